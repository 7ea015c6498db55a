"""What a smooth border between two media does to a ray: Fresnel's and Snell's laws.

Unpolarised light at each meeting (Born & Wolf, Principles of Optics, § 1.5). `ratio` is the index on the ray's side
over the index behind the border; above 1 reflection is total beyond the critical angle.
"""

from __future__ import annotations

import math

from numba import njit


@njit()
def fresnel_reflectance(cosine: float, ratio: float) -> float:
    """Share of unpolarised light that a border reflects.

    cosine : of the angle of incidence [-]; ratio : index here over index behind [-].
    """
    refracted = 1.0 - ratio * ratio * (1.0 - cosine * cosine)
    if refracted <= 0.0:
        return 1.0
    out = math.sqrt(refracted)
    across = (ratio * cosine - out) / (ratio * cosine + out)
    within = (cosine - ratio * out) / (cosine + ratio * out)
    return 0.5 * (across * across + within * within)


@njit()
def refracted_direction(
    dx: float, dy: float, dz: float, nx: float, ny: float, nz: float, ratio: float
) -> tuple[float, float, float]:
    """Direction behind a border, for light that is not totally reflected (Snell's law).

    Parameters
    ----------
    dx, dy, dz : unit direction before [-]
    nx, ny, nz : unit normal that points to the far side [-]
    ratio : index here over index behind [-]
    """
    cosine = dx * nx + dy * ny + dz * nz
    turn = math.sqrt(max(1.0 - ratio * ratio * (1.0 - cosine * cosine), 0.0)) - ratio * cosine
    ex, ey, ez = ratio * dx + turn * nx, ratio * dy + turn * ny, ratio * dz + turn * nz
    size = math.sqrt(ex * ex + ey * ey + ez * ez)
    return ex / size, ey / size, ez / size
