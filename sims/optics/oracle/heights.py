"""The pad's top as a sum of heights: tips, a smooth correction field, a crown, as numbers.

Model
-----
The top is z = height + Σ h_k(r_k) + f(x, y): one curve of height over radius for each tip, around its own axis,
and a bicubic Hermite field. Under a hemisphere h is the exact sphere up to the contact radius; the rest of the
curve, and under another tip all of it, is a monotone cubic (PCHIP) of height over radius through the stored points.
Beyond its last point h is 0, beyond its grid f is 0; where either ends with a step, a vertical face closes it.
Inside a tip's contact radius the top is contact.

On a crown all this stands in the frame of the one press (`sims.optics.oracle.crown`), along whose axis, the normal,
the top is c(x, y) + d(r) + f(x, y). With R the crown's radius, and q = x² + y² for a sphere or y² for a cylinder that
stays straight along the frame's x,

    c = -(R - √(R² - q)) = -q / (R + √(R² - q)),   |slope| √q / √(R² - q),   curvature at most R² / (R² - q)^1.5,

and d is the press' own height, above the untouched crown. Where a sphere is in contact d is the tip's height less the
*mean crown*, a sphere of radius R, or of 2 R for a cylinder: on a sphere the top there is the tip, on a cylinder it is
so with the f of the press.

Beyond `STEEPEST_SHARE` of R the crown goes on straight. No point of a pad lies there (`REACH_SHARE`), and no light in
air meets it: a ball and the cone that touches it are convex together.

Left out
--------
Curves with more than one height at a radius (refused, but for a shank that is in the pad: it leans by `STEEPEST`); the
tips' shape where other heights lift or lower the top under them: contact is the top itself.

This file shares no code with the fast engine on purpose: it is the other half of a comparison.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numba import njit
from scipy.interpolate import PchipInterpolator

from design.arrays import FloatArray, IntArray
from design.errors import ModelScopeError
from sims.optics.oracle.profile import SEAM_MM, check_indentation, free_curve
from sims.optics.scene.optical_scene import SmoothField
from sims.press import Indentation

Tip = tuple[FloatArray, Indentation]

STEEPEST, SPHERE_KNOTS = 30.0, 97
"""A shank in the pad leans outward with this slope: its edge moves out by a thirtieth of what is wetted. Knots of the
sphere below it."""
REACH_SHARE = 0.97
"""Farthest that a pad may reach from the axis of a frame on its crown, over the crown's radius [-]."""
STEEPEST_SHARE = 0.985
"""Beyond this share of its radius a crown goes on straight, so that every place has one height [-]."""
BINS = 512
"""Rings of equal width from a tip's axis to its edge, each with a bound on curvature."""
X, Y, EDGE, CONTACT_RADIUS, SPHERE, DROP, FIRST, LAST = range(8)


class Crown(NamedTuple):
    """A crown in a frame that stands on it.

    Attributes
    ----------
    radius : of curvature [mm]; 0 for a flat top
    along : 1 for a sphere; 0 for a cylinder, whose straight direction is the frame's first axis
    reach : farthest that the pad lies from the frame's axis, for a cylinder across the straight direction [mm]
    """

    radius: float
    along: float
    reach: float

    @property
    def mean_radius(self) -> float:
        """Radius of the sphere with the crown's mean curvature [mm]."""
        return self.radius * (2.0 - self.along)


NO_CROWN = Crown(0.0, 1.0, 0.0)


@njit()
def crown_fall(radius: float, square: float) -> tuple[float, float]:
    """Fall [mm], and slope over distance from the axis [1/mm]; square of that distance [mm²]."""
    farthest = STEEPEST_SHARE * radius
    if square <= farthest * farthest:
        root = math.sqrt(radius * radius - square)
        return square / (radius + root), 1.0 / root
    root = math.sqrt(radius * radius - farthest * farthest)
    slope, distance = farthest / root, math.sqrt(square)
    return farthest * farthest / (radius + root) + slope * (distance - farthest), slope / distance


