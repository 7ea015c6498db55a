"""Conversion of 32-bit counters that wrap to numbers that do not."""

from __future__ import annotations

from collections import deque

import numpy as np

from design.arrays import IntArray
from fabrication.driver.link.protocol import STAMP, WRAP, CountArray

REMEMBERED_FRAMES = 256
"""Number of frames in the search for repeats: 0.6 s at 400 Hz."""


class WrappingCounter:
    """One counter of a board, tracked from its first value.

    Parameters
    ----------
    goes_back : True for sequence numbers, where a step backward means a restart of the board: steps are -2^31 to
        2^31 - 1. False for device time, which only rises: steps are 0 to 2^32 - 1, in microseconds 71.6 minutes.
    """

    def __init__(self, *, goes_back: bool) -> None:
        self._goes_back = goes_back
        self._last: int | None = None

    def next(self, value: int) -> tuple[int, int]:
        """One value without wraps, and the step to it; as `extended`, but much faster for single values."""
        if self._last is None:
            self._last = value
            return value, 1
        step = (value - self._last) % WRAP
        if self._goes_back and step >= WRAP // 2:
            step -= WRAP
        self._last += step
        return self._last, step

    def extended(self, values: CountArray) -> tuple[IntArray, IntArray]:
        """Values without wraps, and the step to each from the previous one; 1 to the very first.

        values : (n,) as sent; both results are (n,)
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
    """Detection of frames that the line delivers twice: number and time equal those of one of the last 256 frames.

    A restarted board repeats its numbers, but never a number with its time.
    """

    def __init__(self) -> None:
        self._order: deque[bytes] = deque()
        self._seen: set[bytes] = set()

    def has(self, message: bytes) -> bool:
        """Whether a complete message of readings arrived before; a new one is remembered."""
        stamp = message[STAMP]
        if stamp in self._seen:
            return True
        if len(self._order) == REMEMBERED_FRAMES:
            self._seen.remove(self._order.popleft())
        self._order.append(stamp)
        self._seen.add(stamp)
        return False


def restarts(values: CountArray, last: int) -> IntArray:
    """Indices of (n,) sequence numbers at a restart of the board: not above the previous number, modulo 2^32.

    last : the number before the first
    """
    steps: IntArray = np.diff(values.astype(np.int64), prepend=last).astype(np.int64) % WRAP
    places: IntArray = np.flatnonzero((steps == 0) | (steps >= WRAP // 2))
    return places
