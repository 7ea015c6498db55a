"""The two modes of one emitter-receiver pair under a growing press, and the gap between them.

Mode 1: light that reflects off the top is lost or redirected as soon as the dimple reaches its
footprint. Mode 2: the tip itself comes between emitter and receiver (Piacenza et al., ICRA 2017,
in words). The definitions in numbers, with T the specularly top-reflected and D the direct light:

    mode 1   from the first depth where |T - T(0)| exceeds 5 % of T's range
             to the last depth where |T - T(deepest)| leaves 5 % of T's range
    mode 2   from the depth after which D stays at or below 95 % of D(0)
             to the depth after which D stays at or below 5 % of D(0)
    gap      onset of mode 2 - end of mode 1; negative when the modes overlap

Boundaries are where the monotone cubic through the samples (Fritsch and Butland 1984) crosses the level: it overshoots
nowhere, meets straight lines exactly and smooth curves to the third power of the step, and rounds off a kink by up to
a seventh of the step. "Stays" is judged up to the deepest press only.
Left out: whether the change of T or D exceeds the noise; deadbands answer that.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import PchipInterpolator

from design.arrays import FloatArray
from design.errors import InputError
from sims.verdict.pair.defaults import MODE_TOLERANCE
from sims.verdict.pair.depth_curve import require_depths_mm, require_samples

HALVINGS = 50
"""Halvings of a segment until the crossing is known to round-off."""


@dataclass(frozen=True, kw_only=True)
class Modes:
    """Where in depth the two modes act. None is an open end: not reached within the depths given.

    Attributes
    ----------
    mode1_mm : start and end of mode 1 [mm]; (0, 0) when the top-reflected light never changes
    mode2_mm : onset and end of mode 2 [mm], each None when not reached
    gap_mm : onset of mode 2 minus end of mode 1 [mm]; None when mode 2 never starts
    gap_at_least_mm : lower bound of the gap [mm] when mode 2 never starts; else None
    """

    mode1_mm: tuple[float, float]
    mode2_mm: tuple[float | None, float | None]
    gap_mm: float | None
    gap_at_least_mm: float | None


def find_modes(
    depth_mm: ArrayLike, top: ArrayLike, direct: ArrayLike, *, tolerance: float = MODE_TOLERANCE
) -> Modes:
    """Find the two modes of one pair.

    Parameters
    ----------
    depth_mm : (n,) depths of the press [mm]; the first 0, increasing
    top : (n,) specularly top-reflected light, skirt included [any one unit]
    direct : (n,) direct light [any one unit]
    tolerance : share of T's range, and of D(0), that counts as "there" [-]; over 0, below 0.5

    Returns
    -------
    Modes
    """
    depth = require_depths_mm(depth_mm)
    top_light = require_samples("top", top, depth)
    direct_light = require_samples("direct", direct, depth)
    if not 0.0 < tolerance < 0.5:
        raise InputError(f"tolerance: {tolerance}, needs a share over 0 and below 0.5; the default is 0.05")
    if direct_light[0] <= 0.0:
        raise InputError(
            f"direct[0]: {direct_light[0]}, needs more than 0; "
            "a pair without a direct path is not judged, leave it out"
        )
    mode1 = _mode1_mm(depth, top_light, tolerance)
    onset = _stays_below_from_mm(depth, direct_light, (1.0 - tolerance) * float(direct_light[0]))
    end = _stays_below_from_mm(depth, direct_light, tolerance * float(direct_light[0]))
    return Modes(
        mode1_mm=mode1,
        mode2_mm=(onset, end),
        gap_mm=None if onset is None else onset - mode1[1],
        gap_at_least_mm=float(depth[-1]) - mode1[1] if onset is None else None,
    )


def _mode1_mm(depth_mm: FloatArray, top: FloatArray, tolerance: float) -> tuple[float, float]:
    band = tolerance * float(np.ptp(top))
    if band == 0.0:
        return (0.0, 0.0)
    moved, unsettled = top - top[0], top - top[-1]
    first = int(np.flatnonzero(np.abs(moved) > band)[0])
    last = int(np.flatnonzero(np.abs(unsettled) > band)[-1])
    start = _crossing_mm(depth_mm, moved, first - 1, float(np.copysign(band, moved[first])))
    end = _crossing_mm(depth_mm, unsettled, last, float(np.copysign(band, unsettled[last])))
    return (start, end)


def _stays_below_from_mm(depth_mm: FloatArray, values: FloatArray, level: float) -> float | None:
    """Depth after which a curve that starts above a level stays at or below it; None when it does not."""
    last_above = int(np.flatnonzero(values > level)[-1])
    if last_above == depth_mm.size - 1:
        return None
    return _crossing_mm(depth_mm, values, last_above, level)


def _crossing_mm(depth_mm: FloatArray, values: FloatArray, segment: int, level: float) -> float:
    """Depth where the monotone cubic through the samples meets a level that lies between the ends of a segment."""
    cubic = PchipInterpolator(depth_mm, values).c[:, segment]
    low, high = 0.0, float(depth_mm[segment + 1] - depth_mm[segment])
    falls = values[segment] > values[segment + 1]
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        is_before = (np.polyval(cubic, middle) > level) == falls
        low, high = (middle, high) if is_before else (low, middle)
    return float(depth_mm[segment] + 0.5 * (low + high))
