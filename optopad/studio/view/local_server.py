"""The page's server: this machine alone, on a port of its own."""

from __future__ import annotations

import contextlib
import io
import socket

import viser

from design.errors import InputError

HOST = "127.0.0.1"
FIRST_PORT, PORTS = 8080, 50


class LocalServer(viser.ViserServer):
    """A viser server that is never shared beyond this machine."""

    def request_share_url(self, verbose: bool = True) -> str | None:  # noqa: ARG002
        """Refuse: viser would open a tunnel to the internet."""
        return None


def local_server(port: int | None) -> LocalServer:
    """A server on a port, or on the first free one from 8080 on.

    Raises
    ------
    InputError : the port is taken, or none is free.
    """
    wanted = free_port(port)
    with contextlib.redirect_stdout(
        io.StringIO()
    ):  # viser draws a box with the address, which our own line tells
        server = LocalServer(host=HOST, port=wanted, label="optopad studio", verbose=False)
    if wanted and server.get_port() != wanted:  # somebody was quicker
        server.stop()
        raise InputError(f"--port: {wanted} is taken on this machine; choose another, or leave it out")
    return server


def free_port(wanted: int | None) -> int:
    """The wanted port if it is free, or the first free one.

    Raises
    ------
    InputError : it is taken, or none is free.
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
