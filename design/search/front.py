"""The Pareto front: designs that no other design dominates in the objectives."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from optopad.design.arrays import BoolArray, FloatArray
from optopad.design.search.improve import Tried
from optopad.design.search.space import SearchSpace


def not_dominated(losses: FloatArray) -> BoolArray:
    """Array (n,) that is true for each design that no other design dominates.

    A design dominates another one if no loss of it is larger and at least one is smaller.

    Parameters
    ----------
    losses : (n, figure) numbers to minimise, one array row per design
    """
    kept = np.ones(len(losses), dtype=np.bool_)
    for row, loss in enumerate(losses):
        beaten_by = np.all(losses <= loss, axis=1) & np.any(losses < loss, axis=1)
        kept[row] = not beaten_by.any()
    return kept


def losses_of(space: SearchSpace, tried: Sequence[Tried]) -> FloatArray:
    """Objectives of designs as an array (n, objective), with signs chosen so that smaller is better."""
    rows = [
        [
            float(one.judged.figures[objective.figure] or 0.0) * (1 if objective.sense == "minimize" else -1)
            for objective in space.objectives
        ]
        for one in tried
    ]
    return np.array(rows, dtype=np.float64).reshape(len(rows), len(space.objectives))


def pareto_front(space: SearchSpace, tried: Sequence[Tried]) -> tuple[Tried, ...]:
    """Feasible designs that no other dominates, without duplicates; the best in the first objective comes first."""
    feasible = [one for one in tried if one.is_feasible]
    losses = losses_of(space, feasible)
    kept: dict[str, tuple[float, Tried]] = {}
    for one, loss, keep in zip(feasible, losses, not_dominated(losses), strict=True):
        if keep:
            kept.setdefault(one.digest, (float(loss[0]), one))
    return tuple(one for _, one in sorted(kept.values(), key=lambda item: (item[0], item[1].number)))
