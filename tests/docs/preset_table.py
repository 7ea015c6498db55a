"""The table of presets of docs/how-to/index.md, and its pictures, docs/images/presets/*.svg, made from the designs."""

from __future__ import annotations

from optopad.design.circuit.circuit import Circuit
from optopad.design.mold.outline import outline_of
from optopad.design.preset import PRESETS, preset
from optopad.design.shape.cavity import cavity_of
from optopad.design.shape.outline import Outline
from optopad.design.spec import SensorDesign
from optopad.fabrication.sheets import svg
from optopad.fabrication.sheets.template import number, size_words
from optopad.fabrication.sheets.wiring_svg import EMITTER_COLOUR, LINE_COLOUR, RECEIVER_COLOUR

PICTURE_PX = 110.0
"""Longer side of a picture [px]."""
ARC_RAD = 0.2
PURPOSES = {
    "piacenza2017-pad": "the paper's pad: the first run, and comparison with published figures",
    "piacenza2017-pair": "the paper's thickness experiment: one row of LEDs faces one of photodiodes",
    "oblong-60x40": "a larger area, such as a palm",
    "fingertip-16": "a small flat fingertip",
    "levi2013-disc": "a published disc with infrared parts",
    "crowned-40x25": "a crowned pad that touches flat objects across its middle line",
    "fingertip-dome": "a round, domed fingertip",
    "gripper-stadium": "the finger of a small gripper, with screw holes",
    "gripper-teensy": "the finger of a gripper that is read at a high rate",
    "roboy-lightskin": "a large disc that averages many readings",
    "disco-patch": "many parts on a board under a reflective skin, as in a published finger",
    "board-pad": "pairs of LED and photodiode on a board, one under each location",
}


def presets_table() -> str:
    """A row for each preset: picture, sizes, parts, board with rate, purpose."""
    rows = [
        "| preset | from above | pad | mold outside | LEDs + photodiodes | board | for |",
        "|---|---|---|---|---|---|---|",
    ]
    for name in PRESETS:
        design = preset(name)
        outline, parts = outline_of(design), cavity_of(design).parts
        lit = sum(part.kind == "emitter" for part in parts)
        tall = number(round(outline.highest_mm - outline.bottom_mm, 1))
        layer = number(design.cavity.clear_thickness_mm)
        crown = "" if design.crown is None else f", {design.crown.shape} R{number(design.crown.radius_mm)}"
        rows.append(
            f"| `{name}` | ![The pad {name} from above](../images/presets/{name}.svg) | "
            f"{size_words(outline.plan.outline, ' mm')}, {layer} mm of clear layer{crown} | "
            f"{size_words(outline.outer, ' mm')}, {tall} mm high | {lit} + {len(parts) - lit} | "
            f"{Circuit.of(design).board.title}, {number(design.board.frame_rate_hz)} Hz | {PURPOSES[name]} |"
        )
    return "\n".join(rows)


def preset_picture(design: SensorDesign) -> str:
    """SVG of a pad from above: mold, screw holes, cavity, workspace, LEDs (orange) and photodiodes (blue)."""
    outline, cavity = outline_of(design), cavity_of(design)
    left, low, right, high = outline.outer.box_mm
    scale = PICTURE_PX / max(right - left, high - low)

    def around(shape: Outline) -> list[svg.Point]:
        return [at(x, y) for x, y in shape.points(ARC_RAD)]

    def at(x: float, y: float) -> svg.Point:
        return (x - left) * scale + 1.0, (high - y) * scale + 1.0

    root = svg.drawing(
        (right - left) * scale + 2.0, (high - low) * scale + 2.0, design.name, "The pad from above, to scale"
    )
    root.append(svg.outline(around(outline.outer), fill="#d9d9d9", stroke=LINE_COLOUR))
    for hole in outline.fixing_holes:
        root.append(svg.circle(at(hole.x, hole.y), hole.radius * scale, fill="#ffffff", stroke=LINE_COLOUR))
    root.append(svg.outline(around(cavity.plan.outline), fill="#eaf4ff", stroke=LINE_COLOUR))
    dashes = {"fill": "none", "stroke": LINE_COLOUR, "stroke_dasharray": "3 2", "stroke_width": "0.7"}
    root.append(svg.outline(around(cavity.workspace), **dashes))
    for part in cavity.parts:
        colour = EMITTER_COLOUR if part.kind == "emitter" else RECEIVER_COLOUR
        plan = part.body_mm[[0, 1, 2, 3] if part.is_on_floor else [4, 5, 1, 0], :2]
        root.append(svg.polygon([at(x, y) for x, y in plan.tolist()], fill=colour))
    return svg.to_text(root)
