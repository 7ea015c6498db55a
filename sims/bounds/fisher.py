"""Fisher information of a press in many readings, and the Cramér-Rao bound, from two independent Jacobians.

Model
-----
Readings cₖ of all pairs are independent and normal about their means, with the standard deviation σₖ of the design's
noise. For θ = (x, y, depth) the Fisher information of one frame of readings is (Kay 1993, eq. 3.31)

    F = Jᵀ W J,   Jₖᵢ = ∂cₖ/∂θᵢ,   W = diag 1/σₖ²,

and no unbiased estimate of θ has a covariance below F⁻¹ (Van Trees 1968, section 2.4). The location bound is
√(F⁻¹ₓₓ + F⁻¹ᵧᵧ), the depth bound √F⁻¹_dd, and 1/√F_dd where the location is known.

Trace noise is no information
-----------------------------
A Jacobian J + n whose noise n comes from the simulation gives E[(J + n)ᵀW(J + n)] = F + E[nᵀWn]: noise counts as
information. With two independent halves, E[(J + a)ᵀW(J + b)] = F. So F is the symmetrised product of the halves. It may
have eigenvalues that are not positive: such a press is *not resolved* to the accuracy of this trace.

Its error: d(F⁻¹) = -F⁻¹ dF F⁻¹, so a bound with v = F⁻¹eᵢ moves by -vᵀdF v, a sum over pairs of
w (Jv)((a + b)v) + w (av)(bv), whose variance is w² (2 (Jv)² s² + s⁴) a pair, with s² = var(av) estimated by half of
((a - b)v)². The differences of stencils between the halves count as noise here, too. A direction with information
within `TOLD_FROM_ZERO` standard errors of zero counts as not resolved, so a bound is rather too large than too small.

Left out: information in the variance of the readings (σ depends on c; at a relative noise of 0.003 it adds 2e-5 of F),
bias of estimators, prior knowledge (the limits of the workspace), several frames (n independent ones divide bounds by
√n), error common to the readings (drift, supply, temperature), ambient light, an unknown gain.

Sources: S. M. Kay, Fundamentals of Statistical Signal Processing: Estimation Theory, 1993, sections 3.7 and 3.9;
H. L. Van Trees, Detection, Estimation, and Modulation Theory I, 1968, section 2.4.

The numbers on which bounds and their summaries depend, collected here; every function takes them as keywords.

Sources
-------
[R] Chosen for this tool: a fingertip-sized contact is useful when it is located to a millimetre and its depth to half
a millimetre (coverage); a voxel is dead when its location is not resolved to half a millimetre, or its depth to a
tenth, the limits of the feasibility study. Confidence: chosen; they serve to rank layouts and are no findings.
[M] Measured on the paper's pad: docs/understand/model.md, "What the signals can tell".

Derivatives of all readings by location and depth, from presses around each voxel's centre, in two independent halves.

They are central differences of six presses a half: (x ± h, y, d), (x, y ± h, d), (x, y, d ± k), with errors of the
order h² and k². Within a half the same seed and settings make one lattice around the tip, whose error is nearly the
same on both sides and cancels; the seeds of the halves differ, so the remaining errors are independent, as the product
above requires. The replicates of one trace are no such halves: their offsets are spread evenly, so their errors are
correlated. Locations a millimetre or two apart are never differenced, since signals bend within less.

Four presses a half would suffice (the corners of a tetrahedron, mirrored in the other half), but its mixed second
derivatives differ between the halves by more than the trace's error and hide it; six give the true error. One-sided
differences, outward in one half and inward in the other, were tried, too: their product is free of errors of the first
order, but where signals bend within the step (the paper's pad at 4.9 mm) the bounds came out twice as large.

Left out: kinks nearer than the steps (the end of a shadow), which are smoothed over h and k.

Derivatives at every voxel of a grid of locations; voxels that the light settings leave open are traced finer.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from design.arrays import BoolArray, FloatArray, IntArray
from design.progress import OnShare
from design.rules.light import SURROUND_MM
from design.shape.cavity import plan_of
from design.spec import SensorDesign
from sims.optics.accuracy import Accuracy
from sims.optics.tracing import trace
from sims.readings.readout import Readout
from sims.verdict.depth_curve import sigma_counts

COVERED_LOCATION_MM: Final = 1.0
"""A covered voxel's location bound is below this [mm]; [R]."""

