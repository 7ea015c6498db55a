r"""Unilateral, frictionless contact of a rigid body with an elastic top: conjugate gradients with constraints.

The pressure p minimises ½ <p, G p> + <p, g₀> over p ≥ 0, where g₀ is the gap of the untouched top (negative where body
and top overlap), and G the top's downward displacement by pressure. In the minimum the gap g = g₀ + G p is 0 where
p > 0, and at least 0 elsewhere.

The method is that of I. A. Polonsky and L. M. Keer, Wear 231 (1999), 206-219, for a given approach of both bodies:
conjugate gradients over the nodes in contact. After every step, pressures below 0 are set to 0, nodes that overlap
without pressure come into contact, and the directions start anew when one does.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from optopad.design.arrays import FloatArray
from optopad.design.errors import ModelScopeError

MOST_STEPS = 1000


class NotSettledError(ModelScopeError):
    """The conjugate gradients did not settle."""


def contact_pressure(
    moved: Callable[[FloatArray], FloatArray], gap: FloatArray, settled: float, start: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Pressure (...) and gap (...) of a press.

    Parameters
    ----------
    moved : function from a pressure (...) to the top's downward displacement (...), linear and symmetric
    gap : (...) gap of the untouched top; infinite where no pressure may act
    settled : largest accepted overlap, and largest gap under pressure
    start : (...) first guess of the pressure, above 0 somewhere

    Raises
    ------
    NotSettledError : `MOST_STEPS` steps were not enough
    """
    open_to = np.isfinite(gap)
    pressure = np.where(open_to, np.maximum(start, 0.0), 0.0)
    way, before, fresh = np.zeros_like(pressure), 1.0, True
    now = moved(pressure) + gap
    for step in range(MOST_STEPS):
        touching = pressure > 0.0
        rest = np.where(touching, now, 0.0)
        squared = float((rest * rest).sum())
        overlap = float(-now.min(where=open_to, initial=0.0))
        if max(np.abs(rest).max(), overlap) <= settled:
            return pressure, now
        way = np.where(touching, rest + (0.0 if fresh else squared / before) * way, 0.0)
        before = squared
        answer = moved(way)
        length = float((rest * way).sum()) / float((way * answer).sum())
        pressure = np.maximum(pressure - length * way, 0.0)
        entering = open_to & (pressure == 0.0) & (now < 0.0) & ~touching
        fresh = bool(entering.any())
        pressure[entering] = -length * now[entering]
        if fresh or step % 50 == 49 or ((pressure == 0.0) & touching).any():
            now = moved(pressure) + gap
        else:
            now = now - length * answer
    raise NotSettledError(
        f"objects: the pressure under them did not settle within {MOST_STEPS} steps; press less deep, or take rounder "
        "edges"
    )
