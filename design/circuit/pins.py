"""Assignment of the board's pins to emitters, and of its analogue inputs to receivers.

Wiring, driver configuration, firmware and rules use the same assignment. If the design lists pins or inputs, the list
has exactly one entry per part, in the order of E1, E2, ... and R1, R2, ... If not, they are assigned in the board's
recommended order.

- Multiplexers: each is connected to one input. Consecutive receivers are on different multiplexers, and all
  multiplexers share the address lines. After each change of the address, every multiplexer therefore gives one reading.
- Converters: receivers are assigned in blocks. With 8 inputs each, U1 has R1 to R8, and U2 has R9 to R16. Converters
  have separate chip selects and no shared address, so blocks cost no time, and one converter is wired to neighbouring
  receivers.

The module also computes the time of a full frame on the board, and the serial rates that an AVR's clock permits.

A frame has one state for each emitter lit alone, and then one with all emitters off. The frame time is a sum: for each
state, the settling time of the light and the conversions of every receiver; then the time to send the packed frame.
With LED drivers, each state begins by sending their data on the SPI bus. With converters, a conversion is a reading on
the bus. The sum is conservative, because the firmware sends one frame while it converts the next. For 9 states, 8
receivers, prescaler 64 and 1 Mbaud the sum is 5.0 ms, and a simulated ATmega2560 needs 4.1 ms
(docs/validation/firmware.md).

The sum includes neither the processor's time for packing, which overlaps with the conversions, nor the longer first
conversion after a reset.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

from optopad.design.errors import DesignError
from optopad.design.fields.finding import Finding, error
from optopad.design.parts import catalog
from optopad.design.parts.catalog import Board, Chip, Converter, LedDriver, Multiplexer, ShiftRegister
from optopad.design.recordings import lit_emitters
from optopad.design.shape.cavity import cavity_of
from optopad.design.spec import BoardUse, SensorDesign
from optopad.design.spec.properties import entries_of

Name = TypeVar("Name", int, str)
SHIFT_PINS = 3
"""Pins of a chain of shift registers: data, clock and latch."""
DRIVER_PINS = 2
"""Pins of a chain of LED drivers in addition to the SPI bus: latch and blank."""
EDGE_US = 1.0
"""Wait of the firmware after each edge of the LED drivers' latch and blank signals [us]."""
DRIVER_EDGES = 4


def board_of(design: SensorDesign) -> Board:
    """Catalogue entry of a design's board."""
    return catalog.find_board(entries_of(design), design.board.kind)


def full_scale_v(design: SensorDesign) -> float:
    """Voltage at an input that gives a full-scale reading [V]."""
    board, converter = board_of(design), converter_of(design)
    if converter is not None:
        return converter.full_scale_on(board)
    if design.board.reference == "internal" and board.internal_reference_v is not None:
        return board.internal_reference_v
    return board.full_scale_v


def amplifier_v(design: SensorDesign) -> float:
    """Supply voltage of the amplifiers, which no reading can exceed [V]."""
    board, converter = board_of(design), converter_of(design)
    return board.pin_v if converter is None else converter.analog_v(board)


def adc_bits(design: SensorDesign) -> int:
    """Number of bits in a reading: the converter's if the design has one, else the board's own."""
    converter = converter_of(design)
    return board_of(design).adc_bits if converter is None else converter.bits


@dataclass(frozen=True, kw_only=True)
class ReceiverPath:
    """The connection from a receiver's amplifier to the board.

    Attributes
    ----------
    channel : name of the board's analogue input; "" with converters
    multiplexer : index of the multiplexer before the input, from 0; None without multiplexers
    converter : index of the converter that reads the receiver, from 0; None if the board's own converter reads it
    address : address at which the multiplexer selects this receiver, or the input that it has on the converter, from 0;
        None if the receiver has its own input on the board
    """

    channel: str = ""
    multiplexer: int | None = None
    converter: int | None = None
    address: int | None = None

    @property
    def label(self) -> str:
        """Where the amplifier's output goes, such as input A0, M1-C3 of multiplexer M1, or U1-C3 of converter U1."""
        if self.converter is not None:
            return f"U{self.converter + 1}-C{self.address}"
        return self.channel if self.multiplexer is None else f"M{self.multiplexer + 1}-C{self.address}"


