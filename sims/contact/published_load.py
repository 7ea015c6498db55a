"""The published load of the paper's sensor, and its comparison with the computed curve."""

from __future__ import annotations

from dataclasses import dataclass

from optopad.design.spec import SensorDesign
from optopad.sims.contact.force_curve import ForceCurve


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
