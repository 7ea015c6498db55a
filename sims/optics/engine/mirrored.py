# mypy: no-warn-return-any
"""Kernels: flux of a pair that the top mirrors once, computed either per point of the top or path by path.

Per point of the top
--------------------
At a point p of the top the receiver's corners are reflected in the tangent plane and projected through p onto the
emitter's plane. The projection, clipped to the emitter, is the lit area A_p, so

    flux = integral over the top of r dr dphi  (g . d) (d . n_e) L / d^4  A_p / A_e  response

with d the vector from emitter to p, g = (-dh/dx, -dh/dy, 1), and L the emitter's radiance. No rays are sampled, and a
caustic causes no singularity. The lit area is weighted at three points in each of its triangles, because near the
critical angle the mirrored share changes too fast for its centroid alone. As angular tables may bend within the lit
area, triangles are divided if this rule and a rule with only their centroids differ.

Shadows: the straight line from p down to a patch is free if it falls faster than the top can. Otherwise it is tested at
the centroid and the corners of the lit area, and at every point of the triangles if these results differ.

Path by path
------------
If exactly one mirror path joins each emitter point e and receiver point q, Newton steps find the point p where it is
mirrored. Hamilton's characteristic function F = |p - e| + |q - p| gives the flux without a divergence of rays:

    d flux = radiance |det d²F/de dq| dA_e dA_q,   det = det(F_ep) det(F_pq) / det(F_pp).

Here a patch is the face of an emitter (`source`) or receiver (`target`).
"""

from __future__ import annotations

import math

from optopad.design.arrays import FloatArray, IntArray
from optopad.sims.optics.engine.straight import (
    area_and_centroid,
    cut,
    cut_to_rectangle,
    is_clear,
    plan_distance,
)
from optopad.sims.optics.kernel_types import ImageRules
from optopad.sims.optics.surface.curves import ACTIVE, TOP, X, Y
from optopad.sims.optics.surface.radial import (
    distance,
    fall_bound,
    fresnel,
    kernel,
    radiance,
    reach2,
    slope_bound,
    wall_normal,
    wall_point,
)
from optopad.sims.optics.surface.tops import (
    BLOCK_X,
    BLOCK_Y,
    FIELD_SLOPE,
    Top,
    block_bounds,
    cell_at,
    is_beyond,
    surface_bend,
    surface_gradient,
    top_point,
    touch,
)

INWARD = 0.97
UNEVEN, PARTS = 0.01, 4
"""Relative difference of the two rules above which triangles are divided; number of pieces per side."""


@kernel
def _project(
    source: FloatArray, target: FloatArray, px: float, py: float, pz: float, gx: float, gy: float, ex: float,
    ey: float, ez: float, depth: float, box: FloatArray, poly: FloatArray,
) -> int:  # fmt: skip
    """Reflect the receiver's corners at p and project them onto the emitter's plane, in homogeneous coordinates.

    Returns the number of corners in `poly`.
    """
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
    return 4


@kernel
def _counted(
    dx: float, dy: float, dz: float, px: float, py: float, gx: float, gy: float, target: FloatArray, box: FloatArray,
) -> float:  # fmt: skip
    """Share of the light along d, mirrored at p, that is not absorbed and is counted by the receiver, over pi."""
    d = 1.0 / math.sqrt(dx * dx + dy * dy + dz * dz)
    back = 2.0 * (dz - gx * dx - gy * dy) * d / (1.0 + gx * gx + gy * gy)
    dx = dx * d + back * gx
    dy = dy * d + back * gy
    m0, m1 = wall_normal(int(target[0]))
    qx, qy, _ = wall_point(int(target[0]), target[1], target[2], box)
    facing = -(dx * m0 + dy * m1)
    length = ((px - qx) * m0 + (py - qy) * m1) / max(facing, 1e-9)
    return math.exp(-box[4] * length) * radiance(target, facing)


