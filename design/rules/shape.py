"""Rules for the outline and the crown of a pad, and the limits of the contact model.

A crown must span the whole pad, leave a thick enough layer at its edge, and be castable. Limits of the contact model
are checked before a contact is computed.

The packaged library has precomputed contacts for a range of layers, which were compared with an independent
finite-element solution (docs/validation/contact.md). For other layers the contact is computed when needed, which takes
minutes, and the result has not been compared. Beyond `LAYER_DEPTH_RANGE` the contact model is not used.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

from design.fields.finding import Finding, error, mm, warning
from design.fields.quantity import ROUNDING_MM
from design.mold.filling import (
    INSET_MM,
    SPRUE_RADIUS_MM,
    VENT_RADIUS_MM,
    filling_offsets_mm,
    is_cast_under_lid,
)
from design.mold.outline import outline_of
from design.shape.cavity import Plan, cavity_of, part_half_width_mm, plan_of, workspace_of
from design.spec import SensorDesign
from design.spec.layout import expand

LARGEST_SHARE_OF_LAYER = 0.8
"""Deepest press that the contact model covers, as a share of the layers' total thickness (clear and black) [-]."""
DEEPEST_PRESS = 1.7
"""Deepest press that the contact model covers [tip radii]."""
LIBRARY_LAYER_RANGE = (1.3, 6.0)
"""Elastic depths (total thickness of clear and black layer) in the packaged contact library [tip radii]."""
CROWNED_LAYER_RANGE = (DEEPEST_PRESS / LARGEST_SHARE_OF_LAYER, 6.0)
"""Elastic depths (total thickness of clear and black layer) that the contact model covers under a crown [tip radii].

The elastic depth at every location must be in this range.
"""
LAYER_DEPTH_RANGE = (1.0, 10.0)
"""Elastic depths (total thickness of clear and black layer) that the contact model covers [tip radii]."""
NEAREST_WALL = 1.5
"""Least distance of a wall from the axis of a press [tip radii].

The loads that represent a press in the contact model extend this far.
"""
LARGEST_CROWN = 0.25
"""Largest ratio of tip radius to crown radius that the contact model covers [-]."""


def thinnest_elastic_mm(design: SensorDesign) -> float:
    """Least total thickness of clear and black layer in the workspace [mm]; under a crown this is at the border.

    NaN if the crown does not reach the border of the workspace.
    """
    elastic = design.cavity.clear_thickness_mm + design.cavity.black_thickness_mm
    plan, space = plan_of(design), workspace_of(design)
    if space.is_empty:
        return elastic
    return elastic - float(plan.top.sag_mm(*space.points(math.pi / 2).T).max())


def deepest_modelled_mm(design: SensorDesign) -> float:
    """Deepest press that the contact model covers for a design [mm]."""
    return min(
        LARGEST_SHARE_OF_LAYER * thinnest_elastic_mm(design), DEEPEST_PRESS * design.indenter.tip_radius_mm
    )


STEEPEST_RIM_DEG = 60.0
"""Largest slope of a crown at its edge; if steeper, the lid cannot be removed, and a press misses the top."""
LEAST_RIM_MM = 1.0
"""Least thickness of the clear layer at the edge of a crown [mm]."""
WIDEST_FACET = 0.5
"""Largest ratio of a facet's half width to the radius of its round wall."""


def is_spanned(design: SensorDesign) -> bool:
    """Whether the outline, facets and crown form a valid pad, so that locations on it can be computed."""
    return not any(finding.severity == "error" for finding in span_findings(design))


def span_findings(design: SensorDesign) -> Iterator[Finding]:
    """Errors about a crown that does not span its pad or has a thin edge, or facets too wide for their round wall."""
    plan = plan_of(design)
    if not plan.top.is_flat:
        yield from _crown_findings(plan)
    yield from _facet_findings(design, plan)


def shape_findings(design: SensorDesign) -> Iterator[Finding]:
    """Reasons why a pad with round walls or a crown cannot be cast, or cannot be pressed as requested."""
    plan = cavity_of(design).plan
    if plan.is_block:
        return
    yield from _option_findings(design, plan)
    yield from _outside_findings(design, plan)
    if not plan.top.is_flat:
        yield from _lid_findings(design)
        yield from _filling_findings(plan, design.cavity.size_fields[1])
        yield from _press_findings(design, plan)


def _reach_mm(plan: Plan) -> float:
    """Largest distance of the pad's edge from the crown's highest point, or from a cylinder's highest line [mm]."""
    return {"x": plan.width_mm / 2, "y": plan.length_mm / 2, None: plan.radius_mm}[plan.top.straight]


def _crown_findings(plan: Plan) -> Iterator[Finding]:
    reach, radius = _reach_mm(plan), plan.top.radius_mm
    least = reach / math.sin(math.radians(STEEPEST_RIM_DEG))
    if radius < least - ROUNDING_MM:
        yield error(
            "crown.radius_mm",
            "the crown does not span the pad" if radius <= reach else "the crown is too steep at the rim",
            value=f"{radius:g} mm over a reach of {mm(reach)}",
            limit=f"at least {mm(least)}: a slope of {STEEPEST_RIM_DEG:g} degrees",
            way_out="raise it, or make the pad smaller",
        )
        return
    lowest = plan.clear_mm - reach**2 / (radius + math.sqrt(radius**2 - reach**2))
    if lowest < LEAST_RIM_MM - ROUNDING_MM:
        yield error(
            "cavity.clear_thickness_mm",
            "the clear layer is too thin at the rim of the crown",
            value=mm(lowest),
            limit=f"at least {mm(LEAST_RIM_MM)}",
            way_out="raise it, raise crown.radius_mm, or make the pad smaller",
        )


