"""What a learner reaches on this very design, from a prediction in its bundle; else the command that would say it."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from design.spec import SensorDesign
from optopad.jobs.prediction_cost import STEM, quick_prediction_s

LEAST_DEPTH_MM = 1.0
"""Depth from which on errors are told: a lighter press is detected, but hardly located [mm]."""


def learner_line(design: SensorDesign, bundle: Path, command: str) -> str:
    """One sentence for the screen; empty where there is neither a prediction nor a way to one.

    Parameters
    ----------
    bundle : the design's bundle, where `optopad predict` leaves its tables
    command : the design and its changes as given on the command line
    """
    document = _prediction(bundle / "sims" / f"{STEM}.json")
    if document is not None and document.get("digest") == design.digest and (said := _reached(document)):
        return said
    seconds = quick_prediction_s(design)
    if seconds is None:
        return ""
    return f"not predicted yet: optopad predict {command} --quick   ({_length(seconds)})"


def _prediction(file: Path) -> dict[str, Any] | None:
    """The tables of a prediction; None where there are none that can be read."""
    try:
        found = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return found if isinstance(found, dict) else None


def _reached(document: Mapping[str, Any]) -> str:
    """Median errors from `LEAST_DEPTH_MM` on, and the share of false alarms; empty where the tables say none."""
    try:
        rows = [row for row in document["errors"] if row["depth_mm"] >= LEAST_DEPTH_MM]
        location, depth = (
            [row[name] for row in rows if row[name] is not None]
            for name in ("location_median_mm", "depth_median_mm")
        )
        alarms = document.get("false_alarms")
        if not location or not depth:
            return ""
        told = "" if alarms is None else f"; {100.0 * alarms:.0f} % false alarms"
        return (
            f"location {_range(location, 2)}, depth {_range(depth, 2)} (simulated {document['learner']}, medians "
            f"from {LEAST_DEPTH_MM:g} mm deep, gains and ambient light not known){told}"
        )
    except (KeyError, TypeError, ValueError):
        return ""


def _range(values: Sequence[float], digits: int) -> str:
    low, high = f"{min(values):.{digits}f}", f"{max(values):.{digits}f}"
    return f"{high} mm" if low == high else f"{low} to {high} mm"


def _length(seconds: float) -> str:
    cores = os.cpu_count() or 1
    length = f"{seconds / 60:.0f} minutes" if seconds >= 90.0 else f"{max(round(seconds, -1), 10):.0f} s"
    return f"about {length} on {cores} core{'s' if cores > 1 else ''}"
