# mypy: no-warn-return-any
"""Kernels: light that is scattered more than once, or mirrored more than once by the deformed top.

Scattered more than once
------------------------
Walls, bottom and tip are divided into patches. Rays deposit an emitter's light g on them, and by reciprocity a
receiver's light t. With reflectances R, and K the share of one patch's scattered light that lands on another, the light
scattered any number of times is

    flux = sum over patches of  R x (Q g) x t x A_r / A_patch,    Q = (I - (R K)^T)^-1.

g and t are computed for the pressed pad. K is that of the untouched pad, so the dimple's effect on light from patch to
patch is left out. On a reflecting tip, g and t include the light that walls and bottom scatter there in the pressed
pad. Light that a tip scatters twice is left out.

The tip's patches are too wide for emitters and receivers 2 mm away: they made their light 9 % too bright. So light that
comes straight from an emitter to the tip and goes straight to a receiver is summed over the much smaller cells of the
sampling grid on the top. All other light uses the patches.

Mirrored more than once
-----------------------
Light that is mirrored twice or more and ends at a receiver is first mirrored in small islands of the top. Rays of
`optopad.sims.optics.engine.scattered` show roughly where these are. There, cells of the grid are divided, guided by the
paths from the emitter's centre by way of the cell's corners to the walls. A cell is dropped if these paths do not end
near a requested receiver. It is divided if they end far apart, on different walls or after different numbers of
reflections. Else it is kept. Each kept cell has at least one point per replicate, and more if it carries much power;
each point has three rays from points evenly spread over the emitter. The *unit* of a receiver is the largest power that
one point may represent near it.

A ray counts for the receiver on which it ends. An island that the rays of all replicates miss is left out.
"""

from __future__ import annotations

import math

import numpy as np

from optopad.design.arrays import FloatArray, IntArray
from optopad.sims.optics.engine.scattered import (
    ALONG,
    AREA,
    ECHO_COLUMNS,
    GX,
    GY,
    KIND,
    POWER,
    PX,
    PY,
    SECTOR,
    TIP_RINGS,
    TIP_SECTORS,
    TOPS,
    U0,
    U1,
    UP,
    V0,
    V1,
    add_deposit,
    contact_cell_area,
    first_free_row,
    follow,
    golden_pair,
    golden_shift,
    join,
    join_on_tip,
    landing,
    parts_of,
    place_on_tip,
    put_point,
    receiver_at,
    tip_patch,
    tip_patch_area,
    unit_there,
)
from optopad.sims.optics.engine.straight import BOTTOM, TIP
from optopad.sims.optics.kernel_types import Orders, Patches
from optopad.sims.optics.surface.radial import array_kernel, kernel, radiance, wall_point
from optopad.sims.optics.surface.tops import Top, surface_gradient

LEAST_AREA_MM2 = 1e-9
TIP_RAYS = 64
"""Rays from each patch of a reflecting tip to walls and bottom: they give an error of 2 % of the light that the tip
scatters."""


@array_kernel
def coarsened(
    deposits: FloatArray, layout: IntArray, coarse: IntArray, box: FloatArray, top: Top
) -> FloatArray:
    """(source, coarse patch) light on walls and bottom, transferred from fine to coarser patches; 0 on the tip."""
    out = np.zeros((deposits.shape[0], coarse[TIP, 2] + coarse[TIP, 0] * coarse[TIP, 1]))
    for k in range(TIP):
        across = (box[0] if k == 0 or k == 2 or k == BOTTOM else box[1]) / layout[k, 0]
        up = (box[1] if k == BOTTOM else box[2]) / layout[k, 1]
        for b in range(layout[k, 1]):
            for a in range(layout[k, 0]):
                n = layout[k, 2] + b * layout[k, 0] + a
                s = (a + 0.5) * across
                t = (b + 0.5) * up
                x, y, z = (s, t, 0.0) if k == BOTTOM else wall_point(k, s, t, box)
                for i in range(deposits.shape[0]):
                    if deposits[i, n] != 0.0:
                        add_deposit(k, x, y, z, deposits[i, n], coarse, box, top, out[i])
    return out


@array_kernel
def scattered_on(deposits: FloatArray, transfer: FloatArray) -> FloatArray:
    """(source, patch) light on patches after scattering; row n of `transfer` is where unit light on patch n goes."""
    out = np.zeros(deposits.shape)
    for n in range(transfer.shape[0]):
        for i in range(deposits.shape[0]):
            power = deposits[i, n]
            if power != 0.0:
                for m in range(transfer.shape[1]):
                    out[i, m] += power * transfer[n, m]
    return out


