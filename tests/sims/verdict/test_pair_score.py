"""The verdict on one pair: made-up light whose verdict is known, clipping, and the error of a trace."""

import dataclasses
import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from optopad.design.errors import InputError
from optopad.sims.verdict.depth_curve import (
    clipped,
    noise_margin,
    noise_units,
    share_above,
    sigma_counts,
    trace_noise_warning,
    widened_threshold,
)
from optopad.sims.verdict.pair_score import score_pair, total_length_mm
from tests.said import says

PROPERTY = settings(max_examples=50, deadline=None, derandomize=True)
DEPTH_MM = np.linspace(0.0, 5.0, 101)
FULL_SCALE = 1023.0


def light(onset_mm, last_mm, depth=DEPTH_MM, top_end_mm=1.0):
    """Direct light lost between two depths, top-reflected light lost by `top_end_mm`: 0.8 + 0.2 of 1e-3."""
    direct = 0.8e-3 * np.interp(depth, [onset_mm, last_mm], [1.0, 0.0])
    top = 0.2e-3 * np.interp(depth, [0.0, top_end_mm], [1.0, 0.0])
    return direct, top, direct + top


def score(direct, top, total, depth=DEPTH_MM, counts=800.0, **more):
    more = {"full_scale_counts": FULL_SCALE, **more}
    return score_pair(depth, direct, top, total, gain_counts_per_flux=counts / 1e-3, **more)


def test_contiguous_modes_have_no_deadband():
    result = score(*light(1.0, 3.0))
    assert result.modes.gap_mm == pytest.approx(1.1 - 0.95, abs=1e-9)
    assert result.end_mm == pytest.approx(2.9, abs=1e-9)
    assert result.deadbands_mm == ()
    assert (result.deadband_total_mm, result.deadband_longest_mm, result.continuity) == (0.0, 0.0, 1.0)
    # 0 counts are reached at 3 mm; the last 3 units before it, 3 σ0 at 320 counts/mm, belong to it
    assert result.saturation_mm == pytest.approx((3.0 - 3.0 * sigma_counts(0.0) / 320.0, 5.0), abs=1e-4)


def test_a_trace_s_error_is_no_resolved_depth():
    """The tip blocks all light at 3 mm; beyond it a coarse trace wavers by 5 counts, a standard error of as much."""
    direct, top, total = light(1.0, 3.0)
    wavering = total + np.where(DEPTH_MM > 3.0, 5.0e-3 / 800.0 * np.sin(9.0 * DEPTH_MM) ** 2, 0.0)
    assert score(direct, top, wavering).saturation_mm is None
    error = np.full_like(total, 5.0e-3 / 800.0)
    exact = score(direct, top, total).saturation_mm
    found = score(direct, top, wavering, standard_error=error).saturation_mm
    assert found == pytest.approx(exact, abs=0.05)


def test_modes_apart_leave_the_deadband_between_them():
    result = score(*light(3.0, 4.0))
    assert result.modes.gap_mm == pytest.approx(3.05 - 0.95, abs=1e-9)
    assert len(result.deadbands_mm) == 1
    # 640 counts between the modes: 3 units are 3 σ(640), at 160 counts/mm of mode 1 and 640 of mode 2
    reach = 3.0 * sigma_counts(640.0)
    assert result.deadbands_mm[0] == pytest.approx((1.0 - reach / 160.0, 3.0 + reach / 640.0), abs=5e-4)
    assert result.deadband_longest_mm == result.deadband_total_mm
    assert result.continuity == pytest.approx(1.0 - result.deadband_total_mm / 3.95, abs=1e-12)
    assert result.evenness == pytest.approx(0.0, abs=1e-9)


def test_strength_is_counts_swing_and_steps():
    direct, top, total = light(1.0, 3.0)
    result = score(direct, top, total + 0.25e-3)
    assert result.strength.untouched_counts == pytest.approx(1000.0, rel=1e-12)
    assert result.strength.swing == pytest.approx(0.8, rel=1e-12)
    at_end = 200.0 + 640.0 * 0.05
    steps = (noise_units(1000.0) - noise_units(at_end)) / 3.0
    assert result.strength.resolvable_steps == pytest.approx(steps, rel=1e-3)  # u is straight between samples


def test_a_pair_that_is_never_blocked_is_judged_to_the_deepest_press():
    result = score(*light(8.0, 9.0))
    assert result.end_mm == 5.0
    assert result.modes.mode2_mm == (None, None)
    assert result.modes.gap_at_least_mm == pytest.approx(4.05, abs=1e-9)
    assert result.deadbands_mm[-1][1] == 5.0
    assert result.saturation_mm is None


