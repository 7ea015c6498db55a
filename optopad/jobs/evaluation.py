"""Evaluation of models on a data set with known presses."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from optopad.design.arrays import FloatArray
from optopad.design.errors import InputError
from optopad.design.progress import OnStep
from optopad.design.shape.cavity import workspace_of
from optopad.design.shape.outline import Outline, rectangle
from optopad.design.spec import SensorDesign
from optopad.screen.prediction import ModelAccuracy, PredictedAccuracy, accuracy_of
from optopad.sims.learning.inference.header import require_design as require_model_of
from optopad.sims.learning.inference.model_file import load_model
from optopad.sims.learning.inference.touch_model import TouchModel
from optopad.sims.learning.tables import judged, needed_samples, published_touch
from optopad.sims.plots.accuracy import shown_places_mm
from optopad.sims.readings.dataset import read_data, require_design
from optopad.sims.readings.press_data import PressData, data_notes
from optopad.work import as_netcdf

FEWEST_SAMPLES = 10


def evaluate(
    file: Path,
    models: Sequence[Path],
    design: SensorDesign | None,
    *,
    topic: str | None = None,
    press_topic: str | None = None,
    on_step: OnStep,
) -> tuple[PredictedAccuracy, Outline]:
    """Evaluate trained models on a data set with known presses.

    Parameters
    ----------
    models : model files; each must be of the same design as the data
    design : design of the data, for workspace and published results; if None, the range of the presses is the workspace
    topic, press_topic : topics of frames and presses in a bag of several sensors

    Returns
    -------
    tables of errors, and the workspace for the pictures

    Raises
    ------
    InputError : data or models cannot be read or are of different designs, or there are too few samples.
    """
    with as_netcdf(file, topic, press_topic) as netcdf:
        data = read_data(netcdf, design)
    notes = [*(require_design(data, design, what=str(file)) if design is not None else ())]
    loaded = [(str(path), load_model(path)) for path in models]
    for name, model in loaded:
        _require_fit(name, model, data)
    tested, told = _test_samples(data)
    workspace = workspace_of(design) if design is not None else _range_of(tested)
    notes += data_notes(data)
    named = _named(loaded)
    found = tuple(
        accuracy
        for name, model in named.items()
        for accuracy in accuracies(model, tested, workspace, on_step=on_step, learner=name)
    )
    return (
        PredictedAccuracy(
            name=design.name if design is not None else file.stem,
            digest=data.design_digest,
            found=found,
            published=None if design is None else published_touch(design),
            notes=(*notes, told),
            settings={
                "data": str(file),
                "models": {name: str(path) for name, path in zip(_named(loaded), models, strict=True)},
            },
        ),
        workspace,
    )


def accuracies(
    model: TouchModel, data: PressData, workspace: Outline, *, on_step: OnStep, learner: str = ""
) -> list[ModelAccuracy]:
    """Tables of one model's errors, one per test set.

    Parameters
    ----------
    data : samples of the test sets
    learner : name of the model in the tables; if "", the model's kind is its name
    """
    name, made = learner or model.header.kind, []
    numbers = np.unique(data.set_number)
    for done, number in enumerate(numbers):
        on_step(f"evaluation of {name}", done / len(numbers))
        info = data.sets[int(number)]
        of_set = needed_samples(data.only(data.set_number == number), shown_places_mm(workspace))
        said = model.predict(of_set.features().astype(np.float64))
        made.append(accuracy_of(name, info.name, info.is_ambient, [judged(of_set, said)]))
    on_step(f"evaluation of {name}", 1.0)
    return made


def _test_samples(data: PressData) -> tuple[PressData, str]:
    """Samples of the test sets, or of all sets if none is a test set, and a note that names the chosen sets."""
    tested = data.role("test")
    told = "judged on the test sets alone"
    if not len(tested):
        tested, told = (
            data,
            (
                "the data have no test set, so all samples are judged: errors of samples that the model "
                "was trained on are too small"
            ),
        )
    if len(tested) < FEWEST_SAMPLES:
        raise InputError(f"data: {len(tested)} samples to judge, needs {FEWEST_SAMPLES}; record more presses")
    return tested, told


def _require_fit(name: str, model: TouchModel, data: PressData) -> None:
    header = model.header
    if data.design_digest is not None:
        try:
            require_model_of(header, data.design_digest)
        except InputError as err:
            raise InputError(f"{name}: {err}") from None
    if header.pair_names != data.pair_names:
        raise InputError(
            f"{name}: a model of {len(header.emitter_names)} emitters and {len(header.receiver_names)} receivers, the "
            f"data have {len(data.emitter_names)} and {len(data.receiver_names)}, or other names; train on these data"
        )


def _named(loaded: Sequence[tuple[str, TouchModel]]) -> Mapping[str, TouchModel]:
    kinds = [model.header.kind for _, model in loaded]
    stems = [f"{kind} ({Path(name).stem})" for kind, (name, _) in zip(kinds, loaded, strict=True)]
    found = {}
    for number, (_, model) in enumerate(loaded):
        kind, stem = kinds[number], stems[number]
        unique = kind if kinds.count(kind) == 1 else stem
        found[unique if stems.count(stem) == 1 else f"{stem} {number + 1}"] = model
    return found


def _range_of(data: PressData) -> Outline:
    low: FloatArray = data.press_mm[:, :2].min(axis=0)
    high: FloatArray = data.press_mm[:, :2].max(axis=0)
    return rectangle((float(low[0]), float(low[1]), float(high[0]), float(high[1])))
