"""How long one full frame takes on the board, and which serial rates its clock can make.

Model: a plain sum. Every state (each emitter alone, then all off) waits for the light to settle and
converts every receiver once; then the packed frame goes over the line. The firmware sends one frame while
it converts the next, so it is faster: 4.1 ms on a simulated ATmega2560 against 5.0 ms by this sum, at 9 states,
8 receivers, prescaler 64, 1 Mbaud (docs/validation/firmware.md). The sum errs on the safe side.

Left out: the processor's own time for packing, which hides behind the conversions, and the longer
first conversion after a reset.
"""

from __future__ import annotations

import math

from design.parts.catalog import Board
from design.spec import BoardUse

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
