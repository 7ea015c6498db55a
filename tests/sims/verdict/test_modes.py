"""Mode boundaries of signals whose boundaries are known in closed form."""

from __future__ import annotations

import dataclasses
import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from optopad.design.draft import Draft
from optopad.design.errors import InputError
from optopad.design.preset import preset
from optopad.design.shape.cavity import cavity_of, judged_pairs, mask_of
from optopad.sims.optics.accuracy import LightSignals
from optopad.sims.press import depth_schedule_mm
from optopad.sims.readings.readout import readout_of
from optopad.sims.verdict.builds import score_curves
from optopad.sims.verdict.causes import rise_of
from optopad.sims.verdict.figure_errors import mode_errors_mm
from optopad.sims.verdict.pair_score import find_modes
from optopad.sims.verdict.presses import pair_curves, untouched_flux
from tests.sims.made_up_scores import made_up_pair

PROPERTY = settings(max_examples=60, deadline=None, derandomize=True)
ROUNDING_MM = 1e-12
DEPTH_MM = np.linspace(0.0, 5.0, 51)
KINK_MM = 0.015
"""A seventh of the step: the most that the cubic rounds off a kink between straight pieces, as (1-t)² (1+t) does."""


def fall(depth_mm, from_mm, to_mm, first=1.0, last=0.0):
    """A straight fall between two depths, constant outside."""
    return np.interp(depth_mm, [from_mm, to_mm], [first, last])


def test_a_pair_without_direct_light_has_the_first_mode_alone():
    modes = find_modes(DEPTH_MM, fall(DEPTH_MM, 0.0, 1.0), np.zeros_like(DEPTH_MM))
    assert modes.mode1_mm == pytest.approx((0.05, 0.95), abs=KINK_MM)
    assert (modes.mode2_mm, modes.gap_mm, modes.gap_at_least_mm) == ((None, None), None, None)


def test_straight_falls_give_the_boundaries_and_the_gap_by_hand():
    # T falls 1 -> 0 over 0..1 mm: it leaves 5 % at 0.05 mm and is settled at 0.95 mm.
    # D falls 1 -> 0 over 2..4 mm: 95 % at 2.1 mm, 5 % at 3.9 mm.
    modes = find_modes(DEPTH_MM, fall(DEPTH_MM, 0.0, 1.0), fall(DEPTH_MM, 2.0, 4.0))
    assert modes.mode1_mm == pytest.approx((0.05, 0.95), abs=KINK_MM)
    assert modes.mode2_mm == pytest.approx((2.1, 3.9), abs=ROUNDING_MM)
    assert modes.gap_mm == pytest.approx(1.15, abs=KINK_MM)
    assert modes.gap_at_least_mm is None


def test_overlapping_modes_have_a_negative_gap():
    modes = find_modes(DEPTH_MM, fall(DEPTH_MM, 0.0, 2.0), fall(DEPTH_MM, 1.0, 3.0))
    assert modes.gap_mm == pytest.approx(1.1 - 1.9, abs=ROUNDING_MM)


def test_straight_lines_are_met_exactly_between_samples():
    depth = np.array([0.0, 1.0, 3.5, 5.0])
    line = 1.0 - 0.2 * depth
    modes = find_modes(depth, line, line)
    assert modes.mode1_mm == pytest.approx((0.25, 4.75), abs=ROUNDING_MM)
    assert modes.mode2_mm == pytest.approx((0.25, 4.75), abs=ROUNDING_MM)


def test_the_cubic_by_hand_where_a_fall_ends_between_samples():
    """Slopes -1 and 0 at the ends of the last step make 0.1 (1 - t)² (1 + t), which is 0.05 at t = 0.40303."""
    end = find_modes(DEPTH_MM, fall(DEPTH_MM, 0.0, 1.0), fall(DEPTH_MM, 2.0, 4.0)).mode1_mm[1]
    share = (end - 0.9) / 0.1
    assert (1.0 - share) ** 2 * (1.0 + share) == pytest.approx(0.5, abs=1e-9)


def test_a_temporary_dip_of_direct_light_does_not_start_mode_2():
    dip = 0.3 * np.exp(-(((DEPTH_MM - 1.0) / 0.2) ** 2))
    modes = find_modes(DEPTH_MM, fall(DEPTH_MM, 0.0, 1.0), fall(DEPTH_MM, 3.0, 4.0) - dip)
    # at 3 mm the dip is e^-100 of 0.3, nothing to rounding
    assert modes.mode2_mm[0] == pytest.approx(3.05, abs=KINK_MM)


