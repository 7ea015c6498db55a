"""The section of the page on two touches, if a score computed it (`optopad score --touches 2`)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup

from optopad.design.draft import Draft
from optopad.design.spec import SensorDesign
from optopad.report.sections.drawings import PREFIX, Drawing
from optopad.report.sections.objects import figures_of
from optopad.report.words import part
from optopad.screen.touches import depth_rows, is_at_once, numbers, touch_sentences, what_touched
from optopad.sims.plots.maps import plot_touch_sheet
from optopad.sims.plots.style import plain_style, svg_text
from optopad.sims.touches_score import TOLD_APART, TOUCHES

NAME = "touches"
USED = {
    "radius_of_tip_mm", "touching_mm", "places_mm", "directions_deg", "depth_mm", "has_room", "least_mm", "is_open",
    "distance", "location_mm", "bound_depth_mm", "location_times", "depth_times",
}  # fmt: skip


def touches_of(folder: Path) -> dict[str, Any] | None:
    """What a bundle says of two touches; None if it was not computed, or the file is damaged."""
    return figures_of(folder, TOUCHES, USED)


def touches_drawing(design: SensorDesign, found: dict[str, Any]) -> Drawing:
    """How clearly two tips that touch each other are resolved, at each location, direction and depth."""
    shows = (
        "The pad from above, once for each depth: a stroke at each location for each direction from one tip to the "
        "other, darker where the frame differs more from that of every single touch."
    )
    with plain_style():
        figure = plot_touch_sheet(
            Draft.of(design),
            np.array(found["places_mm"]),
            found["directions_deg"],
            found["depth_mm"],
            numbers(found, "distance"),
            is_at_once(found),
            numbers(found, "least_mm"),
        )
        return Drawing(stem=PREFIX + NAME, shows=shows, svg=svg_text(figure, NAME))


def touches_section(found: dict[str, Any] | None, drawings: dict[str, Drawing]) -> Markup:
    """The section; empty if nothing was computed."""
    if found is None:
        return Markup()
    return part(
        NAME,
        found=found,
        drawing=drawings[NAME],
        what=what_touched(found),
        sentences=touch_sentences(found),
        limit=TOLD_APART,
        rows=depth_rows(found),
    )
