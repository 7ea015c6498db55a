# mypy: allow-untyped-defs, allow-untyped-calls, allow-untyped-decorators
"""Kernels: the radial table of one tip, and what does not depend on the top.

`rows` (tip, n) hold `sims.optics.surface.SurfaceStack` tip by tip (`ROW` columns); `box` is (length, width,
height, refractive index, absorption per mm, index behind smooth walls or 0). A patch is a row (wall, along, z,
half width, half height, Lambertian order or -1, full area as mounted, radiance over the cosine's nodes ...).
Fresnel: unpolarised, from inside (Born and Wolf, sec. 1.5).
"""

from __future__ import annotations

import math

from numba import njit

from sims.optics.surface import (
    ACTIVE,
    CELLS,
    CUBIC,
    GRADING,
    OUTER_R,
    SPHERE_R,
    SPHERE_Z,
    STEEPEST,
    TIP_R,
    TOP,
)

PATCH_TABLE = 7

kernel = njit(error_model="numpy")


@kernel
def distance(dx, dy):
    """Length of a vector in plan; lengths here are far from overflow, which spares the care of hypot."""
    return math.sqrt(dx * dx + dy * dy)


@kernel
def fresnel(cos_angle, index):
    """Unpolarised reflectance from inside; 1 beyond the critical angle."""
    sin2 = index * index * (1.0 - cos_angle * cos_angle)
    if sin2 >= 1.0:
        return 1.0
    cos_t = math.sqrt(1.0 - sin2)
    rs = (index * cos_angle - cos_t) / (index * cos_angle + cos_t)
    rp = (cos_angle - index * cos_t) / (cos_angle + index * cos_t)
    return 0.5 * (rs * rs + rp * rp)


@kernel
def wall_point(wall, along, z, box):
    """Point of a wall at `along`, z."""
    if wall == 0:
        return along, 0.0, z
    if wall == 1:
        return box[0], along, z
    if wall == 2:
        return along, box[1], z
    return 0.0, along, z


@kernel
def wall_normal(wall):
    """Inward normal (x, y) of a wall."""
    if wall == 0:
        return 0.0, 1.0
    if wall == 1:
        return -1.0, 0.0
    if wall == 2:
        return 0.0, -1.0
    return 1.0, 0.0


@kernel
def mirrored_share(cos_angle, index, behind):
    """Unpolarised reflectance at a smooth face from an index to the one behind it; 1 beyond the critical angle."""
    ratio = index / behind
    sin2 = ratio * ratio * (1.0 - cos_angle * cos_angle)
    if sin2 >= 1.0:
        return 1.0
    cos_t = math.sqrt(1.0 - sin2)
    rs = (ratio * cos_angle - cos_t) / (ratio * cos_angle + cos_t)
    rp = (cos_angle - ratio * cos_t) / (cos_angle + ratio * cos_t)
    return 0.5 * (rs * rs + rp * rp)


@kernel
def radiance(patch, cosine):
    """Radiance over power and area that a patch sends at a cosine to its normal; 1/pi if it is Lambertian [1/sr].

    For a receiver pi times this is the share that it counts of light from there.
    """
    order = patch[5]
    if order == 1.0:
        return 1.0 / math.pi
    if order >= 0.0:
        return (order + 1.0) / (2.0 * math.pi) * cosine ** (order - 1.0)
    last = patch.shape[0] - PATCH_TABLE - 1
    x = min(max(cosine, 0.0), 1.0) * last
    k = min(int(x), last - 1)
    low = patch[PATCH_TABLE + k]
    return low + (x - k) * (patch[PATCH_TABLE + k + 1] - low)


@kernel
def wall_hit(x, y, z, dx, dy, dz, box):
    """Distance to the nearest wall or the bottom, and which (0-3 walls, 4 bottom, -1 none)."""
    t = 1e30
    kind = -1
    if dx > 0.0:
        t = (box[0] - x) / dx
        kind = 1
    elif dx < 0.0:
        t = -x / dx
        kind = 3
    if dy > 0.0:
        ty = (box[1] - y) / dy
        if ty < t:
            t = ty
            kind = 2
    elif dy < 0.0:
        ty = -y / dy
        if ty < t:
            t = ty
            kind = 0
    if dz < 0.0:
        tz = -z / dz
        if tz < t:
            t = tz
            kind = 4
    return t, kind


@kernel
def _cell_x(r, tip, rows):
    """Table coordinate x in 0..1 of a radius beyond the sphere."""
    q = (r - rows[tip, SPHERE_R]) / (rows[tip, OUTER_R] - rows[tip, SPHERE_R])
    return 2.0 * q / (GRADING + math.sqrt(GRADING * GRADING + 4.0 * (1.0 - GRADING) * q))


