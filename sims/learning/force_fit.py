"""Fits modulus and relaxation of a pad's elastomer to the force that a load cell measured under known presses.

Unknowns of the model in `optopad.sims.learning.press_force`, common to all presses:

    a    modulus over the design's modulus, in slow tests (long-time modulus) [-]
    s    share of the instantaneous modulus that relaxes away [-], and its time constant τ [s]
    δ    error of the stage's zero of depth [mm]
    b, r offset of the log's clock [s], and its rate [-]; priors: `CLOCK_SIGMA_S`, `RATE_SIGMA`
    κ    Ting's share of the retraction [-]; prior: `TING_MEAN` ± `TING_SIGMA`, from elastic contact to Ting's
    β    backlash of the stage [mm]; prior: `BACKLASH_SIGMA_MM`

Each press has a tare, and a slope of the tare if there is rest before it and after it; both are eliminated exactly. A
cubic spline through the mean forces of all rests is subtracted before. The sum of squares of (measured - modelled) / σ
is minimised by Levenberg and Marquardt's method from several τ. A sample has σ² = σ_0² + (σ_t dF/dt)²: noise, and
errors of single times, as jitter; both are estimated from the residuals.

Errors are standard errors from three sources, whose variances are added:

    N⁻¹ χ²            Gauss-Newton covariance of all unknowns (N = JᵀJ + priors; χ² per degree of freedom if above 1).
                      An error common to all presses, as that of the clock, is in it.
    (K-1)/K Σ Δ_k²    jackknife: change of the unknowns without press k, Δ_k = -(N - N_k)⁻¹ J_kᵀ r_k. It contains
                      scatter from press to press, which N takes for noise.
    (N⁻¹ Jᵀ ΔF)²      change if the tip's path is a smooth curve between its rows (ΔF) and not straight lines. Rounded
                      ends of the ramps are common to all presses, too, and a slow recording does not show them.

Noise counts in the first two, so the errors are too large rather than too small. Intervals take Student's t for K - 2
degrees of freedom and hold with 95 % for modulus, share, time constant and zero of depth together (Bonferroni: 98.75 %
each). The relaxation is found if the interval of its share excludes 0, if its share is above `LEAST_SHARE`, and if its
time constant is at least twice the least that is searched and below the largest. Otherwise the fit is elastic, and its
distance from the fit with relaxation is added to the errors. A relaxation that is much faster than the ramp cannot be
distinguished from a clock offset of e τ.

Left out: errors of the load cell's scale; errors of the tip's radius and of the layer's thickness, which enter the
modulus: 1 % of the radius is about 0.5 % of the force of a light press (Hertz); more than one time constant; what the
model of the force leaves out.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.special import stdtrit

from optopad.design.arrays import BoolArray, FloatArray
from optopad.design.errors import InputError
from optopad.design.spec import SensorDesign
from optopad.design.spec.properties import youngs_modulus_mpa
from optopad.sims.learning.force_checks import (
    modulus_notes,
    require_misfit,
    require_motion,
    tare_notes,
    unsaturated,
)
from optopad.sims.learning.press_force import (
    BACKLASH_MM,
    CLOCK_S,
    EXCESS,
    LEAST_DEPTH_MM,
    LEAST_REST,
    LOG_MODULUS,
    LOG_TIME,
    MARGIN_MM,
    RATE,
    TING,
    UNKNOWNS,
    ZERO_MM,
    PressWindow,
    TipPath,
    force_at,
    press_windows,
    spans,
)

LEAST_PRESSES = 4
SHORTEST_S, LONGEST_S = 0.05, 60.0
"""Searched range of the time constant [s]."""
STARTS_S = (0.15, 0.5, 1.5, 5.0, 20.0)
"""Time constants from which the search starts [s]."""
FIRST_EXCESS = 0.1
CLOCK_SIGMA_S, RATE_SIGMA = 0.3, 0.005
"""Prior standard deviation of the clock offset [s] and of the clock's rate [-]; the mean of both is 0."""
RAMP_SIGMA_S = 0.05
"""The same of the ramps' times, if they are taken from the force [s]."""
TING_MEAN, TING_SIGMA = 0.5, 0.5
"""Prior mean and standard deviation of Ting's share of the retraction [-]."""
BACKLASH_SIGMA_MM = 0.01
"""Prior standard deviation of the stage's backlash, and of common errors of its depth on the way back [mm]."""
LOWEST = np.array([-np.inf, -0.2, math.log(SHORTEST_S), -MARGIN_MM, -1.0, -0.03, -2.0, -0.1])
HIGHEST = np.array([np.inf, 19.0, math.log(LONGEST_S), MARGIN_MM, 1.0, 0.03, 3.0, 0.1])
"""Bounds of the unknowns, in the order of `optopad.sims.learning.press_force`."""
STEPS = np.array([1e-4, 1e-4, 1e-3, 1e-4, 1e-2, 1e-4, 1e-3, 1e-4])
"""Steps of the differences that give the slopes; the clock's are long, so that noise of the depth averages out."""
CLOCKS_S = tuple(np.arange(-25, 26) / 50.0)
"""Clock offsets beyond the first match that the search begins with [s]."""
FIRST_ERROR, FIRST_JITTER_S, LEAST_JITTER_S = 0.005, 0.02, 1e-4
"""Errors of a sample at first, over the largest force [-], and of its time [s]; and least error of its time."""
STEEP = 0.1
"""A sample is steep where the force changes faster than this share of its fastest change [-]."""
ROUNDS, SHORT_ROUNDS, SETTLED = 40, 12, 1e-6
FOUND_SIGMAS, LEAST_SHARE = 2.0, 0.005
"""Standard errors above which a trend counts, and share above which a relaxation does [-]."""
CONFIDENCE, STATED = 0.95, 4
"""Probability with which all stated intervals hold together [-], and their number."""
GOOD_ERROR = 0.02
"""Relative error of the modulus for which the number of sufficient presses is stated [-]."""

