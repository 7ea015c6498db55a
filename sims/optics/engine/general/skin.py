# mypy: no-warn-return-any
"""Light that a diffuse skin on the top scatters, from an emitter to a receiver: once, by way of points of the top, and
more often, by rays.

Model
-----
An element dA of the skin at P gets the flux E dA from an emitter, per its power, and sends the share R of what it
scatters to a receiver (Lambertian, reflectance ρ):

    dflux = ρ E R dA,     E = ∫ L(c_e) c_e c_P e^(-μ s) / s² dA_e / A_e,     R = ∫ A(c_r) c_r c_P e^(-μ s) / (π s²) dA_r

L is the emitter's radiance divided by its power per area A_e; A(c_r) is the share of light that the receiver counts.
Both integrals are Gauss' rules over the faces. The dimple may hide a node of a face from P. The points P are those of
`optopad.sims.optics.engine.general.points`.
"""

from __future__ import annotations

import math

from optopad.design.arrays import BoolArray, FloatArray
from optopad.sims.optics.engine.general.cuts import BATCH, DA, MX, MY, MZ, PX, PY, PZ, SKIRT
from optopad.sims.optics.engine.general.deposits import RAY_BATCHES
from optopad.sims.optics.engine.general.mirrored import AT, put_sight, sight_is_open
from optopad.sims.optics.engine.general.rays import (
    AREA,
    CX,
    CY,
    CZ,
    HALF_U,
    HALF_V,
    TOP,
    lobe,
    meeting,
    onto,
    sees,
    window_point,
)
from optopad.sims.optics.engine.general.scattered import (
    FIRST,
    MOST_UNDER_SKIN,
    PER_SCATTER,
    face_before,
    look,
    number,
    scattered_way,
    sent_ray,
)
from optopad.sims.optics.engine.general.top import OUTER, FormedTop, dimple, into, normal_at, out_of
from optopad.sims.optics.surface.radial import kernel

WIDE, NARROW = 0.2, 0.07
"""Half size of a face over its distance from which Gauss' rule has four nodes in each direction, and below which it has
one, else two. One node is off by up to 0.2 %, nearly equally with and without a press."""
GAUSS_2 = (-0.5773502691896258, 0.5773502691896258)
GAUSS_4 = (-0.8611363115940526, -0.33998104358485626, 0.33998104358485626, 0.8611363115940526)
WEIGHTS_4 = (0.34785484513745385, 0.6521451548625461, 0.6521451548625461, 0.34785484513745385)


@kernel
def skin_flux(
    emitters: FloatArray, receivers: FloatArray, wanted: BoolArray, points: FloatArray, reflectance: float,
    absorbs: float, top: FormedTop, out: FloatArray, amounts: FloatArray, work: FloatArray,
) -> None:  # fmt: skip
    """Add the light of all emitters by way of points of the skin to `out` (2, batch, emitter, receiver).

    points : (n, 10) as in `optopad.sims.optics.engine.general.mirrored.mirrored_flux`
    amounts, work : workspaces of (emitters + receivers,) and `SIGHTS` + `SIGHT` (emitters + receivers,) numbers
    """
    many = emitters.shape[0]
    pressed = top.numbers[OUTER] > 0.0
    if pressed:
        for k in range(amounts.shape[0]):
            put_sight(emitters[k] if k < many else receivers[k - many], k, top, work)
    for n in range(points.shape[0]):
        p = points[n]
        if p[DA] <= 0.0:
            continue
        if pressed:
            x, y, _ = into(top, p[PX], p[PY], p[PZ])
            work[AT], work[AT + 1], work[AT + 2] = x, y, dimple(top, x, y)[0]
        for k in range(amounts.shape[0]):
            amounts[k] = 0.0
            if not (wanted[k].any() if k < many else wanted[:, k - many].any()):
                continue
            face = emitters[k] if k < many else receivers[k - many]
            is_hidden = pressed and not sight_is_open(k, top, work)
            amounts[k] = _exchanged(face, p, absorbs, is_hidden, top)
            if k < many:
                amounts[k] *= reflectance * p[DA] / face[AREA]
        row, batch = (1 if p[SKIRT] > 0.0 else 0), int(p[BATCH])
        for i in range(many):
            if amounts[i] > 0.0:
                for j in range(receivers.shape[0]):
                    if wanted[i, j]:
                        out[row, batch, i, j] += amounts[i] * amounts[many + j]


