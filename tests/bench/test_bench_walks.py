"""The engine against plain forward tracing, to 0.5 % on the worst pair of the pad pressed 3 mm (see `walk_cost`)."""

from __future__ import annotations

import numpy as np
import pytest

from tests.bench.measures.benchmark_states import benchmark_scene, different_walls
from tests.bench.measures.forward_walk import Walked, walk
from tests.bench.measures.walk_cost import (
    CENTRE_MM,
    LIMIT,
    WALK_RAYS,
    Duel,
    ToolMissingError,
    duel,
    engine_settings,
    mitsuba_walk,
    plain_walk,
)
from tests.oracle.tracer import trace_oracle
from tests.sims.optics.surface.analytic import compact_dimple

SEGMENTS_PER_SECOND = 8e6
"""Below this the plain walk would be no fair opponent."""


def reported(benchmark, bench_size, walked: Walked) -> Duel:
    settings, limit = bench_size.of(
        (engine_settings, LIMIT), (lambda: engine_settings(("draft",), "standard"), 1.0)
    )
    found = duel(walked, settings(), limit)
    figures = {
        "segments_per_second": round(found.segments_per_second),
        "walk_seconds": round(found.walk_seconds, 1),
        "engine_seconds": round(found.engine.seconds, 4),
        "engine_setting": str(found.engine.setting),
        "ratio": round(found.ratio),
    }
    benchmark.extra_info.update(figures)
    print(figures)
    return found


@pytest.mark.full
@pytest.mark.parametrize("depth_mm", [1.0, 3.0])
def test_the_plain_walk_agrees_with_the_oracle(depth_mm):
    """Two forward tracers: squared differences over their variances follow a chi-square law of 48 pairs."""
    scene, press, rays = benchmark_scene(), compact_dimple(depth_mm), 400_000
    oracle = trace_oracle(scene, CENTRE_MM[None], [press], rays=rays, seed=5).without_crossing[0]
    walked = walk(scene, CENTRE_MM, press, rays, seed=6)
    pooled = 0.5 * (oracle + walked.flux)
    pulls = ((walked.flux - oracle) / np.sqrt(2.0 * pooled / rays))[different_walls(scene)]
    assert (pulls**2).sum() < 97.0  # once in 30,000
    assert abs(pulls.sum()) / np.sqrt(pulls.size) < 4.0


@pytest.mark.full
def test_the_engine_is_a_thousand_times_as_fast_as_the_plain_walk(benchmark, bench_size):
    rays = bench_size.of(WALK_RAYS, 20_000)
    found = reported(benchmark, bench_size, benchmark.pedantic(plain_walk, args=(rays,), rounds=1))
    assert found.segments_per_second > bench_size.of(SEGMENTS_PER_SECOND, 0.0)
    assert found.ratio > bench_size.of(1000.0, 0.0)


@pytest.mark.full
def test_the_engine_is_a_thousand_times_as_fast_as_a_mitsuba_loop(benchmark, bench_size):
    try:
        walked = benchmark.pedantic(mitsuba_walk, rounds=1)
    except ToolMissingError as missing:
        pytest.skip(str(missing))
    found = reported(benchmark, bench_size, walked)
    assert found.ratio > bench_size.of(1000.0, 0.0)
