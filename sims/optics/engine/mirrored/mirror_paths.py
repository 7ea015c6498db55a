"""Kernels: one image of a pair in the top, path by path.

Where exactly one mirror path joins each emitter point e and receiver point q, Newton steps find its point p
and Hamilton's characteristic function F = |p - e| + |q - p| gives the flux without a divergence of rays:

    d flux = radiance |det d²F/de dq| dA_e dA_q,   det = det(F_ep) det(F_pq) / det(F_pp).
"""

from __future__ import annotations

import math

from design.arrays import FloatArray, IntArray
from sims.optics.engine.straight.rays import is_clear
from sims.optics.kernel_types import ImageRules
from sims.optics.surface.radial import fresnel, kernel, radiance, wall_normal, wall_point
from sims.optics.surface.top import Top, surface_bend, surface_gradient, touching_tip
from sims.optics.surface.top_grid import cell_at

NEWTON_STEPS = 8
CONVERGED_MM = 1e-5
"""Newton's steps shrink quadratically: the error after the last is far below this."""
LONGEST_STEP_MM = 6.0
FEW_RATIO = 3.0
WHOLE_TOLERANCE = 0.01
"""Largest over smallest flux density of an image's corner paths that the coarse rule takes; share by which Simpson's
rule, corners and middle, may differ from it: a jump of the top's curvature within an image shows there."""
TABLE_TOLERANCE = 3e-4
"""Share by which the two rules may differ for patches with angular tables: where one bends sharply within an image, or
has a step, no rule of few paths is right, by up to 1.3 % of a pair's light."""


@kernel
def mirror_point(
    ex: float, ey: float, ez: float, qx: float, qy: float, qz: float, x: float, y: float, sign: float,
    box: FloatArray, top: Top,
) -> tuple[bool, float, float, float]:  # fmt: skip
    """Newton steps to the path's point: (found, x, y, det F_pp)."""
    for _ in range(NEWTON_STEPS):
        tip, _ = touching_tip(x, y, top)
        if tip >= 0 or not (0.0 < x < box[0] and 0.0 < y < box[1]):
            return False, x, y, 0.0
        h, gx, gy, hxx, hxy, hyy = surface_bend(x, y, top)
        ax, ay, az = x - ex, y - ey, h - ez
        bx, by, bz = x - qx, y - qy, h - qz
        d1 = 1.0 / math.sqrt(ax * ax + ay * ay + az * az)
        d2 = 1.0 / math.sqrt(bx * bx + by * by + bz * bz)
        ax *= d1
        ay *= d1
        az *= d1
        bx *= d2
        by *= d2
        bz *= d2
        ap = ax + az * gx
        aq = ay + az * gy
        bp = bx + bz * gx
        bq = by + bz * gy
        both = d1 + d2
        fxx = (1.0 + gx * gx) * both - ap * ap * d1 - bp * bp * d2 + (az + bz) * hxx
        fyy = (1.0 + gy * gy) * both - aq * aq * d1 - bq * bq * d2 + (az + bz) * hyy
        fxy = gx * gy * both - ap * aq * d1 - bp * bq * d2 + (az + bz) * hxy
        det = fxx * fyy - fxy * fxy
        if det * sign <= 0.0:
            return False, x, y, 0.0
        dx = (fyy * (ap + bp) - fxy * (aq + bq)) / det
        dy = (fxx * (aq + bq) - fxy * (ap + bp)) / det
        step2 = dx * dx + dy * dy
        if step2 > LONGEST_STEP_MM * LONGEST_STEP_MM:
            return False, x, y, 0.0
        x -= dx
        y -= dy
        if step2 < CONVERGED_MM * CONVERGED_MM:
            return True, x, y, det
    return False, x, y, 0.0


@kernel
def _mixed_bend(
    wall: int, ax: float, ay: float, az: float, ap: float, aq: float, gx: float, gy: float, d: float
) -> float:
    """Determinant of the mixed derivatives of a leg's length: end on a wall (along, up), end on the top."""
    along = ax if wall % 2 == 0 else ay
    tx = (1.0 if wall % 2 == 0 else 0.0) - along * ap
    ty = (0.0 if wall % 2 == 0 else 1.0) - along * aq
    return (tx * (gy - az * aq) - ty * (gx - az * ap)) * d * d


@kernel
def path_flux(
    ex: float, ey: float, ez: float, qx: float, qy: float, qz: float, x: float, y: float, det: float,
    source: FloatArray, target: FloatArray, box: FloatArray, top: Top,
) -> float:  # fmt: skip
    """Flux per emitter and receiver area of the path over (x, y); -1 if a leg is hidden."""
    h, gx, gy = surface_gradient(x, y, top)
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
    n0, n1 = wall_normal(int(source[0]))
    m0, m1 = wall_normal(int(target[0]))
    out = ax * n0 + ay * n1
    into = bx * m0 + by * m1
    cos_in = (az - gx * ax - gy * ay) / math.sqrt(1.0 + gx * gx + gy * gy)
    if cos_in <= 0.0:
        return -1.0
    if not is_clear(x, y, h, -ax, -ay, -az, d1, top):
        return -1.0
    if not is_clear(x, y, h, -bx, -by, -bz, d2, top):
        return -1.0
    ap = ax + az * gx
    aq = ay + az * gy
    bp = bx + bz * gx
    bq = by + bz * gy
    pair = _mixed_bend(int(source[0]), ax, ay, az, ap, aq, gx, gy, 1.0 / d1)
    pair *= _mixed_bend(int(target[0]), bx, by, bz, bp, bq, gx, gy, 1.0 / d2)
    flux = abs(pair / det) * fresnel(cos_in, box[3])
    if box[4] > 0.0:
        flux *= math.exp(-box[4] * (d1 + d2))
    return flux * math.pi * radiance(source, out) * radiance(target, into)


