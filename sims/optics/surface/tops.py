# mypy: no-warn-return-any
"""The pressed top that kernels evaluate: the sum of several tips' curves and of a smooth field.

Model
-----
The top's height above the undisturbed plane is the sum of every tip's radial curve
(`optopad.sims.optics.surface.curves`) and of a smooth bicubic field (`optopad.sims.optics.scene.optical_scene`). The
sum is exact where at most one curve differs from zero. It leaves out the deformation of one tip's dimple under another,
so overlapping steep parts are refused.

Grid
----
Light is sampled on cells of the top in coordinates (u, v) around every tip. A tip owns the polygon of the box that is
nearer to it than to any other tip. Each edge of the polygon spans a sector: v runs along the edge, u from the contact
edge (0) to the polygon's edge (1) with r = a + (r_edge(v) - a) u². So cells are narrow at the contact edge. All tips
have the same rings; each tip has its own columns.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from optopad.design.arrays import FloatArray, IntArray
from optopad.design.errors import InputError, ModelScopeError
from optopad.sims.optics.scene.optical_scene import OpticalScene, SmoothField
from optopad.sims.optics.surface.curves import (
    ACTIVE,
    BLOCKS,
    CELLS,
    COLUMNS,
    CONTACT_R,
    FIELD_COLUMNS,
    OUTER_R,
    PIECE_COLUMNS,
    PIECES,
    SKIRT_R,
    SPHERE_R,
    TOP,
    SurfaceStack,
    X,
    Y,
    lowest_of_pieces_mm,
    node_radii_mm,
    stack_surfaces,
)
from optopad.sims.optics.surface.radial import (
    array_kernel,
    contact_radius_2,
    distance,
    height,
    height_and_slope,
    height_slope_curvature,
    inlined,
    kernel,
)
from optopad.sims.press import Indentation

(
    FIELD_ON, FIELD_X, FIELD_Y, PER_X, PER_Y, FIELD_LOWEST, FIELD_SLOPE, FIELD_BEND, SLACK, BLOCK_X, BLOCK_Y, BLOCK,
) = range(COLUMNS, COLUMNS + 12)  # fmt: skip


class Top(NamedTuple):
    """The top in one state, as kernels read it.

    Attributes
    ----------
    rows : (tip, n) numbers of each tip; see `optopad.sims.optics.surface.curves`. The first row also has, from column
        `FIELD_ON`: 1 if there is a field, else 0; the field's origin [mm], cells per mm along x and y, lowest value (0
        or below) [mm], largest slope [-] and bend [1/mm]; largest amount by which the field and the other tips lower
        the top [mm]; blocks per mm along x and y; lowest value and largest slope around each block (`_blocks`)
    field : (nx, ny, 16) coefficients of u^p v^q in each cell, for u and v from 0 to 1 [mm]; q varies fastest. (0, 0,
        16) without a field
    """

    rows: FloatArray
    field: FloatArray


@inlined
def is_plain(top: Top) -> bool:
    """Whether the top is the curve of one tip only, without a smooth field."""
    return top.rows.shape[0] == 1 and top.rows[0, FIELD_ON] == 0.0


@kernel
def is_touched(top: Top) -> bool:
    """Whether the top differs from the undisturbed plane anywhere."""
    if top.rows[0, FIELD_ON] != 0.0:
        return True
    touched = False
    for k in range(top.rows.shape[0]):
        touched = touched or top.rows[k, ACTIVE] > 0.0
    return touched


@kernel
def touching_tip(x: float, y: float, top: Top) -> tuple[int, float]:
    """Tip in contact at a point (-1: none); smallest distance to a tip's axis, in multiples of its skirt radius."""
    share = 1e30
    tip = -1
    for k in range(top.rows.shape[0]):
        if top.rows[k, ACTIVE] > 0.0:
            r = distance(x - top.rows[k, X], y - top.rows[k, Y])
            if r < top.rows[k, CONTACT_R]:
                tip = k
            share = min(share, r / top.rows[k, SKIRT_R])
    return tip, share


