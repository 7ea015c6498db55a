"""Presses on pads that are no blocks: local thickness and mean curvature.

Model
-----
A press goes along the normal of the untouched top at its place (x, y), to a depth d from first touch. It is taken for
the axisymmetric press at the apex of a round pad

- as thick as the pad is there, along the normal (nearer to finite elements than the height over the bottom),
- under a sphere of the top's mean curvature: 1/C under a sphere of radius C, 1/(2C) under a cylinder,
- with its wall at the radius of the pad's area, moved into what the library has. Between round walls its surface is
  followed to the nearest wall and runs out to the farthest one.

A flat pad is pressed in the same way, without the crown, also by tips that are solved live. Heights are those above
the untouched top, along the normal. The exact case is the middle of a disc, flat or under a sphere.
docs/validation/contact-crowns.md compares presses beside it with finite elements in three dimensions.

Left out: that the wall is nearer on one side and the layer thinner, which tilts the top around the tip, and the
difference of a cylinder's two curvatures.
"""

from __future__ import annotations

import math

from design.errors import InputError, ModelScopeError
from design.rules.contact_scope import CROWNED_LAYER_RANGE, NEAREST_WALL
from design.shape.cavity import cavity_of
from design.shape.plan import plan_of
from design.spec import SensorDesign
from sims.contact.library.profile_library import shipped_library
from sims.contact.library.smooth_press import SmoothPress
from sims.contact.scope import layer_depth, mean_crown, tip_radius_mm, wall_radius
from sims.contact.tip import HEMISPHERE, tip_of

Place = tuple[float, float]


def crowned_press(design: SensorDesign, at_mm: Place | None) -> SmoothPress:
    """The presses at a place of a crowned pad, from the library.

    Parameters
    ----------
    at_mm : (x, y) where the tip touches first, in plan [mm]; None is the middle

    Raises
    ------
    ModelScopeError : a tip that is no hemisphere; a layer or crown that the library does not cover
    """
    if tip_of(design.indenter) != HEMISPHERE:
        raise ModelScopeError(
            f"indenter.shape: '{design.indenter.shape}', but only a hemisphere is pressed into a crowned pad; "
            "use one, or leave the crown out"
        )
    layer, tip = layer_depth(design, at_mm), tip_radius_mm(design)
    low, high = CROWNED_LAYER_RANGE
    if not low - 1e-9 <= layer <= high + 1e-9:
        raise ModelScopeError(
            f"cavity.clear_thickness_mm: clear and black layer are {layer * tip:.4g} mm together at a place that is "
            f"pressed; presses into crowned pads are known for {low * tip:.4g} to {high * tip:.4g} mm with this tip; "
            "change it, or indenter.tip_radius_mm"
        )
    return shipped_library().press(layer, wall_radius(design), mean_crown(design))


def round_walls_mm(design: SensorDesign, at_mm: Place | None) -> tuple[float, float] | None:
    """Nearest and farthest wall of a pad with round walls from a place, None is the middle [mm]; else None."""
    outline = plan_of(design).outline
    place = outline.centre_mm if at_mm is None else at_mm
    return (float(outline.gap_mm(*place)), outline.farthest_mm(*place)) if outline.arcs else None


def require_place(design: SensorDesign, at_mm: Place) -> None:
    """Refuse places outside a pad, or nearer to a wall than the contact model covers.

    Raises
    ------
    InputError, ModelScopeError : such a place
    """
    plan, tip = cavity_of(design).plan, tip_radius_mm(design)
    if not all(map(math.isfinite, at_mm)) or not plan.contains(*at_mm):
        raise InputError(f"at_mm: x = {at_mm[0]:g}, y = {at_mm[1]:g} mm must lie in the pad")
    gap = float(plan.outline.gap_mm(*at_mm))
    if gap < NEAREST_WALL * tip - 1e-9:
        raise ModelScopeError(
            f"at_mm: the nearest wall is {gap / tip:.2f} tip radii from the press axis; the contact model "
            f"covers {NEAREST_WALL:g} and more; press farther from it, raise operating.workspace_margin_mm, or use a "
            "smaller tip"
        )