def test_open_ends_are_null_in_json_and_nothing_is_infinite():
    text = json.dumps(dataclasses.asdict(score(*light(8.0, 9.0))), allow_nan=False)
    row = json.loads(text)
    assert row["modes"]["mode2_mm"] == [None, None]
    assert row["modes"]["gap_mm"] is None
    assert row["saturation_mm"] is None
    assert row["noise_margin"] is None


def test_a_clipped_signal_is_flat_and_said_to_be_clipped():
    # 1500 counts untouched, of which mode 1 takes 300 and leaves 1200: the whole of mode 1 is over full scale
    result = score(*light(1.0, 3.0), counts=1500.0)
    # mode 2 takes 600 counts/mm: 1023 is met at 1 + 177/600 mm
    meets = 1.0 + 177.0 / 600.0
    assert result.is_clipped
    assert result.peak_share_of_full_scale == pytest.approx(1500.0 / 1023.0, rel=1e-12)
    assert result.clipped_share == pytest.approx(meets / 2.9, abs=1e-9)
    assert result.strength.untouched_counts == 1023.0
    assert result.deadbands_mm[0] == pytest.approx((0.0, meets + 3 * sigma_counts(1023.0) / 600.0), abs=1e-3)


def test_a_signal_below_full_scale_is_not_clipped():
    result = score(*light(1.0, 3.0), counts=1023.0)
    assert not result.is_clipped
    assert result.clipped_share == 0.0
    assert result.peak_share_of_full_scale == pytest.approx(1.0, rel=1e-12)


def test_where_clipping_ends_does_not_depend_on_the_samples():
    depth = np.array([0.0, 1.0, 3.0, 5.0])
    coarse = score(*light(1.0, 3.0, depth), depth=depth, counts=1500.0)
    fine = score(*light(1.0, 3.0), counts=1500.0)
    # what is left is the bend of u between samples, as 3 units of 600 counts/mm are only 0.015 mm
    assert coarse.deadbands_mm[0] == pytest.approx(fine.deadbands_mm[0], abs=0.01)
    # shares are of the judged depth, whose end lies on a kink that the cubic rounds off
    ends = [one.clipped_share * one.end_mm for one in (coarse, fine)]
    assert ends[0] == pytest.approx(ends[1], abs=1e-9)


def test_clipping_adds_a_sample_where_any_pair_meets_full_scale():
    depth, counts = clipped(np.array([0.0, 2.0]), np.array([[200.0, 50.0], [0.0, 150.0]]), 100.0)
    np.testing.assert_allclose(depth, [0.0, 1.0, 2.0], atol=1e-12)
    np.testing.assert_allclose(counts, [[100.0, 50.0], [100.0, 100.0], [0.0, 100.0]], atol=1e-12)


def test_share_above_counts_lengths_not_samples():
    depth = np.array([0.0, 1.0, 1.1, 4.0])
    assert share_above(depth, np.array([2.0, 0.0, 0.0, 0.0]), 1.0) == pytest.approx(0.5 / 4.0, abs=1e-12)
    assert share_above(depth, np.full(4, 1.0), 1.0) == 0.0
    assert share_above(depth, np.full(4, 2.0), 1.0) == 1.0


def test_boundaries_move_by_less_than_a_hundredth_when_the_grid_is_doubled():
    def verdict(step):
        depth = np.linspace(0.0, 5.0, round(5.0 / step) + 1)
        direct = 0.8e-3 / (1.0 + np.exp((depth - 3.0) / 0.2))
        top = 0.2e-3 * np.exp(-4.0 * depth)
        return score(direct, top, direct + top, depth=depth)

    coarse, fine = verdict(0.05), verdict(0.025)
    assert abs(coarse.end_mm - fine.end_mm) < 0.01
    assert abs(coarse.modes.gap_mm - fine.modes.gap_mm) < 0.01
    assert len(fine.deadbands_mm) == 1
    np.testing.assert_allclose(coarse.deadbands_mm, fine.deadbands_mm, atol=0.01)
    assert abs(coarse.evenness - fine.evenness) < 0.01


@PROPERTY
@given(onset=st.floats(0.5, 4.0), width=st.floats(0.3, 3.0), counts=st.floats(5.0, 3000.0))
def test_the_parts_of_a_score_agree_with_each_other(onset, width, counts):
    result = score(*light(onset, onset + width), counts=counts)
    assert 0.0 < result.end_mm <= 5.0
    assert result.continuity * result.end_mm + result.deadband_total_mm == pytest.approx(
        result.end_mm, abs=1e-9
    )
    assert all(0.0 <= a < b <= result.end_mm for a, b in result.deadbands_mm)
    assert 0.0 <= result.evenness <= 1.0
    assert result.strength.untouched_counts <= FULL_SCALE
    assert result.is_clipped == (counts > FULL_SCALE)
    if result.saturation_mm is not None:
        assert result.end_mm <= result.saturation_mm[0] < result.saturation_mm[1] == 5.0


# ---- the error of the light trace -----------------------------------------------------------------


