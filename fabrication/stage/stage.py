"""Interface and limits of a stage, lists of presses, and the path of the tip.

A stage holds the tip above the pad and moves it in the cavity's coordinate system: x and y are measured from a corner
of the cavity; depth is positive into the pad and 0 at first contact. `collection.Collector` can use any implementation
of `Stage`; `gcode_stage` contains one for printers.

The presses of a collection are given as a list, or as a CSV file with these columns:

    x_mm,y_mm,depth_mm[,set,place,role,pattern,ambient]

Each table row is a position at which frames are taken, in this order. Consecutive table rows with equal `set` and
`place` are one press, which is made completely or not at all. If there is no column `set`, all presses form one set. If
there is no column `place`, a press ends where x or y changes.

A path of the tip over time, as its program commanded it, has rests and straight moves of constant speed. It consists of
knots. Between two knots the position is linear in time, so a rest is two knots at one position. A
knot without a position (NaN) means that the position around it is unknown.

The printer reports when a move has ended, not when it began: firmware may hold a single move back for a tenth of a
second, to wait for more moves. So a move ends when the report arrives, and it began earlier by its way over its
commanded speed. A move that took longer than that by more than `LATEST_START_S` was slower than commanded, because the
printer limits its speed; then it began with the command.

Left out are acceleration and the delay of the report. Together they make the path late by a common 5 to 20 ms: at 5
mm/s and 500 mm/s², acceleration makes it late by 5 ms, or 0.03 mm. A fit of a force to the path finds such a delay as
an offset of the clock.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

import numpy as np

from optopad.design.arrays import FloatArray
from optopad.design.csv_table import read_csv
from optopad.design.errors import InputError
from optopad.design.recordings import SetEntry
from optopad.design.shape.outline import Outline
from optopad.fabrication.driver.recording.position_log import set_entry, whole_place
from optopad.fabrication.driver_file import WorkspaceLimits

if TYPE_CHECKING:
    from typing_extensions import Self  # in typing from Python 3.11

NEEDED = ("x_mm", "y_mm", "depth_mm")
ONE_SET = "collected"


@dataclass(frozen=True, kw_only=True)
class StagePress:
    """One press of a collection: a sequence of positions to which the tip moves.

    Attributes
    ----------
    set_number : index of the press's set in `PressList.sets`
    place_number : number of the press within the set
    steps_mm : positions (x, y, depth) at which frames are taken, in order, in the cavity's coordinate system [mm]
    """

    set_number: int
    place_number: int
    steps_mm: tuple[Position, ...]


@dataclass(frozen=True, kw_only=True)
class PressList:
    """Presses of a collection in the order in which they are made, and their sets."""

    sets: tuple[SetEntry, ...]
    presses: tuple[StagePress, ...]

    @property
    def digest(self) -> str:
        """SHA-256 of the complete list, as 64 hexadecimal digits."""
        presses = [(press.set_number, press.place_number, press.steps_mm) for press in self.presses]
        return hashlib.sha256(repr((self.sets, presses)).encode()).hexdigest()

    def require_within(self, limits: StageLimits) -> None:
        """Raise InputError if a position is outside the limits; the message names the first such position."""
        for press in self.presses:
            for step in press.steps_mm:
                try:
                    limits.require(*step)
                except InputError as err:
                    name = self.sets[press.set_number].name
                    raise InputError(f"press {press.place_number} of set {name!r}: {err}") from None


def press_list(rows: Iterable[tuple[SetEntry, int, Position]]) -> PressList:
    """Make a list of presses from table rows, each of which has a set, a press number within the set, and a position.

    Raises
    ------
    InputError : there are no rows, two sets have the same name, or the rows of one press are not consecutive.
    """
    plain = list(rows)
    grouped = [
        (entry, place, tuple(step for _, _, step in steps))
        for (entry, place), steps in groupby(plain, key=lambda row: row[:2])
    ]
    sets = tuple(dict.fromkeys(entry for entry, _, _ in grouped))
    presses = tuple(
        StagePress(set_number=sets.index(entry), place_number=place, steps_mm=steps)
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
    """Read a list of presses from a CSV file.

    Raises
    ------
    InputError : the file cannot be read, is incomplete, or contradicts itself.
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
"""Position of the tip: x, y, depth in the cavity's coordinate system [mm]; depth is positive into the pad."""

