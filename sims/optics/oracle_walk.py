"""One ray's walk through the pad, written to be read: emission, flight, reflection, fate.

Model
-----
Geometrical optics, unpolarised, one colour. An emitter is a rectangle on a wall; every point of it
radiates cosᵐθ into the elastomer. A ray flies straight to the nearest wall, bottom or top. The top
reflects by Fresnel's equations for unpolarised light (Born & Wolf, Principles of Optics, § 1.5) with
total reflection beyond the critical angle. Walls, emitter faces, the bottom and the wetted tip are
Lambertian. Receivers are perfect absorbers.

Chance and weight
-----------------
A ray reflects or not, at the top as at a wall, by one random number: below the critical angle the
reflectance is a few percent, so following the weak remainder costs more than it tells. Absorption is no
game of chance: the ray carries the weight exp(-absorption · distance), and the lost part is booked as
absorbed in the volume. Each ray thus ends in one place and the account closes to rounding.

Every ray has a random stream of its own (splitmix64; Steele, Lea & Flood 2014), started from a hash of
seed, state, emitter and ray number, so results do not depend on threads or on the number of rays asked for.

Left out
--------
Light that leaves through the top, crosses the crater in air and re-enters: it is booked as escaped, so
the escaped share bounds it. Polarisation that builds up over several reflections. Scattering in the
elastomer.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from sims.optics.oracle_surface import CONTACT, NOTHING, RevolvedSurface, is_submerged, surface_hit

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

FATES = (
    "direct",
    "top",
    "skirt",
    "diffuse",
    "walls",
    "bottom",
    "tip",
    "volume",
    "escaped",
    "unsubmerged",
    "unresolved",
)
"""Where light can end: at a receiver by class (the first four), or lost; the order of every ledger."""
DIRECT, TOP, SKIRT, DIFFUSE, WALLS, BOTTOM, TIP, VOLUME, ESCAPED, UNSUBMERGED, UNRESOLVED = range(11)

SKIRT_SLOPE = 0.02
"""Slope of the surface above which a reflection makes a path a `skirt` path [-]."""
NUDGE_MM = 1e-6
"""A ray restarts this far inside the surface [mm]: as much as pieces overlap, far more than rounding."""
STEP_LIMIT = 10_000
"""Flights after which a ray is given up and booked as unresolved."""


class Scene(NamedTuple):
    """`OpticalScene` as a tuple that compiled code takes; walls 0-3, bottom 4."""

    length: float
    width: float
    height: float
    refractive_index: float
    absorption: float
    wall_reflectance: float
    bottom_reflectance: float
    tip_reflectance: float
    emitter_wall: IntArray
    emitter_patch: FloatArray
    emitter_order: FloatArray
    receiver_wall: IntArray
    receiver_patch: FloatArray


@njit(cache=True)
def scramble(key: np.uint64) -> np.uint64:
    """Mix 64 bits so that neighbouring keys give unrelated ones (splitmix64's finaliser)."""
    key = (key ^ (key >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    key = (key ^ (key >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return key ^ (key >> np.uint64(31))


@njit(cache=True)
def ray_stream(seed: int, state: int, emitter: int, ray: int) -> np.uint64:
    """Start of the random stream of one ray."""
    golden = np.uint64(0x9E3779B97F4A7C15)
    key = scramble(np.uint64(seed) + golden)
    key = scramble((key ^ np.uint64(state)) + golden)
    key = scramble((key ^ np.uint64(emitter)) + golden)
    return scramble((key ^ np.uint64(ray)) + golden)


@njit(cache=True)
def draw(stream: np.uint64) -> tuple[np.uint64, float]:
    """Advance a stream; a number in [0, 1)."""
    stream = stream + np.uint64(0x9E3779B97F4A7C15)
    return stream, float(scramble(stream) >> np.uint64(11)) * 2.0**-53


@njit(cache=True)
def fresnel_reflectance(cosine: float, index: float) -> float:
    """Share of unpolarised light reflected inside a medium at its border to air.

    cosine : of the angle of incidence [-]; index : of the medium [-].
    """
    refracted = 1.0 - index * index * (1.0 - cosine * cosine)
    if refracted <= 0.0:
        return 1.0
    out = math.sqrt(refracted)
    across = (index * cosine - out) / (index * cosine + out)
    within = (cosine - index * out) / (cosine + index * out)
    return 0.5 * (across * across + within * within)


@njit(cache=True)
def lobe_direction(
    nx: float, ny: float, nz: float, order: float, u: float, v: float
) -> tuple[float, float, float]:
    """A direction about a unit normal, distributed as cosᵐθ per solid angle; u, v in [0, 1)."""
    cosine = (1.0 - u) ** (1.0 / (order + 1.0))
    sine = math.sqrt(max(1.0 - cosine * cosine, 0.0))
    if abs(nz) < 0.9:
        across = math.hypot(nx, ny)
        ax, ay, az = -ny / across, nx / across, 0.0
    else:
        across = math.hypot(ny, nz)
        ax, ay, az = 0.0, nz / across, -ny / across
    bx, by, bz = ny * az - nz * ay, nz * ax - nx * az, nx * ay - ny * ax
    p, q = sine * math.cos(2.0 * math.pi * v), sine * math.sin(2.0 * math.pi * v)
    return p * ax + q * bx + cosine * nx, p * ay + q * by + cosine * ny, p * az + q * bz + cosine * nz


@njit(cache=True)
def inward_normal(face: int) -> tuple[float, float, float]:
    """Unit normal of a wall (0-3) or the bottom (4) that points into the elastomer."""
    if face == 0:
        return 0.0, 1.0, 0.0
    if face == 1:
        return -1.0, 0.0, 0.0
    if face == 2:
        return 0.0, -1.0, 0.0
    if face == 3:
        return 1.0, 0.0, 0.0
    return 0.0, 0.0, 1.0


@njit(cache=True)
def emission_point(scene: Scene, emitter: int, u: float, v: float) -> tuple[float, float, float]:
    """A point of an emitter's rectangle; u, v in [0, 1)."""
    along, height, half_width, half_height = scene.emitter_patch[emitter]
    along += (2.0 * u - 1.0) * half_width
    height += (2.0 * v - 1.0) * half_height
    wall = scene.emitter_wall[emitter]
    if wall == 0:
        return along, 0.0, height
    if wall == 1:
        return scene.length, along, height
    if wall == 2:
        return along, scene.width, height
    return 0.0, along, height


@njit(cache=True)
def face_hit(
    scene: Scene, x: float, y: float, z: float, dx: float, dy: float, dz: float
) -> tuple[float, int]:
    """Distance to the nearest wall or the bottom, and which; walls go up without end."""
    best, face = math.inf, -1
    if dx > 0.0 and (scene.length - x) / dx < best:
        best, face = (scene.length - x) / dx, 1
    if dx < 0.0 and -x / dx < best:
        best, face = -x / dx, 3
    if dy > 0.0 and (scene.width - y) / dy < best:
        best, face = (scene.width - y) / dy, 2
    if dy < 0.0 and -y / dy < best:
        best, face = -y / dy, 0
    if dz < 0.0 and -z / dz < best:
        best, face = -z / dz, 4
    return max(best, 0.0), face


@njit(cache=True)
def receiver_at(scene: Scene, wall: int, x: float, y: float, z: float) -> int:
    """The receiver that covers a point of a wall below the undisturbed top, or -1."""
    along = x if wall == 0 or wall == 2 else y
    if z <= scene.height:
        for k in range(scene.receiver_wall.shape[0]):
            if (
                scene.receiver_wall[k] == wall
                and abs(along - scene.receiver_patch[k, 0]) <= scene.receiver_patch[k, 2]
                and abs(z - scene.receiver_patch[k, 1]) <= scene.receiver_patch[k, 3]
            ):
                return k
    return -1


@njit(cache=True)
def walk(
    scene: Scene, surface: RevolvedSurface, emitter: int, stream: np.uint64, vertices: FloatArray
) -> tuple[int, int, float, int]:
    """Follow one ray from an emitter to its end.

    Parameters
    ----------
    vertices : (n, 3) is filled with the places of the path [mm], as far as it has rows

    Returns
    -------
    fate : index into `FATES`
    receiver : its number, or -1
    weight : what absorption left of the ray at its end [-]; the rest went into the volume
    count : number of places on the path
    """
    stream, u = draw(stream)
    stream, v = draw(stream)
    x, y, z = emission_point(scene, emitter, u, v)
    if z > scene.height or not is_submerged(surface, x, y, z):
        return UNSUBMERGED, -1, 1.0, 0
    nx, ny, nz = inward_normal(scene.emitter_wall[emitter])
    stream, u = draw(stream)
    stream, v = draw(stream)
    dx, dy, dz = lobe_direction(nx, ny, nz, scene.emitter_order[emitter], u, v)
    count = record(vertices, 0, x, y, z)
    weight, path = 1.0, DIRECT
    for _ in range(STEP_LIMIT):
        distance, face = face_hit(scene, x, y, z, dx, dy, dz)
        distance, what, nx, ny, nz = surface_hit(surface, x, y, z, dx, dy, dz, distance)
        x, y, z = x + distance * dx, y + distance * dy, z + distance * dz
        weight *= math.exp(-scene.absorption * distance)
        count = record(vertices, count, x, y, z)
        stream, chance = draw(stream)
        if what != NOTHING and what != CONTACT:
            cosine = dx * nx + dy * ny + dz * nz
            if cosine > 0.0:
                if chance >= fresnel_reflectance(cosine, scene.refractive_index):
                    return ESCAPED, -1, weight, count
                dx, dy, dz = dx - 2.0 * cosine * nx, dy - 2.0 * cosine * ny, dz - 2.0 * cosine * nz
                if path != DIFFUSE:
                    steep = nz * math.sqrt(1.0 + SKIRT_SLOPE**2) < 1.0
                    path = max(path, SKIRT if steep else TOP)
            x, y, z = x - NUDGE_MM * nx, y - NUDGE_MM * ny, z - NUDGE_MM * nz
            continue
        if what == CONTACT:
            if chance >= scene.tip_reflectance:
                return TIP, -1, weight, count
            nx, ny, nz = -nx, -ny, -nz
            x, y, z = x + NUDGE_MM * nx, y + NUDGE_MM * ny, z + NUDGE_MM * nz
        elif face == 4:
            if chance >= scene.bottom_reflectance:
                return BOTTOM, -1, weight, count
            nx, ny, nz = inward_normal(face)
        else:
            receiver = receiver_at(scene, face, x, y, z)
            if receiver >= 0:
                return path, receiver, weight, count
            if chance >= scene.wall_reflectance:
                return WALLS, -1, weight, count
            nx, ny, nz = inward_normal(face)
        stream, u = draw(stream)
        stream, v = draw(stream)
        dx, dy, dz = lobe_direction(nx, ny, nz, 1.0, u, v)
        path = DIFFUSE
    return UNRESOLVED, -1, weight, count


@njit(cache=True)
def record(vertices: FloatArray, count: int, x: float, y: float, z: float) -> int:
    """Write down one place of a path while there is room; the count of places so far."""
    if count < vertices.shape[0]:
        vertices[count, 0], vertices[count, 1], vertices[count, 2] = x, y, z
    return count + 1
