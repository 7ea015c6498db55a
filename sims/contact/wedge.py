"""A round tip pressed into a bonded elastic layer, solved by MuJoCo as a thin axisymmetric wedge.

Model
-----
* Lengths are in tip radii R, forces in E·R² (E is Young's modulus), so only two numbers describe the problem: layer
  thickness and press depth. The layer's shape does not depend on its modulus, because the tip is frictionless.
* The layer is a wedge of 0.1 rad around the press axis. It is made of the r-z triangles of `mesh`, each swept into a
  prism of three tetrahedra. Every vertex has three slide joints along the world axes; a stiff fixed tendon prevents
  motion out of its radial plane. (With radial slide joints, the Newton solver would return garbage under contact,
  without a warning.)
* Bottom and wall are bonded. The top is free, and flat or a sphere about the axis (`crown`). The tip has a straight
  shank: it is a capsule for a hemisphere, otherwise the convex bodies of `tip_hulls`. A facet of the layer has one
  contact with each body. Under a flat tip, the contact point moves over the facet, so flat tips end in narrow cycles
  more often and take ten times as many steps.
* The material is stable neo-Hookean. The integrator is `discrete` at time step 1: every step is one damped static
  Newton iteration, after which velocities are set to zero. A depth is settled when a step moves no vertex by more than
  1e-4 tip radii (0.3 µm for a 3 mm tip) or 0.04 % of the depth (0.02 % at first touch).
* Contact is a stiff penalty, proportional to the vertex mass. If the mass is too small, the tip sinks in; if it is too
  large, the contact chatters. Where one facet still chatters, the mean of its cycle is used (see below).

Left out: friction, adhesion, viscosity, inertia, walls nearer than the round one, and the layer's own weight. Linear
tetrahedra lock at a Poisson's ratio beyond 0.49, so `library.smooth_press` extrapolates. Seen from above, the full
circle of wedges is a 63-sided polygon, so radii are uncertain by 0.1 %. All prisms are split in the same sense, so the
two faces of the wedge differ slightly (9 µm at 3 mm depth on a 0.45 mm mesh); their mean is used.

Sources: feasibility study of this project, section "Contact"; MuJoCo 4.0 documentation, `flex` and the `discrete`
integrator.

Checks of a solved press
------------------------

A state passes if it is at rest and finite, no element is inverted, the tip has not sunk into the top, and the force on
the tip equals the reaction of the bonded bottom and wall. `mesh.nodal_forces` computes this reaction from the deformed
shape alone, independently of MuJoCo. A state that fails raises an error; nothing is repaired.

Shape of the tip
----------------

MuJoCo replaces a mesh by its convex hull, so the tip is made of convex bodies.

An outline whose slope only increases outwards gives one convex body of revolution. Other outlines are cut where the
slope decreases, and each part becomes a separate body. A part that starts away from the axis is a ring, and its hull
closes the hole with a disc. The outline never falls outwards, so this disc is inside the tip. Each part is extended
straight beyond its end as far as it stays inside the tip. Otherwise the solver could push an overlapping facet out
through the side of the part.

Arcs become polylines with a sagitta of 1e-6 tip radii, because 1e-4 made the contact chatter. Around the axis, points
are dense within the wedge and sparse elsewhere.

Convergence
-----------

An iteration is at rest when its steps have become negligible, or when it cycles closely around a fixed point.

In a few deep presses, one facet at the contact edge repeatedly enters and leaves the contact. The iteration then ends
in a cycle of a few micrometres that no damping removes. The mean of the cycle is used as the solved state if two
successive windows of iterates have the same mean and no iterate is far from it. Such a state has a `chatter` above 0
and must pass the same force balance as any other.

`PressedFlex` wraps MuJoCo's own part, a deformable body ("flex") under a tip.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import pairwise
from threading import Lock

import mujoco
import numpy as np

from optopad.design.arrays import BoolArray, FloatArray, IntArray
from optopad.sims.contact.mesh import (
    RadialMesh,
    contact_forces,
    elastic_energy,
    nodal_forces,
    shared_out,
    volumes,
)
from optopad.sims.contact.scope import ContactSolveError
from optopad.sims.contact.tip import HEMISPHERE, TipOutline, tip_gap

SETTLED_LIMIT = 1e-4
"""Largest motion of any vertex in the last step of a state at rest [tip radii]."""
SHALLOW = 0.05
"""Largest depth of a press that counts as shallow [tip radii]. Few nodes then touch, so a step changes the force more.
"""
SHALLOW_SHARE, DEEP_SHARE = 2e-4, 4e-4
"""Largest allowed motion of a vertex in the last step, over the depth [-]: for shallow presses, and for deeper ones."""
PENETRATION_LIMIT = 0.02
"""Deepest allowed overlap of a surface facet with the tip [tip radii]: 60 µm for a 3 mm tip."""
BALANCE_LIMIT = 0.01
"""Largest allowed difference between contact force and reaction of the bonded surfaces, over the force [-]."""
BALANCE_FLOOR = 1e-4
"""Smallest force by which `BALANCE_LIMIT` is multiplied [E R²]: 0.9 mN for a 3 mm tip and a modulus of 1 MPa."""


@dataclass(frozen=True, kw_only=True)
class PressState:
    """One solved state of the wedge of the layer; lengths in tip radii, forces in E R².

    Attributes
    ----------
    depth : press depth
    rest, deformed : (vertex, 3) positions without and with the press
    elements : (tetrahedron, 4) indices of each tetrahedron's vertices
    is_bonded : (vertex,) True where the layer is bonded
    poisson_ratio : Poisson's ratio of the layer [-]
    copies : number of wedges in the full circle [-]
    contact_force : force on the tip, for the full circle
    overlap : deepest overlap of a surface facet with the tip, as the solver sees it
    last_step : largest motion of a vertex in the last solver step
    chatter : if the state is the mean of a cycle of iterates, the largest distance of a vertex from that mean;
        otherwise 0
    steps : number of solver steps taken
    tip : outline of the pressing tip
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
    """Results of the checks at one depth; lengths in tip radii, forces in E R².

    Attributes
    ----------
    depth, force : press depth and force
    reaction : vertical reaction of the bonded surfaces
    penetration : deepest overlap of a facet or vertex of the layer with the tip
    last_step : largest motion of a vertex in the last solver step
    chatter : if the state is the mean of a cycle of iterates, the largest distance of a vertex from that mean;
        otherwise 0
    smallest_stretch : smallest volume ratio of an element [-]
    volume_loss : volume lost by compression, for the full circle [R³]
    energy : elastic energy of the layer, for the full circle [E R³]
    steps : number of solver steps taken
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
    """Largest accepted motion of a vertex in the last solver step at this depth [tip radii]."""
    share = DEEP_SHARE if depth > SHALLOW else SHALLOW_SHARE
    return min(SETTLED_LIMIT, share * depth)


def _reaction(state: PressState) -> float:
    """Vertical force of the layer on its bonded vertices, positive downwards, for the full circle [E R²]."""
    forces = nodal_forces(state.rest, state.deformed, state.elements, 1.0, state.poisson_ratio)
    return -state.copies * float(forces[state.is_bonded, 2].sum())


def _balances(force: float, reaction: float) -> bool:
    """Whether the force on the tip and the reaction agree within tolerance; False if either is not a number."""
    return abs(force - reaction) <= BALANCE_LIMIT * max(force, BALANCE_FLOOR)


def is_balanced(state: PressState) -> bool:
    """Whether the force on the tip agrees with the reaction of the bonded surfaces, within tolerance."""
    return _balances(state.contact_force, _reaction(state))


def _penetration(state: PressState) -> float:
    """Deepest overlap of the layer with the tip [tip radii].

    Vertices are checked as well as the solver's contacts, because the solver may miss contacts.
    """
    radius = np.hypot(state.deformed[:, 0], state.deformed[:, 1])
    return max(
        state.overlap, 0.0, -float(tip_gap(radius, state.deformed[:, 2], state.depth, state.tip).min())
    )


def measure_press(state: PressState) -> StepCheck:
    """Compute the quantities with which a solved state is checked, but do not check them."""
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
    """One sentence for each failed check of a measured state."""
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
    """Check a solved state; raise `ContactSolveError` if a check fails."""
    where = f"contact solver at a depth of {state.depth:.4f} tip radii"
    if not np.isfinite(state.deformed).all():
        raise ContactSolveError(f"{where}: positions are not finite; use a finer mesh")
    check = measure_press(state)
    found = _complaints(check)
    if found:
        raise ContactSolveError(f"{where}: {'; '.join(found)}; try another mesh_mm")
    return check


SAGITTA = 1e-6
"""Largest distance between an arc and the polyline that replaces it [tip radii]."""
TOP_HEIGHT = 6.0
"""Height of the shank above the outline [tip radii]; more than the deepest press."""
DENSE_HALF_ANGLE = 0.06
"""Half the angle of the sector in which meridians are dense [rad]; half the wedge's angle is 0.05."""
DENSE_COUNT, SPARSE_COUNT = 5, 12
"""Number of meridians in the dense sector, and in the rest of the circle. One is at the middle of each facet."""
_SLOPE_NOISE = 1e-9


