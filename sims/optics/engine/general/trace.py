"""Trace every pair of a disc or crowned pad, untouched or pressed: flux by path class, with a standard error.

Method, class by class
----------------------
- `direct`: quadrature with a horizon for every column (`direct`).
- `top`, `skirt`: ray bundles by way of points of the top (`mirrored`, `points`); under a diffuse skin, light that it
scatters once, by way of such points (`skin`).
- `diffuse`: the untouched pad's scattered light times the factor by which a press changes light scattered once
(`deposits`). If nothing but the tip scatters, it is the tip's scattered light.

The untouched pad is traced only once, and finely (`pad`). The change by a press is the difference of the light
at the same points and rays with and without the press.

Standard error
--------------
The error of mirrored light comes from grids with every other point; the error of scattered light, from leaving out
every fourth ray in turn. Each pair also has an error by fixed rules: `RULES_ERROR` of the untouched flux,
`HORIZON_ERROR` of the direct light that the press removes, and `CHAINS_ERROR` or `PARTS_ERROR` of the change of
mirrored light. `change_error` leaves out what cancels in the difference of two states: the untouched pad's error, which
all states share, and the error of fixed rules, which is the same share of equal changes. No error covers light
scattered more than once that the dimple obstructs.

This model leaves out smooth walls and folds. Several tips are traced on a grid of heights.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from optopad.design.arrays import BoolArray, FloatArray, IntArray
from optopad.sims.optics.accuracy import Accuracy
from optopad.sims.optics.engine.general.deposits import TIP_PATCHES
from optopad.sims.optics.engine.general.grid import divided, patch_areas
from optopad.sims.optics.engine.general.lower import FormedStack
from optopad.sims.optics.engine.general.pad import (
    CLASSES,
    FormedPad,
    FormedWays,
    formed_ways,
    jackknifed,
    lattice_error,
)
from optopad.sims.optics.engine.general.patches import is_in_plan
from optopad.sims.optics.engine.general.points import points_of, ring_points, ring_zone_mm
from optopad.sims.optics.engine.general.rays import AREA, CZ, HALF_V, VZ
from optopad.sims.optics.engine.general.top import (
    CONTACT_EDGE,
    DEPTH,
    FIELD_X,
    FIELD_Y,
    FLAT,
    GRID_STEP,
    KIND,
    OUTER,
    SKIRT_EDGE,
    SPHERE,
    FormedTop,
    empty_grid,
    empty_row,
    out_of_frame,
)
from optopad.sims.optics.engine.threads import run_each
from optopad.sims.optics.scene.optical_scene import OpticalScene
from optopad.sims.optics.surface.curves import CONTACT_AREA

RULES_ERROR = 3e-4
"""Error of fixed rules relative to the untouched flux, for a pair that a press changes [-]. For comparison: for flat
rectangles, mirrored light here is within 1e-4 of the result of `trace_states`."""
HORIZON_ERROR = 0.01
"""Error of direct light relative to the direct light that the press removes [-]: the largest change that finer rules
cause."""
CHAINS_ERROR, PARTS_ERROR = 0.02, 0.01
"""Error of a press's change of mirrored light, relative to the changes by the skirt and elsewhere [-]: under a crown,
where light is mirrored several times; and under a flat top. It is about the largest change that dividing emitters into
smaller parts still causes."""


@dataclass(frozen=True, kw_only=True)
class FormedLight:
    """Light of some states, as a fraction of emitted power.

    Attributes
    ----------
    flux : (state, class, emitter, receiver) flux [-]
    standard_error : (state, emitter, receiver) standard error of the flux summed over classes [-]
    change_error : (state, emitter, receiver) the part of the error that comes from the press's sample points and rays
        [-]
    scale : (emitter, receiver) untouched flux of all classes, above 0 [-]
    """

    flux: FloatArray
    standard_error: FloatArray
    change_error: FloatArray
    scale: FloatArray


def trace_formed(
    scene: OpticalScene,
    tops: FormedStack,
    states: IntArray,
    settings: Accuracy,
    seed: int,
    wanted: BoolArray,
) -> FormedLight:
    """Trace some states. One emitter's light in one state does not depend on any other emitter or state.

    Parameters
    ----------
    scene : a disc or crowned pad (`lower.check_formed`)
    tops : tops of all states
    states : (n,) numbers of the states to trace
    settings : the accuracy
    seed : seed of the offsets
    wanted : (n, emitter, receiver) mask of the pairs to trace; the flux of others is 0
    """
    ways = formed_ways(scene, settings, seed)
    flux = np.zeros((len(states), CLASSES, *wanted.shape[1:]))
    error, change_error = np.zeros(wanted.shape), np.zeros(wanted.shape)

    def trace_one(number: int) -> None:
        top = tops.top(int(states[number]))
        if top.numbers[OUTER] > 0.0:
            flux[number], error[number], change_error[number] = _pressed(ways, top, wanted[number])
        else:
            flux[number], error[number] = ways.pad.flux, ways.pad.error

    run_each(trace_one, len(states))
    return FormedLight(
        flux=np.where(wanted[:, None], flux, 0.0),
        standard_error=np.where(wanted, error, 0.0),
        change_error=np.where(wanted, change_error, 0.0),
        scale=ways.pad.scale,
    )


def _pressed(
    ways: FormedWays, top: FormedTop, wanted: BoolArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(class, emitter, receiver) light of a pressed state; (emitter, receiver) standard error and change error."""
    pad = ways.pad
    flux = pad.flux.copy()
    straight = pad.straight(top, wanted, ways.rules) - ways.straight if _may_hide(pad, top) else 0.0
    changes = [_mirrored_change(ways, k, top, wanted) for k in range(len(ways.points))]
    mirrored, apart = (np.stack(one) for one in zip(*changes, strict=True))
    scattered, scattered_error = _scattered(ways, top, wanted)
    flux[0] += straight
    flux[1:3] += mirrored.sum(axis=2).mean(axis=0)
    if pad.scene.top_finish == "diffuse":
        again, again_error = _scattered_again(ways, top, wanted)
        scattered, scattered_error = scattered + again, np.hypot(scattered_error, again_error)
    change = straight + mirrored.sum(axis=(1, 2)).mean(axis=0) + scattered - flux[4]
    flux[4] = scattered
    is_changed = np.abs(change) > 1e-9 * pad.scale
    parts = PARTS_ERROR if top.numbers[KIND] == FLAT else CHAINS_ERROR
    chains = parts * np.hypot(*mirrored.sum(axis=2).mean(axis=0))
    rules = np.sqrt((RULES_ERROR * pad.scale * is_changed) ** 2 + (HORIZON_ERROR * straight) ** 2 + chains**2)
    change_error = np.hypot(lattice_error(mirrored, apart), scattered_error)
    error = np.sqrt(pad.error**2 + change_error**2 + rules**2)
    return np.maximum(flux, 0.0), np.asarray(error), np.asarray(change_error)