def multiplexer_of(design: SensorDesign) -> Multiplexer | None:
    """Catalogue entry of a design's multiplexers; None if each receiver has its own analogue input."""
    given = design.board.receivers
    if given is None or given.multiplexer is None:
        return None
    return catalog.find_multiplexer(entries_of(design), given.multiplexer)


def converter_of(design: SensorDesign) -> Converter | None:
    """Catalogue entry of a design's converters; None if the board's own converter reads the receivers."""
    given = design.board.receivers
    if given is None or given.converter is None:
        return None
    return catalog.find_converter(entries_of(design), given.converter)


def shift_register_of(design: SensorDesign) -> ShiftRegister | None:
    """Catalogue entry of a design's shift registers; None if it has none."""
    given = design.board.emitters
    if given is None or given.shift_register is None:
        return None
    return catalog.find_shift_register(entries_of(design), given.shift_register)


def driver_of(design: SensorDesign) -> LedDriver | None:
    """Catalogue entry of a design's LED drivers; None if each emitter has a transistor."""
    given = design.board.emitters
    if given is None or given.driver is None:
        return None
    return catalog.find_led_driver(entries_of(design), given.driver)


def emitter_label(design: SensorDesign, number: int) -> str:
    """Terminal that switches an emitter, such as pin D22, S1-Q3 of shift register S1, or L1-Q3 of LED driver L1.

    Parameters
    ----------
    number : pin of the emitter, or the index of its output in the chain of shift registers or LED drivers
    """
    chain, letter = shift_register_of(design) or driver_of(design), "S"
    if chain is None:
        return f"D{number}"
    if driver_of(design) is not None:
        letter = "L"
    place, output = divmod(number, chain.outputs)
    return f"{letter}{place + 1}-Q{output}"


def spi_pins(design: SensorDesign, board: Board) -> tuple[int, ...]:
    """Pins of the board's SPI bus: clock, data out, data in; empty if the design does not use the bus."""
    return () if converter_of(design) is None and driver_of(design) is None else board.spi_pins


def _open_pins(design: SensorDesign, board: Board) -> tuple[int, ...]:
    """Digital pins in recommended order, without the SPI bus if the design uses it."""
    busy = spi_pins(design, board)
    return tuple(pin for pin in board.digital_pins if pin not in busy)


def switch_pins(design: SensorDesign, board: Board, emitter_count: int) -> tuple[int, ...]:
    """The board's pins that switch emitters.

    There is one per emitter; with shift registers there are data, clock and latch; with LED drivers, latch and blank.
    """
    given, pins = design.board.emitters, _open_pins(design, board)
    if given is not None:
        return given.pins or pins[: _switch_count(design, emitter_count)]
    return _dealt(design.board.emitter_pins, pins, emitter_count)


def _switch_count(design: SensorDesign, emitter_count: int) -> int:
    given = design.board.emitters
    if given is None:
        return emitter_count
    return SHIFT_PINS if given.driver is None else DRIVER_PINS


def address_pins(design: SensorDesign) -> tuple[int, ...]:
    """Digital pins for the address of the multiplexers, lowest bit first; empty without multiplexers.

    Raises
    ------
    DesignError : the board or the multiplexer is not in the catalogue.
    """
    multiplexer, given = multiplexer_of(design), design.board.receivers
    if multiplexer is None or given is None:
        return ()
    return given.address_pins or _spare_pins(design)[: multiplexer.address_bits]


def select_pins(design: SensorDesign) -> tuple[int, ...]:
    """Digital pins for the converters' chip selects, in the order of the converters; empty without converters.

    Raises
    ------
    DesignError : the board, the converter or a part is not in the catalogue.
    """
    converter, given = converter_of(design), design.board.receivers
    if converter is None or given is None:
        return ()
    return given.select_pins or _spare_pins(design)[: converter.needed(len(cavity_of(design).receivers))]


def _spare_pins(design: SensorDesign) -> tuple[int, ...]:
    board = board_of(design)
    used = switch_pins(design, board, len(cavity_of(design).emitters))
    return tuple(pin for pin in _open_pins(design, board) if pin not in used)


