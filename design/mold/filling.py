"""Filling holes of a crowned pad's mold: silicone enters with the mold upside down on its lid.

The lid shapes the crown (`optopad.cad.lid`). In this position the floor is highest, so air escapes there and no filling
hole touches the optical surface. The holes of a mold with a floor are in the floor. The sprue is the hole that receives
the silicone. The clear layer is poured by weight up to the level of the black layer. Then the black layer is poured
until it rises in the vents. The silicone that remains in the holes is black.

        sprue                      vents          turned over: floor up
       ___| |_______________________| |___
      |   black                           |
      |___________________________________|
      |   clear                           |
      |__                               __|
     ____ `--.____               ____.--' ____
    |    pin      ``---.....---``        pin  |   lid, on the bench
    |_________________________________________|

The frame around a circuit board has no floor, and the board closes it. Its black layer is poured first, on the board,
and cures before the lid is put on. The clear layer then enters through passages in the middle of the four walls, level
with the black layer, which are the highest places of the cavity when the frame is upside down:

       ____________________________________
      |____ board ___________________________|
      |   black                              |
   ->  passage (sprue)         passage (vent)  ->
      |   clear                              |

A passage has a flat side at the black layer and a gable at 45 degrees, so that it prints without support.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from optopad.design.mold.sockets import Hole
from optopad.design.shape.cavity import Plan
from optopad.design.shape.outline import Outline, Point

SPRUE_RADIUS_MM, VENT_RADIUS_MM = 2.0, 1.0
"""Radii of sprue and vents. A syringe's tip fits into the sprue; silicone rises in the vents when the mold is full."""
INSET_MM = 3.0
"""Distance of the middle of each sprue or vent from the cavity's walls."""

PASSAGE_MM, LEAST_PASSAGE_MM = 4.0, 2.0
"""Largest and least width and height of the sprue of a frame; vents are half as wide and high."""
WAYS: tuple[Point, ...] = ((0.0, -1.0), (1.0, 0.0), (0.0, 1.0), (-1.0, 0.0))
"""Directions from the middle of the pad to the passages of a frame, the sprue's first."""


@dataclass(frozen=True, kw_only=True)
class Passage:
    """A horizontal hole through the wall of a frame, square with a gable on top.

    Attributes
    ----------
    start_mm : middle (x, y) of its end in the cavity
    way : direction outward, perpendicular to the wall
    length_mm : thickness of the wall
    size_mm : width, and height up to the ridge
    z0 : height of its flat side
    """

    start_mm: Point
    way: Point
    length_mm: float
    size_mm: float
    z0: float

    @property
    def section_mm(self) -> tuple[Point, ...]:
        """Corners of its cross-section: position across it and height z [mm]."""
        half, z = self.size_mm / 2, self.z0
        return (-half, z), (half, z), (half, z + half), (0.0, z + 2 * half), (-half, z + half)

    @property
    def area_mm2(self) -> float:
        """Area of its cross-section [mm2]."""
        return 0.75 * self.size_mm**2


def passage_mm(plan: Plan, top_mm: float, web_mm: float) -> float:
    """Width of the sprue of a frame, limited by the thickness of the clear layer at its edge and by the rim [mm]."""
    return min(PASSAGE_MM, plan.rim_mm[0], top_mm - web_mm)


def passages(plan: Plan, outer: Outline, size_mm: float) -> tuple[Passage, ...]:
    """The sprue and then three vents in the middle of a frame's walls; none for a flat top.

    Parameters
    ----------
    outer : outline of the frame's outer faces
    size_mm : width of the sprue
    """
    if not is_cast_under_lid(plan):
        return ()
    (x, y), found = plan.centre_mm, []
    for k, way in enumerate(WAYS):
        inside, outside = (one.way_out_mm((x, y), way) for one in (plan.outline, outer))
        start = x + inside * way[0], y + inside * way[1]
        size = size_mm if k == 0 else size_mm / 2
        found.append(Passage(start_mm=start, way=way, length_mm=outside - inside, size_mm=size, z0=0.0))
    return tuple(found)


def is_cast_under_lid(plan: Plan) -> bool:
    """Whether a lid shapes the pad's top, so that the mold is filled upside down."""
    return not plan.top.is_flat


def filling_holes(plan: Plan, bottom_mm: float, floor_mm: float) -> tuple[Hole, ...]:
    """The sprue and then three vents near the corners of the floor; none for a flat top, which is poured from above.

    Parameters
    ----------
    bottom_mm : height z of the mold's underside
    floor_mm : height z of the cavity's floor
    """
    if not is_cast_under_lid(plan):
        return ()
    (x, y), (across, deep) = plan.centre_mm, filling_offsets_mm(plan)
    return tuple(
        Hole(
            x=x + sx * across,
            y=y + sy * deep,
            radius=SPRUE_RADIUS_MM if k == 0 else VENT_RADIUS_MM,
            z0=bottom_mm,
            z1=floor_mm,
        )
        for k, (sx, sy) in enumerate(((-1, -1), (1, -1), (1, 1), (-1, 1)))
    )


def filling_offsets_mm(plan: Plan) -> tuple[float, float]:
    """Distance of sprue and vents from the middle of the pad along x and y [mm]."""
    x, y = plan.centre_mm
    if plan.has_origin_corner:
        return x - INSET_MM, y - INSET_MM
    away = (float(plan.outline.gap_mm(x, y)) - INSET_MM) / math.sqrt(2)
    return away, away
