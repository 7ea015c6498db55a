"""Can the mold be printed? Every clearance of `design.mold.webs` that is not kept, in the user's words.

What one change mends is one finding, which tells the worst place and counts the others.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from design.fields.finding import Finding, error, mm, warning
from design.mold.filling import is_cast_under_lid
from design.mold.webs import Clearance, clearances, rim_clearances
from design.shape.plan import plan_of
from design.spec import SensorDesign


@dataclass(frozen=True, kw_only=True)
class Words:
    """What a clearance that is not kept means, and what to do.

    Places to fill in: {where}, {parts}, {wall} and {field} of the clearance; its {value}, what is {needed},
    the value as an {overlap}, {twice} what is lacking, the inner {length} of the wall, what the {mouth} of the mold is,
    and the fields of its {outside}.
    """

    message: str
    way_out: str
    value: str = "{value}"
    limit: str = "at least mold.min_web_mm = {needed}"


_SPREAD = "place fewer parts, spread them, or enlarge the cavity"
_RAISE = "raise {field} by {twice} or more, or shrink the cavity"
_HOLE = "mold.fixing_hole_diameter_mm (0 for none)"
_THICKEN = f"{_RAISE}, or use a part with less body_depth_mm"
_FROM_HOLE = f"change {{field}} or {_HOLE}, or move the part"
_LEADS = "lower {field} or mold.min_web_mm, or use a part with "

WORDS = {
    "wall": Words(message="{parts} are too thin", way_out=_RAISE),
    "cover seat to outer face": Words(
        message="the web behind the cover's seat is too thin in {parts}",
        way_out="lower {field}, or raise mold.outer_length_mm and mold.outer_width_mm",
    ),
    "fixing hole to outer face": Words(
        message="the web between a fixing hole and the outer face is too thin",
        way_out=f"raise {{field}} or lower {_HOLE}",
    ),
    "fixing hole to fixing hole": Words(
        message="the web between a fixing hole and the next fixing hole is too thin",
        way_out=f"lower {{field}} or {_HOLE}",
    ),
    "fixing hole to cavity": Words(
        message="the web between a fixing hole and the {mouth} is too thin",
        way_out=f"lower {{field}} or {_HOLE}, or raise {{outside}}",
    ),
    "body to body": Words(
        message="the bodies of {where} overlap",
        value="by {overlap}",
        limit="{needed} between bodies",
        way_out=_SPREAD,
    ),
    "pocket to pocket": Words(message="the web between the sockets of {where} is too thin", way_out=_SPREAD),
    "pocket to corner": Words(
        message="the socket of {parts} reaches into the end of the {wall} wall",
        value="{value} to the corner",
        limit="at least mold.min_web_mm = {needed} on a wall of {length}",
        way_out="move it inward, place fewer parts, or lengthen the cavity",
    ),
    "pocket back to outer face": Words(
        message="the wall behind the socket of {where} is too thin", way_out=_THICKEN
    ),
    "floor under pocket": Words(
        message="the floor below the socket of {where} is too thin", way_out="raise mold.floor_mm or {field}"
    ),
    "pocket below fill level": Words(
        message="the socket of {where} hardly reaches below the top of the clear layer",
        way_out="lower {field} or raise cavity.clear_thickness_mm",
    ),
    "pocket to fixing hole": Words(
        message="the web between a fixing hole and the socket of {where} is too thin", way_out=_FROM_HOLE
    ),
    "wire slot to fixing hole": Words(
        message="the web between a fixing hole and the wire slot of {where} is too thin", way_out=_FROM_HOLE
    ),
    "lead hole to fixing hole": Words(
        message="the web between a fixing hole and a lead hole of {where} is too thin", way_out=_FROM_HOLE
    ),
    "wire slot to wire slot": Words(
        message="the web between the wire slots of {where} is too thin", way_out=f"{_LEADS}more lead_pitch_mm"
    ),
    "lead hole to lead hole": Words(
        message="the web between the lead holes of {where} is too thin", way_out=f"{_LEADS}more lead_pitch_mm"
    ),
    "lead hole to cavity": Words(
        message="the web from the lead holes to the cavity is too thin at {where}",
        way_out=f"{_LEADS}more lead_setback_mm",
    ),
    "lead hole to outer face": Words(
        message="the web from the lead holes to the outer face is too thin at {where}", way_out=_THICKEN
    ),
    "lead hole to pocket edge": Words(
        message="the web from the lead holes to the socket's edge is too thin at {where}",
        limit="at least {needed}",
        way_out="lower {field}, or use a part with more body_width_mm or body_depth_mm",
    ),
    "body below rim": Words(
        message="the body of {where} sticks out above the rim",
        value="by {overlap}",
        limit="at most 0.00 mm",
        way_out="raise mold.rim_mm or lower the part; the leveling blade will meet it",
    ),
}


def web_findings(design: SensorDesign) -> Iterator[Finding]:
    """Everything that keeps the mold from being printed, and what will be in the blade's way."""
    above_rim = () if is_cast_under_lid(plan_of(design)) else rim_clearances(design)  # a lid has its own rule
    for finding, found in ((error, clearances(design)), (warning, above_rim)):
        for group in _groups([one for one in found if not one.is_kept]):
            worst, more = min(group, key=lambda one: one.spare_mm), len(group) - 1
            said, fill = WORDS[worst.name], _filling(worst, design)
            others = f" (and {more} more place{'s' if more > 1 else ''})" if more else ""
            yield finding(
                worst.field,
                said.message.format(**fill) + others,
                value=said.value.format(**fill),
                limit=said.limit.format(**fill),
                way_out=said.way_out.format(**fill),
            )


def _groups(found: list[Clearance]) -> list[list[Clearance]]:
    """Those with the same way out, of the same field; in the layout, which has many, of the same wall."""
    groups: dict[tuple[str, str | None], list[Clearance]] = {}
    for one in found:
        place = one.wall if one.field.startswith("layout.") else one.field
        groups.setdefault((WORDS[one.name].way_out, place), []).append(one)
    return list(groups.values())


def _filling(one: Clearance, design: SensorDesign) -> dict[str, str | None]:
    """What fills the places in `Words`; lengths that are to be added are rounded up."""
    size = design.cavity
    length = size.wall_length_mm(one.wall) if one.wall else 0.0
    lacking = math.ceil(round(-2 * one.spare_mm * 100, 6)) / 100
    return {
        "where": one.where,
        "parts": one.parts,
        "wall": one.wall,
        "field": one.field,
        "value": mm(one.value_mm),
        "needed": mm(one.needed_mm),
        "overlap": mm(-one.value_mm),
        "twice": mm(lacking),
        "length": f"{length:g} mm",
        "mouth": "pour lip or cover seat of the cavity" if plan_of(design).is_block else "cavity",
        "outside": " and ".join(dict.fromkeys(design.mold.outside_fields)),
    }
