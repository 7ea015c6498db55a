"""All printed parts of the largest preset from a cold start."""

from __future__ import annotations

import pytest

from tests.bench.measures.build_time import LIMIT_S, build_time


@pytest.mark.slow
def test_all_parts_of_a_design_from_a_cold_start(benchmark, bench_size):
    found = []
    name = bench_size.of("oblong-60x40", "piacenza2017-pair")
    benchmark.pedantic(lambda: found.append(build_time(name)), rounds=2)
    best = min(found, key=lambda one: one.processor_s)
    benchmark.extra_info.update(wall_s=round(best.wall_s, 1), processor_s=round(best.processor_s, 1))
    print(best)
    assert best.files > 0
    # processor time: the clock of a shared machine also counts other people's work
    assert not bench_size.is_timed or best.processor_s <= LIMIT_S
