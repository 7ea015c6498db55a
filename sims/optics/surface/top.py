# mypy: no-warn-return-any
"""Kernels: the deformed top as the sum of every tip's radial table and of a smooth field.

A state's top is a `Top`: rows of `sims.optics.surface.curves.SurfaceStack` for each tip, a bicubic field
(`sims.optics.scene.smooth_field`; empty where there is none), and what is known of the field as a whole.
"""

from __future__ import annotations

from typing import NamedTuple

from design.arrays import FloatArray
from sims.optics.surface.curves import ACTIVE, COLUMNS, CONTACT_R, FIELD_COLUMNS, OUTER_R, SKIRT_R, TOP, X, Y
from sims.optics.surface.radial import distance, height, height_and_turn, height_turn_bend, inlined, kernel

FIELD_ON, FIELD_X, FIELD_Y, PER_X, PER_Y, FIELD_LOWEST, FIELD_SLOPE, FIELD_BEND, SLACK = range(
    COLUMNS, COLUMNS + FIELD_COLUMNS
)


class Top(NamedTuple):
    """One state's surface.

    Attributes
    ----------
    rows : (tip, n) see `sims.optics.surface.curves`; in the first, from `FIELD_ON`: field on, origin [mm], cells per mm
        along x and y, lowest value (0 or below) [mm], largest slope [-] and bend [1/mm] of the field; how far the field
        and the tips beside the one at hand may lower the top [mm]
    field : (nx, ny, 16) coefficients of u^p v^q in each cell, q the faster, u and v from 0 to 1 [mm]; or (0, 0, 16)
    """

    rows: FloatArray
    field: FloatArray


@inlined
def is_plain(top: Top) -> bool:
    """Whether one radial table is all there is."""
    return top.rows.shape[0] == 1 and top.rows[0, FIELD_ON] == 0.0


@kernel
def is_touched(top: Top) -> bool:
    """Whether the top differs from the undisturbed plane."""
    if top.rows[0, FIELD_ON] != 0.0:
        return True
    touched = False
    for k in range(top.rows.shape[0]):
        touched = touched or top.rows[k, ACTIVE] > 0.0
    return touched


@kernel
def touching_tip(x: float, y: float, top: Top) -> tuple[int, float]:
    """The tip that touches the top there (-1: none), and the smallest distance from an axis over its skirt radius."""
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
    """Whether a place lies beyond the outer radius of every tip, where the top without a field is undisturbed."""
    for k in range(top.rows.shape[0]):
        outer = top.rows[k, OUTER_R] if top.rows[k, ACTIVE] > 0.0 else 0.0
        if distance(x - top.rows[k, X], y - top.rows[k, Y]) < outer:
            return False
    return True


@inlined
def _field_cell(x: float, y: float, top: Top) -> tuple[int, int, float, float]:
    """Cell of the field and fractions within it; -1 outside."""
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
    """A cubic of four coefficients from the k-th on."""
    return c[k] + v * (c[k + 1] + v * (c[k + 2] + v * c[k + 3]))


@inlined
def _cubic_slope(c: FloatArray, k: int, v: float) -> float:
    """Its first derivative."""
    return c[k + 1] + v * (2.0 * c[k + 2] + v * 3.0 * c[k + 3])


@inlined
def field_height(x: float, y: float, top: Top) -> float:
    """The field's height; 0 outside it."""
    i, j, u, v = _field_cell(x, y, top)
    if i < 0:
        return 0.0
    c = top.field[i, j]
    return _cubic(c, 0, v) + u * (_cubic(c, 4, v) + u * (_cubic(c, 8, v) + u * _cubic(c, 12, v)))


@inlined
def field_gradient(x: float, y: float, top: Top) -> tuple[float, float, float]:
    """The field's height, dh/dx, dh/dy; 0 outside it."""
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


@kernel
def _field_bends(x: float, y: float, top: Top) -> tuple[float, float, float]:
    """The field's d2h/dx2, d2h/dxdy, d2h/dy2; 0 outside it."""
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
    """Height of the top above the bottom."""
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
    """Height of the top, dh/dx, dh/dy."""
    rows = top.rows
    rx = x - rows[0, X]
    ry = y - rows[0, Y]
    h, per = height_and_turn(rx * rx + ry * ry, 0, rows)
    gx = per * rx
    gy = per * ry
    if is_plain(top):
        return h, gx, gy
    for k in range(1, rows.shape[0]):
        rx = x - rows[k, X]
        ry = y - rows[k, Y]
        more, per = height_and_turn(rx * rx + ry * ry, k, rows)
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
    """One tip's height, gradient and second derivatives."""
    rx = x - rows[tip, X]
    ry = y - rows[tip, Y]
    h, turn, bend = height_turn_bend(rx * rx + ry * ry, tip, rows)
    return h, turn * rx, turn * ry, turn + bend * rx * rx, bend * rx * ry, turn + bend * ry * ry


@kernel
def surface_bend(x: float, y: float, top: Top) -> tuple[float, float, float, float, float, float]:
    """Height of the top, dh/dx, dh/dy, d2h/dx2, d2h/dxdy, d2h/dy2."""
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
