"""What a frame costs a model of kind "signal-map", touched or not: at most 5 ms of one core."""

from __future__ import annotations

import time

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

from tests.sims.learning.made_up_map import made_up_map_model, noisy_signals, random_presses

MOST_MS = 5.0
FRAMES = 200


@pytest.mark.parametrize("is_touched", [True, False], ids=["touched", "untouched"])
def test_a_frame_of_the_signal_map(benchmark, bench_size, is_touched):
    frames = bench_size.of(FRAMES, 5)
    model = made_up_map_model()
    presses = random_presses(frames, 1) if is_touched else np.tile([16.0, 16.0, -1.0], (frames, 1))
    signals = noisy_signals(presses, model.noise, 2)

    def read_all() -> None:
        for row in range(frames):
            model.predict(signals[row : row + 1])

    # a second thread waits more than it works on matrices so small, and its wait would count
    with threadpool_limits(1):
        started = time.process_time()
        benchmark.pedantic(read_all, rounds=1, warmup_rounds=1)
    ms = (time.process_time() - started) / (2 * frames) * 1e3  # the warm-up round is counted along
    benchmark.extra_info["core_ms_a_frame"] = ms
    assert not bench_size.is_timed or ms < MOST_MS
