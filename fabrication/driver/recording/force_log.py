"""Reads the log of a load cell: the force on the tip over time.

The file is CSV with a heading; lines that start with # and a logger's greeting before the heading are skipped. It has a
time, as in a stage's log (`optopad.fabrication.driver.recording.position_log`), and one force, positive when the tip
presses the pad. The last word of its heading is the unit:

    force_n              newtons; also "Force (N)", F_N
    force_mn, _cn, _kn   millinewtons, centinewtons, kilonewtons
    force_gf, _kgf       gram-force, kilogram-force
    force_lbf, _ozf      pound-force, ounce-force

Amplifiers such as the HX711 give 5 to 80 samples a second at irregular times, and now and then a wrong one. Left out,
and counted in `ForceLog.notes`, are few samples of these kinds; a log with many of them is refused:

    no number    the cell of the force is empty, nan, inf or the mark of a gap
    spike        a sample far from the samples on both sides, which agree with each other
    impossible   a sample far outside the range of all others, smoothed by the median of five
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from optopad.design.arrays import FloatArray, IntArray
from optopad.design.csv_table import CsvTable, is_number
from optopad.design.errors import InputError
from optopad.fabrication.driver.recording.position_log import log_table, require_rising, times_of

GRAVITY = 9.80665
"""Standard gravity [m/s²]."""
POUND_KG, OUNCE_KG = 0.45359237, 0.028349523125
MASSES_KG = {"g": 1e-3, "kg": 1.0, "mg": 1e-6, "lb": POUND_KG, "oz": OUNCE_KG}
"""Units of mass, for the way out of a log in these units."""
FORCES_N = {"n": 1.0, "mn": 1e-3, "cn": 1e-2, "kn": 1e3, "un": 1e-6} | {
    f"{unit}f": GRAVITY * MASSES_KG[unit] for unit in ("g", "kg", "lb", "oz")
}
"""Newtons of each unit, by the last word of a column's name."""
NEEDED = (
    "a CSV table with time_s (or time_ms, time_us, time_ns, or time as ISO 8601) and force_n (or force_mn)"
)
NO_NUMBERS = {"", "na", "n/a", "null", "none"}
LARGEST = 1e12
"""A force of this size or more, in the log's unit, marks a gap, as 9.97e36 does."""

NOISE_SIGMAS = 10.0
"""Standard deviations of the noise that a spike exceeds."""
SPIKE_SPANS = 6.0
"""A spike differs from the two samples on each side by more than this multiple of their span."""
SPIKE_SHARE = 0.02
"""A spike is larger than this share of the range of the smoothed force [-]."""
IMPOSSIBLE_RANGES = 4.0
"""An impossible force is above the range of the smoothed force by this multiple of it."""
MOST_LEFT_OUT = 0.01
"""Largest share of samples that are left out [-]; three samples always are."""
LEAST_SAMPLES = 8
"""Least number of samples of a log, without those that are left out."""


@dataclass(frozen=True, kw_only=True)
class ForceLog:
    """Force on the tip over time.

    Attributes
    ----------
    file : name of the log file
    time_s : times in increasing order by the log's clock, shape (n,) [s]
    force_n : force, shape (n,) [N]
    notes : sentences on samples that were left out, and on conversion from another unit
    left_out : number of table rows that were left out
    """

    file: str
    time_s: FloatArray
    force_n: FloatArray
    notes: tuple[str, ...] = ()
    left_out: int = 0


def read_force_log(file: Path) -> ForceLog:
    """Read a load cell's log.

    Raises
    ------
    InputError : the file cannot be read, a column or number is missing, the force has another unit or none, the times
        do not increase, many samples are no numbers or spikes, or fewer than 8 others are left.
    """
    table, doubled = log_table(file, NEEDED)
    name, unit_n = _force_column(table)
    rows = len(table.rows)
    missing = [k for k, text in enumerate(table.column(name)) if _is_no_number(text)]
    _require_few(table, missing, f"{name} is no number", "is the cell connected?")
    _require_samples(table, len(table.rows) - len(missing))
    kept = table.without(missing)
    time_s = times_of(kept, NEEDED)
    require_rising(kept, time_s)
    force_n = unit_n * np.array(kept.numbers(name))
    spikes = _spikes(force_n)
    rate = f"at {1.0 / np.median(np.diff(time_s)):.3g} samples per second"
    _require_few(
        kept, spikes, f"{name} is a spike {rate}", "is a wire loose, or are presses shorter than two samples?"
    )
    _require_samples(table, len(kept.rows) - len(spikes))
    notes = [
        None if unit_n == 1.0 else f"{name} was multiplied by {unit_n:g}, to newtons",
        _note(doubled, "are equal to the row before"),
        _note([table.lines[k] for k in missing], f"have no number in {name}"),
        _note([kept.lines[k] for k in spikes], f"are spikes in {name}, {rate}"),
    ]
    return ForceLog(
        file=str(file),
        time_s=np.delete(time_s, spikes),
        force_n=np.delete(force_n, spikes),
        notes=tuple(f"{file.name}: {note}" for note in notes if note is not None),
        left_out=len(doubled) + rows - len(kept.rows) + len(spikes),
    )


