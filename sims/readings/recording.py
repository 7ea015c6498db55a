"""Read a recording of a built sensor under presses, from netCDF or CSV, without filtering.

netCDF (as written by the driver's recorder), dimensions ``time``, ``state``, ``receiver``:

    counts (time, state, receiver)   readings [ADC counts]
    press_depth (time)               depth of the press, positive into the pad, 0 or less untouched [mm]
    press_x, press_y (time)          location of the press in cavity coordinates [mm]; optional
    state, receiver                  names: the emitter that is lit (E1, ...) or ``off``; R1, ...
    attribute design_digest          SHA-256 of the design that was built

Lengths in other units are converted; their attribute `units` names the unit.

CSV: a heading line, then one line per reading. The columns are ``depth_mm``, optionally ``x_mm`` and ``y_mm`` (or with
``_um``, ``_cm`` or ``_m``, or as ``Depth (mm)``), and one column per pair (``E1-R1``) or one column ``signal``. Before
the heading there may be a line ``# design_digest: <digest>``, with at least the first 8 of the 64 digits,
and a line ``# losses: <text>`` that says what is missing.

The readings of an ``off`` state are subtracted. Drift and lag are not corrected.
"""

from __future__ import annotations

import re
from collections.abc import Container
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from optopad.design.arrays import FloatArray
from optopad.design.csv_table import CsvTable, plain_name, read_csv
from optopad.design.errors import InputError
from optopad.design.files import EMPTY, TEXT, kind_of_file
from optopad.design.netcdf_file import read_netcdf, require_numbers
from optopad.design.recordings import LOSSES, OFF, signals_of
from optopad.sims.readings.dataset import AXES, full_scale_of, losses_note, off_last, others_of
from optopad.sims.readings.label_checks import (
    HALF_COUNT,
    LENGTHS_MM,
    READINGS,
    in_unit,
    known_design,
    require_finite,
    require_no_fill_values,
    require_possible_readings,
    require_true_labels,
)
from optopad.sims.readings.press_data import left_out_note

if TYPE_CHECKING:
    import xarray as xr

    from optopad.design.spec import SensorDesign

SIGNAL = "signal"
DIGEST = re.compile(r"[0-9a-f]{8,64}")
PAIR_NAME = re.compile(r"^[A-Za-z0-9]+-[A-Za-z0-9]+$")
MAX_BYTES = 500_000_000
CSV_UNITS = ("mm", "um", "cm", "m")
NEEDED_CSV = f"CSV with depth_mm (or depth_um, depth_m) and a column a pair (as E1-R1), or one named {SIGNAL}"
NEEDED_FILE = f"a recording: netCDF (.nc), which `optopad driver export` makes, or {NEEDED_CSV}"


@dataclass(frozen=True, kw_only=True)
class Recording:
    """Readings of pairs against the depth of a press.

    Attributes
    ----------
    file : file of the readings
    design_digest : digest of the built design, or its first digits; None if the file has none
    depth_mm : (time,) depth of the press [mm]; 0 or less is no contact
    place_mm : (time, 2) x and y of the press in cavity coordinates [mm]; None if the file has none
    counts : (time,) readings of each pair by its name, all in the same unit; a single unnamed pair has the name
        `signal`
    notes : sentences on how readings were processed, and on information that the file lacks
    """

    file: Path
    design_digest: str | None
    depth_mm: FloatArray
    place_mm: FloatArray | None
    counts: dict[str, FloatArray]
    notes: tuple[str, ...]


def read_recording(file: Path, design: SensorDesign | None = None) -> Recording:
    """Read a recording from a netCDF or CSV file.

    Parameters
    ----------
    design : presumed design of the recording, used for the size of the pad

    Raises
    ------
    InputError : the file is missing or has another format, columns are missing, readings are not numbers, units are
        unknown, or presses contradict the pad or the signals.
    """
    found = _read_csv(file) if kind_of_file(file) in (TEXT, EMPTY) else _read_netcdf(file)
    places = {} if found.place_mm is None else {"x": found.place_mm[:, 0], "y": found.place_mm[:, 1]}
    require_finite({"depth": found.depth_mm, **found.counts, **places}, where=str(file), row="reading")
    signals = np.stack(list(found.counts.values()), axis=1)
    known = known_design(design, found.design_digest)
    try:
        require_no_fill_values({"depth": found.depth_mm, **found.counts, **places})
        require_true_labels(found.depth_mm, found.place_mm, signals, known, is_counts=False)
    except InputError as err:
        raise InputError(f"{file}: {err}") from None
    return found


