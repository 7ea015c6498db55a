"""Select the pairs that a model uses, and scale their counts to features.

    feature = (counts - centre) / scale

There are three scalings (docs/how-to/train-learner.md says which learner uses which):

* `counts`: centre 0 and one common scale, so that distances between features are proportional to those between
  readings.
* `standard`: each pair's mean and standard deviation over the training samples.
* `untouched`: each pair's mean and its spread over the training samples, at least the reading noise, so that the noise
  of weak pairs is not amplified.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from optopad.design.arrays import FloatArray
from optopad.design.errors import InputError
from optopad.sims.learning.inference.touch_model import Arrays, taken, taken_whole


@dataclass(frozen=True, kw_only=True, eq=False)
class FeatureScaling:
    """Conversion from counts to features.

    Attributes
    ----------
    kept : (feature,) indices in a frame of the pairs that are used
    centre, scale : (feature,) offset and divisor of each feature [counts]
    """

    kept: NDArray[np.intp]
    centre: FloatArray
    scale: FloatArray

    def features(self, signals: NDArray[np.floating[Any]]) -> FloatArray:
        """Features (n, feature) of frames (n, pair) [-]."""
        return np.asarray((signals[:, self.kept] - self.centre) / self.scale)

    def arrays(self, prefix: str) -> dict[str, NDArray[np.generic]]:
        """The scaling's arrays for a model file, by name; all names start with `prefix`."""
        return {
            f"{prefix}_kept": self.kept.astype(np.int32),
            f"{prefix}_centre": self.centre,
            f"{prefix}_scale": self.scale,
        }


def scaling_of_arrays(arrays: Arrays, prefix: str, pairs: int) -> FeatureScaling:
    """Make the scaling from its arrays in a model file.

    Parameters
    ----------
    arrays : arrays of the file by name
    prefix : common start of the names of the three arrays
    pairs : number of pairs in a frame

    Raises
    ------
    InputError : an array is missing or malformed, a pair is not in the frame, or a scale is not above 0.
    """
    kept = taken_whole(arrays, f"{prefix}_kept", (None,)).astype(np.intp)
    centre = taken(arrays, f"{prefix}_centre", kept.shape)
    scale = taken(arrays, f"{prefix}_scale", kept.shape)
    if not kept.size or kept.min() < 0 or kept.max() >= pairs or scale.min() <= 0.0:
        raise InputError(
            f"{prefix}: names pairs that the frame does not have, or scales that are not above 0"
        )
    return FeatureScaling(kept=kept, centre=centre, scale=scale)
