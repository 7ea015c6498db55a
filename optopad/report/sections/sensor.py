"""Sections on the sensor: its pictures, its parts and materials, and whether the mold can be printed."""

from __future__ import annotations

import base64
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from optopad.design.mold.filling import is_cast_under_lid
from optopad.design.preset import true_description
from optopad.design.shape.cavity import CavityGeometry, PlacedPart, Plan, cavity_of, plan_of
from optopad.design.spec import SensorDesign
from optopad.design.spec.indenter import tip_words
from optopad.report.sections.drawings import Drawing, figure_of
from optopad.report.words import Html, element, facts, section, table
from optopad.screen.answer import counted

MOLD_STL, LID_STL, MOLD_PNG, LID_PNG = "cad/mold.stl", "cad/lid.stl", "cad/mold.png", "cad/lid.png"
ALONG = ", along the normal of the top where the tip touches"
WIRING_SVG = "fabrication/wiring.svg"
SCHEMATIC_SVG = "fabrication/schematic.svg"
ORIENTATION_SVG = "fabrication/orientation.svg"
LAYOUT_WORDS = (
    "Seen from above and cut open, to one scale. Lengths in mm; heights are above the bottom of the clear layer. "
    "Circles: emitters; squares: receivers, with {position}; dashed: where presses are judged."
)
STATES = {"ok": "\N{CHECK MARK} ok", "warning": "! warning", "error": "\N{MULTIPLICATION X} error"}


@dataclass(frozen=True, kw_only=True)
class Pictures:
    """Pictures of a bundle as data URLs (None if a file is missing), and whether x and y start at a corner."""

    mold: str | None
    wiring: str | None
    lid: str | None = None
    has_origin_corner: bool = True
    schematic: str | None = None
    orientation: str | None = None


def pictures_of(design: SensorDesign, folder: Path) -> Pictures:
    """Pictures of the mold and its lid, and the drawings of the build sheet."""
    return Pictures(
        mold=_png_address(folder / MOLD_PNG),
        lid=_png_address(folder / LID_PNG),
        has_origin_corner=plan_of(design).has_origin_corner,
        wiring=_svg_address(folder / WIRING_SVG),
        schematic=_svg_address(folder / SCHEMATIC_SVG),
        orientation=_svg_address(folder / ORIENTATION_SVG),
    )


def _png_address(png: Path) -> str | None:
    return _address("image/png", png.read_bytes()) if png.is_file() else None


def _svg_address(svg: Path) -> str | None:
    return _address("image/svg+xml", svg.read_bytes()) if svg.is_file() else None


def _address(kind: str, content: bytes) -> str:
    return f"data:{kind};base64,{base64.b64encode(content).decode('ascii')}"


def sensor_section(design: SensorDesign, drawings: dict[str, Drawing]) -> Html:
    """The section on the sensor, with its dimensions."""
    cavity = cavity_of(design)
    about = facts(_facts(design, cavity))
    described = true_description(design)
    return section(
        "sensor",
        "Layout",
        *([element("p", described)] if described else []),
        figure_of(drawings["layout"], _layout_words(cavity)),
        about,
    )


def _layout_words(cavity: CavityGeometry) -> str:
    places = {False: "the position of each along its wall", True: "the direction of each from the middle"}
    by_angle = {part.angle_deg is not None for part in cavity.parts}
    words = LAYOUT_WORDS.format(position=" or ".join(places[one] for one in sorted(by_angle)))
    if not is_cast_under_lid(cavity.plan):
        return words
    return f"{words} Dotted: the floor's holes, through which the clear layer is poured upside down."


def mold_figure(pictures: Pictures) -> Html:
    """The mold's picture; empty if the bundle has none."""
    if pictures.mold is None:
        return Html("")
    seen = (
        "the corner where x and y are 0" if pictures.has_origin_corner else "the side where x and y are low"
    )
    return _picture(
        pictures.mold,
        "The mold, shaded",
        f"The mold, seen from above {seen}",
        MOLD_STL,
    )


def lid_figure(pictures: Pictures) -> Html:
    """Lid and mold in cross-section; empty if the bundle has no lid."""
    if pictures.lid is None:
        return Html("")
    words = "The lid on the mold, cut along x through the middle"
    return _picture(pictures.lid, words, words, LID_STL)


def wiring_figure(pictures: Pictures) -> Html:
    """The wiring drawing; empty if the bundle has none."""
    if pictures.wiring is None:
        return Html("")
    words = "Layout and wiring of emitters and receivers"
    return _picture(pictures.wiring, words, "Layout and wiring", WIRING_SVG)


