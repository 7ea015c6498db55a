"""A model's predictions for frames: touch, location and depth with their deviations, force."""

from __future__ import annotations

from dataclasses import dataclass

from optopad.design.arrays import BoolArray, FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class Prediction:
    """Predictions for n frames.

    Attributes
    ----------
    is_touched : (n,) whether the model detects a touch
    touch_score : (n,) score of this decision [-]. Above 0 there is touch; the higher the score, the more certain. It is
        not a probability
    press_mm : (n, 3) x, y, depth [mm]; given for every frame, but meaningful only if there is touch
    sigma_mm : (n, 3) standard deviations of `press_mm` [mm]; NaN if the model has none. For a signal map they refer to
        the tip's true position, for other models to the position that the stage reports. `sigma_of` in the header's
        settings says which of the two
    force_n : (n,) force from the force curve in the model's header [N], 0 without touch. None if the header has no
        force curve
    """

    is_touched: BoolArray
    touch_score: FloatArray
    press_mm: FloatArray
    sigma_mm: FloatArray
    force_n: FloatArray | None
