# mypy: no-warn-return-any
"""Kernels: straight light, and light mirrored by a flat top, between two rectangles on walls.

Gauss quadrature over the emitter's area, the receiver's columns and, in each column, the part of its
height that the emitter point sees. That part is known without sampling: in the vertical plane through
emitter point e and column u the top's horizon over the column is

    Z* = z_e + min over the chord of (h(s) - z_e) / s,     s = fraction of the way in plan,

and straight light is visible below Z*. Several tips: the smallest of their horizons. Patches are clipped to the clear
layer; Fresnel at the top, Beer-Lambert along the path.
"""

from __future__ import annotations

import math

from design.arrays import FloatArray
from sims.optics.surface.curves import ACTIVE, LOWEST, OUTER_R, TOP, X, Y
from sims.optics.surface.radial import (
    distance,
    fresnel,
    height,
    kernel,
    radiance,
    reach2,
    wall_normal,
    wall_point,
)
from sims.optics.surface.top import SLACK, Top, is_plain, surface_height

HORIZON_SAMPLES = 14
HORIZON_BISECTIONS = 9
GOLDEN = 0.6180339887498949
OPEN = 1e9


@kernel
def blocking_radius(z: float, tip: int, rows: FloatArray) -> float:
    """Radius beyond which the top lies nowhere below z; -1: nowhere at all."""
    if rows[tip, ACTIVE] == 0.0 or z <= rows[tip, LOWEST]:
        return -1.0
    return math.sqrt(reach2(z, tip, rows)) if z < rows[tip, TOP] else rows[tip, OUTER_R]


@kernel
def plan_distance(ax: float, ay: float, bx: float, by: float, cx: float, cy: float) -> float:
    """Distance of (cx, cy) to the segment a-b in plan."""
    dx = bx - ax
    dy = by - ay
    t = min(max(((cx - ax) * dx + (cy - ay) * dy) / max(dx * dx + dy * dy, 1e-30), 0.0), 1.0)
    return distance(ax + t * dx - cx, ay + t * dy - cy)


@kernel
def bundle_misses(
    source: FloatArray, target: FloatArray, radius: float, box: FloatArray, x: float, y: float
) -> bool:
    """Whether no straight line in plan from source to target comes within radius of the press axis."""
    a0, b0, _ = wall_point(int(source[0]), source[1] - source[3], 0.0, box)
    a1, b1, _ = wall_point(int(source[0]), source[1] + source[3], 0.0, box)
    c0, d0, _ = wall_point(int(target[0]), target[1] - target[3], 0.0, box)
    c1, d1, _ = wall_point(int(target[0]), target[1] + target[3], 0.0, box)
    near = min(
        min(plan_distance(a0, b0, c0, d0, x, y), plan_distance(a0, b0, c1, d1, x, y)),
        min(plan_distance(a1, b1, c0, d0, x, y), plan_distance(a1, b1, c1, d1, x, y)),
    )
    near = min(near, min(plan_distance(a0, b0, a1, b1, x, y), plan_distance(c0, d0, c1, d1, x, y)))
    if near <= radius:
        return False
    inside = _left_of(a0, b0, c0, d0, x, y) * _left_of(a1, b1, c1, d1, x, y) < 0.0
    crossed = _left_of(a0, b0, c1, d1, x, y) * _left_of(a1, b1, c0, d0, x, y) < 0.0
    return not (inside or crossed)


@kernel
def _left_of(ax: float, ay: float, bx: float, by: float, cx: float, cy: float) -> float:
    return (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)


@kernel
def reach_of(z: float, top: Top, radii: FloatArray) -> None:
    """Fill radii (tip,) beyond which no tip's dimple can block a line that stays below z."""
    for k in range(top.rows.shape[0]):
        radii[k] = blocking_radius(z + top.rows[0, SLACK], k, top.rows)


@kernel
def misses_all(source: FloatArray, target: FloatArray, radii: FloatArray, box: FloatArray, top: Top) -> bool:
    """Whether the pair's bundle in plan stays clear of every tip's radius."""
    for k in range(top.rows.shape[0]):
        if top.rows[k, ACTIVE] > 0.0 and not bundle_misses(
            source, target, radii[k], box, top.rows[k, X], top.rows[k, Y]
        ):
            return False
    return True


@kernel
def _rise(s: float, b: float, c: float, a: float, z: float, tip: int, rows: FloatArray) -> float:
    return (height(max(a * s * s + 2.0 * b * s + c, 0.0), tip, rows) - z) / s


@kernel
def _rise_any(s: float, x: float, y: float, dx: float, dy: float, z: float, top: Top) -> float:
    return (surface_height(x + s * dx, y + s * dy, top) - z) / s


@kernel
def horizon(x: float, y: float, z: float, qx: float, qy: float, radii: FloatArray, top: Top) -> float:
    """Height at q below which the straight line from (x, y, z) passes under the top; OPEN if none can block."""
    lowest = OPEN
    for k in range(top.rows.shape[0]):
        if radii[k] > 0.0:
            lowest = min(lowest, _horizon_of(k, x, y, z, qx, qy, radii[k], top))
    return lowest