@kernel
def _emission(
    a: float, b: float, px: float, py: float, pz: float, gx: float, gy: float, ex: float, ey: float, ez: float,
    source: FloatArray, target: FloatArray, box: FloatArray,
) -> tuple[float, float, float, float, float, float]:  # fmt: skip
    """Weight and direction of the light to p from the emitter's point at offset (a, b).

    The result is the weight, the component of the vector to p into the top, its length, and the vector itself. The
    weight covers emission and absorption (0 if point and p do not face each other); `_counted` is included unless the
    receiver counts all directions equally.
    """
    n0, n1 = wall_normal(int(source[0]))
    on_x = int(source[0]) % 2 == 0
    dx = px - ex - (a if on_x else 0.0)
    dy = py - ey - (0.0 if on_x else a)
    dz = pz - ez - b
    into = -gx * dx - gy * dy + dz
    out = dx * n0 + dy * n1
    d2 = dx * dx + dy * dy + dz * dz
    d = math.sqrt(d2)
    if into <= 0.0 or out <= 0.0:
        return 0.0, into, d, dx, dy, dz
    f = out * into / (d2 * d2)
    f *= radiance(source, out / d)
    if box[4] > 0.0:
        f *= math.exp(-box[4] * d)
    if target[5] != 1.0:
        f *= _counted(dx, dy, dz, px, py, gx, gy, target, box)
    return f, into, d, dx, dy, dz


@kernel
def _spread(
    a: float, b: float, px: float, py: float, pz: float, gx: float, gy: float, ex: float, ey: float, ez: float,
    source: FloatArray, target: FloatArray, box: FloatArray,
) -> float:  # fmt: skip
    """Weight from `_emission` times the share that the top mirrors."""
    f, into, d, _, _, _ = _emission(a, b, px, py, pz, gx, gy, ex, ey, ez, source, target, box)
    if f == 0.0:
        return 0.0
    return f * fresnel(into / (d * math.sqrt(1.0 + gx * gx + gy * gy)), box[3])


FEWEST_PARTS = 4
"""Least number of parts in which lines to an emitter or receiver are followed."""


@kernel
def _may_be_shaded(px: float, py: float, pz: float, patch: FloatArray, box: FloatArray, top: Top) -> bool:
    """Whether the line from the top down to a patch may meet the top again, as it does not fall steeply enough."""
    x0, y0, z = wall_point(int(patch[0]), patch[1] - patch[3], patch[2] + patch[4], box)
    x1, y1, _ = wall_point(int(patch[0]), patch[1] + patch[3], patch[2] + patch[4], box)
    run = max(plan_distance(x0, y0, x0, y0, px, py), plan_distance(x1, y1, x1, y1, px, py))
    row = top.row
    slope = row[FIELD_SLOPE]
    rx = px - row[X]
    ry = py - row[Y]
    if row[ACTIVE] == 0.0:
        pass
    elif rx * (x0 - px) + ry * (y0 - py) >= 0.0 and rx * (x1 - px) + ry * (y1 - py) >= 0.0:
        slope += fall_bound(rx * rx + ry * ry, row)
    else:
        one = (x0 - px) * ry - (y0 - py) * rx
        two = (x1 - px) * ry - (y1 - py) * rx
        near = 0.0
        if one * two > 0.0:
            near = min(
                plan_distance(px, py, x0, y0, row[X], row[Y]), plan_distance(px, py, x1, y1, row[X], row[Y])
            )
        slope += slope_bound(near * near, row)
    return pz - z < slope * run and not _is_above(px, py, pz, x0, y0, x1, y1, z, top)


