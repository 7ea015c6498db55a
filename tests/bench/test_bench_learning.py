"""Answering a frame by each learner's model, one frame at a time, numpy alone; and the search and fit of kernel ridge.

Asked for: kernel ridge of 10,000 samples in 2 ms a frame. The times are printed by pytest-benchmark.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from optopad.sims.learning.inference.kernel_ridge import KernelRidgeModel
from optopad.sims.learning.learners import DEFAULT, LEARNERS, QUICK, fit_kernel_ridge
from tests.sims.learning.pressed_pad import grid_mm, made_up_data, random_places_mm

KEPT_SAMPLES = 10_000
LIMIT_S = 2e-3


@pytest.fixture(scope="module")
def pressed(bench_size):
    return made_up_data(grid_mm(bench_size.of(11, 5)), sets=4)


@pytest.fixture(scope="module")
def frames():
    return made_up_data(random_places_mm(20), role="test").features().astype(float)


def with_samples(model: KernelRidgeModel, count: int) -> KernelRidgeModel:
    """The same model with its samples repeated to a number: the time depends on nothing else."""
    rows = np.arange(count) % len(model.samples)
    return replace(model, samples=model.samples[rows], weights=model.weights[rows])


def test_a_frame_by_kernel_ridge_of_10_000_samples(benchmark, bench_size, pressed, frames):
    small = fit_kernel_ridge(
        pressed, settings=replace(QUICK, search_samples=500, fit_samples=bench_size.of(1_000, 200))
    )
    model, rows = with_samples(small, KEPT_SAMPLES), iter(np.tile(frames, (2_000, 1)))
    told = benchmark.pedantic(lambda: model.predict(next(rows)[None]), rounds=300, warmup_rounds=20)
    assert told.press_mm.shape == (1, 3)
    assert not bench_size.is_timed or benchmark.stats["median"] < LIMIT_S


def test_a_frame_by_the_trees(benchmark, bench_size, pressed, frames):
    settings = replace(bench_size.of(DEFAULT, QUICK), tree_samples=bench_size.of(5_000, 500))
    model, rows = LEARNERS["extra-trees"](pressed, settings=settings), iter(np.tile(frames, (2_000, 1)))
    told = benchmark.pedantic(lambda: model.predict(next(rows)[None]), rounds=300, warmup_rounds=20)
    assert np.isfinite(told.sigma_mm).all()


@pytest.mark.slow
def test_search_and_fit_of_10_000_samples(benchmark, bench_size):
    denser = made_up_data(
        grid_mm(bench_size.of(11, 5)),
        sets=4,
        depths_mm=np.concatenate([[-3.0, -2.0, -1.0], np.arange(0.0, 5.0, 0.2)]),
    )
    settings = bench_size.of(DEFAULT, replace(QUICK, search_samples=200, fit_samples=500))
    model = benchmark.pedantic(fit_kernel_ridge, args=(denser,), kwargs={"settings": settings}, rounds=1)
    assert model.header.settings["fit_samples"] == bench_size.of(KEPT_SAMPLES, 500)
