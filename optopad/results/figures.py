"""The figures that one chooses a design by: one function computes them, and every table and screen shows them.

Figures of the light are those of a score, at its accuracy. Sizes, number of parts and bill follow from the design.
Figures of single pairs are not among them: a pad is judged by all pairs together.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

from design.mold.outline import outline_of
from design.shape.cavity import cavity_of
from design.spec import SensorDesign
from fabrication.gain import gain_of
from fabrication.sheets.bom import bom_rows
from fabrication.sheets.prices import BillSum, bill_sum

if TYPE_CHECKING:
    from sims.score.result import ContinuityScore

Better = Literal["lower", "higher", ""]
LEAST_SHARE = 0.01
"""Least share above 0 that is shown as a number [-]."""
BOUNDARY_STEP_MM = 0.04
"""Shift of a boundary of a deadband in depth if the depth step is doubled [mm]."""
LOADS = ("force_n", "low_n", "high_n")
"""Loads of the force curve in a score's plain data: nominal, and at both ends of the elastic modulus's band."""
SUMMARY_ROOM = 88
"""Largest number of characters of a summary: a line of the screen without its label."""


@dataclass(frozen=True, kw_only=True)
class Band:
    """A figure with the ends of its numerical error; infinite where presses are not resolved or not detected."""

    value: float
    low: float
    high: float

    @property
    def error(self) -> float:
        """Distance from the value to the farther end."""
        return 0.0 if self.low == self.high else max(self.value - self.low, self.high - self.value)


@dataclass(frozen=True, kw_only=True)
class FigureCell:
    """One figure of one design for a table.

    Attributes
    ----------
    name, unit : name and unit of the figure; together they are the column's title
    text : the figure as text without unit; "-" if it does not exist
    better : whether "lower" or "higher" values are better; "" if neither is
    value : number by which designs are ranked; None if the figure does not exist
    error : numerical error of the value, in its unit
    """

    name: str
    unit: str
    text: str
    better: Better = ""
    value: float | None = None
    error: float = 0.0

    @property
    def title(self) -> str:
        """Name and unit of the figure."""
        return f"{self.name} [{self.unit}]" if self.unit else self.name


@dataclass(frozen=True, kw_only=True)
class PadFigures:
    """The figures of one design; those of the light are None if the models do not cover the design.

    Attributes
    ----------
    name, digest : the design's name and content hash
    headline : verdict with the usable depth
    margin : least margin of any location, or of any facing pair [noise units]
    usable_mm : least depth to which depth is resolved [mm]
    deadband_mm : total length of the deadbands at the worst location, or of the worst facing pair [mm]
    location_mm : median Cramér-Rao bound of the location from one frame [mm]
    depth_mm : median Cramér-Rao bound of the depth [mm]; for facing rows, that at a known location
    detection_n : load from which a press is detected at the worst location [N]
    deepest_n : load of the deepest press in the middle [N], with the ends of the elastic modulus's band
    deepest_mm : depth of the deepest press [mm]
    unresolved : share of the volume in which x, y and depth are not resolved together [-]; None for facing rows
    pressable_mm : length and width of the area that may be pressed [mm]
    pressable_share : this area as a share of the pad's area [-]
    outer_mm : length, width and height of the sensor in its mold [mm]
    parts : number of emitters and receivers
    bill : sum of the bill of materials
    """

    name: str
    digest: str
    headline: str
    margin: float | None
    usable_mm: Band | None
    deadband_mm: float | None
    location_mm: Band | None
    depth_mm: Band | None
    detection_n: Band | None
    deepest_n: Band | None
    deepest_mm: float
    unresolved: float | None
    pressable_mm: tuple[float, float]
    pressable_share: float
    outer_mm: tuple[float, float, float]
    parts: int
    bill: BillSum

    @property
    def cells(self) -> tuple[FigureCell, ...]:
        """The figures as the cells of a table, the most important first; every table is made of them."""
        length, width, height = self.outer_mm
        whole = len(self.bill.known) == 1 and not self.bill.unpriced
        currency = " ".join(self.bill.known) if len(self.bill.known) == 1 else ""
        return (
            FigureCell(name="verdict", unit="", text=self.headline),
            _number("margin", "sigma", "higher", self.margin, 1),
            _band("usable", "mm", "higher", self.usable_mm, 2, BOUNDARY_STEP_MM),
            _number("deadband", "mm", "lower", self.deadband_mm, 2, 2 * BOUNDARY_STEP_MM),
            _band("location", "mm", "lower", self.location_mm, 3),
            _band("depth", "mm", "lower", self.depth_mm, 3),
            _band("contact", "N", "lower", self.detection_n, 2),
            FigureCell(
                name="unresolved",
                unit="%",
                text=share_text(self.unresolved),
                better="lower",
                value=self.unresolved,
            ),
            FigureCell(
                name="pressable",
                unit="mm",
                text=f"{_sizes(self.pressable_mm)} ({self.pressable_share:.0%})",
                better="higher",
                value=math.prod(self.pressable_mm),
            ),
            FigureCell(
                name="outside",
                unit="mm",
                text=_sizes((length, width)),
                better="lower",
                value=length * width,
            ),
            _number("height", "mm", "lower", height, 1),
            _number("parts", "", "lower", float(self.parts), 0),
            FigureCell(
                name="price",
                unit=currency,
                text=price_text(self.bill),
                better="lower",
                value=sum(self.bill.known.values()) if whole else None,
            ),
        )

    def to_json(self) -> dict[str, Any]:
        """The figures as plain data; None where a figure does not exist, or a press is not resolved or detected."""
        return {
            "margin_noise_units": self.margin,
            "location_bound_mm": _plain(self.location_mm),
            "depth_bound_mm": _plain(self.depth_mm),
            "detection_force_n": _plain(self.detection_n),
            "deepest_force_n": _plain(self.deepest_n),
            "unresolved_share": self.unresolved,
            "pressable_mm": list(self.pressable_mm),
            "pressable_share": self.pressable_share,
            "outer_mm": list(self.outer_mm),
            "parts": self.parts,
            "price": {
                "known": {currency: round(value, 2) for currency, value in self.bill.known.items()},
                "rows": self.bill.rows,
                "rows_without_price": self.bill.unpriced,
            },
        }


def figures_of(design: SensorDesign, score: ContinuityScore | Mapping[str, Any]) -> PadFigures:
    """The figures of a scored design.

    Parameters
    ----------
    score : the design's score with bounds, or its plain data as in `score.json`
    """
    from sims.score.result import headline

    found = score if isinstance(score, Mapping) else score.to_json()
    bounds, force = found["bounds"], found["force"]
    is_facing = found["judged_by"] == "facing pairs"
    depth_bound = "median_depth_place_known_mm" if is_facing else "median_depth_mm"
    usable, between = found["usable_depth_mm"], found["usable_range_mm"]
    return PadFigures(
        name=design.name,
        digest=design.digest,
        headline=headline(
            found["verdict"],
            is_open=found["is_open"],
            usable_mm=usable,
            asked_mm=None if force is None else float(force["depth_mm"][-1]),
            is_short=True,
        ),
        margin=found["margin_noise_units"],
        usable_mm=None if usable is None else _as_band([usable, *(between or (usable, usable))]),
        deadband_mm=found["deadband_mm"]["total"],
        location_mm=None if bounds is None else _as_band(bounds["median_location_mm"].values()),
        depth_mm=None if bounds is None else _as_band(bounds[depth_bound].values()),
        detection_n=None if bounds is None else _detection(bounds["detection"]),
        deepest_n=None if force is None else _as_band(force[name][-1] for name in LOADS),
        deepest_mm=design.operating.max_depth_mm,
        unresolved=None if bounds is None or is_facing else bounds["unresolved_share"],
        bill=bill_sum(bom_rows(design, gain_of(found))),
        **_sizes_of(design),
    )


def _sizes_of(design: SensorDesign) -> dict[str, Any]:
    """Fields of `PadFigures` that need neither light nor price: pressable area, outer size, number of parts."""
    cavity, mold = cavity_of(design), outline_of(design)
    space = cavity.workspace
    top_mm = max(mold.highest_mm, cavity.plan.clear_mm)
    return {
        "pressable_mm": (_rounded(space.x1_mm - space.x0_mm), _rounded(space.y1_mm - space.y0_mm)),
        "pressable_share": _rounded(space.area_mm2 / cavity.plan.outline.area_mm2),
        "outer_mm": tuple(
            map(_rounded, (mold.outer_length_mm, mold.outer_width_mm, top_mm - mold.bottom_mm))
        ),
        "parts": len(cavity.parts),
    }


def price_text(bill: BillSum) -> str:
    """A bill's sum as a short text, such as "41 EUR + 3 rows": 3 rows have no known price."""
    sums = " + ".join(f"{value:.0f} {currency}" for currency, value in sorted(bill.known.items()))
    rest = f"{bill.unpriced} row{'' if bill.unpriced == 1 else 's'}" if bill.unpriced else ""
    return " + ".join(filter(None, (sums, rest))) if sums else "unknown"


