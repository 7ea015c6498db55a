"""Errors of the light engine against the stored reference: one run of a setting, and the figures made from it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from time import perf_counter, process_time

import numba
import numpy as np

import optopad.sims.optics
from optopad.design.arrays import FloatArray
from optopad.sims.optics.engine.trace_states import Accuracy, trace_scene
from tests.bench.measures.benchmark_states import benchmark_scene, benchmark_states, different_walls
from tests.bench.measures.closest_hits import engine_hits, plain_hits
from tests.bench.measures.surface_mesh import cosine_rays
from tests.sims.optics.surface.analytic import compact_dimple
from tests.validation.light.light_reference import BUILD, GROUPS, Reference, grouped, reference

Setting = str | float | Accuracy

SEED = 5
RATE_RAYS = 300_000
RATE_CENTRE_MM = np.array([14.0, 17.0])
RATE_DEPTH_MM = 3.0
ELSEWHERE_MM = np.array([[15.3, 17.9]])
"""A press outside the benchmark is traced first, so that nothing is compiled or found anew while the clock runs."""


@dataclass(frozen=True, kw_only=True)
class Run:
    """All wanted states of a family of surfaces, traced once on one thread.

    Attributes
    ----------
    flux : (group, state, e, r) [-]
    standard_error : (state, e, r) as claimed [-]
    core_seconds, wall_seconds : of a state [s]
    hits_per_second : closest hits of the engine's kernel in the same run, and of the plain walk's
    """

    flux: FloatArray
    standard_error: FloatArray
    core_seconds: float
    wall_seconds: float
    hits_per_second: tuple[float, float]


@dataclass(frozen=True, kw_only=True)
class Errors:
    """Errors over the undeformed signal, all states and pairs between different walls, as fractions."""

    rms: float
    median: float
    p95: float
    p99: float
    worst: float
    bias: float


@dataclass(frozen=True, kw_only=True)
class Claims:
    """How claimed standard errors compare with errors: ratio of their root mean squares, shares within 1, 2, 3."""

    error_over_claim: float
    within_one: float
    within_two: float
    within_three: float


def measured(surface: str, setting: Setting, wanted: Sequence[int] | None = None) -> Run:
    """Trace the benchmark (or the wanted states of it) at one setting."""
    scene, states = benchmark_scene(), benchmark_states(surface)
    if wanted is not None:
        states = states.some(list(wanted))
    threads = numba.get_num_threads()
    numba.set_num_threads(1)
    trace_scene(scene, ELSEWHERE_MM, [states.indentations[0]], accuracy=setting, seed=SEED)
    cpu, wall = process_time(), perf_counter()
    raw = trace_scene(scene, states.centres_mm, states.indentations, accuracy=setting, seed=SEED)
    cpu, wall = process_time() - cpu, perf_counter() - wall
    lines = cosine_rays(scene, RATE_RAYS)
    rates = [
        hits(compact_dimple(RATE_DEPTH_MM), RATE_CENTRE_MM, lines).millions_per_second * 1e6
        for hits in (engine_hits, plain_hits)
    ]
    numba.set_num_threads(threads)
    count = len(states.indentations)
    return Run(
        flux=grouped(raw.flux),
        standard_error=raw.standard_error,
        core_seconds=cpu / count,
        wall_seconds=wall / count,
        hits_per_second=(rates[0], rates[1]),
    )


def kept(surface: str, setting: Setting, folder: Path = BUILD) -> Run:
    """A run of all states, from the build folder if this engine made it there before, of these surfaces."""
    made_of = f"{setting} {SEED} {engine_fingerprint()} {surfaces_fingerprint(surface)}"
    key = sha256(made_of.encode()).hexdigest()[:12]
    file = folder / f"run-{surface}-{key}.npz"
    if not file.exists():
        run = measured(surface, setting)
        folder.mkdir(parents=True, exist_ok=True)
        times = np.array([run.core_seconds, run.wall_seconds, *run.hits_per_second])
        np.savez(file, flux=run.flux, standard_error=run.standard_error, times=times)
    with np.load(file, allow_pickle=False) as stored:
        core, wall, *rates = (float(value) for value in stored["times"])
        return Run(
            flux=stored["flux"],
            standard_error=stored["standard_error"],
            core_seconds=core,
            wall_seconds=wall,
            hits_per_second=(rates[0], rates[1]),
        )


def engine_fingerprint() -> str:
    """Hash of every source of the light model."""
    digest = sha256()
    for path in sorted(Path(optopad.sims.optics.__path__[0]).glob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()


def surfaces_fingerprint(surface: str) -> str:
    """Hash of the curves of a family's states."""
    digest = sha256()
    for press in benchmark_states(surface).indentations:
        digest.update(np.stack([press.radius_mm, press.height_mm]).tobytes())
    return digest.hexdigest()


def untouched(surface: str) -> FloatArray:
    """(e, r) undeformed signal of the reference [-]."""
    return np.asarray(reference(surface).flat.sum(axis=0))


def relative_errors(
    run: Run, surface: str, wanted: Sequence[int] | None = None, group: str | None = None
) -> FloatArray:
    """(state, pair) error of the signal, or of one group of it, over the undeformed signal."""
    truth = reference(surface).flux
    if wanted is not None:
        truth = truth[:, list(wanted)]
    difference = run.flux - truth
    difference = difference.sum(axis=0) if group is None else difference[GROUPS.index(group)]
    judged = different_walls(benchmark_scene())
    return np.asarray((difference / untouched(surface))[:, judged])


def errors_of(relative: FloatArray) -> Errors:
    """Figures of a set of errors."""
    size = np.abs(relative)
    return Errors(
        rms=float(np.sqrt(np.mean(relative**2))),
        median=float(np.median(size)),
        p95=float(np.quantile(size, 0.95)),
        p99=float(np.quantile(size, 0.99)),
        worst=float(size.max()),
        bias=float(relative.mean()),
    )


def reference_errors(surface: str) -> Errors:
    """Figures of the reference itself: half the difference of its two runs."""
    found: Reference = reference(surface)
    judged = different_walls(benchmark_scene())
    return errors_of((found.error.sum(axis=0) / untouched(surface))[:, judged])


def claims_of(run: Run, surface: str, wanted: Sequence[int] | None = None) -> Claims:
    """Claimed standard errors against errors, pairs between different walls with a claim above zero."""
    judged = different_walls(benchmark_scene())
    claim = (run.standard_error / untouched(surface))[:, judged]
    error = np.abs(relative_errors(run, surface, wanted))
    sure = claim > 0.0
    pull = error[sure] / claim[sure]
    return Claims(
        error_over_claim=float(np.sqrt(np.mean(error**2)) / np.sqrt(np.mean(claim**2))),
        within_one=float((pull <= 1.0).mean()),
        within_two=float((pull <= 2.0).mean()),
        within_three=float((pull <= 3.0).mean()),
    )
