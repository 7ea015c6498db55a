"""The oracle's contact: balance, classical formulas at small depth, convergence, and the stored solutions."""

from __future__ import annotations

import numpy as np
import pytest

from tests.validation.contact.contact_reference import POISSON_RATIO, WALL, contact_edge, reference_state
from tests.validation.elements.layer_mesh import Grading
from tests.validation.elements.press_oracle import Press, PressedState, pressed_states
from tests.validation.elements.tip_outlines import Tip, cone_tip, flat_tip, sphere_tip

LAYER = 8 / 3
STUDY_FORCE_N = {0.2: 0.303, 0.5: 1.261, 1.0: 3.758, 2.0: 11.06, 3.0: 19.89, 4.0: 28.58, 5.0: 36.46}
"""An earlier, separate finite-element study: 8 mm layer, tip radius 3 mm, modulus 1 MPa."""


def even_grading(size: float) -> Grading:
    """Elements of one size under the tip, coarser away from it in proportion."""
    return Grading(
        size=size,
        axis_size=size,
        axis_radius=0.0,
        growth=1.15 ** (size / 0.05),
        largest_radial=8 * size,
        largest_axial=3 * size,
    )


def states(size: float, depths: list[float]) -> list[PressedState]:
    return list(pressed_states(Press(LAYER, WALL, even_grading(size), POISSON_RATIO), depths))


@pytest.fixture(scope="module")
def coarse() -> list[PressedState]:
    """Three close depths on a mesh of 0.2 tip radii."""
    return states(0.2, [0.33, 1 / 3, 2 * (1 / 3) - 0.33])


def test_contact_force_balances_the_bonded_faces_and_is_the_slope_of_the_energy(
    coarse: list[PressedState],
) -> None:
    before, here, after = coarse
    # sum of some hundred nodal residuals of at most 1e-9
    assert here.force == pytest.approx(-here.reaction, abs=1e-7)
    slope = (after.energy - before.energy) / (after.depth - before.depth)
    # central difference over 0.0067 radii of an energy that grows as depth^2.5: 1e-4 relative; contact energy 1e-4
    assert slope == pytest.approx(here.force, rel=5e-4)


def test_volume_is_kept_but_for_the_compressibility_of_the_material(coarse: list[PressedState]) -> None:
    here = coarse[1]
    # mean pressure over bulk modulus: dV/V = -F depth-average / K, of order F / (wall area) / K = 2e-5
    bulk = 1.0 / (3.0 * (1.0 - 2.0 * POISSON_RATIO))
    assert -4.0 < here.volume_change * bulk * np.pi * WALL**2 / here.force < 0.0


def test_penetration_is_negligible(coarse: list[PressedState]) -> None:
    assert max(state.penetration for state in coarse) < 1e-4


def test_the_energy_converges_at_the_rate_that_the_contact_edge_allows() -> None:
    """Displacement has the power 3/2 at the contact edge, so the energy error falls with the cube of the size."""
    stored = reference_state(LAYER, 1 / 3).energy
    energies = [states(size, [1 / 3])[0].energy for size in (0.4, 0.2)]
    rate = np.log2((energies[0] - stored) / (energies[1] - stored))
    # the stored value's own error is 2 % of the finer difference: 0.03 in the rate; 0.4 for so coarse a mesh
    assert 2.5 < rate < 3.5


def test_small_presses_into_a_deep_layer_follow_hertz() -> None:
    depth, layer = 0.01, 40.0
    grading = Grading(
        size=0.025,
        axis_size=0.025,
        axis_radius=0.0,
        fine_radius=0.15,
        fine_depth=0.1,
        growth=1.5,
        largest_radial=10.0,
        largest_axial=10.0,
    )
    [state] = pressed_states(Press(layer, layer, grading, POISSON_RATIO), [depth])
    hertz = 4 / 3 / (1 - POISSON_RATIO**2) * depth**1.5
    finite_layer = 1.0 + 1.133 * np.sqrt(depth) / layer  # Dimitriadis: +0.3 %
    # finite strain of order a/R = 0.1 times 0.1, and four elements across the contact radius: 1.5 %
    assert state.force == pytest.approx(hertz * finite_layer, rel=0.015)
    # the edge is found to a third of an element
    assert contact_edge(state.curve, depth, 0.05)[0] == pytest.approx(np.sqrt(depth), abs=0.01)


