"""Evaluates models on a data set with known presses; writes tables, pictures and a page."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from optopad.cli.verb import named, require_folder, typed, verb
from optopad.design.arrays import FloatArray
from optopad.design.errors import InputError
from optopad.design.file_sets import written_together
from optopad.design.io import write_text_atomically
from optopad.design.progress import OnStep, silent
from optopad.design.shape.cavity import workspace_of
from optopad.design.shape.outline import Outline, rectangle
from optopad.design.spec import SensorDesign
from optopad.report.accuracy import accuracy_page
from optopad.report.sections.drawings import Drawing
from optopad.screen.output import Told
from optopad.screen.prediction import ModelAccuracy, PredictedAccuracy, accuracy_lines, accuracy_of
from optopad.sims.learning.inference.header import require_design as require_model_of
from optopad.sims.learning.inference.model_file import load_model
from optopad.sims.learning.inference.signal_map import KIND as SIGNAL_MAP
from optopad.sims.learning.inference.touch_model import TouchModel
from optopad.sims.learning.tables import ERROR_DEPTHS_MM, judged, needed_samples, published_touch
from optopad.sims.plots.accuracy import plot_arrows, plot_depths, plot_errors, plot_touch, shown_places_mm
from optopad.sims.plots.files import write_plot
from optopad.sims.plots.style import plain_style
from optopad.sims.readings.dataset import read_data, require_design
from optopad.sims.readings.press_data import PressData, data_notes, left_out_note
from optopad.sims.two_touch_errors import errors_on_data, knows_two
from optopad.work import as_netcdf, read_design

FEWEST_SAMPLES = 10


@verb(
    data=typed("DATA"),
    model=typed("FILE"),
    design=typed("DESIGN"),
    out=typed("FOLDER", type=Path, callback=require_folder),
)
def evaluate(
    data: Path,
    *,
    model: Sequence[Path],
    design: str | None = None,
    topic: str | None = None,
    press_topic: str | None = None,
    set_: Sequence[str] = (),
    out: Path | None = None,
    on_step: OnStep = silent,
) -> Told:
    """Report the errors of models on known presses: tables of touch, location and depth, plots, a page.

    Parameters
    ----------
    data : Data set or recording with known presses (.nc, .optorec, .mcap, bag).
    model : Trained model (.optomodel). Repeatable.
    design : Design of the data: its workspace and published results.
    out : Folder of the tables; default: next to the data.

    Raises
    ------
    InputError : data or models cannot be read or are of different designs, or there are too few samples.
    """
    read = None if design is None else read_design(design, set_)
    file = named(data)
    folder = require_folder(out or file.with_name(f"{file.stem}-evaluation"))
    found, workspace = _evaluated(file, model, read, topic, press_topic, on_step)
    page, document, *_ = write_accuracy(found, workspace, folder, "evaluation")
    files = f"files     {folder} ({page.name}, {document.name}, pictures)"
    return Told(found.to_json(), [*accuracy_lines(found), files])


def _evaluated(
    file: Path,
    models: Sequence[Path],
    design: SensorDesign | None,
    topic: str | None,
    press_topic: str | None,
    on_step: OnStep,
) -> tuple[PredictedAccuracy, Outline]:
    """Tables of the models' errors, and the workspace for the pictures."""
    with as_netcdf(file, topic, press_topic) as netcdf:
        data = read_data(netcdf, design)
    notes = [*(require_design(data, design, what=str(file)) if design is not None else ())]
    loaded = [(str(path), load_model(path)) for path in models]
    for name, model in loaded:
        _require_fit(name, model, data)
    tested, told = _test_samples(data)
    single = tested.of_one_tip()
    if len(single) < FEWEST_SAMPLES:
        raise InputError(
            f"data: {len(single)} of {len(tested)} samples have one touch or none, needs {FEWEST_SAMPLES} for their "
            "tables; record some"
        )
    workspace = workspace_of(design) if design is not None else _range_of(tested)
    notes += data_notes(data)
    by_name = _named(loaded)
    found = tuple(
        accuracy
        for name, model in by_name.items()
        for accuracy in accuracies(model, single, workspace, on_step=on_step, learner=name)
    )
    touches = tuple(
        errors_on_data(name, model, tested, on_step) for name, model in by_name.items() if knows_two(model)
    )
    notes += _left_out(by_name, tested)
    return (
        PredictedAccuracy(
            name=design.name if design is not None else file.stem,
            digest=data.design_digest,
            found=found,
            published=None if design is None else published_touch(design),
            touches=touches,
            notes=(*notes, told),
            settings={
                "data": str(file),
                "models": {name: str(path) for name, path in zip(by_name, models, strict=True)},
            },
        ),
        workspace,
    )


def _left_out(models: Mapping[str, TouchModel], tested: PressData) -> list[str]:
    """Notes on the frames of two touches that models of one do not take."""
    one = [name for name, model in models.items() if not knows_two(model)]
    more = left_out_note(
        tested.has_more,
        f"{' and '.join(one)} know{'s' if len(one) == 1 else ''} one touch; `optopad train DATA --learner {SIGNAL_MAP} "
        "--design DESIGN --touches 2` makes a model of two",
    )
    return [more] if one and more else []


def write_accuracy(found: PredictedAccuracy, workspace: Outline, folder: Path, stem: str) -> tuple[Path, ...]:
    """Write ``<stem>.json``, ``<stem>.html`` and the pictures ``<stem>-*`` into a folder; returns the files.

    Parameters
    ----------
    workspace : workspace of the presses
    """
    names, drawings = [f"{stem}.html", f"{stem}.json"], {}
    with written_together(folder) as made, plain_style():
        for name, (figure, shows) in _figures(found, workspace).items():
            svg, png = write_plot(figure, made / f"{stem}-{name}")
            names += [svg.name, png.name]
            drawings[name] = Drawing(stem=svg.stem, shows=shows, svg=svg.read_text(encoding="utf-8"))
        write_text_atomically(made / names[0], accuracy_page(found, drawings))
        write_text_atomically(made / names[1], json.dumps(found.to_json(), indent=2, allow_nan=False) + "\n")
    return tuple(folder / name for name in names)


def _figures(found: PredictedAccuracy, workspace: Outline) -> dict[str, tuple[Figure, str]]:
    pooled = found.pooled()
    first = pooled[found.learners[0]]
    sets = {one.test_set: one.touch for one in found.found if one.learner == first.learner}
    figures = {
        "touch": (plot_touch(sets, found.published), "Share of correct touches against depth"),
        "errors": (
            plot_errors({name: one.errors for name, one in pooled.items()}, found.bound_mm),
            "Median error of location and of depth against depth, by model",
        ),
    }
    for learner, one in pooled.items():
        shown = one.presses.only(one.presses.session_number == 0)
        figures[f"arrows-{learner}"] = (
            plot_arrows(shown, ERROR_DEPTHS_MM, workspace),
            f"Arrows from the true to the estimated location, {learner}, first test set",
        )
        figures[f"depths-{learner}"] = (
            plot_depths(shown, shown_places_mm(workspace)),
            f"Estimated against true depth at single locations, {learner}, first test set",
        )
    return figures


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
