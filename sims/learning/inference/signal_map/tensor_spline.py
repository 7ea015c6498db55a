"""Signals of many pairs over place and depth as one cubic spline, with gradients; numpy only.

Model
-----
On nodes at equal steps in (x, y, s), s = √depth, every pair's signal is a sum of products of uniform cubic B-splines,

    f(x, y, s) = Σ c[i + a, j + b, k + c] wₐ(x) w_b(y) w_c(s),   a, b, c = 0 ... 3  (de Boor 1978, chapter IX),

which passes through the values at the nodes. The root spreads the nodes as signals need them: the contact radius grows
like √depth, and mode 1 of a pair can be over within 0.3 mm. Its slope by s is zero at s = 0, so that the signal leaves
its untouched value in proportion to depth; the other ends have a third derivative that is continuous across the
neighbouring node ("not a knot"). Beyond its nodes the spline is not defined: places and depths are clamped to them.

Left out: kinks at the ends of shadows are rounded over a step.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from design.arrays import FloatArray, IntArray

CHUNK = 256
"""Points evaluated at once: 64 coefficients of every pair are gathered for each, 4 MB with 64 pairs."""
FEWEST_NODES = 5
"""Nodes along an axis: the condition at an end takes five coefficients."""
SMALLEST_ROOT = 1e-3
"""Smallest √depth in the slope by depth [√mm]: (df/ds) / 2s has a limit at 0, its parts do not."""


@dataclass(frozen=True, kw_only=True)
class TensorSpline:
    """A cubic spline of several signals over x, y and √depth.

    Attributes
    ----------
    coefficients : (nx + 2, ny + 2, ns + 2, pair) of the B-splines, in the unit of the signals
    start : (3,) first node of x [mm], y [mm] and s [√mm]
    step : (3,) distance of the nodes, likewise
    """

    coefficients: NDArray[np.float32]
    start: FloatArray
    step: FloatArray

    @property
    def nodes(self) -> tuple[int, int, int]:
        """Number of nodes of x, y and s."""
        nx, ny, ns = (count - 2 for count in self.coefficients.shape[:3])
        return nx, ny, ns

    @property
    def end(self) -> FloatArray:
        """(3,) last node of x [mm], y [mm] and s [√mm]."""
        return np.asarray(self.start + self.step * (np.array(self.nodes) - 1))

    @property
    def deepest_mm(self) -> float:
        """Depth of the last node [mm]."""
        return float(self.end[2] ** 2)

    def values(self, press_mm: FloatArray) -> FloatArray:
        """(n, pair) signals at (n, 3) places and depths [mm]."""
        return self._at(press_mm, with_slopes=False)[:, 0]

    def with_gradient(self, press_mm: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(n, pair) signals and (n, 3, pair) their slopes by x, y and depth [1/mm] at (n, 3) places and depths [mm].

        Beyond the nodes both are those of the nearest place on the border.
        """
        found = self._at(press_mm, with_slopes=True)
        return found[:, 0], found[:, 1:]

    def _at(self, press_mm: FloatArray, *, with_slopes: bool) -> FloatArray:
        parts = [
            self._of_few(press_mm[first : first + CHUNK], with_slopes)
            for first in range(0, max(len(press_mm), 1), CHUNK)
        ]
        return np.concatenate(parts)

    def _of_few(self, press_mm: FloatArray, with_slopes: bool) -> FloatArray:
        root = np.sqrt(np.maximum(press_mm[:, 2], 0.0))
        place = np.stack([press_mm[:, 0], press_mm[:, 1], root], axis=1)
        steps = np.clip((place - self.start) / self.step, 0.0, np.array(self.nodes) - 1.0)
        cell = np.minimum(steps.astype(np.int64), np.array(self.nodes) - 2)
        value, slope = _weights(steps - cell)
        rows = value[:, None]
        if with_slopes:
            slope /= self.step[:, None]
            slope[:, 2] /= 2.0 * np.maximum(root, SMALLEST_ROOT)[:, None]
            rows = np.repeat(rows, 4, axis=1)
            for axis in range(3):
                rows[:, 1 + axis, axis] = slope[:, axis]
        products = _products(rows.reshape(-1, 3, 4)).astype(np.float32)
        return np.asarray(products.reshape(*rows.shape[:2], 64) @ self._gathered(cell), dtype=np.float64)

    def _gathered(self, cell: IntArray) -> NDArray[np.float32]:
        """(n, 64, pair) coefficients around each cell."""
        across, along = self.coefficients.shape[1:3]
        corner = (cell[:, 0] * across + cell[:, 1]) * along + cell[:, 2]
        offsets = _offsets(across, along)
        flat = self.coefficients.reshape(-1, self.coefficients.shape[-1])
        return np.asarray(flat[corner[:, None] + offsets])


