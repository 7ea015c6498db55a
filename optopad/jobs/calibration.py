"""Calibration: fits a design to a recording of its manufactured pad, and makes a model that reads this pad."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from design.arrays import FloatArray
from design.errors import InputError
from design.file_sets import written_together
from design.io import save_design, write_text_atomically
from design.progress import OnStep
from design.spec import SensorDesign
from fabrication.driver.recording.clock_match import OUT_OF_STEP_S, found_offset, match_at, touches_of_log
from fabrication.driver.recording.force_log import ForceLog, read_force_log
from fabrication.driver.recording.joined_log import Offset
from fabrication.driver.recording.position_log import PositionLog
from fabrication.driver.recording.recorded import require_rising
from optopad.work import as_netcdf
from sims.learning.calibration import Calibration, CalibrationReport, calibrated, report_of
from sims.learning.force_fit import ForceFit, fit_force
from sims.learning.inference.model_file import save_model
from sims.learning.inference.signal_map import SignalMapModel
from sims.learning.map_learner import fit_signal_map, map_header, mapped
from sims.readings.data_writer import read_netcdf
from sims.readings.dataset import read_data, require_design
from sims.readings.press_data import PressData, data_notes

MOST_BYTES = 2_000_000_000
"""Largest unpacked size of a recording whose presses are read [bytes]."""
MODEL_FILE = "build.optomodel"
"""File name of the model for the manufactured pad, in the folder of the calibrated design."""


@dataclass(frozen=True, kw_only=True)
class CalibratedBuild:
    """Result of fitting a design to a recording of its manufactured pad.

    Attributes
    ----------
    calibration : fitted values
    report : quality of the fit
    model : model that reads touches of the manufactured pad; None if it was not requested
    force : modulus and relaxation, fitted to a load cell; None without its log
    notes : notes about the data, as sentences
    """

    calibration: Calibration
    report: CalibrationReport
    model: SignalMapModel | None
    notes: tuple[str, ...]
    force: ForceFit | None = None

    @property
    def lines(self) -> list[str]:
        """Lines for the screen."""
        return [*self.report.lines, *(() if self.force is None else self.force.lines), *self.notes]

    def to_json(self, design: SensorDesign) -> dict[str, Any]:
        """The calibration as plain data for JSON."""
        found = self.calibration
        emitters = found.samples.emitters
        return {
            "name": design.name,
            "digest": design.digest,
            "calibrated_digest": found.design.digest,
            "presses": found.samples.presses,
            "readings": int(found.samples.signals.size),
            "seed": found.seed,
            **self.report.to_json(),
            "gains_counts_per_flux": found.fitted.gains.reshape(emitters, -1).tolist(),
            "gains_relative_spread": found.fitted.gain_spread.reshape(emitters, -1).tolist(),
            "tip_beside_stage_mm": found.fitted.offset_mm.tolist(),
            "data_notes": list(self.notes),
            **({} if self.force is None else {"force": self.force.to_json()}),
        }


def calibrate(
    design: SensorDesign,
    file: Path,
    *,
    with_model: bool,
    quick: bool,
    seed: int,
    on_step: OnStep,
    force: Path | None = None,
    offset: Offset = None,
    topic: str | None = None,
    press_topic: str | None = None,
) -> CalibratedBuild:
    """Fit a design to a recording of its manufactured pad, and make the model that reads this pad.

    Parameters
    ----------
    with_model : whether to make the model, which takes longer than the fit
    quick : whether to use a coarser map of presses for the model
    force : log of a load cell under the same presses, to which modulus and relaxation are fitted; None fits none
    offset : clock of the recording's computer minus the log's [s]; "auto" finds it; None: the clocks are the same
    topic, press_topic : topics of frames and presses in a bag of several sensors

    Raises
    ------
    InputError : the data are of another design or have too few presses or untouched frames, nothing can be fitted, or
        the log of the force does not fit the recording.
    """
    with as_netcdf(file, topic, press_topic) as netcdf:
        data = read_data(netcdf, design)
        pressed = None if force is None else _pressed_force(netcdf, read_force_log(force), offset)
    notes = [*require_design(data, design, what=str(file)), *data_notes(data)]
    fit = None if pressed is None else fit_force(design, *pressed, lambda share: on_step("force", share))
    found = calibrated(design, data, seed=seed, on_step=on_step)
    report = report_of(found)
    if fit is not None:
        found = replace(found, design=fit.applied(found.design))
    model = build_model(found, data, quick=quick, seed=seed, on_step=on_step) if with_model else None
    if model is not None and fit is not None and model.header.force_curve is not None:
        curve = replace(model.header.force_curve, relative_sigma=fit.relative_sigma)
        model = replace(model, header=replace(model.header, force_curve=curve))
    return CalibratedBuild(calibration=found, report=report, model=model, notes=tuple(notes), force=fit)


def _pressed_force(netcdf: Path, log: ForceLog, offset: Offset) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Times, presses (n, 3) and forces at the log's times within the recording, by the recording's clock.

    Raises
    ------
    InputError : the recording has no times or presses, has no time in common with the log, or they do not match.
    """
    dataset = read_netcdf(netcdf, needed="a recording with presses", most_bytes=MOST_BYTES)
    names = ("host_time", "press_x", "press_y", "press_depth")
    missing = [name for name in names if name not in dataset]
    if missing:
        raise InputError(
            f"{netcdf}: has no {missing[0]}, needs a recording of `driver record` with its presses"
        )
    host_s, *press = (np.asarray(dataset[name].values, dtype=np.float64) for name in names)
    require_rising(host_s)
    path = PositionLog(file=str(netcdf), time_s=host_s, press_mm=np.stack(press, axis=1))
    shift = _clock_offset(path, log, offset)
    time_s = log.time_s + shift
    inside = (time_s > host_s[0]) & (time_s < host_s[-1])
    at = np.stack([np.interp(time_s[inside], host_s, axis) for axis in path.press_mm.T], axis=1)
    return time_s[inside], at, log.force_n[inside]


