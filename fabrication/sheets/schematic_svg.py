r"""The schematic: an NPN switch for each emitter, an amplifier for each receiver, with values, pins and polarity.

      supply                      +----[RF]----+
        [RS]                      +----||------+  CF
        LED, anode up             |   |\       |
    pin -[RB]-|< NPN       PD ----+---|- >-----+-- analogue input
            ground      cathode up    |+/
                                     ground

With LED drivers, an emitter's anode is connected to the supply and its cathode to the driver's output, without other
components.

Values are those of bom.csv; values that are not known yet are marked.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from optopad.design.circuit.emitter_switch import (
    SupplyCurrent,
    current_sink,
    emitter_switch,
    supply_current,
    transistor_of,
)
from optopad.design.circuit.pins import (
    address_pins,
    amplifier_v,
    board_of,
    converter_of,
    driver_of,
    multiplexer_of,
    receiver_paths,
    select_pins,
    shift_register_of,
    spi_pins,
    switch_pins,
)
from optopad.design.parts.assumptions import ohm_text
from optopad.design.parts.catalog import find_amplifier
from optopad.design.spec import SensorDesign
from optopad.design.spec.properties import entries_of
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
    connections, notes = connections_of(design), _notes(design, gain)
    blocks = [
        *_shift_registers(design),
        *_led_drivers(design),
        *_multiplexers(design),
        *_converters(design),
    ]
    cell_x = CELL_X + (PIN_ROOM if blocks else 0.0)
    across = min(MOST_ACROSS, max(len(connections.emitters), len(connections.receivers)))
    top, cells = MARGIN + HEAD, []
    block_y = max((block.height for block in blocks), default=0.0)
    for row_y, kind in (
        (CELL_Y, _emitters(design)),
        (CELL_Y, _receivers(design, gain)),
        (block_y, [vars(block) | {"body": block.body, "label": block.title} for block in blocks]),
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
        "supply": f"+{board_of(design).emitter_v:g} V",
        "sink": current_sink(design),
        "emitters": cells[0],
        "receivers": cells[1],
        "blocks": cells[2],
        "notes": notes,
        "notes_y": top,
    }
    return filled("optopad.fabrication.sheets", "schematic.svg.j2", values)


def _emitters(design: SensorDesign) -> list[dict[str, Any]]:
    board, found = board_of(design), []
    for one in connections_of(design).emitters:
        switch = emitter_switch(one.part.part, board)
        found.append(
            {
                "name": one.part.name,
                "label": one.polarity,
                "pin": one.pin,
                "series": "none fits" if switch.series_ohm is None else ohm_text(switch.series_ohm),
                "base": ohm_text(switch.base_ohm),
                "transistor": transistor_of(design, one.part.part).entry.name,
            }
        )
    return found


def _receivers(design: SensorDesign, gain: SimulatedGain | None) -> list[dict[str, Any]]:
    read, feedbacks = connections_of(design).receivers, feedbacks_for(design, gain)
    cells = [{"name": one.part.name, "label": one.polarity, "pin": one.pin} for one in read]
    if feedbacks is None:
        return [one | {"ohms": UNKNOWN, "farads": UNKNOWN, "amplifier": ""} for one in cells]
    return [
        cell
        | {
            "ohms": ohm_text(one.standard_ohm),
            "farads": f"{one.capacitor_pf:g} pF",
            "amplifier": find_amplifier(entries_of(design), one.amplifier_id).name,
        }
        for cell, one in zip(cells, feedbacks, strict=True)
    ]


def supply_words(design: SensorDesign) -> str:
    """The supply voltages as text, such as "5 V"."""
    emitters, amplifiers = f"{board_of(design).emitter_v:g} V", f"{amplifier_v(design):g} V"
    if emitters == amplifiers:
        return emitters
    return f"{emitters} for the emitters, {amplifiers} for the amplifiers"


@dataclass(frozen=True, kw_only=True)
class _Block:
    """One integrated circuit in the schematic: its pins, their connections, and notes on additional components.

    Attributes
    ----------
    left, right : for each pin on this side of the circuit, its name and the name of its connection
    below : lines of text below the circuit
    """

    name: str
    title: str
    left: Sequence[tuple[str, str]]
    right: Sequence[tuple[str, str]]
    below: Sequence[str] = ()

    @property
    def body(self) -> float:
        """Height of the circuit's outline [drawing units]."""
        return BLOCK_LINE * max(len(self.left), len(self.right)) + 8.0

    @property
    def height(self) -> float:
        """Height of the circuit's cell [drawing units]."""
        return self.body + BLOCK_LINE * len(self.below) + 58.0


