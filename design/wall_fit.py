"""Do the parts fit into their walls? Sockets as numbers, before anything is printed.

A socket is the body widened by the clearance at both sides, behind and below, open upward so that
the part drops in. Seen from above, for the south wall:

       cavity
    ---+      +---------+        +---
       |  E1  |<- web ->|   R1   |     socket depth = body depth + clearance
       +------+         +--------+
             ^ web                     web >= mold.min_web_mm
    -------------------------------- outer face

Every web between two sockets, to the wall's ends, to the outer face and to the print bed is at least
the thinnest wall that the printer makes. Sockets that keep this distance to their wall's ends cannot
meet around a corner. The pour lip and the rounding of the outer edges, which only the mold knows, are
left out.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import pairwise

from design.cavity import CavityGeometry, PlacedPart
from design.finding import Finding, error, mm, warning
from design.layout import OPPOSITE, WALLS, Wall
from design.spec import Mold, SensorDesign

ROUNDING_MM = 1e-9
"""Sums of decimal lengths come out this exact; a web that equals the need is enough."""

LEDGE_MM = 0.1
"""A lead's hole starts at least this far inside the edge of its socket."""

OUTER_FIELD: dict[Wall, str] = {
    "south": "mold.outer_width_mm",
    "north": "mold.outer_width_mm",
    "east": "mold.outer_length_mm",
    "west": "mold.outer_length_mm",
}


@dataclass(frozen=True, kw_only=True)
class Socket:
    """The room of one part in its wall [mm].

    Attributes
    ----------
    part : the part
    low_mm, high_mm : ends along the wall
    depth_mm : from the inner face outward
    floor_mm : above the clear layer's bottom; may be negative
    """

    part: PlacedPart
    low_mm: float
    high_mm: float
    depth_mm: float
    floor_mm: float


@dataclass(frozen=True, kw_only=True)
class Web:
    """A distance between two things on a wall [mm], negative when they overlap."""

    width_mm: float
    names: str
    field: str


def socket_of(part: PlacedPart, mold: Mold) -> Socket:
    """The room that a part needs in its wall."""
    half = part.part.body_width_mm.value / 2 + mold.part_clearance_mm
    return Socket(
        part=part,
        low_mm=part.along_mm - half,
        high_mm=part.along_mm + half,
        depth_mm=part.part.body_depth_mm.value + mold.part_clearance_mm,
        floor_mm=part.body_base_mm - mold.part_clearance_mm,
    )


def wall_thickness_mm(design: SensorDesign, wall: Wall) -> float:
    """Thickness of a wall of the mold; not positive when the outside is too small [mm]."""
    mold, cavity = design.mold, design.cavity
    if wall in ("south", "north"):
        return (mold.outer_width_mm - cavity.width_mm) / 2
    return (mold.outer_length_mm - cavity.length_mm) / 2


def sockets_by_wall(cavity: CavityGeometry, mold: Mold) -> dict[Wall, list[Socket]]:
    """Sockets of each wall, in the order in which they stand along it."""
    return {
        wall: sorted(
            (socket_of(part, mold) for part in cavity.parts if part.wall == wall),
            key=lambda socket: socket.low_mm,
        )
        for wall in WALLS
    }


def wall_findings(design: SensorDesign, cavity: CavityGeometry) -> Iterator[Finding]:
    """Everything that keeps the parts from fitting into the walls."""
    rows = sockets_by_wall(cavity, design.mold)
    yield from _thickness_findings(design, "east", [*rows["east"], *rows["west"]])
    yield from _thickness_findings(design, "south", [*rows["south"], *rows["north"]])
    for wall, row in rows.items():
        yield from _neighbour_findings(design, wall, row)
        yield from _end_findings(design, wall, row, cavity.wall_length_mm(wall))
        yield from _height_findings(design, wall, row)
    yield from _lead_findings(design, cavity)


def _thickness_findings(design: SensorDesign, wall: Wall, sockets: list[Socket]) -> Iterator[Finding]:
    """A wall and the opposite one, which is as thick, with the sockets of both."""
    thickness, web = wall_thickness_mm(design, wall), design.mold.min_web_mm
    deepest = max((socket.depth_mm for socket in sockets), default=0.0)
    need = deepest + web
    if thickness >= need - ROUNDING_MM:
        return
    field = OUTER_FIELD[wall]
    walls = f"the {wall} and {OPPOSITE[wall]} walls"
    yield error(
        field,
        f"{walls} are too thin for their deepest socket, {mm(deepest)}"
        if sockets
        else f"{walls} are too thin",
        value=f"outside {getattr(design.mold, field.split('.')[1]):g} mm leaves {mm(thickness)} of wall",
        limit=f"at least {mm(need)}",
        way_out=f"raise {field}, shrink the cavity, or use a part with less body_depth_mm",
    )


