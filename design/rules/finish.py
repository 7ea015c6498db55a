"""Rules for smooth walls, angular tables, parts with a lens, and round parts whose light would miss the pad."""

from __future__ import annotations

from collections.abc import Iterator

from optopad.design.draft import Draft
from optopad.design.errors import DesignError
from optopad.design.fields.finding import Finding, error, warning
from optopad.design.parts.angular import FLAT_FACE_LEAST_DEG
from optopad.design.parts.catalog import Part
from optopad.design.parts.spectrum import CURVES
from optopad.design.shape.cavity import CavityGeometry

SHORT_TABLE_DEG = 80.0
"""Angle up to which an angular table should extend; a shorter one causes a warning [deg].

Beyond it a Lambertian source emits 3 % of its power.
"""


ROUND_LEAST = 0.95
"""Least ratio of both widths of a body that counts as round; a side-looking part is cut by a flat."""
LONG_LEAST = 1.15
"""Least ratio of length and width of a round body whose axis is recognised."""


def finish_findings(draft: Draft) -> Iterator[Finding]:
    """Findings about mirror-like walls: a missing or unused refractive index, or longer computation."""
    surfaces = draft.design.surfaces
    if surfaces.wall_index is not None and surfaces.wall_finish != "glossy":
        yield error(
            "surfaces.wall_index",
            f"surfaces.wall_finish is '{surfaces.wall_finish}', which has no use for an index",
            value=f"{surfaces.wall_index:g}",
            limit="no wall_index, or wall_finish = 'glossy'",
            way_out="remove it, or set surfaces.wall_finish = 'glossy'",
        )
    if surfaces.wall_finish != "diffuse":
        yield warning(
            "surfaces.wall_finish",
            "light that a wall mirrors is traced, not integrated: runs take longer, standard errors are larger",
            value=f"'{surfaces.wall_finish}'",
            limit="'diffuse' for the fastest run",
            way_out="keep it where the walls are smooth; read the standard errors",
        )
    if draft.design.mold.material in draft.entries.mold_materials:
        yield from _index_findings(draft)


def _index_findings(draft: Draft) -> Iterator[Finding]:
    try:
        _ = draft.wall_index  # raises an error without an index
    except DesignError as err:
        where, _, rest = str(err).partition(": ")
        what, _, way_out = rest.partition("; ")
        yield error(where, what, value="none", limit="an index of the wall, 1 to 2.5", way_out=way_out)


def angle_findings(cavity: CavityGeometry) -> Iterator[Finding]:
    """Findings about lenses, whose effect in elastomer is not modelled, and about angular tables that end early."""
    for placed in {part.part_id: part for part in cavity.parts}.values():
        yield from _lens_findings(placed.part, placed.part_id, placed.origin)
        yield from _table_findings(placed.part, placed.part_id, placed.origin)
        yield from _view_findings(placed.part, placed.part_id)


def _half_angle_deg(part: Part) -> float:
    table = part.angular_pattern if part.kind == "emitter" else part.angular_response
    return part.half_angle_deg.value if table is None else table.half_angle_deg()


def _lens_findings(part: Part, part_id: str, origin: str) -> Iterator[Finding]:
    half = _half_angle_deg(part)
    if half >= FLAT_FACE_LEAST_DEG or (part.kind == "receiver" and part.epoxy_index is None):
        return
    yield warning(
        origin,
        f"{part_id} has a lens, by its narrow half angle in air; bedded in elastomer a lens loses most of its power, "
        "which is not modelled",
        value=f"{half:g} deg",
        limit=f"{FLAT_FACE_LEAST_DEG:g} deg or more, as behind a flat face",
        way_out="choose a flat part, or measure the angles in elastomer and give them as a table",
    )


def _view_findings(part: Part, part_id: str) -> Iterator[Finding]:
    """Error about a round body that is entered as if its light left across its axis.

    A part's light leaves the wall horizontally. A round body that is longer than wide, as of a 5 mm LED, sends it along
    its length, away from its leads. A side-looking body is flat where its light leaves.
    """
    width, depth, height = (
        size.value for size in (part.body_width_mm, part.body_depth_mm, part.body_height_mm)
    )
    if part.view is not None:
        return
    has_lens = _half_angle_deg(part) < FLAT_FACE_LEAST_DEG
    if _is_round(width, depth, height) and (part.mounting == "radial" or has_lens):
        message = "a round body standing upright sends its light upward along its length, not into the pad"
        way_out = f"mounting = 'surface', body_depth_mm = {height:g}, body_height_mm = {depth:g}"
    elif part.mounting == "radial" and _is_round(width, height, depth):
        message = "the leads of a round body lying on its side leave through the wall's back, not downward"
        way_out = "mounting = 'surface'"
    else:
        return
    yield error(
        f"catalog.parts.{part_id}.mounting",
        f"{part_id}: {message}",
        value=f"'{part.mounting}', {width:g} x {depth:g} x {height:g} mm (width, depth into the wall, height)",
        limit="light that leaves the wall horizontally",
        way_out=f"lay it on its side: {way_out} (`optopad part new` writes such an entry); add view = 'side' if it is "
        "a side-looking part",
    )


def _is_round(one_mm: float, other_mm: float, length_mm: float) -> bool:
    """Whether a body has a square outline across its length, as a round body has, and is longer than wide."""
    narrow, wide = sorted((one_mm, other_mm))
    return narrow >= ROUND_LEAST * wide and length_mm >= LONG_LEAST * wide


def _table_findings(part: Part, part_id: str, origin: str) -> Iterator[Finding]:
    for name in ("angular_pattern", "angular_response"):
        table = getattr(part, name)
        if table is not None and table.last_deg < SHORT_TABLE_DEG:
            yield warning(
                origin,
                f"{name} of {part_id} ends early; beyond its last angle a linear fall to 0 at 90 deg is assumed",
                value=f"{table.last_deg:g} deg",
                limit=f"{SHORT_TABLE_DEG:g} deg or more",
                way_out="give the sheet's values further out",
            )
    for name in CURVES:
        table = getattr(part, name)
        if table is not None and table.adapted is not None:
            yield warning(
                origin,
                f"{name} of {part_id} was adapted, because a digitiser's points are no table",
                value=table.adapted,
                limit="rising points from 0",
                way_out="look at the digitised diagram",
            )
