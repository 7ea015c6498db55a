"""Assumed values about circuits and printers that are not part of a design or its catalogue.

Each has a unit, a source and a confidence. The module also has the standard values of resistors and capacitors (IEC
60063), and their notation in orders. The assumed printer has a build volume, a narrowest stroke and a longest bridge,
which the checks of printed parts use.
"""

from __future__ import annotations

import math
import re

from optopad.design.errors import InputError
from optopad.design.fields.packaged import data_quantities
from optopad.design.fields.quantity import Quantity


def assumption(name: str) -> Quantity:
    """A value from the file `design/data/assumptions.toml`, by its name."""
    return data_quantities("assumptions.toml")[name]


_E24 = "1.0 1.1 1.2 1.3 1.5 1.6 1.8 2.0 2.2 2.4 2.7 3.0 3.3 3.6 3.9 4.3 4.7 5.1 5.6 6.2 6.8 7.5 8.2 9.1"
E24 = tuple(_E24.split())
"""Standard values of resistors in one decade."""
E12 = ("1.0", "1.2", "1.5", "1.8", "2.2", "2.7", "3.3", "3.9", "4.7", "5.6", "6.8", "8.2")
"""Standard values of capacitors in one decade."""

ROUNDING = 1e-9
"""Relative tolerance within which a computed value counts as equal to a standard value."""

OHM_PER_KILOOHM = 1e3
OHM_PER_MEGOHM = 1e6


def standard_at_least(value: float, series: tuple[str, ...] = E24) -> float:
    """Smallest standard value that is at least the given one, in the same unit."""
    return next(one for one in _nearby(value, series) if one >= value * (1 - ROUNDING))


def standard_at_most(value: float, series: tuple[str, ...] = E24) -> float:
    """Largest standard value that is at most the given one, in the same unit."""
    return next(one for one in reversed(_nearby(value, series)) if one <= value * (1 + ROUNDING))


def standard_nearest(value: float, series: tuple[str, ...] = E24) -> float:
    """Standard value that is nearest to the given one in ratio, in the same unit."""
    return min(_nearby(value, series), key=lambda one: abs(math.log(one / value)))


def ohm_text(ohm: float) -> str:
    """A resistance as text for orders, such as 120 ohm, 2.2 kohm, 1 Mohm."""
    for scale, unit in ((OHM_PER_MEGOHM, "Mohm"), (OHM_PER_KILOOHM, "kohm")):
        if ohm >= scale:
            return f"{ohm / scale:g} {unit}"
    return f"{ohm:g} ohm"


def _nearby(value: float, series: tuple[str, ...]) -> list[float]:
    decade = math.floor(math.log10(value))
    return [float(f"{step}e{power}") for power in range(decade - 1, decade + 2) for step in series]


Bed = tuple[float, float, float]
"""Build volume of a printer: x, y and height [mm]."""


def printer(name: str) -> Quantity:
    """A value from the file `design/data/printer.toml`, by its name."""
    return data_quantities("printer.toml")[name]


def usual_bed_mm() -> Bed:
    """Build volume of the assumed printer [mm]."""
    return printer("bed_x").value, printer("bed_y").value, printer("bed_z").value


def bed_of(text: str) -> Bed:
    """Parse a printer's build volume from the command line: ``220,220,250`` or ``220x220x250`` [mm].

    Raises
    ------
    InputError : the text does not consist of three lengths above 0.
    """
    pieces = re.split(r"[,x]", text.strip().lower())
    try:
        sides = [float(piece) for piece in pieces]
    except ValueError:
        sides = []
    if len(sides) != 3 or not all(0 < side < 1e4 for side in sides):
        raise InputError(f"--bed: {text!r} is refused: must be three lengths in mm above 0, as 220,220,250")
    return sides[0], sides[1], sides[2]
