"""The verdict on a design: are the two modes contiguous, and where is depth not resolved?

    judged pairs, each under its own press ──► light ──► counts ──► modes, deadbands, strength
    locations in the workspace ──► all judged pairs ──► map of the pad
    unmeasured parameters, both ends of their bands ──► the governing pair again ──► confidence

Facing rows are judged pair by pair, the middle pair first. A pad is judged by all readings of a frame together
(`optopad.sims.verdict.pad_map`). It has a DEADBAND if at any location depth is not resolved over 0.3 mm or more, but is
resolved again deeper. If depth is not resolved again, the usable depth ends there.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from optopad.design.arrays import FloatArray
from optopad.design.circuit.transimpedance import given_ohms, settling_findings
from optopad.design.errors import ModelScopeError
from optopad.design.fields.finding import FAILS, OUT_OF_SCOPE, USUAL
from optopad.design.pad import Pad
from optopad.design.progress import OnStep
from optopad.design.shape.cavity import (
    CavityGeometry,
    is_facing_rows,
    judged_pairs,
    mask_of,
    pair_name,
)
from optopad.design.spec import SensorDesign
from optopad.sims.contact.pad_surface import contact_notes
from optopad.sims.readings.readout import Readout
from optopad.sims.score.build_tolerance import with_tolerance
from optopad.sims.score.field_steps import with_field_steps
from optopad.sims.score.judge import Judge, settings_of
from optopad.sims.score.result import ContinuityScore, JudgedPair, margin_caution, noise_caution
from optopad.sims.score.trials import with_trial
from optopad.sims.verdict.figure_errors import (
    boundary_forces,
    drawn_figures,
    figure_errors,
    figures_of,
    place_force,
)
from optopad.sims.verdict.pad_map import PadMap


def score(
    design: SensorDesign,
    *,
    fine: bool = False,
    full: bool = False,
    seed: int = 0,
    verdict_only: bool = False,
    tolerance: bool = True,
    on_judged: Callable[[ContinuityScore], None] | None = None,
    on_step: OnStep | None = None,
) -> ContinuityScore:
    """Verdict on a design, with all results that it follows from.

    Parameters
    ----------
    full : whether the map has 11 locations along the longer side and depth steps of 0.1 mm, instead of 5 locations and
        0.2 mm
    fine : same as `full`, with finer light, and with bounds at more depths
    seed : random seed of the light model
    verdict_only : whether to leave out everything that the verdict does not need: tolerance, sensitivity, bounds, and
        the map of facing rows
    tolerance : whether to add tolerance, sensitivity and a trial of changes that would help (`with_tolerance`,
        `with_field_steps`, `with_trial`)
    on_judged : called with the verdict, the map, the bounds and the pairs, before the errors of the pairs' figures and
        all that follows are computed
    on_step : called with the name of the running stage and the share of it that is done, 0 to 1

    Raises
    ------
    DesignError : the design breaks a rule (`optopad check` lists them).
    """
    pad = Pad.of(design)
    judge = Judge(pad, settings_of(fine=fine, full=full), seed=seed, on_step=on_step)
    base = _base_of(pad, seed=seed, fine=fine, full=full)
    try:
        found = _judged(judge, base, verdict_only=verdict_only)
        if on_judged is not None:
            on_judged(found)
        found = _with_figures(judge, pad, found)
    except ModelScopeError as err:
        left = tuple(str(one) for one in pad.findings if one.weight < OUT_OF_SCOPE)
        return replace(base, reason=str(err), warnings=left)
    if tolerance and not verdict_only:
        for added in (with_tolerance, with_field_steps, with_trial):
            found = added(design, found, seed=seed, on_step=judge.tell)
    return found


def verdict_of(
    design: SensorDesign, settings: str = "score", *, seed: int = 0, on_step: OnStep | None = None
) -> ContinuityScore:
    """The verdict, with the map of a pad or the pairs of facing rows, but without other stages.

    Parameters
    ----------
    settings : name of the settings in `optopad.sims.score.judge.SETTINGS`

    Raises
    ------
    DesignError : the design breaks a rule.
    """
    pad = Pad.of(design)
    base = _base_of(pad, seed=seed)
    try:
        return _with_verdict(Judge(pad, settings, seed=seed, on_step=on_step), base)
    except ModelScopeError as err:
        return replace(base, reason=str(err))


def _base_of(pad: Pad, *, seed: int, fine: bool = False, full: bool = False) -> ContinuityScore:
    """A score without results; until they are added, it is marked as out of the models' scope."""
    return ContinuityScore(
        verdict="OUT_OF_MODEL_SCOPE",
        reason="",
        digest=pad.design.digest,
        name=pad.design.name,
        seed=seed,
        fine=fine,
        full=full,
        is_facing_rows=is_facing_rows(pad.cavity),
    )


