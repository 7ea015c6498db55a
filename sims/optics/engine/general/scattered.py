# mypy: no-warn-return-any
"""Light that walls, bottom or tip of a disc or crowned pad scatter: weighted rays, each connected to every receiver.

Model
-----
Rays leave an emitter with Lambertian directions of a low-discrepancy sequence, weighted by its angular pattern. The top
mirrors Fresnel's share; absorption follows Beer and Lambert. Walls, bottom and tip scatter light with a Lambertian
distribution, by their reflectances. Every point of scattering is connected to every receiver by one ray to a point on
the receiver's face, its window. This adds

    weight · c_s c_r A(c_r) area / (π s²) · e^(-μ s)

Light that the top mirrors after its last scattering is counted if the ray itself meets a receiver. A ray's random
numbers depend on its number and on how often it was scattered, not on the press.

A skin of the top mirrors a constant share, or scatters it. Light that a scattering skin alone scattered once is left to
`optopad.sims.optics.engine.general.skin`.

The model leaves out smooth walls, light below `FAINT` of the emitter's power, and the bodies of parts in the layer.
"""

from __future__ import annotations

import math

from optopad.design.arrays import FloatArray
from optopad.sims.optics.engine.general.rays import (
    BOTTOM,
    CX,
    CY,
    CZ,
    HALF_U,
    HALF_V,
    INSIDE,
    NX,
    NY,
    NZ,
    TOP,
    UX,
    UY,
    WALL,
    inward,
    landing,
    lobe,
    meeting,
    onto,
    returned,
    sees,
    up_window,
    window_point,
)
from optopad.sims.optics.engine.general.top import OUTER, SKIN, FormedTop, into, is_contact, normal_at, out_of
from optopad.sims.optics.surface.radial import kernel

FAINT = 1e-7
MOST_SCATTERED, MOST_UNDER_SKIN, MOST_FLIGHTS = 6, 16, 60
"""Largest number of scatterings of a ray, also under a skin that scatters, and of its straight pieces."""
FIRST, PER_SCATTER = 4, 4
DIMENSIONS, DIMENSIONS_UNDER_SKIN = (FIRST + PER_SCATTER * most for most in (MOST_SCATTERED, MOST_UNDER_SKIN))
"""Number of random numbers per ray: for a point and direction at the emitter; then, for each scattering, for a
direction and for a point on the receivers' faces."""


@kernel
def scattered_flux(
    e: FloatArray, receivers: FloatArray, rays: int, steps: FloatArray, shift: FloatArray, absorbs: float,
    index: float, reflectances: FloatArray, walls: FloatArray, arcs: FloatArray, top: FormedTop, out: FloatArray,
) -> None:  # fmt: skip
    """Add an emitter's light per emitted power to `out` (2, receiver): scattered once, and scattered more often.

    rays : number of rays
    steps, shift : (DIMENSIONS or DIMENSIONS_UNDER_SKIN,) steps and offsets of the random sequence
    reflectances : (3,) reflectances of walls, bottom and tip
    """
    submerged = e[HALF_V] * e[HALF_U] * 4.0 / e[10]
    for n in range(rays):
        x, y, z, dx, dy, dz, radiance = sent_ray(e, n, steps, shift)
        weight = math.pi * radiance * submerged / rays
        _walk(x, y, z, dx, dy, dz, weight, FAINT / rays, n, receivers, steps, shift, absorbs, index, reflectances,
              walls, arcs, top, out)  # fmt: skip


@kernel
def _walk(
    x: float, y: float, z: float, dx: float, dy: float, dz: float, weight: float, faint: float, n: int,
    receivers: FloatArray, steps: FloatArray, shift: FloatArray, absorbs: float, index: float, reflectances: FloatArray,
    walls: FloatArray, arcs: FloatArray, top: FormedTop, out: FloatArray,
) -> None:  # fmt: skip
    times, by_skin, is_mirrored = 0, 0, False
    most = (steps.shape[0] - FIRST) // PER_SCATTER
    for _ in range(MOST_FLIGHTS):
        t, what = meeting(x, y, z, dx, dy, dz, walls, arcs, top)
        t, face = face_before(x, y, z, dx, dy, dz, t, receivers)
        weight *= math.exp(-absorbs * t)
        x, y, z = x + t * dx, y + t * dy, z + t * dz
        if face >= 0:
            if times > 0 and is_mirrored:
                out[min(times, 2) - 1, face] += (
                    weight * math.pi * lobe(receivers[face], onto(receivers[face], dx, dy, dz))
                )
            return
        is_skin = what == TOP and top.numbers[SKIN] > 0.0
        if what == TOP:
            qx, qy, _ = into(top, x, y, z)
            nx, ny, nz = normal_at(top, qx, qy)
            nx, ny, nz = out_of(top, nx, ny, nz)
            if not is_skin and not is_contact(top, qx, qy):
                meets = dx * nx + dy * ny + dz * nz
                if meets <= 0.0:
                    return
                weight *= returned(meets, index)
                if weight < faint:
                    return
                dx, dy, dz = dx - 2.0 * meets * nx, dy - 2.0 * meets * ny, dz - 2.0 * meets * nz
                x, y, z = x - 1e-7 * nx, y - 1e-7 * ny, z - 1e-7 * nz
                is_mirrored = True
                continue
            nx, ny, nz = -nx, -ny, -nz
            weight *= top.numbers[SKIN] if is_skin else reflectances[2]
        else:
            nx, ny, nz = inward(what, x, y, walls, arcs)
            j = window_at(what, x, y, z, receivers)
            if j >= 0:
                if times > 0 and is_mirrored:
                    out[min(times, 2) - 1, j] += (
                        weight * math.pi * lobe(receivers[j], -(dx * nx + dy * ny + dz * nz))
                    )
                return
            weight *= reflectances[1] if what == BOTTOM else reflectances[0]
        scattered = times + by_skin
        if weight < faint or scattered == most:
            return
        times, by_skin = times + (0 if is_skin else 1), by_skin + (1 if is_skin else 0)
        x, y, z = x + 1e-7 * nx, y + 1e-7 * ny, z + 1e-7 * nz
        first = FIRST + PER_SCATTER * scattered
        u = 2.0 * number(n, first + 2, steps, shift) - 1.0
        v = 2.0 * number(n, first + 3, steps, shift) - 1.0
        if times > 0 or by_skin > 1:
            row = 0 if times == 1 else 1
            look(x, y, z, nx, ny, nz, weight, u, v, receivers, absorbs, top, out[row])
        dx, dy, dz = scattered_way(nx, ny, nz, n, first, steps, shift)
        is_mirrored = False


