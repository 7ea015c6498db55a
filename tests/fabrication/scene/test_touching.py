"""What touches the pads that `optopad scene` writes, where, and what their frames read then."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

import optopad
from optopad.design.draft import Draft
from optopad.fabrication.scene.simulated_pad import SimulatedPad
from optopad.fabrication.scene.touching import PadTop
from tests.sims.robot.made_up_light import made_up_light

from .pads import DOME, FLAT, GAP_MM, ball_model, design_of


@pytest.mark.parametrize("name", [FLAT, DOME])
def test_a_ball_is_found_where_it_presses(name: str) -> None:
    design, depth_mm = design_of(name), 0.8
    model, plan = ball_model(name), Draft.of(design).plan
    top, data = PadTop(model, "left", design.digest), mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert top.touching(data).geoms == ()
    data.qpos[:] = -(GAP_MM + depth_mm) / 1e3
    mujoco.mj_forward(model, data)
    found = top.touching(data)
    shape = top.shape(found.geoms[0])
    assert shape is not None
    assert shape.kind == "sphere"
    height_mm = float(plan.top_mm(*plan.centre_mm)) + shape.size_mm[0] - depth_mm
    np.testing.assert_allclose(found.centre_mm[0], [*plan.centre_mm, height_mm], atol=1e-6)
    np.testing.assert_allclose(found.turn[0], np.eye(3), atol=1e-9)
    assert found.pressed_mm[0] == pytest.approx(depth_mm, abs=0.03)  # a crown is a convex mesh


def test_a_frame_reads_what_the_pad_does_without_a_simulator() -> None:
    design, depth_mm = design_of(FLAT), 0.8
    model, light = ball_model(FLAT), made_up_light(FLAT)
    data = mujoco.MjData(model)
    data.qpos[:] = -(GAP_MM + depth_mm) / 1e3
    mujoco.mj_forward(model, data)
    pads = [
        SimulatedPad(model, design, "left", light=light, seed=seed, is_ambient=False) for seed in range(40)
    ]
    ratios = np.mean([pad.frame(data).normalised for pad in pads], axis=0)
    known = optopad.forward(design, light)
    press_mm = [[*Draft.of(design).plan.centre_mm, depth_mm]]
    expected = known.presses(press_mm)[0] / known.untouched
    assert expected.min() < 0.95
    strong = known.untouched > 200.0  # of 4095 counts: noise below 0.3 % of a single frame
    np.testing.assert_allclose(ratios[strong], expected[strong], atol=3e-3)
