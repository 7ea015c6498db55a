"""The block as the oracle sees it: the optical scene as checked numbers, its walls, bottom and patches."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from design.errors import InputError
from sims.optics.oracle.chance import pattern_shares
from sims.optics.scene.optical_scene import OpticalScene

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

POWER_TOLERANCE = 1e-6
"""Largest distance of a radiance table's power from 1 [-]: rounding of tables that were written down."""


class Scene(NamedTuple):
    """`OpticalScene` as a tuple that compiled code takes; walls 0-3, bottom 4.

    Attributes that differ from the scene's
    ---------------------------------------
    wall_ratio : index of the elastomer over that behind smooth walls [-]; 0 where walls only scatter
    emitter_pattern : (2, e, n) radiance table [1/sr] and the share of power below each node [-]; a NaN row, or no
        column, is an emitter by order
    receiver_response : (r, n) share of arriving light that is counted [-]; no column: all of it
    """

    length: float
    width: float
    height: float
    refractive_index: float
    absorption: float
    wall_reflectance: float
    bottom_reflectance: float
    tip_reflectance: float
    wall_ratio: float
    emitter_wall: IntArray
    emitter_patch: FloatArray
    emitter_order: FloatArray
    emitter_pattern: FloatArray
    receiver_wall: IntArray
    receiver_patch: FloatArray
    receiver_response: FloatArray


def lower_scene(scene: OpticalScene) -> Scene:
    """Check a scene and turn it into a tuple for compiled code."""
    for name in ("length_mm", "width_mm", "height_mm"):
        _require(name, getattr(scene, name), 0.0, np.inf, open_low=True)
    _require("refractive_index", scene.refractive_index, 1.0, np.inf)
    _require("absorption_per_mm", scene.absorption_per_mm, 0.0, np.inf)
    for name in ("wall_reflectance", "bottom_reflectance", "tip_reflectance"):
        _require(name, getattr(scene, name), 0.0, 1.0)
    for kind in ("emitter", "receiver"):
        _check_patches(scene, kind)
    order = np.asarray(scene.emitter_order, dtype=np.float64)
    if order.shape != np.shape(scene.emitter_wall):
        raise InputError(f"emitter_order: shape {order.shape}, needs {np.shape(scene.emitter_wall)}")
    for i, m in enumerate(order):
        _require(f"emitter_order[{i}]", float(m), 0.0, np.inf)
    radiance = _lowered_patterns(scene)
    return Scene(
        float(scene.length_mm),
        float(scene.width_mm),
        float(scene.height_mm),
        float(scene.refractive_index),
        float(scene.absorption_per_mm),
        float(scene.wall_reflectance),
        float(scene.bottom_reflectance),
        float(scene.tip_reflectance),
        _wall_ratio(scene),
        np.ascontiguousarray(scene.emitter_wall, dtype=np.int64),
        np.ascontiguousarray(scene.emitter_patch, dtype=np.float64),
        np.ascontiguousarray(order),
        np.stack([radiance, pattern_shares(radiance) if radiance.size else radiance]),
        np.ascontiguousarray(scene.receiver_wall, dtype=np.int64),
        np.ascontiguousarray(scene.receiver_patch, dtype=np.float64),
        _lowered_responses(scene),
    )


def _wall_ratio(scene: OpticalScene) -> float:
    if scene.wall_index is None:
        return 0.0
    _require("wall_index", scene.wall_index, 1.0, np.inf)
    return float(scene.refractive_index) / float(scene.wall_index)


def _table(given: FloatArray | None, name: str, rows: int) -> FloatArray:
    """A table over cosines, (rows, n), or (rows, 0) where the scene has none."""
    if given is None:
        return np.empty((rows, 0))
    table = np.ascontiguousarray(given, dtype=np.float64)
    if table.ndim != 2 or table.shape[0] != rows or table.shape[1] < 2:
        raise InputError(f"{name}: shape {table.shape}, needs ({rows}, n) with n >= 2 cosines from 0 to 1")
    return table


def _lowered_patterns(scene: OpticalScene) -> FloatArray:
    radiance = _table(scene.emitter_pattern, "emitter_pattern", len(scene.emitter_wall))
    if not radiance.size:
        return radiance
    for i, row in enumerate(radiance):
        if np.isnan(row).all():
            continue
        if not np.isfinite(row).all() or row.min() < 0.0:
            raise InputError(f"emitter_pattern[{i}]: a radiance is negative or not finite; give numbers >= 0")
        power = float(pattern_shares(row[None])[0, -1])
        if abs(power - 1.0) > POWER_TOLERANCE:
            raise InputError(f"emitter_pattern[{i}]: radiates {power:.7g} of the unit power; scale it to 1")
    return radiance


