"""The verdict on a design: are the two modes contiguous, and where is the sensor blind to depth?

    judged pairs, each under its own press ──► light ──► counts ──► modes, deadbands, strength
    places of the workspace ──► judged pairs together ──► map of the pad
    open values, both ends of their bands ──► the governing pair again ──► how firm it is

Facing rows: the verdict is that of the facing pairs, the middle one first (it governs). Pads: by all judged readings of
a frame together (`sims.verdict.frame_depths`): DEADBAND if some place is blind over 0.3 mm of depth or more and sees
again below; where it stays blind, the usable depth ends.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from design.circuit.transimpedance import given_ohms, settling_findings
from design.errors import ModelScopeError
from design.geometry.cavity import CavityGeometry, cavity_of
from design.geometry.pairs import is_facing_rows, judged_pairs, mask_of, pair_name
from design.rules.check import check, require_valid
from design.spec import SensorDesign
from sims.bounds.observability import PadBounds
from sims.contact.force_curve import ForceCurve, force_curve
from sims.contact.indentation import solved_press
from sims.contact.press_notes import contact_notes
from sims.continuity.build_tolerance import with_tolerance
from sims.continuity.cautions import margin_caution, noise_caution
from sims.continuity.field_steps import with_field_steps
from sims.continuity.map_bounds import map_bounds
from sims.continuity.map_judging import judged_map, pad_place
from sims.continuity.result import ContinuityScore, JudgedPair, Verdict
from sims.optics.accuracy import Accuracy
from sims.optics.light_signals import LightSignals
from sims.press.depths import depth_schedule_mm
from sims.readings.readout import Readout, readout_of
from sims.verdict.boundary_forces import boundary_forces, place_force
from sims.verdict.builds import score_curves
from sims.verdict.causes import Cause, causes_of_pad, causes_of_pairs
from sims.verdict.figure_errors import drawn_figures, figure_errors, figures_of
from sims.verdict.pad_map import PadMap
from sims.verdict.pair.defaults import DEADBAND_MIN_LENGTH_MM, TRACE_ERROR_LIMIT
from sims.verdict.pair.pair_score import PairScore
from sims.verdict.presses import (
    PAIR_ACCURACY,
    SECOND_SEED,
    PairCurves,
    pair_curves,
    untouched_flux,
)

FloatArray = NDArray[np.float64]
OnStep = Callable[[str, float], None]


def score(
    design: SensorDesign,
    *,
    fine: bool = False,
    full: bool = False,
    seed: int = 0,
    verdict_only: bool = False,
    tolerance: bool = True,
    on_step: OnStep | None = None,
) -> ContinuityScore:
    """Judge a design.

    Parameters
    ----------
    full : 11 places along the longer side and 0.1 mm steps for the map, in place of 5 and 0.2 mm
    fine : the same, with finer light, and bounds at more depths
    seed : of the light model's random shifts
    verdict_only : leave out what the verdict does not need: tolerance, what matters, and the map of facing rows
    tolerance : try both ends of every open value and a step of each field, as `with_tolerance` and `with_field_steps`
        do afterwards
    on_step : called with the stage's name and the share of it that is done

    Raises
    ------
    DesignError : the design breaks a rule (`optopad check` lists them).
    """
    require_valid(design)
    tell = on_step or (lambda _stage, _share: None)
    try:
        return _judged(
            design,
            fine=fine,
            full=full,
            seed=seed,
            verdict_only=verdict_only,
            tolerance=tolerance,
            tell=tell,
        )
    except ModelScopeError as err:
        return _out_of_scope(design, str(err), fine=fine, full=full, seed=seed)


def _judged(
    design: SensorDesign,
    *,
    fine: bool,
    full: bool,
    seed: int,
    verdict_only: bool,
    tolerance: bool,
    tell: OnStep,
) -> ContinuityScore:
    cavity = cavity_of(design)
    require_judgeable_depth(design)
    force = centred_force(design, lambda share: tell("contact", share))
    depth_mm = depth_schedule_mm(design.operating.max_depth_mm)
    flat = untouched_flux(design, cavity, seed=seed)
    pairs = judged_pairs(cavity)
    readout = readout_of(design, flat, mask_of(pairs, cavity))
    curves = pair_curves(
        design,
        cavity,
        pairs,
        depth_mm,
        accuracy="fine" if fine else PAIR_ACCURACY,
        seed=seed,
        on_step=lambda share: tell("pairs", share),
    )
    judged, drawn = _judged_pairs(design, cavity, curves, readout)
    facing = is_facing_rows(cavity)
    pairs_open = facing and _pairs_are_open(
        design, cavity, judged, readout, "fine" if fine else PAIR_ACCURACY, seed, tell
    )
    pad_map, pad_signals = None, None
    if not (facing and verdict_only):
        pad_map, pad_signals = judged_map(design, cavity, readout, fine=fine, full=full, seed=seed, tell=tell)
    bounds = None
    if not verdict_only and pad_map is not None and pad_signals is not None:
        bounds = map_bounds(
            design,
            pad_map,
            pad_signals,
            readout,
            fine=fine,
            seed=seed,
            on_step=lambda share: tell("bounds", share),
        )
    found = _assembled(
        design,
        cavity,
        judged,
        drawn,
        pad_map,
        pad_signals,
        readout,
        flat,
        force,
        bounds,
        pairs_open=pairs_open,
        fine=fine,
        full=full,
        seed=seed,
    )
    if tolerance and not verdict_only:
        return with_field_steps(
            design, with_tolerance(design, found, seed=seed, on_step=tell), seed=seed, on_step=tell
        )
    return found


def _judged_pairs(
    design: SensorDesign, cavity: CavityGeometry, curves: tuple[PairCurves, ...], readout: Readout
) -> tuple[tuple[JudgedPair, ...], FloatArray]:
    """All pairs, and their figures drawn again within the trace's error."""
    scores = [score_curves(design, of_pair, readout) for of_pair in curves]
    drawn = drawn_figures(design, curves, scores, readout)
    errors = [
        figure_errors(draws[None], figures_of(score)[None])
        for draws, score in zip(drawn, scores, strict=True)
    ]
    judged = (_judged_pair(design, cavity, *one) for one in zip(curves, scores, errors, strict=True))
    return tuple(judged), drawn


