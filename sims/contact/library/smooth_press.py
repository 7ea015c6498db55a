"""One layer's presses as smooth functions of depth.

A press is described by numbers that change smoothly with depth: ln of the force, ln of the outline
coordinate t of the contact edge, the free surface from that edge to the wall at fixed points along its arc
(`sample_arcs`; relative to the edge), and the share of the load inside fixed shares of t. On a crown the surface and
its arc are those of heights above the untouched top, so that crowns can be interpolated. Each number is a cubic
spline in ln(depth / deepest), in which force and edge are nearly straight lines (powers of the depth:
Hertz' 3/2 and 1/2). All are linear in the coefficients, so that layers can be interpolated.

Below the first solved depth (0.02 mm for a 3 mm tip) the contact is smaller than a mesh cell: there contact
radius and force follow the powers that theory gives them at first touch (1/2 and 3/2 under a round tip), and the
heights of the surface (on a crown: above it) are scaled with the depth. Nothing is extrapolated beyond the deepest
solved depth.

Lengths in tip radii, forces in E R².

From surface nodes to the curve for the light model: exact tip inside the contact, smooth outside.

The nodes of the finite-element top touch the tip to within a few micrometres (facets are chords of a
round tip, and contact is a stiff penalty). Inside the contact the curve is therefore the tip itself.
The contact edge, of radius a, is where the gap vanishes. The first free node, at distance s from the
edge, is taken to have Hertz' gap (Johnson, Contact Mechanics, 1985, eq. 3.42):

    gap = a²/R G(1 + s/a),  G(x) = x²/2 - 1 + ((2 - x²) arcsin(1/x) + sqrt(x² - 1)) / π

On a crown of radius Rc = R/κ the relative curvature 1/R + 1/Rc = (1 + κ)/R replaces 1/R. G has the power 3/2 at the
edge, as any frictionless contact has, so the edge is found to a fraction of the node spacing at every depth; a
constant other than a²/R in a deep press has little effect there. On tips other than a hemisphere the constant is not
known and comes from the second free node.
From the edge a cubic spline runs through
the free nodes; it starts tangent to the tip and ends at the bonded wall. It is resampled densely and
never enters the tip.
All lengths in tip radii.

From two slightly compressible solves to the nearly incompressible layer.

Silicone is nearly incompressible, but linear tetrahedra lock as Poisson's ratio ν nears 1/2. At ν = 0.49
they are accurate but compressible: 3 mm deep in 9 mm, compression takes 16 % of the dimple and the free surface is
17 µm too low. The press depends smoothly on the compressibility 1/K = 3 (1 - 2ν) / E, a regular
perturbation: two solves, at ν = 0.48 and 0.49, are extrapolated linearly in 1 - 2ν to ν = 0.499,

    f(0.499) = f(0.49) + 0.9 (f(0.49) - f(0.48)),

for every number that describes a press (`SmoothPress`). docs/validation/contact.md compares the result with
an independent finite-element solution at ν = 0.499.

Left out: the second order in 1 - 2ν, and the remaining locking, which grows by about a half.

A round pad's surface as that of a square one: followed to half its width, extended to the undisturbed height beyond.

The round pad of a square one's area has its wall outside the square's, 1.13 half widths from the axis, so its surface
is still raised at half the width. Only the corners are beyond; there the curve runs out to the undisturbed height in a
cubic that never crosses it. An independent solution in three dimensions gives the error (docs/validation/walls.md): it
is largest in the strip next to the walls, where the square pad is held down.

Between round walls the curve is followed to the nearest one, and runs out to the farthest.

All lengths in tip radii.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace
from functools import cache, cached_property
from itertools import pairwise

import numpy as np
from scipy.interpolate import BSpline, CubicHermiteSpline, CubicSpline
from scipy.optimize import brentq

from design.arrays import BoolArray, FloatArray
from design.errors import ModelScopeError
from sims.contact.crown import crown_drop, crown_slope
from sims.contact.scope import WALL_RADIUS
from sims.contact.tip import HEMISPHERE, TipOutline, outside_tip, tip_coordinate, tip_gap, tip_outline
from sims.contact.walls import FarPress, far_press

NEAR_SPACING = 0.02
"""Spacing of the curve on the tip and next to it [tip radii]."""
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
    """Gap outside a Hertz contact over contact radius²/tip radius [-], at radius over contact radius >= 1."""
    free = (2.0 - ratio**2) * np.arcsin(1.0 / ratio) + np.sqrt(ratio**2 - 1.0)
    return np.asarray(ratio**2 / 2.0 - 1.0 + free / np.pi, dtype=np.float64)


def _hertz_coordinate(depth: float, tip: TipOutline) -> float:
    """Coordinate at which the tip is half the depth above its apex: the contact edge on a parabola, as a first guess.

    A cone's is at 2/π of the depth (Sneddon), so this is good to a quarter for a contact within one cell. On a crown
    the depth over 1 + κ replaces the depth.
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
    tip : the tip that presses
    crown : tip radius over the radius of the untouched top; 0 is flat [-]
    """
    gap = tip_gap(radius, height, depth, tip)
    touching = np.flatnonzero(gap <= tolerance)
    first = (
        int(touching.max()) + 1 if touching.size else 1
    )  # a facet may rest on a sharp apex between two nodes
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
    tip : the tip that presses
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
    tip : the tip that presses
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


POISSON_RATIOS = (0.48, 0.49)
"""Poisson's ratios that are solved [-]."""
NEARLY_INCOMPRESSIBLE = 0.499
"""Poisson's ratio of the result [-]."""


