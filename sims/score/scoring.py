"""The verdict on a design: are the two modes contiguous, and where is depth not resolved?

    judged pairs, each under its own press ──► light ──► counts ──► modes, deadbands, strength
    locations in the workspace ──► all judged pairs ──► map of the pad
    unmeasured parameters, both ends of their bands ──► the governing pair again ──► confidence

Facing rows are judged pair by pair, the middle pair first. A pad is judged by all readings of a frame together
(`optopad.sims.verdict.pad_map`). It has a DEADBAND if at any location depth is not resolved over 0.3 mm or more, but is
resolved again deeper. If depth is not resolved again, the usable depth ends there.

The module also estimates in advance how long a score or a whole run will take: for each stage, the number of states
times the cost of a state.

Light takes almost all of the time. A state is a press at a location and a depth. States that are equal by symmetry of
the layout are traced once, and stored light costs nothing. On flat rectangles, the time for a state depends on the
number of pairs. On discs and crowned pads, it depends on the numbers of emitters and of points on the top.

The estimate leaves out locations that are still undecided after the first trace, the Monte Carlo simulation over
manufacturing tolerances, and compiling.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from optopad.design.arrays import FloatArray
from optopad.design.circuit.circuit import Circuit
from optopad.design.circuit.transimpedance import given_ohms, settling_findings
from optopad.design.errors import ModelScopeError
from optopad.design.fields.finding import FAILS, OUT_OF_SCOPE, USUAL
from optopad.design.progress import OnStep
from optopad.design.rules.check import check, require_valid
from optopad.design.shape.cavity import (
    CavityGeometry,
    cavity_of,
    chord_midpoint_mm,
    is_facing_rows,
    judged_pairs,
    mask_of,
    pair_name,
    plan_of,
)
from optopad.design.spec import SensorDesign
from optopad.design.spec.cheap_fields import TARGET, cheap_fields
from optopad.sims.bounds.fisher import PRESSES, SHALLOW_MM, Steps, stencil_presses
from optopad.sims.bounds.observability import bound_depths_mm
from optopad.sims.contact.indentation import is_in_library
from optopad.sims.contact.pad_surface import contact_notes
from optopad.sims.contact.scope import layer_depth, solved_depths, tip_radius_mm
from optopad.sims.optics.accuracy import Accuracy, accuracy_of
from optopad.sims.optics.scene.lower import scene_of
from optopad.sims.optics.scene.symmetry import state_classes
from optopad.sims.optics.tracing import emitter_cost_s, pair_cost_s, state_cost_s, untouched_cost_s
from optopad.sims.press import COARSE_STEP_MM, depth_schedule_mm
from optopad.sims.readings.readout import Readout
from optopad.sims.score.build_tolerance import with_tolerance
from optopad.sims.score.field_steps import with_field_steps
from optopad.sims.score.judge import Judge, Settings, settings_of
from optopad.sims.score.result import ContinuityScore, JudgedPair, margin_caution, noise_caution
from optopad.sims.score.trials import with_trial
from optopad.sims.verdict.builds import accuracy_of_builds
from optopad.sims.verdict.figure_errors import (
    boundary_forces,
    drawn_figures,
    figure_errors,
    figures_of,
    place_force,
)
from optopad.sims.verdict.pad_map import PadMap, grid_places_mm, map_grid_mm
from optopad.sims.verdict.presses import (
    NEAR_MM,
    accuracy_of_pairs,
    map_depths_mm,
)
from optopad.sims.verdict.tolerance import tried_values


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
    on_step : called with the name of the running stage and the share of it that is done, 0 to 1

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
        left = tuple(str(one) for one in check(design) if one.weight < OUT_OF_SCOPE)
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
    require_valid(design)
    base = _base_of(design, seed=seed)
    try:
        return _with_verdict(Judge(design, settings, seed=seed, on_step=on_step), base)
    except ModelScopeError as err:
        return replace(base, reason=str(err))


def _base_of(design: SensorDesign, *, seed: int, fine: bool = False, full: bool = False) -> ContinuityScore:
    """A score without results; until they are added, it is marked as out of the models' scope."""
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


