# mypy: no-warn-return-any
"""Kernels: polygons, the point where a ray meets the deformed top, and direct light between rectangles on walls.

Polygons
--------
Convex polygons of homogeneous points (x, y, w) are rows of an array. They are cut by Sutherland and Hodgman's clipping,
one half plane at a time; w allows a point behind the eye.

A ray and the top
-----------------
A march along a ray finds an interval in which the ray crosses the top, and Newton's steps find the point. The top is
the sum of the tip's curve and of a smooth field (`optopad.sims.optics.surface.tops`). The gap g(t) = h(x(t), y(t)) -
z(t) closes at most at the rate dz + M |d_plan|, with M the largest slope of the surface still ahead (of its falling
part once the ray moves outward). So a step of g divided by that rate cannot jump over a crossing. Nor can a step to the
root of g + g' s - K |d_plan|^2 s^2 / 2, with K the largest bend (downward curvature) ahead; the longer of both is
taken. No step is shorter than `MIN_STEP_MM`, so a ray that passes through the tip for less than this length is missed
(less than 2e-5 mm deep in a 3 mm tip).

Without a field, the top is a plane beyond the outer radius and needs no steps there. A ray below the undisturbed top is
followed only where the top may come below the ray's highest point. With a field, which is a pad's usual top, slopes and
bends of both are added.

Direct light
------------
Direct light, and light mirrored by a flat top, is integrated by Gauss quadrature over the emitter's area, the
receiver's columns and, in each column, the part of its height that the emitter's point sees. In the vertical plane
through emitter point e and a column, the top's horizon is

    Z* = z_e + min over the chord of (h(s) - z_e) / s,     s = fraction of the way in plan,

and direct light is visible below Z*. Patches, here the faces of emitters and receivers, are clipped to the clear layer.
Reflection at the top follows Fresnel, absorption along the path Beer and Lambert.
"""

from __future__ import annotations

import math

from optopad.design.arrays import FloatArray
from optopad.sims.optics.surface.curves import (
    ACTIVE,
    BEND,
    CELLS,
    FALL,
    LOWEST,
    OFFSET,
    OUTER_2,
    OUTER_R,
    PIECE_COLUMNS,
    PIECES,
    SCALE,
    SPHERE_2,
    SPHERE_Z,
    START,
    TIP_2,
    TOP,
    WINDOW,
    X,
    Y,
)
from optopad.sims.optics.surface.radial import (
    NEVER,
    distance,
    fresnel,
    height,
    height_and_slope,
    inlined,
    kernel,
    radiance,
    reach2,
    slope_bound,
    wall_hit,
    wall_normal,
    wall_point,
)
from optopad.sims.optics.surface.tops import (
    FIELD_BEND,
    FIELD_LOWEST,
    FIELD_SLOPE,
    SLACK,
    Top,
    field_gradient,
    is_plain,
    surface_gradient,
    surface_height,
    touch,
)


@kernel
def cut(n: int, poly: FloatArray, other: FloatArray, along: float, up: float, whole: float) -> int:
    """Clip a polygon of homogeneous points (x, y, w) to along x + up y + whole w >= 0; return its number of corners."""
    outside = 0
    for c in range(n):
        if along * poly[c, 0] + up * poly[c, 1] + whole * poly[c, 2] < 0.0:
            outside += 1
    if outside == 0:
        return n
    if outside == n:
        return 0
    kept = 0
    fc = along * poly[0, 0] + up * poly[0, 1] + whole * poly[0, 2]
    for c in range(n):
        d = c + 1 if c + 1 < n else 0
        fd = along * poly[d, 0] + up * poly[d, 1] + whole * poly[d, 2]
        if fc >= 0.0:
            for k in range(3):
                other[kept, k] = poly[c, k]
            kept += 1
        if (fc >= 0.0) != (fd >= 0.0):
            t = fc / (fc - fd)
            for k in range(3):
                other[kept, k] = poly[c, k] + t * (poly[d, k] - poly[c, k])
            kept += 1
        fc = fd
    for c in range(kept):
        for k in range(3):
            poly[c, k] = other[c, k]
    return kept if kept > 2 else 0


@kernel
def cut_to_rectangle(n: int, poly: FloatArray, other: FloatArray, half_x: float, half_y: float) -> int:
    """Clip a polygon in front of the eye to |x| <= half_x, |y| <= half_y; return its number of corners."""
    n = cut(n, poly, other, -1.0, 0.0, half_x)
    if n > 0:
        n = cut(n, poly, other, 1.0, 0.0, half_x)
    if n > 0:
        n = cut(n, poly, other, 0.0, -1.0, half_y)
    if n > 0:
        n = cut(n, poly, other, 0.0, 1.0, half_y)
    return n


