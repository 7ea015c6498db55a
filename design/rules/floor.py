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
from optopad.design.shape.cavity import PlacedPart

APART_MM = 0.2
"""Least gap between the bodies of two parts on a board [mm]; IPC-7351B gives 0.1 to 0.5 mm by density of the board."""
LIGHT_FLOOR, STANDS_MM = 0.2, 0.3
"""Reflectance of a floor, and height of a body above it, from which the shadow of the body matters [-, mm]."""


def floor_findings(draft: Draft) -> Iterator[Finding]:
    """Findings about parts on the floor: covered, too high, outside the pad, or overlapping."""
    parts = draft.cavity.on_floor
    if not parts:
        return
    yield from _option_findings(draft)
    for part in {(one.origin, one.part_id, round(one.height_mm, 9)): one for one in parts}.values():
        yield from _height_findings(draft, part)
    outside = [part for part in parts if not _is_inside(draft, part)]
    if outside:
        names = " ".join(part.name for part in outside)
        yield error(
            outside[0].origin,
            f"the bodies of {names} reach under the wall of the frame",
            value=f"{outside[0].name} at x {outside[0].position_mm[0]:g}, y {outside[0].position_mm[1]:g} mm",
            limit="bodies inside the outline of the pad",
            way_out="move them inward, lower the pitch, or enlarge the cavity",
        )
    yield from _overlap_findings(parts)


def _option_findings(draft: Draft) -> Iterator[Finding]:
    if draft.design.surfaces.wall_finish != "diffuse":
        yield error(
            "surfaces.wall_finish",
            "light between parts on the floor is not traced by way of smooth walls",
            value=f"'{draft.design.surfaces.wall_finish}'",
            limit="'diffuse' with parts on the floor",
            way_out="set it to 'diffuse'",
        )
    if draft.design.mold.cover_ledge_mm:
        yield error(
            "mold.cover_ledge_mm",
            "a frame on a circuit board has no glass cover",
            value=f"{draft.design.mold.cover_ledge_mm:g} mm",
            limit="0 with parts on the floor",
            way_out="set it to 0",
        )


def _height_findings(draft: Draft, part: PlacedPart) -> Iterator[Finding]:
    low, high = part.height_mm - part.rise_mm, part.height_mm + part.rise_mm
    black = draft.design.cavity.black_thickness_mm
    if low < -ROUNDING_MM:
        yield error(
            part.height_field,
            f"the black layer covers the face of {part.name}",
            value=f"{mm(-low)} of it; the face is {mm(black + low)} above the board",
            limit=f"at most {mm(black + low)} of black layer",
            way_out="lower it to that, or to 0 for clear silicone down to the board",
        )
    if high > part.clear_mm - ROUNDING_MM:
        yield error(
            part.height_field,
            f"{part.name} is higher than the clear layer",
            value=f"its face reaches {mm(high)}",
            limit=f"less than {mm(part.clear_mm)}, the clear layer above it",
            way_out="thicken cavity.clear_thickness_mm, or use a part with a lower body",
        )
    elif draft.design.operating.max_depth_mm > part.clear_mm - max(high, part.body_top_mm):
        left = part.clear_mm - max(high, part.body_top_mm)
        yield error(
            "operating.max_depth_mm",
            f"the deepest press reaches the body of {part.name}",
            value=f"{draft.design.operating.max_depth_mm:g} mm",
            limit=f"less than {mm(left)}, the clear layer over it",
            way_out="lower it, or thicken the clear layer",
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


def footprint_mm(part: PlacedPart) -> FloatArray:
    """(4, 2) corners of the body of a part on the floor, in plan, counter-clockwise [mm].

    A part that looks up lies on its back; a tilted one reaches back from its face by its depth.
    """
    x, y, _ = part.position_mm
    (tx, ty), (ox, oy) = part.line.tangent, part.line.outward
    half = part.part.body_width_mm.value / 2
    if part.tilt_deg == 0.0:
        low = part.part.active_height_in_body_mm.value
        ends = (-low, part.part.body_height_mm.value - low)
    else:
        ends = (0.0, part.part.body_depth_mm.value)
    corners = [(-half, ends[0]), (half, ends[0]), (half, ends[1]), (-half, ends[1])]
    return np.array([(x + a * tx + b * ox, y + a * ty + b * oy) for a, b in corners])


def _is_inside(draft: Draft, part: PlacedPart) -> bool:
    return all(bool(draft.plan.contains(x, y)) for x, y in footprint_mm(part).tolist())


def _overlap_findings(parts: tuple[PlacedPart, ...]) -> Iterator[Finding]:
    """Error about the two bodies that overlap most, with the number of all such pairs."""
    found = []
    for one, other in combinations(parts, 2):
        if one.coupler is not None and (one.coupler, one.origin) == (other.coupler, other.origin):
            continue
        reach = math.dist(one.position_mm[:2], other.position_mm[:2])
        if reach < 2.0 * sum(
            math.hypot(p.part.body_width_mm.value, p.part.body_height_mm.value) for p in (one, other)
        ):
            gap = _gap_mm(footprint_mm(one), footprint_mm(other))
            if gap < APART_MM - ROUNDING_MM:
                found.append((gap, one, other))
    if found:
        gap, one, other = min(found, key=lambda row: row[0])
        more = f" and {len(found) - 1} more pairs" if len(found) > 1 else ""
        yield error(
            other.origin,
            f"the bodies of {one.name} and {other.name}{more} are too near to each other on the board",
            value=f"{mm(gap)} apart" if gap >= 0.0 else f"they overlap by {mm(-gap)}",
            limit=f"at least {mm(APART_MM)}",
            way_out="raise the pitch, use fewer parts, or smaller ones",
        )


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
    if draft.design.surfaces.wall_finish != "diffuse":
        yield error(
            "surfaces.wall_finish",
            "light under a skin is not traced by way of smooth walls",
            value=f"'{draft.design.surfaces.wall_finish}'",
            limit="'diffuse' with a skin on the top",
            way_out="set it to 'diffuse', or remove [top]",
        )
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
