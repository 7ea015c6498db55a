"""Verbs of the contact model: contact show."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from optopad.cli.common import (
    DesignArgument,
    JsonOption,
    SeedOption,
    SetOption,
    print_json,
    read_design,
    say,
)
from optopad.cli.progress import progress

contact = typer.Typer(help="The contact model: press, surface, force.", no_args_is_help=True)


def register(app: typer.Typer) -> None:
    """Add this group's verbs."""
    app.add_typer(contact, name="contact")


@contact.command()
def show(
    design: DesignArgument,
    depth: Annotated[float, typer.Option(help="Depth of the press [mm].")] = 2.0,
    protocol: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="Also the load over a load protocol: piacenza2017."),
    ] = None,
    set_: SetOption = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", metavar="FOLDER", help="Also pictures, as SVG and PNG, into the bundle in this folder."
        ),
    ] = None,
    seed: SeedOption = 0,
    as_json: JsonOption = False,
) -> None:
    """Load, surface and pressure of a centred press; with a protocol, press and retract."""
    from optopad.press_view import view_json, view_lines, view_press, write_pictures

    read = read_design(design, set_)
    with progress(quiet=as_json) as step:
        view = view_press(read, depth, protocol, on_step=lambda share: step("contact", share))
        files = [] if out is None else write_pictures(view, out, seed=seed)
    if as_json:
        print_json(view_json(view) | {"files": [str(file) for file in files]})
        return
    say("\n".join(view_lines(view)))
    if files:
        say(f"files     {files[0].parent}/contact-*")
