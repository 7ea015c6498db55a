"""What a stage must be able to do, and what it must not.

A stage holds the tip above the pad and moves it in the cavity frame: x, y from a corner of the cavity, depth positive
into the pad, 0 where the tip barely touches. `collection.Collector` drives anything that keeps to `Stage`;
`gcode_stage` has one for printers.

The presses of a collection: a plain list, or a CSV file of the same.

    x_mm,y_mm,depth_mm[,set,place,role,pattern,ambient]

one row a position at which frames are taken, in this order. Consecutive rows of one set and place are one press: it is
made as a whole or not at all. Without `set` everything is one set; without `place` a press ends where x or y changes.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from types import TracebackType
from typing import Protocol, Self

from design.csv_table import read_csv
from design.errors import InputError
from design.recordings import SetEntry
from design.shape.outline import Outline
from fabrication.driver.recording.position_log import set_entry, whole_place
from fabrication.driver_file import WorkspaceLimits

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
        raise InputError("presses: one set has two roles, patterns or lights; give each its own name")
    keys = [(press.set_number, press.place_number) for press in presses]
    twice = next((key for key in keys if keys.count(key) > 1), None) if len(set(keys)) < len(keys) else None
    if twice is not None:
        raise InputError(
            f"presses: press {twice[1]} of set {sets[twice[0]].name!r} is repeated after another press; "
            "number the presses uniquely"
        )
    return PressList(sets=sets, presses=presses)


def read_press_list(file: Path) -> PressList:
    """A list from a CSV file.

    Raises
    ------
    InputError : unreadable, columns missing, no number where one is needed; as `press_list`.
    """
    table = read_csv(
        file, needed=f"a CSV table with {','.join(NEEDED)}, optionally 'set', 'place'", lower=True
    )
    if missing := [name for name in NEEDED if name not in table.heading]:
        raise InputError(
            f"{file}: has no {', '.join(missing)}; needs {','.join(NEEDED)}, optionally 'set', 'place'; "
            f"it has {', '.join(table.heading)}"
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


Position = tuple[float, float, float]
"""x, y, depth [mm]."""

HIGHEST_MM = 60.0
"""Nothing asks for a tip further above the pad; a slip of a unit does."""

LIMIT_SLACK_MM = 1e-6


@dataclass(frozen=True, kw_only=True)
class StageLimits:
    """Where the tip may go: the design's press centres and depth; above the pad up to 60 mm.

    Attributes
    ----------
    area : press centres
    deepest_mm : deepest press
    """

    area: Outline
    deepest_mm: float

    def require(self, x_mm: float, y_mm: float, depth_mm: float) -> None:
        """Refuse a position outside.

        Raises
        ------
        InputError : which coordinate, its limits.
        """
        spans = (
            ("x", x_mm, self.area.x0_mm, self.area.x1_mm),
            ("y", y_mm, self.area.y0_mm, self.area.y1_mm),
            ("depth", depth_mm, -HIGHEST_MM, self.deepest_mm),
        )
        for name, value, low, high in spans:
            if not (math.isfinite(value) and low - LIMIT_SLACK_MM <= value <= high + LIMIT_SLACK_MM):
                raise InputError(
                    f"stage: {name} {value:g} mm is outside of {low:g} to {high:g} mm; nothing moves"
                )
        if not self.area.contains(x_mm, y_mm, LIMIT_SLACK_MM):
            raise InputError(f"stage: x {x_mm:g}, y {y_mm:g} mm is not {self.area.words}; nothing moves")


def limits_of(workspace: WorkspaceLimits) -> StageLimits:
    """Limits of a design, from its driver configuration."""
    return StageLimits(area=workspace.area, deepest_mm=workspace.max_depth_mm)


class Stage(Protocol):
    """A stage; a context manager that leaves with the tip lifted, whatever happened inside."""

    limits: StageLimits

    def __enter__(self) -> Self: ...

    def __exit__(
        self, kind: type[BaseException] | None, err: BaseException | None, trace: TracebackType | None
    ) -> None: ...

    def move_to(self, x_mm: float, y_mm: float, depth_mm: float) -> Position:
        """Go there, never sideways while touching, and stand; returns where the stage says that it is [mm].

        Raises
        ------
        InputError : outside of the limits; nothing has moved.
        DeviceError : the stage does not answer, refuses, or is not where it should be.
        """
        ...

    def lift(self) -> None:
        """Go straight up to the travel height."""
        ...

    def position(self) -> Position:
        """Where the stage says that the tip is, x, y, depth [mm]."""
        ...

    def stop(self) -> None:
        """End the motion at once, then lift."""
        ...
