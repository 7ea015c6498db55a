"""The crowned mesh lies below a sphere, is finer at its rim, and impossible crowns are refused."""

from __future__ import annotations

import numpy as np
import pytest

from optopad.design.errors import InputError, ModelScopeError
from optopad.design.rules.shape import LEAST_RIM_SHARE
from optopad.sims.contact.mesh import RIM_SPACING, finer_towards_end, graded_spacing, radial_mesh
from optopad.sims.contact.scope import crown_drop, crown_slope, require_rim
from optopad.sims.contact.wedge import WEDGE_ANGLE, solve_wedge, sweep

CROWN, WALL = 3 / 14, 11 / 3


def test_crown_is_a_sphere_and_slope_its_derivative() -> None:
    radius = np.linspace(0.0, 4.0, 9)
    np.testing.assert_allclose(crown_drop(radius, 0.2), 5.0 - np.sqrt(25.0 - radius**2), atol=1e-14)
    rise = crown_drop(radius + 1e-6, 0.2) - crown_drop(radius - 1e-6, 0.2)
    np.testing.assert_allclose(crown_slope(radius, 0.2), rise / 2e-6, atol=1e-8)


def test_a_crown_of_ten_metres_keeps_its_digits() -> None:
    radius = np.array([1e-3, 1.0])
    np.testing.assert_allclose(crown_drop(radius, 3e-4), 1.5e-4 * radius**2, rtol=1e-6)


def test_top_lies_on_the_sphere_and_the_bottom_stays_flat() -> None:
    mesh = radial_mesh(3.0, WALL, 0.15, CROWN)
    radius, height = mesh.nodes[mesh.top].T
    np.testing.assert_allclose(height, np.sqrt(1 / CROWN**2 - radius**2) - 1 / CROWN, atol=1e-12)
    assert mesh.nodes[:, 1].min() == pytest.approx(-3.0)
    bonded = mesh.nodes[mesh.is_bonded]
    assert np.all((bonded[:, 1] < -3.0 + 1e-9) | (bonded[:, 0] > WALL - 1e-9))
    assert mesh.is_bonded[mesh.top].tolist() == [False] * (len(mesh.top) - 1) + [True]


@pytest.mark.parametrize("crown", [0.075, CROWN, 0.25])
def test_wedge_has_the_volume_below_the_sphere(crown: float) -> None:
    wedge = sweep(radial_mesh(3.0, WALL, 0.1, crown))
    volumes = np.linalg.det(wedge.points[wedge.elements[:, 1:]] - wedge.points[wedge.elements[:, :1]]) / 6.0
    assert volumes.min() > 0.0
    drop = float(crown_drop(np.array(WALL), crown))
    whole = WALL**2 * (3.0 - drop) + drop**2 * (1.0 / crown - drop / 3.0)
    # chords of 0.25 cut 0.25² κ/12 off a sphere: up to 0.1 % of a layer of 3
    assert volumes.sum() == pytest.approx(0.5 * np.sin(WEDGE_ANGLE) * whole, rel=2e-3)


def test_columns_become_finer_towards_the_rim_and_the_fine_zone_stays() -> None:
    flat, crowned = radial_mesh(3.0, WALL, 0.1), radial_mesh(3.0, WALL, 0.1, CROWN)
    radii = crowned.nodes[crowned.top, 0]
    steps = np.diff(radii)
    assert RIM_SPACING <= steps[-1] < 1.4 * RIM_SPACING
    under_the_tip = radii < 4 / 3
    np.testing.assert_array_equal(radii[under_the_tip], flat.nodes[flat.top, 0][: under_the_tip.sum()])
    assert radii[-1] == flat.nodes[flat.top[-1], 0]


def test_a_spacing_that_is_fine_enough_stays() -> None:
    even = np.linspace(0.0, 1.0, 41)
    np.testing.assert_array_equal(finer_towards_end(even, 0.05, 1.3), even)
    graded = graded_spacing(6.0, 1.0, 0.1, 0.25)
    finer = finer_towards_end(graded, 0.05, 1.3)
    assert np.diff(finer).min() > 0.0
    assert (finer[0], finer[-1]) == (0.0, 6.0)


@pytest.mark.parametrize("crown", [-0.1, float("nan"), float("inf")])
def test_a_crown_that_is_no_convex_top_is_refused(crown: float) -> None:
    with pytest.raises(InputError, match=r"crown: .* must be 0 \(flat\) or more"):
        radial_mesh(3.0, WALL, 0.15, crown)


def test_a_crown_that_ends_before_the_wall_is_refused() -> None:
    with pytest.raises(ModelScopeError, match=r"3\.333.*3\.667"):
        radial_mesh(3.0, WALL, 0.15, 0.3)


def test_a_crown_that_leaves_too_little_at_the_rim_is_refused() -> None:
    with pytest.raises(ModelScopeError, match=r"0\.220.*0\.300"):
        radial_mesh(2.0, WALL, 0.15, CROWN)
    least = float(crown_drop(np.array(WALL), CROWN)) / (1.0 - LEAST_RIM_SHARE)
    require_rim(least + 1e-9, WALL, CROWN)


@pytest.mark.slow
def test_first_touch_of_a_crown_passes_its_checks_and_is_lighter_than_of_a_flat_layer() -> None:
    depths = [0.01, 0.03, 0.06]
    flat, crowned = (solve_wedge(radial_mesh(2.5, 3.0, 0.25, crown), depths, 0.49) for crown in (1e-6, 0.25))
    assert np.all(crowned.force < flat.force)
    assert crowned.heights[-1, -1] == pytest.approx(-float(crown_drop(np.array(3.0), 0.25)), abs=1e-12)
    assert crowned.radii[-1, -1] == pytest.approx(3.0, rel=1e-12)
    above = crowned.heights[-1] + crown_drop(crowned.radii[-1], 0.25)
    # the layer keeps its volume: beside the tip it rises above the untouched crown
    assert above[len(above) // 2 :].max() > 0.0
