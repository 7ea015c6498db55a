"""Deadbands of signals given in noise units, where every answer is known by hand.

Signals are drawn in noise units and turned into counts by the inverse scale.
"""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from optopad.design.errors import InputError
from optopad.sims.verdict.depth_curve import counts_of_noise_units, noise_units
from optopad.sims.verdict.pair_score import (
    continuity,
    deadband_intervals_mm,
    evenness,
    joint_deadband_intervals_mm,
    longest_mm,
    saturation_interval_mm,
    total_length_mm,
)
from tests.said import pattern

PROPERTY = settings(max_examples=60, deadline=None, derandomize=True)
EXACT_MM = 1e-9  # rounding of u, some 1e-13 of up to 2000 units, over slopes of at least 1 unit/mm


def curve(*points):
    """Depths and counts of a signal that is straight in noise units between (depth, unit) points."""
    depth, units = np.array(points, dtype=float).T
    return depth, counts_of_noise_units(units)


def on_one_grid(*curves):
    """Depths and (n, pair) counts of several such signals, with all their corners."""
    depth = np.unique(np.concatenate([d for d, _ in curves]))
    units = [np.interp(depth, d, noise_units(c)) for d, c in curves]
    return depth, counts_of_noise_units(np.stack(units, axis=1))


def approx(*intervals, abs_mm=EXACT_MM):
    return [pytest.approx(interval, abs=abs_mm) for interval in intervals]


# ---- one pair -------------------------------------------------------------------------------------


def test_a_ramp_that_is_steep_enough_has_no_deadband():
    depth, counts = curve((0, 100), (5, 100 - 5 * 10.001))  # 3.0003 units in 0.3 mm
    assert deadband_intervals_mm(depth, counts) == ()


def test_a_ramp_that_is_too_shallow_is_one_deadband_throughout():
    depth, counts = curve((0, 100), (5, 100 - 5 * 9.999))  # 2.9997 units in 0.3 mm
    assert list(deadband_intervals_mm(depth, counts)) == approx((0.0, 5.0))


def test_a_constant_signal_is_one_deadband():
    assert list(deadband_intervals_mm([0.0, 5.0], [300.0, 300.0])) == approx((0.0, 5.0))


def test_a_staircase_has_its_flat_intervals_and_three_units_of_each_edge():
    # steps of 100 units over 0.1 mm, 1000 units/mm: a plateau's interval reaches 0.003 mm into an edge
    depth, counts = curve((0, 500), (1, 400), (2, 400), (2.1, 300), (3.5, 300), (5, 100))
    assert list(deadband_intervals_mm(depth, counts)) == approx((0.97, 2.003), (2.097, 3.5 + 3 / (200 / 1.5)))


def test_a_staircase_with_upright_edges_has_exactly_its_flat_intervals():
    edge = 1e-6
    points = [(0, 900), (1, 600), (2, 600), (2 + edge, 300), (3.5, 300), (3.5 + edge, 200), (5, 50)]
    expected = [(1 - 3 / 300, 2.0), (2.0, 3.5)]
    assert list(deadband_intervals_mm(*curve(*points))) == approx(*expected, abs_mm=2 * edge)


@pytest.mark.parametrize(("drift", "count"), [(2.99, 1), (3.01, 0)])
def test_a_drift_over_the_shortest_interval_is_flat_below_three_units_only(drift, count):
    depth, counts = curve((0, 500), (1, 400), (1.3, 400 - drift), (2.3, 250))
    assert len(deadband_intervals_mm(depth, counts)) == count


@pytest.mark.parametrize(("length", "count"), [(0.27, 0), (0.31, 1)])
def test_a_short_plateau_is_no_deadband(length, count):
    # with 3 units split over edges of 200 units/mm, a plateau gains at most 3 / 200 = 0.015 mm
    depth, counts = curve((0, 500), (1, 300), (1 + length, 300), (2 + length, 100))
    assert len(deadband_intervals_mm(depth, counts)) == count


