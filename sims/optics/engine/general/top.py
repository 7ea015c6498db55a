# mypy: no-warn-return-any
r"""The top of a disc or crowned pad under one press, and the points where rays leave through it.

Model
-----
*Press coordinates* have their origin on the untouched top at the location of the press, and their third axis along the
normal (`PadForm.press_frame`). In them the top is

    z = -c(x, y) + d(r),     r² = x² + y²

where c is the crown's sag below its tangent plane and d the height of the pressed top above the untouched crown. In
the contact of a hemisphere of radius a at depth p, d = a - p - √(a² - r²) + m(r), with m the sag of the mean crown.
For a spherical crown m is c itself, so the top follows the tip exactly. For a cylindrical crown m is the sag of a
sphere of twice its radius. Beyond the contact, d is a C1 cubic through the points of the press's curve, as in
`optopad.sims.optics.surface.curves`, and ends in a tail.

Rays march in steps that cannot jump over the top. The height of a ray above the crown, u = z + c, is convex along it,
so within a step u is nowhere above the line between its ends. Let s be the step's smallest radius. From s outward, d
has three bounds: the lowest d, the largest downward slope, and the largest *cup* κ = max(d'', d'/r, 0), the rate at
which d's slope along a line grows. With the gap g = d - u, a step of length h in plan is safe in three cases: if u
stays below the lowest d; if g at one end is larger than its largest possible loss within the step; or if √g₁ + √g₂ > h
√(κ/2) for the gaps at its ends, because then g lies above the parabola of curvature κ through both. Steps are shortened
until they are safe, or until a ray that comes out closes its gap faster than κ h, and so comes out only once. Steps of
at most `STEP_MM`, less where the gap is small, are tested only at their ends. So a shorter chord through a tip of
radius a may be missed; it is STEP_MM² / 8a deep, 4 µm for a = 3 mm. Newton's rule within the step finds the point where
the ray comes out.

In a block, the walls make d more than radial: a smooth field, of bicubic patches, is added to it, and its bounds to
those of the table.

On a grid of heights d is a bicubic patch in each cell (`grid`). Rays pass blocks of cells below whose lowest d they
stay, and are tested once per cell elsewhere. So a chord through the top within a cell of size s may be missed: at a
curvature κ it is κ s² / 8 deep, 4 µm for 0.2 mm and an edge of radius 1.25 mm.

The model leaves out the second height where the curve folds. Several tips are a grid.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from optopad.design.arrays import FloatArray
from optopad.sims.optics.surface.curves import (
    CELLS,
    OFFSET,
    PIECE_COLUMNS,
    PIECES,
    ROW,
    SCALE,
    SPHERE_2,
    START,
    STEEP,
)
from optopad.sims.optics.surface.radial import height_and_slope, inlined, kernel

NEVER = 1e30
STEP_MM, LEAST_STEP_MM = 0.3, 0.06
"""Longest and shortest step of a march near the dimple in which only the ends are tested [mm]."""
SHORTER, LONGER = 0.25, 2.0
"""Factors by which the step of a march changes after an unsafe step and after a safe one."""
ALOOF, NEWTON_STEPS = 2.5, 8
"""How many times steeper than the dimple a ray must cross the crown, at both ends, to meet the top certainly only once;
and number of Newton steps."""
AT_TOP_MM = 1e-10
"""Distance below which a point counts as on the top [mm]."""
NEAR_TOP_MM = 1e-6
"""Within this distance from the top, one more step of Newton's rule is enough [mm]."""
LOWS, CUPS = ROW, ROW + CELLS
"""Columns in a press's table row where two lists begin: the lowest height and the largest cup from each piece of the
curve outward."""
FORMED_ROW = CUPS + CELLS
FLAT, SPHERE, CYLINDER = 0.0, 1.0, 2.0
# numbers of a top
(
    KIND,
    RADIUS,
    MEAN,
    DEPTH,
    OUTER,
    CONTACT_EDGE,
    SKIRT_EDGE,
    GRID_X,
    GRID_Y,
    GRID_STEP,
    SKIN,
    FIELD_X,
    FIELD_Y,
) = range(13)
NUMBERS = 13
BARE, MIRRORING = 0.0, -1.0
"""Values of `SKIN` without a skin and with one that mirrors; that of one that scatters is its reflectance."""
# values at a node of a grid
VALUE, ALONG_X, ALONG_Y, TWIST, LEVEL, STEEPER, PATCH, LOWEST = range(8)
NODE = 8
BLOCK = 8
"""Number of a grid's cells, in each direction, that share one lowest height."""


