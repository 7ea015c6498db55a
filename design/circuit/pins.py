"""Assignment of the board's pins to emitters, and of its analogue inputs to receivers.

Wiring, driver configuration, firmware and rules use the same assignment. If the design has a list, it has exactly one
entry per part, in the order of E1, E2, ... and R1, R2, ... Without a list, pins and inputs are assigned in the board's
recommended order. With multiplexers each input is connected to one multiplexer. Consecutive receivers are on different
multiplexers, and all multiplexers have the same address. After each change of the address, every multiplexer therefore
gives one reading.

The module also computes the time of a full frame on the board, and the serial rates that an AVR's clock permits.

A frame has one state for each emitter lit alone, and then one with all emitters off. The frame time is a sum. In every
state it includes the settling time of the light and the conversions of every receiver. Then comes the time to send the
packed frame. The sum is conservative, because the firmware sends one frame while it converts the next. For 9 states, 8
receivers, prescaler 64 and 1 Mbaud the sum is 5.0 ms, and a simulated ATmega2560 needs 4.1 ms
(docs/validation/firmware.md).

The sum does not include the processor's time for packing, which overlaps with the conversions, and the longer first
conversion after a reset.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

from design.errors import DesignError
from design.fields.finding import Finding, error
from design.parts import catalog
from design.parts.catalog import Board, Chip, Multiplexer, ShiftRegister
from design.shape.cavity import cavity_of
from design.spec import BoardUse, SensorDesign
from design.spec.properties import entries_of

Name = TypeVar("Name", int, str)
SHIFT_PINS = 3
"""Pins of a chain of shift registers: data, clock and latch."""


def board_of(design: SensorDesign) -> Board:
    """Catalogue entry of a design's board."""
    return catalog.find_board(entries_of(design), design.board.kind)


def full_scale_v(design: SensorDesign) -> float:
    """Voltage at an analogue input that gives the largest reading [V]."""
    board = board_of(design)
    if design.board.reference == "internal" and board.internal_reference_v is not None:
        return board.internal_reference_v
    return board.full_scale_v


@dataclass(frozen=True, kw_only=True)
class ReceiverPath:
    """The connection from a receiver's amplifier to the board.

    Attributes
    ----------
    channel : name of the board's analogue input
    multiplexer : index of the multiplexer before the input, from 0; None without multiplexers
    address : address at which the multiplexer selects this receiver; None without multiplexers
    """

    channel: str
    multiplexer: int | None = None
    address: int | None = None

    @property
    def label(self) -> str:
        """Terminal of the amplifier's output, such as A0, or M1-C3 for channel 3 of multiplexer M1."""
        return self.channel if self.multiplexer is None else f"M{self.multiplexer + 1}-C{self.address}"


def multiplexer_of(design: SensorDesign) -> Multiplexer | None:
    """Catalogue entry of a design's multiplexers; None if each receiver has its own analogue input."""
    given = design.board.receivers
    return None if given is None else catalog.find_multiplexer(entries_of(design), given.multiplexer)


def shift_register_of(design: SensorDesign) -> ShiftRegister | None:
    """Catalogue entry of a design's shift registers; None if each emitter has its own pin."""
    given = design.board.emitters
    return None if given is None else catalog.find_shift_register(entries_of(design), given.shift_register)


def emitter_label(design: SensorDesign, number: int) -> str:
    """Terminal of an emitter's base resistor, such as D22, or S1-Q3 for output 3 of shift register S1.

    Parameters
    ----------
    number : pin of the emitter, or with shift registers the index of its output in the chain
    """
    register = shift_register_of(design)
    if register is None:
        return f"D{number}"
    place, output = divmod(number, register.outputs)
    return f"S{place + 1}-Q{output}"


