"""The presses that a verdict needs, and their light: presses for each judged pair, and a grid of presses over the pad.

A state is a press at one location and depth. For a single pair, the press is at the midpoint of its chord, the straight
line between its components. Pairs with the same midpoint share their states, and only the judged pairs are traced.
Presses that are equal by a symmetry of the layout are traced once.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from optopad.design.arrays import FloatArray
from optopad.design.draft import Draft
from optopad.design.progress import OnShare
from optopad.design.shape.cavity import chord_midpoint_mm
from optopad.sims.optics.accuracy import ACCURACIES, MIRRORED_FINER, Accuracy, LightSignals
from optopad.sims.optics.tracing import trace
from optopad.sims.press import NEAR_CONTACT_MM, depth_schedule_mm

Pair = tuple[int, int]

NEAR_SHARE = 0.3
"""Share of the whole progress that a map's depths near contact account for [-]."""

PAIR_ACCURACY = replace(
    ACCURACIES["standard"], image_step=0.1, top_rings=48, top_columns=120, repeat_share=1e-4
)
"""Light settings for single pairs. A deadband is defined by changes of 3 noise units, about 1 % of the signal, so the
jitter from depth to depth must be well below one unit."""

MAP_ACCURACY = ACCURACIES["score"]
"""Light settings for the quick map of the pad. Errors are below 0.3 % rms of the untouched signal
(docs/validation/light.md). On the paper's pad, margins differ between seeds by 0.9 noise units rms, as much as with
"standard" settings."""

FORMED_PAIR_STEP = 0.35
"""Smallest image step for single pairs in discs and crowned pads, whose integration points are closer together. On the
crowned preset and the dome, at 0.6 mm and deeper, changes have errors of 0.05 to 0.25 % rms of the untouched signal,
under a noise unit."""

NEAR_MM = 0.4
"""Depth up to which a map has more depths and finer light settings [mm]; in a good layout, signals begin within it."""

NEAR_ACCURACY = MIRRORED_FINER
"""Light settings for a map's depths up to `NEAR_MM`."""

DOUBT_ACCURACIES = (ACCURACIES["standard"], PAIR_ACCURACY)
"""Light settings for locations that the map's numerical error leaves undecided, tried in turn. Random shifts are common
to all depths, so the difference of two depths has a smaller error than either depth. At (16, 11) mm of the paper's pad,
between 4.2 and 4.8 mm deep, the error of the difference is 0.4 noise units (rms over pairs) with the map's settings,
0.2 with the first of these and 0.1 with the second."""
SECOND_SEED = 1_000_003
"""Number added to the seed for a second, independent trace of the same presses."""

MOST_TRACED_AGAIN = 12
"""Largest number of undecided locations of a map that are traced again."""

SPECULAR_CLASSES = ("top", "skirt")
"""Path classes of the light mirrored by the top: by its smooth part, and by the flank of the dimple ("skirt")."""


@dataclass(frozen=True, kw_only=True)
class PairCurves:
    """Light of one pair against depth, as a share of the emitted power.

    Attributes
    ----------
    pair : (emitter, receiver) indices
    press_mm : (x, y) of the press [mm]
    depth_mm : (n,) depths [mm]
    direct, top, diffuse, total : (n,) light on the direct path, mirrored by the top, scattered, and in total [-]
    standard_error : (n,) standard error of `total` at depth 0; at other depths, of its change from depth 0 [-]
    """

    pair: Pair
    press_mm: tuple[float, float]
    depth_mm: FloatArray
    direct: FloatArray
    top: FloatArray
    diffuse: FloatArray
    total: FloatArray
    standard_error: FloatArray


def untouched_flux(draft: Draft, *, seed: int, accuracy: str | Accuracy = "standard") -> FloatArray:
    """(emitter, receiver) ratio of received to emitted power on the untouched pad [-]."""
    presses = np.array([[draft.cavity.length_mm / 2, draft.cavity.width_mm / 2, 0.0]])
    light = trace(draft, presses, seed=seed, accuracy=accuracy)
    return np.asarray(light.flux[0])


def accuracy_of_pairs(draft: Draft, accuracy: str | Accuracy = PAIR_ACCURACY) -> str | Accuracy:
    """Light settings for a design's single pairs: the given ones, coarser where images do not give the light."""
    if isinstance(accuracy, str) or draft.is_plain_block:
        return accuracy
    return replace(accuracy, image_step=max(accuracy.image_step, FORMED_PAIR_STEP))


