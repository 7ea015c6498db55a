"""How long a fresh process needs until its first trace, with whatever its compile cache holds."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[3]
FIRST_TRACE = """
from time import perf_counter
start = perf_counter()
import hashlib
import json
import numpy as np
from optopad.design.io import load_design
from tests.sims.optics.surface.analytic import compact_dimple
from optopad.sims.optics.scene.lower import scene_of
from optopad.sims.optics.engine.trace_states import trace_scene
imported = perf_counter()
scene = scene_of(load_design("tests/bench/measures/light-benchmark.toml"))
raw = trace_scene(scene, np.array([[14.0, 17.0]]), [compact_dimple(2.0)])
assert raw.flux.sum() > 0.0
seconds = {"import_seconds": imported - start, "trace_seconds": perf_counter() - imported}
print(json.dumps(seconds | {"flux_sha256": hashlib.sha256(raw.flux.tobytes()).hexdigest()}))
"""


@dataclass(frozen=True, kw_only=True)
class FirstTrace:
    """Wall time of a fresh process: imports, then the first trace (with compiling, where the cache is empty)."""

    import_seconds: float
    trace_seconds: float
    flux_sha256: str
    """Of all bits of the light."""

    @property
    def seconds(self) -> float:
        """Both."""
        return self.import_seconds + self.trace_seconds


def first_trace(cache: Path | None) -> FirstTrace:
    """Trace one state in a fresh process that keeps compiled code in `cache`; None: where this process keeps it."""
    environment = os.environ | ({} if cache is None else {"NUMBA_CACHE_DIR": str(cache)})
    done = subprocess.run(
        [sys.executable, "-c", FIRST_TRACE],
        cwd=ROOT,
        env=environment,
        capture_output=True,
        text=True,
        check=True,
    )
    return FirstTrace(**json.loads(done.stdout.splitlines()[-1]))
