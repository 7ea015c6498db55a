"""Kernels: light that walls, bottom and tip scatter more than once.

With first deposits g of an emitter and t of a receiver, reflectances R and the share K of one patch's scattered light
that lands on another, all orders together are

    flux = sum over patches of  R x (Q g) x t x A_r / A_patch,    Q = (I - (R K)^T)^-1.

g and t are the pressed pad's; K is the untouched pad's: what the dimple does to light on its way from patch to patch is
left out. On a tip that reflects g and t hold, besides first deposits, what walls and bottom scatter on it in the
pressed pad, after all their orders; light that a tip scatters twice is left out.

A tip's patches are wide beside parts 2 mm away, where joining their sums made its light 9 % too bright. What emitters
send it and receivers take of it first hand is therefore joined cell by cell of the lattice that it was summed on, both
by the same point, or over the cell's area where it is divided for a part near to it. The patches keep what comes by way
of the top, walls and bottom.
"""

from __future__ import annotations

import math

import numpy as np

from design.arrays import FloatArray, IntArray
from sims.optics.engine.scattered.diffuse import (
    TIP_RINGS,
    TIP_SECTORS,
    add_deposit,
    follow,
    golden_shift,
    join,
    join_on_tip,
    place_on_tip,
    tip_patch,
    tip_patch_area,
)
from sims.optics.engine.scattered.top_light import AREA, GX, GY, PX, PY, contact_cell_area, parts_of
from sims.optics.engine.straight.rays import BOTTOM, TIP
from sims.optics.kernel_types import Orders, Patches
from sims.optics.surface.radial import array_kernel, kernel, wall_point
from sims.optics.surface.top import Top, surface_gradient

LEAST_AREA_MM2 = 1e-9
TIP_RAYS = 64
"""From each patch of a tip that reflects, back to walls and bottom: 2 % of what these scatter on it."""


@array_kernel
def coarsened(
    deposits: FloatArray, layout: IntArray, coarse: IntArray, box: FloatArray, top: Top
) -> FloatArray:
    """(source, coarse patch) deposits on walls and bottom, moved to patches of a coarser layout; none on the tip."""
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
    """(source, patch) deposits of the orders beyond the first: row n of `transfer` is what a deposit on n becomes."""
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
    """A direction from the top down into the pad, by the cosine to its normal there (gx, gy, -1)."""
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
    """(coarse patch, tip patch) share of a patch's scattered light that lands on the tip, by rays from there back."""
    coarse, areas, _ = orders
    first = coarse[TIP, 2]
    out = np.zeros((first, TIP_RINGS * TIP_SECTORS))
    found = np.empty(first + TIP_RINGS * TIP_SECTORS)
    seen = np.zeros(receivers.shape[0])
    area = tip_patch_area(0, top.rows)
    for m in range(out.shape[1]):
        for n in range(found.shape[0]):
            found[n] = 0.0
        for k in range(TIP_RAYS):
            point = golden_shift(m * TIP_RAYS + k + 1.0)
            x, y = place_on_tip(m, point[0], point[1], 0, top.rows)
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
    """(source, patch) deposits, and on the tip also what first and higher deposits on walls and bottom (source, coarse
    patch) bring. By loops: Numba takes seconds to compile sums and copies of arrays.
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
    """(emitter, receiver) what joining first-hand light on the tip by cells of the lattice (row, column, n) adds to its
    join by patches.

    given, taken : (emitter or receiver, row, column) first-hand light on the contact's rows of the lattice
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
        patch = tip_patch(p[PX], p[PY], layout, 0, top.rows) - layout[TIP, 2]
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
    per_patch = 1.0 / max(tip_patch_area(0, top.rows), LEAST_AREA_MM2)
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
    """(2, emitter, receiver) scattered flux of all orders, without the tip and by way of it, from first deposits
    (source, patch).

    patches: layout and areas of the deposits' patches; orders: layout, areas and transfer of the higher orders' ones;
    on_tip: `shares_on_tip`, or (0, 0) where no tip reflects.
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
