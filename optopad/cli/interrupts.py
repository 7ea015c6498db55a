"""Ctrl-C that is neither lost nor mistaken for a failure.

Three things may happen to the exception by which Python tells of Ctrl-C. In a destructor, or in the callback of a weak
reference, Python prints and drops it (collecting garbage takes a good part of the time of imports, plots and
compiling), and the work goes on as if nobody had asked it to stop: it is sent again. In an import, a package may take
it for a sign that another one is not installed, and do without (as trimesh without SciPy): it waits for the import's
end. And compiled packages, while they are loaded or call back, report it as a failure of their own ("initialization
failed", "invalid bounding box"): who explains a failure asks `has_arrived` first.

`kill` (SIGTERM) and a terminal that goes (SIGHUP, unless ignored as by `nohup`) are answered alike, so that nothing
hidden stays in the folder, the mold's process ends, too, and a stage does not leave its tip in the pad.
"""

from __future__ import annotations

import os
import signal
import sys
import time
from contextlib import suppress
from types import FrameType, TracebackType
from typing import NoReturn, Protocol

AGAIN_S = 0.01
"""Until Ctrl-C comes again: well after a destructor, and at once for a person."""
LONGEST_IMPORT_S = 5.0
"""So long Ctrl-C waits for an import's end."""
IMPORTING = "<frozen importlib._bootstrap>"

_arrived_s: list[float] = []


class _Unraisable(Protocol):
    exc_type: type[BaseException]
    exc_value: BaseException | None
    exc_traceback: TracebackType | None
    err_msg: str | None
    object: object


def listen() -> None:
    """Answer Ctrl-C, and `kill`, as above from now on; not where it is ignored, nor on a system without timers."""
    if signal.getsignal(signal.SIGINT) is not signal.default_int_handler or not hasattr(signal, "setitimer"):
        return
    former = sys.unraisablehook

    def hook(dropped: _Unraisable) -> None:
        if issubclass(dropped.exc_type, KeyboardInterrupt):
            _send_again()
        else:
            former(dropped)

    sys.unraisablehook = hook
    signal.signal(signal.SIGALRM, _answer)
    signal.signal(signal.SIGINT, _answer)
    signal.signal(signal.SIGTERM, _answer)
    if signal.getsignal(signal.SIGHUP) is signal.SIG_DFL:
        signal.signal(signal.SIGHUP, _answer)


def has_arrived() -> bool:
    """Whether Ctrl-C was pressed and not answered yet."""
    return bool(_arrived_s)


def answered() -> None:
    """Ctrl-C was a clean end of what it was meant for, as of a recording; what fails from here on is a failure."""
    _arrived_s.clear()


def be_deaf() -> None:
    """Take no further Ctrl-C: the outcome is known, and Python's own end, which takes a moment, does not change it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if hasattr(signal, "setitimer"):
        signal.setitimer(signal.ITIMER_REAL, 0.0)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    if hasattr(signal, "SIGHUP") and signal.getsignal(signal.SIGHUP) is _answer:
        signal.signal(signal.SIGHUP, signal.SIG_DFL)


def leave(code: int) -> NoReturn:
    """End the process at once: Python would wait for threads, and for some interrupts die of the signal after all."""
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError):  # who read a pipe may be gone
            stream.flush()
    os._exit(code)


def _answer(_number: int, frame: FrameType | None) -> None:
    _arrived_s.append(time.monotonic())
    if _is_importing(frame) and _arrived_s[-1] - _arrived_s[0] < LONGEST_IMPORT_S:
        _send_again()
    else:
        raise KeyboardInterrupt


def _send_again() -> None:
    signal.setitimer(signal.ITIMER_REAL, AGAIN_S)


def _is_importing(frame: FrameType | None) -> bool:
    while frame is not None:
        if frame.f_code.co_filename == IMPORTING:
            return True
        frame = frame.f_back
    return False
