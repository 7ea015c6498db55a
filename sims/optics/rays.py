# mypy: allow-untyped-defs, allow-untyped-calls, allow-untyped-decorators
"""Kernels: one ray, the deformed top, the walls. Arrays only; lengths mm, directions unit vectors.

`press`, `cubic`, `steepest` are one state's rows of `sims.optics.surface.SurfaceStack`; `box` is
(length, width, height, refractive index, absorption per mm).

Ray and top: the gap g(t) = h(r(t)) - z(t) closes at most at the rate dz + M |d_plan|, M the largest slope of
the part of the surface still ahead (of its falling part once the ray moves outward), so steps of g over that
rate cannot jump over a crossing. No step is shorter than `MIN_STEP_MM`, so a chord through the tip shorter
than that is missed (it would be less than 2e-5 mm deep in a 3 mm tip). Fresnel: unpolarised, elastomer to air
(Born and Wolf, sec. 1.5).
"""

from __future__ import annotations

import math

from numba import njit

from sims.optics.surface import (
    ACTIVE,
    CELLS,
    CONTACT_R,
    GRADING,
    LOWEST,
    OUTER_R,
    SPHERE_R,
    SPHERE_Z,
    TIP_R,
    TOP,
    X,
    Y,
)

MIN_STEP_MM = 0.02
BOTTOM, TIP, LOST = 4, 5, -1
MAX_BOUNCES = 24
LOST_WEIGHT = 1e-9

kernel = njit(error_model="numpy")


@kernel
def fresnel(cos_angle, index):
    """Unpolarised reflectance from inside; 1 beyond the critical angle."""
    sin2 = index * index * (1.0 - cos_angle * cos_angle)
    if sin2 >= 1.0:
        return 1.0
    cos_t = math.sqrt(1.0 - sin2)
    rs = (index * cos_angle - cos_t) / (index * cos_angle + cos_t)
    rp = (cos_angle - index * cos_t) / (cos_angle + index * cos_t)
    return 0.5 * (rs * rs + rp * rp)


@kernel
def wall_point(wall, along, z, box):
    """Point of a wall at `along`, z."""
    if wall == 0:
        return along, 0.0, z
    if wall == 1:
        return box[0], along, z
    if wall == 2:
        return along, box[1], z
    return 0.0, along, z


@kernel
def wall_normal(wall):
    """Inward normal (x, y) of a wall."""
    if wall == 0:
        return 0.0, 1.0
    if wall == 1:
        return -1.0, 0.0
    if wall == 2:
        return 0.0, -1.0
    return 1.0, 0.0


@kernel
def _cell_x(r, press):
    """Table coordinate x in 0..1 of a radius beyond the sphere."""
    q = (r - press[SPHERE_R]) / (press[OUTER_R] - press[SPHERE_R])
    return 2.0 * q / (GRADING + math.sqrt(GRADING * GRADING + 4.0 * (1.0 - GRADING) * q))


@kernel
def height(r, press, cubic):
    """Height of the top above the bottom."""
    if press[ACTIVE] == 0.0 or r >= press[OUTER_R]:
        return press[TOP]
    if r <= press[SPHERE_R]:
        return press[SPHERE_Z] - math.sqrt(press[TIP_R] * press[TIP_R] - r * r)
    x = _cell_x(r, press) * CELLS
    k = min(int(x), CELLS - 1)
    t = x - k
    return cubic[k, 0] + t * (cubic[k, 1] + t * (cubic[k, 2] + t * cubic[k, 3]))


