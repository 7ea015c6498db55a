"""Volumes of the printed parts by formula, for comparison with the CAD solids and the files.

The mold is its extruded outline minus its cuts. The cuts do not overlap, except that pockets and slots share volume
with the pour lip, a bevel at the cavity's upper edge. At distance t behind the inner face, the bevel removes the height
(c - t)+ = max(0, c - t), where c is the bevel's height and width. A cut of width b from t0 to t1 shares with it the
volume

    b * integral of (c - t)+ dt = b / 2 * ((c - t0)+^2 - (c - t1)+^2)

This is exact if every cut is within its wall's inner length and its floor is below the lip; `optopad.design.mold.webs`
ensures both. For a cavity of length L and width W, the lip itself is a frustum with mitred corners:

    integral over 0..c of (L + 2s)(W + 2s) - L W ds = (L + W) c^2 + 4/3 c^3

For a glass cover, a seat of width s replaces the lip and removes ((L + 2s)(W + 2s) - L W) x rim. A cut of width b
shares b x min(s, t1) x rim with it. Collars are on the rim behind the lip or seat, and cuts extend up through them.

In a round mold a cut may end in the round outer face. Let d be the distance of the wall's flat facet from the centre, R
the outer radius, and b the distance along the facet from its middle. The outer face is then at T = sqrt(R^2 - b^2) - d
behind the facet. The area of a cut up to a depth t is the integral of min(T, t) over b. The integrand is t where
|b| < sqrt(R^2 - (d + t)^2), and T elsewhere; the integral of T is part of the area of a circle.

The tools' cuts touch but do not overlap.

The lid (`optopad.cad.lid`) is its flange, pins and plug, minus notches and the part of the crown above the seat. This
part is a spherical cap for a dome and nothing for a cylinder. The plug is integrated over horizontal cross-sections,
which the draft makes smaller with depth. The crown, of radius C, covers the middle of a cross-section up to the half
width C sin(q), where C (1 - cos(q)) is the distance below the crown's highest point. The remaining area has a closed
form for a circular or rectangular plug under a dome or cylinder. Gauss' rule integrates it with q as the variable, in
pieces between the depths at which the crown's edge meets a side or a corner of the plug. The relative error is 1e-9
with 48 nodes.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import replace
from itertools import pairwise

import numpy as np

from optopad.cad import tools
from optopad.cad.lid import Plug, lid_size, pin_chamfer_mm
from optopad.cad.tools import BladeSize, GaugeSize, JigSize, shank_mm
from optopad.design.mold.lettering import Stroke, area_mm2, shapes_of
from optopad.design.mold.outline import MoldOutline, outline_of
from optopad.design.mold.part_numbers import DEPTH_MM, PartNumber
from optopad.design.mold.sockets import Collar, Cut, Hole, WallFrame
from optopad.design.shape.top import Top
from optopad.design.spec import SensorDesign
from optopad.design.spec.indenter import Indenter, Piece, tip_outline

NODES = 48
"""Number of nodes of Gauss' rule in each piece of the integral over the depth of a plug."""


def mold_volume_mm3(design: SensorDesign) -> float:
    """Volume of the printed mold [mm3]."""
    outline = outline_of(design)
    holes = [hole for socket in outline.sockets for hole in socket.holes]
    return (
        _prism_mm3(outline)
        - outline.plan.area_mm2 * (outline.top_mm - outline.cavity_bottom_mm)
        - lip_volume_mm3(outline)
        - _seat_mm3(outline)
        + sum(_collar_mm3(collar, outline) for collar in outline.collars)
        - _socket_cuts_mm3(outline)
        - sum(_number_mm3(number) for number in outline.numbers)
        - sum(_hole_mm3(hole) for hole in (*holes, *outline.fixing_holes, *outline.filling))
        - outline.label.area_mm2 * outline.label.depth_mm
    )


def _socket_cuts_mm3(outline: MoldOutline) -> float:
    """Volume of the sockets' pockets, slots, necks and lead channels, less the volume shared with lip or seat [mm3]."""
    channels = [(s.frame, s.channel) for s in outline.sockets if s.channel is not None]
    below = [(s.frame, _below_rim(cut, outline)) for s in outline.sockets for cut in s.cuts]
    return (
        sum(cut_in_frame_mm3(frame, cut) for frame, cut in (*below, *channels))
        - sum(shared_with_lip_mm3(cut, outline.lip_mm) for _, cut in below)
        - sum(_shared_with_seat_mm3(cut, outline) for _, cut in below)
    )


def cut_in_frame_mm3(frame: WallFrame, cut: Cut) -> float:
    """Volume of a cut in a wall, which may have a round outer face [mm3]."""
    if not frame.is_facet:
        return _cut_mm3(cut)
    area = _before_mm2(frame, cut, cut.out1) - _before_mm2(frame, cut, cut.out0)
    return area * (cut.top - cut.floor)


