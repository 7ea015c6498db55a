"""The press of a design's tip into its pad: depth in, surface, force and contact radius out.

A press belongs to one elastic depth over tip radius. It is taken from the shipped library (or solved live, where
a mesh is asked for) and scaled: lengths with the tip radius R, force with E R² (a frictionless neo-Hookean
layer has no other length or force). The library's wall is bonded 16/3 R from the axis.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache

from design.errors import DesignError, InputError
from design.properties import youngs_modulus_mpa
from design.spec import SensorDesign
from sims.contact.incompressible import POISSON_RATIOS, nearly_incompressible
from sims.contact.library import shipped_library
from sims.contact.mesh_error import mesh_note
from sims.contact.press_fit import fit_press
from sims.contact.profiles import UnitPress
from sims.contact.scope import (
    depth_limit_mm,
    elastic_depth_mm,
    layer_depth,
    require_depth,
    solved_depths,
    tip_radius_mm,
    wall_note,
)
from sims.contact.smooth_press import SmoothPress
from sims.contact.solved_press import SolvedPress
from sims.contact.stored_press import PressInputs, stored_press
from sims.contact.tip import HEMISPHERE, tip_of
from sims.indentation import Indentation

__all__ = [
    "depth_limit_mm",
    "elastic_depth_mm",
    "indent",
    "mesh_note",
    "modulus_mpa",
    "solved_press",
    "wall_note",
]

DEFAULT_MESH = 0.1
"""Node spacing under the tip [tip radii]: 0.3 mm for a 3 mm tip."""
MESH_RANGE = (0.04, 0.15)
"""Spacings that are accepted [tip radii]; coarser facets bridge the equator of the tip and lose the contact
edge, finer ones may chatter at deep presses (which is refused, not hidden)."""

LEAST_LIVE_DEPTH = 0.4 / 3
"""A live solve goes at least so deep, so that a smooth description has enough depths [tip radii]."""

_SMOOTH: dict[tuple[int, int], tuple[UnitPress, UnitPress, SmoothPress]] = {}
"""Presses made of this process's solutions, by their identity (they are kept alive beside it)."""


def modulus_mpa(design: SensorDesign) -> float:
    """Young's modulus of the elastomer [MPa].

    Raises
    ------
    DesignError : not a positive number
    """
    modulus = youngs_modulus_mpa(design)
    if not (math.isfinite(modulus) and modulus > 0.0):
        raise DesignError(f"elastomer.youngs_modulus_mpa: {modulus:g} MPa must be a positive number")
    return modulus


def _mesh_size(design: SensorDesign, mesh_mm: float | None) -> float:
    """Node spacing under the tip [tip radii]."""
    if mesh_mm is None:
        return DEFAULT_MESH
    radius = tip_radius_mm(design)
    low, high = (bound * radius for bound in MESH_RANGE)
    if not low - 1e-9 <= mesh_mm <= high + 1e-9:
        raise InputError(f"mesh_mm: {mesh_mm:g} mm must lie between {low:g} and {high:g} mm for this tip")
    return mesh_mm / radius


def _live_press(
    design: SensorDesign, mesh_size: float, deepest: float, on_step: Callable[[float], None] | None
) -> tuple[UnitPress, SmoothPress, tuple[str, ...]]:
    """Solved states at the larger Poisson's ratio, the nearly incompressible press, and notes."""
    layer = layer_depth(design)
    depths = tuple(round(float(depth), 9) for depth in solved_depths(layer, max(deepest, LEAST_LIVE_DEPTH)))
    inputs = [
        PressInputs(
            layer=layer, mesh_size=mesh_size, depths=depths, poisson_ratio=ratio, tip=tip_of(design.indenter)
        )
        for ratio in POISSON_RATIOS
    ]
    shares = dict.fromkeys(POISSON_RATIOS, 0.0)

    def solve(one: PressInputs) -> tuple[UnitPress, tuple[str, ...]]:
        return stored_press(one, lambda share: advance(one.poisson_ratio, share))

    def advance(ratio: float, share: float) -> None:
        shares[ratio] = share
        if on_step is not None:
            on_step(sum(shares.values()) / len(shares))

    with ThreadPoolExecutor(max_workers=len(inputs)) as pool:
        (soft, _), (stiff, notes) = pool.map(solve, inputs)
    return stiff, _smooth(soft, stiff), notes


