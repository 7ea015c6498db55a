"""Verbs of the contact model: contact show, contact build."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from optopad.cli import options
from optopad.cli.output import print_json, say, tell
from optopad.cli.progress import progress
from optopad.work.designs import read_design

contact = typer.Typer(name="contact", help="The contact model: press, surface, force.", no_args_is_help=True)


@contact.command()
def show(
    design: options.Design,
    depth: Annotated[float, typer.Option(help="Depth of the press [mm].")] = 2.0,
    protocol: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="Also the load over a load protocol: piacenza2017."),
    ] = None,
    set_: options.Set = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            metavar="FOLDER",
            help="Also pictures, as SVG and PNG, into the bundle in this folder.",
            callback=options.require_folder,
        ),
    ] = None,
    seed: options.Seed = 0,
    as_json: options.Json = False,
) -> None:
    """Load, surface and pressure of a centred press; with a protocol, press and retract."""
    from optopad.jobs.press_view import view_json, view_lines, view_press, write_pictures

    read = read_design(design, set_)
    with progress(quiet=as_json) as step:
        view = view_press(read, depth, protocol, on_step=lambda share: step("contact", share))
        files = [] if out is None else write_pictures(view, out, seed=seed)
    names = [str(file) for file in files]
    where = [f"files     {files[0].parent}/contact-*"] if files else []
    tell(as_json, lambda: view_json(view) | {"files": names}, lambda: [*view_lines(view), *where])


@contact.command()
def build(
    out: Annotated[
        Path,
        typer.Option(
            "--out",
            metavar="FILE",
            help="Where the library is written (.npz).",
            callback=options.file_name(".npz"),
        ),
    ] = Path("outputs/contact/profiles.npz"),
    workers: Annotated[
        int | None, typer.Option(min=1, max=256, help="Processes at work; default: one a processor.")
    ] = None,
    as_json: options.Json = False,
) -> None:
    """Solve the library of presses anew (two hours or more on two cores); interrupted, it goes on where it stopped."""
    import os

    from sims.contact.library.build import build_library, require_writable, write_library
    from sims.contact.library.profile_library import library_differences, shipped_library

    require_writable(out)

    def tell(done: int, total: int) -> None:
        if not as_json:
            typer.echo(f"solved    {done} of {total}", err=True)

    library = build_library(workers or os.cpu_count() or 1, tell)
    write_library(library, out)
    force, surface = library_differences(library, shipped_library())
    if as_json:
        print_json({"file": str(out), "force_difference": force, "surface_difference_tip_radii": surface})
        return
    say(f"file      {out}")
    say(
        f"beside the shipped library: force within {100 * force:.2g} %, surface within {surface:.2g} tip radii"
    )
