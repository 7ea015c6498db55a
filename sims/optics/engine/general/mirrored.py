# mypy: no-warn-return-any
r"""Light that the top of a disc or crowned pad mirrors: ray bundles by way of points of the top.

Model
-----
The light of an emitter that first meets the top at P, in an element dA, and reaches a receiver after k reflections is

    dflux = ∫ L(c_e) c_e c_P / s² · F_1 ... F_k · e^(-μ way) A(c_r) dA_e dA

integrated over the region of the emitter whose rays by way of P arrive at the receiver. The emitter is divided into
parts that are small relative to their distance from P (`share`). Mirrored at P as in a plane mirror, the sides of the
receiver's face (*window*) become straight lines in the emitter's plane; along these, a part is cut exactly
(`cuts`). All factors are integrated over the arriving light; light hidden by the dimple is found column by
column. From the second reflection on, parts are larger, and their ray bundles are divided near a window
(`chains`). The pad is convex, so a ray that points to a window reaches it, whichever wall's plane it crosses
first.

P runs over a grid of the untouched top and, around the press, over rings (`points`). The change of light by a
press comes from the same points with and without the press. The points form batches, each an even grid by itself, from
whose differences the error is estimated. Light mirrored several times is followed by way of only some points, each of
which represents its neighbours.

The model leaves out the variation of later Fresnel shares within one part's ray bundle, more than `chains.MOST`
reflections, and a column of a part whose ends are both seen while its middle is hidden.
"""

from __future__ import annotations

import math

from optopad.design.arrays import BoolArray, FloatArray
from optopad.sims.optics.engine.general.chains import (
    CHAIN_WORK,
    FAINT,
    IS_LIT,
    LEVELS,
    PLACE,
    follow_chains,
    is_lit,
)
from optopad.sims.optics.engine.general.cuts import (
    BATCH,
    CHAINS,
    DA,
    GAUSS,
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
)
from optopad.sims.optics.engine.general.rays import (
    AREA,
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
    lobe,
    mirrored,
    onto,
    sees,
    share_wall,
    up_window,
    window_point,
)
from optopad.sims.optics.engine.general.top import (
    FLAT,
    KIND,
    NEVER,
    OUTER,
    FormedTop,
    dimple,
    into,
    is_contact,
    is_open,
    is_skirt,
    normal_at,
    out_of,
    sag,
)
from optopad.sims.optics.surface.radial import inlined, kernel

COLUMNS, HALVINGS = 4, 5
"""Number of columns of an emitter's part in which light hidden by the dimple is searched for, and number of halvings in
the search."""
CHAINS_SHARE = 2.0
"""Size of undivided emitter parts for light mirrored several times, relative to their size for light mirrored once."""
STEPS = (0.7548776662466927, 0.5698402909980532)
"""Steps of Roberts' additive sequence. For each point of the top it gives the sample's position in the emitter's
parts."""
MOST_PARTS = 12
"""Largest number of parts into which an emitter is divided in each direction."""
BATCHES = 4
CELL_MM = 0.25
"""Size of the cells in which the distance to receivers that look up is tabulated."""
STEEP_ENOUGH = 0.05
"""Least downward sine of a ray for the test whether it meets the bottom before the top."""
WAYS, PART = CHAIN_WORK, CHAIN_WORK + 9
"""Columns of the array `work`: where the data of mirrored directions begin, and those of the emitter's part."""
AT = PART + 5
"""Column of the array `work` where the position of the top's point, in press coordinates, begins."""
SIGHTS = AT + 3
"""Column of the array `work` where the positions of all faces, as `is_open` takes them, begin; the emitter's is
first."""
SIGHT = 4


