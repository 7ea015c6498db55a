"""A frame on the line to the host: its length, the time to send it, and the serial rates of an AVR's clock."""

from __future__ import annotations

import math

from optopad.design.parts.catalog import Board
from optopad.design.recordings import lit_emitters
from optopad.design.spec import BoardUse

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


def link_time_ms(byte_count: int, baud: int) -> float:
    """Time to send a number of bytes on the serial line [ms]."""
    return byte_count * LINE_BITS_PER_BYTE / baud * MS_PER_S


def sending_time_ms(board: Board, use: BoardUse, byte_count: int) -> float:
    """Time to send a number of bytes to the host, by native USB or by the serial line [ms]."""
    if board.usb_bytes_per_s is not None:
        return byte_count / board.usb_bytes_per_s * MS_PER_S
    return link_time_ms(byte_count, use.baud)


def baud_divisor(clock_hz: int, baud: int) -> int:
    """Number by which an eighth of an AVR's clock is divided to get the serial rate nearest to `baud`."""
    return min(max(round(clock_hz / (UART_CLOCKS_PER_BIT * baud)), 1), UART_MAX_DIVISOR)


def made_baud(clock_hz: int, baud: int) -> float:
    """Serial rate nearest to the requested one that an AVR's UART can produce [baud]."""
    return clock_hz / (UART_CLOCKS_PER_BIT * baud_divisor(clock_hz, baud))


def baud_error(clock_hz: int, baud: int) -> float:
    """Relative error of an AVR's serial rate [-]; positive if it is too fast."""
    return made_baud(clock_hz, baud) / baud - 1.0
