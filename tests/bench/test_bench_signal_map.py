"""What a frame costs a model of kind "signal-map": at most 5 ms of one core."""

from __future__ import annotations

import time

from tests.sims.learning.made_up_map import made_up_map_model, noisy_signals, random_presses

MOST_MS = 5.0
FRAMES = 200


def test_a_frame_of_the_signal_map(benchmark):
    model = made_up_map_model()
    signals = noisy_signals(random_presses(FRAMES, 1), model.noise, 2)

    def read_all() -> None:
        for row in range(FRAMES):
            model.predict(signals[row : row + 1])

    started = time.process_time()
    benchmark.pedantic(read_all, rounds=1, warmup_rounds=1)
    ms = (time.process_time() - started) / (2 * FRAMES) * 1e3  # the warm-up round is counted along
    benchmark.extra_info["core_ms_a_frame"] = ms
    assert ms < MOST_MS
