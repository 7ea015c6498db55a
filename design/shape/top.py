r"""The untouched top of a pad: flat, or convex with its highest point over the middle.

With the curvatures kx and ky along x and y [1/mm], and the location (x, y) relative to the highest point,

    sag = (kx x² + ky y²) / (1 + √(1 - kx² x² - ky² y²)),      normal = (kx x, ky y, √(1 - kx² x² - ky² y²)).

The top is flat if kx = ky = 0, and a sphere of radius 1 / kx if kx = ky > 0. If only one of kx and ky is 0, the top is
a cylinder, straight along that direction.

A press moves against the normal. The coordinate system of a press has its origin where the press meets the top. Its
third axis is the normal. The first two axes are x and y after the smallest rotation that turns z into the normal. On a
cylinder, the first axis is the straight direction.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from optopad.design.arrays import FloatArray


@dataclass(frozen=True, kw_only=True)
class Top:
    """A pad's untouched top.

    Attributes
    ----------
    clear_mm : height of the top's highest point above the bottom of the clear layer
    apex_mm : x, y of the highest point; on a flat top the middle of the pad
    kx, ky : curvatures along x and y [1/mm]; they are equal, or one or both are 0
    """

    clear_mm: float
    apex_mm: tuple[float, float]
    kx: float = 0.0
    ky: float = 0.0

    @property
    def is_flat(self) -> bool:
        """Whether the top is a plane."""
        return self.kx == self.ky == 0.0

    @property
    def straight(self) -> Literal["x", "y"] | None:
        """Direction in which a cylinder is straight; None for a sphere or a flat top."""
        if self.kx == self.ky:
            return None
        return "x" if self.kx == 0.0 else "y"

    @property
    def kind(self) -> Literal["none", "sphere", "cylinder"]:
        """Kind of curvature, as named in design files."""
        if self.is_flat:
            return "none"
        return "sphere" if self.straight is None else "cylinder"

    @property
    def radius_mm(self) -> float:
        """Radius of curvature; infinite for a flat top [mm]."""
        return math.inf if self.is_flat else 1.0 / max(self.kx, self.ky)

    @property
    def mean_curvature(self) -> float:
        """Mean of both curvatures [1/mm]."""
        return (self.kx + self.ky) / 2

    def sag_mm(self, x_mm: ArrayLike, y_mm: ArrayLike) -> FloatArray:
        """How far (...,) the top is below its highest point, at each location [mm]; NaN beyond the crown's radius."""
        x, y, root = self._from_apex(x_mm, y_mm)
        fall: FloatArray = (self.kx * x * x + self.ky * y * y) / (1.0 + root)
        return fall

    def height_mm(self, x_mm: ArrayLike, y_mm: ArrayLike) -> FloatArray:
        """Height (...,) of the top above the bottom of the clear layer [mm]; NaN beyond the crown's radius."""
        return self.clear_mm - self.sag_mm(x_mm, y_mm)

    def normal(self, x_mm: ArrayLike, y_mm: ArrayLike) -> FloatArray:
        """Unit normal (..., 3) of the top at locations, pointing out of the pad.

        Beyond the crown's radius the vector is horizontal and longer than 1.
        """
        x, y, root = self._from_apex(x_mm, y_mm)
        return np.stack([self.kx * x, self.ky * y, np.nan_to_num(root)], axis=-1)

    @property
    def in_frame(self) -> Top:
        """The top in the coordinates of a press at its highest point; a cylinder is straight along the first axis."""
        low, high = sorted((self.kx, self.ky))
        return Top(clear_mm=0.0, apex_mm=(0.0, 0.0), kx=low, ky=high)

    @property
    def frame_turn_deg(self) -> float:
        """Turn of a press frame's first axis from the cavity's x, about the normal [deg]."""
        return 90.0 if self.straight == "y" else 0.0

    def press_frame(self, x_mm: float, y_mm: float) -> tuple[FloatArray, FloatArray]:
        """Coordinate system of a press at a location.

        Returns
        -------
        Origin (3,) on the untouched top in the cavity's coordinates [mm], and axes (3, 3) as rows: two tangents and the
        normal.
        """
        origin = np.array([x_mm, y_mm, float(self.height_mm(x_mm, y_mm))])
        normal = self.normal(x_mm, y_mm)
        nx, ny, nz = normal
        first = np.array([1.0 - nx * nx / (1.0 + nz), -nx * ny / (1.0 + nz), -nx])
        second = np.array([-nx * ny / (1.0 + nz), 1.0 - ny * ny / (1.0 + nz), -ny])
        if self.straight == "y":
            first, second = second, -first
        return origin, np.stack([first, second, normal]) + 0.0

    def _from_apex(self, x_mm: ArrayLike, y_mm: ArrayLike) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Distances from the highest point along x and y [mm], and the normal's z component (NaN beyond the crown)."""
        x, y = np.asarray(x_mm, np.float64) - self.apex_mm[0], np.asarray(y_mm, np.float64) - self.apex_mm[1]
        with np.errstate(invalid="ignore"):
            return x, y, np.sqrt(1.0 - (self.kx * x) ** 2 - (self.ky * y) ** 2)
