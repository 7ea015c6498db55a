# mypy: allow-untyped-defs, allow-untyped-calls, allow-untyped-decorators
"""Kernels: flux of a pair through one point of the top.

At a point p of the top the receiver's corners are reflected in the tangent plane and projected through p
onto the emitter's plane; the projection clipped against the emitter is the lit area A_p, so

    flux = integral over the top of r dr dphi  (g . d) (d . n_e) cos^(m-1) / d^4  (m + 1) / (2 pi) A_p / A_e

with d from emitter to p, g = (-dh/dx, -dh/dy, 1). No ray is sampled, and a caustic is no singularity. The
lit area is weighted at its centroid, within `NEAR_SIZES` emitter sizes by three points a triangle.

Both legs are tested against the top: for the centroid, and where a leg passes the steep part of the dimple
for the corners of the lit area too; if these differ, every triangle point is tested for itself.
"""

from __future__ import annotations

import math

from sims.optics.direct import plan_distance
from sims.optics.rays import fall_bound, fresnel, is_clear, kernel, wall_normal, wall_point
from sims.optics.surface import SKIRT_R, X, Y
from sims.optics.top_cells import top_point

NEAR_SIZES = 14.0
INWARD = 0.97
SHADOW_REACH = 1.1
LEAVING = 0.3
SPARE_SLOPE = 0.02


@kernel
def _clip(poly, other, source):
    """Clip a homogeneous polygon (tangential, vertical, w) against the emitter's half sizes; vertex count."""
    n = 4
    for side in range(5):
        kept = 0
        for c in range(n):
            d = c + 1 if c + 1 < n else 0
            if side == 0:
                fa = poly[c, 2] - 1e-9
                fb = poly[d, 2] - 1e-9
            elif side == 1:
                fa = source[3] * poly[c, 2] - poly[c, 0]
                fb = source[3] * poly[d, 2] - poly[d, 0]
            elif side == 2:
                fa = source[3] * poly[c, 2] + poly[c, 0]
                fb = source[3] * poly[d, 2] + poly[d, 0]
            elif side == 3:
                fa = source[4] * poly[c, 2] - poly[c, 1]
                fb = source[4] * poly[d, 2] - poly[d, 1]
            else:
                fa = source[4] * poly[c, 2] + poly[c, 1]
                fb = source[4] * poly[d, 2] + poly[d, 1]
            if fa >= 0.0:
                other[kept, 0] = poly[c, 0]
                other[kept, 1] = poly[c, 1]
                other[kept, 2] = poly[c, 2]
                kept += 1
            if (fa >= 0.0) != (fb >= 0.0):
                t = fa / (fa - fb)
                for k in range(3):
                    other[kept, k] = poly[c, k] + t * (poly[d, k] - poly[c, k])
                kept += 1
        n = kept
        if n < 3:
            return 0
        for c in range(n):
            for k in range(3):
                poly[c, k] = other[c, k]
    for c in range(n):
        poly[c, 0] /= poly[c, 2]
        poly[c, 1] /= poly[c, 2]
    return n


@kernel
def _project(source, target, px, py, pz, gx, gy, ex, ey, ez, depth, box, poly):
    """Receiver corners reflected at p and projected onto the emitter's plane, homogeneous."""
    norm2 = 1.0 / (1.0 + gx * gx + gy * gy)
    n0, n1 = wall_normal(int(source[0]))
    on_x = int(source[0]) % 2 == 0
    tangent = px - ex if on_x else py - ey
    for c in range(4):
        along = target[1] + (-target[3] if c == 0 or c == 3 else target[3])
        z = target[2] + (-target[4] if c < 2 else target[4])
        qx, qy, qz = wall_point(int(target[0]), along, z, box)
        tx = qx - px
        ty = qy - py
        tz = qz - pz
        back = 2.0 * (tz - gx * tx - gy * ty) * norm2
        tx += back * gx
        ty += back * gy
        tz -= back
        w = tx * n0 + ty * n1
        poly[c, 0] = tangent * w - depth * (tx if on_x else ty)
        poly[c, 1] = (pz - ez) * w - depth * tz
        poly[c, 2] = w