WITH_RELAXATION = np.ones(UNKNOWNS, dtype=bool)
ELASTIC = WITH_RELAXATION.copy()
ELASTIC[[EXCESS, LOG_TIME, TING]] = False
APPROACH = WITH_RELAXATION.copy()
APPROACH[[TING, BACKLASH_MM]] = False


@dataclass(frozen=True, kw_only=True)
class ForceFit:
    """Fitted modulus and relaxation, with standard errors.

    Attributes
    ----------
    modulus_mpa, modulus_sigma_mpa : long-time Young's modulus [MPa]
    relaxed_share, share_sigma : share of the instantaneous modulus that relaxes away [-], also if none was found
    time_constant_s, time_sigma_s : its time constant [s]; None if no relaxation was found
    offset_mm, offset_sigma_mm : true depth minus the stage's depth [mm]
    clock_s, clock_sigma_s : offset of the log's clock, beyond the one that was given [s]
    clock_rate, rate_sigma : seconds of the recording's clock over those of the log's, less 1 [-]
    single_mpa : (press,) modulus of each press by itself, in the order of the recording [MPa]
    rms_n : root mean square of measured less fitted force [N]
    design_mpa : modulus of the design before the fit [MPa]
    notes : what was left out or is doubtful, as sentences
    """

    modulus_mpa: float
    modulus_sigma_mpa: float
    relaxed_share: float
    share_sigma: float
    time_constant_s: float | None
    time_sigma_s: float | None
    offset_mm: float
    offset_sigma_mm: float
    clock_s: float
    clock_sigma_s: float
    clock_rate: float
    rate_sigma: float
    single_mpa: FloatArray
    rms_n: float
    design_mpa: float
    notes: tuple[str, ...] = ()

    @property
    def relative_sigma(self) -> float:
        """Standard error of the modulus, and so of every force, over its value [-]."""
        return self.modulus_sigma_mpa / self.modulus_mpa

    @property
    def quantile(self) -> float:
        """Half width of an interval over its standard error [-]."""
        return _quantile(len(self.single_mpa))

    @property
    def intervals(self) -> dict[str, tuple[float, float]]:
        """Intervals that hold together with 95 %, by name and unit; that of the time constant if one was found."""
        wide = self.quantile
        found = {
            "youngs_modulus_mpa": (self.modulus_mpa, wide * self.modulus_sigma_mpa),
            "relaxed_share": (self.relaxed_share, wide * self.share_sigma),
            "depth_offset_mm": (self.offset_mm, wide * self.offset_sigma_mm),
        }
        intervals = {name: (value - half, value + half) for name, (value, half) in found.items()}
        least, most = np.clip(intervals["relaxed_share"], 0.0, 1.0).tolist()
        intervals["relaxed_share"] = (0.0 if self.time_constant_s is None else least, most)
        if self.time_constant_s is not None and self.time_sigma_s is not None:
            factor = math.exp(wide * self.time_sigma_s / self.time_constant_s)
            intervals["time_constant_s"] = (self.time_constant_s / factor, self.time_constant_s * factor)
        return intervals

    @property
    def scatter(self) -> float:
        """Standard deviation of the modulus of single presses over its mean [-]."""
        return float(self.single_mpa.std(ddof=1) / self.single_mpa.mean())

    @property
    def sufficient(self) -> int:
        """Number of presses for a standard error of 2 % by the scatter of single presses."""
        return max(LEAST_PRESSES, math.ceil((self.scatter / GOOD_ERROR) ** 2))

    @property
    def trend(self) -> tuple[float, float]:
        """Relative change of the modulus from the first press to the last, by a straight line, and its error [-]."""
        count = len(self.single_mpa)
        place = np.linspace(-0.5, 0.5, count)
        relative = self.single_mpa / self.single_mpa.mean() - 1.0
        slope = float(place @ relative / (place @ place))
        rest = relative - slope * place
        return slope, float(np.sqrt((rest @ rest) / max(count - 2, 1) / (place @ place)))

    def applied(self, design: SensorDesign) -> SensorDesign:
        """The design with the fitted modulus and, if it was found, relaxation."""
        changes: dict[str, object] = {"elastomer.youngs_modulus_mpa": float(f"{self.modulus_mpa:.5g}")}
        if self.time_constant_s is not None:
            changes["elastomer.viscoelastic"] = {
                "relaxed_share": float(f"{self.relaxed_share:.4g}"),
                "time_constant_s": float(f"{self.time_constant_s:.4g}"),
            }
        return design.with_(**changes)

    def to_json(self) -> dict[str, object]:
        """The fit as plain data."""
        change, error = self.trend
        return {
            "youngs_modulus_mpa": self.modulus_mpa,
            "youngs_modulus_sigma_mpa": self.modulus_sigma_mpa,
            "design_modulus_mpa": self.design_mpa,
            "relaxed_share": self.relaxed_share,
            "relaxed_share_sigma": self.share_sigma,
            "time_constant_s": self.time_constant_s,
            "time_constant_sigma_s": self.time_sigma_s,
            "depth_offset_mm": self.offset_mm,
            "depth_offset_sigma_mm": self.offset_sigma_mm,
            "presses": len(self.single_mpa),
            "press_scatter": self.scatter,
            "sufficient_presses": self.sufficient,
            "trend": change,
            "trend_sigma": error,
            "rms_n": self.rms_n,
            "clock_offset_s": self.clock_s,
            "clock_offset_sigma_s": self.clock_sigma_s,
            "clock_rate": self.clock_rate,
            "clock_rate_sigma": self.rate_sigma,
            "intervals_95": {name: list(ends) for name, ends in self.intervals.items()},
            "notes": list(self.notes),
        }

    @property
    def lines(self) -> list[str]:
        """Lines for the screen; ± and ranges are intervals that hold together with 95 %."""
        wide, intervals = self.quantile, self.intervals
        lines = [
            f"modulus   {self.modulus_mpa:.3g} ± {wide * self.modulus_sigma_mpa:.2g} MPa (95 %; design "
            f"{self.design_mpa:.3g} MPa), {len(self.single_mpa)} presses"
        ]
        if self.time_constant_s is None:
            lines.append(f"relaxes   not found; the share is below {intervals['relaxed_share'][1]:.2g}")
        else:
            low, high = intervals["time_constant_s"]
            share = f"{self.relaxed_share:.3f} ± {wide * self.share_sigma:.2g}"
            lines.append(
                f"relaxes   {share} of the force, in {self.time_constant_s:.3g} s ({low:.3g} to {high:.3g})"
            )
        lines.append(
            f"force     is as uncertain as the modulus, {_percent(wide * self.relative_sigma)}; "
            f"rms rest {1e3 * self.rms_n:.2g} mN; "
            f"zero of depth {self.offset_mm:+.3f} ± {wide * self.offset_sigma_mm:.2g} mm"
        )
        if self.rate_sigma > 0.0:
            lines.append(
                f"clock     of the log: {1e3 * self.clock_s:+.3g} ± {1e3 * wide * self.clock_sigma_s:.2g} ms from its "
                f"first match, rate {100 * self.clock_rate:+.2g} ± {_percent(wide * self.rate_sigma)}"
            )
        change, error = self.trend
        drifts = abs(change) > FOUND_SIGMAS * error
        moved = f"{100 * change:+.2g} ± {_percent(error)}"
        trend = f"; the modulus changed by {moved} over the recording" if drifts else ""
        off = _percent(2 * math.hypot(self.scatter, self.relative_sigma))
        enough = f"{self.sufficient} presses give {_percent(GOOD_ERROR)}"
        lines.append(f"repeat    when a check press is off by more than {off} ({enough}{trend})")
        return [*lines, *self.notes]


