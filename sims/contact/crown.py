"""Geometry of a pad whose top is a spherical cap ("crown"), highest on the press axis. Lengths are in tip radii.

                 ___---.---___              top: z = -s(r), a sphere of radius 1/κ about the axis
            _--'       |      '--_          s(r) = r² κ / (1 + √(1 - κ² r²))
     wall  |           | H        |
           |           |          | rim     thickness t(r) = H - s(r)
    z=-H   +-----------+----------+         flat bottom
          -wall        0        wall

κ is the tip's radius over the crown's radius; 0 is flat. The formula for s(r) equals 1/κ - √(1/κ² - r²), but does not
lose digits where κ is small.
"""

from __future__ import annotations

import math

import numpy as np

from optopad.design.arrays import FloatArray
from optopad.design.errors import InputError, ModelScopeError
from optopad.design.rules.shape import LEAST_RIM_SHARE


def crown_drop(radius: FloatArray, crown: float) -> FloatArray:
    """Drop (...) of the undeformed crowned top below its apex, at radii (...) [tip radii].

    Parameters
    ----------
    radius : (...) distance from the axis, at most 1/crown [tip radii]
    crown : tip radius over the crown's radius [-]
    """
    bent = crown * np.asarray(radius, dtype=np.float64)
    return np.asarray(bent * radius / (1.0 + np.sqrt(1.0 - bent**2)), dtype=np.float64)


def crown_slope(radius: FloatArray, crown: float) -> FloatArray:
    """Slope (...) of `crown_drop` over the radius [-], at radii (...) below 1/crown [tip radii]."""
    bent = crown * np.asarray(radius, dtype=np.float64)
    return np.asarray(bent / np.sqrt(1.0 - bent**2), dtype=np.float64)


def require_rim(layer_depth: float, wall_radius: float, crown: float) -> None:
    """Refuse a crown that leaves the pad too thin at its rim.

    Parameters
    ----------
    layer_depth, wall_radius : thickness at the apex, radius of the wall [tip radii]
    crown : tip radius over the crown's radius [-]

    Raises
    ------
    InputError : the crown is not a finite number, or is negative
    ModelScopeError : the crown ends before the wall, or the rim is thinner than `LEAST_RIM_SHARE` of the apex
    """
    if not (math.isfinite(crown) and crown >= 0.0):
        raise InputError(
            f"crown: {crown:g} must be 0 (flat) or more, the tip's radius over the crown's: only convex tops are solved"
        )
    if crown * wall_radius >= 1.0:
        raise ModelScopeError(
            f"crown: a sphere of {1.0 / crown:.3f} tip radii ends before the wall at {wall_radius:.3f}; "
            "take a larger crown radius or a smaller pad"
        )
    rim = layer_depth - float(crown_drop(np.array(wall_radius), crown))
    least = LEAST_RIM_SHARE * layer_depth
    if rim < least:
        raise ModelScopeError(
            f"crown: {rim:.3f} tip radii are left at the rim, {least:.3f} are needed ({LEAST_RIM_SHARE:g} of the "
            "thickness at the apex); take a larger crown radius, a smaller pad or a thicker layer"
        )