@kernel
def area_and_centroid(n: int, poly: FloatArray) -> tuple[float, float, float]:
    """Signed area and centroid (x, y) of a polygon whose points have w = 1."""
    x0 = poly[0, 0]
    y0 = poly[0, 1]
    area = 0.0
    sx = 0.0
    sy = 0.0
    for c in range(1, n - 1):
        ax = poly[c, 0] - x0
        ay = poly[c, 1] - y0
        bx = poly[c + 1, 0] - x0
        by = poly[c + 1, 1] - y0
        cross = ax * by - ay * bx
        area += cross
        sx += cross * (ax + bx)
        sy += cross * (ay + by)
    if abs(area) < 1e-15:
        return 0.0, x0, y0
    return 0.5 * area, x0 + sx / (3.0 * area), y0 + sy / (3.0 * area)


CLOSED_MM = 1e-10
"""Height of the top above a ray at which the ray counts as meeting the top [mm]."""
BOTTOM, TIP, LOST = 4, 5, -1
MAX_BOUNCES = 24
LOST_WEIGHT = 1e-9


@inlined
def crossing(
    x: float, y: float, z: float, dx: float, dy: float, dz: float, t0: float, t1: float, top: Top
) -> tuple[float, float]:
    """Interval within distances [t0, t1] in which a ray rises through the top; (t0, -1) if there is none."""
    if is_plain(top):
        return march(x, y, z, dx, dy, dz, t0, t1, True, top.row)
    return march_field(x, y, z, dx, dy, dz, t0, t1, True, top)


@kernel
def is_clear(x: float, y: float, z: float, dx: float, dy: float, dz: float, length: float, top: Top) -> bool:
    """Whether a straight line of the given length from a point of the top stays below the top."""
    t0 = min(MIN_STEP_MM, 0.5 * length)
    _, hit = crossing(x, y, z, dx, dy, dz, t0, length, top)
    return hit < 0.0


@inlined
def top_hit(x: float, y: float, z: float, dx: float, dy: float, dz: float, t1: float, top: Top) -> float:
    """First distance in (0, t1) where the ray meets the top [mm]; -1 if it does not."""
    if is_plain(top):
        return _tip_hit(x, y, z, dx, dy, dz, t1, top.row)
    return _field_hit(x, y, z, dx, dy, dz, t1, top)


@kernel
def _tip_hit(
    x: float, y: float, z: float, dx: float, dy: float, dz: float, t1: float, row: FloatArray
) -> float:
    """`top_hit` without a field."""
    low, high = march(x, y, z, dx, dy, dz, 0.0, t1, False, row)
    return high if high <= low else _refined(x, y, z, dx, dy, dz, low, high, row)


