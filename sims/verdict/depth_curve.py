"""Signals against depth: constants of the verdict, interpolation, noise units, and where a signal is flat.

The constants on which a verdict depends are collected here; the functions take them as keyword arguments.

Sources
-------
[P] P. Piacenza et al., "Accurate contact localization and indentation depth prediction with an
    optics-based tactile sensor", ICRA 2017: two modes, and the deadband between them, in words.
[F] A feasibility study of one emitter and one receiver 20 mm apart under clear layers of 6 to 12 mm,
    which turned the words into the definitions used here. Confidence: chosen, then varied. Mode
    boundaries move by at most 0.28 mm for mode tolerances of 2 to 10 %; the same thicknesses have
    deadbands for a relative noise of 0.001 to 0.01.
[S] Rounding to whole counts has the variance of a uniform error one count wide, 1/12 (Bennett 1948).
[T] L. H. C. Tippett, Biometrika 17 (1925): the range of 30 independent normal errors is on average
    4.09 standard errors; 30 is more samples than a deadband of 2.5 mm has at steps of 0.1 mm.

Interpolation
-------------
Signals are sampled at some depths and taken as straight lines between the samples.

Deadbands are exact for these lines, so a finer grid would not change them. Changes between two samples are not seen.

Noise units
-----------
A scale for counts on which equal steps are equal numbers of standard deviations.

Model: one reading of c counts has the variance σ² = σ0² + (ρ c)², σ0² = 1/12 + read noise². The first
part is rounding and electronics; the second is light that fluctuates in proportion to its mean. The
noise unit u is the variance-stabilising scale of that model, du = dc / σ(c), which integrates to
u = asinh(ρ c / σ0) / ρ, and to u = c / σ0 when ρ is zero.

Left out: shot noise (its variance grows with c, not c²), drift between recordings, ambient light, and
noise that is correlated between readings. A step of one unit is one standard deviation of one
reading; the difference of two readings is √2 times as noisy.

Source: Bartlett, "The use of transformations", Biometrics 3 (1947).

Numerical error
---------------
The error of the Monte Carlo light model, and its effect on a verdict.

The mean reading comes from a simulation, whose error is not noise of the sensor and must not count as signal. Jitter
between depths widens the range of a flat signal, so it *hides* deadbands; on a slope that is just steep enough it can
also create one.
Errors of neighbouring depths share random numbers and are correlated to an unknown degree, so they
cannot be subtracted in quadrature. Two figures are given instead:

- the noise margin: the largest standard error within an interval, in noise units. Up to 0.5,
  the range that errors add to a constant stays on average below the deadband threshold; above it, a
  verdict carries a warning;
- possible deadbands: those found when the threshold is raised by 4.09 times the margin, the mean range
  of 30 independent errors (Tippett 1925). Correlation lowers that range. The result is not a
  confidence limit, and it leaves out any bias of the simulation.

Sliding windows
---------------
The range of piecewise-linear signals within a sliding window of depth, without resampling them.

A window [a, a + L] moves over curves that are straight between samples. An event is an end of the window
passing a sample. Between two events the samples inside the window stay the same, so their largest value M
and smallest value m are constants, and the two end values l = u(a), r = u(a + L) are linear in a. The
range is therefore the largest of seven lines,

    l - r,  r - l,  l - m,  M - l,  r - m,  M - r,  M - m,

hence convex in a. "Range below k" is therefore one open interval of a in each cell between events,
which follows in closed form; the smallest range of a cell is the lowest point of a convex function.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from optopad.design.arrays import BoolArray, FloatArray
from optopad.design.errors import InputError

QUANTISATION_VARIANCE: Final = 1.0 / 12.0
"""Variance of rounding to whole counts [counts squared]; [S]."""

READ_NOISE_COUNTS: Final = 0.5
"""Standard deviation of one reading in the dark, without rounding [counts]; [F], assumed."""

RELATIVE_NOISE: Final = 0.003
"""Standard deviation of the light, divided by its mean [-]; [F], assumed."""

DEADBAND_THRESHOLD: Final = 3.0
"""A signal that varies by less than this many noise units is flat [-]; [F]."""

DEADBAND_MIN_LENGTH_MM: Final = 0.3
"""A flat interval shorter than this is not a deadband [mm]; [F]."""

EVENNESS_WINDOW_MM: Final = 0.5
"""Length of the depth window whose signal range evenness compares [mm]; [F]."""

MODE_TOLERANCE: Final = 0.05
"""Share of the light's range within which it counts as still at its first value, or already at its last [-]; [F]."""