def _may_hide(pad: FormedPad, top: FormedTop) -> bool:
    """Whether a press may hide direct light: on flat tops, only if it reaches below the highest edge of a face."""
    highest_mm = max(
        float((faces[:, CZ] + faces[:, HALF_V] * faces[:, VZ]).max())
        for faces in (pad.emitters, pad.receivers)
    )
    return bool(top.numbers[KIND] != FLAT or pad.scene.height_mm - top.numbers[DEPTH] < highest_mm)


def _mirrored_change(
    ways: FormedWays, number: int, top: FormedTop, wanted: BoolArray
) -> tuple[FloatArray, FloatArray]:
    """(2, batch, emitter, receiver) change of mirrored light by a press, from one replicate's points; and its parts
    whose differences between batches are the error.

    The change is that of the light at the same points with and without the press. Few points serve the narrow image of
    a part on the floor. There, where light is lost, it is the known untouched light that is lost, by the same share.
    """
    pad, points = ways.pad, ways.points[number]
    flat = _without_press(top)
    at = points.in_frame(top)
    if top.numbers[GRID_STEP] > 0.0:
        is_divided, pieces = divided(ways.grid, top)
        shift = ways.shifts[number]
        all_chains = bool(top.numbers[KIND] == SPHERE)
        of_grid = ~is_divided[points.cell]
        finer = points_of(pieces, pad.scene, pad.walls, pad.arcs, shift, all_chains=all_chains).in_frame(top)
    else:
        inner, outer = ring_zone_mm(top)
        reach = np.hypot(at[:, 0], at[:, 1])
        of_grid = (reach >= outer) | (points.is_part & (reach >= inner))
        finer = ring_points(top, outer, ways.grid.pitch_mm, ways.settings, ways.shifts[number])
        x, y = out_of_frame(flat, finer[:, :2])[:, :2].T
        is_ring = is_in_plan(x, y, pad.walls, pad.arcs)
        is_ring &= ~(ways.grid.is_divided(x, y) & (np.hypot(finer[:, 0], finer[:, 1]) >= inner))
        finer = finer[is_ring]
    now = pad.mirrored(top, wanted, np.vstack([at[of_grid], finer]))
    before = pad.mirrored(flat, wanted, finer) - pad.mirrored(flat, wanted, at[~of_grid])
    before += np.where(wanted, ways.mirrored[number], 0.0)
    change = now - before
    if pad.scene.emitter_pose is None:
        return change, change
    left, untouched = now.sum(axis=(0, 1)), before.sum(axis=(0, 1))
    loses = left < untouched
    known = np.divide(pad.flux[1:3].sum(axis=0), untouched, out=np.ones_like(left), where=loses)
    share = np.divide(left, untouched, out=np.ones_like(left), where=loses)
    return change * known, known * (now - share * before)


