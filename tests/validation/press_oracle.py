"""Axisymmetric press of a rigid tip into a bonded layer: the solid, the contact of its top, and continuation in depth.

Displacement, pressure and contact multiplier (`hyperelastic`, `contact_surface`) are found together by Newton's
method, started from the secant of the last two depths; a depth step that does not converge is halved. (Updating the
multiplier between solutions, after Uzawa, diverges beyond depth 1.6 R in a layer of 8/3 R: the layer under the
free load t has a negative stiffness there, larger than the penalty.)

Lengths in tip radii R, stresses in E, forces in E R², energies in E R³.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csc_matrix
from skfem import ElementQuad2, FacetBasis

from tests.validation.contact_surface import ContactSurface, GapFunction, facet_nodes
from tests.validation.hyperelastic import FloatArray, IntArray, Solid
from tests.validation.layer_mesh import Grading, layer_mesh
from tests.validation.newton import MOST_ITERATIONS, OracleError, solve_newton
from tests.validation.tip_outlines import Tip, sphere_tip

PENALTY = 1000.0
"""Contact stiffness k on the way [E / R]."""
FINAL_PENALTY = 3000.0
"""Contact stiffness k of a state that is read: smaller gaps at the contact edge, slower on the way [E / R]."""
LADDERS = ((1.0,), (0.5, 0.7, 1.0), (0.3, 0.2, 0.1, 0.03, 0.1, 0.2, 0.3, 0.5, 0.7, 1.0))
"""Shares of the contact stiffness through which a state is sought, tried in turn: the set of touching points
may cycle for one stiffness and not for another [-]."""
NEAR_PATIENCE = 9
"""Most Newton iterations from a near guess; more mean that touching points cycle."""
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
        self.top, self.top_nodes = _top_of(self.solid)
        nodes = self.solid.nodes
        bonded = np.flatnonzero((nodes[1] < -layer + 1e-9) | (nodes[0] > wall - 1e-9))
        axis = np.flatnonzero(nodes[0] < 1e-9)
        fixed = np.concatenate([2 * bonded, 2 * bonded + 1, 2 * axis])
        self.bonded_vertical = 2 * bonded + 1
        self.size = int(self.top.multiplier_dofs.max()) + 1
        self.free = np.setdiff1d(np.arange(self.size), fixed)
        self.state = np.zeros(self.size)
        self.depth = 0.0
        self.slope = np.zeros(self.size)
        self.rest_volume = self.solid.volume(self.state[: self.solid.size])

    def _gap(self, depth: float) -> GapFunction:
        """Distance of points (..., 2) to the tip at a depth, with derivatives."""

        def gap(points: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
            found = self.tip.gap(points[..., 0], points[..., 1], depth)
            along = np.stack([-found.normal[1], found.normal[0]], axis=-1)
            bent = found.curvature[..., None, None] * along[..., :, None] * along[..., None, :]
            return found.distance, np.moveaxis(found.normal, 0, -1), bent

        return gap

    def _assemble(self, state: FloatArray, depth: float, penalty: float) -> tuple[FloatArray, csc_matrix]:
        """Residual and tangent of solid and contact."""
        solid = self.solid.assemble(state[: self.solid.size], True)
        residual, tangent = self.top.assemble(state, self._gap(depth), penalty)
        residual[: self.solid.size] += solid.residual
        inside = solid.tangent.copy()
        inside.resize(self.size, self.size)
        return residual, (inside + tangent).tocsc()

    def _solve(
        self, guess: FloatArray, depth: float, penalty: float = PENALTY, patience: int = MOST_ITERATIONS
    ) -> tuple[FloatArray, int]:
        """Equilibrium at a depth from a guess, and the number of iterations."""
        return solve_newton(lambda state: self._assemble(state, depth, penalty), guess, self.free, patience)

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
                    state, _ = self._solve(state, depth, share * penalty, NEAR_PATIENCE)
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
        points = self.top.points(self.state)
        distance, normal, _ = self._gap(self.depth)(points)
        traction = self.top.traction(self.state, distance, FINAL_PENALTY)
        solid = self.solid.assemble(self.state[: self.solid.size], False)
        curve = (self.solid.nodes.T + self.solid.moved(self.state))[self.top_nodes]
        area = self._area_ratio(points)
        contact = np.concatenate(
            [points, np.stack([traction / area, self.top.weight * area], axis=-1)], axis=-1
        )
        return PressedState(
            depth=self.depth,
            force=float(-(self.top.weight * traction * normal[..., 1]).sum()),
            reaction=float(-solid.residual[self.bonded_vertical].sum()),
            energy=solid.energy,
            volume_change=self.solid.volume(self.state[: self.solid.size]) / self.rest_volume - 1.0,
            penetration=float(np.maximum(-distance, 0.0).max()),
            curve=curve,
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