def fit_force(
    design: SensorDesign,
    time_s: FloatArray,
    path: TipPath,
    force_n: FloatArray,
    on_step: Callable[[float], None] = lambda _share: None,
) -> ForceFit:
    """Fit modulus, relaxation, zero of depth and clock to a measured force.

    Parameters
    ----------
    time_s : (n,) increasing times of the log, by the recording's clock as far as its offset is known [s]
    path : positions of the tip by the recording's clock
    force_n : (n,) measured force [N]
    on_step : called with the finished share

    Raises
    ------
    InputError : there are fewer than 4 usable presses, the force does not increase with depth or does not follow the
        presses, or the fit is not plausible.
    ModelScopeError : the contact model does not cover a press.
    """
    require_motion(path)
    windows = press_windows(design, path, time_s, force_n)
    kept, notes = _of_one_kind(windows)
    windows, lost = unsaturated(kept, _noise_n(kept))
    notes = (*notes, *lost)
    _require_presses(windows, path, time_s, notes)
    problem = _Problem.of(windows)
    approach, relaxing, elastic_only = (
        free & problem.fitted for free in (APPROACH, WITH_RELAXATION, ELASTIC)
    )
    start = problem.started()
    tried = []
    for k, tau in enumerate(STARTS_S):
        first = start.copy()
        first[[EXCESS, LOG_TIME]] = FIRST_EXCESS, math.log(tau)
        tried.append(problem.solved(first, approach, rounds=SHORT_ROUNDS))
        on_step((k + 1) / (len(STARTS_S) + 2))
    best = min(tried, key=lambda one: one.cost)
    full, problem = _settled(problem, best.at, relaxing)
    on_step((len(STARTS_S) + 1) / (len(STARTS_S) + 2))
    elastic = problem.solved(_without_relaxation(full.at), elastic_only)
    made = _named(design, problem, full, elastic)
    return replace(
        made,
        notes=(*notes, *tare_notes(windows), *modulus_notes(design, made.intervals["youngs_modulus_mpa"])),
    )


