"""Parameters of a build from its readings: Gauss-Newton on traced light, gains and reference depths along.

Model
-----
Signals of sample s and pair (i, j) under unknown parameters u (in spreads of their doubt, about its middle),

    y_s,ij = gᵢ hⱼ F_s,ij(u, press_s + δ) + n,     F the light model, g, h the gains

with normal priors: u of mean 0 and spread 1; the tip of every press beside where the stage says it is, δ, of spread
`stage_mm` in x, y and depth, and in depth of `set_depth_mm` more that all presses of a set have in common; the
logarithms of gains of spread `GAIN_SPREAD` about those that the untouched signals tell. The untouched signals count as
one more sample without δ. n is

    the chain's noise, drift and fluctuation of gains, a reading for itself
    a model error of `MODEL_SHARE` of the untouched signal: the trace's own, walls near the tip; readings that stand
        against the same number of the light model share it (`shared_error`)
    what a straight line leaves of the light between the places where the tip may be, a reading for itself: light kinks
        where the tip meets a path. With F± at ±√3 standard deviations of δ and F₀ between, the curve F₀ + b z + q z² of
        a standard normal z has q = (F₊ + F₋ - 2 F₀) / 6 and leaves q z², of mean square 3 q²; b is the slope
        (statistical linearisation by three Gauss-Hermite points: Särkkä 2013, section 6.2)

Minimised by Gauss-Newton steps on all unknowns at once,

    (AᵀA + P) Δ = Aᵀr - P(Δ₀),    A and r in standard deviations of n, P the priors' information

F is traced at each step; its slopes by u come from differences at the start and follow Broyden's rank-one rule
(Broyden 1965) for `STEPS` steps, so that a step costs one trace. Steps end at the doubt's ends. But F is rough in u:
its adaptive integration errs a little differently at every step, so that near the end its noise decides which of two
costs is less, and slopes that hold the noise show information that is none: such a descent stops short, far from the
minimum along the valley of what is hardly told. So from there on no costs are compared. Slopes U come twice by fresh
differences to both sides, with light of two seeds, whose noise is independent, and

    I = Uᵀ(1 - N(NᵀN + P)⁻¹Nᵀ)U        what the data tell of u beside the other unknowns; N the slopes by these

is the symmetrised product of the two (`sims.bounds.fisher`). Along each of its eigenvectors v, with eigenvalue t and
the standard error e that the light leaves, the share s = max(t - 2 e, 0) / t of the information is shown, and the data
count by that share: `POLISH` steps with the mean light of `LIGHTS` seeds solve s vᵀUᵀr = vᵀu, U the mean of both, by

    vᵀΔ = (s vᵀUᵀr - vᵀu) / (s (t + e) + 1)

whose end does not depend on the divisor. Where nothing is shown the slopes are noise, and so is Uᵀr: it took the index
of the paper's pad, of which the data tell nothing, to the low end of its doubt in ten builds of ten. There s is 0, and
the value goes to the middle of its doubt. The light of these steps is of other seeds than the slopes: noise of one
seed, in both, has a product of its own. Differences to one side err by the light's curvature, alike with every seed:
along the valley, where slopes cancel, what the curvature leaves passed for information (190 in place of 33 for both
heights and the thickness together, on the paper's pad), and the fit went 0.7 spreads astray while it said 0.05.

The covariance of u is (s t + 1)⁻¹ along each v; over that of the prior, 1, it says what the data determine (`report`).
Left out: scatter from part to part, several minima, gains that differ from set to set (their drift counts as noise),
model errors that neighbouring places and depths share, and larger ones. How far off values are on hidden builds is in
docs/validation/calibration.md.

A build's twin: the design with what its own presses say of it, and the model that reads the build.

What a calibration determined and what it could not, as numbers and in plain words.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.linalg import block_diag

from design.arrays import FloatArray
from design.progress import OnStep
from design.spec import SensorDesign
from sims.bounds.fisher import SEED_GAP, TOLD_FROM_ZERO
from sims.learning.calibration_problem import (
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
from sims.learning.inference.signal_map import ReadingNoise
from sims.learning.map_learner import chain_noise, fitted_gains
from sims.optics.tracing import trace
from sims.readings.dataset import PressData

LIGHT_SEED = 15_485_863
"""Added to the seed for the fit's light: simulated data have the seed itself, and must not share its errors."""
SMALLEST_STAGE_MM = 0.005
"""Least spread of where a press is: a stage told to have none still rounds."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Calibration:
    """What a calibration found.

    Attributes
    ----------
    design : with the fitted values set
    unknowns : what was fitted, and the doubt before
    fitted : the fit
    samples : the readings behind it
    seed : of the light
    """

    design: SensorDesign
    unknowns: tuple[Unknown, ...]
    fitted: Fitted
    samples: CalibrationSamples
    seed: int

    @property
    def values(self) -> FloatArray:
        """(unknown,) fitted values, each in its unit."""
        return np.array(
            [one.middle + one.spread * u for one, u in zip(self.unknowns, self.fitted.values, strict=True)]
        )

    @property
    def deviations(self) -> FloatArray:
        """(unknown,) standard deviations after the fit, each in its unit."""
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
    """Fit a design's unknown optics to a build's presses.

    Parameters
    ----------
    data : presses with some frames above the surface before each
    accuracy, seed : of the light

    Raises
    ------
    InputError : too few presses or untouched frames; nothing to fit.
    ModelScopeError : a press that contact or light model does not cover.
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
        return trace(build, press_mm, accuracy=accuracy, seed=own).flux.reshape(len(press_mm), -1)

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
    """The chain's, no less than untouched frames show beside the LEDs' fluctuation: lamps flicker."""
    chain = chain_noise(design, samples.emitters, samples.signals.shape[1])
    untouched = samples.untouched
    fluctuation = design.noise.led_fluctuation * untouched.mean_counts
    seen = np.where(untouched.is_clipped, 0.0, untouched.spread_counts**2 - fluctuation**2)
    return replace(chain, floor_counts=np.sqrt(np.maximum(chain.floor_counts**2, seen)))


