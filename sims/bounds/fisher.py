"""Fisher information about a press in the readings, and the Cramér-Rao bound, from two independent Jacobians.

Model
-----
The readings cₖ of all pairs are independent and normally distributed about their means, with the standard deviation σₖ
of the design's noise. For θ = (x, y, depth) the Fisher information of one frame is (Kay 1993, eq. 3.31)

    F = Jᵀ W J,   Jₖᵢ = ∂cₖ/∂θᵢ,   W = diag 1/σₖ²,

and no unbiased estimate of θ has a covariance below F⁻¹ (Van Trees 1968, section 2.4). The location bound is
√(F⁻¹ₓₓ + F⁻¹ᵧᵧ), and the depth bound is √F⁻¹_dd, or 1/√F_dd if the location is known.

Trace noise is not information
------------------------------
A Jacobian J + n whose noise n comes from the simulation gives E[(J + n)ᵀW(J + n)] = F + E[nᵀWn], so noise would count
as information. Two independent Jacobians J + a and J + b, called halves, give E[(J + a)ᵀW(J + b)] = F. So F is computed
as the symmetrised product of the halves. Some of its eigenvalues may be zero or negative. Then the press is *not
resolved* at the accuracy of this trace.

The error of a bound follows from d(F⁻¹) = -F⁻¹ dF F⁻¹. With v = F⁻¹eᵢ, the variance (F⁻¹)ᵢᵢ changes by -vᵀdF v. This is
a sum over pairs of w (Jv)((a + b)v) + w (av)(bv). The variance of each term is w² (2 (Jv)² s² + s⁴), where s² = var(av)
is estimated by half of ((a - b)v)². A direction whose information is within `ZERO_SIGMAS` standard errors of zero
counts as not resolved, so bounds tend to be too large rather than too small.

Not modelled: information in the variance of the readings (σ depends on c; at a relative noise of 0.003 it adds 2e-5 of
F), bias of estimators, prior knowledge such as the limits of the workspace, several frames (n independent frames divide
bounds by √n), errors common to all readings (drift, supply, temperature), ambient light, and an unknown gain.

Derivatives
-----------
The derivatives of all readings with respect to location and depth are central differences of presses around each
voxel's centre. Each half has six presses: (x ± h, y, d), (x, y ± h, d) and (x, y, d ± k), so errors are of the order h²
and k². Within a half, all presses have the same seed and settings, and hence the same sampling points around the tip.
So their errors are nearly equal on both sides and cancel. The two halves have different seeds, so their remaining
errors are independent, as the product above requires. Replicates within a single trace cannot serve as halves, because
their sampling offsets are spread evenly, which correlates their errors. Steps are small because signals curve within a
millimetre.

Four presses per half would suffice (the corners of a tetrahedron, mirrored in the other half), but mixed second
derivatives would make the halves differ by more than the trace's error. With one-sided differences, outward in one half
and inward in the other, errors of the first order cancel in the product. But where signals curve within the step (the
published pad at 4.9 mm), they made the bounds twice as large.

Kinks of a signal that are narrower than the steps, such as the edge of a shadow, are smoothed over h and k. Voxels
whose bounds are still uncertain with the first light settings are traced again with finer ones, and voxels that are
then not resolved with finer ones still.

Sources
-------
S. M. Kay, Fundamentals of Statistical Signal Processing: Estimation Theory, 1993, sections 3.7 and 3.9;
H. L. Van Trees, Detection, Estimation, and Modulation Theory I, 1968, section 2.4.
[R] Chosen for this tool, to rank layouts. A voxel is covered when a fingertip-sized contact is located to within a
millimetre and its depth to within half a millimetre. A voxel is dead when its location is not resolved to half a
millimetre, or its depth to a tenth, the limits of the feasibility study.
[M] Measured on the published pad: docs/understand/model.md, "What the signals can tell".
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from optopad.design.arrays import BoolArray, FloatArray, IntArray
from optopad.design.draft import Draft
from optopad.design.progress import OnShare
from optopad.design.rules.light import SURROUND_MM
from optopad.sims.optics.accuracy import Accuracy
from optopad.sims.optics.tracing import trace
from optopad.sims.readings.readout import Readout
from optopad.sims.verdict.depth_curve import sigma_counts

COVERED_LOCATION_MM: Final = 1.0
"""Largest location bound of a covered voxel [mm]; [R]."""

COVERED_DEPTH_MM: Final = 0.5
"""Largest depth bound of a covered voxel [mm]; [R]."""

DEAD_LOCATION_MM: Final = 0.5
"""Location bound above which a voxel counts as dead [mm]; [R]."""

DEAD_DEPTH_MM: Final = 0.1
"""Depth bound above which a voxel counts as dead [mm]; [R]."""

LATERAL_STEP_MM: Final = SURROUND_MM
"""Distance from a voxel's centre to the presses for the derivatives with respect to x and y [mm]; [M]."""

