"""Convex objects with rounded edges: signed distance in closed form, with its derivatives.

An object is a core (a point, a box or a cylinder) grown by a radius ρ in all directions, its Minkowski sum with a ball.
Outside the core the distance is that to the core less ρ, and two derivatives follow from the residual r, which leads
from the nearest point of the core to the place:

    d = |r| - ρ,   ∇d = n = r/|r|,   ∇∇d = (P - n nᵀ)/|r| + (curvature of the core's own side),

where P projects on the coordinates in which the residual moves with the place. Inside the core, which no solution
reaches, the nearest face of the core tells the distance. Lowest point at the origin; z up.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from optopad.design.arrays import FloatArray

Distance = tuple[FloatArray, FloatArray, FloatArray]
"""(...) distance, (..., dimension) gradient, (..., dimension, dimension) second derivative."""


def box_distance(places: FloatArray, half: FloatArray) -> Distance:
    """Distance to a box around the origin, in any number of dimensions.

    Parameters
    ----------
    places : (..., dimension)
    half : (dimension,) half its sides
    """
    outside = np.abs(places) - half
    residual = np.maximum(outside, 0.0)
    length = np.linalg.norm(residual, axis=-1)
    nearest = np.eye(len(half))[outside.argmax(axis=-1)]
    is_in = length == 0.0
    moves = np.where(is_in[..., None], nearest, residual > 0.0)
    safe = np.where(is_in, 1.0, length)
    normal = np.where(is_in[..., None], nearest, residual / safe[..., None])
    bent = np.eye(len(half)) * moves[..., None] - normal[..., None] * normal[..., None, :]
    sign = np.where(places < 0.0, -1.0, 1.0)
    normal = normal * sign
    hessian = bent / safe[..., None, None] * sign[..., None] * sign[..., None, :]
    hessian[is_in] = 0.0
    return np.where(is_in, outside.max(axis=-1), length), normal, hessian


@dataclass(frozen=True, kw_only=True)
class RoundedBox:
    """A box, a rod or a ball, turned about the x axis.

    Attributes
    ----------
    half_mm : (x, y, z) half sides of the core
    rounding_mm : radius ρ
    roll_deg : turn about x: 45 points an edge down
    """

    half_mm: tuple[float, float, float]
    rounding_mm: float
    roll_deg: float = 0.0

    def distance(self, places: FloatArray) -> Distance:
        """Of places (..., 3) [mm]; second derivative in 1/mm."""
        cosine, sine = np.cos(np.radians(self.roll_deg)), np.sin(np.radians(self.roll_deg))
        turn = np.array([[1.0, 0.0, 0.0], [0.0, cosine, sine], [0.0, -sine, cosine]])
        _, half_y, half_z = self.half_mm
        centre = np.array([0.0, 0.0, self.rounding_mm + abs(sine) * half_y + abs(cosine) * half_z])
        distance, normal, hessian = box_distance((places - centre) @ turn.T, np.array(self.half_mm))
        return distance - self.rounding_mm, normal @ turn, turn.T @ hessian @ turn


@dataclass(frozen=True, kw_only=True)
class LyingCylinder:
    """A cylinder along x with rounded ends.

    Attributes
    ----------
    radius_mm, length_mm : of the whole, rounding included
    rounding_mm : of the edges at both ends
    """

    radius_mm: float
    length_mm: float
    rounding_mm: float

    def distance(self, places: FloatArray) -> Distance:
        """Of places (..., 3) [mm]; second derivative in 1/mm."""
        up = places[..., 2] - self.radius_mm
        reach = np.maximum(np.hypot(places[..., 1], up), 1e-9)
        core = np.array([0.5 * self.length_mm, self.radius_mm]) - self.rounding_mm
        section = np.stack([places[..., 0], reach], axis=-1)
        distance, normal, hessian = box_distance(section, core)
        axes = np.zeros((*reach.shape, 2, 3))  # of the section: along the cylinder, and out from its axis
        axes[..., 0, 0] = 1.0
        axes[..., 1, 1], axes[..., 1, 2] = places[..., 1] / reach, up / reach
        around = np.stack([np.zeros_like(reach), -axes[..., 1, 2], axes[..., 1, 1]], axis=-1)
        hoop = (normal[..., 1] / reach)[..., None, None] * around[..., :, None] * around[..., None, :]
        return (
            distance - self.rounding_mm,
            (normal[..., None, :] @ axes)[..., 0, :],
            axes.swapaxes(-1, -2) @ hessian @ axes + hoop,
        )


RigidObject = RoundedBox | LyingCylinder
