"""A solved press obeys the physics it claims: check values, limits, balance, volume, scaling."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.spatial import cKDTree

from optopad.design.errors import ModelScopeError
from optopad.design.spec import SensorDesign
from optopad.sims.contact.indentation import indent
from optopad.sims.contact.library.live_press import fit_press
from optopad.sims.contact.library.smooth_press import SmoothPress, TopCurve, contact_tolerance, surface_curve
from optopad.sims.contact.library.solved_press import SolvedPress
from optopad.sims.contact.library.stored_press import UnitPress
from optopad.sims.contact.tip import tip_gap
from optopad.sims.press import Indentation

CHECK_FORCE_N = {0.5: 1.261, 1.0: 3.758, 2.0: 11.06, 3.0: 19.89}
"""Check values of the feasibility study at 8 mm elastic depth, 3 mm tip, 1 MPa [N]."""
CHECK_CONTACT_RADIUS_MM = {0.2: 0.76, 0.5: 1.26, 1.0: 1.77, 2.0: 2.40, 3.0: 2.82}

WALL_MM = 32.0 / np.sqrt(np.pi)
"""Radius of the round pad of the check pad's area [mm]."""


def dimitriadis_force_n(depth_mm: float, tip_radius_mm: float, layer_mm: float, modulus_mpa: float) -> float:
    """Sphere on a bonded incompressible layer; Dimitriadis et al. 2002, Biophys. J. 82, eq. 14."""
    chi = np.sqrt(tip_radius_mm * depth_mm) / layer_mm
    series = 1 + 1.133 * chi + 1.283 * chi**2 + 0.769 * chi**3 + 0.0975 * chi**4
    return float(16 / 9 * modulus_mpa * np.sqrt(tip_radius_mm) * depth_mm**1.5 * series)


@pytest.fixture(scope="module")
def fitted(coarse_press: SolvedPress) -> SmoothPress:
    """The states at the larger Poisson's ratio alone."""
    return fit_press(coarse_press.unit)


def enclosed_volume_mm3(press: Indentation) -> float:
    """Volume between the deformed and the undisturbed top, dimple negative [mm³]; trapezoids."""
    moment = 2 * np.pi * press.radius_mm * press.height_mm
    return float(np.sum(0.5 * (moment[1:] + moment[:-1]) * np.diff(press.radius_mm)))


@pytest.mark.parametrize("depth_mm", [0.2, 0.5])
def test_shallow_force_is_that_of_a_bonded_layer(shallow_press: SolvedPress, depth_mm: float) -> None:
    expected = dimitriadis_force_n(depth_mm, 3.0, 8.0, 1.0)
    # the contact edge is resolved to about a fifth of the 0.2 mm spacing, force goes with its cube, and the
    # formula is for small strain: 5 % covers both (measured +2.1 % and -1.0 %)
    assert shallow_press.at(depth_mm).force_n == pytest.approx(expected, rel=0.05)


def test_force_tends_to_the_power_three_halves_at_contact(shallow_press: SolvedPress) -> None:
    force = [shallow_press.smooth.force_at(depth) for depth in (1e-3 / 3.0, 1e-2 / 3.0)]
    assert np.log10(force[1] / force[0]) == pytest.approx(1.5, abs=1e-9)


@pytest.mark.parametrize(("depth_mm", "expected_n"), CHECK_FORCE_N.items())
def test_coarse_force_is_within_a_tenth_of_the_study(
    coarse_press: SolvedPress, depth_mm: float, expected_n: float
) -> None:
    # 0.45 mm facets make the tip act blunter: error falls with the spacing squared over the contact radius
    # squared; always too stiff, as linear elements are
    assert 1.0 < coarse_press.at(depth_mm).force_n / expected_n < 1.1


@pytest.mark.parametrize(("depth_mm", "expected_mm"), CHECK_CONTACT_RADIUS_MM.items())
def test_contact_radius_is_within_a_fifth_of_the_spacing_of_the_study(
    coarse_press: SolvedPress, depth_mm: float, expected_mm: float
) -> None:
    assert coarse_press.at(depth_mm).contact_radius_mm == pytest.approx(expected_mm, abs=0.2 * 0.45)


def test_force_and_contact_radius_rise_with_depth(coarse_press: SolvedPress) -> None:
    presses = [coarse_press.at(depth) for depth in np.linspace(0.0, 3.0, 61)]
    assert np.all(np.diff([press.force_n for press in presses]) > 0.0)
    # the edge moves between nodes: its estimate may step back by a hundredth of the spacing
    assert np.diff([press.contact_radius_mm for press in presses]).min() > -0.01 * 0.45 - 0.03


def test_force_equals_the_reaction_of_the_bonded_surfaces(coarse_press: SolvedPress) -> None:
    unit = coarse_press.unit
    np.testing.assert_allclose(unit.reaction, unit.force, rtol=0.01)
    deep = unit.depths * 3.0 > 0.25
    np.testing.assert_allclose(unit.reaction[deep], unit.force[deep], rtol=0.002)


