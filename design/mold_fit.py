"""Do the fixing holes of the mold miss everything else? Distances in plan, in closed form.

Four round holes stand in the corners, each `fixing_hole_inset_mm` from both outer faces. The mold is
symmetric, but the parts need not be, so every hole is held against every socket. A surface part's
wires leave outward through slots behind the socket, at their pitch where that leaves webs between
them and fits behind the body, else close together through one; both are taken as one slot.

Left out: the pour lip, and the rounding of the outer edges.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

from design.cavity import CavityGeometry, PlacedPart
from design.finding import Finding, error, mm
from design.layout import Wall
from design.spec import Mold, SensorDesign
from design.wall_fit import ROUNDING_MM, socket_of, wall_thickness_mm

HOLE_WAY_OUT = (
    "change mold.fixing_hole_inset_mm or mold.fixing_hole_diameter_mm (0 for none), or move the part"
)


@dataclass(frozen=True, kw_only=True)
class Rectangle:
    """A rectangle in plan, in the cavity frame [mm]."""

    x0_mm: float
    x1_mm: float
    y0_mm: float
    y1_mm: float

    def distance_mm(self, x_mm: float, y_mm: float) -> float:
        """Distance of a point from the rectangle; negative inside [mm]."""
        dx = max(self.x0_mm - x_mm, x_mm - self.x1_mm)
        dy = max(self.y0_mm - y_mm, y_mm - self.y1_mm)
        return math.hypot(max(dx, 0.0), max(dy, 0.0)) + min(max(dx, dy), 0.0)


def fixing_hole_findings(design: SensorDesign, cavity: CavityGeometry) -> Iterator[Finding]:
    """Everything that a fixing hole comes too near to."""
    diameter = design.mold.fixing_hole_diameter_mm
    if diameter == 0:
        return
    need, radius = design.mold.min_web_mm, diameter / 2
    for what, distance in _distances_mm(design, cavity):
        if distance - radius < need - ROUNDING_MM:
            yield error(
                "mold.fixing_hole_inset_mm",
                f"the web between a fixing hole and {what} is too thin",
                value=mm(distance - radius),
                limit=f"at least mold.min_web_mm = {mm(need)}",
                way_out=HOLE_WAY_OUT,
            )


def fixing_hole_centres_mm(design: SensorDesign) -> tuple[tuple[float, float], ...]:
    """Centres of the four fixing holes in the cavity frame (x, y) [mm]."""
    inset = design.mold.fixing_hole_inset_mm
    x = inset - wall_thickness_mm(design, "west")
    y = inset - wall_thickness_mm(design, "south")
    return tuple(product((x, design.cavity.length_mm - x), (y, design.cavity.width_mm - y)))


def _distances_mm(design: SensorDesign, cavity: CavityGeometry) -> Iterator[tuple[str, float]]:
    centres = fixing_hole_centres_mm(design)
    inner = Rectangle(x0_mm=0.0, x1_mm=cavity.length_mm, y0_mm=0.0, y1_mm=cavity.width_mm)
    yield "the outer face", design.mold.fixing_hole_inset_mm
    yield "the cavity", min(inner.distance_mm(*centre) for centre in centres)
    yield "the next fixing hole", _between_holes_mm(design)
    sockets = [
        (room.distance_mm(*centre), part.name)
        for part in cavity.parts
        for room in _rooms(part, design, cavity, wall_thickness_mm(design, part.wall))
        for centre in centres
    ]
    if sockets:
        nearest, name = min(sockets)
        yield f"the socket of {name}", nearest


def _between_holes_mm(design: SensorDesign) -> float:
    """Distance of a hole's centre from the edge of the next hole [mm]."""
    mold = design.mold
    outer = min(mold.outer_length_mm, mold.outer_width_mm)
    return outer - 2 * mold.fixing_hole_inset_mm - mold.fixing_hole_diameter_mm / 2


def _rooms(
    part: PlacedPart, design: SensorDesign, cavity: CavityGeometry, thickness_mm: float
) -> list[Rectangle]:
    socket = socket_of(part, design.mold)
    rooms = [_in_plan(part.wall, cavity, socket.low_mm, socket.high_mm, 0.0, socket.depth_mm)]
    if part.part.mounting == "surface":
        half = _wires_half_width_mm(part, design.mold)
        low, high = max(part.along_mm - half, socket.low_mm), min(part.along_mm + half, socket.high_mm)
        rooms.append(_in_plan(part.wall, cavity, low, high, socket.depth_mm, thickness_mm))
    return rooms


def _wires_half_width_mm(part: PlacedPart, mold: Mold) -> float:
    """Half of the width that the wires take: side by side at their pitch, or close together [mm]."""
    entry = part.part
    wire = entry.lead_diameter_mm.value + mold.lead_clearance_mm
    row = (entry.lead_count - 1) * entry.lead_pitch_mm.value
    room = entry.body_width_mm.value + 2 * mold.part_clearance_mm
    is_apart = entry.lead_pitch_mm.value - wire >= mold.min_web_mm and row <= room
    return (row + wire if is_apart else entry.lead_count * wire) / 2


def _in_plan(
    wall: Wall, cavity: CavityGeometry, low_mm: float, high_mm: float, from_mm: float, to_mm: float
) -> Rectangle:
    """A stretch of a wall, from and to a distance outward of its inner face."""
    length, width = cavity.length_mm, cavity.width_mm
    match wall:
        case "south":
            return Rectangle(x0_mm=low_mm, x1_mm=high_mm, y0_mm=-to_mm, y1_mm=-from_mm)
        case "north":
            return Rectangle(x0_mm=low_mm, x1_mm=high_mm, y0_mm=width + from_mm, y1_mm=width + to_mm)
        case "west":
            return Rectangle(x0_mm=-to_mm, x1_mm=-from_mm, y0_mm=low_mm, y1_mm=high_mm)
        case "east":
            return Rectangle(x0_mm=length + from_mm, x1_mm=length + to_mm, y0_mm=low_mm, y1_mm=high_mm)
