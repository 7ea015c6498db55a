"""The light reference against the oracle, which shares no code with the engine: is its mean right?

    python -m tests.validation.light_oracle

sends a million rays from every emitter in each of the 2 x 108 benchmark states (ten minutes on one core; finished
places are kept in `build/validation/`) and writes the second table of docs/validation/light.md. Single pairs of the
oracle are far too noisy to judge the reference; sums over all states and pairs are not.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numba
import numpy as np
from numpy.typing import NDArray

from sims.optics.oracle import CLASSES, trace_oracle
from tests.bench.benchmark_states import (
    DEPTHS_MM,
    SURFACES,
    benchmark_scene,
    benchmark_states,
    different_walls,
)
from tests.validation.contact_table import markdown_table, with_table
from tests.validation.dense_curve import dense_press
from tests.validation.light_reference import BUILD, GROUPS, grouped, reference
from tests.validation.light_table import PAGE

FloatArray = NDArray[np.float64]

MARKS = "<!-- made by tests/validation/light_oracle.py -->", "<!-- end of the oracle -->"
RAYS = 1_000_000
SEED = 31


@dataclass(frozen=True, kw_only=True)
class Mean:
    """Mean over states and pairs of reference less oracle, over the mean undeformed signal, and its standard error."""

    surface: str
    group: str
    difference: float
    standard_error: float


def oracle_flux(surface: str, folder: Path = BUILD, rays: int = RAYS) -> FloatArray:
    """(group, state, e, r) flux that the oracle counted."""
    states, scene = benchmark_states(surface), benchmark_scene()
    folder.mkdir(parents=True, exist_ok=True)
    parts = []
    depths = len(DEPTHS_MM)
    for place in range(len(states.indentations) // depths):
        file = folder / f"oracle-{surface}-{rays}-{place:02d}.npz"
        if not file.exists():
            wanted = range(place * depths, (place + 1) * depths)
            presses = [dense_press(states.indentations[k]) for k in wanted]
            light = trace_oracle(scene, states.centres_mm[wanted], presses, rays=rays, seed=SEED + place)
            inside = [number for number, name in enumerate(CLASSES) if name != "crossing"]  # not modelled
            np.savez(file, flux=grouped(light.flux[inside], [CLASSES[number] for number in inside]))
            print(f"{surface}: place {place + 1}", file=sys.stderr, flush=True)
        with np.load(file, allow_pickle=False) as stored:
            parts.append(stored["flux"])
    return np.concatenate(parts, axis=1)


def means(surface: str, rays: int = RAYS) -> Iterator[Mean]:
    """Every group and the sum. A ray counts once or not at all, so a count has the variance of a binomial one."""
    judged = different_walls(benchmark_scene())
    truth, counted = reference(surface), oracle_flux(surface, rays=rays)
    scale = truth.flat.sum(axis=0)[judged].mean()
    for name, mine, other in [
        *zip(GROUPS, truth.flux, counted, strict=True),
        ("signal", truth.flux.sum(axis=0), counted.sum(axis=0)),
    ]:
        per_emitter = (mine * judged).sum(axis=-1)
        variance = (per_emitter * (1.0 - per_emitter) / rays).sum()
        count = mine.shape[0] * judged.sum()
        yield Mean(
            surface=surface,
            group=name,
            difference=float((mine - other)[:, judged].sum() / count / scale),
            standard_error=float(np.sqrt(variance) / count / scale),
        )


def main() -> None:
    """Make the table."""
    numba.set_num_threads(1)
    found = [mean for surface in SURFACES for mean in means(surface)]
    cells = [
        [
            mean.surface,
            mean.group,
            f"{100.0 * mean.difference:+.4f} ± {100.0 * mean.standard_error:.4f}",
            f"{mean.difference / mean.standard_error:+.1f}",
        ]
        for mean in found
    ]
    head = ["surface", "class", "reference - oracle, % of the undeformed signal", "in standard errors"]
    table = markdown_table(head, cells)
    print(table)
    PAGE.write_text(with_table(PAGE.read_text(encoding="utf-8"), table, MARKS), encoding="utf-8")


if __name__ == "__main__":
    main()
