"""The figures that one chooses a design by: one function computes them, and every table and screen shows them.

Figures of the light are those of a score, at its accuracy. Sizes, number of parts and bill follow from the design.
Figures of single pairs are not among them: a pad is judged by all pairs together.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from textwrap import wrap
from typing import TYPE_CHECKING, Any, Literal

from optopad.design.mold.outline import outline_of
from optopad.design.shape.cavity import cavity_of
from optopad.design.spec import SensorDesign
from optopad.fabrication.gain import gain_of
from optopad.fabrication.sheets.bom import bom_rows
from optopad.fabrication.sheets.prices import BillSum, bill_sum

if TYPE_CHECKING:
    from optopad.sims.score.result import ContinuityScore

Better = Literal["lower", "higher", ""]
LEAST_SHARE = 0.01
"""Least share above 0 that is shown as a number [-]."""
BOUNDARY_STEP_MM = 0.04
"""Shift of a boundary of a deadband in depth if the depth step is doubled [mm]."""
LOADS = ("force_n", "low_n", "high_n")
"""Loads of the force curve in a score's plain data: nominal, and at both ends of the elastic modulus's band."""
TABLE_WIDTH = 118
"""Largest width of a table in the terminal [characters]; a wider one is printed in parts, one below the other."""
NONE = "none"
"""Text of a bound or a load where presses are not resolved or not detected."""
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
        return (
            0.0 if self.low == self.value == self.high else max(self.value - self.low, self.high - self.value)
        )


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

    @property
    def words(self) -> str:
        """Name, figure and unit in a sentence."""
        number, bracket, rest = self.text.partition(" (")
        return f"{self.name} {f'{number} {self.unit}'.rstrip()}{bracket}{rest}"


@dataclass(frozen=True, kw_only=True)
class PadFigures:
    """The figures of one design; those of the light are None without a score, or if the models do not cover the design.

    Attributes
    ----------
    name, digest : the design's name and content hash
    pressable_mm : length and width of the area that may be pressed [mm]
    pressable_mm2, pressable_share : this area, and its share of the pad's area [-]
    outer_mm : length, width and height of the sensor in its mold [mm]
    parts : number of emitters and receivers
    bill : sum of the bill of materials
    deepest_mm : depth of the deepest press [mm]
    is_facing_rows : whether the verdict is on facing pairs, which are pressed at known locations
    headline : verdict with the usable depth; empty without a score
    margin : least margin of any location, or of any facing pair [noise units]
    usable_mm : least depth to which depth is resolved [mm]
    deadband_mm : total length of the deadbands at the worst location, or of the governing facing pair [mm]
    location_mm : median Cramér-Rao bound of the location from one frame [mm]
    depth_mm : median Cramér-Rao bound of the depth [mm]; for facing rows, that at a known location
    detection_n : load from which a press is detected at the worst location [N]
    deepest_n : load of the deepest press in the middle [N], with the ends of the elastic modulus's band
    unresolved : share of the volume in which x, y and depth are not resolved together [-]; None for facing rows
    unresolved_step : largest share that one computed location and depth represents [-]
    """

    name: str
    digest: str
    pressable_mm: tuple[float, float]
    pressable_mm2: float
    pressable_share: float
    outer_mm: tuple[float, float, float]
    parts: int
    bill: BillSum
    deepest_mm: float
    is_facing_rows: bool = False
    headline: str = ""
    margin: float | None = None
    usable_mm: Band | None = None
    deadband_mm: float | None = None
    location_mm: Band | None = None
    depth_mm: Band | None = None
    detection_n: Band | None = None
    deepest_n: Band | None = None
    unresolved: float | None = None
    unresolved_step: float = 0.0

    @property
    def cells(self) -> tuple[FigureCell, ...]:
        """The figures as the cells of a table, the most important first; every table is made of them."""
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
                error=self.unresolved_step,
            ),
            *self.of_size,
        )

    @property
    def of_size(self) -> tuple[FigureCell, ...]:
        """The cells that need no score."""
        length, width, height = self.outer_mm
        known = list(self.bill.known.values())
        return (
            FigureCell(
                name="pressable",
                unit="mm",
                text=f"{_sizes(self.pressable_mm)} ({share_text(self.pressable_share)} %)",
                better="higher",
                value=self.pressable_mm2,
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
                unit="",
                text=price_text(self.bill),
                better="lower",
                value=known[0] if len(known) == 1 and not self.bill.unpriced else None,
            ),
        )

    def csv_columns(self) -> dict[str, Any]:
        """The figures as the columns of a CSV file; None where `to_json` has None, and for an unknown price."""
        found = self.to_json()
        sizes = {
            f"{name}_{axis}_mm": size
            for name in ("pressable", "outer")
            for axis, size in zip("xyz", found.pop(f"{name}_mm"), strict=False)
        }
        bill = found.pop("price")
        price = " + ".join(f"{value:.2f} {currency}" for currency, value in bill["known"].items())
        return found | sizes | {"price": price or None, "rows_without_price": bill["rows_without_price"]}

    def to_json(self) -> dict[str, Any]:
        """The figures as plain data; None where a figure does not exist, or a press is not resolved or detected."""
        return {
            "margin_noise_units": self.margin,
            "location_bound_mm": _plain(self.location_mm),
            "depth_bound_mm": _plain(self.depth_mm),
            "detection_force_n": _plain(self.detection_n),
            "deepest_force_n": _plain(self.deepest_n),
            "unresolved_share": self.unresolved,
            **self.size_json(),
        }

    def size_json(self) -> dict[str, Any]:
        """The entries of `to_json` that need no score."""
        return {
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


def figures_of(design: SensorDesign, score: ContinuityScore | Mapping[str, Any] | None) -> PadFigures:
    """The figures of a design.

    Parameters
    ----------
    score : the design's score with bounds, or its plain data as in `score.json`; None if the design has none yet
    """
    if score is None:
        return PadFigures(bill=bill_sum(bom_rows(design)), **_of_design(design))
    from optopad.sims.score.result import headline

    found = score if isinstance(score, Mapping) else score.to_json()
    bounds, force = found["bounds"], found["force"]
    is_facing = found["judged_by"] == "facing pairs"
    depth_bound = "median_depth_place_known_mm" if is_facing else "median_depth_mm"
    usable, between = found["usable_depth_mm"], found["usable_range_mm"]
    return PadFigures(
        is_facing_rows=is_facing,
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
        unresolved=None if bounds is None or is_facing else bounds["unresolved_share"],
        unresolved_step=0.0 if bounds is None else _voxel_share(design, bounds),
        bill=bill_sum(bom_rows(design, gain_of(found))),
        **_of_design(design),
    )


def summary_words(design: SensorDesign, score: ContinuityScore | None) -> str:
    """Size, pressable area, loads, number of parts and price of a design, on one line of the screen.

    Parameters
    ----------
    score : the design's score; if None, the loads are left out
    """
    found = figures_of(design, score)
    cavity, bill = cavity_of(design), found.bill
    outside, pad = f"{_sizes(found.outer_mm)} mm", _sizes((cavity.length_mm, cavity.width_mm))
    pressable = f"pressable {_sizes(found.pressable_mm)}"
    if bill.known:
        short = price_text(bill)
        missing = f" ({bill.unpriced} of {bill.rows} rows without a price)" if bill.unpriced else ""
        prices = [
            f"bill {short.partition(' + ')[0]}{missing}" if len(bill.known) == 1 else f"bill {short}",
            short,
        ]
    else:
        prices = ["no price known", ""]
    # the last choice is the first to be shortened
    forms = [
        ", ".join(filter(None, (size, area, load, f"{found.parts} parts", price)))
        for area, load, size, price in product(
            [f"{pressable} of {pad} mm", f"{pressable} mm"],
            _loads(found),
            [f"{outside} outside", outside],
            prices,
        )
    ]
    return next((form for form in forms if len(form) <= SUMMARY_ROOM), forms[-1])


def figure_lines(
    corner: str,
    labels: Sequence[str],
    figures: Sequence[PadFigures],
    winners: Mapping[str, int] | None = None,
) -> list[str]:
    """Lines of a table with one row for each design and one column for each figure.

    A figure that is the same for all designs is given once, below the table.

    Parameters
    ----------
    corner, labels : heading of the first column, and each design's entry in it
    winners : index of the design that is marked with a star, by the name of the figure
    """
    stars = winners or {}
    columns: list[tuple[str, str, Sequence[str]]] = []
    same: list[str] = []
    for cells in zip(*(one.cells for one in figures), strict=True):
        first = cells[0]
        if first.name != "verdict" and len(cells) > 1 and len({cell.text for cell in cells}) == 1:
            same += [first.words] if first.text != "-" else []
            continue
        star = stars.get(first.name)
        texts = [cell.text + (" *" if place == star else "") for place, cell in enumerate(cells)]
        columns.append((first.name, first.unit, texts))
    lines = in_columns([(corner, "", labels), *columns])
    lines += wrap(f"the same for all: {', '.join(same)}", TABLE_WIDTH, subsequent_indent="  ") if same else []
    texts = [cell.text for one in figures for cell in one.cells]
    if NONE in texts:
        lines.append(
            f"{NONE}: half of the volume is not resolved, or a press is not detected at some location"
        )
    if any(one.is_facing_rows for one in figures):
        lines.append("facing rows: the depth bound is that of presses at a known location")
    return lines


def in_columns(columns: Sequence[tuple[str, str, Sequence[str]]]) -> list[str]:
    """Lines of a table of columns, each with name, unit and texts.

    A table that is wider than `TABLE_WIDTH` is printed in parts, each with the first column.
    """
    padded = []
    for name, unit, texts in columns:
        cells = [name, unit, *texts]
        padded.append([f"{cell:<{max(map(len, cells))}}" for cell in cells])
    labels, *rest = padded
    parts = [[labels]]
    for column in rest:
        if len(parts[-1]) > 1 and sum(len(one[0]) + 2 for one in [*parts[-1], column]) > TABLE_WIDTH + 2:
            parts.append([labels])
        parts[-1].append(column)
    lines: list[str] = []
    for part in parts:
        lines += [""] if lines else []
        lines += ["  ".join(cells).rstrip() for cells in zip(*part, strict=True)]
    return lines


def _of_design(design: SensorDesign) -> dict[str, Any]:
    """Fields of `PadFigures` that need neither light nor price."""
    cavity, mold = cavity_of(design), outline_of(design)
    space = cavity.workspace
    top_mm = max(mold.highest_mm, cavity.plan.clear_mm)
    return {
        "name": design.name,
        "digest": design.digest,
        "deepest_mm": design.operating.max_depth_mm,
        "pressable_mm": (_rounded(space.x1_mm - space.x0_mm), _rounded(space.y1_mm - space.y0_mm)),
        "pressable_mm2": space.area_mm2,
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


def _voxel_share(design: SensorDesign, bounds: Mapping[str, Any]) -> float:
    """Largest share of the volume that one computed location and depth represents [-]."""
    from optopad.sims.bounds.observability import depth_weights

    space = cavity_of(design).workspace
    box_mm2 = (space.x1_mm - space.x0_mm) * (space.y1_mm - space.y0_mm)
    filled = space.area_mm2 / box_mm2 if box_mm2 > 0.0 else 1.0
    locations = len(bounds["x_mm"]) * len(bounds["y_mm"]) * filled
    return float(max(depth_weights(bounds["depth_mm"], design.operating.max_depth_mm)) / locations)


def _loads(found: PadFigures) -> list[str]:
    """Loads of first contact and of the deepest press as text, the longest form first; empty texts if not known."""
    first, last = found.detection_n, found.deepest_n
    if last is None:
        return [""]
    most = f"{last.value:.{1 if last.value < 10.0 else 0}f} N"
    deepest = f"{most} at {found.deepest_mm:g} mm"
    if first is None or math.isinf(first.value):
        return [deepest, f"load up to {most}"]
    band = f"{first.value:.2f} to {most}"
    return [f"contact from {first.value:.2f} N, {deepest}", f"load {band}", band]


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
        return FigureCell(name=name, unit=unit, text=NONE, better=better, value=band.value)
    return _number(name, unit, better, band.value, digits, max(band.error, least_error))
