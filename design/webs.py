"""Clearances of the mold from its parameters: every wall, web and floor that has to print.

Tangent cutters give files that slicers accept and printers get wrong, and no mesh check finds a thin
wall reliably; so distances are computed here in closed form, before any solid exists.

Distances are in plan, except the floor under a pocket. A negative value means that two cuts overlap.
What is a wall of material needs `mold.min_web_mm`; a lead hole only has to stay inside its pocket.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

from design.errors import DesignError
from design.layout import Wall
from design.mold_outline import MoldOutline, by_wall, outline_of
from design.sockets import Box, Cut, Hole, Socket
from design.spec import SensorDesign

LEDGE_MM = 0.1
"""A lead hole starts at least this far inside the edge of its pocket's floor."""
ROUNDING_MM = 1e-9
"""Sums of decimal lengths come out this exact; a web that equals the need is enough."""

_OUTER: dict[Wall, str] = {
    "south": "mold.outer_width_mm",
    "north": "mold.outer_width_mm",
    "east": "mold.outer_length_mm",
    "west": "mold.outer_length_mm",
}


@dataclass(frozen=True, kw_only=True)
class Clearance:
    """One distance that has to be kept.

    Attributes
    ----------
    name : what the distance is, the same words for every place
    value_mm, needed_mm : what the design has, what it needs
    where : the place, with part names
    remedy : which fields to change
    """

    name: str
    value_mm: float
    needed_mm: float
    where: str
    remedy: str

    @property
    def is_kept(self) -> bool:
        """Whether the distance is at least what is needed."""
        return self.value_mm >= self.needed_mm - ROUNDING_MM

    @property
    def spare_mm(self) -> float:
        """How much more there is than needed, to the rounding of lengths; negative when too tight [mm]."""
        return round(self.value_mm - self.needed_mm, 9)

    def __str__(self) -> str:
        """One line for a message: name, value, place, need, way out."""
        value = round(self.value_mm, 3) + 0.0  # no minus zero
        return f"{self.name}: {value:.3f} mm at {self.where}, needs >= {self.needed_mm:g} mm; {self.remedy}"


def clearances(design: SensorDesign) -> tuple[Clearance, ...]:
    """Every clearance of the mold, in the order walls, fixing holes, pockets, leads."""
    outline, web = outline_of(design), design.mold.min_web_mm
    return (
        *_walls(outline, web),
        *_fixing_holes(outline, web),
        *_between_pockets(outline, web),
        *(found for socket in outline.sockets for found in _of_socket(socket, outline, web)),
    )


def tightest(found: tuple[Clearance, ...]) -> tuple[Clearance, ...]:
    """The clearance with the least spare of each name, in the order of first appearance."""
    worst: dict[str, Clearance] = {}
    for one in found:
        if one.name not in worst or one.spare_mm < worst[one.name].spare_mm:
            worst[one.name] = one
    return tuple(worst.values())


def require_buildable(design: SensorDesign) -> None:
    """Refuse a mold whose walls or webs are too thin, before any solid is made.

    Raises
    ------
    DesignError : the tightest place of each kind with its value, its need and the fields to change.
    """
    broken = [one for one in clearances(design) if not one.is_kept]
    if not broken:
        return
    lines = [f"  {one}" for one in tightest(tuple(broken))]
    raise DesignError(f"{design.name}: the mold cannot be built\n" + "\n".join(lines))


def bodies_above_rim(design: SensorDesign) -> tuple[str, ...]:
    """Names of the parts whose body stands above the rim of the mold: a blade or lid will hit them."""
    outline = outline_of(design)
    return tuple(s.name for s in outline.sockets if s.body_top_mm > outline.top_mm + ROUNDING_MM)


def pockets_below_clear_layer(design: SensorDesign) -> tuple[str, ...]:
    """Names of the parts whose pocket reaches below the clear layer, into the black layer or the floor."""
    return tuple(s.name for s in outline_of(design).sockets if s.pocket.floor < -ROUNDING_MM)


def _walls(outline: MoldOutline, web: float) -> Iterator[Clearance]:
    for where, field, value in (
        ("the east and west walls", "mold.outer_length_mm", outline.wall_x_mm),
        ("the south and north walls", "mold.outer_width_mm", outline.wall_y_mm),
    ):
        yield Clearance(name="wall", value_mm=value, needed_mm=web, where=where, remedy=f"raise {field}")


def _fixing_holes(outline: MoldOutline, web: float) -> Iterator[Clearance]:
    if not outline.fixing_holes:
        return
    hole, last, c = outline.fixing_holes[0], outline.fixing_holes[-1], outline.lip_mm
    mouth = Box(x0=-c, x1=outline.length_mm + c, y0=-c, y1=outline.width_mm + c, z0=0.0, z1=0.0)
    yield Clearance(
        name="fixing hole to outer face",
        value_mm=_to_outside_mm(hole, outline),
        needed_mm=web,
        where="the corners",
        remedy="raise mold.fixing_hole_inset_mm or lower mold.fixing_hole_diameter_mm (0 for none)",
    )
    yield Clearance(
        name="fixing hole to fixing hole",
        value_mm=min(last.x - hole.x, last.y - hole.y) - 2 * hole.radius,
        needed_mm=web,
        where="the corners",
        remedy="lower mold.fixing_hole_inset_mm or mold.fixing_hole_diameter_mm (0 for none)",
    )
    yield Clearance(
        name="fixing hole to cavity",
        value_mm=_gap_mm(mouth, hole),
        needed_mm=web,
        where="the corners, at the pour lip",
        remedy="lower mold.fixing_hole_inset_mm or mold.fixing_hole_diameter_mm (0 for none), "
        "or raise mold.outer_length_mm and mold.outer_width_mm",
    )