def tip_hulls(tip: TipOutline) -> list[FloatArray]:
    """Vertices (vertex, 3) of each convex body of the tip, with heights above the apex [tip radii]."""
    outline = outline_points(tip)
    top = float(outline[-1, 1]) + TOP_HEIGHT
    return [_revolved(_prolonged(chain, outline), top) for chain in convex_chains(outline)]


def outline_points(tip: TipOutline) -> FloatArray:
    """The outline as a polyline: radius and height (n, 2) of its corners, from the apex to the shank."""
    found = [np.zeros((1, 2))]
    for start, length, (first, last), row in zip(
        tip.starts[:-1], tip.lengths[:-1], tip.angles[:-1], tip.rows, strict=True
    ):
        step = np.sqrt(8.0 * SAGITTA / row[6]) if row[6] > 0.0 else np.inf
        count = max(1, int(np.ceil((last - first) / step)))
        along = start + length * np.arange(1, count + 1) / count
        found.append(np.stack(tip.points(along[:-1]), axis=1))
        found.append(np.array([[row[2], row[3]]]))
    return np.concatenate(found)


def convex_chains(outline: FloatArray) -> list[FloatArray]:
    """Cut an outline where its slope decreases, into polylines (n, 2) that share their end points."""
    step = np.diff(outline, axis=0)
    angle = np.arctan2(step[:, 1], step[:, 0])
    cuts = np.flatnonzero(np.diff(angle) < -_SLOPE_NOISE) + 1
    ends = [0, *cuts.tolist(), len(outline) - 1]
    return [outline[first : last + 1] for first, last in pairwise(ends)]