@pytest.mark.parametrize("layer", [2.0, 8 / 3, 3.0, 16 / 3])
def test_small_presses_into_bonded_layers_follow_dimitriadis(layer: float) -> None:
    """Dimitriadis et al., Biophys. J. 82, 2002, eq. 13: incompressible layer bonded to a rigid base."""
    state = reference_state(layer, 0.2 / 3)
    ratio = np.sqrt(state.depth) / layer
    series = 1 + 1.133 * ratio + 1.283 * ratio**2 + 0.769 * ratio**3 + 0.0975 * ratio**4
    # the formula is for infinitesimal depth; at 0.07 radii the study too found 2 %
    assert state.force == pytest.approx(16 / 9 * state.depth**1.5 * series, rel=0.03)


@pytest.mark.parametrize("depth_mm", sorted(STUDY_FORCE_N))
def test_stored_forces_agree_with_an_earlier_study(depth_mm: float) -> None:
    # the study's figures are rounded to four digits; its mesh and contact are not recorded
    assert 9.0 * reference_state(LAYER, depth_mm / 3).force == pytest.approx(
        STUDY_FORCE_N[depth_mm], rel=5e-3
    )


@pytest.mark.full
def test_a_stored_solution_is_found_again_on_a_coarser_mesh() -> None:
    """Every element twice as large: the differences are those of the table of mesh errors, with a margin of 2."""
    stored = reference_state(3.0, 1.0)
    [state] = pressed_states(Press(3.0, WALL, Grading(size=0.1, axis_size=0.05), POISSON_RATIO), [1.0])
    assert state.force == pytest.approx(stored.force, rel=1e-3)
    assert contact_edge(state.curve, 1.0)[0] == pytest.approx(stored.contact_radius, abs=0.01)


@pytest.mark.full
@pytest.mark.parametrize("tip", [flat_tip(0.2), cone_tip(60.0, 0.3, 0.2)], ids=lambda tip: tip.name)
def test_other_tips_press_in_balance(tip: object) -> None:
    press = Press(3.0, WALL, Grading(size=0.1, axis_size=0.05), POISSON_RATIO, tip)  # type: ignore[arg-type]
    [state] = pressed_states(press, [0.4])
    assert state.force == pytest.approx(-state.reaction, abs=1e-7)
    assert state.penetration < 3e-4


TIPS = [sphere_tip(), flat_tip(0.2), cone_tip(45.0, 0.15, 0.2)]


def points_outside(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Points around the lower end of a tip pressed 0.8 deep, at distances of up to one radius."""
    generator = np.random.default_rng(7)
    r, z = generator.uniform(0.0, 1.8, 40 * count), generator.uniform(-1.6, 0.6, 40 * count)
    return r, z


@pytest.mark.parametrize("tip", TIPS, ids=lambda tip: tip.name)
def test_normals_and_curvatures_are_derivatives_of_the_distance(tip: Tip) -> None:
    r, z = points_outside(20)
    gap = tip.gap(r, z, 0.8)
    chosen = gap.distance > 0.02
    r, z = r[chosen], z[chosen]
    gap, step = tip.gap(r, z, 0.8), 1e-5
    by_r, by_z = (
        (
            tip.gap(r + step * a, z + step * b, 0.8).distance
            - tip.gap(r - step * a, z - step * b, 0.8).distance
        )
        / (2 * step)
        for a, b in ((1, 0), (0, 1))
    )
    # central differences: step² / distance² = 2.5e-7; points within a step of a joint are not C2
    assert gap.normal == pytest.approx(np.stack([by_r, by_z]), abs=1e-5)
    along = np.stack([-gap.normal[1], gap.normal[0]])
    step = 1e-4
    around = [tip.gap(r + s * step * along[0], z + s * step * along[1], 0.8).distance for s in (1, 0, -1)]
    second = (around[0] - 2 * around[1] + around[2]) / step**2
    smooth = np.abs(second - gap.curvature) < 1e-3 * (1.0 + 1.0 / gap.distance)
    assert smooth.mean() > 0.99
