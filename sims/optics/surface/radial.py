# mypy: no-warn-return-any
"""Kernels: the radial table of one tip's curve, and basic functions of walls, patches and Fresnel reflection.

`row` (`ROW`,) has the columns of `optopad.sims.optics.surface.curves.SurfaceStack`. `box` is (length, width, height,
refractive index, absorption per mm, index behind smooth walls or 0). The active area of an emitter or receiver is a
`patch`: wall, centre along the wall, z, half width, half height, Lambertian order (-1: table), full area as mounted,
then a table of radiance at the cosine's nodes. Fresnel reflection is unpolarised, from inside (Born and Wolf, 1.5).
"""

from __future__ import annotations

import math
from typing import Any

from numba import njit

from optopad.design.arrays import FloatArray
from optopad.sims.optics.kernel_types import KernelDecorator
from optopad.sims.optics.surface.curves import (
    CELLS,
    CONTACT,
    CONTACT_PARTS,
    FALL,
    LOWEST,
    OFFSET,
    OUTER_2,
    PER_LEVEL,
    PIECE_COLUMNS,
    PIECES,
    REACH,
    SCALE,
    SPHERE_2,
    SPHERE_Z,
    START,
    STEEP,
    TIP_2,
    TOP,
)

PATCH_TABLE = 7

UNSEEN: dict[str, Any] = {
    "error_model": "numpy",
    "fastmath": {"contract", "nsz", "arcp"},
    "no_cpython_wrapper": True,
    "no_cfunc_wrapper": True,
}
"""Numba options of kernels that only other kernels call. They have no entry from Python or C, which would take a
seventh of the time to compile; only kernels in `compiled` have one. The processor may fuse multiplications with sums;
infinities and NaN keep their meaning. Sums keep their order, which costs 3 % of the run time. Otherwise the order would
differ between the process that compiles a kernel and later ones, which load it as part of an entry point."""
UNCOUNTED: dict[str, Any] = UNSEEN | {"_nrt": False}
"""The same options, but without Numba's reference counts of arrays. These took an eighth of the run time, as the
compiler cannot remove them for arrays in a named tuple. Such a kernel must neither make nor return an array; Numba
refuses one that does."""
array_kernel: KernelDecorator = njit(**UNSEEN)
kernel: KernelDecorator = njit(**UNCOUNTED)
inlined: KernelDecorator = njit(**UNCOUNTED, forceinline=True)
"""Decorator of functions that every ray calls: a call with an array costs as much as a square root, so they are
inlined."""

NEVER = 1e30


@inlined
def distance(dx: float, dy: float) -> float:
    """Length of a vector in plan. Values are far from overflow, so the slower `hypot` is not needed."""
    return math.sqrt(dx * dx + dy * dy)


@inlined
def contact_radius_2(share: float, row: FloatArray) -> tuple[float, float]:
    """Squared radius within which a tip's contact has this share of its area [mm²], and its derivative by the share."""
    parts = share * CONTACT_PARTS
    part = min(int(parts), CONTACT_PARTS - 1)
    low = row[CONTACT + part]
    step = row[CONTACT + part + 1] - low
    return low + (parts - part) * step, CONTACT_PARTS * step


@kernel
def fresnel(cos_angle: float, index: float) -> float:
    """Unpolarised Fresnel reflectance from inside against air; 1 beyond the critical angle [-]."""
    sin2 = index * index * (1.0 - cos_angle * cos_angle)
    if sin2 >= 1.0:
        return 1.0
    cos_t = math.sqrt(1.0 - sin2)
    rs = (index * cos_angle - cos_t) / (index * cos_angle + cos_t)
    rp = (cos_angle - index * cos_t) / (cos_angle + index * cos_t)
    return 0.5 * (rs * rs + rp * rp)


@kernel
def wall_point(wall: int, along: float, z: float, box: FloatArray) -> tuple[float, float, float]:
    """Point (x, y, z) of a wall at a position along it and a height [mm]."""
    if wall == 0:
        return along, 0.0, z
    if wall == 1:
        return box[0], along, z
    if wall == 2:
        return along, box[1], z
    return 0.0, along, z


@kernel
def wall_normal(wall: int) -> tuple[float, float]:
    """Inward normal (x, y) of a wall."""
    if wall == 0:
        return 0.0, 1.0
    if wall == 1:
        return -1.0, 0.0
    if wall == 2:
        return 0.0, -1.0
    return 1.0, 0.0


@kernel
def mirrored_share(cos_angle: float, index: float, behind: float) -> float:
    """Unpolarised Fresnel reflectance from index `index` to index `behind`; 1 beyond the critical angle."""
    ratio = index / behind
    sin2 = ratio * ratio * (1.0 - cos_angle * cos_angle)
    if sin2 >= 1.0:
        return 1.0
    cos_t = math.sqrt(1.0 - sin2)
    rs = (ratio * cos_angle - cos_t) / (ratio * cos_angle + cos_t)
    rp = (cos_angle - ratio * cos_t) / (cos_angle + ratio * cos_t)
    return 0.5 * (rs * rs + rp * rp)


@kernel
def radiance(patch: FloatArray, cosine: float) -> float:
    """Radiance of a patch, divided by its power per area, at a cosine to its normal [1/sr]; 1/pi if Lambertian.

    For a receiver, pi times this value is the share of light from that direction that is counted.
    """
    return lobe_at(patch[5], patch, PATCH_TABLE, cosine)


