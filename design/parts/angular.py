"""Angular tables as data sheets print them: relative intensity or response over the angle to the axis, in air.

Between its angles a table is linear in the angle. Beyond its last angle it is assumed to fall linearly to 0 at 90
degrees; a table that extends to 90 degrees needs no such assumption. Only ratios count: a sheet's polar diagram may
have its largest value at 1, at 100, or in its own unit. The pattern is rotationally symmetric about the axis.

The model leaves out emission that differs between the two axes of a package.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Self

import numpy as np
from pydantic import Field, model_validator

from design.arrays import FloatArray
from design.fields.base import Model
from design.fields.quantity import Confidence, Text

MAX_POINTS = 400
FLAT_FACE_LEAST_DEG = 40.0
"""A narrower half angle needs a lens, and a lens in elastomer differs from the lens in air of the data sheet."""

AngleDeg = Annotated[float, Field(ge=0.0, le=90.0)]
Relative = Annotated[float, Field(ge=0.0, le=1e6)]


class AngularTable(Model):
    """Relative intensity of an emitter, or response of a receiver, over the angle to its axis."""

    unsaid = ("adapted",)

    angle_deg: Annotated[
        tuple[AngleDeg, ...],
        Field(min_length=2, max_length=MAX_POINTS, description="from 0, the axis, outward; in air"),
    ]
    relative: Annotated[
        tuple[Relative, ...],
        Field(min_length=2, max_length=MAX_POINTS, description="at these angles, in any unit"),
    ]
    source: Text
    confidence: Confidence
    adapted: Text | None = None
    """Changes to the points of a file, if any."""

    @model_validator(mode="after")
    def _is_a_table(self) -> Self:
        if len(self.angle_deg) != len(self.relative):
            raise ValueError(
                f"angle_deg has {len(self.angle_deg)} entries, relative {len(self.relative)}: they pair up"
            )
        if self.angle_deg[0] != 0.0:
            raise ValueError(f"angle_deg starts at {self.angle_deg[0]:g}; start at 0, the axis")
        if any(later <= earlier for earlier, later in pairwise(self.angle_deg)):
            raise ValueError("angle_deg must rise from entry to entry")
        if not any(self.relative):
            raise ValueError("relative is 0 at every angle; give the values of the data sheet")
        return self

    @property
    def last_deg(self) -> float:
        """Largest angle that the sheet gives [deg]."""
        return self.angle_deg[-1]

    def at(self, angle_deg: FloatArray) -> FloatArray:
        """(...,) relative value at angles of 0 to 90 degrees, of the same shape, in the table's own unit."""
        angles, values = list(self.angle_deg), list(self.relative)
        if angles[-1] < 90.0:
            angles, values = [*angles, 90.0], [*values, 0.0]
        return np.interp(angle_deg, angles, values)

    def half_angle_deg(self) -> float:
        """First angle at which the table is half of its value on the axis, or 90 if there is none [deg]."""
        half = 0.5 * self.relative[0]
        points = [*zip(self.angle_deg, self.relative, strict=True), (90.0, 0.0)]
        for (low, above), (high, below) in pairwise(points):
            if above > half >= below:
                return low + (above - half) / (above - below) * (high - low)
        return 90.0
