"""Read data sets from netCDF files. Simulated and built sensors have the same format (docs/reference/files.md).

Dimensions ``time`` (one frame), ``state``, ``receiver``:

    counts (time, state, receiver)        readings; the states are emitters' names and ``off`` [ADC counts]
    press_x, press_y, press_depth (time)  position of the tip as the stage reports it [mm]
    time_s, set, place (time)             time within the set [s], number of the set, number of the press in the set
    true_x, true_y, true_depth (time)     true position of the tip; simulated sets only [mm]
    others (time, other, axis)            x, y, depth of further tips, NaN where there is none; may be absent [mm]
    attributes                            design_digest, full_scale_counts, sets and attributes as JSON

A variable's attribute `units` gives its unit; without it, the units above apply. Lengths and times are converted. Volts
are converted to counts with the data of a design's analogue-to-digital converter.

Files of `optopad driver record` and `export` have no numbers of sets and presses. They are read as one set named
``unnamed``. In these files a new press starts where the depth rises above 0 after the tip has left the pad, or where
the location changes during contact.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from optopad.design.arrays import FloatArray, IntArray
from optopad.design.errors import InputError
from optopad.design.netcdf_file import read_netcdf, require_numbers
from optopad.design.recordings import LOSSES, OFF, UNNAMED, SetEntry
from optopad.sims.press import SAME_PLACE_MM
from optopad.sims.readings.data_writer import AXIS_NAMES, DIMENSIONS, DataWriter, header_of, save_data
from optopad.sims.readings.label_checks import (
    HALF_COUNT,
    LENGTHS_MM,
    READING_SLACK,
    TIMES_S,
    counts_factor,
    in_unit,
    known_design,
    require_no_fill_values,
    require_possible_readings,
    require_true_labels,
    require_true_others,
    unit_factor,
)
from optopad.sims.readings.press_data import CONVERTED, PressData, clipped_note, data_notes, joined

if TYPE_CHECKING:
    import xarray as xr

    from optopad.design.spec import SensorDesign

__all__ = [
    "DataWriter",
    "PressData",
    "SetEntry",
    "clipped_note",
    "data_notes",
    "header_of",
    "joined",
    "read_data",
    "require_design",
    "save_data",
]

MAX_BYTES = 4_000_000_000
RETREAT_MM = 0.1
"""Height above the pad from which the tip counts as having left it [mm]; smaller heights are jitter of the stage."""
NEEDED_FILE = (
    "a data set in netCDF (.nc): `optopad driver export` makes one of a recording with its presses (--stage), "
    "`optopad simulate --protocol` one of a design"
)
MOST_NUMBER = 2**31 - 2
"""Largest accepted number of a press; the next one marks a gap."""
AXES, OTHERS, OBJECT = DIMENSIONS["counts"], "others", "object"
NEEDED = ("counts", "press_x", "press_y", "press_depth", "state", "receiver")
TRUE_PRESS = ("true_x", "true_y", "true_depth")
TIMES = ("time_s", "device_time", "host_time")


def read_data(file: Path, design: SensorDesign | None = None) -> PressData:
    """Read a data set, or a recording of the driver, from a netCDF file.

    Parameters
    ----------
    design : presumed design of the data, used for the size of the pad and to convert volts. Whether the data are of
        this design is checked by `require_design`, not here

    Raises
    ------
    InputError : the file is missing or has another format, variables or states are missing, readings are not numbers,
        units are unknown, or presses contradict the pad or the signals.
    """
    found = read_netcdf(file, needed=NEEDED_FILE, most_bytes=MAX_BYTES, decode_times=False)
    _require_parts(found, file)
    try:
        return _data_of(found, file, design)
    except InputError as err:
        raise InputError(f"{file}: {err}") from None


def require_design(data: PressData, design: SensorDesign, *, what: str = "data") -> tuple[str, ...]:
    """Check that data are of a design. If they name no design, return a sentence that says so.

    Raises
    ------
    InputError : the design's digest, the emitters or the receivers differ.
    """
    from optopad.design.shape.cavity import cavity_of

    if data.design_digest is not None and data.design_digest != design.digest:
        raise InputError(
            f"{what}: of design {data.design_digest[:8]}, needs {design.digest[:8]} ({design.name}); give "
            "the design that was built, or record again"
        )
    cavity = cavity_of(design)
    for kind, had, needed in (
        ("states", data.state_names, (*(one.name for one in cavity.emitters), OFF)),
        ("receivers", data.receiver_names, tuple(one.name for one in cavity.receivers)),
    ):
        if had != needed:
            missing = [name for name in needed if name not in had]
            said = f"lacks {', '.join(missing)}" if missing else f"has {', '.join(had)}"
            raise InputError(f"{what}: of its {kind} it {said}; {design.name} has {', '.join(needed)}")
    if data.design_digest is None:
        return (f"{what} names no design; it is taken as data of {design.name}",)
    return ()


def _require_parts(found: xr.Dataset, file: Path) -> None:
    missing = [name for name in NEEDED if name not in found.variables]
    if missing:
        raise InputError(
            f"{file}: has no {', '.join(missing)}; a data set has counts (time, state, receiver), press_x, press_y and "
            "press_depth (time), and names of states and receivers; where presses are missing, join a stage's log first"
        )
    require_numbers(found, file, ("counts",), AXES)
    by_time = (*NEEDED[1:4], "set", "place", *TIMES, *TRUE_PRESS)
    require_numbers(found, file, [name for name in by_time if name in found.variables], ("time",))


def _data_of(found: xr.Dataset, file: Path, design: SensorDesign | None) -> PressData:
    states, counts = off_last(found)
    digest = _digest(found, file)
    known = known_design(design, digest)
    counts_per_unit = counts_factor(found, known or design)
    receivers = tuple(str(name) for name in found["receiver"].values)
    full_scale = full_scale_of(found, file)
    _require_possible(counts, states, receivers, full_scale or _design_scale(known), counts_per_unit)
    require_no_fill_values({name: found[name].values for name in NEEDED[1:4]})
    counts = counts.astype(np.float32)
    press_mm = in_unit(found, list(NEEDED[1:4]), LENGTHS_MM)
    has_truth = all(name in found.variables for name in TRUE_PRESS)
    attributes = _json(found, "attributes", {}, file)
    named = next((name for name in TIMES if name in found.variables), None)
    time_s = np.arange(len(counts)) if named is None else in_unit(found, [named], TIMES_S)[:, 0]
    if named is None:
        attributes = attributes | {"time_s": "unknown; numbers of the samples"}
    if losses := losses_note(found):
        attributes = attributes | {LOSSES: losses}
    if counts_per_unit != 1.0:
        counts = counts * np.float32(counts_per_unit)
        attributes = attributes | {CONVERTED: f"the readings were volts, multiplied by {counts_per_unit:g}"}
    sets, set_number, place_number = _sets_of(found, press_mm, file)
    data = PressData(
        counts=counts,
        press_mm=press_mm,
        time_s=np.asarray(time_s, dtype=np.float64),
        set_number=set_number,
        place_number=place_number,
        sets=sets,
        state_names=states,
        receiver_names=receivers,
        full_scale_counts=full_scale,
        design_digest=digest,
        attributes=attributes,
        true_press_mm=in_unit(found, list(TRUE_PRESS), LENGTHS_MM) if has_truth else None,
        others_mm=others_of(found, file),
    )
    one = data.of_one_tip()
    require_true_labels(one.press_mm[:, 2], one.press_mm[:, :2], one.features(), known)
    # the radius of listed objects is their own, and was compared when they were pressed
    require_true_others(press_mm, data.others_mm, known, has_tips=OBJECT not in found.variables)
    return data


def others_of(found: xr.Dataset, file: Path) -> FloatArray:
    """Further tips (sample, k, 3) of a file [mm]; k is 0 if it has none.

    Raises
    ------
    InputError : the variable has other dimensions or units.
    """
    if OTHERS not in found.variables:
        return np.zeros((found.sizes["time"], 0, 3))
    require_numbers(found, file, (OTHERS,), DIMENSIONS[OTHERS])
    array = found[OTHERS].transpose(*DIMENSIONS[OTHERS])
    names = [str(name) for name in array["axis"].values] if "axis" in array.coords else list(AXIS_NAMES)
    if names != list(AXIS_NAMES) or array.shape[2] != len(AXIS_NAMES):
        raise InputError(
            f"{OTHERS}: its dimension axis is {', '.join(names)} ({array.shape[2]} values), needs x, y, depth"
        )
    values = array.values.astype(np.float64)
    for tip in range(values.shape[1]):
        columns = zip(AXIS_NAMES, values[:, tip].T, strict=True)
        require_no_fill_values({f"{OTHERS} {tip + 1}, {axis}": column for axis, column in columns})
    return values * unit_factor(array.attrs.get("units"), LENGTHS_MM, OTHERS)


def _require_possible(
    counts: NDArray[Any],
    states: tuple[str, ...],
    receivers: tuple[str, ...],
    full_scale: float | None,
    counts_per_unit: float,
) -> None:
    names = [f"{state}-{receiver}" for state in states for receiver in receivers]
    limit = None if full_scale is None else full_scale / counts_per_unit
    slack = HALF_COUNT if counts_per_unit == 1.0 else READING_SLACK * (limit or 0.0)
    require_possible_readings(counts.reshape(len(counts), -1), names, limit, slack=slack)


def _design_scale(design: SensorDesign | None) -> float | None:
    from optopad.design.circuit.circuit import Circuit

    return None if design is None else 2.0 ** Circuit.of(design).adc.bits - 1.0


def full_scale_of(found: xr.Dataset, file: Path) -> float | None:
    """Reading at which the converter clips [counts], by the attribute `full_scale_counts`; None without it.

    Raises
    ------
    InputError : the attribute is not a number above 0.
    """
    value = found.attrs.get("full_scale_counts")
    if value is None:
        return None
    try:
        scale = float(value)
    except (TypeError, ValueError):
        scale = np.nan
    if not (np.isfinite(scale) and scale > 0.0):
        raise InputError(f"{file}: attribute full_scale_counts is {value!r}, needs a number above 0 [counts]")
    return scale


def _digest(found: xr.Dataset, file: Path) -> str | None:
    value = found.attrs.get("design_digest")
    if value is not None and not isinstance(value, str):
        raise InputError(
            f"{file}: attribute design_digest is {value!r}, needs the 64 digits of a design's digest"
        )
    return None if value is None else value.strip()


def losses_note(found: xr.Dataset) -> str | None:
    """A sentence on what is missing of the recording from which a file was made; None if nothing is known to be."""
    told = found.attrs.get(LOSSES)
    return None if told is None else f"{found.attrs.get('source', 'the recording')}: {told}"


def off_last(found: xr.Dataset) -> tuple[tuple[str, ...], NDArray[Any]]:
    """Names of the states, and readings (time, state, receiver) of the file, with the off state moved to the end."""
    names = [str(name) for name in found["state"].values]
    counts = found["counts"].transpose(*AXES).values
    order = [k for k, name in enumerate(names) if name != OFF] + [
        k for k, name in enumerate(names) if name == OFF
    ]
    return tuple(names[k] for k in order), counts if order == sorted(order) else counts[:, order]


def _sets_of(
    found: xr.Dataset, press_mm: FloatArray, file: Path
) -> tuple[tuple[SetEntry, ...], IntArray, IntArray]:
    if "sets" not in found.attrs or "set" not in found.variables or "place" not in found.variables:
        return (UNNAMED,), np.zeros(len(press_mm), dtype=np.int64), _presses(np.nan_to_num(press_mm))
    sets = tuple(_set_of(row, file) for row in _json(found, "sets", [], file))
    return sets, _numbers(found, "set"), _numbers(found, "place")


def _numbers(found: xr.Dataset, name: str) -> IntArray:
    """Numbers (sample,) of sets or presses; raises `InputError` if one is no whole number from 0."""
    values = found[name].values
    bad = np.flatnonzero(~((values >= 0) & (values <= MOST_NUMBER) & (np.floor(values) == values)))
    if len(bad):
        raise InputError(
            f"{name}: {len(bad)} of {len(values)} values are no whole numbers from 0, the first is {values[bad[0]]:g} "
            f"at time index {bad[0]}; drop frames that belong to no press"
        )
    return np.asarray(values, dtype=np.int64)


def _set_of(row: Any, file: Path) -> SetEntry:
    try:
        return SetEntry(**row)
    except TypeError:
        raise InputError(f"{file}: attribute sets: {row!r} is no set") from None
    except InputError as err:
        raise InputError(f"{file}: attribute sets: {err}") from None


def _json(found: xr.Dataset, name: str, absent: Any, file: Path) -> Any:
    try:
        value = json.loads(found.attrs[name]) if name in found.attrs else absent
    except (TypeError, ValueError, RecursionError):
        raise InputError(f"{file}: attribute {name} is no JSON") from None
    if not isinstance(value, type(absent)):
        raise InputError(f"{file}: attribute {name} is {value!r}, needs a {type(absent).__name__}")
    return value


def _presses(press_mm: FloatArray) -> IntArray:
    """Number (sample,) of each sample's press; samples without contact belong to the nearer of two presses."""
    touched = np.flatnonzero(press_mm[:, 2] > 0.0)
    if not len(touched):
        return np.zeros(len(press_mm), dtype=np.int64)
    at = press_mm[touched, :2]
    lowest = np.minimum.reduceat(press_mm[:, 2], touched)[:-1]
    is_next = (np.hypot(*np.diff(at, axis=0).T) > SAME_PLACE_MM) | (lowest <= -RETREAT_MM)
    number = np.concatenate([[0], np.cumsum(is_next)])
    after = np.minimum(np.searchsorted(touched, np.arange(len(press_mm))), len(touched) - 1)
    before = np.maximum(after - 1, 0)
    to_next, to_last = (np.hypot(*(press_mm[:, :2] - at[near]).T) for near in (after, before))
    is_nearer = to_next <= to_last + SAME_PLACE_MM
    return np.asarray(number[np.where(is_nearer, after, before)], dtype=np.int64)
