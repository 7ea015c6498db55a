"""A pad and its workspace in plan, as patches for plots, and the edge of its top."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.patches import Patch, Polygon

from design.arrays import FloatArray
from design.geometry.cavity import CavityGeometry
from design.geometry.plan import Plan
from design.shape.outline import Outline

TURN_RAD = 2.0 * math.pi / 96
"""Turn of a round wall between two corners: it stands out between them by 5e-4 of its radius."""
PIECES = 12
"""Pieces that a straight wall under a curved edge is drawn in."""


def outline_mm(plan: Plan) -> FloatArray:
    """(n, 2) corners of a pad in plan, counter-clockwise [mm]."""
    return plan.outline.points(TURN_RAD)


def edge_mm(plan: Plan) -> FloatArray:
    """(n, 3) edge of the untouched top: corners in plan, more of them under a crown, and its height there [mm]."""
    corners = plan.outline.points(TURN_RAD, 1 if plan.top.is_flat else PIECES)
    return np.column_stack([corners, plan.top.height_mm(*corners.T)])


def outline_patch(plan: Plan, **look: Any) -> Patch:
    """A pad's outline."""
    return Polygon(outline_mm(plan), **look)


def workspace_patch(space: Outline, **look: Any) -> Patch:
    """The places that presses are judged at."""
    return Polygon(space.points(TURN_RAD), **look)


def clip_to_pad(artist: Any, ax: Any, cavity: CavityGeometry) -> None:
    """Leave of cells only what lies in the pad."""
    artist.set_clip_path(outline_patch(cavity.plan, transform=ax.transData))
