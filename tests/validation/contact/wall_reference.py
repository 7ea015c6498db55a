"""Presses near bonded walls in three dimensions: what the walls change, and the command that solves it.

    python -m tests.validation.contact.wall_reference

For two places in a 32 x 32 mm pad (layer 3 tip radii, tip radius 3 mm) and the middle, blocks of the same mesh
around the tip are solved (`block_oracle`) and the differences from the middle stored in `wall_reference.npz`:
force ratio and change of height at places on circles around the axis. Each is solved on a mesh and on its halves;
the halved one is stored, and the coarser one beside it for an estimate of the error. Finished blocks are kept in
`build/validation/`. Lengths in tip radii.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import cache
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path
from time import perf_counter

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CloughTocher2DInterpolator

from tests.validation.contact.contact_reference import BUILD, POISSON_RATIO
from tests.validation.elements.block_oracle import BlockGrading, BlockPress, Walls

FloatArray = NDArray[np.float64]

STORED = Path(__file__).with_name("wall_reference.npz")
LAYER = 3.0
DEPTHS = (1 / 3, 2 / 3, 1.0)
MIDDLE: Walls = (16 / 3, 16 / 3, 0.0, 16 / 3)
PLACES: dict[str, Walls] = {
    "near a wall": (2.0, 26 / 3, 0.0, 16 / 3),
    "in a corner": (7 / 3, 25 / 3, 8 / 3, 8.0),
}
"""Distances of the walls at -x, +x, -y, +y; 0 stands for a plane of symmetry."""
HALVINGS = 1
RECIPE = 1
"""Version of the solver behind blocks kept in the build folder. Raise it when results change."""
RADII = (1.2, 1.5, 1.8, 2.2, 2.6, 3.2, 4.0, 5.0)
DIRECTIONS_DEG = tuple(range(0, 360, 30))
"""Where heights are compared: on circles around the axis, from the direction of +x."""
WALL_CLEARANCE = 0.1
"""Compared places lie farther than this from the walls."""


@dataclass(frozen=True, kw_only=True)
class WallChange:
    """What walls change at one press depth; lengths in tip radii.

    Attributes
    ----------
    force_factor : force over that of the middle [-]
    x, y : (n,) places relative to the axis
    change : (n,) height there less that of the middle
    """

    force_factor: float
    x: FloatArray
    y: FloatArray
    change: FloatArray


def compared_places(walls: Walls) -> tuple[FloatArray, FloatArray]:
    """(x, y) of the compared places inside a block; all of them in the block in the middle too."""
    radius, angle = np.meshgrid(RADII, np.radians(DIRECTIONS_DEG))
    x, y = (radius * np.cos(angle)).ravel(), (radius * np.sin(angle)).ravel()
    west, east, south, north = walls
    inside = (x > WALL_CLEARANCE - west) & (x < east - WALL_CLEARANCE) & (y < north - WALL_CLEARANCE)
    inside &= (y > -1e-9) if south == 0.0 else (y > WALL_CLEARANCE - south)
    inside &= np.maximum(np.abs(x), np.abs(y)) < MIDDLE[0] - WALL_CLEARANCE
    return x[inside], y[inside]


def solve_block(walls: Walls, grading: BlockGrading, folder: Path = BUILD) -> list[dict[str, FloatArray]]:
    """Forces (depth,) and tops (depth, node, 3) on each mesh, coarsest first; read if finished before."""
    inputs = json.dumps([LAYER, walls, DEPTHS, POISSON_RATIO, asdict(grading), RECIPE])
    stem = f"block-{sha256(inputs.encode()).hexdigest()[:8]}"
    paths = [folder / f"{stem}-{level}.npz" for level in range(HALVINGS + 1)]
    if not all(path.exists() for path in paths):
        folder.mkdir(parents=True, exist_ok=True)
        presses = [BlockPress(LAYER, walls, grading, POISSON_RATIO, level) for level in range(HALVINGS + 1)]
        states: list[list[tuple[float, FloatArray]]] = [[] for _ in presses]
        start = perf_counter()
        for depth in DEPTHS:
            for level, press in enumerate(presses):
                if level == 0:
                    press.advance(depth)
                else:
                    press.adopt(presses[level - 1])
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


def provenance(grading: BlockGrading, command: str, **more: object) -> NDArray[np.str_]:
    """What a stored file of blocks was made of, as JSON."""
    made = {
        "poisson_ratio": POISSON_RATIO,
        "grading": asdict(grading),
        "halvings": HALVINGS,
        "command": command,
        "versions": {name: version(name) for name in ("scikit-fem", "numpy", "scipy")},
    }
    return np.array(json.dumps(more | made))


def read_arrays(path: Path) -> dict[str, FloatArray]:
    """The arrays of a file, by name."""
    with np.load(path, allow_pickle=False) as stored:
        return {name: stored[name] for name in stored.files}


def heights(top: FloatArray, x: FloatArray, y: FloatArray, mirrored: bool) -> FloatArray:
    """Height of a deformed top (node, 3) at places; a mirrored top stands for y < 0 too."""
    if mirrored:
        top = np.concatenate([top, top[top[:, 1] > 1e-9] * np.array([1.0, -1.0, 1.0])])
    return np.asarray(CloughTocher2DInterpolator(top[:, :2], top[:, 2])(x, y))


def changes(walls: Walls, level: int, grading: BlockGrading) -> list[WallChange]:
    """What the walls change at each depth, on one mesh."""
    middle, block = solve_block(MIDDLE, grading)[level], solve_block(walls, grading)[level]
    x, y = compared_places(walls)
    return [
        WallChange(
            force_factor=float(block["force"][row] / middle["force"][row]),
            x=x,
            y=y,
            change=heights(block["top"][row], x, y, walls[2] == 0.0)
            - heights(middle["top"][row], x, y, True),
        )
        for row in range(len(DEPTHS))
    ]


def build(grading: BlockGrading, places: Sequence[str] = tuple(PLACES), path: Path = STORED) -> None:
    """Solve everything and write the stored file."""
    arrays: dict[str, NDArray[np.generic]] = {"depths": np.array(DEPTHS)}
    for place in places:
        fine, half = (changes(PLACES[place], level, grading) for level in (HALVINGS, HALVINGS - 1))
        arrays |= {
            f"{place}: x": fine[0].x,
            f"{place}: y": fine[0].y,
            f"{place}: force": np.array([one.force_factor for one in fine]),
            f"{place}: change": np.array([one.change for one in fine]),
            f"{place}: half force": np.array([one.force_factor for one in half]),
            f"{place}: half change": np.array([one.change for one in half]),
        }
    made_of = provenance(
        grading,
        "python -m tests.validation.contact.wall_reference",
        model="neo-Hookean block, hexahedra Q2/Q1, frictionless hemisphere with shank; differences from the middle",
        layer=LAYER,
    )
    np.savez_compressed(path, provenance=made_of, **arrays)


@cache
def _stored() -> dict[str, FloatArray]:
    return read_arrays(STORED)


def wall_change(place: str, depth: float, *, half: bool = False) -> WallChange:
    """The stored change of a place and depth; `half` takes the coarser mesh.

    Raises
    ------
    KeyError : not among the stored ones
    """
    arrays, prefix = _stored(), f"{place}: {'half ' if half else ''}"
    row = np.flatnonzero(np.isclose(arrays["depths"], depth, atol=1e-6))
    if row.size == 0 or f"{place}: x" not in arrays:
        raise KeyError(f"no stored press {place} at depth {depth:g}")
    return WallChange(
        force_factor=float(arrays[f"{prefix}force"][row[0]]),
        x=arrays[f"{place}: x"],
        y=arrays[f"{place}: y"],
        change=arrays[f"{prefix}change"][row[0]],
    )


if __name__ == "__main__":
    build(BlockGrading())
