"""What touches the pads that `optopad scene` writes, and where, in the cavity's coordinates."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from optopad.design.draft import Draft
from optopad.fabrication.scene.touching import PadTop

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