def share_text(share: float | None) -> str:
    """A share in per cent as text without unit; "-" for None."""
    if share is None:
        return "-"
    return "<1" if 0.0 < share < LEAST_SHARE else f"{100 * share:.0f}"


def _detection(document: Mapping[str, Any] | None) -> Band | None:
    if document is None:
        return None
    return _as_band([document["worst_force_n"], *document["worst_force_range_n"]])


def _as_band(values: Any) -> Band:
    value, low, high = (math.inf if one is None else float(one) for one in values)
    return Band(value=value, low=low, high=high)


def _plain(band: Band | None) -> float | None:
    return None if band is None or math.isinf(band.value) else band.value


def _rounded(value: float) -> float:
    return round(float(value), 4)


def _sizes(lengths_mm: Sequence[float]) -> str:
    return " x ".join(f"{round(one, 1):g}" for one in lengths_mm)


def _number(
    name: str, unit: str, better: Better, value: float | None, digits: int, error: float = 0.0
) -> FigureCell:
    text = "-" if value is None else f"{value:.{digits}f}"
    return FigureCell(name=name, unit=unit, text=text, better=better, value=value, error=error)


def _band(
    name: str, unit: str, better: Better, band: Band | None, digits: int, least_error: float = 0.0
) -> FigureCell:
    if band is None:
        return _number(name, unit, better, None, digits)
    if math.isinf(band.value):
        return FigureCell(name=name, unit=unit, text="none", better=better, value=band.value)
    return _number(name, unit, better, band.value, digits, max(band.error, least_error))
