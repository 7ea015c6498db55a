"""Bounds of a made-up pad: what plots, files and the report are tested on."""

from __future__ import annotations

import numpy as np

from optopad.design.preset import preset
from optopad.design.shape.cavity import CavityGeometry, cavity_of
from optopad.design.spec import SensorDesign
from optopad.sims.bounds.detection_threshold import DetectionThreshold
from optopad.sims.bounds.fisher import Steps
from optopad.sims.bounds.observability import BoundFigure, Limits, PadBounds, PartLoss, pair_names
from optopad.sims.verdict.pad_map import map_grid_mm

DEPTHS_MM = (0.2, 0.7, 1.5, 2.8, 4.9)


def made_up_bounds(design: SensorDesign | None = None, *, places: int = 5) -> PadBounds:
    """Location bounds that fall with depth and grow towards the first corner, which is blind at the first depth."""
    design = design or preset("piacenza2017-pad")
    cavity = cavity_of(design)
    x_mm, y_mm = map_grid_mm(cavity, places)
    depth = np.array(DEPTHS_MM)
    corner = 1.0 + 0.1 * (np.arange(len(y_mm))[:, None, None] + np.arange(len(x_mm))[None, :, None])
    location = 0.02 / depth / corner
    bound = 0.006 / np.sqrt(depth) / corner
    location[0, 0, 0] = bound[0, 0, 0] = np.inf
    alone = 0.7 * bound
    lines = (tuple(x_mm.tolist()), tuple(y_mm.tolist()))
    return PadBounds(
        x_mm=lines[0],
        y_mm=lines[1],
        depth_mm=DEPTHS_MM,
        max_depth_mm=design.operating.max_depth_mm,
        location_mm=location,
        location_error_mm=np.where(np.isfinite(location), 0.02 * location, np.inf),
        depth_bound_mm=bound,
        depth_error_mm=np.where(np.isfinite(bound), 0.01 * bound, np.inf),
        depth_alone_mm=alone,
        depth_alone_error_mm=np.where(np.isfinite(alone), 0.01 * alone, np.inf),
        losses=tuple(_loss(number, part.name) for number, part in enumerate(cavity.parts)),
        detection=made_up_detection(cavity, places),
        limits=Limits(),
        pairs=pair_names(cavity),
        steps=Steps(),
        accuracies=("draft", "standard"),
        seed=0,
        digest=design.digest,
    )


def made_up_detection(cavity: CavityGeometry, places: int = 5) -> DetectionThreshold:
    """A press felt from 0.02 mm and 0.01 N on, later towards the middle."""
    x_mm, y_mm = map_grid_mm(cavity, places)
    reach = np.minimum.outer(np.minimum(y_mm, y_mm[::-1]), np.minimum(x_mm, x_mm[::-1]))
    depth = 0.002 * reach
    force = 3.3 * depth**1.5
    return DetectionThreshold(
        x_mm=tuple(x_mm.tolist()),
        y_mm=tuple(y_mm.tolist()),
        depth_mm=depth,
        depth_low_mm=0.9 * depth,
        depth_high_mm=1.1 * depth,
        force_n=force,
        force_error_low_n=0.85 * force,
        force_error_high_n=1.15 * force,
        low_n=0.66 * force,
        high_n=1.49 * force,
        threshold=3.0,
    )


def _loss(number: int, name: str) -> PartLoss:
    share, place = 0.95 - 0.002 * number, 0.0105 + 0.0001 * number
    return PartLoss(
        part=name,
        coverage=BoundFigure(value=share, low=share - 0.01, high=share + 0.01),
        median_location_mm=BoundFigure(value=place, low=0.98 * place, high=1.02 * place),
        median_depth_mm=BoundFigure(value=0.005, low=0.0049, high=0.0051),
        blind_share=0.04,
    )