@kernel
def _horizon_of(
    tip: int, x: float, y: float, z: float, qx: float, qy: float, radius: float, top: Top
) -> float:
    """The horizon of the part of the chord within `radius` of a tip's axis."""
    plain = is_plain(top)
    dx = qx - x
    dy = qy - y
    px = x - top.rows[tip, X]
    py = y - top.rows[tip, Y]
    a = dx * dx + dy * dy
    b = px * dx + py * dy
    c = px * px + py * py
    disc = b * b - a * (c - radius * radius)
    if disc <= 0.0:
        return OPEN
    root = math.sqrt(disc)
    low = max((-b - root) / a, 1e-6)
    high = min((-b + root) / a, 1.0)
    if high <= low:
        return OPEN
    step = (high - low) / HORIZON_SAMPLES
    best = 1e18
    at = 0
    for k in range(HORIZON_SAMPLES + 1):
        s = low + step * k
        value = _rise(s, b, c, a, z, tip, top.rows) if plain else _rise_any(s, x, y, dx, dy, z, top)
        if value < best:
            best = value
            at = k
    left = low + step * max(at - 1, 0)
    right = low + step * min(at + 1, HORIZON_SAMPLES)
    s1 = right - GOLDEN * (right - left)
    s2 = left + GOLDEN * (right - left)
    f1 = _rise(s1, b, c, a, z, tip, top.rows) if plain else _rise_any(s1, x, y, dx, dy, z, top)
    f2 = _rise(s2, b, c, a, z, tip, top.rows) if plain else _rise_any(s2, x, y, dx, dy, z, top)
    for _ in range(HORIZON_BISECTIONS):
        if f1 < f2:
            right = s2
            s2 = s1
            f2 = f1
            s1 = right - GOLDEN * (right - left)
            f1 = _rise(s1, b, c, a, z, tip, top.rows) if plain else _rise_any(s1, x, y, dx, dy, z, top)
        else:
            left = s1
            s1 = s2
            f1 = f2
            s2 = left + GOLDEN * (right - left)
            f2 = _rise(s2, b, c, a, z, tip, top.rows) if plain else _rise_any(s2, x, y, dx, dy, z, top)
    return z + min(best, min(f1, f2))


@kernel
def column_flux(
    x: float, y: float, z: float, source: FloatArray, target: FloatArray, qx: float, qy: float, z0: float, z1: float,
    mirrored: bool, box: FloatArray, nodes: FloatArray, weights: FloatArray,
) -> float:  # fmt: skip
    """Flux from an emitter point through a column's heights z0..z1, per column width and emitter share."""
    if z1 <= z0:
        return 0.0
    n0, n1 = wall_normal(int(source[0]))
    m0, m1 = wall_normal(int(target[0]))
    dx = qx - x
    dy = qy - y
    out = dx * n0 + dy * n1
    into = -(dx * m0 + dy * m1)
    if out <= 0.0 or into <= 0.0:
        return 0.0
    plain = source[5] == 1.0 and target[5] == 1.0
    plan2 = dx * dx + dy * dy
    total = 0.0
    for k in range(nodes.shape[0]):
        height_k = z0 + (z1 - z0) * nodes[k]
        dz = (2.0 * box[2] - height_k if mirrored else height_k) - z
        d2 = plan2 + dz * dz
        d = math.sqrt(d2)
        f = out * into / (d2 * d2)
        if not plain:
            f *= math.pi * math.pi * radiance(source, out / d) * radiance(target, into / d)
        if mirrored:
            f *= fresnel(dz / d, box[3])
        if box[4] > 0.0:
            f *= math.exp(-box[4] * d)
        total += weights[k] * f
    return total * (z1 - z0) / math.pi


@kernel
def direct_flux(
    source: FloatArray, target: FloatArray, radii: FloatArray, box: FloatArray, top: Top, nodes_e: FloatArray,
    weights_e: FloatArray, nodes_u: FloatArray, weights_u: FloatArray, nodes_z: FloatArray, weights_z: FloatArray,
) -> float:  # fmt: skip
    """Straight flux of a pair under a press, as a fraction of the emitter's power."""
    total = 0.0
    low = target[2] - target[4]
    high = target[2] + target[4]
    for a in range(nodes_e.shape[0]):
        for b in range(nodes_e.shape[0]):
            along = source[1] + source[3] * (2.0 * nodes_e[a] - 1.0)
            z = source[2] + source[4] * (2.0 * nodes_e[b] - 1.0)
            x, y, z = wall_point(int(source[0]), along, z, box)
            share = weights_e[a] * weights_e[b]
            for c in range(nodes_u.shape[0]):
                column = target[1] + target[3] * (2.0 * nodes_u[c] - 1.0)
                qx, qy, _ = wall_point(int(target[0]), column, 0.0, box)
                edge = min(high, horizon(x, y, z, qx, qy, radii, top))
                flux = column_flux(x, y, z, source, target, qx, qy, low, edge, False, box, nodes_z, weights_z)
                total += share * weights_u[c] * flux
    return total * 2.0 * target[3] * 4.0 * source[3] * source[4] / source[6]


@kernel
def flat_flux(
    source: FloatArray, target: FloatArray, box: FloatArray, mirrored: bool, nodes_e: FloatArray, weights_e: FloatArray,
    nodes_u: FloatArray, weights_u: FloatArray, nodes_z: FloatArray, weights_z: FloatArray,
) -> float:  # fmt: skip
    """Straight or mirrored flux of a pair under a flat top."""
    total = 0.0
    low = target[2] - target[4]
    high = target[2] + target[4]
    for a in range(nodes_e.shape[0]):
        for b in range(nodes_e.shape[0]):
            along = source[1] + source[3] * (2.0 * nodes_e[a] - 1.0)
            z = source[2] + source[4] * (2.0 * nodes_e[b] - 1.0)
            x, y, z = wall_point(int(source[0]), along, z, box)
            for c in range(nodes_u.shape[0]):
                column = target[1] + target[3] * (2.0 * nodes_u[c] - 1.0)
                qx, qy, _ = wall_point(int(target[0]), column, 0.0, box)
                flux = column_flux(
                    x, y, z, source, target, qx, qy, low, high, mirrored, box, nodes_z, weights_z
                )
                total += weights_e[a] * weights_e[b] * weights_u[c] * flux
    return total * 2.0 * target[3] * 4.0 * source[3] * source[4] / source[6]
