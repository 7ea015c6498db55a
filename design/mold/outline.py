r"""Numeric model of the printed mold, before any solid is made.

Positions are in the cavity's coordinate system (`optopad.design.shape.cavity`), and the mold is centred on the cavity.

      top   ____      lip, 45 deg      ____
           |    \                     /    |   rim
           |     |~~~~ clear top ~~~~|     |
           |     |                   |     |
           |     |___________________|     |   -black
           |_______________________________|   -black - floor
           <wall>

The lip is a bevel of the cavity's upper edge. A lid casts a crowned top (`optopad.cad.lid`). The mold of a crowned pad
has no lip, and its rim is measured from the highest point of the top's edge. It is filled upside down through holes in
the floor. A mold with round walls follows the cavity's outline, with a flat facet for each optical part. It has neither
a lip nor collars (walls around tall bodies), and its fixing holes are between parts.

If all parts are on the floor, the mold is a frame around them. It has neither floor nor sockets, because the circuit
board under it is the floor of the cavity:

      top   ____      lip           ____
           |    \                 /    |   rim
           |     |~~~~ clear ~~~~|     |
           |     |  _        _   |     |
           |_____|_|_|_black|_|__|_____|   -black: underside of the frame
       ____________________________________
      |____________ board _________________|
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from optopad.design.fields.quantity import ROUNDING_MM
from optopad.design.mold.filling import Passage, filling_holes, is_cast_under_lid, passage_mm, passages
from optopad.design.mold.label import MoldLabel, mold_label
from optopad.design.mold.part_numbers import PartNumber, part_numbers
from optopad.design.mold.sockets import Box, Collar, Hole, Socket, WallFrame, by_wall, raised, socket_of
from optopad.design.once import once
from optopad.design.shape.cavity import CavityGeometry, PlacedPart, Plan, cavity_of
from optopad.design.shape.outline import Outline, Point
from optopad.design.spec import Mold, SensorDesign

LIP_MAX_MM = 1.5
"""Widest pour lip: enough to guide the silicone and to show the fill line."""
LIP_SHARE_OF_WALL = 0.25
"""Greatest width of the lip as a share of the wall; the blade rests on the rest of the rim."""
CORNER_RADIUS_MM = 1.0
"""Radius of the mold's outer vertical edges, comfortable to hold."""
ORIGIN_CUT_MM = 2.0
"""Size of the 45-degree cut of the outer edge at the cavity's origin, which identifies the walls."""
CORNER_SHARE_OF_WALL = 1 / 3
"""Greatest radius or cut of the outer edges as a share of the thinner wall."""


@dataclass(frozen=True, kw_only=True)
class MoldOutline:
    """Dimensions of the mold, in the cavity's coordinate system [mm].

    Attributes
    ----------
    plan : outline of the cavity, and the pad's top
    wall_x_mm, wall_y_mm : least thickness of the mold's walls along x and along y
    bottom_mm, cavity_bottom_mm, top_mm : height z of the underside, the cavity's floor and the rim
    fill_mm : largest height z along the edge of the untouched top
    filling : holes through the floor for filling a crowned pad, the sprue first; empty for a flat top or a frame
    passages : holes through the walls of a frame for filling a crowned pad, the sprue first; empty for others
    lip_mm : leg of the 45-degree pour lip, which is above the fill level; 0 for none
    corner_radius_mm : radius of the outer vertical edges
    origin_cut_mm : size of the 45-degree cut of the outer edge at the origin
    ledge_mm : width of the seat for a glass cover at the fill level, in place of the lip; 0 for none
    fixing_holes : vertical holes for screws or pins
    sockets : cuts for the optical parts
    collars : walls above the rim around taller bodies of parts
    numbers : names of the parts, engraved in the outer faces
    label : text engraved in the underside
    """

    plan: Plan
    wall_x_mm: float
    wall_y_mm: float
    bottom_mm: float
    cavity_bottom_mm: float
    fill_mm: float
    top_mm: float
    lip_mm: float
    ledge_mm: float
    corner_radius_mm: float
    origin_cut_mm: float
    fixing_holes: tuple[Hole, ...]
    filling: tuple[Hole, ...]
    passages: tuple[Passage, ...]
    sockets: tuple[Socket, ...]
    collars: tuple[Collar, ...]
    numbers: tuple[PartNumber, ...]
    label: MoldLabel

    @property
    def is_frame(self) -> bool:
        """Whether the mold has no floor, because a circuit board closes the cavity from below."""
        return self.bottom_mm == self.cavity_bottom_mm

    @property
    def length_mm(self) -> float:
        """Inner size of the cavity along x [mm]."""
        return self.plan.length_mm

    @property
    def width_mm(self) -> float:
        """Inner size of the cavity along y [mm]."""
        return self.plan.width_mm

    @property
    def outer(self) -> Outline:
        """Outline of the outer faces seen from above, without rounded edges and cut."""
        return _outer(self.plan, self.wall_x_mm, self.wall_y_mm)

    @property
    def outer_length_mm(self) -> float:
        """Outer size of the mold along x [mm]."""
        return self.length_mm + 2 * self.wall_x_mm

    @property
    def outer_width_mm(self) -> float:
        """Outer size of the mold along y [mm]."""
        return self.width_mm + 2 * self.wall_y_mm

    @property
    def mouth(self) -> Box:
        """Bounding box of the pour lip or of the cover's seat, across the whole cavity."""
        out = self.mouth_out_mm
        return Box(
            x0=-out,
            x1=self.length_mm + out,
            y0=-out,
            y1=self.width_mm + out,
            z0=self.fill_mm if self.ledge_mm else self.top_mm - self.lip_mm,
            z1=self.top_mm,
        )

    @property
    def mouth_out_mm(self) -> float:
        """Distance by which the lip or the cover's seat extends outward from the cavity at the rim [mm]."""
        return max(self.lip_mm, self.ledge_mm)

    @property
    def height_mm(self) -> float:
        """Height from the underside to the rim [mm]."""
        return self.top_mm - self.bottom_mm

    @property
    def highest_mm(self) -> float:
        """Height z of the highest face: the rim, or the highest collar [mm]."""
        return max([self.top_mm, *(collar.top_mm for collar in self.collars)])


