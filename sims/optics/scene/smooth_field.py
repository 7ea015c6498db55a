"""A smooth height field over the pad's top, for what a press of revolution cannot describe.

Between nodes the field is the bicubic Hermite patch of value, both slopes and the mixed derivative at
the four corners of a cell, so it and its slope are continuous everywhere inside; outside it is 0. Whoever makes a
field sees to it that it and its slope vanish at the border, or that the border lies on or beyond the walls.
The nodes' derivatives come from the C2 bicubic spline through the heights (not-a-knot ends). Where heights are sampled
at the nodes alone, the Hermite patches reproduce it exactly; where they are sampled more closely, its derivatives are
nearly those of the height itself, and few nodes hold a steep one.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from design.arrays import FloatArray, IntArray
from design.errors import InputError

MIN_CELLS = 4
"""A bicubic spline needs four points a side; one cell more keeps its ends apart."""
MAX_NODES = 1_000_000


@dataclass(frozen=True, kw_only=True, eq=False)
class SmoothField:
    """A height added to the top, on a regular grid.

    Attributes
    ----------
    origin_mm : (2,) x and y of the first node in the cavity frame [mm]
    step_mm : (2,) distance of nodes along x and y [mm]
    nodes : (nx, ny, 4) value [mm], slope along x [-], slope along y [-], mixed derivative [1/mm] at
        x_i = x_0 + i dx, y_j = y_0 + j dy

    Raises
    ------
    InputError : a wrong shape, a step that is not above 0, or a value that is not finite.
    """

    origin_mm: FloatArray
    step_mm: FloatArray
    nodes: FloatArray

    def __post_init__(self) -> None:
        """Refuse what no kernel can read."""
        for name in ("origin_mm", "step_mm"):
            values = np.asarray(getattr(self, name))
            if values.shape != (2,) or not np.isfinite(values).all():
                raise InputError(f"{name}: {values}, needs two finite numbers, of x and y")
        if not (np.asarray(self.step_mm) > 0).all():
            raise InputError(f"step_mm: {self.step_mm}, must be above 0 mm along x and y")
        shape = np.shape(self.nodes)
        if len(shape) != 3 or shape[2] != 4 or min(shape[:2]) < 2:
            raise InputError(f"nodes: shape {shape}, needs (2 or more, 2 or more, 4)")
        if not np.isfinite(self.nodes).all():
            i, j, k = np.argwhere(~np.isfinite(self.nodes))[0]
            raise InputError(f"nodes[{i}, {j}, {k}]: {self.nodes[i, j, k]}, must be finite")

    def height_mm(self, x_mm: FloatArray, y_mm: FloatArray) -> FloatArray:
        """(...,) height [mm] at (...,) places in the cavity frame [mm]: the readable form of the kernels' patch."""
        u, i = _cell(np.asarray(x_mm, dtype=np.float64), self.origin_mm[0], self.step_mm[0], len(self.nodes))
        v, j = _cell(
            np.asarray(y_mm, dtype=np.float64), self.origin_mm[1], self.step_mm[1], self.nodes.shape[1]
        )
        inside = (u >= 0) & (u <= 1) & (v >= 0) & (v <= 1)
        along, across = _hermite(u, self.step_mm[0]), _hermite(v, self.step_mm[1])
        total = np.zeros(np.broadcast(u, v).shape)
        for a in range(2):
            for b in range(2):
                node = self.nodes[i + a, j + b]
                total += node[..., 0] * along[a][0] * across[b][0] + node[..., 1] * along[a][1] * across[b][0]
                total += node[..., 2] * along[a][0] * across[b][1] + node[..., 3] * along[a][1] * across[b][1]
        return np.where(inside, total, 0.0)


