"""Press of each frame of a recording: location, depth, and its set in a press protocol."""

from __future__ import annotations

from dataclasses import dataclass

from design.arrays import BoolArray, FloatArray, IntArray
from design.recordings import SetEntry


@dataclass(frozen=True, kw_only=True)
class PressLabels:
    """Press of each frame of a recording.

    Attributes
    ----------
    press_mm : (time, 3) x, y, depth by the stage [mm]; depth 0 or less is untouched
    set_number : (time,) index of the set in `sets`; None if unknown
    place_number : (time,) number of the press within its set; None if unknown
    sets : the sets of presses
    """

    press_mm: FloatArray
    set_number: IntArray | None = None
    place_number: IntArray | None = None
    sets: tuple[SetEntry, ...] = ()

    def only(self, kept: BoolArray) -> PressLabels:
        """The presses of the frames selected by `kept` (time,), with all sets."""
        return PressLabels(
            press_mm=self.press_mm[kept],
            set_number=None if self.set_number is None else self.set_number[kept],
            place_number=None if self.place_number is None else self.place_number[kept],
            sets=self.sets,
        )