@once
def outline_of(design: SensorDesign) -> MoldOutline:
    """Compute the dimensions of a design's mold; `optopad.design.mold.webs` checks whether they can be printed."""
    cavity, mold = cavity_of(design), design.mold
    plan = cavity.plan
    wall_x = (mold.outer_length_mm - plan.length_mm) / 2
    wall_y = (mold.outer_width_mm - plan.width_mm) / 2
    wall = max(min(wall_x, wall_y), 0.0)
    fill = plan.clear_mm if plan.top.is_flat else plan.rim_mm[1]
    floor = 0.0 if design.is_on_board else mold.floor_mm
    bottom, top = -cavity.black_mm - floor, fill + mold.rim_mm
    ledge = mold.cover_ledge_mm
    has_lip = plan.is_block and not ledge
    lip = min(LIP_MAX_MM, mold.rim_mm, wall * LIP_SHARE_OF_WALL) if has_lip else 0.0
    outer = _outer(plan, wall_x, wall_y)
    fixing_holes = _fixing_holes(mold, cavity, outer, bottom, top)
    sockets = tuple(
        _with_room(
            socket_of(part, mold, _frame(part, outer, wall_x, wall_y), top, bottom), fixing_holes, mold
        )
        for part in cavity.parts
        if not part.is_on_floor
    )
    collars: tuple[Collar, ...] = ()
    if plan.is_block:
        collars, sockets = raised(sockets, top, max(lip, ledge), fixing_holes, mold)
    return MoldOutline(
        plan=plan,
        wall_x_mm=wall_x,
        wall_y_mm=wall_y,
        bottom_mm=bottom,
        cavity_bottom_mm=-cavity.black_mm,
        fill_mm=fill,
        top_mm=top,
        lip_mm=lip,
        ledge_mm=ledge,
        corner_radius_mm=min(CORNER_RADIUS_MM, wall * CORNER_SHARE_OF_WALL) if outer.corners_mm else 0.0,
        origin_cut_mm=_origin_cut_mm(mold, wall) if outer.corners_mm else 0.0,
        fixing_holes=fixing_holes,
        filling=() if design.is_on_board else filling_holes(plan, bottom, -cavity.black_mm),
        passages=passages(plan, outer, passage_mm(plan, top, mold.min_web_mm)) if design.is_on_board else (),
        sockets=sockets,
        collars=collars,
        numbers=_numbers(sockets, fixing_holes, bottom if mold.pieces == "one" else -cavity.black_mm, mold),
        label=mold_label(design),
    )


def is_levelled(design: SensorDesign) -> bool:
    """Whether a blade levels the black layer: it is poured first, and no body stands above it."""
    is_poured_last = is_cast_under_lid(cavity_of(design).plan) and not design.is_on_board
    return design.cavity.black_thickness_mm > 0 and not is_poured_last and not bodies_above_black(design)


def bodies_above_black(design: SensorDesign) -> tuple[str, ...]:
    """Names of the parts on the floor whose bodies stand above the black layer, in the way of a blade."""
    return tuple(part.name for part in cavity_of(design).on_floor if part.body_top_mm > ROUNDING_MM)


