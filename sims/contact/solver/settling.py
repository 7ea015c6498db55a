"""When is an iteration at rest? When its steps have died away, or when it circles a fixed point closely.

At a few deep presses one facet at the contact edge enters and leaves the contact again and again, and the
iteration ends in a cycle of a few micrometres that no damping removes. The mean of such a cycle is taken
as the state if two windows of iterates have the same mean and no iterate is far from it. A state found so
says so (its `chatter` is not 0) and has to pass the same force balance as every other.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np

from design.arrays import FloatArray

WINDOW = 40
"""Iterates a window."""
CHATTER_LIMIT = 2e-3
"""Largest distance of a vertex from the mean of its cycle [tip radii]: 6 µm for a 3 mm tip, a fifth of the
default mesh's error at the depths where cycles occur."""
DRIFT_LIMIT = 3e-4
"""Largest difference between the means of two windows [tip radii]: 0.9 µm for a 3 mm tip."""


@dataclass(frozen=True, kw_only=True)
class Cycle:
    """The mean of a cycle of iterates.

    Attributes
    ----------
    mean : (value,) mean iterate
    spread : largest distance of an iterate's value from its mean
    force : mean force
    """

    mean: FloatArray
    spread: float
    force: float


class History:
    """The last two windows of iterates and forces."""

    def __init__(self) -> None:
        self._states: deque[FloatArray] = deque(maxlen=2 * WINDOW)
        self._forces: deque[float] = deque(maxlen=2 * WINDOW)

    def add(self, state: FloatArray, force: float) -> None:
        """Append one iterate; a copy is kept."""
        self._states.append(state.copy())
        self._forces.append(force)

    def cycle(self) -> Cycle | None:
        """The cycle that the iteration is in, or None if it is still on its way."""
        if len(self._states) < 2 * WINDOW:
            return None
        states = np.array(self._states)
        before, after = states[:WINDOW].mean(axis=0), states[WINDOW:].mean(axis=0)
        spread = float(np.abs(states[WINDOW:] - after).max())
        drift = float(np.abs(after - before).max())
        if not (drift <= DRIFT_LIMIT and spread <= CHATTER_LIMIT):
            return None
        return Cycle(mean=after, spread=spread, force=float(np.mean(list(self._forces)[WINDOW:])))
