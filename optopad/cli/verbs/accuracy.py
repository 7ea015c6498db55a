"""Verbs of what a model tells of presses: evaluate, predict."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from optopad.cli import options
from optopad.cli.output import tell
from optopad.cli.progress import progress
from optopad.work.designs import read_design


def evaluate(
    data: Annotated[Path, typer.Argument(metavar="DATA", help="Data set with known presses (.nc).")],
    model: Annotated[
        list[Path], typer.Option("--model", metavar="FILE", help="Trained model (.optomodel). Repeatable.")
    ],
    design: Annotated[
        str | None,
        typer.Option(
            "--design", metavar="DESIGN", help="Its design: workspace, and what was published of it."
        ),
    ] = None,
    set_: options.Set = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            metavar="FOLDER",
            help="Where the tables go; by default beside the data.",
            callback=options.require_folder,
        ),
    ] = None,
    as_json: options.Json = False,
) -> None:
    """Tables of touch, place and depth as in the paper, arrow plots, and a page, for models on known presses."""
    from optopad.jobs.accuracy_files import write_accuracy
    from optopad.jobs.evaluation import evaluate as judge
    from optopad.results.accuracy import accuracy_lines

    read = read_design(design, set_) if design is not None else None
    folder = options.require_folder(out or data.with_name(f"{data.stem}-evaluation"))
    with progress(quiet=as_json) as step:
        found, workspace = judge(data, model, read, on_step=step)
        made = write_accuracy(found, workspace, folder, "evaluation")
    files = f"files     {folder} ({made[0].name}, {made[1].name}, pictures)"
    tell(as_json, found.to_json, lambda: [*accuracy_lines(found), files])


def predict(
    design: options.Design,
    learner: Annotated[
        list[str] | None,
        typer.Option(
            "--learner",
            metavar="NAME",
            help="kernel-ridge (the paper's), extra-trees, network, signal-map, or all.",
        ),
    ] = None,
    quick: Annotated[bool, typer.Option("--quick", help="A thinned protocol: a first look.")] = False,
    full: Annotated[bool, typer.Option("--full", help="24,000 samples in the kernel.")] = False,
    protocol: Annotated[
        str | None, typer.Option("--protocol", metavar="NAME", help="Packaged protocol or a file (.toml).")
    ] = None,
    draws: Annotated[
        int, typer.Option("--draws", metavar="N", help="Times that noise, drift and offsets are drawn.")
    ] = 1,
    set_: options.Set = None,
    out: options.Out = options.DEFAULT_OUT,
    seed: options.Seed = 0,
    as_json: options.Json = False,
) -> None:
    """How well touch, place and depth will be told: a whole data collection, simulated, learned and judged."""
    from design.errors import InputError

    if quick and full:
        raise InputError("predict: --quick and --full contradict each other; give one of them")
    read = read_design(design, set_)
    from optopad.jobs.prediction import FULL, QUICK, USUAL, predict
    from optopad.results.accuracy import accuracy_lines

    with progress(quiet=as_json) as step:
        found, folder = predict(
            read,
            out,
            effort=QUICK if quick else FULL if full else USUAL,
            learners=learner or (),
            protocol=protocol,
            draws=draws,
            seed=seed,
            on_step=step,
        )
    files = f"files     {folder / 'sims'} (prediction.html, prediction.json, pictures, models)"
    tell(as_json, found.to_json, lambda: [*accuracy_lines(found), files])