def smooth_field(
    height_mm: Callable[[FloatArray, FloatArray], FloatArray],
    length_mm: float,
    width_mm: float,
    spacing_mm: float,
    finer: int = 1,
) -> SmoothField:
    """Sample a height over the whole pad, from wall to wall.

    Parameters
    ----------
    height_mm : (nx, 1) x and (1, ny) y in the cavity frame [mm] to (nx, ny) height [mm]
    length_mm, width_mm : of the cavity [mm]
    spacing_mm : of the nodes at most; the grid is stretched to end at the walls [mm]
    finer : the height is sampled so many times between neighbouring nodes, for the nodes' derivatives

    Raises
    ------
    InputError : a size or spacing that is not above 0, too many nodes, or heights that are not finite.
    """
    for name, value in (("length_mm", length_mm), ("width_mm", width_mm), ("spacing_mm", spacing_mm)):
        if not 0 < value < np.inf:
            raise InputError(f"{name}: {value:g} mm, must be above 0")
    counts = [max(MIN_CELLS, int(np.ceil(size / spacing_mm - 1e-9))) + 1 for size in (length_mm, width_mm)]
    if counts[0] * counts[1] > MAX_NODES:
        raise InputError(
            f"spacing_mm: {spacing_mm:g} mm makes {counts[0]} x {counts[1]} nodes, at most {MAX_NODES}; widen it"
        )
    x, y = (
        np.linspace(0.0, size, (count - 1) * finer + 1)
        for size, count in zip((length_mm, width_mm), counts, strict=True)
    )
    values = np.asarray(height_mm(x[:, None], y[None, :]), dtype=np.float64)
    if values.shape != (len(x), len(y)):
        raise InputError(
            f"height_mm: gave shape {values.shape} for {len(x)} x {len(y)} places; give one height each"
        )
    step = np.array([x[finer], y[finer]])
    return SmoothField(origin_mm=np.zeros(2), step_mm=step, nodes=_spline_nodes(x, y, values, finer))


def sum_of_fields(fields: Sequence[SmoothField]) -> SmoothField:
    """The sum of one or more fields on the same grid; of one, that field itself.

    Raises
    ------
    InputError : no field, or grids that differ.
    """
    grids = {(*field.origin_mm, *field.step_mm, *field.nodes.shape) for field in fields}
    if len(grids) != 1:
        raise InputError(
            f"fields: {len(fields)} on {len(grids)} different grids; give one or more on one grid"
        )
    if len(fields) == 1:
        return fields[0]
    nodes = np.sum([field.nodes for field in fields], axis=0)
    return SmoothField(origin_mm=fields[0].origin_mm, step_mm=fields[0].step_mm, nodes=nodes)


def _spline_nodes(x: FloatArray, y: FloatArray, heights: FloatArray, finer: int) -> FloatArray:
    if not np.isfinite(heights).all():
        i, j = np.argwhere(~np.isfinite(heights))[0]
        raise InputError(f"height_mm: {heights[i, j]} at ({x[i]:g}, {y[j]:g}) mm, must be finite everywhere")
    (rise_x, rise_y), kept = (
        (_spline_slopes(len(t), float(t[-1]), finer) for t in (x, y)),
        slice(None, None, finer),
    )
    along = rise_x @ heights
    columns = (heights[kept, kept], along[:, kept], heights[kept] @ rise_y.T, along @ rise_y.T)
    return np.stack(columns, axis=-1)


@lru_cache(maxsize=8)
def _spline_slopes(count: int, size: float, finer: int) -> FloatArray:
    """(node, count) slopes at every `finer`-th of evenly spread points, of the spline through values at all of them."""
    from scipy.interpolate import CubicSpline

    t = np.linspace(0.0, size, count)
    return np.asarray(CubicSpline(t, np.eye(count))(t[::finer], 1))


def _cell(place: FloatArray, origin: float, step: float, count: int) -> tuple[FloatArray, IntArray]:
    """Fraction within, and number of, the cell of a place; the fraction leaves 0 to 1 outside the grid."""
    t = (place - origin) / step
    cell = np.clip(np.floor(t), 0, count - 2).astype(np.int64)
    return t - cell, cell


def _hermite(
    t: FloatArray, step: float
) -> tuple[tuple[FloatArray, FloatArray], tuple[FloatArray, FloatArray]]:
    """For the cell's first and second end: weights of its value and of its slope."""
    s = 1.0 - t
    return ((1 + 2 * t) * s * s, step * t * s * s), ((1 + 2 * s) * t * t, -step * s * t * t)
