"""Presses into one layer as smooth functions of depth. Lengths are in tip radii, forces in E R².

A press is described by `VALUES` numbers that change smoothly with depth:

- ln of the force,
- ln of t, the arc length along the tip's outline from its apex to the contact edge,
- points of the free surface between the contact edge and the wall, at fixed positions along its arc (`sample_arcs`),
  relative to the edge,
- the share of the load inside fixed fractions of t (`LOAD_SHARES`).

On a crown (spherical top), heights and the arc are measured from the undeformed top, so that crowns can be
interpolated. Each number is a cubic spline over ln(depth / deepest). Over this variable, the logarithms of force and
edge are nearly straight lines, because both grow as powers of the depth (Hertz: 3/2 and 1/2). All numbers are linear in
the coefficients, so that layers can be interpolated.

Below the first solved depth (0.02 mm for a 3 mm tip), the contact is smaller than a mesh cell. There the contact radius
and the force follow the powers that theory gives for first touch (1/2 and 3/2 under a round tip), and surface heights
are proportional to the depth. Nothing is extrapolated beyond the deepest solved depth.

Surface nodes become a curve for the light model: the exact tip inside the contact, smooth outside
--------------------------------------------------------------------------------------------------
The nodes of the finite-element top follow the tip only to within a few micrometres, because facets are chords of a
round tip and contact is a stiff penalty. So inside the contact, the curve is the tip itself. At the contact edge, of
radius a, the gap between top and tip vanishes. The first free node, at distance s from the edge, is assumed to have
Hertz' gap (Johnson, Contact Mechanics, 1985, eq. 3.42):

    gap = a²/R G(1 + s/a),  G(x) = x²/2 - 1 + ((2 - x²) arcsin(1/x) + sqrt(x² - 1)) / π

On a crown of radius Rc = R/κ, the relative curvature 1/R + 1/Rc = (1 + κ)/R replaces 1/R. At the edge, the gap grows
with the power 3/2 of the distance, as in any frictionless contact. So the edge is found to a fraction of the node
spacing at every depth. In a deep press the constant a²/R is not exact, with little effect. For tips other than a
hemisphere the constant is not known, and is found from the second free node.

From the edge, a cubic spline runs through the free nodes. It starts tangent to the tip, ends at the bonded wall, is
resampled densely and never enters the tip.

Two slightly compressible solves are extrapolated to the nearly incompressible layer
------------------------------------------------------------------------------------
Silicone is nearly incompressible, but linear tetrahedra lock as Poisson's ratio ν approaches 1/2. At ν = 0.49 they are
accurate but compressible: in a press 3 mm deep into a layer of 9 mm, compression takes up 16 % of the dimple's volume,
so the free surface is 17 µm too low. The press depends smoothly on the compressibility 1/K = 3 (1 - 2ν) / E. So two
solves, at ν = 0.48 and 0.49, are extrapolated linearly in 1 - 2ν to ν = 0.499,

    f(0.499) = f(0.49) + 0.9 (f(0.49) - f(0.48)),

for every number that describes a press. docs/validation/contact.md compares the result with an independent
finite-element solution at ν = 0.499.

Left out: the second order in 1 - 2ν, and the remaining locking, which the extrapolation increases by about a half.

A round pad's surface stands in for a square pad's
--------------------------------------------------
A round pad of the same area has its wall at 1.13 half widths of the square, so its surface is still raised at one half
width. The curve is followed up to there. Farther out are only the square's corners. Towards them, the curve fades to
the undeformed height along a cubic that never crosses this height. docs/validation/walls.md gives the error, found with
an independent solution in three dimensions. It is largest in the strip next to the walls, where the square pad is
bonded.

In a pad with round walls, the curve is followed to the nearest wall and then fades out to the farthest one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace
from functools import cache, cached_property
from itertools import pairwise

import numpy as np
from scipy.interpolate import BSpline, CubicHermiteSpline, CubicSpline
from scipy.optimize import brentq

from optopad.design.arrays import BoolArray, FloatArray
from optopad.design.errors import ModelScopeError
from optopad.sims.contact.scope import WALL_RADIUS, crown_drop, crown_slope
from optopad.sims.contact.tip import HEMISPHERE, TipOutline, outside_tip, tip_coordinate, tip_gap, tip_outline
from optopad.sims.contact.walls import FarPress, far_press

NEAR_SPACING = 0.02
"""Spacing of the curve's points on the tip and next to it [tip radii]."""
FAR_SPACING = 0.08
"""Spacing of the curve's points towards the wall [tip radii]."""
_LEAST_CLEARANCE = 0.3
"""Distance from the contact edge, over the node spacing, within which the spline skips a free node [-]."""


