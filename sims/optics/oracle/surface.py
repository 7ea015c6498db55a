"""The pad's top under one press, a surface of revolution, and where rays meet it from inside and from outside.

Model
-----
The press is axisymmetric about a vertical axis. The contact and where it ends are as in
`sims.optics.oracle.profile`. Beyond, the stored points (radius, height) are read as one smooth curve: a monotone
cubic (PCHIP, Fritsch & Carlson 1980) of radius and of height over chord length, starting on the tip. So the
curve may run back under itself. It is cut into straight pieces that turn by at most `TURN_LIMIT` and are at most
`PIECE_LIMIT_MM` long, which keeps them within 0.15 µm of the curve; revolved, each piece is a cone frustum,
which a ray meets where a quadratic says. Normals turn linearly from end to end of a piece, so they are
continuous. Beyond the last point the top is the plane z = height; if the curve does not end at height zero, a
vertical ring closes the step.

Left out
--------
Anything that is not axisymmetric, and several tips: `sims.optics.oracle.heights` has those. The wall's hold on
the surface (the curve passes through the wall unchanged and is cut off there).

This file shares no code with the fast engine on purpose: it is the other half of a comparison.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from scipy.interpolate import PchipInterpolator

from design.arrays import FloatArray
from sims.optics.oracle.profile import SEAM_MM, check_indentation, free_curve
from sims.press import Indentation

TURN_LIMIT = 0.01
"""Largest turn of the curve within one straight piece [rad]."""
PIECE_LIMIT_MM = 0.1
"""Longest straight piece [mm]; with the turn limit its sagitta is at most 0.125 µm."""
BLOCK = 16

NOTHING, FREE, CONTACT = 0, 1, 2


class RevolvedSurface(NamedTuple):
    """A press as typed numbers, heights in the cavity frame.

    Attributes
    ----------
    centre_x, centre_y : of the press axis [mm]
    top : height of the undisturbed surface [mm]
    highest : of the surface [mm]
    edge : radius beyond which the surface is the plane z = top [mm]; 0 for an untouched pad
    tip_z, tip_radius : height of the tip sphere's centre, its radius [mm]
    cap_radius : radius of the part of the sphere that is in contact [mm]; 0 without contact
    pieces : (p, 8) r, z of the start; r, z of the unit direction; length; angle of the curve's tangent to
        the radial direction at start and end [rad]; 1 if in contact with the tip
    blocks : (b, 4) smallest and largest r, smallest and largest z of each run of `BLOCK` pieces
    back, back_blocks : the free pieces run through from their end to their start, as light in air meets them
    solids : (k, 6) the tip as light in air meets it (`sims.optics.oracle.top.tip_hit`)
    """

    centre_x: float
    centre_y: float
    top: float
    highest: float
    edge: float
    tip_z: float
    tip_radius: float
    cap_radius: float
    pieces: FloatArray
    blocks: FloatArray
    back: FloatArray
    back_blocks: FloatArray
    solids: FloatArray


def lower_surface(
    indentation: Indentation | None, centre_mm: FloatArray, top_mm: float, where: str = "indentation"
) -> RevolvedSurface:
    """Turn one press into numbers; None or a depth of zero or less is the untouched top.

    Parameters
    ----------
    indentation : the press, or None
    centre_mm : (2,) x and y of its axis [mm]
    top_mm : height of the undisturbed surface [mm]
    where : what to call the press in messages
    """
    x, y = float(centre_mm[0]), float(centre_mm[1])
    if indentation is None or indentation.depth_mm <= 0.0:
        none, no_block = np.empty((0, 8)), np.empty((0, 4))
        return RevolvedSurface(
            x, y, top_mm, top_mm, 0.0, 0.0, 1.0, 0.0, none, no_block, none, no_block, np.empty((0, 6))
        )
    check_indentation(indentation, top_mm, where)
    knots, wetted, cap_radius = free_curve(indentation, where)
    pieces = [*_wetted_pieces(wetted), *_curve_pieces(knots), *_closing_ring(knots)]
    table = np.array(pieces, dtype=np.float64).reshape(-1, 8)
    table[:, 1] += top_mm
    back = _reversed_pieces(table[table[:, 7] == 0.0])
    return RevolvedSurface(
        x,
        y,
        top_mm,
        float(max(knots[:, 1].max(), 0.0)) + top_mm,
        float(knots[-1, 0]),
        top_mm - indentation.depth_mm + indentation.tip_radius_mm,
        float(indentation.tip_radius_mm),
        cap_radius,
        table,
        _bounding_blocks(table),
        back,
        _bounding_blocks(back),
        np.empty((0, 6)),
    )


def _reversed_pieces(table: FloatArray) -> FloatArray:
    """The same pieces from end to start, so that what left the elastomer through them enters it."""
    back = table.copy()
    back[:, :2] += table[:, 2:4] * table[:, 4:5]
    back[:, 2:4] *= -1.0
    back[:, 5], back[:, 6] = table[:, 6] + math.pi, table[:, 5] + math.pi
    return back


def _wetted_pieces(ends: FloatArray) -> list[tuple[float, ...]]:
    step = np.diff(ends, axis=0)
    size, angle = np.hypot(step[:, 0], step[:, 1]), np.arctan2(step[:, 1], step[:, 0])
    return [(*ends[i], *(step[i] / size[i]), size[i], angle[i], angle[i], 1.0) for i in range(len(step))]


def _closing_ring(knots: FloatArray) -> list[tuple[float, ...]]:
    r, z = knots[-1]
    if abs(z) < 1e-9:
        return []
    up = math.copysign(1.0, -z)
    return [(r, z, 0.0, up, abs(z), up * 0.5 * math.pi, up * 0.5 * math.pi, 0.0)]


def _curve_pieces(knots: FloatArray) -> list[tuple[float, ...]]:
    """Cut the smooth curve through the knots into straight pieces."""
    chord = np.hypot(*np.diff(knots, axis=0).T)
    along = np.concatenate([[0.0], np.cumsum(chord)])
    curve = PchipInterpolator(along, knots)
    tangent = curve.derivative()
    sample = along[:-1, None] + chord[:, None] * np.linspace(0.0, 1.0, 9)
    turn = np.abs(np.diff(_angles(tangent(sample), np.diff(knots, axis=0)[:, None, :]), axis=1)).sum(axis=1)
    count = np.ceil(np.maximum(turn / TURN_LIMIT, chord / PIECE_LIMIT_MM)).astype(int).clip(min=1)
    pieces: list[tuple[float, ...]] = []
    for start, length, n in zip(along[:-1], chord, count, strict=True):
        cut = start + length * np.linspace(0.0, 1.0, n + 1)
        point = np.asarray(curve(cut))
        step = np.diff(point, axis=0)
        size = np.hypot(*step.T)
        angle = _angles(np.asarray(tangent(cut)), np.vstack([step, step[-1:]]))
        pieces += [(*point[i], *(step[i] / size[i]), size[i], angle[i], angle[i + 1], 0.0) for i in range(n)]
    return pieces


def _angles(tangent: FloatArray, fallback: FloatArray) -> FloatArray:
    """Continuous angle of tangents (..., n, 2) to the radial direction [rad]; at rest, of the fallback."""
    at_rest = np.hypot(tangent[..., 0], tangent[..., 1])[..., None] < 1e-9
    used = np.where(at_rest, fallback, tangent)
    return np.asarray(np.unwrap(np.arctan2(used[..., 1], used[..., 0]), axis=-1))


def _bounding_blocks(table: FloatArray) -> FloatArray:
    ends = table[:, :2] + table[:, 2:4] * table[:, 4:5]
    rows = []
    for first in range(0, len(table), BLOCK):
        points = np.vstack([table[first : first + BLOCK, :2], ends[first : first + BLOCK]])
        low, high = points.min(axis=0) - SEAM_MM, points.max(axis=0) + SEAM_MM
        rows.append((max(low[0], 0.0), high[0], low[1], high[1]))
    return np.array(rows).reshape(-1, 4)


@njit()
def is_submerged(s: RevolvedSurface, x: float, y: float, z: float) -> bool:
    """Whether a point lies in the elastomer: the surface passes above it an odd number of times."""
    r = math.hypot(x - s.centre_x, y - s.centre_y)
    if r >= s.edge:
        return z <= s.top
    above = 0
    if r < s.cap_radius and s.tip_z - math.sqrt(s.tip_radius**2 - r * r) > z:
        above += 1
    for i in range(s.pieces.shape[0]):
        r0, z0, kr, kz, length = s.pieces[i, :5]
        if (r0 <= r) != (r0 + kr * length <= r) and z0 + (r - r0) * kz / kr > z:
            above += 1
    return above % 2 == 1


@njit(forceinline=True)
def surface_hit(
    s: RevolvedSurface, x: float, y: float, z: float, dx: float, dy: float, dz: float, limit: float
) -> tuple[float, int, float, float, float]:
    """First place nearer than `limit` where a ray from inside leaves the elastomer through the top.

    Parameters
    ----------
    x, y, z : start, inside the elastomer [mm]
    dx, dy, dz : unit direction [-]

    Returns
    -------
    distance [mm], what (`NOTHING`, `FREE`, `CONTACT`), and the unit normal that points out of the elastomer
    """
    px, py = x - s.centre_x, y - s.centre_y
    a, b, c = dx * dx + dy * dy, px * dx + py * dy, px * px + py * py
    best, what, nr, nz = limit, NOTHING, 0.0, 1.0
    if dz > 0.0:
        t = (s.top - z) / dz
        if -1e-9 < t < best and a * t * t + 2.0 * b * t + c >= max(s.edge - SEAM_MM, 0.0) ** 2:
            best, what = max(t, 0.0), FREE
    if s.cap_radius > 0.0:
        t = _cap_distance(s, px, py, z, dx, dy, dz)
        if t < best:
            best, what = t, CONTACT
            nr = -math.sqrt(max(a * t * t + 2.0 * b * t + c, 0.0)) / s.tip_radius
            nz = (s.tip_z - z - t * dz) / s.tip_radius
    t, piece = _piece_distance(s.pieces, s.blocks, s.edge, a, b, c, z, dz, best)
    if piece >= 0:
        best, what = t, (CONTACT if s.pieces[piece, 7] > 0.0 else FREE)
        nr, nz = _piece_normal(s.pieces[piece], math.sqrt(max(a * t * t + 2.0 * b * t + c, 0.0)), z + t * dz)
    hx, hy = px + best * dx, py + best * dy
    r = max(math.hypot(hx, hy), 1e-12)
    return best, what, nr * hx / r, nr * hy / r, nz


@njit()
def surface_entry(
    s: RevolvedSurface, x: float, y: float, z: float, dx: float, dy: float, dz: float, limit: float
) -> tuple[float, int, float, float, float]:
    """First place nearer than `limit` where a ray in air enters the elastomer; tips are not seen here.

    Parameters and results as of `surface_hit`, but the start is in air and the normal points into the elastomer.
    """
    if dz >= 0.0 and z > s.highest + SEAM_MM:
        return limit, NOTHING, 0.0, 0.0, -1.0
    px, py = x - s.centre_x, y - s.centre_y
    a, b, c = dx * dx + dy * dy, px * dx + py * dy, px * px + py * py
    best, what, nr, nz = limit, NOTHING, 0.0, -1.0
    if dz < 0.0:
        t = (s.top - z) / dz
        if -1e-9 < t < best and a * t * t + 2.0 * b * t + c >= max(s.edge - SEAM_MM, 0.0) ** 2:
            best, what = max(t, 0.0), FREE
    t, piece = _piece_distance(s.back, s.back_blocks, s.edge, a, b, c, z, dz, best)
    if piece >= 0:
        best, what = t, FREE
        nr, nz = _piece_normal(s.back[piece], math.sqrt(max(a * t * t + 2.0 * b * t + c, 0.0)), z + t * dz)
    hx, hy = px + best * dx, py + best * dy
    r = max(math.hypot(hx, hy), 1e-12)
    return best, what, nr * hx / r, nr * hy / r, nz


@njit()
def _piece_normal(piece: FloatArray, r: float, z: float) -> tuple[float, float]:
    """Radial and vertical part of the unit normal at a place on a piece."""
    r0, z0, kr, kz, length, angle0, angle1, _ = piece
    share = min(max(((r - r0) * kr + (z - z0) * kz) / length, 0.0), 1.0)
    angle = angle0 + share * (angle1 - angle0)
    return -math.sin(angle), math.cos(angle)


@njit()
def _cap_distance(
    s: RevolvedSurface, px: float, py: float, z: float, dx: float, dy: float, dz: float
) -> float:
    """Distance at which a ray enters the tip sphere through its wetted cap [mm]; infinity if it does not."""
    oz = z - s.tip_z
    b = px * dx + py * dy + oz * dz
    gap = b * b - (px * px + py * py + oz * oz - s.tip_radius**2)
    if b >= 0.0 or gap <= 0.0:
        return math.inf
    t = -b - math.sqrt(gap)
    r2 = (px + t * dx) ** 2 + (py + t * dy) ** 2
    if t < 0.0 or oz + t * dz > SEAM_MM or r2 > (s.cap_radius + SEAM_MM) ** 2:
        return math.inf
    return t


@njit()
def _piece_distance(
    pieces: FloatArray,
    blocks: FloatArray,
    edge: float,
    a: float,
    b: float,
    c: float,
    z: float,
    dz: float,
    limit: float,
) -> tuple[float, int]:
    """Nearest passage through the frusta; the ray's squared radius is a t² + 2 b t + c, its height z + dz t."""
    best, piece = limit, -1
    start, stop = 0.0, limit
    reach = (edge + SEAM_MM) ** 2
    if a > 1e-14:
        gap = b * b - a * (c - reach)
        if gap <= 0.0:
            return best, piece
        start = max(start, (-b - math.sqrt(gap)) / a)
        stop = min(stop, (-b + math.sqrt(gap)) / a)
    elif c > reach:
        return best, piece
    for k in range(blocks.shape[0]):
        low_r, high_r, low_z, high_z = blocks[k]
        t0, t1 = start, min(stop, best)
        if abs(dz) > 1e-14:
            ta, tb = (low_z - z) / dz, (high_z - z) / dz
            t0, t1 = max(t0, min(ta, tb)), min(t1, max(ta, tb))
        elif z < low_z or z > high_z:
            continue
        if t0 > t1:
            continue
        middle = min(max(-b / a, t0), t1) if a > 1e-14 else t0
        nearest = a * middle * middle + 2.0 * b * middle + c
        farthest = max(a * t0 * t0 + 2.0 * b * t0 + c, a * t1 * t1 + 2.0 * b * t1 + c)
        if nearest > high_r * high_r or farthest < low_r * low_r:
            continue
        for i in range(k * BLOCK, min((k + 1) * BLOCK, pieces.shape[0])):
            t = _frustum_exit(pieces[i], a, b, c, z, dz, best)
            if t < best:
                best, piece = t, i
    return best, piece