@kernel
def _cosine_direction(one: float, two: float, gx: float, gy: float) -> tuple[float, float, float]:
    """Direction from the top into the pad, Lambertian about (gx, gy, -1), by random numbers `one`, `two` in 0 to 1."""
    slope = math.sqrt(gx * gx + gy * gy)
    norm = 1.0 / math.sqrt(1.0 + slope * slope)
    ux = gx / slope if slope > 0.0 else 1.0
    uy = gy / slope if slope > 0.0 else 0.0
    out = math.sqrt(one)
    side = math.sqrt(1.0 - one)
    along = side * math.cos(2.0 * math.pi * two)
    across = side * math.sin(2.0 * math.pi * two)
    # normal (ux s, uy s, -1) n, up the slope (ux, uy, s) n, level (-uy, ux, 0)
    plan = (out * slope + along) * norm
    return plan * ux - across * uy, plan * uy + across * ux, (along * slope - out) * norm


@array_kernel
def shares_on_tip(receivers: FloatArray, orders: Orders, box: FloatArray, top: Top) -> FloatArray:
    """(coarse patch, tip patch) share of a patch's scattered light that lands on the tip, by rays from the tip."""
    coarse, areas, _ = orders
    first = coarse[TIP, 2]
    out = np.zeros((first, TIP_RINGS * TIP_SECTORS))
    found = np.empty(first + TIP_RINGS * TIP_SECTORS)
    seen = np.zeros(receivers.shape[0])
    area = tip_patch_area(top.row)
    for m in range(out.shape[1]):
        for n in range(found.shape[0]):
            found[n] = 0.0
        for k in range(TIP_RAYS):
            point = golden_shift(m * TIP_RAYS + k + 1.0)
            x, y = place_on_tip(m, point[0], point[1], top.row)
            z, gx, gy = surface_gradient(x, y, top)
            dx, dy, dz = _cosine_direction(point[2], point[3], gx, gy)
            norm = 1e-9 / math.sqrt(1.0 + gx * gx + gy * gy)
            follow(x + gx * norm, y + gy * norm, z - norm, dx, dy, dz, 1.0 / TIP_RAYS, True, receivers, coarse,
                   box, top, found, seen)  # fmt: skip
        for n in range(first):
            if areas[n] > 0.0:
                out[n, m] = found[n] * area / areas[n]
    return out


@array_kernel
def with_walls_on_tip(
    deposits: FloatArray, first: FloatArray, higher: FloatArray, layout: IntArray, coarse: IntArray,
    reflectances: FloatArray, shares: FloatArray,
) -> FloatArray:  # fmt: skip
    """(source, patch) light on patches, increased on the tip by the light that walls and bottom scatter onto it.

    first, higher : (source, coarse patch) light on walls and bottom, before and after scattering

    Loops are used, as Numba takes seconds to compile sums and copies of arrays.
    """
    out = np.zeros(deposits.shape)
    for i in range(deposits.shape[0]):
        for n in range(deposits.shape[1]):
            out[i, n] = deposits[i, n]
    for k in range(TIP):
        for n in range(coarse[k, 2], coarse[k + 1, 2]):
            for i in range(deposits.shape[0]):
                power = (first[i, n] + higher[i, n]) * reflectances[k]
                if power != 0.0:
                    for m in range(shares.shape[1]):
                        out[i, layout[TIP, 2] + m] += power * shares[n, m]
    return out