def test_a_permanent_dip_starts_mode_2():
    direct = np.interp(DEPTH_MM, [0.5, 1.5, 3.0, 4.0], [1.0, 0.5, 0.9, 0.0])
    modes = find_modes(DEPTH_MM, fall(DEPTH_MM, 0.0, 1.0), direct)
    assert modes.mode2_mm[0] == pytest.approx(0.6, abs=ROUNDING_MM)


def test_light_that_first_rises_starts_mode_2_only_when_it_is_lost():
    direct = np.interp(DEPTH_MM, [0.0, 1.0, 2.0, 3.0], [1.0, 1.15, 1.0, 0.0])
    modes = find_modes(DEPTH_MM, fall(DEPTH_MM, 0.0, 1.0), direct)
    assert modes.mode2_mm == pytest.approx((2.05, 2.95), abs=KINK_MM)


def test_top_light_that_overshoots_settles_at_its_last_exit():
    # range 1.2: band 0.06 round the last value 0.2; it leaves the band for good on 0 -> 0.2 at 0.14
    top = np.interp(DEPTH_MM, [0.0, 1.0, 2.0], [1.2, 0.0, 0.2])
    modes = find_modes(DEPTH_MM, top, fall(DEPTH_MM, 3.0, 4.0))
    assert modes.mode1_mm == pytest.approx((0.05, 1.7), abs=ROUNDING_MM)


def test_top_light_that_rises_at_first_starts_mode_1():
    # range 1.1: band 0.055 round the first value 1, left upward at 0.055 / 0.1 mm
    top = np.interp(DEPTH_MM, [0.0, 1.0, 2.0], [1.0, 1.1, 0.0])
    assert find_modes(DEPTH_MM, top, fall(DEPTH_MM, 3.0, 4.0)).mode1_mm[0] == pytest.approx(0.55, abs=1e-12)


def test_mode_2_that_never_starts_is_open_and_bounds_the_gap():
    modes = find_modes(DEPTH_MM, fall(DEPTH_MM, 0.0, 0.4), np.full(51, 0.7))
    assert modes.mode2_mm == (None, None)
    assert modes.gap_mm is None
    assert modes.gap_at_least_mm == pytest.approx(5.0 - 0.38, abs=KINK_MM)


def test_never_is_null_in_json():
    modes = find_modes(DEPTH_MM, fall(DEPTH_MM, 0.0, 0.4), np.full(51, 0.7))
    row = json.loads(json.dumps(dataclasses.asdict(modes), allow_nan=False))
    assert row["mode2_mm"] == [None, None]
    assert row["gap_mm"] is None


def test_mode_2_that_starts_but_does_not_end_has_an_open_end():
    modes = find_modes(DEPTH_MM, fall(DEPTH_MM, 0.0, 1.0), fall(DEPTH_MM, 3.73, 6.0))
    assert modes.mode2_mm[1] is None
    # the fall starts between two samples, 3.7 and 3.8 mm, and 95 % lies beyond them on the line itself
    assert modes.mode2_mm[0] == pytest.approx(3.73 + 0.05 * 2.27, abs=KINK_MM)
    assert modes.gap_mm == pytest.approx(3.73 + 0.05 * 2.27 - 0.95, abs=2 * KINK_MM)


def test_top_light_that_never_changes_has_an_empty_mode_1():
    modes = find_modes(DEPTH_MM, np.zeros(51), fall(DEPTH_MM, 2.0, 4.0))
    assert modes.mode1_mm == (0.0, 0.0)
    assert modes.gap_mm == pytest.approx(2.1, abs=ROUNDING_MM)


@pytest.mark.parametrize("step_mm", [0.1, 0.05])
def test_boundaries_of_smooth_signals_do_not_depend_on_the_grid(step_mm):
    def boundaries(step):
        depth = np.linspace(0.0, 5.0, round(5.0 / step) + 1)
        modes = find_modes(depth, np.exp(-3.0 * depth), 1.0 / (1.0 + np.exp((depth - 2.5) / 0.25)))
        return np.array([*modes.mode1_mm, *modes.mode2_mm])

    # straight lines would be off by curvature x step²/8 over slope = 0.004 mm at 0.1 mm, for T; cubics by less
    assert np.max(np.abs(boundaries(step_mm) - boundaries(step_mm / 2.0))) < 0.004


