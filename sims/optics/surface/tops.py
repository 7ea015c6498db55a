"""Lower presses to the tops that kernels see: several tips and a smooth field in one state.

Model
-----
The top's height over the undisturbed plane is the sum of every tip's radial curve (`sims.optics.surface.curves`) and
of a smooth field (`sims.optics.scene.smooth_field`). Superposition is exact where at most one curve differs from
zero; it leaves out how one tip's dimple deforms under another, and is refused where the steep parts overlap.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from weakref import WeakKeyDictionary

import numpy as np

from design.arrays import FloatArray, IntArray
from design.errors import InputError, ModelScopeError
from sims.optics.scene.optical_scene import OpticalScene
from sims.optics.scene.smooth_field import SmoothField
from sims.optics.surface.curves import (
    ACTIVE,
    FIELD_COLUMNS,
    OUTER_R,
    PIECES,
    SKIRT_R,
    SPHERE_R,
    TOP,
    SurfaceStack,
    X,
    Y,
    stack_surfaces,
)
from sims.optics.surface.radial_table import CELLS, PIECE_COLUMNS, lowest_of_pieces_mm, node_radii_mm
from sims.optics.surface.top import FIELD_BEND, FIELD_LOWEST, FIELD_ON, FIELD_SLOPE, SLACK
from sims.press.indentation import Indentation

Presses = Sequence[Indentation | Sequence[Indentation | None] | None]
SUBDIVISION = 2
SLOPE_RESERVE, BEND_RESERVE = 1.1, 1.2
_KNOWN: WeakKeyDictionary[SmoothField, FloatArray] = WeakKeyDictionary()
"""Bounds of fields that somebody holds."""


@dataclass(frozen=True, kw_only=True)
class TopStack:
    """Tops of all states, as kernels read them.

    Attributes
    ----------
    rows : (state, tip, n) see `sims.optics.surface.curves`
    field : (state, nx, ny, 4) nodes of the fields; (state, 0, 0, 4) where no state has one
    step_mm : (2,) distance of the nodes along x and y [mm]
    """

    rows: FloatArray
    field: FloatArray
    step_mm: FloatArray

    def part(self, states: IntArray) -> tuple[FloatArray, FloatArray]:
        """Arrays of some states in the order of `sims.optics.surface.top.Top`."""
        return self.rows[states], _cells(self.field[states], self.step_mm)


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
    rows = np.stack([_packed(column) for column in columns], axis=1)
    if tips > 1:
        rows = _touched_first(rows)
        _check_apart(rows, scene)
    untouched = (rows[:, :, ACTIVE] == 0.0).all(axis=1)
    rows[untouched, 0, X], rows[untouched, 0, Y] = scene.length_mm / 2, scene.width_mm / 2
    field, known, step = _stacked_fields(fields, states)
    rows[:, 0, FIELD_ON : FIELD_ON + FIELD_COLUMNS] = known
    rows[:, 0, SLACK] += _neighbours_depth_mm(rows)
    return TopStack(rows=rows, field=field, step_mm=step)


def _packed(column: SurfaceStack) -> FloatArray:
    """(state, n) rows of one tip; what is known of the field comes later."""
    states = len(column.press)
    return np.concatenate(
        [
            column.press,
            np.zeros((states, FIELD_COLUMNS)),
            column.reach2,
            column.pieces.reshape(states, -1),
        ],
        axis=1,
    )


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


def _touched_first(rows: FloatArray) -> FloatArray:
    """The same with each state's touching tips before its absent ones."""
    order = np.argsort(rows[:, :, ACTIVE] == 0.0, axis=1, kind="stable")
    return np.asarray(rows[np.arange(len(rows))[:, None], order])


def _check_apart(rows: FloatArray, scene: OpticalScene) -> None:
    for state, tips in enumerate(rows):
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


def _neighbours_depth_mm(rows: FloatArray) -> FloatArray:
    """(state,) how far tips may lower the top on the side of another tip, summed."""
    depth = np.zeros(len(rows))
    for state, tips in enumerate(rows):
        touching = tips[tips[:, ACTIVE] > 0.0]
        for k, one in enumerate(touching):
            apart = [np.hypot(*(one[[X, Y]] - other[[X, Y]])) for m, other in enumerate(touching) if m != k]
            depth[state] += _fall_beyond_mm(one, min(apart) / 2) if apart else 0.0
    return depth


def _fall_beyond_mm(row: FloatArray, radius_mm: float) -> float:
    """How far below the undisturbed top a curve lies at most beyond a radius [mm]."""
    edges, _, _ = node_radii_mm(float(row[SPHERE_R]), float(row[OUTER_R]))
    pieces = row[PIECES:].reshape(CELLS, PIECE_COLUMNS)[edges[1:] > radius_mm]
    if len(pieces) == 0:
        return 0.0
    return max(float(row[TOP] - lowest_of_pieces_mm(pieces).min()), 0.0)


