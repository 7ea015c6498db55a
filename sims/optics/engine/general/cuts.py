# mypy: no-warn-return-any
"""The share of an emitter's part whose light a point of the top mirrors into a receiver's face, by cutting polygons.
Positions in the part are given in half sizes from its middle, so the part is a square from -1 to 1. The sides of the
receiver's face correspond to four lines g + u gu + v gv = 0 in this square. Light reaches the receiver from the region
where all four expressions are above 0, which is a convex polygon.
"""

from __future__ import annotations

import math

from optopad.design.arrays import FloatArray
from optopad.sims.optics.engine.general.rays import UX, UY, VX, VY, VZ, lobe, onto, returned
from optopad.sims.optics.surface.radial import inlined, kernel

GAUSS = 0.5773502691896258
"""The two nodes of Gauss' rule on the interval from -1 to 1 are at plus and minus this value."""
# columns of a point of the top
PX, PY, PZ, MX, MY, MZ, DA, SKIRT, BATCH, CHAINS = range(10)
POINT_COLUMNS = 10


@inlined
def sent(x: float, y: float, z: float, p: FloatArray, e: FloatArray, absorbs: float, index: float) -> float:
    """Light from a point of the emitter that a point of the top mirrors, per area of both [1/mm²]."""
    dx, dy, dz = p[PX] - x, p[PY] - y, p[PZ] - z
    s2 = dx * dx + dy * dy + dz * dz
    s = math.sqrt(s2)
    leaves = -onto(e, dx, dy, dz) / s
    meets = (dx * p[MX] + dy * p[MY] + dz * p[MZ]) / s
    if leaves <= 0.0 or meets <= 0.0:
        return 0.0
    return lobe(e, leaves) * leaves * meets / s2 * returned(meets, index) * math.exp(-absorbs * s)


@kernel
def sent_by_part(
    x0: float, y0: float, z0: float, size_u: float, size_v: float, p: FloatArray, e: FloatArray, absorbs: float,
    index: float,
) -> float:  # fmt: skip
    """Mean of `sent` over a rectangle of the emitter, by Gauss' rule with four nodes [1/mm²].

    The middle of the rectangle is (x0, y0, z0), its half sizes are size_u along the width and size_v along the height
    [mm].
    """
    total = 0.0
    for k in range(4):
        a, b = (GAUSS if k % 2 == 0 else -GAUSS) * size_u, (GAUSS if k < 2 else -GAUSS) * size_v
        total += sent(
            x0 + a * e[UX] + b * e[VX], y0 + a * e[UY] + b * e[VY], z0 + b * e[VZ], p, e, absorbs, index
        )
    return 0.25 * total


@inlined
def lines(
    a0: float, au: float, av: float, b0: float, bu: float, bv: float, first: int, work: FloatArray
) -> None:
    """Store two lines in `work` for `cut`, which keeps the side where g + u gu + v gv is above 0."""
    work[first], work[first + 1], work[first + 2] = a0, au, av
    work[first + 3], work[first + 4], work[first + 5] = b0, bu, bv


@kernel
def cut(work: FloatArray) -> tuple[float, float, float, int, int]:
    """Share of the square from -1 to 1 in which four lines g + u gu + v gv are above 0.

    work : (44,) array with the lines in its first 12 numbers, then space for two polygons

    Returns
    -------
    share; centre u, v of the region; its number of corners (0: the whole square); index in `work` where they begin
    """
    is_cut = False
    for k in range(4):
        most, spread = work[3 * k], abs(work[3 * k + 1]) + abs(work[3 * k + 2])
        if most + spread <= 0.0:
            return 0.0, 0.0, 0.0, 0, 0
        is_cut = is_cut or most < spread
    if not is_cut:
        return 1.0, 0.0, 0.0, 0, 0
    first, other, count = 12, 28, 4
    work[12], work[13], work[14], work[15] = -1.0, -1.0, 1.0, -1.0
    work[16], work[17], work[18], work[19] = 1.0, 1.0, -1.0, 1.0
    for k in range(4):
        g, gu, gv = work[3 * k], work[3 * k + 1], work[3 * k + 2]
        if g >= abs(gu) + abs(gv):
            continue
        kept = 0
        for i in range(count):
            m = first + 2 * (i + 1 if i + 1 < count else 0)
            p0, p1, q0, q1 = work[first + 2 * i], work[first + 2 * i + 1], work[m], work[m + 1]
            in_p, in_q = g + gu * p0 + gv * p1, g + gu * q0 + gv * q1
            if in_p >= 0.0:
                work[other + 2 * kept], work[other + 2 * kept + 1] = p0, p1
                kept += 1
            if (in_p >= 0.0) != (in_q >= 0.0):
                s = in_p / (in_p - in_q)
                work[other + 2 * kept], work[other + 2 * kept + 1] = p0 + s * (q0 - p0), p1 + s * (q1 - p1)
                kept += 1
        count, first, other = kept, other, first
        if count < 3:
            return 0.0, 0.0, 0.0, 0, 0
    twice, sum_u, sum_v = 0.0, 0.0, 0.0
    for i in range(count):
        m = first + 2 * (i + 1 if i + 1 < count else 0)
        p0, p1, q0, q1 = work[first + 2 * i], work[first + 2 * i + 1], work[m], work[m + 1]
        cross = p0 * q1 - q0 * p1
        twice, sum_u, sum_v = twice + cross, sum_u + cross * (p0 + q0), sum_v + cross * (p1 + q1)
    if twice < 1e-14:
        return 0.0, 0.0, 0.0, 0, 0
    return twice / 8.0, sum_u / (3.0 * twice), sum_v / (3.0 * twice), count, first
