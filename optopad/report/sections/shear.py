"""The section of the page on sideways load, if a score computed it (`optopad score --shear`)."""

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
from optopad.screen.shear import map_rows, shear_sentences, unmodelled_rows, what_was_pulled
from optopad.sims.plots.maps import plot_pull_sheet
from optopad.sims.plots.style import plain_style, svg_text
from optopad.sims.shear_score import SHEAR

NAME = "shear"
USED = {
    "friction", "places_mm", "depth_mm", "pull_n", "shear_mm", "least_pull_n", "location_times", "depth_times",
    "unmodelled", "map_errors",
}  # fmt: skip


def shear_of(folder: Path) -> dict[str, Any] | None:
    """What a bundle says of sideways load; None if it was not computed, or the file is damaged."""
    return figures_of(folder, SHEAR, USED)


def shear_drawing(design: SensorDesign, found: dict[str, Any]) -> Drawing:
    """The least pull that one frame gives, at each location and depth."""
    least = np.array([[np.nan if one is None else one for one in row] for row in found["least_pull_n"]])
    shows = "The pad from above, once for each depth: least standard deviation of a sideways force at each location."
    with plain_style():
        figure = plot_pull_sheet(Draft.of(design), np.array(found["places_mm"]), found["depth_mm"], least)
        return Drawing(stem=PREFIX + NAME, shows=shows, svg=svg_text(figure, NAME))


def shear_section(found: dict[str, Any] | None, drawings: dict[str, Drawing]) -> Markup:
    """The section; empty if nothing was computed."""
    if found is None:
        return Markup()
    return part(
        "shear",
        found=found,
        drawing=drawings[NAME],
        what=what_was_pulled(found),
        sentences=shear_sentences(found),
        unmodelled=unmodelled_rows(found),
        maps=map_rows(found),
    )
