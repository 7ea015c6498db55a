"""The pad as the ray tracer takes it: numbers of walls, bottom, crown and patches; Fresnel's and Snell's laws.
In plan the pad is convex. Each flat wall has a position, a tangent and an outward normal; each round wall has a sector.
A rectangle is four flat walls. The bottom is the plane z = 0; the untouched top is flat or a crown. A patch is the
rectangular face of an emitter or receiver.

Faces with a pose
-----------------
A face that is not on a wall is a thin rectangle in the elastomer or flush in the bottom. A ray inside meets it from the
side of its normal only, and passes from the other side. Only the part between the bottom and the untouched top is in
the scene. Parts have no bodies. A receiver's face absorbs, and an emitter's face is like the bottom: it has its
reflectance. Light in air passes these faces.

Light is unpolarised at each reflection (Born & Wolf, Principles of Optics, § 1.5). `ratio` is the index on the ray's
side divided by the index behind the border. If it is above 1, reflection is total beyond the critical angle.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from optopad.design.arrays import BoolArray, FloatArray, IntArray
from optopad.sims.optics.scene.optical_scene import OpticalScene, PadForm
from tests.oracle.chance import pattern_shares
from tests.oracle.surface import sag


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


NO_FACE, BOTTOM_FACE, ROUND_FACE = -1, -2, -3
"""Codes of surfaces besides flat walls. Flat walls are numbered from 0; round walls count down from `ROUND_FACE`."""
POSED_RECEIVER, POSED_EMITTER = 1_000_000, 2_000_000
"""Codes of the first receiver's and of the first emitter's face with a pose; far above the numbers of walls."""
BARE, SPECULAR, DIFFUSE_SKIN = range(3)
FINISHES = ("bare", "specular", "diffuse")
"""Finishes of the top, in the order of their codes."""


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
    emitter_face, receiver_face : (e, 14) and (r, 14) `posed_faces`
    top_finish : `BARE`, `SPECULAR` or `DIFFUSE_SKIN`
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
    emitter_face: FloatArray
    receiver_face: FloatArray
    top_finish: int
    top_reflectance: float


def lower_scene(scene: OpticalScene) -> OracleScene:
    """Convert a scene to a tuple for compiled code. The scene is taken as given: a pad that fits together."""
    form = scene.form
    if form is None:
        walls, arcs = rectangle_walls(float(scene.length_mm), float(scene.width_mm)), np.empty((0, 6))
        crown = np.zeros(4)
    else:
        walls, arcs = form_rows(form)
        crown = np.array([form.top.kx, form.top.ky, *form.top.apex_mm])
    radiance = _table(scene.emitter_pattern, len(scene.emitter_wall))
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
        0.0 if scene.wall_index is None else float(scene.refractive_index) / float(scene.wall_index),
        np.ascontiguousarray(scene.emitter_wall, dtype=np.int64),
        np.ascontiguousarray(scene.emitter_patch, dtype=np.float64),
        np.ascontiguousarray(scene.emitter_order, dtype=np.float64),
        np.stack([radiance, pattern_shares(radiance) if radiance.size else radiance]),
        np.ascontiguousarray(scene.receiver_wall, dtype=np.int64),
        np.ascontiguousarray(scene.receiver_patch, dtype=np.float64),
        _table(scene.receiver_response, len(scene.receiver_wall)),
        posed_faces(scene.emitter_pose, np.asarray(scene.emitter_patch, dtype=np.float64)),
        posed_faces(scene.receiver_pose, np.asarray(scene.receiver_patch, dtype=np.float64)),
        FINISHES.index(scene.top_finish),
        float(scene.top_reflectance),
    )


def posed_faces(poses: FloatArray | None, patches: FloatArray) -> FloatArray:
    """Faces from their poses, as `OpticalScene` defines them.

    Parameters
    ----------
    poses : (n, 5) centre x, y, z [mm], tilt and turn [rad]; NaN rows for faces on walls
    patches : (n, 4) rows that end with half width and half height [mm]

    Returns
    -------
    (n, 14) centre, normal, width axis and height axis (3 each); half width, half height. NaN rows for faces on walls
    """
    rows = np.full((len(patches), 14), np.nan)
    for row, pose, patch in zip(rows, () if poses is None else poses, patches, strict=poses is not None):
        x, y, z, tilt, turn = (float(value) for value in pose)
        if not math.isnan(x):
            ct, st, ca, sa = math.cos(tilt), math.sin(tilt), math.cos(turn), math.sin(turn)
            row[:] = x, y, z, ca * st, sa * st, ct, -sa, ca, 0.0, -ca * ct, -sa * ct, st, patch[2], patch[3]
    return rows


def _table(given: FloatArray | None, rows: int) -> FloatArray:
    """(rows, n) table over cosines as an array; (rows, 0) if the scene has no such table."""
    return np.empty((rows, 0)) if given is None else np.ascontiguousarray(given, dtype=np.float64)


@njit()
def untouched_top(scene: OracleScene, x: float, y: float) -> float:
    """Height of the untouched top at a point [mm]."""
    kx, ky, apex_x, apex_y = scene.crown
    if kx == ky == 0.0:
        return scene.height
    return float(scene.height - sag(kx, ky, x - apex_x, y - apex_y)[0])


@njit()
def inward_normal(scene: OracleScene, face: int, x: float, y: float) -> tuple[float, float, float]:
    """Unit normal of a wall, the bottom or a posed face at a point, pointing into the elastomer."""
    if face >= POSED_EMITTER:
        row = scene.emitter_face[face - POSED_EMITTER]
        return row[3], row[4], row[5]
    if face >= POSED_RECEIVER:
        row = scene.receiver_face[face - POSED_RECEIVER]
        return row[3], row[4], row[5]
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
    face = scene.emitter_face[emitter]
    if not math.isnan(face[0]):
        a, b = (2.0 * u - 1.0) * face[12], (2.0 * v - 1.0) * face[13]
        return (
            face[0] + a * face[6] + b * face[9],
            face[1] + a * face[7] + b * face[10],
            face[2] + a * face[8] + b * face[11],
        )
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


@njit(forceinline=True)
def posed_hit(
    scene: OracleScene, x: float, y: float, z: float, dx: float, dy: float, dz: float, limit: float
) -> tuple[float, int]:
    """Distance, up to `limit`, at which a ray inside first meets the front of a posed face [mm], and the face's code.

    The code is `NO_FACE` and the distance `limit` if the ray meets no such face. A ray meets a face that is flush with
    the bottom instead of the bottom.
    """
    best, code = limit + UNIT_TOLERANCE, NO_FACE
    for k in range(scene.receiver_face.shape[0]):
        distance = _posed_distance(scene, scene.receiver_face[k], x, y, z, dx, dy, dz)
        if distance <= best:
            best, code = distance, POSED_RECEIVER + k
    for k in range(scene.emitter_face.shape[0]):
        distance = _posed_distance(scene, scene.emitter_face[k], x, y, z, dx, dy, dz)
        if distance <= best:
            best, code = distance, POSED_EMITTER + k
    return min(best, limit), code


@njit()
def _posed_distance(
    scene: OracleScene, face: FloatArray, x: float, y: float, z: float, dx: float, dy: float, dz: float
) -> float:
    """Distance at which a ray meets the front of one face [mm]; infinite if it does not, or if the row is NaN."""
    toward = face[3] * dx + face[4] * dy + face[5] * dz
    if not toward < 0.0:
        return math.inf
    px, py, pz = x - face[0], y - face[1], z - face[2]
    distance = -(px * face[3] + py * face[4] + pz * face[5]) / toward
    if distance < 0.0:
        return math.inf
    px, py, pz = px + distance * dx, py + distance * dy, pz + distance * dz
    across = px * face[6] + py * face[7] + pz * face[8]
    if abs(across) > face[12] or abs(px * face[9] + py * face[10] + pz * face[11]) > face[13]:
        return math.inf
    if pz + face[2] > untouched_top(scene, px + face[0], py + face[1]):
        return math.inf
    return float(distance)


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
