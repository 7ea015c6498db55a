"""Clear casting silicones: refractive index, stiffness, absorption, density and cure.

The mixing ratio is the weight of the base divided by that of the curing agent. The refractive index is interpolated
linearly in wavelength inside a source's table, and linearly in the mixing ratio between two tables. Other published
fits (one-term Sellmeier, Schneider 2009) only widen the band of uncertainty. Young's modulus E is interpolated linearly
in 1/ratio between the rows of a table (Wang 2014: E = 20 MPa / ratio).

The model does not include temperature, strain stiffening, or the effect of cure temperature and age. The last two
change E by up to a factor of two, which the band covers. Nothing is extrapolated beyond the wavelengths or ratios of a
table.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import sqrt
from typing import Annotated, Self

from pydantic import Field, model_validator

from optopad.design.errors import DesignError
from optopad.design.fields.base import Model
from optopad.design.fields.quantity import (
    AbsorptionDbPerCm,
    Confidence,
    DensityGPerCm3,
    Maker,
    Notes,
    PoissonRatio,
    Quantity,
    Source,
    Title,
    check_band,
    weakest,
)

MixingRatio = Annotated[float, Field(gt=0.0, le=100.0, description="base over curing agent by weight")]
WavelengthUm = Annotated[float, Field(ge=0.2, le=2.0)]
RefractiveIndex = Annotated[float, Field(ge=1.0, le=2.5)]

RATIO_SLACK = 1e-9


class IndexTable(Model):
    """Table of the refractive index by wavelength, at one mixing ratio."""

    mixing_ratio: MixingRatio
    wavelength_um: Annotated[
        tuple[WavelengthUm, ...], Field(min_length=1, description="wavelengths of the table")
    ]
    index: Annotated[
        tuple[RefractiveIndex, ...], Field(min_length=1, description="refractive index at these wavelengths")
    ]
    source: Source
    confidence: Confidence

    @model_validator(mode="after")
    def _is_a_table(self) -> Self:
        if len(self.wavelength_um) != len(self.index):
            raise ValueError(
                f"wavelength_um has {len(self.wavelength_um)} entries, index {len(self.index)}: they pair up"
            )
        if any(later <= earlier for earlier, later in pairwise(self.wavelength_um)):
            raise ValueError("wavelength_um must rise from entry to entry")
        return self


class IndexFormula(Model):
    """Formula of the refractive index from another source, n^2 = 1 + b wavelength^2 / (wavelength^2 - c_um2).

    It only widens the band.
    """

    b: Annotated[float, Field(gt=0.0, le=10.0, description="b of n² = 1 + b λ² / (λ² - c)")]
    c_um2: Annotated[float, Field(ge=0.0, lt=0.04, description="c of the same formula [µm²]")]
    from_um: Annotated[WavelengthUm, Field(description="shortest wavelength of the formula")]
    to_um: Annotated[WavelengthUm, Field(description="longest wavelength of the formula")]
    source: Source
    confidence: Confidence

    @model_validator(mode="after")
    def _has_a_range(self) -> Self:
        if self.to_um <= self.from_um:
            raise ValueError(f"to_um = {self.to_um} must be above from_um = {self.from_um}")
        return self

    def index(self, wavelength_um: float) -> float:
        """Refractive index from the formula, at a wavelength in its range [-]."""
        square = wavelength_um**2
        return sqrt(1.0 + self.b * square / (square - self.c_um2))


class ModulusRow(Model):
    """Young's modulus at one mixing ratio."""

    mixing_ratio: MixingRatio
    modulus_mpa: Annotated[float, Field(gt=0.0, le=100.0, description="Young's modulus")]
    low: Annotated[float, Field(gt=0.0, le=100.0, description="lower end of the band [MPa]")]
    high: Annotated[float, Field(gt=0.0, le=100.0, description="upper end of the band [MPa]")]
    source: Source
    confidence: Confidence

    @model_validator(mode="after")
    def _band_holds_value(self) -> Self:
        check_band(self.modulus_mpa, self.low, self.high)
        return self


class Cure(Model):
    """One cure schedule: temperature and time."""

    temperature_c: Annotated[
        float, Field(ge=0.0, le=250.0, description="temperature of the oven or the room")
    ]
    minutes: Annotated[float, Field(gt=0.0, le=30000.0, description="time at this temperature")]
    source: Source
    confidence: Confidence


