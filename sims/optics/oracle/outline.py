"""A pad's outline in plan: its walls as rows, how far each runs, and what no form may be."""

from __future__ import annotations

import math

import numpy as np

from design.arrays import FloatArray
from design.errors import InputError
from sims.optics.oracle.heights import REACH_SHARE
from sims.optics.scene.optical_scene import OpticalScene
from sims.optics.scene.pad_form import PadForm

UNIT_TOLERANCE = 1e-9
"""Rounding of unit vectors and of places that lie on a wall [-, mm]."""
BOX_TOLERANCE_MM = 1e-6
ROUND_POINTS = 3600
"""Points of a round wall; between two of them the wall stands out by 4e-7 of its radius."""


def rectangle_walls(length_mm: float, width_mm: float) -> FloatArray:
    """(4, 6) walls of a rectangle from 0, 0: south, east, north, west, as rows of a form."""
    return np.array(
        [
            (0.0, 0.0, 1.0, 0.0, 0.0, -1.0),
            (length_mm, 0.0, 0.0, 1.0, 1.0, 0.0),
            (0.0, width_mm, 1.0, 0.0, 0.0, 1.0),
            (0.0, 0.0, 0.0, 1.0, -1.0, 0.0),
        ]
    )


def wall_runs(walls: FloatArray, round_wall: FloatArray) -> FloatArray:
    """(k, 2) where each flat wall starts and ends along its tangent, cut by all others [mm]; start after end: nowhere.

    walls (k, 6), round_wall (3,) as in a form.
    """
    runs = np.empty((len(walls), 2))
    for number, (x, y, tx, ty, _, _) in enumerate(walls):
        low, high = -math.inf, math.inf
        for other, (ox, oy, _, _, nx, ny) in enumerate(walls):
            beyond, growth = nx * (x - ox) + ny * (y - oy), nx * tx + ny * ty
            if growth > UNIT_TOLERANCE:
                high = min(high, -beyond / growth)
            elif growth < -UNIT_TOLERANCE:
                low = max(low, -beyond / growth)
            elif other != number and beyond > UNIT_TOLERANCE:
                low, high = math.inf, -math.inf
        cx, cy, radius = round_wall
        if radius > 0.0:
            px, py = x - cx, y - cy
            middle = px * tx + py * ty
            gap = middle * middle - (px * px + py * py - radius * radius)
            half = math.sqrt(gap) if gap > 0.0 else -math.inf
            low, high = max(low, -middle - half), min(high, -middle + half)
        runs[number] = low, high
    return runs


def beyond_walls_mm(form: PadForm, places_mm: FloatArray) -> FloatArray:
    """(..., k + 1) how far (..., 2) places lie outside each flat wall and the round one, negative inside [mm]."""
    places, walls = np.asarray(places_mm, dtype=np.float64), np.asarray(form.walls, dtype=np.float64)
    flat = np.sum((places[..., None, :] - walls[:, :2]) * walls[:, 4:], axis=-1)
    cx, cy, radius = form.round_wall
    out = np.hypot(places[..., 0] - cx, places[..., 1] - cy) - radius
    return np.concatenate([flat, np.where(radius > 0.0, out, -np.inf)[..., None]], axis=-1)


def outline_mm(form: PadForm) -> FloatArray:
    """(n, 2) ends of the flat walls and points of the round one, which together enclose the plan [mm]."""
    walls, (cx, cy, radius) = np.asarray(form.walls, dtype=np.float64), form.round_wall
    runs = wall_runs(walls, form.round_wall)
    ends = walls[:, None, :2] + runs[:, :, None] * walls[:, None, 2:4]
    angle = np.linspace(0.0, 2.0 * math.pi, ROUND_POINTS, endpoint=False)
    ring = np.stack([cx + radius * np.cos(angle), cy + radius * np.sin(angle)], axis=-1)
    if radius > 0.0:
        return np.vstack(
            [ends.reshape(-1, 2), ring[beyond_walls_mm(form, ring).max(axis=-1) <= UNIT_TOLERANCE]]
        )
    return ends.reshape(-1, 2)


