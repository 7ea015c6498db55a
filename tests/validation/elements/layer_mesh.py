"""Graded quadrilaterals of the oracle's layer in the r-z half-plane; lengths in tip radii."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from skfem import MeshQuad

from optopad.design.arrays import FloatArray


@dataclass(frozen=True, kw_only=True)
class Grading:
    """Sizes of the elements; each has nodes at half its size.

    Attributes
    ----------
    size : element size at the contact
    axis_size, axis_radius : radial size near the axis and its extent; a deep press stretches the layer there fourfold
    fine_radius, fine_depth : extent of that size
    growth : ratio of neighbouring sizes beyond
    largest_radial, largest_axial : bounds of the size
    """

    size: float = 0.1
    axis_size: float = 0.05
    axis_radius: float = 0.4
    fine_radius: float = 1.3
    fine_depth: float = 0.5
    growth: float = 1.15
    largest_radial: float = 0.4
    largest_axial: float = 0.15


def graded(length: float, fine: float, size: float, growth: float, largest: float) -> FloatArray:
    """Coordinates from 0 to `length`: even to `fine`, then growing, stretched to end exactly."""
    even = np.linspace(0.0, min(fine, length), round(min(fine, length) / size) + 1)
    if fine >= length:
        return even
    steps = [min(size * growth, largest)]
    while sum(steps) < length - fine:
        steps.append(min(steps[-1] * growth, largest))
    beyond = np.cumsum(steps)
    return np.concatenate([even, fine + beyond * (length - fine) / beyond[-1]])


def halved(ticks: FloatArray) -> FloatArray:
    """The same coordinates with the middles between them."""
    return np.sort(np.concatenate([ticks, 0.5 * (ticks[1:] + ticks[:-1])]))


def layer_mesh(layer: float, wall: float, grading: Grading, halvings: int = 0) -> MeshQuad:
    """Mesh of a layer: axis at r = 0, wall at r = `wall`, free top at z = 0, bottom at z = -`layer`.

    Parameters
    ----------
    layer, wall : thickness of the layer, radius of the wall
    grading : sizes of the elements
    halvings : how often every element is then cut into four
    """
    inner = graded(grading.fine_radius, grading.axis_radius, grading.axis_size, grading.growth, grading.size)
    outer = graded(wall - grading.fine_radius, 0.0, grading.size, grading.growth, grading.largest_radial)
    radii = np.concatenate([inner, grading.fine_radius + outer[1:]])
    depths = graded(layer, grading.fine_depth, grading.size, grading.growth, grading.largest_axial)
    for _ in range(halvings):
        radii, depths = halved(radii), halved(depths)
    return MeshQuad.init_tensor(radii, -depths[::-1])
