"""The smallest mold of a design: lowest rim and least outer size with which no rule finds more than before."""

from __future__ import annotations

import math

from optopad.design.errors import DesignError
from optopad.design.fields.base import get_at, leaves
from optopad.design.rules.check import check
from optopad.design.spec import SensorDesign
from optopad.sims.score.objective import bodies_above_surface_mm

OUTER = ("mold.outer_length_mm", "mold.outer_width_mm", "mold.outer_diameter_mm")


def least_rim(design: SensorDesign) -> dict[str, float]:
    """The lowest rim of the mold that no rule refuses and no body stands above; empty if the rim is that low."""
    above_mm = bodies_above_surface_mm(design)
    low = min(math.ceil(round(10.0 * max(above_mm, 0.0), 6)) / 10.0, design.mold.rim_mm)
    return _lowered(design, "mold.rim_mm", low, 0.1)


def smallest_mold(design: SensorDesign) -> dict[str, float]:
    """The smallest outer size and rim of the mold that no rule refuses or warns of; empty if it is that small."""
    changes, own = least_rim(design), dict(leaves(design.model_dump(mode="json")))
    for path in OUTER:
        if own.get(path) is not None:
            changes |= _lowered(design.with_(**changes), path, 0.0, 0.5)
    return changes


def _lowered(design: SensorDesign, path: str, low: float, step: float) -> dict[str, float]:
    """The lowest value of a field, in steps above `low`, with which no rule finds more than before."""
    value = float(get_at(design.model_dump(mode="json"), path))
    usual = len(check(design))

    def is_good(steps: int) -> bool:
        try:
            return len(check(design.with_(**{path: round(low + steps * step, 4)}))) <= usual
        except DesignError:
            return False

    bad, good = -1, math.floor((value - low) / step + 1e-9)
    while good - bad > 1:
        middle = (good + bad) // 2
        bad, good = (bad, middle) if is_good(middle) else (middle, good)
    found = round(low + good * step, 4)
    return {path: found} if found < value - 1e-9 and is_good(good) else {}
