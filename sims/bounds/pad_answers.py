"""Derivatives at every voxel of a grid of places; voxels that the light settings leave unclear are traced finer."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from design.arrays import BoolArray, FloatArray, IntArray
from design.progress import OnShare
from design.spec import SensorDesign
from sims.bounds.defaults import CLEAR_ERROR, SHALLOW_MM
from sims.bounds.fisher import Bounds, Sensitivity, bounds_of
from sims.bounds.stencil import Steps, sensitivity
from sims.optics.accuracy import Accuracy
from sims.readings.readout import Readout

FIRST_STAGE_SHARE = 0.8
"""Share of the progress that the first settings stand for, where others follow."""


def pad_answers(
    design: SensorDesign,
    places_mm: FloatArray,
    depth_mm: FloatArray,
    readout: Readout,
    *,
    accuracies: Sequence[str | Accuracy],
    seed: int,
    steps: Steps,
    on_step: OnShare | None = None,
) -> Sensitivity:
    """Derivatives of all pairs at every place and depth. Presses that a symmetry joins are traced once, by the engine.

    Parameters
    ----------
    places_mm : (place, 2); depth_mm : (depth,)
    accuracies : settings of the light, cheapest first: voxels that are blind, or whose bounds' error is above
        `CLEAR_ERROR` of them, are traced again with the next; voxels above `SHALLOW_MM` begin with the second
    seed, steps, on_step : as `sims.bounds.stencil.sensitivity` takes them

    Returns
    -------
    Sensitivity with the leading axes (place, depth), pairs with the emitter outermost
    """
    voxels = np.array([[*place, depth] for place in places_mm for depth in depth_mm])
    found: Sensitivity | None = None
    left = np.arange(len(voxels))
    if len(accuracies) > 1 and (voxels[:, 2] >= SHALLOW_MM).any():
        left = np.flatnonzero(voxels[:, 2] >= SHALLOW_MM)
    for stage, accuracy in enumerate(accuracies):
        step = None if on_step is None else _share_of_stage(on_step, stage, len(accuracies))
        finer = sensitivity(
            design, voxels[left], readout, accuracy=accuracy, seed=seed, steps=steps, on_step=step
        )
        found = _put(_nothing(finer, len(voxels)) if found is None else found, left, finer)
        left = np.flatnonzero(_is_unclear(bounds_of(found)))
        if left.size == 0:
            break
    assert found is not None
    shape = (len(places_mm), len(depth_mm), -1)
    return Sensitivity(
        first=found.first.reshape(*shape, 3),
        second=found.second.reshape(*shape, 3),
        weight=found.weight.reshape(shape),
    )


def _share_of_stage(on_step: OnShare, stage: int, stages: int) -> OnShare:
    if stages == 1:
        return on_step
    start, span = (0.0, FIRST_STAGE_SHARE) if stage == 0 else (FIRST_STAGE_SHARE, 1.0 - FIRST_STAGE_SHARE)
    return lambda share: on_step(start + span * share)


def _is_unclear(bounds: Bounds) -> BoolArray:
    """(voxel,) whether the trace's error leaves a bound open."""
    is_known = ~bounds.is_blind
    clear = [
        error[is_known] <= CLEAR_ERROR * value[is_known]
        for value, error in (
            (bounds.location_mm, bounds.location_error_mm),
            (bounds.depth_mm, bounds.depth_error_mm),
        )
    ]
    is_unclear = bounds.is_blind.copy()
    is_unclear[is_known] = ~(clear[0] & clear[1])
    return is_unclear


def _nothing(like: Sensitivity, voxels: int) -> Sensitivity:
    """Voxels that nothing is known of yet: blind."""
    pairs = like.weight.shape[-1]
    zeros = np.zeros((voxels, pairs, 3))
    return Sensitivity(first=zeros, second=zeros, weight=np.zeros((voxels, pairs)))


def _put(into: Sensitivity, rows: IntArray, finer: Sensitivity) -> Sensitivity:
    first, second, weight = into.first.copy(), into.second.copy(), into.weight.copy()
    first[rows], second[rows], weight[rows] = finer.first, finer.second, finer.weight
    return Sensitivity(first=first, second=second, weight=weight)
