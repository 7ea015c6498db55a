"""Fits the map of light of a pad (`fast_light`) to traced states.

The weights V are the ridge regression that has the least squared error of light over untouched light. Each state
counts once for each of the pad's symmetries that keep its cells. Channels count relative to their size, and the ridge
has the least error at every twentieth state, which is then fitted with the others.

The errors are those at other states, traced with two replicates and another seed. The error of balls like the tip is
that against presses by the tip itself (`optopad.sims.learning.traced_map.measured_error`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.spatial import cKDTree

from optopad.design.arrays import FloatArray, IntArray
from optopad.design.draft import Draft
from optopad.design.errors import InputError
from optopad.design.files import made_folder
from optopad.design.progress import OnShare, OnStep, silent
from optopad.design.rules.touch import LARGEST_HELD_SHARE
from optopad.design.spec import SensorDesign
from optopad.sims.held import require_traced
from optopad.sims.learning.inference.signal_map import TensorSpline, fitted_spline
from optopad.sims.learning.traced_map import SignalMap, measured_error, traced_map
from optopad.sims.optics.scene.lower import scene_of
from optopad.sims.optics.scene.symmetry import SceneSymmetry, symmetries_of
from optopad.sims.robot.fast_light import (
    CHANNELS,
    SCALARS,
    WIDTHS,
    FastLight,
    Imprint,
    Nodes,
    Single,
    draft_nodes,
    light_file,
)
from optopad.sims.robot.light_states import SHARES, StateSource, traced_ratios
from optopad.sims.verdict.presses import untouched_flux

STATES, FEWEST, MOST = 20_000, 200, 1_000_000
CHECKED = 30
"""Other states of each kind at which the error is measured, at most; fewer if fewer are fitted."""
CELLS, MOST_CELLS, TIP_SHARE = 256, 640, 2.0 / 3.0
"""Cells of a pad; most of them, if their size would otherwise exceed this share of the tip's radius."""
RIDGES = (3e-4, 1e-3, 3e-3, 1e-2, 3e-2, 1e-1)
HELD_OUT, ROWS = 20, 1024
LEAST_SCALE = 1e-3
TIP = "ball like the tip"
ERROR_SEED = 15_485_863


def fit_fast_light(
    design: SensorDesign, *, states: int = STATES, seed: int = 0, on_step: OnStep = silent
) -> FastLight:
    """Fit the map of light of a design, and store it in the cache folder.

    Traced light is kept on disk, so an interrupted fit takes up most of its work again.

    Parameters
    ----------
    states : number of traced states
    seed : seed of the states and their light
    on_step : called with ``map``, ``states``, ``fit`` or ``check``, and the share done

    Raises
    ------
    InputError : the number of states is out of range.
    OutputError : the cache folder cannot be made.
    ModelScopeError : the models do not cover the pad.
    """
    if not FEWEST <= states <= MOST:
        raise InputError(f"states: {states} is refused; give {FEWEST} to {MOST}")
    draft = Draft.of(design)
    require_traced(draft, "robot")
    file = light_file(design)
    made_folder(file.parent, "name another one by OPTOPAD_CACHE")
    known = traced_map(design.with_ball(), seed=seed, on_step=on_step)
    light = _without_weights(draft, known)
    source = StateSource(draft, light, seed)
    _, imprint, ratios = traced_ratios(
        draft, source, range(states), seed=seed, on_share=lambda share: on_step("states", share)
    )
    motions = [one for one in (_motion(light.nodes, each) for each in symmetries_of(scene_of(design))) if one]
    weights = _weights(light, motions, imprint, ratios, lambda share: on_step("fit", share))
    light = replace(light, weights=weights, states=states)
    light = replace(light, errors=_errors(draft, light, known, source, states, seed, on_step))
    light.save(file)
    return light


def cell_mm(draft: Draft) -> float:
    """Size of the cells of a draft's pad [mm]."""
    area_mm2, tip_mm = draft.plan.area_mm2, draft.design.indenter.tip_radius_mm
    return max(min(math.sqrt(area_mm2 / CELLS), TIP_SHARE * tip_mm), math.sqrt(area_mm2 / MOST_CELLS))


def _without_weights(draft: Draft, known: SignalMap) -> FastLight:
    design, plan = draft.design, draft.plan
    tip_mm = design.indenter.tip_radius_mm
    untouched, nodes = untouched_flux(draft, seed=0), draft_nodes(draft, cell_mm(draft))
    return FastLight(
        digest=design.digest,
        top=plan.top,
        nodes=nodes,
        tip_radius_mm=tip_mm,
        tip=_ratio_root(known),
        weights=np.zeros((CHANNELS * nodes.cells, untouched.size), np.float32),
        untouched=untouched,
        deepest_mm=min(LARGEST_HELD_SHARE * nodes.thickness_mm, design.operating.max_depth_mm),
        states=0,
        errors={},
    )


def _ratio_root(known: SignalMap) -> TensorSpline:
    """√(light / untouched light) under the tip; exactly 1 at depth 0."""
    flat = known.flux[0, 0, 0].ravel()
    ratio = known.flux.reshape(*known.flux.shape[:3], -1) / np.where(flat > 0.0, flat, 1.0)
    ratio[..., flat <= 0.0] = 1.0
    nodes = (known.x_mm, known.y_mm, known.root_depth)
    return fitted_spline(
        np.sqrt(np.maximum(ratio, 0.0)),
        np.array([axis[0] for axis in nodes]),
        np.array([axis[1] - axis[0] for axis in nodes]),
    )


