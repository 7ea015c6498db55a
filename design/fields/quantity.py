"""A catalogue value with its unit, source and confidence, and the field types that check its unit.

The confidence has four levels. A value is *measured* on the manufactured unit, *read* in the named source, *inferred*
(computed from read values), or *unverified* (assumed, or quoted from memory). The band from `low` to `high` is believed
to contain the true value.

Values in other units are converted when a specification is read; everywhere else there is one unit per quantity.

Lengths are in mm, angles in degrees, forces in N, moduli in MPa.
"""

from __future__ import annotations

import math
from typing import Annotated, Literal, Self

from pydantic import AfterValidator, Field, StringConstraints, model_validator

from optopad.design.fields.base import Model

ROUNDING_MM = 1e-9
"""Rounding error of sums of decimal lengths [mm]; lengths that differ by less count as equal."""

MM_PER_CM = 10.0
NM_PER_UM = 1000.0

ORDER_DIGITS = 12


def absorption_per_mm(absorption_db_per_cm: float) -> float:
    """Absorption coefficient a [1/mm] of the law exp(-a L), from a loss in dB/cm.

    Notes
    -----
    10^(-dB/10) = exp(-a L), so a L = ln(10)/10 for each dB of loss.
    """
    return absorption_db_per_cm * math.log(10.0) / 10.0 / MM_PER_CM


def lambertian_order(half_angle_deg: float) -> float:
    """Order m of the intensity law cos^m that falls to one half at `half_angle_deg` [-].

    The result is rounded, so that 60 degrees gives exactly 1, for which the light model has a special case. The
    rounding is far below the precision of any data sheet.
    """
    return round(math.log(0.5) / math.log(math.cos(math.radians(half_angle_deg))), ORDER_DIGITS)


Confidence = Annotated[
    Literal["measured", "read", "inferred", "unverified"],
    Field(description="`measured`, `read`, `inferred` or `unverified`"),
]
CONFIDENCES: tuple[Confidence, ...] = ("measured", "read", "inferred", "unverified")
"""Confidence levels, from highest to lowest."""

Text = Annotated[str, StringConstraints(strip_whitespace=True, min_length=1)]
Title = Annotated[Text, Field(description="full name")]
Maker = Annotated[Text, Field(description="who makes it")]
Source = Annotated[Text, Field(description="where the values come from")]
Notes = Annotated[tuple[Text, ...], Field(description="free text")]


class Quantity(Model):
    """A number with its unit, source, confidence and, if known, the band that contains the true value."""

    value: float
    unit: Text
    source: Annotated[Text, Field(description="document, figure or reasoning that the value comes from")]
    confidence: Confidence
    low: Annotated[float | None, Field(description="lower end of the band of the true value")] = None
    high: Annotated[float | None, Field(description="upper end of the band of the true value")] = None

    @model_validator(mode="after")
    def _band_holds_value(self) -> Self:
        check_band(self.value, self.low, self.high)
        return self


class Cost(Model):
    """A quoted price and its date."""

    value: Annotated[float, Field(ge=0.0, description="price of one component")]
    currency: Annotated[str, Field(pattern=r"^[A-Z]{3}$", description="ISO 4217 code, as EUR")]
    date: Annotated[
        str,
        Field(
            pattern=r"^\d{4}-(0[1-9]|1[0-2])(-(0[1-9]|[12]\d|3[01]))?$",
            description="of the quote: yyyy-mm or yyyy-mm-dd",
        ),
    ]
    source: Source


def check_band(value: float, low: float | None, high: float | None) -> None:
    """Refuse a band that does not contain its value; if `low` or `high` is None, there is no limit on that side.

    Raises
    ------
    ValueError : the value is outside [low, high].
    """
    if (low is not None and low > value) or (high is not None and high < value):
        raise ValueError(
            f"the band {low} to {high} does not include the value {value:g}; need low <= value <= high"
        )


def weakest(*confidences: Confidence) -> Confidence:
    """The lowest of several confidences."""
    return max(confidences, key=CONFIDENCES.index)


def _within(unit: str, least: float, most: float, *, open_low: bool = False) -> AfterValidator:
    def check(quantity: Quantity) -> Quantity:
        if quantity.unit != unit:
            raise ValueError(f"the unit is {quantity.unit!r}; this field is in {unit!r}: convert the value")
        for number in (quantity.value, quantity.low, quantity.high):
            if number is not None and not (least <= number <= most and (number > least or not open_low)):
                start = "above" if open_low else "from"
                raise ValueError(
                    f"{number:g} {unit} is out of range: must be {start} {least:g} to {most:g} {unit}"
                )
        return quantity

    return AfterValidator(check)


LengthMm = Annotated[Quantity, _within("mm", 0.0, 100.0, open_low=True)]
HalfAngleDeg = Annotated[Quantity, _within("deg", 1.0, 89.0)]
WavelengthNm = Annotated[Quantity, _within("nm", 200.0, 2000.0)]
VoltageV = Annotated[Quantity, _within("V", 0.0, 20.0, open_low=True)]
CurrentMa = Annotated[Quantity, _within("mA", 0.0, 5000.0, open_low=True)]
ResistanceOhm = Annotated[Quantity, _within("ohm", 0.0, 1e6, open_low=True)]
TimeUs = Annotated[Quantity, _within("us", 0.0, 1e5, open_low=True)]
FrequencyKhz = Annotated[Quantity, _within("kHz", 0.0, 1e5, open_low=True)]
FrequencyMhz = Annotated[Quantity, _within("MHz", 0.0, 100.0, open_low=True)]
PowerMw = Annotated[Quantity, _within("mW", 0.0, 1e4, open_low=True)]
ResponsivityAPerW = Annotated[Quantity, _within("A/W", 0.0, 1000.0, open_low=True)]
"""A photodiode has less than 1 A/W; a phototransistor amplifies its photocurrent some hundred times."""
DarkCurrentNa = Annotated[Quantity, _within("nA", 0.0, 1e6)]
BiasCurrentPa = Annotated[Quantity, _within("pA", 0.0, 1e8)]
OutputMarginMv = Annotated[Quantity, _within("mV", 0.0, 20000.0)]
SlewVPerUs = Annotated[Quantity, _within("V/us", 0.0, 1e5, open_low=True)]
CapacitancePf = Annotated[Quantity, _within("pF", 0.0, 1e6, open_low=True)]
DensityGPerCm3 = Annotated[Quantity, _within("g/cm3", 0.0, 10.0, open_low=True)]
ModulusMpa = Annotated[Quantity, _within("MPa", 0.0, 1000.0, open_low=True)]
PoissonRatio = Annotated[Quantity, _within("1", 0.0, 0.5)]
RefractiveIndex = Annotated[Quantity, _within("1", 1.0, 2.5)]
Reflectance = Annotated[Quantity, _within("1", 0.0, 1.0)]
AbsorptionDbPerCm = Annotated[Quantity, _within("dB/cm", 0.0, 50.0)]
