"""The wiring drawing: the pad from above, to scale; each part is labelled with its reference, pin and position.

         E5   R5
         D26  A4         labels are outside next to their parts, and do not overlap
      +--v----o---+
   R8 o           |      triangle: emitter, circle: receiver; they also differ in colour
      |  cavity   v E3
      +--^----o---+
         E1   R1

On a round pad, a label is at the side of the sheet nearest to its part. Parts on the floor have their labels at them.
The shapes of bodies and mold come from `optopad.design.mold.outline`, so the drawing agrees with the printed part.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

from optopad.design.circuit.circuit import Circuit
from optopad.design.fields.quantity import ROUNDING_MM
from optopad.design.mold.outline import MoldOutline, outline_of
from optopad.design.mold.sockets import Socket
from optopad.design.shape.cavity import TURN_RAD, PlacedPart, Plan, workspace_of
from optopad.design.shape.outline import Outline, X
from optopad.design.spec import SensorDesign
from optopad.design.spec.pad import WALLS, Wall
from optopad.fabrication.connections import Connection, connections_of, pin_words
from optopad.fabrication.sheets import svg
from optopad.fabrication.sheets.svg import Element, Point
from optopad.fabrication.sheets.template import number, size_words

EMITTER_COLOUR = "#b34700"
RECEIVER_COLOUR = "#00589e"
LINE_COLOUR = "#444444"
WORKSPACE_COLOUR = "#2f6b3a"
PIN_PX = 14.0
"""Font size of pin names and of the legend [px]."""
LEGEND_LINE_PX, MARGIN_PX, ORIGIN_PX, SYMBOL_PX = 24.0, 24.0, 4.0, 10.0


def legend_lines(design: SensorDesign, connections: Sequence[Connection]) -> list[tuple[str, str]]:
    """Symbol name and text of every line of the legend; the name is "" for a line without a symbol."""
    outline = outline_of(design)
    bottom = "board" if outline.is_frame and outline.cavity_bottom_mm == 0.0 else "black layer"
    lines = []
    for kind in ("emitter", "receiver"):
        titles = {one.part.part_id: one.part.part.title for one in connections if one.part.kind == kind}
        heights = sorted({one.part.height_mm for one in connections if one.part.kind == kind})
        levels = " and ".join(number(height) for height in heights)
        lines.append((kind, f"{kind}: {', '.join(titles.values())}; centre {levels} mm above the {bottom}"))
    workspace = workspace_of(design)
    return [
        *lines,
        ("workspace", f"workspace of press centres: {_space_words(workspace)}"),
        ("origin", f"origin of x and y: {_origin_words(outline.plan)}"),
        ("", f"labels: reference, pin ({pin_words(Circuit.of(design))}), {_places_words(connections)}"),
        (
            "",
            f"{'frame' if outline.is_frame else 'mold'} outside {size_words(outline.outer, ' mm')}; {_layers(design)}",
        ),
    ]


def _space_words(space: Outline) -> str:
    if space.dimensions[0].is_diameter:
        x, y = (number(place) for place in space.centre_mm)
        return f"{size_words(space, ' mm')}, around x {x}, y {y} mm"
    x0, y0, x1, y1 = (number(side) for side in space.box_mm)
    return f"x {x0} to {x1}, y {y0} to {y1} mm"


def _origin_words(plan: Plan) -> str:
    if plan.has_origin_corner:
        return "inner corner next to the cut edge of the mold"
    box = "square" if plan.length_mm == plan.width_mm else "rectangle"
    return f"corner of the {box} around the {plan.outline.kind}; E1 shows the mold's orientation"


def _places_words(connections: Sequence[Connection]) -> str:
    words = {
        "position along the wall in mm": any(
            one.part.angle_deg is None and not one.part.is_on_floor for one in connections
        ),
        "direction from the middle, 0 along x": any(one.part.angle_deg is not None for one in connections),
        "position of the active area's middle in mm": any(one.part.is_on_floor for one in connections),
    }
    return " or ".join(word for word, applies in words.items() if applies)


def legend(top: float, lines: Sequence[tuple[str, str]]) -> Iterator[Element]:
    """Drawing elements of the legend, whose upper edge is at the sheet's y coordinate `top` [px]."""
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


