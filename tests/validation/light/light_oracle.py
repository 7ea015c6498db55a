"""The light reference against plain forward tracers, which share no code with the engine: is its mean right?

    python -m tests.validation.light.light_oracle

On analytic surfaces the plain walk of tests/bench (4 million rays from every emitter in each of 108 states), on the
contact model's the oracle (100,000 rays): five minutes each on one core; finished places are kept in
`build/validation/`. Writes a table of docs/validation/light.md. Single pairs of a forward tracer are far too noisy
to judge the reference; sums over all states and pairs are not.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numba
import numpy as np

from optopad.design.arrays import FloatArray
from tests.bench.measures.benchmark_states import (
    DEPTHS_MM,
    SURFACES,
    BenchmarkStates,
    benchmark_scene,
    benchmark_states,
    different_walls,
)
from tests.bench.measures.forward_walk import walk
from tests.oracle.tracer import CLASSES, trace_oracle
from tests.validation.contact.contact_table import markdown_table, with_table
from tests.validation.contact.dense_curve import dense_press
from tests.validation.light.light_reference import BUILD, GROUPS, grouped, reference
from tests.validation.light.light_table import PAGE

MARKS = "<!-- made by tests/validation/light/light_oracle.py -->", "<!-- end of the oracle -->"
RAYS = {"analytic": 4_000_000, "contact": 100_000}
SEED = 31


@dataclass(frozen=True, kw_only=True)
class Mean:
    """Mean over states and pairs of reference less tracer, over the mean undeformed signal, and its standard error."""

    surface: str
    group: str
    difference: float
    standard_error: float


def counted_flux(
    surface: str, folder: Path = BUILD, rays: int | None = None, places: int | None = None
) -> FloatArray:
    """(group, state, e, r) flux that the forward tracer of a family of surfaces counted.

    `rays` of an emitter and state (None: `RAYS`), of the first `places` (None: all).
    """
    rays = rays or RAYS[surface]
    states = benchmark_states(surface)
    folder.mkdir(parents=True, exist_ok=True)
    parts = []
    depths = len(DEPTHS_MM)
    for place in range(places or len(states.indentations) // depths):
        file = folder / f"counted-{surface}-{rays}-{place:02d}.npz"
        if not file.exists():
            wanted = states.some(list(range(place * depths, (place + 1) * depths)))
            count = _by_walk if surface == "analytic" else _by_oracle
            np.savez(file, flux=count(wanted, rays, SEED + place))
            print(f"{surface}: place {place + 1}", file=sys.stderr, flush=True)
        with np.load(file, allow_pickle=False) as stored:
            parts.append(stored["flux"])
    return np.concatenate(parts, axis=1)


def _by_walk(states: BenchmarkStates, rays: int, seed: int) -> FloatArray:
    scene = benchmark_scene()
    presses = zip(states.centres_mm, states.indentations, strict=True)
    found = [walk(scene, *press, rays, seed * 1000 + number) for number, press in enumerate(presses)]
    return np.stack([one.groups for one in found if one.groups is not None], axis=1)


def _by_oracle(states: BenchmarkStates, rays: int, seed: int) -> FloatArray:
    presses = [dense_press(press) for press in states.indentations]
    light = trace_oracle(benchmark_scene(), states.centres_mm, presses, rays=rays, seed=seed)
    modelled = [number for number, name in enumerate(CLASSES) if name != "crossing"]
    return grouped(light.flux[modelled], [CLASSES[number] for number in modelled])


def means(
    surface: str, folder: Path = BUILD, rays: int | None = None, places: int | None = None
) -> Iterator[Mean]:
    """Every group and the sum. A ray counts once at most, with a weight of at most 1: binomial variance or less."""
    judged = different_walls(benchmark_scene())
    truth, counted = reference(surface), counted_flux(surface, folder, rays, places)
    flux = truth.flux[:, : counted.shape[1]]
    scale = truth.flat.sum(axis=0)[judged].mean()
    for name, mine, other in [
        *zip(GROUPS, flux, counted, strict=True),
        ("signal", flux.sum(axis=0), counted.sum(axis=0)),
    ]:
        per_emitter = (mine * judged).sum(axis=-1)
        variance = (per_emitter * (1.0 - per_emitter) / (rays or RAYS[surface])).sum()
        count = mine.shape[0] * judged.sum()
        yield Mean(
            surface=surface,
            group=name,
            difference=float((mine - other)[:, judged].sum() / count / scale),
            standard_error=float(np.sqrt(variance) / count / scale),
        )


def cell(mean: Mean) -> str:
    """Reference less tracer and its standard error, in percent of the undeformed signal."""
    return f"{100.0 * mean.difference:+.4f} ± {100.0 * mean.standard_error:.4f}"


def main() -> None:
    """Make the table."""
    numba.set_num_threads(1)
    found = [mean for surface in SURFACES for mean in means(surface)]
    cells = [[surface, *(cell(mean) for mean in found if mean.surface == surface)] for surface in SURFACES]
    table = markdown_table(["surface", *GROUPS, "signal"], cells)
    print(table)
    PAGE.write_text(with_table(PAGE.read_text(encoding="utf-8"), table, MARKS), encoding="utf-8")


if __name__ == "__main__":
    main()
