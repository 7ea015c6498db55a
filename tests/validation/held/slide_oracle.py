"""A rigid object pressed into a layer and then moved sideways with friction: plane strain, the whole section.

The object is pressed to a depth, with or without friction, then moved along x at that depth in steps. Solid and normal
contact are those of the press; friction is that of `friction`.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csc_matrix
from skfem import MeshQuad

from optopad.design.arrays import BoolArray, FloatArray, IntArray
from tests.validation.contact.contact_reference import TOUCHING_GAP, leaving_edge, sampled_curve
from tests.validation.contact.contact_surface import ContactSurface, GapFunction
from tests.validation.elements.continuation import Continuation
from tests.validation.elements.hyperelastic import Solid
from tests.validation.elements.layer_mesh import Grading, layer_mesh
from tests.validation.elements.newton import OracleError
from tests.validation.elements.press_oracle import _top_of
from tests.validation.elements.tip_outlines import Tip
from tests.validation.held.friction import Past, Sliding
from tests.validation.held.plane_oracle import Plane

STUCK = 1e6
"""Coefficient of friction at which nothing slips."""
MOST_ROUNDS = 16
"""Newton iterations with friction; more mean that points cycle between stick and slip."""


class Slide(Continuation):
    """A press whose object also moves sideways.

    Attributes
    ----------
    friction : Coulomb's coefficient from the next step on [-]
    shear : how far the object has moved along x
    past : the last state with friction
    work : work of the object on the pad along x since the press
    way : last step along x
    drift : change of the state over the way of the last step
    """

    friction = 0.0
    copies = 1
    """Parts like the meshed one that the whole pad has."""
    window, touching = 0.1, TOUCHING_GAP
    """As of `leaving_edge`."""
    shear_step = 0.02
    """Largest step along x."""
    stiffness = 1000.0
    """Stiffness k of the friction [E / unit]."""

    def __init__(self, solid: Solid, top: ContactSurface, fixed: IntArray, held: IntArray) -> None:
        super().__init__(solid, top, fixed, held)
        self.shear = self.work = self.way = 0.0
        self.drift = np.zeros_like(self.state)
        self.remember()

    def place(self, depth: float) -> FloatArray:
        """(dimension,) displacement of the object."""
        found = np.zeros(len(self.solid.nodes))
        found[0], found[-1] = self.shear, -depth
        return found

    def remember(self, traction: FloatArray | None = None) -> None:
        """Take the present state for the last one."""
        points = self.top.points(self.state)
        self.past = Past(
            points=points,
            traction=np.zeros_like(points) if traction is None else traction,
            place=self.place(self.depth),
        )

    def rubbed(self, depth: float, penalty: float) -> Sliding:
        """The friction since the last state."""
        return Sliding(
            top=self.top,
            gap=self.gap(depth),
            penalty=penalty,
            stiffness=self.stiffness,
            past=self.past,
            place=self.place(depth),
            friction=self.friction,
        )

    def _assemble(self, state: FloatArray, depth: float, penalty: float) -> tuple[FloatArray, csc_matrix]:
        residual, tangent = super()._assemble(state, depth, penalty)
        if self.friction == 0.0:
            return residual, tangent
        rubbing, by_rubbing = self.rubbed(depth, penalty).assemble(state)
        return residual + rubbing, (tangent + by_rubbing).tocsc()

    def kept(self) -> None:
        """The step is done: its traction is the past of the next one."""
        self.remember(self.rubbed(self.depth, self.penalty).traction(self.state)[0])

    def slide(self, to: float) -> None:
        """Move the object along x, at its depth."""
        step, sign = self.shear_step, float(np.sign(to - self.shear))
        if sign * self.way <= 0.0 and sign != 0.0:
            self.drift = self._stuck(sign)
        while abs(to - self.shear) > 1e-12:
            here, pull = self.shear, self.forces()[0]
            share = min(step, abs(to - here))
            self.shear = here + sign * share
            try:
                guess = self.state + share * self.drift
                state, count = self._solve(guess, self.depth, self.penalty, MOST_ROUNDS)
            except RuntimeError:
                self.shear, step = here, 0.5 * share
                if step < 1e-3 * self.shear_step:
                    raise OracleError(f"shear {here:g}: no state found") from None
                continue
            self.drift, self.state, self.way = (state - self.state) / share, state, self.shear - here
            self.kept()
            self.work += 0.5 * (pull + self.forces()[0]) * (self.shear - here)
            step = min(self.shear_step, share * (1.5 if count <= 8 else 0.8))

    def _stuck(self, sign: float) -> FloatArray:
        """Change of the state over the way at the start, when next to nothing slips yet."""
        friction, here, way = self.friction, self.shear, 0.01 * self.shear_step
        self.friction, self.shear = STUCK, here + sign * way
        state, _ = self._solve(self.state, self.depth, self.penalty)
        self.friction, self.shear = friction, here
        return np.asarray((state - self.state) / way)

    def forces(self) -> FloatArray:
        """(dimension,) force of the object on what is meshed of the pad."""
        traction, _, normal = self.traction()
        both = traction[..., None] * normal - self.past.traction
        return np.asarray((self.top.weight[..., None] * both).sum(axis=(0, 1)))

    def contact(self) -> tuple[BoolArray, BoolArray]:
        """(f, q) whether points touch, and whether they slip."""
        traction, _, _ = self.traction()
        used = np.linalg.norm(self.past.traction, axis=-1)
        touches = traction > 0.0
        return touches, touches & (used >= (1.0 - 1e-9) * self.friction * traction)

    @abstractmethod
    def lines(self) -> dict[str, FloatArray]:
        """As of `SlideState`."""

    def state_now(self) -> SlideState:
        """The present state."""
        forces, (touches, slips), lines = self.copies * self.forces(), self.contact(), self.lines()
        x, z = lines["along"]
        points = np.zeros((len(x), len(self.solid.nodes)))
        points[:, 0], points[:, -1] = x, z
        gap, ends = self.gap(self.depth)(points)[0], []
        for way in (slice(None, None, -1), slice(None)):
            ends.append(leaving_edge(x[way], z[way], gap[way], self.window, self.touching)[0])
        return SlideState(
            force=float(-forces[-1]),
            pull=float(forces[0]),
            slip_share=float(self.top.weight[slips].sum() / self.top.weight[touches].sum()),
            edges=(ends[0], ends[1]),
            lines=lines,
        )


@dataclass(frozen=True, kw_only=True)
class SlideState:
    """One state of a slide, in the units of the press.

    Attributes
    ----------
    force, pull : of the object on the whole pad, into it and along x; in plane strain per length
    slip_share : share of the contact's area at rest that slips
    edges : x of the ends of the contact, in the middle plane
    lines : "along" x in the middle plane, and of a short object "across", along y at the object's place: (2, point)
        places and heights of the deformed top
    """

    force: float
    pull: float
    slip_share: float
    edges: tuple[float, float]
    lines: dict[str, FloatArray]


class PlaneSlide(Slide):
    """A whole section under a long object."""

    penalty = final_penalty = 1000.0

    def __init__(
        self, layer: float, wall: float, grading: Grading, poisson_ratio: float, tip: Tip, halvings: int
    ) -> None:
        half = layer_mesh(layer, wall, grading, halvings)
        x, z = (np.unique(np.round(ticks, 9)) for ticks in half.p)
        solid = Solid(MeshQuad.init_tensor(np.concatenate([-x[:0:-1], x]), z), poisson_ratio, Plane())
        self.tip = tip
        round_top, self.top_nodes = _top_of(solid)
        top = replace(round_top, weight=round_top.weight / (2.0 * np.pi * round_top.rest[..., 0]))
        x, z = solid.nodes
        bonded = np.flatnonzero((z < -layer + 1e-9) | (np.abs(x) > wall - 1e-9))
        super().__init__(solid, top, np.concatenate([2 * bonded, 2 * bonded + 1]), 2 * bonded + 1)

    def gap(self, depth: float) -> GapFunction:
        """Distance of points (..., 2) to the object at a depth and its place along x, with derivatives."""
        shear = self.shear

        def found(points: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
            x = points[..., 0] - shear
            gap = self.tip.gap(np.abs(x), points[..., 1], depth)
            normal = np.stack([np.where(x < 0.0, -1.0, 1.0) * gap.normal[0], gap.normal[1]], axis=-1)
            along = np.stack([-normal[..., 1], normal[..., 0]], axis=-1)
            bent = gap.curvature[..., None, None] * along[..., :, None] * along[..., None, :]
            return gap.distance, normal, bent

        return found

    def lines(self) -> dict[str, FloatArray]:
        """The deformed top."""
        curve = (self.solid.nodes.T + self.solid.moved(self.state))[self.top_nodes]
        return {"along": np.stack(sampled_curve(curve, 16))}
