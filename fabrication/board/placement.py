"""Places the parts of a design's board.

    +---------------------------------------------------+
    |  mold, with the optical  | amplifiers | chips and  o
    |  parts at their places:  | with RF    | switches  J1
    |  wires or leads down     | and CF     | of LEDs    |
    |  into the board          |            |            o
    +---------------------------------------------------+

Chips that switch LEDs, and their transistors, are left of the mold. All parts are on the top. The mold's fixing holes
go through the board. Parts of a group are next to each other; groups fill columns, and the header to the
microcontroller board is at the right edge, between two holes. The first pad of every part is on the router's raster,
so that pads at a pitch of 0.5 mm can be reached.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from optopad.design.circuit.circuit import Circuit
from optopad.design.mold.outline import MoldOutline, outline_of
from optopad.design.shape.cavity import outline_mm
from optopad.design.shape.outline import Point
from optopad.design.spec import SensorDesign
from optopad.fabrication.board.lettering import text_width_mm
from optopad.fabrication.board.model import GROUND, Board, BoardHole, Footprint, Label, moved
from optopad.fabrication.board.netlist import QUAD_PINS, Component, Group, Netlist, netlist_of
from optopad.fabrication.board.packages import (
    HEADER_PITCH_MM,
    WIRES,
    board_data,
    coupler,
    floor_part,
    packaged,
    pin_header,
    wall_part,
)
from optopad.fabrication.board.router import RASTER_MM
from optopad.fabrication.gain import SimulatedGain

MARGIN_MM = 1.5
"""From pads, labels and the mold to the board's edge [mm]."""
GAP_MM = 6.0
"""Between columns of parts [mm]."""
BLOCK_GAP_MM = 1.5
"""Between groups in a column [mm]."""
LEAST_HEIGHT_MM = 30.0
HOLE_DIAMETER_MM = 3.2
"""Holes at the right edge, for M3 screws."""
HOLE_INSET_MM = 4.0
HEADER_LABEL_MM = 4.5
"""Width of the names on each side of the header [mm]."""
NAME_MM, PRINT_GAP_MM = 0.8, 0.15
"""Height of an optical part's name, and its distance from pads [mm]."""
MANY_PADS = 8
"""Parts with more pads are chips, whose names are printed."""
NOTE_OF_LAYER = "The parts look into clear silicone: order a black solder mask, which reflects least."


@dataclass(frozen=True, kw_only=True)
class _Block:
    """Parts of a group around the point (0, 0), and their extent to the left, right, below and above it."""

    parts: tuple[tuple[Component, Point, float], ...]
    box: tuple[float, float, float, float]

    def turned(self) -> _Block:
        """The block turned by half a turn."""
        x0, y0, x1, y1 = self.box
        parts = tuple((one, (-x, -y), (angle + 180.0) % 360.0) for one, (x, y), angle in self.parts)
        return _Block(parts=parts, box=(-x1, -y1, -x0, -y0))

    @property
    def width(self) -> float:
        return self.box[2] - self.box[0]

    @property
    def height(self) -> float:
        return self.box[3] - self.box[1] + BLOCK_GAP_MM


