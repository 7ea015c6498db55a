r"""Height of an object's lowest surface over a grid.

Over each node (x, y), the object's lowest point is where the straight line along z enters it:

| object               | method                                                                                      |
|----------------------|---------------------------------------------------------------------------------------------|
| sphere, ellipsoid    | the smaller root of their quadratic equation                                                |
| cylinder, punch, box | points at distance e (the edge's radius) from a smaller core with sharp edges; the distance |
|                      | to a convex core is convex along a line, so Newton's method from below rises to the root    |
| torus                | the smallest root of its quartic equation: the closed roots of the derivative bracket it,   |
|                      | and Newton's method with bisection finds it                                                 |
| mesh                 | the lowest triangle over the node, each cut by the planes of equal x and interpolated       |

A point p of the object is at R p with R = Rz(yaw) Ry(pitch) Rx(roll), after the pose of a box. A line along z is then
o + z d in the object's own coordinates, with o = Rᵀ (x, y, 0) and d = Rᵀ (0, 0, 1), which are at right angles.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from optopad.design.arrays import BoolArray, FloatArray, IntArray
from optopad.design.held_object import (
    PUNCH_LENGTH_MM,
    Box,
    Cylinder,
    Ellipsoid,
    Facets,
    HeldObject,
    Mesh,
    Punch,
    Sphere,
    Torus,
)

CLOSE_MM = 1e-12
"""Newton's method ends below this distance [mm]."""
GRAZING = 1e-3
"""Cosine between line and normal [-] above which a last step below `CLOSE_MM` improves the height."""
MOST_STEPS = 100
"""Newton steps of a line that only grazes an object, where each step halves the distance; others need fewer than 10."""
PAIRS_AT_ONCE = 1_000_000
"""Number of (triangle, node) pairs whose heights are computed together, which bounds the memory."""

Distance = Callable[[FloatArray], tuple[FloatArray, FloatArray]]
"""Distance of points (n, 3) outside a convex core from it [mm], and its gradient (n, 3)."""


def bottom_mm(held: HeldObject, x_mm: FloatArray, y_mm: FloatArray) -> FloatArray:
    """Height of the lowest surface of an object with its centre over x = y = 0.

    Parameters
    ----------
    held : the object; its place and its depth are not used
    x_mm, y_mm : (nx,), (ny,) increasing coordinates of the nodes, relative to the object's centre [mm]

    Returns
    -------
    (nx, ny) height above the lowest point of the whole object, inside the grid or not [mm]; infinite where the object
    is not above the node.
    """
    turn = rotation(held)
    if isinstance(held, Mesh):
        return _mesh_bottom(held.facets, turn, x_mm, y_mm)
    x, y = (axis.ravel() for axis in np.meshgrid(x_mm, y_mm, indexing="ij"))
    return _bottom(held, turn, x, y).reshape(len(x_mm), len(y_mm))


def rotation(held: HeldObject) -> FloatArray:
    """Matrix (3, 3) that turns an object into its pose from the one in the table of `optopad.design.held_object`."""
    return (
        _about("z", math.radians(held.yaw))
        @ _about("y", math.radians(held.pitch))
        @ _about("x", math.radians(held.roll))
        @ (_box_pose(held) if isinstance(held, Box) else np.eye(3))
    )


def _about(axis: str, angle: float) -> FloatArray:
    """Right-handed rotation (3, 3) about an axis by an angle [rad]."""
    first = "xyz".index(axis)
    i, j = (first + 1) % 3, (first + 2) % 3
    turn = np.eye(3)
    turn[i, i] = turn[j, j] = math.cos(angle)
    turn[j, i] = math.sin(angle)
    turn[i, j] = -turn[j, i]
    return turn


def _box_pose(box: Box) -> FloatArray:
    """Rotation (3, 3) that brings a box's face, edge or corner straight below its centre."""
    length, width, height = _core_of_box(box)
    if box.pose == "face":
        return np.eye(3)
    on_edge = _about("x", math.atan2(width, height))
    if box.pose == "edge":
        return on_edge
    return _about("y", math.atan2(length, math.hypot(width, height))) @ on_edge