def test_a_bump_of_less_than_three_units_leaves_a_plateau_whole_and_a_higher_one_splits_it():
    def plateau(bump):
        return curve((0, 600), (1, 300), (2, 300), (2.1, 300 + bump), (2.2, 300), (3.2, 300), (4.2, 0))

    assert list(deadband_intervals_mm(*plateau(2.99))) != []
    assert len(deadband_intervals_mm(*plateau(2.99))) == 1
    assert len(deadband_intervals_mm(*plateau(60.0))) == 2


@pytest.mark.parametrize(("step", "count"), [(5.0, 1), (5.99, 1), (6.01, 2), (7.0, 2)])
def test_two_shifted_plateaus_merge_when_their_intervals_meet_in_the_step(step, count):
    # each plateau's interval reaches 3 units into the step
    depth, counts = curve((0, 600), (1, 300), (2, 300), (2.01, 300 - step), (3, 300 - step), (4, 0))
    assert len(deadband_intervals_mm(depth, counts)) == count


def test_plateaus_at_one_level_with_a_deep_dip_between_stay_apart():
    depth, counts = curve((0, 300), (1, 300), (1.5, 200), (2, 300), (3, 300))
    assert list(deadband_intervals_mm(depth, counts)) == approx((0.0, 1.015), (1.985, 3.0))


def test_a_minimum_is_flat_round_its_bottom():
    # 3 units of a valley with flanks of 15 and 30 units/mm: 0.2 + 0.1 mm, one maximal interval
    depth, counts = curve((0, 300), (2, 270), (4, 330))
    assert list(deadband_intervals_mm(depth, counts)) == []
    assert list(deadband_intervals_mm(depth, counts, min_length_mm=0.299)) == approx((1.8, 2.1), abs_mm=0.001)


def test_threshold_and_length_are_settings():
    # 1 mm moved by x off the plateau of 5 units spans 5 (1 - x) + 300 x units, or + 295 x to the right
    depth, counts = curve((0, 600), (1, 300), (2, 295), (3, 0))
    assert deadband_intervals_mm(depth, counts, min_length_mm=0.7) == ()
    assert list(deadband_intervals_mm(depth, counts, threshold=5.5, min_length_mm=1.0)) == approx(
        (1 - 0.5 / 295, 2 + 0.5 / 290)
    )


def test_less_noise_resolves_what_more_noise_does_not():
    depth = np.linspace(0.0, 5.0, 101)
    counts = 800.0 - 8.0 * depth  # 2.4 counts in 0.3 mm against σ = 2.4
    assert total_length_mm(deadband_intervals_mm(depth, counts)) == pytest.approx(5.0, abs=EXACT_MM)
    assert deadband_intervals_mm(depth, counts, read_noise_counts=0.1, relative_noise=0.0001) == ()


# ---- the end of mode 2 ----------------------------------------------------------------------------


def test_deadbands_end_with_mode_2_and_saturation_begins_there():
    depth, counts = curve((0, 500), (2, 100), (5, 100))
    assert list(deadband_intervals_mm(depth, counts, end_mm=3.25)) == approx((1.985, 3.25))
    assert saturation_interval_mm(depth, counts, end_mm=3.25) == pytest.approx((3.25, 5.0), abs=EXACT_MM)


def test_a_plateau_with_too_little_before_the_end_is_saturation_only():
    depth, counts = curve((0, 500), (2, 100), (5, 100))
    assert deadband_intervals_mm(depth, counts, end_mm=2.2) == ()
    assert saturation_interval_mm(depth, counts, end_mm=2.2) == pytest.approx((2.2, 5.0), abs=EXACT_MM)


def test_saturation_begins_where_the_signal_stops_changing():
    depth, counts = curve((0, 500), (4, 100), (5, 100))
    assert saturation_interval_mm(depth, counts, end_mm=3.0) == pytest.approx((3.97, 5.0), abs=EXACT_MM)


def test_a_signal_that_still_changes_at_the_deepest_press_is_not_saturated():
    depth, counts = curve((0, 500), (3, 200), (4, 200), (5, 100))
    assert saturation_interval_mm(depth, counts, end_mm=3.0) is None


def test_nothing_saturates_without_depth_beyond_the_end():
    assert saturation_interval_mm([0.0, 5.0], [300.0, 300.0], end_mm=5.0) is None
    assert saturation_interval_mm([0.0, 5.0], [300.0, 300.0], end_mm=4.8) is None


