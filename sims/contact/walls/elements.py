"""Quadratic finite elements along one axis: the one-dimensional integrals that layers on product grids are made of.

On a grid that is a product of axes every integral of products of shape functions is a Kronecker product of these.
Displacements take the quadratic shape functions (a node at the ends and in the middle of every element), pressures the
linear ones: together the Taylor-Hood element, stable for incompressible solids (Elman, Silvester and Wathen, Finite
Elements and Fast Iterative Solvers, 2014, section 3.3).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

import numpy as np
from scipy.sparse import csr_matrix, kron

from design.arrays import FloatArray, IntArray

Weight = Callable[[FloatArray], FloatArray]
Shape = Literal["value", "slope", "pressure"]
POINTS, WEIGHTS = np.polynomial.legendre.leggauss(5)


class QuadraticAxis:
    """Elements between ticks.

    Attributes
    ----------
    ticks : (n + 1,) increasing ends of the elements
    nodes : (2 n + 1,) ticks and middles
    """

    def __init__(self, ticks: FloatArray) -> None:
        self.ticks = np.asarray(ticks, dtype=np.float64)
        count, t = len(self.ticks) - 1, POINTS
        self.nodes = np.interp(np.arange(2 * count + 1) / 2.0, np.arange(count + 1), self.ticks)
        half = 0.5 * np.diff(self.ticks)[:, None]
        self._points = self.ticks[:-1, None] + half * (1.0 + t)
        self._weights = half * WEIGHTS
        values = np.stack([0.5 * t * (t - 1.0), 1.0 - t * t, 0.5 * t * (t + 1.0)])
        slopes = np.stack([t - 0.5, -2.0 * t, t + 0.5])
        hats = np.stack([0.5 * (1.0 - t), 0.5 * (1.0 + t)])
        each = np.ones((count, 1))
        self._shapes: dict[Shape, FloatArray] = {
            "value": values[None] * each[:, None],
            "slope": slopes[None] / half[:, None],
            "pressure": hats[None] * each[:, None],
        }

    def _places(self, shape: Shape) -> IntArray:
        """(element, shape) numbers of an element's nodes."""
        step, count = (1, 2) if shape == "pressure" else (2, 3)
        return step * np.arange(len(self.ticks) - 1)[:, None] + np.arange(count)

    def matrix(self, left: Shape, right: Shape, weight: Weight | None = None) -> csr_matrix:
        """(left, right) integrals of products of shape functions or their slopes, times a weight of the place."""
        weights = self._weights if weight is None else self._weights * weight(self._points)
        found = np.einsum("ngk,nhk,nk->ngh", self._shapes[left], self._shapes[right], weights)
        rows, columns = self._places(left), self._places(right)
        each = np.broadcast_arrays(rows[:, :, None], columns[:, None, :])
        size = rows.max() + 1, columns.max() + 1
        return csr_matrix((found.ravel(), (each[0].ravel(), each[1].ravel())), shape=size)

    def load(self, density: Weight) -> FloatArray:
        """(node,) integrals of the quadratic shape functions times a density of the place."""
        found = np.einsum("ngk,nk->ng", self._shapes["value"], self._weights * density(self._points))
        out = np.zeros(len(self.nodes))
        np.add.at(out, self._places("value"), found)
        return out


def product(*factors: csr_matrix) -> csr_matrix:
    """Kronecker product, the last axis fastest."""
    out = factors[0]
    for factor in factors[1:]:
        out = kron(out, factor, format="csr")
    return out


def graded_ticks(length: float, first: float, growth: float, largest: float) -> FloatArray:
    """(n + 1,) ticks from 0 to a length, their steps growing from about the first to the largest."""
    steps = [first]
    while sum(steps) < length - 1e-9:
        steps.append(min(steps[-1] * growth, largest))
    ticks = np.append(0.0, np.cumsum(steps))
    return np.asarray(ticks * (length / ticks[-1]), dtype=np.float64)
