"""What to order for an item of the bill of materials: maker's part number, order unit, and a price where one is known.

The entries are in `design/data/orders.toml`, by the identifier of a catalogue entry or by the kind of a passive part.
Resistors and capacitors have a part number for each value, by the maker's code (IEC 60062 for resistors; for
capacitors, two digits and a power of ten in picofarads, with 9 for a tenth of a picofarad).
"""

from __future__ import annotations

import math
from functools import cache
from typing import Annotated

from pydantic import Field

from optopad.design.fields.base import Model
from optopad.design.fields.packaged import data_table
from optopad.design.fields.quantity import Confidence, Cost, Source, Text

OHM_PER_UNIT = ((1e6, "M"), (1e3, "K"), (1.0, "R"))
TENTHS = "9"
"""Third digit of a capacitor's code for two digits in tenths of a picofarad."""


class Order(Model):
    """The order of one item.

    Attributes
    ----------
    low, high : smallest and largest resistance [ohm], capacitance [pF] or diameter of a wire [mm] with this part number
    most_mw : largest power of a resistor [mW]
    """

    part_number: Text
    manufacturer: str = ""
    quantity: Annotated[float, Field(gt=0.0, description="pieces or grams in one order unit")] = 1.0
    unit: Text = "piece"
    low: float | None = None
    high: float | None = None
    most_mw: float | None = None
    source: Source
    confidence: Confidence
    cost: Cost | None = None

    def number_of(self, value: float | None) -> str | None:
        """The part number for a value; None if the series does not have it."""
        if self.low is None or self.high is None or value is None:
            return self.part_number
        if not self.low <= value <= self.high:
            return None
        small = f"{round(value * 10):02d}{TENTHS}"
        tiny = f"{round(value * 100):02d}"
        return self.part_number.format(ohm=ohm_code(value), pf=_picofarad_code(value), pf9=small, pf100=tiny)

    def bears(self, power_mw: float) -> bool:
        """Whether a power is within the largest of the series; one without a limit bears any."""
        return self.most_mw is None or power_mw <= self.most_mw

    def units_for(self, quantity: float) -> int:
        """Number of order units that hold a quantity."""
        return math.ceil(quantity / self.quantity - 1e-9)


@cache
def orders() -> dict[str, Order]:
    """All packaged orders, by identifier of the catalogue or kind of part."""
    return {name: Order(**row) for name, row in data_table("orders.toml").items()}


def order_of(
    keys: tuple[str, ...], value: float | None = None, power_mw: float = 0.0
) -> tuple[Order, str] | None:
    """The first order among several that has an item and bears its power, with its part number; None if none does."""
    for key in keys:
        order = orders().get(key)
        number = None if order is None else order.number_of(value)
        if order is not None and number is not None and order.bears(power_mw):
            return order, number
    return None


def ohm_code(ohm: float) -> str:
    """Code of a resistance with the letter at the decimal point, such as 4K7, 120R or 1M."""
    scale, letter = next((one for one in OHM_PER_UNIT if ohm >= one[0]), OHM_PER_UNIT[-1])
    whole, _, part = f"{ohm / scale:g}".partition(".")
    return f"{whole}{letter}{part}"


def _picofarad_code(picofarad: float) -> str:
    power = max(math.floor(math.log10(picofarad)) - 1, 0) if picofarad > 0 else 0
    return f"{round(picofarad / 10**power):02d}{power}"
