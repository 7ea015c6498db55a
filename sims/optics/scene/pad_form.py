"""The form of a pad that is no block: its walls in plan as plain arrays, and its convex top.

In plan the elastomer is convex: { p : n · (p - o) <= 0 for every flat wall, |p - c| <= r for every round one in whose
sector, seen from its centre c, p lies }. The bottom is the plane z = 0; the top is a `design.shape.top.Top`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from design.arrays import FloatArray
from design.shape.top import Top

WALL_COLUMNS = ("x", "y", "tx", "ty", "nx", "ny")
ARC_COLUMNS = ("x", "y", "radius", "ux", "uy", "cosine")
WHOLE_CIRCLE = (0.0, 0.0, -1.0)
"""Sector of a round wall that counts in every direction."""


@dataclass(frozen=True, kw_only=True, repr=False)
class PadForm:
    """Walls and top of a pad that is no block; the domain in plan is convex.

    Attributes
    ----------
    walls : (k, 6) flat walls by `WALL_COLUMNS`: x, y of the place where `along` is 0 [mm]; unit tangent in which
        along grows [-]; unit outward normal [-]
    arcs : (m, 6) round walls by `ARC_COLUMNS`: x, y of the axis, and radius [mm]; unit direction from the axis to the
        middle of the sector in which it is the wall, and cosine of half the sector's turn [-], or `WHOLE_CIRCLE`
    top : untouched; its highest point is the scene's height
    """

    walls: FloatArray
    arcs: FloatArray
    top: Top

    def __repr__(self) -> str:
        """Every number in full, so that two forms have one text only where they are the same."""
        walls, arcs = np.asarray(self.walls).tolist(), np.asarray(self.arcs).tolist()
        return f"PadForm(walls={walls}, arcs={arcs}, top={self.top!r})"