def placed(design: SensorDesign, gain: SimulatedGain | None = None) -> Board:
    """The board with all parts, without tracks.

    Raises
    ------
    DesignError : a chip's package is not known, or the microcontroller board lacks a pin.
    """
    circuit = Circuit.of(design)
    netlist, mold = netlist_of(circuit, gain), outline_of(design)
    optical = tuple(_optical(circuit, netlist, mold))
    centre = mold.plan.centre_mm
    names = list[Label]()
    for one in optical:
        names += _near(one, optical) if one.is_placed else _names(one, centre, names)
    pad = _around([*_corners(optical), *((one.x, one.y) for one in names), *_mold_lines(mold)[1]])
    heights = _heights(optical)
    least = max(pad[3] - pad[1], LEAST_HEIGHT_MM, _header_mm(netlist))
    # Emitters with chips need few lines to the header, so their circuit is on the other side of the pad.
    on_left = [one for one in netlist.groups if one.of_emitters and circuit.emitter_chips]
    to_left = _columns(sorted(on_left, key=lambda one: one.kind == "chip"), heights, least, is_left=True)
    to_right = _columns([one for one in netlist.groups if one not in on_left], heights, least)
    tall = max([least, *(_height(column) for column in (*to_left, *to_right))])
    middle = (pad[1] + pad[3]) / 2
    box_y = _snapped(middle - tall / 2 - MARGIN_MM), _snapped(middle + tall / 2 + MARGIN_MM)
    parts, x, left = list(optical), pad[2] + GAP_MM, pad[0]
    for column in to_right:
        parts += _stacked(column, x, middle)
        x += _width(column) + GAP_MM
    for column in to_left:
        left -= GAP_MM + _width(column)
        parts += _stacked(column, left, middle)
    header_x = x + HEADER_LABEL_MM + HEADER_PITCH_MM / 2
    header = pin_header(netlist.header, (_snapped(header_x) + RASTER_MM / 2, _snapped(middle)))
    right = _snapped(header_x + HEADER_PITCH_MM / 2 + HEADER_LABEL_MM + MARGIN_MM)
    box = _snapped(left - MARGIN_MM), box_y[0], right, box_y[1]
    holes = [
        *(BoardHole(x=one.x, y=one.y, diameter_mm=round(2 * one.radius, 3)) for one in mold.fixing_holes),
        *(
            BoardHole(x=header.x, y=y, diameter_mm=HOLE_DIAMETER_MM)
            for y in (box[1] + HOLE_INSET_MM, box[3] - HOLE_INSET_MM)
        ),
    ]
    chips = [one for one in parts if len(one.pads) > MANY_PADS]
    cavity = circuit.cavity
    is_floor = bool(cavity.on_floor)
    notes = dict.fromkeys(one.note for one in parts if one.note)
    wired = zip((*netlist.emitters, *netlist.receivers), cavity.parts, strict=True)
    notes |= dict.fromkeys(
        f"{its.reference} is {part.name}" for its, part in wired if its.reference != part.name
    )
    return Board(
        name=design.name,
        title=f"{design.name} {design.digest[:8]}",
        kind="floor" if is_floor else "carrier",
        box=box,
        holes=tuple(holes),
        footprints=(*parts, header),
        lines=(*_mold_lines(mold), *(line for one in chips for line in _chip_lines(one))),
        labels=(*names, *_labels(parts[len(optical) :], header, design, centre, is_floor=is_floor)),
        notes=(*([NOTE_OF_LAYER] if is_floor else []), *notes),
    )


def _snapped(value: float) -> float:
    return round(value / RASTER_MM) * RASTER_MM


def _optical(circuit: Circuit, netlist: Netlist, mold: MoldOutline) -> Iterator[Footprint]:
    frames = {socket.part.name: socket.frame for socket in mold.sockets}
    cavity, halves = circuit.cavity, dict[str, Footprint]()
    for parts, nets in ((cavity.emitters, netlist.emitters), (cavity.receivers, netlist.receivers)):
        for part, its in zip(parts, nets, strict=True):
            name, anode, cathode = its.reference, its.anode, its.cathode
            if not part.is_on_floor:
                yield wall_part(part, frames[part.name], name, anode, cathode)
                continue
            one = floor_part(part, name, anode, cathode)
            if part.coupler is None:
                yield one
            elif part.coupler in halves:
                yield coupler(part.coupler, halves[part.coupler], one)
            else:
                halves[part.coupler] = one


def _corners(parts: Sequence[Footprint]) -> list[Point]:
    """Corners of all pads."""
    return [corner for one in parts for pad in one.pads for corner in pad.corners]


def _around(points: Sequence[Point]) -> tuple[float, float, float, float]:
    xs, ys = zip(*points, strict=True)
    return min(xs), min(ys), max(xs), max(ys)


def _mold_lines(mold: MoldOutline) -> tuple[tuple[Point, ...], tuple[Point, ...]]:
    """Outlines of the pad and of the mold."""
    inner, outer = outline_mm(mold.plan), mold.outer.points(0.1)
    as_points = [tuple((float(x), float(y)) for x, y in (*line, line[0])) for line in (inner, outer)]
    return as_points[0], as_points[1]


def _part(one: Component, at: Point, angle: float) -> Footprint:
    """A part whose first pad is on the raster."""
    first = packaged(one.package, one.reference, one.value, one.nets, at, angle).pads[0]
    on = at[0] + _snapped(first.x) - first.x, at[1] + _snapped(first.y) - first.y
    return packaged(one.package, one.reference, one.value, one.nets, on, angle, part_number=one.part_number)


def _header_mm(netlist: Netlist) -> float:
    return (len(netlist.header) + 1) // 2 * HEADER_PITCH_MM + 4 * HOLE_INSET_MM


def _height(column: Sequence[_Block]) -> float:
    return sum(block.height for block in column)


def _width(column: Sequence[_Block]) -> float:
    return max(block.width for block in column)