def test_work_of_the_tip_is_the_elastic_energy(coarse_press: SolvedPress, fitted: SmoothPress) -> None:
    unit = coarse_press.unit
    depths = np.linspace(0.0, 1.0, 2001)
    force = np.array([fitted.force_at(float(depth)) for depth in depths])
    work = float(np.sum(0.5 * (force[1:] + force[:-1]) * np.diff(depths)))
    # the difference is stored in the contact penalty (half of force times a few micrometres) and in the
    # stand-off of facets: together under 1 % of the depth
    assert unit.energy[-1] == pytest.approx(work, rel=0.02)


@pytest.mark.parametrize("depth_mm", [0.01, 0.07, 0.33, 1.0, 1.77, 3.0])
def test_surface_never_lies_inside_the_tip(coarse_press: SolvedPress, depth_mm: float) -> None:
    press = coarse_press.at(depth_mm)
    gap = tip_gap(press.radius_mm / 3.0, press.height_mm / 3.0, depth_mm / 3.0)
    assert gap.min() > -1e-12


def dimple_volume_mm3(press: Indentation) -> float:
    """Volume of the dimple below the undisturbed top [mm³]."""
    moment = -2 * np.pi * press.radius_mm * np.minimum(press.height_mm, 0.0)
    return float(np.sum(0.5 * (moment[1:] + moment[:-1]) * np.diff(press.radius_mm)))


def solved_curve(unit: UnitPress, index: int) -> TopCurve:
    """Curve of one solved state, without any smoothing in depth."""
    tolerance = contact_tolerance(unit.mesh_size, unit.wedge_angle)
    return surface_curve(
        unit.radii[index],
        unit.heights[index],
        float(unit.depths[index]),
        spacing=unit.mesh_size,
        tolerance=tolerance,
    )


def distance_um(curve: TopCurve, other: TopCurve) -> float:
    """Largest distance of a curve's points from another curve, for a tip of 3 mm [um]."""
    knots = np.stack([other.radius, other.height], axis=1)
    along = np.append(0.0, np.cumsum(np.hypot(*np.diff(knots, axis=0).T)))
    points = CubicSpline(along, knots)(np.linspace(0.0, along[-1], 60 * along.size))
    return float(cKDTree(points).query(np.stack([curve.radius, curve.height], axis=1))[0].max() * 3000.0)


def test_surface_nodes_enclose_the_volume_that_compression_took(coarse_press: SolvedPress) -> None:
    unit = coarse_press.unit
    radius, height = unit.radii, unit.heights
    first, last = radius[:, :-1], radius[:, 1:]
    # cone frusta between neighbouring nodes
    inner = height[:, :-1] * (2 * first + last) + height[:, 1:] * (first + 2 * last)
    enclosed = np.sum(np.pi / 3 * (last - first) * inner, axis=1)
    # the wedge's two faces differ by some micrometres (prisms split one way), so its top facets are twisted;
    # nodes are the mean of the faces: 2 % of a small loss (measured 0.3 % at 3 mm)
    np.testing.assert_allclose(enclosed, -unit.volume_loss, rtol=0.02, atol=1e-6)


@pytest.mark.parametrize("depth_mm", [1.0, 2.0, 3.0])
def test_pile_up_takes_the_volume_of_the_dimple(coarse_press: SolvedPress, depth_mm: float) -> None:
    press = coarse_press.round_pad_at(depth_mm)
    # nearly incompressible: a Poisson's ratio of 0.499 leaves a fiftieth of the 15 % that 0.49 loses of the dimple. The
    # curve is smooth where the mesh has chords, 0.45 mm long under the tip: 5 % of the dimple (measured 0 to 3 %)
    assert abs(enclosed_volume_mm3(press)) < 0.05 * dimple_volume_mm3(press)


def test_volume_lost_is_small_beside_the_displaced_volume(coarse_press: SolvedPress) -> None:
    press = coarse_press.at(3.0)
    # bulk modulus of nu = 0.49 is 16.7 E: pressures near E under the tip cost some per cent of volume
    assert 0.0 < coarse_press.unit.volume_loss[-1] * 27.0 < 0.25 * dimple_volume_mm3(press)


def test_left_out_depths_are_interpolated_to_a_few_micrometres(coarse_press: SolvedPress) -> None:
    unit = coarse_press.unit
    left_out = np.array([9, 16, 25])
    kept = np.setdiff1d(np.arange(unit.depths.size), left_out)
    changes = {
        field.name: getattr(unit, field.name)[kept]
        for field in dataclasses.fields(UnitPress)
        if isinstance(getattr(unit, field.name), np.ndarray) and field.name not in ("rest_radii", "tip_rows")
    }
    thinned = fit_press(dataclasses.replace(unit, **changes))
    for index in left_out:
        depth = float(unit.depths[index])
        # facets of 0.45 mm make solved forces jitter by up to 3 % of the force where the contact is two nodes wide
        assert thinned.force_at(depth) == pytest.approx(unit.force[index], rel=0.03)
        assert distance_um(thinned.curve_at(depth), solved_curve(unit, int(index))) < 10.0


