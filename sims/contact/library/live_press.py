"""Fit splines to presses over depth, and solve a design's press live, for a tip or pad outside the shipped library.

`fit_press` reduces a solved press to smooth functions of depth (`SmoothPress`). They are splines, fitted by least
squares, with one interval for every `DEPTHS_PER_INTERVAL` solved depths. The fit has to smooth, because light is
differentiated with respect to depth, while the facets of a mesh come into contact one after another. So the contact
edge and the force jitter as the contact grows, by up to 10 µm and 0.4 % at a spacing of a fifteenth of the tip radius
(3 mm tip, near 1 mm depth). `FitResidual` records the distance of the solved states from the fit.

`live_press` solves a design's press at both Poisson's ratios in parallel, one thread each.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
from scipy.interpolate import CubicSpline, PchipInterpolator, make_lsq_spline

from optopad.design.arrays import FloatArray
from optopad.design.errors import InputError
from optopad.design.progress import OnShare
from optopad.sims.contact.library.smooth_press import (
    LOAD_SHARES,
    POISSON_RATIOS,
    FitResidual,
    SmoothPress,
    StateValues,
    contact_tolerance,
    free_surface,
    nearly_incompressible,
    off_crown,
    sample_arcs,
)
from optopad.sims.contact.library.stored_press import PressInputs, UnitPress, stored_press
from optopad.sims.contact.scope import Contact, solved_depths
from optopad.sims.contact.tip import tip_coordinate, tip_outline

DEPTHS_PER_INTERVAL = 3
"""Number of solved depths per interval of the splines."""


def _resampled(points: FloatArray, wall_radius: float) -> FloatArray:
    """Resample a curve (n, 2) of radius and height at the arc lengths of `sample_arcs`; the result is (sample, 2)."""
    length = np.append(0.0, np.cumsum(np.hypot(*np.diff(points, axis=0).T)))
    return np.asarray(
        CubicSpline(length, points)(sample_arcs(float(length[-1]), wall_radius)), dtype=np.float64
    )


def tributary_areas(radius: FloatArray, height: FloatArray) -> FloatArray:
    """Area (node,) whose load each node of a surface of revolution takes: ∫ N 2πr ds with the node's hat function N.

    The surface is given by the radii and heights (node,) of its nodes. A node on the axis gets a third of the disc that
    reaches to its neighbour, instead of the quarter that reaches half-way.
    """
    length = np.hypot(np.diff(radius), np.diff(height))
    areas = np.zeros_like(radius)
    areas[:-1] += 2.0 * np.pi * length * (radius[:-1] / 3.0 + radius[1:] / 6.0)
    areas[1:] += 2.0 * np.pi * length * (radius[:-1] / 6.0 + radius[1:] / 3.0)
    return areas


def _load_inside(
    force: FloatArray, radius: FloatArray, height: FloatArray, along: FloatArray, edge: float
) -> FloatArray:
    """Share (share,) of the load inside each of the fractions `LOAD_SHARES` of the contact's arc length.

    Parameters
    ----------
    force, radius, height : (node,) force on each top node, and its position
    along : (node,) arc length along the tip's outline from its apex to each node
    edge : the same arc length to the contact edge
    """
    count = int(np.flatnonzero(force > 0.0)[-1]) + 1
    inside = np.cumsum(force[:count]) / force[:count].sum()
    reach = np.cumsum(tributary_areas(radius, height))[: count - 1]
    ring = np.pi * (radius[1:] + radius[:-1]) * np.hypot(np.diff(radius), np.diff(height))
    root = np.sqrt(
        np.append(0.0, np.cumsum(ring))
    )  # square root of the area up to a node: nearly linear along the tip
    whole = float(np.interp(edge, along, root)) ** 2
    kept = reach < whole
    places = np.concatenate([[0.0], reach[kept] / whole, [1.0]])
    shares = np.concatenate([[0.0], inside[: count - 1][kept], [1.0]])
    wanted = np.interp(LOAD_SHARES * edge, along, root) ** 2 / whole
    return np.asarray(PchipInterpolator(places, shares)(np.minimum(wanted, 1.0)), dtype=np.float64)


def _state(unit: UnitPress, index: int) -> StateValues:
    """The numbers that describe the solved press at one of its depths, to be fitted by splines."""
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
    """Distances between solved states and their spline fit; both arrays are (depth, VALUES)."""
    force = np.expm1(fitted[:, 0] - states[:, 0])
    edge = np.exp(fitted[:, 1]) - np.exp(states[:, 1])
    pairs = zip(map(StateValues.unpacked, states), map(StateValues.unpacked, fitted), strict=True)
    surface = np.array([np.hypot(*(after.free - before.free).T) for before, after in pairs])
    figures = [np.array([np.sqrt(np.mean(x**2)), np.abs(x).max()]) for x in (force, edge, surface)]
    return FitResidual.from_array(np.concatenate(figures))


def interval_knots(places: FloatArray) -> FloatArray:
    """Knots of cubic splines for increasing sample positions; the first and last knot occur four times each."""
    inner = places[DEPTHS_PER_INTERVAL:-DEPTHS_PER_INTERVAL:DEPTHS_PER_INTERVAL]
    return np.concatenate([np.repeat(places[0], 4), inner, np.repeat(places[-1], 4)])


def fit_press(unit: UnitPress) -> SmoothPress:
    """Fit splines over ln(depth / deepest depth) to the solved states of a press.

    Parameters
    ----------
    unit : the solved states, at four depths or more
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