TRACE_ERROR_LIMIT: Final = 0.5
"""Largest numerical standard error that a verdict accepts without a warning [noise units]. The range that
it adds over a typical deadband, 4.09 times itself, stays below the threshold of 3."""

NUMERICAL: Final = "numerical error of single pairs"
"""Start of the warning about this error. The verdict of a pad is free of it: its frames come from two traces."""

TRACE_ERROR_SPREAD: Final = 4.09
"""Range that independent errors add over a deadband, in standard errors [-]; [T]."""


def require_depths_mm(depth_mm: ArrayLike) -> FloatArray:
    """Check that depths start at 0 (untouched) and increase; an error is raised otherwise.

    Parameters
    ----------
    depth_mm : (n,) depths of one press [mm]; n >= 2, the first 0, strictly increasing

    Returns
    -------
    (n,) the same depths, as an array [mm]
    """
    depth = np.asarray(depth_mm, dtype=np.float64)
    if depth.ndim != 1 or depth.size < 2:
        raise InputError(f"depth_mm: shape {depth.shape}, needs (n,) with n >= 2; trace more depths")
    if not np.all(np.isfinite(depth)):
        raise InputError("depth_mm: has a value that is not finite; needs finite depths, drop the bad ones")
    if depth[0] != 0.0:
        raise InputError(f"depth_mm[0]: {depth[0]} mm, needs 0 mm; put the untouched state first")
    if not np.all(np.diff(depth) > 0.0):
        i = int(np.flatnonzero(np.diff(depth) <= 0.0)[0])
        raise InputError(
            f"depth_mm[{i + 1}]: {depth[i + 1]} mm, needs more than {depth[i]} mm; "
            "sort the depths and drop repeats"
        )
    return depth


def require_samples(name: str, values: ArrayLike, depth_mm: FloatArray, *, axes: int = 1) -> FloatArray:
    """Check that there is one finite sample per depth, along the first axis; an error is raised otherwise.

    Parameters
    ----------
    name : name of the samples for the error message
    values : (n,) or, with axes = 2, (n, m) samples
    depth_mm : (n,) depths [mm]
    axes : number of axes that the samples must have

    Returns
    -------
    the same samples, as an array
    """
    samples = np.asarray(values, dtype=np.float64)
    if samples.ndim != axes or samples.shape[0] != depth_mm.size or samples.size == 0:
        shape = f"({depth_mm.size},)" if axes == 1 else f"({depth_mm.size}, pairs >= 1)"
        raise InputError(f"{name}: shape {samples.shape}, needs {shape}; give one sample a depth")
    if not np.all(np.isfinite(samples)):
        raise InputError(f"{name}: has a value that is not finite; needs finite samples, retrace that state")
    return samples


def interpolated(depth_mm: FloatArray, values: FloatArray, at_mm: FloatArray) -> FloatArray:
    """Samples at other depths, along straight lines.

    Parameters
    ----------
    depth_mm : (n,) increasing depths [mm]
    values : (n, ...) samples
    at_mm : (m,) requested depths [mm]; outside the samples, the first or last value is used

    Returns
    -------
    (m, ...) samples at `at_mm`
    """
    right = np.clip(np.searchsorted(depth_mm, at_mm), 1, depth_mm.size - 1)
    left = right - 1
    share = np.clip((at_mm - depth_mm[left]) / (depth_mm[right] - depth_mm[left]), 0.0, 1.0)
    share = share.reshape(share.shape + (1,) * (values.ndim - 1))
    line: FloatArray = values[left] * (1.0 - share) + values[right] * share
    return line