@kernel
def _field_hit(x: float, y: float, z: float, dx: float, dy: float, dz: float, t1: float, top: Top) -> float:
    """`top_hit` with a field, by Newton's steps, or by halving where a step leaves the interval."""
    low, high = march_field(x, y, z, dx, dy, dz, 0.0, t1, False, top)
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
    x: float, y: float, z: float, dx: float, dy: float, dz: float, low: float, high: float, row: FloatArray
) -> float:
    """Distance in an interval at which a ray crosses one tip's top, by Newton's steps, halved if they leave it."""
    px = x - row[X]
    py = y - row[Y]
    plan2 = dx * dx + dy * dy
    b = px * dx + py * dy
    c = px * px + py * py
    t = high
    for _ in range(60):
        r2 = max(c + t * (2.0 * b + plan2 * t), 0.0)
        h, turn = height_and_slope(r2, row)
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
    """Follow a ray through reflections at the top to a wall, the bottom or a tip.

    Returns where it ends (0-3 wall, 4 bottom, 5 tip, -1 lost), point, direction, weight after Fresnel reflection and
    absorption, number of reflections at the top, and their smallest distance from a tip's axis as a multiple of the
    radius of the tip's steep skirt.
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
        touches, share = touch(x, y, top)
        if touches:
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


MIN_STEP_MM = 0.02
LEAST_BEND = 1e-12
"""Added to divisors so that none is 0 [1/mm]."""


@inlined
def _plane_hit(z: float, dz: float, t0: float, t1: float, top: float) -> float:
    """Distance at which a ray meets the undisturbed top in [t0, t1]; -1 if it does not."""
    if dz <= 0.0:
        return -1.0
    t = (top - z) / dz
    return max(t, t0) if t <= t1 else -1.0


@inlined
def march(
    x: float, y: float, z: float, dx: float, dy: float, dz: float, t0: float, t1: float, takes_any: bool,
    row: FloatArray,
) -> tuple[float, float]:  # fmt: skip
    """Interval within [t0, t1] in which a ray first rises through one tip's top; (t0, -1) if there is none.

    takes_any : whether any crossing will do, not only the first; one is nearly always found where the ray is nearest to
        the axis
    """
    highest = max(z + dz * t0, z + dz * t1)
    if highest < row[LOWEST]:
        return t0, -1.0
    px = x - row[X]
    py = y - row[Y]
    plan2 = max(dx * dx + dy * dy, 1e-20)
    closest = -(px * dx + py * dy) / plan2
    c = px * px + py * py
    near2 = max(c - plan2 * closest * closest, 0.0)
    outer2 = row[OUTER_2] if highest >= row[TOP] else reach2(highest, row)
    if near2 >= outer2:
        hit = _plane_hit(z, dz, t0, t1, row[TOP])
        return (t0, hit) if hit < 0.0 else (hit, hit)
    half = math.sqrt((outer2 - near2) / plan2)
    t = max(t0, closest - half)
    end = min(t1, closest + half)
    if t > t0:
        hit = _plane_hit(z, dz, t0, min(t, t1), row[TOP])
        if hit >= 0.0:
            return hit, hit
    if t < end:
        if takes_any:
            middle = min(max(t, closest), end)
            away = middle - closest
            if height(near2 + plan2 * away * away, row) < z + dz * middle:
                return t, middle
        low, high = _march_within(z, dz, t, end, closest, near2, plan2, row)
        if high >= 0.0:
            return low, high
    if end < t1:
        hit = _plane_hit(z, dz, max(end, t0), t1, row[TOP])
        if hit >= 0.0:
            return hit, hit
    return t0, -1.0


@inlined
def _on_curve(r2: float, row: FloatArray) -> tuple[float, float, int]:
    """Height of one tip's top within its outer radius, (dh/dr) / r, and the column where its piece begins."""
    if r2 <= row[SPHERE_2]:
        root = math.sqrt(row[TIP_2] - r2)
        return row[SPHERE_Z] - root, 1.0 / root, PIECES
    w = math.sqrt(row[SCALE] * r2 + row[OFFSET])
    u = w - row[START]
    k = min(int(u), CELLS - 1)
    u -= k
    piece = PIECES + PIECE_COLUMNS * k
    c1, c2, c3 = row[piece + 1], row[piece + 2], row[piece + 3]
    turn = (c1 + u * (2.0 * c2 + u * 3.0 * c3)) * row[SCALE] / w
    return row[piece] + u * (c1 + u * (c2 + u * c3)), turn, piece


@inlined
def _bent_step(gap: float, opening: float, bend: float) -> float:
    """Distance within which a ray cannot reach the top.

    gap : height of the top above the ray
    opening : rate at which the gap opens along the ray; it falls by at most `bend` per mm"""
    root = math.sqrt(opening * opening + 2.0 * bend * gap)
    return (opening + root) / bend if opening >= 0.0 else 2.0 * gap / (root - opening)


@inlined
def _march_within(
    z: float, dz: float, t: float, end: float, closest: float, near2: float, plan2: float, row: FloatArray,
) -> tuple[float, float]:  # fmt: skip
    """Interval of the first crossing in [t, end], within a tip's outer radius; its upper end is -1 if there is none."""
    plan = math.sqrt(plan2)
    inward_rate = dz + slope_bound(near2, row) * plan
    previous = t
    while True:
        away = t - closest
        r2 = near2 + plan2 * away * away
        if r2 >= row[OUTER_2]:
            gap, turn, piece = row[TOP], 0.0, PIECES + PIECE_COLUMNS * (CELLS - 1)
        else:
            gap, turn, piece = _on_curve(r2, row)
        gap -= z + dz * t
        if gap < 0.0:
            return previous, t
        rate = inward_rate if away < 0.0 else dz + row[piece + FALL] * plan
        if rate <= 0.0:
            return t, -1.0
        step = _bent_step(gap, turn * plan2 * away - dz, row[piece + BEND] * plan2 + LEAST_BEND)
        if away < 0.0:
            step = min(step, row[piece + WINDOW] / plan)
        step = max(step, gap / rate)
        if t + step >= end:
            return t, -1.0
        previous = t
        t = min(t + max(step, MIN_STEP_MM), end)


