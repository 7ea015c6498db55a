"""How much light leaves through the top, crosses the crater in air and comes back in: what the fast engine leaves out.

    python -m tests.validation.light.crossing_light            the tables of docs/validation/crossing.md, half an hour
    python -m tests.validation.light.crossing_light --fresh    the same, with nothing taken from an interrupted run

The oracle sends rays from every emitter in each of the 2 x 108 benchmark states, and counts those that are received
after a flight in air (class `crossing`); then, fewer of them, with the tip at 121 places 2 mm apart. Finished places
are kept in `build/validation/crossing/`. Of each surface and depth, the pair whose share is largest by two standard
errors' lower bound is measured again with another seed: the largest of many noisy figures is too large on average.
"""

from __future__ import annotations

import shutil
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numba
import numpy as np

from optopad.design.arrays import FloatArray
from optopad.sims.optics.scene.optical_scene import OpticalScene
from optopad.sims.press import Indentation
from tests.bench.measures.benchmark_states import (
    DEPTHS_MM,
    SURFACES,
    benchmark_scene,
    different_walls,
    places_mm,
    surface_of,
)
from tests.oracle.tracer import CLASSES, trace_oracle
from tests.validation.contact.contact_table import markdown_table, with_table

ROOT = Path(__file__).parents[3]
BUILD = ROOT / "build" / "validation" / "crossing"
PAGE = ROOT / "docs" / "validation" / "crossing.md"
MARKS = "<!-- made by tests/validation/light/crossing_light.py -->", "<!-- end -->"
RAYS, SCAN, AGAIN, FLAT = 400_000, 50_000, 10_000_000, 2_000_000
"""Rays of an emitter: at the benchmark's places, in the scan, for the largest pair again, on the untouched pad."""
SEED = 101
SCAN_DEPTHS_MM = (3.0, 4.0, 5.0)
VERSION = 1
"""Counts up when the oracle's physics changes, so that stored runs are not taken for new ones."""


@dataclass(frozen=True, kw_only=True)
class Crossing:
    """Shares of the undeformed signal of a pair, over all places of one surface and depth [-].

    Attributes
    ----------
    mean, mean_error : over pairs of different walls and places, and its standard error
    rms : root of the mean square over them, without what the counts' noise adds
    largest, largest_error : of the pair that surely had the largest share, measured again
    where : of that pair: x and y of the press [mm], emitter, receiver
    is_clear : whether its share was above two standard errors in the first measurement
    same_wall : mean over pairs of one wall of their crossing light, over the mean signal of different walls
    """

    surface: str
    depth_mm: float
    mean: float
    mean_error: float
    rms: float
    largest: float
    largest_error: float
    where: tuple[float, float, int, int]
    is_clear: bool
    same_wall: float


def kept(name: str, make: Callable[[], FloatArray]) -> FloatArray:
    """An array from its file, made and stored if there is none."""
    BUILD.mkdir(parents=True, exist_ok=True)
    file = BUILD / f"{name}-{VERSION}.npy"
    if not file.exists():
        np.save(file, make())
        print(name, file=sys.stderr, flush=True)
    return np.asarray(np.load(file, allow_pickle=False))


def crossing_flux(
    scene: OpticalScene, centre_mm: FloatArray, presses: list[Indentation], rays: int, seed: int
) -> FloatArray:
    """(state, emitter, receiver) received light that crossed the crater [-]."""
    centres = np.tile(centre_mm, (len(presses), 1))
    return trace_oracle(scene, centres, presses, rays=rays, seed=seed).flux[CLASSES.index("crossing")]


def flat_flux() -> FloatArray:
    """(emitter, receiver) flux of the untouched pad [-]."""
    return trace_oracle(benchmark_scene(), np.zeros((1, 2)), [None], rays=FLAT, seed=SEED).total[0]


def only_emitter(scene: OpticalScene, emitter: int) -> OpticalScene:
    """The scene with one of its emitters."""
    chosen = [emitter]
    return replace(
        scene,
        emitter_wall=scene.emitter_wall[chosen],
        emitter_patch=scene.emitter_patch[chosen],
        emitter_order=scene.emitter_order[chosen],
        emitter_pattern=None if scene.emitter_pattern is None else scene.emitter_pattern[chosen],
    )


