"""``python -m optopad.report`` draws plots and writes the page for another process (`optopad.work.beside`)."""

from __future__ import annotations

import gc
from pathlib import Path
from typing import Any

from optopad.design.spec import SensorDesign
from optopad.report.page import write_report
from optopad.report.sections.drawings import Drawing, tolerance_drawings
from optopad.report.sections.early import EarlyDrawings, prepare, write_early
from optopad.sims.score.result import ContinuityScore
from optopad.work import serve


class Page:
    """The page of one score; its drawings stay in this process until the page is written."""

    early: EarlyDrawings | None = None
    late: dict[str, Drawing] | None = None

    def draw_early(self, *arguments: Any, **settings: Any) -> None:
        """Make the drawings of `write_early`, and keep them."""
        self.early = write_early(*arguments, **settings)

    def draw_tolerance(self, score: ContinuityScore) -> None:
        """Make the drawings of the score's tolerance, and keep them."""
        self.late = tolerance_drawings(score)

    def write(
        self, design: SensorDesign, folder: Path, score: ContinuityScore, checks: dict[str, Any], *, seed: int
    ) -> None:
        """Write the page with the drawings that were kept; without them it draws itself."""
        drawn = None if self.early is None or self.late is None else (self.early, self.late)
        write_report(design, folder, score, checks, seed=seed, drawn=drawn)


if __name__ == "__main__":
    gc.disable()  # the process is short, and plots consist of many small objects
    page = Page()
    serve(prepare, page.draw_early, page.draw_tolerance, page.write)