def _settled(problem: _Problem, at: FloatArray, free: BoolArray) -> tuple[_Solved, _Problem]:
    """Solution, and problem with weights by its residuals."""
    found = problem.solved(at, free)
    for _ in range(2):
        problem = problem.reweighted(found.at)
        found = problem.solved(found.at, free)
    return found, problem


def _without_relaxation(at: FloatArray) -> FloatArray:
    changed = at.copy()
    changed[[EXCESS, TING]] = 0.0
    return changed


def _of_one_kind(windows: list[PressWindow]) -> tuple[list[PressWindow], tuple[str, ...]]:
    """Presses whose motion is recorded, or if they are too few, those whose hold alone is used; and a note on these."""
    moving = [one for one in windows if not one.jumps]
    if len(moving) >= LEAST_PRESSES or len(moving) == len(windows):
        return moving, ()
    held = [one for one in windows if one.jumps]
    return held, (
        f"the depth of {len(held)} presses jumps to its value, so the tip was not there during the motion: only their "
        "holds are used, with ramps as the force shows them; join the stage's own positions with --stage for more",
    )


def _require_presses(
    windows: list[PressWindow], path: TipPath, time_s: FloatArray, notes: tuple[str, ...]
) -> None:
    if len(windows) >= LEAST_PRESSES:
        return
    deep, rate = len(spans(path)), 1.0 / float(np.median(np.diff(time_s))) if len(time_s) > 1 else 0.0
    if notes and deep >= LEAST_PRESSES:
        raise InputError(f"{len(windows)} presses can be used, needs {LEAST_PRESSES}: {'; '.join(notes)}")
    raise InputError(
        f"the force log covers {len(windows)} of {deep} presses of {LEAST_DEPTH_MM} mm and deeper with {LEAST_REST} "
        f"samples at rest around them; needs {LEAST_PRESSES}: it has {rate:.3g} samples a second, so leave "
        f"{max(0.5, 2 * LEAST_REST / max(rate, 0.1)):.2g} s of rest before and after each press, and press more often; "
        "10 presses at several depths are good"
    )


