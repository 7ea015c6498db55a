"""Unwraps the board's 32-bit counters, and detects repeated frames and restarts of the board."""

from __future__ import annotations

from collections import deque

import numpy as np

from optopad.design.arrays import IntArray
from optopad.fabrication.driver.link.protocol import STAMP, WRAP, CountArray

REMEMBERED_FRAMES = 256
"""Number of past frames with which a new frame is compared to detect repeats; they span 0.6 s at 400 Hz."""


class WrappingCounter:
    """Turns successive values of one of the board's 32-bit counters into numbers that do not wrap.

    Parameters
    ----------
    goes_back : whether the counter may step backward. Sequence numbers may, because a restart of the board resets
        them; their steps are from -2^31 to 2^31 - 1. Device time never decreases; its steps are from 0 to 2^32 - 1 us
        (71.6 minutes)
    """

    def __init__(self, *, goes_back: bool) -> None:
        self._goes_back = goes_back
        self._last: int | None = None

    def next(self, value: int) -> tuple[int, int]:
        """The unwrapped number for a counter value, and the step from the previous value.

        The step of the first value is 1. For single values, `next` is faster than `extended`.
        """
        if self._last is None:
            self._last = value
            return value, 1
        step = (value - self._last) % WRAP
        if self._goes_back and step >= WRAP // 2:
            step -= WRAP
        self._last += step
        return self._last, step

    def extended(self, values: CountArray) -> tuple[IntArray, IntArray]:
        """The unwrapped numbers for n counter values, and for each the step from the previous value; shapes (n,).

        The step of the very first value is 1.
        """
        if not len(values):
            return np.zeros(0, np.int64), np.zeros(0, np.int64)
        plain = values.astype(np.int64)
        last = int(plain[0]) - 1 if self._last is None else self._last
        steps = np.diff(plain, prepend=last) % WRAP
        if self._goes_back:
            steps = np.where(steps < WRAP // 2, steps, steps - WRAP)
        whole = last + np.cumsum(steps)
        self._last = int(whole[-1])
        return whole, steps


class Repeats:
    """Detects frames delivered twice, whose sequence number and time equal those of one of the last 256 frames.

    A restarted board repeats its sequence numbers, but not with the same times.
    """

    def __init__(self) -> None:
        self._order: deque[bytes] = deque()
        self._seen: set[bytes] = set()

    def has(self, message: bytes) -> bool:
        """Whether a message of readings repeats one of the last 256; if it does not, it is remembered."""
        stamp = message[STAMP]
        if stamp in self._seen:
            return True
        if len(self._order) == REMEMBERED_FRAMES:
            self._seen.remove(self._order.popleft())
        self._order.append(stamp)
        self._seen.add(stamp)
        return False


def restarts(values: CountArray, last: int) -> IntArray:
    """Indices of the frames that are the first after a restart of the board.

    The board has restarted if a sequence number is not above the previous one, modulo 2^32.

    Parameters
    ----------
    values : sequence numbers of the frames, shape (n,)
    last : sequence number before the first of them
    """
    steps: IntArray = np.diff(values.astype(np.int64), prepend=last).astype(np.int64) % WRAP
    places: IntArray = np.flatnonzero((steps == 0) | (steps >= WRAP // 2))
    return places
