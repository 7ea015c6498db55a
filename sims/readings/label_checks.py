"""Checks of units and press labels: stated units are converted, and presses that contradict the pad are refused.

Without these checks, data with wrong labels would train a model without any error message, and its errors would be as
large as the pad. Examples of wrong labels are locations measured from the middle of the pad, or a depth that is
positive upwards. The checks use the design if it is known, otherwise limits that hold for every design. They accept
noise, drift, samples of a hovering tip, and data with few samples in contact.

Readings that a converter cannot give are refused, too: those outside 0 to full scale and, where full scale is unknown,
numbers by which programs mark a gap, such as -999 or netCDF's 9.97e36.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from optopad.design.arrays import FloatArray
from optopad.design.errors import InputError, shown
from optopad.design.shape.outline import rectangle

if TYPE_CHECKING:
    import xarray as xr

    from optopad.design.spec import SensorDesign

LENGTHS_MM = {"mm": 1.0, "millimetre": 1.0, "millimeter": 1.0, "um": 1e-3, "micrometre": 1e-3, "micrometer": 1e-3,
              "micron": 1e-3, "cm": 10.0, "centimetre": 10.0, "centimeter": 10.0, "m": 1e3, "metre": 1e3,
              "meter": 1e3}  # fmt: skip
TIMES_S = {"s": 1.0, "sec": 1.0, "second": 1.0, "ms": 1e-3, "millisecond": 1e-3, "us": 1e-6, "microsecond": 1e-6,
           "ns": 1e-9, "nanosecond": 1e-9, "min": 60.0, "minute": 60.0, "h": 3600.0, "hour": 3600.0}  # fmt: skip
READINGS = {"count": 1.0, "1": 1.0, "adc": 1.0, "adc count": 1.0, "lsb": 1.0, "adu": 1.0, "digit": 1.0}
VOLTS = {"v": 1.0, "volt": 1.0, "mv": 1e-3, "millivolt": 1e-3}

SLACK_MM = 0.5
"""Allowed error of a stage [mm]: presses up to this far beyond the pad's outline or thickness are accepted."""
LARGEST_MM, THICKEST_MM = 200.0, 50.0
"""Largest length and largest thickness that a design's pad can have [mm]."""
METRES_MM = 0.012
"""If no depth or height in a file is larger than this [mm], the depths must be in metres."""
HIGHEST_V = 5.5
"""Largest input voltage of the boards' converters [V]."""
LEAST_CHANGE = 0.1
"""Least change of a pair's signal above the surface, as a share of the signal, that makes the sign of the depth suspect
[-]. Reflections from a hovering tip, drift and noise cause smaller changes.
"""
TIMES_MORE = 4.0
"""Least ratio of the signals' change above the surface to that below it, for a suspect sign of the depth [-]."""
FILL_VALUES = (-999.0, -9999.0, -99999.0, -(2.0**15) + 1, -(2.0**15), 2.0**15 - 1, 2.0**16 - 1, 2.0**23 - 1, -(2.0**23),
               -(2.0**31) + 1, -(2.0**31), 2.0**31 - 1, 2.0**32 - 1, -1e20, 1e20, 1e30, -1e30, 1e36,
               float(np.float32(9.969209968386869e36)), 9.969209968386869e36)  # fmt: skip
"""Numbers by which programs mark a gap: among them the default values of netCDF and all bits of integer types."""
LARGEST = 1e12
"""Larger numbers count as marks of a gap, too."""
SATURATED = (0.0, 2.0**32 - 1)
"""Range of the values of a channel whose readings are all at full scale, which may be unknown [counts]."""
FILL_SPANS = 0.5
"""Such a number is a gap if it is outside the range of all other values by more than this multiple of it."""
HALF_COUNT, READING_SLACK = 0.5, 0.005
"""How far readings may be below 0 or above full scale: counts [counts], and volts as a share of full scale [-]."""
NOISE_SIGMAS = 5.0
MOST_SAMPLES = 20_000
"""Largest number of samples that the test of the depth's sign uses."""


def unit_factor(units: object, known: Mapping[str, float], name: str) -> float:
    """Factor that converts values to the standard unit, from the value of the attribute `units`; 1 if it is absent.

    Raises
    ------
    InputError : the unit is unknown; the message names the variable and the known units.
    """
    if units is None or not str(units).strip():
        return 1.0
    text = str(units).strip().replace("\N{MICRO SIGN}", "u").replace("\N{GREEK SMALL LETTER MU}", "u")
    lower = text.lower().partition(" since ")[0]
    for word in (text, lower, lower[:-1] if len(lower) > 3 and lower.endswith("s") else lower):
        if word in known:
            return known[word]
    short = ", ".join(one for one in known if len(one) <= 5)
    raise InputError(f"{name}: the attribute units is {shown(text)}, needs one of {short}; convert {name}")


