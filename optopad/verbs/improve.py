"""Improves a design: searches similar designs with a fast light model, and scores the best candidates in full.

Quick light is a coarse, fast setting of the light model. A score uses the setting of `optopad score`.

outputs/improve-<name>-<digest8>/
  study.db, designs.csv, front.*, designs/, report.html   files of the search (`optopad.verbs.explore`)
  1-fewest-changes.toml ...    the alternatives: the original design file with the changed lines marked
  improve.json                 the design before and the alternatives, with their scores

Designs are scored until the budget is used: for each quantity to improve (kind), the best by quick light first, each
with several targets of the gain, whose light is known. Of all scored designs without a deadband that are better than
the original, the best of each kind is offered, and one whose verdict no unmeasured parameter changes is preferred. All
figures that are shown are those of the score. If no design is better, the best of the scored designs is reported.

The error of quick light mostly has the same sign for similar designs. The median by which quick light overrates the
margin in the scored designs is therefore subtracted for the others; near a scored design, its own difference.

The budget is counted in processor time as it usually is (`optopad.sims.score.cost.score_cost`), not as it was
measured: the same seed gives the same designs on every machine.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from os import PathLike
from pathlib import Path
from statistics import median
from typing import Any

from optopad.cli.verb import Asked, typed, verb
from optopad.design.draft import Draft
from optopad.design.errors import InputError, ModelScopeError
from optopad.design.fields.base import get_at, known_paths, set_at
from optopad.design.io import dump_design, load_design, read_design_text, write_text_atomically
from optopad.design.preset import preset_text
from optopad.design.progress import OnStep, silent
from optopad.design.rules.check import require_valid
from optopad.design.search.explore import Findings, OnTried
from optopad.design.search.improve import (
    AIMS,
    KINDS,
    LOCATION,
    NEAR_BEST_MM,
    ORDERS,
    SAFE_MARGIN,
    WORTH_ACCURACY,
    Judged,
    Kind,
    Range,
    Tried,
    changes_of,
    improvement_space,
    is_allowed,
    is_near,
    is_possible,
    margin_of,
    picks,
    usable_of,
    worth,
)
from optopad.design.search.points import (
    MOST_A_ROUND,
    MOVES,
    first_points,
    gain_points,
    refinements,
    spread_points,
)
from optopad.design.search.space import SearchSpace, Value
from optopad.design.shape.cavity import cavity_of, is_facing_rows, mask_of, plan_of
from optopad.design.spec import SensorDesign
from optopad.design.spec.properties import CLEAR, HEIGHTS, TARGET
from optopad.report.search import search_page
from optopad.screen.improvement import AT_RISK, Alternative, Improvement, Nearest
from optopad.screen.score import Score
from optopad.screen.search import Search
from optopad.sims.readings.readout import most_target_counts
from optopad.sims.score.build_tolerance import with_tolerance
from optopad.sims.score.cost import score_cost
from optopad.sims.score.field_steps import with_field_steps
from optopad.sims.score.judge import Judge
from optopad.sims.score.objective import (
    bodies_above_surface_mm,
    detection_force_n,
    judge,
    sizes_of,
    with_bounds,
)
from optopad.sims.score.result import ContinuityScore
from optopad.sims.score.scoring import verdict_of
from optopad.sims.score.smallest_mold import least_rim, smallest_mold
from optopad.sims.verdict.depth_curve import DEADBAND_THRESHOLD
from optopad.verbs.explore import search
from optopad.work import OUT

Light = tuple[tuple[str, Value], ...]
BOUND_AIMS, SIZE_AIMS = ("location", "contact"), ("size", "flush")
"""Aims whose figure is a bound, and those whose figure follows from the mold."""
PAD_MINUTES, ROW_MINUTES = 3.0, 2.0
"""Default time budgets to improve a pad, and facing rows of parts [min on two cores]."""
CORES = 2
REVISED_SHARE = 0.4
"""Processor time to judge a design of a search again at a few more locations, as a share of the first time [-]."""
PAD_S, PAIR_S, ROW_S = 1.9, 0.04, 0.6
"""Processor time to evaluate one design in the search [s]: for a pad a fixed part and a part per pair, for facing rows
one value."""
CURVED = 4.0
"""Factor by which the search takes longer per design for a round pad or one with a convex top [-]."""
SEARCH, HARD_SEARCH = 0.3, 0.7
"""Fraction of the time budget for the search with its coarse light model [-]; the rest is for full scores. The second
value is for a search that has found no design without a deadband."""
SPREAD = 0.6
"""Largest fraction of a search's designs that samples the parts' heights and the pad's thickness evenly [-]."""
FEWEST, MOST = 12, 400
"""Least and largest number of designs in a search, not counting variations of the best ones."""
MOST_ROUNDS = 60
"""Largest number of rounds of variations."""
BOUNDS_FACTOR = 2.0
"""Factor by which the search takes longer per design if it needs the bounds of all designs [-]."""
SCORE_S, KNOWN_S = 0.5, 0.1
"""Processor time of a score besides light, and to judge a design whose light is known [s]."""
ATTEMPTS, ROW_ATTEMPTS = 4, 8
"""Number of candidates that are scored for one kind of improvement even if the budget is used: for a pad, and for
facing rows. It is also the largest number of designs of a kind whose unmeasured parameters are varied."""
FIRMER = 1.3
"""If an unmeasured parameter changes a design's verdict, similar candidates need this factor times its margin [-]."""
LEAST_JUDGED = 4
"""Number of designs that are scored in full even if the search's coarse light finds a deadband in all designs."""
MOST_OFFERED = 4
"""Largest number of alternatives."""
MOST_BOUNDS = 4
"""Largest number of a search's pads for which bounds of location and depth are computed, and of scores of a kind."""