def _before_mm2(frame: WallFrame, cut: Cut, level_mm: float) -> float:
    """Area of a cut in a round wall, from the facet outward to `level_mm` or to the outer face [mm2]."""
    radius, middle = frame.outer_radius_mm, frame.length_mm / 2
    stands = radius - frame.thickness_mm
    full = math.sqrt(max(radius**2 - (stands + level_mm) ** 2, 0.0))

    def up_to(beside: float) -> float:
        inner = max(-full, min(full, beside))
        return (
            level_mm * inner
            + _circle_mm2(beside, radius)
            - _circle_mm2(inner, radius)
            - stands * (beside - inner)
        )

    return up_to(cut.along1 - middle) - up_to(cut.along0 - middle)


def _circle_mm2(x: float, radius: float) -> float:
    """Integral from 0 to x of sqrt(radius^2 - x^2), with x limited to +-radius."""
    share = max(-1.0, min(1.0, x / radius))
    return radius**2 / 2 * (share * math.sqrt(1 - share * share) + math.asin(share))


def base_volume_mm3(design: SensorDesign) -> float:
    """Volume of the mold below the cavity's floor, which is the base of a parted mold [mm3]."""
    outline = outline_of(design)
    joint, height = outline.cavity_bottom_mm, outline.cavity_bottom_mm - outline.bottom_mm
    cuts = [cut for socket in outline.sockets for cut in socket.cuts if cut.floor < joint]
    channels = [socket.channel for socket in outline.sockets if socket.channel is not None]
    holes = [hole for socket in outline.sockets for hole in socket.holes]
    return (
        _section_mm2(outline) * height
        - sum(_cut_mm3(replace(cut, top=joint)) for cut in cuts)
        - sum(_cut_mm3(channel) for channel in channels)
        - sum(_hole_mm3(replace(hole, z1=min(hole.z1, joint))) for hole in (*holes, *outline.fixing_holes))
        - outline.label.area_mm2 * outline.label.depth_mm
    )


def lip_volume_mm3(outline: MoldOutline) -> float:
    """Volume that the pour lip would remove from a rim without sockets [mm3]."""
    leg = outline.lip_mm
    return (outline.length_mm + outline.width_mm) * leg**2 + 4 / 3 * leg**3


def shared_with_lip_mm3(cut: Cut, lip_mm: float) -> float:
    """Volume that a pocket or slot shares with the pour lip [mm3].

    Parameters
    ----------
    lip_mm : height and width of the lip's bevel
    """
    near, far = max(lip_mm - cut.out0, 0.0), max(lip_mm - cut.out1, 0.0)
    return (cut.along1 - cut.along0) * (near**2 - far**2) / 2


def _below_rim(cut: Cut, outline: MoldOutline) -> Cut:
    return replace(cut, top=min(cut.top, outline.top_mm))


def _seat_mm3(outline: MoldOutline) -> float:
    ledge = outline.ledge_mm
    ring = (outline.length_mm + 2 * ledge) * (
        outline.width_mm + 2 * ledge
    ) - outline.length_mm * outline.width_mm
    return ring * (outline.top_mm - outline.fill_mm)


def _shared_with_seat_mm3(cut: Cut, outline: MoldOutline) -> float:
    before = max(min(outline.ledge_mm, cut.out1) - cut.out0, 0.0)
    return (cut.along1 - cut.along0) * before * (outline.top_mm - outline.fill_mm)


def _collar_mm3(collar: Collar, outline: MoldOutline) -> float:
    block, cuts = collar.block, [s.cuts for s in outline.sockets if s.part.name in collar.names]
    cut_mm2 = sum(
        (cut.along1 - cut.along0) * max(min(cut.out1, block.out1) - max(cut.out0, block.out0), 0.0)
        for of_socket in cuts
        for cut in of_socket
    )
    area = (block.along1 - block.along0) * (block.out1 - block.out0) - cut_mm2
    return area * (block.top - block.floor)


def _prism_mm3(outline: MoldOutline) -> float:
    return _section_mm2(outline) * outline.height_mm


def _section_mm2(outline: MoldOutline) -> float:
    rounded = 3 * (1 - math.pi / 4) * outline.corner_radius_mm**2
    return outline.outer.area_mm2 - rounded - outline.origin_cut_mm**2 / 2


def _cut_mm3(cut: Cut) -> float:
    return (cut.along1 - cut.along0) * (cut.out1 - cut.out0) * (cut.top - cut.floor)


