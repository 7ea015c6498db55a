"""How far a press that was told lies from the one that was: what grid searches and held-out checks minimise."""

from __future__ import annotations

import numpy as np

from design.arrays import FloatArray

FROM_DEPTH_MM = 1.0
"""Lighter presses change few pairs: where they are is hardly in the signal, and would hide what a learner does."""


def location_error_mm(told_mm: FloatArray, press_mm: FloatArray) -> FloatArray:
    """(n,) distance in the plane of the pad [mm]."""
    return np.asarray(np.hypot(*(told_mm[:, :2] - press_mm[:, :2]).T))


def held_out_figures(told_mm: FloatArray, press_mm: FloatArray) -> dict[str, float]:
    """Medians at samples of `FROM_DEPTH_MM` and more that the fit did without, for a model's header [mm]."""
    deep = press_mm[:, 2] >= FROM_DEPTH_MM
    if not deep.any():
        return {}
    told_mm, press_mm = told_mm[deep], press_mm[deep]
    return {
        "held_out_location_mm": float(np.median(location_error_mm(told_mm, press_mm))),
        "held_out_depth_mm": float(np.median(np.abs(told_mm[:, 2] - press_mm[:, 2]))),
    }


def mean_error_mm(told_mm: FloatArray, press_mm: FloatArray) -> float:
    """Mean distance in the plane plus mean difference in depth [mm]: one figure for a search to minimise."""
    depth = np.abs(told_mm[:, 2] - press_mm[:, 2])
    return float(location_error_mm(told_mm, press_mm).mean() + depth.mean())