def between(
    depth_mm: FloatArray, values: FloatArray, from_mm: float, to_mm: float
) -> tuple[FloatArray, FloatArray]:
    """The part of a curve between two depths, with a sample at each end of the part.

    Parameters
    ----------
    depth_mm : (n,) increasing depths [mm]
    values : (n, ...) samples
    from_mm, to_mm : first and last depth of the part [mm]

    Returns
    -------
    depth_mm : (m,) depths of the part [mm]
    values : (m, ...) samples of the part
    """
    inside = depth_mm[(depth_mm > from_mm) & (depth_mm < to_mm)]
    part_mm = np.concatenate(([from_mm], inside, [to_mm]))
    return part_mm, interpolated(depth_mm, values, part_mm)


def clipped(
    depth_mm: FloatArray, counts: FloatArray, full_scale_counts: float
) -> tuple[FloatArray, FloatArray]:
    """Counts as a converter reads them: never above full scale, with a sample wherever a line crosses full scale.

    Parameters
    ----------
    depth_mm : (n,) increasing depths [mm]
    counts : (n,) or (n, pair) unlimited counts
    full_scale_counts : largest reading [counts]

    Returns
    -------
    depth_mm : (m,) the depths, and those where some pair enters or leaves full scale [mm]
    counts : (m,) or (m, pair) counts, at most full scale
    """
    table = counts.reshape(depth_mm.size, -1)
    before, after = table[:-1] - full_scale_counts, table[1:] - full_scale_counts
    segment, pair = np.nonzero(before * after < 0.0)
    share = before[segment, pair] / (before[segment, pair] - after[segment, pair])
    meets_mm = depth_mm[segment] + share * np.diff(depth_mm)[segment]
    all_mm = np.union1d(depth_mm, meets_mm)
    return all_mm, np.minimum(interpolated(depth_mm, counts, all_mm), full_scale_counts)


def share_above(depth_mm: FloatArray, values: FloatArray, level: float) -> float:
    """Share of the depth range over which a curve is above a level.

    Parameters
    ----------
    depth_mm : (n,) increasing depths [mm]
    values : (n,) samples
    level : level, in the unit of the samples

    Returns
    -------
    share [-], 0 to 1
    """
    before, after = values[:-1] - level, values[1:] - level
    high, low = np.maximum(before, after), np.minimum(before, after)
    part = np.where(low > 0.0, 1.0, np.maximum(high, 0.0) / np.where(high > low, high - low, 1.0))
    part = np.where((high <= 0.0), 0.0, part)
    return float(np.sum(part * np.diff(depth_mm)) / (depth_mm[-1] - depth_mm[0]))


_SERIES_BELOW = 1e-8  # there asinh(x)/x and sinh(x)/x differ from 1 by x²/6 < 2e-17, less than rounding


def _zero_signal_sigma_counts(read_noise_counts: float, relative_noise: float) -> float:
    for name, value in (("read_noise_counts", read_noise_counts), ("relative_noise", relative_noise)):
        if not (np.isfinite(value) and value >= 0.0):
            raise InputError(f"{name}: {value}, needs a finite number >= 0; give the noise of one reading")
    return float(np.sqrt(QUANTISATION_VARIANCE + read_noise_counts**2))


def sigma_counts(
    counts: ArrayLike, read_noise_counts: float = READ_NOISE_COUNTS, relative_noise: float = RELATIVE_NOISE
) -> FloatArray:
    """Standard deviation of one reading.

    Parameters
    ----------
    counts : (...) mean reading [counts]
    read_noise_counts : standard deviation in the dark, without rounding [counts]
    relative_noise : standard deviation of the light, divided by its mean [-]

    Returns
    -------
    (...) standard deviation [counts]
    """
    sigma0 = _zero_signal_sigma_counts(read_noise_counts, relative_noise)
    return np.hypot(sigma0, relative_noise * np.asarray(counts, dtype=np.float64))


