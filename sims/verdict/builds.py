"""Short verdicts on manufactured units of a design: mode gap, deadband and margin of each.

A short verdict is quicker than a full one, so many units can be judged, each with its own values of the unmeasured
parameters. Facing rows are judged by their governing pair under its own press, or by all facing pairs. A pad is judged
at its location of least margin, by the pairs that make up nine tenths of the change of its frames in any part of the
depth. Fewer pairs can only lengthen a deadband, so if these pairs have no deadband, the pad has none there.

A *judge* is the function that gives the short verdict of one unit. It comes with a text that names the pairs or the
location that it uses.

A Monte Carlo study over all tolerances gives the share of units that keep the verdict.

    tolerances ──► Sobol points, scrambled with the seed ──► units ──► short verdicts ──► share that keeps the verdict

Each unit is the design with all its toleranced values drawn at once. Its gain is set anew, as it would be on that unit,
and it is judged as the design itself is: facing rows by all facing pairs, a pad at its location of least margin. The
light model uses the same random shifts for all units, so two units differ by the drawn values only.

Uncertainty: the share has the exact binomial interval (Clopper and Pearson 1934) at 95 %. Sobol points are more even
than random ones, so the interval is somewhat too wide. It accounts only for the finite number of units, not for the
tolerances, which are assumptions. Units whose verdict the numerical error may change are counted separately.

Sensitivity: Spearman's rank correlation of each value with the unit's margin (or, for a unit with a deadband, with
minus the deadband's length), and its 95 % interval after Fisher. It shows a value's effect while all others vary;
`tolerance` varies one value at a time.

Left out: the same as in `optopad.design.spec.tolerances`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from math import ceil, log2
from typing import Any, Protocol

import numpy as np

from optopad.design.arrays import BoolArray, FloatArray
from optopad.design.draft import Draft
from optopad.design.errors import InputError, OptopadError
from optopad.design.shape.cavity import (
    CavityGeometry,
    chord_midpoint_mm,
    is_facing_rows,
    judged_pairs,
    mask_of,
)
from optopad.design.spec import SensorDesign
from optopad.design.spec.tolerances import Tolerance
from optopad.sims.optics.accuracy import ACCURACIES, Accuracy, LightSignals
from optopad.sims.optics.tracing import trace
from optopad.sims.press import COARSE_STEP_MM, depth_schedule_mm
from optopad.sims.readings.readout import Readout, readout_of
from optopad.sims.verdict.depth_curve import (
    DEADBAND_MIN_LENGTH_MM,
    DEADBAND_THRESHOLD,
    between,
    clipped,
    noise_units,
    samples_between,
    sigma_counts,
    smallest_range,
    widened_threshold,
)
from optopad.sims.verdict.pad_map import PadMap, place_of
from optopad.sims.verdict.pair_score import PairScore, score_pair, total_length_mm
from optopad.sims.verdict.presses import SECOND_SEED, Pair, PairCurves, curves_of, pair_curves, states_of

ACCURACY = replace(ACCURACIES["draft"], reference_rays=4096, rings=16, columns=40)
"""Light settings of units; the design itself is traced the same way for comparison. On the paper's pad the margins of
four seeds scatter by 0.04 to 0.2 noise units, as with "standard", in a third of the time; on the pair by 0.1."""
FORMED_ACCURACY = replace(ACCURACY, image_step=0.7)
"""Light settings of units for discs and crowned pads. On three presets the margins of four seeds scatter by 3 to 5 %,
twice as much as with `ACCURACY`, at half the cost."""
NEARLY_DEAD = 1.5 * DEADBAND_THRESHOLD
"""Depths whose frames are closer to each other than this are traced again, to remove the numerical error
[noise units]."""
RESPONSE_WINDOW_MM = 0.5
"""Length of each part of the depth for which the most responsive pairs are selected [mm]."""
RESPONSE_SHARE = 0.9
"""Share of the squared distance of frames that the selected pairs contribute in each part of the depth [-]."""


@dataclass(frozen=True, kw_only=True)
class Brief:
    """A short verdict: the numbers on which a full verdict depends.

    Attributes
    ----------
    gap_mm : signed mode gap [mm]; None when mode 2 is never reached, or for a pad
    deadband_mm : summed length of the deadbands [mm]
    margin : change of the signal, or distance of a pad's frames, over the least resolved 0.3 mm of depth [noise units];
        a value below 3 means a deadband
    usable_mm : largest depth that is resolved, at most the deepest press [mm]; None if not computed
    in_doubt : whether it is undecided, because of the light model's numerical error, if there is a deadband
    """

    gap_mm: float | None
    deadband_mm: float
    margin: float
    usable_mm: float | None = None
    in_doubt: bool = False


def accuracy_of_builds(draft: Draft) -> Accuracy:
    """Accuracy setting of the light model for units of a design."""
    return ACCURACY if draft.plan.is_block else FORMED_ACCURACY


def score_curves(curves: PairCurves, readout: Readout) -> PairScore:
    """Score of one pair from its light, with its receiver's gain; a clipped reading has no numerical error."""
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
        **readout.noise,
    )


