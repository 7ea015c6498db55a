"""Meshes of the untouched pad for display: outline in plan, walls, layers and top; lengths in mm.

The outline is a polygon whose vertices include the plan's corners. Under a crown, straight walls are divided into
short sides, so that their upper edges follow the crown.

The module also cuts meshes open along a plane, to show the inside.
"""

from __future__ import annotations

import numpy as np

from optopad.design.arrays import BoolArray, FloatArray, IntArray
from optopad.design.shape.cavity import Plan, edge_mm


def cut_open(points_mm: FloatArray, triangles: IntArray, y_mm: float) -> tuple[FloatArray, IntArray]:
    """The part of a mesh with y above `y_mm`; triangles across this plane are cut, and the opening is not closed.

    Parameters
    ----------
    points_mm, triangles : (n, 3) points [mm], and (m, 3) indices of points
    """
    height = points_mm[:, 1] - y_mm
    inside = (height >= 0)[triangles]
    count = inside.sum(axis=1)
    whole = triangles[count == 3]
    one = _turned(triangles[count == 1], inside[count == 1])
    two = _turned(triangles[count == 2], ~inside[count == 2])
    near, far = (
        _crossing(points_mm, height, one[:, 0], one[:, 1]),
        _crossing(points_mm, height, one[:, 0], one[:, 2]),
    )
    first, last = (
        _crossing(points_mm, height, two[:, 0], two[:, 1]),
        _crossing(points_mm, height, two[:, 0], two[:, 2]),
    )
    corners = np.concatenate(
        [
            points_mm[whole],
            np.stack([points_mm[one[:, 0]], near, far], axis=1),
            np.stack([first, points_mm[two[:, 1]], points_mm[two[:, 2]]], axis=1),
            np.stack([first, points_mm[two[:, 2]], last], axis=1),
        ]
    )
    return corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3)


def _turned(triangles: IntArray, marked: BoolArray) -> IntArray:
    """Triangles with their corners rotated so that the single marked corner is first; the orientation is unchanged."""
    first = marked.argmax(axis=1)[:, None]
    return np.take_along_axis(triangles, (first + np.arange(3)) % 3, axis=1)


def _crossing(points: FloatArray, height: FloatArray, start: IntArray, end: IntArray) -> FloatArray:
    """Points where edges of a mesh cross a plane.

    `height` is the signed distance of each vertex from the plane; `start` and `end` are the vertices of each edge."""
    share = (height[start] / (height[start] - height[end]))[:, None]
    return np.asarray(points[start] + share * (points[end] - points[start]), dtype=np.float64)


RINGS = 14
"""Number of rings of a crown's mesh from the middle to the edge."""
LOOKS = 400
"""Number of heights at which a ray is tested against a crown."""


def outline_mm(plan: Plan) -> FloatArray:
    """(n, 2) corners of the pad in plan, counter-clockwise."""
    return edge_mm(plan)[:, :2]


def top_mm(plan: Plan, x_mm: FloatArray, y_mm: FloatArray) -> FloatArray:
    """(...,) height of the untouched top at (...,) locations [mm]; 0 beyond the crown's sphere or cylinder."""
    return np.nan_to_num(plan.top.height_mm(x_mm, y_mm), nan=0.0)


def untouched_top(plan: Plan) -> tuple[FloatArray, IntArray]:
    """(n, 3) points [mm] and (m, 3) triangles of the untouched top, in rings from the middle to the edge."""
    edge, middle = outline_mm(plan), np.array(plan.centre_mm)
    shares = np.linspace(0.0, 1.0, 2 if plan.top.is_flat else RINGS)
    places = middle + shares[:, None, None] * (edge - middle)
    heights = top_mm(plan, places[..., 0], places[..., 1])
    points = np.concatenate([places, heights[..., None]], axis=-1).reshape(-1, 3)
    return points, ring_triangles(len(shares), len(edge))


def side_walls(plan: Plan) -> tuple[FloatArray, IntArray]:
    """(n, 3) points [mm] and (m, 3) triangles of the walls, from the clear layer's bottom to the untouched top."""
    edge = outline_mm(plan)
    low = np.column_stack([edge, np.zeros(len(edge))])
    high = np.column_stack([edge, top_mm(plan, edge[:, 0], edge[:, 1])])
    return np.concatenate([low, high]), ring_triangles(2, len(edge))


def slab(plan: Plan, thickness_mm: float) -> tuple[FloatArray, IntArray]:
    """(n, 3) points [mm] and (m, 3) triangles of a closed layer under the clear layer.

    The triangles are counter-clockwise as seen from outside.
    """
    edge = outline_mm(plan)
    rings = [
        np.column_stack([plan.centre_mm + share * (edge - plan.centre_mm), np.full(len(edge), level)])
        for share, level in ((0.0, 0.0), (1.0, 0.0), (1.0, -thickness_mm), (0.0, -thickness_mm))
    ]
    return np.concatenate(rings), ring_triangles(4, len(edge))


def ring_triangles(rings: int, spokes: int) -> IntArray:
    """Indices of two triangles for every cell between rings and spokes, counter-clockwise as seen from above."""
    ring, spoke = (a.ravel() for a in np.meshgrid(np.arange(rings - 1), np.arange(spokes), indexing="ij"))
    after = (spoke + 1) % spokes
    a, b = ring * spokes + spoke, ring * spokes + after
    c, d = (ring + 1) * spokes + spoke, (ring + 1) * spokes + after
    return np.concatenate([np.stack([a, c, d], axis=1), np.stack([a, d, b], axis=1)]).astype(np.int64)


def struck_place(plan: Plan, eye_mm: FloatArray, way: FloatArray) -> tuple[float, float] | None:
    """Location (x, y) where a ray from above first meets the untouched top [mm]; None if it misses the pad.

    Parameters
    ----------
    eye_mm, way : (3,) start and direction of the ray
    """
    if abs(way[2]) < 1e-9:
        return None
    low = plan.clear_mm if plan.top.is_flat else max(np.nan_to_num(plan.rim_mm[0], nan=0.0), 0.0)
    for height in np.linspace(plan.clear_mm, low, 1 if plan.top.is_flat else LOOKS).tolist():
        x, y, _ = (eye_mm + way * (height - eye_mm[2]) / way[2]).tolist()
        if height <= plan.top_mm(x, y) and plan.contains(x, y):
            return x, y
    return None
