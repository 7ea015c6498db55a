"""Search for a small change that removes a deadband: changes of component heights and layer thickness are tried.

    cause of the worst interval ──► fields to change ──► short verdicts on changes at that location
        ──► the smallest sufficient change ──► all locations of the changed pad ──► verdict

A line (`Line`) is a set of fields that change together: both heights, one of them, or the thickness. A move is a change
along a line by some length. Its direction follows from the cause. If the two modes are too far apart, components move
up, or the layer gets thinner. If the direct light is used up, the direction is opposite; otherwise both are tried. A
move is sufficient if no deadband is left and the margin is at least `ENOUGH_MARGIN`. If no move is sufficient, one more
component a side is tried. If no pair's chord runs near the location, this is tried first.

There is no trial for causes that heights do not fix (readings above full scale or too dim). Not tried: two lines at
once, and pitch, shift and gain, which `optopad improve` varies.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product

from optopad.design.draft import Draft
from optopad.design.errors import OptopadError
from optopad.design.fields.base import get_at
from optopad.design.progress import OnStep
from optopad.design.rules.check import check
from optopad.design.shape.cavity import cavity_of, is_facing_rows
from optopad.design.spec import SensorDesign
from optopad.design.spec.properties import CLEAR, HEIGHTS
from optopad.sims.score.build_tolerance import governing_judge
from optopad.sims.score.judge import SETTINGS, Judge
from optopad.sims.score.result import ContinuityScore
from optopad.sims.verdict.builds import Brief, BuildJudge, accuracy_of_builds, facing_judge
from optopad.sims.verdict.causes import Cause
from optopad.sims.verdict.depth_curve import DEADBAND_THRESHOLD
from optopad.sims.verdict.trial import Found, Move, Trial, TriedMove

Line = tuple[tuple[str, int], ...]
"""Fields that change together: path of each field, and sign of its change."""

ENOUGH_MARGIN = 1.5 * DEADBAND_THRESHOLD
"""Margin that a changed design must have [noise units]: one and a half times the threshold, because the light of a
trial is coarse.
"""
GAIN_MM = 0.3
"""Usable depth that a move must add if no move reaches the deepest press [mm]; equal to the least length of a
deadband.
"""
MOST_BRIEFS = 10
"""Largest number of short verdicts in a trial; this many take about a tenth of a score's processor time."""
GRID_MM = 0.1
"""All moves are multiples of this step [mm], a resolution that printed molds can reach."""
LENGTHS_MM = (0.8, 3.0)
"""Smallest and largest length of the first move [mm]. Between them, the length follows from the cause if the cause has
one.
"""
SHARES = (0.5, 0.8, 0.25)
"""Lengths of moves along the first line, as shares of the first move's length; tried in this order until one is
sufficient.
"""
BISECTIONS = 2
FIXED_BY_HEIGHTS = ("apart", "used up", "cancel", "slight", "none near")
MORE_PARTS = {
    "alternating_ring": "parts_per_side",
    "facing_rows": "count",
    "disc_ring": "count",
}
"""For each layout pattern, the name of the field that sets its number of components."""
NEARER = 0.94
"""Pitch as a share of even spacing [-], tried if even spacing puts components too near the corners."""


def with_trial(
    design: SensorDesign, score: ContinuityScore, *, seed: int = 0, on_step: OnStep | None = None
) -> ContinuityScore:
    """A score with a trial of changes that would help.

    The score is returned unchanged if depth is resolved everywhere, or if heights do not fix the cause.

    Parameters
    ----------
    score : score of that design, with the map if the design is a pad
    on_step : called with the name of the running stage and the share of it that is done, 0 to 1
    """
    if score.readout is None or not score.causes or score.causes[0].lack not in FIXED_BY_HEIGHTS:
        return score
    search = _Search(design, score, seed, on_step or (lambda _stage, _share: None))
    return replace(score, trial=search.outcome())


@dataclass(frozen=True, kw_only=True)
class _Tried:
    line: Line
    length_mm: float
    build: SensorDesign
    brief: Brief