def pair_curves(
    draft: Draft,
    pairs: tuple[Pair, ...],
    depth_mm: FloatArray,
    *,
    accuracy: str | Accuracy = PAIR_ACCURACY,
    seed: int,
    on_step: OnShare | None = None,
) -> tuple[PairCurves, ...]:
    """Light of every pair under a press at its own chord's midpoint, at all depths."""
    cavity = draft.cavity
    places = [chord_midpoint_mm(cavity, pair) for pair in pairs]
    distinct = list(dict.fromkeys(places))
    rows = [_rows(distinct.index(place), len(depth_mm)) for place in places]
    states = states_of(np.array(distinct).reshape(-1, 2), depth_mm)
    masks = np.zeros((len(states), len(cavity.emitters), len(cavity.receivers)), dtype=np.bool_)
    for pair, of_pair in zip(pairs, rows, strict=True):
        masks[of_pair, pair[0], pair[1]] = True
    settings = accuracy_of_pairs(draft, accuracy)
    light = trace(draft, states, accuracy=settings, seed=seed, pairs=masks, on_step=_as_share(on_step))
    return tuple(
        curves_of(light, pair, place, of_pair, depth_mm)
        for pair, place, of_pair in zip(pairs, places, rows, strict=True)
    )


def pad_light(
    draft: Draft,
    places_mm: FloatArray,
    depth_mm: FloatArray,
    *,
    accuracy: str | Accuracy,
    seed: int,
    on_step: OnShare | None = None,
) -> LightSignals:
    """Light of all pairs at every location and depth, in the order of `states_of`.

    Parameters
    ----------
    places_mm : (place, 2) press centres [mm]
    depth_mm : (depth,) increasing depths [mm]
    """
    states = states_of(places_mm, depth_mm)
    return trace(draft, states, accuracy=accuracy, seed=seed, on_step=_as_share(on_step))


def map_depths_mm(max_depth_mm: float, step_mm: float) -> FloatArray:
    """(depth,) depths of a map [mm]: equal steps, and extra ones near contact to find the detection threshold."""
    near = [depth for depth in NEAR_CONTACT_MM if depth < max_depth_mm]
    return np.unique(np.concatenate([near, depth_schedule_mm(max_depth_mm, step_mm)]))


def map_light(
    draft: Draft,
    places_mm: FloatArray,
    depth_mm: FloatArray,
    *,
    accuracy: str | Accuracy,
    seed: int,
    near: Accuracy = NEAR_ACCURACY,
    on_step: OnShare | None = None,
) -> LightSignals:
    """Light as from `pad_light`, with the settings `near` for depths up to `NEAR_MM`."""
    is_near = depth_mm <= NEAR_MM
    stages = [(is_near, near), (~is_near, accuracy)]
    parts = [
        pad_light(
            draft, places_mm, depth_mm[chosen], accuracy=settings, seed=seed, on_step=_part_of(on_step, k)
        )
        for k, (chosen, settings) in enumerate(stages)
        if chosen.any()
    ]
    return _joined(parts, len(places_mm))


def _part_of(on_step: OnShare | None, part: int) -> OnShare | None:
    """Progress function for part 0 or 1 of a map; it reports the finished share of the whole map."""
    start, end = ((0.0, NEAR_SHARE), (NEAR_SHARE, 1.0))[part]
    return None if on_step is None else lambda share: on_step(start + (end - start) * share)


def _joined(parts: Sequence[LightSignals], places: int) -> LightSignals:
    """Several parts of the depths at the same locations, joined in the order of `pad_light`."""

    def whole(arrays: Sequence[FloatArray]) -> FloatArray:
        columns = [array.reshape(places, -1, *array.shape[1:]) for array in arrays]
        joined = np.concatenate(columns, axis=1)
        return joined.reshape(-1, *joined.shape[2:])

    return LightSignals(
        flux=whole([part.flux for part in parts]),
        by_class={name: whole([part.by_class[name] for part in parts]) for name in parts[0].by_class},
        standard_error=whole([part.standard_error for part in parts]),
        change_error=whole([part.error_of_changes for part in parts]),
        presses=whole([part.presses for part in parts]),
        digest=parts[0].digest,
        seed=parts[0].seed,
    )


def _as_share(on_step: OnShare | None) -> Callable[[int, int], None] | None:
    return None if on_step is None else lambda done, total: on_step(done / total)


def states_of(places_mm: FloatArray, depth_mm: FloatArray) -> FloatArray:
    """(place x depth, 3) presses as (x, y, depth) [mm]: all depths at the first location, then at the next."""
    return np.array([[x, y, depth] for x, y in places_mm for depth in depth_mm])


def _rows(place: int, depths: int) -> slice:
    return slice(place * depths, (place + 1) * depths)


def curves_of(
    light: LightSignals, pair: Pair, place: tuple[float, float], rows: slice, depth_mm: FloatArray
) -> PairCurves:
    """One pair's light against depth; `rows` selects the presses at the pair's location."""
    at = (rows, *pair)
    return PairCurves(
        pair=pair,
        press_mm=place,
        depth_mm=depth_mm,
        direct=light.by_class["direct"][at],
        top=np.sum([light.by_class[name][at] for name in SPECULAR_CLASSES], axis=0),
        diffuse=light.by_class["diffuse"][at],
        total=light.flux[at],
        standard_error=np.where(depth_mm > 0.0, light.error_of_changes[at], light.standard_error[at]),
    )
