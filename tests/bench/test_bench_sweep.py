"""What a sweep and a study of builds cost: processor time, and wall time on the threads that there are."""

from __future__ import annotations

import os
import time

import numba
import pytest

from optopad.design.preset import preset
from optopad.design.spec.tolerances import build_tolerances
from optopad.sims.verdict.builds import build_study, facing_judge
from optopad.verbs.sweep import sweep

PAIR = preset("piacenza2017-pair")
SWEEP_LIMIT_S = 30.0
"""Wall time of 13 values on 2 idle cores."""
BUILDS_LIMIT_S = 180.0
"""Wall time of 200 builds on 2 idle cores."""


def _measured(benchmark, work, name):
    work(1)  # kernels are compiled, the contact library is read
    processor = time.process_time()
    started = time.perf_counter()
    found = benchmark.pedantic(work, args=(0,), rounds=1)
    figures = {
        "core_s": round(time.process_time() - processor, 1),
        "wall_s": round(time.perf_counter() - started, 1),
        "threads": numba.config.NUMBA_NUM_THREADS,
        "load": os.getloadavg()[0],
    }
    benchmark.extra_info.update(figures)
    print(name, figures)
    return found, figures


@pytest.mark.slow
def test_a_sweep_of_13_thicknesses_of_the_pair(benchmark, bench_size, tmp_path):
    count = bench_size.of(13, 2)

    def swept(part):
        values = [6.0 + 0.5 * step for step in range(1 if part else count)]
        return sweep(PAIR, "cavity.clear_thickness_mm", values, out=tmp_path)

    made, figures = _measured(benchmark, swept, "sweep")
    assert len(made.rows) == count
    assert (
        not bench_size.is_timed or figures["core_s"] < 2 * SWEEP_LIMIT_S
    )  # two idle cores have this much in the limit


@pytest.mark.slow
def test_200_builds_of_the_pair(benchmark, bench_size):
    count = bench_size.of(200, 10)
    name, judge = facing_judge(seed=0)

    def study(part):
        builds = 10 if part else count
        return build_study(PAIR, build_tolerances(PAIR), name, judge, builds=builds, seed=0)

    found, figures = _measured(benchmark, study, "builds")
    assert found.builds == count
    assert not bench_size.is_timed or figures["core_s"] < 2 * BUILDS_LIMIT_S
