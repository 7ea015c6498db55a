"""How long a score, or a whole run, will take, told before it begins: stages x states x what one costs.

Almost all of a score is light. Every stage traces states (a press at a place and a depth); states that a symmetry of
the layout carries onto each other are traced once. On flat rectangles a state costs time by pairs, on discs and crowned
pads by emitters and by points of the top. Light that is stored already costs nothing.

Left out: places that the first light leaves open, the Monte Carlo over manufacturing tolerances, compiling.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from design.arrays import FloatArray
from design.shape.cavity import CavityGeometry, cavity_of
from design.shape.pairs import chord_midpoint_mm, is_facing_rows, judged_pairs
from design.spec import SensorDesign
from design.spec.cheap_fields import TARGET, cheap_fields
from sims.bounds.defaults import SHALLOW_MM
from sims.bounds.observability import bound_depths_mm
from sims.bounds.stencil import PRESSES, Steps, stencil_presses
from sims.continuity.settings import Settings, settings_of
from sims.optics.accuracy import accuracy_of
from sims.optics.scene.lower import scene_of
from sims.optics.scene.symmetry import state_classes
from sims.optics.trace_cost import emitter_cost_s, pair_cost_s, state_cost_s, untouched_cost_s
from sims.press.depths import COARSE_STEP_MM, depth_schedule_mm
from sims.verdict.builds import accuracy_of_builds
from sims.verdict.pad_map import grid_places_mm, map_grid_mm
from sims.verdict.presses import (
    NEAR_MM,
    accuracy_of_pairs,
    map_depths_mm,
)
from sims.verdict.tolerance import tried_values

ANSWERING_PAIRS = 0.35
"""Share of a pad's pairs that answer at its weakest place, by which builds are judged: 0.17 to 0.7 on the presets."""
TRACED_AGAIN = 0.15
"""Share of the bounds' deep voxels that the first light leaves open."""
SAME_MIRRORS = 0.2
"""Cost of a build of a disc or crowned pad that scatters otherwise and mirrors alike, over that of another one."""
TRACED_TWICE = 1.25
"""Cost of builds of discs and crowned pads, over that of one trace: those close to a deadband take two."""
REST_S, RUN_S = 10.0, 24.0
"""Processor time of all but light [s]: of a score (start, contact, drawings), and what a run adds (mold, report)."""
WORTH_SAYING_S = 20.0
"""Nobody wonders before."""


@dataclass(frozen=True, kw_only=True)
class ScoreCost:
    """What a score traces.

    Attributes
    ----------
    presses, pairs : of the map
    core_s : processor time [s]
    stages_s : of it, stage by stage [s]
    job : score or run
    """

    presses: int
    pairs: int
    core_s: float
    stages_s: dict[str, float] = field(default_factory=dict)
    job: str = "score"

    def sentence(self, cores: int) -> str:
        """What to say before a score begins; nothing where it is soon over."""
        seconds = self.core_s / cores
        if seconds < WORTH_SAYING_S:
            return ""
        length = f"{seconds / 60:.0f} minutes" if seconds >= 90.0 else f"{round(seconds, -1):.0f} seconds"
        on = "1 core" if cores == 1 else f"{cores} cores"
        return (
            f"{self.job}: about {length} on {on} ({self.presses} presses x {self.pairs} pairs of parts in the map); "
            "less where the light is known"
        )


def score_cost(design: SensorDesign, *, fine: bool, full: bool, is_run: bool = False) -> ScoreCost:
    """What a score of a design costs, `fine` and `full` as `sims.continuity.scoring.score` takes them.

    is_run : the whole `optopad run`, with mold, report and the firmware's files
    """
    cavity = cavity_of(design)
    row = settings_of(fine=fine, full=full)
    places_mm = grid_places_mm(cavity.workspace, *map_grid_mm(cavity, row.map_places))
    depth_mm = map_depths_mm(design.operating.max_depth_mm, row.map_step_mm)
    stages = {
        "untouched": untouched_cost_s(scene_of(design), accuracy_of(row.untouched)),
        "pairs": _pairs_s(design, cavity, row),
        "map": _map_s(design, places_mm, depth_mm, row),
        "bounds": _bounds_s(design, places_mm, row),
        "builds": _builds_s(design, cavity),
        "rest": REST_S + (RUN_S if is_run else 0.0),
    }
    return ScoreCost(
        presses=len(places_mm) * len(depth_mm),
        pairs=len(cavity.emitters) * len(cavity.receivers),
        core_s=sum(stages.values()),
        stages_s=stages,
        job="run" if is_run else "score",
    )


def _distinct(design: SensorDesign, places_mm: FloatArray) -> int:
    """How many of (n, 2) places no symmetry of the layout carries onto another."""
    found = state_classes(scene_of(design), places_mm[:, None, :], [[1.0]] * len(places_mm))
    return len(found.first)