def contact_tolerance(spacing: float, wedge_angle: float) -> float:
    """Gap between a node and the tip below which the node counts as touching [tip radii].

    Facets touch the tip in their middle. Their nodes are then off the tip by the sagitta spacing²/8 along the curve,
    plus 1 - cos(angle/2) around the axis. Half of this sum is added for slip along the facet.
    """
    return 1.5 * (spacing**2 / 8.0 + 1.0 - float(np.cos(0.5 * wedge_angle)))


def hertz_gap(ratio: FloatArray) -> FloatArray:
    """Gap outside a Hertz contact [contact radius²/tip radius]; `ratio` is radius over contact radius, at least 1."""
    free = (2.0 - ratio**2) * np.arcsin(1.0 / ratio) + np.sqrt(ratio**2 - 1.0)
    return np.asarray(ratio**2 / 2.0 - 1.0 + free / np.pi, dtype=np.float64)


def _hertz_coordinate(depth: float, tip: TipOutline) -> float:
    """Estimate of the contact edge as arc length along the tip's outline, for contacts within one mesh cell.

    It is the point where the outline is half the press depth above its apex, which is exact for a parabola. For a cone
    the exact height is 2/π of the depth (Sneddon), so the estimate is good to about a quarter.

    depth : press depth [tip radii]; on a crown κ, the depth over 1 + κ
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
    """Arc length along the tip's outline from apex to contact edge [tip radii], and index of the first free node.

    Parameters
    ----------
    radius, height : (node,) positions of the surface nodes, from the axis outward [tip radii]
    depth : press depth [tip radii]
    tolerance : gap below which a node counts as touching [tip radii]
    tip : outline of the pressing tip
    crown : tip radius over the radius of the undeformed top; 0 is flat [-]
    """
    gap = tip_gap(radius, height, depth, tip)
    touching = np.flatnonzero(gap <= tolerance)
    first = (
        int(touching.max()) + 1 if touching.size else 1
    )  # a facet may rest on a pointed apex between two nodes
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
    """Radius and height (n, 2) of points on a spline from the contact edge, tangent to the tip, through free nodes."""
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
    """The contact edge, and the free surface from there to the wall.

    Parameters
    ----------
    radius, height : (node,) positions of the surface nodes, from the axis to the wall [tip radii]
    depth : press depth > 0 [tip radii]
    spacing : node spacing at rest under the tip [tip radii]
    tolerance : gap below which a node counts as touching [tip radii]
    tip : outline of the pressing tip
    crown : tip radius over the radius of the undeformed top; 0 is flat [-]

    Returns
    -------
    edge : arc length along the tip's outline from apex to contact edge [tip radii]
    points : (n, 2) radius and height of closely spaced points on the free surface, from just beyond the edge to the
        wall [tip radii]
    """
    edge, first = contact_coordinate(radius, height, depth, tolerance, tip, crown)
    along = tip_coordinate(radius[first : first + 1], height[first : first + 1], depth, tip)
    if along[0] - edge < _LEAST_CLEARANCE * spacing:
        first += 1
    return edge, _free_curve(radius[first:], height[first:], edge, depth, tip)


def contact_radius_at(edge: float, tip: TipOutline = HEMISPHERE) -> float:
    """Contact radius for an arc length along the tip's outline from apex to contact edge; both in tip radii."""
    return float(tip_outline(np.array(edge), 0.0, tip)[0])


def _inside_contact(edge: float, tip: TipOutline) -> FloatArray:
    """Arc lengths (n,) along the tip's outline up to the contact edge, close enough to draw the tip, kinks included."""
    even = np.linspace(0.0, edge, max(2, int(np.ceil(edge / NEAR_SPACING)) + 1))
    kinks = tip.kinks[tip.kinks < edge]
    return even if kinks.size == 0 else np.unique(np.concatenate([even, kinks]))


