"""Reads the log of any stage: the positions of its tip over time.

The file is CSV with a heading; lines that start with # are comments. Required are a time and the three coordinates:

    time_s               seconds since 1970, or of any other clock with a known or found offset (also _ms, _us, _ns, and
                         t or elapsed for time, "Time (ms)", millis, micros); a 32-bit counter may wrap around
    time                 instead of time_s: ISO 8601 with time zone, 2026-05-04T14:03:07.250+02:00 (also timestamp)
    x_mm y_mm depth_mm   location in the cavity's coordinate system, depth positive into the pad (also _um, _cm, _m, and
                         "X (mm)")

A second tip has the columns x2_mm, y2_mm, depth2_mm, in any of these units; rows without it leave all three empty.

Optional columns are `set` (name), `place` (number of the press within its set), `role` (train, test), `pattern`
(grid, random) and `ambient` (yes, no). A table row with an empty `set` or `place` belongs to no press, because the
stage is moving between presses.
"""

from __future__ import annotations

import datetime
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from optopad.design.arrays import BoolArray, FloatArray, IntArray
from optopad.design.csv_table import CsvTable, is_number, read_csv
from optopad.design.errors import InputError, shown
from optopad.design.recordings import UNNAMED, SetEntry
from optopad.fabrication.driver.recording.recorded import PressLabels

LENGTHS_MM = {"_mm": 1.0, "_um": 1e-3, "_cm": 10.0, "_m": 1e3}
TICKS_S = {"_s": 1.0, "_ms": 1e-3, "_us": 1e-6, "_ns": 1e-9}
CLOCKS_S = {name + unit: tick for name in ("time", "t") for unit, tick in TICKS_S.items()}
CLOCK_WORDS = {"time", "t", "timestamp", "stamp", "elapsed", "clock", "uptime"}
"""A column whose name has one of these words and ends in a unit of time is a time; so is a unit alone, as millis."""
MOMENTS = ("time", "timestamp")
"""Permitted names of a column with ISO 8601 times."""
FRACTION = re.compile(r"(?<=:\d\d)[.,](\d+)")
"""Fraction of a second in an ISO 8601 time."""
LAST_S = 4.1e9
"""Latest accepted time, about the end of the year 2099 [s since 1970]; a later one indicates a wrong unit."""
COUNTER_TICKS = 2.0**32
LONGEST_PAUSE_S = 60.0
"""Longest interval between two table rows in which a counter wraps [s]; a longer one is a reset of the logger."""
YES, NO = {"yes", "true", "1"}, {"no", "false", "0"}

LONGEST_GAP_S = 1.0
"""Longest interval between two table rows over which a moving tip's position is interpolated [s]."""

STILL_MM = 0.02
"""Largest distance between the positions in successive table rows for which the tip counts as not moving [mm]."""

FARTHEST_MM, FASTEST_MM_S = 1e5, 1e4
"""Largest coordinate [mm] and speed [mm/s] of a tip; larger ones are wrong values, or marks of a gap as -999."""
LEAST_JUMP_MM = 100.0
"""Speeds are checked for moves longer than this [mm], because rows may arrive in bursts."""

NOWHERE = -1
NEEDED = (
    "a CSV table with time_s (or time_ms, time_us, time_ns, or time as ISO 8601), x_mm, y_mm and depth_mm"
)