COVERED_DEPTH_MM: Final = 0.5
"""A covered voxel's depth bound is below this [mm]; [R]."""

DEAD_LOCATION_MM: Final = 0.5
"""A dead voxel's location bound is above this, or its depth bound above the next [mm]; [R]."""

DEAD_DEPTH_MM: Final = 0.1
"""See `DEAD_LOCATION_MM` [mm]; [R]."""

LATERAL_STEP_MM: Final = SURROUND_MM
"""Offset of the presses that give the derivatives by location [mm]; [M]."""

DEPTH_STEP_MM: Final = 0.1
"""Offset of the presses that give the derivative by depth [mm]; [M]."""

LARGEST_DEPTH_STEP_SHARE: Final = 0.25
"""The depth offset is at most this share of the depth [-]: near contact, signals grow like a power of depth."""

SPIKE: Final = 5.0
"""A pair whose reading has a larger trace error than this at some press of a voxel is left out there [noise units];
[M]: two of 960 at draft, one of which hid all the others."""

TOLD_FROM_ZERO: Final = 2.0
"""Information within this many of the trace's standard errors of zero counts as none [-]."""

BAND: Final = 2.0
"""Low and high of a summary are its values with all bounds moved by this many standard errors of the trace [-]."""

FORMED_SPIKE: Final = 20.0
"""The same for discs and crowned pads [noise units]: their light is integrated on lattices and has no spikes, and the
difference of its halves is in the bounds' error anyway; [M]: with 5, light of half as many points leaves out so many
pairs of the crowned preset that bounds at 2.9 and 3.9 mm are up to 24 % wider; with 20 they agree within 6 %."""

CLEAR_ERROR: Final = 0.05
"""A bound whose trace error is a larger share of it is traced again with finer light [-]; [M]. At a tenth, a depth
bound of the paper's pad late in the press was 18 to 30 µm by six seeds, with stated errors of 0.7 to 2.4; at a
twentieth it was 20 to 21, for an eighth more of the bounds' time."""

SHALLOW_MM: Final = 0.3
"""Voxels above this begin with the second settings of the light [mm]: on the paper's pad four in five of them at 0.2 mm
are open after the first, most of them not resolved; [M]."""

COARSE_DEPTHS_MM: Final = (0.2, 0.7, 1.5, 2.9)
"""Depths of the bounds of a quick score; those beyond the usable range are left out, its end is added [mm]. Most are
half-way between depths of its map, so that the map's light serves both."""

FINE_DEPTHS_MM: Final = (0.15, 0.4, 0.8, 1.5, 2.5, 3.6)
"""Depths of the bounds of a fine score, likewise [mm]. Bounds change slowly with depth, so these are coarser than the
deadband map's."""

PRESSES = 6
"""Number of presses of one half at one voxel."""

DEPTH_DIGITS = 12
"""Decimals of a press's depth [mm]: far below any step, above round-off."""

SEED_GAP = 7919
"""Number added to the seed for the second half; a prime, so that neighbouring seeds of a study share no halves."""


@dataclass(frozen=True, kw_only=True)
class Steps:
    """Offsets of the presses: by location, and by depth at most [mm]."""

    lateral_mm: float = LATERAL_STEP_MM
    depth_mm: float = DEPTH_STEP_MM

    def offsets_mm(self, depth_mm: FloatArray) -> FloatArray:
        """(voxel, 3) offsets by x, y and depth at (voxel,) depths; that by depth is smaller near the surface."""
        by_depth = np.minimum(self.depth_mm, LARGEST_DEPTH_STEP_SHARE * depth_mm)
        lateral = np.full_like(by_depth, self.lateral_mm)
        return np.stack([lateral, lateral, by_depth], axis=-1)