def _scored(judge: Judge, base: ContinuityScore, *, verdict_only: bool) -> ContinuityScore:
    """A score with the results of all stages before tolerance, in the order of the progress lines."""
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
            judge.design,
            judged,
            found.pad_map,
            judge.readout.of_each(len(judge.cavity.receivers)),
            fine=base.fine,
        ),
    )


def _with_errors(judge: Judge) -> tuple[tuple[JudgedPair, ...], FloatArray]:
    """All pairs with loads and errors, and random samples of their figures within the error of the light trace."""
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
    design: SensorDesign,
    judged: tuple[JudgedPair, ...],
    pad_map: PadMap | None,
    gains: tuple[float, ...],
    *,
    fine: bool,
) -> tuple[str, ...]:
    """All warnings about the design and its verdict, those of largest weight first."""
    findings = list(check(design))  # errors were refused before
    circuit = Circuit.of(design)
    if given_ohms(circuit) is None:  # resistors by a rule follow from the light
        findings += settling_findings(circuit, gains)
    found = [(one.weight, str(one)) for one in findings]
    clipped = [pair.name for pair in judged if pair.score.is_clipped]
    if clipped:
        words = (
            f"{len(clipped)} of {len(judged)} pairs clip with a target of {design.gain.target_counts:g} counts, which "
            f"costs the resolution near the surface ({', '.join(clipped[:8])}); set gain.feedback_ohm = 'each', or "
            "lower gain.target_counts"
        )
        found.append((FAILS, words))
    if pad_map is not None and not is_facing_rows(cavity_of(design)):
        found += [(FAILS, text) for text in margin_caution(pad_map)]
    if said := noise_caution(judged, fine=fine):
        found.append((FAILS, said))
    found += [(USUAL, text) for text in contact_notes(design)]
    return tuple(text for _, text in sorted(found, key=lambda one: -one[0]))


ANSWERING_PAIRS = 0.35
"""Assumed share of a pad's pairs that respond at its location of least margin [-]. Manufactured units are judged by
these pairs. On the presets the share is 0.17 to 0.7.
"""
TRACED_AGAIN = 0.15
"""Assumed share of the voxels deeper than `SHALLOW_MM` that are still undecided after the first trace [-]."""
SAME_MIRRORS = 0.2
"""Relative cost of a disc or crowned unit that differs only in scattering, so that mirrored light is reused [-]."""
TRACED_TWICE = 1.25
"""Mean number of traces for a disc or crowned unit: those close to a deadband take two [-]."""
TOP_S = 3e-4
"""Processor time of a flat rectangle's pressed top, per area in squared tip radii [s]. Fitted to facing rows, whose
light is cheap: with it, seven measured scores take 0.76 to 1.73 of the estimate."""
LIVE_S = 27.0
"""Processor time to solve one depth of a press that the library does not have [s]: a flat punch of 2.5 mm in 6 mm."""
REST_S, RUN_S = 16.0, 24.0
"""Processor time for everything except light [s]: `REST_S` for a score (start, contact, trial of changes, drawings),
and `RUN_S` added by a run (mold, report).
"""
WORTH_SAYING_S = 20.0
"""No estimate is shown if it is less than this [s]."""