def receiver_paths(design: SensorDesign) -> tuple[ReceiverPath, ...]:
    """The connection from each receiver to the board, in the order of the cavity's receivers.

    Raises
    ------
    DesignError : pins or inputs are too few, too many, duplicate, or not available on the board.
    """
    multiplexer, (_, channels) = multiplexer_of(design), assigned_pins(design)
    converter, receivers = converter_of(design), range(len(cavity_of(design).receivers))
    if converter is not None:
        blocks = (divmod(j, converter.channels) for j in receivers)
        return tuple(ReceiverPath(converter=chip, address=place) for chip, place in blocks)
    if multiplexer is None:
        return tuple(ReceiverPath(channel=name) for name in channels)
    places = (divmod(j, len(channels)) for j in receivers)
    return tuple(ReceiverPath(channel=channels[m], multiplexer=m, address=a) for a, m in places)


def assigned_pins(design: SensorDesign) -> tuple[tuple[int, ...], tuple[str, ...]]:
    """Pins in the order of the emitters, and analogue inputs in the order of the receivers or multiplexers.

    With shift registers or LED drivers, an emitter's pin is replaced by the number of its output in the chain, from 0.
    With converters, the inputs are empty.

    Raises
    ------
    DesignError : pins or inputs are too few, too many, duplicate, or not available on the board.
    """
    cavity, board = cavity_of(design), board_of(design)
    findings = pin_findings(design, board, len(cavity.emitters), len(cavity.receivers))
    if findings:
        raise DesignError("\n".join(str(finding) for finding in findings))
    pins = _dealt(design.board.emitter_pins, _open_pins(design, board), len(cavity.emitters))
    if design.board.emitters is not None:
        pins = tuple(range(len(cavity.emitters)))
    inputs = input_count(design, len(cavity.receivers))
    channels = _dealt(design.board.receiver_channels, board.analog_channels, inputs)
    return pins, channels


def pin_findings(
    design: SensorDesign, board: Board, emitter_count: int, receiver_count: int
) -> list[Finding]:
    """All findings about the pins and channels of a design."""
    use, multiplexer, converter = design.board, multiplexer_of(design), converter_of(design)
    emitters = [*_bus_findings(design, board), *_emitter_findings(design, board, emitter_count)]
    if converter is not None:
        return [*emitters, *_converter_findings(design, board, converter, emitter_count, receiver_count)]
    return [
        *emitters,
        *_list_findings(
            "board.receiver_channels",
            "receiver" if multiplexer is None else "multiplexer",
            "analogue input",
            use.receiver_channels,
            board.analog_channels,
            input_count(design, receiver_count),
            _multiplexers_needed(design, board, emitter_count, receiver_count),
        ),
        *_address_findings(design, board, emitter_count),
        *_unknown_findings(
            "board.receiver_channels", "analogue input", use.receiver_channels or (), board.analog_channels
        ),
    ]


def _emitter_findings(design: SensorDesign, board: Board, emitter_count: int) -> list[Finding]:
    chain, given = shift_register_of(design) or driver_of(design), design.board.emitters
    known = _open_pins(design, board)
    if chain is None or given is None:
        return [
            *_list_findings(
                "board.emitter_pins", "emitter", "pin", design.board.emitter_pins, known, emitter_count,
                _registers_needed(design, board, emitter_count),
            ),
            *_unknown_pin_findings(design, board),
            *_reserved_findings(design, board),
        ]  # fmt: skip
    words = "shift registers" if given.driver is None else "LED drivers"
    names = "data, clock and latch" if given.driver is None else "latch and blank"
    found = []
    if design.board.emitter_pins is not None:
        found.append(
            error(
                "board.emitter_pins",
                f"the emitters are switched by {words}, which take no pin for each of them",
                value=f"{len(design.board.emitter_pins)} entries",
                limit="none with board.emitters",
                way_out=f"leave the list out; board.emitters.pins has {names}",
            )
        )
    if not chain.works_on(board):
        entry = "shift_register" if given.driver is None else "driver"
        found.append(_supply_error(f"board.emitters.{entry}", chain, board))
    pins, count = switch_pins(design, board, emitter_count), _switch_count(design, emitter_count)
    if len(pins) != count or len(set(pins)) < count or set(pins) - set(known):
        found.append(
            error(
                "board.emitters.pins",
                f"{chain.name} needs {count} pins of the board, each once: {names}",
                value=list(pins),
                limit=f"{count} of {', '.join(map(str, known))}",
                way_out="choose among these, or leave them out",
            )
        )
    return found