@kernel
def march_field(
    x: float, y: float, z: float, dx: float, dy: float, dz: float, t0: float, t1: float, takes_any: bool, top: Top,
) -> tuple[float, float]:  # fmt: skip
    """Interval of a crossing, as `march` returns it, for one tip and a smooth field, whose slopes and bends add up."""
    row = top.row
    reach = max(z + dz * t0, z + dz * t1) - row[FIELD_LOWEST]
    if reach < row[LOWEST]:
        return t0, -1.0
    px = x - row[X]
    py = y - row[Y]
    plan2 = max(dx * dx + dy * dy, 1e-20)
    closest = -(px * dx + py * dy) / plan2
    near2 = max(px * px + py * py - plan2 * closest * closest, 0.0)
    t = t0
    end = t1
    if reach < row[TOP]:
        within2 = reach2(reach, row)
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
    """Interval of the first crossing in [t, end], for one tip and a field; its upper end is -1 if there is none."""
    row = top.row
    plan = math.sqrt(plan2)
    outer2 = row[OUTER_2]
    entry = closest - math.sqrt(max(outer2 - near2, 0.0) / plan2)
    field_rate = dz + row[FIELD_SLOPE] * plan
    inward_rate = field_rate + slope_bound(near2, row) * plan
    field_bend = row[FIELD_BEND] * plan2 + LEAST_BEND
    previous = t
    while True:
        away = t - closest
        r2 = near2 + plan2 * away * away
        # a ray that falls is clear if the tip's curve is nowhere below its height from here on
        if dz < 0.0:
            level = z + dz * t - row[FIELD_LOWEST]
            if level < row[TOP] and reach2(level, row) <= (near2 if away < 0.0 else r2):
                return t, -1.0
        gap, gx, gy = field_gradient(x + dx * t, y + dy * t, top)
        gap -= z + dz * t
        opening = gx * dx + gy * dy - dz
        if r2 >= outer2:
            gap += row[TOP]
            goes_in = away < 0.0 and near2 < outer2
            rate = inward_rate if goes_in else field_rate
            window = max(entry - t, MIN_STEP_MM) if goes_in else NEVER
            if gap < 0.0:
                return previous, t
            if rate <= 0.0:
                return t, -1.0
            step = max(_bent_step(gap, opening, field_bend), gap / field_rate if field_rate > 0.0 else NEVER)
        else:
            height_mm, turn, piece = _on_curve(r2, row)
            gap += height_mm
            rate = inward_rate if away < 0.0 else field_rate + row[piece + FALL] * plan
            window = row[piece + WINDOW] / plan if away < 0.0 else NEVER
            if gap < 0.0:
                return previous, t
            if rate <= 0.0:
                return t, -1.0
            step = _bent_step(gap, opening + turn * plan2 * away, field_bend + row[piece + BEND] * plan2)
        step = max(min(step, window), gap / rate)
        if t + step >= end:
            return t, -1.0
        previous = t
        t = min(t + max(step, MIN_STEP_MM), end)


HORIZON_SAMPLES = 14
HORIZON_BISECTIONS = 9
GOLDEN = 0.6180339887498949
OPEN = 1e9


@kernel
def blocking_radius(z: float, row: FloatArray) -> float:
    """Radius beyond which one tip's top is nowhere below z [mm]; -1 if it is nowhere below z at any radius."""
    if row[ACTIVE] == 0.0 or z <= row[LOWEST]:
        return -1.0
    return math.sqrt(reach2(z, row)) if z < row[TOP] else row[OUTER_R]


@kernel
def plan_distance(ax: float, ay: float, bx: float, by: float, cx: float, cy: float) -> float:
    """Distance of point c from the line segment between points a and b, in plan [mm]."""
    dx = bx - ax
    dy = by - ay
    t = min(max(((cx - ax) * dx + (cy - ay) * dy) / max(dx * dx + dy * dy, 1e-30), 0.0), 1.0)
    return distance(ax + t * dx - cx, ay + t * dy - cy)


