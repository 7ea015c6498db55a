"""Pins of the chips between the board and the parts, each with its connection, as the schematic draws them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from optopad.design.circuit.circuit import Chips, Circuit
from optopad.design.circuit.emitter_switch import current_sink
from optopad.design.parts.assumptions import ohm_text
from optopad.design.parts.circuits import Converter, LedDriver, Multiplexer, ShiftRegister

PARTS = {"S": "{}-RB", "L": "{}", "M": "{}-A", "U": "{}-A"}
"""Component of an emitter or receiver at a terminal, by the letter of the chips."""
UNUSED = {"Q": "open", "C": "ground"}
"""Connection of a terminal without a part, by the first letter of its name."""


@dataclass(frozen=True, kw_only=True)
class Pinout:
    """One chip of a circuit.

    Attributes
    ----------
    name, title : reference designator and name of the chip
    left, right : for each pin on this side of the chip, its name and the name of its connection
    below : notes on additional components
    """

    name: str
    title: str
    left: Sequence[tuple[str, str]]
    right: Sequence[tuple[str, str]]
    below: Sequence[str]


def pinouts_of(circuit: Circuit) -> tuple[Pinout, ...]:
    """The chips of a circuit: those of the emitters, then those of the receivers."""
    return tuple(_pinout(circuit, chips, number) for chips in circuit.chips for number in range(chips.count))


def _pinout(circuit: Circuit, chips: Chips, number: int) -> Pinout:
    entry, name = chips.entry, chips.names[number]
    family, nets = entry.family, _nets(circuit, chips, number)
    below = [*family.below, *(family.first_below if number == 0 else ())]
    return Pinout(
        name=name,
        title=entry.name,
        left=list(_rows(family.left, nets)),
        right=list(_rows(family.right, nets)),
        below=[
            *(line.format_map(nets) for line in below),
            *(f"{name}-{mark}: {words}" for _, mark, *_, words in family.components),
        ],
    )


def _rows(pins: Sequence[tuple[str, str]], nets: Mapping[str, str | list[str]]) -> Iterator[tuple[str, str]]:
    for pin, net in pins:
        row = nets[net.strip("{}")] if "{}" in pin else net.format_map(nets)
        yield from (
            [(pin, row)] if isinstance(row, str) else ((pin.format(k), one) for k, one in enumerate(row))
        )


def _nets(circuit: Circuit, chips: Chips, number: int) -> dict[str, str | list[str]]:
    entry, names = chips.entry, chips.names
    nets: dict[str, str | list[str]] = {
        "name": names[number],
        "level": f"+{circuit.board.pin_v:g} V",
        "analog": f"+{circuit.adc.supply_v:g} V",
        "part": _parts(circuit, chips, number),
    }
    pins, bus = ([f"D{pin}" for pin in each] for each in (chips.pins, circuit.spi_pins))
    match entry:
        case ShiftRegister():
            nets |= zip(("data", "clock", "latch"), pins, strict=True)
        case LedDriver():
            nets |= zip(("latch", "blank"), pins, strict=True)
            nets |= zip(("clock", "data"), bus[:2], strict=True)
            sink = current_sink(circuit)
            nets["reference"] = "" if sink is None else ohm_text(sink.reference_ohm)
        case Multiplexer():
            nets |= {"address": pins, "input": circuit.channels[number]}
            nets["enable"] = "ground" if entry.enable == "ground" else nets["level"]
        case Converter():
            nets |= zip(("clock", "data", "answer"), bus, strict=True)
            nets["select"] = pins[number]
    before, after = entry.family.chain
    nets["chain_in"] = f"{names[number - 1]} {after}" if number else nets.get("data", "")
    nets["chain_out"] = f"{names[number + 1]} {before}" if number + 1 < chips.count else "open"
    return nets


def _parts(circuit: Circuit, chips: Chips, number: int) -> list[str]:
    """The component at each terminal of a chip."""
    is_lit, letter = chips in circuit.emitter_chips, chips.entry.letter
    parts, paths = (
        (circuit.cavity.emitters, circuit.emitters)
        if is_lit
        else (circuit.cavity.receivers, circuit.receivers)
    )
    found = {
        path.terminal: PARTS[letter].format(part.name)
        for part, path in zip(parts, paths, strict=True)
        if path.chip == number
    }
    return [found.get(k, UNUSED[chips.entry.terminal]) for k in range(chips.entry.size)]
