"""Rules for parts on the floor of a pad, and for a skin on its top."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import combinations

import numpy as np

from optopad.design.arrays import FloatArray
from optopad.design.draft import Draft
from optopad.design.fields.finding import Finding, error, mm, outside_models, warning
from optopad.design.fields.quantity import ROUNDING_MM
from optopad.design.rules.shape import LARGEST_SHARE_OF_LAYER
from optopad.design.shape.cavity import PlacedPart
from optopad.design.spec.layout import RingInside

APART_MM = 0.2
"""Least gap between the bodies of two parts on a board, and from a body to the frame's wall [mm].

Courtyards of 0.1 to 0.5 mm around each body are usual, by the density of the board (IPC-7351B).
"""
LIGHT_FLOOR, STANDS_MM = 0.2, 0.3
"""Reflectance of a floor, and height of a body above it, from which the shadow of the body matters [-, mm]."""


def floor_findings(draft: Draft) -> Iterator[Finding]:
    """Findings about parts on the floor: covered, sunk, too high, outside the pad, overlapping, or mixed with walls."""
    parts = draft.cavity.on_floor
    if not parts:
        return
    yield from _option_findings(draft, parts)
    for alike in _alike(parts):
        yield from _height_findings(draft, min(alike, key=lambda part: part.clear_mm))
    yield from _press_findings(draft, parts)
    near = [(_to_wall_mm(draft, part), part) for part in parts]
    outside = [row for row in near if row[0] < APART_MM - ROUNDING_MM]
    if outside:
        worst, names = min(outside, key=lambda row: row[0]), " ".join(part.name for _, part in outside)
        yield error(
            worst[1].origin,
            f"the bodies of {names} are under the wall of the frame, or too near to it",
            value=f"{worst[1].name} {mm(worst[0])} inside it"
            if worst[0] >= 0.0
            else f"{worst[1].name} {mm(-worst[0])} past it",
            limit=f"at least {mm(APART_MM)} from body to wall",
            way_out="move them inward, lower the pitch, or enlarge the cavity",
        )
    yield from _overlap_findings(parts)
    half_mm = min(draft.plan.length_mm, draft.plan.width_mm) / 2
    for number, pattern in enumerate(draft.design.layout):
        if isinstance(pattern, RingInside) and pattern.inset_mm >= half_mm:
            yield error(
                f"layout.{number}.inset_mm",
                "no line is left inside the pad for the ring",
                value=mm(pattern.inset_mm),
                limit=f"less than {mm(half_mm)}, half of the shorter side",
                way_out="lower it",
            )
    for field in ("emitters", "receivers"):
        height = getattr(draft.design, field).height_mm
        if height is not None and draft.design.is_on_board:
            yield warning(
                f"{field}.height_mm",
                "parts on the floor stand on the board, so this height has no effect",
                value=mm(height),
                limit="left out",
                way_out="remove it, or give a part's own height_mm in [[layout]]",
            )


def _alike(parts: tuple[PlacedPart, ...]) -> list[list[PlacedPart]]:
    """Parts in groups of the same entry of the layout, catalogue part, height and tilt."""
    groups: dict[tuple[str, str, float, float], list[PlacedPart]] = {}
    for part in parts:
        key = (part.origin, part.part_id, round(part.height_mm, 9), part.tilt_deg)
        groups.setdefault(key, []).append(part)
    return list(groups.values())


def _option_findings(draft: Draft, parts: tuple[PlacedPart, ...]) -> Iterator[Finding]:
    design = draft.design
    in_walls = [part.name for part in draft.cavity.parts if not part.is_on_floor]
    if in_walls:
        yield error(
            "layout",
            "parts are in the walls and on the floor: neither one mold nor one circuit board holds both",
            value=f"{len(in_walls)} in walls ({in_walls[0]} first), {len(parts)} on the floor",
            limit="all parts in walls, or all on the floor",
            way_out="put all on the floor with pattern = 'grid', 'checkerboard', 'ring_inside' or wall = 'floor', or "
            "all in walls",
        )
    yield from _finish_findings(draft, "between parts on the floor", "parts on the floor")
    if not draft.plan.is_block:
        return  # the rules of shapes refuse a cover and a parted mold
    if design.mold.cover_ledge_mm:
        yield error(
            "mold.cover_ledge_mm",
            "a frame on a circuit board has no glass cover",
            value=f"{design.mold.cover_ledge_mm:g} mm",
            limit="0 with parts on the floor",
            way_out="set it to 0",
        )
    if design.mold.pieces != "one":
        yield error(
            "mold.pieces",
            "a frame on a circuit board has no base",
            value=f"'{design.mold.pieces}'",
            limit="'one' with parts on the floor",
            way_out="set it to 'one'",
        )


def _finish_findings(draft: Draft, where: str, needs: str) -> Iterator[Finding]:
    finish = draft.design.surfaces.wall_finish
    if finish != "diffuse":
        yield error(
            "surfaces.wall_finish",
            f"light {where} is not traced by way of smooth walls",
            value=f"'{finish}'",
            limit=f"'diffuse' with {needs}",
            way_out="set it to 'diffuse'",
        )


def _height_findings(draft: Draft, part: PlacedPart) -> Iterator[Finding]:
    low, high = part.height_mm - part.rise_mm, part.height_mm + part.rise_mm
    black = draft.design.cavity.black_thickness_mm
    sunk = -black - part.body_base_mm
    if sunk > ROUNDING_MM:
        yield error(
            part.height_field,
            f"the body of {part.name} would be inside the circuit board",
            value=f"{part.height_mm:g} mm for its face",
            limit=f"at least {mm(part.height_mm + sunk)}, where the body stands on the board",
            way_out="remove it, so that the part stands on the board, or thicken cavity.black_thickness_mm",
        )
    elif low < -ROUNDING_MM:
        yield error(
            "cavity.black_thickness_mm",
            f"the black layer covers the face of {part.name}",
            value=f"{mm(black)}, and the face begins {mm(black + low)} above the board",
            limit=f"at most {mm(black + low)} of black layer",
            way_out="lower it to that, or to 0 for clear silicone down to the board",
        )
    if high > part.clear_mm - ROUNDING_MM:
        yield error(
            "cavity.clear_thickness_mm"
            if part.height_field == "cavity.black_thickness_mm"
            else part.height_field,
            f"{part.name} is higher than the clear layer",
            value=f"its face reaches {mm(high)}",
            limit=f"less than {mm(part.clear_mm)}, the clear layer over it",
            way_out="thicken cavity.clear_thickness_mm, or use a part with a lower body",
        )
    if low > STANDS_MM and draft.design.surfaces.bottom_reflectance > LIGHT_FLOOR:
        yield warning(
            "cavity.black_thickness_mm",
            f"the body of {part.name} stands in the clear layer, and the shadow that it throws on a light floor is "
            "not modelled",
            value=f"{mm(low)} above the black layer, floor reflectance {draft.design.surfaces.bottom_reflectance:g}",
            limit=f"at most {mm(STANDS_MM)}, or a reflectance of at most {LIGHT_FLOOR:g}",
            way_out=f"pour {mm(black + low)} of black layer up to the faces",
        )


def _press_findings(draft: Draft, parts: tuple[PlacedPart, ...]) -> Iterator[Finding]:
    """Findings about presses that come too near to a body; a body that no tip passes over does not count."""
    depth, reach = draft.design.operating.max_depth_mm, draft.design.indenter.tip_radius_mm
    if draft.workspace.is_empty:
        return
    left = [
        (part.clear_mm - part.body_top_mm, part)
        for part in parts
        if part.body_top_mm < part.clear_mm
        and draft.workspace.outside_mm(*part.position_mm[:2]) - _reach_mm(part) < reach
    ]
    if not left:
        return
    thinnest, part = min(left, key=lambda row: row[0])
    modelled = LARGEST_SHARE_OF_LAYER * thinnest
    if depth > thinnest - ROUNDING_MM:
        yield error(
            "operating.max_depth_mm",
            f"the deepest press reaches the body of {part.name}",
            value=f"{depth:g} mm",
            limit=f"less than {mm(thinnest)}, the silicone over it",
            way_out="lower it, or thicken the clear layer",
        )
    elif depth > modelled + ROUNDING_MM:
        yield warning(
            "operating.max_depth_mm",
            f"the silicone over the body of {part.name} is thin for this press: the contact model has no bodies in "
            "the layer, so its forces there are too low",
            value=f"{depth:g} mm",
            limit=f"at most {mm(modelled)}, {LARGEST_SHARE_OF_LAYER:g} x the {mm(thinnest)} over it",
            way_out="lower it, thicken the clear layer, or measure the force over a part",
        )


def _reach_mm(part: PlacedPart) -> float:
    """Largest distance of a body's outline in plan from the middle of its face [mm]."""
    return float(np.hypot(*(part.footprint_mm - part.position_mm[:2]).T).max())


