"""Discs and crowned pads with made-up maps, bounds and presses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from optopad.design.preset import preset
from optopad.design.shape.cavity import cavity_of, plan_of
from optopad.design.spec import SensorDesign
from optopad.sims.bounds.detection_threshold import DetectionThreshold
from optopad.sims.bounds.observability import PadBounds
from optopad.sims.press import Indentation
from optopad.sims.verdict.pad_map import PadMap, grid_inside
from tests.sims.made_up_bounds import made_up_bounds
from tests.sims.made_up_scores import made_up_map

DISC, DOME, BENT = (preset(name) for name in ("levi2013-disc", "fingertip-dome", "crowned-40x25"))
BOUNDS = ("location_mm", "depth_bound_mm", "depth_alone_mm")
ERRORS = ("location_error_mm", "depth_error_mm", "depth_alone_error_mm")
FELT = ("depth_mm", "depth_low_mm", "depth_high_mm", "force_n", "low_n", "high_n")


def in_workspace(design: SensorDesign, pad_map: PadMap) -> PadMap:
    """A map without the places outside the workspace."""
    space = cavity_of(design).workspace
    kept = tuple(place for place in pad_map.places if space.contains(place.x_mm, place.y_mm, 1e-6))
    return replace(pad_map, places=kept)


def shaped_map(design: SensorDesign) -> PadMap:
    """A made-up map of a design's own places."""
    return in_workspace(design, made_up_map(cavity_of(design), dead_mm=1.9))


def shaped_bounds(design: SensorDesign) -> PadBounds:
    """Made-up bounds, not a number outside the workspace; the first place's first voxel is blind."""
    bounds = made_up_bounds(design)
    inside = grid_inside(cavity_of(design).workspace, np.array(bounds.x_mm), np.array(bounds.y_mm))
    values = {name: np.where(inside[..., None], getattr(bounds, name), np.nan) for name in (*BOUNDS, *ERRORS)}
    first = tuple(np.argwhere(inside)[0])
    for name in BOUNDS:
        values[name][(*first, 0)] = np.inf
    detection = bounds.detection
    assert isinstance(detection, DetectionThreshold)
    masked = {name: np.where(inside, getattr(detection, name), np.nan) for name in FELT}
    return replace(bounds, detection=replace(detection, **masked), **values)


def made_up_press(
    design: SensorDesign, depth_mm: float, at_mm: tuple[float, float] | None = None
) -> Indentation:
    """The tip over the crown's mean sphere in a circle of half its radius, and a cone from there to nothing."""
    tip, crown, edge = design.indenter.tip_radius_mm, design.crown, 0.5 * design.indenter.tip_radius_mm
    radius = np.linspace(0.0, edge, 40)
    height = tip - depth_mm - np.sqrt(tip**2 - radius**2)
    if crown is not None:
        mean = crown.radius_mm * (1.0 if crown.axis is None else 2.0)
        height = height + radius**2 / (mean + np.sqrt(mean**2 - radius**2))
    reach = min(3.0 * tip, 0.8 * plan_of(design).radius_mm)
    beyond = np.linspace(edge, reach, 40)[1:]
    return Indentation(
        depth_mm=depth_mm,
        tip_radius_mm=tip,
        radius_mm=np.concatenate([radius, beyond]),
        height_mm=np.concatenate([height, height[-1] * (reach - beyond) / (reach - edge)]),
        contact_radius_mm=edge,
        force_n=1.0,
    )
