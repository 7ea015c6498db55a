"""A 3-axis printer as a stage, driven by G-code over a serial line, for Marlin, Klipper, RepRapFirmware and Smoothie.

The pad's x and y are parallel to the printer's, and the printer's z points up. There are two ways to give the position
of the cavity's corner in the printer's coordinates: homing, with known coordinates of the corner (`home`), or a known
current position of the tip (`zero`). `zero` works even if opening the port has reset the printer and its coordinates.

Every move ends with M400 (wait for the end of the motion) and is checked with M114 (report the position). M114 reports
the firmware's own count, which does not include lost steps, backlash of the lead screws and bending of the printer.

Each line has one command, and the next is sent after all replies. The firmware sends `ok` when it has accepted a
command, and `echo:busy: ...` every second or two during a long command. It sends `Error:...` or `!!` when it stops, and
`start` after a reset.
"""

from __future__ import annotations

import math
import re
import time
from collections.abc import Callable
from typing import TYPE_CHECKING

from optopad.design.errors import DeviceError, InputError
from optopad.fabrication.driver.link.ports import Port, PortLostError, on_standard_error
from optopad.fabrication.stage.stage import NOWHERE, Knot, Position, StageLimits, leg

if TYPE_CHECKING:
    from typing_extensions import Self  # in typing from Python 3.11

ASK_EVERY_S = 2.0
"""Interval between requests to a printer that may still be booting [s]."""

QUIET_S = 0.3
"""Duration of silence after which no further replies to earlier requests are expected [s]."""

_NUMBER = r"([-+]?\d+(?:\.(\d*))?)"
_PLACE = re.compile(
    rf"(?:ok\s+)?(?:C:\s*)?X:\s*{_NUMBER}\s*Y:\s*{_NUMBER}\s*Z:\s*{_NUMBER}(?=\s|[A-Z]\d?:|$)"
)
_UNKNOWN = re.compile(r"unknown command|bad command|not supported|unsupported command", re.I)


def place_of(line: str) -> tuple[tuple[float, float, float], float] | None:
    """X, Y, Z in a printer's reply to M114 [mm], and the value of their last digit [mm]; None for any other line.

    Most firmware begins the line with X; Marlin 1.0 does so without spaces, and Smoothie begins with `ok C:`. Positions
    in coordinates other than those of G1 are ignored: `MCS:`, the part after `Count`, Grbl's status.
    """
    found = _PLACE.match(line)
    if found is None:
        return None
    x, x_digits, y, y_digits, z, z_digits = found.groups()
    digits = min(len(part or "") for part in (x_digits, y_digits, z_digits))
    return (float(x), float(y), float(z)), 10.0**-digits