def facing_brief(draft: Draft, *, seed: int) -> Brief:
    """Short verdict on facing rows: mode gap of the middle pair, deadband and margin of the worst pair."""
    cavity = draft.cavity
    pairs = judged_pairs(cavity)
    depth_mm = depth_schedule_mm(draft.design.operating.max_depth_mm, COARSE_STEP_MM)
    traced = pair_curves(draft, pairs, depth_mm, accuracy=accuracy_of_builds(draft), seed=seed)
    untouched = np.zeros((len(cavity.emitters), len(cavity.receivers)))
    for curves in traced:
        untouched[curves.pair] = curves.total[0]
    readout = readout_of(draft, untouched, mask_of(pairs, cavity))
    scores = [score_curves(curves, readout) for curves in traced]
    worst_mm = max(score.deadband_total_mm for score in scores)
    found = [pair_margin(readout, curves, score) for curves, score in zip(traced, scores, strict=True)]
    return Brief(
        gap_mm=scores[0].modes.gap_mm,
        deadband_mm=worst_mm,
        margin=min(margin for margin, _ in found),
        usable_mm=min(_usable_mm(draft, score) for score in scores),
        in_doubt=worst_mm == 0.0 and any(margin < widened_threshold(error) for margin, error in found),
    )


def pair_margin(readout: Readout, curves: PairCurves, score: PairScore) -> tuple[float, float]:
    """Margin of a pair, and the numerical error over its judged depth [noise units]."""
    depth_mm = curves.depth_mm
    judged = depth_mm <= score.end_mm
    gain = readout.of_receiver(curves.pair[1])
    error = _trace_error(readout, gain * curves.total[judged], gain * curves.standard_error[judged])
    return _margin(readout, depth_mm, gain * curves.total[:, None], score.end_mm), error


def pair_brief(draft: Draft, pair: Pair, *, seed: int) -> Brief:
    """Short verdict by one pair under a press at the midpoint between its emitter and receiver."""
    place_mm = chord_midpoint_mm(draft.cavity, pair)
    depth_mm, light, readout = _pressed(draft, place_mm, (pair,), seed)
    curves = curves_of(light, pair, place_mm, slice(1, None), depth_mm)
    score = score_curves(curves, readout)
    counts = curves.total[:, None] * readout.of_receiver(pair[1])
    return Brief(
        gap_mm=score.modes.gap_mm,
        deadband_mm=score.deadband_total_mm,
        margin=_margin(readout, depth_mm, counts, score.end_mm),
        usable_mm=_usable_mm(draft, score),
    )


def _usable_mm(draft: Draft, score: PairScore) -> float:
    """Depth up to which a pair resolves depth; the deepest press if it resolves all depths [mm]."""
    return draft.design.operating.max_depth_mm if score.saturation_mm is None else score.saturation_mm[0]