@array_kernel
def first_hand_on_tip(
    given: FloatArray, taken: FloatArray, lattice: FloatArray, sectors: FloatArray, emitters: FloatArray,
    receivers: FloatArray, reflectance: float, layout: IntArray, box: FloatArray, top: Top,
) -> FloatArray:  # fmt: skip
    """(emitter, receiver) correction of light from emitter to tip to receiver: sum over cells less sum over patches.

    given, taken : (emitter, row, column) and (receiver, row, column) light on the grid's cells in the contact
    lattice : (row, column, n) the grid
    """
    out = np.zeros((given.shape[0], taken.shape[0]))
    if given.shape[1] == 0:
        return out
    columns = given.shape[2]
    sums_e = np.zeros((given.shape[0], TIP_RINGS * TIP_SECTORS))
    sums_r = np.zeros((taken.shape[0], TIP_RINGS * TIP_SECTORS))
    for cell in range(given.shape[1] * columns):
        a = cell // columns
        b = cell % columns
        p = lattice[a, b]
        at_point = 1.0 / max(p[AREA] * math.sqrt(1.0 + p[GX] * p[GX] + p[GY] * p[GY]), LEAST_AREA_MM2)
        at_cell = 1.0 / max(contact_cell_area(p, given.shape[1], sectors, top), LEAST_AREA_MM2)
        patch = tip_patch(p[PX], p[PY], layout, top.row) - layout[TIP, 2]
        for j in range(taken.shape[0]):
            sums_r[j, patch] += taken[j, a, b]
        for i in range(given.shape[0]):
            if given[i, a, b] == 0.0:
                continue
            sums_e[i, patch] += given[i, a, b]
            is_divided = parts_of(p, emitters[i], box) > 1
            for j in range(taken.shape[0]):
                if taken[j, a, b] > 0.0:
                    by_point = not is_divided and parts_of(p, receivers[j], box) == 1
                    out[i, j] += given[i, a, b] * taken[j, a, b] * (at_point if by_point else at_cell)
    per_patch = 1.0 / max(tip_patch_area(top.row), LEAST_AREA_MM2)
    for i in range(given.shape[0]):
        for j in range(taken.shape[0]):
            for patch in range(sums_e.shape[1]):
                out[i, j] -= sums_e[i, patch] * sums_r[j, patch] * per_patch
            out[i, j] *= reflectance * 4.0 * receivers[j, 3] * receivers[j, 4]
    return out


@array_kernel
def all_orders(
    given: FloatArray, taken: FloatArray, receivers: FloatArray, patches: Patches, reflectances: FloatArray,
    orders: Orders, on_tip: FloatArray, box: FloatArray, top: Top,
) -> FloatArray:  # fmt: skip
    """(2, emitter, receiver) flux scattered once or more often: not by the tip, and by the tip.

    given, taken : (source, patch) light on patches before any scattering, from emitters and from receivers
        (reciprocity)
    patches : layout and areas of these patches
    orders : layout, areas and transfer of the coarser patches for light scattered more than once
    on_tip : result of `shares_on_tip`; shape (0, 0) if no tip reflects
    """
    layout, areas = patches
    coarse, coarse_areas, transfer = orders
    out = np.zeros((2, given.shape[0], taken.shape[0]))
    first = coarsened(given, layout, coarse, box, top)
    higher = scattered_on(first, transfer)
    gathered = coarsened(taken, layout, coarse, box, top)
    if on_tip.shape[0] > 0:
        given = with_walls_on_tip(given, first, higher, layout, coarse, reflectances, on_tip)
        back = scattered_on(gathered, transfer)
        taken = with_walls_on_tip(taken, gathered, back, layout, coarse, reflectances, on_tip)
    for j in range(taken.shape[0]):
        area = 4.0 * receivers[j, 3] * receivers[j, 4]
        for i in range(given.shape[0]):
            out[0, i, j] = join(given[i], taken[j], area, areas, layout, reflectances) + join(
                higher[i], gathered[j], area, coarse_areas, coarse, reflectances
            )
            out[1, i, j] = join_on_tip(given[i], taken[j], area, layout, reflectances, top)
    return out


# columns of a cell: borders, halvings, then the ends of its corners' paths, with the power per unit of (u, v):
# (low u, low v), (low u, high v), (high u, low v), (high u, high v)
LOW_U, HIGH_U, LOW_V, HIGH_V, LEVEL, CORNERS = range(6)
CELL_COLUMNS = CORNERS + 4 * ECHO_COLUMNS
DROP, DIVIDE, KEEP = range(3)
UNKNOWN = -1.0
"""Stands for the power at a cell's corner through which no path has been traced yet."""

STEP_MM = 1.0
"""A cell is not divided further if the paths by way of its corners end within this distance of each other [mm]."""
CURVE = 0.15
"""Share of the distance between the ends of a cell's corner paths by which light from inside the cell may end beyond
them."""
MIXED_MM = 2.0
"""Distance by which light may end beyond a cell's corner paths, in addition, if these end on different walls or after
different numbers of reflections [mm]."""
DEEPEST, DEEPEST_MIXED, DEEPEST_UNSEEN = 6, 4, 2
"""Largest number of halvings of a cell: in general; if its corner paths end on different walls or after different
numbers of reflections; and if only the emitter's edges light it."""
KEPT_UNITS = 4.0
"""A cell is not divided further if its power is less than this many times the power that one sample may represent:
samples cost less than the corner paths of its quarters."""
MOST_PARTS = 4.0
"""Largest number of pieces, along each side, into which a sampled cell is divided; each piece has one sample."""
STACK = 3 * DEEPEST + 4
BLUR_MM = 4.0
"""Distance from the end of the ray from the emitter's centre within which light from the emitter's edges is searched
for [mm]. With a smaller distance up to 0.3 % of a pair's signal was missed."""


