"""A pad with a pressed top as triangles: what mesh tracers see."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from sims.optics.scene.optical_scene import OpticalScene
from sims.press.indentation import Indentation
from tests.bench.measures.forward_walk import dimple_row

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

GRID = 192
"""Squares along each side of the top; two triangles each, 73,728 in all."""


def compact_height(press: Indentation, top_mm: float) -> Callable[[FloatArray], FloatArray]:
    """Height [mm] over radius [mm] of a compact dimple without pile-up, from its definition."""
    _, _, top, tip, contact2, tip_z, drop, width, rim, _ = dimple_row(np.zeros(2), press, top_mm)

    def height(radius: FloatArray) -> FloatArray:
        share = np.clip((rim - radius) / width, 0.0, None)
        inside = tip_z - np.sqrt(tip**2 - np.minimum(radius**2, contact2))
        return np.where(radius**2 < contact2, inside, top - drop * share**3)

    return height


def top_mesh(
    scene: OpticalScene, centre_mm: FloatArray, height: Callable[[FloatArray], FloatArray], grid: int = GRID
) -> tuple[FloatArray, IntArray]:
    """Vertices (n, 3) [mm] and triangles (2 grid², 3) of the top on a regular grid, facing up."""
    x, y = np.meshgrid(
        np.linspace(0.0, scene.length_mm, grid + 1), np.linspace(0.0, scene.width_mm, grid + 1), indexing="ij"
    )
    z = height(np.hypot(x - centre_mm[0], y - centre_mm[1]))
    vertices = np.column_stack([x.ravel(), y.ravel(), z.ravel()])
    corner = (np.arange(grid)[:, None] * (grid + 1) + np.arange(grid)[None, :]).ravel()
    east, north, far = corner + grid + 1, corner + 1, corner + grid + 2
    triangles = np.concatenate([np.column_stack([corner, east, far]), np.column_stack([corner, far, north])])
    return vertices, triangles


def box_mesh(scene: OpticalScene) -> tuple[FloatArray, IntArray]:
    """Vertices (8, 3) [mm] and triangles (10, 3) of walls and bottom."""
    size = np.array([scene.length_mm, scene.width_mm, scene.height_mm])
    vertices = np.array([(i, j, k) for i in (0, 1) for j in (0, 1) for k in (0, 1)]) * size
    quads = [(0, 2, 6, 4), (0, 4, 5, 1), (2, 3, 7, 6), (0, 1, 3, 2), (4, 6, 7, 5)]
    triangles = [(a, b, c) for p, q, r, s in quads for a, b, c in ((p, q, r), (p, r, s))]
    return vertices, np.array(triangles)


def cosine_rays(scene: OpticalScene, count: int, seed: int = 0) -> FloatArray:
    """(count, 6) origins [mm] and unit directions of rays by the cosine law, from the emitters in turn."""
    generator = np.random.default_rng(seed)
    a, b, u, v = generator.random((4, count))
    which = np.arange(count) % len(scene.emitter_wall)
    wall, patch = scene.emitter_wall[which], scene.emitter_patch[which]
    along = patch[:, 0] + (2.0 * a - 1.0) * patch[:, 2]
    z = patch[:, 1] + (2.0 * b - 1.0) * patch[:, 3]
    into, aside, up = np.sqrt(1.0 - u), np.sqrt(u) * np.cos(2 * np.pi * v), np.sqrt(u) * np.sin(2 * np.pi * v)
    on_x = wall % 2 == 0
    sign = np.where((wall == 0) | (wall == 3), 1.0, -1.0)
    start = np.where((wall == 0) | (wall == 3), 0.0, np.where(wall == 1, scene.length_mm, scene.width_mm))
    x, y = np.where(on_x, along, start), np.where(on_x, start, along)
    dx, dy = np.where(on_x, aside, sign * into), np.where(on_x, sign * into, aside)
    return np.column_stack([x, y, z, dx, dy, up])
