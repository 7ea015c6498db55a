"""Stages of the work in words, for whoever shows how far it is."""

from __future__ import annotations

STAGE_TITLES = {
    "kernels": "compiling the light kernels, once on this machine: a minute or two",
    "contact": "contact (MuJoCo)",
    "pairs": "light, pair by pair",
    "light": "light",
    "loose walls": "light, walls torn loose",
    "data": "samples",
    "map": "light, map of the pad",
    "doubtful places": "light, doubtful places again",
    "map error": "light, between the map's nodes",
    "calibration": "fit of the build's optics",
    "fit": "model",
    "curves": "light, pairs under the tip",
    "open pairs": "light, open pairs again",
    "open places": "light, open places again",
    "bounds": "light, bounds of place and depth",
    "tolerance": "tolerance of open values",
    "what matters": "what matters: a step of each field",
    "trial": "trial: heights and thickness moved",
    "builds": "builds, everything off at once",
    "oracle": "ray tracer",
    "rays": "sample paths",
    "mold": "mold and tools",
    "mold beside": "mold and tools: wait",
    "presses": "presses of the stage",
    "files": "build sheet, driver config, report",
}
