"""Summaries of bounds over a volume, each with the ends that the error of the light trace leaves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from design.arrays import FloatArray
from sims.bounds.defaults import BAND
from sims.bounds.fisher import Bounds

ROUND_OFF_DIGITS = 12
"""Decimals of a share that are more than round-off."""


@dataclass(frozen=True, kw_only=True)
class Figure:
    """A number and the ends of its band; infinite where not bounded."""

    value: float
    low: float
    high: float

    def percent(self) -> str:
        """A share in whole per cent, with its ends where they round to others."""
        same = round(100 * self.low) == round(100 * self.high)
        return f"{self.value:.0%}" if same else f"{self.value:.0%} ({self.low:.0%} to {self.high:.0%})"

    def complement(self) -> Figure:
        """One minus it, of a share: sums of shares are off by round-off, which is cut off."""
        value, low, high = (
            max(0.0, round(1.0 - share, ROUND_OFF_DIGITS)) for share in (self.value, self.high, self.low)
        )
        return Figure(value=value, low=low, high=high)


def depth_weights(depth_mm: Sequence[float] | FloatArray, max_depth_mm: float) -> FloatArray:
    """(n,) share of 0 to the deepest press that each depth stands for: half-way to its neighbours [-].

    Parameters
    ----------
    depth_mm : (n,) rising depths
    max_depth_mm : where the last share ends
    """
    depth = np.asarray(depth_mm, dtype=np.float64)
    edges = np.concatenate([[0.0], 0.5 * (depth[1:] + depth[:-1]), [max_depth_mm]])
    return np.asarray(np.diff(edges) / max_depth_mm)


def median_of(values: FloatArray, errors: FloatArray, weight: FloatArray) -> Figure:
    """Weighted median of bounds, and of all of them lowered and raised by `BAND` standard errors."""
    low, high = _ends(values, errors)
    return Figure(
        value=_median(values, weight),
        low=_median(low, weight),
        high=_median(high, weight),
    )


def share_of(bounds: Bounds, location_mm: float, depth_mm: float, weight: FloatArray) -> Figure:
    """Share of the volume that is not blind and has both bounds below the limits [-]."""
    location_low, location_high = _ends(bounds.location_mm, bounds.location_error_mm)
    depth_low, depth_high = _ends(bounds.depth_mm, bounds.depth_error_mm)

    def share(location: FloatArray, depth: FloatArray) -> float:
        is_inside = np.isfinite(location) & (location < location_mm) & (depth < depth_mm)
        return float(weight[is_inside].sum())

    return Figure(
        value=share(bounds.location_mm, bounds.depth_mm),
        low=share(location_high, depth_high),
        high=share(location_low, depth_low),
    )


def _ends(values: FloatArray, errors: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Values less and plus `BAND` errors; infinite ones stay so."""
    is_known = np.isfinite(values)
    moved = BAND * np.where(is_known, errors, 0.0)
    return np.maximum(values - moved, 0.0), values + moved


def _median(values: FloatArray, weight: FloatArray) -> float:
    order = np.argsort(values, axis=None)
    total = np.cumsum(weight.ravel()[order])
    return float(values.ravel()[order[min(np.searchsorted(total, 0.5 * total[-1]), order.size - 1)]])
