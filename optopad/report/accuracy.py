"""The page on accuracy, in one file: errors of touch, location and depth by model, bounds, and published figures."""

from __future__ import annotations

from collections.abc import Mapping

from optopad.report.sections.drawings import Drawing
from optopad.report.words import asset, part
from optopad.screen.prediction import PredictedAccuracy, bound_text, range_text
from optopad.sims.learning.tables import WITHIN_MM, ErrorRow
from optopad.sims.two_touch_errors import LEAST_MM


def accuracy_page(found: PredictedAccuracy, drawings: Mapping[str, Drawing]) -> str:
    """The page on accuracy as HTML text.

    Parameters
    ----------
    drawings : SVG text by name; the names are touch, errors, arrows-<learner>, depths-<learner>
    """
    learner, best = min(found.pooled().items(), key=lambda item: _mean_location(item[1].errors))
    return part(
        "accuracy",
        style=asset("page.css"),
        name=found.name,
        digest=found.digest or "",
        found=found,
        findings=found.findings(),
        published=found.published,
        drawings=drawings,
        learner=learner,
        known=[row for row in best.errors if row.location is not None and row.depth is not None],
        bound_text=bound_text,
        range_text=range_text,
        least_mm=LEAST_MM,
        within_mm=WITHIN_MM,
    )


def _mean_location(rows: tuple[ErrorRow, ...]) -> float:
    known = [row.location.median for row in rows if row.location is not None and row.depth_mm >= 1.0]
    return sum(known) / len(known) if known else float("inf")
