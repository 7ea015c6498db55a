"""Where the pad was pressed in each sample of a recording, and which set of a protocol each belongs to."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass

from design.arrays import BoolArray, FloatArray, IntArray
from design.errors import InputError

ROLES = ("train", "test")
PATTERNS = ("grid", "random", "unknown", "measured")
"""The last is what older files have for unknown."""


@dataclass(frozen=True, kw_only=True)
class SetEntry:
    """One set of presses.

    Attributes
    ----------
    role : what a learner does with it, `train` or `test`
    pattern : `grid`, `random`, or `unknown`
    is_ambient : whether the room was lit
    """

    name: str
    role: str = "train"
    pattern: str = "unknown"
    is_ambient: bool = True

    def __post_init__(self) -> None:
        for field, value, allowed in (("role", self.role, ROLES), ("pattern", self.pattern, PATTERNS)):
            if value not in allowed:
                raise InputError(
                    f"set {self.name!r}: {field} is {value!r}, needs one of {', '.join(allowed)}"
                )


@dataclass(frozen=True, kw_only=True)
class PressLabels:
    """Labels of samples.

    Attributes
    ----------
    press_mm : (time, 3) x, y, depth as the stage says [mm]; depth 0 or less is untouched
    set_number, place_number : (time,) of the set in `sets`, and of the press within it; None where nobody says
    """

    press_mm: FloatArray
    set_number: IntArray | None = None
    place_number: IntArray | None = None
    sets: tuple[SetEntry, ...] = ()

    def only(self, kept: BoolArray) -> PressLabels:
        """The labels of some samples; all sets stay."""
        return PressLabels(
            press_mm=self.press_mm[kept],
            set_number=None if self.set_number is None else self.set_number[kept],
            place_number=None if self.place_number is None else self.place_number[kept],
            sets=self.sets,
        )


def sets_json(sets: tuple[SetEntry, ...]) -> str:
    """The sets as the attribute `sets` of a netCDF file."""
    return json.dumps([asdict(entry) for entry in sets])
