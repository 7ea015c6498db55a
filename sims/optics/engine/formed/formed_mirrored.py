# mypy: no-warn-return-any
r"""Light that the top of a disc or crowned pad mirrors, once or often: pencils through points of the top.

Model
-----
Light of an emitter that first meets the top at P, in an element dA of it, and comes to a receiver after k reflections:

    dflux = ∫ L(c_e) c_e c_P / s² · F_1 ... F_k · e^(-μ way) A(c_r) dA_e dA

over the part of the emitter whose pencil through P lands on the receiver. The emitter is divided into `parts`² parts. A
part's pencil is followed by three rays, its middle and two beside it, each mirrored where it meets the top by itself;
they carry the part onto the receiver's plane as a parallelogram, whose share on the window is cut exactly. The pad is
convex, so a window is reached whatever wall the middle ray meets first; the dimple's shadow on the last way is asked
for the middle of what lands.

P runs over a grid of the untouched top and, in the dimple's circle, over rings around the press. A press changes light
by the same points with and without it.

Left out: what varies of Fresnel's share and of a shadow within one part's pencil; chains of more than `MOST` mirrors.
"""

from __future__ import annotations

import math

from sims.optics.engine.formed.formed_rays import (
    AREA,
    CX,
    CY,
    CZ,
    HALF_U,
    HALF_V,
    NX,
    NY,
    TOP,
    UX,
    UY,
    WALL,
    lobe,
    meeting,
    sees,
    window_point,
)
from sims.optics.engine.formed.formed_top import (
    OUTER,
    FormedTop,
    fall,
    into,
    is_contact,
    is_skirt,
    normal_at,
    out_of,
    rise,
    top_hit,
    turn,
)
from sims.optics.scene.optical_scene import FloatArray
from sims.optics.surface.radial import fresnel, kernel

MOST = 24
FAINT = 1e-9
"""Share of the emitter's power below which a pencil is followed no further."""
NEAR = 0.25
"""Rays beside the middle of a part leave this share of its half size from it."""
# columns of a point of the top
PX, PY, PZ, MX, MY, MZ, DA, SKIRT = range(8)


@kernel
def mirrored_flux(
    e: FloatArray, receivers: FloatArray, points: FloatArray, parts: int, absorbs: float, index: float,
    walls: FloatArray, round_wall: FloatArray, top: FormedTop, out: FloatArray, work: FloatArray,
) -> None:  # fmt: skip
    """Add to out (2, receiver) what pencils of an emitter through points of the top bring, smooth and by the skirt.

    points : (n, 8) places and normals out of the elastomer, elements of area [mm2], 1 within the skirt
    work : (40,) room for polygons
    """
    pressed = top.numbers[OUTER] > 0.0
    size_u, size_v = e[HALF_U] / parts, e[HALF_V] / parts
    for a in range(parts):
        for b in range(parts):
            mid_u, mid_v = (2.0 * a + 1.0) / parts - 1.0, (2.0 * b + 1.0) / parts - 1.0
            x0, y0, z0 = window_point(e, mid_u, mid_v)
            du, dv = NEAR * size_u, NEAR * size_v
            x1, y1, z1 = x0 + du * e[UX], y0 + du * e[UY], z0
            x2, y2, z2 = x0, y0, z0 + dv
            element = 4.0 * size_u * size_v / e[AREA]
            for n in range(points.shape[0]):
                p = points[n]
                dx, dy, dz = p[PX] - x0, p[PY] - y0, p[PZ] - z0
                s = math.sqrt(dx * dx + dy * dy + dz * dz)
                dx, dy, dz = dx / s, dy / s, dz / s
                leaves = -(dx * e[NX] + dy * e[NY])
                meets = dx * p[MX] + dy * p[MY] + dz * p[MZ]
                if leaves <= 0.0 or meets <= 0.0:
                    continue
                weight = lobe(e, leaves) * leaves * meets * p[DA] * element / (s * s) * fresnel(meets, index)
                weight *= math.exp(-absorbs * s)
                if weight < FAINT:
                    continue
                if pressed and not sees(
                    x0, y0, z0, p[PX] - 1e-6 * p[MX], p[PY] - 1e-6 * p[MY], p[PZ] - 1e-6 * p[MZ], top
                ):
                    continue
                _follow(x1, y1, z1, x2, y2, z2, dx, dy, dz, meets, p, weight, receivers, e, absorbs, index, walls,
                        round_wall, top, pressed, out, work)  # fmt: skip