def in_unit(found: xr.Dataset, names: list[str], known: Mapping[str, float]) -> FloatArray:
    """Variables of a file as columns (time, name), converted to the standard unit by their attribute `units`.

    Raises
    ------
    InputError : a unit is unknown.
    """
    columns = [
        found[name].values.astype(np.float64) * unit_factor(found[name].attrs.get("units"), known, name)
        for name in names
    ]
    return np.stack(columns, axis=1)


def counts_factor(found: xr.Dataset, design: SensorDesign | None) -> float:
    """Factor from a file's readings to ADC counts: 1 for counts, or the counts per volt of the design's converter.

    Raises
    ------
    InputError : the unit is unknown, the readings are volts but no design is given, or they have no unit and cannot be
        counts.
    """
    array = found["counts"]
    units = array.attrs.get("units")
    factor = unit_factor(units, READINGS | VOLTS, "counts")
    if units is not None and str(units).strip().lower().rstrip("s") in VOLTS:
        if design is None:
            raise InputError(
                f"counts: the attribute units is {shown(units)}, needs ADC counts; volts are converted by the "
                "converter of the design: name the design, with --design on the command line"
            )
        return factor * _counts_per_volt(design)
    from optopad.design.circuit.circuit import Circuit

    highest = HIGHEST_V if design is None else Circuit.of(design).adc.full_scale_v
    if array.dtype.kind == "f" and array.size:
        low, high = float(array.min()), float(array.max())
        values = array.values.reshape(-1)[:: max(array.size // MOST_SAMPLES, 1)]
        if 0.0 < high <= highest and low >= -highest and (values != np.rint(values)).mean() > 0.5:
            raise InputError(
                f"counts: the readings are {low:.3g} to {high:.3g} and not whole, needs ADC counts; are they volts? "
                'then set the attribute units of counts to "V" and name the design'
            )
    return factor


def known_design(design: SensorDesign | None, digest: str | None) -> SensorDesign | None:
    """The design that data belong to, according to the digest in them; None if unknown.

    It is `design` if its digest agrees or the data have no digest, otherwise the preset with this digest.
    """
    from optopad.design.preset import PRESETS, preset

    if digest is None or (design is not None and design.digest.startswith(digest)):
        return design
    return next((one for one in map(preset, PRESETS) if one.digest.startswith(digest)), None)


def require_finite(named: Mapping[str, NDArray[Any] | None], *, where: str, row: str) -> None:
    """Check that values are finite, so that a gap in the data never counts as a signal.

    Parameters
    ----------
    named : values (sample, ...) by name; names whose values are None are skipped
    where, row : for the error message: name of the file, and what one entry of the first axis is called ("sample", ...)

    Raises
    ------
    InputError : a value is not finite; the message has its name, the number of such samples, and the first of them.
    """
    for name, values in named.items():
        if values is None or np.isfinite(values).all():
            continue
        bad = np.flatnonzero(~np.isfinite(values.reshape(len(values), -1)).all(axis=1))
        raise InputError(
            f"{where}: {name} is not a number in {len(bad)} of {len(values)} {row}s, first in {row} {bad[0] + 1}; "
            f"drop these {row}s"
        )


def require_whole_tips(others_mm: FloatArray) -> None:
    """Check that each further tip (sample, k, 3) has all of x, y, depth, or none.

    Raises
    ------
    InputError : the message has the number of other tips, and the first sample with one.
    """
    is_known = np.isfinite(others_mm)
    bad = np.argwhere(~(is_known.all(axis=2) | np.isnan(others_mm).all(axis=2)))
    if len(bad):
        sample, tip = bad[0]
        raise InputError(
            f"others: {len(bad)} tips have no finite x, y and depth, the first in sample {sample + 1}: "
            f"{', '.join(f'{value:g}' for value in others_mm[sample, tip])} mm; give all three, or NaN for all where "
            "there is no further tip"
        )


def require_possible_readings(
    readings: NDArray[Any], names: Sequence[str], full_scale: float | None, *, slack: float
) -> None:
    """Check that readings are 0 to full scale. If that is unknown, check that none is a number that marks a gap.

    Parameters
    ----------
    readings : (sample, channel) readings as a converter gives them; values that are not finite are not checked
    names : names of the channels
    full_scale : largest reading, in the unit of the readings; None if unknown
    slack : accepted excess at both ends, in the same unit

    Raises
    ------
    InputError : the message has the number of such readings, and value, time index and channel of the first.
    """
    if not readings.size:
        return
    if full_scale is None:
        require_no_fill_values(dict(zip(names, readings.T, strict=True)))
        return
    low, high = -slack, full_scale + slack
    if readings.min() >= low and readings.max() <= high:
        return
    bad = np.argwhere((readings < low) | (readings > high))
    if len(bad):
        sample, channel = bad[0]
        raise InputError(
            f"counts: {len(bad)} of {readings.size} readings are outside 0 to {full_scale:g}, the first is "
            f"{readings[sample, channel]:g} in {names[channel]} at time index {sample}; do they mark gaps? Drop these "
            "frames, and give readings as the converter made them, without any subtraction"
        )


def require_no_fill_values(named: Mapping[str, NDArray[Any]]) -> None:
    """Check that no value is a number that marks a gap (`FILL_VALUES`) and is far outside the range of the others.

    Parameters
    ----------
    named : values (sample,) by name

    Raises
    ------
    InputError : the message has the number of such values, and value, time index and name of the first.
    """
    for name, values in named.items():
        is_fill = np.isin(values, FILL_VALUES) | (np.abs(values, dtype=np.float64) > LARGEST)
        if not is_fill.any():
            continue
        others = values[~is_fill & np.isfinite(values)]
        low, high = (float(others.min()), float(others.max())) if len(others) else SATURATED
        reach = FILL_SPANS * (high - low) if len(others) else 0.0
        bad = np.flatnonzero(is_fill & ((values < low - reach) | (values > high + reach)))
        if len(bad):
            raise InputError(
                f"{name}: {len(bad)} of {len(values)} values are {values[bad[0]]:g} or such, the first at time index "
                f"{bad[0]}, the others {low:g} to {high:g}: they mark gaps; drop these frames"
            )


def require_true_labels(
    depth_mm: FloatArray,
    location_mm: FloatArray | None,
    signals: NDArray[Any],
    design: SensorDesign | None,
    *,
    is_counts: bool = True,
) -> None:
    """Check that press depths and locations do not contradict the pad or the signals.

    Parameters
    ----------
    depth_mm : (sample,) depth of the presses [mm]; 0 or less is no contact
    location_mm : (sample, 2) x and y of the presses in cavity coordinates [mm]; None if the data have none
    signals : (sample, pair) readings minus those of the off state, all in the same unit
    design : design of the data; if None, limits that hold for every design are used
    is_counts : whether the signals are ADC counts, so that the design's noise applies

    Raises
    ------
    InputError : depth is positive upwards or in another unit, or locations are outside the cavity.
    """
    if not len(depth_mm):
        return
    noise = design.noise.read_noise_counts if design is not None and is_counts else 0.0
    _require_depth_into_the_pad(depth_mm, signals, noise)
    _require_millimetres(depth_mm, design)
    if location_mm is not None:
        _require_in_the_cavity(location_mm[depth_mm > 0.0], design)


def require_true_others(
    press_mm: FloatArray, others_mm: FloatArray, design: SensorDesign | None, *, has_tips: bool = True
) -> None:
    """Check that tips which touch at the same time are in the pad and do not overlap.

    Parameters
    ----------
    press_mm, others_mm : (sample, 3), (sample, k, 3) x, y, depth of the first tip and of further ones [mm]
    design : design of the data; if None, limits that hold for every design are used
    has_tips : whether the pad is pressed by the design's tip, whose radius is then compared if it is a hemisphere

    Raises
    ------
    InputError : a tip is outside the cavity or in another unit, or two tips overlap.
    """
    tips = np.concatenate([press_mm[:, None], others_mm], axis=1)
    tips = tips[(others_mm[..., 2] > 0.0).any(axis=1)]
    touching = tips[tips[..., 2] > 0.0]
    if not len(tips):
        return
    _require_millimetres(touching[:, 2], design, "others")
    _require_in_the_cavity(touching[:, :2], design, "others")
    if design is None or not has_tips or design.indenter.shape != "hemisphere":
        return
    near_mm = 2.0 * design.indenter.tip_radius_mm
    for first, second in combinations(np.moveaxis(tips, 1, 0), 2):
        apart_mm = np.linalg.norm(first - second, axis=1)
        is_bad = (apart_mm < near_mm - SLACK_MM) & (first[:, 2] > 0.0) & (second[:, 2] > 0.0)
        if is_bad.any():
            at = int(is_bad.argmax())
            places = " and ".join(f"({x:g}, {y:g})" for x, y, _ in (first[at], second[at]))
            raise InputError(
                f"others: in {is_bad.sum()} of {len(tips)} frames of two touches the tips overlap, first at {places} "
                f"mm, their centres {apart_mm[at]:.2f} mm apart; needs two tip radii, {near_mm:g} mm; correct the "
                "positions, or drop these frames"
            )


def _require_depth_into_the_pad(depth_mm: FloatArray, signals: NDArray[Any], noise: float) -> None:
    kept = slice(None, None, -(-len(depth_mm) // MOST_SAMPLES))
    depth, seen = depth_mm[kept], signals[kept].astype(np.float64)
    level = np.abs(np.median(seen, axis=0))
    level = np.maximum(level, max(0.1 * float(level.max()), NOISE_SIGMAS * noise / LEAST_CHANGE))
    above, below = (_change(np.abs(depth[side]), seen[side], level) for side in (depth <= 0.0, depth >= 0.0))
    if above >= LEAST_CHANGE and above >= TIMES_MORE * below:
        raise InputError(
            f"press_depth: the signals change by {above:.0%} between samples of depth 0 and less, which are "
            f"untouched, and by {below:.0%} between pressed ones; is depth positive into the pad? Change its sign"
        )


def _change(distance_mm: FloatArray, signals: FloatArray, level: FloatArray) -> float:
    """How much signals change with distance from the surface, as a share of the signal; the largest over all pairs [-].

    It is the spread of the signals in the outer third of the distances minus their spread in the inner third. Changes
    that depend on time alone cancel in this difference. A fifth of the samples may be outliers.

    Parameters
    ----------
    distance_mm : (sample,) distance from the surface [mm]
    signals : (sample, pair) readings minus those of the off state
    level : (pair,) typical signal of each pair, in the same unit
    """
    reach = float(distance_mm.max(initial=0.0))
    near, far = distance_mm <= reach / 3.0, distance_mm >= reach * 2.0 / 3.0
    if reach == 0.0 or not near.any() or not signals.shape[1]:
        return 0.0
    off = np.abs(signals - np.median(signals[near], axis=0))
    spread = [np.quantile(off[rows], 0.8, axis=0) for rows in (far, near)]
    share = np.divide(spread[0] - spread[1], level, out=np.zeros_like(level), where=level > 0.0)
    return max(float(share.max()), 0.0)


def _require_millimetres(
    depth_mm: FloatArray, design: SensorDesign | None, name: str = "press_depth"
) -> None:
    low, high = float(depth_mm.min()), float(depth_mm.max())
    thickest = THICKEST_MM if design is None else design.cavity.clear_thickness_mm
    if high > thickest + SLACK_MM:
        raise InputError(
            f"{name}: the depths reach from {low:g} to {high:g} mm, the clear layer is "
            f"{'at most ' if design is None else ''}{thickest:g} mm thick: are they in millimetres?"
        )
    if high > 0.0 and max(-low, high) <= METRES_MM:
        raise InputError(
            f"{name}: the depths reach from {low:g} to {high:g} mm, which is less than the signals resolve: are "
            "they in millimetres, or in metres?"
        )


def _require_in_the_cavity(
    location_mm: FloatArray, design: SensorDesign | None, name: str = "press_x, press_y"
) -> None:
    x_mm, y_mm = location_mm.T
    whole = rectangle((0.0, 0.0, LARGEST_MM, LARGEST_MM))
    if design is not None:
        from optopad.design.shape.cavity import plan_of

        whole = plan_of(design).outline
    out = np.flatnonzero(~whole.contains(x_mm, y_mm, SLACK_MM))
    if out.size:
        raise InputError(
            f"{name}: {out.size} of {len(x_mm)} pressed samples are outside the cavity, "
            f"{'' if design else 'at most '}{whole.words}; the first is at ({x_mm[out[0]]:g}, {y_mm[out[0]]:g}) mm; is "
            "the origin its corner, and are they in millimetres? Correct them, or drop samples next to the pad"
        )


def _counts_per_volt(design: SensorDesign) -> float:
    """Counts per volt of the board's converter [counts/V]."""
    from optopad.design.circuit.circuit import Circuit

    adc = Circuit.of(design).adc
    return float(2**adc.bits / adc.full_scale_v)
