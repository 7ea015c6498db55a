"""Factors by depth that scale a model's raw deviation to its real error.

They are measured at locations on which the model was not trained:

    sigma = raw sigma × factor(estimated depth)

Factors are interpolated linearly between the table's depths, and constant outside them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from optopad.design.arrays import FloatArray
from optopad.design.errors import InputError
from optopad.sims.learning.inference.touch_model import Arrays, taken


@dataclass(frozen=True, kw_only=True, eq=False)
class SigmaTable:
    """Factors from a model's raw deviation to its standard deviation, by depth.

    Attributes
    ----------
    depth_mm : (depth,) increasing depths [mm]
    factor : (depth, 3) factors for x, y, depth [-]
    """

    depth_mm: FloatArray
    factor: FloatArray

    def sigma_mm(self, depth_mm: FloatArray, raw_mm: FloatArray) -> FloatArray:
        """Standard deviations (n, 3) [mm] from raw deviations (n, 3) [mm] at estimated depths (n,) [mm]."""
        factors = [np.interp(depth_mm, self.depth_mm, column) for column in self.factor.T]
        return np.asarray(raw_mm * np.stack(factors, axis=1))

    def arrays(self) -> dict[str, NDArray[np.generic]]:
        """The table's arrays, by their names in a model file."""
        return {"sigma_depth_mm": self.depth_mm, "sigma_factor": self.factor}


UNIT_SIGMA = SigmaTable(depth_mm=np.zeros(1), factor=np.ones((1, 3)))
"""Table with factors of 1, for a model whose factors were not measured."""


def sigma_table_of_arrays(arrays: Arrays) -> SigmaTable:
    """Make the table from its arrays in a model file; raises `InputError` if they are inconsistent."""
    depth_mm = taken(arrays, "sigma_depth_mm", (None,))
    factor = taken(arrays, "sigma_factor", (len(depth_mm), 3))
    if not len(depth_mm) or (np.diff(depth_mm) <= 0.0).any() or factor.min() < 0.0:
        raise InputError("sigma_depth_mm: needs rising depths and factors of 0 or more")
    return SigmaTable(depth_mm=depth_mm, factor=factor)
