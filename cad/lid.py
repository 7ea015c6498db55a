r"""The lid that casts a crowned top: it lies on the rim while the mold is filled upside down through its floor.

Cut through, as it lies on the mold, for a dome and for a cylinder whose middle line is level with the rim:

      ______________________________         ______________________________  back
     |            _____             |       |                              |
     |_   __..---'     '---..__   __|       |_   ______          ______   _|  seat: on the rim of the mold
     notch | |    dish        | |             | | \     ''----''     / | |    plug, sides drafted
           |_|                |_|             |_|  '                '  |_|    pins, in the fixing holes

The dish is the pad's top. Above the rim it is sunk into the flange; below the rim it is the end of a plug that fills
the cavity's plan, of a disc a circle within its facets. Around the plug silicone rises to the rim: a ridge as wide as
the play and the draft, of a disc up to the round wall. A plug less deep than `LEAST_PLUG_MM` is left out.

Printed on its back, dish up, without support: the file is turned over about the middle line along x.
"""

from __future__ import annotations

from dataclasses import replace
from typing import cast

import cadquery as cq

from cad.lid_size import Notch, Plug, lid_size, pin_chamfer_mm
from cad.mold import BEYOND_MM, cut_solid, outer_prism
from design.mold.outline import outline_of
from design.mold.sockets import Hole
from design.shape.plan import Plan
from design.spec import SensorDesign


def lid(design: SensorDesign) -> cq.Workplane | None:
    """The lid as it lies on the mold, in the cavity frame; None for a flat top."""
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
    pins = [solid for hole in size.pins for solid in _pin(hole)]  # last: the crown's body reaches to them
    pieces = body.fuse(*pins).Solids() if pins else body.Solids()
    assert len(pieces) == 1, f"{design.name}: the lid falls into {len(pieces)} pieces"
    return cq.Workplane(obj=pieces[0])


def _frustum(plug: Plug, centre_mm: tuple[float, float], seat_mm: float) -> cq.Solid:
    """The plug before the dish is cut: a cone's or a pyramid's frustum, widest at the seat."""
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
    """The crown's sphere or cylinder, wider than the pad and deeper than any plug; its seam is below."""
    radius, (x, y) = plan.top.radius_mm, plan.centre_mm
    centre = plan.clear_mm - radius
    if plan.top.straight is None:
        ball = cq.Solid.makeSphere(radius, cq.Vector(x, y, centre), cq.Vector(-1, 0, 0), -90, 90, 360)
        return cast(cq.Solid, ball)
    length = 2 * plan.radius_mm + 2 * BEYOND_MM
    along = cq.Vector(-1, 0, 0) if plan.top.straight == "x" else cq.Vector(0, -1, 0)
    return cq.Solid.makeCylinder(radius, length, cq.Vector(x, y, centre) - along * (length / 2), along)


def _pin(hole: Hole) -> tuple[cq.Solid, cq.Solid]:
    """Cylinder and chamfered end."""
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
