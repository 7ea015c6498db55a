"""Presses into a stadium pad: the chart, what is stored, the model against it, the page."""

from __future__ import annotations

import numpy as np
import pytest

from optopad.design.preset import preset
from optopad.design.shape.cavity import plan_of
from tests.validation.contact.contact_reference import POISSON_RATIO
from tests.validation.contact.crown.offset_oracle import OffsetPress, offset_state, rim_mesh
from tests.validation.contact.crown.stadium_oracle import AREA_MM2, PADS, STORED
from tests.validation.contact.crown.stadium_table import MARKS, PAGE, differences, markdown


@pytest.mark.parametrize("name", PADS)
def test_the_charted_block_fills_the_stadium_of_the_preset(name: str) -> None:
    pad, design = PADS[name], preset("gripper-stadium")
    cavity = design.cavity
    assert design.indenter.tip_radius_mm == pad.tip_mm
    assert cavity.clear_thickness_mm + cavity.black_thickness_mm == pad.layer_mm
    assert plan_of(design).area_mm2 == pytest.approx(AREA_MM2, rel=0.001)
    press = OffsetPress(pad.chart, pad.grading, POISSON_RATIO)
    volume_mm3 = press.copies * press.rest_volume * pad.tip_mm**3
    assert volume_mm3 == pytest.approx(pad.layer_mm * AREA_MM2, rel=1e-5)


@pytest.mark.parametrize("name", PADS)
def test_derivatives_of_the_chart_are_those_of_its_places_and_its_seams_are_edges_of_the_mesh(
    name: str,
) -> None:
    pad, step = PADS[name], 1e-6
    chart = pad.chart
    west, east, _, north = chart.walls
    flat = np.random.default_rng(7).uniform([-west, 0.0, -chart.layer], [east, north, 0.0], (50, 3)).T
    for axis in range(3):
        shift = step * np.eye(3)[:, axis, None]
        slope = (chart.places(flat + shift) - chart.places(flat - shift)) / (2.0 * step)
        np.testing.assert_allclose(slope.T, chart.jacobian(flat)[..., axis], atol=1e-8)
    nodes = rim_mesh(chart, pad.grading, 0).p[0]
    assert len(chart.seams) == (2 if pad.straight_mm else 0)
    for seam in chart.seams:
        assert np.abs(nodes - seam).min() < 1e-12


@pytest.mark.parametrize("name", PADS)
def test_stored_tops_end_at_the_bonded_wall(name: str) -> None:
    pad = PADS[name]
    for depth_mm in pad.depths_mm:
        state = offset_state(name, depth_mm, path=STORED)
        x, y = state.rest_mm.T[:2]
        from_spine = np.hypot(np.maximum(np.abs(x) - pad.straight_mm, 0.0), y)
        assert from_spine.max() == pytest.approx(pad.wall_mm, abs=1e-5)
        assert np.abs(state.moved_mm[from_spine > pad.wall_mm - 1e-5]).max() == 0.0
        assert 2.0 * state.contact_n.sum() == pytest.approx(state.force_n[2], rel=1e-5)


def test_the_page_s_table_is_that_of_the_stored_presses_and_of_the_model() -> None:
    written = PAGE.read_text(encoding="utf-8").split(MARKS[0])[1].split(MARKS[1])[0].strip()
    assert written == markdown()


def test_in_the_round_pad_of_its_area_the_model_is_exact_but_for_the_mesh() -> None:
    for depth_mm in PADS["round"].depths_mm:
        model, mesh = differences("round", depth_mm)
        assert abs(model.error.force_ratio - 1.0) < 0.015
        # the coarser mesh differs by more than the finer one errs
        assert model.error.pad_um[0] < 1.5 * max(mesh.error.pad_um[0], 1.0)


@pytest.mark.parametrize("name", ["middle", "end"])
def test_the_model_has_the_force_and_the_surface_around_the_tip(name: str) -> None:
    for depth_mm in PADS[name].depths_mm:
        model, _ = differences(name, depth_mm)
        assert abs(model.error.force_ratio - 1.0) < 0.03
        assert model.error.near_um[0] < 20.0 * depth_mm
