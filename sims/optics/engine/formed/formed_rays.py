# mypy: no-warn-return-any
"""Rays in a pad with a form: walls, windows, sight, and the first meeting of either with the top.

Points and directions are in the cavity frame; the top is evaluated in its own frame. `walls` (k, 3) has outward normals
and levels of the flat walls, `arcs` (m, 6) the round ones as in `sims.optics.scene.optical_scene`; windows are rows of
`sims.optics.engine.formed.formed_lower`.

The pad is convex. A ray from inside leaves a circle at one point; if that is in the arc's sector, the ray meets the arc
there, or another wall before.
"""

from __future__ import annotations

import math

from design.arrays import FloatArray
from sims.optics.engine.formed.formed_top import FormedTop, into, top_hit, turn
from sims.optics.surface.radial import inlined, kernel, lobe_at

NEVER = 1e30
BOTTOM, TOP = -1, -2
"""Codes of surfaces other than walls; walls have their number, the round ones after the flat ones."""
CX, CY, CZ, UX, UY, HALF_U, HALF_V, NX, NY, ORDER, AREA, WALL, TABLE = range(13)


@inlined
def plan_exit(
    x: float, y: float, z: float, dx: float, dy: float, dz: float, walls: FloatArray, arcs: FloatArray
) -> tuple[float, int]:
    """Distance to the first wall or the bottom, and which."""
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
    """Unit normal into the elastomer at a wall or the bottom."""
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
    """Distance to the first surface that a ray meets, and its code: a wall's number, `BOTTOM` or `TOP`."""
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
    """Point on a window; u, v from -1 to 1."""
    along = u * window[HALF_U]
    return window[CX] + along * window[UX], window[CY] + along * window[UY], window[CZ] + v * window[HALF_V]


@inlined
def lobe(window: FloatArray, cosine: float) -> float:
    """Radiance over power and area of an emitter's window at a cosine to its normal; for a receiver the counted share
    over pi [1/sr].
    """
    return lobe_at(window[ORDER], window, TABLE, cosine)


@inlined
def mirrored(x: float, y: float, z: float, nx: float, ny: float, nz: float) -> tuple[float, float, float]:
    """A vector, mirrored by a plane of a unit normal."""
    c = 2.0 * (x * nx + y * ny + z * nz)
    return x - c * nx, y - c * ny, z - c * nz


@inlined
def beside(x: float, y: float, z: float, nx: float, ny: float, nz: float) -> tuple[float, float, float]:
    """Unit vector along another vector, mirrored."""
    per = 1.0 / math.sqrt(x * x + y * y + z * z)
    return mirrored(x * per, y * per, z * per, nx, ny, nz)


@kernel
def landing(
    x: float, y: float, z: float, dx: float, dy: float, dz: float, r: FloatArray
) -> tuple[float, float, float]:
    """Point at which a ray crosses a window's plane, in half sizes, and the distance; -NEVER if it moves away."""
    toward = dx * r[NX] + dy * r[NY]
    if toward <= 1e-9:
        return 0.0, 0.0, -NEVER
    t = ((r[CX] - x) * r[NX] + (r[CY] - y) * r[NY]) / toward
    u = ((x + t * dx - r[CX]) * r[UX] + (y + t * dy - r[CY]) * r[UY]) / r[HALF_U]
    v = (z + t * dz - r[CZ]) / r[HALF_V]
    return u, v, t
