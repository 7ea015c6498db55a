"""Two sections of the page: on the press, and on fabrication.

Press: load and its band, the published load, and the load while the tip presses and retracts. Fabrication: pictures of
mold and sockets, masses, printing, fitting, casting, purchase and wiring.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from markupsafe import Markup

from optopad.design.press_protocol import load_protocol
from optopad.design.spec import SensorDesign
from optopad.design.spec.properties import modulus
from optopad.report.markdown import html_of
from optopad.report.sections.drawings import PROTOCOL, Drawing
from optopad.report.sections.sensor import Pictures
from optopad.report.words import part
from optopad.sims.contact.force_curve import compared, published_load
from optopad.sims.score.result import ContinuityScore

Drawings = dict[str, Drawing]
TABLE_DEPTHS_MM = (0.2, 0.5, 1.0, 2.0, 3.0, 4.0, 5.0, 7.0, 10.0)


def force_section(design: SensorDesign, score: ContinuityScore, drawings: Drawings) -> Markup:
    """The section on the press: load and contact radius."""
    force, stated, young = score.force, published_load(design), modulus(design)
    if force is None:
        return Markup()
    deepest = float(force.depth_mm[-1])
    depths = [*(depth for depth in TABLE_DEPTHS_MM if depth < deepest - 1e-9), deepest]
    names = ("depth_mm", "load_n", "low_n", "high_n", "radius_mm")
    rows = ((depth, *force.at(depth), force.contact_radius_at(depth)) for depth in depths)
    is_deep = stated is not None and stated.depth_mm <= deepest
    return part(
        "force",
        drawings=drawings,
        loads=[dict(zip(names, row, strict=True)) for row in rows],
        has_band=force.has_band,
        young=young,
        comparison=compared(stated, force, young.value) if stated is not None and is_deep else None,
        option=design.elastomer.viscoelastic,
        protocol=load_protocol(PROTOCOL),
    )


BILL_COLUMNS = (
    "item",
    "quantity",
    "unit",
    "references",
    "value",
    "unit_cost",
    "currency",
    "cost_source",
    "note",
)
WIRING_COLUMNS = ("reference", "part", "wall", "along_mm", "x_mm", "y_mm", "height_mm", "pin", "polarity")
CASTING, BILL, WIRING = "fabrication/casting.md", "fabrication/bom.csv", "fabrication/wiring.csv"


@dataclass(frozen=True, kw_only=True)
class Sheets:
    """A bundle's sheets as text; empty where a file is missing."""

    casting: str
    bill: str
    wiring: str


def sheets_of(folder: Path) -> Sheets:
    """The sheets that a bundle holds."""
    return Sheets(casting=_text(folder / CASTING), bill=_text(folder / BILL), wiring=_text(folder / WIRING))


def _text(path: Path) -> str:
    return path.read_text(encoding="utf-8") if path.is_file() else ""


def build_section(sheets: Sheets, pictures: Pictures) -> Markup:
    """The section with the build sheet, bill of materials and wiring; empty if the bundle has no sheets."""
    if not any((sheets.casting, sheets.bill, sheets.wiring, *pictures.addresses)):
        return Markup()
    return part(
        "build",
        pictures=pictures,
        casting=html_of(sheets.casting),
        bill=_cells(sheets.bill, BILL_COLUMNS),
        bill_columns=BILL_COLUMNS,
        wiring=_cells(sheets.wiring, WIRING_COLUMNS),
        wiring_columns=WIRING_COLUMNS,
    )


def _cells(text: str, columns: Sequence[str]) -> list[list[str]]:
    """These columns of a table as CSV."""
    return [[row.get(name, "") for name in columns] for row in csv.DictReader(io.StringIO(text))]
