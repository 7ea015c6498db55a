"""What small steps of a design's fields do, as data: figures before and after, one field at a time."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from sims.verdict.pair.defaults import DEADBAND_THRESHOLD

AMPLE_MARGIN = 2.0 * DEADBAND_THRESHOLD
"""Margin from which more of it is worth nothing: accuracy is then weighed [noise units]."""
WORTH_NOISE_UNITS = 0.1
"""Depth that a noise unit of margin is worth where changes are weighed against each other [mm]."""


@dataclass(frozen=True, kw_only=True)
class Effect:
    """Figures of a design, or of one with a field moved.

    Attributes
    ----------
    usable_mm, deadband_mm : usable depth and summed deadband of what is judged [mm]
    margin : distance of frames over the least told 0.3 mm of depth [noise units]; below 3 is a deadband
    location_mm, depth_mm : bounds of place and depth of one frame [mm]; None where blind, and the place of facing rows
    """

    usable_mm: float
    deadband_mm: float
    margin: float
    location_mm: float | None
    depth_mm: float | None

    def gain_over(self, other: Effect) -> float:
        """How much better than another [mm].

        Usable depth more and deadband less, a tenth of a mm a noise unit up to `AMPLE_MARGIN`; from there on accuracy,
        a mm a factor e of the bound (of place; of depth where there is none).
        """
        reached, before = min(self.margin, AMPLE_MARGIN), min(other.margin, AMPLE_MARGIN)
        gain = (self.usable_mm - other.usable_mm) - (self.deadband_mm - other.deadband_mm)
        gain += WORTH_NOISE_UNITS * (reached - before)
        return gain + self._finer_than(other) if before == AMPLE_MARGIN else gain

    def _finer_than(self, other: Effect) -> float:
        """Logarithm of the ratio of bounds; 1 for what turns from blind to told, -1 the other way."""
        has_place = self.location_mm is not None or other.location_mm is not None
        now, was = (self.location_mm, other.location_mm) if has_place else (self.depth_mm, other.depth_mm)
        if now is None or was is None:
            return float(now is not None) - float(was is not None)
        return math.log(was / now)

    def to_json(self) -> dict[str, Any]:
        """Plain data for JSON."""
        return {
            "usable_depth_mm": round(self.usable_mm, 4),
            "deadband_mm": round(self.deadband_mm, 4),
            "margin_noise_units": round(self.margin, 3),
            "location_bound_mm": None if self.location_mm is None else round(self.location_mm, 5),
            "depth_bound_mm": None if self.depth_mm is None else round(self.depth_mm, 5),
        }


@dataclass(frozen=True, kw_only=True)
class FieldStep:
    """One field a step down and a step up; None where that is no design, or the models do not answer.

    Attributes
    ----------
    path, step : dotted path and size of the step [unit of the field]
    """

    path: str
    step: float
    lower: Effect | None
    higher: Effect | None

    def gains(self, design: Effect) -> tuple[float | None, float | None]:
        """How much better each side is than the design as it is [mm]."""
        lower, higher = (None if one is None else one.gain_over(design) for one in (self.lower, self.higher))
        return lower, higher


@dataclass(frozen=True, kw_only=True)
class FieldSteps:
    """All fields of a design that cost little to change.

    Attributes
    ----------
    judged : what was looked at: the governing pair's name, or the pad at its weakest place
    bounds_at_mm : (x, y, depth) of the bounds [mm]
    as_designed : figures of the design as it is
    """

    judged: str
    bounds_at_mm: tuple[float, float, float]
    as_designed: Effect
    rows: tuple[FieldStep, ...]

    def better_sides(self) -> dict[str, int]:
        """The side of each field that is better: -1 lower, 1 higher; fields in order of what their step gains."""
        found = []
        for row in self.rows:
            known = [
                (gain, side)
                for gain, side in zip(row.gains(self.as_designed), (-1, 1), strict=True)
                if gain is not None and gain > 0.0
            ]
            if known:
                gain, side = max(known)
                found.append((-gain, row.path, side))
        return {path: side for _, path, side in sorted(found)}

    def to_json(self) -> dict[str, Any]:
        """Plain data for JSON."""
        return {
            "judged": self.judged,
            "bounds_at_mm": [round(value, 4) for value in self.bounds_at_mm],
            "as_designed": self.as_designed.to_json(),
            "fields": [
                {
                    "path": row.path,
                    "step": row.step,
                    "lower": None if row.lower is None else row.lower.to_json(),
                    "higher": None if row.higher is None else row.higher.to_json(),
                }
                for row in self.rows
            ],
        }
