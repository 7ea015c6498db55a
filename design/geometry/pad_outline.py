"""A pad's outline in plan as points for pictures, and the edge of its top; lengths in mm."""

from __future__ import annotations

import math

import numpy as np

from design.arrays import FloatArray
from design.geometry.plan import Plan

TURN_RAD = 2.0 * math.pi / 96
"""Turn of a round wall between two corners: it stands out between them by 5e-4 of its radius."""
PIECES = 16
"""Pieces that a straight wall under a curved edge is drawn in."""


def outline_mm(plan: Plan) -> FloatArray:
    """(n, 2) corners of a pad in plan, counter-clockwise [mm]."""
    return plan.outline.points(TURN_RAD)


def edge_mm(plan: Plan) -> FloatArray:
    """(n, 3) edge of the untouched top: corners in plan, more of them under a crown, and its height there [mm].

    Heights are not numbers where a crown is too tight for its pad.
    """
    corners = plan.outline.points(TURN_RAD, 1 if plan.top.is_flat else PIECES)
    return np.column_stack([corners, plan.top.height_mm(*corners.T)])