@verb(
    vary=typed("FIELD[=A:B]", type=list[str]),
    keep=typed("FIELD"),
    aim=typed("AIM"),
    budget_min=typed("MINUTES", flag="--budget"),
)
def improve(
    design: SensorDesign,
    *,
    vary: Mapping[str, Range | None] | Sequence[str] | None = None,
    keep: Sequence[str] = (),
    more_parts: bool = False,
    aim: str | None = None,
    budget_min: float | None = None,
    out: str | PathLike[str] = OUT,
    seed: int = 0,
    on_step: OnStep | None = None,
    on_tried: OnTried | None = None,
    asked: Asked | None = None,
) -> Improvement:
    """Propose up to four changed designs with a better verdict, as files; the same command continues a search.

    `vary` may be a mapping from fields to their ranges, or to None for the default range. The files keep the comments
    of the design file that the command line names.

    Parameters
    ----------
    vary : Vary this field, too, from A to B. Repeatable.
    keep : Keep the value of this field. Repeatable.
    more_parts : Also try more parts per side.
    aim : What better means: margin, location, contact, size, flush.
    budget_min : Approximate search time; default: 3 for a pad, 2 for facing rows.

    Raises
    ------
    DesignError, InputError : the design, a field, a range, the aim or the budget is invalid.
    """
    ranges = dict(vary) if isinstance(vary, Mapping) else dict(_range(one) for one in vary or ())
    require_valid(design)
    facing = is_facing_rows(cavity_of(design))
    _require_aim(aim, facing=facing)
    trials, costs = trials_of(design, budget_min), Costs.of(design, budget_min, aim)
    space = improvement_space(
        design,
        vary=ranges,
        keep=keep,
        more_parts=more_parts,
        most_counts=_most_counts(design, seed),
        aim=aim,
        trials=trials,
        seed=seed,
        figures=("margin", AIMS[aim] if aim in BOUND_AIMS else "usable_depth_mm"),
    )
    accuracy = "resolvable_steps" if facing else LOCATION
    again = Confirmation(space, accuracy, costs, aim=aim, seed=seed, tell=on_step or silent)
    before = again.before
    if before.verdict == "OUT_OF_MODEL_SCOPE":
        raise InputError(f"{design.name}: {before.reason}; improve needs a design that the models cover")
    before = with_field_steps(design, before, seed=seed, on_step=again.tell)
    first = [one for one in _first(space, before, trials) if is_allowed(space, one)]
    found = search(
        space,
        Path(out),
        trials=max(trials, len(first) + 1),
        on_tried=on_tried,
        first=first,
        refine=partial(_refined, again, starts=2 if facing else 1),
        also_mm=_deciding_places(before),
    )
    made = Improvement(
        design=design,
        before=Score(design=design, found=before),
        aim=aim,
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
        alternatives=alternatives,
        nearest=None if alternatives else again.nearest(),
        judged_again=len(again.scores) - 1,
    )
    text = None if asked is None else _text(asked.design, design, is_changed=bool(asked.changes))
    _write(made, found, text)
    return made


