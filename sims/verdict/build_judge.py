"""How builds of a design are judged: what is looked at, in words, and the function that judges one build.

Facing rows by their governing pair or by all facing pairs; a pad by the pairs that answer at its weakest place.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from design.shape.cavity import cavity_of
from design.shape.pairs import is_facing_rows, judged_pairs
from design.spec import SensorDesign
from sims.optics.light_signals import LightSignals
from sims.readings.readout import Readout
from sims.verdict.builds import Brief, facing_brief, pair_brief, place_brief, responsive_pairs
from sims.verdict.pad_map import PadMap
from sims.verdict.presses import Pair

BuildJudge = Callable[[SensorDesign], Brief]


def pair_judge(pair: Pair, name: str, *, seed: int) -> tuple[str, BuildJudge]:
    """Builds judged by one pair under its own press."""
    return name, lambda build: pair_brief(build, pair, seed=seed)


def facing_judge(*, seed: int) -> tuple[str, BuildJudge]:
    """Builds of facing rows judged by all facing pairs, as the verdict is."""
    return "the facing pairs", lambda build: facing_brief(build, seed=seed)


def place_judge(
    design: SensorDesign, pad_map: PadMap, light: LightSignals, readout: Readout, *, seed: int
) -> tuple[str, BuildJudge]:
    """Builds of a pad judged at the design's weakest place, by the pairs that answer there."""
    weak = pad_map.weakest
    place_mm = (weak.x_mm, weak.y_mm)
    pairs = _answering_pairs(design, light, place_mm, readout)
    name = f"the pad at x {weak.x_mm:g}, y {weak.y_mm:g} mm"
    return name, lambda build: place_brief(build, place_mm, pairs, seed=seed)


def verdict_judge(
    design: SensorDesign,
    pad_map: PadMap | None,
    light: LightSignals | None,
    readout: Readout,
    *,
    seed: int,
) -> tuple[str, BuildJudge]:
    """Builds judged by what the verdict of the design is about."""
    if pad_map is None or light is None or is_facing_rows(cavity_of(design)):
        return facing_judge(seed=seed)
    return place_judge(design, pad_map, light, readout, seed=seed)


def _answering_pairs(
    design: SensorDesign, light: LightSignals, place_mm: tuple[float, float], readout: Readout
) -> tuple[Pair, ...]:
    pairs = judged_pairs(cavity_of(design))
    here = (light.presses[:, 0] == place_mm[0]) & (light.presses[:, 1] == place_mm[1])
    unlimited = np.stack([light.flux[here, i, j] for i, j in pairs], axis=1) * readout.of_pairs(pairs)
    counts = np.minimum(unlimited, readout.full_scale_counts)
    return responsive_pairs(design, light.presses[here, 2], counts, pairs)
