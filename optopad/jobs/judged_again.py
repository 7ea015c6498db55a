"""Designs that a search proposes, judged again as `optopad score` judges, before any of them is named.

    by kind, best first ──► score's light: no deadband, better than before ──► unmeasured parameters ──► alternative
    none of them        ──► all others that quick light leaves possible    ──► alternative, or the nearest

Quick light mostly errs to the same side for designs that are alike: what it overrates of a margin is learnt from every
design that is judged again, the one before included, and taken off the others.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from design.search.improve import (
    KINDS,
    SAFE_MARGIN,
    Kind,
    Pick,
    betters,
    changes_of,
    is_possible,
    margin_of,
    worth,
)
from design.search.judged import Judged, Tried
from design.search.space import SearchSpace
from design.spec import SensorDesign
from optopad.results.improvement import Alternative, Nearest
from sims.continuity.build_tolerance import with_tolerance
from sims.continuity.objective import judge
from sims.continuity.result import ContinuityScore
from sims.continuity.scoring import verdict_of
from sims.verdict.pair.defaults import DEADBAND_THRESHOLD

OnStep = Callable[[str, float], None]
ATTEMPTS = 4
"""Designs of a kind that are judged again before the kind is given up."""
MOST_JUDGED = 12
"""Designs that are judged again before none is said to be better."""
LEAST_JUDGED = 2
"""So many of them though quick light finds a deadband in all."""
MOST_BOUNDS = 4
"""Designs of a pad whose accuracy is worked out."""
PLACE = "location_bound_mm"


class JudgedAgain:
    """Scores of a search's designs, each worked out once.

    Parameters
    ----------
    space : of the search
    accuracy : figure that the most accurate is best in
    """

    def __init__(self, space: SearchSpace, accuracy: str, *, seed: int, tell: OnStep) -> None:
        self.space, self.accuracy, self.seed, self.tell = space, accuracy, seed, tell
        self.scores: dict[str, ContinuityScore] = {}
        self.overrated = 0.0
        self.base, self.before = Judged(), self.verdict(space.base)

    def verdict(self, design: SensorDesign) -> ContinuityScore:
        """Verdict of a score, without the single pairs of a pad, bounds and unmeasured parameters."""
        if design.digest not in self.scores:
            self.scores[design.digest] = verdict_of(design, seed=self.seed, on_step=self.tell)
        return self.scores[design.digest]

    def found_by_search(self, base: Judged, tried: Sequence[Tried]) -> tuple[Tried, ...]:
        """Take the search's figures of the design before; the same designs, the best of a pad with their accuracy."""
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

    def alternatives(self, picks: Sequence[Pick], tried: Sequence[Tried]) -> tuple[Alternative, ...]:
        """Of every kind the first that keeps its promise, different from the others; else any that is better at all."""
        found: list[Alternative] = []
        for kind in KINDS:
            one = self._first_of(kind, [pick.tried for pick in picks if pick.kind == kind], ATTEMPTS)
            if one is not None and all(other.design.digest != one.design.digest for other in found):
                found.append(replace(one, file=f"{len(found) + 1}-{kind.replace(' ', '-')}.toml"))
        if not found:
            rest = sorted(tried, key=_worth, reverse=True)
            rest = [one for n, one in enumerate(rest) if is_possible(one.judged) or n < LEAST_JUDGED]
            one = self._first_of(KINDS[0], rest, MOST_JUDGED)
            found += [] if one is None else [one]
        return tuple(found)

    def _first_of(self, kind: Kind, candidates: list[Tried], attempts: int) -> Alternative | None:
        """The first candidate that is better by a score, and whose verdict no unmeasured parameter changes, if any."""
        undecided: Alternative | None = None
        for _ in range(min(attempts, len(candidates))):
            one = self._next_of(candidates)
            candidates.remove(one)
            changed = self.space.changed(one.parameters)
            self.tell(kind, 0.0)
            score = self.verdict(changed)
            self._learn(one.judged, score)
            if not self._is_better(one, score):
                continue
            if score.tolerance is None:
                score = with_tolerance(changed, score, seed=self.seed, on_step=self.tell)
                self.scores[changed.digest] = score
            made = Alternative(
                kind=kind,
                changes=changes_of(self.space, one.parameters),
                design=changed,
                file=f"1-{kind.replace(' ', '-')}.toml",
                figures=one.judged.figures,
                score=score,
            )
            if score.tolerance is None or not score.tolerance.flipping:
                return made
            undecided = undecided or made
        return undecided

    def _next_of(self, candidates: Sequence[Tried]) -> Tried:
        """The first whose margin stays safe without what quick light overrates, else the one with most of it."""
        safe = [one for one in candidates if margin_of(one.judged) - self.overrated >= SAFE_MARGIN]
        return safe[0] if safe else max(candidates, key=_worth)

    def _learn(self, judged: Judged, score: ContinuityScore) -> None:
        if score.margin is not None and judged.figures.get("margin") is not None:
            self.overrated = max(self.overrated, margin_of(judged) - score.margin)

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
        """The score's figures, with the accuracy that quick light gave."""
        own = {
            "deadband_mm": score.deadband_total_mm,
            "usable_depth_mm": score.usable_depth_mm,
            "margin": score.margin,
        }
        verdict = "DEADBAND" if score.is_open else score.verdict
        return Judged(figures=quick.figures | own, verdict=verdict, may_be=verdict == "CONTIGUOUS")

    def nearest(self, tried: Sequence[Tried]) -> Nearest | None:
        """Of the designs that were judged again the one that comes nearest to what is wanted; None without any."""
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
