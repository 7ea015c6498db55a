r"""One or two tips pressed into a pad at the same time: its top, and the force on each.

Each tip is a ball of the design's tip radius, rigid and without friction, pressed along the normal of the untouched top
at its own place. Both are solved as objects on one grid (`optopad.sims.contact.held.press`): so each feels the motion
of the top by the other. On flat tops this linear answer is then corrected by what it is off for each tip alone,

    height of both = linear height of both + Σ (height of the contact library - linear height) of each alone,

and so is the radius of each contact. So near each tip the top is that of the library's press with finite strains, and
the force on a tip is the library's for it alone times the ratio of its linear forces with and without the other. With
one tip, the top is the library's. On crowned tops the linear answer is taken as it is.

A tip that is too shallow to reach more than a node of the grid, some micrometres, leaves the top of the other one.

The model leaves out friction, and that the corrections of both tips may depend on each other.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import distance_transform_edt

from optopad.design.arrays import FloatArray, IntArray
from optopad.design.draft import Draft
from optopad.design.errors import InputError, ModelScopeError
from optopad.design.rules.touch import LARGEST_HELD_SHARE
from optopad.sims.contact.held.press import FINE, HeldPress, Pad, pad_at, settled
from optopad.sims.contact.pad_surface import PadSurface, pad_surfaces
from optopad.sims.contact.scope import Contact, Place
from optopad.sims.press import GridTop

MOST_TIPS = 2


@dataclass(frozen=True, kw_only=True, eq=False)
class TipsPress:
    """Tips pressed into a pad; axes of tips are those of the given presses that touch.

    Attributes
    ----------
    top : the deformed top
    force_n : (tip,) force on each
    alone_n : (tip,) force on each without the other
    """

    top: GridTop
    force_n: FloatArray
    alone_n: FloatArray


def touching(tips_mm: FloatArray) -> FloatArray:
    """The tips (touching, 3) that touch, of x, y, depth (tip, 3) [mm]: those with a depth above 0."""
    return np.asarray(tips_mm[tips_mm[:, 2] > 0.0], dtype=np.float64)


def require_apart(draft: Draft, tips_mm: FloatArray) -> None:
    """Refuse tips (tip, 3) of x, y, depth [mm] that the model does not cover, before any work.

    Raises
    ------
    InputError : more than two tips touch.
    ModelScopeError : tips are no hemispheres, or overlap.
    """
    tips = touching(tips_mm)
    if len(tips) > MOST_TIPS:
        raise InputError(
            f"touches: {len(tips)} at once; the models know one or two; leave out {len(tips) - MOST_TIPS}"
        )
    if len(tips) < MOST_TIPS:
        return
    if (shape := draft.design.indenter.shape) != "hemisphere":
        raise ModelScopeError(
            f"indenter.shape: {shape}; two touches are modelled for hemispheres; set it to hemisphere"
        )
    apart_mm, need_mm = (
        float(np.linalg.norm(np.subtract(*_centres(draft, tips)))),
        2.0 * draft.design.indenter.tip_radius_mm,
    )
    if apart_mm < need_mm - 1e-6:
        raise ModelScopeError(
            f"touches: tips at ({tips[0, 0]:g}, {tips[0, 1]:g}) and ({tips[1, 0]:g}, {tips[1, 1]:g}) mm overlap: their "
            f"centres are {apart_mm:.3g} mm apart, need {need_mm:g} mm, two tip radii; move them apart"
        )


def pressed_tips(contact: Contact, tips_mm: FloatArray) -> TipsPress:
    """Press one or two tips into a pad.

    Parameters
    ----------
    tips_mm : (tip, 3) x, y, depth [mm]; a tip with a depth of 0 or less, or NaN, is absent

    Raises
    ------
    InputError : more than two tips touch, or none
    ModelScopeError : tips overlap or are no hemispheres, or a press is outside the range of the contact model
    """
    require_apart(contact.draft, tips_mm)
    tips = touching(tips_mm)
    if len(tips) > 1:
        order = np.lexsort(tips.T)  # so exchanged tips have the same bits
        found = _pressed(contact, tips[order])
        return replace(found, force_n=found.force_n[order], alone_n=found.alone_n[order])
    if not len(tips):
        raise InputError("tips_mm: none has a depth above 0; give one or two that touch")
    return _pressed(contact, tips)


def _pressed(contact: Contact, tips: FloatArray) -> TipsPress:
    """The press of one or two tips that touch."""
    pad = pad_at(contact, _frame_at(contact.draft, tips), FINE)
    if len(tips) > 1:
        _require_depth(contact, tips)
    is_flat = contact.draft.plan.top.is_flat
    surfaces = list(pad_surfaces(contact, tips)) if is_flat else []
    library_n = np.array([one.near.force_n for one in surfaces] if is_flat else [0.0] * len(tips))
    overlaps = [_overlap(pad, contact, tip) for tip in tips]
    if is_flat and len(tips) == 1:
        return TipsPress(
            top=_library_top(pad, surfaces[0], overlaps[0]), force_n=library_n, alone_n=library_n
        )
    is_seen = tips[:, 2] >= pad.step_mm**2 / contact.tip_radius_mm
    if not is_seen.all():  # it reaches one node or none, and changes less than the grid resolves
        top = _pressed(contact, tips[is_seen]).top if is_seen.any() else _untouched(pad)
        return TipsPress(top=top, force_n=library_n, alone_n=library_n)
    alone = [_linear(pad, one, float(tip[2])) for one, tip in zip(overlaps, tips, strict=True)]
    alone_n = np.array([one.force_n for one in alone])
    if len(tips) == 1:
        return TipsPress(top=alone[0].top, force_n=alone_n, alone_n=alone_n)
    both, nearest = _linear(pad, np.minimum(*overlaps), float(tips[:, 2].max())), np.argmin(overlaps, axis=0)
    force_n = np.array([both.pressure_mpa[nearest == k].sum() * pad.step_mm**2 for k in range(len(tips))])
    if not is_flat:
        return TipsPress(top=both.top, force_n=force_n, alone_n=alone_n)
    return TipsPress(
        top=_corrected(pad, both, alone, overlaps, nearest, surfaces),
        force_n=force_n * library_n / alone_n,
        alone_n=library_n,
    )


def _untouched(pad: Pad) -> GridTop:
    zero = np.zeros(pad.inside.shape)
    return GridTop(at_mm=pad.at_mm, x_mm=pad.x_mm, y_mm=pad.y_mm, height_mm=zero, level=zero - pad.step_mm)


def deepest_mm(contact: Contact, at_mm: Place | None = None) -> float:
    """Deepest press that the model of two tips covers at a place, or where the pad is thickest [mm]."""
    radius = contact.tip_radius_mm
    return min(LARGEST_HELD_SHARE * contact.layer_at(at_mm), 1.0) * radius


def _require_depth(contact: Contact, tips: FloatArray) -> None:
    """Refuse tips deeper than the linear layer is taken to hold, or than a ball is half sunk."""
    for x, y, depth in tips.tolist():
        deepest = deepest_mm(contact, (x, y))
        if depth > deepest + 1e-9:
            raise ModelScopeError(
                f"touches: {depth:g} mm is deeper than the model of two touches covers at ({x:g}, {y:g}) mm: "
                f"{deepest:.3g} mm, {LARGEST_HELD_SHARE:.0%} of the elastic layer there and one tip radius at most; "
                "press less deep"
            )


def _frame_at(draft: Draft, tips: FloatArray) -> Place:
    """Place of the press frame: the same for all presses on flat tops, between the tips on others."""
    if draft.plan.top.is_flat:
        return draft.plan.centre_mm
    x, y = tips[:, :2].mean(axis=0).tolist()
    return x, y


def _centres(draft: Draft, tips: FloatArray) -> FloatArray:
    """Centres (tip, 3) of the tips' balls in cavity coordinates [mm]."""
    top, radius = draft.plan.top, draft.design.indenter.tip_radius_mm
    return np.array(
        [
            np.array([x, y, float(top.height_mm(x, y))]) + (radius - depth) * np.asarray(top.normal(x, y))
            for x, y, depth in tips.tolist()
        ]
    )