def _clock_offset(path: PositionLog, log: ForceLog, offset: Offset) -> float:
    pressed, forces = touches_of_log(path), log.touches
    if offset == "auto":
        return found_offset(pressed, forces).offset_s
    shift = float(offset or 0.0)
    first, last = forces.span_s
    begin, end = pressed.span_s
    if last + shift < begin or first + shift > end:
        raise InputError(
            f"{log.file}: no time in common with the recording: the presses last from 0 to {end - begin:.1f} s, "
            f"the log from {first + shift - begin:.1f} to {last + shift - begin:.1f} s; is it another run's log, or "
            "another clock? Find the offset with --offset auto, or give it"
        )
    match = match_at(pressed, forces, shift)
    if offset is None and match.edges and not (match.is_good and abs(match.offset_s) <= OUT_OF_STEP_S):
        raise InputError(
            f"{log.file}: is out of step with the recording: {match.share:.0%} of {match.edges} begins and ends of "
            f"presses match, {match.offset_s:+.2f} s late; find the offset with --offset auto, or state it: --offset 0 "
            "takes the log unchanged"
        )
    return shift


def build_model(
    found: Calibration, data: PressData, *, quick: bool, seed: int, on_step: OnStep
) -> SignalMapModel:
    """Make the model that reads a calibrated pad: a map of the pad's signals over location and depth."""
    lightmap = mapped(found.design, quick=quick, seed=seed, on_step=on_step)
    header = map_header(found.design, data, lightmap, seed)
    return fit_signal_map(found.design, lightmap, header, data, seed=seed, on_step=on_step)


def write_calibration(made: CalibratedBuild, design: SensorDesign, folder: Path) -> tuple[Path, ...]:
    """Write ``design.toml``, ``calibration.json`` and, if there is a model, ``build.optomodel``; return their paths."""
    names = ["design.toml", "calibration.json"]
    with written_together(folder) as hidden:
        save_design(made.calibration.design, hidden / names[0])
        facts = json.dumps(made.to_json(design), indent=2, allow_nan=False) + "\n"
        write_text_atomically(hidden / names[1], facts)
        if made.model is not None:
            names.append(MODEL_FILE)
            save_model(hidden / names[2], made.model)
    return tuple(folder / name for name in names)


def earlier_model_note(made: CalibratedBuild, folder: Path) -> tuple[str, ...]:
    """A note that the model in the folder is from an earlier calibration; empty if this calibration made a model."""
    if made.model is not None or not (folder / MODEL_FILE).exists():
        return ()
    return (
        f"{folder / MODEL_FILE} is of an earlier calibration and does not match the present design.toml; "
        "calibrate without --no-model, or delete it",
    )
