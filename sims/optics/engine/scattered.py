# mypy: no-warn-return-any
"""Kernels: light that walls, bottom or tip scatter once, and how the pressed top changes it.

Scattered once
--------------
Walls, bottom and tip are divided into patches. Rays from an emitter are followed through all reflections at the top and
deposit its power on patches. The same is done from every receiver, and by reciprocity

    flux = sum over patches of  reflectance x deposit_e x deposit_r x A_r / A_patch.

A deposit is shared between the four patches around it, so it changes smoothly with the ray. Receivers' faces absorb.
Emitters' faces reflect like the wall around them. Smooth walls mirror their Fresnel share. The finite size of patches
on walls and bottom causes a bias, which is the same with and without a press. `optopad.sims.optics.engine.trace_states`
cancels it by taking the ratio to the untouched pad's sum. Light scattered by the tip has no untouched value and is used
as it is.

Change by the press
-------------------
Rays from an emitter or receiver to a grid of points of the pressed top, contact included, end somewhere now, and ended
elsewhere under the untouched top. The difference of the two, summed over the grid with the weight

    radiance x cos x (g . d) / d^3 dA,    g = (-dh/dx, -dh/dy, 1), d from the emitter or receiver to the point,

is the exact change of the light on walls and bottom, as the press changes only rays that meet the top first. The grid
includes the part of the top that is still flat, since light mirrored there may then meet a dimple. One ray is used for
both tops, so a top that hardly changes has hardly any effect.

The rays' powers differ by orders of magnitude. For an emitter or receiver at a small distance, cells that are large for
this distance are divided. A ray of little power is followed at random: one of power w < w0 with probability w / w0, and
then with power w0 (Russian roulette: Arvo and Kirk 1990), which leaves the mean unchanged.
"""

from __future__ import annotations

import math

import numpy as np

from optopad.design.arrays import FloatArray, IntArray
from optopad.sims.optics.engine.straight import BOTTOM, LOST, LOST_WEIGHT, TIP, chain, is_clear
from optopad.sims.optics.surface.curves import CONTACT, CONTACT_AREA, CONTACT_PARTS, TOP, X, Y
from optopad.sims.optics.surface.radial import (
    array_kernel,
    contact_radius_2,
    fresnel,
    kernel,
    mirrored_share,
    radiance,
    wall_hit,
    wall_normal,
    wall_point,
)
from optopad.sims.optics.surface.tops import (
    AX,
    AY,
    BX,
    BY,
    FIELD_ON,
    Top,
    is_beyond,
    place_in_contact,
    place_on_top,
    surface_gradient,
    surface_height,
    touch,
)


@kernel
def put_point(p: FloatArray, sector: int, u: float, v: float, sectors: FloatArray, top: Top) -> None:
    """Fill `p` with the point of the top at (u, v), its gradient, and the plan area per du dv."""
    p[PX], p[PY], _, p[AREA] = place_on_top(sector, u, v, sectors, top)
    p[PZ], p[GX], p[GY] = surface_gradient(p[PX], p[PY], top)


@kernel
def landing(
    p: FloatArray, along: float, up: float, source: FloatArray, box: FloatArray, top: Top
) -> tuple[float, int, float, float, int, float, float]:
    """End of the path from a point of the emitter by way of the top's point p.

    Returns the power (0: no such path), wall, position along it and height, number of further reflections, their
    smallest distance from a tip's axis as a multiple of the skirt radius, and cosine of arrival.
    """
    ex, ey, ez = wall_point(int(source[0]), along, up, box)
    if ez >= surface_height(ex, ey, top):
        return 0.0, -1, 0.0, 0.0, 0, 1e30, 1.0
    weight, dx, dy, dz, cos_in = first_leg(p, ex, ey, ez, source, box, top, 0.0, 0.0)
    if weight == 0.0:
        return 0.0, -1, 0.0, 0.0, 0, 1e30, 1.0
    kind, x, y, z, dx, dy, dz, left, tops, nearest = echo(p, dx, dy, dz, cos_in, box, top)
    n0, n1 = wall_normal(kind) if 0 <= kind < 4 else (0.0, 0.0)
    return weight * left, kind, (x if kind == 0 or kind == 2 else y), z, tops, nearest, -(dx * n0 + dy * n1)


