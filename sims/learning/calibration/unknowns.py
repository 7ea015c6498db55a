"""What is not known of a build's optics before it is calibrated, and how wide the doubt is.

The optical ones of the design's tolerances (`design.spec.tolerances`): heights of emitters and receivers, the emitting
area, the emitters' half angle, reflectances, refractive index and absorption, thickness of the clear layer. Each is
one number for all parts of a kind. A doubt that is uniform from end to end enters the fit as a normal one of the same
spread, and the fit stays within the ends. Left out: the cavity's length and width and the tip's radius, which a
caliper measures; the black layer; scatter from part to part.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from design.arrays import FloatArray
from design.errors import InputError
from design.spec import SensorDesign
from design.spec.tolerances import UNIT_ENDS, Tolerance, build_tolerances

OPTICAL_ENDS = (
    "emitters.height_mm",
    "receivers.height_mm",
    ".active_width_mm",
    ".active_height_mm",
    ".half_angle_deg",
    "surfaces.wall_reflectance",
    "surfaces.bottom_reflectance",
    "elastomer.refractive_index",
    "elastomer.absorption_db_per_cm",
    "cavity.clear_thickness_mm",
)
"""Ends of the paths that are fitted."""
NORMAL_ENDS = 2.0
"""Ends of a normal tolerance, in standard deviations (`design.spec.tolerances`)."""


@dataclass(frozen=True, kw_only=True)
class Unknown:
    """One parameter to fit.

    Attributes
    ----------
    path, unit : dotted path that sets it
    value : the design's
    low, high : ends of the doubt
    spread : its standard deviation
    """

    path: str
    unit: str
    value: float
    low: float
    high: float
    spread: float

    @property
    def middle(self) -> float:
        """Where the doubt is centred."""
        return 0.5 * (self.low + self.high)

    @property
    def words(self) -> str:
        """Its name in plain words."""
        last = self.path.rsplit(".", 1)[-1]
        for end, unit in UNIT_ENDS.items():
            last = last.removesuffix(end) if unit == self.unit else last
        kind = self.path.split(".")[0].rstrip("s")
        return f"{kind} {last}".replace("_", " ").replace("part measurement ", "LED ")


def unknowns_of(design: SensorDesign) -> tuple[Unknown, ...]:
    """The optical parameters of a design that are not measured, in a fixed order.

    Raises
    ------
    InputError : all of them are measured, so that nothing is left to fit.
    """
    found = tuple(_unknown(one) for one in build_tolerances(design) if one.path.endswith(OPTICAL_ENDS))
    if not found:
        raise InputError(
            f"calibrate: {design.name} has no optical value with a tolerance, all are measured; "
            "train a model on the data instead"
        )
    return found


def _unknown(one: Tolerance) -> Unknown:
    width = one.high - one.low
    spread = width / (2.0 * NORMAL_ENDS) if one.distribution == "normal" else width / np.sqrt(12.0)
    return Unknown(
        path=one.path, unit=one.unit, value=one.value, low=one.low, high=one.high, spread=float(spread)
    )


def with_values(design: SensorDesign, unknowns: tuple[Unknown, ...], values: FloatArray) -> SensorDesign:
    """The design with parameters (unknown,) set."""
    return design.with_(**{one.path: float(value) for one, value in zip(unknowns, values, strict=True)})
