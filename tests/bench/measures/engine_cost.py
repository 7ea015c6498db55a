"""What the light engine costs for one state, and how far off each pair is: both measured, on one thread."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from time import process_time

import numba
import numpy as np

from optopad.design.arrays import BoolArray, FloatArray
from optopad.sims.optics.engine.trace_states import Accuracy, trace_scene
from optopad.sims.optics.scene.optical_scene import OpticalScene
from optopad.sims.press import Indentation

Setting = str | float | Accuracy

SEEDS = (11, 12, 13, 14, 15, 16)
REFERENCE_SEEDS = (101, 102, 103, 104)


@dataclass(frozen=True, kw_only=True)
class Cost:
    """One setting on one state.

    Attributes
    ----------
    setting : of the engine's accuracy
    seconds : processor time of a state, mean over seeds
    error : (e, r) root mean square over seeds of the flux's error over the flux [-]
    """

    setting: Setting
    seconds: float
    error: FloatArray

    def worst(self, pairs: BoolArray) -> float:
        """Largest error of the wanted pairs."""
        return float(self.error[pairs].max())


def timed_traces(
    scene: OpticalScene,
    centre_mm: FloatArray,
    press: Indentation,
    setting: Setting,
    seeds: Sequence[int],
) -> tuple[FloatArray, float]:
    """(seed, e, r) flux of a state, and the mean processor time of a trace on one thread.

    The untouched pad of each seed is made first and not counted: a design needs it once.
    """
    threads = numba.get_num_threads()
    numba.set_num_threads(1)
    flux, seconds = [], 0.0
    for seed in seeds:
        trace_scene(scene, centre_mm[None], [None], accuracy=setting, seed=seed)
        start = process_time()
        raw = trace_scene(scene, centre_mm[None], [press], accuracy=setting, seed=seed)
        seconds += process_time() - start
        flux.append(raw.flux.sum(axis=0)[0])
    numba.set_num_threads(threads)
    return np.array(flux), seconds / len(seeds)


def costs(
    scene: OpticalScene,
    centre_mm: FloatArray,
    press: Indentation,
    settings: Sequence[Setting],
    finest: Setting,
) -> list[Cost]:
    """Every setting on one state, against the mean of the finest over seeds of its own."""
    truth = timed_traces(scene, centre_mm, press, finest, REFERENCE_SEEDS)[0].mean(axis=0)
    judged = np.where(truth > 0.0, truth, np.inf)
    found = []
    for setting in settings:
        flux, seconds = timed_traces(scene, centre_mm, press, setting, SEEDS)
        error = np.sqrt(np.mean((flux - truth) ** 2, axis=0)) / judged
        found.append(Cost(setting=setting, seconds=seconds, error=error))
    return found


def cheapest(found: Sequence[Cost], limit: float, pairs: BoolArray) -> Cost:
    """The cheapest setting whose worst wanted pair is within a relative error."""
    good = [cost for cost in found if cost.worst(pairs) <= limit]
    if not good:
        raise AssertionError(f"no setting reaches {limit:g}: {[cost.worst(pairs) for cost in found]}")
    return min(good, key=lambda cost: cost.seconds)
