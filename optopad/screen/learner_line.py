"""What a learner reaches on this very design, from a prediction in its bundle; else the command that would say it."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from design.spec import SensorDesign
from optopad.work.prediction_cost import STEM, quick_prediction_s

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
    """The best learner's median errors from `LEAST_DEPTH_MM` on, and its false alarms; empty where there are none."""
    try:
        every = document.get("learners", [document])  # earlier files have those of the first alone
        told = [(medians, one) for one in every if all(medians := _medians(one["errors"]))]
        if not told:
            return ""
        (location, depth), best = min(told, key=lambda one: sum(one[0][0]) / len(one[0][0]))
        alarms = best.get("false_alarms")
        false = "" if alarms is None else f"; {100.0 * alarms:.0f} % false alarms"
        return (
            f"location {_range(location, 2)}, depth {_range(depth, 2)} ({best['learner']}, simulated){false}"
        )
    except (KeyError, TypeError, ValueError):
        return ""


def _medians(rows: Sequence[Mapping[str, Any]]) -> tuple[list[float], list[float]]:
    """Medians of the location's and of the depth's errors by depth, from `LEAST_DEPTH_MM` on [mm]."""
    deep = [row for row in rows if row["depth_mm"] >= LEAST_DEPTH_MM]
    location, depth = (
        [float(row[name]) for row in deep if row[name] is not None]
        for name in ("location_median_mm", "depth_median_mm")
    )
    return location, depth


def _range(values: Sequence[float], digits: int) -> str:
    low, high = f"{min(values):.{digits}f}", f"{max(values):.{digits}f}"
    return f"{high} mm" if low == high else f"{low} to {high} mm"


def _length(seconds: float) -> str:
    cores = os.cpu_count() or 1
    length = f"{seconds / 60:.0f} minutes" if seconds >= 90.0 else f"{max(round(seconds, -1), 10):.0f} s"
    return f"about {length} on {cores} core{'s' if cores > 1 else ''}"
