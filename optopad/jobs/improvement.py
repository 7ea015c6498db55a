"""Improves a design: searches similar designs with a fast light model, and scores the best candidates in full.

Quick light is a coarse, fast setting of the light model. A score uses the setting of `optopad score`.

outputs/improve-<name>-<digest8>/
  study.db, designs.csv, front.*, designs/, report.html   files of the search (`optopad.jobs.exploration`)
  1-fewest-changes.toml ...    the alternatives: the original design file with the changed lines marked
  improve.json                 the design before and the alternatives, with their scores

For each quantity to improve (kind), the best candidates are scored first. A candidate becomes an alternative if it has
no deadband, is better than the original, and no unmeasured parameter changes its verdict. If all candidates fail, other
designs that may have no deadband are scored. If these fail too, the best of the scored designs is reported.

The error of quick light mostly has the same sign for similar designs. The median by which quick light overrates the
margin in the scored designs is therefore subtracted for the others.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from statistics import median
from typing import Any

from design.errors import InputError
from design.fields.base import get_at, known_paths, set_at
from design.io import dump_design, load_design, write_text_atomically
from design.progress import OnStep, silent
from design.rules.check import require_valid
from design.search.explore import OnTried
from design.search.improve import (
    ENOUGH_SHARE,
    KINDS,
    NEAR_BEST_MM,
    SAFE_MARGIN,
    Judged,
    Kind,
    Range,
    Tried,
    betters,
    changes_of,
    improvement_space,
    is_near,
    is_possible,
    margin_of,
    picks,
    usable_of,
    worth,
)
from design.search.points import MOST_A_ROUND, MOVES, first_points, refinements, spread_points
from design.search.space import SearchSpace
from design.shape.cavity import cavity_of, is_facing_rows, plan_of
from design.spec import SensorDesign
from design.spec.cheap_fields import CLEAR, HEIGHTS
from optopad.jobs.exploration import search
from optopad.report.search import search_page
from optopad.results.improvement import Alternative, Improvement, Nearest
from optopad.results.score import Score
from optopad.results.shown import Search
from sims.score.build_tolerance import with_tolerance
from sims.score.field_steps import with_field_steps
from sims.score.objective import judge
from sims.score.result import ContinuityScore
from sims.score.scoring import verdict_of
from sims.verdict.depth_curve import DEADBAND_THRESHOLD

PAD_MINUTES, ROW_MINUTES = 3.0, 2.0
"""Default time budgets to improve a pad, and facing rows of parts [min on two cores]."""
CORES = 2
PAD_S, PAIR_S, ROW_S = 1.9, 0.04, 0.6
"""Processor time to evaluate one design in the search [s]: for a pad a fixed part and a part per pair, for facing rows
one value."""
CURVED = 4.0
"""Factor by which the search takes longer per design for a round pad or one with a convex top [-]."""
SEARCH = 0.4
"""Fraction of the time budget for the search with its coarse light model [-]; the rest is for full scores."""
SPREAD = 0.6
"""Largest fraction of a search's designs that samples the parts' heights and the pad's thickness evenly [-]."""
FEWEST, MOST = 12, 400
"""Least and largest number of designs in a search, not counting variations of the best ones."""
ATTEMPTS, ROW_ATTEMPTS = 4, 8
"""Largest number of candidates that are scored for one kind of improvement: for a pad, and for facing rows."""
FIRMER = 1.3
"""If an unmeasured parameter changes a design's verdict, similar candidates need this factor times its margin [-]."""
MOST_JUDGED = 12
"""Number of designs that are scored in full before the search reports that none is better."""
LEAST_JUDGED = 2
"""Number of designs that are scored in full even if the search's coarse light finds a deadband in all designs."""
MOST_BOUNDS = 4
"""Largest number of a search's pads for which bounds of location and depth are computed."""
PLACE = "location_bound_mm"


