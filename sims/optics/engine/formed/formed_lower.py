"""Lower a pad with a form, and presses on it, to the arrays that the kernels read."""

from __future__ import annotations

import numpy as np

from sims.optics.engine.formed.formed_top import CYLINDER, FLAT, NUMBERS, SPHERE, FormedTop, empty_rows
from sims.optics.scene.optical_scene import FloatArray, OpticalScene
from sims.optics.scene.pad_form import PadForm
from sims.optics.surface.curves import (
    CONTACT_R,
    OUTER_R,
    PIECES,
    REACH,
    ROW,
    SKIRT_R,
    check_curve,
    lower_curve,
)
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
        rows, radii = _lowered(press, mean, scene.height_mm)
        numbers[3:] = press.depth_mm, *radii
    return FormedTop(origin, np.ascontiguousarray(axes), numbers, rows)


def _crown_numbers(form: PadForm) -> tuple[float, float, float]:
    if not form.is_crowned:
        return FLAT, 0.0, 0.0
    radius = form.crown_radius_mm
    return (SPHERE, radius, radius) if form.crown_axis == "none" else (CYLINDER, radius, 2.0 * radius)


def _lowered(press: Indentation, mean_mm: float, clear_mm: float) -> tuple[FloatArray, tuple[float, ...]]:
    """(1, n) row of the radial table of d; outer, contact and skirt radius [mm]."""
    check_curve(press, clear_mm)
    numbers, table, _ = lower_curve(press, 0.0, mean_mm)
    row = np.zeros(ROW)
    row[: len(numbers)] = numbers
    row[REACH:PIECES] = table.reach2
    row[PIECES:] = table.pieces.ravel()
    return row[None], (numbers[OUTER_R], numbers[CONTACT_R], numbers[SKIRT_R])
