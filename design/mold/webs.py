"""Clearances of the mold, computed from its parameters: every wall, web and floor that must be printable.

Slicers accept files with tangent cuts, but printers fail on them, and no mesh check finds a thin wall reliably.
Distances are therefore computed here in closed form, before any CAD solid exists. A web is the wall between two cuts.
The drawing shows the wall at low y from above:

       cavity
    ---+      +---------+        +---
       |  E1  |<- web ->|   R1   |     pocket: body + clearance at each side and behind
       +------+         +--------+
             ^ web                     web >= mold.min_web_mm
    -------------------------------- outer face

Distances are horizontal, except the floor under a pocket and the rim over a body. A negative value means that two cuts
overlap. A wall of material must be at least `mold.min_web_mm` thick. A lead hole only has to be inside its pocket.
Pockets that are at least a web away from the ends of their wall cannot meet around a corner.
`optopad.design.rules.mold` explains each violated clearance to the user.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations, pairwise

from optopad.design.fields.quantity import ROUNDING_MM
from optopad.design.mold.outline import MoldOutline
from optopad.design.mold.sockets import Cut, Hole, Socket, by_wall
from optopad.design.spec import Mold
from optopad.design.spec.properties import clearance_mm

LEDGE_MM = 0.1
"""Least distance of a lead hole from the edge of its pocket's floor."""

LEDGE = "mold.cover_ledge_mm"
INSET = "mold.fixing_hole_inset_mm"
LEADS = "mold.lead_clearance_mm"


@dataclass(frozen=True, kw_only=True)
class Clearance:
    """A distance in the mold, and the least distance that is required.

    Attributes
    ----------
    name : kind of distance, such as "pocket to pocket"
    value_mm : distance in the design; negative if cuts overlap
    needed_mm : required distance
    parts : names of the optical parts, or a description of the location
    wall : name of the parts' wall; None if the location is not on one wall
    field : dotted path of the design's field that mainly determines the distance
    """

    name: str
    value_mm: float
    needed_mm: float
    parts: str
    wall: str | None = None
    field: str

    @property
    def is_kept(self) -> bool:
        """Whether the distance is at least the required one."""
        return self.value_mm >= self.needed_mm - ROUNDING_MM

    @property
    def spare_mm(self) -> float:
        """Distance minus the required distance, rounded to 1e-9 [mm]; negative if it is too small."""
        return round(self.value_mm - self.needed_mm, 9)

    @property
    def where(self) -> str:
        """The location in words."""
        return self.parts if self.wall is None else f"{self.parts} on the {self.wall} wall"


def clearances(outline: MoldOutline, mold: Mold) -> tuple[Clearance, ...]:
    """All clearances of a mold, in the order walls, fixing holes, pockets, leads."""
    web = mold.min_web_mm
    return (
        *_walls(outline, mold),
        *_between_fixing_holes(outline, web),
        *_between_pockets(outline, mold),
        *_between_facets(outline, mold),
        *(found for socket in outline.sockets for found in _of_socket(socket, outline, mold)),
    )


def rim_clearances(outline: MoldOutline) -> tuple[Clearance, ...]:
    """Distance of each part's body below the rim; a taller body is printable but in the way of the blade or lid."""
    return tuple(
        Clearance(
            name="body below rim",
            value_mm=outline.top_mm - socket.part.body_top_mm,
            needed_mm=0.0,
            parts=socket.part.name,
            wall=socket.frame.wall,
            field=socket.part.height_field,
        )
        for socket in outline.sockets
    )


def tightest(found: tuple[Clearance, ...]) -> tuple[Clearance, ...]:
    """For each kind of distance, the clearance that is nearest to its limit, in the order of first appearance."""
    worst: dict[str, Clearance] = {}
    for one in found:
        if one.name not in worst or one.spare_mm < worst[one.name].spare_mm:
            worst[one.name] = one
    return tuple(worst.values())


def bodies_above_rim(outline: MoldOutline) -> tuple[str, ...]:
    """Names of the parts whose body extends above the rim of the mold."""
    return tuple(one.parts for one in rim_clearances(outline) if not one.is_kept)


