"""The section on making it: pictures of mold and sockets, what to weigh, print, fit and cast, buy and wire."""

from __future__ import annotations

import csv
import io
from dataclasses import dataclass
from pathlib import Path

from optopad.report.sections.sensor import (
    Pictures,
    lid_figure,
    mold_figure,
    orientation_figure,
    schematic_figure,
    wiring_figure,
)
from optopad.report.text.markdown import html_of
from optopad.report.text.markup import Html, element, section, table
from optopad.screen.numbers import counted

CASTING, BILL, WIRING = "fabrication/casting.md", "fabrication/bom.csv", "fabrication/wiring.csv"
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
WIRING_COLUMNS = ("reference", "part", "wall", "along_mm", "height_mm", "pin", "polarity")


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


def build_section(sheets: Sheets, pictures: Pictures) -> Html:
    """The build sheet, its bill and its wiring; nothing where the bundle has no sheets."""
    parts = [
        mold_figure(pictures),
        lid_figure(pictures),
        orientation_figure(pictures),
        _folded("Casting, step by step", html_of(sheets.casting), CASTING) if sheets.casting else Html(""),
        _folded(*_bill(sheets.bill), BILL) if sheets.bill else Html(""),
        _folded(*_wiring(sheets.wiring, pictures), WIRING) if sheets.wiring else wiring_figure(pictures),
        schematic_figure(pictures),
    ]
    shown = [part for part in parts if part]
    return section("build", "Build sheet", *shown, class_="build") if shown else Html("")


def _folded(title: str, body: Html, file: str) -> Html:
    summary = element("summary", element("h3", title))
    link = element("p", "As a file: ", element("a", file, href=file), class_="note")
    return element("details", summary, body, link, open="", class_="sheet")


def _bill(text: str) -> tuple[str, Html]:
    rows = list(csv.DictReader(io.StringIO(text)))
    body = [tuple(row.get(name, "") for name in BILL_COLUMNS) for row in rows]
    title = f"Bill of materials, {counted(len(rows), 'line')}"
    return title, table(BILL_COLUMNS, body, label="Bill of materials", numeric=(1,), class_="wide")


def _wiring(text: str, pictures: Pictures) -> tuple[str, Html]:
    rows = list(csv.DictReader(io.StringIO(text)))
    body = [tuple(row.get(name, "") for name in WIRING_COLUMNS) for row in rows]
    heads = [name.replace("_mm", " [mm]") for name in WIRING_COLUMNS]
    grid = table(heads, body, label="Wiring", numeric=(3, 4), class_="wide")
    return f"Wiring, {counted(len(rows), 'part')}", element("div", wiring_figure(pictures), grid)
