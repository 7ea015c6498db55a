r"""The mold as a CAD solid: a printed part with the cavity, the sockets, the pour lip and the fixing holes.

View from above (L-shaped marks: sockets open to the cavity and upward), and cross-section through a receiver:

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

The pour lip is a bevel at the cavity's upper edge. If the rim is no higher than the lip, the lip starts at the
silicone's undisturbed top, so that the user pours to that line. In a design with a glass cover, a seat at that height
replaces the lip. Names of the optical parts are engraved in the outer faces (`optopad.design.mold.part_numbers`), and a
label in the underside (`optopad.design.mold.label`). Bodies taller than the rim have collars
(`optopad.design.mold.sockets`). The mold may be divided at the cavity's floor.

A mold with round walls follows the cavity's outline. A round wall has a flat facet for each optical part. Sockets are
perpendicular to their facets, and wire slots, lead channels and names end in the round outer face:

           ____----____            arcs between facets, chords at facets: one exact outline, moved up past the rim
        .-'   _|  |_   '-.
       /   .-'______'-.   \
      |   /            \   |
     _|__/              \__|_

If all parts are on the floor, the mold is a frame without floor and sockets, which stands on their circuit board.

The mold of a crowned pad has no lip, because a lid (`optopad.cad.lid`) shapes the top, and silicone enters through
holes in the floor, or through passages in the walls of a frame. All dimensions come from `optopad.design.mold.outline`.
The solid is in the cavity's coordinate system (`optopad.design.shape.cavity`); `optopad.cad.export` lifts it onto the
print bed.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from typing import cast

import cadquery as cq

from optopad.design.mold import part_numbers
from optopad.design.mold.filling import Passage
from optopad.design.mold.lettering import Loop, Shape, shapes_of
from optopad.design.mold.outline import MoldOutline, outline_of
from optopad.design.mold.part_numbers import PartNumber
from optopad.design.mold.sockets import Box, Cut, Hole, Socket, WallFrame
from optopad.design.rules.check import require_valid
from optopad.design.shape.outline import Line, Outline
from optopad.design.spec import SensorDesign

BEYOND_MM = 1.0
"""Length by which cutting solids extend beyond the faces that they cut, so that no two faces coincide there."""


def build_mold(design: SensorDesign) -> cq.Workplane:
    """Build the mold as one CAD solid in the cavity's coordinate system [mm].

    Raises
    ------
    DesignError : the design breaks a rule; for example, a web is too thin.
    """
    require_valid(design)
    outline = outline_of(design)
    cutters = _mouth(outline)
    for socket in outline.sockets:
        cutters += _socket_cutters(socket, outline)
    cutters += [_drill(hole) for hole in (*outline.fixing_holes, *outline.filling)]
    cutters += [_bored(passage, outline) for passage in outline.passages]
    cutters += [solid for number in outline.numbers for solid in _engraved(number)]
    cutters += _label(outline)
    pieces = _block(outline).cut(*cutters).Solids()
    assert len(pieces) == 1, f"{design.name}: the mold falls into {len(pieces)} pieces"
    return cq.Workplane(obj=pieces[0])


def part_mold(mold: cq.Workplane, outline: MoldOutline) -> tuple[cq.Workplane, cq.Workplane]:
    """Cut a mold at the cavity's floor; return the part above, called the mold's frame, and the base below."""
    low, high = outline.bottom_mm - BEYOND_MM, outline.highest_mm + BEYOND_MM
    found = []
    for z0, z1 in ((outline.cavity_bottom_mm, high), (low, outline.cavity_bottom_mm)):
        corner = cq.Vector(-outline.wall_x_mm - BEYOND_MM, -outline.wall_y_mm - BEYOND_MM, z0)
        room = cq.Solid.makeBox(
            outline.outer_length_mm + 2 * BEYOND_MM, outline.outer_width_mm + 2 * BEYOND_MM, z1 - z0, corner
        )
        pieces = cast(cq.Shape, mold.val()).intersect(room).Solids()
        assert len(pieces) == 1, f"a half of the mold falls into {len(pieces)} pieces"
        found.append(cq.Workplane(obj=pieces[0]))
    return found[0], found[1]


def _block(outline: MoldOutline) -> cq.Solid:
    """The mold before any cuts: the extruded outline and the collars for tall bodies."""
    solid = outer_prism(outline, outline.bottom_mm, outline.height_mm)
    collars = [_filled(collar.box) for collar in outline.collars]
    return cast(cq.Solid, solid.fuse(*collars).clean()) if collars else solid


def outer_prism(outline: MoldOutline, foot_mm: float, height_mm: float) -> cq.Solid:
    """Extrude the outer outline: round for a round pad, else with rounded edges and a bevel at the origin's corner.

    Parameters
    ----------
    foot_mm : z coordinate of the underside
    height_mm : height of the prism
    """
    block = cq.Workplane(obj=prism(outline.outer, foot_mm, height_mm))
    if outline.corner_radius_mm > 0:
        block = block.edges("|Z and (>X or >Y)").fillet(outline.corner_radius_mm)
    if outline.origin_cut_mm > 0:
        block = block.edges("|Z and <X and <Y").chamfer(outline.origin_cut_mm)
    return cast(cq.Solid, block.val())


def _filled(box: Box) -> cq.Solid:
    return cq.Solid.makeBox(
        box.x1 - box.x0, box.y1 - box.y0, box.z1 - box.z0, cq.Vector(box.x0, box.y0, box.z0)
    )


def _mouth(outline: MoldOutline) -> list[cq.Solid]:
    """Cutting solids for the cavity with its lip or with the cover's seat, extended past the rim."""
    if outline.lip_mm:
        return [_flared(outline)]
    inside, foot = outline.plan.outline, _foot_mm(outline)
    if not outline.ledge_mm:
        return [prism(inside, foot, outline.top_mm + BEYOND_MM - foot)]
    seat = _filled(replace(outline.mouth, z1=outline.top_mm + BEYOND_MM))
    return [prism(inside, foot, outline.top_mm - foot), seat]


