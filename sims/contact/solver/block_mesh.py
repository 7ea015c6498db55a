"""The mesh of a rectangular pad around the press axis: hexahedra cut into 24 tetrahedra, graded.

Lengths are in tip radii; the press axis is x = y = 0, the undisturbed top z = 0, the walls are straight and
bonded at x = -west, x = east, y = -south, y = north. A pad that is symmetric in y is modelled by its half y >= 0.

Each hexahedron gets a node in its middle and one in the middle of each face, and a tetrahedron for
each quarter of a face. Four tetrahedra meet in two planes along every line from a face's middle: their
volumes are then dependent, as those of the crossed triangles of `mesh` are, and near-incompressible
material does not lock (5 tetrahedra a hexahedron are up to 8 % too stiff at nu = 0.49, and say so only
by converging slowly).

A nearer wall is made by bonding nodes of the same mesh: its lines pass through every place where a wall may be.
Two pads with different walls therefore have the same elements under the tip, and the error of that
mesh cancels in their difference.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

FINE_HALF_WIDTH = 1.2
"""Half width of the finely meshed square under the tip [tip radii]."""
FINE_DEPTH = 0.8
"""Depth of the finely meshed zone [tip radii], at most half of the layer."""
GROWTH = 1.4
"""Ratio of neighbouring spacings beyond the fine zone [-]."""
LARGEST_LATERAL, LARGEST_VERTICAL = 1.0, 0.9
"""Largest spacing towards the walls, and towards the bottom unless a fifth of the layer is more [tip radii]."""
THINNEST_SHARE = 0.2
"""Largest vertical spacing under the tip, in a thin layer, over the layer's depth [-]."""
_TINY = 1e-9


@dataclass(frozen=True, kw_only=True)
class BlockMesh:
    """Tetrahedra of a pad; lengths in tip radii.

    Attributes
    ----------
    points : (node, 3) positions at rest
    elements : (tetrahedron, 4) node indices; elements with bonded nodes only are left out
    is_bonded : (node,) True on bottom and walls
    top : (top node,) positions at rest (x, y) of the top, whole master mesh, whatever the walls
    top_node : (top node,) index into `points`; -1 where the walls have cut the place off
    facets : (facet, 3) triangles of the top as indices into `top`
    is_half : whether the plane y = 0 is one of symmetry
    """

    points: FloatArray
    elements: IntArray
    is_bonded: NDArray[np.bool_]
    top: FloatArray
    top_node: IntArray
    facets: IntArray
    is_half: bool


def _extended(lines: list[float], stop: float, spacing: float, largest: float) -> list[float]:
    """The lines and further ones that grow from `spacing` to end exactly at the stop."""
    length = stop - lines[-1]
    steps: list[float] = []
    while sum(steps) < 0.87 * length:
        spacing = min(spacing * GROWTH, largest)
        steps.append(spacing)
    if not steps:
        return lines
    return lines + list(lines[-1] + np.cumsum(steps) * (length / sum(steps)))


def lines_through(stops: Sequence[float], fine: float) -> FloatArray:
    """(line,) coordinates from 0 through every stop: even near 0, then growing.

    Parameters
    ----------
    stops : increasing distances beyond the fine square that need a line [tip radii]
    fine : spacing under the tip [tip radii]
    """
    lines = list(np.linspace(0.0, FINE_HALF_WIDTH, round(FINE_HALF_WIDTH / fine) + 1))
    for stop in stops:
        lines = _extended(lines, stop, lines[-1] - lines[-2], LARGEST_LATERAL)
    return np.array(lines)


def vertical_lines(layer: float, fine: float) -> FloatArray:
    """(line,) heights from the bottom to the top [tip radii]."""
    depth, spacing = min(FINE_DEPTH, 0.6 * layer), min(fine, THINNEST_SHARE * layer)
    lines = list(np.linspace(0.0, depth, round(depth / spacing) + 1))
    largest = max(LARGEST_VERTICAL, THINNEST_SHARE * layer)
    return -np.array(_extended(lines, layer, lines[1], largest))[::-1]


def _middles(lines: FloatArray) -> FloatArray:
    return np.asarray(0.5 * (lines[1:] + lines[:-1]), dtype=np.float64)


class _Nodes:
    """Families of nodes on grids, numbered one after the other."""

    def __init__(self) -> None:
        self.points: list[FloatArray] = []
        self.count = 0

    def add(self, x: FloatArray, y: FloatArray, z: FloatArray) -> IntArray:
        """(x, y, z) indices of a new family."""
        grid = np.stack(np.meshgrid(x, y, z, indexing="ij"), axis=-1)
        first = self.count
        self.points.append(grid.reshape(-1, 3))
        self.count += len(self.points[-1])
        return np.arange(first, self.count, dtype=np.int64).reshape(grid.shape[:3])


