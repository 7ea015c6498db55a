"""Samples, light, noise and unknown parameters of one calibration; `optopad.sims.learning.calibration` has the
equations.

Unknown parameters
------------------
They are the optical tolerances of the design (`optopad.design.spec.tolerances`): heights of emitters and receivers, the
emitting area, the emitters' half angle, reflectances, refractive index and absorption, thickness of the clear layer.
Each is one number for all emitters or all receivers. A uniform prior enters the fit as a normal one of the same spread,
and the fit stays within its limits. Left out: the cavity's length and width and the tip's radius, which a caliper
measures; the black layer; scatter from component to component.

Samples are readings at some depths of every press, while the tip moves in. Light is traced at locations rounded to
`PLACE_MM`, so that symmetric locations remain symmetric.

Errors of the light model that readings share
---------------------------------------------
Locations that are equal by symmetry are traced once. A pair whose light misses the dimple keeps its untouched light. So
on a grid of presses, several readings are compared with the same number from the light model, and share its error. A
parameter is the same for all emitters or all receivers. Its slopes are therefore as symmetric as the errors, which add
up instead of averaging out. If they were treated as independent, the standard deviation would be too small by up to the
root of the number of readings that share one. So

    residual rᵢ = own noise + cᵢ ε_g,   ε_g standard normal, one for a group g,   cᵢ in standard deviations of own noise

with the covariance 1 + c cᵀ in every group, groups being disjoint. Its inverse root is in closed form (Sherman and
Morrison 1950),

    (1 + c cᵀ)^-½ = 1 - f c cᵀ,   f = (1 - (1 + |c|²)^-½) / |c|²

which makes residuals and slopes independent, with spread 1. Left out: errors of neighbouring depths and locations,
which are similar but not equal.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from optopad.design.arrays import FloatArray, IntArray
from optopad.design.errors import InputError
from optopad.design.progress import OnStep
from optopad.design.spec import SensorDesign
from optopad.design.spec.tolerances import UNIT_ENDS, Tolerance, build_tolerances
from optopad.sims.learning.inference.signal_map import ReadingNoise
from optopad.sims.learning.map_learner import Untouched, gain_parts, untouched_of
from optopad.sims.readings.dataset import PressData

DIGITS = 11
"""Light values that agree to this many digits, relative to the brightest, count as the same value of the model."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SharedError:
    """Groups of readings that are compared with the same value of the light model and share its error.

    Attributes
    ----------
    order : (reading,) indices of the readings, group by group
    starts : (group,) position in `order` of each group's first reading
    group : (reading,) number of each reading's group
    """

    order: IntArray
    starts: IntArray
    group: IntArray

    def sums(self, values: FloatArray) -> FloatArray:
        """Sums (group, ...) over the readings of each group, of values (reading, ...)."""
        return np.asarray(np.add.reduceat(values[self.order], self.starts, axis=0))

    def whitened(self, values: FloatArray, shared: FloatArray) -> FloatArray:
        """Transform residuals or slopes (reading, column) so that their errors are independent.

        Parameters
        ----------
        values : (reading, column) residuals or slopes, divided by the standard deviation of each reading's own noise
        shared : (reading,) standard deviation of the shared error, in the same unit
        """
        square = self.sums(shared**2)
        factor = np.where(square > 0.0, (1.0 - (1.0 + square) ** -0.5) / np.maximum(square, 1e-300), 0.0)
        along = factor[:, None] * self.sums(shared[:, None] * values)
        return np.asarray(values - shared[:, None] * along[self.group])


def shared_error(light: FloatArray) -> SharedError:
    """Group readings with equal light; `light` is (sample, pair), and readings are its flattened elements."""
    _, group = np.unique(np.round(light.ravel() / np.abs(light).max(), DIGITS), return_inverse=True)
    group = group.reshape(-1)
    order = np.argsort(group, kind="stable")
    starts = np.flatnonzero(np.diff(group[order], prepend=-1))
    return SharedError(order=order, starts=starts, group=group)


