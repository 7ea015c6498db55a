"""What a model says of readings: touched or not, where, how deep, how surely, how hard."""

from __future__ import annotations

from dataclasses import dataclass

from design.arrays import BoolArray, FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class Prediction:
    """Answers to n frames.

    Attributes
    ----------
    is_touched : (n,) the model's decision
    touch_score : (n,) what the decision rests on: the further above 0, the surer touched; no probability [-]
    press_mm : (n, 3) x, y, depth [mm]; given for every frame, meaningful where there is touch
    sigma_mm : (n, 3) standard deviations of press_mm [mm]; NaN where the model does not know them. Of where the tip is
        (signal map), or of what a stage says, its errors included (learners): the header's settings say `sigma_of`
    force_n : (n,) from the force curve of the model's header, 0 where untouched [N]; None without such a curve
    """

    is_touched: BoolArray
    touch_score: FloatArray
    press_mm: FloatArray
    sigma_mm: FloatArray
    force_n: FloatArray | None