def orientation_figure(pictures: Pictures) -> Html:
    """Cross-sections through the sockets; empty if the bundle has none."""
    if pictures.orientation is None:
        return Html("")
    words = "Each kind of part in its socket, cut across the wall"
    return _picture(pictures.orientation, words, words, ORIENTATION_SVG)


def schematic_figure(pictures: Pictures) -> Html:
    """The schematic; empty if the bundle has none."""
    if pictures.schematic is None:
        return Html("")
    words = "Schematic: the switch of each emitter, and the amplifier of each receiver"
    return _picture(pictures.schematic, words, "Schematic", SCHEMATIC_SVG)


def _picture(address: str, words: str, caption: str, file: str) -> Html:
    image = element("img", src=address, alt=words)
    words_below = element("figcaption", f"{caption}: ", element("a", file, href=file))
    look = (
        "card themed" if address.startswith("data:image/png") else "card"
    )  # the drawing has its own white background
    return element("figure", element("div", image, class_=look), words_below)


def _facts(design: SensorDesign, cavity: CavityGeometry) -> list[tuple[str, str]]:
    return [
        ("cavity", _cavity_words(cavity)),
        ("layers", f"{cavity.clear_mm:g} mm clear on {cavity.black_mm:g} mm black"),
        *([] if cavity.plan.top.is_flat else [("top", _top_words(cavity.plan))]),
        ("elastomer", f"{design.elastomer.material}, {design.elastomer.mixing_ratio:g} : 1 by weight"),
        ("emitters", _parts(cavity.emitters)),
        ("receivers", _parts(cavity.receivers)),
        ("tip", tip_words(design.indenter)),
        ("workspace", cavity.workspace.place_words),
        ("deepest press", f"{design.operating.max_depth_mm:g} mm{'' if cavity.plan.top.is_flat else ALONG}"),
        ("board", f"{design.board.kind}, {design.board.frame_rate_hz:g} frames per second required"),
        ("measured on the built pad", ", ".join(design.measured) or "nothing yet"),
    ]


def _cavity_words(cavity: CavityGeometry) -> str:
    by_angle = sum(part.angle_deg is not None for part in cavity.parts)
    whose = "part" if by_angle == len(cavity.parts) else "part in a round wall"
    return f"{cavity.plan.outline.size_words}{f', a flat facet for each {whose}' if by_angle else ''}"


def _top_words(plan: Plan) -> str:
    low, high = (f"{edge:.2f}" for edge in plan.rim_mm)
    top, straight = plan.top, "" if plan.top.straight is None else f", straight along {plan.top.straight}"
    edge = low if low == high else f"{low} to {high}"
    return (
        f"convex, a {top.kind} of {top.radius_mm:g} mm radius{straight}; its edge {edge} mm above the bottom"
    )


def _parts(parts: tuple[PlacedPart, ...]) -> str:
    groups: dict[tuple[str, float], int] = {}
    for part in parts:
        groups[part.part_id, part.height_mm] = groups.get((part.part_id, part.height_mm), 0) + 1
    return "; ".join(
        f"{count} {part} at {height:g} mm above the bottom" for (part, height), count in groups.items()
    )


def checks_section(checks: dict[str, Any]) -> Html:
    """The section with the mold's checks, failed ones first."""
    findings = sorted(checks.get("findings", []), key=lambda row: list(STATES)[::-1].index(row["state"]))
    wrong = {state: sum(row["state"] == state for row in findings) for state in ("error", "warning")}
    lead = "The files can be printed." if checks.get("ok") else "The files can NOT be printed as they are."
    rows = [
        (
            str(row["name"]),
            element("span", STATES[row["state"]], class_=f"state {row['state']}"),
            f"{row['value']:g}",
            f"{row['limit']:g}",
            str(row["unit"]),
            str(row.get("note", "")),
        )
        for row in findings
    ]
    heads = ("check", "state", "value", "limit", "unit", "note")
    return section(
        "mold",
        "Mold checks",
        element(
            "p",
            f"{lead} {counted(len(findings), 'check')}, {counted(wrong['error'], 'error')}, "
            f"{counted(wrong['warning'], 'warning')}; measured on the files as written.",
        ),
        table(heads, rows, label="Mold checks", numeric=(2, 3), class_="wide") if rows else Html(""),
    )
