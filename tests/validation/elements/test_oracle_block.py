"""The oracle in three dimensions: derivatives, balance, symmetry, and agreement with the axisymmetric one."""

from __future__ import annotations

import numpy as np
import pytest
from skfem import MeshHex

from optopad.design.arrays import FloatArray
from tests.validation.contact.contact_reference import POISSON_RATIO
from tests.validation.elements.block_oracle import BlockGrading, BlockPress, BlockState, Walls
from tests.validation.elements.hyperelastic import Solid, Spatial

COARSE = BlockGrading(size=1.2, growth=2.0)


def cube(poisson_ratio: float) -> Solid:
    ticks = np.linspace(0.0, 1.0, 3)
    return Solid(MeshHex.init_tensor(ticks, ticks[::2], ticks[::2]), poisson_ratio, Spatial())


def pressed(layer: float, walls: Walls, depth: float) -> BlockState:
    press = BlockPress(layer, walls, COARSE, POISSON_RATIO)
    press.advance(depth)
    return press.read()


def test_residual_and_tangent_are_derivatives_of_the_energy_in_space() -> None:
    solid = cube(0.49)
    generator = np.random.default_rng(3)
    state, direction = (0.03 * generator.standard_normal(solid.size) for _ in range(2))
    step = 1e-5
    ahead, behind = (solid.assemble(state + sign * step * direction, False) for sign in (1, -1))
    here = solid.assemble(state, True)
    # central differences: error step² = 1e-10 relative
    slope = (ahead.energy - behind.energy) / (2 * step)
    assert slope == pytest.approx(here.residual @ direction, rel=1e-6, abs=1e-8)
    difference = (ahead.residual - behind.residual) / (2 * step)
    assert difference == pytest.approx(here.tangent @ direction, abs=1e-7 * np.abs(difference).max())


def test_a_sheared_and_stretched_cube_has_the_energy_of_the_closed_form() -> None:
    solid = cube(0.3)
    gradient = np.array([[1.2, 0.3, 0.0], [0.0, 0.9, 0.1], [0.05, 0.0, 1.1]])
    state = np.zeros(solid.size)
    state[: solid.displacement_size] = (solid.nodes.T @ (gradient - np.eye(3)).T).ravel()
    volume = np.linalg.det(gradient)
    state[solid.displacement_size :] = solid.mixed * (volume - 1.0)
    mu, lam = solid.mu, solid.lam
    closed = 0.5 * mu * ((gradient**2).sum() - 3.0 - 2.0 * np.log(volume)) + 0.5 * lam * (volume - 1.0) ** 2
    # a homogeneous state lies in the element space: round-off
    assert solid.assemble(state, False).energy == pytest.approx(closed, rel=1e-12)
    assert solid.volume(state) == pytest.approx(volume, rel=1e-12)


def test_gradients_of_the_distance_in_space_are_its_derivatives() -> None:
    press = BlockPress(2.0, (4.0, 4.0, 0.0, 4.0), COARSE, POISSON_RATIO)
    gap = press.gap(0.5)
    points = np.random.default_rng(5).uniform([-1.5, -1.5, -1.0], [1.5, 1.5, 0.4], (40, 3))
    points = points[gap(points)[0] > 0.05]
    _, normal, hessian = gap(points)
    step = 1e-5
    for axis in range(3):
        shift = step * np.eye(3)[axis]
        ahead, behind = gap(points + shift), gap(points - shift)
        # central differences: error step² over distance², 4e-8; the join of sphere and shank is not C2
        assert (ahead[0] - behind[0]) / (2 * step) == pytest.approx(normal[:, axis], abs=1e-6)
        bent = (ahead[1] - behind[1]) / (2 * step)
        assert np.median(np.abs(bent - hessian[:, axis]).max(axis=1)) < 1e-6


def test_half_a_block_presses_like_the_whole() -> None:
    half = pressed(2.0, (4.0, 3.0, 0.0, 4.0), 0.2)
    whole = pressed(2.0, (4.0, 3.0, 4.0, 4.0), 0.2)
    # the same discrete problem: Newton's limit of 1e-9 a node
    assert half.force == pytest.approx(whole.force, abs=1e-7)
    assert half.force == pytest.approx(-half.reaction, abs=1e-7)
    mirrored = whole.top[whole.top[:, 1] > -1e-9]
    assert half.top[np.lexsort(half.top.T)] == pytest.approx(mirrored[np.lexsort(mirrored.T)], abs=1e-6)


def _profile(state: BlockState) -> FloatArray:
    """Heights of the nodes along y = 0."""
    line = state.top[np.abs(state.top[:, 1]) < 1e-9]
    return line[np.argsort(line[:, 0])][:, 2]
