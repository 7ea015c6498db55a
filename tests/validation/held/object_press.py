"""A rigid object pressed into a rectangular pad bonded at its floor and walls: a quarter, in three dimensions.

The planes x = 0 and y = 0 through the middle of the pad and of the object are planes of symmetry. Solid, contact and
continuation are those of the block under a tip (`block_oracle`); the mesh is fine where the object's edges press.

Lengths in mm, stresses in E, forces in E mm².
"""

from __future__ import annotations

from dataclasses import dataclass

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
    along : of x and y: (2, point) distance from the middle and height of the deformed top along this axis
    edge : of x and y: where the top leaves the object along this axis
    """

    force: float
    reaction: float
    area: float
    penetration: float
    along: tuple[FloatArray, FloatArray]
    edge: tuple[float, float]

    def height(self, axis: int, place: float) -> float:
        """Of the top at a place along an axis, beyond the contact."""
        return float(np.interp(place, *self.along[axis]))


class ObjectPress(BlockPress):
    """A quarter of a pad under an object, pressed deeper and deeper."""

    largest_step = 0.25
    """Largest depth step [mm]."""
    copies = 4

    def __init__(
        self, thing: RigidObject, ticks: tuple[FloatArray, ...], poisson_ratio: float, penalty: float
    ) -> None:
        self.thing, self.penalty = thing, penalty
        solid = Solid(MeshHex.init_tensor(ticks[0], ticks[1], -ticks[2][::-1]), poisson_ratio, Spatial())
        x, y, z = solid.nodes
        far = [axis[-1] - 1e-9 for axis in ticks]
        held = np.flatnonzero((x > far[0]) | (y > far[1]) | (z < -far[2]))
        mirrored = [3 * np.flatnonzero(solid.nodes[axis] < 1e-9) + axis for axis in (0, 1)]
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
        along = self._line(read.top, 0), self._line(read.top, 1)
        return ObjectState(
            force=read.force,
            reaction=read.reaction,
            area=float(self.copies * touched.sum()),
            penetration=read.penetration,
            along=along,
            edge=(self._edge(along[0], 0), self._edge(along[1], 1)),
        )

    def _line(self, top: FloatArray, axis: int) -> FloatArray:
        """(2, point) the deformed top along x or y, from the middle to the wall."""
        rest = self.solid.nodes[:, self.top_nodes]
        on = np.flatnonzero(rest[1 - axis] < 1e-9)
        on = on[np.argsort(rest[axis, on])]
        return np.stack(sampled_curve(top[on][:, [axis, 2]], 16))

    def _edge(self, line: FloatArray, axis: int) -> float:
        """Where such a line leaves the object."""
        points = np.zeros((line.shape[1], 3))
        points[:, [axis, 2]] = line.T
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
