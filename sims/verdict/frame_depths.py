"""What one frame of all judged readings tells of depth at a place: told apart, deadband, fade.

Model
-----
A frame is the readings of all judged pairs, limited at full scale, on the scale of noise units u. Two depths are told
apart if their frames are at least 3 noise units apart,

    D²(a, b) = Σ over pairs (u(b) - u(a))²  >=  3².

A place is blind over an interval of at least 0.3 mm of which no two depths are told apart; intervals that overlap are
one. One after which the signal comes back is a deadband; one that runs to the deepest press is fade: there the range
ends. With one pair this is the pair's own deadband (`pair.deadbands`).

The light's own error would pass for distance. Light traced twice with other random offsets gives independent halves A
and B, and Σ ΔA ΔB has the mean D²: errors average out. The halves' scatter, σ² = Σ (ΔA - ΔB)² / 4n over n pairs, gives
the standard deviation of that sum, 2 σ √(D² + n σ²); less than two of them from the threshold is open. Where light was
traced once, D² lies between the sum of squares and that less 2 Σ (s²(a) + s²(b)), s its standard errors: those of two
depths may add, though with common offsets they mostly cancel, and the sum as it is is believed most.

Between the depths traced, frames lie on straight lines; windows start every 0.02 mm.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from design.arrays import BoolArray, FloatArray
from sims.verdict.pair.defaults import DEADBAND_MIN_LENGTH_MM, DEADBAND_THRESHOLD
from sims.verdict.pair.depth_curve import interpolated

Interval = tuple[float, float]

STEPS = 15
"""Steps of a window of 0.3 mm."""
SURE = 2.0
"""Standard deviations from the threshold beyond which a distance is no longer open."""
BOUND = 2.0
"""Variances of light traced once that are taken off its distances at most: errors of two depths may add or cancel."""


@dataclass(frozen=True, kw_only=True)
class Frames:
    """The readings of a place against depth.

    Attributes
    ----------
    depth_mm : (n,) increasing depths from 0 [mm]
    halves : (2, n, pair) readings by independent traces, limited at full scale; twice the same where traced once
        [noise units]
    variance : (n,) of the trace, summed over pairs, where it was traced once; 0 elsewhere
    """

    depth_mm: FloatArray
    halves: FloatArray
    variance: FloatArray


@dataclass(frozen=True, kw_only=True)
class Blindness:
    """Where in depth a place is blind.

    Attributes
    ----------
    deadbands_mm : intervals after which the signal comes back [mm]
    usable_mm : where the last one begins that runs to the deepest press, else the deepest press [mm]
    """

    deadbands_mm: tuple[Interval, ...]
    usable_mm: float


@dataclass(frozen=True, kw_only=True)
class DepthReading:
    """What frames of a place tell of depth.

    Attributes
    ----------
    blind : by the distances believed most
    least, most : blind as little and as much as the light's own error allows
    margin, margin_error : of the least told 0.3 mm before the range ends, the distance of its most distant frames and
        what the light's error may add to it [noise units]
    margin_mm : where that is [mm]
    open_mm : depths, in order, of windows that the light's error leaves open; they may overlap [mm]
    """

    blind: Blindness
    least: Blindness
    most: Blindness
    margin: float
    margin_error: float
    margin_mm: Interval
    open_mm: tuple[Interval, ...]

    @property
    def is_open(self) -> bool:
        """Whether the light's own error may make or hide a deadband."""
        return bool(self.least.deadbands_mm) != bool(self.most.deadbands_mm)

    @property
    def usable_range_mm(self) -> Interval:
        """Least and most depth that may be usable [mm]."""
        return self.most.usable_mm, self.least.usable_mm


def read_depths(
    frames: Frames, *, threshold: float = DEADBAND_THRESHOLD, min_length_mm: float = DEADBAND_MIN_LENGTH_MM
) -> DepthReading:
    """Judge a place.

    Parameters
    ----------
    frames : of the place, to a deepest press of at least the shortest deadband
    threshold : distance at which two depths are told apart [noise units]
    min_length_mm : shortest interval that counts [mm]
    """
    deepest = float(frames.depth_mm[-1])
    step = min(min_length_mm, deepest) / STEPS
    starts = np.arange(0.0, deepest - STEPS * step + 0.5 * step, step)
    grid_mm = np.asarray(step * np.arange(len(starts) + STEPS), dtype=np.float64)
    low, mean, high = (_widest(distances) for distances in _square_distances(frames, grid_mm))
    limit = threshold**2
    blind, least, most = (
        _blindness(starts, STEPS * step, squares < limit, deepest) for squares in (mean, high, low)
    )
    told = starts < max(blind.usable_mm, step)
    at = int(np.argmin(np.where(told, mean, np.inf)))
    margin = float(np.sqrt(max(mean[at], 0.0)))
    is_open = (low < limit) & (high >= limit)
    return DepthReading(
        blind=blind,
        least=least,
        most=most,
        margin=margin,
        margin_error=float(np.sqrt(max(high[at], 0.0))) - margin,
        margin_mm=(float(starts[at]), float(starts[at] + STEPS * step)),
        open_mm=tuple((float(a), float(a + STEPS * step)) for a in starts[is_open]),
    )


def _square_distances(frames: Frames, at_mm: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(m, m) squared distances of the frames at some depths: at least, believed most, at most."""
    one, two = (interpolated(frames.depth_mm, half, at_mm) for half in frames.halves)
    once = interpolated(frames.depth_mm, frames.variance[:, None], at_mm)[:, 0]
    pairs = one.shape[1]
    square = _from_products(one @ two.T)
    apart = 0.5 * (one - two)
    sigma2 = np.maximum(_from_products(apart @ apart.T), 0.0) / pairs
    deviation = 2.0 * np.sqrt(sigma2 * (np.maximum(square, 0.0) + pairs * sigma2))
    doubt = once[:, None] + once[None, :]
    return square - BOUND * doubt - SURE * deviation, square, square + SURE * deviation


def _from_products(products: FloatArray) -> FloatArray:
    """(m, m) products of differences a(j) - a(i) with b(j) - b(i), from those of a(i) with b(j)."""
    own = np.diag(products)
    return np.asarray(own[:, None] + own[None, :] - products - products.T)


def _widest(square: FloatArray) -> FloatArray:
    """(start,) largest squared distance of two frames within each window."""
    count = len(square) - STEPS
    widest = np.full(count, -np.inf)
    for lag in range(1, STEPS + 1):
        apart = np.diagonal(square, lag)
        windows = np.lib.stride_tricks.sliding_window_view(apart, STEPS + 1 - lag)[:count]
        widest = np.maximum(widest, windows.max(axis=1))
    return widest


def _blindness(starts: FloatArray, length: float, is_blind: BoolArray, deepest: float) -> Blindness:
    """Deadbands and usable depth from which windows are blind."""
    merged: list[list[float]] = []
    for start in starts[is_blind]:
        if merged and start <= merged[-1][1] + 1e-9:
            merged[-1][1] = float(start + length)
        else:
            merged.append([float(start), float(start + length)])
    usable = deepest
    if merged and is_blind[-1]:
        usable = merged.pop()[0]
    return Blindness(deadbands_mm=tuple((a, b) for a, b in merged), usable_mm=usable)
