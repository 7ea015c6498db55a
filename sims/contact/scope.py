"""Range of the contact model: layer thickness, press depth and walls, and the depths that are solved.

The limits come from this project's feasibility study (section "Contact"). Outside these limits, MuJoCo's solution was
not compared with the independent finite-element solution.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from optopad.design.arrays import FloatArray
from optopad.design.draft import Draft
from optopad.design.errors import InputError, ModelScopeError
from optopad.design.once import once
from optopad.design.rules.shape import (
    DEEPEST_PRESS,
    LARGEST_SHARE_OF_LAYER,
    LAYER_DEPTH_RANGE,
    LEAST_RIM_SHARE,
    WALL_RADIUS_RANGE,
    deepest_modelled_mm,
    deepest_of_tip,
)
from optopad.design.spec import SensorDesign
from optopad.sims.contact.tip import TipOutline, tip_of

Place = tuple[float, float]


class ContactSolveError(RuntimeError):
    """The contact solver returned a state that fails the checks."""


HALF_WIDTH = 16 / 3
"""Half width of the published pad [tip radii]: 16 mm for a 3 mm tip."""
WALL_RADIUS = 16 / 3
"""Default wall radius of a round pad [tip radii]."""
FIRST_DEPTHS = (0.02 / 3, 0.05 / 3, 0.1 / 3, 0.15 / 3, 0.2 / 3)
"""First solved depths [tip radii]. They are close together, because mode 1 of a pair can end within 0.2 mm."""
DEPTH_STEP = 0.1 / 3
"""Step between solved depths after the first ones [tip radii]."""


def round_radius(length: float, width: float) -> float:
    """Radius of the round pad with the area of a rectangular pad, in the unit of `length` and `width`.

    Rubber is incompressible, so the volume that the tip displaces rises elsewhere, over the area of the pad. With equal
    areas, the free surfaces of a round and a square pad therefore agree within a few micrometres, except next to the
    walls. The effect of the real walls is added later (`library.solved_press`).
    """
    return math.sqrt(length * width / math.pi)


def half_width_of(radius: float) -> float:
    """Half width of the square pad with the area of a round pad, in the unit of the radius."""
    return 0.5 * math.sqrt(math.pi) * radius


@dataclass(frozen=True, eq=False)
class Contact:
    """A design's tip and pad, as all its presses share them; each value is computed when it is first asked for.

    Attributes
    ----------
    draft : the design, and what is resolved from it
    """

    draft: Draft

    @property
    def design(self) -> SensorDesign:
        """The design."""
        return self.draft.design

    @property
    def tip_radius_mm(self) -> float:
        """Radius of the tip [mm]."""
        return self.design.indenter.tip_radius_mm

    @cached_property
    def tip(self) -> TipOutline:
        """Outline of the tip."""
        return tip_of(self.design.indenter)

    @cached_property
    def layer(self) -> float:
        """Thickness of the elastic layer at the highest point of the top [tip radii]; errors as of `layer_at`."""
        return self.layer_at(None)

    def layer_at(self, at_mm: Place | None) -> float:
        """Thickness of the elastic layer (clear and black, which deform as one elastomer) over tip radius [-].

        Parameters
        ----------
        at_mm : (x, y) in cavity coordinates where the thickness is measured, along the normal of the top [mm]. None is
            the highest point of the top

        Raises
        ------
        ModelScopeError : the thickness is outside the modelled range
        """
        cavity, radius = self.design.cavity, self.tip_radius_mm
        depth = cavity.elastic_mm
        if at_mm is not None:
            top = self.draft.plan.top
            depth = float((depth - top.sag_mm(*at_mm)) / top.normal(*at_mm)[2])
        ratio = depth / radius
        low, high = LAYER_DEPTH_RANGE
        if not low - 1e-9 <= ratio <= high + 1e-9:
            raise ModelScopeError(
                f"cavity.clear_thickness_mm + black_thickness_mm: elastic depth {ratio * radius:.4g} mm is {ratio:.2f} "
                f"tip radii; the contact model covers {low} to {high}, here {low * radius:g} to {high * radius:g} mm"
            )
        return ratio

    @cached_property
    def wall_radius(self) -> float:
        """Radius of the round pad with the area of the design's pad [tip radii], clipped to `WALL_RADIUS_RANGE`."""
        radius = math.sqrt(self.draft.plan.area_mm2 / math.pi) / self.tip_radius_mm
        low, high = WALL_RADIUS_RANGE
        return min(max(radius, low), high)

    @cached_property
    def mean_crown(self) -> float:
        """Tip radius times the mean curvature of the undeformed top [-]; 0 for a flat top."""
        return self.tip_radius_mm * self.draft.plan.top.mean_curvature

    @cached_property
    def depth_limit_mm(self) -> float:
        """Deepest press that the contact model covers at every location of the design's pad [mm]."""
        return deepest_modelled_mm(self.draft)

    @cached_property
    def deepest_mm(self) -> float:
        """Deepest press of the design [mm]; errors are those of `require_depth`."""
        return self.require_depth(self.design.operating.max_depth_mm, "operating.max_depth_mm")

    def require_depth(self, depth_mm: float, name: str) -> float:
        """Return the depth [mm] if the contact model covers it; otherwise raise an error that starts with `name`.

        Raises
        ------
        InputError : the depth is not a finite number
        ModelScopeError : the depth exceeds the model's range
        """
        if not math.isfinite(depth_mm):
            raise InputError(f"{name}: {depth_mm} must be a finite number of mm")
        limit = self.depth_limit_mm
        if depth_mm > limit + 1e-9:
            raise ModelScopeError(
                f"{name}: {depth_mm:g} mm is deeper than the contact model covers: {limit:g} mm, the smaller of "
                f"{LARGEST_SHARE_OF_LAYER} of the elastic depth and {deepest_of_tip(self.design.indenter):g} tip "
                "radii; press less deep or make the pad thicker"
            )
        return depth_mm


