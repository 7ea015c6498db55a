"""A serial line to a printer's firmware that speaks G-code with `ok` (Marlin and its kin).

One command a line, the next when all answers are there. The firmware says `ok` when it has taken a command,
`echo:busy: ...` every second or two while one takes long, `Error:...` or `!!` when it stops, and `start` after a reset.
"""

from __future__ import annotations

import re
import time
from collections.abc import Callable

from design.errors import DeviceError
from fabrication.driver.link.ports import Port, PortLostError, on_standard_error

ASK_EVERY_S = 2.0
"""How often a board that boots is asked who it is."""

QUIET_S = 0.3
"""Longest pause between answers to questions that were asked twice."""

_NUMBER = r"([-+]?\d+(?:\.(\d*))?)"
_PLACE = re.compile(
    rf"(?:ok\s+)?(?:C:\s*)?X:\s*{_NUMBER}\s*Y:\s*{_NUMBER}\s*Z:\s*{_NUMBER}(?=\s|[A-Z]\d?:|$)"
)
_UNKNOWN = re.compile(r"unknown command|bad command|not supported|unsupported command", re.I)


def place_of(line: str) -> tuple[tuple[float, float, float], float] | None:
    """X, Y, Z [mm] of an answer to M114, and the step of its last digit [mm]; None for a line that is none.

    Marlin, Klipper, Repetier and RepRapFirmware begin the line with X, Marlin 1.0 without blanks, Smoothie with
    `ok C:`. Positions in other coordinates than those of G1 are none: `MCS:`, what follows `Count`, Grbl's status.
    """
    found = _PLACE.match(line)
    if found is None:
        return None
    x, x_digits, y, y_digits, z, z_digits = found.groups()
    digits = min(len(part or "") for part in (x_digits, y_digits, z_digits))
    return (float(x), float(y), float(z)), 10.0**-digits


class GcodeLine:
    """Commands and answers.

    Parameters
    ----------
    port : open
    answer_s : longest silence before a command counts as not answered [s]

    Attributes
    ----------
    has_begun_anew : whether the firmware was reset after it was greeted: its coordinates mean nothing any more
    """

    def __init__(self, port: Port, answer_s: float) -> None:
        self._port = port
        self._answer_s = answer_s
        self._kept = b""
        self._owed = 0
        self.has_begun_anew = False

    def greet(self, boot_s: float, on_wait: Callable[[str], None] = on_standard_error) -> None:
        """Wait until the firmware answers, which opening the port may have reset; DeviceError after `boot_s` [s].

        on_wait : takes a line every two seconds of the wait
        """
        begun, heard = time.monotonic(), b""
        end = begun + boot_s
        while (now := time.monotonic()) < end:
            if now > begun + ASK_EVERY_S:
                on_wait(
                    f"waiting   {self._port.name}: no answer of the printer yet; still waiting, up to {boot_s:g} s"
                )
            self._write("M115")
            asked = time.monotonic()
            while time.monotonic() < min(asked + ASK_EVERY_S, end):
                heard += self._read()
                if any(line.startswith("ok") for line in _lines(heard)):
                    self._drain()
                    return
        said = f"{len(heard)} bytes and no ok among them" if heard else "silent"
        grbl = "; Grbl has neither M114 nor M400, which a stage needs" if b"Grbl" in heard else ""
        raise DeviceError(
            f"{self._port.name}: {said} for {boot_s:.1f} s{grbl}; is it the printer's port (--stage-port), and its "
            "baud rate (--stage-baud)?"
        )

    def send(self, command: str, *, takes_s: float = 0.0, is_optional: bool = False) -> list[str]:
        """Send a command and wait for its answer.

        Parameters
        ----------
        takes_s : how long it is expected to work before it answers [s]
        is_optional : whether firmware without it is all right

        Returns
        -------
        the lines before its `ok`

        Raises
        ------
        DeviceError : no answer, an error, a reset, an unknown command; the port is gone.
        """
        self.post(command)
        said = self.answers(command, takes_s)
        if not is_optional and (unknown := [line for line in said if _UNKNOWN.search(line)]):
            raise DeviceError(f"{self._port.name}: {unknown[0]!r}; the firmware lacks {command.split()[0]}")
        return said

    def post(self, command: str) -> None:
        """Send a command without waiting; its answer is owed."""
        self._owed += 1
        self._write(command)

    def answers(
        self, command: str, takes_s: float = 0.0, is_last: Callable[[str], bool] | None = None
    ) -> list[str]:
        """Wait until nothing is owed any more; as `send`.

        Parameters
        ----------
        is_last : whether a line answers the last command: after its `ok`, answers still owed to earlier ones never come
            (an interrupt took them, or kept the commands from being sent), and what does come late is dropped
        """
        said: list[str] = []
        end = time.monotonic() + self._answer_s + takes_s
        is_told = is_over = False
        while self._owed > 0 and not is_over:
            if time.monotonic() > end:
                raise DeviceError(
                    f"{self._port.name}: no answer to {command} for {self._answer_s + takes_s:.1f} s"
                )
            self._kept += self._read()
            *lines, self._kept = self._kept.split(b"\n")
            for line in _lines(b"\n".join(lines)):
                self._judge(line, command)
                is_told = is_told or (is_last is not None and is_last(line))
                if line.startswith("ok"):
                    self._owed -= 1
                    is_over = is_told
                elif "busy:" in line:
                    end = max(end, time.monotonic() + self._answer_s)
                said.append(line)
        if self._owed > 0:
            self._drain()
        return said

    def _judge(self, line: str, command: str) -> None:
        lowered = line.lower()
        if _UNKNOWN.search(line):
            return  # RepRapFirmware calls it an error; whether the command is needed is the caller's
        if lowered.startswith(("error", "!!")) or ("home" in lowered and "first" in lowered):
            self._owed = 0
            raise DeviceError(f"{self._port.name}: the printer says {line!r} to {command}")
        if line == "start":
            self._owed = 0
            self.has_begun_anew = True
            raise DeviceError(
                f"{self._port.name}: the printer began anew during {command}; its position is lost"
            )

    def _drain(self) -> None:
        """Drop what comes late, as answers to questions that were asked twice; nothing is owed then."""
        end = time.monotonic() + QUIET_S
        while time.monotonic() < end:
            if self._read():
                end = time.monotonic() + QUIET_S
        self._kept, self._owed = b"", 0

    def _write(self, command: str) -> None:
        try:
            self._port.write(command.encode("ascii") + b"\n")
        except PortLostError as err:
            raise _gone(err) from err

    def _read(self) -> bytes:
        try:
            return self._port.read()
        except PortLostError as err:
            raise _gone(err) from err


def _gone(err: PortLostError) -> DeviceError:
    return DeviceError(f"{str(err).partition('; ')[0]}; the tip stays where it is: lift it by hand")


def _lines(heard: bytes) -> list[str]:
    return [line for raw in heard.split(b"\n") if (line := raw.decode("ascii", errors="replace").strip())]
