"""Entry point: builds the command tree and turns every outcome into an exit code.

0 done; 2 bad input, one message; 1 our own failure; 130 interrupted.
"""

from __future__ import annotations

import sys
import traceback

import typer
from typer.exceptions import TyperException

from design.errors import OptopadError
from optopad.cli import (
    accuracy,
    author,
    bench,
    build,
    calibrate,
    compare,
    contact,
    driver,
    explore,
    job,
    physics,
    rays,
    sweep,
    train,
)

DONE, OUR_FAILURE, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130

app = typer.Typer(
    name="optopad",
    help="One design file in; a printable mold, a verdict on the layout, and the driver config out.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)
for group in (
    job,
    author,
    build,
    physics,
    sweep,
    compare,
    rays,
    contact,
    driver,
    bench,
    explore,
    train,
    calibrate,
    accuracy,
):
    group.register(app)


def main(arguments: list[str] | None = None) -> int:
    """Run one command.

    Returns
    -------
    exit code, also raised as SystemExit when called without arguments (as the installed command)
    """
    code = _run(sys.argv[1:] if arguments is None else arguments)
    if arguments is None:
        sys.exit(code)
    return code


def _run(arguments: list[str]) -> int:
    try:
        outcome = typer.main.get_command(app).main(arguments, prog_name="optopad", standalone_mode=False)
    except OptopadError as err:
        return _refused(str(err))
    except TyperException as err:
        return _misused(err)
    except typer.Abort:
        return _interrupted()
    except ImportError as err:
        from optopad.doctor import explain_import_error

        return _refused(explain_import_error(err), OUR_FAILURE)
    except (
        Exception
    ):  # on purpose all: what nobody above expected is our own failure, whatever its type, and exits with 1
        traceback.print_exc()
        return _refused("this is optopad's own failure; please report it with the lines above", OUR_FAILURE)
    if outcome == INTERRUPTED:  # the command line's library answers Ctrl-C with this code and no word
        return _interrupted()
    return outcome if isinstance(outcome, int) else DONE


def _interrupted() -> int:
    print(
        "optopad: interrupted: nothing is half-written, and finished parts are found again", file=sys.stderr
    )
    return INTERRUPTED


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
