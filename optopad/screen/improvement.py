"""The result of `optopad improve`: the original design, better designs, or the nearest design if none is better."""

from __future__ import annotations

import shlex
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from optopad.design.search.improve import Kind
from optopad.design.spec import SensorDesign
from optopad.screen.answer import INTERRUPTED, Result, block, labelled, number, row, table
from optopad.screen.figures import figures_of
from optopad.screen.score import Score
from optopad.screen.verdict_sentences import changes_words, sentences_of, verdict_words
from optopad.sims.score.objective import sizes_of
from optopad.sims.score.result import ContinuityScore

AIM_TITLES = {
    "margin": "largest margin",
    "location": "finest location",
    "contact": "lightest first contact",
    "size": "smallest outside",
    "flush": "lowest above the surface",
}
"""Title of each aim's alternative."""
AT_RISK = " at risk"
"""End of the kind of a design that is better in the aim, but whose verdict an unmeasured parameter can change."""
WHOLE = 12
"""Largest number of lines for one text of the result, large enough that no text is cut."""


SHOWN = {
    "margin": "margin",
    "location": "location to",
    "contact": "first contact from",
    "unresolved": "not resolved",
}
"""Figures of an alternative on the screen, and what they are called there."""


def _outside(sizes_mm: tuple[float, float, float]) -> str:
    return " x ".join(f"{size:.1f}" for size in sizes_mm)


@dataclass(frozen=True, kw_only=True)
class Alternative:
    """A verified design that is better than the original.

    Attributes
    ----------
    kind : the quantity in which the design is best
    changes : new values of the changed fields, by dotted path
    design, file : the design, and the name of its file
    score : result of `optopad score`, with bounds
    """

    kind: Kind
    changes: dict[str, Any]
    design: SensorDesign
    file: str
    score: ContinuityScore

    @property
    def title(self) -> str:
        """Text for the kind; an aim is the best value of its figure."""
        aim = self.kind.removesuffix(AT_RISK)
        return AIM_TITLES.get(aim, aim) + self.kind[len(aim) :]


@dataclass(frozen=True, kw_only=True)
class Nearest:
    """The best of the scored designs, reported if none is better than the original.

    Attributes
    ----------
    changes : new values of the changed fields, by dotted path
    score : result of `optopad score`
    at_ends : dotted paths of the fields whose value is at an end of its range
    """

    changes: dict[str, Any]
    at_ends: tuple[str, ...]
    score: ContinuityScore

    def to_json(self) -> dict[str, Any]:
        """This design as plain data for JSON."""
        return {
            "changes": self.changes,
            "at_range_end": list(self.at_ends),
            "verdict": self.score.verdict,
            "usable_depth_mm": self.score.usable_depth_mm,
            "deadband_mm": self.score.deadband_total_mm,
            "margin_noise_units": self.score.margin,
        }