def _overlap(pad: Pad, contact: Contact, tip: FloatArray) -> FloatArray:
    """Height (nx, ny) of a tip's lowest surface over the untouched top [mm]; infinite where there is none."""
    origin, axes = contact.draft.plan.top.press_frame(*pad.at_mm)
    x, y, z = axes @ (_centres(contact.draft, tip[None])[0] - origin)
    square = contact.tip_radius_mm**2 - (pad.x_mm[:, None] - x) ** 2 - (pad.y_mm - y) ** 2
    over = z - np.sqrt(np.maximum(square, 0.0)) + np.nan_to_num(pad.sag_mm)
    return np.where((square > 0.0) & (pad.wall_mm > 1e-9), over, np.inf)


def _linear(pad: Pad, overlap: FloatArray, depth_mm: float) -> HeldPress:
    """The press of a linear layer."""
    load, moved = pad.pressed(pad.slope * overlap, depth_mm)
    return settled(pad, overlap, load, moved, depth_mm, is_sharp_allowed=True)


def _library_top(pad: Pad, surface: PadSurface, overlap: FloatArray) -> GridTop:
    """The contact library's top under one tip, on the pad's grid."""
    x_mm, y_mm = pad.x_mm + pad.at_mm[0], pad.y_mm + pad.at_mm[1]
    radius = np.hypot(x_mm[:, None] - surface.at_mm[0], y_mm - surface.at_mm[1])
    level = np.clip(surface.near.contact_radius_mm - radius, -pad.step_mm, pad.step_mm)
    level = np.where(np.isfinite(overlap), level, -pad.step_mm)
    height = np.where(pad.inside, surface.height_mm(x_mm, y_mm), 0.0)
    return GridTop(
        at_mm=pad.at_mm,
        x_mm=pad.x_mm,
        y_mm=pad.y_mm,
        height_mm=np.where(level > 0.0, overlap, np.minimum(height, overlap)),
        level=level,
    )


