"""Confidence in a verdict: the design is judged again at both ends of every unmeasured parameter's band.

One parameter is changed at a time, and the gain is set as it would be on that unit. Parameters whose band can change
the verdict come first; the others follow by their largest change of deadband, then of margin. Parameters without a
band cannot be tried. `optopad.sims.verdict.builds` varies several parameters at once.

The module also holds the data of a sensitivity study: figures before and after a small step of one field at a time.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from optopad.design.draft import Draft
from optopad.design.errors import OptopadError
from optopad.design.spec import SensorDesign
from optopad.design.spec.properties import UsedValue, used_values
from optopad.sims.verdict.builds import Brief, BuildJudge
from optopad.sims.verdict.depth_curve import DEADBAND_THRESHOLD

AMPLE_MARGIN = 2.0 * DEADBAND_THRESHOLD
"""Margin above which more margin no longer counts as an improvement, but better accuracy does [noise units]."""
WORTH_NOISE_UNITS = 0.1
"""Depth that counts as much as one noise unit of margin when changes are compared [mm per noise unit]."""


@dataclass(frozen=True, kw_only=True)
class Effect:
    """Figures of a design, as designed or with one field changed.

    Attributes
    ----------
    usable_mm, deadband_mm : usable depth and summed deadband of the judged pair or location [mm]
    margin : distance between frames over the least resolved 0.3 mm of depth [noise units]; a margin below 3 means a
        deadband
    location_mm, depth_mm : smallest possible errors of location and depth [mm]; None if not resolved; facing rows have
        no location
    """

    usable_mm: float
    deadband_mm: float
    margin: float
    location_mm: float | None
    depth_mm: float | None

    def gain_over(self, other: Effect) -> float:
        """Improvement over the figures of another design, expressed as a depth [mm].

        It is the sum of added usable depth, removed deadband, and 0.1 mm per noise unit of margin up to `AMPLE_MARGIN`.
        If the other design already has this margin, each factor e by which the location bound shrinks adds 1 mm. The
        depth bound is used if neither design has a location bound.
        """
        reached, before = min(self.margin, AMPLE_MARGIN), min(other.margin, AMPLE_MARGIN)
        gain = (self.usable_mm - other.usable_mm) - (self.deadband_mm - other.deadband_mm)
        gain += WORTH_NOISE_UNITS * (reached - before)
        return gain + self._finer_than(other) if before == AMPLE_MARGIN else gain

    def _finer_than(self, other: Effect) -> float:
        """Logarithm of the factor by which this design's accuracy bound is smaller than another's.

        It is 1 if only this design has a bound, and -1 if only the other has one.
        """
        has_place = self.location_mm is not None or other.location_mm is not None
        now, was = (self.location_mm, other.location_mm) if has_place else (self.depth_mm, other.depth_mm)
        if now is None or was is None:
            return float(now is not None) - float(was is not None)
        return math.log(was / now)

    def to_json(self) -> dict[str, Any]:
        """The effect as plain data for JSON."""
        return {
            "usable_depth_mm": round(self.usable_mm, 4),
            "deadband_mm": round(self.deadband_mm, 4),
            "margin_noise_units": round(self.margin, 3),
            "location_bound_mm": None if self.location_mm is None else round(self.location_mm, 5),
            "depth_bound_mm": None if self.depth_mm is None else round(self.depth_mm, 5),
        }


@dataclass(frozen=True, kw_only=True)
class FieldStep:
    """Effects of a step of one field down, and of one up.

    Attributes
    ----------
    path : dotted path of the field
    step : size of the step [unit of the field]
    lower, higher : figures after the step down and up; None if the step breaks a rule or leaves the models' scope
    """

    path: str
    step: float
    lower: Effect | None
    higher: Effect | None

    def gains(self, design: Effect) -> tuple[float | None, float | None]:
        """Improvement over the unchanged design by a step down and by a step up [mm]; None where not judged."""
        lower, higher = (None if one is None else one.gain_over(design) for one in (self.lower, self.higher))
        return lower, higher


@dataclass(frozen=True, kw_only=True)
class FieldSteps:
    """Effects of a small step of each field that is cheap to change.

    Attributes
    ----------
    judged : name of the judged pair, or the pad's location of least margin
    bounds_at_mm : (x, y, depth) of the press at which the accuracy bounds are computed [mm]
    as_designed : figures of the unchanged design
    """

    judged: str
    bounds_at_mm: tuple[float, float, float]
    as_designed: Effect
    rows: tuple[FieldStep, ...]

    def better_sides(self) -> dict[str, int]:
        """Fields that improve the design, each with the direction (-1 down, 1 up); the largest improvement first."""
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
        """The study as plain data for JSON."""
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


@dataclass(frozen=True, kw_only=True)
class ToleranceRow:
    """One unmeasured parameter and the effect of its band on the verdict.

    Attributes
    ----------
    path, confidence : dotted path of the parameter, and the confidence in its value
    values : low and high end of the band [unit of the parameter]
    gap_mm : mode gap at both ends [mm]; None when mode 2 is never reached, and for a pad
    deadband_mm : summed deadband at both ends [mm]
    margin : signal change over the least responsive 0.3 mm of depth at both ends [noise units]; a margin below 3 means
        a deadband
    flips : whether the verdict at either end differs from the design's
    """

    path: str
    confidence: str
    values: tuple[float, float]
    gap_mm: tuple[float | None, float | None]
    deadband_mm: tuple[float, float]
    margin: tuple[float, float]
    flips: bool

    def effect(self, design: Brief) -> tuple[bool, float, float]:
        """Sort key: whether the verdict changes, and the largest changes of deadband [mm] and margin [noise units]."""
        return (
            self.flips,
            max(abs(value - design.deadband_mm) for value in self.deadband_mm),
            max(abs(value - design.margin) for value in self.margin),
        )


@dataclass(frozen=True, kw_only=True)
class ToleranceBand:
    """Effects of all unmeasured parameters, the strongest effect on the verdict first.

    Attributes
    ----------
    judged : name of the governing pair, or the pad's location of least margin
    deadband_mm, gap_mm, margin : deadband [mm], mode gap [mm] and margin [noise units] of the design itself
    rows : effect of each parameter
    unbanded : unmeasured parameters without a band, whose effect is unknown
    untried : parameters with an end of the band that cannot be judged, each with the reason
    """

    judged: str
    deadband_mm: float
    gap_mm: float | None
    margin: float
    rows: tuple[ToleranceRow, ...]
    unbanded: tuple[str, ...]
    untried: tuple[str, ...] = ()

    @property
    def deadband_range_mm(self) -> tuple[float, float]:
        """Smallest and largest summed deadband over all ends tried [mm]."""
        tried = [self.deadband_mm, *(value for row in self.rows for value in row.deadband_mm)]
        return min(tried), max(tried)

    @property
    def flipping(self) -> tuple[str, ...]:
        """Paths of the parameters whose band changes the verdict."""
        return tuple(row.path for row in self.rows if row.flips)

    def to_json(self) -> dict[str, Any]:
        """The effects as plain data for JSON."""
        return {
            "judged": self.judged,
            "deadband_mm": round(self.deadband_mm, 4),
            "deadband_range_mm": [round(value, 4) for value in self.deadband_range_mm],
            "mode_gap_mm": None if self.gap_mm is None else round(self.gap_mm, 4),
            "margin_noise_units": round(self.margin, 3),
            "flips_verdict": list(self.flipping),
            "rows": [_row_json(row) for row in self.rows],
            "unbanded": list(self.unbanded),
            "untried": list(self.untried),
        }


def tolerance_band(
    design: SensorDesign,
    judged: str,
    judge: BuildJudge,
    on_step: Callable[[float], None] | None = None,
    *,
    added: Sequence[UsedValue] = (),
) -> ToleranceBand:
    """Try both ends of every unmeasured parameter's band.

    Parameters
    ----------
    judged : name of the judged pair or location, for messages
    judge : function for the short verdict on a unit; called for the unchanged design first
    added : further values with bands, such as manufacturing tolerances; they replace parameters with the same path
    """
    as_designed = judge(Draft.of(design))
    replaced = {used.path for used in added}
    open_values = [
        used
        for used in used_values(design)
        if used.path not in replaced and (used.is_open or _band_is_wide(used))
    ]
    open_values += added
    banded = [used for used in open_values if _ends(used) is not None]
    rows, untried = [], []
    for done, used in enumerate(banded):
        try:
            rows.append(_row(design, used, as_designed, judge))
        except OptopadError as err:
            untried.append(f"{used.path}: {err}")
        if on_step is not None:
            on_step((done + 1) / len(banded))
    return ToleranceBand(
        judged=judged,
        gap_mm=as_designed.gap_mm,
        deadband_mm=as_designed.deadband_mm,
        margin=as_designed.margin,
        rows=tuple(sorted(rows, key=lambda row: row.effect(as_designed), reverse=True)),
        unbanded=tuple(used.path for used in open_values if _ends(used) is None),
        untried=tuple(untried),
    )


def _row(design: SensorDesign, used: UsedValue, as_designed: Brief, judge: BuildJudge) -> ToleranceRow:
    ends = _ends(used)
    assert ends is not None
    low, high = (judge(Draft.of(design.with_(**{used.path: end}))) for end in ends)
    return ToleranceRow(
        path=used.path,
        confidence=used.quantity.confidence,
        values=ends,
        gap_mm=(low.gap_mm, high.gap_mm),
        deadband_mm=(low.deadband_mm, high.deadband_mm),
        margin=(low.margin, high.margin),
        flips=any((build.deadband_mm > 0.0) != (as_designed.deadband_mm > 0.0) for build in (low, high)),
    )


def _band_is_wide(used: UsedValue) -> bool:
    return used.quantity.confidence != "measured" and _ends(used) is not None


def _ends(used: UsedValue) -> tuple[float, float] | None:
    low, high = used.quantity.low, used.quantity.high
    if low is None or high is None or low == high:
        return None
    return low, high


def _row_json(row: ToleranceRow) -> dict[str, Any]:
    return {
        "path": row.path,
        "confidence": row.confidence,
        "values": list(row.values),
        "mode_gap_mm": [None if gap is None else round(gap, 4) for gap in row.gap_mm],
        "deadband_mm": [round(value, 4) for value in row.deadband_mm],
        "margin_noise_units": [round(value, 3) for value in row.margin],
        "flips_verdict": row.flips,
    }