@dataclass(frozen=True, kw_only=True)
class TopCurve:
    """The deformed top as a curve from the axis to the wall; lengths in tip radii.

    Attributes
    ----------
    radius, height : (n,) points: the exact tip up to the contact edge, then the free surface
    inclination : (n,) angle of the tangent to the radial direction [rad]; continuous at the contact edge
    contact_radius : radius of the circle where the surface leaves the tip
    """

    radius: FloatArray
    height: FloatArray
    inclination: FloatArray
    contact_radius: float


def _tangent_angles(along: FloatArray, tip: TipOutline) -> FloatArray:
    """Angle (n,) of the tip's tangent to the radial direction [rad], at arc lengths (n,) along its outline."""
    if tip == HEMISPHERE:
        return np.minimum(along, 0.5 * np.pi)
    return np.array([tip.tangent_angle(float(place)) for place in along])


def _free_angles(radius: FloatArray, height: FloatArray, first: float) -> FloatArray:
    """Angle (n,) of a spline's tangent to the radial direction [rad] at its points (n,); the first angle is `first`."""
    points = np.stack([radius, height], axis=1)
    chord = np.append(0.0, np.cumsum(np.hypot(*np.diff(points, axis=0).T)))
    start = np.array([np.cos(first), np.sin(first)])
    tangent = CubicSpline(chord, points, bc_type=((1, start), (2, np.zeros(2))))(chord, 1)
    return np.asarray(np.arctan2(tangent[:, 1], tangent[:, 0]), dtype=np.float64)


def whole_curve(edge: float, free: FloatArray, depth: float, tip: TipOutline = HEMISPHERE) -> TopCurve:
    """Join the tip's outline up to the contact edge with the free surface; points inside the tip are moved onto it.

    Parameters
    ----------
    edge : arc length along the tip's outline from apex to contact edge [tip radii]
    free : (n, 2) radius and height of points on the free surface, from just beyond the edge to the wall [tip radii]
    depth : press depth > 0 [tip radii]
    tip : outline of the pressing tip
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
    """The deformed top as a curve of closely spaced points, from surface nodes; parameters as for `free_surface`."""
    edge, free = free_surface(
        radius, height, depth, spacing=spacing, tolerance=tolerance, tip=tip, crown=crown
    )
    return whole_curve(edge, free, depth, tip)


POISSON_RATIOS = (0.48, 0.49)
"""Poisson's ratios at which presses are solved [-]."""
NEARLY_INCOMPRESSIBLE = 0.499
"""Poisson's ratio to which solved presses are extrapolated [-]."""


def extrapolation_weight() -> float:
    """Weight with which the change from Poisson's ratio 0.48 to 0.49 is added to extrapolate to 0.499 [-]: 0.9."""
    soft, stiff = POISSON_RATIOS
    return (NEARLY_INCOMPRESSIBLE - stiff) / (stiff - soft)


def nearly_incompressible(soft: SmoothPress, stiff: SmoothPress) -> SmoothPress:
    """Extrapolate presses to Poisson's ratio 0.499 from two solves, at the lower and higher of `POISSON_RATIOS`.

    Both must have the same depths and mesh.
    """
    difference = stiff.coefficients - soft.coefficients
    return replace(stiff, coefficients=stiff.coefficients + extrapolation_weight() * difference)


LONGEST = math.sqrt(2.0) - 1.0
"""Longest distance over which the curve fades out, over the pad's half width [-]: as far as the square's corner."""
POINTS = 16
"""Number of points on the part of the curve that fades out."""


def run_out(curve: TopCurve, half_width: float, length: float | None = None) -> TopCurve:
    """Follow a round pad's surface to the real pad's nearest wall, then let it fade to the undeformed height.

    Parameters
    ----------
    curve : the top of a round pad; returned unchanged if it ends before `half_width`
    half_width : radius at which the curve starts to fade: half the width of a square pad, or the distance to the
        nearest wall
    length : longest distance over which the curve fades; None is as far as the corner of the square
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
        length = min(length, -3.0 * height / slope)  # a longer cubic would cross the undeformed height
    tail = CubicHermiteSpline([half_width, half_width + length], [height, 0.0], [slope, 0.0])
    radius = np.linspace(half_width, half_width + length, POINTS)
    return TopCurve(
        radius=np.append(curve.radius[:first], radius),
        height=np.append(curve.height[:first], tail(radius)),
        inclination=np.append(curve.inclination[:first], np.arctan(tail(radius, 1))),
        contact_radius=curve.contact_radius,
    )


FIRST_SPACING, SPACING_GROWTH, LARGEST_SPACING = 0.003, 1.04, 0.015
"""First spacing, growth ratio and largest spacing of the free surface's samples; spacings over its arc length [-]."""
_RUN_BACK = 1e-6
LOAD_SHARES = np.linspace(0.0, 1.0, 17)
"""Fractions of the arc length from tip apex to contact edge; the share of the load within each is stored [-]."""


