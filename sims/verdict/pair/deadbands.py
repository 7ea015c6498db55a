"""Deadbands: depths over which a reading says nothing about depth.

A deadband is an interval of depth, at least 0.3 mm long, over which the signal in noise units varies by
less than 3. Overlapping maximal intervals are merged, so a reported deadband is their *union*: every
depth in it lies in some 0.3 mm or longer stretch that is flat, though the signal may drift by more than
3 units from one end of a long deadband to the other (a slope below 10 units/mm is one deadband
throughout). A steep step of more than 6 units between two plateaus keeps them apart, since the interval
of each reaches less than 3 units into the step; a smaller one does not.

Intervals are those of the press up to `end_mm`, the end of mode 2: a plateau that runs past it counts
with the part before it, and only if that part is long enough. Flatness beyond is *saturation*: the
tip already blocks the pair, and nothing more is expected of it.

Several pairs together (a pad) are blind only where all of them are: the largest of their ranges is
below 3. A further pair can only shorten the pad's deadbands.

The answer is exact for straight lines, in noise units, between the depths given (`window_range`).
Left out: gain drift, lag, and the error of the light trace itself, for which see `trace_noise`.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from design.arrays import FloatArray
from design.errors import InputError
from sims.verdict.pair.defaults import (
    DEADBAND_MIN_LENGTH_MM,
    DEADBAND_THRESHOLD,
    EVENNESS_WINDOW_MM,
    READ_NOISE_COUNTS,
    RELATIVE_NOISE,
)
from sims.verdict.pair.depth_curve import between, require_depths_mm, require_samples
from sims.verdict.pair.noise_units import noise_units
from sims.verdict.pair.window_range import Interval, flat_intervals_mm, smallest_range


def deadband_intervals_mm(
    depth_mm: ArrayLike,
    counts: ArrayLike,
    *,
    end_mm: float | None = None,
    read_noise_counts: float = READ_NOISE_COUNTS,
    relative_noise: float = RELATIVE_NOISE,
    min_length_mm: float = DEADBAND_MIN_LENGTH_MM,
    threshold: float = DEADBAND_THRESHOLD,
) -> tuple[Interval, ...]:
    """Deadbands of one pair.

    Parameters
    ----------
    depth_mm : (n,) depths of the press [mm]; the first 0, increasing
    counts : (n,) mean readings, clipped at full scale [counts]
    end_mm : end of mode 2 [mm]; None judges all depths
    read_noise_counts, relative_noise : noise of one reading [counts], [-]
    min_length_mm : shortest interval that counts [mm]
    threshold : range below which the signal is flat [noise units]

    Returns
    -------
    disjoint intervals (from, to) in order [mm]
    """
    depth = require_depths_mm(depth_mm)
    return joint_deadband_intervals_mm(
        depth,
        require_samples("counts", counts, depth)[:, np.newaxis],
        end_mm=end_mm,
        read_noise_counts=read_noise_counts,
        relative_noise=relative_noise,
        min_length_mm=min_length_mm,
        threshold=threshold,
    )


def joint_deadband_intervals_mm(
    depth_mm: ArrayLike,
    counts: ArrayLike,
    *,
    end_mm: float | None = None,
    read_noise_counts: float = READ_NOISE_COUNTS,
    relative_noise: float = RELATIVE_NOISE,
    min_length_mm: float = DEADBAND_MIN_LENGTH_MM,
    threshold: float = DEADBAND_THRESHOLD,
) -> tuple[Interval, ...]:
    """Deadbands of several pairs together: depths over which no pair changes by the threshold.

    Parameters
    ----------
    depth_mm : (n,) depths of the press [mm]; the first 0, increasing
    counts : (n, pair) mean readings, clipped at full scale [counts]
    end_mm : last depth that is judged [mm]; None judges all depths
    read_noise_counts, relative_noise : noise of one reading [counts], [-]
    min_length_mm : shortest interval that counts [mm]
    threshold : range below which a signal is flat [noise units]

    Returns
    -------
    disjoint intervals (from, to) in order [mm]
    """
    depth = require_depths_mm(depth_mm)
    table = require_samples("counts", counts, depth, axes=2)
    _require_positive(min_length_mm=min_length_mm, threshold=threshold)
    units = noise_units(table, read_noise_counts, relative_noise)
    part_mm, part = between(depth, units, 0.0, _end_within(depth, end_mm))
    return flat_intervals_mm(part_mm, part, min_length_mm, threshold)


def saturation_interval_mm(
    depth_mm: ArrayLike,
    counts: ArrayLike,
    *,
    end_mm: float,
    read_noise_counts: float = READ_NOISE_COUNTS,
    relative_noise: float = RELATIVE_NOISE,
    min_length_mm: float = DEADBAND_MIN_LENGTH_MM,
    threshold: float = DEADBAND_THRESHOLD,
) -> Interval | None:
    """The flat interval beyond the end of mode 2 that lasts to the deepest press.

    Parameters
    ----------
    depth_mm : (n,) depths of the press [mm]; the first 0, increasing
    counts : (n,) mean readings, clipped at full scale [counts]
    end_mm : end of mode 2 [mm]
    read_noise_counts, relative_noise : noise of one reading [counts], [-]
    min_length_mm : shortest interval that counts [mm]
    threshold : range below which the signal is flat [noise units]

    Returns
    -------
    (from, to) [mm]; None when the signal still changes at the deepest press
    """
    depth = require_depths_mm(depth_mm)
    readings = require_samples("counts", counts, depth)
    _require_positive(min_length_mm=min_length_mm, threshold=threshold)
    end, deepest = _end_within(depth, end_mm), float(depth[-1])
    if deepest - end < min_length_mm:
        return None
    units = noise_units(readings, read_noise_counts, relative_noise)
    part_mm, part = between(depth, units, end, deepest)
    flat = flat_intervals_mm(part_mm, part[:, np.newaxis], min_length_mm, threshold)
    return flat[-1] if flat and flat[-1][1] == deepest else None


def total_length_mm(intervals_mm: Sequence[Interval]) -> float:
    """Summed length of disjoint intervals [mm]."""
    return float(sum(to - start for start, to in intervals_mm))


def longest_mm(intervals_mm: Sequence[Interval]) -> float:
    """Length of the longest interval [mm]; 0 when there is none."""
    return float(max((to - start for start, to in intervals_mm), default=0.0))


def continuity(deadbands_mm: Sequence[Interval], end_mm: float) -> float:
    """Share of the judged depth that is not deadband: the gate of the verdict.

    Parameters
    ----------
    deadbands_mm : disjoint intervals within 0 and `end_mm` [mm]
    end_mm : end of the judged depth [mm]

    Returns
    -------
    1 - Σ deadband / end depth [-], 0 to 1
    """
    _require_positive(end_mm=end_mm)
    return max(0.0, 1.0 - total_length_mm(deadbands_mm) / end_mm)  # max: rounding of the sum only


def evenness(
    depth_mm: ArrayLike,
    counts: ArrayLike,
    *,
    end_mm: float | None = None,
    read_noise_counts: float = READ_NOISE_COUNTS,
    relative_noise: float = RELATIVE_NOISE,
    window_mm: float = EVENNESS_WINDOW_MM,
) -> float:
    """How evenly one pair spreads its range over the depth: the rank among pairs without a deadband.

    Parameters
    ----------
    depth_mm : (n,) depths of the press [mm]; the first 0, increasing
    counts : (n,) mean readings, clipped at full scale [counts]
    end_mm : end of mode 2 [mm]; None judges all depths
    read_noise_counts, relative_noise : noise of one reading [counts], [-]
    window_mm : window length [mm]; a press shorter than it is judged as one window

    Returns
    -------
    smallest range within a window over whole range x window / end depth [-], at most 1; 0 when
    nothing changes at all
    """
    depth = require_depths_mm(depth_mm)
    readings = require_samples("counts", counts, depth)
    _require_positive(window_mm=window_mm)
    end = _end_within(depth, end_mm)
    part_mm, units = between(depth, noise_units(readings, read_noise_counts, relative_noise), 0.0, end)
    window, whole = min(window_mm, end), float(np.ptp(units))
    if whole == 0.0:
        return 0.0
    return min(1.0, smallest_range(part_mm, units, window) / (whole * window / end))


def _end_within(depth_mm: FloatArray, end_mm: float | None) -> float:
    """End of the judged depth, refused outside the depths given."""
    deepest = float(depth_mm[-1])
    if end_mm is None:
        return deepest
    if not 0.0 < end_mm <= deepest:
        raise InputError(f"end_mm: {end_mm} mm, needs over 0 and at most {deepest} mm; trace to that depth")
    return float(end_mm)


def _require_positive(**values: float) -> None:
    for name, value in values.items():
        if not (np.isfinite(value) and value > 0.0):
            raise InputError(f"{name}: {value}, needs a finite number over 0; leave it out for the default")
