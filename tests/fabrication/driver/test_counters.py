"""Wraps of sequence number and device time over a day, losses and restarts."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from optopad.fabrication.driver.link.frames import WrappingCounter

RATE_HZ = 400
DAY_FRAMES = 24 * 3600 * RATE_HZ


def chunks(total: int, size: int) -> list[tuple[int, int]]:
    return [(start, min(start + size, total)) for start in range(0, total, size)]


@pytest.mark.slow
def test_a_day_of_frames_across_the_wrap_of_the_sequence_loses_none() -> None:
    counter, start, seen = WrappingCounter(goes_back=True), 2**32 - DAY_FRAMES // 2, 0
    for first, end in chunks(DAY_FRAMES, 1_000_000):
        sent = ((start + np.arange(first, end)) % 2**32).astype(np.uint32)
        whole, steps = counter.extended(sent)
        assert (steps == 1).all()
        assert whole[0] == start + first
        seen += len(whole)
    assert seen == DAY_FRAMES
    assert whole[-1] == start + DAY_FRAMES - 1  # beyond 2^32


@pytest.mark.slow
def test_a_day_of_device_time_wraps_twenty_times_and_never_goes_back() -> None:
    counter, wraps, last = WrappingCounter(goes_back=False), 0, -1
    for first, end in chunks(DAY_FRAMES, 1_000_000):
        truth = np.arange(first, end, dtype=np.int64) * (1_000_000 // RATE_HZ)
        sent = (truth % 2**32).astype(np.uint32)
        wraps += int((np.diff(sent.astype(np.int64), prepend=max(last, 0) % 2**32) < 0).sum())
        whole, _ = counter.extended(sent)
        assert np.array_equal(whole, truth)
        last = int(whole[-1])
    assert wraps == 20  # 86,400 s over 4,294.97 s


@given(st.integers(0, 2**32 - 1), st.lists(st.integers(1, 2**31 - 1), min_size=1, max_size=30))
def test_lost_frames_are_counted_across_any_wrap(start: int, steps: list[int]) -> None:
    truth = start + np.concatenate(([0], np.cumsum(steps)))
    counter = WrappingCounter(goes_back=True)
    whole, found = counter.extended((truth % 2**32).astype(np.uint32))
    assert np.array_equal(whole, truth)
    assert found.tolist() == [1, *steps]


@given(st.lists(st.integers(0, 2**32 - 1), max_size=20), st.integers(0, 20))
def test_pieces_count_as_the_whole_does(values: list[int], cut: int) -> None:
    sent = np.array(values, dtype=np.uint32)
    whole, steps = WrappingCounter(goes_back=True).extended(sent)
    counter = WrappingCounter(goes_back=True)
    parts = [counter.extended(sent[:cut]), counter.extended(sent[cut:])]
    assert np.array_equal(np.concatenate([part[0] for part in parts]), whole)
    assert np.array_equal(np.concatenate([part[1] for part in parts]), steps)


@pytest.mark.parametrize("again", [0, 5, 99])
def test_a_board_that_began_anew_is_a_step_backward(again: int) -> None:
    counter = WrappingCounter(goes_back=True)
    counter.extended(np.array([100], dtype=np.uint32))
    _, steps = counter.extended(np.array([again], dtype=np.uint32))
    assert steps[0] < 0


@given(st.booleans(), st.lists(st.integers(0, 2**32 - 1), min_size=1, max_size=20))
def test_one_by_one_counts_as_all_at_once(goes_back: bool, values: list[int]) -> None:
    whole, steps = WrappingCounter(goes_back=goes_back).extended(np.array(values, dtype=np.uint32))
    counter = WrappingCounter(goes_back=goes_back)
    assert [counter.next(value) for value in values] == list(zip(whole.tolist(), steps.tolist(), strict=True))
