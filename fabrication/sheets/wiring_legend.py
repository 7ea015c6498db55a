"""The legend of the wiring drawing, and the colours and sizes that it shares with the drawing."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from design.mold.outline import outline_of
from design.shape.cavity import workspace_of
from design.shape.outline import Outline
from design.shape.plan import Plan
from design.spec import SensorDesign
from fabrication.connections import Connection
from fabrication.sheets.formats import svg
from fabrication.sheets.formats.svg import Element, Point
from fabrication.sheets.formats.table import number, size_words

EMITTER_COLOUR = "#b34700"
RECEIVER_COLOUR = "#00589e"
LINE_COLOUR = "#444444"
WORKSPACE_COLOUR = "#2f6b3a"
PIN_PX = 14.0
"""Font size of pins and of the legend."""
LEGEND_LINE_PX, MARGIN_PX, ORIGIN_PX, SYMBOL_PX = 24.0, 24.0, 4.0, 10.0


def legend_lines(design: SensorDesign, connections: Sequence[Connection]) -> list[tuple[str, str]]:
    """Symbol (none: empty) and text of every line."""
    outline = outline_of(design)
    lines = []
    for kind in ("emitter", "receiver"):
        titles = {one.part.part_id: one.part.part.title for one in connections if one.part.kind == kind}
        heights = sorted({one.part.height_mm for one in connections if one.part.kind == kind})
        levels = " and ".join(number(height) for height in heights)
        lines.append(
            (kind, f"{kind}: {', '.join(titles.values())}; centre {levels} mm above the black layer")
        )
    workspace = workspace_of(design)
    return [
        *lines,
        ("workspace", f"workspace of press centres: {_space_words(workspace)}"),
        ("origin", f"origin of x and y: {_origin_words(outline.plan)}"),
        ("", f"labels: reference, board pin (D digital, A analogue), {_places_words(connections)}"),
        ("", f"mold outside {size_words(outline.outer, ' mm')}"),
    ]


def _space_words(space: Outline) -> str:
    if space.dimensions[0].is_diameter:
        x, y = (number(place) for place in space.centre_mm)
        return f"{size_words(space, ' mm')}, around x {x}, y {y} mm"
    x0, y0, x1, y1 = (number(side) for side in space.box_mm)
    return f"x {x0} to {x1}, y {y0} to {y1} mm"


def _origin_words(plan: Plan) -> str:
    if plan.has_origin_corner:
        return "inner corner next to the mold's cut edge"
    box = "square" if plan.length_mm == plan.width_mm else "rectangle"
    return f"corner of the {box} around the {plan.outline.kind}; E1 tells the mold's direction"


def _places_words(connections: Sequence[Connection]) -> str:
    by_angle = {one.part.angle_deg is not None for one in connections}
    words = {False: "place along the wall in mm", True: "direction from the middle, 0 along x"}
    return " or ".join(words[one] for one in sorted(by_angle))


def legend(top: float, lines: Sequence[tuple[str, str]]) -> Iterator[Element]:
    """The lines as drawn, from a height of the sheet down [px]."""
    for place, (symbol, content) in enumerate(lines):
        middle = (MARGIN_PX + SYMBOL_PX, top + (place + 0.5) * LEGEND_LINE_PX)
        yield from _legend_symbol(symbol, middle)
        yield svg.text((middle[0] + 2.2 * SYMBOL_PX, middle[1] + PIN_PX * 0.35), content, PIN_PX)


def _legend_symbol(symbol: str, at: Point) -> Iterator[Element]:
    match symbol:
        case "emitter":
            yield svg.triangle(at, (0, -1), SYMBOL_PX * 0.8, fill=EMITTER_COLOUR)
        case "receiver":
            yield svg.circle(at, SYMBOL_PX * 0.7, fill="none", stroke=RECEIVER_COLOUR, stroke_width="3")
        case "workspace":
            half = (SYMBOL_PX, SYMBOL_PX * 0.6)
            corners = (at[0] - half[0], at[1] - half[1]), (at[0] + half[0], at[1] + half[1])
            yield svg.rectangle(*corners, fill="none", stroke=WORKSPACE_COLOUR, stroke_dasharray="5 4")
        case "origin":
            yield svg.circle(at, ORIGIN_PX, fill=LINE_COLOUR)