def place_brief(draft: Draft, place_mm: tuple[float, float], pairs: tuple[Pair, ...], *, seed: int) -> Brief:
    """Short verdict at one location by several pairs; depths whose margin is near the threshold are traced twice."""
    depth_mm, light, readout = _pressed(draft, place_mm, pairs, seed)
    counts = np.stack([_counts(light, pairs, readout, first=1)] * 2)
    once = np.zeros_like(counts[0])
    nearly = place_of(place_mm, depth_mm, counts, once, readout, threshold=NEARLY_DEAD).depths.blind
    again = np.zeros(len(depth_mm), dtype=np.bool_)
    for interval in (*nearly.deadbands_mm, (nearly.usable_mm, float(depth_mm[-1]))):
        if interval[1] > interval[0]:
            again[samples_between(depth_mm, *interval)] = True
    if again.any():
        second = _light(draft, place_mm, depth_mm[again], pairs, seed + SECOND_SEED)
        counts[1, again] = _counts(second, pairs, readout)
    found = place_of(place_mm, depth_mm, counts, once, readout).depths
    return Brief(
        gap_mm=None,
        deadband_mm=total_length_mm(found.blind.deadbands_mm),
        margin=found.margin,
        usable_mm=found.blind.usable_mm,
        in_doubt=found.is_open,
    )


def _counts(light: LightSignals, pairs: tuple[Pair, ...], readout: Readout, *, first: int = 0) -> FloatArray:
    """(state, pair) readings under the presses (states), starting at index `first` [counts]; not clipped."""
    emitters, receivers = np.array(pairs).T
    return np.asarray(light.flux[first:, emitters, receivers] * readout.of_pairs(pairs))


def responsive_pairs(
    readout: Readout, depth_mm: FloatArray, counts: FloatArray, pairs: tuple[Pair, ...]
) -> tuple[Pair, ...]:
    """The pairs that contribute most of the change of the frames in any part of the depth.

    Parameters
    ----------
    depth_mm : (n,) depths [mm]
    counts : (n, pair) readings at one location
    pairs : (emitter, receiver) of each column of `counts`
    """
    units = noise_units(counts, **readout.noise)
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
    draft: Draft, place_mm: tuple[float, float], pairs: tuple[Pair, ...], seed: int
) -> tuple[FloatArray, LightSignals, Readout]:
    """Depths, light and gain for one press location; the light is of the untouched pad first, then of each depth."""
    cavity = draft.cavity
    depth_mm = depth_schedule_mm(draft.design.operating.max_depth_mm, COARSE_STEP_MM)
    light = _light(draft, place_mm, depth_mm, pairs, seed, is_after_untouched=True)
    return depth_mm, light, readout_of(draft, light.flux[0], mask_of(judged_pairs(cavity), cavity))


def _light(
    draft: Draft,
    place_mm: tuple[float, float],
    depth_mm: FloatArray,
    pairs: tuple[Pair, ...],
    seed: int,
    *,
    is_after_untouched: bool = False,
) -> LightSignals:
    """Light of some pairs at some depths; if `is_after_untouched`, the untouched pad with all pairs comes first."""
    begin = [0.0] if is_after_untouched else []
    states = states_of(np.array([place_mm]), np.concatenate([begin, depth_mm]))
    masks = np.repeat(mask_of(pairs, draft.cavity)[np.newaxis], len(states), axis=0)
    masks[: len(begin)] = True
    return trace(draft, states, accuracy=accuracy_of_builds(draft), seed=seed, pairs=masks)


def _margin(readout: Readout, depth_mm: FloatArray, counts: FloatArray, end_mm: float) -> float:
    knots_mm, readings = clipped(depth_mm, counts, readout.full_scale_counts)
    part_mm, units = between(knots_mm, noise_units(readings, **readout.noise), 0.0, end_mm)
    return smallest_range(part_mm, units, min(DEADBAND_MIN_LENGTH_MM, end_mm))


