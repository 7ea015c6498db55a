# mypy: no-warn-return-any
r"""Light that the top of a disc or crowned pad mirrors, once or often: pencils through points of the top.

Model
-----
Light of an emitter that first meets the top at P, in an element dA of it, and comes to a receiver after k reflections:

    dflux = ∫ L(c_e) c_e c_P / s² · F_1 ... F_k · e^(-μ way) A(c_r) dA_e dA

over the part of the emitter whose pencil through P lands on the receiver. The emitter is divided into parts that are
small against their distance from P (`share`). By the plane mirror at P a window's sides come to straight lines of the
emitter's plane, which cut a part exactly (`formed_cuts`). From the second mirror on, two rays beside the middle one,
each mirrored where it meets the top by itself, carry the part onto the receiver's plane as a parallelogram; a part
whose pencil that mirror spreads is divided. Of what leaves, L c_e c_P / s² and F_1, the mean over what lands is taken;
the dimple's shadows on the first and the last way are asked for its middle. The pad is convex, so a window is reached
whatever wall the ray meets first.

P runs over a grid of the untouched top and, around the press, over rings (`formed_points`). A press changes light by
the same points with and without it. Points go by batches, each an even lattice by itself, which tell the lattice's
error.

Left out: what varies of later Fresnel shares and of a shadow within one part's pencil; chains of more than `MOST`
mirrors.
"""

from __future__ import annotations

import math

