r"""The mold as plain numbers: what is printed, before any solid is made.

Frame of `design.shape.cavity`; the mold is centred on the cavity.

      top   ____      lip, 45 deg      ____
           |    \                     /    |   rim
           |     |~~~~ clear top ~~~~|     |
           |     |                   |     |
           |     |___________________|     |   -black
           |_______________________________|   -black - floor
           <wall>

A crowned top is cast by a lid (`cad.lid`): there is no pour lip, the rim is counted from the highest place of the top's
edge, and the mold is filled upside down through holes in its floor, which is then the highest place. The mold of a disc
is round, with a facet for each part; it has neither lip nor collars, and its fixing holes stand between parts.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from design.mold.filling import filling_holes
from design.mold.label import MoldLabel, mold_label
from design.mold.part_numbers import PartNumber, part_numbers
from design.mold.raised_sockets import Collar, by_wall, raised
from design.mold.sockets import Box, Hole, Socket, WallFrame, socket_of
from design.shape.cavity import CavityGeometry, cavity_of
from design.shape.outline import Line, Outline
from design.shape.plan import Plan
from design.spec import Mold, SensorDesign

LIP_MAX_MM = 1.5
"""Widest pour lip: enough to guide a pour and to show the fill line."""
LIP_SHARE_OF_WALL = 0.25
"""The lip leaves three quarters of the rim flat, for the leveling blade to rest on."""
CORNER_RADIUS_MM = 1.0
"""Rounding of the outer vertical edges: comfortable to hold."""
ORIGIN_CUT_MM = 2.0
"""45-degree cut of the outer edge at the cavity's origin, so that the walls can be told apart."""
CORNER_SHARE_OF_WALL = 1 / 3
"""Rounding and cut stay within this share of the thinner wall."""
DIAGONALS_DEG = (45.0, 135.0, 225.0, 315.0)


@dataclass(frozen=True, kw_only=True)
class MoldOutline:
    """Numbers of the mold in the cavity frame [mm].

    Attributes
    ----------
    plan : the cavity in plan, and the pad's top
    wall_x_mm, wall_y_mm : thickness of the east and west, of the south and north walls; of a round mold at the thinnest
    bottom_mm, cavity_bottom_mm, fill_mm, top_mm : levels: bed, cavity floor, highest place of the undisturbed top's
        edge, rim
    filling : holes through the floor to fill a crowned pad through, the sprue first; empty for a flat top
    lip_mm : leg of the 45-degree pour lip; it never reaches below the fill level
    corner_radius_mm, origin_cut_mm : outer vertical edges
    ledge_mm : width of a glass cover's seat at the fill level, in place of the lip; 0 for none
    fixing_holes, sockets : what is cut through and into the walls
    collars : walls above the rim around bodies that are taller
    numbers : names sunk into the outer faces
    label : what is sunk into the underside
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
    sockets: tuple[Socket, ...]
    collars: tuple[Collar, ...]
    numbers: tuple[PartNumber, ...]
    label: MoldLabel

    @property
    def length_mm(self) -> float:
        """Inner size along x [mm]."""
        return self.plan.length_mm

    @property
    def width_mm(self) -> float:
        """Inner size along y [mm]."""
        return self.plan.width_mm

    @property
    def outer_radius_mm(self) -> float:
        """Of the round mold of a disc; 0 for a block [mm]."""
        return self.plan.radius_mm + self.wall_x_mm if self.plan.is_disc else 0.0

    @property
    def outer(self) -> Outline:
        """The outer faces in plan, without rounding and cut."""
        x, y = self.wall_x_mm, self.wall_y_mm
        return self.plan.outline.in_box((-x, -y, self.length_mm + x, self.width_mm + y))

    @property
    def outer_length_mm(self) -> float:
        """Outside along x [mm]."""
        return self.length_mm + 2 * self.wall_x_mm

    @property
    def outer_width_mm(self) -> float:
        """Outside along y [mm]."""
        return self.width_mm + 2 * self.wall_y_mm

    @property
    def mouth(self) -> Box:
        """What the pour lip or the cover's seat opens, with the cavity below it."""
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
        """How far the rim is opened outward of the cavity [mm]."""
        return max(self.lip_mm, self.ledge_mm)

    @property
    def height_mm(self) -> float:
        """From the bed to the rim [mm]."""
        return self.top_mm - self.bottom_mm

    @property
    def highest_mm(self) -> float:
        """Level of the highest face: the rim, or the highest collar [mm]."""
        return max([self.top_mm, *(collar.top_mm for collar in self.collars)])


