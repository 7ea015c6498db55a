"""The verb of the learners: train."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from optopad.cli import options
from optopad.cli.output import tell
from optopad.cli.progress import progress
from optopad.work.designs import read_design


def train(
    data: Annotated[
        list[Path],
        typer.Argument(
            metavar="DATA", help="Data sets or recordings with known presses (.nc), of one sensor."
        ),
    ],
    learner: Annotated[
        str,
        typer.Option(
            "--learner",
            metavar="NAME",
            help="kernel-ridge (the paper's), extra-trees, network, `all` of these; or signal-map.",
        ),
    ] = "extra-trees",
    design: Annotated[
        str | None,
        typer.Option(
            "--design", metavar="DESIGN", help="What the data must be of; adds its force to the model."
        ),
    ] = None,
    effort: Annotated[
        str,
        typer.Option("--effort", metavar="NAME", help="quick, default, full, or whole: how many samples."),
    ] = "default",
    set_: options.Set = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            metavar="FILE",
            help="Model (.optomodel), or a folder; by default beside the data.",
            callback=options.file_name(".optomodel", or_folder=True),
        ),
    ] = None,
    seed: options.Seed = 0,
    as_json: options.Json = False,
) -> None:
    """Train a model that tells touch, place and depth, on simulated or recorded presses; one file a model."""
    from design.errors import InputError
    from optopad.jobs.training import train_models

    if set_ and design is None:
        raise InputError("--set: changes a design; name it with --design")
    read = None if design is None else read_design(design, set_)
    with progress(quiet=as_json) as step:
        found = train_models(data, learner, out, design=read, effort=effort, seed=seed, on_step=step)
    tell(as_json, found.to_json, found.lines)