@njit()
def crown_bend(radius: float, square: float) -> float:
    """Largest curvature up to a distance from the axis [1/mm]; square of that distance [mm²]."""
    farthest = STEEPEST_SHARE * radius
    inner = radius * radius - min(square, farthest * farthest)
    return radius * radius / (inner * math.sqrt(inner))


class SummedSurface(NamedTuple):
    """Tips, a field and a crown as typed numbers, heights in the cavity frame or in that of a press on a crown.

    Attributes
    ----------
    top : height of the undisturbed surface [mm]
    lowest, highest : bounds of the surface [mm]
    tips : (k, 8) centre x, y; edge; contact radius; sphere radius (0: none); depth of its apex [mm]; first and last
        row of its curve
    curve : (m, 5) radius at the start of a piece, and the height's coefficients of powers 0 to 3 beyond it
    starts : (k, BINS) first row of `curve` that may hold a radius of the ring
    bends : (k, BINS) largest |h''| and |h'| / r within the ring [1/mm]
    origin, step : (2,) of the field's grid [mm]
    nodes : (nx, ny, 4) value, slopes and mixed derivative; (0, 0, 4) without a field
    field_bend : bound of the field's second derivative in any direction [1/mm]
    solids : (k, 6) the tips as light in air meets them (`sims.optics.oracle.top.tip_hit`)
    crown_radius, crown_along : of `Crown`; radius 0 without one
    crown_mean : radius of the mean crown [mm]
    """

    top: float
    lowest: float
    highest: float
    tips: FloatArray
    curve: FloatArray
    starts: IntArray
    bends: FloatArray
    origin: FloatArray
    step: FloatArray
    nodes: FloatArray
    field_bend: float
    solids: FloatArray
    crown_radius: float
    crown_along: float
    crown_mean: float


def lower_sum(
    tips: Sequence[Tip],
    field: SmoothField | None,
    top_mm: float,
    where: str = "indentations",
    crown: Crown = NO_CROWN,
) -> SummedSurface:
    """Turn tips, as (2,) centres [mm] with their presses, and a field into numbers.

    top_mm : height of the undisturbed surface at the frame's origin [mm]; where : what to call the presses in
    messages; crown : below that height, about the frame's origin, where its one press is

    Raises
    ------
    ModelScopeError : a curve with several heights at one radius; contacts that reach into another contact
    """
    _check_apart(tips, where)
    rows, curves, starts, bends = [], [], [], []
    first, fall, rise = 0, 0.0, 0.0
    if crown.radius > 0.0:
        fall = crown_fall(crown.radius, crown.reach**2)[0]
    for number, (centre, press) in enumerate(tips):
        name = where if len(tips) == 1 else f"{where}[{number}]"
        if crown.radius == 0.0:
            check_indentation(press, top_mm, name)
        knots, sphere, contact = _single_valued(press, name, crown.mean_radius)
        pieces = _cubic_pieces(knots)
        edge = float(knots[-1, 0])
        row = (centre[0], centre[1], edge, contact, sphere, press.depth_mm, first, first + len(pieces) - 1)
        rings, ring_bends = _rings(row, pieces, crown.mean_radius)
        rows.append(row)
        curves.append(pieces)
        starts.append(rings + first)
        bends.append(ring_bends)
        first += len(pieces)
        fall, rise = fall + max(press.depth_mm, -knots[:, 1].min()), rise + max(knots[:, 1].max(), 0.0)
    nodes, origin, step, low, high, field_bend = _lowered_field(field)
    return SummedSurface(
        top_mm,
        top_mm - fall + low,
        top_mm + rise + high,
        np.array(rows, dtype=np.float64).reshape(-1, 8),
        np.ascontiguousarray(np.vstack(curves)) if curves else np.empty((0, 5)),
        np.array(starts, dtype=np.int64).reshape(-1, BINS),
        np.array(bends, dtype=np.float64).reshape(-1, BINS),
        origin,
        step,
        nodes,
        field_bend,
        np.empty((0, 6)),
        crown.radius,
        crown.along,
        crown.mean_radius,
    )


