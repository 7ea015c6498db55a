"""Handling of Ctrl-C, so that it is neither lost nor reported as a failure.

Python reports Ctrl-C by the exception KeyboardInterrupt, which can be lost in three cases:

- In a destructor, or in the callback of a weak reference, Python prints and drops the exception. Ctrl-C is sent again.
- In an import, a package may conclude that another package is not installed, and continue without it. The exception is
  delayed until the end of the import.
- Compiled packages may report Ctrl-C as a failure of their own ("initialization failed", "invalid bounding box"). Code
  that explains a failure checks `has_arrived` first.

A thread watches whether the main thread responds within `PATIENCE_S`. If the main thread waits for other threads at the
end of a `with` block, Ctrl-C is sent again, which ends the waiting. If the main thread is in compiled code of a
computation, which Python cannot interrupt, the process removes the folders of unfinished work, ends the processes that
it started, and ends at once.

`kill` (SIGTERM) and a closed terminal (SIGHUP, unless ignored as by `nohup`) are handled in the same way, so no hidden
files or processes remain, and a stage does not leave its tip in the pad.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from contextlib import suppress
from pathlib import Path
from types import FrameType
from typing import NoReturn

AGAIN_S = 0.01
"""Delay after which a lost Ctrl-C is sent again [s]: longer than a destructor runs, but not noticed by a person."""
LONGEST_IMPORT_S = 1.5
"""Longest time for which the handling of Ctrl-C is delayed until an import ends [s]."""
INTERRUPTED = 130
"""Exit code of an interrupted command."""
PATIENCE_S = 1.2
"""Time within which the main thread must respond to Ctrl-C [s]; then the process is ended or Ctrl-C sent again."""
IMPORTING = "<frozen importlib._bootstrap>"
ROOT = Path(__file__).parents[1]
COMPUTING = tuple(f"{ROOT / room}{os.sep}" for room in ("sims", "cad", "design"))
"""Folders of code that Ctrl-C may end at any point: this code moves no stage, and replaces files only as a whole."""
OURS = f"{ROOT}{os.sep}"
WAITING = (
    os.path.join("concurrent", "futures", "thread.py"),
    os.path.join("concurrent", "futures", "_base.py"),
)

DEAF = float("inf")

_arrived_s: list[float] = []
_answered_s: list[float] = [-1.0]
"""Time of the last Ctrl-C that reached the main thread [s]; a list of one number."""


def listen() -> None:
    """Install the handlers of Ctrl-C and `kill`, unless Ctrl-C is ignored or the system has no timers."""
    if signal.getsignal(signal.SIGINT) is not signal.default_int_handler or not hasattr(signal, "setitimer"):
        return
    former = sys.unraisablehook

    def hook(dropped: sys.UnraisableHookArgs) -> None:
        if issubclass(dropped.exc_type, KeyboardInterrupt):
            _send_again()
        else:
            former(dropped)

    sys.unraisablehook = hook
    reading, writing = os.pipe()
    os.set_blocking(writing, False)
    signal.set_wakeup_fd(
        writing, warn_on_full_buffer=False
    )  # written to even if Python's own handler has to wait
    threading.Thread(target=_watch, args=(reading,), name="optopad interrupts", daemon=True).start()
    signal.signal(signal.SIGALRM, _answer)
    signal.signal(signal.SIGINT, _answer)
    signal.signal(signal.SIGTERM, _answer)
    if signal.getsignal(signal.SIGHUP) is signal.SIG_DFL:
        signal.signal(signal.SIGHUP, _answer)


def has_arrived() -> bool:
    """Whether Ctrl-C was pressed and is not handled yet."""
    return bool(_arrived_s)


def answered() -> None:
    """Mark Ctrl-C as handled, because it regularly ended a task such as a recording; later errors are failures."""
    _arrived_s.clear()


def be_deaf() -> None:
    """Ignore further Ctrl-C, because the command is done and the Python process is ending."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _answered_s[0] = DEAF
    if hasattr(signal, "setitimer"):
        signal.setitimer(signal.ITIMER_REAL, 0.0)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    if hasattr(signal, "SIGHUP") and signal.getsignal(signal.SIGHUP) is _answer:
        signal.signal(signal.SIGHUP, signal.SIG_DFL)


def say() -> None:
    """Print the message that the command was interrupted."""
    print("optopad: interrupted: no file is incomplete, and finished parts are reused", file=sys.stderr)


def leave(code: int) -> NoReturn:
    """End the process at once with an exit code, without waiting for threads."""
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError):  # the reader of a pipe may have ended
            stream.flush()
    os._exit(code)


def _answer(_number: int, frame: FrameType | None) -> None:
    _answered_s[0] = time.monotonic()
    _arrived_s.append(_answered_s[0])
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


def _watch(reading: int) -> None:
    """Act on each Ctrl-C that the main thread does not handle in time; runs in its own thread."""
    while os.read(reading, 1):
        came_s = time.monotonic()
        time.sleep(PATIENCE_S)
        if _answered_s[0] < came_s - AGAIN_S:  # the main thread has not returned to Python since
            _end_compiled()
        while _arrived_s and _answered_s[0] != DEAF:
            frame = _of_main()
            if frame is not None and _is_joining(frame):
                signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGINT)
            time.sleep(PATIENCE_S / 4)


def _end_compiled() -> None:
    """End the process at once if its main thread is in a computation or imports a package."""
    frame = _of_main()
    computes = _is_importing(frame)
    while frame is not None and not computes:
        file = frame.f_code.co_filename
        if file.startswith(OURS):
            computes = file.startswith(COMPUTING)
            break
        frame = frame.f_back
    if not computes:
        return
    for module, clean in (("optopad.work", "end_started"), ("optopad.fabrication.bundle", "abandon")):
        if module in sys.modules:
            getattr(sys.modules[module], clean)()
    with suppress(OSError):
        if sys.stderr.isatty():
            sys.stderr.write("\x1b[?25h\n")  # a progress bar hides the cursor
        say()
    leave(INTERRUPTED)


def _is_joining(frame: FrameType) -> bool:
    """Whether a frame of the call stack is waiting for the threads of a pool at the end of a `with` block."""
    outer: FrameType | None = frame
    while outer is not None and not outer.f_code.co_filename.startswith(OURS):
        if outer.f_code.co_filename.endswith(WAITING) and outer.f_code.co_name in ("shutdown", "__exit__"):
            return True
        outer = outer.f_back
    return False


def _of_main() -> FrameType | None:
    return sys._current_frames().get(threading.main_thread().ident or 0)
