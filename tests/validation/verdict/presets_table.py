"""What `score` and a quick prediction say of two presets: tests/validation/verdict/presets_table.md.

python -m tests.validation.verdict.presets_table          (some minutes of two cores)
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import optopad
from optopad.design.io import write_text_atomically
from tests.validation.contact.contact_table import markdown_table

TABLE = Path(__file__).with_name("presets_table.md")
SCORED = (("piacenza2017-pad", False), ("gripper-stadium", False), ("gripper-stadium", True))
PREDICTED = "gripper-stadium"
HEADS = ["design", "settings", "verdict", "margin, sigma", "at x, y mm", "least usable depth mm"]
HEADS += [
    "not resolved %",
    "location bound mm",
    "depth bound mm",
    "detected from mm, worst location",
    "force at 0.6 mm: N",
    "low",
    "high",
]


def main() -> None:
    """Score, predict, write the table."""
    lines = [
        "# Presets, scored and predicted",
        "",
        "Made by `python -m tests.validation.verdict.presets_table`. *Not resolved* is the share of the volume in",
        "which one frame does not resolve x, y and depth together. Bounds are medians over the pad.",
        "",
        markdown_table(HEADS, [scored_row(name, is_fine) for name, is_fine in SCORED]),
        "",
        "Quick prediction, kernel ridge, one draw, all test sets:",
        "",
        markdown_table(["design", "depth mm", "location: median mm", "found %"], predicted_rows(PREDICTED)),
        "",
    ]
    write_text_atomically(TABLE, "\n".join(lines))


def scored_row(name: str, is_fine: bool) -> list[str]:
    """One design's figures at the settings of `score` or of `score --fine`."""
    said = optopad.score(optopad.load(name), fine=is_fine).to_dict()
    bounds, place = said["bounds"], said["map"]["weakest_place_mm"]
    at = said["force"]["depth_mm"].index(0.6)
    deepest = max(mm for row in bounds["felt"]["depth_mm"] for mm in row if mm is not None)
    return [
        name,
        "fine" if is_fine else "score",
        said["verdict"],
        f"{said['margin_noise_units']:.1f}",
        f"{place[0]:g}, {place[1]:g}" if place else "-",
        f"{said['usable_depth_mm']:.2f}",
        f"{100 * bounds['blind_share']:.0f}",
        f"{bounds['median_location_mm']['value']:.3f}",
        f"{bounds['median_depth_mm']['value']:.3f}",
        f"{deepest:.2f}",
        *(f"{said['force'][name][at]:.2f}" for name in ("force_n", "low_n", "high_n")),
    ]


def predicted_rows(name: str) -> list[list[str]]:
    """Errors of the paper's learner by depth."""
    with tempfile.TemporaryDirectory() as folder:
        said: dict[str, Any] = optopad.predict(optopad.load(name), out=folder).to_dict()
    (rows,) = (one["errors"] for one in said["learners"] if one["learner"] == "kernel-ridge")
    return [
        [name, f"{row['depth_mm']:g}", f"{row['location_median_mm']:.2f}", f"{100 * row['found']:.0f}"]
        for row in rows
        if row["location_median_mm"] is not None
    ]


if __name__ == "__main__":
    main()
