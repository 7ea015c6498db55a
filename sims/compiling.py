"""Report when kernels are compiled: once per machine, and again after a change of a source, numba or the processor.

A progress display registers a callback. Modules with compiled code forward numba's compiling events to it. Code that is
read from numba's cache on disk is not compiled, so it causes no event. Nothing here imports numba before it is needed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

LAST = ("trace_further", "trace_emitter", "next_path", "straight_matrix")
"""The last entry points that each kind of pad and the ray tracer call; when one is compiled, compiling is done."""

_TOLD = set(LAST)
"""Names of the entry points whose compiling is reported. Others take less than a second."""
_ASKED: list[_Word] = []
_LISTENERS: list[Any] = []
"""The listener to numba's events; empty, or one entry."""


class _Word:
    """A callback and the last value that it was called with, so that it is not called twice with the same value."""

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
    """Report numba's compiling events to the callbacks; modules with entry points call it, any number of times."""
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
    """Report the compiling of this entry point, too."""
    _TOLD.add(entry_point)


def is_there(entry_point: str) -> None:
    """Note that an entry point is compiled, by any process; after the last one, report the end of compiling."""
    if entry_point in LAST:
        _say(1.0)


def _say(share: float) -> None:
    for word in _ASKED:
        word.say(share)