def _to_wall_mm(draft: Draft, part: PlacedPart) -> float:
    """Least distance of a body from the wall of the pad [mm]; negative where it reaches under the wall."""
    return -max(draft.plan.outline.outside_mm(x, y) for x, y in part.footprint_mm.tolist())


def _overlap_findings(parts: tuple[PlacedPart, ...]) -> Iterator[Finding]:
    """Error about the two bodies that overlap most, with the number of all such pairs."""
    found = []
    bodies = [(part, part.footprint_mm, _reach_mm(part)) for part in parts]
    for (one, mine, near), (other, theirs, far) in combinations(bodies, 2):
        if one.coupler is not None and one.coupler == other.coupler and _share_package(one, other):
            continue
        if math.dist(one.position_mm[:2], other.position_mm[:2]) < near + far + APART_MM:
            gap = _gap_mm(mine, theirs)
            if gap < APART_MM - ROUNDING_MM:
                found.append((gap, one, other))
    if found:
        gap, one, other = min(found, key=lambda row: row[0])
        more = len(found) - 1
        others = f" (and {more} more pair{'s' if more > 1 else ''})" if more else ""
        yield error(
            other.origin,
            f"the bodies of {one.name} and {other.name}{others} are too near to each other on the board",
            value=f"{mm(gap)} apart" if gap >= 0.0 else f"they overlap by {mm(-gap)}",
            limit=f"at least {mm(APART_MM)}",
            way_out="raise the pitch, use fewer parts, or smaller ones",
        )


