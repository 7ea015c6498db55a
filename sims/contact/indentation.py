"""The press of a design's tip into its pad: depth in, surface, force and contact radius out.

A press belongs to one elastic depth over tip radius. It is taken from the shipped library (or solved live, where
a mesh is asked for) and scaled: lengths with the tip radius R, force with E R² (a frictionless neo-Hookean
layer has no other length or force). A rectangular pad is taken for the round one of its area (`scope.round_radius`);
another place, or pad, than the middle of its square changes the force by the ratio that walls make (`walls`).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache

from design.errors import DesignError, InputError, ModelScopeError
from design.spec import SensorDesign
from design.spec.properties import youngs_modulus_mpa
from sims.contact.library.live_press import live_note, live_press, mesh_size
from sims.contact.library.profile_library import shipped_library
from sims.contact.library.profiles import UnitPress
from sims.contact.library.smooth_press import SmoothPress
from sims.contact.library.solved_press import SolvedPress
from sims.contact.scope import (
    FIRST_DEPTHS,
    LARGEST_ASPECT,
    WALL_RADIUS_RANGE,
    depth_limit_mm,
    elastic_depth_mm,
    half_width_of,
    layer_depth,
    require_depth,
    round_radius,
    tip_radius_mm,
    wall_radius,
)
from sims.contact.tip import HEMISPHERE, tip_of
from sims.contact.walls.near_walls import wall_correction, walls_of
from sims.contact.walls.superposition import Walls
from sims.press.indentation import Indentation

__all__ = [
    "depth_limit_mm",
    "elastic_depth_mm",
    "indent",
    "modulus_mpa",
    "solved_press",
]


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


def is_in_library(design: SensorDesign) -> bool:
    """Whether the shipped library has the presses of a design: a hemisphere, a layer within its entries."""
    return tip_of(design.indenter) == HEMISPHERE and shipped_library().covers(round(layer_depth(design), 9))


@lru_cache(maxsize=64)
def _library_press(layer: float, wall: float) -> SmoothPress:
    """The library's presses of a layer in a round pad; designs that differ elsewhere share them."""
    return shipped_library().press(layer, wall)


def solved_press(
    design: SensorDesign,
    max_depth_mm: float | None = None,
    mesh_mm: float | None = None,
    on_step: Callable[[float], None] | None = None,
    *,
    at_mm: tuple[float, float] | None = None,
) -> SolvedPress:
    """The press of a design's tip into its pad, down to a depth or deeper.

    Parameters
    ----------
    design : the sensor
    max_depth_mm : deepest press wanted, by default that of the design's range of use [mm]
    mesh_mm : node spacing under the tip [mm]; a value solves anew. None takes the shipped library, which has
        hemispheres and layers of 1.3 to 6 tip radii; others are solved with a tenth of the tip radius.
    on_step : called with the fraction done while solving
    at_mm : (x, y) of the press axis in the cavity frame [mm]; None is the middle. It changes the force and the
        correction for walls; the curve is that of the centred press.

    Raises
    ------
    DesignError, InputError : a value that is no positive number
    ModelScopeError : a layer, depth or (with `at_mm`) place outside the model
    """
    name = "operating.max_depth_mm" if max_depth_mm is None else "max_depth_mm"
    wanted = design.operating.max_depth_mm if max_depth_mm is None else max_depth_mm
    radius, layer, modulus = tip_radius_mm(design), round(layer_depth(design), 9), modulus_mpa(design)
    deepest = require_depth(design, wanted, name) / radius
    walls, notes = _walls(design, layer, at_mm)
    notes += pad_notes(design)
    unit: UnitPress | None = None
    if mesh_mm is None and is_in_library(design):
        smooth = _library_press(layer, round(wall_radius(design), 9))
    else:
        unit, smooth, told = live_press(design, mesh_size(design, mesh_mm), deepest, on_step)
        notes += (live_note(design, mesh_mm), *told)
    return SolvedPress(
        smooth=smooth,
        unit=unit,
        tip_radius_mm=radius,
        youngs_modulus_mpa=modulus,
        walls=walls,
        notes=notes,
    )


def _walls(
    design: SensorDesign, layer: float, at_mm: tuple[float, float] | None
) -> tuple[Walls | None, tuple[str, ...]]:
    """Distances of the walls [tip radii], None in the middle of a pad that the correction does not cover; notes.

    At a place that was asked for, the correction itself refuses what it does not cover.
    """
    walls = walls_of(design, at_mm)
    reason = None if at_mm is not None else _uncovered(layer, walls)
    if reason is None:
        return walls, ()
    half = half_width_of(wall_radius(design))
    return None, (f"walls: forces are those of walls at {half:.2f} tip radii, too low here ({reason})",)


@lru_cache(maxsize=64)
def _uncovered(layer: float, walls: Walls) -> str | None:
    """Why the wall correction does not cover a place, or None."""
    try:
        wall_correction(layer, FIRST_DEPTHS[0], walls)
    except ModelScopeError as err:
        return str(err)
    return None


def pad_notes(design: SensorDesign) -> tuple[str, ...]:
    """That a pad is smaller than the smallest solved one, or too oblong to be taken for a round one."""
    cavity, tip, (smallest, largest) = design.cavity, tip_radius_mm(design), WALL_RADIUS_RANGE
    short, long = sorted((cavity.length_mm, cavity.width_mm))
    notes: tuple[str, ...] = ()
    if long > LARGEST_ASPECT * short and short < 2.0 * half_width_of(largest * tip):
        notes = (
            f"pad: {cavity.length_mm:g} x {cavity.width_mm:g} mm is pressed as the round pad of its area, which was "
            f"compared with square pads only (here {long / short:.2f} to 1, noted from {LARGEST_ASPECT}): along the "
            "near walls the surface stands too high, beside the tip too low",
        )
    if round_radius(short, long) >= (smallest - 1e-9) * tip:
        return notes
    side = 2.0 * half_width_of(smallest * tip)
    return (
        *notes,
        f"pad: {cavity.length_mm:g} x {cavity.width_mm:g} mm is less than the contact model has solved for this tip; "
        f"the surface is that of a pad of {side:.1f} x {side:.1f} mm, so it rises too little; make the pad larger or "
        "use a smaller tip",
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
    at_mm : (x, y) of the press axis in the cavity frame [mm]; None is the middle. The force is that of the
        place, the curve that of the centred press: `pad_surface` has what the walls change of it.
    mesh_mm : node spacing under the tip [mm]; a value solves anew, see `solved_press`

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
    return solved_press(design, deepest, mesh_mm, at_mm=at_mm).at(depth_mm)