def _core_of_box(box: Box) -> FloatArray:
    """Half sides (3,) of the sharp box from which a rounded box's surface has the distance `edge_mm` [mm]."""
    return np.array([box.length, box.width, box.height]) / 2 - box.edge_mm


def _bottom(held: HeldObject, turn: FloatArray, x: FloatArray, y: FloatArray) -> FloatArray:
    """Height (n,) of the lowest surface of any object but a mesh."""
    down = turn[2]  # the direction z in the object's own coordinates
    if isinstance(held, Sphere):
        return _ellipsoid_bottom(np.full(3, held.radius), np.eye(3), x, y)
    if isinstance(held, Ellipsoid):
        return _ellipsoid_bottom(np.array([held.a, held.b, held.c]), turn, x, y)
    if isinstance(held, Torus):
        return _torus_bottom(held.radius, held.tube, turn, x, y)
    if isinstance(held, Box):
        core = _core_of_box(held)
        lowest = -float(np.abs(down) @ core) - held.edge_mm
        return _rounded_bottom(_box_distance(core), held.edge_mm, lowest, turn, x, y)
    assert isinstance(held, Cylinder | Punch)
    return _cylinder_bottom(held, turn, x, y)


def _ellipsoid_bottom(half_axes: FloatArray, turn: FloatArray, x: FloatArray, y: FloatArray) -> FloatArray:
    """Height (n,) of an ellipsoid's lowest surface.

    Notes
    -----
    With the shape matrix S = R diag(a²) Rᵀ, the silhouette along z is the ellipse u = sᵀ S2⁻¹ s <= 1 of s = (x, y),
    where S2 is the upper left block of S. The lowest surface is z = k·s - h √(1 - u), with k = S2⁻¹ (Sxz, Syz) and
    h² = Szz - k·(Sxz, Syz), and the lowest point of all is at -√Szz.
    """
    shape = (turn * half_axes**2) @ turn.T
    inverse = np.linalg.inv(shape[:2, :2])
    slope = inverse @ shape[:2, 2]
    half = math.sqrt(shape[2, 2] - slope @ shape[:2, 2])
    u = inverse[0, 0] * x * x + 2.0 * inverse[0, 1] * x * y + inverse[1, 1] * y * y
    height = slope[0] * x + slope[1] * y - half * np.sqrt(np.maximum(1.0 - u, 0.0)) + math.sqrt(shape[2, 2])
    return np.where(u <= 1.0, np.maximum(height, 0.0), np.inf)


def _cylinder_bottom(held: Cylinder | Punch, turn: FloatArray, x: FloatArray, y: FloatArray) -> FloatArray:
    """Height (n,) of the lowest surface of a cylinder along its x axis, or of a punch along its z axis."""
    edge, radius, axis = held.edge_mm, held.radius - held.edge_mm, 0 if isinstance(held, Cylinder) else 2
    if isinstance(held, Cylinder):
        middle, half = 0.0, held.length / 2 - edge
    else:
        middle, half = PUNCH_LENGTH_MM / 2, PUNCH_LENGTH_MM / 2 - edge
    down = float(turn[2, axis])
    lowest = middle * down - abs(down) * half - radius * math.sqrt(max(1.0 - down * down, 0.0)) - edge
    return _rounded_bottom(_cylinder_distance(axis, middle, half, radius), edge, lowest, turn, x, y)


def _box_distance(core: FloatArray) -> Distance:
    def distance(points: FloatArray) -> tuple[FloatArray, FloatArray]:
        beyond = points - np.clip(points, -core, core)
        length = np.sqrt(np.einsum("ij,ij->i", beyond, beyond))
        return length, beyond / length[:, None]

    return distance


def _cylinder_distance(axis: int, middle: float, half: float, radius: float) -> Distance:
    def distance(points: FloatArray) -> tuple[FloatArray, FloatArray]:
        beyond = points.copy()
        beyond[:, axis] -= middle
        beyond[:, axis] -= np.clip(beyond[:, axis], -half, half)
        i, j = (axis + 1) % 3, (axis + 2) % 3
        across = np.hypot(points[:, i], points[:, j])
        share = np.maximum(across - radius, 0.0) / np.maximum(across, radius if radius > 0.0 else CLOSE_MM)
        beyond[:, i] *= share
        beyond[:, j] *= share
        length = np.sqrt(np.einsum("ij,ij->i", beyond, beyond))
        return length, beyond / length[:, None]

    return distance