class FormedTop(NamedTuple):
    """The top in one state, as kernels read it; the module's docstring explains press coordinates, d and cup.

    Attributes
    ----------
    origin : (3,) origin of press coordinates, in cavity coordinates [mm]
    axes : (3, 3) axes of press coordinates, one per table row [-]
    numbers : (13,) type of crown (flat, sphere or cylinder); its radius and the mean crown's radius (0 if flat) [mm];
        depth of the press; radius beyond which d is 0; contact radius; skirt radius, within which a reflection counts
        as the skirt's [mm]; x and y of the grid's first node, and distance of its nodes [mm]. The last seven are 0 if
        untouched, the last three if d is radial. Then the skin: `BARE`, `MIRRORING`, or the share that it scatters;
        and the distances of a field's nodes along x and y [mm], 0 without a field
    row : (`FORMED_ROW`,) radial table of d (`optopad.sims.optics.surface.curves`), then lowest heights, then largest
        cups; of a grid, only the bounds from each radius outward are used; if untouched, a single 0
    grid : (nx, ny, `NODE`) values at the nodes of a grid: d, its slopes along x and y, its mixed derivative; level of
        the contact, above 0 inside; 1 in the skirt, else 0; number of the contact's patch; and, at node (i, j), the
        lowest d in the block of cells (i, j), which spans `BLOCK` cells each way. If d is radial, a single node, or the
        values and slopes of a smooth field that is added to it
    """

    origin: FloatArray
    axes: FloatArray
    numbers: FloatArray
    row: FloatArray
    grid: FloatArray


