"""Patches of walls and bottom of a disc or crowned pad: their layout, areas and weights."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from optopad.design.arrays import BoolArray, FloatArray
from optopad.sims.optics.engine.general.deposits import TIP_PATCHES
from optopad.sims.optics.scene.optical_scene import OpticalScene

PATCH_MM = 2.0
LEAST_TURNS = 24
SAMPLES = 50
"""Number of slices into which a bottom patch, or the range of directions of a wall patch, is cut to sum its area."""


@dataclass(frozen=True, kw_only=True)
class PatchLayout:
    """Patches on bottom, walls and contact, as kernels read them.

    Attributes
    ----------
    numbers : (8,) middle x, y of the pad in plan [mm]; bottom patches per mm, and their numbers of columns and rows;
        number of directions of wall patches, number of heights, heights per mm
    weight : (patch,) reflectance divided by area [1/mm²]: bottom, then walls, then the contact's patches, which have 0
        here since they change with the press
    """

    numbers: FloatArray
    weight: FloatArray


def patch_layout(
    scene: OpticalScene, walls: FloatArray, arcs: FloatArray, patch_mm: float = PATCH_MM
) -> PatchLayout:
    """Layout of patches for a disc or crowned pad."""
    form = scene.form
    assert form is not None
    columns, rows = (max(int(np.ceil(size / patch_mm)), 1) for size in (scene.length_mm, scene.width_mm))
    turns = max(LEAST_TURNS, int(np.pi * (scene.length_mm + scene.width_mm) / 2.0 / patch_mm))
    levels = max(int(np.ceil(scene.height_mm / patch_mm)), 1)
    middle = np.array([scene.length_mm / 2.0, scene.width_mm / 2.0])
    bottom = _bottom_areas(columns, rows, patch_mm, walls, arcs)
    side = _wall_areas(scene, walls, arcs, middle, turns, levels)
    reflectance = np.concatenate(
        [np.full(bottom.size, scene.bottom_reflectance), np.full(side.size, scene.wall_reflectance)]
    )
    area = np.concatenate([bottom.ravel(), side.ravel()])
    weight = np.divide(reflectance, area, out=np.zeros(len(area)), where=area > 0.0)
    numbers = np.array([*middle, 1.0 / patch_mm, columns, rows, turns, levels, levels / scene.height_mm])
    return PatchLayout(numbers=numbers, weight=np.concatenate([weight, np.zeros(TIP_PATCHES)]))


def is_in_plan(x: FloatArray, y: FloatArray, walls: FloatArray, arcs: FloatArray) -> BoolArray:
    """Mask of the points (x, y) that are inside the pad in plan."""
    inside = np.ones(np.shape(x), dtype=np.bool_)
    for nx, ny, level in walls:
        inside &= nx * x + ny * y <= level
    for arc in arcs:
        away, is_here = from_arc(arc, x, y)
        inside &= ~is_here | (away <= arc[2])
    return inside


def from_arc(arc: FloatArray, x: FloatArray, y: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Distances of points from the axis of a round wall `arc` (6,) [mm], and mask of the points in its sector."""
    cx, cy, _, ux, uy, cosine = arc
    away = np.hypot(x - cx, y - cy)
    return away, np.asarray((x - cx) * ux + (y - cy) * uy >= cosine * away)


def border_mm(way: FloatArray, start_mm: FloatArray, walls: FloatArray, arcs: FloatArray) -> FloatArray:
    """(n, 2) points where lines from `start_mm` (2,) inside along `way` (n, 2) meet the pad's outline in plan [mm]."""
    reach = np.full(len(way), np.inf)
    for nx, ny, level in walls:
        toward = way @ (nx, ny)
        gap = np.full(len(way), level - start_mm @ (nx, ny))
        reach = np.minimum(reach, np.divide(gap, toward, out=np.full(len(way), np.inf), where=toward > 1e-9))
    for arc in arcs:
        from_axis = start_mm - arc[:2]
        along = way @ from_axis
        gap = along**2 - (from_axis @ from_axis - arc[2] ** 2)
        far = np.sqrt(np.maximum(gap, 0.0)) - along
        _, is_here = from_arc(arc, *(start_mm + far[:, None] * way).T)
        reach = np.where(is_here, np.minimum(reach, far), reach)
    return np.asarray(start_mm + reach[:, None] * way)


def _bottom_areas(
    columns: int, rows: int, patch_mm: float, walls: FloatArray, arcs: FloatArray
) -> FloatArray:
    """(columns, rows) areas of the bottom's patches inside the pad's outline [mm²], summed over slices across x."""
    x = (np.arange(columns * SAMPLES) + 0.5) * patch_mm / SAMPLES
    low, high = np.zeros(len(x)), np.full(len(x), rows * patch_mm)
    for nx, ny, level in walls:
        if abs(ny) < 1e-9:
            high = np.where(nx * x > level, low, high)
        elif ny > 0.0:
            high = np.minimum(high, (level - nx * x) / ny)
        else:
            low = np.maximum(low, (level - nx * x) / ny)
    for arc in arcs:
        half = np.sqrt(np.maximum(arc[2] ** 2 - (x - arc[0]) ** 2, 0.0))
        low = np.where(from_arc(arc, x, arc[1] - half)[1], np.maximum(low, arc[1] - half), low)
        high = np.where(from_arc(arc, x, arc[1] + half)[1], np.minimum(high, arc[1] + half), high)
    edges = np.arange(rows + 1) * patch_mm
    below = np.minimum(np.maximum(edges, low[:, None]), np.maximum(high, low)[:, None])
    return np.asarray(np.diff(below, axis=1).reshape(columns, SAMPLES, rows).sum(axis=1) * patch_mm / SAMPLES)


def _wall_areas(
    scene: OpticalScene,
    walls: FloatArray,
    arcs: FloatArray,
    middle: FloatArray,
    turns: int,
    levels: int,
) -> FloatArray:
    """(turns, levels) areas of the walls below the untouched top [mm²], by direction from the middle and height."""
    form = scene.form
    assert form is not None
    turn = np.linspace(-np.pi, np.pi, turns * SAMPLES + 1)
    way = np.column_stack([np.cos(turn), np.sin(turn)])
    place = border_mm(way, middle, walls, arcs)
    step = np.hypot(*np.diff(place, axis=0).T)
    between = (place[1:] + place[:-1]) / 2.0
    top = form.top.height_mm(between[:, 0], between[:, 1])
    high = scene.height_mm / levels
    covered = np.clip(top[:, None] - high * np.arange(levels), 0.0, high)
    return np.asarray((step[:, None] * covered).reshape(turns, SAMPLES, levels).sum(axis=1))
