"""What a scan of the whole pad costs: 121 places x 51 depths of 0 to 5 mm."""

from __future__ import annotations

from dataclasses import dataclass
from time import perf_counter, process_time

import numba

from optopad.sims.optics.engine.trace_states import RawLight, trace_scene
from tests.bench.measures.benchmark_states import benchmark_scene, pad_scan

THREADS = 2


@dataclass(frozen=True, kw_only=True)
class Scan:
    """The light of all states, and what they took."""

    raw: RawLight
    states: int
    core_minutes: float
    wall_seconds: float


def scan(surface: str, along: int = 11, depths: int = 51) -> Scan:
    """Trace the scan on two threads, after one state outside the clock."""
    if numba.config.NUMBA_NUM_THREADS < THREADS:
        raise ValueError(
            f"a scan needs {THREADS} threads, NUMBA_NUM_THREADS is {numba.config.NUMBA_NUM_THREADS}"
        )
    scene, (centres, presses) = benchmark_scene(), pad_scan(surface, along, depths)
    trace_scene(scene, centres[1:2], presses[1:2])
    threads = numba.get_num_threads()
    numba.set_num_threads(THREADS)
    cpu, wall = process_time(), perf_counter()
    raw = trace_scene(scene, centres, presses)
    cpu, wall = process_time() - cpu, perf_counter() - wall
    numba.set_num_threads(threads)
    return Scan(raw=raw, states=len(presses), core_minutes=cpu / 60.0, wall_seconds=wall)
