"""Convert the surface curves of presses to radial tables, which the light kernels read.

Model
-----
Around the press axis the top is h(r): the exact tip sphere in the contact, then a C1 curve through the indentation's
points, a C1 cubic tail down to the undisturbed height, and the flat top. The curve's slopes come from the points'
inclinations where these are known, else from modified Akima interpolation. The pile-up may rise above the undisturbed
top. If the tip is not a hemisphere, there is no exact sphere: the curve begins `APEX_MM` off the axis, and its part
within the contact radius is the contact.

Choices and their bounds
------------------------
* There is one height for each radius: points whose radius does not exceed an earlier one are dropped. This removes the
  material above an overhang.
* Slopes are at most `MAX_SLOPE`: points above a steep piece move outward by at most their rise over `MAX_SLOPE` (0.033
  mm for 1 mm of wrapped shank). `moved_mm` is the largest move, including those at overhangs.
* Material never reaches into the tip: heights are limited to the tip sphere's.
* Where the curve wraps the shank, it counts as contact up to its last point within the contact radius. Up to there the
  curve is a wall as steep as `MAX_SLOPE`.
* The curve is cut at the last point that is higher than `CUT_HEIGHT_MM` or steeper than `CUT_SLOPE`, and ends in a tail
  of `TAIL_MM`. A residual slope e moves a mirror image at distance D by 2 e D: at 20 mm 0.8 µm, below 0.05 % of a 2 mm
  receiver. That holds for curves that end flat, as the contact model's do
  (`optopad.sims.contact.library.smooth_press`). Otherwise the tail dips by 4/27 of slope x `TAIL_MM`.

Whatever is not axisymmetric is left out here; `optopad.sims.optics.surface.tops` adds a smooth field.

Table
-----
Between contact edge a and outer radius b the curve h(r) is stored as `CELLS` cubic pieces, uniform in

    x = sqrt(A r² + D) - C,    x(a) = 0,    x(b) = CELLS.

So a kernel needs one square root to find a height from r², and no further one for the gradient: dh/dr / r = h' A / (x +
C). C is such that the first piece is `FIRST_PIECE` times the mean piece: pieces are short at the contact edge and
nearly uniform in r beyond.

Rays are followed in steps that cannot jump over the top. For this, each piece has upper bounds that hold from the piece
outward: on slope, on fall (negative slope), and on *bend*. Bend is the rate at which the slope along a line falls,
-d²h/ds², in the direction in which it is largest: max(-h'', -h'/r, 0). For rays that move inward, the bound on bend
also covers a *window* of radii inward of the piece.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np
from scipy.interpolate import Akima1DInterpolator, CubicHermiteSpline

from optopad.design.arrays import FloatArray
from optopad.design.errors import InputError, ModelScopeError
from optopad.sims.optics.scene.optical_scene import OpticalScene
from optopad.sims.press import Indentation

CELLS = 320
LEVELS = 64
FIRST_PIECE = 0.25
BOUND_RESERVE = 1.01
"""Safety factor on bounds, as these are computed from only `SAMPLES` points of each piece."""
SAMPLES = 9
NEAREST_WINDOW_MM, WINDOW_SHARE = 0.06, 0.25
"""Width of the window inward of a piece: the larger of this many mm and this share of the radius. A wider window allows
longer steps but contains a larger bend."""

# columns of a piece
CUBIC, STEEP, FALL, WINDOW, BEND = 0, 4, 5, 6, 7
PIECE_COLUMNS = 8


@dataclass(frozen=True, kw_only=True)
class RadialTable:
    """One press's curve as kernels read it; the module's docstring defines bend, window, A, C and D.

    Attributes
    ----------
    pieces : (CELLS, 8) four coefficients of the height above the clear layer's bottom, a cubic in the fraction of the
        piece [mm]; largest |dh/dr| and largest fall -dh/dr from this piece outward [-]; window inward [mm]; largest
        bend in that window and outward [1/mm]
    reach2 : (LEVELS,) squared radii, for evenly spaced height intervals (levels) from the curve's lowest point to the
        undisturbed top: beyond this radius the top is nowhere below the interval's upper end [mm²]
    scale, offset, start : the constants A [1/mm²], D and C of the coordinate x
    radius, slope : (CELLS + 1,) radius [mm] and dh/dr [-] at the ends of the pieces
    """

    pieces: FloatArray
    reach2: FloatArray
    scale: float
    offset: float
    start: float
    radius: FloatArray
    slope: FloatArray


def node_radii_mm(first_mm: float, last_mm: float) -> tuple[FloatArray, float, float]:
    """(CELLS + 1,) radii of the pieces' ends [mm], and the constants A [1/mm²] and C of the coordinate x."""
    start = CELLS * FIRST_PIECE * first_mm / (last_mm + first_mm * (1.0 - 2.0 * FIRST_PIECE))
    scale = CELLS * (CELLS + 2.0 * start) / (last_mm**2 - first_mm**2)
    x = np.arange(CELLS + 1) + start
    radii = np.sqrt(first_mm**2 + (x**2 - start**2) / scale)
    radii[0], radii[-1] = first_mm, last_mm
    return radii, scale, start


