"""Predictions of a model from readings: touch, location, depth, their deviations, force."""

from __future__ import annotations

from dataclasses import dataclass

from design.arrays import BoolArray, FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class Prediction:
    """Predictions for n frames.

    Attributes
    ----------
    is_touched : (n,) the model's decision
    touch_score : (n,) score of the decision: higher above 0 means a more certain touch; it is no probability [-]
    press_mm : (n, 3) x, y, depth [mm]; given for every frame, meaningful where there is touch
    sigma_mm : (n, 3) standard deviations of press_mm [mm]; NaN where the model has none. They refer to the tip (signal
        map), or to the stage's position with its errors (learners), as `sigma_of` in the header's settings states
    force_n : (n,) from the force curve of the model's header, 0 where untouched [N]; None without such a curve
    """

    is_touched: BoolArray
    touch_score: FloatArray
    press_mm: FloatArray
    sigma_mm: FloatArray
    force_n: FloatArray | None
