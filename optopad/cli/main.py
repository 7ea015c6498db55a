"""Entry point of the command line: runs a command and converts its outcome to an exit code.

Exit codes are 0 for success, 2 for bad input (with one message), 1 for an internal error, 130 for an interrupt.

Importing the commands takes half a second. The imports are inside `main`, so that Ctrl-C is handled during them, too.
"""

from __future__ import annotations

import sys

TYPE_CHECKING = False  # as in typing, which takes a while to load
if TYPE_CHECKING:
    from typer.exceptions import TyperException

DONE, OUR_FAILURE, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130
COLLECTED_AFTER = (100_000, 10, 10)
"""Thresholds of Python's garbage collector; by default it scans imported modules often, which takes 8 % of a run."""


def main(arguments: list[str] | None = None) -> int:
    """Run one command.

    Returns
    -------
    the exit code; if `arguments` is omitted (as by the installed command), SystemExit is raised with the code instead
    """
    if arguments is not None:
        return _told(_run(arguments))
    try:
        from optopad.cli.interrupts import listen

        listen()
        _hide_warnings()
        code = _run(sys.argv[1:])
    except KeyboardInterrupt:  # before the command line's library handles it, or after
        code = INTERRUPTED
    from optopad.cli.interrupts import be_deaf, leave

    be_deaf()
    _told(code)
    if code == INTERRUPTED:
        leave(code)
    sys.exit(code)


def _hide_warnings() -> None:
    """Show no warning of Python to users, who cannot act on it; -W or PYTHONWARNINGS shows them."""
    import warnings

    if not sys.warnoptions:
        warnings.simplefilter("ignore")


def _told(code: int) -> int:
    if code == INTERRUPTED:  # the command line's library prints no message
        from optopad.cli.interrupts import say

        say()
    return code


def _run(arguments: list[str]) -> int:
    try:
        return _outcome(arguments)
    except Exception as err:  # all, on purpose: errors that no code below expected
        from optopad.cli.interrupts import has_arrived

        return INTERRUPTED if has_arrived() else _failed(err)


def _outcome(arguments: list[str]) -> int:
    import errno
    import gc
    import os

    if sys.version_info < (3, 11):
        version = ".".join(map(str, sys.version_info[:3]))
        return _refused(
            f"commands need Python 3.11 to 3.13, this is {version}; here, use `import optopad` in Python"
        )
    gc.set_threshold(*COLLECTED_AFTER)
    if os.path.expanduser("~") == "~":  # libraries would fail during import
        from optopad.sims.cache import NO_HOME

        os.environ["HOME"] = str(NO_HOME)
    import typer
    from typer.exceptions import TyperException

    from optopad.cli.commands import whole_command
    from optopad.design.errors import OptopadError, readable

    try:
        outcome = whole_command().main(arguments, prog_name="optopad", standalone_mode=False)
    except OptopadError as err:
        return _refused(str(err))
    except TyperException as err:
        return _misused(err)
    except OSError as err:
        unusable = (errno.ENAMETOOLONG, errno.ELOOP, errno.EACCES, errno.EPERM, errno.EISDIR, errno.ENOTDIR)
        if err.errno not in unusable or err.filename is None:
            raise
        return _refused(readable(f"{err.filename}: {err.strerror}; give another name"))
    except typer.Abort:
        return INTERRUPTED
    return outcome if isinstance(outcome, int) else DONE


def _failed(err: Exception) -> int:
    if isinstance(err, ImportError):
        from optopad.doctor import explain_import_error

        return _refused(explain_import_error(err), OUR_FAILURE)
    import traceback

    traceback.print_exception(err)
    return _refused("this is optopad's own failure; please report it with the lines above", OUR_FAILURE)


def _misused(err: TyperException) -> int:
    show = getattr(err, "show", None)
    if show is not None:
        show()
    else:
        print(err, file=sys.stderr)
    return BAD_INPUT


def _refused(message: str, code: int = BAD_INPUT) -> int:
    print(f"optopad: {message}", file=sys.stderr)
    return code
