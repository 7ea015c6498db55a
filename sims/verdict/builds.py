"""One build of a design, judged in brief: the gap, the deadband and the margin that a verdict turns on.

Used to try builds that differ from the design in an open value. Facing rows are judged by one pair under
its own press; a pad at one place, by the pairs that make up nine tenths of what its frames change there in any part of
the depth. Fewer pairs can only lengthen a pad's deadband, so a pad that is safe by them is safe.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from design.arrays import FloatArray
from design.shape.cavity import cavity_of
from design.shape.pairs import chord_midpoint_mm, judged_pairs, mask_of
from design.shape.plan import plan_of
from design.spec import SensorDesign
from sims.optics.accuracy import ACCURACIES, Accuracy
from sims.optics.light_signals import LightSignals
from sims.optics.tracing import trace
from sims.press.depths import COARSE_STEP_MM, depth_schedule_mm
from sims.readings.readout import Readout, readout_of
from sims.verdict.pad_map import place_of
from sims.verdict.pair.deadbands import total_length_mm
from sims.verdict.pair.defaults import DEADBAND_MIN_LENGTH_MM, DEADBAND_THRESHOLD
from sims.verdict.pair.depth_curve import between, clipped
from sims.verdict.pair.noise_units import noise_of, noise_units, sigma_counts
from sims.verdict.pair.pair_score import PairScore, score_pair
from sims.verdict.pair.trace_noise import samples_between, widened_threshold
from sims.verdict.pair.window_range import smallest_range
from sims.verdict.presses import SECOND_SEED, Pair, PairCurves, curves_of, pair_curves, states_of

ACCURACY = replace(ACCURACIES["draft"], reference_rays=4096)
"""Light settings of tried builds; the design as it is is traced the same way for comparison. On the paper's pad and
pair, four seeds' margins spread as at "standard" (by 0.16 noise units on the pad), at half the cost."""
FORMED_ACCURACY = replace(ACCURACY, image_step=0.7, rings=16, columns=40)
"""The same for discs and crowned pads. On three presets four seeds' margins spread by 3 to 5 % of themselves, twice
as much as with `ACCURACY`, at half the cost."""
NEARLY_BLIND = 1.5 * DEADBAND_THRESHOLD
"""Distance below which depths of a build are traced a second time, to take the light's own error out [noise units]."""
RESPONSE_WINDOW_MM = 0.5
"""Part of the depth in which the most responsive pairs of a place are looked for [mm]."""
RESPONSE_SHARE = 0.9
"""Share of the squared distance of frames that they make up there [-]."""


@dataclass(frozen=True, kw_only=True)
class Brief:
    """What a verdict turns on.

    Attributes
    ----------
    gap_mm : signed mode gap [mm]; None when mode 2 is never reached, or for a pad
    deadband_mm : summed length of the deadbands [mm]
    margin : change of the signal, or distance of a pad's frames, over the least told 0.3 mm of depth [noise units];
        below 3 is a deadband
    usable_mm : depth from which on depth is not told any more, or the deepest press [mm]; None where not worked out
    in_doubt : whether the light trace's own error may hide a deadband where none was found
    """

    gap_mm: float | None
    deadband_mm: float
    margin: float
    usable_mm: float | None = None
    in_doubt: bool = False


def accuracy_of_builds(design: SensorDesign) -> Accuracy:
    """Light settings of tried builds of a design."""
    return ACCURACY if plan_of(design).is_block else FORMED_ACCURACY


def score_curves(design: SensorDesign, curves: PairCurves, readout: Readout) -> PairScore:
    """Judge one pair's light at its receiver's gain; a clipped reading cuts the trace's error off with it."""
    gain = readout.of_receiver(curves.pair[1])
    is_clipped = curves.total * gain >= readout.full_scale_counts
    return score_pair(
        curves.depth_mm,
        curves.direct,
        curves.top,
        curves.total,
        gain_counts_per_flux=gain,
        full_scale_counts=readout.full_scale_counts,
        standard_error=np.where(is_clipped, 0.0, curves.standard_error),
        **noise_of(design),
    )


