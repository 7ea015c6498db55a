"""Makes a command of a verb: a function whose signature and docstring say all that the command line needs.

    @verb(vary=typed("FIELD[=A:B]"), budget_min=typed("MINUTES", flag="--budget"))
    def improve(design: SensorDesign, *, vary: Sequence[str] = (), budget_min: float | None = None, ...) -> Improvement:

Parameters before the ``*`` are arguments of the command, those behind it are options of their names. The help of a
parameter is its line in the docstring, or that of `SHARED`, which has the parameters of many verbs. `typed` says what
the annotation does not: metavar, limits, checks. Some parameters are filled in:

- a `SensorDesign` is read from an argument DESIGN, and changed by an option ``--set``
- `on_step` and `on_tried` report progress on standard error
- `asked` holds the words that name the design

A verb returns a result that has `to_json` for ``--json`` and `screen` for the terminal.

`SHARED` has the options of several commands; checks of their values stand beside it.
"""

from __future__ import annotations

import inspect
import math
import os
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from inspect import Parameter
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

import typer

from optopad.design.errors import InputError, OutputError
from optopad.design.files import folder_fault, has_file_suffix, require_folder_name, require_suffix
from optopad.screen.answer import as_typed
from optopad.screen.output import print_json, progress, say
from optopad.work import read_design

Folder = TypeVar("Folder", Path, Path | None)
LARGEST_SEED = 2**31 - 1
"""Largest seed that all used libraries accept."""


def file_name(*suffixes: str, or_folder: bool = False) -> Callable[[Path | None], Path | None]:
    """Make a function that checks the name of an output file, before any other work.

    Parameters
    ----------
    suffixes : permitted file suffixes, for example ".nc"
    or_folder : whether a name without a suffix is permitted, for a folder
    """

    def checked(file: Path | None) -> Path | None:
        is_folder = or_folder and file is not None and (file.is_dir() or not has_file_suffix(file))
        if file is not None and not is_folder:
            require_suffix(file, suffixes, "--out ")
        return file

    return checked


def require_folder(folder: Folder) -> Folder:
    """Check that a folder can be created and written later, and return it; nothing is created yet.

    Raises
    ------
    InputError : the name is that of a file.
    OutputError : the folder cannot be created or written.
    """
    if folder is None:
        return None
    require_folder_name(folder, "--out ")
    if fault := folder_fault(folder):
        raise OutputError(f"--out {folder}: cannot be written: {fault}; choose another folder")
    return folder


def named(path: Path) -> Path:
    """The path itself if it ends in a name, else the same place by its name: ``.`` gives the current folder's path."""
    return path if path.name not in ("", "..") else Path(os.path.realpath(path))


def checked_out(out: Path, *read: Path | str | None) -> None:
    """Raise InputError if the command would overwrite a file that it reads."""
    if any(
        one is not None and Path(one).exists() and Path(one).samefile(out) for one in read if out.exists()
    ):
        raise InputError(f"--out {out}: is a file that this command reads; choose another name")


def parsed_press(text: str) -> tuple[float, float, float]:
    """Parse x, y and depth of a press from a text ``X,Y,DEPTH`` [mm].

    Raises
    ------
    InputError : the text is not three finite numbers.
    """
    try:
        x_mm, y_mm, depth_mm = (float(number) for number in text.split(","))
    except ValueError:
        raise InputError(
            f"--press: {text!r} is refused: write X,Y,DEPTH in millimetres, as 16,16,2"
        ) from None
    if not all(math.isfinite(number) for number in (x_mm, y_mm, depth_mm)):
        raise InputError(f"--press: {text!r} is refused: needs three finite numbers of millimetres")
    return x_mm, y_mm, depth_mm


def parsed_offset(text: str | None) -> float | Literal["auto"] | None:
    """The clock offset [s] of `--offset`; raises InputError."""
    if text is None:
        return None
    if text == "auto":
        return "auto"
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(f"--offset: {text!r} is refused: seconds, or auto")
    return value


def typed(metavar: str | None = None, **how: Any) -> dict[str, Any]:
    """How a parameter is typed where the verb's signature does not say it.

    Parameters
    ----------
    metavar : what the help shows in place of the value
    how : `flag`, the option's name; `type`, to which the text is converted; `default`, if Python's is another;
        `help`, if the docstring has none; and what typer takes: min, max, callback
    """
    return {"metavar": metavar, **how}


SHARED: dict[str, dict[str, Any]] = {
    "design": typed("DESIGN", help="Design file (.toml), bundle folder, or the name of a preset."),
    "set_": typed("PATH=VALUE", help="Change a field, as cavity.clear_thickness_mm=10. Repeatable."),
    "out": typed("FOLDER", type=Path, callback=require_folder, help="Folder that holds the bundles."),
    "seed": typed(min=0, max=LARGEST_SEED, help="Seed of every random stream."),
    "fine": typed(help="Finer light, and a map of 11 locations per side with steps of 0.1 mm."),
    "details": typed(help="Print every figure instead of one screen."),
    "as_json": typed(help="One JSON object on standard output, nothing else."),
    # the built sensor
    "config": typed(
        "CONFIG", help="driver.toml, bundle folder, or the design that was built (file or preset)."
    ),
    "port": typed("NAME", help="Serial port, or serial:NUMBER of its USB device; default: found by USB."),
    "patience": typed(
        "S",
        min=0.1,
        help="Longest wait for a frame, and for the board to start, but at least its boot time (10 s if left out).",
    ),
    "rate": typed("HZ", min=0, help="Frames per second; 0: as many as the board can."),
    "accept_digest": typed("DIGITS", help="Accept a board with firmware of this other design."),
    "frames": typed("N", min=1, help="End after at least this number of frames."),
    "seconds": typed("S", min=0.0, help="End after this time."),
    "bundles": typed("FOLDER", help="Folder that holds the bundles, to find a design's."),
    # recordings
    "topic": typed("NAME", help="Topic of the frames, in a bag of several sensors."),
    "press_topic": typed("NAME", help="Topic of the presses, if a bag has several."),
    "offset": typed("S", help="This machine's clock minus the log's; `auto` finds it."),
}
"""How parameters that many verbs have are typed, by name."""


