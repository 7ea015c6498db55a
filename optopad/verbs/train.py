"""Trains models on data with known presses, and writes model files."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any

from optopad.cli.verb import file_name, named, typed, verb
from optopad.design.draft import Draft
from optopad.design.errors import InputError
from optopad.design.files import made_folder
from optopad.design.progress import OnStep, silent
from optopad.design.spec import SensorDesign
from optopad.fabrication.driver.recording.bag import is_bag
from optopad.screen.training import TrainedModel, Training
from optopad.sims.learning.inference.model_file import save_model
from optopad.sims.learning.inference.signal_map import KIND as SIGNAL_MAP
from optopad.sims.learning.learners import EFFORTS, LEARNERS, Learner
from optopad.sims.learning.map_learner import signal_map_learner
from optopad.sims.learning.samples import prepared
from optopad.sims.learning.traced_map import load_curve
from optopad.sims.readings.dataset import PressData, data_notes, joined, read_data, require_design
from optopad.sims.readings.press_data import left_out_note
from optopad.sims.two_touch_errors import require_touches
from optopad.work import as_netcdf, is_recording, read_design

SUFFIX = ".optomodel"
ALL = "all"
MORE = (
    "models are trained on single touches. A signal map learns two touches from the light model: train it with "
    "--learner signal-map --design DESIGN --touches 2, and judge it on such frames with `optopad evaluate`"
)


@verb(
    data=typed("DATA"),
    learner=typed("NAME"),
    touches=typed("N"),
    design=typed("DESIGN"),
    effort=typed("NAME"),
    out=typed("FILE", type=Path, callback=file_name(SUFFIX, or_folder=True)),
)
def train(
    data: Sequence[Path],
    *,
    learner: str = "extra-trees",
    touches: int = 1,
    design: str | None = None,
    effort: str = "default",
    topic: str | None = None,
    press_topic: str | None = None,
    set_: Sequence[str] = (),
    out: Path | None = None,
    seed: int = 0,
    on_step: OnStep = silent,
) -> Training:
    """Train models that estimate touch, location and depth on simulated or recorded presses; one file per model.

    Parameters
    ----------
    data : Data sets or recordings with known presses (.nc, .optorec, .mcap, bag), of one sensor.
    learner : kernel-ridge (the paper's), extra-trees, `all` of these; or signal-map.
    touches : Number of touches at once that a signal map knows, 1 or 2.
    design : Design of the data; adds its force curve to the model.
    effort : Number of samples: quick, default, or full.
    out : Model (.optomodel), or a folder; default: next to the data.

    Raises
    ------
    InputError : a name or number is refused, or the data are of another design, too few, or without known presses or
        training sets.
    OutputError : the folder cannot be written.
    """
    if set_ and design is None:
        raise InputError("--set: changes a design; name it with --design")
    read, files = None if design is None else read_design(design, set_), [named(one) for one in data]
    require_touches(touches, None if read is None else Draft.of(read))
    learners = _learners(learner, read, effort, seed, touches)
    settings = EFFORTS.get(effort)
    if settings is None:
        raise InputError(f"--effort: {effort!r} is refused: give {', '.join(EFFORTS)}")
    places = _files(tuple(learners), files, out)
    presses, notes = _training_data(files, read, topic, press_topic)
    force = None if read is None else load_curve(read)
    facts = prepared(presses).facts()
    models = []
    for name, fit in learners.items():
        model: Any = fit(presses, seed=seed, on_step=_named(on_step, name), settings=settings)
        header = replace(model.header, force_curve=force)
        save_model(places[name], replace(model, header=header))
        models.append(TrainedModel(file=places[name], header=header))
    return Training(models=tuple(models), facts=facts, notes=notes)


def _learners(
    learner: str, design: SensorDesign | None, effort: str, seed: int, touches: int
) -> dict[str, Learner]:
    """The requested learners by name; the learner `signal-map` needs the design."""
    if touches > 1 and learner != SIGNAL_MAP:
        raise InputError(
            f"--touches: {touches} is refused for --learner {learner}, which knows one touch; give --learner "
            f"{SIGNAL_MAP}"
        )
    if learner == ALL:
        return dict(LEARNERS)
    if learner in LEARNERS:
        return {learner: LEARNERS[learner]}
    if learner != SIGNAL_MAP:
        raise InputError(
            f"--learner: {learner!r} is refused: give {', '.join(LEARNERS)}, {SIGNAL_MAP}, or {ALL}"
        )
    if design is None:
        raise InputError(f"--learner: {SIGNAL_MAP} is computed from a design; name it with --design")
    return {SIGNAL_MAP: signal_map_learner(design, quick=effort == "quick", seed=seed, touches=touches)}


def _files(names: Sequence[str], files: Sequence[Path], out: Path | None) -> dict[str, Path]:
    if not files:
        raise InputError("data: none given; name at least one file")
    stem = files[0].name.partition(".")[0]
    if out is not None and out.suffix.lower() == SUFFIX:
        if len(names) > 1:
            raise InputError(f"--out: {out} is one file for {len(names)} models; give a folder")
        found = {names[0]: out}
    else:
        folder = files[0].parent if out is None else out
        found = {name: folder / f"{stem}-{name}{SUFFIX}" for name in names}
    for file in found.values():
        made_folder(file.parent)
    return found


def _training_data(
    files: Sequence[Path], design: SensorDesign | None, topic: str | None, press_topic: str | None
) -> tuple[PressData, tuple[str, ...]]:
    """The data with role "train", and notes; topics are for the bags among the files, of which there must be one."""
    bags = [file for file in files if is_recording(file) and is_bag(file)]
    with ExitStack() as opened:
        every = [
            opened.enter_context(
                as_netcdf(file, topic, press_topic) if file in bags or not bags else as_netcdf(file)
            )
            for file in files
        ]
        data = joined([read_data(file, design) for file in every])
    notes = () if design is None else require_design(data, design)
    whole = data.role("train")
    train = whole.of_one_tip()
    if not len(train):
        raise InputError(
            "data: no set for training, all have the role test; name a data set with training sets"
        )
    more = left_out_note(whole.has_more, MORE)
    return train, (*notes, *data_notes(train), *filter(None, (more,)))


def _named(on_step: OnStep, name: str) -> OnStep:
    return lambda stage, share: on_step(f"{name}: {stage}", share)
