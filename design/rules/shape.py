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

from optopad.design.draft import Draft
from optopad.design.fields.finding import Finding, error, mm, outside_models
from optopad.design.fields.quantity import ROUNDING_MM
from optopad.design.mold.filling import (
    INSET_MM,
    LEAST_PASSAGE_MM,
    SPRUE_RADIUS_MM,
    VENT_RADIUS_MM,
    filling_offsets_mm,
    is_cast_under_lid,
    passage_mm,
)
from optopad.design.shape.cavity import Plan, part_half_width_mm
from optopad.design.spec.indenter import Indenter, tip_outline

LARGEST_SHARE_OF_LAYER = 0.8
"""Deepest press that the contact model covers, as a share of the layers' total thickness (clear and black) [-]."""
LEAST_PRESS_MM = 0.3
"""Least deepest press on which a verdict is possible: the least length of a deadband [mm]."""
DEEPEST_PRESS = 1.7
"""Deepest press that the contact model covers [tip radii]."""
DEEPEST_PUNCH = 0.65
"""Deepest press of a flat punch with a sharp edge that the contact model covers [tip radii].

In a layer of 2.4 tip radii, the solved surface enters the edge by more than 0.02 tip radii from a depth of 0.7 on.
"""
SHARP_EDGE = 0.2
"""Radius of a flat punch's edge below which `DEEPEST_PUNCH` holds: two spacings of the contact mesh [tip radii]."""
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
NARROW = 5.0
"""Width of a pad below which the walls may change a hemisphere's presses too much for the contact model [tip radii]."""
LARGEST_CROWN = 0.25
"""Largest ratio of tip radius to crown radius that the contact model covers [-]."""
LARGEST_REACH = 0.8
"""Largest radius of a crowned pad that the contact model covers, over the crown's radius [-]."""
LEAST_RIM_SHARE = 0.15
"""Least thickness of the elastic layer at the rim of a crowned pad, over that at the apex [-].

The mesh has as many layers of elements at the rim as at the apex, so they become thin there.
"""
WALL_RADIUS_RANGE = (3.76126389, 7.5)
"""Range of the solved round pads' radii [tip radii]. With a 3 mm tip, it covers the areas of square pads of 20 to
40 mm. From 6.0 to 7.5, the force at a depth of 1 tip radius falls by only 1 %.
"""


def thinnest_elastic_mm(draft: Draft) -> float:
    """Least total thickness of clear and black layer in the workspace [mm]; under a crown this is at the border.

    NaN if the crown does not reach the border of the workspace.
    """
    elastic = draft.design.cavity.elastic_mm
    plan, space = draft.plan, draft.workspace
    if space.is_empty:
        return elastic
    return elastic - float(plan.top.sag_mm(*space.points(math.pi / 2).T).max())


def deepest_modelled_mm(draft: Draft) -> float:
    """Deepest press that the contact model covers for a design [mm]."""
    return min(
        LARGEST_SHARE_OF_LAYER * thinnest_elastic_mm(draft),
        deepest_of_tip(draft.design.indenter) * draft.design.indenter.tip_radius_mm,
    )


def is_wide(draft: Draft) -> bool:
    """Whether the walls change presses as little as the contact model covers, without a computation.

    A hemisphere's presses change by 17 % of their depth at most; other pads than flat rectangles have no such limit.
    """
    plan, tip = draft.plan, draft.design.indenter
    narrow = min(plan.length_mm, plan.width_mm) < NARROW * tip.tip_radius_mm
    return not plan.is_block or (tip.shape == "hemisphere" and not narrow)


def deepest_of_tip(tip: Indenter) -> float:
    """Deepest press that the contact model covers for the shape of a tip [tip radii]."""
    is_sharp = tip.shape == "flat_punch" and tip_outline(tip)[-1].radius < SHARP_EDGE * tip.tip_radius_mm
    return DEEPEST_PUNCH if is_sharp else DEEPEST_PRESS


STEEPEST_RIM_DEG = 60.0
"""Largest slope of a crown at its edge; if steeper, the lid cannot be removed, and a press misses the top."""
LEAST_RIM_MM = 1.0
"""Least thickness of the clear layer at the edge of a crown [mm]."""
WIDEST_FACET = 0.5
"""Largest ratio of a facet's half width to the radius of its round wall."""


def is_spanned(draft: Draft) -> bool:
    """Whether the outline, facets and crown form a valid pad, so that locations on it can be computed."""
    return not any(finding.severity == "error" for finding in span_findings(draft))


def span_findings(draft: Draft) -> Iterator[Finding]:
    """Errors about a crown that does not span its pad or has a thin edge, or facets too wide for their round wall."""
    plan = draft.plan
    if not plan.top.is_flat:
        yield from _crown_findings(plan)
    yield from _facet_findings(draft, plan)


def shape_findings(draft: Draft) -> Iterator[Finding]:
    """Reasons why a pad with round walls or a crown cannot be cast, or cannot be pressed as requested."""
    plan = draft.cavity.plan
    if plan.is_block:
        return
    yield from _option_findings(draft, plan)
    yield from _outside_findings(draft, plan)
    if not plan.top.is_flat:
        yield from _lid_findings(draft)
        yield from (
            _passage_findings(draft)
            if draft.design.is_on_board
            else _filling_findings(plan, draft.design.cavity.size_fields[1])
        )
        yield from _press_findings(draft, plan)


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


