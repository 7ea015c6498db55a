"""Two sections of the page: on the press, and on fabrication.

Press: load and its band, the published load, and the load while the tip presses and retracts. Fabrication: pictures of
mold and sockets, masses, printing, fitting, casting, purchase and wiring.
"""

from __future__ import annotations

import csv
import io
from dataclasses import dataclass
from pathlib import Path

from optopad.design.fields.quantity import Quantity
from optopad.design.press_protocol import load_protocol
from optopad.design.spec import SensorDesign
from optopad.design.spec.properties import modulus
from optopad.report.markdown import html_of
from optopad.report.sections.drawings import PROTOCOL, Drawing, figure_of
from optopad.report.sections.published import compared, published_load
from optopad.report.sections.sensor import (
    Pictures,
    lid_figure,
    mold_figure,
    orientation_figure,
    schematic_figure,
    wiring_figure,
)
from optopad.report.words import Html, element, section, table
from optopad.screen.answer import counted
from optopad.screen.verdict_sentences import ends
from optopad.sims.contact.force_curve import ForceCurve
from optopad.sims.score.result import ContinuityScore

Drawings = dict[str, Drawing]
TABLE_DEPTHS_MM = (0.2, 0.5, 1.0, 2.0, 3.0, 4.0, 5.0, 7.0, 10.0)

ELASTIC = (
    "Press and retract have the same load: relaxation is off. It is an option, elastomer.viscoelastic "
    "with relaxed_share and time_constant_s, for values measured on the built pad."
)
_FIGURES = (
    ("force", "Load of a centred press; shaded: the band of the modulus."),
    ("force-near", "The same near contact, with the point that the paper states."),
    ("contact-radius", "Radius of the circle where pad and tip touch."),
    ("load-protocol", "Load over a protocol of steps and pauses, in and out."),
    ("load-time", "The same against time."),
)


def force_section(design: SensorDesign, score: ContinuityScore, drawings: Drawings) -> Html:
    """The section on the press: load and contact radius."""
    if score.force is None:
        return Html("")
    young = modulus(design)
    return section(
        "force",
        "Load against depth",
        element("p", _lead(score.force)),
        element(
            "div",
            *(figure_of(drawings[name], text) for name, text in _FIGURES if name in drawings),
            class_="grid",
        ),
        table(
            ("depth [mm]", "load [N]", "band of the modulus [N]", "contact radius [mm]"),
            _rows(score.force),
            label="Load and contact radius",
            numeric=(1, 2, 3),
        ),
        *(element("p", note, class_="note") for note in _notes(design, score.force, young)),
    )


def _lead(force: ForceCurve) -> str:
    deepest = float(force.depth_mm[-1])
    value, low, high = force.at(deepest)
    band = f" ({low:.3g} to {high:.3g} N over the band of the modulus)" if force.has_band else ""
    return f"The deepest press, {deepest:g} mm, takes {value:.3g} N{band}."


def _notes(design: SensorDesign, force: ForceCurve, young: Quantity) -> list[str]:
    notes = [
        f"The load is proportional to Young's modulus, {young.value:.3g} MPa ({young.confidence}: {young.source})."
    ]
    stated = published_load(design)
    if stated is not None and stated.depth_mm <= force.depth_mm[-1]:
        words = compared(stated, force, young.value).words
        notes.append(f"{stated.source}. {words[0].upper()}{words[1:]}.")
    option = design.elastomer.viscoelastic
    if option is None:
        return [*notes, ELASTIC]
    protocol = load_protocol(PROTOCOL)
    notes.append(
        f"Press and retract differ by elastomer.viscoelastic: {option.relaxed_share:.0%} of the instantaneous modulus "
        f"relaxes with a time constant of {option.time_constant_s:g} s, and the modulus above is the long-time one. "
        f"Protocol: {protocol.title}; at {protocol.speed_mm_per_s.value:g} mm/s, which is assumed. In retraction the "
        "model keeps the elastic contact, which is off by a few percent of the peak load."
    )
    if protocol.deepest_mm.value > force.depth_mm[-1]:
        notes.append(
            f"The protocol reaches {protocol.deepest_mm.value:g} mm, deeper than operating.max_depth_mm: not drawn."
        )
    return notes


def _rows(force: ForceCurve) -> list[tuple[str, ...]]:
    rows: list[tuple[str, ...]] = []
    deepest = float(force.depth_mm[-1])
    shown = [depth for depth in TABLE_DEPTHS_MM if depth < deepest - 1e-9]
    for at_mm in (*shown, deepest):
        load, low, high = force.at(at_mm)
        radius = force.contact_radius_at(at_mm)
        band = ends(low, high) if force.has_band else "measured"
        rows.append((f"{at_mm:g}", f"{load:.2f}", band, f"{radius:.2f}"))
    return rows


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
    """The section with the build sheet, bill of materials and wiring; empty if the bundle has no sheets."""
    parts = [
        mold_figure(pictures),
        lid_figure(pictures),
        orientation_figure(pictures),
        _folded("Casting, step by step", Html(html_of(sheets.casting)), CASTING)
        if sheets.casting
        else Html(""),
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
