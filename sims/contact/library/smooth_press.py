"""One layer's presses as smooth functions of depth.

A press is described by numbers that change smoothly with depth: ln of the force, ln of the outline
coordinate t of the contact edge, the free surface from that edge to the wall at fixed places along its arc
(`sample_arcs`; relative to the edge), and the share of the load inside fixed shares of t. On a crown the surface is
that of heights above the untouched top, its arc too, so that crowns can be interpolated. Each number is a cubic
spline in ln(depth / deepest), in which force and edge are nearly straight lines (powers of the depth:
Hertz' 3/2 and 1/2). All are linear in the coefficients, so that layers can be interpolated.

Below the first solved depth (0.02 mm for a 3 mm tip) the contact is smaller than a mesh cell: there contact
radius and force follow the powers that theory gives them at first touch (1/2 and 3/2 under a round tip), and the
heights of the surface (on a crown: above it) are scaled with the depth. Nothing is extrapolated beyond the deepest
solved depth.

Lengths in tip radii, forces in E R².
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import cache, cached_property

import numpy as np
from scipy.interpolate import BSpline

from design.arrays import BoolArray, FloatArray
from design.errors import ModelScopeError
from sims.contact.library.surface_curve import TopCurve, contact_radius_at, whole_curve
from sims.contact.scope import WALL_RADIUS
from sims.contact.solver.crown import crown_drop, crown_slope
from sims.contact.tip import HEMISPHERE, TipOutline, tip_outline
from sims.contact.walls.far_press import FarPress, far_press

FIRST_SPACING, SPACING_GROWTH, LARGEST_SPACING = 0.003, 1.04, 0.015
"""First spacing, ratio of neighbouring ones and bound of the surface samples [share of the arc length]."""
_RUN_BACK = 1e-6
LOAD_SHARES = np.linspace(0.0, 1.0, 17)
"""Shares of the contact's outline at which the load inside is kept [-]."""


@cache
def _arc_shares() -> FloatArray:
    steps = [FIRST_SPACING]
    while sum(steps) < 1.0:
        steps.append(min(steps[-1] * SPACING_GROWTH, LARGEST_SPACING))
    shares = np.append(0.0, np.cumsum(steps))
    return np.asarray(shares / shares[-1], dtype=np.float64)


def arc_shares() -> FloatArray:
    """(sample,) shares of the free surface's arc length, from 0 at the contact edge to 1 at the wall [-]."""
    return _arc_shares().copy()


def sample_arcs(length: float, wall_radius: float) -> FloatArray:
    """(sample,) arcs of the samples from the contact edge on, from 0 to the whole length [tip radii].

    Beside the contact they hardly depend on the place of the wall, so presses in pads of different sizes can be
    interpolated; with a wall at `WALL_RADIUS` they are the `arc_shares` of the length.

    Parameters
    ----------
    length : arc from the contact edge to the wall [tip radii]
    wall_radius : of the bonded wall [tip radii]
    """
    stretch = WALL_RADIUS / wall_radius
    shares = _arc_shares()
    return np.asarray(length * stretch * shares / (1.0 + (stretch - 1.0) * shares), dtype=np.float64)


SAMPLES = _arc_shares().size
VALUES = 2 + 2 * SAMPLES + LOAD_SHARES.size
"""Numbers that describe a state: ln force, ln edge, radii, heights, shares of the load."""


def runs_back(curve: TopCurve) -> BoolArray:
    """(n,) points nearer to the axis than one before them."""
    return np.asarray(curve.radius < np.maximum.accumulate(curve.radius) - _RUN_BACK)


def outward(curve: TopCurve) -> tuple[FloatArray, FloatArray]:
    """Radius, increasing, and height of a curve: of a stretch that runs back the lowest point is kept."""
    kept = np.append(True, np.diff(np.maximum.accumulate(curve.radius)) > _RUN_BACK)
    return curve.radius[kept], curve.height[kept]


