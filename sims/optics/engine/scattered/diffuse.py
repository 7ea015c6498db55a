# mypy: no-warn-return-any
"""Kernels: light that walls, bottom or tip scatter once.

The power of every emitter is deposited on patches of walls, bottom and tip by rays that follow the whole specular
chain through the top; the same is done from every receiver, and by reciprocity

    flux = sum over patches of  reflectance x deposit_e x deposit_r x A_r / A_patch.

A deposit is shared between the four patches around it, so it changes smoothly with the ray. Receiver faces absorb;
emitter faces reflect like the wall around them. Smooth walls mirror their Fresnel share on. Patches of walls and bottom
have a finite size (a bias of the join that is the same with and without a press); `sims.optics.engine.trace_states`
divides it out with the untouched pad's join. The untouched pad knows no tip, so light by way of the tip is taken as
joined.
"""

from __future__ import annotations

import math

import numpy as np

from design.arrays import FloatArray, IntArray
from sims.optics.engine.straight.rays import BOTTOM, LOST_WEIGHT, TIP, chain
from sims.optics.surface.curves import CONTACT, CONTACT_AREA, CONTACT_PARTS, X, Y
from sims.optics.surface.radial import (
    array_kernel,
    contact_radius_2,
    kernel,
    mirrored_share,
    radiance,
    wall_normal,
    wall_point,
)
from sims.optics.surface.top import Top, surface_height

TIP_RINGS = 3
TIP_SECTORS = 12
MIRRORINGS = 64
"""Most reflections at smooth walls on one path."""


@kernel
def fraction(x: float) -> float:
    """Part after the point."""
    return x - math.floor(x)


@kernel
def golden_pair(n: int, one: float, two: float) -> tuple[float, float]:
    """n-th point of an additive sequence in the unit square, moved by (one, two)."""
    return fraction(n * 0.7548776662466927 + one), fraction(n * 0.5698402909980532 + two)


@array_kernel
def golden_shift(k: float) -> FloatArray:
    """(4,) k-th point of an additive sequence with irrational, mutually unrelated steps, in 0..1."""
    out = np.empty(4)
    out[0] = fraction(k * 0.8566748838545029)
    out[1] = fraction(k * 0.7338918566271260)
    out[2] = fraction(k * 0.6287067210378087)
    out[3] = fraction(k * 0.5385972572236101)
    return out


@array_kernel
def layout_of(box: FloatArray, size: float) -> IntArray:
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
def tip_patch(x: float, y: float, layout: IntArray, tip: int, rows: FloatArray) -> int:
    """Index of the tip's patch that holds a place: rings of equal area, a wrapped shank with them."""
    px = x - rows[tip, X]
    py = y - rows[tip, Y]
    r2 = px * px + py * py
    part = 0
    while part < CONTACT_PARTS - 1 and rows[tip, CONTACT + part + 1] < r2:
        part += 1
    low = rows[tip, CONTACT + part]
    share = (part + (r2 - low) / (rows[tip, CONTACT + part + 1] - low)) / CONTACT_PARTS
    a = min(int((math.atan2(py, px) / (2.0 * math.pi) + 0.5) * TIP_SECTORS), TIP_SECTORS - 1)
    b = min(int(share * TIP_RINGS), TIP_RINGS - 1)
    return layout[TIP, 2] + b * layout[TIP, 0] + a