def _bus_findings(design: SensorDesign, board: Board) -> list[Finding]:
    use = design.board
    fields = [
        *(["board.receivers.converter"] if converter_of(design) else []),
        *(["board.emitters.driver"] if driver_of(design) else []),
    ]
    able = [name for name, one in entries_of(design).boards.items() if one.spi_pins]
    return [
        error(
            field,
            f"no program of the {board.title} drives its SPI bus",
            value=use.kind,
            limit=f"a board with arduino.spi_pins: {', '.join(able) or 'none is in the catalogue'}",
            way_out="name one of these in board.kind, or give arduino.spi_pins in the entry of your board",
        )
        for field in fields
        if not board.spi_pins
    ]


def _least_switch_count(design: SensorDesign, pin_count: int, emitter_count: int) -> int:
    """Number of pins that switch emitters; if the board has too few, the number with shift registers instead."""
    count = _switch_count(design, emitter_count)
    return count if count <= pin_count else SHIFT_PINS


def _registers_needed(design: SensorDesign, board: Board, emitter_count: int) -> str | None:
    """Remedy for too few emitter pins: a shift register or an LED driver that fits the board; None if none does."""
    ways: list[str] = []
    for name, one in entries_of(design).shift_registers.items():
        if one.works_on(board) and not ways:
            number = (
                f"{emitter_count} emitters need {one.needed(emitter_count)} of them and {SHIFT_PINS} pins"
            )
            ways.append(f'set board.emitters.shift_register = "{name}": {number}')
    for name, driver in entries_of(design).led_drivers.items():
        if driver.works_on(board) and board.spi_pins and len(ways) < 2:
            number = f"{driver.needed(emitter_count)} of them, the SPI bus and {DRIVER_PINS} pins"
            ways.append(f'set board.emitters.driver = "{name}", of constant current: {number}')
    return "; or ".join(ways) or None


def _supply_error(field: str, entry: Chip, board: Board) -> Finding:
    if isinstance(entry, Converter):
        return _converter_supply_error(field, entry, board)
    return error(
        field,
        f"{entry.name} does not work at the level of the board's pins",
        value=f"{board.pin_v:g} V",
        limit=f"{entry.supply_low_v:g} to {entry.supply_high_v:g} V",
        way_out="choose another one, or another board.kind",
    )


def _converter_supply_error(field: str, entry: Converter, board: Board) -> Finding:
    least, most = entry.logic_low_v, entry.logic_high_v
    if least is None or most is None:
        return error(
            field,
            f"{entry.name} has one supply, and its data output is at the level of that supply, which a pin of the "
            "board does not bear",
            value=f"pins of {board.pin_v:g} V",
            limit=f"{entry.supply_low_v:g} to {entry.supply_high_v:g} V",
            way_out="name a converter that works at the level of the pins, as mcp3208 at 2.7 to 5.5 V, or one "
            "with a digital supply of its own, as ads8688",
        )
    return error(
        field,
        f"{entry.name} has its analogue supply from the emitters' supply and its digital supply at the level of the "
        "board's pins",
        value=f"{board.emitter_v:g} V and {board.pin_v:g} V",
        limit=f"{entry.supply_low_v:g} to {entry.supply_high_v:g} V and {least:g} to {most:g} V",
        way_out="name another converter, as mcp3208, or another board.kind",
    )


def input_count(design: SensorDesign, receiver_count: int) -> int:
    """Number of analogue inputs that the receivers need, directly or through multiplexers."""
    multiplexer = multiplexer_of(design)
    if converter_of(design) is not None:
        return 0
    return receiver_count if multiplexer is None else multiplexer.needed(receiver_count)


def _multiplexers_needed(
    design: SensorDesign, board: Board, emitter_count: int, receiver_count: int
) -> str | None:
    """Remedy for too few inputs: a multiplexer or a converter that fits; None if there is none."""
    if design.board.receivers is not None:
        return None
    ways = [
        _multiplexer_way(design, board, emitter_count, receiver_count),
        _converter_way(design, board, emitter_count, receiver_count),
    ]
    return "; or ".join(way for way in ways if way) or None


