"""Titles of the steps of a computation, for progress lines."""

from __future__ import annotations

STAGE_TITLES = {
    "kernels": "compiling the light kernels, once on this machine: half a minute or more",
    "contact": "contact (MuJoCo)",
    "pairs": "light, pair by pair",
    "light": "light",
    "loose walls": "light, walls torn loose",
    "data": "samples",
    "map": "light, map of the pad",
    "doubtful places": "light, doubtful locations again",
    "map error": "light, between the map's nodes",
    "calibration": "fit of the unit's optics",
    "fit": "model",
    "curves": "light, pairs under the tip",
    "open pairs": "light, undecided pairs again",
    "open places": "light, undecided locations again",
    "bounds": "light, bounds of resolution",
    "tolerance": "unmeasured parameters",
    "what matters": "sensitivity to each parameter",
    "trial": "trial: heights and thickness moved",
    "builds": "Monte Carlo over tolerances",
    "rays": "sample paths",
    "mold": "mold and tools",
    "mold beside": "mold and tools: wait",
    "presses": "presses of the stage",
    "files": "build sheet, driver config, report",
}