def radial_table(
    radius: FloatArray, height: FloatArray, slope: FloatArray, *, top_mm: float, lowest_mm: float
) -> RadialTable:
    """Convert a C1 cubic curve, given by points with slopes, to a table.

    Parameters
    ----------
    radius, height, slope : (n,) increasing radii [mm], heights relative to the undisturbed top [mm], dh/dr [-]
    top_mm, lowest_mm : heights of the undisturbed top and of the tip's lowest point above the bottom [mm]
    """
    curve = CubicHermiteSpline(radius, height, slope)
    nodes, scale, start = node_radii_mm(float(radius[0]), float(radius[-1]))
    per_piece = (np.arange(CELLS + 1) + start) / (scale * nodes)
    value, node_slope = curve(nodes), curve(nodes, 1)
    node_slope[0], node_slope[-1] = slope[0], 0.0
    rise, jump = node_slope * per_piece, np.diff(value)
    pieces = np.zeros((CELLS, PIECE_COLUMNS))
    pieces[:, 0], pieces[:, 1] = value[:-1] + top_mm, rise[:-1]
    pieces[:, 2], pieces[:, 3] = 3 * jump - 2 * rise[:-1] - rise[1:], rise[:-1] + rise[1:] - 2 * jump
    slopes = _slopes_within(pieces, nodes, scale, start)
    pieces[:, STEEP] = _outward_maximum(np.abs(slopes))
    pieces[:, FALL] = _outward_maximum(np.maximum(-slopes, 0.0))
    pieces[:, WINDOW] = np.maximum(NEAREST_WINDOW_MM, WINDOW_SHARE * nodes[:-1])
    holds = np.searchsorted(nodes, nodes[:-1] - pieces[:, WINDOW], side="right") - 1
    pieces[:, BEND] = _outward_maximum(_bends_within(pieces, nodes, scale, start))[np.maximum(holds, 0)]
    return RadialTable(
        pieces=pieces,
        reach2=_reach2(pieces, nodes, top_mm, lowest_mm),
        scale=scale,
        offset=start**2 - scale * float(nodes[0]) ** 2,
        start=start,
        radius=nodes,
        slope=node_slope,
    )


def lowest_of_pieces_mm(pieces: FloatArray) -> FloatArray:
    """(CELLS,) lower bound of the height of each cubic piece: its lowest Bernstein coefficient [mm]."""
    c0, c1, c2, c3 = pieces[:, :4].T
    return np.asarray(np.min([c0, c0 + c1 / 3, c0 + (2 * c1 + c2) / 3, c0 + c1 + c2 + c3], axis=0))


def outward_cup(table: RadialTable) -> FloatArray:
    """(CELLS,) largest upward curvature along any line, max(h'', h'/r, 0), from each piece outward [1/mm]."""
    return _outward_maximum(_bends_within(-table.pieces, table.radius, table.scale, table.start))


