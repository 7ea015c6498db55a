"""The light engine against a forward walk in Mitsuba 3 on a mesh: docs/validation/mitsuba.md.

    python -m tests.validation.light.mitsuba_check  a few presses, minutes each; writes the table of the page
    python -m tests.validation.light.mitsuba_check --speed  one press, 8 million rays: what it counted and took, as JSON

Mitsuba is optional (`pip install mitsuba`); see `tests.validation.light.mitsuba_walk` for what it needs.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from sims.optics.engine.trace_states import trace_scene
from sims.press.indentation import Indentation
from tests.bench.measures.benchmark_states import benchmark_scene, different_walls, surface_of
from tests.bench.measures.forward_walk import Walked
from tests.bench.measures.surface_mesh import compact_height
from tests.validation.contact.contact_table import markdown_table, with_table
from tests.validation.contact.dense_curve import dense_press

FloatArray = NDArray[np.float64]

PAGE = Path(__file__).parents[3] / "docs" / "validation" / "mitsuba.md"
MARKS = "<!-- made by tests/validation/light/mitsuba_check.py -->", "<!-- end -->"
STATES = (
    ("analytic", 3.0, (14.0, 17.0)),
    ("contact", 1.0, (22.0, 9.0)),
    ("contact", 3.0, (16.0, 16.0)),
)
"""Surface, depth and place [mm]; not deeper than 3 mm, where the surface still has one height for each radius."""
RAYS = 12 << 20
FINE_GRID = 1024
SPEED_RAYS = 1 << 20
FAINTEST = 100.0
"""Rays that a pair must have caught to be judged on its own."""


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """One press, both ways.

    Attributes
    ----------
    pulls : (n,) differences of the judged pairs in combined standard errors
    sum_ratio, sum_error : engine over Mitsuba of the light between different walls, less 1, and its standard error
    """

    pulls: FloatArray
    sum_ratio: float
    sum_error: float
    seconds: float


def curve_height(press: Indentation, top_mm: float) -> Callable[[FloatArray], FloatArray]:
    """Height [mm] over radius [mm]: the sphere inside the contact, a monotone cubic through many points beyond."""
    press = dense_press(press)
    beyond = press.radius_mm > press.contact_radius_mm + 1e-6
    tip, tip_z = press.tip_radius_mm, top_mm - press.depth_mm + press.tip_radius_mm
    edge = tip_z - np.sqrt(tip**2 - press.contact_radius_mm**2)
    radius = np.concatenate([[press.contact_radius_mm], press.radius_mm[beyond]])
    curve = PchipInterpolator(radius, np.concatenate([[edge], top_mm + press.height_mm[beyond]]))

    def height(at: FloatArray) -> FloatArray:
        inside = tip_z - np.sqrt(tip**2 - np.minimum(at, press.contact_radius_mm) ** 2)
        outside = curve(np.clip(at, radius[0], radius[-1]))
        return np.where(at < press.contact_radius_mm, inside, np.where(at > radius[-1], top_mm, outside))

    return height


def walked(
    surface: str, depth_mm: float, centre_mm: tuple[float, float], rays: int, grid: int, seed: int = 0
) -> Walked:
    """The walk in Mitsuba."""
    from tests.validation.light.mitsuba_walk import pad, walk

    scene, press = benchmark_scene(), surface_of(surface)(depth_mm)
    of = compact_height if surface == "analytic" else curve_height
    given = pad(scene, np.array(centre_mm), of(press, scene.height_mm), press.contact_radius_mm, grid)
    return walk(given, rays, seed)


def compared(
    surface: str, depth_mm: float, centre_mm: tuple[float, float], rays: int = RAYS, seed: int = 0
) -> Comparison:
    """The engine at its finest against the walk."""
    found = walked(surface, depth_mm, centre_mm, rays, FINE_GRID, seed)
    scene = benchmark_scene()
    press = surface_of(surface)(depth_mm)
    raw = trace_scene(scene, np.array([centre_mm]), [press], accuracy="fine", seed=7)
    flux, sampled = raw.flux.sum(axis=0)[0], np.sqrt(np.mean(raw.standard_error**2))
    judged = different_walls(scene) & (flux * found.rays > FAINTEST)
    variance = found.variance / found.rays
    difference = (flux - found.flux)[judged]
    total = found.flux[judged].sum()
    return Comparison(
        pulls=difference / np.sqrt(variance[judged] + sampled**2),
        sum_ratio=float(difference.sum() / total),
        sum_error=float(np.sqrt(variance[judged].sum() + sampled**2 * judged.sum()) / total),
        seconds=found.seconds,
    )


def row(surface: str, depth_mm: float, centre_mm: tuple[float, float], found: Comparison) -> list[str]:
    """A line of the table."""
    return [
        surface,
        f"{depth_mm:g}",
        f"{centre_mm[0]:g}, {centre_mm[1]:g}",
        f"{100.0 * found.sum_ratio:+.3f} ± {100.0 * found.sum_error:.3f}",
        f"{np.sqrt(np.mean(found.pulls**2)):.2f}",
        f"{np.abs(found.pulls).max():.1f}",
        f"{found.seconds:.0f}",
    ]


HEAD = [
    "surface",
    "depth mm",
    "place mm",
    "sum over 48 pairs, engine - Mitsuba %",
    "pull rms",
    "largest pull",
    "core-s of Mitsuba",
]


def main(arguments: list[str]) -> None:
    """Make the table, or measure the speed."""
    if "--speed" in arguments:
        found = walked("analytic", 3.0, (14.0, 17.0), SPEED_RAYS, grid=192)
        values = asdict(found) | {"flux": found.flux.tolist(), "variance": found.variance.tolist()}
        print(json.dumps(values))
        return
    lines = []
    for number, state in enumerate(STATES):
        lines.append(row(*state, compared(*state, seed=number + 1)))
        print(" | ".join(lines[-1]), flush=True)
    made = f"Made with mitsuba {version('mitsuba')} and drjit {version('drjit')}"
    table = f"{made}, {8 * RAYS / 1e6:.0f} million rays a state.\n\n{markdown_table(HEAD, lines)}"
    PAGE.write_text(with_table(PAGE.read_text(encoding="utf-8"), table, MARKS), encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
