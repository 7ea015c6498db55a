"""A ball in MuJoCo meets the force of the contact model, whatever its mass and the time step."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from optopad.design.errors import InputError
from optopad.fabrication.scene.contact_fit import LARGEST_STEP_S, contact_fit, tuned
from optopad.sims.contact.indentation import solved_press
from optopad.sims.contact.scope import contact_of

from .pads import FLAT, GAP_MM, ROUND, SHAPES, ball_model, design_of, settled_depth_mm

LARGEST_ERROR = 0.05


@pytest.mark.parametrize(
    "name", [name if name in (FLAT, ROUND) else pytest.param(name, marks=pytest.mark.slow) for name in SHAPES]
)
def test_the_fit_is_within_five_percent_of_the_contact_model_at_all_depths(name: str) -> None:
    fit, design = contact_fit(design_of(name)), design_of(name)
    layer = design.cavity.clear_thickness_mm + design.cavity.black_thickness_mm
    assert fit.depth_mm[0] == pytest.approx(0.3)
    assert fit.depth_mm[-1] == pytest.approx(min(3.0, layer / 3.0))
    between = np.linspace(fit.depth_mm[0], fit.depth_mm[-1], 41)
    press = solved_press(contact_of(design), float(fit.depth_mm[-1]))
    force = np.array([press.force_n(float(depth)) for depth in between])
    assert np.abs(fit.force_at_n(between) / force - 1.0).max() < LARGEST_ERROR


def test_the_fit_is_for_a_ball_whatever_the_tips_shape() -> None:
    punch = design_of(FLAT).with_(**{"indenter.shape": "flat_punch", "indenter.edge_radius_mm": 0.3})
    found, ball = contact_fit(punch), contact_fit(design_of(FLAT))
    assert (found.solimp, found.inverse_weight) == (ball.solimp, ball.inverse_weight)


@pytest.mark.parametrize("step", [0.001, 0.002, LARGEST_STEP_S])
@pytest.mark.parametrize("mass", [0.005, 2.0])
def test_a_ball_at_rest_meets_the_contact_models_force(step: float, mass: float) -> None:
    fit, model = contact_fit(design_of(FLAT)), ball_model(FLAT, mass=mass, step=step)
    for k in (0, 12, -1):
        depth = settled_depth_mm(model, fit.force_n[k], rest_s=0.4 + mass)
        # Against the fit, a ball of 5 g differs by half of 200 /kg over 42,000 /kg.
        assert fit.force_at_n(depth) == pytest.approx(fit.force_n[k], rel=0.003)


@pytest.mark.parametrize("step", [0.001, LARGEST_STEP_S])
@pytest.mark.parametrize("mass", [0.005, 0.5, 2.0])
def test_a_ball_that_falls_on_the_pad_comes_to_rest_on_it(step: float, mass: float) -> None:
    fit, model = contact_fit(design_of(FLAT)), ball_model(FLAT, mass=mass, step=step)
    model.opt.gravity[2] = -9.81
    data, height_m = mujoco.MjData(model), []
    data.qpos[0] = 0.02
    while data.time < 1.0 + mass:
        mujoco.mj_step(model, data)
        height_m.append(data.qpos[0])
    assert abs(data.qvel[0]) < 1e-4
    layer_mm = 6.0
    assert min(height_m) * -1e3 - GAP_MM < 1.2 * layer_mm  # 2 kg on a pin of 3 mm go deep, but not through
    depth = -data.qpos[0] * 1e3 - GAP_MM
    if depth < 0.4 * layer_mm:
        assert fit.force_at_n(depth) == pytest.approx(mass * 9.81, rel=0.01)


@pytest.mark.parametrize("impratio", [1.0, 10.0])
def test_a_pyramidal_cone_has_the_force_of_an_elliptic_one(impratio: float) -> None:
    fit = contact_fit(design_of(FLAT))
    model = ball_model(FLAT, cone=mujoco.mjtCone.mjCONE_PYRAMIDAL, impratio=impratio)
    assert fit.force_at_n(settled_depth_mm(model, 2.0)) == pytest.approx(2.0, rel=0.003)


def test_stiffness_is_a_factor_of_the_force() -> None:
    fit, model = contact_fit(design_of(FLAT)), ball_model(FLAT)
    tuned(model, "left", stiffness=4.0)
    assert 4.0 * fit.force_at_n(settled_depth_mm(model, 4.0)) == pytest.approx(4.0, rel=0.01)
    with pytest.raises(
        InputError, match=r"stiffness: 0 is refused; give a factor of the force from 0.01 to 100"
    ):
        tuned(model, "left", stiffness=0.0)


def test_an_untuned_pad_is_hard() -> None:
    model = ball_model(FLAT)
    mujoco.mj_setConst(model, mujoco.MjData(model))
    assert settled_depth_mm(model, 2.0) < 0.01


def test_a_model_without_the_pad_is_refused_with_the_names_of_its_pads() -> None:
    with pytest.raises(
        InputError, match=r"'right' is no pad .* no 'right_pad_top'; its pads are 'left'; .*'right_'"
    ):
        tuned(ball_model(FLAT), "right")
    with pytest.raises(InputError, match="its pads are none; attach one"):
        tuned(mujoco.MjModel.from_xml_string("<mujoco/>"))


def test_a_time_step_too_long_for_the_fit_is_refused() -> None:
    model = ball_model(FLAT)
    model.opt.timestep = 0.005
    with pytest.raises(
        InputError, match=r"timestep: 5 ms, .* at most 4 ms; set model.opt.timestep to 0.004 or less"
    ):
        tuned(model, "left")


def test_a_fused_body_is_refused() -> None:
    model = ball_model(FLAT)
    model.body_geomnum[model.geom("left_pad_top").bodyid[0]] = 7
    with pytest.raises(InputError, match=r"left_pad_top: its body has 7 geoms, .* leave fusestatic out"):
        tuned(model, "left")
