"""Load against depth of a press, with the uncertainty band of the material's modulus.

The layer's shape does not depend on its modulus, and the load is proportional to it: F = E R² f(d/R, h/R).
So one solved press gives the load at the catalogue's modulus and at both ends of its band (the mixing
ratio sets the value; cure and batch set the band). A modulus measured on the manufactured pad has none.

Left out: the band covers the modulus only, not the error of the contact model or the distance of the
real walls.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from design.arrays import FloatArray
from design.fields.quantity import Quantity
from design.spec import SensorDesign
from design.spec.properties import modulus
from sims.contact.library.solved_press import SolvedPress


@dataclass(frozen=True, kw_only=True)
class LoadCurve:
    """Load against depth of one press, from the contact model.

    Attributes
    ----------
    depth_mm : (n,) [mm]
    force_n : (n,) load at the best value of the modulus [N]
    low_n, high_n : (n,) load at the ends of the modulus's band [N]; equal to `force_n` without a band
    """

    depth_mm: FloatArray
    force_n: FloatArray
    low_n: FloatArray
    high_n: FloatArray

    @property
    def has_band(self) -> bool:
        """Whether the modulus is uncertain."""
        return bool(self.low_n[-1] < self.high_n[-1])

    def at(self, depth_mm: float) -> tuple[float, float, float]:
        """Load and the ends of its band [N] at a depth, by straight lines between the stored ones."""
        low, value, high = (
            float(np.interp(depth_mm, self.depth_mm, load))
            for load in (self.low_n, self.force_n, self.high_n)
        )
        return value, low, high


@dataclass(frozen=True, kw_only=True)
class ForceCurve(LoadCurve):
    """Load and contact radius against depth.

    Attributes
    ----------
    contact_radius_mm : (n,) [mm]
    """

    contact_radius_mm: FloatArray

    def contact_radius_at(self, depth_mm: float) -> float:
        """Contact radius [mm] at a depth, by straight lines between the stored ones."""
        return float(np.interp(depth_mm, self.depth_mm, self.contact_radius_mm))


def band_factors(young: Quantity) -> tuple[float, float]:
    """Ends of a modulus's band over its value [-]; 1 where there is no band."""
    low = young.value if young.low is None else young.low
    high = young.value if young.high is None else young.high
    return low / young.value, high / young.value


def load_curve(design: SensorDesign, press: SolvedPress, depth_mm: FloatArray) -> LoadCurve:
    """The load of a solved press, without its surface.

    Parameters
    ----------
    design : the sensor whose elastomer gives the band
    press : its solved press
    depth_mm : (n,) increasing depths [mm]

    Raises
    ------
    ModelScopeError : a depth is deeper than solved
    """
    depths = np.asarray(depth_mm, dtype=np.float64)
    force = np.array([press.force_n(float(depth)) for depth in depths])
    low, high = band_factors(modulus(design))
    return LoadCurve(depth_mm=depths, force_n=force, low_n=low * force, high_n=high * force)


def force_curve(design: SensorDesign, press: SolvedPress, depth_mm: FloatArray) -> ForceCurve:
    """The load of a solved press and its contact radius; arguments and errors of `load_curve`."""
    load = load_curve(design, press, depth_mm)
    radius = np.array([press.at(float(depth)).contact_radius_mm for depth in load.depth_mm])
    return ForceCurve(**vars(load), contact_radius_mm=radius)
