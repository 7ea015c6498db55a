"""What wedge and block ask of MuJoCo: a flex beneath a tip, stepped by hand. Lengths in tip radii, forces in E R²."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from threading import Lock

import mujoco
import numpy as np

from design.arrays import FloatArray, IntArray

CONTACT_TIME = 0.1
"""Time constant of the contact over the time step [-]; smaller ones chatter, larger ones sink in."""
CONTACT = {"solref": [CONTACT_TIME, 1.0], "solimp": [0.9999, 0.9999, 0.001, 0.5, 2.0], "condim": 1}
_TIP_HALF_LENGTH = 4.0
_FLEX_RADIUS = 3e-5


def set_options(spec: mujoco.MjSpec, iterations: int, memory: int) -> None:
    """Static Newton iterations: unit time step, no gravity, no safety floor on contact stiffness."""
    option = spec.option
    option.integrator = mujoco.mjtIntegrator.mjINT_DISCRETE
    option.solver = mujoco.mjtSolver.mjSOL_NEWTON
    option.timestep, option.gravity = 1.0, [0.0, 0.0, 0.0]
    option.tolerance, option.iterations = 1e-8, iterations
    option.disableflags |= mujoco.mjtDisableBit.mjDSBL_REFSAFE
    spec.memory = memory


def add_round_tip(spec: mujoco.MjSpec) -> None:
    """A hemisphere of radius 1 with a straight shank on a body that is moved by hand, 1 above the apex."""
    tip = spec.worldbody.add_body(name="tip", mocap=True, pos=[0.0, 0.0, 2.0])
    size, pos = [1.0, _TIP_HALF_LENGTH, 0.0], [0.0, 0.0, _TIP_HALF_LENGTH]
    tip.add_geom(type=mujoco.mjtGeom.mjGEOM_CAPSULE, size=size, pos=pos, **CONTACT)


def add_flex(
    spec: mujoco.MjSpec,
    owners: list[str],
    offsets: list[float],
    elements: IntArray,
    **material: float,
) -> None:
    """The layer, of vertices that bodies or the world own; `material`: poisson and damping [-]."""
    flex = spec.add_flex(name="layer", dim=3, young=1.0, **material)
    flex.elastic3d = 1
    flex.radius, flex.contype, flex.conaffinity = _FLEX_RADIUS, 1, 1
    flex.selfcollide = mujoco.mjtFlexSelf.mjFLEXSELF_NONE
    flex.condim, flex.solref, flex.solimp = CONTACT["condim"], CONTACT["solref"], CONTACT["solimp"]
    flex.vertbody, flex.vert, flex.elem = owners, offsets, elements.ravel().tolist()


class _Quiet:
    """How many solves want MuJoCo quiet, and the handler that returns with the last of them."""

    lock, solves, previous = Lock(), 0, None


@contextmanager
def quiet_mujoco() -> Iterator[None]:
    """Keep MuJoCo from writing a log file into the working folder; threads may nest it.

    It warns that the unconstrained start of a step is solved to 1e-4 only; that start does not matter for
    a state at rest, which `check_press` judges from its shape.
    """
    with _Quiet.lock:
        if _Quiet.solves == 0:
            _Quiet.previous = mujoco.get_mju_user_warning()
            mujoco.set_mju_user_warning(lambda _message: None)
        _Quiet.solves += 1
    try:
        yield
    finally:
        with _Quiet.lock:
            _Quiet.solves -= 1
            if _Quiet.solves == 0:
                mujoco.set_mju_user_warning(_Quiet.previous)


class PressedFlex:
    """One model being pressed deeper and deeper; so many copies of it make the whole."""

    def __init__(self, model: mujoco.MjModel, copies: float) -> None:
        self.model, self.copies = model, copies
        self.data = mujoco.MjData(model)
        vertical = [j for j in range(model.njnt) if model.jnt_axis[j][2] > 0.5]
        self.vertical_dofs = model.jnt_dofadr[vertical]

    def place(self, depth: float, guess: FloatArray) -> None:
        """Move the tip to `depth` and the vertices to `guess`."""
        self.data.mocap_pos[0] = [0.0, 0.0, 1.0 - depth]
        self.data.qpos[:] = guess

    def step(self) -> float:
        """One damped static iteration; largest motion of a vertex [tip radii]."""
        before = self.data.qpos.copy()
        mujoco.mj_step(self.model, self.data)
        self.data.qvel[:] = 0.0
        return float(np.abs(self.data.qpos - before).max())

    def force(self) -> float:
        """Contact force of the whole [E R²]."""
        return -self.copies * float(self.data.qfrc_constraint[self.vertical_dofs].sum())

    def deformed(self) -> FloatArray:
        """(vertex, 3) the present positions."""
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_flex(self.model, self.data)
        return np.array(self.data.flexvert_xpos)