@dataclass(frozen=True, kw_only=True, repr=False)
class Improvement(Result):
    """Result of a search for improvements of a design, with up to four verified changes.

    Attributes
    ----------
    design, before : the original design and its score
    aim : what better means, a name in `optopad.design.search.improve.AIMS`, or None
    alternatives : better designs, at most one for each quantity to improve
    nearest : the best scored design if there are no alternatives; else None
    tried : number of designs in the search, which uses a coarse setting of the light model
    judged_again : number of designs that were scored
    folder : folder with all files
    is_interrupted : whether the search was stopped before its end
    """

    design: SensorDesign
    before: Score
    aim: str | None = None
    alternatives: tuple[Alternative, ...]
    nearest: Nearest | None
    tried: int
    folder: Path
    is_interrupted: bool
    judged_again: int = 0

    @property
    def exit_code(self) -> int:
        """Exit code of the command."""
        return INTERRUPTED if self.is_interrupted else 0

    @property
    def designs(self) -> tuple[SensorDesign, ...]:
        """The alternatives' designs; empty if the search found no better design."""
        return tuple(one.design for one in self.alternatives)

    @property
    def kinds(self) -> tuple[str, ...]:
        """The quantity in which each alternative is best."""
        return tuple(one.kind for one in self.alternatives)

    @property
    def changes(self) -> tuple[dict[str, Any], ...]:
        """New values of the changed fields of each alternative, by dotted path."""
        return tuple(one.changes for one in self.alternatives)

    @property
    def scores(self) -> tuple[Score, ...]:
        """The score of each alternative."""
        return tuple(Score(design=one.design, found=one.score) for one in self.alternatives)

    @property
    def files(self) -> tuple[Path, ...]:
        """Design file of each alternative."""
        return tuple(self.folder / one.file for one in self.alternatives)

    @property
    def page(self) -> Path:
        """The page with the original design and the alternatives."""
        return self.folder / "report.html"

    def to_json(self) -> dict[str, Any]:
        """The improvement as plain data for JSON."""
        return {
            "before": {**self.before.to_dict(), "figures": self._json(self.design, self.before.found)},
            "alternatives": [
                {
                    "kind": one.kind,
                    "changes": one.changes,
                    "file": str(self.folder / one.file),
                    **one.score.to_json(),
                    "figures": self._json(one.design, one.score),
                }
                for one in self.alternatives
            ],
            "aim": self.aim,
            "nearest": None if self.nearest is None else self.nearest.to_json(),
            "designs": self.tried,
            "judged_by_score": self.judged_again,
            "interrupted": self.is_interrupted,
            "folder": str(self.folder),
        }

    @staticmethod
    def _json(design: SensorDesign, score: ContinuityScore) -> dict[str, Any]:
        sizes = sizes_of(design)
        return figures_of(design, score).to_json() | {name: sizes[name] for name in sorted(sizes)}

    def lines(self) -> list[str]:
        """Text of `optopad improve`: the original design, up to four alternatives with costs, and the next command."""
        judged = f"; {self.tried} designs judged, {self.judged_again} of them at score accuracy"
        lines = row("design", f"{self.design.name} ({self.design.digest[:8]}){judged}", WHOLE)
        lines += row("before", sentences_of(self.design, self.before.found).verdict, WHOLE)
        for place, one in enumerate(self.alternatives, 1):
            lines += row(str(place), f"{one.title}: {changes_words(self.design, one.changes)}", WHOLE)
            lines += row("", self._resolution(one), WHOLE)
        if self.is_interrupted:
            lines += row("stopped", "every result is kept; the same command continues the search")
        elif self.alternatives:
            lines.append(
                labelled("files", f"{self.folder}/{', '.join(one.file for one in self.alternatives)}")
            )
        else:
            lines += self._nearest()
        return [*lines, labelled("report", str(self.folder / "report.html")), *self._next()]

    def _next(self) -> list[str]:
        if self.is_interrupted:
            return []
        if self.alternatives:
            return [
                labelled("next", f"optopad run {shlex.quote(str(self.folder / self.alternatives[0].file))}")
            ]
        return row("next", "widen a range with --vary FIELD=A:B, allow --more-parts, or raise --budget")

    def _resolution(self, one: Alternative) -> str:
        said = sentences_of(one.design, one.score)
        now, was = figures_of(one.design, one.score), figures_of(self.design, self.before.found)
        words = [verdict_words(one.score), said.confidence.partition(":")[0]]
        words += [
            f"{name} {cell.text} {cell.unit} (was {old.text})"
            for cell, old in zip(now.cells, was.cells, strict=True)
            if (name := SHOWN.get(cell.name)) and cell.text != "-"
        ]
        if self.aim == "size":
            words += [
                f"outside {_outside(now.outer_mm)} mm (was {_outside(was.outer_mm)})",
            ]
        if self.aim == "flush":
            name = "above_surface_mm"
            above, before = sizes_of(one.design)[name], sizes_of(self.design)[name]
            words.append(f"rim or body {number(above, 1)} mm above the surface (was {number(before, 1)})")
        return "; ".join(word for word in words if word)

    def _nearest(self) -> list[str]:
        none = "no better design" if self.before.verdict == "DEADBAND" else "no significantly better design"
        lines = row("none", f"{none} among {self.tried}", WHOLE)
        nearest = self.nearest
        if nearest is not None:
            dead = nearest.score.deadband_total_mm
            left = f"{dead:.2f} mm of deadband" if dead else f"margin {number(nearest.score.margin, 1)} sigma"
            words = changes_words(self.design, nearest.changes)
            lines += row("nearest", f"{words}: {verdict_words(nearest.score)}; {left}", WHOLE)
            if nearest.at_ends:
                lines += row("limit", f"at the end of the range: {', '.join(nearest.at_ends)}", WHOLE)
        return lines

    def _repr_html_(self) -> str:
        rows = [("before", "unchanged", verdict_words(self.before.found))]
        rows += [
            (one.title, changes_words(self.design, one.changes), verdict_words(one.score))
            for one in self.alternatives
        ]
        return block(f"improve {self.design.name}", (), table(("", "changes", "verdict"), rows))
