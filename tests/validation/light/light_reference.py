"""Converged fluxes of the light benchmark, stored: what the errors of docs/validation/light.md are errors against.

`light_reference_build` makes them: 18 places x 6 depths, on analytic and contact surfaces, twice, with other settings,
another seed and other Gauss orders. The mean of both runs is the reference; half their difference estimates its
error. `data/light_reference.npz` keeps both, with the recipe.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from optopad.design.arrays import FloatArray
from optopad.sims.optics.engine.trace_states import CLASS_NAMES

STORED = Path(__file__).parent / "data" / "light_reference.npz"
BUILD = Path(__file__).parents[3] / "build" / "validation" / "light"
GROUPS = ("direct", "mirrored", "diffuse")
"""Classes that every method divides alike: the border between `top` and `skirt` is a convention."""


@dataclass(frozen=True, kw_only=True)
class Reference:
    """Fluxes of one family of surfaces.

    Attributes
    ----------
    halves : (2, group, state, e, r) both runs [-]
    flat : (group, e, r) of the untouched pad, mean of both runs [-]
    seconds : (2,) of a state, by the machine that made it
    """

    halves: FloatArray
    flat: FloatArray
    seconds: FloatArray

    @property
    def flux(self) -> FloatArray:
        """(group, state, e, r) the reference [-]."""
        return np.asarray(self.halves.mean(axis=0))

    @property
    def error(self) -> FloatArray:
        """(group, state, e, r) half the difference of the runs: as large as the error of their mean [-]."""
        return np.asarray((self.halves[0] - self.halves[1]) / 2.0)


def grouped(flux: FloatArray, names: Sequence[str] = CLASS_NAMES) -> FloatArray:
    """(group, ...) from (class, ...) of these names: what is neither direct nor diffuse was mirrored."""
    named = dict(zip(names, flux, strict=True))
    direct, diffuse = named.pop("direct"), named.pop("diffuse")
    return np.stack([direct, np.sum(list(named.values()), axis=0), diffuse])


@cache
def reference(surface: str, path: Path = STORED) -> Reference:
    """The stored reference of a family of surfaces."""
    with np.load(path, allow_pickle=False) as stored:
        return Reference(
            halves=stored[f"{surface}_halves"].astype(np.float64),
            flat=stored[f"{surface}_flat"].astype(np.float64),
            seconds=stored[f"{surface}_seconds"],
        )
