"""A simulated 3-axis printer with Marlin's G-code, for tests of the stage without a printer.

The printer takes bytes and times and returns bytes; `optopad.fabrication.driver.simulated.port.FakePort` connects it to
a pseudo-terminal. A move has constant speed, without acceleration, and begins when the previous one has ended. The
replies to M400 and G28 come at the end of the motion, all others immediately. Opening the port resets the printer: its
coordinates become 0 at the current position.

Faults are `silent` (no reply after some moves), `error` (stops with `Error:`), `shifted` (stops short of the target,
as at its own limits), and `restarted` (sends `start` during a motion, as after a reset).
"""

from __future__ import annotations

import re
import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from optopad.design.arrays import FloatArray
from optopad.design.errors import InputError

FAULTS = ("silent", "error", "shifted", "restarted")
BUSY_EVERY_S = 2.0
BOOT_S = 0.2
SHIFT_MM = 0.5
NEVER_S = 1e9
HOMING_SPEED_MM_S = 100.0
_WORD = re.compile(r"([A-Z])(-?\d+\.?\d*)")
TAKEN = {"G21", "G90", "G91", "G1", "G28", "G92", "M114", "M115", "M400", "M410", "M211"}


@dataclass(frozen=True)
class _Ride:
    begun_s: float
    ends_s: float
    start: FloatArray
    end: FloatArray

    def at(self, now_s: float) -> FloatArray:
        share = 1.0 if now_s >= self.ends_s else max(now_s - self.begun_s, 0.0) / (self.ends_s - self.begun_s)
        found: FloatArray = self.start + share * (self.end - self.start)
        return found