QUIET_COLOUR = "#595959"
WALL_COLOUR = "#d9d9d9"
POCKET_COLOUR = "#ffffff"
CAVITY_COLOUR = "#f4f9ff"

NAME_PX, NOTE_PX, HEADING_PX = 16.0, 13.0, 20.0
"""Font sizes of reference designators, notes and heading [px]."""
LETTER_SHARE = 0.6
"""Assumed width of a letter as a fraction of the font size [-]; the actual average is smaller."""
LABEL_LINES = 3
FLOOR_LINES, FLOOR_STACK, FLOOR_LINE_PX = 5.0, 4, 16.0
"""Height of the label around the symbol of a part on the floor [lines], and the lines of one next to it, and their
distance [px]."""
MOST_PX = 2600.0
"""Largest length of the cavity's longer side on the sheet [px]; labels of very close parts then overlap."""
LABEL_START_PX, LABEL_GAP_PX = 5.0, 10.0
LINE_PX = 18.0
LEADER_PX = 14.0
PAD_PX = 640.0
"""Smallest length of the cavity's longer side on the sheet [px]; it is larger if a wall's labels need more room."""
SIDE_PITCH_PX = 22.0
"""Vertical distance between neighbouring labels on the left or right of the pad [px]."""
DIMENSION_INSET_PX = 42.0
"""Distance of dimension lines, which are inside the cavity, from its walls [px]."""
AXIS_PX, AXIS_INSET_PX = 46.0, 34.0


@dataclass(frozen=True, kw_only=True)
class Sheet:
    """Scale and position of the pad on the sheet of the wiring drawing.

    Attributes
    ----------
    outline : dimensions of the mold
    scale : scale of the drawing [px/mm]
    left, top : sheet position of the cavity's upper left corner, at low x and high y [px]
    pitch : horizontal distance between neighbouring labels above or below the pad [px]
    columns : distances from a leader line to the reference, pin and position in a label left or right of the pad [px]
    side : width of the labels left and right of the pad [px]
    sides : for each part on the floor, the side of its label by `_label_side`
    """

    outline: MoldOutline
    scale: float
    left: float
    top: float
    pitch: float
    columns: tuple[float, float, float]
    side: float
    sides: Mapping[str, Point]

    def at(self, x_mm: float, y_mm: float) -> Point:
        """Sheet position [px] of a point in the cavity's coordinate system."""
        return self.left + x_mm * self.scale, self.top + (self.outline.width_mm - y_mm) * self.scale

    def around(self, outline: Outline) -> list[Point]:
        """Sheet positions of an outline's corners, starting at low x and low y if there is such a corner [px]."""
        return [self.at(*corner) for corner in outline.points(TURN_RAD).tolist()]

    @property
    def low_corner(self) -> Point:
        """Sheet position of the mold's outer corner at low x and low y [px]."""
        return self.at(-self.outline.wall_x_mm, -self.outline.wall_y_mm)

    @property
    def high_corner(self) -> Point:
        """Sheet position of the mold's outer corner at high x and high y [px]."""
        out = self.outline
        return self.at(out.length_mm + out.wall_x_mm, out.width_mm + out.wall_y_mm)