@kernel
def skin_again(
    e: FloatArray, receivers: FloatArray, rays: int, steps: FloatArray, shift: FloatArray, reflectance: float,
    absorbs: float, walls: FloatArray, arcs: FloatArray, top: FormedTop, out: FloatArray,
) -> None:  # fmt: skip
    """Add light that the skin scatters twice or more, and nothing else, to `out` (batch, receiver), by rays.

    Only a dimple or a crown sends light from the skin to the skin.
    """
    weight0 = math.pi * 4.0 * e[HALF_U] * e[HALF_V] / e[AREA] / rays
    for n in range(rays):
        x, y, z, dx, dy, dz, radiance = sent_ray(e, n, steps, shift)
        weight = weight0 * radiance
        for times in range(MOST_UNDER_SKIN):
            t, what = meeting(x, y, z, dx, dy, dz, walls, arcs, top)
            if what != TOP or face_before(x, y, z, dx, dy, dz, t, receivers)[1] >= 0:
                break
            weight *= reflectance * math.exp(-absorbs * t)
            qx, qy, _ = into(top, x + t * dx, y + t * dy, z + t * dz)
            nx, ny, nz = normal_at(top, qx, qy)
            nx, ny, nz = out_of(top, nx, ny, nz)
            x, y, z = x + t * dx - 1e-7 * nx, y + t * dy - 1e-7 * ny, z + t * dz - 1e-7 * nz
            first = FIRST + PER_SCATTER * times
            if times > 0:
                u = 2.0 * number(n, first + 2, steps, shift) - 1.0
                v = 2.0 * number(n, first + 3, steps, shift) - 1.0
                look(x, y, z, -nx, -ny, -nz, weight, u, v, receivers, absorbs, top, out[n % RAY_BATCHES])
            dx, dy, dz = scattered_way(-nx, -ny, -nz, n, first, steps, shift)


@kernel
def _exchanged(face: FloatArray, p: FloatArray, absorbs: float, is_hidden: bool, top: FormedTop) -> float:
    """∫ lobe c c_P e^(-μ s) / s² dA over a face, seen from a point of the top; `is_hidden`: if it may be hidden."""
    far = math.sqrt((face[CX] - p[PX]) ** 2 + (face[CY] - p[PY]) ** 2 + (face[CZ] - p[PZ]) ** 2)
    wide = max(face[HALF_U], face[HALF_V]) / far
    is_near, is_far = wide > WIDE, wide < NARROW
    count = 1 if is_far else (4 if is_near else 2)
    total = 0.0
    for a in range(count):
        u, weight_u = (
            (GAUSS_4[a], WEIGHTS_4[a]) if is_near else ((0.0, 2.0) if is_far else (GAUSS_2[a % 2], 1.0))
        )
        for b in range(count):
            v, weight_v = (
                (GAUSS_4[b], WEIGHTS_4[b]) if is_near else ((0.0, 2.0) if is_far else (GAUSS_2[b % 2], 1.0))
            )
            x, y, z = window_point(face, u, v)
            dx, dy, dz = x - p[PX], y - p[PY], z - p[PZ]
            s2 = dx * dx + dy * dy + dz * dz
            s = math.sqrt(s2)
            leaves = -(dx * p[MX] + dy * p[MY] + dz * p[MZ]) / s
            enters = onto(face, dx, dy, dz) / s
            if leaves <= 0.0 or enters <= 0.0:
                continue
            if is_hidden and not sees(
                p[PX] - 1e-6 * p[MX], p[PY] - 1e-6 * p[MY], p[PZ] - 1e-6 * p[MZ], x, y, z, top
            ):
                continue
            total += weight_u * weight_v * lobe(face, enters) * enters * leaves * math.exp(-absorbs * s) / s2
    return total * face[HALF_U] * face[HALF_V]