def _judged_pair(
    design: SensorDesign,
    cavity: CavityGeometry,
    curves: PairCurves,
    scored: PairScore,
    errors: dict[str, float],
) -> JudgedPair:
    force, is_at_place = place_force(design, curves.press_mm)
    return JudgedPair(
        name=pair_name(cavity, curves.pair),
        curves=curves,
        score=scored,
        forces=boundary_forces(scored.modes, force, is_at_place=is_at_place),
        errors=errors,
    )


def require_judgeable_depth(design: SensorDesign) -> None:
    """Refuse a range of use in which no deadband could be (ModelScopeError)."""
    if design.operating.max_depth_mm < DEADBAND_MIN_LENGTH_MM:
        raise ModelScopeError(
            f"operating.max_depth_mm: {design.operating.max_depth_mm:g} mm is less than a deadband's least length, "
            f"{DEADBAND_MIN_LENGTH_MM:g} mm, so nothing can be judged; raise it"
        )


def centred_force(design: SensorDesign, on_step: Callable[[float], None]) -> ForceCurve:
    """Load of the centred press at the depths of a score."""
    press = solved_press(design, on_step=on_step)
    return force_curve(design, press, depth_schedule_mm(design.operating.max_depth_mm))


def governing_pair(judged: tuple[JudgedPair, ...], facing: bool) -> JudgedPair:
    """The middle facing pair, or the worst one if only another has a deadband.

    Of a pad: the pair with most deadband, then least evenness, clipped ones last.
    """
    if facing:
        worst = max(judged, key=lambda pair: pair.score.deadband_total_mm)
        return judged[0] if judged[0].score.deadbands_mm else worst
    return max(
        judged,
        key=lambda pair: (not pair.score.is_clipped, pair.score.deadband_total_mm, -pair.score.evenness),
    )