@kernel
def _is_above(
    px: float, py: float, pz: float, x0: float, y0: float, x1: float, y1: float, z: float, top: Top,
) -> bool:  # fmt: skip
    """Whether the top is nowhere below the lines from its point p down to an edge from (x0, y0) to (x1, y1) at z.

    The lines are followed in parts of equal shares. In a part the top stays above them if its lowest point there is
    above their highest, or if it falls less steeply than they do. False means that neither bound shows it.
    """
    row = top.row
    fall = pz - z
    qx = 0.5 * (x0 + x1) - px
    qy = 0.5 * (y0 + y1) - py
    half = 0.5 * distance(x1 - x0, y1 - y0)
    length = distance(qx, qy)
    width = min(1.0 / max(row[BLOCK_X], 1e-9), 1.0 / max(row[BLOCK_Y], 1e-9))
    if fall <= 0.0 or half >= 0.8 * width:
        return False
    run = length + half
    parts = max(math.ceil(length / (2.0 * (width - half))), FEWEST_PARTS)
    ax = px - row[X]
    ay = py - row[Y]
    nearest = -(ax * qx + ay * qy) / max(length * length, 1e-30)
    toward = min(ax * (x0 - px) + ay * (y0 - py), ax * (x1 - px) + ay * (y1 - py))
    least2 = plan_distance(x0, y0, x1, y1, px, py) ** 2
    for k in range(parts):
        one = k / parts
        two = (k + 1) / parts
        low, steep = block_bounds(px + 0.5 * (one + two) * qx, py + 0.5 * (one + two) * qy, top)
        s = min(max(nearest, one), two)
        near = max(distance(ax + s * qx, ay + s * qy) - two * half, 0.0)
        near2 = near * near
        level = pz - one * fall - low
        if level < row[TOP] and reach2(level, row) <= near2:
            continue
        start = max(distance(ax + one * qx, ay + one * qy) - one * half, 1e-9)
        inward = min(max(-(toward + one * least2) / start, 0.0), run)
        if (steep + fall_bound(near2, row)) * run + slope_bound(near2, row) * inward > fall:
            return False
    return True


@kernel
def _sees(
    a: float, b: float, dim_e: bool, dim_q: bool, px: float, py: float, pz: float, gx: float, gy: float, ex: float,
    ey: float, ez: float, source: FloatArray, target: FloatArray, box: FloatArray, top: Top,
) -> bool:  # fmt: skip
    """Whether light from the emitter's point at offset (a, b) reaches p and then the receiver's plane.

    dim_e, dim_q : whether the lines to emitter and receiver may be shaded; a line that may not be is not tested
    """
    on_x = int(source[0]) % 2 == 0
    dx = px - ex - (a if on_x else 0.0)
    dy = py - ey - (0.0 if on_x else a)
    dz = pz - ez - b
    into = dz - gx * dx - gy * dy
    if into <= 0.0:
        return False
    d = math.sqrt(dx * dx + dy * dy + dz * dz)
    dx /= d
    dy /= d
    dz /= d
    if dim_e and not is_clear(px, py, pz, -dx, -dy, -dz, d, top):
        return False
    if not dim_q:
        return True
    back = 2.0 * into / d / (1.0 + gx * gx + gy * gy)
    dx += back * gx
    dy += back * gy
    dz -= back
    m0, m1 = wall_normal(int(target[0]))
    qx, qy, _ = wall_point(int(target[0]), target[1], target[2], box)
    approach = -(dx * m0 + dy * m1)
    if approach <= 1e-9:
        return False
    length = ((px - qx) * m0 + (py - qy) * m1) / approach
    return length > 0.0 and is_clear(px, py, pz, dx, dy, dz, length, top)


@kernel
def _seen_share(
    n: int, poly: FloatArray, cx: float, cy: float, dim_e: bool, dim_q: bool, px: float, py: float, pz: float,
    gx: float, gy: float, ex: float, ey: float, ez: float, source: FloatArray, target: FloatArray, box: FloatArray,
    top: Top,
) -> float:  # fmt: skip
    """Visible share of the lit area: 1 if its centroid and corners are visible, 0 if none of these is, else 0.5."""
    seen = _sees(cx, cy, dim_e, dim_q, px, py, pz, gx, gy, ex, ey, ez, source, target, box, top)
    for c in range(n):
        x = cx + INWARD * (poly[c, 0] - cx)
        y = cy + INWARD * (poly[c, 1] - cy)
        if seen != _sees(x, y, dim_e, dim_q, px, py, pz, gx, gy, ex, ey, ez, source, target, box, top):
            return 0.5
    return 1.0 if seen else 0.0


