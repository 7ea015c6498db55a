"""What is lost when one emitter or one receiver dies: the bounds again without its pairs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from design.arrays import FloatArray
from design.shape.cavity import CavityGeometry
from sims.bounds.figures import Figure, median_of, share_of
from sims.bounds.fisher import Sensitivity, bounds_of


@dataclass(frozen=True, kw_only=True)
class PartLoss:
    """The pad without one part.

    Attributes
    ----------
    part : its name, as E3
    coverage : share of the workspace's volume still covered [-]
    median_location_mm, median_depth_mm : median bounds of what is left [mm]; infinite where half is blind
    blind_share : share of the volume where some direction cannot be told [-]
    """

    part: str
    coverage: Figure
    median_location_mm: Figure
    median_depth_mm: Figure
    blind_share: float


def part_losses(
    answers: Sensitivity,
    cavity: CavityGeometry,
    weight: FloatArray,
    covered_location_mm: float,
    covered_depth_mm: float,
) -> tuple[PartLoss, ...]:
    """The pad without each part in turn, emitters first.

    Parameters
    ----------
    answers : derivatives of all pairs, emitter outermost
    weight : (...) share of the volume that each voxel stands for
    """
    emitter, receiver = (index.ravel() for index in np.indices((len(cavity.emitters), len(cavity.receivers))))
    lost = [(part.name, emitter == k) for k, part in enumerate(cavity.emitters)]
    lost += [(part.name, receiver == k) for k, part in enumerate(cavity.receivers)]
    return tuple(
        _loss(name, answers.without(is_lost), weight, covered_location_mm, covered_depth_mm)
        for name, is_lost in lost
    )


def _loss(
    name: str,
    answers: Sensitivity,
    weight: FloatArray,
    covered_location_mm: float,
    covered_depth_mm: float,
) -> PartLoss:
    found = bounds_of(answers)
    return PartLoss(
        part=name,
        coverage=share_of(found, covered_location_mm, covered_depth_mm, weight),
        median_location_mm=median_of(found.location_mm, found.location_error_mm, weight),
        median_depth_mm=median_of(found.depth_mm, found.depth_error_mm, weight),
        blind_share=float(weight[found.is_blind].sum()),
    )