def _samples(nodes: FloatArray, scale: float, start: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(SAMPLES,) fractions of a piece; (CELLS, SAMPLES) x + C [-] and radius [mm] at these fractions of each piece."""
    t = np.linspace(0.0, 1.0, SAMPLES)
    x = np.arange(CELLS)[:, None] + t + start
    return t, x, np.sqrt(np.maximum(nodes[0] ** 2 + (x**2 - start**2) / scale, nodes[0] ** 2))


def _slopes_within(pieces: FloatArray, nodes: FloatArray, scale: float, start: float) -> FloatArray:
    """(CELLS, SAMPLES) slope dh/dr at evenly spaced points of every piece [-]."""
    t, x, r = _samples(nodes, scale, start)
    gradient = pieces[:, 1:2] + 2 * pieces[:, 2:3] * t + 3 * pieces[:, 3:4] * t**2
    return np.asarray(gradient * scale * r / x)


def _bends_within(pieces: FloatArray, nodes: FloatArray, scale: float, start: float) -> FloatArray:
    """(CELLS, SAMPLES) bend max(-h'', -h'/r, 0) at evenly spaced points of every piece [1/mm]."""
    t, x, r = _samples(nodes, scale, start)
    turn = (pieces[:, 1:2] + 2 * pieces[:, 2:3] * t + 3 * pieces[:, 3:4] * t**2) * scale / x
    radial = turn + (2 * pieces[:, 2:3] + 6 * pieces[:, 3:4] * t - turn / scale) * (scale * r / x) ** 2
    return np.asarray(np.maximum(np.maximum(-radial, -turn), 0.0))


def _outward_maximum(values: FloatArray) -> FloatArray:
    """(CELLS,) largest of `values` (CELLS, SAMPLES) over this and all outer pieces, times `BOUND_RESERVE`."""
    worst = BOUND_RESERVE * values.max(axis=1)
    return np.asarray(np.maximum.accumulate(worst[::-1])[::-1])


def _reach2(pieces: FloatArray, nodes: FloatArray, top_mm: float, lowest_mm: float) -> FloatArray:
    """(LEVELS,) squared radius beyond which the curve is nowhere below each level [mm²], as in `RadialTable`."""
    low = lowest_of_pieces_mm(pieces)
    levels = lowest_mm + (top_mm - lowest_mm) * np.arange(1, LEVELS + 1) / LEVELS
    below = low[None, :] < levels[:, None]
    last = np.where(below.any(axis=1), CELLS - np.argmax(below[:, ::-1], axis=1), 0)
    return np.asarray(nodes[last] ** 2)


MAX_SLOPE = 30.0
CUT_HEIGHT_MM = 5e-5
CUT_SLOPE = 2e-5
TAIL_MM = 4.0
SKIRT_SLOPE = 0.1
MIN_KNOT_STEP_MM = 1e-3
TOUCHING = 1e-9
"""Relative tolerance of the contact radius: points this much beyond it still count as contact."""
UPRIGHT_MM = 1e-9
"""A step back in radius [mm] below which the curve still counts as vertical, not as an overhang."""
APEX_MM = 1e-3
FLATTEST_APEX_MM = 1e-9

# columns of a press row
X, Y, ACTIVE, SPHERE_R, TIP_R, SPHERE_Z, OUTER_R, CONTACT_R, LOWEST, HIGHEST, SKIRT_R, TOP = range(12)
SPHERE_2, TIP_2, OUTER_2, SCALE, OFFSET, START, PER_LEVEL = range(12, 19)
CONTACT_AREA = 19
CONTACT = 20
CONTACT_PARTS = 48
COLUMNS = CONTACT + CONTACT_PARTS + 1
# a row as kernels read it: the press's columns, data of the field, levels, pieces
BLOCKS = 16
"""Number of blocks along each side of the field, for which its lowest value and largest slope are kept."""
FIELD_COLUMNS = 11 + 2 * BLOCKS * BLOCKS
REACH = COLUMNS + FIELD_COLUMNS
PIECES = REACH + LEVELS
ROW = PIECES + PIECE_COLUMNS * CELLS


@dataclass(frozen=True, kw_only=True)
class SurfaceStack:
    """Radial tables of one tip in all states, as kernels read them.

    Attributes
    ----------
    press : (state, n) by columns: x, y of the press axis [mm]; 1 if the tip touches, else 0; radius in plan up to which
        the sphere is used, tip radius, height of the sphere's centre, outer radius, contact radius, lowest and highest
        point of the surface, skirt radius, height of the undisturbed top [mm]; squares of the sphere's, tip's and outer
        radius [mm²]; scale, offset and start of the table; levels per mm; area of the contact and squared radii that
        divide it into parts of equal area [mm²]
    reach2 : (state, level) squared radii; see `RadialTable` [mm²]
    pieces : (state, piece, 8) data of the pieces; see `RadialTable`
    moved_mm : (state,) largest distance by which a point was moved to make the curve single valued [mm]
    """

    press: FloatArray
    reach2: FloatArray
    pieces: FloatArray
    moved_mm: FloatArray


def stack_surfaces(
    indentations: Sequence[Indentation | None], centres_mm: FloatArray, scene: OpticalScene
) -> SurfaceStack:
    """Convert one indentation per state to tables; None stands for the untouched pad.

    Parameters
    ----------
    indentations : one indentation or None per state; an object that occurs several times is converted only once
    centres_mm : (state, 2) x and y of the press axis [mm]
    scene : the block of clear material

    Raises
    ------
    InputError : a press is outside the block, or a curve has too few, unordered or non-finite points.
    ModelScopeError : a press goes through the clear layer, or a tip overlaps a wall.
    """
    centres = np.asarray(centres_mm, dtype=np.float64)
    if centres.shape != (len(indentations), 2):
        raise InputError(f"centres_mm: shape {centres.shape}, needs ({len(indentations)}, 2)")
    count = len(indentations)
    press = np.zeros((count, COLUMNS))
    press[:, TOP] = press[:, LOWEST] = press[:, HIGHEST] = scene.height_mm
    reach2 = np.zeros((count, LEVELS))
    pieces = np.zeros((count, CELLS, PIECE_COLUMNS))
    moved = np.zeros(count)
    for state, indentation in enumerate(indentations):
        if indentation is None or indentation.depth_mm <= 0:
            continue
        press[state], table, moved[state] = _lower(indentation, scene.height_mm)
        reach2[state], pieces[state] = table.reach2, table.pieces
        press[state, X:ACTIVE] = centres[state]
        _check_place(state, centres[state], press[state, CONTACT_R], scene)
    return SurfaceStack(press=press, reach2=reach2, pieces=pieces, moved_mm=moved)


def _check_place(state: int, centre: FloatArray, contact_radius: float, scene: OpticalScene) -> None:
    x, y = centre
    if not (0 < x < scene.length_mm and 0 < y < scene.width_mm):
        raise InputError(
            f"state {state}: press at ({x:g}, {y:g}) mm is outside the block of "
            f"{scene.length_mm:g} x {scene.width_mm:g} mm; move it inside"
        )
    room = min(x, y, scene.length_mm - x, scene.width_mm - y)
    if room <= contact_radius:
        raise ModelScopeError(
            f"state {state}: contact radius {contact_radius:.2f} mm but only {room:.2f} mm to the wall; "
            "the surface model is axisymmetric: press further inside"
        )


_Lowered = tuple[FloatArray, RadialTable, float]
_LOWERED: WeakKeyDictionary[Indentation, tuple[float, _Lowered]] = WeakKeyDictionary()
"""Height of the top and, converted for this height, the curve of each press that is still referenced."""


def _lower(indentation: Indentation, top_mm: float) -> _Lowered:
    height_mm, lowered = _LOWERED.get(indentation, (math.nan, None))
    if lowered is None or height_mm != top_mm:
        check_curve(indentation, top_mm)
        lowered = lower_curve(indentation, top_mm)
        _LOWERED[indentation] = top_mm, lowered
    return lowered


def lower_curve(indentation: Indentation, top_mm: float, mean_mm: float = 0.0) -> _Lowered:
    """Convert a press's curve: its numbers (`COLUMNS`), its radial table, the largest move of a point [mm].

    Parameters
    ----------
    top_mm : height of the undisturbed top, at which the curve ends [mm]
    mean_mm : radius of a sphere with the crown's mean curvature; heights are given above this sphere. 0 for a flat top
        [mm]
    """
    depth = indentation.depth_mm
    tip, start = _sphere(indentation)
    centre_z = top_mm - depth + tip
    radius, height, given, moved, contact = _single_valued(indentation, tip, start, mean_mm)
    given[0] = start / np.sqrt(tip**2 - start**2)
    if mean_mm > 0.0:
        given[0] += start / np.sqrt(mean_mm**2 - start**2)
    radius, height, slope = _with_tail(radius, height, given)
    table = radial_table(radius, height, slope, top_mm=top_mm, lowest_mm=top_mm - depth)
    skirt = table.radius[np.abs(table.slope) >= SKIRT_SLOPE]
    row = np.zeros(COLUMNS)
    row[ACTIVE], row[SPHERE_R], row[TIP_R], row[SPHERE_Z] = 1.0, start, tip, centre_z
    row[OUTER_R], row[CONTACT_R] = radius[-1], contact
    row[LOWEST], row[HIGHEST] = top_mm - depth, max(top_mm, float(table.pieces[:, 0].max()))
    row[SKIRT_R] = max(contact, float(skirt.max()) if skirt.size else contact)
    row[TOP] = top_mm
    row[SPHERE_2], row[TIP_2], row[OUTER_2] = start**2, tip**2, radius[-1] ** 2
    row[SCALE], row[OFFSET], row[START] = table.scale, table.offset, table.start
    row[PER_LEVEL] = LEVELS / depth
    row[CONTACT_AREA], row[CONTACT:] = _contact_parts_mm2(
        tip, start, radius[radius <= contact], height[radius <= contact]
    )
    return row, table, moved


def _sphere(indentation: Indentation) -> tuple[float, float]:
    """Sphere that replaces the curve near the axis: its radius, and the radius in plan up to which it is used [mm].

    For a hemisphere it is the tip, up to the edge of the contact or to `MAX_SLOPE`. For other tips it is a sphere that
    fits the curve at `APEX_MM`.
    """
    tip = indentation.tip_radius_mm
    if indentation.is_hemisphere:
        return tip, float(min(indentation.contact_radius_mm, tip * MAX_SLOPE / np.hypot(1.0, MAX_SLOPE)))
    rise = float(np.interp(APEX_MM, indentation.radius_mm, indentation.height_mm)) + indentation.depth_mm
    rise = min(max(rise, FLATTEST_APEX_MM), 0.5 * APEX_MM)
    return 0.5 * (APEX_MM**2 / rise + rise), APEX_MM


def _contact_parts_mm2(
    tip: float, start: float, radius: FloatArray, height: FloatArray
) -> tuple[float, FloatArray]:
    """Area of the contact [mm²], and (CONTACT_PARTS + 1,) squared radii that divide it into parts of equal area [mm²].

    Area is measured along the surface. Parts of equal area in plan would be too coarse on the steep side of a deep
    contact, which faces LEDs and photodiodes.
    """
    angle = np.linspace(0.0, np.arcsin(start / tip), 8 * CONTACT_PARTS + 1)
    r = np.concatenate((tip * np.sin(angle), radius[1:]))
    h = np.concatenate((height[0] - tip * (np.cos(angle) - np.cos(angle[-1])), height[1:]))
    band = np.hypot(np.diff(r), np.diff(h)) * (r[1:] + r[:-1])
    area = np.concatenate(([0.0], np.cumsum(band)))
    parts = np.interp(np.linspace(0.0, area[-1], CONTACT_PARTS + 1), area, r**2)
    return np.pi * float(area[-1]), parts


def check_curve(indentation: Indentation, top_mm: float) -> None:
    """Refuse a curve that cannot be a press into a layer.

    top_mm : thickness of the layer [mm]

    Raises
    ------
    InputError : the curve is invalid.
    ModelScopeError : the press goes through the layer."""
    radius, height = np.asarray(indentation.radius_mm), np.asarray(indentation.height_mm)
    if radius.ndim != 1 or radius.shape != height.shape or radius.size < 4:
        raise InputError(
            f"indentation: radius {radius.shape} and height {height.shape} must be equal, n >= 4"
        )
    scalars = (indentation.depth_mm, indentation.tip_radius_mm, indentation.contact_radius_mm)
    if not (np.isfinite(radius).all() and np.isfinite(height).all() and np.isfinite(scalars).all()):
        raise InputError("indentation: the profile holds a value that is not finite; solve it again")
    if indentation.tip_radius_mm <= 0 or indentation.contact_radius_mm <= 0:
        raise InputError("indentation: tip and contact radius must be positive where depth is")
    if indentation.depth_mm >= top_mm:
        raise ModelScopeError(
            f"press depth {indentation.depth_mm:g} mm reaches through the clear layer of {top_mm:g} mm; press less"
        )


def _fall(radius: float, mean_mm: float) -> float:
    """Distance of a sphere of radius `mean_mm` below its tangent plane at a radius in plan [mm]; 0 for a flat top."""
    return radius**2 / (mean_mm + float(np.sqrt(mean_mm**2 - radius**2))) if mean_mm > 0.0 else 0.0


def _single_valued(
    indentation: Indentation, tip: float, start: float, mean_mm: float
) -> tuple[FloatArray, FloatArray, FloatArray, float, float]:
    """Curve with one height per radius from the sphere's end outward, the largest move, and the contact radius [mm].

    The curve is three arrays: radius [mm], height relative to the undisturbed top [mm], slope dh/dr (NaN if unknown).
    """
    depth = indentation.depth_mm
    radius = np.asarray(indentation.radius_mm, dtype=np.float64)
    height = np.asarray(indentation.height_mm, dtype=np.float64)
    outward = np.maximum.accumulate(radius)
    moved = float(np.max(outward - radius))
    is_upright = (radius[1:] > outward[:-1] - UPRIGHT_MM) & (np.diff(height) > 0)
    is_new = np.concatenate(([True], (np.diff(outward) > 0) | is_upright)) & (
        radius > start + MIN_KNOT_STEP_MM
    )
    touched = indentation.contact_radius_mm * (1.0 + TOUCHING)
    contact = start
    first = -depth + tip - float(np.sqrt(tip**2 - start**2)) + _fall(start, mean_mm)
    knots_r, knots_h, slopes = [start], [first], [np.nan]
    for r, h, slope in zip(radius[is_new], height[is_new], _slopes(indentation)[is_new], strict=True):
        if indentation.is_hemisphere and r < tip:
            h = min(h, -depth + tip - np.sqrt(max(tip**2 - r**2, 0.0)) + _fall(r, mean_mm))
        placed = max(r, knots_r[-1] + MIN_KNOT_STEP_MM, knots_r[-1] + abs(h - knots_h[-1]) / MAX_SLOPE)
        moved = max(moved, placed - r)
        knots_r.append(placed)
        knots_h.append(float(h))
        slopes.append(float(slope) if placed == r else np.nan)
        if r <= touched and h < 0:
            contact = placed
    return np.array(knots_r), np.array(knots_h), np.array(slopes), moved, contact


def _slopes(indentation: Indentation) -> FloatArray:
    """(n,) slope dh/dr at the points [-]; NaN if it is unknown, or steeper than `MAX_SLOPE`."""
    if indentation.inclination_deg is None:
        return np.full(np.shape(indentation.radius_mm), np.nan)
    angle = np.radians(indentation.inclination_deg)
    with np.errstate(divide="ignore", invalid="ignore"):
        slope = np.sin(angle) / np.cos(angle)
    return np.where((np.cos(angle) > 0.0) & (np.abs(slope) < MAX_SLOPE), slope, np.nan)


def _with_tail(
    radius: FloatArray, height: FloatArray, given: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Radius, height and slope of a curve, after it is cut where it becomes flat and closed by a cubic tail."""
    slope = Akima1DInterpolator(radius, height, method="makima").derivative()(radius)
    slope = np.where(np.isfinite(given), given, slope)
    slope = np.clip(slope, -MAX_SLOPE, MAX_SLOPE)
    counts = np.flatnonzero((np.abs(height) > CUT_HEIGHT_MM) | (np.abs(slope) > CUT_SLOPE))
    last = int(counts[-1]) + 1
    return (
        np.append(radius[:last], radius[last - 1] + TAIL_MM),
        np.append(height[:last], 0.0),
        np.append(slope[:last], 0.0),
    )
