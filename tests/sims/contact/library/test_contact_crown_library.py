"""Crowned pads from the shipped library: what it holds, its limits, and what a crown does to a press."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from optopad.design.errors import InputError, ModelScopeError
from optopad.design.rules.shape import LARGEST_REACH, WALL_RADIUS_RANGE
from optopad.sims.contact.library.live_press import fit_press
from optopad.sims.contact.library.profile_library import (
    CORNER,
    CROWN_CENTRE,
    CROWN_LAYERS,
    CROWN_RADII,
    Library,
    shipped_library,
)
from optopad.sims.contact.library.smooth_press import (
    POISSON_RATIOS,
    SmoothPress,
    above_crown,
    nearly_incompressible,
    off_crown,
)
from optopad.sims.contact.library.stored_press import stored_press
from optopad.sims.contact.scope import WALL_RADIUS, crown_drop, require_rim
from tests.validation.contact.library_build import (
    all_pads,
    crown_changes,
    crowned_pads,
    entry_inputs,
    largest_crown,
    library_depths,
    library_differences,
    slope_and_bow,
    solved_crowns,
)
from tests.validation.contact.library_interpolation import distances_um

DOME = (4.5, 5.5, 1 / 9)
"""Layer, wall and crown of the preset of a domed fingertip."""


@pytest.fixture(scope="module")
def library() -> Library:
    return shipped_library()


def rms_um(left: SmoothPress, right: SmoothPress, depth: float) -> float:
    """Distance of one curve's points from the other curve, for a tip of 3 mm [um]."""
    return float(np.sqrt(np.mean(distances_um(left, right, depth) ** 2)))


def test_flat_pads_hear_nothing_of_crowns(library: Library) -> None:
    nothing = replace(
        library.crowned, slopes=np.nan * library.crowned.slopes, bow=np.nan * library.crowned.bow
    )
    for layer in (1.3, 2.125, 3.3, 6.0):
        for radius in (None, 4.2, 7.5):
            press = library.press(layer, radius)
            without = replace(library, crowned=nothing).press(layer, radius, 0.0)
            assert (press.crown, without.crown) == (0.0, 0.0)
            np.testing.assert_array_equal(without.coefficients, press.coefficients)
            for name in ("radius", "height", "inclination"):
                here, there = (getattr(one.curve_at(0.7), name) for one in (press, without))
                np.testing.assert_array_equal(here, there)


def test_the_largest_crown_nearly_touches_a_limit(library: Library) -> None:
    for layer in np.linspace(CROWN_LAYERS[0], CROWN_LAYERS[-1], 7):
        for radius in np.linspace(*WALL_RADIUS_RANGE, 5):
            largest = largest_crown(layer, radius)
            library.press(layer, radius, largest)
            with pytest.raises(ModelScopeError):
                library.press(layer, radius, largest + 2e-4)


def test_half_and_whole_of_the_largest_crown_are_solved_at_the_centre_the_whole_elsewhere() -> None:
    assert solved_crowns(*CROWN_CENTRE) == pytest.approx(
        (0.5 * largest_crown(*CROWN_CENTRE), largest_crown(*CROWN_CENTRE))
    )
    assert solved_crowns(6.0, WALL_RADIUS) == (largest_crown(6.0, WALL_RADIUS),)
    assert len(crowned_pads()) == len(CROWN_LAYERS) + len(CROWN_RADII) - 1


def test_a_crowned_press_is_the_flat_one_and_a_parabola_of_the_crown(library: Library) -> None:
    for row, layer in enumerate(CROWN_LAYERS):
        for column, radius in enumerate(CROWN_RADII):
            slope, bow = library.crowned.slopes[row, column], library.crowned.bow
            for share in (0.3, 1.0):
                crown = share * largest_crown(layer, radius)
                press = library.press(layer, radius, crown)
                expected = library.press(layer, radius).coefficients + crown * slope + crown**2 * bow
                np.testing.assert_allclose(press.coefficients, expected, atol=1e-9)
                assert (press.crown, press.layer_depth, press.wall_radius) == (crown, layer, radius)
                assert press.deepest == pytest.approx(1.7)


def test_solved_presses_come_back(library: Library) -> None:
    """From presses of the library itself the same changes follow, so a solved press is reproduced."""
    presses = {pad: [library.press(*pad, crown) for crown in solved_crowns(*pad)] for pad in crowned_pads()}
    changes = crown_changes({pad: library.press(*pad) for pad in presses}, presses)
    np.testing.assert_array_equal(changes.layers, CROWN_LAYERS)
    np.testing.assert_array_equal(changes.radii, CROWN_RADII)
    for pad, of_pad in presses.items():
        for press in of_pad:
            # single precision of the stored factors
            np.testing.assert_allclose(
                changes.at(*pad, press.crown), library.crowned.at(*pad, press.crown), atol=1e-6
            )