def _heights(optical: Sequence[Footprint]) -> dict[str, float]:
    """Mean y of the optical parts' pads on each net, without ground."""
    found: dict[str, list[float]] = {}
    for one in optical:
        for pad in one.pads:
            found.setdefault(pad.net, []).append(pad.y)
    return {net: sum(ys) / len(ys) for net, ys in found.items() if net != GROUND}


def _columns(
    groups: Sequence[Group], heights: Mapping[str, float], least_mm: float, *, is_left: bool = False
) -> list[list[_Block]]:
    """Blocks in columns, the nearest to the pad first: amplifiers, then the rest. Many make a square, not a strip.

    Within a column, blocks are in the order of the optical parts that they are connected to, the highest first.
    """
    make = {"amplifier": _amplifier_block, "chip": _chip_block, "switch": _switch_block}
    blocks = [make[group.kind](group) for group in groups]
    most_mm = max(least_mm, math.sqrt(sum((block.width + GAP_MM) * block.height for block in blocks)))
    columns: list[list[tuple[float, _Block]]] = []
    last = ""
    for group, block in zip(groups, blocks, strict=True):
        is_new = group.kind != last and "amplifier" in (group.kind, last)
        if not columns or is_new or _height([one for _, one in columns[-1]]) + block.height > most_mm:
            columns.append([])
        at = [heights[net] for one in group.parts for net in one.nets.values() if net in heights]
        columns[-1].append((sum(at) / len(at) if at else -math.inf, block.turned() if is_left else block))
        last = group.kind
    return [[block for _, block in sorted(column, key=lambda one: -one[0])] for column in columns]


def _stacked(column: Sequence[_Block], x: float, middle: float) -> Iterator[Footprint]:
    """The parts of a column from its left end, centred at a height."""
    y = middle + _height(column) / 2
    for block in column:
        at = x + _width(column) / 2 - (block.box[0] + block.box[2]) / 2, y - block.box[3] - BLOCK_GAP_MM / 2
        yield from (_part(one, moved(place, at, 0.0), angle) for one, place, angle in block.parts)
        y -= block.height


def _amplifier_block(group: Group) -> _Block:
    chip, supply, *feedback = group.parts
    parts = [(chip, (0.0, 0.0), 0.0), (supply, (-5.5, 0.0), 90.0)]
    outputs = [chip.nets[str(out)] for out, _, _ in QUAD_PINS]
    for pair in zip(feedback[::2], feedback[1::2], strict=True):
        k = outputs.index(pair[0].nets["1"])
        side, is_up = (1.0 if k % 2 else -1.0), k < 2
        for one, out in zip(pair, (5.5, 7.5), strict=True):
            # The first pad is on the output, which is outside of the inverting input.
            parts.append((one, (side * out, 3.175 if is_up else -3.175), 270.0 if is_up else 90.0))
    return _Block(parts=tuple(parts), box=(-8.5, -5.5, 8.5, 5.5))