@kernel
def sent_ray(
    window: FloatArray, n: int, steps: FloatArray, shift: FloatArray
) -> tuple[float, float, float, float, float, float, float]:
    """Start of a window's ray on its face, its Lambertian direction, and the window's `lobe` there."""
    x, y, z = window_point(
        window, 2.0 * number(n, 0, steps, shift) - 1.0, 2.0 * number(n, 1, steps, shift) - 1.0
    )
    dx, dy, dz = scattered_way(-window[NX], -window[NY], -window[NZ], n, 2, steps, shift)
    return x, y, z, dx, dy, dz, lobe(window, math.sqrt(number(n, 2, steps, shift)))


@kernel
def scattered_way(
    nx: float, ny: float, nz: float, n: int, first: int, steps: FloatArray, shift: FloatArray
) -> tuple[float, float, float]:
    """Lambertian direction about a unit normal, by two random numbers of a ray from the dimension `first` on."""
    return about(nx, ny, nz, math.sqrt(number(n, first, steps, shift)), number(n, first + 1, steps, shift))


@kernel
def look(
    x: float, y: float, z: float, nx: float, ny: float, nz: float, weight: float, u: float, v: float,
    receivers: FloatArray, absorbs: float, top: FormedTop, out: FloatArray,
) -> None:  # fmt: skip
    """Add the direct light from a point of scattering to every receiver."""
    for j in range(receivers.shape[0]):
        r = receivers[j]
        tx, ty, tz = window_point(r, u, v)
        dx, dy, dz = tx - x, ty - y, tz - z
        s2 = dx * dx + dy * dy + dz * dz
        s = math.sqrt(s2)
        leaves, enters = (dx * nx + dy * ny + dz * nz) / s, onto(r, dx, dy, dz) / s
        if leaves <= 0.0 or enters <= 0.0:
            continue
        if top.numbers[OUTER] > 0.0 and not sees(x, y, z, tx, ty, tz, top):
            continue
        area = 4.0 * r[HALF_U] * r[HALF_V]
        out[j] += weight * leaves * enters * lobe(r, enters) * area * math.exp(-absorbs * s) / s2


@kernel
def window_at(what: int, x: float, y: float, z: float, receivers: FloatArray) -> int:
    """Number of the receiver whose face contains a point of a wall; -1 if there is none."""
    for j in range(receivers.shape[0]):
        r = receivers[j]
        along = (x - r[CX]) * r[UX] + (y - r[CY]) * r[UY]
        rise = up_window(r, x - r[CX], y - r[CY], z - r[CZ])
        if r[WALL] == what and abs(rise) <= r[HALF_V] and abs(along) <= r[HALF_U]:
            return j
    return -1


@kernel
def face_before(
    x: float, y: float, z: float, dx: float, dy: float, dz: float, limit: float, receivers: FloatArray
) -> tuple[float, int]:
    """Distance at which a ray meets the front of a receiver's face in the layer, and its number; `limit`, -1: none."""
    best, which = limit, -1
    for j in range(receivers.shape[0]):
        if receivers[j, WALL] == INSIDE:
            u, v, t = landing(x, y, z, dx, dy, dz, receivers[j])
            if 1e-9 < t <= best + 1e-9 and abs(u) <= 1.0 and abs(v) <= 1.0:
                best, which = t, j
    return best, which


@kernel
def number(ray: int, dimension: int, steps: FloatArray, shift: FloatArray) -> float:
    """Random number of a ray from 0 to 1 in one dimension of the sequence."""
    value = shift[dimension] + (ray + 1.0) * steps[dimension]
    return value - math.floor(value)


@kernel
def about(nx: float, ny: float, nz: float, cosine: float, turn: float) -> tuple[float, float, float]:
    """Unit direction with a given cosine to a unit normal; `turn` is its angle about the normal, in full turns."""
    sine = math.sqrt(max(1.0 - cosine * cosine, 0.0))
    a, b = sine * math.cos(2.0 * math.pi * turn), sine * math.sin(2.0 * math.pi * turn)
    if abs(nz) < 0.9:
        per = 1.0 / math.sqrt(nx * nx + ny * ny)
        ux, uy, uz = -ny * per, nx * per, 0.0
    else:
        per = 1.0 / math.sqrt(nx * nx + nz * nz)
        ux, uy, uz = nz * per, 0.0, -nx * per
    vx, vy, vz = ny * uz - nz * uy, nz * ux - nx * uz, nx * uy - ny * ux
    return cosine * nx + a * ux + b * vx, cosine * ny + a * uy + b * vy, cosine * nz + a * uz + b * vz