@cache
def _arc_shares() -> FloatArray:
    """Positions (sample,) on the free surface as shares of its arc length, 0 at the contact edge and 1 at the wall."""
    steps = [FIRST_SPACING]
    while sum(steps) < 1.0:
        steps.append(min(steps[-1] * SPACING_GROWTH, LARGEST_SPACING))
    shares = np.append(0.0, np.cumsum(steps))
    return np.asarray(shares / shares[-1], dtype=np.float64)


def sample_arcs(length: float, wall_radius: float) -> FloatArray:
    """Arc lengths (sample,) of the free surface's samples, from 0 at the contact edge to `length` [tip radii].

    Near the contact, they hardly depend on the wall's position, so presses into pads of different sizes can be
    interpolated. With a wall at `WALL_RADIUS`, they are `_arc_shares` times the length.

    Parameters
    ----------
    length : arc length from the contact edge to the wall [tip radii]
    wall_radius : radius of the bonded wall [tip radii]
    """
    stretch = WALL_RADIUS / wall_radius
    shares = _arc_shares()
    return np.asarray(length * stretch * shares / (1.0 + (stretch - 1.0) * shares), dtype=np.float64)


SAMPLES = _arc_shares().size
VALUES = 2 + 2 * SAMPLES + LOAD_SHARES.size
"""How many numbers describe a press at one depth: ln force, ln edge, sample radii and heights, shares of the load."""


def runs_back(curve: TopCurve) -> BoolArray:
    """Mask (n,) of the points that are nearer to the axis than an earlier point of the curve."""
    return np.asarray(curve.radius < np.maximum.accumulate(curve.radius) - _RUN_BACK)


def outward(curve: TopCurve) -> tuple[FloatArray, FloatArray]:
    """Radius and height of a curve's points at which the radius increases; overhanging parts are left out."""
    kept = np.append(True, np.diff(np.maximum.accumulate(curve.radius)) > _RUN_BACK)
    return curve.radius[kept], curve.height[kept]


