"""Which samples the tables and pictures need: a data set has ten times as many as they show."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from design.arrays import FloatArray
from sims.evaluation.judged import DEPTH_TOLERANCE_MM
from sims.evaluation.tables import ERROR_DEPTHS_MM, TOUCH_DEPTHS_MM
from sims.readings.press_data import PressData


def needed_samples(data: PressData, places_mm: FloatArray) -> PressData:
    """Samples at the depths of the tables, and all of the presses nearest to some places.

    Parameters
    ----------
    places_mm : (place, 2) where depth is shown sample by sample [mm]
    """
    depth_mm = data.press_mm[:, 2]
    wanted = np.zeros(len(data), dtype=np.bool_)
    for row in _all_depths():
        wanted |= np.abs(depth_mm - row) <= DEPTH_TOLERANCE_MM
    number = data.press_numbers()
    for place in places_mm:
        nearest = int(np.hypot(*(data.press_mm[:, :2] - place).T).argmin())
        wanted |= number == number[nearest]
    return data.only(wanted)


def _all_depths() -> Sequence[float]:
    return sorted({*TOUCH_DEPTHS_MM, *ERROR_DEPTHS_MM})