@kernel
def _is_all_mirrored(
    n: int, poly: FloatArray, px: float, py: float, pz: float, gx: float, gy: float, ex: float, ey: float, ez: float,
    source: FloatArray, box: FloatArray,
) -> bool:  # fmt: skip
    """Whether light from every corner of the lit area is totally reflected at p."""
    on_x = int(source[0]) % 2 == 0
    most = (1.0 - 1.0 / (box[3] * box[3])) * (1.0 + gx * gx + gy * gy)
    for c in range(n):
        dx = px - ex - (poly[c, 0] if on_x else 0.0)
        dy = py - ey - (0.0 if on_x else poly[c, 0])
        dz = pz - ez - poly[c, 1]
        into = dz - gx * dx - gy * dy
        if into * into > most * (dx * dx + dy * dy + dz * dz):
            return False
    return True


@kernel
def _mirrored_weight(
    n: int, poly: FloatArray, area: float, cx: float, cy: float, px: float, py: float, pz: float, gx: float,
    gy: float, ex: float, ey: float, ez: float, source: FloatArray, target: FloatArray, box: FloatArray,
) -> float:  # fmt: skip
    """Mean weight over a lit area that is visible and totally reflected, with two thirds of the usual points.

    The points are the midpoints of the triangles' edges; two triangles share each inner edge (second order).
    """
    total = 0.0
    before = (poly[n - 1, 0] - cx) * (poly[0, 1] - cy) - (poly[n - 1, 1] - cy) * (poly[0, 0] - cx)
    for c in range(n):
        e = c + 1 if c + 1 < n else 0
        ax, ay, bx, by = poly[c, 0], poly[c, 1], poly[e, 0], poly[e, 1]
        cross = (ax - cx) * (by - cy) - (ay - cy) * (bx - cx)
        inner = _emission(
            0.5 * (ax + cx), 0.5 * (ay + cy), px, py, pz, gx, gy, ex, ey, ez, source, target, box
        )
        outer = _emission(
            0.5 * (ax + bx), 0.5 * (ay + by), px, py, pz, gx, gy, ex, ey, ez, source, target, box
        )
        total += inner[0] * (before + cross) + outer[0] * cross
        before = cross
    return total / (6.0 * area)


@kernel
def _mean_weight(
    n: int, poly: FloatArray, area: float, cx: float, cy: float, parts: int, divided: bool, dim_e: bool, dim_q: bool,
    px: float, py: float, pz: float, gx: float, gy: float, ex: float, ey: float, ez: float, source: FloatArray,
    target: FloatArray, box: FloatArray, top: Top,
) -> float:  # fmt: skip
    """Mean weight over the lit area, at three points in each of parts² pieces of each triangle (second order).

    divided : whether a shadow divides the area; hidden points then count 0
    """
    total = 0.0
    for c in range(n):
        e = c + 1 if c + 1 < n else 0
        ax, ay, bx, by = poly[c, 0], poly[c, 1], poly[e, 0], poly[e, 1]
        cross = (ax - cx) * (by - cy) - (ay - cy) * (bx - cx)
        for k in range(3 * parts * parts):
            part = k // 3
            a = part // parts
            b = part % parts
            side = 1.0 / parts
            if a + b >= parts:  # a piece whose corners are in reverse order
                a = parts - a
                b = parts - b
                side = -side
            wa = a / parts + side * (2.0 / 3.0 if k % 3 == 0 else 1.0 / 6.0)
            wb = b / parts + side * (2.0 / 3.0 if k % 3 == 1 else 1.0 / 6.0)
            x = (1.0 - wa - wb) * cx + wa * ax + wb * bx
            y = (1.0 - wa - wb) * cy + wa * ay + wb * by
            if divided and not _sees(
                x, y, dim_e, dim_q, px, py, pz, gx, gy, ex, ey, ez, source, target, box, top
            ):
                continue
            total += _spread(x, y, px, py, pz, gx, gy, ex, ey, ez, source, target, box) * cross
    return total / (6.0 * area * parts * parts)


