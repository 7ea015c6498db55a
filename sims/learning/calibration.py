"""Fit the unknown parameters of a manufactured pad to its readings, by Gauss-Newton steps on traced light.

Gains of the components and offsets of the tip are fitted along with them.

Model
-----
The signal of sample s and pair (i, j), given the unknown parameters u in prior standard deviations about the prior
mean, is

    y_s,ij = gᵢ hⱼ F_s,ij(u, press_s + δ) + n,     F the light model, g, h the gains of emitter and receiver

with normal priors. u has mean 0 and spread 1. The offset δ of the tip from the stage's position has the spread
`stage_mm` in x, y and depth. A further depth offset of spread `set_depth_mm` is common to all presses of a set. The
logarithms of the gains have the spread `GAIN_SPREAD` about estimates from the untouched signals. The untouched signals
count as one more sample, without δ. The noise n is the sum of

    the chain's noise, drift and fluctuation of gains, independent for each reading
    a model error of `MODEL_SHARE` of the untouched signal: the trace's own, and walls near the tip; readings that are
    compared with the same number of the light model share this error (`shared_error`)
    the residual of a linear fit of light over the possible tip positions, independent for each reading: light has kinks
    where the tip meets a light path. With F± at ±√3 standard deviations of δ and F₀ between, the curve F₀ + b z + q z²
    of a standard normal z has q = (F₊ + F₋ - 2 F₀) / 6 and leaves q z², of mean square 3 q²; b is the slope
    (statistical linearisation by three Gauss-Hermite points: Särkkä 2013, section 6.2)

First steps: Broyden's rule
---------------------------
The cost is minimised by Gauss-Newton steps on all unknowns at once,

    (AᵀA + P) Δ = Aᵀr - P(Δ₀),    A and r in standard deviations of n, P the priors' information

F is traced at each step. Its slopes by u come from differences at the start and follow Broyden's rank-one rule (Broyden
1965) for `STEPS` steps, so that a step costs one trace. Steps end at the limits of the prior.

F is rough in u, because the error of its adaptive integration changes at every step. Near the end this noise decides
which of two costs is less, and noise in the slopes counts as information. Such a descent stops early, far from the
minimum along poorly determined directions. So from there on costs are not compared.

Last steps: significant information only
----------------------------------------
The slopes U are computed twice by fresh two-sided differences, with light of two seeds, whose noise is independent.
Then

    I = Uᵀ(1 - N(NᵀN + P)⁻¹Nᵀ)U        information on u with gains and offsets free; N their slopes

is the symmetrised product of the two (`optopad.sims.bounds.fisher`). Each of its eigenvectors v has an eigenvalue t,
with a standard error e from the light. The share s = max(t - 2 e, 0) / t of the information is significant, and the
data count by that share. `POLISH` steps with the mean light of `LIGHTS` seeds solve s vᵀUᵀr = vᵀu, with U the mean of
the two estimates, by

    vᵀΔ = (s vᵀUᵀr - vᵀu) / (s (t + e) + 1)

whose limit does not depend on the divisor. Where no information is significant, s is 0, and the value is the prior
mean. Without s, noise in the slopes moved the refractive index of the paper's pad, which the data do not determine, to
the low limit of its prior in all of ten simulated units. The light of these steps has seeds other than those of the
slopes: with a common seed, the product of the two noises would not average to 0. One-sided differences err by the
light's curvature, equally with every seed. Along poorly determined directions, where slopes cancel, that error would
count as information. On the paper's pad it gave 190 instead of 33 for the combination of both heights and the
thickness, and the fit erred by 0.7 spreads with a stated error of 0.05.

The covariance of u is (s t + 1)⁻¹ along each v. The prior's is 1, so this shows how much the data determine.

Left out: scatter from component to component, several minima, gains that differ from set to set (their drift counts as
noise), model errors common to neighbouring locations and depths, and model errors above `MODEL_SHARE`.
docs/validation/calibration.md has the errors of fitted values on simulated units whose parameters the fit does not
know.

A report lists the fitted parameters, and the combinations of parameters that the data do not determine.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.linalg import block_diag

from optopad.design.arrays import FloatArray
from optopad.design.draft import Draft
from optopad.design.progress import OnStep
from optopad.design.spec import SensorDesign
from optopad.sims.bounds.fisher import SEED_GAP, ZERO_SIGMAS
from optopad.sims.learning.calibration_problem import (
    HALVES,
    LIGHTS,
    CalibrationSamples,
    Light,
    Problem,
    Unknown,
    calibration_samples,
    unknowns_of,
    with_values,
)
from optopad.sims.learning.inference.signal_map import ReadingNoise
from optopad.sims.learning.map_learner import chain_noise, fitted_gains
from optopad.sims.optics.tracing import trace
from optopad.sims.readings.dataset import PressData

LIGHT_SEED = 15_485_863
"""Number added to the seed for the fit's light. Simulated data use the seed itself, and the fit must not share their
numerical errors.
"""
SMALLEST_STAGE_MM = 0.005
"""Smallest assumed standard deviation of a press's position [mm]: even a perfect stage rounds its position."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Calibration:
    """The result of a calibration.

    Attributes
    ----------
    design : the design with the fitted values set
    unknowns : the fitted parameters and their priors
    fitted : the result of the fit in prior standard deviations, with gains and tip offsets
    samples : the readings used in the fit
    seed : random seed of the fit
    """

    design: SensorDesign
    unknowns: tuple[Unknown, ...]
    fitted: Fitted
    samples: CalibrationSamples
    seed: int

    @property
    def values(self) -> FloatArray:
        """Fitted values (unknown,), each in its own unit."""
        return np.array(
            [one.middle + one.spread * u for one, u in zip(self.unknowns, self.fitted.values, strict=True)]
        )

    @property
    def deviations(self) -> FloatArray:
        """Standard deviations (unknown,) after the fit, each in its parameter's unit."""
        spread = np.array([one.spread for one in self.unknowns])
        return np.asarray(np.sqrt(np.diag(self.fitted.covariance)) * spread)


