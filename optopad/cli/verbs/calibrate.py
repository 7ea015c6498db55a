"""The verb calibrate: fit the twin to a build."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from optopad.cli import options
from optopad.cli.output import tell
from optopad.cli.progress import progress
from optopad.work.designs import read_design


def calibrate(
    design: options.Design,
    data: Annotated[
        Path, typer.Argument(metavar="DATA", help="Recording of 10 to 50 presses of the build (.nc).")
    ],
    no_model: Annotated[
        bool, typer.Option("--no-model", help="Only fit; do not trace the map for the build's model.")
    ] = False,
    quick: Annotated[bool, typer.Option("--quick", help="A coarser map, in a third of the time.")] = False,
    set_: options.Set = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            metavar="FOLDER",
            help="Where the twin goes; by default beside the data.",
            callback=options.require_folder,
        ),
    ] = None,
    seed: options.Seed = 0,
    as_json: options.Json = False,
) -> None:
    """Fit heights, LED size, reflectances, index and gains to presses of a build; its design and a model for it."""
    from optopad.jobs.calibration import calibrate as fit
    from optopad.jobs.calibration import earlier_model_note, write_calibration

    read = read_design(design, set_)
    folder = options.require_folder(out or data.with_name(f"{data.stem}-calibration"))
    with progress(quiet=as_json) as step:
        made = fit(read, data, with_model=not no_model, quick=quick, seed=seed, on_step=step)
        files = write_calibration(made, read, folder)
        made = replace(made, notes=(*made.notes, *earlier_model_note(made, folder)))
    where = f"files     {folder} ({', '.join(one.name for one in files)})"
    tell(as_json, lambda: made.to_json(read), lambda: [*made.report.lines, *made.notes, where])
