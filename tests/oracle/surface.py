"""The top of the pad for the ray tracer, and the points where rays meet the top from inside and outside.

Model
-----
The top is given in *press coordinates*. Their third axis is the normal of the untouched top at the location of the
press. Along this axis the top is a sum of heights: with the curvatures kx and ky of the untouched top [1/mm], and q =
kx² x² + ky² y²,

    h(x, y) = -(kx x² + ky y²) / (1 + √(1 - q)) + Σ d_k(r_k) + f(x, y),    |curvature| <= max(kx, ky) / (1 - q)^1.5,

with one profile d_k over the radius r_k around each tip's axis, and a bicubic Hermite field f. If kx = ky = 0, the
untouched top is flat. Where q is above `STEEPEST_SHARE`² the crown continues straight. No point of a pad is there
(`REACH_SHARE`). Nor does light in air meet this part, as a ball and a cone that touches it are convex together.

In contact with a sphere, d_k is the tip's height less that of the *mean crown*, a sphere of the curvature (kx + ky) /
2. So on a spherical crown the top in contact equals the tip; on a cylindrical crown it does so once the press's f is
added. The rest of a profile is a cubic in each interval of radius. d_k is 0 beyond the profile's last point, and f is 0
beyond its grid. Where either ends with a step, a vertical face closes the step. Inside a tip's contact radius the top
is contact.

A flat top without a field and with at most one tip needs no sum (`is_sum`). It consists of the plane, an exact sphere,
and cone frusta that follow the profile, which may run back under itself. For each of these, the distance where a ray
meets it solves a quadratic equation.

Where a ray meets a sum
-----------------------
The *clearance* c(t) along a ray is its height below the top or, in air, above the top. The ray is followed to the first
zero of c. The edges of contacts, profiles and field cut it into parts on which c is once differentiable and |c''| has a
bound K from tables over radius: |c''| <= w² (max(|d''|, |d'| / r) + the field's bound), where w is the length in plan
of a unit step. A crown adds the bound of its curvature at the part's largest q, for the component across a straight
direction. As the crown is convex, it adds only to the bound downward for a ray inside, and only to the bound upward for
a ray outside: c'' is in -K_down to K_up.

A step s is safe if the clearances at its ends are above K_up s² / 8, or if c cannot fall within it. A step contains the
first zero if its end is below zero and either c must fall within it or K_up is 0. Then Newton's steps within a bracket
find the zero. Any other step is halved, down to `FINEST_MM`. So a ray is missed only where it grazes the top less than
K `FINEST_MM`² / 8 deep.

Light in air also meets the tips. Nothing but the press is known of the tips, so they are taken as solid and endless. A
hemispherical tip is a half sphere with a cylinder of the same radius above. Any other tip is a cylinder of the contact
radius that starts at the end of the contact; it hides no more than the tip does. A press without contact has no tip.
Where other heights raise the top into a tip, light there counts as absorbed by the tip. A top that is given as a whole
(`level`) has no tips in air: light there passes through them, and all of it counts as `crossing`.

Left out
--------
A sum leaves out profiles with more than one height at a radius, and the tip's shape where other heights lift or lower
the top under it: there the top itself counts as contact. The wall does not hold the surface: a profile passes through
the wall unchanged and is cut off there.

This file shares no code with the fast light model on purpose: the two are compared with each other.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from numba import njit

from optopad.design.arrays import FloatArray, IntArray

NOTHING, FREE, CONTACT = 0, 1, 2
INSIDE, OUTSIDE = 1.0, -1.0
"""Side of the top from which a ray comes: in the elastomer, or in air."""
SEAM_MM = 1e-6
"""Overlap of neighbouring pieces of a surface, so that no ray slips through a seam [mm]. Points closer together than
this count as one."""
REACH_SHARE = 0.97
"""Largest distance of a pad's points from the press axis, relative to the crown's radius [-]."""
STEEPEST_SHARE = 0.985
"""Share of its radius beyond which a crown continues straight, so that every point in plan has a height [-]."""
BLOCK = 16
"""Number of cones that share one bounding box."""
BINS = 512
"""Number of rings of equal width from a tip's axis to its edge; each has a bound on curvature."""
X, Y, EDGE, CONTACT_RADIUS, SPHERE, DROP, FIRST, LAST = range(8)

