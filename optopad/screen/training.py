"""Simulated presses and data sets, models trained on data, and a design fitted to its manufactured pad."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from optopad.design.spec import SensorDesign
from optopad.screen.answer import Result, counted
from optopad.sims.learning.inference.header import ModelHeader

if TYPE_CHECKING:
    from optopad.sims.learning.calibration import Calibration, CalibrationReport
    from optopad.sims.learning.force_fit import ForceFit
    from optopad.sims.learning.inference.signal_map import SignalMapModel


def signal_lines(summary: dict[str, Any]) -> Iterator[str]:
    """Light of each press by path class."""
    for state in summary["states"]:
        x_mm, y_mm, depth_mm = state["press_mm"]
        shares = "  ".join(f"{name} {value:.3e}" for name, value in state["mean_flux_by_class"].items())
        yield (
            f"press {x_mm:6.2f} {y_mm:6.2f}  depth {depth_mm:5.2f} mm  mean flux {state['mean_flux']:.4e}  {shares}"
        )


def data_lines(summary: dict[str, Any]) -> list[str]:
    """Text that summarises the data set of a protocol or of a list of presses, in a few lines."""
    lines = [_protocol_line(summary) if "protocol" in summary else _list_line(summary)]
    lines += [
        f"set       {one['name']:<20} {one['role']:<6} {one['pattern']:<7} "
        f"{'ambient' if one['is_ambient'] else 'dark':<8} {one['presses']} presses"
        for one in summary["sets"]
    ]
    if summary["taken_up_presses"]:
        lines.append(f"reused    {summary['taken_up_presses']} presses of an interrupted run")
    if summary["clipped"]:
        lines.append(f"warning   {summary['clipped']}")
    lines += [f"note      {text}" for text in summary.get("notes", ())]
    return [*lines, f"file      {summary['file']}"]


def _protocol_line(summary: dict[str, Any]) -> str:
    protocol = summary["protocol"]
    return (
        f"protocol  {protocol['name']}: {protocol['points_per_press']} points a press, "
        f"{protocol['touched_per_press']} of them at 0 mm or deeper; {summary['samples']} samples, "
        f"{protocol['hours']:.1f} h on a stage"
    )


def _list_line(summary: dict[str, Any]) -> str:
    depths, forces, objects = summary["depth_mm"], summary["force_n"], summary["objects"]
    named = objects[0] if len(objects) == 1 else f"{len(objects)} different objects"
    presses = counted(summary["presses"], "press", "presses")
    if more := summary.get("two_touches"):
        presses += f" ({more} of two touches)"
    return (
        f"list      {presses} by {named}, {min(depths):.2f} to {max(depths):.2f} mm deep, {min(forces):.2f} to "
        f"{max(forces):.2f} N; {summary['samples']} samples"
    )


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


@dataclass(frozen=True, kw_only=True, repr=False)
class Training(Result):
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
