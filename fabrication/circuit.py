"""Resistors of the emitters' switches, from the catalogue and the board's supply.

                supply                     Each emitter has its own NPN transistor; the pin drives the
                  |                        base. One emitter is lit at a time.
               [series]
                  |  anode                 series = (supply - forward) / max current, rounded up to E24
               [emitter]
                  |  cathode               base = (supply - base-emitter) x forced gain / max current,
    pin --[base]--|< NPN                   rounded down to E24, so that the transistor saturates
                  |
                ground

Safe side: the forward voltage is the lower end of its band where there is one, and the transistor's own
drop is left out, so the emitter's current stays below its maximum. Left out: the supply's tolerance,
heating, the receivers' amplifiers (their gain needs the emitters' power, which no entry has).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from design.catalog import Board, Part
from design.quantity import Quantity
from fabrication.assumptions import assumption

_E24 = "1.0 1.1 1.2 1.3 1.5 1.6 1.8 2.0 2.2 2.4 2.7 3.0 3.3 3.6 3.9 4.3 4.7 5.1 5.6 6.2 6.8 7.5 8.2 9.1"
E24 = tuple(_E24.split())
"""Standard values of a decade, IEC 60063."""

ROUNDING = 1e-9
"""A computed value this near to a standard one, relatively, is that one."""

MA_PER_A = 1e3
MW_PER_W = 1e3
OHM_PER_KILOOHM = 1e3


@dataclass(frozen=True, kw_only=True)
class EmitterSwitch:
    """Resistors of one kind of emitter.

    Attributes
    ----------
    series_ohm, base_ohm : standard values; series_ohm is None when the supply cannot light the emitter
    forward_v : the forward voltage that they were computed with, and where it comes from
    current_ma : through the emitter at that voltage, at most
    base_current_ma : out of the pin
    series_mw : heat in the series resistor while the emitter is lit
    """

    series_ohm: float | None
    base_ohm: float
    forward_v: Quantity
    current_ma: float
    base_current_ma: float
    series_mw: float

    def overloads_pin(self, board: Board) -> bool:
        """Whether the base current is more than a pin of the board should give."""
        return self.base_current_ma > board.max_pin_current_ma.value


def emitter_switch(part: Part) -> EmitterSwitch:
    """Resistors for an emitter of the catalogue."""
    assert part.forward_voltage_v is not None, "the catalogue gives every emitter a forward voltage"
    assert part.max_current_ma is not None, "the catalogue gives every emitter a current"
    supply = assumption("supply_v").value
    drop = _least_forward_v(part.forward_voltage_v)
    most_a = part.max_current_ma.value / MA_PER_A
    base_ohm = _base_ohm(supply, most_a)
    left = supply - drop.value
    series = standard_at_least(left / most_a) if left > 0 else None
    current_a = left / series if series else 0.0
    return EmitterSwitch(
        series_ohm=series,
        base_ohm=base_ohm,
        forward_v=drop,
        current_ma=current_a * MA_PER_A,
        base_current_ma=(supply - assumption("base_emitter_v").value) / base_ohm * MA_PER_A,
        series_mw=current_a * max(left, 0.0) * MW_PER_W,
    )


def standard_at_least(ohm: float) -> float:
    """Smallest E24 resistance that is not below the given one [ohm]."""
    return next(value for value in _nearby(ohm) if value >= ohm * (1 - ROUNDING))


def standard_at_most(ohm: float) -> float:
    """Largest E24 resistance that is not above the given one [ohm]."""
    return next(value for value in reversed(_nearby(ohm)) if value <= ohm * (1 + ROUNDING))


def ohm_text(ohm: float) -> str:
    """A resistance as it is written on an order: 120 ohm, 2.2 kohm."""
    return f"{ohm:g} ohm" if ohm < OHM_PER_KILOOHM else f"{ohm / OHM_PER_KILOOHM:g} kohm"


def _base_ohm(supply_v: float, most_a: float) -> float:
    left = supply_v - assumption("base_emitter_v").value
    return standard_at_most(left * assumption("forced_gain").value / most_a)


def _least_forward_v(forward: Quantity) -> Quantity:
    return forward if forward.low is None else forward.model_copy(update={"value": forward.low})


def _nearby(ohm: float) -> list[float]:
    decade = math.floor(math.log10(ohm))
    return [float(f"{step}e{power}") for power in range(decade - 1, decade + 2) for step in E24]