def pockets_below_clear_layer(outline: MoldOutline) -> tuple[str, ...]:
    """Names of the parts whose pocket extends below the clear layer, into the black layer or the floor."""
    return tuple(s.part.name for s in outline.sockets if s.pocket.floor < -ROUNDING_MM)


def _outside(socket: Socket, mold: Mold) -> str:
    """Name of the design's field that makes the wall of a socket thicker."""
    x, y = socket.frame.line.outward
    return mold.outside_fields[abs(y) > abs(x)]


def _walls(outline: MoldOutline, mold: Mold) -> Iterator[Clearance]:
    web, (along_x, along_y) = mold.min_web_mm, mold.outside_fields
    sides = [
        ("the east and west walls", along_x, outline.wall_x_mm),
        ("the south and north walls", along_y, outline.wall_y_mm),
    ]
    for parts, field, value in [("the walls", *sides[0][1:])] if along_x == along_y else sides:
        yield Clearance(name="wall", value_mm=value, needed_mm=web, parts=parts, field=field)
        if outline.ledge_mm:
            left = value - outline.ledge_mm
            yield Clearance(
                name="cover seat to outer face", value_mm=left, needed_mm=web, parts=parts, field=LEDGE
            )


def _between_fixing_holes(outline: MoldOutline, web: float) -> Iterator[Clearance]:
    if not outline.fixing_holes:
        return
    pairs = combinations(outline.fixing_holes, 2)
    mouth = outline.mouth
    opened = outline.plan.outline.in_box((mouth.x0, mouth.y0, mouth.x1, mouth.y1))
    for name, value in (
        ("fixing hole to outer face", min(_to_outside_mm(hole, outline) for hole in outline.fixing_holes)),
        ("fixing hole to fixing hole", min((_apart_mm(*pair) for pair in pairs), default=math.inf)),
        (
            "fixing hole to cavity",
            min(opened.outside_mm(hole.x, hole.y) - hole.radius for hole in outline.fixing_holes),
        ),
    ):
        yield Clearance(name=name, value_mm=value, needed_mm=web, parts="the corners", field=INSET)


def _between_pockets(outline: MoldOutline, mold: Mold) -> Iterator[Clearance]:
    """Clearance between neighbouring parts on each straight wall: between pockets, or between overlapping bodies."""
    web = mold.min_web_mm
    for wall, row in by_wall(tuple(one for one in outline.sockets if not one.frame.is_facet)).items():
        for low, high in pairwise(row):
            room = clearance_mm(mold, low.part.part_id) + clearance_mm(mold, high.part.part_id)
            gap = high.pocket.along0 - low.pocket.along1
            bodies = gap + room
            overlap = bodies < -ROUNDING_MM
            yield Clearance(
                name="body to body" if overlap else "pocket to pocket",
                value_mm=bodies if overlap else gap,
                needed_mm=web + room if overlap else web,
                parts=f"{low.part.name} and {high.part.name}",
                wall=wall,
                field=high.part.origin,
            )


def _between_facets(outline: MoldOutline, mold: Mold) -> Iterator[Clearance]:
    """Clearance between neighbouring parts in facets: between their pockets or slots, or between overlapping bodies."""
    (x, y), web = outline.plan.centre_mm, mold.min_web_mm
    places = [(one, one.part.position_mm) for one in outline.sockets]
    around = [one for one, place in sorted(places, key=lambda one: math.atan2(one[1][1] - y, one[1][0] - x))]
    for low, high in pairwise((*around, around[0]) if len(around) > 1 else ()):
        if not (low.frame.is_facet or high.frame.is_facet):
            continue
        gap = min(low.frame.apart_mm(one, high.frame, other) for one in low.cuts for other in high.cuts)
        room = clearance_mm(mold, low.part.part_id) + clearance_mm(mold, high.part.part_id)
        overlap = gap + room < -ROUNDING_MM
        yield Clearance(
            name="body to body" if overlap else "pocket to pocket",
            value_mm=gap + room if overlap else gap,
            needed_mm=web + room if overlap else web,
            parts=f"{low.part.name} and {high.part.name}",
            field=max(low.part.origin, high.part.origin),
        )


