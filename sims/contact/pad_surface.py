"""The deformed top of a whole pad under one press, walls included: height at any (x, y).

Built on a square pad of half width b = 16/3 tip radii, pressed in its middle: the curve of the round pad with its wall
at b, which is zero there, and what a square of that width adds to it. That is taken from the round pad of the square's
area, run out beyond half the width (`run_out`), h_a, where the walls do not hold it down:

    S(x, y) = h_b(r) + (h_a(r) - h_b(r)) prod (1 - s^p),  s = way from the axis towards a wall over the wall's own

To it comes what other walls change, the field of `walls`, which is not axisymmetric either. p = `RIM_POWER` is read off
one independent solution, of the published pad pressed in its middle; docs/validation/walls.md has errors of others.
Height here is a function of place: where the surface wraps the shank, it is the lowest of its heights.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from design.errors import ModelScopeError
from design.spec import SensorDesign
from sims.contact.indentation import is_in_library, solved_press
from sims.contact.library.profile_library import LAYERS, shipped_library
from sims.contact.scope import HALF_WIDTH, elastic_depth_mm, round_radius, tip_radius_mm
from sims.contact.walls.near_walls import WallCorrection, wall_correction, walls_of
from sims.contact.walls.shape import contact_window
from sims.press.indentation import Indentation

FloatArray = NDArray[np.float64]

RIM_POWER = 16.0
"""How near to the walls a square pad follows the round one of its area [-]."""
_STEP = 1e-6


@dataclass(frozen=True, kw_only=True)
class PadSurface:
    """The top of a pad under one press.

    Attributes
    ----------
    press : the press as light sees it: a curve around its axis, the force of the place
    reference, of_area : the same depth in the round pads with a wall at 16/3 tip radii and of the area of the square of
        that half width
    at_mm : (x, y) of the press axis in the cavity frame [mm]
    size_mm : length and width of the cavity [mm]
    correction : what the walls add, in tip radii
    """

    press: Indentation
    reference: Indentation
    of_area: Indentation
    at_mm: tuple[float, float]
    size_mm: tuple[float, float]
    correction: WallCorrection

    def height_mm(self, x_mm: FloatArray, y_mm: FloatArray) -> FloatArray:
        """(...,) height of the top over the undisturbed one [mm] at places in the cavity frame [mm].

        Places are shapes that broadcast; (nx, 1) and (1, ny), a grid, are the cheapest.
        """
        along, across = self._from_axis(x_mm, y_mm)
        centred = curve_height_mm(self.reference, np.hypot(along, across))
        return centred + self._squared_mm(along, across) + self._added_mm(along, across)

    def wall_height_mm(self, x_mm: FloatArray, y_mm: FloatArray) -> FloatArray:
        """(...,) the part of `height_mm` that is not in the press's own curve [mm], 0 inside the contact of this press.

        The correction's data have a contact of their own, up to 0.07 tip radii smaller; here the correction sets in
        at the press's contact edge, over the same width, so the height of a ring of about that width differs.
        """
        along, across = self._from_axis(x_mm, y_mm)
        radius = np.hypot(along, across)
        tip, field = self.press.tip_radius_mm, self.correction.field
        edge = self.press.contact_radius_mm / tip
        added = self._added_mm(along, across)
        if field is not None:
            edge = max(field.contact_radius, edge)
            own = contact_window(radius / tip, field.contact_radius)
            added = np.where(own > 0.0, added / np.maximum(own, 1e-300), 0.0)
        added = added + self._squared_mm(along, across)
        added = added + curve_height_mm(self.reference, radius) - curve_height_mm(self.press, radius)
        return np.asarray(added * contact_window(radius / tip, edge), dtype=np.float64)

    def _from_axis(self, x_mm: FloatArray, y_mm: FloatArray) -> tuple[FloatArray, FloatArray]:
        along = np.clip(x_mm, 0.0, self.size_mm[0]) - self.at_mm[0]
        return along, np.clip(y_mm, 0.0, self.size_mm[1]) - self.at_mm[1]

    def _added_mm(self, along_mm: FloatArray, across_mm: FloatArray) -> FloatArray:
        tip = self.press.tip_radius_mm
        return tip * self.correction.height(along_mm / tip, across_mm / tip)

    def _squared_mm(self, along_mm: FloatArray, across_mm: FloatArray) -> FloatArray:
        """What the square of half width 16/3 tip radii adds to the round pad of that radius, 0 at its walls."""
        (x, y), (length, width) = self.at_mm, self.size_mm
        farthest = HALF_WIDTH * self.press.tip_radius_mm
        kept = np.ones(np.broadcast(along_mm, across_mm).shape)
        for outward, wall in (
            (-along_mm, x),
            (along_mm, length - x),
            (-across_mm, y),
            (across_mm, width - y),
        ):
            kept = kept * (1.0 - np.clip(outward / min(wall, farthest), 0.0, 1.0) ** RIM_POWER)
        radius = np.hypot(along_mm, across_mm)
        raised = curve_height_mm(self.of_area, radius) - curve_height_mm(self.reference, radius)
        return np.asarray(kept * raised, dtype=np.float64)


def _outward(press: Indentation) -> tuple[FloatArray, FloatArray]:
    """Radius, increasing, and height of the curve; of a stretch that runs back the lowest point is kept."""
    farthest = np.maximum.accumulate(press.radius_mm)
    kept = np.append(True, np.diff(farthest) > _STEP)
    return press.radius_mm[kept], press.height_mm[kept]


def curve_height_mm(press: Indentation, radius_mm: FloatArray) -> FloatArray:
    """(...,) height of a press [mm] at distances from its axis [mm]; beyond the curve that of its end."""
    radius, height = _outward(press)
    return np.asarray(
        PchipInterpolator(radius, height)(np.clip(radius_mm, 0.0, radius[-1])), dtype=np.float64
    )


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
    ModelScopeError : a tip, layer, depth or place that contact library or wall correction do not cover
    """
    if not is_in_library(design):
        low, high = LAYERS[0] * tip_radius_mm(design), LAYERS[-1] * tip_radius_mm(design)
        raise ModelScopeError(
            "indenter, cavity.clear_thickness_mm + black_thickness_mm: the surface of a whole pad is known for "
            f"hemispheres in layers of {low:g} to {high:g} mm, here {design.indenter.shape} in "
            f"{elastic_depth_mm(design):g} mm"
        )
    solved = solved_press(design, max(depth_mm, design.operating.max_depth_mm), at_mm=at_mm)
    depth, layer = solved.scaled_depth(depth_mm), solved.smooth.layer_depth
    library, side = shipped_library(), 2.0 * HALF_WIDTH
    reference = replace(solved, smooth=library.press(layer)).round_pad_at(depth_mm)
    of_area = replace(solved, smooth=library.press(layer, round_radius(side, side))).at(depth_mm)
    size = (design.cavity.length_mm, design.cavity.width_mm)
    return PadSurface(
        press=solved.at(depth_mm),
        reference=reference,
        of_area=of_area,
        at_mm=at_mm or (0.5 * size[0], 0.5 * size[1]),
        size_mm=size,
        correction=wall_correction(layer, depth, walls_of(design, at_mm), _rim(reference)),
    )