FINEST_MM = 2e-5
"""Shortest step along a ray [mm]."""
BORDER_MM = 1e-9
"""Distance that the ends of a part of a ray keep from the circles and lines that bound it [mm]."""
MARGIN_MM = 1e-6
"""Extension of a field beyond its border, so that rounding at a wall where the field ends makes no step [mm]."""
FACE_MM = 1e-7
"""Smallest jump of the top across a border that counts as a vertical face, not as rounding [mm]."""

Vector = tuple[float, float, float]
Ray = tuple[float, float, float, float, float, float]
"""A ray: start x, y, z [mm], and unit direction [-]."""
Line = tuple[float, float, float, float, float]
"""A ray relative to an axis, as a, b, c, z, dz: squared radius a t² + 2 b t + c [mm²], height z + dz t [mm]."""
Meeting = tuple[float, int, float, float, float]
"""Where a ray meets a surface: distance [mm], type of surface (`NOTHING`, `FREE`, `CONTACT`), and the unit normal that
points away from the ray's side."""


class Surface(NamedTuple):
    """The top in one state as numbers. All but origin and axes are in press coordinates.

    Attributes
    ----------
    origin : (3,) origin of press coordinates, on the untouched top [mm]
    axes : (9,) axes of press coordinates, one after another [-]
    kx, ky : curvatures of the untouched top, 0 <= kx <= ky [1/mm]
    lowest, highest : bounds of the surface [mm]
    is_sum : whether heights are added; if False, the top is flat with one tip or none, given by the plane and cones
    tips : (k, 8) centre x, y; edge, where the profile ends; contact radius (with cones, that of the spherical part);
        sphere radius (0 if none); depth of the tip's apex [mm]; first and last index in `curve`
    solids : (k, 6) the tips as light in air meets them: x, y of the axis; height of the sphere's centre, and its radius
        (0 if none); radius of the cylinder, and the height where it starts [mm]
    cones : (p, 8) r, z of the start [mm]; r, z of the unit direction; length [mm]; angle of the profile's tangent to
        the radial direction at start and end [rad]; 1 if in contact with the tip
    blocks : (b, 4) smallest and largest r, smallest and largest z of each run of `BLOCK` cones [mm]
    curve : (m, 5) radius at the start of a piece [mm], and the height's coefficients of powers 0 to 3 of the radius
        beyond the start
    starts : (k, BINS) index of the first piece in `curve` that may contain a radius of the ring
    bends : (k, BINS) largest |d''| and |d'| / r within the ring [1/mm]
    nodes : (nx, ny, 4) the field's value [mm], slopes [-] and mixed derivative [1/mm]; (0, 0, 4) without a field
    corner, step : (2,) first node of the field's grid, and distance between its nodes [mm]
    field_bend : bound of the field's second derivative in any direction [1/mm]
    level : (nx, ny) values at the field's nodes, linear between them; the top is contact where they are above 0. (0, 0)
        if the tips alone are contact
    """

    origin: Vector
    axes: tuple[float, ...]
    kx: float
    ky: float
    lowest: float
    highest: float
    is_sum: bool
    tips: FloatArray
    solids: FloatArray
    cones: FloatArray
    blocks: FloatArray
    curve: FloatArray
    starts: IntArray
    bends: FloatArray
    nodes: FloatArray
    corner: tuple[float, float]
    step: tuple[float, float]
    field_bend: float
    level: FloatArray


