"""Presses beside the apex of a round, spherically crowned pad, solved in three dimensions.

    python -m tests.validation.contact.crown.offset_oracle    (half an hour, resumable) writes offset_oracle.npz

Half a pad is meshed: the plane through its apex and the press axis is one of symmetry. The mesh is that of a block
(`block_oracle`), fine under the tip; a chart maps the block (X from the press axis, Y, Z) onto the pad,

    u = (X + o)/W,  v = Y/W,   x = W u √(1 - v²/2),  y = W v √(1 - u²/2),   r² = W² (u² + v² - u² v²),
    z = -s(r) + Z (1 - s(r)/H),   s of `Crown`,

so the top is the sphere and the wall is the cylinder r = W, without chords. Two edges of the block lie flat in the
wall, where the chart has no inverse; both are bonded, and no quadrature point lies on them. Between the centres of a
stadium's half rounds the block is as it is, and u counts from the nearer one (`stadium_oracle`).

The tip presses along the normal of the untouched top at x = o, y = 0, to a depth from first touch. The frame of the
press has its origin there; its axes are the meridian towards the rim, y, and the normal. Solid, contact and
continuation are those of `elements`. Each pad is solved on a mesh and on its halves, which tell its error.

Lengths in tip radii R, stresses in E, forces in E R². Left out: what the axisymmetric oracle leaves out.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, replace
from functools import cache
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path
from time import perf_counter

import numpy as np
from numpy.typing import NDArray
from skfem import Basis, MeshHex

from optopad.design.arrays import FloatArray
from tests.validation.contact.contact_reference import BUILD, POISSON_RATIO
from tests.validation.contact.contact_surface import ContactSurface, GapFunction
from tests.validation.contact.crown.crown_oracle import Crown
from tests.validation.elements.block_oracle import BlockGrading, BlockPress, Walls, _top_of, block_mesh
from tests.validation.elements.continuation import NEAR_PATIENCE, Continuation
from tests.validation.elements.hyperelastic import Solid, Spatial
from tests.validation.elements.layer_mesh import halved
from tests.validation.elements.newton import OracleError
from tests.validation.elements.tip_outlines import sphere_tip

STORED = Path(__file__).with_name("offset_oracle.npz")
GRADING = BlockGrading(size=0.5, fine_radius=1.0, fine_depth=0.5, growth=2.0, largest=3.0)
"""The coarser mesh; the finer one has elements of 0.25 tip radii at the contact."""
WIDE = replace(GRADING, growth=3.0, largest=4.0)
"""The same for pads that are larger by the tip."""
RIM_SHARE = 0.15
"""Share of the outermost elements that is cut off at the wall, where stress is singular at the top's rim [-]. In an
axisymmetric layer on such a mesh it brings the error of the surface from 30 to 9 µm rms at 3 mm deep."""
REACH = 1.2
"""Half width of the square around the axis in which faces of the top may touch [tip radii]."""
SOFTER = (1.0, 0.4, 0.15)
"""Shares of the contact stiffness that are tried in turn [-]."""
HALVINGS = 1
RECIPE = 1
"""Version of the solver behind states kept in the build folder. Raise it when results change."""


@dataclass(frozen=True, kw_only=True)
class OffsetPad:
    """A round pad, where it is pressed, and how deep.

    Attributes
    ----------
    tip_mm : radius of the tip [mm]
    crown_mm : radius of the untouched top; infinite is flat [mm]
    layer_mm : thickness at the apex [mm]
    wall_mm : radius of the bonded wall [mm]
    offset_mm : of the press place from the axis of the pad, in plan [mm]
    depths_mm : of the tip along the normal [mm]
    grading : of the coarser mesh
    straight_mm : of a stadium, half the length of its straight walls; a disc has none [mm]
    """

    tip_mm: float
    crown_mm: float
    layer_mm: float
    wall_mm: float
    offset_mm: float
    depths_mm: tuple[float, ...]
    grading: BlockGrading = GRADING
    straight_mm: float = 0.0

    @property
    def chart(self) -> PadChart:
        """The pad in tip radii."""
        layer, wall, offset, straight = (
            one / self.tip_mm for one in (self.layer_mm, self.wall_mm, self.offset_mm, self.straight_mm)
        )
        return PadChart(layer, wall, self.tip_mm / self.crown_mm, offset, straight)


@dataclass(frozen=True)
class PadChart:
    """Places of a block's points in the pad; all lengths in tip radii.

    Attributes
    ----------
    layer, wall : thickness at the apex, radius of the wall
    curvature : tip radius over the crown's radius
    offset : of the press place from the axis of the pad, in plan
    straight : half the length of the straight walls, where the first derivatives jump
    """

    layer: float
    wall: float
    curvature: float
    offset: float
    straight: float = 0.0

    @property
    def walls(self) -> Walls:
        """Walls of the block from the press axis."""
        half = self.straight + self.wall
        return half + self.offset, half - self.offset, 0.0, self.wall

    @property
    def seams(self) -> tuple[float, ...]:
        """Where along the block the chart's first derivatives jump."""
        return (-self.straight - self.offset, self.straight - self.offset) if self.straight else ()

    @property
    def frame(self) -> FloatArray:
        """(3, 3) rows: axes of the press in the pad's."""
        sine = self.curvature * self.offset
        cosine = np.sqrt(1.0 - sine**2)
        return np.array([[cosine, 0.0, -sine], [0.0, 1.0, 0.0], [sine, 0.0, cosine]])

    @property
    def origin(self) -> FloatArray:
        """(3,) place of first touch in the pad, from its apex."""
        return np.array([self.offset, 0.0, -float(Crown(self.curvature).drop(np.array(self.offset)))])

    def _plan(self, flat: FloatArray) -> tuple[FloatArray, ...]:
        """What is straight of x, u, v, and the roots that multiply them."""
        x = flat[0] + self.offset
        straight = np.clip(x, -self.straight, self.straight)
        u, v = (x - straight) / self.wall, flat[1] / self.wall
        return straight, u, v, np.sqrt(1.0 - 0.5 * v**2), np.sqrt(1.0 - 0.5 * u**2)

    def places(self, flat: FloatArray) -> FloatArray:
        """(3, ...) points of the pad, from its apex, of (3, ...) points of the block."""
        straight, u, v, by_u, by_v = self._plan(flat)
        x, y = straight + self.wall * u * by_u, self.wall * v * by_v
        drop = Crown(self.curvature).drop(np.hypot(x, y))
        return np.stack([x, y, -drop + flat[2] * (1.0 - drop / self.layer)])

    def jacobian(self, flat: FloatArray) -> FloatArray:
        """(..., 3, 3) derivatives of the places (row) by the block's coordinates (column)."""
        straight, u, v, by_u, by_v = self._plan(flat)
        found = np.zeros((*u.shape, 3, 3))
        found[..., 0, 0] = np.where(np.abs(straight) < self.straight, 1.0, by_u)
        found[..., 0, 1], found[..., 1, 0] = -0.5 * u * v / by_u, -0.5 * u * v / by_v
        found[..., 1, 1] = by_v
        x, y = straight + self.wall * u * by_u, self.wall * v * by_v
        square = x**2 + y**2
        root = np.sqrt(1.0 - self.curvature**2 * square)
        down = self.curvature / root * (1.0 + flat[2] / self.layer)
        found[..., 2, :2] = -down[..., None] * (
            x[..., None] * found[..., 0, :2] + y[..., None] * found[..., 1, :2]
        )
        found[..., 2, 2] = 1.0 - self.curvature * square / (1.0 + root) / self.layer
        return found

    def in_press(self, points: FloatArray) -> FloatArray:
        """(..., 3) points in the frame of the press, of (..., 3) points of the pad."""
        return np.asarray((points - self.origin) @ self.frame.T)


