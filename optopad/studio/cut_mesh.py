"""A mesh cut open along a plane, for a look inside."""

from __future__ import annotations

import numpy as np

from design.arrays import BoolArray, FloatArray, IntArray


def cut_open(points_mm: FloatArray, triangles: IntArray, y_mm: float) -> tuple[FloatArray, IntArray]:
    """The part of a surface with y above a value, triangles across it cut there; the cut stays open.

    Parameters
    ----------
    points_mm : (n, 3); triangles : (m, 3) numbers of points
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
    """Triangles with their one marked corner first, the sense of rotation kept."""
    first = marked.argmax(axis=1)[:, None]
    return np.take_along_axis(triangles, (first + np.arange(3)) % 3, axis=1)


def _crossing(points: FloatArray, height: FloatArray, start: IntArray, end: IntArray) -> FloatArray:
    """Where edges cross the plane."""
    share = (height[start] / (height[start] - height[end]))[:, None]
    return np.asarray(points[start] + share * (points[end] - points[start]), dtype=np.float64)