@dataclass(frozen=True, kw_only=True)
class PositionLog:
    """Positions of a stage's tip at n times, as read from its log.

    Attributes
    ----------
    file : name of the log file
    time_s : times in increasing order, shape (n,) [s]
    press_mm : positions (x, y, depth) in the cavity's coordinate system, shape (n, 3) [mm]
    set_number : for each position, the index of its set in `sets`, or -1 without a set; None if the log has no sets
    place_number : for each position, the number of its press within the set, or -1 without a press; None if the log has
        no such column
    sets : the sets of presses
    others_mm : positions of a second tip, shape (n, 1, 3), NaN where it is unknown [mm]; None if the log has none
    """

    file: str
    time_s: FloatArray
    press_mm: FloatArray
    set_number: IntArray | None = None
    place_number: IntArray | None = None
    sets: tuple[SetEntry, ...] = ()
    others_mm: FloatArray | None = None

    @property
    def tips_mm(self) -> FloatArray:
        """Positions of all tips, shape (n, tip, 3) [mm]."""
        first = self.press_mm[:, np.newaxis]
        return first if self.others_mm is None else np.concatenate([first, self.others_mm], axis=1)

    def labels_at(self, time_s: FloatArray) -> tuple[PressLabels, BoolArray]:
        """Positions and sets at given times of the log's clock [s], and for each time whether the position is known.

        Positions are interpolated linearly. They are unknown outside the log, in a long gap during which a tip moved,
        where the log begins or ends to have a second tip, and at times that belong to no press.
        """
        after = np.clip(np.searchsorted(self.time_s, time_s, side="right"), 1, len(self.time_s) - 1)
        gap_s = self.time_s[after] - self.time_s[after - 1]
        tips = self.tips_mm
        moved_mm = np.nanmax(np.linalg.norm(tips[after] - tips[after - 1], axis=2), axis=1)
        known = (time_s >= self.time_s[0]) & (time_s <= self.time_s[-1])
        known &= (gap_s <= LONGEST_GAP_S) | (moved_mm <= STILL_MM)
        known &= (np.isnan(tips[after]) == np.isnan(tips[after - 1])).all(axis=(1, 2))
        axes = tips.reshape(len(tips), -1).T
        at_mm = np.stack([np.interp(time_s, self.time_s, axis) for axis in axes], axis=1).reshape(
            -1, *tips.shape[1:]
        )
        row = np.where(time_s >= self.time_s[-1], len(self.time_s) - 1, after - 1)
        numbers = [None if column is None else column[row] for column in (self.set_number, self.place_number)]
        for column in numbers:
            known &= True if column is None else column != NOWHERE
        return (
            PressLabels(
                press_mm=at_mm[:, 0],
                set_number=numbers[0],
                place_number=numbers[1],
                sets=self.sets,
                others_mm=at_mm[:, 1:],
            ),
            known,
        )

    def crossings_s(self) -> tuple[FloatArray, FloatArray]:
        """Times at which the deeper tip's depth rises above 0, and at which it falls to 0 or less [s]."""
        depth = np.nanmax(self.tips_mm[..., 2], axis=1)
        touched = depth > 0
        at = np.flatnonzero(touched[1:] != touched[:-1])
        share = depth[at] / (depth[at] - depth[at + 1])
        time_s = self.time_s[at] + share * (self.time_s[at + 1] - self.time_s[at])
        return time_s[touched[at + 1]], time_s[~touched[at + 1]]


def read_position_log(file: Path) -> PositionLog:
    """Read a stage's log.

    Raises
    ------
    InputError : the file cannot be read, a column or number is missing, or the times do not increase.
    """
    table, _ = log_table(file, NEEDED)
    time_s = times_of(table)
    press_mm = np.stack([_lengths(table, axis) for axis in ("x", "y", "depth")], axis=1)
    require_rising(table, time_s)
    others_mm = _others(table)
    for tip in [press_mm] if others_mm is None else [press_mm, others_mm[:, 0]]:
        _require_possible(table, time_s, tip)
    _require_close(table, time_s, press_mm)
    sets, set_number = _sets(table)
    place_number = _places(table)
    if set_number is not None and place_number is None:
        raise InputError(
            f"{file}: has a column 'set' without a column 'place'; number the presses of each set in a column 'place'"
        )
    if place_number is not None and set_number is None:
        sets, set_number = (UNNAMED,), np.zeros(len(place_number), dtype=np.int64)
    return PositionLog(
        file=str(file),
        time_s=time_s,
        press_mm=press_mm,
        set_number=set_number,
        place_number=place_number,
        sets=sets,
        others_mm=others_mm,
    )


def log_table(file: Path, needed: str) -> tuple[CsvTable, tuple[int, ...]]:
    """The table of a log without rows that are equal to the row before them, and the line numbers of those rows.

    If all rows are equal, none is left out. Raises InputError if the file is no such table.
    """
    whole = read_csv(file, needed=needed, fewest_rows=2, lower=True)
    table, doubled = whole.without_doubles()
    return (whole, ()) if len(table.rows) < 2 else (table, doubled)