def _between_pockets(outline: MoldOutline, web: float) -> Iterator[Clearance]:
    for wall, row in by_wall(outline.sockets).items():
        if not row:
            continue
        length = row[0].frame.length_mm
        for socket, gap in ((row[0], row[0].pocket.along0), (row[-1], length - row[-1].pocket.along1)):
            yield Clearance(
                name="pocket to corner",
                value_mm=gap,
                needed_mm=web,
                where=f"{socket.name} on the {wall} wall",
                remedy=f"move it inward ({socket.origin}) or lengthen the cavity",
            )
        for low, high in pairwise(row):
            yield Clearance(
                name="pocket to pocket",
                value_mm=high.pocket.along0 - low.pocket.along1,
                needed_mm=web,
                where=f"{low.name} and {high.name} on the {wall} wall",
                remedy=f"spread or thin out the parts ({low.origin}), or lengthen the cavity",
            )


def _of_socket(socket: Socket, outline: MoldOutline, web: float) -> Iterator[Clearance]:
    wall, pocket = socket.frame.wall, socket.pocket
    where = f"{socket.name} on the {wall} wall"
    for name, value, remedy in (
        (
            "pocket back to outer face",
            socket.frame.thickness_mm - pocket.out1,
            f"raise {_OUTER[wall]}, or use a part with less body_depth_mm",
        ),
        (
            "floor under pocket",
            pocket.floor - outline.bottom_mm,
            "raise the part's height_mm or mold.floor_mm",
        ),
        (
            "pocket below fill level",
            outline.fill_mm - pocket.floor,
            "lower the part's height_mm or raise cavity.clear_thickness_mm",
        ),
    ):
        yield Clearance(name=name, value_mm=value, needed_mm=web, where=where, remedy=remedy)
    for name, gap in (
        ("pocket to fixing hole", _least_gap_mm(socket, (pocket,), outline)),
        ("wire slot to fixing hole", _least_gap_mm(socket, socket.slots, outline)),
    ):
        if gap is not None:
            yield Clearance(
                name=name,
                value_mm=gap,
                needed_mm=web,
                where=where,
                remedy=f"move it inward ({socket.origin}), or change mold.fixing_hole_inset_mm",
            )
    yield from _of_leads(socket, outline, web, where)


def _of_leads(socket: Socket, outline: MoldOutline, web: float, where: str) -> Iterator[Clearance]:
    for low, high in pairwise(socket.slots):
        yield Clearance(
            name="wire slot to wire slot",
            value_mm=high.along0 - low.along1,
            needed_mm=web,
            where=where,
            remedy="lower mold.lead_clearance_mm",
        )
    for low_hole, high_hole in pairwise(socket.holes):
        yield Clearance(
            name="lead hole to lead hole",
            value_mm=_apart_mm(low_hole, high_hole),
            needed_mm=web,
            where=where,
            remedy="lower mold.lead_clearance_mm, or use a part with more lead_pitch_mm",
        )
    for hole in socket.holes:
        yield from _of_hole(socket, hole, outline, web, where)


def _of_hole(socket: Socket, hole: Hole, outline: MoldOutline, web: float, where: str) -> Iterator[Clearance]:
    pocket = socket.pocket
    along, outward = _in_wall(socket, hole)
    sideways = min(along - pocket.along0, pocket.along1 - along) - hole.radius
    rows = [
        ("lead hole to cavity", outward - hole.radius, web),
        ("lead hole to outer face", socket.frame.thickness_mm - outward - hole.radius, web),
        ("lead hole to pocket edge", min(sideways, pocket.out1 - outward - hole.radius), LEDGE_MM),
    ]
    if outline.fixing_holes:
        nearest = min(_apart_mm(hole, fixing) for fixing in outline.fixing_holes)
        rows.append(("lead hole to fixing hole", nearest, web))
    for name, value, needed in rows:
        yield Clearance(
            name=name,
            value_mm=value,
            needed_mm=needed,
            where=where,
            remedy="lower mold.lead_clearance_mm, or use another part (lead_setback_mm, body_width_mm, lead_pitch_mm)",
        )


def _in_wall(socket: Socket, hole: Hole) -> tuple[float, float]:
    across = socket.frame.across_mm
    match socket.frame.wall:
        case "south":
            return hole.x, -hole.y
        case "north":
            return hole.x, hole.y - across
        case "west":
            return hole.y, -hole.x
        case "east":
            return hole.y, hole.x - across


def _least_gap_mm(socket: Socket, cuts: tuple[Cut, ...], outline: MoldOutline) -> float | None:
    boxes = [socket.frame.box(cut) for cut in cuts]
    return min((_gap_mm(box, hole) for box in boxes for hole in outline.fixing_holes), default=None)


def _gap_mm(box: Box, hole: Hole) -> float:
    """Distance in plan between a box and a hole; negative when they overlap."""
    dx, dy = max(box.x0 - hole.x, hole.x - box.x1), max(box.y0 - hole.y, hole.y - box.y1)
    signed = math.hypot(max(dx, 0.0), max(dy, 0.0)) + min(max(dx, dy), 0.0)
    return signed - hole.radius


def _apart_mm(one: Hole, other: Hole) -> float:
    return math.hypot(one.x - other.x, one.y - other.y) - one.radius - other.radius


def _to_outside_mm(hole: Hole, outline: MoldOutline) -> float:
    """Distance of a fixing hole to the nearest outer face, rounding and origin cut included."""
    inset, radius = hole.x + outline.wall_x_mm, outline.corner_radius_mm
    rounding = radius - math.sqrt(2) * (radius - inset) if inset < radius else inset
    cut = (2 * inset - outline.origin_cut_mm) / math.sqrt(2)
    return min(inset, rounding, cut) - hole.radius
