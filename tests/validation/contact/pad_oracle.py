"""Presses in whole pads solved in three dimensions, and the command that solves them.

    python -m tests.validation.contact.pad_oracle    (two hours, resumable) writes pad_oracle.npz

Blocks bonded at bottom and walls (`block_oracle`), solved on a mesh and on its halves, which tell its error. The finer
one is what the model is compared with. Finished blocks are kept in `build/validation/`.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from functools import cache
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path
from time import perf_counter

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CloughTocher2DInterpolator

from optopad.design.arrays import FloatArray
from optopad.design.preset import preset
from optopad.design.spec import SensorDesign
from tests.validation.contact.contact_reference import BUILD, POISSON_RATIO, reference_state
from tests.validation.elements.block_oracle import BlockGrading, BlockPress, Walls
from tests.validation.elements.continuation import interpolated
from tests.validation.elements.newton import OracleError

STORED = Path(__file__).with_name("pad_oracle.npz")
TIP_RADIUS_MM = 3.0
LAYER = 3.0
DEPTHS_MM = (1.0, 2.0, 3.0, 4.5)
GRID_MM = 0.5
SAMPLES = 4
"""Points of the oracle's quadratic faces between two nodes."""
DEEPEST_EDGE = 4.0 / 3.0
HALVINGS = 1
RECIPE = 1
"""Version of the solver behind blocks kept in the build folder. Raise it when results change."""


@dataclass(frozen=True, kw_only=True)
class Place:
    """A published design, or one with another cavity, and (x, y) of the press axis in its cavity [mm]."""

    name: str
    at_mm: tuple[float, float]
    size_mm: tuple[float, float] | None = None

    @property
    def design(self) -> SensorDesign:
        """The design."""
        published = preset(self.name)
        if self.size_mm is None:
            return published
        return published.with_(**{"cavity.length_mm": self.size_mm[0], "cavity.width_mm": self.size_mm[1]})

    @property
    def is_mirrored(self) -> bool:
        """Whether the middle of the width is a plane of symmetry."""
        return self.at_mm[1] == 0.5 * self.design.cavity.width_mm

    @property
    def walls(self) -> Walls:
        """Distances of the walls [tip radii]; the third is 0 for a plane of symmetry."""
        cavity, (x, y) = self.design.cavity, self.at_mm
        east, north = cavity.length_mm - x, cavity.width_mm - y
        south = 0.0 if self.is_mirrored else y
        return x / TIP_RADIUS_MM, east / TIP_RADIUS_MM, south / TIP_RADIUS_MM, north / TIP_RADIUS_MM

    def grid_mm(self) -> tuple[FloatArray, FloatArray]:
        """(nx,) x and (ny,) y of the compared nodes in the cavity frame [mm], walls included."""
        cavity = self.design.cavity
        x, y = (
            np.linspace(0.0, size, round(size / GRID_MM) + 1) for size in (cavity.length_mm, cavity.width_mm)
        )
        return x, y

    def radius_mm(self) -> FloatArray:
        """(nx, ny) distance of the nodes from the press axis [mm]."""
        x, y = self.grid_mm()
        return np.hypot(x[:, None] - self.at_mm[0], y[None, :] - self.at_mm[1])


PAD, PAIR = "piacenza2017-pad", "piacenza2017-pair"
PLACES = {
    "pad middle": Place(name=PAD, at_mm=(16.0, 16.0)),
    "pad near a wall": Place(name=PAD, at_mm=(6.0, 16.0)),
    "pad in a corner": Place(name=PAD, at_mm=(8.0, 8.0)),
    "40 x 28 middle": Place(name=PAD, at_mm=(20.0, 14.0), size_mm=(40.0, 28.0)),
    "40 x 28 near a wall": Place(name=PAD, at_mm=(8.0, 14.0), size_mm=(40.0, 28.0)),
    "pair middle": Place(name=PAIR, at_mm=(10.0, 10.0)),
    "small pad": Place(name=PAIR, at_mm=(8.0, 8.0), size_mm=(16.0, 16.0)),
}


@dataclass(frozen=True, kw_only=True)
class PadPress:
    """One press of the oracle.

    Attributes
    ----------
    force : of the whole pad [E R²]
    height_mm : (nx, ny) of the top over the undisturbed one, at the nodes of `Place.grid_mm` [mm]
    """

    force: float
    height_mm: FloatArray


def solve_block(
    walls: Walls, depths: tuple[float, ...], grading: BlockGrading, folder: Path = BUILD
) -> list[dict[str, FloatArray]]:
    """Forces (depth,) and tops (depth, node, 3) on each mesh, coarsest first; read if finished before."""
    inputs = json.dumps([LAYER, walls, depths, POISSON_RATIO, asdict(grading), RECIPE])
    stem = f"block-{sha256(inputs.encode()).hexdigest()[:8]}"
    paths = [folder / f"{stem}-{level}.npz" for level in range(HALVINGS + 1)]
    if not all(path.exists() for path in paths):
        folder.mkdir(parents=True, exist_ok=True)
        presses = [BlockPress(LAYER, walls, grading, POISSON_RATIO, level) for level in range(HALVINGS + 1)]
        states: list[list[tuple[float, FloatArray]]] = [[] for _ in presses]
        start = perf_counter()
        for depth in depths:
            for level, press in enumerate(presses):
                if level == 0:
                    press.advance(depth)
                else:
                    try:
                        press.adopt(presses[level - 1])
                    except (
                        OracleError
                    ):  # too far from the coarser mesh's state: step by step from its own last one
                        press.advance(depth)
                state = press.read()
                states[level].append((state.force, state.top))
                print(f"walls {walls}  depth {depth:.4f}  mesh {level}  force {state.force:.6f}", flush=True)
                print(
                    f"  balance {state.force + state.reaction:.1e}  {perf_counter() - start:.0f} s",
                    flush=True,
                )
        for path, found in zip(paths, states, strict=True):
            force, top = np.array([one[0] for one in found]), np.array([one[1] for one in found])
            np.savez_compressed(path, force=force, top=top)
    return [read_arrays(path) for path in paths]