def _trace_error(readout: Readout, counts: FloatArray, standard_error: FloatArray) -> float:
    """Numerical error of the light: its root mean square over depths and pairs [noise units]."""
    readings = np.minimum(counts, readout.full_scale_counts)
    errors = np.where(readings < readout.full_scale_counts, standard_error, 0.0)
    return float(np.sqrt(np.mean((errors / sigma_counts(readings, **readout.noise)) ** 2)))


CONFIDENCE = 0.95
NORMAL_95 = 1.959964
CUT_SIGMA = 2.0
"""Half-width of a normally distributed tolerance, in standard deviations; no value is drawn beyond its ends."""
FEWEST_BUILDS, MOST_BUILDS = 10, 100_000


BuildJudge = Callable[[Draft], Brief]


def pair_judge(pair: Pair, name: str, *, seed: int) -> tuple[str, BuildJudge]:
    """A judge of units by one pair under a press at the middle of its path, with the pair's name."""
    return name, lambda build: pair_brief(build, pair, seed=seed)


def facing_judge(*, seed: int) -> tuple[str, BuildJudge]:
    """A judge of facing rows by all facing pairs, as for the full verdict."""
    return "the facing pairs", lambda build: facing_brief(build, seed=seed)


def place_judge(
    cavity: CavityGeometry, pad_map: PadMap, light: LightSignals, readout: Readout, *, seed: int
) -> tuple[str, BuildJudge]:
    """A judge of pads at the design's location of least margin, by the pairs that respond there."""
    weak = pad_map.weakest
    place_mm = (weak.x_mm, weak.y_mm)
    pairs = _answering_pairs(cavity, light, place_mm, readout)
    name = f"the pad at x {weak.x_mm:g}, y {weak.y_mm:g} mm"
    return name, lambda build: place_brief(build, place_mm, pairs, seed=seed)


def verdict_judge(
    cavity: CavityGeometry,
    pad_map: PadMap | None,
    light: LightSignals | None,
    readout: Readout,
    *,
    seed: int,
) -> tuple[str, BuildJudge]:
    """A judge of a design's units: by all facing pairs for facing rows, otherwise at the location of least margin."""
    if pad_map is None or light is None or is_facing_rows(cavity):
        return facing_judge(seed=seed)
    return place_judge(cavity, pad_map, light, readout, seed=seed)


def _answering_pairs(
    cavity: CavityGeometry, light: LightSignals, place_mm: tuple[float, float], readout: Readout
) -> tuple[Pair, ...]:
    pairs = judged_pairs(cavity)
    here = (light.presses[:, 0] == place_mm[0]) & (light.presses[:, 1] == place_mm[1])
    unlimited = np.stack([light.flux[here, i, j] for i, j in pairs], axis=1) * readout.of_pairs(pairs)
    counts = np.minimum(unlimited, readout.full_scale_counts)
    return responsive_pairs(readout, light.presses[here, 2], counts, pairs)


class Memo(Protocol):
    """Store of short verdicts by name, from which an interrupted study continues where it stopped."""

    def get(self, name: str) -> Any | None:
        """The JSON data stored under a name; None if there are none."""

    def put(self, name: str, result: Any) -> None:
        """Store JSON data under a name."""


