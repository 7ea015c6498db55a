"""Connects a simulated device to a port: a pseudo-terminal or, on Windows, which has none, a local socket.

Opening the port resets the board, as on an Arduino. A host that does not read loses bytes, as on a serial line.
"""

from __future__ import annotations

import contextlib
import os
import select
import socket
import threading
import time
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from optopad.design.errors import DeviceError, InputError

if TYPE_CHECKING:
    from typing_extensions import Self  # in typing from Python 3.11

IDLE_S = 0.02
"""Interval at which a port is polled while no host has it open [s]."""

LONGEST_WAIT_S = 0.05
LARGEST_READ = 4096
QUEUE_BYTES = 16384
"""Number of bytes queued for a slow host above which new messages are discarded."""


class Device(Protocol):
    """Interface of a simulated device on a port; its methods take bytes and times [s] and return bytes."""

    @property
    def due_s(self) -> float:
        """Time of the next message that the device sends without a request [s]."""

    def reset(self, now_s: float) -> None:
        """Restart the device at time `now_s` [s], because the port was opened."""

    def spoken(self, now_s: float) -> bytes:
        """Bytes that the device sends without a request at time `now_s` [s]; may be empty."""

    def heard(self, piece: bytes, now_s: float) -> bytes:
        """Process bytes from the host at time `now_s` [s] and return the reply."""


def queued(unsent: bytes, sent: bytes) -> bytes:
    """Bytes to send next: those not yet sent and, unless they are more than 16 KiB, the new message `sent`."""
    return unsent if len(unsent) > QUEUE_BYTES else unsent + sent


class Wire(Protocol):
    """The device's end of a simulated line, and the port's name for the host."""

    name: str

    def is_open(self) -> bool:
        """Whether a host has the other end open."""

    def exchange(self, sent: bytes, wait_s: float) -> bytes:
        """Send the bytes that the host accepts, wait up to `wait_s` for bytes from the host [s], and return these."""

    def close(self) -> None:
        """Close the device's end; to the host, the board appears to be unplugged."""


class PtyWire:
    """The device's end of a pseudo-terminal; the host opens its `name`.

    Parameters
    ----------
    link : path of a symbolic link that gives the pseudo-terminal a fixed name; if None, no link is made
    """

    def __init__(self, link: Path | None = None) -> None:
        import pty
        import tty

        self._master, slave = pty.openpty()
        tty.setraw(slave)
        self._system_name = os.ttyname(slave)
        os.close(slave)
        os.set_blocking(self._master, False)
        self._link = link
        self._heard = self._unsent = b""
        self.name = self._system_name if link is None else str(link)
        if link is not None:
            _point(link, self._system_name)

    def is_open(self) -> bool:
        """Whether a host has the pseudo-terminal open."""
        try:
            piece = os.read(self._master, LARGEST_READ)
        except BlockingIOError:
            return True
        except OSError:  # EIO: no one has the other side open
            self._unsent = b""
            return False
        self._heard += piece
        return bool(piece)

    def exchange(self, sent: bytes, wait_s: float) -> bytes:
        """Send the bytes that the system's buffer accepts, wait up to `wait_s` [s], and return the host's bytes.

        The remaining bytes are sent in the next call.
        """
        self._unsent = queued(self._unsent, sent)
        if self._unsent:
            with contextlib.suppress(OSError):
                self._unsent = self._unsent[os.write(self._master, self._unsent) :]
        heard, self._heard = self._heard, b""
        if heard or not select.select([self._master], [], [], wait_s)[0]:
            return heard
        try:
            return os.read(self._master, LARGEST_READ)
        except OSError:
            time.sleep(IDLE_S)  # the host has left: select returns at once from now on
            return b""

    def close(self) -> None:
        """Unplug the board. The symbolic link is removed first, because the system may reuse the port's name."""
        if (
            self._link is not None
            and self._link.is_symlink()
            and os.readlink(self._link) == self._system_name
        ):
            self._link.unlink()
        os.close(self._master)


