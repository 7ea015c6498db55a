"""The pressed top as a mesh for a picture: rings around the press axis, drawn out to the pad's own outline."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from design.spec import SensorDesign
from sims.contact.pad_surface import PadSurface, curve_height_mm, pad_surface

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

SPOKES, RINGS = 72, 28
REST_MM = 0.5
"""Nodes of the smooth rest of the height: straight between them it is off by 0.01 mm at most, near the contact."""


def pressed_top(
    design: SensorDesign, place_mm: tuple[float, float], depth_mm: float
) -> tuple[FloatArray, IntArray, PadSurface | None]:
    """Points (n, 3) [mm] and triangles (m, 3) of the top in the cavity frame, and the surface; None where untouched.

    Raises
    ------
    ModelScopeError : a press that the contact model does not cover.
    """
    size = (design.cavity.length_mm, design.cavity.width_mm)
    angles = _angles(size, place_mm)
    reach = _reach(size, place_mm, angles)
    surface = pad_surface(design, depth_mm, place_mm) if depth_mm > 0 else None
    tip = design.indenter.tip_radius_mm
    radii = _radii(surface, tip, float(reach.max()))
    at = np.minimum(radii[:, None], reach[None, :])
    x = np.clip(place_mm[0] + at * np.cos(angles), 0.0, size[0])
    y = np.clip(place_mm[1] + at * np.sin(angles), 0.0, size[1])
    height = np.zeros_like(x) if surface is None else _height(surface, at, x, y)
    points = np.stack([x, y, design.cavity.clear_thickness_mm + height], axis=-1).reshape(-1, 3)
    return points, _triangles(len(radii), len(angles)), surface


def _height(surface: PadSurface, radius: FloatArray, x_mm: FloatArray, y_mm: FloatArray) -> FloatArray:
    """The curve around the axis, and outside the contact the smooth rest between its own nodes."""
    near = curve_height_mm(surface.near, radius)
    lines = [np.linspace(0.0, size, math.ceil(size / REST_MM) + 1) for size in surface.size_mm]
    rest = surface.beside_mm(*lines)
    cells = [len(line) - 1 for line in lines]
    column = np.clip(x_mm / surface.size_mm[0] * cells[0], 0, cells[0] - 1e-9)
    row = np.clip(y_mm / surface.size_mm[1] * cells[1], 0, cells[1] - 1e-9)
    i, j = column.astype(int), row.astype(int)
    u, v = column - i, row - j
    beside = (
        rest[i, j] * (1 - u) * (1 - v)
        + rest[i + 1, j] * u * (1 - v)
        + rest[i, j + 1] * (1 - u) * v
        + rest[i + 1, j + 1] * u * v
    )
    return near + np.where(radius <= surface.near.contact_radius_mm, 0.0, beside)


def _angles(size_mm: tuple[float, float], place_mm: tuple[float, float]) -> FloatArray:
    """Even angles, with those of the corners among them."""
    corners = [
        np.arctan2(y - place_mm[1], x - place_mm[0]) for x in (0.0, size_mm[0]) for y in (0.0, size_mm[1])
    ]
    even = np.linspace(-np.pi, np.pi, SPOKES, endpoint=False)
    return np.unique(np.round(np.concatenate([even, corners]), 9))


def _reach(size_mm: tuple[float, float], place_mm: tuple[float, float], angles: FloatArray) -> FloatArray:
    """(angle,) distance from the press axis to the pad's side [mm]."""
    cos, sin = np.cos(angles), np.sin(angles)
    with np.errstate(divide="ignore"):
        along = np.where(
            cos > 0, (size_mm[0] - place_mm[0]) / cos, -place_mm[0] / np.where(cos == 0, 1.0, cos)
        )
        across = np.where(
            sin > 0, (size_mm[1] - place_mm[1]) / sin, -place_mm[1] / np.where(sin == 0, 1.0, sin)
        )
    along = np.where(np.abs(cos) < 1e-12, np.inf, along)
    across = np.where(np.abs(sin) < 1e-12, np.inf, across)
    return np.asarray(np.minimum(along, across), dtype=np.float64)


def _radii(surface: PadSurface | None, tip_mm: float, farthest_mm: float) -> FloatArray:
    """Rings: dense under and beside the tip, wide beyond; the last beyond every corner [mm]."""
    edge = tip_mm if surface is None else max(surface.near.contact_radius_mm, 0.3 * tip_mm)
    near = np.linspace(0.0, edge, RINGS // 3)
    beside = edge + np.linspace(0.0, 2.0 * tip_mm, RINGS // 2)[1:]
    beyond = np.linspace(beside[-1], max(farthest_mm, beside[-1] + tip_mm), RINGS // 4)[1:]
    return np.concatenate([near, beside, beyond])


def _triangles(rings: int, spokes: int) -> IntArray:
    """Two triangles for every cell between rings and spokes, seen from above counter-clockwise."""
    ring, spoke = (a.ravel() for a in np.meshgrid(np.arange(rings - 1), np.arange(spokes), indexing="ij"))
    after = (spoke + 1) % spokes
    a, b = ring * spokes + spoke, ring * spokes + after
    c, d = (ring + 1) * spokes + spoke, (ring + 1) * spokes + after
    return np.concatenate([np.stack([a, c, d], axis=1), np.stack([a, d, b], axis=1)]).astype(np.int64)
