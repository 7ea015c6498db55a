# mypy: no-warn-return-any
"""Kernels: the deformed top as the sum of every tip's radial table and of a smooth field.

A state's top is a `Top`: rows of `sims.optics.surface.curves.SurfaceStack` for each tip, a bicubic Hermite field
(`sims.optics.scene.smooth_field`; empty where there is none), and what is known of the field as a whole.
"""

from __future__ import annotations

from typing import NamedTuple

from sims.optics.scene.optical_scene import FloatArray
from sims.optics.surface.curves import ACTIVE, COLUMNS, CONTACT_R, FIELD_COLUMNS, OUTER_R, SKIRT_R, TOP, X, Y
from sims.optics.surface.radial import distance, height, height_and_turn, height_turn_bend, inlined, kernel

FIELD_ON, FIELD_X, FIELD_Y, FIELD_DX, FIELD_DY, FIELD_LOWEST, FIELD_SLOPE, SLACK = range(
    COLUMNS, COLUMNS + FIELD_COLUMNS
)


class Top(NamedTuple):
    """One state's surface.

    Attributes
    ----------
    rows : (tip, n) see `sims.optics.surface.curves`; in the first, from `FIELD_ON`: field on, origin, steps, lowest
    value (0
        or below), largest slope; how far the field and the tips beside the one at hand may lower the top [mm]
    field : (nx, ny, 4) nodes of the field, or (0, 0, 4)
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


@kernel
def _field_cell(x: float, y: float, top: Top) -> tuple[int, int, float, float]:
    """Cell of the field and fractions within it; -1 outside."""
    rows = top.rows
    u = (x - rows[0, FIELD_X]) / rows[0, FIELD_DX]
    v = (y - rows[0, FIELD_Y]) / rows[0, FIELD_DY]
    nx = top.field.shape[0] - 1
    ny = top.field.shape[1] - 1
    if not (0.0 <= u <= nx and 0.0 <= v <= ny):
        return -1, -1, 0.0, 0.0
    i = min(int(u), nx - 1)
    j = min(int(v), ny - 1)
    return i, j, u - i, v - j


@kernel
def _ends(t: float, step: float) -> tuple[float, float, float, float]:
    """Hermite weights of value and slope at both ends of a cell."""
    s = 1.0 - t
    return (1.0 + 2.0 * t) * s * s, step * t * s * s, (1.0 + 2.0 * s) * t * t, -step * s * t * t


@kernel
def _end_slopes(t: float, step: float) -> tuple[float, float, float, float]:
    """First derivatives of `_ends` with respect to the place."""
    s = 1.0 - t
    return -6.0 * t * s / step, s * (1.0 - 3.0 * t), 6.0 * t * s / step, t * (3.0 * t - 2.0)


@kernel
def _end_bends(t: float, step: float) -> tuple[float, float, float, float]:
    """Second derivatives of `_ends`."""
    s2 = step * step
    return (12.0 * t - 6.0) / s2, (6.0 * t - 4.0) / step, (6.0 - 12.0 * t) / s2, (6.0 * t - 2.0) / step


@kernel
def _mixed(
    i: int, j: int, along: tuple[float, float, float, float], across: tuple[float, float, float, float],
    field: FloatArray,
) -> float:  # fmt: skip
    """Sum over a cell's four nodes of weights along x and y."""
    total = 0.0
    for a in range(2):
        for b in range(2):
            node = field[i + a, j + b]
            wa = along[2 * a]
            sa = along[2 * a + 1]
            wb = across[2 * b]
            sb = across[2 * b + 1]
            total += wb * (node[0] * wa + node[1] * sa) + sb * (node[2] * wa + node[3] * sa)
    return total


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
        i, j, u, v = _field_cell(x, y, top)
        if i >= 0:
            h += _mixed(i, j, _ends(u, top.rows[0, FIELD_DX]), _ends(v, top.rows[0, FIELD_DY]), top.field)
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
        i, j, u, v = _field_cell(x, y, top)
        if i >= 0:
            along = _ends(u, top.rows[0, FIELD_DX])
            across = _ends(v, top.rows[0, FIELD_DY])
            h += _mixed(i, j, along, across, top.field)
            gx += _mixed(i, j, _end_slopes(u, top.rows[0, FIELD_DX]), across, top.field)
            gy += _mixed(i, j, along, _end_slopes(v, top.rows[0, FIELD_DY]), top.field)
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
        i, j, u, v = _field_cell(x, y, top)
        if i >= 0:
            dx = top.rows[0, FIELD_DX]
            dy = top.rows[0, FIELD_DY]
            along = _ends(u, dx)
            across = _ends(v, dy)
            along_slope = _end_slopes(u, dx)
            across_slope = _end_slopes(v, dy)
            h += _mixed(i, j, along, across, top.field)
            gx += _mixed(i, j, along_slope, across, top.field)
            gy += _mixed(i, j, along, across_slope, top.field)
            hxx += _mixed(i, j, _end_bends(u, dx), across, top.field)
            hxy += _mixed(i, j, along_slope, across_slope, top.field)
            hyy += _mixed(i, j, along, _end_bends(v, dy), top.field)
    return h, gx, gy, hxx, hxy, hyy