def _text(where: str, design: SensorDesign, *, is_changed: bool) -> str | None:
    """Text of a design file; None if fields were changed (`is_changed`) or the design has parts of its own."""
    path = Path(where)
    if is_changed or any(design.catalog.model_dump().values()):
        return None
    if not path.exists():
        return preset_text(where)
    text = read_design_text(path / "design.toml" if path.is_dir() else path)
    first, _, rest = text.partition("\n")
    return rest if first.startswith("# optopad design ") else text  # it names a digest, which will change


def _range(text: str) -> tuple[str, tuple[float, float] | None]:
    path, equals, ends = text.partition("=")
    if not equals:
        return path.strip(), None
    try:
        low, high = (float(end) for end in ends.split(":"))
    except ValueError:
        raise InputError(
            f"--vary: {text!r} is refused: write FIELD=A:B, as receivers.height_mm=5:7"
        ) from None
    return path.strip(), (low, high)


def _require_aim(aim: str | None, *, facing: bool) -> None:
    if aim is not None and aim not in AIMS:
        raise InputError(f"--aim: {aim!r} is refused: give one of {', '.join(AIMS)}")
    if aim == "location" and facing:
        raise InputError(
            "--aim: location is refused for facing rows, which do not resolve the location of a press; give one of "
            + ", ".join(one for one in AIMS if one != aim)
        )


def _most_counts(design: SensorDesign, seed: int) -> float:
    """Largest useful target of the gain, from the untouched light; infinite if the models do not cover the design."""
    judge = Judge(Draft.of(design), "search", seed=seed)
    try:
        return most_target_counts(judge.draft, judge.untouched, mask_of(judge.names, judge.cavity))
    except ModelScopeError:
        return math.inf


@dataclass(frozen=True, kw_only=True)
class Costs:
    """Usual processor times of the parts of an improvement [s].

    Attributes
    ----------
    budget_s : the whole budget
    trial_s : one design of the search
    verdict_s, bounds_s, tolerance_s : verdict of one design at the accuracy of a score, its bounds, and the effect of
        its unmeasured parameters
    """

    budget_s: float
    trial_s: float
    verdict_s: float
    bounds_s: float
    tolerance_s: float

    @classmethod
    def of(cls, design: SensorDesign, budget_min: float | None, aim: str | None) -> Costs:
        """The costs of a design's improvement; equal on all machines."""
        stages = score_cost(design)
        return cls(
            budget_s=_budget_s(design, budget_min),
            trial_s=_trial_s(design) * (BOUNDS_FACTOR if aim in BOUND_AIMS else 1.0),
            verdict_s=SCORE_S + stages["untouched"] + stages["map"],
            bounds_s=stages["bounds"],
            tolerance_s=0.5 * stages["builds"],
        )

    def of_search(self, tried: Sequence[Tried]) -> float:
        """Processor time of a search [s]; refused designs cost nothing, and designs whose light is known hardly any."""
        lit = [_light_of(one) for one in tried if one.digest and not one.judged.reason.startswith("breaks")]
        return len(set(lit)) * self.trial_s + (len(lit) - len(set(lit))) * KNOWN_S


def _light_of(one: Tried) -> Light:
    return _light(one.parameters)


def _light(parameters: Mapping[str, Value]) -> Light:
    """The values on which a design's light depends."""
    return tuple(sorted((path, value) for path, value in parameters.items() if path != TARGET))