def _lowered_responses(scene: OpticalScene) -> FloatArray:
    response = _table(scene.receiver_response, "receiver_response", len(scene.receiver_wall))
    for i, row in enumerate(response):
        if row.size and not ((row >= 0.0) & (row <= 1.0)).all():
            raise InputError(f"receiver_response[{i}]: {row.min():g} to {row.max():g} must lie within 0 to 1")
    return response


def _require(name: str, value: float, low: float, high: float, *, open_low: bool = False) -> None:
    """Refuse a number outside its range, NaN and infinity."""
    if not (np.isfinite(value) and low <= value <= high and not (open_low and value == low)):
        sign = ">" if open_low else ">="
        limit = f"{sign} {low:g}" + ("" if np.isinf(high) else f" and <= {high:g}")
        raise InputError(f"{name}: {value:g} must be {limit}")


def _check_patches(scene: OpticalScene, kind: str) -> None:
    """Refuse emitters or receivers that are not rectangles on a wall of the block."""
    walls, patches = np.asarray(getattr(scene, f"{kind}_wall")), np.asarray(getattr(scene, f"{kind}_patch"))
    if walls.ndim != 1 or patches.shape != (walls.size, 4):
        raise InputError(f"{kind}_patch: shape {patches.shape}, needs ({walls.size}, 4)")
    for i, (wall, patch) in enumerate(zip(walls, patches, strict=True)):
        name = f"{kind}_patch[{i}]"
        if wall not in (0, 1, 2, 3):
            raise InputError(f"{kind}_wall[{i}]: {wall} is no wall; south 0, east 1, north 2, west 3")
        if not np.isfinite(patch).all() or patch[2] <= 0.0 or patch[3] <= 0.0:
            raise InputError(f"{name}: {patch.tolist()} must be finite, with half sizes > 0 mm")
        run = scene.length_mm if wall in (0, 2) else scene.width_mm
        if patch[0] - patch[2] < 0.0 or patch[0] + patch[2] > run:
            raise InputError(
                f"{name}: spans {patch[0] - patch[2]:g} to {patch[0] + patch[2]:g} mm along a wall of"
                f" {run:g} mm; move it along the wall"
            )
        if patch[1] - patch[3] < 0.0:
            raise InputError(f"{name}: reaches {patch[3] - patch[1]:g} mm below the bottom; raise it")


@njit()
def inward_normal(face: int) -> tuple[float, float, float]:
    """Unit normal of a wall (0-3) or the bottom (4) that points into the elastomer."""
    if face == 0:
        return 0.0, 1.0, 0.0
    if face == 1:
        return -1.0, 0.0, 0.0
    if face == 2:
        return 0.0, -1.0, 0.0
    if face == 3:
        return 1.0, 0.0, 0.0
    return 0.0, 0.0, 1.0


@njit(forceinline=True)
def emission_point(scene: Scene, emitter: int, u: float, v: float) -> tuple[float, float, float]:
    """A point of an emitter's rectangle; u, v in [0, 1)."""
    along, height, half_width, half_height = scene.emitter_patch[emitter]
    along += (2.0 * u - 1.0) * half_width
    height += (2.0 * v - 1.0) * half_height
    wall = scene.emitter_wall[emitter]
    if wall == 0:
        return along, 0.0, height
    if wall == 1:
        return scene.length, along, height
    if wall == 2:
        return along, scene.width, height
    return 0.0, along, height


@njit(forceinline=True)
def face_hit(
    scene: Scene, x: float, y: float, z: float, dx: float, dy: float, dz: float
) -> tuple[float, int]:
    """Distance to the nearest wall or the bottom, and which; walls go up without end."""
    best, face = math.inf, -1
    if dx > 0.0 and (scene.length - x) / dx < best:
        best, face = (scene.length - x) / dx, 1
    if dx < 0.0 and -x / dx < best:
        best, face = -x / dx, 3
    if dy > 0.0 and (scene.width - y) / dy < best:
        best, face = (scene.width - y) / dy, 2
    if dy < 0.0 and -y / dy < best:
        best, face = -y / dy, 0
    if dz < 0.0 and -z / dz < best:
        best, face = -z / dz, 4
    return max(best, 0.0), face


@njit(forceinline=True)
def receiver_at(scene: Scene, wall: int, x: float, y: float, z: float) -> int:
    """The receiver that covers a point of a wall below the undisturbed top, or -1."""
    along = x if wall == 0 or wall == 2 else y
    if z <= scene.height:
        for k in range(scene.receiver_wall.shape[0]):
            if (
                scene.receiver_wall[k] == wall
                and abs(along - scene.receiver_patch[k, 0]) <= scene.receiver_patch[k, 2]
                and abs(z - scene.receiver_patch[k, 1]) <= scene.receiver_patch[k, 3]
            ):
                return k
    return -1