_BUS = {"mcp3208": ("CLK", "DIN", "DOUT", "CS"), "ads8688": ("SCLK", "SDI", "SDO", "CS")}
"""Names of the pins for clock, data in, data out and chip select, for each type of converter."""
_INPUTS = {"mcp3208": "CH{}", "ads8688": "AIN_{}P"}
_SUPPLIES = {
    "mcp3208": (("VDD", "analog"), ("VREF", "analog"), ("AGND", "ground"), ("DGND", "ground")),
    "ads8688": (
        ("AVDD", "analog"),
        ("DVDD", "level"),
        ("DAISY", "ground"),
        ("ALARM", "open"),
        ("RST/PD", "level"),
        ("REFSEL", "ground"),
        ("REFIO", "CR"),
        ("REFCAP", "CB"),
        ("AUX_IN", "ground"),
        ("AUX_GND", "ground"),
        ("AIN_nGND", "ground"),
        ("REFGND", "ground"),
        ("AGND", "ground"),
        ("DGND", "ground"),
    ),
}
"""Other pins of each type of converter, with the net or component to which each pin is connected."""


def _multiplexers(design: SensorDesign) -> list[_Block]:
    entry = multiplexer_of(design)
    if entry is None:
        return []
    paths, read, supply = receiver_paths(design), connections_of(design).receivers, _pin_supply(design)
    blocks = []
    for number in range(entry.needed(len(read))):
        mine = [(one, path) for one, path in zip(read, paths, strict=True) if path.multiplexer == number]
        outputs = {path.address: f"{one.part.name}-A" for one, path in mine}
        board = [
            ("SIG", mine[0][1].channel),
            *((f"S{k}", f"D{pin}") for k, pin in enumerate(address_pins(design))),
        ]
        enable = "ground" if entry.enable == "ground" else supply
        blocks.append(
            _Block(
                name=f"M{number + 1}",
                title=entry.name,
                left=[(f"C{k}", outputs.get(k, "ground")) for k in range(entry.channels)],
                right=[*board, ("VCC", supply), ("GND", "ground"), ("EN", enable)],
            )
        )
    return blocks


def _shift_registers(design: SensorDesign) -> list[_Block]:
    entry, lit = shift_register_of(design), connections_of(design).emitters
    if entry is None:
        return []
    data, clock, latch = (f"D{pin}" for pin in switch_pins(design, board_of(design), len(lit)))
    names = {one.pin_number: f"{one.part.name}-RB" for one in lit}
    count, supply = entry.needed(len(lit)), _pin_supply(design)
    return [
        _Block(
            name=f"S{number + 1}",
            title=entry.name,
            left=[
                ("DS", data if number == 0 else f"S{number} QS"),
                ("SHCP", clock),
                ("STCP", latch),
                ("VCC", supply),
                ("GND", "ground"),
                ("OE", "ground"),
                ("MR", supply),
            ],
            right=[
                *((f"Q{k}", names.get(number * entry.outputs + k, "open")) for k in range(entry.outputs)),
                ("QS", f"S{number + 2} DS" if number + 1 < count else "open"),
            ],
        )
        for number in range(count)
    ]