@kernel
def power_near(
    a: int, b: int, first: int, columns: FloatArray, echoes: FloatArray, receivers: FloatArray, units: FloatArray,
) -> tuple[float, float]:  # fmt: skip
    """Largest power of rays by way of a cell or its neighbours, mirrored again, that end near a requested receiver.

    first : first row of the grid that is not in the contact
    units : (receiver,) power that one sample may represent near it

    Returns
    -------
    largest power in all replicates: 0 if no such ray ends near a requested receiver, negative if no ray is mirrored
    again; and that receiver's entry in `units`
    """
    most = 0.0
    unit = 0.0
    is_lit = False
    for wall in range(4):
        power = 0.0
        low_s = low_z = 1e9
        high_s = high_z = -1e9
        for near in range(3):
            c = b if near == 0 else int(columns[b, 2 + near])
            for d in range(max(a - 1, first), min(a + 2, echoes.shape[1])):
                for n in range(echoes.shape[0]):
                    echo = echoes[n, d, c]
                    if echo[POWER] > 0.0 and echo[TOPS] > 0.0:
                        is_lit = True
                        if echo[KIND] == wall:
                            power = max(power, echo[POWER])
                            low_s = min(low_s, echo[ALONG])
                            high_s = max(high_s, echo[ALONG])
                            low_z = min(low_z, echo[UP])
                            high_z = max(high_z, echo[UP])
        if power > most:
            there = unit_there(
                wall,
                low_s - MIXED_MM,
                high_s + MIXED_MM,
                low_z - MIXED_MM,
                high_z + MIXED_MM,
                receivers,
                units,
            )
            if there > 0.0:
                most = power
                unit = there
    return (most if is_lit else -1.0), unit


@kernel
def corner(cell: FloatArray, c: int, column: int) -> float:
    """Value in a column of the stored end of the path from the emitter's centre by way of a cell's corner c."""
    return cell[CORNERS + c * ECHO_COLUMNS + column]


@kernel
def put_echo(cell: FloatArray, c: int, echo: FloatArray) -> None:
    """Store the end of a path in a cell, as that of the path by way of its corner c."""
    for k in range(ECHO_COLUMNS):
        cell[CORNERS + c * ECHO_COLUMNS + k] = echo[k]


@kernel
def put_corner(
    echo: FloatArray, sector: int, u: float, v: float, source: FloatArray, sectors: FloatArray, box: FloatArray,
    top: Top, p: FloatArray,
) -> None:  # fmt: skip
    """Fill `echo` with the end of the path from the emitter's centre by way of the top at (u, v).

    Its power is 0 unless the path is mirrored again and ends on a wall.
    """
    put_point(p, sector, u, v, sectors, top)
    power, kind, s, z, tops, _, _ = landing(p, source[1], source[2], source, box, top)
    is_on = power > 0.0 and tops > 0 and 0 <= kind < 4
    echo[POWER] = power if is_on else 0.0
    echo[KIND] = kind
    echo[ALONG] = s
    echo[UP] = z
    echo[TOPS] = tops


@kernel
def _bounds(cell: FloatArray, wall: int) -> tuple[int, bool, float, float, float, float]:
    """Number of a cell's corner paths that end on a wall, whether with equally many reflections, box of their ends."""
    count = 0
    is_alike = True
    tops = 0.0
    low_s = low_z = 1e9
    high_s = high_z = -1e9
    for c in range(4):
        if corner(cell, c, POWER) > 0.0 and corner(cell, c, KIND) == wall:
            low_s = min(low_s, corner(cell, c, ALONG))
            high_s = max(high_s, corner(cell, c, ALONG))
            low_z = min(low_z, corner(cell, c, UP))
            high_z = max(high_z, corner(cell, c, UP))
            is_alike = is_alike and (count == 0 or tops == corner(cell, c, TOPS))
            tops = corner(cell, c, TOPS)
            count += 1
    return count, is_alike, low_s, high_s, low_z, high_z