def _pairs_s(design: SensorDesign, cavity: CavityGeometry, row: Settings) -> float:
    """Single pairs, each under its own press; a pair's image under a symmetry is not traced again."""
    settings = accuracy_of(accuracy_of_pairs(design, row.pairs))
    pairs = judged_pairs(cavity)
    alike = len(pairs) / max(_distinct_pairs(design, cavity), 1)
    depths = len(depth_schedule_mm(design.operating.max_depth_mm, row.step_mm))
    return len(pairs) / alike * depths * emitter_cost_s(scene_of(design), settings, 1)


def _distinct_pairs(design: SensorDesign, cavity: CavityGeometry) -> int:
    """How many judged pairs no symmetry of the layout carries onto another, by the places of their presses."""
    places = np.array([chord_midpoint_mm(cavity, pair) for pair in judged_pairs(cavity)])
    distinct = np.unique(np.round(places, 6), axis=0)
    return round(len(places) * _distinct(design, distinct) / len(distinct))


def _map_s(design: SensorDesign, places_mm: FloatArray, depth_mm: FloatArray, row: Settings) -> float:
    scene = scene_of(design)
    near = int(np.sum(depth_mm <= NEAR_MM))
    at_a_place = near * state_cost_s(scene, row.near or row.map)
    at_a_place += (len(depth_mm) - near) * state_cost_s(scene, row.map)
    return _distinct(design, places_mm) * at_a_place


def _bounds_s(design: SensorDesign, places_mm: FloatArray, row: Settings) -> float:
    """Both halves of all stencils."""
    if is_facing_rows(cavity_of(design)):
        return 0.0
    scene, steps = scene_of(design), Steps()
    depths = bound_depths_mm(row.bound_depths_mm, design.operating.max_depth_mm, steps.depth_mm)
    voxels = np.column_stack([places_mm, np.ones(len(places_mm))])
    sides = stencil_presses(voxels, steps.offsets_mm(voxels[:, 2])).reshape(-1, PRESSES, 3)
    beside, middle = _distinct(design, sides[:, :4, :2].reshape(-1, 2)), 2 * _distinct(design, places_mm)
    deep = int(np.sum(depths >= SHALLOW_MM))
    first, then = (accuracy_of(one) for one in row.bounds)
    known = middle if first == row.map else 0  # the first half's, from the map
    finer = (len(depths) - deep + TRACED_AGAIN * deep) * 2 * (beside + middle)
    return (
        deep * (2 * (beside + middle) - known) * state_cost_s(scene, first)
        + finer * state_cost_s(scene, then)
        + untouched_cost_s(scene, first)
    )


def _builds_s(design: SensorDesign, cavity: CavityGeometry) -> float:
    """Both ends of every unmeasured parameter, and a step of each field either way."""
    settings, scene = accuracy_of_builds(design), scene_of(design)
    pairs = len(cavity.emitters) * len(cavity.receivers)
    is_facing, is_flat = is_facing_rows(cavity), scene.form is None
    judged = 1 if is_facing else max(round(ANSWERING_PAIRS * pairs), 1)
    depths = len(depth_schedule_mm(design.operating.max_depth_mm, COARSE_STEP_MM))
    fields = [path for path in cheap_fields(design) if path != TARGET]
    stepped = [design] * (2 * len(fields))
    total = 0.0
    for build, is_step in _tried(design, stepped):
        own = scene_of(build)
        judged_s = pair_cost_s(own, settings) * judged if is_flat else state_cost_s(own, settings)
        if is_facing and not is_flat:
            judged_s = emitter_cost_s(own, settings, 1)
        bounds_s = (2 * PRESSES + 1) * state_cost_s(own, settings) if is_step else 0.0
        mirrors = SAME_MIRRORS if not is_flat and build is not design and _mirrors_alike(own, scene) else 1.0
        total += (
            (1.0 if is_flat else TRACED_TWICE)
            * mirrors
            * (untouched_cost_s(own, settings) + depths * judged_s + bounds_s)
        )
    return total


def _tried(design: SensorDesign, stepped: Sequence[SensorDesign]) -> list[tuple[SensorDesign, bool]]:
    """Builds that are judged, and whether their bounds are wanted, too."""
    ends = [(design.with_(**{used.path: end}), False) for used, both in tried_values(design) for end in both]
    return [(design, True), *ends, *((build, True) for build in stepped)]


def _mirrors_alike(one: object, other: object) -> bool:
    """Whether two scenes differ in what scatters alone."""
    scatters = {"wall_reflectance", "bottom_reflectance", "tip_reflectance"}
    kept = [
        {name: repr(value) for name, value in vars(scene).items() if name not in scatters}
        for scene in (one, other)
    ]
    return kept[0] == kept[1]