def _prolonged(chain: FloatArray, outline: FloatArray) -> FloatArray:
    """Extend the last line of a part of the outline as far as this line stays above the outline."""
    (r0, h0), (r1, h1) = chain[-2], chain[-1]
    beyond = outline[outline[:, 0] > r1 + 1e-12]
    if len(beyond) == 0 or r1 - r0 < 1e-12:
        return chain
    above = h1 + (h1 - h0) / (r1 - r0) * (beyond[:, 0] - r1) - beyond[:, 1]
    count = int(np.argmax(above < 0.0)) if (above < 0.0).any() else len(beyond)
    if count == 0:
        return chain
    reach = beyond[count - 1, 0]
    return np.concatenate([chain, [[reach, h1 + (h1 - h0) / (r1 - r0) * (reach - r1)]]])


def _revolved(chain: FloatArray, top: float) -> FloatArray:
    """Vertices (vertex, 3) of the body made by revolving a part of the outline and closing it at height `top`."""
    sparse = np.linspace(DENSE_HALF_ANGLE, 2.0 * np.pi - DENSE_HALF_ANGLE, SPARSE_COUNT + 2)[1:-1]
    angle = np.concatenate([np.linspace(-DENSE_HALF_ANGLE, DENSE_HALF_ANGLE, DENSE_COUNT), sparse])
    rim = np.array([[chain[-1, 0], max(top, float(chain[-1, 1]) + 1.0)]])
    profile = np.concatenate([chain, rim])
    on_axis = profile[profile[:, 0] <= 1e-12]
    rings = profile[profile[:, 0] > 1e-12]
    radius, height = rings[:, 0, None], rings[:, 1, None]
    points = np.stack(
        [radius * np.cos(angle), radius * np.sin(angle), height + np.zeros_like(angle)], axis=-1
    ).reshape(-1, 3)
    return np.concatenate([np.stack([on_axis[:, 0], on_axis[:, 0], on_axis[:, 1]], axis=1), points])


WINDOW = 40
"""Number of successive iterates over which a cycle is averaged."""
CHATTER_LIMIT = 2e-3
"""Largest allowed distance of a vertex from the mean of its cycle [tip radii]: 6 µm for a 3 mm tip, a fifth of the
default mesh's error at the depths where cycles occur.
"""
DRIFT_LIMIT = 3e-4
"""Largest allowed difference between the means of two successive windows [tip radii]: 0.9 µm for a 3 mm tip."""


