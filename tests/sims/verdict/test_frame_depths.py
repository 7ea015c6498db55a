"""Made-up frames: one pair, many weak ones, deadband, fade, clipped, open."""

from __future__ import annotations

import numpy as np
import pytest

from optopad.sims.verdict.depth_curve import clipped, noise_units
from optopad.sims.verdict.pad_map import DepthReading, Frames, read_depths
from optopad.sims.verdict.pair_score import deadband_intervals_mm

DEPTH = np.arange(0.0, 5.0001, 0.1)


def exact(units: np.ndarray, depth: np.ndarray = DEPTH) -> DepthReading:
    return read_depths(Frames(depth_mm=depth, halves=np.stack([units, units]), variance=np.zeros(len(depth))))


def ramp(*knots: tuple[float, float]) -> np.ndarray:
    return np.interp(DEPTH, *zip(*knots, strict=True))


def test_a_pad_of_one_pair_has_the_pairs_deadband() -> None:
    counts = ramp((0, 900), (1.0, 700), (2.2, 690), (4.0, 100), (4.2, 60), (5.0, 40))
    noise = {"read_noise_counts": 0.5, "relative_noise": 0.003}
    own = deadband_intervals_mm(DEPTH, counts, **noise)
    found = exact(noise_units(counts, **noise)[:, None])
    assert len(own) == len(found.blind.deadbands_mm) == 1
    # windows start every 0.02 mm
    np.testing.assert_allclose(found.blind.deadbands_mm[0], own[0], atol=0.021)
    assert found.blind.usable_mm == 5.0
    assert not found.is_open


def test_many_pairs_that_change_a_little_tell_together_what_none_tells_alone() -> None:
    """48 pairs, 0.5 noise units each over every 0.3 mm: together 0.5 √48 = 3.46."""
    units = np.tile(0.5 / 0.3 * DEPTH[:, None], (1, 48))
    assert exact(units).blind.deadbands_mm == ()
    assert exact(units).margin == pytest.approx(0.5 * np.sqrt(48))
    assert exact(units).blind.usable_mm == 5.0
    # 36 of them: exactly the threshold, and a little less is blind to the end
    assert exact(units[:, :36] * 1.0001).blind.usable_mm == 5.0
    assert exact(units[:, :36] * 0.999).blind.usable_mm == 0.0


def test_a_flat_stretch_is_a_deadband_where_the_signal_comes_back_and_fade_where_it_does_not() -> None:
    middle = ramp((0, 0), (2.0, 60), (3.0, 60), (5.0, 120))[:, None]
    found = exact(middle)
    # 30 units per mm: 3 units are 0.1 mm, which the flat stretch reaches into each slope
    np.testing.assert_allclose(found.blind.deadbands_mm, [(1.9, 3.1)], atol=0.021)
    assert found.blind.usable_mm == 5.0
    end = ramp((0, 0), (3.8, 114), (5.0, 114))[:, None]
    assert exact(end).blind.deadbands_mm == ()
    assert exact(end).blind.usable_mm == pytest.approx(3.7, abs=0.021)
    both = exact(ramp((0, 0), (1, 30), (2, 30), (4, 90), (5, 90))[:, None])
    np.testing.assert_allclose(both.blind.deadbands_mm, [(0.9, 2.1)], atol=0.021)
    assert both.blind.usable_mm == pytest.approx(3.9, abs=0.021)


def test_a_short_flat_stretch_is_none() -> None:
    assert exact(ramp((0, 0), (2.0, 60), (2.05, 60), (5.0, 150))[:, None]).blind.deadbands_mm == ()


def test_a_reading_at_full_scale_tells_nothing_while_it_is_there() -> None:
    counts = ramp((0, 1500), (2.5, 800), (5.0, 100))[:, None]
    knots, readings = clipped(DEPTH, counts, 1023.0)
    found = exact(noise_units(readings), knots)
    leaves = np.interp(-1023.0, -counts[:, 0], DEPTH)
    # 3 noise units of 3 counts are 0.03 mm
    np.testing.assert_allclose(found.blind.deadbands_mm, [(0.0, leaves + 0.033)], atol=0.03)


def test_independent_halves_take_the_lights_error_out() -> None:
    """Errors of 1 unit in each of 48 pairs would be 10 units of distance; half of the frames do not change at all."""
    chance = np.random.default_rng(5)
    truth = np.tile(np.interp(DEPTH, [0, 2.5, 5.0], [0, 60, 60])[:, None], (1, 48))
    halves = truth + chance.normal(size=(2, len(DEPTH), 48))
    found = read_depths(Frames(depth_mm=DEPTH, halves=halves, variance=np.zeros(len(DEPTH))))
    once = read_depths(Frames(depth_mm=DEPTH, halves=halves[[0, 0]], variance=np.zeros(len(DEPTH))))
    assert once.blind.usable_mm == 5.0  # what the error alone would make
    low, high = found.usable_range_mm
    assert low <= 2.6
    assert high >= 2.4
    assert found.open_mm


def test_what_the_lights_error_may_hide_or_make_is_open() -> None:
    chance = np.random.default_rng(1)
    steep = np.interp(DEPTH, [0, 2, 2.6, 5.0], [0, 60, 62.4, 140])
    truth = np.tile(steep[:, None], (1, 2))  # 1.7 units over 0.3 mm of the slow stretch
    fine, coarse = (truth + size * chance.normal(size=(2, len(DEPTH), 2)) for size in (0.01, 2.0))
    none = np.zeros(len(DEPTH))
    clear, doubtful = (
        read_depths(Frames(depth_mm=DEPTH, halves=halves, variance=none)) for halves in (fine, coarse)
    )
    assert not clear.is_open
    assert clear.least.deadbands_mm
    assert doubtful.is_open
    assert any(start < 2.3 < end for start, end in doubtful.open_mm)


def test_light_traced_once_is_open_by_its_own_standard_error() -> None:
    units = np.tile(0.6 / 0.3 * DEPTH[:, None], (1, 48))
    small, large = (
        read_depths(
            Frames(depth_mm=DEPTH, halves=np.stack([units, units]), variance=np.full(len(DEPTH), size))
        )
        for size in (0.5, 5.0)
    )
    assert not small.open_mm
    assert large.open_mm
    assert large.usable_range_mm == (0.0, 5.0)


def test_a_press_as_short_as_the_shortest_deadband_is_one_window() -> None:
    depth = np.array([0.0, 0.1, 0.3])
    assert exact(np.array([[0.0], [1.0], [2.0]]), depth).blind.usable_mm == 0.0
    assert exact(np.array([[0.0], [1.0], [4.0]]), depth).blind.usable_mm == pytest.approx(0.3)
