"""The deformed surface of the pad under one press: the vocabulary shared by contact and light.

A press is axisymmetric. The surface is stored as a curve (radius, height) that starts on the axis
under the tip and runs outward; near the shank it may run back, so radius need not increase.
Heights are relative to the undisturbed surface, negative in the dimple, positive in the pile-up.
Inside the contact circle the surface is the tip's: exactly a sphere under a hemisphere, the curve itself
under any other tip.
"""

from __future__ import annotations

from dataclasses import dataclass

from design.arrays import FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class Indentation:
    """One press of a tip, which is a body of revolution, into the pad.

    Attributes
    ----------
    depth_mm : how far the tip's apex lies below the undisturbed surface [mm]; 0 = untouched
    tip_radius_mm : radius of the tip and its shank [mm]
    radius_mm : (n,) distance from the press axis along the curve [mm]
    height_mm : (n,) height relative to the undisturbed surface [mm]
    contact_radius_mm : radius of the circle where the surface leaves the tip [mm]
    force_n : press force [N]
    is_hemisphere : whether the tip is a hemisphere of that radius
    inclination_deg : (n,) angle of the curve's tangent to the radial direction, continuous along the curve
        (its normal is C1 data, the points are its knots) [deg]; None where only points are known
    """

    depth_mm: float
    tip_radius_mm: float
    radius_mm: FloatArray
    height_mm: FloatArray
    contact_radius_mm: float
    force_n: float
    is_hemisphere: bool = True
    inclination_deg: FloatArray | None = None
