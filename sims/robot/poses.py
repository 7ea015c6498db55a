"""Objects of `optopad press` as shapes of a robot's simulation: the same pose, but sharp edges.

The lowest points of both are at the same height, since depths count from first touch.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.spatial import ConvexHull

from optopad.design.arrays import FloatArray
from optopad.design.errors import InputError
from optopad.design.held_object import (
    PUNCH_LENGTH_MM,
    Box,
    Cylinder,
    Ellipsoid,
    HeldObject,
    Mesh,
    Punch,
    Sphere,
)
from optopad.design.shape.top import Top
from optopad.sims.contact.held.bottoms import rotation
from optopad.sims.robot.shapes import Shape, hull_of, overlap_mm

SEARCHED_MM, SEARCHED = 8.0, 65
"""Half side of the square in which the first touch on a crown is searched [mm], and its points along a side."""
MOST_HOLLOW = 0.02
"""Share of its hull's volume that a mesh may lack [-]."""
ALONG_X = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
"""Rotation from a shape's axis, z, to that of a lying cylinder, x."""


def posed(
    held: HeldObject, top: Top, at_mm: tuple[float, float], depth_mm: float
) -> tuple[Shape, FloatArray, FloatArray]:
    """Shape, centre (3,) and rotation (3, 3) in cavity coordinates of an object that is pressed at a place, to a depth.

    Raises
    ------
    InputError : the object has a hole.
    """
    held = held.model_copy(update={"yaw": held.yaw - top.frame_turn_deg})
    shape, turn, lowest_mm, offset = _standing(held)
    origin, axes = top.press_frame(*at_mm)
    turned = axes.T @ turn
    centre = origin + axes.T @ (offset + np.array([0.0, 0.0, lowest_mm]))
    if not top.is_flat:
        centre = centre + _lift_mm(shape, centre, turned, top, at_mm) * axes[2]
    return shape, centre - depth_mm * axes[2], turned


def _lift_mm(
    shape: Shape, centre: FloatArray, turn: FloatArray, top: Top, at_mm: tuple[float, float]
) -> float:
    """How far a shape that touches a crown's tangent plane has to move out until it just touches the crown; below 0 in.

    Beyond the middle of a crown the top falls away, so it is the points around the place of the press that count.
    """
    share = np.linspace(-1.0, 1.0, SEARCHED)
    x, y = np.meshgrid(at_mm[0] + SEARCHED_MM * share, at_mm[1] + SEARCHED_MM * share)
    height = top.height_mm(x, y)
    on_top = np.isfinite(height)
    points = np.column_stack([x[on_top], y[on_top], height[on_top]])
    normal = top.press_frame(*at_mm)[1][2][None]
    return float(overlap_mm(shape, centre[None], turn[None], points, normal).max())


def _standing(held: HeldObject) -> tuple[Shape, FloatArray, float, FloatArray]:
    """Shape, rotation, height of the object's centre above its lowest point, and the shape's centre relative to it."""
    turn, middle = rotation(held), np.zeros(3)
    if isinstance(held, Sphere):
        return _shape("sphere", held.radius), turn, held.radius, middle
    if isinstance(held, Ellipsoid):
        axes = np.array([held.a, held.b, held.c])
        return _shape("ellipsoid", *axes), turn, float(np.linalg.norm(turn[2] * axes)), middle
    if isinstance(held, Box):
        half = np.array([held.length, held.width, held.height]) / 2.0
        return _shape("box", *half), turn, float(np.abs(turn[2]) @ half), middle
    if isinstance(held, Mesh):
        corners = held.facets.vertices_mm
        _require_convex(held)
        return hull_of(corners), turn, -float((corners @ turn[2]).min()), middle
    if isinstance(held, Punch):
        middle = turn[:, 2] * PUNCH_LENGTH_MM / 2.0
        lowest = _lowest_mm(turn, held.radius, PUNCH_LENGTH_MM / 2.0) - middle[2]
        return _shape("cylinder", held.radius, PUNCH_LENGTH_MM / 2.0), turn, lowest, middle
    if not isinstance(held, Cylinder):
        raise InputError(
            f"object: {held.words} has no convex shape; the map of light for simulation knows convex objects: "
            "use a mesh of its convex hull, or several objects"
        )
    turn = turn @ ALONG_X
    half_mm = held.length / 2.0
    if held.edge_mm < held.radius:
        return _shape("cylinder", held.radius, half_mm), turn, _lowest_mm(turn, held.radius, half_mm), middle
    half_mm -= held.radius
    return _shape("capsule", held.radius, half_mm), turn, abs(turn[2, 2]) * half_mm + held.radius, middle


def _require_convex(held: Mesh) -> None:
    corners = held.facets.vertices_mm
    a, b, c = np.moveaxis(corners[held.facets.triangles], 1, 0)
    volume = abs(float(np.einsum("ti,ti->", a, np.cross(b, c)))) / 6.0
    missing = 1.0 - volume / ConvexHull(corners).volume
    if missing > MOST_HOLLOW:
        raise InputError(
            f"object: {held.words} lacks {missing:.0%} of its convex hull; the map of light for simulation knows "
            "convex objects: divide the mesh into convex parts"
        )


def _lowest_mm(turn: FloatArray, radius_mm: float, half_mm: float) -> float:
    """How far a cylinder reaches below its middle."""
    down = float(turn[2, 2])
    return abs(down) * half_mm + radius_mm * math.sqrt(max(1.0 - down * down, 0.0))


def _shape(kind: str, *size_mm: float) -> Shape:
    return Shape(kind=kind, size_mm=np.array([*size_mm, 0.0, 0.0])[:3])