def calibrated(
    design: SensorDesign,
    data: PressData,
    *,
    accuracy: str = "draft",
    seed: int = 0,
    on_step: OnStep | None = None,
) -> Calibration:
    """Fit the unknown parameters of a design to the presses on a manufactured pad.

    Parameters
    ----------
    data : frames of the presses; before each press, some frames have the tip above the surface
    accuracy, seed : accuracy setting and random seed of the light model
    on_step : called with the name of the stage and the fraction done (0 to 1)

    Raises
    ------
    InputError : there are too few presses or untouched frames, or nothing to fit.
    ModelScopeError : the contact or light model does not cover a press.
    """
    unknowns = unknowns_of(design)
    samples = calibration_samples(data, design.operating.max_depth_mm)
    stage = design.noise
    middle, spread, value, low, high = (
        np.array([getattr(one, name) for one in unknowns])
        for name in ("middle", "spread", "value", "low", "high")
    )

    def light(values: FloatArray, press_mm: FloatArray, half: int) -> FloatArray:
        build = with_values(design, unknowns, np.clip(middle + spread * values, low, high))
        own = seed + LIGHT_SEED + SEED_GAP * half
        return trace(Draft.of(build), press_mm, accuracy=accuracy, seed=own).flux.reshape(len(press_mm), -1)

    found = fitted(
        light,
        samples,
        _noise(design, samples),
        start=(value - middle) / spread,
        low=(low - middle) / spread,
        high=(high - middle) / spread,
        stage_mm=np.maximum([stage.position_error_mm] * 2 + [stage.zero_offset_place_mm], SMALLEST_STAGE_MM),
        set_depth_mm=stage.zero_offset_set_mm,
        on_step=on_step,
    )
    return Calibration(
        design=with_values(design, unknowns, np.clip(middle + spread * found.values, low, high)),
        unknowns=unknowns,
        fitted=found,
        samples=samples,
        seed=seed,
    )


def _noise(design: SensorDesign, samples: CalibrationSamples) -> ReadingNoise:
    """Noise of the signal chain, or the scatter of the untouched frames where that is larger (flickering lamps)."""
    chain = chain_noise(design, samples.emitters, samples.signals.shape[1])
    untouched = samples.untouched
    fluctuation = design.noise.led_fluctuation * untouched.mean_counts
    seen = np.where(untouched.is_clipped, 0.0, untouched.spread_counts**2 - fluctuation**2)
    return replace(chain, floor_counts=np.sqrt(np.maximum(chain.floor_counts**2, seen)))


