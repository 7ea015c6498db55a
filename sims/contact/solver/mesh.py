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

Under a spherical crown (`crown`) every column of that mesh is shrunk evenly to the thickness there, with its bottom
kept and its top on the sphere, apex at height 0. There the top meets the wall in more than a right angle, where stress
is singular; columns are finer towards that rim, else force comes out too large (by 3 % on a pad of 3.7 tip radii).

The tip slides on the top, so the spacing there sets how well the contact radius is resolved: the
fine zone reaches beyond the largest contact radius (one tip radius) and down to where the steep
strain of a deep press has faded.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from design.arrays import BoolArray, FloatArray, IntArray
from sims.contact.solver.crown import crown_drop, require_rim

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

RIM_SPACING = 0.02
"""Radial spacing beside the wall under a crown [tip radii]. Half of it changes a press by less than a micrometre."""
RIM_GROWTH = 1.3
"""Ratio of neighbouring spacings from there inward [-]."""


@dataclass(frozen=True, kw_only=True)
class RadialMesh:
    """Triangles in the r-z half-plane; lengths in tip radii.

    Attributes
    ----------
    nodes : (node, 2) radius and height of the nodes at rest; the top's apex lies at height 0
    triangles : (triangle, 3) node indices
    top : (top node,) indices of the top surface from the axis outward
    is_bonded : (node,) True on the bottom and on the wall
    """

    nodes: FloatArray
    triangles: IntArray
    top: IntArray
    is_bonded: BoolArray


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


def finer_towards_end(coordinates: FloatArray, last: float, growth: float) -> FloatArray:
    """Coordinates whose spacing falls to `last` or a little more at the end; as they are where it is less already.

    Parameters
    ----------
    coordinates : (n,) increasing [any unit]
    last : spacing at the end [same unit]
    growth : ratio of neighbouring spacings from there back, until they are those of the coordinates [-]
    """
    largest = float(coordinates[-1] - coordinates[-2])
    if largest <= last:
        return coordinates
    steps = last * growth ** np.arange(np.ceil(np.log(largest / last) / np.log(growth)))
    kept = coordinates[coordinates <= coordinates[-1] - steps.sum()]
    steps *= (coordinates[-1] - kept[-1]) / steps.sum()
    return np.concatenate([kept, (coordinates[-1] - np.cumsum(steps)[:-1])[::-1], coordinates[-1:]])


def _crossed(columns: int, rows: int) -> IntArray:
    """(4 * cells, 3) triangles over a grid of nodes followed by one middle node per cell."""
    column, row = np.meshgrid(np.arange(columns - 1), np.arange(rows - 1), indexing="ij")
    corner = (column * rows + row).ravel()
    middle = columns * rows + np.arange(corner.size)
    ring = [corner, corner + rows, corner + rows + 1, corner + 1]
    sides = [np.stack([ring[k], ring[(k + 1) % 4], middle], axis=1) for k in range(4)]
    return np.stack(sides, axis=1).reshape(-1, 3).astype(np.int64)


def radial_mesh(layer_depth: float, wall_radius: float, spacing: float, crown: float = 0.0) -> RadialMesh:
    """Mesh of a layer bonded at its bottom and at its cylindrical wall.

    Parameters
    ----------
    layer_depth, wall_radius : thickness of the layer on the axis, radius of the wall [tip radii]
    spacing : node spacing in the fine zone under the tip [tip radii]
    crown : tip radius over the radius of the top's sphere; 0 is flat [-]

    Raises
    ------
    InputError, ModelScopeError : a crown that is no number from 0 on, or that leaves too little at the rim
    """
    require_rim(layer_depth, wall_radius, crown)
    radii = graded_spacing(wall_radius, FINE_RADIUS, spacing, LARGEST_RADIAL_SPACING)
    if crown > 0.0:
        radii = finer_towards_end(radii, RIM_SPACING, RIM_GROWTH)
    coarsest = max(spacing, layer_depth / FEWEST_ROWS)
    heights = -graded_spacing(layer_depth, FINE_DEPTH, spacing, coarsest)[::-1]
    grid = np.stack(np.meshgrid(radii, heights, indexing="ij"), axis=-1)
    if crown > 0.0:
        grid[..., 1] -= crown_drop(radii, crown)[:, None] * (1.0 + heights / layer_depth)
    middles = 0.25 * (grid[1:, 1:] + grid[1:, :-1] + grid[:-1, 1:] + grid[:-1, :-1])
    nodes = np.concatenate([grid.reshape(-1, 2), middles.reshape(-1, 2)])
    rows = len(heights)
    return RadialMesh(
        nodes=nodes,
        triangles=_crossed(len(radii), rows),
        top=np.arange(len(radii), dtype=np.int64) * rows + rows - 1,
        is_bonded=(nodes[:, 1] < -layer_depth + 1e-9) | (nodes[:, 0] > wall_radius - 1e-9),
    )
