"""The form of a pad that is no flat rectangle: its walls in plan as plain arrays, and its convex top.

In plan the elastomer is { p : n · (p - o) <= 0 for every flat wall, |p - c| <= radius of the round wall }, which is
convex. The bottom is the plane z = 0; the top is a `design.shape.top.Top`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from design.arrays import FloatArray
from design.shape.top import Top

WALL_COLUMNS = ("x", "y", "tx", "ty", "nx", "ny")


@dataclass(frozen=True, kw_only=True, repr=False)
class PadForm:
    """Walls and top of a pad that is no flat rectangle; the domain in plan is convex.

    Attributes
    ----------
    walls : (k, 6) flat walls by `WALL_COLUMNS`: x, y of the place where `along` is 0 [mm]; unit tangent in which
        along grows [-]; unit outward normal [-]
    round_wall : (3,) x, y of the axis and radius of a round wall [mm]; radius 0 for none
    top : untouched; its highest point is the scene's height
    """

    walls: FloatArray
    round_wall: FloatArray
    top: Top

    def __repr__(self) -> str:
        """Every number in full, so that two forms have one text only where they are the same."""
        walls, round_wall = np.asarray(self.walls).tolist(), np.asarray(self.round_wall).tolist()
        return f"PadForm(walls={walls}, round_wall={round_wall}, top={self.top!r})"
