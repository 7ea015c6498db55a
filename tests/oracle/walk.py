"""The path of one ray through the pad, written for readability: emission, flight, reflection, end.

Model
-----
Geometrical optics, unpolarised, one wavelength. An emitter is a rectangle on a wall or with a pose
(`tests.oracle.scene`); every point of it radiates cosᵐθ, or a tabulated pattern, into the elastomer. A ray flies
straight to the nearest wall, bottom, top or front of a face with a pose. The top reflects by Fresnel's equations;
transmitted light continues in air and may enter again. Walls, emitter faces, the bottom and the tip in contact are
Lambertian. Smooth walls and the emitters' faces in them mirror Fresnel's share first, and scatter part of the rest.
Receivers absorb all light that meets them, and count all of it or a share that depends on the angle of arrival.

A top with a skin reflects a fixed share of the light, by a mirror or Lambertian, and absorbs the rest. Nothing passes
it. A press changes its shape only, so contact is like the rest of the top.

Random decisions and weight
---------------------------
At the top and at a wall one random number decides whether a ray is reflected, and at a receiver whether it is counted.
Below the critical angle the reflectance is a few per cent, so following both parts would cost more than it gains.
Absorption is not random: the ray has the weight exp(-absorption · distance), and the lost part is booked as absorbed in
the volume. Each ray thus ends at one point, and all shares of the power sum to 1 up to rounding.

Light in air
------------
A ray that leaves by Snell's law flies straight, and meets the top from outside, a tip, or a wall. The top mirrors it or
lets it in by Fresnel's equations. Tips scatter or absorb as they do in contact. A wall that the dimple exposes below
the undisturbed top scatters or absorbs like any wall, but is never smooth, and its receivers absorb without counting.
Next to the pad nothing stands above the undisturbed top: light that passes over a wall has escaped. Air absorbs
nothing.

Left out
--------
Polarisation that builds up over several reflections; scattering in the elastomer.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from optopad.design.arrays import FloatArray
from tests.oracle.chance import (
    direction_about,
    draw,
    lobe_direction,
    pattern_cosine,
    table_value,
)
from tests.oracle.scene import (
    BARE,
    BOTTOM_FACE,
    NO_FACE,
    POSED_EMITTER,
    POSED_RECEIVER,
    SPECULAR,
    UNIT_TOLERANCE,
    OracleScene,
    emission_point,
    face_hit,
    fresnel_reflectance,
    inward_normal,
    posed_hit,
    receiver_at,
    refracted_direction,
    untouched_top,
)
from tests.oracle.surface import (
    CONTACT,
    INSIDE,
    NOTHING,
    OUTSIDE,
    Surface,
    is_in_elastomer,
    is_steep,
    is_untouched,
    tip_hit,
    top_hit,
)

BACK_INSIDE, OVER_THE_WALLS, ON_A_TIP, ON_A_WALL, GIVEN_UP = range(5)
"""How a flight in air ends."""
NUDGE_MM = 1e-6
"""Distance of a ray's new start from the surface that it met [mm]: the overlap of pieces, far more than rounding."""
AIR_STEP_LIMIT = 1_000
"""Number of flights in air after which a ray is given up."""


