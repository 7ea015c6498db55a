"""Finds serial ports by USB identity, opens and reads them, and explains errors of the operating system.

A port is given by its system name (`/dev/ttyACM0`, `COM3`), the name of a pseudo-terminal, or a pyserial URL
(`socket://localhost:4242`). Opening the port of an Arduino resets the board.
"""

from __future__ import annotations

import contextlib
import errno
import os
import sys
import time
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import serial
from serial.tools import list_ports

from optopad.design.errors import DeviceError
from optopad.fabrication.driver_file import BoardSetup

if TYPE_CHECKING:
    from typing_extensions import Self  # in typing from Python 3.11

WAIT_S = 0.1
"""Longest wait for the first byte in one read, and so about the longest delay after a request to stop [s]."""

GATHER_S = 0.005
"""Time for which a read waits for more bytes after the first [s]; each wake-up costs 0.2 to 0.5 ms of CPU time."""

WRITE_WAIT_S = 1.0
LARGEST_READ = 65536
SOCKET = "socket://"


class PortLostError(DeviceError):
    """The port was lost while it was open: unplugged, or the other end closed."""


@dataclass(frozen=True, kw_only=True)
class FoundPort:
    """A serial port of this computer.

    Attributes
    ----------
    usb_id : USB "vendor:product"; "" if the port is not of a USB device
    title : the system's description; "" if there is none
    serial_number : serial number of the USB device; "" if it has none, as many copies of boards
    """

    name: str
    usb_id: str
    title: str
    serial_number: str = ""

    def __str__(self) -> str:
        known = self.usb_id, self.title, self.serial_number and SERIAL + self.serial_number
        return f"{self.name} ({' '.join(filter(None, known)) or 'no USB device'})"


def ports_here() -> list[FoundPort]:
    """All serial ports that the system lists."""
    return [
        FoundPort(
            name=port.device,
            usb_id="" if port.vid is None else f"{port.vid:04x}:{port.pid:04x}",
            title="" if port.description in (None, "n/a") else port.description,
            serial_number=port.serial_number or "",
        )
        for port in list_ports.comports()
    ]


PTY_BAUD = 115200
"""Baud rate set on a pseudo-terminal, where it has no effect; macOS accepts only the old standard rates."""


CHIP_MAKERS = frozenset({"0403", "067b", "10c4", "1a86"})
"""USB vendors of serial chips used in many types of devices: FTDI, Prolific, Silicon Labs, QinHeng (CH340)."""


GUESSED = "Only the serial chip identifies this port, and printers and other devices have the same chip."


def is_guess(port: FoundPort, board: BoardSetup) -> bool:
    """Whether a port is identified only by a type of serial chip that other devices, such as printers, also have."""
    return port.usb_id not in board.usb_ids or port.usb_id.partition(":")[0] in CHIP_MAKERS


SERIAL = "serial:"
"""Beginning of a port's name that gives the serial number of its USB device instead of a system's name."""


def port_of_serial(name: str, ports: Iterable[FoundPort] | None = None) -> str:
    """The system's name of a port that is given as ``serial:NUMBER``; other names are returned unchanged.

    Unlike the system's names, the serial number stays the same when boards are plugged in in another order.

    Parameters
    ----------
    ports : ports to choose from; if None, all ports of the system

    Raises
    ------
    DeviceError : no port or several ports have the number; the message lists the ports.
    """
    if not name.startswith(SERIAL):
        return name
    here = ports_here() if ports is None else list(ports)
    matching = [
        port for port in here if port.serial_number and port.serial_number == name.removeprefix(SERIAL)
    ]
    if len(matching) > 1:
        raise DeviceError(
            f"{len(matching)} devices have the serial number of --port {name}: {_listed(matching)}; name a port"
        )
    if not matching:
        raise DeviceError(f"no device has the serial number of --port {name}; ports here: {_listed(here)}")
    return matching[0].name


def serial_number_of(name: str) -> str:
    """Serial number of the USB device at a port that the system lists; "" if it has none, or is not listed."""
    return next(
        (port.serial_number for port in ports_here() if plain_name(port.name) == plain_name(name)), ""
    )


def find_port(
    board: BoardSetup, ports: Iterable[FoundPort] | None = None, *, not_ports: Iterable[str] = ()
) -> FoundPort:
    """The only port with a board of this type, found by the USB identity of the original board, or else of copies.

    Parameters
    ----------
    ports : ports to choose from; if None, all ports of the system
    not_ports : names of ports to exclude, because other devices use them

    Raises
    ------
    DeviceError : no port or several ports match; the message lists the ports.
    """
    taken = {plain_name(name) for name in not_ports}
    here = ports_here() if ports is None else list(ports)
    free = [port for port in here if plain_name(port.name) not in taken]
    for wanted in (board.usb_ids, board.bridge_usb_ids):
        matching = [port for port in free if port.usb_id in wanted]
        if len(matching) == 1:
            return matching[0]
        if matching:
            raise DeviceError(
                f"{len(matching)} ports look like {board.title}: {_listed(matching)}; name one with --port (port=)"
            )
    raise DeviceError(
        f"no {board.title} found by its USB identity; ports here: {_listed(here)}; plug it in (a charging cable has no "
        "data lines), or name the port with --port (port=)"
    )


