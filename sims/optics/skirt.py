# mypy: allow-untyped-defs, allow-untyped-calls, allow-untyped-decorators
"""Kernels: light with exactly one reflection at the deformed top, as an integral over the top.

Cells of the top are halved until the receiver's image moves across a cell by less than `tolerance` of its
size (image and emitter together); a cell whose image stays away from the emitter is dropped, with a margin of
`MARGIN` times the movement (half of it would do for a linear map). What is left is summed by Gauss points and
quartered where two rules differ. Radii beyond `reach` are left to `mirror`.
"""

from __future__ import annotations

import math

from sims.optics.pinhole import pinhole
from sims.optics.rays import kernel, wall_point
from sims.optics.surface import SKIRT_R
from sims.optics.top_cells import top_point
from sims.optics.top_image import aim_offset, angular_change, image_box

CELL_STACK = 96
STACK = CELL_STACK + 64
DEEPEST = 7.0
DARK_CHANGE = 0.35
GAUSS = 0.5773502691896258
SMALLEST_U = 2e-5
MARGIN = 0.75
FINE_MARGIN = 0.55


@kernel
def split(stack, depth, u0, u, u1, v0, v, v1, in_u, in_v):
    """Push the halves (or quarters) of a cell."""
    at = 2 * depth
    for a in range(2 if in_u else 1):
        for b in range(2 if in_v else 1):
            stack[at, 0] = u if a == 1 else u0
            stack[at, 1] = u if in_u and a == 0 else u1
            stack[at, 2] = v if b == 1 else v0
            stack[at + 1, 0] = v if in_v and b == 0 else v1
            at += 2


@kernel
def resolved_cell(
    wall, a0, a1, b0, b1, change, half, tall, move_a, move_b, source, target, sectors, reach, largest, box,
    press, cubic, steepest, poly, other, stack,
):  # fmt: skip
    """Flux through a cell across which the image moves by `change` sizes: (outside the skirt, inside it).

    Two by two Gauss points count; the cell is quartered where they differ from the midpoint by more
    than `largest`, and where the image misses the emitter at all
    five points while it moves by more than `DARK_CHANGE`. Quarters whose
    image lies further from the emitter than it can move within them are dropped.
    """
    ex, ey, ez = wall_point(int(source[0]), source[1], source[2], box)
    qx, qy, qz = wall_point(int(target[0]), target[1], target[2], box)
    outer = 0.0
    inner = 0.0
    stack[0, 0], stack[0, 1], stack[0, 2] = a0, a1, b0
    stack[1, 0], stack[1, 1] = b1, 0.0
    depth = 1
    while depth > 0:
        depth -= 1
        u0, u1, v0 = stack[2 * depth, 0], stack[2 * depth, 1], stack[2 * depth, 2]
        v1 = stack[2 * depth + 1, 0]
        level = stack[2 * depth + 1, 1]
        u = 0.5 * (u0 + u1)
        v = 0.5 * (v0 + v1)
        hu = 0.5 * (u1 - u0)
        hv = 0.5 * (v1 - v0)
        if level > 0.0 and half > 0.0:
            shrink = FINE_MARGIN * 0.5**level
            along, up, w, _, _, _, _, _, _ = aim_offset(
                wall, u, v, source, ex, ey, ez, qx, qy, qz, sectors, press, cubic
            )
            if w > 1e-9 and (abs(along) > half + shrink * move_a or abs(up) > tall + shrink * move_b):
                continue
        total = 0.0
        met = False
        for k in range(4):
            us = u + (GAUSS if k < 2 else -GAUSS) * hu
            vs = v + (GAUSS if k % 2 == 0 else -GAUSS) * hv
            flux, _, meets = pinhole(
                wall, us, vs, source, target, sectors, reach, box, press, cubic, steepest, poly, other
            )
            total += flux
            met = met or meets
        total *= hu * hv
        middle, r, meets = pinhole(
            wall, u, v, source, target, sectors, reach, box, press, cubic, steepest, poly, other
        )
        is_dark = not (met or meets)
        unsure = (
            change * 0.5**level > DARK_CHANGE if is_dark else abs(total - 4.0 * middle * hu * hv) > largest
        )
        if unsure and level < DEEPEST:
            split(stack, depth, u0, u, u1, v0, v, v1, True, True)
            for k in range(4):
                stack[2 * (depth + k) + 1, 1] = level + 1.0
            depth += 4
            continue
        if r < press[SKIRT_R]:
            inner += total
        else:
            outer += total
    return outer, inner