def times_of(table: CsvTable, needed: str = NEEDED) -> FloatArray:
    """Times of a log's rows [s], from the first column that states one; raises InputError."""
    if (name := _clock_of(table)) is not None:
        tick_s = TICKS_S[f"_{name.rpartition('_')[2]}"]
        ticks = np.array(table.numbers(name))
        if np.abs(ticks).max() < COUNTER_TICKS:
            ticks[1:] += COUNTER_TICKS * np.cumsum(_wraps(np.diff(ticks), tick_s))
        _require_unit(table, name, tick_s * np.abs(ticks).max(), tick_s)
        return tick_s * ticks
    moments = [name for name in MOMENTS if name in table.heading]
    if not moments:
        raise InputError(f"{table.file}: has no time; needs {needed}; it has {', '.join(table.heading)}")
    if is_number(first := table.column(moments[0])[0]):
        unit = next((unit for unit, tick_s in TICKS_S.items() if abs(float(first)) * tick_s < LAST_S), "_s")
        raise InputError(
            f"{table.file}: {moments[0]} is {first}, a number without a unit; name the column by it, as time{unit} (or "
            f"{', '.join('time' + other for other in TICKS_S if other != unit)})"
        )
    return np.array(table.parsed(moments[0], _iso_s, "ISO 8601 with its zone, as 2026-05-04T14:03:07.250Z"))


def _clock_of(table: CsvTable) -> str | None:
    """The column whose name states a time and its unit; None if there is none."""
    usual = [name for name in CLOCKS_S if name in table.heading]
    if usual:
        return usual[0]
    units = [name for name in table.heading if f"_{name.rpartition('_')[2]}" in TICKS_S]
    found = [name for name in units if "_" not in name or CLOCK_WORDS.intersection(name.split("_")[:-1])]
    if len(found) > 1:
        raise InputError(f"{table.file}: has the times {', '.join(found)}; name the one of its clock time_s")
    return found[0] if found else None


def _wraps(steps: FloatArray, tick_s: float) -> BoolArray:
    """Whether a 32-bit counter wrapped around in each step between rows, shape (n,) [ticks]."""
    return (steps < 0.0) & ((steps + COUNTER_TICKS) * tick_s < LONGEST_PAUSE_S)


def _require_unit(table: CsvTable, name: str, latest_s: float, tick_s: float) -> None:
    if latest_s > LAST_S:
        fitting = [unit for unit, tick in TICKS_S.items() if latest_s / tick_s * tick < LAST_S]
        way_out = (
            f"are they of {name.partition('_')[0]}{fitting[0]}? name the column so"
            if fitting
            else "correct them"
        )
        raise InputError(
            f"{table.file}: {name} reaches {latest_s / tick_s:.4g}, which is later than the year 2100; {way_out}"
        )


def require_rising(table: CsvTable, time_s: FloatArray) -> None:
    """Raise InputError unless each row of a log is later than the row before it."""
    not_rising = np.flatnonzero(np.diff(time_s) <= 0)
    if not not_rising.size:
        return
    k = int(not_rising[0])
    former, row = table.lines[k], table.lines[k + 1]
    if time_s[k + 1] == time_s[k]:
        raise InputError(
            f"{table.file}: row {row} has the time of row {former} ({not_rising.size} of {len(time_s)} rows are not "
            "later than the one before); write the times with more digits, or drop rows"
        )
    raise InputError(
        f"{table.file}: the times do not rise: row {row} is {time_s[k + 1] - time_s[k]:+.3f} s after row "
        f"{former}; the clock was set back, or the file holds two logs: cut the log there"
    )


def _require_possible(table: CsvTable, time_s: FloatArray, press_mm: FloatArray) -> None:
    """Raise InputError where a position is out of any stage's reach, or cannot be reached in time from the last one."""
    far = np.flatnonzero((np.abs(press_mm) > FARTHEST_MM).any(axis=1))
    if not far.size:
        moved_mm = np.linalg.norm(np.diff(press_mm, axis=0), axis=1)
        far = 1 + np.flatnonzero((moved_mm > LEAST_JUMP_MM) & (moved_mm > FASTEST_MM_S * np.diff(time_s)))
    if far.size:
        x, y, depth = press_mm[far[0]]
        raise InputError(
            f"{table.where(int(far[0]))}: the tip is at x {x:g}, y {y:g}, depth {depth:g} mm, which no stage reaches "
            "from the row before; is it the mark of a gap, or are the times in another unit? Drop such rows"
        )


