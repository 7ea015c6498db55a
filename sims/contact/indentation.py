"""The press of a design's tip into its pad: depth in, surface, force and contact radius out.

A solution belongs to one elastic depth over tip radius. It is solved once, kept in this process and
on disk, and scaled: lengths with the tip radius R, force with E R² (a frictionless neo-Hookean layer
has no other length or force). The bonded wall is always 16/3 R away; `wall_note` says when the real
walls are nearer. Off-centre presses have the centred shape in this version.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from importlib.metadata import version

from design.errors import DesignError, InputError
from design.properties import youngs_modulus_mpa
from design.spec import SensorDesign
from sims.contact.mesh_error import mesh_note
from sims.contact.profiles import SolvedPress, UnitPress
from sims.contact.scope import (
    depth_limit_mm,
    elastic_depth_mm,
    layer_depth,
    require_depth,
    solved_depths,
    tip_radius_mm,
    wall_note,
)
from sims.contact.store import entry_key, read_entry, write_entry
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

RECIPE = 8
"""Version of the solver behind stored solutions. Raise it when results change."""
DEFAULT_MESH = 0.1
"""Node spacing under the tip [tip radii]: 0.3 mm for a 3 mm tip."""
MESH_RANGE = (0.04, 0.15)
"""Spacings that are accepted [tip radii]; coarser facets bridge the equator of the tip and lose the contact
edge, finer ones may chatter at deep presses (which is refused, not hidden)."""

_SOLVED: dict[str, UnitPress] = {}
"""Solutions of this process by key; each is a pure function of its key."""


@cache
def _mujoco_version() -> str:
    """Looked up once: the installed package's record is read from disk."""
    return version("mujoco")


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


def _solve(
    layer: float, mesh_size: float, depths: tuple[float, ...], on_step: Callable[[float], None] | None
) -> UnitPress:
    """Run MuJoCo; imported here so that stored solutions need no solver."""
    from sims.contact.unit_press import solve_unit_press

    return solve_unit_press(layer, mesh_size, depths, on_step)


def _unit_press(
    layer: float, mesh_size: float, deepest: float, on_step: Callable[[float], None] | None
) -> tuple[UnitPress, tuple[str, ...]]:
    """From this process, from disk, or solved and stored; with notes."""
    layer, mesh_size = round(layer, 9), round(mesh_size, 9)
    depths = tuple(round(float(depth), 9) for depth in solved_depths(layer, deepest))
    inputs = {
        "layer": layer,
        "mesh": mesh_size,
        "depths": depths,
        "recipe": RECIPE,
        "mujoco": _mujoco_version(),
    }
    key = entry_key(inputs)
    notes: tuple[str, ...] = ()
    if key not in _SOLVED:
        press = read_entry(key)
        if press is None:
            press = _solve(layer, mesh_size, depths, on_step)
            note = write_entry(key, press)
            notes = (note,) if note else ()
        _SOLVED[key] = press
    return _SOLVED[key], notes


def solved_press(
    design: SensorDesign,
    max_depth_mm: float | None = None,
    mesh_mm: float | None = None,
    on_step: Callable[[float], None] | None = None,
) -> SolvedPress:
    """The solved press of a design's tip into its pad, down to a depth.

    Parameters
    ----------
    design : the sensor
    max_depth_mm : deepest press, by default that of the design's range of use [mm]
    mesh_mm : node spacing under the tip, by default a tenth of the tip radius [mm]
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
    unit, notes = _unit_press(layer, _mesh_size(design, mesh_mm), deepest, on_step)
    return SolvedPress(unit=unit, tip_radius_mm=radius, youngs_modulus_mpa=modulus, notes=notes)


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
    mesh_mm : node spacing under the tip, by default a tenth of the tip radius [mm]

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