@njit(forceinline=True)
def top_hit(s: Surface, side: float, ray: Ray, limit: float) -> Meeting:
    """First point nearer than `limit` [mm] where a ray meets the top; tips are not tested here.

    ray : the ray in cavity coordinates
    side : `INSIDE` for a ray in the elastomer, `OUTSIDE` for one in air
    """
    local = in_frame(s, ray)
    if s.is_sum:
        distance, what, nx, ny, nz = _sum_hit(s, side, local, limit)
    else:
        distance, what, nx, ny, nz = _cone_hit(s, side, local, limit)
    nx, ny, nz = _turned_back(s.axes, nx, ny, nz)
    return distance, what, nx, ny, nz


@njit()
def is_in_elastomer(s: Surface, x: float, y: float, z: float) -> bool:
    """Whether a point is below the top; if the top consists of cones, an odd number of them is then above the point."""
    u, v, w, _, _, _ = in_frame(s, (x, y, z, 0.0, 0.0, 0.0))
    if s.is_sum:
        return bool(w <= top_height(s, u, v)[0])
    r = math.hypot(u, v)
    if s.tips.shape[0] == 0 or r >= s.tips[0, EDGE]:
        return bool(w <= 0.0)
    above = 0
    if r < s.tips[0, CONTACT_RADIUS] and _tip_z(s) - math.sqrt(s.tips[0, SPHERE] ** 2 - r * r) > w:
        above += 1
    for i in range(s.cones.shape[0]):
        r0, z0, kr, kz, length = s.cones[i, :5]
        if (r0 <= r) != (r0 + kr * length <= r) and z0 + (r - r0) * kz / kr > w:
            above += 1
    return above % 2 == 1


@njit()
def is_untouched(s: Surface) -> bool:
    """Whether the top is untouched. Pads are convex, so light that leaves through it then meets no surface again."""
    return len(s.tips) == 0 and len(s.nodes) == 0


@njit()
def is_steep(s: Surface, slope: float, place_and_normal: Ray) -> bool:
    """Whether press and field tilt the top by more than a slope [-], at a given point with a given outward normal."""
    x, y, _, nx, ny, nz = in_frame(s, place_and_normal)
    _, along, across = sag(s.kx, s.ky, x, y)
    return bool(nz <= 0.0 or math.hypot(along - nx / nz, across - ny / nz) > slope)


@njit()
def tip_hit(s: Surface, ray: Ray, limit: float) -> tuple[float, bool, float, float, float]:
    """First point nearer than `limit` [mm] where a ray in air meets a tip.

    Returns
    -------
    distance [mm], whether there is such a point, and the unit normal that points out of the tip. A normal of length
    zero means that the ray starts inside the tip
    """
    best, hit, nx, ny, nz = limit, False, 0.0, 0.0, 0.0
    x, y, z, dx, dy, dz = in_frame(s, ray)
    for k in range(s.solids.shape[0]):
        cx, cy, cz, sphere, radius, foot = s.solids[k]
        px, py, pz = x - cx, y - cy, z - cz
        across = px * px + py * py
        if (z >= foot and across < radius * radius) or (z < foot and across + pz * pz < sphere * sphere):
            return 0.0, True, 0.0, 0.0, 0.0
        a, b = dx * dx + dy * dy, px * dx + py * dy
        gap = b * b - a * (across - radius * radius)
        if b < 0.0 and gap > 0.0:
            t = (-b - math.sqrt(gap)) / a
            if 0.0 <= t < best and z + t * dz >= foot:
                best, hit = t, True
                nx, ny, nz = (px + t * dx) / radius, (py + t * dy) / radius, 0.0
        b += pz * dz
        gap = b * b - (across + pz * pz - sphere * sphere)
        if sphere > 0.0 and b < 0.0 and gap > 0.0:
            t = -b - math.sqrt(gap)
            if 0.0 <= t < best and z + t * dz < foot:
                best, hit = t, True
                nx, ny, nz = (px + t * dx) / sphere, (py + t * dy) / sphere, (pz + t * dz) / sphere
    nx, ny, nz = _turned_back(s.axes, nx, ny, nz)
    return best, hit, nx, ny, nz


