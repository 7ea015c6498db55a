"""A round tip pressed into a rectangular pad with bonded bottom and walls, solved by MuJoCo in three dimensions.

Model: as in `wedge` (Stable Neo-Hookean, frictionless hemisphere with a shank, stiff contact, integrator
`discrete` at time step 1, velocities zeroed after each step), but of the whole pad or, where it is symmetric in y,
of its half y >= 0, and on the much coarser mesh of `block_mesh`. Only differences between two pads on one
mesh are meant to be used: each surface by itself carries that mesh's error, which their difference does not.

Poisson's ratio is 0.495, between the wedge's 0.49 and rubber's 0.4999: nearer walls confine the layer,
so that their effect grows with incompressibility; `docs/validation/walls.md` has the figures.

Every state is checked as a wedge's is: settled, finite, no inverted element, force against the reaction of
bottom and walls. The overlap of facets with the tip is not limited by the wedge's bound, because a coarse facet's
chord lies inside the tip by construction; that of nodes is.
All lengths in tip radii, forces in E R².
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from sims.contact.solver import pressed_flex
from sims.contact.solver.block_mesh import BlockMesh
from sims.contact.solver.press_checks import (
    BALANCE_LIMIT,
    ContactSolveError,
    PressState,
    StepCheck,
    measure_press,
)
from sims.contact.solver.settling import WINDOW, History

FloatArray = NDArray[np.float64]

DAMPING = 1.0
"""Stiffness-proportional damping over the time step [-]: a step covers half of a Newton step."""
MASS_PER_AREA = 0.004
"""Vertex mass over spacing² [E R]; sets the contact stiffness."""
SYMMETRY_STIFFNESS = 3300.0
"""Stiffness that holds the nodes of the plane of symmetry in it [E R]."""
DAMPING_FACTORS = (1.0, 4.0)
"""Damping is raised by these where contact chatters; the limit at which a state counts as settled falls with it."""
FEWEST_STEPS, MOST_STEPS = 4, 80
"""Solver steps a depth."""
SETTLED_LIMIT = 5e-4
"""Largest last step of a settled state [tip radii]: 1.5 um for a 3 mm tip. With a damping of 1 the way left is about
as long as the last step."""
NODE_OVERLAP_LIMIT = 0.05
"""Deepest a node of the top may lie inside the tip [tip radii]. Contact is a penalty, which gives way by up to 0.045 in
the deepest presses, in both pads of a difference alike; `docs/validation/walls.md` has the effect of a stiffer one."""
APPROACH_STEP = 0.12
"""Largest move of the tip between two equilibria [tip radii]."""


@dataclass(frozen=True, kw_only=True)
class BlockState:
    """One settled state; lengths in tip radii, force in E R².

    Attributes
    ----------
    depth, force : press depth and force of the whole pad
    top : (top node, 3) deformed top of the master mesh; nodes beyond a wall stay at rest
    check : what the checks found
    """

    depth: float
    force: float
    top: FloatArray
    check: StepCheck


def _add_vertex(spec: mujoco.MjSpec, name: str, point: FloatArray, mass: float, held: bool) -> None:
    """A point mass on three slide joints; `held` keeps it in the plane of symmetry."""
    body = spec.worldbody.add_body(name=name, pos=point)
    body.mass, body.inertia, body.explicitinertial = mass, [mass] * 3, True
    for axis in ([1, 0, 0], [0, 1, 0], [0, 0, 1]):
        joint = body.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis)
        if held and axis[1]:
            joint.stiffness = [SYMMETRY_STIFFNESS, 0.0, 0.0]


def compile_block(mesh: BlockMesh, spacing: float, poisson_ratio: float, stiffness: float) -> mujoco.MjModel:
    """Lower the pad to a MuJoCo model."""
    spec = mujoco.MjSpec()
    pressed_flex.set_options(spec, iterations=100, memory=3 << 30)
    pressed_flex.add_round_tip(spec)
    owners: list[str] = []
    offsets: list[float] = []
    for index, (point, bonded) in enumerate(zip(mesh.points, mesh.is_bonded, strict=True)):
        owners.append("world" if bonded else f"v{index}")
        offsets += point.tolist() if bonded else [0.0, 0.0, 0.0]
        if not bonded:
            held = mesh.is_half and bool(abs(point[1]) < 1e-9)
            _add_vertex(spec, f"v{index}", point, stiffness * MASS_PER_AREA * spacing**2, held)
    pressed_flex.add_flex(spec, owners, offsets, mesh.elements, poisson=poisson_ratio, damping=DAMPING)
    return spec.compile()


class _Press(pressed_flex.PressedFlex):
    """One pad being pressed deeper and deeper."""

    def __init__(self, mesh: BlockMesh, spacing: float, poisson_ratio: float, stiffness: float) -> None:
        self.mesh, self.poisson_ratio = mesh, poisson_ratio
        super().__init__(compile_block(mesh, spacing, poisson_ratio, stiffness), 2.0 if mesh.is_half else 1.0)
        self.rest = self.data.qpos.copy()

    def settle(self, depth: float, guess: FloatArray, most_steps: int) -> PressState:
        """Move the tip and iterate until at rest; where contact chatters, damp it harder."""
        self.place(depth, guess)
        for factor in DAMPING_FACTORS:
            self.model.flex_damping[:] = factor * DAMPING
            limit = SETTLED_LIMIT * (1.0 + DAMPING) / (1.0 + factor * DAMPING)
            state = self._iterated(depth, limit, most_steps)
            if state.last_step < limit or most_steps < MOST_STEPS or not np.isfinite(state.last_step):
                break
        self.model.flex_damping[:] = DAMPING
        return state

    def _iterated(self, depth: float, limit: float, most_steps: int) -> PressState:
        """Iterate until no vertex moves by `limit` in a step, until a narrow cycle, or `most_steps` times."""
        history = History()
        for count in range(1, most_steps + 1):
            last_step = self.step()
            if not np.isfinite(last_step) or (count >= FEWEST_STEPS and last_step < limit):
                break
            history.add(self.data.qpos, self.force())
            cycle = history.cycle() if count % WINDOW == 0 else None
            if cycle is not None:
                self.data.qpos[:] = cycle.mean
                return self._state(depth, cycle.force, 0.0, cycle.spread, count)
        return self._state(depth, self.force(), last_step, 0.0, count)

    def _state(self, depth: float, force: float, last_step: float, chatter: float, steps: int) -> PressState:
        return PressState(
            depth=depth,
            rest=self.mesh.points,
            deformed=self.deformed(),
            elements=self.mesh.elements,
            is_bonded=self.mesh.is_bonded,
            poisson_ratio=self.poisson_ratio,
            copies=self.copies,
            contact_force=force,
            overlap=0.0,
            last_step=last_step,
            chatter=chatter,
            steps=steps,
        )


def _complaints(check: StepCheck) -> list[str]:
    found = []
    if not check.last_step <= SETTLED_LIMIT:
        found.append(f"not settled: last step {check.last_step:.1e}, limit {SETTLED_LIMIT:.0e} tip radii")
    if not check.penetration <= NODE_OVERLAP_LIMIT:
        found.append(f"a node {check.penetration:.3f} tip radii inside the tip, limit {NODE_OVERLAP_LIMIT}")
    if not check.smallest_stretch > 0.0:
        found.append(f"inverted element: volume ratio {check.smallest_stretch:.2f}")
    if not abs(check.force - check.reaction) <= BALANCE_LIMIT * check.force:
        found.append(f"force {check.force:.4e} against reaction {check.reaction:.4e} E R²")
    return found


def _checked(state: PressState) -> StepCheck:
    where = f"block solver at a depth of {state.depth:.4f} tip radii"
    if not np.isfinite(state.deformed).all():
        raise ContactSolveError(f"{where}: positions are not finite; use a finer mesh or smaller steps")
    check = measure_press(state)
    if found := _complaints(check):
        raise ContactSolveError(f"{where}: {'; '.join(found)}")
    return check


def _path(depths: Sequence[float]) -> Iterator[tuple[float, bool]]:
    """Depths on the way, at most `APPROACH_STEP` apart, and whether each is asked for."""
    last = 0.0
    for depth in depths:
        count = int(np.ceil((depth - last) / APPROACH_STEP - 1e-9))
        for index in range(1, count + 1):
            yield last + (depth - last) * index / count, index == count
        last = depth


def solve_block(
    mesh: BlockMesh, depths: Sequence[float], spacing: float, poisson_ratio: float, stiffness: float = 1.0
) -> Iterator[BlockState]:
    """Press the tip to each depth in turn; yields every checked state as it is found.

    Parameters
    ----------
    mesh : the pad
    depths : increasing press depths [tip radii]
    spacing : edge of the hexahedra under the tip [tip radii]
    poisson_ratio : of small strains [-]
    stiffness : of the contact, over the usual one [-]

    Raises
    ------
    ContactSolveError : a state is not settled, not finite, inverted, sunk in, or out of balance
    """
    with pressed_flex.quiet_mujoco():
        press = _Press(mesh, spacing, poisson_ratio, stiffness)
        past = present = press.rest
        past_depth = present_depth = 0.0
        for depth, wanted in _path(depths):
            ratio = (depth - present_depth) / (present_depth - past_depth) if past_depth > 0.0 else 0.0
            guess = present + min(ratio, 1.0) * (present - past)
            state = press.settle(depth, guess, MOST_STEPS if wanted else FEWEST_STEPS + 2)
            if wanted:
                yield _block_state(mesh, state)
            past, present = present, press.data.qpos.copy()
            past_depth, present_depth = present_depth, depth


def _block_state(mesh: BlockMesh, state: PressState) -> BlockState:
    check = _checked(state)
    top = np.column_stack([mesh.top, np.zeros(len(mesh.top))])
    is_free = mesh.top_node >= 0
    top[is_free] = state.deformed[mesh.top_node[is_free]]
    return BlockState(depth=state.depth, force=check.force, top=top, check=check)
