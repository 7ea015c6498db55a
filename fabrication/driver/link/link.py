"""Dialogue with a board on an open port: waits for its reset, checks its identity and design, starts and stops it."""

from __future__ import annotations

import math
import re
import time
from collections.abc import Callable

from optopad.design.errors import DeviceError, InputError
from optopad.fabrication.driver.link.ports import GUESSED, Port
from optopad.fabrication.driver.link.printers import HEARD_BYTES, printer_words
from optopad.fabrication.driver.link.protocol import (
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
