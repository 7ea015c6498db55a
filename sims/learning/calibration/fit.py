"""Parameters of a build from its readings: Gauss-Newton on traced light, gains and reference depths along.

Model
-----
Signals of sample s and pair (i, j) under unknown parameters u (in spreads of their doubt, about its middle),

    y_s,ij = gᵢ hⱼ F_s,ij(u, press_s + δ) + n,     F the light model, g, h the gains

with normal priors: u of mean 0 and spread 1; the tip of every press beside where the stage says it is, δ, of spread
`stage_mm` in x, y and depth; the logarithms of gains of spread `GAIN_SPREAD` about those that the untouched signals
tell. n is the chain's noise, and a model error of `MODEL_SHARE` of the untouched signal: the trace's own, walls near
the tip. The untouched signals count as one more sample without δ. Minimised by Gauss-Newton steps on all unknowns at
once,

    (AᵀA + P) Δ = Aᵀr - P(Δ₀),    A and r in standard deviations of n, P the priors' information

F is traced at each step; its slopes by u come from differences at the start and once more near the end, and follow
Broyden's rank-one rule between (Broyden 1965), so that a step costs one trace. The light model's offsets have one seed
throughout: differences are of the parameters, not of the rays. Steps end at the doubt's ends.

What the data tell of u is the information that the other unknowns leave, I = Uᵀ(1 - N(NᵀN + P)⁻¹Nᵀ)U, U the slopes by
u, N by all else. Slopes that carry the light's own noise would invent information (`sims.bounds.fisher`), so U comes
twice, the second time with light of another seed, and I is their symmetrised product, less two standard errors that
the light leaves, negative ones taken as none. The covariance of u is (I + 1)⁻¹; over that of the prior, 1, it says what
the data determine (`report`). Left out: scatter from part to part, several minima, errors of contact and light model
that are no noise: on hidden builds values are off by several of these deviations (docs/validation/calibration.md).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sims.bounds.defaults import TOLD_FROM_ZERO
from sims.learning.calibration.samples import CalibrationSamples
from sims.learning.inference.reading_noise import ReadingNoise
from sims.learning.map_learner import fitted_gains

FloatArray = NDArray[np.float64]
Light = Callable[[FloatArray, FloatArray, int], FloatArray]
"""Flux (n, pair) of parameters (unknown,) in spreads and presses (n, 3), depth 0 untouched; light of half 0 or 1."""
OnStep = Callable[[str, float], None]

GAIN_SPREAD = 0.5
MODEL_SHARE = 0.004
SLOPE_STEP = 0.5
"""Step of the differences by a parameter, in spreads of its doubt."""
PLACE_MM = 0.1
"""Light is traced at places rounded to this and carried to the place itself by the slopes: what a stage's error had
kept apart is symmetric again, and traced once. Over half of it a signal of 300 counts bends by about 0.1 counts."""
PRESS_STEP_MM = 0.1
"""Step of the differences by x, y and depth, half of it to either side."""
STEPS = 3, 6
"""Steps with slopes that follow Broyden's rule, before and after slopes are taken anew."""
DONE = 0.01
"""Steps smaller than this in every parameter end a round, in spreads."""
SMALL_FLUX = 1e-12


@dataclass(frozen=True, kw_only=True, eq=False)
class Fitted:
    """The parameters of a build.

    Attributes
    ----------
    values : (unknown,) in spreads of their doubt about its middle [-]
    covariance : (unknown, unknown) of values [-]
    gains : (pair,) counts per flux, a product of emitter's and receiver's
    gain_spread : (pair,) relative standard deviation of the gains [-]
    offset_mm : (press, 3) tip beside the stage, x, y and depth [mm]
    rms : (2,) root mean square residual before and after, in standard deviations [-]
    traces : how often the light of all samples was traced
    """

    values: FloatArray
    covariance: FloatArray
    gains: FloatArray
    gain_spread: FloatArray
    offset_mm: FloatArray
    rms: tuple[float, float]
    traces: int