@kernel
def _follow(
    x1: float, y1: float, z1: float, x2: float, y2: float, z2: float, dx: float, dy: float, dz: float, meets: float,
    p: FloatArray, weight: float, receivers: FloatArray, e: FloatArray, absorbs: float, index: float,
    walls: FloatArray, round_wall: FloatArray, top: FormedTop, pressed: bool, out: FloatArray, work: FloatArray,
) -> None:  # fmt: skip
    nx, ny, nz = p[MX], p[MY], p[MZ]
    x, y, z = p[PX], p[PY], p[PZ]
    ax, ay, az = x, y, z
    bx, by, bz = x, y, z
    ex, ey, ez = mirrored_from(x1, y1, z1, x, y, z, nx, ny, nz)
    fx, fy, fz = mirrored_from(x2, y2, z2, x, y, z, nx, ny, nz)
    dx, dy, dz = dx - 2.0 * meets * nx, dy - 2.0 * meets * ny, dz - 2.0 * meets * nz
    is_whole = True
    row = 1 if p[SKIRT] > 0.0 else 0
    x, y, z = x - 1e-7 * nx, y - 1e-7 * ny, z - 1e-7 * nz
    for _ in range(MOST):
        for j in range(receivers.shape[0]):
            r = receivers[j]
            toward = dx * r[NX] + dy * r[NY]
            if toward <= 1e-9 or r[WALL] == e[WALL]:
                continue
            t = ((r[CX] - x) * r[NX] + (r[CY] - y) * r[NY]) / toward
            if t <= 0.0:
                continue
            u = ((x + t * dx - r[CX]) * r[UX] + (y + t * dy - r[CY]) * r[UY]) / r[HALF_U]
            v = (z + t * dz - r[CZ]) / r[HALF_V]
            if abs(u) > 12.0 or abs(v) > 12.0:
                continue
            share = 0.0
            if is_whole:
                u1, v1, ok1 = landing(ax, ay, az, ex, ey, ez, r)
                u2, v2, ok2 = landing(bx, by, bz, fx, fy, fz, r)
                if ok1 and ok2:
                    share = share_on(
                        u, v, (u1 - u) / NEAR, (v1 - v) / NEAR, (u2 - u) / NEAR, (v2 - v) / NEAR, work
                    )
            elif abs(u) <= 1.0 and abs(v) <= 1.0:
                share = 1.0
            if share <= 0.0:
                continue
            if pressed:
                tx, ty, tz = window_point(r, min(max(u, -1.0), 1.0), min(max(v, -1.0), 1.0))
                if not sees(x, y, z, tx, ty, tz, top):
                    continue
            out[row, j] += weight * share * math.pi * lobe(r, toward) * math.exp(-absorbs * t)
        t, what = meeting(x, y, z, dx, dy, dz, walls, round_wall, top)
        if what != TOP:
            return
        x, y, z = x + t * dx, y + t * dy, z + t * dz
        qx, qy, _ = into(top, x, y, z)
        if is_contact(top, qx, qy):
            return
        if is_skirt(top, qx, qy):
            row = 1
        nx, ny, nz = normal_at(top, qx, qy)
        nx, ny, nz = out_of(top, nx, ny, nz)
        meets = dx * nx + dy * ny + dz * nz
        if meets <= 0.0:
            return
        weight *= fresnel(meets, index) * math.exp(-absorbs * t)
        if weight < FAINT:
            return
        dx, dy, dz = dx - 2.0 * meets * nx, dy - 2.0 * meets * ny, dz - 2.0 * meets * nz
        x, y, z = x - 1e-7 * nx, y - 1e-7 * ny, z - 1e-7 * nz
        if is_whole:
            ax, ay, az, ex, ey, ez, ok1 = next_of(ax, ay, az, ex, ey, ez, top)
            bx, by, bz, fx, fy, fz, ok2 = next_of(bx, by, bz, fx, fy, fz, top)
            is_whole = ok1 and ok2


@kernel
def mirrored_from(
    fx: float, fy: float, fz: float, x: float, y: float, z: float, nx: float, ny: float, nz: float
) -> tuple[float, float, float]:
    """Unit direction from a place, mirrored at another."""
    dx, dy, dz = x - fx, y - fy, z - fz
    per = 1.0 / math.sqrt(dx * dx + dy * dy + dz * dz)
    dx, dy, dz = dx * per, dy * per, dz * per
    c = 2.0 * (dx * nx + dy * ny + dz * nz)
    return dx - c * nx, dy - c * ny, dz - c * nz


