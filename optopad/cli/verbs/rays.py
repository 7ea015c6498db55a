"""Verb of the ray pictures: rays."""

from __future__ import annotations

from typing import Annotated

import typer

from optopad.cli import options
from optopad.cli.output import tell
from optopad.cli.progress import progress
from optopad.work.designs import read_design


def rays(
    design: options.Design,
    emitter: Annotated[
        str | None,
        typer.Option(metavar="E1", help="One emitter, by its name in the wiring table. Default: all."),
    ] = None,
    receiver: Annotated[
        str | None,
        typer.Option(
            metavar="R1", help="One receiver, likewise. With --emitter: a pair, cut along its chord."
        ),
    ] = None,
    press: Annotated[
        list[str] | None,
        typer.Option(
            "--press",
            metavar="X,Y,DEPTH",
            help="A press [mm]; repeatable. Default: both ends of the deadband if a verdict found one, else three "
            "depths, at the pair's middle or the pad's weakest place.",
        ),
    ] = None,
    count: Annotated[
        int, typer.Option(min=1, max=200, help="Paths drawn of the strongest kind of light.")
    ] = 24,
    set_: options.Set = None,
    out: options.Out = options.DEFAULT_OUT,
    seed: options.Seed = 0,
    as_json: options.Json = False,
) -> None:
    """Sample paths of light, untouched and pressed: mode 1, mode 2, scattered, lost; pictures into the bundle."""
    presses = tuple(options.parsed_press(text) for text in press or [])
    read = read_design(design, set_)

    from design.shape.cavity import cavity_of
    from optopad.jobs.ray_view import (
        RayRequest,
        part_number,
        view_json,
        view_lines,
        view_rays,
        write_pictures,
    )

    cavity = cavity_of(read)
    request = RayRequest(
        emitter=None if emitter is None else part_number(cavity.emitters, emitter, "--emitter"),
        receiver=None if receiver is None else part_number(cavity.receivers, receiver, "--receiver"),
        presses=presses,
        count=count,
    )
    with progress(quiet=as_json) as step:
        view = view_rays(read, request, out, seed=seed, on_step=step)
        files = write_pictures(view, out)
    names = [str(file) for file in files]
    where = [f"file      {file}" for file in files]
    tell(as_json, lambda: view_json(view) | {"files": names}, lambda: [*view_lines(view), *where])