@kernel
def _is_uneven(
    mean: float, n: int, poly: FloatArray, area: float, cx: float, cy: float, px: float, py: float, pz: float,
    gx: float, gy: float, ex: float, ey: float, ez: float, source: FloatArray, target: FloatArray, box: FloatArray,
) -> bool:  # fmt: skip
    """Whether `mean` differs from the mean of the weights at the triangles' centroids by more than `UNEVEN`."""
    total = 0.0
    for c in range(n):
        e = c + 1 if c + 1 < n else 0
        ax, ay, bx, by = poly[c, 0], poly[c, 1], poly[e, 0], poly[e, 1]
        cross = (ax - cx) * (by - cy) - (ay - cy) * (bx - cx)
        x = (cx + ax + bx) / 3.0
        y = (cy + ay + by) / 3.0
        total += _spread(x, y, px, py, pz, gx, gy, ex, ey, ez, source, target, box) * cross
    return abs(total / (2.0 * area) - mean) > UNEVEN * mean


@kernel
def pinhole(
    sector: int, u: float, v: float, source: FloatArray, target: FloatArray, skip_flat: bool, sectors: FloatArray,
    box: FloatArray, top: Top, poly: FloatArray, other: FloatArray,
) -> tuple[float, float]:  # fmt: skip
    """Flux by way of the top at (u, v) per du dv, and the point's radius as a multiple of the skirt's radius.

    skip_flat : whether light from outside every deformed part is left out
    """
    px, py, pz, gx, gy, _, plan = top_point(sector, u, v, sectors, top)
    touches, share = touch(px, py, top)
    if (touches and u > 0.0) or (skip_flat and is_beyond(px, py, top)):
        return 0.0, share
    ex, ey, ez = wall_point(int(source[0]), source[1], source[2], box)
    n0, n1 = wall_normal(int(source[0]))
    depth = (px - ex) * n0 + (py - ey) * n1
    if depth <= 1e-6:
        return 0.0, share
    n = _project(source, target, px, py, pz, gx, gy, ex, ey, ez, depth, box, poly)
    n = cut(n, poly, other, 0.0, 0.0, 1.0)
    if n > 0:
        n = cut_to_rectangle(n, poly, other, source[3], source[4])
    if n == 0:
        return 0.0, share
    for c in range(n):
        poly[c, 0] /= poly[c, 2]
        poly[c, 1] /= poly[c, 2]
    area, cx, cy = area_and_centroid(n, poly)
    if area == 0.0:
        return 0.0, share
    dim_e = _may_be_shaded(px, py, pz, source, box, top)
    dim_q = _may_be_shaded(px, py, pz, target, box, top)
    divided = False
    if dim_e or dim_q:
        seen = _seen_share(
            n, poly, cx, cy, dim_e, dim_q, px, py, pz, gx, gy, ex, ey, ez, source, target, box, top
        )
        if seen == 0.0:
            return 0.0, share
        divided = seen < 1.0
    if not divided and _is_all_mirrored(n, poly, px, py, pz, gx, gy, ex, ey, ez, source, box):
        f = _mirrored_weight(n, poly, area, cx, cy, px, py, pz, gx, gy, ex, ey, ez, source, target, box)
    else:
        f = _mean_weight(
            n, poly, area, cx, cy, 1, divided, dim_e, dim_q, px, py, pz, gx, gy, ex, ey, ez, source, target, box, top
        )  # fmt: skip
    by_table = source[5] < 0.0 or target[5] < 0.0
    if (
        by_table
        and not divided
        and _is_uneven(f, n, poly, area, cx, cy, px, py, pz, gx, gy, ex, ey, ez, source, target, box)
    ):
        f = _mean_weight(
            n, poly, area, cx, cy, PARTS, False, dim_e, dim_q, px, py, pz, gx, gy, ex, ey, ez, source, target, box, top
        )  # fmt: skip
    if f <= 0.0:
        return 0.0, share
    if target[5] == 1.0:
        on_x = int(source[0]) % 2 == 0
        dx = px - ex - (cx if on_x else 0.0)
        dy = py - ey - (0.0 if on_x else cx)
        f *= _counted(dx, dy, pz - ez - cy, px, py, gx, gy, target, box)
    return f * abs(area) / source[6] * math.pi * plan, share