def _number_mm3(number: PartNumber) -> float:
    """Volume that a part's name removes from the mold [mm3], less where a round outer face recedes from the facet."""
    flat = area_mm2(number.strokes) * DEPTH_MM
    if not number.frame.is_facet:
        return flat
    middle, radius = number.frame.length_mm / 2, number.frame.outer_radius_mm
    return flat - _over_strokes(number.strokes, lambda x: _below_chord_mm2(x - middle, radius))


def _over_strokes(strokes: Iterable[Stroke], antiderivative: Callable[[float], float]) -> float:
    """Integral of a function of x over the area covered by strokes, along its edges (Green's theorem)."""
    loops = [loop for shape in shapes_of(strokes) for loop in (shape.outline, *shape.holes)]
    edges = [edge for loop in loops for edge in zip(loop, (*loop[1:], loop[0]), strict=True)]
    return sum(antiderivative(x) * (top - y) for (x, y), (_, top) in edges if top != y)


def _below_chord_mm2(beside_mm: float, radius_mm: float) -> float:
    """Area between a circle and its tangent, from the point of contact to `beside_mm` along the tangent [mm2]."""
    return radius_mm * beside_mm - _circle_mm2(beside_mm, radius_mm)


def _hole_mm3(hole: Hole) -> float:
    return math.pi * hole.radius**2 * (hole.z1 - hole.z0)


def lid_volume_mm3(design: SensorDesign) -> float:
    """Volume of the printed lid [mm3]; 0 for a flat top."""
    outline, size = outline_of(design), lid_size(design)
    if size is None:
        return 0.0
    top = outline.plan.top
    over = outline.plan.clear_mm - size.seat_mm
    return (
        _section_mm2(outline) * size.flange_mm
        + sum(_pin_mm3(pin) for pin in size.pins)
        - sum(cut_in_frame_mm3(notch.frame, notch.cut) for notch in size.notches)
        + (plug_volume_mm3(size.plug, top, over) if size.plug is not None else 0.0)
        - (_cap_mm3(top.radius_mm, over) if over > 0 else 0.0)
    )


def _pin_mm3(pin: Hole) -> float:
    chamfer, radius = pin_chamfer_mm(pin), pin.radius
    end = radius - chamfer
    cone = math.pi * chamfer / 3 * (radius**2 + radius * end + end**2)
    return math.pi * radius**2 * (pin.z1 - pin.z0 - chamfer) + cone


def _cap_mm3(radius: float, height: float) -> float:
    return math.pi * height**2 * (3 * radius - height) / 3


def plug_volume_mm3(plug: Plug, top: Top, over_mm: float) -> float:
    """Volume of a lid's plug below the flange, without the crown that is cut from it [mm3].

    Parameters
    ----------
    plug : the plug before it is cut
    top : shape and radius of the crown
    over_mm : height of the crown's highest point above the flange's underside
    """
    radius = top.radius_mm
    above = max(-over_mm, 0.0)
    whole = _gauss(lambda depth: _outside_mm2(plug, top, depth, 0.0), 0.0, above)
    ends = [
        angle for sides in _meetings(plug, top) if (angle := _meets(plug, sides, radius, over_mm)) is not None
    ]
    start = math.acos(1 - max(over_mm, 0.0) / radius)
    pieces = sorted({start, *(angle for angle in ends if angle > start)})

    def rate(angle: float) -> float:
        depth = radius * (1 - math.cos(angle)) - over_mm
        return _outside_mm2(plug, top, depth, radius * math.sin(angle)) * radius * math.sin(angle)

    return whole + sum(_gauss(rate, low, high) for low, high in pairwise(pieces))


def _outside_mm2(plug: Plug, top: Top, depth: float, level: float) -> float:
    """Area of the plug's cross-section at a depth below the flange, without the crown's cross-section [mm2].

    Parameters
    ----------
    level : radius or half width of the crown's cross-section at that depth
    """
    a, b = (half - plug.inset_mm(depth) for half in plug.half_mm)
    if plug.is_round:
        if level >= a:
            return 0.0
        half_chord = math.pi * a**2 / 4 - _circle_mm2(level, a)
        return math.pi * (a**2 - level**2) if top.straight is None else 4 * half_chord
    if top.straight is not None:
        along, across = (a, b) if top.straight == "x" else (b, a)
        return 4 * along * max(across - level, 0.0)
    return 4 * (a * b - _quarter_mm2(level, a, b))


def _quarter_mm2(radius: float, a: float, b: float) -> float:
    """Area common to a quarter disc and a rectangle a x b with a corner at the disc's centre [mm2]."""
    if radius >= math.hypot(a, b):
        return a * b
    if radius == 0.0:
        return 0.0
    flat = math.sqrt(max(radius**2 - b**2, 0.0))
    return b * flat + _circle_mm2(min(a, radius), radius) - _circle_mm2(flat, radius)