class ChartedSolid(Spatial):
    """Kinematics of a body whose rest shape is that of the chart."""

    def __init__(self, chart: PadChart) -> None:
        self.chart = chart

    def _jacobian(self, basis: Basis) -> FloatArray:
        """(element, point, 3, 3) of the chart."""
        return self.chart.jacobian(np.asarray(basis.global_coordinates()))

    def weight(self, basis: Basis) -> FloatArray:
        """(element, point) volume at rest of the quadrature points."""
        return np.asarray(basis.dx * np.linalg.det(self._jacobian(basis)))

    def strain_operator(self, basis: Basis) -> FloatArray:
        """(element, point, 9, 81) derivative of F by the element's displacements."""
        operator, inverse = super().strain_operator(basis), np.linalg.inv(self._jacobian(basis))
        for row in range(0, 9, 3):
            part = operator[:, :, row : row + 3]
            operator[:, :, row : row + 3] = np.matmul(inverse.swapaxes(2, 3), part)
        return operator


def rim_mesh(chart: PadChart, grading: BlockGrading, halvings: int) -> MeshHex:
    """The block's mesh, with thinner elements at the walls, and the seams on edges."""
    x, y, z = (np.unique(np.round(ticks, 12)) for ticks in block_mesh(chart.layer, chart.walls, grading, 0).p)
    for seam in chart.seams:
        x[np.abs(x - seam).argmin()] = seam
    west, east, north = (
        ticks[end] + RIM_SHARE * (ticks[beside] - ticks[end])
        for ticks, end, beside in ((x, 0, 1), (x, -1, -2), (y, -1, -2))
    )
    axes = [np.sort(np.append(x, [west, east])), np.sort(np.append(y, north)), z]
    for _ in range(halvings):
        axes = [halved(ticks) for ticks in axes]
    return MeshHex.init_tensor(*axes)


