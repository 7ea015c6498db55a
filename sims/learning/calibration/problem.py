"""Samples, light and noise of one calibration: what `sims.learning.calibration.fit` minimises, and where it traces.

The equations are there. Light is traced at places rounded to `PLACE_MM`, so that symmetric ones stay so.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from design.arrays import FloatArray
from design.progress import OnStep
from sims.learning.calibration.samples import CalibrationSamples
from sims.learning.calibration.shared_error import shared_error
from sims.learning.inference.signal_map.reading_noise import ReadingNoise
from sims.learning.signal_map.map_learner import gain_parts

Light = Callable[[FloatArray, FloatArray, int], FloatArray]
"""Flux (n, pair) of parameters (unknown,) in spreads and presses (n, 3), depth 0 untouched; by one of several seeds."""

MODEL_SHARE = 0.004
SLOPE_STEP = 0.5
"""Step of the differences by a parameter, in spreads of its doubt."""
PLACE_MM = 0.1
"""Light is traced at places rounded to this and carried to the place itself by the slopes: what a stage's error had
kept apart is symmetric again, and traced once. Over half of it a signal of 300 counts bends by about 0.1 counts."""
PRESS_STEP = 3.0**0.5
"""Step of the differences by x, y and depth to either side, in standard deviations of where the tip may be."""
HALVES = 2
"""Seeds of the slopes."""
LIGHTS = 3
"""Seeds whose mean light the last steps are taken with, none of them a seed of the slopes."""
SMALL_FLUX = 1e-12


@dataclass(eq=False)
class Problem:
    """Samples, light and priors of one calibration; counts the traces."""

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
        """(offset, offset) inverse covariance of the tips beside the stage, x, y and depth of each press [1/mm²]."""
        found = np.diag(np.tile(self.stage_mm**-2.0, self.samples.presses))
        is_same_set = self.samples.press_set[:, None] == self.samples.press_set
        own = self.stage_mm[2] ** 2 * np.eye(self.samples.presses)
        found[2::3, 2::3] = np.linalg.inv(own + self.set_depth_mm**2 * is_same_set)
        return np.asarray(found)

    @property
    def spread_mm(self) -> FloatArray:
        """(3,) how far the tip may be from where light is traced, standard deviations [mm]."""
        rounding = np.array([1.0, 1.0, 0.0]) * PLACE_MM / np.sqrt(12.0)
        return np.asarray(np.hypot(np.hypot(self.stage_mm, [0.0, 0.0, self.set_depth_mm]), rounding))

    def weigh(self, flux: FloatArray, bend_counts: FloatArray) -> None:
        """Set weights of readings, and what they share, for some light and the signal that its bends leave."""
        variance = self.variance + bend_counts**2
        clip = self.samples.untouched.clip_counts
        is_lost = self.signals >= clip - 3.0 * np.sqrt(variance + self.model_counts**2)
        self.weight = np.where(is_lost, 0.0, variance**-0.5)
        self.shared = shared_error(flux)
        self.shared_spread = (self.model_counts * self.weight).ravel()

    def whitened(self, values: FloatArray) -> FloatArray:
        """(reading, column) of values (sample, pair, column) in standard deviations, made independent."""
        return self.shared.whitened(values.reshape(self.signals.size, -1), self.shared_spread)

    def flux(self, values: FloatArray, *, moved_mm: FloatArray | None = None, half: int = 0) -> FloatArray:
        """(sample, pair) light of parameters at the rounded places, moved by (3,); untouched in the last row."""
        press_mm = self.rounded_mm.copy()
        if moved_mm is not None:
            press_mm[:-1] += moved_mm
        self.traces += 1
        self.on_step("calibration", min(self.traces / self.expected, 1.0))
        return np.maximum(self.light(values, press_mm, half), SMALL_FLUX)

    def rough_slopes(self, values: FloatArray) -> FloatArray:
        """(unknown, sample, pair) change of light with each parameter, by differences towards the inside."""
        flux = self.flux(values)
        found = []
        for axis in range(len(values)):
            side = SLOPE_STEP if values[axis] + SLOPE_STEP <= self.high[axis] else -SLOPE_STEP
            found.append((self.flux(_moved(values, axis, side)) - flux) / side)
        return np.array(found)

    def slopes(self, values: FloatArray, half: int) -> FloatArray:
        """(unknown, sample, pair) the same by differences to both sides, as far as the doubt's ends let them."""
        found = []
        for axis, value in enumerate(values):
            down = max(-SLOPE_STEP, self.low[axis] - value)
            up = min(SLOPE_STEP, self.high[axis] - value)
            sides = [self.flux(_moved(values, axis, side), half=half) for side in (down, up)]
            found.append((sides[1] - sides[0]) / (up - down))
        return np.array(found)

    def press_slopes(self, values: FloatArray, flux: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(3, sample, pair) slopes of light by x, y and depth [1/mm]; (sample, pair) rms of what they leave [-]."""
        found, left = [], np.zeros(flux.shape)
        for step in PRESS_STEP * np.diag(self.spread_mm):
            above, below = (self.flux(values, moved_mm=side * step) for side in (1.0, -1.0))
            found.append((above - below) / (2.0 * step.sum()))
            left += 3.0 * ((above + below - 2.0 * flux) / 6.0) ** 2
        return np.array(found), np.sqrt(left)

    def mean_flux(self, values: FloatArray) -> FloatArray:
        """(sample, pair) mean light of several seeds that no slope has."""
        lights = [self.flux(values, half=HALVES + light) for light in range(LIGHTS)]
        return np.asarray(np.mean(lights, axis=0))


def _moved(values: FloatArray, axis: int, by: float) -> FloatArray:
    """A copy with one value moved."""
    moved = values.copy()
    moved[axis] += by
    return moved
