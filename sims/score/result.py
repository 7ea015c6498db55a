"""The result of a score: verdict, pairs, pad, tolerance and warnings, and its form as plain data for JSON.

The text of a verdict is the same wherever it is shown, and says if the verdict is undecided. Warnings say how close the
verdict is to changing, and on which unmeasured parameters it depends.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from optopad.design.arrays import FloatArray
from optopad.sims.bounds.observability import PadBounds, bounds_json
from optopad.sims.contact.force_curve import ForceCurve
from optopad.sims.optics.accuracy import LightSignals
from optopad.sims.readings.readout import Readout
from optopad.sims.verdict.builds import BuildStudy
from optopad.sims.verdict.causes import Cause, Rise, rise_of
from optopad.sims.verdict.depth_curve import DEADBAND_THRESHOLD, TRACE_ERROR_LIMIT, trace_noise_warning
from optopad.sims.verdict.figure_errors import BoundaryForces, mode_errors_mm
from optopad.sims.verdict.pad_map import PadMap
from optopad.sims.verdict.pair_score import PairScore
from optopad.sims.verdict.presses import PairCurves
from optopad.sims.verdict.tolerance import FieldSteps, ToleranceBand, ToleranceRow
from optopad.sims.verdict.trial import Trial

RESTS, UNDECIDED = "the verdict rests on unmeasured parameters", "the verdict is undecided"
"""Beginnings of two warnings that the screen shows on a line of their own."""
NEGLIGIBLE_MM = 5e-4
"""Difference up to which a usable depth counts as equal to the required depth [mm], since stored values are rounded."""


def headline(
    verdict: str,
    *,
    is_open: bool,
    usable_mm: float | None,
    asked_mm: float | None,
    is_short: bool = False,
) -> str:
    """Text of the verdict; it also says if the verdict is undecided, and the usable depth if the design requires more.

    Parameters
    ----------
    is_open : whether the numerical error of the light model leaves the verdict undecided
    usable_mm, asked_mm : usable depth, and deepest press that the design requires [mm]; None if nothing was judged
    is_short : whether to use the short form for a table column
    """
    words = f"{verdict}, undecided" if is_open else verdict
    if usable_mm is None or asked_mm is None or usable_mm > asked_mm - NEGLIGIBLE_MM:
        return words
    joint = " to" if words == "CONTIGUOUS" else ", to" if is_open else ", usable to"
    asked = f"{asked_mm:g} mm" if is_short else f"the {asked_mm:g} mm required"
    return f"{words}{joint} {_depth(usable_mm, asked_mm)} of {asked}"


def _depth(usable_mm: float, asked_mm: float) -> str:
    """A usable depth rounded to a tenth of a millimetre, or with enough digits to differ from the required depth."""
    digits = next(n for n in (1, 2, 3) if n == 3 or round(usable_mm, n) < asked_mm - NEGLIGIBLE_MM)
    return f"{usable_mm:.{digits}f}"


def margin_caution(pad_map: PadMap) -> list[str]:
    """A list with one warning if the numerical error leaves a pad's verdict undecided; otherwise an empty list."""
    if not pad_map.is_open:
        return []
    place = min((one for one in pad_map.places if one.depths.most.deadbands_mm), key=lambda one: one.margin)
    start, end = place.depths.margin_mm
    return [
        f"{UNDECIDED} at ({place.x_mm:g}, {place.y_mm:g}) mm: frames from {start:.2f} to {end:.2f} mm deep differ by "
        f"{place.margin:.1f} ± {place.depths.margin_error:.1f} sigma (numerical error of the light model), and a "
        f"deadband is below {DEADBAND_THRESHOLD:g} sigma; run with --fine"
    ]


def band_caution(band: ToleranceBand | None) -> str | None:
    """Warning that names the unmeasured parameters behind the verdict, strongest effect first; None if none."""
    if band is None or not (band.rows or band.unbanded):
        return None
    ranked = [f"{row.path} {row.values[0]:.3g} to {row.values[1]:.3g} ({_effect(row)})" for row in band.rows]
    others = [f"{path} (no uncertainty band)" for path in band.unbanded] + [
        f"{text} (not tried)" for text in band.untried
    ]
    return (
        f"{RESTS}, varied for {band.judged} (deadband {band.deadband_mm:.2f} mm, margin {band.margin:.0f} sigma): "
        + "; ".join(ranked + others)
    )