@dataclass(frozen=True, kw_only=True)
class _Whole:
    """Verdict on all locations of a changed pad, or on all facing pairs."""

    verdict: str
    deadband_mm: float
    usable_mm: float
    margin: float
    judged: str


class _Search:
    """Search for a sufficient move for the first cause of a score, trying one set of fields after another."""

    def __init__(self, design: SensorDesign, score: ContinuityScore, seed: int, tell: OnStep) -> None:
        self.design, self.score, self.seed, self.tell = design, score, seed, tell
        self.cause = score.causes[0]
        self.searched, self.judge = _judge_at(design, score, self.cause, seed)
        self.deepest_mm = design.operating.max_depth_mm
        self.known = {str(one) for one in check(design)}
        self.tried: dict[tuple[Line, float], _Tried | None] = {}
        self.more_parts_tried = False

    def outcome(self) -> Trial:
        """Result of the search.

        Moves are tried before more components, unless no pair's chord runs near the location.
        """
        steps = (self._move_that_helps, self._parts_that_help)
        for step in steps[::-1] if self.cause.lack == "none near" else steps:
            found = step()
            if found is not None:
                return found
        return self._trial("none", (), None)

    def _move_that_helps(self) -> Trial | None:
        self._search()
        for one in self._candidates():
            whole = self._whole(one.build, one.brief)
            if whole is not None and self._is_better(whole):
                changes = _changes(self.design, one.line, one.length_mm)
                return self._trial("move", _moves(self.design, changes), whole)
        return None

    def _parts_that_help(self) -> Trial | None:
        for changes, build in _with_more_parts(self.design):
            self.more_parts_tried = True
            whole = self._whole(build, None)
            if whole is not None and self._is_better(whole):
                return self._trial("more parts", _moves(self.design, changes), whole)
        return None

    def _rows(self) -> list[_Tried]:
        return [one for one in self.tried.values() if one is not None]

    def _candidates(self) -> list[_Tried]:
        """The smallest useful move, then the move with the largest margin, because another location may need more."""
        useful = [one for one in self._rows() if self._is_useful(one.brief)]
        if not useful:
            return []
        least = min(useful, key=self._rank)
        safest = max(useful, key=lambda one: one.brief.margin)
        return [least] if safest is least else [least, safest]

    def _trial(self, found: Found, moves: tuple[Move, ...], whole: _Whole | None) -> Trial:
        rows = self._rows()
        return Trial(
            kind=self.cause.kind,
            found=found,
            moves=moves,
            verdict=None if whole is None else whole.verdict,
            deadband_mm=None if whole is None else whole.deadband_mm,
            usable_mm=None if whole is None else whole.usable_mm,
            margin=None if whole is None else whole.margin,
            judged="" if whole is None else whole.judged,
            searched=self.searched,
            tried=tuple(
                TriedMove(
                    changes=_changes(self.design, one.line, one.length_mm),
                    deadband_mm=one.brief.deadband_mm,
                    usable_mm=self._usable(one.brief),
                    margin=one.brief.margin,
                )
                for one in rows
            ),
            farthest_mm=max((one.length_mm for one in rows), default=0.0),
            more_parts_tried=self.more_parts_tried,
        )

    def _search(self) -> None:
        start = _on_grid(min(max(self.cause.short_mm or 0.0, LENGTHS_MM[0]), LENGTHS_MM[1]))
        for side in _sides(self.cause):
            both, receivers, emitters, clear = _lines(self.design, side)
            enough = next((s for s in SHARES if self._reaches(both, s * start)), None)
            if enough is None:
                for line, share in ((clear, 0.5), *product((receivers, emitters), (1.0, 0.5))):
                    self._reaches(line, share * start)
                continue
            least = self._shortened(both, _on_grid(enough * start))
            for line, share in ((receivers, 2.0), (emitters, 2.0), (clear, 1.0)):
                self._reaches(line, share * least)

    def _shortened(self, line: Line, enough_mm: float) -> float:
        """The smallest sufficient move along a line [mm], by bisection below `enough_mm`, which is sufficient."""
        below = [
            length for (of, length), one in self.tried.items() if of == line and length < enough_mm and one
        ]
        low = max(below, default=0.0)
        for _ in range(BISECTIONS):
            middle = _on_grid(0.5 * (low + enough_mm))
            if not low < middle < enough_mm:
                break
            if self._reaches(line, middle):
                enough_mm = middle
            else:
                low = middle
        return enough_mm

    def _reaches(self, line: Line, length_mm: float) -> bool:
        """Whether a move is sufficient by its short verdict.

        It is False if the move breaks a rule, or if `MOST_BRIEFS` verdicts have been made already.
        """
        length_mm = _on_grid(length_mm)
        if (line, length_mm) not in self.tried and line and length_mm > 0.0:
            if len(self._rows()) >= MOST_BRIEFS:
                return False
            self.tried[line, length_mm] = self._brief(line, length_mm)
            self.tell("trial", min(len(self.tried) / MOST_BRIEFS, 1.0))
        one = self.tried.get((line, length_mm))
        return one is not None and self._is_enough(one.brief)

    def _brief(self, line: Line, length_mm: float) -> _Tried | None:
        build = _changed(self.design, _changes(self.design, line, length_mm))
        if build is None or is_facing_rows(cavity_of(build)) != self.score.is_facing_rows:
            return None
        try:
            return _Tried(line=line, length_mm=length_mm, build=build, brief=self.judge(Draft.of(build)))
        except OptopadError:
            return None

    def _usable(self, brief: Brief) -> float:
        return self.deepest_mm if brief.usable_mm is None else brief.usable_mm

    def _is_enough(self, brief: Brief) -> bool:
        is_deep = self.cause.kind == "deadband" or self._usable(brief) >= self.deepest_mm - 1e-9
        return brief.deadband_mm == 0.0 and brief.margin >= ENOUGH_MARGIN and is_deep

    def _is_useful(self, brief: Brief) -> bool:
        """Whether a move is sufficient, or at least leaves no deadband and adds `GAIN_MM` to the usable depth."""
        deeper = self._usable(brief) - (self.score.usable_depth_mm or 0.0)
        is_clear = brief.deadband_mm == 0.0 and brief.margin >= ENOUGH_MARGIN
        return self._is_enough(brief) or (is_clear and self.cause.kind == "fade" and deeper >= GAIN_MM)

    def _is_better(self, whole: _Whole) -> bool:
        """Whether the changed pad has no deadband, enough margin, and more usable depth if that was the cause."""
        deeper = whole.usable_mm - (self.score.usable_depth_mm or 0.0)
        is_clear = whole.deadband_mm == 0.0 and whole.margin >= ENOUGH_MARGIN
        return is_clear and (self.cause.kind == "deadband" or deeper >= GAIN_MM)

    def _rank(self, one: _Tried) -> tuple[int, int, int, float]:
        """Sort key of a move, smallest first.

        The key consists of the depth lost in steps of `GAIN_MM`, the number of new rule findings, the number of fields,
        and the length.
        """
        lost = round((self.deepest_mm - self._usable(one.brief)) / GAIN_MM)
        news = sum(str(finding) not in self.known for finding in check(one.build))
        return lost, news, len(one.line), one.length_mm

    def _whole(self, build: SensorDesign, brief: Brief | None) -> _Whole | None:
        try:
            if self.score.is_facing_rows:
                found = brief or facing_judge(seed=self.seed)[1](Draft.of(build))
                return _Whole(
                    verdict="DEADBAND" if found.deadband_mm > 0.0 else "CONTIGUOUS",
                    deadband_mm=found.deadband_mm,
                    usable_mm=self._usable(found),
                    margin=found.margin,
                    judged="all facing pairs, coarse light",
                )
            return _whole_pad(build, self.seed)
        except OptopadError:
            return None