def improve(
    design: SensorDesign,
    out: Path,
    *,
    text: str | None = None,
    vary: Mapping[str, Range | None] | None = None,
    keep: Sequence[str] = (),
    more_parts: bool = False,
    budget_min: float | None = None,
    seed: int = 0,
    on_step: OnStep | None = None,
    on_tried: OnTried | None = None,
) -> Improvement:
    """Search for similar, better designs, and score the best candidates.

    Parameters
    ----------
    text : text of the design file, whose comments the alternatives keep; if None, their files have no comments
    vary : additional fields to vary, each with its range or None for the default range
    keep : fields to leave unchanged
    more_parts : whether the search may add parts to a side
    budget_min : approximate time on two idle cores [min]; None for the default

    Raises
    ------
    InputError, DesignError : fields, ranges or the budget are invalid.
    """
    require_valid(design)
    facing = is_facing_rows(cavity_of(design))
    accuracy = "resolvable_steps" if facing else PLACE
    space = improvement_space(
        design,
        vary=vary or {},
        keep=keep,
        more_parts=more_parts,
        trials=trials_of(design, budget_min),
        seed=seed,
        figures=("margin", "usable_depth_mm"),
    )
    again = Confirmation(space, accuracy, seed=seed, tell=on_step or silent)
    before = again.before
    if before.verdict == "OUT_OF_MODEL_SCOPE":
        raise InputError(f"{design.name}: {before.reason}; improve needs a design that the models cover")
    before = with_field_steps(design, before, seed=seed, on_step=again.tell)
    trials = trials_of(design, budget_min)
    first = _first(space, before, trials)
    found = search(
        space,
        out,
        trials=max(trials, len(first) + 1),
        on_tried=on_tried,
        first=first,
        refine=lambda findings, number: refinements(space, findings.tried, number, starts=2 if facing else 1),
        also_mm=_deciding_places(before),
    )
    made = Improvement(
        design=design,
        before=Score(design=design, found=before),
        figures=found.findings.base.figures,
        alternatives=(),
        nearest=None,
        tried=len(found.findings.tried),
        folder=found.folder,
        is_interrupted=found.findings.is_interrupted,
    )
    if made.is_interrupted:
        return made
    tried = again.found_by_search(found.findings.base, found.findings.tried)
    alternatives = again.alternatives(tried)
    made = replace(
        made,
        figures=again.base.figures,
        alternatives=alternatives,
        nearest=None if alternatives else again.nearest(tried),
        judged_again=len(again.scores) - 1,
    )
    _write(made, found, text)
    return made


def trials_of(design: SensorDesign, budget_min: float | None) -> int:
    """Number of designs to search in a time budget [min], from the usual time per design; equal on all machines."""
    cavity = cavity_of(design)
    facing = is_facing_rows(cavity)
    budget = (ROW_MINUTES if facing else PAD_MINUTES) if budget_min is None else budget_min
    if not 0.0 < budget <= 24 * 60:
        raise InputError(f"--budget: {budget:g} minutes is refused: give more than 0, up to 1440")
    pairs = len(cavity.emitters) * len(cavity.receivers)
    each_s = ROW_S if facing else PAD_S + PAIR_S * pairs
    each_s *= 1.0 if plan_of(design).is_block else CURVED
    around = len(MOVES) * MOST_A_ROUND * (2 if facing else 1)
    return min(max(int(SEARCH * budget * 60.0 * CORES / each_s) - around, FEWEST), MOST)


def _first(space: SearchSpace, before: ContinuityScore, trials: int) -> list[dict[str, Any]]:
    """Initial points of the search, as values of the varied fields.

    The order is: changes against the cause of the worst deadband, steps with a good sensitivity, evenly spread points.
    """
    cause = before.causes[0] if before.causes else None
    side = 0 if cause is None else {"apart": 1, "used up": -1}.get(cause.lack, 0)
    sides = {**dict.fromkeys(HEIGHTS[::-1], side), CLEAR: -side} if side else {}
    if before.steps is not None:
        sides |= {path: way for path, way in before.steps.better_sides().items() if path not in sides}
    short = None if cause is None else max(cause.short_mm or 2.0, 0.5)
    points = first_points(space, sides=sides, short_mm=short)
    return points + [one for one in spread_points(space, int(SPREAD * trials)) if one not in points]


def _deciding_places(before: ContinuityScore) -> list[tuple[float, float]]:
    """Locations that decide a pad's verdict [mm]: where the deadband is worst, and where the margin is least."""
    if before.pad_map is None or before.is_facing_rows:
        return []
    return list(dict.fromkeys((one.x_mm, one.y_mm) for one in (before.pad_map.worst, before.pad_map.weakest)))


def _write(made: Improvement, found: Search, text: str | None) -> None:
    if text is None:
        text = dump_design(made.design).split("\n", 1)[
            1
        ]  # its first line names a digest, which will be another
    _clear(made.folder, keep={one.file for one in made.alternatives})
    for one in made.alternatives:
        _write_design(made.folder / one.file, text, made.design, one.changes, one.kind)
    write_text_atomically(made.folder / "report.html", search_page(found, made))
    write_text_atomically(made.folder / "improve.json", json.dumps(made.to_json(), indent=2) + "\n")


