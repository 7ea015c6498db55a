"""Derivatives of all readings by place and depth, from presses beside each voxel's centre, in two independent halves.

Central differences of six presses a half: (x ± h, y, d), (x, y ± h, d), (x, y, d ± k), off by terms of the order h²
and k². Within a half the same seed and settings make one lattice around the tip, whose error is nearly the same on
both sides and cancels; between the halves seeds differ, so that what is left is independent (`sims.bounds.fisher`
says why that matters). The replicates of one trace are no such halves: their offsets are spread evenly, so that their
errors lean against each other. A grid of places a millimetre or two apart is never differenced: signals bend within
less.

Four presses a half would do (the corners of a tetrahedron, mirrored in the other half), but its mixed second
derivatives differ between the halves by more than the trace's error and hide it; six tell the error truly. One-sided
differences, outward in one half and inward in the other, were tried, too: their product is free of errors of the first
order, but where signals bend within the step (the paper's pad at 4.9 mm) the bounds came out twice as large.

Left out: kinks nearer than the steps (the end of a shadow) are smoothed over h and k.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from design.arrays import FloatArray
from design.progress import OnShare
from design.shape.plan import plan_of
from design.spec import SensorDesign
from sims.bounds.defaults import (
    DEPTH_STEP_MM,
    FORMED_SPIKE,
    LARGEST_DEPTH_STEP_SHARE,
    LATERAL_STEP_MM,
    SPIKE,
)
from sims.bounds.fisher import Sensitivity
from sims.optics.accuracy import Accuracy
from sims.optics.tracing import trace
from sims.readings.readout import Readout
from sims.verdict.pair.noise_units import sigma_counts

PRESSES = 6
"""Presses of one half at one voxel."""

DEPTH_DIGITS = 12
"""Decimals of a press's depth [mm]: far below any step, above round-off."""

SEED_GAP = 7919
"""Added to the seed for the second half; a prime, so that neighbouring seeds of a study do not share halves."""


@dataclass(frozen=True, kw_only=True)
class Steps:
    """Offsets of the presses: by place, and by depth at most [mm]."""

    lateral_mm: float = LATERAL_STEP_MM
    depth_mm: float = DEPTH_STEP_MM

    def offsets_mm(self, depth_mm: FloatArray) -> FloatArray:
        """(voxel, 3) offsets by x, y and depth at (voxel,) depths; that by depth is smaller near the surface."""
        by_depth = np.minimum(self.depth_mm, LARGEST_DEPTH_STEP_SHARE * depth_mm)
        lateral = np.full_like(by_depth, self.lateral_mm)
        return np.stack([lateral, lateral, by_depth], axis=-1)


def stencil_presses(voxels_mm: FloatArray, offsets_mm: FloatArray) -> FloatArray:
    """(voxel x 6, 3) presses: of each (voxel, 3) centre those on both sides by x, by y, by depth [mm].

    Depths are rounded to `DEPTH_DIGITS`, so that sums are the numbers of a map's schedule and its light is found again.
    """
    sides = np.repeat(np.eye(3), 2, axis=0) * np.tile([1.0, -1.0], 3)[:, None]
    presses = (voxels_mm[:, None, :] + sides * offsets_mm[:, None, :]).reshape(-1, 3)
    presses[:, 2] = np.round(presses[:, 2], DEPTH_DIGITS)
    return np.asarray(presses)


def stencil_derivatives(readings: FloatArray, offsets_mm: FloatArray) -> FloatArray:
    """(voxel, pair, 3) derivatives by x, y, depth [counts/mm] of (voxel, 6, pair) readings [counts]."""
    change = np.moveaxis(readings[:, 0::2] - readings[:, 1::2], 1, -1)
    return np.asarray(change / (2.0 * offsets_mm[:, None, :]))


def sensitivity(
    design: SensorDesign,
    voxels_mm: FloatArray,
    readout: Readout,
    *,
    accuracy: str | Accuracy,
    seed: int,
    steps: Steps,
    on_step: OnShare | None = None,
) -> Sensitivity:
    """Derivatives of all pairs at each voxel.

    Parameters
    ----------
    voxels_mm : (voxel, 3) x, y, depth
    accuracy, seed : of the light; the second half has ``seed + SEED_GAP``
    on_step : called with the share that is done

    Returns
    -------
    Sensitivity with the leading axis voxel, pairs with the emitter outermost. Pairs that read above full scale at any
    of the presses tell nothing, nor do those that the trace itself does not know to `SPIKE` (`FORMED_SPIKE`) noise
    units: leaving a pair out can but widen the bounds.
    """
    offsets = steps.offsets_mm(voxels_mm[:, 2])
    presses = stencil_presses(voxels_mm, offsets)
    halves = [
        _readings(design, presses, readout, accuracy, seed + SEED_GAP * half, _share_of_half(on_step, half))
        for half in range(2)
    ]
    (first, first_error), (second, second_error) = halves
    errors, spike = np.concatenate([first_error, second_error], axis=1), SPIKE
    if not plan_of(design).is_block:
        errors, spike = _apart(first, second), FORMED_SPIKE
    return Sensitivity(
        first=stencil_derivatives(first, offsets),
        second=stencil_derivatives(second, offsets),
        weight=_weights(design, np.concatenate([first, second], axis=1), errors, spike, readout),
    )


def _apart(first: FloatArray, second: FloatArray) -> FloatArray:
    """(voxel, 6, pair) how far the halves' readings of a press lie apart, less what they do at all of the voxel.

    In place of the stated errors of discs and crowned pads, which bound a lattice's error with much room.
    """
    apart = (first - second) / np.sqrt(2.0)
    return np.asarray(np.abs(apart - apart.mean(axis=1, keepdims=True)))


def _readings(
    design: SensorDesign,
    presses: FloatArray,
    readout: Readout,
    accuracy: str | Accuracy,
    seed: int,
    on_step: Callable[[int, int], None] | None,
) -> tuple[FloatArray, FloatArray]:
    """(voxel, 6, pair) unlimited readings and their standard errors [counts]."""
    light = trace(design, presses, accuracy=accuracy, seed=seed, on_step=on_step)
    shape = (len(presses) // PRESSES, PRESSES, -1)
    return (
        (light.flux * readout.gains).reshape(shape),
        (light.standard_error * readout.gains).reshape(shape),
    )


def _share_of_half(on_step: OnShare | None, half: int) -> Callable[[int, int], None] | None:
    return None if on_step is None else lambda done, total: on_step(0.5 * (half + done / total))


def _weights(
    design: SensorDesign, readings: FloatArray, errors: FloatArray, spike: float, readout: Readout
) -> FloatArray:
    """(voxel, pair) 1/variance of the mean reading [1/counts²]; 0 where a press is above full scale or badly traced."""
    sigma = sigma_counts(readings.mean(axis=1), design.noise.read_noise_counts, design.noise.relative_noise)
    is_lost = (readings.max(axis=1) >= readout.full_scale_counts) | (errors.max(axis=1) > spike * sigma)
    return np.where(is_lost, 0.0, sigma**-2.0)
