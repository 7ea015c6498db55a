"""The tree of commands, in the groups and the order of the help; also the command `doctor` and the group `driver`."""

from __future__ import annotations

import shlex
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from optopad.cli import collect, design, firmware, job, learning, options, parts, physics, search, sensor
from optopad.screen.output import print_json, say
from optopad.work import read_design


def doctor(as_json: options.Json = False) -> None:
    """Report what this machine can and cannot do."""
    from dataclasses import asdict

    from optopad.doctor import examine

    findings = examine()
    if as_json:
        print_json({"findings": [asdict(finding) for finding in findings]})
    else:
        for finding in findings:
            way_out = f"  -> {finding.way_out}" if finding.way_out else ""
            say(f"{finding.state:<8} {finding.name:<16} {finding.detail}{way_out}")


driver = typer.Typer(
    name="driver",
    help="The built sensor: its configuration, firmware, readings.",
    no_args_is_help=True,
    context_settings={"help_option_names": ["-h", "--help"]},
)


@driver.command()
def config(
    design: options.Design,
    set_: options.Set = None,
    prices: Annotated[
        Path | None,
        typer.Option(
            "--prices", metavar="FILE", help="Your own prices, as a copy of bom.csv with unit_cost filled."
        ),
    ] = None,
    budget: Annotated[
        str | None,
        typer.Option("--budget", metavar="AMOUNT", help="Compare the bill with an amount, as 25EUR."),
    ] = None,
    out: options.Out = options.DEFAULT_OUT,
    seed: options.Seed = 0,
    as_json: options.Json = False,
) -> None:
    """Write driver.toml, wiring table and bill of materials of a design."""
    from dataclasses import asdict

    from optopad.fabrication.sheets.bom import SET_BY_GAIN
    from optopad.fabrication.sheets.prices import (
        bill_sum,
        held_against,
        parsed_budget,
        read_prices,
        unused_words,
    )
    from optopad.jobs.pipeline import write_driver_config
    from optopad.screen.verdict import as_typed

    limit, own = (
        None if budget is None else parsed_budget(budget),
        None if prices is None else read_prices(prices),
    )
    bundle, rows = write_driver_config(read_design(design, set_), out, seed=seed, prices=own)
    folder, total = bundle / "fabrication", bill_sum(rows)
    held = None if limit is None else held_against(rows, limit)
    unused = None if own is None else unused_words(rows, own)
    if as_json:
        bill = {
            "known": total.known,
            "rows": total.rows,
            "rows_without_price": total.unpriced,
            "rows_set_by_gain": sum(SET_BY_GAIN in row.value for row in rows),
            "budget": None if held is None else asdict(held),
            "unused_prices": unused,
        }
        files = sorted(str(file) for file in folder.iterdir() if file.is_file())
        print_json({"files": files, "bill": bill})
        return
    say(f"bill      {total.words}")
    if unused is not None:
        say(f"prices    {unused}")
    if held is not None:
        say(f"budget    {held.words}")
    if any(SET_BY_GAIN in row.value for row in rows):
        typed = as_typed(design, set_) + (
            "" if out == options.DEFAULT_OUT else f" --out {shlex.quote(str(out))}"
        )
        say(
            f"open      amplifier and feedback follow from the gain: optopad run {typed}, then this command again"
        )
    say(f"files     {folder}")


for verb in (
    firmware.firmware,
    firmware.flash,
    sensor.read,
    sensor.record,
    sensor.check,
    sensor.export,
    collect.collect,
    sensor.fake,
    sensor.ros2,
):
    driver.command()(verb)

Verb = Callable[..., None] | typer.Typer
GROUPS: dict[str, dict[Verb, str]] = {
    "Main job": {
        job.run: "Make mold, verdict, driver configuration and report of a design.",
        job.report: "Find the report of a bundle, and check the bundle's files.",
        design.studio: "Edit and press a design in a browser, with live signals.",
        doctor: "Show the capabilities of this machine and missing packages.",
    },
    "Design": {
        design.new: "Write a commented design file to start from.",
        design.check: "List everything in a design that cannot work.",
        design.schema: "Print the JSON Schema of design files, for editors.",
        parts.parts: "List the catalogue: parts, silicones, plastics, boards.",
        parts.part: "Write the entry of a part from its data sheet.",
    },
    "Mold": {
        design.build: "Write the mold and its tools as STL, STEP and 3MF.",
    },
    "Physics": {
        physics.score: "Report the deadbands, the usable depth and the resolution.",
        physics.simulate: "Compute the signals of presses, or a whole data set.",
        physics.sweep: "Score a design at several values of one field.",
        physics.compare: "Compare designs, or a measured press with the simulation.",
        physics.rays: "Draw paths of light, without contact and pressed.",
        physics.contact: "Compute surface and force of a press.",
        learning.predict: "Predict the errors of location and depth of a sensor.",
    },
    "Search": {
        search.improve: "Change a design until its verdict is better.",
        search.explore: "Search a space of designs for the best ones.",
    },
    "Built sensor": {
        driver: "Configure, program, check, read and record the sensor.",
        learning.train: "Train a model that estimates touch, location and depth.",
        learning.evaluate: "Report the errors of models on known presses.",
        learning.calibrate: "Fit the simulated sensor to presses of the built one.",
    },
}


class GroupedHelp(TyperGroup):
    """Help text that lists the commands by group."""

    def format_commands(self, ctx: Any, formatter: Any) -> None:  # noqa: ARG002
        """Write one section of the help per group; the column of names has the same width in all sections."""
        width = max(len(name_of(verb)) for group in GROUPS.values() for verb in group)
        for title, group in GROUPS.items():
            with formatter.section(title):
                formatter.write_dl([(name_of(verb).ljust(width), line) for verb, line in group.items()])


def name_of(verb: Verb) -> str:
    """Name of a command as the user types it."""
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
    """The whole command tree, as typer needs it; made only on demand, because that takes longer than many commands."""
    return typer.main.get_command(app)
