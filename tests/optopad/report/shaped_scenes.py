"""Scores and light of discs and crowned pads, made up, for the report."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from optopad.design.shape.cavity import cavity_of
from optopad.design.spec import SensorDesign
from optopad.report.scenes.ray_scene import RayScene
from optopad.sims.optics.paths import LightPath
from optopad.sims.rays import RayState
from optopad.sims.score.result import ContinuityScore
from tests.sims.made_up_scores import dead_score
from tests.sims.plots.shaped_pads import in_workspace, made_up_press, shaped_bounds


def shaped_score(design: SensorDesign) -> ContinuityScore:
    """A made-up score with the design's own places and made-up bounds."""
    score = dead_score(design)
    assert score.pad_map is not None
    return replace(score, pad_map=in_workspace(design, score.pad_map), bounds=shaped_bounds(design))


def made_up_light(design: SensorDesign) -> RayScene:
    """One straight path of one pair, untouched and under a press beside the middle."""
    cavity, depth = cavity_of(design), 1.0
    start, end = cavity.emitters[0].position_mm, cavity.receivers[1].position_mm
    path = LightPath(fate="direct", emitter=0, receiver=1, ray=0, places_mm=np.array([start, end]))
    place = cavity.plan.centre_mm[0] - 3.0, cavity.plan.centre_mm[1] - 2.0
    untouched = RayState(
        press_mm=(*cavity.plan.centre_mm, 0.0),
        indentation=None,
        power={"direct": np.array([1e-3])},
        emitters=1,
        paths=(path,),
        lost=(),
        lost_by=(),
    )
    pressed = replace(untouched, press_mm=(*place, depth), indentation=made_up_press(design, depth, place))
    return RayScene(
        design=design,
        cavity=cavity,
        pairs=((0, 1),),
        place_mm=place,
        is_middle=False,
        labels=("untouched", "1.00 mm"),
        states=(untouched, pressed),
    )