@kernel
def bundle_misses(
    source: FloatArray, target: FloatArray, radius: float, box: FloatArray, x: float, y: float
) -> bool:
    """Whether no straight line from source to target comes, in plan, within a radius of the press axis (x, y)."""
    a0, b0, _ = wall_point(int(source[0]), source[1] - source[3], 0.0, box)
    a1, b1, _ = wall_point(int(source[0]), source[1] + source[3], 0.0, box)
    c0, d0, _ = wall_point(int(target[0]), target[1] - target[3], 0.0, box)
    c1, d1, _ = wall_point(int(target[0]), target[1] + target[3], 0.0, box)
    near = min(
        min(plan_distance(a0, b0, c0, d0, x, y), plan_distance(a0, b0, c1, d1, x, y)),
        min(plan_distance(a1, b1, c0, d0, x, y), plan_distance(a1, b1, c1, d1, x, y)),
    )
    near = min(near, min(plan_distance(a0, b0, a1, b1, x, y), plan_distance(c0, d0, c1, d1, x, y)))
    if near <= radius:
        return False
    inside = _left_of(a0, b0, c0, d0, x, y) * _left_of(a1, b1, c1, d1, x, y) < 0.0
    crossed = _left_of(a0, b0, c1, d1, x, y) * _left_of(a1, b1, c0, d0, x, y) < 0.0
    return not (inside or crossed)


@kernel
def _left_of(ax: float, ay: float, bx: float, by: float, cx: float, cy: float) -> float:
    return (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)


@kernel
def reach_of(z: float, top: Top) -> float:
    """Radius beyond which the dimple cannot block a line that stays below z [mm]."""
    return blocking_radius(z + top.row[SLACK], top.row)


@kernel
def misses(source: FloatArray, target: FloatArray, radius: float, box: FloatArray, top: Top) -> bool:
    """Whether all straight lines between two patches stay outside a radius around the tip's axis in plan."""
    return top.row[ACTIVE] == 0.0 or bundle_misses(source, target, radius, box, top.row[X], top.row[Y])


@kernel
def _rise(s: float, b: float, c: float, a: float, z: float, row: FloatArray) -> float:
    return (height(max(a * s * s + 2.0 * b * s + c, 0.0), row) - z) / s


@kernel
def _rise_any(s: float, x: float, y: float, dx: float, dy: float, z: float, top: Top) -> float:
    return (surface_height(x + s * dx, y + s * dy, top) - z) / s


@kernel
def horizon(x: float, y: float, z: float, qx: float, qy: float, radius: float, top: Top) -> float:
    """Height at (qx, qy) below which the straight line from (x, y, z) passes under the top; OPEN if any height does.

    radius : `reach_of` the line's heights; only the part of the line within this radius of the tip's axis counts
    """
    if radius <= 0.0:
        return OPEN
    plain = is_plain(top)
    dx = qx - x
    dy = qy - y
    px = x - top.row[X]
    py = y - top.row[Y]
    a = dx * dx + dy * dy
    b = px * dx + py * dy
    c = px * px + py * py
    disc = b * b - a * (c - radius * radius)
    if disc <= 0.0:
        return OPEN
    root = math.sqrt(disc)
    low = max((-b - root) / a, 1e-6)
    high = min((-b + root) / a, 1.0)
    if high <= low:
        return OPEN
    step = (high - low) / HORIZON_SAMPLES
    best = 1e18
    at = 0
    for k in range(HORIZON_SAMPLES + 1):
        s = low + step * k
        value = _rise(s, b, c, a, z, top.row) if plain else _rise_any(s, x, y, dx, dy, z, top)
        if value < best:
            best = value
            at = k
    left = low + step * max(at - 1, 0)
    right = low + step * min(at + 1, HORIZON_SAMPLES)
    s1 = right - GOLDEN * (right - left)
    s2 = left + GOLDEN * (right - left)
    f1 = _rise(s1, b, c, a, z, top.row) if plain else _rise_any(s1, x, y, dx, dy, z, top)
    f2 = _rise(s2, b, c, a, z, top.row) if plain else _rise_any(s2, x, y, dx, dy, z, top)
    for _ in range(HORIZON_BISECTIONS):
        if f1 < f2:
            right = s2
            s2 = s1
            f2 = f1
            s1 = right - GOLDEN * (right - left)
            f1 = _rise(s1, b, c, a, z, top.row) if plain else _rise_any(s1, x, y, dx, dy, z, top)
        else:
            left = s1
            s1 = s2
            f1 = f2
            s2 = left + GOLDEN * (right - left)
            f2 = _rise(s2, b, c, a, z, top.row) if plain else _rise_any(s2, x, y, dx, dy, z, top)
    return z + min(best, min(f1, f2))


