"""Closest hits of many rays, by the engine's radial table and by the plain walk's formula."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from time import process_time

import numpy as np
from numba import njit

from optopad.design.arrays import FloatArray
from optopad.sims.optics.engine.straight import top_hit
from optopad.sims.optics.surface.radial import wall_hit
from optopad.sims.optics.surface.tops import Top, stack_tops
from optopad.sims.press import Indentation
from tests.bench.measures import forward_walk
from tests.bench.measures.benchmark_states import benchmark_scene


@dataclass(frozen=True, kw_only=True)
class Hits:
    """(n,) distances [mm], and millions of rays a second of processor time, the fastest of the repeats."""

    distance_mm: FloatArray
    millions_per_second: float


@njit(error_model="numpy")
def _engine_hits(lines, box, top, out):
    for k in range(lines.shape[0]):
        x, y, z = lines[k, 0], lines[k, 1], lines[k, 2]
        dx, dy, dz = lines[k, 3], lines[k, 4], lines[k, 5]
        t, _ = wall_hit(x, y, z, dx, dy, dz, box)
        hit = top_hit(x, y, z, dx, dy, dz, t, top)
        out[k] = hit if hit >= 0.0 else t


def engine_hits(press: Indentation, centre_mm: FloatArray, lines: FloatArray, repeats: int = 3) -> Hits:
    """The engine's own intersection; lines (n, 6) are origins [mm] and unit directions."""
    scene = benchmark_scene()
    stack = stack_tops([press], centre_mm[None], scene)
    box = np.array([scene.length_mm, scene.width_mm, scene.height_mm, scene.refractive_index, 0.0, 0.0])
    table = box, Top(*(rows[0] for rows in stack.part(np.array([0]))))
    out = np.empty(len(lines))
    _engine_hits(lines[:10], *table, out)

    def run() -> FloatArray:
        _engine_hits(lines, *table, out)
        return out

    return _timed(run, repeats)


def plain_hits(press: Indentation, centre_mm: FloatArray, lines: FloatArray, repeats: int = 3) -> Hits:
    """The plain walk's intersection with a compact dimple."""
    forward_walk.closest_hits(benchmark_scene(), centre_mm, press, lines[:10])
    return _timed(lambda: forward_walk.closest_hits(benchmark_scene(), centre_mm, press, lines), repeats)


def _timed(run: Callable[[], FloatArray], repeats: int) -> Hits:
    seconds = []
    for _ in range(repeats):
        start = process_time()
        distance = run()
        seconds.append(process_time() - start)
    return Hits(distance_mm=distance, millions_per_second=len(distance) / min(seconds) / 1e6)
