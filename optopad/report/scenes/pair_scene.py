"""The judged pairs as data for the page, where the user selects one: curves, modes, deadbands, and positions."""

from __future__ import annotations

from typing import Any

from optopad.design.arrays import FloatArray
from optopad.design.shape.cavity import TURN_RAD, CavityGeometry, cavity_of
from optopad.design.spec import SensorDesign
from optopad.report.words import governing, reading
from optopad.sims.score.result import ContinuityScore, JudgedPair
from optopad.sims.verdict.figure_errors import Load

STEPS = 10_000
"""Number of steps that the untouched light of a pair corresponds to."""


def pair_scene(design: SensorDesign, score: ContinuityScore) -> dict[str, Any]:
    """Data of all judged pairs: depths in mm, light in units of 1/10 000 of the pair's untouched light."""
    cavity = cavity_of(design)
    names = [pair.name for pair in score.pairs]
    return {
        "depth": [round(float(depth), 4) for depth in score.pairs[0].curves.depth_mm],
        "first": names.index(governing(score).name),
        "plan": plan_of(cavity, design.indenter.tip_radius_mm),
        "pairs": [_pair(pair) for pair in score.pairs],
    }


def plan_of(cavity: CavityGeometry, tip_mm: float) -> dict[str, Any]:
    """The pad from above, as data for the page.

    Returns
    -------
    length and width of the pad, tip radius, corners of outline and workspace (counter-clockwise) [mm]; of each part
    the name, kind, x and y [mm], and direction of its label
    """
    space, plan = cavity.workspace, cavity.plan
    return {
        "length": cavity.length_mm,
        "width": cavity.width_mm,
        "tip": tip_mm,
        "outline": plan.outline.points(TURN_RAD).round(3).tolist(),
        "space": space.points(TURN_RAD).round(3).tolist(),
        "parts": [
            [
                part.name,
                part.kind,
                *(round(v, 3) for v in (*part.position_mm[:2], *part.label_way)),
            ]
            for part in cavity.parts
        ],
    }


def _pair(pair: JudgedPair) -> dict[str, Any]:
    curves, score, modes = pair.curves, pair.score, pair.score.modes
    untouched = float(curves.total[0])
    onset, last = modes.mode2_mm
    brightest = float(curves.total.max()) / untouched
    return {
        "name": pair.name,
        "press": [round(value, 2) for value in curves.press_mm],
        "total": _steps(curves.total, untouched),
        "direct": _steps(curves.direct, untouched),
        "top": _steps(curves.top, untouched),
        "mode1": list(modes.mode1_mm),
        "mode2": None if onset is None else [onset, last],
        "dead": [list(span) for span in score.deadbands_mm],
        "flat": None if score.saturation_mm is None else list(score.saturation_mm),
        "counts": score.strength.untouched_counts,
        "full": brightest / score.peak_share_of_full_scale if score.is_clipped else None,
        "reading": reading(pair),
        "loads": _loads(pair),
    }


def _loads(pair: JudgedPair) -> str:
    """Text with the loads at the boundaries of the modes; empty if they are not known."""
    forces = pair.forces
    if forces is None:
        return ""

    def load(found: Load | None) -> str:
        return "open" if found is None else f"{found[0]:.2g} N ({found[1]:.2g} to {found[2]:.2g})"

    whose = "" if forces.is_at_place else ", of the centred press"
    second = "" if forces.mode2_onset is None else f"; mode 2 begins at {load(forces.mode2_onset)}"
    return (
        f"Load{whose}: mode 1 ends at {load(forces.mode1_end)}{second}. In brackets: the band of the modulus."
    )


def _steps(light: FloatArray, untouched: float) -> list[int]:
    return [round(STEPS * float(value) / untouched) for value in light]
