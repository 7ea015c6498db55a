"""A crown, pressed by one tip or untouched: a sum of heights in the frame of the press, and rays in that frame.

The third axis of the frame is the crown's normal where the press goes in (`PadForm.press_frame`). A ray is turned into
the frame, and the normal of what it meets is turned back; a distance is the same in both.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from numba import njit

from design.arrays import FloatArray
from sims.optics.oracle.heights import SummedSurface, crown_fall
from sims.optics.oracle.march import is_under_sum, summed_hit


class CrownedTop(NamedTuple):
    """A crown, pressed or not.

    Attributes
    ----------
    origin : (3,) of the frame: where the press goes in, or the apex [mm]
    axes : (3, 3) of the frame, a row each [-]
    heights : the top above the frame's first two axes, along its third; tips and solids are in the frame, too
    """

    origin: FloatArray
    axes: FloatArray
    heights: SummedSurface


@njit()
def in_frame(top: CrownedTop, x: float, y: float, z: float) -> tuple[float, float, float]:
    """A place in the frame."""
    px, py, pz = x - top.origin[0], y - top.origin[1], z - top.origin[2]
    return turned(top, px, py, pz)


@njit()
def turned(top: CrownedTop, vx: float, vy: float, vz: float) -> tuple[float, float, float]:
    """A vector in the frame."""
    a = top.axes
    return (
        a[0, 0] * vx + a[0, 1] * vy + a[0, 2] * vz,
        a[1, 0] * vx + a[1, 1] * vy + a[1, 2] * vz,
        a[2, 0] * vx + a[2, 1] * vy + a[2, 2] * vz,
    )


@njit()
def turned_back(top: CrownedTop, vx: float, vy: float, vz: float) -> tuple[float, float, float]:
    """A vector of the frame in the cavity."""
    a = top.axes
    return (
        a[0, 0] * vx + a[1, 0] * vy + a[2, 0] * vz,
        a[0, 1] * vx + a[1, 1] * vy + a[2, 1] * vz,
        a[0, 2] * vx + a[1, 2] * vy + a[2, 2] * vz,
    )


@njit()
def is_under_crown(top: CrownedTop, x: float, y: float, z: float) -> bool:
    """Whether a place of the cavity lies in the elastomer."""
    u, v, w = in_frame(top, x, y, z)
    return is_under_sum(top.heights, u, v, w)


@njit()
def crowned_hit(
    top: CrownedTop,
    side: float,
    x: float,
    y: float,
    z: float,
    dx: float,
    dy: float,
    dz: float,
    limit: float,
) -> tuple[float, int, float, float, float]:
    """First place nearer than `limit` where a ray meets the top; as `summed_hit`, but all in the cavity's axes."""
    u, v, w = in_frame(top, x, y, z)
    du, dv, dw = turned(top, dx, dy, dz)
    distance, what, nu, nv, nw = summed_hit(top.heights, side, u, v, w, du, dv, dw, limit)
    nx, ny, nz = turned_back(top, nu, nv, nw)
    return distance, what, nx, ny, nz


@njit()
def is_crown_steep(
    top: CrownedTop, slope: float, x: float, y: float, z: float, nx: float, ny: float, nz: float
) -> bool:
    """Whether press and field slope by more than `slope` [-] at a place of the top with a unit normal out of it.

    The normal's slope in the frame less that of the crown.
    """
    u, v, _ = in_frame(top, x, y, z)
    nu, nv, nw = turned(top, nx, ny, nz)
    if nw <= 0.0:
        return True
    s = top.heights
    _, steepness = crown_fall(s.crown_radius, s.crown_along * u * u + v * v)
    return math.hypot(steepness * s.crown_along * u - nu / nw, steepness * v - nv / nw) > slope
