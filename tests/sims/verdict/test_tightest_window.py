"""Where the light trace's own error comes nearest to hiding a deadband."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from design.geometry.cavity import cavity_of
from design.preset import preset
from sims.continuity.cautions import margin_caution
from sims.verdict.pad_map import PadMap
from sims.verdict.pair.defaults import DEADBAND_THRESHOLD, TRACE_ERROR_SPREAD
from sims.verdict.pair.trace_noise import TightWindow, tight_windows
from tests.sims.made_up_scores import made_up_map

DEPTH_MM = np.linspace(0.0, 5.0, 51)
SLOW = np.where(DEPTH_MM < 1.0, 18.0 * DEPTH_MM, 18.0 + 70.0 * (DEPTH_MM - 1.0))[:, None]
"""5.4 noise units over the first 0.3 mm, 21 over any beyond 1 mm."""


def tightest(error_units: np.ndarray) -> TightWindow:
    return least_spare(SLOW, error_units)


def least_spare(units: np.ndarray, error_units: np.ndarray) -> TightWindow:
    return min(tight_windows(DEPTH_MM, units, DEPTH_MM, error_units, 0.3), key=lambda window: window.spare)


def test_a_trace_without_error_leaves_the_change_itself():
    window = tightest(np.zeros((51, 1)))
    assert window.change == pytest.approx(5.4)
    assert (window.needed, window.spare) == pytest.approx((DEADBAND_THRESHOLD, 2.4))
    assert 0.0 <= window.start_mm < window.end_mm <= 1.0 + 1e-9


def test_only_the_error_within_a_window_counts_there():
    """Where signals are steep an error of 2 makes nothing doubtful that are safe by 18."""
    errors = np.where(DEPTH_MM > 2.0, 2.0, 0.1)[:, None]
    window = tightest(errors)
    assert window.end_mm <= 1.0 + 1e-9
    assert window.trace_error == pytest.approx(0.1)
    assert window.spare == pytest.approx(5.4 - DEADBAND_THRESHOLD - 0.1 * TRACE_ERROR_SPREAD)


def test_a_larger_change_with_a_larger_error_may_be_the_tighter_one():
    errors = np.where(np.abs(DEPTH_MM - 3.0) < 0.16, 5.0, 0.0)[:, None]
    window = tightest(errors)
    assert 2.4 < window.start_mm < 3.2
    assert window.change == pytest.approx(21.0)
    assert window.spare < 2.4


def test_the_error_is_the_mean_square_over_pairs_and_depths():
    errors = np.tile([0.3, 0.4], (51, 1))
    window = least_spare(np.hstack([SLOW, 0.0 * SLOW]), errors)
    assert window.trace_error == pytest.approx(np.sqrt((0.09 + 0.16) / 2.0))


def pad_of(trace_error: float, *, dead_mm: float = 0.0) -> PadMap:
    made_up = made_up_map(cavity_of(preset("piacenza2017-pad")), dead_mm=dead_mm)
    window = TightWindow(start_mm=0.0, end_mm=0.3, change=5.3, trace_error=trace_error)
    places = (replace(made_up.places[0], margin=5.3, tightest=window), *made_up.places[1:])
    return replace(made_up, places=places)


def test_a_verdict_is_open_where_the_error_may_hide_a_deadband():
    pad_map = pad_of(0.7)
    assert pad_map.is_open
    [caution] = margin_caution(pad_map)
    assert "changes by 5.3 noise units over 0.3 mm within 0.00 to 0.30 mm" in caution
    assert f"can make {3.0 + 0.7 * TRACE_ERROR_SPREAD:.1f} of nothing; run with --fine" in caution


def test_a_verdict_is_not_open_where_the_error_is_small_or_a_deadband_is_found():
    for pad_map in (pad_of(0.4), pad_of(0.7, dead_mm=2.0)):
        assert not pad_map.is_open
        assert margin_caution(pad_map) == []