DEFAULT_MESH = 0.1
"""Node spacing under the tip [tip radii]: 0.3 mm for a 3 mm tip."""
MESH_RANGE = (0.04, 0.15)
"""Accepted node spacings under the tip [tip radii]. Coarser facets cannot follow the tip and lose the contact edge;
finer ones may chatter in deep presses, which raises an error.
"""
LEAST_DEPTH = 0.4 / 3
"""Depth that every live solve reaches at least [tip radii], so that the spline fit has enough depths."""


_SMOOTH: dict[tuple[int, int], tuple[UnitPress, UnitPress, SmoothPress]] = {}
"""Fitted presses of this process, by the `id` of their two solutions, which are stored too so that ids stay valid."""


def mesh_size(contact: Contact, mesh_mm: float | None) -> float:
    """Convert a node spacing under the tip from mm to tip radii; None becomes `DEFAULT_MESH`.

    Raises
    ------
    InputError : the spacing is outside `MESH_RANGE`
    """
    if mesh_mm is None:
        return DEFAULT_MESH
    radius = contact.tip_radius_mm
    low, high = (bound * radius for bound in MESH_RANGE)
    if not low - 1e-9 <= mesh_mm <= high + 1e-9:
        raise InputError(f"mesh_mm: {mesh_mm:g} mm must lie between {low:g} and {high:g} mm for this tip")
    return mesh_mm / radius


def live_press(
    contact: Contact, spacing: float, deepest: float, on_step: OnShare | None
) -> tuple[UnitPress, SmoothPress, tuple[str, ...]]:
    """The press of a design's tip, solved now or taken from the cache of earlier solves.

    Parameters
    ----------
    contact : the design's tip and pad
    spacing, deepest : node spacing under the tip, and deepest press [tip radii]
    on_step : called with the fraction done (0 to 1)

    Returns
    -------
    The solved states at the larger Poisson's ratio, the nearly incompressible press extrapolated from both ratios, and
    notes for the user.

    Raises
    ------
    ContactSolveError : a state fails its checks
    """
    layer = contact.layer
    depths = tuple(round(float(depth), 9) for depth in solved_depths(layer, max(deepest, LEAST_DEPTH)))
    inputs = PressInputs(
        layer=layer,
        mesh_size=spacing,
        depths=depths,
        poisson_ratio=POISSON_RATIOS[-1],
        tip=contact.tip,
        wall_radius=contact.wall_radius,
    )
    return both_ratios(inputs, on_step)


def both_ratios(
    inputs: PressInputs, on_step: OnShare | None
) -> tuple[UnitPress, SmoothPress, tuple[str, ...]]:
    """Solve a press at both `POISSON_RATIOS`, and extrapolate; return values and errors are those of `live_press`.

    Parameters
    ----------
    inputs : all inputs of the solution; its `poisson_ratio` is ignored
    on_step : called with the fraction done (0 to 1)
    """
    tell = _Progress(on_step)

    def solve(ratio: float) -> tuple[UnitPress, tuple[str, ...]]:
        own = replace(inputs, poisson_ratio=ratio)
        return stored_press(own, lambda share: tell.advance(ratio, share))

    with ThreadPoolExecutor(max_workers=len(POISSON_RATIOS)) as pool:
        (soft, _), (stiff, notes) = pool.map(solve, POISSON_RATIOS)
    return stiff, _smooth(soft, stiff), notes


def live_note(contact: Contact, mesh_mm: float | None) -> str:
    """A note for the user that a press was solved live, with which mesh, and without a comparison to a reference."""
    spacing = DEFAULT_MESH * contact.tip_radius_mm if mesh_mm is None else mesh_mm
    return (
        f"contact solved live on a mesh of {spacing:g} mm under the tip, not taken from the library: it "
        "was not compared with a reference"
    )


class _Progress:
    """Reports the mean progress of two solves that run in parallel threads."""

    def __init__(self, on_step: OnShare | None) -> None:
        self.on_step, self.shares = on_step, dict.fromkeys(POISSON_RATIOS, 0.0)

    def advance(self, ratio: float, share: float) -> None:
        self.shares[ratio] = share
        if self.on_step is not None:
            self.on_step(sum(self.shares.values()) / len(self.shares))


def _smooth(soft: UnitPress, stiff: UnitPress) -> SmoothPress:
    """The nearly incompressible press extrapolated from two solutions; this process caches it for this pair."""
    key = (id(soft), id(stiff))
    if key not in _SMOOTH:
        _SMOOTH[key] = (soft, stiff, nearly_incompressible(fit_press(soft), fit_press(stiff)))
    return _SMOOTH[key][2]
