"""From a design to the optical scene: the printed cavity's numbers, as the arrays that kernels read."""

from __future__ import annotations

import numpy as np

from design.cavity import PlacedPart, cavity_of
from design.layout import WALLS
from design.properties import absorption_coefficient_per_mm, emitter_order, refractive_index
from design.spec import SensorDesign
from sims.optics.scene import FloatArray, IntArray, OpticalScene


def scene_of(design: SensorDesign) -> OpticalScene:
    """The clear block of a design with its emitters and receivers, in the order of pins and signals.

    Raises
    ------
    DesignError : an unknown part or material, or an index outside the material's table.
    """
    cavity = cavity_of(design)
    return OpticalScene(
        length_mm=cavity.length_mm,
        width_mm=cavity.width_mm,
        height_mm=cavity.clear_mm,
        refractive_index=refractive_index(design).value,
        absorption_per_mm=absorption_coefficient_per_mm(design),
        wall_reflectance=design.surfaces.wall_reflectance,
        bottom_reflectance=design.surfaces.bottom_reflectance,
        tip_reflectance=design.surfaces.tip_reflectance,
        emitter_wall=_walls(cavity.emitters),
        emitter_patch=_patches(cavity.emitters),
        emitter_order=np.array([emitter_order(part.part) for part in cavity.emitters]),
        receiver_wall=_walls(cavity.receivers),
        receiver_patch=_patches(cavity.receivers),
    )


def _walls(parts: tuple[PlacedPart, ...]) -> IntArray:
    return np.array([WALLS.index(part.wall) for part in parts], dtype=np.int64)


def _patches(parts: tuple[PlacedPart, ...]) -> FloatArray:
    return np.array([[p.along_mm, p.height_mm, p.half_width_mm, p.half_height_mm] for p in parts])
