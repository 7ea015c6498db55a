"""Detect touch by the plane of a linear support vector machine.

score = w · feature + b; touch if it is above 0. This is the paper's touch classifier. Source: Cortes and Vapnik,
Support-vector networks, Machine Learning 20 (1995).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from optopad.design.arrays import FloatArray
from optopad.sims.learning.inference.feature_scaling import FeatureScaling, scaling_of_arrays
from optopad.sims.learning.inference.touch_model import Arrays, taken


@dataclass(frozen=True, kw_only=True, eq=False)
class TouchSvm:
    """A plane in the space of the features that separates touch from no touch.

    Attributes
    ----------
    scaling : scaling of counts to features
    weights : (feature,) w, normal of the plane [-]
    bias : b, offset of the plane [-]
    """

    scaling: FeatureScaling
    weights: FloatArray
    bias: float

    def score(self, signals: FloatArray) -> FloatArray:
        """Score (n,) of frames (n, pair); above 0 means touch [-].

        It is the signed distance from the plane, in units of the margin.
        """
        return np.asarray(self.scaling.features(signals) @ self.weights + self.bias)

    def arrays(self) -> dict[str, NDArray[np.generic]]:
        """The classifier's arrays, by their names in a model file."""
        return self.scaling.arrays("touch") | {
            "touch_weights": self.weights,
            "touch_bias": np.array([self.bias]),
        }


def touch_svm_of_arrays(arrays: Arrays, pairs: int) -> TouchSvm:
    """Make the classifier from its arrays in a model file; raises `InputError` if they are inconsistent."""
    scaling = scaling_of_arrays(arrays, "touch", pairs)
    weights = taken(arrays, "touch_weights", scaling.kept.shape)
    return TouchSvm(scaling=scaling, weights=weights, bias=float(taken(arrays, "touch_bias", (1,))[0]))
