"""Dialogue with a board on an open port: waits for its reset, checks its identity and design, starts and stops it.

A 3D printer at a port is detected, because many printers have the same serial chips and boards as sensors. A printer
with Marlin, Repetier, RepRapFirmware or Smoothie replies to M115 in text. A printer with Klipper replies to Klipper's
own request with a message of its protocol (see the page Protocol of Klipper3d/klipper). The sensor's firmware ignores
both requests.
"""

from __future__ import annotations

import math
import re
import time
from collections.abc import Callable

from optopad.design.errors import DeviceError, InputError
from optopad.fabrication.driver.link.ports import GUESSED, Port
from optopad.fabrication.driver.link.protocol import (
    HELLO_BYTES,
    VERSION,
    Command,
    FrameFormat,
    Hello,
    Kind,
    Message,
    Scanner,
    frame_format,
    message_lengths,
    pack_command,
    unpack_hello,
)
from optopad.fabrication.driver_file import DriverConfig

BAUDS = 115200, 250000
"""Baud rates that nearly all printers use."""

PRINTER_ANSWER_S = 1.5
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
            if _heard(port, PRINTER_ANSWER_S) is None:
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


ASK_EVERY_S = 0.25
"""Interval between requests for identification while the board sends data [s]. While the board is silent, the interval
doubles each time, because each byte sent to a boot loader makes it wait longer."""

ANSWER_S = 2.5
"""Longest wait for a board's hello after its boot time [s]; the board sends a hello every second without a request."""

SAY_EVERY_S = 2.0
"""Interval between progress messages while waiting for a board [s]."""

US_PER_S = 1e6


class Link:
    """Dialogue with one board over one open port.

    Parameters
    ----------
    port : open port
    config : configuration of the design whose frames are expected
    """

    def __init__(self, port: Port, config: DriverConfig) -> None:
        self.port = port
        self.config = config
        self.layout: FrameFormat = frame_format(config)
        self.scanner = Scanner(message_lengths(self.layout))
        self.hello_message = b""

    def messages(self) -> list[Message]:
        """Complete messages that arrive within about a tenth of a second; raises PortLostError if the port is lost."""
        piece = self.port.read()
        return self.scanner.feed(piece) if piece else []

    def send(self, command: Command, argument: int = 0) -> None:
        """Send a command to the board; raises PortLostError if the port is lost."""
        self.port.write(pack_command(command, argument))

    def start(self, interval_us: int) -> None:
        """Set the frame interval [us], 0 for the board's shortest, and start the stream of frames."""
        self.send(Command.RATE, interval_us)
        self.send(Command.START)

    def greet(
        self,
        *,
        accept_digest: str | None,
        patience_s: float,
        is_guess: bool = False,
        is_over: Callable[[], bool] = lambda: False,
        on_wait: Callable[[str], None] = lambda _: None,
    ) -> Hello:
        """Wait for the board's hello (its description of itself), and check that the board is of this design.

        After a reset, the board sends its hello without a request, and nothing is sent to it while its boot loader
        listens. A board that is already sending frames is stopped and then identified. A silent board receives a
        request for identification after its boot time. If the port is a guess, nothing is sent to a silent device,
        because it may be a printer.

        Parameters
        ----------
        accept_digest : first 8 or more digits of the digest of another accepted design, or None
        patience_s : longest wait [s]
        is_guess : whether the port was chosen only because of its serial chip, which other devices also have
        on_wait : called with a progress line every two seconds of the wait
        is_over : called repeatedly; the wait stops when it returns True

        Raises
        ------
        DeviceError : the device is silent, is a printer, or has other firmware or another design; or `is_over`
            stopped the wait.
        """
        begun = time.monotonic()
        ask_at = begun + (math.inf if is_guess else self.config.board.boot_s)
        gap_s, say_at = ASK_EVERY_S, begun + SAY_EVERY_S
        heard, last = 0, b""
        while (now := time.monotonic()) < begun + patience_s:
            if is_over():
                raise DeviceError(f"{self.port.name}: closed while the board was greeted")
            if now >= say_at:
                say_at += SAY_EVERY_S
                on_wait(self._wait_line(heard, now - begun, patience_s))
            piece = self.port.read()
            heard += len(piece)
            last = (last + piece)[-HEARD_BYTES:]
            if words := printer_words(last):
                raise DeviceError(
                    f"{self.port.name}: the device there is a printer ({words!r}), not the sensor; name "
                    "the sensor's port with --port (port=)"
                )
            for version, message in self.scanner.feed(piece):
                kind = version & 0x0F
                if kind == Kind.HELLO:
                    return self._checked(message, accept_digest)
                ask_at = min(ask_at, now + gap_s)  # it runs already: no boot to wait for
            if now >= ask_at:
                ask_at = now + gap_s
                gap_s *= 1 if heard else 2
                self.send(Command.STOP)
                self.send(Command.IDENTIFY)
        why = self._why_no_hello(heard, patience_s)
        raise DeviceError(
            f"{why}. {GUESSED} If this is another device, name the sensor's port with --port (port=)"
            if is_guess
            else why
        )

    def _checked(self, message: bytes, accept_digest: str | None) -> Hello:
        hello = unpack_hello(message)
        check_hello(hello, self.config, where=self.port.name, accept_digest=accept_digest)
        self.hello_message = message
        return hello

    def _wait_line(self, heard: int, waited_s: float, patience_s: float) -> str:
        state = f"{heard} bytes and no hello" if heard else "silent"
        return (
            f"waiting   {self.port.name}: {state} for {waited_s:.0f} s; still waiting, up to {patience_s:g} s"
        )

    def _why_no_hello(self, heard: int, waited_s: float) -> str:
        port, board = self.port.name, self.config.board
        if heard == 0:
            return (
                f"{port}: silent for {waited_s:.1f} s; is it the right port, and does the board have this "
                "design's firmware (`optopad driver flash DESIGN`)? A slower boot loader needs "
                "--patience SECONDS (patience_s=)"
            )
        return (
            f"{port}: {heard} bytes in {waited_s:.1f} s and no hello among them: another device sends "
            f"there, or its rate is not {board.baud} baud; name the right port, or flash the firmware "
            "(`optopad driver flash DESIGN`)"
        )


