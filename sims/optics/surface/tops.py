# mypy: no-warn-return-any
"""The pressed top that kernels evaluate: the sum of a tip's curve and of a smooth field.

Model
-----
The top's height above the undisturbed plane is the sum of the tip's radial curve
(`optopad.sims.optics.surface.curves`) and of a smooth bicubic field (`optopad.sims.optics.scene.optical_scene`).
Several tips at once are traced on a grid of heights instead (`optopad.sims.optics.engine.general`).

Grid
----
Light is sampled on cells of the top in coordinates (u, v) around the tip. Each edge of the box spans a sector: v runs
along the edge, u from the contact edge (0) to the box's edge (1) with r = a + (r_edge(v) - a) u². So cells are narrow
at the contact edge.
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
from optopad.design.errors import InputError
from optopad.sims.optics.scene.optical_scene import OpticalScene, SmoothField
from optopad.sims.optics.surface.curves import (
    ACTIVE,
    BLOCKS,
    COLUMNS,
    CONTACT_R,
    FIELD_COLUMNS,
    OUTER_R,
    SKIRT_R,
    X,
    Y,
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
    row : (n,) numbers of the tip; see `optopad.sims.optics.surface.curves`. From column `FIELD_ON`: 1 if there is a
        field, else 0; the field's origin [mm], cells per mm along x and y, lowest value (0 or below) [mm], largest
        slope [-] and bend [1/mm]; largest amount by which the field lowers the top [mm]; blocks per mm along x and y;
        lowest value and largest slope around each block (`_blocks`)
    field : (nx, ny, 16) coefficients of u^p v^q in each cell, for u and v from 0 to 1 [mm]; q varies fastest. (0, 0,
        16) without a field
    """

    row: FloatArray
    field: FloatArray


@inlined
def is_plain(top: Top) -> bool:
    """Whether the top is the curve of the tip only, without a smooth field."""
    return top.row[FIELD_ON] == 0.0


@kernel
def is_touched(top: Top) -> bool:
    """Whether the top differs from the undisturbed plane anywhere."""
    return top.row[FIELD_ON] != 0.0 or top.row[ACTIVE] > 0.0


@kernel
def touch(x: float, y: float, top: Top) -> tuple[bool, float]:
    """Whether the tip touches at a point; the distance to its axis, in multiples of its skirt radius (1e30: no tip)."""
    if top.row[ACTIVE] == 0.0:
        return False, 1e30
    r = distance(x - top.row[X], y - top.row[Y])
    return r < top.row[CONTACT_R], min(1e30, r / top.row[SKIRT_R])


@kernel
def is_beyond(x: float, y: float, top: Top) -> bool:
    """Whether a point is beyond the tip's outer radius, so that the top without a field is undisturbed there."""
    outer = top.row[OUTER_R] if top.row[ACTIVE] > 0.0 else 0.0
    return distance(x - top.row[X], y - top.row[Y]) >= outer


@inlined
def _field_cell(x: float, y: float, top: Top) -> tuple[int, int, float, float]:
    """Cell of the field that contains a point (-1: outside), and the point's fractions within it along x and y."""
    u = (x - top.row[FIELD_X]) * top.row[PER_X]
    v = (y - top.row[FIELD_Y]) * top.row[PER_Y]
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
    return height, along * top.row[PER_X], across * top.row[PER_Y]


@inlined
def block_bounds(x: float, y: float, top: Top) -> tuple[float, float]:
    """Lowest value of the field [mm] and its largest slope, within one block's width around the block of a point."""
    i = min(max(int((x - top.row[FIELD_X]) * top.row[BLOCK_X]), 0), BLOCKS - 1)
    j = min(max(int((y - top.row[FIELD_Y]) * top.row[BLOCK_Y]), 0), BLOCKS - 1)
    column = BLOCK + 2 * (BLOCKS * i + j)
    return top.row[column], top.row[column + 1]


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
    per_x = top.row[PER_X]
    per_y = top.row[PER_Y]
    return hxx * per_x * per_x, hxy * per_x * per_y, hyy * per_y * per_y


@kernel
def surface_height(x: float, y: float, top: Top) -> float:
    """Height of the top above the bottom at a point [mm]."""
    rx = x - top.row[X]
    ry = y - top.row[Y]
    h = height(rx * rx + ry * ry, top.row)
    if not is_plain(top):
        h += field_height(x, y, top)
    return h


@kernel
def surface_gradient(x: float, y: float, top: Top) -> tuple[float, float, float]:
    """Height of the top above the bottom [mm], dh/dx, dh/dy at a point."""
    rx = x - top.row[X]
    ry = y - top.row[Y]
    h, per = height_and_slope(rx * rx + ry * ry, top.row)
    gx = per * rx
    gy = per * ry
    if is_plain(top):
        return h, gx, gy
    more, mx, my = field_gradient(x, y, top)
    return h + more, gx + mx, gy + my


@kernel
def surface_bend(x: float, y: float, top: Top) -> tuple[float, float, float, float, float, float]:
    """Height of the top above the bottom [mm], dh/dx, dh/dy, d2h/dx2, d2h/dxdy, d2h/dy2 at a point."""
    rx = x - top.row[X]
    ry = y - top.row[Y]
    h, turn, bend = height_slope_curvature(rx * rx + ry * ry, top.row)
    gx, gy = turn * rx, turn * ry
    hxx, hxy, hyy = turn + bend * rx * rx, bend * rx * ry, turn + bend * ry * ry
    if is_plain(top):
        return h, gx, gy, hxx, hxy, hyy
    more, mx, my = field_gradient(x, y, top)
    mxx, mxy, myy = _field_bends(x, y, top)
    return h + more, gx + mx, gy + my, hxx + mxx, hxy + mxy, hyy + myy