def _smooth(soft: UnitPress, stiff: UnitPress) -> SmoothPress:
    """The nearly incompressible press, made once for every pair of solutions of this process."""
    key = (id(soft), id(stiff))
    if key not in _SMOOTH:
        _SMOOTH[key] = (soft, stiff, nearly_incompressible(fit_press(soft), fit_press(stiff)))
    return _SMOOTH[key][2]


@lru_cache(maxsize=64)
def _library_press(layer: float) -> SmoothPress:
    """The library's presses of a layer; designs that differ elsewhere share them."""
    return shipped_library().press(layer)


def solved_press(
    design: SensorDesign,
    max_depth_mm: float | None = None,
    mesh_mm: float | None = None,
    on_step: Callable[[float], None] | None = None,
) -> SolvedPress:
    """The press of a design's tip into its pad, down to a depth or deeper.

    Parameters
    ----------
    design : the sensor
    max_depth_mm : deepest press wanted, by default that of the design's range of use [mm]
    mesh_mm : node spacing under the tip [mm]; a value solves anew. None takes the shipped library, which has
        hemispheres; other tips are solved with a spacing of a tenth of the tip radius.
    on_step : called with the fraction done while solving

    Raises
    ------
    DesignError, InputError : a value that is no positive number
    ModelScopeError : a layer or depth outside the model
    """
    name = "operating.max_depth_mm" if max_depth_mm is None else "max_depth_mm"
    wanted = design.operating.max_depth_mm if max_depth_mm is None else max_depth_mm
    radius, layer, modulus = tip_radius_mm(design), layer_depth(design), modulus_mpa(design)
    deepest = require_depth(design, wanted, name) / radius
    unit: UnitPress | None = None
    notes: tuple[str, ...] = ()
    if mesh_mm is None and tip_of(design.indenter) == HEMISPHERE:
        smooth = _library_press(round(layer, 9))
    else:
        unit, smooth, notes = _live_press(design, _mesh_size(design, mesh_mm), deepest, on_step)
    return SolvedPress(
        smooth=smooth, unit=unit, tip_radius_mm=radius, youngs_modulus_mpa=modulus, notes=notes
    )


def _require_inside(design: SensorDesign, at_mm: tuple[float, float]) -> None:
    """Refuse a place outside the cavity."""
    for letter, value, limit in zip(
        "xy", at_mm, (design.cavity.length_mm, design.cavity.width_mm), strict=True
    ):
        if not (math.isfinite(value) and 0.0 <= value <= limit):
            raise InputError(f"at_mm: {letter} = {value:g} mm must lie in the cavity, 0 to {limit:g} mm")


def indent(
    design: SensorDesign,
    depth_mm: float,
    at_mm: tuple[float, float] | None = None,
    *,
    mesh_mm: float | None = None,
) -> Indentation:
    """Press the design's tip into its pad.

    Parameters
    ----------
    design : the sensor
    depth_mm : how far the tip's apex lies below the undisturbed surface [mm]; 0 or less: untouched
    at_mm : (x, y) of the press axis in the cavity frame [mm]; None is the middle. The shape is that of
        the centred press wherever it is.
    mesh_mm : node spacing under the tip [mm]; a value solves anew. None takes the shipped library, which has
        hemispheres; other tips are solved with a spacing of a tenth of the tip radius.

    Returns
    -------
    Indentation : curve of the deformed top, contact radius and force

    Raises
    ------
    DesignError, InputError : a value that is no number, a place outside the cavity
    ModelScopeError : a layer or depth outside the model
    """
    require_depth(design, depth_mm, "depth_mm")
    if at_mm is not None:
        _require_inside(design, at_mm)
    deepest = max(depth_mm, design.operating.max_depth_mm)
    return solved_press(design, deepest, mesh_mm).at(depth_mm)
