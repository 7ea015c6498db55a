"""Lower indentations to radial tables that the ray kernels read.

Model
-----
Around the press axis the top is h(r): the exact tip sphere inside the contact, then a C1 curve
through the indentation's points (with the slopes of its inclinations, else modified Akima's), then a C1
cubic tail to the undisturbed height, then flat. The pile-up may rise above the undisturbed top. A tip that is no
hemisphere has no sphere: the curve begins `APEX_MM` off the axis, and the contact is the part of it within the
contact radius.

Between contact edge and outer radius the curve is stored as cubic pieces (`sims.optics.surface.curves`).

Choices and their bounds
------------------------
* One height for each radius: points whose radius does not exceed an earlier one are dropped, which
  keeps the lowest of an overhang (the material above it is removed).
* Slopes are at most `MAX_SLOPE`: points above a steep piece move outward by at most their rise over
  `MAX_SLOPE` (1 mm of wrapped shank: 0.033 mm). `moved_mm` is the largest move, overhang included.
* Material never reaches into the tip: heights below the sphere's are kept, higher ones are clipped.
* Where the curve wraps the shank it counts as contact up to its last point within the contact radius, so light that
  lands there meets the tip. Up to there the curve is a wall as steep as `MAX_SLOPE`.
* Flat beyond: the curve is cut at the last point that is higher than `CUT_HEIGHT_MM` or steeper than
  `CUT_SLOPE`, and ends in a tail of `TAIL_MM`. A residual slope e moves a mirror image by 2 e D:
  at 20 mm 0.8 µm, below 0.05 % of a 2 mm receiver. That holds for curves that run out, as the contact model's do
  (`sims.contact.library.smooth_press`); one that ends in a slope dips in its tail by 4/27 of slope x `TAIL_MM`.

Left out: anything not axisymmetric (`sims.optics.surface.tops` adds several tips and a smooth field).

Lower a radial curve to the table that the ray kernels read.

Between contact edge a and outer radius b the curve h(r) is stored as `CELLS` cubic pieces, uniform in

    x = sqrt(A r² + D) - C,    x(a) = 0,    x(b) = CELLS,

so that a kernel needs one square root from r² to a height, and none from there to a gradient:
dh/dr / r = h' A / (x + C). C makes the first piece `FIRST_PIECE` of the mean one: pieces are short at the contact edge
and nearly uniform in r beyond. Each piece also has the data for a march along a ray from there: bounds of slope outward
and of fall outward, the window inward, and the bound of bend within that window. Bend is the rate at which the slope
along a line falls, -d²h/ds², the largest of all directions: max(-h'', -h'/r, 0).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np
from scipy.interpolate import Akima1DInterpolator, CubicHermiteSpline

from design.arrays import FloatArray
from design.errors import InputError, ModelScopeError
from sims.optics.scene.optical_scene import OpticalScene
from sims.press import Indentation

CELLS = 320
LEVELS = 64
FIRST_PIECE = 0.25
BOUND_RESERVE = 1.01
"""Safety factor on the largest of `SAMPLES` slopes of a piece."""
SAMPLES = 9
NEAREST_WINDOW_MM, WINDOW_SHARE = 0.06, 0.25
"""Window of a march inward [mm], or share of its radius; a larger window has a larger bend."""

# columns of a piece
CUBIC, STEEP, FALL, WINDOW, BEND = 0, 4, 5, 6, 7
PIECE_COLUMNS = 8


@dataclass(frozen=True, kw_only=True)
class RadialTable:
    """One curve as kernels read it.

    Attributes
    ----------
    pieces : (CELLS, 8) height above the clear layer's bottom as a cubic in the piece's fraction [mm]; from this piece
        outward the largest |dh/dr| and the largest fall -dh/dr [-]; window inward [mm], largest bend within it
        and outward [1/mm]
    reach2 : (LEVELS,) squared radius beyond which the top is nowhere below the upper edge of each level between
        its lowest point and the undisturbed top [mm²]
    scale, offset, start : A [1/mm²], D and C of the coordinate x
    radius, slope : (CELLS + 1,) of the nodes [mm], [-]
    """

    pieces: FloatArray
    reach2: FloatArray
    scale: float
    offset: float
    start: float
    radius: FloatArray
    slope: FloatArray


def node_radii_mm(first_mm: float, last_mm: float) -> tuple[FloatArray, float, float]:
    """(CELLS + 1,) radii of the nodes [mm], and A [1/mm²] and C of the coordinate."""
    start = CELLS * FIRST_PIECE * first_mm / (last_mm + first_mm * (1.0 - 2.0 * FIRST_PIECE))
    scale = CELLS * (CELLS + 2.0 * start) / (last_mm**2 - first_mm**2)
    x = np.arange(CELLS + 1) + start
    radii = np.sqrt(first_mm**2 + (x**2 - start**2) / scale)
    radii[0], radii[-1] = first_mm, last_mm
    return radii, scale, start


def radial_table(
    radius: FloatArray, height: FloatArray, slope: FloatArray, *, top_mm: float, lowest_mm: float
) -> RadialTable:
    """Lower the C1 cubic curve through knots with slopes.

    Parameters
    ----------
    radius, height, slope : (n,) rising radii, heights relative to the undisturbed top [mm], dh/dr [-]
    top_mm, lowest_mm : undisturbed top and lowest point of the tip above the bottom [mm]
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
    """(CELLS,) lower bound of each cubic's height: its lowest Bernstein coefficient [mm]."""
    c0, c1, c2, c3 = pieces[:, :4].T
    return np.asarray(np.min([c0, c0 + c1 / 3, c0 + (2 * c1 + c2) / 3, c0 + c1 + c2 + c3], axis=0))


