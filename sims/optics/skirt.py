# mypy: allow-untyped-defs, allow-untyped-calls, allow-untyped-decorators
"""Kernels: light with exactly one reflection at the deformed top, as an integral over the top.

At a point p of the top the receiver's corners are reflected in the tangent plane and projected through p
onto the emitter's plane; the projection clipped against the emitter is the lit area A_p, so

    flux = integral over the top of r dr dphi  (g . d) (d . n_e) cos^(m-1) / d^4  (m + 1) / (2 pi) A_p / A_e

with d from emitter to p, g = (-dh/dx, -dh/dy, 1). No ray is sampled, and a caustic is no singularity.
Cells in (u, v): v along a sector of angles that one wall spans, u with r = a + (r_wall(phi) - a) u²,
a the contact edge. Cells are halved until the mismatch between reflected direction and receiver varies by
less than `tolerance` of the receiver's angular size and the cell could carry less than `largest`; then the
midpoint counts. The clipped area is weighted at its centroid, near an emitter by three points a triangle.
Both legs are tested against the top. Radii beyond `reach` are left to the flat mirror.
"""

from __future__ import annotations

import math

import numpy as np

from sims.optics.rays import fresnel, height_and_slope, is_clear, kernel, wall_normal, wall_point
from sims.optics.surface import CONTACT_R, SKIRT_R, X, Y

STACK = 96
NEAR_SIZES = 5.0
SMALLEST_U = 2e-5
COARSE_COLUMNS = 14


@kernel
def sector_angles(press, box):
    """(4, 2) start and span of the angles whose ray from the press axis meets wall 0 to 3."""
    out = np.empty((4, 2))
    x = press[X]
    y = press[Y]
    start = math.atan2(-y, -x)
    corners = (
        start,
        math.atan2(-y, box[0] - x),
        math.atan2(box[1] - y, box[0] - x),
        math.atan2(box[1] - y, -x),
        start + 2.0 * math.pi,
    )
    for k in range(4):
        out[k, 0] = corners[k]
        out[k, 1] = corners[k + 1] - corners[k]
    return out


@kernel
def wall_reach(wall, cos_phi, sin_phi, press, box):
    """Distance from the press axis to a wall in this direction."""
    if wall == 0:
        return press[Y] / max(-sin_phi, 1e-12)
    if wall == 1:
        return (box[0] - press[X]) / max(cos_phi, 1e-12)
    if wall == 2:
        return (box[1] - press[Y]) / max(sin_phi, 1e-12)
    return press[X] / max(-cos_phi, 1e-12)


@kernel
def top_point(wall, u, v, sectors, box, press, cubic):
    """Point of the top, dh/dx, dh/dy, r, and the plan area per du dv."""
    phi = sectors[wall, 0] + v * sectors[wall, 1]
    c = math.cos(phi)
    s = math.sin(phi)
    inner = press[CONTACT_R]
    span = max(wall_reach(wall, c, s, press, box) - inner, 0.0)
    r = inner + span * u * u
    h, slope = height_and_slope(r, press, cubic)
    return press[X] + r * c, press[Y] + r * s, h, slope * c, slope * s, r, r * 2.0 * span * u * sectors[wall, 1]


@kernel
def outgoing(wall, u, v, ex, ey, ez, sectors, box, press, cubic):
    """Direction after reflection of the ray from (ex, ey, ez), cosine of incidence, 1/distance, the point."""
    px, py, pz, gx, gy, _, _ = top_point(wall, u, v, sectors, box, press, cubic)
    dx = px - ex
    dy = py - ey
    dz = pz - ez
    inverse = 1.0 / max(math.sqrt(dx * dx + dy * dy + dz * dz), 1e-9)
    dx *= inverse
    dy *= inverse
    dz *= inverse
    norm = 1.0 / math.sqrt(1.0 + gx * gx + gy * gy)
    cos_in = (-gx * dx - gy * dy + dz) * norm
    f = 2.0 * cos_in * norm
    return dx + f * gx, dy + f * gy, dz - f, cos_in, inverse, px, py, pz


@kernel
def mismatch(wall, u, v, ex, ey, ez, qx, qy, qz, sectors, box, press, cubic):
    """Reflected direction minus direction to the receiver's centre, incidence cosine, both 1/distances."""
    ox, oy, oz, cos_in, inverse, px, py, pz = outgoing(wall, u, v, ex, ey, ez, sectors, box, press, cubic)
    tx = qx - px
    ty = qy - py
    tz = qz - pz
    back = 1.0 / max(math.sqrt(tx * tx + ty * ty + tz * tz), 1e-9)
    return ox - tx * back, oy - ty * back, oz - tz * back, cos_in, inverse, back


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
def _near_weight(n, poly, area, px, py, pz, gx, gy, ex, ey, ez, source, box):
    """Mean weight over the clipped polygon, three points a triangle (exact to second order)."""
    total = 0.0
    for c in range(1, n - 1):
        ax = poly[c, 0]
        ay = poly[c, 1]
        bx = poly[c + 1, 0]
        by = poly[c + 1, 1]
        cross = (ax - poly[0, 0]) * (by - poly[0, 1]) - (ay - poly[0, 1]) * (bx - poly[0, 0])
        for k in range(3):
            wa = 2.0 / 3.0 if k == 0 else 1.0 / 6.0
            wb = 2.0 / 3.0 if k == 1 else 1.0 / 6.0
            wo = 1.0 - wa - wb
            x = wo * poly[0, 0] + wa * ax + wb * bx
            y = wo * poly[0, 1] + wa * ay + wb * by
            f, _, _, _ = _spread(x, y, px, py, pz, gx, gy, ex, ey, ez, source, box)
            total += f * cross / 6.0
    return total / area


