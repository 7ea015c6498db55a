"""The form of a pad that is no flat rectangle: its walls in plan and its convex top, as plain arrays.

In plan the elastomer is { p : n · (p - o) <= 0 for every flat wall, |p - c| <= radius of the round wall }, which is
convex. The bottom is the plane z = 0. With the crown's radius of curvature R, its highest point (x_a, y_a) and the
clear thickness there h, the untouched top is

    sphere               z = h - (R - √(R² - (x - x_a)² - (y - y_a)²))
    straight along x     z = h - (R - √(R² - (y - y_a)²))
    straight along y     z = h - (R - √(R² - (x - x_a)²))
    flat (R infinite)    z = h

A press goes along the outward normal n of the untouched top. Its frame stands on the top where the press goes in: the
third axis is n, the first two are tangents. On a sphere they are x and y turned by the least rotation that carries z
to n; on a cylinder the first is the straight direction and the second n times it, so that the frame is right-handed.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from design.arrays import FloatArray

WALL_COLUMNS = ("x", "y", "tx", "ty", "nx", "ny")


@dataclass(frozen=True, kw_only=True, repr=False)
class PadForm:
    """Walls and top of a pad that is no flat rectangle; the domain in plan is convex.

    Attributes
    ----------
    walls : (k, 6) flat walls by `WALL_COLUMNS`: x, y of the place where `along` is 0 [mm]; unit tangent in which
        along grows [-]; unit outward normal [-]
    round_wall : (3,) x, y of the axis and radius of a round wall [mm]; radius 0 for none
    crown_radius_mm : radius of curvature of the convex top [mm]; infinite for a flat one
    crown_axis : "none": a sphere, or flat; "x": a cylinder that stays straight along x; "y": likewise
    apex_mm : x, y of the crown's highest point [mm]
    """

    walls: FloatArray
    round_wall: FloatArray
    crown_radius_mm: float
    crown_axis: Literal["none", "x", "y"]
    apex_mm: tuple[float, float]

    def __repr__(self) -> str:
        """Every number in full, so that two forms have one text only where they are the same."""
        walls, round_wall = np.asarray(self.walls).tolist(), np.asarray(self.round_wall).tolist()
        return (
            f"PadForm(walls={walls}, round_wall={round_wall}, crown_radius_mm={float(self.crown_radius_mm)!r},"
            f" crown_axis={self.crown_axis!r}, apex_mm={tuple(map(float, self.apex_mm))})"
        )

    @property
    def is_crowned(self) -> bool:
        """Whether the untouched top is curved."""
        return bool(np.isfinite(self.crown_radius_mm))

    def top_mm(self, x_mm: ArrayLike, y_mm: ArrayLike, clear_mm: float) -> FloatArray:
        """(...,) height of the untouched top at (...,) places [mm]; NaN where the crown does not reach.

        clear_mm : thickness of the clear layer at the apex [mm].
        """
        across, along = self._from_apex(x_mm, y_mm)
        reach = across * across + along * along
        if not self.is_crowned:
            return np.full(reach.shape, float(clear_mm))
        with np.errstate(invalid="ignore"):
            inner = np.sqrt(self.crown_radius_mm**2 - reach)
        return np.asarray(clear_mm - reach / (self.crown_radius_mm + inner))

    def normal(self, x_mm: ArrayLike, y_mm: ArrayLike) -> FloatArray:
        """(..., 3) unit outward normal of the untouched top at (...,) places; NaN where the crown does not reach."""
        sideways = np.stack(self._from_apex(x_mm, y_mm), axis=-1) / self.crown_radius_mm
        with np.errstate(invalid="ignore"):
            upward = np.sqrt(1.0 - np.sum(sideways**2, axis=-1))
        return np.concatenate([sideways, upward[..., None]], axis=-1)

    def press_frame(self, x_mm: float, y_mm: float, clear_mm: float) -> tuple[FloatArray, FloatArray]:
        """Frame of a press at a place of the top.

        Returns
        -------
        origin (3,) on the untouched top [mm], and axes (3, 3): a row each, the third along the normal [-]
        """
        origin = np.array([x_mm, y_mm, float(self.top_mm(x_mm, y_mm, clear_mm))])
        normal = self.normal(x_mm, y_mm)
        if self.is_crowned and self.crown_axis != "none":
            first = np.array([1.0, 0.0, 0.0]) if self.crown_axis == "x" else np.array([0.0, 1.0, 0.0])
            return origin, np.stack([first, np.cross(normal, first), normal])
        nx, ny, nz = normal
        first = np.array([1.0 - nx * nx / (1.0 + nz), -nx * ny / (1.0 + nz), -nx])
        second = np.array([-nx * ny / (1.0 + nz), 1.0 - ny * ny / (1.0 + nz), -ny])
        return origin, np.stack([first, second, normal])

    def _from_apex(self, x_mm: ArrayLike, y_mm: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """(...,) distances from the apex along x and y, 0 along the straight direction of a cylinder [mm]."""
        x, y = np.broadcast_arrays(np.asarray(x_mm, np.float64), np.asarray(y_mm, np.float64))
        return (
            np.zeros(x.shape) if self.crown_axis == "x" else x - self.apex_mm[0],
            np.zeros(y.shape) if self.crown_axis == "y" else y - self.apex_mm[1],
        )
