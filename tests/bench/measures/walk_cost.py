"""Processor time to 0.5 % on the worst pair of the pad pressed 3 mm: plain forward tracers, and the engine.

All on one thread. A walk's time follows from its measured variance a ray and its measured time a ray; each emitter is
traced only as long as its own worst pair needs. The engine's is the time of the cheapest setting whose measured error
(root mean square over seeds, against the finest) is within 0.5 % on every pair. Errors are over the pair's own flux.
"""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import dataclass
from functools import cache
from importlib.util import find_spec

import numpy as np

from optopad.sims.optics.engine.trace_states import ACCURACIES
from tests.bench.measures.benchmark_states import benchmark_scene, different_walls
from tests.bench.measures.engine_cost import Cost, cheapest, costs
from tests.bench.measures.forward_walk import Walked, walk
from tests.sims.optics.surface.analytic import compact_dimple

CENTRE_MM = np.array([14.0, 17.0])
DEPTH_MM = 3.0
LIMIT = 0.005
WALK_RAYS = 4_000_000


@dataclass(frozen=True, kw_only=True)
class Duel:
    """A walk against the engine."""

    segments_per_second: float
    walk_seconds: float
    engine: Cost

    @property
    def ratio(self) -> float:
        """How many times as long the walk takes."""
        return self.walk_seconds / self.engine.seconds


class ToolMissingError(Exception):
    """An optional tool is absent or does not run; the text says which and what to do."""


def plain_walk(rays: int = WALK_RAYS) -> Walked:
    """The plain walk, compiled with Numba."""
    scene, press = benchmark_scene(), compact_dimple(DEPTH_MM)
    walk(scene, CENTRE_MM, press, 1000)
    return walk(scene, CENTRE_MM, press, rays, seed=1)


def mitsuba_walk() -> Walked:
    """The drjit loop, in a process of its own: with an LLVM that it does not like, drjit ends the process."""
    if find_spec("mitsuba") is None:
        raise ToolMissingError("needs the optional package mitsuba: pip install mitsuba")
    command = [sys.executable, "-m", "tests.validation.light.mitsuba_check", "--speed"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise ToolMissingError(
            f"Mitsuba does not run here ({' '.join(done.stderr.split())[-200:]}); set DRJIT_LIBLLVM_PATH to LLVM 19"
        )
    values = json.loads(done.stdout)
    return Walked(**(values | {name: np.array(values[name]) for name in ("flux", "variance")}))


@cache
def engine_settings(names: tuple[str, ...] = tuple(ACCURACIES), finest: str = "fine") -> tuple[Cost, ...]:
    """Settings of the engine, by default every one, on the same state."""
    return tuple(costs(benchmark_scene(), CENTRE_MM, compact_dimple(DEPTH_MM), names, finest))


def duel(walked: Walked, settings: tuple[Cost, ...] | None = None, limit: float = LIMIT) -> Duel:
    """A walk's time against the engine's, both to a relative error of the worst pair."""
    pairs = different_walls(benchmark_scene())
    return Duel(
        segments_per_second=walked.segments / walked.seconds,
        walk_seconds=walked.seconds_for(limit, pairs),
        engine=cheapest(settings or engine_settings(), limit, pairs),
    )