def _assembled(
    design: SensorDesign,
    cavity: CavityGeometry,
    judged: tuple[JudgedPair, ...],
    drawn: FloatArray,
    pad_map: PadMap | None,
    pad_signals: LightSignals | None,
    readout: Readout,
    flat: FloatArray,
    force: ForceCurve,
    bounds: PadBounds | None,
    *,
    pairs_open: bool,
    fine: bool,
    full: bool,
    seed: int,
) -> ContinuityScore:
    facing = is_facing_rows(cavity)
    governing = governing_pair(judged, facing)
    deadbands = pad_map.worst.deadbands_mm if pad_map and not facing else governing.score.deadbands_mm
    found = any(pair.score.deadbands_mm for pair in judged) if facing else bool(deadbands)
    headline = _headline(judged, governing, facing)
    shown = [k for k, pair in enumerate(judged) if not facing or pair is governing]
    worst = max(judged, key=lambda pair: pair.score.deadband_total_mm)
    usable_mm, usable_range_mm = _usable(design, judged, pad_map, facing=facing)
    verdict: Verdict = "DEADBAND" if found else "CONTIGUOUS"
    return ContinuityScore(
        verdict=verdict,
        reason="",
        digest=design.digest,
        name=design.name,
        seed=seed,
        fine=fine,
        full=full,
        is_facing_rows=facing,
        deadbands_mm=tuple(deadbands),
        usable_depth_mm=usable_mm,
        usable_range_mm=usable_range_mm,
        is_open=pairs_open if facing or pad_map is None else pad_map.is_open,
        governing=governing.name,
        worst_pair_mm=worst.score.deadband_total_mm,
        worst_pair=worst.name,
        mode_gap_mm=headline.gap_mm,
        continuity=headline.continuity,
        evenness=headline.evenness,
        strength=headline.strength,
        figure_errors=figure_errors(drawn[shown], np.stack([figures_of(judged[k].score) for k in shown])),
        pairs=judged,
        unjudged=_unjudged(cavity, flat, readout),
        clipped=tuple(pair.name for pair in judged if pair.score.is_clipped),
        untouched_flux=flat,
        readout=readout,
        pad_map=pad_map,
        pad_signals=pad_signals,
        causes=_causes(design, judged, pad_map, pad_signals, readout),
        bounds=bounds,
        force=force,
        warnings=_warnings(design, judged, pad_map, readout.of_each(len(cavity.receivers))),
    )


def _causes(
    design: SensorDesign,
    judged: tuple[JudgedPair, ...],
    pad_map: PadMap | None,
    pad_signals: LightSignals | None,
    readout: Readout,
) -> tuple[Cause, ...]:
    if is_facing_rows(cavity_of(design)):
        return causes_of_pairs(design, [(pair.curves, pair.score) for pair in judged], readout)
    if pad_map is None or pad_signals is None:
        return ()
    return causes_of_pad(design, pad_map, pad_signals, readout)


def _usable(
    design: SensorDesign, judged: tuple[JudgedPair, ...], pad_map: PadMap | None, *, facing: bool
) -> tuple[float, tuple[float, float]]:
    """Depth to which depth is told, and what the light's error leaves of it; of the pad, or of the facing pairs."""
    if pad_map is not None and not facing:
        return pad_map.usable_depth_mm, pad_map.usable_range_mm
    usable = usable_of_pairs(design, judged)
    return usable, (usable, usable)


def usable_of_pairs(design: SensorDesign, judged: tuple[JudgedPair, ...]) -> float:
    """Least depth of any facing pair from which on its depth is not told any more, or the deepest press [mm]."""
    ends = [pair.score.saturation_mm[0] for pair in judged if pair.score.saturation_mm is not None]
    return min([*ends, design.operating.max_depth_mm])


