"""The range of piecewise-linear signals within a sliding window of depth, without a resampling grid.

A window [a, a + L] moves over curves that are straight between samples. Between two events (an end of
the window passes a sample) the samples inside stay the same ones, so their largest value M and
smallest value m are constants, and the two end values l = u(a), r = u(a + L) are linear in a. The
range is then the largest of seven lines,

    l - r,  r - l,  l - m,  M - l,  r - m,  M - r,  M - m,

hence convex in a. "Range below k" is therefore one open interval of a in each cell between events,
which follows in closed form; the smallest range of a cell is the lowest point of a convex function.
"""

from __future__ import annotations

import numpy as np

from design.arrays import BoolArray, FloatArray
from sims.verdict.pair.depth_curve import interpolated

Interval = tuple[float, float]

GOLDEN = (5.0**0.5 - 1.0) / 2.0
GOLDEN_STEPS = 60
"""Each step leaves 0.62 of the bracket: 60 leave 3e-13 of a cell."""


def flat_intervals_mm(
    depth_mm: FloatArray, units: FloatArray, length_mm: float, threshold: float
) -> tuple[Interval, ...]:
    """Depths that lie in some window over which every signal's range is below a threshold.

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
    Every interval of at least the window's length with a range below the threshold is a union of such
    windows, and every such window is such an interval: the result is the union of the maximal ones.
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
    """Smallest range of a signal, or of the most responsive of several, within any window of a given length.

    As `smallest_ranges`.

    Returns
    -------
    range, in the unit of the signal
    """
    return float(np.min(smallest_ranges(depth_mm, units, length_mm)[2]))


def smallest_ranges(
    depth_mm: FloatArray, units: FloatArray, length_mm: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Smallest range of a signal, or of the most responsive of several, by where the window starts.

    Parameters
    ----------
    depth_mm : (n,) increasing depths [mm]
    units : (n,) signal or (n, pair) signals, straight between the depths
    length_mm : window length [mm]; at most the depth range

    Returns
    -------
    (cell,) first and last start of the windows of each cell [mm]; (cell,) smallest range, in the unit of the signal
    """
    first_mm, last_mm, *lines = _range_lines(depth_mm, units.reshape(len(depth_mm), -1), length_mm)
    first, last = (np.moveaxis(of_end, 1, 2).reshape(-1, of_end.shape[1]) for of_end in lines)
    return first_mm, last_mm, _lowest_of_highest(first, last)


def _lowest_of_highest(first: FloatArray, last: FloatArray) -> FloatArray:
    """Lowest point, within each cell, of the highest of several straight lines.

    The highest of straight lines is convex, so golden-section search shrinks each cell to its lowest point.

    Parameters
    ----------
    first, last : (line, cell) values of the lines at a cell's two ends

    Returns
    -------
    (cell,) lowest value
    """
    low, high = np.zeros(first.shape[1]), np.ones(first.shape[1])
    slope = last - first
    for _ in range(GOLDEN_STEPS):
        left, right = high - GOLDEN * (high - low), low + GOLDEN * (high - low)
        goes_left = np.max(first + slope * left, axis=0) <= np.max(first + slope * right, axis=0)
        low, high = np.where(goes_left, low, left), np.where(goes_left, right, high)
    ends = np.stack(
        [
            np.max(first + slope * share, axis=0)
            for share in (low, high, np.zeros_like(low), np.ones_like(low))
        ]
    )
    return np.asarray(ends.min(axis=0))


def _range_lines(
    depth_mm: FloatArray, units: FloatArray, length_mm: float
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Cells of window starts, and the seven lines at each cell's two ends.

    Returns
    -------
    first_mm, last_mm : (cell,) first and last window start of each cell [mm]
    at_first, at_last : (7, cell, pair) the lines at these two starts
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
    """Smallest and largest sample strictly inside each window, and which windows hold none."""
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
    """Open part of each cell, as shares 0 to 1, where all lines of all pairs lie below a threshold."""
    rise = at_last - at_first
    crossing = (threshold - at_first) / np.where(rise == 0.0, np.inf, rise)
    first_below, last_below = at_first < threshold, at_last < threshold
    enter = np.where(first_below, 0.0, np.where(last_below, crossing, 1.0))
    leave = np.where(last_below, 1.0, np.where(first_below, crossing, 0.0))
    return enter.max(axis=(0, 2)), leave.min(axis=(0, 2))


def _union(starts: FloatArray, ends: FloatArray) -> tuple[Interval, ...]:
    """Union of intervals given in order of their starts; those that touch become one."""
    merged: list[Interval] = []
    for start, end in zip(starts.tolist(), ends.tolist(), strict=True):
        if merged and start <= merged[-1][1]:
            merged[-1] = (merged[-1][0], max(end, merged[-1][1]))
        else:
            merged.append((start, end))
    return tuple(merged)
