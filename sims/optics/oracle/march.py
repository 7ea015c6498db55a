"""Where rays meet a top that is a sum of heights, from inside and from outside.

Method
------
Along a ray the clearance c(t), top less ray or, in air, ray less top, is followed from 0 up. Circles of contact
and edge and the field's border cut the ray into parts on which c is once differentiable and |c''| has a bound K,
kept in tables over radius: with unit steps of which w² lie in plan, |c''| <= w² (max(|h''|, |h'| / r) + field's).
A crown adds w² R² / (R² - r²)^1.5 at the part's greatest r, a cylinder with what lies across its straight direction;
it is convex, so that only downward from inside and only upward from outside: c'' lies in -K_down to K_up.
A step s is safe if the clearances at its ends are above K_up s² / 8, or if c cannot fall within it; it holds the
first zero if its end is below zero and c must fall within it, or K_up is 0, and bisection then finds it; otherwise it
is halved. Steps end at `FINEST_MM`, so that what is missed is a graze less than K `FINEST_MM`² / 8 deep. On a crown
Newton's steps take the place of bisection.

This file shares no code with the fast engine on purpose: it is the other half of a comparison.
"""

from __future__ import annotations

import math

from numba import njit

from sims.optics.oracle.heights import (
    BINS,
    CONTACT_RADIUS,
    DROP,
    EDGE,
    LAST,
    SPHERE,
    SummedSurface,
    X,
    Y,
    crown_bend,
    crown_fall,
)
from sims.optics.oracle.surface import CONTACT, FREE, NOTHING

FINEST_MM = 2e-5
"""Shortest step along a ray [mm]."""
BORDER_MM = 1e-9
"""A part of a ray starts and ends this far from the circles and lines that bound it [mm]."""
MARGIN_MM = 1e-6
"""A field goes on this far beyond its border [mm], so that rounding at a wall where it ends is no step."""
FACE_MM = 1e-7
"""Fall of the clearance across a border that is a vertical face, not rounding [mm]."""
INSIDE, OUTSIDE = 1.0, -1.0


@njit()
def summed_height(s: SummedSurface, x: float, y: float) -> tuple[float, float, float]:
    """Height of the top [mm] and its slopes along x and y [-] at a place."""
    height, along, across = s.top, 0.0, 0.0
    if s.crown_radius > 0.0:
        fall, steepness = crown_fall(s.crown_radius, s.crown_along * x * x + y * y)
        height, along, across = height - fall, -steepness * s.crown_along * x, -steepness * y
    for k in range(s.tips.shape[0]):
        px, py = x - s.tips[k, X], y - s.tips[k, Y]
        r, edge, contact = math.hypot(px, py), s.tips[k, EDGE], s.tips[k, CONTACT_RADIUS]
        if r >= edge:
            continue
        sphere = s.tips[k, SPHERE]
        if sphere > 0.0 and r < contact:
            depth = math.sqrt(max(sphere * sphere - r * r, 1e-18))
            height += sphere - s.tips[k, DROP] - depth
            slope = r / depth
            if s.crown_radius > 0.0:
                fall, steepness = crown_fall(s.crown_mean, r * r)
                height += fall
                slope += steepness * r
        else:
            row = s.starts[k, min(int(r / edge * BINS), BINS - 1)]
            while row < s.tips[k, LAST] and r >= s.curve[row + 1, 0]:
                row += 1
            start, c0, c1, c2, c3 = s.curve[row]
            u = r - start
            height += ((c3 * u + c2) * u + c1) * u + c0
            slope = (3.0 * c3 * u + 2.0 * c2) * u + c1
        if r > 1e-12:
            along += slope * px / r
            across += slope * py / r
    if s.nodes.shape[0] > 0:
        value, fx, fy = _field_height(s, x, y)
        height, along, across = height + value, along + fx, across + fy
    return height, along, across