def wiring_svg(design: SensorDesign) -> str:
    """The wiring drawing as SVG text.

    Raises
    ------
    DesignError : the catalogue does not have a part, or the board does not have a pin.
    """
    connections = connections_of(Circuit.of(design)).all
    sheet = _sheet(outline_of(design), connections)
    lines = legend_lines(design, connections)
    legend_top = sheet.low_corner[1] + LEADER_PX + LABEL_LINES * LINE_PX + MARGIN_PX
    root = svg.drawing(
        sheet.high_corner[0] + LEADER_PX + sheet.side + MARGIN_PX,
        legend_top + len(lines) * LEGEND_LINE_PX + MARGIN_PX,
        f"Wiring of {design.name}",
        f"Top view of the pad with its {len(connections)} parts and their pins; the same as wiring.csv",
    )
    root.extend(_heading(design))
    root.extend(_mold(sheet))
    root.extend(_inside(sheet, workspace_of(design), design))
    sockets = {socket.part.name: socket for socket in sheet.outline.sockets}
    root.extend(_part(sheet, one, sockets.get(one.part.name)) for one in connections)
    for side in WALLS:
        root.extend(_labels(sheet, side, _on_side(connections, side), sockets))
    for one in connections:
        if one.part.is_on_floor:
            root.extend(_own_label(sheet, one, sheet.sides[one.part.name]))
    root.extend(legend(legend_top, lines))
    return svg.to_text(root)


def _on_side(connections: Sequence[Connection], side: Wall) -> list[Connection]:
    """The parts in walls whose labels are at a side of the sheet."""
    return [one for one in connections if not one.part.is_on_floor and _side(one) == side]


def _side(one: Connection) -> Wall:
    """Side of the sheet where a part's label is: that of the part's wall or, on a round pad, the nearest side."""
    x, y = one.part.line.outward
    if abs(x) > abs(y):
        return "east" if x > 0 else "west"
    return "north" if y > 0 else "south"


def spread(wanted: Sequence[float], gap: float, low: float, high: float) -> list[float]:
    """Positions of labels along a line, at least `gap` apart, with least squared deviations from requested positions.

    Parameters
    ----------
    wanted : requested positions, in increasing order
    gap : smallest distance between neighbours
    low, high : limits of the positions; all labels must fit between them
    """
    blocks: list[list[float]] = []  # neighbours that touch share the mean of (wanted - place x gap)
    for place, position in enumerate(wanted):
        blocks.append([position - place * gap])
        while len(blocks) > 1 and _mean(blocks[-2]) >= _mean(blocks[-1]):
            last = blocks.pop()
            blocks[-1] += last
    free = [_mean(block) for block in blocks for _ in block]
    last_start = high - (len(free) - 1) * gap
    return [max(low, min(start, last_start)) + place * gap for place, start in enumerate(free)]


def _mean(values: list[float]) -> float:
    return sum(values) / len(values)


def _sheet(outline: MoldOutline, connections: Sequence[Connection]) -> Sheet:
    names = max(_text_px(one.part.name, NAME_PX) for one in connections)
    pins = max(_text_px(one.pin, PIN_PX) for one in connections)
    places = max(_text_px(line, NOTE_PX) for one in connections for line in one.part.place_lines)
    pitch = max(names, pins, places) + LABEL_GAP_PX
    second = LABEL_START_PX + names + LABEL_GAP_PX
    columns = (LABEL_START_PX, second, second + pins + LABEL_GAP_PX)
    side = columns[2] + places if outline.sockets else 0.0
    needs = [PAD_PX / max(outline.length_mm, outline.width_mm)]
    for wall in WALLS:
        count = len(_on_side(connections, wall))
        is_level = wall in ("south", "north")
        step, span = (pitch, outline.length_mm) if is_level else (SIDE_PITCH_PX, outline.width_mm)
        needs.append(count * step / span)
    on_floor = [one.part for one in connections if one.part.is_on_floor]
    on_floor_scale, sides = _floor_labels(on_floor, max(names, pins, places) + LABEL_START_PX)
    needs.append(on_floor_scale)
    scale = min(max(needs), MOST_PX / max(outline.length_mm, outline.width_mm))
    above = MARGIN_PX + HEADING_PX + 2 * LINE_PX + LABEL_LINES * LINE_PX + LEADER_PX
    return Sheet(
        outline=outline,
        scale=scale,
        left=MARGIN_PX + side + LEADER_PX + outline.wall_x_mm * scale,
        top=above + outline.wall_y_mm * scale,
        pitch=pitch,
        columns=columns,
        side=side,
        sides=sides,
    )


