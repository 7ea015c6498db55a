"""How well a signal map tells two touches from one: the part on estimation of docs/validation/touches.md.

    python -m tests.validation.learning.two_touches_table          (about ten minutes on two cores)

The map is the one that `optopad train --learner signal-map --touches 2` makes of simulated data, with its full grid.
The frames are as those of `optopad predict --touches 2`: light that the map has not seen, noise and drift of the signal
chain. Here both touches are equally deep, at depths of the score, `SEPARATION` times as far apart as tips that touch
each other, at random places and directions; the single touches are these touches, alone.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from optopad.design.arrays import FloatArray
from optopad.design.draft import Draft
from optopad.design.preset import preset
from optopad.design.press_protocol import QUICK_PROTOCOL, load_protocol_file
from optopad.design.progress import silent
from optopad.sims.learning.inference.two_touches import found_touches
from optopad.sims.learning.map_learner import signal_map_learner
from optopad.sims.learning.together_fit import matched_to
from optopad.sims.readings.protocol import draw, protocol_curves
from optopad.sims.touches_score import DEPTHS
from optopad.sims.two_touch_errors import frames_of
from tests.validation.contact.contact_table import markdown_table, write_tables

PAGE = Path(__file__).parents[3] / "docs" / "validation" / "touches.md"
PADS = ("piacenza2017-pad", "gripper-teensy")
SEPARATION, STATES, SEED = 1.3, 50, 5
HEAD = [
    "preset", "depth mm", "apart mm", "frames", "two found %", "location: median, 95 % mm", "depth: median, 95 % mm",
    "single touches", "called one %", "none, two %",
]  # fmt: skip


def pairs(draft: Draft, depth_mm: float, rng: np.random.Generator) -> FloatArray:
    """Two equal touches (n, 2, 3) at random places and directions."""
    away, found = SEPARATION * 2.0 * draft.design.indenter.tip_radius_mm, list[FloatArray]()
    while len(found) < STATES:
        first = draft.workspace.spread(rng.uniform(size=(1, 2)))[0]
        angle = rng.uniform(0.0, 2.0 * np.pi)
        second = first + away * np.array([np.cos(angle), np.sin(angle)])
        if draft.workspace.contains(*second):
            found.append(np.array([[*first, depth_mm], [*second, depth_mm]]))
    return np.array(found)


def rows(name: str) -> list[list[str]]:
    """A row for each depth."""
    design = preset(name)
    draft, rng = Draft.of(design), np.random.default_rng(SEED)
    curves = protocol_curves(design, load_protocol_file(QUICK_PROTOCOL).fitted_to(design), is_coarse=True)
    model = signal_map_learner(design, touches=2)(draw(curves).role("train"), seed=0)
    deepest = min(DEPTHS[-1] * design.indenter.tip_radius_mm, 0.9 * design.operating.max_depth_mm)
    made = []
    for share in DEPTHS:
        both = pairs(draft, share / DEPTHS[-1] * deepest, rng)
        alone = np.stack([both.reshape(-1, 3), np.full((2 * STATES, 3), np.nan)], axis=1)
        touches = np.concatenate([both, alone])
        signals = frames_of(touches, curves, rng, seed=SEED, on_step=silent)
        found = found_touches(model, np.concatenate(signals))
        true = np.tile(touches, (len(signals), 1, 1))
        is_pair = np.tile(np.arange(len(touches)) < STATES, len(signals))
        is_two = is_pair & (found.count == 2)
        off = found.press_mm[is_two] - matched_to(true[is_two], found.press_mm[is_two])
        called = [100.0 * float((found.count[~is_pair] == count).mean()) for count in (1, 0, 2)]
        made.append(
            [
                name,
                f"{both[0, 0, 2]:.2g}",
                f"{np.hypot(*(both[0, 0] - both[0, 1])[:2]):.2g}",
                str(int(is_pair.sum())),
                f"{100.0 * float((found.count[is_pair] == 2).mean()):.1f}",
                spread(np.hypot(off[..., 0], off[..., 1])),
                spread(np.abs(off[..., 2])),
                str(int((~is_pair).sum())),
                f"{called[0]:.1f}",
                f"{called[1]:.1f}, {called[2]:.1f}",
            ]
        )
    return made


def spread(errors: FloatArray) -> str:
    """Median and 95th percentile; empty without errors."""
    return f"{np.median(errors):.2f}, {np.percentile(errors, 95):.2f}" if errors.size else ""


def estimation() -> str:
    """The table of all pads."""
    return markdown_table(HEAD, [row for name in PADS for row in rows(name)])


if __name__ == "__main__":
    if sys.argv[1:]:  # pads to print
        print(*(row for name in sys.argv[1:] for row in rows(name)), sep="\n")
    else:
        write_tables(PAGE, "tests/validation/learning/two_touches_table.py", {"estimation": estimation}, [])
