# mypy: no-warn-return-any
"""Light that a disc or crowned pad's emitters send to patches of wall, bottom and tip, and receivers take from them.

Model
-----
It is assumed that a press changes all scattered light by the same factor as light scattered once:

    S = S_0 · J / J_0,      J = Σ_p ρ_p G_p T_p / A_p

S_0 is the untouched pad's scattered light (`scattered`). G_p is the light of the emitter on patch p, direct or
mirrored by the top, or scattered by its skin. T_p is the light that the receiver would send to p (reciprocity). Bottom
patches are squares in plan. Wall patches are divided by direction from the middle of the pad and by height. The contact
has `TIP_RINGS` rings of equal area, each in `TIP_TURNS` parts.

The rays of each emitter or receiver form batches of every n-th ray; their differences give the error.

The model leaves out that the press obstructs light scattered more than once.
"""

from __future__ import annotations

import math

from optopad.design.arrays import FloatArray
from optopad.sims.optics.engine.general.rays import (
    BOTTOM,
    HALF_U,
    HALF_V,
    TOP,
    meeting,
    returned,
)
from optopad.sims.optics.engine.general.scattered import (
    FAINT,
    FIRST,
    face_before,
    scattered_way,
    sent_ray,
    window_at,
)
from optopad.sims.optics.engine.general.top import (
    GRID_STEP,
    PATCH,
    SKIN,
    FormedTop,
    into,
    is_contact,
    near_node,
    normal_at,
    out_of,
)
from optopad.sims.optics.surface.curves import CONTACT, CONTACT_PARTS
from optopad.sims.optics.surface.radial import kernel

MOST_MIRRORS = 24
RAY_BATCHES = 4
TIP_RINGS, TIP_TURNS = 6, 12
TIP_PATCHES = TIP_RINGS * TIP_TURNS
# numbers of a patch layout
MIDDLE_X, MIDDLE_Y, PER_MM, COLUMNS, ROWS, TURNS, LEVELS, PER_LEVEL = range(8)


@kernel
def deposit(
    window: FloatArray, receivers: FloatArray, rays: int, steps: FloatArray, shift: FloatArray, absorbs: float,
    index: float, walls: FloatArray, arcs: FloatArray, top: FormedTop, layout: FloatArray, out: FloatArray,
) -> None:  # fmt: skip
    """Add to `out` (batch, patch) the light on patches from rays of an emitter or receiver; the tip's come last."""
    unit = 4.0 * window[HALF_U] * window[HALF_V] / window[10] / rays
    for n in range(rays):
        x, y, z, dx, dy, dz, radiance = sent_ray(window, n, steps, shift)
        weight = math.pi * radiance * unit
        for times in range(MOST_MIRRORS):
            t, what = meeting(x, y, z, dx, dy, dz, walls, arcs, top)
            if face_before(x, y, z, dx, dy, dz, t, receivers)[1] >= 0:
                break
            weight *= math.exp(-absorbs * t)
            x, y, z = x + t * dx, y + t * dy, z + t * dz
            if what != TOP:
                if window_at(what, x, y, z, receivers) < 0:
                    out[n % RAY_BATCHES, patch_of(what, x, y, z, layout)] += weight
                break
            qx, qy, _ = into(top, x, y, z)
            if is_contact(top, qx, qy):
                patch = out.shape[1] - TIP_PATCHES + tip_patch(top, qx, qy)
                out[n % RAY_BATCHES, patch] += weight
                break
            nx, ny, nz = normal_at(top, qx, qy)
            nx, ny, nz = out_of(top, nx, ny, nz)
            meets = dx * nx + dy * ny + dz * nz
            if meets <= 0.0:
                break
            if top.numbers[SKIN] > 0.0:
                weight *= top.numbers[SKIN]
                if weight < FAINT / rays:
                    break
                first = FIRST + 2 * times % (steps.shape[0] - FIRST)
                dx, dy, dz = scattered_way(-nx, -ny, -nz, n, first, steps, shift)
                x, y, z = x - 1e-7 * nx, y - 1e-7 * ny, z - 1e-7 * nz
                continue
            weight *= returned(meets, index)
            if weight < FAINT / rays:
                break
            dx, dy, dz = dx - 2.0 * meets * nx, dy - 2.0 * meets * ny, dz - 2.0 * meets * nz
            x, y, z = x - 1e-7 * nx, y - 1e-7 * ny, z - 1e-7 * nz


@kernel
def patch_of(what: int, x: float, y: float, z: float, layout: FloatArray) -> int:
    """Number of the patch at a point of the bottom or a wall, given the code of the surface."""
    columns, rows = int(layout[COLUMNS]), int(layout[ROWS])
    if what == BOTTOM:
        i = min(max(int(x * layout[PER_MM]), 0), columns - 1)
        j = min(max(int(y * layout[PER_MM]), 0), rows - 1)
        return i * rows + j
    turns, levels = int(layout[TURNS]), int(layout[LEVELS])
    turn = math.atan2(y - layout[MIDDLE_Y], x - layout[MIDDLE_X]) / (2.0 * math.pi) + 0.5
    k = min(max(int(turn * turns), 0), turns - 1)
    m = min(max(int(z * layout[PER_LEVEL]), 0), levels - 1)
    return columns * rows + k * levels + m


@kernel
def tip_patch(top: FormedTop, x: float, y: float) -> int:
    """Number of the tip's patch at a point (x, y) of the contact, in press coordinates."""
    if top.numbers[GRID_STEP] > 0.0:
        i, j = near_node(top, x, y)
        return int(top.grid[i, j, PATCH])
    r2, ring = x * x + y * y, 0
    for k in range(1, TIP_RINGS):
        if r2 >= top.row[CONTACT + k * CONTACT_PARTS // TIP_RINGS]:
            ring = k
    turn = math.atan2(y, x) / (2.0 * math.pi) + 0.5
    return ring * TIP_TURNS + min(int(turn * TIP_TURNS), TIP_TURNS - 1)
