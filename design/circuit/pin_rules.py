"""Rules for the pins and inputs of a circuit: each on the board, given once, and enough of them; and faster boards.

If the design lists pins or inputs, the list has exactly one entry per part.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TypeVar

from optopad.design.circuit.circuit import Chips, Circuit
from optopad.design.fields.finding import Finding, error
from optopad.design.parts.circuits import Multiplexer

Name = TypeVar("Name", int, str)
REGISTER_PINS = 3
"""Pins of a chain of shift registers, which need fewest of the emitters' circuits on a board without a bus."""


def pin_findings(circuit: Circuit) -> Iterator[Finding]:
    """All findings about the pins and channels of a circuit."""
    yield from _bus_findings(circuit)
    for chips in circuit.emitter_chips:
        yield from _emitter_chip_findings(circuit, chips)
    if not circuit.emitter_chips:
        yield from _emitter_pin_findings(circuit)
    use, board = circuit.use, circuit.board
    if circuit.adc.separate is None:
        yield from _list_findings(
            "board.receiver_channels",
            circuit.receiver_chips[0].entry.noun if circuit.receiver_chips else "receiver",
            "analogue input",
            use.receiver_channels,
            board.analog_channels,
            circuit.input_count,
            _input_ways(circuit),
        )
    for chips in circuit.receiver_chips:
        yield from _receiver_chip_findings(circuit, chips)
    if circuit.adc.separate is None:
        yield from _unknown_findings(
            "board.receiver_channels", "analogue input", use.receiver_channels or (), board.analog_channels
        )


def _bus_findings(circuit: Circuit) -> Iterator[Finding]:
    able = [name for name, one in circuit.entries.boards.items() if one.spi_pins]
    for chips in reversed(circuit.chips):
        if chips.entry.uses_bus and not circuit.board.spi_pins:
            yield error(
                chips.entry.field,
                f"no program of the {circuit.board.title} drives its SPI bus",
                value=circuit.use.kind,
                limit=f"a board with arduino.spi_pins: {', '.join(able) or 'none is in the catalogue'}",
                way_out="name one of these in board.kind, or give arduino.spi_pins in the entry of your board",
            )


def _supply_findings(circuit: Circuit, chips: Chips) -> Iterator[Finding]:
    if not chips.entry.works_on(circuit.board):
        meaning, value, limit, way_out = chips.entry.supply_fault(circuit.board)
        yield error(chips.entry.field, meaning, value=value, limit=limit, way_out=way_out)


def _emitter_pin_findings(circuit: Circuit) -> Iterator[Finding]:
    board, known, pins = circuit.board, circuit.open_pins, circuit.use.emitter_pins
    yield from _list_findings(
        "board.emitter_pins", "emitter", "pin", pins, known, circuit.emitter_count, _emitter_ways(circuit)
    )
    serial = set(board.uart_pins or ())
    taken = serial | {*board.reserved_pins, *circuit.spi_pins}
    free = [pin for pin in pins or () if pin not in taken]
    yield from _unknown_findings("board.emitter_pins", "pin", free, known)
    for pin in dict.fromkeys(pins or ()):
        if pin in taken:
            yield error(
                "board.emitter_pins",
                f"pin {pin} {'carries the serial line to the host' if pin in serial else 'has another job'}",
                value=pin,
                limit=f"none of {', '.join(map(str, sorted(taken)))}",
                way_out="choose another pin, or leave the list out",
            )


def _emitter_chip_findings(circuit: Circuit, chips: Chips) -> Iterator[Finding]:
    entry, listed, known = chips.entry, circuit.use.emitter_pins, circuit.open_pins
    if listed is not None:
        yield error(
            "board.emitter_pins",
            f"the emitters are switched by {entry.noun}s, which take no pin for each of them",
            value=f"{len(listed)} entries",
            limit="none with board.emitters",
            way_out=f"leave the list out; {entry.pins_field} has {entry.controls}",
        )
    yield from _supply_findings(circuit, chips)
    pins, count = chips.pins, circuit.switch_count
    if len(pins) != count or len(set(pins)) < count or set(pins) - set(known):
        yield error(
            entry.pins_field,
            f"{entry.name} needs {count} pins of the board, each once: {entry.controls}",
            value=list(pins),
            limit=f"{count} of {', '.join(map(str, known))}",
            way_out="choose among these, or leave them out",
        )


def _receiver_chip_findings(circuit: Circuit, chips: Chips) -> Iterator[Finding]:
    entry, use = chips.entry, circuit.use
    yield from _supply_findings(circuit, chips)
    if not isinstance(entry, Multiplexer):
        unused = (
            (
                "board.receiver_channels",
                None if use.receiver_channels is None else list(use.receiver_channels),
            ),
            ("board.reference", None if use.reference == "supply" else use.reference),
        )
        for field, value in unused:
            if value is not None:
                yield error(
                    field,
                    f"{entry.name} reads the receivers, and the board's own converter is not used",
                    value=value,
                    limit="left out with board.receivers.converter",
                    way_out="remove it, or remove board.receivers.converter",
                )
    known, count = circuit.open_pins, entry.pin_count(circuit.receiver_count)
    pins, used = chips.given_pins, circuit.switch_pins
    if pins is None:
        if circuit.switch_count + count > len(known):
            yield error(
                entry.pins_field,
                f"the board has no pins left for the {entry.controls} of {entry.name}",
                value=f"{circuit.switch_count} pins for emitters and {count} for the {entry.controls}",
                limit=f"at most {len(known)} pins",
                way_out="use fewer emitters, or name another board.kind",
            )
        return
    wrong = [pin for pin in pins if pin not in known or pin in used or pins.count(pin) > 1]
    if len(pins) != count or wrong:
        yield error(
            entry.pins_field,
            f"{entry.name} needs {count} pins of the board that no emitter has, each once",
            value=list(pins),
            limit=f"{count} of {', '.join(str(pin) for pin in known if pin not in used)}",
            way_out="choose among these, or leave the list out",
        )