def _neighbour_findings(design: SensorDesign, wall: Wall, row: list[Socket]) -> Iterator[Finding]:
    need, room = design.mold.min_web_mm, 2 * design.mold.part_clearance_mm
    webs = [
        Web(
            width_mm=high.low_mm - low.high_mm,
            names=f"{low.part.name} and {high.part.name}",
            field=high.part.origin,
        )
        for low, high in pairwise(row)
    ]
    overlaps = [web for web in webs if web.width_mm + room < -ROUNDING_MM]
    thin = [web for web in webs if web not in overlaps and web.width_mm < need - ROUNDING_MM]
    for worst, more in _worst(overlaps):
        yield error(
            worst.field,
            f"the bodies of {worst.names} on the {wall} wall overlap{more}",
            value=f"by {mm(-worst.width_mm - room)}",
            limit=f"{mm(need + room)} between bodies",
            way_out="place fewer parts, spread them, or lengthen the cavity",
        )
    for worst, more in _worst(thin):
        yield error(
            worst.field,
            f"the web between the sockets of {worst.names} on the {wall} wall is too thin{more}",
            value=mm(worst.width_mm),
            limit=f"at least mold.min_web_mm = {mm(need)}",
            way_out="place fewer parts, spread them, or lengthen the cavity",
        )


def _end_findings(design: SensorDesign, wall: Wall, row: list[Socket], length_mm: float) -> Iterator[Finding]:
    need = design.mold.min_web_mm
    gaps = [
        Web(
            width_mm=min(socket.low_mm, length_mm - socket.high_mm),
            names=socket.part.name,
            field=socket.part.origin,
        )
        for socket in row
    ]
    for worst, more in _worst([gap for gap in gaps if gap.width_mm < need - ROUNDING_MM]):
        yield error(
            worst.field,
            f"the socket of {worst.names} reaches into the end of the {wall} wall{more}",
            value=f"{mm(worst.width_mm)} to the corner",
            limit=f"at least mold.min_web_mm = {mm(need)} on a wall of {length_mm:g} mm",
            way_out="move it inward, place fewer parts, or lengthen the cavity",
        )


def _height_findings(design: SensorDesign, wall: Wall, row: list[Socket]) -> Iterator[Finding]:
    bed = -design.cavity.black_thickness_mm - design.mold.floor_mm
    rim = design.cavity.clear_thickness_mm + design.mold.rim_mm
    floors = [
        Web(width_mm=s.floor_mm - bed, names=s.part.name, field=height_field(design, s.part)) for s in row
    ]
    tops = [
        Web(width_mm=rim - s.part.body_top_mm, names=s.part.name, field=height_field(design, s.part))
        for s in row
    ]
    need = design.mold.min_web_mm
    for worst, more in _worst([web for web in floors if web.width_mm < need - ROUNDING_MM]):
        yield error(
            worst.field,
            f"the floor below the socket of {worst.names} on the {wall} wall is too thin{more}",
            value=mm(worst.width_mm),
            limit=f"at least mold.min_web_mm = {mm(need)}",
            way_out="raise mold.floor_mm or the part's height_mm",
        )
    for worst, more in _worst([web for web in tops if web.width_mm < -ROUNDING_MM]):
        yield warning(
            worst.field,
            f"the body of {worst.names} on the {wall} wall sticks out above the rim{more}",
            value=f"by {mm(-worst.width_mm)}",
            limit=f"a top at {mm(rim)} at most",
            way_out="raise mold.rim_mm or lower the part; the leveling blade will meet it",
        )


def _lead_findings(design: SensorDesign, cavity: CavityGeometry) -> Iterator[Finding]:
    """Radial parts only: their leads go down through round holes; wires leave through open slots."""
    mold = design.mold
    radial = {part.part_id: part.part for part in cavity.parts if part.part.mounting == "radial"}
    for part_id, entry in radial.items():
        radius = (entry.lead_diameter_mm.value + mold.lead_clearance_mm) / 2
        reach = (entry.lead_count - 1) / 2 * entry.lead_pitch_mm.value + radius
        setback = entry.lead_setback_mm.value if entry.lead_setback_mm else entry.body_depth_mm.value / 2
        beside = entry.body_width_mm.value / 2 + mold.part_clearance_mm - reach
        behind = entry.body_depth_mm.value + mold.part_clearance_mm - setback - radius
        for what, have, need in (
            ("between the lead holes", entry.lead_pitch_mm.value - 2 * radius, mold.min_web_mm),
            ("from the lead holes to the cavity", setback - radius, mold.min_web_mm),
            ("from the lead holes to the socket's edge", min(beside, behind), LEDGE_MM),
        ):
            if have < need - ROUNDING_MM:
                yield error(
                    "mold.lead_clearance_mm",
                    f"the web {what} of {part_id} is too thin",
                    value=mm(have),
                    limit=f"at least {mm(need)}",
                    way_out="lower mold.lead_clearance_mm or mold.min_web_mm, or use another part",
                )


def height_field(design: SensorDesign, part: PlacedPart) -> str:
    """Dotted path that a part's height comes from: its place in the layout, or its kind's section."""
    pattern = design.layout[int(part.origin.rsplit(".", 1)[1])]
    own = getattr(pattern, "height_mm", None) is not None
    return f"{part.origin}.height_mm" if own else f"{part.kind}s.height_mm"


def _worst(webs: Iterable[Web]) -> Iterator[tuple[Web, str]]:
    """The narrowest of some webs and how many more there are; nothing for none."""
    found = sorted(webs, key=lambda web: round(web.width_mm, 6))  # equal ones stay in order
    if found:
        more = len(found) - 1
        yield found[0], f" (and {more} more place{'s' if more > 1 else ''})" if more else ""
