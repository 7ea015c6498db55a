"""How far solid shapes reach below the top of a pad: the depth image of a robot's simulation.

The pad's untouched top has nodes with normals. The line along the normal through each node enters the shape at a signed
distance t from the node, for lines that come from inside the pad; the *overlap* is -t. So it is above 0 where the
shape is below the untouched top, its negative is the gap elsewhere, and -∞ where the line misses the shape.

Shapes and their sizes are those of MuJoCo's geoms. They have sharp edges.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from optopad.design.errors import InputError

Reals = NDArray[np.floating[Any]]
"""Real numbers in single or double precision; results have that of the points."""

KINDS = ("sphere", "ellipsoid", "cylinder", "capsule", "box", "hull")
PLANES_AT_ONCE = 64
FLAT_MM = 1e-4
"""Thickness below which a hull encloses nothing [mm]: the rounding of a mesh in single precision."""
PARALLEL = 1e-9
"""Component of a direction below which a line counts as parallel to a side or an axis [-]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Shape:
    """A convex solid with its centre at the origin of its own axes.

    Attributes
    ----------
    kind : one of `KINDS`
    size_mm : (3,) half sizes, unused ones 0: the radius of a sphere; radius and half length of a cylinder or capsule
        along its z axis; half sides of a box; half axes of an ellipsoid [mm]
    planes : (f, 4) of a hull: unit normals n and distances d, inside is n·p <= d [-, mm]; None for other kinds
    """

    kind: str
    size_mm: Reals
    planes: Reals | None = None

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise InputError(f"shape: {self.kind!r} is refused; give one of {', '.join(KINDS)}")

    def entry_mm(self, start_mm: Reals, way: Reals) -> Reals:
        """Distance (...,) along lines from points (3, ...) in unit directions (3, ...), until they enter; inf if never.

        It is negative if the shape begins behind the point. Points and directions are in the shape's own axes.
        """
        with np.errstate(invalid="ignore", divide="ignore"):
            first, last = _SPANS[self.kind](self, start_mm, way)
            return np.where(first <= last, first, np.inf)


def hull_of(points_mm: Reals) -> Shape:
    """The convex hull of points (n, 3), as a shape about their origin.

    Raises
    ------
    InputError : the points are fewer than four, or lie in a plane.
    """
    if len(points_mm) < 4 or np.linalg.matrix_rank(points_mm - points_mm[0], tol=FLAT_MM) < 3:
        raise InputError(f"hull: {len(points_mm)} points in a plane enclose nothing; give a solid's corners")
    equations = np.unique(np.round(ConvexHull(points_mm).equations, 6), axis=0)
    planes = np.column_stack([equations[:, :3], -equations[:, 3]])
    return Shape(kind="hull", size_mm=np.zeros(3), planes=planes)


def overlap_mm(shape: Shape, centre_mm: Reals, turn: Reals, points_mm: Reals, normals: Reals) -> Reals:
    """Overlap (n, k) of a shape in n poses at k nodes of the top [mm]; -inf where it is nowhere over a node.

    Parameters
    ----------
    centre_mm, turn : (n, 3) centres and (n, 3, 3) rotations of the shape; columns of a rotation are its axes
    points_mm, normals : (k, 3) nodes and (k, 3) outward unit normals; one normal (1, 3) on a flat top
    """
    axes = np.moveaxis(turn, 2, 0)
    start = axes @ points_mm.T - np.einsum("ani,ni->an", axes, centre_mm)[..., None]
    return np.asarray(-shape.entry_mm(start, axes @ normals.T))


Span = tuple[Reals, Reals]
"""First and last distance (...,) along lines within a shape; the first is above the last, or NaN, for a miss."""


def _dot(one: Reals, other: Reals) -> Reals:
    """Products of vectors (m, ...) along the first axis."""
    found: Reals = one[0] * other[0]
    for k in range(1, len(one)):
        found += one[k] * other[k]
    return found


def _round(start: Reals, way: Reals, square: float) -> Span:
    """Span of |start + t way|² <= square, in two or three dimensions."""
    a = np.maximum(_dot(way, way), PARALLEL**2)
    middle = _dot(start, way)
    middle /= -a
    root = _dot(start, start)
    root -= square
    root /= -a
    root += middle * middle
    np.sqrt(root, out=root)
    return middle - root, middle + root


def _slabs(start: Reals, way: Reals, half: Reals) -> Span:
    """Span within |component| <= half (m,) for each of m components."""
    first, last = None, None
    for one, along, reach in zip(start, way, half.tolist(), strict=True):
        inverse = 1.0 / np.where(np.abs(along) < PARALLEL, PARALLEL, along)
        middle, side = -one * inverse, reach * np.abs(inverse)
        low, high = middle - side, middle + side
        first = low if first is None else np.maximum(first, low, out=first)
        last = high if last is None else np.minimum(last, high, out=last)
    assert first is not None
    assert last is not None
    return first, last


def _ellipsoid(shape: Shape, start: Reals, way: Reals) -> Span:
    if shape.kind == "sphere":
        return _round(start, way, float(shape.size_mm[0]) ** 2)
    half = shape.size_mm.reshape(3, *[1] * (start.ndim - 1)).astype(start.dtype)
    return _round(start / half, way / half, 1.0)


def _box(shape: Shape, start: Reals, way: Reals) -> Span:
    return _slabs(start, way, shape.size_mm)


def _cylinder(shape: Shape, start: Reals, way: Reals) -> Span:
    side = _round(start[:2], way[:2], float(shape.size_mm[0]) ** 2)
    ends = _slabs(start[2:], way[2:], shape.size_mm[1:2])
    return np.maximum(side[0], ends[0]), np.minimum(side[1], ends[1])


def _capsule(shape: Shape, start: Reals, way: Reals) -> Span:
    """The line enters where it enters the infinite cylinder or, if that is beyond an end, the ball there."""
    radius, half = shape.size_mm[:2].tolist()
    square = radius**2
    first, last = _round(start[:2], way[:2], square)
    ends = []
    for distance, k in ((first, 0), (last, 1)):
        height = start[2] + distance * way[2]
        ball = np.stack([*np.broadcast_arrays(start[0], start[1], start[2] - np.clip(height, -half, half))])
        ends.append(np.where(np.abs(height) <= half, distance, _round(ball, way, square)[k]))
    return ends[0], ends[1]


def _hull(shape: Shape, start: Reals, way: Reals) -> Span:
    assert shape.planes is not None
    first: Reals = np.full(start.shape[1:], -np.inf, start.dtype)
    last: Reals = np.full(start.shape[1:], np.inf, start.dtype)
    planes = shape.planes.astype(start.dtype)
    for some in np.array_split(planes, -(-len(planes) // PLANES_AT_ONCE)):
        slope = np.tensordot(some[:, :3], way, 1)
        slope = np.where(np.abs(slope) < PARALLEL, PARALLEL, slope)
        cut = np.tensordot(some[:, :3], start, 1)
        np.subtract(some[:, 3].reshape(-1, *[1] * (start.ndim - 1)), cut, out=cut)
        cut /= slope
        np.maximum(first, np.where(slope < 0.0, cut, -np.inf).max(axis=0), out=first)
        np.minimum(last, np.where(slope < 0.0, np.inf, cut).min(axis=0), out=last)
    return first, last


_SPANS = {
    "sphere": _ellipsoid,
    "ellipsoid": _ellipsoid,
    "cylinder": _cylinder,
    "capsule": _capsule,
    "box": _box,
    "hull": _hull,
}