@dataclass(frozen=True, kw_only=True)
class Cycle:
    """Mean and spread of a cycle in which the solver's iterates ended.

    Attributes
    ----------
    mean : (coordinate,) mean of the iterates' vertex coordinates
    spread : largest distance of a coordinate from its mean
    force : mean of the iterates' forces
    """

    mean: FloatArray
    spread: float
    force: float


class History:
    """The last two windows of iterates and their forces, from which cycles are detected."""

    def __init__(self) -> None:
        self._states: deque[FloatArray] = deque(maxlen=2 * WINDOW)
        self._forces: deque[float] = deque(maxlen=2 * WINDOW)

    def add(self, state: FloatArray, force: float) -> None:
        """Append a copy of one iterate, and its force."""
        self._states.append(state.copy())
        self._forces.append(force)

    def cycle(self) -> Cycle | None:
        """The cycle in which the iterates have ended; None if there is none, or fewer than two windows of iterates."""
        if len(self._states) < 2 * WINDOW:
            return None
        states = np.array(self._states)
        before, after = states[:WINDOW].mean(axis=0), states[WINDOW:].mean(axis=0)
        spread = float(np.abs(states[WINDOW:] - after).max())
        drift = float(np.abs(after - before).max())
        if not (drift <= DRIFT_LIMIT and spread <= CHATTER_LIMIT):
            return None
        return Cycle(mean=after, spread=spread, force=float(np.mean(list(self._forces)[WINDOW:])))


CONTACT_TIME = 0.1
"""Time constant of the contact over the time step [-]. If it is smaller, contact chatters; if larger, the tip sinks in.
"""
CONTACT = {"solref": [CONTACT_TIME, 1.0], "solimp": [0.9999, 0.9999, 0.001, 0.5, 2.0], "condim": 1}
_TIP_HALF_LENGTH = 4.0
_FLEX_RADIUS = 3e-5


def set_options(spec: mujoco.MjSpec, iterations: int, memory: int) -> None:
    """Set up static Newton iterations: unit time step, no gravity, no lower limit to the contact's time constant."""
    option = spec.option
    option.integrator = mujoco.mjtIntegrator.mjINT_DISCRETE
    option.solver = mujoco.mjtSolver.mjSOL_NEWTON
    option.timestep, option.gravity = 1.0, [0.0, 0.0, 0.0]
    option.tolerance, option.iterations = 1e-8, iterations
    option.disableflags |= mujoco.mjtDisableBit.mjDSBL_REFSAFE
    spec.memory = memory


def add_round_tip(spec: mujoco.MjSpec) -> None:
    """Add a hemispherical tip of radius 1 with a straight shank.

    Its body is moved explicitly; the body's origin is 1 above the apex.
    """
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
    """Add the layer as a deformable body.

    Parameters
    ----------
    owners : for each vertex, name of the body to which it is fixed, which may be the world
    offsets : x, y, z of each vertex relative to its body, in one list
    elements : (tetrahedron, 4) indices of each tetrahedron's vertices
    material : keyword arguments `poisson` and `damping` of the material
    """
    flex = spec.add_flex(name="layer", dim=3, young=1.0, **material)
    flex.elastic3d = 1
    flex.radius, flex.contype, flex.conaffinity = _FLEX_RADIUS, 1, 1
    flex.selfcollide = mujoco.mjtFlexSelf.mjFLEXSELF_NONE
    flex.condim, flex.solref, flex.solimp = CONTACT["condim"], CONTACT["solref"], CONTACT["solimp"]
    flex.vertbody, flex.vert, flex.elem = owners, offsets, elements.ravel().tolist()


class _Quiet:
    """Number of running solves that silence MuJoCo's warnings, and the handler to restore after the last of them."""

    lock, solves, previous = Lock(), 0, None


