"""The section of the page on what the pad sees of objects, if a score computed it (`optopad score --objects`)."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup

from optopad.design.draft import Draft
from optopad.design.spec import SensorDesign
from optopad.report.sections.drawings import PREFIX, Drawing
from optopad.report.words import part
from optopad.screen.held import object_sentences
from optopad.sims.held_score import OBJECTS
from optopad.sims.plots.held import plot_objects
from optopad.sims.plots.style import plain_style, svg_text

NAME = "objects"
USED = {
    "objects", "force_n", "radius_of_tip_mm", "places_mm", "depth_mm", "apart_sigma", "edge_turn_deg",
    "cylinder_radius_mm", "changes_sigma", "as_ball",
}  # fmt: skip


def objects_of(folder: Path) -> dict[str, Any] | None:
    """What a bundle says of objects; None if it was not computed, or the file is damaged."""
    return figures_of(folder, OBJECTS, USED)


def figures_of(folder: Path, name: str, used: set[str]) -> dict[str, Any] | None:
    """The data of a file in a bundle's folder `sims`; None if it is missing or damaged, or lacks a key that is used."""
    try:
        found: dict[str, Any] = json.loads((folder / "sims" / name).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return found if isinstance(found, dict) and found.keys() >= used else None


def objects_drawing(design: SensorDesign, found: dict[str, Any]) -> Drawing:
    """The pairs that each object changes, side by side."""
    changes = {name: np.array(one) for name, one in found["changes_sigma"].items()}
    shows = (
        "The pad from above, once for each object: lines are pairs that it changes, wider for larger changes."
    )
    with plain_style():
        svg = svg_text(plot_objects(Draft.of(design), changes), NAME)
    return Drawing(stem=PREFIX + NAME, shows=shows, svg=svg)


def objects_section(found: dict[str, Any] | None, drawings: dict[str, Drawing]) -> Markup:
    """The section; empty if nothing was computed."""
    if found is None:
        return Markup()
    return part(
        "objects",
        found=found,
        drawing=drawings[NAME],
        sentences=object_sentences(found),
        apart=np.array(found["apart_sigma"]).min(axis=0),
        depths=np.array(found["depth_mm"]).mean(axis=0),
    )
