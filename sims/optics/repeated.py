# mypy: allow-untyped-defs, allow-untyped-calls, allow-untyped-decorators
"""Kernels: light with two or more specular reflections at the deformed top.

The first reflection point is sampled over the top on a stratified grid, with emitter points from a fixed
low-discrepancy set, so that neighbouring depths use the same points. A first pass flags the cells whose ray
meets the top again and ends near a wanted receiver; these and their neighbours are resampled, more often
where more light may pass. A feature narrower than a cell that the first pass misses on all sides is left out.
"""

from __future__ import annotations

import math

import numpy as np

from sims.optics.rays import chain, fresnel, height, is_clear, kernel, wall_normal, wall_point
from sims.optics.surface import SKIRT_R, X, Y
from sims.optics.top_cells import top_point

NEAR_RECEIVER_MM = 3.0
FEWEST_SAMPLES = 6
MOST_SAMPLES = 160
SECTOR_CELLS = 4


@kernel
def fraction(x):
    """Part after the point."""
    return x - math.floor(x)


@kernel
def first_reflection(wall, u, v, x, y, z, source, sectors, box, press, cubic, steepest):
    """Flux per du dv from an emitter point by the top at (u, v); start and direction after it; radius."""
    px, py, pz, gx, gy, r, plan = top_point(wall, u, v, sectors, press, cubic)
    n0, n1 = wall_normal(int(source[0]))
    dx = px - x
    dy = py - y
    dz = pz - z
    out = dx * n0 + dy * n1
    into = -gx * dx - gy * dy + dz
    if out <= 0.0 or into <= 0.0 or z >= height(math.hypot(x - press[X], y - press[Y]), press, cubic):
        return 0.0, px, py, pz, 0.0, 0.0, 0.0, r, 0.0
    d2 = dx * dx + dy * dy + dz * dz
    d = math.sqrt(d2)
    f = plan * out * into / (d2 * d2) * (out / d) ** (source[5] - 1.0) * (source[5] + 1.0) / (2.0 * math.pi)
    f *= math.exp(-box[4] * d) * 4.0 * source[3] * source[4] / source[6]
    dx /= d
    dy /= d
    dz /= d
    if not is_clear(px, py, pz, -dx, -dy, -dz, d, press, cubic, steepest):
        return 0.0, px, py, pz, 0.0, 0.0, 0.0, r, 0.0
    norm = 1.0 / math.sqrt(1.0 + gx * gx + gy * gy)
    cos_in = into / d * norm
    back = 2.0 * cos_in * norm
    return f, px + 1e-9 * gx, py + 1e-9 * gy, pz - 1e-9, dx + back * gx, dy + back * gy, dz - back, r, cos_in


@kernel
def _receiver(kind, x, y, z, receivers, wanted, margin):
    """First wanted receiver whose face, grown by margin, holds the point; -1 if none."""
    along = x if kind == 0 or kind == 2 else y
    for j in range(receivers.shape[0]):
        if (
            wanted[j]
            and receivers[j, 0] == kind
            and abs(along - receivers[j, 1]) <= receivers[j, 3] + margin
            and abs(z - receivers[j, 2]) <= receivers[j, 4] + margin
        ):
            return j
    return -1


@kernel
def _trace(wall, u, v, e0, e1, source, sectors, box, press, cubic, steepest):
    """One sample: flux density, kind, end point, further top reflections, smallest radius."""
    along = source[1] + source[3] * (2.0 * e0 - 1.0)
    up = source[2] + source[4] * (2.0 * e1 - 1.0)
    x, y, z = wall_point(int(source[0]), along, up, box)
    f, x, y, z, dx, dy, dz, r, cos_in = first_reflection(
        wall, u, v, x, y, z, source, sectors, box, press, cubic, steepest
    )
    if f <= 0.0:
        return 0.0, -1, x, y, z, 0, r
    f *= fresnel(cos_in, box[3])
    kind, x, y, z, weight, tops, nearest = chain(x, y, z, dx, dy, dz, 1.0, box, press, cubic, steepest)
    return f * weight, kind, x, y, z, tops, min(r, nearest)


@kernel
def repeated_reflections(
    source, receivers, wanted, sectors, box, press, cubic, steepest, points, shift, rings, columns, unit, out
):
    """Add flux of chains with two or more top reflections to out[receiver, (outside, inside the skirt)]."""
    per_sector = max(1, columns // SECTOR_CELLS)
    power = np.zeros((SECTOR_CELLS * per_sector, rings))
    tag = np.zeros((SECTOR_CELLS * per_sector, rings), np.int64)
    n = 0
    for b in range(power.shape[0]):
        wall = b // per_sector
        for a in range(rings):
            p = points[n % points.shape[0]]
            n += 1
            u = (a + fraction(p[2] + shift[2])) / rings
            v = (b % per_sector + fraction(p[3] + shift[3])) / per_sector
            f, kind, x, y, z, tops, _ = _trace(
                wall, u, v, fraction(p[0] + shift[0]), fraction(p[1] + shift[1]),
                source, sectors, box, press, cubic, steepest,
            )  # fmt: skip
            power[b, a] = f / (rings * per_sector)
            if tops > 0:
                near = (
                    kind >= 0
                    and kind < 4
                    and _receiver(kind, x, y, z, receivers, wanted, NEAR_RECEIVER_MM) >= 0
                )
                tag[b, a] = 2 if near else 1
    for b in range(power.shape[0]):
        wall = b // per_sector
        for a in range(rings):
            flag = 0
            brightest = 0.0
            for bb in range(b - 1, b + 2):
                for aa in range(max(a - 1, 0), min(a + 2, rings)):
                    flag = max(flag, tag[bb % power.shape[0], aa])
                    brightest = max(brightest, power[bb % power.shape[0], aa])
            if flag == 0:
                continue
            samples = FEWEST_SAMPLES
            if flag == 2:
                samples = int(min(max(brightest / unit, FEWEST_SAMPLES), MOST_SAMPLES))
            address = b * rings + a + 1.0
            for k in range(samples):
                p = points[k]
                u = (a + fraction(p[2] + shift[2] + address * 0.7548776662466927)) / rings
                v = (b % per_sector + fraction(p[3] + shift[3] + address * 0.5698402909980532)) / per_sector
                f, kind, x, y, z, tops, nearest = _trace(
                    wall, u, v,
                    fraction(p[0] + shift[0] + address * 0.8191725133961645),
                    fraction(p[1] + shift[1] + address * 0.6710436067037893),
                    source, sectors, box, press, cubic, steepest,
                )  # fmt: skip
                if tops == 0 or kind < 0 or kind > 3:
                    continue
                j = _receiver(kind, x, y, z, receivers, wanted, 0.0)
                if j >= 0:
                    inner = 1 if nearest < press[SKIRT_R] else 0
                    out[j, inner] += f / (rings * per_sector * samples)
