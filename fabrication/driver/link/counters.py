"""Counters without overflow: 32-bit counters of the board, which wrap around, become numbers that do not."""

from __future__ import annotations

from collections import deque

import numpy as np

from design.arrays import IntArray
from fabrication.driver.link.protocol import STAMP, WRAP, CountArray

REMEMBERED_FRAMES = 256
"""Number of past frames among which repeats are searched; 0.6 s at 400 Hz."""


class WrappingCounter:
    """Follows a 32-bit counter of the board, and removes its wraps.

    Parameters
    ----------
    goes_back : whether the counter may step backward. True for sequence numbers, which a restart of the board sets
        back; a step is from -2^31 to 2^31 - 1. False for device time, which only rises; a step is from 0 to 2^32 - 1
        (71.6 minutes in microseconds).
    """

    def __init__(self, *, goes_back: bool) -> None:
        self._goes_back = goes_back
        self._last: int | None = None

    def next(self, value: int) -> tuple[int, int]:
        """The unwrapped number of one counter value, and the step since the previous value; 1 for the first value.

        The result is that of `extended`, but much faster for single values.
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
        """The unwrapped numbers of (n,) counter values, and the step from each previous value; both (n,).

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
    """Detects frames that the line delivers twice: sequence number and time equal those of one of the last 256 frames.

    A restarted board repeats its numbers, but not with the same times.
    """

    def __init__(self) -> None:
        self._order: deque[bytes] = deque()
        self._seen: set[bytes] = set()

    def has(self, message: bytes) -> bool:
        """Whether a message of readings repeats one of the remembered ones; if not, it is remembered."""
        stamp = message[STAMP]
        if stamp in self._seen:
            return True
        if len(self._order) == REMEMBERED_FRAMES:
            self._seen.remove(self._order.popleft())
        self._order.append(stamp)
        self._seen.add(stamp)
        return False


def restarts(values: CountArray, last: int) -> IntArray:
    """Indices at which the sequence numbers (n,) show a restart of the board.

    At a restart the number is not above the previous one, modulo 2^32.

    last : sequence number before the first one
    """
    steps: IntArray = np.diff(values.astype(np.int64), prepend=last).astype(np.int64) % WRAP
    places: IntArray = np.flatnonzero((steps == 0) | (steps >= WRAP // 2))
    return places
