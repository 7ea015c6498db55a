"""Unit conversions at the edge of the specification; everywhere else one unit per quantity holds.

Lengths mm, angles degrees, forces N, moduli MPa.
"""

from __future__ import annotations

import math

ROUNDING_MM = 1e-9
"""Sums of decimal lengths come out this exact; a length that equals its limit is within it."""

MM_PER_CM = 10.0
NM_PER_UM = 1000.0

ORDER_DIGITS = 12


def absorption_per_mm(absorption_db_per_cm: float) -> float:
    """Natural-log absorption coefficient [1/mm] of a loss given in dB/cm.

    Notes
    -----
    10^(-dB/10) = exp(-a L), so a = ln(10)/10 per dB.
    """
    return absorption_db_per_cm * math.log(10.0) / 10.0 / MM_PER_CM


def lambertian_order(half_angle_deg: float) -> float:
    """Order m of the intensity law cos^m that falls to one half at ``half_angle_deg`` [-].

    Rounded far below any sheet's precision, so that 60 degrees is order 1 itself and not its neighbour: light kernels
    know that one.
    """
    return round(math.log(0.5) / math.log(math.cos(math.radians(half_angle_deg))), ORDER_DIGITS)
