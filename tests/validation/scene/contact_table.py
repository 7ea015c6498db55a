"""Force of a pad in MuJoCo against the models of contact: balls of the tip's radius, and other objects.

    python -m tests.validation.scene.contact_table     writes the tables of docs/validation/scene.md; half a minute

A ball is pressed by a force that grows from 0 and stays; its depth at rest gives the contact model's force to compare
with. Objects are held at a depth; MuJoCo's force there is the sum over its contacts. The model of objects
(`optopad.sims.held`) refuses sharp edges deeper than a sixth of the layer.
"""

from __future__ import annotations

import sys
from pathlib import Path

import mujoco
import numpy as np

from optopad.design.draft import Draft
from optopad.design.errors import ModelScopeError
from optopad.design.held_object import held_of
from optopad.fabrication.scene.contact_fit import contact_fit, tuned
from optopad.fabrication.scene.mjcf import pad_spec
from optopad.sims.contact.indentation import solved_press
from optopad.sims.contact.scope import contact_of
from optopad.sims.held import AskedPress, pressed
from tests.fabrication.scene.pads import SHAPES, ball_model, design_of, settled_depth_mm, top_m
from tests.validation.contact.contact_table import markdown_table, write_tables

PAGE = Path(__file__).parents[3] / "docs" / "validation" / "scene.md"
STEPS_MS, MASSES_KG, DEPTHS_MM = (1, 2, 4), (0.005, 0.05, 0.5, 2.0), (0.3, 0.6, 1.0, 1.5, 2.0, 3.0)
PAD, HELD_MM = "piacenza2017-pad", (0.5, 1.0, 1.5)
GEOM = mujoco.mjtGeom
LYING = [np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0]
OBJECTS = {
    "sphere,radius=3": (GEOM.mjGEOM_SPHERE, [3.0, 0.0, 0.0], 3.0),
    "sphere,radius=8": (GEOM.mjGEOM_SPHERE, [8.0, 0.0, 0.0], 8.0),
    "cylinder,radius=5,length=12": (GEOM.mjGEOM_CYLINDER, [5.0, 6.0, 0.0], 5.0),
    "cylinder,radius=5,length=24": (GEOM.mjGEOM_CYLINDER, [5.0, 12.0, 0.0], 5.0),
    "box,length=6,width=6,height=6": (GEOM.mjGEOM_BOX, [3.0, 3.0, 3.0], 3.0),
    "box,length=12,width=12,height=12": (GEOM.mjGEOM_BOX, [6.0, 6.0, 6.0], 6.0),
}
"""Objects as `optopad press` names them, and as geoms: half sizes, and height of the middle over the foot [mm]."""


def force_rows() -> list[list[str]]:
    """A row for each pad and mass: the error at each depth with the largest size over the time steps."""
    found = []
    for name in SHAPES:
        fit = contact_fit(design_of(name))
        press = solved_press(contact_of(design_of(name)), float(fit.depth_mm[-1]))
        depths = [depth for depth in DEPTHS_MM if depth <= fit.depth_mm[-1] + 1e-9]
        for mass in MASSES_KG:
            worst = np.zeros(len(depths))
            for step in STEPS_MS:
                model = ball_model(name, mass=mass, step=step * 1e-3)
                for k, depth in enumerate(depths):
                    force = float(fit.force_at_n(depth))
                    rests = settled_depth_mm(model, force, rest_s=0.4 + 2.0 * mass)
                    error = force / press.force_n(min(rests, float(fit.depth_mm[-1]))) - 1.0
                    worst[k] = max(worst[k], error, key=abs)
            cells = [f"{100 * one:+.1f}" for one in worst] + ["-"] * (len(DEPTHS_MM) - len(depths))
            found.append([name, f"{1e3 * mass:g}", *cells])
    return found


def object_rows() -> list[list[str]]:
    """A row for each object and depth: both forces and MuJoCo's number of contacts."""
    found = []
    for words in OBJECTS:
        for depth in HELD_MM:
            asked = AskedPress(
                held=(held_of(words),), at_mm=Draft.of(design_of(PAD)).plan.centre_mm, depth_mm=depth
            )
            try:
                model_n = f"{pressed(Draft.of(design_of(PAD)), asked).force_n:.1f}"
            except ModelScopeError:
                model_n = "refused"
            count, force = _mujoco_force_n(words, depth)
            found.append([words, f"{depth:g}", model_n, f"{force:.1f}", f"{count}"])
    return found


def _mujoco_force_n(words: str, depth_mm: float) -> tuple[int, float]:
    """MuJoCo's number of contacts and force of an object held at a depth."""
    design = design_of(PAD)
    kind, half_mm, middle_mm = OBJECTS[words]
    spec = mujoco.MjSpec()
    spec.attach(pad_spec(design), prefix="left_", site=spec.worldbody.add_site(name="mount"))
    place = top_m(design) + np.array([0.0, 0.0, middle_mm - depth_mm]) * 1e-3
    body = spec.worldbody.add_body(name="object", pos=place, gravcomp=1.0)
    body.add_freejoint()
    lies = LYING if kind == GEOM.mjGEOM_CYLINDER else [1.0, 0.0, 0.0, 0.0]
    body.add_geom(
        type=kind, size=np.array(half_mm) * 1e-3, quat=lies, mass=1e3
    )  # so heavy that it hardly moves
    model = spec.compile()
    tuned(model, "left")
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return data.ncon, float(data.qfrc_constraint[2])


def force() -> str:
    """The table of balls."""
    return markdown_table(["pad", "g", *(f"{one:g} mm" for one in DEPTHS_MM)], force_rows())


def objects() -> str:
    """The table of other objects."""
    return markdown_table(["object", "mm", "model N", "MuJoCo N", "contacts"], object_rows())


TABLES = {"force": force, "objects": objects}


if __name__ == "__main__":
    write_tables(PAGE, "tests/validation/scene/contact_table.py", TABLES, sys.argv[1:])