@dataclass(frozen=True, kw_only=True)
class _Solved:
    """Unknowns at the least sum of squares, and normal matrices (press, free, free) and gradients (press, free)."""

    at: FloatArray
    free: BoolArray
    cost: float
    normal: FloatArray
    gradient: FloatArray


@dataclass(frozen=True, kw_only=True)
class _Problem:
    """Windows with a weight per sample, 1/σ [1/N], and an orthonormal basis of the tares of each."""

    windows: list[PressWindow]
    weights: list[FloatArray]
    bases: list[FloatArray]
    noise_n: float
    middle_s: float

    @property
    def fitted(self) -> BoolArray:
        """(`UNKNOWNS`,) unknowns that the samples depend on; without the ramps, not the rate or the retraction."""
        found = np.ones(UNKNOWNS, dtype=bool)
        found[[RATE, TING, BACKLASH_MM]] = not self.windows[0].jumps
        return found

    @property
    def prior_sigmas(self) -> FloatArray:
        """(`UNKNOWNS`,) prior standard deviations; without the ramps, the clock's is that of the ramps' times."""
        found = np.full(UNKNOWNS, np.inf)
        found[[CLOCK_S, RATE, TING]] = CLOCK_SIGMA_S, RATE_SIGMA, TING_SIGMA
        found[BACKLASH_MM] = BACKLASH_SIGMA_MM
        if self.windows[0].jumps:
            found[CLOCK_S] = RAMP_SIGMA_S
        return found

    def prior(self, at: FloatArray, free: BoolArray) -> FloatArray:
        """(free,) distance of the unknowns from their prior means, in standard deviations."""
        means = TING_MEAN * (np.arange(UNKNOWNS) == TING)
        found: FloatArray = ((at - means) / self.prior_sigmas)[free]
        return found

    def prior_normal(self, free: BoolArray) -> FloatArray:
        """(free, free) normal matrix of the priors."""
        return np.diag(self.prior_sigmas[free] ** -2.0)

    @classmethod
    def of(cls, windows: list[PressWindow]) -> _Problem:
        """The problem with weights by the noise at rest, and by the jitter times the measured slope."""
        noise = max(_noise_n(windows), 1e-4 * max(float(np.ptp(one.force_n)) for one in windows))
        slopes = [np.gradient(one.force_n, one.time_s) for one in windows]
        middle = float(np.mean([one.time_s.mean() for one in windows]))
        made = cls(windows=windows, weights=[], bases=[], noise_n=noise, middle_s=middle)
        coarse = math.hypot(noise, FIRST_ERROR * max(float(np.ptp(one.force_n)) for one in windows))
        return made.weighted(coarse, FIRST_JITTER_S, slopes)

    def weighted(self, noise_n: float, jitter_s: float, slopes: list[FloatArray]) -> _Problem:
        weights = [
            one.used / np.hypot(noise_n, jitter_s * slope)
            for one, slope in zip(self.windows, slopes, strict=True)
        ]
        bases = [one.tare_basis(weight) for one, weight in zip(self.windows, weights, strict=True)]
        return replace(self, weights=weights, bases=bases)

    def reweighted(self, at: FloatArray) -> _Problem:
        """The problem less a smooth tare, with noise and jitter by the residuals at a solution."""
        return replace(self, windows=self._detrended(at))._reweighted(at)

    def _reweighted(self, at: FloatArray) -> _Problem:
        rests = [self.unweighted(k, at) for k in range(len(self.windows))]
        slopes = [self.slope(k, at) for k in range(len(self.windows))]
        used = np.concatenate([one.used for one in self.windows])
        rest, slope = np.concatenate(rests)[used], np.concatenate(slopes)[used]
        steep = np.abs(slope) > STEEP * np.abs(slope).max()
        noise = math.sqrt(float(np.mean(rest[~steep] ** 2))) if (~steep).any() else self.noise_n
        noise = max(noise, 1e-4 * max(float(np.ptp(one.force_n)) for one in self.windows))
        jitter = LEAST_JITTER_S
        if steep.any():
            beyond = float(np.mean((rest[steep] ** 2 - noise**2) / slope[steep] ** 2))
            jitter = math.sqrt(max(beyond, LEAST_JITTER_S**2))
        return self.weighted(noise, jitter, slopes)

    def _detrended(self, at: FloatArray) -> list[PressWindow]:
        """The windows less a cubic spline through the mean forces of all rests."""
        times = np.concatenate([one.time_s for one in self.windows])
        is_free = np.concatenate([force_at(one, at, self.middle_s) == 0.0 for one in self.windows])
        times, first = np.unique(times[is_free], return_index=True)
        force = np.concatenate([one.force_n for one in self.windows])[is_free][first]
        turns = [one.node_s[one.turn] for one in self.windows]
        groups = np.searchsorted(turns, times)
        found, counts = np.unique(groups, return_counts=True)
        kept = found[counts >= LEAST_REST]
        if len(kept) < LEAST_PRESSES:
            return self.windows
        knots = [float(times[groups == one].mean()) for one in kept]
        levels = [float(force[groups == one].mean()) for one in kept]
        spline = CubicSpline(knots, levels, bc_type="natural")

        def tare(time_s: FloatArray) -> FloatArray:
            inside = np.clip(time_s, knots[0], knots[-1])  # straight on beyond the ends
            ends = (
                (levels[1] - levels[0]) / (knots[1] - knots[0]),
                (levels[-1] - levels[-2]) / (knots[-1] - knots[-2]),
            )
            beyond = np.where(time_s < knots[0], ends[0], ends[1]) * (time_s - inside)
            return np.asarray(spline(inside) + beyond, dtype=np.float64)

        return [replace(one, force_n=one.force_n - tare(one.time_s)) for one in self.windows]

    def slope(self, k: int, at: FloatArray) -> FloatArray:
        """(sample,) change of the modelled force over time [N/s]."""
        step = STEPS[CLOCK_S] * (np.arange(UNKNOWNS) == CLOCK_S)
        higher, lower = (force_at(self.windows[k], at + sign * step, self.middle_s) for sign in (1.0, -1.0))
        slope: FloatArray = (higher - lower) / (2.0 * STEPS[CLOCK_S])
        return slope

    def unweighted(self, k: int, at: FloatArray) -> FloatArray:
        """(sample,) measured less modelled force, less the best tare [N]."""
        window, weight = self.windows[k], self.weights[k]
        rest = weight * (window.force_n - force_at(window, at, self.middle_s))
        found: FloatArray = (rest - self.bases[k] @ (self.bases[k].T @ rest)) / np.where(
            weight > 0.0, weight, 1.0
        )
        return found

    def projected(self, k: int, force_n: FloatArray) -> FloatArray:
        """(sample,) weighted force, less what a tare explains [-]."""
        values = self.weights[k] * force_n
        found: FloatArray = values - self.bases[k] @ (self.bases[k].T @ values)
        return found

    def started(self) -> FloatArray:
        """Unknowns from which the search starts: of an elastic pad, with clock and modulus by least squares.

        Raises
        ------
        InputError : the force does not increase with depth.
        """
        tried = [self._scaled(clock) for clock in (CLOCKS_S if self.fitted[RATE] else (0.0,))]
        best = max(tried, key=lambda one: abs(one[0]))
        if best[0] <= 0.0:
            raise InputError(
                "the force falls where the depth rises; is its sign reversed (it must be positive when pressed: negate "
                "the column), or is the log of another recording?"
            )
        return best[1]

    def _scaled(self, clock_s: float) -> tuple[float, FloatArray]:
        """Correlation of the measured and the elastic force at a clock offset, and the unknowns there."""
        at = clock_s * (np.arange(UNKNOWNS) == CLOCK_S)
        both = square = 0.0
        for k, window in enumerate(self.windows):
            model = self.projected(k, force_at(window, at, self.middle_s))
            both += float(model @ self.projected(k, window.force_n))
            square += float(model @ model)
        at[LOG_MODULUS] = math.log(max(both, 1e-300) / square) if square > 0.0 else 0.0
        return both / math.sqrt(square) if square > 0.0 else 0.0, at

    def cost(self, at: FloatArray, free: BoolArray) -> float:
        prior = self.prior(at, free)
        cost = float(prior @ prior)
        for k, window in enumerate(self.windows):
            rest = self.projected(k, window.force_n - force_at(window, at, self.middle_s))
            cost += float(rest @ rest)
        return cost

    def linearised(self, at: FloatArray, free: BoolArray) -> tuple[FloatArray, FloatArray, float]:
        """Normal matrices (press, free, free), gradients J'r (press, free), and the sum of squares without priors."""
        places = np.flatnonzero(free)
        normal = np.empty((len(self.windows), len(places), len(places)))
        gradient, cost = np.empty((len(self.windows), len(places))), 0.0
        for k, window in enumerate(self.windows):
            rest = self.projected(k, window.force_n - force_at(window, at, self.middle_s))
            slopes = self.slopes(k, at, free)
            normal[k], gradient[k] = slopes @ slopes.T, slopes @ rest
            cost += float(rest @ rest)
        return normal, gradient, cost

    def slopes(self, k: int, at: FloatArray, free: BoolArray) -> FloatArray:
        """(free, sample) change of the weighted model with each free unknown, less what a tare explains."""
        window, places = self.windows[k], np.flatnonzero(free)
        slopes = np.empty((len(places), len(window.time_s)))
        for row, place in enumerate(places):
            if place == LOG_MODULUS:
                slopes[row] = self.projected(k, force_at(window, at, self.middle_s))
                continue
            step = STEPS[place] * (np.arange(UNKNOWNS) == place)
            higher, lower = (force_at(window, at + sign * step, self.middle_s) for sign in (1.0, -1.0))
            slopes[row] = self.projected(k, (higher - lower) / (2.0 * STEPS[place]))
        return slopes

    def rounding(self, k: int, at: FloatArray) -> FloatArray:
        """(sample,) weighted change of the model if the path is a smooth curve between its rows."""
        window = self.windows[k]
        rounded = replace(window, node_mm=window.rounded_mm)
        change = force_at(rounded, at, self.middle_s) - force_at(window, at, self.middle_s)
        return self.projected(k, change)

    def solved(self, at: FloatArray, free: BoolArray, rounds: int = ROUNDS) -> _Solved:
        """Least squares by Levenberg and Marquardt's method, within the bounds."""
        places, damping = np.flatnonzero(free), 1e-3
        at = np.clip(at, LOWEST, HIGHEST)
        normal, gradient, cost = self.linearised(at, free)
        cost += float(np.sum(self.prior(at, free) ** 2))
        for _ in range(rounds):
            matrix = normal.sum(axis=0) + self.prior_normal(free)
            pull = gradient.sum(axis=0) - self.prior(at, free) / self.prior_sigmas[free]
            trial, gained = at, 0.0
            for _ in range(8):
                damped = matrix + damping * np.diag(np.diag(matrix)) + 1e-12 * np.eye(len(places))
                trial = at.copy()
                trial[places] += np.linalg.solve(damped, pull)
                trial = np.clip(trial, LOWEST, HIGHEST)
                gained = cost - self.cost(trial, free)
                if gained >= 0.0:
                    damping = max(damping / 10.0, 1e-9)
                    break
                damping *= 10.0
            if gained < 0.0:
                break
            at = trial
            normal, gradient, cost = self.linearised(at, free)
            cost += float(np.sum(self.prior(at, free) ** 2))
            if gained < SETTLED * max(cost, 1.0):
                break
        return _Solved(at=at, free=free, cost=cost, normal=normal, gradient=gradient)


