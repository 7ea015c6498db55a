"""Resistors of the transistor switches of the emitters, and the current of the supply.

                supply                     Each emitter has its own NPN transistor; the pin drives the
                  |                        base. One emitter is lit at a time.
               [series]
                  |  anode                 series = (supply - forward) / max current, rounded up to E24
               [emitter]
                  |  cathode               base = (pin - base-emitter) x forced gain / max current,
    pin --[base]--|< NPN                   rounded down to E24, so that the transistor saturates
                  |
                ground

The choice is conservative. The calculation uses the lower end of the forward voltage's band, if there is one, and
neglects the transistor's own voltage drop. The emitter's current is therefore below its maximum. The supply's tolerance
and heating are not included. The receivers' amplifiers are in `design.circuit.transimpedance`.

The supply powers the lit emitter, the base of its transistor, the amplifiers and the board.

One emitter is lit at a time. If a fault lights all emitters, their currents add up. Each is the largest current that
the emitter's resistor permits. The other currents are assumed (`design/data/assumptions.toml`).
"""

from __future__ import annotations

from dataclasses import dataclass

from design.circuit.pins import board_of, shift_register_of
from design.fields.quantity import Quantity
from design.parts.assumptions import assumption, standard_at_least, standard_at_most
from design.parts.catalog import Board, Part
from design.shape.cavity import cavity_of
from design.spec import SensorDesign

MA_PER_A = 1e3
MW_PER_W = 1e3


@dataclass(frozen=True, kw_only=True)
class EmitterSwitch:
    """Resistors and currents of the transistor switch of one kind of emitter.

    Attributes
    ----------
    series_ohm : resistor in series with the emitter; None if the supply voltage is too low to light it
    base_ohm : resistor before the transistor's base
    forward_v : forward voltage of the calculation, the lower end of its band if there is one
    current_ma : largest current, at this forward voltage
    usual_current_ma : current at the typical forward voltage, which determines the emitted light
    base_current_ma : current from the pin into the transistor's base
    series_mw : power dissipated in the series resistor while the emitter is lit
    """

    series_ohm: float | None
    base_ohm: float
    forward_v: Quantity
    current_ma: float
    usual_current_ma: float
    base_current_ma: float
    series_mw: float


def most_drive_ma(design: SensorDesign, board: Board) -> tuple[str, float]:
    """Name and current limit [mA] of the output that drives an emitter's base resistor: a pin, or a shift register."""
    register = shift_register_of(design)
    if register is None:
        return "a pin", board.max_pin_current_ma.value
    return f"an output of {register.name}", register.max_output_ma.value


def emitter_switch(part: Part, board: Board) -> EmitterSwitch:
    """Compute the resistors of the transistor switch for an emitter of the catalogue on a board."""
    assert part.forward_voltage_v is not None, "the catalogue gives every emitter a forward voltage"
    assert part.max_current_ma is not None, "the catalogue gives every emitter a current"
    supply = board.emitter_v
    drop = _least_forward_v(part.forward_voltage_v)
    most_a = part.max_current_ma.value / MA_PER_A
    base_ohm = _base_ohm(board.pin_v, most_a)
    left = supply - drop.value
    series = standard_at_least(left / most_a) if left > 0 else None
    current_a = left / series if series else 0.0
    return EmitterSwitch(
        series_ohm=series,
        base_ohm=base_ohm,
        forward_v=drop,
        current_ma=current_a * MA_PER_A,
        usual_current_ma=max(supply - part.forward_voltage_v.value, 0.0) / series * MA_PER_A
        if series
        else 0.0,
        base_current_ma=(board.pin_v - assumption("base_emitter_v").value) / base_ohm * MA_PER_A,
        series_mw=current_a * max(left, 0.0) * MW_PER_W,
    )


def _base_ohm(pin_v: float, most_a: float) -> float:
    left = pin_v - assumption("base_emitter_v").value
    return standard_at_most(left * assumption("forced_gain").value / most_a)


def _least_forward_v(forward: Quantity) -> Quantity:
    return forward if forward.low is None else forward.model_copy(update={"value": forward.low})


@dataclass(frozen=True, kw_only=True)
class SupplyCurrent:
    """Currents from the supply [mA].

    Attributes
    ----------
    emitter_ma : largest current of one emitter, with the base current of its transistor
    all_emitters_ma : current of all emitters together, which only a fault can cause
    amplifiers_ma, board_ma : assumed currents of the amplifiers and of the board
    """

    emitter_ma: float
    all_emitters_ma: float
    amplifiers_ma: float
    board_ma: float

    @property
    def full_power_ma(self) -> float:
        """Current while the sensor operates with one emitter lit [mA]."""
        return self.emitter_ma + self.amplifiers_ma + self.board_ma

    @property
    def fault_ma(self) -> float:
        """Current if a fault lights all emitters [mA]."""
        return self.all_emitters_ma + self.amplifiers_ma + self.board_ma


def supply_current(design: SensorDesign) -> SupplyCurrent:
    """Compute the supply currents of a design."""
    cavity, board = cavity_of(design), board_of(design)
    switches = [emitter_switch(one.part, board) for one in cavity.emitters]
    each = [switch.current_ma + switch.base_current_ma for switch in switches]
    return SupplyCurrent(
        emitter_ma=max(each, default=0.0),
        all_emitters_ma=sum(each),
        amplifiers_ma=assumption("amplifier_supply_ma").value * len(cavity.receivers),
        board_ma=assumption("board_supply_ma").value,
    )