def _chip_block(group: Group) -> _Block:
    chip, *small = group.parts
    package = board_data()["rows"][chip.package]
    half_x = package["row"] + package["pad"][0] / 2 + 2.0
    half_y = package["body"][1] / 2 + 0.8
    parts = [(chip, (0.0, 0.0), 0.0)]
    each_row = max(int(2 * half_x // 3.5), 1)
    for k, one in enumerate(small):
        row, place = divmod(k, each_row)
        count = min(len(small) - row * each_row, each_row)
        parts.append((one, ((place - (count - 1) / 2) * 3.5, half_y + 1.0 + 1.8 * row), 0.0))
    rows = -(-len(small) // each_row)
    return _Block(parts=tuple(parts), box=(-half_x, -half_y - 0.7, half_x, half_y + 0.9 + 1.8 * rows))


def _switch_block(group: Group) -> _Block:
    transistor, series, base = group.parts
    wide, high = board_data()["pads"][series.package]["body"]
    out = 2.2 + wide / 2 + 0.6
    return _Block(
        parts=(
            (transistor, (0.0, 0.0), 180.0),
            (series, (-out, 0.95 + (high - 0.825) / 2), 180.0),
            (base, (3.75, -0.95), 0.0),
        ),
        box=(-out - wide / 2 - 0.7, -1.75, 5.4, 1.75 + max(high - 0.825, 0.0)),
    )


def _near(one: Footprint, optical: Sequence[Footprint]) -> Iterator[Label]:
    """Name of a part on the board on the first of its sides where no pad is; left out if there is none."""
    x0, y0, x1, y1 = _around([*one.body_corners, *_corners([one])])
    half_x, half_y = text_width_mm(one.reference, NAME_MM) / 2, NAME_MM / 2
    side_x, side_y = half_x + 0.3, half_y + 0.3
    middle = (x0 + x1) / 2, (y0 + y1) / 2
    for x, y in (
        (middle[0], y0 - side_y),
        (middle[0], y1 + side_y),
        (x1 + side_x, middle[1]),
        (x0 - side_x, middle[1]),
    ):
        boxes = (_around(pad.corners) for part in optical for pad in part.pads)
        gaps = (max(a - x - half_x, x - half_x - c, b - y - half_y, y - half_y - d) for a, b, c, d in boxes)
        if min(gaps) > PRINT_GAP_MM:
            yield Label(text=one.reference, x=x, y=y, height_mm=NAME_MM)
            return


def _names(one: Footprint, centre: Point, others: Sequence[Label]) -> list[Label]:
    """Name of a part in a wall: inside the pad above its leads, or outside its wires with their polarity.

    It is farther outside where other names are in the way.
    """
    away = one.x - centre[0], one.y - centre[1]
    far = max((away[0] ** 2 + away[1] ** 2) ** 0.5, 1e-6)
    along, across = one.pads[-1].x - one.pads[0].x, one.pads[-1].y - one.pads[0].y
    length = (along**2 + across**2) ** 0.5
    outward = across / length, -along / length
    if outward[0] * away[0] + outward[1] * away[1] < 0:
        outward = -outward[0], -outward[1]
    if one.package != WIRES:
        return [Label(text=one.reference, x=one.x - 4.0 * away[0] / far, y=one.y - 4.0 * away[1] / far)]
    ends = [
        Label(text=pad.number, x=pad.x + 1.5 * outward[0], y=pad.y + 1.5 * outward[1]) for pad in one.pads
    ]
    reach = abs(outward[0]) * text_width_mm(one.reference, NAME_MM) / 2 + abs(outward[1]) * NAME_MM / 2
    tries = [
        Label(text=one.reference, x=one.x + out * outward[0], y=one.y + out * outward[1])
        for out in (2.2 + reach, 3.4 + reach, 4.6 + reach)
    ]
    return [
        *ends,
        next((label for label in tries if not any(_meet(label, other) for other in others)), tries[-1]),
    ]


def _meet(one: Label, other: Label) -> bool:
    """Whether two texts overlap."""
    half = (text_width_mm(one.text, one.height_mm) + text_width_mm(other.text, other.height_mm)) / 2
    return (
        abs(one.x - other.x) < half + 0.2
        and abs(one.y - other.y) < (one.height_mm + other.height_mm) / 2 + 0.2
    )


def _labels(
    others: Sequence[Footprint], header: Footprint, design: SensorDesign, centre: Point, *, is_floor: bool
) -> Iterator[Label]:
    """Names of the chips, of the header's pins, and of the design."""
    for one in others:
        if len(one.pads) > MANY_PADS:
            in_middle = one.pads[-1].x == one.x
            yield Label(text=one.reference, x=one.x, y=one.y + (one.body[1] / 2 - 1.5 if in_middle else 0.0))
    for k, pad in enumerate(header.pads):
        out = HEADER_PITCH_MM / 2 + 0.1 + text_width_mm(pad.net, 0.8) / 2
        yield Label(text=pad.net, x=pad.x + (out if k % 2 else -out), y=pad.y)
    lines = (design.name, design.digest[:8])
    if is_floor:  # under the mold's wall
        yield Label(
            text=" ".join(lines), x=centre[0], y=(design.cavity.width_mm - design.mold.outer_width_mm) / 4
        )
    else:
        yield from (
            Label(text=line, x=centre[0], y=centre[1] + 1.0 - 2.0 * k) for k, line in enumerate(lines)
        )


def _chip_lines(one: Footprint) -> Iterator[tuple[Point, ...]]:
    """Lines above and below a chip's body; the upper one reaches over the first pad."""
    half_x, half_y = one.body[0] / 2, one.body[1] / 2 + 0.15
    first = moved((one.pads[0].x - one.x, one.pads[0].y - one.y), (0.0, 0.0), -one.angle_deg)
    reach = first[0] - one.pads[0].width / 2
    yield tuple(moved(end, (one.x, one.y), one.angle_deg) for end in ((reach, half_y), (half_x, half_y)))
    yield tuple(moved(end, (one.x, one.y), one.angle_deg) for end in ((-half_x, -half_y), (half_x, -half_y)))