def check_form(scene: OpticalScene, form: PadForm) -> None:
    """Refuse a form that encloses no pad, or whose crown does not reach over it."""
    _check_numbers(form)
    for number, (low, high) in enumerate(
        wall_runs(np.asarray(form.walls, dtype=np.float64), form.round_wall)
    ):
        if not high - low > UNIT_TOLERANCE:
            raise InputError(
                f"form.walls[{number}]: nothing of it bounds the pad; take it out, or turn the walls' normals outward"
            )
        if not (np.isfinite(low) and np.isfinite(high)):
            raise InputError(
                f"form.walls[{number}]: runs on without end; give the walls that close the outline"
            )
    outline = outline_mm(form)
    low, high = outline.min(axis=0), outline.max(axis=0)
    for axis, first, last, size in zip("xy", low, high, (scene.length_mm, scene.width_mm), strict=True):
        if first < -BOX_TOLERANCE_MM or last > size + BOX_TOLERANCE_MM:
            name = "length_mm" if axis == "x" else "width_mm"
            raise InputError(
                f"form: the plan runs from {axis} = {first:g} to {last:g} mm, outside its box of 0 to {size:g} mm;"
                f" move the walls or correct {name}"
            )
    if beyond_walls_mm(form, np.asarray(form.top.apex_mm)).max() > UNIT_TOLERANCE:
        raise InputError(
            f"form.top.apex_mm: {tuple(form.top.apex_mm)} lies outside the walls; it is the middle of the pad, and the"
            " walls' normals point away from it"
        )
    if not form.top.is_flat:
        _check_crown(scene, form, outline)


def _check_numbers(form: PadForm) -> None:
    walls, round_wall = (
        np.asarray(form.walls, dtype=np.float64),
        np.asarray(form.round_wall, dtype=np.float64),
    )
    if walls.ndim != 2 or walls.shape[1] != 6:
        raise InputError(f"form.walls: shape {walls.shape}, needs (k, 6): x, y, tx, ty, nx, ny")
    if round_wall.shape != (3,) or not np.isfinite(round_wall).all() or round_wall[2] < 0.0:
        raise InputError(f"form.round_wall: {round_wall.tolist()}, needs finite x, y and a radius >= 0 mm")
    if round_wall[2] == 0.0 and len(walls) < 3:
        raise InputError(
            f"form.walls: {len(walls)} flat walls and no round one enclose nothing; give at least 3"
        )
    for number, row in enumerate(walls):
        if not np.isfinite(row).all():
            raise InputError(f"form.walls[{number}]: {row.tolist()} must be finite")
        for name, vector in (("tangent", row[2:4]), ("normal", row[4:])):
            size = float(np.hypot(*vector))
            if abs(size - 1.0) > UNIT_TOLERANCE:
                raise InputError(
                    f"form.walls[{number}]: its {name} has the length {size:.10g}; scale it to 1"
                )
        if abs(float(row[2:4] @ row[4:])) > UNIT_TOLERANCE:
            raise InputError(
                f"form.walls[{number}]: tangent and normal are not at right angles; turn one of them"
            )
    kx, ky = form.top.kx, form.top.ky
    if not (0.0 <= kx < np.inf and 0.0 <= ky < np.inf and (kx == ky or 0.0 in (kx, ky))):
        raise InputError(
            f"form.top: curvatures of {kx:g} and {ky:g} 1/mm must be >= 0, and equal or one of them 0"
        )
    if np.shape(form.top.apex_mm) != (2,) or not np.isfinite(form.top.apex_mm).all():
        raise InputError(f"form.top.apex_mm: {form.top.apex_mm}, needs finite x and y")


def _check_crown(scene: OpticalScene, form: PadForm, outline: FloatArray) -> None:
    used = np.array([form.top.kx > 0.0, form.top.ky > 0.0])
    reach = float(np.hypot(*((outline - form.top.apex_mm) * used).T).max())
    if reach > REACH_SHARE * form.top.radius_mm:
        raise InputError(
            f"form.top: a crown of {form.top.radius_mm:g} mm over a plan that reaches {reach:g} mm from the apex,"
            f" needs >= {reach / REACH_SHARE:g} mm; flatten the crown"
        )
    rim = float(form.top.height_mm(outline[:, 0], outline[:, 1]).min())
    if rim <= 0.0:
        raise InputError(
            f"form: the rim of the crown lies {-rim:g} mm below the bottom, with a height_mm of {scene.height_mm:g} mm"
            " at the apex; raise it or flatten the crown"
        )