def _refined(again: Confirmation, findings: Findings, number: int, *, starts: int) -> list[dict[str, Value]]:
    """Variations of the best designs, while the search's share of the budget lasts."""
    space, tried = again.space, again.with_aim(findings.tried)
    share = SEARCH if any(is_possible(one.judged) for one in tried) else HARD_SEARCH
    if number >= len(MOVES) and again.costs.of_search(tried) >= share * again.costs.budget_s:
        return []
    for round_number in range(number, min(number + 2 * len(MOVES), MOST_ROUNDS)):
        points = refinements(space, tried, round_number, starts=starts, aim=again.by_aim)
        if allowed := [one for one in points if is_allowed(space, one)]:
            return allowed
    return []


def _budget_s(design: SensorDesign, budget_min: float | None) -> float:
    facing = is_facing_rows(cavity_of(design))
    budget = (ROW_MINUTES if facing else PAD_MINUTES) if budget_min is None else budget_min
    if not 0.0 < budget <= 24 * 60:
        raise InputError(f"--budget: {budget:g} minutes is refused: give more than 0, up to 1440")
    return budget * 60.0 * CORES


def _trial_s(design: SensorDesign) -> float:
    cavity = cavity_of(design)
    pad_s = PAD_S + PAIR_S * len(cavity.emitters) * len(cavity.receivers)
    each_s = ROW_S if is_facing_rows(cavity) else pad_s
    return each_s * (1.0 if plan_of(design).is_block else CURVED)


def trials_of(design: SensorDesign, budget_min: float | None) -> int:
    """Number of designs before variations of the best ones, for a time budget [min]; equal on all machines."""
    around = len(MOVES) * MOST_A_ROUND * (2 if is_facing_rows(cavity_of(design)) else 1)
    each = int(SEARCH * _budget_s(design, budget_min) / _trial_s(design))
    return min(max(each - around, FEWEST), MOST)


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
        text = dump_design(made.design).split("\n", 1)[1]  # its first line names the digest, which changes
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


@dataclass(frozen=True, kw_only=True)
class Scored:
    """A scored design: `tried` has the score's figures."""

    tried: Tried
    design: SensorDesign
    score: ContinuityScore

    @property
    def is_robust(self) -> bool:
        """Whether no unmeasured parameter changes the verdict."""
        return self.score.tolerance is None or not self.score.tolerance.flipping


