"""What near walls add to a centred press: a factor on the force and a field on the height.

The reference is a square pad of half width 16/3 tip radii, pressed in its middle. A pad whose walls are nearer to the
press axis, because the press is off-centre or the pad is small, is stiffer, and its surface is zero at those walls and
higher everywhere else: rubber keeps its volume. The correction is the difference, from three-dimensional MuJoCo
runs (`wall_runs`, `block`), of a pad with near walls and the same mesh with all walls at 16/3, so it is zero for
a centred press in a square pad of that half width. A wall farther than 16/3 has an effect too, of the other sign:
the reference is held down at 16/3, where such a pad is still raised. Beyond 8 tip radii nothing changes.
`solved_press` takes ratios of these factors, `pad_surface` builds on the reference.

Single walls are data, by layer depth, wall distance and press depth; several walls are superposed as stated in
`wall_superposition`. Force: F/F0 = 1 + Σ A_i σ_i, with σ_i what wall i alone adds and A_i its amplitude.

Interpolation is linear in the data: cubic splines in the logarithm of the layer depth and the reciprocal of the
wall distance (with zero slope at 8, where its effect ends), and over press depth relative to the
deepest one, in its root for the force, which like the contact radius starts as a root.

Out of range is refused by name: a wall nearer than 1.5 tip radii, a layer or press outside the contact model, walls
so near together that superposition has not been verified. Measured errors: `docs/validation/walls.md`.

Left out: the volume that rubber loses (Poisson's ratio is 0.495) and friction.
All lengths in tip radii unless a name says mm.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from design.errors import InputError, ModelScopeError
from design.rules.contact_scope import DEEPEST_PRESS, LARGEST_SHARE_OF_LAYER
from sims.contact.scope import HALF_WIDTH, tip_radius_mm
from sims.contact.walls.shape import BASE_START
from sims.contact.walls.stored import WallState, wall_data
from sims.contact.walls.superposition import (
    WallField,
    Walls,
    amplitudes,
    coupling,
    returned_share,
    wall_strength,
)

if TYPE_CHECKING:
    from design.spec import SensorDesign

FloatArray = NDArray[np.float64]
Rim = tuple[FloatArray, FloatArray]

LARGEST_RETURNED_SHARE = 0.45
"""Largest share of their effect that the walls may return to each other [-]; four walls at 8/3 tip radii, the nearest
that were compared with a run, return 0.4."""
_SIDES = ("west", "east", "south", "north")


@dataclass(frozen=True, kw_only=True)
class WallCorrection:
    """The correction for one place, layer and press depth; lengths in tip radii.

    Attributes
    ----------
    force_factor : force over that of the centred press [-]
    field : the change of the height; None where all walls are at 16/3
    notes : what the user should know
    """

    force_factor: float
    field: WallField | None
    notes: tuple[str, ...] = ()

    def height(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Change of the surface's height at places inside the pad.

        Parameters
        ----------
        x, y : shapes that broadcast, as (nx, 1) and (1, ny) for a grid, the cheapest; place relative to the press
            axis, east and north positive

        Returns
        -------
        the broadcast shape; zero inside the contact, minus the centred height at the walls
        """
        x, y = np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)
        if self.field is None:
            return np.zeros(np.broadcast(x, y).shape)
        if x.ndim != y.ndim:
            x, y = np.broadcast_arrays(x, y)
        return self.field.height(x, y)

    def azimuthal_mean(self, radius: FloatArray, directions: int = 48) -> FloatArray:
        """(n,) mean of the change over the part of each circle that lies inside the pad."""
        radius = np.asarray(radius, dtype=np.float64)
        if self.field is None:
            return np.zeros_like(radius)
        angle = 2.0 * np.pi * (np.arange(directions) + 0.5) / directions
        x, y = radius[:, None] * np.cos(angle), radius[:, None] * np.sin(angle)
        west, east, south, north = self.field.walls
        inside = (x >= -west) & (x <= east) & (y >= -south) & (y <= north)
        change = np.where(inside, self.height(x, y), 0.0).sum(axis=1)
        return np.asarray(change / np.maximum(inside.sum(axis=1), 1), dtype=np.float64)


NO_CORRECTION = WallCorrection(force_factor=1.0, field=None)
"""All walls at 16/3 tip radii, or an untouched pad."""


def _require(layer: float, depth: float, distances: Walls) -> None:
    """Refuse what the data does not cover."""
    data = wall_data()
    low, high = float(data.layers[0]), float(data.layers[-1])
    if not low - 1e-9 <= layer <= high + 1e-9:
        raise ModelScopeError(f"layer: {layer:g} tip radii; the wall correction covers {low:g} to {high:g}")
    deepest = deepest_press(layer)
    if not depth <= deepest * (1.0 + 1e-9):
        raise ModelScopeError(f"depth: {depth:g} tip radii; the wall correction covers up to {deepest:g}")
    for side, distance in zip(_SIDES, distances, strict=True):
        if not math.isfinite(distance):
            raise InputError(f"distances: {side} = {distance} must be a finite number of tip radii")
        if distance < data.nearest - 1e-9:
            raise ModelScopeError(
                f"distances: the {side} wall is {distance:.2f} tip radii from the press axis; the wall correction "
                f"covers {data.nearest:g} and more; press farther from it or use a smaller tip"
            )


