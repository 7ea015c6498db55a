"""The result of `optopad improve`: the original design, better designs, or the nearest design if none is better."""

from __future__ import annotations

import shlex
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from design.search.improve import Judged, Kind
from design.spec import SensorDesign
from optopad.results.score import Score
from optopad.results.shown import Result, block, number, table
from optopad.screen.verdict import labelled, row
from optopad.screen.verdict_sentences import changes_words, sentences_of, verdict_words
from sims.score.result import ContinuityScore

Figures = dict[str, float | None]
WHOLE = 12
"""Largest number of lines for one text of the result, large enough that no text is cut."""


@dataclass(frozen=True, kw_only=True)
class Alternative:
    """A verified design that is better than the original.

    Attributes
    ----------
    kind : the quantity in which the design is best
    changes : new values of the changed fields, by dotted path
    design, file : the design, and the name of its file
    figures : figures from the search, with its coarse light model
    score : result of `optopad score`
    """

    kind: Kind
    changes: dict[str, Any]
    design: SensorDesign
    file: str
    figures: Figures
    score: ContinuityScore


@dataclass(frozen=True, kw_only=True)
class Nearest:
    """The best of the scored designs, reported if none is better than the original.

    Attributes
    ----------
    changes : new values of the changed fields, by dotted path
    judged : figures from the search, with its coarse light model
    score : result of `optopad score`
    at_ends : dotted paths of the fields whose value is at an end of its range
    """

    changes: dict[str, Any]
    judged: Judged
    at_ends: tuple[str, ...]
    score: ContinuityScore

    def to_json(self) -> dict[str, Any]:
        """This design as plain data for JSON."""
        return {
            "changes": self.changes,
            "figures": self.judged.figures,
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
    design, before, figures : the original design, its score, and its figures from the search
    alternatives : better designs, at most one for each quantity to improve
    nearest : the best scored design if there are no alternatives; else None
    tried : number of designs in the search, which uses a coarse setting of the light model
    judged_again : number of designs that were scored
    folder : folder with all files
    is_interrupted : whether the search was stopped before its end
    """

    design: SensorDesign
    before: Score
    figures: Figures
    alternatives: tuple[Alternative, ...]
    nearest: Nearest | None
    tried: int
    folder: Path
    is_interrupted: bool
    judged_again: int = 0

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
            "before": {**self.before.to_dict(), "search_figures": self.figures},
            "alternatives": [
                {
                    "kind": one.kind,
                    "changes": one.changes,
                    "file": str(self.folder / one.file),
                    "search_figures": one.figures,
                    **one.score.to_json(),
                }
                for one in self.alternatives
            ],
            "nearest": None if self.nearest is None else self.nearest.to_json(),
            "designs": self.tried,
            "judged_by_score": self.judged_again,
            "interrupted": self.is_interrupted,
            "folder": str(self.folder),
        }

    def lines(self) -> list[str]:
        """Text of `optopad improve`: the original design, up to four alternatives with costs, and the next command."""
        judged = f"; {self.tried} designs judged, {self.judged_again} of them at score accuracy"
        lines = row("design", f"{self.design.name} ({self.design.digest[:8]}){judged}", WHOLE)
        lines += row("before", sentences_of(self.design, self.before.found).verdict, WHOLE)
        for place, one in enumerate(self.alternatives, 1):
            lines += row(str(place), f"{one.kind}: {changes_words(self.design, one.changes)}", WHOLE)
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
        parts = [verdict_words(one.score), said.confidence.partition(":")[0]]
        parts.append(
            f"margin {number(one.score.margin, 1)} sigma (was {number(self.before.found.margin, 1)})"
        )
        now, was = one.figures.get("location_bound_mm"), self.figures.get("location_bound_mm")
        if now is not None:
            parts.append(f"location {now:.3f} mm with quick light (was {number(was, 3)})")
        return "; ".join(part for part in parts if part)

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
            (one.kind, changes_words(self.design, one.changes), verdict_words(one.score))
            for one in self.alternatives
        ]
        return block(f"improve {self.design.name}", (), table(("", "changes", "verdict"), rows))