def _converter_way(design: SensorDesign, board: Board, emitter_count: int, receiver_count: int) -> str | None:
    pins = set(board.digital_pins) - set(board.spi_pins)
    spare = len(pins) - _least_switch_count(design, len(pins), emitter_count)
    for name, one in entries_of(design).converters.items():
        count = one.needed(receiver_count)
        if board.spi_pins and one.works_on(board) and count <= spare:
            return (
                f'set board.receivers.converter = "{name}", of {one.bits} bits: {count} of them, the SPI bus and '
                f"{count} select pin{'s' if count > 1 else ''}"
            )
    return None


def _multiplexer_way(
    design: SensorDesign, board: Board, emitter_count: int, receiver_count: int
) -> str | None:
    pins = _open_pins(design, board)
    spare = len(pins) - _least_switch_count(design, len(pins), emitter_count)
    for name, one in sorted(entries_of(design).multiplexers.items(), key=lambda item: -item[1].channels):
        count = one.needed(receiver_count)
        if one.works_on(board) and one.address_bits <= spare and count <= len(board.analog_channels):
            inputs = " and ".join(board.analog_channels[:count])
            return (
                f'set board.receivers.multiplexer = "{name}": {receiver_count} receivers need {count} of them on '
                f"{inputs}, and {one.address_bits} pins for the address"
            )
    return None


def _address_findings(design: SensorDesign, board: Board, emitter_count: int) -> list[Finding]:
    multiplexer, given = multiplexer_of(design), design.board.receivers
    if multiplexer is None or given is None:
        return []
    found = []
    if not multiplexer.works_on(board):
        found.append(_supply_error("board.receivers.multiplexer", multiplexer, board))
    wanted = _Pins("board.receivers.address_pins", multiplexer.name, multiplexer.address_bits, "address")
    return [*found, *_receiver_pin_findings(design, board, wanted, given.address_pins, emitter_count)]


def _converter_findings(
    design: SensorDesign, board: Board, converter: Converter, emitter_count: int, receiver_count: int
) -> list[Finding]:
    use, found = design.board, []
    if not converter.works_on(board):
        found.append(_supply_error("board.receivers.converter", converter, board))
    unused = (
        ("board.receiver_channels", None if use.receiver_channels is None else list(use.receiver_channels)),
        ("board.reference", None if use.reference == "supply" else use.reference),
    )
    found += [
        error(
            field,
            f"{converter.name} reads the receivers, and the board's own converter is not used",
            value=value,
            limit="left out with board.receivers.converter",
            way_out="remove it, or remove board.receivers.converter",
        )
        for field, value in unused
        if value is not None
    ]
    given = None if use.receivers is None else use.receivers.select_pins
    wanted = _Pins(
        "board.receivers.select_pins", converter.name, converter.needed(receiver_count), "chip selects"
    )
    return [*found, *_receiver_pin_findings(design, board, wanted, given, emitter_count)]


@dataclass(frozen=True)
class _Pins:
    """Pins that the receivers' circuits need: the design's field, name of the circuit, number and purpose."""

    field: str
    chip: str
    count: int
    purpose: str


def _receiver_pin_findings(
    design: SensorDesign, board: Board, wanted: _Pins, pins: tuple[int, ...] | None, emitter_count: int
) -> list[Finding]:
    known, count = _open_pins(design, board), wanted.count
    if pins is None:
        switches = _switch_count(design, emitter_count)
        if switches + count <= len(known):
            return []
        return [
            error(
                wanted.field,
                f"the board has no pins left for the {wanted.purpose} of {wanted.chip}",
                value=f"{switches} pins for emitters and {count} for the {wanted.purpose}",
                limit=f"at most {len(known)} pins",
                way_out="use fewer emitters, or name another board.kind",
            )
        ]
    used = switch_pins(design, board, emitter_count)
    wrong = [pin for pin in pins if pin not in known or pin in used or pins.count(pin) > 1]
    if len(pins) == count and not wrong:
        return []
    return [
        error(
            wanted.field,
            f"{wanted.chip} needs {count} pins of the board that no emitter has, each once",
            value=list(pins),
            limit=f"{count} of {', '.join(str(pin) for pin in known if pin not in used)}",
            way_out="choose among these, or leave the list out",
        )
    ]


def _dealt(given: tuple[Name, ...] | None, known: tuple[Name, ...], count: int) -> tuple[Name, ...]:
    return known[:count] if given is None else given


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