def test_slope_and_bow_are_those_of_a_parabola(library: Library) -> None:
    flat = library.press(*CROWN_CENTRE)
    wave = np.sin(np.arange(flat.coefficients.size)).reshape(flat.coefficients.shape)
    crowned = [
        replace(
            flat, crown=crown, coefficients=flat.coefficients + 2.0 * crown * wave - 3.0 * crown**2 * wave
        )
        for crown in (0.07, 0.15)
    ]
    slope, bow = slope_and_bow(flat, crowned)
    np.testing.assert_allclose(slope, 2.0 * wave, atol=1e-10)
    np.testing.assert_allclose(bow, -3.0 * wave, atol=1e-9)


def test_every_press_is_solved_once() -> None:
    pads = all_pads()
    assert len(set(pads)) == len(pads)
    for layer, radius, crown in pads:
        require_rim(layer, radius, crown)
    assert {pad[:2] for pad in pads if pad[2]} == set(crowned_pads())


@pytest.mark.parametrize("depth", [0.003, 0.05, 0.25, 1.0, 1.7])
def test_a_crown_that_flattens_ends_in_the_flat_pad(library: Library, depth: float) -> None:
    for layer, radius, _ in (DOME, (2.2, 4.0, 0.1), (6.0, 7.5, 0.1)):
        flat, nearly = library.press(layer, radius), library.press(layer, radius, 1e-6)
        assert nearly.force_at(depth) == pytest.approx(flat.force_at(depth), rel=1e-5)
        # the other curve is sampled every fifth of a micrometre
        assert distances_um(nearly, flat, depth).max() < 0.3


def test_press_is_continuous_in_layer_wall_and_crown(library: Library) -> None:
    step = np.array([1e-7, 1e-7, 1e-9])
    for pad in (DOME, (3.0, 16 / 3, 0.1), (3.0, 4.5, 0.15), (2.126, 5.4, 0.1)):
        below, above = (library.press(*map(float, np.array(pad) + sign * step)) for sign in (-1.0, 1.0))
        for depth in (0.1, 0.5, 1.0, 1.7):
            assert above.force_at(depth) == pytest.approx(below.force_at(depth), rel=1e-6)
            assert distances_um(above, below, depth).max() < 0.3


def test_force_grows_with_depth_and_falls_with_the_crown(library: Library) -> None:
    for layer, radius, _ in (DOME, (3.0, 4.0, 0.0), (2.2, 5.0, 0.0), (6.0, 7.5, 0.0)):
        crowns = np.linspace(0.0, largest_crown(layer, radius), 9)
        presses = [library.press(layer, radius, float(crown)) for crown in crowns]
        depths = np.linspace(0.002, 1.7, 60)
        force = np.array([[press.force_at(float(depth)) for depth in depths] for press in presses])
        assert np.all(np.diff(force, axis=1) > 0.0)
        assert np.all(np.diff(force, axis=0) < 0.0)


@pytest.mark.parametrize("depth", [0.0, 0.003, 0.2, 0.9, 1.7])
def test_surface_runs_from_the_tip_to_the_rim(library: Library, depth: float) -> None:
    for layer, radius, crown in (DOME, (3.0, 3.95, 0.2), (2.5, 4.6, 0.13)):
        press = library.press(layer, radius, crown)
        curve = press.curve_at(depth)
        assert (curve.radius[0], curve.height[0]) == pytest.approx((0.0, -depth), abs=1e-12)
        rim = -float(crown_drop(np.array(radius), crown))
        assert (curve.radius[-1], curve.height[-1]) == pytest.approx((radius, rim), abs=1e-9)
        above = above_crown(curve, crown)
        assert above.height[-1] == pytest.approx(0.0, abs=1e-9)
        beyond = above.radius > 2.5
        # what rises beside the tip is lower than its rise in the thinnest layer, and nothing ripples down
        assert np.all(above.height[beyond] > -0.02 * depth - 1e-9)
        assert np.all(above.height[beyond] < 0.3 * depth + 1e-9)


def test_what_the_tip_displaces_rises_beside_it(library: Library) -> None:
    for layer, radius, crown in (DOME, (3.0, 3.95, 0.2), (2.5, 4.6, 0.13)):
        curve = above_crown(library.press(layer, radius, crown).curve_at(0.6), crown)
        moment = 2.0 * np.pi * curve.radius * curve.height
        dimple = -float(np.trapezoid(np.minimum(moment, 0.0), curve.radius))
        # as in flat pads, what is left of the volume's loss grows with the layer's share of the pad
        assert abs(float(np.trapezoid(moment, curve.radius))) < 0.25 * dimple


