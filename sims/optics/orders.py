# mypy: allow-untyped-defs, allow-untyped-calls, allow-untyped-decorators
"""Kernels: light that walls and bottom scatter more than once.

With first deposits g of an emitter and t of a receiver, reflectances R and the share K of one patch's scattered light
that lands on another, all orders together are

    flux = sum over patches of  R x (Q g) x t x A_r / A_patch,    Q = (I - (R K)^T)^-1.

g and t are the pressed pad's; K is the untouched pad's: what the dimple does to light on its way from patch to patch is
left out, and so is what the tip scatters before or after a wall does.
"""

from __future__ import annotations

import numpy as np

from sims.optics.diffuse import add_deposit, join
from sims.optics.radial import array_kernel, wall_point
from sims.optics.rays import BOTTOM, TIP


@array_kernel
def coarsened(deposits, layout, coarse, box, top):
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
def scattered_on(deposits, transfer):
    """(source, patch) deposits of the orders beyond the first: row n of `transfer` is what a deposit on n becomes."""
    out = np.zeros(deposits.shape)
    for n in range(transfer.shape[0]):
        for i in range(deposits.shape[0]):
            power = deposits[i, n]
            if power != 0.0:
                for m in range(transfer.shape[1]):
                    out[i, m] += power * transfer[n, m]
    return out


@array_kernel
def all_orders(given, taken, receivers, patches, reflectances, orders, box, top):
    """(emitter, receiver) scattered flux of all orders from first deposits (source, patch).

    patches: layout and areas of the deposits' patches; orders: layout, areas and transfer of the higher orders' ones.
    """
    layout, areas = patches
    coarse, coarse_areas, transfer = orders
    out = np.zeros((given.shape[0], taken.shape[0]))
    higher = scattered_on(coarsened(given, layout, coarse, box, top), transfer)
    gathered = coarsened(taken, layout, coarse, box, top)
    for j in range(taken.shape[0]):
        area = 4.0 * receivers[j, 3] * receivers[j, 4]
        for i in range(given.shape[0]):
            out[i, j] = join(given[i], taken[j], area, areas, layout, reflectances, top) + join(
                higher[i], gathered[j], area, coarse_areas, coarse, reflectances, top
            )
    return out
