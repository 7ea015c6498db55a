"""The tree of commands, in the groups and the order of the help. A command is imported when it is typed."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from importlib import import_module
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from optopad.cli.verb import command_of

GROUPS: dict[str, dict[str, str]] = {
    "Main job": {
        "run": "Make mold, verdict, driver configuration and report of a design.",
        "report": "Find the report of a bundle, and check the bundle's files.",
        "studio": "Edit and press a design in a browser, with live signals.",
        "doctor": "Show the capabilities of this machine and missing packages.",
    },
    "Design": {
        "new": "Write a commented design file to start from.",
        "check": "List everything in a design that cannot work.",
        "schema": "Print the JSON Schema of design files, for editors.",
        "parts": "List the catalogue: parts, silicones, plastics, boards.",
        "part": "Write the entry of a part from its data sheet.",
    },
    "Mold": {
        "build": "Write the mold and its tools as STL, STEP and 3MF.",
    },
    "Physics": {
        "score": "Report the deadbands, the usable depth and the resolution.",
        "press": "Compute the signals and the force of any object.",
        "simulate": "Compute the signals of presses, or a whole data set.",
        "sweep": "Score a design at several values of one field.",
        "compare": "Compare designs, or a measured press with the simulation.",
        "rays": "Draw paths of light, without contact and pressed.",
        "contact": "Compute surface and force of a press.",
        "predict": "Predict the errors of location and depth of a sensor.",
        "scene": "Write the pad as a MuJoCo model, and a demo scene.",
    },
    "Search": {
        "improve": "Change a design until its verdict is better.",
        "explore": "Search a space of designs for the best ones.",
    },
    "Built sensor": {
        "driver": "Configure, program, check, read and record the sensor.",
        "train": "Train a model that estimates touch, location and depth.",
        "evaluate": "Report the errors of models on known presses.",
        "calibrate": "Fit the simulated sensor to presses of the built one.",
    },
}
"""Commands by group, and their lines in the help."""
BELOW = {
    "contact": ("The contact model: press, surface, force.", "show"),
    "driver": (
        "The built sensor: its configuration, firmware, readings.",
        "config firmware flash read record check export collect fake ros2",
    ),
    "part": ("A part of your own for the catalogue.", "new"),
}
"""Commands that have commands below them: their help, and the names below."""
SHORT = {"part new": "Write a part's entry from its data sheet."}
"""Lines in the help of a group, where the beginning of the command's own help would be cut."""
SETTINGS: dict[str, Any] = {
    "add_completion": False,
    "pretty_exceptions_enable": False,
    "rich_markup_mode": None,
}
TOP: dict[str, Any] = {
    "help": "One design file in; a printable mold, a verdict on the layout, and the driver config out.",
    "context_settings": {"help_option_names": ["-h", "--help"]},
}


class Commands(Mapping[str, Any]):
    """Commands by name, each imported and made when it is first taken.

    Parameters
    ----------
    above : the command above these; "" for the first ones
    """

    def __init__(self, above: str, names: Sequence[str]) -> None:
        self.above, self.names = above, names
        self.made: dict[str, Any] = {}

    def __getitem__(self, name: str) -> Any:
        if name not in self.names:
            raise KeyError(name)
        if name not in self.made:
            is_group = not self.above and name in BELOW
            self.made[name] = _group(name) if is_group else _command(self.above, name)
        return self.made[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self.names)

    def __len__(self) -> int:
        return len(self.names)


def _command(above: str, name: str) -> Any:
    module = {"": name, "driver": f"driver.{name}"}.get(above, above)
    found = import_module(f"optopad.verbs.{module}")
    function = command_of(getattr(found, f"{name}_command", None) or getattr(found, name))
    app = typer.Typer(**SETTINGS)
    app.command(name, short_help=SHORT.get(f"{above} {name}"))(function)
    return typer.main.get_command(app)


def _group(name: str) -> Any:
    help_text, names = BELOW[name]
    app = typer.Typer(name=name, help=help_text, no_args_is_help=True, **SETTINGS)
    group: Any = typer.main.get_group(app)
    group.commands = Commands(name, names.split())
    return group


class GroupedHelp(TyperGroup):
    """Help text that lists the commands by group."""

    def format_commands(self, ctx: Any, formatter: Any) -> None:  # noqa: ARG002
        """Write one section of the help per group; the column of names has the same width in all sections."""
        width = max(len(name) for group in GROUPS.values() for name in group)
        for title, group in GROUPS.items():
            with formatter.section(title):
                formatter.write_dl([(name.ljust(width), line) for name, line in group.items()])


def _print_version(is_asked: bool) -> None:
    if is_asked:
        from importlib.metadata import version

        print(f"optopad {version('optopad')}")
        raise typer.Exit


def _options(
    version: Annotated[
        bool,
        typer.Option("--version", help="Show the version and exit.", is_eager=True, callback=_print_version),
    ] = False,
) -> None:
    """Options of the command itself."""


@cache
def whole_command() -> Any:
    """The whole command tree."""
    app = typer.Typer(name="optopad", cls=GroupedHelp, no_args_is_help=True, **TOP, **SETTINGS)
    app.callback()(_options)
    group: Any = typer.main.get_group(app)
    names = [name for names in GROUPS.values() for name in names]
    group.commands = Commands("", sorted(names, key=BELOW.__contains__))
    return group