def switch_pins(design: SensorDesign, board: Board, emitter_count: int) -> tuple[int, ...]:
    """The board's pins that switch emitters: one per emitter, or data, clock and latch of the shift registers."""
    given = design.board.emitters
    if given is not None:
        return given.pins or board.digital_pins[:SHIFT_PINS]
    return _dealt(design.board.emitter_pins, board.digital_pins, emitter_count)


def _switch_count(design: SensorDesign, emitter_count: int) -> int:
    return SHIFT_PINS if design.board.emitters else emitter_count


def address_pins(design: SensorDesign) -> tuple[int, ...]:
    """Digital pins for the address of the multiplexers, lowest bit first; empty without multiplexers.

    Raises
    ------
    DesignError : the board or the multiplexer is not in the catalogue.
    """
    multiplexer, given = multiplexer_of(design), design.board.receivers
    if multiplexer is None or given is None:
        return ()
    board = board_of(design)
    used = switch_pins(design, board, len(cavity_of(design).emitters))
    free = [pin for pin in board.digital_pins if pin not in used]
    return given.address_pins or tuple(free[: multiplexer.address_bits])


def receiver_paths(design: SensorDesign) -> tuple[ReceiverPath, ...]:
    """The connection from each receiver to the board, in the order of the cavity's receivers.

    Raises
    ------
    DesignError : pins or inputs are too few, too many, duplicate, or not available on the board.
    """
    multiplexer, (_, channels) = multiplexer_of(design), assigned_pins(design)
    if multiplexer is None:
        return tuple(ReceiverPath(channel=name) for name in channels)
    places = (divmod(j, len(channels)) for j in range(len(cavity_of(design).receivers)))
    return tuple(ReceiverPath(channel=channels[m], multiplexer=m, address=a) for a, m in places)


def assigned_pins(design: SensorDesign) -> tuple[tuple[int, ...], tuple[str, ...]]:
    """Pins in the order of the emitters, and analogue inputs in the order of the receivers or multiplexers.

    With shift registers there are no pins per emitter; the first result then has the index of each emitter's output in
    the chain, from 0.

    Raises
    ------
    DesignError : pins or inputs are too few, too many, duplicate, or not available on the board.
    """
    cavity, board = cavity_of(design), board_of(design)
    findings = pin_findings(design, board, len(cavity.emitters), len(cavity.receivers))
    if findings:
        raise DesignError("\n".join(str(finding) for finding in findings))
    pins = _dealt(design.board.emitter_pins, board.digital_pins, len(cavity.emitters))
    if shift_register_of(design) is not None:
        pins = tuple(range(len(cavity.emitters)))
    inputs = input_count(design, len(cavity.receivers))
    channels = _dealt(design.board.receiver_channels, board.analog_channels, inputs)
    return pins, channels


