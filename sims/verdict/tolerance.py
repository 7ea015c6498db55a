"""How firm a verdict is: the build judged again at both ends of every open value's band.

One value at a time, all others at their design value, the gain set anew (as it would be on that
build). Ranked by whether an end turns the verdict, then by how far it moves the margin to a deadband.
Left out: values off together (`build_study` draws them), bands that nobody has given.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from design.errors import OptopadError
from design.spec import SensorDesign
from design.spec.properties import UsedValue, used_values
from sims.verdict.builds import Brief


@dataclass(frozen=True, kw_only=True)
class ToleranceRow:
    """One open value and what its band does to the governing pair.

    Attributes
    ----------
    path, confidence : dotted path to measure, and how firm its value is
    values : the low and high end tried
    gap_mm : mode gap at both ends [mm]; None when mode 2 is never reached
    deadband_mm : summed deadband at both ends [mm]
    margin : change over the least responsive 0.3 mm of depth at both ends [noise units]; below 3 is a deadband
    flips : whether either end has a deadband where the design has none, or the other way round
    """

    path: str
    confidence: str
    values: tuple[float, float]
    gap_mm: tuple[float | None, float | None]
    deadband_mm: tuple[float, float]
    margin: tuple[float, float]
    flips: bool

    def effect(self, design: Brief) -> tuple[bool, float, float]:
        """Sort key: turns the verdict; largest move of the deadband [mm]; of the margin [noise units]."""
        return (
            self.flips,
            max(abs(value - design.deadband_mm) for value in self.deadband_mm),
            max(abs(value - design.margin) for value in self.margin),
        )


@dataclass(frozen=True, kw_only=True)
class ToleranceBand:
    """All open values, the strongest effect on the verdict first.

    Attributes
    ----------
    judged : what was judged: the governing pair's name, or the pad at its weakest place
    deadband_mm, gap_mm, margin : at the design's own values [mm], [mm], [noise units]
    rows : ranked
    unbanded : open values that have no band, so that nothing can be said of them
    untried : ends of bands at which no build can be judged, and why
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
        """Paths whose band turns the verdict."""
        return tuple(row.path for row in self.rows if row.flips)

    def to_json(self) -> dict[str, Any]:
        """Plain data for JSON."""
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
    judge: Callable[[SensorDesign], Brief],
    on_step: Callable[[float], None] | None = None,
    *,
    added: Sequence[UsedValue] = (),
) -> ToleranceBand:
    """Try both ends of every open value's band.

    Parameters
    ----------
    judged : what the judge looks at, for messages
    judge : the brief of a build; called for the design as it is first
    added : further values with bands, such as tolerances of making; they replace open values of the same path
    """
    as_designed = judge(design)
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


def tried_values(design: SensorDesign) -> list[tuple[UsedValue, tuple[float, float]]]:
    """Unmeasured parameters that have a band, and its ends."""
    used = (one for one in used_values(design) if one.is_open or _band_is_wide(one))
    return [(one, ends) for one in used if (ends := _ends(one)) is not None]


def _row(
    design: SensorDesign, used: UsedValue, as_designed: Brief, judge: Callable[[SensorDesign], Brief]
) -> ToleranceRow:
    ends = _ends(used)
    assert ends is not None
    low, high = (judge(design.with_(**{used.path: end})) for end in ends)
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
