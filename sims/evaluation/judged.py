"""Presses beside what a model says of them: the rows that every table and picture is made of."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from design.arrays import BoolArray, FloatArray, IntArray
from design.errors import InputError
from sims.learning.inference.prediction import Prediction
from sims.press.same_places import place_numbers
from sims.readings.press_data import PressData

DEPTH_TOLERANCE_MM = 0.04
"""A sample belongs to a row of a table when its depth is this near; schedules step by 0.1 mm."""


@dataclass(frozen=True, kw_only=True)
class JudgedPresses:
    """Samples, and what one model says of each.

    Attributes
    ----------
    press_mm : (n, 3) x, y, depth as the stage reported them; depth below 0 is untouched, 0 and above touched [mm]
    said_mm : (n, 3) what the model says, whether it finds a touch or not [mm]
    is_found : (n,) whether the model finds a touch
    place_number : (n,) which place a sample belongs to; samples of one place share what is particular to it
    session_number : (n,) which set of which draw; samples of one session share its drift and its reference depth
    """

    press_mm: FloatArray
    said_mm: FloatArray
    is_found: BoolArray
    place_number: IntArray
    session_number: IntArray

    @property
    def is_touched(self) -> BoolArray:
        """(n,) whether the tip was at the surface or in it."""
        return np.asarray(self.press_mm[:, 2] >= 0.0)

    @property
    def false_alarms(self) -> float | None:
        """Share of the untouched samples that the model finds touched [-]; None without untouched samples."""
        quiet = self.is_found[~self.is_touched]
        return float(quiet.mean()) if len(quiet) else None

    @property
    def location_error_mm(self) -> FloatArray:
        """(n,) distance in the plane between said and reported place [mm]."""
        return np.asarray(np.hypot(*(self.said_mm - self.press_mm)[:, :2].T))

    @property
    def depth_error_mm(self) -> FloatArray:
        """(n,) absolute difference of depth [mm]."""
        return np.asarray(np.abs(self.said_mm[:, 2] - self.press_mm[:, 2]))

    def at_depth(self, depth_mm: float) -> JudgedPresses:
        """The samples of one row of a table."""
        return self.only(np.abs(self.press_mm[:, 2] - depth_mm) <= DEPTH_TOLERANCE_MM)

    def only(self, chosen: BoolArray) -> JudgedPresses:
        """The samples that a mask (n,) picks."""
        return JudgedPresses(**{one.name: getattr(self, one.name)[chosen] for one in fields(self)})

    def __len__(self) -> int:
        return len(self.press_mm)


def judged(data: PressData, said: Prediction) -> JudgedPresses:
    """Hold a model's answers against a data set.

    Raises
    ------
    InputError : another number of answers than of samples.
    """
    if len(said.press_mm) != len(data.press_mm):
        raise InputError(
            f"prediction: {len(said.press_mm)} rows for {len(data.press_mm)} samples; predict all"
        )
    return JudgedPresses(
        press_mm=np.asarray(data.press_mm, dtype=np.float64),
        said_mm=np.asarray(said.press_mm, dtype=np.float64),
        is_found=np.asarray(said.is_touched, dtype=bool),
        place_number=place_numbers(data.press_mm[:, :2]),
        session_number=np.asarray(np.unique(data.set_number, return_inverse=True)[1], dtype=np.int64),
    )


def joined(parts: Sequence[JudgedPresses]) -> JudgedPresses:
    """Samples of several data sets or draws as one: sessions stay apart, places that are the same become one."""
    press_mm = np.concatenate([part.press_mm for part in parts])
    shifts = np.cumsum([0, *(int(part.session_number.max(initial=-1)) + 1 for part in parts[:-1])])
    return JudgedPresses(
        press_mm=press_mm,
        said_mm=np.concatenate([part.said_mm for part in parts]),
        is_found=np.concatenate([part.is_found for part in parts]),
        place_number=place_numbers(press_mm[:, :2]),
        session_number=np.concatenate(
            [part.session_number + shift for part, shift in zip(parts, shifts, strict=True)]
        ),
    )
