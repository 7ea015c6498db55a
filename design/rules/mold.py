"""Rules for the mold: printable walls, and its options such as a glass cover's seat, a parted mold, and fits.

Every distance in the mold that is too small (`optopad.design.mold.webs`) becomes a finding with a remedy. Distances
that the same change to the design would correct are combined into one finding, which names the worst location and
counts the others.

Names of parts that do not fit on the outer face are not reported here but by the checks of printed parts
(`optopad.cad.checks`).
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass

from optopad.design.draft import Draft
from optopad.design.errors import DesignError
from optopad.design.fields.finding import FAILS, Finding, error, mm, note, warning
from optopad.design.fields.quantity import ROUNDING_MM
from optopad.design.mold.filling import is_cast_under_lid
from optopad.design.mold.outline import MoldOutline
from optopad.design.mold.webs import INSET, Clearance, clearances, rim_clearances
from optopad.design.parts.catalog import packaged

FLAT_PAIR = ("kingbright-apt2012zgc", "osram-sfh2400")
"""Packaged LED and photodiode that need the thinnest wall, and whose colours suit each other."""
MUCH_LARGER = 1.5
"""Ratio of two housings' areas above which the smaller one is suggested [-]."""
WALL_STEP_MM, WIDEST_MM = 0.5, 16.0
"""Step and end of the search for the thinnest wall of a mold [mm]."""


@dataclass(frozen=True, kw_only=True)
class Words:
    """Texts of the finding about a distance in the mold that is too small, with placeholders.

    Placeholders from the `Clearance` are {where}, {parts}, {wall}, {field}, {value} and {needed}. In addition,
    {overlap} is the value with its sign reversed, {twice} is twice the missing length, and {length} is the inner length
    of the wall. {mouth} names the opening at the rim, and {outside} names the fields of the mold's outer size.
    """

    message: str
    way_out: str
    value: str = "{value}"
    limit: str = "at least mold.min_web_mm = {needed}"


_SPREAD = "use fewer parts, spread them, or enlarge the cavity"
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
        way_out="move it inward, use fewer parts, or lengthen the cavity",
    ),
    "pocket back to outer face": Words(
        message="the wall behind the socket of {where} is too thin", way_out=_THICKEN
    ),
    "floor under pocket": Words(
        message="the floor below the socket of {where} is too thin", way_out="raise mold.floor_mm or {field}"
    ),
    "pocket below fill level": Words(
        message="the socket of {where} is too shallow below the top of the clear layer",
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
        way_out="raise mold.rim_mm or lower the part; the leveling blade will hit it",
    ),
}


def web_findings(draft: Draft) -> Iterator[Finding]:
    """Errors about distances in the mold that are too small to print, and warnings about bodies above the rim."""
    above_rim = () if is_cast_under_lid(draft.plan) else rim_clearances(draft.outline)  # lids: another rule
    for finding, found in ((error, clearances(draft.outline, draft.design.mold)), (warning, above_rim)):
        for group in _groups([one for one in found if not one.is_kept]):
            worst, more = min(group, key=lambda one: one.spare_mm), len(group) - 1
            said, fill = WORDS[worst.name], _filling(worst, draft)
            others = f" (and {more} more position{'s' if more > 1 else ''})" if more else ""
            yield finding(
                worst.field,
                said.message.format(**fill) + others,
                value=said.value.format(**fill),
                limit=said.limit.format(**fill),
                way_out=said.way_out.format(**fill),
            )


def _groups(found: list[Clearance]) -> list[list[Clearance]]:
    """Groups of distances that the same change to the design would correct.

    The distances of a group have the same remedy, and the same field or, for fields of the layout, the same wall.
    """
    groups: dict[tuple[str, str | None], list[Clearance]] = {}
    for one in found:
        place = one.wall if one.field.startswith("layout.") else one.field
        groups.setdefault((WORDS[one.name].way_out, place), []).append(one)
    return list(groups.values())


def _filling(one: Clearance, draft: Draft) -> dict[str, str | None]:
    """Values of the placeholders in `Words` for one distance; lengths to be added are rounded up."""
    size = draft.design.cavity
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
        "mouth": "pour lip or cover seat of the cavity" if draft.plan.is_block else "cavity",
        "outside": " and ".join(dict.fromkeys(draft.design.mold.outside_fields)),
    }


LEAST_SEAT_MM = 0.5
"""Least height of the rim around a glass cover, to hold it in position [mm]."""
RESIN = re.compile(
    r"resin|stereo-?lith|photopolymer|\bm?sla\b|\bdlp\b|\blcd\b|polyjet|material jet", re.IGNORECASE
)
"""Pattern that detects resin printing from the name or title of a mold material."""
OTHER_CURE = re.compile(r"\btin\b|condensation", re.IGNORECASE)
"""Pattern that detects silicones that do not cure with platinum, unlike most clear ones."""


def is_inhibited(draft: Draft) -> bool:
    """Whether the mold is printed in resin and the silicone cures with platinum, which may leave it tacky."""
    found = draft.entries.mold_materials.get(draft.design.mold.material)
    silicone = draft.elastomer
    said = " ".join((draft.design.elastomer.material, silicone.title, *silicone.notes))
    return (
        found is not None
        and RESIN.search(f"{draft.design.mold.material.replace('_', '-')} {found.title}") is not None
        and OTHER_CURE.search(said) is None
    )


def mold_findings(draft: Draft) -> Iterator[Finding]:
    """Findings about the mold's material and options: cure, fits, a glass cover's seat, and a parted mold."""
    outline = draft.outline
    yield from _cure_findings(draft)
    yield from _fit_findings(draft, outline)
    yield from _cover_findings(draft, outline)
    yield from _piece_findings(draft)


