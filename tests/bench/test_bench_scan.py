"""A scan of the whole pad: processor time, and wall time on two threads."""

from __future__ import annotations

import os

import numba
import numpy as np
import pytest

from tests.bench.measures.benchmark_states import SURFACES
from tests.bench.measures.scan_cost import THREADS, scan


@pytest.mark.slow
@pytest.mark.parametrize("surface", SURFACES)
def test_scan_of_121_places_and_51_depths(benchmark, bench_size, surface):
    if numba.config.NUMBA_NUM_THREADS < THREADS:
        pytest.skip(f"needs {THREADS} threads, NUMBA_NUM_THREADS is {numba.config.NUMBA_NUM_THREADS}")
    along, depths = bench_size.of((11, 51), (2, 3))
    found = benchmark.pedantic(scan, args=(surface, along, depths), rounds=1)
    figures = {
        "core_minutes": round(found.core_minutes, 2),
        "wall_seconds": round(found.wall_seconds, 1),
        "load": os.getloadavg()[0],
    }
    benchmark.extra_info.update(figures)
    print(surface, figures)
    flux = found.raw.flux.sum(axis=0)
    assert flux.shape == (along**2 * depths, 8, 8)
    assert np.isfinite(flux).all()
    assert (flux[0] == flux[depths]).all()  # depth 0 at the first two places: both untouched