class GcodeLine:
    """Serial line to a printer: sends commands and collects replies.

    Parameters
    ----------
    port : open port of the printer
    answer_s : longest silence while a reply is expected [s]

    Attributes
    ----------
    has_begun_anew : whether the printer was reset after `greet`, which makes its coordinates invalid
    """

    def __init__(self, port: Port, answer_s: float) -> None:
        self._port = port
        self._answer_s = answer_s
        self._kept = b""
        self._owed = 0
        self.has_begun_anew = False

    def greet(self, boot_s: float, on_wait: Callable[[str], None] = on_standard_error) -> None:
        """Wait until the printer replies; opening the port may have reset it.

        Parameters
        ----------
        boot_s : longest wait [s]
        on_wait : called with a progress line every two seconds of the wait

        Raises
        ------
        DeviceError : the printer does not reply in time.
        """
        begun, heard = time.monotonic(), b""
        end = begun + boot_s
        while (now := time.monotonic()) < end:
            if now > begun + ASK_EVERY_S:
                on_wait(
                    f"waiting   {self._port.name}: no reply of the printer yet; still waiting, up to {boot_s:g} s"
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
        """Send a command and wait for its reply.

        Parameters
        ----------
        takes_s : time that the command is expected to take [s]
        is_optional : whether no error is raised if the printer does not know the command

        Returns
        -------
        lines of the reply, including `ok`

        Raises
        ------
        DeviceError : the printer does not reply, reports an error, was reset, or does not know the command; or the port
            is lost.
        """
        self.post(command)
        said = self.answers(command, takes_s)
        if not is_optional and (unknown := [line for line in said if _UNKNOWN.search(line)]):
            raise DeviceError(f"{self._port.name}: {unknown[0]!r}; the firmware lacks {command.split()[0]}")
        return said

    def post(self, command: str) -> None:
        """Send a command without waiting for its reply."""
        self._owed += 1
        self._write(command)

    def answers(
        self, command: str, takes_s: float = 0.0, is_last: Callable[[str], bool] | None = None
    ) -> list[str]:
        """Wait for the replies to all commands sent so far and return their lines; raises the same errors as `send`.

        Parameters
        ----------
        command : the last command, for messages
        takes_s : time that the command is expected to take [s]
        is_last : function that returns whether a line belongs to the last command's reply. After that reply, missing
            earlier replies are no longer expected, because an interrupt may have discarded them
        """
        said: list[str] = []
        end = time.monotonic() + self._answer_s + takes_s
        is_told = is_over = False
        while self._owed > 0 and not is_over:
            if time.monotonic() > end:
                raise DeviceError(
                    f"{self._port.name}: no reply to {command} for {self._answer_s + takes_s:.1f} s"
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
            return  # RepRapFirmware calls it an error; the caller decides whether it needs the command
        if lowered.startswith(("error", "!!")) or ("home" in lowered and "first" in lowered):
            self._owed = 0
            raise DeviceError(f"{self._port.name}: the printer replied {line!r} to {command}")
        if line == "start":
            self._owed = 0
            self.has_begun_anew = True
            raise DeviceError(
                f"{self._port.name}: the printer restarted during {command}; its position is lost"
            )

    def _drain(self) -> None:
        """Discard late lines until the printer is silent; replies to earlier commands are then no longer expected."""
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


BAUD = 115200
TRAVEL_MM = 5.0
"""Default height of the tip above the pad during lateral motion [mm]."""

NEAR_MM = 1.0
"""Height above the pad below which the tip moves at the pressing speed [mm]."""

TRAVEL_SPEED_MM_S, PRESS_SPEED_MM_S = 30.0, 5.0
BOOT_S, ANSWER_S, HOMING_S = 15.0, 10.0, 120.0
TOLERANCE_MM = 0.03
"""Accepted distance between a reported position and its target [mm]; more is accepted if positions are coarse."""

COARSEST_MM = 0.1
"""Coarsest accepted resolution of positions in M114's reply [mm]; whole millimetres are too coarse for presses."""

S_PER_MIN = 60.0
MM_DIGITS = 4
ROUNDING_MM = 1e-4
SHOWN_CHARACTERS = 120


class GcodeStage:
    """A 3-axis printer that presses the pad.

    Parameters
    ----------
    port : name of the printer's serial port
    limits : permitted positions of the tip, see `stage.limits_of`
    baud : baud rate of the line
    travel_mm : height of the tip above the pad during lateral motion [mm]
    travel_speed_mm_s, press_speed_mm_s : speeds of the tip far from the pad, and near or in the pad [mm/s]
    boot_s : longest wait for the printer after opening the port [s]
    answer_s : longest silence while a reply is expected [s]

    Attributes
    ----------
    left_at : position of the tip (x, y, depth) after the `with` block [mm]; None before the end of the block, if the
        tip could not be lifted, or if a reset made its position unknown
    """

    def __init__(
        self,
        port: str,
        limits: StageLimits,
        *,
        baud: int = BAUD,
        travel_mm: float = TRAVEL_MM,
        travel_speed_mm_s: float = TRAVEL_SPEED_MM_S,
        press_speed_mm_s: float = PRESS_SPEED_MM_S,
        boot_s: float = BOOT_S,
        answer_s: float = ANSWER_S,
    ) -> None:
        for name, value in (
            ("travel_mm", travel_mm),
            ("travel_speed_mm_s", travel_speed_mm_s),
            ("press_speed_mm_s", press_speed_mm_s),
        ):
            if not (math.isfinite(value) and value > 0):
                raise InputError(f"stage: {name} is {value:g}, needs a number above 0")
        self.limits = limits
        self._name, self._baud = port, baud
        self._travel_mm = travel_mm
        self._speeds_mm_s = travel_speed_mm_s, press_speed_mm_s
        self._boot_s, self._answer_s = boot_s, answer_s
        self.left_at: Position | None = None
        self._origin: Position | None = None
        self._sent: Position | None = None
        self._at: Position | None = None
        self._knots: list[Knot] = []
        self._limits_are_off = False
        self._port: Port | None = None
        self._open_line: GcodeLine | None = None

    def __enter__(self) -> Self:
        self._port = Port(self._name, self._baud)
        try:
            self._open_line = GcodeLine(self._port, self._answer_s)
            self._line.greet(self._boot_s)
            self._line.send("G21")  # millimetres
            self._line.send("G90")  # absolute
        except BaseException:
            self._port.close()
            raise
        return self

    def __exit__(self, _kind: object, err: BaseException | None, _trace: object) -> None:
        try:
            if self._line.has_begun_anew:
                self._lift_blindly()
            elif self._origin is not None:
                self.lift()
                self.left_at = self.position()
            if self._limits_are_off:
                self._line.send("M211 S1", is_optional=True)
        except DeviceError as stuck:
            why = "" if err is None or str(err) == str(stuck) else f"{str(err) or 'interrupted'}; "
            raise DeviceError(f"{why}{stuck}; the tip may still touch the pad: lift it by hand") from err
        finally:
            if self._port is not None:
                self._port.close()

    def home(self, origin_mm: Position) -> None:
        """Home all axes (G28), which makes the printer's coordinates absolute.

        Parameters
        ----------
        origin_mm : the printer's X, Y, Z when the tip is at the cavity's corner (0, 0) and at the height of the
            untouched surface [mm]
        """
        self._line.send("G28", takes_s=HOMING_S)
        self._origin = origin_mm
        self.lift()

    def zero(self, x_mm: float, y_mm: float, depth_mm: float = 0.0) -> None:
        """Define the tip's current position in the cavity's coordinate system [mm], then lift it to travel height.

        Raises
        ------
        InputError : the position is outside the limits.
        """
        self.limits.require(x_mm, y_mm, depth_mm)
        self._limits_are_off = True
        self._line.send("M211 S0", is_optional=True)  # its own limits are invalid without homing
        (x, y, z), step_mm = self._machine()
        if (
            step_mm > TOLERANCE_MM
        ):  # its rounding would be an error of every depth: the given position becomes exact
            self._line.send(f"G92 X{x:.3f} Y{y:.3f} Z{z:.3f}")
        self._origin = x - x_mm, y - y_mm, z + depth_mm
        self._sent = self._at = x_mm, y_mm, depth_mm
        self.lift()

    def move_to(self, x_mm: float, y_mm: float, depth_mm: float) -> Position:
        """Move to a position, stop, and return the reported position; for details and errors see
        `stage.Stage.move_to`."""
        self.limits.require(x_mm, y_mm, depth_mm)
        x, y, depth = self._at = self.position()
        if math.hypot(x_mm - x, y_mm - y) > TOLERANCE_MM / 2:
            self._go(min(depth, -self._travel_mm))
            self._slide(x_mm, y_mm)
        self._go(depth_mm)
        return self._arrived((x_mm, y_mm, depth_mm))

    def lift(self) -> None:
        """Move straight up to the travel height.

        An interrupt may have discarded a reply, so the command is sent without waiting for earlier replies.
        """
        height_mm = self._known_origin()[2] + self._travel_mm
        start, self._at, sent_s = self._at, None, time.time()
        self._line.post(f"G1 Z{height_mm:.3f} {feed_word(self._speeds_mm_s[1])}")
        self._line.post("M400")
        self._line.post("M114")
        way_mm = 2 * (self.limits.deepest_mm + self._travel_mm)  # down, if that is pending, and up

        def is_up(line: str) -> bool:
            found = place_of(line)
            return found is not None and abs(found[0][2] - height_mm) < tolerance_mm(found[1])

        self._line.answers("the lift", takes_s=way_mm / self._speeds_mm_s[1], is_last=is_up)
        if self._sent is not None:
            self._sent = *self._sent[:2], -self._travel_mm
        if start is None:
            self._knots.append((time.time(), *NOWHERE))
        else:
            self._at = *start[:2], -self._travel_mm
            self._knots += leg(sent_s, time.time(), start, self._at, self._speeds_mm_s[1])

    def position(self) -> Position:
        """Position (x, y, depth) that the printer reports [mm].

        A coordinate that equals the target's within the last reported digit is replaced by the target's exact value.
        """
        return self._position()[0]

    def path(self) -> list[Knot]:
        """Knots of the tip's path since the last call, see `stage.TracedStage.path`."""
        found, self._knots = self._knots, []
        return [*found, (time.time(), *(self._at or NOWHERE))]

    def stop(self) -> None:
        """Stop the motion immediately (M410), then lift the tip."""
        self._at = None
        self._line.post("M410")
        self.lift()

    def _position(self) -> tuple[Position, float]:
        origin = self._known_origin()
        (x, y, z), step_mm = self._machine()
        told = x - origin[0], y - origin[1], origin[2] - z
        x, y, depth = (
            to if abs(at - to) <= step_mm + ROUNDING_MM else round(at, MM_DIGITS) + 0.0
            for at, to in zip(told, self._sent or (math.nan,) * 3, strict=True)
        )
        return (x, y, depth), step_mm

    def _lift_blindly(self) -> None:
        """Move straight up by more than the largest depth; used after a reset, when the position is unknown."""
        up_mm = self.limits.deepest_mm + self._travel_mm
        self._line.send("G91")
        self._at = None
        self._move(f"Z{up_mm:.3f}", up_mm, self._speeds_mm_s[1])
        self._line.send("G90")

    def _go(self, to_depth_mm: float) -> None:
        """Move vertically to a depth, slowly near and in the pad, and fast above."""
        x, y, depth = self._known_place()
        fast, slow = self._speeds_mm_s
        near = -NEAR_MM
        if min(depth, to_depth_mm) < near < max(depth, to_depth_mm):
            self._go(near)
            self._go(to_depth_mm)
        elif depth != to_depth_mm:
            speed = fast if max(depth, to_depth_mm) <= near else slow
            height = self._known_origin()[2] - to_depth_mm
            self._ride(f"Z{height:.3f}", (x, y, to_depth_mm), speed)

    def _slide(self, x_mm: float, y_mm: float) -> None:
        origin, depth = self._known_origin(), self._known_place()[2]
        words = f"X{origin[0] + x_mm:.3f} Y{origin[1] + y_mm:.3f}"
        self._ride(words, (x_mm, y_mm, depth), self._speeds_mm_s[0])

    def _ride(self, words: str, end: Position, speed_mm_s: float) -> None:
        start, self._at, sent_s = self._known_place(), None, time.time()
        self._move(words, math.dist(start, end), speed_mm_s)
        self._knots += leg(sent_s, time.time(), start, end, speed_mm_s)
        self._at = end

    def _move(self, words: str, way_mm: float, speed_mm_s: float) -> None:
        self._line.send(f"G1 {words} {feed_word(speed_mm_s)}")
        self._line.send("M400", takes_s=way_mm / speed_mm_s)

    def _known_place(self) -> Position:
        if self._at is None:
            self._at = self.position()
        return self._at

    def _arrived(self, target: Position) -> Position:
        self._sent = target
        found, step_mm = self._position()
        if math.dist(found, target) > tolerance_mm(step_mm):
            told = ", ".join(f"{value:.2f}" for value in found)
            wanted = ", ".join(f"{value:.2f}" for value in target)
            raise DeviceError(
                f"{self._name}: the printer is at x, y, depth {told} mm, but was sent to {wanted} mm: a limit of its "
                "own, or a stop; home it (--origin), or set the position of the tip again (--tip-at)"
            )
        return found

    def _machine(self) -> tuple[Position, float]:
        said = self._line.send("M114")
        places = [place for line in said if (place := place_of(line)) is not None]
        if not places:
            answer = " | ".join(said)[:SHOWN_CHARACTERS]
            raise DeviceError(
                f"{self._name}: the reply to M114 has no readable position, but is {answer!r}; a stage needs Marlin, "
                "Klipper, RepRapFirmware or Smoothie, and X, Y and Z in the coordinates of G1"
            )
        if places[-1][1] > COARSEST_MM:
            raise DeviceError(
                f"{self._name}: M114 gives whole millimetres; a stage needs one decimal at least"
            )
        return places[-1]  # an earlier one is an unrequested report

    def _known_origin(self) -> Position:
        if self._origin is None:
            raise DeviceError("the stage has no position of the pad; call home() or zero() first")
        if self._line.has_begun_anew:
            raise DeviceError(f"{self._name}: the printer restarted; its position is lost")
        return self._origin

    @property
    def _line(self) -> GcodeLine:
        if self._open_line is None:
            raise DeviceError("the stage is not open; use it as `with GcodeStage(...) as stage:`")
        return self._open_line


def tolerance_mm(step_mm: float) -> float:
    """Tolerance of a reported position [mm]; `step_mm` is the value of the last digit of position and origin [mm]."""
    return max(TOLERANCE_MM, 2.0 * step_mm + ROUNDING_MM)


def feed_word(speed_mm_s: float) -> str:
    """G-code word that sets a speed in mm/min, for example F300 for 5 mm/s.

    Decimals are kept, because rounding would change a slow speed considerably or make it 0.
    """
    return f"F{S_PER_MIN * speed_mm_s:.6g}"
