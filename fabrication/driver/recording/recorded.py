"""A recording's frames as arrays, and the known press of each frame: location, depth, and set of presses.

A known press is valid until the next one. Frames and presses are compared by one clock: that of the recorder, which
gave both their times. Equal times are decided by the order in which the recorder wrote them. If the recorder's clock
was set back, times are ambiguous, and this order decides alone. A frame whose press remains unknown has no label.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from optopad.design.arrays import BoolArray, FloatArray, IntArray
from optopad.design.errors import InputError
from optopad.design.recordings import SetEntry, signals_of
from optopad.fabrication.driver_file import DriverConfig

NS_PER_S = 1_000_000_000
SET_BACK_NS = NS_PER_S
"""Backward step in the times of successive frames above which the clock is taken as set back [ns]."""
EARLIEST_NS = 60 * NS_PER_S
"""Longest time before the first frame in which a press may have been set that is still valid then [ns]."""
NEVER_NS = np.iinfo(np.int64).min


@dataclass(frozen=True, kw_only=True)
class PressLabels:
    """The press during each of n frames of a recording.

    Attributes
    ----------
    press_mm : x, y and depth according to the stage, shape (n, 3) [mm]; the pad is untouched if depth is 0 or less
    others_mm : the same of k further fingers, shape (n, k, 3) [mm]; such a finger does not touch if depth is 0 or less,
        or NaN
    set_number : index of the set in `sets`, shape (n,); None if unknown
    place_number : number of the press within its set, shape (n,); None if unknown
    sets : the sets of presses

    Raises
    ------
    InputError : a position is not a finite number.
    """

    press_mm: FloatArray
    others_mm: FloatArray = field(default_factory=lambda: np.zeros((0, 0, 3)))
    set_number: IntArray | None = None
    place_number: IntArray | None = None
    sets: tuple[SetEntry, ...] = ()

    def __post_init__(self) -> None:
        """Refuse positions that are not finite numbers."""
        bad = np.flatnonzero(~np.isfinite(self.press_mm).all(axis=1))
        if len(bad):
            x_mm, y_mm, depth_mm = self.press_mm[bad[0]]
            raise InputError(
                f"the press of {len(bad)} of {len(self.press_mm)} frames is not finite, first of frame {bad[0] + 1}: "
                f"{x_mm:g}, {y_mm:g}, {depth_mm:g} mm; correct it, or drop these frames"
            )

    @property
    def has_others(self) -> bool:
        """Whether there are further fingers."""
        return bool(self.others_mm.shape[1])

    def only(self, kept: BoolArray) -> PressLabels:
        """The presses of the frames for which `kept` is True, with all sets."""
        return PressLabels(
            press_mm=self.press_mm[kept],
            others_mm=self.others_mm[kept] if self.has_others else self.others_mm,
            set_number=None if self.set_number is None else self.set_number[kept],
            place_number=None if self.place_number is None else self.place_number[kept],
            sets=self.sets,
        )


@dataclass(frozen=True, kw_only=True)
class Moments:
    """When n frames or presses were recorded.

    Attributes
    ----------
    time_ns : times by the recorder's clock, shape (n,) [ns]
    place : place of each in the order in which the recorder wrote frames and presses, shape (n,)
    """

    time_ns: IntArray
    place: IntArray


@dataclass(frozen=True, kw_only=True)
class Start:
    """Where another recording of the same sensor begins; presses between the two are not recorded.

    Attributes
    ----------
    before_ns : time of the last frame of the recording before [ns]
    first_ns : time of the first frame or press of the new recording [ns]
    place : place of that frame or press in the order in which all were written
    """

    before_ns: int
    first_ns: int
    place: int


def press_labels(
    press_mm: FloatArray,
    presses: Moments,
    frames: Moments,
    gaps_ns: Sequence[tuple[int, int]] = (),
    starts: Sequence[Start] = (),
) -> tuple[PressLabels, BoolArray]:
    """Press of each frame, and whether it is known; frames before the first press of their recording are untouched.

    In a recording that has no press, or that follows one with a press, they are unknown.

    Parameters
    ----------
    press_mm : (press, 3) x, y, depth of known presses, at least one [mm]
    presses, frames : when they were recorded; frames in the order in which the sensor sent them
    gaps_ns : times of the last record before and the first one behind each gap in which presses may be missing [ns]
    starts : where further recordings begin

    Raises
    ------
    InputError : no press was set during the frames, or order and times contradict each other.
    """
    if _step_back_ns(frames.time_ns) > SET_BACK_NS:
        number = _by_order(presses, frames)
        if gaps_ns:
            raise InputError(
                f"the clock was set back and parts of the recording are missing: {_spans(presses, frames)}; the "
                "press of a frame cannot be known, record again"
            )
        known = np.ones(len(number), dtype=np.bool_)
        pressed = np.where(number >= 0, presses.place[np.maximum(number, 0)], presses.place.min())
        for start in starts:
            known &= (frames.place < start.place) == (pressed < start.place)
    else:
        _require_overlap(presses, frames)
        number, known = _by_time(presses, frames)
        pressed_ns = np.where(number >= 0, presses.time_ns[np.maximum(number, 0)], NEVER_NS)
        for begin_ns, end_ns in gaps_ns:
            if end_ns < begin_ns:
                raise InputError(
                    "parts of the recording are missing, and the others are not in the order of time: the press of a "
                    "frame cannot be known; repair the file, as by `mcap recover` and `mcap sort`"
                )
            known &= (frames.time_ns <= begin_ns) | (pressed_ns >= end_ns)
        pressed_ns = np.where(number >= 0, pressed_ns, presses.time_ns.min())
        for start in starts:
            known &= (frames.time_ns <= start.before_ns) == (pressed_ns < start.first_ns)
    untouched = np.array([press_mm[0, 0], press_mm[0, 1], 0.0])
    labels = np.where((number >= 0)[:, None], press_mm[np.maximum(number, 0)], untouched)
    return PressLabels(press_mm=labels), known


def _by_time(presses: Moments, frames: Moments) -> tuple[IntArray, BoolArray]:
    """Number of the press before each frame by time, -1 before the first; known if every order of the times agrees."""
    presses = _valid_from_their_time(presses, frames)
    latest_ns: IntArray = np.maximum.accumulate(frames.time_ns)
    number = _before(presses, Moments(time_ns=latest_ns, place=frames.place))
    if (latest_ns == frames.time_ns).all():
        return number, np.ones(len(number), dtype=np.bool_)
    earliest_ns: IntArray = np.minimum.accumulate(frames.time_ns[::-1])[::-1]
    return number, number == _before(presses, Moments(time_ns=earliest_ns, place=frames.place))


def _valid_from_their_time(presses: Moments, frames: Moments) -> Moments:
    """The presses, with those before the frames of the same time that were written after a later frame: a program
    stated their times afterwards."""
    time_ns: IntArray = np.maximum.accumulate(frames.time_ns)
    after = np.searchsorted(time_ns, presses.time_ns, side="right")
    is_stated = (after < len(time_ns)) & (presses.place > frames.place[np.minimum(after, len(time_ns) - 1)])
    return Moments(time_ns=presses.time_ns, place=np.where(is_stated, -1, presses.place))


def _before(presses: Moments, frames: Moments) -> IntArray:
    count = len(frames.place)
    order = np.lexsort(
        (np.concatenate([frames.place, presses.place]), np.concatenate([frames.time_ns, presses.time_ns]))
    )
    is_press = order >= count
    last = np.cumsum(is_press) - 1
    sorted_presses = np.concatenate([[-1], order[is_press] - count])
    found = np.empty(count, dtype=np.int64)
    found[order[~is_press]] = sorted_presses[last[~is_press] + 1]
    return found


def _by_order(presses: Moments, frames: Moments) -> IntArray:
    """Number of the press before each frame by the order in which the recorder wrote them."""
    place = np.concatenate([frames.place, presses.place])
    order = np.argsort(place, kind="stable")
    time_ns = np.concatenate([frames.time_ns, presses.time_ns])[order]
    is_press = order >= len(frames.place)
    part = np.concatenate([[0], np.cumsum(np.diff(time_ns) < -SET_BACK_NS)])
    alone = np.setdiff1d(part[is_press], part[~is_press])
    if len(alone) or (np.diff(frames.place) < 0).any():
        raise InputError(
            f"the clock was set back, and presses and frames are not in the order in which they came: "
            f"{_spans(presses, frames)}; record again without changing the clock"
        )
    return _before(*(Moments(time_ns=np.zeros_like(one.place), place=one.place) for one in (presses, frames)))


def _require_overlap(presses: Moments, frames: Moments) -> None:
    first, last = frames.time_ns.min(), frames.time_ns.max()
    if not ((presses.time_ns >= first - EARLIEST_NS) & (presses.time_ns <= last)).any():
        raise InputError(
            f"no press was set during the frames: {_spans(presses, frames)}; are they of another recording, or by "
            "another clock? Record both with one recorder"
        )


def _spans(presses: Moments, frames: Moments) -> str:
    begun = frames.time_ns[0]
    (a, b), (c, d) = (
        ((one.time_ns.min() - begun) / NS_PER_S, (one.time_ns.max() - begun) / NS_PER_S)
        for one in (frames, presses)
    )
    return f"frames from {a:.1f} to {b:.1f} s, presses from {c:.1f} to {d:.1f} s"


def _step_back_ns(time_ns: IntArray) -> int:
    return int((np.maximum.accumulate(time_ns) - time_ns).max()) if len(time_ns) else 0


@dataclass(frozen=True, kw_only=True)
class Recorded:
    """The n frames of a recording, as arrays, in the order in which the sensor sent them.

    Attributes
    ----------
    config : driver configuration of the sensor
    counts : readings, shape (n, states, receivers) [counts]
    connection : connection number of each frame, from 1; it increases where sequence and board's clock start anew
    sequence : sequence number of each frame within its connection, increasing
    device_s : time of each frame by the board's clock, since its reset [s]
    host_s : time of each frame's arrival by the clock of the machine that read the board, since 1970 [s]. The log time
        of a bag may be another clock; presses are joined by that one. `host_s` never decreases unless the clock was set
        back; code that searches in it calls `require_rising` first
    labels : press of each frame; None if the recording contains no presses
    lost : number of frames missing, by their sequence numbers
    doubled : number of frames that arrived twice; one of the two is kept
    left_out : number of frames left out because their press is unknown: presses may be among the missing records
    stray_bytes : number of bytes in the file that belong to no complete record
    missing_files : files that a bag's `metadata.yaml` lists, but that are not in its folder
    ended_cleanly : whether the recorder closed the file normally
    made_presses : number of presses of a collection that are stored, and of all its presses; None if it is none
    """

    config: DriverConfig
    counts: NDArray[np.uint16]
    connection: IntArray
    sequence: IntArray
    device_s: FloatArray
    host_s: FloatArray
    labels: PressLabels | None
    lost: int
    stray_bytes: int
    ended_cleanly: bool
    doubled: int = 0
    left_out: int = 0
    missing_files: tuple[str, ...] = ()
    made_presses: tuple[int, int] | None = None

    def require_one_finger(self, out: Path) -> None:
        """Check that the press of one finger is known, for files that hold no more; raises InputError."""
        if self.labels is not None and self.labels.has_others:
            raise InputError(
                f"{out}: has the press of one finger a frame, and two are known; give a file .nc, or --lerobot"
            )

    @property
    def press_mm(self) -> FloatArray | None:
        """Press of each frame (x, y, depth), shape (n, 3) [mm]; None if the recording contains no presses."""
        return None if self.labels is None else self.labels.press_mm

    @property
    def signals(self) -> FloatArray:
        """Readings minus those in the dark state, shape (n, emitters, receivers) [counts]."""
        return signals_of(self.counts.astype(np.float64))

    @property
    def losses(self) -> str:
        """What is missing, such as "2 lost; the end is incomplete: 70 bytes belong to no whole record"."""
        told = [f"{self.lost} lost"]
        if self.doubled:
            told.append(f"{self.doubled} doubled")
        if self.left_out:
            told.append(f"{self.left_out} left out, as their press is not known")
        text = ", ".join(told)
        if self.missing_files:
            text += f"; {', '.join(self.missing_files)} of metadata.yaml is missing"
        if self.made_presses is not None and self.made_presses[0] < self.made_presses[1]:
            text += "; {} of {} presses made".format(*self.made_presses)
        if not self.ended_cleanly and self.stray_bytes:
            text += f"; the end is incomplete: {self.stray_bytes} bytes belong to no whole record"
        elif self.stray_bytes:
            text += f"; {self.stray_bytes} bytes belong to no whole record"
        elif not self.ended_cleanly and not self.missing_files:
            text += "; the recorder did not end it"
        return text

    @property
    def is_whole(self) -> bool:
        """Whether nothing is missing."""
        is_complete = self.made_presses is None or self.made_presses[0] == self.made_presses[1]
        return self.ended_cleanly and is_complete and not (self.lost or self.left_out or self.stray_bytes)

    def only(self, kept: BoolArray) -> Recorded:
        """The recording with only the frames for which `kept` is True; the numbers of lost and doubled frames do not
        change."""
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        cut: dict[str, Any] = {
            name: value[kept] for name, value in values.items() if isinstance(value, np.ndarray)
        }
        return replace(self, labels=None if self.labels is None else self.labels.only(kept), **cut)


LOSSES_NAME = "optopad_losses"
"""Name of the metadata in an MCAP file that say what was missing of the recording from which it was made."""
LOSS_COUNTS = ("lost", "absent", "doubled", "left_out", "stray_bytes")


def absent_frames(connection: IntArray, sequence: IntArray) -> int:
    """Number of sequence numbers that are missing within the connections; both arguments have the shape (n,)."""
    steps = np.diff(sequence)[np.diff(connection) == 0]
    return int((steps - 1).sum())


def losses_metadata(recorded: Recorded, topic: str) -> dict[str, str]:
    """What is missing of a recording, as metadata for a copy of it; empty if nothing is.

    Parameters
    ----------
    topic : topic of the copy's frames
    """
    if recorded.is_whole and not recorded.doubled:
        return {}
    absent = absent_frames(recorded.connection, recorded.sequence)
    counts = {name: absent if name == "absent" else getattr(recorded, name) for name in LOSS_COUNTS}
    return {
        "topic": topic,
        "begun_s": repr(float(recorded.host_s[0])),
        **{name: str(count) for name, count in counts.items()},
        "ended_cleanly": json.dumps(recorded.ended_cleanly),
        "missing_files": json.dumps(recorded.missing_files),
    }


def with_earlier_losses(recorded: Recorded, metadata: dict[str, str]) -> Recorded:
    """The recording that was read from a copy, with the losses of its original, from `losses_metadata`.

    Raises
    ------
    InputError : the metadata are damaged.
    """
    try:
        counts = {name: int(metadata[name]) for name in LOSS_COUNTS}
        ended_cleanly, missing = (json.loads(metadata[name]) for name in ("ended_cleanly", "missing_files"))
        missing = tuple(str(name) for name in missing)
    except (KeyError, ValueError, TypeError, RecursionError) as err:
        raise InputError(
            f"the metadata {LOSSES_NAME} are damaged: {err!r}; export the recording again"
        ) from None
    return replace(
        recorded,
        lost=max(recorded.lost + counts["lost"] - counts["absent"], 0),
        doubled=recorded.doubled + counts["doubled"],
        left_out=recorded.left_out + counts["left_out"],
        stray_bytes=recorded.stray_bytes + counts["stray_bytes"],
        ended_cleanly=recorded.ended_cleanly and ended_cleanly is True,
        missing_files=(*recorded.missing_files, *missing),
    )


def require_rising(host_s: FloatArray) -> None:
    """Raise InputError if the host's clock was set back during a recording; shape of its times (n,) [s]."""
    step_s = np.diff(host_s)
    if (step_s < 0).any():
        frame = int(np.flatnonzero(step_s < 0)[0])
        raise InputError(
            f"the recording's clock was set back by {-step_s[frame]:.2f} s after frame {frame + 1}: no "
            "log can be joined to it; record again without changing the clock"
        )
