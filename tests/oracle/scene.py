"""The pad as the ray tracer takes it: checked numbers of walls, bottom, crown and patches; Fresnel's and Snell's laws.
In plan the pad is convex. Each flat wall has a position, a tangent and an outward normal; each round wall has a sector.
A rectangle is four flat walls. The bottom is the plane z = 0; the untouched top is flat or a crown. A patch is the
rectangular face of an emitter or receiver.

Light is unpolarised at each reflection (Born & Wolf, Principles of Optics, § 1.5). `ratio` is the index on the ray's
side divided by the index behind the border. If it is above 1, reflection is total beyond the critical angle.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from optopad.design.arrays import BoolArray, FloatArray, IntArray
from optopad.design.errors import InputError
from optopad.sims.optics.scene.optical_scene import OpticalScene, PadForm
from tests.oracle.chance import pattern_shares
from tests.oracle.surface import REACH_SHARE, sag


@njit()
def fresnel_reflectance(cosine: float, ratio: float) -> float:
    """Share of unpolarised light that a border between two media reflects.

    cosine : cosine of the angle of incidence [-]
    ratio : index on the ray's side divided by the index behind the border [-]
    """
    refracted = 1.0 - ratio * ratio * (1.0 - cosine * cosine)
    if refracted <= 0.0:
        return 1.0
    out = math.sqrt(refracted)
    across = (ratio * cosine - out) / (ratio * cosine + out)
    within = (cosine - ratio * out) / (cosine + ratio * out)
    return 0.5 * (across * across + within * within)


@njit()
def refracted_direction(
    dx: float, dy: float, dz: float, nx: float, ny: float, nz: float, ratio: float
) -> tuple[float, float, float]:
    """Direction behind a border of light that is not totally reflected (Snell's law).

    Parameters
    ----------
    dx, dy, dz : unit direction before the border [-]
    nx, ny, nz : unit normal that points to the far side [-]
    ratio : index on the ray's side divided by the index behind the border [-]
    """
    cosine = dx * nx + dy * ny + dz * nz
    turn = math.sqrt(max(1.0 - ratio * ratio * (1.0 - cosine * cosine), 0.0)) - ratio * cosine
    ex, ey, ez = ratio * dx + turn * nx, ratio * dy + turn * ny, ratio * dz + turn * nz
    size = math.sqrt(ex * ex + ey * ey + ez * ez)
    return ex / size, ey / size, ez / size


UNIT_TOLERANCE = 1e-9
"""Tolerance for rounding, of unit vectors [-] and of points on a wall [mm]."""
BOX_TOLERANCE_MM = 1e-6
ROUND_POINTS = 3600
"""Number of points that represent a round wall; between two points the wall bulges by 4e-7 of its radius."""


def rectangle_walls(length_mm: float, width_mm: float) -> FloatArray:
    """(4, 6) south, east, north and west wall of a rectangle that begins at 0, 0; columns as in `PadForm.walls`."""
    return np.array(
        [
            (0.0, 0.0, 1.0, 0.0, 0.0, -1.0),
            (length_mm, 0.0, 0.0, 1.0, 1.0, 0.0),
            (0.0, width_mm, 1.0, 0.0, 0.0, 1.0),
            (0.0, 0.0, 0.0, 1.0, -1.0, 0.0),
        ]
    )


def wall_runs(walls: FloatArray, arcs: FloatArray) -> FloatArray:
    """(k, 2) start and end of each flat wall along its tangent, where other walls cut it [mm].

    If a start comes after the end, nothing of the wall is left. `walls` (k, 6) and `arcs` (m, 6) are as in `PadForm`.
    """
    runs = np.empty((len(walls), 2))
    for number, (x, y, tx, ty, _, _) in enumerate(walls):
        cuts = np.array([*_line_cuts(walls, x, y, tx, ty), *_arc_cuts(arcs, x, y, tx, ty)])
        # the pad is convex: its wall extends from the first to the last cut that is in it, or beyond
        kept = cuts[_lies_in(walls, arcs, x, y, tx, ty, cuts)]
        low, high = kept.min(initial=math.inf), kept.max(initial=-math.inf)
        if len(kept):
            beyond = _lies_in(walls, arcs, x, y, tx, ty, np.array([low - 1.0, high + 1.0]))
            low, high = (-math.inf if beyond[0] else low), (math.inf if beyond[1] else high)
        runs[number] = low, high
    return runs


def _line_cuts(walls: FloatArray, x: float, y: float, tx: float, ty: float) -> list[float]:
    """Positions along a line at which it crosses flat walls [mm]."""
    cuts = []
    for ox, oy, _, _, nx, ny in walls:
        beyond, growth = nx * (x - ox) + ny * (y - oy), nx * tx + ny * ty
        if abs(growth) > UNIT_TOLERANCE:
            cuts.append(-beyond / growth)
    return cuts


def _arc_cuts(arcs: FloatArray, x: float, y: float, tx: float, ty: float) -> list[float]:
    """Positions along a line where it crosses the arcs' circles or, if it misses one, is nearest to it [mm]."""
    cuts = []
    for cx, cy, radius, *_ in arcs:
        px, py = x - cx, y - cy
        middle = px * tx + py * ty
        gap = middle * middle - (px * px + py * py - radius * radius)
        half = math.sqrt(max(gap, 0.0))
        cuts += [-middle - half, -middle, -middle + half]
    return cuts


def _lies_in(
    walls: FloatArray, arcs: FloatArray, x: float, y: float, tx: float, ty: float, along: FloatArray
) -> BoolArray:
    """(n,) mask of the positions `along` a line in plan that are in the pad or on its border."""
    places = np.stack([x + along * tx, y + along * ty], axis=-1)
    beyond = _beyond_mm(walls, arcs, places)
    return np.asarray(beyond.max(axis=-1, initial=-math.inf) <= UNIT_TOLERANCE)


def _beyond_mm(walls: FloatArray, arcs: FloatArray, places: FloatArray) -> FloatArray:
    flat = np.sum((places[..., None, :] - walls[:, :2]) * walls[:, 4:], axis=-1)
    off = places[..., None, :] - arcs[:, :2]
    away = np.hypot(off[..., 0], off[..., 1])
    is_here = np.sum(off * arcs[:, 3:5], axis=-1) >= arcs[:, 5] * away
    return np.concatenate([flat, np.where(is_here, away - arcs[:, 2], -np.inf)], axis=-1)


def beyond_walls_mm(form: PadForm, places_mm: FloatArray) -> FloatArray:
    """(..., k + m) distance of (..., 2) points from each flat and round wall [mm]: positive outside, negative inside.

    The distance is -inf for a round wall if the point is not in the wall's sector.
    """
    return _beyond_mm(*form_rows(form), np.asarray(places_mm, dtype=np.float64))


def form_rows(form: PadForm) -> tuple[FloatArray, FloatArray]:
    """Flat walls (k, 6) and round walls (m, 6) of a `PadForm`, as contiguous arrays."""
    walls, arcs = (np.ascontiguousarray(rows, dtype=np.float64) for rows in (form.walls, form.arcs))
    return walls, arcs


def outline_mm(form: PadForm) -> FloatArray:
    """(n, 2) ends of the flat walls and points of the round walls; their convex hull is the pad in plan [mm]."""
    walls, arcs = form_rows(form)
    ends = walls[:, None, :2] + wall_runs(walls, arcs)[:, :, None] * walls[:, None, 2:4]
    angle = np.linspace(0.0, 2.0 * math.pi, ROUND_POINTS, endpoint=False)
    around = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    found = [ends.reshape(-1, 2)]
    for arc in arcs:
        ring = arc[:2] + arc[2] * around[around @ arc[3:5] >= arc[5]]
        found.append(ring[beyond_walls_mm(form, ring).max(axis=-1) <= UNIT_TOLERANCE])
    return np.vstack(found)


def check_form(scene: OpticalScene, form: PadForm) -> None:
    """Check the walls and the crown of a pad.

    Raises
    ------
    InputError : the walls do not enclose a pad, or the crown does not cover it.
    """
    _check_numbers(form)
    for number, (low, high) in enumerate(wall_runs(*form_rows(form))):
        if not high - low > UNIT_TOLERANCE:
            raise InputError(
                f"form.walls[{number}]: nothing of it bounds the pad; take it out, or turn the walls' normals outward"
            )
        if not (np.isfinite(low) and np.isfinite(high)):
            raise InputError(
                f"form.walls[{number}]: runs on without end; give the walls that close the outline"
            )
    outline = outline_mm(form)
    low, high = outline.min(axis=0), outline.max(axis=0)
    for axis, first, last, size in zip("xy", low, high, (scene.length_mm, scene.width_mm), strict=True):
        if first < -BOX_TOLERANCE_MM or last > size + BOX_TOLERANCE_MM:
            name = "length_mm" if axis == "x" else "width_mm"
            raise InputError(
                f"form: the plan runs from {axis} = {first:g} to {last:g} mm, outside its box of 0 to {size:g} mm;"
                f" move the walls or correct {name}"
            )
    if beyond_walls_mm(form, np.asarray(form.top.apex_mm)).max() > UNIT_TOLERANCE:
        raise InputError(
            f"form.top.apex_mm: {tuple(form.top.apex_mm)} lies outside the walls; it is the middle of the pad, and the"
            " walls' normals point away from it"
        )
    if not form.top.is_flat:
        _check_crown(scene, form, outline)


def _check_numbers(form: PadForm) -> None:
    walls, arcs = form_rows(form)
    if walls.ndim != 2 or walls.shape[1] != 6:
        raise InputError(f"form.walls: shape {walls.shape}, needs (k, 6): x, y, tx, ty, nx, ny")
    if arcs.ndim != 2 or arcs.shape[1] != 6:
        raise InputError(f"form.arcs: shape {arcs.shape}, needs (m, 6): x, y, radius, ux, uy, cosine")
    for number, row in enumerate(arcs):
        size = float(np.hypot(*row[3:5]))
        is_sector = row[5] == -1.0 if size == 0.0 else abs(size - 1.0) <= UNIT_TOLERANCE
        if not np.isfinite(row).all() or row[2] <= 0.0 or not is_sector:
            raise InputError(
                f"form.arcs[{number}]: {row.tolist()}, needs finite x, y, a radius > 0 mm, and a unit vector with the"
                " cosine of half the sector's turn, or 0, 0, -1 for a whole circle"
            )
    if not len(arcs) and len(walls) < 3:
        raise InputError(
            f"form.walls: {len(walls)} flat walls and no round one enclose nothing; give at least 3"
        )
    for number, row in enumerate(walls):
        if not np.isfinite(row).all():
            raise InputError(f"form.walls[{number}]: {row.tolist()} must be finite")
        for name, vector in (("tangent", row[2:4]), ("normal", row[4:])):
            size = float(np.hypot(*vector))
            if abs(size - 1.0) > UNIT_TOLERANCE:
                raise InputError(
                    f"form.walls[{number}]: its {name} has the length {size:.10g}; scale it to 1"
                )
        if abs(float(row[2:4] @ row[4:])) > UNIT_TOLERANCE:
            raise InputError(
                f"form.walls[{number}]: tangent and normal are not at right angles; turn one of them"
            )
    kx, ky = form.top.kx, form.top.ky
    if not (0.0 <= kx < np.inf and 0.0 <= ky < np.inf and (kx == ky or 0.0 in (kx, ky))):
        raise InputError(
            f"form.top: curvatures of {kx:g} and {ky:g} 1/mm must be >= 0, and equal or one of them 0"
        )
    if np.shape(form.top.apex_mm) != (2,) or not np.isfinite(form.top.apex_mm).all():
        raise InputError(f"form.top.apex_mm: {form.top.apex_mm}, needs finite x and y")


def _check_crown(scene: OpticalScene, form: PadForm, outline: FloatArray) -> None:
    used = np.array([form.top.kx > 0.0, form.top.ky > 0.0])
    reach = float(np.hypot(*((outline - form.top.apex_mm) * used).T).max())
    if reach > REACH_SHARE * form.top.radius_mm:
        raise InputError(
            f"form.top: a crown of {form.top.radius_mm:g} mm over a plan that reaches {reach:g} mm from the apex,"
            f" needs >= {reach / REACH_SHARE:g} mm; flatten the crown"
        )
    rim = float(form.top.height_mm(outline[:, 0], outline[:, 1]).min())
    if rim <= 0.0:
        raise InputError(
            f"form: the rim of the crown lies {-rim:g} mm below the bottom, with a height_mm of {scene.height_mm:g} mm"
            " at the apex; raise it or flatten the crown"
        )


NO_FACE, BOTTOM_FACE, ROUND_FACE = -1, -2, -3
"""Codes of surfaces besides flat walls. Flat walls are numbered from 0; round walls count down from `ROUND_FACE`."""
POWER_TOLERANCE = 1e-6
"""Largest deviation of a radiance table's power from 1 [-], as tables may have been rounded."""


class OracleScene(NamedTuple):
    """`OpticalScene` as a tuple for compiled code; only the attributes that differ from `OpticalScene` are listed.

    Attributes
    ----------
    walls, arcs : (k, 6) flat and (m, 6) round walls, as in `PadForm`
    crown : (4,) curvatures of the untouched top along x and y [1/mm]; x, y of its apex [mm]
    wall_ratio : index of the elastomer divided by the index behind smooth walls [-]; 0 if walls only scatter
    emitter_pattern : (2, e, n) radiance table [1/sr] and the share of power below each node [-]. An emitter's
        Lambertian order is used instead if its table row is NaN or n is 0
    receiver_response : (r, n) share of arriving light that is counted [-]; if n is 0, all light is counted
    """

    walls: FloatArray
    arcs: FloatArray
    crown: FloatArray
    height: float
    refractive_index: float
    absorption: float
    wall_reflectance: float
    bottom_reflectance: float
    tip_reflectance: float
    wall_ratio: float
    emitter_wall: IntArray
    emitter_patch: FloatArray
    emitter_order: FloatArray
    emitter_pattern: FloatArray
    receiver_wall: IntArray
    receiver_patch: FloatArray
    receiver_response: FloatArray


def lower_scene(scene: OpticalScene) -> OracleScene:
    """Check a scene and convert it to a tuple for compiled code.

    Raises
    ------
    InputError : a number of the scene is out of range, or walls, crown and patches do not fit together.
    """
    for name in ("length_mm", "width_mm", "height_mm"):
        _require(name, getattr(scene, name), 0.0, np.inf, open_low=True)
    _require("refractive_index", scene.refractive_index, 1.0, np.inf)
    _require("absorption_per_mm", scene.absorption_per_mm, 0.0, np.inf)
    for name in ("wall_reflectance", "bottom_reflectance", "tip_reflectance"):
        _require(name, getattr(scene, name), 0.0, 1.0)
    walls, arcs, crown = _lowered_form(scene)
    for kind in ("emitter", "receiver"):
        _check_patches(scene, kind)
    order = np.asarray(scene.emitter_order, dtype=np.float64)
    if order.shape != np.shape(scene.emitter_wall):
        raise InputError(f"emitter_order: shape {order.shape}, needs {np.shape(scene.emitter_wall)}")
    for i, m in enumerate(order):
        _require(f"emitter_order[{i}]", float(m), 0.0, np.inf)
    radiance = _lowered_patterns(scene)
    return OracleScene(
        walls,
        arcs,
        crown,
        float(scene.height_mm),
        float(scene.refractive_index),
        float(scene.absorption_per_mm),
        float(scene.wall_reflectance),
        float(scene.bottom_reflectance),
        float(scene.tip_reflectance),
        _wall_ratio(scene),
        np.ascontiguousarray(scene.emitter_wall, dtype=np.int64),
        np.ascontiguousarray(scene.emitter_patch, dtype=np.float64),
        np.ascontiguousarray(order),
        np.stack([radiance, pattern_shares(radiance) if radiance.size else radiance]),
        np.ascontiguousarray(scene.receiver_wall, dtype=np.int64),
        np.ascontiguousarray(scene.receiver_patch, dtype=np.float64),
        _lowered_responses(scene),
    )


def _lowered_form(scene: OpticalScene) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Attributes `walls`, `arcs` and `crown` of `OracleScene`, after checking the pad's."""
    form = scene.form
    if form is None:
        walls = rectangle_walls(float(scene.length_mm), float(scene.width_mm))
        return walls, np.empty((0, 6)), np.zeros(4)
    check_form(scene, form)
    return *form_rows(form), np.array([form.top.kx, form.top.ky, *form.top.apex_mm])


def _wall_ratio(scene: OpticalScene) -> float:
    if scene.wall_index is None:
        return 0.0
    _require("wall_index", scene.wall_index, 1.0, np.inf)
    return float(scene.refractive_index) / float(scene.wall_index)


def _table(given: FloatArray | None, name: str, rows: int) -> FloatArray:
    """(rows, n) table over cosines as an array; (rows, 0) if the scene has no such table."""
    if given is None:
        return np.empty((rows, 0))
    table = np.ascontiguousarray(given, dtype=np.float64)
    if table.ndim != 2 or table.shape[0] != rows or table.shape[1] < 2:
        raise InputError(f"{name}: shape {table.shape}, needs ({rows}, n) with n >= 2 cosines from 0 to 1")
    return table


def _lowered_patterns(scene: OpticalScene) -> FloatArray:
    radiance = _table(scene.emitter_pattern, "emitter_pattern", len(scene.emitter_wall))
    if not radiance.size:
        return radiance
    for i, row in enumerate(radiance):
        if np.isnan(row).all():
            continue
        if not np.isfinite(row).all() or row.min() < 0.0:
            raise InputError(f"emitter_pattern[{i}]: a radiance is negative or not finite; give numbers >= 0")
        power = float(pattern_shares(row[None])[0, -1])
        if abs(power - 1.0) > POWER_TOLERANCE:
            raise InputError(f"emitter_pattern[{i}]: radiates {power:.7g} of the unit power; scale it to 1")
    return radiance


def _lowered_responses(scene: OpticalScene) -> FloatArray:
    response = _table(scene.receiver_response, "receiver_response", len(scene.receiver_wall))
    for i, row in enumerate(response):
        if row.size and not ((row >= 0.0) & (row <= 1.0)).all():
            raise InputError(f"receiver_response[{i}]: {row.min():g} to {row.max():g} must lie within 0 to 1")
    return response


def _require(name: str, value: float, low: float, high: float, *, open_low: bool = False) -> None:
    """Refuse a number outside its range, NaN or infinity."""
    if not (np.isfinite(value) and low <= value <= high and not (open_low and value == low)):
        sign = ">" if open_low else ">="
        limit = f"{sign} {low:g}" + ("" if np.isinf(high) else f" and <= {high:g}")
        raise InputError(f"{name}: {value:g} must be {limit}")


def _check_patches(scene: OpticalScene, kind: str) -> None:
    """Refuse emitters or receivers, as `kind` names, that are not rectangles on a flat wall of the pad."""
    walls, patches = np.asarray(getattr(scene, f"{kind}_wall")), np.asarray(getattr(scene, f"{kind}_patch"))
    if walls.ndim != 1 or patches.shape != (walls.size, 4):
        raise InputError(f"{kind}_patch: shape {patches.shape}, needs ({walls.size}, 4)")
    if scene.form is None:
        runs = np.array([(0.0, run) for run in (scene.length_mm, scene.width_mm) * 2])
        words, slack = "south 0, east 1, north 2, west 3", 0.0
    else:
        runs = wall_runs(*form_rows(scene.form))
        words, slack = f"the form has {len(runs)}, from 0", UNIT_TOLERANCE
    for i, (wall, patch) in enumerate(zip(walls, patches, strict=True)):
        name = f"{kind}_patch[{i}]"
        if wall not in range(len(runs)):
            raise InputError(f"{kind}_wall[{i}]: {wall} is no wall; {words}")
        if not np.isfinite(patch).all() or patch[2] <= 0.0 or patch[3] <= 0.0:
            raise InputError(f"{name}: {patch.tolist()} must be finite, with half sizes > 0 mm")
        low, high = runs[wall]
        if patch[0] - patch[2] < low - slack or patch[0] + patch[2] > high + slack:
            wall_text = f"of {high:g} mm" if scene.form is None else f"from {low:g} to {high:g} mm"
            raise InputError(
                f"{name}: spans {patch[0] - patch[2]:g} to {patch[0] + patch[2]:g} mm along a wall"
                f" {wall_text}; move it along the wall"
            )
        if patch[1] - patch[3] < 0.0:
            raise InputError(f"{name}: reaches {patch[3] - patch[1]:g} mm below the bottom; raise it")


@njit()
def untouched_top(scene: OracleScene, x: float, y: float) -> float:
    """Height of the untouched top at a point [mm]."""
    kx, ky, apex_x, apex_y = scene.crown
    if kx == ky == 0.0:
        return scene.height
    return float(scene.height - sag(kx, ky, x - apex_x, y - apex_y)[0])


@njit()
def inward_normal(scene: OracleScene, face: int, x: float, y: float) -> tuple[float, float, float]:
    """Unit normal of a wall or the bottom at a point, pointing into the elastomer."""
    if face == BOTTOM_FACE:
        return 0.0, 0.0, 1.0
    if face <= ROUND_FACE:
        arc = scene.arcs[ROUND_FACE - face]
        px, py = arc[0] - x, arc[1] - y
        size = math.hypot(px, py)
        return px / size, py / size, 0.0
    return 0.0 - scene.walls[face, 4], 0.0 - scene.walls[face, 5], 0.0


@njit(forceinline=True)
def emission_point(scene: OracleScene, emitter: int, u: float, v: float) -> tuple[float, float, float]:
    """Point of an emitter's rectangle at fractions u, v in [0, 1) of its width and height."""
    along, height, half_width, half_height = scene.emitter_patch[emitter]
    along += (2.0 * u - 1.0) * half_width
    height += (2.0 * v - 1.0) * half_height
    x, y, tx, ty, _, _ = scene.walls[scene.emitter_wall[emitter]]
    return x + along * tx, y + along * ty, height


@njit(forceinline=True)
def face_hit(
    scene: OracleScene, x: float, y: float, z: float, dx: float, dy: float, dz: float
) -> tuple[float, int]:
    """Distance to the nearest wall or the bottom [mm], and its code; walls are taken as endless upward."""
    best, face = math.inf, NO_FACE
    for wall in range(scene.walls.shape[0]):
        ox, oy, _, _, nx, ny = scene.walls[wall]
        toward = nx * dx + ny * dy
        if toward > 0.0:
            distance = -(nx * (x - ox) + ny * (y - oy)) / toward
            if distance < best:
                best, face = distance, wall
    for number in range(scene.arcs.shape[0]):
        distance = _round_distance(scene.arcs[number], x, y, dx, dy)
        if distance < best:
            best, face = distance, ROUND_FACE - number
    if dz < 0.0 and -z / dz < best:
        best, face = -z / dz, BOTTOM_FACE
    return max(best, 0.0), face


@njit()
def _round_distance(arc: FloatArray, x: float, y: float, dx: float, dy: float) -> float:
    """Distance at which a ray from inside leaves through a round wall [mm]; infinite if it leaves by another wall."""
    px, py, radius = x - arc[0], y - arc[1], arc[2]
    a, b, c = dx * dx + dy * dy, px * dx + py * dy, px * px + py * py - radius * radius
    if a < 1e-28:
        return math.inf
    gap = b * b - a * c
    root = math.sqrt(max(gap, 0.0))
    far = -c / (b + root) if b > 0.0 and gap > 0.0 else (root - b) / a
    qx, qy = px + far * dx, py + far * dy
    return float(far) if qx * arc[3] + qy * arc[4] >= arc[5] * math.hypot(qx, qy) else math.inf


@njit(forceinline=True)
def receiver_at(scene: OracleScene, face: int, x: float, y: float, z: float) -> int:
    """Number of the receiver that covers a point of a wall below the undisturbed top; -1 if there is none."""
    if face >= 0 and z <= untouched_top(scene, x, y):
        ox, oy, tx, ty, _, _ = scene.walls[face]
        along = tx * (x - ox) + ty * (y - oy)
        for k in range(scene.receiver_wall.shape[0]):
            if (
                scene.receiver_wall[k] == face
                and abs(along - scene.receiver_patch[k, 0]) <= scene.receiver_patch[k, 2]
                and abs(z - scene.receiver_patch[k, 1]) <= scene.receiver_patch[k, 3]
            ):
                return k
    return -1