def _effect(row: ToleranceRow) -> str:
    dead, margin = row.deadband_mm, row.margin
    changes = ", changes the verdict" if row.flips else ""
    deadband = f"deadband {dead[0]:.2f} to {dead[1]:.2f} mm"
    return f"{row.confidence}: {deadband}, margin {margin[0]:.0f} to {margin[1]:.0f} sigma{changes}"


def noise_caution(judged: tuple[JudgedPair, ...], *, fine: bool = False) -> str | None:
    """Warning if the numerical error of the light model is large enough to look like a signal; otherwise None."""
    margins = [pair.score.noise_margin for pair in judged if pair.score.noise_margin is not None]
    if not margins or max(margins) <= TRACE_ERROR_LIMIT:
        return None
    return trace_noise_warning(max(margins), fine=fine)


Verdict = Literal["CONTIGUOUS", "DEADBAND", "OUT_OF_MODEL_SCOPE"]
Interval = tuple[float, float]


@dataclass(frozen=True, kw_only=True)
class JudgedPair:
    """One judged pair: its name, signal against depth, score, loads and errors.

    `name` is, for example, E1-R3. `forces` are the loads at the boundaries of the modes, and `errors` the standard
    errors of the figures by name (`optopad.sims.verdict.figure_errors`). Both are None if not computed.
    """

    name: str
    curves: PairCurves
    score: PairScore
    forces: BoundaryForces | None = None
    errors: dict[str, float] | None = None


