"""Convert a top given as heights on a grid to the arrays that the light kernels read, and divide the cells it bends.

Between nodes, the height is the bicubic Hermite patch of a cell; slopes at nodes are those of the C2 bicubic spline
through the heights. Height and slopes are continuous. The contact is where a level, linear between nodes, is above 0.

The contact has patches for scattered light (`deposits`): strips along x, divided along y, so that all have about the
same area.

Mirrored light is followed through one point per cell of the untouched top (`points`). Where the pressed top turns by
more than `TURN` within a cell, or the edge of the contact crosses a larger one, the cell is divided into four, up to
`DIVISIONS` times. A contact mirrors nothing, so its inside keeps its cells.
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import distance_transform_edt, maximum_filter

from optopad.design.arrays import BoolArray, FloatArray, IntArray
from optopad.design.errors import InputError, ModelScopeError
from optopad.sims.optics.engine.general.deposits import TIP_PATCHES, TIP_TURNS
from optopad.sims.optics.engine.general.points import TopGrid, quartered
from optopad.sims.optics.engine.general.top import (
    BLOCK,
    CUPS,
    DEPTH,
    FORMED_ROW,
    GRID_STEP,
    GRID_X,
    GRID_Y,
    LEVEL,
    LOWEST,
    LOWS,
    NODE,
    OUTER,
    PATCH,
    STEEPER,
    FormedTop,
)
from optopad.sims.optics.scene.optical_scene import OpticalScene, spline_nodes
from optopad.sims.optics.surface.curves import (
    CELLS,
    OFFSET,
    PIECE_COLUMNS,
    PIECES,
    SCALE,
    SKIRT_SLOPE,
    SPHERE_2,
    START,
    STEEP,
)
from optopad.sims.press import GridTop

TURN = 0.2
"""Largest change of the top's slope within a cell that is not divided [-]."""
DIVISIONS = 3
EVEN = 1e-6
"""Largest relative difference between the distances of nodes that count as equal [-]."""
LEAST_LEFT = 0.02
"""Least thickness of the clear layer that a press leaves, over its thickness [-]."""


def check_grid(scene: OpticalScene, state: int, press: GridTop) -> None:
    """Refuse a grid that cannot be the top of a pad.

    Raises
    ------
    InputError : shapes do not fit, a value is not finite, or the nodes are not equally spaced.
    ModelScopeError : the press goes through the clear layer.
    """
    shape = (len(press.x_mm), len(press.y_mm))
    if min(shape) < 4 or np.shape(press.height_mm) != shape or np.shape(press.level) != shape:
        raise InputError(
            f"state {state}: heights {np.shape(press.height_mm)} and level {np.shape(press.level)} on {shape} nodes; "
            "give one of each per node, on 4 x 4 nodes or more"
        )
    if not (np.isfinite(press.height_mm).all() and np.isfinite(press.level).all()):
        raise InputError(f"state {state}: a height or level is not finite; solve the press again")
    steps = np.concatenate([np.diff(press.x_mm), np.diff(press.y_mm)])
    if not (steps.min() > 0.0 and np.ptp(steps) <= EVEN * steps.max()):
        raise InputError(
            f"state {state}: nodes are {steps.min():g} to {steps.max():g} mm apart; space them equally"
        )
    if -press.height_mm.min() > (1.0 - LEAST_LEFT) * scene.height_mm:
        raise ModelScopeError(
            f"state {state}: the press is {-press.height_mm.min():.3g} mm deep in a clear layer of "
            f"{scene.height_mm:g} mm; press less"
        )


def gridded(untouched: FormedTop, press: GridTop) -> FormedTop:
    """A top under objects, from the untouched top in the same press coordinates."""
    x, y, height = press.x_mm, press.y_mm, press.height_mm
    step = float(x[1] - x[0])
    grid = np.zeros((*height.shape, NODE))
    grid[..., :LEVEL] = spline_nodes(x - x[0], y - y[0], height, 1)
    slope = np.hypot(grid[..., 1], grid[..., 2])
    touches = press.level > 0.0
    grid[..., LEVEL] = press.level
    grid[..., STEEPER] = maximum_filter((slope > SKIRT_SLOPE) | touches, 3)
    grid[..., PATCH] = _patches(touches, np.hypot(1.0, slope))
    low = np.minimum(height, 0.0) - _overshoot(height)
    lows = _block_lows(low)
    grid[: lows.shape[0], : lows.shape[1], LOWEST] = lows
    numbers = untouched.numbers.copy()
    radius = np.hypot(x[:, None], y[None, :])
    bent = maximum_filter((np.abs(height) > 1e-7) | (slope > 1e-7), 3)
    outer = float(radius[bent].max(initial=0.0)) + step
    numbers[[DEPTH, OUTER, GRID_X, GRID_Y, GRID_STEP]] = -low.min(), outer, x[0], y[0], step
    return untouched._replace(
        numbers=numbers, row=_bounds_outward(radius, low, slope, outer, step), grid=grid
    )


def patch_areas(top: FormedTop) -> FloatArray:
    """(`TIP_PATCHES`,) area of the contact's patches on a grid [mm²]; 0 for a patch without a node."""
    grid = top.grid
    touches = grid[..., LEVEL] > 0.0
    element = top.numbers[GRID_STEP] ** 2 * np.sqrt(1.0 + grid[..., 1] ** 2 + grid[..., 2] ** 2)
    number = grid[..., PATCH][touches].astype(np.int64)
    return np.asarray(np.bincount(number, element[touches], TIP_PATCHES), dtype=np.float64)


