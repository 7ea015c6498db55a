"""The table of docs/validation/light.md for the paper's pad: errors and costs of the settings against `fine`.

    python -m tests.validation.light.light_pad    three minutes on one core

The benchmark's parts lie 2.7 mm and more below the top; the pad's reach to 0.7 mm below it, and its light grazes the
top over 28 mm, so that settings err otherwise. 18 places, drawn evenly over the workspace, times six depths, surfaces
of the contact model. The truth is the mean of three runs at `fine`, whose scatter is said.
"""

from __future__ import annotations

from pathlib import Path
from time import process_time

import numba
import numpy as np

from optopad.design.arrays import FloatArray
from optopad.design.io import write_text_atomically
from optopad.design.preset import preset
from optopad.design.shape.cavity import cavity_of
from optopad.sims.optics.engine.trace_states import trace_scene
from optopad.sims.optics.scene.lower import scene_of
from tests.bench.measures.benchmark_states import different_walls
from tests.oracle.pressed import pressed_tops
from tests.validation.contact.contact_table import markdown_table, with_table
from tests.validation.light.light_figures import Errors, errors_of
from tests.validation.light.light_table import ERROR_HEAD, PAGE, error_cells

MARKS = "<!-- made by tests/validation/light/light_pad.py -->", "<!-- end of pad -->"
SETTINGS = ("draft", "score", "standard")
DEPTHS_MM = (0.3, 0.7, 1.5, 2.5, 3.6, 4.9)
PLACES, PLACE_SEED = 18, 3
SEEDS, TRUE_SEEDS = (5, 105), (901, 902, 903)


class Pad:
    """The paper's pad under the table's presses."""

    def __init__(self) -> None:
        design = preset("piacenza2017-pad")
        self.scene = scene_of(design)
        space = cavity_of(design).workspace
        low, high = (space.x0_mm, space.y0_mm), (space.x1_mm, space.y1_mm)
        places = np.random.default_rng(PLACE_SEED).uniform(low, high, (PLACES, 2))
        self.centres_mm = np.repeat(places, len(DEPTHS_MM), axis=0)
        tops = pressed_tops(design, np.column_stack([self.centres_mm, DEPTHS_MM * PLACES]))
        self.near, self.fields = tops.near, tops.fields
        self.judged = different_walls(self.scene)
        self.untouched = self.flux("fine", TRUE_SEEDS[0], [0], is_pressed=False)[0]

    def flux(self, setting: str, seed: int, states: list[int], *, is_pressed: bool = True) -> FloatArray:
        """(state, pair) light of different walls."""
        near = [self.near[k] if is_pressed else None for k in states]
        fields = [self.fields[k] if is_pressed else None for k in states]
        raw = trace_scene(
            self.scene, self.centres_mm[states], near, fields=fields, accuracy=setting, seed=seed
        )
        return np.asarray(raw.flux.sum(axis=0)[:, self.judged])


def by_depth(errors: FloatArray) -> list[str]:
    """Root mean square by depth of (run, state, pair) errors [%]."""
    square = (errors**2).reshape(len(errors), -1, len(DEPTHS_MM), errors.shape[-1]).mean(axis=(0, 1, 3))
    return [f"{100.0 * np.sqrt(value):.2f}" for value in square]


def table() -> str:
    """Scatter of the truth, and one row a setting."""
    pad = Pad()
    every = list(range(len(pad.near)))
    runs = np.array([pad.flux("fine", seed, every) for seed in TRUE_SEEDS]) / pad.untouched
    truth = runs.mean(axis=0)
    rows = []
    for setting in SETTINGS:
        pad.flux(setting, 0, every[:1])
        started = process_time()
        errors = np.array([pad.flux(setting, seed, every) for seed in SEEDS]) / pad.untouched - truth
        seconds = (process_time() - started) / (len(SEEDS) * len(every))
        found: Errors = errors_of(errors)
        rows.append([setting, *error_cells(found), *by_depth(errors), f"{seconds:.4f}"])
    scatter = 100.0 * np.sqrt(runs.var(axis=0, ddof=1).mean() / len(runs))
    head = ["accuracy", *ERROR_HEAD, *(f"rms at {depth:g} mm" for depth in DEPTHS_MM), "core-s a state"]
    return "\n\n".join([markdown_table(head, rows), f"Standard error of the truth: {scatter:.3f} % rms."])


def write_page(text: str, page: Path = PAGE) -> None:
    """Put the table into the page."""
    write_text_atomically(page, with_table(page.read_text(encoding="utf-8"), text, MARKS))


def main() -> None:
    """Measure and write."""
    numba.set_num_threads(1)
    write_page(table())


if __name__ == "__main__":
    main()
