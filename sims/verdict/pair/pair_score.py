"""The verdict on one emitter-receiver pair under one press, from its light alone.

    light by path ──► modes, end depth = min(end of mode 2, deepest press)
    total x gain ──► counts, clipped at full scale ──► noise units ──► deadbands, evenness, strength

Definitions are in `modes`, `deadbands` and `noise_units`. A clipped reading is flat, so a signal over
full scale shows as a deadband here; `peak_share_of_full_scale` tells it apart from a bad layout.
Left out: ambient light, amplifier offset and non-linearity, crosstalk between pairs.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from design.arrays import FloatArray
from design.errors import InputError
from sims.verdict.pair.deadbands import (
    continuity,
    deadband_intervals_mm,
    evenness,
    longest_mm,
    saturation_interval_mm,
    total_length_mm,
)
from sims.verdict.pair.defaults import (
    DEADBAND_MIN_LENGTH_MM,
    DEADBAND_THRESHOLD,
    EVENNESS_WINDOW_MM,
    MODE_TOLERANCE,
    READ_NOISE_COUNTS,
    RELATIVE_NOISE,
)
from sims.verdict.pair.depth_curve import between, clipped, require_depths_mm, require_samples, share_above
from sims.verdict.pair.modes import Modes, find_modes
from sims.verdict.pair.noise_units import noise_units
from sims.verdict.pair.trace_noise import noise_margin, widened_threshold
from sims.verdict.pair.window_range import Interval


@dataclass(frozen=True, kw_only=True)
class Strength:
    """How much signal there is to work with, at the common gain.

    Attributes
    ----------
    untouched_counts : reading of the untouched pad, clipped at full scale [counts]
    swing : 1 - smallest / untouched reading, over all depths [-]
    resolvable_steps : range of the signal up to the end depth over the deadband threshold [-]
    """

    untouched_counts: float
    swing: float
    resolvable_steps: float


@dataclass(frozen=True, kw_only=True)
class PairScore:
    """Verdict on one pair. Lengths are depths [mm]; None is open, absent or not asked for.

    Attributes
    ----------
    end_mm : end of the judged depth: end of mode 2, or the deepest press if that comes first [mm]
    modes : the two modes and their gap
    deadbands_mm : disjoint intervals (from, to) up to the end depth [mm]
    deadband_total_mm, deadband_longest_mm : their summed and their largest length [mm]
    saturation_mm : flat interval beyond the end depth that lasts to the deepest press [mm]; changes within one
        standard error of the light model count as flat
    continuity : 1 - deadband / end depth [-], the gate
    evenness : smallest over mean range of a 0.5 mm window [-], the rank
    strength : counts, swing, steps
    is_clipped : whether some reading exceeds full scale
    clipped_share : share of the judged depth at full scale [-]
    peak_share_of_full_scale : largest unlimited reading over full scale [-]
    noise_margin : largest standard error of the trace over the judged depth [noise units], if given
    possible_deadbands_mm : deadbands that the trace's error may hide, with those found [mm], if given
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
    depth_mm : (n,) depths of the press [mm]; the first 0, increasing; the last is the deepest judged
    direct : (n,) direct light, as a fraction of emitted power [-]
    top : (n,) specularly top-reflected light, skirt included [-]
    total : (n,) all light that the receiver gets [-]
    gain_counts_per_flux : reading for a flux of 1 [counts]; common to the pairs that are compared
    full_scale_counts : largest reading of the converter [counts]
    standard_error : (n,) standard error of `total` from the trace [-]; None when it has none
    read_noise_counts, relative_noise : noise of one reading [counts], [-]
    threshold : range below which the signal is flat [noise units]
    min_length_mm : shortest deadband [mm]
    window_mm : window of evenness [mm]
    mode_tolerance : tolerance of the mode boundaries [-]

    Returns
    -------
    PairScore
    """
    depth = require_depths_mm(depth_mm)
    unlimited = _unlimited_counts(depth, total, gain_counts_per_flux, full_scale_counts)
    modes = find_modes(depth, top, direct, tolerance=mode_tolerance)
    end = float(depth[-1]) if modes.mode2_mm[1] is None else modes.mode2_mm[1]
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
    """Counts of a converter without full scale; refused when they cannot be readings."""
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