class Elastomer(Model):
    """A clear two-part silicone; a kit whose parts are mixed in equal amounts has the mixing ratio 1."""

    title: Title
    manufacturer: Maker
    mixing_ratio_low: MixingRatio
    mixing_ratio_high: MixingRatio
    density_g_per_cm3: Annotated[
        DensityGPerCm3,
        Field(description="density of the cured silicone, from which the build sheet computes grams"),
    ]
    poisson_ratio: Annotated[PoissonRatio, Field(description="Poisson's ratio of the cured silicone")]
    absorption_db_per_cm: Annotated[
        AbsorptionDbPerCm, Field(description="absorption of light in the clear layer")
    ]
    index: Annotated[
        tuple[IndexTable, ...],
        Field(min_length=1, description="refractive index by mixing ratio: a table over the wavelength"),
    ]
    index_band: Annotated[
        tuple[IndexFormula, ...], Field(description="other sources; they widen the band")
    ] = ()
    modulus: Annotated[
        tuple[ModulusRow, ...],
        Field(min_length=1, description="Young's modulus by mixing ratio, with its band"),
    ]
    cure: Annotated[tuple[Cure, ...], Field(description="temperatures and times of the cure")] = ()
    notes: Notes = ()

    @model_validator(mode="after")
    def _ratios_are_in_order(self) -> Self:
        low, high = self.mixing_ratio_low, self.mixing_ratio_high
        if high < low:
            raise ValueError(f"mixing_ratio_high = {high:g} must be at least mixing_ratio_low = {low:g}")
        for name, rows in (("index", self.index), ("modulus", self.modulus)):
            ratios = [row.mixing_ratio for row in rows]
            if any(later <= earlier for earlier, later in pairwise(ratios)):
                raise ValueError(f"{name}: mixing_ratio must rise from table to table, got {ratios}")
            if ratios[0] < low or ratios[-1] > high:
                raise ValueError(f"{name}: mixing_ratio must be within {low:g} to {high:g}, got {ratios}")
        return self

    @model_validator(mode="after")
    def _band_meets_the_tables(self) -> Self:
        for place, formula in enumerate(self.index_band):
            start, end = _shared_um(self.index, formula)
            if start > end:
                raise ValueError(
                    f"index_band.{place}: its wavelengths must overlap those of every index table"
                )
        return self


@dataclass(frozen=True, kw_only=True)
class _Interpolated:
    """Refractive index that is interpolated between two tables.

    `ends` are the refractive indices from the two tables at the wavelength. `is_tabulated` is true if the value is an
    entry of a table.
    """

    value: float
    ends: tuple[float, float]
    tables: tuple[IndexTable, IndexTable]
    is_tabulated: bool


def refractive_index(elastomer: Elastomer, mixing_ratio: float, wavelength_um: float) -> Quantity:
    """Refractive index of a cured elastomer, with a band that covers all its sources.

    Parameters
    ----------
    elastomer : the catalogue entry
    mixing_ratio : weight of base divided by weight of curing agent [-]
    wavelength_um : vacuum wavelength [um]

    Returns
    -------
    The index [-]. Its band includes the values of other sources' formulas. Outside the wavelengths of a formula, its
    difference from the tables at its nearest wavelength is used. If the mixing ratio is permitted but outside the
    tables, the nearest table is used and the band includes all tables, because they show no trend with the ratio, only
    scatter between samples.

    Raises
    ------
    DesignError : no table covers the mixing ratio or the wavelength.
    """
    nearest_ratio = _ratio_with_table(elastomer, mixing_ratio)
    is_held = nearest_ratio != mixing_ratio
    mixing_ratio = nearest_ratio
    found = _interpolate(elastomer, mixing_ratio, wavelength_um)
    others = []
    for formula in elastomer.index_band:
        start, end = _shared_um(elastomer.index, formula)
        nearest = min(max(wavelength_um, start), end)
        others.append(
            found.value + formula.index(nearest) - _interpolate(elastomer, mixing_ratio, nearest).value
        )
    if is_held:
        others += [_in_table(table, wavelength_um, elastomer.title)[0] for table in elastomer.index]
    grades = [table.confidence for table in found.tables]
    if is_held or not found.is_tabulated:
        grades.append("inferred")
    return Quantity(
        value=found.value,
        unit="1",
        source=_joined(
            [table.source for table in found.tables], [band.source for band in elastomer.index_band]
        ),
        confidence=weakest(*grades),
        low=min(found.value, *found.ends, *others),
        high=max(found.value, *found.ends, *others),
    )