class FakePrinter:
    """A simulated printer with a tip above a pad.

    Parameters
    ----------
    tip_mm : initial position of the tip (x, y, depth) in the cavity's coordinate system [mm]
    fault : one of `FAULTS`; None for a printer without a fault
    fault_after : number of moves before the fault
    home_mm : home position (x, y, depth) to which G28 moves the tip [mm]

    Attributes
    ----------
    place_text : format string of the reply to M114 (report the position), for x, y and z [mm]
    """

    place_text = "X:{0:.2f} Y:{1:.2f} Z:{2:.2f} E:0.00 Count X:0 Y:0 Z:0\nok\n"

    def __init__(
        self,
        tip_mm: ArrayLike,
        *,
        fault: str | None = None,
        fault_after: int = 4,
        home_mm: ArrayLike = (-40.0, -40.0, 0.0),
    ) -> None:
        if fault is not None and fault not in FAULTS:
            raise InputError(f"stage fault: {fault!r}, needs one of {', '.join(FAULTS)}")
        self._fault, self._left = fault, fault_after
        self._home = _flipped(np.asarray(home_mm, dtype=np.float64))
        here = _flipped(np.asarray(tip_mm, dtype=np.float64))
        self._zero = here
        self._ride = _Ride(0.0, 0.0, here, here)
        self._queue: list[bytes] = []
        self.speed_mm_s = 10.0
        self.commands: list[str] = []
        """All commands that the printer has received."""
        self.reset(0.0)

    def tip_mm(self, now_s: float) -> FloatArray:
        """Position of the tip (x, y, depth) at time `now_s` [s], in the cavity's coordinate system [mm]."""
        return _flipped(self._ride.at(now_s))

    def reset(self, now_s: float) -> None:
        """Restart the printer, as opening the port does: its coordinates become 0 at the current position."""
        here = self._ride.at(now_s)
        self._ride = _Ride(now_s, now_s, here, here)
        self._zero = here
        self._is_relative = False
        self._kept, self._waiting = b"", ""
        self._due_s, self._says = now_s + BOOT_S, "start"

    @property
    def due_s(self) -> float:
        """Time of the next message that the printer sends without a further command [s]."""
        return self._due_s

    def spoken(self, now_s: float) -> bytes:
        """Bytes that the printer sends without a further command at time `now_s` [s]; may be empty."""
        if now_s < self._due_s:
            return b""
        if self._says:
            said, self._says = self._says, ""
            self._due_s = NEVER_S
            return f"{said}\n".encode() + self._obeyed_all(now_s)
        if now_s < self._ride.ends_s:
            self._due_s = min(now_s + BUSY_EVERY_S, self._ride.ends_s)
            return b"echo:busy: processing\n"
        self._waiting, self._due_s = "", NEVER_S
        return b"ok\n" + self._obeyed_all(now_s)

    def heard(self, piece: bytes, now_s: float) -> bytes:
        """Process bytes from the host at time `now_s` [s] and return the immediate reply."""
        self._kept += piece
        *lines, self._kept = self._kept.split(b"\n")
        self._queue += lines
        return self._obeyed_all(now_s)

    def _obeyed_all(self, now_s: float) -> bytes:
        said = b""
        while self._queue and not self._waiting and not self._says:
            said += self._obeyed(self._queue.pop(0).decode("ascii", "replace").strip(), now_s)
        return said

    def _obeyed(self, line: str, now_s: float) -> bytes:
        code = line.partition(" ")[0]
        self.commands.append(line)
        if self._fault is not None and code == "G1":
            self._left -= 1
        if self._shows("silent"):
            return b""
        if self._shows("error") and code == "G1":
            return b"Error:Printer halted. kill() called!\n"
        if self._shows("restarted") and code == "G1":
            self.reset(now_s)
            self._fault = None
            return b""
        if code not in TAKEN:
            return f'echo:Unknown command: "{line}"\nok\n'.encode()
        return self._done(code, {letter: float(number) for letter, number in _WORD.findall(line)}, now_s)

    def _done(self, code: str, words: dict[str, float], now_s: float) -> bytes:
        if code == "M114":
            x, y, z = self._ride.at(now_s) - self._zero
            return self.place_text.format(x, y, z).encode()
        if code == "G1":
            self._move(words, now_s)
        elif code in ("G90", "G91"):
            self._is_relative = code == "G91"
        elif code == "G92":
            now = self._ride.end - self._zero
            self._zero = self._ride.end - [words.get(axis, now[k]) for k, axis in enumerate("XYZ")]
        elif code == "M410":
            here = self._ride.at(now_s)
            self._ride = _Ride(now_s, now_s, here, here)
        elif code == "G28":
            self._zero = self._home
            self.speed_mm_s = HOMING_SPEED_MM_S
            self._travel(self._home, now_s)
        if code in ("M400", "G28"):
            self._waiting, self._due_s = code, min(self._ride.ends_s, now_s + BUSY_EVERY_S)
            return b""
        return b"FIRMWARE_NAME:simulated\nok\n" if code == "M115" else b"ok\n"

    def _move(self, words: dict[str, float], now_s: float) -> None:
        self.speed_mm_s = words.get("F", 60.0 * self.speed_mm_s) / 60.0
        end = self._ride.end - self._zero
        if self._is_relative:
            words = {axis: end[k] + words.get(axis, 0.0) for k, axis in enumerate("XYZ")}
        target = np.array([words.get(axis, end[k]) for k, axis in enumerate("XYZ")]) + self._zero
        if self._shows("shifted"):
            target[2] += SHIFT_MM
        self._travel(target, now_s)

    def _travel(self, target: FloatArray, now_s: float) -> None:
        start = self._ride.end
        begun = max(now_s, self._ride.ends_s)
        takes = float(np.linalg.norm(target - start)) / self.speed_mm_s
        self._ride = _Ride(begun, begun + takes, start, target)

    def _shows(self, fault: str) -> bool:
        return self._fault == fault and self._left < 0


class TipFinger:
    """The printer's tip as the finger that presses the simulated board's pad."""

    def __init__(self, printer: FakePrinter) -> None:
        self._printer = printer

    def at(self, _time_s: ArrayLike) -> FloatArray:
        """Current position of the tip (x, y, depth) [mm]; the board's time is ignored."""
        return self._printer.tip_mm(time.monotonic())


def _flipped(position: FloatArray) -> FloatArray:
    found: FloatArray = position * np.array([1.0, 1.0, -1.0])
    return found