OPTICAL_ENDS = (
    "emitters.height_mm",
    "receivers.height_mm",
    ".active_width_mm",
    ".active_height_mm",
    ".half_angle_deg",
    "surfaces.wall_reflectance",
    "surfaces.bottom_reflectance",
    "elastomer.refractive_index",
    "elastomer.absorption_db_per_cm",
    "cavity.clear_thickness_mm",
)
"""A design field is fitted if its dotted path ends in one of these."""
NORMAL_ENDS = 2.0
"""Distance from the middle of a normal tolerance to its limits, in standard deviations
(`optopad.design.spec.tolerances`)."""


@dataclass(frozen=True, kw_only=True)
class Unknown:
    """One parameter to fit, with its prior.

    Attributes
    ----------
    path, unit : dotted path of the parameter in the design, and its unit
    value : the design's value
    low, high : limits of the prior
    spread : standard deviation of the prior
    """

    path: str
    unit: str
    value: float
    low: float
    high: float
    spread: float

    @property
    def middle(self) -> float:
        """Middle of the prior."""
        return 0.5 * (self.low + self.high)

    @property
    def words(self) -> str:
        """The parameter's name in plain words."""
        last = self.path.rsplit(".", 1)[-1]
        for end, unit in UNIT_ENDS.items():
            last = last.removesuffix(end) if unit == self.unit else last
        kind = self.path.split(".")[0].rstrip("s")
        return f"{kind} {last}".replace("_", " ").replace("part measurement ", "LED ")


def unknowns_of(design: SensorDesign) -> tuple[Unknown, ...]:
    """The optical parameters of a design that were not measured, always in the same order.

    Raises
    ------
    InputError : all of them are measured, so there is nothing to fit.
    """
    found = tuple(_unknown(one) for one in build_tolerances(design) if one.path.endswith(OPTICAL_ENDS))
    if not found:
        raise InputError(
            f"calibrate: {design.name}: all optical values were measured, so none has a tolerance to fit; "
            "train a model on the data instead"
        )
    return found


def _unknown(one: Tolerance) -> Unknown:
    width = one.high - one.low
    spread = width / (2.0 * NORMAL_ENDS) if one.distribution == "normal" else width / np.sqrt(12.0)
    return Unknown(
        path=one.path, unit=one.unit, value=one.value, low=one.low, high=one.high, spread=float(spread)
    )


def with_values(design: SensorDesign, unknowns: tuple[Unknown, ...], values: FloatArray) -> SensorDesign:
    """The design with its unknown parameters set to `values` (unknown,)."""
    return design.with_(**{one.path: float(value) for one, value in zip(unknowns, values, strict=True)})