def pin_findings(
    design: SensorDesign, board: Board, emitter_count: int, receiver_count: int
) -> list[Finding]:
    """All errors about the pins and analogue inputs of a design."""
    use, multiplexer = design.board, multiplexer_of(design)
    return [
        *_emitter_findings(design, board, emitter_count),
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
    register, given = shift_register_of(design), design.board.emitters
    if register is None or given is None:
        return [
            *_list_findings(
                "board.emitter_pins", "emitter", "pin", design.board.emitter_pins, board.digital_pins, emitter_count,
                _registers_needed(design, board, emitter_count),
            ),
            *_unknown_pin_findings(design.board.emitter_pins or (), board),
            *_reserved_findings(design.board.emitter_pins, board),
        ]  # fmt: skip
    found = []
    if design.board.emitter_pins is not None:
        found.append(
            error(
                "board.emitter_pins",
                "the emitters are switched by shift registers, which take no pin for each of them",
                value=f"{len(design.board.emitter_pins)} entries",
                limit="none with board.emitters",
                way_out="leave the list out; board.emitters.pins has data, clock and latch",
            )
        )
    if not register.works_on(board):
        found.append(_supply_error("board.emitters.shift_register", register, board))
    pins = switch_pins(design, board, emitter_count)
    if len(set(pins)) < SHIFT_PINS or set(pins) - set(board.digital_pins):
        found.append(
            error(
                "board.emitters.pins",
                f"{register.name} needs 3 pins of the board, each once",
                value=list(pins),
                limit=f"3 of {', '.join(map(str, board.digital_pins))}",
                way_out="choose among these, or leave them out",
            )
        )
    return found


def _registers_needed(design: SensorDesign, board: Board, emitter_count: int) -> str | None:
    """Remedy for too few pins: a packaged shift register that works on the board; None if there is none."""
    for name, one in entries_of(design).shift_registers.items():
        if one.works_on(board):
            number = (
                f"{emitter_count} emitters need {one.needed(emitter_count)} of them and {SHIFT_PINS} pins"
            )
            return f'set board.emitters.shift_register = "{name}": {number}'
    return None


def _supply_error(field: str, entry: Chip, board: Board) -> Finding:
    return error(
        field,
        f"{entry.name} does not work at the level of the board's pins",
        value=f"{board.pin_v:g} V",
        limit=f"{entry.supply_low_v:g} to {entry.supply_high_v:g} V",
        way_out="choose another one, or another board.kind",
    )


def input_count(design: SensorDesign, receiver_count: int) -> int:
    """Number of analogue inputs that the receivers need, directly or through multiplexers."""
    multiplexer = multiplexer_of(design)
    return receiver_count if multiplexer is None else multiplexer.needed(receiver_count)


def _multiplexers_needed(
    design: SensorDesign, board: Board, emitter_count: int, receiver_count: int
) -> str | None:
    """Remedy for too few analogue inputs: the packaged multiplexer that needs the fewest; None if none fits."""
    if design.board.receivers is not None:
        return None
    spare = len(board.digital_pins) - _switch_count(design, emitter_count)
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
    """Errors about the multiplexers' supply voltage and about the pins of their address."""
    multiplexer, given = multiplexer_of(design), design.board.receivers
    if multiplexer is None or given is None:
        return []
    found = []
    if not multiplexer.works_on(board):
        found.append(_supply_error("board.receivers.multiplexer", multiplexer, board))
    field, bits = "board.receivers.address_pins", multiplexer.address_bits
    pins = given.address_pins
    if pins is None:
        switches = _switch_count(design, emitter_count)
        if switches + bits > len(board.digital_pins):
            found.append(
                error(
                    field,
                    f"the board has no pins left for the address of {multiplexer.name}",
                    value=f"{switches} pins for emitters and {bits} address lines",
                    limit=f"at most {len(board.digital_pins)} pins",
                    way_out="use fewer emitters, or name another board.kind",
                )
            )
        return found
    used = switch_pins(design, board, emitter_count)
    wrong = [pin for pin in pins if pin not in board.digital_pins or pin in used or pins.count(pin) > 1]
    if len(pins) != bits or wrong:
        found.append(
            error(
                field,
                f"{multiplexer.name} needs {bits} pins of the board that no emitter has, each once",
                value=list(pins),
                limit=f"{bits} of {', '.join(str(pin) for pin in board.digital_pins if pin not in used)}",
                way_out="choose among these, or leave the list out",
            )
        )
    return found


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


def _unknown_pin_findings(pins: Sequence[int], board: Board) -> list[Finding]:
    busy = {*board.reserved_pins, *(board.uart_pins or ())}  # another finding covers these pins
    return _unknown_findings(
        "board.emitter_pins", "pin", [pin for pin in pins if pin not in busy], board.digital_pins
    )


def _reserved_findings(pins: Sequence[int] | None, board: Board) -> list[Finding]:
    serial, reserved = set(board.uart_pins or ()), set(board.reserved_pins)
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
"""Length of a frame's check value, the CRC-32 over all preceding bytes."""

LINE_BITS_PER_BYTE = 10
"""Bits on the serial line for each byte: start bit, 8 data bits, stop bit."""

UART_CLOCKS_PER_BIT = 8
"""Least clock cycles per bit of an AVR's UART at double speed (U2X); others are multiples."""

UART_MAX_DIVISOR = 4096
"""Largest divisor of an AVR's UART, whose register has 12 bits."""

MS_PER_S = 1e3
US_PER_MS = 1e3
US_PER_S = 1e6


def state_count(emitter_count: int) -> int:
    """Number of states of a frame: each emitter lit alone, then all off."""
    return emitter_count + 1


def frame_bytes(emitter_count: int, receiver_count: int, adc_bits: int) -> int:
    """Length of a packed frame [bytes]: header, readings packed bit by bit, check value."""
    readings = state_count(emitter_count) * receiver_count
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


def frame_time_ms(
    board: Board,
    use: BoardUse,
    emitter_count: int,
    receiver_count: int,
    multiplexer: Multiplexer | None = None,
) -> float:
    """Time of one full frame [ms]: settling and conversions in all states, and then sending.

    With multiplexers the sum includes their settling time after each new address.
    """
    conversions = receiver_count * use.averages * conversion_time_ms(board, use.adc_prescaler)
    if multiplexer is not None:
        addresses = math.ceil(receiver_count / multiplexer.needed(receiver_count))
        conversions += addresses * multiplexer.settle_us.value / US_PER_MS
    state = use.settle_us / US_PER_MS + conversions
    sent = frame_bytes(emitter_count, receiver_count, board.adc_bits)
    return state_count(emitter_count) * state + sending_time_ms(board, use, sent)


def frame_rate_hz(
    design: SensorDesign, board: Board | None = None, adc_prescaler: int | None = None
) -> float:
    """Frames per second on a board, as the reciprocal of `frame_time_ms`.

    Parameters
    ----------
    board : None for the board of the design
    adc_prescaler : divider of the converter's clock; None for that of the design
    """
    cavity, use = cavity_of(design), design.board
    if adc_prescaler is not None:
        use = use.model_copy(update={"adc_prescaler": adc_prescaler})
    counts = len(cavity.emitters), len(cavity.receivers)
    return MS_PER_S / frame_time_ms(board or board_of(design), use, *counts, multiplexer_of(design))


def faster_boards(design: SensorDesign) -> list[tuple[str, float]]:
    """Identifiers and frame rates [Hz] of faster boards in the catalogue that fit the design, the fastest first."""
    now, found = frame_rate_hz(design), []
    for name, board in entries_of(design).boards.items():
        rate = frame_rate_hz(design, board)
        if rate > now and _fits_on(design, name, board):
            found.append((name, rate))
    return sorted(found, key=lambda one: (-one[1], one[0]))


def _fits_on(design: SensorDesign, name: str, board: Board) -> bool:
    """Whether a board has the pins, inputs, voltage levels and reference that a design uses."""
    if design.board.reference == "internal" and board.internal_reference_v is None:
        return False
    cavity, use = cavity_of(design), design.board.model_copy(update={"kind": name})
    on_it = design.model_copy(update={"board": use})
    return not pin_findings(on_it, board, len(cavity.emitters), len(cavity.receivers))


def baud_divisor(clock_hz: int, baud: int) -> int:
    """Divisor of an eighth of an AVR's clock that gives the serial rate nearest to `baud`."""
    return min(max(round(clock_hz / (UART_CLOCKS_PER_BIT * baud)), 1), UART_MAX_DIVISOR)


def made_baud(clock_hz: int, baud: int) -> float:
    """Serial rate of an AVR's UART that is nearest to the requested one [baud]."""
    return clock_hz / (UART_CLOCKS_PER_BIT * baud_divisor(clock_hz, baud))


def baud_error(clock_hz: int, baud: int) -> float:
    """Relative error of an AVR's serial rate [-]; positive if it is too fast."""
    return made_baud(clock_hz, baud) / baud - 1.0
