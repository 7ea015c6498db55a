"""The pad's model: where its parts are, what it weighs, and what its taxels measure."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from optopad.design.draft import Draft
from optopad.fabrication.scene.mjcf import KG_PER_MM3, pad_meshes, pad_spec, taxels_mm

from .pads import DOME, FLAT, GAP_MM, ROUND, SHAPES, ball_model, design_of, top_m

EACH_SHAPE = [
    name if name in (FLAT, ROUND) else pytest.param(name, marks=pytest.mark.slow) for name in SHAPES
]


def pressed(
    name: str, depth_mm: float, at_mm: tuple[float, float] | None = None
) -> tuple[mujoco.MjModel, mujoco.MjData]:
    model = ball_model(name, at_mm=at_mm)
    data = mujoco.MjData(model)
    data.joint("press").qpos[0] = -(depth_mm + GAP_MM) * 1e-3
    return model, data


@pytest.mark.parametrize("name", EACH_SHAPE)
def test_penetration_is_the_depth_of_the_press_and_taxels_measure_it(name: str) -> None:
    middle = Draft.of(design_of(name)).plan.centre_mm
    model, data = pressed(name, 1.0)
    mujoco.mj_forward(model, data)
    (contact,) = data.contact
    assert {model.geom(contact.geom1).name, model.geom(contact.geom2).name} == {"ball", "left_pad_top"}
    assert contact.dist == pytest.approx(-1e-3, abs=2e-6)
    taxels = taxels_mm(design_of(name))
    depths = data.sensor("left_pad_tactile").data.reshape(3, -1)[0]
    points = data.site("left_pad_cavity").xpos + taxels * 1e-3
    away = np.linalg.norm(points - data.geom("ball").xpos, axis=1)
    assert depths == pytest.approx(np.maximum(model.geom("ball").size[0] - away, 0.0), abs=1e-7)
    assert taxels[depths.argmax(), :2] == pytest.approx(middle, abs=0.51)


@pytest.mark.slow
def test_a_ball_beside_the_middle_of_a_dome_meets_it_as_a_sphere() -> None:
    model, data = pressed(DOME, 0.8, (14.0, 8.0))
    mujoco.mj_forward(model, data)
    (contact,) = data.contact
    top = Draft.of(design_of(DOME)).plan.top
    centre = data.site("left_pad_cavity").xpos + np.array([*top.apex_mm, top.clear_mm - top.radius_mm]) * 1e-3
    away = data.geom("ball").xpos - centre
    depth_mm = top.radius_mm + model.geom("ball").size[0] * 1e3 - np.linalg.norm(away) * 1e3
    assert -contact.dist * 1e3 == pytest.approx(depth_mm, abs=0.02)  # facets are chords of the crown
    assert abs(contact.frame[:3] @ away) > np.cos(np.radians(3.0)) * np.linalg.norm(away)


def test_taxels_measure_the_speed_of_sliding_along_the_cavity() -> None:
    model, data = pressed(FLAT, 1.0)
    model.jnt_axis[model.joint("press").id] = [0.6, 0.8, 0.0]
    data.qpos[0], data.qvel[0] = 0.0, 0.01
    model.body("ball").pos[2] -= 1.1e-3
    mujoco.mj_forward(model, data)
    depth, along_x, along_y = data.sensor("left_pad_tactile").data.reshape(3, -1)
    touched = depth > 0.0
    assert touched.any()
    assert along_x[touched] == pytest.approx(0.006, abs=1e-6)
    assert along_y[touched] == pytest.approx(0.008, abs=1e-6)


def test_the_pad_weighs_what_its_volumes_and_densities_give() -> None:
    trimesh = pytest.importorskip("trimesh")
    design, model = design_of(FLAT), ball_model(FLAT)
    volumes = {
        name: trimesh.Trimesh(mesh.vertices, mesh.triangles).volume
        for name, mesh in pad_meshes(design).items()
    }
    assert volumes["pad_silicone"] == pytest.approx(30.0 * 22.0 * 6.0, rel=1e-6)
    plastic, silicone = volumes["pad_mold"] * 1.04 * KG_PER_MM3, 30.0 * 22.0 * 6.0 * 1.03 * KG_PER_MM3
    assert model.body("left_pad").mass[0] == pytest.approx(plastic + silicone, rel=1e-5)
    assert model.body("left_pad_face").mass[0] == 0.0


def test_the_cavitys_site_is_the_origin_of_the_cavity() -> None:
    design, data = design_of(ROUND), mujoco.MjData(ball_model(ROUND))
    mujoco.mj_kinematics(ball_model(ROUND), data)
    plan = Draft.of(design).plan
    corner = data.site("left_pad_cavity").xpos * 1e3
    assert corner[:2] == pytest.approx([-plan.length_mm / 2, -plan.width_mm / 2])
    assert top_m(design)[2] * 1e3 == pytest.approx(corner[2] + plan.clear_mm)
    assert data.site("left_pad_mount").xpos == pytest.approx([0.0, 0.0, 0.0])


@pytest.mark.parametrize("name", EACH_SHAPE)
def test_the_molds_collision_is_as_large_as_the_mold_and_leaves_the_cavity_free(name: str) -> None:
    design = design_of(name)
    model = pad_spec(design).compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    outline, inside = Draft.of(design).outline, Draft.of(design).plan.outline
    corners, free = [], inside.spread(np.random.default_rng(0).uniform(size=(200, 2)))
    free = np.column_stack([free, np.full(200, outline.top_mm)]) - [*inside.centre_mm, outline.bottom_mm]
    for k in range(model.ngeom):
        if not model.geom(k).name.startswith("pad_wall"):
            continue
        signs = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, -1).T
        axes = data.geom_xmat[k].reshape(3, 3)
        corners.append(data.geom_xpos[k] + (signs * model.geom_size[k]) @ axes.T)
        local = np.abs((free * 1e-3 - data.geom_xpos[k]) @ axes) - model.geom_size[k]
        assert local.max(axis=1).min() > -1e-9
    sizes = np.ptp(np.concatenate(corners), axis=0) * 1e3
    slack = (
        1.0 if inside.corners_mm else 1.021
    )  # boxes around a round wall reach beyond it by up to 1 / cos(pi / 16)
    for found, wanted in zip(sizes, (outline.outer_length_mm, outline.outer_width_mm, None), strict=True):
        if wanted is not None:
            assert wanted * 0.999 <= found <= wanted * slack + 1e-6
    assert sizes[2] >= outline.height_mm - 1e-6