def _noise_n(windows: list[PressWindow]) -> float:
    """Standard deviation of the load cell's noise, from differences of neighbouring samples at rest [N]."""
    steps = []
    for one in windows:
        steps += [np.diff(rest) for rest in one.at_rest_n]
    pooled = np.abs(np.concatenate([*steps, np.zeros(0)]))
    return float(1.4826 * np.median(pooled) / math.sqrt(2.0)) if pooled.size else 0.0


def _sigmas(problem: _Problem, found: _Solved) -> FloatArray:
    """(`UNKNOWNS`,) standard errors of the unknowns, by the module's three sources; 0 for fixed ones."""
    inner = found.free & (found.at > LOWEST) & (found.at < HIGHEST)
    keep = inner[found.free]
    normal = found.normal[:, keep][:, :, keep]
    gradient = found.gradient[:, keep]
    prior = problem.prior_normal(inner)
    total = normal.sum(axis=0) + prior
    samples = sum(int(np.count_nonzero(weight)) for weight in problem.weights)
    tares = sum(basis.shape[1] for basis in problem.bases)
    chi = max(1.0, found.cost / max(samples - tares - int(inner.sum()), 1))
    count = len(normal)
    moved = np.array([np.linalg.solve(total - normal[k], -gradient[k]) for k in range(count)])
    scatter = (count - 1) / count * np.sum((moved - moved.mean(axis=0)) ** 2, axis=0)
    pull = sum(problem.slopes(k, found.at, inner) @ problem.rounding(k, found.at) for k in range(count))
    sigmas = np.zeros(UNKNOWNS)
    sigmas[inner] = np.sqrt(np.diag(np.linalg.inv(total)) * chi + scatter + np.linalg.solve(total, pull) ** 2)
    return sigmas