@kernel
def _spread(a, b, px, py, pz, gx, gy, ex, ey, ez, source, box):
    """Emission, incidence and absorption weight of the emitter point at offset (a, b); direction to p."""
    n0, n1 = wall_normal(int(source[0]))
    on_x = int(source[0]) % 2 == 0
    dx = px - ex - (a if on_x else 0.0)
    dy = py - ey - (0.0 if on_x else a)
    dz = pz - ez - b
    into = -gx * dx - gy * dy + dz
    out = dx * n0 + dy * n1
    d2 = dx * dx + dy * dy + dz * dz
    if into <= 0.0 or out <= 0.0:
        return 0.0, dx, dy, dz
    d = math.sqrt(d2)
    f = out * into / (d2 * d2)
    order = source[5]
    if order != 1.0:
        f *= (out / d) ** (order - 1.0)
    cos_in = into / (d * math.sqrt(1.0 + gx * gx + gy * gy))
    return f * fresnel(cos_in, box[3]) * math.exp(-box[4] * d), dx, dy, dz


@kernel
def _polygon(n, poly):
    """Signed area and centroid of a polygon."""
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


@kernel
def _sees(a, b, px, py, pz, gx, gy, ex, ey, ez, source, target, box, press, cubic, steepest):
    """Length of the leg to the receiver's plane for the emitter point at offset (a, b); -1 if it is hidden."""
    on_x = int(source[0]) % 2 == 0
    dx = px - ex - (a if on_x else 0.0)
    dy = py - ey - (0.0 if on_x else a)
    dz = pz - ez - b
    into = dz - gx * dx - gy * dy
    if into <= 0.0:
        return -1.0
    d = math.sqrt(dx * dx + dy * dy + dz * dz)
    dx /= d
    dy /= d
    dz /= d
    if not is_clear(px, py, pz, -dx, -dy, -dz, d, press, cubic, steepest):
        return -1.0
    back = 2.0 * into / d / (1.0 + gx * gx + gy * gy)
    dx += back * gx
    dy += back * gy
    dz -= back
    m0, m1 = wall_normal(int(target[0]))
    qx, qy, _ = wall_point(int(target[0]), target[1], target[2], box)
    approach = -(dx * m0 + dy * m1)
    if approach <= 1e-9:
        return -1.0
    length = ((px - qx) * m0 + (py - qy) * m1) / approach
    if length <= 0.0 or not is_clear(px, py, pz, dx, dy, dz, length, press, cubic, steepest):
        return -1.0
    return length


@kernel
def _is_divided(
    n, poly, cx, cy, seen, px, py, pz, gx, gy, ex, ey, ez, source, target, box, press, cubic, steepest
):
    """Whether some corner of the lit area (drawn in a little) is hidden and some is not."""
    for c in range(n):
        x = cx + INWARD * (poly[c, 0] - cx)
        y = cy + INWARD * (poly[c, 1] - cy)
        leg = _sees(x, y, px, py, pz, gx, gy, ex, ey, ez, source, target, box, press, cubic, steepest)
        if (leg >= 0.0) != seen:
            return True
    return False


