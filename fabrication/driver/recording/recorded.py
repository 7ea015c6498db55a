"""A recording's frames as arrays, and the known press of each frame."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from design.arrays import BoolArray, FloatArray, IntArray
from design.recordings import signals_of
from fabrication.driver.recording.press_labels import PressLabels
from fabrication.driver_file import DriverConfig


@dataclass(frozen=True, kw_only=True)
class Recorded:
    """The n frames of a recording, as arrays.

    Attributes
    ----------
    config : driver configuration of the sensor
    counts : readings, shape (n, states, receivers) [counts]
    connection : connection number of each frame, from 1
    sequence : sequence number of each frame within its connection
    device_s : time of each frame by the board's clock, since its reset [s]
    host_s : time of each frame by the host's clock, since 1970 [s]
    labels : press of each frame; None if the recording contains no presses
    lost : number of frames missing, by their sequence numbers
    doubled : number of frames that arrived twice; one of the two is kept
    stray_bytes : number of bytes in the file that belong to no complete record
    ended_cleanly : whether the recorder closed the file normally
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

    @property
    def press_mm(self) -> FloatArray | None:
        """Press of each frame (x, y, depth), shape (n, 3) [mm]; None if the recording contains no presses."""
        return None if self.labels is None else self.labels.press_mm

    @property
    def signals(self) -> FloatArray:
        """Readings minus those in the dark state, shape (n, emitters, receivers) [counts]."""
        return signals_of(self.counts.astype(np.float64))

    def only(self, kept: BoolArray) -> Recorded:
        """The recording with only the frames for which `kept` is True; the numbers of lost and doubled frames do not
        change."""
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        cut: dict[str, Any] = {
            name: value[kept] for name, value in values.items() if isinstance(value, np.ndarray)
        }
        return replace(self, labels=None if self.labels is None else self.labels.only(kept), **cut)


def press_labels(presses_mm: FloatArray, press_s: FloatArray, host_s: FloatArray) -> PressLabels:
    """Press of each frame: the last press recorded before it. Frames before the first press are untouched.

    Parameters
    ----------
    presses_mm : (press, 3) x, y, depth of known presses [mm]
    press_s, host_s : (press,) and (time,) times of the presses and of the frames' arrivals, by the host's clock [s]
    """
    return labels_at(presses_mm, np.searchsorted(press_s, host_s, side="right") - 1)


def labels_at(presses_mm: FloatArray, before: IntArray) -> PressLabels:
    """Press of each frame by the number (time,) of the press before it; -1 before the first press."""
    untouched = np.array([presses_mm[0, 0], presses_mm[0, 1], 0.0])
    return PressLabels(
        press_mm=np.where((before >= 0)[:, None], presses_mm[np.maximum(before, 0)], untouched)
    )