def facing_brief(design: SensorDesign, *, seed: int) -> Brief:
    """A build of facing rows, judged by all facing pairs: gap of the middle one, deadband and margin of the worst."""
    cavity = cavity_of(design)
    pairs = judged_pairs(cavity)
    depth_mm = depth_schedule_mm(design.operating.max_depth_mm, COARSE_STEP_MM)
    traced = pair_curves(design, cavity, pairs, depth_mm, accuracy=accuracy_of_builds(design), seed=seed)
    untouched = np.zeros((len(cavity.emitters), len(cavity.receivers)))
    for curves in traced:
        untouched[curves.pair] = curves.total[0]
    readout = readout_of(design, untouched, mask_of(pairs, cavity))
    scores = [score_curves(design, curves, readout) for curves in traced]
    worst_mm = max(score.deadband_total_mm for score in scores)
    found = [
        pair_margin(design, readout, curves, score) for curves, score in zip(traced, scores, strict=True)
    ]
    return Brief(
        gap_mm=scores[0].modes.gap_mm,
        deadband_mm=worst_mm,
        margin=min(margin for margin, _ in found),
        usable_mm=min(_usable_mm(design, score) for score in scores),
        in_doubt=worst_mm == 0.0 and any(margin < widened_threshold(error) for margin, error in found),
    )


def pair_margin(
    design: SensorDesign, readout: Readout, curves: PairCurves, score: PairScore
) -> tuple[float, float]:
    """Margin of a pair, and the light trace's error over its judged depth [noise units]."""
    depth_mm = curves.depth_mm
    judged = depth_mm <= score.end_mm
    gain, full_scale = readout.of_receiver(curves.pair[1]), readout.full_scale_counts
    error = _trace_error(
        design, full_scale, gain * curves.total[judged], gain * curves.standard_error[judged]
    )
    return _margin(design, depth_mm, full_scale, gain * curves.total[:, None], score.end_mm), error


def pair_brief(design: SensorDesign, pair: Pair, *, seed: int) -> Brief:
    """A build judged by one pair under the press at its chord's midpoint."""
    place_mm = chord_midpoint_mm(cavity_of(design), pair)
    depth_mm, light, readout = _pressed(design, place_mm, (pair,), seed)
    curves = curves_of(light, pair, place_mm, slice(1, None), depth_mm)
    score = score_curves(design, curves, readout)
    counts = curves.total[:, None] * readout.of_receiver(pair[1])
    return Brief(
        gap_mm=score.modes.gap_mm,
        deadband_mm=score.deadband_total_mm,
        margin=_margin(design, depth_mm, readout.full_scale_counts, counts, score.end_mm),
        usable_mm=_usable_mm(design, score),
    )


def _usable_mm(design: SensorDesign, score: PairScore) -> float:
    """Depth from which on a pair does not tell depth any more, or the deepest press [mm]."""
    return design.operating.max_depth_mm if score.saturation_mm is None else score.saturation_mm[0]


def place_brief(
    design: SensorDesign, place_mm: tuple[float, float], pairs: tuple[Pair, ...], *, seed: int
) -> Brief:
    """A build judged at one place by some pairs together, over all depths; where nearly blind, by two traces."""
    depth_mm, light, readout = _pressed(design, place_mm, pairs, seed)
    counts = np.stack([_counts(light, pairs, readout, first=1)] * 2)
    full_scale, once = readout.full_scale_counts, np.zeros_like(counts[0])
    nearly = place_of(
        design, place_mm, depth_mm, counts, once, full_scale, threshold=NEARLY_BLIND
    ).depths.blind
    again = np.zeros(len(depth_mm), dtype=np.bool_)
    for interval in (*nearly.deadbands_mm, (nearly.usable_mm, float(depth_mm[-1]))):
        if interval[1] > interval[0]:
            again[samples_between(depth_mm, *interval)] = True
    if again.any():
        second = _light(design, place_mm, depth_mm[again], pairs, seed + SECOND_SEED)
        counts[1, again] = _counts(second, pairs, readout)
    found = place_of(design, place_mm, depth_mm, counts, once, full_scale).depths
    return Brief(
        gap_mm=None,
        deadband_mm=total_length_mm(found.blind.deadbands_mm),
        margin=found.margin,
        usable_mm=found.blind.usable_mm,
        in_doubt=found.is_open,
    )


