# mypy: allow-untyped-defs, allow-untyped-calls, allow-untyped-decorators
"""Kernels: light that walls, bottom or tip scatter once.

The power of every emitter is deposited on patches of walls, bottom and tip by rays that follow the whole
specular chain through the deformed top; the same is done from every receiver, and by reciprocity

    flux = sum over patches of  reflectance x deposit_e x deposit_r x A_r / A_patch.

Every ray uses the same points in every state. Receiver faces absorb; emitter faces reflect like the wall
around them. Patches have a finite size (a bias of the join that is the same with and without a press);
`sims.optics.engine` divides it out with a finer join of the untouched pad.
"""

from __future__ import annotations

import math

import numpy as np

from sims.optics.rays import BOTTOM, TIP, chain, height, kernel, wall_normal, wall_point
from sims.optics.repeated import fraction
from sims.optics.surface import ACTIVE, CONTACT_R, TIP_R, X, Y

TIP_RINGS = 3
TIP_SECTORS = 12


@kernel
def golden_shift(k):
    """(4,) k-th point of an additive sequence with irrational, mutually unrelated steps, in 0..1."""
    out = np.empty(4)
    out[0] = fraction(k * 0.8566748838545029)
    out[1] = fraction(k * 0.7338918566271260)
    out[2] = fraction(k * 0.6287067210378087)
    out[3] = fraction(k * 0.5385972572236101)
    return out


@kernel
def layout_of(box, size):
    """(6, 3) columns, rows, first index of the patches on walls 0-3, bottom and tip (5)."""
    out = np.zeros((6, 3), np.int64)
    first = 0
    for k in range(6):
        across = box[0] if k == 0 or k == 2 or k == BOTTOM else box[1]
        up = box[1] if k == BOTTOM else box[2]
        out[k, 0] = max(1, math.ceil(across / size))
        out[k, 1] = max(1, math.ceil(up / size))
        if k == TIP:
            out[k, 0] = TIP_SECTORS
            out[k, 1] = TIP_RINGS
        out[k, 2] = first
        first += out[k, 0] * out[k, 1]
    return out


@kernel
def patch_of(kind, x, y, z, layout, box, press):
    """Index of the patch that holds a point."""
    if kind == TIP:
        px = x - press[X]
        py = y - press[Y]
        q = (px * px + py * py) / (press[CONTACT_R] * press[CONTACT_R])
        a = int((math.atan2(py, px) / (2.0 * math.pi) + 0.5) * TIP_SECTORS)
        b = int(q * TIP_RINGS)
    else:
        across = box[0] if kind == 0 or kind == 2 or kind == BOTTOM else box[1]
        up = box[1] if kind == BOTTOM else box[2]
        along = x if kind == 0 or kind == 2 or kind == BOTTOM else y
        a = int(along / across * layout[kind, 0])
        b = int((y if kind == BOTTOM else z) / up * layout[kind, 1])
    a = min(max(a, 0), layout[kind, 0] - 1)
    b = min(max(b, 0), layout[kind, 1] - 1)
    return layout[kind, 2] + b * layout[kind, 0] + a


@kernel
def on_receiver(kind, x, y, z, receivers):
    """Whether a wall point lies on a receiver's face."""
    along = x if kind == 0 or kind == 2 else y
    for j in range(receivers.shape[0]):
        if (
            receivers[j, 0] == kind
            and abs(along - receivers[j, 1]) <= receivers[j, 3]
            and abs(z - receivers[j, 2]) <= receivers[j, 4]
        ):
            return True
    return False


@kernel
def patch_areas(layout, receivers, box):
    """Area of every wall and bottom patch without receiver faces; 0 for the tip's."""
    out = np.zeros(layout[5, 2] + layout[5, 0] * layout[5, 1])
    for k in range(5):
        du = (box[0] if k == 0 or k == 2 or k == BOTTOM else box[1]) / layout[k, 0]
        dv = (box[1] if k == BOTTOM else box[2]) / layout[k, 1]
        for b in range(layout[k, 1]):
            for a in range(layout[k, 0]):
                area = du * dv
                if k < BOTTOM:
                    for j in range(receivers.shape[0]):
                        if receivers[j, 0] == k:
                            u0 = max(a * du, receivers[j, 1] - receivers[j, 3])
                            u1 = min((a + 1) * du, receivers[j, 1] + receivers[j, 3])
                            v0 = max(b * dv, receivers[j, 2] - receivers[j, 4])
                            v1 = min((b + 1) * dv, receivers[j, 2] + receivers[j, 4])
                            area -= max(u1 - u0, 0.0) * max(v1 - v0, 0.0)
                out[layout[k, 2] + b * layout[k, 0] + a] = max(area, 0.0)
    return out