def _require_close(table: CsvTable, time_s: FloatArray, press_mm: FloatArray) -> None:
    step_s, moved_mm = np.diff(time_s), np.linalg.norm(np.diff(press_mm, axis=0), axis=1)
    if ((step_s > LONGEST_GAP_S) & (moved_mm > STILL_MM)).all():
        raise InputError(
            f"{table.file}: the tip moves between all rows, and they are {step_s.min():g} s apart or more, needs "
            f"{LONGEST_GAP_S:g} s or less; are the times milliseconds? name their column time_ms"
        )


def _iso_s(text: str) -> float:
    # Python 3.10 reads no Z, and a fraction only of three or six digits
    plain = FRACTION.sub(lambda found: f".{found[1]:0<6.6}", text)
    moment = datetime.datetime.fromisoformat(plain[:-1] + "+00:00" if plain.endswith("Z") else plain)
    if moment.tzinfo is None:
        raise ValueError("has no zone")
    return moment.timestamp()


def _lengths(table: CsvTable, axis: str) -> FloatArray:
    if (name := _length_column(table, axis)) is None:
        raise InputError(
            f"{table.file}: has no {axis}_mm (or {axis}_um, {axis}_cm, {axis}_m); it has {', '.join(table.heading)}"
        )
    return LENGTHS_MM[name.removeprefix(axis)] * np.array(table.numbers(name))


def _length_column(table: CsvTable, axis: str) -> str | None:
    """The column of an axis, with its unit; None if there is none."""
    return next((axis + unit for unit in LENGTHS_MM if axis + unit in table.heading), None)


def _others(table: CsvTable) -> FloatArray | None:
    """Positions of the second tip (n, 1, 3), NaN in rows without it; None if the log has none."""
    first, second, third = (
        [_length_column(table, f"{axis}{number}") for axis in ("x", "y", "depth")] for number in ("", 2, 3)
    )
    if any(third):
        raise InputError(
            f"{table.file}: has {', '.join(filter(None, third))}; a log has the positions of one tip or of two: leave "
            "the third out"
        )
    has = [name for name in second if name is not None]
    if not has:
        return None
    if len(has) < len(first):
        raise InputError(
            f"{table.file}: has {', '.join(has)} alone; a second tip has x2_mm, y2_mm and depth2_mm: add the others"
        )
    without = [k for k, row in enumerate(table.records()) if not any(row[name] for name in has)]
    if len(without) == len(table.rows):
        return None
    found = np.full((len(table.rows), 1, 3), np.nan)
    rows = table.without(without)
    found[np.setdiff1d(np.arange(len(found)), without), 0] = np.stack(
        [_lengths(rows, axis) for axis in ("x2", "y2", "depth2")], axis=1
    )
    return found


def _sets(table: CsvTable) -> tuple[tuple[SetEntry, ...], IntArray | None]:
    if "set" not in table.heading:
        return (), None
    names = table.column("set")
    entries: dict[str, SetEntry] = {}
    for k, row in enumerate(table.records()):
        if row["set"] and row["set"] not in entries:
            entries[row["set"]] = set_entry(table.where(k), row)
    if not entries:
        raise InputError(f"{table.file}: no row belongs to a set; fill the column 'set', or leave it out")
    order = list(entries)
    numbers = np.array([order.index(name) if name else NOWHERE for name in names], dtype=np.int64)
    return tuple(entries.values()), numbers


def set_entry(where: str, row: dict[str, str]) -> SetEntry:
    """The set of presses that a table row describes in its column `set` and, if present, `role`, `pattern`, `ambient`.

    `where` names the file and table row in error messages.
    """
    ambient = (row.get("ambient") or "yes").lower()
    if ambient not in YES | NO:
        raise InputError(f"{where}: ambient is {ambient!r}, needs yes or no")
    return SetEntry(
        name=row["set"],
        role=row.get("role") or "train",
        pattern=row.get("pattern") or "unknown",
        is_ambient=ambient in YES,
    )


def _places(table: CsvTable) -> IntArray | None:
    if "place" not in table.heading:
        return None
    texts = table.column("place")
    return np.array(
        [whole_place(table.where(k), text) if text else NOWHERE for k, text in enumerate(texts)],
        dtype=np.int64,
    )


def whole_place(where: str, text: str) -> int:
    """Parse the number of a press; spreadsheets may write 3 as 3.0.

    Raises
    ------
    InputError : the text is not a whole number, 0 or greater.
    """
    if not is_number(text) or not 0 <= float(text) < 2**53 or float(text) % 1:
        raise InputError(f"{where}: 'place' is {shown(text)}, needs a whole number from 0")
    return int(float(text))
