"""Pads in MuJoCo that several tests press; each is made once."""

from __future__ import annotations

from functools import cache

import mujoco
import numpy as np

from optopad.design.draft import Draft
from optopad.design.preset import preset
from optopad.design.spec import SensorDesign
from optopad.fabrication.scene.contact_fit import tuned
from optopad.fabrication.scene.mjcf import pad_spec

FLAT, ROUND, DOME = "gripper-teensy", "gripper-stadium", "fingertip-dome"
SHAPES = (FLAT, ROUND, DOME, "piacenza2017-pad", "levi2013-disc", "crowned-40x25")
GAP_MM = 0.1
"""Gap between the ball and the top in a new model [mm]."""


@cache
def design_of(name: str) -> SensorDesign:
    return preset(name)


def ball_model(
    name: str,
    *,
    mass: float = 0.05,
    step: float = 0.002,
    at_mm: tuple[float, float] | None = None,
    **options: float,
) -> mujoco.MjModel:
    """A pad named left on a fixed mount, and above it a ball of the tip's radius that slides along z."""
    design = design_of(name)
    spec = mujoco.MjSpec()
    spec.option.timestep, spec.option.gravity = step, [0.0, 0.0, 0.0]
    for key, value in options.items():
        setattr(spec.option, key, value)
    spec.attach(pad_spec(design), prefix="left_", site=spec.worldbody.add_site(name="mount"))
    radius = design.indenter.tip_radius_mm * 1e-3
    body = spec.worldbody.add_body(
        name="ball", pos=top_m(design, at_mm) + np.array([0.0, 0.0, radius + GAP_MM * 1e-3])
    )
    body.add_joint(name="press", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[0.0, 0.0, 1.0])
    body.add_geom(name="ball", size=[radius, 0.0, 0.0], mass=mass)
    model = spec.compile()
    tuned(model, "left")
    return model


def top_m(design: SensorDesign, at_mm: tuple[float, float] | None = None) -> np.ndarray:
    """A point of the untouched top, relative to the mount [m]."""
    draft = Draft.of(design)
    x, y = at_mm or draft.plan.centre_mm
    middle = np.array([*draft.plan.centre_mm, draft.outline.bottom_mm])
    return (np.array([x, y, draft.plan.top_mm(x, y)]) - middle) * 1e-3


def settled_depth_mm(
    model: mujoco.MjModel, force_n: float, *, ramp_s: float = 0.4, rest_s: float = 0.4
) -> float:
    """Depth of the ball at rest under a force that grows from 0 [mm]."""
    data, joint = mujoco.MjData(model), model.joint("press").dofadr[0]
    while data.time < ramp_s + rest_s:
        data.qfrc_applied[joint] = -force_n * min(data.time / ramp_s, 1.0)
        mujoco.mj_step(model, data)
    assert data.ncon == 1
    assert abs(data.qvel[joint]) < 1e-5
    return -data.contact[0].dist * 1e3