GAIN_SPREAD = 0.5
POLISH = 4
"""Steps with the mean light."""
STEPS = 4
"""Steps with slopes that follow Broyden's rule."""
DONE = 0.05
"""Steps smaller than this in every parameter end them, in spreads: the light's noise over less is no slope."""


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
    """Fit a build.

    Parameters
    ----------
    light : the light model
    noise : of one reading, by the chain
    start, low, high : (unknown,) where the fit begins, and the ends, in spreads
    stage_mm : (3,) standard deviations of where a press really is, beside the stage's x, y and depth [mm]
    set_depth_mm : the same of depth, common to all presses of a set [mm]
    on_step : called with ``calibration`` and about the share that is done
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
    state.polish(state.told(halves))
    gains = state.gain_covariance()
    problem.on_step("calibration", 1.0)
    return Fitted(
        values=state.values,
        covariance=state.told(halves).covariance,
        gains=np.exp(problem.parts @ state.log_gains),
        gain_spread=np.sqrt(np.einsum("ki,ij,kj->k", problem.parts, gains, problem.parts)),
        offset_mm=state.offset_mm.reshape(-1, 3),
        rms=(first, state.rms),
        traces=problem.traces,
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class Told:
    """What data tell of the parameters, direction by direction, in spreads of their doubt.

    Attributes
    ----------
    vectors : (unknown, direction)
    information : (direction,) on each [-]
    error : (direction,) its standard error by the light's noise [-]
    """

    vectors: FloatArray
    information: FloatArray
    error: FloatArray

    @property
    def share(self) -> FloatArray:
        """(direction,) share of the information that stands clear of its error, 0 to 1 [-]."""
        shown = np.maximum(self.information - TOLD_FROM_ZERO * self.error, 0.0)
        return np.asarray(shown / np.where(shown > 0.0, self.information, 1.0))

    @property
    def covariance(self) -> FloatArray:
        """(unknown, unknown) of the parameters after the data; the unit matrix if nothing is shown."""
        return self.combined(1.0 / (self.share * self.information + 1.0))

    def combined(self, values: FloatArray) -> FloatArray:
        """(unknown, unknown) matrix of the given (direction,) eigenvalues."""
        return np.asarray((self.vectors * values) @ self.vectors.T)


class _State:
    """Where the fit stands."""

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
        """Slopes by the press, and weights of the readings, where the fit stands; gains and offsets to match."""
        self.by_press, left = self.problem.press_slopes(self.values, self.flux)
        self.problem.weigh(self.flux, np.exp(self.problem.parts @ self.log_gains) * left)
        self.log_gains, self.offset_mm = self.inner(self.flux)

    @property
    def rms(self) -> float:
        """Residual over readings that count, in standard deviations."""
        counted = self.problem.weight.ravel() > 0
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
        """(reading,) in standard deviations, made independent."""
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
        """Slopes of the mean in standard deviations, (sample x pair, gains + presses), gains first."""
        problem = self.problem
        mean = self._mean(flux, log_gains, offset_mm) * problem.weight
        by_gain = mean[:, :, None] * problem.parts
        gains = np.exp(problem.parts @ log_gains)
        slopes = np.moveaxis(self.by_press * (gains * problem.weight), 0, 2)
        by_offset = problem.of_press[:, None, :, None] * slopes[:, :, None, :]
        both = np.concatenate([by_gain, by_offset.reshape(*mean.shape, -1)], axis=2)
        return problem.whitened(both), problem.parts.shape[1]

    def inner(self, flux: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Best gains and reference depths for some light."""
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
        """AᵀA + P of all unknowns, parameters first, and the right-hand side."""
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
        """Of all unknowns; a parameter at an end that wants beyond it is held."""
        return self._held(*self._normal())

    def _held(self, matrix: FloatArray, slope: FloatArray) -> FloatArray:
        """Solution of matrix x step = slope, parameters first; those at an end that want beyond it are held."""
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

    def polish(self, told: Told) -> None:
        """Steps with the mean light of several seeds and fixed slopes, by the share of information that is shown."""
        problem = self.problem
        for _ in range(POLISH):
            self._settle()
            matrix = told.combined(told.share * (told.information + told.error) + 1.0)
            level = np.exp(problem.parts @ self.log_gains) * problem.weight
            own = problem.whitened(np.moveaxis(self.slopes * level, 0, 2))
            residual = self._residual(self.flux, self.log_gains, self.offset_mm)
            step = self._held(matrix, told.combined(told.share) @ (own.T @ residual) - self.values)
            self.values = np.clip(self.values + step, problem.low, problem.high)
        self._settle()

    def _settle(self) -> None:
        """Mean light where the fit stands, gains and offsets to match."""
        self.flux = self.problem.mean_flux(self.values)
        self.log_gains, self.offset_mm = self.inner(self.flux)

    def gain_covariance(self) -> FloatArray:
        """(gain, gain) of the logarithms of gains, all else unknown."""
        names, gains = len(self.values), self.problem.parts.shape[1]
        return np.asarray(np.linalg.inv(self._normal()[0])[names : names + gains, names : names + gains])

    def told(self, halves: list[FloatArray]) -> Told:
        """What the data tell of the parameters, by slopes (unknown, sample, pair) of two independent halves."""
        nuisance, gains = self._columns(self.flux, self.log_gains, self.offset_mm)
        level = np.exp(self.problem.parts @ self.log_gains) * self.problem.weight
        first, second = (self.problem.whitened(np.moveaxis(half * level, 0, 2)) for half in halves)
        inner = nuisance.T @ nuisance + self._nuisance_information(gains)
        shared = [nuisance.T @ half for half in (first, second)]
        product = first.T @ second - shared[0].T @ np.linalg.solve(inner, shared[1])
        information, vectors = np.linalg.eigh(0.5 * (product + product.T))
        error = _information_error(first @ vectors, second @ vectors, self.problem.shared.sums)
        return Told(vectors=vectors, information=information, error=error)


