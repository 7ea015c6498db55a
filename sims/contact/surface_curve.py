"""From surface nodes to the curve that light meets: exact tip inside the contact, smooth outside.

The nodes of the finite-element top touch the tip to within a few micrometres (facets are chords of a
round tip, and contact is a stiff penalty). Inside the contact the curve is therefore the tip itself.
The contact ends where the gap vanishes: near the edge a frictionless gap grows with the power 3/2 of
the distance along the tip (Johnson, Contact Mechanics, section 4.2), so gap^(2/3) of the first two free
nodes is continued linearly to zero. From there a cubic spline runs through the free nodes; it starts
tangent to the tip and ends at the bonded wall. It is resampled densely and never enters the tip.
All lengths in tip radii.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from sims.contact.tip import outside_tip, tip_coordinate, tip_gap, tip_outline

FloatArray = NDArray[np.float64]

NEAR_SPACING = 0.02
"""Spacing of the curve on the tip and beside it [tip radii]."""
FAR_SPACING = 0.08
"""Spacing of the curve towards the wall [tip radii]."""
_LEAST_CLEARANCE = 0.3
"""A free node nearer to the contact edge than this share of the spacing is left to the spline [-]."""


def contact_tolerance(spacing: float, wedge_angle: float) -> float:
    """Gap below which a node counts as touching [tip radii].

    Facets touch the tip in their middle: nodes then stand off by the sagitta spacing²/8 along the
    curve and by 1 - cos(angle/2) around the axis. Half of the sum is added for slip along the facet.
    """
    return 1.5 * (spacing**2 / 8.0 + 1.0 - float(np.cos(0.5 * wedge_angle)))


def contact_coordinate(
    radius: FloatArray, height: FloatArray, depth: float, tolerance: float
) -> tuple[float, int]:
    """Outline coordinate of the contact edge [tip radii] and index of the first free node.

    Parameters
    ----------
    radius, height : (node,) surface nodes from the axis outward [tip radii]
    depth : press depth [tip radii]
    tolerance : gap below which a node touches [tip radii]
    """
    gap = tip_gap(radius, height, depth)
    touching = np.flatnonzero(gap <= tolerance)
    first = int(touching.max()) + 1 if touching.size else 0
    along = tip_coordinate(radius[first : first + 2], height[first : first + 2], depth)
    inner, outer = gap[first : first + 2] ** (2 / 3)
    edge = float(along[0] - inner * (along[1] - along[0]) / (outer - inner))
    last_touch = float(tip_coordinate(radius[first - 1], height[first - 1], depth)) if first else 0.0
    return min(max(edge, last_touch, 0.0), float(along[0])), first


def _free_curve(radius: FloatArray, height: FloatArray, edge: float, depth: float) -> FloatArray:
    """(n, 2) spline through free nodes, tangent to the tip at the contact edge."""
    start = np.stack(tip_outline(np.array(edge), depth))
    angle = min(edge, 0.5 * np.pi)
    tangent = np.array([np.cos(angle), np.sin(angle)])
    points = np.concatenate([start[None], np.stack([radius, height], axis=1)])
    chord = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    spline = CubicSpline(chord, points, bc_type=((1, tangent), (2, np.zeros(2))))
    pieces = []
    for low, high in pairwise(chord):
        spacing = NEAR_SPACING if low < 1.0 else FAR_SPACING
        pieces.append(np.linspace(low, high, max(2, int(np.ceil((high - low) / spacing)) + 1))[1:])
    return np.asarray(spline(np.concatenate(pieces)), dtype=np.float64)


def surface_curve(
    radius: FloatArray, height: FloatArray, depth: float, *, spacing: float, tolerance: float
) -> tuple[FloatArray, FloatArray, float]:
    """The deformed top as a dense curve.

    Parameters
    ----------
    radius, height : (node,) surface nodes from the axis to the wall [tip radii]
    depth : press depth > 0 [tip radii]
    spacing : node spacing at rest under the tip [tip radii]
    tolerance : gap below which a node touches [tip radii]

    Returns
    -------
    radius, height : (n,) curve from the axis, at height -depth, to the wall, at height 0 [tip radii]
    contact radius : radius of the circle where the surface leaves the tip [tip radii]
    """
    edge, first = contact_coordinate(radius, height, depth, tolerance)
    along = tip_coordinate(radius[first : first + 1], height[first : first + 1], depth)
    if along[0] - edge < _LEAST_CLEARANCE * spacing:
        first += 1
    count = max(2, int(np.ceil(edge / NEAR_SPACING)) + 1)
    tip_radius, tip_height = tip_outline(np.linspace(0.0, edge, count), depth)
    free = _free_curve(radius[first:], height[first:], edge, depth)
    free_radius, free_height = outside_tip(free[:, 0], free[:, 1], depth)
    contact_radius = float(np.sin(min(edge, 0.5 * np.pi)))
    return (
        np.concatenate([tip_radius, free_radius]),
        np.concatenate([tip_height, free_height]),
        contact_radius,
    )
