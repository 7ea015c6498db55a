"""The verdict on one emitter-receiver pair under one press: its two modes, the gap between them, and its deadbands.

    light by path ──► modes, end depth = min(end of mode 2, deepest press)
    total x gain ──► counts, clipped at full scale ──► noise units ──► deadbands, evenness, strength

Modes
-----
Mode 1: light that the top returns is lost or redirected as soon as the dimple reaches the point of reflection.
Mode 2: the tip itself comes between emitter and receiver. Piacenza et al. (ICRA 2017) define both modes in words. In
numbers, with T the light specularly reflected by the top and D the direct light:

    mode 1   from the first depth where |T - T(0)| exceeds 5 % of T's range
             to the last depth where |T - T(deepest)| leaves 5 % of T's range
    mode 2   from the depth after which D stays at or below 95 % of D(0)
             to the depth after which D stays at or below 5 % of D(0)
    gap      onset of mode 2 - end of mode 1; negative when the modes overlap

Two parts that look up from the floor have no direct light, so only mode 1: loss or gain of the light by way of the top.

A boundary is where the monotone cubic through the samples (Fritsch and Butland 1984) crosses one of these levels. The
cubic never overshoots, is exact for straight lines, and has a third-order error in the step on smooth curves. It rounds
off a kink by up to a seventh of the step. "Stays" is judged up to the deepest press only. Whether the
change of T or D exceeds the noise matters only for the deadbands, not for the modes.

Deadbands
---------
A deadband is an interval of depth, at least 0.3 mm long, over which the signal in noise units varies by less than 3.
Overlapping maximal intervals are merged, so a reported deadband is their *union*: every depth in it is in some flat
stretch of 0.3 mm or more. The signal may still drift by more than 3 units from one end of a long deadband to the other:
a slope below 10 units/mm is one deadband throughout. A steep step of more than 6 units keeps two plateaus apart, since
the interval of each extends less than 3 units into the step. A smaller step does not.

Deadbands end at `end_mm`, the end of mode 2, or of mode 1 for a pair without direct light. Flatness beyond it is
*saturation*: the tip already blocks the pair, so no further change is expected. A plateau across `end_mm` counts as a
deadband only if its part before `end_mm` is long
enough. Several pairs together have a deadband only where the largest of their ranges is below 3.

The result is exact for signals that are straight, in noise units, between the given depths. A clipped reading is flat,
so a signal over full scale shows as a deadband; `peak_share_of_full_scale` distinguishes it from a bad layout.
Not modelled: gain drift, lag, ambient light, amplifier offset and non-linearity, crosstalk between pairs. For the error
of the light model see `optopad.sims.verdict.depth_curve`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import PchipInterpolator

from optopad.design.arrays import FloatArray
from optopad.design.errors import InputError
from optopad.sims.verdict.depth_curve import (
    DEADBAND_MIN_LENGTH_MM,
    DEADBAND_THRESHOLD,
    EVENNESS_WINDOW_MM,
    MODE_TOLERANCE,
    READ_NOISE_COUNTS,
    RELATIVE_NOISE,
    Interval,
    between,
    clipped,
    flat_intervals_mm,
    noise_margin,
    noise_units,
    require_depths_mm,
    require_samples,
    share_above,
    smallest_range,
    widened_threshold,
)

HALVINGS = 50
"""Number of bisection steps; after these, only rounding limits the accuracy of a crossing."""


@dataclass(frozen=True, kw_only=True)
class Modes:
    """The depths at which the two modes act.

    Attributes
    ----------
    mode1_mm : start and end of mode 1 [mm]; (0, 0) if the top-reflected light never changes
    mode2_mm : onset and end of mode 2 [mm]; each is None if not reached within the given depths, or if the pair has no
        direct light, as two parts on the floor
    gap_mm : onset of mode 2 minus end of mode 1 [mm]; None if mode 2 never starts
    gap_at_least_mm : lower bound of the gap if mode 2 never starts [mm]; None if it starts, or without direct light
    """

    mode1_mm: tuple[float, float]
    mode2_mm: tuple[float | None, float | None]
    gap_mm: float | None
    gap_at_least_mm: float | None


def find_modes(
    depth_mm: ArrayLike, top: ArrayLike, direct: ArrayLike, *, tolerance: float = MODE_TOLERANCE
) -> Modes:
    """Find the two modes of one pair.

    Parameters
    ----------
    depth_mm : (n,) increasing depths of the press [mm]; the first is 0
    top : (n,) light specularly reflected by the top, including the flank of the dimple [any unit]
    direct : (n,) direct light [the same or another unit]
    tolerance : share of the mirrored light's range, and of the untouched direct light, within which a mode counts as
        not begun or as ended [-]; between 0 and 0.5

    Returns
    -------
    Modes
    """
    depth = require_depths_mm(depth_mm)
    top_light = require_samples("top", top, depth)
    direct_light = require_samples("direct", direct, depth)
    if not 0.0 < tolerance < 0.5:
        raise InputError(f"tolerance: {tolerance}, needs a share over 0 and below 0.5; the default is 0.05")
    mode1 = _mode1_mm(depth, top_light, tolerance)
    if direct_light[0] <= 0.0:
        return Modes(mode1_mm=mode1, mode2_mm=(None, None), gap_mm=None, gap_at_least_mm=None)
    onset = _stays_below_from_mm(depth, direct_light, (1.0 - tolerance) * float(direct_light[0]))
    end = _stays_below_from_mm(depth, direct_light, tolerance * float(direct_light[0]))
    return Modes(
        mode1_mm=mode1,
        mode2_mm=(onset, end),
        gap_mm=None if onset is None else onset - mode1[1],
        gap_at_least_mm=float(depth[-1]) - mode1[1] if onset is None else None,
    )


def _mode1_mm(depth_mm: FloatArray, top: FloatArray, tolerance: float) -> tuple[float, float]:
    band = tolerance * float(np.ptp(top))
    if band == 0.0:
        return (0.0, 0.0)
    moved, unsettled = top - top[0], top - top[-1]
    first = int(np.flatnonzero(np.abs(moved) > band)[0])
    last = int(np.flatnonzero(np.abs(unsettled) > band)[-1])
    start = _crossing_mm(depth_mm, moved, first - 1, float(np.copysign(band, moved[first])))
    end = _crossing_mm(depth_mm, unsettled, last, float(np.copysign(band, unsettled[last])))
    return (start, end)


def _stays_below_from_mm(depth_mm: FloatArray, values: FloatArray, level: float) -> float | None:
    """Depth from which a curve stays at or below a level [mm]; None if it ends above. It must start above the level."""
    last_above = int(np.flatnonzero(values > level)[-1])
    if last_above == depth_mm.size - 1:
        return None
    return _crossing_mm(depth_mm, values, last_above, level)


def _crossing_mm(depth_mm: FloatArray, values: FloatArray, segment: int, level: float) -> float:
    """Depth where the monotone cubic through the samples crosses a level within a segment [mm]."""
    cubic = PchipInterpolator(depth_mm, values).c[:, segment]
    low, high = 0.0, float(depth_mm[segment + 1] - depth_mm[segment])
    falls = values[segment] > values[segment + 1]
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        is_before = (np.polyval(cubic, middle) > level) == falls
        low, high = (middle, high) if is_before else (low, middle)
    return float(depth_mm[segment] + 0.5 * (low + high))


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
    depth_mm : (n,) increasing depths of the press [mm]; the first is 0
    counts : (n,) mean readings, clipped at full scale [counts]
    end_mm : end of mode 2 [mm]; if None, all depths are judged
    read_noise_counts, relative_noise : constant [counts] and relative [-] part of the noise of one reading
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
    """Joint deadbands of several pairs: depths over which no pair changes by the threshold.

    Parameters
    ----------
    depth_mm : (n,) increasing depths of the press [mm]; the first is 0
    counts : (n, pair) mean readings, clipped at full scale [counts]
    end_mm : last depth that is judged [mm]; if None, all depths are judged
    read_noise_counts, relative_noise : constant [counts] and relative [-] part of the noise of one reading
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
    """The flat interval beyond the end of mode 2 that extends to the deepest press.

    Parameters
    ----------
    depth_mm : (n,) increasing depths of the press [mm]; the first is 0
    counts : (n,) mean readings, clipped at full scale [counts]
    end_mm : end of mode 2 [mm]
    read_noise_counts, relative_noise : constant [counts] and relative [-] part of the noise of one reading
    min_length_mm : shortest interval that counts [mm]
    threshold : range below which the signal is flat [noise units]

    Returns
    -------
    (from, to) [mm]; None if the signal still changes at the deepest press
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
    """Length of the longest interval [mm]; 0 if there are none."""
    return float(max((to - start for start, to in intervals_mm), default=0.0))


def continuity(deadbands_mm: Sequence[Interval], end_mm: float) -> float:
    """Share of the judged depth that is not in a deadband.

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
    """How evenly a pair's signal range is spread over depth; used to rank pairs without a deadband.

    Parameters
    ----------
    depth_mm : (n,) increasing depths of the press [mm]; the first is 0
    counts : (n,) mean readings, clipped at full scale [counts]
    end_mm : end of mode 2 [mm]; if None, all depths are judged
    read_noise_counts, relative_noise : constant [counts] and relative [-] part of the noise of one reading
    window_mm : window length [mm]; if the judged depth is shorter, it is one window

    Returns
    -------
    smallest range within a window, divided by the mean range (whole range x window / end depth) [-]; at most 1, and 0
        if the signal is constant
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
    """End of the judged depth [mm]; an error is raised if it is outside the given depths."""
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


@dataclass(frozen=True, kw_only=True)
class Strength:
    """Strength of a pair's signal.

    Attributes
    ----------
    untouched_counts : reading of the untouched pad, clipped at full scale [counts]
    swing : 1 - smallest reading over all depths / untouched reading [-]
    resolvable_steps : number of deadband thresholds in the signal's range up to the end depth [-]
    """

    untouched_counts: float
    swing: float
    resolvable_steps: float


@dataclass(frozen=True, kw_only=True)
class PairScore:
    """Verdict on one pair. All lengths are depths.

    Attributes
    ----------
    end_mm : end of the judged depth: end of mode 2, or the deepest press if that comes first [mm]
    modes : the two modes and their gap
    deadbands_mm : disjoint intervals (from, to) up to the end depth [mm]
    deadband_total_mm, deadband_longest_mm : summed and largest length of the deadbands [mm]
    saturation_mm : flat interval beyond the end depth that extends to the deepest press [mm]; None if there is none.
        Changes within one standard error of the light model count as flat
    continuity : share of the judged depth that is not in a deadband [-]
    evenness : smallest signal range in any 0.5 mm of depth, divided by the mean range in 0.5 mm [-]
    strength : untouched counts, swing and resolvable steps
    is_clipped : whether any reading exceeds full scale
    clipped_share : share of the judged depth at full scale [-]
    peak_share_of_full_scale : largest reading before clipping, as a share of full scale [-]
    noise_margin : largest standard error of the light model over the judged depth [noise units]; None if no standard
        errors were given
    possible_deadbands_mm : the deadbands found and those that the light model's error may hide [mm]; None if no
        standard errors were given
    """

    end_mm: float
    modes: Modes
    deadbands_mm: tuple[Interval, ...]
    deadband_total_mm: float
    deadband_longest_mm: float
    saturation_mm: Interval | None
    continuity: float
    evenness: float
    strength: Strength
    is_clipped: bool
    clipped_share: float
    peak_share_of_full_scale: float
    noise_margin: float | None
    possible_deadbands_mm: tuple[Interval, ...] | None


def score_pair(
    depth_mm: ArrayLike,
    direct: ArrayLike,
    top: ArrayLike,
    total: ArrayLike,
    *,
    gain_counts_per_flux: float,
    full_scale_counts: float,
    standard_error: ArrayLike | None = None,
    read_noise_counts: float = READ_NOISE_COUNTS,
    relative_noise: float = RELATIVE_NOISE,
    threshold: float = DEADBAND_THRESHOLD,
    min_length_mm: float = DEADBAND_MIN_LENGTH_MM,
    window_mm: float = EVENNESS_WINDOW_MM,
    mode_tolerance: float = MODE_TOLERANCE,
) -> PairScore:
    """Judge one pair.

    Parameters
    ----------
    depth_mm : (n,) increasing depths of the press [mm]; the first is 0, the last is the deepest press
    direct : (n,) direct light, as a share of the emitted power [-]
    top : (n,) light reflected specularly by the top and the flank of the dimple, as a share of the emitted power [-]
    total : (n,) all light that the receiver gets, as a share of the emitted power [-]
    gain_counts_per_flux : reading if `total` were 1 [counts]; the same for all pairs that are compared
    full_scale_counts : largest reading of the converter [counts]
    standard_error : (n,) standard error of `total` from the light model [-]; None if unknown
    read_noise_counts, relative_noise : constant [counts] and relative [-] part of the noise of one reading
    threshold : range below which the signal is flat [noise units]
    min_length_mm : shortest deadband [mm]
    window_mm : window of evenness [mm]
    mode_tolerance : tolerance of the mode boundaries, see `find_modes` [-]

    Returns
    -------
    PairScore
    """
    depth = require_depths_mm(depth_mm)
    unlimited = _unlimited_counts(depth, total, gain_counts_per_flux, full_scale_counts)
    modes = find_modes(depth, top, direct, tolerance=mode_tolerance)
    end = float(depth[-1]) if modes.mode2_mm[1] is None else modes.mode2_mm[1]
    if not np.asarray(direct)[0] > 0.0 and modes.mode1_mm[1] > 0.0:
        end = modes.mode1_mm[1]
    at_mm, counts = clipped(depth, unlimited, full_scale_counts)
    noise = {"read_noise_counts": read_noise_counts, "relative_noise": relative_noise}
    rule = {"end_mm": end, "min_length_mm": min_length_mm, **noise}
    found = deadband_intervals_mm(at_mm, counts, threshold=threshold, **rule)
    margin, possible, feigned = None, None, 0.0
    if standard_error is not None:
        error = gain_counts_per_flux * require_samples("standard_error", standard_error, depth)
        readings = np.minimum(unlimited, full_scale_counts)
        margin = noise_margin(depth, readings, error, within_mm=(0.0, end), **noise)
        feigned = noise_margin(depth, readings, error, within_mm=(end, float(depth[-1])), **noise)
        doubtful = widened_threshold(margin, threshold=threshold)
        possible = deadband_intervals_mm(at_mm, counts, threshold=doubtful, **rule)
    _, judged_units = between(at_mm, noise_units(counts, **noise), 0.0, end)
    return PairScore(
        end_mm=end,
        modes=modes,
        deadbands_mm=found,
        deadband_total_mm=total_length_mm(found),
        deadband_longest_mm=longest_mm(found),
        saturation_mm=saturation_interval_mm(at_mm, counts, threshold=threshold + feigned, **rule),
        continuity=continuity(found, end),
        evenness=evenness(at_mm, counts, end_mm=end, window_mm=window_mm, **noise),
        strength=_strength(counts, judged_units, threshold),
        is_clipped=bool(np.any(unlimited > full_scale_counts)),
        clipped_share=share_above(*between(depth, unlimited, 0.0, end), full_scale_counts),
        peak_share_of_full_scale=float(unlimited.max() / full_scale_counts),
        noise_margin=margin,
        possible_deadbands_mm=possible,
    )


def _unlimited_counts(
    depth_mm: FloatArray, total: ArrayLike, gain_counts_per_flux: float, full_scale_counts: float
) -> FloatArray:
    """(n,) counts before clipping at full scale; an error is raised if they are not possible readings."""
    for name, value in (
        ("gain_counts_per_flux", gain_counts_per_flux),
        ("full_scale_counts", full_scale_counts),
    ):
        if not (np.isfinite(value) and value > 0.0):
            raise InputError(f"{name}: {value}, needs a finite number over 0; take it from the board")
    light = require_samples("total", total, depth_mm)
    if light[0] <= 0.0 or np.any(light < 0.0):
        raise InputError(
            f"total: {light[0]} untouched, smallest {light.min()}, needs over 0 untouched, never negative; "
            "leave a pair without light out"
        )
    return gain_counts_per_flux * light


def _strength(counts: FloatArray, judged_units: FloatArray, threshold: float) -> Strength:
    return Strength(
        untouched_counts=float(counts[0]),
        swing=float(1.0 - counts.min() / counts[0]),
        resolvable_steps=float(np.ptp(judged_units) / threshold),
    )
