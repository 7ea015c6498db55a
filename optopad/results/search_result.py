"""What a search left behind."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from design.search.explore import Findings
from design.search.judged import Judged, Tried
from design.spec import SensorDesign
from sims.continuity.headline import headline
from sims.verdict.pair.defaults import DEADBAND_THRESHOLD

QUICK_ERRORS = {"draft": 3.0, "search": 2.0, "score": 0.0}
"""How far margins may be from the score's, by the accuracy of a search [noise units]: the largest difference was 1.94
on 13 pads (docs/how-to/search-layouts.md), and 0.86 without that one. Of draft light it was 2.9 on four pads
of 4 + 4 parts. The largest of so few is no bound."""


@dataclass(frozen=True, kw_only=True)
class Search:
    """What a search left behind.

    Attributes
    ----------
    folder : with tables, designs and page
    findings : what was found
    files : design file of each design on the front, relative to the folder
    importance : share of each field by objective; empty when too little was judged
    """

    folder: Path
    findings: Findings
    files: tuple[str, ...]
    importance: dict[str, dict[str, float]]

    @property
    def base_headline(self) -> str:
        """The base design's verdict in the words of a score."""
        return self._headline(self.findings.base, self.findings.space.base)

    def headline(self, one: Tried) -> str:
        """A design's verdict in the words of a score, undecided where the search's light may err; empty without one."""
        design = self.findings.space.design_at(one.parameters) if one.judged.verdict else None
        return self._headline(one.judged, design)

    def is_open(self, judged: Judged) -> bool:
        """Whether the error of the search's light may change the verdict."""
        margin = judged.figures.get("margin")
        error = QUICK_ERRORS[self.findings.space.accuracy]
        return margin is not None and abs(margin - DEADBAND_THRESHOLD) < error

    def _headline(self, judged: Judged, design: SensorDesign | None) -> str:
        if design is None or not judged.verdict:
            return ""
        return headline(
            judged.verdict,
            is_open=self.is_open(judged),
            usable_mm=judged.figures.get("usable_depth_mm"),
            asked_mm=design.operating.max_depth_mm,
            is_short=True,
        )
