"""Drawing of the parts' orientation in the wall: for each type of part and height, a cross-section through the socket.

      cavity | wall                    the active face points into the cavity; its centre's height is measured
             |______ rim               from the bottom of the clear layer (z = 0)
     ~ fill ~| body |
             ||face ||
     ________|______|
     black   |  ||  leads or wires
    ---------+-------- bed

The drawing agrees with the printed part: its numbers come from `optopad.design.mold.outline`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

from optopad.design.circuit.circuit import Circuit
from optopad.design.mold.outline import MoldOutline, outline_of
from optopad.design.mold.sockets import Cut, Socket, lead_setback_mm
from optopad.design.spec import SensorDesign
from optopad.design.spec.properties import clearance_mm, fit_name
from optopad.fabrication.connections import polarity_of
from optopad.fabrication.sheets import svg
from optopad.fabrication.sheets.svg import Element, Point
from optopad.fabrication.sheets.template import number
from optopad.fabrication.sheets.wiring_svg import EMITTER_COLOUR, RECEIVER_COLOUR

SCALE = 16.0
"""Scale of the drawing [drawing units/mm]."""
INSIDE_MM = 9.0
"""Width of the cavity that is drawn in front of the wall [mm]."""
MARGIN, GAP = 24.0, 36.0
HEADING_PX, TEXT_PX = 20.0, 14.0
LINE_PX = 19.0
HEAD = 62.0
TEXT_WIDTH = 470.0
WALL, CLEAR, BLACK, BODY, INK, QUIET = "#d9d9d9", "#eaf4ff", "#4d4d4d", "#ffffff", "#222222", "#595959"


def orientation_svg(design: SensorDesign) -> str:
    """Cross-sections through the sockets of all types of parts, to scale, as SVG text.

    Raises
    ------
    DesignError : the catalogue does not have a part.
    """
    outline = outline_of(design)
    groups = _groups(outline.sockets)
    tallest = (outline.highest_mm - outline.bottom_mm) * SCALE
    widest = (INSIDE_MM + max(outline.wall_x_mm, outline.wall_y_mm)) * SCALE
    row = max(tallest + 2 * LINE_PX, 11 * LINE_PX) + GAP
    root = svg.drawing(
        2 * MARGIN + widest + GAP + TEXT_WIDTH,
        HEAD + len(groups) * row + MARGIN,
        f"Parts of {design.name} in their sockets",
        f"Sections through {len(groups)} kinds of socket, true to scale",
    )
    root.append(svg.text((MARGIN, MARGIN + HEADING_PX), design.name, HEADING_PX, font_weight="bold"))
    subtitle = (
        f"parts in their sockets, cut across the wall; design digest {design.digest[:8]}; lengths in mm"
    )
    root.append(svg.text((MARGIN, MARGIN + HEADING_PX + LINE_PX), subtitle, TEXT_PX, fill=QUIET))
    for place, group in enumerate(groups):
        top = HEAD + place * row + LINE_PX
        root.append(_section(design, outline, group[0], (MARGIN, top)))
        for line, text in enumerate(_words(design, group)):
            at = MARGIN + widest + GAP, top + (line + 1) * LINE_PX
            root.append(svg.text(at, text, TEXT_PX, **({"font_weight": "bold"} if line == 0 else {})))
    return svg.to_text(root)


def _groups(sockets: Sequence[Socket]) -> list[list[Socket]]:
    groups: dict[tuple[str, float, float], list[Socket]] = {}
    for socket in sockets:
        key = socket.part.part_id, socket.part.height_mm, socket.frame.thickness_mm
        groups.setdefault(key, []).append(socket)
    return list(groups.values())


def _section(design: SensorDesign, outline: MoldOutline, socket: Socket, corner: Point) -> Element:
    thickness, top = socket.frame.thickness_mm, outline.highest_mm

    def at(outward: float, z: float) -> Point:
        return corner[0] + (INSIDE_MM + outward) * SCALE, corner[1] + (top - z) * SCALE

    def block(o0: float, o1: float, z0: float, z1: float, fill: str, **style: str) -> Element:
        return svg.rectangle(at(o0, z1), at(o1, z0), fill=fill, **style)

    part, colour = socket.part, EMITTER_COLOUR if socket.part.kind == "emitter" else RECEIVER_COLOUR
    drawing = svg.group(f"{part.name}: {part.part.title}")
    drawing.append(block(-INSIDE_MM, 0.0, 0.0, outline.fill_mm, CLEAR))
    if outline.cavity_bottom_mm < 0:
        drawing.append(block(-INSIDE_MM, 0.0, outline.cavity_bottom_mm, 0.0, BLACK))
    drawing.append(block(-INSIDE_MM, thickness, outline.bottom_mm, outline.cavity_bottom_mm, WALL))
    drawing.append(block(0.0, thickness, outline.bottom_mm, outline.top_mm, WALL))
    if socket.pocket.top > outline.top_mm:
        end = min(socket.pocket.out1 + design.mold.min_web_mm, thickness)
        drawing.append(block(outline.mouth_out_mm, end, outline.top_mm, socket.pocket.top, WALL))
    for cut in socket.cuts:
        drawing.append(block(cut.out0, cut.out1, cut.floor, cut.top, BODY))
    drawing.extend(_ways_of_leads(socket, block))
    depth, face = part.part.body_depth_mm.value, part.part.active_height_mm.value / 2
    drawing.append(
        block(0.0, depth, part.body_base_mm, part.body_top_mm, BODY, stroke=INK, stroke_width="1.6")
    )
    drawing.append(block(-0.12, 0.12, part.height_mm - face, part.height_mm + face, colour))
    drawing.extend(svg.arrow(at(-0.3, part.height_mm), at(-3.0, part.height_mm), colour))
    drawing.append(
        svg.polyline(
            [at(-INSIDE_MM, outline.fill_mm), at(0.0, outline.fill_mm)], stroke="#2f6b9a", stroke_width="2"
        )
    )
    drawing.extend(_dimension(at, part.height_mm))
    return drawing


def _ways_of_leads(socket: Socket, block: Callable[..., Element]) -> Iterator[Element]:
    if socket.channel is not None:
        cut: Cut = socket.channel
        yield block(cut.out0, cut.out1, cut.floor, cut.top, BODY)
    if socket.holes:
        hole, setback = socket.holes[0], lead_setback_mm(socket.part.part)
        yield block(setback - hole.radius, setback + hole.radius, hole.z0, hole.z1, BODY)
        lead = socket.part.part.lead_diameter_mm.value / 2
        end = hole.z0 - (0.0 if socket.channel is None else 0.8)
        yield block(setback - lead, setback + lead, end, socket.part.body_base_mm, INK)
        if socket.channel is not None:
            yield block(setback - lead, socket.frame.thickness_mm + 1.2, end - 2 * lead, end, INK)
    for slot in socket.slots:
        wire = socket.part.part.lead_diameter_mm.value
        low = socket.part.body_base_mm + 0.5
        yield block(
            socket.part.part.body_depth_mm.value, socket.frame.thickness_mm + 1.2, low, low + wire, INK
        )
        assert slot.floor <= low


def _dimension(at: Callable[[float, float], Point], height_mm: float) -> Iterator[Element]:
    foot, head = at(-5.0, 0.0), at(-5.0, height_mm)
    yield from svg.arrow(foot, head, INK)
    yield from svg.arrow(head, foot, INK)
    yield svg.text((foot[0] - 6, (foot[1] + head[1]) / 2 + 5), number(height_mm), TEXT_PX, anchor="end")
    yield svg.polyline([at(-6.0, height_mm), at(-3.0, height_mm)], stroke=QUIET, stroke_dasharray="3 3")


def _words(design: SensorDesign, group: Sequence[Socket]) -> list[str]:
    first, part = group[0], group[0].part
    room = clearance_mm(design.mold, part.part_id)
    leads = "leads down" if first.holes else "wires out through the back, pressed into the neck"
    if first.holes:
        leads += (
            ", then out through the channel" if first.channel else " through the floor, no channel: use feet"
        )
    names = [socket.part.name for socket in group]
    lines = [names[k : k + 12] for k in range(0, len(names), 12)]
    return [
        part.part.title,
        *(" ".join(line) for line in lines),
        f"active face towards the cavity, flush with its wall, centre at {number(part.height_mm)}",
        f"body on the floor of its pocket, base at {number(part.body_base_mm)}, top at {number(part.body_top_mm)}",
        f"fit: {fit_name(design.mold, part.part_id)}, {number(room)} at each side",
        leads,
        *_wrapped(polarity_of(part, Circuit.of(design))),
    ]


def _wrapped(text: str) -> list[str]:
    lines: list[str] = []
    line = ""
    for word in text.split():
        if len(line) + len(word) > 62:
            lines, line = [*lines, line], ""
        line = f"{line} {word}".strip()
    return [*lines, line]