@dataclass(frozen=True, kw_only=True)
class KeyFigures:
    """The verdict on a design and its most important figures.

    Attributes
    ----------
    verdict : CONTIGUOUS, DEADBAND or OUT_OF_MODEL_SCOPE
    reason : why the models do not cover the design; empty if they do
    deadbands_mm : depths (from, to) of each deadband of the governing facing pair, or of the worst location of the pad
        [mm]
    usable_depth_mm : least depth at which any location, or any facing pair, stops resolving depth, or the deepest press
        [mm]; None if nothing was judged
    is_open : whether the numerical error of the light model leaves the verdict undecided
    mode_gap_mm : difference in depth from the end of mode 1 to the start of mode 2, for the governing facing pair or as
        the median over judged pairs [mm]; None if mode 2 does not start
    continuity, evenness : figures of the governing facing pair, or medians over judged pairs [-]
    strength : baseline light and counts, swing, resolvable steps
    warnings : limits to the validity of the verdict
    """

    verdict: Verdict
    reason: str = ""
    deadbands_mm: tuple[Interval, ...] = ()
    usable_depth_mm: float | None = None
    is_open: bool = False
    mode_gap_mm: float | None = None
    continuity: float | None = None
    evenness: float | None = None
    strength: dict[str, float] | None = None
    warnings: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class ContinuityScore(KeyFigures):
    """The verdict on a design, with all results that it follows from.

    Attributes
    ----------
    digest, name : the scored design's digest and name
    seed, fine, full : arguments of `optopad.sims.score.scoring.score`
    is_facing_rows : whether the verdict is on facing pairs (True) or on a pad (False)
    usable_range_mm : smallest and largest usable depth within the numerical error of the light model [mm]
    margin : least difference between frames (pad), or least change of the signal (facing pair), over 0.3 mm of depth
        within the usable range [noise units]; a margin below 3 means a deadband
    governing : name of the pair that represents the others (`optopad.sims.score.judge.governing_pair`)
    worst_pair_mm, worst_pair : total deadband of the judged pair that has most [mm], and its name
    figure_errors : standard errors of continuity, evenness and strength by name; None if not computed
    untouched_flux : (emitter, receiver) received divided by emitted power on the untouched pad [-]
    pairs : judged pairs
    unjudged : untouched counts of all pairs that are not judged, by name
    clipped : names of the judged pairs whose readings exceed full scale
    tolerance : verdict at both ends of the uncertainty band of each unmeasured parameter; None if not computed
    builds : Monte Carlo simulation of manufactured units; None if not requested
    steps : sensitivity to a small step of each field; None if not computed
    pad_map, pad_signals : the judged locations of the workspace, and the light at them
    causes : reasons why depth is not resolved: one for each interval of depth concerned, at a location or for a facing
        pair, the worst first
    trial : effect of changed component heights or layer thickness on the worst of these intervals; None if not tried
    bounds : lower bounds on the errors of a press's location and depth from one frame; None if only the verdict was
        computed
    """

    digest: str
    name: str
    seed: int
    fine: bool
    is_facing_rows: bool
    full: bool = False
    usable_range_mm: Interval | None = None
    margin: float | None = None
    governing: str | None = None
    worst_pair_mm: float | None = None
    worst_pair: str | None = None
    figure_errors: dict[str, float] | None = None
    pairs: tuple[JudgedPair, ...] = ()
    unjudged: dict[str, float] = field(default_factory=dict)
    clipped: tuple[str, ...] = ()
    untouched_flux: FloatArray | None = None
    readout: Readout | None = None
    pad_map: PadMap | None = None
    pad_signals: LightSignals | None = None
    causes: tuple[Cause, ...] = ()
    bounds: PadBounds | None = None
    force: ForceCurve | None = None
    tolerance: ToleranceBand | None = None
    builds: BuildStudy | None = None
    steps: FieldSteps | None = None
    trial: Trial | None = None

    @property
    def deadband_total_mm(self) -> float:
        """Total length of `deadbands_mm` [mm]."""
        return sum(end - start for start, end in self.deadbands_mm)

    @property
    def rise(self) -> Rise | None:
        """The judged pair whose reading rises most above untouched under any press of the map; None if none rises."""
        if self.pad_signals is None or self.pad_signals.presses.ndim != 2:
            return None
        return rise_of(self.pad_signals, {pair.name: pair.curves.pair for pair in self.pairs})

    @property
    def pairs_with_deadband(self) -> int:
        """Number of judged pairs that have a deadband of their own."""
        return sum(bool(pair.score.deadbands_mm) for pair in self.pairs)

    def to_json(self) -> dict[str, Any]:
        """The score as plain data for JSON; missing or infinite numbers are None."""
        return {
            "name": self.name,
            "digest": self.digest,
            "verdict": self.verdict,
            "reason": self.reason,
            "deadband_mm": {
                "total": None if self.verdict == "OUT_OF_MODEL_SCOPE" else _rounded(self.deadband_total_mm),
                "worst_pair": _rounded(self.worst_pair_mm),
                "intervals": [[_rounded(start), _rounded(end)] for start, end in self.deadbands_mm],
            },
            "usable_depth_mm": _rounded(self.usable_depth_mm),
            "usable_range_mm": None
            if self.usable_range_mm is None
            else [_rounded(v) for v in self.usable_range_mm],
            "margin_noise_units": _rounded(self.margin),
            "is_open": self.is_open,
            "worst_pair": self.worst_pair,
            "governing_pair": self.governing,
            "pairs_with_deadband": {"count": self.pairs_with_deadband, "judged": len(self.pairs)},
            "mode_gap_mm": _rounded(self.mode_gap_mm),
            "continuity": _rounded(self.continuity),
            "evenness": _rounded(self.evenness),
            "strength": None if self.strength is None else {k: _rounded(v) for k, v in self.strength.items()},
            "figure_errors": _errors_json(self.figure_errors),
            "judged_by": "facing pairs" if self.is_facing_rows else "pad",
            "pairs": [_pair_json(pair) for pair in self.pairs],
            "unjudged_untouched_counts": {name: _rounded(value) for name, value in self.unjudged.items()},
            "clipped": list(self.clipped),
            "counts_per_flux": None if self.readout is None else _rounded(self.readout.counts_per_flux),
            "receiver_counts_per_flux": _gains_json(self.readout, self.untouched_flux),
            "untouched_flux": None if self.untouched_flux is None else _rows(self.untouched_flux),
            "map": None if self.pad_map is None else _map_json(self.pad_map),
            "causes": [cause.to_json() for cause in self.causes],
            "rises": None if (rise := self.rise) is None else rise.to_json(),
            "bounds": None if self.bounds is None else bounds_json(self.bounds),
            "force": None if self.force is None else _force_json(self.force),
            "tolerance": None if self.tolerance is None else self.tolerance.to_json(),
            "builds": None if self.builds is None else self.builds.to_json(),
            "what_matters": None if self.steps is None else self.steps.to_json(),
            "trial": None if self.trial is None else self.trial.to_json(),
            "seed": self.seed,
            "fine": self.fine,
            "full": self.full,
            "warnings": list(self.warnings),
        }