@kernel
def unit_there(
    kind: int, low_s: float, high_s: float, low_z: float, high_z: float, receivers: FloatArray, units: FloatArray,
) -> float:  # fmt: skip
    """Smallest power that a sample may represent near requested receivers in a box on a wall; 0 if there are none.

    units : (receiver,) power that one sample may represent near each receiver; 0 if the receiver is not requested
    """
    least = 0.0
    for j in range(receivers.shape[0]):
        if units[j] == 0.0 or receivers[j, 0] != kind or (least > 0.0 and units[j] >= least):
            continue
        if low_s > receivers[j, 1] + receivers[j, 3] or high_s < receivers[j, 1] - receivers[j, 3]:
            continue
        if low_z > receivers[j, 2] + receivers[j, 4] or high_z < receivers[j, 2] - receivers[j, 4]:
            continue
        least = units[j]
    return least


TIP_RINGS = 3
TIP_SECTORS = 12
MIRRORINGS = 64
"""Largest number of reflections at smooth walls on one path."""


@kernel
def fraction(x: float) -> float:
    """Fractional part of a number."""
    return x - math.floor(x)


@kernel
def golden_pair(n: int, one: float, two: float) -> tuple[float, float]:
    """n-th point of a low-discrepancy sequence in the unit square, moved by (one, two)."""
    return fraction(n * 0.7548776662466927 + one), fraction(n * 0.5698402909980532 + two)


@array_kernel
def golden_shift(k: float) -> FloatArray:
    """(4,) k-th point of a low-discrepancy sequence in 0 to 1, by irrational steps."""
    out = np.empty(4)
    out[0] = fraction(k * 0.8566748838545029)
    out[1] = fraction(k * 0.7338918566271260)
    out[2] = fraction(k * 0.6287067210378087)
    out[3] = fraction(k * 0.5385972572236101)
    return out


@array_kernel
def layout_of(box: FloatArray, size: float) -> IntArray:
    """(6, 3): numbers of patch columns and rows, and index of the first patch, on walls 0-3, bottom (4), tip (5)."""
    out = np.zeros((6, 3), np.int64)
    first = 0
    for k in range(6):
        across = box[0] if k == 0 or k == 2 or k == BOTTOM else box[1]
        up = box[1] if k == BOTTOM else box[2]
        out[k, 0] = max(1, math.ceil(across / size))
        out[k, 1] = max(1, math.ceil(up / size))
        if k == TIP:
            out[k, 0] = TIP_SECTORS
            out[k, 1] = TIP_RINGS
        out[k, 2] = first
        first += out[k, 0] * out[k, 1]
    return out


@kernel
def tip_patch(x: float, y: float, layout: IntArray, row: FloatArray) -> int:
    """Index of the tip's patch at a point: rings of equal area, a wrapped shank included, are divided by angle."""
    px = x - row[X]
    py = y - row[Y]
    r2 = px * px + py * py
    part = 0
    while part < CONTACT_PARTS - 1 and row[CONTACT + part + 1] < r2:
        part += 1
    low = row[CONTACT + part]
    share = (part + (r2 - low) / (row[CONTACT + part + 1] - low)) / CONTACT_PARTS
    a = min(int((math.atan2(py, px) / (2.0 * math.pi) + 0.5) * TIP_SECTORS), TIP_SECTORS - 1)
    b = min(int(share * TIP_RINGS), TIP_RINGS - 1)
    return layout[TIP, 2] + b * layout[TIP, 0] + a


