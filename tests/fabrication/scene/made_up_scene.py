"""A scene with pads as `optopad scene` names their parts, and a stand-in for the map of light.

A pad is a box whose top is the untouched top, with the site of the cavity frame. The light of a pair falls with the
overlap near the straight line between its parts.
"""

from __future__ import annotations

import re
from functools import cached_property

import mujoco
import numpy as np

import optopad
from optopad.design.arrays import FloatArray
from optopad.design.shape.cavity import cavity_of
from optopad.design.spec import SensorDesign
from optopad.sims.readings.signal_chain import without_noise
from optopad.sims.robot.fast_light import Imprint
from optopad.sims.robot.shapes import Shape, overlap_mm

TIP_RADIUS_MM = 5.0
DESIGN = optopad.load("fingertip-16")
QUIET = without_noise(DESIGN)
"""The design without noise: counts are gain times light."""


class StandInLight:
    """Light that falls exponentially with the overlap along each pair's path."""

    def __init__(self, design: SensorDesign = DESIGN, deepest_mm: float = 3.0) -> None:
        self.digest, self.deepest_mm = design.digest, deepest_mm
        self._cavity = cavity_of(design)
        x, y = (np.linspace(0.5, side - 0.5, 15) for side in (self._cavity.length_mm, self._cavity.width_mm))
        height = np.full(225, self._cavity.clear_mm)
        self.points_mm = np.column_stack([one.ravel() for one in np.meshgrid(x, y)] + [height])
        self.normals = np.array([[0.0, 0.0, 1.0]])

    @cached_property
    def untouched(self) -> FloatArray:
        emitters, receivers = len(self._cavity.emitters), len(self._cavity.receivers)
        return 1e-3 * (1.0 + 0.1 * np.arange(emitters * receivers).reshape(emitters, receivers) % 1.0)

    @cached_property
    def kernel(self) -> FloatArray:
        """(node, emitter, receiver) loss of a pair's light per overlap [1/mm]."""
        nodes = self.points_mm[:, None, None, :2]
        start = np.array([one.position_mm[:2] for one in self._cavity.emitters])[:, None]
        end = np.array([one.position_mm[:2] for one in self._cavity.receivers])[None]
        way = end - start
        along = np.clip(((nodes - start) * way).sum(-1) / (way**2).sum(-1), 0.0, 1.0)
        far_mm = np.linalg.norm(nodes - start - along[..., None] * way, axis=-1)
        return 0.03 * np.exp(-((far_mm / 2.0) ** 2))

    def imprint(self, shape: Shape, centre_mm: FloatArray, turn: FloatArray) -> Imprint:
        return flat_imprint(overlap_mm(shape, centre_mm, turn, self.points_mm, self.normals))

    def ratios(self, imprint: Imprint) -> FloatArray:
        overlap = imprint.limited(self.deepest_mm).overlap_mm
        return np.exp(-np.tensordot(np.maximum(overlap, 0.0), self.kernel, 1))


def flat_imprint(overlap_mm: FloatArray) -> Imprint:
    """Imprint with given overlaps (n, node)."""
    balls = np.empty((len(overlap_mm), 0, 3))
    return Imprint(overlap_mm=overlap_mm, balls_mm=balls, deepest_mm=overlap_mm.max(axis=1))


def pad_body(prefix: str = "", at_m: float = 0.0, design: SensorDesign = DESIGN) -> str:
    """MJCF of a pad whose cavity begins at x = `at_m`."""
    cavity = cavity_of(design)
    x, y, z = (side / 2e3 for side in (cavity.length_mm, cavity.width_mm, cavity.clear_mm))
    return f"""
      <!--{prefix} {design.digest}-->
      <body name="{prefix}pad" pos="{at_m} 0 0">
        <body name="{prefix}pad_face">
          <geom name="{prefix}pad_top" type="box" size="{x} {y} {z}" pos="{x} {y} {z}" priority="1"/>
        </body>
        <site name="{prefix}pad_cavity"/>
      </body>"""


def ball(name: str = "ball", radius_mm: float = TIP_RADIUS_MM) -> str:
    """MJCF of a free ball, far from the pads."""
    return (
        f'<body name="{name}" pos="0 0 1"><freejoint/><geom name="{name}" size="{radius_mm / 1e3}"/></body>'
    )


def scene(*bodies: str, step_s: float = 0.002, assets: str = "") -> mujoco.MjModel:
    """Compiled model of the given bodies."""
    pads = re.findall(r"<!--(\w*) (\w+)-->", "".join(bodies))
    custom = "".join(
        f'<numeric name="{prefix}pad_inverse_weight" data="1e4"/><text name="{prefix}pad_design" data="{digest}"/>'
        for prefix, digest in pads
    )
    return mujoco.MjModel.from_xml_string(
        f'<mujoco><option timestep="{step_s}"/><asset>{assets}</asset><custom>{custom}</custom>'
        f"<worldbody>{''.join(bodies)}</worldbody></mujoco>"
    )


class Press:
    """Holds the only free body at a location of a pad's top, at given depths."""

    def __init__(self, model: mujoco.MjModel, x_mm: float, y_mm: float, *, at_m: float = 0.0) -> None:
        self.model, self.data = model, mujoco.MjData(model)
        cavity = cavity_of(DESIGN)
        self._top_mm = np.array([x_mm + 1e3 * at_m, y_mm, cavity.clear_mm + TIP_RADIUS_MM])

    def to(self, depth_mm: float) -> mujoco.MjData:
        """Place the ball so deep, without a step of time."""
        self.data.qpos[:3] = (self._top_mm - [0.0, 0.0, depth_mm]) / 1e3
        self.data.qvel[:] = 0.0
        mujoco.mj_forward(self.model, self.data)
        return self.data

    def step(self, depth_mm: float) -> mujoco.MjData:
        """One step of time, at whose end the ball is so deep."""
        mujoco.mj_step(self.model, self.data)
        return self.to(depth_mm)