HIGHEST_MM = 60.0
"""Largest permitted height of the tip above the pad [mm]; a larger value indicates a wrong unit."""

LIMIT_SLACK_MM = 1e-6


@dataclass(frozen=True, kw_only=True)
class StageLimits:
    """Permitted positions of the tip: within the design's workspace, and up to 60 mm above the pad.

    Attributes
    ----------
    area : region of the permitted x and y coordinates
    deepest_mm : largest permitted depth [mm]
    """

    area: Outline
    deepest_mm: float

    def require(self, x_mm: float, y_mm: float, depth_mm: float) -> None:
        """Check that a position is within the limits.

        Raises
        ------
        InputError : the position is outside; the message gives the coordinate and its limits, or the region.
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
    """Permitted positions of the tip for a design's workspace."""
    return StageLimits(area=workspace.area, deepest_mm=workspace.max_depth_mm)


class Stage(Protocol):
    """Interface of a stage: a context manager that lifts the tip when the `with` block ends, even after an error."""

    limits: StageLimits

    def __enter__(self) -> Self: ...

    def __exit__(self, kind: Any, err: Any, trace: Any, /) -> None: ...

    def move_to(self, x_mm: float, y_mm: float, depth_mm: float) -> Position:
        """Move to a position, stop, and return the position that the stage reports [mm].

        The tip never moves laterally while it touches the pad.

        Raises
        ------
        InputError : the position is outside the limits; nothing has moved.
        DeviceError : the stage does not reply, refuses the command, or is not at the target.
        """
        ...

    def lift(self) -> None:
        """Move the tip straight up to the height for lateral motion."""
        ...

    def position(self) -> Position:
        """Position of the tip that the stage reports (x, y, depth), in the cavity's coordinate system [mm]."""
        ...

    def stop(self) -> None:
        """Stop the motion immediately, then lift the tip."""
        ...


Knot = tuple[float, float, float, float]
"""Time [s since 1970] and position x, y, depth [mm] of the tip."""
NOWHERE: Position = (math.nan, math.nan, math.nan)
LATEST_START_S = 0.2
"""Longest time between a command and the beginning of its move [s]."""
SAME_MM = 0.05
"""Greatest step between two parts of a path [mm]; at a larger one a part between them is missing."""


@runtime_checkable
class TracedStage(Stage, Protocol):
    """A stage that knows the path of its tip."""

    def path(self) -> list[Knot]:
        """Knots of the path since the last call, to the present time; the tip is at rest."""
        ...


def leg(sent_s: float, ended_s: float, start: Position, end: Position, speed_mm_s: float) -> list[Knot]:
    """Knots of a straight move.

    Parameters
    ----------
    sent_s, ended_s : times at which it was commanded, and at which its end was reported [s since 1970]
    start, end : positions before and after [mm]
    speed_mm_s : commanded speed [mm/s]
    """
    takes_s = math.dist(start, end) / speed_mm_s
    is_late = ended_s - sent_s > takes_s + LATEST_START_S
    began_s = sent_s if is_late else max(sent_s, ended_s - takes_s)
    return [(began_s, *start), (ended_s, *end)]


def joined_path(parts: Iterable[FloatArray]) -> FloatArray | None:
    """The knots (n, 4) of a whole path, from its parts in any order; None if there are none, or if times decrease.

    Where a part does not continue at the position at which the part before it ended, a knot without a position is
    inserted. Knots without a position are removed at the ends.
    """
    found: list[FloatArray] = []
    for part in sorted((part for part in parts if len(part)), key=lambda part: float(part[0, 0])):
        if found and np.linalg.norm(part[0, 1:] - found[-1][-1, 1:]) > SAME_MM:
            found.append(np.array([(part[0, 0], *NOWHERE)]))
        found.append(part)
    whole = np.concatenate([np.empty((0, 4)), *found])
    known = np.flatnonzero(np.isfinite(whole).all(axis=1))
    if len(known) < 2 or (np.diff(whole[:, 0]) < 0).any():
        return None
    return whole[known[0] : known[-1] + 1]