def above_crown(curve: TopCurve, crown: float) -> TopCurve:
    """The same points by their height above the untouched crown at their radius, with that curve's inclination.

    Parameters
    ----------
    curve : the top, heights above the untouched apex
    crown : tip radius over the radius of the untouched top [-]
    """
    if crown == 0.0:
        return curve
    along, up = np.cos(curve.inclination), np.sin(curve.inclination)
    return replace(
        curve,
        height=curve.height + crown_drop(curve.radius, crown),
        inclination=np.arctan2(up + crown_slope(curve.radius, crown) * along, along),
    )


def on_crown(curve: TopCurve, crown: float) -> TopCurve:
    """The inverse of `above_crown`."""
    return above_crown(curve, -crown)


def off_crown(points: FloatArray, wall_radius: float, crown: float) -> FloatArray:
    """(n, 2) points with heights above the untouched crown instead of above its apex [tip radii].

    Parameters
    ----------
    points : (n, 2) radius and height; a fitted radius may lie a little beyond the wall [tip radii]
    wall_radius : where the crown ends [tip radii]
    crown : tip radius over the radius of the untouched top; negative is the inverse [-]
    """
    if crown == 0.0:
        return points
    drop = crown_drop(np.minimum(points[:, 0], wall_radius), crown)
    return np.stack([points[:, 0], points[:, 1] + drop], axis=1)


@dataclass(frozen=True, kw_only=True)
class StateValues:
    """One state in the numbers that splines are made of; see the module for their meaning.

    Attributes
    ----------
    log_force, log_edge : ln of the force [E R²], ln of the edge's outline coordinate [tip radii]
    free : (SAMPLES, 2) radius and height of the free surface less those of its first point, the contact edge; heights
        are above the untouched top (`off_crown`) [tip radii]
    load : (share,) part of the load inside `LOAD_SHARES` of the contact [-]
    """

    log_force: float
    log_edge: float
    free: FloatArray
    load: FloatArray

    def packed(self) -> FloatArray:
        """(VALUES,) all numbers in a row."""
        return np.concatenate([[self.log_force, self.log_edge], self.free.T.ravel(), self.load])

    @classmethod
    def unpacked(cls, row: FloatArray) -> StateValues:
        """The inverse of `packed`."""
        free, load = row[2 : 2 + 2 * SAMPLES], row[2 + 2 * SAMPLES :]
        return cls(log_force=float(row[0]), log_edge=float(row[1]), free=free.reshape(2, -1).T, load=load)


@dataclass(frozen=True, kw_only=True)
class FitResidual:
    """How far the solved states lie from the splines, over all depths.

    Attributes
    ----------
    force_rms, force_largest : of the force [-]
    edge_rms, edge_largest : of the contact edge's outline coordinate [tip radii]
    surface_rms, surface_largest : of the free surface's samples [tip radii]
    """

    force_rms: float
    force_largest: float
    edge_rms: float
    edge_largest: float
    surface_rms: float
    surface_largest: float

    @classmethod
    def from_array(cls, figures: FloatArray) -> FitResidual:
        """From (6,) figures in the order of the attributes."""
        return cls(**{field.name: float(figure) for field, figure in zip(fields(cls), figures, strict=True)})

    def as_array(self) -> FloatArray:
        """(6,) in the order of the attributes."""
        return np.array([getattr(self, field.name) for field in fields(self)])


