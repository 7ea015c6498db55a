"""Trains models on data with known presses, and writes model files."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from optopad.design.errors import InputError
from optopad.design.files import made_folder
from optopad.design.progress import OnStep, silent
from optopad.design.spec import SensorDesign
from optopad.fabrication.driver.recording.bag import is_bag
from optopad.sims.learning.inference.header import ForceCurve, ModelHeader
from optopad.sims.learning.inference.model_file import save_model
from optopad.sims.learning.inference.touch_model import TouchModel
from optopad.sims.learning.learners import LEARNERS, Learner
from optopad.sims.learning.samples import prepared
from optopad.sims.learning.settings import EFFORTS
from optopad.sims.readings.dataset import PressData, data_notes, joined, read_data, require_design
from optopad.work import as_netcdf, is_recording

SUFFIX = ".optomodel"
ALL = "all"
SIGNAL_MAP = "signal-map"


SHOWN = {
    "gamma_times_median": "gamma x median distance",
    "lambda": "lambda",
    "fit_samples": "samples",
    "trees": "trees",
    "held_out_location_mm": "held-out location, median mm",
    "held_out_depth_mm": "depth, median mm",
    "touch_held_out_right": "touch, held out",
}
"""Label of each setting of a model that is shown to the user; the model file contains all settings."""


@dataclass(frozen=True, kw_only=True)
class TrainedModel:
    """A trained model on the disk.

    Attributes
    ----------
    file : path of the model
    header : description of the training data, and the settings that the training chose
    """

    file: Path
    header: ModelHeader

    def to_json(self) -> dict[str, Any]:
        """File and header as plain data for JSON."""
        return {
            "learner": self.header.kind,
            "file": str(self.file),
            "bytes": self.file.stat().st_size,
            "settings": dict(self.header.settings),
        }


@dataclass(frozen=True, kw_only=True)
class Training:
    """Trained models, and a description of their training data.

    Attributes
    ----------
    models : trained models, in the order of the learners
    facts : numbers of samples, locations and presses, and of omitted data
    notes : sentences about missing information and saturation in the data
    """

    models: tuple[TrainedModel, ...]
    facts: dict[str, Any]
    notes: tuple[str, ...]

    def to_json(self) -> dict[str, Any]:
        """The models and the description of the data as plain data for JSON."""
        return {
            "models": [one.to_json() for one in self.models],
            "data": self.facts,
            "notes": list(self.notes),
        }

    def lines(self) -> list[str]:
        """The training as text: used and omitted data, then each model with its file."""
        facts = self.facts
        lines = [
            f"data      {facts['samples']} samples, {facts['touched_samples']} touched; "
            f"{facts['locations']} locations, {facts['presses']} presses; {', '.join(facts['sets'])}"
        ]
        lines += [f"left out  {text}" for text in facts["left_out"]]
        lines += [f"note      {text}" for text in self.notes]
        for model in self.models:
            lines.append(f"model     {model.header.kind}: {_chosen(model.header.settings)}")
            lines.append(f"file      {model.file} ({model.file.stat().st_size / 1e6:.1f} MB)")
        return lines


def _chosen(settings: Any) -> str:
    shown = [f"{words} {_number(settings[name])}" for name, words in SHOWN.items() if name in settings]
    border = settings.get("search_at_border", [])
    warned = [f"the search ended at the border of its grid of {' and '.join(border)}"] if border else []
    return ", ".join(shown + warned)


def _number(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def train_models(
    files: Sequence[Path],
    learner: str,
    out: Path | None,
    *,
    design: SensorDesign | None = None,
    effort: str = "default",
    seed: int = 0,
    topic: str | None = None,
    press_topic: str | None = None,
    on_step: OnStep = silent,
) -> Training:
    """Train one learner, or all, on the training sets of one or several files.

    Parameters
    ----------
    files : data sets or recordings
    learner : name of a learner, ``all``, or ``signal-map``, which is not part of ``all``
    out : file of the model for one learner, or a folder; None for the folder of the first data file
    design : design of the data; its force curve is added to the models
    topic, press_topic : topics of frames and presses in bags of several sensors

    Raises
    ------
    InputError : a name is unknown, or the data are of another design, too few, or without known presses or training
        sets.
    OutputError : the folder cannot be written.
    """
    learners = _learners(learner, design, effort, seed)
    settings = EFFORTS.get(effort)
    if settings is None:
        raise InputError(f"--effort: {effort!r} is refused: give {', '.join(EFFORTS)}")
    places = _files(tuple(learners), files, out)
    data, notes = _training_data(files, design, topic, press_topic)
    force = None if design is None else _load_curve(design)
    facts = prepared(data).facts()
    models = []
    for name, fit in learners.items():
        step = _named(on_step, name)
        model = fit(data, seed=seed, on_step=step, settings=settings)
        header = replace(model.header, force_curve=force)
        save_model(places[name], _with_header(model, header))
        models.append(TrainedModel(file=places[name], header=header))
    return Training(models=tuple(models), facts=facts, notes=notes)


def _learners(learner: str, design: SensorDesign | None, effort: str, seed: int) -> dict[str, Learner]:
    """The requested learners by name; the learner `signal-map` needs the design."""
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
    from optopad.sims.learning.map_learner import signal_map_learner

    return {SIGNAL_MAP: signal_map_learner(design, quick=effort == "quick", seed=seed)}


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
    train = data.role("train")
    if not len(train):
        raise InputError(
            "data: no set for training, all have the role test; name a data set with training sets"
        )
    return train, (*notes, *data_notes(train))


def _load_curve(design: SensorDesign) -> ForceCurve:
    from optopad.sims.learning.traced_map import load_curve

    return load_curve(design)


def _with_header(model: Any, header: ModelHeader) -> TouchModel:
    changed: TouchModel = replace(model, header=header)
    return changed


def _named(on_step: OnStep, name: str) -> OnStep:
    return lambda stage, share: on_step(f"{name}: {stage}", share)