def _check_apart(tips: Sequence[Tip], where: str) -> None:
    for k, (centre, press) in enumerate(tips):
        for other, (place, second) in enumerate(tips[:k]):
            gap = math.hypot(*(np.asarray(centre) - np.asarray(place)))
            need = press.contact_radius_mm + second.contact_radius_mm
            if gap < need:
                raise ModelScopeError(
                    f"{where}[{other}] and [{k}]: {gap:g} mm apart, but their contacts have radii that add up to"
                    f" {need:g} mm; move the tips apart"
                )


def on_crown(press: Indentation, mean_radius_mm: float) -> Indentation:
    """The press with heights above the tangent plane in place of heights above the mean crown; radius 0: flat."""
    if mean_radius_mm == 0.0:
        return press
    return replace(press, height_mm=np.asarray(press.height_mm) - _falls(press.radius_mm, mean_radius_mm))


def _falls(radius_mm: FloatArray, mean_radius_mm: float) -> FloatArray:
    """(n,) fall of the mean crown at radii [mm]."""
    return np.array([crown_fall(mean_radius_mm, float(r) ** 2)[0] for r in radius_mm])


def _single_valued(given: Indentation, where: str, mean_radius_mm: float) -> tuple[FloatArray, float, float]:
    """Knots (n, 2) of height over rising radius, radius of the sphere inside them, 0 for none, and contact radius."""
    press = on_crown(given, mean_radius_mm)
    knots, wetted, cap = free_curve(press, where)
    sphere, contact = cap if press.is_hemisphere else 0.0, float(press.contact_radius_mm)
    if not press.is_hemisphere and len(wetted):
        knots = np.vstack([wetted, knots[1:]])
    if press.tip_radius_mm < press.depth_mm and sphere >= press.tip_radius_mm:
        knots, sphere = _leaning(press, knots), 0.0
        contact = float(knots[SPHERE_KNOTS, 0])
    if np.diff(knots[:, 0]).min() < SEAM_MM:
        raise ModelScopeError(
            f"{where}: the curve has several heights at one radius (it folds); with several tips, a field or a crown"
            " only single-valued curves can be traced: press less deep"
        )
    if mean_radius_mm > 0.0:
        knots[:, 1] += _falls(knots[:, 0], mean_radius_mm)
    return knots, press.tip_radius_mm if sphere > 0.0 else 0.0, contact


def _leaning(press: Indentation, free: FloatArray) -> FloatArray:
    """Knots of a tip in beyond its equator: the sphere, its shank as a steep cone, the free curve moved out."""
    tip, equator = press.tip_radius_mm, press.tip_radius_mm - press.depth_mm
    angle = np.linspace(0.0, math.atan(STEEPEST), SPHERE_KNOTS)
    sphere = np.column_stack([tip * np.sin(angle), equator - tip * np.cos(angle)])
    rise = free[0, 1] - sphere[-1, 1]
    edge = np.array([[sphere[-1, 0] + rise / STEEPEST, free[0, 1]]])
    beyond = free[1:].copy()
    least = edge[0, 0] + 2.0 * SEAM_MM * np.arange(1, len(beyond) + 1)
    beyond[:, 0] = np.maximum(np.maximum.accumulate(beyond[:, 0]), least)
    return np.vstack([sphere, edge, beyond])


def _cubic_pieces(knots: FloatArray) -> FloatArray:
    """(m, 5) rows of radius and coefficients of rising power."""
    spline = PchipInterpolator(knots[:, 0], knots[:, 1])
    return np.column_stack([knots[:-1, 0], spline.c[::-1].T])


