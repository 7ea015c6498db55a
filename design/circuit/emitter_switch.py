"""Resistors of the transistors that switch the emitters, and the current from the supply.

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
and any heating are not included. The receivers' amplifiers are in `optopad.design.circuit.transimpedance`.

The transistor is the smallest of the catalogue that suits: its saturation voltage is stated at the emitter's largest
current or above, with a base current of a tenth, and it bears the emitters' supply. The design may name another in
`board.transistor`.

With LED drivers, no emitter has a transistor or a series resistor. Each anode is connected to the supply, and each
cathode to a constant-current output. One reference resistor on each driver sets the current of all outputs:

    reference = current ratio x reference voltage / current, rounded up to E24

The current is the lowest `max_current_ma` of the design's emitters, or that of an output if this is lower.

The supply feeds the lit emitter and its base, the amplifiers and the board.

One emitter is lit at a time. If a fault lights all emitters, their currents add up. Each is the largest current that
the emitter's resistor permits. The current of an amplifier is that of its entry. As long as the amplifier is not known,
its current is assumed, as that of the board is (`design/data/assumptions.toml`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from optopad.design.circuit.amplifier import Shortfall
from optopad.design.circuit.circuit import Circuit
from optopad.design.fields.quantity import Quantity
from optopad.design.parts.assumptions import assumption, standard_at_least, standard_at_most
from optopad.design.parts.catalog import Board, Part, find_amplifier, find_transistor
from optopad.design.parts.circuits import ShiftRegister, Transistor

MA_PER_A = 1e3
MW_PER_W = 1e3


@dataclass(frozen=True, kw_only=True)
class EmitterSwitch:
    """Resistors and currents of the transistor switch for one type of emitter.

    Attributes
    ----------
    series_ohm : resistor in series with the emitter; None if the supply voltage is too low to light it
    base_ohm : resistor before the transistor's base
    forward_v : forward voltage used in the calculation: the lower end of its band if there is one
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


def most_drive_ma(circuit: Circuit) -> tuple[str, float]:
    """Name and current limit [mA] of what drives an emitter's base resistor: a pin, or a shift register's output."""
    for chips in circuit.emitter_chips:
        if isinstance(chips.entry, ShiftRegister):
            return f"an output of {chips.entry.name}", chips.entry.max_output_ma.value
    return "a pin", circuit.board.max_pin_current_ma.value


def emitter_switch(part: Part, board: Board) -> EmitterSwitch:
    """Compute the resistors of the transistor switch for a catalogue emitter on a given board."""
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


@dataclass(frozen=True, kw_only=True)
class ChosenTransistor:
    """The transistor that switches an emitter: its identifier and entry in the catalogue."""

    transistor_id: str
    entry: Transistor


def transistor_of(circuit: Circuit, part: Part) -> ChosenTransistor:
    """The transistor that the design names, or else the smallest that suits the emitter, or the largest there is.

    Raises
    ------
    DesignError : the design names a transistor that is not in the catalogue.
    """
    entries, named = circuit.entries, circuit.use.transistor
    if named is not None:
        return ChosenTransistor(transistor_id=named, entry=find_transistor(entries, named))
    by_size = sorted(entries.transistors.items(), key=lambda item: item[1].saturation_ma.value)
    suits = (item for item in by_size if not any(transistor_shortfalls(circuit, item[1], part)))
    name, entry = next(suits, by_size[-1])
    return ChosenTransistor(transistor_id=name, entry=entry)


def transistor_shortfalls(circuit: Circuit, transistor: Transistor, part: Part) -> Iterator[Shortfall]:
    """Limits of an emitter's switch that a transistor does not keep."""
    assert part.max_current_ma is not None, "the catalogue gives every emitter a current"
    current_ma, supply_v = part.max_current_ma.value, circuit.board.emitter_v
    if current_ma > transistor.saturation_ma.value:
        yield Shortfall(
            meaning="does not saturate at the current",
            value=f"{current_ma:g} mA",
            limit=f"at most {transistor.saturation_ma.value:g} mA",
        )
    if supply_v > transistor.most_collector_v:
        yield Shortfall(
            meaning="does not bear the supply",
            value=f"{supply_v:g} V",
            limit=f"at most {transistor.most_collector_v:g} V",
        )