@contextmanager
def quiet_mujoco() -> Iterator[None]:
    """`with` block that keeps MuJoCo's warnings from creating a log file in the working folder; it may be nested.

    MuJoCo warns that the unconstrained start of a step is solved only to 1e-4. This start has no effect on a state at
    rest, and `check_press` judges the state by its shape. Blocks in several threads may overlap.
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
    """MuJoCo model of a part of the layer that is pressed deeper and deeper; `copies` parts make up the whole layer."""

    def __init__(self, model: mujoco.MjModel, copies: float) -> None:
        self.model, self.copies = model, copies
        self.data = mujoco.MjData(model)
        vertical = [j for j in range(model.njnt) if model.jnt_axis[j][2] > 0.5]
        self.vertical_dofs = model.jnt_dofadr[vertical]

    def place(self, depth: float, guess: FloatArray) -> None:
        """Move the tip to `depth` and the vertices to the coordinates `guess`."""
        self.data.mocap_pos[0] = [0.0, 0.0, 1.0 - depth]
        self.data.qpos[:] = guess

    def step(self) -> float:
        """Perform one damped static iteration, and return the largest motion of a vertex [tip radii]."""
        before = self.data.qpos.copy()
        mujoco.mj_step(self.model, self.data)
        self.data.qvel[:] = 0.0
        return float(np.abs(self.data.qpos - before).max())

    def force(self) -> float:
        """Contact force of the whole layer [E R²]."""
        return -self.copies * float(self.data.qfrc_constraint[self.vertical_dofs].sum())

    def deformed(self) -> FloatArray:
        """Current positions (vertex, 3) of the vertices."""
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_flex(self.model, self.data)
        return np.array(self.data.flexvert_xpos)


WEDGE_ANGLE = 0.1
"""Opening angle of the wedge [rad]."""
DAMPING = 4.0
"""Stiffness-proportional damping over the time step [-]; a step is 1/(1 + damping) of a full Newton step."""
MASS_PER_RADIUS = 0.004
"""Vertex mass over (spacing · angle · radius) [E R]; sets the contact stiffness."""
SMALLEST_MASS_RADIUS = 0.7
"""Vertices nearer to the axis than this radius have the mass of vertices at this radius [tip radii]."""
HOOP_STIFFNESS = 3300.0
"""Stiffness that prevents motion out of the radial plane [E R]."""
DAMPING_FACTORS = (1.0, 4.0, 16.0)
"""Factors on the damping that are tried in turn if contact chatters. The limit of the motion per step falls with each.
"""
FEWEST_STEPS, MOST_STEPS = 4, 160
"""Fewest and most solver steps per depth; very deep presses converge slowly and need up to 130."""


@dataclass(frozen=True, kw_only=True)
class WedgeSolution:
    """Solved states at rest, one per depth; lengths in tip radii, forces in E R².

    Attributes
    ----------
    depths : (depth,) press depths
    radii, heights : (depth, top node) deformed top from the axis to the wall, mean of the two faces
    normal_force : (depth, top node) force of the tip on each top node, positive where the tip presses
    force : (depth,) press force
    checks : results of the checks, one for each depth
    """

    depths: FloatArray
    radii: FloatArray
    heights: FloatArray
    normal_force: FloatArray
    force: FloatArray
    checks: tuple[StepCheck, ...]


@dataclass(frozen=True, kw_only=True)
class Tetrahedra:
    """The wedge in space: vertices and elements, and for every vertex its node in the r-z mesh and its angle."""

    points: FloatArray
    elements: IntArray
    node: IntArray
    angle: FloatArray

    def face_mean(self, values: FloatArray, nodes: IntArray) -> FloatArray:
        """Mean of values (vertex,) over the wedge's two faces, at the given nodes of the r-z mesh."""
        total = np.bincount(self.node, weights=values)
        return np.asarray((total / np.bincount(self.node))[nodes], dtype=np.float64)


def sweep(mesh: RadialMesh) -> Tetrahedra:
    """Sweep the r-z triangles into tetrahedra; the two faces of the wedge share the vertices on the axis."""
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
    # splitting along sorted indices gives neighbours the same diagonal on their shared face
    a, b, c = np.sort(mesh.triangles, axis=1).T
    prisms = [(a, b, c, far[c]), (a, b, far[b], far[c]), (a, far[a], far[b], far[c])]
    elements = np.concatenate([np.stack(corners, axis=1) for corners in prisms])
    ordered = np.sort(elements, axis=1)
    elements = elements[np.all(np.diff(ordered, axis=1) > 0, axis=1)]
    flipped = np.linalg.det(points[elements[:, 1:]] - points[elements[:, :1]]) < 0
    elements[flipped] = elements[flipped][:, [0, 1, 3, 2]]
    return Tetrahedra(points=points, elements=elements, node=node, angle=angle)


def _add_tip(spec: mujoco.MjSpec, shape: TipOutline) -> None:
    """Add a tip of radius 1 with a straight shank.

    Its body is moved explicitly; the body's origin is 1 above the apex.
    """
    if shape == HEMISPHERE:
        add_round_tip(spec)
        return
    tip = spec.worldbody.add_body(name="tip", mocap=True, pos=[0.0, 0.0, 2.0])
    for index, points in enumerate(tip_hulls(shape)):
        hull = spec.add_mesh(name=f"tip{index}", inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX)
        hull.uservert = (points - [0.0, 0.0, 1.0]).ravel().tolist()
        tip.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=hull.name, **CONTACT)