def _text_px(content: str, size: float) -> float:
    return len(content) * size * LETTER_SHARE


def _heading(design: SensorDesign) -> Iterator[Element]:
    baseline = MARGIN_PX + HEADING_PX
    yield svg.text((MARGIN_PX, baseline), design.name, HEADING_PX, font_weight="bold")
    subtitle = f"wiring, seen from above (open side up); design digest {design.digest[:8]}"
    yield svg.text((MARGIN_PX, baseline + LINE_PX), subtitle, PIN_PX, fill=QUIET_COLOUR)


def _mold(sheet: Sheet) -> Iterator[Element]:
    out = sheet.outline
    corners, cut = sheet.around(out.outer), out.origin_cut_mm * sheet.scale
    if cut:
        (x, y), *others = corners
        corners = [(x + cut, y), *others, (x, y - cut)]
    yield svg.polygon(corners, fill=WALL_COLOUR, stroke=LINE_COLOUR)
    for hole in out.fixing_holes:
        yield svg.circle(
            sheet.at(hole.x, hole.y), hole.radius * sheet.scale, fill="#ffffff", stroke=LINE_COLOUR
        )
    yield svg.outline(sheet.around(out.plan.outline), fill=CAVITY_COLOUR, stroke=LINE_COLOUR)


def _inside(sheet: Sheet, workspace: Outline, design: SensorDesign) -> Iterator[Element]:
    out, step = sheet.outline, LINE_PX / sheet.scale
    if not workspace.is_empty:
        yield svg.outline(
            sheet.around(workspace), fill="none", stroke=WORKSPACE_COLOUR, stroke_dasharray="7 5"
        )
    walls = {line.name: line for line in out.plan.outline.bare.lines}
    for name, steps, turn in (("north", 1.3, 0), ("south", 0.9, 0), ("east", 1.0, -90), ("west", 1.2, -90)):
        if name in walls:
            wall = walls[name]
            yield _turned(sheet.at(*wall.point(wall.length_mm / 2, -steps * step)), name, turn)
    yield from _dimensions(sheet)
    yield from _axes(sheet)
    if not out.is_frame:  # the middle of a frame's cavity is full of parts
        yield svg.text(
            sheet.at(*out.plan.centre_mm), _layers(design), PIN_PX, anchor="middle", fill=QUIET_COLOUR
        )


def _layers(design: SensorDesign) -> str:
    """Thicknesses of the layers in words."""
    layers = f"clear {number(design.cavity.clear_thickness_mm)} mm"
    if design.cavity.black_thickness_mm > 0:
        layers += f" on black {number(design.cavity.black_thickness_mm)} mm"
    return layers


def _turned(at: Point, content: str, degrees: int) -> Element:
    element = svg.text(at, content, NOTE_PX, anchor="middle", fill=QUIET_COLOUR)
    if degrees:
        element.set("transform", f"rotate({degrees} {at[0]:.2f} {at[1]:.2f})")
    return element


def _dimensions(sheet: Sheet) -> Iterator[Element]:
    bare = sheet.outline.plan.outline.bare
    for one in bare.dimensions:
        start, end = (
            sheet.at(*place) for place in _ends_mm(bare, one.direction, DIMENSION_INSET_PX / sheet.scale)
        )
        turn = 0 if one.direction == X else -90
        centre = ((start[0] + end[0]) / 2, (start[1] + end[1]) / 2)
        yield from svg.arrow(centre, start, LINE_COLOUR)
        yield from svg.arrow(centre, end, LINE_COLOUR)
        label = f"{'diameter ' if one.is_diameter else ''}{number(one.size_mm)} mm"
        half = (_text_px(label, PIN_PX) / 2 + 3, PIN_PX * 0.6)
        half = half if turn == 0 else half[::-1]
        low, high = (centre[0] - half[0], centre[1] - half[1]), (centre[0] + half[0], centre[1] + half[1])
        yield svg.rectangle(low, high, fill=CAVITY_COLOUR)
        drop = PIN_PX * 0.35
        element = _turned((centre[0] + (drop if turn else 0), centre[1] + (0 if turn else drop)), label, turn)
        element.set("fill", LINE_COLOUR)
        yield element


