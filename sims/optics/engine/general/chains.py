# mypy: no-warn-return-any
r"""Light that the top of a disc or crowned pad mirrors twice or more, followed as ray bundles. A *ray bundle* (pencil)
is the light that goes from a part of the emitter by way of one point of the top. A *window* is the face of an emitter
or receiver. The *skirt* is the steep part of the dimple around the tip.

First only the bundle's middle ray is followed. If it comes near a window, the bundle is divided, at most `LEVELS`
times. Before the last division, five rays represent a bundle: one from the part's middle and four around it at the
nodes of Gauss' rule. Each ray is mirrored where it itself meets the top. To second order the five rays show the image
of the part in a window's plane: a parallelogram about the mean of the arriving light. In four cases the bundle is
divided once more, and each piece is represented by its middle ray alone, as a sample: if the rays meet different
surfaces; if the dimple hides some of them; if the mean arrives farther from the middle ray than `BEND` times the
window's half size; or if the skirt mirrors the bundle. The spread over points of the top gives the error of these
samples.
"""

from __future__ import annotations

import math

from optopad.design.arrays import BoolArray, FloatArray
from optopad.sims.optics.engine.general.cuts import (
    BATCH,
    GAUSS,
    MX,
    MY,
    MZ,
    PX,
    PY,
    PZ,
    cut,
    lines,
    sent,
    sent_by_part,
)
from optopad.sims.optics.engine.general.rays import (
    CX,
    CY,
    CZ,
    HALF_U,
    HALF_V,
    UX,
    UY,
    VX,
    VY,
    VZ,
    landing,
    lobe,
    mirrored,
    mirrored_unit,
    onto,
    plan_exit,
    returned,
    sees,
    share_wall,
    window_point,
)
from optopad.sims.optics.engine.general.top import (
    NEVER,
    OUTER,
    FormedTop,
    into,
    is_contact,
    is_skirt,
    normal_at,
    out_of,
    top_hit,
    turn,
)
from optopad.sims.optics.surface.radial import inlined, kernel

MOST = 24
FAINT = 1e-9
"""Share of the emitter's power below which the ray bundle from an undivided part of the emitter is not followed
further."""
SIDES, RAYS = 4, 44
"""Number of rays around a ray bundle's middle ray, and the column in `work` where their data begin."""
LANDED, LANDINGS = RAYS + 6 * SIDES, 32
"""Column in `work` where a ray bundle's contributions to receivers begin, and their largest number."""
DIVISIONS, LEVELS = 2, 2
"""Number of pieces of a divided ray bundle in each direction, and largest number of divisions."""
STACK = LANDED + 3 * LANDINGS
"""Column in `work` where the list of pieces that are still to be followed begins."""
IS_LIT = STACK + 4 * (DIVISIONS * DIVISIONS * (LEVELS + 1) + 1)
"""Column in `work`: 1 if the dimple certainly hides no line from the emitter to the point of the top."""
PLACE = IS_LIT + 1
"""Column in `work` where the sample's position in a piece begins; each of its two numbers is from -1 to 1."""
CHAIN_WORK = PLACE + 2
BEND = 0.2
"""Largest offset between the mean arrival of a ray bundle and the arrival of its middle ray, in half sizes of the
receiver's face. If the offset is larger, the bundle is divided."""
STAYS_FAR, COMES_NEAR, COMES_BENT, COMES_DIM = 0, 1, 2, 3
WIDENS = 1.2
"""In the search for receivers, a ray bundle is taken to be wider by this factor than with plane mirrors."""
BRIGHT = 1e4
"""A ray bundle that the dimple's steep skirt mirrors is divided if its power exceeds this multiple of `FAINT`."""
BEHIND = 0.5
"""How far behind a wall a ray bundle's middle ray may still meet the top, relative to the distance to the wall."""
FARTHEST = 20.0
"""A receiver is not tested if a ray bundle's middle ray arrives more than this many half sizes from its face's
middle."""


