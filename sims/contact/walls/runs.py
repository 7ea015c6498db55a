"""The three-dimensional runs behind the wall correction: which pads are pressed, and their surfaces on disk.

For each layer depth two meshes are used, each with a pad whose walls are all at 16/3 tip radii as the
reference: one with a single wall moved to the west, one with one or two walls at `PAIR_DISTANCE`
(that meet, or face each other). Every finished run is one file; an interrupted set goes on where it stopped.
    python -m sims.contact.walls.fit FOLDER [PROCESSES]
makes all runs (about 30 s each on one core of its own) and from them the shipped file.
All lengths in tip radii, forces in E R².
"""

from __future__ import annotations

import os
import zlib
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from importlib.metadata import version
from multiprocessing import get_context
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from design.rules.contact_scope import DEEPEST_PRESS, LARGEST_SHARE_OF_LAYER
from sims.contact.scope import HALF_WIDTH

FloatArray = NDArray[np.float64]

LAYERS = (1.3, 1.9, 2.8, 4.1, 6.0)
"""Elastic depths [tip radii]."""
DISTANCES = (1.5, 1.8, 2.4, 3.4)
"""Distances of a single near wall [tip radii]; at 16/3 the correction is zero by definition."""
FAR_DISTANCE = 8.0
"""Distance of a single wall that is farther than 16/3; farther ones count as at this one [tip radii]."""
PAIR_LAYERS = (2.8, 4.1)
"""Elastic depths of the pads with two near walls [tip radii]; thinner and deeper layers take the nearest one's."""
PAIR_DISTANCE = 2.4
"""Distance of each of two near walls [tip radii]."""
DEPTH_COUNT = 14
"""Depths a run, evenly spaced up to the model's limit."""
POISSON_RATIO = 0.495
"""[-]; see `block`."""
SPACING = 0.4
"""Edge of the hexahedra under the tip [tip radii]."""

CHECK_DEPTHS = (1 / 3, 2 / 3, 1.0, 4 / 3, 1.7)
"""Depths of the runs that check the correction [tip radii]: 1, 2, 3, 4 and 5.1 mm for a 3 mm tip."""
CHECK_WALLS = {
    "near a wall": (2.0, 26 / 3, 16 / 3, 16 / 3),
    "in a corner": (7 / 3, 25 / 3, 8 / 3, 8.0),
    "in a tight corner": (2.0, 16 / 3, 2.0, 16 / 3),
    "small pad": (4.0,) * 4,
    "smaller pad": (8 / 3,) * 4,
}
"""Pads that are no nodes of the data: 32 x 32 mm pressed at (6, 16), (7, 8) and (6, 6) mm with a 3 mm tip (the last
with its far walls at 16 mm); the middle of
a 16 x 16 mm pad with a 2 mm tip; the middle of a pad with walls at 8/3 tip radii. Order: west, east, south, north."""

Walls = tuple[float, float, float, float]
_FAR = HALF_WIDTH
PAIRS = ("single", "corner", "channel")
"""Pads on the mesh of two near walls: one wall, two that meet, two that face each other."""


@dataclass(frozen=True, kw_only=True)
class WallRun:
    """One pad to be pressed.

    Attributes
    ----------
    layer : elastic depth
    walls : distances (west, east, south, north)
    stops : for each side, distances through which the mesh has lines; equal for pads that are compared
    spacing : edge of the hexahedra under the tip
    poisson_ratio : [-]
    stiffness : of the contact, over the usual one [-]
    depths : press depths
    """

    layer: float
    walls: Walls
    stops: tuple[tuple[float, ...], ...]
    depths: tuple[float, ...]
    spacing: float = SPACING
    poisson_ratio: float = POISSON_RATIO
    stiffness: float = 1.0

    @property
    def name(self) -> str:
        """File name without ending."""
        walls = "-".join(f"{wall:.3f}" for wall in self.walls)
        lines = zlib.crc32(repr((self.stops, self.depths, self.stiffness)).encode())
        return f"h{self.layer:.3f}_w{walls}_m{lines:08x}_s{self.spacing:.3f}_n{self.poisson_ratio:.4f}"


@dataclass(frozen=True, kw_only=True)
class WallSurfaces:
    """A finished run; lengths in tip radii, forces in E R².

    Attributes
    ----------
    depths, force : (depth,)
    rest : (top node, 2) places of the master mesh at rest
    facets : (facet, 3) triangles of the top
    top : (depth, top node, 3) deformed top
    is_half : whether only y >= 0 is modelled
    """

    depths: FloatArray
    force: FloatArray
    rest: FloatArray
    facets: NDArray[np.int64]
    top: FloatArray
    is_half: bool