@njit()
def in_frame(s: Surface, ray: Ray) -> Ray:
    """Convert a ray from cavity coordinates to press coordinates."""
    x, y, z, dx, dy, dz = ray
    place = _turned(s.axes, x - s.origin[0], y - s.origin[1], z - s.origin[2])
    return place + _turned(s.axes, dx, dy, dz)


@njit()
def _turned(a: tuple[float, ...], vx: float, vy: float, vz: float) -> Vector:
    """Convert a vector from cavity coordinates to press coordinates."""
    return (
        a[0] * vx + a[1] * vy + a[2] * vz,
        a[3] * vx + a[4] * vy + a[5] * vz,
        a[6] * vx + a[7] * vy + a[8] * vz,
    )


@njit()
def _turned_back(a: tuple[float, ...], vx: float, vy: float, vz: float) -> Vector:
    """Convert a vector from press coordinates to cavity coordinates."""
    return (
        a[0] * vx + a[3] * vy + a[6] * vz,
        a[1] * vx + a[4] * vy + a[7] * vz,
        a[2] * vx + a[5] * vy + a[8] * vz,
    )


@njit()
def sag(kx: float, ky: float, x: float, y: float) -> tuple[float, float, float]:
    """Distance of an untouched top below its highest point [mm], and the distance's slopes [-], at (x, y) in plan."""
    u, v = kx * x, ky * y
    square = u * u + v * v
    if square <= STEEPEST_SHARE * STEEPEST_SHARE:
        root = math.sqrt(1.0 - square)
        steepness = 1.0 / root
        return (u * x + v * y) / (1.0 + root), steepness * u, steepness * v
    root = math.sqrt(1.0 - STEEPEST_SHARE * STEEPEST_SHARE)
    slope, share = STEEPEST_SHARE / root, math.sqrt(square)
    fall = STEEPEST_SHARE * STEEPEST_SHARE / (1.0 + root) + slope * (share - STEEPEST_SHARE)
    return fall / max(kx, ky), slope * u / share, slope * v / share


@njit()
def top_height(s: Surface, x: float, y: float) -> tuple[float, float, float]:
    """Height of the top as a sum [mm], and its slopes along x and y [-], at a point in press coordinates."""
    height, along, across = 0.0, 0.0, 0.0
    if s.ky > 0.0:
        fall, along, across = sag(s.kx, s.ky, x, y)
        height, along, across = -fall, -along, -across
    for k in range(s.tips.shape[0]):
        px, py = x - s.tips[k, X], y - s.tips[k, Y]
        r, edge, contact = math.hypot(px, py), s.tips[k, EDGE], s.tips[k, CONTACT_RADIUS]
        if r >= edge:
            continue
        sphere = s.tips[k, SPHERE]
        if sphere > 0.0 and r < contact:
            depth = math.sqrt(max(sphere * sphere - r * r, 1e-18))
            mean = 0.5 * (s.kx + s.ky)
            fall, steepness, _ = sag(mean, mean, r, 0.0)
            height += sphere - s.tips[k, DROP] - depth + fall
            slope = r / depth + steepness
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
def _field_height(s: Surface, x: float, y: float) -> tuple[float, float, float]:
    """Height of the field [mm], and its slopes along x and y [-], at a point."""
    u, v = (x - s.corner[0]) / s.step[0], (y - s.corner[1]) / s.step[1]
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
    """Weights of the value and slope at one end, in a cubic's value, then in its slope; t in [0, 1] from its start."""
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
def _sum_hit(s: Surface, side: float, ray: Ray, limit: float) -> Meeting:
    """`top_hit` for a ray in press coordinates and a top that is a sum of heights."""
    x, y, z, dx, dy, dz = ray
    t, stop = 0.0, limit
    far = s.lowest if side == INSIDE else s.highest  # beyond this height there is no surface
    if side * (far - z) > 0.0:
        t = (far - z) / dz if side * dz > 0.0 else limit
    elif side * dz < 0.0:
        stop = min(limit, (far - z) / dz)
    before = math.inf
    which = -3
    while t < stop:
        border, next_which = _next_border(s, ray, t + 2.0 * BORDER_MM, stop)
        clear, _ = _clearance(s, side, ray, t)
        if which > -3 and clear <= 0.0 and before - clear > FACE_MM:
            return _face(s, which, ray, t)
        end = border - BORDER_MM if border < stop else stop
        place = _first_zero(s, side, ray, t, max(end, t))
        if place < stop:
            return _met(s, side, x + place * dx, y + place * dy, place)
        before, _ = _clearance(s, side, ray, end)
        t, which = border + BORDER_MM, next_which
    return limit, NOTHING, 0.0, 0.0, side