def noise_units(
    counts: ArrayLike, read_noise_counts: float = READ_NOISE_COUNTS, relative_noise: float = RELATIVE_NOISE
) -> FloatArray:
    """Convert counts to noise units, u = asinh(ρ c / σ0) / ρ.

    Parameters
    ----------
    counts : (...) mean reading [counts]
    read_noise_counts : standard deviation in the dark, without rounding [counts]
    relative_noise : standard deviation of the light, divided by its mean [-]; zero gives u = c / σ0

    Returns
    -------
    (...) reading [noise units]; an odd and increasing function of the counts
    """
    linear = np.asarray(counts, dtype=np.float64) / _zero_signal_sigma_counts(
        read_noise_counts, relative_noise
    )
    return linear * _ratio_to_argument(np.arcsinh, relative_noise * linear)


def counts_of_noise_units(
    units: ArrayLike, read_noise_counts: float = READ_NOISE_COUNTS, relative_noise: float = RELATIVE_NOISE
) -> FloatArray:
    """Convert noise units to counts, c = σ0 sinh(ρ u) / ρ: the inverse of `noise_units`.

    Parameters
    ----------
    units : (...) reading [noise units]
    read_noise_counts : standard deviation in the dark, without rounding [counts]
    relative_noise : standard deviation of the light, divided by its mean [-]; zero gives c = σ0 u

    Returns
    -------
    (...) reading [counts]
    """
    u = np.asarray(units, dtype=np.float64)
    sigma0 = _zero_signal_sigma_counts(read_noise_counts, relative_noise)
    return sigma0 * u * _ratio_to_argument(np.sinh, relative_noise * u)


def _ratio_to_argument(function: np.ufunc, x: FloatArray) -> FloatArray:
    """function(x) / x for asinh or sinh; where x is too small to divide by, the limit 1."""
    small = np.abs(x) < _SERIES_BELOW
    safe = np.where(small, 1.0, x)
    ratio: FloatArray = np.where(small, 1.0, function(safe) / safe)
    return ratio


def samples_between(depth_mm: FloatArray, start_mm: float, end_mm: float) -> slice:
    """Slice of the samples that define a curve between two depths, including those at or just outside the ends."""
    first = int(np.searchsorted(depth_mm, start_mm, side="right")) - 1
    return slice(max(first, 0), int(np.searchsorted(depth_mm, end_mm, side="left")) + 1)


def noise_margin(
    depth_mm: ArrayLike,
    counts: ArrayLike,
    standard_error_counts: ArrayLike,
    *,
    within_mm: Interval | None = None,
    read_noise_counts: float = READ_NOISE_COUNTS,
    relative_noise: float = RELATIVE_NOISE,
) -> float:
    """Largest numerical standard error of a reading within an interval of depth.

    Parameters
    ----------
    depth_mm : (n,) increasing depths of the press [mm]; the first is 0
    counts : (n,) or (n, pair) mean readings [counts]
    standard_error_counts : (n,) or (n, pair) numerical standard error of `counts` [counts]
    within_mm : interval (from, to) to examine, its ends included [mm]; None for all depths
    read_noise_counts, relative_noise : constant [counts] and relative [-] part of the noise of one reading

    Returns
    -------
    standard error [noise units], the largest over depths and pairs
    """
    depth = require_depths_mm(depth_mm)
    readings = require_samples("counts", counts, depth, axes=2 if np.ndim(counts) == 2 else 1)
    error = require_samples("standard_error_counts", standard_error_counts, depth, axes=readings.ndim)
    if np.any(error < 0.0) or error.shape != readings.shape:
        raise InputError(
            f"standard_error_counts: shape {error.shape}, smallest {error.min()}, "
            f"needs shape {readings.shape} and no negative value; "
            "pass the trace's own standard error times the gain"
        )
    units = error / sigma_counts(readings, read_noise_counts, relative_noise)
    if within_mm is None:
        return float(units.max())
    return float(between(depth, units, *within_mm)[1].max())


