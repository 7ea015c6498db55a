# mypy: allow-untyped-defs, allow-untyped-calls, allow-untyped-decorators
"""Kernels: one ray and the deformed top. Arrays only; lengths mm, directions unit vectors.

The top is the sum of what every tip does to it and of a smooth field (`sims.optics.top`). The gap
g(t) = h(x(t), y(t)) - z(t) closes at most at the rate dz + M |d_plan|, M the largest slope of the part of the surface
still ahead (of its falling part once the ray moves outward), so steps of g over that rate cannot jump over a
crossing. No step is shorter than `MIN_STEP_MM`, so a chord through the tip shorter than that is missed (it would be
less than 2e-5 mm deep in a 3 mm tip).
"""

from __future__ import annotations

import math

from sims.optics.radial import (
    distance,
    fall_bound,
    fresnel,
    height,
    kernel,
    slope_bound,
    wall_hit,
)
from sims.optics.surface import ACTIVE, LOWEST, TOP, X, Y
from sims.optics.top import (
    FIELD_LOWEST,
    FIELD_SLOPE,
    is_plain,
    is_touched,
    surface_gradient,
    surface_height,
    touching_tip,
)

MIN_STEP_MM = 0.02
BOTTOM, TIP, LOST = 4, 5, -1
MAX_BOUNCES = 24
LOST_WEIGHT = 1e-9


@kernel
def march(x, y, z, dx, dy, dz, t0, t1, tip, rows):
    """Bracket of the first crossing from below to above one tip's top in [t0, t1]; (t0, -1) if there is none."""
    if max(z + dz * t0, z + dz * t1) < rows[tip, LOWEST]:
        return t0, -1.0
    px = x - rows[tip, X]
    py = y - rows[tip, Y]
    plan2 = dx * dx + dy * dy
    plan = math.sqrt(plan2)
    b = px * dx + py * dy
    c = px * px + py * py
    closest = -b / plan2 if plan2 > 1e-20 else t0
    t_min = min(max(closest, t0), t1)
    r_min = math.sqrt(max(plan2 * t_min * t_min + 2.0 * b * t_min + c, 0.0))
    t = t0
    if dz > 0.0:
        t = max(t, min((rows[tip, LOWEST] - z) / dz, t1))
    previous = t
    while True:
        r = math.sqrt(max(plan2 * t * t + 2.0 * b * t + c, 0.0))
        gap = height(r, tip, rows) - (z + dz * t)
        if gap < 0.0:
            return previous, t
        if t >= t1:
            return t, -1.0
        previous = t
        if t >= closest:
            rate = dz + fall_bound(r, tip, rows) * plan
            if rate <= 0.0:
                return t, -1.0
            step = gap / rate
        else:
            window = max(0.25, 0.35 * r)
            rate = dz + slope_bound(max(r_min, r - window), tip, rows) * plan
            step = window / plan if rate <= 0.0 else min(gap / rate, window / plan)
        t = min(t + max(step, MIN_STEP_MM), t1)


@kernel
def march_any(x, y, z, dx, dy, dz, t0, t1, top):
    """As `march`, for several tips and a field: the rates of all of them add up."""
    tips = top.rows.shape[0]
    lowest = top.rows[0, FIELD_LOWEST]
    for k in range(tips):
        lowest += min(top.rows[k, LOWEST], top.rows[k, TOP]) - (top.rows[k, TOP] if k > 0 else 0.0)
    if max(z + dz * t0, z + dz * t1) < lowest:
        return t0, -1.0
    plan = math.sqrt(dx * dx + dy * dy)
    t = t0
    if dz > 0.0:
        t = max(t, min((lowest - z) / dz, t1))
    previous = t
    while True:
        px = x + dx * t
        py = y + dy * t
        gap = surface_height(px, py, top) - (z + dz * t)
        if gap < 0.0:
            return previous, t
        if t >= t1:
            return t, -1.0
        previous = t
        window = 1e9
        slope = top.rows[0, FIELD_SLOPE]
        for k in range(tips):
            if top.rows[k, ACTIVE] == 0.0:
                continue
            rx = px - top.rows[k, X]
            ry = py - top.rows[k, Y]
            r = distance(rx, ry)
            if rx * dx + ry * dy >= 0.0:
                slope += fall_bound(r, k, top.rows)
            else:
                ahead = max(0.25, 0.35 * r)
                window = min(window, ahead)
                slope += slope_bound(max(r - ahead, 0.0), k, top.rows)
        rate = dz + slope * plan
        if rate <= 0.0 and window > 1e8:
            return t, -1.0
        step = gap / rate if rate > 0.0 else 1e9
        if plan > 0.0:
            step = min(step, window / plan)
        t = min(t + max(step, MIN_STEP_MM), t1)


@kernel
def crossing(x, y, z, dx, dy, dz, t0, t1, top):
    """Bracket of the first crossing from below to above the top in [t0, t1]; (t0, -1) if there is none."""
    if is_plain(top):
        return march(x, y, z, dx, dy, dz, t0, t1, 0, top.rows)
    return march_any(x, y, z, dx, dy, dz, t0, t1, top)


@kernel
def is_clear(x, y, z, dx, dy, dz, length, top):
    """Whether the leg of this length that leaves a point of the top stays below the top."""
    if not is_touched(top):
        return True
    t0 = min(MIN_STEP_MM, 0.5 * length)
    _, hit = crossing(x, y, z, dx, dy, dz, t0, length, top)
    return hit < 0.0


@kernel
def top_hit(x, y, z, dx, dy, dz, t1, top):
    """First distance in (0, t1) where the ray meets the top; -1 if it does not."""
    if not is_touched(top):
        if dz <= 0.0:
            return -1.0
        t = (top.rows[0, TOP] - z) / dz
        return t if t < t1 else -1.0
    low, high = crossing(x, y, z, dx, dy, dz, 0.0, t1, top)
    if high < 0.0:
        return -1.0
    g_low = surface_height(x + dx * low, y + dy * low, top) - (z + dz * low)
    g_high = surface_height(x + dx * high, y + dy * high, top) - (z + dz * high)
    if g_low <= 0.0:
        return low
    for _ in range(60):
        t = low + (high - low) * g_low / (g_low - g_high)
        gap = surface_height(x + dx * t, y + dy * t, top) - (z + dz * t)
        if gap < 0.0:
            if g_high == 0.0 or high - t < 1e-12:
                break
            high = t
            g_high = gap
            g_low *= 0.5
        else:
            low = t
            g_low = gap
            g_high *= 0.5
        if abs(gap) < 1e-10 or high - low < 1e-11:
            break
    return low


@kernel
def chain(x, y, z, dx, dy, dz, weight, box, top):
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