@kernel
def is_beyond(x: float, y: float, top: Top) -> bool:
    """Whether a point is beyond the outer radius of every tip, so that the top without a field is undisturbed there."""
    for k in range(top.rows.shape[0]):
        outer = top.rows[k, OUTER_R] if top.rows[k, ACTIVE] > 0.0 else 0.0
        if distance(x - top.rows[k, X], y - top.rows[k, Y]) < outer:
            return False
    return True


@inlined
def _field_cell(x: float, y: float, top: Top) -> tuple[int, int, float, float]:
    """Cell of the field that contains a point (-1: outside), and the point's fractions within it along x and y."""
    u = (x - top.rows[0, FIELD_X]) * top.rows[0, PER_X]
    v = (y - top.rows[0, FIELD_Y]) * top.rows[0, PER_Y]
    nx = top.field.shape[0]
    ny = top.field.shape[1]
    if not (0.0 <= u <= nx and 0.0 <= v <= ny):
        return -1, -1, 0.0, 0.0
    i = min(int(u), nx - 1)
    j = min(int(v), ny - 1)
    return i, j, u - i, v - j


@inlined
def _cubic(c: FloatArray, k: int, v: float) -> float:
    """Value at v of the cubic whose four coefficients begin at `c[k]`."""
    return c[k] + v * (c[k + 1] + v * (c[k + 2] + v * c[k + 3]))


@inlined
def _cubic_slope(c: FloatArray, k: int, v: float) -> float:
    """Derivative at v of the cubic whose four coefficients begin at `c[k]`."""
    return c[k + 1] + v * (2.0 * c[k + 2] + v * 3.0 * c[k + 3])


@inlined
def field_height(x: float, y: float, top: Top) -> float:
    """Height of the field at a point [mm]; 0 outside the field."""
    i, j, u, v = _field_cell(x, y, top)
    if i < 0:
        return 0.0
    c = top.field[i, j]
    return _cubic(c, 0, v) + u * (_cubic(c, 4, v) + u * (_cubic(c, 8, v) + u * _cubic(c, 12, v)))


@inlined
def field_gradient(x: float, y: float, top: Top) -> tuple[float, float, float]:
    """Height of the field [mm], dh/dx, dh/dy at a point; 0 outside the field."""
    i, j, u, v = _field_cell(x, y, top)
    if i < 0:
        return 0.0, 0.0, 0.0
    c = top.field[i, j]
    b1 = _cubic(c, 4, v)
    b2 = _cubic(c, 8, v)
    b3 = _cubic(c, 12, v)
    height = _cubic(c, 0, v) + u * (b1 + u * (b2 + u * b3))
    along = b1 + u * (2.0 * b2 + u * 3.0 * b3)
    across = _cubic_slope(c, 0, v)
    across += u * (_cubic_slope(c, 4, v) + u * (_cubic_slope(c, 8, v) + u * _cubic_slope(c, 12, v)))
    return height, along * top.rows[0, PER_X], across * top.rows[0, PER_Y]


@inlined
def block_bounds(x: float, y: float, top: Top) -> tuple[float, float]:
    """Lowest value of the field [mm] and its largest slope, within one block's width around the block of a point."""
    i = min(max(int((x - top.rows[0, FIELD_X]) * top.rows[0, BLOCK_X]), 0), BLOCKS - 1)
    j = min(max(int((y - top.rows[0, FIELD_Y]) * top.rows[0, BLOCK_Y]), 0), BLOCKS - 1)
    column = BLOCK + 2 * (BLOCKS * i + j)
    return top.rows[0, column], top.rows[0, column + 1]


@kernel
def _field_bends(x: float, y: float, top: Top) -> tuple[float, float, float]:
    """Second derivatives d2h/dx2, d2h/dxdy, d2h/dy2 of the field at a point [1/mm]; 0 outside the field."""
    i, j, u, v = _field_cell(x, y, top)
    if i < 0:
        return 0.0, 0.0, 0.0
    c = top.field[i, j]
    hxx = 0.0
    hxy = 0.0
    hyy = 0.0
    for p in range(3, -1, -1):
        hyy = hyy * u + 2.0 * c[4 * p + 2] + v * 6.0 * c[4 * p + 3]
        if p > 0:
            hxy = hxy * u + p * _cubic_slope(c, 4 * p, v)
        if p > 1:
            hxx = hxx * u + p * (p - 1) * _cubic(c, 4 * p, v)
    per_x = top.rows[0, PER_X]
    per_y = top.rows[0, PER_Y]
    return hxx * per_x * per_x, hxy * per_x * per_y, hyy * per_y * per_y


