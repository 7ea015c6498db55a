"""The result of fitting a design to its manufactured pad."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from optopad.design.spec import SensorDesign
from optopad.screen.shown import Result
from optopad.sims.learning.calibration import Calibration, CalibrationReport
from optopad.sims.learning.force_fit import ForceFit
from optopad.sims.learning.inference.signal_map import SignalMapModel


@dataclass(frozen=True, kw_only=True, repr=False)
class CalibratedBuild(Result):
    """Result of fitting a design to a recording of its manufactured pad.

    Attributes
    ----------
    design : the design that was fitted
    calibration : fitted values
    report : quality of the fit
    model : model that reads touches of the manufactured pad; None if it was not requested
    force : modulus and relaxation, fitted to a load cell; None without its log
    notes : notes about the data, as sentences
    files : files that were written
    """

    design: SensorDesign
    calibration: Calibration
    report: CalibrationReport
    model: SignalMapModel | None
    notes: tuple[str, ...]
    force: ForceFit | None = None
    files: tuple[Path, ...] = ()

    def screen(self) -> list[str]:
        """The fit, and its files."""
        names = ", ".join(one.name for one in self.files)
        return [*self.lines(), f"files     {self.files[0].parent} ({names})"]

    def lines(self) -> list[str]:
        """Quality of the fit, and notes."""
        return [*self.report.lines, *(() if self.force is None else self.force.lines), *self.notes]

    def to_json(self) -> dict[str, Any]:
        """The calibration as plain data for JSON."""
        found = self.calibration
        emitters = found.samples.emitters
        return {
            "name": self.design.name,
            "digest": self.design.digest,
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