def _rings(row: tuple[float, ...], pieces: FloatArray, mean_radius_mm: float) -> tuple[IntArray, FloatArray]:
    """For each ring the first piece that reaches into it, and the bound of curvature."""
    edge, contact, sphere = row[EDGE], row[CONTACT_RADIUS], row[SPHERE]
    border = np.linspace(0.0, edge, BINS + 1)
    ends = np.append(pieces[1:, 0], edge)
    first = np.searchsorted(ends, border[:-1], side="left").clip(max=len(pieces) - 1)
    last = np.searchsorted(pieces[:, 0], border[1:], side="right") - 1
    piece_bend = _piece_bends(pieces, ends)
    bends = np.zeros(BINS)
    for ring in range(BINS):
        if last[ring] >= first[ring]:
            bends[ring] = piece_bend[first[ring] : last[ring] + 1].max()
        if sphere > 0.0 and border[ring] < contact:
            inner = sphere**2 - min(border[ring + 1], contact) ** 2
            bend = sphere**2 / max(inner, 1e-6) ** 1.5
            if mean_radius_mm > 0.0:
                bend += crown_bend(mean_radius_mm, min(border[ring + 1], contact) ** 2)
            bends[ring] = max(bends[ring], bend)
    return first.astype(np.int64), bends


def _piece_bends(pieces: FloatArray, ends: FloatArray) -> FloatArray:
    """(m,) bound of |h''| and of |h'| / r on each cubic piece [1/mm]."""
    start, size = pieces[:, 0], ends - pieces[:, 0]
    _, _, one, two, three = pieces.T
    second = np.maximum(np.abs(2.0 * two), np.abs(2.0 * two + 6.0 * three * size))
    slope = np.maximum(np.abs(one), np.abs(one + (2.0 * two + 3.0 * three * size) * size))
    slope += 0.25 * second * size  # a parabola between its ends
    return np.asarray(np.maximum(second, slope / np.maximum(start, 1e-2)))


def _lowered_field(
    field: SmoothField | None,
) -> tuple[FloatArray, FloatArray, FloatArray, float, float, float]:
    """Nodes, origin and step of a field, bounds of its height [mm], and of its curvature [1/mm]."""
    if field is None:
        return np.empty((0, 0, 4)), np.zeros(2), np.ones(2), 0.0, 0.0, 0.0
    nodes = np.ascontiguousarray(field.nodes, dtype=np.float64)
    step = np.asarray(field.step_mm, dtype=np.float64)
    net = _bezier_net(nodes, step)
    along = 6.0 * np.abs(np.diff(net, 2, axis=2)).max() / step[0] ** 2
    across = 6.0 * np.abs(np.diff(net, 2, axis=3)).max() / step[1] ** 2
    mixed = 9.0 * np.abs(np.diff(np.diff(net, axis=2), axis=3)).max() / (step[0] * step[1])
    bend = float(max(along, across) + mixed)
    origin = np.asarray(field.origin_mm, dtype=np.float64)
    return nodes, origin, step, min(float(net.min()), 0.0), max(float(net.max()), 0.0), bend


def _bezier_net(nodes: FloatArray, step: FloatArray) -> FloatArray:
    """(nx - 1, ny - 1, 4, 4) control heights of each cell; the patch and its slopes stay within their hull."""
    value, along, across, mixed = np.moveaxis(nodes, -1, 0)
    dx, dy = step / 3.0
    corner = np.empty((*value.shape, 3, 3))  # control heights at -1, 0, 1 steps / 3 around each node
    for i, u in enumerate((-dx, 0.0, dx)):
        for j, v in enumerate((-dy, 0.0, dy)):
            corner[..., i, j] = value + u * along + v * across + u * v * mixed
    net = np.empty((value.shape[0] - 1, value.shape[1] - 1, 4, 4))
    net[..., :2, :2] = corner[:-1, :-1, 1:, 1:]
    net[..., 2:, :2] = corner[1:, :-1, :2, 1:]
    net[..., :2, 2:] = corner[:-1, 1:, 1:, :2]
    net[..., 2:, 2:] = corner[1:, 1:, :2, :2]
    return net