NEWTON_STEPS = 8
CONVERGED_MM = 1e-5
"""Largest last step of Newton's rule [mm]. Steps shrink quadratically, so the remaining error is far smaller."""
LONGEST_STEP_MM = 6.0
FEW_RATIO = 3.0
WHOLE_TOLERANCE = 0.01
"""Largest relative difference of an image's mean flux density from Simpson's rule, by corners and middle: a larger one
reveals a jump of the top's curvature. (Up to `FEW_RATIO`, largest over smallest density of the corner paths, the coarse
rule is used.)"""
TABLE_TOLERANCE = 3e-4
"""Largest relative difference of the coarse and the fine rule for patches with angular tables. If a table bends sharply
or has a step within an image, a rule of few paths errs by up to 1.3 % of a pair's light."""


@kernel
def mirror_point(
    ex: float, ey: float, ez: float, qx: float, qy: float, qz: float, x: float, y: float, sign: float,
    box: FloatArray, top: Top,
) -> tuple[bool, float, float, float]:  # fmt: skip
    """Find the point where a path is mirrored, by Newton steps from (x, y); return whether found, x, y, det F_pp."""
    for _ in range(NEWTON_STEPS):
        touches, _ = touch(x, y, top)
        if touches or not (0.0 < x < box[0] and 0.0 < y < box[1]):
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
    """Determinant of the mixed second derivatives of the distance from a wall's point (along, up) to the top."""
    along = ax if wall % 2 == 0 else ay
    tx = (1.0 if wall % 2 == 0 else 0.0) - along * ap
    ty = (0.0 if wall % 2 == 0 else 1.0) - along * aq
    return (tx * (gy - az * aq) - ty * (gx - az * ap)) * d * d


@kernel
def path_flux(
    ex: float, ey: float, ez: float, qx: float, qy: float, qz: float, x: float, y: float, det: float,
    source: FloatArray, target: FloatArray, box: FloatArray, top: Top,
) -> float:  # fmt: skip
    """Flux per emitter area and receiver area along the path by way of the top's point (x, y) [1/mm⁴]; -1 if hidden."""
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
    """Point (x, y, z) of a patch at offsets a, b from its centre, as multiples of its half sizes."""
    return wall_point(
        int(patch[0]), patch[1] + patch[3] * (2.0 * a - 1.0), patch[2] + patch[4] * (2.0 * b - 1.0), box
    )


@kernel
def corner_paths(
    source: FloatArray, target: FloatArray, cx: float, cy: float, sign: float, number: int, tag: IntArray, rings: int,
    phase: float, columns: FloatArray, sectors: FloatArray, box: FloatArray, top: Top,
) -> tuple[float, float]:  # fmt: skip
    """Ratio of largest to smallest flux density of the 16 paths between corners of emitter and receiver, and the mean.

    The ratio is -1 unless all paths exist, are free, and are mirrored in or next to the image's own island.
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
    """Mean flux density of an image, by Gauss nodes on both patches; -1 if a path is not found or is hidden."""
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
    """Flux of the image near (x, y), and the image's centre; the flux is -1 if the image is not whole."""
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
