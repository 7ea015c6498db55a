"""Angular tables from data sheets: relative intensity or response as a function of the angle to the axis, in air.

Values are interpolated linearly in the angle. Beyond the last angle they are assumed to decrease linearly to 0 at 90
degrees; a table that extends to 90 degrees needs no such assumption. Only ratios of the values are used, so their unit
does not matter. The pattern is rotationally symmetric about the axis.

The model does not include packages whose emission differs between two planes.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Self

import numpy as np
from pydantic import Field, model_validator

from optopad.design.arrays import FloatArray
from optopad.design.fields.base import Model
from optopad.design.fields.quantity import Confidence, Source, Text

MAX_POINTS = 400
FLAT_FACE_LEAST_DEG = 40.0
"""Half angle below which a part must have a lens, which acts differently in elastomer from in air."""

AngleDeg = Annotated[float, Field(ge=0.0, le=90.0)]
Relative = Annotated[float, Field(ge=0.0, le=1e6)]


class AngularTable(Model):
    """Relative intensity of an emitter, or response of a receiver, by the angle to its axis."""

    unsaid = ("adapted",)

    angle_deg: Annotated[
        tuple[AngleDeg, ...],
        Field(min_length=2, max_length=MAX_POINTS, description="from 0, the axis, outward; in air"),
    ]
    relative: Annotated[
        tuple[Relative, ...],
        Field(min_length=2, max_length=MAX_POINTS, description="at these angles, in any unit"),
    ]
    source: Source
    confidence: Confidence
    adapted: Text | None = None
    """Changes that were made to the points of a file, if any."""

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
        """Largest angle in the table [deg]."""
        return self.angle_deg[-1]

    def at(self, angle_deg: FloatArray) -> FloatArray:
        """Relative value (...,) at angles of 0 to 90 degrees, in the table's own unit."""
        angles, values = list(self.angle_deg), list(self.relative)
        if angles[-1] < 90.0:
            angles, values = [*angles, 90.0], [*values, 0.0]
        return np.interp(angle_deg, angles, values)

    def half_angle_deg(self) -> float:
        """First angle at which the table is half of its value on the axis [deg]; 90 if the table has no such angle."""
        half = 0.5 * self.relative[0]
        points = [*zip(self.angle_deg, self.relative, strict=True), (90.0, 0.0)]
        for (low, above), (high, below) in pairwise(points):
            if above > half >= below:
                return low + (above - half) / (above - below) * (high - low)
        return 90.0