from sims.optics.engine.formed.formed_cuts import (
    BATCH,
    DA,
    MX,
    MY,
    MZ,
    PX,
    PY,
    PZ,
    SKIRT,
    cut,
    lines,
    sent,
    sent_by_part,
)
from sims.optics.engine.formed.formed_rays import (
    AREA,
    CX,
    CY,
    CZ,
    HALF_U,
    HALF_V,
    NX,
    NY,
    UX,
    UY,
    WALL,
    lobe,
    plan_exit,
    sees,
    window_point,
)
from sims.optics.engine.formed.formed_top import (
    AT_TOP_MM,
    FLAT,
    KIND,
    NEVER,
    OUTER,
    FormedTop,
    above,
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
from sims.optics.scene.optical_scene import BoolArray, FloatArray
from sims.optics.surface.radial import fresnel, inlined, kernel

MOST = 24
FAINT = 1e-9
"""Share of the emitter's power below which a pencil is followed no further."""
NEAR = 0.02
"""Rays beside the middle of a part leave this share of its half size from it."""
WIDE, MOST_DIVIDED = 0.2, 4
"""Half spread of a pencil after its second mirror that is followed as one [rad]; an emitter's part with a wider one is
divided, in either direction into so many at most."""
MOST_PARTS = 12
"""Parts of an emitter in either direction, at most."""
BATCHES = 4
NEWTON_STEPS, NEARLY_AT_TOP_MM = 6, 1e-8


@kernel
def mirrored_flux(
    e: FloatArray, receivers: FloatArray, wanted: BoolArray, points: FloatArray, share: float, absorbs: float,
    index: float, walls: FloatArray, round_wall: FloatArray, top: FormedTop, out: FloatArray, work: FloatArray,
) -> None:  # fmt: skip
    """Add to out (2, batch, receiver) what pencils of an emitter through points of the top bring, smooth and by the
    skirt.

    wanted : (receiver,) which of them
    points : (n, 9) places and normals out of the elastomer, elements of area [mm2], 1 within the skirt, batch
    share : size of a part over its distance from a point, at most
    work : (44,) room for lines and polygons
    """
    pressed = top.numbers[OUTER] > 0.0
    for n in range(points.shape[0]):
        p = points[n]
        away = -((p[PX] - e[CX]) * e[NX] + (p[PY] - e[CY]) * e[NY])
        if away <= 1e-9 or p[DA] <= 0.0:
            continue
        along = abs((p[PX] - e[CX]) * e[UX] + (p[PY] - e[CY]) * e[UY])
        beside, above = max(along - e[HALF_U], 0.0), max(abs(p[PZ] - e[CZ]) - e[HALF_V], 0.0)
        size = share * math.sqrt(away * away + beside * beside + above * above)
        parts_u = min(int(2.0 * e[HALF_U] / size) + 1, MOST_PARTS)
        parts_v = min(int(2.0 * e[HALF_V] / size) + 1, MOST_PARTS)
        size_u, size_v = e[HALF_U] / parts_u, e[HALF_V] / parts_v
        element = 4.0 * size_u * size_v / e[AREA] * p[DA]
        for a in range(parts_u):
            for b in range(parts_v):
                x0, y0, z0 = window_point(e, (2.0 * a + 1.0) / parts_u - 1.0, (2.0 * b + 1.0) / parts_v - 1.0)
                weight = sent(x0, y0, z0, p, e, absorbs, index)
                if weight * element >= FAINT:
                    _follow(x0, y0, z0, size_u, size_v, p, weight, element, n + a + b, receivers, wanted, e, absorbs,
                            index, walls, round_wall, top, pressed, out, work)  # fmt: skip


@kernel
def _follow(
    x0: float, y0: float, z0: float, size_u: float, size_v: float, p: FloatArray, weight: float, element: float,
    number: int, receivers: FloatArray, wanted: BoolArray, e: FloatArray, absorbs: float, index: float,
    walls: FloatArray, round_wall: FloatArray, top: FormedTop, pressed: bool, out: FloatArray, work: FloatArray,
) -> None:  # fmt: skip
    """Follow the pencil of one part, of half sizes size_u and size_v about x0, y0, z0, through a point of the top.

    A part that is divided is followed through a diagonal of its squares, another one for each `number`.
    """
    nx, ny, nz = p[MX], p[MY], p[MZ]
    x, y, z = p[PX], p[PY], p[PZ]
    row, batch = (1 if p[SKIRT] > 0.0 else 0), int(p[BATCH])
    # ways from the part's places, mirrored, are w + a wu + b wv with a, b from -1 to 1
    wx, wy, wz = mirrored(x - x0, y - y0, z - z0, nx, ny, nz)
    ux, uy, uz = mirrored(-size_u * e[UX], -size_u * e[UY], 0.0, nx, ny, nz)
    vx, vy, vz = mirrored(0.0, 0.0, -size_v, nx, ny, nz)
    fx, fy, fz = x - 1e-7 * nx, y - 1e-7 * ny, z - 1e-7 * nz
    for j in range(receivers.shape[0]):
        r = receivers[j]
        deep = (r[CX] - x) * r[NX] + (r[CY] - y) * r[NY]
        if not wanted[j] or r[WALL] == e[WALL] or deep <= 1e-9:
            continue
        side, high = (x - r[CX]) * r[UX] + (y - r[CY]) * r[UY], z - r[CZ]
        t0, tu, tv = wx * r[NX] + wy * r[NY], ux * r[NX] + uy * r[NY], vx * r[NX] + vy * r[NY]
        half, s0 = r[HALF_U], side * t0 + deep * (wx * r[UX] + wy * r[UY])
        su, sv = side * tu + deep * (ux * r[UX] + uy * r[UY]), side * tv + deep * (vx * r[UX] + vy * r[UY])
        lines(
            half * t0 - s0,
            half * tu - su,
            half * tv - sv,
            half * t0 + s0,
            half * tu + su,
            half * tv + sv,
            0,
            work,
        )
        half, s0, su, sv = r[HALF_V], high * t0 + deep * wz, high * tu + deep * uz, high * tv + deep * vz
        lines(
            half * t0 - s0,
            half * tu - su,
            half * tv - sv,
            half * t0 + s0,
            half * tu + su,
            half * tv + sv,
            6,
            work,
        )
        share, a, b, count, start = cut(work)
        if share <= 0.0:
            continue
        dx, dy, dz = wx + a * ux + b * vx, wy + a * uy + b * vy, wz + a * uz + b * vz
        s = math.sqrt(dx * dx + dy * dy + dz * dz)
        toward = (dx * r[NX] + dy * r[NY]) / s
        if toward <= 1e-9:
            continue
        t = deep / toward
        if pressed and not (
            _is_lit(x0 + a * size_u * e[UX], y0 + a * size_u * e[UY], z0 + b * size_v, p, top)
            and sees(fx, fy, fz, x + t * dx / s, y + t * dy / s, z + t * dz / s, top)
        ):
            continue
        mean = sent_by_part(x0, y0, z0, size_u, size_v, p, e, absorbs, index, count, start, work)
        out[row, batch, j] += mean * element * share * math.pi * lobe(r, toward) * math.exp(-absorbs * t)
    if not pressed and wz < 0.0 and top.numbers[KIND] == FLAT:
        return
    divided = 1
    while divided > 0:
        wider = 0
        for k in range(divided):
            m = (k + number) % divided
            a, b = (2.0 * k + 1.0) / divided - 1.0, (2.0 * m + 1.0) / divided - 1.0
            px, py = x0 + a * size_u * e[UX], y0 + a * size_u * e[UY]
            pz, du, dv = z0 + b * size_v, NEAR * size_u / divided, NEAR * size_v / divided
            dx, dy, dz = beside(x - px, y - py, z - pz, nx, ny, nz)
            t = _next_mirror(fx, fy, fz, dx, dy, dz, walls, round_wall, top)
            if t >= NEVER or (pressed and not _is_lit(px, py, pz, p, top)):
                continue
            ax, ay, az = beside(x - px - du * e[UX], y - py - du * e[UY], z - pz, nx, ny, nz)
            bx, by, bz = beside(x - px, y - py, z - pz - dv, nx, ny, nz)
            part = element / divided * (weight if divided == 1 else sent(px, py, pz, p, e, absorbs, index))
            wider = _follow_on(x, y, z, fx, fy, fz, dx, dy, dz, t, ax, ay, az, bx, by, bz, part, row, batch,
                               divided == 1, receivers, wanted, e, absorbs, index, walls, round_wall, top, pressed, out,
                               work)  # fmt: skip
        divided = wider if divided == 1 else 0


@kernel
def _follow_on(
    px: float, py: float, pz: float, x: float, y: float, z: float, dx: float, dy: float, dz: float, t: float,
    ex: float, ey: float, ez: float, fx: float, fy: float, fz: float, weight: float, row: int, batch: int,
    may_divide: bool, receivers: FloatArray, wanted: BoolArray, e: FloatArray, absorbs: float, index: float,
    walls: FloatArray, round_wall: FloatArray, top: FormedTop, pressed: bool, out: FloatArray, work: FloatArray,
) -> int:  # fmt: skip
    """Follow a pencil from its second mirror on, which its middle ray meets at t; e, f: ways of the rays beside it.

    Returns 0, or into how many parts the emitter's part is better divided, as that mirror spreads the pencil.
    """
    ax, ay, az = px, py, pz
    bx, by, bz = px, py, pz
    is_whole = True
    for _ in range(MOST):
        x, y, z = x + t * dx, y + t * dy, z + t * dz
        qx, qy, _ = into(top, x, y, z)
        if is_contact(top, qx, qy):
            return 0
        if is_skirt(top, qx, qy):
            row = 1
        nx, ny, nz = normal_at(top, qx, qy)
        nx, ny, nz = out_of(top, nx, ny, nz)
        meets = dx * nx + dy * ny + dz * nz
        if meets <= 0.0:
            return 0
        weight *= fresnel(meets, index) * math.exp(-absorbs * t)
        if weight < FAINT:
            return 0
        dx, dy, dz = mirrored(dx, dy, dz, nx, ny, nz)
        x, y, z = x - 1e-7 * nx, y - 1e-7 * ny, z - 1e-7 * nz
        if is_whole:
            ax, ay, az, ex, ey, ez, ok1 = next_of(ax, ay, az, ex, ey, ez, t, top)
            bx, by, bz, fx, fy, fz, ok2 = next_of(bx, by, bz, fx, fy, fz, t, top)
            is_whole = ok1 and ok2
            if may_divide:
                may_divide = False
                spread = max(
                    abs(ex - dx) + abs(ey - dy) + abs(ez - dz), abs(fx - dx) + abs(fy - dy) + abs(fz - dz)
                )
                if spread > NEAR * WIDE:
                    return min(int(spread / (NEAR * WIDE)) + 1, MOST_DIVIDED)
        for j in range(receivers.shape[0]):
            r = receivers[j]
            toward = dx * r[NX] + dy * r[NY]
            if not wanted[j] or r[WALL] == e[WALL] or toward <= 1e-9:
                continue
            u, v, is_ahead = landing(x, y, z, dx, dy, dz, r)
            if not is_ahead or abs(u) > 12.0 or abs(v) > 12.0:
                continue
            share, a, b = 0.0, 0.0, 0.0
            u1, v1, ok1 = landing(ax, ay, az, ex, ey, ez, r)
            u2, v2, ok2 = landing(bx, by, bz, fx, fy, fz, r)
            if is_whole and ok1 and ok2:
                au, av, bu, bv = (u1 - u) / NEAR, (v1 - v) / NEAR, (u2 - u) / NEAR, (v2 - v) / NEAR
                lines(1.0 - u, -au, -bu, 1.0 + u, au, bu, 0, work)
                lines(1.0 - v, -av, -bv, 1.0 + v, av, bv, 6, work)
                share, a, b, _, _ = cut(work)
                u, v = u + a * au + b * bu, v + a * av + b * bv
            elif not is_whole and abs(u) <= 1.0 and abs(v) <= 1.0:
                share = 1.0
            if share <= 0.0:
                continue
            tx, ty, tz = window_point(r, u, v)
            if pressed and not sees(x, y, z, tx, ty, tz, top):
                continue
            way = math.sqrt((tx - x) ** 2 + (ty - y) ** 2 + (tz - z) ** 2)
            out[row, batch, j] += weight * share * math.pi * lobe(r, toward) * math.exp(-absorbs * way)
        t = _next_mirror(x, y, z, dx, dy, dz, walls, round_wall, top)
        if t >= NEVER:
            return 0
    return 0


@inlined
def mirrored(x: float, y: float, z: float, nx: float, ny: float, nz: float) -> tuple[float, float, float]:
    """A vector, mirrored by a plane of a unit normal."""
    c = 2.0 * (x * nx + y * ny + z * nz)
    return x - c * nx, y - c * ny, z - c * nz


@inlined
def beside(x: float, y: float, z: float, nx: float, ny: float, nz: float) -> tuple[float, float, float]:
    """Unit vector along another one, mirrored."""
    per = 1.0 / math.sqrt(x * x + y * y + z * z)
    return mirrored(x * per, y * per, z * per, nx, ny, nz)


@inlined
def _is_lit(x0: float, y0: float, z0: float, p: FloatArray, top: FormedTop) -> bool:
    """Whether a place of the emitter sees a point of the top."""
    return sees(x0, y0, z0, p[PX] - 1e-6 * p[MX], p[PY] - 1e-6 * p[MY], p[PZ] - 1e-6 * p[MZ], top)


@kernel
def _next_mirror(
    x: float, y: float, z: float, dx: float, dy: float, dz: float, walls: FloatArray, round_wall: FloatArray,
    top: FormedTop,
) -> float:  # fmt: skip
    """Distance to the top where a ray meets it before walls and bottom; NEVER where it does not."""
    limit = -z / dz if dz < 0.0 else 1e3
    ax, ay, az = into(top, x, y, z)
    bx, by, bz = turn(top, dx, dy, dz)
    t = top_hit(top, ax, ay, az, bx, by, bz, limit)
    if t >= limit:
        return NEVER
    wall, _ = plan_exit(x, y, z, dx, dy, dz, walls, round_wall)
    return t if t < wall else NEVER


@kernel
def next_of(
    x: float, y: float, z: float, dx: float, dy: float, dz: float, near: float, top: FormedTop
) -> tuple[float, float, float, float, float, float, bool]:
    """A ray beside the middle, mirrored where it meets the top about as far as that does; and whether it does.

    near : distance at which the middle ray meets the top [mm]; Newton's rule goes on from there
    """
    qx, qy, qz = into(top, x, y, z)
    ex, ey, ez = turn(top, dx, dy, dz)
    t = near
    for _ in range(NEWTON_STEPS):
        sx, sy = qx + t * ex, qy + t * ey
        off = above(top, sx, sy, qz + t * ez)
        if abs(off) < AT_TOP_MM:
            break
        nx, ny, nz = normal_at(top, sx, sy)
        rate = (ex * nx + ey * ny + ez * nz) / nz
        if rate <= 1e-9:
            return x, y, z, dx, dy, dz, False
        t -= off / rate
    qx, qy, qz = qx + t * ex, qy + t * ey, qz + t * ez
    if not abs(above(top, qx, qy, qz)) < NEARLY_AT_TOP_MM:
        return x, y, z, dx, dy, dz, False
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
def top_points(at: FloatArray, top: FormedTop, out: FloatArray) -> None:
    """Fill (n, 9) points of the top: at (n, 4) places in the plan of its frame, elements of that plan [mm2], batch."""
    for n in range(at.shape[0]):
        x, y = at[n, 0], at[n, 1]
        down, _ = rise(top, x * x + y * y)
        nx, ny, nz = normal_at(top, x, y)
        height = down - fall(top, x, y)
        px, py, pz = out_of(top, x, y, height)
        out[n, PX], out[n, PY], out[n, PZ] = px + top.origin[0], py + top.origin[1], pz + top.origin[2]
        out[n, MX], out[n, MY], out[n, MZ] = out_of(top, nx, ny, nz)
        out[n, DA] = at[n, 2] / nz
        out[n, BATCH] = at[n, 3]
        out[n, SKIRT] = 1.0 if is_skirt(top, x, y) else 0.0
        if is_contact(top, x, y):
            out[n, DA] = 0.0
