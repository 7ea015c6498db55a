"""Kernels: one ray and the deformed top. Arrays only; lengths mm, directions unit vectors.

The top is the sum of what every tip does to it and of a smooth field (`sims.optics.surface.top`). The gap
g(t) = h(x(t), y(t)) - z(t) closes at most at the rate dz + M |d_plan|, M the largest slope of the part of the surface
still ahead (of its falling part once the ray moves outward), so steps of g over that rate cannot jump over a
crossing. Nor can those to the root of g + g' s - K |d_plan|^2 s^2 / 2, K the largest bend ahead; of both the longer is
taken. No step is shorter than `MIN_STEP_MM`, so a chord through the tip shorter than that is missed (it would be
less than 2e-5 mm deep in a 3 mm tip).

One tip and no field, the usual case: beyond the outer radius the top is a plane and needs no steps, and a ray that
stays below the undisturbed top is followed only where the top may come below the ray's highest point.
"""

from __future__ import annotations

import math

from sims.optics.scene.optical_scene import FloatArray
from sims.optics.surface.curves import (
    ACTIVE,
    LOWEST,
    OFFSET,
    OUTER_2,
    PIECES,
    SCALE,
    SPHERE_2,
    SPHERE_Z,
    START,
    TIP_2,
    TOP,
    X,
    Y,
)
from sims.optics.surface.radial import (
    distance,
    fall_bound,
    fresnel,
    height,
    height_and_turn,
    inlined,
    kernel,
    reach2,
    slope_bound,
    wall_hit,
)
from sims.optics.surface.radial_table import BEND, CELLS, FALL, PIECE_COLUMNS, WINDOW
from sims.optics.surface.top import (
    FIELD_LOWEST,
    FIELD_SLOPE,
    Top,
    is_plain,
    surface_gradient,
    surface_height,
    touching_tip,
)

MIN_STEP_MM = 0.02
LEAST_BEND = 1e-12
"""Added to what is divided by [1/mm]."""
NEAREST_AHEAD_MM, AHEAD_SHARE = 0.25, 0.35
"""Towards one of several tips a step looks this far, or this share of the distance to its axis."""
CLOSED_MM = 1e-10
"""A gap at which a crossing is found."""
BOTTOM, TIP, LOST = 4, 5, -1
MAX_BOUNCES = 24
LOST_WEIGHT = 1e-9


@inlined
def _plane_hit(z: float, dz: float, t0: float, t1: float, top: float) -> float:
    """Where a ray meets the undisturbed top in [t0, t1]; -1 if it does not."""
    if dz <= 0.0:
        return -1.0
    t = (top - z) / dz
    return max(t, t0) if t <= t1 else -1.0


@inlined
def march(
    x: float, y: float, z: float, dx: float, dy: float, dz: float, t0: float, t1: float, takes_any: bool, tip: int,
    rows: FloatArray,
) -> tuple[float, float]:  # fmt: skip
    """Bracket of the first crossing from below to above one tip's top in [t0, t1]; (t0, -1) if there is none.

    `takes_any`: any crossing will do; a ray that has one is nearly always above the top where it is nearest the axis.
    """
    highest = max(z + dz * t0, z + dz * t1)
    if highest < rows[tip, LOWEST]:
        return t0, -1.0
    px = x - rows[tip, X]
    py = y - rows[tip, Y]
    plan2 = max(dx * dx + dy * dy, 1e-20)
    closest = -(px * dx + py * dy) / plan2
    c = px * px + py * py
    near2 = max(c - plan2 * closest * closest, 0.0)
    outer2 = rows[tip, OUTER_2] if highest >= rows[tip, TOP] else reach2(highest, tip, rows)
    if near2 >= outer2:
        hit = _plane_hit(z, dz, t0, t1, rows[tip, TOP])
        return (t0, hit) if hit < 0.0 else (hit, hit)
    half = math.sqrt((outer2 - near2) / plan2)
    t = max(t0, closest - half)
    end = min(t1, closest + half)
    if t > t0:
        hit = _plane_hit(z, dz, t0, min(t, t1), rows[tip, TOP])
        if hit >= 0.0:
            return hit, hit
    if t < end:
        if takes_any:
            middle = min(max(t, closest), end)
            away = middle - closest
            if height(near2 + plan2 * away * away, tip, rows) < z + dz * middle:
                return t, middle
        low, high = _march_within(z, dz, t, end, closest, near2, plan2, tip, rows)
        if high >= 0.0:
            return low, high
    if end < t1:
        hit = _plane_hit(z, dz, max(end, t0), t1, rows[tip, TOP])
        if hit >= 0.0:
            return hit, hit
    return t0, -1.0