@dataclass(frozen=True, kw_only=True)
class OffsetState:
    """One converged press.

    Attributes
    ----------
    force, reaction : (3,) of the contact on the pad's whole top and of the bonded faces, in the frame of the press
    contact : (m, 4) touching points in the frame of the press, and the force on each along its axis; of half the pad
    moved : (node, 3) displacement of the top's nodes, in the pad's axes
    """

    force: FloatArray
    reaction: FloatArray
    contact: FloatArray
    moved: FloatArray


class OffsetPress(BlockPress):
    """A crowned pad under a tip beside its apex, pressed deeper and deeper."""

    def __init__(
        self, chart: PadChart, grading: BlockGrading, poisson_ratio: float, halvings: int = 0
    ) -> None:
        self.chart, self.tip, self.copies = chart, sphere_tip(), 2
        solid = Solid(rim_mesh(chart, grading, halvings), poisson_ratio, ChartedSolid(chart))
        west, east, _, north = chart.walls
        x, y, z = solid.nodes
        is_held = (z < -chart.layer + 1e-9) | (x < 1e-9 - west) | (x > east - 1e-9) | (y > north - 1e-9)
        held = np.flatnonzero(is_held)
        fixed = (3 * held[:, None] + np.arange(3)).ravel()
        fixed = np.concatenate([fixed, 3 * np.flatnonzero(np.abs(y) < 1e-9) + 1])
        self.top_nodes = np.flatnonzero(np.abs(z) < 1e-9)
        self.flat_top = _top_of(solid, REACH)
        Continuation.__init__(self, solid, self._laid(self.flat_top), fixed, 3 * held + 2)

    def _laid(self, top: ContactSurface) -> ContactSurface:
        """The block's top on the crown."""
        flat = np.moveaxis(top.rest, -1, 0)
        jacobian = self.chart.jacobian(flat)
        normal = np.cross(jacobian[..., 0], jacobian[..., 1])
        rest = np.moveaxis(self.chart.places(flat), 0, -1)
        return replace(top, rest=rest, weight=top.weight * np.linalg.norm(normal, axis=-1))

    def corners(self) -> FloatArray:
        """(2, multiplier) places of the multipliers in the block."""
        laid, self.top = self.top, self.flat_top
        found = super().corners()
        self.top = laid
        return found

    @property
    def rest_top(self) -> FloatArray:
        """(node, 3) nodes of the untouched top in the block."""
        return np.asarray(self.solid.nodes[:, self.top_nodes].T)

    def gap(self, depth: float) -> GapFunction:
        """Distance of the pad's points (..., 3) to the tip at a depth, with derivatives."""
        turned, along_axis = self.chart.frame, super().gap(depth)

        def found(points: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
            distance, normal, hessian = along_axis(self.chart.in_press(points))
            return distance, normal @ turned, turned.T @ hessian @ turned

        return found

    def settle(self, guess: FloatArray, depth: float, penalty: float) -> None:
        """Take the equilibrium at a depth near a guess; where contact does not settle, with a softer contact.

        The mean gap vanishes whatever the stiffness is.
        """
        failure: RuntimeError = OracleError()
        for share in SOFTER:
            try:
                self.state, _ = self._solve(guess, depth, share * penalty, NEAR_PATIENCE)
            except RuntimeError as error:
                failure = error
            else:
                self.depth, self.final_penalty = depth, share * penalty
                return
        raise failure

    def state_now(self) -> OffsetState:
        """The present state, solved with the final contact stiffness."""
        self.settle(self.state, self.depth, self.final_penalty)
        traction, _, normal = self.traction()
        frame = self.chart.frame
        forces = -(self.top.weight * traction)[..., None] * (normal @ frame.T)
        residual = self.solid.assemble(self.solid_state, False).residual
        reaction = -residual[self.held[:, None] + np.arange(-2, 1)].sum(axis=0) @ frame.T
        touching = traction > 0.0
        points = self.chart.in_press(self.top.points(self.state)[touching])
        both = np.array([2.0, 0.0, 2.0])  # what acts across the plane of symmetry cancels
        return OffsetState(
            force=both * forces.sum(axis=(0, 1)),
            reaction=both * reaction,
            contact=np.column_stack([points, forces[touching][:, 2]]),
            moved=self.solid.moved(self.state)[self.top_nodes],
        )


DOME = OffsetPad(tip_mm=3, crown_mm=14, layer_mm=9, wall_mm=10, offset_mm=4, depths_mm=(1.0, 2.0, 3.0))
FINGERTIP = OffsetPad(
    tip_mm=2, crown_mm=18, layer_mm=9, wall_mm=11, offset_mm=5, depths_mm=(0.5, 1.0, 2.0), grading=WIDE
)
PADS = {
    "apex": replace(DOME, wall_mm=11, offset_mm=0),
    "dome": DOME,
    "fingertip": FINGERTIP,
    "flat": replace(FINGERTIP, crown_mm=np.inf, depths_mm=(2.0,)),
}
"""The apex, which `crown_reference` has too; beside it; a fingertip's dome; and a flat disc."""


def _path(name: str, pad: OffsetPad, depth_mm: float, level: int, folder: Path) -> Path:
    """Where a finished state is kept."""
    inputs = json.dumps([asdict(pad) | {"depths_mm": None}, POISSON_RATIO, RIM_SHARE, RECIPE])
    return folder / f"offset-{name}-{sha256(inputs.encode()).hexdigest()[:8]}-{depth_mm:g}-{level}.npz"


def solve_pad(
    name: str, pad: OffsetPad, halvings: int = HALVINGS, folder: Path = BUILD
) -> dict[float, list[dict[str, FloatArray]]]:
    """Depth [mm] -> arrays of the state on each mesh, coarsest first; read if finished before."""
    levels = range(halvings + 1)
    paths = {depth: [_path(name, pad, depth, level, folder) for level in levels] for depth in pad.depths_mm}
    if not all(path.exists() for one in paths.values() for path in one):
        presses = [OffsetPress(pad.chart, pad.grading, POISSON_RATIO, level) for level in levels]
        for depth, of_depth in paths.items():
            for level, path in enumerate(of_depth):
                _press_on(presses, level, depth / pad.tip_mm, path)
    return {depth: [read_arrays(path) for path in of_depth] for depth, of_depth in paths.items()}


def _press_on(presses: list[OffsetPress], level: int, depth: float, path: Path) -> None:
    """Press to a depth [tip radii], from the coarser mesh's state if there is one, and keep the state; or read it."""
    press, start = presses[level], perf_counter()
    if path.exists():
        press.state, press.depth = read_arrays(path)["unknowns"], depth
        return
    try:
        if level == 0:
            press.advance(depth)
        else:
            press.adopt(presses[level - 1])
    except RuntimeError:  # too far from the coarser mesh's state: step by step from its own last one
        press.advance(depth)
    state = press.state_now()
    path.parent.mkdir(parents=True, exist_ok=True)
    arrays = {key: np.asarray(value) for key, value in vars(state).items()}
    np.savez_compressed(path, rest=press.rest_top, unknowns=press.state, **arrays)
    print(
        f"{path.stem}: {press.size} unknowns, force {state.force.round(5)}, stiffness {press.final_penalty:g}, "
        f"balance {np.abs(state.force + state.reaction).max():.0e}, {perf_counter() - start:.0f} s",
        flush=True,
    )


def read_arrays(path: Path) -> dict[str, FloatArray]:
    """The arrays of a file, by name."""
    with np.load(path, allow_pickle=False) as stored:
        return {name: stored[name] for name in stored.files}


@dataclass(frozen=True, kw_only=True)
class StoredState:
    """One press of the stored file; modulus 1 MPa.

    Attributes
    ----------
    force_n : (3,) on the tip's axis last, in the frame of the press [N]
    flat : (node, 2) places of the top's nodes in the block, a product of coordinates [tip radii]
    rest_mm, moved_mm : (node, 3) untouched top from its apex, displacement, in the pad's axes; y is 0 or more [mm]
    contact_mm : (m, 3) touching points in the frame of the press, of half the pad [mm]
    contact_n : (m,) force on them along the axis of the press [N]
    """

    force_n: FloatArray
    flat: FloatArray
    rest_mm: FloatArray
    moved_mm: FloatArray
    contact_mm: FloatArray
    contact_n: FloatArray


def _stored_arrays(pad: OffsetPad, state: dict[str, FloatArray]) -> tuple[dict[str, FloatArray], ...]:
    """What is stored of a mesh, and of a state on it, in mm and N."""
    scale = pad.tip_mm
    mesh = {
        "flat": state["rest"][:, :2],
        "rest_mm": np.float32(scale * pad.chart.places(state["rest"].T).T),
    }
    return mesh, {
        "force_n": scale**2 * state["force"],
        "moved_mm": np.float32(scale * state["moved"]),
        "contact_mm": np.float32(scale * state["contact"][:, :3]),
        "contact_n": np.float32(scale**2 * state["contact"][:, 3]),
    }


def build(pads: dict[str, OffsetPad], path: Path, command: str) -> None:
    """Solve everything and write the stored file; the model's presses in it stay."""
    arrays: dict[str, NDArray[np.generic]] = {}
    if path.exists():
        arrays |= {name: array for name, array in read_arrays(path).items() if name.startswith("model/")}
    for name, pad in pads.items():
        for depth, levels in solve_pad(name, pad).items():
            for mesh, state in zip(("half", "fine"), levels[-2:], strict=True):
                for place, kept in zip(("", f"{depth:g}/"), _stored_arrays(pad, state), strict=True):
                    arrays |= {f"{name}/{mesh}/{place}{key}": value for key, value in kept.items()}
    made = {
        "command": command,
        "model": "neo-Hookean pad, hexahedra Q2/Q1 on a chart, frictionless hemisphere with shank, bonded",
        "poisson_ratio": POISSON_RATIO,
        "pads": {name: asdict(pad) for name, pad in pads.items()},
        "halvings": HALVINGS,
        "versions": {name: version(name) for name in ("scikit-fem", "numpy", "scipy")},
    }
    np.savez_compressed(path, provenance=np.array(json.dumps(made)), **arrays)  # type: ignore[arg-type]


@cache
def _stored(path: Path) -> dict[str, FloatArray]:
    return read_arrays(path)


def offset_state(name: str, depth_mm: float, *, half: bool = False, path: Path = STORED) -> StoredState:
    """The stored press of a pad, one of `PADS`, and depth, one of its own; `half` takes the coarser mesh.

    Raises
    ------
    KeyError : not among the stored ones
    """
    begin, held = f"{name}/{'half' if half else 'fine'}", {}
    for key, array in _stored(path).items():
        folder, _, last = key.rpartition("/")
        if folder in (begin, f"{begin}/{depth_mm:g}"):
            held[last] = np.asarray(array, dtype=np.float64)
    if "force_n" not in held:
        raise KeyError(f"no stored press for {name}, {depth_mm:g} mm")
    return StoredState(**held)


if __name__ == "__main__":
    build(PADS, STORED, "python -m tests.validation.contact.crown.offset_oracle")
