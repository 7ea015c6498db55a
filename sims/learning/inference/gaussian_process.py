"""A Gaussian process carried by inducing points: its mean, and its own standard deviation for every frame.

    k(s, z) = exp(-|s - z|)                      |.| the Euclidean distance of features over the length scale
    mean(s) = m + scale × k_s · A                k_s: kernels with the inducing points
    var(s)  = scale² × (1 - k_s · Q k_s)

A and Q come from the fit (`sims.learning.fits.gaussian_process`). The noise of a reading is not in the variance; the
table of trust sets its scale. Source: Rasmussen and Williams, Gaussian processes for machine learning (2006), sections
4.2.1 (this kernel: Matérn 1/2) and 8.3.4 (projected process).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from design.arrays import FloatArray
from design.errors import InputError
from sims.learning.inference.feature_scaling import scaling_of_arrays
from sims.learning.inference.header import ModelHeader
from sims.learning.inference.sigma_table import sigma_table_of_arrays
from sims.learning.inference.touch_model import Arrays, taken
from sims.learning.inference.touch_svm import touch_svm_of_arrays
from sims.learning.inference.trusted_model import TrustedModel

FRAMES_AT_ONCE = 1_000
LEAST_VARIANCE = 1e-4
"""Of the process over its own scale squared: Q is kept in single precision, and no press is known that well."""


@dataclass(frozen=True, kw_only=True, eq=False)
class GaussianProcessModel(TrustedModel):
    """A touch classifier, a Gaussian process for the press, and the trust in its deviation.

    Attributes, beside those of every `TrustedModel`
    ----------
    length : length scale of the features [-]
    points : (point, feature) inducing points over the length scale [-]
    weights : (point, 3) A
    known : (point, point) Q [-]
    mean_mm, scale_mm : (3,) of the outputs [mm]
    """

    length: float
    points: FloatArray
    weights: FloatArray
    known: NDArray[np.float32]
    mean_mm: FloatArray
    scale_mm: FloatArray

    def press_and_spread_mm(self, signals: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(n, 3) mean and (n, 3) standard deviation of the process, before trust [mm]."""
        features = self.scaling.features(signals) / self.length
        press_mm, spread_mm = np.empty((2, len(features), 3))
        for start in range(0, len(features), FRAMES_AT_ONCE):
            rows = slice(start, start + FRAMES_AT_ONCE)
            kernel = exponential_kernel(features[rows], self.points)
            press_mm[rows] = self.mean_mm + self.scale_mm * (kernel @ self.weights)
            spread_mm[rows] = np.sqrt(self._variance(kernel))[:, None] * self.scale_mm
        return press_mm, spread_mm

    def _variance(self, kernel: FloatArray) -> FloatArray:
        """(n,) variance over the scale squared, of kernels (n, point)."""
        single = kernel.astype(np.float32)
        known = np.einsum("nm,nm->n", single @ self.known, single, dtype=np.float64)
        return np.asarray(np.maximum(1.0 - known, LEAST_VARIANCE))

    def arrays(self) -> Arrays:
        """The numbers that its file keeps."""
        return (
            self.touch.arrays()
            | self.scaling.arrays("process")
            | {
                "process_length": np.array([self.length]),
                "process_points": self.points,
                "process_weights": self.weights,
                "process_known": self.known,
                "process_mean_mm": self.mean_mm,
                "process_scale_mm": self.scale_mm,
            }
            | self.sigma.arrays()
        )


def exponential_kernel(one: FloatArray, other: FloatArray) -> FloatArray:
    """(n, m) kernels of samples (n, feature) and (m, feature), both over the length scale."""
    squares = np.square(one).sum(axis=1)[:, None] + np.square(other).sum(axis=1)[None]
    return np.asarray(np.exp(-np.sqrt(np.maximum(squares - 2.0 * one @ other.T, 0.0))))


def gaussian_process_of_arrays(header: ModelHeader, arrays: Arrays) -> GaussianProcessModel:
    """What `GaussianProcessModel.arrays` wrote; raises InputError where it does not fit."""
    pairs = len(header.untouched_counts)
    scaling = scaling_of_arrays(arrays, "process", pairs)
    length = float(taken(arrays, "process_length", (1,))[0])
    points = taken(arrays, "process_points", (None, len(scaling.kept)))
    count = len(points)
    if not (count and length > 0.0):
        raise InputError("process_points: there are none, or their length scale is not above 0")
    return GaussianProcessModel(
        header=header,
        touch=touch_svm_of_arrays(arrays, pairs),
        scaling=scaling,
        length=length,
        points=points,
        weights=taken(arrays, "process_weights", (count, 3)),
        known=taken(arrays, "process_known", (count, count)).astype(np.float32),
        mean_mm=taken(arrays, "process_mean_mm", (3,)),
        scale_mm=taken(arrays, "process_scale_mm", (3,)),
        sigma=sigma_table_of_arrays(arrays),
    )
