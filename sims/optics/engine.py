# mypy: allow-untyped-calls
"""Trace every pair of a scene through pressed tops: flux by path class, with a standard error.

DOC
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sims.optics.accuracy import ACCURACIES, Accuracy, accuracy_of
from sims.optics.checks import check_scene, wanted_pairs
from sims.optics.scene import OpticalScene
from sims.optics.smooth_field import SmoothField
from sims.optics.surface import SKIRT_R
from sims.optics.tops import Presses, TopStack, stack_tops
from sims.optics.untouched import Untouched, gauss, untouched_pad

__all__ = ["ACCURACIES", "CLASS_NAMES", "Accuracy", "RawLight", "trace_scene"]

FloatArray = NDArray[np.float64]
CLASS_NAMES = ("direct", "top", "skirt", "wall", "diffuse")
BATCH_STATES = 32


@dataclass(frozen=True, kw_only=True)
class RawLight:
    """Flux over emitted power.

    Attributes
    ----------
    flux : (class, state, emitter, receiver), classes in the order of `CLASS_NAMES` [-]
    standard_error : (state, emitter, receiver) of the sum over classes [-]
    skirt_radius_mm : (state,) border between top and skirt; 0 where untouched
    """

    flux: FloatArray
    standard_error: FloatArray
    skirt_radius_mm: FloatArray


def trace_scene(
    scene: OpticalScene,
    centres_mm: FloatArray,
    indentations: Presses,
    *,
    fields: Sequence[SmoothField | None] | None = None,
    accuracy: str | Accuracy = "standard",
    seed: int = 0,
    pairs: NDArray[np.bool_] | None = None,
    on_step: Callable[[int, int], None] | None = None,
) -> RawLight:
    """Trace a scene for a list of presses.

    Parameters
    ----------
    scene : walls, emitters, receivers and materials
    centres_mm : (state, 2) or (state, tip, 2) press axes; ignored where untouched [mm]
    indentations : per state one, None where untouched, or a sequence of these, one for each tip
    fields : one per state, added to the top; None: none
    accuracy : draft, standard, fine, reference, or settings
    seed : of all offsets; same seed, same bits, whatever the number of threads
    pairs : (emitter, receiver) or (state, emitter, receiver) mask; a pair left out is 0
    on_step : called with (states done, states)

    Raises
    ------
    InputError, ModelScopeError : see `sims.optics.checks`, `sims.optics.surface` and `sims.optics.tops`.
    """
    settings = accuracy_of(accuracy)
    check_scene(scene)
    tops = stack_tops(indentations, np.asarray(centres_mm, dtype=np.float64), scene, fields)
    states = len(indentations)
    wanted = wanted_pairs(pairs, states, len(scene.emitter_wall), len(scene.receiver_wall))
    fixed = untouched_pad(scene, settings, seed)
    flux, error = np.zeros((len(CLASS_NAMES), *wanted.shape)), np.zeros(wanted.shape)
    for start in range(0, states, BATCH_STATES):
        part = slice(start, min(start + BATCH_STATES, states))
        values = _trace_batch(wanted[part], tops, part, fixed, settings)
        flux[:, part] = values.mean(axis=1).transpose(1, 0, 2, 3)
        totals = values.sum(axis=2)
        error[part] = totals.std(axis=1, ddof=1) / np.sqrt(settings.replicates)
        if on_step is not None:
            on_step(part.stop, states)
    return RawLight(flux=flux, standard_error=error, skirt_radius_mm=tops.press[:, :, SKIRT_R].max(axis=1))


def _trace_batch(
    wanted: NDArray[np.bool_], tops: TopStack, part: slice, fixed: Untouched, settings: Accuracy
) -> FloatArray:
    from sims.optics.compiled import trace_states

    rules = (
        *gauss(settings.nodes_emitter),
        *gauss(settings.nodes_column),
        *gauss(settings.nodes_height),
    )
    image_rules = (
        *gauss(settings.few_emitter),
        *gauss(settings.few_receiver),
        *gauss(settings.most_emitter),
        *gauss(settings.most_receiver),
    )
    numbers = np.array(
        [
            settings.rings, settings.columns, settings.image_step, settings.top_rings, settings.top_columns,
            settings.repeat_share, settings.wall_rays,
        ],
        dtype=np.float64,
    )  # fmt: skip
    flat = (fixed.straight, fixed.diffuse, fixed.wall, fixed.given, fixed.taken, fixed.joined)
    return np.asarray(
        trace_states(
            wanted, fixed.emitters, fixed.receivers, fixed.box, tops.part(part), flat, fixed.scale, rules, image_rules,
            fixed.points, fixed.shifts, fixed.layout, fixed.areas, fixed.reflectances, numbers, fixed.rays,
        )
    )  # fmt: skip
