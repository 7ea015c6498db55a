"""A made-up score with made-up bounds, for the maps of the report."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from optopad.design.preset import preset
from optopad.sims.bounds.detection_threshold import DetectionThreshold
from optopad.sims.bounds.fisher import Steps
from optopad.sims.bounds.observability import BoundFigure, Limits, PadBounds, PartLoss
from optopad.sims.score.result import ContinuityScore
from tests.sims.made_up_scores import dead_score

PAD = preset("piacenza2017-pad")


def bounded_score() -> ContinuityScore:
    """The pad's made-up score with made-up bounds: worse with depth, blind at the deepest voxel of the first place."""
    score = dead_score(PAD)
    pad = score.pad_map
    assert pad is not None
    depth = (0.2, 0.7, 1.5, 2.8, 4.9)
    place = 0.004 * np.ones((len(pad.y_mm), len(pad.x_mm), 1)) * 4.0 ** np.arange(5)
    place[0, 0, -1] = np.inf
    error = np.where(np.isfinite(place), 0.01 * place, np.inf)
    shape = place.shape[:2]
    detection = DetectionThreshold(
        x_mm=pad.x_mm,
        y_mm=pad.y_mm,
        depth_mm=np.full(shape, 0.05),
        depth_low_mm=np.full(shape, 0.04),
        depth_high_mm=np.full(shape, 0.06),
        force_n=np.full(shape, 0.02),
        force_error_low_n=np.full(shape, 0.015),
        force_error_high_n=np.full(shape, 0.025),
        low_n=np.full(shape, 0.013),
        high_n=np.full(shape, 0.03),
        threshold=3.0,
    )
    figure = BoundFigure(value=0.9, low=0.85, high=0.95)
    small = BoundFigure(value=0.05, low=0.04, high=0.06)
    loss = PartLoss(
        part="E3", coverage=figure, median_location_mm=small, median_depth_mm=small, blind_share=0.02
    )
    bounds = PadBounds(
        x_mm=pad.x_mm,
        y_mm=pad.y_mm,
        depth_mm=depth,
        max_depth_mm=5.0,
        location_mm=place,
        location_error_mm=error,
        depth_bound_mm=0.5 * place,
        depth_error_mm=0.5 * error,
        depth_alone_mm=0.1 * place,
        depth_alone_error_mm=0.1 * error,
        losses=(loss,),
        detection=detection,
        limits=Limits(),
        pairs=(),
        steps=Steps(),
        accuracies=("draft",),
        seed=0,
        digest="",
    )
    return replace(score, bounds=bounds)