def test_noise_margin_is_the_largest_standard_error_in_noise_units():
    counts, error = np.array([800.0, 400.0, 100.0]), np.array([1.2, 1.2, 1.2])
    margin = noise_margin([0.0, 1.0, 2.0], counts, error)
    assert margin == pytest.approx(1.2 / sigma_counts(100.0), rel=1e-12)


def test_noise_margin_looks_only_within_the_interval():
    depth, error = np.array([0.0, 1.0, 2.0, 3.0]), np.array([0.0, 0.1, 0.2, 5.0])
    sigma = sigma_counts(300.0)
    margin = noise_margin(depth, np.full(4, 300.0), error, within_mm=(0.5, 1.5))
    assert margin == pytest.approx(0.15 / sigma, rel=1e-12)


def test_noise_margin_of_several_pairs_is_that_of_the_worst():
    error = np.array([[0.1, 0.2], [0.3, 0.1]])
    margin = noise_margin([0.0, 1.0], np.full((2, 2), 300.0), error)
    assert margin == pytest.approx(0.3 / sigma_counts(300.0), rel=1e-12)


def test_a_fine_trace_draws_no_warning_and_a_coarse_one_names_value_limit_and_way_out():
    assert trace_noise_warning(0.5) is None
    warning = trace_noise_warning(0.8)
    assert "0.8 sigma" in warning
    assert says(warning, "--fine ... 0.5 sigma")
    assert "even with --fine" in trace_noise_warning(0.8, fine=True)


def test_the_threshold_widens_with_the_trace_error():
    assert widened_threshold(0.0) == 3.0
    assert widened_threshold(0.5) == pytest.approx(3.0 + 0.5 * 4.09, rel=1e-12)


def jittered_score(relative_error, seed):
    direct, top, total = light(3.0, 4.0)
    noise = np.random.default_rng(seed).standard_normal(DEPTH_MM.size)
    return score(direct, top, total * (1.0 + relative_error * noise), standard_error=relative_error * total)


def test_jitter_that_hides_a_deadband_leaves_it_possible_and_warns():
    exact = score(*light(3.0, 4.0)).deadband_total_mm
    assert exact == pytest.approx(2.05, abs=0.01)
    for seed in range(5):
        result = jittered_score(0.005, seed)  # 3.2 counts between the modes, where σ is 2.0
        assert result.noise_margin == pytest.approx(0.005 * 800.0 / sigma_counts(800.0), rel=0.02)
        assert result.deadband_total_mm < 0.8 * exact
        assert total_length_mm(result.possible_deadbands_mm) >= exact - 0.01
        assert trace_noise_warning(result.noise_margin) is not None


def test_jitter_below_the_limit_hides_no_deadband():
    exact = score(*light(3.0, 4.0)).deadband_total_mm
    for seed in range(5):
        result = jittered_score(0.0015, seed)
        assert 0.45 < result.noise_margin < 0.5
        assert trace_noise_warning(result.noise_margin) is None
        # one sample at each end, 0.05 mm, may leave or join
        assert result.deadband_total_mm == pytest.approx(exact, abs=0.1)


def test_the_error_of_light_beyond_the_end_of_mode_2_does_not_matter():
    error = np.where(DEPTH_MM > 4.5, 1e-4, 1e-7)
    result = score(*light(3.0, 4.0), standard_error=error)
    assert result.end_mm == pytest.approx(3.95, abs=1e-9)
    assert result.noise_margin < 0.5


def test_an_exact_trace_has_no_further_possible_deadbands():
    result = score(*light(3.0, 4.0), standard_error=np.zeros(DEPTH_MM.size))
    assert result.noise_margin == 0.0
    assert result.possible_deadbands_mm == result.deadbands_mm


# ---- refusals -------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["gain_counts_per_flux", "full_scale_counts"])
def test_a_board_without_gain_or_range_is_refused(name):
    board = {"gain_counts_per_flux": 1e5, "full_scale_counts": 1023.0, name: 0.0}
    with pytest.raises(InputError, match=rf"{name}: 0.0.*over 0"):
        score_pair(DEPTH_MM, *light(1.0, 3.0), **board)


def test_light_that_cannot_be_is_refused():
    direct, top, total = light(1.0, 3.0)
    with pytest.raises(InputError, match=r"total: 0.001 untouched, smallest -0.1, needs over 0 untouched"):
        score(direct, top, np.where(DEPTH_MM > 4.0, -0.1, total))


def test_standard_errors_must_fit_and_not_be_negative():
    with pytest.raises(InputError, match=r"standard_error: shape \(3,\), needs \(101,\)"):
        score(*light(1.0, 3.0), standard_error=np.zeros(3))
    with pytest.raises(InputError, match=r"standard_error_counts: .*no negative value"):
        score(*light(1.0, 3.0), standard_error=np.full(101, -1e-6))