def test_what_lies_beyond_the_end_does_not_matter_before_it():
    depth, counts = curve((0, 500), (1, 300), (2, 300), (3, 100), (5, 100))
    other = counts.copy()
    other[-1] = 900.0
    assert deadband_intervals_mm(depth, counts, end_mm=3.0) == deadband_intervals_mm(depth, other, end_mm=3.0)


# ---- several pairs --------------------------------------------------------------------------------


def test_a_pad_is_blind_only_where_every_pair_is():
    first = curve((0, 500), (1, 300), (3, 300), (5, 0))
    second = curve((0, 500), (2, 500), (4, 300), (5, 300))
    # flat: first 0.985..3.02, second 0..2.03; a common window holds both, the edges' ends do not add up
    together = joint_deadband_intervals_mm(*on_one_grid(first, second))
    assert list(together) == approx((0.985, 2.03))


def test_a_pad_of_complementary_pairs_has_no_deadband():
    first = curve((0, 500), (2, 100), (4, 100))
    second = curve((0, 500), (2, 500), (4, 100))
    assert deadband_intervals_mm(*first) != ()
    assert deadband_intervals_mm(*second) != ()
    assert joint_deadband_intervals_mm(*on_one_grid(first, second)) == ()


def test_two_pairs_that_each_change_by_less_than_the_threshold_do_not_add_up():
    first = curve((0, 500), (1, 300), (2, 298), (3, 0))
    second = curve((0, 500), (1, 300), (2, 302), (3, 500))
    assert len(joint_deadband_intervals_mm(*on_one_grid(first, second))) == 1


# ---- exactness ------------------------------------------------------------------------------------


def random_walk(seed, samples=31, pairs=1):
    """A wandering signal with flat stretches, 0 to 5 mm."""
    rng = np.random.default_rng(seed)
    depth = np.concatenate(([0.0], np.sort(rng.uniform(0.0, 5.0, samples - 2)), [5.0]))
    steps = rng.normal(0.0, 3.0, (samples, pairs)) * (rng.random((samples, pairs)) < 0.5)
    return depth, counts_of_noise_units(400.0 + np.cumsum(steps, axis=0))


def slow_deadbands(depth, counts, grid_mm, min_length_mm=0.3, threshold=3.0):
    """The definition, word for word, on a grid that holds the samples: every start, grown to a range of 3."""
    at = np.union1d(np.arange(0.0, 5.0 + grid_mm / 2.0, grid_mm), depth)
    units = np.stack([np.interp(at, depth, u) for u in noise_units(counts).T], axis=1)
    found = []
    for i, start in enumerate(at):
        low, high = np.minimum.accumulate(units[i:]), np.maximum.accumulate(units[i:])
        last = at[i + np.count_nonzero(np.max(high - low, axis=1) < threshold) - 1]
        if last - start >= min_length_mm:
            if found and start <= found[-1][1]:
                found[-1][1] = max(found[-1][1], last)
            else:
                found.append([start, last])
    return found


def lie_within(intervals, others, margin_mm):
    """Whether every depth of the first set is in the second, each interval of which is grown by a margin."""
    grown = []
    for a, b in others:
        if grown and a - margin_mm <= grown[-1][1]:
            grown[-1][1] = b + margin_mm
        else:
            grown.append([a - margin_mm, b + margin_mm])
    return all(any(c <= a and b <= d for c, d in grown) for a, b in intervals)


@pytest.mark.parametrize("pairs", [1, 3])
@pytest.mark.parametrize("seed", range(8))
def test_the_closed_form_lies_between_two_bounds_from_the_definition_on_a_grid(seed, pairs):
    # A window between grid depths is a true window; a true window shrinks to one between grid depths
    # that is shorter by at most a step at each end.
    grid_mm = 0.01
    depth, counts = random_walk(seed, pairs=pairs)
    exact = joint_deadband_intervals_mm(depth, counts)
    inner = slow_deadbands(depth, counts, grid_mm)
    outer = slow_deadbands(depth, counts, grid_mm, min_length_mm=0.3 - 2 * grid_mm)
    assert len(inner) > 0
    assert lie_within(inner, exact, EXACT_MM)
    assert lie_within(exact, outer, grid_mm + EXACT_MM)


