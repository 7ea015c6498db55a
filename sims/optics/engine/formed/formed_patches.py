"""Patches of a disc's or crowned pad's walls and bottom: their numbers for kernels, their areas, their weights."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from design.arrays import BoolArray, FloatArray
from sims.optics.engine.formed.formed_deposits import TIP_PATCHES
from sims.optics.scene.optical_scene import OpticalScene

PATCH_MM = 2.0
LEAST_TURNS = 24
SAMPLES = 50
"""Slices of a bottom patch, and of a bin of directions, that areas are summed over."""


@dataclass(frozen=True, kw_only=True)
class PatchLayout:
    """Patches as kernels read them.

    Attributes
    ----------
    numbers : (8,) middle x, y of the plan [mm], bottom patches per mm, their columns and rows, wall bins of direction,
        levels of height, levels per mm
    weight : (patch,) reflectance over area [1/mm2]: bottom, walls, and the contact's, which change with the press (0)
    """

    numbers: FloatArray
    weight: FloatArray


def patch_layout(
    scene: OpticalScene, walls: FloatArray, round_wall: FloatArray, patch_mm: float = PATCH_MM
) -> PatchLayout:
    """The patches of a scene with a form."""
    form = scene.form
    assert form is not None
    columns, rows = (max(int(np.ceil(size / patch_mm)), 1) for size in (scene.length_mm, scene.width_mm))
    turns = max(LEAST_TURNS, int(np.pi * (scene.length_mm + scene.width_mm) / 2.0 / patch_mm))
    levels = max(int(np.ceil(scene.height_mm / patch_mm)), 1)
    middle = np.array([scene.length_mm / 2.0, scene.width_mm / 2.0])
    bottom = _bottom_areas(columns, rows, patch_mm, walls, round_wall)
    side = _wall_areas(scene, walls, round_wall, middle, turns, levels)
    reflectance = np.concatenate(
        [np.full(bottom.size, scene.bottom_reflectance), np.full(side.size, scene.wall_reflectance)]
    )
    area = np.concatenate([bottom.ravel(), side.ravel()])
    weight = np.divide(reflectance, area, out=np.zeros(len(area)), where=area > 0.0)
    numbers = np.array([*middle, 1.0 / patch_mm, columns, rows, turns, levels, levels / scene.height_mm])
    return PatchLayout(numbers=numbers, weight=np.concatenate([weight, np.zeros(TIP_PATCHES)]))


def is_in_plan(x: FloatArray, y: FloatArray, walls: FloatArray, round_wall: FloatArray) -> BoolArray:
    """Whether places of the plan lie in the pad."""
    inside = np.ones(np.shape(x), dtype=np.bool_)
    for nx, ny, level in walls:
        inside &= nx * x + ny * y <= level
    if round_wall[2] > 0.0:
        inside &= np.hypot(x - round_wall[0], y - round_wall[1]) <= round_wall[2]
    return inside


def _bottom_areas(
    columns: int, rows: int, patch_mm: float, walls: FloatArray, round_wall: FloatArray
) -> FloatArray:
    """(columns, rows) areas within the plan [mm2]: slices across x, each cut where it leaves the convex plan."""
    x = (np.arange(columns * SAMPLES) + 0.5) * patch_mm / SAMPLES
    low, high = np.zeros(len(x)), np.full(len(x), rows * patch_mm)
    for nx, ny, level in walls:
        if abs(ny) < 1e-9:
            high = np.where(nx * x > level, low, high)
        elif ny > 0.0:
            high = np.minimum(high, (level - nx * x) / ny)
        else:
            low = np.maximum(low, (level - nx * x) / ny)
    if round_wall[2] > 0.0:
        half = np.sqrt(np.maximum(round_wall[2] ** 2 - (x - round_wall[0]) ** 2, 0.0))
        low, high = np.maximum(low, round_wall[1] - half), np.minimum(high, round_wall[1] + half)
    edges = np.arange(rows + 1) * patch_mm
    below = np.minimum(np.maximum(edges, low[:, None]), np.maximum(high, low)[:, None])
    return np.asarray(np.diff(below, axis=1).reshape(columns, SAMPLES, rows).sum(axis=1) * patch_mm / SAMPLES)


def _wall_areas(
    scene: OpticalScene,
    walls: FloatArray,
    round_wall: FloatArray,
    middle: FloatArray,
    turns: int,
    levels: int,
) -> FloatArray:
    """(turns, levels) areas of the walls below the untouched top, by direction from the middle [mm2]."""
    form = scene.form
    assert form is not None
    turn = np.linspace(-np.pi, np.pi, turns * SAMPLES + 1)
    way = np.column_stack([np.cos(turn), np.sin(turn)])
    reach = np.full(len(turn), round_wall[2] if round_wall[2] > 0.0 else np.inf)
    for nx, ny, level in walls:
        toward = way @ (nx, ny)
        with np.errstate(divide="ignore"):
            reach = np.where(toward > 1e-9, np.minimum(reach, (level - middle @ (nx, ny)) / toward), reach)
    place = middle + reach[:, None] * way
    step = np.hypot(*np.diff(place, axis=0).T)
    between = (place[1:] + place[:-1]) / 2.0
    top = form.top.height_mm(between[:, 0], between[:, 1])
    high = scene.height_mm / levels
    covered = np.clip(top[:, None] - high * np.arange(levels), 0.0, high)
    return np.asarray((step[:, None] * covered).reshape(turns, SAMPLES, levels).sum(axis=1))
