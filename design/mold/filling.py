"""Filling holes of a crowned pad's mold: silicone enters through the floor, with the mold upside down on its lid.

The lid shapes the crown (`optopad.cad.lid`). In this position the floor is highest, so air escapes there and no filling
hole touches the optical surface. The sprue is the hole that receives the silicone. The clear layer is poured by weight
up to the level of the black layer. Then the black layer is poured until it rises in the vents. The silicone that
remains in the holes is black.

        sprue                      vents          turned over: floor up
       ___| |_______________________| |___
      |   black                           |
      |___________________________________|
      |   clear                           |
      |__                               __|
     ____ `--.____               ____.--' ____
    |    pin      ``---.....---``        pin  |   lid, on the bench
    |_________________________________________|
"""

from __future__ import annotations

import math

from optopad.design.mold.sockets import Hole
from optopad.design.shape.cavity import Plan

SPRUE_RADIUS_MM, VENT_RADIUS_MM = 2.0, 1.0
"""Radii of sprue and vents. A syringe's tip fits into the sprue; silicone rises in the vents when the mold is full."""
INSET_MM = 3.0
"""Distance of the middle of each sprue or vent from the cavity's walls."""


def is_cast_under_lid(plan: Plan) -> bool:
    """Whether a lid shapes the pad's top, so that the mold is filled upside down through its floor."""
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
