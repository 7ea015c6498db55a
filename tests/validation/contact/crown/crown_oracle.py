"""The finite-element oracle on a spherically crowned layer: a rigid tip pressed along the axis at the apex.

The layer is bonded to a flat bottom at z = -H and to a round wall; its untouched top is a sphere of radius Rc,

    z = -s(r),   s(r) = r² κ / (1 + √(1 - κ² r²)),   κ = 1/Rc,

so the thickness at a radius is t(r) = H - s(r). The mesh stays that of a flat layer. It is a chart: the point (r, y)
of the flat layer stands for the rest position (r, Z) with

    Z = -s + y t/H,   ∂Z/∂y = t/H,   ∂Z/∂r = -s' (1 + y/H),
    ∂f/∂Z = f_y H/t,  ∂f/∂R = f_r - f_y (H/t) ∂Z/∂r,   dV = 2π r (t/H) dr dy,   dA = 2π r √(1 + s'²) dr.

The chart is exact (no chords stand for the crown) and smooth. Where the top meets the wall, the layer fills an angle
of 90° and the slope of the crown there, one side bonded and one free: stress is singular, the more the wider the angle,
and elements of one size converge slowly. So elements are halved again and again towards that rim (`RIM_CUTS`).

Solid, contact and continuation are those of `elements`; nothing is shared with MuJoCo or with `optopad.sims.contact`.

Lengths in tip radii R, stresses in E, forces in E R². Left out: what the flat oracle leaves out (friction, viscosity,
gravity).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from skfem import Basis, MeshQuad

from optopad.design.arrays import FloatArray
from tests.validation.elements.continuation import Continuation
from tests.validation.elements.hyperelastic import Axisymmetric, Solid
from tests.validation.elements.layer_mesh import Grading, halved, layer_mesh
from tests.validation.elements.press_oracle import Press, PressedState, _top_of
from tests.validation.elements.tip_outlines import sphere_tip

RIM_CUTS = 5
"""How often the outermost column of the coarsest mesh is halved towards the wall; the uppermost row, once less."""


@dataclass(frozen=True)
class Crown:
    """A spherical top.

    Attributes
    ----------
    curvature : tip radius over the crown's radius; 0 is flat
    """

    curvature: float

    def drop(self, radius: FloatArray) -> FloatArray:
        """(...) how far the untouched top lies below its apex at radii [tip radii]."""
        bent = self.curvature * np.asarray(radius, dtype=np.float64)
        return np.asarray(bent * radius / (1.0 + np.sqrt(1.0 - bent**2)))

    def slope(self, radius: FloatArray) -> FloatArray:
        """(...) derivative of `drop` [-]."""
        bent = self.curvature * np.asarray(radius, dtype=np.float64)
        return np.asarray(bent / np.sqrt(1.0 - bent**2))


class CrownedSolid(Axisymmetric):
    """Kinematics of a body of revolution whose rest shape is that of the chart."""

    def __init__(self, crown: Crown, layer: float) -> None:
        self.crown, self.layer = crown, layer

    def _stretch(self, basis: Basis) -> tuple[FloatArray, FloatArray]:
        """(element, point) derivatives of Z by y and by r."""
        radius, height = basis.global_coordinates()
        thickness = (self.layer - self.crown.drop(radius)) / self.layer
        return thickness, -self.crown.slope(radius) * (1.0 + height / self.layer)

    def weight(self, basis: Basis) -> FloatArray:
        """(element, point) volume at rest of the quadrature points."""
        return np.asarray(super().weight(basis) * self._stretch(basis)[0])

    def strain_operator(self, basis: Basis) -> FloatArray:
        """(element, point, 5, 18) derivative of F by the element's displacements."""
        along, across = (part[:, :, None] for part in self._stretch(basis))
        operator = super().strain_operator(basis)
        for radial, axial in ((0, 1), (2, 3)):
            operator[:, :, axial] /= along
            operator[:, :, radial] -= across * operator[:, :, axial]
        return operator


def _cut(ticks: FloatArray, times: int) -> FloatArray:
    """Increasing coordinates with the last interval cut in halves towards its end."""
    length = ticks[-1] - ticks[-2]
    return np.concatenate([ticks[:-1], ticks[-1] - length * 0.5 ** np.arange(1, times + 1), ticks[-1:]])


def rim_mesh(layer: float, wall: float, grading: Grading, halvings: int) -> MeshQuad:
    """The flat layer's mesh, finer towards the rim; parameters are those of `layer_mesh`."""
    radii, heights = (np.unique(np.round(axis, 12)) for axis in layer_mesh(layer, wall, grading).p)
    radii, heights = _cut(radii, RIM_CUTS), _cut(heights, RIM_CUTS - 1)
    for _ in range(halvings):
        radii, heights = halved(radii), halved(heights)
    return MeshQuad.init_tensor(radii, heights)


class CrownedPress(Press):
    """A crowned layer under a hemisphere of radius 1, pressed deeper and deeper at its apex.

    Parameters
    ----------
    layer, wall : thickness at the apex, radius of the bonded wall [tip radii]
    curvature : tip radius over the crown's radius
    grading, halvings : coarsest mesh, how often it is halved
    poisson_ratio : of the layer
    """

    def __init__(
        self,
        layer: float,
        wall: float,
        curvature: float,
        grading: Grading,
        poisson_ratio: float,
        halvings: int = 0,
    ) -> None:
        self.crown = Crown(curvature)
        assert self.crown.drop(np.array(wall)) < layer, "the crown meets the bottom"
        solid = Solid(
            rim_mesh(layer, wall, grading, halvings), poisson_ratio, CrownedSolid(self.crown, layer)
        )
        self.tip = sphere_tip()
        top, self.top_nodes = _top_of(solid)
        radius = top.rest[..., 0]
        lowered = top.rest.copy()
        lowered[..., 1] -= self.crown.drop(radius)
        top = replace(top, rest=lowered, weight=top.weight * np.sqrt(1.0 + self.crown.slope(radius) ** 2))
        r, z = solid.nodes
        bonded = np.flatnonzero((z < -layer + 1e-9) | (r > wall - 1e-9))
        fixed = np.concatenate([2 * bonded, 2 * bonded + 1, 2 * np.flatnonzero(r < 1e-9)])
        Continuation.__init__(self, solid, top, fixed, 2 * bonded + 1)

    @property
    def rest_radii(self) -> FloatArray:
        """(2 * edges + 1,) radius at rest of the nodes of `PressedState.curve`."""
        return np.asarray(self.solid.nodes[0][self.top_nodes])

    def read(self) -> PressedState:
        """The present state; its curve lies where the deformed top does, below the apex at 0."""
        state = super().read()
        lowered = np.stack([np.zeros_like(self.rest_radii), -self.crown.drop(self.rest_radii)], axis=1)
        return replace(state, curve=state.curve + lowered)

    def _area_ratio(self, points: FloatArray) -> FloatArray:
        """(edge, point) deformed over rest area of the top."""
        rest = self.top.rest[..., 0]
        corners = self.solid.nodes[0][self.top.nodes]
        length = (corners[:, 2] - corners[:, 0])[:, None]
        place = (rest - corners[:, :1]) / length
        slope = np.stack([4 * place - 3, 4 - 8 * place, 4 * place - 1], axis=-1)
        moved = np.matmul(slope, self.solid.moved(self.state)[self.top.nodes]) / length[..., None]
        steep = self.crown.slope(rest)
        stretched = np.hypot(1.0 + moved[..., 0], moved[..., 1] - steep)
        return np.asarray(stretched / np.sqrt(1.0 + steep**2) * points[..., 0] / rest)
