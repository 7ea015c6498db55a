"""How long a fresh process needs until its first trace: with a warm compile cache, and with none."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
FIRST_TRACE = """
from time import perf_counter
start = perf_counter()
import json
import numpy as np
from design.io import load_design
from sims.optics.analytic import compact_dimple
from sims.optics.lower import scene_of
from sims.optics.engine import trace_scene
imported = perf_counter()
scene = scene_of(load_design("tests/bench/light-benchmark.toml"))
raw = trace_scene(scene, np.array([[14.0, 17.0]]), [compact_dimple(2.0)])
traced = perf_counter()
again = trace_scene(scene, np.array([[15.0, 17.0]]), [compact_dimple(2.1)])
assert raw.flux.sum() > 0.0
print(json.dumps({"import": imported - start, "first": traced - imported, "second": perf_counter() - traced}))
"""


def first_trace(cache: Path) -> dict[str, float]:
    """Seconds of import, first and second trace in a fresh process that compiles into `cache`."""
    environment = os.environ | {"NUMBA_CACHE_DIR": str(cache)}
    done = subprocess.run(
        [sys.executable, "-c", FIRST_TRACE],
        cwd=ROOT,
        env=environment,
        capture_output=True,
        text=True,
        check=True,
    )
    return json.loads(done.stdout)


@pytest.mark.slow
def test_first_trace_with_and_without_a_compile_cache(benchmark, tmp_path):
    cold = first_trace(tmp_path)
    warm = benchmark.pedantic(first_trace, args=(tmp_path,), rounds=3)
    figures = {
        "cold_seconds": round(cold["import"] + cold["first"], 1),
        "compile_seconds": round(cold["first"] - warm["first"], 1),
        "warm_seconds": round(warm["import"] + warm["first"], 2),
        "warm_import_seconds": round(warm["import"], 2),
    }
    benchmark.extra_info.update(figures)
    print(figures)
    assert warm["first"] < 0.5 * cold["first"]