@inlined
def _march_within(
    z: float, dz: float, t: float, end: float, closest: float, near2: float, plan2: float, tip: int, rows: FloatArray,
) -> tuple[float, float]:  # fmt: skip
    """The bracket in [t, end], inside a tip's outer radius; its upper end is -1 if there is none."""
    plan = math.sqrt(plan2)
    inward_rate = dz + slope_bound(near2, tip, rows) * plan
    previous = t
    while True:
        away = t - closest
        r2 = near2 + plan2 * away * away
        piece = PIECES
        if r2 >= rows[tip, OUTER_2]:
            gap = rows[tip, TOP] - z - dz * t
            turn = 0.0
            piece = PIECES + PIECE_COLUMNS * (CELLS - 1)
        elif r2 <= rows[tip, SPHERE_2]:
            root = math.sqrt(rows[tip, TIP_2] - r2)
            gap = rows[tip, SPHERE_Z] - root - z - dz * t
            turn = 1.0 / root
        else:
            w = math.sqrt(rows[tip, SCALE] * r2 + rows[tip, OFFSET])
            u = w - rows[tip, START]
            k = min(int(u), CELLS - 1)
            u -= k
            piece = PIECES + PIECE_COLUMNS * k
            c1, c2, c3 = rows[tip, piece + 1], rows[tip, piece + 2], rows[tip, piece + 3]
            gap = rows[tip, piece] + u * (c1 + u * (c2 + u * c3)) - z - dz * t
            turn = (c1 + u * (2.0 * c2 + u * 3.0 * c3)) * rows[tip, SCALE] / w
        if gap < 0.0:
            return previous, t
        rate = inward_rate if away < 0.0 else dz + rows[tip, piece + FALL] * plan
        if rate <= 0.0:
            return t, -1.0
        opening = turn * plan2 * away - dz
        bend = rows[tip, piece + BEND] * plan2 + LEAST_BEND
        root = math.sqrt(opening * opening + 2.0 * bend * gap)
        step = (opening + root) / bend if opening >= 0.0 else 2.0 * gap / (root - opening)
        if away < 0.0:
            step = min(step, rows[tip, piece + WINDOW] / plan)
        step = max(step, gap / rate)
        if t + step >= end:
            return t, -1.0
        previous = t
        t = min(t + max(step, MIN_STEP_MM), end)


@kernel
def march_any(
    x: float, y: float, z: float, dx: float, dy: float, dz: float, t0: float, t1: float, top: Top
) -> tuple[float, float]:
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
                slope += fall_bound(r * r, k, top.rows)
            else:
                ahead = max(NEAREST_AHEAD_MM, AHEAD_SHARE * r)
                window = min(window, ahead)
                slope += slope_bound(max(r - ahead, 0.0) ** 2, k, top.rows)
        rate = dz + slope * plan
        if rate <= 0.0 and window > 1e8:
            return t, -1.0
        step = gap / rate if rate > 0.0 else 1e9
        if plan > 0.0:
            step = min(step, window / plan)
        t = min(t + max(step, MIN_STEP_MM), t1)


@inlined
def crossing(
    x: float, y: float, z: float, dx: float, dy: float, dz: float, t0: float, t1: float, top: Top
) -> tuple[float, float]:
    """Bracket of a crossing from below to above the top in [t0, t1]; (t0, -1) if there is none."""
    if is_plain(top):
        return march(x, y, z, dx, dy, dz, t0, t1, True, 0, top.rows)
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
    """`top_hit` for several tips or a field: the bracket halved by false position (Illinois)."""
    low, high = march_any(x, y, z, dx, dy, dz, 0.0, t1, top)
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
        if abs(gap) < CLOSED_MM or high - low < 1e-11:
            break
    return low


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