@dataclass(frozen=True, kw_only=True)
class SmoothPress:
    """Presses of one layer under one tip, at every depth; lengths in tip radii, forces in E R².

    Attributes
    ----------
    layer_depth, wall_radius : elastic depth of the layer, radius of the bonded wall
    mesh_size : node spacing under the tip
    first, deepest : shallowest and deepest solved press
    knots : (knot,) of the cubic splines in ln(depth / deepest), with repeated ends [-]
    coefficients : (coefficient, VALUES) of the splines
    residual : of the fit to the solved states
    tip : what presses
    versions : names and versions of what computed it
    crown : tip radius over the radius of the untouched top, pressed at its apex; 0 is flat [-]
    """

    layer_depth: float
    wall_radius: float
    mesh_size: float
    first: float
    deepest: float
    knots: FloatArray
    coefficients: FloatArray
    residual: FitResidual
    versions: tuple[str, ...]
    tip: TipOutline = HEMISPHERE
    crown: float = 0.0

    @cached_property
    def _values(self) -> BSpline:
        return BSpline(self.knots, self.coefficients, 3)

    @cached_property
    def far(self) -> FarPress:
        """The loads that stand for these presses far from the tip.

        Raises
        ------
        ModelScopeError : a crowned top
        """
        if self.crown:
            raise ModelScopeError(
                f"crown: {self.crown:g}; the model of walls covers flat tops only, so a crowned pad is pressed at its "
                "apex"
            )

        def top(depth: float) -> tuple[FloatArray, FloatArray, float]:
            curve = self.curve_at(depth)
            return *outward(curve), curve.contact_radius

        return far_press(self.layer_depth, self.wall_radius, self.deepest, top)

    def _place(self, depth: float) -> float:
        """The splines' argument, kept inside the knots."""
        place = float(np.log(min(max(depth, self.first), self.deepest) / self.deepest))
        return min(max(place, float(self.knots[0])), float(self.knots[-1]))

    def values_at(self, depth: float) -> StateValues:
        """The describing numbers at a solved depth; nearer ones are moved into the solved range."""
        return StateValues.unpacked(np.asarray(self._values(self._place(depth)), dtype=np.float64))

    def force_at(self, depth: float) -> float:
        """Force at a depth between 0 and the deepest one [E R²]."""
        if depth <= 0.0:
            return 0.0
        shallower = min(0.0, float(np.log(depth / self.first)))
        log_force = float(self._values(self._place(depth))[0])
        return float(np.exp(log_force + (1.0 + self.tip.contact_power) * shallower))

    def edge_at(self, depth: float) -> float:
        """Outline coordinate of the contact edge at a depth between 0 and the deepest one [tip radii]."""
        if depth <= 0.0:
            return 0.0
        shallower = min(0.0, float(np.log(depth / self.first)))
        log_edge = float(self._values(self._place(depth))[1])
        return float(np.exp(log_edge + self.tip.contact_power * shallower))

    def curve_at(self, depth: float) -> TopCurve:
        """The top from axis to wall at a depth between 0 and the deepest one; heights above the untouched apex."""
        if depth <= 0.0:
            flat = sample_arcs(self.wall_radius, self.wall_radius)
            nothing = np.zeros_like(flat)
            untouched = TopCurve(radius=flat, height=nothing, inclination=nothing, contact_radius=0.0)
            return on_crown(untouched, self.crown)
        solved = max(depth, self.first)
        values = self.values_at(solved)
        edge = float(np.exp(values.log_edge))
        curve = whole_curve(edge, self._free(values.free, edge, solved), solved, self.tip)
        if depth >= self.first:
            return curve
        moved = above_crown(curve, self.crown)
        shallower = replace(
            moved,
            height=moved.height * (depth / self.first),
            inclination=np.arctan(np.tan(moved.inclination) * (depth / self.first)),
            contact_radius=contact_radius_at(self.edge_at(depth), self.tip),
        )
        return on_crown(shallower, self.crown)

    def _free(self, relative: FloatArray, edge: float, depth: float) -> FloatArray:
        """(SAMPLES, 2) free surface that starts on the tip and ends where the layer is bonded.

        Fitting edge and surface one by one moves the end by a micrometre or so; that is shared out along the arc.
        """
        start = np.stack(tip_outline(np.array(edge), depth, self.tip))
        above = off_crown(start[None], self.wall_radius, self.crown) + relative
        miss = np.array([self.wall_radius, 0.0]) - above[-1]
        shares = sample_arcs(1.0, self.wall_radius)
        return off_crown(above + shares[:, None] * miss, self.wall_radius, -self.crown)[1:]