@kernel
def pinhole(wall, u, v, source, target, sectors, reach, box, press, cubic, steepest, poly, other):
    """Flux through the top at (u, v) per du dv, and the radius."""
    px, py, pz, gx, gy, r, plan = top_point(wall, u, v, sectors, box, press, cubic)
    if r > reach:
        return 0.0, r
    ex, ey, ez = wall_point(int(source[0]), source[1], source[2], box)
    n0, n1 = wall_normal(int(source[0]))
    depth = (px - ex) * n0 + (py - ey) * n1
    if depth <= 1e-6:
        return 0.0, r
    _project(source, target, px, py, pz, gx, gy, ex, ey, ez, depth, box, poly)
    n = _clip(poly, other, source)
    if n == 0:
        return 0.0, r
    area, cx, cy = _polygon(n, poly)
    if area == 0.0:
        return 0.0, r
    f, dx, dy, dz = _spread(cx, cy, px, py, pz, gx, gy, ex, ey, ez, source, box)
    if f <= 0.0:
        return 0.0, r
    d = math.sqrt(dx * dx + dy * dy + dz * dz)
    if d < NEAR_SIZES * 2.0 * max(source[3], source[4]):
        f = _near_weight(n, poly, area, px, py, pz, gx, gy, ex, ey, ez, source, box)
    dx /= d
    dy /= d
    dz /= d
    if not is_clear(px, py, pz, -dx, -dy, -dz, d, press, cubic, steepest):
        return 0.0, r
    norm2 = 1.0 / (1.0 + gx * gx + gy * gy)
    back = 2.0 * (dz - gx * dx - gy * dy) * norm2
    dx += back * gx
    dy += back * gy
    dz -= back
    m0, m1 = wall_normal(int(target[0]))
    qx, qy, _ = wall_point(int(target[0]), target[1], target[2], box)
    approach = -(dx * m0 + dy * m1)
    if approach <= 1e-9:
        return 0.0, r
    length = ((px - qx) * m0 + (py - qy) * m1) / approach
    if length <= 0.0 or not is_clear(px, py, pz, dx, dy, dz, length, press, cubic, steepest):
        return 0.0, r
    f *= math.exp(-box[4] * length) * abs(area) / source[6] * (source[5] + 1.0) / (2.0 * math.pi)
    return f * plan, r


@kernel
def coarse_cells(rings, columns, phase_u, phase_v, sectors):
    """(cell, 5) sector, u0, u1, v0, v1: a grid whose inner edges are shifted by the phases (0..1)."""
    counts = np.empty(4, np.int64)
    for k in range(4):
        counts[k] = max(2, int(round(columns * sectors[k, 1] / (2.0 * math.pi))))
    out = np.empty(((rings + 1) * (counts.sum() + 4), 5))
    n = 0
    for k in range(4):
        for b in range(counts[k] + 1):
            v0 = max(0.0, (b - 1 + phase_v) / counts[k])
            v1 = min(1.0, (b + phase_v) / counts[k])
            for a in range(rings + 1):
                u0 = max(0.0, (a - 1 + phase_u) / rings)
                u1 = min(1.0, (a + phase_u) / rings)
                if v1 - v0 > 1e-9 and u1 - u0 > 1e-9:
                    out[n, 0] = k
                    out[n, 1] = u0
                    out[n, 2] = u1
                    out[n, 3] = v0
                    out[n, 4] = v1
                    n += 1
    return out[:n]