def _scattered(ways: FormedWays, top: FormedTop, wanted: BoolArray) -> tuple[FloatArray, FloatArray]:
    """(emitter, receiver) scattered light under a press, and its standard error.

    The error is a jackknife: each batch of rays is left out in turn.
    """
    pad, untouched = ways.pad, ways.pad.flux[4]
    weight = pad.patches.weight.copy()
    is_grid = top.numbers[GRID_STEP] > 0.0
    tip = patch_areas(top) if is_grid else np.full(TIP_PATCHES, top.row[CONTACT_AREA] / TIP_PATCHES)
    weight[-TIP_PATCHES:] = np.divide(
        pad.scene.tip_reflectance, tip, out=np.zeros(TIP_PATCHES), where=tip > 0.0
    )
    area = pad.receivers[:, AREA]
    of_skin = untouched if pad.scene.top_finish == "diffuse" else 0.0  # which no wall or bottom scatters
    found, squares = [], []
    for shift, before in zip(ways.rays, ways.deposits, strict=True):
        now = pad.deposits(top, wanted, shift)
        both = (np.concatenate([now[0], before[0]], axis=1), np.concatenate([now[1], before[1]], axis=1))

        def scattered(given: FloatArray, taken: FloatArray) -> FloatArray:
            pressed, flat = (
                (one * weight) @ other.T
                for one, other in zip(np.split(given, 2), np.split(taken, 2), strict=True)
            )
            ratio = np.divide(pressed, flat, out=np.zeros_like(flat), where=flat > 0.0)
            return np.asarray(np.where(flat > 0.0, untouched * ratio, of_skin + pressed * area))

        value, error = jackknifed(both, scattered)
        found.append(value)
        squares.append(error**2)
    return np.mean(found, axis=0), np.sqrt(np.mean(squares, axis=0) / len(found))


def _scattered_again(ways: FormedWays, top: FormedTop, wanted: BoolArray) -> tuple[FloatArray, FloatArray]:
    """(emitter, receiver) change by a press of light that only the skin scatters, twice or more, and its error."""
    pad = ways.pad
    changes = np.stack(
        [
            pad.again(top, wanted, shift)
            - (0.0 if top.numbers[KIND] == FLAT else pad.again(pad.top, wanted, shift))
            for shift in ways.rays
        ]
    )
    batches = changes.reshape(-1, *changes.shape[2:])
    error = batches.std(axis=0, ddof=1) * np.sqrt(len(batches)) / len(ways.rays)
    return batches.sum(axis=0) / len(ways.rays), np.asarray(error)


def _without_press(top: FormedTop) -> FormedTop:
    """The untouched top in the coordinates of a press."""
    numbers = top.numbers.copy()
    numbers[[DEPTH, OUTER, CONTACT_EDGE, SKIRT_EDGE, GRID_STEP, FIELD_X, FIELD_Y]] = 0.0
    return top._replace(numbers=numbers, row=empty_row(), grid=empty_grid())