def outward_cup(table: RadialTable) -> FloatArray:
    """(CELLS,) largest rate at which the slope along a line rises, d²h/ds², from each piece outward: max(h'', h'/r, 0)
    [1/mm].
    """
    return _outward_maximum(_bends_within(-table.pieces, table.radius, table.scale, table.start))


def _samples(nodes: FloatArray, scale: float, start: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(SAMPLES,) fractions of a piece, and (CELLS, SAMPLES) x + C and radius there [mm]."""
    t = np.linspace(0.0, 1.0, SAMPLES)
    x = np.arange(CELLS)[:, None] + t + start
    return t, x, np.sqrt(np.maximum(nodes[0] ** 2 + (x**2 - start**2) / scale, nodes[0] ** 2))


def _slopes_within(pieces: FloatArray, nodes: FloatArray, scale: float, start: float) -> FloatArray:
    """(CELLS, SAMPLES) dh/dr at evenly spread points of every piece."""
    t, x, r = _samples(nodes, scale, start)
    gradient = pieces[:, 1:2] + 2 * pieces[:, 2:3] * t + 3 * pieces[:, 3:4] * t**2
    return np.asarray(gradient * scale * r / x)


def _bends_within(pieces: FloatArray, nodes: FloatArray, scale: float, start: float) -> FloatArray:
    """(CELLS, SAMPLES) bend at evenly spread points of every piece [1/mm]."""
    t, x, r = _samples(nodes, scale, start)
    turn = (pieces[:, 1:2] + 2 * pieces[:, 2:3] * t + 3 * pieces[:, 3:4] * t**2) * scale / x
    radial = turn + (2 * pieces[:, 2:3] + 6 * pieces[:, 3:4] * t - turn / scale) * (scale * r / x) ** 2
    return np.asarray(np.maximum(np.maximum(-radial, -turn), 0.0))


def _outward_maximum(values: FloatArray) -> FloatArray:
    """(CELLS,) largest value of this and all outer pieces, with a reserve."""
    worst = BOUND_RESERVE * values.max(axis=1)
    return np.asarray(np.maximum.accumulate(worst[::-1])[::-1])


def _reach2(pieces: FloatArray, nodes: FloatArray, top_mm: float, lowest_mm: float) -> FloatArray:
    """(LEVELS,) squared radius beyond which no piece comes below each level."""
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
"""Share of the contact radius by which a point of the contact may be beyond it."""
UPRIGHT_MM = 1e-9
"""Curves that run back by less count as upright."""
APEX_MM = 1e-3
FLATTEST_APEX_MM = 1e-9

# columns of a press row
X, Y, ACTIVE, SPHERE_R, TIP_R, SPHERE_Z, OUTER_R, CONTACT_R, LOWEST, HIGHEST, SKIRT_R, TOP = range(12)
SPHERE_2, TIP_2, OUTER_2, SCALE, OFFSET, START, PER_LEVEL = range(12, 19)
CONTACT_AREA = 19
CONTACT = 20
CONTACT_PARTS = 48
COLUMNS = CONTACT + CONTACT_PARTS + 1
# a tip's row as kernels read it: the press's columns, data of the field (first tip), levels, pieces
FIELD_COLUMNS = 9
REACH = COLUMNS + FIELD_COLUMNS
PIECES = REACH + LEVELS
ROW = PIECES + PIECE_COLUMNS * CELLS


@dataclass(frozen=True, kw_only=True)
class SurfaceStack:
    """Tables of all states, as kernels read them.

    Attributes
    ----------
    press : (state, n) centre x, y [mm], active 0 or 1, radius of the exact sphere, tip radius, height of
        the tip's centre, outer radius, contact radius, lowest and highest surface, skirt radius, undisturbed top [mm];
        squares of sphere's, tip's and outer radius [mm²], scale, offset and start of the table, levels per mm; area of
        the contact and squared radii that divide it into parts of equal area [mm²]
    reach2 : (state, level) and pieces : (state, piece, 8), see `sims.optics.surface.curves.RadialTable`
    moved_mm : (state,) largest move of a point to make the curve single valued [mm]
    """

    press: FloatArray
    reach2: FloatArray
    pieces: FloatArray
    moved_mm: FloatArray


def stack_surfaces(
    indentations: Sequence[Indentation | None], centres_mm: FloatArray, scene: OpticalScene
) -> SurfaceStack:
    """Lower one indentation (or None, untouched) per state.

    Parameters
    ----------
    indentations : one per state; the same object is lowered once
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
"""Height of the top and lowered curve of each press, as long as the press is referenced."""


def _lower(indentation: Indentation, top_mm: float) -> _Lowered:
    height_mm, lowered = _LOWERED.get(indentation, (math.nan, None))
    if lowered is None or height_mm != top_mm:
        check_curve(indentation, top_mm)
        lowered = lower_curve(indentation, top_mm)
        _LOWERED[indentation] = top_mm, lowered
    return lowered


def lower_curve(indentation: Indentation, top_mm: float, mean_mm: float = 0.0) -> _Lowered:
    """A press's row of numbers (`COLUMNS`), its radial table, and the largest move of a point [mm].

    Parameters
    ----------
    top_mm : height of the undisturbed top, at which the curve ends
    mean_mm : radius of the crown above which the curve's heights are given, 0 for a flat top: in the contact they are
        those of the tip above that crown
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
    """The sphere that replaces the curve at the axis: its radius, and the radius in plan up to which it is used [mm].

    Under a hemisphere it is the tip, up to the edge of the contact or to `MAX_SLOPE`. Other tips have a sphere that
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
    """Area of the contact, sphere and curve beyond, and (CONTACT_PARTS + 1,) squared radii between equal parts of it.

    Parts of equal plan area would hardly resolve the steep side of a deep contact, which faces the parts.
    """
    angle = np.linspace(0.0, np.arcsin(start / tip), 8 * CONTACT_PARTS + 1)
    r = np.concatenate((tip * np.sin(angle), radius[1:]))
    h = np.concatenate((height[0] - tip * (np.cos(angle) - np.cos(angle[-1])), height[1:]))
    band = np.hypot(np.diff(r), np.diff(h)) * (r[1:] + r[:-1])
    area = np.concatenate(([0.0], np.cumsum(band)))
    parts = np.interp(np.linspace(0.0, area[-1], CONTACT_PARTS + 1), area, r**2)
    return np.pi * float(area[-1]), parts


def check_curve(indentation: Indentation, top_mm: float) -> None:
    """Refuse a curve that is no press into a layer of this thickness [mm]."""
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
    """Distance of a crown below its tangent plane; 0 for a flat top."""
    return radius**2 / (mean_mm + float(np.sqrt(mean_mm**2 - radius**2))) if mean_mm > 0.0 else 0.0


def _single_valued(
    indentation: Indentation, tip: float, start: float, mean_mm: float
) -> tuple[FloatArray, FloatArray, FloatArray, float, float]:
    """Radius, relative height and slope (NaN: unknown) from the sphere's end outward, largest move, contact radius."""
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
    """(n,) dh/dr at the points; NaN where the curve is steeper than a function of radius may be, or unknown."""
    if indentation.inclination_deg is None:
        return np.full(np.shape(indentation.radius_mm), np.nan)
    angle = np.radians(indentation.inclination_deg)
    with np.errstate(divide="ignore", invalid="ignore"):
        slope = np.sin(angle) / np.cos(angle)
    return np.where((np.cos(angle) > 0.0) & (np.abs(slope) < MAX_SLOPE), slope, np.nan)


def _with_tail(
    radius: FloatArray, height: FloatArray, given: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Knots with slopes, cut where the rest is flat and closed by a cubic tail."""
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