@PROPERTY
@given(seed=st.integers(0, 10_000))
def test_samples_added_on_the_lines_change_nothing(seed):
    depth, counts = random_walk(seed)
    extra = np.unique(np.concatenate((depth, np.random.default_rng(seed).uniform(0.0, 5.0, 40))))
    dense = counts_of_noise_units(np.interp(extra, depth, noise_units(counts[:, 0])))
    before, after = deadband_intervals_mm(depth, counts[:, 0]), deadband_intervals_mm(extra, dense)
    assert len(before) == len(after)
    assert list(after) == approx(*before)


def test_boundaries_of_a_smooth_signal_move_by_less_than_a_hundredth_when_the_grid_is_doubled():
    def bands(step):
        depth = np.linspace(0.0, 5.0, round(5.0 / step) + 1)
        share = 0.2 * np.exp(-4.0 * depth) + 0.8 / (1.0 + np.exp((depth - 3.0) / 0.15))
        return deadband_intervals_mm(depth, 800.0 * share, end_mm=3.5)

    coarse, fine = bands(0.05), bands(0.025)
    assert len(coarse) == len(fine) == 1
    assert fine[0][1] - fine[0][0] > 1.0
    np.testing.assert_allclose(coarse, fine, atol=0.01)


@PROPERTY
@given(seed=st.integers(0, 10_000), end=st.floats(0.5, 5.0))
def test_deadbands_are_disjoint_long_enough_and_within_the_judged_depth(seed, end):
    depth, counts = random_walk(seed)
    bands = deadband_intervals_mm(depth, counts[:, 0], end_mm=end)
    edges = np.ravel(bands)
    assert np.all(np.diff(edges) > 0.0)
    assert all(b - a >= 0.3 - 1e-12 for a, b in bands)  # rounding of start + length
    assert edges.size == 0 or (edges[0] >= 0.0 and edges[-1] <= end)


@PROPERTY
@given(seed=st.integers(0, 10_000), end=st.floats(0.5, 5.0))
def test_deadband_and_continuity_make_up_the_judged_depth(seed, end):
    depth, counts = random_walk(seed)
    bands = deadband_intervals_mm(depth, counts[:, 0], end_mm=end)
    share = continuity(bands, end)
    assert 0.0 <= share <= 1.0
    assert share * end + total_length_mm(bands) == pytest.approx(end, abs=1e-12)
    assert longest_mm(bands) <= total_length_mm(bands)


@PROPERTY
@given(seed=st.integers(0, 10_000), scale=st.floats(0.2, 5.0))
def test_scaling_depth_scales_the_deadbands(seed, scale):
    depth, counts = random_walk(seed)
    bands = deadband_intervals_mm(depth, counts[:, 0])
    scaled = deadband_intervals_mm(depth * scale, counts[:, 0], min_length_mm=0.3 * scale)
    assert list(scaled) == approx(*[(a * scale, b * scale) for a, b in bands], abs_mm=1e-8)


@PROPERTY
@given(seed=st.integers(0, 10_000))
def test_a_dark_pair_changes_nothing_for_the_pad(seed):
    depth, counts = random_walk(seed, pairs=2)
    dark = np.column_stack((counts, np.zeros(depth.size)))
    assert joint_deadband_intervals_mm(depth, dark) == joint_deadband_intervals_mm(depth, counts)


@PROPERTY
@given(seed=st.integers(0, 10_000))
def test_a_further_pair_never_lengthens_the_pads_deadbands(seed):
    depth, counts = random_walk(seed, pairs=3)
    fewer, more = (
        joint_deadband_intervals_mm(depth, counts[:, :2]),
        joint_deadband_intervals_mm(depth, counts),
    )
    for a, b in more:
        assert any(start - EXACT_MM <= a and b <= end + EXACT_MM for start, end in fewer)


@PROPERTY
@given(seed=st.integers(0, 10_000))
def test_a_shift_in_noise_units_changes_nothing(seed):
    depth, counts = random_walk(seed)
    shifted = counts_of_noise_units(noise_units(counts[:, 0]) + 150.0)
    bands, moved = deadband_intervals_mm(depth, counts[:, 0]), deadband_intervals_mm(depth, shifted)
    assert list(moved) == approx(*bands, abs_mm=1e-8)


