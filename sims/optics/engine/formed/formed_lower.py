"""Lower a pad with a form, and presses on it, to the arrays that the kernels read."""

from __future__ import annotations

import numpy as np

from design.errors import InputError
from sims.optics.engine.formed.formed_top import CYLINDER, FLAT, NUMBERS, SPHERE, FormedTop, empty_rows
from sims.optics.scene.optical_scene import FloatArray, OpticalScene
from sims.optics.scene.pad_form import PadForm
from sims.optics.surface.curves import (
    APEX_MM,
    COLUMNS,
    FIELD_COLUMNS,
    MAX_SLOPE,
    MIN_KNOT_STEP_MM,
    OFFSET,
    OUTER_2,
    ROW,
    SCALE,
    SPHERE_2,
    SPHERE_Z,
    START,
    TIP_2,
    _with_tail,
)
from sims.optics.surface.radial_table import LEVELS, radial_table
from sims.press.indentation import Indentation


def windows_of(scene: OpticalScene, kind: str) -> FloatArray:
    """(n, 12 + table) windows: centre, unit tangent, half sizes (clipped under the crown), outward normal, order, area
    as mounted, wall; then the radiance or response table.
    """
    form = scene.form
    assert form is not None
    walls = np.asarray(getattr(scene, f"{kind}_wall"))
    patches = np.asarray(getattr(scene, f"{kind}_patch"))
    table = scene.emitter_pattern if kind == "emitter" else scene.receiver_response
    rows = []
    for k, (wall, (along, z, half_u, half_v)) in enumerate(zip(walls, patches, strict=True)):
        x, y, tx, ty, nx, ny = form.walls[wall]
        ends = [(x + (along + s) * tx, y + (along + s) * ty) for s in (-half_u, 0.0, half_u)]
        top = min(float(form.top_mm(*end, scene.height_mm)) for end in ends)
        high = min(z + half_v, top)
        low = z - half_v
        order = float(scene.emitter_order[k]) if kind == "emitter" else 1.0
        values = np.empty(0)
        if table is not None:
            values = np.asarray(table[k]) / (1.0 if kind == "emitter" else np.pi)
            order = -1.0 if np.isfinite(values).all() else order
            values = np.nan_to_num(values)
        centre = (x + along * tx, y + along * ty, (low + high) / 2)
        rows.append(
            np.concatenate(
                [
                    [*centre, tx, ty, half_u, max((high - low) / 2, 0.0), nx, ny, order],
                    [4.0 * half_u * half_v, wall],
                    values,
                ]
            )
        )
    return np.array(rows)


def walls_of(scene: OpticalScene) -> tuple[FloatArray, FloatArray]:
    """(k, 3) outward normals and levels of the flat walls, and (3,) round wall."""
    form = scene.form
    assert form is not None
    walls = np.asarray(form.walls, dtype=np.float64).reshape(-1, 6)
    level = walls[:, 0] * walls[:, 4] + walls[:, 1] * walls[:, 5]
    return np.column_stack([walls[:, 4:6], level]), np.asarray(form.round_wall, dtype=np.float64)


def formed_top(scene: OpticalScene, centre_mm: FloatArray, press: Indentation | None) -> FormedTop:
    """The top of one state; None is untouched, in the frame of the apex."""
    form = scene.form
    assert form is not None
    place = form.apex_mm if press is None else (float(centre_mm[0]), float(centre_mm[1]))
    origin, axes = form.press_frame(*place, scene.height_mm)
    kind, radius, mean = _crown_numbers(form)
    numbers = np.zeros(NUMBERS)
    numbers[:3] = kind, radius, mean
    rows = empty_rows()
    if press is not None:
        rows, outer, contact = _lowered(press, mean)
        numbers[3:] = press.depth_mm, outer, contact, -press.depth_mm
    return FormedTop(origin, np.ascontiguousarray(axes), numbers, rows)


def _crown_numbers(form: PadForm) -> tuple[float, float, float]:
    if not form.is_crowned:
        return FLAT, 0.0, 0.0
    radius = form.crown_radius_mm
    return (SPHERE, radius, radius) if form.crown_axis == "none" else (CYLINDER, radius, 2.0 * radius)


def _lowered(press: Indentation, mean_mm: float) -> tuple[FloatArray, float, float]:
    """(1, n) row of the radial table of d, its outer radius, and the contact radius."""
    radius = np.asarray(press.radius_mm, dtype=np.float64)
    height = np.asarray(press.height_mm, dtype=np.float64)
    if not press.is_hemisphere:
        raise InputError("indentation: on a disc or a crown a hemisphere alone is traced")
    tip = press.tip_radius_mm
    start = float(min(press.contact_radius_mm, tip * MAX_SLOPE / np.hypot(1.0, MAX_SLOPE)))
    start = max(start, APEX_MM)

    def mean_fall(r: float) -> float:
        return 0.0 if mean_mm == 0.0 else r * r / (mean_mm + np.sqrt(mean_mm**2 - r * r))

    def tip_rise(r: float) -> float:
        return -press.depth_mm + tip - float(np.sqrt(max(tip**2 - r * r, 0.0))) + mean_fall(r)

    slope = start / np.sqrt(tip**2 - start**2)
    if mean_mm > 0.0:
        slope += start / np.sqrt(mean_mm**2 - start**2)
    knots_r, knots_h, given = [start], [tip_rise(start)], [slope]
    for r, h in zip(radius, height, strict=True):
        if r <= start + MIN_KNOT_STEP_MM:
            continue
        if r < tip:
            h = min(h, tip_rise(float(r)))
        placed = max(r, knots_r[-1] + MIN_KNOT_STEP_MM, knots_r[-1] + abs(h - knots_h[-1]) / MAX_SLOPE)
        knots_r.append(float(placed))
        knots_h.append(float(h))
        given.append(np.nan)
    knots, heights, slopes = _with_tail(np.array(knots_r), np.array(knots_h), np.array(given))
    table = radial_table(knots, heights, slopes, top_mm=0.0, lowest_mm=-press.depth_mm)
    row = np.zeros(ROW)
    row[SPHERE_Z], row[SPHERE_2], row[TIP_2] = tip - press.depth_mm, start**2, tip**2
    row[OUTER_2], row[SCALE], row[OFFSET], row[START] = knots[-1] ** 2, table.scale, table.offset, table.start
    begin = COLUMNS + FIELD_COLUMNS
    row[begin : begin + LEVELS] = table.reach2
    row[begin + LEVELS :] = table.pieces.ravel()
    return row[None], float(knots[-1]), start
