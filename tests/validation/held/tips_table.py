"""Two tips at once: the model against finite strains, `tips.csv`.

    python -m tests.validation.held.tips_table              all tables of docs/validation/touches.md
    python -m tests.validation.held.tips_table contact      one

Two balls lie at the same distance from the middle of the paper's pad. Heights are compared at the same distances from
the axis of a ball: inward, to the other ball; outward; and along y.
"""

from __future__ import annotations

import sys
from functools import cache
from pathlib import Path

import numpy as np
from scipy.interpolate import RegularGridInterpolator

from optopad.design.preset import preset
from optopad.sims.contact.held.tips import TipsPress, pressed_tips
from optopad.sims.contact.scope import contact_of
from optopad.sims.press import GridTop
from tests.validation.contact.contact_table import markdown_table, write_tables
from tests.validation.held.object_table import MIDDLE, PAD, Line
from tests.validation.held.tips_truth import CASES, STORED, TipPress, TipsCase
from tests.validation.held.truth_file import Row, read_truth

PAGE = Path(__file__).parents[3] / "docs" / "validation" / "touches.md"
STEP_MM = 0.02

Rows = dict[str, Row]


@cache
def stored() -> dict[tuple[float, float, bool], Rows]:
    """Distance, depth, whether a ball is alone -> quantity -> its row."""
    found: dict[tuple[float, float, bool], Rows] = {}
    for name, rows in read_truth(STORED).items():
        for row in rows:
            found.setdefault((CASES[name].apart_mm, row.depth_mm, CASES[name].is_alone), {})[row.quantity] = (
                row
            )
    return found


@cache
def modelled(apart_mm: float, depth_mm: float, is_alone: bool) -> TipsPress:
    """Two tips beside the middle of the paper's pad, or the first of them."""
    tips = [(MIDDLE[0] + sign * 0.5 * apart_mm, MIDDLE[1], depth_mm) for sign in (1, -1)]
    return pressed_tips(contact_of(preset(PAD)), np.array(tips[:1] if is_alone else tips))


def line(top: GridTop, axis_mm: float, way: str) -> Line:
    """The top along a way from a ball's axis at y = 0."""
    axis, sign = TipPress.ways[way]
    at = np.arange(0.0, 30.0, STEP_MM)
    x, y = ((axis_mm, 0.0)[k] + sign * at * (axis == k) for k in (0, 1))
    height, level = (
        RegularGridInterpolator((top.x_mm, top.y_mm), values, bounds_error=False)((x, y))
        for values in (top.height_mm, top.level)
    )
    return Line.of(at, height, level, force=0.0)


def off_um(case: TipsCase, top: GridTop, rows: Rows) -> dict[str, dict[str, tuple[float, float]]]:
    """Way -> place -> the modelled height less the stored one, and the error of the coarser mesh."""
    found: dict[str, dict[str, tuple[float, float]]] = {}
    for way in case.names:
        own, edge = line(top, 0.5 * case.apart_mm, way), rows[f"contact half width along {way} [mm]"].value
        found[way] = {}
        for place, at in case.places_mm(way, edge).items():
            row = rows[f"height at {way} = {place} mm [mm]"]
            height = float(np.interp(at, own.at_mm, own.height_mm))
            found[way][place] = 1e3 * (height - row.value), 1e3 * abs(row.mesh_error)
    return found


def largest_um(off: dict[str, dict[str, tuple[float, float]]], number: int = 0) -> float:
    """Largest error of the top, or of the coarser mesh."""
    return max(abs(one[number]) for places in off.values() for one in places.values())


def contact_row(apart_mm: float, depth_mm: float) -> list[str]:
    """Two balls, and one of them without the other."""
    modulus = contact_of(preset(PAD)).draft.modulus.value
    cases = {case.is_alone: case for case in CASES.values() if case.apart_mm == apart_mm}
    both, alone = (stored()[apart_mm, depth_mm, is_alone] for is_alone in (False, True))
    models = [modelled(apart_mm, depth_mm, is_alone) for is_alone in (False, True)]
    truths = [rows["force/E [mm2]"] for rows in (both, alone)]
    solved, coarse = (np.array([row.value + k * row.mesh_error for row in truths]) for k in (0, 1))
    own = np.array([model.force_n[0] for model in models]) / modulus
    errors = 100.0 * (own / solved - 1.0)
    more, more_coarse, more_own = (100.0 * (pair[0] / pair[1] - 1.0) for pair in (solved, coarse, own))
    off, off_alone = (
        off_um(cases[is_alone], model.top, rows)
        for is_alone, model, rows in zip((False, True), models, (both, alone), strict=True)
    )
    edges = [
        100.0
        * (
            line(models[0].top, 0.5 * apart_mm, way).edge_mm
            / both[f"contact half width along {way} [mm]"].value
            - 1.0
        )
        for way in TipsCase.names
    ]
    return [
        f"{apart_mm:g}",
        f"{depth_mm:g}",
        f"{solved[0]:.3f}",
        f"{errors[0]:+.1f}",
        f"{errors[1]:+.1f}",
        f"{more:+.1f}, {more_own:+.1f}",
        ", ".join(f"{one:+.1f}" for one in edges),
        f"{largest_um(off):.0f}, {largest_um(off_alone):.0f}",
        f"{0.1 * largest_um(off) / depth_mm:.1f}",
        "; ".join(", ".join(f"{one:+.0f}" for one, _ in places.values()) for places in off.values()),
        f"{100.0 * abs(coarse[0] / solved[0] - 1.0):.2f}, {abs(more_coarse - more):.2f}",
        f"{largest_um(off, 1):.0f}",
    ]


HEAD = ["apart mm", "depth mm", "force/E", "force %", "alone %", "by the other: solved, model %"]
HEAD += ["half width inward, outward, y %", "top: largest µm, alone", "% of the depth"]
HEAD += ["inward; outward; y µm", "meshes: force %, by the other %", "meshes: top µm"]


def contact() -> str:
    """A row for each stored press of two balls."""
    return markdown_table(HEAD, [contact_row(*key) for *key, is_alone in stored() if not is_alone])


TABLES = {"contact": contact}


if __name__ == "__main__":
    write_tables(PAGE, "tests/validation/held/tips_table.py", TABLES, sys.argv[1:])