@kernel
def surface_height(x: float, y: float, top: Top) -> float:
    """Height of the top above the bottom at a point [mm]."""
    rows = top.rows
    rx = x - rows[0, X]
    ry = y - rows[0, Y]
    h = height(rx * rx + ry * ry, 0, rows)
    if is_plain(top):
        return h
    for k in range(1, rows.shape[0]):
        rx = x - rows[k, X]
        ry = y - rows[k, Y]
        h += height(rx * rx + ry * ry, k, rows) - rows[k, TOP]
    if top.rows[0, FIELD_ON] != 0.0:
        h += field_height(x, y, top)
    return h


@kernel
def surface_gradient(x: float, y: float, top: Top) -> tuple[float, float, float]:
    """Height of the top above the bottom [mm], dh/dx, dh/dy at a point."""
    rows = top.rows
    rx = x - rows[0, X]
    ry = y - rows[0, Y]
    h, per = height_and_slope(rx * rx + ry * ry, 0, rows)
    gx = per * rx
    gy = per * ry
    if is_plain(top):
        return h, gx, gy
    for k in range(1, rows.shape[0]):
        rx = x - rows[k, X]
        ry = y - rows[k, Y]
        more, per = height_and_slope(rx * rx + ry * ry, k, rows)
        h += more - rows[k, TOP]
        gx += per * rx
        gy += per * ry
    if top.rows[0, FIELD_ON] != 0.0:
        more, mx, my = field_gradient(x, y, top)
        h += more
        gx += mx
        gy += my
    return h, gx, gy


@kernel
def _tip_bend(
    x: float, y: float, tip: int, rows: FloatArray
) -> tuple[float, float, float, float, float, float]:
    """Height of one tip's curve at a point, its gradient and second derivatives."""
    rx = x - rows[tip, X]
    ry = y - rows[tip, Y]
    h, turn, bend = height_slope_curvature(rx * rx + ry * ry, tip, rows)
    return h, turn * rx, turn * ry, turn + bend * rx * rx, bend * rx * ry, turn + bend * ry * ry


@kernel
def surface_bend(x: float, y: float, top: Top) -> tuple[float, float, float, float, float, float]:
    """Height of the top above the bottom [mm], dh/dx, dh/dy, d2h/dx2, d2h/dxdy, d2h/dy2 at a point."""
    h, gx, gy, hxx, hxy, hyy = _tip_bend(x, y, 0, top.rows)
    if is_plain(top):
        return h, gx, gy, hxx, hxy, hyy
    for k in range(1, top.rows.shape[0]):
        more, mx, my, mxx, mxy, myy = _tip_bend(x, y, k, top.rows)
        h += more - top.rows[k, TOP]
        gx += mx
        gy += my
        hxx += mxx
        hxy += mxy
        hyy += myy
    if top.rows[0, FIELD_ON] != 0.0:
        more, mx, my = field_gradient(x, y, top)
        mxx, mxy, myy = _field_bends(x, y, top)
        h += more
        gx += mx
        gy += my
        hxx += mxx
        hxy += mxy
        hyy += myy
    return h, gx, gy, hxx, hxy, hyy


# columns of a sector row
AX, AY, BX, BY, SPAN, TIP = range(6)
# columns of a node row
NX, NY, NZ, GX, GY, HXX, HXY, HYY = range(8)
NODE_COLUMNS = 8
MOST_EDGES = 12
FEWEST_COLUMNS = 3