@kernel
def column_flux(
    x: float, y: float, z: float, source: FloatArray, target: FloatArray, qx: float, qy: float, z0: float, z1: float,
    mirrored: bool, box: FloatArray, nodes: FloatArray, weights: FloatArray,
) -> float:  # fmt: skip
    """Flux from an emitter's point to heights z0 to z1 of a receiver's column, per column width and emitter share."""
    if z1 <= z0:
        return 0.0
    n0, n1 = wall_normal(int(source[0]))
    m0, m1 = wall_normal(int(target[0]))
    dx = qx - x
    dy = qy - y
    out = dx * n0 + dy * n1
    into = -(dx * m0 + dy * m1)
    if out <= 0.0 or into <= 0.0:
        return 0.0
    plain = source[5] == 1.0 and target[5] == 1.0
    plan2 = dx * dx + dy * dy
    total = 0.0
    for k in range(nodes.shape[0]):
        height_k = z0 + (z1 - z0) * nodes[k]
        dz = (2.0 * box[2] - height_k if mirrored else height_k) - z
        d2 = plan2 + dz * dz
        d = math.sqrt(d2)
        f = out * into / (d2 * d2)
        if not plain:
            f *= math.pi * math.pi * radiance(source, out / d) * radiance(target, into / d)
        if mirrored:
            f *= fresnel(dz / d, box[3])
        if box[4] > 0.0:
            f *= math.exp(-box[4] * d)
        total += weights[k] * f
    return total * (z1 - z0) / math.pi


@kernel
def direct_flux(
    source: FloatArray, target: FloatArray, radius: float, box: FloatArray, top: Top, nodes_e: FloatArray,
    weights_e: FloatArray, nodes_u: FloatArray, weights_u: FloatArray, nodes_z: FloatArray, weights_z: FloatArray,
) -> float:  # fmt: skip
    """Direct flux of a pair under a press, as a fraction of the emitter's power."""
    total = 0.0
    low = target[2] - target[4]
    high = target[2] + target[4]
    for a in range(nodes_e.shape[0]):
        for b in range(nodes_e.shape[0]):
            along = source[1] + source[3] * (2.0 * nodes_e[a] - 1.0)
            z = source[2] + source[4] * (2.0 * nodes_e[b] - 1.0)
            x, y, z = wall_point(int(source[0]), along, z, box)
            share = weights_e[a] * weights_e[b]
            for c in range(nodes_u.shape[0]):
                column = target[1] + target[3] * (2.0 * nodes_u[c] - 1.0)
                qx, qy, _ = wall_point(int(target[0]), column, 0.0, box)
                edge = min(high, horizon(x, y, z, qx, qy, radius, top))
                flux = column_flux(x, y, z, source, target, qx, qy, low, edge, False, box, nodes_z, weights_z)
                total += share * weights_u[c] * flux
    return total * 2.0 * target[3] * 4.0 * source[3] * source[4] / source[6]


@kernel
def flat_flux(
    source: FloatArray, target: FloatArray, box: FloatArray, mirrored: bool, nodes_e: FloatArray, weights_e: FloatArray,
    nodes_u: FloatArray, weights_u: FloatArray, nodes_z: FloatArray, weights_z: FloatArray,
) -> float:  # fmt: skip
    """Flux of a pair under a flat top, direct or mirrored once by the top, as a fraction of the emitter's power."""
    total = 0.0
    low = target[2] - target[4]
    high = target[2] + target[4]
    for a in range(nodes_e.shape[0]):
        for b in range(nodes_e.shape[0]):
            along = source[1] + source[3] * (2.0 * nodes_e[a] - 1.0)
            z = source[2] + source[4] * (2.0 * nodes_e[b] - 1.0)
            x, y, z = wall_point(int(source[0]), along, z, box)
            for c in range(nodes_u.shape[0]):
                column = target[1] + target[3] * (2.0 * nodes_u[c] - 1.0)
                qx, qy, _ = wall_point(int(target[0]), column, 0.0, box)
                flux = column_flux(
                    x, y, z, source, target, qx, qy, low, high, mirrored, box, nodes_z, weights_z
                )
                total += weights_e[a] * weights_e[b] * weights_u[c] * flux
    return total * 2.0 * target[3] * 4.0 * source[3] * source[4] / source[6]