@kernel
def _mean_weight(
    n,
    poly,
    area,
    cx,
    cy,
    divided,
    px,
    py,
    pz,
    gx,
    gy,
    ex,
    ey,
    ez,
    source,
    target,
    box,
    press,
    cubic,
    steepest,
):
    """Mean weight over the lit area, three points in each triangle from centroid to edge (second order).

    Where the area is divided, a hidden point counts nothing; returns also a leg length to the receiver.
    """
    total = 0.0
    length = -1.0
    for c in range(n):
        e = c + 1 if c + 1 < n else 0
        ax, ay, bx, by = poly[c, 0], poly[c, 1], poly[e, 0], poly[e, 1]
        cross = (ax - cx) * (by - cy) - (ay - cy) * (bx - cx)
        for k in range(3):
            wa = 2.0 / 3.0 if k == 0 else 1.0 / 6.0
            wb = 2.0 / 3.0 if k == 1 else 1.0 / 6.0
            x = (1.0 - wa - wb) * cx + wa * ax + wb * bx
            y = (1.0 - wa - wb) * cy + wa * ay + wb * by
            if divided:
                leg = _sees(x, y, px, py, pz, gx, gy, ex, ey, ez, source, target, box, press, cubic, steepest)
                if leg < 0.0:
                    continue
                length = leg
            f, _, _, _ = _spread(x, y, px, py, pz, gx, gy, ex, ey, ez, source, box)
            total += f * cross / 6.0
    return total / area, length


@kernel
def _may_be_shaded(px, py, pz, qx, qy, qz, press, steepest):
    """Whether a leg from the top to (around) q comes near the steep part, and not just away from it."""
    if plan_distance(px, py, qx, qy, press[X], press[Y]) > SHADOW_REACH * press[SKIRT_R]:
        return False
    dx = qx - px
    dy = qy - py
    run = math.hypot(dx, dy)
    r = math.hypot(px - press[X], py - press[Y])
    outward = (px - press[X]) * dx + (py - press[Y]) * dy
    leaves = outward > LEAVING * r * run
    return not (leaves and pz - qz > (fall_bound(r, press, steepest) + SPARE_SLOPE) * run)


@kernel
def pinhole(wall, u, v, source, target, sectors, reach, box, press, cubic, steepest, poly, other):
    """Flux through the top at (u, v) per du dv, the radius, and whether the image meets the emitter."""
    px, py, pz, gx, gy, r, plan = top_point(wall, u, v, sectors, press, cubic)
    if r > reach:
        return 0.0, r, False
    ex, ey, ez = wall_point(int(source[0]), source[1], source[2], box)
    n0, n1 = wall_normal(int(source[0]))
    depth = (px - ex) * n0 + (py - ey) * n1
    if depth <= 1e-6:
        return 0.0, r, False
    _project(source, target, px, py, pz, gx, gy, ex, ey, ez, depth, box, poly)
    n = _clip(poly, other, source)
    if n == 0:
        return 0.0, r, False
    area, cx, cy = _polygon(n, poly)
    if area == 0.0:
        return 0.0, r, False
    length = _sees(cx, cy, px, py, pz, gx, gy, ex, ey, ez, source, target, box, press, cubic, steepest)
    qx, qy, _ = wall_point(int(target[0]), target[1], target[2], box)
    divided = False
    if _may_be_shaded(px, py, pz, ex, ey, ez + source[4], press, steepest) or _may_be_shaded(
        px, py, pz, qx, qy, target[2] + target[4], press, steepest
    ):
        divided = _is_divided(
            n, poly, cx, cy, length >= 0.0, px, py, pz, gx, gy, ex, ey, ez, source, target, box, press, cubic,
            steepest,
        )  # fmt: skip
    if length < 0.0 and not divided:
        return 0.0, r, True
    f, dx, dy, dz = _spread(cx, cy, px, py, pz, gx, gy, ex, ey, ez, source, box)
    near = NEAR_SIZES * 2.0 * max(source[3], source[4])
    if divided or dx * dx + dy * dy + dz * dz < near * near:
        f, leg = _mean_weight(
            n, poly, area, cx, cy, divided, px, py, pz, gx, gy, ex, ey, ez, source, target, box, press, cubic,
            steepest,
        )  # fmt: skip
        if divided:
            length = leg
    if f <= 0.0:
        return 0.0, r, True
    f *= math.exp(-box[4] * length) * abs(area) / source[6] * (source[5] + 1.0) / (2.0 * math.pi)
    return f * plan, r, True
