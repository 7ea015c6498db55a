"""An emitter's spectrum, the refractive index averaged over it, and the reader of digitised curves.

The light model uses one refractive index for all light, n = int w(lambda) n(lambda) dlambda / int w dlambda. The weight
w is linear between its points and 0 outside. It is the emitted power times the receiver's responsivity in any unit,
because only ratios are used. Simpson's rule integrates pieces of at most 10 nm, and is exact where n is linear in a
piece.

The index is averaged, not the signal. The mean of a signal F(n) is F(mean) + F'' var(n) / 2 + ..., so the error is of
second order. `deviation` is the square root of var(n). Absorption is not averaged.

A CSV file from a digitising program can provide a data sheet's curve, either an angular table or a spectrum:

    angle_deg, relative        a heading, empty lines and lines that begin with # are skipped
    -89.6, 0.02                any number of rows, in any order
    0.31, 0.99

The points are processed in this order, and the field `adapted` of the table records each change:

- Negative values of up to 2 % of the largest value become 0. Angles beyond 90 degrees by up to 1 degree become 90.
- Points are sorted. Points at the same angle or wavelength are replaced by their mean.
- Values on both sides of the axis are replaced by their mean; where only one side has a value, it is used.
- If the first angle is up to 2 degrees, it becomes 0.
- More than 181 points are replaced by 181 equidistant points by linear interpolation.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from math import ceil, sqrt
from pathlib import Path
from typing import Annotated, Any, Self

import numpy as np
from pydantic import Field, model_validator

from optopad.design.arrays import FloatArray
from optopad.design.csv_table import numbered_points
from optopad.design.errors import DesignError
from optopad.design.fields.base import Model
from optopad.design.fields.quantity import NM_PER_UM, Confidence, Quantity, Source, Text, weakest

CURVE_FILE = "curve_csv"
CURVES = {
    "angular_pattern": ("angle_deg", "relative"),
    "angular_response": ("angle_deg", "relative"),
    "spectrum": ("wavelength_nm", "weight"),
}
"""Fields of a part that a curve file may give, and the names of their two lists."""
LARGEST_BELOW_ZERO = 0.02
"""Largest accepted negative value of a digitised curve, as a share of its largest value."""
FARTHEST_FROM_AXIS_DEG = 2.0
FARTHEST_BEYOND_DEG = 1.0
MOST_POINTS = 181


def with_curve(table: dict[str, Any], file: Path, kind: str) -> dict[str, Any]:
    """Read a curve file; return the table with the points in place of the file's name.

    Parameters
    ----------
    table : fields of the table, including `curve_csv`
    file : path of the curve file
    kind : field of a part, one of the keys of `CURVES`

    Raises
    ------
    DesignError : the table has both points and a file, the file cannot be read, or its points do not form a curve of
        this kind.
    """
    across, value = CURVES[kind]
    if doubled := [name for name in (across, value) if name in table]:
        raise DesignError(f"{file}: {kind} has {doubled[0]} and {CURVE_FILE}; keep one of the two")
    needed = f"a CSV table with {across} and {value}, one point per row"
    points = np.array([point for _, point in numbered_points(file, needed=needed)])
    changes: list[str] = []
    where, values = points[:, 0], points[:, 1]
    values = _from_zero(values, changes, file, value)
    if across == "angle_deg":
        where, values = _folded(where, values, changes, file)
    elif where.max() < 20.0:
        raise DesignError(f"{file}: {across} reaches {where.max():g}; wavelengths are in nm, not in µm")
    where, values = _sorted(where, values, changes)
    if across == "angle_deg":
        where = _from_axis(where, changes, file)
    where, values, thinned = _thinned(where, values)
    rest = {name: given for name, given in table.items() if name != CURVE_FILE}
    adapted = {"adapted": f"{file.name}: {', '.join(changes + thinned)}"} if changes else {}
    return rest | adapted | {across: where.round(6).tolist(), value: values.tolist()}


def _from_zero(values: FloatArray, changes: list[str], file: Path, name: str) -> FloatArray:
    largest, least = values.max(), values.min()
    if largest <= 0.0 or least < -LARGEST_BELOW_ZERO * largest:
        raise DesignError(
            f"{file}: {name} ranges from {least:g} to {largest:g}; needs values from 0, at most "
            f"{LARGEST_BELOW_ZERO:.0%} of the largest below it; correct the axis of the digitised diagram"
        )
    if least < 0.0:
        changes.append(f"{(values < 0.0).sum()} values down to {least:g} set to 0")
    return np.maximum(values, 0.0)


def _folded(
    angles: FloatArray, values: FloatArray, changes: list[str], file: Path
) -> tuple[FloatArray, FloatArray]:
    """Angles of 0 to 90 degrees, and the mean of the values on both sides of the axis.

    Changes are appended to `changes` in words.
    """
    farthest = np.abs(angles).max()
    if farthest > 90.0 + FARTHEST_BEYOND_DEG:
        raise DesignError(
            f"{file}: angle_deg reaches {farthest:g}; needs angles to the axis, -90 to 90 degrees"
        )
    if farthest > 90.0:
        changes.append(f"{(np.abs(angles) > 90.0).sum()} angles up to {farthest:g} deg set to 90")
        angles = np.clip(angles, -90.0, 90.0)
    if angles.min() >= 0.0:
        return angles, values
    if angles.max() < FARTHEST_FROM_AXIS_DEG:
        changes.append("angles of the other side mirrored")
        return -np.minimum(angles, 0.0), values
    sides = [
        _sorted(side * angles[side * angles >= 0.0], values[side * angles >= 0.0], [])
        for side in (1.0, -1.0)
        if (side * angles >= 0.0).any()
    ]
    grid = np.unique(np.concatenate([side for side, _ in sides]))
    each = np.array([np.interp(grid, *side, right=np.nan) for side in sides])
    apart = np.nanmax(np.ptp(each, axis=0)) / values.max()
    changes.append(f"both sides of the axis averaged, {apart:.1%} of the largest apart at most")
    return grid, np.nanmean(each, axis=0)


def _sorted(where: FloatArray, values: FloatArray, changes: list[str]) -> tuple[FloatArray, FloatArray]:
    """Points in increasing order, with the mean of points at the same angle or wavelength.

    Changes are appended to `changes` in words.
    """
    found, place, counts = np.unique(where, return_inverse=True, return_counts=True)
    if (np.diff(where) < 0.0).any():
        changes.append("points sorted")
    if len(found) < len(where):
        changes.append(f"{len(where) - len(found)} points at a location of another averaged")
    return found, np.bincount(place, weights=values) / counts


def _from_axis(angles: FloatArray, changes: list[str], file: Path) -> FloatArray:
    first = angles[0]
    if first > FARTHEST_FROM_AXIS_DEG:
        raise DesignError(
            f"{file}: angle_deg starts at {first:g}; needs a point at {FARTHEST_FROM_AXIS_DEG:g} or less"
        )
    if first > 0.0:
        changes.append(f"the first angle, {first:g} deg, taken for the axis")
    return np.concatenate([[0.0], angles[1:]])


def _thinned(where: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray, list[str]]:
    """Reduce a curve to at most `MOST_POINTS` points; the last result describes the change, if any."""
    if len(where) <= MOST_POINTS:
        return where, values, []
    grid = np.linspace(where[0], where[-1], MOST_POINTS)
    kept = np.interp(grid, where, values)
    off = np.abs(np.interp(where, grid, kept) - values).max() / values.max()
    return grid, kept, [f"{len(where)} points thinned to {MOST_POINTS}, {off:.1%} of the largest off at most"]


LONGEST_PIECE_NM = 10.0
MAX_POINTS = 400

Nanometres = Annotated[float, Field(ge=200.0, le=2000.0)]
Weight = Annotated[float, Field(ge=0.0, le=1e9)]


class Spectrum(Model):
    """Relative weight of an emitter's wavelengths: its spectral power, preferably times the receiver's responsivity."""

    unsaid = ("adapted",)

    wavelength_nm: Annotated[
        tuple[Nanometres, ...],
        Field(min_length=2, max_length=MAX_POINTS, description="wavelengths of the table"),
    ]
    weight: Annotated[
        tuple[Weight, ...], Field(min_length=2, max_length=MAX_POINTS, description="in any unit")
    ]
    source: Source
    confidence: Confidence
    adapted: Text | None = None
    """Changes that were made to the points of a file, if any."""

    @model_validator(mode="after")
    def _is_a_table(self) -> Self:
        if len(self.wavelength_nm) != len(self.weight):
            raise ValueError(
                f"wavelength_nm has {len(self.wavelength_nm)} entries, weight {len(self.weight)}: they pair up"
            )
        if any(later <= earlier for earlier, later in pairwise(self.wavelength_nm)):
            raise ValueError("wavelength_nm must rise from entry to entry")
        if not any(self.weight):
            raise ValueError("weight is 0 at every wavelength; give the values of the data sheet")
        return self

    def samples(self) -> tuple[tuple[float, float], ...]:
        """Wavelengths [um] and their weights for Simpson's rule; the weights add up to 1."""
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
    """A refractive index averaged over a spectrum.

    Attributes
    ----------
    mean : weighted mean of the index [-]; the ends of its band are the weighted means of the ends of the index's band
    deviation : weighted standard deviation of the index over the spectrum [-]
    """

    mean: Quantity
    deviation: float


def spectral_index(spectrum: Spectrum, index_at: Callable[[float], Quantity]) -> SpectralIndex:
    """Average a refractive index over a spectrum.

    Parameters
    ----------
    spectrum : weights by wavelength
    index_at : function that returns the refractive index at a wavelength [um]

    Raises
    ------
    DesignError : `index_at` has no index for a wavelength of the spectrum.
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