def _read_netcdf(file: Path) -> Recording:
    dataset = read_netcdf(file, needed=NEEDED_FILE, most_bytes=MAX_BYTES, decode_times=False)
    missing = [
        name for name in ("counts", "press_depth", "state", "receiver") if name not in dataset.variables
    ]
    if missing:
        raise InputError(
            f"{file}: has no {', '.join(missing)}; a recording has counts (time, state, receiver), "
            "press_depth (time), and names of states and receivers"
        )
    has_place = _has_place(file, dataset.variables, "press_x", "press_y")
    require_numbers(dataset, file, ("counts",), AXES)
    lengths = ["press_depth", *(("press_x", "press_y") if has_place else ())]
    require_numbers(dataset, file, lengths, ("time",))
    try:
        is_more = np.asarray((others_of(dataset, file)[..., 2] > 0.0).any(axis=1))
    except InputError as err:
        raise InputError(f"{file}: {err}") from None
    dataset = dataset.isel(time=~is_more) if is_more.any() else dataset
    states, counts = off_last(dataset)
    names = [f"{state}-{receiver}" for state in states for receiver in dataset["receiver"].values]
    readings = counts.reshape(len(counts), -1)
    require_finite(dict(zip(names, readings.T, strict=True)), where=str(file), row="reading")
    try:
        press_mm = in_unit(dataset, lengths, LENGTHS_MM)
        require_possible_readings(readings, names, _full_scale(dataset, file), slack=HALF_COUNT)
    except InputError as err:
        raise InputError(f"{file}: {err}") from None
    has_off = states[-1:] == (OFF,)
    signals = signals_of(counts.astype(np.float64)) if has_off else counts.astype(np.float64)
    return Recording(
        file=file,
        design_digest=_checked_digest(file, dataset.attrs.get("design_digest")),
        depth_mm=press_mm[:, 0],
        place_mm=press_mm[:, 1:] if has_place else None,
        counts={
            f"{state}-{receiver}": signals[:, i, j]
            for i, state in enumerate(states)
            for j, receiver in enumerate(dataset["receiver"].values)
            if state != OFF
        },
        notes=(
            *(("readings of the off state were subtracted",) if has_off else ()),
            *filter(None, (losses_note(dataset), left_out_note(is_more, "one press is compared at a time"))),
        ),
    )


def _full_scale(dataset: xr.Dataset, file: Path) -> float | None:
    """Largest reading; None if it is unknown, or if the readings are no counts."""
    units = str(dataset["counts"].attrs.get("units") or "count").strip().lower()
    return full_scale_of(dataset, file) if {units, units.rstrip("s")}.intersection(READINGS) else None


def _read_csv(file: Path) -> Recording:
    table = read_csv(file, needed=NEEDED_CSV, most_bytes=MAX_BYTES)
    signals = [name for name in table.heading if name == SIGNAL or PAIR_NAME.match(name)]
    lengths = {axis: found for axis in ("depth", "x", "y") if (found := _length_mm(table, axis)) is not None}
    if "depth" not in lengths or not signals:
        raise InputError(f"{file}: its columns are {', '.join(table.heading)}; needs {NEEDED_CSV}")
    has_place = _has_place(file, [f"{axis}_mm" for axis in lengths], "x_mm", "y_mm")
    stated, losses = (
        next((m[1] for line in table.remarks if (m := re.search(rf"{name}:\s*(.*)", line))), None)
        for name in ("design_digest", LOSSES)
    )
    return Recording(
        file=file,
        design_digest=_checked_digest(file, stated),
        depth_mm=lengths["depth"],
        place_mm=np.stack([lengths["x"], lengths["y"]], axis=1) if has_place else None,
        counts={name: np.array(table.numbers(name)) for name in signals},
        notes=() if losses is None else (f"{file.name}: {losses}",),
    )


def _length_mm(table: CsvTable, axis: str) -> FloatArray | None:
    """Column (time,) of an axis, converted to mm from the unit in its name (``depth_um``); None if there is none.

    Raises
    ------
    InputError : the axis occurs twice, or a line lacks its number.
    """
    named = {f"{axis}_{unit}": LENGTHS_MM[unit] for unit in CSV_UNITS}
    has = [name for name in table.heading if plain_name(name) in named and not PAIR_NAME.match(name)]
    if len(has) > 1:
        raise InputError(f"{table.file}: has {' and '.join(has)}; keep one")
    return named[plain_name(has[0])] * np.array(table.numbers(has[0])) if has else None


def _checked_digest(file: Path, stated: object) -> str | None:
    """Check a stated design digest, or its first digits; return it in lower case, or None if none is stated."""
    if stated is None:
        return None
    digest = str(stated).strip().lower()
    if not DIGEST.fullmatch(digest):
        raise InputError(
            f"{file}: design_digest: {stated!r} is no digest of a design; needs its 64 hexadecimal digits, or the "
            "first 8 and more, as `optopad check` prints them with --json; or leave it out"
        )
    return digest


def _has_place(file: Path, names: Container[Any], x: str, y: str) -> bool:
    """Whether the file has both coordinates of the press; raises `InputError` if it has only one."""
    if (x in names) != (y in names):
        one, other = (x, y) if x in names else (y, x)
        raise InputError(f"{file}: has {one} without {other}; give both, or neither and --at X,Y")
    return x in names
