"""A circuit board as plain data: outline, holes, parts with their nets, tracks and vias.

Positions are in the cavity's coordinate system [mm]: x to the right and y upward, seen from the parts' side. Angles are
counter-clockwise.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from optopad.design.shape.outline import Point

TRACK_MM = 0.2
CLEARANCE_MM = 0.2
VIA_MM = 0.6
VIA_DRILL_MM = 0.3
EDGE_MM = 0.3
"""Least distance of copper from the board's edge [mm]."""
HOLE_MM = 0.3
"""Least distance of copper from a hole without copper [mm]."""
TOP, BOTTOM = 0, 1
"""Copper layers."""
GROUND = "GND"


@dataclass(frozen=True, kw_only=True)
class Pad:
    """A pad of a footprint, at its position on the board.

    Attributes
    ----------
    number, net : name of the pad, and of its net; "" if it is not connected
    x, y, angle_deg : middle and direction
    width, height : size along the pad's own axes
    is_round : whether it is a circle of this width
    drill_mm : diameter of its hole; 0 for a pad on the top alone
    """

    number: str
    net: str
    x: float
    y: float
    width: float
    height: float
    angle_deg: float = 0.0
    is_round: bool = False
    drill_mm: float = 0.0

    @property
    def layers(self) -> tuple[int, ...]:
        """Copper layers of the pad."""
        return (TOP, BOTTOM) if self.drill_mm else (TOP,)

    @property
    def corners(self) -> tuple[Point, ...]:
        """Corners of the pad's rectangle, counter-clockwise."""
        return rectangle((self.x, self.y), (self.width, self.height), self.angle_deg)


@dataclass(frozen=True, kw_only=True)
class Label:
    """A text on the board: its middle, and the height of its capitals."""

    text: str
    x: float
    y: float
    height_mm: float = 0.8


@dataclass(frozen=True, kw_only=True)
class Footprint:
    """A part on the board's top side.

    Attributes
    ----------
    reference, value : name and value, such as RS1 and 150 ohm
    package : name of the package, such as SOIC-14
    library : name of the same footprint in KiCad's library; "" if it has none
    x, y, angle_deg : position and direction of the package
    pads : pads at their positions on the board
    body : width and height of the body, along the package's axes
    part_number : what to order; "" if unknown
    is_placed : whether the part itself is on the board; otherwise only its wires or leads are
    note : what to know of it, such as an assumption
    """

    reference: str
    value: str
    package: str
    library: str = ""
    x: float
    y: float
    angle_deg: float = 0.0
    pads: tuple[Pad, ...]
    body: tuple[float, float]
    part_number: str = ""
    is_placed: bool = True
    note: str = ""

    @property
    def body_corners(self) -> tuple[Point, ...]:
        """Corners of the body's rectangle, counter-clockwise."""
        return rectangle((self.x, self.y), self.body, self.angle_deg)


@dataclass(frozen=True, kw_only=True)
class Track:
    """A straight piece of copper on one layer."""

    net: str
    start: Point
    end: Point
    layer: int


@dataclass(frozen=True, kw_only=True)
class Via:
    """A plated hole between the layers."""

    net: str
    x: float
    y: float


@dataclass(frozen=True, kw_only=True)
class BoardHole:
    """A round hole without copper, for a screw or pin."""

    x: float
    y: float
    diameter_mm: float


@dataclass(frozen=True, kw_only=True)
class Unrouted:
    """A connection without a track: its net, and the two pads, such as A1-4."""

    net: str
    start: str
    end: str


@dataclass(frozen=True, kw_only=True)
class Board:
    """A board with everything on it.

    Attributes
    ----------
    name : name of the design
    title : text printed on the board
    kind : `carrier` under a mold, or `floor` with the optical parts on it
    box : lower left and upper right corner: x0, y0, x1, y1
    lines : lines printed on the top: closed polygons of the pad and of the mold
    pours : rectangles of the ground pour by layer: x0, y0, x1, y1
    unrouted : connections that have no track
    notes : assumptions and warnings about the board, in words
    """

    name: str
    title: str
    kind: str
    box: tuple[float, float, float, float]
    holes: tuple[BoardHole, ...]
    footprints: tuple[Footprint, ...]
    lines: tuple[tuple[Point, ...], ...]
    labels: tuple[Label, ...]
    tracks: tuple[Track, ...] = ()
    vias: tuple[Via, ...] = ()
    pours: tuple[tuple[tuple[Point, ...], ...], ...] = ((), ())
    unrouted: tuple[Unrouted, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def pads(self) -> Iterator[tuple[Footprint, Pad]]:
        """All pads with their footprints."""
        return ((one, pad) for one in self.footprints for pad in one.pads)

    @property
    def nets(self) -> Mapping[str, tuple[str, ...]]:
        """Pads of each net, such as A1-4, by the net's name."""
        found: dict[str, list[str]] = {}
        for one, pad in self.pads:
            if pad.net:
                found.setdefault(pad.net, []).append(f"{one.reference}-{pad.number}")
        return {net: tuple(found[net]) for net in sorted(found)}


def rectangle(middle: Point, size: tuple[float, float], angle_deg: float) -> tuple[Point, ...]:
    """Corners of a turned rectangle, counter-clockwise."""
    x, y = size[0] / 2, size[1] / 2
    return tuple(moved(end, middle, angle_deg) for end in ((-x, -y), (x, -y), (x, y), (-x, y)))


def moved(point: Point, by: Point, angle_deg: float) -> Point:
    """A point that is turned about the origin, then moved; exact at multiples of 90 degrees."""
    quarter, rest = divmod(angle_deg % 360.0, 90.0)
    x, y = point
    if rest:
        cosine, sine = math.cos(math.radians(rest)), math.sin(math.radians(rest))
        x, y = cosine * x - sine * y, sine * x + cosine * y
    for _ in range(int(quarter)):
        x, y = -y, x
    return x + by[0], y + by[1]
