"""Lower presses to the tops that kernels see: several tips and a smooth field in one state.

Model
-----
The top's height over the undisturbed plane is the sum of every tip's radial curve (`sims.optics.surface`) and of a
smooth field (`sims.optics.smooth_field`). Superposition is exact where at most one curve differs from zero; it leaves
out how one tip's dimple deforms under another, and is refused where the steep parts overlap.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from design.errors import InputError, ModelScopeError
from sims.indentation import Indentation
from sims.optics.scene import OpticalScene
from sims.optics.smooth_field import SmoothField
from sims.optics.surface import ACTIVE, SKIRT_R, SPHERE_R, TOP, SurfaceStack, X, Y, stack_surfaces
from sims.optics.top import FIELD_LOWEST, FIELD_SLOPE, GRID_COLUMNS, SLACK

FloatArray = NDArray[np.float64]
Presses = Sequence[Indentation | Sequence[Indentation | None] | None]
SUBDIVISION = 4
SLOPE_RESERVE = 1.1


@dataclass(frozen=True, kw_only=True)
class TopStack:
    """Tops of all states, as kernels read them.

    Attributes
    ----------
    press, cubic, steepest : (state, tip, ...) rows of `sims.optics.surface.SurfaceStack`
    field : (state, nx, ny, 4) nodes of the fields; (state, 0, 0, 4) where no state has one
    grid : (state, 8) see `sims.optics.top`
    """

    press: FloatArray
    cubic: FloatArray
    steepest: FloatArray
    field: FloatArray
    grid: FloatArray

    def part(
        self, states: NDArray[np.int64]
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
        """Arrays of some states in the order of `sims.optics.top.Top`."""
        return (
            self.press[states],
            self.cubic[states],
            self.steepest[states],
            self.field[states],
            self.grid[states],
        )


def stack_tops(
    indentations: Presses,
    centres_mm: FloatArray,
    scene: OpticalScene,
    fields: Sequence[SmoothField | None] | None = None,
) -> TopStack:
    """Lower one press, or one for each tip, and perhaps a field per state.

    Parameters
    ----------
    indentations : per state an indentation, None (untouched), or a sequence of these, one for each tip
    centres_mm : (state, 2) or (state, tip, 2) x and y of the press axes [mm]
    fields : one per state, on one grid

    Raises
    ------
    InputError : shapes that do not fit together; a press outside the block; a bad curve or field.
    ModelScopeError : tips whose steep parts overlap, several tips that scatter light, a press out of scope.
    """
    nested = [_as_tips(one) for one in indentations]
    states = len(nested)
    tips = max((len(one) for one in nested), default=1)
    centres = _centres(centres_mm, states, tips)
    columns = [
        stack_surfaces([one[k] if k < len(one) else None for one in nested], centres[:, k], scene)
        for k in range(tips)
    ]
    press, cubic, steepest = (
        np.stack([getattr(column, name) for column in columns], axis=1)
        for name in ("press", "cubic", "steepest")
    )
    if tips > 1:
        press, cubic, steepest = _touched_first(press, cubic, steepest)
        _check_apart(press, scene)
    field, grid = _stacked_fields(fields, states)
    untouched = (press[:, :, ACTIVE] == 0.0).all(axis=1)
    press[untouched, 0, X], press[untouched, 0, Y] = scene.length_mm / 2, scene.width_mm / 2
    grid[:, SLACK] += _neighbours_depth_mm(press, columns, cubic)
    return TopStack(press=press, cubic=cubic, steepest=steepest, field=field, grid=grid)


def _as_tips(one: Indentation | Sequence[Indentation | None] | None) -> list[Indentation | None]:
    return [one] if one is None or isinstance(one, Indentation) else list(one) or [None]


def _centres(centres_mm: FloatArray, states: int, tips: int) -> FloatArray:
    centres = np.asarray(centres_mm, dtype=np.float64)
    if centres.shape == (states, 2):
        centres = centres[:, None]
    if centres.ndim != 3 or centres.shape[0] != states or centres.shape[1] < tips or centres.shape[2] != 2:
        raise InputError(
            f"centres_mm: shape {np.shape(centres_mm)}, needs ({states}, 2) or ({states}, {tips}, 2)"
        )
    return centres


def _touched_first(
    press: FloatArray, cubic: FloatArray, steepest: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """The same with each state's touching tips before its absent ones."""
    order = np.argsort(press[:, :, ACTIVE] == 0.0, axis=1, kind="stable")
    rows = np.arange(len(press))[:, None]
    return press[rows, order], cubic[rows, order], steepest[rows, order]


