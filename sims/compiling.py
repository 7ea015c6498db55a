"""Report when kernels are compiled: once per machine, and again when the sources, numba or the processor change.

A progress display registers a callback. Modules with compiled code forward numba's compile events to it. Code that is
read from numba's cache on disk is not compiled, so it causes no event. This module imports numba only when needed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

LAST = ("trace_further", "trace_emitter", "next_path", "straight_matrix")
"""For each type of pad, and for the ray tracer, name of the entry point that is compiled last."""

_TOLD = set(LAST)
"""Names of the entry points whose compilation is reported. Others compile in less than a second."""
_ASKED: list[_Word] = []
_LISTENERS: list[Any] = []
"""The listener to numba's events; empty until it is registered."""


class _Word:
    """A callback and the last value passed to it, so that it is not called twice in a row with the same value."""

    def __init__(self, tell: Callable[[float], None]) -> None:
        self.tell, self.share = tell, 1.0

    def say(self, share: float) -> None:
        if share != self.share:
            self.share = share
            self.tell(share)


@contextmanager
def compiling_told(tell: Callable[[float], None]) -> Iterator[None]:
    """`with` block in which `tell` is called with 0 when compilation begins and with 1 when it ends."""
    word = _Word(tell)
    _ASKED.append(word)
    try:
        yield
    finally:
        _ASKED.remove(word)
        word.say(1.0)


def listen_to_numba() -> None:
    """Forward numba's compile events to the callbacks; every module with entry points may call this."""
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
    """Report the compilation of this entry point, too."""
    _TOLD.add(entry_point)


def is_there(entry_point: str) -> None:
    """Note that this or another process has compiled an entry point. After the last one, report that all are done."""
    if entry_point in LAST:
        _say(1.0)


def _say(share: float) -> None:
    for word in _ASKED:
        word.say(share)