@pytest.mark.slow
def test_boundaries_converge_faster_than_the_square_of_the_step():
    rates = np.linspace(2.0, 4.0, 101)  # moves the boundary through all positions between samples

    def worst_error(step):
        depth = np.linspace(0.0, 5.0, round(5.0 / step) + 1)
        errors = []
        for k in rates:
            exact = -np.log(np.exp(-5.0 * k) + 0.05 * (1.0 - np.exp(-5.0 * k))) / k
            errors.append(abs(find_modes(depth, np.exp(-k * depth), fall(depth, 2, 4)).mode1_mm[1] - exact))
        return max(errors)

    errors = [worst_error(step) for step in (0.1, 0.05, 0.025)]
    orders = np.log2(np.divide(errors[:-1], errors[1:]))
    assert (
        orders > 2.7
    ).all()  # the slopes of a monotone cubic are good to step², its values to step³ on smooth falls
    assert errors[0] < 4.0 * 0.1**2 / 8.0  # at the usual step already below the straight line's k step²/8


@PROPERTY
@given(scale=st.floats(0.1, 10.0), light=st.floats(1e-6, 1e3))
def test_boundaries_scale_with_depth_and_ignore_the_unit_of_light(scale, light):
    top, direct = fall(DEPTH_MM, 0.0, 1.3), fall(DEPTH_MM, 1.9, 3.7)
    modes = find_modes(DEPTH_MM, top, direct)
    scaled = find_modes(DEPTH_MM * scale, top * light, direct * light)
    assert scaled.mode1_mm == pytest.approx(np.multiply(modes.mode1_mm, scale), rel=1e-9)
    assert scaled.mode2_mm == pytest.approx(np.multiply(modes.mode2_mm, scale), rel=1e-9)
    assert scaled.gap_mm == pytest.approx(modes.gap_mm * scale, rel=1e-9)


@pytest.mark.parametrize(
    ("depth", "message"),
    [
        ([0.1, 1.0, 2.0], r"depth_mm\[0\]: 0.1 mm, needs 0 mm"),
        ([0.0, 1.0, 1.0], r"depth_mm\[2\]: 1.0 mm, needs more than 1.0 mm"),
        ([0.0, np.nan, 1.0], "not finite"),
        ([0.0], r"shape \(1,\), needs \(n,\) with n >= 2"),
    ],
)
def test_unusable_depths_are_refused_with_the_way_out(depth, message):
    with pytest.raises(InputError, match=message):
        find_modes(depth, np.ones(len(depth)), np.ones(len(depth)))


def test_samples_that_do_not_fit_the_depths_are_refused_by_name():
    with pytest.raises(InputError, match=r"top: shape \(3,\), needs \(51,\)"):
        find_modes(DEPTH_MM, np.ones(3), np.ones(51))
    with pytest.raises(InputError, match="direct: has"):
        find_modes(DEPTH_MM, np.ones(51), np.full(51, np.nan))


@pytest.mark.parametrize("tolerance", [0.0, 0.5, np.nan])
def test_an_impossible_tolerance_is_refused(tolerance):
    with pytest.raises(InputError, match=r"tolerance: .*below 0.5"):
        find_modes(DEPTH_MM, np.ones(51), np.ones(51), tolerance=tolerance)


def test_an_error_moves_a_boundary_by_itself_over_the_slope():
    """Shifting the whole direct curve by its error moves the level's crossing by what is stated, to the curvature."""
    curves = made_up_pair(onset_mm=1.0, last_mm=3.0).curves
    modes = find_modes(curves.depth_mm, curves.top, curves.direct)
    _, (_, stated) = mode_errors_mm(curves, modes)
    level = 0.05 * curves.direct[0]
    crossings = [
        float(np.interp(-level, -(curves.direct + shift), curves.depth_mm))
        for shift in (-curves.standard_error, curves.standard_error)
    ]
    assert stated == pytest.approx(0.5 * (crossings[1] - crossings[0]), rel=0.1)


def test_twice_the_error_moves_boundaries_twice_as_far_and_open_ones_have_none():
    curves = made_up_pair(onset_mm=3.0, last_mm=9.0).curves
    modes = find_modes(curves.depth_mm, curves.top, curves.direct)
    (start, end), (onset, last) = mode_errors_mm(curves, modes)
    doubled = mode_errors_mm(replace(curves, standard_error=2 * curves.standard_error), modes)
    assert modes.mode2_mm[1] is None
    assert last is None
    assert doubled[0] == pytest.approx((2 * start, 2 * end))
    assert doubled[1][0] == pytest.approx(2 * onset)


BOUNDARY_MM = 0.05
DEADBAND_MM = 0.15


