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

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from optopad.design.circuit.emitter_switch import (
    CurrentSink,
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
from optopad.design.circuit.transimpedance import Feedback
from optopad.design.parts.assumptions import ohm_text
from optopad.design.parts.catalog import Board, find_amplifier
from optopad.design.spec import SensorDesign
from optopad.design.spec.properties import entries_of
from optopad.fabrication.connections import Connection, connections_of, pin_words
from optopad.fabrication.gain import SimulatedGain, feedbacks_for
from optopad.fabrication.sheets import svg
from optopad.fabrication.sheets.svg import Element, Point

CELL_X, CELL_Y = 264.0, 210.0
PIN_ROOM = 36.0
"""Width added to a circuit's cell in the schematic, for long pin names such as multiplexer channels [drawing units]."""
MARGIN = 24.0
HEADING_PX, TEXT_PX, VALUE_PX = 20.0, 14.0, 12.0
HEAD = 64.0
NOTE_LINE = 19.0
MOST_ACROSS = 4
BLOCK_X, BLOCK_LINE = 96.0, 14.0
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
    connections, feedbacks = connections_of(design), feedbacks_for(design, gain)
    notes, sink = _notes(design, gain), current_sink(design)
    blocks = [
        *_shift_registers(design),
        *_led_drivers(design),
        *_multiplexers(design),
        *_converters(design),
    ]
    cell_x = CELL_X + (PIN_ROOM if blocks else 0.0)
    across = min(MOST_ACROSS, max(len(connections.emitters), len(connections.receivers)))
    rows_lit = -(-len(connections.emitters) // across)
    rows_read = -(-len(connections.receivers) // across)
    width = max(2 * MARGIN + across * cell_x, 3.3 * CELL_X)
    rows_led = -(-len(blocks) // across)
    block_y = max((block.height for block in blocks), default=0.0)
    notes_top = MARGIN + HEAD + (rows_lit + rows_read) * CELL_Y + rows_led * block_y
    root = svg.drawing(
        width,
        notes_top + len(notes) * NOTE_LINE + MARGIN,
        f"Schematic of {design.name}",
        f"{len(connections.emitters)} switched emitters and {len(connections.receivers)} receivers with amplifiers; "
        "values as in bom.csv",
    )
    subtitle = f"schematic; design digest {design.digest[:8]}; values as in bom.csv, pins as in wiring.csv"
    root.append(svg.text((MARGIN, MARGIN + HEADING_PX), design.name, HEADING_PX, font_weight="bold"))
    root.append(svg.text((MARGIN, MARGIN + HEADING_PX + NOTE_LINE), subtitle, TEXT_PX, fill=QUIET))
    for place, one in enumerate(connections.emitters):
        corner = _corner(place, across, cell_x, MARGIN + HEAD)
        board, transistor = board_of(design), transistor_of(design, one.part.part).entry.name
        root.append(
            _switch(one, board, transistor, corner) if sink is None else _sunk(one, board, sink, corner)
        )
    top = MARGIN + HEAD + rows_lit * CELL_Y
    for place, one in enumerate(connections.receivers):
        feedback = None if feedbacks is None else feedbacks[place]
        amplifier = "" if feedback is None else find_amplifier(entries_of(design), feedback.amplifier_id).name
        root.append(_amplifier(one, feedback, amplifier, _corner(place, across, cell_x, top)))
    top += rows_read * CELL_Y
    for place, block in enumerate(blocks):
        corner = MARGIN + (place % across) * cell_x, top + (place // across) * block_y
        root.append(block.drawn(corner))
    for place, line in enumerate(notes):
        root.append(svg.text((MARGIN, notes_top + (place + 1) * NOTE_LINE), line, TEXT_PX))
    return svg.to_text(root)


def _corner(place: int, across: int, cell_x: float, top: float) -> Point:
    return MARGIN + (place % across) * cell_x, top + (place // across) * CELL_Y


def _switch(one: Connection, board: Board, transistor: str, corner: Point) -> Element:
    x, y = corner[0] + 150, corner[1]
    switch = emitter_switch(one.part.part, board)
    series = "none fits" if switch.series_ohm is None else ohm_text(switch.series_ohm)
    name = one.part.name
    cell = svg.group(f"{name}: {one.polarity}")
    cell.append(svg.text((x - 8, y + 16), f"+{board.emitter_v:g} V", VALUE_PX, anchor="end"))
    cell.extend([svg.wire((x - 9, y + 10), (x + 9, y + 10)), svg.wire((x, y + 10), (x, y + 26))])
    cell.append(svg.resistor((x, y + 43), upright=True))
    cell.extend(_labels((x + 11, y + 40), f"{name}-RS", series))
    cell.append(svg.wire((x, y + 60), (x, y + 82)))
    cell.extend(svg.diode((x, y + 90), emits=True))
    cell.append(svg.text((x - 14, y + 86), name, TEXT_PX, anchor="end", font_weight="bold"))
    cell.append(svg.text((x - 14, y + 101), "anode up", VALUE_PX, anchor="end", fill=QUIET))
    cell.append(svg.wire((x, y + 98), (x, y + 116)))
    cell.extend(svg.npn((x - 24, y + 138)))
    cell.extend(_labels((x + 8, y + 136), f"{name}-Q", transistor))
    cell.append(svg.wire((x, y + 160), (x, y + 168)))
    cell.extend(svg.ground((x, y + 168)))
    cell.append(svg.wire((x - 90, y + 138), (x - 76, y + 138)))
    cell.append(svg.resistor((x - 59, y + 138), upright=False))
    cell.append(svg.wire((x - 42, y + 138), (x - 24, y + 138)))
    cell.append(svg.terminal((x - 94, y + 138)))
    cell.append(svg.text((x - 104, y + 142), one.pin, TEXT_PX, anchor="end", font_weight="bold"))
    cell.extend(_labels((x - 78, y + 158), f"{name}-RB", ohm_text(switch.base_ohm)))
    return cell


def _sunk(one: Connection, board: Board, sink: CurrentSink, corner: Point) -> Element:
    """Drawing of one emitter connected to an LED driver's output, with its upper left corner at `corner`."""
    x, y = corner[0] + 150, corner[1]
    name = one.part.name
    cell = svg.group(f"{name}: {one.polarity}")
    cell.append(svg.text((x - 8, y + 46), f"+{board.emitter_v:g} V", VALUE_PX, anchor="end"))
    cell.extend([svg.wire((x - 9, y + 40), (x + 9, y + 40)), svg.wire((x, y + 40), (x, y + 82))])
    cell.extend(svg.diode((x, y + 90), emits=True))
    cell.append(svg.text((x - 14, y + 86), name, TEXT_PX, anchor="end", font_weight="bold"))
    cell.append(svg.text((x - 14, y + 101), "anode up", VALUE_PX, anchor="end", fill=QUIET))
    cell.append(svg.wire((x, y + 98), (x, y + 134)))
    cell.append(svg.terminal((x, y + 138)))
    cell.append(svg.text((x - 10, y + 142), one.pin, TEXT_PX, anchor="end", font_weight="bold"))
    cell.append(svg.text((x + 10, y + 142), f"{sink.current_ma:.1f} mA", VALUE_PX, fill=QUIET))
    return cell


def _amplifier(one: Connection, feedback: Feedback | None, amplifier: str, corner: Point) -> Element:
    x, y, name = corner[0] + 60, corner[1], one.part.name
    ohms = UNKNOWN if feedback is None else ohm_text(feedback.standard_ohm)
    farads = UNKNOWN if feedback is None else f"{feedback.capacitor_pf:g} pF"
    cell = svg.group(f"{name}: {one.polarity}")
    tip, node = (x + 140, y + 128), (x + 66, y + 116)
    cell.extend(svg.amplifier(tip))
    cell.append(svg.text((tip[0] - 30, tip[1] + 38), f"{name}-A", VALUE_PX))
    if amplifier:
        cell.append(svg.text((tip[0] - 30, tip[1] + 51), amplifier, VALUE_PX, fill=QUIET))
    cell.extend([svg.wire((x, node[1]), (tip[0] - 46, node[1])), svg.dot(node)])
    cell.append(svg.wire((x, node[1]), (x, y + 136)))
    cell.extend(svg.diode((x, y + 144), emits=False))
    cell.append(svg.text((x - 14, y + 132), name, TEXT_PX, anchor="end", font_weight="bold"))
    cell.append(svg.text((x - 14, y + 158), "cathode", VALUE_PX, anchor="end", fill=QUIET))
    cell.append(svg.text((x - 14, y + 171), "up", VALUE_PX, anchor="end", fill=QUIET))
    cell.append(svg.wire((x, y + 152), (x, y + 168)))
    cell.extend(svg.ground((x, y + 168)))
    plus = (tip[0] - 46, tip[1] + 12)
    cell.extend([svg.wire(plus, (node[0], plus[1]), (node[0], y + 168)), *svg.ground((node[0], y + 168))])
    right, middle = x + 156, (node[0] + x + 156) / 2
    for level in (52.0, 88.0):
        cell.append(svg.wire((node[0], y + level), (middle - (17 if level < 60 else 3), y + level)))
        cell.append(svg.wire((middle + (17 if level < 60 else 3), y + level), (right, y + level)))
    cell.append(svg.resistor((middle, y + 52), upright=False))
    cell.extend(svg.capacitor((middle, y + 88)))
    cell.append(svg.wire(node, (node[0], y + 52)))
    cell.append(svg.wire((right, y + 52), (right, tip[1])))
    cell.extend([svg.dot((node[0], y + 88)), svg.dot((right, y + 88)), svg.dot((right, tip[1]))])
    cell.append(svg.text((middle, y + 40), f"{name}-RF {ohms}", VALUE_PX, anchor="middle"))
    cell.append(svg.text((middle, y + 75), f"{name}-CF {farads}", VALUE_PX, anchor="middle"))
    cell.append(svg.wire(tip, (x + 170, tip[1])))
    cell.append(svg.terminal((x + 174, tip[1])))
    cell.append(svg.text((x + 181, tip[1] + 5), one.pin, TEXT_PX, font_weight="bold"))
    return cell


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
    def height(self) -> float:
        """Height of the circuit's cell [drawing units]."""
        return 26 + BLOCK_LINE * (max(len(self.left), len(self.right)) + len(self.below)) + 40

    def drawn(self, corner: Point) -> Element:
        """Drawing of the circuit in a cell whose upper left corner is at `corner`."""
        x, y = corner[0] + 84, corner[1] + 26
        bottom = y + BLOCK_LINE * max(len(self.left), len(self.right)) + 8
        cell = svg.group(f"{self.name}: {self.title}")
        cell.append(svg.text((x, y - 8), f"{self.name} {self.title}", TEXT_PX, font_weight="bold"))
        cell.append(svg.rectangle((x, y), (x + BLOCK_X, bottom), fill="none", stroke="#000000"))
        for k, (inner, outer) in enumerate(self.left):
            level = y + 14 + k * BLOCK_LINE
            cell.append(svg.wire((x - 14, level - 4), (x, level - 4)))
            cell.append(svg.text((x + 4, level), inner, VALUE_PX))
            cell.append(svg.text((x - 18, level), outer, VALUE_PX, anchor="end"))
        for k, (inner, outer) in enumerate(self.right):
            level = y + 14 + k * BLOCK_LINE
            cell.append(svg.wire((x + BLOCK_X, level - 4), (x + BLOCK_X + 14, level - 4)))
            cell.append(svg.text((x + BLOCK_X - 4, level), inner, VALUE_PX, anchor="end"))
            cell.append(svg.text((x + BLOCK_X + 18, level), outer, VALUE_PX, font_weight="bold"))
        for k, line in enumerate(self.below):
            cell.append(svg.text((x, bottom + 14 + k * BLOCK_LINE), line, VALUE_PX))
        return cell


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


def _labels(at: Point, name: str, value: str) -> Iterator[Element]:
    yield svg.text(at, name, VALUE_PX)
    yield svg.text((at[0], at[1] + 14), value, VALUE_PX, fill=QUIET)


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
