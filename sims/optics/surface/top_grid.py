"""Kernels: the top in cells of (u, v) around every tip.

A tip owns the part of the box that is nearer to it than to any other, a convex polygon. Each edge of it spans a
sector: v runs along the edge, u from the contact edge (0) to it (1) with r = a + (r_edge(v) - a) u², so that cells are
narrow at the contact edge. A grid has the same number of rings everywhere and one run of columns per tip.
"""

from __future__ import annotations

import math

import numpy as np

from design.arrays import FloatArray
from sims.optics.surface.curves import ACTIVE, CONTACT_R, X, Y
from sims.optics.surface.radial import array_kernel, contact_radius_2, kernel
from sims.optics.surface.top import Top, surface_bend, surface_gradient

# columns of a sector row
AX, AY, BX, BY, SPAN, TIP = range(6)
# columns of a node row
NX, NY, NZ, GX, GY, HXX, HXY, HYY = range(8)
NODE_COLUMNS = 8
MOST_EDGES = 12
FEWEST_COLUMNS = 3


@kernel
def _cell_of_tip(tip: int, top: Top, box: FloatArray, corners: FloatArray, other: FloatArray) -> int:
    """Corners (n, 2) of the part of the box nearest to a tip; their number."""
    corners[0, 0], corners[0, 1] = 0.0, 0.0
    corners[1, 0], corners[1, 1] = box[0], 0.0
    corners[2, 0], corners[2, 1] = box[0], box[1]
    corners[3, 0], corners[3, 1] = 0.0, box[1]
    n = 4
    x = top.rows[tip, X]
    y = top.rows[tip, Y]
    for k in range(top.rows.shape[0]):
        if k == tip or top.rows[k, ACTIVE] == 0.0:
            continue
        dx = top.rows[k, X] - x
        dy = top.rows[k, Y] - y
        half = 0.5 * (dx * dx + dy * dy)
        kept = 0
        for c in range(n):
            d = c + 1 if c + 1 < n else 0
            fc = half - (corners[c, 0] - x) * dx - (corners[c, 1] - y) * dy
            fd = half - (corners[d, 0] - x) * dx - (corners[d, 1] - y) * dy
            if fc >= 0.0:
                other[kept, 0] = corners[c, 0]
                other[kept, 1] = corners[c, 1]
                kept += 1
            if (fc >= 0.0) != (fd >= 0.0):
                t = fc / (fc - fd)
                other[kept, 0] = corners[c, 0] + t * (corners[d, 0] - corners[c, 0])
                other[kept, 1] = corners[c, 1] + t * (corners[d, 1] - corners[c, 1])
                kept += 1
        n = kept
        for c in range(n):
            corners[c, 0] = other[c, 0]
            corners[c, 1] = other[c, 1]
    return n


@array_kernel
def sectors_of(top: Top, box: FloatArray) -> FloatArray:
    """(sector, 6) start of each edge and vector to its end, both from the axis; angle; tip. Sorted by tip.

    Where no tip touches, the first one's axis serves as the middle of the grid.
    """
    corners = np.empty((MOST_EDGES, 2))
    other = np.empty((MOST_EDGES, 2))
    out = np.empty((top.rows.shape[0] * MOST_EDGES, 6))
    found = 0
    for tip in range(top.rows.shape[0]):
        if top.rows[tip, ACTIVE] == 0.0 and not (tip == 0 and top.rows[:, ACTIVE].max() == 0.0):
            continue
        n = _cell_of_tip(tip, top, box, corners, other)
        for c in range(n):
            d = c + 1 if c + 1 < n else 0
            ax = corners[c, 0] - top.rows[tip, X]
            ay = corners[c, 1] - top.rows[tip, Y]
            bx = corners[d, 0] - top.rows[tip, X]
            by = corners[d, 1] - top.rows[tip, Y]
            out[found, AX] = ax
            out[found, AY] = ay
            out[found, BX] = bx - ax
            out[found, BY] = by - ay
            out[found, SPAN] = math.atan2(ax * by - ay * bx, ax * bx + ay * by)
            out[found, TIP] = tip
            if out[found, SPAN] > 1e-9:
                found += 1
    return out[:found]


@kernel
def place_on_top(
    sector: int, u: float, v: float, sectors: FloatArray, top: Top
) -> tuple[float, float, float, float]:
    """Place (x, y) of (u, v), its radius, and the plan area per du dv."""
    wx = sectors[sector, AX] + v * sectors[sector, BX]
    wy = sectors[sector, AY] + v * sectors[sector, BY]
    reach2 = wx * wx + wy * wy
    reach = math.sqrt(reach2)
    turn = (wx * sectors[sector, BY] - wy * sectors[sector, BX]) / reach2
    tip = int(sectors[sector, TIP])
    inner = top.rows[tip, CONTACT_R]
    span = max(reach - inner, 0.0)
    r = inner + span * u * u
    x = top.rows[tip, X] + r * wx / reach
    y = top.rows[tip, Y] + r * wy / reach
    return x, y, r, r * 2.0 * span * u * turn


@kernel
def place_in_contact(
    sector: int, s: float, v: float, sectors: FloatArray, top: Top
) -> tuple[float, float, float]:
    """Place (x, y) in a tip's contact, s from the axis (0) to the edge (1) by area, and the plan area per ds dv."""
    wx = sectors[sector, AX] + v * sectors[sector, BX]
    wy = sectors[sector, AY] + v * sectors[sector, BY]
    reach2 = wx * wx + wy * wy
    turn = (wx * sectors[sector, BY] - wy * sectors[sector, BX]) / reach2
    tip = int(sectors[sector, TIP])
    r2, growth = contact_radius_2(s, tip, top.rows)
    share = math.sqrt(r2 / reach2)
    x = top.rows[tip, X] + share * wx
    y = top.rows[tip, Y] + share * wy
    return x, y, 0.5 * growth * turn