@kernel
def tip_patch_area(ring, press):
    """Area of one tip patch: rings of equal plan area, on the sphere up to the contact edge."""
    tip = press[TIP_R]
    contact = min(press[CONTACT_R], tip)
    low = math.sqrt(max(tip * tip - contact * contact * ring / TIP_RINGS, 0.0))
    high = math.sqrt(max(tip * tip - contact * contact * (ring + 1.0) / TIP_RINGS, 0.0))
    return 2.0 * math.pi * tip * (low - high) / TIP_SECTORS


@kernel
def deposit(source, receivers, box, press, cubic, steepest, points, count, shift, layout, out):
    """Add the share of a patch's emission that lands on every patch after any specular chain."""
    weight = 4.0 * source[3] * source[4] / source[6] / count
    wall = int(source[0])
    for k in range(count):
        p = points[k]
        along = source[1] + source[3] * (2.0 * fraction(p[0] + shift[0]) - 1.0)
        other = source[2] + source[4] * (2.0 * fraction(p[1] + shift[1]) - 1.0)
        cos_out = (1.0 - fraction(p[2] + shift[2])) ** (1.0 / (source[5] + 1.0))
        sin_out = math.sqrt(max(1.0 - cos_out * cos_out, 0.0))
        phi = 2.0 * math.pi * fraction(p[3] + shift[3])
        if wall == BOTTOM:
            x, y, z = along, other, 0.0
            dx, dy, dz = sin_out * math.cos(phi), sin_out * math.sin(phi), cos_out
        else:
            x, y, z = wall_point(wall, along, other, box)
            n0, n1 = wall_normal(wall)
            side = sin_out * math.cos(phi)
            dx = n0 * cos_out - n1 * side
            dy = n1 * cos_out + n0 * side
            dz = sin_out * math.sin(phi)
        if press[ACTIVE] > 0.0 and z >= height(math.hypot(x - press[X], y - press[Y]), press, cubic):
            continue
        kind, x, y, z, left, _, _ = chain(x, y, z, dx, dy, dz, 1.0, box, press, cubic, steepest)
        if kind < 0 or (kind < BOTTOM and on_receiver(kind, x, y, z, receivers)):
            continue
        out[patch_of(kind, x, y, z, layout, box, press)] += weight * left


@kernel
def join(from_emitter, from_receiver, receiver_area, areas, layout, reflectances, press):
    """Once-scattered flux of a pair from its two deposits."""
    total = 0.0
    for k in range(6):
        part = 0.0
        for b in range(layout[k, 1]):
            for a in range(layout[k, 0]):
                n = layout[k, 2] + b * layout[k, 0] + a
                product = from_emitter[n] * from_receiver[n]
                if product > 0.0:
                    area = tip_patch_area(b, press) if k == TIP else areas[n]
                    if area > 1e-9:
                        part += product / area
        total += part * reflectances[k]
    return total * receiver_area


@kernel
def bounces(layout, receivers, box, press, cubic, steepest, points, count):
    """(patch, patch) share of one patch's scattered light that lands on another, untouched top."""
    patches = layout[5, 2]
    out = np.zeros((patches, patches + layout[5, 0] * layout[5, 1]))
    source = np.zeros(7)
    shift = np.zeros(4)
    for k in range(5):
        du = (box[0] if k == 0 or k == 2 or k == BOTTOM else box[1]) / layout[k, 0]
        dv = (box[1] if k == BOTTOM else box[2]) / layout[k, 1]
        for b in range(layout[k, 1]):
            for a in range(layout[k, 0]):
                n = layout[k, 2] + b * layout[k, 0] + a
                source[0], source[1], source[2] = k, (a + 0.5) * du, (b + 0.5) * dv
                source[3], source[4], source[5] = 0.5 * du, 0.5 * dv, 1.0
                source[6] = du * dv
                shift[:] = golden_shift(n + 1.0)
                deposit(source, receivers, box, press, cubic, steepest, points, count, shift, layout, out[n])
    return out[:, :patches]
