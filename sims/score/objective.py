"""Figures of a design for a search: the requested figures of its score, computed in order of increasing cost.

    rules ──► parts and height ──► untouched light ──► pairs ──► map of the pad ──► bounds
      the evaluation ends after the first step that breaks a limit, and records the reason

The stages are those of a score (`optopad.sims.score.judge`), with the settings of a search or of a score. For facing
rows the figures are those of the governing pair; for a pad they are medians over judged pairs. The tolerance of
unmeasured parameters is not computed.

The module also has a draft verdict, computed in seconds while a layout is being moved by hand. Its light, depths and
bounds are coarse (`SETTINGS["draft"]`):

    curves_under   pairs whose chord runs under one press, each judged alone         a third of a second
    draft_score    verdict and map of the pad, or of all facing pairs                one to six seconds
    with_draft_bounds   bounds of location and depth, at two depths                  two to ten more

Times are for a pad of 48 pairs and two cores; the longer times are for layouts without symmetry. Locations of a pad
with a margin close to the deadband threshold are traced again with finer light. A draft has no tolerance and no
sensitivity to parameters, and single pairs of a pad are not judged.
"""

from __future__ import annotations

import threading
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from optopad.design.draft import Draft
from optopad.design.errors import DesignError, ModelScopeError
from optopad.design.mold.outline import outline_of
from optopad.design.pad import Pad
from optopad.design.progress import OnStep
from optopad.design.rules.check import check
from optopad.design.search.figures import BOUND_FIGURES
from optopad.design.search.improve import Judged, Limit
from optopad.design.shape.cavity import (
    CavityGeometry,
    beside_chord,
    cavity_of,
    judged_pairs,
    mask_of,
    pair_name,
)
from optopad.design.spec import SensorDesign
from optopad.sims.bounds.detection_threshold import DetectionThreshold
from optopad.sims.contact.indentation import round_press
from optopad.sims.optics.tracing import trace
from optopad.sims.press import depth_schedule_mm
from optopad.sims.readings.readout import Readout
from optopad.sims.score.judge import CLOSE_UNITS, SETTINGS, Judge, governing_pair, usable_of_pairs
from optopad.sims.score.result import ContinuityScore, JudgedPair
from optopad.sims.score.scoring import verdict_of
from optopad.sims.verdict.builds import pair_margin, score_curves
from optopad.sims.verdict.depth_curve import DEADBAND_THRESHOLD
from optopad.sims.verdict.presses import accuracy_of_pairs, curves_of, states_of

Pair = tuple[int, int]

MOST_PAIRS = 8
"""Largest number of pairs that are traced under a press, those with the nearest chords."""
FEWEST_PAIRS = 3
"""Number of pairs that are traced if no chord runs under the tip, those with the nearest chords."""


@dataclass(frozen=True, kw_only=True)
class PlaceCurves:
    """Pairs near one press, each judged alone; the chord of a pair is the straight line between its components.

    Attributes
    ----------
    place_mm : (x, y) of the press [mm]
    readout : gains of the receivers
    pairs : judged pairs, the nearest chord first
    is_draft : whether the light has the accuracy of a draft (True) or of a score (False)
    """

    place_mm: tuple[float, float]
    readout: Readout
    pairs: tuple[JudgedPair, ...]
    is_draft: bool


def pairs_under(cavity: CavityGeometry, place_mm: tuple[float, float]) -> tuple[Pair, ...]:
    """Judged pairs whose chord runs under the tip at a location, the nearest chord first.

    If no chord does, these are the `FEWEST_PAIRS` nearest pairs.
    """
    distances = {pair: beside_chord(cavity, pair, place_mm)[0] for pair in judged_pairs(cavity)}
    nearest = sorted(distances, key=lambda pair: round(distances[pair], 6))
    under = [pair for pair in nearest if distances[pair] <= cavity.tip_radius_mm]
    return tuple(under[:MOST_PAIRS] or nearest[:FEWEST_PAIRS])


