"""Errors of the light model that readings share: one of its numbers, several readings.

Model
-----
Places that a symmetry of the pad makes one are traced once, and a pair whose light misses the dimple keeps its
untouched light: on a grid of presses several readings stand against one number of the light model, and its error is
theirs together. A parameter is the same for all parts of a kind, so its slopes are symmetric as the errors are, and
these add up instead of averaging out: taken for independent they make a deviation too small by up to the root of how
many share one. So

    residual rᵢ = own noise + cᵢ ε_g,   ε_g standard normal, one a group g,   cᵢ in own standard deviations

with the covariance 1 + c cᵀ in every group, groups being disjoint. Its inverse root is in closed form (Sherman and
Morrison 1950),

    (1 + c cᵀ)^-½ = 1 - f c cᵀ,   f = (1 - (1 + |c|²)^-½) / |c|²

which takes residuals and slopes to independent ones of spread 1. Left out: errors of neighbouring depths and places,
which are alike too, but not equal.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from design.arrays import FloatArray, IntArray

DIGITS = 11
"""Light that agrees to so many digits of the brightest is one number of the model, renumbered by a symmetry."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SharedError:
    """Readings sorted by what number of the light model they stand against.

    Attributes
    ----------
    order : (reading,) readings group by group
    starts : (group,) where each group begins in that order
    group : (reading,) group of each reading
    """

    order: IntArray
    starts: IntArray
    group: IntArray

    def sums(self, values: FloatArray) -> FloatArray:
        """(group, ...) sums over the readings (reading, ...) of each group."""
        return np.asarray(np.add.reduceat(values[self.order], self.starts, axis=0))

    def whitened(self, values: FloatArray, shared: FloatArray) -> FloatArray:
        """(reading, column) values in own standard deviations, made independent.

        Parameters
        ----------
        values : (reading, column); shared : (reading,) spread of the shared error in own standard deviations
        """
        square = self.sums(shared**2)
        factor = np.where(square > 0.0, (1.0 - (1.0 + square) ** -0.5) / np.maximum(square, 1e-300), 0.0)
        along = factor[:, None] * self.sums(shared[:, None] * values)
        return np.asarray(values - shared[:, None] * along[self.group])


def shared_error(light: FloatArray) -> SharedError:
    """Groups of readings by equal light (sample, pair), which is flattened."""
    _, group = np.unique(np.round(light.ravel() / np.abs(light).max(), DIGITS), return_inverse=True)
    group = group.reshape(-1)
    order = np.argsort(group, kind="stable")
    starts = np.flatnonzero(np.diff(group[order], prepend=-1))
    return SharedError(order=order, starts=starts, group=group)
