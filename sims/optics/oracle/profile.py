"""One press's curve, checked and divided into what is tip and what is free, as the oracle reads it.

Under a hemisphere the contact is an exact sphere, and above its equator (a press deeper than the tip radius) the
cylindrical shank up to the last point of the curve that is no farther out than the contact radius. Under another
tip the curve itself is the tip up to that point. The free curve starts where the contact ends.
"""

from __future__ import annotations

import math

import numpy as np

from design.arrays import FloatArray
from design.errors import InputError
from sims.press import Indentation

SEAM_MM = 1e-6
"""Overlap of neighbouring pieces of a surface [mm], so that no ray slips through a seam; points nearer are one."""
TIP_MISMATCH_MM = 0.1
"""Largest distance between the end of the contact on the curve and the tip [mm]: mesh and penetration."""


def check_indentation(press: Indentation, top_mm: float, where: str) -> None:
    """Refuse a press whose profile cannot be a pad's surface.

    top_mm : height of the undisturbed surface [mm]; where : what to call the press in messages.
    """
    radius, height = np.asarray(press.radius_mm, float), np.asarray(press.height_mm, float)
    scalars = (press.depth_mm, press.tip_radius_mm, press.contact_radius_mm)
    if radius.ndim != 1 or radius.shape != height.shape or radius.size < 2:
        raise InputError(
            f"{where}: radius_mm {radius.shape} and height_mm {height.shape} must be two lists of the same"
            " length, at least 2 points"
        )
    if not (np.isfinite(radius).all() and np.isfinite(height).all() and np.isfinite(scalars).all()):
        raise InputError(f"{where}: the profile holds NaN or infinity; solve the contact again")
    if radius.min() < 0.0:
        raise InputError(f"{where}: radius_mm {radius.min():g} is negative; a radius is a distance")
    if radius[0] > SEAM_MM:
        raise InputError(f"{where}: the curve starts at radius {radius[0]:g} mm; it must start at 0")
    if radius[-1] < radius.max():
        raise InputError(
            f"{where}: the curve ends at radius {radius[-1]:g} mm, inside its largest {radius.max():g} mm;"
            " it must end at its outer rim"
        )
    if press.tip_radius_mm <= 0.0:
        raise InputError(f"{where}: tip_radius_mm {press.tip_radius_mm:g} must be > 0")
    if press.contact_radius_mm < 0.0 or press.contact_radius_mm > radius[-1] - 2.0 * SEAM_MM:
        raise InputError(
            f"{where}: contact_radius_mm {press.contact_radius_mm:g} must be >= 0 and inside the curve's rim,"
            f" {radius[-1]:g} mm"
        )
    deepest = max(press.depth_mm, -float(height.min()))
    if deepest >= top_mm:
        raise InputError(
            f"{where}: reaches {deepest:g} mm down in a clear layer of {top_mm:g} mm; press less deep"
        )


def free_curve(press: Indentation, where: str) -> tuple[FloatArray, FloatArray, float]:
    """Knots (n, 2) of the free curve, ends (m, 2) of the tip's wetted straight pieces, radius of its cap."""
    curve = np.column_stack([press.radius_mm, press.height_mm]).astype(np.float64)
    if press.contact_radius_mm == 0.0:
        return apart(curve), np.empty((0, 2)), 0.0
    tip, equator = press.tip_radius_mm, press.tip_radius_mm - press.depth_mm
    last = int(np.flatnonzero(curve[:, 0] <= press.contact_radius_mm * (1.0 + 1e-9))[-1])
    if not press.is_hemisphere:
        return apart(curve[last:]), apart(curve[: last + 1]), 0.0
    r, z = curve[last]
    gap = math.hypot(r, z - equator) - tip if z <= equator else r - tip
    if abs(gap) > TIP_MISMATCH_MM:
        raise InputError(
            f"{where}: at the contact radius the curve is {gap:+.3f} mm off the tip (limit"
            f" {TIP_MISMATCH_MM:g} mm); check tip_radius_mm {tip:g} and depth_mm {press.depth_mm:g}"
        )
    if z > equator:
        shank = np.array([[tip, equator], [tip, z]])
        return apart(np.vstack([shank[1:], curve[last + 1 :]])), shank, tip
    cap = min(press.contact_radius_mm, tip)
    start = np.array([[cap, equator - math.sqrt(tip * tip - cap * cap)]])
    return apart(np.vstack([start, curve[last + 1 :]])), np.empty((0, 2)), cap


def apart(knots: FloatArray) -> FloatArray:
    """The knots without those that repeat the one before them."""
    step = np.hypot(*np.diff(knots, axis=0).T)
    return np.asarray(knots[np.concatenate([[True], step > SEAM_MM])])