@njit()
def _field_height(s: SummedSurface, x: float, y: float) -> tuple[float, float, float]:
    """The field's value [mm] and slopes [-] at a place."""
    u, v = (x - s.origin[0]) / s.step[0], (y - s.origin[1]) / s.step[1]
    last_i, last_j = s.nodes.shape[0] - 1, s.nodes.shape[1] - 1
    du, dv = MARGIN_MM / s.step[0], MARGIN_MM / s.step[1]
    if u < -du or v < -dv or u > last_i + du or v > last_j + dv:
        return 0.0, 0.0, 0.0
    u, v = min(max(u, 0.0), float(last_i)), min(max(v, 0.0), float(last_j))
    i, j = min(int(u), last_i - 1), min(int(v), last_j - 1)
    u, v = u - i, v - j
    value, along, across = 0.0, 0.0, 0.0
    for a in range(2):
        p0, p1, q0, q1 = _cubic_ends(u, a, s.step[0])
        for b in range(2):
            r0, r1, t0, t1 = _cubic_ends(v, b, s.step[1])
            z, zx, zy, zxy = s.nodes[i + a, j + b]
            value += p0 * (z * r0 + zy * r1) + p1 * (zx * r0 + zxy * r1)
            along += q0 * (z * r0 + zy * r1) + q1 * (zx * r0 + zxy * r1)
            across += p0 * (z * t0 + zy * t1) + p1 * (zx * t0 + zxy * t1)
    return value, along, across


@njit()
def _cubic_ends(t: float, end: int, step: float) -> tuple[float, float, float, float]:
    """Weights of an end's value and slope in a cubic's value, then in its slope; t in [0, 1] from the first end."""
    if end == 0:
        return (
            1.0 + t * t * (2.0 * t - 3.0),
            step * t * (1.0 + t * (t - 2.0)),
            6.0 * t * (t - 1.0) / step,
            1.0 + t * (3.0 * t - 4.0),
        )
    return (
        t * t * (3.0 - 2.0 * t),
        step * t * t * (t - 1.0),
        6.0 * t * (1.0 - t) / step,
        t * (3.0 * t - 2.0),
    )


@njit()
def _clearance(
    s: SummedSurface, side: float, x: float, y: float, z: float, dx: float, dy: float, dz: float, t: float
) -> tuple[float, float]:
    """Clearance of a ray [mm] and its growth along the ray [-]; side 1 from inside, -1 from outside."""
    height, along, across = summed_height(s, x + t * dx, y + t * dy)
    return side * (height - z - t * dz), side * (along * dx + across * dy - dz)


@njit()
def _bends(
    s: SummedSurface, side: float, x: float, y: float, dx: float, dy: float, t0: float, t1: float
) -> tuple[float, float]:
    """K_up and K_down: bounds of the clearance's second derivative between two places on a ray [1/mm]."""
    bound = s.field_bend
    a = dx * dx + dy * dy
    for k in range(s.tips.shape[0]):
        px, py = x - s.tips[k, X], y - s.tips[k, Y]
        b, c, edge = px * dx + py * dy, px * px + py * py, s.tips[k, EDGE]
        nearest = min(max(-b / a, t0), t1) if a > 1e-14 else t0
        low = math.sqrt(max((a * nearest + 2.0 * b) * nearest + c, 0.0))
        if low >= edge:
            continue
        high = math.sqrt(max((a * t0 + 2.0 * b) * t0 + c, (a * t1 + 2.0 * b) * t1 + c, 0.0))
        worst = 0.0
        for ring in range(int(low / edge * BINS), min(int(high / edge * BINS), BINS - 1) + 1):
            worst = max(worst, s.bends[k, ring])
        bound += worst
    bound *= a
    crown = _crown_bend(s, x, y, dx, dy, t0, t1) if s.crown_radius > 0.0 else 0.0
    return (bound, bound + crown) if side == INSIDE else (bound + crown, bound)