@dataclass(frozen=True, kw_only=True)
class BuildStudy:
    """Result of a Monte Carlo study over manufactured units.

    Attributes
    ----------
    judged : text that names the judged pairs or location
    seed : seed of the draw
    as_designed : short verdict on the design itself, judged as the units are
    tolerances : the varied values, in the order of the columns of `values`
    values : (build, tolerance) drawn values, each in the unit of its tolerance
    deadband_mm, margin : (build,) summed deadband of each unit [mm] and its margin [noise units]; NaN where not judged
    in_doubt : (build,) whether the numerical error may change the verdict
    unjudged : number of units that could not be judged, by reason
    """

    judged: str
    seed: int
    as_designed: Brief
    tolerances: tuple[Tolerance, ...]
    values: FloatArray
    deadband_mm: FloatArray
    margin: FloatArray
    in_doubt: BoolArray
    unjudged: dict[str, int]

    @property
    def builds(self) -> int:
        """Number of units that were judged."""
        return int(np.isfinite(self.deadband_mm).sum())

    @property
    def kept(self) -> int:
        """Number of units that keep the design's verdict."""
        judged = self.deadband_mm[np.isfinite(self.deadband_mm)]
        return int(((judged > 0.0) == (self.as_designed.deadband_mm > 0.0)).sum())

    @property
    def kept_share(self) -> float:
        """Share of the judged units that keep the design's verdict [-]."""
        return self.kept / self.builds

    @property
    def kept_interval(self) -> tuple[float, float]:
        """Exact 95 % binomial interval of `kept_share` [-]."""
        from scipy.stats import binomtest  # its import takes long, and only a study needs it

        found = binomtest(self.kept, self.builds).proportion_ci(CONFIDENCE, method="exact")
        return float(found.low), float(found.high)

    @property
    def doubtful(self) -> int:
        """Number of judged units whose verdict the numerical error may change."""
        return int(self.in_doubt.sum())

    @property
    def firmness(self) -> FloatArray:
        """(build,) values that rank the units: the margin, or minus the deadband's length where there is a deadband."""
        return np.where(self.deadband_mm > 0.0, -self.deadband_mm, self.margin)

    def rank_correlations(self) -> tuple[tuple[float, float, float], ...]:
        """Spearman's correlation of each tolerance with `firmness`, and its 95 % interval (low, high).

        It is (0, -1, 1) if all units are equal, or fewer than 4 were judged.
        """
        from scipy.stats import spearmanr

        judged = np.isfinite(self.deadband_mm)
        firm, count = self.firmness[judged], int(judged.sum())
        if count < 4 or np.ptp(firm) == 0.0:
            return ((0.0, -1.0, 1.0),) * len(self.tolerances)
        return tuple(
            _with_interval(float(spearmanr(column, firm).statistic), count)
            for column in self.values[judged].T
        )

    @property
    def ranking(self) -> tuple[int, ...]:
        """Indices of the tolerances, the strongest rank correlation first."""
        strength = [abs(value) for value, _, _ in self.rank_correlations()]
        return tuple(sorted(range(len(strength)), key=lambda number: -strength[number]))

    def to_json(self) -> dict[str, Any]:
        """The study as plain data for JSON."""
        low, high = self.kept_interval
        correlations = self.rank_correlations()
        return {
            "judged": self.judged,
            "seed": self.seed,
            "builds": self.builds,
            "kept": self.kept,
            "kept_share": round(self.kept_share, 4),
            "kept_share_95": [round(low, 4), round(high, 4)],
            "in_doubt": self.doubtful,
            "unjudged": self.unjudged,
            "as_designed": _brief_json(self.as_designed),
            "deadband_mm_quantiles": _quantiles(self.deadband_mm),
            "margin_noise_units_quantiles": _quantiles(self.margin),
            "values": [
                {
                    **asdict(self.tolerances[number]),
                    "rank_correlation": round(correlations[number][0], 4),
                    "rank_correlation_95": [round(end, 4) for end in correlations[number][1:]],
                }
                for number in self.ranking
            ],
        }