def outline_of(design: SensorDesign) -> MoldOutline:
    """The numbers of a design's mold; whether they can be built is the question of `design.mold.webs`."""
    cavity, mold = cavity_of(design), design.mold
    plan = cavity.plan
    wall_x = (mold.outer_length_mm - plan.length_mm) / 2
    wall_y = (mold.outer_width_mm - plan.width_mm) / 2
    wall = max(min(wall_x, wall_y), 0.0)
    fill = plan.clear_mm if plan.top.is_flat else plan.rim_mm[1]
    bottom, top = -cavity.black_mm - mold.floor_mm, fill + mold.rim_mm
    ledge = mold.cover_ledge_mm
    has_lip = plan.is_flat_rectangle and not ledge
    lip = min(LIP_MAX_MM, mold.rim_mm, wall * LIP_SHARE_OF_WALL) if has_lip else 0.0
    fixing_holes = _fixing_holes(mold, cavity, wall_x, wall_y, bottom, top)
    sockets = tuple(
        _with_room(
            socket_of(part, mold, _frame(part.line, plan, wall_x, wall_y), top, bottom), fixing_holes, mold
        )
        for part in cavity.parts
    )
    collars: tuple[Collar, ...] = ()
    if plan.is_flat_rectangle:
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
        corner_radius_mm=0.0 if plan.is_disc else min(CORNER_RADIUS_MM, wall * CORNER_SHARE_OF_WALL),
        origin_cut_mm=0.0 if plan.is_disc else _origin_cut_mm(mold, wall),
        fixing_holes=fixing_holes,
        filling=filling_holes(plan, bottom, -cavity.black_mm),
        sockets=sockets,
        collars=collars,
        numbers=_numbers(sockets, fixing_holes, bottom if mold.pieces == "one" else -cavity.black_mm, mold),
        label=mold_label(design),
    )


def _with_room(socket: Socket, fixing_holes: tuple[Hole, ...], mold: Mold) -> Socket:
    """The socket, without its channel where a fixing hole stands in the way."""
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
    around = sockets if any(socket.frame.outer_radius_mm for socket in sockets) else ()
    return tuple(
        number
        for row in by_wall(sockets).values()
        for number in part_numbers(row, fixing_holes, bottom, mold.min_web_mm, around)
    )


def bed_lift_mm(design: SensorDesign) -> float:
    """What is added to z of the cavity frame in every file, so that the print bed is z = 0 [mm]."""
    return design.cavity.black_thickness_mm + design.mold.floor_mm


def _origin_cut_mm(mold: Mold, wall_mm: float) -> float:
    cut = min(ORIGIN_CUT_MM, wall_mm * CORNER_SHARE_OF_WALL)
    if mold.fixing_hole_diameter_mm == 0:
        return cut
    keep = mold.fixing_hole_diameter_mm / 2 + mold.min_web_mm
    return max(min(cut, 2 * mold.fixing_hole_inset_mm - math.sqrt(2) * keep), 0.0)


def _frame(line: Line, plan: Plan, wall_x: float, wall_y: float) -> WallFrame:
    if plan.is_disc:
        outer = plan.radius_mm + wall_x
        return WallFrame(line=line, thickness_mm=outer - plan.stands_mm(line), outer_radius_mm=outer)
    return WallFrame(line=line, thickness_mm=wall_y if line.outward[0] == 0.0 else wall_x)


def _fixing_holes(
    mold: Mold, cavity: CavityGeometry, wall_x: float, wall_y: float, bottom: float, top: float
) -> tuple[Hole, ...]:
    if mold.fixing_hole_diameter_mm == 0:
        return ()
    inset, radius = mold.fixing_hole_inset_mm, mold.fixing_hole_diameter_mm / 2
    if cavity.plan.is_disc:
        x, y = cavity.plan.centre_mm
        away = cavity.plan.radius_mm + wall_x - inset
        turns = [math.radians(angle) for angle in _between_parts_deg(cavity)]
        places = [(x + away * math.cos(turn), y + away * math.sin(turn)) for turn in turns]
        return tuple(Hole(x=hx, y=hy, radius=radius, z0=bottom, z1=top) for hx, hy in places)
    xs = (inset - wall_x, cavity.length_mm + wall_x - inset)
    ys = (inset - wall_y, cavity.width_mm + wall_y - inset)
    return tuple(Hole(x=x, y=y, radius=radius, z0=bottom, z1=top) for x in xs for y in ys)


def _between_parts_deg(cavity: CavityGeometry) -> list[float]:
    """Directions of a disc's fixing holes: of the middles between neighbouring parts those nearest to the diagonals."""
    at = sorted({math.degrees(math.atan2(*part.line.outward[::-1])) % 360.0 for part in cavity.parts})
    middles = [
        (low + ((high - low) % 360.0 or 360.0) / 2) % 360.0
        for low, high in zip(at, (*at[1:], at[0]), strict=True)
    ]
    found: list[float] = []
    for diagonal in DIAGONALS_DEG:
        left = [angle for angle in middles if angle not in found]
        if left:
            found.append(
                min(left, key=lambda angle: (round(abs((angle - diagonal + 180) % 360 - 180), 6), angle))
            )
    return found
