"""Stored solutions of the finite-element oracle, and the command that makes them.

    python -m tests.validation.contact_reference

solves four layers down to 5/3 tip radii (the thinnest to 4/3) and writes `contact_reference.npz`. Finished
layers are kept in `build/validation/`, so that an interrupted run continues. Lengths are in tip radii R, forces
in E R².
"""

from __future__ import annotations

import json
import sys
from dataclasses import asdict, dataclass
from functools import cache
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

STORED = Path(__file__).with_name("contact_reference.npz")
BUILD = Path(__file__).parents[2] / "build" / "validation"
WALL = 16 / 3
POISSON_RATIO = 0.499
LAYERS = (2.0, 8 / 3, 3.0, 16 / 3)
DEPTHS = tuple(depth / 3.0 for depth in (0.2, 0.5, 1.0, 2.0, 3.0, 4.0, 5.0))
DEEPEST_SHARE = 0.7
"""Deepest press over layer: 4/3 of a layer of 2 is solved, 5/3 is not."""
FIELDS = ("force", "reaction", "energy", "volume_change", "penetration")


@dataclass(frozen=True, kw_only=True)
class ReferenceState:
    """One press of the unit hemisphere into a layer; lengths in tip radii, force in E R².

    Attributes
    ----------
    layer, depth : thickness of the layer, depth of the apex
    force, energy : press force, elastic energy
    contact_edge : (r, z) where the surface leaves the tip
    nodes : (2 * edges + 1, 2) deformed nodes of the top; corner, middle, corner, ... of quadratic edges
    rest_radii : (2 * edges + 1,) radius of these nodes at rest
    contact : (points, 4) radius, height, pressure and deformed area of the contact quadrature points
    """

    layer: float
    depth: float
    force: float
    energy: float
    contact_edge: tuple[float, float]
    nodes: FloatArray
    rest_radii: FloatArray
    contact: FloatArray

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


def contact_edge(contact: FloatArray) -> tuple[float, float]:
    """Where contact ends: the square of the pressure, linear in radius near the edge of a smooth contact,
    is extended to zero from the last four touching points, but not beyond the first open point.

    On the shank the radius is constant, so the path is followed by its length.
    """
    touching = np.flatnonzero(contact[:, 2] > 0.0)
    last = int(touching[-1])
    length = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(contact[:, :2], axis=0).T))])
    tail = slice(max(0, last - 3), last + 1)
    slope, at_zero = np.polyfit(length[tail], contact[tail, 2] ** 2, 1) if last > 0 else (0.0, 0.0)
    end = -at_zero / slope if slope < 0.0 else length[last]
    end = float(np.clip(end, length[last], length[last + 1]))
    return float(np.interp(end, length, contact[:, 0])), float(np.interp(end, length, contact[:, 1]))


def depths_of(layer: float) -> tuple[float, ...]:
    """Depths solved in a layer."""
    return tuple(depth for depth in DEPTHS if depth <= DEEPEST_SHARE * layer)


@cache
def reference_arrays() -> dict[str, FloatArray]:
    """The stored arrays."""
    with np.load(STORED, allow_pickle=False) as stored:
        return {name: stored[name] for name in stored.files}


def reference_state(layer: float, depth: float) -> ReferenceState:
    """The stored solution of a layer and depth [tip radii].

    Raises
    ------
    KeyError : not among the stored ones
    """
    arrays = reference_arrays()
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
        contact_edge=(float(arrays["contact_edge"][at][0]), float(arrays["contact_edge"][at][1])),
        nodes=arrays["nodes"][at],
        rest_radii=arrays["rest_radii"],
        contact=arrays["contact"][at],
    )


def solve_layer(layer: float, grading: object, folder: Path = BUILD) -> dict[str, FloatArray]:
    """Solve the states of a layer, or read them if they were finished before."""
    from tests.validation.press_oracle import Press, pressed_states

    inputs = json.dumps([layer, WALL, POISSON_RATIO, asdict(grading), DEPTHS])  # type: ignore[call-overload]
    path = folder / f"contact-{layer:.3f}-{sha256(inputs.encode()).hexdigest()[:8]}.npz"
    if not path.exists():
        press = Press(layer, WALL, grading, POISSON_RATIO)  # type: ignore[arg-type]
        found = []
        start = perf_counter()
        for state in pressed_states(press, depths_of(layer)):
            found.append(state)
            print(
                f"layer {layer:.3f}  depth {state.depth:.4f}  force {state.force:.5f}  {perf_counter() - start:.0f} s",
                flush=True,
            )
        folder.mkdir(parents=True, exist_ok=True)
        np.savez_compressed(
            path,
            rest_radii=press.solid.nodes[0][press.top_nodes],
            nodes=np.array([state.curve for state in found]),
            contact=np.array([state.contact for state in found]),
            contact_edge=np.array([contact_edge(state.contact) for state in found]),
            **{name: np.array([getattr(state, name) for state in found]) for name in FIELDS},
        )
    with np.load(path, allow_pickle=False) as stored:
        return {name: stored[name] for name in stored.files}


def build(grading: object, path: Path = STORED) -> None:
    """Solve everything and write the stored file."""
    solved = [solve_layer(layer, grading) for layer in LAYERS]
    arrays: dict[str, NDArray[np.generic]] = {"layers": np.array(LAYERS), "depths": np.array(DEPTHS)}
    arrays["rest_radii"] = solved[0]["rest_radii"]
    for name in ("nodes", "contact", "contact_edge", *FIELDS):
        shape = (len(LAYERS), len(DEPTHS), *solved[0][name].shape[1:])
        filled = np.full(shape, np.nan)
        for row, one in enumerate(solved):
            filled[row, : len(one[name])] = one[name]
        arrays[name] = filled
    provenance = {
        "model": "axisymmetric neo-Hookean, Q2/Q1 displacement-pressure, frictionless hemisphere with shank",
        "poisson_ratio": POISSON_RATIO,
        "wall": WALL,
        "grading": asdict(grading),  # type: ignore[call-overload]
        "command": "python -m tests.validation.contact_reference",
        "versions": {name: version(name) for name in ("scikit-fem", "numpy", "scipy")},
        "python": ".".join(map(str, sys.version_info[:2])),
    }
    np.savez_compressed(path, provenance=np.array(json.dumps(provenance)), **arrays)


if __name__ == "__main__":
    from tests.validation.layer_mesh import Grading

    build(Grading())