def _ends_mm(bare: Outline, direction: Point, inset_mm: float) -> tuple[Point, Point]:
    """End points [mm] of a dimension line across the pad along `direction`, `inset_mm` inside the wall at high x or y.

    On a round pad, the line is `inset_mm` from the middle instead, above the text there.
    """
    axis = int(direction == X)  # of the line's position next to other lines
    start, end = (place[axis] for place in bare.touches_mm(direction))
    at = list(bare.centre_mm)
    at[axis] = end + inset_mm if start == end else min(max(start, end), bare.box_mm[2 + axis] - inset_mm)
    (x, y), (dx, dy) = at, direction
    low, high = (bare.way_out_mm((x, y), (sign * dx, sign * dy)) for sign in (-1.0, 1.0))
    return (x - low * dx, y - low * dy), (x + high * dx, y + high * dy)


def _axes(sheet: Sheet) -> Iterator[Element]:
    x, y = sheet.at(0, 0)
    inset = AXIS_INSET_PX if sheet.outline.plan.has_origin_corner else 0.0
    corner = (x + inset, y - inset)
    for end, name, label in (
        ((corner[0] + AXIS_PX, corner[1]), "x", (corner[0] + AXIS_PX + 5, corner[1] + 4)),
        ((corner[0], corner[1] - AXIS_PX), "y", (corner[0] - 4, corner[1] - AXIS_PX - 6)),
    ):
        yield from svg.arrow(corner, end, LINE_COLOUR)
        yield svg.text(label, name, PIN_PX, fill=LINE_COLOUR, font_style="italic")
    yield svg.circle((x, y), ORIGIN_PX, fill=LINE_COLOUR)


def _part(sheet: Sheet, one: Connection, socket: Socket | None) -> Element:
    return _on_floor(sheet, one) if socket is None else _in_socket(sheet, one, socket)


def _on_floor(sheet: Sheet, one: Connection) -> Element:
    """A part on the floor: its body, and its symbol at the middle of its active area."""
    colour = EMITTER_COLOUR if one.part.kind == "emitter" else RECEIVER_COLOUR
    shapes = svg.group(_told(one))
    body = [sheet.at(*corner) for corner in one.part.footprint_mm.tolist()]
    shapes.append(svg.outline(body, fill=POCKET_COLOUR, stroke=colour, stroke_width="1.5"))
    centre, (x, y, _) = sheet.at(*one.part.position_mm[:2]), one.normal
    way = (x, -y) if one.part.tilt_deg else (0.0, -1.0)
    if one.part.kind == "emitter":
        shapes.append(svg.triangle(centre, way, SYMBOL_PX * 0.8, fill=colour))
    else:
        shapes.append(svg.circle(centre, SYMBOL_PX * 0.7, fill="none", stroke=colour, stroke_width="3"))
    return shapes


def _label_side(part: PlacedPart, parts: Sequence[PlacedPart]) -> Point:
    """Side of the label of a part on the floor: away from the other half of its coupler, else (0, 0) at the part."""
    partner = next(
        (one for one in parts if part.coupler and one.coupler == part.coupler and one is not part), None
    )
    if partner is None:
        return 0.0, 0.0
    x, y = (here - there for here, there in zip(part.position_mm[:2], partner.position_mm[:2], strict=True))
    return (math.copysign(1.0, x), 0.0) if abs(x) >= abs(y) else (0.0, math.copysign(1.0, y))


