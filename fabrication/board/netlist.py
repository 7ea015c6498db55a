"""The circuit of a design as parts with nets, in groups that are placed together.

    emitter   supply - RS - LED - Q - ground, RB from the drive to Q's base; with LED drivers, supply - LED - output
    receiver  photodiode and RF, CF at an inverting input of a package A of four amplifiers
    chips     as the schematic has their pins (`schematic_svg.pinouts_of`), and their capacitors

Nets have the names of the board's pins, such as D22 and A0, of the chips' terminals, such as S1-Q3 and M1-C0, and of
supplies, such as +5V and GND.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from optopad.design.circuit.circuit import Chips, Circuit
from optopad.design.circuit.emitter_switch import current_sink, emitter_switch, transistor_of
from optopad.design.errors import DesignError
from optopad.design.parts.assumptions import ohm_text
from optopad.design.parts.catalog import find_amplifier
from optopad.design.parts.circuits import Converter, LedDriver, ShiftRegister
from optopad.design.parts.orders import ohm_code
from optopad.fabrication.board.model import GROUND
from optopad.fabrication.board.packages import board_data
from optopad.fabrication.connections import connections_of
from optopad.fabrication.gain import SimulatedGain, feedbacks_for
from optopad.fabrication.sheets.bom import PULL_UP_OHM, SET_BY_GAIN
from optopad.fabrication.sheets.schematic_svg import Pinout, pinouts_of

AMPLIFIERS_EACH = 4
QUAD_PINS = ((1, 2, 3), (14, 13, 12), (7, 6, 5), (8, 9, 10))
"""Output, inverting and non-inverting input of each amplifier of a package of four; 4 is the supply, 11 ground.

The upper two come first; they serve the upper two of four receivers.
"""
PULL_DOWN_OHM = 10e3


@dataclass(frozen=True, kw_only=True)
class Component:
    """A part of the circuit: its package, and the net of each pad."""

    reference: str
    value: str
    package: str
    nets: Mapping[str, str]
    part_number: str = ""


@dataclass(frozen=True, kw_only=True)
class Group:
    """Parts that are placed together, the main one first.

    Attributes
    ----------
    kind : amplifier, chip or switch
    of_emitters : whether the group serves emitters
    """

    kind: str
    parts: tuple[Component, ...]
    of_emitters: bool = False


@dataclass(frozen=True, kw_only=True)
class OpticalNets:
    """Nets of an optical part's leads."""

    reference: str
    anode: str
    cathode: str


@dataclass(frozen=True, kw_only=True)
class Netlist:
    """The circuit on the board.

    Attributes
    ----------
    emitters, receivers : nets of the optical parts, in the order of the layout
    groups : all other parts but the header
    header : nets of the header's pins, in order
    """

    emitters: tuple[OpticalNets, ...]
    receivers: tuple[OpticalNets, ...]
    groups: tuple[Group, ...]
    header: tuple[str, ...]


def board_gaps(circuit: Circuit, gain: SimulatedGain | None = None) -> list[str]:
    """Reasons why no board can be made for a circuit: chips whose package or pins are not known."""
    data = board_data()
    gaps = [
        f"{chips.entry.name}: its package and pins are not in board_packages.toml; name another "
        f"{chips.entry.noun}, as {next(iter(sorted(set(data['chips']) & set(_same_kind(circuit, chips)))), 'none')}"
        for chips in circuit.chips
        if chips.chip_id not in data["chips"]
    ]
    unread = {one.part_id: data["optical"].get(one.part_id, {}).get("unread") for one in circuit.cavity.parts}
    gaps += [
        f"{part_id}: {why}, which no circuit of optopad does; choose another part"
        for part_id, why in unread.items()
        if why
    ]
    amplifier = _amplifier_id(circuit, gain)
    if amplifier is not None and find_amplifier(circuit.entries, amplifier).channels != AMPLIFIERS_EACH:
        gaps.append(
            f"{amplifier}: only packages of {AMPLIFIERS_EACH} amplifiers have a footprint; name another one"
        )
    return gaps


def _same_kind(circuit: Circuit, chips: Chips) -> Mapping[str, object]:
    entries: Mapping[str, object] = getattr(circuit.entries, chips.entry.table)
    return entries


def _amplifier_id(circuit: Circuit, gain: SimulatedGain | None) -> str | None:
    feedbacks = feedbacks_for(circuit, gain)
    return circuit.use.amplifier if feedbacks is None else feedbacks[0].amplifier_id


def volts(supply_v: float) -> str:
    """Name of a supply's net."""
    return f"+{supply_v:g}V"