@dataclass(frozen=True, kw_only=True)
class ScoreCost:
    """Estimated cost of a score.

    Attributes
    ----------
    presses, pairs : numbers of presses and of pairs in the map
    core_s : processor time [s]
    stages_s : processor time by stage [s]
    job : "score" or "run"
    """

    presses: int
    pairs: int
    core_s: float
    stages_s: dict[str, float] = field(default_factory=dict)
    job: str = "score"

    def sentence(self, cores: int) -> str:
        """Message on the expected time, shown before a score begins; empty if the time is short."""
        seconds = self.core_s / cores
        if seconds < WORTH_SAYING_S:
            return ""
        length = f"{seconds / 60:.0f} minutes" if seconds >= 90.0 else f"{round(seconds, -1):.0f} seconds"
        on = "1 core" if cores == 1 else f"{cores} cores"
        return (
            f"{self.job}: about {length} on {on} ({self.presses} presses x {self.pairs} pairs of parts in the map); "
            "less where the light is known"
        )


def score_cost(design: SensorDesign, *, fine: bool, full: bool, is_run: bool = False) -> ScoreCost:
    """Estimated cost of a score, or of a whole `optopad run` if `is_run` is True.

    `fine` and `full` are the options of `optopad.sims.score.scoring.score`. A run adds mold, report and the firmware's
    files.
    """
    cavity = cavity_of(design)
    row = settings_of(fine=fine, full=full).for_pairs(len(judged_pairs(cavity)))
    places_mm = grid_places_mm(cavity.workspace, *map_grid_mm(cavity, row.map_places))
    depth_mm = map_depths_mm(design.operating.max_depth_mm, row.map_step_mm)
    stages = {
        "contact": _contact_s(design),
        "untouched": untouched_cost_s(scene_of(design), accuracy_of(row.untouched)),
        "pairs": _pairs_s(design, cavity, row),
        "map": _map_s(design, places_mm, depth_mm, row),
        "bounds": _bounds_s(design, places_mm, row),
        "builds": _builds_s(design, cavity),
        "rest": REST_S + (RUN_S if is_run else 0.0),
    }
    return ScoreCost(
        presses=len(places_mm) * len(depth_mm),
        pairs=len(cavity.emitters) * len(cavity.receivers),
        core_s=sum(stages.values()),
        stages_s=stages,
        job="run" if is_run else "score",
    )


def _state_s(design: SensorDesign, settings: Accuracy) -> float:
    """Processor time of one state: its light, and on a flat rectangle its top between the walls [s]."""
    scene, tip = scene_of(design), tip_radius_mm(design)
    top_s = TOP_S * scene.length_mm * scene.width_mm / tip**2 if scene.form is None else 0.0
    return top_s + state_cost_s(scene, settings)


def _contact_s(design: SensorDesign) -> float:
    """Processor time to solve the presses of a tip or layer that the library does not have [s]."""
    if not plan_of(design).top.is_flat or is_in_library(design):
        return 0.0
    deepest = design.operating.max_depth_mm / tip_radius_mm(design)
    return LIVE_S * len(solved_depths(layer_depth(design), deepest))


def _distinct(design: SensorDesign, places_mm: FloatArray) -> int:
    """Number of locations in `places_mm` (n, 2); those that are equal by symmetry of the layout count once."""
    found = state_classes(scene_of(design), places_mm[:, None, :], [[1.0]] * len(places_mm))
    return len(found.first)


def _pairs_s(design: SensorDesign, cavity: CavityGeometry, row: Settings) -> float:
    """Processor time of single pairs, each under its own press [s]; pairs equal by symmetry are traced once."""
    settings = accuracy_of(accuracy_of_pairs(design, row.pairs))
    pairs = judged_pairs(cavity)
    alike = len(pairs) / max(_distinct_pairs(design, cavity), 1)
    depths = len(depth_schedule_mm(design.operating.max_depth_mm, row.step_mm))
    return len(pairs) / alike * depths * emitter_cost_s(scene_of(design), settings, 1)


def _distinct_pairs(design: SensorDesign, cavity: CavityGeometry) -> int:
    """Number of judged pairs; pairs whose presses are equal by symmetry of the layout count once."""
    places = np.array([chord_midpoint_mm(cavity, pair) for pair in judged_pairs(cavity)])
    distinct = np.unique(np.round(places, 6), axis=0)
    return round(len(places) * _distinct(design, distinct) / len(distinct))


