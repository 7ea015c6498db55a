"""A gripper with two pads closes on an object that differs from episode to episode, for `optopad.envs`.

The gripper of the demo scene is at the height of the object and moves its fingers alone. The object is a cylinder, a
box or a ball of a random size; it stands on a post, at a random place between the fingers. The fingers start
`START_MM` away from the largest object, and follow a position that closes at the speed that is asked for.
"""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from optopad.design.spec import SensorDesign
from optopad.fabrication.driver.link.frames import Frame
from optopad.fabrication.scene.contact_fit import pad_geom, tuned
from optopad.fabrication.scene.demo import (
    LIFT_MM,
    OBJECTS,
    OPEN_MM,
    TALL,
    add_object,
    grip_force_n,
    gripper_spec,
    sizes_of,
)
from optopad.fabrication.scene.mjcf import M_PER_MM
from optopad.fabrication.scene.pad_light import PadLight
from optopad.fabrication.scene.simulated_pad import SimulatedPad
from optopad.sims.robot.fast_light import light_of

PAD = "left"
SMALLEST, LARGEST = 0.24, 0.36
"""Half size of an object across the fingers, over the pad's width [-]."""
BESIDE, OFF_MIDDLE_MM = 0.12, 1.0
"""Largest distance of an object from the pad's middle, over the pad's width [-], and from the gripper's middle [mm]."""
START_MM = (1.0, 3.0)
"""Range of the gap between a finger and the object at the beginning [mm]."""
STRONGEST = 10.0
"""Largest force of a finger, over the demo's."""
POST = 0.06
"""Half size of the post across the fingers, over the pad's width [-]."""
STEPS = 10
"""Steps of time of a step of control."""


class GraspScene:
    """The gripper and one object at a time.

    Parameters
    ----------
    design : the pads' design
    light : map of its light, as `SimulatedPad` takes it
    """

    def __init__(self, design: SensorDesign, light: PadLight | str | None = None) -> None:
        self._design = design
        self._light = light_of(design, light) if light is None or isinstance(light, str) else light
        self._sizes = sizes_of(design)
        self._spec = gripper_spec(design, STRONGEST * grip_force_n(design))
        self._bodies: list[str] = []
        self._renderer: mujoco.Renderer | None = None
        self.object: dict[str, Any] = {}

    def begin(self, rng: np.random.Generator) -> None:
        """Draw an object, and open the fingers around it."""
        size = self._sizes
        kind = str(rng.choice(OBJECTS))
        half = rng.uniform(SMALLEST, LARGEST) * size.width
        x, z = rng.uniform(-BESIDE, BESIDE, 2) * size.width
        y = rng.uniform(-OFF_MIDDLE_MM, OFF_MIDDLE_MM) * M_PER_MM
        gap = rng.uniform(*START_MM) * M_PER_MM
        for name in self._bodies:
            self._spec.delete(self._spec.body(name))
        self._bodies = [kind, f"{kind}_post"]
        add_object(
            self._spec,
            kind,
            (x, y, size.grip_z + z),
            half,
            TALL * size.width * rng.uniform(0.7, 1.0),
            POST * size.width,
        )
        self.close_renderer()
        self.model = self._spec.compile()
        self.model.opt.disableflags |= (
            mujoco.mjtDisableBit.mjDSBL_SENSOR
        )  # taxels take half of the time of a step
        tuned(self.model, "right")  # `SimulatedPad` tunes the left one
        self.data = mujoco.MjData(self.model)
        self._geom = pad_geom(self.model, PAD)
        opened = size.half + OPEN_MM * M_PER_MM
        self._closed = max(opened - half - abs(y) - gap, 0.0)
        self.data.joint("carriage_z").qpos = self.data.actuator("carriage_z").ctrl = -LIFT_MM * M_PER_MM
        for name in ("left_slide", "right_slide"):
            self.data.joint(name).qpos = self.data.actuator(name).ctrl = self._closed
        mujoco.mj_forward(self.model, self.data)
        self.object = {"kind": kind, "half_mm": half / M_PER_MM, "x_mm": x / M_PER_MM, "z_mm": z / M_PER_MM}
        self.pad = SimulatedPad(
            self.model, self._design, PAD, light=self._light, seed=int(rng.integers(2**31)), baseline_s=0.5
        )
        self.frame: Frame = self.pad.frame(self.data)

    @property
    def step_s(self) -> float:
        """Time of a step of control [s]."""
        return STEPS * float(self.model.opt.timestep)

    def close(self, speed_mm_s: float) -> None:
        """Close the fingers for one step of control, or open them at a negative speed."""
        slide = self.model.actuator("left_slide").ctrlrange[1]
        self._closed = float(np.clip(self._closed + speed_mm_s * M_PER_MM * self.step_s, 0.0, slide))
        for name in ("left_slide", "right_slide"):
            self.data.actuator(name).ctrl = self._closed
        for _ in range(STEPS):
            mujoco.mj_step(self.model, self.data)
        self.frame = self.pad.frame(self.data)

    @property
    def depth_mm(self) -> float:
        """Depth of the touch of the pad, from MuJoCo; 0 without one."""
        is_own = (self.data.contact.geom == self._geom).any(axis=1)
        return float(max(-self.data.contact.dist[is_own].min(initial=0.0), 0.0)) / M_PER_MM

    def picture(self, height: int = 480, width: int = 640) -> NDArray[np.uint8]:
        """Picture (height, width, 3) of the scene, by 8-bit colours."""
        if self._renderer is None:
            self._renderer = mujoco.Renderer(self.model, height, width)
        self._renderer.update_scene(self.data, "near")
        return np.asarray(self._renderer.render())

    def close_renderer(self) -> None:
        """Free the renderer, if there is one."""
        if self._renderer is not None:
            self._renderer.close()
        self._renderer = None
