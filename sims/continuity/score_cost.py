"""How long a score will take, told before it begins: presses x pairs x what one costs.

Almost all of a score is light, and light is traced pair by pair, press by press. Measured on pads of 8 to 32 parts
(rings of alternating parts, 20 presses at random places, nothing cached): 0.8 to 1.2 ms of one core for a pair under a
press at the map's settings, 2.2 to 2.4 ms at its settings near contact. Left out: the presses of single pairs, the
tolerance of open values, and what the pad's symmetry and the store of known light save.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from design.geometry.cavity import cavity_of
from design.spec import SensorDesign
from sims.press.depths import COARSE_STEP_MM, STEP_MM
from sims.verdict.pad_map import COARSE_PLACES, FINE_PLACES, map_grid_mm
from sims.verdict.presses import NEAR_MM, map_depths_mm

MAP_PAIR_S = 0.9e-3
"""Processor time of a pair under a press of the map [s]."""
NEAR_PAIR_S = 2.2e-3
"""The same up to `NEAR_MM`, where the light is finer [s]."""
FINE_PAIR_S = 2.0e-3
"""The same with `fine`, on the pad of 16 parts [s]."""
WORTH_SAYING_S = 20.0
"""Nobody wonders before."""


@dataclass(frozen=True, kw_only=True)
class ScoreCost:
    """What a score traces.

    Attributes
    ----------
    presses, pairs : of the map
    core_s : processor time [s]
    """

    presses: int
    pairs: int
    core_s: float

    def sentence(self, cores: int) -> str:
        """What to say before a score begins; nothing where it is soon over."""
        seconds = self.core_s / cores
        if seconds < WORTH_SAYING_S:
            return ""
        length = f"{seconds / 60:.0f} minutes" if seconds >= 90.0 else f"{round(seconds, -1):.0f} seconds"
        on = "1 core" if cores == 1 else f"{cores} cores"
        return (
            f"score: about {length} on {on} ({self.presses} presses x {self.pairs} pairs of parts); "
            "less by symmetry, and where the light is known"
        )


def score_cost(design: SensorDesign, *, fine: bool, full: bool) -> ScoreCost:
    """What the map of a design costs, `fine` and `full` as `sims.continuity.scoring.score` takes them."""
    cavity = cavity_of(design)
    places, step_mm = (FINE_PLACES, STEP_MM) if fine or full else (COARSE_PLACES, COARSE_STEP_MM)
    x_mm, y_mm = map_grid_mm(cavity, places)
    depth_mm = map_depths_mm(design.operating.max_depth_mm, step_mm)
    near = int(np.sum(depth_mm <= NEAR_MM))
    pairs = len(cavity.emitters) * len(cavity.receivers)
    at_a_place = near * NEAR_PAIR_S + (len(depth_mm) - near) * (FINE_PAIR_S if fine else MAP_PAIR_S)
    return ScoreCost(
        presses=len(x_mm) * len(y_mm) * len(depth_mm),
        pairs=pairs,
        core_s=len(x_mm) * len(y_mm) * pairs * at_a_place,
    )
