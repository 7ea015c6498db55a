"""Verbs of what a model tells of presses: evaluate, predict."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from optopad.cli.common import JsonOption, SetOption, print_json, read_design, say
from optopad.cli.progress import progress


def register(app: typer.Typer) -> None:
    """Add this group's verbs."""
    app.command()(evaluate)


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
    set_: SetOption = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="FOLDER", help="Where the tables go; by default beside the data."),
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Tables of touch, place and depth as in the paper, arrow plots, and a page, for models on known presses."""
    from optopad.accuracy import accuracy_lines
    from optopad.accuracy_files import write_accuracy
    from optopad.evaluation import evaluate as judge

    read = read_design(design, set_) if design is not None else None
    folder = out or data.with_name(f"{data.stem}-evaluation")
    with progress(quiet=as_json) as step:
        found, workspace = judge(data, model, read, on_step=step)
        made = write_accuracy(found, workspace, folder, "evaluation")
    if as_json:
        print_json(found.to_json())
        return
    say("\n".join(accuracy_lines(found)))
    say(f"files     {folder} ({made[0].name}, {made[1].name}, pictures)")
