"""Packages of LEDs and photodiodes, with the sizes that an entry of the catalogue needs, and their lenses.

A round package has a dome in front of its die: a lens. Filed flat, it has none. In a flat epoxy face a die that
radiates as the cosine (half angle 60 degrees, Lambertian) still does so outside: refraction at a plane keeps radiance
over the squared index, so the law of the cosine stays. Two effects are left out. The cup around the die narrows the
beam. In a round body of 5 mm, whose die is about 3 mm behind the filed face, light steeper than about 45 degrees meets
the side of the body first. So the band of the angle begins there. No measurement of a filed LED in silicone was found.

A dome that stays on is bedded in elastomer, whose index n_e is near that of the epoxy, n. Near the axis, light of a die
at a distance c behind the centre of a dome of radius R turns from an angle alpha to

    theta = alpha (1 - (n / n_outside - 1) c / R)

A die with a half angle of 60 degrees and a dome with half angle theta_air in air has, with the same dome, in elastomer

    theta_e = 60 - (60 - theta_air) (n / n_e - 1) / (n - 1)

With n = 1.53 and n_e = 1.41 a lens keeps 16 % of its effect. This is an estimate: it is exact near the axis only.
"""

from __future__ import annotations

from functools import cache
from typing import Annotated, Literal

from pydantic import Field

from optopad.design.errors import InputError
from optopad.design.fields.base import Model, nearest
from optopad.design.fields.packaged import data_table
from optopad.design.fields.quantity import HalfAngleDeg, LengthMm, Quantity, Text

LAMBERTIAN_DEG = 60.0
EPOXY_INDEX = 1.53
"""Index of clear LED epoxy; makers state 1.50 to 1.55 (recalled)."""
ELASTOMER_INDEX = 1.41
SIDE_OF_BODY_DEG = 45.0
"""Angle beyond which light of a filed round LED meets the side of its body [deg]."""

Lens = Literal["filed", "kept", "none"]
View = Literal["top", "side"]


class Package(Model):
    """Sizes of a package as it is mounted behind a wall: width along the wall, depth into it, height upward."""

    title: Text
    mounting: Literal["radial", "surface"]
    view: View
    legs: Annotated[Text, Field(description="where the legs leave")]
    body_width_mm: LengthMm
    body_depth_mm: LengthMm
    body_height_mm: LengthMm
    dome_mm: Annotated[LengthMm | None, Field(description="length of the dome, which a file removes")] = None
    active_width_mm: LengthMm
    active_height_mm: LengthMm
    active_height_in_body_mm: LengthMm
    lead_pitch_mm: LengthMm
    lead_diameter_mm: LengthMm
    lead_setback_mm: LengthMm | None = None
    lead_count: int
    notes: tuple[Text, ...] = ()

    def depth_mm(self, lens: Lens) -> Quantity:
        """Depth of the body into the wall, without the dome if that is filed off [mm]."""
        depth, dome = self.body_depth_mm, self.dome_mm
        if lens != "filed" or dome is None:
            return depth
        ends = [None if end is None else round(end - dome.value, 6) for end in (depth.low, depth.high)]
        return Quantity(
            value=round(depth.value - dome.value, 6),
            unit="mm",
            source=f"{depth.value:g} mm ({depth.source}) less the dome of {dome.value:g} mm, filed flat",
            confidence="inferred",
            low=ends[0],
            high=ends[1],
        )


@cache
def packages() -> dict[str, Package]:
    """The known packages by name."""
    table = data_table("packages.toml")["packages"]
    return {name: Package.model_validate(fields) for name, fields in table.items()}


def find_package(name: str) -> Package:
    """Find a package by its name; InputError with similar names if there is none."""
    known = packages()
    if name not in known:
        near = nearest(name.lower().replace(" ", "-"), tuple(known))
        hint = f"did you mean {near[0]}? " if near else ""
        raise InputError(
            f"--package: {name!r} is refused: {hint}known are {', '.join(known)}; for another package take the "
            "nearest, and correct the sizes in the entry"
        )
    return known[name]


def half_angle_in_elastomer(half_angle: HalfAngleDeg, lens: Lens) -> Quantity:
    """Half angle of a part in elastomer [deg], from the data sheet's half angle in air and what becomes of its lens."""
    air_deg = half_angle.value
    if lens == "none":
        return half_angle
    if lens == "filed":
        return Quantity(
            value=LAMBERTIAN_DEG,
            unit="deg",
            source=f"assumed Lambertian behind a face filed flat; {air_deg:g} deg with the dome in air; band: from "
            "where the side of the body cuts the light off",
            confidence="unverified",
            low=SIDE_OF_BODY_DEG,
            high=65.0,
        )
    left = (EPOXY_INDEX / ELASTOMER_INDEX - 1.0) / (EPOXY_INDEX - 1.0)
    bedded_deg = round(LAMBERTIAN_DEG - (LAMBERTIAN_DEG - air_deg) * left, 1)
    return Quantity(
        value=bedded_deg,
        unit="deg",
        source=f"{air_deg:g} deg in air; a dome of epoxy (index {EPOXY_INDEX:g}) in silicone keeps {left:.0%} of "
        "its effect near the axis; estimated, not measured",
        confidence="unverified",
        low=min(SIDE_OF_BODY_DEG, bedded_deg),
        high=max(65.0, bedded_deg),
    )
