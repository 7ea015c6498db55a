"""Axisymmetric press of a rigid tip into a layer bonded at its bottom and at a cylindrical wall.

Lengths in tip radii R, stresses in E, forces in E R², energies in E R³.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from skfem import ElementQuad2, FacetBasis

from optopad.design.arrays import FloatArray, IntArray
from tests.validation.contact.contact_surface import ContactSurface, GapFunction, facet_nodes
from tests.validation.elements.continuation import Continuation
from tests.validation.elements.hyperelastic import Solid
from tests.validation.elements.layer_mesh import Grading, layer_mesh
from tests.validation.elements.tip_outlines import Tip, sphere_tip

EDGE_QUADRATURE = 7
"""Polynomial order of the contact quadrature: 4 points an edge."""


@dataclass(frozen=True, kw_only=True)
class PressedState:
    """One converged press.

    Attributes
    ----------
    depth : of the apex below the undisturbed surface
    force, reaction : of the contact and of the bonded boundary, both along the axis
    energy : elastic energy
    volume_change : relative to rest
    penetration : largest
    curve : (2 * edges + 1, 2) deformed nodes of the top from the axis to the wall; corner, middle, corner, ...
    contact : (points, 4) radius, height, contact pressure and weight (deformed area) at the contact quadrature
    """

    depth: float
    force: float
    reaction: float
    energy: float
    volume_change: float
    penetration: float
    curve: FloatArray
    contact: FloatArray


class Press(Continuation):
    """A layer under a tip, pressed deeper and deeper."""

    def __init__(
        self,
        layer: float,
        wall: float,
        grading: Grading,
        poisson_ratio: float,
        tip: Tip | None = None,
        halvings: int = 0,
    ) -> None:
        solid = Solid(layer_mesh(layer, wall, grading, halvings), poisson_ratio)
        self.tip = tip or sphere_tip()
        top, self.top_nodes = _top_of(solid)
        r, z = solid.nodes
        bonded = np.flatnonzero((z < -layer + 1e-9) | (r > wall - 1e-9))
        fixed = np.concatenate([2 * bonded, 2 * bonded + 1, 2 * np.flatnonzero(r < 1e-9)])
        super().__init__(solid, top, fixed, 2 * bonded + 1)

    def gap(self, depth: float) -> GapFunction:
        """Distance of points (..., 2) to the tip at a depth, with derivatives."""

        def found(points: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
            gap = self.tip.gap(points[..., 0], points[..., 1], depth)
            along = np.stack([-gap.normal[1], gap.normal[0]], axis=-1)
            bent = gap.curvature[..., None, None] * along[..., :, None] * along[..., None, :]
            return gap.distance, np.moveaxis(gap.normal, 0, -1), bent

        return found

    def read(self) -> PressedState:
        """The present state, solved with the final contact stiffness."""
        self.settle(self.state, self.depth, self.final_penalty)
        traction, distance, normal = self.traction()
        solid = self.solid.assemble(self.solid_state, False)
        points = self.top.points(self.state)
        area = self._area_ratio(points)
        contact = np.concatenate(
            [points, np.stack([traction / area, self.top.weight * area], axis=-1)], axis=-1
        )
        return PressedState(
            depth=self.depth,
            force=float(-(self.top.weight * traction * normal[..., 1]).sum()),
            reaction=float(-solid.residual[self.held].sum()),
            energy=solid.energy,
            volume_change=self.solid.volume(self.solid_state) / self.rest_volume - 1.0,
            penetration=float(np.maximum(-distance, 0.0).max()),
            curve=(self.solid.nodes.T + self.solid.moved(self.state))[self.top_nodes],
            contact=contact.reshape(-1, 4)[np.argsort(self.top.rest[..., 0].ravel())],
        )

    def _area_ratio(self, points: FloatArray) -> FloatArray:
        """(edge, point) deformed over rest area of the top."""
        rest = self.top.rest[..., 0]
        corners = self.solid.nodes.T[self.top.nodes]
        place = (rest - corners[:, :1, 0]) / (corners[:, 2:, 0] - corners[:, :1, 0])
        slope = np.stack([4 * place - 3, 4 - 8 * place, 4 * place - 1], axis=-1)
        moved = np.matmul(slope, corners + self.solid.moved(self.state)[self.top.nodes])
        length = (corners[:, 2, 0] - corners[:, 0, 0])[:, None]
        return np.asarray(np.hypot(moved[..., 0], moved[..., 1]) / length * points[..., 0] / rest)


def _top_of(solid: Solid) -> tuple[ContactSurface, IntArray]:
    """The top as a contact surface, edges from the axis outward, and its nodes in the same order."""
    mesh = solid.mesh
    facets = mesh.facets_satisfying(lambda x: np.abs(x[1]) < 1e-9)
    facets = facets[np.argsort(mesh.p[0, mesh.facets[:, facets]].mean(axis=0))]
    basis = FacetBasis(mesh, ElementQuad2(), facets=facets, intorder=EDGE_QUADRATURE)
    nodes, place = facet_nodes(solid.nodes, basis.element_dofs, np.abs(solid.nodes[1]) < 1e-9)
    rest = np.moveaxis(np.asarray(basis.global_coordinates()), 0, -1)
    values = np.stack([np.broadcast_to(np.asarray(one[0]), rest.shape[:-1]) for one in basis.basis])
    inner, outer = (solid.nodes[0][nodes[:, k]][:, None] for k in (0, 2))
    share = (rest[..., 0] - inner) / (outer - inner)
    corners = solid.size + np.arange(len(facets) + 1)
    top = ContactSurface(
        shape=values[place, np.arange(len(facets))[:, None]].swapaxes(1, 2),
        hats=np.stack([1.0 - share, share], axis=-1),
        weight=basis.dx * 2.0 * np.pi * rest[..., 0],
        rest=rest,
        nodes=nodes,
        multiplier_dofs=np.stack([corners[:-1], corners[1:]], axis=1),
    )
    return top, np.append(nodes[:, :2].ravel(), nodes[-1, 2])


def pressed_states(
    press: Press, depths: Sequence[float], on_step: Callable[[float, int], None] | None = None
) -> Iterator[PressedState]:
    """The states of a press at increasing depths."""
    for depth in depths:
        press.advance(depth, on_step)
        yield press.read()