def test_points_are_taken_off_a_crown_and_put_back() -> None:
    points = np.stack([np.linspace(0.0, 4.0, 30), np.linspace(-1.0, 0.2, 30)], axis=1)
    off = off_crown(points, 4.0, 0.2)
    np.testing.assert_allclose(off[:, 1] - points[:, 1], 5.0 - np.sqrt(25.0 - points[:, 0] ** 2), atol=1e-12)
    np.testing.assert_allclose(off_crown(off, 4.0, -0.2), points, atol=1e-14)
    assert off_crown(points, 4.0, 0.0) is points
    np.testing.assert_array_equal(off_crown(points + np.array([0.1, 0.0]), 4.0, 0.2)[-1, 1], off[-1, 1])


def test_pads_outside_the_solved_walls_are_moved_in(library: Library) -> None:
    for asked, taken in ((8.0, WALL_RADIUS_RANGE[1]), (2.0, WALL_RADIUS_RANGE[0])):
        there, here = library.press(4.0, asked, 0.07), library.press(4.0, taken, 0.07)
        assert there.wall_radius == taken
        np.testing.assert_array_equal(there.coefficients, here.coefficients)


@pytest.mark.parametrize(
    ("pad", "error", "message"),
    [
        ((3.0, 5.0, -0.1), InputError, r"crown: -0\.1 must be 0 \(flat\) or more"),
        ((3.0, 5.0, float("nan")), InputError, "crown: nan must be 0"),
        ((6.0, 3.0, 0.26), ModelScopeError, r"3\.846.*4 or"),
        ((2.1, 4.0, 0.05), ModelScopeError, r"layer: 2\.100 tip radii.* 2\.125 to 6; take a thicker layer"),
        ((6.5, 4.0, 0.05), ModelScopeError, r"layer: 6\.500 tip radii.* 2\.125 to 6; take a thinner layer"),
        ((6.0, 5.0, 0.17), ModelScopeError, r"5\.000.*0\.850.*0\.8 at"),
        ((6.0, 9.0, 0.09), ModelScopeError, r"9\.000 tip radii lies at 0\.810"),
        ((6.0, 3.0, 0.22), ModelScopeError, r"3\.761 tip radii lies at 0\.827 .* a smaller tip"),
        ((2.2, 5.0, 0.15), ModelScopeError, "larger crown radius"),
    ],
)
def test_crowns_that_are_not_covered_are_refused(
    library: Library, pad: tuple[float, float, float], error: type[Exception], message: str
) -> None:
    with pytest.raises(error, match=message):
        library.press(*pad)


def test_limits_themselves_are_covered(library: Library) -> None:
    assert library.press(6.0, 4.0, LARGEST_REACH / 4.0).crown == pytest.approx(0.2)
    assert library.press(CORNER, 4.0, 0.05).layer_depth == pytest.approx(CORNER)
    assert library.press(6.0, 4.0, 0.05).layer_depth == pytest.approx(6.0)


def test_difference_of_two_libraries_sees_their_crowns(library: Library) -> None:
    slopes = library.crowned.slopes.copy()
    slopes[:, :, :, 0] += 0.1  # force by exp(0.1 crown)
    other = replace(library, crowned=replace(library.crowned, slopes=slopes))
    force, surface = library_differences(other, library)
    largest = max(largest_crown(layer, radius) for layer in CROWN_LAYERS for radius in CROWN_RADII)
    assert (force, surface) == (pytest.approx(np.expm1(0.1 * largest)), 0.0)
    assert library_differences(library, library) == (0.0, 0.0)


@pytest.mark.full
def test_a_crowned_pad_solved_live_is_the_shipped_one(library: Library) -> None:
    crown = solved_crowns(*CROWN_CENTRE)[1]
    depths = library_depths(CROWN_CENTRE[0])
    # the first part of the depths; the spline through them differs from the whole one near its end only
    layer, radius = CROWN_CENTRE
    soft, stiff = (
        stored_press(replace(entry_inputs(layer, ratio, radius, crown), depths=depths[:24]))[0]
        for ratio in POISSON_RATIOS
    )
    live, shipped = (
        nearly_incompressible(fit_press(soft), fit_press(stiff)),
        library.press(layer, radius, crown),
    )
    for depth in depths[2:18:3]:
        # another processor rounds differently and may leave a facet in or out of contact
        assert live.force_at(depth) == pytest.approx(shipped.force_at(depth), rel=5e-3)
        assert rms_um(live, shipped, depth) < 3.0