@inlined
def lobe_at(order: float, row: FloatArray, first: int, cosine: float) -> float:
    """Radiance, divided by power per area, at a cosine [1/sr], by Lambertian order.

    If the order is negative, the radiance is read from a table that begins at column `first` of `row`.
    """
    if order == 1.0:
        return 1.0 / math.pi
    if order >= 0.0:
        return (order + 1.0) / (2.0 * math.pi) * cosine ** (order - 1.0)
    last = row.shape[0] - first - 1
    x = min(max(cosine, 0.0), 1.0) * last
    k = min(int(x), last - 1)
    low = row[first + k]
    return low + (x - k) * (row[first + k + 1] - low)


@inlined
def wall_hit(
    x: float, y: float, z: float, dx: float, dy: float, dz: float, box: FloatArray
) -> tuple[float, int]:
    """Distance to the nearest wall or the bottom [mm], and the surface met: 0-3 walls, 4 bottom, -1 none.

    The code has no branches on the signs of the ray's direction, because a processor could not predict them.
    """
    per_x = 1.0 / dx if dx != 0.0 else NEVER
    per_y = 1.0 / dy if dy != 0.0 else NEVER
    tx = max((box[0] - x) * per_x, -x * per_x)
    ty = max((box[1] - y) * per_y, -y * per_y)
    t = min(tx, ty)
    kind = (1 if dx > 0.0 else 3) if tx <= ty else (2 if dy > 0.0 else 0)
    kind = kind if t < NEVER else -1
    tz = -z / dz if dz < 0.0 else NEVER
    kind = 4 if tz < t else kind
    return min(t, tz), kind


@inlined
def height(r2: float, row: FloatArray) -> float:
    """Height of the top above the bottom at a squared radius from the tip's axis [mm]."""
    if r2 >= row[OUTER_2]:
        return row[TOP]
    if r2 <= row[SPHERE_2]:
        return row[SPHERE_Z] - math.sqrt(row[TIP_2] - r2)
    x = math.sqrt(row[SCALE] * r2 + row[OFFSET]) - row[START]
    k = min(int(x), CELLS - 1)
    t = x - k
    c = PIECES + PIECE_COLUMNS * k
    return row[c] + t * (row[c + 1] + t * (row[c + 2] + t * row[c + 3]))


@inlined
def height_and_slope(r2: float, row: FloatArray) -> tuple[float, float]:
    """Height of the top [mm], and (dh/dr) / r [1/mm], which times (x, y) is the gradient."""
    if r2 >= row[OUTER_2]:
        return row[TOP], 0.0
    if r2 <= row[SPHERE_2]:
        root = math.sqrt(row[TIP_2] - r2)
        return row[SPHERE_Z] - root, 1.0 / root
    w = math.sqrt(row[SCALE] * r2 + row[OFFSET])
    x = w - row[START]
    k = min(int(x), CELLS - 1)
    t = x - k
    c = PIECES + PIECE_COLUMNS * k
    c1, c2, c3 = row[c + 1], row[c + 2], row[c + 3]
    first = c1 + t * (2.0 * c2 + t * 3.0 * c3)
    return row[c] + t * (c1 + t * (c2 + t * c3)), first * row[SCALE] / w


@kernel
def height_slope_curvature(r2: float, row: FloatArray) -> tuple[float, float, float]:
    """Height of the top [mm], q = (dh/dr) / r [1/mm], and (dq/dr) / r [1/mm³]."""
    if r2 >= row[OUTER_2]:
        return row[TOP], 0.0, 0.0
    if r2 <= row[SPHERE_2]:
        root = math.sqrt(row[TIP_2] - r2)
        return row[SPHERE_Z] - root, 1.0 / root, 1.0 / (root * root * root)
    w = math.sqrt(row[SCALE] * r2 + row[OFFSET])
    x = w - row[START]
    k = min(int(x), CELLS - 1)
    t = x - k
    c = PIECES + PIECE_COLUMNS * k
    c1, c2, c3 = row[c + 1], row[c + 2], row[c + 3]
    per = row[SCALE] / w
    turn = (c1 + t * (2.0 * c2 + t * 3.0 * c3)) * per
    bend = (2.0 * c2 + t * 6.0 * c3) * per * per - turn * per / w
    return row[c] + t * (c1 + t * (c2 + t * c3)), turn, bend


@inlined
def _piece(r2: float, row: FloatArray) -> int:
    """Column where the data of the piece at a squared radius begin; within the sphere, those of the first piece."""
    if r2 <= row[SPHERE_2]:
        return PIECES
    k = int(math.sqrt(row[SCALE] * r2 + row[OFFSET]) - row[START])
    return PIECES + PIECE_COLUMNS * min(k, CELLS - 1)


@inlined
def slope_bound(r2: float, row: FloatArray) -> float:
    """Largest |dh/dr| at this squared radius and beyond."""
    return 0.0 if r2 >= row[OUTER_2] else row[_piece(r2, row) + STEEP]


@kernel
def fall_bound(r2: float, row: FloatArray) -> float:
    """Largest fall -dh/dr at this squared radius and beyond."""
    return 0.0 if r2 >= row[OUTER_2] else row[_piece(r2, row) + FALL]


@inlined
def reach2(z: float, row: FloatArray) -> float:
    """Squared radius beyond which the top is nowhere below z [mm²], z below the undisturbed top; -1: nowhere at all."""
    if z <= row[LOWEST]:
        return -1.0
    return row[REACH + int((z - row[LOWEST]) * row[PER_LEVEL])]