@kernel
def mirrored_flux(
    e: FloatArray, receivers: FloatArray, wanted: BoolArray, points: FloatArray, share: float, absorbs: float,
    index: float, walls: FloatArray, arcs: FloatArray, top: FormedTop, near: FloatArray, out: FloatArray,
    work: FloatArray,
) -> None:  # fmt: skip
    """Add an emitter's light by way of points of the top to `out` (2, batch, receiver): without and with steep skirt.

    wanted : (receiver,) mask of the requested receivers
    points : (n, 10) by columns: point; normal out of the elastomer; area that the point represents [mm²]; 1 within the
        dimple's skirt, else 0; batch; number of points that this one represents for light mirrored several times
    share : largest size of a part of the emitter, relative to its distance from a point
    near : least distance of each cell of `CELL_MM` in the plane of receivers that look up, counted from the origin, to
        a requested one [mm]. Empty if they are not in one such plane
    work : (`SIGHTS` + `SIGHT` (receivers + 1),) workspace
    """
    pressed = top.numbers[OUTER] > 0.0
    if pressed:
        put_sight(e, 0, top, work)
        for j in range(receivers.shape[0]):
            put_sight(receivers[j], j + 1, top, work)
    for n in range(points.shape[0]):
        p = points[n]
        away = -onto(e, p[PX] - e[CX], p[PY] - e[CY], p[PZ] - e[CZ])
        if away <= 1e-9 or p[DA] <= 0.0:
            continue
        lands = _may_land(p, e, receivers, wanted, near)
        is_often = p[CHAINS] > 0.0 and (pressed or top.numbers[KIND] != FLAT)
        if not lands and not is_often:
            continue
        if pressed:
            x, y, _ = into(top, p[PX], p[PY], p[PZ])
            work[AT], work[AT + 1], work[AT + 2] = x, y, dimple(top, x, y)[0]
            work[IS_LIT] = 1.0 if sight_is_open(0, top, work) else 0.0
        along = abs((p[PX] - e[CX]) * e[UX] + (p[PY] - e[CY]) * e[UY])
        rise = abs(up_window(e, p[PX] - e[CX], p[PY] - e[CY], p[PZ] - e[CZ]))
        beside, above = max(along - e[HALF_U], 0.0), max(rise - e[HALF_V], 0.0)
        work[PLACE], work[PLACE + 1] = 2.0 * (n * STEPS[0] % 1.0) - 1.0, 2.0 * (n * STEPS[1] % 1.0) - 1.0
        distance = math.sqrt(away * away + beside * beside + above * above)
        parts = 0
        # light mirrored once, and light mirrored often
        is_often = is_often and not (top.numbers[KIND] == FLAT and _ends_below(p, e, top, work))
        for often in range(2 if is_often else 1):
            size = (CHAINS_SHARE if often else 1.0) * share * distance
            parts_u = min(int(2.0 * e[HALF_U] / size) + 1, MOST_PARTS)
            parts_v = min(int(2.0 * e[HALF_V] / size) + 1, MOST_PARTS)
            levels = LEVELS + (1 if parts_u * parts_v < parts else 0)
            parts = parts_u * parts_v
            size_u, size_v = e[HALF_U] / parts_u, e[HALF_V] / parts_v
            if often == 0 and not lands:
                continue
            element = 4.0 * size_u * size_v / e[AREA] * p[DA] * (p[CHAINS] if often else 1.0)
            for a in range(parts_u):
                for b in range(parts_v):
                    x0, y0, z0 = window_point(
                        e, (2.0 * a + 1.0) / parts_u - 1.0, (2.0 * b + 1.0) / parts_v - 1.0
                    )
                    weight = sent(x0, y0, z0, p, e, absorbs, index)
                    if weight * element < FAINT:
                        continue
                    if often == 1:
                        follow_chains(x0, y0, z0, size_u, size_v, p, element, FAINT / weight,
                                      1 if p[SKIRT] > 0.0 else 0, levels, receivers, wanted, e, absorbs, index, walls,
                                      arcs, top, out, work)  # fmt: skip
                    else:
                        _follow(x0, y0, z0, size_u, size_v, p, element, receivers, wanted, e, absorbs, index, top,
                                pressed, out, work)  # fmt: skip