@kernel
def height_and_slope(r, press, cubic):
    """Height of the top and dh/dr."""
    if press[ACTIVE] == 0.0 or r >= press[OUTER_R]:
        return press[TOP], 0.0
    if r <= press[SPHERE_R]:
        root = math.sqrt(press[TIP_R] * press[TIP_R] - r * r)
        return press[SPHERE_Z] - root, r / root
    x = _cell_x(r, press)
    per_mm = CELLS / ((press[OUTER_R] - press[SPHERE_R]) * (GRADING + 2.0 * (1.0 - GRADING) * x))
    x *= CELLS
    k = min(int(x), CELLS - 1)
    t = x - k
    h = cubic[k, 0] + t * (cubic[k, 1] + t * (cubic[k, 2] + t * cubic[k, 3]))
    return h, (cubic[k, 1] + t * (2.0 * cubic[k, 2] + t * 3.0 * cubic[k, 3])) * per_mm


@kernel
def height_slope_bend(r, press, cubic):
    """Height of the top, dh/dr and d²h/dr² beyond the sphere."""
    if press[ACTIVE] == 0.0 or r >= press[OUTER_R]:
        return press[TOP], 0.0, 0.0
    x = _cell_x(r, press)
    span = press[OUTER_R] - press[SPHERE_R]
    per_mm = 1.0 / (span * (GRADING + 2.0 * (1.0 - GRADING) * x))
    turn = -2.0 * (1.0 - GRADING) * span * per_mm * per_mm * per_mm
    x *= CELLS
    k = min(int(x), CELLS - 1)
    t = x - k
    h = cubic[k, 0] + t * (cubic[k, 1] + t * (cubic[k, 2] + t * cubic[k, 3]))
    first = (cubic[k, 1] + t * (2.0 * cubic[k, 2] + t * 3.0 * cubic[k, 3])) * CELLS
    second = (2.0 * cubic[k, 2] + t * 6.0 * cubic[k, 3]) * (CELLS * CELLS)
    return h, first * per_mm, second * per_mm * per_mm + first * turn


@kernel
def slope_bound(r, press, steepest):
    """Largest |dh/dr| at this radius and beyond."""
    if press[ACTIVE] == 0.0 or r >= press[OUTER_R]:
        return 0.0
    if r <= press[SPHERE_R]:
        return steepest[0, 0]
    return steepest[0, min(int(_cell_x(r, press) * CELLS), CELLS - 1)]


@kernel
def fall_bound(r, press, steepest):
    """Largest fall -dh/dr at this radius and beyond."""
    if press[ACTIVE] == 0.0 or r >= press[OUTER_R]:
        return 0.0
    if r <= press[SPHERE_R]:
        return steepest[1, 0]
    return steepest[1, min(int(_cell_x(r, press) * CELLS), CELLS - 1)]


@kernel
def march(x, y, z, dx, dy, dz, t0, t1, press, cubic, steepest):
    """Bracket of the first crossing from below to above the top in [t0, t1]; (t0, -1) if there is none."""
    if max(z + dz * t0, z + dz * t1) < press[LOWEST]:
        return t0, -1.0
    px = x - press[X]
    py = y - press[Y]
    plan2 = dx * dx + dy * dy
    plan = math.sqrt(plan2)
    b = px * dx + py * dy
    c = px * px + py * py
    closest = -b / plan2 if plan2 > 1e-20 else t0
    t_min = min(max(closest, t0), t1)
    r_min = math.sqrt(max(plan2 * t_min * t_min + 2.0 * b * t_min + c, 0.0))
    t = t0
    if dz > 0.0:
        t = max(t, min((press[LOWEST] - z) / dz, t1))
    previous = t
    while True:
        r = math.sqrt(max(plan2 * t * t + 2.0 * b * t + c, 0.0))
        gap = height(r, press, cubic) - (z + dz * t)
        if gap < 0.0:
            return previous, t
        if t >= t1:
            return t, -1.0
        previous = t
        if t >= closest:
            rate = dz + fall_bound(r, press, steepest) * plan
            if rate <= 0.0:
                return t, -1.0
            step = gap / rate
        else:
            window = max(0.25, 0.35 * r)
            rate = dz + slope_bound(max(r_min, r - window), press, steepest) * plan
            step = window / plan if rate <= 0.0 else min(gap / rate, window / plan)
        t = min(t + max(step, MIN_STEP_MM), t1)