def netlist_of(circuit: Circuit, gain: SimulatedGain | None = None) -> Netlist:
    """The parts and nets of a design's circuit.

    Raises
    ------
    DesignError : a chip's package or pins are not known, or the board lacks a required pin.
    """
    connections, gaps = connections_of(circuit), board_gaps(circuit, gain)
    if gaps:
        raise DesignError("no circuit board: " + "; ".join(gaps))
    supply, is_sunk = volts(circuit.board.emitter_v), circuit.led_driver is not None
    emitters = tuple(
        OpticalNets(
            reference=f"E{k}",
            anode=supply if is_sunk else f"E{k}-A",
            cathode=one.pin if is_sunk else f"E{k}-K",
        )
        for k, one in enumerate(connections.emitters, start=1)
    )
    receivers = tuple(
        OpticalNets(reference=f"R{k}", anode=GROUND, cathode=f"R{k}-K")
        for k in range(1, len(connections.receivers) + 1)
    )
    groups = (
        *_amplifiers(circuit, gain),
        *_chips(circuit),
        *(() if is_sunk else _switches(circuit, [one.pin for one in connections.emitters])),
    )
    nets = {net for group in groups for part in group.parts for net in part.nets.values()}
    nets |= {one.anode for one in emitters}
    return Netlist(emitters=emitters, receivers=receivers, groups=groups, header=tuple(_header(nets)))


def _header(nets: set[str]) -> Iterator[str]:
    """Pins to the microcontroller board: supplies, ground, then its pins by number."""
    yield from sorted((net for net in nets if net.startswith("+")), reverse=True)
    yield GROUND
    pins = [net for net in nets if not net.startswith("+") and net != GROUND and "-" not in net]
    yield from sorted(pins, key=lambda net: (net[0] != "D", len(net), net))
    yield GROUND


def resistor(
    reference: str, ohm: float | None, one: str, other: str, power_mw: float = 0.0, unknown: str = SET_BY_GAIN
) -> Component:
    """A resistor of the smallest size that bears a power; without a resistance, its value is `unknown`."""
    sizes = board_data()["resistors"]
    size = next((entry for entry in sizes if entry["most_mw"] >= power_mw), sizes[-1])
    number = "" if ohm is None else size["part_number"].format(ohm=ohm_code(ohm))
    return Component(
        reference=reference,
        value=unknown if ohm is None else ohm_text(ohm),
        package=size["package"],
        nets={"1": one, "2": other},
        part_number=number,
    )


def capacitor(reference: str, value: str, one: str, other: str) -> Component:
    """A ceramic capacitor."""
    number = board_data()["capacitors"].get(value, "")
    return Component(
        reference=reference, value=value, package="0603", nets={"1": one, "2": other}, part_number=number
    )


def _switches(circuit: Circuit, drives: Sequence[str]) -> Iterator[Group]:
    supply = volts(circuit.board.emitter_v)
    for k, (one, drive) in enumerate(zip(circuit.cavity.emitters, drives, strict=True), start=1):
        switch, transistor = emitter_switch(one.part, circuit.board), transistor_of(circuit, one.part)
        number = board_data()["transistors"].get(transistor.transistor_id, "")
        yield Group(
            kind="switch",
            of_emitters=True,
            parts=(
                Component(
                    reference=f"Q{k}",
                    value=number or transistor.entry.name,
                    package="SOT-23",
                    nets={"1": f"E{k}-B", "2": GROUND, "3": f"E{k}-K"},
                    part_number=number,
                ),
                resistor(f"RS{k}", switch.series_ohm, supply, f"E{k}-A", switch.series_mw, "none fits"),
                resistor(f"RB{k}", switch.base_ohm, f"E{k}-B", drive),
            ),
        )


