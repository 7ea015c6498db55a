"""Kernels: where along a ray the deformed top may be crossed.

The top is the sum of what every tip does to it and of a smooth field (`sims.optics.surface.top`). The gap
g(t) = h(x(t), y(t)) - z(t) closes at most at the rate dz + M |d_plan|, M the largest slope of the part of the surface
still ahead (of its falling part once the ray moves outward), so steps of g over that rate cannot jump over a
crossing. Nor can those to the root of g + g' s - K |d_plan|^2 s^2 / 2, K the largest bend ahead; of both the longer is
taken. No step is shorter than `MIN_STEP_MM`, so a chord through the tip shorter than that is missed (it would be
less than 2e-5 mm deep in a 3 mm tip).

One tip without a field: beyond the outer radius the top is a plane and needs no steps, and a ray that stays below the
undisturbed top is followed only where the top may come below the ray's highest point. One tip with a field, a pad's
usual top: slopes and bends of both add up. Several tips: by slopes alone.
"""

from __future__ import annotations

import math

from design.arrays import FloatArray
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
    NEVER,
    distance,
    fall_bound,
    height,
    inlined,
    kernel,
    reach2,
    slope_bound,
)
from sims.optics.surface.radial_table import BEND, CELLS, FALL, PIECE_COLUMNS, WINDOW
from sims.optics.surface.top import (
    FIELD_BEND,
    FIELD_LOWEST,
    FIELD_SLOPE,
    Top,
    field_gradient,
    surface_height,
)

MIN_STEP_MM = 0.02
LEAST_BEND = 1e-12
"""Added to what is divided by [1/mm]."""
NEAREST_AHEAD_MM, AHEAD_SHARE = 0.25, 0.35
"""Towards one of several tips a step looks this far, or this share of the distance to its axis."""


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
def _on_curve(r2: float, tip: int, rows: FloatArray) -> tuple[float, float, int]:
    """Height of one tip's top within its outer radius, dh/dr over r, and where its piece begins."""
    if r2 <= rows[tip, SPHERE_2]:
        root = math.sqrt(rows[tip, TIP_2] - r2)
        return rows[tip, SPHERE_Z] - root, 1.0 / root, PIECES
    w = math.sqrt(rows[tip, SCALE] * r2 + rows[tip, OFFSET])
    u = w - rows[tip, START]
    k = min(int(u), CELLS - 1)
    u -= k
    piece = PIECES + PIECE_COLUMNS * k
    c1, c2, c3 = rows[tip, piece + 1], rows[tip, piece + 2], rows[tip, piece + 3]
    turn = (c1 + u * (2.0 * c2 + u * 3.0 * c3)) * rows[tip, SCALE] / w
    return rows[tip, piece] + u * (c1 + u * (c2 + u * c3)), turn, piece


@inlined
def _bent_step(gap: float, opening: float, bend: float) -> float:
    """How far a gap that opens at this rate, and bends shut at this one at most, cannot close."""
    root = math.sqrt(opening * opening + 2.0 * bend * gap)
    return (opening + root) / bend if opening >= 0.0 else 2.0 * gap / (root - opening)


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
        if r2 >= rows[tip, OUTER_2]:
            gap, turn, piece = rows[tip, TOP], 0.0, PIECES + PIECE_COLUMNS * (CELLS - 1)
        else:
            gap, turn, piece = _on_curve(r2, tip, rows)
        gap -= z + dz * t
        if gap < 0.0:
            return previous, t
        rate = inward_rate if away < 0.0 else dz + rows[tip, piece + FALL] * plan
        if rate <= 0.0:
            return t, -1.0
        step = _bent_step(gap, turn * plan2 * away - dz, rows[tip, piece + BEND] * plan2 + LEAST_BEND)
        if away < 0.0:
            step = min(step, rows[tip, piece + WINDOW] / plan)
        step = max(step, gap / rate)
        if t + step >= end:
            return t, -1.0
        previous = t
        t = min(t + max(step, MIN_STEP_MM), end)


@kernel
def march_field(
    x: float, y: float, z: float, dx: float, dy: float, dz: float, t0: float, t1: float, takes_any: bool, top: Top,
) -> tuple[float, float]:  # fmt: skip
    """As `march`, for one tip and a field: their gaps, slopes and bends add up."""
    rows = top.rows
    reach = max(z + dz * t0, z + dz * t1) - rows[0, FIELD_LOWEST]
    if reach < rows[0, LOWEST]:
        return t0, -1.0
    px = x - rows[0, X]
    py = y - rows[0, Y]
    plan2 = max(dx * dx + dy * dy, 1e-20)
    closest = -(px * dx + py * dy) / plan2
    near2 = max(px * px + py * py - plan2 * closest * closest, 0.0)
    t = t0
    end = t1
    if reach < rows[0, TOP]:
        within2 = reach2(reach, 0, rows)
        if near2 >= within2:
            return t0, -1.0
        half = math.sqrt((within2 - near2) / plan2)
        t = max(t0, closest - half)
        end = min(t1, closest + half)
        if t >= end:
            return t0, -1.0
    if takes_any:
        middle = min(max(t, closest), end)
        if middle > t and surface_height(x + dx * middle, y + dy * middle, top) < z + dz * middle:
            return t, middle
    return _march_on_field(x, y, z, dx, dy, dz, t, end, closest, near2, plan2, top)


@inlined
def _march_on_field(
    x: float, y: float, z: float, dx: float, dy: float, dz: float, t: float, end: float, closest: float, near2: float,
    plan2: float, top: Top,
) -> tuple[float, float]:  # fmt: skip
    """The bracket in [t, end]; its upper end is -1 if there is none. Outside the tip's curve the field is alone."""
    rows = top.rows
    plan = math.sqrt(plan2)
    outer2 = rows[0, OUTER_2]
    entry = closest - math.sqrt(max(outer2 - near2, 0.0) / plan2)
    field_rate = dz + rows[0, FIELD_SLOPE] * plan
    inward_rate = field_rate + slope_bound(near2, 0, rows) * plan
    field_bend = rows[0, FIELD_BEND] * plan2 + LEAST_BEND
    previous = t
    while True:
        away = t - closest
        r2 = near2 + plan2 * away * away
        gap, gx, gy = field_gradient(x + dx * t, y + dy * t, top)
        gap -= z + dz * t
        opening = gx * dx + gy * dy - dz
        if r2 >= outer2:
            gap += rows[0, TOP]
            goes_in = away < 0.0 and near2 < outer2
            rate = inward_rate if goes_in else field_rate
            window = max(entry - t, MIN_STEP_MM) if goes_in else NEVER
            if gap < 0.0:
                return previous, t
            if rate <= 0.0:
                return t, -1.0
            step = max(_bent_step(gap, opening, field_bend), gap / field_rate if field_rate > 0.0 else NEVER)
        else:
            height_mm, turn, piece = _on_curve(r2, 0, rows)
            gap += height_mm
            rate = inward_rate if away < 0.0 else field_rate + rows[0, piece + FALL] * plan
            window = rows[0, piece + WINDOW] / plan if away < 0.0 else NEVER
            if gap < 0.0:
                return previous, t
            if rate <= 0.0:
                return t, -1.0
            step = _bent_step(gap, opening + turn * plan2 * away, field_bend + rows[0, piece + BEND] * plan2)
        step = max(min(step, window), gap / rate)
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