@kernel
def is_clear(x, y, z, dx, dy, dz, length, press, cubic, steepest):
    """Whether the leg of this length that leaves a point of the top stays below the top."""
    if press[ACTIVE] == 0.0:
        return True
    t0 = min(MIN_STEP_MM, 0.5 * length)
    _, hit = march(x, y, z, dx, dy, dz, t0, length, press, cubic, steepest)
    return hit < 0.0


@kernel
def top_hit(x, y, z, dx, dy, dz, t1, press, cubic, steepest):
    """First distance in (0, t1) where the ray meets the top; -1 if it does not."""
    if press[ACTIVE] == 0.0:
        if dz <= 0.0:
            return -1.0
        t = (press[TOP] - z) / dz
        return t if t < t1 else -1.0
    low, high = march(x, y, z, dx, dy, dz, 0.0, t1, press, cubic, steepest)
    if high < 0.0:
        return -1.0
    px = x - press[X]
    py = y - press[Y]
    g_low = height(math.hypot(px + dx * low, py + dy * low), press, cubic) - (z + dz * low)
    g_high = height(math.hypot(px + dx * high, py + dy * high), press, cubic) - (z + dz * high)
    if g_low <= 0.0:
        return low
    for _ in range(60):
        t = low + (high - low) * g_low / (g_low - g_high)
        gap = height(math.hypot(px + dx * t, py + dy * t), press, cubic) - (z + dz * t)
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
def wall_hit(x, y, z, dx, dy, dz, box):
    """Distance to the nearest wall or the bottom, and which (0-3 walls, 4 bottom, -1 none)."""
    t = 1e30
    kind = LOST
    if dx > 0.0:
        t = (box[0] - x) / dx
        kind = 1
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
    if dz < 0.0:
        tz = -z / dz
        if tz < t:
            t = tz
            kind = BOTTOM
    return t, kind


@kernel
def chain(x, y, z, dx, dy, dz, weight, box, press, cubic, steepest):
    """Follow a ray through specular reflections at the top to a wall, the bottom or the tip.

    Returns kind (0-3 wall, 4 bottom, 5 tip, -1 lost), point, weight with Fresnel and absorption,
    number of top reflections, smallest radius of a reflection [mm].
    """
    tops = 0
    nearest = 1e30
    for _ in range(MAX_BOUNCES):
        t, kind = wall_hit(x, y, z, dx, dy, dz, box)
        if kind == LOST and dz <= 0.0:
            break
        hit = top_hit(x, y, z, dx, dy, dz, t, press, cubic, steepest)
        if hit >= 0.0:
            t = hit
        x += t * dx
        y += t * dy
        z += t * dz
        weight *= math.exp(-box[4] * t)
        if hit < 0.0:
            return kind, x, y, z, weight, tops, nearest
        px = x - press[X]
        py = y - press[Y]
        r = math.hypot(px, py)
        if press[ACTIVE] > 0.0 and r < press[CONTACT_R]:
            return TIP, x, y, z, weight, tops, nearest
        _, slope = height_and_slope(r, press, cubic)
        norm = 1.0 / math.sqrt(1.0 + slope * slope)
        nx = -slope * px / max(r, 1e-12) * norm
        ny = -slope * py / max(r, 1e-12) * norm
        cos_in = dx * nx + dy * ny + dz * norm
        if cos_in <= 0.0:
            break
        weight *= fresnel(cos_in, box[3])
        if weight < LOST_WEIGHT:
            break
        tops += 1
        nearest = min(nearest, r) if press[ACTIVE] > 0.0 else nearest
        dx -= 2.0 * cos_in * nx
        dy -= 2.0 * cos_in * ny
        dz -= 2.0 * cos_in * norm
        x -= 1e-9 * nx
        y -= 1e-9 * ny
        z -= 1e-9 * norm
    return LOST, x, y, z, weight, tops, nearest