@kernel
def _ends_below(p: FloatArray, e: FloatArray, top: FormedTop, work: FloatArray) -> bool:
    """Whether no light of an emitter that a point of a flat, pressed top mirrors meets the top again.

    This is certain if the dimple hides no line from the point to the part of the bottom where the light goes.
    """
    x, y, z = p[PX] - e[CX], p[PY] - e[CY], p[PZ] - e[CZ]
    away = math.sqrt(x * x + y * y + z * z)
    dx, dy, dz = mirrored(x / away, y / away, z / away, p[MX], p[MY], p[MZ])
    spread = math.hypot(e[HALF_U], e[HALF_V]) / away
    least = -dz - spread  # sine of the flattest ray's slope, at least
    if least <= STEEP_ENOUGH:
        return False
    t = -p[PZ] / dz
    around = p[PZ] / least * (1.0 + spread) - p[PZ] / (-dz + spread) * (1.0 - spread)
    tx, ty, tz = into(top, p[PX] + t * dx, p[PY] + t * dy, 0.0)
    return is_open(top, work[AT], work[AT + 1], work[AT + 2], tx, ty, around, tz)


@kernel
def _may_land(
    p: FloatArray, e: FloatArray, receivers: FloatArray, wanted: BoolArray, near: FloatArray
) -> bool:
    """Whether some ray of an emitter, mirrored at a point of the top, may reach a requested receiver's window.

    Seen from the point, the emitter is within a cone about the direction of its middle, and each window is within
    another cone. The emitter's cone keeps its angle when it is mirrored. If it then misses the cones of all windows, no
    ray arrives.
    """
    x, y, z = p[PX] - e[CX], p[PY] - e[CY], p[PZ] - e[CZ]
    away = math.sqrt(x * x + y * y + z * z)
    sine = math.hypot(e[HALF_U], e[HALF_V]) / away
    if sine >= 1.0:
        return True
    cosine = math.sqrt(1.0 - sine * sine)
    dx, dy, dz = mirrored(x / away, y / away, z / away, p[MX], p[MY], p[MZ])
    least = -dz * cosine - sine  # cosine of the flattest ray to the vertical, at least
    if near.shape[0] > 0 and least > STEEP_ENOUGH:
        down = p[PZ] - receivers[0, CZ]
        a = min(
            max(int((p[PX] - down * dx / dz) / CELL_MM), 0), near.shape[0] - 1
        )  # outside, the border is nearer
        b = min(max(int((p[PY] - down * dy / dz) / CELL_MM), 0), near.shape[1] - 1)
        if near[a, b] > down * sine / (-dz * least):
            return False
    for j in range(receivers.shape[0]):
        r = receivers[j]
        if not wanted[j] or share_wall(e, r):
            continue
        x, y, z = r[CX] - p[PX], r[CY] - p[PY], r[CZ] - p[PZ]
        far2 = x * x + y * y + z * z
        wide2 = r[HALF_U] * r[HALF_U] + r[HALF_V] * r[HALF_V]
        if wide2 >= far2:
            return True
        along = x * dx + y * dy + z * dz
        if along > 0.0 and (far2 - along * along) * cosine * cosine > 2.0 * (
            wide2 + along * along * sine * sine
        ):
            continue  # far outside both cones, without a root
        nearest = cosine * math.sqrt(far2 - wide2) - sine * math.sqrt(wide2)
        if along > nearest - 1e-9 * far2:
            return True
    return False