def _meetings(plug: Plug, top: Top) -> list[tuple[float, ...]]:
    """Sides and corners of the plug that the crown's edge meets.

    Each is a tuple of half widths at the flange: one for a side or a round plug, two for a corner.
    """
    a, b = plug.half_mm
    if plug.is_round:
        return [(a,)]
    if top.straight is not None:
        return [(b,)] if top.straight == "x" else [(a,)]
    return [(a,), (b,), (a, b)]


def _meets(plug: Plug, sides: tuple[float, ...], radius: float, over: float) -> float | None:
    """Angle q at which the crown's edge meets a side or corner of the plug; None if that is above the plug.

    With the crown's radius C, the slope t of the draft, half widths w and s = over + h, the depth h below the flange
    solves s (2 C - s) = sum of (w - h t)^2.
    """
    slope = plug.inset_mm(1.0)
    square = -1 - len(sides) * slope**2
    linear = 2 * (radius - over) + 2 * slope * sum(sides)
    constant = over * (2 * radius - over) - sum(side**2 for side in sides)
    root = math.sqrt(linear**2 - 4 * square * constant)
    depth = 2 * constant / (-linear - root)
    return math.acos(1 - (over + depth) / radius) if depth > 0 else None


def _gauss(rate: Callable[[float], float], low: float, high: float) -> float:
    """Integral of `rate` from `low` to `high`, by Gauss' rule."""
    nodes, weights = np.polynomial.legendre.leggauss(NODES)
    middle, half = (low + high) / 2, (high - low) / 2
    return sum(float(w) * half * rate(middle + half * float(x)) for x, w in zip(nodes, weights, strict=True))


def blade_volume_mm3(size: BladeSize) -> float:
    """Volume of a leveling blade [mm3]: bar and tongue, less the bevel's triangle."""
    bevel = min(tools.BLADE_THICKNESS_MM - tools.BLADE_EDGE_MM, size.reach_mm)
    flat = size.span_mm * tools.BLADE_GRIP_MM + size.tongue_mm * size.reach_mm
    return flat * tools.BLADE_THICKNESS_MM - size.tongue_mm * bevel**2 / 2


def gauge_volume_mm3(size: GaugeSize) -> float:
    """Volume of a pour gauge [mm3]: bar and teeth."""
    flat = size.span_mm * tools.GAUGE_GRIP_MM + tools.TOOTH_MM * sum(size.teeth_mm)
    return flat * tools.GAUGE_THICKNESS_MM


def jig_volume_mm3(size: JigSize) -> float:
    """Volume of a solder jig [mm3]: the plate less its cuts."""
    cut = sum((box.x1 - box.x0) * (box.y1 - box.y0) * (box.z1 - box.z0) for box in size.boxes)
    drilled = sum(_hole_mm3(hole) for hole in size.holes)
    return size.length_mm * size.width_mm * tools.JIG_THICKNESS_MM - cut - drilled


def indenter_tip_volume_mm3(design: SensorDesign) -> float:
    """Volume of a printed tip [mm3]: the body of revolution of the tip's outline, and the cylinder."""
    radius = design.indenter.tip_radius_mm
    return math.pi * radius**2 * shank_mm(design) + tip_volume_mm3(design.indenter)


def tip_volume_mm3(indenter: Indenter) -> float:
    """Volume of the tip between the apex and the beginning of the shank [mm3]."""
    return math.fsum(_below_mm3(piece) for piece in tip_outline(indenter))


def _below_mm3(piece: Piece) -> float:
    """Volume of revolution below a piece of the outline: the integral of pi r² dh along it [mm3]."""
    (r0, h0), (r1, h1) = piece.start, piece.end
    if piece.radius == 0.0:
        return math.pi / 3.0 * (h1 - h0) * (r0 * r0 + r0 * r1 + r1 * r1)
    return _arc_volume(piece, _angle(piece, piece.end)) - _arc_volume(piece, _angle(piece, piece.start))


def _angle(piece: Piece, point: tuple[float, float]) -> float:
    """Angle of a point on an arc [rad], measured at the arc's centre from the downward direction."""
    return math.atan2(point[0] - piece.centre[0], piece.centre[1] - point[1])


def _arc_volume(piece: Piece, angle: float) -> float:
    """Antiderivative over the angle a of pi (c + q sin a)² q sin a, for an arc of radius q centred at radius c."""
    c, q, cosine = piece.centre[0], piece.radius, math.cos(angle)
    square = 0.5 * angle - 0.25 * math.sin(2.0 * angle)
    return math.pi * (-c * c * q * cosine + 2.0 * c * q * q * square + q**3 * (cosine**3 / 3.0 - cosine))