@kernel
def follow_chains(
    x0: float, y0: float, z0: float, size_u: float, size_v: float, p: FloatArray, element: float, faint: float,
    row: int, levels: int, receivers: FloatArray, wanted: BoolArray, e: FloatArray, absorbs: float, index: float,
    walls: FloatArray, arcs: FloatArray, top: FormedTop, out: FloatArray, work: FloatArray,
) -> None:  # fmt: skip
    """Follow the light from a part of the emitter, of half sizes size_u and size_v, by way of a point of the top.

    element : area of the part times the area that the point represents
    faint : light below this is not followed further; it corresponds to `FAINT` of the emitter's power
    row : 1 if the point is in the dimple's steep skirt, else 0
    levels : largest number of times that the light is divided
    """
    per, waiting = 1.0 / DIVISIONS, 1
    work[STACK], work[STACK + 1], work[STACK + 2], work[STACK + 3] = 0.0, 0.0, 1.0, 0.0
    while waiting > 0:
        waiting -= 1
        k = STACK + 4 * waiting
        a, b, size, level = work[k], work[k + 1], work[k + 2], int(work[k + 3])
        x, y, z = _part_place(x0, y0, z0, a * size_u, b * size_v, e)
        near = COMES_NEAR
        if level < levels:
            near = _comes_near(x, y, z, size * max(size_u, size_v), p, size * size * element, size * size * faint,
                               receivers, wanted, e, absorbs, index, walls, arcs, top)  # fmt: skip
            if near == STAYS_FAR:
                continue
        if near == COMES_DIM:
            level = levels
        if level == levels:
            a, b = a + size * work[PLACE], b + size * work[PLACE + 1]
            x, y, z = _part_place(x0, y0, z0, a * size_u, b * size_v, e)
        if level < levels - 1 or near == COMES_BENT or _follow(
            x, y, z, size * size_u, size * size_v, p, size * size * element, size * size * faint, row,
            level == levels, receivers, wanted, e, absorbs, index, walls, arcs, top, out, work,
        ):  # fmt: skip
            for n in range(DIVISIONS * DIVISIONS):
                k = STACK + 4 * waiting
                work[k] = a + size * ((2.0 * (n % DIVISIONS) + 1.0) * per - 1.0)
                work[k + 1] = b + size * ((2.0 * (n // DIVISIONS) + 1.0) * per - 1.0)
                work[k + 2] = per * size
                work[k + 3] = level + 1
                waiting += 1


@kernel
def _comes_near(
    x0: float, y0: float, z0: float, size: float, p: FloatArray, weight: float, faint: float, receivers: FloatArray,
    wanted: BoolArray, e: FloatArray, absorbs: float, index: float, walls: FloatArray, arcs: FloatArray,
    top: FormedTop,
) -> int:  # fmt: skip
    """Whether a ray bundle comes near a receiver after its second or a later reflection, by its middle ray alone.

    size : larger half size of the bundle's start on the emitter [mm]

    Returns
    -------
    `STAYS_FAR` or `COMES_NEAR`. If the ray meets the dimple's steep skirt, which widens the bundle: `COMES_BENT` with
    much power left, `COMES_DIM` with little
    """
    nx, ny, nz = p[MX], p[MY], p[MZ]
    way = math.sqrt((p[PX] - x0) ** 2 + (p[PY] - y0) ** 2 + (p[PZ] - z0) ** 2)
    widens = WIDENS * size / way
    dx, dy, dz = mirrored_unit(p[PX] - x0, p[PY] - y0, p[PZ] - z0, nx, ny, nz)
    x, y, z = p[PX] - 1e-7 * nx, p[PY] - 1e-7 * ny, p[PZ] - 1e-7 * nz
    for _ in range(MOST):
        t, _ = _top_before_wall(x, y, z, dx, dy, dz, walls, arcs, top)
        if t >= NEVER:
            return STAYS_FAR
        way += t
        x, y, z = x + t * dx, y + t * dy, z + t * dz
        qx, qy, _ = into(top, x, y, z)
        nx, ny, nz = normal_at(top, qx, qy)
        nx, ny, nz = out_of(top, nx, ny, nz)
        meets = max(dx * nx + dy * ny + dz * nz, 0.0)
        weight *= returned(meets, index) * math.exp(-absorbs * t)
        if is_skirt(top, qx, qy) or meets <= 0.0:
            return COMES_BENT if weight > BRIGHT * faint else COMES_DIM
        if weight < faint:
            return STAYS_FAR
        dx, dy, dz = mirrored(dx, dy, dz, nx, ny, nz)
        x, y, z = x - 1e-7 * nx, y - 1e-7 * ny, z - 1e-7 * nz
        for j in range(receivers.shape[0]):
            r = receivers[j]
            if not wanted[j] or share_wall(e, r):
                continue
            tx, ty, tz = r[CX] - x, r[CY] - y, r[CZ] - z
            ahead = tx * dx + ty * dy + tz * dz
            around = math.hypot(r[HALF_U], r[HALF_V]) + widens * (way + max(ahead, 0.0))
            if ahead > -around and tx * tx + ty * ty + tz * tz - ahead * ahead < around * around:
                return COMES_NEAR
    return STAYS_FAR


@kernel
def _follow(
    x0: float, y0: float, z0: float, size_u: float, size_v: float, p: FloatArray, weight: float, faint: float,
    row: int, is_sample: bool, receivers: FloatArray, wanted: BoolArray, e: FloatArray, absorbs: float, index: float,
    walls: FloatArray, arcs: FloatArray, top: FormedTop, out: FloatArray, work: FloatArray,
) -> bool:  # fmt: skip
    """Add a ray bundle's light after its second and later reflections; or return True if it must be divided first.

    is_sample : whether the middle ray alone represents the bundle; it then need not be divided
    """
    pressed = top.numbers[OUTER] > 0.0
    nx, ny, nz = p[MX], p[MY], p[MZ]
    dx, dy, dz = mirrored_unit(p[PX] - x0, p[PY] - y0, p[PZ] - z0, nx, ny, nz)
    x, y, z = p[PX] - 1e-7 * nx, p[PY] - 1e-7 * ny, p[PZ] - 1e-7 * nz
    t, spare = _top_before_wall(x, y, z, dx, dy, dz, walls, arcs, top)
    if t >= NEVER:
        return False
    landed, is_whole = 0, not is_sample
    if is_whole:
        for side in range(SIDES):
            ax, ay, az = _side_place(side, x0, y0, z0, size_u, size_v, e)
            ex, ey, ez = mirrored_unit(p[PX] - ax, p[PY] - ay, p[PZ] - az, nx, ny, nz)
            put_ray(x, y, z, ex, ey, ez, side, work)
    if spare < 0.0 and not (is_whole and _goes_on(spare, walls, arcs, top, work)):
        return False
    for _ in range(MOST):
        x, y, z = x + t * dx, y + t * dy, z + t * dz
        qx, qy, _ = into(top, x, y, z)
        if is_skirt(top, qx, qy):
            row = 1
        nx, ny, nz = normal_at(top, qx, qy)
        nx, ny, nz = out_of(top, nx, ny, nz)
        meets = dx * nx + dy * ny + dz * nz
        ends = is_contact(top, qx, qy) or meets <= 0.0
        if is_whole:
            mirrored_sides = 0
            for side in range(SIDES):
                if _mirror_side(side, top, work):
                    mirrored_sides += 1
            is_whole = mirrored_sides == SIDES and not ends
            if not is_whole and not (ends and mirrored_sides == 0):
                return True
        if ends:
            break
        weight *= returned(meets, index) * math.exp(-absorbs * t)
        if weight < faint:
            break
        dx, dy, dz = mirrored(dx, dy, dz, nx, ny, nz)
        x, y, z = x - 1e-7 * nx, y - 1e-7 * ny, z - 1e-7 * nz
        for j in range(receivers.shape[0]):
            r = receivers[j]
            toward = onto(r, dx, dy, dz)
            if not wanted[j] or share_wall(e, r) or toward <= 1e-9:
                continue
            u, v, ahead = landing(x, y, z, dx, dy, dz, r)
            if abs(u) > FARTHEST or abs(v) > FARTHEST:
                continue
            share, a, b = 0.0, 0.0, 0.0
            is_pencil = is_whole
            if is_whole:
                au, av, bu, bv, mu, mv, most = pencil(u, v, r, work)
                is_pencil = most > -NEVER
                if max(most, ahead) > 0.0:
                    u, v = u + mu, v + mv
                    reach_u, reach_v = 1.0 + abs(au) + abs(bu) + abs(mu), 1.0 + abs(av) + abs(bv) + abs(mv)
                    if abs(u) >= reach_u or abs(v) >= reach_v:
                        continue
                    lines(1.0 - u, -au, -bu, 1.0 + u, au, bu, 0, work)
                    lines(1.0 - v, -av, -bv, 1.0 + v, av, bv, 6, work)
                    share, a, b, _, _ = cut(work)
                    u, v = u + a * au + b * bu, v + a * av + b * bv
                    if share > 0.0 and abs(mu) + abs(mv) > BEND:
                        return True
            if not is_pencil and ahead > 0.0 and abs(u) <= 1.0 and abs(v) <= 1.0:
                if not is_sample:
                    return True
                share = 1.0
            if share <= 0.0:
                continue
            counts = lobe(r, toward)
            if is_pencil:
                counts = _counted(a, b, share, toward, counts, r, work)
            if pressed:
                seen = _seen_rays(x0, y0, z0, size_u, size_v, x, y, z, u, v, is_pencil, p, e, r, top, work)
                if not is_sample and 0.0 < seen < 1.0:
                    return True
                counts *= seen
            tx, ty, tz = window_point(r, u, v)
            way = math.sqrt((tx - x) ** 2 + (ty - y) ** 2 + (tz - z) ** 2)
            ax, ay, az = _part_place(x0, y0, z0, a * size_u, b * size_v, e)
            brings = sent(ax, ay, az, p, e, absorbs, index)
            middle = sent(x0, y0, z0, p, e, absorbs, index)
            if is_pencil and middle > 0.0:
                mean = sent_by_part(x0, y0, z0, size_u, size_v, p, e, absorbs, index)
                brings *= 1.0 + share * (mean / middle - 1.0)
            brings *= weight * share * math.pi * counts * math.exp(-absorbs * way)
            if landed < LANDINGS and brings > 0.0:
                k = LANDED + 3 * landed
                work[k], work[k + 1], work[k + 2] = float(row), float(j), brings
                landed += 1
        t, spare = _top_before_wall(x, y, z, dx, dy, dz, walls, arcs, top)
        if t >= NEVER or (spare < 0.0 and not (is_whole and _goes_on(spare, walls, arcs, top, work))):
            break
    for n in range(landed):
        k = LANDED + 3 * n
        out[int(work[k]), int(p[BATCH]), int(work[k + 1])] += work[k + 2]
    return False


@inlined
def _side_place(
    side: int, x0: float, y0: float, z0: float, size_u: float, size_v: float, e: FloatArray
) -> tuple[float, float, float]:
    """Start on the emitter of one of the four rays around the middle one: 0, 1 along the wall; 2, 3 above and below."""
    off = GAUSS if side % 2 == 0 else -GAUSS
    if side < 2:
        return _part_place(x0, y0, z0, off * size_u, 0.0, e)
    return _part_place(x0, y0, z0, 0.0, off * size_v, e)


@inlined
def _part_place(
    x0: float, y0: float, z0: float, along: float, up: float, e: FloatArray
) -> tuple[float, float, float]:
    """Point of the emitter at distances along its width and its height from a point of it [mm]."""
    return x0 + along * e[UX] + up * e[VX], y0 + along * e[UY] + up * e[VY], z0 + up * e[VZ]


@kernel
def _mirror_side(side: int, top: FormedTop, work: FloatArray) -> bool:
    """Follow one of the rays around the middle one to the top; return whether it is mirrored there."""
    k = RAYS + 6 * side
    qx, qy, qz = into(top, work[k], work[k + 1], work[k + 2])
    ex, ey, ez = turn(top, work[k + 3], work[k + 4], work[k + 5])
    t = top_hit(top, qx, qy, qz, ex, ey, ez, 1e3)
    if t >= 1e3:
        return False
    qx, qy, qz = qx + t * ex, qy + t * ey, qz + t * ez
    nx, ny, nz = normal_at(top, qx, qy)
    c = ex * nx + ey * ny + ez * nz
    if c <= 0.0 or is_contact(top, qx, qy):
        return False
    x, y, z = out_of(top, qx - 1e-7 * nx, qy - 1e-7 * ny, qz - 1e-7 * nz)
    dx, dy, dz = out_of(top, ex - 2.0 * c * nx, ey - 2.0 * c * ny, ez - 2.0 * c * nz)
    put_ray(x + top.origin[0], y + top.origin[1], z + top.origin[2], dx, dy, dz, side, work)
    return True


@kernel
def _seen_rays(
    x0: float, y0: float, z0: float, size_u: float, size_v: float, x: float, y: float, z: float, u: float, v: float,
    is_pencil: bool, p: FloatArray, e: FloatArray, r: FloatArray, top: FormedTop, work: FloatArray,
) -> float:  # fmt: skip
    """Share of a ray bundle's rays whose first and last straight pieces the dimple does not hide."""
    tx, ty, tz = window_point(r, u, v)
    is_open = work[IS_LIT] > 0.0
    seen = 1.0 if (is_open or is_lit(x0, y0, z0, p, top)) and sees(x, y, z, tx, ty, tz, top) else 0.0
    if not is_pencil:
        return seen
    for side in range(SIDES):
        k = RAYS + 6 * side
        ax, ay, az = _side_place(side, x0, y0, z0, size_u, size_v, e)
        if is_open or is_lit(ax, ay, az, p, top):
            u, v, ahead = landing(work[k], work[k + 1], work[k + 2], work[k + 3], work[k + 4], work[k + 5], r)
            tx, ty, tz = window_point(r, u, v)
            if ahead > 0.0 and sees(work[k], work[k + 1], work[k + 2], tx, ty, tz, top):
                seen += 1.0
    return seen / (SIDES + 1.0)


@inlined
def _counted(
    a: float, b: float, share: float, toward: float, counts: float, r: FloatArray, work: FloatArray
) -> float:
    """Share of the arriving light that a receiver counts, averaged over the arriving rays of a ray bundle.

    a, b, share : middle of the region of the emitter's part from which rays arrive, from -1 to 1, and the region's
        share of the part
    toward, counts : cosine at which the middle ray arrives, and the share of its light that the receiver counts
    """
    k = RAYS + 3
    t0 = onto(r, work[k], work[k + 1], work[k + 2])
    t1 = onto(r, work[k + 6], work[k + 7], work[k + 8])
    t2 = onto(r, work[k + 12], work[k + 13], work[k + 14])
    t3 = onto(r, work[k + 18], work[k + 19], work[k + 20])
    mean = 0.5 * (lobe(r, t0) + lobe(r, t1) + lobe(r, t2) + lobe(r, t3)) - counts
    here = lobe(r, toward + 0.5 / GAUSS * (a * (t0 - t1) + b * (t2 - t3)))
    return max(here + share * (mean - counts), 0.0)


@inlined
def put_ray(
    x: float, y: float, z: float, dx: float, dy: float, dz: float, side: int, work: FloatArray
) -> None:
    """Store one of the four rays around a ray bundle's middle ray in `work`."""
    k = RAYS + 6 * side
    work[k], work[k + 1], work[k + 2], work[k + 3], work[k + 4], work[k + 5] = x, y, z, dx, dy, dz


@kernel
def pencil(
    u: float, v: float, r: FloatArray, work: FloatArray
) -> tuple[float, float, float, float, float, float, float]:
    """Image of a part of the emitter on a receiver's face, in multiples of the face's half sizes.

    Returns
    -------
    shift (u, v) that corresponds to half the part's width; shift (u, v) that corresponds to half its height; shift (u,
    v) of the mean from the middle ray; largest distance that a ray travels to the face, -NEVER if not all arrive
    """
    k = RAYS
    u0, v0, ok0 = landing(work[k], work[k + 1], work[k + 2], work[k + 3], work[k + 4], work[k + 5], r)
    k = RAYS + 6
    u1, v1, ok1 = landing(work[k], work[k + 1], work[k + 2], work[k + 3], work[k + 4], work[k + 5], r)
    k = RAYS + 12
    u2, v2, ok2 = landing(work[k], work[k + 1], work[k + 2], work[k + 3], work[k + 4], work[k + 5], r)
    k = RAYS + 18
    u3, v3, ok3 = landing(work[k], work[k + 1], work[k + 2], work[k + 3], work[k + 4], work[k + 5], r)
    per = 0.5 / GAUSS
    return (
        per * (u0 - u1),
        per * (v0 - v1),
        per * (u2 - u3),
        per * (v2 - v3),
        0.5 * (u0 + u1 + u2 + u3) - 2.0 * u,
        0.5 * (v0 + v1 + v2 + v3) - 2.0 * v,
        max(max(ok0, ok1), max(ok2, ok3)) if min(min(ok0, ok1), min(ok2, ok3)) > -NEVER else -NEVER,
    )


@inlined
def is_lit(x0: float, y0: float, z0: float, p: FloatArray, top: FormedTop) -> bool:
    """Whether the dimple does not hide the straight line from a point of the emitter to a point of the top."""
    return sees(x0, y0, z0, p[PX] - 1e-6 * p[MX], p[PY] - 1e-6 * p[MY], p[PZ] - 1e-6 * p[MZ], top)


@kernel
def _goes_on(spare: float, walls: FloatArray, arcs: FloatArray, top: FormedTop, work: FloatArray) -> bool:
    """Whether some ray of a ray bundle meets the top before a wall, although the middle ray meets it behind the wall.

    spare : distance from the middle ray's point on the top to the wall, negative if the point is behind the wall
    """
    more = 0.0
    for pair in range(2):
        most = 0.0
        for side in range(2 * pair, 2 * pair + 2):
            k = RAYS + 6 * side
            near, beyond = _top_before_wall(
                work[k],
                work[k + 1],
                work[k + 2],
                work[k + 3],
                work[k + 4],
                work[k + 5],
                walls,
                arcs,
                top,
            )
            if near < NEVER:
                most = max(most, beyond - spare)
        more += most
    return spare + more / GAUSS > 0.0


@inlined
def _top_before_wall(
    x: float, y: float, z: float, dx: float, dy: float, dz: float, walls: FloatArray, arcs: FloatArray,
    top: FormedTop,
) -> tuple[float, float]:  # fmt: skip
    """Distance of a ray to the top (NEVER if not met), and how much farther the wall is (negative if it is nearer)."""
    wall, _ = plan_exit(x, y, z, dx, dy, dz, walls, arcs)
    limit = (1.0 + BEHIND) * wall
    if dz < 0.0:
        limit = min(limit, -z / dz)
    ax, ay, az = into(top, x, y, z)
    bx, by, bz = turn(top, dx, dy, dz)
    t = top_hit(top, ax, ay, az, bx, by, bz, limit)
    return (t, wall - t) if t < limit else (NEVER, 0.0)