@kernel
def _follow(
    x0: float, y0: float, z0: float, size_u: float, size_v: float, p: FloatArray, element: float,
    receivers: FloatArray, wanted: BoolArray, e: FloatArray, absorbs: float, index: float, top: FormedTop,
    pressed: bool, out: FloatArray, work: FloatArray,
) -> None:  # fmt: skip
    """Add the light from one part of the emitter, with middle x0, y0, z0, that a point of the top mirrors once."""
    nx, ny, nz = p[MX], p[MY], p[MZ]
    x, y, z = p[PX], p[PY], p[PZ]
    row, batch = (1 if p[SKIRT] > 0.0 else 0), int(p[BATCH])
    # rays from the part's points, mirrored, have the direction w + a wu + b wv with a, b from -1 to 1
    wx, wy, wz = mirrored(x - x0, y - y0, z - z0, nx, ny, nz)
    ux, uy, uz = mirrored(-size_u * e[UX], -size_u * e[UY], 0.0, nx, ny, nz)
    vx, vy, vz = mirrored(-size_v * e[VX], -size_v * e[VY], -size_v * e[VZ], nx, ny, nz)
    work[WAYS], work[WAYS + 1], work[WAYS + 2] = wx, wy, wz
    work[WAYS + 3], work[WAYS + 4], work[WAYS + 5] = ux, uy, uz
    work[WAYS + 6], work[WAYS + 7], work[WAYS + 8] = vx, vy, vz
    work[PART], work[PART + 1], work[PART + 2], work[PART + 3], work[PART + 4] = x0, y0, z0, size_u, size_v
    for j in range(receivers.shape[0]):
        r = receivers[j]
        deep = onto(r, r[CX] - x, r[CY] - y, r[CZ] - z)
        if not wanted[j] or share_wall(e, r) or deep <= 1e-9:
            continue
        side = (x - r[CX]) * r[UX] + (y - r[CY]) * r[UY]
        high = up_window(r, x - r[CX], y - r[CY], z - r[CZ])
        t0, tu, tv = onto(r, wx, wy, wz), onto(r, ux, uy, uz), onto(r, vx, vy, vz)
        half, s0 = r[HALF_U], side * t0 + deep * (wx * r[UX] + wy * r[UY])
        su, sv = side * tu + deep * (ux * r[UX] + uy * r[UY]), side * tv + deep * (vx * r[UX] + vy * r[UY])
        if abs(s0) - half * t0 >= abs(su) + abs(sv) + half * (abs(tu) + abs(tv)):
            continue
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
        half, s0 = r[HALF_V], high * t0 + deep * up_window(r, wx, wy, wz)
        su, sv = high * tu + deep * up_window(r, ux, uy, uz), high * tv + deep * up_window(r, vx, vy, vz)
        if abs(s0) - half * t0 >= abs(su) + abs(sv) + half * (abs(tu) + abs(tv)):
            continue
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
        share, _, _, count, start = cut(work)
        if share <= 0.0:
            continue
        brings = NEVER
        if pressed and not (work[IS_LIT] > 0.0 and sight_is_open(j + 1, top, work)):
            brings = _seen(p, e, r, deep, absorbs, index, count, start, top, work)
        if brings >= NEVER:
            brings = share * _brought(p, e, r, deep, absorbs, index, count, start, work)
        out[row, batch, j] += brings * element * math.pi


@kernel
def put_sight(window: FloatArray, number: int, top: FormedTop, work: FloatArray) -> None:
    """Store the position of the face of an emitter or receiver in `work`, in the form that `is_open` takes."""
    x, y, _ = into(top, window[CX], window[CY], window[CZ])
    around, most = 0.0, -NEVER
    for k in range(4):
        px, py, pz = window_point(window, 1.0 if k % 2 == 0 else -1.0, 1.0 if k < 2 else -1.0)
        qx, qy, qz = into(top, px, py, pz)
        around, most = max(around, math.hypot(qx - x, qy - y)), max(most, qz + sag(top, qx, qy))
    k = SIGHTS + SIGHT * number
    work[k], work[k + 1], work[k + 2], work[k + 3] = x, y, around, most


