r"""The schematic: an NPN switch for each emitter, an amplifier for each receiver, with values, pins and polarity.

      supply                      +----[RF]----+
        [RS]                      +----||------+  CF
        LED, anode up             |   |\       |
    pin -[RB]-|< NPN       PD ----+---|- >-----+-- analogue input
            ground      cathode up    |+/
                                     ground

With LED drivers, an emitter's anode is connected to the supply and its cathode to the driver's output, without other
components.

Chips between the board and the parts have their pins, each with its connection. Values are those of bom.csv; values
that are not known yet are marked.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from optopad.design.circuit.circuit import Chips, Circuit
from optopad.design.circuit.emitter_switch import (
    SupplyCurrent,
    current_sink,
    emitter_switch,
    supply_current,
    transistor_of,
)
from optopad.design.parts.assumptions import ohm_text
from optopad.design.parts.catalog import find_amplifier
from optopad.design.parts.circuits import Converter, LedDriver, Multiplexer, ShiftRegister
from optopad.design.spec import SensorDesign
from optopad.fabrication.connections import connections_of, pin_words
from optopad.fabrication.gain import SimulatedGain, feedbacks_for
from optopad.fabrication.sheets.template import filled

CELL_X, CELL_Y = 264.0, 210.0
PIN_ROOM = 36.0
"""Width added to a circuit's cell in the schematic, for long pin names such as multiplexer channels [drawing units]."""
MARGIN = 24.0
HEAD = 64.0
NOTE_LINE = 19.0
MOST_ACROSS = 4
BLOCK_LINE = 14.0
QUIET = "#595959"
UNKNOWN = "set by gain"


def schematic_svg(design: SensorDesign, gain: SimulatedGain | None = None) -> str:
    """The schematic as SVG text.

    Parameters
    ----------
    gain : simulated gain from light to counts; if None, values that depend on it are not given

    Raises
    ------
    DesignError : the catalogue does not have a part, or the board does not have a pin.
    """
    circuit = Circuit.of(design)
    connections, notes, blocks = connections_of(circuit), _notes(circuit, gain), _blocks(circuit)
    cell_x = CELL_X + (PIN_ROOM if blocks else 0.0)
    across = min(MOST_ACROSS, max(len(connections.emitters), len(connections.receivers)))
    top, cells = MARGIN + HEAD, []
    block_y = max((one["height"] for one in blocks), default=0.0)
    for row_y, kind in (
        (CELL_Y, _emitters(circuit)),
        (CELL_Y, _receivers(circuit, gain)),
        (block_y, blocks),
    ):
        places = ((MARGIN + k % across * cell_x, top + k // across * row_y) for k in range(len(kind)))
        cells.append([one | {"x": x, "y": y} for one, (x, y) in zip(kind, places, strict=True)])
        top += -(-len(kind) // across) * row_y
    values = {
        "design": design,
        "width": max(2 * MARGIN + across * cell_x, 3.3 * CELL_X),
        "height": top + len(notes) * NOTE_LINE + MARGIN,
        "margin": MARGIN,
        "quiet": QUIET,
        "supply": f"+{circuit.board.emitter_v:g} V",
        "sink": current_sink(circuit),
        "emitters": cells[0],
        "receivers": cells[1],
        "blocks": cells[2],
        "notes": notes,
        "notes_y": top,
    }
    return filled("optopad.fabrication.sheets", "schematic.svg.j2", values)


def _blocks(circuit: Circuit) -> list[dict[str, Any]]:
    """The chips, with the heights of their outlines and of their cells [drawing units]."""
    found = []
    for one in pinouts_of(circuit):
        body = BLOCK_LINE * max(len(one.left), len(one.right)) + 8.0
        height = body + BLOCK_LINE * len(one.below) + 58.0
        found.append(vars(one) | {"label": one.title, "body": body, "height": height})
    return found


def _emitters(circuit: Circuit) -> list[dict[str, Any]]:
    found = []
    for one in connections_of(circuit).emitters:
        switch = emitter_switch(one.part.part, circuit.board)
        found.append(
            {
                "name": one.part.name,
                "label": one.polarity,
                "pin": one.pin,
                "series": "none fits" if switch.series_ohm is None else ohm_text(switch.series_ohm),
                "base": ohm_text(switch.base_ohm),
                "transistor": transistor_of(circuit, one.part.part).entry.name,
            }
        )
    return found


def _receivers(circuit: Circuit, gain: SimulatedGain | None) -> list[dict[str, Any]]:
    read, feedbacks = connections_of(circuit).receivers, feedbacks_for(circuit, gain)
    cells = [{"name": one.part.name, "label": one.polarity, "pin": one.pin} for one in read]
    if feedbacks is None:
        return [one | {"ohms": UNKNOWN, "farads": UNKNOWN, "amplifier": ""} for one in cells]
    return [
        cell
        | {
            "ohms": ohm_text(one.standard_ohm),
            "farads": f"{one.capacitor_pf:g} pF",
            "amplifier": find_amplifier(circuit.entries, one.amplifier_id).name,
        }
        for cell, one in zip(cells, feedbacks, strict=True)
    ]


def supply_words(circuit: Circuit) -> str:
    """The supply voltages as text, such as "5 V"."""
    emitters, amplifiers = f"{circuit.board.emitter_v:g} V", f"{circuit.adc.supply_v:g} V"
    if emitters == amplifiers:
        return emitters
    return f"{emitters} for the emitters, {amplifiers} for the amplifiers"


def current_of(circuit: Circuit, gain: SimulatedGain | None) -> SupplyCurrent:
    """The currents that the supply gives, with the amplifier that the gain chooses."""
    feedbacks = feedbacks_for(circuit, gain)
    return supply_current(circuit, None if feedbacks is None else feedbacks[0].amplifier_id)


def amplifiers_ma(current: SupplyCurrent) -> str:
    """The current of all amplifiers as text [mA]."""
    return f"{current.amplifiers_ma:.0f}" if current.amplifiers_ma >= 10.0 else f"{current.amplifiers_ma:.2g}"


def _notes(circuit: Circuit, gain: SimulatedGain | None) -> Sequence[str]:
    current, board = current_of(circuit, gain), circuit.board
    assumed = "" if current.is_amplifier_known else " (assumed)"
    lit = "emitter and base" if circuit.led_driver is None else "the emitter"
    more = f", {current.circuits_ma:.0f} for converters and LED drivers" if current.circuits_ma else ""
    return (
        f"Supply {supply_words(circuit)}, ground common with the {board.title}. One emitter is lit at a time.",
        f"At full power {current.full_power_ma:.0f} mA: "
        f"{current.emitter_ma:.0f} mA for {lit}, {amplifiers_ma(current)} for the amplifiers{assumed}, "
        f"{current.board_ma:.0f} for the board (assumed){more};",
        f"{current.fault_ma:.0f} mA if a fault lit all emitters.",
        f"{pin_words(circuit)}.",
        "Amplifiers: single supply, inputs and outputs down to ground; 100 nF at each package, supply to ground.",
        "Which lead is anode or cathode: the part's data sheet.",
    )


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