def curves_under(
    design: SensorDesign,
    place_mm: tuple[float, float],
    *,
    is_draft: bool = True,
    seed: int = 0,
    on_step: OnStep | None = None,
) -> PlaceCurves:
    """Signal against depth for the pairs under one press, and the score of each pair.

    Parameters
    ----------
    place_mm : (x, y) of the press in cavity coordinates [mm]
    is_draft : if True, use the coarse light and depths of a draft, and a rotationally symmetric contact surface; if
        False, use the settings of a score

    Raises
    ------
    DesignError, ModelScopeError : the design breaks a rule, or the models do not cover the press.
    """
    pad = Pad.of(design)
    judge = Judge(pad, "draft" if is_draft else "score", seed=seed)
    depth_mm = depth_schedule_mm(judge.deepest_mm, judge.settings.step_mm)
    pairs = pairs_under(judge.cavity, place_mm)
    press = round_press(judge.contact, at_mm=place_mm) if is_draft else None
    light = trace(
        pad,
        states_of(np.array([place_mm]), depth_mm),
        profile=None if press is None else [press.at(depth) for depth in depth_mm.tolist()],
        accuracy=accuracy_of_pairs(pad, judge.settings.pairs),
        seed=seed,
        pairs=mask_of(pairs, judge.cavity),
        on_step=None if on_step is None else lambda done, total: on_step("curves", done / total),
    )
    curves = [curves_of(light, pair, place_mm, slice(None), depth_mm) for pair in pairs]
    return PlaceCurves(
        place_mm=place_mm,
        readout=judge.readout,
        pairs=tuple(
            JudgedPair(
                name=pair_name(judge.cavity, one.pair),
                curves=one,
                score=score_curves(one, judge.readout),
            )
            for one in curves
        ),
        is_draft=is_draft,
    )


def draft_score(design: SensorDesign, *, seed: int = 0, on_step: OnStep | None = None) -> ContinuityScore:
    """Verdict and map of a design in seconds, without bounds; `with_draft_bounds` adds the bounds.

    Raises
    ------
    DesignError : the design breaks a rule.
    """
    return verdict_of(design, "draft", seed=seed, on_step=on_step)


def with_draft_bounds(
    design: SensorDesign, draft: ContinuityScore, *, on_step: OnStep | None = None
) -> ContinuityScore:
    """A pad's draft score with bounds on location and depth from one frame and the detection threshold added."""
    if draft.pad_map is None or draft.readout is None or draft.pad_signals is None:
        return draft
    return with_bounds(design, draft, "draft", on_step=on_step)


def with_bounds(
    design: SensorDesign, score: ContinuityScore, settings: str = "score", *, on_step: OnStep | None = None
) -> ContinuityScore:
    """A score with the bounds of its design, and the map from which they follow; unchanged if it has them.

    Parameters
    ----------
    settings : name of the settings in `optopad.sims.score.judge.SETTINGS` with which the score was made
    """
    if score.bounds is not None or score.readout is None:
        return score
    judge = Judge(Draft.of(design), settings, seed=score.seed, on_step=on_step)
    if score.pad_map is not None and score.pad_signals is not None:
        judge.take(score.readout, score.pad_map, score.pad_signals)
    bounds = judge.bounds
    return replace(score, bounds=bounds, pad_map=judge.pad_map, pad_signals=judge.pad_signals)


MAP_FIGURES = frozenset({"verdict", "deadband_mm", "usable_depth_mm", "margin"})
SIZE_FIGURES = frozenset({"outer_volume_cm3", "above_surface_mm"})
PAIR_FIGURES = frozenset({"evenness", "continuity", "swing", "resolvable_steps"})

_ONE_AT_A_TIME = threading.Lock()
"""Lock around the compiled kernels, which two threads must not enter at once; a cluster's workers have several
threads."""


class _PrunedError(Exception):
    """Raised to stop judging a design early; the text is the reason."""