def widened_threshold(
    margin: float, *, threshold: float = DEADBAND_THRESHOLD, spread: float = TRACE_ERROR_SPREAD
) -> float:
    """Deadband threshold plus the range that numerical errors of the light may add to a flat signal.

    Parameters
    ----------
    margin : largest numerical standard error [noise units]
    threshold : deadband threshold for light without numerical error [noise units]
    spread : range of the errors over an interval, as a multiple of their standard error [-]

    Returns
    -------
    threshold [noise units]
    """
    return threshold + spread * margin


def trace_noise_warning(margin: float, *, fine: bool = False, limit: float = TRACE_ERROR_LIMIT) -> str | None:
    """The warning about the numerical error of the light model.

    Parameters
    ----------
    margin : largest numerical standard error over the judged depth [noise units]
    fine : whether the light was traced with the option --fine, which is otherwise the remedy
    limit : margin up to which there is no warning [noise units]

    Returns
    -------
    one sentence with the value, the remedy and the limit; None if the margin is within the limit
    """
    if margin <= limit:
        return None
    remedy = "even with --fine" if fine else "run with --fine"
    size, most = f"{margin:.2g} sigma", f"{limit:.2g} sigma"
    return f"{NUMERICAL} {size}, {remedy} (it can pass for signal; limit {most})"


Interval = tuple[float, float]

GOLDEN = (5.0**0.5 - 1.0) / 2.0
GOLDEN_STEPS = 60
"""Number of golden-section steps; each leaves 0.62 of the interval, so 60 leave 3e-13 of it."""


def flat_intervals_mm(
    depth_mm: FloatArray, units: FloatArray, length_mm: float, threshold: float
) -> tuple[Interval, ...]:
    """Intervals of depth composed of windows in which the range of every signal is below a threshold.

    Parameters
    ----------
    depth_mm : (n,) increasing depths [mm]
    units : (n, pair) signals, straight between the depths
    length_mm : window length [mm]
    threshold : range that no signal may reach within the window, in the unit of the signals

    Returns
    -------
    disjoint intervals (from, to) in order [mm]; each is at least `length_mm` long

    Notes
    -----
    The result is also the union of all intervals, of the window's length or longer, over which every range is below
    the threshold, because each of these intervals is composed of such windows.
    """
    if depth_mm[-1] - depth_mm[0] < length_mm:
        return ()
    first_mm, last_mm, at_first, at_last = _range_lines(depth_mm, units, length_mm)
    enter, leave = _shares_below(at_first, at_last, threshold)
    flat = enter < leave
    starts = (first_mm * (1.0 - enter) + last_mm * enter)[flat]
    last_starts = (first_mm * (1.0 - leave) + last_mm * leave)[flat]
    ends = np.where(last_starts >= last_mm[-1], depth_mm[-1], last_starts + length_mm)
    return _union(starts, ends)


def smallest_range(depth_mm: FloatArray, units: FloatArray, length_mm: float) -> float:
    """Smallest range of a signal within any window of a given length.

    Of several signals, the one with the largest range counts in each window. Parameters are those of
    `smallest_ranges`.

    Returns
    -------
    range, in the unit of the signal
    """
    return float(np.min(smallest_ranges(depth_mm, units, length_mm)[2]))