@kernel
def _cell_of_tip(tip: int, top: Top, box: FloatArray, corners: FloatArray, other: FloatArray) -> int:
    """Fill `corners` (n, 2) with the polygon in the box that is nearer to a tip than to others; return their number."""
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
    """(sector, 6) for each edge of a tip's polygon: start relative to the axis, vector to the end, angle, tip number.

    Sectors are sorted by tip. If no tip touches, the grid is centred on the first tip's axis.
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
    """Point (x, y) at coordinates (u, v) of a sector [mm], its radius [mm], and the plan area per du dv [mm²]."""
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
    """Point (x, y) in a tip's contact, and the plan area per ds dv [mm²].

    The coordinate s is the share of the contact's area within the point's radius, from 0 at the axis to 1 at the edge.
    """
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
    """Point (x, y, z) of the top at coordinates (u, v), dh/dx, dh/dy, its radius, and the plan area per du dv [mm²]."""
    x, y, r, area = place_on_top(sector, u, v, sectors, top)
    h, gx, gy = surface_gradient(x, y, top)
    return x, y, h, gx, gy, r, area


@array_kernel
def columns_of(columns: float, phase: float, sectors: FloatArray) -> FloatArray:
    """Divide sectors into columns of about equal angle.

    Parameters
    ----------
    columns : number of columns in a full turn; a sector has at least `FEWEST_COLUMNS`
    phase : shift of the column borders within a sector, in column widths, 0 to 1; at 0.5 all columns are equal
    sectors : (sector, 6) result of `sectors_of`

    Returns
    -------
    (column, 5) number of the sector; v at the column's start and end, 0 to 1 along the sector's edge; numbers of the
    previous and the next column around the tip
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
    """Coordinate u of a ring's inner border; `phase`, 0 to 1, shifts all borders but the first and the last."""
    if ring == 0:
        return 0.0
    if ring == rings:
        return 1.0
    return (ring + phase - 0.5) / rings


@array_kernel
def top_nodes(rings: int, phase: float, columns: FloatArray, sectors: FloatArray, top: Top) -> FloatArray:
    """(ring + 1, column, 8) position, height, gradient and second derivatives of the top at each column's start."""
    nodes = np.empty((rings + 1, columns.shape[0], NODE_COLUMNS))
    for b in range(columns.shape[0]):
        for a in range(rings + 1):
            u = ring_edge(a, rings, phase)
            _put_node(nodes[a, b], int(columns[b, 0]), u, columns[b, 1], sectors, top)
    return nodes


@array_kernel
def top_middles(rings: int, phase: float, columns: FloatArray, sectors: FloatArray, top: Top) -> FloatArray:
    """(ring, column, 8) position, height, gradient and second derivatives of the top in each cell's middle."""
    nodes = np.empty((rings, columns.shape[0], NODE_COLUMNS))
    for b in range(columns.shape[0]):
        for a in range(rings):
            u = 0.5 * (ring_edge(a, rings, phase) + ring_edge(a + 1, rings, phase))
            v = 0.5 * (columns[b, 1] + columns[b, 2])
            _put_node(nodes[a, b], int(columns[b, 0]), u, v, sectors, top)
    return nodes


@kernel
def _put_node(row: FloatArray, sector: int, u: float, v: float, sectors: FloatArray, top: Top) -> None:
    """Fill a row with position, height, gradient and second derivatives of the top at (u, v) of a sector."""
    row[NX], row[NY], _, _ = place_on_top(sector, u, v, sectors, top)
    row[NZ], row[GX], row[GY], row[HXX], row[HXY], row[HYY] = surface_bend(row[NX], row[NY], top)


@kernel
def cell_at(
    x: float, y: float, rings: int, phase: float, columns: FloatArray, sectors: FloatArray, top: Top
) -> tuple[int, int]:
    """Ring and column of the cell that contains a point; (-1, -1) if it is in a contact or outside the grid."""
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


Presses = Sequence[Indentation | Sequence[Indentation | None] | None]
SUBDIVISION = 2
SLOPE_RESERVE, BEND_RESERVE = 1.1, 1.2
_KNOWN: WeakKeyDictionary[SmoothField, FloatArray] = WeakKeyDictionary()
"""Result of `_known_of` for each field that is still referenced."""