@kernel
def top_point(
    sector: int, u: float, v: float, sectors: FloatArray, top: Top
) -> tuple[float, float, float, float, float, float, float]:
    """Point of the top, dh/dx, dh/dy, radius, and the plan area per du dv."""
    x, y, r, area = place_on_top(sector, u, v, sectors, top)
    h, gx, gy = surface_gradient(x, y, top)
    return x, y, h, gx, gy, r, area


@array_kernel
def columns_of(columns: float, phase: float, sectors: FloatArray) -> FloatArray:
    """(column, 5) sector, v where it starts, v where it ends, previous column, next column (round the tip).

    The phase, 0 to 1, moves the inner borders of each sector's columns.
    """
    counts = np.empty(sectors.shape[0], np.int64)
    for k in range(sectors.shape[0]):
        counts[k] = max(FEWEST_COLUMNS, round(columns * sectors[k, SPAN] / (2.0 * math.pi)))
    out = np.empty((counts.sum(), 5))
    n = 0
    first = 0
    for k in range(sectors.shape[0]):
        if k > 0 and sectors[k, TIP] != sectors[k - 1, TIP]:
            first = n
        for b in range(counts[k]):
            out[n, 0] = k
            out[n, 1] = (b + phase - 0.5) / counts[k] if b > 0 else 0.0
            out[n, 2] = (b + phase + 0.5) / counts[k] if b + 1 < counts[k] else 1.0
            out[n, 3] = n - 1
            out[n, 4] = n + 1
            n += 1
        if k + 1 == sectors.shape[0] or sectors[k + 1, TIP] != sectors[k, TIP]:
            out[first, 3] = n - 1
            out[n - 1, 4] = first
    return out


@kernel
def ring_edge(ring: int, rings: int, phase: float) -> float:
    """u of a ring's inner border; the phase, 0 to 1, moves all but the first and the last."""
    if ring == 0:
        return 0.0
    if ring == rings:
        return 1.0
    return (ring + phase - 0.5) / rings


@array_kernel
def top_nodes(rings: int, phase: float, columns: FloatArray, sectors: FloatArray, top: Top) -> FloatArray:
    """(ring + 1, column, 8) place, height, gradient and second derivatives at every column's start."""
    nodes = np.empty((rings + 1, columns.shape[0], NODE_COLUMNS))
    for b in range(columns.shape[0]):
        for a in range(rings + 1):
            u = ring_edge(a, rings, phase)
            _put_node(nodes[a, b], int(columns[b, 0]), u, columns[b, 1], sectors, top)
    return nodes


@array_kernel
def top_middles(rings: int, phase: float, columns: FloatArray, sectors: FloatArray, top: Top) -> FloatArray:
    """(ring, column, 8) the same in the middle of every cell."""
    nodes = np.empty((rings, columns.shape[0], NODE_COLUMNS))
    for b in range(columns.shape[0]):
        for a in range(rings):
            u = 0.5 * (ring_edge(a, rings, phase) + ring_edge(a + 1, rings, phase))
            v = 0.5 * (columns[b, 1] + columns[b, 2])
            _put_node(nodes[a, b], int(columns[b, 0]), u, v, sectors, top)
    return nodes


@kernel
def _put_node(row: FloatArray, sector: int, u: float, v: float, sectors: FloatArray, top: Top) -> None:
    """Fill a row of `top_nodes`."""
    row[NX], row[NY], _, _ = place_on_top(sector, u, v, sectors, top)
    row[NZ], row[GX], row[GY], row[HXX], row[HXY], row[HYY] = surface_bend(row[NX], row[NY], top)


@kernel
def cell_at(
    x: float, y: float, rings: int, phase: float, columns: FloatArray, sectors: FloatArray, top: Top
) -> tuple[int, int]:
    """Ring and column of the cell that holds a place; (-1, -1) in a contact or outside."""
    for n in range(columns.shape[0]):
        k = int(columns[n, 0])
        tip = int(sectors[k, TIP])
        dx = x - top.rows[tip, X]
        dy = y - top.rows[tip, Y]
        ax = sectors[k, AX] + columns[n, 1] * sectors[k, BX]
        ay = sectors[k, AY] + columns[n, 1] * sectors[k, BY]
        bx = sectors[k, AX] + columns[n, 2] * sectors[k, BX]
        by = sectors[k, AY] + columns[n, 2] * sectors[k, BY]
        one = ax * dy - ay * dx
        two = dx * by - dy * bx
        if one < 0.0 or two < 0.0 or ax * dx + ay * dy < 0.0:
            continue
        v = one / max(one + two, 1e-30)
        wx = ax + v * (bx - ax)
        wy = ay + v * (by - ay)
        reach = math.sqrt(wx * wx + wy * wy)
        r = math.sqrt(dx * dx + dy * dy)
        inner = top.rows[tip, CONTACT_R]
        if r < inner or r > reach:
            continue
        u = math.sqrt((r - inner) / max(reach - inner, 1e-12))
        ring = min(max(int(u * rings + 0.5 - phase), 0), rings - 1)
        return ring, n
    return -1, -1
