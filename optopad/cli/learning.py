"""Commands for models: train, predict, evaluate, and calibrate, which fits the simulation to a manufactured pad."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from optopad.cli import options
from optopad.screen.output import progress, tell
from optopad.work import read_design


def evaluate(
    data: Annotated[
        Path,
        typer.Argument(
            metavar="DATA", help="Data set or recording with known presses (.nc, .optorec, .mcap, bag)."
        ),
    ],
    model: Annotated[
        list[Path], typer.Option("--model", metavar="FILE", help="Trained model (.optomodel). Repeatable.")
    ],
    design: Annotated[
        str | None,
        typer.Option(
            "--design", metavar="DESIGN", help="Design of the data: its workspace and published results."
        ),
    ] = None,
    topic: options.Topic = None,
    press_topic: options.PressTopic = None,
    set_: options.Set = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            metavar="FOLDER",
            help="Folder of the tables; default: next to the data.",
            callback=options.require_folder,
        ),
    ] = None,
    as_json: options.Json = False,
) -> None:
    """Report the errors of models on known presses: tables of touch, location and depth, plots, a page."""
    from optopad.jobs.evaluation import evaluate as judge
    from optopad.jobs.prediction import write_accuracy
    from optopad.screen.prediction import accuracy_lines

    read = read_design(design, set_) if design is not None else None
    data = options.named(data)
    folder = options.require_folder(out or data.with_name(f"{data.stem}-evaluation"))
    with progress(quiet=as_json) as step:
        found, workspace = judge(data, model, read, topic=topic, press_topic=press_topic, on_step=step)
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
            help="kernel-ridge (the paper's), extra-trees, signal-map, or all.",
        ),
    ] = None,
    quick: Annotated[bool, typer.Option("--quick", help="A thinned protocol, for a first look.")] = False,
    full: Annotated[bool, typer.Option("--full", help="24,000 samples in the kernel.")] = False,
    protocol: Annotated[
        str | None, typer.Option("--protocol", metavar="NAME", help="Packaged protocol or a file (.toml).")
    ] = None,
    draws: Annotated[
        int, typer.Option("--draws", metavar="N", help="Draws of noise, drift and offsets.")
    ] = 1,
    set_: options.Set = None,
    out: options.Out = options.DEFAULT_OUT,
    seed: options.Seed = 0,
    as_json: options.Json = False,
) -> None:
    """Predict the errors of touch, location and depth: simulate a data collection, train models, evaluate them."""
    from optopad.design.errors import InputError

    if quick and full:
        raise InputError("predict: --quick and --full contradict each other; give one of them")
    read = read_design(design, set_)
    from optopad.jobs.prediction import FULL, QUICK, USUAL, predict
    from optopad.screen.prediction import accuracy_lines

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


def calibrate(
    design: options.Design,
    data: Annotated[
        Path,
        typer.Argument(
            metavar="DATA",
            help="Recording of 10 to 50 presses of the built pad (.nc, .optorec, .mcap, bag).",
        ),
    ],
    no_model: Annotated[
        bool, typer.Option("--no-model", help="Only fit; do not trace the map for the pad's model.")
    ] = False,
    quick: Annotated[bool, typer.Option("--quick", help="A coarser map, in a third of the time.")] = False,
    force: Annotated[
        Path | None,
        typer.Option(
            "--force",
            metavar="CSV",
            help="A load cell's log of these presses (time, force_n): also fit the modulus.",
        ),
    ] = None,
    offset: options.Offset = None,
    topic: options.Topic = None,
    press_topic: options.PressTopic = None,
    set_: options.Set = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            metavar="FOLDER",
            help="Folder of the calibrated design; default: next to the data.",
            callback=options.require_folder,
        ),
    ] = None,
    seed: options.Seed = 0,
    as_json: options.Json = False,
) -> None:
    """Fit heights, LED size, reflectances, index and gains to presses of a built pad; writes its design and a model."""
    from optopad.design.errors import InputError
    from optopad.jobs.calibration import calibrate as fit
    from optopad.jobs.calibration import earlier_model_note, write_calibration

    read = read_design(design, set_)
    data = options.named(data)
    folder = options.require_folder(out or data.with_name(f"{data.stem}-calibration"))
    shift = options.parsed_offset(offset)
    if offset is not None and force is None:
        raise InputError("--offset: shifts a load cell's log; give --force, too")
    with progress(quiet=as_json) as step:
        made = fit(
            read,
            data,
            with_model=not no_model,
            quick=quick,
            seed=seed,
            on_step=step,
            force=force,
            offset=shift,
            topic=topic,
            press_topic=press_topic,
        )
        files = write_calibration(made, read, folder)
        made = replace(made, notes=(*made.notes, *earlier_model_note(made, folder)))
    where = f"files     {folder} ({', '.join(one.name for one in files)})"
    tell(as_json, lambda: made.to_json(read), lambda: [*made.lines, where])


def train(
    data: Annotated[
        list[Path],
        typer.Argument(
            metavar="DATA",
            help="Data sets or recordings with known presses (.nc, .optorec, .mcap, bag), of one sensor.",
        ),
    ],
    learner: Annotated[
        str,
        typer.Option(
            "--learner",
            metavar="NAME",
            help="kernel-ridge (the paper's), extra-trees, `all` of these; or signal-map.",
        ),
    ] = "extra-trees",
    design: Annotated[
        str | None,
        typer.Option(
            "--design", metavar="DESIGN", help="Design of the data; adds its force curve to the model."
        ),
    ] = None,
    effort: Annotated[
        str,
        typer.Option("--effort", metavar="NAME", help="Number of samples: quick, default, or full."),
    ] = "default",
    topic: options.Topic = None,
    press_topic: options.PressTopic = None,
    set_: options.Set = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            metavar="FILE",
            help="Model (.optomodel), or a folder; default: next to the data.",
            callback=options.file_name(".optomodel", or_folder=True),
        ),
    ] = None,
    seed: options.Seed = 0,
    as_json: options.Json = False,
) -> None:
    """Train models that estimate touch, location and depth on simulated or recorded presses; one file per model."""
    from optopad.design.errors import InputError
    from optopad.jobs.training import train_models

    if set_ and design is None:
        raise InputError("--set: changes a design; name it with --design")
    read = None if design is None else read_design(design, set_)
    with progress(quiet=as_json) as step:
        found = train_models(
            [options.named(one) for one in data],
            learner,
            out,
            design=read,
            effort=effort,
            seed=seed,
            topic=topic,
            press_topic=press_topic,
            on_step=step,
        )
    tell(as_json, found.to_json, found.lines)
