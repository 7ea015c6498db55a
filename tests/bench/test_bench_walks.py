"""The engine against plain forward tracing: processor time to 0.5 % on the worst pair of the pad pressed 3 mm.

Both sides run on one thread in one run. A walk's time follows from its measured variance a ray and its measured time a
ray; each emitter is traced only as long as its own worst pair needs. The engine's is the time of the cheapest setting
whose measured error (root mean square over seeds, against the finest) is within 0.5 % on every pair.
"""

from __future__ import annotations

import json
import subprocess
import sys
from functools import cache
from importlib.util import find_spec

import numpy as np
import pytest

from sims.optics.analytic import compact_dimple
from sims.optics.engine import ACCURACIES
from sims.optics.oracle import trace_oracle
from tests.bench.benchmark_states import benchmark_scene, different_walls
from tests.bench.engine_cost import Cost, cheapest, costs
from tests.bench.forward_walk import Walked, walk

CENTRE_MM = np.array([14.0, 17.0])
DEPTH_MM = 3.0
LIMIT = 0.005
WALK_RAYS = 4_000_000
SEGMENTS_PER_SECOND = 8e6
"""Below this the plain walk would be no fair opponent."""


def plain_walk(rays: int = WALK_RAYS) -> Walked:
    scene, press = benchmark_scene(), compact_dimple(DEPTH_MM)
    walk(scene, CENTRE_MM, press, 1000)
    return walk(scene, CENTRE_MM, press, rays, seed=1)


@cache
def engine() -> Cost:
    scene, press = benchmark_scene(), compact_dimple(DEPTH_MM)
    found = costs(scene, CENTRE_MM, press, list(ACCURACIES), "fine")
    for cost in found:
        print(f"{cost.setting}: {cost.seconds:.4f} s, worst pair {cost.worst(different_walls(scene)):.2%}")
    return cheapest(found, LIMIT, different_walls(scene))


def seconds_for(walked: Walked) -> float:
    return walked.seconds_for(LIMIT, different_walls(benchmark_scene()))


def report(benchmark, name: str, walked: Walked) -> float:
    rate, needed = walked.segments / walked.seconds, seconds_for(walked)
    ratio = needed / engine().seconds
    figures = {
        "segments_per_second": rate,
        "seconds_to_half_a_percent": needed,
        "engine_seconds": engine().seconds,
        "engine_setting": str(engine().setting),
        "ratio": ratio,
    }
    benchmark.extra_info.update(figures)
    print(name, json.dumps(figures))
    return ratio


@pytest.mark.parametrize("depth_mm", [1.0, 3.0])
def test_the_plain_walk_agrees_with_the_oracle(depth_mm):
    """Two forward tracers: differences in combined standard errors are a chi-square of 64 pairs."""
    scene, press, rays = benchmark_scene(), compact_dimple(depth_mm), 400_000
    oracle = trace_oracle(scene, CENTRE_MM[None], [press], rays=rays, seed=5).total[0]
    walked = walk(scene, CENTRE_MM, press, rays, seed=6)
    pooled = 0.5 * (oracle + walked.flux)
    pulls = (walked.flux - oracle) / np.sqrt(2.0 * pooled / rays)
    judged = different_walls(scene)
    assert (pulls[judged] ** 2).sum() < 97.0  # 48 degrees of freedom: beyond it once in 30,000
    assert abs(pulls[judged].sum()) / np.sqrt(judged.sum()) < 4.0


@pytest.mark.slow
def test_the_engine_is_a_thousand_times_faster_than_the_plain_walk(benchmark):
    walked = benchmark.pedantic(plain_walk, rounds=1)
    assert walked.segments / walked.seconds > SEGMENTS_PER_SECOND
    assert report(benchmark, "plain walk", walked) > 1000.0


@pytest.mark.slow
def test_the_engine_is_a_thousand_times_faster_than_a_mitsuba_loop(benchmark):
    if find_spec("mitsuba") is None:
        pytest.skip("needs the optional package mitsuba: pip install mitsuba (docs/validation/mitsuba.md)")
    walked = benchmark.pedantic(mitsuba_walk, rounds=1)
    assert report(benchmark, "Mitsuba", walked) > 1000.0


def mitsuba_walk() -> Walked:
    """In a process of its own: with an LLVM that it does not like, drjit ends the process."""
    command = [sys.executable, "-m", "tests.validation.mitsuba_check", "--speed"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        pytest.skip(f"Mitsuba does not run here ({done.stderr.strip()[-200:]}); set DRJIT_LIBLLVM_PATH")
    values = json.loads(done.stdout)
    return Walked(**(values | {name: np.array(values[name]) for name in ("flux", "variance")}))
