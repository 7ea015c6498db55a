"""Sections on the thing itself: its pictures, what it is made of, and whether the mold can be printed."""

from __future__ import annotations

import base64
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from design.mold.outline import bed_lift_mm
from design.preset import true_description
from design.shape.cavity import CavityGeometry, PlacedPart, cavity_of
from design.shape.outline import Outline
from design.spec import Crown, SensorDesign
from design.spec.tip_shape import tip_words
from optopad.report.sections.drawings import Drawing, figure_of
from optopad.report.text.markup import Html, element, facts, section, table
from optopad.screen.numbers import counted

MOLD_STL, LID_STL = "cad/mold.stl", "cad/lid.stl"
ALONG = ", along the normal of the top where the tip touches"
WIRING_SVG = "fabrication/wiring.svg"
SCHEMATIC_SVG = "fabrication/schematic.svg"
ORIENTATION_SVG = "fabrication/orientation.svg"
LAYOUT_WORDS = (
    "Seen from above and cut open, to one scale. Lengths in mm; heights are above the bottom of the clear layer. "
    "Circles: emitters; squares: receivers, with {place}; dashed: where presses are judged."
)
STATES = {"ok": "\N{CHECK MARK} ok", "warning": "! warning", "error": "\N{MULTIPLICATION X} error"}


@dataclass(frozen=True, kw_only=True)
class Pictures:
    """Pictures that a bundle holds as data addresses, None where a file is missing; and whether the mold is round."""

    mold: str | None
    wiring: str | None
    lid: str | None = None
    is_round: bool = False
    schematic: str | None = None
    orientation: str | None = None


def pictures_of(design: SensorDesign, folder: Path) -> Pictures:
    """The mold as a picture, and the drawings of the build sheet."""
    return Pictures(
        mold=_mold_address(folder / MOLD_STL),
        lid=_lid_address(design, folder),
        is_round=design.cavity.outline == "disc",
        wiring=_svg_address(folder / WIRING_SVG),
        schematic=_svg_address(folder / SCHEMATIC_SVG),
        orientation=_svg_address(folder / ORIENTATION_SVG),
    )


def _mold_address(stl: Path) -> str | None:
    if not stl.is_file():
        return None
    from cad.picture import mold_picture

    return _address("image/png", mold_picture(stl))


def _lid_address(design: SensorDesign, folder: Path) -> str | None:
    lid, mold = folder / LID_STL, folder / MOLD_STL
    if design.crown is None or not (lid.is_file() and mold.is_file()):
        return None
    from cad.lid_size import lid_size, turned_over
    from cad.mesh import Mesh, read_stl
    from cad.picture import section_picture

    size, whole = lid_size(design), read_stl(mold.read_bytes())
    assert size is not None  # a crowned pad has a lid
    lift = np.array([0.0, 0.0, bed_lift_mm(design)], dtype=np.float32)
    parts = (
        Mesh(vertices=whole.vertices - lift, triangles=whole.triangles),
        turned_over(read_stl(lid.read_bytes()), design, size),
    )
    return _address("image/png", section_picture(parts, design.cavity.width_mm / 2))


def _svg_address(svg: Path) -> str | None:
    return _address("image/svg+xml", svg.read_bytes()) if svg.is_file() else None


def _address(kind: str, content: bytes) -> str:
    return f"data:{kind};base64,{base64.b64encode(content).decode('ascii')}"


def sensor_section(design: SensorDesign, drawings: dict[str, Drawing]) -> Html:
    """What the sensor is, with its dimensions."""
    about = facts(_facts(design, cavity_of(design)))
    described = true_description(design)
    return section(
        "sensor",
        "Layout",
        *([element("p", described)] if described else []),
        figure_of(drawings["layout"], _layout_words(design)),
        about,
    )


def _layout_words(design: SensorDesign) -> str:
    is_disc = design.cavity.outline == "disc"
    place = "the direction of each from the middle" if is_disc else "the place of each along its wall"
    words = LAYOUT_WORDS.format(place=place)
    if design.crown is None:
        return words
    return f"{words} Dotted: the floor's holes, which the clear layer is poured through upside down."


def mold_figure(pictures: Pictures) -> Html:
    """The mold's picture; nothing where the bundle has none."""
    if pictures.mold is None:
        return Html("")
    seen = "the side" if pictures.is_round else "the corner"
    return _picture(
        pictures.mold,
        "The mold, shaded",
        f"The mold, seen from above {seen} where x and y are {'low' if pictures.is_round else '0'}",
        MOLD_STL,
    )