def _amplifiers(circuit: Circuit, gain: SimulatedGain | None) -> Iterator[Group]:
    feedbacks, amplifier = feedbacks_for(circuit, gain), _amplifier_id(circuit, gain)
    title = f"four amplifiers, {SET_BY_GAIN}"
    value = title if amplifier is None else find_amplifier(circuit.entries, amplifier).name
    supply, outputs = volts(circuit.adc.supply_v), [one.pin for one in circuit.receivers]
    for first in range(0, len(outputs), AMPLIFIERS_EACH):
        name = f"A{first // AMPLIFIERS_EACH + 1}"
        nets, more = {"4": supply, "11": GROUND}, list[Component]()
        numbers = sorted(
            range(first, min(first + AMPLIFIERS_EACH, len(outputs))),
            key=lambda k: -circuit.cavity.receivers[k].position_mm[1],
        )
        for k, (out, inverting, other) in enumerate(QUAD_PINS):
            nets[str(other)] = GROUND
            if k >= len(numbers):  # a spare amplifier follows ground
                nets |= {str(out): f"{name}-spare{k + 1}", str(inverting): f"{name}-spare{k + 1}"}
                continue
            number = numbers[k] + 1
            output, inverted = outputs[number - 1], f"R{number}-K"
            nets |= {str(out): output, str(inverting): inverted}
            feedback = None if feedbacks is None else feedbacks[number - 1]
            farads = SET_BY_GAIN if feedback is None else f"{feedback.capacitor_pf:g} pF"
            ohm = None if feedback is None else feedback.standard_ohm
            more += [
                resistor(f"RF{number}", ohm, output, inverted),
                capacitor(f"CF{number}", farads, output, inverted),
            ]
        part = Component(
            reference=name,
            value=value,
            package="SOIC-14",
            nets=nets,
            part_number=board_data()["amplifiers"].get(amplifier or "", ""),
        )
        supply_capacitor = capacitor(f"CA{name[1:]}", "100 nF", supply, GROUND)
        yield Group(kind="amplifier", parts=(part, supply_capacitor, *more))


def _chips(circuit: Circuit) -> Iterator[Group]:
    pinouts = {one.name: one for one in pinouts_of(circuit)}
    joined = _joined(pinouts.values())
    for chips in reversed(circuit.chips):
        for name in chips.names:
            parts = tuple(_chip(circuit, chips, pinouts[name], joined))
            yield Group(kind="chip", parts=parts, of_emitters=chips in circuit.emitter_chips)


def _joined(pinouts: Iterable[Pinout]) -> Mapping[tuple[str, str], str]:
    """Nets of pins that are connected to pins of chips directly, such as the data of a chain, by chip and pin."""
    found: dict[tuple[str, str], str] = {}
    for one in pinouts:
        for pin, to in (*one.left, *one.right):
            chip, _, its = to.partition(" ")
            if its and not to.startswith("+"):
                ends = sorted([(one.name, pin), (chip, its)])
                found |= dict.fromkeys(ends, "-".join(ends[0]))
    return found


def _chip(
    circuit: Circuit, chips: Chips, pinout: Pinout, joined: Mapping[tuple[str, str], str]
) -> Iterator[Component]:
    entry, name, data = chips.entry, pinout.name, board_data()["chips"][chips.chip_id]
    terminal = f"{name}-{entry.terminal}"
    by_pin, nets = dict((*pinout.left, *pinout.right)), dict[str, str]()
    of_parts = next(pin for pin, net in (*entry.family.left, *entry.family.right) if net == "{part}")
    rows = {of_parts.format(k): k for k in range(entry.size)}
    for number, pin in enumerate(data["pins"], start=1):
        if not pin:
            continue
        to = by_pin[pin]
        if to == "open":
            continue
        if (name, pin) in joined:
            net = joined[name, pin]
        elif to == "ground":
            net = GROUND
        elif pin in rows:
            net = f"{terminal}{rows[pin]}"
        else:
            net = to.replace(" ", "") if to.startswith("+") else to
        nets[str(number)] = net
    if "below" in board_data()["rows"][data["package"]]:
        nets[str(len(data["pins"]) + 1)] = GROUND
    yield Component(
        reference=name, value=entry.name, package=data["package"], nets=nets, part_number=data["part_number"]
    )
    letter, place = name[0], name[1:]
    analog, level = volts(circuit.adc.supply_v), volts(circuit.board.pin_v)
    is_converter = isinstance(entry, Converter)
    yield capacitor(f"C{letter}{place}", "100 nF", analog if is_converter else level, GROUND)
    if isinstance(entry, Converter) and entry.has_own_logic:
        yield capacitor(f"CD{place}", "100 nF", level, GROUND)
    for _, mark, value, *_ in entry.family.components:
        yield capacitor(f"{mark}{place}", value, f"{name}-{mark}", GROUND)
    pins = [f"D{pin}" for pin in chips.pins]
    if isinstance(entry, LedDriver):
        sink = current_sink(circuit)
        yield resistor(f"RI{place}", None if sink is None else sink.reference_ohm, f"{name}-RI", GROUND)
        if place == "1":
            yield resistor("RP1", PULL_UP_OHM, level, by_pin["BLANK"])
    elif isinstance(entry, ShiftRegister) and place == "1":
        for k, pin in enumerate(pins, start=1):
            yield resistor(f"RD{k}", PULL_DOWN_OHM, pin, GROUND)
