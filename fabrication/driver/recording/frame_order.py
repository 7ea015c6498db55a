"""The order of a bag's frames, and where a board or its node started anew.

Within a connection, sequence number and board's clock increase from frame to frame. Where they do not, the board has
started again, if it can have: its clock shows less than the time since the frame before. Otherwise the frames are out
of order. Log times order the frames unless the order in which the recorder wrote them agrees better with the sequence
numbers. The latter is right after the recorder's clock was set back.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from optopad.design.arrays import BoolArray, IntArray
from optopad.design.errors import InputError
from optopad.fabrication.driver.recording.messages import Frames

US_PER_S = 1_000_000
LATE_US = 50_000
"""Longest delay of a frame that may make a pause look shorter than the time since the board's start [us]."""
WRAP_US = 1 << 31
"""Backward step of the board's clock from which it was the wrap of its 32-bit counter [us]."""
NEXT_FRAMES = 10
"""Number of frames after the end of a connection that would continue it."""


def ordered(frames: Frames) -> tuple[IntArray, IntArray]:
    """Numbers of the frames in the order in which the sensor sent them, without doubled ones, and their connections.

    Returns
    -------
    shapes (n,) and (n,); connections count from 1

    Raises
    ------
    InputError : the frames contradict each other.
    """
    every = _Columns(
        *(
            frames.column(name)
            for name in ("connection", "sequence", "device_us", "arrived_ns", "time_ns", "place")
        )
    )
    count = len(every.place)
    by_time = (
        np.arange(count)
        if _is_sorted(every.time_ns, every.place)
        else np.lexsort((every.place, every.time_ns))
    )
    found = every.taken(by_time)
    if found.begins().all_rise:
        return by_time, np.ones(count, dtype=np.int64)
    single = by_time[found.is_first()]
    by_place = single[np.argsort(every.place[single], kind="stable")]
    candidates = [(order, every.taken(order).begins()) for order in (single, by_place)]
    order, begins = min(candidates, key=lambda one: (one[1].unexplained, one[1].count))
    if begins.unexplained:
        order, begins = _sorted_within(every, *candidates[0])
    elif order is by_place:
        _require_even(every.taken(order))
    _require_new_starts(every.taken(order), begins.mask)
    connection: IntArray = 1 + np.cumsum(begins.mask)
    return order, connection


@dataclass(frozen=True)
class _Begins:
    """Which frames cannot follow the frame before in one connection, and which of them a new start explains."""

    mask: BoolArray
    explained: BoolArray

    @property
    def all_rise(self) -> bool:
        return not self.mask.any()

    @property
    def count(self) -> int:
        return int(np.count_nonzero(self.mask))

    @property
    def unexplained(self) -> int:
        return int(np.count_nonzero(self.mask & ~self.explained))


@dataclass(frozen=True)
class _Columns:
    connection: IntArray
    sequence: IntArray
    device_us: IntArray
    arrived_ns: IntArray
    time_ns: IntArray
    place: IntArray

    def taken(self, order: IntArray) -> _Columns:
        return _Columns(*(column[order] for column in vars(self).values()))

    def is_first(self) -> BoolArray:
        """Whether each frame is the first with its numbers and times."""
        columns = (self.arrived_ns, self.device_us, self.sequence, self.connection)
        order = np.lexsort(columns)
        mask = np.ones(len(order), dtype=np.bool_)
        mask[order[1:]] = np.any([np.diff(column[order]) != 0 for column in columns], axis=0)
        return mask

    def begins(self) -> _Begins:
        steps = [np.diff(column) for column in (self.connection, self.sequence, self.device_us)]
        connection, sequence, device_us = steps
        rises = (sequence > 0) & (device_us >= 0)
        passed_us = np.diff(self.time_ns) // 1000
        can_start = (connection > 0) | (self.device_us[1:] <= passed_us + LATE_US)
        can_start |= (sequence > 0) & ((connection < 0) & (device_us >= 0) | (device_us < -WRAP_US))
        mask = ~((connection == 0) & rises)
        return _Begins(np.concatenate([[False], mask]), np.concatenate([[False], can_start]))


def _is_sorted(time_ns: IntArray, place: IntArray) -> bool:
    step = np.diff(time_ns)
    return bool(((step > 0) | (step == 0) & (np.diff(place) > 0)).all())


def _sorted_within(every: _Columns, order: IntArray, begins: _Begins) -> tuple[IntArray, _Begins]:
    """Sort frames by their numbers within each run between new starts; raises InputError if that is no order either."""
    found = every.taken(order)
    run = np.cumsum(begins.mask & begins.explained)
    again = order[np.lexsort((found.sequence, found.connection, run))]
    after = every.taken(again).begins()
    if after.unexplained:
        raise InputError(
            f"{begins.unexplained} frames are out of order, and sequence numbers, board's clock and log times "
            "contradict each other: the file is damaged, or has several recordings of one time; keep those in folders "
            "of their own"
        )
    return again, after


def _require_even(found: _Columns) -> None:
    """Refuse an order of files in which the board's clock does not go on where the log time steps back."""
    device_us, sequence = np.diff(found.device_us), np.diff(found.sequence)
    goes_on = (device_us >= 0) & (sequence > 0) & (np.diff(found.connection) == 0)
    back = goes_on & (np.diff(found.time_ns) < 0)
    interval_us = np.median(device_us[goes_on] / sequence[goes_on])
    off_us = np.abs(device_us - sequence * interval_us)
    if (off_us[back] > US_PER_S + 0.1 * device_us[back]).any():
        raise InputError(
            "log times step back between frames that do not follow each other: the folder has several recordings; keep "
            "them in folders of their own"
        )


def _require_new_starts(found: _Columns, begins: BoolArray) -> None:
    """Refuse an order in which a connection continues one that comes later, as after the clock was set back."""
    first = np.flatnonzero(np.concatenate([[True], begins[1:]]))
    last = np.concatenate([first[1:] - 1, [len(begins) - 1]])
    ends = {(int(found.connection[k]), int(found.sequence[k])): int(k) for k in last}
    for one, k in enumerate(first.tolist()):
        for step in range(1, NEXT_FRAMES + 1):
            end = ends.get((int(found.connection[k]), int(found.sequence[k]) - step))
            if end is None or end <= last[one]:
                continue
            passed_us = int(found.device_us[k] - found.device_us[end])
            if 0 < passed_us < US_PER_S:
                raise InputError(
                    "the clock was set back between files, and their order is not known: add metadata.yaml, or name "
                    "the files in their order"
                )