def _map_s(design: SensorDesign, places_mm: FloatArray, depth_mm: FloatArray, row: Settings) -> float:
    near = int(np.sum(depth_mm <= NEAR_MM))
    at_a_place = near * _state_s(design, row.near or row.map)
    at_a_place += (len(depth_mm) - near) * _state_s(design, row.map)
    return _distinct(design, places_mm) * at_a_place


def _bounds_s(design: SensorDesign, places_mm: FloatArray, row: Settings) -> float:
    """Processor time for the bounds: all presses, in two independent traces [s]."""
    scene, steps = scene_of(design), Steps()
    depths = bound_depths_mm(row.bound_depths_mm, design.operating.max_depth_mm, steps.depth_mm)
    voxels = np.column_stack([places_mm, np.ones(len(places_mm))])
    sides = stencil_presses(voxels, steps.offsets_mm(voxels[:, 2])).reshape(-1, PRESSES, 3)
    beside, middle = _distinct(design, sides[:, :4, :2].reshape(-1, 2)), 2 * _distinct(design, places_mm)
    deep = int(np.sum(depths >= SHALLOW_MM))
    first, then = (accuracy_of(one) for one in row.bounds[:2])
    known = middle if first == row.map else 0  # the first half's, from the map
    finer = (len(depths) - deep + TRACED_AGAIN * deep) * 2 * (beside + middle)
    return (
        deep * (2 * (beside + middle) - known) * _state_s(design, first)
        + finer * _state_s(design, then)
        + untouched_cost_s(scene, first)
    )


def _builds_s(design: SensorDesign, cavity: CavityGeometry) -> float:
    """Processor time of tolerance and sensitivity [s].

    Tolerance needs a verdict at both ends of every unmeasured parameter, sensitivity one for a step up and down of each
    field.
    """
    settings, scene = accuracy_of_builds(design), scene_of(design)
    pairs = len(cavity.emitters) * len(cavity.receivers)
    is_facing, is_flat = is_facing_rows(cavity), scene.form is None
    judged = 1 if is_facing else max(round(ANSWERING_PAIRS * pairs), 1)
    depths = len(depth_schedule_mm(design.operating.max_depth_mm, COARSE_STEP_MM))
    fields = [path for path in cheap_fields(design) if path != TARGET]
    stepped = [design] * (2 * len(fields))
    total = 0.0
    for build, is_step in _tried(design, stepped):
        own = scene_of(build)
        judged_s = pair_cost_s(own, settings) * judged if is_flat else state_cost_s(own, settings)
        if is_facing and not is_flat:
            judged_s = emitter_cost_s(own, settings, 1)
        bounds_s = (2 * PRESSES + 1) * state_cost_s(own, settings) if is_step else 0.0
        mirrors = SAME_MIRRORS if not is_flat and build is not design and _mirrors_alike(own, scene) else 1.0
        total += (
            (1.0 if is_flat else TRACED_TWICE)
            * mirrors
            * (untouched_cost_s(own, settings) + depths * judged_s + bounds_s)
        )
    return total


def _tried(design: SensorDesign, stepped: Sequence[SensorDesign]) -> list[tuple[SensorDesign, bool]]:
    """Designs that are judged for tolerance and sensitivity, each with whether it also needs bounds."""
    ends = [(design.with_(**{used.path: end}), False) for used, both in tried_values(design) for end in both]
    return [(design, True), *ends, *((build, True) for build in stepped)]


def _mirrors_alike(one: object, other: object) -> bool:
    """Whether two scenes differ only in scattering, not in mirrored light."""
    scatters = {"wall_reflectance", "bottom_reflectance", "tip_reflectance"}
    kept = [
        {name: repr(value) for name, value in vars(scene).items() if name not in scatters}
        for scene in (one, other)
    ]
    return kept[0] == kept[1]
