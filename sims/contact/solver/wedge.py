"""A round tip pressed into a bonded elastic layer, solved by MuJoCo as a thin axisymmetric wedge.

Model
-----
* Everything is in tip radii and in E·R² for forces, so that the problem has two numbers: layer depth
  and press depth. The layer's shape does not depend on its modulus because the tip is frictionless.
* The layer is a wedge of 0.1 rad around the press axis, made of the r-z triangles of `mesh`, each
  swept into a prism of three tetrahedra. Every vertex has three world-axis slide joints; motion out
  of its radial plane is forbidden by a stiff fixed tendon. (Radial slide joints together with contact
  make the Newton solver return garbage without a warning, hence world axes.)
* Bottom and wall are bonded. The top is free, flat or a sphere about the axis (`crown`), and touched by a tip with
  a straight shank: a capsule for a hemisphere, else the convex bodies of `tip_hulls`. A facet has one contact with
  each of them. Beneath a flat face it wanders over the facet, so flat tips end in narrow cycles more often, and take
  ten times the steps.
* Stable Neo-Hookean material, integrator `discrete` at time step 1: every
  step is one damped static Newton iteration; velocities are zeroed after it. A depth is settled when
  a step moves no vertex by more than 1e-4 tip radii (0.3 µm for a 3 mm tip) nor by 0.04 % of
  the depth (0.02 % at first touch).
* Contact is a stiff penalty, proportional to the vertex mass: too light sinks in, too heavy chatters.
  Where one facet chatters all the same, the mean of its cycle is taken (see `settling`).

What it leaves out: friction and adhesion, viscosity and inertia, nearer walls, the layer's own
weight. Linear tetrahedra lock beyond a Poisson's ratio of 0.49: see `incompressible` for the last bit.
The wedge is a 63-sided polygon seen from above: radii are uncertain by 0.1 %. Prisms are split one way,
so the two faces of the wedge differ a little (9 µm at 3 mm depth on a 0.45 mm mesh); their mean is used.

Method and its traps: feasibility study of this project, section "Contact"; MuJoCo 4.0 documentation,
`flex` and the `discrete` integrator.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from design.arrays import FloatArray, IntArray
from sims.contact.solver import pressed_flex
from sims.contact.solver.mesh import RadialMesh
from sims.contact.solver.press_checks import PressState, StepCheck, check_press, is_balanced, settled_limit
from sims.contact.solver.settling import WINDOW, History
from sims.contact.solver.tip_hulls import tip_hulls
from sims.contact.solver.top_load import contact_forces, shared_out
from sims.contact.tip import HEMISPHERE, TipOutline

WEDGE_ANGLE = 0.1
"""Opening angle of the wedge [rad]."""
DAMPING = 4.0
"""Stiffness-proportional damping over the time step [-]: a step covers 1/(1 + damping) of a Newton step."""
MASS_PER_RADIUS = 0.004
"""Vertex mass over (spacing · angle · radius) [E R]; sets the contact stiffness."""
SMALLEST_MASS_RADIUS = 0.7
"""Vertices nearer to the axis weigh as much as those at this radius [tip radii]."""
HOOP_STIFFNESS = 3300.0
"""Stiffness that forbids motion out of the radial plane [E R]."""
DAMPING_FACTORS = (1.0, 4.0, 16.0)
"""Damping is raised by these where contact chatters; the limit at which a state counts as settled falls with it."""
FEWEST_STEPS, MOST_STEPS = 4, 160
"""Solver steps a depth; slow modes of very deep presses take up to 130."""


@dataclass(frozen=True, kw_only=True)
class WedgeSolution:
    """Settled states, one a depth; lengths in tip radii, forces in E R².

    Attributes
    ----------
    depths : (depth,) press depths
    radii, heights : (depth, top node) deformed top from the axis to the wall, mean of the two faces
    normal_force : (depth, top node) force of the tip on the node, positive where it presses the layer
    force : (depth,) press force
    checks : one record a depth
    """

    depths: FloatArray
    radii: FloatArray
    heights: FloatArray
    normal_force: FloatArray
    force: FloatArray
    checks: tuple[StepCheck, ...]


@dataclass(frozen=True, kw_only=True)
class Tetrahedra:
    """The wedge in space: positions, elements, and the r-z node and angle of every vertex."""

    points: FloatArray
    elements: IntArray
    node: IntArray
    angle: FloatArray

    def face_mean(self, values: FloatArray, nodes: IntArray) -> FloatArray:
        """Mean over the two faces of a value per vertex, for r-z nodes."""
        total = np.bincount(self.node, weights=values)
        return np.asarray((total / np.bincount(self.node))[nodes], dtype=np.float64)


def sweep(mesh: RadialMesh) -> Tetrahedra:
    """Sweep the r-z triangles into tetrahedra; vertices on the axis are shared by both faces."""
    count = len(mesh.nodes)
    on_axis = mesh.nodes[:, 0] < 1e-9
    off_axis = np.flatnonzero(~on_axis)
    far = np.arange(count)
    far[off_axis] = count + np.arange(off_axis.size)
    node = np.concatenate([np.arange(count), off_axis])
    angle = np.concatenate(
        [np.where(on_axis, 0.0, -0.5 * WEDGE_ANGLE), np.full(off_axis.size, 0.5 * WEDGE_ANGLE)]
    )
    radius = mesh.nodes[node, 0]
    points = np.stack([radius * np.cos(angle), radius * np.sin(angle), mesh.nodes[node, 1]], axis=1)
    # splitting along sorted indices gives neighbours the same diagonal on their common face
    a, b, c = np.sort(mesh.triangles, axis=1).T
    prisms = [(a, b, c, far[c]), (a, b, far[b], far[c]), (a, far[a], far[b], far[c])]
    elements = np.concatenate([np.stack(corners, axis=1) for corners in prisms])
    ordered = np.sort(elements, axis=1)
    elements = elements[np.all(np.diff(ordered, axis=1) > 0, axis=1)]
    flipped = np.linalg.det(points[elements[:, 1:]] - points[elements[:, :1]]) < 0
    elements[flipped] = elements[flipped][:, [0, 1, 3, 2]]
    return Tetrahedra(points=points, elements=elements, node=node, angle=angle)


def _add_tip(spec: mujoco.MjSpec, shape: TipOutline) -> None:
    """A tip of radius 1 with a straight shank on a body that is moved by hand, 1 above the apex."""
    if shape == HEMISPHERE:
        pressed_flex.add_round_tip(spec)
        return
    tip = spec.worldbody.add_body(name="tip", mocap=True, pos=[0.0, 0.0, 2.0])
    for index, points in enumerate(tip_hulls(shape)):
        hull = spec.add_mesh(name=f"tip{index}", inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX)
        hull.uservert = (points - [0.0, 0.0, 1.0]).ravel().tolist()
        tip.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=hull.name, **pressed_flex.CONTACT)


def _add_vertex(spec: mujoco.MjSpec, name: str, point: FloatArray, angle: float, mass: float) -> None:
    """A point mass that may move in its radial plane only; on the axis (angle 0) only up and down."""
    body = spec.worldbody.add_body(name=name, pos=point)
    body.mass, body.inertia, body.explicitinertial = mass, [mass] * 3, True
    on_axis = np.hypot(point[0], point[1]) < 1e-9
    for letter, axis in (("x", [1, 0, 0]), ("y", [0, 1, 0]), ("z", [0, 0, 1])):
        joint = body.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis, name=name + letter)
        if on_axis and letter != "z":
            joint.stiffness = [HOOP_STIFFNESS, 0.0, 0.0]
    if not on_axis:
        hoop = spec.add_tendon(name=name)
        hoop.wrap_joint(name + "x", -np.sin(angle))
        hoop.wrap_joint(name + "y", np.cos(angle))
        hoop.stiffness, hoop.springlength = [HOOP_STIFFNESS, 0.0, 0.0], [0.0, 0.0]


def _add_layer(spec: mujoco.MjSpec, mesh: RadialMesh, wedge: Tetrahedra, poisson_ratio: float) -> None:
    """The flex: bonded vertices belong to the world, the others to bodies of their own."""
    spacing = mesh.nodes[mesh.top[1], 0] - mesh.nodes[mesh.top[0], 0]
    owners: list[str] = []
    offsets: list[float] = []
    for index, (point, node, angle) in enumerate(zip(wedge.points, wedge.node, wedge.angle, strict=True)):
        if mesh.is_bonded[node]:
            owners.append("world")
            offsets += point.tolist()
            continue
        radius = max(float(mesh.nodes[node, 0]), SMALLEST_MASS_RADIUS)
        _add_vertex(spec, f"v{index}", point, float(angle), MASS_PER_RADIUS * spacing * WEDGE_ANGLE * radius)
        owners.append(f"v{index}")
        offsets += [0.0, 0.0, 0.0]
    pressed_flex.add_flex(spec, owners, offsets, wedge.elements, poisson=poisson_ratio, damping=DAMPING)


def compile_wedge(
    mesh: RadialMesh, wedge: Tetrahedra, poisson_ratio: float, tip: TipOutline = HEMISPHERE
) -> mujoco.MjModel:
    """Lower the wedge to a MuJoCo model."""
    spec = mujoco.MjSpec()
    pressed_flex.set_options(spec, iterations=200, memory=1 << 30)
    _add_tip(spec, tip)
    _add_layer(spec, mesh, wedge, poisson_ratio)
    return spec.compile()


class _Press(pressed_flex.PressedFlex):
    """One model being pressed deeper and deeper."""

    def __init__(self, mesh: RadialMesh, poisson_ratio: float, tip: TipOutline) -> None:
        self.mesh, self.poisson_ratio, self.tip = mesh, poisson_ratio, tip
        self.wedge = sweep(mesh)
        copies = float(2.0 * np.pi / np.sin(WEDGE_ANGLE))
        super().__init__(compile_wedge(mesh, self.wedge, poisson_ratio, tip), copies)
        self.normal_force = np.zeros(len(mesh.top))

    def _normal_force(self) -> FloatArray:
        """(top node,) contact force on the nodes of the top, whole turn [E R²]."""
        at, force = contact_forces(self.data)
        points = np.asarray(self.data.flexvert_xpos, dtype=np.float64)
        radius = self.wedge.face_mean(np.hypot(points[:, 0], points[:, 1]), self.mesh.top)
        height = self.wedge.face_mean(points[:, 2], self.mesh.top)
        return shared_out(at, self.copies * force, np.stack([radius, height], axis=1))

    def settle(self, depth: float, guess: FloatArray) -> PressState:
        """Move the tip to `depth` and iterate from `guess` until at rest; where contact chatters, damp it harder."""
        self.place(depth, guess)
        for factor in DAMPING_FACTORS:
            self.model.flex_damping[:] = factor * DAMPING
            state = self._iterated(depth, settled_limit(depth) * (1.0 + DAMPING) / (1.0 + factor * DAMPING))
            if state.last_step < settled_limit(depth):
                break
        self.model.flex_damping[:] = DAMPING
        return state

    def _iterated(self, depth: float, limit: float) -> PressState:
        """Iterate until no vertex moves by `limit` in a step of a balanced state, a narrow cycle, or patience ends."""
        history = History()
        loads: deque[FloatArray] = deque(maxlen=WINDOW)
        for count in range(1, MOST_STEPS + 1):
            last_step = self.step()
            loads.append(self._normal_force())
            if not np.isfinite(last_step):
                break
            is_slow = count >= FEWEST_STEPS and last_step < limit
            # between far walls a layer may still drift, in steps below the limit
            if is_slow and is_balanced(self._state(depth, self.force(), last_step, 0.0, count)):
                break
            history.add(self.data.qpos, self.force())
            cycle = history.cycle() if count % WINDOW == 0 else None
            if cycle is not None:
                latest = self.data.qpos.copy()
                self.data.qpos[:] = cycle.mean
                state = self._state(depth, cycle.force, 0.0, cycle.spread, count)
                if is_balanced(state):  # else the cycle still drifts, slowly beside the depth
                    self.normal_force = np.mean(loads, axis=0)
                    return state
                self.data.qpos[:] = latest
        self.normal_force = loads[-1]
        return self._state(depth, self.force(), last_step, 0.0, count)

    def _state(self, depth: float, force: float, last_step: float, chatter: float, steps: int) -> PressState:
        """The present positions as arrays."""
        overlap = max(0.0, -float(self.data.contact.dist.min())) if self.data.ncon else 0.0
        return PressState(
            depth=depth,
            rest=self.wedge.points,
            deformed=self.deformed(),
            elements=self.wedge.elements,
            is_bonded=self.mesh.is_bonded[self.wedge.node],
            poisson_ratio=self.poisson_ratio,
            copies=self.copies,
            contact_force=force,
            overlap=overlap,
            last_step=last_step,
            chatter=chatter,
            steps=steps,
            tip=self.tip,
        )


def solve_wedge(
    mesh: RadialMesh,
    depths: Sequence[float],
    poisson_ratio: float,
    on_step: Callable[[float], None] | None = None,
    tip: TipOutline = HEMISPHERE,
) -> WedgeSolution:
    """Press the tip to each depth in turn and check every settled state.

    Parameters
    ----------
    mesh : the layer, flat or crowned, bonded at its bottom and wall; depths are below its apex
    depths : increasing press depths [tip radii]; a step of more than 1/30 risks divergence
    poisson_ratio : of the layer [-]; beyond 0.49 the tetrahedra lock
    on_step : called with the fraction done
    tip : what presses

    Raises
    ------
    ContactSolveError : a state is not settled, not finite, inverted, sunk in, or out of balance
    """
    found = []
    with pressed_flex.quiet_mujoco():
        for settled in _settled(_Press(mesh, poisson_ratio, tip), depths):
            found.append(settled)
            if on_step is not None:
                on_step(len(found) / len(depths))
    return WedgeSolution(
        depths=np.array(depths, dtype=np.float64),
        radii=np.array([one.radii for one in found]),
        heights=np.array([one.heights for one in found]),
        normal_force=np.array([one.normal_force for one in found]),
        force=np.array([one.check.force for one in found]),
        checks=tuple(one.check for one in found),
    )


@dataclass(frozen=True)
class _Settled:
    """Top surface and checks of one settled state."""

    radii: FloatArray
    heights: FloatArray
    normal_force: FloatArray
    check: StepCheck


def _settled(press: _Press, depths: Sequence[float]) -> Iterator[_Settled]:
    """Settle and check each depth, from the last one moved on."""
    past = present = press.data.qpos.copy()
    past_depth = present_depth = 0.0
    for index, depth in enumerate(depths):
        ratio = (depth - present_depth) / (present_depth - past_depth) if index > 0 else 0.0
        state = press.settle(depth, present + min(ratio, 1.0) * (present - past))
        radius = np.hypot(state.deformed[:, 0], state.deformed[:, 1])
        yield _Settled(
            press.wedge.face_mean(radius, press.mesh.top),
            press.wedge.face_mean(state.deformed[:, 2], press.mesh.top),
            press.normal_force,
            check_press(state),
        )
        past, present = present, press.data.qpos.copy()
        past_depth, present_depth = present_depth, depth
