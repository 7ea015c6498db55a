"""Resistors of the emitters' switches, from the catalogue and the board's voltages.

                supply                     Each emitter has its own NPN transistor; the pin drives the
                  |                        base. One emitter is lit at a time.
               [series]
                  |  anode                 series = (supply - forward) / max current, rounded up to E24
               [emitter]
                  |  cathode               base = (pin - base-emitter) x forced gain / max current,
    pin --[base]--|< NPN                   rounded down to E24, so that the transistor saturates
                  |
                ground

The choice is conservative: the forward voltage is the lower end of its band where there is one, and the transistor's
own drop is neglected, so the emitter's current stays below its maximum. The model leaves out the supply's tolerance and
heating. The receivers' amplifiers are in `design.circuit.transimpedance`.

The supply feeds the lit emitter and its base, the amplifiers and the board.

One emitter is lit at a time, at full power; with all of them lit by a fault the supply sees their sum. Emitters take
the largest current that their resistors permit; the other currents are assumed (`design/data/assumptions.toml`).
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
    """Resistors of one kind of emitter.

    Attributes
    ----------
    series_ohm, base_ohm : standard values; series_ohm is None when the supply cannot light the emitter
    forward_v : the forward voltage of the calculation, and its source
    current_ma : largest current through the emitter at that voltage
    usual_current_ma : current through the emitter at its usual forward voltage; it sets the emitted light
    base_current_ma : current out of the pin
    series_mw : heat in the series resistor while the emitter is lit
    """

    series_ohm: float | None
    base_ohm: float
    forward_v: Quantity
    current_ma: float
    usual_current_ma: float
    base_current_ma: float
    series_mw: float


def most_drive_ma(design: SensorDesign, board: Board) -> tuple[str, float]:
    """What drives an emitter's base resistor, and the most that it should give [mA]."""
    register = shift_register_of(design)
    if register is None:
        return "a pin", board.max_pin_current_ma.value
    return f"an output of {register.name}", register.max_output_ma.value


def emitter_switch(part: Part, board: Board) -> EmitterSwitch:
    """Resistors for an emitter of the catalogue on a board."""
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
    """Currents of the supply [mA].

    Attributes
    ----------
    emitter_ma : the emitter with the largest current, and the base current of its transistor
    all_emitters_ma : all emitters at once, which the firmware never lights together
    amplifiers_ma, board_ma : assumed
    """

    emitter_ma: float
    all_emitters_ma: float
    amplifiers_ma: float
    board_ma: float

    @property
    def full_power_ma(self) -> float:
        """Current while the sensor runs, with one emitter lit [mA]."""
        return self.emitter_ma + self.amplifiers_ma + self.board_ma

    @property
    def fault_ma(self) -> float:
        """Current with every emitter lit [mA]."""
        return self.all_emitters_ma + self.amplifiers_ma + self.board_ma


def supply_current(design: SensorDesign) -> SupplyCurrent:
    """The currents of a design."""
    cavity, board = cavity_of(design), board_of(design)
    switches = [emitter_switch(one.part, board) for one in cavity.emitters]
    each = [switch.current_ma + switch.base_current_ma for switch in switches]
    return SupplyCurrent(
        emitter_ma=max(each, default=0.0),
        all_emitters_ma=sum(each),
        amplifiers_ma=assumption("amplifier_supply_ma").value * len(cavity.receivers),
        board_ma=assumption("board_supply_ma").value,
    )