def _floor_labels(parts: Sequence[PlacedPart], width: float) -> tuple[float, dict[str, Point]]:
    """Least scale at which no labels of parts on the floor overlap [px/mm], and the side of each label by name.

    Labels are around the symbols, or those of couplers at their sides, whichever permits the smaller drawing.
    """
    ways = [
        {part.name: (0.0, 0.0) for part in parts},
        {part.name: _label_side(part, parts) for part in parts},
    ]
    scales = [_least_scale(parts, sides, width) for sides in ways]
    best = 1 if scales[1] < scales[0] else 0
    return scales[best], ways[best]


def _least_scale(parts: Sequence[PlacedPart], sides: Mapping[str, Point], width: float) -> float:
    """Least scale at which no labels of parts on the floor overlap, for labels of this width [px/mm]."""
    tall = FLOOR_LINES * LINE_PX
    boxes = []
    for part in parts:
        side = sides[part.name]
        size = (width, tall) if side == (0.0, 0.0) else (width, FLOOR_STACK * FLOOR_LINE_PX)
        away = [
            way * (SYMBOL_PX + LABEL_START_PX + length / 2) for way, length in zip(side, size, strict=True)
        ]
        boxes.append((part.position_mm[:2], away, size))

    def needed(one: float, other: float, ahead: float, least: float) -> float:
        """Scale at which two labels are clear of each other along one axis; infinite if no scale does that."""
        apart = other - one
        if abs(apart) < ROUNDING_MM:
            return 0.0 if abs(ahead) >= least else math.inf
        return max((least - math.copysign(1.0, apart) * ahead) / abs(apart), 0.0)

    return max(
        (
            min(needed(p[k], q[k], b[k] - a[k], (m[k] + n[k]) / 2) for k in (0, 1))
            for (p, a, m), (q, b, n) in combinations(boxes, 2)
        ),
        default=0.0,
    )


def _own_label(sheet: Sheet, one: Connection, side: Point) -> Iterator[Element]:
    """Name, pin and position of a part on the floor: around its symbol, or at one side of it."""
    colour = EMITTER_COLOUR if one.part.kind == "emitter" else RECEIVER_COLOUR
    x, y = sheet.at(*one.part.position_mm[:2])
    quiet = [(line, NOTE_PX, {"fill": QUIET_COLOUR}) for line in one.part.place_lines]
    lines = [
        (one.part.name, NAME_PX, {"fill": colour, "font_weight": "bold"}),
        (one.pin, PIN_PX, {"fill": colour}),
        *quiet,
    ]
    clear = SYMBOL_PX + LABEL_START_PX
    levels = [k * FLOOR_LINE_PX for k in range(len(lines))]
    anchor = "middle"
    if side[0]:
        x, anchor = x + side[0] * clear, "start" if side[0] > 0.0 else "end"
        levels = [y + level - 0.35 * levels[-1] for level in levels]
    elif side[1]:
        first = y - clear - levels[-1] if side[1] > 0.0 else y + clear + 0.6 * FLOOR_LINE_PX
        levels = [first + level for level in levels]
    else:
        levels = [y - clear - LINE_PX, y - clear, *(y + clear + level for level in levels[: len(quiet)])]
        levels[2:] = [level + 0.4 * FLOOR_LINE_PX for level in levels[2:]]
    for level, (content, size, style) in zip(levels, lines, strict=True):
        # a white border keeps the text legible on the lines of bodies
        border = {"stroke": POCKET_COLOUR, "stroke_width": "4", "paint_order": "stroke"}
        yield svg.text((x, level), content, size, anchor=anchor, **border, **style)


