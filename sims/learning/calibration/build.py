"""A build's twin: the design with what its own presses say of it, and the model that reads the build."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from design.arrays import FloatArray
from design.progress import OnStep
from design.spec import SensorDesign
from sims.bounds.stencil import SEED_GAP
from sims.learning.calibration.fit import Fitted, fitted
from sims.learning.calibration.samples import CalibrationSamples, calibration_samples
from sims.learning.calibration.unknowns import Unknown, unknowns_of, with_values
from sims.learning.inference.signal_map.reading_noise import ReadingNoise
from sims.learning.signal_map.map_learner import chain_noise
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
