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
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from inspect import Parameter
from pathlib import Path
from typing import Annotated, Any, TypeVar

import typer

from optopad.cli.options import SHARED, typed
from optopad.screen.answer import as_typed
from optopad.screen.output import print_json, progress, say
from optopad.work import read_design

__all__ = ["Asked", "command_of", "typed", "verb"]

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
