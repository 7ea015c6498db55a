"""Drawing of the parts' orientation: for each type of part and height, a cross-section through its socket or board.

      cavity | wall                    the active face points into the cavity; its centre's height is measured
             |______ rim               from the bottom of the clear layer (z = 0)
     ~ fill ~| body |
             ||face ||
     ________|______|
     black   |  ||  leads or wires
    ---------+-------- bed

Parts on the floor are drawn on their circuit board, with the layers around them:

     ~ fill ~~~~~~~~~~
      clear  __face__     looks up; its height is measured from the bottom of the clear layer
     _______| body  |___
     black  |_______|
    ==================== circuit board

The drawing agrees with the printed part: its numbers come from `optopad.design.mold.outline`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from functools import partial

from optopad.design.circuit.circuit import Circuit
from optopad.design.fields.quantity import ROUNDING_MM
from optopad.design.mold.outline import MoldOutline, outline_of
from optopad.design.mold.sockets import Cut, Socket, lead_setback_mm
from optopad.design.shape.cavity import PlacedPart, cavity_of
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
BOARD, BOARD_MM = "#3f7d55", 1.6
"""Colour and thickness of a circuit board; 1.6 mm is the usual one."""


def orientation_svg(design: SensorDesign) -> str:
    """Cross-sections through the sockets of all types of parts, to scale, as SVG text.

    Raises
    ------
    DesignError : the catalogue does not have a part.
    """
    outline = outline_of(design)
    groups, standing = _groups(outline.sockets), _standing(cavity_of(design).on_floor)
    below = BOARD_MM if outline.is_frame else 0.0
    tallest = (outline.highest_mm - outline.bottom_mm + below) * SCALE
    widest = (INSIDE_MM + max(outline.wall_x_mm, outline.wall_y_mm)) * SCALE
    row = max(tallest + 2 * LINE_PX, 11 * LINE_PX) + GAP
    root = svg.drawing(
        2 * MARGIN + widest + GAP + TEXT_WIDTH,
        HEAD + (len(groups) + len(standing)) * row + MARGIN,
        f"Parts of {design.name} in their places",
        f"Sections through {len(groups) + len(standing)} kinds of places, true to scale",
    )
    root.append(svg.text((MARGIN, MARGIN + HEADING_PX), design.name, HEADING_PX, font_weight="bold"))
    where = "on the circuit board" if outline.is_frame else "in their sockets, cut across the wall"
    subtitle = f"parts {where}; design digest {design.digest[:8]}; lengths in mm"
    root.append(svg.text((MARGIN, MARGIN + HEADING_PX + LINE_PX), subtitle, TEXT_PX, fill=QUIET))
    drawn = [
        *((partial(_section, design, outline, group[0]), _words(design, group)) for group in groups),
        *((partial(_on_board, outline, alike[0]), _board_words(design, alike)) for alike in standing),
    ]
    for place, (section, words) in enumerate(drawn):
        top = HEAD + place * row + LINE_PX
        root.append(section((MARGIN, top)))
        for line, text in enumerate(words):
            at = MARGIN + widest + GAP, top + (line + 1) * LINE_PX
            root.append(svg.text(at, text, TEXT_PX, **({"font_weight": "bold"} if line == 0 else {})))
    return svg.to_text(root)


def _groups(sockets: Sequence[Socket]) -> list[list[Socket]]:
    groups: dict[tuple[str, float, float], list[Socket]] = {}
    for socket in sockets:
        key = socket.part.part_id, socket.part.height_mm, socket.frame.thickness_mm
        groups.setdefault(key, []).append(socket)
    return list(groups.values())


def _standing(parts: Sequence[PlacedPart]) -> list[list[PlacedPart]]:
    """Parts on the floor in groups of one type, height and tilt."""
    groups: dict[tuple[str, float, float], list[PlacedPart]] = {}
    for part in parts:
        groups.setdefault((part.part_id, round(part.height_mm, 9), part.tilt_deg), []).append(part)
    return list(groups.values())


def _on_board(outline: MoldOutline, part: PlacedPart, corner: Point) -> Element:
    """Cross-section through a part on the circuit board, along the direction in which it looks or is turned."""
    wide = INSIDE_MM + max(outline.wall_x_mm, outline.wall_y_mm)
    board, tilt = outline.cavity_bottom_mm, math.radians(part.tilt_deg)

    def at(across: float, z: float) -> Point:
        return corner[0] + (wide / 2 + across) * SCALE, corner[1] + (outline.highest_mm - z) * SCALE

    def block(z0: float, z1: float, fill: str) -> Element:
        return svg.rectangle(at(-wide / 2, z1), at(wide / 2, z0), fill=fill)

    def on_body(up_face: float, behind: float) -> Point:
        """Point of the body: distance up the face from the active area's middle, and behind the face [mm]."""
        across = -up_face * math.cos(tilt) - behind * math.sin(tilt)
        return at(across, part.height_mm + up_face * math.sin(tilt) - behind * math.cos(tilt))

    size, colour = part.part, EMITTER_COLOUR if part.kind == "emitter" else RECEIVER_COLOUR
    low, deep = size.active_height_in_body_mm.value, size.body_depth_mm.value
    high, half = size.body_height_mm.value - low, part.half_height_mm
    drawing = svg.group(f"{part.name}: {size.title}")
    drawing.append(block(0.0, outline.fill_mm, CLEAR))
    if board < 0:
        drawing.append(block(board, 0.0, BLACK))
    drawing.append(block(board - BOARD_MM, board, BOARD))
    body = [on_body(-low, 0.0), on_body(high, 0.0), on_body(high, deep), on_body(-low, deep)]
    drawing.append(svg.polygon(body, fill=BODY, stroke=INK, stroke_width="1.6"))
    face = [on_body(-half, 0.0), on_body(half, 0.0)]
    drawing.append(svg.polyline(face, stroke=colour, stroke_width="4"))
    drawing.extend(svg.arrow(on_body(0.0, -0.3), on_body(0.0, -min(3.0, 0.6 * outline.fill_mm)), colour))
    surface = [at(-wide / 2, outline.fill_mm), at(wide / 2, outline.fill_mm)]
    drawing.append(svg.polyline(surface, stroke="#2f6b9a", stroke_width="2"))
    foot = at(-wide / 2 + 2.5, 0.0)
    drawing.append(
        svg.polyline(
            [at(-wide / 2, part.height_mm), at(0.0, part.height_mm)], stroke=QUIET, stroke_dasharray="3 3"
        )
    )
    drawing.append(
        svg.text(
            (foot[0] - 2.4 * SCALE, at(0.0, part.height_mm)[1] - 5), number(part.height_mm), TEXT_PX, fill=INK
        )
    )
    return drawing


def _board_words(design: SensorDesign, alike: Sequence[PlacedPart]) -> list[str]:
    part = alike[0]
    names = [one.name for one in alike]
    board = -design.cavity.black_thickness_mm
    looks = "looks up" if part.tilt_deg == 0.0 else f"tilted {part.tilt_deg:g} degrees from looking up"
    gap = part.body_base_mm - board
    stands = "on the circuit board" if gap < ROUNDING_MM else f"{number(gap)} above the circuit board"
    return [
        part.part.title,
        *(" ".join(names[k : k + 12]) for k in range(0, len(names), 12)),
        *_wrapped(
            f"active face {looks}, centre {number(part.height_mm - board)} above the board"
            + (f" and {number(part.height_mm)} above the black layer" if board < 0 else "")
        ),
        f"body {stands}, top {number(part.body_top_mm - board)} above the board",
        *_wrapped(polarity_of(part, Circuit.of(design))),
    ]


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
