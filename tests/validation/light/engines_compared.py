"""Whether one light engine would do: rectangles by the engine of discs and crowned tops, against their own.

    python -m tests.validation.light.engines_compared     writes engines_table.md; about a minute

The rectangle is given as a form, which the general engine takes. Same presses, settings `score`; processor time of a
state without the untouched pad, the stated error, and the spread of each class of light over seeds.
"""

from __future__ import annotations

import os
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from optopad.design.preset import preset
from optopad.design.shape.top import Top
from optopad.sims.optics.engine.general import pad as formed_pad
from optopad.sims.optics.engine.trace_states import RawLight, trace_scene
from optopad.sims.optics.scene.lower import scene_of
from optopad.sims.optics.scene.optical_scene import OpticalScene
from tests.oracle.form_scenes import rectangle_form
from tests.oracle.pressed import pressed_tops

PADS, STATES, SEEDS, DEPTHS_MM = ("piacenza2017-pad", "oblong-60x40"), 9, 6, (0.3, 1.0, 2.0)
TABLE = Path(__file__).with_name("engines_table.md")
HEAD = (
    "| pad | engine | ms a state | stated error % | spread of mirrored light % | of scattered light % |\n"
    "|---|---|---:|---:|---:|---:|\n"
)


def as_form(scene: OpticalScene) -> OpticalScene:
    """The same pad for the general engine."""
    middle = scene.length_mm / 2, scene.width_mm / 2
    top = Top(clear_mm=scene.height_mm, apex_mm=middle, kx=0.0, ky=0.0)
    return replace(scene, form=replace(rectangle_form(scene.length_mm, scene.width_mm), top=top))


def measured(scene: OpticalScene, presses: Any, tops: list[Any]) -> tuple[float, float, float, float]:
    """Milliseconds a state, stated error, spread of mirrored and of scattered light over the untouched flux."""

    def trace(seed: int, count: int | None = None) -> RawLight:
        return trace_scene(scene, presses[:count, :2], tops[:count], accuracy="score", seed=seed)

    trace(0, 1)
    took_s, light = 0.0, []
    for seed in range(SEEDS):
        formed_pad._MIRRORED.clear()
        trace(seed, 1)
        began = time.process_time()
        light.append(trace(seed))
        took_s += time.process_time() - began
    untouched = trace_scene(scene, presses[:1, :2], [None], accuracy="score").flux.sum(axis=0)[0]
    lit = untouched > 0.0
    flux = np.array([one.flux for one in light])
    spread = [
        np.sqrt(np.mean((part.std(axis=0, ddof=1) / np.where(lit, untouched, 1.0))[:, lit] ** 2))
        for part in (flux[:, 1:3].sum(axis=1), flux[:, 4])
    ]
    stated = float(np.mean([one.relative_error.mean() for one in light]))
    return 1e3 * took_s / SEEDS / len(presses), 100 * stated, 100 * float(spread[0]), 100 * float(spread[1])


def rows() -> list[str]:
    """Two rows a pad."""
    found = []
    for name in PADS:
        design = preset(name)
        scene, random = scene_of(design), np.random.default_rng(3)
        places = 0.3 + 0.4 * random.random((STATES, 2))
        depths = np.resize(DEPTHS_MM, STATES)
        presses = np.column_stack([places * (scene.length_mm, scene.width_mm), depths])
        near = pressed_tops(design, presses, by_symmetry=False).near
        for engine, given in (("of rectangles", scene), ("general", as_form(scene))):
            ms, *percent = measured(given, presses, near)
            found.append(
                f"| {name} | {engine} | {ms:.0f} | " + " | ".join(f"{one:.2f}" for one in percent) + " |"
            )
    return found


if __name__ == "__main__":
    os.environ["OPTOPAD_LIGHT_CACHE_MB"] = "0"
    TABLE.write_text(HEAD + "\n".join(rows()) + "\n", encoding="utf-8")
    print(TABLE.read_text(encoding="utf-8"))
