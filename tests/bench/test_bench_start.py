"""A fresh process until its first trace: with a warm compile cache, and with none."""

from __future__ import annotations

import pytest

from tests.bench.measures.start_time import first_trace


@pytest.mark.slow
def test_first_trace_with_and_without_a_compile_cache(benchmark, bench_size, tmp_path):
    cache = bench_size.of(tmp_path, None)  # small: the cache that there is
    cold = first_trace(cache)
    warm = benchmark.pedantic(first_trace, args=(cache,), rounds=3)
    figures = {"cold_seconds": round(cold.seconds, 1), "warm_seconds": round(warm.seconds, 2)}
    benchmark.extra_info.update(figures)
    print(figures)
    assert warm.flux_sha256 == cold.flux_sha256
    assert not bench_size.is_timed or warm.trace_seconds < 0.5 * cold.trace_seconds