def _with_verdict(judge: Judge, base: ContinuityScore) -> ContinuityScore:
    """A score with the verdict, and with the map or the pairs from which it follows."""
    facing = judge.is_facing
    return replace(
        base,
        verdict=judge.verdict,
        deadbands_mm=judge.deadbands_mm,
        usable_depth_mm=judge.usable_depth_mm,
        usable_range_mm=judge.usable_range_mm,
        margin=judge.margin,
        is_open=judge.is_open,
        untouched_flux=judge.untouched,
        readout=judge.readout,
        governing=judge.governing.name if facing else None,
        pairs=judge.pairs if facing else (),
        pad_map=None if facing else judge.pad_map,
        pad_signals=None if facing else judge.pad_signals,
        causes=judge.causes,
        force=judge.force,
    )


def _judged(judge: Judge, base: ContinuityScore, *, verdict_only: bool) -> ContinuityScore:
    """A score with the results of the judge's stages, in the order of the progress lines."""
    _, pairs = judge.force, judge.pairs
    found = replace(_with_verdict(judge, base), governing=judge.governing.name, pairs=pairs)
    if not (judge.is_facing and verdict_only):
        found = replace(found, pad_map=judge.pad_map, pad_signals=judge.pad_signals)
    return found if verdict_only else replace(found, bounds=judge.bounds)


def _with_figures(judge: Judge, pad: Pad, found: ContinuityScore) -> ContinuityScore:
    """A score with its figures, with the loads and errors of its pairs, and with warnings."""
    facing = judge.is_facing
    judged, drawn = _with_errors(judge)
    governing = next(pair for pair in judged if pair.name == found.governing)
    shown = [k for k, pair in enumerate(judged) if not facing or pair is governing]
    worst = max(judged, key=lambda pair: pair.score.deadband_total_mm)
    headline = _headline(judged, governing, facing)
    return replace(
        found,
        worst_pair_mm=worst.score.deadband_total_mm,
        worst_pair=worst.name,
        mode_gap_mm=headline.gap_mm,
        continuity=headline.continuity,
        evenness=headline.evenness,
        strength=headline.strength,
        figure_errors=figure_errors(drawn[shown], np.stack([figures_of(judged[k].score) for k in shown])),
        pairs=judged,
        unjudged=_unjudged(judge.cavity, judge.untouched, judge.readout),
        clipped=tuple(pair.name for pair in judged if pair.score.is_clipped),
        warnings=_warnings(judge, pad, judged, found.pad_map, fine=found.fine),
    )


def _with_errors(judge: Judge) -> tuple[tuple[JudgedPair, ...], FloatArray]:
    """All pairs with loads and errors, and random samples of their figures within the error of the light trace."""
    pairs = judge.pairs
    drawn = drawn_figures([pair.curves for pair in pairs], [pair.score for pair in pairs], judge.readout)
    judged = []
    for pair, draws in zip(pairs, drawn, strict=True):
        force, is_at_place = place_force(judge.contact, pair.curves.press_mm)
        judged.append(
            replace(
                pair,
                forces=boundary_forces(pair.score.modes, force, is_at_place=is_at_place),
                errors=figure_errors(draws[None], figures_of(pair.score)[None]),
            )
        )
    return tuple(judged), drawn


@dataclass(frozen=True, kw_only=True)
class _Headline:
    gap_mm: float | None
    continuity: float
    evenness: float
    strength: dict[str, float]


def _headline(judged: tuple[JudgedPair, ...], governing: JudgedPair, facing: bool) -> _Headline:
    """Figures of the governing facing pair, or for a pad the medians over judged pairs."""
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
    judge: Judge,
    pad: Pad,
    judged: tuple[JudgedPair, ...],
    pad_map: PadMap | None,
    *,
    fine: bool,
) -> tuple[str, ...]:
    """All warnings about the design and its verdict, those of largest weight first."""
    circuit, findings = pad.circuit, pad.findings
    if given_ohms(circuit) is None:  # resistors by a rule follow from the light
        gains = judge.readout.of_each(len(judge.cavity.receivers))
        findings = (*findings, *settling_findings(circuit, gains))
    found = [(one.weight, str(one)) for one in findings]
    clipped = [pair.name for pair in judged if pair.score.is_clipped]
    if clipped:
        words = (
            f"{len(clipped)} of {len(judged)} pairs clip with a target of {pad.design.gain.target_counts:g} counts, "
            f"which costs the resolution near the surface ({', '.join(clipped[:8])}); set gain.feedback_ohm = 'each', "
            "or lower gain.target_counts"
        )
        found.append((FAILS, words))
    if pad_map is not None and not judge.is_facing:
        found += [(FAILS, text) for text in margin_caution(pad_map)]
    if said := noise_caution(judged, fine=fine):
        found.append((FAILS, said))
    found += [(USUAL, text) for text in contact_notes(judge.contact)]
    return tuple(text for _, text in sorted(found, key=lambda one: -one[0]))
