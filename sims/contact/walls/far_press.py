"""A press seen from afar: loads on a linear layer that raise its top as the solved press does outside the dimple.

Model
-----
Beside the dimple strains are small, so the top there is that of a linear incompressible layer (`round_layer`) under
loads near the axis. Two of them, p(r) = 5 / (2 π w²) (1 - r²/w²)^(3/2) with w of `LOAD_RADII`, have any force and
spread. Their amplitudes are those that give the solved round pad's top from `START` beyond the contact to its wall, in
least squares. What they raise in a layer of another outline, less what they raise in the round pad, is what that
outline changes of the press: small, smooth, hence linear too (`surroundings`). Nothing is fitted to results in three
dimensions.

Lengths in tip radii, amplitudes in tip radii times the layer's shear modulus over it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.interpolate import CubicSpline, PchipInterpolator

from design.arrays import FloatArray
from sims.contact.walls.round_layer import LayerField, RoundLayer

Top = Callable[[float], tuple[FloatArray, FloatArray, float]]
"""Depth to (radius, height) of the top from the axis to the wall, and contact radius."""

LOAD_RADII = (0.75, 1.5)
"""Of one to four loads, 0.4 to 2.0 wide, two or more give the same surface in a pad within 1 µm rms (tip of 3 mm)."""
START = 0.6
"""How far beyond the contact, or the tip's radius, the linear layer is compared with the solved top."""
SAMPLES = 60
DEPTHS = 32
"""Depths at which amplitudes are found, even in their root: the nearest lie close, where amplitudes rise steeply."""
WIDE = 4.0
"""Radius over depth of a layer whose wall is felt nowhere [-]: what a load moves decays as exp(-2 r / depth)."""


@lru_cache(maxsize=32)
def load_fields(layer: float, wall: float) -> tuple[LayerField, ...]:
    """What each load does to a round layer of a depth, bonded at a radius."""
    solved = RoundLayer(layer, wall)
    return tuple(solved.field(_load(width)) for width in LOAD_RADII)


def wide_fields(layer: float) -> tuple[LayerField, ...]:
    """What each load does to a layer without walls."""
    return load_fields(layer, max(WIDE * layer, 3.0 * LOAD_RADII[-1]))


def _load(width: float) -> Callable[[FloatArray], FloatArray]:
    return lambda r: 2.5 / (np.pi * width**2) * np.maximum(1.0 - (r / width) ** 2, 0.0) ** 1.5


@dataclass(frozen=True, kw_only=True)
class FarPress:
    """Amplitudes of the loads at every depth.

    Attributes
    ----------
    layer, wall : depth of the layer, radius of the round pad's wall
    deepest : deepest press known; beyond it amplitudes go on in a straight line
    residual : (depth,) root mean square of the linear layer's top less the solved one where they are compared
    """

    layer: float
    wall: float
    deepest: float
    residual: FloatArray
    _by_root: CubicSpline

    def amplitudes(self, depth: float) -> FloatArray:
        """(load,) at a depth."""
        if depth <= 0.0:
            return np.zeros(len(LOAD_RADII))
        root = np.sqrt(min(depth, self.deepest))
        found = np.asarray(self._by_root(root), dtype=np.float64)
        if depth > self.deepest:
            found = found + (depth - self.deepest) * self._by_root(root, 1) / (2.0 * root)
        return np.asarray(found, dtype=np.float64)


def far_press(layer: float, wall: float, deepest: float, top: Top) -> FarPress:
    """The loads of a family of presses into a round pad.

    Parameters
    ----------
    layer, wall, deepest : depth of the layer, radius of the wall, deepest press
    top : of the solved presses
    """
    roots = np.sqrt(deepest) * np.arange(1, DEPTHS + 1) / DEPTHS
    fields = load_fields(layer, wall)
    rows = [_matched(fields, *top(float(root**2))) for root in roots]
    amplitudes = np.concatenate([np.zeros((1, len(LOAD_RADII))), [row for row, _ in rows]])
    return FarPress(
        layer=layer,
        wall=wall,
        deepest=deepest,
        residual=np.array([residual for _, residual in rows]),
        _by_root=CubicSpline(np.append(0.0, roots), amplitudes),
    )


def _matched(
    fields: tuple[LayerField, ...], radius: FloatArray, height: FloatArray, contact: float
) -> tuple[FloatArray, float]:
    """Amplitudes (load,) that give a top, and the root mean square of what is left."""
    places = np.linspace(max(contact, 1.0) + START, fields[0].wall, SAMPLES)
    wanted = PchipInterpolator(radius, height)(places)
    columns = np.stack([field.top_at(places) for field in fields], axis=1)
    found, *_ = np.linalg.lstsq(columns, wanted, rcond=None)
    return np.asarray(found, dtype=np.float64), float(np.sqrt(np.mean((columns @ found - wanted) ** 2)))
