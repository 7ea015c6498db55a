"""Kernels: one ray and the deformed top. Arrays only; lengths mm, directions unit vectors.

Whether a ray meets the top is told by `marches`, where by Newton's steps in the bracket that it gives.
"""

from __future__ import annotations

import math

from design.arrays import FloatArray
from sims.optics.engine.straight.marches import MIN_STEP_MM, march, march_any, march_field
from sims.optics.surface.curves import X, Y
from sims.optics.surface.radial import fresnel, height_and_turn, inlined, kernel, wall_hit
from sims.optics.surface.top import Top, is_plain, surface_gradient, touching_tip

CLOSED_MM = 1e-10
"""A gap at which a crossing is found."""
BOTTOM, TIP, LOST = 4, 5, -1
MAX_BOUNCES = 24
LOST_WEIGHT = 1e-9


@inlined
def crossing(
    x: float, y: float, z: float, dx: float, dy: float, dz: float, t0: float, t1: float, top: Top
) -> tuple[float, float]:
    """Bracket of a crossing from below to above the top in [t0, t1]; (t0, -1) if there is none."""
    if is_plain(top):
        return march(x, y, z, dx, dy, dz, t0, t1, True, 0, top.rows)
    if top.rows.shape[0] == 1:
        return march_field(x, y, z, dx, dy, dz, t0, t1, True, top)
    return march_any(x, y, z, dx, dy, dz, t0, t1, top)


@kernel
def is_clear(x: float, y: float, z: float, dx: float, dy: float, dz: float, length: float, top: Top) -> bool:
    """Whether the leg of this length that leaves a point of the top stays below the top."""
    t0 = min(MIN_STEP_MM, 0.5 * length)
    _, hit = crossing(x, y, z, dx, dy, dz, t0, length, top)
    return hit < 0.0


@inlined
def top_hit(x: float, y: float, z: float, dx: float, dy: float, dz: float, t1: float, top: Top) -> float:
    """First distance in (0, t1) where the ray meets the top; -1 if it does not."""
    if is_plain(top):
        return _tip_hit(x, y, z, dx, dy, dz, t1, top.rows)
    return _any_hit(x, y, z, dx, dy, dz, t1, top)


@kernel
def _tip_hit(
    x: float, y: float, z: float, dx: float, dy: float, dz: float, t1: float, rows: FloatArray
) -> float:
    """`top_hit` for one tip and no field."""
    low, high = march(x, y, z, dx, dy, dz, 0.0, t1, False, 0, rows)
    return high if high <= low else _refined(x, y, z, dx, dy, dz, low, high, rows)


@kernel
def _any_hit(x: float, y: float, z: float, dx: float, dy: float, dz: float, t1: float, top: Top) -> float:
    """`top_hit` for several tips or a field: in the bracket Newton's steps, halved where they leave it."""
    if top.rows.shape[0] == 1:
        low, high = march_field(x, y, z, dx, dy, dz, 0.0, t1, False, top)
    else:
        low, high = march_any(x, y, z, dx, dy, dz, 0.0, t1, top)
    if high <= low:
        return high
    t = high
    for _ in range(60):
        h, gx, gy = surface_gradient(x + dx * t, y + dy * t, top)
        gap = h - z - dz * t
        if abs(gap) < CLOSED_MM:
            break
        if gap < 0.0:
            high = t
        else:
            low = t
        if high - low < 1e-12:
            break
        rate = gx * dx + gy * dy - dz
        t = t - gap / rate if rate < 0.0 else low
        if not low < t < high:
            t = 0.5 * (low + high)
    return t


@inlined
def _refined(
    x: float, y: float, z: float, dx: float, dy: float, dz: float, low: float, high: float, rows: FloatArray
) -> float:
    """Crossing of one tip's top in a bracket: Newton's steps, halved where they leave it."""
    px = x - rows[0, X]
    py = y - rows[0, Y]
    plan2 = dx * dx + dy * dy
    b = px * dx + py * dy
    c = px * px + py * py
    t = high
    for _ in range(60):
        r2 = max(c + t * (2.0 * b + plan2 * t), 0.0)
        h, turn = height_and_turn(r2, 0, rows)
        gap = h - z - dz * t
        if abs(gap) < CLOSED_MM:
            break
        if gap < 0.0:
            high = t
        else:
            low = t
        if high - low < 1e-12:
            break
        rate = turn * (b + plan2 * t) - dz
        t = t - gap / rate if rate < 0.0 else low
        if not low < t < high:
            t = 0.5 * (low + high)
    return t


@kernel
def chain(
    x: float, y: float, z: float, dx: float, dy: float, dz: float, weight: float, box: FloatArray, top: Top
) -> tuple[int, float, float, float, float, float, float, float, int, float]:
    """Follow a ray through specular reflections at the top to a wall, the bottom or a tip.

    Returns kind (0-3 wall, 4 bottom, 5 tip, -1 lost), point, direction, weight with Fresnel and absorption, number of
    top reflections, smallest distance of one from a tip's axis over that tip's skirt radius.
    """
    tops = 0
    nearest = 1e30
    for _ in range(MAX_BOUNCES):
        t, kind = wall_hit(x, y, z, dx, dy, dz, box)
        if kind == LOST and dz <= 0.0:
            break
        hit = top_hit(x, y, z, dx, dy, dz, t, top)
        if hit >= 0.0:
            t = hit
        x += t * dx
        y += t * dy
        z += t * dz
        weight *= math.exp(-box[4] * t)
        if hit < 0.0:
            return kind, x, y, z, dx, dy, dz, weight, tops, nearest
        tip, share = touching_tip(x, y, top)
        if tip >= 0:
            return TIP, x, y, z, dx, dy, dz, weight, tops, nearest
        _, gx, gy = surface_gradient(x, y, top)
        norm = 1.0 / math.sqrt(1.0 + gx * gx + gy * gy)
        cos_in = (dz - dx * gx - dy * gy) * norm
        if cos_in <= 0.0:
            break
        weight *= fresnel(cos_in, box[3])
        if weight < LOST_WEIGHT:
            break
        tops += 1
        nearest = min(nearest, share)
        back = 2.0 * cos_in * norm
        dx += back * gx
        dy += back * gy
        dz -= back
        x += 1e-9 * gx * norm
        y += 1e-9 * gy * norm
        z -= 1e-9 * norm
    return LOST, x, y, z, dx, dy, dz, weight, tops, nearest
