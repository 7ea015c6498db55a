"""A design and its better neighbours."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from design.spec import SensorDesign
from optopad.front.judged import Score
from optopad.front.shown import block, table
from optopad.report.text.answer import changes_words, verdict_words
from optopad.results.improvement import Improvement
from optopad.screen.improvement_screen import improvement_screen


@dataclass(frozen=True, kw_only=True, repr=False)
class Improved:
    """Up to four changes that mend or better a design.

    Attributes
    ----------
    found : everything (`optopad.results.improvement.Improvement`)
    """

    found: Improvement

    @property
    def before(self) -> Score:
        """The design's own verdict."""
        return Score(design=self.found.design, found=self.found.before)

    @property
    def designs(self) -> tuple[SensorDesign, ...]:
        """The alternatives; empty where nothing in reach is better."""
        return tuple(one.design for one in self.found.alternatives)

    @property
    def kinds(self) -> tuple[str, ...]:
        """In what each is best."""
        return tuple(one.kind for one in self.found.alternatives)

    @property
    def changes(self) -> tuple[dict[str, Any], ...]:
        """New values of each by dotted path."""
        return tuple(one.changes for one in self.found.alternatives)

    @property
    def scores(self) -> tuple[Score, ...]:
        """The verdict on each."""
        return tuple(Score(design=one.design, found=one.score) for one in self.found.alternatives)

    @property
    def files(self) -> tuple[Path, ...]:
        """Design file of each."""
        return tuple(self.found.folder / one.file for one in self.found.alternatives)

    @property
    def page(self) -> Path:
        """The page with before and after."""
        return self.found.folder / "report.html"

    def to_dict(self) -> dict[str, Any]:
        """The same as `optopad improve --json`."""
        return self.found.to_json()

    def __repr__(self) -> str:
        return "\n".join(improvement_screen(self.found))

    def _repr_html_(self) -> str:
        rows = [("before", "as it is", verdict_words(self.found.before))]
        rows += [
            (one.kind, changes_words(self.found.design, one.changes), verdict_words(one.score))
            for one in self.found.alternatives
        ]
        return block(f"improve {self.found.design.name}", (), table(("", "what changes", "verdict"), rows))