@kernel
def height(r, tip, rows):
    """Height of the top above the bottom."""
    if rows[tip, ACTIVE] == 0.0 or r >= rows[tip, OUTER_R]:
        return rows[tip, TOP]
    if r <= rows[tip, SPHERE_R]:
        return rows[tip, SPHERE_Z] - math.sqrt(rows[tip, TIP_R] * rows[tip, TIP_R] - r * r)
    x = _cell_x(r, tip, rows) * CELLS
    k = min(int(x), CELLS - 1)
    t = x - k
    return rows[tip, CUBIC + 4 * k] + t * (
        rows[tip, CUBIC + 4 * k + 1] + t * (rows[tip, CUBIC + 4 * k + 2] + t * rows[tip, CUBIC + 4 * k + 3])
    )


@kernel
def height_and_slope(r, tip, rows):
    """Height of the top and dh/dr."""
    if rows[tip, ACTIVE] == 0.0 or r >= rows[tip, OUTER_R]:
        return rows[tip, TOP], 0.0
    if r <= rows[tip, SPHERE_R]:
        root = math.sqrt(rows[tip, TIP_R] * rows[tip, TIP_R] - r * r)
        return rows[tip, SPHERE_Z] - root, r / root
    x = _cell_x(r, tip, rows)
    per_mm = CELLS / ((rows[tip, OUTER_R] - rows[tip, SPHERE_R]) * (GRADING + 2.0 * (1.0 - GRADING) * x))
    x *= CELLS
    k = min(int(x), CELLS - 1)
    t = x - k
    h = rows[tip, CUBIC + 4 * k] + t * (
        rows[tip, CUBIC + 4 * k + 1] + t * (rows[tip, CUBIC + 4 * k + 2] + t * rows[tip, CUBIC + 4 * k + 3])
    )
    return h, (
        rows[tip, CUBIC + 4 * k + 1]
        + t * (2.0 * rows[tip, CUBIC + 4 * k + 2] + t * 3.0 * rows[tip, CUBIC + 4 * k + 3])
    ) * per_mm


@kernel
def height_slope_bend(r, tip, rows):
    """Height of the top, dh/dr and d²h/dr² beyond the sphere."""
    if rows[tip, ACTIVE] == 0.0 or r >= rows[tip, OUTER_R]:
        return rows[tip, TOP], 0.0, 0.0
    x = _cell_x(r, tip, rows)
    span = rows[tip, OUTER_R] - rows[tip, SPHERE_R]
    per_mm = 1.0 / (span * (GRADING + 2.0 * (1.0 - GRADING) * x))
    turn = -2.0 * (1.0 - GRADING) * span * per_mm * per_mm * per_mm
    x *= CELLS
    k = min(int(x), CELLS - 1)
    t = x - k
    h = rows[tip, CUBIC + 4 * k] + t * (
        rows[tip, CUBIC + 4 * k + 1] + t * (rows[tip, CUBIC + 4 * k + 2] + t * rows[tip, CUBIC + 4 * k + 3])
    )
    first = (
        rows[tip, CUBIC + 4 * k + 1]
        + t * (2.0 * rows[tip, CUBIC + 4 * k + 2] + t * 3.0 * rows[tip, CUBIC + 4 * k + 3])
    ) * CELLS
    second = (2.0 * rows[tip, CUBIC + 4 * k + 2] + t * 6.0 * rows[tip, CUBIC + 4 * k + 3]) * (CELLS * CELLS)
    return h, first * per_mm, second * per_mm * per_mm + first * turn


@kernel
def slope_bound(r, tip, rows):
    """Largest |dh/dr| at this radius and beyond."""
    if rows[tip, ACTIVE] == 0.0 or r >= rows[tip, OUTER_R]:
        return 0.0
    if r <= rows[tip, SPHERE_R]:
        return rows[tip, STEEPEST]
    return rows[tip, STEEPEST + min(int(_cell_x(r, tip, rows) * CELLS), CELLS - 1)]


@kernel
def fall_bound(r, tip, rows):
    """Largest fall -dh/dr at this radius and beyond."""
    if rows[tip, ACTIVE] == 0.0 or r >= rows[tip, OUTER_R]:
        return 0.0
    if r <= rows[tip, SPHERE_R]:
        return rows[tip, STEEPEST + CELLS + 1]
    return rows[tip, STEEPEST + CELLS + 1 + min(int(_cell_x(r, tip, rows) * CELLS), CELLS - 1)]