def stencil_presses(voxels_mm: FloatArray, offsets_mm: FloatArray) -> FloatArray:
    """(voxel x 6, 3) presses: of each (voxel, 3) centre those on both sides by x, by y, by depth [mm].

    Depths are rounded to `DEPTH_DIGITS`, so that they equal those of a map's schedule and its stored light is found.
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
    accuracy, seed : accuracy setting and random seed of the light model; the second half has ``seed + SEED_GAP``
    on_step : called with the share that is done

    Returns
    -------
    Sensitivity with the leading axis voxel, pairs with the emitter outermost. Pairs that read above full scale at any
    of the presses are left out, as are those with a trace error above `SPIKE` (`FORMED_SPIKE`) noise units: leaving a
    pair out can only widen the bounds.
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
    """(voxel, 6, pair) difference of the halves' readings of a press, less their difference over the whole voxel.

    It replaces the stated errors of discs and crowned pads, which bound a lattice's error very loosely.
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
    sigma = sigma_counts(readings.mean(axis=1), design.value_noise_counts, design.noise.relative_noise)
    is_lost = (readings.max(axis=1) >= readout.full_scale_counts) | (errors.max(axis=1) > spike * sigma)
    return np.where(is_lost, 0.0, sigma**-2.0)


@dataclass(frozen=True, kw_only=True)
class Sensitivity:
    """Sensitivity of readings to a press, in two independent halves.

    Attributes
    ----------
    first, second : (..., pair, 3) derivatives of the readings by x, y and depth [counts/mm]
    weight : (..., pair) one over the variance of a reading, 0 where it is left out [1/counts²]
    """

    first: FloatArray
    second: FloatArray
    weight: FloatArray

    def without(self, is_lost: BoolArray) -> Sensitivity:
        """The same with some pairs lost: (pair,) mask."""
        return Sensitivity(first=self.first, second=self.second, weight=np.where(is_lost, 0.0, self.weight))


@dataclass(frozen=True, kw_only=True)
class Bounds:
    """Least standard deviations of unbiased estimates from one frame; infinite where not resolved.

    Attributes
    ----------
    location_mm : (...) of the location, √(var x + var y); depth_mm : of the depth
    depth_alone_mm : of the depth when the location is known
    location_error_mm, depth_error_mm, depth_alone_error_mm : (...) standard errors from the light trace;
        infinite where not resolved
    """

    location_mm: FloatArray
    location_error_mm: FloatArray
    depth_mm: FloatArray
    depth_error_mm: FloatArray
    depth_alone_mm: FloatArray
    depth_alone_error_mm: FloatArray

    @property
    def is_blind(self) -> BoolArray:
        """(...) whether some direction of (x, y, depth) has no information above the trace's error."""
        return ~np.isfinite(self.location_mm)


def information(answers: Sensitivity) -> FloatArray:
    """(..., 3, 3) Fisher information of x, y, depth [1/mm²]; not always positive definite."""
    weighted = answers.first * answers.weight[..., None]
    product = np.swapaxes(weighted, -1, -2) @ answers.second
    return np.asarray(0.5 * (product + np.swapaxes(product, -1, -2)))


def information_error(answers: Sensitivity, direction: FloatArray) -> FloatArray:
    """Standard error of vᵀFv from the light trace.

    Parameters
    ----------
    direction : (..., 3) v

    Returns
    -------
    (...) standard error [v²/mm²]
    """
    first, second = ((half @ direction[..., None])[..., 0] for half in (answers.first, answers.second))
    variance = 0.5 * (first - second) ** 2
    slope = 0.25 * (first + second) ** 2
    spread = answers.weight**2 * (2.0 * slope * variance + variance**2)
    return np.asarray(np.sqrt(spread.sum(axis=-1)))


