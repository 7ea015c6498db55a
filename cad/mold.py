r"""The mold: one printed part with the cavity, the sockets, the pour lip and the fixing holes.

Seen from above (L-shaped marks: sockets open to the cavity and upward), and cut through a receiver:

      y ^  o---------------------------o  outer_width_mm
        |  | (o)   _  _     _  _   (o) |
        |  |    __| || |___| || |__    |          top  ___               ____ _  rim_mm
        |  |   |                   |   |              |   \             |    | |
        |  |   |_     cavity      _|   |              |    |~~ fill ~~~~|pkt | |  z = clear
        |  |   |_  length x width _|   |              |    |            |    | |
        |  |   |__   __   __   ____|   |              |    |            |____|_|  body base - clearance
        |  |      |_||_| |_||_|        |              |    |__ black ___| ||   |  z = 0
        |  | (o)   ||     ||       (o) |              |                   ||   |  z = -black
        |  /----||-----||-------------o               |___________________||___|  z = -black - floor
        +--> x  origin corner cut at 45 deg              wall        lead holes

The silicone's undisturbed top is where the lip starts, if the rim is no higher than the lip: pour to that
line. A label is sunk into the underside (`design.mold_label`). All numbers come from `design.mold_outline`; the
frame is that of `design.cavity` (files are lifted onto the bed by `cad.export`).
"""

from __future__ import annotations

from itertools import pairwise
from typing import cast

import cadquery as cq

from design.mold_label import Stroke
from design.mold_outline import MoldOutline, outline_of
from design.rules import require_valid
from design.sockets import Cut, Hole, Socket
from design.spec import SensorDesign

BEYOND_MM = 1.0
"""Cutters reach this far past the faces they open, so that no two faces coincide there."""


def build_mold(design: SensorDesign) -> cq.Workplane:
    """The mold as one solid in the cavity frame.

    Raises
    ------
    DesignError : the design breaks a rule, such as a web that is too thin; nothing has been built.
    """
    require_valid(design)
    outline = outline_of(design)
    cutters = [_mouth(outline)]
    for socket in outline.sockets:
        cutters += _socket_cutters(socket, outline)
    cutters += [_drill(hole) for hole in outline.fixing_holes]
    cutters += [_engraved(stroke, outline) for stroke in outline.label.strokes]
    pieces = _block(outline).cut(*cutters).Solids()
    assert len(pieces) == 1, f"{design.name}: the mold falls into {len(pieces)} pieces"
    return cq.Workplane(obj=pieces[0])


def _block(outline: MoldOutline) -> cq.Solid:
    """Outer prism with rounded edges and the cut at the origin's corner."""
    corner = (-outline.wall_x_mm, -outline.wall_y_mm, outline.bottom_mm)
    block = cq.Workplane("XY").box(
        outline.outer_length_mm, outline.outer_width_mm, outline.height_mm, centered=False
    )
    if outline.corner_radius_mm > 0:
        block = block.edges("|Z and (>X or >Y)").fillet(outline.corner_radius_mm)
    if outline.origin_cut_mm > 0:
        block = block.edges("|Z and <X and <Y").chamfer(outline.origin_cut_mm)
    return cast(cq.Solid, block.translate(corner).val())


def _mouth(outline: MoldOutline) -> cq.Solid:
    """Cavity and flared lip as one polyhedron, up past the rim."""
    foot, knee = outline.cavity_bottom_mm, outline.top_mm - outline.lip_mm
    if outline.lip_mm == 0:
        knee = outline.top_mm + BEYOND_MM
    rings = [_ring(outline, 0.0, foot), _ring(outline, 0.0, knee)]
    if outline.lip_mm > 0:
        rings.append(_ring(outline, outline.lip_mm + BEYOND_MM, outline.top_mm + BEYOND_MM))
    faces = [_polygon(rings[0][::-1]), _polygon(rings[-1])]
    for low, high in pairwise(rings):
        faces += [_polygon([low[k], low[(k + 1) % 4], high[(k + 1) % 4], high[k]]) for k in range(4)]
    return cq.Solid.makeSolid(cq.Shell.makeShell(faces))


def _ring(outline: MoldOutline, out: float, z: float) -> list[cq.Vector]:
    x0, x1, y0, y1 = -out, outline.length_mm + out, -out, outline.width_mm + out
    return [cq.Vector(x, y, z) for x, y in ((x0, y0), (x1, y0), (x1, y1), (x0, y1))]


def _polygon(points: list[cq.Vector]) -> cq.Face:
    return cq.Face.makeFromWires(cq.Wire.makePolygon(points, close=True))


def _socket_cutters(socket: Socket, outline: MoldOutline) -> list[cq.Solid]:
    reaches_floor = socket.pocket.floor < outline.cavity_bottom_mm
    into_cavity = 0.0 if reaches_floor else BEYOND_MM
    cutters = [_slab(socket, socket.pocket, socket.pocket.out0 - into_cavity, socket.pocket.out1)]
    cutters += [_slab(socket, slot, slot.out0, slot.out1 + BEYOND_MM) for slot in socket.slots]
    return cutters + [_drill(hole) for hole in socket.holes]


def _slab(socket: Socket, cut: Cut, out0: float, out1: float) -> cq.Solid:
    box = socket.frame.box(
        Cut(
            along0=cut.along0,
            along1=cut.along1,
            out0=out0,
            out1=out1,
            floor=cut.floor,
            top=cut.top + BEYOND_MM,
        )
    )
    return cq.Solid.makeBox(
        box.x1 - box.x0, box.y1 - box.y0, box.z1 - box.z0, cq.Vector(box.x0, box.y0, box.z0)
    )


def _engraved(stroke: Stroke, outline: MoldOutline) -> cq.Solid:
    """A stroke of the label, from below the bed up into the floor."""
    return cq.Solid.makeBox(
        stroke.x1 - stroke.x0,
        stroke.y1 - stroke.y0,
        outline.label.depth_mm + BEYOND_MM,
        cq.Vector(stroke.x0, stroke.y0, outline.bottom_mm - BEYOND_MM),
    )


def _drill(hole: Hole) -> cq.Solid:
    foot = cq.Vector(hole.x, hole.y, hole.z0 - BEYOND_MM)
    return cq.Solid.makeCylinder(hole.radius, hole.z1 - hole.z0 + 2 * BEYOND_MM, foot, cq.Vector(0, 0, 1))
