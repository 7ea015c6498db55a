"""Path of a stage's tip over time, as its program commanded it: rests and straight moves of constant speed.

A path consists of knots. Between two knots the position is linear in time, so a rest is two knots at one position. A
knot without a position (NaN) means that the position around it is unknown.

The printer reports when a move has ended, not when it began: firmware may hold a single move back for a tenth of a
second, to wait for more moves. So a move ends when the report arrives, and it began earlier by its way over its
commanded speed. A move that took longer than that by more than `LATEST_START_S` was slower than commanded, because the
printer limits its speed; then it began with the command.

Left out are acceleration and the delay of the report. Together they make the path late by a common 5 to 20 ms: at 5
mm/s and 500 mm/s², acceleration makes it late by 5 ms, or 0.03 mm. A fit of a force to the path finds such a delay as
an offset of the clock.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Protocol, runtime_checkable

import numpy as np

from optopad.design.arrays import FloatArray
from optopad.fabrication.stage.stage import Position, Stage

Knot = tuple[float, float, float, float]
"""Time [s since 1970] and position x, y, depth [mm] of the tip."""
NOWHERE: Position = (math.nan, math.nan, math.nan)
LATEST_START_S = 0.2
"""Longest time between a command and the beginning of its move [s]."""
SAME_MM = 0.05
"""Greatest step between two parts of a path [mm]; at a larger one a part between them is missing."""


@runtime_checkable
class TracedStage(Stage, Protocol):
    """A stage that knows the path of its tip."""

    def path(self) -> list[Knot]:
        """Knots of the path since the last call, to the present time; the tip is at rest."""
        ...


def leg(sent_s: float, ended_s: float, start: Position, end: Position, speed_mm_s: float) -> list[Knot]:
    """Knots of a straight move.

    Parameters
    ----------
    sent_s, ended_s : times at which it was commanded, and at which its end was reported [s since 1970]
    start, end : positions before and after [mm]
    speed_mm_s : commanded speed [mm/s]
    """
    takes_s = math.dist(start, end) / speed_mm_s
    is_late = ended_s - sent_s > takes_s + LATEST_START_S
    began_s = sent_s if is_late else max(sent_s, ended_s - takes_s)
    return [(began_s, *start), (ended_s, *end)]


def joined_path(parts: Iterable[FloatArray]) -> FloatArray | None:
    """The knots (n, 4) of a whole path, from its parts in any order; None if there are none, or if times decrease.

    Where a part does not continue at the position at which the part before it ended, a knot without a position is
    inserted. Knots without a position are removed at the ends.
    """
    found: list[FloatArray] = []
    for part in sorted((part for part in parts if len(part)), key=lambda part: float(part[0, 0])):
        if found and np.linalg.norm(part[0, 1:] - found[-1][-1, 1:]) > SAME_MM:
            found.append(np.array([(part[0, 0], *NOWHERE)]))
        found.append(part)
    whole = np.concatenate([np.empty((0, 4)), *found])
    known = np.flatnonzero(np.isfinite(whole).all(axis=1))
    if len(known) < 2 or (np.diff(whole[:, 0]) < 0).any():
        return None
    return whole[known[0] : known[-1] + 1]