def fitted_spline(signals: FloatArray, start: FloatArray, step: FloatArray) -> TensorSpline:
    """The spline through signals at its nodes.

    Parameters
    ----------
    signals : (nx, ny, ns, pair), the first s is 0
    start : (3,) first node of x [mm], y [mm], s [√mm]
    step : (3,) distance of the nodes
    """
    coefficients = np.asarray(signals, dtype=np.float64)
    for axis in range(3):
        solve = _solver(coefficients.shape[axis], axis == 2)
        coefficients = np.moveaxis(np.tensordot(solve, coefficients, axes=(1, axis)), 0, axis)
    return TensorSpline(
        coefficients=np.ascontiguousarray(coefficients, dtype=np.float32),
        start=np.asarray(start, dtype=np.float64),
        step=np.asarray(step, dtype=np.float64),
    )


def _solver(count: int, is_flat_at_start: bool) -> FloatArray:
    """(count + 2, count) from values at nodes to coefficients."""
    if count < FEWEST_NODES:
        raise ValueError(f"{count} nodes along an axis, needs {FEWEST_NODES} or more")
    rows = np.zeros((count + 2, count + 2))
    for node in range(count):
        rows[node, node : node + 3] = 1 / 6, 4 / 6, 1 / 6
    rows[count, :5] = (-1.0, 0.0, 1.0, 0.0, 0.0) if is_flat_at_start else (1.0, -4.0, 6.0, -4.0, 1.0)
    rows[count + 1, -5:] = 1.0, -4.0, 6.0, -4.0, 1.0
    return np.asarray(np.linalg.inv(rows)[:, :count])


def _weights(t: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(n, 3, 4) values and slopes of the four B-splines that reach (n, 3) shares of a cell."""
    value, slope = np.empty((*t.shape, 4)), np.empty((*t.shape, 4))
    u, t2 = 1.0 - t, t * t
    u2 = u * u
    value[..., 0], value[..., 3] = u2 * u, t2 * t
    value[..., 1] = 3.0 * value[..., 3] - 6.0 * t2 + 4.0
    value[..., 2] = 3.0 * value[..., 0] - 6.0 * u2 + 4.0
    slope[..., 0], slope[..., 3] = -u2, t2
    slope[..., 1] = 3.0 * t2 - 4.0 * t
    slope[..., 2] = 4.0 * u - 3.0 * u2
    value /= 6.0
    slope /= 2.0
    return value, slope


def _products(weights: FloatArray) -> FloatArray:
    """(n, 64) products of (n, 3, 4) weights, the last axis fastest."""
    first, second, third = weights[:, 0], weights[:, 1], weights[:, 2]
    plane = (first[:, :, None] * second[:, None, :]).reshape(len(weights), 16)
    return np.asarray((plane[:, :, None] * third[:, None, :]).reshape(len(weights), 64))


@cache
def _offsets(across: int, along: int) -> IntArray:
    """(64,) distance in the flat table from a cell's first coefficient to each of its 64."""
    i, j, k = np.meshgrid(np.arange(4), np.arange(4), np.arange(4), indexing="ij")
    return ((i * across + j) * along + k).ravel()