def _rounded_bottom(
    distance: Distance, edge: float, lowest: float, turn: FloatArray, x: FloatArray, y: FloatArray
) -> FloatArray:
    """Height (n,) above `lowest` at which lines along z come within `edge` of a convex core."""
    height = np.zeros(len(x))
    origin = np.column_stack([x, y, np.full(len(x), lowest)]) @ turn
    left: IntArray = np.arange(len(x))
    for _ in range(MOST_STEPS):
        length, gradient = distance(origin[left] + height[left, None] * turn[2])
        gap, slope = length - edge, gradient @ turn[2]
        is_far = gap > CLOSE_MM
        height[left[is_far & (slope >= 0.0)]] = np.inf
        rises = slope < np.where(is_far, 0.0, -GRAZING)
        height[left[rises]] -= gap[rises] / slope[rises]
        left = left[is_far & rises]
        if len(left) == 0:
            break
    return np.maximum(height, 0.0)


def _torus_bottom(radius: float, tube: float, turn: FloatArray, x: FloatArray, y: FloatArray) -> FloatArray:
    """Height (n,) of a torus's lowest surface.

    Notes
    -----
    Along a line at the distance √s from the centre, (z² + s + R² - r²)² = 4 R² (z² + s - (w + z d)²) with w and d the
    components of o and d along the ring's axis: F(z) = z⁴ + a z² + b z + c = 0. F falls up to its first minimum, and
    between its maximum and its second minimum, so the first of these parts that reaches 0 has the smallest root.
    """
    d = float(turn[2, 2])
    w = turn[0, 2] * x + turn[1, 2] * y
    s = x * x + y * y
    lowest = -radius * math.sqrt(max(1.0 - d * d, 0.0)) - tube
    k = s + radius**2 - tube**2
    a = 2.0 * k - 4.0 * radius**2 * (1.0 - d * d)
    b = 8.0 * radius**2 * w * d
    c = k * k - 4.0 * radius**2 * (s - w * w)

    def value(z: FloatArray, on: BoolArray) -> FloatArray:
        heights: FloatArray = ((z * z + a[on]) * z + b[on]) * z + c[on]
        return heights

    first, middle, last = _stationary(a / 2.0, b / 4.0)
    every = np.ones(len(x), bool)
    falls_first = value(first, every) <= 0.0
    falls_last = ~falls_first & (value(last, every) <= 0.0)
    height = np.full(len(x), np.inf)
    for on, low, high in (
        (falls_first, np.full(int(falls_first.sum()), lowest - CLOSE_MM), first[falls_first]),
        (falls_last, middle[falls_last], last[falls_last]),
    ):
        z = 0.5 * (low + high)
        for _ in range(MOST_STEPS):
            at = value(z, on)
            low, high = np.where(at > 0.0, z, low), np.where(at > 0.0, high, z)
            with np.errstate(divide="ignore", invalid="ignore"):
                newton = z - at / ((4.0 * z * z + 2.0 * a[on]) * z + b[on])
            is_inside = (newton > low) & (newton < high)
            step = np.where(is_inside, newton, 0.5 * (low + high)) - z
            z = z + step
            if len(step) == 0 or np.abs(step).max() < CLOSE_MM:
                break
        height[on] = np.maximum(z - lowest, 0.0)
    return height


