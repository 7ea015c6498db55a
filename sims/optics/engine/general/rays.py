# mypy: no-warn-return-any
"""Rays in a disc or crowned pad: where they meet walls, bottom, top, and *windows* (faces of emitters and receivers).
Points and directions are in cavity coordinates; the top is evaluated in press coordinates. `walls` (k, 3) holds the
outward normal of each flat wall and its distance from the origin, `arcs` (m, 6) the round walls as in `PadForm`.
Windows are rows of `optopad.sims.optics.engine.general.lower.windows_of`.

The pad is convex. So a ray from inside leaves the full circle of an arc at one point. If this point is in the arc's
sector, the ray meets the arc there, unless it meets another wall before.
"""

from __future__ import annotations

import math

from optopad.design.arrays import FloatArray
from optopad.sims.optics.engine.general.top import FormedTop, into, top_hit, turn
from optopad.sims.optics.surface.radial import fresnel, inlined, kernel, lobe_at

NEVER = 1e30
BOTTOM, TOP, INSIDE = -1, -2, -3
"""Codes of surfaces other than walls. A wall's code is its number; round walls come after flat ones. `INSIDE` is the
wall of a face that stands in the layer."""
CX, CY, CZ, UX, UY, HALF_U, HALF_V, NX, NY, ORDER, AREA, WALL, NZ, VX, VY, VZ, TABLE = range(17)


@inlined
def plan_exit(
    x: float, y: float, z: float, dx: float, dy: float, dz: float, walls: FloatArray, arcs: FloatArray
) -> tuple[float, int]:
    """Distance to the first wall or the bottom [mm], and its code."""
    best, which = NEVER, BOTTOM
    if dz < 0.0:
        best = -z / dz
    for k in range(walls.shape[0]):
        toward = dx * walls[k, 0] + dy * walls[k, 1]
        if toward > 1e-12:
            t = (walls[k, 2] - x * walls[k, 0] - y * walls[k, 1]) / toward
            if t < best:
                best, which = t, k
    a = dx * dx + dy * dy
    if a > 1e-14:
        for k in range(arcs.shape[0]):
            radius = arcs[k, 2]
            px, py = x - arcs[k, 0], y - arcs[k, 1]
            b = px * dx + py * dy
            gap = b * b - a * (px * px + py * py - radius * radius)
            t = (-b + math.sqrt(max(gap, 0.0))) / a
            if t < best and (px + t * dx) * arcs[k, 3] + (py + t * dy) * arcs[k, 4] >= arcs[k, 5] * radius:
                best, which = t, walls.shape[0] + k
    return max(best, 0.0), which


@inlined
def inward(which: int, x: float, y: float, walls: FloatArray, arcs: FloatArray) -> tuple[float, float, float]:
    """Unit normal of a wall or the bottom at a point, pointing into the elastomer."""
    if which == BOTTOM:
        return 0.0, 0.0, 1.0
    if which >= walls.shape[0]:
        k = which - walls.shape[0]
        return (arcs[k, 0] - x) / arcs[k, 2], (arcs[k, 1] - y) / arcs[k, 2], 0.0
    return -walls[which, 0], -walls[which, 1], 0.0


@kernel
def meeting(
    x: float, y: float, z: float, dx: float, dy: float, dz: float, walls: FloatArray, arcs: FloatArray,
    top: FormedTop,
) -> tuple[float, int]:  # fmt: skip
    """Distance to the first surface that a ray meets [mm], and its code: a wall's number, `BOTTOM` or `TOP`."""
    limit, which = plan_exit(x, y, z, dx, dy, dz, walls, arcs)
    ax, ay, az = into(top, x, y, z)
    bx, by, bz = turn(top, dx, dy, dz)
    t = top_hit(top, ax, ay, az, bx, by, bz, limit)
    if t < limit:
        return t, TOP
    return limit, which


@inlined
def sees(x: float, y: float, z: float, tx: float, ty: float, tz: float, top: FormedTop) -> bool:
    """Whether the straight line between two points of the pad stays below the top."""
    dx, dy, dz = tx - x, ty - y, tz - z
    size = math.sqrt(dx * dx + dy * dy + dz * dz)
    per = 1.0 / size
    ax, ay, az = into(top, x, y, z)
    bx, by, bz = turn(top, dx * per, dy * per, dz * per)
    return top_hit(top, ax, ay, az, bx, by, bz, size - 1e-7) >= size - 1e-7


@inlined
def window_point(window: FloatArray, u: float, v: float) -> tuple[float, float, float]:
    """Point (x, y, z) of a window at u along the wall and v in height, both from -1 to 1."""
    along, up = u * window[HALF_U], v * window[HALF_V]
    return (
        window[CX] + along * window[UX] + up * window[VX],
        window[CY] + along * window[UY] + up * window[VY],
        window[CZ] + up * window[VZ],
    )


@inlined
def onto(window: FloatArray, dx: float, dy: float, dz: float) -> float:
    """Component of a vector along a window's outward normal."""
    return dx * window[NX] + dy * window[NY] + dz * window[NZ]


@inlined
def up_window(window: FloatArray, dx: float, dy: float, dz: float) -> float:
    """Component of a vector along a window's height."""
    return dx * window[VX] + dy * window[VY] + dz * window[VZ]


@inlined
def share_wall(e: FloatArray, r: FloatArray) -> bool:
    """Whether two windows are in one wall, so that only the dimple's skirt could mirror light between them."""
    return e[WALL] == r[WALL] and e[WALL] >= 0.0


@inlined
def returned(cosine: float, index: float) -> float:
    """Share of light that the top mirrors: Fresnel's by the refractive index, or that of a skin, given as minus it."""
    return fresnel(cosine, index) if index > 0.0 else -index


@inlined
def lobe(window: FloatArray, cosine: float) -> float:
    """Radiance of an emitter's window, divided by its power per area, at a cosine to its normal [1/sr].

    For a receiver, pi times this value is the share of light that is counted.
    """
    return lobe_at(window[ORDER], window, TABLE, cosine)


@inlined
def mirrored(x: float, y: float, z: float, nx: float, ny: float, nz: float) -> tuple[float, float, float]:
    """Mirror a vector in a plane with a unit normal."""
    c = 2.0 * (x * nx + y * ny + z * nz)
    return x - c * nx, y - c * ny, z - c * nz


@inlined
def mirrored_unit(
    x: float, y: float, z: float, nx: float, ny: float, nz: float
) -> tuple[float, float, float]:
    """Mirror a vector in a plane with a unit normal and scale it to length 1."""
    per = 1.0 / math.sqrt(x * x + y * y + z * z)
    return mirrored(x * per, y * per, z * per, nx, ny, nz)


@kernel
def landing(
    x: float, y: float, z: float, dx: float, dy: float, dz: float, r: FloatArray
) -> tuple[float, float, float]:
    """Where a ray crosses a window's plane: u, v in half sizes of the window, and distance (-NEVER: moves away)."""
    toward = onto(r, dx, dy, dz)
    if toward <= 1e-9:
        return 0.0, 0.0, -NEVER
    t = onto(r, r[CX] - x, r[CY] - y, r[CZ] - z) / toward
    u = ((x + t * dx - r[CX]) * r[UX] + (y + t * dy - r[CY]) * r[UY]) / r[HALF_U]
    v = up_window(r, x + t * dx - r[CX], y + t * dy - r[CY], z + t * dz - r[CZ]) / r[HALF_V]
    return u, v, t
