"""Lower a design to the arrays of an optical scene."""

from __future__ import annotations

import numpy as np

from design.cavity import PlacedPart, cavity_of
from design.properties import absorption_coefficient_per_mm, emitter_order, refractive_index
from design.spec import SensorDesign
from sims.optics.scene import FloatArray, IntArray, OpticalScene

WALL_NUMBERS = {"south": 0, "east": 1, "north": 2, "west": 3}


def scene_of(design: SensorDesign) -> OpticalScene:
    """The clear block with the active areas of all parts, in the order of the cavity's parts.

    Receivers are bare: what falls on the active area counts, whatever its angle.
    """
    cavity = cavity_of(design)
    surfaces = design.surfaces
    return OpticalScene(
        length_mm=cavity.length_mm,
        width_mm=cavity.width_mm,
        height_mm=cavity.clear_mm,
        refractive_index=refractive_index(design).value,
        absorption_per_mm=absorption_coefficient_per_mm(design),
        wall_reflectance=surfaces.wall_reflectance,
        bottom_reflectance=surfaces.bottom_reflectance,
        tip_reflectance=surfaces.tip_reflectance,
        emitter_wall=_walls(cavity.emitters),
        emitter_patch=_patches(cavity.emitters),
        emitter_order=np.array([emitter_order(part.part) for part in cavity.emitters]),
        receiver_wall=_walls(cavity.receivers),
        receiver_patch=_patches(cavity.receivers),
    )


def _walls(parts: tuple[PlacedPart, ...]) -> IntArray:
    return np.array([WALL_NUMBERS[part.wall] for part in parts], dtype=np.int64)


def _patches(parts: tuple[PlacedPart, ...]) -> FloatArray:
    rows = [(p.along_mm, p.height_mm, p.half_width_mm, p.half_height_mm) for p in parts]
    return np.array(rows, dtype=np.float64).reshape(-1, 4)