@kernel
def fate_of(
    cell: FloatArray, unseen: float, unseen_unit: float, receivers: FloatArray, units: FloatArray
) -> tuple[int, int]:
    """Whether to drop, divide or sample a cell, and the number of pieces along each side of a sampled cell.

    unseen : power that the emitter's edges may send by way of the undivided cell where the emitter's centre sends none
    unseen_unit : power that one sample of this unseen light may represent
    units : (receiver,) power that one sample may represent near each receiver
    """
    brightest = max(
        max(corner(cell, 0, POWER), corner(cell, 1, POWER)),
        max(corner(cell, 2, POWER), corner(cell, 3, POWER)),
    )
    if brightest == 0.0:
        if cell[LEVEL] == 0.0:
            return DIVIDE, 1
        if unseen == 0.0:
            return DROP, 1
        power = unseen * 0.25 ** cell[LEVEL]
        is_kept = cell[LEVEL] >= DEEPEST_UNSEEN or power < unseen_unit
        return (KEEP if is_kept else DIVIDE), _parts(power, unseen_unit)
    unit = 0.0
    is_whole = False
    size = 0.0
    for wall in range(4):
        count, is_alike, low_s, high_s, low_z, high_z = _bounds(cell, wall)
        if count == 0:
            continue
        size = max(high_s - low_s, high_z - low_z)
        is_whole = count == 4 and is_alike
        margin = BLUR_MM + (CURVE * size if is_whole else MIXED_MM + size)
        there = unit_there(
            wall, low_s - margin, high_s + margin, low_z - margin, high_z + margin, receivers, units
        )
        if there > 0.0 and (unit == 0.0 or there < unit):
            unit = there
    if unit == 0.0:
        return DROP, 1
    power = brightest * (cell[HIGH_U] - cell[LOW_U]) * (cell[HIGH_V] - cell[LOW_V])
    is_kept = (
        power < KEPT_UNITS * unit
        or (is_whole and size <= STEP_MM)
        or cell[LEVEL] >= (DEEPEST if is_whole else DEEPEST_MIXED)
    )
    return (KEEP if is_kept else DIVIDE), _parts(power, unit)


@kernel
def _parts(power: float, unit: float) -> int:
    """Number of pieces along each side of a cell, so that a sample in each represents a power of at most `unit`."""
    return int(min(max(math.ceil(math.sqrt(power / unit)), 1.0), MOST_PARTS))


