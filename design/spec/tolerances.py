"""Tolerances of a manufactured unit: bands of unmeasured parameters, and manufacturing tolerances.

    not measured on the unit  ──► band of the catalogue or of `bands.toml`, with uniform density
    printed, poured, levelled ──► named defaults of `tolerances.toml`, which are assumptions (mostly normal)
    [tolerances] of the design ──► replace either: dotted path = half width in the field's unit; 0 is exact

A value that is listed in the design's field `measured` does not vary. All emitters deviate together, as do all
receivers; scatter between individual parts is not included. Displacements along a wall are not included, nor are
correlations between values, because none are known.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any, Literal

from optopad.design.errors import DesignError
from optopad.design.fields.base import get_at, is_value, known_values, unknown_path
from optopad.design.fields.finding import Finding, error
from optopad.design.fields.packaged import data_table
from optopad.design.fields.quantity import Quantity
from optopad.design.spec import SensorDesign
from optopad.design.spec.properties import UsedValue, used_values

Distribution = Literal["uniform", "normal"]
Origin = Literal["open value", "making", "given in the design"]
GIVEN_SOURCE = "half width given in the design's [tolerances]"


@dataclass(frozen=True, kw_only=True)
class Tolerance:
    """One value that may deviate on a manufactured unit.

    Attributes
    ----------
    path : dotted path of the design's field that sets the value
    value : value in the design, in `unit`
    low, high : ends of the range of possible values
    distribution : `uniform` from end to end, or `normal` around the middle and cut off at the ends, two standard
        deviations away
    origin : whether the value is unmeasured, varies in manufacture, or has a tolerance in the design
    source : source of the range
    """

    path: str
    value: float
    low: float
    high: float
    unit: str
    distribution: Distribution
    origin: Origin
    source: str

    @property
    def as_used_value(self) -> UsedValue:
        """The tolerance as a value with a band, so that a score can be computed for both ends."""
        quantity = Quantity(
            value=self.value,
            unit=self.unit,
            source=self.source,
            confidence="unverified",
            low=self.low,
            high=self.high,
        )
        return UsedValue(path=self.path, quantity=quantity)


def build_tolerances(design: SensorDesign) -> tuple[Tolerance, ...]:
    """All tolerances of a manufactured unit of a design, in a fixed order.

    Raises
    ------
    DesignError : a path in the design's table `tolerances` does not lead to a number.
    """
    found = {one.path: one for one in (*_open_values(design), *_made_values(design))}
    values = _values_of(design)
    for path, half_width in design.tolerances.items():
        found.pop(path, None)
        if half_width > 0.0:
            found[path] = _given(path, half_width, *values.at(path))
    return tuple(found.values())


def tolerance_findings(design: SensorDesign) -> Iterator[Finding]:
    """Errors about paths in the design's table `tolerances` that do not lead to a number."""
    values = _values_of(design)
    for path, half_width in design.tolerances.items():
        try:
            values.at(path)
        except DesignError as err:
            yield error(
                f"tolerances.{path}",
                "a tolerance without a field of the design",
                value=f"{half_width:g}",
                limit="the dotted path of a number of the design",
                way_out=str(err).removeprefix("tolerances: "),
            )


def _open_values(design: SensorDesign) -> list[Tolerance]:
    found = []
    for used in used_values(design):
        low, high = used.quantity.low, used.quantity.high
        if low is not None and high is not None and low < high and used.quantity.confidence != "measured":
            found.append(
                Tolerance(
                    path=used.path,
                    value=used.quantity.value,
                    low=low,
                    high=high,
                    unit=used.quantity.unit,
                    distribution="uniform",
                    origin="open value",
                    source=used.quantity.source,
                )
            )
    return found


def _made_values(design: SensorDesign) -> list[Tolerance]:
    document = design.model_dump(mode="json")
    found = []
    for path, row in _defaults().items():
        if not is_value(document, path):
            continue  # a disc has no length
        value = float(get_at(document, path))
        if path not in design.measured and value > 0.0:
            found.append(
                Tolerance(
                    path=path,
                    value=value,
                    low=max(value - row.plus_minus, 0.0),
                    high=value + row.plus_minus,
                    unit=row.unit,
                    distribution=row.distribution,
                    origin="making",
                    source=row.source,
                )
            )
    return found


def _given(path: str, half_width: float, value: float, unit: str) -> Tolerance:
    return Tolerance(
        path=path,
        value=value,
        low=max(value - half_width, 0.0),
        high=value + half_width,
        unit=unit,
        distribution="normal",
        origin="given in the design",
        source=GIVEN_SOURCE,
    )


@dataclass(frozen=True, kw_only=True)
class _Values:
    """Values with units that a tolerance may name: of the parts and materials in use, and fields of the design."""

    used: Mapping[str, Quantity]
    document: Mapping[str, Any]

    def at(self, path: str) -> tuple[float, str]:
        """Value and unit at a dotted path; DesignError if it does not lead to a number."""
        if path in self.used:
            return self.used[path].value, self.used[path].unit
        if not is_value(self.document, path):
            raise DesignError(f"tolerances: {unknown_path(path, (*known_values(SensorDesign), *self.used))}")
        value = get_at(self.document, path)
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise DesignError(
                f"tolerances: {path}: {value!r} is no number, so it has no tolerance; remove it"
            )
        return float(value), next((unit for end, unit in UNIT_ENDS.items() if path.endswith(end)), "1")


def _values_of(design: SensorDesign) -> _Values:
    if not design.tolerances:
        return _Values(used={}, document={})
    used = {one.path: one.quantity for one in used_values(design)}
    return _Values(used=used, document=design.model_dump(mode="json"))


UNIT_ENDS = {"_mm": "mm", "_deg": "deg", "_n": "N", "_mpa": "MPa", "_db_per_cm": "dB/cm", "_nm": "nm"}
"""Unit of a field by the suffix of its name."""


@dataclass(frozen=True, kw_only=True)
class _Default:
    plus_minus: float
    unit: str
    distribution: Distribution
    source: str


@cache
def _defaults() -> dict[str, _Default]:
    return {path: _Default(**row) for path, row in data_table("tolerances.toml").items()}
