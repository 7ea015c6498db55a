r"""The schematic: an NPN switch for each emitter, an amplifier for each receiver, with values, pins and polarity.

      supply                      +----[RF]----+
        [RS]                      +----||------+  CF
        LED, anode up             |   |\       |
    pin -[RB]-|< NPN       PD ----+---|- >-----+-- analogue input
            ground      cathode up    |+/
                                     ground

With LED drivers, an emitter's anode is connected to the supply and its cathode to the driver's output, without other
components.

Values are those of bom.csv; values that are not known yet are marked. The module also writes the section of the casting
instructions on the emitters' resistors, currents and supply.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from optopad.design.circuit.circuit import Circuit
from optopad.design.circuit.emitter_switch import (
    CurrentSink,
    SupplyCurrent,
    current_sink,
    emitter_switch,
    most_drive_ma,
    supply_current,
    transistor_of,
)
from optopad.design.circuit.transimpedance import Feedback
from optopad.design.parts.assumptions import ohm_text
from optopad.design.parts.catalog import Board, find_amplifier
from optopad.design.spec import SensorDesign
from optopad.fabrication.connections import Connection, connections_of, pin_words
from optopad.fabrication.gain import SimulatedGain, feedbacks_for
from optopad.fabrication.pinouts import Pinout, pinouts_of
from optopad.fabrication.sheets import svg
from optopad.fabrication.sheets.svg import Element, Point


def circuit_lines(design: SensorDesign, gain: SimulatedGain | None = None) -> Iterator[str]:
    """Lines of the section on the emitters' switches and supply in the casting instructions, as Markdown."""
    circuit = Circuit.of(design)
    kinds = {one.part_id: one.part for one in circuit.cavity.emitters}
    board, current = circuit.board, _current(circuit, gain)
    amplifiers = f"{_ma(current.amplifiers_ma)}{'' if current.is_amplifier_known else '*'}"
    driver, most_ma = most_drive_ma(circuit)
    more = f", converters and LED drivers ({current.circuits_ma:.0f})" if current.circuits_ma else ""
    yield "## Wire the emitters"
    yield ""
    sink, chip = current_sink(circuit), circuit.led_driver
    if sink is not None and chip is not None:
        yield f"Each anode to the supply, each cathode to its output of a {chip.name}, as `schematic.svg` draws it."
        yield f"A resistor of {ohm_text(sink.reference_ohm)} from IREF of each {chip.name} to ground sets"
        yield f"{sink.current_ma:.1f} mA through the emitter that is on."
        yield ""
        yield f"The supply, {_supply_text(circuit)}, gives {current.full_power_ma:.0f}* mA at full power: one emitter"
        yield f"({current.emitter_ma:.0f}), the amplifiers ({amplifiers}) and the board"
        yield f"({current.board_ma:.0f}*){more}. If a fault lit all emitters, it would be {current.fault_ma:.0f}*."
        yield ""
        return
    yield "One NPN transistor each, as `schematic.svg` draws it."
    yield ""
    yield f"| emitter | series resistor | base resistor | through the emitter mA | out of {driver} mA |"
    yield "|---|---|---|---|---|"
    for part_id, part in kinds.items():
        switch = emitter_switch(part, board)
        series = "none fits: a higher supply" if switch.series_ohm is None else ohm_text(switch.series_ohm)
        pin = f"{switch.base_current_ma:.1f}" + (" TOO MUCH" if switch.base_current_ma > most_ma else "")
        lit = f"{switch.usual_current_ma:.1f} usual, {switch.current_ma:.1f} at most"
        yield f"| {part_id} | {series} | {ohm_text(switch.base_ohm)} | {lit} | {pin} |"
    yield ""
    yield f"The supply, {_supply_text(circuit)}, gives {current.full_power_ma:.0f}* mA at full power: one emitter"
    yield f"lit with its base current ({current.emitter_ma:.0f}), the amplifiers ({amplifiers}) and the"
    yield f"board ({current.board_ma:.0f}*){more}. If a fault lit all emitters, it would be {current.fault_ma:.0f}*."
    yield ""


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
    circuit = Circuit.of(design)
    connections, feedbacks = connections_of(circuit), feedbacks_for(circuit, gain)
    notes, sink, blocks = _notes(circuit, gain), current_sink(circuit), pinouts_of(circuit)
    cell_x = CELL_X + (PIN_ROOM if blocks else 0.0)
    across = min(MOST_ACROSS, max(len(connections.emitters), len(connections.receivers)))
    rows_lit = -(-len(connections.emitters) // across)
    rows_read = -(-len(connections.receivers) // across)
    width = max(2 * MARGIN + across * cell_x, 3.3 * CELL_X)
    rows_led = -(-len(blocks) // across)
    block_y = max(map(_block_height, blocks), default=0.0)
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
        board, transistor = circuit.board, transistor_of(circuit, one.part.part).entry.name
        root.append(
            _switch(one, board, transistor, corner) if sink is None else _sunk(one, board, sink, corner)
        )
    top = MARGIN + HEAD + rows_lit * CELL_Y
    for place, one in enumerate(connections.receivers):
        feedback = None if feedbacks is None else feedbacks[place]
        amplifier = "" if feedback is None else find_amplifier(circuit.entries, feedback.amplifier_id).name
        root.append(_amplifier(one, feedback, amplifier, _corner(place, across, cell_x, top)))
    top += rows_read * CELL_Y
    for place, block in enumerate(blocks):
        corner = MARGIN + (place % across) * cell_x, top + (place // across) * block_y
        root.append(_block(block, corner))
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


def _supply_text(circuit: Circuit) -> str:
    emitters, amplifiers = f"{circuit.board.emitter_v:g} V", f"{circuit.adc.supply_v:g} V"
    if emitters == amplifiers:
        return emitters
    return f"{emitters} for the emitters, {amplifiers} for the amplifiers"


def _block_height(one: Pinout) -> float:
    """Height of a chip's cell [drawing units]."""
    return 26 + BLOCK_LINE * (max(len(one.left), len(one.right)) + len(one.below)) + 40


def _block(one: Pinout, corner: Point) -> Element:
    """Drawing of a chip in a cell whose upper left corner is at `corner`."""
    x, y = corner[0] + 84, corner[1] + 26
    bottom = y + BLOCK_LINE * max(len(one.left), len(one.right)) + 8
    cell = svg.group(f"{one.name}: {one.title}")
    cell.append(svg.text((x, y - 8), f"{one.name} {one.title}", TEXT_PX, font_weight="bold"))
    cell.append(svg.rectangle((x, y), (x + BLOCK_X, bottom), fill="none", stroke="#000000"))
    for k, (inner, outer) in enumerate(one.left):
        level = y + 14 + k * BLOCK_LINE
        cell.append(svg.wire((x - 14, level - 4), (x, level - 4)))
        cell.append(svg.text((x + 4, level), inner, VALUE_PX))
        cell.append(svg.text((x - 18, level), outer, VALUE_PX, anchor="end"))
    for k, (inner, outer) in enumerate(one.right):
        level = y + 14 + k * BLOCK_LINE
        cell.append(svg.wire((x + BLOCK_X, level - 4), (x + BLOCK_X + 14, level - 4)))
        cell.append(svg.text((x + BLOCK_X - 4, level), inner, VALUE_PX, anchor="end"))
        cell.append(svg.text((x + BLOCK_X + 18, level), outer, VALUE_PX, font_weight="bold"))
    for k, line in enumerate(one.below):
        cell.append(svg.text((x, bottom + 14 + k * BLOCK_LINE), line, VALUE_PX))
    return cell


def _labels(at: Point, name: str, value: str) -> Iterator[Element]:
    yield svg.text(at, name, VALUE_PX)
    yield svg.text((at[0], at[1] + 14), value, VALUE_PX, fill=QUIET)


def _current(circuit: Circuit, gain: SimulatedGain | None) -> SupplyCurrent:
    feedbacks = feedbacks_for(circuit, gain)
    return supply_current(circuit, None if feedbacks is None else feedbacks[0].amplifier_id)


def _ma(current: float) -> str:
    return f"{current:.0f}" if current >= 10.0 else f"{current:.2g}"


def _notes(circuit: Circuit, gain: SimulatedGain | None) -> Sequence[str]:
    current, board = _current(circuit, gain), circuit.board
    assumed = "" if current.is_amplifier_known else " (assumed)"
    lit = "emitter and base" if circuit.led_driver is None else "the emitter"
    more = f", {current.circuits_ma:.0f} for converters and LED drivers" if current.circuits_ma else ""
    return (
        f"Supply {_supply_text(circuit)}, ground common with the {board.title}. One emitter is lit at a time.",
        f"At full power {current.full_power_ma:.0f} mA: "
        f"{current.emitter_ma:.0f} mA for {lit}, {_ma(current.amplifiers_ma)} for the amplifiers{assumed}, "
        f"{current.board_ma:.0f} for the board (assumed){more};",
        f"{current.fault_ma:.0f} mA if a fault lit all emitters.",
        f"{pin_words(circuit)}.",
        "Amplifiers: single supply, inputs and outputs down to ground; 100 nF at each package, supply to ground.",
        "Which lead is anode or cathode: the part's data sheet.",
    )
