"""The plain forward walk, compiled with Numba: what the light engine is measured against, made as fast as it goes.

Every emitter sends rays by its cosine law; a ray flies to the nearest of walls, bottom and top, is mirrored at the top
with its Fresnel share as weight, is scattered by walls and bottom by chance, and ends on a receiver, on the tip or
where it is not scattered. No path is guided towards a receiver: this is the tracer that one writes first. It knows the
compact dimple of `tests.sims.optics.surface.analytic` (without pile-up) in closed form and shares no code with
`optopad.sims.optics`.

The dimple is met by testing intervals of the ray: the top is lowest where the interval comes nearest to the axis, so an
interval whose highest end lies below that is passed over and the next one is twice as long; else it is cut, down to
`SHORTEST_MM`. One thread; a random stream (splitmix64) for each emitter.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from time import process_time

import numpy as np
from numba import njit

from optopad.design.arrays import BoolArray, FloatArray
from optopad.sims.optics.scene.optical_scene import OpticalScene
from optopad.sims.press import Indentation

SHORTEST_MM = 0.02
FAINT, KEPT = 1e-3, 0.1
"""Below this weight a ray goes on with this chance, its weight raised by as much."""
MOST_FLIGHTS = 64
TOP, DIMPLE = 5, 6
MIRRORED, SCATTERED = 1, 2

fast = njit(fastmath=True, inline="always", error_model="numpy")


@dataclass(frozen=True, kw_only=True)
class Walked:
    """What a walk counted, for every emitter and receiver.

    Attributes
    ----------
    flux : (e, r) share of the emitted power [-]
    variance : (e, r) variance of one ray's share [-]
    rays : of each emitter
    segments : flights of all rays
    seconds : processor time
    groups : (3, e, r) flux of straight, mirrored and scattered light, where the walk tells them apart [-]
    """

    flux: FloatArray
    variance: FloatArray
    rays: int
    segments: int
    seconds: float
    groups: FloatArray | None = None

    def rays_for(self, relative_error: float, pairs: BoolArray) -> FloatArray:
        """(e,) rays until the worst wanted pair of an emitter has this relative standard error."""
        flux = np.where(pairs & (self.flux > 0.0), self.flux, np.inf)
        relative = np.where(pairs, self.variance, 0.0) / flux**2
        return np.asarray(relative.max(axis=1) / relative_error**2)

    def seconds_for(self, relative_error: float, pairs: BoolArray) -> float:
        """Processor time for it, each emitter traced for as long as its own worst pair needs."""
        each = self.seconds / (self.rays * len(self.flux))
        return float(self.rays_for(relative_error, pairs).sum() * each)


def dimple_row(centre_mm: FloatArray, press: Indentation | None, top_mm: float) -> FloatArray:
    """Centre x, y, top, tip radius, contact radius squared, height of the tip's centre, drop, skirt width, rim, lowest.

    The numbers of `tests.sims.optics.surface.analytic.compact_dimple`, found from its definition [mm].
    """
    if press is None:
        return np.array([centre_mm[0], centre_mm[1], top_mm, 1.0, 0.0, top_mm, 0.0, 1.0, 0.0, top_mm])
    tip, depth, contact = press.tip_radius_mm, press.depth_mm, press.contact_radius_mm
    root = math.sqrt(tip**2 - contact**2)
    drop = depth - (tip - root)
    width = 3.0 * drop * root / contact
    row = [*centre_mm, top_mm, tip, contact**2, top_mm - depth + tip, drop, width, contact + width]
    return np.array([*row, top_mm - depth])


def walk(
    scene: OpticalScene, centre_mm: FloatArray, press: Indentation | None, rays: int, seed: int = 0
) -> Walked:
    """Send `rays` rays from every emitter."""
    arguments = _lowered(scene, centre_mm, press)
    start = process_time()
    total, square, segments = _walk_all(*arguments, rays, seed)
    seconds = process_time() - start
    groups = total / rays
    mean = groups.sum(axis=0)
    return Walked(
        flux=mean,
        variance=square / rays - mean**2,
        rays=rays,
        segments=int(segments),
        seconds=seconds,
        groups=groups,
    )


def even_walk(
    scene: OpticalScene, centre_mm: FloatArray, press: Indentation | None, emitter: int, points: FloatArray
) -> FloatArray:
    """(2, r) straight and mirrored flux of one emitter between dark walls, by rays at `points` [-].

    Parameters
    ----------
    points : (n, 4) in 0..1, place on the emitter and angle; evenly spread ones err some ten times less than chance
    """
    dark = replace(scene, wall_reflectance=0.0, bottom_reflectance=0.0)
    box, emitters, receivers, first, dimple = _lowered(dark, centre_mm, press)
    total = _walk_points(box, emitters[emitter], receivers, first, dimple, points)
    return np.asarray(total[: MIRRORED + 1] / len(points))


def _lowered(scene: OpticalScene, centre_mm: FloatArray, press: Indentation | None) -> tuple[FloatArray, ...]:
    if (scene.emitter_order != 1.0).any() and not np.allclose(scene.emitter_order, 1.0, rtol=1e-12):
        raise ValueError("the plain walk knows Lambertian emitters only")
    box = np.array(
        [
            scene.length_mm,
            scene.width_mm,
            scene.height_mm,
            scene.refractive_index,
            scene.wall_reflectance,
            scene.bottom_reflectance,
        ]
    )
    emitters = np.column_stack([scene.emitter_wall, scene.emitter_patch])
    receivers = np.column_stack([scene.receiver_wall, scene.receiver_patch])
    first = np.searchsorted(scene.receiver_wall, np.arange(5)).astype(np.int64)
    if (np.diff(scene.receiver_wall) < 0).any():
        raise ValueError("the plain walk wants receivers in the order of the walls")
    return box, emitters, receivers, first, dimple_row(centre_mm, press, scene.height_mm)


def closest_hits(
    scene: OpticalScene, centre_mm: FloatArray, press: Indentation | None, lines: FloatArray
) -> FloatArray:
    """(n,) distance to the closest hit of lines (n, 6), origin and unit direction [mm]."""
    box, _, _, _, dimple = _lowered(scene, centre_mm, press)
    out = np.empty(len(lines))
    _hits(lines, box, dimple, out)
    return out


@fast
def _height(q, s):
    """Height of the top at a squared distance from the axis."""
    if q < s[4]:
        return s[5] - math.sqrt(s[3] * s[3] - q)
    r = math.sqrt(q)
    if r >= s[8]:
        return s[2]
    g = (s[8] - r) / s[7]
    return s[2] - s[6] * g * g * g


@njit(fastmath=True, error_model="numpy")
def _dimple_hit(px, py, z, dx, dy, dz, end, s):
    """First distance in (0, end) at which a ray that starts (px, py) from the axis leaves the elastomer; or -1."""
    a = dx * dx + dy * dy
    b = px * dx + py * dy
    c = px * px + py * py
    low = 0.0
    high = end
    if a > 1e-14:
        inside = b * b - a * (c - s[8] * s[8])
        if inside <= 0.0:
            return -1.0
        root = math.sqrt(inside)
        low = max(low, (-b - root) / a)
        high = min(high, (root - b) / a)
        nearest = -b / a
    else:
        if c > s[8] * s[8]:
            return -1.0
        nearest = 0.0
    if dz > 1e-14:
        low = max(low, (s[9] - z) / dz)
    elif dz < -1e-14:
        high = min(high, (s[9] - z) / dz)
    elif z < s[9]:
        return -1.0
    step = high - low
    t = low
    while t < high:
        u = min(t + step, high)
        closest = min(max(nearest, t), u)
        q = max(a * closest * closest + 2.0 * b * closest + c, 0.0)
        if _height(q, s) > z + max(dz * t, dz * u):
            t = u
            step *= 2.0
        elif u - t > SHORTEST_MM:
            step = 0.35 * (u - t)
        else:
            over = z + dz * u - _height(max(a * u * u + 2.0 * b * u + c, 0.0), s)
            if over < 0.0:
                t = u
                continue
            under = z + dz * t - _height(max(a * t * t + 2.0 * b * t + c, 0.0), s)
            if under >= 0.0:
                if t > 1e-3:
                    return t
                t = u
                continue
            for _ in range(3):
                m = t - under * (u - t) / (over - under)
                gap = z + dz * m - _height(max(a * m * m + 2.0 * b * m + c, 0.0), s)
                if gap < 0.0:
                    t = m
                    under = gap
                else:
                    u = m
                    over = gap
            return t - under * (u - t) / (over - under)
    return -1.0


@fast
def _closest(x, y, z, dx, dy, dz, box, s):
    """Distance to the closest hit and what it is: 0-3 walls, 4 bottom, 5 flat top, 6 dimple."""
    t = 1e30
    kind = 1
    if dx > 0.0:
        t = (box[0] - x) / dx
    elif dx < 0.0:
        t = -x / dx
        kind = 3
    if dy > 0.0:
        ty = (box[1] - y) / dy
        if ty < t:
            t = ty
            kind = 2
    elif dy < 0.0:
        ty = -y / dy
        if ty < t:
            t = ty
            kind = 0
    if dz > 0.0:
        tz = (box[2] - z) / dz
        if tz < t:
            t = tz
            kind = TOP
    elif dz < 0.0:
        tz = -z / dz
        if tz < t:
            t = tz
            kind = 4
    if s[8] > 0.0 and z + max(dz * t, 0.0) > s[9]:
        hit = _dimple_hit(x - s[0], y - s[1], z, dx, dy, dz, t, s)
        if hit > 0.0:
            return hit, DIMPLE
    return t, kind


@fast
def _draw(stream):
    """Advance a splitmix64 stream; a number in 0..1."""
    stream = np.uint64(stream + np.uint64(0x9E3779B97F4A7C15))
    key = stream
    key = (key ^ (key >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    key = (key ^ (key >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    key = key ^ (key >> np.uint64(31))
    return stream, (key >> np.uint64(11)) * (1.0 / 9007199254740992.0)


@fast
def _cosine_direction(kind, u, v):
    """A direction by the cosine law about the inward normal of a wall (0-3) or the bottom (4)."""
    sine = math.sqrt(u)
    a = sine * math.cos(2.0 * math.pi * v)
    b = sine * math.sin(2.0 * math.pi * v)
    c = math.sqrt(max(0.0, 1.0 - u))
    if kind == 0:
        return a, c, b
    if kind == 1:
        return -c, a, b
    if kind == 2:
        return a, -c, b
    if kind == 3:
        return c, a, b
    return a, b, c


@fast
def _fresnel(c, index):
    """Unpolarised reflectance from inside."""
    s2 = index * index * (1.0 - c * c)
    if s2 >= 1.0:
        return 1.0
    o = math.sqrt(1.0 - s2)
    across = (index * c - o) / (index * c + o)
    within = (c - index * o) / (c + index * o)
    return 0.5 * (across * across + within * within)


@fast
def _receiver(kind, x, y, z, receivers, first):
    """The receiver at a wall point, or -1."""
    along = x if kind == 0 or kind == 2 else y
    for j in range(first[kind], first[kind + 1]):
        if abs(along - receivers[j, 1]) <= receivers[j, 3] and abs(z - receivers[j, 2]) <= receivers[j, 4]:
            return j
    return -1


@njit(fastmath=True, error_model="numpy")
def _walk_one(kind, x, y, z, dx, dy, dz, stream, box, receivers, first, s):
    """Follow one ray; stream, receiver or -1, weight, flights, group."""
    weight = 1.0
    group = 0
    flights = 0
    while flights < MOST_FLIGHTS:
        t, kind = _closest(x, y, z, dx, dy, dz, box, s)
        flights += 1
        x += t * dx
        y += t * dy
        z += t * dz
        if kind < 5:
            if kind < 4:
                j = _receiver(kind, x, y, z, receivers, first)
                if j >= 0:
                    return stream, j, weight, flights, group
            stream, chance = _draw(stream)
            if chance > (box[4] if kind < 4 else box[5]):
                return stream, -1, 0.0, flights, group
            stream, u = _draw(stream)
            stream, v = _draw(stream)
            dx, dy, dz = _cosine_direction(kind, u, v)
            group = SCATTERED
        elif kind == TOP:
            z = box[2]
            group = max(group, MIRRORED)
            weight *= _fresnel(dz, box[3])
            dz = -dz
        else:
            px = x - s[0]
            py = y - s[1]
            q = px * px + py * py
            if q < s[4]:
                return stream, -1, 0.0, flights, group
            r = math.sqrt(q)
            g = max((s[8] - r) / s[7], 0.0)
            slope = 3.0 * s[6] / s[7] * g * g
            nz = 1.0 / math.sqrt(1.0 + slope * slope)
            nx = -slope * px / r * nz
            ny = -slope * py / r * nz
            c = dx * nx + dy * ny + dz * nz
            if c <= 0.0:
                return stream, -1, 0.0, flights, group
            weight *= _fresnel(c, box[3])
            group = max(group, MIRRORED)
            dx -= 2.0 * c * nx
            dy -= 2.0 * c * ny
            dz -= 2.0 * c * nz
            x -= 1e-6 * nx
            y -= 1e-6 * ny
            z -= 1e-6 * nz
        if weight < FAINT:
            stream, chance = _draw(stream)
            if chance > KEPT:
                return stream, -1, 0.0, flights, group
            weight /= KEPT
    return stream, -1, 0.0, flights, group


@fast
def _emitted(emitter, a, b, u, v, box):
    """Origin and direction of a ray by four numbers in 0..1: two for the place on the emitter, two for the angle."""
    wall = int(emitter[0])
    along = emitter[1] + (2.0 * a - 1.0) * emitter[3]
    z = emitter[2] + (2.0 * b - 1.0) * emitter[4]
    x = along if wall % 2 == 0 else (box[0] if wall == 1 else 0.0)
    y = along if wall % 2 == 1 else (box[1] if wall == 2 else 0.0)
    dx, dy, dz = _cosine_direction(wall, u, v)
    return x, y, z, dx, dy, dz


@njit(fastmath=True, error_model="numpy")
def _walk_all(box, emitters, receivers, first, s, rays, seed):
    """(group, e, r) sums of weights, (e, r) sums of their squares, and the flights of all rays."""
    total = np.zeros((3, emitters.shape[0], receivers.shape[0]))
    square = np.zeros((emitters.shape[0], receivers.shape[0]))
    segments = 0
    for i in range(emitters.shape[0]):
        stream = np.uint64(seed * 1000003 + i + 1) * np.uint64(0xD1342543DE82EF95)
        wall = int(emitters[i, 0])
        for _ in range(rays):
            stream, a = _draw(stream)
            stream, b = _draw(stream)
            stream, u = _draw(stream)
            stream, v = _draw(stream)
            x, y, z, dx, dy, dz = _emitted(emitters[i], a, b, u, v, box)
            stream, j, weight, flights, group = _walk_one(
                wall, x, y, z, dx, dy, dz, stream, box, receivers, first, s
            )
            segments += flights
            if j >= 0:
                total[group, i, j] += weight
                square[i, j] += weight * weight
    return total, square, segments


@njit(fastmath=True, error_model="numpy")
def _walk_points(box, emitter, receivers, first, s, points):
    """(group, r) sums of weights of one emitter's rays at given points of 0..1, where nothing scatters."""
    total = np.zeros((3, receivers.shape[0]))
    stream = np.uint64(1)
    for k in range(points.shape[0]):
        x, y, z, dx, dy, dz = _emitted(emitter, points[k, 0], points[k, 1], points[k, 2], points[k, 3], box)
        stream, j, weight, _, group = _walk_one(
            int(emitter[0]), x, y, z, dx, dy, dz, stream, box, receivers, first, s
        )
        if j >= 0:
            total[group, j] += weight
    return total


@njit(fastmath=True, error_model="numpy")
def _hits(rays, box, s, out):
    """Distances to the closest hits."""
    for k in range(rays.shape[0]):
        out[k], _ = _closest(rays[k, 0], rays[k, 1], rays[k, 2], rays[k, 3], rays[k, 4], rays[k, 5], box, s)