def _named(design: SensorDesign, problem: _Problem, full: _Solved, elastic: _Solved) -> ForceFit:
    sigmas, excess = _sigmas(problem, full), float(full.at[EXCESS])
    share, share_sigma = excess / (1.0 + excess), float(sigmas[EXCESS]) / (1.0 + excess) ** 2
    count = len(problem.windows)
    wide = _quantile(count)
    tau = math.exp(full.at[LOG_TIME])
    is_inside = 2.0 * SHORTEST_S < tau < LONGEST_S / 1.01
    is_found = is_inside and share > max(wide * share_sigma, LEAST_SHARE)
    chosen = full if is_found else elastic
    if not is_found:
        sigmas = np.hypot(_sigmas(problem, elastic), elastic.at - full.at)
        share = max(share, 0.0)
    modulus = youngs_modulus_mpa(design)
    factor = math.exp(chosen.at[LOG_MODULUS])
    rests = [problem.unweighted(k, chosen.at) for k in range(count)]
    require_misfit(
        problem.windows, rests, [force_at(one, chosen.at, problem.middle_s) for one in problem.windows]
    )
    if abs(chosen.at[ZERO_MM]) > 0.99 * MARGIN_MM:
        raise InputError(
            f"the zero of depth is off by {MARGIN_MM:g} mm or more, the most that is searched: the fit failed; check "
            "where the stage's depth is 0 (first contact), and that the log is this recording's"
        )
    return ForceFit(
        modulus_mpa=modulus * factor,
        modulus_sigma_mpa=modulus * factor * float(sigmas[LOG_MODULUS]),
        relaxed_share=share,
        share_sigma=share_sigma,
        time_constant_s=tau if is_found else None,
        time_sigma_s=tau * float(sigmas[LOG_TIME]) if is_found else None,
        offset_mm=float(chosen.at[ZERO_MM]),
        offset_sigma_mm=float(sigmas[ZERO_MM]),
        clock_s=float(chosen.at[CLOCK_S]),
        clock_sigma_s=float(sigmas[CLOCK_S]),
        clock_rate=float(chosen.at[RATE]),
        rate_sigma=float(sigmas[RATE]),
        single_mpa=modulus * factor * np.array([_single(problem, k, chosen.at) for k in range(count)]),
        rms_n=math.sqrt(
            float(
                np.mean(
                    np.concatenate([part[one.used] for part, one in zip(rests, problem.windows, strict=True)])
                    ** 2
                )
            )
        ),
        design_mpa=modulus,
    )


def _quantile(presses: int) -> float:
    """Student's t for intervals that hold together; two degrees less than presses, for a and δ [-]."""
    return float(stdtrit(presses - 2, 1.0 - (1.0 - CONFIDENCE) / (2 * STATED)))


def _single(problem: _Problem, k: int, at: FloatArray) -> float:
    """Modulus of one press over that of the fit, with the other unknowns of the fit [-]."""
    window = problem.windows[k]
    model = problem.projected(k, force_at(window, at, problem.middle_s))
    return float(model @ problem.projected(k, window.force_n) / (model @ model))


def _percent(share: float) -> str:
    return f"{100 * share:.2g} %"
