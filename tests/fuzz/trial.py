"""One trial: something is done to a file, and the answer must be a result or a refusal that can be read."""

from __future__ import annotations

import contextlib
import io
import sys
import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass

from optopad.design.errors import LONGEST_MESSAGE_BYTES, OptopadError

LONGEST_ANSWER_S = 2.0
"""Processor time of one answer about a design: other work on the machine must not make a test fail."""
LONGEST_SHOWN_BYTES = 4_096
REFUSED = 2

assert LONGEST_MESSAGE_BYTES < LONGEST_SHOWN_BYTES


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """What came of a trial.

    Attributes
    ----------
    what : number and kind of the trial
    seconds : processor time of the answer [s]
    message_bytes : length of the longest message
    is_refused : whether the file was refused
    failure : what was wrong with the answer; empty where nothing was
    """

    what: str
    seconds: float = 0.0
    message_bytes: int = 0
    is_refused: bool = False
    failure: str = ""


def tried(what: str, answer: Callable[[], list[str]], *, longest_s: float = LONGEST_ANSWER_S) -> Outcome:
    """Do it; the answer is what was said, line by line, and an error of ours is as good."""
    started = time.process_time()
    failure, is_refused = "", False
    with _unraisable() as ignored:
        try:
            said = answer()
        except OptopadError as err:
            said, is_refused = [str(err)], True
        except Exception as err:
            said, failure = [], "".join(traceback.format_exception(err)[-3:])
    seconds = time.process_time() - started
    faults = [failure, *ignored, *map(message_fault, said)]
    if seconds > longest_s:
        faults.append(f"took {seconds:.1f} s of the processor")
    return Outcome(
        what=what,
        seconds=seconds,
        message_bytes=max((len(text.encode("utf-8", "replace")) for text in said), default=0),
        is_refused=is_refused,
        failure="\n".join(filter(None, faults)),
    )


def message_fault(text: str) -> str:
    """Why a message cannot be shown; empty where it can."""
    length = len(text.encode("utf-8", "replace"))
    if length > LONGEST_SHOWN_BYTES:
        return f"a message of {length} bytes: {text[:200]!r}"
    strange = [one for one in text if one != "\n" and not one.isprintable()]
    return f"a message with {strange[0]!r}: {text[:200]!r}" if strange else ""


def command(arguments: list[str], *, refused: bool) -> list[str]:
    """Run the command line in this process and return what it says of errors; AssertionError for a wrong exit code."""
    from optopad.cli.main import main

    said = io.StringIO()
    with contextlib.redirect_stderr(said), contextlib.redirect_stdout(io.StringIO()):
        code = main(arguments)
    text = said.getvalue()
    assert code in ((REFUSED,) if refused else (0, REFUSED)), f"exit {code} of {arguments}: {text[-2000:]}"
    assert "Traceback" not in text, text[-2000:]
    return [text]


@contextlib.contextmanager
def _unraisable():
    """Collects what Python would print as 'Exception ignored in'."""
    found: list[str] = []
    before = sys.unraisablehook
    sys.unraisablehook = lambda told: found.append(f"ignored in {told.object!r}: {told.exc_value!r}")
    try:
        yield found
    finally:
        sys.unraisablehook = before
