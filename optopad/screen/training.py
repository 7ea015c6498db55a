"""Trained models, and what their training used."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from optopad.screen.shown import Result
from optopad.sims.learning.inference.header import ModelHeader

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
