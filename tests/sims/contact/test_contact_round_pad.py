"""The round pad that stands for a rectangular one: its radius, its presses, and how its surface runs out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from optopad.design.preset import preset
from optopad.design.spec import SensorDesign
from optopad.sims.contact import indent
from optopad.sims.contact.indentation import solved_press
from optopad.sims.contact.library.profile_library import (
    LAYERS,
    PAD_RADII,
    WALL_LAYERS,
    Library,
    shipped_library,
)
from optopad.sims.contact.library.smooth_press import LONGEST, TopCurve, _arc_shares, run_out, sample_arcs
from optopad.sims.contact.scope import HALF_WIDTH, WALL_RADIUS, contact_of, half_width_of, round_radius


@pytest.fixture(scope="module")
def library() -> Library:
    return shipped_library()


def volume(radius: np.ndarray, height: np.ndarray) -> float:
    """Of a surface of revolution over the undisturbed one, by trapezia."""
    return float(2.0 * np.pi * np.trapezoid(radius * height, radius))


def test_round_pads_have_the_area_of_the_cavity() -> None:
    for name in ("piacenza2017-pad", "piacenza2017-pair", "fingertip-16"):
        design = preset(name)
        radius = contact_of(design).wall_radius * design.indenter.tip_radius_mm
        assert np.pi * radius**2 == pytest.approx(design.cavity.length_mm * design.cavity.width_mm)
        assert half_width_of(radius) == pytest.approx(0.5 * design.cavity.length_mm)
        assert solved_press(contact_of(design)).smooth.wall_radius == pytest.approx(
            contact_of(design).wall_radius
        )
    # the largest that is solved stands for larger ones
    assert contact_of(preset("oblong-60x40")).wall_radius == PAD_RADII[-1]


def test_samples_beside_the_contact_stay_where_the_wall_goes() -> None:
    near, far = sample_arcs(3.4, 3.8), sample_arcs(7.1, 7.5)
    np.testing.assert_array_equal(sample_arcs(5.0, WALL_RADIUS), 5.0 * _arc_shares())
    for arcs, length in ((near, 3.4), (far, 7.1)):
        assert (arcs[0], arcs[-1]) == pytest.approx((0.0, length))
        assert np.all(np.diff(arcs) > 0.0)
    # slopes at the contact are 16/3 of the share of the wall's radius that is free: 4.8 and 5.0
    assert near[10] == pytest.approx(far[10], rel=0.1)


def test_the_library_holds_every_solved_pad(library: Library) -> None:
    assert set(WALL_LAYERS) <= set(LAYERS)
    for row, layer in enumerate(WALL_LAYERS):
        for column, radius in enumerate(PAD_RADII):
            press = library.press(layer, radius)
            expected = library.coefficients[LAYERS.index(layer)] + library.wall_changes[row, column]
            np.testing.assert_allclose(press.coefficients, expected, atol=1e-9)
            assert press.curve_at(0.5).radius[-1] == pytest.approx(radius)
    np.testing.assert_array_equal(
        library.press(2.5, WALL_RADIUS).coefficients, library.press(2.5).coefficients
    )


def test_a_smaller_pad_is_stiffer_and_rises_more(library: Library) -> None:
    for layer in (1.6, 3.0, 5.0):
        presses = [library.press(layer, radius) for radius in np.linspace(3.8, 7.5, 20)]
        force = np.array([press.force_at(0.6) for press in presses])
        assert np.all(np.diff(force) < 0.0)
        height = [float(np.interp(2.0, *_outside(press.curve_at(0.6)))) for press in presses]
        assert height[0] > height[-1]


def _outside(curve: TopCurve) -> tuple[np.ndarray, np.ndarray]:
    beyond = curve.radius > 1.2
    return curve.radius[beyond], curve.height[beyond]


@pytest.mark.parametrize("radius", [3.8, 4.2, 5.0, 6.018, 7.5])
@pytest.mark.parametrize(("layer", "limit"), [(2.125, 0.05), (3.0, 0.1), (6.0, 0.26)])
def test_what_the_tip_displaces_rises_beside_it(
    library: Library, layer: float, limit: float, radius: float
) -> None:
    """Elements lock as Poisson's ratio nears a half, and what is left of the volume's loss grows with the layer's
    share of the pad: to 3, 7 and 25 % of the dimple here (docs/understand/model.md)."""
    curve = library.press(layer, radius).curve_at(0.6)
    displaced = -volume(curve.radius[curve.height < 0], curve.height[curve.height < 0])
    assert -limit * displaced < volume(curve.radius, curve.height) < 0.01 * displaced


@pytest.mark.parametrize("left_out", [1, 2])
def test_a_left_out_pad_is_found_again_from_the_others(library: Library, left_out: int) -> None:
    kept = np.arange(len(PAD_RADII)) != left_out
    thinned = replace(library, pad_radii=library.pad_radii[kept], wall_changes=library.wall_changes[:, kept])
    true, found = (one.press(3.0, PAD_RADII[left_out]) for one in (library, thinned))
    for depth in (0.1, 0.5, 1.0, 1.5):
        # found: 0.34 % and 4.2 µm; the gaps are twice the library's, so these are 4 to 16 times its errors. No wall at
        # all would be off by 1.2 % and more
        assert found.force_at(depth) == pytest.approx(true.force_at(depth), rel=0.005)
        at = np.linspace(1.3, PAD_RADII[left_out] - 0.1, 40)
        here, there = (np.interp(at, *_outside(press.curve_at(depth))) for press in (true, found))
        assert np.abs(here - there).max() * 3000.0 < 6.0


def made_up(height_at_half: float, slope: float) -> TopCurve:
    """A straight line through a height at the half width of a pad, beyond a flat part."""
    radius = np.linspace(2.0, 6.0, 41)
    return TopCurve(
        radius=radius,
        height=height_at_half + slope * (radius - HALF_WIDTH),
        inclination=np.full_like(radius, np.arctan(slope)),
        contact_radius=0.5,
    )


@pytest.mark.parametrize(("height", "slope"), [(0.05, -0.07), (0.01, -0.2), (0.05, 0.01), (-0.02, 0.05)])
def test_a_curve_is_followed_to_half_the_width_and_runs_out_without_a_dip(
    height: float, slope: float
) -> None:
    whole, found = made_up(height, slope), run_out(made_up(height, slope), HALF_WIDTH)
    inside = found.radius < HALF_WIDTH
    np.testing.assert_array_equal(found.height[inside], whole.height[: int(inside.sum())])
    assert found.height[int(inside.sum())] == pytest.approx(height)
    assert found.inclination[int(inside.sum())] == pytest.approx(np.arctan(slope))
    assert (found.height[-1], found.inclination[-1]) == pytest.approx((0.0, 0.0), abs=1e-12)
    assert found.radius[-1] <= (1.0 + LONGEST) * HALF_WIDTH + 1e-12
    assert np.all(found.height[~inside] * np.sign(height) >= -1e-12)
    assert np.all(np.diff(found.radius) > 0.0)


def test_a_curve_that_ends_inside_the_pad_is_left_alone() -> None:
    whole = made_up(0.05, -0.07)
    assert run_out(whole, 7.0) is whole


def test_what_light_sees_ends_flat_and_beyond_the_walls() -> None:
    press = indent(preset("piacenza2017-pad"), 3.0)
    assert press.inclination_deg is not None
    assert press.radius_mm[-1] > 16.0
    assert (press.height_mm[-1], press.inclination_deg[-1]) == pytest.approx((0.0, 0.0), abs=1e-9)
    assert np.all(press.height_mm[press.radius_mm > 16.0] >= -1e-9)


def test_a_pad_too_small_for_its_tip_is_told() -> None:
    small = too_small()
    (note,) = solved_press(contact_of(small)).notes
    assert "12 x 12 mm" in note
    assert "smaller tip" in note
    assert solved_press(contact_of(preset("piacenza2017-pair"))).notes == ()


def too_small() -> SensorDesign:
    """A tip of 3 mm on a pad of 12 mm: 2.26 tip radii."""
    return preset("piacenza2017-pair").with_(**{"cavity.length_mm": 12.0, "cavity.width_mm": 12.0})


def test_radius_of_the_round_pad_scales() -> None:
    assert round_radius(2.0, 2.0) == pytest.approx(2.0 / np.sqrt(np.pi))
    assert half_width_of(round_radius(6.0, 6.0)) == pytest.approx(3.0)