@dataclass(frozen=True, kw_only=True)
class TopStack:
    """Tops of all states, as kernels read them.

    Attributes
    ----------
    rows : (state, tip, n) as in `Top`
    field : (state, nx, ny, 4) nodes of the fields (`SmoothField`); (state, 0, 0, 4) if no state has a field
    step_mm : (2,) distance between nodes along x and y [mm]
    """

    rows: FloatArray
    field: FloatArray
    step_mm: FloatArray

    def part(self, states: IntArray) -> tuple[FloatArray, FloatArray]:
        """Arrays `Top.rows` and `Top.field` of some states, each with a leading axis for the state."""
        return self.rows[states], _cells(self.field[states], self.step_mm)


def stack_tops(
    indentations: Presses,
    centres_mm: FloatArray,
    scene: OpticalScene,
    fields: Sequence[SmoothField | None] | None = None,
) -> TopStack:
    """Convert the presses of all states and, if given, a smooth field per state.

    Parameters
    ----------
    indentations : for each state an indentation, None (untouched), or a sequence with one of these for each tip
    centres_mm : (state, 2) or (state, tip, 2) x and y of the press axes [mm]
    fields : for each state a field on the same grid, or None; if omitted, no state has a field

    Raises
    ------
    InputError : shapes do not fit together, a press is outside the block, or a curve or field is invalid.
    ModelScopeError : steep parts of tips overlap, several tips scatter light, or a press is out of scope.
    """
    nested = [_as_tips(one) for one in indentations]
    states = len(nested)
    tips = max((len(one) for one in nested), default=1)
    centres = _centres(centres_mm, states, tips)
    columns = [
        stack_surfaces([one[k] if k < len(one) else None for one in nested], centres[:, k], scene)
        for k in range(tips)
    ]
    rows = np.stack([_packed(column) for column in columns], axis=1)
    if tips > 1:
        rows = _touched_first(rows)
        _check_apart(rows, scene)
    untouched = (rows[:, :, ACTIVE] == 0.0).all(axis=1)
    rows[untouched, 0, X], rows[untouched, 0, Y] = scene.length_mm / 2, scene.width_mm / 2
    field, known, step = _stacked_fields(fields, states)
    rows[:, 0, FIELD_ON : FIELD_ON + FIELD_COLUMNS] = known
    rows[:, 0, SLACK] += _neighbours_depth_mm(rows)
    return TopStack(rows=rows, field=field, step_mm=step)


def _packed(column: SurfaceStack) -> FloatArray:
    """(state, n) rows of one tip, as in `Top`, with 0 in the field's columns."""
    states = len(column.press)
    return np.concatenate(
        [
            column.press,
            np.zeros((states, FIELD_COLUMNS)),
            column.reach2,
            column.pieces.reshape(states, -1),
        ],
        axis=1,
    )


def _as_tips(one: Indentation | Sequence[Indentation | None] | None) -> list[Indentation | None]:
    return [one] if one is None or isinstance(one, Indentation) else list(one) or [None]


def _centres(centres_mm: FloatArray, states: int, tips: int) -> FloatArray:
    centres = np.asarray(centres_mm, dtype=np.float64)
    if centres.shape == (states, 2):
        centres = centres[:, None]
    if centres.ndim != 3 or centres.shape[0] != states or centres.shape[1] < tips or centres.shape[2] != 2:
        raise InputError(
            f"centres_mm: shape {np.shape(centres_mm)}, needs ({states}, 2) or ({states}, {tips}, 2)"
        )
    return centres


def _touched_first(rows: FloatArray) -> FloatArray:
    """Rows (state, tip, n) with the tips that touch moved before those that do not."""
    order = np.argsort(rows[:, :, ACTIVE] == 0.0, axis=1, kind="stable")
    return np.asarray(rows[np.arange(len(rows))[:, None], order])


