"""From surface nodes to the curve that light meets: exact tip inside the contact, smooth outside.

The nodes of the finite-element top touch the tip to within a few micrometres (facets are chords of a
round tip, and contact is a stiff penalty). Inside the contact the curve is therefore the tip itself.
The contact edge, of radius a, is where the gap vanishes. The first free node, at distance s from the
edge, is taken to have Hertz' gap (Johnson, Contact Mechanics, 1985, eq. 3.42):

    gap = a²/R G(1 + s/a),  G(x) = x²/2 - 1 + ((2 - x²) arcsin(1/x) + sqrt(x² - 1)) / π

On a crown of radius Rc = R/κ the relative curvature 1/R + 1/Rc = (1 + κ)/R stands for 1/R. G has the power 3/2 at
the edge, which any frictionless contact has, so the edge is found to a fraction of the node spacing at every depth; a
constant other than a²/R in a deep press matters little there. On other tips than a hemisphere the constant is not
known: it comes from the second free node.
From the edge a cubic spline runs through
the free nodes; it starts tangent to the tip and ends at the bonded wall. It is resampled densely and
never enters the tip.
All lengths in tip radii.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq

from design.arrays import FloatArray
from sims.contact.tip import HEMISPHERE, TipOutline, outside_tip, tip_coordinate, tip_gap, tip_outline

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


def hertz_gap(ratio: FloatArray) -> FloatArray:
    """Gap beside a Hertz contact over contact radius²/tip radius [-], at radius over contact radius >= 1."""
    free = (2.0 - ratio**2) * np.arcsin(1.0 / ratio) + np.sqrt(ratio**2 - 1.0)
    return np.asarray(ratio**2 / 2.0 - 1.0 + free / np.pi, dtype=np.float64)


def _hertz_coordinate(depth: float, tip: TipOutline) -> float:
    """Where the tip is half the depth above its apex: the contact edge on a parabola, for want of a better one.

    A cone's is at 2/π of the depth (Sneddon), so this is good to a quarter for a contact within one cell. On a crown
    the depth over 1 + κ stands for the depth.
    """
    places = np.linspace(0.0, tip.starts[-1] + depth, 400)
    return float(np.interp(0.5 * depth, tip.points(places)[1], places))


def contact_coordinate(
    radius: FloatArray,
    height: FloatArray,
    depth: float,
    tolerance: float,
    tip: TipOutline = HEMISPHERE,
    crown: float = 0.0,
) -> tuple[float, int]:
    """Outline coordinate of the contact edge [tip radii] and index of the first free node.

    Parameters
    ----------
    radius, height : (node,) surface nodes from the axis outward [tip radii]
    depth : press depth [tip radii]
    tolerance : gap below which a node touches [tip radii]
    tip : what presses
    crown : tip radius over the radius of the untouched top; 0 is flat [-]
    """
    gap = tip_gap(radius, height, depth, tip)
    touching = np.flatnonzero(gap <= tolerance)
    first = (
        int(touching.max()) + 1 if touching.size else 1
    )  # a facet may stand on a sharp apex between two nodes
    along = tip_coordinate(radius, height, depth, tip)
    free = slice(first, first + 2)

    def excess(edge: float) -> float:
        edge_radius, edge_height = tip_outline(np.array(edge), depth, tip)
        distance = np.hypot(radius[free] - edge_radius, height[free] - edge_height)
        shape = hertz_gap(1.0 + distance / edge_radius)
        if tip == HEMISPHERE:
            return float((1.0 + crown) * edge_radius**2 * shape[0] - gap[first])
        return float(shape[0] * gap[first + 1] - shape[1] * gap[first])

    low, high = float(along[max(first - 2, 0)]) + 1e-6, float(along[first])
    if low >= high or excess(low) <= 0.0 or excess(high) >= 0.0:
        if first > 1:
            return float(along[first - 1]), first
        return min(_hertz_coordinate(depth / (1.0 + crown), tip), float(along[first])), first
    return float(brentq(excess, low, high, xtol=1e-9)), first


def _free_curve(
    radius: FloatArray, height: FloatArray, edge: float, depth: float, tip: TipOutline
) -> FloatArray:
    """(n, 2) spline through free nodes, tangent to the tip at the contact edge."""
    start = np.stack(tip_outline(np.array(edge), depth, tip))
    angle = min(edge, 0.5 * np.pi) if tip == HEMISPHERE else tip.tangent_angle(edge)
    tangent = np.array([np.cos(angle), np.sin(angle)])
    points = np.concatenate([start[None], np.stack([radius, height], axis=1)])
    chord = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    spline = CubicSpline(chord, points, bc_type=((1, tangent), (2, np.zeros(2))))
    pieces = []
    for low, high in pairwise(chord):
        spacing = NEAR_SPACING if low < 1.0 else FAR_SPACING
        pieces.append(np.linspace(low, high, max(2, int(np.ceil((high - low) / spacing)) + 1))[1:])
    return np.asarray(spline(np.concatenate(pieces)), dtype=np.float64)


def free_surface(
    radius: FloatArray,
    height: FloatArray,
    depth: float,
    *,
    spacing: float,
    tolerance: float,
    tip: TipOutline = HEMISPHERE,
    crown: float = 0.0,
) -> tuple[float, FloatArray]:
    """The contact edge and the surface beyond it.

    Parameters
    ----------
    radius, height : (node,) surface nodes from the axis to the wall [tip radii]
    depth : press depth > 0 [tip radii]
    spacing : node spacing at rest under the tip [tip radii]
    tolerance : gap below which a node touches [tip radii]
    tip : what presses
    crown : tip radius over the radius of the untouched top; 0 is flat [-]

    Returns
    -------
    edge : outline coordinate of the contact edge [tip radii]
    points : (n, 2) dense free surface that follows the edge, to the wall [tip radii]
    """
    edge, first = contact_coordinate(radius, height, depth, tolerance, tip, crown)
    along = tip_coordinate(radius[first : first + 1], height[first : first + 1], depth, tip)
    if along[0] - edge < _LEAST_CLEARANCE * spacing:
        first += 1
    return edge, _free_curve(radius[first:], height[first:], edge, depth, tip)


def contact_radius_at(edge: float, tip: TipOutline = HEMISPHERE) -> float:
    """Radius of the tip's outline where the surface leaves it, at an outline coordinate [tip radii]."""
    return float(tip_outline(np.array(edge), 0.0, tip)[0])


