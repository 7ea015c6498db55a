"""Light in the air above the pad: from where it left the elastomer to where it enters again, or is lost.

Model
-----
A ray leaves by Snell's law, flies straight, and meets the top from outside, a tip, or a wall. The top mirrors or
lets it in by Fresnel's equations. Tips scatter like their wetted part, or absorb. Below the undisturbed top a wall
that the dimple has bared scatters or absorbs like any wall, its receivers absorb without being counted, and it is
never smooth. Above the undisturbed top there is nothing beside the pad: what passes over a wall there has escaped.
Air absorbs nothing.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from design.arrays import FloatArray
from sims.optics.oracle.border import fresnel_reflectance, refracted_direction
from sims.optics.oracle.chance import draw, lobe_direction
from sims.optics.oracle.scene import (
    BOTTOM_FACE,
    NO_FACE,
    Scene,
    face_hit,
    inward_normal,
    receiver_at,
    untouched_top,
)
from sims.optics.oracle.surface import NOTHING
from sims.optics.oracle.top import Top, tip_met, top_entry

BACK_INSIDE, OVER_THE_WALLS, ON_A_TIP, ON_A_WALL, GIVEN_UP = range(5)
"""How a flight in air ends."""
NUDGE_MM = 1e-6
"""A ray restarts this far from the surface that it met [mm]: as much as pieces overlap, far more than rounding."""
AIR_STEP_LIMIT = 1_000
"""Flights in air after which a ray is given up."""


@njit()
def fly(
    scene: Scene,
    top: Top,
    stream: np.uint64,
    place: tuple[float, float, float],
    direction: tuple[float, float, float],
    vertices: FloatArray,
    count: int,
) -> tuple[int, np.uint64, tuple[float, float, float], tuple[float, float, float], int]:
    """Follow one ray through the air.

    Parameters
    ----------
    place, direction : just outside the elastomer [mm], unit vector
    vertices, count : places of the path so far, which go on being filled

    Returns
    -------
    how it ends, its stream, place and direction (inside the elastomer again, if it ends there), count of places
    """
    (x, y, z), (dx, dy, dz) = place, direction
    for _ in range(AIR_STEP_LIMIT):
        distance, face = face_hit(scene, x, y, z, dx, dy, dz)
        distance, what, nx, ny, nz = top_entry(top, x, y, z, dx, dy, dz, distance)
        on_tip, is_tip, tx, ty, tz = tip_met(top, x, y, z, dx, dy, dz, distance)
        if not is_tip and what == NOTHING and _passes_over(scene, face, distance, x, y, z, dx, dy, dz):
            return OVER_THE_WALLS, stream, (x, y, z), (dx, dy, dz), count
        if is_tip:
            distance = on_tip
        x, y, z = x + distance * dx, y + distance * dy, z + distance * dz
        count = record(vertices, count, x, y, z)
        stream, chance = draw(stream)
        if is_tip:
            nx, ny, nz = tx, ty, tz
            if chance >= scene.tip_reflectance or tx * tx + ty * ty + tz * tz == 0.0:
                return ON_A_TIP, stream, (x, y, z), (dx, dy, dz), count
        elif what != NOTHING:
            cosine = dx * nx + dy * ny + dz * nz
            if cosine <= 0.0 or chance >= fresnel_reflectance(cosine, 1.0 / scene.refractive_index):
                if cosine > 0.0:
                    dx, dy, dz = refracted_direction(dx, dy, dz, nx, ny, nz, 1.0 / scene.refractive_index)
                x, y, z = x + NUDGE_MM * nx, y + NUDGE_MM * ny, z + NUDGE_MM * nz
                return BACK_INSIDE, stream, (x, y, z), (dx, dy, dz), count
            dx, dy, dz = dx - 2.0 * cosine * nx, dy - 2.0 * cosine * ny, dz - 2.0 * cosine * nz
            x, y, z = x - NUDGE_MM * nx, y - NUDGE_MM * ny, z - NUDGE_MM * nz
            continue
        elif face == BOTTOM_FACE:
            return GIVEN_UP, stream, (x, y, z), (dx, dy, dz), count
        else:
            if chance >= scene.wall_reflectance or receiver_at(scene, face, x, y, z) >= 0:
                return ON_A_WALL, stream, (x, y, z), (dx, dy, dz), count
            nx, ny, nz = inward_normal(scene, face, x, y)
        x, y, z = x + NUDGE_MM * nx, y + NUDGE_MM * ny, z + NUDGE_MM * nz
        stream, u = draw(stream)
        stream, v = draw(stream)
        dx, dy, dz = lobe_direction(nx, ny, nz, 1.0, u, v)
    return GIVEN_UP, stream, (x, y, z), (dx, dy, dz), count


@njit()
def _passes_over(
    scene: Scene,
    face: int,
    distance: float,
    x: float,
    y: float,
    z: float,
    dx: float,
    dy: float,
    dz: float,
) -> bool:
    """Whether a ray that meets nothing else passes the walls above the untouched top."""
    return face == NO_FACE or z + distance * dz > untouched_top(scene, x + distance * dx, y + distance * dy)


@njit()
def record(vertices: FloatArray, count: int, x: float, y: float, z: float) -> int:
    """Write down one place of a path while there is room; the count of places so far."""
    if count < vertices.shape[0]:
        vertices[count, 0], vertices[count, 1], vertices[count, 2] = x, y, z
    return count + 1
