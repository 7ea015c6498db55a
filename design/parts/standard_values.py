"""Standard values of resistors and capacitors, IEC 60063, and how they are written on an order."""

from __future__ import annotations

import math

_E24 = "1.0 1.1 1.2 1.3 1.5 1.6 1.8 2.0 2.2 2.4 2.7 3.0 3.3 3.6 3.9 4.3 4.7 5.1 5.6 6.2 6.8 7.5 8.2 9.1"
E24 = tuple(_E24.split())
"""Resistors of a decade."""
E12 = ("1.0", "1.2", "1.5", "1.8", "2.2", "2.7", "3.3", "3.9", "4.7", "5.6", "6.8", "8.2")
"""Capacitors of a decade."""

ROUNDING = 1e-9
"""A computed value this near to a standard one, relatively, is that one."""

OHM_PER_KILOOHM = 1e3
OHM_PER_MEGOHM = 1e6


def standard_at_least(value: float, series: tuple[str, ...] = E24) -> float:
    """Smallest standard value that is not below the given one, in its unit."""
    return next(one for one in _nearby(value, series) if one >= value * (1 - ROUNDING))


def standard_at_most(value: float, series: tuple[str, ...] = E24) -> float:
    """Largest standard value that is not above the given one, in its unit."""
    return next(one for one in reversed(_nearby(value, series)) if one <= value * (1 + ROUNDING))


def standard_nearest(value: float, series: tuple[str, ...] = E24) -> float:
    """Standard value with the least ratio to the given one, in its unit."""
    return min(_nearby(value, series), key=lambda one: abs(math.log(one / value)))


def ohm_text(ohm: float) -> str:
    """A resistance as it is written on an order: 120 ohm, 2.2 kohm, 1 Mohm."""
    for scale, unit in ((OHM_PER_MEGOHM, "Mohm"), (OHM_PER_KILOOHM, "kohm")):
        if ohm >= scale:
            return f"{ohm / scale:g} {unit}"
    return f"{ohm:g} ohm"


def _nearby(value: float, series: tuple[str, ...]) -> list[float]:
    decade = math.floor(math.log10(value))
    return [float(f"{step}e{power}") for power in range(decade - 1, decade + 2) for step in series]