def _gains_json(readout: Readout | None, untouched_flux: FloatArray | None) -> list[float | None] | None:
    if readout is None or untouched_flux is None:
        return None
    return [_rounded(gain) for gain in readout.of_each(untouched_flux.shape[1])]


def _rows(values: FloatArray) -> list[list[float | None]]:
    return [[_rounded(value) for value in row] for row in values.tolist()]


def _rounded(value: float | None) -> float | None:
    return None if value is None or not np.isfinite(value) else float(f"{value:.6g}")


def _errors_json(errors: dict[str, float] | None) -> dict[str, float | None] | None:
    return None if errors is None else {name: _rounded(error) for name, error in errors.items()}


def _pair_json(pair: JudgedPair) -> dict[str, Any]:
    score, modes = pair.score, pair.score.modes
    errors1, errors2 = mode_errors_mm(pair.curves, modes)
    return {
        "pair": pair.name,
        "press_mm": [_rounded(value) for value in pair.curves.press_mm],
        "mode1_mm": [_rounded(value) for value in modes.mode1_mm],
        "mode2_mm": [_rounded(value) for value in modes.mode2_mm],
        "mode1_error_mm": [_rounded(value) for value in errors1],
        "mode2_error_mm": [_rounded(value) for value in errors2],
        "mode_forces_n": None if pair.forces is None else pair.forces.to_json(),
        "mode_gap_mm": _rounded(modes.gap_mm),
        "mode_gap_at_least_mm": _rounded(modes.gap_at_least_mm),
        "end_mm": _rounded(score.end_mm),
        "deadbands_mm": [[_rounded(start), _rounded(end)] for start, end in score.deadbands_mm],
        "saturation_mm": None if score.saturation_mm is None else [_rounded(v) for v in score.saturation_mm],
        "continuity": _rounded(score.continuity),
        "evenness": _rounded(score.evenness),
        "untouched_counts": _rounded(score.strength.untouched_counts),
        "swing": _rounded(score.strength.swing),
        "resolvable_steps": _rounded(score.strength.resolvable_steps),
        "errors": _errors_json(pair.errors),
        "clipped_share": _rounded(score.clipped_share),
        "noise_margin": _rounded(score.noise_margin),
    }


def _map_json(pad_map: PadMap) -> dict[str, Any]:
    return {
        "x_mm": list(pad_map.x_mm),
        "y_mm": list(pad_map.y_mm),
        "deadband_mm": _rows(pad_map.deadband_grid_mm().round(4)),
        "dead_share": _rounded(pad_map.dead_share),
        "usable_mm": _rows(pad_map.usable_grid_mm().round(4)),
        "margin_noise_units": _in_a_row(pad_map, [place.margin for place in pad_map.places]),
        "trace_error_noise_units": _in_a_row(
            pad_map, [place.depths.margin_error for place in pad_map.places]
        ),
        "weakest_place_mm": [_rounded(pad_map.weakest.x_mm), _rounded(pad_map.weakest.y_mm)],
        "worst_place_mm": [_rounded(pad_map.worst.x_mm), _rounded(pad_map.worst.y_mm)]
        if pad_map.worst.deadbands_mm
        else None,
    }


def _in_a_row(pad_map: PadMap, of_places: list[float]) -> list[float | None]:
    """The map's values in one list, ordered by y and then x, rounded to three digits; None outside the workspace."""
    return [value for row in _rows(pad_map.grid([round(one, 3) for one in of_places])) for value in row]


def _force_json(force: ForceCurve) -> dict[str, list[float]]:
    return {
        "depth_mm": force.depth_mm.round(4).tolist(),
        "force_n": force.force_n.round(4).tolist(),
        "low_n": force.low_n.round(4).tolist(),
        "high_n": force.high_n.round(4).tolist(),
        "contact_radius_mm": force.contact_radius_mm.round(4).tolist(),
    }
