"""The presses of a collection: a plain list, or a CSV file of the same.

    x_mm,y_mm,depth_mm[,set,place,role,pattern,ambient]

one row a position at which frames are taken, in this order. Consecutive rows of one set and place are one press: it is
made as a whole or not at all. Without `set` everything is one set; without `place` a press ends where x or y changes.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path

from design.csv_table import read_csv
from design.errors import InputError
from design.recordings import SetEntry
from fabrication.driver.recording.position_log import set_entry, whole_place
from fabrication.stage.stage import Position, StageLimits

NEEDED = ("x_mm", "y_mm", "depth_mm")
ONE_SET = "collected"


@dataclass(frozen=True, kw_only=True)
class Press:
    """One press.

    Attributes
    ----------
    set_number, place_number : of its set in the list's `sets`; of the press within it
    steps_mm : where frames are taken, in order: x, y, depth [mm]
    """

    set_number: int
    place_number: int
    steps_mm: tuple[Position, ...]


@dataclass(frozen=True, kw_only=True)
class PressList:
    """Presses in the order in which they are made."""

    sets: tuple[SetEntry, ...]
    presses: tuple[Press, ...]

    @property
    def digest(self) -> str:
        """SHA-256 over all of it, 64 digits."""
        presses = [(press.set_number, press.place_number, press.steps_mm) for press in self.presses]
        return hashlib.sha256(repr((self.sets, presses)).encode()).hexdigest()

    def require_within(self, limits: StageLimits) -> None:
        """Refuse a list with a position that the stage must not go to; InputError names the first."""
        for press in self.presses:
            for step in press.steps_mm:
                try:
                    limits.require(*step)
                except InputError as err:
                    name = self.sets[press.set_number].name
                    raise InputError(f"press {press.place_number} of set {name!r}: {err}") from None


def press_list(rows: Iterable[tuple[SetEntry, int, Position]]) -> PressList:
    """A list from rows of set, number of the press within it, and position.

    Raises
    ------
    InputError : no rows; one name for two sets; a press that comes up again after another.
    """
    plain = list(rows)
    grouped = [
        (entry, place, tuple(step for _, _, step in steps))
        for (entry, place), steps in groupby(plain, key=lambda row: row[:2])
    ]
    sets = tuple(dict.fromkeys(entry for entry, _, _ in grouped))
    presses = tuple(
        Press(set_number=sets.index(entry), place_number=place, steps_mm=steps)
        for entry, place, steps in grouped
    )
    if not presses:
        raise InputError("presses: none; give at least one position")
    if len({entry.name for entry in sets}) < len(sets):
        raise InputError("presses: one set has two roles, patterns or lights; name them apart")
    keys = [(press.set_number, press.place_number) for press in presses]
    twice = next((key for key in keys if keys.count(key) > 1), None) if len(set(keys)) < len(keys) else None
    if twice is not None:
        raise InputError(
            f"presses: press {twice[1]} of set {sets[twice[0]].name!r} comes up again after another; "
            "number presses apart"
        )
    return PressList(sets=sets, presses=presses)


def read_press_list(file: Path) -> PressList:
    """A list from a CSV file.

    Raises
    ------
    InputError : unreadable, columns missing, no number where one is needed; as `press_list`.
    """
    table = read_csv(file, needed=f"a CSV table with {','.join(NEEDED)}, perhaps set, place", lower=True)
    if missing := [name for name in NEEDED if name not in table.heading]:
        raise InputError(
            f"{file}: has no {', '.join(missing)}; needs {','.join(NEEDED)}, perhaps set, place; it has "
            f"{', '.join(table.heading)}"
        )
    rows, place, last = [], -1, None
    steps = zip(*(table.numbers(name) for name in NEEDED), strict=True)
    for number, (row, step) in enumerate(zip(table.records(), steps, strict=True)):
        where = table.where(number)
        entry = set_entry(where, row | {"set": row.get("set") or ONE_SET})
        at = (entry.name, step[0], step[1])
        place = whole_place(where, row["place"]) if "place" in row else place + (at != last)
        last = at
        rows.append((entry, place, step))
    try:
        return press_list(rows)
    except InputError as err:
        raise InputError(f"{file}: {err}") from None
