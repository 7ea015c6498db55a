# mypy: allow-untyped-defs, allow-untyped-calls, allow-untyped-decorators
"""Kernels: light mirrored by the gently curved part of the top, path by path.

Where the top bends little, exactly one reflected path joins emitter point e and receiver point q. Its
reflection point p = (x, y, h) makes the length F = |p - e| + |q - p| stationary (Fermat); Newton steps find
it. Hamilton's characteristic function gives the flux without a caustic-prone divergence of rays:

    d flux = radiance |det d²F/de dq| dA_e dA_q,   det = det(F_ep) det(F_pq) / det(F_pp),

summed by Gauss nodes on both patches. A pair is taken here only if all its paths, corners included, exist,
are clear, and reflect outside `calm_radius`: there the curvature is at most half of what would let two
paths meet. All else is left to `skirt`.
"""

from __future__ import annotations

import math

from sims.optics.rays import fresnel, height_slope_bend, is_clear, kernel, wall_normal, wall_point
from sims.optics.surface import CELLS, GRADING, OUTER_R, SKIRT_R, SPHERE_R, TOP, X, Y

NEWTON_STEPS = 12
CONVERGED_MM = 1e-9


@kernel
def calm_radius(source, target, share, box, press, bends):
    """Radius beyond which the top bends less than `share` of what folds the pair's mirror image."""
    ex, ey, _ = wall_point(int(source[0]), source[1], 0.0, box)
    qx, qy, _ = wall_point(int(target[0]), target[1], 0.0, box)
    drop = 2.0 * press[TOP] - source[2] - source[4] - target[2] - target[4]
    length = math.sqrt((ex - qx) ** 2 + (ey - qy) ** 2 + 4.0 * box[2] * box[2])
    allowed = share * 2.0 * max(drop, 0.0) / (length * length)
    for k in range(CELLS - 1, -1, -1):
        if bends[k] > allowed:
            x = (k + 1.0) / CELLS
            r = press[SPHERE_R] + (press[OUTER_R] - press[SPHERE_R]) * x * (GRADING + (1.0 - GRADING) * x)
            return max(r, press[SKIRT_R])
    return press[SKIRT_R]