GAIN_SPREAD = 0.5
POLISH = 4
"""Number of last steps, with the mean light of several seeds."""
STEPS = 4
"""Number of first steps, with slopes that follow Broyden's rule."""
DONE = 0.05
"""The descent ends at steps smaller than this, in prior standard deviations; the light's noise hides smaller ones."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Fitted:
    """The fitted parameters, gains and tip offsets.

    Attributes
    ----------
    values : (unknown,) parameters in prior standard deviations about the prior mean [-]
    covariance : (unknown, unknown) covariance of `values` [-]
    gains : (pair,) counts per flux, the product of an emitter's and a receiver's gain [counts]
    gain_spread : (pair,) relative standard deviation of the gains [-]
    offset_mm : (press, 3) offset of the tip from the stage's position in x, y and depth [mm]
    rms : root mean square residuals before and after the fit, in standard deviations of the noise [-]
    traces : how often the light of all samples was traced
    """

    values: FloatArray
    covariance: FloatArray
    gains: FloatArray
    gain_spread: FloatArray
    offset_mm: FloatArray
    rms: tuple[float, float]
    traces: int


def fitted(
    light: Light,
    samples: CalibrationSamples,
    noise: ReadingNoise,
    *,
    start: FloatArray,
    low: FloatArray,
    high: FloatArray,
    stage_mm: FloatArray,
    set_depth_mm: float = 0.0,
    on_step: OnStep | None = None,
) -> Fitted:
    """Fit the parameters, gains and tip offsets to the samples.

    Parameters
    ----------
    light : the light model, as a function of parameters, presses and seed number
    noise : noise of one reading by the signal chain
    start, low, high : (unknown,) start values and limits of the parameters, in prior standard deviations
    stage_mm : (3,) standard deviations of a press's true position about the stage's x, y and depth [mm]
    set_depth_mm : standard deviation of a depth offset that all presses of a set share [mm]
    on_step : called with ``calibration`` and the approximate fraction done (0 to 1)
    """
    problem = Problem(
        light, samples, noise, low, high, stage_mm, set_depth_mm, on_step or (lambda _stage, _share: None),
        expected=5 * len(start) + STEPS + 14 + LIGHTS * (POLISH + 1),
    )  # fmt: skip
    state = _State(problem, start, problem.flux(start))
    state.look_around()
    first = state.rms
    state.slopes = problem.rough_slopes(state.values)
    state.descend(STEPS)
    halves = [problem.slopes(state.values, half) for half in range(HALVES)]
    state.slopes = 0.5 * (halves[0] + halves[1])
    state.look_around()
    state.polish(state.fisher(halves))
    gains = state.gain_covariance()
    problem.on_step("calibration", 1.0)
    return Fitted(
        values=state.values,
        covariance=state.fisher(halves).covariance,
        gains=np.exp(problem.parts @ state.log_gains),
        gain_spread=np.sqrt(np.einsum("ki,ij,kj->k", problem.parts, gains, problem.parts)),
        offset_mm=state.offset_mm.reshape(-1, 3),
        rms=(first, state.rms),
        traces=problem.traces,
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class FisherInformation:
    """Fisher information that the data hold on the parameters, along independent directions.

    Parameters are in prior standard deviations.

    Attributes
    ----------
    vectors : (unknown, direction) eigenvectors of the Fisher information matrix
    information : (direction,) eigenvalues: the information along each direction [-]
    error : (direction,) standard error of this information due to the light's noise [-]
    """

    vectors: FloatArray
    information: FloatArray
    error: FloatArray

    @property
    def share(self) -> FloatArray:
        """Significant share (direction,) of the information, 0 to 1: the part that exceeds two standard errors [-]."""
        shown = np.maximum(self.information - ZERO_SIGMAS * self.error, 0.0)
        return np.asarray(shown / np.where(shown > 0.0, self.information, 1.0))

    @property
    def covariance(self) -> FloatArray:
        """Covariance (unknown, unknown) of the parameters after the fit; the unit matrix if there is no information."""
        return self.combined(1.0 / (self.share * self.information + 1.0))

    def combined(self, values: FloatArray) -> FloatArray:
        """Matrix (unknown, unknown) with the same eigenvectors and the given eigenvalues (direction,)."""
        return np.asarray((self.vectors * values) @ self.vectors.T)


class _State:
    """The current state of the fit: parameters, light, slopes, gains and offsets."""

    def __init__(self, problem: Problem, values: FloatArray, flux: FloatArray) -> None:
        self.problem, self.values, self.flux = problem, values, flux
        self.slopes = np.zeros((len(values), *flux.shape))
        self.by_press = np.zeros((3, *flux.shape))
        samples = problem.samples
        level = np.log(fitted_gains(samples.untouched, flux[-1], samples.emitters))
        self.prior_gains: FloatArray = np.asarray(
            np.linalg.lstsq(problem.parts, level, rcond=None)[0], np.float64
        )
        self.log_gains = self.prior_gains.copy()
        self.offset_mm = np.zeros(3 * samples.presses)

    def look_around(self) -> None:
        """Update the slopes of light by x, y and depth, the weights of the readings, and the best gains and offsets."""
        self.by_press, left = self.problem.press_slopes(self.values, self.flux)
        self.problem.weigh(self.flux, np.exp(self.problem.parts @ self.log_gains) * left)
        self.log_gains, self.offset_mm = self.inner(self.flux)

    @property
    def rms(self) -> float:
        """Root mean square residual of the unclipped readings, in standard deviations of the noise."""
        counted = self.problem.weight.ravel() > 0
        residual = self._residual(self.flux, self.log_gains, self.offset_mm)
        return float(np.sqrt((residual[counted] ** 2).mean()))

    def descend(self, steps: int) -> None:
        """Take at most `steps` Gauss-Newton steps, with slopes updated by Broyden's rule."""
        for _ in range(steps):
            step = self._step()[: len(self.values)]
            trial = np.clip(self.values + step, self.problem.low, self.problem.high)
            step = trial - self.values
            if np.abs(step).max() < DONE:
                return
            if not self._take(trial, step):
                return

    def _take(self, trial: FloatArray, step: FloatArray) -> bool:
        """Take a step if it lowers the cost, otherwise try 0.4 and then 0.16 of it; return whether any was taken."""
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
        """Residuals (reading,) in standard deviations, transformed to be independent."""
        off = (self.problem.signals - self._mean(flux, log_gains, offset_mm)) * self.problem.weight
        return self.problem.whitened(off)[:, 0]

    def _cost(
        self, values: FloatArray, flux: FloatArray, log_gains: FloatArray, offset_mm: FloatArray
    ) -> float:
        priors = (
            (values**2).sum()
            + (((log_gains - self.prior_gains) / GAIN_SPREAD) ** 2).sum()
            + offset_mm @ self.problem.offset_information @ offset_mm
        )
        return float((self._residual(flux, log_gains, offset_mm) ** 2).sum() + priors)

    def _columns(
        self, flux: FloatArray, log_gains: FloatArray, offset_mm: FloatArray
    ) -> tuple[FloatArray, int]:
        """Slopes (reading, gains + offsets) of the mean signals by gains and tip offsets, and the number of gains.

        Slopes are in standard deviations of the noise, transformed to be independent.
        """
        problem = self.problem
        mean = self._mean(flux, log_gains, offset_mm) * problem.weight
        by_gain = mean[:, :, None] * problem.parts
        gains = np.exp(problem.parts @ log_gains)
        slopes = np.moveaxis(self.by_press * (gains * problem.weight), 0, 2)
        by_offset = problem.of_press[:, None, :, None] * slopes[:, :, None, :]
        both = np.concatenate([by_gain, by_offset.reshape(*mean.shape, -1)], axis=2)
        return problem.whitened(both), problem.parts.shape[1]

    def inner(self, flux: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Gains and tip offsets that fit best for the given light."""
        log_gains, offset_mm = self.log_gains, self.offset_mm
        for _ in range(4):
            columns, gains = self._columns(flux, log_gains, offset_mm)
            now = np.concatenate([log_gains - self.prior_gains, offset_mm])
            prior = self._nuisance_information(gains)
            slope = columns.T @ self._residual(flux, log_gains, offset_mm) - prior @ now
            step = np.linalg.solve(columns.T @ columns + prior, slope)
            log_gains, offset_mm = log_gains + step[:gains], offset_mm + step[gains:]
        return log_gains, offset_mm

    def _nuisance_information(self, gains: int) -> FloatArray:
        return np.asarray(block_diag(GAIN_SPREAD**-2.0 * np.eye(gains), self.problem.offset_information))

    def _normal(self) -> tuple[FloatArray, FloatArray]:
        """Matrix AᵀA + P of the normal equations, and their right-hand side.

        The unknowns are in the order parameters, gains, offsets.
        """
        problem = self.problem
        nuisance, gains = self._columns(self.flux, self.log_gains, self.offset_mm)
        level = np.exp(problem.parts @ self.log_gains) * problem.weight
        own = problem.whitened(np.moveaxis(self.slopes * level, 0, 2))
        columns = np.concatenate([own, nuisance], axis=1)
        prior = block_diag(np.eye(len(self.values)), self._nuisance_information(gains))
        now = np.concatenate([self.values, self.log_gains - self.prior_gains, self.offset_mm])
        residual = self._residual(self.flux, self.log_gains, self.offset_mm)
        return columns.T @ columns + prior, columns.T @ residual - prior @ now

    def _step(self) -> FloatArray:
        """Gauss-Newton step of all unknowns; parameters at a limit do not move beyond it."""
        return self._held(*self._normal())

    def _held(self, matrix: FloatArray, slope: FloatArray) -> FloatArray:
        """Solution of matrix x step = slope, parameters first; parameters at a limit do not move beyond it."""
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

    def polish(self, fisher: FisherInformation) -> None:
        """Take the last steps, with fixed slopes, the mean light of several seeds, and significant information only."""
        problem = self.problem
        for _ in range(POLISH):
            self._settle()
            matrix = fisher.combined(fisher.share * (fisher.information + fisher.error) + 1.0)
            level = np.exp(problem.parts @ self.log_gains) * problem.weight
            own = problem.whitened(np.moveaxis(self.slopes * level, 0, 2))
            residual = self._residual(self.flux, self.log_gains, self.offset_mm)
            step = self._held(matrix, fisher.combined(fisher.share) @ (own.T @ residual) - self.values)
            self.values = np.clip(self.values + step, problem.low, problem.high)
        self._settle()

    def _settle(self) -> None:
        """Trace the mean light at the current parameters, and fit gains and offsets to it."""
        self.flux = self.problem.mean_flux(self.values)
        self.log_gains, self.offset_mm = self.inner(self.flux)

    def gain_covariance(self) -> FloatArray:
        """Covariance (gain, gain) of the logarithms of the gains, with all other unknowns free."""
        names, gains = len(self.values), self.problem.parts.shape[1]
        return np.asarray(np.linalg.inv(self._normal()[0])[names : names + gains, names : names + gains])

    def fisher(self, halves: list[FloatArray]) -> FisherInformation:
        """Fisher information on the parameters, from two independent slope estimates (unknown, sample, pair)."""
        nuisance, gains = self._columns(self.flux, self.log_gains, self.offset_mm)
        level = np.exp(self.problem.parts @ self.log_gains) * self.problem.weight
        first, second = (self.problem.whitened(np.moveaxis(half * level, 0, 2)) for half in halves)
        inner = nuisance.T @ nuisance + self._nuisance_information(gains)
        shared = [nuisance.T @ half for half in (first, second)]
        product = first.T @ second - shared[0].T @ np.linalg.solve(inner, shared[1])
        information, vectors = np.linalg.eigh(0.5 * (product + product.T))
        error = _information_error(first @ vectors, second @ vectors, self.problem.shared.sums)
        return FisherInformation(vectors=vectors, information=information, error=error)


def _information_error(
    first: FloatArray, second: FloatArray, sums: Callable[[FloatArray], FloatArray]
) -> FloatArray:
    """Standard error (direction,) of the sum of first x second over the readings; both are (reading, direction).

    With the mean t and the difference d of first and second, it is √Σ((t d)² + (d²/2)²); see
    `optopad.sims.bounds.fisher`. Readings that are compared with the same light have the same noise, so `sums` adds
    them up before squaring.
    """
    mean, off = 0.5 * (first + second), first - second
    return np.asarray(np.sqrt((sums(mean * off) ** 2 + sums(0.5 * off**2) ** 2).sum(axis=0)))


DETERMINED = 0.5
"""A parameter or combination is determined if its spread after the fit is at most this share of the prior's [-]."""
NAMED = 0.3
"""Least weight at which the report names a parameter of a combination [-]."""
GOOD_RMS = 2.0
"""Residual above which the model does not explain the pad, in standard deviations of the noise [-]."""


@dataclass(frozen=True, kw_only=True)
class FittedValue:
    """One parameter before and after the fit.

    Attributes
    ----------
    path, unit : dotted path of the parameter in the design, and its unit
    before, before_spread : the design's value and the standard deviation of the prior
    after, after_spread : the fitted value and its standard deviation
    at_end : whether the fit stopped at a limit of the prior
    """

    path: str
    unit: str
    before: float
    before_spread: float
    after: float
    after_spread: float
    at_end: bool

    @property
    def share_left(self) -> float:
        """Standard deviation after the fit, divided by the standard deviation before [-]."""
        return self.after_spread / self.before_spread

    @property
    def is_determined(self) -> bool:
        """Whether the standard deviation after the fit is at most half of the prior's (`DETERMINED`)."""
        return self.share_left <= DETERMINED


@dataclass(frozen=True, kw_only=True)
class CalibrationReport:
    """Report on a calibration: fitted values, and sentences for the user.

    Attributes
    ----------
    values : result for each parameter
    undetermined : sentences on combinations that the data do not determine, the least determined first
    notes : further notes, as sentences
    rms_before, rms_after : root mean square residual before and after the fit, in standard deviations of the noise [-]
    """

    values: tuple[FittedValue, ...]
    undetermined: tuple[str, ...]
    notes: tuple[str, ...]
    rms_before: float
    rms_after: float

    def to_json(self) -> dict[str, Any]:
        """The report as plain data for JSON."""
        return {
            "values": [vars(one) | {"share_left": one.share_left} for one in self.values],
            "undetermined": list(self.undetermined),
            "notes": list(self.notes),
            "rms_before": self.rms_before,
            "rms_after": self.rms_after,
        }

    @property
    def lines(self) -> list[str]:
        """The report as lines of text."""
        rows = [
            f"{one.path:<52} {one.before:9.4g} -> {one.after:9.4g} +- {one.after_spread:.2g} {one.unit}"
            f"{'' if one.is_determined else '   (not determined)'}"
            for one in self.values
        ]
        head = f"residuals  {self.rms_before:.1f} -> {self.rms_after:.1f} standard deviations"
        return [head, *rows, *self.undetermined, *self.notes]


def report_of(found: Calibration) -> CalibrationReport:
    """Make the report on a calibration."""
    fit = found.fitted
    rows = zip(found.unknowns, found.values, found.deviations, strict=True)
    before, after = fit.rms
    return CalibrationReport(
        values=tuple(
            FittedValue(
                path=one.path,
                unit=one.unit,
                before=one.value,
                before_spread=one.spread,
                after=float(value),
                after_spread=float(deviation),
                at_end=bool(min(value - one.low, one.high - value) < 1e-6 * (one.high - one.low)),
            )
            for one, value, deviation in rows
        ),
        undetermined=undetermined(found.unknowns, fit.covariance),
        notes=tuple(_notes(found, after)),
        rms_before=before,
        rms_after=after,
    )


def undetermined(unknowns: Sequence[Unknown], covariance: FloatArray) -> tuple[str, ...]:
    """Sentences on combinations of parameters that the data do not determine, the least determined first.

    Parameters
    ----------
    covariance : (unknown, unknown) covariance after the fit, in prior standard deviations; the unit matrix if the data
        hold no information
    """
    variance, vectors = np.linalg.eigh(covariance)
    said = []
    for axis in np.argsort(-variance):
        spread = float(np.sqrt(variance[axis]))
        if spread <= DETERMINED:
            break
        said.append(
            f"not determined: {_combination(unknowns, vectors[:, axis])} (known to "
            f"{100 * min(spread, 1.0):.0f} % of the tolerance before)"
        )
    return tuple(said)


def _combination(unknowns: Sequence[Unknown], vector: FloatArray) -> str:
    order = np.argsort(-np.abs(vector))
    named = [k for k in order if abs(vector[k]) >= NAMED] or [order[0]]
    if len(named) == 1:
        return str(unknowns[named[0]].words)
    lead = np.sign(vector[named[0]])
    parts = [f"{unknowns[k].words} {'more' if np.sign(vector[k]) == lead else 'less'}" for k in named]
    return " with ".join([parts[0], ", ".join(parts[1:])])


def _notes(found: Calibration, rms_after: float) -> list[str]:
    ends = [
        one.path
        for one, value in zip(found.unknowns, found.values, strict=True)
        if min(value - one.low, one.high - value) < 1e-6 * (one.high - one.low)
    ]
    notes = [
        "the deviations are as accurate as the light model; effects that it leaves out enter them as 0.4 "
        "% of a signal (docs/how-to/calibrate.md)"
    ]
    if ends:
        notes.append(
            f"at an end of its tolerance: {', '.join(ends)}; if the manufactured unit may be outside it, "
            "widen it in [tolerances]"
        )
    if rms_after > GOOD_RMS:
        notes.append(
            f"the fit leaves {rms_after:.1f} standard deviations; this unit has an effect that is not in "
            "the model: compare with `optopad driver check`, or train on more data instead"
        )
    zero = float(np.mean(found.fitted.offset_mm[:, 2]))
    if abs(zero) >= 0.03:
        notes.append(
            f"the tip is {abs(zero):.2f} mm {'deeper' if zero > 0.0 else 'less deep'} than the stage "
            "reports, on average over the presses"
        )
    return notes
