r"""The lid that shapes a crowned top: it closes the mold, which is then filled upside down through holes in its floor.

The cross-sections show the lid on the mold for a dome (left) and for a cylinder with its highest line at the rim:

      ______________________________         ______________________________  back
     |            _____             |       |                              |
     |_   __..---'     '---..__   __|       |_   ______          ______   _|  seat: on the rim of the mold
     notch | |    dish        | |             | | \     ''----''     / | |    plug, sides drafted
           |_|                |_|             |_|  '                '  |_|    pins, in the fixing holes

The dish is the concave face that shapes the top of the pad. The flange is the plate over the rim. Where the top is
above the rim, the dish is cut into the flange. Where the top is below the rim, the dish is the end of a plug that fills
the cavity. On a round pad the plug is a circle within the flat facets of the wall. Around the plug, silicone rises to
the rim as a ridge that is as wide as the gap around the plug. A plug shallower than `LEAST_PLUG_MM` is left out.

The lid is printed on its back, dish up, without support. In its file it is therefore turned over about the middle line
along x. Volume, checks and pictures use the lid's dimensions (`LidSize`) without a CAD kernel.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import cast

import cadquery as cq
import numpy as np

from optopad.cad.mesh import Mesh
from optopad.cad.mold import BEYOND_MM, cut_solid, outer_prism
from optopad.design.mold.outline import MoldOutline, outline_of
from optopad.design.mold.sockets import Cut, Hole, WallFrame
from optopad.design.mold.webs import Clearance
from optopad.design.shape.cavity import Plan, facet
from optopad.design.spec import SensorDesign

PLAY_MM = 0.15
"""Width of the gap around the plug at the rim, and around the pins in their holes."""
DRAFT_DEG = 2.0
"""Draft angle of the plug's sides, which lets the plug be pulled out of the cured pad."""
FLANGE_MM = 3.0
"""Smallest thickness of the lid over the rim."""
OVER_CROWN_MM = 2.5
"""Smallest thickness of the lid over the crown's highest point."""
BELOW_MM = 0.5
"""Extra depth of the plug before its concave face is cut; the cut removes it."""
LEAST_PLUG_MM = 0.05
"""Smallest depth of a plug, half of a thin printed layer; a shallower plug is left out."""
CLEAR_OF_TANGENT_MM = 0.005
"""Distance by which the flange is raised if a cylinder's highest line would touch it, where CAD booleans would fail.

The printed lid is then lower on the mold by this distance, a twentieth of a thin layer.
"""
PIN_MM, PIN_CHAMFER_MM = 3.0, 0.5
"""Length of the pins, which is limited to half of the mold's height, and of the chamfer at their ends."""
NOTCH_WIDTH_MM, NOTCH_DEPTH_MM, NOTCH_HEIGHT_MM = 6.0, 1.5, 1.5
"""Largest width, depth and height of the two notches for a screwdriver.

The depth is limited to a third of the mold's wall, and the height to half of the flange.
"""
LEAST_NOTCH_MM = 1.0
"""Smallest width of a notch; narrower ones are left out."""
NOTCH_TURNS_DEG = range(0, 180, 5)
"""Directions considered for the notches of a round lid with a dome; with a cylinder, they mark the cylinder's axis."""


@dataclass(frozen=True, kw_only=True)
class Plug:
    """The part of a lid that extends into the cavity.

    Attributes
    ----------
    half_mm : half length and half width of the plug at the flange; (radius, radius) if it is round
    is_round : whether the plug is round
    floor_mm : z coordinate of the plug's end before the concave face is cut
    """

    half_mm: tuple[float, float]
    is_round: bool
    floor_mm: float

    def inset_mm(self, depth_mm: float) -> float:
        """Distance by which the draft moves the plug's sides inward at a depth below the flange [mm]."""
        return depth_mm * math.tan(math.radians(DRAFT_DEG))


@dataclass(frozen=True, kw_only=True)
class Notch:
    """A notch for a screwdriver in the flange's underside; `cut` is in the coordinate system of the wall below it."""

    frame: WallFrame
    cut: Cut