def _in_socket(sheet: Sheet, one: Connection, socket: Socket) -> Element:
    part, frame, half = one.part, socket.frame, one.part.part.body_width_mm.value / 2
    is_emitter = part.kind == "emitter"
    colour = EMITTER_COLOUR if is_emitter else RECEIVER_COLOUR
    shapes = svg.group(_told(one))
    pocket, depth = socket.pocket, part.part.body_depth_mm.value

    def place(along_mm: float, outward_mm: float) -> Point:
        return sheet.at(*frame.point(along_mm, outward_mm))

    def box(along0: float, along1: float, out0: float, out1: float, **style: str) -> Element:
        ends = ((along0, out0), (along1, out0), (along1, out1), (along0, out1))
        return svg.outline([place(*end) for end in ends], **style)

    shapes.append(box(pocket.along0, pocket.along1, pocket.out0, pocket.out1, fill=POCKET_COLOUR))
    body = (part.along_mm - half, part.along_mm + half, 0.0, depth)
    shapes.append(box(*body, fill=POCKET_COLOUR, stroke=colour, stroke_width="1.5"))
    face = [place(part.along_mm - part.half_width_mm, 0), place(part.along_mm + part.half_width_mm, 0)]
    shapes.append(svg.polyline(face, stroke=colour, stroke_width="5"))
    radius = min(SYMBOL_PX, 0.4 * min(depth, 2 * half) * sheet.scale)
    centre, inward = place(part.along_mm, depth / 2), (one.normal[0], -one.normal[1])
    if is_emitter:
        shapes.append(svg.triangle(centre, inward, radius, fill=colour))
    else:
        shapes.append(svg.circle(centre, radius, fill="none", stroke=colour, stroke_width="3"))
    return shapes


def _told(one: Connection) -> str:
    return f"{one.part.kind} {one.part.name}: {one.pin}, {one.part.place_words}"


def _labels(
    sheet: Sheet, wall: Wall, connections: Sequence[Connection], sockets: dict[str, Socket]
) -> Iterator[Element]:
    is_side = wall in ("east", "west")
    axis = 1 if is_side else 0
    anchors = {
        one.part.name: sheet.at(
            *sockets[one.part.name].frame.point(one.part.along_mm, sockets[one.part.name].pocket.out1)
        )
        for one in connections
    }
    row = sorted(connections, key=lambda one: anchors[one.part.name][axis])
    low, high = sorted((sheet.low_corner[axis], sheet.high_corner[axis]))
    gap = SIDE_PITCH_PX if is_side else sheet.pitch
    places = spread([anchors[one.part.name][axis] for one in row], gap, low + gap / 2, high - gap / 2)
    for one, place in zip(row, places, strict=True):
        yield from _label(sheet, one, anchors[one.part.name], place)


def _label(sheet: Sheet, one: Connection, anchor: Point, place: float) -> Iterator[Element]:
    colour = EMITTER_COLOUR if one.part.kind == "emitter" else RECEIVER_COLOUR
    (x0, y0), (x1, y1) = sheet.low_corner, sheet.high_corner
    end, knee = {
        "south": ((place, y0 + LEADER_PX), (place, y0)),
        "north": ((place, y1 - LEADER_PX), (place, y1)),
        "east": ((x1 + LEADER_PX, place), (x1, place)),
        "west": ((x0 - LEADER_PX, place), (x0, place)),
    }[_side(one)]
    yield svg.polyline([anchor, knee, end], stroke=QUIET_COLOUR)
    (place_line,) = one.part.place_lines
    lines = ((one.part.name, NAME_PX, "bold"), (one.pin, PIN_PX, "normal"), (place_line, NOTE_PX, ""))
    for (content, size, weight), (at, side) in zip(lines, _line_places(sheet, one, end), strict=True):
        fill = QUIET_COLOUR if weight == "" else colour
        yield svg.text(at, content, size, anchor=side, fill=fill, font_weight=weight or "normal")


def _line_places(sheet: Sheet, one: Connection, end: Point) -> list[tuple[Point, str]]:
    """For each line of a label (name, pin, position): its point on the sheet [px] and the text anchor there."""
    x, y = end
    match _side(one):
        case "south":
            return [((x, y + (k + 0.85) * LINE_PX), "middle") for k in range(LABEL_LINES)]
        case "north":
            return [((x, y - 6 - (LABEL_LINES - 1 - k) * LINE_PX), "middle") for k in range(LABEL_LINES)]
    sign, side = (1, "start") if _side(one) == "east" else (-1, "end")
    return [((x + sign * step, y + PIN_PX * 0.35), side) for step in sheet.columns]