def smallest_ranges(
    depth_mm: FloatArray, units: FloatArray, length_mm: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Smallest range of a signal in windows of a given length, for each cell of window starts.

    A cell is an interval of start depths over which the windows contain the same samples. Of several signals, the one
    with the largest range counts.

    Parameters
    ----------
    depth_mm : (n,) increasing depths [mm]
    units : (n,) signal or (n, pair) signals, straight between the depths
    length_mm : window length [mm]; at most the depth range

    Returns
    -------
    (cell,) first start and (cell,) last start of the windows in each cell [mm]; (cell,) smallest range, in the unit of
        the signal
    """
    first_mm, last_mm, *lines = _range_lines(depth_mm, units.reshape(len(depth_mm), -1), length_mm)
    first, last = (np.moveaxis(of_end, 1, 2).reshape(-1, of_end.shape[1]) for of_end in lines)
    return first_mm, last_mm, _lowest_of_highest(first, last)


def _lowest_of_highest(first: FloatArray, last: FloatArray) -> FloatArray:
    """Minimum, within each cell, of the maximum of several straight lines.

    The maximum of straight lines is convex, so golden-section search finds its lowest point.

    Parameters
    ----------
    first, last : (line, cell) values of the lines at a cell's two ends

    Returns
    -------
    (cell,) lowest value
    """
    low, high = np.zeros(first.shape[1]), np.ones(first.shape[1])
    slope, highest = last - first, np.maximum.reduce  # along the lines; faster than `np.max` on small arrays
    for _ in range(GOLDEN_STEPS):
        left, right = high - GOLDEN * (high - low), low + GOLDEN * (high - low)
        goes_left = highest(first + slope * left) <= highest(first + slope * right)
        low, high = np.where(goes_left, low, left), np.where(goes_left, right, high)
    ends = [highest(first + slope * share) for share in (low, high, np.zeros_like(low), np.ones_like(low))]
    return np.asarray(np.minimum.reduce(ends))


def _range_lines(
    depth_mm: FloatArray, units: FloatArray, length_mm: float
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Cells of window starts, and the values of the seven lines (see the module) at both ends of each cell.

    Returns
    -------
    first_mm, last_mm : (cell,) first and last window start of each cell [mm]
    at_first, at_last : (7, cell, pair) values of the lines at these two starts
    """
    events = np.concatenate((depth_mm, depth_mm - length_mm))
    events = np.unique(np.clip(events, depth_mm[0], depth_mm[-1] - length_mm))
    first_mm, last_mm = (events, events) if events.size == 1 else (events[:-1], events[1:])
    low, high, empty = _inner_extremes(depth_mm, units, 0.5 * (first_mm + last_mm), length_mm)
    lines = []
    for start_mm in (first_mm, last_mm):
        left = interpolated(depth_mm, units, start_mm)
        right = interpolated(depth_mm, units, start_mm + length_mm)
        inner = np.stack((left - low, high - left, right - low, high - right, high - low))
        inner[:, empty] = 0.0
        lines.append(np.concatenate((np.stack((left - right, right - left)), inner)))
    return first_mm, last_mm, lines[0], lines[1]


def _inner_extremes(
    depth_mm: FloatArray, units: FloatArray, start_mm: FloatArray, length_mm: float
) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Smallest and largest sample strictly inside each window, and which windows contain none."""
    begin = np.searchsorted(depth_mm, start_mm, side="right")
    stop = np.searchsorted(depth_mm, start_mm + length_mm, side="left")
    low = np.zeros((start_mm.size, units.shape[1]))
    high = np.zeros_like(low)
    for cell in np.flatnonzero(stop > begin):
        inside = units[begin[cell] : stop[cell]]
        low[cell], high[cell] = inside.min(axis=0), inside.max(axis=0)
    return low, high, stop <= begin


def _shares_below(
    at_first: FloatArray, at_last: FloatArray, threshold: float
) -> tuple[FloatArray, FloatArray]:
    """Interval of each depth cell in which the changes of all pairs, linear within a cell, are below a threshold.

    Returns the start and the end of the interval, as fractions of the cell from 0 to 1.
    """
    rise = at_last - at_first
    crossing = (threshold - at_first) / np.where(rise == 0.0, np.inf, rise)
    first_below, last_below = at_first < threshold, at_last < threshold
    enter = np.where(first_below, 0.0, np.where(last_below, crossing, 1.0))
    leave = np.where(last_below, 1.0, np.where(first_below, crossing, 0.0))
    return enter.max(axis=(0, 2)), leave.min(axis=(0, 2))


def _union(starts: FloatArray, ends: FloatArray) -> tuple[Interval, ...]:
    """Union of intervals that are sorted by their starts; intervals that touch become one."""
    merged: list[Interval] = []
    for start, end in zip(starts.tolist(), ends.tolist(), strict=True):
        if merged and start <= merged[-1][1]:
            merged[-1] = (merged[-1][0], max(end, merged[-1][1]))
        else:
            merged.append((start, end))
    return tuple(merged)
