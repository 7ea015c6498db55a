"""The height correction of several walls from that of single ones; all lengths in tip radii.

With z the height of the centred press, P_i u the value of u at wall i carried inwards by `fade`, f_i the rest
of wall i's own effect (zero at that wall) and A_i its amplitude (1 where no other wall is near):

    dz = g · [ (1 - Pw - Pe)(1 - Ps - Pn) z - z + (1 - Qw - Qe)(1 - Qs - Qn) Σ A_i f_i ]

The first part takes the height at every wall to zero and nothing more; Q is P with half the reach. z + dz is
zero at every wall exactly, also in the corners, and one wall alone gives back its own fit, z - P z + f.

Amplitudes: a wall acts on what the press sends to it, and the others return some of it,
A_i = 1 + Σ_j M_ij A_j with M_ij = c_ij s_j: c from pads with two equal walls (that meet, or face each other) at a
distance D_0, one c for the force and one for the height; s_j how much of that wall j returns: 1 at D_0, 0 at 16/3,

    s = (1/D - 3/16) / (1/D_0 - 3/16)

Two facing walls at 3.4 tip radii returned 0.45 of those at D_0 = 2.4, for which this says 0.47.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sims.contact.scope import HALF_WIDTH
from sims.contact.walls.shape import across_basis, along_basis, contact_window, fade

FloatArray = NDArray[np.float64]
HeightField = Callable[[FloatArray, FloatArray], FloatArray]
Walls = tuple[float, float, float, float]

REST_REACH = 0.5
"""Reach over wall distance at which the walls' fields are taken to zero at other walls [-]; the one of 0.2 to 1 that
suits pads with two to four walls at 8/3 tip radii best."""
ADJACENT = np.array([[0, 0, 1, 1], [0, 0, 1, 1], [1, 1, 0, 0], [1, 1, 0, 0]], dtype=np.float64)
"""Which of west, east, south, north meet in a corner."""
OPPOSITE = np.array([[0, 1, 0, 0], [1, 0, 0, 0], [0, 0, 0, 1], [0, 0, 1, 0]], dtype=np.float64)
"""Which of them face each other."""


def wall_strength(distance: FloatArray, pair_distance: float) -> FloatArray:
    """s for walls at distances (n,), from D_0."""
    far = 1.0 / HALF_WIDTH
    return np.asarray((1.0 / distance - far) / (1.0 / pair_distance - far), dtype=np.float64)


def coupling(adjacent: float, opposite: float, strength: FloatArray) -> FloatArray:
    """(4, 4) M_ij, from the two couplings and each wall's strength s_j (4,)."""
    return np.asarray((adjacent * ADJACENT + opposite * OPPOSITE) * strength, dtype=np.float64)


def amplitudes(matrix: FloatArray) -> FloatArray:
    """(4,) A with A = 1 + M A."""
    return np.asarray(np.linalg.solve(np.eye(4) - matrix, np.ones(4)), dtype=np.float64)


def returned_share(matrix: FloatArray) -> float:
    """Largest eigenvalue of M by size: what one more round of reflections adds relative to the last."""
    return float(np.abs(np.linalg.eigvals(matrix)).max())


@dataclass(frozen=True, kw_only=True)
class WallField:
    """The correction of the height for one place and depth; lengths in tip radii.

    Attributes
    ----------
    walls : distances (west, east, south, north)
    coefficients : (4, ACROSS_COUNT, ALONG_COUNT) amplitude times spline coefficients of each wall
    contact_radius : radius of the contact
    base : height of the centred press at a radius beyond 1.3; zero from 16/3 on
    """

    walls: Walls
    coefficients: FloatArray
    contact_radius: float
    base: Callable[[FloatArray], FloatArray]

    def _moved(self) -> tuple[bool, ...]:
        return tuple(abs(wall - HALF_WIDTH) > 1e-9 for wall in self.walls)

    def _rest(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Σ A_i f_i; each f_i is a sum of products of functions of x and of y, so a grid costs little."""
        total = np.zeros(np.broadcast(x, y).shape)
        frames = ((x, y), (-x, y), (y, x), (-y, x))
        for moved, wall, block, (across, along) in zip(
            self._moved(), self.walls, self.coefficients, frames, strict=True
        ):
            if moved:
                crossing = (across_basis(across.ravel(), wall) @ block).reshape(*across.shape, -1)
                beside = along_basis(along.ravel()).reshape(*along.shape, -1)
                total += np.einsum("...k,...k->...", crossing, beside)
        return total

    def _centred(self, x: FloatArray, y: FloatArray) -> FloatArray:
        return self.base(np.hypot(x, y))

    def _carried(self, field: HeightField, x: FloatArray, y: FloatArray, reach: float) -> FloatArray:
        """(1 - Pw - Pe)(1 - Ps - Pn) u - u."""
        west, east, south, north = self.walls
        sides_x = ((-west, fade(x + west, reach * west)), (east, fade(east - x, reach * east)))
        sides_y = ((-south, fade(y + south, reach * south)), (north, fade(north - y, reach * north)))
        moved = self._moved()
        along_x = [side for side, is_moved in zip(sides_x, moved[:2], strict=True) if is_moved]
        along_y = [side for side, is_moved in zip(sides_y, moved[2:], strict=True) if is_moved]
        total = np.zeros(np.broadcast(x, y).shape)
        one = (1,) * total.ndim
        for place, weight in along_x:
            total -= weight * field(np.full(one, place), y)
        for place, weight in along_y:
            total -= weight * field(x, np.full(one, place))
        for place, weight in along_x:
            for other, other_weight in along_y:
                corner = field(np.full(one, place), np.full(one, other))
                total += weight * other_weight * corner
        return total

    def height(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """What the walls add to the height at places inside the pad, from the press axis; shapes that broadcast."""
        window = contact_window(np.hypot(x, y), self.contact_radius)
        change = self._carried(self._centred, x, y, 1.0) + self._rest(x, y)
        if sum(self._moved()) > 1:
            change += self._carried(self._rest, x, y, REST_REACH)
        return np.asarray(window * change, dtype=np.float64)