def above_crown(curve: TopCurve, crown: float) -> TopCurve:
    """Convert a curve's heights and tangent angles so that they refer to the undeformed crown, not the apex's plane.

    Parameters
    ----------
    curve : the top, with heights above the undeformed apex
    crown : tip radius over the radius of the undeformed top [-]
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
    """Convert heights above the undeformed crown back to heights above its apex: the inverse of `above_crown`."""
    return above_crown(curve, -crown)


def off_crown(points: FloatArray, wall_radius: float, crown: float) -> FloatArray:
    """Convert the heights of points from above the crown's apex to above the undeformed crown.

    Parameters
    ----------
    points : (n, 2) radius and height [tip radii]; a fitted radius may be slightly beyond the wall
    wall_radius : radius at which the crown ends [tip radii]
    crown : tip radius over the radius of the undeformed top; a negative value gives the inverse conversion [-]
    """
    if crown == 0.0:
        return points
    drop = crown_drop(np.minimum(points[:, 0], wall_radius), crown)
    return np.stack([points[:, 0], points[:, 1] + drop], axis=1)


@dataclass(frozen=True, kw_only=True)
class StateValues:
    """The numbers that describe a press at one depth; splines fit each of them over depth.

    Attributes
    ----------
    log_force : ln of the force [E R²]
    log_edge : ln of the arc length along the tip's outline from apex to contact edge [tip radii]
    free : (SAMPLES, 2) radius and height of the free surface relative to its first point, the contact edge [tip radii];
        heights are above the undeformed top (`off_crown`)
    load : (share,) share of the load inside each of `LOAD_SHARES` of the contact [-]
    """

    log_force: float
    log_edge: float
    free: FloatArray
    load: FloatArray

    def packed(self) -> FloatArray:
        """All numbers as one array (VALUES,), in the order of the attributes."""
        return np.concatenate([[self.log_force, self.log_edge], self.free.T.ravel(), self.load])

    @classmethod
    def unpacked(cls, row: FloatArray) -> StateValues:
        """Read the numbers from one array (VALUES,): the inverse of `packed`."""
        free, load = row[2 : 2 + 2 * SAMPLES], row[2 + 2 * SAMPLES :]
        return cls(log_force=float(row[0]), log_edge=float(row[1]), free=free.reshape(2, -1).T, load=load)


@dataclass(frozen=True, kw_only=True)
class FitResidual:
    """Errors of the spline fit to the solved states over all depths: root mean square, and largest.

    Attributes
    ----------
    force_rms, force_largest : relative error of the force [-]
    edge_rms, edge_largest : error of the arc length along the tip's outline from apex to contact edge [tip radii]
    surface_rms, surface_largest : error of the free surface's samples [tip radii]
    """

    force_rms: float
    force_largest: float
    edge_rms: float
    edge_largest: float
    surface_rms: float
    surface_largest: float

    @classmethod
    def from_array(cls, figures: FloatArray) -> FitResidual:
        """Read the errors from an array (6,) in the order of the attributes."""
        return cls(**{field.name: float(figure) for field, figure in zip(fields(cls), figures, strict=True)})


@dataclass(frozen=True, kw_only=True)
class SmoothPress:
    """Presses of one tip into one layer, at every depth; lengths in tip radii, forces in E R².

    Attributes
    ----------
    layer_depth, wall_radius : layer thickness, and radius of the bonded wall
    mesh_size : node spacing under the tip in the solved mesh
    first, deepest : depths of the shallowest and of the deepest solved press
    knots : (knot,) knots of the cubic splines over ln(depth / deepest), with repeated ends [-]
    coefficients : (coefficient, VALUES) spline coefficients of the numbers in `StateValues`
    residual : distance of the fit from the solved states
    tip : outline of the pressing tip
    versions : names and versions of the programs that computed the presses
    crown : tip radius over the radius of a spherical top that is pressed at its apex; 0 is flat [-]
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
        """Loads on a linear elastic layer that raise its top outside the dimple just as these presses do.

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
        """The splines' argument ln(depth / deepest), clipped to the range of the knots."""
        place = float(np.log(min(max(depth, self.first), self.deepest) / self.deepest))
        return min(max(place, float(self.knots[0])), float(self.knots[-1]))

    def values_at(self, depth: float) -> StateValues:
        """The numbers that describe the press at a depth, which is clipped to the solved range."""
        return StateValues.unpacked(np.asarray(self._values(self._place(depth)), dtype=np.float64))

    def force_at(self, depth: float) -> float:
        """Force at a depth up to the deepest solved one [E R²]; 0 without contact."""
        if depth <= 0.0:
            return 0.0
        shallower = min(0.0, float(np.log(depth / self.first)))
        log_force = float(self._values(self._place(depth))[0])
        return float(np.exp(log_force + (1.0 + self.tip.contact_power) * shallower))

    def edge_at(self, depth: float) -> float:
        """Arc length along the tip's outline from apex to contact edge [tip radii] at a depth; 0 without contact."""
        if depth <= 0.0:
            return 0.0
        shallower = min(0.0, float(np.log(depth / self.first)))
        log_edge = float(self._values(self._place(depth))[1])
        return float(np.exp(log_edge + self.tip.contact_power * shallower))

    def curve_at(self, depth: float) -> TopCurve:
        """The top from axis to wall at a depth up to the deepest solved one; heights are above the undeformed apex."""
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
        """Points (n, 2) of the free surface, from just beyond the contact edge to where the layer is bonded.

        The separate fits of edge and surface miss the bonded end by about a micrometre. This error is distributed along
        the arc.
        """
        start = np.stack(tip_outline(np.array(edge), depth, self.tip))
        above = off_crown(start[None], self.wall_radius, self.crown) + relative
        miss = np.array([self.wall_radius, 0.0]) - above[-1]
        shares = sample_arcs(1.0, self.wall_radius)
        return off_crown(above + shares[:, None] * miss, self.wall_radius, -self.crown)[1:]