Function = TypeVar("Function", bound=Callable[..., Any])
Typed = dict[str, Any]
TYPES: dict[str, Any] = {
    **{kind.__name__: kind for kind in (str, int, float, bool, Path)},
    "Sequence[str]": list[str],
    "Sequence[Path]": list[Path],
}
"""What a user can type, by the annotation; `typed` gives the type of others."""


@dataclass(frozen=True)
class Asked:
    """The design and its changes, as the user typed them."""

    design: str
    changes: Sequence[str]

    @property
    def words(self) -> str:
        """The words, for a command that the user may type next."""
        return as_typed(self.design, self.changes)


def verb(*, set_before: str = "", **options: Typed | None) -> Callable[[Function], Function]:
    """Mark a function as a verb.

    Parameters
    ----------
    set_before : option before which the help lists ``--set``; "" for the first place
    options : how parameters are typed; None for one that cannot be typed
    """

    def marked(function: Function) -> Function:
        vars(function)["verb"] = (set_before, options)
        return function

    return marked


def command_of(function: Callable[..., Any]) -> Callable[..., None]:
    """The command of a verb, as a function that typer understands."""
    set_before, options = vars(function)["verb"]
    said, taken = inspect.getdoc(function) or "", inspect.signature(function).parameters
    words = list(_words(taken.values(), SHARED | options, helps_of(said), set_before))
    if "as_json" not in taken and "as_json" not in options:
        words.append(_word("as_json", "bool", False, SHARED["as_json"]))

    def command(**given: Any) -> None:
        as_json = given.get("as_json", False)
        values = {
            name: taken[name].default if value is None else value
            for name, value in given.items()
            if name in taken
        }
        with ExitStack() as stack:
            if _is_design(taken.get("design")):
                values["design"] = read_design(given["design"], given["set_"])
            if "asked" in taken:
                values["asked"] = Asked(given["design"], given["set_"] or ())
            if "on_step" in taken:
                values["on_step"] = stack.enter_context(progress(quiet=as_json))
            if "on_tried" in taken:
                from optopad.screen.search import telling

                values["on_tried"] = stack.enter_context(telling(quiet=as_json))
            result = function(**values)
        _show(result, as_json)

    command.__name__, command.__doc__ = function.__name__, " ".join(said.partition("\n\n")[0].split())
    command.__signature__ = inspect.Signature(words)  # type: ignore[attr-defined]
    command.__annotations__ = {word.name: word.annotation for word in words}
    return command


def _show(result: Any, as_json: bool) -> None:
    if result is None:  # the verb showed itself
        return
    if as_json:
        print_json(result.to_json())
    elif lines := result.screen():
        say("\n".join(lines))
    if code := getattr(result, "exit_code", 0):
        raise typer.Exit(code)


def _is_design(parameter: Parameter | None) -> bool:
    return parameter is not None and parameter.annotation == "SensorDesign"


def _words(
    taken: Iterable[Parameter], options: Mapping[str, Typed | None], helps: dict[str, str], set_before: str
) -> Iterator[Parameter]:
    """The words of the command, in the order of the help."""
    for one in taken:
        if one.name == set_before:
            yield _word("set_", "Sequence[str]", (), SHARED["set_"])
        if one.name in ("on_step", "on_tried", "asked") or options.get(one.name, {}) is None:
            continue
        annotation = "str" if _is_design(one) else one.annotation
        how, help_text = options.get(one.name) or {}, helps.get(one.name, "")
        yield _word(one.name, annotation, one.default, how, help_text, one.kind is not one.KEYWORD_ONLY)
        if _is_design(one) and not set_before:
            yield _word("set_", "Sequence[str]", (), SHARED["set_"])


def _word(
    name: str, annotation: str, default: Any, how: Typed, help_text: str = "", is_argument: bool = False
) -> Parameter:
    how = how | ({"help": help_text} if help_text else {})
    kind = how.pop("type", None) or TYPES[annotation.removesuffix(" | None")]
    flag = how.pop("flag", f"--{name.removeprefix('as_').strip('_').replace('_', '-')}")
    default = how.pop("default", None if default == () else default)
    info = typer.Argument(**how) if is_argument else typer.Option(flag, **how)
    kind = kind | None if default is None else kind
    return Parameter(name, Parameter.KEYWORD_ONLY, default=default, annotation=Annotated[kind, info])


def helps_of(docstring: str) -> dict[str, str]:
    """The help of each parameter, from the lines ``name : text`` of a docstring's section Parameters."""
    section = docstring.partition("Parameters\n----------\n")[2].partition("\n\n")[0]
    entries = re.findall(r"^(\w+) : (.*(?:\n {4}.*)*)", section, flags=re.MULTILINE)
    return {name: " ".join(text.split()) for name, text in entries}