class SocketWire:
    """A socket that listens only on this computer; the host opens `socket://localhost:<port>`."""

    def __init__(self, port: int = 0) -> None:
        try:
            self._listener = socket.create_server(("127.0.0.1", port))
        except OSError as err:
            raise DeviceError(
                f"socket {port}: cannot be opened here: {err.strerror}; choose another"
            ) from err
        self._listener.setblocking(False)
        self._host: socket.socket | None = None
        self._unsent = b""
        self.name = f"socket://localhost:{self._listener.getsockname()[1]}"

    def is_open(self) -> bool:
        """Whether a host is connected."""
        if self._host is None:
            try:
                self._host, _ = self._listener.accept()
            except BlockingIOError:
                return False
            self._host.setblocking(False)
            self._host.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        return True

    def exchange(self, sent: bytes, wait_s: float) -> bytes:
        """Send the bytes that the host accepts, wait up to `wait_s` [s], and return the host's bytes.

        The remaining bytes are sent in the next call.
        """
        host = self._host
        if host is None:
            return b""
        self._unsent = queued(self._unsent, sent)
        try:
            if self._unsent:
                self._unsent = self._unsent[host.send(self._unsent) :]
            if not select.select([host], [], [], wait_s)[0]:
                return b""
            heard = host.recv(LARGEST_READ)
        except BlockingIOError:
            return b""
        except OSError:
            heard = b""
        if not heard:
            host.close()
            self._host, self._unsent = None, b""
        return heard

    def close(self) -> None:
        """Unplug the board."""
        if self._host is not None:
            self._host.close()
        self._listener.close()


def new_wire(*, use_socket: bool = False, link: Path | None = None) -> Wire:
    """A pseudo-terminal, or a socket if it is requested or if the system has no pseudo-terminals."""
    if use_socket or os.name != "posix":
        if link is not None:
            raise InputError("--link: names a pseudo-terminal; leave it out with a socket")
        return SocketWire()
    return PtyWire(link)


def serve(board: Device, wire: Wire, is_over: threading.Event) -> None:
    """Run a simulated device on its end of a line until `is_over` is set."""
    was_open = False
    while not is_over.is_set():
        if not wire.is_open():
            was_open = False
            is_over.wait(IDLE_S)
            continue
        if not was_open:
            was_open = True
            board.reset(time.monotonic())
        now_s = time.monotonic()
        sent = board.spoken(now_s)
        wait_s = min(max(board.due_s - time.monotonic(), 0.0), LONGEST_WAIT_S)
        heard = wire.exchange(sent, wait_s)
        while heard:
            heard = wire.exchange(board.heard(heard, time.monotonic()), 0.0)


class FakePort:
    """A port with a simulated board, which the host can open under `name` while the `with` block runs.

    Parameters
    ----------
    board : the simulated device
    wire : the device's end of the line; if None, a pseudo-terminal is made, or a socket if the system has none
    """

    def __init__(self, board: Device, wire: Wire | None = None) -> None:
        self._board = board
        self._wire = wire or new_wire()
        self._over = threading.Event()
        self._thread = threading.Thread(
            target=serve, args=(board, self._wire, self._over), name="optopad fake board", daemon=True
        )

    @property
    def name(self) -> str:
        """Name of the port for the host."""
        return self._wire.name

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.unplug()

    def unplug(self) -> None:
        """Remove the port, even while the host has it open; a second call has no effect."""
        if self._thread.is_alive():
            self._over.set()
            self._thread.join()
            self._wire.close()


def require_free(link: Path, option: str = "--link") -> None:
    """Check that a name is available for the symbolic link to a simulated port.

    A broken link left behind by an earlier run may be replaced.

    Raises
    ------
    InputError : a file or another board's link has this name, or the folder does not exist.
    """
    if link.exists() and not link.is_symlink():
        raise InputError(f"{option} {link}: exists and is no link; choose another name")
    if not link.absolute().parent.is_dir():
        raise InputError(
            f"{option} {link}: cannot be made: {link.absolute().parent} is no folder; choose another"
        )
    if link.exists():
        raise InputError(
            f"{option} {link}: leads to {os.readlink(link)}, probably another simulated board; end that "
            "one, choose another name, or remove the link if no board runs"
        )


def _point(link: Path, target: str) -> None:
    require_free(link)
    link.unlink(missing_ok=True)
    try:
        link.symlink_to(target)
    except OSError as err:
        raise InputError(f"--link {link}: cannot be made: {err.strerror}; choose another folder") from None