def _corrected(
    pad: Pad,
    both: HeldPress,
    alone: list[HeldPress],
    overlaps: list[FloatArray],
    nearest: IntArray,
    surfaces: list[PadSurface],
) -> GridTop:
    """The top under both tips, corrected by what the linear layer is off under each alone."""
    free, wider = both.top.height_mm.copy(), []
    for surface, linear, overlap in zip(surfaces, alone, overlaps, strict=True):
        free += _library_top(pad, surface, overlap).height_mm - linear.top.height_mm
        wider.append(surface.near.contact_radius_mm - math.sqrt(linear.area_mm2 / math.pi))
    overlap = np.minimum(*overlaps)
    level = _unlimited(both.top.level, pad.step_mm) + np.array(wider)[nearest]
    level = np.where(np.isfinite(overlap), np.clip(level, -pad.step_mm, pad.step_mm), -pad.step_mm)
    height = np.where(level > 0.0, overlap, np.minimum(free, overlap))
    return replace(both.top, height_mm=height, level=level)


def _unlimited(level: FloatArray, step: float) -> FloatArray:
    """Distance (nx, ny) from the edge of the contact, positive inside, from that which is limited to the step [mm]."""
    is_inside, found = level > 0.0, level.copy()
    for side, sign in ((is_inside, 1.0), (~is_inside, -1.0)):
        away, nearest = distance_transform_edt(side, sampling=step, return_indices=True)
        far = side & (np.abs(level) >= step)
        found[far] = sign * (away + sign * level[tuple(nearest)])[far]
    return found