def _judge_at(
    design: SensorDesign, score: ContinuityScore, cause: Cause, seed: int
) -> tuple[str, BuildJudge]:
    """A judge for short verdicts and its name: on all facing pairs, or at the location of a pad's cause."""
    if score.is_facing_rows or score.pad_map is None:
        return facing_judge(seed=seed)
    here = min(
        score.pad_map.places,
        key=lambda one: (one.x_mm - cause.place_mm[0]) ** 2 + (one.y_mm - cause.place_mm[1]) ** 2,
    )
    name, judge, _ = governing_judge(
        design, replace(score, pad_map=replace(score.pad_map, places=(here,))), seed
    )
    return name, judge


def _sides(cause: Cause) -> tuple[int, ...]:
    """Directions to try: 1 moves components nearer to the top, -1 away from it."""
    return {"apart": (1,), "used up": (-1,)}.get(cause.lack, (1, -1))


def _lines(design: SensorDesign, side: int) -> tuple[Line, Line, Line, Line]:
    """Lines to try: both heights, the receivers', the emitters', the thickness. A line is empty if impossible."""
    fields = {part.height_field for part in cavity_of(design).parts}
    emitters, receivers = (((path, side),) if path in fields else () for path in HEIGHTS)
    both = emitters + receivers if emitters and receivers else ()
    return both, receivers, emitters, ((CLEAR, -side),)