def _unknown_pin_findings(design: SensorDesign, board: Board) -> list[Finding]:
    busy = {
        *board.reserved_pins,
        *(board.uart_pins or ()),
        *spi_pins(design, board),
    }  # another finding covers these
    pins = design.board.emitter_pins or ()
    known = _open_pins(design, board)
    return _unknown_findings("board.emitter_pins", "pin", [pin for pin in pins if pin not in busy], known)


def _reserved_findings(design: SensorDesign, board: Board) -> list[Finding]:
    serial, pins = set(board.uart_pins or ()), design.board.emitter_pins
    reserved = {*board.reserved_pins, *spi_pins(design, board)}
    return [
        error(
            "board.emitter_pins",
            f"pin {pin} {'carries the serial line to the host' if pin in serial else 'has another job'}",
            value=pin,
            limit=f"none of {', '.join(map(str, sorted(serial | reserved)))}",
            way_out="choose another pin, or leave the list out",
        )
        for pin in dict.fromkeys(pins or ())
        if pin in serial | reserved
    ]


MAGIC_BYTES = 2
VERSION_BYTES = 1
SEQUENCE_BYTES = 4
TIME_BYTES = 4
CHECK_BYTES = 4
"""Length of a frame's check value [bytes], the CRC-32 of all preceding bytes."""
LINE_BITS_PER_BYTE = 10
"""Bits on the serial line for each byte: start bit, 8 data bits, stop bit."""

UART_CLOCKS_PER_BIT = 8
"""Smallest number of clock cycles per bit of an AVR's UART at double speed (U2X); all others are its multiples."""

UART_MAX_DIVISOR = 4096
"""Largest divisor of an AVR's UART, whose register has 12 bits."""

MS_PER_S = 1e3
US_PER_MS = 1e3
US_PER_S = 1e6


def state_count(emitter_count: int, dark: str = "frame") -> int:
    """Number of states in a frame, as in `lit_emitters`."""
    return len(lit_emitters(emitter_count, dark))


def frame_bytes(emitter_count: int, receiver_count: int, adc_bits: int, dark: str = "frame") -> int:
    """Length of a packed frame [bytes]: header, readings packed bit by bit, check value."""
    readings = state_count(emitter_count, dark) * receiver_count
    packed = math.ceil(readings * adc_bits / 8)
    return MAGIC_BYTES + VERSION_BYTES + SEQUENCE_BYTES + TIME_BYTES + packed + CHECK_BYTES


def conversion_time_ms(board: Board, adc_prescaler: int) -> float:
    """Time of one analogue-to-digital conversion [ms]; the prescaler matters for AVR chips only."""
    if board.conversion_us is not None:
        return board.conversion_us.value / US_PER_MS
    assert board.adc_clocks_per_conversion is not None, "the entry gives one of the two"
    return board.adc_clocks_per_conversion * adc_prescaler / board.clock_hz * MS_PER_S


def link_time_ms(byte_count: int, baud: int) -> float:
    """Time to send a number of bytes on the serial line [ms]."""
    return byte_count * LINE_BITS_PER_BYTE / baud * MS_PER_S


def sending_time_ms(board: Board, use: BoardUse, byte_count: int) -> float:
    """Time to send a number of bytes to the host, by native USB or by the serial line [ms]."""
    if board.usb_bytes_per_s is not None:
        return byte_count / board.usb_bytes_per_s * MS_PER_S
    return link_time_ms(byte_count, use.baud)


def reading_time_ms(board: Board, use: BoardUse, converter: Converter | None) -> float:
    """Time of one reading [ms], by the given converter or, if it is None, by the board's own."""
    if converter is not None:
        return converter.reading_us(board) / US_PER_MS
    return conversion_time_ms(board, use.adc_prescaler)


def switch_time_ms(driver: LedDriver | ShiftRegister | None, emitter_count: int, dark: str) -> float:
    """Time that shift registers or LED drivers take to switch an emitter [ms]; 0 if `driver` is None."""
    if driver is None:
        return 0.0
    if isinstance(driver, ShiftRegister):
        return driver.switch_us(emitter_count, dark) / US_PER_MS
    sent_ms = driver.bits(emitter_count) / driver.clock_hz(emitter_count) * MS_PER_S
    return sent_ms + (DRIVER_EDGES * EDGE_US + driver.turn_on_wait_us) / US_PER_MS