def on_standard_error(line: str) -> None:
    """Print a progress line to standard error; the default for the `on_wait` parameters."""
    print(line, file=sys.stderr)


class Port:
    """An open serial line.

    Parameters
    ----------
    name : name of the port, a pyserial URL, or ``serial:`` and the serial number of a USB device
    baud : baud rate of the line
    gather_s : time to wait for more bytes after the first [s]

    Raises
    ------
    DeviceError : the port does not exist, is in use, is not a serial port, or the user lacks permission. The message
        says what to do.
    """

    def __init__(self, name: str, baud: int, gather_s: float = GATHER_S) -> None:
        name = port_of_serial(name)
        self.name = name
        self._gather_s = gather_s
        self._is_socket = name.startswith(SOCKET)
        self._line = _opened(name, baud)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def read(self) -> bytes:
        """Bytes that have arrived, possibly none.

        The read waits at most `WAIT_S` for the first byte, then `gather_s` for more.

        Raises
        ------
        PortLostError : the port is lost.
        """
        try:
            return self._read_socket() if self._is_socket else self._read_line()
        except (OSError, serial.SerialException) as err:
            raise self._lost(err) from err

    def write(self, message: bytes) -> None:
        """Send bytes; raises PortLostError if the port is lost or does not accept them."""
        try:
            self._line.write(message)
        except (OSError, serial.SerialException) as err:
            raise self._lost(err) from err

    def set_baud(self, baud: int) -> None:
        """Change the baud rate without reopening the port, which would reset the board; raises DeviceError on
        failure."""
        try:
            self._line.baudrate = baud
        except (OSError, ValueError) as err:
            if getattr(err, "errno", None) != errno.ENOTTY:
                raise DeviceError(f"{self.name}: {_why_not(self.name, err, baud)}") from err

    def close(self) -> None:
        """Close the port; no error is raised if it was lost."""
        try:
            self._line.close()
        except (OSError, serial.SerialException):
            return  # nothing remains to close

    def _read_line(self) -> bytes:
        first: bytes = self._line.read(1)
        if not first:
            return first
        time.sleep(self._gather_s)
        waiting = self._line.in_waiting
        rest: bytes = self._line.read(waiting) if waiting else b""
        return first + rest

    def _read_socket(self) -> bytes:
        """Read one byte from a socket, then all waiting bytes, because a socket does not report their number."""
        self._line.timeout = WAIT_S
        first: bytes = self._line.read(1)
        if not first:
            return first
        time.sleep(self._gather_s)
        self._line.timeout = 0
        rest: bytes = self._line.read(LARGEST_READ)
        return first + rest

    def _lost(self, err: Exception) -> PortLostError:
        return PortLostError(f"{self.name}: the port was lost: {err}; plug the board in again")


def _opened(name: str, baud: int) -> Any:
    options: dict[str, Any] = {"baudrate": baud, "timeout": WAIT_S}
    if not name.startswith((SOCKET, "loop://")):
        options |= {"write_timeout": WRITE_WAIT_S} | ({"exclusive": True} if os.name == "posix" else {})
    try:
        return serial.serial_for_url(name, **options)
    except (OSError, ValueError) as err:  # pyserial's own error is an OSError
        if getattr(err, "errno", None) == errno.ENOTTY:
            with contextlib.suppress(OSError, ValueError):
                return serial.serial_for_url(name, **(options | {"baudrate": PTY_BAUD}))
        raise DeviceError(f"{name}: {_why_not(name, err, baud)}") from err


def _why_not(name: str, err: Exception, baud: int) -> str:
    code = getattr(err, "errno", None)
    text = str(err)
    if code == errno.EACCES or "PermissionError" in text or "Access is denied" in text:
        return (
            "no permission to open it; on Linux `sudo usermod -a -G dialout $USER`, then log in again; "
            "elsewhere close the program that uses it"
        )
    if code == errno.ENOENT or "FileNotFoundError" in text:
        return f"no such port; ports here: {_listed(ports_here())}"
    if code in (errno.EBUSY, errno.EAGAIN) or "exclusively lock" in text:
        return "in use by another program; close it (the Arduino IDE's serial monitor, another reader)"
    if code in (errno.ENOTTY, errno.EINVAL, errno.EISDIR) or "Could not configure" in text:
        return f"is no serial port that does {baud} baud; ports here: {_listed(ports_here())}"
    if name.startswith(SOCKET):
        return f"no reply there ({text}); start `optopad driver fake` first"
    return f"cannot be opened: {text}"


def plain_name(name: str) -> str:
    """A port's name with symbolic links resolved, so that different names of the same port become equal."""
    return os.path.normcase(os.path.realpath(name) if os.path.exists(name) else name)


def _listed(ports: Iterable[FoundPort]) -> str:
    return ", ".join(map(str, ports)) or "none"
