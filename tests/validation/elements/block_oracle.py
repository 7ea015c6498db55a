"""A tip pressed into a rectangular block bonded at its bottom and at its four walls, in three dimensions.

The same solid and contact as the axisymmetric press (`hyperelastic`, `contact_surface`) on hexahedra with
triquadratic displacement and trilinear pressure. A plane of symmetry y = 0 halves the block where the walls allow it.
Meshes that three dimensions can afford are coarse: use differences between blocks that share the mesh
around the tip, and judge them by a halved mesh.

Lengths in tip radii R, stresses in E, forces in E R². The axis of the tip is x = y = 0, the free top z = 0.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from skfem import ElementHex2, FacetBasis, MeshHex

from optopad.design.arrays import FloatArray, IntArray
from tests.validation.contact.contact_surface import ContactSurface, GapFunction, facet_nodes
from tests.validation.elements.continuation import Continuation
from tests.validation.elements.hyperelastic import Solid, Spatial
from tests.validation.elements.layer_mesh import graded, halved
from tests.validation.elements.tip_outlines import Tip, sphere_tip

Walls = tuple[float, float, float, float]
"""Distances of the walls at -x, +x, -y, +y from the axis; the third is 0 where y = 0 is a plane of symmetry."""

FACE_QUADRATURE = 5
"""Polynomial order of the contact quadrature: 3 x 3 points a face."""


@dataclass(frozen=True, kw_only=True)
class BlockGrading:
    """Sizes of the elements of a block.

    Attributes
    ----------
    size : around the tip
    fine_radius, fine_depth : extent of that size
    growth : ratio of neighbouring sizes beyond
    largest : bound of the size
    """

    size: float = 0.6
    fine_radius: float = 1.2
    fine_depth: float = 0.6
    growth: float = 1.5
    largest: float = 2.0


@dataclass(frozen=True, kw_only=True)
class BlockState:
    """One converged press.

    Attributes
    ----------
    depth : of the apex
    force, reaction : of the contact and of the bonded faces, along the axis; of the whole block
    penetration : largest
    top : (node, 3) deformed nodes of the top
    """

    depth: float
    force: float
    reaction: float
    penetration: float
    top: FloatArray


def block_mesh(layer: float, walls: Walls, grading: BlockGrading, halvings: int) -> MeshHex:
    """Mesh of a block, even around the axis and the same for every block that reaches beyond the fine zone."""

    def side(distance: float) -> FloatArray:
        return graded(distance, grading.fine_radius, grading.size, grading.growth, grading.largest)

    def across(low: float, high: float) -> FloatArray:
        return np.unique(np.concatenate([-side(low) if low > 0.0 else [0.0], side(high)]))

    depths = graded(layer, grading.fine_depth, grading.size, grading.growth, grading.largest)
    axes = [across(walls[0], walls[1]), across(walls[2], walls[3]), -depths[::-1]]
    for _ in range(halvings):
        axes = [halved(ticks) for ticks in axes]
    return MeshHex.init_tensor(*axes)


class BlockPress(Continuation):
    """A block under a tip, pressed deeper and deeper."""

    largest_step = 0.12
    """Largest depth step [tip radii]; coarse meshes take larger ones."""
    penalty = final_penalty = 300.0
    """Contact stiffness [E / R]; on coarse faces touching points cycle with stiffer ones."""

    def __init__(
        self,
        layer: float,
        walls: Walls,
        grading: BlockGrading,
        poisson_ratio: float,
        halvings: int = 0,
        tip: Tip | None = None,
    ) -> None:
        solid = Solid(block_mesh(layer, walls, grading, halvings), poisson_ratio, Spatial())
        self.tip = tip or sphere_tip()
        self.copies = 2 if walls[2] == 0.0 else 1
        x, y, z = solid.nodes
        bonded = (z < -layer + 1e-9) | (x < 1e-9 - walls[0]) | (x > walls[1] - 1e-9) | (y > walls[3] - 1e-9)
        if self.copies == 1:
            bonded |= y < 1e-9 - walls[2]
        held = np.flatnonzero(bonded)
        fixed = (3 * held[:, None] + np.arange(3)).ravel()
        if self.copies == 2:
            fixed = np.concatenate([fixed, 3 * np.flatnonzero(np.abs(y) < 1e-9) + 1])
        self.top_nodes = np.flatnonzero(np.abs(z) < 1e-9)
        super().__init__(solid, _top_of(solid, grading.fine_radius), fixed, 3 * held + 2)

    def gap(self, depth: float) -> GapFunction:
        """Distance of points (..., 3) to the tip at a depth, with derivatives."""

        def found(points: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
            x, y, z = np.moveaxis(points, -1, 0)
            radius = np.hypot(x, y)
            gap = self.tip.gap(radius, z, depth)
            safe = np.maximum(radius, 1e-9)
            out = np.stack([x / safe, y / safe, np.zeros_like(x)], axis=-1)
            up, around = np.array([0.0, 0.0, 1.0]), np.stack([-y / safe, x / safe, np.zeros_like(x)], axis=-1)
            normal = gap.normal[0][..., None] * out + gap.normal[1][..., None] * up
            along = -gap.normal[1][..., None] * out + gap.normal[0][..., None] * up
            hoop = np.where(radius > 1e-6, gap.normal[0] / safe, gap.curvature)
            bent = gap.curvature[..., None, None] * along[..., :, None] * along[..., None, :]
            return (
                gap.distance,
                normal,
                bent + hoop[..., None, None] * around[..., :, None] * around[..., None, :],
            )

        return found

    def read(self) -> BlockState:
        """The present state, solved with the final contact stiffness."""
        self.settle(self.state, self.depth, self.final_penalty)
        traction, distance, normal = self.traction()
        solid = self.solid.assemble(self.solid_state, False)
        return BlockState(
            depth=self.depth,
            force=float(-self.copies * (self.top.weight * traction * normal[..., 2]).sum()),
            reaction=float(-self.copies * solid.residual[self.held].sum()),
            penetration=float(np.maximum(-distance, 0.0).max()),
            top=(self.solid.nodes.T + self.solid.moved(self.state))[self.top_nodes],
        )


def _top_of(solid: Solid, reach: float) -> ContactSurface:
    """The faces of the top that may touch: those within a square of half width `reach` around the axis."""
    mesh = solid.mesh
    middles = mesh.p[:, mesh.facets].mean(axis=1)
    near = (np.abs(middles[2]) < 1e-9) & (np.abs(middles[:2]).max(axis=0) < reach)
    facets = np.flatnonzero(near)
    basis = FacetBasis(mesh, ElementHex2(), facets=facets, intorder=FACE_QUADRATURE)
    is_top = np.abs(solid.nodes[2]) < 1e-9
    nodes, place = facet_nodes(solid.nodes, basis.element_dofs, is_top)
    rest = np.moveaxis(np.asarray(basis.global_coordinates()), 0, -1)
    values = np.stack([np.broadcast_to(np.asarray(one[0]), rest.shape[:-1]) for one in basis.basis])
    corners, hats = _bilinear(mesh.p[:, mesh.facets[:, facets]], rest)
    numbers = mesh.facets[:, facets].T[np.arange(len(facets))[:, None], corners]
    _, multiplier = np.unique(numbers, return_inverse=True)
    return ContactSurface(
        shape=values[place, np.arange(len(facets))[:, None]].swapaxes(1, 2),
        hats=hats,
        weight=np.asarray(basis.dx),
        rest=rest,
        nodes=nodes,
        multiplier_dofs=solid.size + multiplier.reshape(numbers.shape),
    )


def _bilinear(corners: FloatArray, points: FloatArray) -> tuple[IntArray, FloatArray]:
    """Order of the corners of axis-parallel faces, (3, 4, face), and bilinear hats (face, point, 4) in that order."""
    x, y = corners[:2]
    order = np.array([np.lexsort((y[:, face], x[:, face])) for face in range(x.shape[1])])
    low, high = corners[:2].min(axis=1), corners[:2].max(axis=1)
    share = (points[..., :2] - low.T[:, None]) / (high - low).T[:, None]
    s, t = share[..., 0], share[..., 1]
    return order, np.stack([(1 - s) * (1 - t), (1 - s) * t, s * (1 - t), s * t], axis=-1)