def deepest_press(layer: float) -> float:
    """Deepest press that the correction covers [tip radii]."""
    return min(LARGEST_SHARE_OF_LAYER * layer, DEEPEST_PRESS)


def _base(rim: Rim) -> Callable[[FloatArray], FloatArray]:
    """Height of the centred press beyond `BASE_START`, zero from 16/3 on, from points of its curve."""
    radius, height = rim
    first = int(np.flatnonzero(radius < BASE_START)[-1]) if radius[0] < BASE_START else 0
    curve = PchipInterpolator(radius[first:], height[first:])
    return lambda at: np.where(at < HALF_WIDTH, curve(np.clip(at, BASE_START, HALF_WIDTH)), 0.0)


@dataclass(frozen=True)
class _Superposed:
    """The data at one layer and depth, and how the walls of one place add up."""

    walls: Walls
    state: WallState
    weights: list[FloatArray]
    force: FloatArray
    height: FloatArray

    def force_factor(self) -> float:
        added = np.array([weight @ self.state.force_ratio for weight in self.weights])
        return 1.0 + float(amplitudes(self.force) @ added)


def _superposed(layer: float, depth: float, distances: Walls) -> _Superposed | None:
    """What `wall_correction` says; None where nothing is to be corrected."""
    _require(layer, depth, distances)
    west, east, south, north = (min(distance, wall_data().farthest) for distance in distances)
    walls = (west, east, south, north)
    if depth <= 0.0 or all(abs(wall - HALF_WIDTH) < 1e-9 for wall in walls):
        return None
    state = wall_data().at(layer, depth / deepest_press(layer))
    force, height = (
        coupling(adjacent, facing, wall_strength(np.array(walls), wall_data().pair_distance))
        for adjacent, facing in state.couplings
    )
    returned = max(returned_share(force), returned_share(height))
    if returned > LARGEST_RETURNED_SHARE:
        places = ", ".join(f"{side} {wall:.2f}" for side, wall in zip(_SIDES, walls, strict=True))
        raise ModelScopeError(
            f"distances: walls at {places} tip radii are too near together for the wall correction (each round of "
            f"reflections returns {returned:.2f}, limit {LARGEST_RETURNED_SHARE}); use a larger pad or a smaller tip"
        )
    return _Superposed(walls, state, [wall_data().distance_weights(wall) for wall in walls], force, height)


@lru_cache(maxsize=4096)
def wall_force_factor(layer: float, depth: float, distances: Walls) -> float:
    """Force over that of the centred press [-], without the field; arguments and errors of `wall_correction`.

    Remembered: pairs, map and page ask for the same places and depths.
    """
    found = _superposed(layer, depth, distances)
    return 1.0 if found is None else found.force_factor()


def wall_correction(layer: float, depth: float, distances: Walls, rim: Rim | None = None) -> WallCorrection:
    """The correction of a centred press for near walls; all lengths in tip radii.

    Parameters
    ----------
    layer, depth : elastic depth of the layer, press depth
    distances : distances (west, east, south, north) of the walls from the press axis; those beyond 8 count as at 8
    rim : (radius, height), both (n,), of the centred press's curve outside the contact, the radius increasing from
        1.2 or less to 16/3; with it, corrected heights are zero at the walls exactly. By default that of the runs.

    Raises
    ------
    InputError : a distance that is no number
    ModelScopeError : outside the range of the data, or walls too near together
    """
    found = _superposed(layer, depth, distances)
    if found is None:
        return NO_CORRECTION
    state = found.state
    blocks = np.array(
        [
            size * (weight @ state.coefficients)
            for size, weight in zip(amplitudes(found.height), found.weights, strict=True)
        ]
    )
    field = WallField(
        walls=found.walls,
        coefficients=blocks.reshape(4, *state.block_shape),
        contact_radius=state.contact_radius,
        base=_base(rim if rim is not None else (state.rim_radii, state.rim)),
    )
    return WallCorrection(force_factor=found.force_factor(), field=field)


def walls_of(design: SensorDesign, at_mm: tuple[float, float] | None = None) -> Walls:
    """Distances (west, east, south, north) of a design's walls from a press axis [tip radii].

    Parameters
    ----------
    design : the sensor
    at_mm : (x, y) of the press axis in the cavity frame [mm]; None is the middle
    """
    radius, length, width = tip_radius_mm(design), design.cavity.length_mm, design.cavity.width_mm
    x, y = at_mm if at_mm is not None else (0.5 * length, 0.5 * width)
    return (x / radius, (length - x) / radius, y / radius, (width - y) / radius)