def _counts(light: LightSignals, pairs: tuple[Pair, ...], readout: Readout, *, first: int = 0) -> FloatArray:
    """(state, pair) readings from a state on."""
    emitters, receivers = np.array(pairs).T
    return np.asarray(light.flux[first:, emitters, receivers] * readout.of_pairs(pairs))


def responsive_pairs(
    design: SensorDesign, depth_mm: FloatArray, counts: FloatArray, pairs: tuple[Pair, ...]
) -> tuple[Pair, ...]:
    """The pairs that make up most of what frames change in any part of the depth.

    Parameters
    ----------
    depth_mm : (n,) depths
    counts : (n, pair) readings at one place
    pairs : names of the columns
    """
    units = noise_units(counts, **noise_of(design))
    chosen: dict[Pair, None] = {}
    for start in np.arange(0.0, depth_mm[-1] - 1e-9, RESPONSE_WINDOW_MM):
        end = min(start + RESPONSE_WINDOW_MM, float(depth_mm[-1]))
        _, inside = between(depth_mm, units, float(start), end)
        square = np.ptp(inside, axis=0) ** 2
        order = np.argsort(-square)
        enough = int(np.searchsorted(np.cumsum(square[order]), RESPONSE_SHARE * square.sum())) + 1
        chosen |= dict.fromkeys(pairs[int(k)] for k in order[:enough])
    return tuple(sorted(chosen))


def _pressed(
    design: SensorDesign, place_mm: tuple[float, float], pairs: tuple[Pair, ...], seed: int
) -> tuple[FloatArray, LightSignals, Readout]:
    """Depths, light and gain of one press: state 0 is the untouched pad with all pairs, then a state a depth."""
    cavity = cavity_of(design)
    depth_mm = depth_schedule_mm(design.operating.max_depth_mm, COARSE_STEP_MM)
    light = _light(design, place_mm, depth_mm, pairs, seed, is_after_untouched=True)
    return depth_mm, light, readout_of(design, light.flux[0], mask_of(judged_pairs(cavity), cavity))


def _light(
    design: SensorDesign,
    place_mm: tuple[float, float],
    depth_mm: FloatArray,
    pairs: tuple[Pair, ...],
    seed: int,
    *,
    is_after_untouched: bool = False,
) -> LightSignals:
    """Light of some pairs at some depths; of all pairs on the untouched pad before them where it is asked for."""
    begin = [0.0] if is_after_untouched else []
    states = states_of(np.array([place_mm]), np.concatenate([begin, depth_mm]))
    masks = np.repeat(mask_of(pairs, cavity_of(design))[np.newaxis], len(states), axis=0)
    masks[: len(begin)] = True
    return trace(design, states, accuracy=accuracy_of_builds(design), seed=seed, pairs=masks)


def _margin(
    design: SensorDesign, depth_mm: FloatArray, full_scale: float, counts: FloatArray, end_mm: float
) -> float:
    knots_mm, readings = clipped(depth_mm, counts, full_scale)
    part_mm, units = between(knots_mm, noise_units(readings, **noise_of(design)), 0.0, end_mm)
    return smallest_range(part_mm, units, min(DEADBAND_MIN_LENGTH_MM, end_mm))


def _trace_error(
    design: SensorDesign, full_scale: float, counts: FloatArray, standard_error: FloatArray
) -> float:
    """Error of the light trace, pooled over depths and pairs: a single state's has too few replicates [noise units]."""
    readings = np.minimum(counts, full_scale)
    errors = np.where(readings < full_scale, standard_error, 0.0)
    return float(np.sqrt(np.mean((errors / sigma_counts(readings, **noise_of(design))) ** 2)))
