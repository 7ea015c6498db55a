"""The presses that a verdict needs, and their light: one press a judged pair, and a map of the pad.

A pair is pressed at the midpoint of its chord; pairs with the same midpoint share their states.
Only the pairs judged at a state are traced there. What a symmetry of the layout carries onto something
traced already is not traced again.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from design.cavity import CavityGeometry
from design.pairs import chord_midpoint_mm
from design.spec import SensorDesign
from design.symmetry import Symmetry, same_place, symmetries
from sims.optics.engine import ACCURACIES, Accuracy
from sims.optics.light_signals import LightSignals
from sims.optics.tracing import trace

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
Pair = tuple[int, int]
OnStep = Callable[[float], None]

PAIR_ACCURACY = replace(
    ACCURACIES["standard"], image_step=0.05, top_rings=24, top_columns=64, repeat_share=3e-4
)
"""Settings of single pairs: a deadband is told by changes of 3 noise units, about 1 % of the signal, so the jitter
from depth to depth must stay well below one unit."""

MAP_ACCURACY = ACCURACIES["standard"]
"""Settings of the map."""

SPECULAR_CLASSES = ("top", "skirt")
"""Path classes whose sum is the light reflected at the top surface: what mode 1 takes away."""


@dataclass(frozen=True, kw_only=True)
class PairCurves:
    """Light of one pair against depth, as a fraction of the emitted power.

    Attributes
    ----------
    pair : emitter and receiver number
    press_mm : (x, y) of the press
    depth_mm, direct, top, diffuse, total, standard_error : (n,) each; top holds all specular light
    """

    pair: Pair
    press_mm: tuple[float, float]
    depth_mm: FloatArray
    direct: FloatArray
    top: FloatArray
    diffuse: FloatArray
    total: FloatArray
    standard_error: FloatArray


def untouched_flux(design: SensorDesign, cavity: CavityGeometry, *, seed: int) -> FloatArray:
    """(emitter, receiver) flux of the untouched pad [-]."""
    presses = np.array([[cavity.length_mm / 2, cavity.width_mm / 2, 0.0]])
    light = trace(design, presses, seed=seed)
    return np.asarray(light.flux[0])


def pair_curves(
    design: SensorDesign,
    cavity: CavityGeometry,
    pairs: tuple[Pair, ...],
    depth_mm: FloatArray,
    *,
    accuracy: str | Accuracy = PAIR_ACCURACY,
    seed: int,
    on_step: OnStep | None = None,
) -> tuple[PairCurves, ...]:
    """Trace every pair under its own press, all depths of the schedule; congruent pairs once."""
    layout = symmetries(cavity)
    leads = [min(symmetry.pair(pair) for symmetry in layout) for pair in pairs]
    traced = _traced_curves(design, cavity, tuple(dict.fromkeys(leads)), depth_mm, accuracy, seed, on_step)
    return tuple(
        replace(traced[lead], pair=pair, press_mm=chord_midpoint_mm(cavity, pair))
        for pair, lead in zip(pairs, leads, strict=True)
    )


def pad_light(
    design: SensorDesign,
    cavity: CavityGeometry,
    places_mm: FloatArray,
    depth_mm: FloatArray,
    *,
    accuracy: str | Accuracy,
    seed: int,
    on_step: OnStep | None = None,
) -> LightSignals:
    """All pairs at every place and depth; states run through depths first, congruent places traced once.

    Parameters
    ----------
    places_mm : (place, 2) press centres
    depth_mm : (depth,) rising depths
    """
    leads = [_lead_of(place, places_mm, cavity) for place in places_mm]
    distinct = sorted({lead for lead, _ in leads})
    light = trace(
        design,
        states_of(places_mm[distinct], depth_mm),
        accuracy=accuracy,
        seed=seed,
        on_step=_as_share(on_step),
    )
    rows, emitters, receivers = _carried(leads, distinct, len(depth_mm))

    def carried(flux: FloatArray) -> FloatArray:
        return flux[rows[:, None, None], emitters[:, :, None], receivers[:, None, :]]

    return replace(
        light,
        presses=states_of(places_mm, depth_mm),
        flux=carried(light.flux),
        by_class={name: carried(flux) for name, flux in light.by_class.items()},
        standard_error=carried(light.standard_error),
    )


def _traced_curves(
    design: SensorDesign,
    cavity: CavityGeometry,
    pairs: tuple[Pair, ...],
    depth_mm: FloatArray,
    accuracy: str | Accuracy,
    seed: int,
    on_step: OnStep | None,
) -> dict[Pair, PairCurves]:
    places = {pair: chord_midpoint_mm(cavity, pair) for pair in pairs}
    distinct = list(dict.fromkeys(places.values()))
    rows = {pair: _rows(distinct.index(place), len(depth_mm)) for pair, place in places.items()}
    states = states_of(np.array(distinct), depth_mm)
    masks = np.zeros((len(states), len(cavity.emitters), len(cavity.receivers)), dtype=np.bool_)
    for pair in pairs:
        masks[rows[pair], pair[0], pair[1]] = True
    light = trace(design, states, accuracy=accuracy, seed=seed, pairs=masks, on_step=_as_share(on_step))
    return {pair: curves_of(light, pair, places[pair], rows[pair], depth_mm) for pair in pairs}


def _as_share(on_step: OnStep | None) -> Callable[[int, int], None] | None:
    return None if on_step is None else lambda done, total: on_step(done / total)


def states_of(places_mm: FloatArray, depth_mm: FloatArray) -> FloatArray:
    """(place x depth, 3) presses, depth innermost [mm]."""
    return np.array([[x, y, depth] for x, y in places_mm for depth in depth_mm])


def _lead_of(place_mm: FloatArray, places_mm: FloatArray, cavity: CavityGeometry) -> tuple[int, Symmetry]:
    """The first place that a symmetry of the layout carries this one onto, and that symmetry."""
    x_mm, y_mm = float(place_mm[0]), float(place_mm[1])
    found = [
        (number, symmetry)
        for symmetry in symmetries(cavity)
        for number, other in enumerate(places_mm)
        if same_place(symmetry.image((x_mm, y_mm)), (float(other[0]), float(other[1])))
    ]
    return min(found, key=lambda item: item[0])


def _carried(
    leads: list[tuple[int, Symmetry]], distinct: list[int], depths: int
) -> tuple[IntArray, IntArray, IntArray]:
    """For every state: the traced row, and the traced emitter and receiver that stand for its own."""
    rows = [distinct.index(number) * depths + depth for number, _ in leads for depth in range(depths)]
    emitters = [symmetry.emitters for _, symmetry in leads for _ in range(depths)]
    receivers = [symmetry.receivers for _, symmetry in leads for _ in range(depths)]
    return np.array(rows), np.array(emitters), np.array(receivers)


def _rows(place: int, depths: int) -> slice:
    return slice(place * depths, (place + 1) * depths)


def curves_of(
    light: LightSignals, pair: Pair, place: tuple[float, float], rows: slice, depth_mm: FloatArray
) -> PairCurves:
    """One pair's light against depth, from the states of its press."""
    at = (rows, *pair)
    return PairCurves(
        pair=pair,
        press_mm=place,
        depth_mm=depth_mm,
        direct=light.by_class["direct"][at],
        top=np.sum([light.by_class[name][at] for name in SPECULAR_CLASSES], axis=0),
        diffuse=light.by_class["diffuse"][at],
        total=light.flux[at],
        standard_error=light.standard_error[at],
    )
