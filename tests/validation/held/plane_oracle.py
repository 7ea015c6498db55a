"""A long rigid object pressed into a layer in plane strain, bonded at its bottom and at two walls.

The section of the object is that of a tip (`tip_outlines`): a circle of radius 1 is a long cylinder, a flat tip is a
punch of half width 1. Solid, contact and continuation are those of the axisymmetric press; half the section is meshed.

Lengths in the section's half width R, stresses in E, forces per length in E R.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from skfem import Basis

from optopad.design.arrays import FloatArray
from tests.validation.contact.contact_reference import contact_edge, sampled_curve
from tests.validation.elements.continuation import Continuation
from tests.validation.elements.hyperelastic import Axisymmetric, Solid
from tests.validation.elements.layer_mesh import Grading, layer_mesh
from tests.validation.elements.press_oracle import Press, _top_of
from tests.validation.elements.tip_outlines import Tip


class Plane(Axisymmetric):
    """F_xx, F_xz, F_zx, F_zz and F_yy = 1 of a long body; volumes are those of a unit of its length."""

    def weight(self, basis: Basis) -> FloatArray:
        """(element, point) volume at rest of the quadrature points."""
        return np.asarray(basis.dx)

    def strain_operator(self, basis: Basis) -> FloatArray:
        """(element, point, 5, 18) derivative of F by the element's displacements."""
        operator = super().strain_operator(basis)
        operator[:, :, 4] = 0.0
        return operator


@dataclass(frozen=True, kw_only=True)
class PlaneState:
    """One converged press.

    Attributes
    ----------
    force, reaction : of the contact and of the bonded faces, along the press; both halves
    edge : half width of the contact, where the top leaves the object
    volume_change : relative to rest
    top : (2, point) deformed top from the middle to the wall
    """

    force: float
    reaction: float
    edge: float
    volume_change: float
    top: FloatArray

    def height(self, x: float) -> float:
        """Of the top at a place beyond the contact."""
        return float(np.interp(x, *self.top))


class PlanePress(Press):
    """A layer under a long object, pressed deeper and deeper."""

    def __init__(
        self, layer: float, wall: float, grading: Grading, poisson_ratio: float, tip: Tip, halvings: int
    ) -> None:
        solid = Solid(layer_mesh(layer, wall, grading, halvings), poisson_ratio, Plane())
        self.tip = tip
        round_top, self.top_nodes = _top_of(solid)
        top = replace(round_top, weight=round_top.weight / (2.0 * np.pi * round_top.rest[..., 0]))
        x, z = solid.nodes
        bonded = np.flatnonzero((z < -layer + 1e-9) | (x > wall - 1e-9))
        fixed = np.concatenate([2 * bonded, 2 * bonded + 1, 2 * np.flatnonzero(x < 1e-9)])
        Continuation.__init__(self, solid, top, fixed, 2 * bonded + 1)

    def state_now(self) -> PlaneState:
        """The present state, solved with the final contact stiffness."""
        self.settle(self.state, self.depth, self.final_penalty)
        traction, _, normal = self.traction()
        curve = (self.solid.nodes.T + self.solid.moved(self.state))[self.top_nodes]
        solid = self.solid.assemble(self.solid_state, False)
        return PlaneState(
            force=float(-2.0 * (self.top.weight * traction * normal[..., 1]).sum()),
            reaction=float(-2.0 * solid.residual[self.held].sum()),
            edge=contact_edge(curve, self.depth, tip=self.tip)[0],
            volume_change=self.solid.volume(self.solid_state) / self.rest_volume - 1.0,
            top=np.stack(sampled_curve(curve, 16)),
        )
