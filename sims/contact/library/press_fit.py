"""Reduce a solved press to smooth functions of depth, `SmoothPress`.

The splines are least squares fits with one interval for every `DEPTHS_PER_INTERVAL` solved depths.
Contact on a mesh comes facet by facet, which makes edges and forces jitter as the contact grows (at a
spacing of a fifteenth of the tip radius by up to 10 µm and 0.4 % for a 3 mm tip, near 1 mm depth), and
light is differentiated with respect to depth. `FitResidual` says how far the solved states lie from the fit.
"""

from __future__ import annotations

import numpy as np
from scipy.interpolate import CubicSpline, PchipInterpolator, make_lsq_spline

from design.arrays import FloatArray
from sims.contact.library.profiles import UnitPress
from sims.contact.library.smooth_press import (
    LOAD_SHARES,
    FitResidual,
    SmoothPress,
    StateValues,
    off_crown,
    sample_arcs,
)
from sims.contact.library.surface_curve import contact_tolerance, free_surface
from sims.contact.tip import tip_coordinate, tip_outline

DEPTHS_PER_INTERVAL = 3
"""Solved depths for one interval of the splines."""


def _resampled(points: FloatArray, wall_radius: float) -> FloatArray:
    """(sample, 2) points at the `sample_arcs` of a dense curve."""
    length = np.append(0.0, np.cumsum(np.hypot(*np.diff(points, axis=0).T)))
    return np.asarray(
        CubicSpline(length, points)(sample_arcs(float(length[-1]), wall_radius)), dtype=np.float64
    )


def tributary_areas(radius: FloatArray, height: FloatArray) -> FloatArray:
    """(node,) area of the full turn that loads each node of a polyline, ∫ N 2πr ds with its hat function N.

    A node on the axis has a third of the disk to its neighbour, not the quarter out to the middle between them.
    """
    length = np.hypot(np.diff(radius), np.diff(height))
    areas = np.zeros_like(radius)
    areas[:-1] += 2.0 * np.pi * length * (radius[:-1] / 3.0 + radius[1:] / 6.0)
    areas[1:] += 2.0 * np.pi * length * (radius[:-1] / 6.0 + radius[1:] / 3.0)
    return areas


def _load_inside(
    force: FloatArray, radius: FloatArray, height: FloatArray, along: FloatArray, edge: float
) -> FloatArray:
    """(share,) part of the load within `LOAD_SHARES` of the contact; a node carries its own area's load."""
    count = int(np.flatnonzero(force > 0.0)[-1]) + 1
    inside = np.cumsum(force[:count]) / force[:count].sum()
    reach = np.cumsum(tributary_areas(radius, height))[: count - 1]
    ring = np.pi * (radius[1:] + radius[:-1]) * np.hypot(np.diff(radius), np.diff(height))
    root = np.sqrt(
        np.append(0.0, np.cumsum(ring))
    )  # the root of the area within a node: nearly linear along the tip
    whole = float(np.interp(edge, along, root)) ** 2
    kept = reach < whole
    places = np.concatenate([[0.0], reach[kept] / whole, [1.0]])
    shares = np.concatenate([[0.0], inside[: count - 1][kept], [1.0]])
    wanted = np.interp(LOAD_SHARES * edge, along, root) ** 2 / whole
    return np.asarray(PchipInterpolator(places, shares)(np.minimum(wanted, 1.0)), dtype=np.float64)


def _state(unit: UnitPress, index: int) -> StateValues:
    """The describing numbers of one solved state."""
    depth = float(unit.depths[index])
    radius, height = unit.radii[index], unit.heights[index]
    tolerance = contact_tolerance(unit.mesh_size, unit.wedge_angle)
    edge, free = free_surface(
        radius, height, depth, spacing=unit.mesh_size, tolerance=tolerance, tip=unit.tip, crown=unit.crown
    )
    start = np.stack(tip_outline(np.array(edge), depth, unit.tip))
    dense = off_crown(np.concatenate([start[None], free]), unit.wall_radius, unit.crown)
    return StateValues(
        log_force=float(np.log(unit.force[index])),
        log_edge=float(np.log(edge)),
        free=_resampled(dense, unit.wall_radius) - dense[0],
        load=_load_inside(
            unit.normal_force[index], radius, height, tip_coordinate(radius, height, depth, unit.tip), edge
        ),
    )


def _residual(states: FloatArray, fitted: FloatArray) -> FitResidual:
    """Distance of states from their fit; both (depth, VALUES)."""
    force = np.expm1(fitted[:, 0] - states[:, 0])
    edge = np.exp(fitted[:, 1]) - np.exp(states[:, 1])
    pairs = zip(map(StateValues.unpacked, states), map(StateValues.unpacked, fitted), strict=True)
    surface = np.array([np.hypot(*(after.free - before.free).T) for before, after in pairs])
    figures = [np.array([np.sqrt(np.mean(x**2)), np.abs(x).max()]) for x in (force, edge, surface)]
    return FitResidual.from_array(np.concatenate(figures))


def interval_knots(places: FloatArray) -> FloatArray:
    """Knots of the cubic splines for increasing sample places, the ends four times."""
    inner = places[DEPTHS_PER_INTERVAL:-DEPTHS_PER_INTERVAL:DEPTHS_PER_INTERVAL]
    return np.concatenate([np.repeat(places[0], 4), inner, np.repeat(places[-1], 4)])


def fit_press(unit: UnitPress) -> SmoothPress:
    """Splines in ln(depth / deepest) through the solved states.

    Parameters
    ----------
    unit : the solved states, four depths or more
    """
    states = np.array([_state(unit, index).packed() for index in range(unit.depths.size)])
    places = np.log(unit.depths / unit.deepest)
    spline = make_lsq_spline(places, states, interval_knots(places), k=3)
    return SmoothPress(
        layer_depth=unit.layer_depth,
        wall_radius=unit.wall_radius,
        crown=unit.crown,
        mesh_size=unit.mesh_size,
        first=float(unit.depths[0]),
        deepest=unit.deepest,
        knots=spline.t,
        coefficients=spline.c,
        residual=_residual(states, spline(places)),
        versions=unit.versions,
        tip=unit.tip,
    )