@njit()
def _clearance(s: Surface, side: float, ray: Ray, t: float) -> tuple[float, float]:
    """Clearance at distance t along a ray [mm], positive on the ray's side of the top, and its growth along the ray."""
    x, y, z, dx, dy, dz = ray
    height, along, across = top_height(s, x + t * dx, y + t * dy)
    return side * (height - z - t * dz), side * (along * dx + across * dy - dz)


@njit()
def _bends(s: Surface, side: float, ray: Ray, t0: float, t1: float) -> tuple[float, float]:
    """Bounds K_up, K_down on the second derivative of a ray's clearance from the top between t0 and t1 [1/mm]."""
    x, y, _, dx, dy, _ = ray
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
    crown = 0.0
    if s.ky > 0.0:
        for t in (t0, t1):
            u, v = s.kx * (x + t * dx), s.ky * (y + t * dy)
            crown = max(crown, u * u + v * v)
        inner = 1.0 - min(crown, STEEPEST_SHARE * STEEPEST_SHARE)
        crown = (s.kx * dx * dx + s.ky * dy * dy) / (inner * math.sqrt(inner))
    return (bound, bound + crown) if side == INSIDE else (bound + crown, bound)


@njit()
def _next_border(s: Surface, ray: Ray, t: float, limit: float) -> tuple[float, int]:
    """Distance at which a ray next crosses a border in plan; tip number, or -1, -2 for the field's border in x, y."""
    x, y, _, dx, dy, _ = ray
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
                place = (s.corner[0] + end * (s.nodes.shape[0] - 1) * s.step[0] + margin - x) / dx
                if t < place < best:
                    best, which = place, -1
            if dy != 0.0:
                place = (s.corner[1] + end * (s.nodes.shape[1] - 1) * s.step[1] + margin - y) / dy
                if t < place < best:
                    best, which = place, -2
    return best, which


@njit()
def _first_zero(s: Surface, side: float, ray: Ray, t0: float, t1: float) -> float:
    """First distance from t0 to t1 at which a ray meets the top [mm]; infinite if it does not."""
    t, step = t0, t1 - t0
    near, growth = _clearance(s, side, ray, t)
    if near <= 0.0 and growth < 0.0:
        return t
    while t < t1:
        step = min(step, t1 - t)
        end = t + step if step < t1 - t else t1
        far, far_growth = _clearance(s, side, ray, end)
        up, down = _bends(s, side, ray, t, end)
        rises = growth - down * step >= 0.0 and far > 0.0
        falls = (growth + up * step < 0.0 or up == 0.0) and near > 0.0 >= far
        if not (rises or falls or min(near, far) > up * step * step / 8.0):
            if step > FINEST_MM:
                step *= 0.5
                continue
            falls = far <= 0.0
        if falls:
            return _zero(s, side, ray, t, end)
        t, near, growth, step = end, far, far_growth, 2.0 * step
    return math.inf


