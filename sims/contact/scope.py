"""Range of the contact model: layer thickness, press depth and walls, and the depths that are solved.

The limits come from this project's feasibility study (section "Contact"). Outside these limits, MuJoCo's solution was
not compared with the independent finite-element solution.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from optopad.design.arrays import FloatArray
from optopad.design.draft import Draft
from optopad.design.errors import DesignError, InputError, ModelScopeError
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
from optopad.design.shape.cavity import plan_of

if TYPE_CHECKING:
    from optopad.design.spec import SensorDesign


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


def _positive(name: str, value: float) -> float:
    """Return the value if it is a positive finite number; otherwise raise `InputError`."""
    if not (math.isfinite(value) and value > 0.0):
        raise DesignError(f"{name}: {value:g} must be a positive number")
    return value


def tip_radius_mm(design: SensorDesign) -> float:
    """Radius of the tip [mm]."""
    return _positive("indenter.tip_radius_mm", design.indenter.tip_radius_mm)


def elastic_depth_mm(design: SensorDesign) -> float:
    """Thickness of the elastic layer [mm]: clear and black layer together, which deform as one elastomer."""
    cavity = design.cavity
    return _positive(
        "cavity.clear_thickness_mm + cavity.black_thickness_mm",
        cavity.clear_thickness_mm + cavity.black_thickness_mm,
    )


def layer_depth(design: SensorDesign, at_mm: tuple[float, float] | None = None) -> float:
    """Thickness of the elastic layer (clear and black) over tip radius [-].

    Parameters
    ----------
    design : the sensor
    at_mm : (x, y) in cavity coordinates where the thickness is measured, along the normal of the top [mm]. None is
        the highest point of the top

    Raises
    ------
    ModelScopeError : the thickness is outside the modelled range
    """
    radius = tip_radius_mm(design)
    depth = elastic_depth_mm(design)
    if at_mm is not None:
        top = plan_of(design).top
        depth = float((depth - top.sag_mm(*at_mm)) / top.normal(*at_mm)[2])
    ratio = depth / radius
    low, high = LAYER_DEPTH_RANGE
    if not low - 1e-9 <= ratio <= high + 1e-9:
        raise ModelScopeError(
            f"cavity.clear_thickness_mm + black_thickness_mm: elastic depth {ratio * radius:.4g} mm is {ratio:.2f} "
            f"tip radii; the contact model covers {low} to {high}, here {low * radius:g} to {high * radius:g} mm"
        )
    return ratio


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


@once
def wall_radius(design: SensorDesign) -> float:
    """Radius of the round pad with the area of the design's pad [tip radii], clipped to `WALL_RADIUS_RANGE`."""
    radius = math.sqrt(plan_of(design).area_mm2 / math.pi) / tip_radius_mm(design)
    low, high = WALL_RADIUS_RANGE
    return min(max(radius, low), high)


@once
def mean_crown(design: SensorDesign) -> float:
    """Tip radius times the mean curvature of the undeformed top [-]; 0 for a flat top."""
    return tip_radius_mm(design) * plan_of(design).top.mean_curvature


@once
def depth_limit_mm(design: SensorDesign) -> float:
    """Deepest press that the contact model covers at every location of the design's pad [mm]."""
    tip_radius_mm(design), elastic_depth_mm(design)  # raises if values are not numbers
    return deepest_modelled_mm(Draft(design))


def require_depth(design: SensorDesign, depth_mm: float, name: str) -> float:
    """Return the depth [mm] if the contact model covers it; otherwise raise an error whose message starts with `name`.

    Raises
    ------
    InputError : the depth is not a finite number
    ModelScopeError : the depth exceeds the model's range
    """
    if not math.isfinite(depth_mm):
        raise InputError(f"{name}: {depth_mm} must be a finite number of mm")
    limit = depth_limit_mm(design)
    if depth_mm > limit + 1e-9:
        raise ModelScopeError(
            f"{name}: {depth_mm:g} mm is deeper than the contact model covers: {limit:g} mm, the smaller of "
            f"{LARGEST_SHARE_OF_LAYER} of the elastic depth and {deepest_of_tip(design.indenter):g} tip radii; "
            "press less deep or make the pad thicker"
        )
    return depth_mm


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
