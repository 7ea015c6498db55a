"""The press that explains a frame best: a coarse table, then Gauss-Newton steps; numpy only.

Model
-----
For a press θ = (x, y, depth) the signals have the mean m(θ) and the covariance C of `reading_noise`. What is minimised
is the square of the residual in C⁻¹, which is minus twice the log-likelihood but for a constant,

    χ²(θ) = (y - m)ᵀ C⁻¹ (y - m),      step: (A + λ diag A) Δ = g,   A = JᵀC⁻¹J,   g = JᵀC⁻¹(y - m)

(Levenberg 1944, Marquardt 1963; J by the spline). The search starts at the table's best press and at its best ones
elsewhere, and stays inside a box: a coordinate at its border that wants to leave is held. At the end A⁻¹ is the
covariance of the press, the gains marginalised. Pairs that remain beyond `OUTLIER` deviations get Huber's weights,
and the search goes on from there: a reading that the model does not know moves the press less.

Left out: presses beyond the box, two tips at once, what other minima would say (the second start is compared by χ²
only), the spread of a flat χ² where the touch is too light to be located: there A⁻¹ is but a hint.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from design.arrays import FloatArray
from sims.learning.inference.signal_map.reading_noise import Whitening

Answers = Callable[[FloatArray], tuple[FloatArray, FloatArray]]
"""Signals (n, pair) and their slopes (n, 3, pair) at presses (n, 3)."""

STARTS = 3
ELSEWHERE_MM = 3.0
"""A further start is at least this far from those before it."""
STEPS = 9
AFTER_STEPS = 4
"""Steps at most, and after Huber's weights."""
MOST_PRODUCTS, MOST_ROWS = 250_000, 40
"""A block of the table times so many rows stays below the 262,144 products from which OpenBLAS shares a product of
matrices among threads: for one frame that gains nothing, and costs milliseconds where other work holds the cores."""
DONE_MM = 1e-3
"""Steps smaller than this end the search: far below the noise of any frame."""
DONE_SQUARE = 0.02
"""Steps that gain less in χ² end it too: a tenth of a standard deviation of the press; untouched frames are flat."""
FIRST_DAMPING = 1e-2
FACTOR = 6.0
OUTLIER = 4.0
"""Own deviations of a pair from which it loses weight."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Box:
    """Where presses are looked for: (3,) lowest and highest x, y, depth [mm]."""

    low: FloatArray
    high: FloatArray

    @property
    def prior_information(self) -> FloatArray:
        """(3, 3) of a press anywhere in the box alike [1/mm²]: keeps the covariance finite where nothing is told."""
        return np.asarray(np.diag(12.0 / (self.high - self.low) ** 2))


@dataclass(frozen=True, kw_only=True, eq=False)
class Found:
    """The best press of each frame.

    Attributes
    ----------
    press_mm : (n, 3) x, y, depth; covariance : (n, 3, 3) [mm²]
    square : (n,) χ² there [-]
    untouched_square : (n,) χ² of no press, with the same weights [-]
    """

    press_mm: FloatArray
    covariance: FloatArray
    square: FloatArray
    untouched_square: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class CoarseTable:
    """Presses (t, 3) to start from and their signals (t, pair)."""

    press_mm: FloatArray
    signals: FloatArray

    def starts(self, signals: FloatArray, seen: Whitening) -> FloatArray:
        """(n, STARTS, 3) presses to begin with: the best one, and the best ones far from those before."""
        square = self._squares(signals, seen)
        chosen = []
        for _ in range(STARTS):
            best = self.press_mm[np.argmin(square, axis=1)]
            distance = np.linalg.norm(self.press_mm[None, :, :2] - best[:, None, :2], axis=2)
            square = np.where(distance < ELSEWHERE_MM, np.inf, square)
            chosen.append(best)
        return np.stack(chosen, axis=1)

    @cached_property
    def _blocks(self) -> tuple[tuple[NDArray[np.float32], NDArray[np.float32]], ...]:
        """Signals (pair, few) and their squares, block by block, in single precision: they only choose starts."""
        by_pair = np.asarray(self.signals.T, dtype=np.float32)
        few = max(MOST_PRODUCTS // (by_pair.shape[0] * MOST_ROWS), 1)
        parts = (by_pair[:, start : start + few] for start in range(0, by_pair.shape[1], few))
        return tuple((np.ascontiguousarray(part), np.ascontiguousarray(part**2)) for part in parts)

    def _squares(self, signals: FloatArray, seen: Whitening) -> FloatArray:
        """(n, t) χ² of every press of the table, less what all have in common."""
        count, gains, pairs = seen.shared.shape
        own = (seen.shared @ signals[:, :, None]).astype(np.float32)
        shared = seen.shared.reshape(count * gains, pairs).astype(np.float32)
        weight, weighted = seen.weight.astype(np.float32), (seen.weight * signals).astype(np.float32)
        parts = []
        for block, squares in self._blocks:
            left = own - (shared @ block).reshape(count, gains, block.shape[1])
            parts.append(weight @ squares - 2.0 * (weighted @ block) - np.einsum("ngt,ngt->nt", left, left))
        return np.concatenate(parts, axis=1).astype(np.float64)


def found_presses(
    answers: Answers,
    table: CoarseTable,
    box: Box,
    signals: FloatArray,
    untouched: FloatArray,
    seen: Whitening,
) -> Found:
    """The best press of every frame.

    Parameters
    ----------
    answers : the signals of presses and their slopes [counts, counts/mm]
    signals : (n, pair) frames; untouched : (pair,) signals without a press [counts]
    seen : the frames' covariance
    """
    count = len(signals)
    starts = table.starts(signals, seen)
    twice = np.repeat(np.arange(count), STARTS)
    found = _Search(answers, box, signals[twice], seen.of(twice)).descend(starts.reshape(-1, 3), STEPS)
    pick = np.argmin(found.square.reshape(count, STARTS), axis=1) + STARTS * np.arange(count)
    place = found.of(pick)
    own = seen.own_deviations(signals - answers(place.press)[0])
    untouched_square = seen.square(signals - untouched)
    wild = np.flatnonzero((np.abs(own) > OUTLIER).any(axis=1))
    if len(wild):
        softened = seen.of(wild).softened(own[wild], OUTLIER)
        again = _Search(answers, box, signals[wild], softened).descend(place.press[wild], AFTER_STEPS)
        place = place.replaced(wild, again)
        untouched_square[wild] = softened.square(signals[wild] - untouched)
    return Found(
        press_mm=place.press,
        covariance=np.asarray(np.linalg.inv(place.matrix + box.prior_information)),
        square=place.square,
        untouched_square=untouched_square,
    )


@dataclass(frozen=True, eq=False)
class _Place:
    """Presses (n, 3), χ² there (n,) and A (n, 3, 3)."""

    press: FloatArray
    square: FloatArray
    matrix: FloatArray

    def of(self, rows: NDArray[np.intp]) -> _Place:
        """Some of the frames."""
        return _Place(self.press[rows], self.square[rows], self.matrix[rows])

    def replaced(self, rows: NDArray[np.intp], other: _Place) -> _Place:
        """With some frames' places replaced."""
        merged = [one.copy() for one in (self.press, self.square, self.matrix)]
        for one, new in zip(merged, (other.press, other.square, other.matrix), strict=True):
            one[rows] = new
        return _Place(*merged)