def youngs_modulus_mpa(elastomer: Elastomer, mixing_ratio: float) -> Quantity:
    """Young's modulus of a cured elastomer [MPa], interpolated linearly in 1 / mixing ratio.

    Parameters
    ----------
    elastomer : the catalogue entry
    mixing_ratio : weight of base divided by weight of curing agent [-]

    Raises
    ------
    DesignError : the mixing ratio is outside the range of the catalogue's table.
    """
    rows = elastomer.modulus
    below, above, _ = _bracket(
        [row.mixing_ratio for row in rows],
        mixing_ratio,
        f"elastomer.mixing_ratio: {elastomer.title} has its Young's modulus",
        "choose a ratio inside, or give elastomer.youngs_modulus_mpa",
    )
    first, second = rows[below], rows[above]
    weight = 0.0
    if first is not second:
        weight = (1 / mixing_ratio - 1 / first.mixing_ratio) / (
            1 / second.mixing_ratio - 1 / first.mixing_ratio
        )
    return Quantity(
        value=first.modulus_mpa + weight * (second.modulus_mpa - first.modulus_mpa),
        unit="MPa",
        source=_joined([first.source, second.source], []),
        confidence=weakest(first.confidence, second.confidence, *(() if first is second else ("inferred",))),
        low=first.low + weight * (second.low - first.low),
        high=first.high + weight * (second.high - first.high),
    )


def _bracket(knots: Sequence[float], at: float, what: str, way_out: str) -> tuple[int, int, float]:
    """Indices of the two knots around `at`, and the weight of the second one; both indices are equal at a knot.

    Raises
    ------
    DesignError : `at` is outside the knots; the message starts with `what` and ends with `way_out`.
    """
    for place, knot in enumerate(knots):
        if abs(knot - at) <= RATIO_SLACK:
            return place, place, 0.0
    if not knots[0] < at < knots[-1]:
        known = f"at {knots[0]:g} only" if len(knots) == 1 else f"from {knots[0]:g} to {knots[-1]:g}"
        raise DesignError(f"{what} {known}, not at {at:g}; {way_out}")
    above = next(place for place, knot in enumerate(knots) if knot > at)
    return above - 1, above, (at - knots[above - 1]) / (knots[above] - knots[above - 1])


def _ratio_with_table(elastomer: Elastomer, mixing_ratio: float) -> float:
    """The mixing ratio itself or, if it is permitted but outside the tables, the ratio of the nearest table."""
    ratios = [table.mixing_ratio for table in elastomer.index]
    if len(ratios) == 1 or not elastomer.mixing_ratio_low <= mixing_ratio <= elastomer.mixing_ratio_high:
        return mixing_ratio
    return min(max(mixing_ratio, ratios[0]), ratios[-1])


def _interpolate(elastomer: Elastomer, mixing_ratio: float, wavelength_um: float) -> _Interpolated:
    below, above, weight = _bracket(
        [table.mixing_ratio for table in elastomer.index],
        mixing_ratio,
        f"elastomer.mixing_ratio: {elastomer.title} has its refractive index",
        "choose a ratio inside, or give elastomer.refractive_index",
    )
    tables = (elastomer.index[below], elastomer.index[above])
    low_end, low_exact = _in_table(tables[0], wavelength_um, elastomer.title)
    high_end, high_exact = _in_table(tables[1], wavelength_um, elastomer.title)
    return _Interpolated(
        value=low_end + weight * (high_end - low_end),
        ends=(low_end, high_end),
        tables=tables,
        is_tabulated=below == above and low_exact and high_exact,
    )


def _in_table(table: IndexTable, wavelength_um: float, title: str) -> tuple[float, bool]:
    """Refractive index from a table at a wavelength, and whether the table has an entry for this wavelength."""
    below, above, weight = _bracket(
        table.wavelength_um,
        wavelength_um,
        f"wavelength [um]: {title} at {table.mixing_ratio:g}:1 has its refractive index",
        "choose an emitter inside, or give elastomer.refractive_index",
    )
    return table.index[below] + weight * (table.index[above] - table.index[below]), below == above


def _shared_um(tables: Sequence[IndexTable], formula: IndexFormula) -> tuple[float, float]:
    """Shortest and longest wavelength that a formula and all tables cover [um]."""
    start = max(formula.from_um, *(table.wavelength_um[0] for table in tables))
    end = min(formula.to_um, *(table.wavelength_um[-1] for table in tables))
    return start, end


def _joined(sources: list[str], band: list[str]) -> str:
    text = "; ".join(dict.fromkeys(sources))
    return f"{text}; band: {'; '.join(band)}" if band else text