def _facet_findings(design: SensorDesign, plan: Plan) -> Iterator[Finding]:
    told: set[str] = set()
    for place in expand(design.layout, design.cavity):
        if place.angle_deg is None:
            continue
        half, part_id = part_half_width_mm(design, place)
        arc = plan.outline.arc_towards(place.angle_deg)
        most = WIDEST_FACET * arc.radius_mm
        past = arc.past_end_deg(place.angle_deg, half)
        if past > 0.0 and half <= most + ROUNDING_MM:
            yield error(
                place.origin,
                f"the facet of {part_id} at {place.angle_deg:g} degrees reaches past the end of the round wall",
                value=f"by {past:.1f} degrees",
                limit="facets within the round wall, which ends where the straight walls begin",
                way_out=f"turn it {math.ceil(past):g} degrees or more towards the middle of the round wall, or use a "
                "straight wall",
            )
        if half > most + ROUNDING_MM and part_id not in told:
            told.add(part_id)
            yield error(
                place.origin,
                f"the facet of {part_id} is too wide for its round wall",
                value=mm(2 * half),
                limit=f"at most half the diameter, {mm(2 * most)}",
                way_out=f"use a part with less body_width_mm, or raise {design.cavity.size_fields[1]}",
            )


def _option_findings(design: SensorDesign, plan: Plan) -> Iterator[Finding]:
    field = "crown" if is_cast_under_lid(plan) else "cavity.outline"
    if design.mold.cover_ledge_mm:
        yield error(
            "mold.cover_ledge_mm",
            "a glass cover needs a flat rectangular pad",
            value=f"{design.mold.cover_ledge_mm:g} mm",
            limit=f"0 with this {field}",
            way_out="set it to 0",
        )
    if design.mold.pieces != "one":
        yield error(
            "mold.pieces",
            "only the mold of a flat rectangle can be parted",
            value=f"'{design.mold.pieces}'",
            limit=f"'one' with this {field}",
            way_out="set it to 'one'",
        )


def _outside_findings(design: SensorDesign, plan: Plan) -> Iterator[Finding]:
    """Error about a round mold whose outer face is not concentric with the round wall of the pad."""
    along, across = (
        (outer - inner) / 2
        for outer, inner in (
            (design.mold.outer_length_mm, plan.length_mm),
            (design.mold.outer_width_mm, plan.width_mm),
        )
    )
    if plan.outline.bare.arcs and abs(along - across) > ROUNDING_MM:
        yield error(
            design.mold.outside_fields[0],
            "the walls of a mold with round walls must be equally thick all around",
            value=f"walls of {mm(along)} along x, {mm(across)} along y",
            limit="the same for both",
            way_out=f"set it to {plan.length_mm + 2 * across:g} mm, or change {design.mold.outside_fields[1]}",
        )


def _lid_findings(design: SensorDesign) -> Iterator[Finding]:
    if design.mold.fixing_hole_diameter_mm == 0:
        yield error(
            "mold.fixing_hole_diameter_mm",
            "the lid that shapes the crown has no fixing",
            value="no fixing holes",
            limit="above 0: the lid's pins go into them",
            way_out="give fixing holes, preferably of 2 to 4 mm",
        )
    outline = outline_of(design)
    high = [s.part for s in outline.sockets if s.part.body_top_mm > outline.top_mm + ROUNDING_MM]
    if high:
        worst = max(high, key=lambda part: part.body_top_mm)
        names = " ".join(part.name for part in high)
        yield error(
            worst.height_field,
            f"the lid that shapes the crown would rest on the bodies of {names}",
            value=f"{mm(worst.body_top_mm - outline.top_mm)} above the rim",
            limit=f"at most {mm(outline.top_mm)}, the rim of the mold",
            way_out="lower it, raise mold.rim_mm, or use a part with less body_height_mm",
        )


def _filling_findings(plan: Plan, size_field: str) -> Iterator[Finding]:
    across = min(filling_offsets_mm(plan))
    least = (SPRUE_RADIUS_MM + VENT_RADIUS_MM) / 2 + 0.5
    if across < least:
        yield error(
            size_field,
            "the floor has no room for sprue and vents, through which a crowned pad is filled",
            value=f"{mm(across)} from the middle to them",
            limit=f"at least {mm(least)}, with their middles {mm(INSET_MM)} from the walls",
            way_out="raise it, or leave the crown out",
        )


def _press_findings(design: SensorDesign, plan: Plan) -> Iterator[Finding]:
    space, depth = workspace_of(design), design.operating.max_depth_mm
    tip, bend_mm = design.indenter.tip_radius_mm, plan.top.radius_mm
    if tip / bend_mm > LARGEST_CROWN + ROUNDING_MM:
        yield warning(
            "indenter.tip_radius_mm",
            "the crown is more curved than the contact model covers, so the verdict will be OUT_OF_MODEL_SCOPE",
            value=f"{tip:g} mm on a crown of {bend_mm:g} mm",
            limit=f"at most {LARGEST_CROWN:g} of the crown's radius",
            way_out="use a smaller tip, or raise crown.radius_mm",
        )
    if space.is_empty:
        return
    corner = space.clamped(0.0, 0.0)
    there = plan.top_mm(*corner)
    if there + ROUNDING_MM < depth <= plan.clear_mm + ROUNDING_MM:  # deeper presses have another finding
        yield error(
            "operating.max_depth_mm",
            "the deepest press is deeper than the clear layer at the border of the workspace",
            value=f"{depth:g} mm",
            limit=f"at most {mm(there)} at x {corner[0]:.3g}, y {corner[1]:.3g} mm",
            way_out="lower it, raise operating.workspace_margin_mm, or thicken the layer",
        )
