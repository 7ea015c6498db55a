"""Touched samples as the better learners take them: readings, presses, and which of them are held out for trust."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from design.arrays import BoolArray, FloatArray
from sims.learning.samples.splits import held_out, spread_samples
from sims.learning.samples.training_data import TrainingData

HELD_OUT_SHARE = 0.2
"""Of the locations, for the table of trust."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PressSamples:
    """Samples of touch.

    Attributes
    ----------
    signals : (n, pair) readings less the off state [counts]
    press_mm : (n, 3) [mm]
    is_held_out : (n,) at locations that the fit for trust does without
    """

    signals: FloatArray
    press_mm: FloatArray
    is_held_out: BoolArray

    def __len__(self) -> int:
        return len(self.press_mm)


def press_samples(data: TrainingData, most: int, rng: np.random.Generator) -> PressSamples:
    """At most so many samples of depth 0 and more, spread over presses and depths."""
    touched = np.flatnonzero(data.is_touched)
    chosen = touched[spread_samples(data.press[touched], data.press_mm[touched, 2], most, rng)]
    return PressSamples(
        signals=data.signals[chosen].astype(np.float64),
        press_mm=data.press_mm[chosen],
        is_held_out=held_out(data.location[chosen], HELD_OUT_SHARE, rng),
    )
