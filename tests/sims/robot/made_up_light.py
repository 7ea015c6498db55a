"""A map of light with made-up weights and a made-up light of the tip, for tests without tracing."""

from __future__ import annotations

import numpy as np

import optopad
from optopad.design.draft import Draft
from optopad.design.spec import SensorDesign
from optopad.sims.learning.inference.signal_map import fitted_spline
from optopad.sims.robot.fast_light import CHANNELS, FastLight, draft_nodes
from optopad.sims.robot.light_fit import cell_mm


def made_up_light(name: str = "gripper-teensy", design: SensorDesign | None = None) -> FastLight:
    """A map with random weights, and light of the tip that falls with its depth and depends on its place."""
    design = optopad.load(name) if design is None else design
    draft = Draft.of(design)
    cavity, rng = draft.cavity, np.random.default_rng(1)
    shape = len(cavity.emitters), len(cavity.receivers)
    nodes, pairs = draft_nodes(draft, cell_mm(draft)), shape[0] * shape[1]
    x, y, root = (np.linspace(0.0, one, 8) for one in (cavity.length_mm, cavity.width_mm, 1.4))
    slope = rng.uniform(0.02, 0.1, pairs)
    places = (x[:, None, None, None] + 2.0 * y[:, None, None]) / 40.0
    roots = 1.0 - slope * root[:, None] ** 2 * (1.0 + places)
    steps = np.array([axis[1] - axis[0] for axis in (x, y, root)])
    return FastLight(
        digest=design.digest,
        top=draft.plan.top,
        nodes=nodes,
        tip_radius_mm=design.indenter.tip_radius_mm,
        tip=fitted_spline(roots, np.zeros(3), steps),
        weights=rng.normal(0.0, 1e-3, (CHANNELS * nodes.cells, pairs)).astype(np.float32),
        untouched=rng.uniform(1e-3, 2e-3, shape),
        deepest_mm=2.0,
        states=0,
        errors={"all": 0.02},
    )