class Confirmation:
    """Full scores of designs from a search, with the light model of `optopad score`; each is computed once.

    Parameters
    ----------
    space : the search space
    accuracy : name of the figure by which the accuracy of designs is compared
    aim : the user's aim, or None
    """

    def __init__(
        self,
        space: SearchSpace,
        accuracy: str,
        costs: Costs,
        *,
        aim: str | None,
        seed: int,
        tell: OnStep,
    ) -> None:
        self.space, self.accuracy, self.costs, self.seed, self.tell = space, accuracy, costs, seed, tell
        self.aim, self.kinds = aim, KINDS if aim is None else (aim, *KINDS)
        self.scores: dict[str, ContinuityScore] = {}
        self.pool: dict[str, Scored] = {}
        self._sizes: dict[str, dict[str, float | None]] = {}
        self.overrated, self.most_mm = 0.0, math.inf
        self._differences = [0.0]
        self._overrates: list[tuple[Tried, float]] = []
        self._lit, self._hoped = set[Light](), dict[Light, float]()
        self._bounded = {_light(space.base_parameters() or {})}
        self._revised: dict[int, tuple[Tried, int]] = {}
        before = self.verdict(space.base)
        self._deciding_mm = _deciding_places(before)
        self.before = with_bounds(space.base, before, on_step=tell)
        self.spent_s = costs.verdict_s + costs.bounds_s + costs.tolerance_s
        self.base = Judged()

    def verdict(self, design: SensorDesign) -> ContinuityScore:
        """Verdict of a design with the light model of `optopad score`.

        Bounds, the effect of unmeasured parameters and figures of a pad's single pairs are left out.
        """
        if design.digest not in self.scores:
            self.scores[design.digest] = verdict_of(design, seed=self.seed, on_step=self.tell)
        return self.scores[design.digest]

    def by_aim(self, one: Tried) -> tuple[float, ...]:
        """Sort key for the user's aim, or else for the margin; larger is better."""
        key = ORDERS[self.aim or "margin"](self.space, one, self.accuracy)
        return (float(is_possible(one.judged)), *(-value for value in key), -one.number)

    def with_aim(self, tried: Sequence[Tried]) -> list[Tried]:
        """The designs with the sizes that an aim needs and a search does not compute."""
        if self.aim not in SIZE_AIMS:
            return list(tried)
        return [
            replace(one, judged=self._sized(one.judged, self.space.changed(one.parameters)))
            if one.digest
            else one
            for one in tried
        ]

    def _sized(self, judged: Judged, design: SensorDesign) -> Judged:
        """The result with the sizes of a design whose rim is as low as its bodies."""
        if design.digest not in self._sizes:
            rim = max(bodies_above_surface_mm(design), 0.0)
            low = design.with_(**{"mold.rim_mm": min(rim, design.mold.rim_mm)})
            self._sizes[design.digest] = sizes_of(low)
        return replace(judged, figures=judged.figures | self._sizes[design.digest])

    def found_by_search(self, base: Judged, tried: Sequence[Tried]) -> list[Tried]:
        """Store the search's figures of the original design, and return the search's designs.

        For a pad, the best designs get their bounds of location and depth.
        """
        self.spent_s += self.costs.of_search(tried)
        self.base = replace(base, verdict=self.before.verdict)
        if self.aim in SIZE_AIMS:
            self.base = replace(self.base, figures=self.base.figures | sizes_of(self.space.base))
        self._learn(base, self.before)
        tried = self.with_aim([*tried, *self._at_other_gains(tried)])
        best = sorted(
            (one for one in tried if is_possible(one.judged)), key=lambda one: worth(one.judged), reverse=True
        )
        if self.accuracy != LOCATION or not best or self.aim in BOUND_AIMS:
            return tried
        self.base = self._with_accuracy(self.base, self.space.base)
        numbers = {one.number for one in best[:MOST_BOUNDS]}
        return [
            replace(one, judged=self._with_accuracy(one.judged, self.space.changed(one.parameters)))
            if one.number in numbers
            else one
            for one in tried
        ]

    def _at_other_gains(self, tried: Sequence[Tried]) -> list[Tried]:
        """The search's designs with other targets of the gain, so that each is known at its best."""
        known = {(_light_of(one), one.parameters.get(TARGET)) for one in tried}
        found: list[Tried] = []
        for one in tried:
            for point in gain_points(self.space, one.parameters) if is_possible(one.judged) else ():
                if (_light_of(one), point[TARGET]) in known or not is_allowed(self.space, point):
                    continue
                known.add((_light_of(one), point[TARGET]))
                self.spent_s += KNOWN_S
                design = self.space.changed(point)
                made = replace(one, number=-1 - len(found), parameters=point, digest=design.digest)
                found.append(replace(made, judged=self._quick(design)))
        return found

    def _quick(self, design: SensorDesign) -> Judged:
        """Verdict and margin with a search's light, also where scored designs were decided."""
        accuracy, also_mm = self.space.accuracy, self._deciding_mm
        return judge(design, (), wanted=("margin",), accuracy=accuracy, also_mm=also_mm, seed=self.seed)

    def _with_accuracy(self, judged: Judged, design: SensorDesign) -> Judged:
        self.tell("accuracy", 0.0)
        self.spent_s += self.costs.trial_s
        more = judge(design, (), wanted=(LOCATION,), accuracy=self.space.accuracy, seed=self.seed)
        return replace(judged, figures=more.figures | judged.figures)

    def alternatives(self, tried: Sequence[Tried]) -> tuple[Alternative, ...]:
        """The best scored design for every quantity to improve (such as "most depth"), all different.

        Every change of one field alone is scored, then some candidates of each kind, then all kinds in turn, until the
        budget is used or no candidate is left.
        """
        attempts = ATTEMPTS if self.accuracy == LOCATION else ROW_ATTEMPTS
        wanted = self.kinds[:1] if self.aim else self.kinds
        reserve_s = self.costs.bounds_s + self.costs.tolerance_s
        for single in self._single_changes(tried):
            if self.spent_s < self.costs.budget_s - reserve_s:
                self._add(single)
        for kind in (*wanted, None):
            for number in range(attempts):
                one = self._next_of(kind, tried)
                if one is None or (kind is None and (self.best(KINDS[0]) or number >= LEAST_JUDGED)):
                    break
                self._add(one)
                best = None if kind is None or kind in BOUND_AIMS else self.best(kind)
                if best is not None and best.is_robust:
                    break
        while self.spent_s < self.costs.budget_s - reserve_s:
            found = [one for kind in wanted if (one := self._next_of(kind, tried)) is not None]
            if not found and not self.best(KINDS[0]):
                rest = self._next_of(None, tried)
                found = [] if rest is None else [rest]
            if not found:
                break
            for one in found:
                self._add(one)
        return self._offered()

    def _single_changes(self, tried: Sequence[Tried]) -> list[Tried]:
        """For each field, the best design of the search that changes it alone, besides the gain.

        It is what a user would try by hand, and the error of quick light may hide how good it is.
        """
        best = dict[frozenset[str], Tried]()
        for one in sorted(tried, key=self.by_aim):
            fields = frozenset(changes_of(self.space, one.parameters)) - {TARGET}
            if one.digest and len(fields) <= 1 and is_possible(one.judged):
                best[fields] = one
        return sorted(best.values(), key=self.by_aim, reverse=True)

    def _next_of(self, kind: Kind | None, tried: Sequence[Tried]) -> Tried | None:
        """The next candidate for a kind that is not scored yet; for None, the best of all designs.

        It is the first with the required margin, corrected for the search's typical error; if none has it, the best.
        """
        fresh = [self._latest(one) for one in tried if one.digest and _light_of(one) not in self._lit]
        if kind is None:
            return max(
                (one for one in fresh if one.judged.figures), key=lambda one: worth(one.judged), default=None
            )
        while True:
            best = self._first_of(kind, fresh)
            if best is None or self._is_latest(best):
                return best
            self._revise(best)
            fresh = [self._latest(one) for one in fresh]

    def _latest(self, one: Tried) -> Tried:
        return self._revised.get(one.number, (one, 0))[0]

    def _is_latest(self, one: Tried) -> bool:
        _, known = self._revised.get(one.number, (one, len(_deciding_places(self.before))))
        return known == len(self._deciding_mm)

    def _revise(self, one: Tried) -> None:
        """Judge a design of the search also at the locations that decided the verdict of scored designs.

        The few locations of a search may miss the one with the least margin, so it would overrate all similar designs.
        """
        self.spent_s += REVISED_SHARE * self.costs.trial_s
        more = self._quick(self.space.changed(one.parameters))
        judged = replace(more, figures=one.judged.figures | more.figures)
        self._revised[one.number] = replace(one, judged=judged), len(self._deciding_mm)

    def _first_of(self, kind: Kind, fresh: Sequence[Tried]) -> Tried | None:
        every = picks(self.space, self.base, fresh, self.accuracy, self.most_mm, kinds=(kind,))
        candidates = [pick.tried for pick in every]
        margin = DEADBAND_THRESHOLD if kind == "most depth" else SAFE_MARGIN
        corrected = [
            replace(
                one, judged=replace(one.judged, figures=one.judged.figures | {"margin": self._expected(one)})
            )
            for one in candidates
        ]
        safe = [one for one in corrected if margin_of(one.judged) >= margin]
        if kind in ("margin", "most robust"):
            safe.sort(key=lambda one: ORDERS[kind](self.space, one, self.accuracy))
        best = safe[0] if safe else max(corrected, key=lambda one: worth(one.judged), default=None)
        return next((one for one in candidates if best is not None and one.number == best.number), None)

    def _expected(self, one: Tried) -> float:
        """Margin that a score is expected to find: quick light overrates similar designs alike [sigma]."""
        near = [
            difference
            for other, difference in self._overrates
            if is_near(self.space, one, other, apart_from=(TARGET,))
        ]
        return margin_of(one.judged) - max([self.overrated, *near])

    def _add(self, one: Tried) -> None:
        """Score a design, and, if its verdict is good or nearly so, the same design with other targets of the gain."""
        score = self._scored(one)
        new_mm = [place for place in _deciding_places(score) if place not in self._deciding_mm]
        if new_mm:
            self._deciding_mm += new_mm
            self._revise(one)
            one = self._latest(one)
        self._learn(one.judged, score)
        if self.aim is not None and self.aim in BOUND_AIMS:
            self._hoped[_light_of(one)] = one.judged.figures.get(AIMS[self.aim]) or math.inf
        if score.margin is not None:
            self._overrates.append((one, margin_of(one.judged) - score.margin))
        if (score.margin or 0.0) > 0.5 * DEADBAND_THRESHOLD:
            for point in gain_points(self.space, one.parameters):
                if is_allowed(self.space, point):
                    self._scored(replace(one, parameters=point, judged=Judged()))

    def _scored(self, one: Tried) -> ContinuityScore:
        design = self.space.changed(one.parameters)
        also = self._also(design)
        design = design.with_(**also)
        self.tell("score", 0.0)
        known = _light_of(one) in self._lit
        self._lit.add(_light_of(one))
        self.spent_s += KNOWN_S if known else self.costs.verdict_s
        score = self.verdict(design)
        self._keep(replace(one, also=also, digest=design.digest), design, score)
        return score

    def _also(self, design: SensorDesign) -> dict[str, float]:
        if self.aim == "size":
            return smallest_mold(design)
        return least_rim(design) if self.aim == "flush" else {}

    def _keep(self, one: Tried, design: SensorDesign, score: ContinuityScore) -> Scored:
        self.scores[design.digest] = score
        made = Scored(tried=replace(one, judged=self._judged(design, score)), design=design, score=score)
        self.pool[design.digest] = made
        return made

    def _judged(self, design: SensorDesign, score: ContinuityScore) -> Judged:
        """A score's figures, as the search compares them."""
        own: dict[str, float | None] = {
            "deadband_mm": score.deadband_total_mm,
            "usable_depth_mm": score.usable_depth_mm,
            "margin": score.margin,
        }
        if self.aim in SIZE_AIMS:
            own |= sizes_of(design)
        if score.bounds is not None:
            location = score.bounds.median_location_mm.value
            own[LOCATION] = location if math.isfinite(location) else None
            if score.bounds.detection is not None:
                own["detection_force_n"] = detection_force_n(score.bounds.detection)
        verdict = "DEADBAND" if score.is_open else score.verdict
        return Judged(figures=own, verdict=verdict, may_be=verdict == "CONTIGUOUS")

    def best(self, kind: Kind) -> Scored | None:
        """The best scored design of a kind, of those whose verdict no unmeasured parameter changes; else the best.

        Unmeasured parameters are varied for a limited number of designs, the best first.
        """
        if kind in ("best accuracy", *BOUND_AIMS):
            self._bound_best(kind)
        fallback: Scored | None = None
        flipped: list[Tried] = []
        for one in self._ranked(kind):
            if any(
                is_near(self.space, one.tried, other)
                and margin_of(one.tried.judged) < FIRMER * margin_of(other.judged)
                for other in flipped
            ):
                continue
            one = self._firm(one)
            if one.is_robust:
                return one
            fallback = fallback or one
            flipped.append(one.tried)
            if len(flipped) >= (ATTEMPTS if self.accuracy == LOCATION else ROW_ATTEMPTS):
                break
        return fallback

    def _ranked(self, kind: Kind) -> list[Scored]:
        base = self._judged(self.space.base, self.before)
        every = picks(
            self.space,
            base,
            [one.tried for one in self.pool.values()],
            self.accuracy,
            self.most_mm,
            kinds=(kind,),
            safe=DEADBAND_THRESHOLD,
        )
        return [self.pool[pick.tried.digest] for pick in every]

    def _bound_best(self, kind: Kind) -> None:
        """Compute bounds of the scored designs that may be the best of a kind.

        They are taken in the order of the aim's figure in quick light, if it is known, then by margin, largest first.
        """
        possible = [one.tried for one in self.pool.values() if is_possible(one.tried.judged)]
        possible.sort(key=lambda one: (self._hoped.get(_light_of(one), math.inf), -margin_of(one.judged)))
        for one in (self.pool[tried.digest] for tried in possible):
            is_known = _light_of(one.tried) in self._bounded
            is_over = self.spent_s > self.costs.budget_s and kind not in BOUND_AIMS
            if is_known or (len(self._bounded) <= MOST_BOUNDS and not is_over):
                self._with_bounds(one)

    def _with_bounds(self, one: Scored) -> Scored:
        if one.score.bounds is not None:
            return one
        known = _light_of(one.tried) in self._bounded
        self._bounded.add(_light_of(one.tried))
        self.spent_s += KNOWN_S if known else self.costs.bounds_s
        score = with_bounds(one.design, one.score, on_step=self.tell)
        return self._keep(one.tried, one.design, score)

    def _firm(self, one: Scored) -> Scored:
        if one.score.tolerance is not None:
            return one
        self.spent_s += self.costs.tolerance_s
        score = with_tolerance(one.design, one.score, seed=self.seed, on_step=self.tell)
        return self._keep(one.tried, one.design, score)

    def _offered(self) -> tuple[Alternative, ...]:
        """The alternatives, with bounds; a choice is made again if bounds that were added change it."""
        chosen = self._chosen()
        for _ in range(MOST_OFFERED):
            lacking = [one for _, one in chosen if one.score.bounds is None]
            for one in lacking:
                self._with_bounds(one)
            if not lacking:
                break
            chosen = self._chosen()
        return tuple(
            Alternative(
                kind=kind,
                changes=changes_of(self.space, one.tried.parameters) | dict(one.tried.also),
                design=one.design,
                file=f"{number}-{kind.replace(' ', '-')}.toml",
                score=one.score,
            )
            for number, (kind, one) in enumerate(chosen, 1)
        )

    def _chosen(self) -> list[tuple[Kind, Scored]]:
        self.most_mm = math.inf
        deepest = self.best("most depth")
        if deepest is not None:
            self.most_mm = deepest.score.usable_depth_mm or 0.0
        found: list[tuple[Kind, Scored]] = []
        for kind in self.kinds:
            one = self.best(kind)
            if one is None or any(other.design.digest == one.design.digest for _, other in found):
                continue
            depths = [other.score.usable_depth_mm or 0.0 for _, other in found]
            if kind == "most depth" and usable_of(one.tried.judged) < max(depths, default=0.0) + NEAR_BEST_MM:
                continue
            found.append((kind, one))
            bold = self._bolder(one) if kind == self.aim else None
            if bold is not None:
                found.append((kind + AT_RISK, bold))
        return found[:MOST_OFFERED]

    def _bolder(self, robust: Scored) -> Scored | None:
        """The best scored design in the aim, if it is better than the robust one by the share `WORTH_ACCURACY`."""
        assert self.aim is not None
        ranked = self._ranked(self.aim)
        best, mine = (
            ORDERS[self.aim](self.space, one.tried, self.accuracy)[0] for one in (ranked[0], robust)
        )
        return ranked[0] if best < mine - WORTH_ACCURACY * abs(mine) else None

    def _learn(self, judged: Judged, score: ContinuityScore) -> None:
        if score.margin is not None and judged.figures.get("margin") is not None:
            self._differences.append(margin_of(judged) - score.margin)
            self.overrated = max(median(self._differences), 0.0)

    def nearest(self) -> Nearest | None:
        """The best of the scored designs; None if no design was scored."""
        found = [one for one in self.pool.values() if changes_of(self.space, one.tried.parameters)]
        if not found:
            return None
        best = max(found, key=lambda one: worth(one.tried.judged))
        ends = tuple(
            field.path
            for field in self.space.fields
            if field.low is not None and float(best.tried.parameters[field.path]) in (field.low, field.high)
        )
        changes = changes_of(self.space, best.tried.parameters)
        return Nearest(changes=changes, at_ends=ends, score=best.score)
