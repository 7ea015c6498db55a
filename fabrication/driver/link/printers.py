"""Detects a 3D printer at a port, because many printers have the same serial chips and boards as sensors.

A printer with Marlin, Repetier, RepRapFirmware or Smoothie replies to M115 in text. A printer with Klipper replies to
Klipper's own request with a message of its protocol (see the page Protocol of Klipper3d/klipper). The sensor's firmware
ignores both requests.
"""

from __future__ import annotations

import math
import re
import time

from optopad.design.errors import DeviceError
from optopad.fabrication.driver.link.ports import Port
from optopad.fabrication.driver.link.protocol import HELLO_BYTES, VERSION, Kind, Scanner

BAUDS = 115200, 250000
"""Baud rates that nearly all printers use."""

ANSWER_S = 1.5
"""Time to wait for a reply to each request [s]; more frequent requests would keep a boot loader running."""

HEARD_BYTES = 4096
"""Number of most recently received bytes that are searched for a printer's reply."""

FIRST_WORDS_S = 1.0
"""Time for which the test listens after a device's reset, counted from the first byte that it sends [s]."""

_SAID = re.compile(
    rb"^(?:start|ok\b.*|echo:.*|.*(?:FIRMWARE_NAME|Marlin|Klipper|RepRapFirmware|Repetier|Smoothie|Grbl).*)\r?\n",
    re.M,
)
_KLIPPER = re.compile(rb"\x05[\x10-\x1f]..\x7e", re.S)


def printer_words(heard: bytes) -> str:
    """First line of `heard` that only a printer sends, or "Klipper's protocol" if it is found; "" if neither is."""
    if line := _SAID.search(heard):
        return line[0].decode("ascii", errors="replace").strip()
    blocks = (block for block in _KLIPPER.findall(heard) if block[2:4] == _klipper_crc(block[:2]))
    return "Klipper's protocol" if any(blocks) else ""


def require_no_printer(name: str, baud: int, patience_s: float) -> None:
    """Check that no 3D printer is at a port: listen after a reset, then send requests that printers reply to.

    The test ends as soon as a sensor of any design sends its hello (its identification).

    Parameters
    ----------
    name : name of the port
    baud : baud rate of the sensor's line; the test also uses the printers' usual rates
    patience_s : longest wait for a boot loader to end [s]

    Raises
    ------
    DeviceError : a printer is at the port, or the port cannot be opened.
    """
    for rate in (baud, *BAUDS):  # opening resets a board
        with Port(name, rate) as port:
            heard = _heard(port, patience_s, after_first_s=FIRST_WORDS_S)
            if heard == b"" or (heard and rate == BAUDS[-1]):
                _ask(port, (baud, *BAUDS), patience_s if heard else 0.0)
            if not heard:
                return


def _ask(port: Port, bauds: tuple[int, ...], until_s: float) -> None:
    end = time.monotonic() + until_s
    while True:
        for baud in bauds:
            port.set_baud(baud)
            port.write(b"\x7e\x05\x1f" + _klipper_crc(b"\x05\x1f") + b"\x7e\nM115\n")
            if _heard(port, ANSWER_S) is None:
                return
        if time.monotonic() >= end:
            return


def _heard(port: Port, longest_s: float, after_first_s: float = math.inf) -> bytes | None:
    """Listen at a port; return the bytes received, or None if a sensor sends its hello.

    The function listens for `longest_s`, but at most `after_first_s` after the first byte [s]. It raises DeviceError if
    a printer replies.
    """
    scanner, heard = Scanner({VERSION << 4 | Kind.HELLO: HELLO_BYTES}), b""
    end = time.monotonic() + longest_s
    while time.monotonic() < end:
        piece = port.read()
        if piece and not heard:
            end = min(end, time.monotonic() + after_first_s)
        heard = (heard + piece)[-HEARD_BYTES:]
        if scanner.feed(piece):
            return None
        if words := printer_words(heard):
            raise DeviceError(
                f"{port.name}: the device there is a printer ({words!r}); nothing was written to its "
                "memory; name the sensor's port with --port. To use this board as the sensor, upload an "
                "empty sketch with the Arduino IDE first"
            )
    return heard


def _klipper_crc(block: bytes) -> bytes:
    crc = 0xFFFF
    for byte in block:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ (0x8408 if crc & 1 else 0)
    return crc.to_bytes(2, "big")
