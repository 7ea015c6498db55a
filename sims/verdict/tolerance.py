"""How firm a verdict is: the governing pair traced again at both ends of every open value's band.

One value at a time, all others at their design value, the gain set anew (as it would be on that
build). Left out: values off together (a Monte Carlo over builds), bands that nobody has given.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from design.properties import UsedValue, used_values
from design.spec import SensorDesign

Summary = tuple[float | None, float]
"""Signed mode gap [mm] (None when open) and summed deadband [mm] of the governing pair."""


@dataclass(frozen=True, kw_only=True)
class ToleranceRow:
    """One open value and what its band does to the governing pair.

    Attributes
    ----------
    path, confidence : dotted path to measure, and how firm its value is
    values : the low and high end tried
    gap_mm : mode gap at both ends [mm]; None when mode 2 is never reached
    deadband_mm : summed deadband at both ends [mm]
    flips : whether either end has a deadband where the design has none, or the other way round
    """

    path: str
    confidence: str
    values: tuple[float, float]
    gap_mm: tuple[float | None, float | None]
    deadband_mm: tuple[float, float]
    flips: bool

    def effect_mm(self, deadband_mm: float) -> float:
        """Largest move of the summed deadband away from the design's [mm]."""
        return max(abs(value - deadband_mm) for value in self.deadband_mm)


@dataclass(frozen=True, kw_only=True)
class ToleranceBand:
    """All open values, the strongest effect on the verdict first.

    Attributes
    ----------
    pair : name of the governing pair
    deadband_mm, gap_mm : at the design's own values [mm]
    rows : ranked
    unbanded : open values that have no band, so that nothing can be said of them
    """

    pair: str
    deadband_mm: float
    gap_mm: float | None
    rows: tuple[ToleranceRow, ...]
    unbanded: tuple[str, ...]

    @property
    def deadband_range_mm(self) -> tuple[float, float]:
        """Smallest and largest summed deadband over all ends tried [mm]."""
        tried = [self.deadband_mm, *(value for row in self.rows for value in row.deadband_mm)]
        return min(tried), max(tried)

    @property
    def flipping(self) -> tuple[str, ...]:
        """Paths whose band turns the verdict."""
        return tuple(row.path for row in self.rows if row.flips)

    def to_json(self) -> dict[str, Any]:
        """Plain data for JSON."""
        return {
            "pair": self.pair,
            "deadband_mm": round(self.deadband_mm, 4),
            "deadband_range_mm": [round(value, 4) for value in self.deadband_range_mm],
            "mode_gap_mm": None if self.gap_mm is None else round(self.gap_mm, 4),
            "flips_verdict": list(self.flipping),
            "rows": [_row_json(row) for row in self.rows],
            "unbanded": list(self.unbanded),
        }


def tolerance_band(
    design: SensorDesign,
    pair: str,
    summary: Summary,
    summarise: Callable[[SensorDesign], Summary],
    on_step: Callable[[float], None] | None = None,
) -> ToleranceBand:
    """Try both ends of every open value's band.

    Parameters
    ----------
    pair : name of the governing pair
    summary : its mode gap and deadband at the design's own values
    summarise : the same for a changed design
    """
    open_values = [used for used in used_values(design) if used.is_open or _band_is_wide(used)]
    banded = [used for used in open_values if _ends(used) is not None]
    rows = []
    for done, used in enumerate(banded):
        rows.append(_row(design, used, summary, summarise))
        if on_step is not None:
            on_step((done + 1) / len(banded))
    rows.sort(
        key=lambda row: (row.flips, row.effect_mm(summary[1]), _gap_move(row, summary[0])), reverse=True
    )
    return ToleranceBand(
        pair=pair,
        gap_mm=summary[0],
        deadband_mm=summary[1],
        rows=tuple(rows),
        unbanded=tuple(used.path for used in open_values if _ends(used) is None),
    )


def _row(
    design: SensorDesign, used: UsedValue, summary: Summary, summarise: Callable[[SensorDesign], Summary]
) -> ToleranceRow:
    ends = _ends(used)
    assert ends is not None
    (gap_low, dead_low), (gap_high, dead_high) = (summarise(design.with_(**{used.path: end})) for end in ends)
    return ToleranceRow(
        path=used.path,
        confidence=used.quantity.confidence,
        values=ends,
        gap_mm=(gap_low, gap_high),
        deadband_mm=(dead_low, dead_high),
        flips=any((dead > 0.0) != (summary[1] > 0.0) for dead in (dead_low, dead_high)),
    )


def _band_is_wide(used: UsedValue) -> bool:
    return used.quantity.confidence != "measured" and _ends(used) is not None


def _ends(used: UsedValue) -> tuple[float, float] | None:
    low, high = used.quantity.low, used.quantity.high
    if low is None or high is None or low == high:
        return None
    return low, high


def _gap_move(row: ToleranceRow, gap_mm: float | None) -> float:
    if gap_mm is None:
        return 0.0
    return max((abs(value - gap_mm) for value in row.gap_mm if value is not None), default=0.0)


def _row_json(row: ToleranceRow) -> dict[str, Any]:
    return {
        "path": row.path,
        "confidence": row.confidence,
        "values": list(row.values),
        "mode_gap_mm": [None if gap is None else round(gap, 4) for gap in row.gap_mm],
        "deadband_mm": [round(value, 4) for value in row.deadband_mm],
        "flips_verdict": row.flips,
    }