@dataclass(frozen=True, kw_only=True)
class LidSize:
    """Dimensions of a lid, in the cavity's coordinate system [mm].

    Attributes
    ----------
    seat_mm, back_mm : z coordinates of the flange's underside, which is on the rim, and of its back
    plug : part of the lid in the cavity; None if the concave face is completely in the flange
    has_dish : whether the lid has a concave face, in the flange or at the end of the plug
    pins : pins below the flange, which fit into the fixing holes
    notches : notches at opposite sides; empty if there is no room for them
    """

    seat_mm: float
    back_mm: float
    plug: Plug | None
    has_dish: bool
    pins: tuple[Hole, ...]
    notches: tuple[Notch, ...]

    @property
    def flange_mm(self) -> float:
        """Thickness of the flange [mm]."""
        return self.back_mm - self.seat_mm


def lid_size(design: SensorDesign) -> LidSize | None:
    """Dimensions of a design's lid; None for a flat top, which is poured without a lid."""
    outline = outline_of(design)
    plan = outline.plan
    if plan.top.is_flat:
        return None
    touches = plan.top.straight is not None and plan.clear_mm > outline.top_mm - CLEAR_OF_TANGENT_MM
    seat = outline.top_mm + (CLEAR_OF_TANGENT_MM if touches else 0.0)
    plug = _plug(plan, seat)
    back = max(outline.top_mm + FLANGE_MM, plan.clear_mm + OVER_CROWN_MM)
    length = min(PIN_MM, outline.height_mm / 2)
    pins = tuple(
        replace(hole, radius=hole.radius - PLAY_MM, z0=seat - length, z1=seat)
        for hole in outline.fixing_holes
        if hole.radius > PLAY_MM
    )
    return LidSize(
        seat_mm=seat,
        back_mm=back,
        plug=plug,
        has_dish=plug is not None or plan.clear_mm > seat,
        pins=pins,
        notches=tuple(_notches(outline, seat, back, design.mold.min_web_mm)),
    )


def turned_over(mesh: Mesh, design: SensorDesign, size: LidSize) -> Mesh:
    """Convert a lid from the cavity's coordinate system to that of its file, or back, by the same half turn.

    In the file, the lid is on its back at z = 0.
    """
    flip = np.array([1.0, -1.0, -1.0])
    move = np.array([0.0, design.cavity.width_mm, float(np.float32(size.back_mm))])
    turned = mesh.vertices.astype(np.float64) * flip + move
    return Mesh(vertices=turned.astype(np.float32) + np.float32(0.0), triangles=mesh.triangles)


def lid_clearances(design: SensorDesign) -> Iterator[Clearance]:
    """Thicknesses of the thinnest parts of a lid, with their limits; none for a flat top."""
    size, web = lid_size(design), design.mold.min_web_mm
    if size is None:
        return
    over = size.back_mm - max(design.cavity.clear_thickness_mm, size.seat_mm)
    notch = max((one.cut.top - size.seat_mm for one in size.notches), default=0.0)
    pin = min((2 * hole.radius for hole in size.pins), default=0.0)
    for name, value, needed, field in (
        ("over the crown", over, OVER_CROWN_MM, "crown.radius_mm"),
        ("over a notch", size.flange_mm - notch, web, "mold.min_web_mm"),
        ("thickness of a pin", pin, web, "mold.fixing_hole_diameter_mm"),
    ):
        yield Clearance(name=name, value_mm=value, needed_mm=needed, parts="the lid", field=field)


def _plug(plan: Plan, seat_mm: float) -> Plug | None:
    """The lid's plug; None if even the lowest point of the top is hardly below the flange."""
    is_round = not plan.has_origin_corner
    if is_round:
        radius = float(plan.outline.gap_mm(*plan.centre_mm)) - PLAY_MM
        half, corner = (radius, radius), (radius, 0.0)
        corners = [corner, corner[::-1]]
    else:
        half = (plan.length_mm / 2 - PLAY_MM, plan.width_mm / 2 - PLAY_MM)
        corners = [half]
    x, y = plan.centre_mm
    lowest = min(plan.top_mm(x + dx, y + dy) for dx, dy in corners)
    if seat_mm - lowest < LEAST_PLUG_MM:
        return None
    return Plug(half_mm=half, is_round=is_round, floor_mm=lowest - BELOW_MM)