@njit()
def _zero(s: Surface, side: float, ray: Ray, low: float, high: float) -> float:
    """Distance at which a ray meets the top [mm], between `low`, before the top, and `high`, past the top.

    Newton's steps start from `high`; a step that leaves the bracket is replaced by halving.
    """
    place = high
    for _ in range(60):
        clear, growth = _clearance(s, side, ray, place)
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
def _met(s: Surface, side: float, x: float, y: float, distance: float) -> Meeting:
    """What a ray meets at a point of the top: `distance`, contact or free surface, and the normal there."""
    _, along, across = top_height(s, x, y)
    size = side / math.sqrt(1.0 + along * along + across * across)
    what = FREE
    for k in range(s.tips.shape[0]):
        if math.hypot(x - s.tips[k, X], y - s.tips[k, Y]) < s.tips[k, CONTACT_RADIUS]:
            what = CONTACT
    if s.level.shape[0] > 0 and _level(s, x, y) > 0.0:
        what = CONTACT
    return distance, what, -along * size, -across * size, size


@njit()
def _level(s: Surface, x: float, y: float) -> float:
    """Level of contact at a point, linear between the field's nodes."""
    u = min(max((x - s.corner[0]) / s.step[0], 0.0), s.level.shape[0] - 1.0)
    v = min(max((y - s.corner[1]) / s.step[1], 0.0), s.level.shape[1] - 1.0)
    i, j = min(int(u), s.level.shape[0] - 2), min(int(v), s.level.shape[1] - 2)
    u, v = u - i, v - j
    low = (1.0 - v) * s.level[i, j] + v * s.level[i, j + 1]
    high = (1.0 - v) * s.level[i + 1, j] + v * s.level[i + 1, j + 1]
    return float((1.0 - u) * low + u * high)


@njit()
def _face(s: Surface, which: int, ray: Ray, t: float) -> Meeting:
    """What a ray meets at the vertical face at a tip's edge or at the field's border."""
    x, y, _, dx, dy, _ = ray
    nx, ny = dx, 0.0
    if which >= 0:
        nx, ny = x + t * dx - s.tips[which, X], y + t * dy - s.tips[which, Y]
    elif which == -2:
        nx, ny = 0.0, dy
    size = math.copysign(math.hypot(nx, ny), nx * dx + ny * dy)
    return t, FREE, nx / size, ny / size, 0.0


@njit()
def _tip_z(s: Surface) -> float:
    """Height of the centre of the only tip's sphere [mm]."""
    return float(s.tips[0, SPHERE] - s.tips[0, DROP])


@njit(forceinline=True)
def _cone_hit(s: Surface, side: float, ray: Ray, limit: float) -> Meeting:
    """`top_hit` for a ray in press coordinates, if the top is the plane z = 0 and one tip's cones.

    From outside, the tip's sphere is not tested.
    """
    x, y, z, dx, dy, dz = ray
    far = s.lowest if side == INSIDE else s.highest
    if side * dz <= 0.0 and side * (far - z) > SEAM_MM:
        return limit, NOTHING, 0.0, 0.0, side
    edge = s.tips[0, EDGE] if s.tips.shape[0] > 0 else 0.0
    a, b, c = dx * dx + dy * dy, x * dx + y * dy, x * x + y * y
    best, what, nr, nz = limit, NOTHING, 0.0, side
    if side * dz > 0.0:
        t = -z / dz
        if -1e-9 < t < best and a * t * t + 2.0 * b * t + c >= max(edge - SEAM_MM, 0.0) ** 2:
            best, what = max(t, 0.0), FREE
    if edge > 0.0:
        if side == INSIDE and s.tips[0, CONTACT_RADIUS] > 0.0:
            t = _cap_distance(s, ray)
            if t < best:
                best, what = t, CONTACT
                nr = -math.sqrt(max(a * t * t + 2.0 * b * t + c, 0.0)) / s.tips[0, SPHERE]
                nz = (_tip_z(s) - z - t * dz) / s.tips[0, SPHERE]
        t, cone = _cone_distance(s.cones, s.blocks, side, edge, (a, b, c, z, dz), best)
        if cone >= 0:
            best, what = t, (CONTACT if s.cones[cone, 7] > 0.0 else FREE)
            r = math.sqrt(max(a * t * t + 2.0 * b * t + c, 0.0))
            nr, nz = _cone_normal(s.cones[cone], side, r, z + t * dz)
    hx, hy = x + best * dx, y + best * dy
    r = max(math.hypot(hx, hy), 1e-12)
    return best, what, nr * hx / r, nr * hy / r, nz


