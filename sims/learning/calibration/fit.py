"""Parameters of a build from its readings: Gauss-Newton on traced light, gains and reference depths along.

Model
-----
Signals of sample s and pair (i, j) under unknown parameters u (in spreads of their doubt, about its middle),

    y_s,ij = gᵢ hⱼ F_s,ij(u, depth_s + z_press) + n,     F the light model, g, h the gains

with normal priors: u of mean 0 and spread 1, every press's reference depth z of spread `zero_spread_mm`, the logarithms
of gains of spread `GAIN_SPREAD` about those that the untouched signals tell. n is the chain's noise, and a model error
of `MODEL_SHARE` of the untouched signal: the trace's own, the stage's error in x and y, walls near the tip. The
untouched signals count as one more sample without z. Minimised by Gauss-Newton steps on all unknowns at once,

    (AᵀA + P) Δ = Aᵀr - P(Δ₀),    A and r in standard deviations of n, P the priors' information

F is traced at each step; its slopes by u come from differences at the start and once more near the end, and follow
Broyden's rank-one rule between (Broyden 1965), so that a step costs one trace. The light model's offsets have one seed
throughout: differences are of the parameters, not of the rays. Steps end at the doubt's ends.

At the end the inverse of AᵀA + P is the covariance of everything; its block of u, over that of the prior (the unit
matrix), says what the data determine (`report`). Left out: scatter from part to part, several minima.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sims.learning.calibration.samples import CalibrationSamples
from sims.learning.inference.reading_noise import ReadingNoise
from sims.learning.map_learner import fitted_gains

FloatArray = NDArray[np.float64]
Light = Callable[[FloatArray, FloatArray], FloatArray]
"""Flux (n, pair) of parameters (unknown,) in spreads and presses (n, 3); depth 0 is untouched."""
OnStep = Callable[[str, float], None]

GAIN_SPREAD = 0.5
MODEL_SHARE = 0.004
SLOPE_STEP = 0.3
"""Step of the differences by a parameter, in spreads of its doubt."""
SLOPE_PLACE_MM = 0.1
"""Slopes are taken at places rounded to this: they change little over it, and the places of a grid become symmetric
again, which a stage's error had kept from being traced once."""
DEPTH_STEP_MM = 0.05
STEPS = 3
"""Steps with slopes that follow Broyden's rule, before and after slopes are taken anew."""
DONE = 0.02
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
    zero_mm : (press,) reference depths: tip beside the stage [mm]
    rms : (2,) root mean square residual before and after, in standard deviations [-]
    traces : how often the light of all samples was traced
    """

    values: FloatArray
    covariance: FloatArray
    gains: FloatArray
    gain_spread: FloatArray
    zero_mm: FloatArray
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
    zero_spread_mm: float
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

    def flux(self, values: FloatArray, *, nearby: bool = False, deeper_mm: float = 0.0) -> FloatArray:
        """(sample, pair) light of parameters; the last row is the untouched pad.

        nearby : at places rounded to `SLOPE_PLACE_MM`; deeper_mm : added to all presses
        """
        press_mm = self.press_mm.copy()
        press_mm[:-1, 2] += deeper_mm
        if nearby:
            press_mm[:, :2] = np.round(press_mm[:, :2] / SLOPE_PLACE_MM) * SLOPE_PLACE_MM
        self.traces += 1
        self.on_step("calibration", min(self.traces / self.expected, 1.0))
        return np.maximum(self.light(values, press_mm), SMALL_FLUX)

    def slopes(self, values: FloatArray) -> FloatArray:
        """(unknown, sample, pair) change of light with each parameter, by differences towards the inside."""
        flux = self.flux(values, nearby=True)
        found = []
        for axis in range(len(values)):
            side = SLOPE_STEP if values[axis] + SLOPE_STEP <= self.high[axis] else -SLOPE_STEP
            moved = values.copy()
            moved[axis] += side
            found.append((self.flux(moved, nearby=True) - flux) / side)
        return np.array(found)


def fitted(
    light: Light,
    samples: CalibrationSamples,
    noise: ReadingNoise,
    *,
    start: FloatArray,
    low: FloatArray,
    high: FloatArray,
    zero_spread_mm: float,
    on_step: OnStep | None = None,
) -> Fitted:
    """Fit a build.

    Parameters
    ----------
    light : the light model
    noise : of one reading, by the chain
    start, low, high : (unknown,) where the fit begins, and the ends, in spreads
    zero_spread_mm : standard deviation of a press's reference depth [mm]
    on_step : called with ``calibration`` and about the share that is done
    """
    problem = _Problem(
        light, samples, noise, low, high, zero_spread_mm, on_step or (lambda _stage, _share: None),
        expected=2 * len(start) + 2 * STEPS + 5,
    )  # fmt: skip
    flux = problem.flux(start)
    deeper, here = (problem.flux(start, nearby=True, deeper_mm=step) for step in (DEPTH_STEP_MM, 0.0))
    by_depth = (deeper - here) / DEPTH_STEP_MM
    state = _State(problem, start, flux, by_depth)
    first = state.rms
    for _ in range(2):
        state.slopes = problem.slopes(state.values)
        state.descend()
    covariance, names = state.covariance(), len(start)
    gains = covariance[names : names + problem.parts.shape[1], names : names + problem.parts.shape[1]]
    return Fitted(
        values=state.values,
        covariance=covariance[:names, :names],
        gains=np.exp(problem.parts @ state.log_gains),
        gain_spread=np.sqrt(np.einsum("ki,ij,kj->k", problem.parts, gains, problem.parts)),
        zero_mm=state.zero_mm,
        rms=(first, state.rms),
        traces=problem.traces,
    )


class _State:
    """Where the fit stands."""

    def __init__(self, problem: _Problem, values: FloatArray, flux: FloatArray, by_depth: FloatArray) -> None:
        self.problem, self.values, self.flux, self.by_depth = problem, values, flux, by_depth
        self.slopes = np.zeros((len(values), *flux.shape))
        samples = problem.samples
        level = np.log(fitted_gains(samples.untouched, flux[-1], samples.emitters))
        self.prior_gains = np.linalg.lstsq(problem.parts, level, rcond=None)[0]
        self.log_gains = self.prior_gains.copy()
        self.zero_mm = np.zeros(samples.presses)
        self.log_gains, self.zero_mm = self._inner(flux)

    @property
    def rms(self) -> float:
        """Residual over readings that count, in standard deviations."""
        counted = self.problem.weight > 0
        residual = self._residual(self.flux, self.log_gains, self.zero_mm)
        return float(np.sqrt((residual[counted] ** 2).mean()))

    def descend(self) -> None:
        """Steps with slopes by Broyden's rule."""
        for _ in range(STEPS):
            step = self._step()[: len(self.values)]
            trial = np.clip(self.values + step, self.problem.low, self.problem.high)
            step = trial - self.values
            if np.abs(step).max() < DONE:
                return
            if not self._take(trial, step):
                return

    def _take(self, trial: FloatArray, step: FloatArray) -> bool:
        """Go there, or half or a quarter of the way where that is not better; whether it went."""
        before = self._cost(self.values, self.flux, self.log_gains, self.zero_mm)
        for _ in range(3):
            flux = self.problem.flux(trial)
            off = flux - self.flux - np.tensordot(step, self.slopes, axes=1)
            self.slopes += step[:, None, None] * off / (step @ step)
            log_gains, zero_mm = self._inner(flux)
            if self._cost(trial, flux, log_gains, zero_mm) < before:
                self.values, self.flux, self.log_gains, self.zero_mm = trial, flux, log_gains, zero_mm
                return True
            step = 0.4 * step
            trial = self.values + step
        return False

    def _mean(self, flux: FloatArray, log_gains: FloatArray, zero_mm: FloatArray) -> FloatArray:
        moved = flux + (self.problem.of_press @ zero_mm)[:, None] * self.by_depth
        return np.asarray(np.exp(self.problem.parts @ log_gains) * moved)

    def _residual(self, flux: FloatArray, log_gains: FloatArray, zero_mm: FloatArray) -> FloatArray:
        return (self.problem.signals - self._mean(flux, log_gains, zero_mm)) * self.problem.weight

    def _cost(
        self, values: FloatArray, flux: FloatArray, log_gains: FloatArray, zero_mm: FloatArray
    ) -> float:
        priors = (
            (values**2).sum()
            + (((log_gains - self.prior_gains) / GAIN_SPREAD) ** 2).sum()
            + ((zero_mm / self.problem.zero_spread_mm) ** 2).sum()
        )
        return float((self._residual(flux, log_gains, zero_mm) ** 2).sum() + priors)

    def _columns(
        self, flux: FloatArray, log_gains: FloatArray, zero_mm: FloatArray
    ) -> tuple[FloatArray, int]:
        """Slopes of the mean in standard deviations, (sample x pair, gains + presses), gains first."""
        problem = self.problem
        mean = self._mean(flux, log_gains, zero_mm) * problem.weight
        by_gain = mean[:, :, None] * problem.parts
        gains = np.exp(problem.parts @ log_gains)
        by_zero = (gains * self.by_depth * problem.weight)[:, :, None] * problem.of_press[:, None, :]
        both = np.concatenate([by_gain, by_zero], axis=2)
        return both.reshape(-1, both.shape[2]), problem.parts.shape[1]

    def _inner(self, flux: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Best gains and reference depths for some light."""
        log_gains, zero_mm = self.log_gains, self.zero_mm
        for _ in range(4):
            columns, gains = self._columns(flux, log_gains, zero_mm)
            now = np.concatenate([log_gains - self.prior_gains, zero_mm])
            prior = self._nuisance_information(gains)
            slope = columns.T @ self._residual(flux, log_gains, zero_mm).ravel() - prior * now
            step = np.linalg.solve(columns.T @ columns + np.diag(prior), slope)
            log_gains, zero_mm = log_gains + step[:gains], zero_mm + step[gains:]
        return log_gains, zero_mm

    def _nuisance_information(self, gains: int) -> FloatArray:
        presses = np.full(self.problem.samples.presses, self.problem.zero_spread_mm**-2.0)
        return np.concatenate([np.full(gains, GAIN_SPREAD**-2.0), presses])

    def _normal(self) -> tuple[FloatArray, FloatArray]:
        """AᵀA + P of all unknowns, parameters first, and the right-hand side."""
        problem = self.problem
        nuisance, gains = self._columns(self.flux, self.log_gains, self.zero_mm)
        level = np.exp(problem.parts @ self.log_gains) * problem.weight
        own = (self.slopes * level).reshape(len(self.values), -1).T
        columns = np.concatenate([own, nuisance], axis=1)
        prior = np.concatenate([np.ones(len(self.values)), self._nuisance_information(gains)])
        now = np.concatenate([self.values, self.log_gains - self.prior_gains, self.zero_mm])
        residual = self._residual(self.flux, self.log_gains, self.zero_mm).ravel()
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

    def covariance(self) -> FloatArray:
        """Of all unknowns, parameters first."""
        return np.asarray(np.linalg.inv(self._normal()[0]))
