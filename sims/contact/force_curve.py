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
from optopad.design.spec import SensorDesign
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


@dataclass(frozen=True, kw_only=True)
class PublishedLoad:
    """A published load of one sensor.

    Attributes
    ----------
    depth_mm, force_n : depth [mm] and load [N]; the paper says "corresponds to about"
    source, short_source : full and short reference of the publication
    tip_radius_mm, clear_mm, black_mm, material, mixing_ratio : tip, layers and elastomer of the published press
    """

    depth_mm: float
    force_n: float
    source: str
    short_source: str
    tip_radius_mm: float
    clear_mm: float
    black_mm: float
    material: str
    mixing_ratio: float

    @property
    def point(self) -> tuple[float, float, str]:
        """Depth [mm], load [N] and a label for a plot."""
        return (
            self.depth_mm,
            self.force_n,
            f"{self.short_source}: {self.depth_mm:g} mm, about {self.force_n:g} N",
        )

    def is_of(self, design: SensorDesign) -> bool:
        """Whether a design has this tip, these layers and this elastomer."""
        return (
            design.indenter.tip_radius_mm == self.tip_radius_mm
            and design.cavity.clear_thickness_mm == self.clear_mm
            and design.cavity.black_thickness_mm == self.black_mm
            and design.elastomer.material == self.material
            and design.elastomer.mixing_ratio == self.mixing_ratio
            and design.indenter.shape == "hemisphere"
        )


@dataclass(frozen=True, kw_only=True)
class LoadComparison:
    """A published load and the computed one.

    Attributes
    ----------
    stated : the published load
    force_n, low_n, high_n : load computed at the published depth, and the ends of its band [N]
    needed_modulus_mpa : modulus at which the computed load would equal the published one [MPa]
    """

    stated: PublishedLoad
    force_n: float
    low_n: float
    high_n: float
    needed_modulus_mpa: float

    @property
    def miss(self) -> float:
        """Relative error of the computed load: computed over published load, less 1 [-]."""
        return self.force_n / self.stated.force_n - 1.0

    @property
    def is_in_band(self) -> bool:
        """Whether the published load is within the band of the computed load."""
        return self.low_n <= self.stated.force_n <= self.high_n

    @property
    def words(self) -> str:
        """The comparison in words; a disagreement is stated."""
        side = "above" if self.miss > 0.0 else "below"
        band = "inside" if self.is_in_band else "OUTSIDE"
        return (
            f"computed at {self.stated.depth_mm:g} mm: {self.force_n:.2f} N, {abs(self.miss):.0%} {side} the stated "
            f"{self.stated.force_n:g} N, which is {band} the band of the modulus ({self.low_n:.2f} to "
            f"{self.high_n:.2f} N); a modulus of {self.needed_modulus_mpa:.2f} MPa would give it. The model was not "
            "fitted to that point, and the error of the stated value is unknown"
        )


def compared(stated: PublishedLoad, force: ForceCurve, modulus_mpa: float) -> LoadComparison:
    """Compare a computed curve with a published load.

    Parameters
    ----------
    force : the computed curve, down to the published depth or deeper
    modulus_mpa : Young's modulus of the computed curve [MPa]
    """
    force_n, low_n, high_n = force.at(stated.depth_mm)
    return LoadComparison(
        stated=stated,
        force_n=force_n,
        low_n=low_n,
        high_n=high_n,
        needed_modulus_mpa=modulus_mpa * stated.force_n / force_n,
    )


PIACENZA_2017 = PublishedLoad(
    depth_mm=0.6,
    force_n=2.0,
    source=(
        "Piacenza et al., ICRA 2017: 0.6 mm corresponds to about 2 N, measured with a 6 mm hemispherical tip on "
        "PDMS mixed 1:20; that it was the complete pad of 1 + 8 mm is inferred"
    ),
    short_source="Piacenza 2017, measured",
    tip_radius_mm=3.0,
    clear_mm=8.0,
    black_mm=1.0,
    material="sylgard-184",
    mixing_ratio=20.0,
)
"""Load that the paper states, with the word "about" and without an uncertainty."""


def published_load(design: SensorDesign) -> PublishedLoad | None:
    """The published load that applies to a design; None if there is none."""
    return PIACENZA_2017 if PIACENZA_2017.is_of(design) else None