def pin_chamfer_mm(hole: Hole) -> float:
    """Length of the chamfer at a pin's end [mm]."""
    return min(PIN_CHAMFER_MM, hole.radius / 2, (hole.z1 - hole.z0) / 2)


def _notches(outline: MoldOutline, seat_mm: float, back_mm: float, web_mm: float) -> Iterator[Notch]:
    """Two opposite notches, at least `web_mm` away from the pins' holes; none if there is no room."""
    depth = min(NOTCH_DEPTH_MM, min(outline.wall_x_mm, outline.wall_y_mm) / 3)
    top = seat_mm + min(NOTCH_HEIGHT_MM, (back_mm - seat_mm) / 2)
    for frame in _notched_walls(outline, depth):
        half = _notch_half_mm(frame, outline, depth, web_mm)
        if 2 * half < LEAST_NOTCH_MM:
            continue
        middle = frame.length_mm / 2
        cut = Cut(
            along0=middle - half,
            along1=middle + half,
            out0=frame.thickness_mm - depth,
            out1=frame.thickness_mm,
            floor=seat_mm,
            top=top,
        )
        yield Notch(frame=frame, cut=cut)


def _notched_walls(outline: MoldOutline, depth_mm: float) -> list[WallFrame]:
    """The two opposite walls above which the notches are.

    On a rectangular mold, these are the long walls. On a round one, they are at the ends of the cylinder's axis or, for
    a dome, as far as possible from the pins.
    """
    plan = outline.plan
    if plan.has_origin_corner:
        along_x = plan.length_mm >= plan.width_mm
        names = ("south", "north") if along_x else ("west", "east")
        thickness = outline.wall_y_mm if along_x else outline.wall_x_mm
        return [WallFrame(line=line, thickness_mm=thickness) for line in plan.walls if line.name in names]

    axis = plan.top.straight
    turns = NOTCH_TURNS_DEG if axis is None else (0,) if axis == "x" else (90,)

    def pair(turn_deg: float) -> list[WallFrame]:
        return [_round_wall(outline, turn_deg + other) for other in (0.0, 180.0)]

    def least(turn_deg: float) -> float:
        return round(min(_to_pins_mm(frame, outline, depth_mm) for frame in pair(turn_deg)), 6)

    return pair(max(turns, key=least))


def _round_wall(outline: MoldOutline, turn_deg: float) -> WallFrame:
    inner, outer = (one.arc_towards(turn_deg) for one in (outline.plan.outline.bare, outline.outer))
    line = facet(inner, turn_deg, min(NOTCH_WIDTH_MM, inner.radius_mm) / 2)
    stands = -line.along_and_outward_mm(*inner.centre_mm)[1]
    return WallFrame(line=line, thickness_mm=outer.radius_mm - stands, outer_radius_mm=outer.radius_mm)


def _notch_half_mm(frame: WallFrame, outline: MoldOutline, depth_mm: float, web_mm: float) -> float:
    """Half the width of a notch [mm], limited by the pins and, on a round wall, by the depth of the notch."""
    half = min(NOTCH_WIDTH_MM / 2, frame.length_mm / 2, _to_pins_mm(frame, outline, depth_mm) - web_mm)
    radius = frame.outer_radius_mm
    return min(half, math.sqrt(radius * depth_mm - depth_mm**2 / 4)) if frame.is_facet else half


def _to_pins_mm(frame: WallFrame, outline: MoldOutline, depth_mm: float) -> float:
    """Distance from a notch's middle to the edge of the nearest pin's hole, less the notch's depth [mm]."""
    x, y = frame.point(frame.length_mm / 2, frame.thickness_mm)
    holes = outline.fixing_holes
    apart = min((math.hypot(hole.x - x, hole.y - y) - hole.radius for hole in holes), default=math.inf)
    return apart - depth_mm