@once
def contact_of(design: SensorDesign) -> Contact:
    """A design's tip and pad, as all its presses share them."""
    return Contact(Draft.of(design))


def solved_depths(layer: float, deepest: float) -> FloatArray:
    """Depths to solve, from a fixed series: up to the first one that is at least `deepest`.

    Parameters
    ----------
    layer : layer thickness [tip radii]
    deepest : deepest press requested [tip radii]

    Returns
    -------
    (depth,) increasing depths [tip radii]; none exceeds the model's limit
    """
    limit = min(LARGEST_SHARE_OF_LAYER * layer, DEEPEST_PRESS)
    count = math.ceil((limit - FIRST_DEPTHS[-1]) / DEPTH_STEP)
    schedule = np.append(FIRST_DEPTHS, FIRST_DEPTHS[-1] + DEPTH_STEP * np.arange(1, count + 1))
    schedule = np.unique(np.minimum(schedule, limit))
    if schedule.size > 1 and schedule[-1] - schedule[-2] < 1e-6:
        schedule = np.delete(schedule, -2)
    return schedule[: int(np.searchsorted(schedule, deepest - 1e-9)) + 1]


def crown_drop(radius: FloatArray, crown: float) -> FloatArray:
    """Drop (...) of the undeformed crowned top below its apex, at radii (...) [tip radii].

    The top is a sphere of radius 1/κ about the axis: s(r) = 1/κ - √(1/κ² - r²), written so that no digits are lost
    where κ is small.

    Parameters
    ----------
    radius : (...) distance from the axis, at most 1/crown [tip radii]
    crown : tip radius over the crown's radius [-]
    """
    bent = crown * np.asarray(radius, dtype=np.float64)
    return np.asarray(bent * radius / (1.0 + np.sqrt(1.0 - bent**2)), dtype=np.float64)


def crown_slope(radius: FloatArray, crown: float) -> FloatArray:
    """Slope (...) of `crown_drop` over the radius [-], at radii (...) below 1/crown [tip radii]."""
    bent = crown * np.asarray(radius, dtype=np.float64)
    return np.asarray(bent / np.sqrt(1.0 - bent**2), dtype=np.float64)


def require_rim(layer_depth: float, wall_radius: float, crown: float) -> None:
    """Refuse a crown that leaves the pad too thin at its rim.

    Parameters
    ----------
    layer_depth, wall_radius : thickness at the apex, radius of the wall [tip radii]
    crown : tip radius over the crown's radius [-]

    Raises
    ------
    InputError : the crown is not a finite number, or is negative
    ModelScopeError : the crown ends before the wall, or the rim is thinner than `LEAST_RIM_SHARE` of the apex
    """
    if not (math.isfinite(crown) and crown >= 0.0):
        raise InputError(
            f"crown: {crown:g} must be 0 (flat) or more, the tip's radius over the crown's: only convex tops are solved"
        )
    if crown * wall_radius >= 1.0:
        raise ModelScopeError(
            f"crown: a sphere of {1.0 / crown:.3f} tip radii ends before the wall at {wall_radius:.3f}; "
            "take a larger crown radius or a smaller pad"
        )
    rim = layer_depth - float(crown_drop(np.array(wall_radius), crown))
    least = LEAST_RIM_SHARE * layer_depth
    if rim < least:
        raise ModelScopeError(
            f"crown: {rim:.3f} tip radii are left at the rim, {least:.3f} are needed ({LEAST_RIM_SHARE:g} of the "
            "thickness at the apex); take a larger crown radius, a smaller pad or a thicker layer"
        )