def scores_of(design, *, seed, step_mm, pairs=None):
    cavity = cavity_of(design)
    pairs = pairs or judged_pairs(cavity)
    readout = readout_of(
        Draft.of(design), untouched_flux(Draft.of(design), seed=seed), mask_of(pairs, cavity)
    )
    depth_mm = depth_schedule_mm(design.operating.max_depth_mm, step_mm)
    return [score_curves(c, readout) for c in pair_curves(Draft.of(design), pairs, depth_mm, seed=seed)]


@pytest.mark.slow
@pytest.mark.parametrize("thickness_mm", [8.0, 9.0], ids=["contiguous", "deadband"])
@pytest.mark.parametrize(("seed", "step_mm"), [(0, 0.2), (1, 0.1)], ids=["double step", "other seed"])
def test_boundaries_and_deadbands_stay(thickness_mm, seed, step_mm):
    design = preset("piacenza2017-pair").with_(**{"cavity.clear_thickness_mm": thickness_mm})
    check_same(scores_of(design, seed=0, step_mm=0.1), scores_of(design, seed=seed, step_mm=step_mm))


@pytest.mark.full
def test_boundaries_and_deadbands_of_the_pad_stay():
    """The pairs of one emitter, of the two kinds that the ring's turns leave."""
    design = preset("piacenza2017-pad")
    pairs = tuple(pair for pair in judged_pairs(cavity_of(design)) if pair[0] == 0)
    before = scores_of(design, seed=0, step_mm=0.1, pairs=pairs)
    check_same(before, scores_of(design, seed=0, step_mm=0.2, pairs=pairs))
    check_same(before, scores_of(design, seed=1, step_mm=0.1, pairs=pairs))


@pytest.mark.slow
def test_boundaries_stay_where_mode_1_is_over_in_0_3_mm():
    """Boundaries only: the outer pairs are flat from 0.00 to 0.30 mm, just a deadband's least length, now and then."""
    design = preset("piacenza2017-pair").with_(**{"cavity.clear_thickness_mm": 12.0})
    before = scores_of(design, seed=0, step_mm=0.1)
    check_same(before, scores_of(design, seed=0, step_mm=0.2), with_deadbands=False)


def check_same(before, after, *, with_deadbands=True):
    for old, new in zip(before, after, strict=True):
        ends = zip(
            old.modes.mode1_mm + old.modes.mode2_mm, new.modes.mode1_mm + new.modes.mode2_mm, strict=True
        )
        for was, now in ends:
            assert (was is None) == (now is None)
            if was is not None and now is not None:
                assert now == pytest.approx(was, abs=BOUNDARY_MM)
        if with_deadbands:
            assert new.deadband_total_mm == pytest.approx(old.deadband_total_mm, abs=DEADBAND_MM)


PAIRS = {"E1-R1": (0, 0), "E1-R2": (0, 1)}


def light(pressed: tuple[float, float], error: float = 0.0) -> LightSignals:
    """Two pairs of 1, untouched and under one press; what changes is mirrored by the smooth top."""
    flux = np.array([[[1.0, 1.0]], [list(pressed)]])
    straight = np.full_like(flux, 0.2)
    dark = np.zeros_like(flux)
    return LightSignals(
        flux=flux,
        by_class={"direct": straight, "top": flux - straight, "skirt": dark, "diffuse": dark},
        standard_error=np.full_like(flux, error),
        presses=np.array([[5.0, 5.0, 0.0], [5.0, 6.0, 3.0]]),
        digest="",
        seed=0,
    )


def test_the_pair_that_rises_most_is_named_with_its_press_and_the_light_that_grows() -> None:
    found = rise_of(light((1.41, 1.2)), PAIRS)
    assert found is not None
    assert (found.pair, found.place_mm, found.depth_mm, found.part) == (
        "E1-R1",
        (5.0, 6.0),
        3.0,
        "smooth top",
    )
    assert np.isclose(found.share, 1.41)
    assert (found.pairs, found.judged) == (2, 2)
    assert "141 % of its untouched" in found.sentence.replace("%", " %")
    assert found.to_json()["pair"] == "E1-R1"


def test_a_rise_within_the_lights_error_or_below_5_percent_is_none() -> None:
    assert rise_of(light((1.41, 0.5), error=0.3), PAIRS) is None
    assert rise_of(light((1.04, 0.5)), PAIRS) is None


def test_a_pair_that_is_dark_untouched_does_not_rise() -> None:
    one = light((0.9, 1.0))
    flux = one.flux.copy()
    flux[:, 0, 1] = [0.001, 0.1]
    assert rise_of(replace(one, flux=flux), PAIRS) is None