@njit()
def fly(
    scene: OracleScene,
    top: Surface,
    stream: np.uint64,
    place: tuple[float, float, float],
    direction: tuple[float, float, float],
    vertices: FloatArray,
    count: int,
) -> tuple[int, np.uint64, tuple[float, float, float], tuple[float, float, float], int]:
    """Follow one ray through the air.

    Parameters
    ----------
    stream : state of the ray's random stream
    place, direction : start just outside the elastomer [mm], unit direction [-]
    vertices, count : (n, 3) points of the path so far [mm], which are extended, and their number

    Returns
    -------
    how the flight ends; state of the random stream; end point and direction, inside the elastomer again if the ray
    enters it; number of points
    """
    (x, y, z), (dx, dy, dz) = place, direction
    for _ in range(AIR_STEP_LIMIT):
        distance, face = face_hit(scene, x, y, z, dx, dy, dz)
        distance, what, nx, ny, nz = top_hit(top, OUTSIDE, (x, y, z, dx, dy, dz), distance)
        on_tip, is_tip, tx, ty, tz = tip_hit(top, (x, y, z, dx, dy, dz), distance)
        if not is_tip and what == NOTHING and _passes_over(scene, face, distance, x, y, z, dx, dy, dz):
            return OVER_THE_WALLS, stream, (x, y, z), (dx, dy, dz), count
        if is_tip:
            distance = on_tip
        x, y, z = x + distance * dx, y + distance * dy, z + distance * dz
        count = record(vertices, count, x, y, z)
        stream, chance = draw(stream)
        if is_tip:
            nx, ny, nz = tx, ty, tz
            if chance >= scene.tip_reflectance or tx * tx + ty * ty + tz * tz == 0.0:
                return ON_A_TIP, stream, (x, y, z), (dx, dy, dz), count
        elif what != NOTHING:
            cosine = dx * nx + dy * ny + dz * nz
            if cosine <= 0.0 or chance >= fresnel_reflectance(cosine, 1.0 / scene.refractive_index):
                if cosine > 0.0:
                    dx, dy, dz = refracted_direction(dx, dy, dz, nx, ny, nz, 1.0 / scene.refractive_index)
                x, y, z = x + NUDGE_MM * nx, y + NUDGE_MM * ny, z + NUDGE_MM * nz
                return BACK_INSIDE, stream, (x, y, z), (dx, dy, dz), count
            dx, dy, dz = dx - 2.0 * cosine * nx, dy - 2.0 * cosine * ny, dz - 2.0 * cosine * nz
            x, y, z = x - NUDGE_MM * nx, y - NUDGE_MM * ny, z - NUDGE_MM * nz
            continue
        elif face == BOTTOM_FACE:
            return GIVEN_UP, stream, (x, y, z), (dx, dy, dz), count
        else:
            if chance >= scene.wall_reflectance or receiver_at(scene, face, x, y, z) >= 0:
                return ON_A_WALL, stream, (x, y, z), (dx, dy, dz), count
            nx, ny, nz = inward_normal(scene, face, x, y)
        x, y, z = x + NUDGE_MM * nx, y + NUDGE_MM * ny, z + NUDGE_MM * nz
        stream, u = draw(stream)
        stream, v = draw(stream)
        dx, dy, dz = lobe_direction(nx, ny, nz, 1.0, u, v)
    return GIVEN_UP, stream, (x, y, z), (dx, dy, dz), count


@njit()
def _passes_over(
    scene: OracleScene,
    face: int,
    distance: float,
    x: float,
    y: float,
    z: float,
    dx: float,
    dy: float,
    dz: float,
) -> bool:
    """Whether a ray, which meets no other surface, passes over the walls above the untouched top."""
    return face == NO_FACE or z + distance * dz > untouched_top(scene, x + distance * dx, y + distance * dy)


@njit()
def record(vertices: FloatArray, count: int, x: float, y: float, z: float) -> int:
    """Add a point to a path if there is space; return the number of points, which grows in any case."""
    if count < vertices.shape[0]:
        vertices[count, 0], vertices[count, 1], vertices[count, 2] = x, y, z
    return count + 1


FATES = (
    "direct",
    "top",
    "skirt",
    "wall",
    "diffuse",
    "crossing",
    "walls",
    "bottom",
    "tip",
    "volume",
    "escaped",
    "uncounted",
    "unsubmerged",
    "unresolved",
    "skin",
)
"""Possible ends of light: the first six are classes of received light, the others are losses."""
(
    DIRECT,
    TOP,
    SKIRT,
    WALL,
    DIFFUSE,
    CROSSING,
    WALLS,
    BOTTOM,
    TIP,
    VOLUME,
    ESCAPED,
    UNCOUNTED,
    UNSUBMERGED,
    UNRESOLVED,
    SKIN,
) = range(15)

SKIRT_SLOPE = 0.02
"""Slope of the pressed top against the untouched top [-]; a reflection where it is larger makes a path a `skirt`
path."""
STEP_LIMIT = 10_000
"""Number of flights after which a ray is given up and booked as unresolved."""


