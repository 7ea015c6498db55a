"""The r-z mesh of the elastic layer: crossed triangles, fine under the tip, coarse towards the wall.

All lengths are in tip radii, so one mesh serves every press with the same elastic depth over radius.
Every rectangle of a graded grid is cut by both diagonals into four triangles about a middle node.
That pattern is used because single-diagonal linear triangles lock in near-incompressible materials;
crossed ones still satisfy the volume constraint of a quadrilateral with room to deform.

        r = 0                                r = wall
    z=0  +--+--+--+--+--+---+----+------+------+   free top
         |\\/|\\/|\\/|\\/|\\/|
         |/\\|/\\|/\\|/\\|/\\| ...                 bonded wall
    z=-h +--+--+--+--+--+---+----+------+------+   bonded bottom

The tip slides on the top, so the spacing there sets how well the contact radius is resolved: the
fine zone reaches beyond the largest contact radius (one tip radius) and down to where the steep
strain of a deep press has faded.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

FINE_RADIUS = 4 / 3
"""Radius of the fine zone [tip radii]."""
FINE_DEPTH = 0.5
"""Depth of the fine zone [tip radii]."""
GROWTH = 1.08
"""Ratio of neighbouring spacings outside the fine zone [-]."""
LARGEST_RADIAL_SPACING = 0.25
"""Largest radial spacing [tip radii]."""
FEWEST_ROWS = 20
"""The largest axial spacing is the layer's depth over this [-], but never less than the spacing under the tip."""


@dataclass(frozen=True, kw_only=True)
class RadialMesh:
    """Triangles in the r-z half-plane; lengths in tip radii.

    Attributes
    ----------
    nodes : (node, 2) radius and height of the nodes at rest; the top lies at height 0
    triangles : (triangle, 3) node indices
    top : (top node,) indices of the top surface from the axis outward
    is_bonded : (node,) True on the bottom and on the wall
    """

    nodes: FloatArray
    triangles: IntArray
    top: IntArray
    is_bonded: NDArray[np.bool_]


def graded_spacing(length: float, fine_length: float, fine: float, largest: float) -> FloatArray:
    """Coordinates from 0 to `length`: even to `fine_length`, then growing, scaled to end exactly.

    Parameters
    ----------
    length, fine_length : whole length and length of the even part [any unit]
    fine, largest : first spacing and upper bound of the spacing [same unit]

    Returns
    -------
    (n,) increasing coordinates.
    """
    even = min(fine_length, length)
    points = list(np.linspace(0.0, even, max(1, round(even / fine)) + 1))
    fine_count = len(points)
    step = fine
    while points[-1] < length - 1e-9:
        step = min(step * GROWTH, largest)
        points.append(points[-1] + step)
    coordinates = np.array(points)
    if len(coordinates) > fine_count:
        last_fine = coordinates[fine_count - 1]
        stretch = (length - last_fine) / (coordinates[-1] - last_fine)
        coordinates[fine_count:] = last_fine + (coordinates[fine_count:] - last_fine) * stretch
    return coordinates


def _crossed(columns: int, rows: int) -> IntArray:
    """(4 * cells, 3) triangles over a grid of nodes followed by one middle node per cell."""
    column, row = np.meshgrid(np.arange(columns - 1), np.arange(rows - 1), indexing="ij")
    corner = (column * rows + row).ravel()
    middle = columns * rows + np.arange(corner.size)
    ring = [corner, corner + rows, corner + rows + 1, corner + 1]
    sides = [np.stack([ring[k], ring[(k + 1) % 4], middle], axis=1) for k in range(4)]
    return np.stack(sides, axis=1).reshape(-1, 3).astype(np.int64)


def radial_mesh(layer_depth: float, wall_radius: float, spacing: float) -> RadialMesh:
    """Mesh of a layer bonded at its bottom and at its cylindrical wall.

    Parameters
    ----------
    layer_depth, wall_radius : thickness of the layer, radius of the wall [tip radii]
    spacing : node spacing in the fine zone under the tip [tip radii]
    """
    radii = graded_spacing(wall_radius, FINE_RADIUS, spacing, LARGEST_RADIAL_SPACING)
    coarsest = max(spacing, layer_depth / FEWEST_ROWS)
    heights = -graded_spacing(layer_depth, FINE_DEPTH, spacing, coarsest)[::-1]
    grid = np.stack(np.meshgrid(radii, heights, indexing="ij"), axis=-1)
    middles = 0.25 * (grid[1:, 1:] + grid[1:, :-1] + grid[:-1, 1:] + grid[:-1, :-1])
    nodes = np.concatenate([grid.reshape(-1, 2), middles.reshape(-1, 2)])
    rows = len(heights)
    return RadialMesh(
        nodes=nodes,
        triangles=_crossed(len(radii), rows),
        top=np.arange(len(radii), dtype=np.int64) * rows + rows - 1,
        is_bonded=(nodes[:, 1] < -layer_depth + 1e-9) | (nodes[:, 0] > wall_radius - 1e-9),
    )
