"""A recording's frames as arrays, and the known press of each frame."""

from __future__ import annotations

import json
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from optopad.design.arrays import BoolArray, FloatArray, IntArray
from optopad.design.errors import InputError
from optopad.design.recordings import signals_of
from optopad.fabrication.driver.recording.press_labels import PressLabels
from optopad.fabrication.driver_file import DriverConfig


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