@kernel
def single_reflection(
    source, target, cells, aims, sectors, reach, tolerance, largest, box, press, cubic, steepest, work
):
    """Flux of a pair with one reflection: (outside the skirt radius, inside it)."""
    ex, ey, ez = wall_point(int(source[0]), source[1], source[2], box)
    qx, qy, qz = wall_point(int(target[0]), target[1], target[2], box)
    emitter_size = math.hypot(source[3], source[4])
    receiver_size = math.hypot(target[3], target[4])
    smallest_half = min(target[3], target[4])
    on_x = int(source[0]) % 2 == 0
    poly = work[:12]
    other = work[12:24]
    stack = work[24:]
    outer = 0.0
    inner = 0.0
    for k in range(cells.shape[0]):
        if aims[k, 9] == 0.0:
            continue
        tx = qx - aims[k, 3]
        ty = qy - aims[k, 4]
        tz = qz - aims[k, 5]
        back = 1.0 / max(math.sqrt(tx * tx + ty * ty + tz * tz), 1e-9)
        limit = (receiver_size + MARGIN * aims[k, 8]) * back + emitter_size * aims[k, 6] + MARGIN * aims[k, 7]
        cosine = (aims[k, 0] * tx + aims[k, 1] * ty + aims[k, 2] * tz) * back
        if limit < 1.9 and cosine < 1.0 - 0.5 * limit * limit:
            continue
        wall = int(cells[k, 0])
        stack[0, 0], stack[0, 1], stack[0, 2] = cells[k, 1], cells[k, 2], cells[k, 3]
        stack[1, 0] = cells[k, 4]
        depth = 1
        while depth > 0:
            depth -= 1
            u0, u1, v0 = stack[2 * depth, 0], stack[2 * depth, 1], stack[2 * depth, 2]
            v1 = stack[2 * depth + 1, 0]
            u = 0.5 * (u0 + u1)
            v = 0.5 * (v0 + v1)
            ca, cb, cw, best, plane, gx, gy, _, _ = aim_offset(
                wall, u, v, source, ex, ey, ez, qx, qy, qz, sectors, press, cubic
            )
            px, py, pz, _, _, _, _ = top_point(wall, u, v, sectors, press, cubic)
            across = -1.0
            up = -1.0
            if cw > 1e-9 and plane > 1e-9:
                m = cw / plane
                across, up = image_box(
                    target, source, gx, gy, plane, cw,
                    ((px - ex if on_x else py - ey) - ca) * m, (pz - ez - cb) * m,
                )  # fmt: skip
            behind = 0
            au = av = bu = bv = 0.0
            for side in range(4):
                us = u0 if side == 0 else (u1 if side == 1 else u)
                vs = v0 if side == 2 else (v1 if side == 3 else v)
                sa, sb, sw, facing, there, _, _, _, _ = aim_offset(
                    wall, us, vs, source, ex, ey, ez, qx, qy, qz, sectors, press, cubic
                )
                best = max(best, facing)
                if sw <= 1e-9 or there <= 1e-9:
                    behind += 1
                elif side < 2:
                    au += abs(sa - ca)
                    bu += abs(sb - cb)
                else:
                    av += abs(sa - ca)
                    bv += abs(sb - cb)
            if best < 0.0 or (plane <= 1e-9 and behind == 4):
                continue
            half = -1.0
            tall = -1.0
            if across >= 0.0 and behind == 0:
                half = across + source[3]
                tall = up + source[4]
                if abs(ca) > half + MARGIN * (au + av) or abs(cb) > tall + MARGIN * (bu + bv):
                    continue
                change_u = max(au / half, bu / tall)
                change_v = max(av / half, bv / tall)
            else:
                off, change_u, change_v = angular_change(
                    wall, u0, u, u1, v0, v, v1, ex, ey, ez, qx, qy, qz, sectors, press, cubic
                )
                back = 1.0 / math.sqrt((qx - px) ** 2 + (qy - py) ** 2 + (qz - pz) ** 2)
                near = 1.0 / math.sqrt((px - ex) ** 2 + (py - ey) ** 2 + (pz - ez) ** 2)
                if off > receiver_size * back + emitter_size * near + MARGIN * (change_u + change_v):
                    continue
                change_u /= 2.0 * smallest_half * back
                change_v /= 2.0 * smallest_half * back
            if max(change_u, change_v) > tolerance and 2 * depth + 4 < CELL_STACK and u1 - u0 > SMALLEST_U:
                split(stack, depth, u0, u, u1, v0, v, v1, change_u > change_v, change_u <= change_v)
                depth += 2
                continue
            far, near_axis = resolved_cell(
                wall, u0, u1, v0, v1, max(change_u, change_v), 1.15 * half, 1.15 * tall, au + av, bu + bv,
                source, target, sectors, reach, largest, box, press, cubic, steepest, poly, other,
                stack[CELL_STACK:],
            )  # fmt: skip
            outer += far
            inner += near_axis
    return outer, inner
