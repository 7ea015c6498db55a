"""The verb group driver: everything about the built sensor."""

from __future__ import annotations

import typer

from optopad.cli import options
from optopad.cli.driver import collect, export, fake, firmware, sensor
from optopad.cli.output import print_json, say
from optopad.work.designs import read_design

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
    out: options.Out = options.DEFAULT_OUT,
    seed: options.Seed = 0,
    as_json: options.Json = False,
) -> None:
    """driver.toml, wiring table and bill of materials for exactly this geometry."""
    from optopad.jobs.pipeline import write_driver_config

    folder = write_driver_config(read_design(design, set_), out, seed=seed) / "fabrication"
    if as_json:
        print_json({"files": sorted(str(file) for file in folder.iterdir() if file.is_file())})
    else:
        say(f"files     {folder}")


for verb in (
    firmware.firmware,
    firmware.flash,
    sensor.read,
    sensor.record,
    sensor.check,
    export.export,
    collect.collect,
    fake.fake,
):
    driver.command()(verb)
