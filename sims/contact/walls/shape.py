"""The functions that the wall correction is made of; all lengths in tip radii.

One near wall, to the west at distance D of the press axis; x across it, y along it; b = 16/3 where walls are
bonded in the reference. Three pieces, each C1:

* `contact_window` g: 0 inside the contact, where the tip is exact, to 1 at `WINDOW_WIDTH` beyond its edge;
* `fade` e(s) = (1 - s/D)² to s = D: carries the height that the reference has at the wall's place inwards;
* a tensor of cubic B-splines in ξ(x) and |y|/b, zero at the near wall and at b, even in y.

ξ stretches the side of the wall so that the wall lies at -1 and the axis at 0 for every D, near or far; its slope
at the axis is that of the other side, so the field is C1 there:

    ξ = x / (b + (b/D - 1) x)  for x < 0,   x / b  otherwise
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sims.contact.scope import HALF_WIDTH

FloatArray = NDArray[np.float64]

ACROSS_CELLS, ALONG_CELLS = 14, 7
"""Cells of the splines across the wall, over both sides of the axis, and along it, over one side."""
ACROSS_COUNT, ALONG_COUNT = ACROSS_CELLS + 1, ALONG_CELLS + 1
"""Coefficients across and along."""
BASE_START = 1.2
"""Radius from which the height of the centred press is used [tip radii]: beyond any contact, nearer than any wall."""
RIM_RADII = np.linspace(BASE_START, HALF_WIDTH, 32)
"""Radii of the stored height of the centred press."""
WINDOW_WIDTH = 0.2
"""Over what distance from the contact edge the correction sets in [tip radii]."""


def wall_coordinate(x: FloatArray, distance: float) -> FloatArray:
    """ξ(x): -1 at the wall, 0 on the axis, 1 at 16/3 tip radii on the other side."""
    stretch = HALF_WIDTH / distance - 1.0
    inside = np.maximum(x, -distance)
    return np.asarray(inside / (HALF_WIDTH + stretch * np.minimum(inside, 0.0)), dtype=np.float64)


def _cubic(t: FloatArray) -> FloatArray:
    """Cardinal cubic B-spline, centred at 0 with support (-2, 2)."""
    inner, outer = np.maximum(1.0 - np.abs(t), 0.0), np.maximum(2.0 - np.abs(t), 0.0)
    return np.asarray((outer**3 - 4.0 * inner**3) / 6.0, dtype=np.float64)


def across_basis(x: FloatArray, distance: float) -> FloatArray:
    """(n, ACROSS_COUNT) splines across the wall; 0 at the wall, at 16/3 and beyond."""
    t = 0.5 * ACROSS_CELLS * (wall_coordinate(x, distance) + 1.0)
    raw = _cubic(t[:, None] - np.arange(-1, ACROSS_CELLS + 2))
    basis = raw[:, 1:-1].copy()
    basis[:, 0] -= 4.0 * raw[:, 0]
    basis[:, 1] -= raw[:, 0]
    basis[:, -1] -= 4.0 * raw[:, -1]
    basis[:, -2] -= raw[:, -1]
    basis[(t <= 0.0) | (t >= ACROSS_CELLS)] = 0.0
    return basis


def along_basis(y: FloatArray) -> FloatArray:
    """(n, ALONG_COUNT) splines along the wall, even in y; 0 at 16/3 and beyond."""
    t = ALONG_CELLS * np.abs(y) / HALF_WIDTH
    raw = _cubic(t[:, None] - np.arange(-1, ALONG_CELLS + 2))
    basis = raw[:, 1:-1].copy()
    basis[:, 1] += raw[:, 0]
    basis[:, -1] -= 4.0 * raw[:, -1]
    basis[:, -2] -= raw[:, -1]
    basis[t >= ALONG_CELLS] = 0.0
    return basis


def contact_window(radius: FloatArray, contact_radius: float) -> FloatArray:
    """0 inside the contact, 1 at `WINDOW_WIDTH` beyond it and further out."""
    t = np.clip((radius - contact_radius) / WINDOW_WIDTH, 0.0, 1.0)
    return np.asarray(t * t * (3.0 - 2.0 * t), dtype=np.float64)


def fade(from_wall: FloatArray, distance: float) -> FloatArray:
    """1 at the wall, 0 at the axis and beyond."""
    return np.asarray(np.maximum(1.0 - from_wall / distance, 0.0) ** 2, dtype=np.float64)