@kernel
def place_on_tip(patch: int, one: float, two: float, row: FloatArray) -> tuple[float, float]:
    """Point (x, y) on one of the tip's patches, at a fraction of its area outward and of its angle."""
    r2, _ = contact_radius_2((patch // TIP_SECTORS + one) / TIP_RINGS, row)
    r = math.sqrt(r2)
    angle = 2.0 * math.pi * ((patch % TIP_SECTORS + two) / TIP_SECTORS - 0.5)
    return row[X] + r * math.cos(angle), row[Y] + r * math.sin(angle)


@kernel
def tip_patch_area(row: FloatArray) -> float:
    """Area of each of a tip's patches, which are equal [mm²]."""
    return row[CONTACT_AREA] / (TIP_RINGS * TIP_SECTORS)


@kernel
def add_deposit(
    kind: int, x: float, y: float, z: float, weight: float, layout: IntArray, box: FloatArray, top: Top,
    out: FloatArray,
) -> None:  # fmt: skip
    """Add a weight to the patches around a point of a wall, the bottom or the tip."""
    if kind == TIP:
        out[tip_patch(x, y, layout, top.row)] += weight
        return
    columns = layout[kind, 0]
    rows = layout[kind, 1]
    across = box[0] if kind == 0 or kind == 2 or kind == BOTTOM else box[1]
    up = box[1] if kind == BOTTOM else box[2]
    along = x if kind == 0 or kind == 2 or kind == BOTTOM else y
    s = min(max(along / across * columns - 0.5, 0.0), columns - 1.0)
    t = min(max((y if kind == BOTTOM else z) / up * rows - 0.5, 0.0), rows - 1.0)
    a = min(int(s), max(columns - 2, 0))
    b = min(int(t), max(rows - 2, 0))
    s -= a
    t -= b
    first = layout[kind, 2] + b * columns + a
    right = 1 if columns > 1 else 0
    above = columns if rows > 1 else 0
    out[first] += weight * (1.0 - s) * (1.0 - t)
    out[first + right] += weight * s * (1.0 - t)
    out[first + above] += weight * (1.0 - s) * t
    out[first + above + right] += weight * s * t


@kernel
def receiver_at(kind: int, x: float, y: float, z: float, receivers: FloatArray) -> int:
    """Number of the receiver whose face contains a point of wall `kind`; -1 if there is none."""
    along = x if kind == 0 or kind == 2 else y
    for j in range(receivers.shape[0]):
        if (
            receivers[j, 0] == kind
            and abs(along - receivers[j, 1]) <= receivers[j, 3]
            and abs(z - receivers[j, 2]) <= receivers[j, 4]
        ):
            return j
    return -1


@array_kernel
def patch_areas(layout: IntArray, receivers: FloatArray, box: FloatArray) -> FloatArray:
    """(patch,) area of wall and bottom patches without receivers' faces [mm²]; 0 for the tip's."""
    out = np.zeros(layout[5, 2] + layout[5, 0] * layout[5, 1])
    for k in range(5):
        du = (box[0] if k == 0 or k == 2 or k == BOTTOM else box[1]) / layout[k, 0]
        dv = (box[1] if k == BOTTOM else box[2]) / layout[k, 1]
        for b in range(layout[k, 1]):
            for a in range(layout[k, 0]):
                area = du * dv
                if k < BOTTOM:
                    for j in range(receivers.shape[0]):
                        if receivers[j, 0] == k:
                            u0 = max(a * du, receivers[j, 1] - receivers[j, 3])
                            u1 = min((a + 1) * du, receivers[j, 1] + receivers[j, 3])
                            v0 = max(b * dv, receivers[j, 2] - receivers[j, 4])
                            v1 = min((b + 1) * dv, receivers[j, 2] + receivers[j, 4])
                            area -= max(u1 - u0, 0.0) * max(v1 - v0, 0.0)
                out[layout[k, 2] + b * layout[k, 0] + a] = max(area, 0.0)
    return out


@kernel
def leaving(
    patch: FloatArray, p: FloatArray, shift: FloatArray, box: FloatArray
) -> tuple[float, float, float, float, float, float, float]:
    """Start, direction and weight of a ray from the face of an emitter or receiver, by four random numbers `p`.

    Directions follow the Lambertian order. If the face has a table, they are Lambertian and the weight includes the
    table.
    """
    wall = int(patch[0])
    along = patch[1] + patch[3] * (2.0 * fraction(p[0] + shift[0]) - 1.0)
    other = patch[2] + patch[4] * (2.0 * fraction(p[1] + shift[1]) - 1.0)
    order = max(patch[5], 1.0) if patch[5] < 0.0 else patch[5]
    cos_out = (1.0 - fraction(p[2] + shift[2])) ** (1.0 / (order + 1.0))
    sin_out = math.sqrt(max(1.0 - cos_out * cos_out, 0.0))
    phi = 2.0 * math.pi * fraction(p[3] + shift[3])
    weight = 4.0 * patch[3] * patch[4] / patch[6]
    if patch[5] < 0.0:
        weight *= math.pi * radiance(patch, cos_out)
    if wall == BOTTOM:
        return along, other, 0.0, sin_out * math.cos(phi), sin_out * math.sin(phi), cos_out, weight
    x, y, z = wall_point(wall, along, other, box)
    n0, n1 = wall_normal(wall)
    side = sin_out * math.cos(phi)
    return x, y, z, n0 * cos_out - n1 * side, n1 * cos_out + n0 * side, sin_out * math.sin(phi), weight


@kernel
def follow(
    x: float, y: float, z: float, dx: float, dy: float, dz: float, weight: float, gathers: bool,
    receivers: FloatArray, layout: IntArray, box: FloatArray, top: Top, out: FloatArray, seen: FloatArray,
) -> None:  # fmt: skip
    """Deposit a ray's light on walls, bottom and tip; add to `seen` the light that smooth walls mirror onto receivers.

    gathers : True for a ray that follows a receiver's light backwards. Scattered light loses the mirrored share when it
        enters a smooth wall, not when it leaves the wall; so a backward ray loses nothing
    """
    for mirrorings in range(MIRRORINGS):
        kind, x, y, z, dx, dy, dz, left, _, _ = chain(x, y, z, dx, dy, dz, 1.0, box, top)
        weight *= left
        if kind < 0 or weight < LOST_WEIGHT:
            return
        if kind >= BOTTOM:
            add_deposit(kind, x, y, z, weight, layout, box, top, out)
            return
        n0, n1 = wall_normal(kind)
        cos_in = -(dx * n0 + dy * n1)
        j = receiver_at(kind, x, y, z, receivers)
        if j >= 0:
            if mirrorings > 0:
                seen[j] += weight * math.pi * radiance(receivers[j], cos_in)
            return
        share = mirrored_share(cos_in, box[3], box[5]) if box[5] > 0.0 else 0.0
        entering = weight if gathers else weight * (1.0 - share)
        add_deposit(kind, x, y, z, entering, layout, box, top, out)
        weight *= share
        if weight < LOST_WEIGHT:
            return
        dx += 2.0 * cos_in * n0
        dy += 2.0 * cos_in * n1
        x += 1e-9 * n0
        y += 1e-9 * n1


@kernel
def deposit(
    source: FloatArray, gathers: bool, receivers: FloatArray, box: FloatArray, top: Top, points: FloatArray,
    count: int, shift: FloatArray, layout: IntArray, out: FloatArray, seen: FloatArray,
) -> None:  # fmt: skip
    """Deposit the light of an emitter or receiver on patches by rays; add to `seen` as `follow` does."""
    for k in range(count):
        x, y, z, dx, dy, dz, weight = leaving(source, points[k], shift, box)
        if z < surface_height(x, y, top):
            follow(x, y, z, dx, dy, dz, weight / count, gathers, receivers, layout, box, top, out, seen)


@kernel
def join(
    from_emitter: FloatArray, from_receiver: FloatArray, receiver_area: float, areas: FloatArray, layout: IntArray,
    reflectances: FloatArray,
) -> float:  # fmt: skip
    """Flux of a pair that walls and bottom scatter once, from the light of emitter and receiver on patches."""
    total = 0.0
    for k in range(TIP):
        part = 0.0
        for n in range(layout[k, 2], layout[k, 2] + layout[k, 0] * layout[k, 1]):
            product = from_emitter[n] * from_receiver[n]
            if product != 0.0 and areas[n] > 1e-9:
                part += product / areas[n]
        total += part * reflectances[k]
    return total * receiver_area


@kernel
def join_on_tip(
    from_emitter: FloatArray, from_receiver: FloatArray, receiver_area: float, layout: IntArray,
    reflectances: FloatArray, top: Top,
) -> float:  # fmt: skip
    """Flux of a pair that a tip scatters once, from the light of emitter and receiver on its patches."""
    if reflectances[TIP] == 0.0:
        return 0.0
    total = 0.0
    for n in range(layout[TIP, 2], layout[TIP, 2] + layout[TIP, 0] * layout[TIP, 1]):
        total += from_emitter[n] * from_receiver[n]
    area = tip_patch_area(top.row)
    return total / area * reflectances[TIP] * receiver_area if area > 1e-9 else 0.0


@array_kernel
def bounces(
    layout: IntArray, receivers: FloatArray, box: FloatArray, top: Top, points: FloatArray, count: int
) -> FloatArray:
    """(patch, patch) share of one patch's scattered light that lands on another under the untouched top."""
    patches = layout[5, 2]
    out = np.zeros((patches, patches + layout[5, 0] * layout[5, 1]))
    source = np.zeros(7)
    seen = np.zeros(receivers.shape[0])
    for k in range(5):
        du = (box[0] if k == 0 or k == 2 or k == BOTTOM else box[1]) / layout[k, 0]
        dv = (box[1] if k == BOTTOM else box[2]) / layout[k, 1]
        for b in range(layout[k, 1]):
            for a in range(layout[k, 0]):
                n = layout[k, 2] + b * layout[k, 0] + a
                source[0], source[1], source[2] = k, (a + 0.5) * du, (b + 0.5) * dv
                source[3], source[4], source[5] = 0.5 * du, 0.5 * dv, 1.0
                source[6] = du * dv
                shift = golden_shift(n + 1.0)
                deposit(source, False, receivers, box, top, points, count, shift, layout, out[n], seen)
    return out[:, :patches]


# columns of a lattice row
PX, PY, PZ, GX, GY, AREA, TOUCHED, SECTOR, U0, U1, V0, V1, FLAT, MX, MY, MZ, SIZE = range(17)
POINT_COLUMNS = 17
# columns of an echo row, the end of a ray from the emitter; in the contact, power is all light landing on the cell
POWER, KIND, ALONG, UP, TOPS = range(5)
ECHO_COLUMNS = 5
NEAR = 0.4
"""Largest ratio of a grid cell's size to its distance from an emitter or receiver. A larger cell is divided for it;
without this, errors of scattered light were three times as large on the paper's pad, up to 16 % of a signal."""
MOST_PARTS = 8
FEWEST_CONTACT_RINGS = 3
COLUMNS_A_CONTACT_RING = 10
"""Number of the grid's columns per ring in the contact: on a fully submerged tip a cell is half as wide as high. With
only three rings, the light behind such a tip, where almost none remains, erred by 0.4 % of the signal."""
COSINES = 16
THIRD_TURN = 0.381966011250105
"""2 minus the golden ratio: step of a sequence that is independent of that of the points on the emitter."""


@kernel
def contact_rings(columns: float) -> int:
    """Number of the grid's rings in the contact, from the number of columns around a tip."""
    return max(int(columns) // COLUMNS_A_CONTACT_RING, FEWEST_CONTACT_RINGS)


@kernel
def first_free_row(lattice: FloatArray) -> int:
    """First row of the grid that is not in the contact."""
    row = 0
    while row < lattice.shape[0] and lattice[row, 0, TOUCHED] == 1.0:
        row += 1
    return row


@kernel
def lattice_points(
    in_contact: int, columns: FloatArray, shift_u: float, shift_v: float, sectors: FloatArray, top: Top,
    out: FloatArray,
) -> None:  # fmt: skip
    """Fill `out` (row, column, 17), which holds zeros, with a grid of points of the pressed top and its cells' sizes.

    The first `in_contact` rows are rings of equal area in the contact; the others are rings of u outside it.
    """
    rings = out.shape[0] - in_contact
    for b in range(columns.shape[0]):
        k = int(columns[b, 0])
        v = columns[b, 1] + shift_v * (columns[b, 2] - columns[b, 1])
        for a in range(out.shape[0]):
            row = out[a, b]
            row[TOUCHED] = 1.0 if a < in_contact else 0.0
            count = in_contact if a < in_contact else rings
            n = a if a < in_contact else a - in_contact
            row[U0] = n / count
            row[U1] = (n + 1.0) / count
            row[SECTOR] = k
            row[V0] = columns[b, 1]
            row[V1] = columns[b, 2]
            put_on_top(row, (n + shift_u) / count, v, (columns[b, 2] - columns[b, 1]) / count, sectors, top)
            row[MX], row[MY], _ = _place(
                row, 0.5 * (row[U0] + row[U1]), 0.5 * (row[V0] + row[V1]), sectors, top
            )
            row[MZ] = surface_height(row[MX], row[MY], top)
            row[SIZE] = 0.0
            for c in range(4):
                x, y, _ = _place(
                    row, row[U0] if c < 2 else row[U1], row[V0] if c % 2 == 0 else row[V1], sectors, top
                )
                rise = surface_height(x, y, top) - row[MZ] if row[TOUCHED] == 1.0 else 0.0
                row[SIZE] = max(row[SIZE], math.sqrt((x - row[MX]) ** 2 + (y - row[MY]) ** 2 + rise * rise))


@kernel
def _place(row: FloatArray, u: float, v: float, sectors: FloatArray, top: Top) -> tuple[float, float, float]:
    """Point (x, y) at (u, v) of a grid point's sector, in the contact if that point is, and plan area per du dv."""
    if row[TOUCHED] == 1.0:
        return place_in_contact(int(row[SECTOR]), u, v, sectors, top)
    x, y, _, area = place_on_top(int(row[SECTOR]), u, v, sectors, top)
    return x, y, area


@kernel
def put_on_top(row: FloatArray, u: float, v: float, share: float, sectors: FloatArray, top: Top) -> None:
    """Fill position, gradient and area of a grid point at (u, v) in its sector.

    share : the area du dv that the point represents
    """
    row[PX], row[PY], area = _place(row, u, v, sectors, top)
    row[AREA] = area * share
    row[FLAT] = 0.0
    if row[TOUCHED] == 0.0:
        touches, _ = touch(row[PX], row[PY], top)
        if touches:
            row[AREA] = 0.0
        row[FLAT] = 1.0 if top.row[FIELD_ON] == 0.0 and is_beyond(row[PX], row[PY], top) else 0.0
    row[PZ], row[GX], row[GY] = surface_gradient(row[PX], row[PY], top)


@kernel
def contact_cell_area(row: FloatArray, rings: int, sectors: FloatArray, top: Top) -> float:
    """Area of the top in a grid cell of the contact, if there are `rings` rings of equal area [mm²]."""
    k = int(row[SECTOR])
    x0 = sectors[k, AX] + row[V0] * sectors[k, BX]
    y0 = sectors[k, AY] + row[V0] * sectors[k, BY]
    x1 = sectors[k, AX] + row[V1] * sectors[k, BX]
    y1 = sectors[k, AY] + row[V1] * sectors[k, BY]
    angle = math.atan2(x0 * y1 - y0 * x1, x0 * x1 + y0 * y1)
    return top.row[CONTACT_AREA] / rings * angle / (2.0 * math.pi)


@kernel
def _whole_power(patch: FloatArray) -> float:
    """Light of a face summed over all directions: 1 for an emitter, the mean response for a receiver."""
    power = 0.0
    for k in range(COSINES):
        cosine = (k + 0.5) / COSINES
        power += 2.0 * math.pi / COSINES * cosine * radiance(patch, cosine)
    return power


@kernel
def parts_of(cell: FloatArray, patch: FloatArray, box: FloatArray) -> int:
    """Number of pieces along each side into which a cell of the grid is divided for a nearby emitter or receiver."""
    x0, y0, z = wall_point(int(patch[0]), patch[1], patch[2], box)
    on_x = int(patch[0]) % 2 == 0
    along = max(abs(cell[MX] - x0 if on_x else cell[MY] - y0) - patch[3], 0.0)
    across = cell[MY] - y0 if on_x else cell[MX] - x0
    up = max(abs(cell[MZ] - z) - patch[4], 0.0)
    near = math.sqrt(along * along + across * across + up * up)
    return int(min(max(math.ceil(cell[SIZE] / (NEAR * near + 1e-9)), 1.0), MOST_PARTS))


@kernel
def first_leg(
    p: FloatArray, ex: float, ey: float, ez: float, source: FloatArray, box: FloatArray, top: Top, least: float,
    luck: float,
) -> tuple[float, float, float, float, float]:  # fmt: skip
    """Weight, direction and cosine of arrival of the ray from e to the grid's point p.

    The weight is 0 if p is hidden or faces away. A weight below `least` becomes `least` with the probability weight /
    least, else 0; `luck` is the random number for this, 0 to 1.
    """
    n0, n1 = wall_normal(int(source[0]))
    dx = p[PX] - ex
    dy = p[PY] - ey
    dz = p[PZ] - ez
    out = dx * n0 + dy * n1
    into = dz - p[GX] * dx - p[GY] * dy
    if out <= 0.0 or into <= 0.0 or p[AREA] == 0.0:
        return 0.0, dx, dy, dz, 0.0
    d = math.sqrt(dx * dx + dy * dy + dz * dz)
    dx /= d
    dy /= d
    dz /= d
    weight = radiance(source, out / d) * out * into / (d * d * d * d) * p[AREA] * math.exp(-box[4] * d)
    weight *= 4.0 * source[3] * source[4] / source[6]
    if weight < least * luck:
        return 0.0, dx, dy, dz, 0.0
    if not is_clear(p[PX], p[PY], p[PZ], -dx, -dy, -dz, d, top):
        return 0.0, dx, dy, dz, 0.0
    weight = max(weight, least)
    return weight, dx, dy, dz, into / (d * math.sqrt(1.0 + p[GX] * p[GX] + p[GY] * p[GY]))


@kernel
def echo(
    p: FloatArray, dx: float, dy: float, dz: float, cos_in: float, box: FloatArray, top: Top
) -> tuple[int, float, float, float, float, float, float, float, int, float]:
    """Follow a ray after its reflection at the grid's point p to its end; returns what `straight.chain` returns."""
    norm = 1.0 / math.sqrt(1.0 + p[GX] * p[GX] + p[GY] * p[GY])
    back = 2.0 * cos_in * norm
    return chain(
        p[PX] + 1e-9 * p[GX] * norm, p[PY] + 1e-9 * p[GY] * norm, p[PZ] - 1e-9 * norm,
        dx + back * p[GX], dy + back * p[GY], dz - back, fresnel(cos_in, box[3]), box, top,
    )  # fmt: skip


@kernel
def _untouched_fate(
    x: float, y: float, z: float, dx: float, dy: float, dz: float, height: float, box: FloatArray
) -> tuple[int, float, float, float, float]:
    """End of a ray from (x, y, z) under an untouched top: surface, point, and share of its power that is left there."""
    t, kind = wall_hit(x, y, z, dx, dy, dz, box)
    left = 1.0
    run = 0.0
    if dz > 0.0 and (height - z) / dz < t:
        run = (height - z) / dz
        x += run * dx
        y += run * dy
        z = height
        left = fresnel(dz, box[3])
        dz = -dz
        t, kind = wall_hit(x, y, z, dx, dy, dz, box)
    return kind, x + t * dx, y + t * dy, z + t * dz, left * math.exp(-box[4] * (run + t))


@kernel
def top_change(
    source: FloatArray, receivers: FloatArray, lattice: FloatArray, shift: FloatArray, layout: IntArray,
    box: FloatArray, top: Top, out: FloatArray, echoes: FloatArray, ray_share: float, offset: FloatArray,
    sectors: FloatArray, p: FloatArray,
) -> None:  # fmt: skip
    """Add the press's change of light on patches to `out` (patch,), for an emitter or receiver; fill `echoes`.

    ray_share : power, as a multiple of a ray's mean power, below which a ray is followed at random
    offset : (2,) position of points in the pieces of a divided cell
    echoes : (row, column, 5) end of the ray by way of each cell: of several rays, the brightest one that is mirrored
        again; in the contact, the light of all rays
    """
    height = top.row[TOP]
    least = ray_share * _whole_power(source) / (lattice.shape[0] * lattice.shape[1])
    n = 0
    for a in range(lattice.shape[0]):
        for b in range(lattice.shape[1]):
            cell = lattice[a, b]
            echoes[a, b, POWER] = 0.0
            echoes[a, b, KIND] = LOST
            parts = parts_of(cell, source, box)
            if parts == 1:
                n += 1
                _follow(
                    n, cell, source, receivers, shift, height, least, 1, layout, box, top, out, echoes[a, b]
                )
                continue
            share = (cell[U1] - cell[U0]) * (cell[V1] - cell[V0]) / parts**2
            for part in range(parts * parts):
                n += 1
                u = cell[U0] + (part // parts + offset[0]) / parts * (cell[U1] - cell[U0])
                v = cell[V0] + (part % parts + offset[1]) / parts * (cell[V1] - cell[V0])
                p[SECTOR] = cell[SECTOR]
                p[TOUCHED] = cell[TOUCHED]
                put_on_top(p, u, v, share, sectors, top)
                _follow(
                    n, p, source, receivers, shift, height, least, parts, layout, box, top, out, echoes[a, b]
                )


@kernel
def _follow(
    n: int, p: FloatArray, source: FloatArray, receivers: FloatArray, shift: FloatArray, height: float, least: float,
    parts: int, layout: IntArray, box: FloatArray, top: Top, out: FloatArray, found: FloatArray,
) -> None:  # fmt: skip
    """Add to `out` the change of light on patches by the n-th ray, to a point in one of a cell's parts² pieces.

    The ray's end is stored in `found` (5,), with its power multiplied to that of the whole cell, if `found` is empty,
    or if the ray is mirrored again and brighter than the stored one. In the contact, `found` sums the light of all
    rays.
    """
    one, two = golden_pair(n, shift[0], shift[1])
    along = source[1] + source[3] * (2.0 * one - 1.0)
    up = source[2] + source[4] * (2.0 * two - 1.0)
    ex, ey, ez = wall_point(int(source[0]), along, up, box)
    if ez >= surface_height(ex, ey, top):
        return
    luck = THIRD_TURN * n + shift[0] + shift[1]
    luck -= math.floor(luck)
    weight, dx, dy, dz, cos_in = first_leg(p, ex, ey, ez, source, box, top, least, luck)
    if weight == 0.0:
        return
    if p[TOUCHED] == 0.0:
        kind, x, y, z, _, _, _, left, tops, _ = echo(p, dx, dy, dz, cos_in, box, top)
        power = weight * left * parts * parts
        if found[POWER] == 0.0 or (tops > 0 and (found[TOPS] == 0.0 or power > found[POWER])):
            found[POWER] = power
            found[KIND] = kind
            found[ALONG] = x if kind == 0 or kind == 2 else y
            found[UP] = z
            found[TOPS] = tops
        if p[FLAT] == 1.0 and tops == 0 and kind != TIP:
            return  # the undisturbed top mirrors it to the same point
        if kind >= 0 and (kind >= BOTTOM or receiver_at(kind, x, y, z, receivers) < 0):
            add_deposit(kind, x, y, z, weight * left, layout, box, top, out)
    else:
        found[POWER] += weight
        found[KIND] = TIP
        add_deposit(TIP, p[PX], p[PY], p[PZ], weight, layout, box, top, out)
    gone = weight
    if box[4] > 0.0:
        gone *= math.exp(box[4] * math.sqrt((p[PX] - ex) ** 2 + (p[PY] - ey) ** 2 + (p[PZ] - ez) ** 2))
    kind, x, y, z, left = _untouched_fate(ex, ey, ez, dx, dy, dz, height, box)
    if kind >= 0 and (kind == BOTTOM or receiver_at(kind, x, y, z, receivers) < 0):
        add_deposit(kind, x, y, z, -gone * left, layout, box, top, out)