def _facet_findings(draft: Draft, plan: Plan) -> Iterator[Finding]:
    told: set[str] = set()
    for place in draft.places:
        if place.angle_deg is None:
            continue
        half, part_id = part_half_width_mm(draft.design, place)
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
                way_out=f"use a part with less body_width_mm, or raise {draft.design.cavity.size_fields[1]}",
            )


def _option_findings(draft: Draft, plan: Plan) -> Iterator[Finding]:
    field = "crown" if is_cast_under_lid(plan) else "cavity.outline"
    if draft.design.mold.cover_ledge_mm:
        yield error(
            "mold.cover_ledge_mm",
            "a glass cover needs a flat rectangular pad",
            value=f"{draft.design.mold.cover_ledge_mm:g} mm",
            limit=f"0 with this {field}",
            way_out="set it to 0",
        )
    if draft.design.mold.pieces != "one":
        yield error(
            "mold.pieces",
            "only the mold of a flat rectangle can be parted",
            value=f"'{draft.design.mold.pieces}'",
            limit=f"'one' with this {field}",
            way_out="set it to 'one'",
        )


def _outside_findings(draft: Draft, plan: Plan) -> Iterator[Finding]:
    along, across = (
        (outer - inner) / 2
        for outer, inner in (
            (draft.design.mold.outer_length_mm, plan.length_mm),
            (draft.design.mold.outer_width_mm, plan.width_mm),
        )
    )
    if plan.outline.bare.arcs and abs(along - across) > ROUNDING_MM:
        yield error(
            draft.design.mold.outside_fields[0],
            "the walls of a mold with round walls must be equally thick all around",
            value=f"walls of {mm(along)} along x, {mm(across)} along y",
            limit="the same for both",
            way_out=f"set it to {plan.length_mm + 2 * across:g} mm, or change {draft.design.mold.outside_fields[1]}",
        )


def _lid_findings(draft: Draft) -> Iterator[Finding]:
    if draft.design.mold.fixing_hole_diameter_mm == 0:
        yield error(
            "mold.fixing_hole_diameter_mm",
            "the lid that shapes the crown has no fixing",
            value="no fixing holes",
            limit="above 0: the lid's pins go into them",
            way_out="give fixing holes, preferably of 2 to 4 mm",
        )
    outline = draft.outline
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


def _passage_findings(draft: Draft) -> Iterator[Finding]:
    size = passage_mm(draft.plan, draft.outline.top_mm, draft.design.mold.min_web_mm)
    if size < LEAST_PASSAGE_MM - ROUNDING_MM:
        yield error(
            "cavity.clear_thickness_mm",
            "the frame's walls have no room for sprue and vents, through which a crowned pad is filled",
            value=f"{mm(draft.plan.rim_mm[0])} of clear layer at the edge, rim at {mm(draft.outline.top_mm)}",
            limit=f"at least {mm(LEAST_PASSAGE_MM)} at the edge, and mold.min_web_mm more at the rim",
            way_out="raise it or crown.radius_mm, or leave the crown out",
        )


def _press_findings(draft: Draft, plan: Plan) -> Iterator[Finding]:
    space, depth = draft.workspace, draft.design.operating.max_depth_mm
    yield from _crowned_contact_findings(draft, plan)
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


def _crowned_contact_findings(draft: Draft, plan: Plan) -> Iterator[Finding]:
    tip, bend = draft.design.indenter.tip_radius_mm, plan.top.mean_curvature
    if draft.design.indenter.shape != "hemisphere":
        yield outside_models(
            "indenter.shape",
            "only a hemisphere is pressed into a crowned pad",
            value=f"'{draft.design.indenter.shape}'",
            limit="'hemisphere'",
            way_out="use one, or leave the crown out",
        )
    if tip * bend > LARGEST_CROWN + ROUNDING_MM:
        yield outside_models(
            "indenter.tip_radius_mm",
            "the crown is more curved than the contact model covers",
            value=f"{tip:g} mm on a crown of {1.0 / bend:g} mm mean radius",
            limit=f"at most {LARGEST_CROWN:g} of the crown's radius",
            way_out="use a smaller tip, or raise crown.radius_mm",
        )
        return
    low, high = (radii * tip for radii in WALL_RADIUS_RANGE)
    wall = min(max(math.sqrt(plan.area_mm2 / math.pi), low), high)
    reach = wall * bend
    if reach > LARGEST_REACH + 1e-9:
        yield outside_models(
            "crown.radius_mm",
            "the crown is steeper at the wall than the contact model covers",
            value=f"{1.0 / bend:.2f} mm mean radius over a reach of {mm(wall)}",
            limit=f"at least {mm(wall / LARGEST_REACH)}",
            way_out="raise it, use a smaller pad, or a smaller indenter.tip_radius_mm where the pad is narrower than "
            f"{2.0 * low:.3g} mm",
        )
        return
    fall = bend * wall**2 / (1.0 + math.sqrt(1.0 - reach**2))
    corner = draft.workspace.clamped(0.0, 0.0)
    elastic = draft.design.cavity.elastic_mm
    thinnest = float((elastic - plan.top.sag_mm(*corner)) / plan.top.normal(*corner)[2])
    if not thinnest - fall >= LEAST_RIM_SHARE * thinnest:
        yield outside_models(
            "crown.radius_mm",
            "the layer at the rim of the crown is thinner than the contact model covers",
            value=f"the crown falls by {mm(fall)} to the wall",
            limit=f"at most {mm((1.0 - LEAST_RIM_SHARE) * thinnest)}, {1.0 - LEAST_RIM_SHARE:.0%} of both layers at "
            "the border of the workspace",
            way_out="raise it, thicken the layers, or use a smaller pad",
        )