@dataclass(frozen=True, eq=False)
class _Search:
    """Gauss-Newton steps of many frames side by side."""

    answers: Answers
    box: Box
    signals: FloatArray
    seen: Whitening

    def descend(self, press: FloatArray, steps: int) -> _Place:
        """Some steps downhill."""
        press = np.clip(press, self.box.low, self.box.high)
        square, matrix, slope = self._normal(press)
        damping = np.full(len(press), FIRST_DAMPING)
        is_done = np.zeros(len(press), dtype=np.bool_)
        for _ in range(steps):
            trial = np.clip(press + self._step(press, matrix, slope, damping), self.box.low, self.box.high)
            new_square, new_matrix, new_slope = self._normal(trial)
            is_better = new_square < square
            is_done |= np.abs(trial - press).max(axis=1) < DONE_MM
            is_done |= is_better & (square - new_square < DONE_SQUARE)
            press = np.where(is_better[:, None], trial, press)
            matrix = np.where(is_better[:, None, None], new_matrix, matrix)
            slope = np.where(is_better[:, None], new_slope, slope)
            square = np.where(is_better, new_square, square)
            damping = np.where(is_better, damping / FACTOR, damping * FACTOR)
            if is_done.all():
                break
        return _Place(press, square, matrix)

    def _normal(self, press: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """χ² (n,), A (n, 3, 3) and g (n, 3)."""
        mean, slopes = self.answers(press)
        residual = self.signals - mean
        weighted = slopes * self.seen.weight[:, None, :]
        shared = self.seen.shared @ np.swapaxes(slopes, 1, 2)
        own = self.seen.shared @ residual[:, :, None]
        back = np.swapaxes(shared, 1, 2)
        matrix = weighted @ np.swapaxes(slopes, 1, 2) - back @ shared
        slope = (weighted @ residual[:, :, None] - back @ own)[:, :, 0]
        square = (self.seen.weight * residual**2).sum(axis=1) - (own**2).sum(axis=(1, 2))
        return square, matrix, slope

    def _step(
        self, press: FloatArray, matrix: FloatArray, slope: FloatArray, damping: FloatArray
    ) -> FloatArray:
        """(n, 3) damped steps; a coordinate that would leave the box stays."""
        is_held = ((press <= self.box.low) & (slope < 0)) | ((press >= self.box.high) & (slope > 0))
        is_free = ~is_held
        both = is_free[:, :, None] & is_free[:, None, :]
        diagonal = np.einsum("nii->ni", matrix) * (1.0 + damping[:, None]) + 1e-9
        damped = np.where(both, matrix, 0.0)
        axes = np.arange(3)
        damped[:, axes, axes] = np.where(is_free, diagonal, 1.0)
        return np.asarray(np.linalg.solve(damped, np.where(is_free, slope, 0.0)[:, :, None])[:, :, 0])