def _patches(touches: BoolArray, element: FloatArray) -> FloatArray:
    """(nx, ny) number of the contact's patch at each node: that of the nearest node that an object touches."""
    number = np.zeros(touches.shape)
    at = np.argwhere(touches)
    if len(at) == 0:
        return number
    area = element[touches]
    strip = _even_parts(at[:, 0] + 1e-6 * at[:, 1], area, TIP_PATCHES // TIP_TURNS)
    for one in range(TIP_PATCHES // TIP_TURNS):
        own = np.flatnonzero(strip == one)
        if len(own):
            part = _even_parts(at[own, 1] + 1e-6 * at[own, 0], area[own], TIP_TURNS)
            number[tuple(at[own].T)] = one * TIP_TURNS + part
    nearest = distance_transform_edt(~touches, return_distances=False, return_indices=True)
    return np.asarray(number[tuple(nearest)])


def _even_parts(place: FloatArray, area: FloatArray, parts: int) -> IntArray:
    """(n,) number of the part of each element, when all are divided in the order of `place` into equal areas."""
    order = np.argsort(place, kind="stable")
    before = np.cumsum(area[order]) - 0.5 * area[order]
    number = np.empty(len(area), dtype=np.int64)
    number[order] = np.minimum((before / area.sum() * parts).astype(np.int64), parts - 1)
    return number


def _overshoot(height: FloatArray) -> float:
    """How far a bicubic patch may go below its lowest node, at most about [mm]."""
    bends = [np.abs(np.diff(height, 2, axis=axis)).max(initial=0.0) for axis in (0, 1)]
    return 0.25 * float(max(bends)) + 1e-9


def _block_lows(low: FloatArray) -> FloatArray:
    """Lowest height of each block of `BLOCK` x `BLOCK` cells, its outer nodes included [mm]."""
    cells = low
    for axis in (0, 1):
        count = cells.shape[axis] - 1
        starts = range(0, count, BLOCK)
        parts = [cells.take(range(k, min(k + BLOCK, count) + 1), axis).min(axis=axis) for k in starts]
        cells = np.stack(parts, axis=axis)
    return cells


def _bounds_outward(
    radius: FloatArray, low: FloatArray, slope: FloatArray, outer: float, step: float
) -> FloatArray:
    """(`FORMED_ROW`,) row with the lowest height and the largest slope from each of `CELLS` radii outward."""
    row = np.zeros(FORMED_ROW)
    row[[SPHERE_2, OFFSET, START]], row[SCALE] = (-1.0, 0.0, 0.0), (CELLS / outer) ** 2
    ring = np.clip(((radius + 2.0 * step) / outer * CELLS).astype(np.int64), 0, CELLS - 1).ravel()
    lowest, steepest = np.zeros(CELLS), np.zeros(CELLS)
    np.minimum.at(lowest, ring, low.ravel())
    np.maximum.at(steepest, ring, 1.1 * slope.ravel())
    row[LOWS:CUPS] = np.minimum.accumulate(lowest[::-1])[::-1]
    row[PIECES + STEEP + PIECE_COLUMNS * np.arange(CELLS)] = np.maximum.accumulate(steepest[::-1])[::-1]
    return row


def divided(cells: TopGrid, top: FormedTop) -> tuple[BoolArray, TopGrid]:
    """(n,) mask of the cells that the pressed top bends too much, and the smaller cells that replace them.

    cells : cells of the untouched top, in plan
    """
    turning = _turning(top)
    step = float(top.numbers[GRID_STEP])
    first = np.array([top.numbers[GRID_X], top.numbers[GRID_Y]])

    def is_large(corner: FloatArray, size: FloatArray, level: int) -> BoolArray:
        place = np.column_stack([corner + 0.5 * size[:, None], np.full(len(size), top.origin[2])])
        at = np.round(((place - top.origin) @ top.axes[:2].T - first) / step).astype(np.int64)
        inside = ((at >= 0) & (at < turning.shape)).all(axis=1)
        i, j = np.where(inside[:, None], at, 0).T
        window = 2 * int(np.ceil(0.5 * float(np.max(size, initial=0.0)) / step)) + 1
        return np.asarray(
            inside & (maximum_filter(turning, window)[i, j] * size > TURN) & (level < DIVISIONS)
        )

    is_divided = is_large(cells.corner, cells.size, 0)
    index = np.round(cells.corner / cells.size[:, None]).astype(np.int64)[is_divided]
    size, kept = cells.size[is_divided], []
    for level in range(1, DIVISIONS + 1):
        index, size = quartered(index), np.repeat(size / 2.0, 4)
        again = is_large(index * size[:, None], size, level)
        kept.append((index[~again], size[~again]))
        index, size = index[again], size[again]
    index, size = np.concatenate([one for one, _ in kept]), np.concatenate([one for _, one in kept])
    batch = (index[:, 0] % 2 + 2 * (index[:, 1] % 2)).astype(np.float64)
    return is_divided, TopGrid(
        pitch_mm=cells.pitch_mm,
        corner=index * size[:, None],
        size=size,
        batch=batch,
        divided=cells.divided,
        chains_every=cells.chains_every,
    )


def _turning(top: FormedTop) -> FloatArray:
    """(nx, ny) how much the top's slope changes per length [1/mm]; 0 inside a contact, very large at its edge."""
    grid, step = top.grid, float(top.numbers[GRID_STEP])
    bends = [np.gradient(grid[..., k], step, axis=axis) for k in (1, 2) for axis in (0, 1)]
    turning = np.sqrt(sum(bend**2 for bend in bends))
    touches = grid[..., LEVEL] > 0.0
    near, far = maximum_filter(touches, 3), maximum_filter(~touches, 3)
    return np.where(near & far, 1e3, np.where(touches, 0.0, turning))