@kernel
def _patch_point(patch: FloatArray, a: float, b: float, box: FloatArray) -> tuple[float, float, float]:
    """Point of a patch at fractions of its width and height."""
    return wall_point(
        int(patch[0]), patch[1] + patch[3] * (2.0 * a - 1.0), patch[2] + patch[4] * (2.0 * b - 1.0), box
    )


@kernel
def corner_paths(
    source: FloatArray, target: FloatArray, cx: float, cy: float, sign: float, number: int, tag: IntArray, rings: int,
    phase: float, columns: FloatArray, sectors: FloatArray, box: FloatArray, top: Top,
) -> tuple[float, float]:  # fmt: skip
    """Largest over smallest, and mean, flux density of the 16 paths between corners; -1 unless each exists, is clear,
    and reflects in or beside the image's own island.
    """
    low = 1e30
    high = 0.0
    total = 0.0
    for k in range(16):
        ex, ey, ez = _patch_point(source, float(k & 1), float((k >> 1) & 1), box)
        qx, qy, qz = _patch_point(target, float((k >> 2) & 1), float((k >> 3) & 1), box)
        found, x, y, det = mirror_point(ex, ey, ez, qx, qy, qz, cx, cy, sign, box, top)
        if not found:
            return -1.0, 0.0
        ring, column = cell_at(x, y, rings, phase, columns, sectors, top)
        if ring < 0:
            return -1.0, 0.0
        inside = False
        for near in range(3):
            c = column if near == 0 else int(columns[column, 2 + near])
            for a in range(max(ring - 1, 0), min(ring + 2, rings)):
                inside = inside or tag[a, c] == number
        if not inside:
            return -1.0, 0.0
        flux = path_flux(ex, ey, ez, qx, qy, qz, x, y, det, source, target, box, top)
        if flux <= 0.0:
            return -1.0, 0.0
        low = min(low, flux)
        high = max(high, flux)
        total += flux
    return high / low, total / 16.0


@kernel
def image_sum(
    source: FloatArray, target: FloatArray, cx: float, cy: float, sign: float, box: FloatArray, top: Top,
    nodes_e: FloatArray, weights_e: FloatArray, nodes_q: FloatArray, weights_q: FloatArray,
) -> float:  # fmt: skip
    """Mean flux density of an image by Gauss nodes on both patches; -1 if a path is not found or not clear."""
    total = 0.0
    for a in range(nodes_e.shape[0]):
        for b in range(nodes_e.shape[0]):
            ex, ey, ez = _patch_point(source, nodes_e[a], nodes_e[b], box)
            x = cx
            y = cy
            for c in range(nodes_q.shape[0]):
                for n in range(nodes_q.shape[0]):
                    d = n if c % 2 == 0 else nodes_q.shape[0] - 1 - n
                    qx, qy, qz = _patch_point(target, nodes_q[c], nodes_q[d], box)
                    found, x, y, det = mirror_point(ex, ey, ez, qx, qy, qz, x, y, sign, box, top)
                    if not found:
                        return -1.0
                    flux = path_flux(ex, ey, ez, qx, qy, qz, x, y, det, source, target, box, top)
                    if flux < 0.0:
                        return -1.0
                    total += weights_e[a] * weights_e[b] * weights_q[c] * weights_q[d] * flux
    return total


@kernel
def whole_image(
    source: FloatArray, target: FloatArray, x: float, y: float, sign: float, number: int, tag: IntArray, rings: int,
    phase: float, columns: FloatArray, sectors: FloatArray, box: FloatArray, top: Top, rules: ImageRules,
    whole_ratio: float,
) -> tuple[float, float, float]:  # fmt: skip
    """Flux of the image that begins near (x, y), and its centre; -1 unless it is whole and simple."""
    few_e, few_we, few_q, few_wq, most_e, most_we, most_q, most_wq = rules
    ex, ey, ez = wall_point(int(source[0]), source[1], source[2], box)
    qx, qy, qz = wall_point(int(target[0]), target[1], target[2], box)
    found, cx, cy, det = mirror_point(ex, ey, ez, qx, qy, qz, x, y, sign, box, top)
    if not found:
        return -1.0, x, y
    mean = 0.0
    ratio, corners = corner_paths(
        source, target, cx, cy, sign, number, tag, rings, phase, columns, sectors, box, top
    )
    if ratio < 0.0 or ratio > whole_ratio:
        return -1.0, cx, cy
    by_table = source[5] < 0.0 or target[5] < 0.0
    if ratio < FEW_RATIO or by_table:
        mean = image_sum(source, target, cx, cy, sign, box, top, few_e, few_we, few_q, few_wq)
    if ratio >= FEW_RATIO or by_table:
        few = mean
        mean = image_sum(source, target, cx, cy, sign, box, top, most_e, most_we, most_q, most_wq)
        if by_table and abs(few - mean) > TABLE_TOLERANCE * mean:
            return -1.0, cx, cy
    middle = path_flux(ex, ey, ez, qx, qy, qz, cx, cy, det, source, target, box, top)
    if mean < 0.0 or abs((corners + 2.0 * middle) / 3.0 - mean) > WHOLE_TOLERANCE * mean:
        return -1.0, cx, cy
    return mean * 16.0 * source[3] * source[4] * target[3] * target[4] / source[6], cx, cy
