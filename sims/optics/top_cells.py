# mypy: allow-untyped-defs, allow-untyped-calls, allow-untyped-decorators
"""Kernels: the top around a press in cells of (u, v).

v runs along a wall, which spans a sector of angles; u from the contact edge (0) to that wall (1) with
r = a + (r_wall(v) - a) u², so that cells are narrow at the contact edge.
"""

from __future__ import annotations

import math

import numpy as np

from sims.optics.rays import height_and_slope, kernel
from sims.optics.surface import CONTACT_R, X, Y


@kernel
def sectors_of(press, box):
    """(4, 5) per wall: corner where it starts and vector to its end, both from the press axis; its span."""
    out = np.empty((4, 5))
    x = press[X]
    y = press[Y]
    corners = ((-x, -y), (box[0] - x, -y), (box[0] - x, box[1] - y), (-x, box[1] - y), (-x, -y))
    for k in range(4):
        ax, ay = corners[k]
        bx, by = corners[k + 1]
        out[k, 0] = ax
        out[k, 1] = ay
        out[k, 2] = bx - ax
        out[k, 3] = by - ay
        out[k, 4] = math.atan2(ax * by - ay * bx, ax * bx + ay * by)
    return out


@kernel
def top_point(wall, u, v, sectors, press, cubic):
    """Point of the top, dh/dx, dh/dy, r, and the plan area per du dv."""
    wx = sectors[wall, 0] + v * sectors[wall, 2]
    wy = sectors[wall, 1] + v * sectors[wall, 3]
    reach2 = wx * wx + wy * wy
    reach = math.sqrt(reach2)
    c = wx / reach
    s = wy / reach
    turn = (wx * sectors[wall, 3] - wy * sectors[wall, 2]) / reach2
    inner = press[CONTACT_R]
    span = max(reach - inner, 0.0)
    r = inner + span * u * u
    h, slope = height_and_slope(r, press, cubic)
    return press[X] + r * c, press[Y] + r * s, h, slope * c, slope * s, r, r * 2.0 * span * u * turn


@kernel
def outgoing(wall, u, v, ex, ey, ez, sectors, press, cubic):
    """Direction after reflection of the ray from (ex, ey, ez), cosine of incidence, 1/distance, the point."""
    px, py, pz, gx, gy, _, _ = top_point(wall, u, v, sectors, press, cubic)
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
def coarse_cells(rings, columns, phase_u, phase_v, sectors):
    """(cell, 5) sector, u0, u1, v0, v1: a grid whose inner edges are shifted by the phases (0..1)."""
    counts = np.empty(4, np.int64)
    for k in range(4):
        counts[k] = max(2, round(columns * sectors[k, 4] / (2.0 * math.pi)))
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