def _information_error(
    first: FloatArray, second: FloatArray, sums: Callable[[FloatArray], FloatArray]
) -> FloatArray:
    """(direction,) standard error of Σ first x second over readings (reading, direction): `sims.bounds.fisher`.

    With t the mean and d the difference of the halves it is √Σ((t d)² + (d²/2)²); readings that stand against the same
    light have their noise in common, so that `sums` adds them up before the squares.
    """
    mean, off = 0.5 * (first + second), first - second
    return np.asarray(np.sqrt((sums(mean * off) ** 2 + sums(0.5 * off**2) ** 2).sum(axis=0)))


DETERMINED = 0.5
"""A parameter, or a combination, counts as determined if its spread fell to this share of the doubt before, or less."""
NAMED = 0.3
"""Parameters with at least this share of a combination are named in it."""
GOOD_RMS = 2.0
"""Residuals above this many standard deviations say that the model does not explain the build."""


@dataclass(frozen=True, kw_only=True)
class FittedValue:
    """One parameter before and after.

    Attributes
    ----------
    path, unit : dotted path of the design
    before, before_spread : the design's value, and the spread of its doubt
    after, after_spread : fitted value and its standard deviation
    at_end : whether the fit stopped at an end of the doubt
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
        """Spread after over spread before [-]."""
        return self.after_spread / self.before_spread

    @property
    def is_determined(self) -> bool:
        """Whether the data say more than the doubt did."""
        return self.share_left <= DETERMINED


@dataclass(frozen=True, kw_only=True)
class CalibrationReport:
    """A calibration in numbers and words.

    Attributes
    ----------
    values : one a parameter
    undetermined : sentences, the least determined combination first
    notes : what else to know, as sentences
    rms_before, rms_after : residuals in standard deviations [-]
    """

    values: tuple[FittedValue, ...]
    undetermined: tuple[str, ...]
    notes: tuple[str, ...]
    rms_before: float
    rms_after: float

    def to_json(self) -> dict[str, Any]:
        """As plain data."""
        return {
            "values": [vars(one) | {"share_left": one.share_left} for one in self.values],
            "undetermined": list(self.undetermined),
            "notes": list(self.notes),
            "rms_before": self.rms_before,
            "rms_after": self.rms_after,
        }

    @property
    def lines(self) -> list[str]:
        """For people."""
        rows = [
            f"{one.path:<52} {one.before:9.4g} -> {one.after:9.4g} +- {one.after_spread:.2g} {one.unit}"
            f"{'' if one.is_determined else '   (not determined)'}"
            for one in self.values
        ]
        head = f"residuals  {self.rms_before:.1f} -> {self.rms_after:.1f} standard deviations"
        return [head, *rows, *self.undetermined, *self.notes]


def report_of(found: Calibration) -> CalibrationReport:
    """What a calibration amounts to."""
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
    """Combinations of parameters that the data leave open, in plain words, the widest first.

    Parameters
    ----------
    covariance : (unknown, unknown) of the parameters in spreads of their doubt: the unit matrix tells nothing
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
