"""Estimate (x, y, depth) by kernel ridge regression with the Laplacian kernel, as in the paper.

    f(s) = m + Σ_i a_i exp(-γ |s - s_i|₁)        sum over the kept training samples s_i

with features s, mean press m, weights a_i, and |.|₁ the sum of absolute differences. The samples are stored in single
precision because a frame is compared with each of them, and reading them from memory takes most of the time.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from optopad.design.arrays import FloatArray
from optopad.design.errors import InputError
from optopad.sims.learning.inference.header import ModelHeader
from optopad.sims.learning.inference.touch_model import (
    Arrays,
    FeatureScaling,
    Prediction,
    TouchSvm,
    checked_signals,
    prediction_of,
    scaling_of_arrays,
    taken,
    touch_svm_of_arrays,
)

Float32Array = NDArray[np.float32]

BLOCK = 512
"""Number of stored samples that are compared with a frame at once: their differences fit into the processor's cache."""


@dataclass(frozen=True, kw_only=True, eq=False)
class KernelRidgeModel:
    """The paper's model: a support vector machine for touch, then kernel ridge regression for the press.

    Attributes
    ----------
    header : description of the model and its training data
    touch : touch classifier
    scaling : scaling of the features of the regression
    samples : (kept, feature) features of the stored training samples [-]
    weights : (kept, 3) weights of each stored sample for x, y, depth [mm]
    mean_mm : (3,) mean press of the training samples [mm]
    gamma : γ of the kernel, per unit of L1 distance between features [-]
    """

    header: ModelHeader
    touch: TouchSvm
    scaling: FeatureScaling
    samples: Float32Array
    weights: FloatArray
    mean_mm: FloatArray
    gamma: float

    def predict(self, signals: FloatArray) -> Prediction:
        """Predictions for frames (n, pair) [counts]."""
        signals = checked_signals(self.header, signals)
        features = self.scaling.features(signals).astype(np.float32)
        press_mm = np.array([self._press_mm(one) for one in features]).reshape(-1, 3)
        return prediction_of(self.header, self.touch.score(signals), press_mm)

    def _press_mm(self, feature: Float32Array) -> FloatArray:
        kernel = np.exp(-self.gamma * l1_distances(self.samples, feature).astype(np.float64))
        return np.asarray(self.mean_mm + kernel @ self.weights)

    def arrays(self) -> Arrays:
        """The model's arrays, by their names in its file."""
        return (
            self.touch.arrays()
            | self.scaling.arrays("ridge")
            | {
                "ridge_samples": self.samples,
                "ridge_weights": self.weights,
                "ridge_mean_mm": self.mean_mm,
                "ridge_gamma": np.array([self.gamma]),
            }
        )


def l1_distances(samples: Float32Array, feature: Float32Array) -> Float32Array:
    """L1 distances (kept,) between one sample (feature,) and the stored samples (kept, feature)."""
    distances = np.empty(len(samples), np.float32)
    ones = np.ones(samples.shape[1], np.float32)
    work = np.empty((min(BLOCK, len(samples)), samples.shape[1]), np.float32)
    for start in range(0, len(samples), BLOCK):
        block = samples[start : start + BLOCK]
        room = work[: len(block)]
        np.subtract(block, feature, out=room)
        np.abs(room, out=room)
        np.dot(room, ones, out=distances[start : start + BLOCK])
    return distances


def kernel_ridge_of_arrays(header: ModelHeader, arrays: Arrays) -> KernelRidgeModel:
    """Make the model from its header and arrays in a file; raises `InputError` if the arrays are inconsistent."""
    pairs = len(header.untouched_counts)
    scaling = scaling_of_arrays(arrays, "ridge", pairs)
    samples = taken(arrays, "ridge_samples", (None, len(scaling.kept)))
    gamma = float(taken(arrays, "ridge_gamma", (1,))[0])
    if not gamma > 0.0:
        raise InputError(f"ridge_gamma: {gamma} is not above 0")
    return KernelRidgeModel(
        header=header,
        touch=touch_svm_of_arrays(arrays, pairs),
        scaling=scaling,
        samples=np.ascontiguousarray(samples, dtype=np.float32),
        weights=taken(arrays, "ridge_weights", (len(samples), 3)),
        mean_mm=taken(arrays, "ridge_mean_mm", (3,)),
        gamma=gamma,
    )