DEPTH_STEP_MM: Final = 0.1
"""Distance from a voxel's centre to the presses for the derivative with respect to depth [mm]; [M]."""

LARGEST_DEPTH_STEP_SHARE: Final = 0.25
"""Upper limit of `DEPTH_STEP_MM` as a share of the depth [-]. It matters near first contact, where signals grow like a
power of depth."""

TRUSTED: Final = 2.0
"""Trace error above which a reading's weight is less than its noise allows [noise units]. [M]: on the published pad and
`fingertip-16`, a limit of 3 gives the same median location bounds. On a pad of 34 x 18 mm with 5.5 mm of silicone, 15 %
of the volume is not resolved at a target of 300 counts and 26 % at 1200; 23 % if no reading is clipped. With pairs
above 5 noise units left out instead, these are 20, 43 and 36 %: noise shrinks relative to light as light grows, and
ever more pairs were left out."""

ZERO_SIGMAS: Final = 2.0
"""Number of the light trace's standard errors within which Fisher information counts as zero [-]."""

BAND: Final = 2.0
"""Number of standard errors by which all bounds are shifted for the low and high ends of a summary [-]."""

FORMED_TRUSTED: Final = 8.0
"""`TRUSTED` for discs and crowned pads [noise units]. Their light is integrated on regular point lattices and has no
outliers, so the limit is looser. [M]: on the crowned preset a limit of 5 gives the same median bounds, and 2 widens
them by 3 %."""

CLEAR_ERROR: Final = 0.05
"""Relative trace error of a bound above which its voxel is traced again with finer light settings [-]. [M]: with 0.1,
six seeds gave 18 to 30 µm for the depth bound of a deep press on the published pad, with stated errors of 0.7 to
2.4 µm. With 0.05 they gave 20 to 21 µm, for an eighth more computing time."""

SHALLOW_MM: Final = 0.3
"""Voxels less deep than this are traced with the second light settings from the start [mm]. [M]: at 0.2 mm on the
published pad, the first settings leave four in five voxels uncertain, most of them not resolved."""

COARSE_DEPTHS_MM: Final = (0.2, 0.7, 1.5, 2.9)
"""Depths of the voxels in a quick score [mm]. Depths beyond the usable range are left out, and the end of the range is
added. Most are half-way between depths of the deadband map, so their presses can use its stored light."""

FINE_DEPTHS_MM: Final = (0.15, 0.4, 0.8, 1.5, 2.5, 3.6)
"""Depths of the voxels in a fine score [mm]; the end of the usable range is added. Fewer depths suffice than for the
deadband map, because bounds change slowly with depth."""

PRESSES = 6
"""Number of presses per voxel in one of the two halves: both sides in x, y and depth."""

DEPTH_DIGITS = 12
"""Number of decimals to which a press's depth in mm is rounded: far finer than any step, but coarser than round-off."""

SEED_GAP = 7919
"""Number added to the seed for the second half of the presses: a large prime, so that a study with consecutive seeds
never uses a half twice."""


@dataclass(frozen=True, kw_only=True)
class Steps:
    """How far the presses for the derivatives lie from a voxel's centre: in x and y, and at most in depth [mm]."""

    lateral_mm: float = LATERAL_STEP_MM
    depth_mm: float = DEPTH_STEP_MM

    def offsets_mm(self, depth_mm: FloatArray) -> FloatArray:
        """(voxel, 3) offsets in x, y and depth [mm] for voxels at depths (voxel,); shallow ones get less in depth."""
        by_depth = np.minimum(self.depth_mm, LARGEST_DEPTH_STEP_SHARE * depth_mm)
        lateral = np.full_like(by_depth, self.lateral_mm)
        return np.stack([lateral, lateral, by_depth], axis=-1)


def stencil_presses(voxels_mm: FloatArray, offsets_mm: FloatArray) -> FloatArray:
    """(voxel x 6, 3) presses around the centres (voxel, 3), offset by +x, -x, +y, -y, +depth, -depth [mm].

    Depths are rounded to `DEPTH_DIGITS` so that they match depths of the deadband map, whose stored light is then used.
    """
    sides = np.repeat(np.eye(3), 2, axis=0) * np.tile([1.0, -1.0], 3)[:, None]
    presses = (voxels_mm[:, None, :] + sides * offsets_mm[:, None, :]).reshape(-1, 3)
    presses[:, 2] = np.round(presses[:, 2], DEPTH_DIGITS)
    return np.asarray(presses)