def _force_column(table: CsvTable) -> tuple[str, float]:
    """Name of the column with the force, and newtons of its unit."""
    units = {name: name.rpartition("_")[2] for name in table.heading}
    found = [name for name, unit in units.items() if unit in FORCES_N and (name != unit or len(units) == 2)]
    named = [f"force_{unit}" for unit in FORCES_N if f"force_{unit}" in found]
    if named or len(found) == 1:
        name = (named or found)[0]
        return name, FORCES_N[units[name]]
    if found:
        raise InputError(f"{table.file}: has {', '.join(found)}; name the one along the depth force_n")
    for name, unit in units.items():
        if unit in MASSES_KG:
            raise InputError(
                f"{table.file}: {name} is a mass, needs a force; multiply by {GRAVITY * MASSES_KG[unit]:.6g} and name "
                f"the column force_n{f', or name it force_{unit}f' if f'{unit}f' in FORCES_N else ''}"
            )
    raise InputError(
        f"{table.file}: has no force_n (or force_mn); it has {', '.join(table.heading)}; name the force by its unit: "
        "force_n, or force_gf for grams of a scale (also _kgf, _lbf, _ozf)"
    )


def _is_no_number(text: str) -> bool:
    return text.lower() in NO_NUMBERS or (is_number(text) and not abs(float(text)) < LARGEST)


def _require_few(table: CsvTable, rows: list[int], what: str, question: str) -> None:
    most = max(3, int(MOST_LEFT_OUT * len(table.rows)))
    if len(rows) > most:
        shown = ",".join(table.rows[rows[0]])
        raise InputError(
            f"{table.file}: {what} in {len(rows)} of {len(table.rows)} rows, first in row {table.lines[rows[0]]} "
            f"({shown}), needs {most} at most; {question} Record again, or drop these rows"
        )


def _require_samples(table: CsvTable, count: int) -> None:
    if count < LEAST_SAMPLES:
        raise InputError(
            f"{table.file}: has {count} forces in {len(table.rows)} rows, needs {LEAST_SAMPLES} at least; record the "
            "force during the whole recording"
        )


def _note(lines: list[int] | tuple[int, ...], what: str) -> str | None:
    if not lines:
        return None
    counted = f"row {lines[0]}" if len(lines) == 1 else f"{len(lines)} rows, first row {lines[0]},"
    return f"left out {counted} that {what}"


def _spikes(force_n: FloatArray) -> list[int]:
    """Samples that are single spikes or impossible, see the module docstring."""
    near = np.lib.stride_tricks.sliding_window_view(np.pad(force_n, 2, mode="reflect"), 5)
    smooth = np.median(near, axis=1)
    low, high = float(smooth.min()), float(smooth.max())
    noise = NOISE_SIGMAS * _noise(force_n)
    least = max(noise, SPIKE_SHARE * (high - low))
    sides = near[:, [0, 1, 3, 4]]
    off = np.abs(force_n - np.median(sides, axis=1))
    is_spike = off > np.maximum(SPIKE_SPANS * np.ptp(sides, axis=1), least)
    is_impossible = (force_n > high + max(IMPOSSIBLE_RANGES * (high - low), noise)) | (force_n < low - least)
    found: IntArray = np.flatnonzero((is_spike | is_impossible) & (high > low))
    return [int(k) for k in found]


def _noise(values: FloatArray) -> float:
    """Standard deviation of white noise, from the median size of second differences."""
    second = values[2:] - 2.0 * values[1:-1] + values[:-2]
    return 1.4826 * float(np.median(np.abs(second))) / math.sqrt(6.0) if len(second) else 0.0
