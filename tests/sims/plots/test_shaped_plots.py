"""Plots of discs and crowned pads: outlines, empty cells, sections along the normal of a press."""

from __future__ import annotations

import math

import numpy as np
import pytest
from matplotlib.collections import QuadMesh
from matplotlib.patches import Polygon

from optopad.design.shape.cavity import cavity_of, edge_mm, outline_mm
from optopad.sims.plots.contact import CutPlane, cut_tip_mm, cut_top_mm, plot_profile, press_frame
from optopad.sims.plots.maps import (
    plot_bound_sheet,
    plot_deadband_map,
    plot_detection_map,
    plot_margin_map,
    plot_usable_map,
)
from optopad.sims.plots.rays import cut_across, cut_through
from tests.sims.plots.shaped_pads import BENT, DISC, DOME, made_up_press, shaped_bounds, shaped_map

FLAT_MM = 0.02
"""A cut is found on a grid of 500 by 500 places over 25 mm; lines between them are straight."""


@pytest.mark.parametrize("design", [DISC, DOME], ids=["disc", "dome"])
def test_a_disc_s_outline_is_a_circle_with_a_facet_for_each_part(design):
    plan = cavity_of(design).plan
    corners = outline_mm(plan)
    x, y = corners.T
    area = 0.5 * float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))
    # chords in place of arcs: less than 1 - sin(a) / a of a = 2 pi / 96
    assert area == pytest.approx(plan.area_mm2, rel=8e-4)
    assert area < plan.area_mm2
    away = np.hypot(x - plan.centre_mm[0], y - plan.centre_mm[1])
    assert away.max() <= plan.radius_mm + 1e-9
    for wall in plan.walls:
        for along in (0.0, wall.length_mm):
            # corners nearer than a hundredth of a millimetre are one
            assert np.hypot(*(corners - wall.point(along)).T).min() < 0.011


def test_the_edge_of_a_cylinder_is_straight_along_it_and_curved_across():
    plan = cavity_of(BENT).plan
    for x, y, z in edge_mm(plan).tolist():
        assert z == plan.top_mm(x, y)
    assert edge_mm(plan)[:, 2].min() == pytest.approx(plan.rim_mm[0])
    assert edge_mm(plan)[:, 2].max() == pytest.approx(plan.rim_mm[1])


@pytest.mark.parametrize("plot", [plot_deadband_map, plot_margin_map, plot_usable_map])
def test_cells_outside_the_workspace_stay_empty(plot):
    pad_map, cavity = shaped_map(DISC), cavity_of(DISC)
    ax = plot(pad_map, cavity)
    mesh = next(one for one in ax.collections if isinstance(one, QuadMesh))
    known = np.ma.count(np.ma.masked_invalid(mesh.get_array()))
    assert known == len(pad_map.places) < len(pad_map.x_mm) * len(pad_map.y_mm)
    assert len(ax.texts) == len(pad_map.places) + len(cavity.parts)
    assert not any("nan" in text.get_text() for text in ax.texts)
    assert mesh.get_clip_path() is not None
    (dashed,) = [patch for patch in ax.patches if patch.get_gid() == "workspace"]
    away = np.linalg.norm(dashed.get_path().vertices - cavity.plan.centre_mm, axis=1)
    assert away == pytest.approx(21.5)


def test_only_blind_voxels_are_hatched():
    bounds = shaped_bounds(DISC)
    ax = plot_bound_sheet(bounds, cavity_of(DISC), "location").axes[0]
    assert len([patch for patch in ax.patches if patch.get_hatch()]) == 1
    assert len(ax.texts) == int(bounds.inside.sum()) - 1
    assert any(isinstance(patch, Polygon) for patch in ax.patches)
    assert bounds.detection is not None
    ax = plot_detection_map(bounds.detection, cavity_of(DISC))
    assert not any(patch.get_hatch() for patch in ax.patches)
    assert len(ax.texts) == int(bounds.inside.sum())


def test_lines_across_a_disc_end_on_its_wall():
    cavity = cavity_of(DISC)
    plan, part = cavity.plan, cavity.emitters[0]
    cut = cut_across(cavity, part)
    assert cut.length_mm == pytest.approx(2 * plan.stands_mm(part.line))  # a part faces it
    chord = cut_through(cavity, 20.0, 12.0)
    assert chord.start_mm[1] == chord.end_mm[1] == 12.0
    half = math.sqrt(27.5**2 - 15.5**2)
    assert (chord.start_mm[0], chord.end_mm[0]) == pytest.approx((27.5 - half, 27.5 + half))
    assert plan.outline.way_out_mm(plan.centre_mm, (math.sqrt(0.75), 0.5)) == pytest.approx(27.5)


@pytest.mark.parametrize("design", [DOME, BENT, DISC], ids=["dome", "cylinder", "disc"])
def test_a_press_s_frame_stands_on_the_top_along_its_normal(design):
    plan = cavity_of(design).plan
    at = plan.centre_mm[0] + 3.0, plan.centre_mm[1] + 2.0
    frame = press_frame(design, at)
    assert frame.axes[2] == pytest.approx(plan.normal(*at))
    rng = np.random.default_rng(0)
    across, aside = rng.uniform(-3.0, 3.0, (2, 50))
    places = frame.places_mm(across, aside, frame.top_mm(None, across, aside))
    # the untouched top in the frame is the untouched top
    assert places[:, 2] == pytest.approx([plan.top_mm(x, y) for x, y in places[:, :2].tolist()], abs=1e-9)
    assert np.stack(frame.seen_from_it(places))[:2] == pytest.approx(np.stack([across, aside]))


@pytest.mark.parametrize("design", [DOME, BENT], ids=["dome", "cylinder"])
def test_a_section_through_the_axis_cuts_the_tip_at_its_depth_along_the_normal(design):
    plan, depth = cavity_of(design).plan, 1.0
    x, y = plan.centre_mm
    at = (x, y + 3.0)  # the section along y holds the axis
    plane = CutPlane(start_mm=(x, 0.0), direction=(0.0, 1.0), reach_mm=(0.5, 2 * y - 0.5), ceiling_mm=11.0)
    frame = press_frame(design, at)
    apex = frame.origin_mm - depth * frame.axes[2]
    press = made_up_press(design, depth)
    for line in (cut_top_mm(frame, press, plane), cut_tip_mm(design, frame, depth, plane)):
        nearest = np.hypot(*(line - [apex[1], apex[2]]).T).min()
        assert nearest < FLAT_MM
    top = cut_top_mm(frame, press, plane)
    beyond = top[np.abs(top[:, 0] - at[1]) > 9.5]
    assert beyond[:, 1] == pytest.approx([plan.top_mm(x, along) for along in beyond[:, 0]], abs=FLAT_MM)


def test_a_profile_on_a_crown_lies_on_the_tip_in_the_contact():
    press = made_up_press(DOME, 1.0)
    tip = np.array([0.0, 1.0, 2.0]), np.array([0.0, 2.0 - math.sqrt(3.0), 2.0])
    ax = plot_profile(press, tip, crown_radius_mm=18.0)
    surface = next(line for line in ax.lines if str(line.get_label()).startswith("surface"))
    radius, height = np.array(surface.get_data())
    inside = np.abs(radius) <= press.contact_radius_mm
    assert height[inside] == pytest.approx(1.0 - np.sqrt(4.0 - radius[inside] ** 2))
    rest = next(line for line in ax.lines if line.get_label() == "undisturbed surface")
    assert min(rest.get_ydata()) < -0.5