# ---- continuity and evenness ----------------------------------------------------------------------


def test_continuity_is_the_share_that_is_not_deadband():
    assert continuity([(0.77, 2.53)], 4.34) == pytest.approx(1.0 - 1.76 / 4.34, abs=1e-12)
    assert continuity([], 3.0) == 1.0
    assert continuity([(0.0, 3.0)], 3.0) == 0.0


def test_an_even_ramp_has_evenness_one():
    depth, counts = curve((0, 500), (5, 0))
    assert evenness(depth, counts) == pytest.approx(1.0, abs=1e-9)


def test_evenness_is_the_weakest_window_over_the_mean_one():
    # 300 units over 1 mm, 20 over 3 mm, 180 over 1 mm: weakest 0.5 mm has 10/3, the mean one 50
    depth, counts = curve((0, 500), (1, 200), (4, 180), (5, 0))
    assert evenness(depth, counts) == pytest.approx((10.0 / 3.0) / 50.0, abs=1e-9)


def test_evenness_sees_a_turning_point():
    # a valley with flanks of 100 and 300 units/mm: 0.5 mm round it spans 37.5 where both ends are level
    depth, counts = curve((0, 500), (2, 300), (3, 600))
    assert evenness(depth, counts) == pytest.approx(37.5 / (300.0 * 0.5 / 3.0), abs=1e-9)


def test_evenness_stops_at_the_end_of_mode_2():
    depth, counts = curve((0, 500), (2, 300), (3, 270), (4, 270), (5, 0))
    # up to 3 mm: weakest window 15 units, mean one 230 / 6
    assert evenness(depth, counts, end_mm=3.0) == pytest.approx(15.0 / (230.0 / 6.0), abs=1e-9)
    assert evenness(depth, counts) == pytest.approx(0.0, abs=1e-9)


def test_a_signal_that_never_changes_has_evenness_zero():
    assert evenness([0.0, 5.0], [300.0, 300.0]) == 0.0


def test_a_press_shorter_than_the_window_is_one_window():
    depth, counts = curve((0, 500), (0.2, 490), (0.4, 300))
    assert evenness(depth, counts) == pytest.approx(1.0, abs=1e-9)


@PROPERTY
@given(seed=st.integers(0, 10_000))
def test_evenness_agrees_with_windows_on_a_fine_grid(seed):
    depth, counts = random_walk(seed)
    units = noise_units(counts[:, 0])
    at = np.linspace(0.0, 5.0, 2001)
    windows = np.lib.stride_tricks.sliding_window_view(np.interp(at, depth, units), 201)
    slow = min(1.0, np.ptp(windows, axis=1).min() / (np.ptp(units) * 0.1))
    steepest = np.max(np.abs(np.diff(units) / np.diff(depth)))
    # the grid may miss the best start and each extreme by half a step, and the range changes by twice the slope
    missed = steepest * 0.0025 / (np.ptp(units) * 0.1)
    assert slow - missed <= evenness(depth, counts[:, 0]) <= slow + missed + 1e-9


# ---- refusals -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("settings_", "message"),
    [
        ({"end_mm": 6.0}, "end_mm: 6.0 mm, needs over 0 and at most 5.0 mm"),
        ({"end_mm": 0.0}, "end_mm: 0.0 mm, needs over 0"),
        ({"min_length_mm": 0.0}, "min_length_mm: 0.0 ... over 0"),
        ({"threshold": -1.0}, "-1.0, needs ... over 0"),
    ],
)
def test_unusable_settings_are_refused_by_name(settings_, message):
    with pytest.raises(InputError, match=pattern(message)):
        deadband_intervals_mm([0.0, 5.0], [500.0, 100.0], **settings_)


def test_a_pad_without_pairs_is_refused():
    with pytest.raises(InputError, match=r"counts: shape \(2, 0\), needs \(2, pairs >= 1\)"):
        joint_deadband_intervals_mm([0.0, 5.0], np.zeros((2, 0)))