@inlined
def sight_is_open(number: int, top: FormedTop, work: FloatArray) -> bool:
    """Whether the dimple certainly hides no line from the top's point in `work` to a window; see `is_open`."""
    k = SIGHTS + SIGHT * number
    return is_open(top, work[AT], work[AT + 1], work[AT + 2], work[k], work[k + 1], work[k + 2], work[k + 3])


@kernel
def _brought(
    p: FloatArray, e: FloatArray, r: FloatArray, deep: float, absorbs: float, index: float, count: int, start: int,
    work: FloatArray,
) -> float:  # fmt: skip
    """Light that a point of the top mirrors to a receiver: mean over the region of an emitter's part that arrives.

    count : number of corners of that region, stored in `work` from `start` on; its triangles are sampled at the middles
        of their sides. If 0, the whole part arrives, and Gauss' rule with four nodes is used
    """
    total, whole = 0.0, 0.0
    for k in range(1, max(count - 1, 2)):
        i, m = start + 2 * k, start + 2 * k + 2
        area, places = 4.0, 4
        if count > 0:
            places = 3
            area = abs(
                (work[i] - work[start]) * (work[m + 1] - work[start + 1])
                - (work[m] - work[start]) * (work[i + 1] - work[start + 1])
            )
        for side in range(places):
            if count == 0:
                a, b = (GAUSS if side % 2 == 0 else -GAUSS), (GAUSS if side < 2 else -GAUSS)
            else:
                one, other = (start, i) if side == 0 else ((i, m) if side == 1 else (m, start))
                a, b = 0.5 * (work[one] + work[other]), 0.5 * (work[one + 1] + work[other + 1])
            total += area / places * _counted(a, b, p, e, r, deep, absorbs, index, work)
        whole += area
    return total / whole if whole > 0.0 else 0.0


@inlined
def _counted(
    a: float, b: float, p: FloatArray, e: FloatArray, r: FloatArray, deep: float, absorbs: float, index: float,
    work: FloatArray,
) -> float:  # fmt: skip
    """Light from position a, b of an emitter's part, mirrored by a point of the top and counted by a receiver."""
    dx, dy, dz = _way(a, b, work)
    toward = onto(r, dx, dy, dz) / math.sqrt(dx * dx + dy * dy + dz * dz)
    if toward <= 1e-9:
        return 0.0
    x, y, z = _place(a, b, e, work)
    return sent(x, y, z, p, e, absorbs, index) * lobe(r, toward) * math.exp(-absorbs * deep / toward)


@inlined
def _way(a: float, b: float, work: FloatArray) -> tuple[float, float, float]:
    """Vector from the position a, b of an emitter's part to the point of the top, mirrored there."""
    k = WAYS
    return (
        work[k] + a * work[k + 3] + b * work[k + 6],
        work[k + 1] + a * work[k + 4] + b * work[k + 7],
        work[k + 2] + a * work[k + 5] + b * work[k + 8],
    )


@inlined
def _place(a: float, b: float, e: FloatArray, work: FloatArray) -> tuple[float, float, float]:
    """Point (x, y, z) of an emitter's part at a, b from -1 to 1."""
    along, up = a * work[PART + 3], b * work[PART + 4]
    return (
        work[PART] + along * e[UX] + up * e[VX],
        work[PART + 1] + along * e[UY] + up * e[VY],
        work[PART + 2] + up * e[VZ],
    )


