"""Frames of a pad in MuJoCo against its light, and where trained models see a ball in the scene.

    python -m tests.validation.scene.light_table     writes the tables of docs/validation/scene.md; needs the map of
                                                     light of `optopad scene piacenza2017-pad --fit`; minutes

Objects are held in the scene at a place and a depth. The pad's readings without noise are compared with the light of
`optopad press` of the same object, traced at the accuracy "standard" with another seed; the tip also with the light of
`optopad simulate`. A ball held by the scene at random places is read by models that were trained on simulated presses;
their errors there are compared with those at random presses of their own data set.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from pathlib import Path

import mujoco
import numpy as np

import optopad
from optopad.design.draft import Draft
from optopad.design.held_object import held_of
from optopad.design.spec import SensorDesign
from optopad.fabrication.scene.contact_fit import tuned
from optopad.fabrication.scene.mjcf import pad_spec
from optopad.fabrication.scene.simulated_pad import SimulatedPad
from optopad.fabrication.scene.touching import PadTop
from optopad.sims.held import AskedPress, held_light, pressed
from optopad.sims.learning.inference.model_file import load_model
from optopad.sims.optics import trace
from optopad.sims.robot.fast_light import FastLight, fast_light, together
from optopad.sims.robot.poses import posed
from tests.validation.contact.contact_table import markdown_table, write_tables

PAGE = Path(__file__).parents[3] / "docs" / "validation" / "scene.md"
PAD, SEED = "piacenza2017-pad", 977
OBJECTS = (
    "sphere,radius=3",
    "sphere,radius=8",
    "cylinder,radius=5,length=12,yaw=30",
    "box,length=8,width=8,height=8,yaw=20",
    "box,length=8,width=8,height=8,pose=edge,yaw=20",
    "box,length=8,width=8,height=8,pose=corner,yaw=20",
)
PLACES_MM, DEPTHS_MM = ((16.0, 16.0), (12.3, 19.1), (20.4, 11.2)), (0.3, 0.8, 1.4)
GEOMS = {
    "sphere": mujoco.mjtGeom.mjGEOM_SPHERE,
    "cylinder": mujoco.mjtGeom.mjGEOM_CYLINDER,
    "box": mujoco.mjtGeom.mjGEOM_BOX,
}


class Held:
    """A pad that is fixed in a scene, and one object of any pose that nothing moves."""

    def __init__(self, design: SensorDesign, text: str) -> None:
        self.held, self.top = held_of(text), Draft.of(design).plan.top
        shape, _, _ = posed(self.held, self.top, PLACES_MM[0], 0.0)
        spec = mujoco.MjSpec()
        spec.attach(pad_spec(design), prefix="left_", site=spec.worldbody.add_site(name="mount"))
        body = spec.worldbody.add_body(name="object")
        body.add_freejoint()
        body.add_geom(name="object", type=GEOMS[shape.kind], size=shape.size_mm * 1e-3)
        self.model = spec.compile()
        tuned(self.model, "left")
        self.data = mujoco.MjData(self.model)

    def at(self, x_mm: float, y_mm: float, depth_mm: float) -> mujoco.MjData:
        """The scene with the object pressed so deep at a place."""
        _, centre, turn = posed(self.held, self.top, (x_mm, y_mm), depth_mm)
        mujoco.mj_forward(self.model, self.data)
        site = self.data.site("left_pad_cavity")
        axes = site.xmat.reshape(3, 3)
        quat = np.zeros(4)
        mujoco.mju_mat2Quat(quat, (axes @ turn).ravel())
        self.data.qpos[:] = [*(site.xpos + axes @ centre * 1e-3), *quat]
        mujoco.mj_forward(self.model, self.data)
        return self.data

    def ratios(self, light: FastLight, data: mujoco.MjData) -> np.ndarray:
        """Light over untouched light (emitter, receiver) under what MuJoCo has in contact with the pad."""
        top = PadTop(self.model, "left", light.digest)
        found = top.touching(data)
        each = [
            light.imprint(top.shape(geom), centre[None], turn[None])
            for geom, centre, turn in zip(found.geoms, found.centre_mm, found.turn, strict=True)
        ]
        return light.ratios(together(each))[0]


def light_rows() -> list[list[str]]:
    """A row for each object: errors of the readings at each depth over places, and over the change of the readings."""
    design = optopad.load(PAD)
    draft, light = Draft.of(design), fast_light(design)
    found = []
    for text in OBJECTS:
        scene, asked = Held(design, text), []
        seen = []
        for depth in DEPTHS_MM:
            for x, y in PLACES_MM:
                seen.append(scene.ratios(light, scene.at(x, y, depth)).ravel())
                asked.append(AskedPress(held=(scene.held,), at_mm=(x, y), depth_mm=depth))
        traced = held_light(draft, [pressed(draft, one) for one in asked], accuracy="standard", seed=SEED)
        truths = {"press": (traced.flux / traced.untouched).reshape(len(seen), -1)}
        if text == OBJECTS[0]:
            rows = np.array([[*one.at_mm, one.depth_mm] for one in asked])
            own = trace(
                draft, np.concatenate([[[16.0, 16.0, 0.0]], rows]), accuracy="standard", seed=SEED
            ).flux
            truths["simulate"] = (own[1:] / own[0]).reshape(len(seen), -1)
        for name, truth in truths.items():
            off = np.array(seen) - truth
            by_depth = [
                f"{100 * np.sqrt(np.mean(part**2)):.2f} of {100 * np.sqrt(np.mean((whole - 1.0) ** 2)):.1f}"
                for part, whole in zip(
                    np.split(off, len(DEPTHS_MM)), np.split(truth, len(DEPTHS_MM)), strict=True
                )
            ]
            found.append([text, name, *by_depth])
    return found


BALLS, TOUCH_MM = 200, (0.5, 1.0, 2.0)


def ball_rows(folder: Path) -> list[list[str]]:
    """A row for each learner and depth: median errors of location in its own data, and in the scene [mm]."""
    design = optopad.load(PAD)
    scene = Held(design, "sphere,radius=3")
    rng = np.random.default_rng(1)
    space, light = Draft.of(design).workspace, fast_light(design)
    places = space.spread(rng.uniform(size=(BALLS, 2)))
    found = []
    for file in sorted(folder.glob("*.optomodel")):
        model = load_model(file)
        own = own_errors_mm(file, folder)
        pad = SimulatedPad(scene.model, design, "left", light=light, touch_model=model, is_ambient=False)
        scene.data.time = 0.0
        for depth in TOUCH_MM:
            off, missed = [], 0
            for x, y in places.tolist():
                for _ in range(3):
                    data = scene.at(x, y, -5.0)
                    data.time += pad.interval_s
                    pad.touch(data)
                data = scene.at(x, y, depth)
                for _ in range(3):
                    data.time += pad.interval_s
                    touch = pad.touch(data)
                missed += not touch.is_touched
                off.append(float(np.hypot(*(touch.press_mm[:2] - (x, y)))) if touch.is_touched else np.nan)
            median = float(np.nanmedian(off))
            there = own[depth]
            cells = [
                model.header.kind,
                f"{depth:g}",
                f"{there:.2f}",
                f"{median:.2f}",
                f"{median / there:.2f}",
            ]
            found.append([*cells, f"{missed}"])
    return found


def own_errors_mm(file: Path, folder: Path) -> dict[float, float]:
    """Median error of location by depth at the presses of the test set in the dark, by `optopad evaluate --json`."""
    made = json.loads((folder / f"{file.name}.json").read_text())
    (dark,) = [one for one in made["models"] if not one["is_ambient"]]
    found = {}
    for depth in TOUCH_MM:
        row = min(dark["errors"], key=lambda one: abs(one["depth_mm"] - depth))
        assert row["depth_mm"] == depth
        found[depth] = row["found_location_mm"]["median"]
    return found


def models_in(folder: Path) -> None:
    """Simulate a data set in a folder, train all learners on it, and write their errors at its test presses."""
    data = folder / "out"
    _run("simulate", PAD, "--protocol", "piacenza2017-quick", "--fit", "--out", data)
    (file,) = data.glob("*/sims/data-*.nc")
    _run("train", file, "--learner", "all", "--effort", "quick", "--design", PAD, "--out", folder)
    _run(
        "train",
        file,
        "--learner",
        "signal-map",
        "--effort",
        "quick",
        "--design",
        PAD,
        "--out",
        folder / "signal-map.optomodel",
    )
    for model in folder.glob("*.optomodel"):
        made = _run("evaluate", file, "--model", model, "--json")
        (folder / f"{model.name}.json").write_text(made)


def _run(*words: object) -> str:
    return subprocess.run(
        [sys.executable, "-m", "optopad", *map(str, words)], check=True, stdout=subprocess.PIPE, text=True
    ).stdout


def kinds() -> str:
    """The errors of the stored map, by kind of object."""
    light = fast_light(optopad.load(PAD))
    print(f"{light.states} states")
    rows = [[kind, f"{100 * error:.2g}"] for kind, error in light.errors.items()]
    return markdown_table(["kind of object", "error %"], rows)


def light() -> str:
    """The table of objects in the scene."""
    return markdown_table(["object", "against", *(f"{depth:g} mm %" for depth in DEPTHS_MM)], light_rows())


def ball() -> str:
    """The table of trained models."""
    with tempfile.TemporaryDirectory() as place:
        models_in(Path(place))
        rows = ball_rows(Path(place))
    head = ["learner", "depth mm", "own error mm", "in the scene mm", "ratio", "not found"]
    return markdown_table(head, rows)


TABLES = {"kinds": kinds, "light": light, "ball": ball}


if __name__ == "__main__":
    write_tables(PAGE, "tests/validation/scene/light_table.py", TABLES, sys.argv[1:])