def _foot_mm(outline: MoldOutline) -> float:
    """Height z of the lower end of the cavity's cutting solid, which passes the underside of a frame [mm]."""
    return outline.cavity_bottom_mm - (BEYOND_MM if outline.is_frame else 0.0)


def prism(outline: Outline, foot_mm: float, height_mm: float) -> cq.Solid:
    """Extrude an outline upward from z = `foot_mm`."""
    edges, up = [], cq.Vector(0, 0, 1)
    for one in outline.loop:
        if isinstance(one, Line):
            edges.append(cq.Edge.makeLine(*(cq.Vector(*end, foot_mm) for end in one.ends)))
        else:
            start = math.degrees(one.start_rad)
            turn, centre = math.degrees(one.turn_rad), cq.Vector(*one.centre_mm, foot_mm)
            edges.append(cq.Edge.makeCircle(one.radius_mm, centre, up, start, start + turn))
    around = cq.Wire.assembleEdges(edges)
    return cq.Solid.extrudeLinear(around, [], cq.Vector(0, 0, height_mm))


def _flared(outline: MoldOutline) -> cq.Solid:
    """Cutting solid for the cavity and its bevelled lip, as one polyhedron."""
    foot, knee = _foot_mm(outline), outline.top_mm - outline.lip_mm
    rings = [_ring(outline, 0.0, foot), _ring(outline, 0.0, knee)]
    if not outline.collars:
        rings.append(_ring(outline, outline.lip_mm + BEYOND_MM, outline.top_mm + BEYOND_MM))
    else:  # straight up past the rim, because collars are right behind the lip
        rings += [_ring(outline, outline.lip_mm, z) for z in (outline.top_mm, outline.top_mm + BEYOND_MM)]
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
    through = socket.necks or socket.slots
    for way in (*socket.slots, *socket.necks):
        cutters.append(_slab(socket, way, way.out0, way.out1 + (BEYOND_MM if way in through else 0.0)))
    if socket.channel is not None:
        beyond = replace(socket.channel, floor=socket.channel.floor - BEYOND_MM)
        outward = replace(beyond, out1=beyond.out1 + BEYOND_MM)
        cutters.append(cut_solid(socket.frame, outward))
    return cutters + [_drill(hole) for hole in socket.holes]


