"""Skins of tactile sensors: thin coats on the top of the clear layer that scatter or mirror light back into it.

A skin returns the same share of the light at every angle: as a matt white surface (diffuse, Lambertian) or as a mirror
(specular). The rest is absorbed. Its reflectance is that inside the silicone, where no air lies in front of the skin.

The model includes neither skins that scatter into a lobe around the mirror direction nor light that passes through.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from optopad.design.errors import DesignError
from optopad.design.fields.base import Model
from optopad.design.fields.quantity import (
    Confidence,
    LengthMm,
    ModulusMpa,
    Notes,
    Quantity,
    Source,
    Title,
    check_band,
)

Finish = Literal["diffuse", "specular"]
Wavelength = Annotated[float, Field(ge=200.0, le=2000.0)]
Share = Annotated[float, Field(ge=0.0, le=0.99)]


class ReflectanceTable(Model):
    """Reflectance of a skin by wavelength, with its band; linear between the wavelengths."""

    wavelength_nm: Annotated[
        tuple[Wavelength, ...], Field(min_length=1, max_length=400, description="wavelengths of the table")
    ]
    share: Annotated[
        tuple[Share, ...], Field(description="reflected share of the light at these wavelengths")
    ]
    low: Annotated[tuple[Share, ...], Field(description="lower ends of the band of the true share")]
    high: Annotated[tuple[Share, ...], Field(description="upper ends of the band of the true share")]
    source: Source
    confidence: Confidence

    @model_validator(mode="after")
    def _is_a_table(self) -> Self:
        for name in ("share", "low", "high"):
            count = len(getattr(self, name))
            if count != len(self.wavelength_nm):
                raise ValueError(
                    f"wavelength_nm has {len(self.wavelength_nm)} entries, {name} {count}: they pair up"
                )
        if any(later <= earlier for earlier, later in pairwise(self.wavelength_nm)):
            raise ValueError("wavelength_nm must rise from entry to entry")
        for value, low, high in zip(self.share, self.low, self.high, strict=True):
            check_band(value, low, high)
        return self


class Skin(Model):
    """A coat on the top of the clear layer, seen from inside: it scatters or mirrors light back into the layer."""

    title: Title
    finish: Annotated[
        Finish,
        Field(description="diffuse: scatters to all sides as matt paint; specular: reflects as a mirror"),
    ]
    reflectance: Annotated[ReflectanceTable, Field(description="reflected share of the light by wavelength")]
    thickness_mm: Annotated[LengthMm, Field(description="of the coat")]
    youngs_modulus_mpa: Annotated[ModulusMpa, Field(description="Young's modulus of the coat")]
    notes: Notes = ()

    def reflectance_at(self, wavelength_nm: float) -> Quantity:
        """Reflected share of the light at a wavelength [-], with its band.

        Raises
        ------
        DesignError : the table does not reach the wavelength.
        """
        table = self.reflectance
        first, last = table.wavelength_nm[0], table.wavelength_nm[-1]
        if not first <= wavelength_nm <= last:
            raise DesignError(
                f"top.skin: {self.title} has its reflectance from {first:g} to {last:g} nm, not at "
                f"{wavelength_nm:g} nm; give top.finish and top.reflectance instead"
            )
        share, low, high = (
            float(np.interp(wavelength_nm, table.wavelength_nm, values))
            for values in (table.share, table.low, table.high)
        )
        return Quantity(
            value=share, unit="1", source=table.source, confidence=table.confidence, low=low, high=high
        )