def bounds_of(answers: Sensitivity, told_from_zero: float = TOLD_FROM_ZERO) -> Bounds:
    """Cramér-Rao bounds of location and depth.

    Parameters
    ----------
    answers : derivatives of all pairs, from independent halves
    told_from_zero : standard errors of the trace by which information must exceed zero [-]
    """
    fisher = information(answers)
    is_seen = _is_seen(answers, fisher, told_from_zero)
    inverse = np.linalg.inv(np.where(is_seen[..., None, None], fisher, np.eye(3)))
    variance = np.diagonal(inverse, axis1=-2, axis2=-1)
    slips = [information_error(answers, inverse[..., axis]) for axis in range(3)]
    location, location_error = _rooted(variance[..., 0] + variance[..., 1], np.hypot(*slips[:2]), is_seen)
    depth, depth_error = _rooted(variance[..., 2], slips[2], is_seen)
    alone, alone_error = _depth_alone(answers, fisher[..., 2, 2], told_from_zero)
    return Bounds(
        location_mm=location,
        location_error_mm=location_error,
        depth_mm=depth,
        depth_error_mm=depth_error,
        depth_alone_mm=alone,
        depth_alone_error_mm=alone_error,
    )


def _is_seen(answers: Sensitivity, fisher: FloatArray, told_from_zero: float) -> BoolArray:
    """(...) whether every direction has information that exceeds the trace's error."""
    least, vectors = np.linalg.eigh(fisher)
    clear = [
        least[..., axis] > told_from_zero * information_error(answers, vectors[..., axis])
        for axis in range(3)
    ]
    return np.asarray(np.all(clear, axis=0) & (least[..., 0] > 1e-12 * np.abs(least[..., 2])))


def _rooted(variance: FloatArray, error: FloatArray, is_seen: BoolArray) -> tuple[FloatArray, FloatArray]:
    """Root of a variance and its standard error; infinite where not resolved."""
    root = np.sqrt(np.where(is_seen, variance, 1.0))
    return np.where(is_seen, root, np.inf), np.where(is_seen, 0.5 * error / root, np.inf)


def _depth_alone(
    answers: Sensitivity, depth_information: FloatArray, told_from_zero: float
) -> tuple[FloatArray, FloatArray]:
    error = information_error(answers, np.broadcast_to([0.0, 0.0, 1.0], (*depth_information.shape, 3)))
    is_seen = (depth_information > told_from_zero * error) & (depth_information > 0.0)
    known = np.where(is_seen, depth_information, 1.0)
    return _rooted(1.0 / known, error / known**2, is_seen)


FIRST_STAGE_SHARE = 0.8
"""Share of the progress for the first settings, where others follow."""


def sensitivities(
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
    """Derivatives of all pairs at every location and depth. The engine traces presses that are equal by symmetry once.

    Parameters
    ----------
    places_mm : (place, 2); depth_mm : (depth,)
    accuracies : settings of the light, cheapest first: voxels that are not resolved, or whose bounds' error is above
        `CLEAR_ERROR` of them, are traced again with the next; voxels above `SHALLOW_MM` begin with the second
    seed, steps, on_step : as for `sims.bounds.fisher.sensitivity`

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
    """Voxels without information yet: not resolved."""
    pairs = like.weight.shape[-1]
    zeros = np.zeros((voxels, pairs, 3))
    return Sensitivity(first=zeros, second=zeros, weight=np.zeros((voxels, pairs)))


def _put(into: Sensitivity, rows: IntArray, finer: Sensitivity) -> Sensitivity:
    first, second, weight = into.first.copy(), into.second.copy(), into.weight.copy()
    first[rows], second[rows], weight[rows] = finer.first, finer.second, finer.weight
    return Sensitivity(first=first, second=second, weight=weight)
