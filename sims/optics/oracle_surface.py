"""The deformed top of the pad as the oracle sees it, and where a ray leaves the elastomer through it.

Model
-----
The press is axisymmetric about a vertical axis. Inside the contact circle the surface *is* the tip:
an exact sphere, and above its equator (a press deeper than the tip radius) the cylindrical shank up to
the last point of the curve that is no farther out than the contact radius. Under a tip that is no
hemisphere, the curve itself is the tip up to that point, as straight pieces. Beyond, the stored points
(radius, height) are read as one smooth curve: a monotone cubic (PCHIP, Fritsch & Carlson 1980) of radius
and of height over chord length, starting on the tip. So the curve may run back under itself. It is cut
into straight pieces that turn by at most `TURN_LIMIT` and are at most `PIECE_LIMIT_MM` long, which keeps
them within 0.15 µm of the curve; revolved, each piece is a cone frustum, which a ray meets where a
quadratic says. Normals turn linearly from end to end of a piece, so they are continuous. Beyond the last
point the top is the plane z = height; if the curve does not end at height zero, a vertical ring closes
the step.

Left out
--------
Anything that is not axisymmetric; several tips; the wall's hold on the surface (the curve passes through
the wall unchanged and is cut off there).

This file shares no code with the fast engine on purpose: it is the other half of a comparison.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from design.errors import InputError
from sims.indentation import Indentation

FloatArray = NDArray[np.float64]

TURN_LIMIT = 0.01
"""Largest turn of the curve within one straight piece [rad]."""
PIECE_LIMIT_MM = 0.1
"""Longest straight piece [mm]; with the turn limit its sagitta is at most 0.125 µm."""
SEAM_MM = 1e-6
"""Overlap of neighbouring pieces [mm], so that no ray slips through a seam."""
TIP_MISMATCH_MM = 0.1
"""Largest distance between the end of the contact on the curve and the tip [mm]: mesh and penetration."""
BLOCK = 16

NOTHING, FREE, CONTACT = 0, 1, 2


class RevolvedSurface(NamedTuple):
    """A press as typed numbers, heights in the cavity frame.

    Attributes
    ----------
    centre_x, centre_y : of the press axis [mm]
    top : height of the undisturbed surface [mm]
    edge : radius beyond which the surface is the plane z = top [mm]; 0 for an untouched pad
    tip_z, tip_radius : height of the tip sphere's centre, its radius [mm]
    cap_radius : radius of the part of the sphere that is in contact [mm]; 0 without contact
    pieces : (p, 8) r, z of the start; r, z of the unit direction; length; angle of the curve's tangent to
        the radial direction at start and end [rad]; 1 if in contact with the tip
    blocks : (b, 4) smallest and largest r, smallest and largest z of each run of `BLOCK` pieces
    """

    centre_x: float
    centre_y: float
    top: float
    edge: float
    tip_z: float
    tip_radius: float
    cap_radius: float
    pieces: FloatArray
    blocks: FloatArray


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
        return RevolvedSurface(x, y, top_mm, 0.0, 0.0, 1.0, 0.0, np.empty((0, 8)), np.empty((0, 4)))
    _check_indentation(indentation, top_mm, where)
    knots, wetted, cap_radius = _free_curve(indentation, where)
    pieces = [*_wetted_pieces(wetted), *_curve_pieces(knots), *_closing_ring(knots)]
    table = np.array(pieces, dtype=np.float64).reshape(-1, 8)
    table[:, 1] += top_mm
    return RevolvedSurface(
        x,
        y,
        top_mm,
        float(knots[-1, 0]),
        top_mm - indentation.depth_mm + indentation.tip_radius_mm,
        float(indentation.tip_radius_mm),
        cap_radius,
        table,
        _bounding_blocks(table),
    )


def _check_indentation(press: Indentation, top_mm: float, where: str) -> None:
    radius, height = np.asarray(press.radius_mm, float), np.asarray(press.height_mm, float)
    scalars = (press.depth_mm, press.tip_radius_mm, press.contact_radius_mm)
    if radius.ndim != 1 or radius.shape != height.shape or radius.size < 2:
        raise InputError(
            f"{where}: radius_mm {radius.shape} and height_mm {height.shape} must be two lists of the same"
            " length, at least 2 points"
        )
    if not (np.isfinite(radius).all() and np.isfinite(height).all() and np.isfinite(scalars).all()):
        raise InputError(f"{where}: the profile holds NaN or infinity; solve the contact again")
    if radius.min() < 0.0:
        raise InputError(f"{where}: radius_mm {radius.min():g} is negative; a radius is a distance")
    if radius[0] > SEAM_MM:
        raise InputError(f"{where}: the curve starts at radius {radius[0]:g} mm; it must start at 0")
    if radius[-1] < radius.max():
        raise InputError(
            f"{where}: the curve ends at radius {radius[-1]:g} mm, inside its largest {radius.max():g} mm;"
            " it must end at its outer rim"
        )
    if press.tip_radius_mm <= 0.0:
        raise InputError(f"{where}: tip_radius_mm {press.tip_radius_mm:g} must be > 0")
    if press.contact_radius_mm < 0.0 or press.contact_radius_mm > radius[-1] - 2.0 * SEAM_MM:
        raise InputError(
            f"{where}: contact_radius_mm {press.contact_radius_mm:g} must be >= 0 and inside the curve's rim,"
            f" {radius[-1]:g} mm"
        )
    deepest = max(press.depth_mm, -float(height.min()))
    if deepest >= top_mm:
        raise InputError(
            f"{where}: reaches {deepest:g} mm down in a clear layer of {top_mm:g} mm; press less deep"
        )


def _free_curve(press: Indentation, where: str) -> tuple[FloatArray, FloatArray, float]:
    """Knots (n, 2) of the free curve, ends (m, 2) of the tip's wetted straight pieces, radius of its cap."""
    curve = np.column_stack([press.radius_mm, press.height_mm]).astype(np.float64)
    if press.contact_radius_mm == 0.0:
        return _apart(curve), np.empty((0, 2)), 0.0
    tip, equator = press.tip_radius_mm, press.tip_radius_mm - press.depth_mm
    last = int(np.flatnonzero(curve[:, 0] <= press.contact_radius_mm * (1.0 + 1e-9))[-1])
    if not press.is_hemisphere:
        return _apart(curve[last:]), _apart(curve[: last + 1]), 0.0
    r, z = curve[last]
    gap = math.hypot(r, z - equator) - tip if z <= equator else r - tip
    if abs(gap) > TIP_MISMATCH_MM:
        raise InputError(
            f"{where}: at the contact radius the curve is {gap:+.3f} mm off the tip (limit"
            f" {TIP_MISMATCH_MM:g} mm); check tip_radius_mm {tip:g} and depth_mm {press.depth_mm:g}"
        )
    if z > equator:
        shank = np.array([[tip, equator], [tip, z]])
        return _apart(np.vstack([shank[1:], curve[last + 1 :]])), shank, tip
    cap = min(press.contact_radius_mm, tip)
    start = np.array([[cap, equator - math.sqrt(tip * tip - cap * cap)]])
    return _apart(np.vstack([start, curve[last + 1 :]])), np.empty((0, 2)), cap