def extrapolation_weight() -> float:
    """Share of the difference between the two solves that is added to the stiffer one [-]: 0.9."""
    soft, stiff = POISSON_RATIOS
    return (NEARLY_INCOMPRESSIBLE - stiff) / (stiff - soft)


def nearly_incompressible(soft: SmoothPress, stiff: SmoothPress) -> SmoothPress:
    """Extrapolate the presses at the two `POISSON_RATIOS`, solved at the same depths on the same mesh."""
    difference = stiff.coefficients - soft.coefficients
    return replace(stiff, coefficients=stiff.coefficients + extrapolation_weight() * difference)


LONGEST = math.sqrt(2.0) - 1.0
"""Longest distance over which the curve runs out, over the half width [-]: to the corner of the square."""
POINTS = 16
"""Number of points over that distance."""


def run_out(curve: TopCurve, half_width: float, length: float | None = None) -> TopCurve:
    """The curve to half the width of a square pad, then run out; unchanged where it ends before.

    Parameters
    ----------
    curve : the top of a round pad
    half_width : of the square pad, or where else its own curve ends
    length : longest distance over which it runs out; None: to the corner of the square
    """
    beyond = np.flatnonzero(curve.radius >= half_width)
    if beyond.size == 0:
        return curve
    first = int(beyond[0])
    around = slice(first - 1, first + 1)
    piece = CubicHermiteSpline(curve.radius[around], curve.height[around], np.tan(curve.inclination[around]))
    height, slope = float(piece(half_width)), float(piece(half_width, 1))
    length = LONGEST * half_width if length is None else length
    if height * slope < 0.0:
        length = min(length, -3.0 * height / slope)  # a longer cubic would cross the undisturbed height
    tail = CubicHermiteSpline([half_width, half_width + length], [height, 0.0], [slope, 0.0])
    radius = np.linspace(half_width, half_width + length, POINTS)
    return TopCurve(
        radius=np.append(curve.radius[:first], radius),
        height=np.append(curve.height[:first], tail(radius)),
        inclination=np.append(curve.inclination[:first], np.arctan(tail(radius, 1))),
        contact_radius=curve.contact_radius,
    )


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

    Near the contact they hardly depend on the wall's position, so presses in pads of different sizes can be
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
"""Count of the numbers that describe a state: ln force, ln edge, radii, heights, shares of the load."""


def runs_back(curve: TopCurve) -> BoolArray:
    """(n,) points nearer to the axis than one before them."""
    return np.asarray(curve.radius < np.maximum.accumulate(curve.radius) - _RUN_BACK)


def outward(curve: TopCurve) -> tuple[FloatArray, FloatArray]:
    """Radius, increasing, and height of a curve; where it runs back, the lowest point is kept."""
    kept = np.append(True, np.diff(np.maximum.accumulate(curve.radius)) > _RUN_BACK)
    return curve.radius[kept], curve.height[kept]


def above_crown(curve: TopCurve, crown: float) -> TopCurve:
    """The same points with heights above the untouched crown at their radius, and that curve's inclination.

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
    points : (n, 2) radius and height; a fitted radius may be a little beyond the wall [tip radii]
    wall_radius : radius at which the crown ends [tip radii]
    crown : tip radius over the radius of the untouched top; negative is the inverse [-]
    """
    if crown == 0.0:
        return points
    drop = crown_drop(np.minimum(points[:, 0], wall_radius), crown)
    return np.stack([points[:, 0], points[:, 1] + drop], axis=1)


@dataclass(frozen=True, kw_only=True)
class StateValues:
    """One state as the numbers that are fitted by splines; the module explains their meaning.

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
    """Distance of the solved states from the splines, over all depths.

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
    residual : distance of the fit from the solved states
    tip : the tip that presses
    versions : names and versions of the programs that computed it
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
        """The loads that represent these presses far from the tip.

        Raises
        ------
        ModelScopeError : the top is crowned
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
        """The describing numbers at a solved depth; shallower depths are moved into the solved range."""
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

        Separate fits of edge and surface move the end by about a micrometre; that is distributed along the arc.
        """
        start = np.stack(tip_outline(np.array(edge), depth, self.tip))
        above = off_crown(start[None], self.wall_radius, self.crown) + relative
        miss = np.array([self.wall_radius, 0.0]) - above[-1]
        shares = sample_arcs(1.0, self.wall_radius)
        return off_crown(above + shares[:, None] * miss, self.wall_radius, -self.crown)[1:]
