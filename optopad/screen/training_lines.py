"""What a training says to people."""

from __future__ import annotations

from typing import Any

from optopad.jobs.training import Training

SHOWN = {
    "gamma_times_median": "gamma x median distance",
    "lambda": "lambda",
    "method": "solved",
    "fit_samples": "samples",
    "trees": "trees",
    "epochs": "passes",
    "held_out_location_mm": "held-out location, median mm",
    "held_out_depth_mm": "depth, median mm",
    "touch_held_out_right": "touch, held out",
}
"""What of a model's settings is shown, in words; the file's header has all of them."""


def training_lines(found: Training) -> list[str]:
    """Data, what was left out, and each model with its file."""
    facts = found.facts
    lines = [
        f"data      {facts['samples']} samples, {facts['touched_samples']} touched; "
        f"{facts['locations']} locations, {facts['presses']} presses; {', '.join(facts['sets'])}"
    ]
    lines += [f"left out  {text}" for text in facts["left_out"]]
    lines += [f"note      {text}" for text in found.notes]
    for model in found.models:
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