@inlined
def into(top: FormedTop, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Convert a point from cavity coordinates to press coordinates."""
    return turn(top, x - top.origin[0], y - top.origin[1], z - top.origin[2])


@inlined
def turn(top: FormedTop, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Convert a vector from cavity coordinates to press coordinates."""
    a = top.axes
    return (
        a[0, 0] * x + a[0, 1] * y + a[0, 2] * z,
        a[1, 0] * x + a[1, 1] * y + a[1, 2] * z,
        a[2, 0] * x + a[2, 1] * y + a[2, 2] * z,
    )


@inlined
def out_of(top: FormedTop, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Convert a vector from press coordinates to cavity coordinates."""
    a = top.axes
    return (
        a[0, 0] * x + a[1, 0] * y + a[2, 0] * z,
        a[0, 1] * x + a[1, 1] * y + a[2, 1] * z,
        a[0, 2] * x + a[1, 2] * y + a[2, 2] * z,
    )


@inlined
def sag(top: FormedTop, x: float, y: float) -> float:
    """Distance of the untouched crown below its tangent plane [mm]; far outside the pad it continues steeply."""
    kind = top.numbers[KIND]
    if kind == FLAT:
        return 0.0
    radius = top.numbers[RADIUS]
    reach = y * y if kind == CYLINDER else x * x + y * y
    return reach / (radius + math.sqrt(max(radius * radius - reach, 1e-12)))


@inlined
def crown_slopes(top: FormedTop, x: float, y: float) -> tuple[float, float]:
    """Slopes along x and y of the crown's distance below its tangent plane."""
    kind = top.numbers[KIND]
    if kind == FLAT:
        return 0.0, 0.0
    radius = top.numbers[RADIUS]
    reach = y * y if kind == CYLINDER else x * x + y * y
    per = 1.0 / math.sqrt(max(radius * radius - reach, 1e-12))
    return (0.0 if kind == CYLINDER else x * per), y * per


@inlined
def dimple(top: FormedTop, x: float, y: float) -> tuple[float, float, float]:
    """Height d of the pressed top above the crown at a point (x, y) in press coordinates [mm], and its slopes [-]."""
    r2 = x * x + y * y
    if r2 >= top.numbers[OUTER] * top.numbers[OUTER]:
        return 0.0, 0.0, 0.0
    step = top.numbers[GRID_STEP]
    if step > 0.0:
        return _on_grid(top, x, y, step, step)
    value, turned = height_and_slope(r2, top.row)
    mean = top.numbers[MEAN]
    if r2 <= top.row[SPHERE_2] and mean > 0.0:
        root = math.sqrt(max(mean * mean - r2, 1e-12))
        value += r2 / (mean + root)
        turned += 1.0 / root
    if top.numbers[FIELD_X] == 0.0:
        return value, turned * x, turned * y
    more, along, across = _on_grid(top, x, y, top.numbers[FIELD_X], top.numbers[FIELD_Y])
    return value + more, turned * x + along, turned * y + across


@kernel
def _on_grid(top: FormedTop, x: float, y: float, step: float, step_y: float) -> tuple[float, float, float]:
    """Height [mm] and its slopes [-] on a grid: the bicubic Hermite patch of the cell; 0 beyond the grid."""
    grid = top.grid
    s, t = (x - top.numbers[GRID_X]) / step, (y - top.numbers[GRID_Y]) / step_y
    if s < 0.0 or t < 0.0 or s >= grid.shape[0] - 1 or t >= grid.shape[1] - 1:
        return 0.0, 0.0, 0.0
    i, j = int(s), int(t)
    s, t = s - i, t - j
    value = along = across = 0.0
    for a in range(2):
        p = s if a == 0 else 1.0 - s
        sign = 1.0 if a == 0 else -1.0
        # weights of value and slope at this end of the cell, and their derivatives
        f, g = (1.0 + 2.0 * p) * (1.0 - p) * (1.0 - p), sign * step * p * (1.0 - p) * (1.0 - p)
        df, dg = sign * -6.0 * p * (1.0 - p) / step, (1.0 - p) * (1.0 - 3.0 * p)
        for b in range(2):
            q = t if b == 0 else 1.0 - t
            turn = 1.0 if b == 0 else -1.0
            h, k = (1.0 + 2.0 * q) * (1.0 - q) * (1.0 - q), turn * step_y * q * (1.0 - q) * (1.0 - q)
            dh, dk = turn * -6.0 * q * (1.0 - q) / step_y, (1.0 - q) * (1.0 - 3.0 * q)
            node = grid[i + a, j + b]
            here, slope = h * node[VALUE] + k * node[ALONG_Y], h * node[ALONG_X] + k * node[TWIST]
            value += f * here + g * slope
            along += df * here + dg * slope
            across += f * (dh * node[VALUE] + dk * node[ALONG_Y]) + g * (
                dh * node[ALONG_X] + dk * node[TWIST]
            )
    return value, along, across


@inlined
def near_node(top: FormedTop, x: float, y: float) -> tuple[int, int]:
    """Indices of the grid's node that is nearest to a point (x, y) in press coordinates."""
    step = top.numbers[GRID_STEP]
    i, j = int((x - top.numbers[GRID_X]) / step + 0.5), int((y - top.numbers[GRID_Y]) / step + 0.5)
    return min(max(i, 0), top.grid.shape[0] - 1), min(max(j, 0), top.grid.shape[1] - 1)


@kernel
def _level(top: FormedTop, x: float, y: float) -> float:
    """Level of the contact at a point (x, y) in press coordinates, linear between the nodes of a cell."""
    grid, step = top.grid, top.numbers[GRID_STEP]
    s, t = (x - top.numbers[GRID_X]) / step, (y - top.numbers[GRID_Y]) / step
    if s < 0.0 or t < 0.0 or s >= grid.shape[0] - 1 or t >= grid.shape[1] - 1:
        return -1.0
    i, j = int(s), int(t)
    s, t = s - i, t - j
    low = grid[i, j, LEVEL] + t * (grid[i, j + 1, LEVEL] - grid[i, j, LEVEL])
    high = grid[i + 1, j, LEVEL] + t * (grid[i + 1, j + 1, LEVEL] - grid[i + 1, j, LEVEL])
    return low + s * (high - low)


@kernel
def crown_exit(top: FormedTop, x: float, y: float, z: float, dx: float, dy: float, dz: float) -> float:
    """Distance at which a ray from inside, in press coordinates, leaves the untouched crown; NEVER if it does not."""
    kind = top.numbers[KIND]
    if kind == FLAT:
        return max(-z / dz, 0.0) if dz > 0.0 else NEVER
    radius = top.numbers[RADIUS]
    pz = z + radius
    if kind == CYLINDER:
        a, b, c = dy * dy + dz * dz, y * dy + pz * dz, y * y + pz * pz - radius * radius
    else:
        a, b, c = (
            dx * dx + dy * dy + dz * dz,
            x * dx + y * dy + pz * dz,
            x * x + y * y + pz * pz - radius * radius,
        )
    gap = b * b - a * c
    if a < 1e-14 or gap < 0.0:
        return NEVER
    t = (-b + math.sqrt(gap)) / a
    if t < 0.0 or pz + t * dz <= 0.0:
        return NEVER
    return t


@inlined
def above(top: FormedTop, x: float, y: float, z: float) -> float:
    """Height of a point above the pad's top [mm]; negative inside the elastomer. The point is in press coordinates."""
    return z + sag(top, x, y) - dimple(top, x, y)[0]


@inlined
def above_along(
    top: FormedTop, x: float, y: float, z: float, dx: float, dy: float, dz: float
) -> tuple[float, float]:
    """Height of a point in press coordinates above the pad's top [mm], and its derivative along a direction."""
    sx, sy = crown_slopes(top, x, y)
    height, gx, gy = dimple(top, x, y)
    return z + sag(top, x, y) - height, dz + (sx - gx) * dx + (sy - gy) * dy


@kernel
def top_hit(
    top: FormedTop, x: float, y: float, z: float, dx: float, dy: float, dz: float, limit: float
) -> float:
    """Distance, below `limit`, at which a ray from inside first leaves through the top; NEVER if it does not.

    x, y, z, dx, dy, dz : start and unit direction in press coordinates
    """
    leaves = crown_exit(top, x, y, z, dx, dy, dz)
    outer = top.numbers[OUTER]
    if outer > 0.0:
        a, b, c = dx * dx + dy * dy, x * dx + y * dy, x * x + y * y - outer * outer
        first, last = 0.0, -1.0
        if a < 1e-14:
            last = NEVER if c < 0.0 else -1.0
        else:
            gap = b * b - a * c
            if gap > 0.0:
                root = math.sqrt(gap)
                first, last = max((-b - root) / a, 0.0), (-b + root) / a
        if last > first and leaves > first:
            if leaves < NEVER:
                lower = _clear_before(top, x, y, z, dx, dy, dz, a, b, min(leaves, limit), leaves)
                if lower > 0.0:
                    return (
                        NEVER if leaves - lower > limit else _settled(top, x, y, z, dx, dy, dz, leaves, limit)
                    )
            if top.numbers[GRID_STEP] > 0.0:
                t = _cross_grid(top, x, y, z, dx, dy, dz, a, first, min(last, limit))
            else:
                t = _march(top, x, y, z, dx, dy, dz, a, b, first, min(last, limit))
            if t < NEVER:
                return t
            if limit <= last:
                return NEVER  # within the dimple's circle the crown is no border
    return leaves if leaves < limit else NEVER


@kernel
def _clear_before(
    top: FormedTop, x: float, y: float, z: float, dx: float, dy: float, dz: float, a: float, b: float, end: float,
    leaves: float,
) -> float:  # fmt: skip
    """How far before its exit from the crown a ray may leave through the top, at most [mm]; 0 if it may leave twice.

    A ray leaves only once if, up to `end`, the dimple is much less steep than the ray relative to the crown.
    """
    at = min(max(-b / a, 0.0), end) if a > 1e-14 else 0.0
    qx, qy = x + at * dx, y + at * dy
    low, steep, _ = _bounds(top, qx * qx + qy * qy)
    sx, sy = crown_slopes(top, x, y)
    leaving = -(dz + sx * dx + sy * dy)
    px, py = x + leaves * dx, y + leaves * dy
    sx, sy = crown_slopes(top, px, py)
    meeting = dz + sx * dx + sy * dy
    if min(leaving, meeting) <= ALOOF * steep * math.sqrt(a) or above(top, x, y, z) > 0.0:
        return 0.0
    return 1e-9 - 2.0 * low / meeting


@kernel
def _settled(
    top: FormedTop, x: float, y: float, z: float, dx: float, dy: float, dz: float, t: float, limit: float
) -> float:
    """Distance at which a ray meets the top, by Newton's rule from a nearby distance t; NEVER if not below `limit`."""
    for _ in range(NEWTON_STEPS):
        off, grows = above_along(top, x + t * dx, y + t * dy, z + t * dz, dx, dy, dz)
        t -= off / grows
        if abs(off) < NEAR_TOP_MM:
            break
    return t if t < limit else NEVER


@kernel
def _march(
    top: FormedTop, x: float, y: float, z: float, dx: float, dy: float, dz: float, a: float, b: float, first: float,
    stop: float,
) -> float:  # fmt: skip
    """Distance, between `first` and `stop` within the dimple's circle, at which a ray leaves; NEVER if it does not.

    a, b : squared length of the direction in plan, and its scalar product with the start in plan [mm]
    """
    across = math.sqrt(a)
    t = first
    px, py = x + t * dx, y + t * dy
    u = z + t * dz + sag(top, px, py)
    clear = dimple(top, px, py)[0] - u
    if clear < 0.0 and t > 1e-9:
        return t
    step = stop - t
    while stop - t > 1e-9:
        step = min(step, stop - t)
        end = t + step
        px, py = x + end * dx, y + end * dy
        end_u = z + end * dz + sag(top, px, py)
        end_clear = dimple(top, px, py)[0] - end_u
        turn_at = min(max(-b / a, t), end) if a > 1e-14 else t
        qx, qy = x + turn_at * dx, y + turn_at * dy
        low, steep, cup = _bounds(top, qx * qx + qy * qy)
        closes, bends = steep * across * step, cup * (across * step) ** 2
        if not (
            max(u, end_u) < low
            or (clear >= 0.0 and clear - (end_u - u) > closes)
            or (end_clear >= 0.0 and end_clear + (end_u - u) > closes)
            or (min(clear, end_clear) >= 0.0 and (math.sqrt(clear) + math.sqrt(end_clear)) ** 2 > 0.5 * bends)
        ):
            if clear >= 0.0 and end_clear < 0.0 and step > LEAST_STEP_MM:
                closing = above_along(top, x + t * dx, y + t * dy, z + t * dz, dx, dy, dz)[1]
                if closing * step >= bends:
                    return _between(top, x, y, z, dx, dy, dz, t, end)
            if step > min(STEP_MM, max(0.5 * min(clear, end_clear), LEAST_STEP_MM)):
                step *= SHORTER
                continue
            if end_clear < 0.0:
                return _between(top, x, y, z, dx, dy, dz, t, end)
        t, u, clear = end, end_u, end_clear
        step *= LONGER
    return NEVER


@kernel
def _cross_grid(
    top: FormedTop, x: float, y: float, z: float, dx: float, dy: float, dz: float, a: float, first: float, stop: float
) -> float:  # fmt: skip
    """As `_march`, on a grid: blocks in which the ray stays below the lowest d are passed at once.

    The height of a ray above the crown is convex along it, so within a block it is largest at one end.
    """
    step = top.numbers[GRID_STEP]
    across, size = math.sqrt(a), BLOCK * step
    columns, rows = (top.grid.shape[0] - 2) // BLOCK, (top.grid.shape[1] - 2) // BLOCK
    t, nudge = first, 1e-9 + 1e-7 * step / max(across, 1e-7)
    px, py = x + t * dx, y + t * dy
    u = z + t * dz + sag(top, px, py)
    clear = dimple(top, px, py)[0] - u
    if clear < 0.0 and t > 1e-9:
        return t
    while t < stop:
        s, r = (px - top.numbers[GRID_X]) / size, (py - top.numbers[GRID_Y]) / size
        i, j = math.floor(s), math.floor(r)
        end = stop
        if dx != 0.0:
            end = min(end, t + ((i + 1 if dx > 0.0 else i) - s) * size / dx + nudge)
        if dy != 0.0:
            end = min(end, t + ((j + 1 if dy > 0.0 else j) - r) * size / dy + nudge)
        px, py = x + end * dx, y + end * dy
        end_u = z + end * dz + sag(top, px, py)
        is_on = 0 <= i <= columns and 0 <= j <= rows
        if max(u, end_u) >= (top.grid[i, j, LOWEST] if is_on else 0.0):
            pieces = int((end - t) * across / step) + 1
            per = (end - t) / pieces
            for k in range(pieces):
                at = end if k == pieces - 1 else t + per * (k + 1)
                qx, qy = x + at * dx, y + at * dy
                if z + at * dz + sag(top, qx, qy) > dimple(top, qx, qy)[0]:
                    return _between(top, x, y, z, dx, dy, dz, at - per, at)
        t, u = end, end_u
    return NEVER


@inlined
def is_open(
    top: FormedTop, x: float, y: float, u: float, to_x: float, to_y: float, round_mm: float, to_u: float
) -> bool:
    """Whether the dimple certainly hides no straight line from a point of the top to a window.

    x, y, u : the point in press coordinates in plan, and its height above the untouched crown [mm]
    to_x, to_y, round_mm, to_u : middle of the window in press coordinates in plan, radius of a circle about it that
        contains the window, and the window's largest height above the crown [mm]

    Beyond some share of its length, a line is below the lowest point of the dimple that it passes. Up to there, the
    dimple must be less steep than the line.
    """
    vx, vy = to_x - x, to_y - y
    along2 = vx * vx + vy * vy
    at = min(max(-(x * vx + y * vy) / along2, 0.0), 1.0) if along2 > 0.0 else 0.0
    nearest = max(math.hypot(x + at * vx, y + at * vy) - round_mm, 0.0)
    far, drop = math.sqrt(along2) + round_mm, u - to_u
    near = far * max(u - _bounds(top, nearest * nearest)[0], 0.0)
    if near >= far * drop:
        return False
    nearest = max(nearest, math.hypot(x, y) - near / drop)
    return _bounds(top, nearest * nearest)[1] * far < drop


@inlined
def _bounds(top: FormedTop, r2: float) -> tuple[float, float, float]:
    """Lowest d [mm], largest slope of d [-] and largest cup of d [1/mm] from a squared radius r2 outward."""
    row = top.row
    if r2 >= top.numbers[OUTER] * top.numbers[OUTER]:
        return 0.0, 0.0, 0.0
    if r2 <= row[SPHERE_2]:
        return -top.numbers[DEPTH], NEVER, NEVER
    k = min(int(math.sqrt(row[SCALE] * r2 + row[OFFSET]) - row[START]), CELLS - 1)
    return row[LOWS + k], row[PIECES + PIECE_COLUMNS * k + STEEP], row[CUPS + k]


@kernel
def _between(
    top: FormedTop, x: float, y: float, z: float, dx: float, dy: float, dz: float, low: float, high: float
) -> float:
    """Distance at which a ray crosses the top between `low` (inside) and `high` (outside), by Newton's rule."""
    t = 0.5 * (low + high)
    for _ in range(60):
        off, grows = above_along(top, x + t * dx, y + t * dy, z + t * dz, dx, dy, dz)
        if off > 0.0:
            high = t
        else:
            low = t
        nearer = t - off / grows if grows > 0.0 else low
        if low < nearer < high:
            if abs(off) < NEAR_TOP_MM:
                return nearer
            t = nearer
        elif high - low < AT_TOP_MM or abs(off) < AT_TOP_MM:
            return t
        else:
            t = 0.5 * (low + high)
    return t


@inlined
def normal_at(top: FormedTop, x: float, y: float) -> tuple[float, float, float]:
    """Unit normal out of the elastomer at a point (x, y) of the top, in press coordinates."""
    sx, sy = crown_slopes(top, x, y)
    _, gx, gy = dimple(top, x, y)
    nx, ny = sx - gx, sy - gy
    per = 1.0 / math.sqrt(1.0 + nx * nx + ny * ny)
    return nx * per, ny * per, per


@inlined
def is_contact(top: FormedTop, x: float, y: float) -> bool:
    """Whether the tip touches the bare top at (x, y) in press coordinates. A skin hides what touches it."""
    if top.numbers[SKIN] != BARE:
        return False
    if top.numbers[GRID_STEP] > 0.0:
        return _level(top, x, y) > 0.0
    edge = top.numbers[CONTACT_EDGE]
    return x * x + y * y < edge * edge


@inlined
def is_skirt(top: FormedTop, x: float, y: float) -> bool:
    """Whether (x, y) in press coordinates is within the skirt: the outermost radius where the dimple is steep.

    On a grid, the skirt is all places near a node where the dimple is steep.
    """
    if top.numbers[GRID_STEP] > 0.0:
        i, j = near_node(top, x, y)
        return top.grid[i, j, STEEPER] > 0.0
    edge = top.numbers[SKIRT_EDGE]
    return x * x + y * y < edge * edge


def empty_row() -> FloatArray:
    """(1,) radial table of an untouched top, which is 0."""
    return np.zeros(1)


def empty_grid() -> FloatArray:
    """(1, 1, `NODE`) grid of a top whose dimple is radial."""
    return np.zeros((1, 1, NODE))


def out_of_frame(top: FormedTop, at_mm: FloatArray) -> FloatArray:
    """(n, 3) points of the untouched top in cavity coordinates, at (n, 2) press coordinates x and y [mm]."""
    x, y = at_mm.T
    kind, radius = top.numbers[KIND], top.numbers[RADIUS]
    fallen = np.zeros(len(x))
    if kind != FLAT:
        reach = y * y if kind == CYLINDER else x * x + y * y
        fallen = reach / (radius + np.sqrt(np.maximum(radius * radius - reach, 1e-12)))
    return np.asarray(np.column_stack([x, y, -fallen]) @ top.axes + top.origin)