def _check_apart(rows: FloatArray, scene: OpticalScene) -> None:
    for state, tips in enumerate(rows):
        touching = tips[tips[:, ACTIVE] > 0.0]
        if len(touching) > 1 and scene.tip_reflectance > 0.0:
            raise ModelScopeError(
                f"surfaces.tip_reflectance: {scene.tip_reflectance:g} with {len(touching)} tips in state {state}: "
                "light that tips scatter is modelled for one tip only; set it to 0"
            )
        for k, one in enumerate(touching):
            for other in touching[k + 1 :]:
                apart = float(np.hypot(one[X] - other[X], one[Y] - other[Y]))
                need = float(one[SKIRT_R] + other[SKIRT_R])
                if apart <= need:
                    raise ModelScopeError(
                        f"presses: state {state} has tips {apart:.2f} mm apart whose dimples need {need:.2f} mm; "
                        "superposition does not hold there, move them apart or press less"
                    )


def _neighbours_depth_mm(rows: FloatArray) -> FloatArray:
    """(state,) upper bound on how much other tips lower the top where a tip is nearest [mm], summed over tips."""
    depth = np.zeros(len(rows))
    for state, tips in enumerate(rows):
        touching = tips[tips[:, ACTIVE] > 0.0]
        for k, one in enumerate(touching):
            apart = [np.hypot(*(one[[X, Y]] - other[[X, Y]])) for m, other in enumerate(touching) if m != k]
            depth[state] += _fall_beyond_mm(one, min(apart) / 2) if apart else 0.0
    return depth


def _fall_beyond_mm(row: FloatArray, radius_mm: float) -> float:
    """Largest depth of a curve below the undisturbed top, beyond a given radius [mm]."""
    edges, _, _ = node_radii_mm(float(row[SPHERE_R]), float(row[OUTER_R]))
    pieces = row[PIECES:].reshape(CELLS, PIECE_COLUMNS)[edges[1:] > radius_mm]
    if len(pieces) == 0:
        return 0.0
    return max(float(row[TOP] - lowest_of_pieces_mm(pieces).min()), 0.0)


