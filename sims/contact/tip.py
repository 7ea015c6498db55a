"""The tip: a hemisphere with a straight shank, in tip radii, and the coordinate along its outline.

       |  |                     outline coordinate t: 0 at the apex, angle of the sphere
       |  |  shank              up to π/2, then π/2 + height above the equator
z=0 ---|--|----- undisturbed top
       \\  /   hemisphere
        --     apex, at z = -depth
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


def tip_gap(radius: FloatArray, height: FloatArray, depth: float) -> FloatArray:
    """(...,) distance of points to the tip's surface, negative inside; all in tip radii."""
    below_equator = np.minimum(height - (1.0 - depth), 0.0)
    return np.asarray(np.hypot(radius, below_equator) - 1.0, dtype=np.float64)


def tip_coordinate(radius: FloatArray, height: FloatArray, depth: float) -> FloatArray:
    """(...,) outline coordinate of the tip's point nearest to each position; all in tip radii."""
    above_equator = height - (1.0 - depth)
    angle = np.arctan2(radius, np.maximum(-above_equator, 0.0))
    return np.asarray(angle + np.maximum(above_equator, 0.0), dtype=np.float64)


def tip_outline(coordinate: FloatArray, depth: float) -> tuple[FloatArray, FloatArray]:
    """Radius and height (...,) of the tip's outline at an outline coordinate; all in tip radii."""
    angle = np.minimum(coordinate, 0.5 * np.pi)
    above_equator = np.maximum(coordinate - 0.5 * np.pi, 0.0)
    return np.sin(angle), 1.0 - depth - np.cos(angle) + above_equator


def outside_tip(radius: FloatArray, height: FloatArray, depth: float) -> tuple[FloatArray, FloatArray]:
    """Points moved onto the tip's surface where they lie inside it; all (...,) in tip radii."""
    inside = tip_gap(radius, height, depth) < 0.0
    on_radius, on_height = tip_outline(tip_coordinate(radius, height, depth), depth)
    return np.where(inside, on_radius, radius), np.where(inside, on_height, height)
