"""Counters of 32 bits that wrap, as numbers that do not."""

from __future__ import annotations

from collections import deque

import numpy as np

from design.arrays import IntArray
from fabrication.driver.link.protocol import STAMP, WRAP, CountArray

REMEMBERED_FRAMES = 256
"""So far back a repeat is looked for: 0.6 s at 400 Hz."""


class WrappingCounter:
    """One counter of a board, followed from its first value on.

    Parameters
    ----------
    goes_back : True for sequence numbers, whose step backward says that the board began anew: steps are -2^31 to
        2^31 - 1. False for device time, which only rises: steps are 0 to 2^32 - 1, in microseconds 71.6 minutes.
    """

    def __init__(self, *, goes_back: bool) -> None:
        self._goes_back = goes_back
        self._last: int | None = None

    def next(self, value: int) -> tuple[int, int]:
        """One value without the wraps, and the step to it; as `extended`, and for single values much faster."""
        if self._last is None:
            self._last = value
            return value, 1
        step = (value - self._last) % WRAP
        if self._goes_back and step >= WRAP // 2:
            step -= WRAP
        self._last += step
        return self._last, step

    def extended(self, values: CountArray) -> tuple[IntArray, IntArray]:
        """Values without the wraps, and the step to each from the one before it; 1 to the very first.

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
    """Frames that the line delivers twice: number and time are those of one of the last 256 frames.

    A board that began anew repeats its numbers, but never a number with its time.
    """

    def __init__(self) -> None:
        self._order: deque[bytes] = deque()
        self._seen: set[bytes] = set()

    def has(self, message: bytes) -> bool:
        """Whether a whole message of readings came before; it is noted where it did not."""
        stamp = message[STAMP]
        if stamp in self._seen:
            return True
        if len(self._order) == REMEMBERED_FRAMES:
            self._seen.remove(self._order.popleft())
        self._order.append(stamp)
        self._seen.add(stamp)
        return False


def restarts(values: CountArray, last: int) -> IntArray:
    """Places of (n,) sequence numbers where the board must have begun anew: not above the one before, modulo 2^32.

    last : the number before the first
    """
    steps: IntArray = np.diff(values.astype(np.int64), prepend=last).astype(np.int64) % WRAP
    places: IntArray = np.flatnonzero((steps == 0) | (steps >= WRAP // 2))
    return places
