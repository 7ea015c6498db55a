"""Write a bundle's report: one self-contained page, and its plots as files.

The page needs no network and no other file; its links lead to the files of the bundle in the same folder. Its one
script rotates the 3D view, selects pairs, steps through the maps, and switches between light and dark colours. If the
script does not run, and in print, the page shows the same content as drawings and tables.
Equal designs, scores, checks and files give the same page, byte for byte.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from markupsafe import Markup

from optopad.design.io import write_text_atomically
from optopad.design.spec import SensorDesign
from optopad.fabrication.bundle import versions
from optopad.report.scenes.map_scene import MapScene
from optopad.report.scenes.mold_scene import mold_scene
from optopad.report.scenes.ray_scene import RayScene
from optopad.report.sections.closing import bundle_files, closing_sections
from optopad.report.sections.drawings import PREFIX, Drawing, tolerance_drawings
from optopad.report.sections.early import EarlyDrawings, early_drawings
from optopad.report.sections.load import Sheets, build_section, force_section, sheets_of
from optopad.report.sections.maps import map_section
from optopad.report.sections.objects import objects_drawing, objects_of, objects_section
from optopad.report.sections.rays import rays_section
from optopad.report.sections.sensor import Pictures, checks_section, pictures_of, sensor_section
from optopad.report.sections.shear import shear_drawing, shear_of, shear_section
from optopad.report.sections.signals import (
    causes_section,
    matters_section,
    pairs_section,
    signal_section,
    tolerance_section,
)
from optopad.report.sections.touches import touches_drawing, touches_of, touches_section
from optopad.report.sections.verdict import verdict_part
from optopad.report.words import asset, part, script_policy, script_text
from optopad.sims.score.result import ContinuityScore

PAGE = "report.html"
TITLES = {
    "why": "Why",
    "rays": "3-D",
    "sensor": "Layout",
    "signals": "Signals",
    "map": "Map",
    "pairs": "Pairs",
    "matters": "Sensitivity",
    "tolerance": "Tolerance",
    "force": "Load",
    "objects": "Objects",
    "shear": "Shear",
    "touches": "Two touches",
    "build": "Build",
    "mold": "Checks",
    "warnings": "Warnings",
    "limits": "Left out",
    "files": "Files",
    "origin": "Origin",
}
LAST = ("warnings", "limits", "files", "origin")
"""The sections at the end of every page."""


@dataclass(frozen=True, kw_only=True)
class Found:
    """Content of a report's page apart from the verdict.

    Attributes
    ----------
    checks : the mold's checks, as in ``cad/checks.json``
    drawings : plots by name
    pictures, sheets, files : the bundle's pictures, its sheets, and the names of its files
    mold : the mold for the 3D view; None if the bundle has no mold
    light : the light paths for the 3D view, or a text that says why there are none; None if there is no verdict
    sheet : the picture of these paths for print; None if there are none
    maps : maps of the pad by depth; None if the score has no map
    objects, shear, touches : what the pad sees of objects, of sideways load and of two touches; None if this was not
        computed
    """

    checks: dict[str, Any]
    drawings: dict[str, Drawing]
    pictures: Pictures
    sheets: Sheets
    files: tuple[str, ...]
    mold: dict[str, Any] | None
    light: RayScene | str | None
    sheet: Drawing | None
    maps: MapScene | None
    objects: dict[str, Any] | None = None
    shear: dict[str, Any] | None = None
    touches: dict[str, Any] | None = None


Drawn = tuple[EarlyDrawings, dict[str, Drawing]]
"""Early drawings of a score, and drawings of its tolerance."""


def write_report(
    design: SensorDesign,
    folder: Path,
    score: ContinuityScore,
    checks: dict[str, Any],
    *,
    seed: int,
    drawn: Drawn | None = None,
) -> Path:
    """Write ``report.html`` and ``sims/plot-*.svg`` into a bundle; returns the page's path.

    Parameters
    ----------
    folder : the bundle, with the files that the page shows and links to
    checks : the mold's checks, as in ``cad/checks.json``
    drawn : early drawings and those of the tolerance for this score; if None, they are made now
    """
    early, late = drawn or (early_drawings(design, score, seed=seed), tolerance_drawings(score))
    drawings = early.drawings | late
    objects, shear, touches = objects_of(folder), shear_of(folder), touches_of(folder)
    if objects is not None:
        drawings["objects"] = objects_drawing(design, objects)
    if shear is not None:
        drawings["shear"] = shear_drawing(design, shear)
    if touches is not None:
        drawings["touches"] = touches_drawing(design, touches)
    _write_drawings(folder / "sims", drawings)
    found = Found(
        checks=checks,
        drawings=drawings,
        pictures=pictures_of(design, folder),
        sheets=sheets_of(folder),
        files=tuple(bundle_files(folder)),
        mold=mold_scene(design, folder),
        light=early.light,
        sheet=early.sheet,
        maps=early.maps,
        objects=objects,
        shear=shear,
        touches=touches,
    )
    page = report_html(design, score, found, versions(), seed=seed)
    write_text_atomically(folder / PAGE, page)
    return folder / PAGE


def _write_drawings(sims: Path, drawings: dict[str, Drawing]) -> None:
    sims.mkdir(exist_ok=True)
    for stale in sims.glob(f"{PREFIX}*.svg"):
        stale.unlink()
    for drawing in drawings.values():
        write_text_atomically(sims / drawing.file_name, drawing.svg)


def report_html(
    design: SensorDesign, score: ContinuityScore, found: Found, made_with: dict[str, str], *, seed: int
) -> str:
    """The report page as HTML text.

    Parameters
    ----------
    made_with : version of each program or library, by name
    """
    sections = {
        **_light_sections(design, score, found),
        "build": build_section(found.sheets, found.pictures),
        "mold": checks_section(found.checks),
    }
    return part(
        "report",
        what="verdict",
        name=design.name,
        digest=design.digest,
        score=score,
        style=asset("page.css"),
        policy=script_policy(),
        script=script_text(),
        titles={name: title for name, title in TITLES.items() if sections.get(name) or name in LAST},
        verdict=verdict_part(design, score),
        sections=[*sections.values(), closing_sections(design, score, found.files, seed, made_with)],
    )


def _light_sections(design: SensorDesign, score: ContinuityScore, found: Found) -> dict[str, Markup]:
    drawings = found.drawings
    layout = {"sensor": sensor_section(design, drawings)}
    if not score.pairs:
        return layout
    return {
        "why": causes_section(score, drawings),
        "rays": rays_section(found.light, found.mold, found.sheet),
        **layout,
        "signals": signal_section(design, score, drawings),
        "map": map_section(score, drawings, found.maps),
        "pairs": pairs_section(score, drawings),
        "matters": matters_section(score, drawings),
        "tolerance": tolerance_section(score, drawings),
        "force": force_section(design, score, drawings),
        "objects": objects_section(found.objects, drawings),
        "shear": shear_section(found.shear, drawings),
        "touches": touches_section(found.touches, drawings),
    }
