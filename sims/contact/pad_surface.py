"""The deformed top of a whole pad under one press, walls included: height at any (x, y).

The centred press gives the shape around the axis; near walls add the field of `walls`, which is not
axisymmetric. Height here is a function of place: where the surface wraps the shank, it is the lowest of its heights.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from design.spec import SensorDesign
from sims.contact.indentation import solved_press
from sims.contact.wall_shape import contact_window
from sims.contact.walls import WallCorrection, wall_correction, walls_of
from sims.indentation import Indentation

FloatArray = NDArray[np.float64]

_STEP = 1e-6


@dataclass(frozen=True, kw_only=True)
class PadSurface:
    """The top of a pad under one press.

    Attributes
    ----------
    press : the press: its curve is that of the centred press, its force that of the place
    at_mm : (x, y) of the press axis in the cavity frame [mm]
    size_mm : length and width of the cavity [mm]
    correction : what the walls add, in tip radii
    """

    press: Indentation
    at_mm: tuple[float, float]
    size_mm: tuple[float, float]
    correction: WallCorrection

    def centred_height_mm(self, radius_mm: FloatArray) -> FloatArray:
        """(...,) height of the centred press [mm] at distances from its axis [mm]; 0 beyond the library's wall."""
        radius, height = _outward(self.press)
        reached = np.clip(radius_mm, 0.0, radius[-1])
        return np.asarray(PchipInterpolator(radius, height)(reached), dtype=np.float64)

    def height_mm(self, x_mm: FloatArray, y_mm: FloatArray) -> FloatArray:
        """(...,) height of the top over the undisturbed one [mm] at places in the cavity frame [mm].

        Places are shapes that broadcast; (nx, 1) and (1, ny), a grid, are the cheapest.
        """
        along, across = self._from_axis(x_mm, y_mm)
        added = self._added_mm(along, across)
        return np.asarray(self.centred_height_mm(np.hypot(along, across)) + added, dtype=np.float64)

    def wall_height_mm(self, x_mm: FloatArray, y_mm: FloatArray) -> FloatArray:
        """(...,) the part of `height_mm` that the walls add [mm], 0 inside the contact of this press.

        The correction's data have a contact of their own, up to 0.07 tip radii smaller; here the correction sets in
        at the press's contact edge, over the same width, so the height of a ring of about that width differs.
        """
        along, across = self._from_axis(x_mm, y_mm)
        added = self._added_mm(along, across)
        if self.correction.field is None:
            return added
        radius = np.hypot(along, across) / self.press.tip_radius_mm
        own = self.correction.field.contact_radius
        edge = max(own, self.press.contact_radius_mm / self.press.tip_radius_mm)
        window = contact_window(radius, own)
        return np.where(window > 0.0, added * contact_window(radius, edge) / np.maximum(window, 1e-300), 0.0)

    def _from_axis(self, x_mm: FloatArray, y_mm: FloatArray) -> tuple[FloatArray, FloatArray]:
        along = np.clip(x_mm, 0.0, self.size_mm[0]) - self.at_mm[0]
        return along, np.clip(y_mm, 0.0, self.size_mm[1]) - self.at_mm[1]

    def _added_mm(self, along_mm: FloatArray, across_mm: FloatArray) -> FloatArray:
        tip = self.press.tip_radius_mm
        return tip * self.correction.height(along_mm / tip, across_mm / tip)


def _outward(press: Indentation) -> tuple[FloatArray, FloatArray]:
    """Radius, increasing, and height of the curve; of a stretch that runs back the lowest point is kept."""
    farthest = np.maximum.accumulate(press.radius_mm)
    kept = np.append(True, np.diff(farthest) > _STEP)
    return press.radius_mm[kept], press.height_mm[kept]


def _rim(press: Indentation) -> tuple[FloatArray, FloatArray] | None:
    """The curve beyond the tip's radius in tip radii, as the correction wants it; None for an untouched pad."""
    if press.depth_mm <= 0.0:
        return None
    radius, height = (values / press.tip_radius_mm for values in _outward(press))
    outside = radius > 1.1
    return radius[outside], height[outside]


def pad_surface(
    design: SensorDesign, depth_mm: float, at_mm: tuple[float, float] | None = None
) -> PadSurface:
    """Press a design's tip into its pad and give the whole top.

    Parameters
    ----------
    design : the sensor
    depth_mm : depth of the press [mm]; 0 or less: untouched
    at_mm : (x, y) of the press axis in the cavity frame [mm]; None is the middle

    Raises
    ------
    ModelScopeError : a layer, depth or place that contact model or wall correction do not cover
    """
    solved = solved_press(design, max(depth_mm, design.operating.max_depth_mm), at_mm=at_mm)
    press, size = solved.at(depth_mm), (design.cavity.length_mm, design.cavity.width_mm)
    correction = wall_correction(
        solved.smooth.layer_depth, solved.scaled_depth(depth_mm), walls_of(design, at_mm), _rim(press)
    )
    middle = (0.5 * size[0], 0.5 * size[1])
    return PadSurface(press=press, at_mm=at_mm or middle, size_mm=size, correction=correction)