def _cure_findings(draft: Draft) -> Iterator[Finding]:
    if draft.design.elastomer.material in draft.entries.elastomers and is_inhibited(draft):
        yield warning(
            "mold.material",
            "platinum silicones do not cure against many printed resins: the pad may stay tacky",
            value=f"'{draft.design.mold.material}'",
            limit="a filament print, or a resin that a test piece has cured on",
            weight=FAILS,
            way_out="print in filament, or wash, post-cure and coat the mold and try some silicone on it first",
        )


def _fit_findings(draft: Draft, outline: MoldOutline) -> Iterator[Finding]:
    used = sorted({socket.part.part_id for socket in outline.sockets})
    for part_id in draft.design.mold.fits:
        if part_id not in used:
            yield error(
                f"mold.fits.{part_id}",
                "no part of the layout is one of these",
                value=part_id,
                limit=f"one of {', '.join(used)}" if used else "no fits: parts on the floor have no sockets",
                way_out="correct the name, or leave it out",
            )


def _cover_findings(draft: Draft, outline: MoldOutline) -> Iterator[Finding]:
    if not outline.ledge_mm:
        return
    if draft.design.mold.rim_mm < LEAST_SEAT_MM:
        yield error(
            "mold.rim_mm",
            "too low to hold a glass cover in its seat",
            value=mm(draft.design.mold.rim_mm),
            limit=f"at least {mm(LEAST_SEAT_MM)}",
            way_out="raise it, best to the cover's thickness, or set mold.cover_ledge_mm = 0",
        )
    high = [s.part for s in outline.sockets if s.part.body_top_mm > outline.fill_mm + ROUNDING_MM]
    if high:
        worst = max(high, key=lambda part: part.body_top_mm)
        names = " ".join(part.name for part in high)
        yield error(
            "mold.cover_ledge_mm",
            f"a cover at the fill level would rest on the bodies of {names}",
            value=f"{mm(worst.body_top_mm - outline.fill_mm)} above it",
            limit="bodies below the clear layer's top",
            way_out=f"lower {worst.height_field}, use a part with less body_height_mm, or set it to 0",
        )


def _piece_findings(draft: Draft) -> Iterator[Finding]:
    if draft.design.mold.pieces == "frame_and_base" and draft.design.mold.fixing_hole_diameter_mm == 0:
        yield error(
            "mold.pieces",
            "frame and base have no fixing",
            value="no fixing holes",
            limit="mold.fixing_hole_diameter_mm above 0",
            way_out="give fixing holes for screws, or set mold.pieces = 'one'",
        )


def housing_notes(draft: Draft) -> Iterator[Finding]:
    """Note about LEDs of the user's own, if a flat packaged pair would have a much smaller housing.

    Housings are compared by the areas of the smallest molds, seen from above, that keep all clearances.
    """
    own = draft.outline.sockets
    emitters = sorted({one.part.part_id for one in own if one.part.kind == "emitter"} - set(packaged().parts))
    if not emitters:
        return
    try:
        flat = Draft(draft.design.with_(**{"emitters.part": FLAT_PAIR[0], "receivers.part": FLAT_PAIR[1]}))
    except DesignError:
        return
    sizes = [_least_outer_mm(one) for one in (draft, flat)]
    if {one.part.part_id for one in flat.outline.sockets} != set(FLAT_PAIR) or None in sizes:
        return
    mine, theirs = (size for size in sizes if size is not None)
    if mine[0] * mine[1] <= MUCH_LARGER * theirs[0] * theirs[1]:
        return
    outline, times = draft.outline, mine[0] * mine[1] / (theirs[0] * theirs[1])
    led, diode = FLAT_PAIR
    yield note(
        "emitters.part",
        f"the housing of {', '.join(emitters)} is {times:.1f} times as large as that of a flat packaged pair",
        value=f"outside {outline.outer_length_mm:g} x {outline.outer_width_mm:g} mm, at least "
        f"{mine[0]:g} x {mine[1]:g} mm with these parts",
        limit=f"{theirs[0]:g} x {theirs[1]:g} mm for the pair",
        way_out=f"if there is no room, set emitters.part = '{led}', receivers.part = '{diode}', the heights anew, and "
        f"{INSET} = {draft.design.mold.fixing_hole_diameter_mm / 2 + draft.design.mold.min_web_mm:g}",
    )


def _least_outer_mm(draft: Draft) -> tuple[float, float] | None:
    """Length and width of the smallest mold, in steps of 0.5 mm, that violates no clearance which a larger one keeps.

    Fixing holes are as near to the outer faces as they may be. None if the schema refuses the sizes.
    """
    plan, mold = draft.plan, draft.design.mold
    is_round = plan.outline.dimensions[0].is_diameter
    inset_mm = mold.fixing_hole_diameter_mm / 2 + mold.min_web_mm

    def violated(wall_mm: float) -> set[str]:
        length, width = plan.length_mm + 2 * wall_mm, plan.width_mm + 2 * wall_mm
        sizes = {"mold.outer_length_mm": length, "mold.outer_width_mm": width}
        sizes = {"mold.outer_diameter_mm": length} if is_round else sizes
        larger = Draft(draft.design.with_(**sizes, **{INSET: inset_mm}))
        found = clearances(larger.outline, larger.design.mold)
        return {f"{one.name} {one.where}" for one in found if not one.is_kept}

    try:
        others, low, high = violated(WIDEST_MM), 0, round(WIDEST_MM / WALL_STEP_MM)
        while high - low > 1:
            middle = (low + high) // 2
            low, high = (low, middle) if violated(middle * WALL_STEP_MM) == others else (middle, high)
    except DesignError:
        return None
    return plan.length_mm + 2 * high * WALL_STEP_MM, plan.width_mm + 2 * high * WALL_STEP_MM