@njit()
def _frustum_exit(
    piece: FloatArray, a: float, b: float, c: float, z: float, dz: float, limit: float
) -> float:
    """Distance at which a ray leaves through one frustum [mm]; infinity if it does not before `limit`.

    On the cone through the piece, the offset f(t) = (z - z0) kr - (r - r0) kz is zero; it grows where the
    ray leaves the elastomer. Squaring r = sqrt(a t² + 2 b t + c) gives a quadratic; Newton steps on f
    then remove its rounding, and show up the root of the mirrored cone.
    """
    r0, z0, kr, kz, length = piece[:5]
    g0, g1 = (z - z0) * kr + r0 * kz, dz * kr
    qa, qb, qc = a * kz * kz - g1 * g1, b * kz * kz - g0 * g1, c * kz * kz - g0 * g0
    gap = qb * qb - qa * qc
    if gap < -1e-12 * qb * qb:
        return math.inf
    q = -(qb + math.copysign(math.sqrt(max(gap, 0.0)), qb))
    best = math.inf
    for root in range(2):
        if root == 0:
            if qa == 0.0:
                continue
            t = q / qa
        else:
            if q == 0.0:
                continue
            t = qc / q
        offset, growth = 1.0, 1.0
        for _ in range(3):
            r = max(math.sqrt(max((a * t + 2.0 * b) * t + c, 0.0)), 1e-12)
            offset = g0 + g1 * t - kz * r
            growth = g1 - kz * (a * t + b) / r
            if growth <= 0.0 or abs(offset) < 1e-12:
                break
            t -= offset / growth
        if growth <= 0.0 or abs(offset) > 1e-9 or t < 0.0 or t >= limit or t >= best:
            continue
        r = math.sqrt(max((a * t + 2.0 * b) * t + c, 0.0))
        share = (r - r0) * kr + (z + t * dz - z0) * kz
        if -SEAM_MM <= share <= length + SEAM_MM:
            best = t
    return best