def stencil_derivatives(readings: FloatArray, offsets_mm: FloatArray) -> FloatArray:
    """Derivatives (voxel, pair, 3) with respect to x, y and depth [counts/mm] from readings (voxel, 6, pair)."""
    change = np.moveaxis(readings[:, 0::2] - readings[:, 1::2], 1, -1)
    return np.asarray(change / (2.0 * offsets_mm[:, None, :]))


def sensitivity(
    draft: Draft,
    voxels_mm: FloatArray,
    readout: Readout,
    *,
    accuracy: str | Accuracy,
    seed: int,
    steps: Steps,
    on_step: OnShare | None = None,
) -> Sensitivity:
    """Derivatives of all pairs' readings with respect to location and depth, at each voxel.

    Parameters
    ----------
    voxels_mm : (voxel, 3) x, y, depth [mm]
    accuracy, seed : accuracy setting and random seed of the light model; the second half has ``seed + SEED_GAP``
    on_step : called with the share of the work done, 0 to 1

    Returns
    -------
    Sensitivity with the axes (voxel, pair), pairs in emitter-major order. Pairs that reach full scale at any of the
    presses have weight 0, and pairs with a trace error above `TRUSTED` (for discs and crowned pads, `FORMED_TRUSTED`)
    have less weight. This can only widen the bounds.
    """
    offsets = steps.offsets_mm(voxels_mm[:, 2])
    presses = stencil_presses(voxels_mm, offsets)
    halves = [
        _readings(draft, presses, readout, accuracy, seed + SEED_GAP * half, _share_of_half(on_step, half))
        for half in range(2)
    ]
    (first, first_error), (second, second_error) = halves
    errors, trusted = np.concatenate([first_error, second_error], axis=1), TRUSTED
    if not draft.plan.is_block:
        errors, trusted = _apart(first, second), FORMED_TRUSTED
    return Sensitivity(
        first=stencil_derivatives(first, offsets),
        second=stencil_derivatives(second, offsets),
        weight=_weights(np.concatenate([first, second], axis=1), errors, trusted, readout),
    )


def _apart(first: FloatArray, second: FloatArray) -> FloatArray:
    """(voxel, 6, pair) trace error of the readings, estimated from the difference between the halves [counts].

    The mean difference over the voxel's six presses is subtracted, since it cancels in derivatives. Discs and crowned
    pads use this estimate because the errors stated by the light model are far too large for them.
    """
    apart = (first - second) / np.sqrt(2.0)
    return np.asarray(np.abs(apart - apart.mean(axis=1, keepdims=True)))