@kernel
def aim_cells(cells, source, sectors, reach, box, press, cubic):
    """(cell, 10) where the emitter's centre ray goes after each cell: direction, point, 1/distance, spread,
    cell size, lit (1) or facing away (0)."""
    ex, ey, ez = wall_point(int(source[0]), source[1], source[2], box)
    out = np.zeros((cells.shape[0], 10))
    for k in range(cells.shape[0]):
        wall = int(cells[k, 0])
        u0, u1, v0, v1 = cells[k, 1], cells[k, 2], cells[k, 3], cells[k, 4]
        u = 0.5 * (u0 + u1)
        v = 0.5 * (v0 + v1)
        ox, oy, oz, best, inverse, px, py, pz = outgoing(wall, u, v, ex, ey, ez, sectors, box, press, cubic)
        spread = 0.0
        size = 0.0
        for side in range(4):
            us = u0 if side == 0 else (u1 if side == 1 else u)
            vs = v0 if side == 2 else (v1 if side == 3 else v)
            ax, ay, az, cos_in, _, sx, sy, sz = outgoing(
                wall, us, vs, ex, ey, ez, sectors, box, press, cubic
            )
            best = max(best, cos_in)
            spread += math.sqrt((ax - ox) ** 2 + (ay - oy) ** 2 + (az - oz) ** 2)
            size += math.sqrt((sx - px) ** 2 + (sy - py) ** 2 + (sz - pz) ** 2)
        _, _, _, _, _, r, _ = top_point(wall, u0, v, sectors, box, press, cubic)
        out[k, 0], out[k, 1], out[k, 2] = ox, oy, oz
        out[k, 3], out[k, 4], out[k, 5] = px, py, pz
        out[k, 6], out[k, 7], out[k, 8] = inverse, spread, size
        out[k, 9] = 1.0 if best > -0.05 and r <= reach else 0.0
    return out


@kernel
def single_reflection(
    source, target, cells, aims, sectors, reach, tolerance, largest, box, press, cubic, steepest, work
):
    """Flux of a pair with one reflection: (outside the skirt radius, inside it)."""
    ex, ey, ez = wall_point(int(source[0]), source[1], source[2], box)
    qx, qy, qz = wall_point(int(target[0]), target[1], target[2], box)
    emitter_size = math.hypot(source[3], source[4])
    receiver_size = math.hypot(target[3], target[4])
    smallest_half = min(target[3], target[4])
    poly = work[:12]
    other = work[12:24]
    stack = work[24:]
    outer = 0.0
    inner = 0.0
    for k in range(cells.shape[0]):
        if aims[k, 9] == 0.0:
            continue
        tx = qx - aims[k, 3]
        ty = qy - aims[k, 4]
        tz = qz - aims[k, 5]
        back = 1.0 / max(math.sqrt(tx * tx + ty * ty + tz * tz), 1e-9)
        limit = (receiver_size + aims[k, 8]) * back + (emitter_size + 0.0) * aims[k, 6] + aims[k, 7]
        cosine = (aims[k, 0] * tx + aims[k, 1] * ty + aims[k, 2] * tz) * back
        if limit < 1.9 and cosine < 1.0 - 0.5 * limit * limit:
            continue
        wall = int(cells[k, 0])
        stack[0, 0], stack[0, 1], stack[0, 2] = cells[k, 1], cells[k, 2], cells[k, 3]
        stack[1, 0] = cells[k, 4]
        depth = 1
        while depth > 0:
            depth -= 1
            u0, u1, v0 = stack[2 * depth, 0], stack[2 * depth, 1], stack[2 * depth, 2]
            v1 = stack[2 * depth + 1, 0]
            u = 0.5 * (u0 + u1)
            v = 0.5 * (v0 + v1)
            cx, cy, cz, best, near, back = mismatch(
                wall, u, v, ex, ey, ez, qx, qy, qz, sectors, box, press, cubic
            )
            along_u = 0.0
            along_v = 0.0
            for side in range(4):
                us = u0 if side == 0 else (u1 if side == 1 else u)
                vs = v0 if side == 2 else (v1 if side == 3 else v)
                ax, ay, az, cos_in, _, _ = mismatch(
                    wall, us, vs, ex, ey, ez, qx, qy, qz, sectors, box, press, cubic
                )
                best = max(best, cos_in)
                change = math.sqrt((ax - cx) ** 2 + (ay - cy) ** 2 + (az - cz) ** 2)
                if side < 2:
                    along_u += change
                else:
                    along_v += change
            if best < -0.02:
                continue
            off = math.sqrt(cx * cx + cy * cy + cz * cz)
            if off > receiver_size * back + emitter_size * near + 0.75 * (along_u + along_v):
                continue
            _, _, _, _, _, r, plan = top_point(wall, u, v, sectors, box, press, cubic)
            area = (u1 - u0) * (v1 - v0)
            power = area * plan * max(best, 0.02) * near * near / math.pi
            allowed = tolerance * 2.0 * smallest_half * back
            change = max(along_u, along_v)
            too_coarse = change > allowed or (power > largest and change > 0.03 * allowed)
            if too_coarse and 2 * depth + 4 < stack.shape[0] and u1 - u0 > SMALLEST_U:
                for half in range(2):
                    at = 2 * (depth + half)
                    if along_u > along_v:
                        stack[at, 0] = u0 if half == 0 else u
                        stack[at, 1] = u if half == 0 else u1
                        stack[at, 2], stack[at + 1, 0] = v0, v1
                    else:
                        stack[at, 0], stack[at, 1] = u0, u1
                        stack[at, 2] = v0 if half == 0 else v
                        stack[at + 1, 0] = v if half == 0 else v1
                depth += 2
                continue
            flux, r = pinhole(
                wall, u, v, source, target, sectors, reach, box, press, cubic, steepest, poly, other
            )
            if r < press[SKIRT_R]:
                inner += flux * area
            else:
                outer += flux * area
    return outer, inner
