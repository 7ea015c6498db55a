r"""What two touches change together in the light of every pair, beyond the product of both; needs numpy only.

    change(A, B) = d_A d_B Σ over both orders of  w₂ tanh(W₁ φ + b₁),      d = depth over tip radius

φ are, for a pair's chord from emitter to receiver: where each touch is along the chord (-1 to 1 between its ends), its
distance from the chord, its depth and its ratio of light; the distance of both touches; whether both are on the same
side of the chord; and the chord's length. Lengths are in tip radii. So one small network holds for all pairs of a
pad, and its slopes by the six coordinates follow by the chain rule. The factor makes the change 0 if a touch is absent,
the sum makes it independent of the order. The network is fitted by `optopad.sims.learning.together_fit`.

What it misses has a standard deviation of √(e₀² + (e₁ m)²), with m the root of the product of both touches' own
changes, 1 - ratio, of the pair.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

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

FEATURES = 11
BLUR = 0.3
"""Distance from a chord below which both sides count as one [tip radii]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Together:
    """What two touches change together.

    Attributes
    ----------
    chords_mm : (pair, 4) x and y of emitter and receiver
    radius_mm : radius of the tip
    inner, inner_offset : (FEATURES, hidden), (hidden,) first layer of the network
    outer : (hidden,) its last layer
    missed : (2,) e₀ and e₁ of the network's error [-]
    threshold : half of the difference in χ² above which there are two touches [-]
    sigma : factors by depth that multiply the standard deviations of two touches
    """

    chords_mm: FloatArray
    radius_mm: float
    inner: FloatArray
    inner_offset: FloatArray
    outer: FloatArray
    missed: FloatArray
    threshold: float
    sigma: SigmaTable

    @property
    def least_mm(self) -> float:
        """Least distance of two tips that do not overlap [mm]."""
        return 2.0 * self.radius_mm

    def error(self, first: FloatArray, second: FloatArray) -> FloatArray:
        """Standard deviation (n, pair) of what the network misses, from both touches' ratios (n, pair) [-]."""
        return missed_by(self.missed, first, second)

    def change(
        self, press: FloatArray, ratio: FloatArray, slope: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """What two touches change together, over untouched light (n, pair) [-], and its slopes (n, 2, 3, pair) [1/mm].

        Parameters
        ----------
        press : (n, 2, 3) x, y, depth of both touches [mm]
        ratio : (n, 2, pair) their ratios of light
        slope : (n, 2, 3, pair) slopes of these by x, y and depth [1/mm]
        """
        depth = press[:, :, 2] / self.radius_mm
        inputs, by_press = self._features(press, ratio, slope)
        total, back = np.zeros(ratio.shape[::2]), np.zeros_like(inputs)
        for order in (slice(None), _SWAPPED):
            hidden = np.tanh(inputs[..., order] @ self.inner + self.inner_offset)
            total += hidden @ self.outer
            by_input = ((1.0 - hidden**2) * self.outer) @ self.inner.T
            back += by_input if order is not _SWAPPED else by_input[..., _SWAPPED]
        scale = depth.prod(axis=1)[:, None]
        slopes = scale[:, None, None] * np.einsum("nkf,nacfk->nack", back, by_press)
        slopes[:, 0, 2] += depth[:, 1, None] / self.radius_mm * total
        slopes[:, 1, 2] += depth[:, 0, None] / self.radius_mm * total
        return scale * total, slopes

    @cached_property
    def _chords(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Middles (pair, 2), directions (pair, 2) and half lengths (pair,) of the chords [mm]."""
        start, end = self.chords_mm[:, :2], self.chords_mm[:, 2:]
        half = 0.5 * np.maximum(np.linalg.norm(end - start, axis=1), 1e-6)
        return 0.5 * (start + end), (end - start) / (2.0 * half[:, None]), half

    def features(self, press: FloatArray, ratio: FloatArray) -> FloatArray:
        """Inputs φ (n, pair, FEATURES) of the network, as of `change`."""
        return self._features(press, ratio, np.zeros((*ratio.shape[:2], 3, ratio.shape[2])))[0]

    def _features(
        self, press: FloatArray, ratio: FloatArray, slope: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Inputs (n, pair, FEATURES), and their slopes (n, 2, 3, FEATURES, pair) [1/mm]."""
        middle, way, half = self._chords
        radius, (count, _, pairs) = self.radius_mm, ratio.shape
        inputs = np.empty((count, pairs, FEATURES))
        slopes = np.zeros((count, 2, 3, FEATURES, pairs))
        off = press[:, :, None, :2] - middle
        along = (off * way).sum(axis=-1) / half
        aside = (way[:, 0] * off[..., 1] - way[:, 1] * off[..., 0]) / radius
        smooth = np.sqrt(aside**2 + BLUR**2)
        across = np.stack([-way[:, 1], way[:, 0]], axis=1) / radius
        for k in range(2):
            first = 4 * k
            inputs[..., first : first + 4] = np.stack(
                [
                    along[:, k],
                    smooth[:, k],
                    np.broadcast_to(press[:, k, 2:] / radius, (count, pairs)),
                    ratio[:, k],
                ],
                axis=-1,
            )
            for axis in range(2):
                slopes[:, k, axis, first] = way[:, axis] / half
                slopes[:, k, axis, first + 1] = aside[:, k] / smooth[:, k] * across[:, axis]
            slopes[:, k, 2, first + 2] = 1.0 / radius
            slopes[:, k, :, first + 3] = slope[:, k]
        apart = press[:, 0, :2] - press[:, 1, :2]
        away = np.maximum(np.linalg.norm(apart, axis=1), 1e-9)
        inputs[..., 8] = away[:, None] / (4.0 * radius)
        inputs[..., 9] = aside.prod(axis=1) / smooth.prod(axis=1)
        inputs[..., 10] = half / (4.0 * radius)
        for k in range(2):
            by_aside = aside[:, 1 - k] / smooth[:, 1 - k] * BLUR**2 / smooth[:, k] ** 3
            for axis in range(2):
                sign = 1.0 - 2.0 * k
                slopes[:, k, axis, 8] = (sign * apart[:, axis] / away / (4.0 * radius))[:, None]
                slopes[:, k, axis, 9] = by_aside * across[:, axis]
        return inputs, slopes

    def arrays(self) -> dict[str, NDArray[np.generic]]:
        """The arrays, by their names in a model file."""
        return {
            "together_chords_mm": self.chords_mm,
            "together_inner": self.inner,
            "together_inner_offset": self.inner_offset,
            "together_outer": self.outer,
            "together_numbers": np.array([self.radius_mm, *self.missed, self.threshold]),
            **{f"together_{name}": array for name, array in self.sigma.arrays().items()},
        }


_SWAPPED = np.array([4, 5, 6, 7, 0, 1, 2, 3, 8, 9, 10])
"""The inputs with both touches exchanged."""


def missed_by(missed: FloatArray, first: FloatArray, second: FloatArray) -> FloatArray:
    """Standard deviation (n, pair) of what a network misses; see the module [-]."""
    return np.asarray(np.sqrt(missed[0] ** 2 + missed[1] ** 2 * np.abs((1.0 - first) * (1.0 - second))))


def together_of_arrays(arrays: Arrays, pairs: int) -> Together | None:
    """Make it from its arrays in a model file; None if it has none.

    Raises
    ------
    InputError : arrays are missing or inconsistent.
    """
    if "together_numbers" not in arrays:
        return None
    inner = taken(arrays, "together_inner", (FEATURES, None))
    radius, *missed, threshold = taken(arrays, "together_numbers", (4,)).tolist()
    if radius <= 0.0 or min(missed) < 0.0:
        raise InputError("together_numbers: need a radius above 0, and errors of 0 or more")
    renamed = {
        name.removeprefix("together_"): array
        for name, array in arrays.items()
        if name.startswith("together_")
    }
    return Together(
        chords_mm=taken(arrays, "together_chords_mm", (pairs, 4)),
        radius_mm=radius,
        inner=inner,
        inner_offset=taken(arrays, "together_inner_offset", (inner.shape[1],)),
        outer=taken(arrays, "together_outer", (inner.shape[1],)),
        missed=np.array(missed),
        threshold=threshold,
        sigma=sigma_table_of_arrays(renamed),
    )
