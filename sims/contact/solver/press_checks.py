"""Is a solved press to be believed? Checks from the deformed shape alone, independent of MuJoCo.

A state passes when it is settled and finite, no element is inverted, the top has not sunk into the
tip, and the force on the tip equals the reaction of the bonded bottom and wall, which is computed
from the deformed shape by `neo_hookean`. A state that fails raises; nothing is repaired.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from design.arrays import BoolArray, FloatArray, IntArray
from sims.contact.solver.neo_hookean import elastic_energy, nodal_forces, volumes
from sims.contact.solver.settling import CHATTER_LIMIT
from sims.contact.tip import HEMISPHERE, TipOutline, tip_gap

SETTLED_LIMIT = 1e-4
"""Largest last step of any vertex [tip radii]."""
SHALLOW = 0.05
"""Depth below which the contact spans a few nodes only, and a step moves its force more [tip radii]."""
SHALLOW_SHARE, DEEP_SHARE = 2e-4, 4e-4
"""Largest last step of any vertex as a fraction of the depth [-], for shallow presses and for deeper ones."""
PENETRATION_LIMIT = 0.02
"""Deepest a surface facet may lie inside the tip [tip radii]: 60 µm for a 3 mm tip."""
BALANCE_LIMIT = 0.01
"""Largest difference between contact force and reaction, as a fraction of the force, [-]."""
BALANCE_FLOOR = 1e-4
"""Forces below this are compared absolutely [E R²]: 0.9 mN for 3 mm and 1 MPa."""


class ContactSolveError(RuntimeError):
    """The contact solver returned a state that fails its own checks."""


@dataclass(frozen=True, kw_only=True)
class PressState:
    """One state of the wedge; lengths in tip radii, forces in E R².

    Attributes
    ----------
    depth : press depth
    rest, deformed : (vertex, 3) positions
    elements : (tetrahedron, 4) vertex indices
    is_bonded : (vertex,) True where the layer is bonded
    poisson_ratio : [-]
    copies : how many wedges make the full turn [-]
    contact_force : force of the full turn on the tip
    overlap : deepest overlap of a surface facet with the tip, as the solver sees it
    last_step : largest motion of a vertex in the last solver step
    chatter : largest distance of a vertex from the mean of the cycle that this state is; 0: no cycle
    steps : solver steps taken [-]
    tip : what presses
    """

    depth: float
    rest: FloatArray
    deformed: FloatArray
    elements: IntArray
    is_bonded: BoolArray
    poisson_ratio: float
    copies: float
    contact_force: float
    overlap: float
    last_step: float
    chatter: float
    steps: int
    tip: TipOutline = HEMISPHERE


@dataclass(frozen=True, kw_only=True)
class StepCheck:
    """What the checks of one depth found; lengths in tip radii, forces in E R².

    Attributes
    ----------
    depth, force : press depth and force
    reaction : vertical reaction of the bonded surfaces
    penetration : deepest overlap of the layer with the tip, by facets and by vertices
    last_step : largest motion of a vertex in the last solver step
    chatter : largest distance of a vertex from the mean of the cycle that this state is; 0: no cycle
    smallest_stretch : smallest volume ratio of an element [-]
    volume_loss : volume lost by compression, whole turn [R³]
    energy : elastic energy of the layer, whole turn [E R³]
    steps : solver steps taken [-]
    """

    depth: float
    force: float
    reaction: float
    penetration: float
    last_step: float
    chatter: float
    smallest_stretch: float
    volume_loss: float
    energy: float
    steps: float


def settled_limit(depth: float) -> float:
    """Largest last step of a settled state at this depth [tip radii]."""
    share = DEEP_SHARE if depth > SHALLOW else SHALLOW_SHARE
    return min(SETTLED_LIMIT, share * depth)


def _reaction(state: PressState) -> float:
    """Vertical force that the layer exerts on its bonded vertices, downwards positive."""
    forces = nodal_forces(state.rest, state.deformed, state.elements, 1.0, state.poisson_ratio)
    return -state.copies * float(forces[state.is_bonded, 2].sum())


def _balances(force: float, reaction: float) -> bool:
    """Whether the force on the tip is that on the bonded surfaces; False where one is no number."""
    return abs(force - reaction) <= BALANCE_LIMIT * max(force, BALANCE_FLOOR)


def is_balanced(state: PressState) -> bool:
    """Whether the force on the tip is that on the bonded surfaces."""
    return _balances(state.contact_force, _reaction(state))


def _penetration(state: PressState) -> float:
    """Deepest overlap; vertices are looked at too, because the solver sees no contact that it missed."""
    radius = np.hypot(state.deformed[:, 0], state.deformed[:, 1])
    return max(
        state.overlap, 0.0, -float(tip_gap(radius, state.deformed[:, 2], state.depth, state.tip).min())
    )


def measure_press(state: PressState) -> StepCheck:
    """Measure a state without judging it."""
    rest_volumes = volumes(state.rest, state.elements)
    present_volumes = volumes(state.deformed, state.elements)
    energy = elastic_energy(state.rest, state.deformed, state.elements, 1.0, state.poisson_ratio)
    return StepCheck(
        depth=state.depth,
        force=state.contact_force,
        reaction=_reaction(state),
        penetration=_penetration(state),
        last_step=state.last_step,
        chatter=state.chatter,
        smallest_stretch=float((present_volumes / rest_volumes).min()),
        volume_loss=state.copies * float((rest_volumes - present_volumes).sum()),
        energy=state.copies * energy,
        steps=float(state.steps),
    )


def _complaints(check: StepCheck) -> list[str]:
    """What is wrong with a measured state, in words."""
    found = []
    limit = settled_limit(check.depth)
    if not check.last_step <= limit:
        found.append(f"not settled: last step {check.last_step:.1e}, limit {limit:.0e} tip radii")
    if not check.chatter <= CHATTER_LIMIT:
        found.append(f"chatter of {check.chatter:.1e}, limit {CHATTER_LIMIT:.0e} tip radii")
    if not check.penetration <= PENETRATION_LIMIT:
        found.append(f"surface {check.penetration:.3f} tip radii inside the tip, limit {PENETRATION_LIMIT}")
    if not check.smallest_stretch > 0.0:
        found.append(f"inverted element: volume ratio {check.smallest_stretch:.2f}")
    if not _balances(check.force, check.reaction):
        found.append(f"force {check.force:.4e} against reaction {check.reaction:.4e} E R²")
    return found


def check_press(state: PressState) -> StepCheck:
    """Measure a state and raise `ContactSolveError` if it cannot be believed."""
    where = f"contact solver at a depth of {state.depth:.4f} tip radii"
    if not np.isfinite(state.deformed).all():
        raise ContactSolveError(f"{where}: positions are not finite; use a finer mesh")
    check = measure_press(state)
    found = _complaints(check)
    if found:
        raise ContactSolveError(f"{where}: {'; '.join(found)}; try another mesh_mm")
    return check
