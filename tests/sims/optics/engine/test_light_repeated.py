"""Light mirrored several times: its sampling goes by the dimmest receiver that it may reach."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from optopad.sims.optics.engine.trace_states import ACCURACIES, CLASS_NAMES, trace_scene
from tests.bench.measures.benchmark_states import DEPTHS_MM, benchmark_scene, benchmark_states

MIRRORED = [CLASS_NAMES.index("top"), CLASS_NAMES.index("skirt")]
STATE, EMITTER, RECEIVER = 10 * len(DEPTHS_MM) + DEPTHS_MM.index(2.0), 6, 0
SEEDS = 16


def scatter(repeat_share: float) -> float:
    """Standard deviation over seeds of a dim pair's mirrored light, over its untouched signal."""
    scene, states = benchmark_scene(), benchmark_states("analytic")
    pairs = np.zeros((8, 8), dtype=np.bool_)
    pairs[EMITTER] = True
    settings = replace(ACCURACIES["standard"], repeat_share=repeat_share)
    found = []
    for seed in range(SEEDS):
        raw = trace_scene(
            scene,
            states.centres_mm[[STATE, STATE]],
            [None, states.indentations[STATE]],
            accuracy=settings,
            seed=seed,
            pairs=pairs,
        )
        found.append(raw.flux[MIRRORED, 1, EMITTER, RECEIVER].sum() / raw.flux[:, 0, EMITTER, RECEIVER].sum())
    return float(np.std(found, ddof=1))


@pytest.mark.slow
def test_a_dim_pair_scatters_less_the_less_a_sample_stands_for():
    rough, fine = scatter(1e-2), scatter(5e-4)
    # by the emitter's brightest pair, and one sample for each cell whose light ends together, both were 0.0018
    assert fine < 0.4 * rough
    assert fine < 0.0008