def _face_rings(corner: IntArray, faces: tuple[IntArray, IntArray, IntArray]) -> list[list[IntArray]]:
    """For each of the six faces of every hexahedron: its middle, then its four corners in turn."""

    def at(i: int, j: int, k: int) -> IntArray:
        nx, ny, nz = corner.shape
        return corner[i : nx - 1 + i, j : ny - 1 + j, k : nz - 1 + k].ravel()

    turn = ((0, 0), (1, 0), (1, 1), (0, 1))
    rings = []
    for side in (0, 1):
        east, north, top = faces
        middle_x = (east[:-1], east[1:])[side].ravel()
        middle_y = (north[:, :-1], north[:, 1:])[side].ravel()
        middle_z = (top[:, :, :-1], top[:, :, 1:])[side].ravel()
        rings.append([middle_x, *(at(side, a, b) for a, b in turn)])
        rings.append([middle_y, *(at(a, side, b) for a, b in turn)])
        rings.append([middle_z, *(at(a, b, side) for a, b in turn)])
    return rings


def crossed_block(x: FloatArray, y: FloatArray, z: FloatArray) -> tuple[FloatArray, IntArray, IntArray]:
    """Nodes, tetrahedra and top facets of a grid of hexahedra, each cut into 24.

    Returns
    -------
    (node, 3) positions, (tetrahedron, 4) and (facet, 3) node indices; all volumes are positive
    """
    nodes = _Nodes()
    mx, my, mz = _middles(x), _middles(y), _middles(z)
    corner, middle = nodes.add(x, y, z), nodes.add(mx, my, mz).ravel()
    faces = (nodes.add(x, my, mz), nodes.add(mx, y, mz), nodes.add(mx, my, z))
    points = np.concatenate(nodes.points)
    rings = _face_rings(corner, faces)
    quarters = [(ring[0], ring[1 + k], ring[1 + (k + 1) % 4]) for ring in rings for k in range(4)]
    elements = np.concatenate([np.stack([middle, *quarter], axis=1) for quarter in quarters])
    flipped = np.linalg.det(points[elements[:, 1:]] - points[elements[:, :1]]) < 0
    elements[flipped] = elements[flipped][:, [0, 1, 3, 2]]
    facets = np.concatenate([np.stack(quarter, axis=1) for quarter in quarters[-4:]])
    return points, elements, facets[points[facets, 2].min(axis=1) > -_TINY]


def _bonded(points: FloatArray, layer: float, walls: tuple[float, float, float, float]) -> NDArray[np.bool_]:
    west, east, south, north = walls
    x, y, z = points.T
    beyond = (x < -west + _TINY) | (x > east - _TINY) | (y < -south + _TINY) | (y > north - _TINY)
    return np.asarray(beyond | (z < -layer + _TINY), dtype=np.bool_)


def block_mesh(
    layer: float,
    walls: tuple[float, float, float, float],
    stops: Sequence[Sequence[float]],
    spacing: float,
) -> BlockMesh:
    """Mesh of a pad.

    Parameters
    ----------
    layer : elastic depth [tip radii]
    walls : distances (west, east, south, north) of the walls from the press axis [tip radii]
    stops : for each of the four sides, increasing distances through which the master mesh has lines; the wall's
        is one of them [tip radii]
    spacing : edge of the hexahedra under the tip [tip radii]
    """
    west, east, south, north = (lines_through(side, spacing) for side in stops)
    is_half = walls[2] == walls[3] and tuple(stops[2]) == tuple(stops[3])
    x = np.concatenate([-west[:0:-1], east])
    y = north if is_half else np.concatenate([-south[:0:-1], north])
    points, elements, facets = crossed_block(x, y, vertical_lines(layer, spacing))
    bonded = _bonded(points, layer, walls)
    elements = elements[~bonded[elements].all(axis=1)]
    used = np.unique(elements)
    renumbered = np.full(len(points), -1, dtype=np.int64)
    renumbered[used] = np.arange(used.size)
    top = np.flatnonzero(points[:, 2] > -_TINY)
    place = np.full(len(points), -1, dtype=np.int64)
    place[top] = np.arange(top.size)
    return BlockMesh(
        points=points[used],
        elements=renumbered[elements],
        is_bonded=bonded[used],
        top=points[top, :2],
        top_node=renumbered[top],
        facets=place[facets],
        is_half=is_half,
    )
