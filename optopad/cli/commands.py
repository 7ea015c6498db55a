"""The command tree: every verb under one name, in the groups and the order of the help."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from optopad.cli.driver.verbs import driver
from optopad.cli.verbs import (
    accuracy,
    author,
    bench,
    build,
    calibrate,
    compare,
    contact,
    explore,
    improve,
    job,
    physics,
    rays,
    studio,
    sweep,
    train,
)

Verb = Callable[..., None] | typer.Typer
GROUPS: dict[str, dict[Verb, str]] = {
    "Main job": {
        job.run: "Make mold, verdict, driver configuration and report of a design.",
        job.report: "Find the report of a bundle, and check the bundle's files.",
        studio.studio: "Edit and press a design in a browser, with live signals.",
        bench.doctor: "Show what this machine can do, and what is missing.",
    },
    "Design": {
        author.new: "Write a commented design file to start from.",
        author.check: "List everything in a design that cannot work.",
        author.schema: "Print the JSON Schema of design files, for editors.",
        author.migrate: "Lift a design file to the present schema version.",
    },
    "Mold": {
        build.build: "Write the mold and its tools as STL, STEP and 3MF.",
    },
    "Physics": {
        physics.score: "Report the deadbands, the usable depth and the resolution.",
        physics.simulate: "Compute the signals of presses, or a whole data set.",
        sweep.sweep: "Score a design at several values of one field.",
        compare.compare: "Compare designs, or a measured press with the simulation.",
        rays.rays: "Draw paths of light, without contact and pressed.",
        contact.contact: "Compute surface and force of a press.",
        accuracy.predict: "Predict the errors of location and depth of a sensor.",
    },
    "Search": {
        improve.improve: "Change a design until its verdict is better.",
        explore.explore: "Search a space of designs for the best ones.",
    },
    "Built sensor": {
        driver: "Configure, program, check, read and record the sensor.",
        train.train: "Train a model that estimates touch, location and depth.",
        accuracy.evaluate: "Report the errors of models on known presses.",
        calibrate.calibrate: "Fit the simulated sensor to presses of the built one.",
    },
}


class GroupedHelp(TyperGroup):
    """The help lists the verbs by group."""

    def format_commands(self, ctx: Any, formatter: Any) -> None:  # noqa: ARG002
        """Write a section a group, all with the same width of names."""
        width = max(len(name_of(verb)) for group in GROUPS.values() for verb in group)
        for title, group in GROUPS.items():
            with formatter.section(title):
                formatter.write_dl([(name_of(verb).ljust(width), line) for verb, line in group.items()])


def name_of(verb: Verb) -> str:
    """What a user types."""
    return verb.info.name or "" if isinstance(verb, typer.Typer) else verb.__name__


app = typer.Typer(
    name="optopad",
    cls=GroupedHelp,
    help="One design file in; a printable mold, a verdict on the layout, and the driver config out.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _print_version(is_asked: bool) -> None:
    if is_asked:
        from importlib.metadata import version

        print(f"optopad {version('optopad')}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool,
        typer.Option("--version", help="Show the version and exit.", is_eager=True, callback=_print_version),
    ] = False,
) -> None:
    """Options of the command itself."""


for group in GROUPS.values():
    for verb, line in group.items():
        if isinstance(verb, typer.Typer):
            app.add_typer(verb, short_help=line)
        else:
            app.command(short_help=line)(verb)


@cache
def whole_command() -> Any:
    """The whole tree as typer runs it; making it takes longer than many verbs."""
    return typer.main.get_command(app)