@kernel
def _seen(
    p: FloatArray, e: FloatArray, r: FloatArray, deep: float, absorbs: float, index: float, count: int, start: int,
    top: FormedTop, work: FloatArray,
) -> float:  # fmt: skip
    """Integral of an emitter part's light that the dimple lets pass to a receiver by way of a point of the top.

    NEVER if none is hidden. The dimple hides a column of the part from one end. Under a flat top this is the upper end,
    since both rays are flatter there. The hidden length is found by halving.
    """
    low, high = -1.0, 1.0
    if count > 0:
        low, high = work[start], work[start]
        for k in range(1, count):
            low, high = min(low, work[start + 2 * k]), max(high, work[start + 2 * k])
    width, first = (high - low) / COLUMNS, COLUMNS
    for k in range(COLUMNS):
        a = low + (k + 0.5) * width
        under, over = _ends(a, work)
        if over > under and not (
            _passes(a, over, p, e, r, deep, top, work) and _passes(a, under, p, e, r, deep, top, work)
        ):
            first = k
            break
    if first == COLUMNS:
        return NEVER
    total = 0.0
    for k in range(COLUMNS):
        a = low + (k + 0.5) * width
        under, over = _ends(a, work)
        if over <= under:
            continue
        is_under = k < first or _passes(a, under, p, e, r, deep, top, work)
        is_over = k < first or _passes(a, over, p, e, r, deep, top, work)
        if not (is_under or is_over):
            continue
        if is_under != is_over:
            seen, dark = (under, over) if is_under else (over, under)
            for _ in range(HALVINGS):
                b = 0.5 * (seen + dark)
                if _passes(a, b, p, e, r, deep, top, work):
                    seen = b
                else:
                    dark = b
            under, over = (under, 0.5 * (seen + dark)) if is_under else (0.5 * (seen + dark), over)
        for end in range(2):
            b = 0.5 * (under + over) + (GAUSS if end else -GAUSS) * 0.5 * (over - under)
            total += width * (over - under) * 0.125 * _counted(a, b, p, e, r, deep, absorbs, index, work)
    return total


@inlined
def _ends(a: float, work: FloatArray) -> tuple[float, float]:
    """Lower and upper end of the region that arrives, in the column at position `a` of an emitter's part."""
    under, over = -1.0, 1.0
    for side in range(4):
        g, gv = work[3 * side] + a * work[3 * side + 1], work[3 * side + 2]
        if gv > 0.0:
            under = max(under, -g / gv)
        elif gv < 0.0:
            over = min(over, -g / gv)
    return under, over


@inlined
def _passes(
    a: float, b: float, p: FloatArray, e: FloatArray, r: FloatArray, deep: float, top: FormedTop, work: FloatArray
) -> bool:  # fmt: skip
    """Whether the dimple hides neither the line from an emitter's point to the top nor the line to the receiver."""
    dx, dy, dz = _way(a, b, work)
    toward = onto(r, dx, dy, dz)
    if toward <= 0.0:
        return False
    t = deep / toward
    x, y, z = p[PX] - 1e-7 * p[MX], p[PY] - 1e-7 * p[MY], p[PZ] - 1e-7 * p[MZ]
    if not sees(x, y, z, p[PX] + t * dx, p[PY] + t * dy, p[PZ] + t * dz, top):
        return False
    x, y, z = _place(a, b, e, work)
    return is_lit(x, y, z, p, top)


@kernel
def top_points(at: FloatArray, top: FormedTop, out: FloatArray) -> None:
    """Fill `out` (n, 10) with points of the top, as `mirrored_flux` takes them.

    at : (n, 5) by columns: x, y in press coordinates, area in that x-y plane [mm²], batch, and number of points that
        this one represents for light mirrored several times
    """
    for n in range(at.shape[0]):
        x, y = at[n, 0], at[n, 1]
        down = dimple(top, x, y)[0]
        nx, ny, nz = normal_at(top, x, y)
        height = down - sag(top, x, y)
        px, py, pz = out_of(top, x, y, height)
        out[n, PX], out[n, PY], out[n, PZ] = px + top.origin[0], py + top.origin[1], pz + top.origin[2]
        out[n, MX], out[n, MY], out[n, MZ] = out_of(top, nx, ny, nz)
        out[n, DA] = at[n, 2] / nz
        out[n, BATCH], out[n, CHAINS] = at[n, 3], at[n, 4]
        out[n, SKIRT] = 1.0 if is_skirt(top, x, y) else 0.0
        if is_contact(top, x, y):
            out[n, DA] = 0.0
