"""A pad's outline in plan: its walls as rows, how far each runs, and what no form may be."""

from __future__ import annotations

import math

import numpy as np

from design.arrays import BoolArray, FloatArray
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


def wall_runs(walls: FloatArray, arcs: FloatArray) -> FloatArray:
    """(k, 2) where each flat wall starts and ends along its tangent, cut by all others [mm]; start after end: nowhere.

    walls (k, 6), arcs (m, 6) as in a form.
    """
    runs = np.empty((len(walls), 2))
    for number, (x, y, tx, ty, _, _) in enumerate(walls):
        cuts = np.array([*_line_cuts(walls, x, y, tx, ty), *_arc_cuts(arcs, x, y, tx, ty)])
        # the pad is convex: its wall runs from the first to the last cut that lies in it, or on from there
        kept = cuts[_lies_in(walls, arcs, x, y, tx, ty, cuts)]
        low, high = kept.min(initial=math.inf), kept.max(initial=-math.inf)
        if len(kept):
            beyond = _lies_in(walls, arcs, x, y, tx, ty, np.array([low - 1.0, high + 1.0]))
            low, high = (-math.inf if beyond[0] else low), (math.inf if beyond[1] else high)
        runs[number] = low, high
    return runs


def _line_cuts(walls: FloatArray, x: float, y: float, tx: float, ty: float) -> list[float]:
    """Where a line crosses flat walls, along its tangent [mm]."""
    cuts = []
    for ox, oy, _, _, nx, ny in walls:
        beyond, growth = nx * (x - ox) + ny * (y - oy), nx * tx + ny * ty
        if abs(growth) > UNIT_TOLERANCE:
            cuts.append(-beyond / growth)
    return cuts


def _arc_cuts(arcs: FloatArray, x: float, y: float, tx: float, ty: float) -> list[float]:
    """Where a line crosses circles, or comes nearest to one that it passes, along its tangent [mm]."""
    cuts = []
    for cx, cy, radius, *_ in arcs:
        px, py = x - cx, y - cy
        middle = px * tx + py * ty
        gap = middle * middle - (px * px + py * py - radius * radius)
        half = math.sqrt(max(gap, 0.0))
        cuts += [-middle - half, -middle, -middle + half]
    return cuts


def _lies_in(
    walls: FloatArray, arcs: FloatArray, x: float, y: float, tx: float, ty: float, along: FloatArray
) -> BoolArray:
    """(n,) whether places along a line lie in the pad or on its border."""
    places = np.stack([x + along * tx, y + along * ty], axis=-1)
    beyond = _beyond_mm(walls, arcs, places)
    return np.asarray(beyond.max(axis=-1, initial=-math.inf) <= UNIT_TOLERANCE)


def _beyond_mm(walls: FloatArray, arcs: FloatArray, places: FloatArray) -> FloatArray:
    flat = np.sum((places[..., None, :] - walls[:, :2]) * walls[:, 4:], axis=-1)
    off = places[..., None, :] - arcs[:, :2]
    away = np.hypot(off[..., 0], off[..., 1])
    is_here = np.sum(off * arcs[:, 3:5], axis=-1) >= arcs[:, 5] * away
    return np.concatenate([flat, np.where(is_here, away - arcs[:, 2], -np.inf)], axis=-1)


def beyond_walls_mm(form: PadForm, places_mm: FloatArray) -> FloatArray:
    """(..., k + m) how far (..., 2) places lie outside each flat wall and each round one, negative inside [mm]."""
    return _beyond_mm(*form_rows(form), np.asarray(places_mm, dtype=np.float64))


def form_rows(form: PadForm) -> tuple[FloatArray, FloatArray]:
    """Walls (k, 6) and arcs (m, 6) of a form."""
    walls, arcs = (np.ascontiguousarray(rows, dtype=np.float64) for rows in (form.walls, form.arcs))
    return walls, arcs


def outline_mm(form: PadForm) -> FloatArray:
    """(n, 2) ends of the flat walls and points of the round ones, which together enclose the plan [mm]."""
    walls, arcs = form_rows(form)
    ends = walls[:, None, :2] + wall_runs(walls, arcs)[:, :, None] * walls[:, None, 2:4]
    angle = np.linspace(0.0, 2.0 * math.pi, ROUND_POINTS, endpoint=False)
    around = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    found = [ends.reshape(-1, 2)]
    for arc in arcs:
        ring = arc[:2] + arc[2] * around[around @ arc[3:5] >= arc[5]]
        found.append(ring[beyond_walls_mm(form, ring).max(axis=-1) <= UNIT_TOLERANCE])
    return np.vstack(found)


def check_form(scene: OpticalScene, form: PadForm) -> None:
    """Refuse a form that encloses no pad, or whose crown does not reach over it."""
    _check_numbers(form)
    for number, (low, high) in enumerate(wall_runs(*form_rows(form))):
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
    walls, arcs = form_rows(form)
    if walls.ndim != 2 or walls.shape[1] != 6:
        raise InputError(f"form.walls: shape {walls.shape}, needs (k, 6): x, y, tx, ty, nx, ny")
    if arcs.ndim != 2 or arcs.shape[1] != 6:
        raise InputError(f"form.arcs: shape {arcs.shape}, needs (m, 6): x, y, radius, ux, uy, cosine")
    for number, row in enumerate(arcs):
        size = float(np.hypot(*row[3:5]))
        is_sector = row[5] == -1.0 if size == 0.0 else abs(size - 1.0) <= UNIT_TOLERANCE
        if not np.isfinite(row).all() or row[2] <= 0.0 or not is_sector:
            raise InputError(
                f"form.arcs[{number}]: {row.tolist()}, needs finite x, y, a radius > 0 mm, and a unit vector with the"
                " cosine of half the sector's turn, or 0, 0, -1 for a whole circle"
            )
    if not len(arcs) and len(walls) < 3:
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