def build_study(
    design: SensorDesign,
    tolerances: Sequence[Tolerance],
    judged: str,
    judge: BuildJudge,
    *,
    builds: int,
    seed: int,
    on_step: Callable[[float], None] | None = None,
) -> BuildStudy:
    """Judge units, each with all toleranced values drawn at once.

    Parameters
    ----------
    judge : function for the short verdict on a unit; it is called for the design itself first
    builds : number of units; a power of two covers the tolerances most evenly

    Raises
    ------
    InputError : the number of units is too small or too large, or no value varies.
    """
    if not FEWEST_BUILDS <= builds <= MOST_BUILDS:
        raise InputError(f"--builds: {builds} is refused: needs {FEWEST_BUILDS} to {MOST_BUILDS} units")
    if not tolerances:
        raise InputError("--tolerance: no value varies: each was measured or has a tolerance of 0")
    as_designed, values = judge(Draft.of(design)), drawn_values(tolerances, builds, seed)
    briefs: list[Brief | None] = []
    unjudged: dict[str, int] = {}
    for number, row in enumerate(values):
        changes = {one.path: float(value) for one, value in zip(tolerances, row, strict=True)}
        try:
            briefs.append(judge(Draft.of(design.with_(**changes))))
        except OptopadError as err:
            reason = str(err).split(":")[0]
            unjudged[reason] = unjudged.get(reason, 0) + 1
            briefs.append(None)
        if on_step is not None:
            on_step((number + 1) / builds)
    if not any(briefs):
        raise InputError(
            f"--tolerance: no manufactured unit could be judged ({', '.join(unjudged)}); narrow the tolerances"
        )
    return BuildStudy(
        judged=judged,
        seed=seed,
        as_designed=as_designed,
        tolerances=tuple(tolerances),
        values=values,
        deadband_mm=np.array([np.nan if one is None else one.deadband_mm for one in briefs]),
        margin=np.array([np.nan if one is None else one.margin for one in briefs]),
        in_doubt=np.array([one is not None and one.in_doubt for one in briefs]),
        unjudged=unjudged,
    )


def drawn_values(tolerances: Sequence[Tolerance], builds: int, seed: int) -> FloatArray:
    """(build, tolerance) values: scrambled Sobol points, mapped to each tolerance's distribution."""
    from scipy.stats import qmc

    sobol = qmc.Sobol(len(tolerances), scramble=True, rng=np.random.default_rng(seed))
    points = sobol.random_base2(ceil(log2(builds)))[:builds]
    columns = [_quantile(one, column) for one, column in zip(tolerances, points.T, strict=True)]
    return np.stack(columns, axis=1)


def remembered(judge: BuildJudge, memo: Memo | None, name: str) -> BuildJudge:
    """A judge that returns a unit's stored short verdict if there is one; otherwise it judges and stores the result."""
    if memo is None:
        return judge

    def recalled(build: Draft) -> Brief:
        key = f"{name} {build.design.digest}"
        earlier = memo.get(key)
        if earlier is not None:
            return Brief(**earlier)
        found = judge(build)
        memo.put(key, asdict(found))
        return found

    return recalled


def _quantile(tolerance: Tolerance, shares: FloatArray) -> FloatArray:
    from scipy.stats import truncnorm, uniform

    low, high = tolerance.low, tolerance.high
    if tolerance.distribution == "uniform":
        found = uniform.ppf(shares, loc=low, scale=high - low)
    else:
        sigma = (high - low) / (2.0 * CUT_SIGMA)
        found = truncnorm.ppf(shares, -CUT_SIGMA, CUT_SIGMA, loc=(low + high) / 2.0, scale=sigma)
    return np.asarray(found, dtype=np.float64)


def _with_interval(correlation: float, count: int) -> tuple[float, float, float]:
    """(correlation, low, high): Fisher's 95 % interval, widened for ranks (Fieller, Hartley and Pearson 1957)."""
    if not np.isfinite(correlation):
        return 0.0, -1.0, 1.0
    middle = np.arctanh(np.clip(correlation, -0.999999, 0.999999))
    half = NORMAL_95 * np.sqrt(1.06 / (count - 3))
    return correlation, float(np.tanh(middle - half)), float(np.tanh(middle + half))


def _brief_json(brief: Brief) -> dict[str, Any]:
    return {
        "deadband_mm": round(brief.deadband_mm, 4),
        "margin_noise_units": round(brief.margin, 3),
        "mode_gap_mm": None if brief.gap_mm is None else round(brief.gap_mm, 4),
    }


def _quantiles(values: FloatArray) -> dict[str, float]:
    shares = (5, 25, 50, 75, 95)
    found = np.nanpercentile(values, shares)
    return {f"{share} %": round(float(value), 4) for share, value in zip(shares, found, strict=True)}
