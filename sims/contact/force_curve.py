"""Force against depth of a press, with an uncertainty band from the material's modulus.

The deformed shape does not depend on Young's modulus E, and the force F is proportional to E: F = E R² f(d/R, h/R),
with tip radius R, press depth d and layer thickness h. So one solved press gives the force at the catalogue's modulus
and at both ends of its band. The mixing ratio determines the modulus, while cure and batch cause its band. A modulus
measured on the manufactured pad has no band.

The band does not include the error of the contact model or the effect of the real walls' distance.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from optopad.design.arrays import FloatArray
from optopad.design.fields.quantity import Quantity
from optopad.sims.contact.library.solved_press import SolvedPress


@dataclass(frozen=True, kw_only=True)
class LoadCurve:
    """Force against depth of one press, from the contact model.

    Attributes
    ----------
    depth_mm : (n,) increasing press depths [mm]
    force_n : (n,) force at the nominal modulus [N]
    low_n, high_n : (n,) force at the lower and upper end of the modulus's band [N]; if it has none, equal to `force_n`
    """

    depth_mm: FloatArray
    force_n: FloatArray
    low_n: FloatArray
    high_n: FloatArray

    @property
    def has_band(self) -> bool:
        """Whether the modulus has an uncertainty band."""
        return bool(self.low_n[-1] < self.high_n[-1])

    def at(self, depth_mm: float) -> tuple[float, float, float]:
        """Force at a depth [mm], and the lower and upper end of its band [N], interpolated linearly."""
        low, value, high = (
            float(np.interp(depth_mm, self.depth_mm, load))
            for load in (self.low_n, self.force_n, self.high_n)
        )
        return value, low, high


@dataclass(frozen=True, kw_only=True)
class ForceCurve(LoadCurve):
    """Force and contact radius against depth of one press, from the contact model.

    Attributes
    ----------
    contact_radius_mm : (n,) contact radius at each depth [mm]
    """

    contact_radius_mm: FloatArray

    def contact_radius_at(self, depth_mm: float) -> float:
        """Contact radius [mm] at a depth [mm], interpolated linearly."""
        return float(np.interp(depth_mm, self.depth_mm, self.contact_radius_mm))


def band_factors(young: Quantity) -> tuple[float, float]:
    """Lower and upper end of the modulus's uncertainty band over its nominal value [-]; both 1 if it has no band."""
    low = young.value if young.low is None else young.low
    high = young.value if young.high is None else young.high
    return low / young.value, high / young.value


def load_curve(press: SolvedPress, depth_mm: FloatArray) -> LoadCurve:
    """Force against depth of a solved press, without computing its surface.

    Parameters
    ----------
    press : the solved press
    depth_mm : (n,) increasing depths [mm]

    Raises
    ------
    ModelScopeError : a depth exceeds the deepest solved press
    """
    depths = np.asarray(depth_mm, dtype=np.float64)
    force = np.array([press.force_n(float(depth)) for depth in depths])
    low, high = band_factors(press.modulus)
    return LoadCurve(depth_mm=depths, force_n=force, low_n=low * force, high_n=high * force)


def force_curve(press: SolvedPress, depth_mm: FloatArray) -> ForceCurve:
    """Force and contact radius against depth of a solved press; arguments and errors are those of `load_curve`."""
    load = load_curve(press, depth_mm)
    radius = np.array([press.at(float(depth)).contact_radius_mm for depth in load.depth_mm])
    return ForceCurve(**vars(load), contact_radius_mm=radius)
