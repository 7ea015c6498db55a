"""The command tree: every group of verbs under one name."""

from __future__ import annotations

import typer

from optopad.cli.driver import verbs as driver
from optopad.cli.verbs import (
    accuracy,
    author,
    bench,
    build,
    calibrate,
    compare,
    contact,
    explore,
    job,
    physics,
    rays,
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