def _of_socket(socket: Socket, outline: MoldOutline, mold: Mold) -> Iterator[Clearance]:
    part, frame, outside = socket.part, socket.frame, _outside(socket, mold)
    for name, field, value, needed in (
        *_of_pocket(socket, outline, mold.min_web_mm, outside),
        *_to_fixing_holes(socket, outline, mold.min_web_mm),
        *_of_leads(socket, mold.min_web_mm, outside),
    ):
        yield Clearance(
            name=name, value_mm=value, needed_mm=needed, parts=part.name, wall=frame.wall, field=field
        )


Row = tuple[str, str, float, float]
"""Name, field, value and required value of one clearance of a socket."""


def _of_pocket(socket: Socket, outline: MoldOutline, web: float, outside: str) -> Iterator[Row]:
    pocket, frame, part = socket.pocket, socket.frame, socket.part
    if not frame.is_facet:
        to_corner = min(pocket.along0, frame.length_mm - pocket.along1)
        yield "pocket to corner", part.origin, to_corner, web
    behind = min(frame.thickness_at_mm(along) for along in (pocket.along0, pocket.along1))
    yield "pocket back to outer face", outside, behind - pocket.out1, web
    yield "floor under pocket", part.height_field, pocket.floor - outline.bottom_mm, web
    yield "pocket below fill level", part.height_field, outline.fill_mm - pocket.floor, web


def _to_fixing_holes(socket: Socket, outline: MoldOutline, web: float) -> Iterator[Row]:
    if not outline.fixing_holes:
        return
    yield "pocket to fixing hole", INSET, _least_gap_mm(socket, (socket.pocket,), outline), web
    if socket.slots:
        ways = (*socket.slots, *socket.necks)
        yield "wire slot to fixing hole", INSET, _least_gap_mm(socket, ways, outline), web
    if socket.holes:
        pairs = ((lead, fixing) for lead in socket.holes for fixing in outline.fixing_holes)
        yield "lead hole to fixing hole", INSET, min(_apart_mm(*pair) for pair in pairs), web


def _of_leads(socket: Socket, web: float, outside: str) -> Iterator[Row]:
    pocket, frame = socket.pocket, socket.frame
    for before, after in pairwise(socket.slots):
        yield "wire slot to wire slot", LEADS, after.along0 - before.along1, web
    for one, other in pairwise(socket.holes):
        yield "lead hole to lead hole", LEADS, _apart_mm(one, other), web
    if not socket.holes:
        return
    radius = socket.holes[0].radius
    places = [frame.along_and_outward_mm(hole.x, hole.y) for hole in socket.holes]
    low, high = min(along for along, _ in places), max(along for along, _ in places)
    near, far = min(outward for _, outward in places), max(outward for _, outward in places)
    behind = min(frame.thickness_at_mm(along) for along in (low - radius, high + radius))
    to_edge = min(low - pocket.along0, pocket.along1 - high, pocket.out1 - far)
    yield "lead hole to cavity", LEADS, near - radius, web
    yield "lead hole to outer face", outside, behind - far - radius, web
    yield "lead hole to pocket edge", LEADS, to_edge - radius, LEDGE_MM


def _least_gap_mm(socket: Socket, cuts: tuple[Cut, ...], outline: MoldOutline) -> float:
    return min(socket.frame.gap_mm(cut, hole) for cut in cuts for hole in outline.fixing_holes)


def _apart_mm(one: Hole, other: Hole) -> float:
    return math.hypot(one.x - other.x, one.y - other.y) - one.radius - other.radius


def _to_outside_mm(hole: Hole, outline: MoldOutline) -> float:
    """Distance from a fixing hole to the nearest outer face, including rounded edges and cut [mm]."""
    inset, radius = float(outline.outer.gap_mm(hole.x, hole.y)), outline.corner_radius_mm
    rounding = radius - math.sqrt(2) * (radius - inset) if inset < radius else inset
    cut = (2 * inset - outline.origin_cut_mm) / math.sqrt(2)
    return min(inset, rounding, cut) - hole.radius