@dataclass(frozen=True, kw_only=True)
class _Motion:
    """A symmetry: cell j holds what `cells[j]` held before, turned by the matrix `channels`, and pair p what
    `pairs[p]` held."""

    cells: IntArray
    pairs: IntArray
    channels: Single


def _motion(nodes: Nodes, one: SceneSymmetry) -> _Motion | None:
    """A symmetry on the cells; None if it does not map the grid onto itself, as a turn of a disc by 45 deg."""
    middles = np.stack(np.meshgrid(*nodes.cell_lines_mm, indexing="ij"), axis=-1).reshape(-1, 2)
    away, image = cKDTree(middles).query(one.image(middles))
    if float(away.max()) > 0.01 * nodes.pitch_mm:
        return None
    before = np.empty(len(image), dtype=np.int64)
    before[image] = np.arange(len(image))
    emitters, receivers = np.argsort(one.emitters), np.argsort(one.receivers)
    pairs = emitters[:, None] * len(receivers) + receivers
    return _Motion(cells=before, pairs=pairs.ravel(), channels=_turned(one.matrix))


def _turned(matrix: FloatArray) -> Single:
    """Matrix (channel, channel) that turns the channels of a node; see `FastLight.features`."""
    found = np.eye(CHANNELS)
    basis = np.array([[[0.5, 0.0], [0.0, -0.5]], [[0.0, 1.0], [1.0, 0.0]]])  # of gx² - gy² and gx gy
    moved = matrix @ basis @ matrix.T
    tensor = np.stack([moved[:, 0, 0] - moved[:, 1, 1], moved[:, 0, 1]])
    for width in range(len(WIDTHS)):
        at = SCALARS + width + len(WIDTHS) * np.arange(4)
        found[np.ix_(at[:2], at[:2])] = tensor
        found[np.ix_(at[2:], at[2:])] = matrix
    return found.astype(np.float32)


def _weights(
    light: FastLight, motions: Sequence[_Motion], imprint: Imprint, ratios: FloatArray, on_share: OnShare
) -> Single:
    """V (channel x cell, pair) of the map's module, from light over untouched light (n, pair)."""
    base, features = light.parts(imprint)
    wanted = (ratios - base).astype(np.float32)
    left = np.arange(len(wanted)) % HELD_OUT == 0
    size = features.shape[1]
    sums = [[np.zeros((size, width), np.float32) for width in (size, wanted.shape[1])] for _ in range(2)]
    for start in range(0, len(wanted), ROWS):
        rows = np.arange(start, min(start + ROWS, len(wanted)))
        for own, (square, mixed) in zip((rows[~left[rows]], rows[left[rows]]), sums, strict=True):
            of_cells = features[own].reshape(len(own), CHANNELS, -1)
            for motion in motions:
                moved = motion.channels @ of_cells[:, :, motion.cells]
                flat = moved.reshape(len(own), -1)
                square += flat.T @ flat
                mixed += flat.T @ wanted[own][:, motion.pairs]
        on_share((start + len(rows)) / len(wanted))
    (square, mixed), (other_square, other_mixed) = sums

    def solved(square: Single, mixed: Single, ridge: float) -> Single:
        scale = np.sqrt(np.diag(square)) + np.float32(LEAST_SCALE)
        matrix = square / scale[:, None] / scale
        matrix[np.diag_indices(size)] += np.float32(ridge)
        return np.asarray(
            cho_solve(cho_factor(matrix, overwrite_a=True), mixed / scale[:, None]) / scale[:, None]
        )

    def error(ridge: float) -> float:
        found = features[left] @ solved(square, mixed, ridge)
        return float(np.square(found - wanted[left]).mean())

    return solved(square + other_square, mixed + other_mixed, min(RIDGES, key=error))


def _errors(
    draft: Draft,
    light: FastLight,
    known: SignalMap,
    source: StateSource,
    states: int,
    seed: int,
    on_step: OnStep,
) -> dict[str, float]:
    """Root mean square errors of the light over untouched light, by kind of object."""
    each = min(CHECKED, max(states // 20 // len(SHARES), 2))
    kinds = [kind for kind in SHARES for _ in range(each)]
    numbers = [states + k for k in range(len(kinds))]
    _, imprint, ratios = traced_ratios(
        draft,
        source,
        numbers,
        kinds,
        accuracy="score",
        seed=seed + ERROR_SEED,
        on_share=lambda share: on_step("check", share),
    )
    square = np.square(light.ratios(imprint).reshape(len(ratios), -1) - ratios)
    own = np.array(kinds)
    found = {kind: float(np.sqrt(square[own == kind].mean())) for kind in SHARES}
    return {
        TIP: _tip_error(draft.design.with_ball(), light, known),
        **found,
        "all": float(np.sqrt(square.mean())),
    }


def _tip_error(design: SensorDesign, light: FastLight, known: SignalMap) -> float:
    """The same of the spline of the tip, at presses as deep as the map of light covers."""
    checked = measured_error(design, known)
    rows = checked.press_mm[:, 2] <= light.deepest_mm
    off = (checked.found - checked.truth)[rows].reshape(int(rows.sum()), -1) / known.untouched
    return float(np.sqrt(np.square(off).mean()))