def _clear(folder: Path, *, keep: set[str]) -> None:
    try:
        earlier = json.loads((folder / "improve.json").read_text(encoding="utf-8"))["alternatives"]
        names = {Path(one["file"]).name for one in earlier}
    except (OSError, ValueError, KeyError, TypeError):
        return
    for name in names - keep:
        (folder / name).unlink(missing_ok=True)


def _write_design(file: Path, text: str, base: SensorDesign, changes: Mapping[str, Any], kind: str) -> None:
    import tomlkit

    document, was, known = tomlkit.parse(text), base.model_dump(mode="json"), known_paths(SensorDesign)
    for path, value in changes.items():
        item = tomlkit.item(value)
        item.comment(f"was {get_at(was, path)!r}; improve: {kind}")
        set_at(document, path, item, known=known)
    write_text_atomically(file, tomlkit.dumps(document))
    load_design(file)


class Confirmation:
    """Full scores of designs from a search, with the light model of `optopad score`; each is computed once.

    Parameters
    ----------
    space : the search space
    accuracy : name of the figure by which the accuracy of designs is compared
    """

    def __init__(self, space: SearchSpace, accuracy: str, *, seed: int, tell: OnStep) -> None:
        self.space, self.accuracy, self.seed, self.tell = space, accuracy, seed, tell
        self.scores: dict[str, ContinuityScore] = {}
        self.overrated = 0.0
        self._differences = [0.0]
        self.base, self.before = Judged(), self.verdict(space.base)

    def verdict(self, design: SensorDesign) -> ContinuityScore:
        """Verdict of a design with the light model of `optopad score`.

        Bounds, the effect of unmeasured parameters and figures of a pad's single pairs are left out.
        """
        if design.digest not in self.scores:
            self.scores[design.digest] = verdict_of(design, seed=self.seed, on_step=self.tell)
        return self.scores[design.digest]

    def found_by_search(self, base: Judged, tried: Sequence[Tried]) -> tuple[Tried, ...]:
        """Store the search's figures of the original design, and return the search's designs.

        For a pad, the best designs get their bounds of location and depth.
        """
        self.base = replace(base, verdict=self.before.verdict)
        self._learn(base, self.before)
        best = sorted((one for one in tried if is_possible(one.judged)), key=_worth, reverse=True)[
            :MOST_BOUNDS
        ]
        if self.accuracy != PLACE or not best:
            return tuple(tried)
        self.base = self._with_accuracy(self.base, self.space.base)
        numbers = {one.number for one in best}
        return tuple(
            replace(one, judged=self._with_accuracy(one.judged, self.space.changed(one.parameters)))
            if one.number in numbers
            else one
            for one in tried
        )

    def _with_accuracy(self, judged: Judged, design: SensorDesign) -> Judged:
        self.tell("accuracy", 0.0)
        more = judge(design, (), wanted=(PLACE,), accuracy=self.space.accuracy, seed=self.seed)
        return replace(judged, figures=more.figures | judged.figures)

    def alternatives(self, tried: Sequence[Tried]) -> tuple[Alternative, ...]:
        """The first verified design for every quantity to improve (such as "most depth"), all different.

        If there is none for any quantity, one verified design that is better is returned.
        """
        attempts = ATTEMPTS if self.accuracy == PLACE else ROW_ATTEMPTS
        deepest = self._first_of("most depth", self._picked("most depth", tried), attempts)
        most_mm = math.inf if deepest is None else deepest.score.usable_depth_mm or 0.0
        found: list[Alternative] = []
        for kind in KINDS:
            if kind == "most depth":
                least_mm = (
                    max((one.score.usable_depth_mm or 0.0 for one in found), default=0.0) + NEAR_BEST_MM
                )
                one = deepest if most_mm >= least_mm else None
            else:
                least_mm = 0.0 if deepest is None else ENOUGH_SHARE * most_mm
                one = self._first_of(kind, self._picked(kind, tried, most_mm), attempts, least_mm)
            if one is not None and all(other.design.digest != one.design.digest for other in found):
                found.append(replace(one, file=f"{len(found) + 1}-{kind.replace(' ', '-')}.toml"))
        if not found:
            rest = sorted(tried, key=_worth, reverse=True)
            rest = [one for n, one in enumerate(rest) if is_possible(one.judged) or n < LEAST_JUDGED]
            one = self._first_of(KINDS[0], rest, MOST_JUDGED)
            found += [] if one is None else [one]
        return tuple(found)

    def _picked(self, kind: Kind, tried: Sequence[Tried], most_mm: float = math.inf) -> list[Tried]:
        every = picks(self.space, self.base, tried, self.accuracy, most_mm)
        return [pick.tried for pick in every if pick.kind == kind]

    def _first_of(
        self, kind: Kind, candidates: list[Tried], attempts: int, least_mm: float = 0.0
    ) -> Alternative | None:
        """The first candidate that scores better than the original and whose verdict no unmeasured parameter changes.

        If there is none, the first that scores better is returned; None if no candidate does. For "most depth", the
        usable depth may be up to `NEAR_BEST_MM` below that of the deepest design.

        Parameters
        ----------
        least_mm : required usable depth [mm]
        """
        candidates = [one for one in candidates if usable_of(one.judged) >= least_mm]
        undecided: Alternative | None = None
        for _ in range(attempts):
            if not candidates:
                break
            tried = self._next_of(candidates, DEADBAND_THRESHOLD if kind == "most depth" else SAFE_MARGIN)
            candidates.remove(tried)
            changed = self.space.changed(tried.parameters)
            self.tell(kind, 0.0)
            score = self.verdict(changed)
            self._learn(tried.judged, score)
            if not self._is_better(tried, score) or (score.usable_depth_mm or 0.0) < least_mm:
                continue
            if score.tolerance is None:
                score = with_tolerance(changed, score, seed=self.seed, on_step=self.tell)
                self.scores[changed.digest] = score
            made = Alternative(
                kind=kind,
                changes=changes_of(self.space, tried.parameters),
                design=changed,
                file=f"1-{kind.replace(' ', '-')}.toml",
                figures=tried.judged.figures,
                score=score,
            )
            if score.tolerance is None or not score.tolerance.flipping:
                return made
            undecided = undecided or made
            if kind == "most depth":
                least_mm = max(least_mm, (score.usable_depth_mm or 0.0) - NEAR_BEST_MM)
            safe = FIRMER * margin_of(tried.judged)
            candidates = [
                one
                for one in candidates
                if usable_of(one.judged) >= least_mm
                and (margin_of(one.judged) >= safe or not is_near(self.space, one, tried))
            ]
        return undecided

    def _next_of(self, candidates: Sequence[Tried], margin: float) -> Tried:
        """The first candidate with the required margin, corrected for the search's typical error; if none, the best."""
        safe = [one for one in candidates if margin_of(one.judged) - self.overrated >= margin]
        return safe[0] if safe else max(candidates, key=_worth)

    def _learn(self, judged: Judged, score: ContinuityScore) -> None:
        if score.margin is not None and judged.figures.get("margin") is not None:
            self._differences.append(margin_of(judged) - score.margin)
            self.overrated = max(median(self._differences), 0.0)

    def _is_better(self, one: Tried, score: ContinuityScore) -> bool:
        return (
            score.verdict == "CONTIGUOUS"
            and not score.is_open
            and bool(changes_of(self.space, one.parameters))
            and betters(
                self._as_judged(self.base, self.before),
                self._as_judged(one.judged, score),
                self.accuracy,
                safe=DEADBAND_THRESHOLD,
            )
        )

    @staticmethod
    def _as_judged(quick: Judged, score: ContinuityScore) -> Judged:
        own = {
            "deadband_mm": score.deadband_total_mm,
            "usable_depth_mm": score.usable_depth_mm,
            "margin": score.margin,
        }
        verdict = "DEADBAND" if score.is_open else score.verdict
        return Judged(figures=quick.figures | own, verdict=verdict, may_be=verdict == "CONTIGUOUS")

    def nearest(self, tried: Sequence[Tried]) -> Nearest | None:
        """The best of the scored designs; None if no design was scored."""
        digests = {self.space.changed(one.parameters).digest: one for one in tried if one.digest}
        found = [
            (score, digests[digest])
            for digest, score in self.scores.items()
            if digest in digests and changes_of(self.space, digests[digest].parameters)
        ]
        if not found:
            return None
        score, one = max(found, key=lambda both: worth(self._as_judged(both[1].judged, both[0])))
        ends = tuple(
            field.path
            for field in self.space.fields
            if field.low is not None and float(one.parameters[field.path]) in (field.low, field.high)
        )
        return Nearest(
            changes=changes_of(self.space, one.parameters), judged=one.judged, at_ends=ends, score=score
        )


def _worth(one: Tried) -> tuple[bool, float, float, float]:
    return worth(one.judged)
