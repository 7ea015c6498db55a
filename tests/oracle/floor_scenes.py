"""Pads with emitters and receivers on the floor, that the oracle's tests and the validation tables share."""

from __future__ import annotations

from typing import Any

import numpy as np

from optopad.sims.optics.scene.optical_scene import OpticalScene, PadForm
from tests.oracle.form_scenes import block, rectangle_form

LENGTH_MM, WIDTH_MM, CLEAR_MM = 20.0, 16.0, 4.0
CROWN_MM = 40.0
"""Radius of the crown of `crowned_floor_scene`."""
FLUSH = 0.0, 0.0, 0.0
"""Centre height [mm], tilt and turn [deg] of a face that looks up from the bottom."""
Face = tuple[float, float, float, float, float, float, float]
"""Face on the floor: centre x, y, z [mm]; tilt, turn [deg]; half width, half height [mm]."""


def on_floor(emitters: list[Face], receivers: list[Face]) -> dict[str, Any]:
    """Fields of an `OpticalScene` with these faces and no others."""
    fields: dict[str, Any] = {"emitter_order": np.ones(len(emitters))}
    for name, faces in (("emitter", emitters), ("receiver", receivers)):
        rows = np.array(faces, dtype=np.float64).reshape(-1, 7)
        fields[f"{name}_wall"] = np.full(len(rows), -1, dtype=np.int64)
        fields[f"{name}_patch"] = np.column_stack([np.zeros(len(rows)), rows[:, 2], rows[:, 5:]])
        fields[f"{name}_pose"] = np.column_stack([rows[:, :3], np.radians(rows[:, 3:5])])
    return fields


EMITTERS: list[Face] = [(6.0, 5.0, *FLUSH, 0.5, 0.4), (14.0, 11.0, *FLUSH, 0.5, 0.4)]
RECEIVERS: list[Face] = [(14.0, 5.0, *FLUSH, 1.1, 0.9), (6.0, 11.0, *FLUSH, 1.1, 0.9)]
TILTED_EMITTERS: list[Face] = [(4.0, 8.0, 1.2, 60.0, 0.0, 0.5, 0.4), (10.0, 3.0, 1.0, 90.0, 90.0, 0.5, 0.4)]
TILTED_RECEIVERS: list[Face] = [
    (16.0, 8.0, 1.4, 60.0, 180.0, 1.1, 0.9),
    (10.0, 13.0, 1.2, 90.0, 270.0, 1.1, 0.9),
]
"""A pair tilted by 60 degrees that looks along x, and a level pair that looks along y."""


def floor_scene(
    finish: str = "bare",
    reflectance: float = 0.0,
    *,
    emitters: list[Face] | None = None,
    receivers: list[Face] | None = None,
    form: PadForm | None = None,
    size_mm: tuple[float, float] = (LENGTH_MM, WIDTH_MM),
    **changes: Any,
) -> OpticalScene:
    """A rectangle, 4 mm high and flat unless another form is given, with faces on its floor: by default flush ones.

    size_mm : size in plan of the box around the pad
    """
    fields = on_floor(
        EMITTERS if emitters is None else emitters, RECEIVERS if receivers is None else receivers
    )
    fields |= {"height_mm": CLEAR_MM, "top_finish": finish, "top_reflectance": reflectance}
    return block(rectangle_form(*size_mm) if form is None else form, size_mm, **(fields | changes))


def crowned_floor_scene(finish: str = "bare", reflectance: float = 0.0, **changes: Any) -> OpticalScene:
    """The flush faces under a cylinder of radius `CROWN_MM`, straight along x."""
    return floor_scene(
        finish, reflectance, form=rectangle_form(LENGTH_MM, WIDTH_MM, CROWN_MM, "x"), **changes
    )
