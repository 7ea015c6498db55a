"""The oracle's solid against closed forms and a manufactured solution."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq
from skfem import MeshQuad

from optopad.design.arrays import FloatArray
from tests.validation.elements.hyperelastic import Solid, lame
from tests.validation.elements.newton import InvertedElementError, solve_newton


def cylinder(cells: int, poisson_ratio: float) -> Solid:
    """A cylinder of radius and height 1."""
    ticks = np.linspace(0.0, 1.0, cells + 1)
    return Solid(MeshQuad.init_tensor(ticks, ticks), poisson_ratio)


def disturbed(solid: Solid, seed: int) -> FloatArray:
    """A state without symmetry and far from rest."""
    generator = np.random.default_rng(seed)
    state = 0.02 * generator.standard_normal(solid.size)
    state[: 2 * solid.node_count : 2] *= solid.nodes[0]
    return state


def uniaxial(stretch: float, poisson_ratio: float) -> tuple[float, float]:
    """Radial stretch and force of a unit cylinder under axial stretch with a free side, by one scalar equation."""
    lam, mu = lame(poisson_ratio)

    def side_stress(radial: float) -> float:
        volume = radial**2 * stretch
        return mu * (radial - 1.0 / radial) + lam * (volume - 1.0) * radial * stretch

    radial = brentq(side_stress, 0.5, 2.0, xtol=1e-15)
    axial = mu * (stretch - 1.0 / stretch) + lam * (radial**2 * stretch - 1.0) * radial**2
    return radial, np.pi * axial


@pytest.mark.parametrize("poisson_ratio", [0.3, 0.499])
@pytest.mark.parametrize("stretch", [0.6, 1.5])
def test_a_cylinder_between_frictionless_plates_follows_the_closed_form(
    stretch: float, poisson_ratio: float
) -> None:
    solid = cylinder(2, poisson_ratio)
    r, z = solid.nodes
    state = np.zeros(solid.size)
    top, bottom, axis = (np.flatnonzero(np.abs(x) < 1e-9) for x in (z - 1.0, z, r))
    state[2 * top + 1] = stretch - 1.0
    fixed = np.concatenate([2 * top + 1, 2 * bottom + 1, 2 * axis])
    free = np.setdiff1d(np.arange(solid.size), fixed)
    # the affine state is a good guess only in height; the side must find its place
    state[1 : 2 * solid.node_count : 2] = (stretch - 1.0) * z
    state[: 2 * solid.node_count : 2] = (stretch**-0.5 - 1.0) * r

    def assemble(values: FloatArray) -> tuple[FloatArray, object]:
        found = solid.assemble(values, True)
        return found.residual, found.tangent

    state, _ = solve_newton(assemble, state, free)
    radial, force = uniaxial(stretch, poisson_ratio)
    # a homogeneous state lies in the element space: only round-off and the Newton limit (1e-9) are left
    assert state[: 2 * solid.node_count : 2] == pytest.approx((radial - 1.0) * r, abs=1e-8)
    assert solid.assemble(state, False).residual[2 * top + 1].sum() == pytest.approx(force, rel=1e-7)
    assert solid.volume(state) == pytest.approx(np.pi * radial**2 * stretch, rel=1e-8)


def test_residual_and_tangent_are_derivatives_of_the_energy() -> None:
    solid = cylinder(2, 0.49)
    state, direction = disturbed(solid, 1), disturbed(solid, 2)
    step = 1e-5
    ahead, behind = (solid.assemble(state + sign * step * direction, False) for sign in (1, -1))
    here = solid.assemble(state, True)
    # central differences: error step² = 1e-10 relative to values of order 1e-2 to 1
    assert (ahead.energy - behind.energy) / (2 * step) == pytest.approx(
        here.residual @ direction, rel=1e-6, abs=1e-8
    )
    difference = (ahead.residual - behind.residual) / (2 * step)
    assert difference == pytest.approx(here.tangent @ direction, abs=1e-7 * np.abs(difference).max())
    assert abs(here.tangent - here.tangent.T).max() < 1e-12


def test_an_inverted_element_is_refused() -> None:
    solid = cylinder(2, 0.49)
    state = np.zeros(solid.size)
    state[1 : 2 * solid.node_count : 2] = -2.0 * solid.nodes[1]
    with pytest.raises(InvertedElementError, match="no positive volume"):
        solid.assemble(state, False)


def exact_displacement(r: FloatArray, z: FloatArray) -> FloatArray:
    """A smooth large deformation, odd in r as symmetry demands."""
    return np.stack([0.2 * r * np.cos(1.5 * z) * np.exp(-r), 0.25 * np.sin(1.2 * z) * np.cos(r * r)])


def exact_gradient(r: FloatArray, z: FloatArray) -> FloatArray:
    """(..., 5) its deformation gradient F_rr, F_rz, F_zr, F_zz, F_θθ."""
    fade = np.exp(-r)
    return np.stack(
        [
            1.0 + 0.2 * (1.0 - r) * fade * np.cos(1.5 * z),
            -0.3 * r * fade * np.sin(1.5 * z),
            -0.5 * r * np.sin(1.2 * z) * np.sin(r * r),
            1.0 + 0.3 * np.cos(1.2 * z) * np.cos(r * r),
            1.0 + 0.2 * np.cos(1.5 * z) * fade,
        ],
        axis=-1,
    )


def exact_pressure(r: FloatArray, z: FloatArray) -> FloatArray:
    return 0.3 * np.cos(2.0 * r) * np.sin(z + 0.3)


def manufactured_errors(cells: int) -> tuple[float, float, float]:
    """Errors of displacement, its gradient and pressure (root mean square) with loads made from the exact fields."""
    solid = cylinder(cells, 0.499)
    r, z = solid.nodes
    x, y = solid.displacement.global_coordinates()
    load = solid.weak_form(exact_gradient(x, y), exact_pressure(x, y))
    fixed_nodes = np.flatnonzero((r > 1 - 1e-9) | (z < 1e-9) | (z > 1 - 1e-9))
    fixed = np.concatenate([2 * fixed_nodes, 2 * fixed_nodes + 1, 2 * np.flatnonzero(r < 1e-9)])
    state = np.zeros(solid.size)
    state[: 2 * solid.node_count] = exact_displacement(r, z).T.ravel()

    def assemble(values: FloatArray) -> tuple[FloatArray, object]:
        found = solid.assemble(values, True)
        return found.residual - load, found.tangent

    state, _ = solve_newton(assemble, state, np.setdiff1d(np.arange(solid.size), fixed))
    displacement = np.array(
        [solid.displacement.interpolate(state[k : 2 * solid.node_count : 2]) for k in (0, 1)]
    )
    errors = (
        displacement - exact_displacement(x, y),
        np.moveaxis(solid.deformation(state) - exact_gradient(x, y), -1, 0),
        (solid.pressure(state) - exact_pressure(x, y))[None],
    )
    volume = solid.weight.sum()
    found = [float(np.sqrt((solid.weight * error**2).sum() / volume)) for error in errors]
    return found[0], found[1], found[2]


def test_errors_fall_at_the_rates_of_taylor_hood_elements() -> None:
    coarse, fine = manufactured_errors(6), manufactured_errors(12)
    displacement, gradient, pressure = np.log2(np.array(coarse) / np.array(fine))
    # theory: 3, 2 and 2; a tenth is left for the higher-order terms of a finite mesh
    assert displacement > 2.9
    assert gradient > 1.9
    assert pressure > 1.9
    assert fine[0] < 1e-4
