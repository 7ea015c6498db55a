"""The press during each frame of a recording: location, depth, and set of presses."""

from __future__ import annotations

from dataclasses import dataclass

from design.arrays import BoolArray, FloatArray, IntArray
from design.recordings import SetEntry


@dataclass(frozen=True, kw_only=True)
class PressLabels:
    """The press during each of n frames of a recording.

    Attributes
    ----------
    press_mm : x, y and depth according to the stage, shape (n, 3) [mm]; the pad is untouched if depth is 0 or less
    set_number : index of the set in `sets`, shape (n,); None if unknown
    place_number : number of the press within its set, shape (n,); None if unknown
    sets : the sets of presses
    """

    press_mm: FloatArray
    set_number: IntArray | None = None
    place_number: IntArray | None = None
    sets: tuple[SetEntry, ...] = ()

    def only(self, kept: BoolArray) -> PressLabels:
        """The presses of the frames for which `kept` is True, with all sets."""
        return PressLabels(
            press_mm=self.press_mm[kept],
            set_number=None if self.set_number is None else self.set_number[kept],
            place_number=None if self.place_number is None else self.place_number[kept],
            sets=self.sets,
        )