def _stationary(p: FloatArray, q: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Roots of z³ + p z + q, from lowest to highest; three times the same one if there is one only."""
    discriminant = (q / 2.0) ** 2 + (p / 3.0) ** 3
    root = np.sqrt(np.maximum(discriminant, 0.0))
    larger = np.cbrt(-np.copysign(np.abs(q) / 2.0 + root, q))
    with np.errstate(divide="ignore", invalid="ignore"):
        only = larger - np.where(larger == 0.0, 0.0, p / (3.0 * larger))
        size = 2.0 * np.sqrt(np.maximum(-p / 3.0, 0.0))
        angle = np.arccos(np.clip(3.0 * q / (p * size), -1.0, 1.0)) / 3.0
    third = 2.0 * math.pi / 3.0
    is_three = discriminant < 0.0
    first, middle, last = (
        np.where(is_three, size * np.cos(angle - shift), only) for shift in (2.0 * third, third, 0.0)
    )
    return first, middle, last


def _mesh_bottom(facets: Facets, turn: FloatArray, x_mm: FloatArray, y_mm: FloatArray) -> FloatArray:
    """Height (nx, ny) of the lowest triangle over each node."""
    corners = facets.vertices_mm @ turn.T
    corners[:, 2] -= corners[:, 2].min()
    heights = np.full((len(x_mm), len(y_mm)), np.inf)
    triangles = corners[facets.triangles]
    first, last = _between(x_mm, triangles[:, :, 0].min(axis=1), triangles[:, :, 0].max(axis=1))
    low, high = _between(y_mm, triangles[:, :, 1].min(axis=1), triangles[:, :, 1].max(axis=1))
    is_over = (last > first) & (high > low)
    triangles, first, last = triangles[is_over], first[is_over], last[is_over]
    triangles = np.take_along_axis(
        triangles, np.argsort(triangles[:, :, 0], axis=1, kind="stable")[..., None], axis=1
    )
    part_of = np.cumsum((last - first) * (high - low)[is_over]) // PAIRS_AT_ONCE
    for part in np.split(np.arange(len(triangles)), np.flatnonzero(np.diff(part_of)) + 1):
        _lower(heights, triangles[part], first[part], last[part], x_mm, y_mm)
    return heights


def _lower(
    heights: FloatArray,
    triangles: FloatArray,
    first: IntArray,
    last: IntArray,
    x_mm: FloatArray,
    y_mm: FloatArray,
) -> None:
    """Lower heights (nx, ny) to triangles (m, 3, 3), each with its corners in the order of x, in place.

    A plane of equal x cuts a triangle from its longest side along x to one of the other two.
    """
    owner, column = _spread(first, last)
    a, b, c = (triangles[owner, corner] for corner in range(3))
    x = x_mm[column]
    is_left = (x <= b[:, 0])[:, None]
    start = _on_side(x, a, c)
    end = _on_side(x, np.where(is_left, a, b), np.where(is_left, b, c))
    bottom, top = _between(y_mm, np.minimum(start[:, 0], end[:, 0]), np.maximum(start[:, 0], end[:, 0]))
    owner, row = _spread(bottom, top)
    (y0, z0), (y1, z1) = start[owner].T, end[owner].T
    z = z0 + _share(y_mm[row] - y0, y1 - y0) * (z1 - z0)
    np.minimum.at(heights, (column[owner], row), z)


def _on_side(x: FloatArray, start: FloatArray, end: FloatArray) -> FloatArray:
    """y and z (n, 2) at which sides of triangles, given by two points (n, 3), have the given x (n,)."""
    share = _share(x - start[:, 0], end[:, 0] - start[:, 0])[:, None]
    return start[:, 1:] + share * (end[:, 1:] - start[:, 1:])


def _share(part: FloatArray, whole: FloatArray) -> FloatArray:
    """Quotient (n,); 1 where the whole is 0."""
    return np.divide(part, whole, out=np.ones_like(part), where=whole != 0.0)


def _between(nodes: FloatArray, low: FloatArray, high: FloatArray) -> tuple[IntArray, IntArray]:
    """First node of each interval (n,), whose ends belong to it, and the node after its last."""
    return np.searchsorted(nodes, low, "left"), np.searchsorted(nodes, high, "right")


def _spread(first: IntArray, last: IntArray) -> tuple[IntArray, IntArray]:
    """All indices from `first` to before `last` of n intervals, one after another: interval and index of each."""
    count = last - first
    owner = np.repeat(np.arange(len(count)), count)
    return owner, np.arange(len(owner)) + np.repeat(first - (np.cumsum(count) - count), count)