def lit_time_us(design: SensorDesign) -> float:
    """Time from lighting an emitter until the end of its state [us]: settling, then all readings."""
    board, use, count = board_of(design), design.board, len(cavity_of(design).receivers)
    return _lit_ms(board, use, count, multiplexer_of(design), converter_of(design)) * US_PER_MS


def _lit_ms(
    board: Board,
    use: BoardUse,
    receiver_count: int,
    multiplexer: Multiplexer | None,
    converter: Converter | None,
) -> float:
    conversions = receiver_count * use.averages * reading_time_ms(board, use, converter)
    if multiplexer is not None:
        addresses = math.ceil(receiver_count / multiplexer.needed(receiver_count))
        conversions += addresses * multiplexer.settle_us.value / US_PER_MS
    return use.settle_us / US_PER_MS + conversions


def frame_time_ms(
    board: Board,
    use: BoardUse,
    emitter_count: int,
    receiver_count: int,
    multiplexer: Multiplexer | None = None,
    *,
    converter: Converter | None = None,
    driver: LedDriver | ShiftRegister | None = None,
) -> float:
    """Time of one full frame [ms]: all states, then sending it, with settling after each new multiplexer address."""
    state = switch_time_ms(driver, emitter_count, use.dark)
    state += _lit_ms(board, use, receiver_count, multiplexer, converter)
    bits = board.adc_bits if converter is None else converter.bits
    sent = frame_bytes(emitter_count, receiver_count, bits, use.dark)
    return state_count(emitter_count, use.dark) * state + sending_time_ms(board, use, sent)


def design_frame_time_ms(
    design: SensorDesign, emitter_count: int, receiver_count: int, board: Board, use: BoardUse
) -> float:
    """Time of one full frame with all circuits between a design's board and its parts [ms]."""
    return frame_time_ms(
        board,
        use,
        emitter_count,
        receiver_count,
        multiplexer_of(design),
        converter=converter_of(design),
        driver=driver_of(design) or shift_register_of(design),
    )


def frame_rate_hz(
    design: SensorDesign, board: Board | None = None, adc_prescaler: int | None = None
) -> float:
    """Frames per second on a board, as the reciprocal of `frame_time_ms`.

    Parameters
    ----------
    board : board to use; None for the design's own
    adc_prescaler : divider of the converter's clock; None for the design's own
    """
    cavity, use = cavity_of(design), design.board
    if adc_prescaler is not None:
        use = use.model_copy(update={"adc_prescaler": adc_prescaler})
    counts = len(cavity.emitters), len(cavity.receivers)
    return MS_PER_S / design_frame_time_ms(design, *counts, board or board_of(design), use)


def faster_boards(design: SensorDesign) -> list[tuple[str, float]]:
    """Identifiers and frame rates [Hz] of faster boards in the catalogue that fit the design, the fastest first."""
    now, found = frame_rate_hz(design), []
    for name, board in entries_of(design).boards.items():
        rate = frame_rate_hz(design, board)
        if rate > now and _fits_on(design, name, board):
            found.append((name, rate))
    return sorted(found, key=lambda one: (-one[1], one[0]))


def _fits_on(design: SensorDesign, name: str, board: Board) -> bool:
    if design.board.reference == "internal" and board.internal_reference_v is None:
        return False
    cavity, use = cavity_of(design), design.board.model_copy(update={"kind": name})
    on_it = design.model_copy(update={"board": use})
    return not pin_findings(on_it, board, len(cavity.emitters), len(cavity.receivers))


def baud_divisor(clock_hz: int, baud: int) -> int:
    """Number by which an eighth of an AVR's clock is divided to get the serial rate nearest to `baud`."""
    return min(max(round(clock_hz / (UART_CLOCKS_PER_BIT * baud)), 1), UART_MAX_DIVISOR)


def made_baud(clock_hz: int, baud: int) -> float:
    """Serial rate nearest to the requested one that an AVR's UART can produce [baud]."""
    return clock_hz / (UART_CLOCKS_PER_BIT * baud_divisor(clock_hz, baud))


def baud_error(clock_hz: int, baud: int) -> float:
    """Relative error of an AVR's serial rate [-]; positive if it is too fast."""
    return made_baud(clock_hz, baud) / baud - 1.0