def judge(
    design: SensorDesign,
    limits: tuple[Limit, ...],
    *,
    wanted: Sequence[str],
    accuracy: str = "search",
    also_mm: Sequence[tuple[float, float]] = (),
    seed: int = 0,
) -> Judged:
    """Judge a design for a search.

    Parameters
    ----------
    limits : limits on figures that the design must keep; the evaluation ends after the first step that breaks one
    wanted : names of the requested figures (from `optopad.design.search.figures`, or "verdict"), in addition to those
        with
        limits
    accuracy : name of the settings in `optopad.sims.score.judge.SETTINGS`
    also_mm : (x, y) of further locations of a pad to judge, such as one known to decide the verdict [mm]; locations
        outside the design's workspace are left out
    seed : random seed of the light model
    """
    needed = {*wanted, *(limit.figure for limit in limits)}
    with _ONE_AT_A_TIME:
        settings = replace(SETTINGS[accuracy], has_detection="detection_force_n" in needed)
        return _Search(
            Judge(Draft.of(design), settings, seed=seed, also_mm=also_mm), limits, needed
        ).outcome()


class _Search:
    """Evaluation of one design, step by step; each step adds to `figures`."""

    def __init__(self, stages: Judge, limits: tuple[Limit, ...], needed: set[str]) -> None:
        self.stages, self.limits, self.needed = stages, limits, needed
        self.figures: dict[str, float | None] = {}
        self.verdict, self.may_be = "", False

    def outcome(self) -> Judged:
        """Run the steps until all figures are known or a limit is broken."""
        reason = ""
        try:
            self._steps()
        except (_PrunedError, ModelScopeError) as err:
            reason = str(err)
        return Judged(figures=self.figures, verdict=self.verdict, reason=reason, may_be=self.may_be)

    def _steps(self) -> None:
        broken = [str(finding) for finding in check(self.stages.design) if finding.severity == "error"]
        if broken:
            raise _PrunedError(f"breaks a rule: {broken[0]}")
        self._count(self.stages.cavity)
        self._stop_if_hopeless()
        self._untouched()
        self._stop_if_hopeless()
        if self.stages.is_facing:
            self._facing()
        else:
            self._pad()
        self._stop_if_hopeless()

    def _stop_if_hopeless(self) -> None:
        so_far = Judged(figures=self.figures, verdict=self.verdict)
        for limit in self.limits:
            if (limit.violation(so_far) or 0.0) > 0.0:
                value = self.verdict if limit.equals else f"{self.figures[limit.figure]:.4g}"
                raise _PrunedError(f"{limit.figure} {value}, required {limit}")

    def _count(self, cavity: CavityGeometry) -> None:
        self.figures["part_count"] = float(len(cavity.parts))
        self.figures["pad_height_mm"] = cavity.clear_mm + cavity.black_mm
        if self.needed & SIZE_FIGURES:
            self.figures |= sizes_of(self.stages.design)
        if "cost" in self.needed:
            self.figures["cost"] = price_of(cavity)

    def _untouched(self) -> None:
        flux, names = self.stages.untouched, self.stages.names
        # The common gain hides the amount of light, so strength is light: a share of the emitted power.
        chosen = names[:1] if self.stages.is_facing else names
        self.figures["strength"] = float(np.median([flux[pair] for pair in chosen])) if chosen else 0.0

    def _facing(self) -> None:
        """Judge the middle pair first, which rejects most designs; judge the others only if it has no deadband."""
        names = self.stages.names
        judged = self.stages.judged(names[:1])
        self._headline(judged)
        self._stop_if_hopeless()
        if not self.figures["deadband_mm"] and len(names) > 1:
            judged += self.stages.judged(names[1:])
            self._headline(judged)
        self._bounds()

    def _headline(self, judged: tuple[JudgedPair, ...]) -> None:
        """Set the figures of facing rows to those of the governing pair, except usable depth and margin.

        Usable depth and margin are the least over the pairs.
        """
        design, score = self.stages.design, governing_pair(judged, True).score
        margins = [pair_margin(self.stages.readout, pair.curves, pair.score) for pair in judged]
        self.may_be = min(margin + error for margin, error in margins) >= DEADBAND_THRESHOLD
        self.figures |= {
            "evenness": score.evenness,
            "continuity": score.continuity,
            "swing": score.strength.swing,
            "resolvable_steps": score.strength.resolvable_steps,
            "deadband_mm": score.deadband_total_mm,
            "usable_depth_mm": usable_of_pairs(design, judged),
            "margin": min(margin for margin, _ in margins),
        }
        self.verdict = "DEADBAND" if score.deadbands_mm else "CONTIGUOUS"

    def _pad(self) -> None:
        if self.needed & PAIR_FIGURES:
            self._medians(self.stages.pairs)
            self._stop_if_hopeless()
        if self.needed & MAP_FIGURES:
            places = self.stages.places
            self.figures |= {
                "deadband_mm": max(place.deadband_total_mm for place in places),
                "usable_depth_mm": self.stages.usable_depth_mm,
                "margin": min(place.margin for place in places),
            }
            self.verdict = self.stages.verdict
            self.may_be = min(place.margin for place in places) >= DEADBAND_THRESHOLD - CLOSE_UNITS
            self._stop_if_hopeless()
        self._bounds()

    def _medians(self, judged: tuple[JudgedPair, ...]) -> None:
        scores = [pair.score for pair in judged]
        self.figures |= {
            "evenness": float(np.median([score.evenness for score in scores])),
            "continuity": float(np.median([score.continuity for score in scores])),
            "swing": float(np.median([score.strength.swing for score in scores])),
            "resolvable_steps": float(np.median([score.strength.resolvable_steps for score in scores])),
        }

    def _bounds(self) -> None:
        if not self.needed & BOUND_FIGURES:
            return
        bounds = self.stages.bounds
        for name, value in (
            ("location_bound_mm", bounds.median_location_mm.value),
            ("depth_bound_mm", bounds.median_depth_mm.value),
            ("dead_share", bounds.dead_share.value),
        ):
            self.figures[name] = float(value) if np.isfinite(value) else None
        if bounds.detection is not None:
            self.figures["detection_force_n"] = detection_force_n(bounds.detection)


