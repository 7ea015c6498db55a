"""A rectangle with half-round ends as an outline, put together by hand."""

from __future__ import annotations

import math
from collections.abc import Sequence

from design.shape.outline import Arc, Line, Outline, Point


def stadium(
    length_mm: float, width_mm: float, directions_deg: Sequence[float] = (), half_mm: float = 1.5
) -> Outline:
    """Two straight walls and two half circles, with a facet of twice a half width in each direction."""
    radius = width_mm / 2
    west, east = (radius, radius), (length_mm - radius, radius)
    along, run = (1.0, 0.0), length_mm - width_mm
    south = Line(name="south", origin=(radius, 0.0), tangent=along, outward=(0.0, -1.0), length_mm=run)
    north = Line(name="north", origin=(radius, width_mm), tangent=along, outward=(0.0, 1.0), length_mm=run)
    lines, arcs = [south, north], []
    for centre, start in ((west, math.pi / 2), (east, -math.pi / 2)):
        turns = sorted((math.radians(one) - start) % (2.0 * math.pi) for one in directions_deg)
        turns = [turn for turn in turns if turn < math.pi]
        half, at = math.asin(half_mm / radius), 0.0
        for turn in turns:
            lines.append(_facet(centre, radius, start + turn, half_mm))
            arcs.append(
                Arc(centre_mm=centre, radius_mm=radius, start_rad=start + at, turn_rad=turn - half - at)
            )
            at = turn + half
        arcs.append(Arc(centre_mm=centre, radius_mm=radius, start_rad=start + at, turn_rad=math.pi - at))
    return Outline(kind="disc", box_mm=(0.0, 0.0, length_mm, width_mm), lines=tuple(lines), arcs=tuple(arcs))


def _facet(centre: Point, radius: float, turn_rad: float, half: float) -> Line:
    outward = math.cos(turn_rad), math.sin(turn_rad)
    tangent, away = (-outward[1], outward[0]), math.sqrt(radius**2 - half**2)
    return Line(
        name=f"{math.degrees(turn_rad):g}-degree",
        origin=(
            centre[0] + away * outward[0] - half * tangent[0],
            centre[1] + away * outward[1] - half * tangent[1],
        ),
        tangent=tangent,
        outward=outward,
        length_mm=2.0 * half,
    )