def _share_package(one: PlacedPart, other: PlacedPart) -> bool:
    """Whether two halves of a coupler are one package: entries of the catalogue named alike but for their kind."""
    stems = {part.part_id.removesuffix(f"-{part.kind}") for part in (one, other)}
    return len(stems) == 1 and one.part_id != other.part_id


def _gap_mm(one: FloatArray, other: FloatArray) -> float:
    """Largest gap between two convex outlines along any of their sides' normals [mm]; negative: they overlap."""
    best = -math.inf
    for corners in (one, other):
        for k in range(len(corners)):
            along = corners[(k + 1) % len(corners)] - corners[k]
            normal = np.array([along[1], -along[0]]) / np.hypot(*along)
            a, b = one @ normal, other @ normal
            best = max(best, float(b.min() - a.max()), float(a.min() - b.max()))
    return best


SKIN_REACH = 0.25
"""Largest bending length of a skin on a layer, over the tip's radius, at which the contact model covers it [-]."""


def skin_findings(draft: Draft) -> Iterator[Finding]:
    """Findings about a skin that is too stiff for the contact model, which leaves it out.

    A stiff film of thickness t on a soft solid bends over a length of t (E / 3 E_s)^(1/3), by plane strain moduli
    (Allen, Analysis and Design of Structural Sandwich Panels, 1969, ch. 8: wrinkling of a face on its core).
    """
    top = draft.design.top
    if top is None or (top.skin is not None and top.skin not in draft.entries.skins):
        return
    if not draft.cavity.on_floor:  # which has the same finding
        yield from _finish_findings(draft, "under a skin", "a skin on the top")
    skin = draft.skin
    if skin is None or skin.thickness_mm is None or skin.youngs_modulus_mpa is None:
        return
    ratio = skin.youngs_modulus_mpa.value / draft.modulus.value
    bends = skin.thickness_mm.value * (max(ratio, 1.0) / 3.0) ** (1.0 / 3.0)
    most = SKIN_REACH * draft.design.indenter.tip_radius_mm
    if bends > most + ROUNDING_MM:
        yield outside_models(
            "top.thickness_mm",
            "the skin spreads a press more than the contact model covers, which leaves it out",
            value=f"it bends over {mm(bends)}: {mm(skin.thickness_mm.value)} thick, {ratio:.3g} times as stiff",
            limit=f"at most {mm(most)}, {SKIN_REACH:g} tip radii",
            way_out="use a thinner or softer skin, or a larger tip",
        )