FEWEST_PRESSES = 5
STATES = 95
"""Approximate number of presses and depths that each step of the fit traces; this takes 1 s to 2 s on one core."""
FEWEST_DEPTHS, MOST_DEPTHS = 3, 10
SHALLOWEST_MM = 0.4
"""Least depth of fitted presses [mm]: lighter ones depend more on the error of depth 0 than on the optics."""
NEAR_MM = 0.15
"""Largest difference between a frame's depth and a required depth at which the frame is used [mm]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class CalibrationSamples:
    """Readings to which the parameters are fitted.

    Attributes
    ----------
    press_mm : (n, 3) x, y, depth as the stage reports them [mm]
    press : (n,) number of the press of each reading, from 0
    press_set : (press,) number of the set that each press belongs to
    signals : (n, pair) readings minus those of the off state [counts]
    untouched : readings of the sensor without contact
    emitters : number of emitters
    """

    press_mm: FloatArray
    press: IntArray
    press_set: IntArray
    signals: FloatArray
    untouched: Untouched
    emitters: int

    @property
    def presses(self) -> int:
        """Number of presses."""
        return int(self.press.max()) + 1


def calibration_samples(data: PressData, deepest_mm: float) -> CalibrationSamples:
    """Choose some readings of each press to fit to.

    Parameters
    ----------
    data : presses with untouched frames
    deepest_mm : deepest press that the design allows [mm]

    Raises
    ------
    InputError : there are too few presses or untouched frames.
    """
    untouched, number = untouched_of(data), data.press_numbers()
    reached = [
        one for one in range(number.max() + 1) if data.press_mm[number == one, 2].max() >= SHALLOWEST_MM
    ]
    if len(reached) < FEWEST_PRESSES:
        raise InputError(
            f"calibrate: {len(reached)} presses of {SHALLOWEST_MM:g} mm and more, needs >= "
            f"{FEWEST_PRESSES}, better 30; press at locations spread over the workspace"
        )
    depths = int(np.clip(STATES // len(reached), FEWEST_DEPTHS, MOST_DEPTHS))
    rows, press = [], []
    for count, one in enumerate(reached):
        chosen = _rows_of(data.press_mm[:, 2], np.flatnonzero(number == one), depths, deepest_mm)
        rows.append(chosen)
        press.append(np.full(len(chosen), count))
    kept = np.concatenate(rows)
    return CalibrationSamples(
        press_mm=data.press_mm[kept],
        press=np.concatenate(press),
        press_set=np.array([data.set_number[number == one][0] for one in reached], dtype=np.int64),
        signals=data.only(kept).features().astype(np.float64),
        untouched=untouched,
        emitters=len(data.emitter_names),
    )


def _rows_of(depth_mm: FloatArray, rows: IntArray, depths: int, deepest_mm: float) -> IntArray:
    """Indices of the frames nearest to the required depths, while the tip of one press moves in."""
    way_in = rows[: int(np.argmax(depth_mm[rows])) + 1]
    end = min(float(depth_mm[way_in].max()), 0.9 * deepest_mm)
    wanted = np.linspace(np.sqrt(SHALLOWEST_MM), np.sqrt(end), depths) ** 2
    nearest = [int(way_in[np.argmin(np.abs(depth_mm[way_in] - one))]) for one in wanted]
    kept = sorted(
        {row for row, one in zip(nearest, wanted, strict=True) if abs(depth_mm[row] - one) <= NEAR_MM}
    )
    return np.array(kept or nearest[-1:], dtype=np.int64)


Light = Callable[[FloatArray, FloatArray, int], FloatArray]
"""Function from parameters (unknown,) [prior standard deviations], presses (n, 3) [mm] and a seed number to flux (n,
pair). Depth 0 is the untouched pad.
"""

MODEL_SHARE = 0.004
SLOPE_STEP = 0.5
"""Step of a parameter for finite differences, in prior standard deviations."""
PLACE_MM = 0.1
"""Light is traced at locations rounded to this step [mm], and extrapolated by its slopes. Presses that differ only by
the stage's error become symmetric again, and are traced once. Over half a step, a signal of 300 counts deviates from a
straight line by about 0.1 counts.
"""
PRESS_STEP = 3.0**0.5
"""Step in x, y and depth to either side for finite differences, in standard deviations of the tip's position."""
HALVES = 2
"""Number of seeds with which slopes are computed independently."""
LIGHTS = 3
"""Number of seeds over which the light of the last steps is averaged; none of them is a seed of the slopes."""
SMALL_FLUX = 1e-12


