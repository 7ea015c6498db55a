"""The few readings of a recording that a calibration is fitted to: some depths of every press on its way in."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from design.arrays import FloatArray, IntArray
from design.errors import InputError
from sims.learning.signal_map.map_learner import Untouched, untouched_of
from sims.readings.dataset import PressData

FEWEST_PRESSES = 5
STATES = 95
"""Light is traced for about so many presses and depths at every step of the fit: 1 s to 2 s on one core."""
FEWEST_DEPTHS, MOST_DEPTHS = 3, 10
SHALLOWEST_MM = 0.4
"""Lighter presses say more of the reference depth's error than of the optics."""
NEAR_MM = 0.15
"""A depth counts as reached by a frame this near to it."""


@dataclass(frozen=True, kw_only=True, eq=False)
class CalibrationSamples:
    """Readings to fit.

    Attributes
    ----------
    press_mm : (n, 3) x, y, depth by the stage [mm]
    press : (n,) number of the press
    press_set : (press,) number of the set that each press belongs to
    signals : (n, pair) readings less the off state [counts]
    untouched : what the sensor reads without a touch
    emitters : how many
    """

    press_mm: FloatArray
    press: IntArray
    press_set: IntArray
    signals: FloatArray
    untouched: Untouched
    emitters: int

    @property
    def presses(self) -> int:
        """How many."""
        return int(self.press.max()) + 1


def calibration_samples(data: PressData, deepest_mm: float) -> CalibrationSamples:
    """Choose readings.

    Parameters
    ----------
    data : presses with untouched frames
    deepest_mm : deepest press of the design

    Raises
    ------
    InputError : too few presses or untouched frames.
    """
    untouched, number = untouched_of(data), data.press_numbers()
    reached = [
        one for one in range(number.max() + 1) if data.press_mm[number == one, 2].max() >= SHALLOWEST_MM
    ]
    if len(reached) < FEWEST_PRESSES:
        raise InputError(
            f"calibrate: {len(reached)} presses of {SHALLOWEST_MM:g} mm and more, needs >= {FEWEST_PRESSES}, "
            "better 30; press at places spread over the workspace"
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
    """Rows of one press nearest to wanted depths, on the way in."""
    way_in = rows[: int(np.argmax(depth_mm[rows])) + 1]
    end = min(float(depth_mm[way_in].max()), 0.9 * deepest_mm)
    wanted = np.linspace(np.sqrt(SHALLOWEST_MM), np.sqrt(end), depths) ** 2
    nearest = [int(way_in[np.argmin(np.abs(depth_mm[way_in] - one))]) for one in wanted]
    kept = sorted(
        {row for row, one in zip(nearest, wanted, strict=True) if abs(depth_mm[row] - one) <= NEAR_MM}
    )
    return np.array(kept or nearest[-1:], dtype=np.int64)
