"""Stored solutions of the finite-element oracle, and the command that makes them.

    python -m tests.validation.contact.contact_reference

solves four layers down to 5/3 tip radii (the thinnest to 4/3) and writes `contact_reference.npz`. Finished
states are kept in `build/validation/`, so that an interrupted run continues. Lengths are in tip radii R, forces
in E R².
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from functools import cache, cached_property
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from optopad.design.arrays import FloatArray
from tests.validation.elements.layer_mesh import Grading
from tests.validation.elements.press_oracle import Press
from tests.validation.elements.tip_outlines import Tip, sphere_tip

STORED = Path(__file__).with_name("contact_reference.npz")
BUILD = Path(__file__).parents[3] / "build" / "validation"
WALL = 16 / 3
POISSON_RATIO = 0.499
LAYERS = (2.0, 8 / 3, 3.0, 16 / 3)
DEPTHS = tuple(depth / 3.0 for depth in (0.2, 0.5, 1.0, 2.0, 3.0, 4.0, 5.0))
DEEPEST_SHARE = 0.7
"""Deepest press over layer: 4/3 of a layer of 2 is solved, 5/3 is not."""
HALVINGS = 2
"""How often the coarsest mesh is halved: elements of 0.025 tip radii at the contact."""
RECIPE = 1
"""Version of the solver behind states kept in the build folder. Raise it when results change."""
TOUCHING_GAP = 2e-4
"""Gap below which the surface may touch [tip radii]; above any gap inside a contact, 1e-4."""
FIELDS = ("force", "reaction", "energy", "volume_change", "penetration")


@dataclass(frozen=True, kw_only=True)
class CoarserState:
    """The same press on elements of twice the size; what is needed to estimate errors."""

    force: float
    energy: float
    nodes: FloatArray


@dataclass(frozen=True, kw_only=True)
class ReferenceState:
    """One press of the unit hemisphere into a layer; lengths in tip radii, force in E R².

    Attributes
    ----------
    layer, depth : thickness of the layer, depth of the apex
    force, energy : press force, elastic energy
    nodes : (2 * edges + 1, 2) deformed nodes of the top; corner, middle, corner, ... of quadratic edges
    rest_radii : (2 * edges + 1,) radius of these nodes at rest
    contact : (points, 4) radius, height, pressure and deformed area of the contact quadrature points
    half : the same press on the coarser mesh
    """

    layer: float
    depth: float
    force: float
    energy: float
    nodes: FloatArray
    rest_radii: FloatArray
    contact: FloatArray
    half: CoarserState

    @cached_property
    def contact_edge(self) -> tuple[float, float]:
        """(r, z) where the surface leaves the tip."""
        return contact_edge(self.nodes, self.depth)

    @property
    def contact_radius(self) -> float:
        """Radius of the circle where the surface leaves the tip."""
        return self.contact_edge[0]

    def curve(self, points_per_edge: int = 16) -> tuple[FloatArray, FloatArray]:
        """(r, z) of the deformed top from the axis to the wall: the finite-element curve itself, sampled."""
        return sampled_curve(self.nodes, points_per_edge)

    def pressure(self) -> tuple[FloatArray, FloatArray]:
        """Radius and contact pressure where the tip touches."""
        touching = self.contact[:, 2] > 0.0
        return self.contact[touching, 0], self.contact[touching, 2]


def sampled_curve(nodes: FloatArray, points_per_edge: int) -> tuple[FloatArray, FloatArray]:
    """Points of a chain of quadratic edges, `points_per_edge` an edge and the last node."""
    s = np.arange(points_per_edge) / points_per_edge
    shape = np.stack([(1 - s) * (1 - 2 * s), 4 * s * (1 - s), s * (2 * s - 1)], axis=1)
    edges = np.stack([nodes[:-2:2], nodes[1:-1:2], nodes[2::2]], axis=1)
    points = np.concatenate([np.matmul(shape, edges).reshape(-1, 2), nodes[-1:]])
    return points[:, 0], points[:, 1]


def leaving_edge(
    r: FloatArray, z: FloatArray, gap: FloatArray, window: float = 0.1, touching: float = TOUCHING_GAP
) -> tuple[float, float]:
    """(r, z) where a curve leaves a rigid object.

    The gap beside the edge of a smooth frictionless contact grows with the power 3/2 of the distance s (Johnson,
    Contact Mechanics, sec. 5.1). gap^(2/3), fitted by a parabola in s over the outer three quarters of a window,
    is extended to zero. Pressure would locate the edge to an element only; this converges to 0.001 tip radii.

    Parameters
    ----------
    r, z, gap : (n,) points of the curve, and their distance to the object
    window : arc length of the fit
    touching : gap below which the curve may touch
    """
    length = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(r), np.diff(z)))])
    last = int(np.flatnonzero(gap < touching)[-1])
    fitted = (length > length[last] + 0.25 * window) & (length < length[last] + window)
    roots = np.roots(np.polyfit(length[fitted] - length[last], gap[fitted] ** (2 / 3), 2))
    end = length[last] + float(np.real(roots[np.argmin(np.abs(roots))]))
    return float(np.interp(end, length, r)), float(np.interp(end, length, z))


def contact_edge(
    nodes: FloatArray, depth: float, window: float = 0.1, tip: Tip | None = None
) -> tuple[float, float]:
    """(r, z) where the surface leaves a tip, by default a sphere with a shank.

    Parameters
    ----------
    nodes : deformed top, as in `ReferenceState`
    depth : of the apex
    window : arc length of the fit
    """
    r, z = sampled_curve(nodes, 16)
    edge, height = leaving_edge(r, z, (tip or sphere_tip()).gap(r, z, depth).distance, window)
    return min(edge, 1.0), height


def depths_of(layer: float) -> tuple[float, ...]:
    """Depths solved in a layer."""
    return tuple(depth for depth in DEPTHS if depth <= DEEPEST_SHARE * layer)


def _read_arrays(path: Path) -> dict[str, FloatArray]:
    with np.load(path, allow_pickle=False) as stored:
        return {name: stored[name] for name in stored.files}


@cache
def reference_arrays(path: Path = STORED) -> dict[str, FloatArray]:
    """The stored arrays."""
    return _read_arrays(path)


def reference_state(layer: float, depth: float, path: Path = STORED) -> ReferenceState:
    """The stored solution of a layer and depth [tip radii].

    Raises
    ------
    KeyError : not among the stored ones
    """
    arrays = reference_arrays(path)
    row = np.flatnonzero(np.isclose(arrays["layers"], layer, atol=1e-6))
    column = np.flatnonzero(np.isclose(arrays["depths"], depth, atol=1e-6))
    if row.size == 0 or column.size == 0 or np.isnan(arrays["force"][row[0], column[0]]):
        raise KeyError(f"no stored solution for layer {layer:g}, depth {depth:g}")
    at = (row[0], column[0])
    return ReferenceState(
        layer=layer,
        depth=depth,
        force=float(arrays["force"][at]),
        energy=float(arrays["energy"][at]),
        nodes=arrays["nodes"][at],
        rest_radii=arrays["rest_radii"],
        contact=arrays["contact"][at],
        half=CoarserState(
            force=float(arrays["half_force"][at]),
            energy=float(arrays["half_energy"][at]),
            nodes=arrays["half_nodes"][at],
        ),
    )


def _state_arrays(press: Press) -> dict[str, NDArray[np.generic]]:
    """What is kept of one state."""
    state = press.read()
    contact = state.contact.copy()
    open_points = np.flatnonzero(contact[:, 2] == 0.0)
    contact[open_points[1:]] = 0.0  # beyond the first open point nothing is needed; zeros pack well
    return {
        "rest_radii": press.solid.nodes[0][press.top_nodes],
        "nodes": state.curve,
        "contact": contact,
        **{name: np.array(getattr(state, name)) for name in FIELDS},
    }


def solve_layer(
    layer: float, depths: Sequence[float], grading: Grading, halvings: int, folder: Path = BUILD
) -> dict[float, list[dict[str, FloatArray]]]:
    """Solve the states of a layer on a chain of meshes, or read those that were finished before.

    The coarsest mesh is pressed deeper and deeper; each finer one starts from the state of the coarser one.

    Parameters
    ----------
    layer, depths : thickness, increasing depths
    grading, halvings : coarsest mesh, how often it is halved
    folder : where finished states are kept

    Returns
    -------
    depth -> arrays of the state on each mesh, coarsest first.
    """
    inputs = json.dumps([layer, WALL, POISSON_RATIO, asdict(grading), RECIPE])
    stem = f"contact-{layer:.3f}-{sha256(inputs.encode()).hexdigest()[:8]}"
    return solved_states(
        stem,
        depths,
        halvings,
        lambda level: Press(layer, WALL, grading, POISSON_RATIO, halvings=level),
        folder,
    )


def solved_states(
    stem: str, depths: Sequence[float], halvings: int, make: Callable[[int], Press], folder: Path = BUILD
) -> dict[float, list[dict[str, FloatArray]]]:
    """Solve the states of one press on a chain of meshes, or read those that were finished before.

    Parameters
    ----------
    stem : names what is solved; a part of the file names
    depths : increasing depths
    halvings : how often the coarsest mesh is halved
    make : the untouched press on the mesh of a level; 0 is the coarsest
    folder : where finished states are kept

    Returns
    -------
    depth -> arrays of the state on each mesh, coarsest first.
    """

    def path(depth: float, level: int) -> Path:
        return folder / f"{stem}-{depth:.4f}-{level}.npz"

    levels = range(halvings + 1)
    missing = [depth for depth in depths if not all(path(depth, level).exists() for level in levels)]
    presses: list[Press] = []
    start = perf_counter()
    for depth in depths[: depths.index(missing[-1]) + 1] if missing else []:
        presses = presses or [make(level) for level in levels]
        presses[0].advance(depth)
        for level in levels if depth in missing else []:
            if level > 0:
                presses[level].adopt(presses[level - 1])
            arrays = _state_arrays(presses[level])
            folder.mkdir(parents=True, exist_ok=True)
            np.savez_compressed(path(depth, level), **arrays)
            print(
                f"{stem}  depth {depth:.4f}  mesh {level}  force {arrays['force']:.6f}"
                f"  {perf_counter() - start:.0f} s",
                flush=True,
            )
    return {depth: [_read_arrays(path(depth, level)) for level in levels] for depth in depths}


def _table(states: list[list[dict[str, FloatArray]]], name: str) -> FloatArray:
    """(layer, depth, ...) one quantity; NaN where a depth was not solved."""
    filled = np.full((len(LAYERS), len(DEPTHS), *states[0][0][name].shape), np.nan)
    for row, layer in enumerate(states):
        for column, state in enumerate(layer):
            filled[row, column] = state[name]
    return filled


def build(grading: Grading, path: Path = STORED) -> None:
    """Solve everything and write the stored file: the finest mesh, and the next coarser one to estimate errors."""
    solved = [list(solve_layer(one, depths_of(one), grading, HALVINGS).values()) for one in LAYERS]
    fine, half = ([[meshes[level] for meshes in layer] for layer in solved] for level in (-1, -2))
    provenance = {
        "model": "axisymmetric neo-Hookean, Q2/Q1 displacement-pressure, frictionless hemisphere with shank",
        "poisson_ratio": POISSON_RATIO,
        "wall": WALL,
        "grading": asdict(grading),
        "halvings": HALVINGS,
        "command": "python -m tests.validation.contact.contact_reference",
        "versions": {name: version(name) for name in ("scikit-fem", "numpy", "scipy")},
    }
    np.savez_compressed(
        path,
        provenance=np.array(json.dumps(provenance)),
        layers=np.array(LAYERS),
        depths=np.array(DEPTHS),
        rest_radii=fine[0][0]["rest_radii"],
        **{name: _table(fine, name) for name in ("nodes", "contact", *FIELDS)},
        **{f"half_{name}": _table(half, name) for name in ("nodes", "force", "energy")},
    )


if __name__ == "__main__":
    build(Grading())