def _inside_contact(edge: float, tip: TipOutline) -> FloatArray:
    """(n,) outline coordinates from the apex to the contact edge, close enough to draw the tip; its kinks too."""
    even = np.linspace(0.0, edge, max(2, int(np.ceil(edge / NEAR_SPACING)) + 1))
    kinks = tip.kinks[tip.kinks < edge]
    return even if kinks.size == 0 else np.unique(np.concatenate([even, kinks]))


@dataclass(frozen=True, kw_only=True)
class TopCurve:
    """The deformed top from the axis to the wall; lengths in tip radii.

    Attributes
    ----------
    radius, height : (n,) points: the exact tip up to the contact edge, then the free surface
    inclination : (n,) angle of the tangent to the radial direction [rad]; it is continuous at the edge
    contact_radius : radius of the circle where the surface leaves the tip
    """

    radius: FloatArray
    height: FloatArray
    inclination: FloatArray
    contact_radius: float


def _tangent_angles(along: FloatArray, tip: TipOutline) -> FloatArray:
    """(n,) angle of the tip's tangent at outline coordinates [rad]."""
    if tip == HEMISPHERE:
        return np.minimum(along, 0.5 * np.pi)
    return np.array([tip.tangent_angle(float(place)) for place in along])


def _free_angles(radius: FloatArray, height: FloatArray, first: float) -> FloatArray:
    """(n,) angle of the tangent of the spline through points, `first` at the first of them [rad]."""
    points = np.stack([radius, height], axis=1)
    chord = np.append(0.0, np.cumsum(np.hypot(*np.diff(points, axis=0).T)))
    start = np.array([np.cos(first), np.sin(first)])
    tangent = CubicSpline(chord, points, bc_type=((1, start), (2, np.zeros(2))))(chord, 1)
    return np.asarray(np.arctan2(tangent[:, 1], tangent[:, 0]), dtype=np.float64)


def whole_curve(edge: float, free: FloatArray, depth: float, tip: TipOutline = HEMISPHERE) -> TopCurve:
    """The exact tip up to the contact edge, then the free surface, which never enters the tip.

    Parameters
    ----------
    edge : outline coordinate of the contact edge [tip radii]
    free : (n, 2) free surface that follows the edge, to the wall [tip radii]
    depth : press depth > 0 [tip radii]
    tip : what presses
    """
    along = _inside_contact(edge, tip)
    tip_radius, tip_height = tip_outline(along, depth, tip)
    free_radius, free_height = outside_tip(free[:, 0], free[:, 1], depth, tip)
    tip_angle = _tangent_angles(along, tip)
    free_angle = _free_angles(
        np.append(tip_radius[-1], free_radius), np.append(tip_height[-1], free_height), float(tip_angle[-1])
    )
    return TopCurve(
        radius=np.concatenate([tip_radius, free_radius]),
        height=np.concatenate([tip_height, free_height]),
        inclination=np.concatenate([tip_angle, free_angle[1:]]),
        contact_radius=contact_radius_at(edge, tip),
    )


def surface_curve(
    radius: FloatArray,
    height: FloatArray,
    depth: float,
    *,
    spacing: float,
    tolerance: float,
    tip: TipOutline = HEMISPHERE,
    crown: float = 0.0,
) -> TopCurve:
    """The deformed top as a dense curve: `whole_curve` of `free_surface`, which have the parameters."""
    edge, free = free_surface(
        radius, height, depth, spacing=spacing, tolerance=tolerance, tip=tip, crown=crown
    )
    return whole_curve(edge, free, depth, tip)
