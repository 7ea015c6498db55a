"""A scan of the whole pad, 121 places x 51 depths of 0 to 5 mm: processor time and wall time on two threads."""

from __future__ import annotations

import os
from time import perf_counter, process_time

import numba
import numpy as np
import pytest

from sims.optics.engine import trace_scene
from tests.bench.benchmark_states import SURFACES, benchmark_scene, pad_scan

THREADS = 2


@pytest.mark.slow
@pytest.mark.parametrize("surface", SURFACES)
def test_scan_of_the_pad(benchmark, surface):
    if numba.config.NUMBA_NUM_THREADS < THREADS:
        pytest.skip(f"needs {THREADS} threads, NUMBA_NUM_THREADS is {numba.config.NUMBA_NUM_THREADS}")
    scene, (centres, presses) = benchmark_scene(), pad_scan(surface)
    trace_scene(scene, centres[1:2], presses[1:2])
    before = numba.get_num_threads()
    numba.set_num_threads(THREADS)
    cpu, wall = process_time(), perf_counter()
    raw = benchmark.pedantic(trace_scene, args=(scene, centres, presses), rounds=1)
    cpu, wall = process_time() - cpu, perf_counter() - wall
    numba.set_num_threads(before)
    figures = {
        "core_minutes": round(cpu / 60.0, 2),
        "wall_seconds": round(wall, 1),
        "load": os.getloadavg()[0],
    }
    benchmark.extra_info.update(figures)
    print(surface, figures)
    assert raw.flux.shape[1:] == (len(presses), 8, 8)
    assert np.isfinite(raw.flux).all()
    assert (raw.flux.sum(axis=0)[0] == raw.flux.sum(axis=0)[51]).all()  # both untouched
