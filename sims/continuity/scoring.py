"""The verdict on a design: are the two modes contiguous, and where is the sensor blind to depth?

    judged pairs, each under its own press ──► light ──► counts ──► modes, deadbands, strength
    places of the workspace ──► judged pairs together ──► map of the pad
    open values, both ends of their bands ──► the governing pair again ──► how firm it is

Facing rows: the verdict is that of the facing pairs, the middle one first (it governs). Pads: by all judged readings of
a frame together (`sims.verdict.frame_depths`): DEADBAND if some place is blind over 0.3 mm of depth or more and sees
again below; where it stays blind, the usable depth ends.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from design.arrays import FloatArray
from design.circuit.transimpedance import given_ohms, settling_findings
from design.errors import ModelScopeError
from design.progress import OnStep
from design.rules.check import check, require_valid
from design.shape.cavity import CavityGeometry, cavity_of
from design.shape.pairs import is_facing_rows, judged_pairs, mask_of, pair_name
from design.spec import SensorDesign
from sims.contact.press_notes import contact_notes
from sims.continuity.build_tolerance import with_tolerance
from sims.continuity.cautions import margin_caution, noise_caution
from sims.continuity.field_steps import with_field_steps
from sims.continuity.judge import Judge
from sims.continuity.result import ContinuityScore, JudgedPair
from sims.continuity.settings import settings_of
from sims.continuity.trials import with_trial
from sims.readings.readout import Readout
from sims.verdict.boundary_forces import boundary_forces, place_force
from sims.verdict.figure_errors import drawn_figures, figure_errors, figures_of
from sims.verdict.pad_map import PadMap


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
    tolerance : try both ends of every open value, a step of each field, and moves that would help, as
        `with_tolerance`, `with_field_steps` and `with_trial` do afterwards
    on_step : called with the stage's name and the share of it that is done

    Raises
    ------
    DesignError : the design breaks a rule (`optopad check` lists them).
    """
    require_valid(design)
    judge = Judge(design, settings_of(fine=fine, full=full), seed=seed, on_step=on_step)
    base = _base_of(design, seed=seed, fine=fine, full=full)
    try:
        found = _scored(judge, base, verdict_only=verdict_only)
    except ModelScopeError as err:
        return replace(base, reason=str(err), warnings=tuple(str(finding) for finding in check(design)))
    if tolerance and not verdict_only:
        for added in (with_tolerance, with_field_steps, with_trial):
            found = added(design, found, seed=seed, on_step=judge.tell)
    return found


def verdict_of(
    design: SensorDesign, settings: str = "score", *, seed: int = 0, on_step: OnStep | None = None
) -> ContinuityScore:
    """The verdict, with the map of a pad or the pairs of facing rows, and nothing that it does not need.

    Parameters
    ----------
    settings : a row of `sims.continuity.settings.SETTINGS`

    Raises
    ------
    DesignError : the design breaks a rule.
    """
    require_valid(design)
    base = _base_of(design, seed=seed)
    try:
        return _with_verdict(Judge(design, settings, seed=seed, on_step=on_step), base)
    except ModelScopeError as err:
        return replace(base, reason=str(err))


def _base_of(design: SensorDesign, *, seed: int, fine: bool = False, full: bool = False) -> ContinuityScore:
    """A score that says nothing yet."""
    return ContinuityScore(
        verdict="OUT_OF_MODEL_SCOPE",
        reason="",
        digest=design.digest,
        name=design.name,
        seed=seed,
        fine=fine,
        full=full,
        is_facing_rows=is_facing_rows(cavity_of(design)),
    )


def _with_verdict(judge: Judge, base: ContinuityScore) -> ContinuityScore:
    """The verdict of a pad's map or of facing pairs, with what it is read from."""
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


def _scored(judge: Judge, base: ContinuityScore, *, verdict_only: bool) -> ContinuityScore:
    """All that a score has before its tolerance: stages in the order of the progress lines."""
    facing = judge.is_facing
    _ = judge.force
    judged, drawn = _with_errors(judge)
    has_map = not (facing and verdict_only)
    found = _with_verdict(judge, base)
    if has_map:
        found = replace(found, pad_map=judge.pad_map, pad_signals=judge.pad_signals)
    governing = next(pair for pair in judged if pair.name == judge.governing.name)
    shown = [k for k, pair in enumerate(judged) if not facing or pair is governing]
    worst = max(judged, key=lambda pair: pair.score.deadband_total_mm)
    headline = _headline(judged, governing, facing)
    return replace(
        found,
        governing=governing.name,
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
        bounds=None if verdict_only else judge.bounds,
        warnings=_warnings(
            judge.design, judged, found.pad_map, judge.readout.of_each(len(judge.cavity.receivers))
        ),
    )


def _with_errors(judge: Judge) -> tuple[tuple[JudgedPair, ...], FloatArray]:
    """All pairs with loads and errors, and their figures drawn again within the trace's error."""
    design, pairs = judge.design, judge.pairs
    drawn = drawn_figures(
        design, [pair.curves for pair in pairs], [pair.score for pair in pairs], judge.readout
    )
    judged = []
    for pair, draws in zip(pairs, drawn, strict=True):
        force, is_at_place = place_force(design, pair.curves.press_mm)
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
