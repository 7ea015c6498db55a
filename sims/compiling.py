"""Progress of compiling kernels: once per machine, and again after a change of a source, numba or the processor.

A progress display registers a callback; rooms with compiled code listen to numba's events of compiling. Code read from
numba's cache on disk is not compiled, so there is no event. Nothing here imports numba before it is needed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

LAST = ("trace_further", "trace_emitter", "next_path", "straight_matrix")
"""Entry points that are called after all others of their kind of pad, or of the ray tracer."""

_TOLD = set(LAST)
"""Entry points, which take long; functions compiled for a caller in Python take less than a second."""
_ASKED: list[_Word] = []
_LISTENERS: list[Any] = []
"""The listener, at most one."""


class _Word:
    """State of one callback."""

    def __init__(self, tell: Callable[[float], None]) -> None:
        self.tell, self.share = tell, 1.0

    def say(self, share: float) -> None:
        if share != self.share:
            self.share = share
            self.tell(share)


@contextmanager
def compiling_told(tell: Callable[[float], None]) -> Iterator[None]:
    """Within this context, call `tell` with 0 when compiling begins and with 1 when it is done."""
    word = _Word(tell)
    _ASKED.append(word)
    try:
        yield
    finally:
        _ASKED.remove(word)
        word.say(1.0)


def listen_to_numba() -> None:
    """Forward numba's own events; modules with compiled entry points call it, any number of times."""
    from numba.core import event

    class Listener(event.Listener):
        def on_start(self, event: Any) -> None:
            if event.data["dispatcher"].py_func.__name__ in _TOLD:
                _say(0.0)

        def on_end(self, event: Any) -> None:
            is_there(event.data["dispatcher"].py_func.__name__)

    if not _LISTENERS:
        _LISTENERS.append(Listener())
        event.register("numba:compile", _LISTENERS[0])  # type: ignore[no-untyped-call]


def tell_of(entry_point: str) -> None:
    """Report the compiling of this function, too."""
    _TOLD.add(entry_point)


def is_there(entry_point: str) -> None:
    """An entry point is compiled, by this process or by another one."""
    if entry_point in LAST:
        _say(1.0)


def _say(share: float) -> None:
    for word in _ASKED:
        word.say(share)
