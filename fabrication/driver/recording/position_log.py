"""The log of any stage: where its tip was, over time.

As a file: CSV with a heading, lines that start with # are remarks. Needed are a time and the three positions:

    time_s | time_ms     seconds (milliseconds) since 1970, or of any other clock with a known or found offset; also t_s
    time                 or ISO 8601 with its zone: 2026-05-04T14:03:07.250+02:00
    x_mm y_mm depth_mm   place in the cavity frame, depth positive into the pad (also _um, _m)

and as wanted `set` (name), `place` (whole number of the press within its set), `role` (train, test), `pattern` (grid,
random) and `ambient` (yes, no). A row with an empty `set` or `place` belongs to none: the stage travels.
"""

from __future__ import annotations

import csv
import datetime
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from design.errors import InputError
from fabrication.driver.recording.press_labels import PressLabels, SetEntry

FloatArray = NDArray[np.float64]

LENGTHS_MM = {"_mm": 1.0, "_um": 1e-3, "_m": 1e3}
CLOCKS_S = {"time_s": 1.0, "time_ms": 1e-3, "t_s": 1.0}
YES, NO = {"yes", "true", "1"}, {"no", "false", "0"}

LONGEST_GAP_S = 1.0
"""Between rows further apart than this the tip is known only where it did not move."""

STILL_MM = 0.02
"""Two rows closer than this are the same position."""

NOWHERE = -1


@dataclass(frozen=True, kw_only=True)
class PositionLog:
    """Positions over time.

    Attributes
    ----------
    file : where it is from
    time_s : (row,) rising [s]
    press_mm : (row, 3) x, y, depth [mm]
    set_number, place_number : (row,), -1 for none; None where the log does not say
    """

    file: str
    time_s: FloatArray
    press_mm: FloatArray
    set_number: NDArray[np.int64] | None = None
    place_number: NDArray[np.int64] | None = None
    sets: tuple[SetEntry, ...] = ()

    def labels_at(self, time_s: FloatArray) -> tuple[PressLabels, NDArray[np.bool_]]:
        """Labels at times of the log's own clock, linear between rows, and whether each is known.

        Unknown is what lies outside the log, in a gap in which the tip moved, or in a row that belongs to no set.
        """
        after = np.clip(np.searchsorted(self.time_s, time_s, side="right"), 1, len(self.time_s) - 1)
        gap_s = self.time_s[after] - self.time_s[after - 1]
        moved_mm = np.linalg.norm(self.press_mm[after] - self.press_mm[after - 1], axis=1)
        known = (time_s >= self.time_s[0]) & (time_s <= self.time_s[-1])
        known &= (gap_s <= LONGEST_GAP_S) | (moved_mm <= STILL_MM)
        press_mm = np.stack([np.interp(time_s, self.time_s, axis) for axis in self.press_mm.T], axis=1)
        row = np.where(time_s >= self.time_s[-1], len(self.time_s) - 1, after - 1)
        numbers = [None if column is None else column[row] for column in (self.set_number, self.place_number)]
        for column in numbers:
            known &= True if column is None else column != NOWHERE
        return (
            PressLabels(press_mm=press_mm, set_number=numbers[0], place_number=numbers[1], sets=self.sets),
            known,
        )

    def crossings_s(self) -> tuple[FloatArray, FloatArray]:
        """Times when the depth rises above 0, and when it is back at 0 or less [s]."""
        depth, touched = self.press_mm[:, 2], self.press_mm[:, 2] > 0
        at = np.flatnonzero(touched[1:] != touched[:-1])
        share = depth[at] / (depth[at] - depth[at + 1])
        time_s = self.time_s[at] + share * (self.time_s[at + 1] - self.time_s[at])
        return time_s[touched[at + 1]], time_s[~touched[at + 1]]


def read_position_log(file: Path) -> PositionLog:
    """A stage's log.

    Raises
    ------
    InputError : unreadable, columns missing, no number where one is needed, times that do not rise.
    """
    rows = _rows(file)
    columns = {name: [row[name] for row in rows] for name in rows[0]}
    time_s = _times(file, columns)
    press_mm = np.stack([_lengths(file, columns, axis) for axis in ("x", "y", "depth")], axis=1)
    falling = np.flatnonzero(np.diff(time_s) <= 0)
    if falling.size:
        k = int(falling[0])
        raise InputError(
            f"{file}: the times do not rise: row {k + 2} is {time_s[k + 1] - time_s[k]:+.3f} s after row {k + 1}; "
            "a clock that was set back, or two logs in one: cut the log there"
        )
    sets, set_number = _sets(file, columns)
    place_number = _places(file, columns)
    if set_number is not None and place_number is None:
        raise InputError(f"{file}: has set without place; number the presses of each set in a column place")
    if place_number is not None and set_number is None:
        sets, set_number = (SetEntry(name="measured"),), np.zeros(len(place_number), dtype=np.int64)
    return PositionLog(
        file=str(file),
        time_s=time_s,
        press_mm=press_mm,
        set_number=set_number,
        place_number=place_number,
        sets=sets,
    )


