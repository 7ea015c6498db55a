"""The light reference against an even forward walk, pair by pair: straight and mirrored light on analytic surfaces.

    python -m tests.validation.light.light_walk

The plain walk of tests/bench shares no code with the engine. Sent by scrambled Sobol points instead of chance, and
between dark walls, it errs some ten times less: little enough to judge single pairs, which `light_oracle` cannot.
States and emitters are drawn once; judged is what the press changes, by a hundredth of the signal or more, at
receivers on other walls. The same rays are sent into the flat pad too, whose straight and mirrored light is known from
quadrature: a control variate, taken by the share of that light which is left. Each scramble is a replicate, so the
standard errors are the walk's own. Some minutes on one core; finished draws are kept in `build/validation/`.
Writes a table of docs/validation/light.md.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.stats import qmc

from optopad.design.arrays import FloatArray
from tests.bench.measures.benchmark_states import benchmark_scene, benchmark_states, different_walls
from tests.bench.measures.forward_walk import even_walk
from tests.validation.contact.contact_table import markdown_table, with_table
from tests.validation.light.light_reference import BUILD, GROUPS, reference
from tests.validation.light.light_table import PAGE

MARKS = "<!-- made by tests/validation/light/light_walk.py -->", "<!-- end of the even walk -->"
DRAWS, DRAW_SEED = 24, 17
REPLICATES, LOG2_RAYS = 16, 22
LEAST_CHANGE = 0.01


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """One group of light over all judged pairs; differences are reference less walk, over the undeformed signal.

    Attributes
    ----------
    pairs : how many
    mean, mean_error : mean difference and its standard error
    rms, walk_rms : root mean square of the differences, and of the walk's standard errors: equal if only the walk errs
    within_two : share of the pairs within two of the walk's standard errors; 0.93 or 0.94 if only the walk errs
    """

    group: str
    pairs: int
    mean: float
    mean_error: float
    rms: float
    walk_rms: float
    within_two: float


def drawn(draws: int = DRAWS) -> list[tuple[int, int]]:
    """States and emitters, drawn once; fewer are the first of them."""
    scene, states = benchmark_scene(), benchmark_states("analytic")
    size = len(states.indentations), len(scene.emitter_wall)
    every = np.random.default_rng(DRAW_SEED).permutation(size[0] * size[1])[:draws]
    return [(int(number // size[1]), int(number % size[1])) for number in every]


def walked(
    state: int | None,
    emitter: int,
    folder: Path = BUILD,
    replicates: int = REPLICATES,
    log2_rays: int = LOG2_RAYS,
) -> FloatArray:
    """(replicate, straight or mirrored, r) flux that the even walk counts in a state or (None) in the flat pad [-].

    A replicate of an emitter has the same rays in every state.
    """
    file = folder / f"even-{replicates}-{log2_rays}-{'flat' if state is None else state}-{emitter}.npz"
    if not file.exists():
        states = benchmark_states("analytic")
        press = (
            (states.centres_mm[0], None)
            if state is None
            else (states.centres_mm[state], states.indentations[state])
        )
        sobol = [
            qmc.Sobol(4, scramble=True, rng=np.random.default_rng([emitter, number]))
            for number in range(replicates)
        ]
        flux = [even_walk(benchmark_scene(), *press, emitter, one.random_base2(log2_rays)) for one in sobol]
        folder.mkdir(parents=True, exist_ok=True)
        np.savez(file, flux=np.stack(flux))
    with np.load(file, allow_pickle=False) as stored:
        return np.asarray(stored["flux"])


def compare(
    folder: Path = BUILD,
    draws: int = DRAWS,
    replicates: int = REPLICATES,
    log2_rays: int = LOG2_RAYS,
    on_step: Callable[[str], None] = lambda text: None,
) -> list[Comparison]:
    """Straight light, mirrored light, and both."""
    truth, judged = reference("analytic"), different_walls(benchmark_scene())
    signal = truth.flat.sum(axis=0)
    changes = np.abs(truth.flux - truth.flat[:, None])[:2].sum(axis=0)
    parts = []
    for number, (state, emitter) in enumerate(drawn(draws)):
        changed = changes[state, emitter] > LEAST_CHANGE * signal[emitter]
        receivers = np.flatnonzero(judged[emitter] & changed)
        counted, flat = (walked(one, emitter, folder, replicates, log2_rays) for one in (state, None))
        known = truth.flat[:2, emitter]
        left = np.divide(truth.flux[:2, state, emitter], known, out=np.zeros_like(known), where=known > 0.0)
        difference = truth.flux[:2, state, emitter] - (counted - np.minimum(left, 1.0) * (flat - known))
        parts.append((difference / signal[emitter])[:, :, receivers])
        on_step(f"{number + 1} of {draws} draws")
    straight, mirrored = np.moveaxis(np.concatenate(parts, axis=-1), 1, 0)
    named = {GROUPS[0]: straight, GROUPS[1]: mirrored, "both": straight + mirrored}
    return [_comparison(name, differences) for name, differences in named.items()]


def _comparison(group: str, differences: FloatArray) -> Comparison:
    """Figures of (replicate, pair) differences; pairs of one emitter share its rays, replicates share nothing."""
    replicates, pairs = differences.shape
    found = differences.mean(axis=0)
    error = differences.std(axis=0, ddof=1) / np.sqrt(replicates)
    return Comparison(
        group=group,
        pairs=pairs,
        mean=float(found.mean()),
        mean_error=float(differences.mean(axis=1).std(ddof=1) / np.sqrt(replicates)),
        rms=float(np.sqrt((found**2).mean())),
        walk_rms=float(np.sqrt((error**2).mean())),
        within_two=float((np.abs(found) <= 2.0 * error).mean()),
    )


def main() -> None:
    """Make the table."""
    found = compare(on_step=lambda text: print(text, file=sys.stderr, flush=True))
    cells = [
        [
            one.group,
            str(one.pairs),
            f"{100.0 * one.mean:+.4f} ± {100.0 * one.mean_error:.4f}",
            f"{100.0 * one.rms:.4f}",
            f"{100.0 * one.walk_rms:.4f}",
            f"{one.within_two:.2f}",
        ]
        for one in found
    ]
    head = [
        "class",
        "pairs",
        "mean of reference - walk, % of the undeformed signal",
        "rms",
        "rms of the walk's own standard errors",
        "pairs within two of these",
    ]
    table = markdown_table(head, cells)
    print(table)
    PAGE.write_text(with_table(PAGE.read_text(encoding="utf-8"), table, MARKS), encoding="utf-8")


if __name__ == "__main__":
    main()