@njit()
def emission_direction(scene: OracleScene, emitter: int, u: float, v: float) -> tuple[float, float, float]:
    """Random direction of an emitter's light, by its table or its Lambertian order; u, v are random in [0, 1)."""
    face = (
        scene.emitter_wall[emitter] if math.isnan(scene.emitter_face[emitter, 0]) else POSED_EMITTER + emitter
    )
    nx, ny, nz = inward_normal(scene, face, 0.0, 0.0)  # a flat face's, at any point
    if scene.emitter_pattern.shape[2] > 0 and not math.isnan(scene.emitter_pattern[0, emitter, 0]):
        cosine = pattern_cosine(scene.emitter_pattern[0, emitter], scene.emitter_pattern[1, emitter], u)
        return direction_about(nx, ny, nz, cosine, v)
    return lobe_direction(nx, ny, nz, scene.emitter_order[emitter], u, v)


@njit(forceinline=True)
def walk(
    scene: OracleScene, top: Surface, emitter: int, stream: np.uint64, vertices: FloatArray
) -> tuple[int, int, float, int]:
    """Follow one ray from an emitter to its end.

    Parameters
    ----------
    stream : state of the ray's random stream
    vertices : (n, 3) array that is filled with points of the path [mm], at most n

    Returns
    -------
    fate : index into `FATES`
    receiver : number of the receiver, or -1
    weight : share of the ray's power that remains at its end [-]; the rest is absorbed in the volume
    count : number of points on the path
    """
    stream, u = draw(stream)
    stream, v = draw(stream)
    x, y, z = emission_point(scene, emitter, u, v)
    if z < -UNIT_TOLERANCE or z > untouched_top(scene, x, y) or not is_in_elastomer(top, x, y, z):
        return UNSUBMERGED, -1, 1.0, 0
    stream, u = draw(stream)
    stream, v = draw(stream)
    direction = emission_direction(scene, emitter, u, v)
    place, count = (x, y, z), record(vertices, 0, x, y, z)
    path, weight = DIRECT, 1.0
    for _ in range(STEP_LIMIT):
        fate, receiver, weight, count, stream, place, direction = walk_inside(
            scene, top, path, weight, stream, place, direction, vertices, count
        )
        if fate != ESCAPED or is_untouched(top):
            return fate, receiver, weight, count
        end, stream, place, direction, count = fly(scene, top, stream, place, direction, vertices, count)
        if end != BACK_INSIDE:
            return _fate_in_air(end), -1, weight, count
        path = CROSSING
    return UNRESOLVED, -1, weight, count