@kernel
def put_first(
    cell: FloatArray, root: tuple[int, float, float, float, float], next_column: int, a: int, b: int,
    known: FloatArray, source: FloatArray, sectors: FloatArray, box: FloatArray, top: Top, p: FloatArray,
) -> None:  # fmt: skip
    """Fill a cell with ring a and column b of the grid; `known` (ring, column, 5) holds the ends found so far."""
    sector, low_u, high_u, low_v, high_v = root
    cell[LOW_U] = low_u
    cell[HIGH_U] = high_u
    cell[LOW_V] = low_v
    cell[HIGH_V] = high_v
    cell[LEVEL] = 0.0
    for c in range(4):
        echo = known[a + c // 2, b if c % 2 == 0 else next_column]
        if echo[POWER] == UNKNOWN:
            put_corner(
                echo,
                sector,
                low_u if c < 2 else high_u,
                low_v if c % 2 == 0 else high_v,
                source,
                sectors,
                box,
                top,
                p,
            )
        put_echo(cell, c, echo)


@kernel
def divide(
    cells: FloatArray, n: int, sector: int, source: FloatArray, sectors: FloatArray, box: FloatArray, top: Top,
    p: FloatArray, nine: FloatArray,
) -> None:  # fmt: skip
    """Replace cells[n] by its four quarters, in cells[n] to cells[n + 3]."""
    cell = cells[n]
    us = (cell[LOW_U], 0.5 * (cell[LOW_U] + cell[HIGH_U]), cell[HIGH_U])
    vs = (cell[LOW_V], 0.5 * (cell[LOW_V] + cell[HIGH_V]), cell[HIGH_V])
    level = cell[LEVEL] + 1.0
    for a in range(3):
        for b in range(3):
            if a != 1 and b != 1:
                for k in range(ECHO_COLUMNS):
                    nine[a, b, k] = corner(cell, a + b // 2, k)
            else:
                put_corner(nine[a, b], sector, us[a], vs[b], source, sectors, box, top, p)
    for a in range(2):
        for b in range(2):
            part = cells[n + 2 * a + b]
            part[LOW_U] = us[a]
            part[HIGH_U] = us[a + 1]
            part[LOW_V] = vs[b]
            part[HIGH_V] = vs[b + 1]
            part[LEVEL] = level
            for c in range(4):
                put_echo(part, c, nine[a + c // 2, b + c % 2])


RAYS = 3
"""Number of rays by way of a sample, a point of the top. They start at points evenly spread over the emitter."""


@kernel
def add_sample(
    p: FloatArray, one: float, two: float, source: FloatArray, receivers: FloatArray, units: FloatArray,
    box: FloatArray, top: Top, out: FloatArray,
) -> None:  # fmt: skip
    """Add the light by way of a point of the top to out[receiver, (outside, inside the skirt)].

    Its rays start at the emitter's point (one, two), 0 to 1, and at points shifted from there, wrapped at the edges.
    """
    for k in range(RAYS):
        a = one + k / RAYS
        b = two + (RAYS - 1) * k / RAYS
        along = source[1] + source[3] * (2.0 * (a - math.floor(a)) - 1.0)
        up = source[2] + source[4] * (2.0 * (b - math.floor(b)) - 1.0)
        power, kind, s, z, tops, nearest, facing = landing(p, along, up, source, box, top)
        if power <= 0.0 or tops == 0 or kind < 0 or kind > 3:
            continue
        j = receiver_at(kind, s, s, z, receivers)
        if j >= 0 and units[j] > 0.0:
            share = power * math.pi * radiance(receivers[j], facing) / RAYS
            out[j, 1 if nearest < 1.0 else 0] += share


@kernel
def add_samples(
    cell: FloatArray, parts: int, sector: int, count: int, source: FloatArray, receivers: FloatArray,
    units: FloatArray, shifts: FloatArray, sectors: FloatArray, box: FloatArray, top: Top, p: FloatArray,
    out: FloatArray,
) -> int:  # fmt: skip
    """Add a cell's light to out[replicate, receiver, (outside, inside the skirt)], by a point in each of parts² pieces.

    count : number of points used before Returns the number of points used afterwards.
    """
    wide = (cell[HIGH_U] - cell[LOW_U]) / parts
    high = (cell[HIGH_V] - cell[LOW_V]) / parts
    for part in range(parts * parts):
        count += 1
        for n in range(shifts.shape[0]):
            u = cell[LOW_U] + (part // parts + shifts[n, 0]) * wide
            v = cell[LOW_V] + (part % parts + shifts[n, 1]) * high
            put_point(p, sector, u, v, sectors, top)
            p[AREA] *= wide * high
            one, two = golden_pair(count, shifts[n, 2], shifts[n, 2])
            add_sample(p, one, two, source, receivers, units, box, top, out[n])
    return count


@array_kernel
def repeated_reflections(
    source: FloatArray, receivers: FloatArray, units: FloatArray, lattice: FloatArray, echoes: FloatArray,
    columns: FloatArray, shifts: FloatArray, sectors: FloatArray, box: FloatArray, top: Top, p: FloatArray,
    out: FloatArray,
) -> None:  # fmt: skip
    """Add light that the top mirrors twice or more to out[replicate, receiver, (outside, inside the steep skirt)].

    lattice : one replicate's grid of points
    echoes : (replicate, row, column, 5) ends of the rays by way of the grid's points
    shifts : (replicate, 3 or more) position in a cell along u and v, and start of the first ray on the emitter, 0 to 1
    units : (receiver,) power that one sample may represent near each receiver; 0 if the receiver is not requested
    """
    first = first_free_row(lattice)
    rings = lattice.shape[0] - first
    known = np.full((rings + 1, lattice.shape[1], ECHO_COLUMNS), UNKNOWN)
    cells = np.empty((STACK, CELL_COLUMNS))
    nine = np.empty((3, 3, ECHO_COLUMNS))
    count = 0
    for a in range(rings):
        for b in range(lattice.shape[1]):
            unseen, unseen_unit = power_near(a + first, b, first, columns, echoes, receivers, units)
            if unseen < 0.0:
                continue
            root = lattice[a + first, b]
            sector = int(root[SECTOR])
            put_first(cells[0], (sector, root[U0], root[U1], root[V0], root[V1]), int(columns[b, 4]), a, b, known,
                      source, sectors, box, top, p)  # fmt: skip
            n = 1
            while n > 0:
                n -= 1
                fate, parts = fate_of(cells[n], unseen, unseen_unit, receivers, units)
                if fate == DIVIDE:
                    divide(cells, n, sector, source, sectors, box, top, p, nine)
                    n += 4
                elif fate == KEEP:
                    count = add_samples(cells[n], parts, sector, count, source, receivers, units, shifts, sectors,
                                        box, top, p, out)  # fmt: skip
