"""Notes on what touches a pad: its rim, its walls and its crown against flat, straight and round objects.

Objects are rigid and pressed in the middle. A straight one, as a long cylinder, has its lowest line on both rims where
it spans the opening, so it is stopped as a flat one is. A ball of radius R sinks by R - √(R² - w²) into an opening of
half width w. So it reaches a depth a below the rim if R is at most (w² + a²) / (2 a), for a < w.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from optopad.design.arrays import FloatArray
from optopad.design.draft import Draft
from optopad.design.fields.finding import Finding, mm, note
from optopad.design.fields.quantity import ROUNDING_MM
from optopad.design.mold.filling import is_cast_under_lid
from optopad.design.mold.outline import MoldOutline

LARGEST_HELD_SHARE = 1.0 / 3.0
"""Deepest press over the elastic layer's thickness that the model of pressed objects covers [-]."""
NEAREST_HELD = 0.15
"""Least distance of their contact from a wall that the model covers, over the elastic layer's thickness [-]."""


def touch_notes(draft: Draft) -> Iterator[Finding]:
    """Notes on objects that the rim or the walls keep away, or stop before the deepest press."""
    if is_cast_under_lid(draft.plan):
        yield from _crown_notes(draft)
    elif not draft.outline.ledge_mm:
        yield from _rim_notes(draft)
        yield _fit_note(draft)


def rim_height_mm(outline: MoldOutline, out_mm: FloatArray) -> FloatArray:
    """Height (...) of the mold above a flat pad's top, at distances outside the pad's walls [mm].

    The lip rises at 45 degrees. The seat of a cover is level with the top. A collar counts as if it went all around.
    """
    lowest_mm = 0.0 if outline.ledge_mm else outline.top_mm - outline.lip_mm - outline.fill_mm
    in_mouth = lowest_mm + np.minimum(out_mm, outline.lip_mm)
    return np.where(out_mm < outline.mouth_out_mm - 1e-9, in_mouth, outline.highest_mm - outline.fill_mm)


def largest_ball_mm(outline: MoldOutline, depth_mm: float) -> float:
    """Radius of the largest ball that presses the middle of a flat pad to a depth, clear of the rim [mm]."""
    half_mm = min(outline.length_mm, outline.width_mm) / 2
    edges = np.array([0.0, outline.mouth_out_mm])
    heights = rim_height_mm(outline, edges)
    return min(_largest_mm(half_mm + out, up + depth_mm) for out, up in zip(edges, heights, strict=True))


def _largest_mm(half_mm: float, sunk_mm: float) -> float:
    """Radius of the largest ball whose lowest point is `sunk_mm` below an opening of half width `half_mm` [mm]."""
    if sunk_mm <= ROUNDING_MM:
        return math.inf
    return half_mm if sunk_mm >= half_mm else (half_mm**2 + sunk_mm**2) / (2.0 * sunk_mm)


def _rim_notes(draft: Draft) -> Iterator[Finding]:
    outline, depth_mm = draft.outline, draft.design.operating.max_depth_mm
    above_mm = outline.highest_mm - outline.fill_mm
    deepest_mm = largest_ball_mm(outline, depth_mm)
    if above_mm <= ROUNDING_MM:
        yield note(
            "mold.rim_mm",
            "the pad is flush with the rim of the mold: a flat or straight object that spans the opening touches it, "
            "but cannot press it",
            value=f"a ball presses it {depth_mm:g} mm deep up to a radius of {deepest_mm:.3g} mm",
            limit="a top above the rim for flat objects",
            way_out="add a crown if you hold flat objects; a fingertip or a tip smaller than the opening needs none",
        )
        return
    bodies_mm = max((one.part.body_top_mm for one in outline.sockets), default=0.0) - outline.fill_mm
    yield note(
        "mold.rim_mm",
        "the pad is below the rim of the mold: no flat or straight object that spans the opening touches it",
        value=f"{mm(above_mm)} below; a ball touches it up to a radius of {largest_ball_mm(outline, 0.0):.0f} mm, and "
        f"presses it {depth_mm:g} mm deep up to {deepest_mm:.3g} mm",
        limit="0.00 mm for flat objects to touch it, a crown for them to press it",
        way_out=(
            f"use components whose bodies end below the surface (now up to {mm(bodies_mm)} above it), then set "
            "mold.rim_mm = 0"
            if bodies_mm > ROUNDING_MM
            else "set mold.rim_mm = 0 and pour to the brim (no pour gauge then)"
        )
        + "; a fingertip or a tip smaller than the opening needs neither",
    )


def _fit_note(draft: Draft) -> Finding:
    plan, cavity = draft.plan, draft.design.cavity
    elastic_mm = cavity.elastic_mm
    wall_mm = NEAREST_HELD * elastic_mm
    length_mm, width_mm = (size - 2.0 * wall_mm for size in (plan.length_mm, plan.width_mm))
    straight_mm = max(length_mm, width_mm) if plan.is_block else abs(length_mm - width_mm)
    face = (
        f"{length_mm:.1f} x {width_mm:.1f} mm"
        if plan.is_block
        else f"{min(length_mm, width_mm):.1f} mm across"
    )
    cylinder = f", cylinders to {straight_mm:.1f} mm long" if straight_mm > ROUNDING_MM else ""
    return note(
        cavity.size_fields[0],
        "flat and straight objects must fit between the walls",
        value=f"flat faces to {face}{cylinder}, all to {LARGEST_HELD_SHARE * elastic_mm:.2g} mm deep",
        limit=f"{mm(wall_mm)} from contact to wall, and {LARGEST_HELD_SHARE:.0%} of both layers",
        way_out="others have no figures from optopad press",
    )


def _crown_notes(draft: Draft) -> Iterator[Finding]:
    proud_mm = draft.plan.clear_mm - draft.outline.highest_mm
    depth_mm = draft.design.operating.max_depth_mm
    if proud_mm >= depth_mm - ROUNDING_MM:
        return
    straight = draft.plan.top.straight
    if proud_mm > ROUNDING_MM:
        said = "a flat object larger than the pad presses the crown until it meets the rim of the mold"
        value = f"{mm(proud_mm)} deep"
    else:
        said = "the crown is not above all of the rim of the mold: a flat object larger than the pad cannot press it"
        value = f"{mm(proud_mm)} above the rim" + (f" at both ends of {straight}" if straight else "")
    yield note(
        "crown.radius_mm" if straight is None else "crown.shape",
        said,
        value=value,
        limit=f"{mm(depth_mm)} for the deepest press",
        way_out="lower crown.radius_mm or mold.rim_mm"
        if straight is None
        else f"hold objects shorter than the pad along {straight}, or use a crown of shape 'sphere'",
    )
