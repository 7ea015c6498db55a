# mypy: allow-untyped-defs, allow-untyped-calls, allow-untyped-decorators
"""Kernels: where a receiver appears, seen from an emitter through one reflection at the top."""

from __future__ import annotations

import math

import numpy as np

from sims.optics.rays import kernel, wall_normal, wall_point
from sims.optics.top_cells import outgoing, top_point


@kernel
def aim_offset(wall, u, v, source, ex, ey, ez, qx, qy, qz, sectors, press, cubic):
    """Where the receiver's centre, seen from the emitter's plane through the top at (u, v), appears.

    Returns the offset from the emitter's centre (along, up), the cosine of the reflected view against the
    emitter's axis times its length (not above 0: behind), incidence, distance to the emitter's plane,
    dh/dx, dh/dy, r and plan area per du dv.
    """
    px, py, pz, gx, gy, r, plan = top_point(wall, u, v, sectors, press, cubic)
    n0, n1 = wall_normal(int(source[0]))
    on_x = int(source[0]) % 2 == 0
    depth = (px - ex) * n0 + (py - ey) * n1
    tx = qx - px
    ty = qy - py
    tz = qz - pz
    facing = gx * tx + gy * ty - tz
    back = 2.0 * facing / (1.0 + gx * gx + gy * gy)
    tx -= back * gx
    ty -= back * gy
    tz += back
    w = tx * n0 + ty * n1
    m = depth / w if w > 1e-9 else 0.0
    along = (px - ex if on_x else py - ey) - m * (tx if on_x else ty)
    return along, pz - ez - m * tz, w, facing, depth, gx, gy, r, plan


@kernel
def image_box(target, source, gx, gy, depth, w, along, up):
    """Half sizes of the receiver's image around its centre's; -1 where part of it is behind.

    (along, up, w) is the reflected view vector from the top to the receiver's centre.
    """
    n0, n1 = wall_normal(int(source[0]))
    on_x = int(source[0]) % 2 == 0
    norm2 = 1.0 + gx * gx + gy * gy
    ux = 1.0 if int(target[0]) % 2 == 0 else 0.0
    back = 2.0 * (gx * ux + gy * (1.0 - ux)) / norm2
    ax = ux - back * gx
    ay = 1.0 - ux - back * gy
    across_t = target[3] * (ax if on_x else ay)
    across_w = target[3] * (ax * n0 + ay * n1)
    across_z = target[3] * back
    back = 2.0 / norm2
    ax = back * gx
    ay = back * gy
    rise_t = target[4] * (ax if on_x else ay)
    rise_w = target[4] * (ax * n0 + ay * n1)
    rise_z = target[4] * (1.0 - back)
    if w - abs(across_w) - abs(rise_w) < 0.1 * w:
        return -1.0, -1.0
    half = 0.0
    tall = 0.0
    for c in range(4):
        i = -1.0 if c % 2 == 0 else 1.0
        j = -1.0 if c < 2 else 1.0
        wc = w + i * across_w + j * rise_w
        half = max(half, abs(depth * ((along + i * across_t + j * rise_t) / wc - along / w)))
        tall = max(tall, abs(depth * ((up + i * across_z + j * rise_z) / wc - up / w)))
    return half, tall


@kernel
def angular_change(wall, u0, u, u1, v0, v, v1, ex, ey, ez, qx, qy, qz, sectors, press, cubic):
    """Angle between reflected ray and receiver at the cell's centre, and how it changes along u and v."""
    cx, cy, cz, along_u, along_v = 0.0, 0.0, 0.0, 0.0, 0.0
    for side in range(5):
        us = u0 if side == 1 else (u1 if side == 2 else u)
        vs = v0 if side == 3 else (v1 if side == 4 else v)
        ax, ay, az, _, _, px, py, pz = outgoing(wall, us, vs, ex, ey, ez, sectors, press, cubic)
        tx = qx - px
        ty = qy - py
        tz = qz - pz
        back = 1.0 / max(math.sqrt(tx * tx + ty * ty + tz * tz), 1e-9)
        ax -= tx * back
        ay -= ty * back
        az -= tz * back
        if side == 0:
            cx, cy, cz = ax, ay, az
        change = math.sqrt((ax - cx) ** 2 + (ay - cy) ** 2 + (az - cz) ** 2)
        if side == 1 or side == 2:
            along_u += change
        else:
            along_v += change
    return math.sqrt(cx * cx + cy * cy + cz * cz), along_u, along_v


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
        ox, oy, oz, best, inverse, px, py, pz = outgoing(wall, u, v, ex, ey, ez, sectors, press, cubic)
        spread = 0.0
        size = 0.0
        for side in range(4):
            us = u0 if side == 0 else (u1 if side == 1 else u)
            vs = v0 if side == 2 else (v1 if side == 3 else v)
            ax, ay, az, cos_in, _, sx, sy, sz = outgoing(wall, us, vs, ex, ey, ez, sectors, press, cubic)
            best = max(best, cos_in)
            spread += math.sqrt((ax - ox) ** 2 + (ay - oy) ** 2 + (az - oz) ** 2)
            size += math.sqrt((sx - px) ** 2 + (sy - py) ** 2 + (sz - pz) ** 2)
        _, _, _, _, _, r, _ = top_point(wall, u0, v, sectors, press, cubic)
        out[k, 0], out[k, 1], out[k, 2] = ox, oy, oz
        out[k, 3], out[k, 4], out[k, 5] = px, py, pz
        out[k, 6], out[k, 7], out[k, 8] = inverse, spread, size
        out[k, 9] = 1.0 if best > -0.05 and r <= reach else 0.0
    return out
