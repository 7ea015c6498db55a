"""What a signal map has to know about two touches; needs numpy only.

The map's light, and the product of the ratios of two touches, are not exact. Over untouched light, their error is taken
as normally distributed and independent for each pair, with the variance

    e₀² + e₁² (1 - r)² + e₂² |(1 - r_A) (1 - r_B)|,

r the ratio of light that a frame shows, r_A and r_B the map's of both touches. The first two terms are the error of the
map, which grows with what a touch changes; the last is that of the product. `optopad.sims.learning.together_fit` finds
the three numbers from light that is traced.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from optopad.design.arrays import FloatArray
from optopad.design.errors import InputError
from optopad.sims.learning.inference.touch_model import (
    Arrays,
    SigmaTable,
    sigma_table_of_arrays,
    taken,
)


@dataclass(frozen=True, kw_only=True, eq=False)
class Together:
    """What a signal map has to know about two touches.

    Attributes
    ----------
    radius_mm : radius of the tip
    errors : (3,) e₀, e₁ and e₂ [-]
    floor_counts : (pair,) standard deviation of a signal without light, without the map's error [counts]
    threshold : half of the difference in χ² above which there are two touches [-]
    sigma : factors by depth that multiply the standard deviations of two touches
    """

    radius_mm: float
    errors: FloatArray
    floor_counts: FloatArray
    threshold: float
    sigma: SigmaTable

    @property
    def least_mm(self) -> float:
        """Least distance of two tips that do not overlap [mm]."""
        return 2.0 * self.radius_mm

    def map_variance(self, ratio: FloatArray) -> FloatArray:
        """Variance (n, pair) of the map's error, over untouched light squared, in frames of ratios (n, pair) [-]."""
        return np.asarray(self.errors[0] ** 2 + self.errors[1] ** 2 * (1.0 - ratio) ** 2)

    def product_variance(self, first: FloatArray, second: FloatArray) -> FloatArray:
        """Variance (n, pair) of the product's error, from both touches' ratios (n, pair) [-]."""
        return np.asarray(self.errors[2] ** 2 * np.abs((1.0 - first) * (1.0 - second)))

    def arrays(self) -> dict[str, NDArray[np.generic]]:
        """The arrays, by their names in a model file."""
        return {
            "two_numbers": np.array([self.radius_mm, *self.errors, self.threshold]),
            "two_floor_counts": self.floor_counts,
            **{f"two_{name}": array for name, array in self.sigma.arrays().items()},
        }


def together_of_arrays(arrays: Arrays, pairs: int) -> Together | None:
    """Make it from its arrays in a model file; None if it has none.

    Raises
    ------
    InputError : arrays are missing or inconsistent.
    """
    if "two_numbers" not in arrays:
        return None
    radius, *errors, threshold = taken(arrays, "two_numbers", (5,)).tolist()
    floor = taken(arrays, "two_floor_counts", (pairs,))
    if radius <= 0.0 or min(errors) < 0.0 or floor.min() <= 0.0:
        raise InputError(
            "two_numbers, two_floor_counts: need a radius and floors above 0, and errors of 0 or more"
        )
    own = {name.removeprefix("two_"): array for name, array in arrays.items() if name.startswith("two_")}
    return Together(
        radius_mm=radius,
        errors=np.array(errors),
        floor_counts=floor,
        threshold=threshold,
        sigma=sigma_table_of_arrays(own),
    )
