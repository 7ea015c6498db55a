"""Joins a stage's log to a recording: each frame gets the tip's position, the set and the press number from the log.

A frame's time is its arrival at the host, about 5 to 20 ms after the measurement. At 5 mm/s, the tip moves by up to
0.1 mm in this time; if that matters, hold the tip still during frames. Frames without a known position are left out and
counted.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Literal

import numpy as np

from optopad.design.arrays import FloatArray, IntArray
from optopad.design.errors import InputError
from optopad.fabrication.driver.descriptor import descriptor_of
from optopad.fabrication.driver.recording.clock_match import (
    ClockMatch,
    found_offset,
    match_at,
    require_in_step,
    touches_of_log,
    touches_of_signals,
)
from optopad.fabrication.driver.recording.position_log import PositionLog
from optopad.fabrication.driver.recording.recorded import Recorded, require_rising

LATE_S = 0.05
"""A frame counts as delayed if its delay exceeds the shortest delay of frames near it by more than this [s].

Such delays occur when the computer is busy or asleep.
"""

LAG_S = 2.0
"""Length of the time intervals in each of which the shortest delay of a frame is determined [s].

Over two intervals, a clock error of 0.5 % changes the delay by 20 ms.
"""

Offset = float | Literal["auto"] | None
"""Clock offset: clock of the recording's computer minus the log's clock [s]. With "auto", the offset is found from the
touches. None means that both use the same clock, which is checked."""


@dataclass(frozen=True, kw_only=True)
class JoinedLog:
    """A recording whose frames have positions from a stage's log.

    Attributes
    ----------
    recorded : the frames with a known position
    offset_s : clock offset that was used: clock of the recording's computer minus the log's clock [s]
    match : match of the touches in recording and log, near that offset
    left_out : number of frames without a known position
    """

    recorded: Recorded
    offset_s: float
    match: ClockMatch
    left_out: int


def joined(recorded: Recorded, log: PositionLog, offset: Offset = None) -> JoinedLog:
    """Give every frame of a recording the tip's position in a stage's log at the frame's time.

    Raises
    ------
    InputError : recording and log do not overlap in time, their touches do not match, or the clock offset cannot be
        found or is ambiguous.
    """
    require_rising(recorded.host_s)
    host_s = measured_s(recorded.host_s, recorded.device_s, recorded.connection)
    said = descriptor_of(recorded.config)
    seen = touches_of_signals(host_s, recorded.signals, 0.98 * said.full_scale)
    logged = touches_of_log(log)
    if offset == "auto":
        match = found_offset(seen, logged)
        offset_s = match.offset_s
    else:
        offset_s = float(offset or 0.0)
        _require_overlap(recorded, log, offset_s)
        match = require_in_step(seen, logged) if offset is None else match_at(seen, logged, offset_s)
    labels, known = log.labels_at(host_s - offset_s)
    if not known.any():
        raise InputError(
            f"{log.file}: of {len(host_s)} frames none has a known position: {_spans(recorded, log, offset_s)}"
        )
    whole = replace(recorded, labels=labels)
    return JoinedLog(
        recorded=whole.only(known), offset_s=offset_s, match=match, left_out=int(np.count_nonzero(~known))
    )


def measured_s(host_s: FloatArray, device_s: FloatArray, connection: IntArray) -> FloatArray:
    """Arrival time of each frame by the host's clock, never decreasing, shape (n,) [s].

    For frames that had to wait because the host was busy, the time is derived from the board's clock. Frames that were
    read together have the same time.

    Parameters
    ----------
    host_s : host's time of arrival of each frame, never decreasing, shape (n,) [s]
    device_s, connection : board's time [s] and connection number of each frame, shape (n,); the board's clock starts
        anew where the number changes, or where it goes back
    """
    late_s = np.zeros(len(host_s))
    anew = 1 + np.flatnonzero((np.diff(connection) != 0) | (np.diff(device_s) < 0.0))
    for begin, end in pairwise([0, *anew.tolist(), len(host_s)]):
        own_s = device_s[begin:end]
        lag_s, block = host_s[begin:end] - own_s, ((own_s - own_s[0]) // LAG_S).astype(np.int64)
        least_s = np.full(block.max() + 3, np.inf)
        np.minimum.at(least_s, block + 1, lag_s)
        near_s = np.minimum(np.minimum(least_s[:-2], least_s[1:-1]), least_s[2:])
        late_s[begin:end] = lag_s - near_s[block]
    found: FloatArray = np.maximum.accumulate(host_s - np.where(late_s > LATE_S, late_s, 0.0))
    return found


def _require_overlap(recorded: Recorded, log: PositionLog, offset_s: float) -> None:
    first, last = log.time_s[[0, -1]] + offset_s
    if last < recorded.host_s.min() or first > recorded.host_s.max():
        raise InputError(
            f"{log.file}: no time in common with the recording: {_spans(recorded, log, offset_s)}; is it "
            "another run's log, or another clock? Find the offset with --offset auto, or give it"
        )


def _spans(recorded: Recorded, log: PositionLog, offset_s: float) -> str:
    begun = recorded.host_s.min()
    first, last = log.time_s[[0, -1]] + offset_s - begun
    ends = f"frames from 0 to {recorded.host_s.max() - begun:.1f} s of the recording"
    return f"{ends}, the log from {first:.1f} to {last:.1f} s"
