"""The scalings of `sims.learning.inference.feature_scaling`, from training samples."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sims.learning.inference.feature_scaling import FeatureScaling

LEAST_SCALE_COUNTS = 1.0
"""About the noise of a reading less the off state (0.5 count each and the converter's steps): a pair whose signal
varies less than that is not blown up."""


def counts_scaling(kept: NDArray[np.intp]) -> FeatureScaling:
    """The readings as they are."""
    return FeatureScaling(kept=kept, centre=np.zeros(len(kept)), scale=np.ones(len(kept)))


def standard_scaling(kept: NDArray[np.intp], signals: NDArray[np.float32]) -> FeatureScaling:
    """Every pair by its own mean and standard deviation over samples (n, pair), at least the noise's.

    Parameters
    ----------
    kept : pairs that are used
    """
    used = signals[:, kept].astype(np.float64)
    return FeatureScaling(
        kept=kept, centre=used.mean(axis=0), scale=np.maximum(used.std(axis=0), LEAST_SCALE_COUNTS)
    )
