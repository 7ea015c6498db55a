"""Graded quadrilaterals of the oracle's layer in the r-z half-plane; lengths in tip radii."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from skfem import MeshQuad

FloatArray = NDArray[np.float64]


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

    size: float = 0.05
    axis_size: float = 0.025
    axis_radius: float = 0.4
    fine_radius: float = 1.3
    fine_depth: float = 0.5
    growth: float = 1.15
    largest_radial: float = 0.4
    largest_axial: float = 0.15

    def halved(self) -> Grading:
        """Every size halved, growth per length kept."""
        return Grading(
            size=0.5 * self.size,
            axis_size=0.5 * self.axis_size,
            axis_radius=self.axis_radius,
            fine_radius=self.fine_radius,
            fine_depth=self.fine_depth,
            growth=self.growth**0.5,
            largest_radial=0.5 * self.largest_radial,
            largest_axial=0.5 * self.largest_axial,
        )


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


def layer_mesh(layer: float, wall: float, grading: Grading) -> MeshQuad:
    """Mesh of a layer: axis at r = 0, wall at r = `wall`, free top at z = 0, bottom at z = -`layer`."""
    inner = graded(grading.fine_radius, grading.axis_radius, grading.axis_size, grading.growth, grading.size)
    outer = graded(wall - grading.fine_radius, 0.0, grading.size, grading.growth, grading.largest_radial)
    radii = np.concatenate([inner, grading.fine_radius + outer[1:]])
    depths = graded(layer, grading.fine_depth, grading.size, grading.growth, grading.largest_axial)
    return MeshQuad.init_tensor(radii, -depths[::-1])
