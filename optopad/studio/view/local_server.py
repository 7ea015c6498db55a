"""The page's server, which accepts only this machine and this page.

viser serves its page and its websocket to any client, including any other web page that the user has open. Every
request and handshake is therefore checked before viser receives it. It must name the served address, because a foreign
name may resolve to this machine. It must come from this page or from no page, and it must contain a random token that
is part of the address.
"""

from __future__ import annotations

import contextlib
import ctypes
import gc
import io
import logging
import secrets
import socket
import sys
import threading
from collections.abc import Iterator
from functools import partial
from http import HTTPStatus
from typing import Any

import viser
import websockets.asyncio.server
from websockets.asyncio.server import ServerConnection
from websockets.frames import CloseCode
from websockets.http11 import Request, Response

from optopad.design.errors import InputError
from optopad.studio.view.shapes import LARGEST_B, LARGEST_PICTURE_B, fault_of

HOST = "127.0.0.1"
FIRST_PORT, PORTS = 8080, 50
LARGEST_MESSAGE_B = LARGEST_PICTURE_B + 2**10
COLLECT_S = 1.0
"""Delay between the end of a connection with large messages and the release of their memory [s]."""

_LOG = logging.getLogger(__name__)
_LOG.addFilter(lambda record: record.getMessage() != "opening handshake failed")
"""Connections without a valid request, such as those of a port scan, are not reported."""
_PATCHING = threading.Lock()


class LocalServer(viser.ViserServer):
    """A viser server for one page on this machine, never shared beyond it.

    Parameters
    ----------
    port : port to serve at; 0 for any free port

    Attributes
    ----------
    token : first part of the address's path; requests without the token are refused

    Raises
    ------
    InputError : this version of viser does not allow the requests to be checked.
    """

    def __init__(self, port: int) -> None:
        self.token = secrets.token_urlsafe(24)
        self.is_checked = False
        with self._checked(), contextlib.redirect_stdout(io.StringIO()):  # viser would print its own address
            super().__init__(host=HOST, port=port, label="optopad studio", verbose=False)
        if not self.is_checked:
            self.stop()
            raise InputError(
                f"studio: viser {viser.__version__} is refused: the studio cannot check the origin of "
                "requests; install the version in constraints.txt"
            )

    @property
    def url(self) -> str:
        """Address of the page, with its token."""
        return f"http://{HOST}:{self.get_port()}/{self.token}/"

    def request_share_url(self, verbose: bool = True) -> str | None:  # noqa: ARG002
        """Do nothing: viser would open a tunnel to the internet."""
        return None

    def fault_of(self, raw: str | bytes) -> str | None:
        """The reason why a message of the page is refused, in one line; None if it is accepted."""
        return fault_of(raw, self.gui._gui_input_handle_from_uuid)

    @contextlib.contextmanager
    def _checked(self) -> Iterator[None]:
        """Context in which viser starts its server with `_Connection`, which checks every request."""
        serve = websockets.asyncio.server.serve

        def checked(*arguments: Any, **options: Any) -> Any:
            self.is_checked = True
            own = {
                "create_connection": partial(_Connection, self),
                "max_size": LARGEST_MESSAGE_B,
                "logger": _LOG,
            }
            return serve(*arguments, **options | own)

        with _PATCHING:
            try:
                setattr(websockets.asyncio.server, "serve", checked)  # noqa: B010  (mypy takes no other function)
                yield
            finally:
                setattr(websockets.asyncio.server, "serve", serve)  # noqa: B010


class _Connection(ServerConnection):
    """A connection to the page's server that refuses foreign requests, and messages that the page does not send."""

    def __init__(self, page: LocalServer, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self._page, self._is_large = page, False

    async def handshake(self, process_request: Any = None, *more: Any, **options: Any) -> None:
        """Check the request, then let viser answer it; the token is removed from the path."""

        def checked(connection: ServerConnection, request: Request) -> Response | None:
            first, _, rest = request.path.removeprefix("/").partition("?")[0].partition("/")
            refusal = self._refusal(request, first)
            if refusal is not None:
                return connection.respond(HTTPStatus.FORBIDDEN, refusal + "\n")
            request.path = f"/{rest}"
            answer: Response | None = process_request(connection, request)
            return answer

        await super().handshake(checked, *more, **options)

    def _refusal(self, request: Request, token: str) -> str | None:
        """The reason why a request is refused, in one line; None if it is from this page."""
        port = self.local_address[1]
        here = [f"{name}:{port}" for name in (HOST, "localhost", "[::1]")]
        hosts = [host.lower() for host in request.headers.get_all("Host")]
        origins = request.headers.get_all("Origin")
        if len(hosts) != 1 or hosts[0] not in here:
            return f"Host {', '.join(hosts)} is refused: the studio is at {here[0]} alone."
        if origins and origins != [f"http://{hosts[0]}"]:
            return f"Origin {', '.join(origins)} is refused: only the studio's own page is accepted."
        is_known = secrets.compare_digest(token.encode(errors="surrogateescape"), self._page.token.encode())
        return None if is_known else "No or a wrong token: open the address that the studio printed."

    async def recv(self, decode: bool | None = None) -> Any:
        """The page's next message; an invalid one is reported in one line on standard error and ends the connection."""
        raw = await super().recv(decode)
        self._is_large |= len(raw) > LARGEST_B
        fault = self._page.fault_of(raw)
        if fault is None:
            return raw
        _say_refused(fault)
        await self.close(CloseCode.POLICY_VIOLATION, "the message is refused; the terminal shows the reason")
        raise self.protocol.close_exc

    def connection_lost(self, exc: Exception | None) -> None:
        """Report a message that was too large to be received, and free the memory of large messages."""
        super().connection_lost(exc)
        if self._is_large:
            self.loop.call_later(COLLECT_S, _free)
        sent = self.protocol.close_sent
        if sent is not None and sent.code == CloseCode.MESSAGE_TOO_BIG:
            _say_refused(f"it is larger than {LARGEST_MESSAGE_B} bytes")


def _free() -> None:
    """Free memory: reference cycles of viser's ended tasks, and unused pages of the C library."""
    gc.collect()
    with contextlib.suppress(OSError, AttributeError, TypeError):  # only the GNU C library has it
        ctypes.CDLL(None).malloc_trim(0)


def _say_refused(why: str) -> None:
    print(f"studio: a message of the page is refused: {why}", file=sys.stderr)


def local_server(port: int | None) -> LocalServer:
    """A server at the given port or, if it is None, at the first free port from 8080 on.

    Raises
    ------
    InputError : the port is taken, or none is free.
    """
    wanted = free_port(port)
    server = LocalServer(wanted)
    if wanted and server.get_port() != wanted:  # another program was faster
        server.stop()
        raise InputError(f"--port: {wanted} is taken on this machine; choose another, or leave it out")
    return server


def free_port(wanted: int | None) -> int:
    """The given port, which must be free; if it is None, the first free port from 8080 on.

    Raises
    ------
    InputError : the port is taken, or none is free.
    """
    if wanted is not None:
        if wanted != 0 and not _is_free(wanted):
            raise InputError(f"--port: {wanted} is taken on this machine; choose another, or leave it out")
        return wanted
    for port in range(FIRST_PORT, FIRST_PORT + PORTS):
        if _is_free(port):
            return port
    raise InputError(f"--port: {FIRST_PORT} to {FIRST_PORT + PORTS - 1} are all taken; name a free one")


def _is_free(port: int) -> bool:
    with socket.socket() as trial:
        trial.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            trial.bind((HOST, port))
        except (OSError, OverflowError):
            return False
    return True