def _check_apart(press: FloatArray, scene: OpticalScene) -> None:
    for state, tips in enumerate(press):
        touching = tips[tips[:, ACTIVE] > 0.0]
        if len(touching) > 1 and scene.tip_reflectance > 0.0:
            raise ModelScopeError(
                f"surfaces.tip_reflectance: {scene.tip_reflectance:g} with {len(touching)} tips in state {state}: "
                "light that tips scatter is modelled for one tip only; set it to 0"
            )
        for k, one in enumerate(touching):
            for other in touching[k + 1 :]:
                apart = float(np.hypot(one[X] - other[X], one[Y] - other[Y]))
                need = float(one[SKIRT_R] + other[SKIRT_R])
                if apart <= need:
                    raise ModelScopeError(
                        f"presses: state {state} has tips {apart:.2f} mm apart whose dimples need {need:.2f} mm; "
                        "superposition does not hold there, move them apart or press less"
                    )


def _neighbours_depth_mm(press: FloatArray, columns: list[SurfaceStack], cubic: FloatArray) -> FloatArray:
    """(state,) how far tips may lower the top on the side of another tip, summed."""
    depth = np.zeros(len(press))
    if len(columns) == 1:
        return depth
    for state, tips in enumerate(press):
        count = int((tips[:, ACTIVE] > 0.0).sum())
        for k in range(count):
            near = min(
                (np.hypot(*(tips[k, [X, Y]] - tips[m, [X, Y]])) / 2 for m in range(count) if m != k),
                default=np.inf,
            )
            depth[state] += _fall_beyond_mm(tips[k], cubic[state, k], float(near))
    return depth


def _fall_beyond_mm(press: FloatArray, cubic: FloatArray, radius_mm: float) -> float:
    """How far below the undisturbed top a curve lies at most beyond a radius [mm]."""
    from sims.optics.surface import CELLS, GRADING, OUTER_R

    x = np.arange(CELLS + 1) / CELLS
    edges = press[SPHERE_R] + (press[OUTER_R] - press[SPHERE_R]) * x * (GRADING + (1 - GRADING) * x)
    outside = edges[1:] > radius_mm
    lowest = np.minimum(cubic[:, 0], cubic.sum(axis=1))[outside]
    return max(float(press[TOP] - lowest.min()), 0.0) if lowest.size else 0.0


def _stacked_fields(
    fields: Sequence[SmoothField | None] | None, states: int
) -> tuple[FloatArray, FloatArray]:
    grid = np.zeros((states, GRID_COLUMNS))
    if fields is None or all(field is None for field in fields):
        return np.zeros((states, 0, 0, 4)), grid
    if len(fields) != states:
        raise InputError(f"fields: {len(fields)} for {states} states; give one, or None, per state")
    shapes = {field.nodes.shape for field in fields if field is not None}
    if len(shapes) != 1:
        raise InputError(f"fields: grids of {sorted(shapes)} nodes; give all states the same grid")
    nodes = np.zeros((states, *shapes.pop()))
    for state, field in enumerate(fields):
        if field is not None:
            nodes[state] = field.nodes
            grid[state] = _grid_row(field)
    return nodes, grid


def _grid_row(field: SmoothField) -> FloatArray:
    """Origin, steps and bounds of a field; bounds from `SUBDIVISION` points a cell along each side."""
    value, slope_x, slope_y = _sampled(field)
    row = np.zeros(GRID_COLUMNS)
    row[:5] = 1.0, *field.origin_mm, *field.step_mm
    row[FIELD_LOWEST] = min(SLOPE_RESERVE * float(value.min()), 0.0)
    row[FIELD_SLOPE] = SLOPE_RESERVE * float(np.hypot(slope_x, slope_y).max())
    row[SLACK] = -row[FIELD_LOWEST]
    return row


def _sampled(field: SmoothField) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Value and both slopes at `SUBDIVISION` + 1 points a cell along each side."""
    t = np.linspace(0.0, 1.0, SUBDIVISION + 1)
    (along, along_slope), (across, across_slope) = (_weights(t, step) for step in field.step_mm)
    n = field.nodes
    corners = np.stack(
        [np.stack([n[a : len(n) - 1 + a, b : n.shape[1] - 1 + b] for b in (0, 1)]) for a in (0, 1)]
    )
    # node columns: value, d/dx, d/dy, mixed -> (x kind, y kind)
    kinds = corners.reshape(*corners.shape[:4], 2, 2).swapaxes(4, 5)
    pattern = "abijkl,pak,qbl->ijpq"
    return (
        np.einsum(pattern, kinds, along, across, optimize=True),
        np.einsum(pattern, kinds, along_slope, across, optimize=True),
        np.einsum(pattern, kinds, along, across_slope, optimize=True),
    )


def _weights(t: FloatArray, step: float) -> tuple[FloatArray, FloatArray]:
    """(point, end, kind) Hermite weights of value and slope at both ends, and their derivatives."""
    s = 1.0 - t
    value = np.stack(
        [
            np.stack([(1 + 2 * t) * s * s, step * t * s * s], -1),
            np.stack([(1 + 2 * s) * t * t, -step * s * t * t], -1),
        ],
        1,
    )
    slope = np.stack(
        [
            np.stack([-6 * t * s / step, s * (1 - 3 * t)], -1),
            np.stack([6 * t * s / step, t * (3 * t - 2)], -1),
        ],
        1,
    )
    return value, slope