def check_hello(hello: Hello, config: DriverConfig, *, where: str, accept_digest: str | None) -> None:
    """Check that a board's hello (its identification) names the required design.

    Parameters
    ----------
    hello : the board's description of itself
    config : configuration of the required design
    where : name of the port, for messages
    accept_digest : first 8 or more digits of the digest of another accepted design, or None

    Raises
    ------
    DeviceError : the board's frames have another shape, or its design is neither the required nor the accepted one.
    """
    layout = frame_format(config)
    has = (hello.emitters, hello.receivers, hello.bits, hello.dark)
    wanted = (layout.emitters, layout.receivers, layout.bits, layout.dark)
    if has != wanted:
        darks = (f', dark states "{has[3]}"', f', "{wanted[3]}"') if has[3] != wanted[3] else ("", "")
        raise DeviceError(
            f"{where}: firmware for {has[0]} emitters, {has[1]} receivers, {has[2]} bits{darks[0]}; driver.toml of "
            f"{config.design} has {wanted[0]}, {wanted[1]}, {wanted[2]}{darks[1]}; flash this design's firmware "
            "(`optopad driver flash DESIGN`), or use the driver.toml of the board's design"
        )
    if hello.digest == config.digest or is_accepted(hello.digest, accept_digest):
        return
    raise DeviceError(
        f"{where}: firmware of another design, digest {hello.digest[:8]}; driver.toml is {config.design}'s, digest "
        f"{config.digest[:8]}; flash this design's firmware (`optopad driver flash DESIGN`), or, if its wiring is the "
        f"same, accept it: --accept-digest {hello.digest[:8]} (accept_digest=)"
    )


def is_accepted(digest: str, accept_digest: str | None) -> bool:
    """Whether a digest begins with the digits `accept_digest`; always False if `accept_digest` is None."""
    return accept_digest is not None and digest.startswith(accept_digest.lower())


def require_digest(accept_digest: str | None) -> None:
    """Raise InputError unless `accept_digest` is None or consists of 8 to 64 hexadecimal digits."""
    if accept_digest is not None and not re.fullmatch(r"[0-9a-fA-F]{8,64}", accept_digest):
        raise InputError(
            f"accept_digest: {accept_digest!r} names no design; give 8 to 64 hexadecimal digits of the board's digest"
        )


def interval_us(rate_hz: float) -> int:
    """Frame interval [us] for a frame rate [Hz]; 0, which means the board's shortest interval, for a rate of 0."""
    return round(US_PER_S / rate_hz) if rate_hz > 0 else 0