def _on_grid(length_mm: float) -> float:
    return round(GRID_MM * round(length_mm / GRID_MM), 6)


def _changes(design: SensorDesign, line: Line, length_mm: float) -> dict[str, float]:
    values = design.model_dump(mode="json")
    return {path: round(float(get_at(values, path)) + sign * length_mm, 6) for path, sign in line}


def _changed(design: SensorDesign, changes: dict[str, float]) -> SensorDesign | None:
    """The design with these fields changed; None if the result breaks a rule."""
    try:
        build = design.with_(**changes)
        return None if any(one.severity == "error" for one in check(build)) else build
    except OptopadError:
        return None


def _moves(design: SensorDesign, changes: dict[str, float]) -> tuple[Move, ...]:
    values = design.model_dump(mode="json")
    parts = cavity_of(design).parts
    return tuple(
        Move(
            path=path,
            parts=_span([part.name for part in parts if part.height_field == path]),
            was=get_at(values, path),
            to=to,
        )
        for path, to in changes.items()
    )


def _span(names: Sequence[str]) -> str:
    """First and last of several component names, such as E1-E4."""
    return f"{names[0]}-{names[-1]}" if len(names) > 1 else "".join(names)


def _with_more_parts(design: SensorDesign) -> Iterator[tuple[dict[str, float], SensorDesign]]:
    """Changes and design for one more component a side, in the first layout pattern that has a number of components.

    If one more breaks a rule, two more are tried. In a ring, each is also tried with a smaller pitch. The iterator is
    empty if none is valid.
    """
    for number, pattern in enumerate(design.layout):
        name = MORE_PARTS.get(pattern.pattern)
        count = getattr(pattern, name) if name else None
        if not isinstance(count, int):
            continue
        for more in (1, 2):
            changes: dict[str, float] = {f"layout.{number}.{name}": count + more}
            nearer_mm = _on_grid(
                NEARER * min(design.cavity.length_mm, design.cavity.width_mm) / (count + more)
            )
            closer = changes | {f"layout.{number}.pitch_mm": nearer_mm}
            for tried in (changes, closer) if pattern.pattern == "alternating_ring" else (changes,):
                build = _changed(design, tried)
                if build is not None:
                    yield tried, build
                    return


def _whole_pad(design: SensorDesign, seed: int) -> _Whole:
    """Verdict on all locations of a pad, with the coarse light of a trial."""
    draft = Draft.of(design)
    light = accuracy_of_builds(draft)
    judge = Judge(
        draft,
        replace(SETTINGS["draft"], untouched=light, map=light, near_tips=None, settled="none"),
        seed=seed,
    )
    return _Whole(
        verdict=judge.verdict,
        deadband_mm=judge.pad_map.worst.deadband_total_mm,
        usable_mm=judge.usable_depth_mm,
        margin=judge.pad_map.weakest.margin,
        judged=f"all {len(judge.places)} locations, coarse light",
    )
