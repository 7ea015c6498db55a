"""Where the tip really is, beside what the stage says.

    depth = reported + offset of the set + offset of the place, and on the way back + lag, never beyond the turn
    x, y  = reported + error of the press

The offsets of depth stand for a zero that was set by hand and a surface that is not level; the lag is backlash, so
that after the turn the tip stays until the lag is taken up. Light is traced at the protocol's places and depths are
interpolated, so the error in x and y is put on the reported place: its spread is the same, and one trace serves all
seeds. Left out: a stage that is not square or not level, errors that depend on the place.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from design.arrays import BoolArray, FloatArray
from design.spec.noise import Noise


@dataclass(frozen=True, kw_only=True)
class PressDraw:
    """Errors of one press.

    Attributes
    ----------
    zero_offset_mm : true less reported depth on the way in [mm]
    place_error_mm : (2,) true less reported x, y [mm]
    """

    zero_offset_mm: float
    place_error_mm: FloatArray


def drawn_set_offset_mm(noise: Noise, rng: np.random.Generator) -> float:
    """Offset of a set's reference depth [mm]."""
    return float(noise.zero_offset_set_mm * rng.standard_normal())


def drawn_press(noise: Noise, set_offset_mm: float, rng: np.random.Generator) -> PressDraw:
    """Errors of a new press."""
    return PressDraw(
        zero_offset_mm=set_offset_mm + float(noise.zero_offset_place_mm * rng.standard_normal()),
        place_error_mm=noise.position_error_mm * rng.standard_normal(2),
    )


def true_depth_mm(
    reported_mm: FloatArray, is_retracting: BoolArray, drawn: PressDraw, retract_lag_mm: float
) -> FloatArray:
    """(n,) depth of the tip in one press, in and back [mm]."""
    deepest = reported_mm.max() if len(reported_mm) else 0.0
    lagging = np.where(is_retracting, np.minimum(reported_mm + retract_lag_mm, deepest), reported_mm)
    return np.asarray(lagging + drawn.zero_offset_mm)