def _emitter_ways(circuit: Circuit) -> str | None:
    """Remedy for too few emitter pins: a shift register or an LED driver that fits the board; None if none does."""
    ways: list[str] = []
    board, emitters = circuit.board, circuit.emitter_count
    for name, one in circuit.entries.shift_registers.items():
        if one.works_on(board) and not ways:
            number = (
                f"{emitters} emitters need {one.needed(emitters)} of them and {one.pin_count(emitters)} pins"
            )
            ways.append(f'set {one.field} = "{name}": {number}')
    for name, driver in circuit.entries.led_drivers.items():
        if driver.works_on(board) and board.spi_pins and len(ways) < 2:
            number = f"{driver.needed(emitters)} of them, the SPI bus and {driver.pin_count(emitters)} pins"
            ways.append(f'set {driver.field} = "{name}", of constant current: {number}')
    return "; or ".join(ways) or None


def _input_ways(circuit: Circuit) -> str | None:
    """Remedy for too few inputs: a multiplexer or a converter that fits; None if there is none."""
    if circuit.use.receivers is not None:
        return None
    ways = (_multiplexer_way(circuit), _converter_way(circuit))
    return "; or ".join(way for way in ways if way) or None


def _spare_count(circuit: Circuit, pin_count: int) -> int:
    """Pins that the emitters leave; if the board has too few for them, those that shift registers would leave."""
    count = circuit.switch_count
    return pin_count - (count if count <= pin_count else REGISTER_PINS)


def _converter_way(circuit: Circuit) -> str | None:
    board = circuit.board
    spare = _spare_count(circuit, len(set(board.digital_pins) - set(board.spi_pins)))
    for name, one in circuit.entries.converters.items():
        count = one.needed(circuit.receiver_count)
        if board.spi_pins and one.works_on(board) and count <= spare:
            return (
                f'set {one.field} = "{name}", of {one.bits} bits: {count} of them, the SPI bus and '
                f"{count} select pin{'s' if count > 1 else ''}"
            )
    return None


def _multiplexer_way(circuit: Circuit) -> str | None:
    board, receivers = circuit.board, circuit.receiver_count
    spare = _spare_count(circuit, len(circuit.open_pins))
    known = circuit.entries.multiplexers
    for name, one in sorted(known.items(), key=lambda item: -item[1].channels):
        count = one.needed(receivers)
        if one.works_on(board) and one.address_bits <= spare and count <= len(board.analog_channels):
            inputs = " and ".join(board.analog_channels[:count])
            return (
                f'set {one.field} = "{name}": {receivers} receivers need {count} of them on '
                f"{inputs}, and {one.address_bits} pins for the address"
            )
    return None


def _list_findings(
    field: str,
    part: str,
    noun: str,
    given: Sequence[Name] | None,
    known: Sequence[Name],
    count: int,
    way_out: str | None = None,
) -> list[Finding]:
    if given is None:
        return _room_findings(field, part, noun, len(known), count, way_out)
    found = []
    if len(given) != count:
        found.append(
            error(
                field,
                f"the layout has {count} {part}s, the list is for {len(given)}",
                value=f"{len(given)} entries",
                limit=f"exactly {count}",
                way_out=f"give one {noun} for each {part}, or leave the list out",
            )
        )
    for name in sorted({name for name in given if list(given).count(name) > 1}):
        found.append(
            error(
                field,
                f"{noun} {name} is given to {list(given).count(name)} {part}s",
                value=name,
                limit=f"each {noun} once",
                way_out=f"give every {part} its own {noun}",
            )
        )
    return found


def _room_findings(
    field: str, part: str, noun: str, available: int, count: int, way_out: str | None
) -> list[Finding]:
    if count <= available:
        return []
    return [
        error(
            field,
            f"the layout has {count} {part}s, more than the board has {noun}s for",
            value=count,
            limit=f"at most {available}",
            way_out=way_out or f"use fewer {part}s, or name another board.kind",
        )
    ]


def _unknown_findings(field: str, noun: str, given: Sequence[Name], known: Sequence[Name]) -> list[Finding]:
    strange = [name for name in dict.fromkeys(given) if name not in known]
    return [
        error(
            field,
            f"{noun} {name} is not one that the board offers",
            value=name,
            limit=f"one of {', '.join(map(str, known))}",
            way_out="choose another, or leave the list out",
        )
        for name in strange
    ]


def faster_boards(circuit: Circuit) -> list[tuple[str, float]]:
    """Identifiers and frame rates [Hz] of faster boards in the catalogue that fit the design, the fastest first."""
    found = [(name, circuit.on(name)) for name in circuit.entries.boards]
    rates = [
        (name, one.frame_rate_hz)
        for name, one in found
        if one.frame_rate_hz > circuit.frame_rate_hz and _fits(one)
    ]
    return sorted(rates, key=lambda one: (-one[1], one[0]))


def _fits(circuit: Circuit) -> bool:
    if circuit.use.reference == "internal" and circuit.board.internal_reference_v is None:
        return False
    return not any(pin_findings(circuit))