def _rows(file: Path) -> list[dict[str, str]]:
    try:
        lines = file.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as err:
        raise InputError(f"{file}: no text that can be read: {err}") from None
    rows = list(csv.reader(line for line in lines if line.strip() and not line.startswith("#")))
    if len(rows) < 3:
        raise InputError(f"{file}: needs a heading (time_s,x_mm,y_mm,depth_mm) and at least two rows")
    heading = [name.strip().lower() for name in rows[0]]
    doubled = sorted({name for name in heading if heading.count(name) > 1})
    if doubled:
        raise InputError(f"{file}: has the column {', '.join(doubled)} twice")
    for number, row in enumerate(rows[1:], start=1):
        if len(row) != len(heading):
            raise InputError(
                f"{file}: row {number} has {len(row)} values, the heading {len(heading)} columns"
            )
    return [dict(zip(heading, (value.strip() for value in row), strict=True)) for row in rows[1:]]


def _times(file: Path, columns: dict[str, list[str]]) -> FloatArray:
    for name, unit_s in CLOCKS_S.items():
        if name in columns:
            return unit_s * _numbers(file, name, columns[name], float)
    if "time" not in columns:
        raise InputError(
            f"{file}: has no time; needs a column time_s or time_ms, or time as ISO 8601; it has {', '.join(columns)}"
        )
    return _numbers(file, "time", columns["time"], _iso_s)


def _iso_s(text: str) -> float:
    moment = datetime.datetime.fromisoformat(text)
    if moment.tzinfo is None:
        raise ValueError("has no zone")
    return moment.timestamp()


def _lengths(file: Path, columns: dict[str, list[str]], axis: str) -> FloatArray:
    for suffix, unit_mm in LENGTHS_MM.items():
        if (name := axis + suffix) in columns:
            return unit_mm * _numbers(file, name, columns[name], float)
    raise InputError(f"{file}: has no {axis}_mm (or {axis}_um, {axis}_m); it has {', '.join(columns)}")


def _numbers(file: Path, name: str, texts: list[str], parsed: Callable[[str], float]) -> FloatArray:
    values = np.empty(len(texts))
    for k, text in enumerate(texts):
        try:
            values[k] = parsed(text)
        except ValueError:
            values[k] = np.nan
        if not np.isfinite(values[k]):
            wanted = (
                "ISO 8601 with its zone, as 2026-05-04T14:03:07.250Z"
                if parsed is _iso_s
                else "a finite number"
            )
            raise InputError(f"{file}: row {k + 1}: {name} is {text!r}, needs {wanted}; drop or mend the row")
    return values


def _sets(file: Path, columns: dict[str, list[str]]) -> tuple[tuple[SetEntry, ...], NDArray[np.int64] | None]:
    if "set" not in columns:
        return (), None
    names = columns["set"]
    entries: dict[str, SetEntry] = {}
    for k, name in enumerate(names):
        if name and name not in entries:
            entries[name] = set_entry(
                f"{file}: row {k + 1}", {key: column[k] for key, column in columns.items()}
            )
    if not entries:
        raise InputError(f"{file}: no row belongs to a set; fill the column set, or leave it out")
    order = list(entries)
    numbers = np.array([order.index(name) if name else NOWHERE for name in names], dtype=np.int64)
    return tuple(entries.values()), numbers


def set_entry(where: str, row: dict[str, str]) -> SetEntry:
    """The set that a row of a table says: `set`, and as given `role`, `pattern`, `ambient`."""
    ambient = (row.get("ambient") or "yes").lower()
    if ambient not in YES | NO:
        raise InputError(f"{where}: ambient is {ambient!r}, needs yes or no")
    return SetEntry(
        name=row["set"],
        role=row.get("role") or "train",
        pattern=row.get("pattern") or "measured",
        is_ambient=ambient in YES,
    )


def _places(file: Path, columns: dict[str, list[str]]) -> NDArray[np.int64] | None:
    if "place" not in columns:
        return None
    numbers = np.full(len(columns["place"]), NOWHERE, dtype=np.int64)
    for k, text in enumerate(columns["place"]):
        if text and not text.isdecimal():
            raise InputError(f"{file}: row {k + 1}: place is {text!r}, needs a whole number, or nothing")
        numbers[k] = int(text) if text else NOWHERE
    return numbers
