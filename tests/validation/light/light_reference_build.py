"""The command that makes the reference of docs/validation/light.md.

    python -m tests.validation.light.light_reference_build

traces the benchmark twice (`HALVES`), as finely as the engine offers and finer. Finished places
are kept in `build/validation/`, so that an interrupted run continues; twenty minutes on one core.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from hashlib import sha256
from pathlib import Path
from time import perf_counter

import numba
import numpy as np
from numpy.typing import NDArray

from optopad.design.arrays import FloatArray
from optopad.sims.optics.engine.trace_states import ACCURACIES, Accuracy, trace_scene
from tests.bench.measures.benchmark_states import DEPTHS_MM, benchmark_scene, benchmark_states
from tests.validation.light.light_reference import BUILD, STORED, grouped

RECIPES = {"analytic": 5, "contact": 6}
"""Version of the surfaces, the physics and the method behind states kept in the build folder. Raise it when results
change. That of version 1, of the engine before this one, summed mirrored light partly over cells of the top; its pairs
were off by 0.04 % rms (`light_walk`), which neither half could show. That of version 4 had a contact 2 % too large at
5 mm of the contact model's surfaces; that of version 5, the surface of a round pad with its wall at 16/3 tip radii."""


@dataclass(frozen=True, kw_only=True)
class Half:
    """One of two independent runs."""

    seed: int
    accuracy: Accuracy


FINE = ACCURACIES["reference"]
ANALYTIC = {
    "one": Half(seed=1001, accuracy=FINE),
    "two": Half(
        seed=2002,
        accuracy=replace(
            FINE, rings=52, columns=160, image_step=0.02, whole_ratio=3.0, top_rings=96, top_columns=240
        ),
    ),
}
CONTACT = ANALYTIC
HALVES: Mapping[str, Mapping[str, Half]] = {"analytic": ANALYTIC, "contact": CONTACT}


def recipe(runs: Mapping[str, Mapping[str, Half]] = HALVES) -> str:
    """What the stored fluxes depend on, as text."""
    halves = {surface: {name: asdict(half) for name, half in both.items()} for surface, both in runs.items()}
    return json.dumps({"versions": RECIPES, "halves": halves})


def build(
    path: Path = STORED,
    folder: Path = BUILD,
    on_step: Callable[[str], None] = print,
    halves: Mapping[str, Mapping[str, Half]] = HALVES,
    places: int | None = None,
) -> None:
    """Trace what is not in the folder yet, of the first `places` (None: all), and store everything."""
    threads = numba.get_num_threads()
    numba.set_num_threads(1)
    stored: dict[str, NDArray[np.generic]] = {"recipe": np.array(recipe(halves))}
    for surface, both in halves.items():
        runs = [_half(surface, name, half, folder, on_step, places) for name, half in both.items()]
        stored[f"{surface}_halves"] = np.stack([flux for flux, _, _ in runs]).astype(np.float32)
        stored[f"{surface}_flat"] = np.mean([flat for _, flat, _ in runs], axis=0).astype(np.float32)
        stored[f"{surface}_seconds"] = np.array([seconds for _, _, seconds in runs])
    path.parent.mkdir(exist_ok=True)
    np.savez_compressed(path, **stored)
    numba.set_num_threads(threads)


def _half(
    surface: str, name: str, half: Half, folder: Path, on_step: Callable[[str], None], places: int | None
) -> tuple[FloatArray, FloatArray, float]:
    """(group, state, e, r) flux of one run, (group, e, r) of the untouched pad, seconds a state."""
    states = benchmark_states(surface)
    key = sha256(f"{RECIPES[surface]} {half}".encode()).hexdigest()[:12]
    folder.mkdir(parents=True, exist_ok=True)
    parts: list[FloatArray] = []
    seconds: list[float] = []
    depths = len(DEPTHS_MM)
    for place in range(places or len(states.indentations) // depths):
        file = folder / f"{surface}-{name}-{key}-{place:02d}.npz"
        if not file.exists():
            wanted = range(place * depths, (place + 1) * depths)
            start = perf_counter()
            flux = _traced(half, states.centres_mm[wanted], [states.indentations[k] for k in wanted])
            took = (perf_counter() - start) / depths
            np.savez(file, flux=flux, seconds=took)
            on_step(f"{surface} {name}: place {place + 1}, {took:.1f} s a state")
        with np.load(file, allow_pickle=False) as kept:
            parts.append(kept["flux"])
            seconds.append(float(kept["seconds"]))
    flat = _traced(half, states.centres_mm[:1], [None])[:, 0]
    return np.concatenate(parts, axis=1), flat, float(np.median(seconds))


def _traced(half: Half, centres_mm: FloatArray, presses: list) -> FloatArray:
    raw = trace_scene(benchmark_scene(), centres_mm, presses, accuracy=half.accuracy, seed=half.seed)
    return grouped(raw.flux)


if __name__ == "__main__":
    build(on_step=lambda text: print(text, file=sys.stderr, flush=True))
