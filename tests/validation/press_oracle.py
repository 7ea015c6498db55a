"""Frictionless press of a rigid tip into the oracle's layer: augmented Lagrangian contact, Newton, continuation.

Contact adds to the energy of the solid, at quadrature points of the top edge (rest area dA = 2πr dr),

    C(u, t) = ∫ [ <t - k g>² - t² ] / (2k) dA,     g = signed distance of the deformed point to the tip,

with <x> = max(x, 0), penalty k and multiplier t (Alart and Curnier, Comput. Methods Appl. Mech. Eng. 92, 1991).
Minimal in u and maximal in t: inside the contact the mean gap vanishes, outside t does, whatever k is. <t - k g>
is the contact force per rest area; over the ratio of deformed to rest area it is the contact pressure.
t is continuous and linear along each edge, an order less than u, which satisfies the inf-sup condition;
multipliers at the quadrature points do not, and their pressure oscillates from edge to edge.

u, p and t are found together by Newton's method, started from the secant of the last two depths; a
depth step that does not converge is halved. (Updating t between solutions, after Uzawa, diverges beyond depth
1.6 R in a layer of 8/3 R: the layer under the free load t has a negative stiffness there, larger than k.)

Lengths in tip radii R, stresses in E, forces in E R², energies in E R³.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csc_matrix
from skfem import ElementQuad2, FacetBasis

from tests.validation.hyperelastic import FloatArray, Solid, scattered
from tests.validation.layer_mesh import Grading, layer_mesh
from tests.validation.newton import OracleError, solve_newton
from tests.validation.tip_outlines import Tip, sphere_tip

PENALTY = 1000.0
"""Contact stiffness k on the way [E / R]."""
FINAL_PENALTY = 3000.0
"""Contact stiffness k of a state that is read: smaller gaps at the contact edge, slower on the way [E / R]."""
LADDERS = ((1.0,), (0.5, 0.7, 1.0), (0.3, 0.2, 0.1, 0.03, 0.1, 0.2, 0.3, 0.5, 0.7, 1.0))
"""Shares of the contact stiffness through which a state is sought, tried in turn: the set of touching points
may cycle for one stiffness and not for another [-]."""
LARGEST_STEP = 0.05
SMALLEST_STEP = 1e-3
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


class Press:
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
        self.solid = Solid(layer_mesh(layer, wall, grading, halvings), poisson_ratio)
        self.tip = tip or sphere_tip()
        self._lower_top()
        nodes = self.solid.nodes
        bonded = np.flatnonzero((nodes[1] < -layer + 1e-9) | (nodes[0] > wall - 1e-9))
        axis = np.flatnonzero(nodes[0] < 1e-9)
        fixed = np.concatenate([2 * bonded, 2 * bonded + 1, 2 * axis])
        self.bonded_vertical = 2 * bonded + 1
        self.size = self.solid.size + len(self.edge_nodes) + 1
        self.free = np.setdiff1d(np.arange(self.size), fixed)
        self.state = np.zeros(self.size)
        self.depth = 0.0
        self.slope = np.zeros(self.size)
        self.rest_volume = self.solid.volume(self.state[: self.solid.size])

    def _lower_top(self) -> None:
        """Shape values, slopes, weights and unknowns of the top's edges, from the axis outward."""
        mesh = self.solid.mesh
        facets = mesh.facets_satisfying(lambda x: np.abs(x[1]) < 1e-9)
        facets = facets[np.argsort(mesh.p[0, mesh.facets[:, facets]].mean(axis=0))]
        basis = FacetBasis(mesh, ElementQuad2(), facets=facets, intorder=EDGE_QUADRATURE)
        radius = basis.global_coordinates()[0]
        nodes = basis.element_dofs.T
        on_top = np.abs(self.solid.nodes[1][nodes]) < 1e-9
        kept = np.array([row[flags] for row, flags in zip(nodes, on_top, strict=True)])
        order = np.argsort(self.solid.nodes[0][kept], axis=1)
        pick = np.array([np.flatnonzero(flags)[o] for flags, o in zip(on_top, order, strict=True)])
        self.edge_nodes = np.take_along_axis(nodes, pick, axis=1)
        shapes = np.stack([np.broadcast_to(np.asarray(one[0]), radius.shape) for one in basis.basis])
        slopes = np.stack([one[0].grad[0] for one in basis.basis])
        rows = np.arange(len(facets))[:, None]
        self.edge_shape: FloatArray = shapes[pick, rows].transpose(0, 2, 1)
        self.edge_slope: FloatArray = slopes[pick, rows].transpose(0, 2, 1)
        self.edge_radius: FloatArray = radius
        self.edge_weight: FloatArray = basis.dx * 2.0 * np.pi * radius
        dofs = np.stack([2 * self.edge_nodes, 2 * self.edge_nodes + 1], axis=-1)
        self.edge_dofs = dofs.reshape(len(facets), 6)
        self.hats = self._corner_hats(radius)
        self.top_nodes = np.append(self.edge_nodes[:, :2].ravel(), self.edge_nodes[-1, 2])

    def _corner_hats(self, radius: FloatArray) -> FloatArray:
        """(edge, point, 2) linear shape functions of the two corners of every edge."""
        inner, outer = (self.solid.nodes[0][self.edge_nodes[:, k]][:, None] for k in (0, 2))
        share = (radius - inner) / (outer - inner)
        corners = np.arange(len(radius) + 1)
        self.multiplier_dofs = self.solid.size + np.stack([corners[:-1], corners[1:]], axis=1)
        return np.stack([1.0 - share, share], axis=-1)

    def _multiplier(self, state: FloatArray) -> FloatArray:
        """(edge, point) multiplier at the contact quadrature."""
        return np.matmul(self.hats, state[self.multiplier_dofs][..., None])[..., 0]

    def _edge_points(self, state: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(edge, point) deformed radius and height of the contact quadrature."""
        moved = np.matmul(self.edge_shape, state[self.edge_dofs].reshape(-1, 3, 2))
        return self.edge_radius + moved[..., 0], moved[..., 1]

    def _assemble(self, state: FloatArray, depth: float, penalty: float) -> tuple[FloatArray, csc_matrix]:
        """Residual and tangent of solid and contact."""
        solid = self.solid.assemble(state[: self.solid.size], True)
        gap = self.tip.gap(*self._edge_points(state), depth)
        multiplier = self._multiplier(state)
        traction = np.maximum(multiplier - penalty * gap.distance, 0.0)
        closed = traction > 0.0
        weight = self.edge_weight[..., None]
        normal = self._along(gap.normal)
        tangent = self._along(np.stack([-gap.normal[1], gap.normal[0]]))
        residual = np.zeros(self.size)
        residual[: self.solid.size] = solid.residual
        np.add.at(residual, self.edge_dofs, -(weight * traction[..., None] * normal).sum(axis=1))
        excess = (traction - multiplier) / penalty
        np.add.at(residual, self.multiplier_dofs, (weight * excess[..., None] * self.hats).sum(axis=1))
        touching = weight * closed[..., None]
        uu = np.matmul((penalty * touching * normal).swapaxes(1, 2), normal)
        uu -= np.matmul((weight * (traction * gap.curvature)[..., None] * tangent).swapaxes(1, 2), tangent)
        um = -np.matmul((touching * normal).swapaxes(1, 2), self.hats)
        mm = np.matmul((weight * (closed - 1.0)[..., None] * self.hats).swapaxes(1, 2), self.hats) / penalty
        local = np.block([[uu, um], [um.swapaxes(1, 2), mm]])
        contact = scattered(local, np.concatenate([self.edge_dofs, self.multiplier_dofs], axis=1), self.size)
        inside = solid.tangent.copy()
        inside.resize(self.size, self.size)
        return residual, (inside + contact).tocsc()

    def _along(self, direction: FloatArray) -> FloatArray:
        """(edge, point, 6) change of a displacement along a direction by the edge's unknowns."""
        shapes = self.edge_shape[..., :, None] * np.moveaxis(direction, 0, -1)[..., None, :]
        return shapes.reshape(*direction.shape[1:], 6)

    def _solve(self, guess: FloatArray, depth: float, penalty: float = PENALTY) -> tuple[FloatArray, int]:
        """Equilibrium at a depth from a guess, and the number of iterations."""
        return solve_newton(lambda state: self._assemble(state, depth, penalty), guess, self.free)

    def advance(self, depth: float, on_step: Callable[[float, int], None] | None = None) -> None:
        """Continue to a deeper state."""
        step = min(LARGEST_STEP, max(self.depth, 0.02))
        while self.depth < depth - 1e-12:
            step = min(step, LARGEST_STEP)
            target = self.depth + step
            if target > depth - 0.3 * step:
                target = depth
            try:
                state, count = self._solve(self.state + (target - self.depth) * self.slope, target)
            except RuntimeError:  # OracleError, or a factorisation that found the matrix singular
                step *= 0.5
                if step < SMALLEST_STEP:
                    raise OracleError(f"depth {target:g}: no state found") from None
                continue
            self.slope = (state - self.state) / (target - self.depth)
            self.state, self.depth = state, target
            if on_step is not None:
                on_step(target, count)
            step *= 1.5 if count <= 7 else 0.8

    def _settle(self, guess: FloatArray, depth: float, penalty: float) -> FloatArray:
        """Equilibrium at a depth from a near guess; where contact does not settle, by way of other stiffnesses."""
        failure = OracleError()
        for ladder in LADDERS:
            state = guess
            try:
                for share in ladder:
                    state, _ = self._solve(state, depth, share * penalty)
            except OracleError as error:
                failure = error
            else:
                return state
        raise failure

    def adopt(self, other: Press) -> None:
        """Solve the depth of a press on another mesh, from its state."""
        ours, theirs = self.solid, other.solid
        guess = np.zeros(self.size)
        moved = other.state[: 2 * theirs.node_count].reshape(-1, 2)
        for axis in (0, 1):
            guess[axis : 2 * ours.node_count : 2] = interpolated(theirs.nodes, moved[:, axis], ours.nodes, 2)
        pressure = other.state[2 * theirs.node_count : theirs.size]
        guess[2 * ours.node_count : ours.size] = interpolated(theirs.mesh.p, pressure, ours.mesh.p, 1)
        corners, their_corners = (one.solid.nodes[0][one.top_nodes[::2]] for one in (self, other))
        guess[ours.size :] = np.interp(corners, their_corners, other.state[theirs.size :])
        self.state = self._settle(guess, other.depth, PENALTY)
        self.depth = other.depth

    def read(self) -> PressedState:
        """The present state, solved with the final contact stiffness."""
        self.state = self._settle(self.state, self.depth, FINAL_PENALTY)
        r, z = self._edge_points(self.state)
        gap = self.tip.gap(r, z, self.depth)
        traction = np.maximum(self._multiplier(self.state) - FINAL_PENALTY * gap.distance, 0.0)
        solid = self.solid.assemble(self.state[: self.solid.size], False)
        moved = np.matmul(self.edge_slope, self.state[self.edge_dofs].reshape(-1, 3, 2))
        area = np.hypot(1.0 + moved[..., 0], moved[..., 1]) * r / self.edge_radius
        curve = (
            self.solid.nodes[:, self.top_nodes].T
            + self.state[: 2 * self.solid.node_count].reshape(-1, 2)[self.top_nodes]
        )
        contact = np.stack([r, z, traction / area, self.edge_weight * area], axis=-1).reshape(-1, 4)
        return PressedState(
            depth=self.depth,
            force=float(-(self.edge_weight * traction * gap.normal[1]).sum()),
            reaction=float(-solid.residual[self.bonded_vertical].sum()),
            energy=solid.energy,
            volume_change=self.solid.volume(self.state[: self.solid.size]) / self.rest_volume - 1.0,
            penetration=float(np.maximum(-gap.distance, 0.0).max()),
            curve=curve,
            contact=contact[np.argsort(self.edge_radius.ravel())],
        )


def lagrange_matrix(ticks: FloatArray, points: FloatArray, order: int) -> FloatArray:
    """Values at points from values at ticks, piecewise polynomial over every `order` intervals; (point, tick)."""
    piece = np.clip(
        np.searchsorted(ticks[::order], points, side="right") - 1, 0, (len(ticks) - 1) // order - 1
    )
    matrix = np.zeros((len(points), len(ticks)))
    for own in range(order + 1):
        weight = np.ones(len(points))
        for other in set(range(order + 1)) - {own}:
            here, there = ticks[order * piece + own], ticks[order * piece + other]
            weight *= (points - there) / (here - there)
        matrix[np.arange(len(points)), order * piece + own] = weight
    return matrix


def interpolated(nodes: FloatArray, values: FloatArray, points: FloatArray, order: int) -> FloatArray:
    """Values at the points of one grid from values at the nodes of another; both (2, n), products of r and z."""
    (r, column), (z, row) = (np.unique(np.round(one, 12), return_inverse=True) for one in nodes)
    (new_r, new_column), (new_z, new_row) = (
        np.unique(np.round(one, 12), return_inverse=True) for one in points
    )
    grid = np.zeros((len(r), len(z)))
    grid[column, row] = values
    found = lagrange_matrix(r, new_r, order) @ grid @ lagrange_matrix(z, new_z, order).T
    return np.asarray(found[new_column, new_row])


def pressed_states(
    press: Press, depths: Sequence[float], on_step: Callable[[float, int], None] | None = None
) -> Iterator[PressedState]:
    """The states of a press at increasing depths."""
    for depth in depths:
        press.advance(depth, on_step)
        yield press.read()