def test_smooth_press_stays_near_every_solved_state(coarse_press: SolvedPress, fitted: SmoothPress) -> None:
    unit = coarse_press.unit
    for index in range(unit.depths.size):
        depth = float(unit.depths[index])
        # least squares: a third as many coefficients as solved numbers; jitter as above
        assert fitted.force_at(depth) == pytest.approx(unit.force[index], rel=0.03)
        assert distance_um(fitted.curve_at(depth), solved_curve(unit, index)) < 10.0


def test_force_and_edge_are_smooth_functions_of_depth(coarse_press: SolvedPress) -> None:
    depths = np.linspace(0.05, 1.0, 400)
    force = np.array([coarse_press.smooth.force_at(float(depth)) for depth in depths])
    slope = np.diff(force) / np.diff(depths)
    assert np.all(slope > 0.0)
    # no corner: over a hundredth of the range the slope changes by a few per cent of its largest value
    assert np.abs(np.diff(slope)).max() < 0.02 * slope.max()


@pytest.mark.parametrize("depth_mm", [0.0, -0.3])
def test_untouched_pad_is_flat_and_free_of_force(coarse_press: SolvedPress, depth_mm: float) -> None:
    press = coarse_press.round_pad_at(depth_mm)
    np.testing.assert_array_equal(press.height_mm, 0.0)
    assert (press.force_n, press.contact_radius_mm) == (0.0, 0.0)
    assert (press.radius_mm[0], press.radius_mm[-1]) == (0.0, pytest.approx(WALL_MM))


@pytest.mark.parametrize("depth_mm", [1e-6, 1e-4, 0.003, 0.02])
def test_first_touch_is_a_small_smooth_dimple(coarse_press: SolvedPress, depth_mm: float) -> None:
    press = coarse_press.at(depth_mm)
    assert press.height_mm.min() == pytest.approx(-depth_mm, rel=1e-9)
    assert np.abs(press.height_mm).max() <= depth_mm * (1 + 1e-9)
    assert 0.0 <= press.contact_radius_mm <= 0.45
    assert np.hypot(np.diff(press.radius_mm), np.diff(press.height_mm)).min() > 0.0


@pytest.mark.parametrize("depth_mm", [0.2, 1.0, 2.05, 3.0])
def test_curve_is_dense_and_starts_and_ends_where_it_should(
    coarse_press: SolvedPress, depth_mm: float
) -> None:
    press = coarse_press.round_pad_at(depth_mm)
    assert (press.radius_mm[0], press.height_mm[0]) == (0.0, pytest.approx(-depth_mm))
    assert press.radius_mm[-1] == pytest.approx(WALL_MM)
    assert press.height_mm[-1] == pytest.approx(0.0, abs=1e-9)
    points = np.stack([press.radius_mm, press.height_mm], axis=1)
    along = np.append(0.0, np.cumsum(np.hypot(*np.diff(points, axis=0).T)))
    assert np.diff(along).min() > 0.0
    half = CubicSpline(along[::2], points[::2])(along[1:-1:2])
    # a cubic through every second point finds the others: through all of them it is sixteen times nearer
    assert np.hypot(*(half - points[1:-1:2]).T).max() * 1000.0 < 5.0


def test_deeper_than_solved_is_refused_not_extrapolated(coarse_press: SolvedPress) -> None:
    with pytest.raises(ModelScopeError, match=r"depth_mm: 3\.2 is beyond the solved 3 mm"):
        coarse_press.at(3.2)
    with pytest.raises(ModelScopeError):
        coarse_press.at(float("nan"))


def test_doubling_every_length_doubles_the_shape_and_quadruples_the_force(
    check_design: SensorDesign, coarse_press: SolvedPress
) -> None:
    double = check_design.with_(
        **{
            "cavity.clear_thickness_mm": 14.0,
            "cavity.black_thickness_mm": 2.0,
            "indenter.tip_radius_mm": 6.0,
            "operating.max_depth_mm": 6.0,
            "cavity.length_mm": 64.0,
            "cavity.width_mm": 64.0,
            "mold.outer_length_mm": 80.0,
            "mold.outer_width_mm": 80.0,
        }
    )
    small, large = coarse_press.at(1.3), indent(double, 2.6, mesh_mm=0.9)
    np.testing.assert_allclose(large.radius_mm, 2.0 * small.radius_mm, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(large.height_mm, 2.0 * small.height_mm, rtol=1e-12, atol=1e-12)
    assert large.force_n == pytest.approx(4.0 * small.force_n, rel=1e-12)
    assert large.contact_radius_mm == pytest.approx(2.0 * small.contact_radius_mm, rel=1e-12)


def test_modulus_scales_the_force_and_leaves_the_shape(
    check_design: SensorDesign, coarse_press: SolvedPress
) -> None:
    stiff = indent(check_design.with_(**{"elastomer.youngs_modulus_mpa": 2.5}), 1.3, mesh_mm=0.45)
    soft = coarse_press.at(1.3)
    np.testing.assert_array_equal(stiff.height_mm, soft.height_mm)
    assert stiff.force_n == pytest.approx(2.5 * soft.force_n, rel=1e-12)