@njit()
def _cone_normal(cone: FloatArray, side: float, r: float, z: float) -> tuple[float, float]:
    """Radial and vertical components of the unit normal at a point of a cone."""
    r0, z0, kr, kz, length, angle0, angle1, _ = cone
    share = min(max(((r - r0) * kr + (z - z0) * kz) / length, 0.0), 1.0)
    angle = angle0 + share * (angle1 - angle0)
    return -side * math.sin(angle), side * math.cos(angle)


@njit()
def _cap_distance(s: Surface, ray: Ray) -> float:
    """Distance at which a ray meets the part of the tip sphere in contact [mm]; infinite if it does not."""
    x, y, z, dx, dy, dz = ray
    oz = z - _tip_z(s)
    b = x * dx + y * dy + oz * dz
    gap = b * b - (x * x + y * y + oz * oz - s.tips[0, SPHERE] ** 2)
    if b >= 0.0 or gap <= 0.0:
        return math.inf
    t = -b - math.sqrt(gap)
    r2 = (x + t * dx) ** 2 + (y + t * dy) ** 2
    if t < 0.0 or oz + t * dz > SEAM_MM or r2 > (s.tips[0, CONTACT_RADIUS] + SEAM_MM) ** 2:
        return math.inf
    return t


@njit()
def _cone_distance(
    cones: FloatArray, blocks: FloatArray, side: float, edge: float, line: Line, limit: float
) -> tuple[float, int]:
    """Distance at which a ray first passes through one of the cones [mm], and the cone's number."""
    a, b, c, z, dz = line
    best, cone = limit, -1
    start, stop = 0.0, limit
    reach = (edge + SEAM_MM) ** 2
    if a > 1e-14:
        gap = b * b - a * (c - reach)
        if gap <= 0.0:
            return best, cone
        start = max(start, (-b - math.sqrt(gap)) / a)
        stop = min(stop, (-b + math.sqrt(gap)) / a)
    elif c > reach:
        return best, cone
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
        for i in range(k * BLOCK, min((k + 1) * BLOCK, cones.shape[0])):
            if side == INSIDE or cones[i, 7] == 0.0:  # in air the tip's own side belongs to the tip
                t = _one_cone_distance(cones[i], side, line, best)
                if t < best:
                    best, cone = t, i
    return best, cone


@njit()
def _one_cone_distance(cone: FloatArray, side: float, line: Line, limit: float) -> float:
    """Distance at which a ray passes through one cone frustum from its side [mm]; infinite if not before `limit`.

    There the offset from the cone, f(t) = (z - z0) kr - (r - r0) kz with start (r0, z0) and direction (kr, kz), is
    zero. It grows where the ray leaves the elastomer, and falls where the ray enters it. Squaring r = sqrt(a t² + 2 b t
    + c) gives a quadratic. Newton steps on f then remove its rounding, and reveal a root on the mirrored cone.
    """
    a, b, c, z, dz = line
    r0, z0, kr, kz, length = cone[:5]
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
            if side * growth <= 0.0 or abs(offset) < 1e-12:
                break
            t -= offset / growth
        if side * growth <= 0.0 or abs(offset) > 1e-9 or t < 0.0 or t >= limit or t >= best:
            continue
        r = math.sqrt(max((a * t + 2.0 * b) * t + c, 0.0))
        share = (r - r0) * kr + (z + t * dz - z0) * kz
        if -SEAM_MM <= share <= length + SEAM_MM:
            best = t
    return best