@dataclass(eq=False)
class Problem:
    """Samples, light and priors of one calibration; counts how often light is traced."""

    light: Light
    samples: CalibrationSamples
    noise: ReadingNoise
    low: FloatArray
    high: FloatArray
    stage_mm: FloatArray
    set_depth_mm: float
    on_step: OnStep
    expected: int
    traces: int = 0

    def __post_init__(self) -> None:
        rows, pairs = self.samples.signals.shape
        mean = self.samples.untouched.mean_counts
        self.signals = np.concatenate([self.samples.signals, mean[None]])
        self.press_mm = np.concatenate([self.samples.press_mm, [[*self.samples.press_mm[0, :2], 0.0]]])
        drift = np.hypot(self.noise.emitter_drift, self.noise.receiver_drift)
        self.variance = self.noise.variance(self.signals) + (drift * self.signals) ** 2
        self.model_counts = MODEL_SHARE * np.maximum(mean, np.median(mean))
        self.parts = gain_parts(self.samples.emitters, pairs)
        self.of_press = np.zeros((rows + 1, self.samples.presses))
        self.of_press[np.arange(rows), self.samples.press] = 1.0
        self.offset_information = self._offset_information()
        self.rounded_mm = self.press_mm.copy()
        self.rounded_mm[:, :2] = np.round(self.press_mm[:, :2] / PLACE_MM) * PLACE_MM

    def _offset_information(self) -> FloatArray:
        """Inverse covariance of the tip's offsets from the stage [1/mm²], in the order x, y, depth for each press."""
        found = np.diag(np.tile(self.stage_mm**-2.0, self.samples.presses))
        is_same_set = self.samples.press_set[:, None] == self.samples.press_set
        own = self.stage_mm[2] ** 2 * np.eye(self.samples.presses)
        found[2::3, 2::3] = np.linalg.inv(own + self.set_depth_mm**2 * is_same_set)
        return np.asarray(found)

    @property
    def spread_mm(self) -> FloatArray:
        """Standard deviations (3,) of the tip's x, y and depth about the traced, rounded location [mm]."""
        rounding = np.array([1.0, 1.0, 0.0]) * PLACE_MM / np.sqrt(12.0)
        return np.asarray(np.hypot(np.hypot(self.stage_mm, [0.0, 0.0, self.set_depth_mm]), rounding))

    def weigh(self, flux: FloatArray, bend_counts: FloatArray) -> None:
        """Set the weights of the readings, and the errors that readings share.

        `bend_counts` is the residual of a linear fit of light over tip positions. Clipped readings get the weight 0.
        """
        variance = self.variance + bend_counts**2
        clip = self.samples.untouched.clip_counts
        is_lost = self.signals >= clip - 3.0 * np.sqrt(variance + self.model_counts**2)
        self.weight = np.where(is_lost, 0.0, variance**-0.5)
        self.shared = shared_error(flux)
        self.shared_spread = (self.model_counts * self.weight).ravel()

    def whitened(self, values: FloatArray) -> FloatArray:
        """Values (sample, pair, column) flattened to (reading, column), and transformed to be independent."""
        return self.shared.whitened(values.reshape(self.signals.size, -1), self.shared_spread)

    def flux(self, values: FloatArray, *, moved_mm: FloatArray | None = None, half: int = 0) -> FloatArray:
        """Light (sample, pair) at the rounded presses, moved by `moved_mm` if given; the last sample is untouched."""
        press_mm = self.rounded_mm.copy()
        if moved_mm is not None:
            press_mm[:-1] += moved_mm
        self.traces += 1
        self.on_step("calibration", min(self.traces / self.expected, 1.0))
        return np.maximum(self.light(values, press_mm, half), SMALL_FLUX)

    def rough_slopes(self, values: FloatArray) -> FloatArray:
        """Change (unknown, sample, pair) of light with each parameter, by one-sided differences within the limits."""
        flux = self.flux(values)
        found = []
        for axis in range(len(values)):
            side = SLOPE_STEP if values[axis] + SLOPE_STEP <= self.high[axis] else -SLOPE_STEP
            found.append((self.flux(_moved(values, axis, side)) - flux) / side)
        return np.array(found)

    def slopes(self, values: FloatArray, half: int) -> FloatArray:
        """Change (unknown, sample, pair) of light with each parameter, by two-sided differences within the limits."""
        found = []
        for axis, value in enumerate(values):
            down = max(-SLOPE_STEP, self.low[axis] - value)
            up = min(SLOPE_STEP, self.high[axis] - value)
            sides = [self.flux(_moved(values, axis, side), half=half) for side in (down, up)]
            found.append((sides[1] - sides[0]) / (up - down))
        return np.array(found)

    def press_slopes(self, values: FloatArray, flux: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Slopes (3, sample, pair) of light by x, y, depth [1/mm], and rms residual (sample, pair) of a linear fit."""
        found, left = [], np.zeros(flux.shape)
        for step in PRESS_STEP * np.diag(self.spread_mm):
            above, below = (self.flux(values, moved_mm=side * step) for side in (1.0, -1.0))
            found.append((above - below) / (2.0 * step.sum()))
            left += 3.0 * ((above + below - 2.0 * flux) / 6.0) ** 2
        return np.array(found), np.sqrt(left)

    def mean_flux(self, values: FloatArray) -> FloatArray:
        """Mean light (sample, pair) of several seeds, none of which is a seed of the slopes."""
        lights = [self.flux(values, half=HALVES + light) for light in range(LIGHTS)]
        return np.asarray(np.mean(lights, axis=0))


def _moved(values: FloatArray, axis: int, by: float) -> FloatArray:
    """A copy of the values, with `by` added to the one at index `axis`."""
    moved = values.copy()
    moved[axis] += by
    return moved
