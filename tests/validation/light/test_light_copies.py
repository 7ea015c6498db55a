"""Reduced copies, by the same code, of what `make validate` makes of light beside its table: reference, speeds."""

from __future__ import annotations

import json
import re
from functools import partial
from pathlib import Path

import numba
import numpy as np
import pytest

from optopad.sims.optics.engine.trace_states import ACCURACIES
from tests.bench.measures.benchmark_states import SURFACES, benchmark_scene, different_walls
from tests.bench.measures.closest_hits import engine_hits, plain_hits
from tests.bench.measures.surface_mesh import cosine_rays
from tests.bench.measures.walk_cost import CENTRE_MM, plain_walk
from tests.sims.optics.surface.analytic import compact_dimple
from tests.validation.light import light_speed
from tests.validation.light.light_oracle import RAYS, means
from tests.validation.light.light_reference import reference
from tests.validation.light.light_reference_build import Half, build
from tests.validation.light.light_walk import DRAWS, LOG2_RAYS, compare

HALVES = {
    surface: {
        name: Half(seed=seed, accuracy=ACCURACIES["standard"]) for name, seed in (("one", 11), ("two", 12))
    }
    for surface in SURFACES
}


@pytest.mark.slow
def test_the_plain_walk_and_the_engine_hit_the_same_places() -> None:
    """The engine's table follows the formula within a micrometre; grazing rays stretch that."""
    lines, press = cosine_rays(benchmark_scene(), 20_000), compact_dimple(3.0)
    by_engine, by_plain = (hits(press, CENTRE_MM, lines, 1) for hits in (engine_hits, plain_hits))
    assert (np.abs(by_engine.distance_mm - by_plain.distance_mm) < 5e-3).mean() > 0.999


@pytest.mark.full
def test_a_reference_of_one_place_is_the_stored_one_and_goes_on_where_it_stopped(tmp_path: Path) -> None:
    """At the standard setting. Its mean is off by a few hundredths of a percent of the signal, 0.1 % allows for six
    states in place of 108."""
    steps: list[str] = []
    path, judged = tmp_path / "reference.npz", different_walls(benchmark_scene())
    build(path, tmp_path, steps.append, HALVES, places=1)
    assert len(steps) == 4
    build(path, tmp_path, steps.append, HALVES, places=1)
    assert len(steps) == 4
    for surface in SURFACES:
        made, stored = reference(surface, path), reference(surface)
        assert made.flux.shape == (3, 6, 8, 8)
        signal = stored.flat.sum(axis=0)[judged]
        off = (made.flux - stored.flux[:, :6]).sum(axis=0)[:, judged] / signal
        assert abs(off.mean()) < 1e-3
        assert np.median(np.abs(off)) < 1e-3
    with np.load(path, allow_pickle=False) as made_by:
        assert json.loads(str(made_by["recipe"]))["halves"]["contact"]["two"]["seed"] == 12


@pytest.mark.full
@pytest.mark.parametrize(("surface", "rays"), [("analytic", 100_000), ("contact", 10_000)])
def test_forward_tracers_count_the_reference_s_light(tmp_path: Path, surface: str, rays: int) -> None:
    """Two places, the seeds fixed; the variance is an upper bound, so 3.5 standard errors are one in 2000 or less."""
    assert rays < RAYS[surface]
    found = list(means(surface, tmp_path, rays, places=2))
    assert [mean.group for mean in found] == ["direct", "mirrored", "diffuse", "signal"]
    assert all(0.0 < mean.standard_error < 0.02 for mean in found)
    assert all(abs(mean.difference) < 3.5 * mean.standard_error for mean in found)


@pytest.mark.full
def test_an_even_walk_counts_the_reference_s_light_pair_by_pair(tmp_path: Path) -> None:
    """Six draws, each scramble's points fixed: what is left is the walk's own error, 0.15 % of the signal."""
    replicates, log2_rays = 16, 18
    assert log2_rays < LOG2_RAYS
    found = compare(tmp_path, draws=DRAWS // 4, replicates=replicates, log2_rays=log2_rays)
    assert [one.group for one in found] == ["direct", "mirrored", "both"]
    for one in found:
        assert one.pairs >= 8
        assert 0.0 < one.walk_rms < 3e-3
        assert one.rms < 1.6 * one.walk_rms
        assert abs(one.mean) < 5.0 * one.mean_error  # once in 6000 with fifteen degrees of freedom


@pytest.mark.full
def test_every_speed_can_be_measured() -> None:
    """What the machine does meanwhile is not ours: asserted are the rows, and what no load can turn round."""
    parts = [
        *light_speed.hits(rays=50_000),
        *light_speed.walks({"plain walk, Numba": partial(plain_walk, rays=200_000)}),
        *light_speed.starts(warm_runs=1, is_cold=False),
    ]
    if numba.config.NUMBA_NUM_THREADS >= 2:
        parts += light_speed.scans(along=2, depths=6)
        assert sum("scan of 24 states" in what for what, _ in parts) == 2
    rows = dict(parts)
    rates = [
        float(rows[f"closest hits, {who}"].split()[0]) for who in ("engine, analytic surface", "plain walk")
    ]
    assert min(rates) > 0.1
    ratio = re.search(r": (\d+)x$", rows["to 0.5 % on the worst pair, plain walk, Numba"])
    assert ratio is not None
    assert int(ratio[1]) > 50
    assert float(rows["import and first trace, compile cache warm"].split()[0]) > 0.1