def _stacked_fields(
    fields: Sequence[SmoothField | None] | None, states: int
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(state, nx, ny, 4) nodes of the fields; (state, n) the field's columns of `Top.rows`; node distance [mm]."""
    known = np.zeros((states, FIELD_COLUMNS))
    if fields is None or all(field is None for field in fields):
        return np.zeros((states, 0, 0, 4)), known, np.ones(2)
    if len(fields) != states:
        raise InputError(f"fields: {len(fields)} for {states} states; give one, or None, per state")
    grids = {(field.nodes.shape, *field.step_mm) for field in fields if field is not None}
    if len(grids) != 1:
        shapes = sorted(shape for shape, *_ in grids)
        raise InputError(f"fields: grids of {shapes} nodes; give all states the same grid")
    shape, *step = grids.pop()
    nodes = np.zeros((states, *shape))
    for state, field in enumerate(fields):
        if field is not None:
            nodes[state] = field.nodes
            known[state] = _known_of(field)
    return nodes, known, np.array(step)


def _cells(nodes: FloatArray, step: FloatArray) -> FloatArray:
    """(state, nx - 1, ny - 1, 16) coefficients of u^p v^q in each cell's bicubic Hermite patch."""
    if nodes.shape[1] == 0:
        return np.zeros((len(nodes), 0, 0, 16))
    # columns of a node: value, d/dx, d/dy, mixed, in units of a cell
    scaled = nodes * np.array([1.0, step[0], step[1], step[0] * step[1]])
    corners = [scaled[:, a : a - 1 or None, b : b - 1 or None] for a in (0, 1) for b in (0, 1)]
    return np.ascontiguousarray(np.concatenate(corners, axis=-1) @ _patches())


@cache
def _patches() -> FloatArray:
    """(16, 16) matrix from the node values at a cell's corners (0, 0), (0, 1), (1, 0), (1, 1) to its coefficients."""
    # value and slope at a cell's first end, then at its second -> coefficients of 1, u, u², u³
    cubic = np.array([[1, 0, 0, 0], [0, 1, 0, 0], [-3, -2, 3, -1], [2, 1, -2, 1]])
    along_then_across = np.kron(cubic, cubic).reshape(16, 2, 2, 2, 2)  # end and derivative of u, then of v
    return np.asarray(along_then_across.transpose(1, 3, 4, 2, 0).reshape(16, 16), dtype=np.float64)


def _known_of(field: SmoothField) -> FloatArray:
    """A field's columns of `Top.rows`; bounds are computed from `SUBDIVISION` + 1 points along a cell's side."""
    if field in _KNOWN:
        return _KNOWN[field]
    value, slope_x, slope_y, bend = _sampled(field)
    row = np.zeros(FIELD_COLUMNS)
    row[:5] = 1.0, *field.origin_mm, *(1.0 / field.step_mm)
    row[FIELD_LOWEST - FIELD_ON] = min(SLOPE_RESERVE * float(value.min()), 0.0)
    row[FIELD_SLOPE - FIELD_ON] = SLOPE_RESERVE * float(np.hypot(slope_x, slope_y).max())
    row[FIELD_BEND - FIELD_ON] = BEND_RESERVE * max(float(bend.max()), 0.0)
    row[SLACK - FIELD_ON] = -row[FIELD_LOWEST - FIELD_ON]
    shape = np.array(field.nodes.shape[:2]) - 1
    row[BLOCK_X - FIELD_ON : BLOCK - FIELD_ON] = BLOCKS / (shape * field.step_mm)
    lowest, slope = (
        of_cells.reshape(*shape, -1) for of_cells in (-np.minimum(value, 0.0), np.hypot(slope_x, slope_y))
    )
    around = np.stack([_blocks(lowest.max(axis=2)), _blocks(slope.max(axis=2))], axis=-1)
    row[BLOCK - FIELD_ON :] = (SLOPE_RESERVE * around * [-1.0, 1.0]).ravel()
    _KNOWN[field] = row
    return row


def _blocks(of_cells: FloatArray) -> FloatArray:
    """(BLOCKS, BLOCKS) largest value of the cells (nx, ny) in each block and within one block's width around it."""
    for axis in (0, 1):
        cells = of_cells.shape[axis]
        first = np.maximum(np.floor((np.arange(BLOCKS) - 1) * cells / BLOCKS), 0).astype(int)
        last = np.minimum(np.ceil((np.arange(BLOCKS) + 2) * cells / BLOCKS), cells - 1).astype(int)
        spans = np.stack([first, last], axis=1).ravel()
        within = np.maximum.reduceat(of_cells, spans, axis=axis)
        within = within[::2] if axis == 0 else within[:, ::2]
        of_cells = np.maximum(within, np.take(of_cells, last, axis=axis))
    return of_cells


def _sampled(field: SmoothField) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Height, slopes and bend (largest downward curvature) at `SUBDIVISION` + 1 points along each side of a cell."""
    cells = _cells(field.nodes[None], field.step_mm)[0].reshape(-1, 16)
    (dx, dy), points = field.step_mm, (SUBDIVISION + 1) ** 2
    scale = np.array([1.0, 1.0 / dx, 1.0 / dy, 1.0 / dx**2, 1.0 / (dx * dy), 1.0 / dy**2])
    found = (cells @ _samples()).reshape(-1, 6, points) * scale[:, None]
    height, slope_x, slope_y, hxx, hxy, hyy = found.swapaxes(0, 1)
    return height, slope_x, slope_y, -0.5 * (hxx + hyy) + np.hypot(0.5 * (hxx - hyy), hxy)


@cache
def _samples() -> FloatArray:
    """(16, 6 x points) matrix from a cell's coefficients to height, slopes and second derivatives per cell."""
    t, power = np.linspace(0.0, 1.0, SUBDIVISION + 1)[:, None], np.arange(4)
    value = t**power
    slope = np.where(power > 0, power * t ** np.maximum(power - 1, 0), 0.0)
    bend = np.where(power > 1, power * (power - 1) * t ** np.maximum(power - 2, 0), 0.0)
    kinds = ((value, value), (slope, value), (value, slope), (bend, value), (slope, slope), (value, bend))
    return np.concatenate([np.kron(along, across) for along, across in kinds]).T