# columns of a sector row
AX, AY, BX, BY, SPAN = range(5)
# columns of a node row
NX, NY, NZ, GX, GY, HXX, HXY, HYY = range(8)
NODE_COLUMNS = 8
FEWEST_COLUMNS = 3


@array_kernel
def sectors_of(top: Top, box: FloatArray) -> FloatArray:
    """(sector, 5) for each edge of the box: start relative to the tip's axis, vector to the end, angle."""
    out = np.empty((4, 5))
    for c in range(4):
        ax = (box[0] if c == 1 or c == 2 else 0.0) - top.row[X]
        ay = (box[1] if c > 1 else 0.0) - top.row[Y]
        bx = (box[0] if c < 2 else 0.0) - top.row[X]
        by = (box[1] if c == 1 or c == 2 else 0.0) - top.row[Y]
        out[c, AX] = ax
        out[c, AY] = ay
        out[c, BX] = bx - ax
        out[c, BY] = by - ay
        out[c, SPAN] = math.atan2(ax * by - ay * bx, ax * bx + ay * by)
    return out


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
    inner = top.row[CONTACT_R]
    span = max(reach - inner, 0.0)
    r = inner + span * u * u
    x = top.row[X] + r * wx / reach
    y = top.row[Y] + r * wy / reach
    return x, y, r, r * 2.0 * span * u * turn


@kernel
def place_in_contact(
    sector: int, s: float, v: float, sectors: FloatArray, top: Top
) -> tuple[float, float, float]:
    """Point (x, y) in the tip's contact, and the plan area per ds dv [mm²].

    The coordinate s is the share of the contact's area within the point's radius, from 0 at the axis to 1 at the edge.
    """
    wx = sectors[sector, AX] + v * sectors[sector, BX]
    wy = sectors[sector, AY] + v * sectors[sector, BY]
    reach2 = wx * wx + wy * wy
    turn = (wx * sectors[sector, BY] - wy * sectors[sector, BX]) / reach2
    r2, growth = contact_radius_2(s, top.row)
    share = math.sqrt(r2 / reach2)
    x = top.row[X] + share * wx
    y = top.row[Y] + share * wy
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
    sectors : (sector, 5) result of `sectors_of`

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
    for k in range(sectors.shape[0]):
        for b in range(counts[k]):
            out[n, 0] = k
            out[n, 1] = (b + phase - 0.5) / counts[k] if b > 0 else 0.0
            out[n, 2] = (b + phase + 0.5) / counts[k] if b + 1 < counts[k] else 1.0
            out[n, 3] = n - 1
            out[n, 4] = n + 1
            n += 1
    out[0, 3] = n - 1
    out[n - 1, 4] = 0
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
        dx = x - top.row[X]
        dy = y - top.row[Y]
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
        inner = top.row[CONTACT_R]
        if r < inner or r > reach:
            continue
        u = math.sqrt((r - inner) / max(reach - inner, 1e-12))
        ring = min(max(int(u * rings + 0.5 - phase), 0), rings - 1)
        return ring, n
    return -1, -1


SUBDIVISION = 2
SLOPE_RESERVE, BEND_RESERVE = 1.1, 1.2
_KNOWN: WeakKeyDictionary[SmoothField, FloatArray] = WeakKeyDictionary()
"""Result of `_known_of` for each field that is still referenced."""


@dataclass(frozen=True, kw_only=True)
class TopStack:
    """Tops of all states, as kernels read them.

    Attributes
    ----------
    rows : (state, n) as `Top.row`
    field : (state, nx, ny, 4) nodes of the fields (`SmoothField`); (state, 0, 0, 4) if no state has a field
    step_mm : (2,) distance between nodes along x and y [mm]
    """

    rows: FloatArray
    field: FloatArray
    step_mm: FloatArray

    def part(self, states: IntArray) -> tuple[FloatArray, FloatArray]:
        """Arrays `Top.row` and `Top.field` of some states, each with a leading axis for the state."""
        return self.rows[states], _cells(self.field[states], self.step_mm)


def stack_tops(
    indentations: Sequence[Indentation | None],
    centres_mm: FloatArray,
    scene: OpticalScene,
    fields: Sequence[SmoothField | None] | None = None,
) -> TopStack:
    """Convert the presses of all states and, if given, a smooth field per state.

    Parameters
    ----------
    indentations : for each state an indentation, or None if untouched
    centres_mm : (state, 2) x and y of the press axes [mm]
    fields : for each state a field on the same grid, or None; if omitted, no state has a field

    Raises
    ------
    InputError : shapes do not fit together, a press is outside the block, or a curve or field is invalid.
    ModelScopeError : a press is out of scope.
    """
    states, stack = len(indentations), stack_surfaces(indentations, centres_mm, scene)
    stack.press[stack.press[:, ACTIVE] == 0.0, X : Y + 1] = scene.length_mm / 2, scene.width_mm / 2
    field, known, step = _stacked_fields(fields, states)
    rows = np.concatenate([stack.press, known, stack.reach2, stack.pieces.reshape(states, -1)], axis=1)
    return TopStack(rows=rows, field=field, step_mm=step)


def _stacked_fields(
    fields: Sequence[SmoothField | None] | None, states: int
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(state, nx, ny, 4) nodes of the fields; (state, n) the field's columns of `Top.row`; node distance [mm]."""
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
    """A field's columns of `Top.row`; bounds are computed from `SUBDIVISION` + 1 points along a cell's side."""
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