def _readings(
    draft: Draft,
    presses: FloatArray,
    readout: Readout,
    accuracy: str | Accuracy,
    seed: int,
    on_step: Callable[[int, int], None] | None,
) -> tuple[FloatArray, FloatArray]:
    """(voxel, 6, pair) readings, not clipped at full scale, and their standard errors [counts]."""
    light = trace(draft, presses, accuracy=accuracy, seed=seed, on_step=on_step)
    shape = (len(presses) // PRESSES, PRESSES, -1)
    return (
        (light.flux * readout.gains).reshape(shape),
        (light.standard_error * readout.gains).reshape(shape),
    )


def _share_of_half(on_step: OnShare | None, half: int) -> Callable[[int, int], None] | None:
    return None if on_step is None else lambda done, total: on_step(0.5 * (half + done / total))


def _weights(readings: FloatArray, errors: FloatArray, trusted: float, readout: Readout) -> FloatArray:
    """(voxel, pair) one over the variance of a reading in one frame, or of its trace error if larger [1/counts²].

    A trace error counts as far as it exceeds `trusted` noise units, at the press where it is largest. The weight is 0
    where the pair reaches full scale.
    """
    sigma = sigma_counts(readings.mean(axis=1), **readout.noise)
    is_clipped = readings.max(axis=1) >= readout.full_scale_counts
    return np.where(is_clipped, 0.0, np.maximum(sigma, errors.max(axis=1) / trusted) ** -2.0)


@dataclass(frozen=True, kw_only=True)
class Sensitivity:
    """Derivatives of the readings with respect to location and depth, from two independent light traces.

    Attributes
    ----------
    first, second : (..., pair, 3) derivatives with respect to x, y and depth [counts/mm], from each of the traces
    weight : (..., pair) one over the variance of a reading [1/counts²]; 0 where the pair is left out
    """

    first: FloatArray
    second: FloatArray
    weight: FloatArray

    def without(self, is_lost: BoolArray) -> Sensitivity:
        """The same derivatives, but with weight 0 for the pairs that the mask (pair,) marks as lost."""
        return Sensitivity(first=self.first, second=self.second, weight=np.where(is_lost, 0.0, self.weight))


@dataclass(frozen=True, kw_only=True)
class Bounds:
    """Smallest standard deviations with which unbiased estimators can find location and depth from one frame.

    All arrays have the axes of the derivatives except pair and (x, y, depth). They are infinite where a press is not
    resolved.

    Attributes
    ----------
    location_mm : standard deviation of the location, √(var x + var y) [mm]
    depth_mm : standard deviation of the depth when the location is unknown [mm]
    depth_alone_mm : standard deviation of the depth when the location is known [mm]
    location_error_mm, depth_error_mm, depth_alone_error_mm : standard errors of these, due to the light trace [mm]
    """

    location_mm: FloatArray
    location_error_mm: FloatArray
    depth_mm: FloatArray
    depth_error_mm: FloatArray
    depth_alone_mm: FloatArray
    depth_alone_error_mm: FloatArray

    @property
    def is_blind(self) -> BoolArray:
        """(...) whether a press is not resolved: some direction of (x, y, depth) has no information above the error."""
        return ~np.isfinite(self.location_mm)


def information(answers: Sensitivity) -> FloatArray:
    """(..., n, n) Fisher information about all unknowns; trace noise may make it not positive definite."""
    weighted = answers.first * answers.weight[..., None]
    product = np.swapaxes(weighted, -1, -2) @ answers.second
    return np.asarray(0.5 * (product + np.swapaxes(product, -1, -2)))


def information_error(answers: Sensitivity, direction: FloatArray) -> FloatArray:
    """Standard error of vᵀFv due to the light trace, where F is the Fisher information.

    Parameters
    ----------
    direction : (..., n) vector v

    Returns
    -------
    (...) standard error
    """
    first, second = ((half @ direction[..., None])[..., 0] for half in (answers.first, answers.second))
    variance = 0.5 * (first - second) ** 2
    slope = 0.25 * (first + second) ** 2
    spread = answers.weight**2 * (2.0 * slope * variance + variance**2)
    return np.asarray(np.sqrt(spread.sum(axis=-1)))


def least_variances(
    answers: Sensitivity, zero_sigmas: float = ZERO_SIGMAS
) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Least variances (..., n) of all unknowns if none is known, their standard errors, and whether they are resolved.

    Where a press is not resolved, the numbers mean nothing.
    """
    fisher = information(answers)
    is_seen = _is_seen(answers, fisher, zero_sigmas)
    inverse = np.linalg.inv(np.where(is_seen[..., None, None], fisher, np.eye(fisher.shape[-1])))
    slips = [information_error(answers, inverse[..., axis]) for axis in range(fisher.shape[-1])]
    return np.diagonal(inverse, axis1=-2, axis2=-1), np.stack(slips, axis=-1), is_seen


def bounds_of(answers: Sensitivity, zero_sigmas: float = ZERO_SIGMAS) -> Bounds:
    """Cramér-Rao bounds of location and depth.

    Parameters
    ----------
    answers : derivatives of the readings of all pairs, from independent halves
    zero_sigmas : number of the trace's standard errors by which information must exceed zero in every direction
        [-]; otherwise the press counts as not resolved
    """
    variance, slips, is_seen = least_variances(answers, zero_sigmas)
    location, location_error = rooted(
        variance[..., 0] + variance[..., 1], np.hypot(slips[..., 0], slips[..., 1]), is_seen
    )
    depth, depth_error = rooted(variance[..., 2], slips[..., 2], is_seen)
    alone, alone_error = _depth_alone(answers, zero_sigmas)
    return Bounds(
        location_mm=location,
        location_error_mm=location_error,
        depth_mm=depth,
        depth_error_mm=depth_error,
        depth_alone_mm=alone,
        depth_alone_error_mm=alone_error,
    )


def _is_seen(answers: Sensitivity, fisher: FloatArray, zero_sigmas: float) -> BoolArray:
    """(...) whether a press is resolved: in every direction of the unknowns, information exceeds the trace's error."""
    least, vectors = np.linalg.eigh(fisher)
    clear = [
        least[..., axis] > zero_sigmas * information_error(answers, vectors[..., axis])
        for axis in range(fisher.shape[-1])
    ]
    return np.asarray(np.all(clear, axis=0) & (least[..., 0] > 1e-12 * np.abs(least[..., 2])))


def rooted(variance: FloatArray, error: FloatArray, is_seen: BoolArray) -> tuple[FloatArray, FloatArray]:
    """Square root of a variance, and the root's standard error; both infinite where `is_seen` is False."""
    root = np.sqrt(np.where(is_seen, variance, 1.0))
    return np.where(is_seen, root, np.inf), np.where(is_seen, 0.5 * error / root, np.inf)


def _depth_alone(answers: Sensitivity, zero_sigmas: float) -> tuple[FloatArray, FloatArray]:
    fisher = information(answers)
    depth_information = fisher[..., 2, 2]
    error = information_error(answers, np.broadcast_to(np.eye(fisher.shape[-1])[2], fisher.shape[:-1]))
    is_seen = (depth_information > zero_sigmas * error) & (depth_information > 0.0)
    known = np.where(is_seen, depth_information, 1.0)
    return rooted(1.0 / known, error / known**2, is_seen)


STAGE_ENDS = (0.8, 0.95)
"""Progress to show when the first and the second light settings are finished and finer ones may follow [-]."""


def sensitivities(
    draft: Draft,
    places_mm: FloatArray,
    depth_mm: FloatArray,
    readout: Readout,
    *,
    accuracies: Sequence[str | Accuracy],
    seed: int,
    steps: Steps,
    on_step: OnShare | None = None,
) -> Sensitivity:
    """Derivatives of all pairs' readings with respect to location and depth, in every voxel.

    Voxels that are not resolved, or whose bounds have a relative error above `CLEAR_ERROR`, are traced again with the
    second accuracy. Voxels shallower than `SHALLOW_MM` begin with it. Voxels that are still not resolved are traced
    with the third.

    Parameters
    ----------
    places_mm, depth_mm : (place, 2) locations x, y, and (depth,) depths; each combination is a voxel [mm]
    accuracies : accuracy settings of the light model, cheapest first
    seed : random seed of the first half; the second half has ``seed + SEED_GAP``
    steps : offsets of the presses
    on_step : called with the share of the work done, 0 to 1

    Returns
    -------
    Sensitivity with the axes (place, depth, pair), pairs in emitter-major order
    """
    voxels = np.array([[*place, depth] for place in places_mm for depth in depth_mm])
    found: Sensitivity | None = None
    left = np.arange(len(voxels))
    if len(accuracies) > 1 and (voxels[:, 2] >= SHALLOW_MM).any():
        left = np.flatnonzero(voxels[:, 2] >= SHALLOW_MM)
    for stage, accuracy in enumerate(accuracies):
        step = None if on_step is None else _share_of_stage(on_step, stage, len(accuracies))
        finer = sensitivity(
            draft, voxels[left], readout, accuracy=accuracy, seed=seed, steps=steps, on_step=step
        )
        found = _put(_nothing(finer, len(voxels)) if found is None else found, left, finer)
        left = np.flatnonzero(_is_unclear(bounds_of(found)) if stage == 0 else bounds_of(found).is_blind)
        if left.size == 0:
            break
    if on_step is not None:
        on_step(1.0)
    assert found is not None
    shape = (len(places_mm), len(depth_mm), -1)
    return Sensitivity(
        first=found.first.reshape(*shape, 3),
        second=found.second.reshape(*shape, 3),
        weight=found.weight.reshape(shape),
    )


def _share_of_stage(on_step: OnShare, stage: int, stages: int) -> OnShare:
    ends = (0.0, *STAGE_ENDS[: stages - 1], 1.0)
    return lambda share: on_step(ends[stage] + (ends[stage + 1] - ends[stage]) * share)


def _is_unclear(bounds: Bounds) -> BoolArray:
    """(voxel,) whether a voxel is not resolved, or the trace error of its location or depth bound is too large."""
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
    """Derivatives and weights of 0 for a number of voxels, so that none is resolved, with as many pairs as `like`."""
    pairs = like.weight.shape[-1]
    zeros = np.zeros((voxels, pairs, 3))
    return Sensitivity(first=zeros, second=zeros, weight=np.zeros((voxels, pairs)))


def _put(into: Sensitivity, rows: IntArray, finer: Sensitivity) -> Sensitivity:
    first, second, weight = into.first.copy(), into.second.copy(), into.weight.copy()
    first[rows], second[rows], weight[rows] = finer.first, finer.second, finer.weight
    return Sensitivity(first=first, second=second, weight=weight)