@kernel
def mirrored_path(ex, ey, ez, qx, qy, qz, source, target, calm, box, press, cubic, steepest):
    """Flux per emitter and receiver area of the one mirrored path; -1 if it is not calm and clear."""
    share = (press[TOP] - ez) / max(2.0 * press[TOP] - ez - qz, 1e-9)
    x = ex + share * (qx - ex)
    y = ey + share * (qy - ey)
    for step in range(NEWTON_STEPS + 1):
        rx = x - press[X]
        ry = y - press[Y]
        r = math.sqrt(rx * rx + ry * ry)
        if r <= calm:
            return -1.0
        h, slope, bend = height_slope_bend(r, press, cubic)
        c = rx / r
        s = ry / r
        gx = slope * c
        gy = slope * s
        around = slope / r
        hxx = bend * c * c + around * s * s
        hyy = bend * s * s + around * c * c
        hxy = (bend - around) * c * s
        ax, ay, az = x - ex, y - ey, h - ez
        bx, by, bz = x - qx, y - qy, h - qz
        d1 = math.sqrt(ax * ax + ay * ay + az * az)
        d2 = math.sqrt(bx * bx + by * by + bz * bz)
        ax /= d1
        ay /= d1
        az /= d1
        bx /= d2
        by /= d2
        bz /= d2
        ap = ax + az * gx
        aq = ay + az * gy
        bp = bx + bz * gx
        bq = by + bz * gy
        fxx = (1.0 + gx * gx - ap * ap) / d1 + (1.0 + gx * gx - bp * bp) / d2 + (az + bz) * hxx
        fyy = (1.0 + gy * gy - aq * aq) / d1 + (1.0 + gy * gy - bq * bq) / d2 + (az + bz) * hyy
        fxy = (gx * gy - ap * aq) / d1 + (gx * gy - bp * bq) / d2 + (az + bz) * hxy
        det = fxx * fyy - fxy * fxy
        if det <= 0.0:
            return -1.0
        dx = (fyy * (ap + bp) - fxy * (aq + bq)) / det
        dy = (fxx * (aq + bq) - fxy * (ap + bp)) / det
        if dx * dx + dy * dy < CONVERGED_MM * CONVERGED_MM:
            break
        if step == NEWTON_STEPS:
            return -1.0
        x -= dx
        y -= dy
    if not (0.0 < x < box[0] and 0.0 < y < box[1]):
        return -1.0
    n0, n1 = wall_normal(int(source[0]))
    m0, m1 = wall_normal(int(target[0]))
    out = ax * n0 + ay * n1
    into = bx * m0 + by * m1
    cos_in = (az - gx * ax - gy * ay) / math.sqrt(1.0 + gx * gx + gy * gy)
    if out <= 0.0 or into <= 0.0 or cos_in <= 0.0:
        return 0.0
    if not is_clear(x, y, h, -ax, -ay, -az, d1, press, cubic, steepest):
        return -1.0
    if not is_clear(x, y, h, -bx, -by, -bz, d2, press, cubic, steepest):
        return -1.0
    pair = _mixed(int(source[0]), ax, ay, az, ap, aq, gx, gy, d1)
    pair *= _mixed(int(target[0]), bx, by, bz, bp, bq, gx, gy, d2)
    flux = abs(pair) / det * fresnel(cos_in, box[3]) * math.exp(-box[4] * (d1 + d2))
    if source[5] != 1.0:
        flux *= out ** (source[5] - 1.0)
    return flux * (source[5] + 1.0) / (2.0 * math.pi)


@kernel
def _mixed(wall, ax, ay, az, ap, aq, gx, gy, d):
    """Determinant of the mixed derivatives of a leg's length: end on a wall (along, up), end on the top."""
    along = ax if wall % 2 == 0 else ay
    tx = (1.0 if wall % 2 == 0 else 0.0) - along * ap
    ty = (0.0 if wall % 2 == 0 else 1.0) - along * aq
    return (tx * (gy - az * aq) - ty * (gx - az * ap)) / (d * d)


@kernel
def calm_mirror(source, target, calm, box, press, cubic, steepest, nodes_e, weights_e, nodes_q, weights_q):
    """Mirrored flux of a pair whose paths all reflect beyond `calm` unhindered; -1 if any does not."""
    total = 0.0
    for corners in range(2):
        ne = 2 if corners == 0 else nodes_e.shape[0]
        nq = 2 if corners == 0 else nodes_q.shape[0]
        for a in range(ne):
            for b in range(ne):
                sa = float(a) if corners == 0 else nodes_e[a]
                sb = float(b) if corners == 0 else nodes_e[b]
                ex, ey, ez = wall_point(
                    int(source[0]),
                    source[1] + source[3] * (2.0 * sa - 1.0),
                    source[2] + source[4] * (2.0 * sb - 1.0),
                    box,
                )
                for c in range(nq):
                    for d in range(nq):
                        ta = float(c) if corners == 0 else nodes_q[c]
                        tb = float(d) if corners == 0 else nodes_q[d]
                        qx, qy, qz = wall_point(
                            int(target[0]),
                            target[1] + target[3] * (2.0 * ta - 1.0),
                            target[2] + target[4] * (2.0 * tb - 1.0),
                            box,
                        )
                        flux = mirrored_path(
                            ex, ey, ez, qx, qy, qz, source, target, calm, box, press, cubic, steepest
                        )
                        if flux < 0.0:
                            return -1.0
                        if corners == 1:
                            total += weights_e[a] * weights_e[b] * weights_q[c] * weights_q[d] * flux
    return total * 16.0 * source[3] * source[4] * target[3] * target[4] / source[6]