@kernel
def next_of(
    x: float, y: float, z: float, dx: float, dy: float, dz: float, top: FormedTop
) -> tuple[float, float, float, float, float, float, bool]:
    """A ray beside the middle, mirrored where it next meets the top, walls or not; and whether it does."""
    qx, qy, qz = into(top, x, y, z)
    ex, ey, ez = turn(top, dx, dy, dz)
    nx, ny, nz = normal_at(top, qx, qy)
    qx, qy, qz = qx - 1e-7 * nx, qy - 1e-7 * ny, qz - 1e-7 * nz
    t = top_hit(top, qx, qy, qz, ex, ey, ez, 1e3)
    if t > 1e3:
        return x, y, z, dx, dy, dz, False
    qx, qy, qz = qx + t * ex, qy + t * ey, qz + t * ez
    nx, ny, nz = normal_at(top, qx, qy)
    c = 2.0 * (ex * nx + ey * ny + ez * nz)
    ox, oy, oz = out_of(top, qx, qy, qz)
    dx, dy, dz = out_of(top, ex - c * nx, ey - c * ny, ez - c * nz)
    good = c > 0.0 and not is_contact(top, qx, qy)
    return ox + top.origin[0], oy + top.origin[1], oz + top.origin[2], dx, dy, dz, good


@kernel
def landing(
    x: float, y: float, z: float, dx: float, dy: float, dz: float, r: FloatArray
) -> tuple[float, float, bool]:
    """Where a ray comes through a window's plane, in half sizes, and whether it does."""
    toward = dx * r[NX] + dy * r[NY]
    if toward <= 1e-9:
        return 0.0, 0.0, False
    t = ((r[CX] - x) * r[NX] + (r[CY] - y) * r[NY]) / toward
    u = ((x + t * dx - r[CX]) * r[UX] + (y + t * dy - r[CY]) * r[UY]) / r[HALF_U]
    v = (z + t * dz - r[CZ]) / r[HALF_V]
    return u, v, t > 0.0


@kernel
def share_on(u: float, v: float, au: float, av: float, bu: float, bv: float, work: FloatArray) -> float:
    """Share of a parallelogram u, v ± a ± b that lies on the square from -1 to 1."""
    wide, high = abs(au) + abs(bu), abs(av) + abs(bv)
    if abs(u) >= 1.0 + wide or abs(v) >= 1.0 + high:
        return 0.0
    if abs(u) + wide <= 1.0 and abs(v) + high <= 1.0:
        return 1.0
    area = 4.0 * abs(au * bv - av * bu)
    if area < 1e-10:
        return 1.0 if abs(u) <= 1.0 and abs(v) <= 1.0 else 0.0
    work[0], work[1] = u - au - bu, v - av - bv
    work[2], work[3] = u + au - bu, v + av - bv
    work[4], work[5] = u + au + bu, v + av + bv
    work[6], work[7] = u - au + bu, v - av + bv
    count, first, other = 4, 0, 20
    for side in range(4):
        axis, sign = side // 2, (1.0 if side % 2 == 0 else -1.0)
        kept = 0
        for k in range(count):
            m = k + 1 if k + 1 < count else 0
            p0, p1 = work[first + 2 * k], work[first + 2 * k + 1]
            q0, q1 = work[first + 2 * m], work[first + 2 * m + 1]
            in_p = 1.0 - sign * (p0 if axis == 0 else p1)
            in_q = 1.0 - sign * (q0 if axis == 0 else q1)
            if in_p >= 0.0:
                work[other + 2 * kept], work[other + 2 * kept + 1] = p0, p1
                kept += 1
            if (in_p >= 0.0) != (in_q >= 0.0):
                s = in_p / (in_p - in_q)
                work[other + 2 * kept], work[other + 2 * kept + 1] = p0 + s * (q0 - p0), p1 + s * (q1 - p1)
                kept += 1
        count = kept
        first, other = other, first
        if count < 3:
            return 0.0
    twice = 0.0
    for k in range(count):
        m = k + 1 if k + 1 < count else 0
        twice += work[first + 2 * k] * work[first + 2 * m + 1] - work[first + 2 * m] * work[first + 2 * k + 1]
    return 0.5 * abs(twice) / area


@kernel
def top_points(at: FloatArray, element: FloatArray, top: FormedTop, out: FloatArray) -> None:
    """Fill (n, 8) points of the top: at (n, 2) places in the plan of its frame, with elements of that plan [mm2]."""
    for n in range(at.shape[0]):
        x, y = at[n, 0], at[n, 1]
        down, _ = rise(top, x * x + y * y)
        nx, ny, nz = normal_at(top, x, y)
        height = down - fall(top, x, y)
        px, py, pz = out_of(top, x, y, height)
        out[n, PX], out[n, PY], out[n, PZ] = px + top.origin[0], py + top.origin[1], pz + top.origin[2]
        out[n, MX], out[n, MY], out[n, MZ] = out_of(top, nx, ny, nz)
        out[n, DA] = element[n] / nz
        out[n, SKIRT] = 1.0 if is_skirt(top, x, y) else 0.0
        if is_contact(top, x, y):
            out[n, DA] = 0.0