def _slab(socket: Socket, cut: Cut, out0: float, out1: float) -> cq.Solid:
    reach = replace(cut, out0=out0, out1=out1, top=cut.top + BEYOND_MM)
    return cut_solid(socket.frame, reach)


def cut_solid(frame: WallFrame, cut: Cut) -> cq.Solid:
    """Cutting solid for a cut in a wall: a box, rotated if the wall is a facet of a round wall."""
    if frame.runs_along_axes:
        return _filled(frame.box(cut))
    corners = [cq.Vector(x, y, cut.floor) for x, y in reversed(frame.corners(cut))]
    up = cq.Vector(0, 0, cut.top - cut.floor)
    return cq.Solid.extrudeLinear(cq.Wire.makePolygon(corners, close=True), [], up)


def _engraved(number: PartNumber) -> list[cq.Solid]:
    """Cutting solids for a part's engraved name, from beyond the outer face into the wall."""
    frame = number.frame
    x0, y0 = frame.point(0.0, frame.thickness_mm + BEYOND_MM)
    x1, y1 = frame.point(0.0, frame.thickness_mm - part_numbers.DEPTH_MM)

    def place(loop: Loop) -> cq.Wire:
        points = ((*frame.point(along, frame.thickness_mm + BEYOND_MM), z) for along, z in loop)
        return cq.Wire.makePolygon([cq.Vector(*point) for point in points], close=True)

    return [_prism(shape, place, cq.Vector(x1 - x0, y1 - y0, 0.0)) for shape in shapes_of(number.strokes)]


def _label(outline: MoldOutline) -> list[cq.Solid]:
    """Cutting solids for the label, from below the mold up into its floor."""
    foot = outline.bottom_mm - BEYOND_MM

    def place(loop: Loop) -> cq.Wire:
        return cq.Wire.makePolygon([cq.Vector(x, y, foot) for x, y in loop], close=True)

    up = cq.Vector(0.0, 0.0, outline.label.depth_mm + BEYOND_MM)
    return [_prism(shape, place, up) for shape in shapes_of(outline.label.strokes)]


def _prism(shape: Shape, place: Callable[[Loop], cq.Wire], way: cq.Vector) -> cq.Solid:
    """Extrude a flat shape along the vector `way`; `place` converts the shape's loops to wires in space."""
    return cq.Solid.extrudeLinear(place(shape.outline), [place(hole) for hole in shape.holes], way)


def _bored(passage: Passage, outline: MoldOutline) -> cq.Solid:
    """Cutting solid for a passage, from inside the cavity to beyond the outer face, and past a frame's underside."""
    (x, y), (dx, dy) = passage.start_mm, passage.way
    x, y = x - BEYOND_MM * dx, y - BEYOND_MM * dy
    low = passage.z0 - (BEYOND_MM if passage.z0 <= outline.bottom_mm else 0.0)
    section = ((across, low if z == passage.z0 else z) for across, z in passage.section_mm)
    corners = [cq.Vector(x - across * dy, y + across * dx, z) for across, z in section]
    length = passage.length_mm + 2 * BEYOND_MM
    return cq.Solid.extrudeLinear(
        cq.Wire.makePolygon(corners, close=True), [], cq.Vector(length * dx, length * dy, 0.0)
    )


def _drill(hole: Hole) -> cq.Solid:
    foot = cq.Vector(hole.x, hole.y, hole.z0 - BEYOND_MM)
    return cq.Solid.makeCylinder(hole.radius, hole.z1 - hole.z0 + 2 * BEYOND_MM, foot, cq.Vector(0, 0, 1))
