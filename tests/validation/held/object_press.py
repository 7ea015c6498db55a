"""A rigid object pressed into a rectangular pad bonded at its floor and walls: a quarter, in three dimensions.

The planes x = 0 and y = 0 through the middle of the pad and of the object are planes of symmetry (`tips_truth` has
others). Solid, contact and
continuation are those of the block under a tip (`block_oracle`); the mesh is fine where the object's edges press.

Lengths in mm, stresses in E, forces in E mm².
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import permutations

import numpy as np
from skfem import MeshHex

from optopad.design.arrays import FloatArray
from tests.validation.contact.contact_reference import leaving_edge, sampled_curve
from tests.validation.contact.contact_surface import GapFunction
from tests.validation.contact.crown.offset_oracle import SOFTER
from tests.validation.elements.block_oracle import BlockPress, _top_of
from tests.validation.elements.continuation import Continuation
from tests.validation.elements.hyperelastic import Solid, Spatial
from tests.validation.elements.layer_mesh import graded
from tests.validation.elements.newton import MOST_ITERATIONS, OracleError
from tests.validation.held.rounded_objects import Distance, RigidObject

WINDOW_MM = 0.8
"""Arc beside the contact in which the gap locates its edge."""
TOUCHING_MM = 0.01
"""Gap below which the top may touch; coarse faces wave by less."""
REACH_MM = 8.0
"""Half width of the square in which the top may touch."""


@dataclass(frozen=True, kw_only=True)
class AxisGrading:
    """Sizes of the elements along an axis.

    Attributes
    ----------
    focus_mm : where they are finest
    size_mm, fine_mm : the finest, and how far they reach to both sides
    growth, largest_mm : ratio of neighbours beyond, bound
    """

    focus_mm: float
    size_mm: float
    fine_mm: float
    growth: float = 1.6
    largest_mm: float = 3.0

    def ticks(self, length_mm: float, coarser: float) -> FloatArray:
        """Coordinates from 0 to a length; all sizes are multiplied by `coarser`."""

        def side(length: float) -> FloatArray:
            return graded(
                length, self.fine_mm, coarser * self.size_mm, self.growth, coarser * self.largest_mm
            )

        below, above = side(self.focus_mm), side(length_mm - self.focus_mm)
        return np.concatenate([self.focus_mm - below[:0:-1], self.focus_mm + above])


@dataclass(frozen=True, kw_only=True)
class ObjectState:
    """One converged press.

    Attributes
    ----------
    force, reaction : along z, of the contact and of the bonded faces; of the whole pad
    area : of the contact, seen from above
    penetration : largest
    along : of each way (`ObjectPress.ways`): (2, point) distance from the object's axis and height of the deformed top
    edge : of each way: where the top leaves the object
    """

    force: float
    reaction: float
    area: float
    penetration: float
    along: tuple[FloatArray, ...]
    edge: tuple[float, ...]

    def height(self, way: int, place: float) -> float:
        """Of the top at a place along a way, beyond the contact."""
        return float(np.interp(place, *self.along[way]))


class ObjectPress(BlockPress):
    """A quarter of a pad under an object, pressed deeper and deeper."""

    largest_step = 0.25
    """Largest depth step [mm]."""
    copies = 4
    ways: Mapping[str, tuple[int, int]] = {"x": (0, 1), "y": (1, 1)}
    """Lines over the top from the object's axis: axis and sign."""

    def __init__(
        self,
        thing: RigidObject,
        ticks: tuple[FloatArray, ...],
        poisson_ratio: float,
        penalty: float,
        mirrors: tuple[int, ...] = (0, 1),
    ) -> None:
        """A pad from the first to the last tick, which has its planes of symmetry at the first one of some axes."""
        self.thing, self.penalty = thing, penalty
        solid = Solid(MeshHex.init_tensor(ticks[0], ticks[1], -ticks[2][::-1]), poisson_ratio, Spatial())
        x, y, z = solid.nodes
        near, far = ([axis[end] for axis in ticks] for end in (0, -1))
        is_held = (x > far[0] - 1e-9) | (y > far[1] - 1e-9) | (z < 1e-9 - far[2])
        mirrored = []
        for axis in (0, 1):
            is_near = solid.nodes[axis] < near[axis] + 1e-9
            if axis in mirrors:
                mirrored.append(3 * np.flatnonzero(is_near) + axis)
            else:
                is_held |= is_near
        held = np.flatnonzero(is_held)
        self.top_nodes = np.flatnonzero(np.abs(z) < 1e-9)
        fixed = np.concatenate([(3 * held[:, None] + np.arange(3)).ravel(), *mirrored])
        Continuation.__init__(self, solid, _top_of(solid, REACH_MM), fixed, 3 * held + 2)

    def gap(self, depth: float) -> GapFunction:
        """Distance of points (..., 3) to the object at a depth, with derivatives."""

        def found(points: FloatArray) -> Distance:
            return self.thing.distance(points + np.array([0.0, 0.0, depth]))

        return found

    def _solve(
        self, guess: FloatArray, depth: float, penalty: float, patience: int = MOST_ITERATIONS
    ) -> tuple[FloatArray, int]:
        """Equilibrium at a depth; where contact does not settle, with a softer contact.

        The mean gap vanishes whatever the stiffness is.
        """
        for share in SOFTER:
            try:
                found = super()._solve(guess, depth, share * penalty, patience)
            except RuntimeError:
                continue
            self.final_penalty = share * penalty
            return found
        raise OracleError(f"depth {depth:g}: no state found near the guess")

    def settle(self, guess: FloatArray, depth: float, penalty: float) -> None:
        """Take the equilibrium at a depth near a guess."""
        self.state, _ = self._solve(guess, depth, penalty)
        self.depth = depth

    def state_now(self) -> ObjectState:
        """The present state, solved with the final contact stiffness."""
        read = self.read()
        traction, _, _ = self.traction()
        touched = self._flat_area()[traction > 0.0]
        along = tuple(self._line(read.top, *way) for way in self.ways.values())
        return ObjectState(
            force=read.force,
            reaction=read.reaction,
            area=float(self.copies * touched.sum()),
            penetration=read.penetration,
            along=along,
            edge=tuple(self._edge(*one) for one in zip(along, self.ways.values(), strict=True)),
        )

    def _line(self, top: FloatArray, axis: int, sign: int) -> FloatArray:
        """(2, point) the deformed top along a way, from the object's axis to the wall or the plane of symmetry."""
        rest = self.solid.nodes[:, self.top_nodes]
        ticks = np.unique(np.round(rest[1 - axis], 9))
        across = ticks[np.argsort(np.abs(ticks))[: 1 if ticks[0] == 0.0 else 3]]
        found = []
        for tick in across:  # with an object beside, the nodes over the way have moved off it
            on = np.flatnonzero((np.abs(rest[1 - axis] - tick) < 1e-9) & (sign * rest[axis] > -1e-9))
            found.append(top[on[np.argsort(sign * rest[axis, on])]])
        lines = np.stack(found)
        weight = np.ones(lines.shape[:2])
        for one, other in permutations(range(len(across)), 2):
            away = lines[other, :, 1 - axis]
            weight[one] *= away / (away - lines[one, :, 1 - axis])
        line = (weight[..., None] * lines[..., [axis, 2]]).sum(axis=0)
        return np.stack(sampled_curve(line * (sign, 1.0), 16))

    def _edge(self, line: FloatArray, way: tuple[int, int]) -> float:
        """Where such a line leaves the object."""
        points = np.zeros((line.shape[1], 3))
        points[:, [way[0], 2]] = line.T * (way[1], 1.0)
        gap = self.gap(self.depth)(points)[0]
        return leaving_edge(*line, gap, WINDOW_MM, TOUCHING_MM)[0]

    def _flat_area(self) -> FloatArray:
        """(face, point) area that the points of the contact quadrature cover, seen from above."""

        def powers(place: FloatArray, order: tuple[int, int]) -> FloatArray:
            """(..., 9) derivatives of x^i y^j, i and j to 2."""
            sides = []
            for one, slope in zip(np.moveaxis(place, -1, 0), order, strict=True):
                plain, bent = np.stack([one**0, one, one**2], -1), np.stack([0 * one, one**0, 2 * one], -1)
                sides.append(bent if slope else plain)
            return (sides[0][..., :, None] * sides[1][..., None, :]).reshape(*place.shape[:-1], 9)

        nodes = np.moveaxis(self.solid.nodes[:2][:, self.top.nodes], 0, -1)
        middle = nodes.mean(axis=1, keepdims=True)
        moved = (self.solid.nodes.T + self.solid.moved(self.state))[self.top.nodes][..., :2]
        factors = np.linalg.solve(powers(nodes - middle, (0, 0)), moved)
        by_x, by_y = (powers(self.top.rest[..., :2] - middle, order) @ factors for order in ((1, 0), (0, 1)))
        return np.asarray(self.top.weight * (by_x[..., 0] * by_y[..., 1] - by_x[..., 1] * by_y[..., 0]))
