"""The command tree: every verb under one name, in the order of the help."""

from __future__ import annotations

import typer

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

app = typer.Typer(
    name="optopad",
    help="One design file in; a printable mold, a verdict on the layout, and the driver config out.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)
for verb in (
    job.run,
    job.report,
    author.new,
    author.check,
    author.schema,
    author.migrate,
    build.build,
    physics.simulate,
    physics.score,
    sweep.sweep,
    compare.compare,
    rays.rays,
    bench.doctor,
    explore.explore,
    improve.improve,
    studio.studio,
    train.train,
    calibrate.calibrate,
    accuracy.evaluate,
    accuracy.predict,
):
    app.command()(verb)
app.add_typer(contact.contact, name="contact")
app.add_typer(driver, name="driver")