def read_arrays(path: Path) -> dict[str, FloatArray]:
    """The arrays of a file, by name."""
    with np.load(path, allow_pickle=False) as stored:
        return {name: stored[name] for name in stored.files}


def dense_top(rest: FloatArray, top: FloatArray) -> FloatArray:
    """(m, 3) points of the oracle's deformed top between its nodes, the elements' own polynomials.

    Parameters
    ----------
    rest : (2, n) places of the nodes at rest, a product of coordinates
    top : (n, 3) deformed nodes
    """
    axes = [np.unique(np.round(one, 9)) for one in rest]
    finer = [
        np.interp(np.arange(SAMPLES * (len(one) - 1) + 1) / SAMPLES, range(len(one)), one) for one in axes
    ]
    points = np.stack([one.ravel() for one in np.meshgrid(*finer, indexing="ij")])
    return np.stack([interpolated(rest, values, points, 2) for values in top.T], axis=1)


def heights_mm(place: Place, depth: float, points: FloatArray) -> FloatArray:
    """(nx, ny) height at the nodes [mm]: the exact tip in the contact.

    Parameters
    ----------
    depth : of the press [tip radii]
    points : (m, 3) of the deformed top from the press axis [tip radii]; of half the pad where it is mirrored
    """
    if place.is_mirrored:
        points = np.concatenate([points, points[points[:, 1] > 1e-9] * np.array([1.0, -1.0, 1.0])])
    x, y = place.grid_mm()
    along, across = np.meshgrid(
        (x - place.at_mm[0]) / TIP_RADIUS_MM, (y - place.at_mm[1]) / TIP_RADIUS_MM, indexing="ij"
    )
    found = np.asarray(CloughTocher2DInterpolator(points[:, :2], points[:, 2])(along, across))
    found[[0, -1]] = found[:, [0, -1]] = 0.0
    radius = np.hypot(along, across)
    tip = 1.0 - depth - np.sqrt(np.maximum(1.0 - radius**2, 0.0))
    # from 4/3 on the shank is in contact
    edge = reference_state(LAYER, min(depth, DEEPEST_EDGE)).contact_radius
    return TIP_RADIUS_MM * np.where(radius < edge, tip, found)


def solve(place: Place, grading: BlockGrading) -> tuple[FloatArray, FloatArray]:
    """Forces (mesh, depth) [E R²] and heights (mesh, depth, nx, ny) [mm], the coarser mesh first."""
    tops = []
    depths = tuple(depth / TIP_RADIUS_MM for depth in DEPTHS_MM)
    solved = solve_block(place.walls, depths, grading)
    for level, states in enumerate(solved):
        press = BlockPress(LAYER, place.walls, grading, POISSON_RATIO, level)
        rest = press.solid.nodes[:2, press.top_nodes]
        tops.append(
            [
                heights_mm(place, depth, dense_top(rest, top))
                for depth, top in zip(depths, states["top"], strict=True)
            ]
        )
    return np.array([states["force"] for states in solved]), np.array(tops)


def build(grading: BlockGrading, path: Path = STORED) -> None:
    """Solve everything and write the stored file."""
    arrays: dict[str, NDArray[np.generic]] = {}
    for name, place in PLACES.items():
        arrays[f"{name}: force"], tops = solve(place, grading)
        arrays[f"{name}: height"] = tops.astype(np.float32)
    made = {
        "command": "python -m tests.validation.contact.pad_oracle",
        "model": "neo-Hookean block, hexahedra Q2/Q1, frictionless hemisphere with shank, bonded bottom and walls",
        "axes": "mesh (coarser, finer), depth, x, y",
        "depths_mm": DEPTHS_MM,
        "poisson_ratio": POISSON_RATIO,
        "grading": asdict(grading),
        "halvings": HALVINGS,
        "versions": {name: version(name) for name in ("scikit-fem", "numpy", "scipy")},
    }
    np.savez_compressed(path, provenance=np.array(json.dumps(made)), **arrays)  # type: ignore[arg-type]


@cache
def _stored() -> dict[str, FloatArray]:
    return read_arrays(STORED)


def pad_press(name: str, depth_mm: float, *, half: bool = False) -> PadPress:
    """The stored press of a place, one of `PLACES`, and depth, one of `DEPTHS_MM`; `half` takes the coarser mesh."""
    level, row = -2 if half else -1, DEPTHS_MM.index(depth_mm)
    return PadPress(
        force=float(_stored()[f"{name}: force"][level, row]),
        height_mm=_stored()[f"{name}: height"][level, row].astype(np.float64),
    )


if __name__ == "__main__":
    build(BlockGrading())
