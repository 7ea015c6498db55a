"""How far a press that was told lies from the one that was: what grid searches and held-out checks minimise."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


def location_error_mm(told_mm: FloatArray, press_mm: FloatArray) -> FloatArray:
    """(n,) distance in the plane of the pad [mm]."""
    return np.asarray(np.hypot(*(told_mm[:, :2] - press_mm[:, :2]).T))


def mean_error_mm(told_mm: FloatArray, press_mm: FloatArray) -> float:
    """Mean distance in the plane plus mean difference in depth [mm]: one figure for a search to minimise."""
    depth = np.abs(told_mm[:, 2] - press_mm[:, 2])
    return float(location_error_mm(told_mm, press_mm).mean() + depth.mean())