@dataclass(eq=False)
class _Problem:
    """Samples, light and priors of one calibration; counts the traces."""

    light: Light
    samples: CalibrationSamples
    noise: ReadingNoise
    low: FloatArray
    high: FloatArray
    stage_mm: FloatArray
    on_step: OnStep
    expected: int
    traces: int = 0

    def __post_init__(self) -> None:
        rows, pairs = self.samples.signals.shape
        mean = self.samples.untouched.mean_counts
        self.signals = np.concatenate([self.samples.signals, mean[None]])
        self.press_mm = np.concatenate([self.samples.press_mm, [[*self.samples.press_mm[0, :2], 0.0]]])
        clip = self.samples.untouched.clip_counts
        variance = self.noise.variance(self.signals) + (MODEL_SHARE * np.maximum(mean, np.median(mean))) ** 2
        drift = np.hypot(self.noise.emitter_drift, self.noise.receiver_drift)
        variance += (drift * self.signals) ** 2
        is_lost = self.signals >= clip - 3.0 * np.sqrt(variance)
        self.weight = np.where(is_lost, 0.0, variance**-0.5)
        names = np.divmod(np.arange(pairs), pairs // self.samples.emitters)
        self.parts = np.concatenate(
            [np.eye(self.samples.emitters)[names[0]], np.eye(pairs // self.samples.emitters)[names[1]]],
            axis=1,
        )
        self.of_press = np.zeros((rows + 1, self.samples.presses))
        self.of_press[np.arange(rows), self.samples.press] = 1.0
        self.offset_information = np.tile(self.stage_mm**-2.0, self.samples.presses)
        self.rounded_mm = self.press_mm.copy()
        self.rounded_mm[:, :2] = np.round(self.press_mm[:, :2] / PLACE_MM) * PLACE_MM

    def flux(self, values: FloatArray, *, moved_mm: FloatArray | None = None, half: int = 0) -> FloatArray:
        """(sample, pair) light of parameters at the rounded places, moved by (3,); untouched in the last row."""
        press_mm = self.rounded_mm.copy()
        if moved_mm is not None:
            press_mm[:-1] += moved_mm
        self.traces += 1
        self.on_step("calibration", min(self.traces / self.expected, 1.0))
        return np.maximum(self.light(values, press_mm, half), SMALL_FLUX)

    def slopes(self, values: FloatArray, half: int) -> FloatArray:
        """(unknown, sample, pair) change of light with each parameter, by differences towards the inside."""
        flux = self.flux(values, half=half)
        found = []
        for axis in range(len(values)):
            side = SLOPE_STEP if values[axis] + SLOPE_STEP <= self.high[axis] else -SLOPE_STEP
            moved = values.copy()
            moved[axis] += side
            found.append((self.flux(moved, half=half) - flux) / side)
        return np.array(found)

    def press_slopes(self, values: FloatArray) -> FloatArray:
        """(3, sample, pair) change of light with x, y and depth of the press [1/mm]."""
        found = []
        for axis in 0.5 * PRESS_STEP_MM * np.eye(3):
            above, below = (self.flux(values, moved_mm=side * axis) for side in (1.0, -1.0))
            found.append((above - below) / PRESS_STEP_MM)
        return np.array(found)


def fitted(
    light: Light,
    samples: CalibrationSamples,
    noise: ReadingNoise,
    *,
    start: FloatArray,
    low: FloatArray,
    high: FloatArray,
    stage_mm: FloatArray,
    on_step: OnStep | None = None,
) -> Fitted:
    """Fit a build.

    Parameters
    ----------
    light : the light model
    noise : of one reading, by the chain
    start, low, high : (unknown,) where the fit begins, and the ends, in spreads
    stage_mm : (3,) standard deviations of where a press really is, beside the stage's x, y and depth [mm]
    on_step : called with ``calibration`` and about the share that is done
    """
    problem = _Problem(
        light, samples, noise, low, high, stage_mm, on_step or (lambda _stage, _share: None),
        expected=3 * (len(start) + 1) + sum(STEPS) + 13,
    )  # fmt: skip
    state = _State(problem, start, problem.flux(start), problem.press_slopes(start))
    first = state.rms
    state.slopes = problem.slopes(state.values, 0)
    state.descend(STEPS[0])
    state.by_press = problem.press_slopes(state.values)
    state.log_gains, state.offset_mm = state.inner(state.flux)
    halves = [problem.slopes(state.values, half) for half in range(2)]
    state.slopes = 0.5 * (halves[0] + halves[1])
    state.descend(STEPS[1])
    gains = state.gain_covariance()
    problem.on_step("calibration", 1.0)
    return Fitted(
        values=state.values,
        covariance=state.covariance(halves),
        gains=np.exp(problem.parts @ state.log_gains),
        gain_spread=np.sqrt(np.einsum("ki,ij,kj->k", problem.parts, gains, problem.parts)),
        offset_mm=state.offset_mm.reshape(-1, 3),
        rms=(first, state.rms),
        traces=problem.traces,
    )


class _State:
    """Where the fit stands."""

    def __init__(self, problem: _Problem, values: FloatArray, flux: FloatArray, by_press: FloatArray) -> None:
        self.problem, self.values, self.flux, self.by_press = problem, values, flux, by_press
        self.slopes = np.zeros((len(values), *flux.shape))
        samples = problem.samples
        level = np.log(fitted_gains(samples.untouched, flux[-1], samples.emitters))
        self.prior_gains = np.linalg.lstsq(problem.parts, level, rcond=None)[0]
        self.log_gains = self.prior_gains.copy()
        self.offset_mm = np.zeros(3 * samples.presses)
        self.log_gains, self.offset_mm = self.inner(flux)

    @property
    def rms(self) -> float:
        """Residual over readings that count, in standard deviations."""
        counted = self.problem.weight > 0
        residual = self._residual(self.flux, self.log_gains, self.offset_mm)
        return float(np.sqrt((residual[counted] ** 2).mean()))

    def descend(self, steps: int) -> None:
        """Steps with slopes by Broyden's rule."""
        for _ in range(steps):
            step = self._step()[: len(self.values)]
            trial = np.clip(self.values + step, self.problem.low, self.problem.high)
            step = trial - self.values
            if np.abs(step).max() < DONE:
                return
            if not self._take(trial, step):
                return

    def _take(self, trial: FloatArray, step: FloatArray) -> bool:
        """Go there, or half or a quarter of the way where that is not better; whether it went."""
        before = self._cost(self.values, self.flux, self.log_gains, self.offset_mm)
        for _ in range(3):
            flux = self.problem.flux(trial)
            off = flux - self.flux - np.tensordot(step, self.slopes, axes=1)
            self.slopes += step[:, None, None] * off / (step @ step)
            log_gains, offset_mm = self.inner(flux)
            if self._cost(trial, flux, log_gains, offset_mm) < before:
                self.values, self.flux, self.log_gains, self.offset_mm = trial, flux, log_gains, offset_mm
                return True
            step = 0.4 * step
            trial = self.values + step
        return False

    def _mean(self, flux: FloatArray, log_gains: FloatArray, offset_mm: FloatArray) -> FloatArray:
        offsets = (
            self.problem.of_press @ offset_mm.reshape(-1, 3) + self.problem.press_mm - self.problem.rounded_mm
        )
        moved = flux + np.einsum("sa,ask->sk", offsets, self.by_press)
        return np.asarray(np.exp(self.problem.parts @ log_gains) * moved)

    def _residual(self, flux: FloatArray, log_gains: FloatArray, offset_mm: FloatArray) -> FloatArray:
        return (self.problem.signals - self._mean(flux, log_gains, offset_mm)) * self.problem.weight

    def _cost(
        self, values: FloatArray, flux: FloatArray, log_gains: FloatArray, offset_mm: FloatArray
    ) -> float:
        priors = (
            (values**2).sum()
            + (((log_gains - self.prior_gains) / GAIN_SPREAD) ** 2).sum()
            + (offset_mm**2 * self.problem.offset_information).sum()
        )
        return float((self._residual(flux, log_gains, offset_mm) ** 2).sum() + priors)

    def _columns(
        self, flux: FloatArray, log_gains: FloatArray, offset_mm: FloatArray
    ) -> tuple[FloatArray, int]:
        """Slopes of the mean in standard deviations, (sample x pair, gains + presses), gains first."""
        problem = self.problem
        mean = self._mean(flux, log_gains, offset_mm) * problem.weight
        by_gain = mean[:, :, None] * problem.parts
        gains = np.exp(problem.parts @ log_gains)
        slopes = np.moveaxis(self.by_press * (gains * problem.weight), 0, 2)
        by_offset = problem.of_press[:, None, :, None] * slopes[:, :, None, :]
        both = np.concatenate([by_gain, by_offset.reshape(*mean.shape, -1)], axis=2)
        return both.reshape(-1, both.shape[2]), problem.parts.shape[1]

    def inner(self, flux: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Best gains and reference depths for some light."""
        log_gains, offset_mm = self.log_gains, self.offset_mm
        for _ in range(4):
            columns, gains = self._columns(flux, log_gains, offset_mm)
            now = np.concatenate([log_gains - self.prior_gains, offset_mm])
            prior = self._nuisance_information(gains)
            slope = columns.T @ self._residual(flux, log_gains, offset_mm).ravel() - prior * now
            step = np.linalg.solve(columns.T @ columns + np.diag(prior), slope)
            log_gains, offset_mm = log_gains + step[:gains], offset_mm + step[gains:]
        return log_gains, offset_mm

    def _nuisance_information(self, gains: int) -> FloatArray:
        return np.concatenate([np.full(gains, GAIN_SPREAD**-2.0), self.problem.offset_information])

    def _normal(self) -> tuple[FloatArray, FloatArray]:
        """AᵀA + P of all unknowns, parameters first, and the right-hand side."""
        problem = self.problem
        nuisance, gains = self._columns(self.flux, self.log_gains, self.offset_mm)
        level = np.exp(problem.parts @ self.log_gains) * problem.weight
        own = (self.slopes * level).reshape(len(self.values), -1).T
        columns = np.concatenate([own, nuisance], axis=1)
        prior = np.concatenate([np.ones(len(self.values)), self._nuisance_information(gains)])
        now = np.concatenate([self.values, self.log_gains - self.prior_gains, self.offset_mm])
        residual = self._residual(self.flux, self.log_gains, self.offset_mm).ravel()
        return columns.T @ columns + np.diag(prior), columns.T @ residual - prior * now

    def _step(self) -> FloatArray:
        """Of all unknowns; a parameter at an end that wants beyond it is held."""
        matrix, slope = self._normal()
        names = len(self.values)
        held = np.zeros(len(slope), dtype=bool)
        for _ in range(names):
            free = ~held
            step = np.zeros(len(slope))
            step[free] = np.linalg.solve(matrix[np.ix_(free, free)], slope[free])
            beyond = self.values + step[:names]
            at_end = ((self.values <= self.problem.low) & (beyond < self.problem.low)) | (
                (self.values >= self.problem.high) & (beyond > self.problem.high)
            )
            if not (at_end & free[:names]).any():
                return step
            held[:names] |= at_end
        return step

    def gain_covariance(self) -> FloatArray:
        """(gain, gain) of the logarithms of gains, all else unknown."""
        names, gains = len(self.values), self.problem.parts.shape[1]
        return np.asarray(np.linalg.inv(self._normal()[0])[names : names + gains, names : names + gains])

    def covariance(self, halves: list[FloatArray]) -> FloatArray:
        """(unknown, unknown) of the parameters, by slopes (unknown, sample, pair) of two independent halves."""
        nuisance, gains = self._columns(self.flux, self.log_gains, self.offset_mm)
        level = np.exp(self.problem.parts @ self.log_gains) * self.problem.weight
        first, second = ((half * level).reshape(len(self.values), -1).T for half in halves)
        inner = nuisance.T @ nuisance + np.diag(self._nuisance_information(gains))
        shared = [nuisance.T @ half for half in (first, second)]
        told = first.T @ second - shared[0].T @ np.linalg.solve(inner, shared[1])
        information, vectors = np.linalg.eigh(0.5 * (told + told.T))
        sure = information - TOLD_FROM_ZERO * _information_error(first @ vectors, second @ vectors)
        return np.asarray((vectors / (np.maximum(sure, 0.0) + 1.0)) @ vectors.T)


def _information_error(first: FloatArray, second: FloatArray) -> FloatArray:
    """(direction,) standard error of Σ first x second over readings (reading, direction): `sims.bounds.fisher`."""
    variance = 0.5 * (first - second) ** 2
    slope = 0.25 * (first + second) ** 2
    return np.asarray(np.sqrt((2.0 * slope * variance + variance**2).sum(axis=0)))