def _pairs_are_open(
    design: SensorDesign,
    cavity: CavityGeometry,
    judged: tuple[JudgedPair, ...],
    readout: Readout,
    accuracy: str | Accuracy,
    seed: int,
    tell: OnStep,
) -> bool:
    """Whether the light's own error may make or hide every deadband of facing pairs, asked of a second trace.

    Two traces err independently of each other, so what both agree on is no error (`sims.verdict.frame_depths`).
    """
    if any(pair.score.deadbands_mm for pair in judged):
        return False
    doubtful = [
        pair
        for pair in judged
        if pair.score.possible_deadbands_mm and (pair.score.noise_margin or 0.0) > TRACE_ERROR_LIMIT
    ]
    if not doubtful:
        return False
    again = pair_curves(
        design,
        cavity,
        tuple(pair.curves.pair for pair in doubtful),
        judged[0].curves.depth_mm,
        accuracy=accuracy,
        seed=seed + SECOND_SEED,
        on_step=lambda share: tell("open pairs", share),
    )
    for pair, second in zip(doubtful, again, strict=True):
        halves = np.stack([pair.curves.total, second.total])[..., np.newaxis] * readout.of_receiver(
            second.pair[1]
        )
        place = pad_place(
            design,
            np.array(second.press_mm),
            second.depth_mm,
            halves,
            np.zeros_like(halves[0]),
            readout.full_scale_counts,
        )
        if place.depths.is_open or place.deadbands_mm:
            return True
    return False


@dataclass(frozen=True, kw_only=True)
class _Headline:
    gap_mm: float | None
    continuity: float
    evenness: float
    strength: dict[str, float]


def _headline(judged: tuple[JudgedPair, ...], governing: JudgedPair, facing: bool) -> _Headline:
    """The governing facing pair's figures; for a pad the medians over judged pairs."""
    shown = (governing,) if facing else judged
    gaps = [pair.score.modes.gap_mm for pair in shown]
    closed = [np.inf if gap is None else gap for gap in gaps]
    median_gap = float(np.median(closed))
    return _Headline(
        gap_mm=median_gap if np.isfinite(median_gap) else None,
        continuity=float(np.median([pair.score.continuity for pair in shown])),
        evenness=float(np.median([pair.score.evenness for pair in shown])),
        strength={
            "untouched_flux": float(np.median([pair.curves.total[0] for pair in shown])),
            "untouched_counts": float(np.median([pair.score.strength.untouched_counts for pair in shown])),
            "swing": float(np.median([pair.score.strength.swing for pair in shown])),
            "resolvable_steps": float(np.median([pair.score.strength.resolvable_steps for pair in shown])),
        },
    )


def _unjudged(cavity: CavityGeometry, flat: FloatArray, readout: Readout) -> dict[str, float]:
    counts = readout.counts(flat)
    judged = mask_of(judged_pairs(cavity), cavity)
    return {pair_name(cavity, (int(i), int(j))): float(counts[i, j]) for i, j in np.argwhere(~judged)}


def _warnings(
    design: SensorDesign, judged: tuple[JudgedPair, ...], pad_map: PadMap | None, gains: tuple[float, ...]
) -> tuple[str, ...]:
    found = [str(finding) for finding in check(design)]  # errors were refused before
    if given_ohms(design) is None:  # resistors by a rule are known with the light alone
        found += [str(finding) for finding in settling_findings(design, gains)]
    found += contact_notes(design)
    found += filter(None, [noise_caution(judged)])
    if pad_map is not None and not is_facing_rows(cavity_of(design)):
        found += margin_caution(pad_map)
    clipped = [pair.name for pair in judged if pair.score.is_clipped]
    if clipped:
        found.append(
            f"{len(clipped)} of {len(judged)} judged pairs read above full scale at their gain and are "
            f"blind while they do: {', '.join(clipped[:8])}; set gain.feedback_ohm = 'each', or lower "
            "gain.target_counts"
        )
    return tuple(found)


def _out_of_scope(design: SensorDesign, reason: str, *, fine: bool, full: bool, seed: int) -> ContinuityScore:
    return ContinuityScore(
        verdict="OUT_OF_MODEL_SCOPE",
        reason=reason,
        digest=design.digest,
        name=design.name,
        seed=seed,
        fine=fine,
        full=full,
        is_facing_rows=is_facing_rows(cavity_of(design)),
        warnings=tuple(str(finding) for finding in check(design)),
    )
