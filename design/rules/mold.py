"""Options of the mold that need something of the rest: a cover's seat, a parted mold, fits; what stands above the pad.

Names that find no room on the outer face are told by the printed parts' checks (`cad.checks`).
"""

from __future__ import annotations

import re
from collections.abc import Iterator

from design.fields.finding import Finding, error, mm, note, warning
from design.fields.units import ROUNDING_MM
from design.mold.filling import is_cast_under_lid
from design.mold.outline import MoldOutline, outline_of
from design.spec import SensorDesign
from design.spec.properties import elastomer_of, entries_of

LEAST_SEAT_MM = 0.5
"""A cover needs this much rim around it to stay where it is laid."""
RESIN = re.compile(
    r"resin|stereo-?lith|photopolymer|\bm?sla\b|\bdlp\b|\blcd\b|polyjet|material jet", re.IGNORECASE
)
"""Words for prints of liquid resin, in the name or title of a material."""
OTHER_CURE = re.compile(r"\btin\b|condensation", re.IGNORECASE)
"""Words for silicones that do not cure by platinum, which most clear ones do."""


def is_inhibited(design: SensorDesign) -> bool:
    """Whether the mold is printed in resin, on which a platinum silicone stays tacky."""
    found = entries_of(design).mold_materials.get(design.mold.material)
    silicone = elastomer_of(design)
    said = " ".join((design.elastomer.material, silicone.title, *silicone.notes))
    return (
        found is not None
        and RESIN.search(f"{design.mold.material.replace('_', '-')} {found.title}") is not None
        and OTHER_CURE.search(said) is None
    )


def mold_findings(design: SensorDesign) -> Iterator[Finding]:
    """What keeps an option from working."""
    outline = outline_of(design)
    yield from _cure_findings(design)
    yield from _fit_findings(design, outline)
    yield from _cover_findings(design, outline)
    yield from _piece_findings(design)


def _cure_findings(design: SensorDesign) -> Iterator[Finding]:
    if design.elastomer.material in entries_of(design).elastomers and is_inhibited(design):
        yield warning(
            "mold.material",
            "platinum silicones do not cure against many printed resins: the pad may stay tacky",
            value=f"'{design.mold.material}'",
            limit="a filament print, or a resin that a test piece has cured on",
            way_out="print in filament, or wash, post-cure and coat the mold and try some silicone on it first",
        )


def _fit_findings(design: SensorDesign, outline: MoldOutline) -> Iterator[Finding]:
    used = sorted({socket.part.part_id for socket in outline.sockets})
    for part_id in design.mold.fits:
        if part_id not in used:
            yield error(
                f"mold.fits.{part_id}",
                "no part of the layout is one of these",
                value=part_id,
                limit=f"one of {', '.join(used)}",
                way_out="correct the name, or leave it out",
            )


def _cover_findings(design: SensorDesign, outline: MoldOutline) -> Iterator[Finding]:
    if not outline.ledge_mm:
        return
    if design.mold.rim_mm < LEAST_SEAT_MM:
        yield error(
            "mold.rim_mm",
            "too low to hold a glass cover in its seat",
            value=mm(design.mold.rim_mm),
            limit=f"at least {mm(LEAST_SEAT_MM)}",
            way_out="raise it, best to the cover's thickness, or set mold.cover_ledge_mm = 0",
        )
    high = [s.part for s in outline.sockets if s.part.body_top_mm > outline.fill_mm + ROUNDING_MM]
    if high:
        worst = max(high, key=lambda part: part.body_top_mm)
        names = " ".join(part.name for part in high)
        yield error(
            "mold.cover_ledge_mm",
            f"a cover at the fill level would lie on the bodies of {names}",
            value=f"{mm(worst.body_top_mm - outline.fill_mm)} above it",
            limit="bodies below the clear layer's top",
            way_out=f"lower {worst.height_field}, use a part with less body_height_mm, or set it to 0",
        )


def _piece_findings(design: SensorDesign) -> Iterator[Finding]:
    if design.mold.pieces == "frame_and_base" and design.mold.fixing_hole_diameter_mm == 0:
        yield error(
            "mold.pieces",
            "nothing holds frame and base together",
            value="no fixing holes",
            limit="mold.fixing_hole_diameter_mm above 0",
            way_out="give fixing holes for screws, or set mold.pieces = 'one'",
        )


def reach_notes(design: SensorDesign) -> Iterator[Finding]:
    """A flat top below its rim, which no flat object larger than the opening touches."""
    outline = outline_of(design)
    above_mm = outline.highest_mm - outline.fill_mm
    if is_cast_under_lid(outline.plan) or outline.ledge_mm or above_mm <= ROUNDING_MM:
        return
    half_mm = min(outline.length_mm, outline.width_mm) / 2 + outline.mouth_out_mm
    flattest_mm = (half_mm**2 + above_mm**2) / (2.0 * above_mm)
    bodies_mm = max((one.part.body_top_mm for one in outline.sockets), default=0.0) - outline.fill_mm
    is_by_body = bodies_mm > ROUNDING_MM
    yield note(
        "mold.rim_mm",
        "the pad lies below the mold around it: a flat object larger than the opening never touches it",
        value=f"{mm(above_mm)} below; an object touches if its radius of curvature is below {flattest_mm:.0f} mm",
        limit="0.00 mm for flat objects",
        way_out=(
            f"use components whose bodies end below the surface (now up to {mm(bodies_mm)} above it), then set "
            "mold.rim_mm = 0"
            if is_by_body
            else "set mold.rim_mm = 0 and pour to the brim (no pour gauge then)"
        )
        + "; a fingertip or a tip smaller than the opening needs neither",
    )
