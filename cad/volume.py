"""Volumes of the printed parts by formula, to hold the solids and the files against.

The mold is its outer prism less cuts that do not overlap, except that pockets and slots share the
pour lip's wedge. With the wedge removing max(0, c - t) of height at distance t behind the inner
face (c: leg of the lip), a cut of width b from t0 to t1 shares

    b * integral of max(0, c - t) dt = b / 2 * ((c - t0)+^2 - (c - t1)+^2)

with it. That is exact as long as every cut lies within its wall's inner length and its floor lies
below the lip, which `design.geometry.webs` makes sure of. The lip itself is a frustum with mitred corners:

    integral over 0..c of (L + 2s)(W + 2s) - L W ds = (L + W) c^2 + 4/3 c^3

A cover's seat takes ((L + 2s)(W + 2s) - L W) x rim instead, and shares with a cut of width b what lies before s:
b x min(s, t1) x rim from the wall on. Collars stand on the rim behind lip or seat, and cuts go up through them.
"""

from __future__ import annotations

import math
from dataclasses import replace

from design.geometry.mold_outline import MoldOutline, outline_of
from design.geometry.raised_sockets import Collar
from design.geometry.sockets import Cut, Hole
from design.spec import SensorDesign


def mold_volume_mm3(design: SensorDesign) -> float:
    """Volume of the printed mold [mm3]."""
    outline = outline_of(design)
    cuts = [_below_rim(cut, outline) for socket in outline.sockets for cut in socket.cuts]
    channels = [socket.channel for socket in outline.sockets if socket.channel is not None]
    holes = [hole for socket in outline.sockets for hole in socket.holes]
    return (
        _prism_mm3(outline)
        - outline.length_mm * outline.width_mm * (outline.top_mm - outline.cavity_bottom_mm)
        - lip_volume_mm3(outline)
        - _seat_mm3(outline)
        + sum(_collar_mm3(collar, outline) for collar in outline.collars)
        - sum(_cut_mm3(cut) - shared_with_lip_mm3(cut, outline.lip_mm) for cut in cuts)
        + sum(_shared_with_seat_mm3(cut, outline) for cut in cuts)
        - sum(_cut_mm3(channel) for channel in channels)
        - sum(number.volume_mm3 for number in outline.numbers)
        - sum(_hole_mm3(hole) for hole in (*holes, *outline.fixing_holes))
        - outline.label.area_mm2 * outline.label.depth_mm
    )


def base_volume_mm3(design: SensorDesign) -> float:
    """Volume of the mold below the cavity's floor: the base of a parted mold [mm3]."""
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
    """Volume that the pour lip takes from a rim without sockets [mm3]."""
    leg = outline.lip_mm
    return (outline.length_mm + outline.width_mm) * leg**2 + 4 / 3 * leg**3


def shared_with_lip_mm3(cut: Cut, lip_mm: float) -> float:
    """Volume that a pocket or slot and the pour lip both take [mm3]."""
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
    return outline.outer_length_mm * outline.outer_width_mm - rounded - outline.origin_cut_mm**2 / 2


def _cut_mm3(cut: Cut) -> float:
    return (cut.along1 - cut.along0) * (cut.out1 - cut.out0) * (cut.top - cut.floor)


def _hole_mm3(hole: Hole) -> float:
    return math.pi * hole.radius**2 * (hole.z1 - hole.z0)
