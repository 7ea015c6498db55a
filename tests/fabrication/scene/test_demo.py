"""The demo scene: the gripper lifts each object from the files alone."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

from optopad.fabrication.scene.contact_fit import tuned
from optopad.fabrication.scene.demo import LIFT_MM, OBJECTS, drive, duration_s, held_at, script_of
from optopad.fabrication.scene.files import write_scene

from .pads import FLAT, SHAPES, design_of


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    where = tmp_path_factory.mktemp("scene")
    write_scene(design_of(FLAT), where)
    return where


def lifted(model: mujoco.MjModel) -> dict[str, float]:
    """How far each object is above its post while the script holds it up, and at the end [m]."""
    for name in ("left", "right"):
        tuned(model, name)
    data, found = mujoco.MjData(model), {}
    due = sorted((held_at(model, name), name) for name in OBJECTS)
    while data.time < duration_s(model):
        drive(model, data)
        mujoco.mj_step(model, data)
        if due and data.time >= due[0][0]:
            name = due.pop(0)[1]
            found[name] = float(data.body(name).xpos[2] - model.body(name).pos[2])
            touched = {
                model.geom(g).name
                for c in data.contact
                for g in c.geom
                if name in {model.geom(x).name for x in c.geom}
            }
            assert touched == {name, "left_pad_top", "right_pad_top"}
    found["back"] = max(float(np.abs(data.body(name).xpos - model.body(name).pos).max()) for name in OBJECTS)
    return found


@pytest.mark.slow
@pytest.mark.parametrize("name", SHAPES)
def test_the_gripper_lifts_each_object_and_puts_it_back(name: str, tmp_path: Path) -> None:
    write_scene(design_of(name), tmp_path)
    found = lifted(mujoco.MjModel.from_xml_path(str(tmp_path / "demo.xml")))
    for one in OBJECTS:
        assert found[one] == pytest.approx(LIFT_MM * 1e-3, abs=0.001)
    assert found["back"] < 0.001


def test_the_demo_has_a_pad_on_each_finger_and_a_script(folder: Path) -> None:
    model = mujoco.MjModel.from_xml_path(str(folder / "demo.xml"))
    assert [tuned(model, name) for name in ("left", "right")] == [
        model.geom(f"{name}_pad_top").id for name in ("left", "right")
    ]
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    left, right = (data.site(f"{name}_pad_cavity").xmat.reshape(3, 3) for name in ("left", "right"))
    assert left[:, 2] == pytest.approx([0.0, 1.0, 0.0], abs=1e-6)
    assert right[:, 2] == pytest.approx([0.0, -1.0, 0.0], abs=1e-6)
    times = script_of(model)[:, 0]
    assert (np.diff(times) > 0).all()
    assert duration_s(model) == times[-1]


def test_the_pads_file_can_be_attached_in_python_and_in_mjcf(folder: Path, tmp_path: Path) -> None:
    robot = mujoco.MjSpec()
    site = robot.worldbody.add_body(name="finger").add_site(name="tip", pos=[0.0, 0.0, 0.5])
    robot.attach(mujoco.MjSpec.from_file(str(folder / "pad.xml")), prefix="left_", site=site)
    text = (
        f'<mujoco><asset><model name="pad" file="{folder / "pad.xml"}"/></asset><worldbody><body pos="0 0 0.5">'
        '<attach model="pad" body="pad" prefix="left_"/></body></worldbody></mujoco>'
    )
    (tmp_path / "robot.xml").write_text(text)
    models = [robot.compile(), mujoco.MjModel.from_xml_path(str(tmp_path / "robot.xml"))]
    for model in models:
        tuned(model, "left")
        assert model.sensor("left_pad_tactile").dim[0] == 3 * model.mesh("left_pad_taxels").vertnum[0]
    assert models[0].body_invweight0[-1, 0] == pytest.approx(models[1].body_invweight0[-1, 0])


def test_equal_designs_give_equal_files(folder: Path, tmp_path: Path) -> None:
    for name, path in write_scene(design_of(FLAT), tmp_path).items():
        assert path.read_bytes() == (folder / name).read_bytes()
