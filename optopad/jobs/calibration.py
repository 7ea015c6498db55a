"""Calibration: fits a design to a recording of its manufactured pad, and makes a model that reads this pad."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from design.io import save_design, write_text_atomically, written_together
from design.progress import OnStep
from design.spec import SensorDesign
from optopad.work import as_netcdf
from sims.learning.calibration import Calibration, CalibrationReport, calibrated, report_of
from sims.learning.inference.model_file import save_model
from sims.learning.inference.signal_map import SignalMapModel
from sims.learning.map_learner import fit_signal_map, map_header, mapped
from sims.readings.dataset import read_data, require_design
from sims.readings.press_data import PressData, data_notes

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
    notes : notes about the data, as sentences
    """

    calibration: Calibration
    report: CalibrationReport
    model: SignalMapModel | None
    notes: tuple[str, ...]

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
        }


def calibrate(
    design: SensorDesign, file: Path, *, with_model: bool, quick: bool, seed: int, on_step: OnStep
) -> CalibratedBuild:
    """Fit a design to a recording of its manufactured pad, and make the model that reads this pad.

    Parameters
    ----------
    with_model : whether to make the model, which takes longer than the fit
    quick : whether to use a coarser map of presses for the model

    Raises
    ------
    InputError : the data are of another design or have too few presses or untouched frames, or nothing can be fitted.
    """
    with as_netcdf(file) as netcdf:
        data = read_data(netcdf, design)
    notes = [*require_design(data, design, what=str(file)), *data_notes(data)]
    found = calibrated(design, data, seed=seed, on_step=on_step)
    model = build_model(found, data, quick=quick, seed=seed, on_step=on_step) if with_model else None
    return CalibratedBuild(calibration=found, report=report_of(found), model=model, notes=tuple(notes))


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