def scan_places_mm() -> FloatArray:
    """(121, 2) press axes 2 mm apart, 6 mm and more from the walls [mm]."""
    ticks = np.linspace(6.0, 26.0, 11)
    return np.array([(x, y) for x in ticks for y in ticks])


def measured(
    surface: str, places: FloatArray, depths_mm: Sequence[float], rays: int, name: str
) -> Iterator[Crossing]:
    """One row for every depth. A ray counts once or not at all, so a count has the variance of a binomial one."""
    scene = benchmark_scene()
    presses = [surface_of(surface)(depth_mm) for depth_mm in depths_mm]
    flux = np.stack(
        [
            kept(
                f"{name}-{rays}-{number:02d}",
                partial(crossing_flux, scene, centre, presses, rays, SEED + 1 + number),
            )
            for number, centre in enumerate(places)
        ]
    )  # (place, depth, emitter, receiver)
    flat, judged = kept(f"flat-{FLAT}", flat_flux), different_walls(scene)
    scale = np.where(judged, flat, flat[judged].mean())  # some pairs of one wall have no signal at all
    share, variance = flux / scale, flux * (1.0 - flux) / rays / scale**2
    for at, depth_mm in enumerate(depths_mm):
        mine, noise = share[:, at, judged], variance[:, at, judged]
        sure = np.where(judged, share[:, at] - 2.0 * np.sqrt(variance[:, at]), -np.inf)
        place, emitter, receiver = (int(k) for k in np.unravel_index(np.argmax(sure), sure.shape))
        one = partial(crossing_flux, only_emitter(scene, emitter), places[place], [presses[at]], AGAIN, SEED)
        again = float(kept(f"{name}-{AGAIN}-again-{at}-{place}-{emitter}", one)[0, 0, receiver])
        signal = float(flat[emitter, receiver])
        yield Crossing(
            surface=surface,
            depth_mm=depth_mm,
            mean=float(mine.mean()),
            mean_error=float(np.sqrt(noise.sum()) / noise.size),
            rms=float(np.sqrt(max((mine**2 - noise).mean(), 0.0))),
            largest=again / signal,
            largest_error=float(np.sqrt(again * (1.0 - again) / AGAIN)) / signal,
            where=(float(places[place, 0]), float(places[place, 1]), emitter, receiver),
            is_clear=bool(sure.max() > 0.0),
            same_wall=float(flux[:, at, ~judged].mean() / flat[judged].mean()),
        )


def cells(row: Crossing) -> list[str]:
    """A row of the table, shares in percent."""
    x_mm, y_mm, emitter, receiver = row.where
    return [
        row.surface,
        f"{row.depth_mm:g}",
        f"{100.0 * row.mean:.4f} ± {100.0 * row.mean_error:.4f}",
        f"{100.0 * row.rms:.4f}",
        f"{100.0 * row.largest:.3f} ± {100.0 * row.largest_error:.3f}" if row.is_clear else "-",
        f"{emitter} → {receiver} at ({x_mm:.1f}, {y_mm:.1f}) mm" if row.is_clear else "none above noise",
        f"{100.0 * row.same_wall:.5f}",
    ]


def main(arguments: list[str]) -> None:
    """Make the tables."""
    if "--fresh" in arguments and BUILD.exists():
        shutil.rmtree(BUILD)
    numba.set_num_threads(1)
    head = [
        "surface",
        "depth mm",
        "mean % of the pair's signal",
        "rms %",
        "largest pair %",
        "which",
        "pairs of one wall, mean % of the others' signal",
    ]
    tables = []
    for title, places, depths_mm, rays, prefix in (
        ("The 18 benchmark places", places_mm(), DEPTHS_MM, RAYS, ""),
        ("121 places, 2 mm apart", scan_places_mm(), SCAN_DEPTHS_MM, SCAN, "scan-"),
    ):
        rows = [
            cells(row)
            for surface in SURFACES
            for row in measured(surface, places, depths_mm, rays, prefix + surface)
        ]
        tables.append(f"### {title}\n\n{markdown_table(head, rows)}")
    text = "\n\n".join(tables)
    print(text)
    PAGE.write_text(with_table(PAGE.read_text(encoding="utf-8"), text, MARKS), encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
