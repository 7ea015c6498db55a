"""Make the library of solved presses anew: one solve a layer, in parallel, resumable.

Every finished layer is stored in the cache of solved presses at once, so an interrupted build goes on
where it stopped. Workers are processes of their own, one thread each; a layer is a pure function of its
inputs, so their number does not change the result.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from importlib.metadata import version
from multiprocessing import get_context
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from design.errors import OutputError
from sims.contact.library import LAYERS, Library, deepest_press, pack
from sims.contact.press_fit import fit_press
from sims.contact.profiles import UnitPress
from sims.contact.scope import DEPTH_STEP, FIRST_DEPTHS
from sims.contact.stored_press import RECIPE, stored_press

FloatArray = NDArray[np.float64]

LIBRARY_MESH = 1 / 15
"""Node spacing under the tip of the library's entries [tip radii]: 0.2 mm for a 3 mm tip."""


def library_depths(layer: float) -> tuple[float, ...]:
    """Depths solved for an entry [tip radii]: the same shares of the deepest press in every entry."""
    deepest = deepest_press(layer)
    longest = deepest_press(max(LAYERS))
    steady = np.arange(FIRST_DEPTHS[-1] + DEPTH_STEP, longest - 0.5 * DEPTH_STEP, DEPTH_STEP)
    schedule = np.concatenate([FIRST_DEPTHS, steady, [longest]])
    return tuple(round(float(depth), 9) for depth in schedule * (deepest / longest))


def solve_entry(layer: float, on_step: Callable[[float], None] | None = None) -> UnitPress:
    """The solved states of one layer [tip radii], from the cache or solved and stored there."""
    return stored_press(layer, LIBRARY_MESH, library_depths(layer), on_step)[0]


def assembled(entries: Sequence[UnitPress]) -> Library:
    """The library of solved layers, thinnest first."""
    presses = [fit_press(entry) for entry in entries]
    return Library(
        layers=np.array([press.layer_depth for press in presses]),
        first=np.array([press.first for press in presses]),
        wall_radius=presses[0].wall_radius,
        mesh_size=presses[0].mesh_size,
        knots=presses[0].knots,
        coefficients=np.array([press.coefficients for press in presses]),
        residual=np.array([press.residual.as_array() for press in presses]),
        recipe=RECIPE,
        versions=(*presses[0].versions, f"numpy {version('numpy')}", f"scipy {version('scipy')}"),
    )


def build_library(workers: int, on_step: Callable[[float], None] | None = None) -> Library:
    """Solve every layer that the cache lacks, and fit them all.

    Parameters
    ----------
    workers : processes at work
    on_step : called with the fraction of layers done

    Raises
    ------
    ContactSolveError : a layer's state fails its checks
    """
    thickest_first = sorted(LAYERS, reverse=True)
    with ProcessPoolExecutor(max_workers=workers, mp_context=get_context("spawn")) as pool:
        jobs: dict[Future[UnitPress], float] = {
            pool.submit(solve_entry, layer): layer for layer in thickest_first
        }
        waiting = set(jobs)
        try:
            while waiting:
                done, waiting = wait(waiting, return_when=FIRST_COMPLETED)
                for job in done:
                    job.result()
                if on_step is not None:
                    on_step(1.0 - len(waiting) / len(jobs))
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise
    found = {layer: job.result() for job, layer in jobs.items()}
    return assembled([found[layer] for layer in LAYERS])


def write_library(library: Library, path: Path) -> None:
    """Write the file in one step.

    Raises
    ------
    OutputError : the place cannot be written
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        part = path.with_name(f".{path.name}.{os.getpid()}.part")
        with part.open("wb") as file:
            np.savez_compressed(file, allow_pickle=False, **pack(library))
        os.replace(part, path)
    except OSError as err:
        raise OutputError(f"{path}: cannot be written ({err.strerror or err}); choose another --out") from err