def _stacked_fields(
    fields: Sequence[SmoothField | None] | None, states: int
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Nodes, what is known of each field, and the distance of the nodes, which all have in common."""
    known = np.zeros((states, FIELD_COLUMNS))
    if fields is None or all(field is None for field in fields):
        return np.zeros((states, 0, 0, 4)), known, np.ones(2)
    if len(fields) != states:
        raise InputError(f"fields: {len(fields)} for {states} states; give one, or None, per state")
    grids = {(field.nodes.shape, *field.step_mm) for field in fields if field is not None}
    if len(grids) != 1:
        shapes = sorted(shape for shape, *_ in grids)
        raise InputError(f"fields: grids of {shapes} nodes; give all states the same grid")
    shape, *step = grids.pop()
    nodes = np.zeros((states, *shape))
    for state, field in enumerate(fields):
        if field is not None:
            nodes[state] = field.nodes
            known[state] = _known_of(field)
    return nodes, known, np.array(step)


def _cells(nodes: FloatArray, step: FloatArray) -> FloatArray:
    """(state, nx - 1, ny - 1, 16) coefficients of u^p v^q of the bicubic Hermite patches between nodes."""
    if nodes.shape[1] == 0:
        return np.zeros((len(nodes), 0, 0, 16))
    # columns of a node: value, d/dx, d/dy, mixed, in units of a cell
    scaled = nodes * np.array([1.0, step[0], step[1], step[0] * step[1]])
    corners = [scaled[:, a : a - 1 or None, b : b - 1 or None] for a in (0, 1) for b in (0, 1)]
    return np.ascontiguousarray(np.concatenate(corners, axis=-1) @ _patches())


@cache
def _patches() -> FloatArray:
    """(16, 16) from the four columns of a cell's corners (0, 0), (0, 1), (1, 0), (1, 1) to its coefficients."""
    # value and slope at a cell's first end, then at its second -> coefficients of 1, u, u², u³
    cubic = np.array([[1, 0, 0, 0], [0, 1, 0, 0], [-3, -2, 3, -1], [2, 1, -2, 1]])
    along_then_across = np.kron(cubic, cubic).reshape(16, 2, 2, 2, 2)  # end and derivative of u, then of v
    return np.asarray(along_then_across.transpose(1, 3, 4, 2, 0).reshape(16, 16), dtype=np.float64)


def _known_of(field: SmoothField) -> FloatArray:
    """Origin, cells per mm and bounds of a field; bounds from `SUBDIVISION` points a cell along each side."""
    if field in _KNOWN:
        return _KNOWN[field]
    value, slope_x, slope_y, bend = _sampled(field)
    row = np.zeros(FIELD_COLUMNS)
    row[:5] = 1.0, *field.origin_mm, *(1.0 / field.step_mm)
    row[FIELD_LOWEST - FIELD_ON] = min(SLOPE_RESERVE * float(value.min()), 0.0)
    row[FIELD_SLOPE - FIELD_ON] = SLOPE_RESERVE * float(np.hypot(slope_x, slope_y).max())
    row[FIELD_BEND - FIELD_ON] = BEND_RESERVE * max(float(bend.max()), 0.0)
    row[SLACK - FIELD_ON] = -row[FIELD_LOWEST - FIELD_ON]
    _KNOWN[field] = row
    return row


def _sampled(field: SmoothField) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Value, slopes and bend (the fastest fall of a slope in any direction), `SUBDIVISION` + 1 points a cell a side."""
    cells = _cells(field.nodes[None], field.step_mm)[0].reshape(-1, 16)
    (dx, dy), points = field.step_mm, (SUBDIVISION + 1) ** 2
    scale = np.array([1.0, 1.0 / dx, 1.0 / dy, 1.0 / dx**2, 1.0 / (dx * dy), 1.0 / dy**2])
    found = (cells @ _samples()).reshape(-1, 6, points) * scale[:, None]
    height, slope_x, slope_y, hxx, hxy, hyy = found.swapaxes(0, 1)
    return height, slope_x, slope_y, -0.5 * (hxx + hyy) + np.hypot(0.5 * (hxx - hyy), hxy)


@cache
def _samples() -> FloatArray:
    """(16, 6 points) from a cell's coefficients to height, slopes and second derivatives in units of a cell."""
    t, power = np.linspace(0.0, 1.0, SUBDIVISION + 1)[:, None], np.arange(4)
    value = t**power
    slope = np.where(power > 0, power * t ** np.maximum(power - 1, 0), 0.0)
    bend = np.where(power > 1, power * (power - 1) * t ** np.maximum(power - 2, 0), 0.0)
    kinds = ((value, value), (slope, value), (value, slope), (bend, value), (slope, slope), (value, bend))
    return np.concatenate([np.kron(along, across) for along, across in kinds]).T