def _with_room(socket: Socket, fixing_holes: tuple[Hole, ...], mold: Mold) -> Socket:
    """A socket as given, or without its lead channel if the channel is too near a fixing hole."""
    channel = socket.channel
    if channel is None:
        return socket
    near = any(socket.frame.gap_mm(channel, hole) < mold.min_web_mm for hole in fixing_holes)
    return socket.without_channel() if near else socket


def _numbers(
    sockets: tuple[Socket, ...], fixing_holes: tuple[Hole, ...], bottom: float, mold: Mold
) -> tuple[PartNumber, ...]:
    if mold.numbers == "none":
        return ()
    around = sockets if any(socket.frame.is_facet for socket in sockets) else ()
    return tuple(
        number
        for row in by_wall(sockets).values()
        for number in part_numbers(row, fixing_holes, bottom, mold.min_web_mm, around)
    )


def bed_lift_mm(design: SensorDesign) -> float:
    """Offset added to z of the cavity's coordinates in all files of the mold, so that the print bed is z = 0 [mm]."""
    return -outline_of(design).bottom_mm


def _origin_cut_mm(mold: Mold, wall_mm: float) -> float:
    cut = min(ORIGIN_CUT_MM, wall_mm * CORNER_SHARE_OF_WALL)
    if mold.fixing_hole_diameter_mm == 0:
        return cut
    keep = mold.fixing_hole_diameter_mm / 2 + mold.min_web_mm
    return max(min(cut, 2 * mold.fixing_hole_inset_mm - math.sqrt(2) * keep), 0.0)


def _outer(plan: Plan, wall_x: float, wall_y: float) -> Outline:
    return plan.outline.in_box((-wall_x, -wall_y, plan.length_mm + wall_x, plan.width_mm + wall_y))


def _frame(part: PlacedPart, outer: Outline, wall_x: float, wall_y: float) -> WallFrame:
    line = part.line
    if part.angle_deg is None:
        return WallFrame(line=line, thickness_mm=wall_y if line.outward[0] == 0.0 else wall_x)
    arc = outer.arc_towards(part.angle_deg)
    stands = -line.along_and_outward_mm(*arc.centre_mm)[1]
    return WallFrame(line=line, thickness_mm=arc.radius_mm - stands, outer_radius_mm=arc.radius_mm)


def _fixing_holes(
    mold: Mold, cavity: CavityGeometry, outer: Outline, bottom: float, top: float
) -> tuple[Hole, ...]:
    """Fixing holes: in the corners or, if the mold has no corners, between the parts in its walls."""
    if mold.fixing_hole_diameter_mm == 0:
        return ()
    inset, radius = mold.fixing_hole_inset_mm, mold.fixing_hole_diameter_mm / 2
    x0, y0, x1, y1 = outer.box_mm
    within = outer.in_box((x0 + inset, y0 + inset, x1 - inset, y1 - inset))
    places = within.corners_mm or _between_parts_mm(cavity, within)
    return tuple(Hole(x=x, y=y, radius=radius, z0=bottom, z1=top) for x, y in places)


def _between_parts_mm(cavity: CavityGeometry, within: Outline) -> list[Point]:
    """Up to four points on an outline for fixing holes, in directions halfway between neighbouring parts in its walls.

    The points nearest to the diagonals of the bounding box are chosen, or on them if no part is in a wall.
    """
    (x, y), (x0, y0, x1, y1) = within.centre_mm, within.box_mm
    in_walls = (part.position_mm for part in cavity.parts if not part.is_on_floor)
    at = sorted({_direction_deg(px - x, py - y) for px, py, _ in in_walls})
    diagonals = [
        _direction_deg(*corner)
        for corner in ((x1 - x, y1 - y), (x0 - x, y1 - y), (x0 - x, y0 - y), (x1 - x, y0 - y))
    ]
    middles = [
        (low + ((high - low) % 360.0 or 360.0) / 2) % 360.0
        for low, high in zip(at, (*at[1:], *at[:1]), strict=True)
    ] or diagonals
    found: list[float] = []
    for diagonal in diagonals:
        left = [angle for angle in middles if angle not in found]
        if left:
            found.append(
                min(left, key=lambda angle: (round(abs((angle - diagonal + 180) % 360 - 180), 6), angle))
            )
    ways = [(math.cos(math.radians(angle)), math.sin(math.radians(angle))) for angle in found]
    far = [within.way_out_mm((x, y), way) for way in ways]
    return [(x + away * dx, y + away * dy) for away, (dx, dy) in zip(far, ways, strict=True)]


def _direction_deg(x: float, y: float) -> float:
    return round(math.degrees(math.atan2(y, x)), 9) % 360.0