def lid(design: SensorDesign) -> cq.Workplane | None:
    """CAD solid of the lid in its position on the mold, in the cavity's coordinate system; None for a flat top."""
    outline, size = outline_of(design), lid_size(design)
    if size is None:
        return None
    body: cq.Shape = outer_prism(outline, size.seat_mm, size.flange_mm)
    if size.plug is not None:
        body = body.fuse(_frustum(size.plug, outline.plan.centre_mm, size.seat_mm))
    cutters = [_notch(notch) for notch in size.notches]
    if size.has_dish:
        cutters.append(crown_body(outline.plan))
    if cutters:
        body = body.cut(*cutters)
    pins = [solid for hole in size.pins for solid in _pin(hole)]  # fused last: the crown's body overlaps them
    pieces = body.fuse(*pins).Solids() if pins else body.Solids()
    assert len(pieces) == 1, f"{design.name}: the lid falls into {len(pieces)} pieces"
    return cq.Workplane(obj=pieces[0])


def _frustum(plug: Plug, centre_mm: tuple[float, float], seat_mm: float) -> cq.Solid:
    """The plug before its concave face is cut: a frustum of a cone or pyramid, widest at the flange."""
    (x, y), depth = centre_mm, seat_mm - plug.floor_mm
    inset = plug.inset_mm(depth)
    if plug.is_round:
        foot = cq.Vector(x, y, plug.floor_mm)
        return cq.Solid.makeCone(plug.half_mm[0] - inset, plug.half_mm[0], depth, foot, cq.Vector(0, 0, 1))
    low, high = (
        [
            cq.Vector(x + sx * (plug.half_mm[0] - less), y + sy * (plug.half_mm[1] - less), z)
            for sx, sy in ((-1, -1), (1, -1), (1, 1), (-1, 1))
        ]
        for less, z in ((inset, plug.floor_mm), (0.0, seat_mm))
    )
    rings = [low[::-1], high, *([low[k], low[k - 3], high[k - 3], high[k]] for k in range(4))]
    faces = [cq.Face.makeFromWires(cq.Wire.makePolygon(ring, close=True)) for ring in rings]
    return cq.Solid.makeSolid(cq.Shell.makeShell(faces))


def crown_body(plan: Plan) -> cq.Solid:
    """Sphere or cylinder whose top is the crown. It extends beyond pad and plug; the kernel's seam line is below."""
    radius, (x, y) = plan.top.radius_mm, plan.centre_mm
    centre = plan.clear_mm - radius
    if plan.top.straight is None:
        ball = cq.Solid.makeSphere(radius, cq.Vector(x, y, centre), cq.Vector(-1, 0, 0), -90, 90, 360)
        return cast(cq.Solid, ball)
    length = 2 * plan.radius_mm + 2 * BEYOND_MM
    along = cq.Vector(-1, 0, 0) if plan.top.straight == "x" else cq.Vector(0, -1, 0)
    return cq.Solid.makeCylinder(radius, length, cq.Vector(x, y, centre) - along * (length / 2), along)


def _pin(hole: Hole) -> tuple[cq.Solid, cq.Solid]:
    up, chamfer = cq.Vector(0, 0, 1), pin_chamfer_mm(hole)
    foot = cq.Vector(hole.x, hole.y, hole.z0)
    end = cq.Solid.makeCone(hole.radius - chamfer, hole.radius, chamfer, foot, up)
    return end, cq.Solid.makeCylinder(
        hole.radius, hole.z1 - hole.z0 - chamfer, foot + cq.Vector(0, 0, chamfer), up
    )


def _notch(notch: Notch) -> cq.Solid:
    cut = notch.cut
    reach = replace(cut, out1=cut.out1 + BEYOND_MM, floor=cut.floor - BEYOND_MM)
    return cut_solid(notch.frame, reach)