@kernel
def place_on_tip(patch: int, one: float, two: float, tip: int, rows: FloatArray) -> tuple[float, float]:
    """Place (x, y) on one of the tip's patches, at fractions of its area outward and of its angle."""
    r2, _ = contact_radius_2((patch // TIP_SECTORS + one) / TIP_RINGS, tip, rows)
    r = math.sqrt(r2)
    angle = 2.0 * math.pi * ((patch % TIP_SECTORS + two) / TIP_SECTORS - 0.5)
    return rows[tip, X] + r * math.cos(angle), rows[tip, Y] + r * math.sin(angle)


@kernel
def tip_patch_area(tip: int, rows: FloatArray) -> float:
    """Area of each of a tip's patches."""
    return rows[tip, CONTACT_AREA] / (TIP_RINGS * TIP_SECTORS)


@kernel
def add_deposit(
    kind: int, x: float, y: float, z: float, weight: float, layout: IntArray, box: FloatArray, top: Top,
    out: FloatArray,
) -> None:  # fmt: skip
    """Add a weight to the patches around a point of a wall, the bottom or the tip."""
    if kind == TIP:
        out[tip_patch(x, y, layout, 0, top.rows)] += weight
        return
    columns = layout[kind, 0]
    rows = layout[kind, 1]
    across = box[0] if kind == 0 or kind == 2 or kind == BOTTOM else box[1]
    up = box[1] if kind == BOTTOM else box[2]
    along = x if kind == 0 or kind == 2 or kind == BOTTOM else y
    s = min(max(along / across * columns - 0.5, 0.0), columns - 1.0)
    t = min(max((y if kind == BOTTOM else z) / up * rows - 0.5, 0.0), rows - 1.0)
    a = min(int(s), max(columns - 2, 0))
    b = min(int(t), max(rows - 2, 0))
    s -= a
    t -= b
    first = layout[kind, 2] + b * columns + a
    right = 1 if columns > 1 else 0
    above = columns if rows > 1 else 0
    out[first] += weight * (1.0 - s) * (1.0 - t)
    out[first + right] += weight * s * (1.0 - t)
    out[first + above] += weight * (1.0 - s) * t
    out[first + above + right] += weight * s * t


@kernel
def receiver_at(kind: int, x: float, y: float, z: float, receivers: FloatArray) -> int:
    """The receiver whose face holds a wall point; -1 if none."""
    along = x if kind == 0 or kind == 2 else y
    for j in range(receivers.shape[0]):
        if (
            receivers[j, 0] == kind
            and abs(along - receivers[j, 1]) <= receivers[j, 3]
            and abs(z - receivers[j, 2]) <= receivers[j, 4]
        ):
            return j
    return -1


@array_kernel
def patch_areas(layout: IntArray, receivers: FloatArray, box: FloatArray) -> FloatArray:
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
def leaving(
    patch: FloatArray, p: FloatArray, shift: FloatArray, box: FloatArray
) -> tuple[float, float, float, float, float, float, float]:
    """A point of a wall patch and a direction by its cosine order (a table: Lambertian): start, direction, weight."""
    wall = int(patch[0])
    along = patch[1] + patch[3] * (2.0 * fraction(p[0] + shift[0]) - 1.0)
    other = patch[2] + patch[4] * (2.0 * fraction(p[1] + shift[1]) - 1.0)
    order = max(patch[5], 1.0) if patch[5] < 0.0 else patch[5]
    cos_out = (1.0 - fraction(p[2] + shift[2])) ** (1.0 / (order + 1.0))
    sin_out = math.sqrt(max(1.0 - cos_out * cos_out, 0.0))
    phi = 2.0 * math.pi * fraction(p[3] + shift[3])
    weight = 4.0 * patch[3] * patch[4] / patch[6]
    if patch[5] < 0.0:
        weight *= math.pi * radiance(patch, cos_out)
    if wall == BOTTOM:
        return along, other, 0.0, sin_out * math.cos(phi), sin_out * math.sin(phi), cos_out, weight
    x, y, z = wall_point(wall, along, other, box)
    n0, n1 = wall_normal(wall)
    side = sin_out * math.cos(phi)
    return x, y, z, n0 * cos_out - n1 * side, n1 * cos_out + n0 * side, sin_out * math.sin(phi), weight


@kernel
def follow(
    x: float, y: float, z: float, dx: float, dy: float, dz: float, weight: float, gathers: bool,
    receivers: FloatArray, layout: IntArray, box: FloatArray, top: Top, out: FloatArray, seen: FloatArray,
) -> None:  # fmt: skip
    """Deposit what a ray brings to walls, bottom and tip; add to seen what smooth walls mirror onto receivers.

    Light loses the mirrored share where it enters a smooth wall to be scattered, not where it comes out of it again: a
    ray that gathers light for a receiver, backwards, loses nothing there.
    """
    for mirrorings in range(MIRRORINGS):
        kind, x, y, z, dx, dy, dz, left, _, _ = chain(x, y, z, dx, dy, dz, 1.0, box, top)
        weight *= left
        if kind < 0 or weight < LOST_WEIGHT:
            return
        if kind >= BOTTOM:
            add_deposit(kind, x, y, z, weight, layout, box, top, out)
            return
        n0, n1 = wall_normal(kind)
        cos_in = -(dx * n0 + dy * n1)
        j = receiver_at(kind, x, y, z, receivers)
        if j >= 0:
            if mirrorings > 0:
                seen[j] += weight * math.pi * radiance(receivers[j], cos_in)
            return
        share = mirrored_share(cos_in, box[3], box[5]) if box[5] > 0.0 else 0.0
        entering = weight if gathers else weight * (1.0 - share)
        add_deposit(kind, x, y, z, entering, layout, box, top, out)
        weight *= share
        if weight < LOST_WEIGHT:
            return
        dx += 2.0 * cos_in * n0
        dy += 2.0 * cos_in * n1
        x += 1e-9 * n0
        y += 1e-9 * n1


@kernel
def deposit(
    source: FloatArray, gathers: bool, receivers: FloatArray, box: FloatArray, top: Top, points: FloatArray,
    count: int, shift: FloatArray, layout: IntArray, out: FloatArray, seen: FloatArray,
) -> None:  # fmt: skip
    """Add the share of a patch's emission that lands on every patch after any specular chain, by rays into the
    half space; and what smooth walls mirror onto receivers.
    """
    for k in range(count):
        x, y, z, dx, dy, dz, weight = leaving(source, points[k], shift, box)
        if z < surface_height(x, y, top):
            follow(x, y, z, dx, dy, dz, weight / count, gathers, receivers, layout, box, top, out, seen)


@kernel
def join(
    from_emitter: FloatArray, from_receiver: FloatArray, receiver_area: float, areas: FloatArray, layout: IntArray,
    reflectances: FloatArray,
) -> float:  # fmt: skip
    """Flux of a pair that walls and bottom scatter once, from its two deposits."""
    total = 0.0
    for k in range(TIP):
        part = 0.0
        for n in range(layout[k, 2], layout[k, 2] + layout[k, 0] * layout[k, 1]):
            product = from_emitter[n] * from_receiver[n]
            if product != 0.0 and areas[n] > 1e-9:
                part += product / areas[n]
        total += part * reflectances[k]
    return total * receiver_area


@kernel
def join_on_tip(
    from_emitter: FloatArray, from_receiver: FloatArray, receiver_area: float, layout: IntArray,
    reflectances: FloatArray, top: Top,
) -> float:  # fmt: skip
    """Flux of a pair that a tip scatters once, from its two deposits."""
    if reflectances[TIP] == 0.0:
        return 0.0
    total = 0.0
    for n in range(layout[TIP, 2], layout[TIP, 2] + layout[TIP, 0] * layout[TIP, 1]):
        total += from_emitter[n] * from_receiver[n]
    area = tip_patch_area(0, top.rows)
    return total / area * reflectances[TIP] * receiver_area if area > 1e-9 else 0.0


@array_kernel
def bounces(
    layout: IntArray, receivers: FloatArray, box: FloatArray, top: Top, points: FloatArray, count: int
) -> FloatArray:
    """(patch, patch) share of one patch's scattered light that lands on another, untouched top."""
    patches = layout[5, 2]
    out = np.zeros((patches, patches + layout[5, 0] * layout[5, 1]))
    source = np.zeros(7)
    seen = np.zeros(receivers.shape[0])
    for k in range(5):
        du = (box[0] if k == 0 or k == 2 or k == BOTTOM else box[1]) / layout[k, 0]
        dv = (box[1] if k == BOTTOM else box[2]) / layout[k, 1]
        for b in range(layout[k, 1]):
            for a in range(layout[k, 0]):
                n = layout[k, 2] + b * layout[k, 0] + a
                source[0], source[1], source[2] = k, (a + 0.5) * du, (b + 0.5) * dv
                source[3], source[4], source[5] = 0.5 * du, 0.5 * dv, 1.0
                source[6] = du * dv
                shift = golden_shift(n + 1.0)
                deposit(source, False, receivers, box, top, points, count, shift, layout, out[n], seen)
    return out[:, :patches]
