"""A solid under a rigid tip, pressed deeper and deeper: Newton's method with continuation in depth.

Displacement, pressure and contact multiplier (`hyperelastic`, `contact_surface`) are found together, started from
the secant of the last two depths; a depth step that does not converge is halved. (Updating the multiplier between
solutions, after Uzawa, diverges beyond depth 1.6 R in a layer of 8/3 R: the layer under the free load t has a
negative stiffness there, larger than the penalty.)

Lengths in tip radii R, stresses in E, forces in E R², energies in E R³.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable

import numpy as np
from scipy.sparse import csc_matrix

from optopad.design.arrays import FloatArray, IntArray
from tests.validation.contact.contact_surface import ContactSurface, GapFunction
from tests.validation.elements.elimination import nested_dissection
from tests.validation.elements.hyperelastic import Solid
from tests.validation.elements.newton import MOST_ITERATIONS, OracleError, solve_newton

LADDERS = ((1.0,), (0.5, 0.7, 1.0), (0.3, 0.2, 0.1, 0.03, 0.1, 0.2, 0.3, 0.5, 0.7, 1.0))
"""Shares of the contact stiffness through which a state is sought, tried in turn: the set of touching points
may cycle for one stiffness and not for another [-]."""
NEAR_PATIENCE = 9
"""Most Newton iterations from a near guess; more mean that touching points cycle."""
SMALLEST_STEP = 1e-3


class Continuation(ABC):
    """States of increasing depth.

    Attributes
    ----------
    solid, top : what is pressed, and the part of its surface that may touch
    free : unknowns that are not prescribed (displacements, pressures and multipliers) in order of elimination
    held : vertical unknowns of the bonded nodes, whose residual is the reaction
    state, depth : the present state
    """

    largest_step = 0.05
    """Largest depth step [tip radii]."""
    penalty = 1000.0
    """Contact stiffness k on the way [E / R]."""
    final_penalty = 3000.0
    """Contact stiffness k of a state that is read: smaller gaps at the contact edge, slower on the way [E / R]."""

    def __init__(self, solid: Solid, top: ContactSurface, fixed: IntArray, held: IntArray) -> None:
        self.solid, self.top, self.held = solid, top, held
        self.size = int(top.multiplier_dofs.max()) + 1
        self.free = self._elimination_order(fixed)
        self.state = np.zeros(self.size)
        self.depth = 0.0
        self.slope = np.zeros(self.size)
        self.rest_volume = solid.volume(self.solid_state)

    def _elimination_order(self, fixed: IntArray) -> IntArray:
        """Unknowns that are not fixed, ordered by nested dissection."""
        mesh = self.solid.mesh
        dimension = len(mesh.p)
        corners = np.concatenate([self.corners().T, np.zeros((self.size - self.solid.size, 1))], axis=1)
        places = np.concatenate([np.repeat(self.solid.nodes.T, dimension, axis=0), mesh.p.T, corners])
        order = nested_dissection(places, [np.unique(np.round(ticks, 9)) for ticks in mesh.p])
        is_free = np.ones(self.size, dtype=bool)
        is_free[fixed] = False
        return np.asarray(order[is_free[order]])

    @property
    def solid_state(self) -> FloatArray:
        """Displacements and pressures of the present state."""
        return self.state[: self.solid.size]

    @abstractmethod
    def gap(self, depth: float) -> GapFunction:
        """Distance of points to the tip at a depth, with derivatives."""

    def _assemble(self, state: FloatArray, depth: float, penalty: float) -> tuple[FloatArray, csc_matrix]:
        """Residual and tangent of solid and contact."""
        solid = self.solid.assemble(state[: self.solid.size], True)
        residual, tangent = self.top.assemble(state, self.gap(depth), penalty)
        residual[: self.solid.size] += solid.residual
        inside = solid.tangent.copy()
        inside.resize(self.size, self.size)
        return residual, (inside + tangent).tocsc()

    def _solve(
        self, guess: FloatArray, depth: float, penalty: float, patience: int = MOST_ITERATIONS
    ) -> tuple[FloatArray, int]:
        """Equilibrium at a depth from a guess, and the number of iterations."""
        return solve_newton(
            lambda state: self._assemble(state, depth, penalty), guess, self.free, patience, "NATURAL"
        )

    def advance(self, depth: float, on_step: Callable[[float, int], None] | None = None) -> None:
        """Continue to a deeper state."""
        step = min(self.largest_step, max(self.depth, 0.02))
        while self.depth < depth - 1e-12:
            step = min(step, self.largest_step)
            target = self.depth + step
            if target > depth - 0.3 * step:
                target = depth
            try:
                guess = self.state + (target - self.depth) * self.slope
                state, count = self._solve(guess, target, self.penalty)
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

    def settle(self, guess: FloatArray, depth: float, penalty: float) -> None:
        """Take the equilibrium at a depth near a guess; where contact does not settle, by way of other stiffnesses."""
        failure = OracleError()
        for ladder in LADDERS:
            state = guess
            try:
                for share in ladder:
                    state, _ = self._solve(state, depth, share * penalty, NEAR_PATIENCE)
            except OracleError as error:
                failure = error
            else:
                self.state, self.depth = state, depth
                return
        raise failure

    def adopt(self, other: Continuation) -> None:
        """Solve the depth of a press on another mesh, from its state. Both meshes are products of coordinates."""
        ours, theirs = self.solid, other.solid
        guess = np.zeros(self.size)
        dimension = len(ours.nodes)
        moved = theirs.moved(other.state)
        for axis in range(dimension):
            values = interpolated(theirs.nodes, moved[:, axis], ours.nodes, 2)
            guess[axis : ours.displacement_size : dimension] = values
        pressure = other.state[theirs.displacement_size : theirs.size]
        guess[ours.displacement_size : ours.size] = interpolated(theirs.mesh.p, pressure, ours.mesh.p, 1)
        values = interpolated(other.corners(), other.state[theirs.size :], self.corners(), 1)
        guess[ours.size :] = values
        self.settle(guess, other.depth, self.penalty)

    def corners(self) -> FloatArray:
        """(dimension - 1, multiplier) places of the multipliers on the top."""
        places = np.zeros((self.size - self.solid.size, self.top.rest.shape[-1] - 1))
        # linear hats reproduce coordinates: least squares over each facet's points gives those of its corners
        for facet, dofs in enumerate(self.top.multiplier_dofs):
            found = np.linalg.lstsq(self.top.hats[facet], self.top.rest[facet, :, :-1], rcond=None)[0]
            places[dofs - self.solid.size] = found
        return places.T

    def traction(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """(facet, point) contact force per rest area, gap, and (facet, point, dimension) normal of the tip."""
        distance, normal, _ = self.gap(self.depth)(self.top.points(self.state))
        return self.top.traction(self.state, distance, self.final_penalty), distance, normal


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
    """Values at the points of one grid from values at the nodes of another; both (dimension, n), products of axes."""
    ticks, places = zip(*(np.unique(np.round(one, 9), return_inverse=True) for one in nodes), strict=True)
    new_ticks, new_places = zip(
        *(np.unique(np.round(one, 9), return_inverse=True) for one in points), strict=True
    )
    grid = np.zeros([len(one) for one in ticks])
    grid[places] = values
    for axis, (old, new) in enumerate(zip(ticks, new_ticks, strict=True)):
        found = np.tensordot(lagrange_matrix(old, new, order), grid, axes=(1, axis))
        grid = np.moveaxis(found, 0, axis)
    return np.asarray(grid[new_places])