@dataclass(frozen=True, kw_only=True)
class CurrentSink:
    """The constant current that all outputs of a design's LED drivers share.

    Attributes
    ----------
    reference_ohm : standard resistor at the reference pin of each driver
    current_ma : current through the emitter that is on
    asked_ma : lowest `max_current_ma` of the design's emitters; more than `current_ma` if the outputs cannot supply it
    dropout_v : voltage at the output that is on, which the supply must provide in addition to the forward voltage
    """

    reference_ohm: float
    current_ma: float
    asked_ma: float
    dropout_v: float

    def needed_v(self, part: Part) -> float:
        """Lowest supply voltage for an emitter [V]: its largest possible forward voltage, plus the dropout."""
        forward = part.forward_voltage_v
        assert forward is not None, "the catalogue gives every emitter a forward voltage"
        return (forward.value if forward.high is None else forward.high) + self.dropout_v


def current_sink(circuit: Circuit) -> CurrentSink | None:
    """The current of the design's LED drivers; None if each emitter has a transistor."""
    driver = circuit.led_driver
    if driver is None:
        return None
    limits = [one.part.max_current_ma for one in circuit.cavity.emitters]
    asked_ma = min(limit.value for limit in limits if limit is not None)
    volts = driver.current_ratio * driver.reference_v
    reference = standard_at_least(volts * MA_PER_A / min(asked_ma, driver.max_output_ma.value))
    return CurrentSink(
        reference_ohm=reference,
        current_ma=volts / reference * MA_PER_A,
        asked_ma=asked_ma,
        dropout_v=driver.dropout_v.value,
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
    emitter_ma : current of the emitter that draws most, plus the base current of its transistor, if it has one
    all_emitters_ma : the same for all emitters at once, which the firmware never lights together
    amplifiers_ma : of all amplifiers, also of spare ones in their packages
    is_amplifier_known : whether it is that of the catalogue's entry, and not assumed
    board_ma : assumed current of the board
    circuits_ma : own current of converters and LED drivers
    """

    emitter_ma: float
    all_emitters_ma: float
    amplifiers_ma: float
    board_ma: float
    is_amplifier_known: bool
    circuits_ma: float = 0.0

    @property
    def full_power_ma(self) -> float:
        """Current while the sensor runs, with one emitter lit [mA]."""
        return self.emitter_ma + self.amplifiers_ma + self.board_ma + self.circuits_ma

    @property
    def fault_ma(self) -> float:
        """Current with every emitter lit [mA]."""
        return self.all_emitters_ma + self.amplifiers_ma + self.board_ma + self.circuits_ma


def supply_current(circuit: Circuit, amplifier_id: str | None = None) -> SupplyCurrent:
    """The currents that a design draws from the supply.

    Parameters
    ----------
    amplifier_id : the receivers' amplifier in the catalogue; if None and the design names none, its current is assumed

    Raises
    ------
    DesignError : the catalogue has no such amplifier.
    """
    cavity, board, sink = circuit.cavity, circuit.board, current_sink(circuit)
    switches = [emitter_switch(one.part, board) for one in cavity.emitters]
    each = [switch.current_ma + switch.base_current_ma for switch in switches]
    if sink is not None:
        each = [sink.current_ma for _ in each]
    return SupplyCurrent(
        emitter_ma=max(each, default=0.0),
        all_emitters_ma=sum(each),
        amplifiers_ma=_amplifiers_ma(circuit, amplifier_id or circuit.use.amplifier, len(cavity.receivers)),
        is_amplifier_known=(amplifier_id or circuit.use.amplifier) is not None,
        board_ma=assumption("board_supply_ma").value,
        circuits_ma=sum(chips.count * chips.entry.own_ma for chips in reversed(circuit.chips)),
    )


def _amplifiers_ma(circuit: Circuit, amplifier_id: str | None, receivers: int) -> float:
    if amplifier_id is None:
        return assumption("amplifier_supply_ma").value * receivers
    entry = find_amplifier(circuit.entries, amplifier_id)
    return entry.supply_ma.value * entry.channels * entry.needed(receivers)
