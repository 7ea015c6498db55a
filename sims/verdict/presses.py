"""The presses that a verdict needs, and their light: one press a judged pair, and a map of the pad.

A pair is pressed at the midpoint of its chord; pairs with the same midpoint share their states.
Only the pairs judged at a state are traced there.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from design.cavity import CavityGeometry
from design.pairs import chord_midpoint_mm
from design.spec import SensorDesign
from sims.optics.light_signals import LightSignals
from sims.optics.tracing import trace

FloatArray = NDArray[np.float64]
Pair = tuple[int, int]
OnStep = Callable[[float], None]

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
    return trace(design, presses, seed=seed).flux[0]


def pair_curves(
    design: SensorDesign,
    cavity: CavityGeometry,
    pairs: tuple[Pair, ...],
    depth_mm: FloatArray,
    *,
    seed: int,
    on_step: OnStep | None = None,
) -> tuple[PairCurves, ...]:
    """Trace every pair under its own press, all depths of the schedule."""
    places = [chord_midpoint_mm(cavity, pair) for pair in pairs]
    distinct = list(dict.fromkeys(places))
    states = np.array([[x, y, depth] for x, y in distinct for depth in depth_mm])
    masks = np.zeros((len(states), len(cavity.emitters), len(cavity.receivers)), dtype=np.bool_)
    for pair, place in zip(pairs, places, strict=True):
        masks[_rows(distinct.index(place), len(depth_mm)), pair[0], pair[1]] = True
    light = trace(design, states, seed=seed, pairs=masks, on_step=on_step)
    return tuple(
        _curves(light, pair, place, _rows(distinct.index(place), len(depth_mm)), depth_mm)
        for pair, place in zip(pairs, places, strict=True)
    )


def pad_light(
    design: SensorDesign,
    places_mm: FloatArray,
    depth_mm: FloatArray,
    *,
    seed: int,
    on_step: OnStep | None = None,
) -> LightSignals:
    """All pairs at every place and depth; states run through depths first.

    Parameters
    ----------
    places_mm : (place, 2) press centres
    depth_mm : (depth,) rising depths
    """
    states = np.array([[x, y, depth] for x, y in places_mm for depth in depth_mm])
    return trace(design, states, seed=seed, on_step=on_step)


def _rows(place: int, depths: int) -> slice:
    return slice(place * depths, (place + 1) * depths)


def _curves(
    light: LightSignals, pair: Pair, place: tuple[float, float], rows: slice, depth_mm: FloatArray
) -> PairCurves:
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
