"""Light of two tips at once against the oracle, pair by pair: `python -m tests.validation.light.tips_table`.

The oracle and the product trace the same top, which the contact model of both tips gives. So the table tests the light
alone. The oracle runs in batches of rays; interrupted, it goes on.

Columns of the table
--------------------
- worst: the pair that is off most, in joint standard errors of product and oracle, and the rms of these errors
- all: how far the sum over all pairs is off, and the oracle's standard error of it
- change by the tips, the oracle's standard error, and the product's: over the untouched signal, rms over pairs that are
  not dim (`tests.validation.light.shapes_table`)
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from optopad.design.draft import Draft
from optopad.design.preset import preset
from optopad.sims.optics.scene.lower import scene_of
from optopad.sims.optics.tracing import tops_of_tips, trace
from tests.validation.contact.contact_table import markdown_table, write_tables
from tests.validation.light.shapes_table import DIM, compared, oracle_batches

PAGE = Path(__file__).parents[3] / "docs" / "validation" / "touches.md"
Tip = tuple[float, float, float]
STATES: dict[str, tuple[tuple[Tip, Tip], ...]] = {
    "piacenza2017-pad": (
        ((13.0, 16.0, 0.5), (19.0, 16.0, 0.5)),
        ((12.0, 12.0, 1.0), (17.3, 17.3, 1.0)),
        ((7.0, 16.0, 1.0), (25.0, 16.0, 1.0)),
        ((9.5, 16.0, 2.0), (18.5, 20.0, 1.0)),
        ((10.0, 16.0, 3.0), (22.0, 16.0, 3.0)),
        ((12.0, 13.0, 3.0), (19.5, 13.0, 0.5)),
        ((6.0, 10.0, 2.0), (6.0, 18.0, 1.0)),
        ((6.0, 6.0, 1.5), (19.0, 9.0, 2.5)),
    ),
    "levi2013-disc": (((23.0, 27.0, 1.0), (32.0, 29.0, 2.0)), ((14.0, 20.0, 1.5), (20.5, 22.0, 0.7))),
    "crowned-40x25": (((15.0, 12.0, 1.0), (24.0, 13.0, 0.7)), ((8.0, 8.0, 1.5), (30.0, 17.0, 1.0))),
    "gripper-stadium": (((9.0, 7.0, 0.5), (14.0, 7.5, 0.3)), ((7.0, 5.0, 0.6), (11.0, 9.0, 0.4))),
}
"""x, y, depth of both tips [mm]; on the paper's pad 2 to 6 tip radii apart, the last two near walls."""
ACCURACY = "standard"
RAYS = 100_000
"""Rays of each emitter in a batch."""
BATCHES = {"piacenza2017-pad": 4, "levi2013-disc": 3, "crowned-40x25": 4, "gripper-stadium": 4}


def rows(name: str) -> Iterator[list[str]]:
    """A row for each pair of tips on a pad."""
    draft = Draft.of(preset(name))
    scene, radius = scene_of(draft.design), draft.design.indenter.tip_radius_mm
    rays, count = RAYS, BATCHES[name]
    tips = np.array([((0.0, 0.0, 0.0),) * 2, *STATES[name]])
    made = tops_of_tips(draft, scene, tips).made
    tops = [made(state) for state in range(len(tips))]
    batches = oracle_batches(f"{name}-tips", scene, tips[:, 0, :2], tops, rays, count)
    seen = batches.mean(axis=0).sum(axis=(1, 2))
    light = trace(draft, tips, accuracy=ACCURACY)
    untouched = light.flux[0]
    bright = untouched >= DIM * untouched.max()
    for state, (one, other) in enumerate(tips[1:], start=1):
        row = compared(light.flux, light.standard_error, light.flux, batches, state, rays)
        every = light.flux[state].sum() / seen[state] - 1.0
        counted = np.sqrt(light.flux[state] / (rays * count))
        shares = np.array([light.flux[state] - untouched, counted, light.standard_error[state]]) / untouched
        yield [
            name,
            "; ".join(", ".join(f"{value:g}" for value in tip) for tip in (one, other)),
            f"{np.hypot(*(one - other)[:2]) / radius:.1f}",
            f"{row.worst:.1f}",
            f"{row.spread:.2f}",
            f"{100.0 * every:+.2f}, {100.0 / np.sqrt(seen[state] * rays * count):.2f}",
            *(f"{100.0 * np.sqrt(np.mean(share[bright] ** 2)):.2f}" for share in shares),
        ]


def light() -> str:
    """The table of all pads."""
    head = ["preset", "x, y, depth of both tips mm", "apart, tip radii", "worst pair, joint standard errors"]
    head += ["rms of these", "all: off, error %", "change %", "the oracle's error %", "stated error %"]
    return markdown_table(head, [row for name in STATES for row in rows(name)])


if __name__ == "__main__":
    if sys.argv[1:]:  # pads to print
        print(*(row for name in sys.argv[1:] for row in rows(name)), sep="\n")
    else:
        write_tables(PAGE, "tests/validation/light/tips_table.py", {"light": light}, [])