def _add_vertex(spec: mujoco.MjSpec, name: str, point: FloatArray, angle: float, mass: float) -> None:
    """Add a point mass that can move only in its radial plane, or if it is on the axis, only up and down."""
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
    """Add the layer as a deformable body. Bonded vertices belong to the world, all others to bodies of their own."""
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
    add_flex(spec, owners, offsets, wedge.elements, poisson=poisson_ratio, damping=DAMPING)


def compile_wedge(
    mesh: RadialMesh, wedge: Tetrahedra, poisson_ratio: float, tip: TipOutline = HEMISPHERE
) -> mujoco.MjModel:
    """Build the MuJoCo model of the wedge and its tip."""
    spec = mujoco.MjSpec()
    set_options(spec, iterations=200, memory=1 << 30)
    _add_tip(spec, tip)
    _add_layer(spec, mesh, wedge, poisson_ratio)
    return spec.compile()


class _Press(PressedFlex):
    """MuJoCo model of a wedge of the layer that a tip presses deeper and deeper."""

    def __init__(self, mesh: RadialMesh, poisson_ratio: float, tip: TipOutline) -> None:
        self.mesh, self.poisson_ratio, self.tip = mesh, poisson_ratio, tip
        self.wedge = sweep(mesh)
        copies = float(2.0 * np.pi / np.sin(WEDGE_ANGLE))
        super().__init__(compile_wedge(mesh, self.wedge, poisson_ratio, tip), copies)
        self.normal_force = np.zeros(len(mesh.top))

    def _normal_force(self) -> FloatArray:
        """Contact force (top node,) on the nodes of the top, for the full circle [E R²]."""
        at, force = contact_forces(self.data)
        points = np.asarray(self.data.flexvert_xpos, dtype=np.float64)
        radius = self.wedge.face_mean(np.hypot(points[:, 0], points[:, 1]), self.mesh.top)
        height = self.wedge.face_mean(points[:, 2], self.mesh.top)
        return shared_out(at, self.copies * force, np.stack([radius, height], axis=1))

    def settle(self, depth: float, guess: FloatArray) -> PressState:
        """Move the tip to `depth` and iterate from `guess` until at rest; if the contact chatters, increase damping."""
        self.place(depth, guess)
        for factor in DAMPING_FACTORS:
            self.model.flex_damping[:] = factor * DAMPING
            state = self._iterated(depth, settled_limit(depth) * (1.0 + DAMPING) / (1.0 + factor * DAMPING))
            if state.last_step < settled_limit(depth):
                break
        self.model.flex_damping[:] = DAMPING
        return state

    def _iterated(self, depth: float, limit: float) -> PressState:
        """Iterate until the state is balanced and no vertex moves by `limit` in a step, or a narrow cycle is found.

        If neither happens within `MOST_STEPS` steps, return the last state.
        """
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
                if is_balanced(state):  # otherwise the cycle still drifts
                    self.normal_force = np.mean(loads, axis=0)
                    return state
                self.data.qpos[:] = latest
        self.normal_force = loads[-1]
        return self._state(depth, self.force(), last_step, 0.0, count)

    def _state(self, depth: float, force: float, last_step: float, chatter: float, steps: int) -> PressState:
        """The current state of the wedge, with the given force and convergence figures."""
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
    """Press the tip to each depth in turn until the layer is at rest, and check every solved state.

    Parameters
    ----------
    mesh : the layer, flat or with a spherical top, bonded at its bottom and wall
    depths : increasing press depths below the apex [tip radii]; a step of more than 1/30 risks divergence
    poisson_ratio : Poisson's ratio of the layer [-]; beyond 0.49 the tetrahedra lock
    on_step : called with the fraction done (0 to 1)
    tip : outline of the pressing tip

    Raises
    ------
    ContactSolveError : a state is not at rest, not finite, has an inverted element, overlaps the tip, or is out of
        balance
    """
    found = []
    with quiet_mujoco():
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
    """Top surface and checks of one state at rest."""

    radii: FloatArray
    heights: FloatArray
    normal_force: FloatArray
    check: StepCheck


def _settled(press: _Press, depths: Sequence[float]) -> Iterator[_Settled]:
    """Move the tip to each depth in turn, starting from the extrapolated last states, and yield the checked states."""
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