def run_depths(layer: float) -> tuple[float, ...]:
    """Depths of a run: even steps to the deepest press of the model [tip radii]."""
    deepest = min(LARGEST_SHARE_OF_LAYER * layer, DEEPEST_PRESS)
    return tuple(deepest * (index + 1) / DEPTH_COUNT for index in range(DEPTH_COUNT))


def single_run(layer: float, distance: float) -> WallRun:
    """A pad with one wall moved to the west; at 16/3 the reference.

    The mesh of the farther wall continues that of the others, which have the same lines up to 16/3.
    """
    beyond = (FAR_DISTANCE,) if distance > _FAR else ()
    stops = ((*DISTANCES, _FAR, *beyond), (_FAR,), (_FAR,), (_FAR,))
    return WallRun(layer=layer, walls=(distance, _FAR, _FAR, _FAR), stops=stops, depths=run_depths(layer))


def pair_walls(kind: str, distance: float = PAIR_DISTANCE) -> Walls:
    """Distances (west, east, south, north) of one of `PAIRS`; "reference": all at 16/3."""
    west, far = distance, _FAR
    return {
        "reference": (far, far, far, far),
        "single": (west, far, far, far),
        "corner": (west, far, west, far),
        "channel": (west, west, far, far),
    }[kind]


def pair_run(layer: float, kind: str, distance: float = PAIR_DISTANCE) -> WallRun:
    """A pad with up to two near walls."""
    stops = ((distance, _FAR),) * 4
    return WallRun(layer=layer, walls=pair_walls(kind, distance), stops=stops, depths=run_depths(layer))


def all_runs() -> list[WallRun]:
    """Every run of the shipped data, the most useful first."""
    order = sorted(LAYERS, key=lambda layer: abs(np.log(layer / 2.8)))
    singles = [
        single_run(layer, distance) for layer in order for distance in (_FAR, *DISTANCES, FAR_DISTANCE)
    ]
    pairs = [pair_run(layer, kind) for layer in PAIR_LAYERS for kind in ("reference", *PAIRS)]
    return singles + pairs


def check_run(walls: Walls, *, near: bool = True, layer: float = 3.0) -> WallRun:
    """A pad that the data does not contain, or (`near` False) its reference on the same mesh."""
    sides = [tuple(sorted({wall, _FAR})) for wall in walls]
    return WallRun(layer=layer, walls=walls if near else (_FAR,) * 4, stops=tuple(sides), depths=CHECK_DEPTHS)


def make_run(run: WallRun, folder: Path) -> Path:
    """Solve a run and store it, unless it is stored already; returns its file."""
    from sims.contact.solver.block import solve_block
    from sims.contact.solver.block_mesh import block_mesh

    path = folder / f"{run.name}.npz"
    if path.exists():
        return path
    mesh = block_mesh(run.layer, run.walls, run.stops, run.spacing)
    states = list(solve_block(mesh, run.depths, run.spacing, run.poisson_ratio, run.stiffness))
    temporary = path.with_suffix(f".{os.getpid()}.part")
    with temporary.open("wb") as file:
        np.savez_compressed(
            file,
            allow_pickle=False,
            depths=np.array([state.depth for state in states]),
            force=np.array([state.force for state in states]),
            reaction=np.array([state.check.reaction for state in states]),
            last_step=np.array([state.check.last_step for state in states]),
            penetration=np.array([state.check.penetration for state in states]),
            smallest_stretch=np.array([state.check.smallest_stretch for state in states]),
            top=np.array([state.top for state in states], dtype=np.float32),
            rest=mesh.top,
            facets=mesh.facets.astype(np.int32),
            is_half=np.array(mesh.is_half),
            mujoco=np.array(version("mujoco")),
        )
    os.replace(temporary, path)
    return path


def read_run(run: WallRun, folder: Path) -> WallSurfaces:
    """A stored run."""
    with np.load(folder / f"{run.name}.npz", allow_pickle=False) as entry:
        return WallSurfaces(
            depths=entry["depths"],
            force=entry["force"],
            rest=entry["rest"],
            facets=entry["facets"].astype(np.int64),
            top=entry["top"].astype(np.float64),
            is_half=bool(entry["is_half"]),
        )


def make_runs(runs: Sequence[WallRun], folder: Path, processes: int = 1) -> None:
    """Solve and store all runs, each in one process."""
    folder.mkdir(parents=True, exist_ok=True)
    if processes == 1:
        for run in runs:
            make_run(run, folder)
        return
    with ProcessPoolExecutor(max_workers=processes, mp_context=get_context("spawn")) as pool:
        for future in [pool.submit(make_run, run, folder) for run in runs]:
            future.result()
