"""Fisher information of a press in many readings, and the Cramér-Rao bound, from two independent Jacobians.

Model
-----
Readings cₖ of all pairs are independent and normal about their means, with the standard deviation σₖ of the design's
noise. For θ = (x, y, depth) the Fisher information of one frame of readings is (Kay 1993, eq. 3.31)

    F = Jᵀ W J,   Jₖᵢ = ∂cₖ/∂θᵢ,   W = diag 1/σₖ²,

and no unbiased estimate of θ has a covariance below F⁻¹ (Van Trees 1968, section 2.4). Location bound
√(F⁻¹ₓₓ + F⁻¹ᵧᵧ), depth bound √F⁻¹_dd, and 1/√F_dd where the place is known.

Trace noise is no information
-----------------------------
A Jacobian J + n whose noise n comes from the simulation gives E[(J + n)ᵀW(J + n)] = F + E[nᵀWn]: noise passes for
information. With two independent halves, E[(J + a)ᵀW(J + b)] = F. So F is the symmetrised product of the halves. It may
have eigenvalues that are not positive: there the press is *blind* as far as this trace can tell, never exactly known.

Its error: d(F⁻¹) = -F⁻¹ dF F⁻¹, so a bound with v = F⁻¹eᵢ moves by -vᵀdF v, a sum over pairs of
w (Jv)((a + b)v) + w (av)(bv), whose variance is w² (2 (Jv)² s² + s⁴) a pair, with s² = var(av) estimated by half of
((a - b)v)². The differences of stencils between the halves count as noise here, too. A direction with
information within `TOLD_FROM_ZERO` standard errors of zero counts as blind: a bound is rather too large than too small.

Left out: what the variance of the readings tells (σ depends on c; at a relative noise of 0.003 it adds 2e-5 of F), bias
of estimators, prior knowledge (the workspace ends somewhere), several frames (n independent ones divide bounds by √n),
error that readings share (drift, supply, temperature), ambient light, an unknown gain.

Sources: S. M. Kay, Fundamentals of Statistical Signal Processing: Estimation Theory, 1993, sections 3.7 and 3.9;
H. L. Van Trees, Detection, Estimation, and Modulation Theory I, 1968, section 2.4.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from design.arrays import BoolArray, FloatArray
from sims.bounds.defaults import TOLD_FROM_ZERO


@dataclass(frozen=True, kw_only=True)
class Sensitivity:
    """How readings answer to a press, twice and independently.

    Attributes
    ----------
    first, second : (..., pair, 3) derivatives of the readings by x, y and depth [counts/mm]
    weight : (..., pair) one over the variance of a reading, 0 where it tells nothing [1/counts²]
    """

    first: FloatArray
    second: FloatArray
    weight: FloatArray

    def without(self, is_lost: BoolArray) -> Sensitivity:
        """The same with some pairs lost: (pair,) mask."""
        return Sensitivity(first=self.first, second=self.second, weight=np.where(is_lost, 0.0, self.weight))


@dataclass(frozen=True, kw_only=True)
class Bounds:
    """Least standard deviations of unbiased estimates from one frame; infinite where blind.

    Attributes
    ----------
    location_mm : (...) of the place, √(var x + var y); depth_mm : of the depth
    depth_alone_mm : of the depth when the place is known
    location_error_mm, depth_error_mm, depth_alone_error_mm : (...) standard errors that the light trace leaves;
        infinite where blind
    """

    location_mm: FloatArray
    location_error_mm: FloatArray
    depth_mm: FloatArray
    depth_error_mm: FloatArray
    depth_alone_mm: FloatArray
    depth_alone_error_mm: FloatArray

    @property
    def is_blind(self) -> BoolArray:
        """(...) whether some direction of (x, y, depth) has no information that the trace can tell from none."""
        return ~np.isfinite(self.location_mm)


def information(answers: Sensitivity) -> FloatArray:
    """(..., 3, 3) Fisher information of x, y, depth [1/mm²]; not always positive definite."""
    weighted = answers.first * answers.weight[..., None]
    product = np.swapaxes(weighted, -1, -2) @ answers.second
    return np.asarray(0.5 * (product + np.swapaxes(product, -1, -2)))


def information_error(answers: Sensitivity, direction: FloatArray) -> FloatArray:
    """Standard error of vᵀFv that the trace leaves.

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
    """Cramér-Rao bounds of place and depth.

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
    """Root of a variance and its standard error; infinite where not seen."""
    root = np.sqrt(np.where(is_seen, variance, 1.0))
    return np.where(is_seen, root, np.inf), np.where(is_seen, 0.5 * error / root, np.inf)


def _depth_alone(
    answers: Sensitivity, depth_information: FloatArray, told_from_zero: float
) -> tuple[FloatArray, FloatArray]:
    error = information_error(answers, np.broadcast_to([0.0, 0.0, 1.0], (*depth_information.shape, 3)))
    is_seen = (depth_information > told_from_zero * error) & (depth_information > 0.0)
    known = np.where(is_seen, depth_information, 1.0)
    return _rooted(1.0 / known, error / known**2, is_seen)
