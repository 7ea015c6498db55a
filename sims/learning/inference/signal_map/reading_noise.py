"""What readings may be off by, as one normal distribution a frame; numpy only.

Model
-----
Signals y of all pairs (lit reading less the off state) have the covariance

    C = V + G Gᵀ,   V = diag (floor² + shot y + (relative y)²),   G = [δₑ y by emitter | δᵣ y by receiver]

V is noise that every reading has of its own (electronics and rounding of both readings, photons, whatever else grows
with the signal, the map's own error). G is a gain of each emitter and of each receiver that nobody knows better than δ:
an LED's fluctuation from frame to frame, and drift since the untouched signals were taken. Marginalising over a normal
prior of the gains is adding G Gᵀ (Rasmussen and Williams 2006, eq. 2.40). So

    aᵀC⁻¹b = aᵀWb - (Ha)ᵀ(Hb),   W = V⁻¹,   H = L⁻¹GᵀW,   LLᵀ = 1 + GᵀWG        (Woodbury)

with the signals measured in place of their means: one factorisation a frame, the same for every press that is tried,
so that likelihoods of presses, and of none, compare. A reading at full scale tells nothing (its weight is 0).

Left out: the log-determinant's change with the press, drift of the off state, errors that pairs share otherwise.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from design.arrays import FloatArray

CLIP_MARGIN = 3.0
"""A reading within this many standard deviations of full scale counts as clipped."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ReadingNoise:
    """Noise of a sensor's signals.

    Attributes
    ----------
    floor_counts : (pair,) standard deviation of a signal without light of its own [counts]
    shot : variance over signal [counts]
    relative : standard deviation of a signal over itself, every pair for itself [-]
    emitter_drift, receiver_drift : standard deviation of a gain, each part for itself [-]
    emitters : how many; the pairs are emitter by emitter
    clip_counts : (pair,) signal above which the converter clips [counts]; infinite where that is not known
    """

    floor_counts: FloatArray
    shot: float
    relative: float
    emitter_drift: float
    receiver_drift: float
    emitters: int
    clip_counts: FloatArray

    @property
    def receivers(self) -> int:
        """How many."""
        return len(self.floor_counts) // self.emitters

    def variance(self, signals: FloatArray) -> FloatArray:
        """(n, pair) variance of each signal on its own [counts²]."""
        shot = self.shot * np.maximum(signals, 0.0)
        return np.asarray(self.floor_counts**2 + shot + (self.relative * signals) ** 2)

    def gain_columns(self, signals: FloatArray) -> FloatArray:
        """(n, gain, pair) what a standard deviation of each gain does to the signals [counts]."""
        by_emitter = np.repeat(np.eye(self.emitters), self.receivers, axis=1) * self.emitter_drift
        by_receiver = np.tile(np.eye(self.receivers), (1, self.emitters)) * self.receiver_drift
        return np.concatenate([by_emitter, by_receiver]) * signals[:, None, :]

    def seen_in(self, signals: FloatArray) -> Whitening:
        """The covariance of frames (n, pair), ready for products."""
        variance = self.variance(signals)
        is_clipped = signals >= self.clip_counts - CLIP_MARGIN * np.sqrt(variance)
        return whitening(np.where(is_clipped, 0.0, 1.0 / variance), self.gain_columns(signals))


@dataclass(frozen=True, kw_only=True, eq=False)
class Whitening:
    """The inverse covariance of n frames, aᵀC⁻¹b = aᵀWb - (Ha)ᵀ(Hb).

    Attributes
    ----------
    weight : (n, pair) W [1/counts²]
    gains : (n, gain, pair) G
    shared : (n, gain, pair) H [1/counts]
    """

    weight: FloatArray
    gains: FloatArray
    shared: FloatArray

    def square(self, residual: FloatArray) -> FloatArray:
        """(n,) rᵀC⁻¹r of residuals (n, pair) [counts]."""
        shared = (self.shared @ residual[:, :, None])[:, :, 0]
        return np.asarray((self.weight * residual**2).sum(axis=1) - (shared**2).sum(axis=1))

    def of(self, rows: FloatArray | slice | NDArray[np.intp]) -> Whitening:
        """Some of the frames."""
        return Whitening(weight=self.weight[rows], gains=self.gains[rows], shared=self.shared[rows])

    def own_deviations(self, residual: FloatArray) -> FloatArray:
        """(n, pair) residuals less what the gains explain, in each pair's own standard deviations [-]."""
        shared = (self.shared @ residual[:, :, None])[:, :, 0]
        factor = _factor(self.weight, self.gains)
        gains = np.linalg.solve(np.swapaxes(factor, 1, 2), shared[:, :, None])[:, :, 0]
        explained = (gains[:, None, :] @ self.gains)[:, 0]
        return np.asarray((residual - explained) * np.sqrt(self.weight))

    def softened(self, own_deviations: FloatArray, limit: float) -> Whitening:
        """The same with less weight to pairs (n, pair) whose own deviation exceeds a limit (Huber's weights)."""
        excess = np.maximum(np.abs(own_deviations) / limit, 1.0)
        return whitening(self.weight / excess, self.gains)


def whitening(weight: FloatArray, gains: FloatArray) -> Whitening:
    """Of weights (n, pair) and gains (n, gain, pair)."""
    shared = np.asarray(np.linalg.solve(_factor(weight, gains), gains * weight[:, None, :]))
    return Whitening(weight=weight, gains=gains, shared=shared)


def _factor(weight: FloatArray, gains: FloatArray) -> FloatArray:
    """(n, gain, gain) lower triangle L of 1 + GᵀWG."""
    inner = (gains * weight[:, None, :]) @ np.swapaxes(gains, 1, 2)
    return np.asarray(np.linalg.cholesky(inner + np.eye(gains.shape[1])))
