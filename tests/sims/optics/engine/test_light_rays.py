"""Rays over the top that tell scattered light: divided cells beside a part, faint rays left to chance."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from optopad.design.draft import Draft
from optopad.design.preset import preset
from optopad.sims.optics.engine.trace_states import ACCURACIES, CLASS_NAMES, trace_scene
from optopad.sims.optics.tracing import trace
from tests.bench.measures.benchmark_states import (
    DEPTHS_MM,
    benchmark_scene,
    benchmark_states,
    different_walls,
)

DIFFUSE = CLASS_NAMES.index("diffuse")
STATE = 4 * len(DEPTHS_MM) + 3
SEEDS = 12


def scattered(ray_share: float) -> np.ndarray:
    """(seed, emitter, receiver) scattered light of a press."""
    scene, states = benchmark_scene(), benchmark_states("analytic").some([STATE])
    settings = replace(ACCURACIES["score"], ray_share=ray_share)
    return np.array(
        [
            trace_scene(scene, states.centres_mm, states.indentations, accuracy=settings, seed=seed).flux[
                DIFFUSE, 0
            ]
            for seed in range(SEEDS)
        ]
    )


def test_rays_left_to_chance_leave_the_mean_as_it_is():
    followed, by_chance = scattered(0.0), scattered(2.0)
    judged = different_walls(benchmark_scene())
    off = (by_chance.mean(axis=0) - followed.mean(axis=0))[judged]
    error = np.sqrt((by_chance.var(axis=0, ddof=1) + followed.var(axis=0, ddof=1))[judged] / SEEDS)
    # chance is at work, and the differences are of the size that their scatter over the seeds tells
    assert by_chance[:, judged].std(axis=0).mean() > 1.2 * followed[:, judged].std(axis=0).mean()
    assert 0.5 < np.sqrt(np.mean((off / error) ** 2)) < 1.6
    assert abs(off.sum()) < 0.01 * followed.mean(axis=0)[judged].sum()


@pytest.mark.slow
def test_parts_near_the_top_get_no_spikes_of_scattered_light():
    design = preset("piacenza2017-pad")
    presses = np.array([[19.92, 11.85, 0.0], [19.92, 11.85, 4.9]])
    exact = trace(Draft.of(design), presses, accuracy="fine", seed=901)
    for seed in (5, 105, 205):
        rough = trace(Draft.of(design), presses, accuracy="score", seed=seed)
        off = rough.by_class["diffuse"][1] - exact.by_class["diffuse"][1]
        # with undivided cells 4 % of a pair's signal at the second of these seeds
        assert np.abs(off / exact.flux[0])[exact.flux[0] > 0.1 * exact.flux[0].max()].max() < 0.005