def lid_figure(pictures: Pictures) -> Html:
    """Lid and mold, cut through; nothing where the bundle has no lid."""
    if pictures.lid is None:
        return Html("")
    words = "The lid on the mold, cut along x through the middle"
    return _picture(pictures.lid, words, words, LID_STL)


def wiring_figure(pictures: Pictures) -> Html:
    """The wiring drawing; nothing where the bundle has none."""
    if pictures.wiring is None:
        return Html("")
    words = "Layout and wiring of emitters and receivers"
    return _picture(pictures.wiring, words, "Layout and wiring", WIRING_SVG)


def orientation_figure(pictures: Pictures) -> Html:
    """Sections through the sockets; nothing where the bundle has none."""
    if pictures.orientation is None:
        return Html("")
    words = "Each kind of part in its socket, cut across the wall"
    return _picture(pictures.orientation, words, words, ORIENTATION_SVG)


def schematic_figure(pictures: Pictures) -> Html:
    """The schematic; nothing where the bundle has none."""
    if pictures.schematic is None:
        return Html("")
    words = "Schematic: a transistor switch for each emitter, an amplifier for each receiver"
    return _picture(pictures.schematic, words, "Schematic", SCHEMATIC_SVG)


def _picture(address: str, words: str, caption: str, file: str) -> Html:
    image = element("img", src=address, alt=words)
    words_below = element("figcaption", f"{caption}: ", element("a", file, href=file))
    look = (
        "card themed" if address.startswith("data:image/png") else "card"
    )  # the drawing has its own white ground
    return element("figure", element("div", image, class_=look), words_below)


def _facts(design: SensorDesign, cavity: CavityGeometry) -> list[tuple[str, str]]:
    return [
        ("cavity", _cavity_words(cavity)),
        ("layers", f"{cavity.clear_mm:g} mm clear on {cavity.black_mm:g} mm black"),
        *([] if design.crown is None else [("top", _crown_words(design.crown, cavity))]),
        ("elastomer", f"{design.elastomer.material}, {design.elastomer.mixing_ratio:g} : 1 by weight"),
        ("emitters", _parts(cavity.emitters)),
        ("receivers", _parts(cavity.receivers)),
        ("tip", tip_words(design.indenter)),
        ("workspace", _workspace_words(cavity.workspace)),
        ("deepest press", f"{design.operating.max_depth_mm:g} mm{'' if design.crown is None else ALONG}"),
        ("board", f"{design.board.kind}, {design.board.frame_rate_hz:g} frames a second wanted"),
        ("measured on the build", ", ".join(design.measured) or "nothing yet"),
    ]


def _cavity_words(cavity: CavityGeometry) -> str:
    if cavity.plan.is_disc:
        return f"disc of {cavity.length_mm:g} mm, a flat facet for each part"
    return f"{cavity.length_mm:g} x {cavity.width_mm:g} mm"


def _crown_words(crown: Crown, cavity: CavityGeometry) -> str:
    low, high = (f"{edge:.2f}" for edge in cavity.plan.rim_mm)
    straight = "" if crown.axis is None else f", straight along {crown.axis}"
    edge = low if low == high else f"{low} to {high}"
    return f"convex, a {crown.shape} of {crown.radius_mm:g} mm radius{straight}; its edge {edge} mm above the bottom"


def _workspace_words(space: Outline) -> str:
    if space.arcs:
        x, y = (space.x0_mm + space.x1_mm) / 2, (space.y0_mm + space.y1_mm) / 2
        return f"disc of {space.x1_mm - space.x0_mm:g} mm around x {x:g}, y {y:g} mm"
    return f"x {space.x0_mm:g} to {space.x1_mm:g}, y {space.y0_mm:g} to {space.y1_mm:g} mm"


def _parts(parts: tuple[PlacedPart, ...]) -> str:
    groups: dict[tuple[str, float], int] = {}
    for part in parts:
        groups[part.part_id, part.height_mm] = groups.get((part.part_id, part.height_mm), 0) + 1
    return "; ".join(
        f"{count} {part} at {height:g} mm above the bottom" for (part, height), count in groups.items()
    )


def checks_section(checks: dict[str, Any]) -> Html:
    """The mold's checks, what is wrong first."""
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