@njit()
def _crown_bend(s: SummedSurface, x: float, y: float, dx: float, dy: float, t0: float, t1: float) -> float:
    """The crown's part of the bound."""
    farthest = 0.0
    for t in (t0, t1):
        px, py = x + t * dx, y + t * dy
        farthest = max(farthest, s.crown_along * px * px + py * py)
    return (s.crown_along * dx * dx + dy * dy) * crown_bend(s.crown_radius, farthest)


@njit()
def _next_border(
    s: SummedSurface, x: float, y: float, dx: float, dy: float, t: float, limit: float
) -> tuple[float, int]:
    """The next circle or line after t that a ray crosses in plan, and which: a tip, -1 along x, -2 along y."""
    best, which = limit, -3
    a = dx * dx + dy * dy
    for k in range(s.tips.shape[0]):
        px, py = x - s.tips[k, X], y - s.tips[k, Y]
        b, c = px * dx + py * dy, px * px + py * py
        for radius in (s.tips[k, EDGE], s.tips[k, CONTACT_RADIUS]):
            gap = b * b - a * (c - radius * radius)
            if gap <= 0.0 or a < 1e-14:
                continue
            for sign in (-1.0, 1.0):
                place = (-b + sign * math.sqrt(gap)) / a
                if t < place < best:
                    best, which = place, k
    if s.nodes.shape[0] > 0:
        for end in range(2):
            margin = MARGIN_MM if end == 1 else -MARGIN_MM
            if dx != 0.0:
                place = (s.origin[0] + end * (s.nodes.shape[0] - 1) * s.step[0] + margin - x) / dx
                if t < place < best:
                    best, which = place, -1
            if dy != 0.0:
                place = (s.origin[1] + end * (s.nodes.shape[1] - 1) * s.step[1] + margin - y) / dy
                if t < place < best:
                    best, which = place, -2
    return best, which


@njit()
def _first_zero(
    s: SummedSurface,
    side: float,
    x: float,
    y: float,
    z: float,
    dx: float,
    dy: float,
    dz: float,
    t0: float,
    t1: float,
) -> float:
    """First place between t0 and t1 where the clearance falls to zero; infinity if it does not."""
    t, step = t0, t1 - t0
    near, growth = _clearance(s, side, x, y, z, dx, dy, dz, t)
    if near <= 0.0 and growth < 0.0:
        return t
    while t < t1:
        step = min(step, t1 - t)
        end = t + step if step < t1 - t else t1
        far, far_growth = _clearance(s, side, x, y, z, dx, dy, dz, end)
        up, down = _bends(s, side, x, y, dx, dy, t, end)
        rises = growth - down * step >= 0.0 and far > 0.0
        falls = (growth + up * step < 0.0 or up == 0.0) and near > 0.0 >= far
        if not (rises or falls or min(near, far) > up * step * step / 8.0):
            if step > FINEST_MM:
                step *= 0.5
                continue
            falls = far <= 0.0
        if falls and s.crown_radius > 0.0:
            return _newton(s, side, x, y, z, dx, dy, dz, t, end)
        if falls:
            return _bisected(s, side, x, y, z, dx, dy, dz, t, end)
        t, near, growth, step = end, far, far_growth, 2.0 * step
    return math.inf


@njit()
def _bisected(
    s: SummedSurface,
    side: float,
    x: float,
    y: float,
    z: float,
    dx: float,
    dy: float,
    dz: float,
    low: float,
    high: float,
) -> float:
    """A zero of the clearance between a place where it is positive and one where it is not."""
    for _ in range(60):
        middle = 0.5 * (low + high)
        if high - low < 1e-13 or middle in (low, high):
            break
        if _clearance(s, side, x, y, z, dx, dy, dz, middle)[0] > 0.0:
            low = middle
        else:
            high = middle
    return low


