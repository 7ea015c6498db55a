"""Which pin drives which emitter, which analogue input reads which receiver.

The one answer that wiring, driver config, firmware and rules share. A list in the design has exactly
one entry a part, in the order of E1, E2, ... and R1, R2, ...; without a list, pins and inputs are
dealt out in the board's recommended order.

How long one full frame takes on the board, and which serial rates its clock can make.

Model: a plain sum. Every state (each emitter alone, then all off) waits for the light to settle and
converts every receiver once; then the packed frame goes over the line. The firmware sends one frame while
it converts the next, so it is faster: 4.1 ms on a simulated ATmega2560 against 5.0 ms by this sum, at 9 states,
8 receivers, prescaler 64, 1 Mbaud (docs/validation/firmware.md). The sum errs on the safe side.

Left out: the processor's own time for packing, which hides behind the conversions, and the longer
first conversion after a reset.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TypeVar

from design.errors import DesignError
from design.fields.finding import Finding, error
from design.parts import catalog
from design.parts.catalog import Board
from design.shape.cavity import cavity_of
from design.spec import BoardUse, SensorDesign
from design.spec.properties import entries_of

Name = TypeVar("Name", int, str)


def board_of(design: SensorDesign) -> Board:
    """The catalogue entry of the design's board."""
    return catalog.find_board(entries_of(design), design.board.kind)


def assigned_pins(design: SensorDesign) -> tuple[tuple[int, ...], tuple[str, ...]]:
    """Emitter pins and receiver channels, in the order of the cavity's emitters and receivers.

    Raises
    ------
    DesignError : too few of them, too many, one twice, one that the board lacks or needs itself.
    """
    cavity, board = cavity_of(design), board_of(design)
    findings = pin_findings(design, board, len(cavity.emitters), len(cavity.receivers))
    if findings:
        raise DesignError("\n".join(str(finding) for finding in findings))
    pins = _dealt(design.board.emitter_pins, board.digital_pins, len(cavity.emitters))
    channels = _dealt(design.board.receiver_channels, board.analog_channels, len(cavity.receivers))
    return pins, channels


def pin_findings(
    design: SensorDesign, board: Board, emitter_count: int, receiver_count: int
) -> list[Finding]:
    """Everything wrong with the pins and channels of a design."""
    use = design.board
    return [
        *_list_findings(
            "board.emitter_pins", "emitter", "pin", use.emitter_pins, board.digital_pins, emitter_count
        ),
        *_unknown_pin_findings(use.emitter_pins or (), board),
        *_reserved_findings(use.emitter_pins, board),
        *_list_findings(
            "board.receiver_channels",
            "receiver",
            "analogue input",
            use.receiver_channels,
            board.analog_channels,
            receiver_count,
        ),
        *_unknown_findings(
            "board.receiver_channels", "analogue input", use.receiver_channels or (), board.analog_channels
        ),
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
) -> list[Finding]:
    if given is None:
        return _room_findings(field, part, noun, len(known), count)
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


def _room_findings(field: str, part: str, noun: str, available: int, count: int) -> list[Finding]:
    if count <= available:
        return []
    return [
        error(
            field,
            f"the layout has {count} {part}s, more than the board has {noun}s for",
            value=count,
            limit=f"at most {available}",
            way_out=f"use fewer {part}s, or name another board.kind",
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
    busy = {*board.reserved_pins, *board.uart_pins}  # these have their own finding
    return _unknown_findings(
        "board.emitter_pins", "pin", [pin for pin in pins if pin not in busy], board.digital_pins
    )


def _reserved_findings(pins: Sequence[int] | None, board: Board) -> list[Finding]:
    serial, reserved = set(board.uart_pins), set(board.reserved_pins)
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
"""CRC-32 over everything before it."""

LINE_BITS_PER_BYTE = 10
"""Start bit, 8 data bits, stop bit."""

UART_CLOCKS_PER_BIT = 8
"""An AVR UART at double speed (U2X) divides its clock by 8 times a whole number."""

UART_MAX_DIVISOR = 4096
"""The divisor register has 12 bits."""

MS_PER_S = 1e3
US_PER_MS = 1e3
US_PER_S = 1e6


def state_count(emitter_count: int) -> int:
    """States of a frame: each emitter alone, then all off."""
    return emitter_count + 1


def frame_bytes(emitter_count: int, receiver_count: int, adc_bits: int) -> int:
    """Length of a packed frame: head, readings packed bit by bit, check."""
    readings = state_count(emitter_count) * receiver_count
    packed = math.ceil(readings * adc_bits / 8)
    return MAGIC_BYTES + VERSION_BYTES + SEQUENCE_BYTES + TIME_BYTES + packed + CHECK_BYTES


def conversion_time_ms(board: Board, adc_prescaler: int) -> float:
    """Time of one analogue conversion [ms]."""
    return board.adc_clocks_per_conversion * adc_prescaler / board.clock_hz * MS_PER_S


def link_time_ms(byte_count: int, baud: int) -> float:
    """Time that bytes take on the serial line [ms]."""
    return byte_count * LINE_BITS_PER_BYTE / baud * MS_PER_S


def frame_time_ms(board: Board, use: BoardUse, emitter_count: int, receiver_count: int) -> float:
    """Time of one full frame: all states, then the line [ms]."""
    conversions = receiver_count * conversion_time_ms(board, use.adc_prescaler)
    state = use.settle_us / US_PER_MS + conversions
    sent = frame_bytes(emitter_count, receiver_count, board.adc_bits)
    return state_count(emitter_count) * state + link_time_ms(sent, use.baud)


def baud_divisor(clock_hz: int, baud: int) -> int:
    """What the UART divides an eighth of its clock by, for the rate nearest to the wanted one."""
    return min(max(round(clock_hz / (UART_CLOCKS_PER_BIT * baud)), 1), UART_MAX_DIVISOR)


def made_baud(clock_hz: int, baud: int) -> float:
    """The rate nearest to the wanted one that the UART can make [baud]."""
    return clock_hz / (UART_CLOCKS_PER_BIT * baud_divisor(clock_hz, baud))


def baud_error(clock_hz: int, baud: int) -> float:
    """Signed relative error of the rate that the UART makes [-]."""
    return made_baud(clock_hz, baud) / baud - 1.0