def _converters(design: SensorDesign) -> list[_Block]:
    entry, board = converter_of(design), board_of(design)
    if entry is None:
        return []
    paths, read, selects = receiver_paths(design), connections_of(design).receivers, select_pins(design)
    clock, out, into = (f"D{pin}" for pin in spi_pins(design, board))
    bus, inputs = _BUS[entry.commands], _INPUTS[entry.commands]
    nets = {"analog": f"+{entry.analog_v(board):g} V", "level": _pin_supply(design)}
    caps = [(pin, net) for pin, net in _SUPPLIES[entry.commands] if net in ("CR", "CB")]
    blocks = []
    for number, select in enumerate(selects):
        mine = {
            path.address: f"{one.part.name}-A"
            for one, path in zip(read, paths, strict=True)
            if path.converter == number
        }
        nets |= {mark: f"U{number + 1}-{mark}" for _, mark in caps}
        lines = zip(bus, (clock, out, into, f"D{select}"), strict=True)
        blocks.append(
            _Block(
                name=f"U{number + 1}",
                title=entry.name,
                left=[(inputs.format(k), mine.get(k, "ground")) for k in range(entry.channels)],
                right=[*lines, *((pin, nets.get(net, net)) for pin, net in _SUPPLIES[entry.commands])],
                below=[f"{nets[mark]}: 10 uF from {pin} to ground" for pin, mark in caps],
            )
        )
    return blocks


def _led_drivers(design: SensorDesign) -> list[_Block]:
    entry, sink, lit = driver_of(design), current_sink(design), connections_of(design).emitters
    if entry is None or sink is None:
        return []
    board, supply = board_of(design), _pin_supply(design)
    clock, out, _ = (f"D{pin}" for pin in spi_pins(design, board))
    latch, blank = (f"D{pin}" for pin in switch_pins(design, board, len(lit)))
    names = {one.pin_number: one.part.name for one in lit}
    count = entry.needed(len(lit))
    return [
        _Block(
            name=f"L{number + 1}",
            title=entry.name,
            left=[
                ("SIN", out if number == 0 else f"L{number} SOUT"),
                ("SCLK", clock),
                ("XLAT", latch),
                ("BLANK", blank),
                ("VCC", supply),
                ("GND", "ground"),
                ("IREF", f"L{number + 1}-RI"),
            ],
            below=[
                f"L{number + 1}-RI: {ohm_text(sink.reference_ohm)} from IREF to ground",
                *([f"L1-RP: 10 kohm from BLANK to {supply}"] if number == 0 else []),
            ],
            right=[
                *((f"OUT{k}", names.get(number * entry.outputs + k, "open")) for k in range(entry.outputs)),
                ("SOUT", f"L{number + 2} SIN" if number + 1 < count else "open"),
            ],
        )
        for number in range(count)
    ]


def _pin_supply(design: SensorDesign) -> str:
    return f"+{board_of(design).pin_v:g} V"


def current_of(design: SensorDesign, gain: SimulatedGain | None) -> SupplyCurrent:
    """The currents that the supply gives, with the amplifier that the gain chooses."""
    feedbacks = feedbacks_for(design, gain)
    return supply_current(design, None if feedbacks is None else feedbacks[0].amplifier_id)


def amplifiers_ma(current: SupplyCurrent) -> str:
    """The current of all amplifiers as text [mA]."""
    return f"{current.amplifiers_ma:.0f}" if current.amplifiers_ma >= 10.0 else f"{current.amplifiers_ma:.2g}"


def _notes(design: SensorDesign, gain: SimulatedGain | None) -> Sequence[str]:
    current, board = current_of(design, gain), board_of(design)
    assumed = "" if current.is_amplifier_known else " (assumed)"
    lit = "emitter and base" if driver_of(design) is None else "the emitter"
    more = f", {current.circuits_ma:.0f} for converters and LED drivers" if current.circuits_ma else ""
    return (
        f"Supply {supply_words(design)}, ground common with the {board.title}. One emitter is lit at a time.",
        f"At full power {current.full_power_ma:.0f} mA: "
        f"{current.emitter_ma:.0f} mA for {lit}, {amplifiers_ma(current)} for the amplifiers{assumed}, "
        f"{current.board_ma:.0f} for the board (assumed){more};",
        f"{current.fault_ma:.0f} mA if a fault lit all emitters.",
        f"{pin_words(design)}.",
        "Amplifiers: single supply, inputs and outputs down to ground; 100 nF at each package, supply to ground.",
        "Which lead is anode or cathode: the part's data sheet.",
    )