@njit()
def _newton(
    s: SummedSurface,
    side: float,
    x: float,
    y: float,
    z: float,
    dx: float,
    dy: float,
    dz: float,
    low: float,
    high: float,
) -> float:
    """As `_bisected`, by Newton's steps from the far end, halving where one leaves the bracket: crowns are smooth."""
    place = high
    for _ in range(60):
        clear, growth = _clearance(s, side, x, y, z, dx, dy, dz, place)
        if clear > 0.0:
            low = place
        else:
            high = place
        guess = place - clear / growth if growth < 0.0 else low
        if not low < guess < high:
            guess = 0.5 * (low + high)
        if abs(guess - place) < 1e-13 or high - low < 1e-13:
            break
        place = guess
    return low if high - low < 1e-13 else place


@njit()
def summed_hit(
    s: SummedSurface,
    side: float,
    x: float,
    y: float,
    z: float,
    dx: float,
    dy: float,
    dz: float,
    limit: float,
) -> tuple[float, int, float, float, float]:
    """First place nearer than `limit` where a ray meets the top.

    Parameters
    ----------
    side : `INSIDE` for a ray in the elastomer, `OUTSIDE` for one in air
    x, y, z : start [mm]; dx, dy, dz : unit direction [-]

    Returns
    -------
    distance [mm], what (`NOTHING`, `FREE`, `CONTACT`), and the unit normal that points away from the ray's side
    """
    t, stop = 0.0, limit
    far = s.lowest if side == INSIDE else s.highest  # beyond this height there is nothing to meet
    if side * (far - z) > 0.0:
        t = (far - z) / dz if side * dz > 0.0 else limit
    elif side * dz < 0.0:
        stop = min(limit, (far - z) / dz)
    before = math.inf
    which = -3
    while t < stop:
        border, next_which = _next_border(s, x, y, dx, dy, t + 2.0 * BORDER_MM, stop)
        clear, _ = _clearance(s, side, x, y, z, dx, dy, dz, t)
        if which > -3 and clear <= 0.0 and before - clear > FACE_MM:
            return _face(s, which, x, y, dx, dy, t)
        end = border - BORDER_MM if border < stop else stop
        place = _first_zero(s, side, x, y, z, dx, dy, dz, t, max(end, t))
        if place < stop:
            return _met(s, side, x + place * dx, y + place * dy, place)
        before, _ = _clearance(s, side, x, y, z, dx, dy, dz, end)
        t, which = border + BORDER_MM, next_which
    return limit, NOTHING, 0.0, 0.0, side


@njit()
def _met(
    s: SummedSurface, side: float, x: float, y: float, distance: float
) -> tuple[float, int, float, float, float]:
    """What lies at a place of the top, and its normal."""
    _, along, across = summed_height(s, x, y)
    size = side / math.sqrt(1.0 + along * along + across * across)
    what = FREE
    for k in range(s.tips.shape[0]):
        if math.hypot(x - s.tips[k, X], y - s.tips[k, Y]) < s.tips[k, CONTACT_RADIUS]:
            what = CONTACT
    return distance, what, -along * size, -across * size, size


@njit()
def _face(
    s: SummedSurface, which: int, x: float, y: float, dx: float, dy: float, t: float
) -> tuple[float, int, float, float, float]:
    """The vertical face at a tip's edge or at the field's border, which a ray passes outward or inward."""
    nx, ny = dx, 0.0
    if which >= 0:
        nx, ny = x + t * dx - s.tips[which, X], y + t * dy - s.tips[which, Y]
    elif which == -2:
        nx, ny = 0.0, dy
    size = math.copysign(math.hypot(nx, ny), nx * dx + ny * dy)
    return t, FREE, nx / size, ny / size, 0.0


@njit()
def is_under_sum(s: SummedSurface, x: float, y: float, z: float) -> bool:
    """Whether a point lies in the elastomer."""
    return bool(z <= summed_height(s, x, y)[0])
