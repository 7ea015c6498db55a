"""Touch or not: the plane of a linear support vector machine.

score = w · feature + b; touched where it is above 0. Source: Cortes and Vapnik, Support-vector networks, Machine
Learning 20 (1995); the paper's touch classifier.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from design.arrays import FloatArray
from sims.learning.inference.feature_scaling import FeatureScaling, scaling_of_arrays
from sims.learning.inference.touch_model import Arrays, taken


@dataclass(frozen=True, kw_only=True, eq=False)
class TouchSvm:
    """A plane in the space of the features.

    Attributes
    ----------
    scaling : scaling of counts to features
    weights : (feature,) normal of the plane [-]
    bias : its offset [-]
    """

    scaling: FeatureScaling
    weights: FloatArray
    bias: float

    def score(self, signals: FloatArray) -> FloatArray:
        """(n,) signed distance to the plane, in units of the margin, of frames (n, pair) [-]."""
        return np.asarray(self.scaling.features(signals) @ self.weights + self.bias)

    def arrays(self) -> dict[str, NDArray[np.generic]]:
        """The arrays, named for a model's file."""
        return self.scaling.arrays("touch") | {
            "touch_weights": self.weights,
            "touch_bias": np.array([self.bias]),
        }


def touch_svm_of_arrays(arrays: Arrays, pairs: int) -> TouchSvm:
    """The plane from `TouchSvm.arrays`; raises InputError where the arrays do not fit."""
    scaling = scaling_of_arrays(arrays, "touch", pairs)
    weights = taken(arrays, "touch_weights", scaling.kept.shape)
    return TouchSvm(scaling=scaling, weights=weights, bias=float(taken(arrays, "touch_bias", (1,))[0]))
