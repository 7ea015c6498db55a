"""A round pad's surface as that of a square one: followed to half its width, run out beyond.

The round pad that stands for a square one of the same area has its wall outside the square's, 1.13 half widths from the
axis, so its surface is still raised at half the width. Beyond lie the corners only; there the curve runs out to the
undisturbed height in a cubic that never crosses it. An independent solution in three dimensions tells the error
(docs/validation/walls.md): it is largest in the strip beside the walls, where the square pad is held down.

Between round walls the curve is followed to the nearest one, and runs out to the farthest.

All lengths in tip radii.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from sims.contact.library.surface_curve import TopCurve

LONGEST = math.sqrt(2.0) - 1.0
"""Longest stretch over which the curve runs out, over the half width [-]: to the corner of the square."""
POINTS = 16
"""Points of the stretch."""


def run_out(curve: TopCurve, half_width: float, length: float | None = None) -> TopCurve:
    """The curve to half the width of a square pad, then run out; as it is where it ends before.

    Parameters
    ----------
    curve : the top of a round pad
    half_width : of the square pad, or where else its own curve ends
    length : longest stretch over which it runs out; None: to the corner of the square
    """
    beyond = np.flatnonzero(curve.radius >= half_width)
    if beyond.size == 0:
        return curve
    first = int(beyond[0])
    around = slice(first - 1, first + 1)
    piece = CubicHermiteSpline(curve.radius[around], curve.height[around], np.tan(curve.inclination[around]))
    height, slope = float(piece(half_width)), float(piece(half_width, 1))
    length = LONGEST * half_width if length is None else length
    if height * slope < 0.0:
        length = min(length, -3.0 * height / slope)  # a longer cubic would cross the undisturbed height
    tail = CubicHermiteSpline([half_width, half_width + length], [height, 0.0], [slope, 0.0])
    radius = np.linspace(half_width, half_width + length, POINTS)
    return TopCurve(
        radius=np.append(curve.radius[:first], radius),
        height=np.append(curve.height[:first], tail(radius)),
        inclination=np.append(curve.inclination[:first], np.arctan(tail(radius, 1))),
        contact_radius=curve.contact_radius,
    )