def _apart(knots: FloatArray) -> FloatArray:
    """The knots without those that repeat the one before them."""
    step = np.hypot(*np.diff(knots, axis=0).T)
    return np.asarray(knots[np.concatenate([[True], step > SEAM_MM])])


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


@njit(cache=True)
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


@njit(cache=True)
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
    t, piece = _piece_distance(s, a, b, c, z, dz, best)
    if piece >= 0:
        best, what = t, (CONTACT if s.pieces[piece, 7] > 0.0 else FREE)
        r = math.sqrt(max(a * t * t + 2.0 * b * t + c, 0.0))
        r0, z0, kr, kz, length, angle0, angle1, _ = s.pieces[piece]
        share = min(max(((r - r0) * kr + (z + t * dz - z0) * kz) / length, 0.0), 1.0)
        angle = angle0 + share * (angle1 - angle0)
        nr, nz = -math.sin(angle), math.cos(angle)
    hx, hy = px + best * dx, py + best * dy
    r = max(math.hypot(hx, hy), 1e-12)
    return best, what, nr * hx / r, nr * hy / r, nz


@njit(cache=True)
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


@njit(cache=True)
def _piece_distance(
    s: RevolvedSurface, a: float, b: float, c: float, z: float, dz: float, limit: float
) -> tuple[float, int]:
    """Nearest exit through the frusta; the ray's squared radius is a t² + 2 b t + c, its height z + dz t."""
    best, piece = limit, -1
    start, stop = 0.0, limit
    reach = (s.edge + SEAM_MM) ** 2
    if a > 1e-14:
        gap = b * b - a * (c - reach)
        if gap <= 0.0:
            return best, piece
        start = max(start, (-b - math.sqrt(gap)) / a)
        stop = min(stop, (-b + math.sqrt(gap)) / a)
    elif c > reach:
        return best, piece
    for k in range(s.blocks.shape[0]):
        low_r, high_r, low_z, high_z = s.blocks[k]
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
        for i in range(k * BLOCK, min((k + 1) * BLOCK, s.pieces.shape[0])):
            t = _frustum_exit(s.pieces[i], a, b, c, z, dz, best)
            if t < best:
                best, piece = t, i
    return best, piece


@njit(cache=True)
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
