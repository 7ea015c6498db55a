"""Calibration: fits a design to a recording of its manufactured pad, and makes a model that reads this pad."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from optopad.cli.options import named, parsed_offset, require_folder
from optopad.cli.verb import typed, verb
from optopad.design.arrays import FloatArray
from optopad.design.errors import InputError
from optopad.design.file_sets import written_together
from optopad.design.io import save_design, write_text_atomically
from optopad.design.netcdf_file import read_netcdf
from optopad.design.progress import OnStep, silent
from optopad.design.spec import SensorDesign
from optopad.fabrication.driver.recording.force_log import ForceLog, read_force_log
from optopad.fabrication.driver.recording.joined_log import Offset, measured_s
from optopad.fabrication.driver.recording.recorded import require_rising
from optopad.screen.calibration import CalibratedBuild
from optopad.sims.learning.calibration import Calibration, calibrated, report_of
from optopad.sims.learning.force_checks import require_motion
from optopad.sims.learning.force_fit import fit_force
from optopad.sims.learning.inference.model_file import save_model
from optopad.sims.learning.inference.signal_map import SignalMapModel
from optopad.sims.learning.map_learner import fit_signal_map, map_header, mapped
from optopad.sims.learning.press_force import TipPath
from optopad.sims.readings.dataset import read_data, require_design
from optopad.sims.readings.press_data import PressData, data_notes
from optopad.verbs.force_clock import force_clock
from optopad.work import as_netcdf

if TYPE_CHECKING:
    import xarray as xr

MOST_BYTES = 2_000_000_000
"""Largest unpacked size of a recording whose presses are read [bytes]."""
FRAMES = ("host_time", "press_x", "press_y", "press_depth")
BOARD = ("device_time", "connection")
MOVES = ("move_time", "move_x", "move_y", "move_depth")
MOVE_STEP_S = 0.05
"""Longest time between two positions of a moving tip [s]."""
MODEL_FILE = "build.optomodel"
"""File name of the model for the manufactured pad, in the folder of the calibrated design."""


@verb(
    data=typed("DATA"),
    force=typed("CSV"),
    out=typed("FOLDER", type=Path, callback=require_folder),
    set_before="out",
)
def calibrate(
    design: SensorDesign,
    data: Path,
    *,
    no_model: bool = False,
    quick: bool = False,
    force: Path | None = None,
    offset: str | None = None,
    topic: str | None = None,
    press_topic: str | None = None,
    out: Path | None = None,
    seed: int = 0,
    on_step: OnStep = silent,
) -> CalibratedBuild:
    """Fit heights, LED size, reflectances, index and gains to presses of a built pad; writes its design and a model.

    Parameters
    ----------
    data : Recording of 10 to 50 presses of the built pad (.nc, .optorec, .mcap, bag).
    no_model : Only fit; do not trace the map for the pad's model.
    quick : A coarser map, in a third of the time.
    force : A load cell's log of these presses (time, force_n): also fit the modulus.
    out : Folder of the calibrated design; default: next to the data.

    Raises
    ------
    InputError : the data are of another design or have too few presses or untouched frames, nothing can be fitted, or
        the log of the force does not fit the recording.
    """
    file = named(data)
    folder = require_folder(out or file.with_name(f"{file.stem}-calibration"))
    shift = parsed_offset(offset)
    if offset is not None and force is None:
        raise InputError("--offset: shifts a load cell's log; give --force, too")
    made = fitted(
        design,
        file,
        with_model=not no_model,
        quick=quick,
        seed=seed,
        on_step=on_step,
        force=force,
        offset=shift,
        topics=(topic, press_topic),
    )
    files = write_calibration(made, folder)
    return replace(made, notes=(*made.notes, *_earlier_model_note(made, folder)), files=files)


def fitted(
    design: SensorDesign,
    file: Path,
    *,
    with_model: bool,
    quick: bool,
    seed: int,
    on_step: OnStep,
    force: Path | None = None,
    offset: Offset = None,
    topics: tuple[str | None, str | None] = (None, None),
) -> CalibratedBuild:
    """The fit of `calibrate`, and its model `with_model`; nothing is written."""
    with as_netcdf(file, *topics) as netcdf:
        data = read_data(netcdf, design)
        log = None if force is None else read_force_log(force)
        pressed = None if log is None else _pressed_force(netcdf, log, offset)
    notes = [*require_design(data, design, what=str(file)), *data_notes(data), *(log.notes if log else ())]
    fit = None if pressed is None else fit_force(design, *pressed, lambda share: on_step("force", share))
    found = calibrated(design, data, seed=seed, on_step=on_step)
    report = report_of(found)
    if fit is not None:
        found = replace(found, design=fit.applied(found.design))
    model = build_model(found, data, quick=quick, seed=seed, on_step=on_step) if with_model else None
    if model is not None and fit is not None and model.header.force_curve is not None:
        curve = replace(model.header.force_curve, relative_sigma=fit.relative_sigma)
        model = replace(model, header=replace(model.header, force_curve=curve))
    return CalibratedBuild(
        design=design, calibration=found, report=report, model=model, notes=tuple(notes), force=fit
    )


def _pressed_force(netcdf: Path, log: ForceLog, offset: Offset) -> tuple[FloatArray, TipPath, FloatArray]:
    """Times of the log within the recording, by the recording's clock, the tip's positions, and the forces.

    Raises
    ------
    InputError : the recording has no times or presses, has no time in common with the log, or they do not match.
    """
    dataset = read_netcdf(netcdf, needed="a recording with presses", most_bytes=MOST_BYTES)
    path = _moves(dataset) if MOVES[0] in dataset else _labelled(dataset, netcdf)
    time_s = force_clock(path, log, offset).at(log.time_s)
    inside = (time_s > path.time_s[0]) & (time_s < path.time_s[-1])
    return time_s[inside], path, log.force_n[inside]


def _labelled(dataset: xr.Dataset, netcdf: Path) -> TipPath:
    """The tip's positions at the frames of a recording; raises InputError if they do not show its motion.

    A frame has the time at which a stage's log was joined to it, and of frames with the same time the first is taken.
    """
    missing = [name for name in FRAMES if name not in dataset]
    if missing:
        raise InputError(
            f"{netcdf}: has no {missing[0]}, needs a recording of `driver record` with its presses"
        )
    host_s, *press = (np.asarray(dataset[name].values, dtype=np.float64) for name in FRAMES)
    require_rising(host_s)
    time_s = host_s
    board = [np.asarray(dataset[name].values, dtype=np.float64) for name in BOARD if name in dataset]
    if len(board) == len(BOARD) and all(
        one.shape == host_s.shape and np.isfinite(one).all() for one in board
    ):
        time_s = measured_s(host_s, board[0], board[1].astype(np.int64))
    rises = np.diff(time_s, prepend=-np.inf) > 0.0
    path = TipPath(time_s=time_s[rises], press_mm=np.stack(press, axis=1)[rises])
    require_motion(path)
    return path


def _moves(dataset: xr.Dataset) -> TipPath:
    """The tip's path that `driver collect` writes: its knots, and positions between those of a move.

    Stretches around a knot without a position remain unknown: no force is fitted to a press that begins or ends in one,
    and none within it counts as force at rest.
    """
    knots = np.stack([np.asarray(dataset[name].values, dtype=np.float64) for name in MOVES], axis=1)
    moves = (np.diff(knots[:, 1:], axis=0) != 0.0).any(axis=1) & np.isfinite(knots[1:] + knots[:-1]).all(
        axis=1
    )
    parts = np.where(moves, np.ceil(np.diff(knots[:, 0]) / MOVE_STEP_S), 1.0).astype(np.int64).clip(1)
    ends = np.concatenate([[0], np.cumsum(parts)])
    place = np.arange(ends[-1] + 1)
    row = np.interp(place, ends, np.arange(len(knots)))
    whole = np.stack([np.interp(row, np.arange(len(knots)), axis) for axis in knots.T], axis=1)
    known = np.isfinite(whole).all(axis=1)
    whole, part = whole[known], np.cumsum(~known)[known]
    rises = np.diff(whole[:, 0], prepend=-np.inf) > 0.0
    return TipPath(
        time_s=whole[rises, 0],
        press_mm=whole[rises, 1:],
        after_unknown=1 + np.flatnonzero(np.diff(part[rises])),
    )


def build_model(
    found: Calibration, data: PressData, *, quick: bool, seed: int, on_step: OnStep
) -> SignalMapModel:
    """Make the model that reads a calibrated pad: a map of the pad's signals over location and depth."""
    lightmap = mapped(found.design, quick=quick, seed=seed, on_step=on_step)
    header = map_header(found.design, data, lightmap, seed)
    return fit_signal_map(found.design, lightmap, header, data, seed=seed, on_step=on_step)


def write_calibration(made: CalibratedBuild, folder: Path) -> tuple[Path, ...]:
    """Write ``design.toml``, ``calibration.json`` and, if there is a model, ``build.optomodel``; return their paths."""
    names = ["design.toml", "calibration.json"]
    with written_together(folder) as hidden:
        save_design(made.calibration.design, hidden / names[0])
        facts = json.dumps(made.to_json(), indent=2, allow_nan=False) + "\n"
        write_text_atomically(hidden / names[1], facts)
        if made.model is not None:
            names.append(MODEL_FILE)
            save_model(hidden / names[2], made.model)
    return tuple(folder / name for name in names)


def _earlier_model_note(made: CalibratedBuild, folder: Path) -> tuple[str, ...]:
    """A note that the model in the folder is from an earlier calibration; empty if this calibration made a model."""
    if made.model is not None or not (folder / MODEL_FILE).exists():
        return ()
    return (
        f"{folder / MODEL_FILE} is of an earlier calibration and does not match the present design.toml; "
        "calibrate without --no-model, or delete it",
    )
