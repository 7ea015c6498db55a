"""An emitter's spectrum, and the refractive index averaged over it.

Model: one index stands for all light, n = int w(lambda) n(lambda) dlambda / int w dlambda, with the weight w linear
between its points and 0 outside. The weight is what counts in the end: emitted power times the receiver's
responsivity, relative, in any unit. Simpson's rule on pieces of at most 10 nm; exact where n is linear there.

What averaging the index, not the light, leaves out: a signal F(n) averages to F(mean) + F'' var(n) / 2 + ...; the
first-order term vanishes by construction. `deviation` gives the root of var(n). Absorption is not averaged.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from math import ceil, sqrt
from typing import Annotated, Self

from pydantic import Field, model_validator

from design.fields.base import Model
from design.fields.quantity import Confidence, Quantity, Text, weakest
from design.fields.units import NM_PER_UM

LONGEST_PIECE_NM = 10.0
MAX_POINTS = 400

Nanometres = Annotated[float, Field(ge=200.0, le=2000.0)]
Weight = Annotated[float, Field(ge=0.0, le=1e9)]


class Spectrum(Model):
    """Relative weight of an emitter's wavelengths: its spectral power, better times the receiver's responsivity."""

    unsaid = ("adapted",)

    wavelength_nm: Annotated[tuple[Nanometres, ...], Field(min_length=2, max_length=MAX_POINTS)]
    weight: Annotated[
        tuple[Weight, ...], Field(min_length=2, max_length=MAX_POINTS, description="in any unit")
    ]
    source: Text
    confidence: Confidence
    adapted: Text | None = None
    """What was done to the points of a file, where anything was."""

    @model_validator(mode="after")
    def _is_a_table(self) -> Self:
        if len(self.wavelength_nm) != len(self.weight):
            raise ValueError(
                f"wavelength_nm has {len(self.wavelength_nm)} entries, weight {len(self.weight)}: they pair up"
            )
        if any(later <= earlier for earlier, later in pairwise(self.wavelength_nm)):
            raise ValueError("wavelength_nm must rise from entry to entry")
        if not any(self.weight):
            raise ValueError("weight is 0 at every wavelength; give what the sheet shows")
        return self

    def samples(self) -> tuple[tuple[float, float], ...]:
        """Wavelengths [um] where there is light, and their shares of the whole, which add up to 1."""
        points: dict[float, float] = {}
        table = zip(self.wavelength_nm, self.weight, strict=True)
        for (start, first), (end, last) in pairwise(table):
            pieces = ceil((end - start) / LONGEST_PIECE_NM)
            for k in range(2 * pieces + 1):
                at, simpson = k / (2 * pieces), (1, 4, 2)[0 if k in (0, 2 * pieces) else 2 - k % 2]
                share = simpson * (end - start) / (6 * pieces) * (first + at * (last - first))
                where = start + at * (end - start)
                points[where] = points.get(where, 0.0) + share
        total = sum(points.values())
        return tuple((where / NM_PER_UM, share / total) for where, share in points.items() if share > 0.0)


@dataclass(frozen=True, kw_only=True)
class SpectralIndex:
    """An index averaged over a spectrum.

    Attributes
    ----------
    mean : weighted mean, its band the weighted mean of both ends [-]
    deviation : weighted standard deviation of the index over the spectrum [-]
    """

    mean: Quantity
    deviation: float


def spectral_index(spectrum: Spectrum, index_at: Callable[[float], Quantity]) -> SpectralIndex:
    """Average an index over a spectrum.

    Parameters
    ----------
    spectrum : the weights
    index_at : refractive index at a wavelength [um]

    Raises
    ------
    DesignError : a wavelength that has weight and no index.
    """
    samples = [(index_at(where), share) for where, share in spectrum.samples()]
    value = sum(share * index.value for index, share in samples)
    variance = sum(share * (index.value - value) ** 2 for index, share in samples)
    low = sum(share * (index.value if index.low is None else index.low) for index, share in samples)
    high = sum(share * (index.value if index.high is None else index.high) for index, share in samples)
    first = samples[0][0]
    mean = Quantity(
        value=value,
        unit=first.unit,
        source=f"{first.source}; averaged over the spectrum: {spectrum.source}",
        confidence=weakest("inferred", spectrum.confidence, *(index.confidence for index, _ in samples)),
        low=min(low, value),
        high=max(high, value),
    )
    return SpectralIndex(mean=mean, deviation=sqrt(variance))