def detection_force_n(found: DetectionThreshold) -> float | None:
    """Load from which a press is detected at the worst location [N]; None if it is not detected there."""
    force = float(found.force_n[found.worst])
    return force if np.isfinite(force) else None


def bodies_above_surface_mm(design: SensorDesign) -> float:
    """Height of the highest body above the edge of the untouched surface [mm]; below 0 if all end below it."""
    outline = outline_of(design)
    return max(one.part.body_top_mm for one in outline.sockets) - outline.fill_mm


def sizes_of(design: SensorDesign) -> dict[str, float | None]:
    """Outer volume of the mold [cm3], and height of its rim or of the highest body above the surface [mm]."""
    outline = outline_of(design)
    above_mm = max(outline.highest_mm - outline.fill_mm, bodies_above_surface_mm(design))
    height_mm = max(outline.fill_mm + above_mm, cavity_of(design).plan.clear_mm) - outline.bottom_mm
    volume = outline.outer_length_mm * outline.outer_width_mm * height_mm
    return {"outer_volume_cm3": round(volume / 1000.0, 4), "above_surface_mm": round(max(above_mm, 0.0), 4)}


def price_of(cavity: CavityGeometry) -> float:
    """Price of all emitters and receivers, in the currency of the catalogue's prices.

    Raises
    ------
    DesignError : a component has no price, or the prices are in different currencies.
    """
    costs = {part.part_id: part.part.cost for part in cavity.parts}
    missing = sorted(name for name, cost in costs.items() if cost is None)
    if missing:
        raise DesignError(
            f"cost: the catalogue has no price for {', '.join(missing)}; give the part a cost in your own catalogue "
            "(docs/how-to/own-parts.md, section A price), or leave cost out"
        )
    currencies = {cost.currency for cost in costs.values() if cost is not None}
    if len(currencies) > 1:
        raise DesignError(
            f"cost: prices in {' and '.join(sorted(currencies))} cannot be added; give one currency"
        )
    return sum(cost.value for part in cavity.parts if (cost := part.part.cost) is not None)
