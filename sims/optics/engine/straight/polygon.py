"""Kernels: convex polygons of homogeneous points (x, y, w) in rows of an array: cut, area, centroid.

Sutherland and Hodgman's clipping, one half plane at a time; w lets a point lie behind the eye.
"""

from __future__ import annotations

from design.arrays import FloatArray
from sims.optics.surface.radial import kernel


@kernel
def cut(n: int, poly: FloatArray, other: FloatArray, along: float, up: float, whole: float) -> int:
    """Clip a polygon of homogeneous points (x, y, w) to along x + up y + whole w >= 0; its number of corners."""
    outside = 0
    for c in range(n):
        if along * poly[c, 0] + up * poly[c, 1] + whole * poly[c, 2] < 0.0:
            outside += 1
    if outside == 0:
        return n
    if outside == n:
        return 0
    kept = 0
    fc = along * poly[0, 0] + up * poly[0, 1] + whole * poly[0, 2]
    for c in range(n):
        d = c + 1 if c + 1 < n else 0
        fd = along * poly[d, 0] + up * poly[d, 1] + whole * poly[d, 2]
        if fc >= 0.0:
            for k in range(3):
                other[kept, k] = poly[c, k]
            kept += 1
        if (fc >= 0.0) != (fd >= 0.0):
            t = fc / (fc - fd)
            for k in range(3):
                other[kept, k] = poly[c, k] + t * (poly[d, k] - poly[c, k])
            kept += 1
        fc = fd
    for c in range(kept):
        for k in range(3):
            poly[c, k] = other[c, k]
    return kept if kept > 2 else 0


@kernel
def cut_to_rectangle(n: int, poly: FloatArray, other: FloatArray, half_x: float, half_y: float) -> int:
    """Clip a polygon in front of the eye to |x| <= half_x, |y| <= half_y; its number of corners."""
    n = cut(n, poly, other, -1.0, 0.0, half_x)
    if n > 0:
        n = cut(n, poly, other, 1.0, 0.0, half_x)
    if n > 0:
        n = cut(n, poly, other, 0.0, -1.0, half_y)
    if n > 0:
        n = cut(n, poly, other, 0.0, 1.0, half_y)
    return n


@kernel
def area_and_centroid(n: int, poly: FloatArray) -> tuple[float, float, float]:
    """Signed area and centroid of a polygon whose w are 1."""
    x0 = poly[0, 0]
    y0 = poly[0, 1]
    area = 0.0
    sx = 0.0
    sy = 0.0
    for c in range(1, n - 1):
        ax = poly[c, 0] - x0
        ay = poly[c, 1] - y0
        bx = poly[c + 1, 0] - x0
        by = poly[c + 1, 1] - y0
        cross = ax * by - ay * bx
        area += cross
        sx += cross * (ax + bx)
        sy += cross * (ay + by)
    if abs(area) < 1e-15:
        return 0.0, x0, y0
    return 0.5 * area, x0 + sx / (3.0 * area), y0 + sy / (3.0 * area)