@njit(forceinline=True)
def walk_inside(
    scene: OracleScene,
    top: Surface,
    path: int,
    weight: float,
    stream: np.uint64,
    place: tuple[float, float, float],
    direction: tuple[float, float, float],
    vertices: FloatArray,
    count: int,
) -> tuple[int, int, float, int, np.uint64, tuple[float, float, float], tuple[float, float, float]]:
    """Follow one ray within the elastomer, until it ends or leaves through the top.

    Parameters
    ----------
    path : class of the light so far, an index into `FATES`
    weight : share of the ray's power that remains after absorption so far [-]
    stream : state of the ray's random stream
    place, direction : start [mm], and unit direction [-]
    vertices, count : (n, 3) points of the path so far [mm], which are extended, and their number

    Returns
    -------
    fate, receiver, weight and count as for `walk`; then state of the random stream, point and direction. If the fate is
    `ESCAPED`, point and direction are those just outside the top
    """
    (x, y, z), (dx, dy, dz) = place, direction
    for _ in range(STEP_LIMIT):
        distance, face = face_hit(scene, x, y, z, dx, dy, dz)
        distance, posed = posed_hit(scene, x, y, z, dx, dy, dz, distance)
        face = face if posed == NO_FACE else posed
        distance, what, nx, ny, nz = top_hit(top, INSIDE, (x, y, z, dx, dy, dz), distance)
        x, y, z = x + distance * dx, y + distance * dy, z + distance * dz
        weight *= math.exp(-scene.absorption * distance)
        count = record(vertices, count, x, y, z)
        stream, chance = draw(stream)
        if what != NOTHING and scene.top_finish != BARE:
            cosine = dx * nx + dy * ny + dz * nz
            x, y, z = x - NUDGE_MM * nx, y - NUDGE_MM * ny, z - NUDGE_MM * nz
            if cosine <= 0.0:
                continue
            if chance >= scene.top_reflectance:
                return SKIN, -1, weight, count, stream, place, direction
            if scene.top_finish == SPECULAR:
                dx, dy, dz = dx - 2.0 * cosine * nx, dy - 2.0 * cosine * ny, dz - 2.0 * cosine * nz
                path = max(path, SKIRT if is_steep(top, SKIRT_SLOPE, (x, y, z, nx, ny, nz)) else TOP)
                continue
            nx, ny, nz = -nx, -ny, -nz
        elif what != NOTHING and what != CONTACT:
            cosine = dx * nx + dy * ny + dz * nz
            if cosine > 0.0:
                if chance >= fresnel_reflectance(cosine, scene.refractive_index):
                    direction = refracted_direction(dx, dy, dz, nx, ny, nz, scene.refractive_index)
                    place = (x + NUDGE_MM * nx, y + NUDGE_MM * ny, z + NUDGE_MM * nz)
                    return ESCAPED, -1, weight, count, stream, place, direction
                dx, dy, dz = dx - 2.0 * cosine * nx, dy - 2.0 * cosine * ny, dz - 2.0 * cosine * nz
                path = max(path, SKIRT if is_steep(top, SKIRT_SLOPE, (x, y, z, nx, ny, nz)) else TOP)
            x, y, z = x - NUDGE_MM * nx, y - NUDGE_MM * ny, z - NUDGE_MM * nz
            continue
        elif what == CONTACT:
            if chance >= scene.tip_reflectance:
                return TIP, -1, weight, count, stream, place, direction
            nx, ny, nz = -nx, -ny, -nz
            x, y, z = x + NUDGE_MM * nx, y + NUDGE_MM * ny, z + NUDGE_MM * nz
        elif face == BOTTOM_FACE or face >= POSED_EMITTER:
            if chance >= scene.bottom_reflectance:
                return BOTTOM, -1, weight, count, stream, place, direction
            nx, ny, nz = inward_normal(scene, face, x, y)
        else:
            nx, ny, nz = inward_normal(scene, face, x, y)
            cosine = -(dx * nx + dy * ny + dz * nz)
            receiver = face - POSED_RECEIVER
            if receiver < 0:
                receiver = receiver_at(scene, face, x, y, z)
            if receiver >= 0:
                if chance >= _counted_share(scene, receiver, cosine):
                    path, receiver = UNCOUNTED, -1
                return path, receiver, weight, count, stream, place, direction
            mirrored = fresnel_reflectance(cosine, scene.wall_ratio) if scene.wall_ratio > 0.0 else 0.0
            if chance < mirrored:
                dx, dy, dz = dx + 2.0 * cosine * nx, dy + 2.0 * cosine * ny, dz + 2.0 * cosine * nz
                path = max(path, WALL)
                continue
            if chance >= mirrored + (1.0 - mirrored) * scene.wall_reflectance:
                return WALLS, -1, weight, count, stream, place, direction
        stream, u = draw(stream)
        stream, v = draw(stream)
        dx, dy, dz = lobe_direction(nx, ny, nz, 1.0, u, v)
        path = max(path, DIFFUSE)
    return UNRESOLVED, -1, weight, count, stream, place, direction


@njit()
def _counted_share(scene: OracleScene, receiver: int, cosine: float) -> float:
    """Share that a receiver counts of light arriving at a cosine to its normal [-]."""
    if scene.receiver_response.shape[1] == 0:
        return 1.0
    return table_value(scene.receiver_response[receiver], cosine)


@njit()
def _fate_in_air(end: int) -> int:
    """Index into `FATES` of light whose flight in air has ended."""
    if end == OVER_THE_WALLS:
        return ESCAPED
    if end == ON_A_TIP:
        return TIP
    return WALLS if end == ON_A_WALL else UNRESOLVED
