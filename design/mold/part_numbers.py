r"""Names of the optical parts, such as E1, engraved in the outer faces of the mold below their sockets.

    outer face, seen from outside            small letters of 3 x 5 points; upright where a name is wider
      | | |   | |       | | |                than its space on the wall, read from below
      |_|_|___|_|_______|_|_|   pockets
         E1      R1        E2   numbers
      ____________n_____________  channels, bed

The space for a name extends halfway to the neighbouring parts, within the inner length of the wall. It is above the
lead channels and above the joint of a parted mold, and below the lowest pocket of the wall. On a round wall every part
has its own facet. There the space is above all channels and below all pockets of the mold. It also ends where the outer
face has receded from the facet's plane by half of the name's depth. Names that do not fit are left out and reported
(`optopad.cad.checks`).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache

from optopad.design.fields.packaged import data_table
from optopad.design.mold.lettering import OVERLAP, Point, Stroke, strokes_of, upper_edges_mm
from optopad.design.mold.sockets import Hole, Socket, WallFrame

DEPTH_MM = 0.5
"""Depth of the strokes: deeper than the layer steps and seams of a print, and shallow enough to bridge."""
MARGIN_MM = 0.4
"""Margin around a name: the width of a nozzle."""
SMALLEST_PITCH_MM, LARGEST_PITCH_MM = 0.6, 0.9
"""Smallest and largest pitch of the points of letters.

The smallest gives strokes of 0.75 mm with gaps of 0.45 mm, which a 0.4 mm nozzle still separates. The largest gives
strokes of 1.1 mm.
"""
COLUMNS, ROWS, GAP = 3, 5, 1


@dataclass(frozen=True, kw_only=True)
class PartNumber:
    """The name of an optical part as rectangles to cut into the mold.

    Attributes
    ----------
    name : name of the part
    frame : coordinate system of the wall in whose outer face the name is engraved
    strokes : rectangles; x along the wall, y upward [mm]
    stroke_mm : width of a stroke
    """

    name: str
    frame: WallFrame
    strokes: tuple[Stroke, ...]
    stroke_mm: float

    @property
    def ceiling_mm2(self) -> float:
        """Area of the ceilings of the strokes, which the printer bridges over half a millimetre [mm2]."""
        return upper_edges_mm(self.strokes) * DEPTH_MM


def part_numbers(
    sockets: Sequence[Socket],
    fixing_holes: Sequence[Hole],
    bottom_mm: float,
    web_mm: float,
    around: Sequence[Socket] = (),
) -> tuple[PartNumber, ...]:
    """Engraved names of the parts in one wall, in their order along it; names without enough space are left out.

    Parameters
    ----------
    sockets : sockets of one wall, in their order along it
    around : all sockets of a mold with round walls; empty for a rectangular mold
    fixing_holes : fixing holes of the mold
    bottom_mm : height z of the mold's underside; if the mold is parted, that of its upper piece
    web_mm : thinnest wall that can be printed
    """
    if not sockets:
        return ()
    beside = around or sockets
    low = max([bottom_mm, *(one.channel.top for one in beside if one.channel)]) + MARGIN_MM
    high = min(one.pocket.floor for one in beside) - MARGIN_MM
    found = []
    for place, socket in enumerate(sockets):
        room = _room_around_mm(socket, around) if socket.frame.is_facet else _room_mm(sockets, place)
        if _wall_left_mm(socket, fixing_holes, room) < web_mm:
            continue
        number = _number(socket, room, (low, high))
        if number is not None:
            found.append(number)
    return tuple(found)


def _room_mm(sockets: Sequence[Socket], place: int) -> tuple[float, float]:
    """Range along the wall for the name of the socket with index `place` [mm]."""
    at, frame = sockets[place].part.along_mm, sockets[place].frame
    before = (sockets[place - 1].part.along_mm + at) / 2 if place > 0 else 0.0
    after = (sockets[place + 1].part.along_mm + at) / 2 if place + 1 < len(sockets) else frame.length_mm
    half = min(at - before, after - at) - MARGIN_MM / 2
    return at - half, at + half


def _room_around_mm(socket: Socket, around: Sequence[Socket]) -> tuple[float, float]:
    """Range along a round outer face for a socket's name [mm]; it ends halfway to the nearest other part."""
    (x, y), radius = socket.frame.line.outward, socket.frame.outer_radius_mm
    others = [one.frame.line.outward for one in around if one is not socket]
    gap = min((math.acos(max(-1.0, min(1.0, x * ox + y * oy))) for ox, oy in others), default=math.pi)
    to_next = (radius - DEPTH_MM) * math.tan(min(gap, math.pi / 2) / 2) - MARGIN_MM / 2
    half = min(to_next, math.sqrt(radius * DEPTH_MM - DEPTH_MM**2 / 4))
    return socket.part.along_mm - half, socket.part.along_mm + half


def _wall_left_mm(socket: Socket, fixing_holes: Sequence[Hole], room: tuple[float, float]) -> float:
    """Least thickness of material behind a name, to the cavity, lead holes and fixing holes [mm]."""
    frame = socket.frame
    left = [frame.thickness_mm - DEPTH_MM]
    for hole in (*socket.holes, *fixing_holes):
        along, outward = frame.along_and_outward_mm(hole.x, hole.y)
        if outward > 0 and room[0] - hole.radius < along < room[1] + hole.radius:
            left.append(frame.thickness_mm - outward - hole.radius - DEPTH_MM)
    return min(left)


def _number(socket: Socket, room: tuple[float, float], levels: tuple[float, float]) -> PartNumber | None:
    """A horizontal name if that is legible, else an upright one; None if neither is legible."""
    name = socket.part.name
    points = _points(name.upper())
    wide = len(name) * (COLUMNS + GAP) - GAP + OVERLAP - 1.0
    high = ROWS + OVERLAP - 1.0
    across, upward = room[1] - room[0], levels[1] - levels[0]
    level = min(across / wide, upward / high, LARGEST_PITCH_MM)
    upright = min(across / high, upward / wide, LARGEST_PITCH_MM)
    pitch = level if level >= SMALLEST_PITCH_MM else upright
    if pitch < SMALLEST_PITCH_MM:
        return None
    if pitch is upright and level < SMALLEST_PITCH_MM:
        points = {(row, -column) for column, row in points}  # a quarter turn: upright, read from below
        points = {(x, y - min(y for _, y in points)) for x, y in points}
        wide, high = high, wide
    mirrored = socket.frame.wall in ("north", "west")
    shift = -wide / 2 * pitch if not mirrored else wide / 2 * pitch
    place = socket.part.along_mm + shift, sum(levels) / 2 + high / 2 * pitch
    strokes = tuple(strokes_of(points, place, pitch, mirrored=mirrored))
    return PartNumber(name=name, frame=socket.frame, strokes=strokes, stroke_mm=OVERLAP * pitch)


def _points(text: str) -> set[Point]:
    return {
        (place * (COLUMNS + GAP) + column, row)
        for place, letter in enumerate(text)
        for row, bits in enumerate(small_letters()[letter])
        for column, bit in enumerate(bits)
        if bit == "1"
    }


def unnumbered(names: Sequence[str], numbers: Sequence[PartNumber]) -> Iterator[str]:
    """Names of parts that do not fit and are therefore not engraved on the mold."""
    there = {one.name for one in numbers}
    return (name for name in names if name not in there)


@cache
def small_letters() -> dict[str, tuple[str, ...]]:
    """Rows of points of every letter that can occur in a name."""
    return {name: tuple(rows.split()) for name, rows in data_table("small_letters.toml").items()}
