"""The top of the pad in one state: a surface of revolution or a sum of heights, and the tips above it.

On a flat pad a single tip is a `RevolvedSurface`, which may fold; several tips, or a field, are a `SummedSurface`. A
crown, pressed by one tip or untouched, is a `CrownedTop`: a `SummedSurface` in the frame of the press.

Light in air also meets the tips. What is known of them is the press, so they are taken as solid and endless:
under a hemisphere the lower half sphere and a cylinder of its radius above; under any other tip a cylinder of the
contact radius that stands on the end of the contact, which hides no more than the tip does. A press without contact
has no tip. Where other heights raise the top into a tip, light there counts as absorbed by the tip.
"""

# ruff: noqa: ARG001
from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numba import njit
from numba.extending import overload
from numpy.typing import ArrayLike

from design.arrays import FloatArray
from design.errors import InputError, ModelScopeError
from sims.optics.oracle.crown import (
    CrownedTop,
    crowned_hit,
    in_frame,
    is_crown_steep,
    is_under_crown,
    turned,
    turned_back,
)
from sims.optics.oracle.heights import REACH_SHARE, Crown, SummedSurface, Tip, lower_sum, on_crown
from sims.optics.oracle.march import INSIDE, OUTSIDE, is_under_sum, summed_hit
from sims.optics.oracle.profile import check_indentation, free_curve
from sims.optics.oracle.scene import UNIT_TOLERANCE, beyond_walls_mm, outline_mm
from sims.optics.oracle.surface import (
    RevolvedSurface,
    is_submerged,
    lower_surface,
    surface_entry,
    surface_hit,
)
from sims.optics.scene.optical_scene import OpticalScene, PadForm, SmoothField
from sims.press import Indentation

Presses = Indentation | None | Sequence[Indentation | None]
"""What presses on the pad in one state: one tip, none, or one press or None for each tip."""


Top = RevolvedSurface | SummedSurface | CrownedTop
"""The top in one state; compiled code is specialised for each."""
Meeting = tuple[float, int, float, float, float]
"""Distance [mm], what, and a unit normal."""


def lower_presses(
    scene: OpticalScene,
    centres_mm: ArrayLike,
    indentations: Sequence[Presses],
    fields: Sequence[SmoothField | None] | None = None,
) -> list[Top]:
    """Check the states' presses and turn each into numbers.

    Parameters
    ----------
    centres_mm : (state, 2), or (state, tip, 2) where several tips press at once [mm]
    indentations : (state,) of one press or None (untouched), or of a sequence of these, one per tip
    fields : (state,) height added to the top, or None; on a crown along the normal of the press, over its frame

    Raises
    ------
    InputError : shapes that do not fit, places outside the pad, bad profiles
    ModelScopeError : with several tips, a field or a crown, a curve that folds; contacts that overlap; several tips
        on a crown, and a press from whose frame the crown falls away too steeply
    """
    states = len(indentations)
    centres = np.asarray(centres_mm, dtype=np.float64)
    if centres.ndim not in (2, 3) or len(centres) != states or centres.shape[-1] != 2:
        raise InputError(
            f"centres_mm: shape {centres.shape}, needs ({states}, 2): one x, y per indentation, or"
            f" ({states}, tips, 2)"
        )
    if fields is not None and len(fields) != states:
        raise InputError(f"fields: {len(fields)} given, needs {states}: one or None per state")
    tops = []
    for state, presses in enumerate(indentations):
        tips = _pressing_tips(scene, centres[state].reshape(-1, 2), presses, state)
        field = None if fields is None else fields[state]
        tops.append(_lower_top(scene, tips, field, f"indentations[{state}]"))
    return tops


def _pressing_tips(scene: OpticalScene, centres: FloatArray, presses: Presses, state: int) -> list[Tip]:
    """Centres (2,) [mm] and presses of the tips that touch the pad."""
    listed = [presses] if presses is None or isinstance(presses, Indentation) else list(presses)
    if len(listed) > len(centres) or (len(listed) != len(centres) and any(listed)):
        raise InputError(
            f"indentations[{state}]: {len(listed)} presses for {len(centres)} places in centres_mm[{state}]; give"
            " one press or None per tip"
        )
    tips = []
    for number, (centre, press) in enumerate(zip(centres, listed, strict=False)):
        if press is None or press.depth_mm <= 0.0:
            continue
        name = f"centres_mm[{state}]" if len(centres) == 1 else f"centres_mm[{state}, {number}]"
        _check_place(scene, centre, name)
        tips.append((centre, press))
    return tips


def _check_place(scene: OpticalScene, centre: FloatArray, name: str) -> None:
    for axis, place, limit in zip("xy", centre, (scene.length_mm, scene.width_mm), strict=True):
        if not 0.0 <= place <= limit:
            raise InputError(f"{name}: {axis} = {place:g} mm is outside the pad, 0 to {limit:g} mm")
    if scene.form is not None:
        beyond = beyond_walls_mm(scene.form, centre)
        if beyond.max() > UNIT_TOLERANCE:
            wall = int(beyond.argmax())
            wall_name = "the round wall" if wall >= len(scene.form.walls) else f"wall {wall}"
            raise InputError(
                f"{name}: {centre[0]:g}, {centre[1]:g} mm is {beyond.max():g} mm outside {wall_name}; press inside"
            )


def _lower_top(scene: OpticalScene, tips: list[Tip], field: SmoothField | None, where: str) -> Top:
    top_mm = scene.height_mm
    if scene.form is not None and not scene.form.top.is_flat:
        return _lower_crowned(scene, scene.form, tips, field, where)
    solids = _solids(tips, top_mm, where)
    if field is not None or len(tips) > 1:
        return lower_sum(tips, field, top_mm, where)._replace(solids=solids)
    centre, press = tips[0] if tips else (np.zeros(2), None)
    return lower_surface(press, centre, top_mm, where)._replace(solids=solids)


def _lower_crowned(
    scene: OpticalScene, form: PadForm, tips: list[Tip], field: SmoothField | None, where: str
) -> CrownedTop:
    if len(tips) > 1:
        raise ModelScopeError(
            f"{where}: {len(tips)} tips on a crown; only one is traced there, press one by one"
        )
    if field is not None and not tips:
        raise InputError(f"{where}: a field without a press on a crown has no frame; leave it out")
    place, press = tips[0] if tips else (np.array(form.top.apex_mm), None)
    origin, axes = form.top.press_frame(float(place[0]), float(place[1]))
    along = 1.0 if form.top.straight is None else 0.0
    crown = Crown(form.top.radius_mm, along, _reach_mm(scene, form, origin, axes, along))
    if crown.reach > REACH_SHARE * crown.radius:
        raise ModelScopeError(
            f"{where}: seen along the press the pad reaches {crown.reach:g} mm from its axis, and a crown of radius"
            f" {crown.radius:g} mm can be traced to {REACH_SHARE * crown.radius:g} mm; press nearer to the apex or"
            " flatten the crown"
        )
    alone: list[Tip] = []
    if press is not None:
        # a tilted tip's lowest place lies up to radius (1 - cosine) below its apex
        check_indentation(press, float(origin[2] - press.tip_radius_mm * (1.0 - axes[2, 2])), where)
        alone = [(np.zeros(2), press)]
    solids = _solids([(centre, on_crown(tip, crown.mean_radius)) for centre, tip in alone], 0.0, where)
    heights = lower_sum(alone, field, 0.0, where, crown)._replace(solids=solids)
    return CrownedTop(origin, np.ascontiguousarray(axes), heights)


def _reach_mm(
    scene: OpticalScene, form: PadForm, origin: FloatArray, axes: FloatArray, along: float
) -> float:
    """Farthest place of bottom or untouched top from a frame's axis, for a cylinder across it [mm]."""
    outline = outline_mm(form)
    top = form.top.height_mm(outline[:, 0], outline[:, 1])
    ends = np.vstack([np.column_stack([outline, height]) for height in (np.zeros(len(top)), top)])
    sideways = (ends - origin) @ axes[:2].T
    return float(np.sqrt(along * sideways[:, 0] ** 2 + sideways[:, 1] ** 2).max())


def _solids(tips: list[Tip], top_mm: float, where: str) -> FloatArray:
    """(k, 6) tips as light in air meets them: x, y of the axis; height of the sphere's centre, and its radius,
    0 for none; radius of the cylinder, and the height where it starts [mm]."""
    rows = []
    for (x, y), press in tips:
        if press.contact_radius_mm == 0.0:
            continue
        if press.is_hemisphere:
            centre, radius = top_mm - press.depth_mm + press.tip_radius_mm, press.tip_radius_mm
            rows.append((x, y, centre, radius, radius, centre))
        else:
            _, wetted, _ = free_curve(press, where)
            rows.append((x, y, 0.0, 0.0, wetted[-1, 0], top_mm + wetted[-1, 1]))
    return np.array(rows, dtype=np.float64).reshape(-1, 6)


def is_in_elastomer(top: Top, x: float, y: float, z: float) -> bool:
    """Whether a place x, y, z lies below the top."""
    if isinstance(top, CrownedTop):
        return is_under_crown(top, x, y, z)
    return is_under_sum(top, x, y, z) if isinstance(top, SummedSurface) else is_submerged(top, x, y, z)


def top_exit(
    top: Top, x: float, y: float, z: float, dx: float, dy: float, dz: float, limit: float
) -> Meeting:
    """First place where a ray from inside leaves the elastomer through the top.

    Parameters
    ----------
    x, y, z : start, inside the elastomer [mm]
    dx, dy, dz : unit direction
    limit : how far to look [mm]

    Returns
    -------
    distance [mm], what (`NOTHING`, `FREE`, `CONTACT`), and the unit normal that points out of the elastomer
    """
    if isinstance(top, CrownedTop):
        return crowned_hit(top, INSIDE, x, y, z, dx, dy, dz, limit)
    return (
        summed_hit(top, INSIDE, x, y, z, dx, dy, dz, limit)
        if isinstance(top, SummedSurface)
        else surface_hit(top, x, y, z, dx, dy, dz, limit)
    )


def top_entry(
    top: Top, x: float, y: float, z: float, dx: float, dy: float, dz: float, limit: float
) -> Meeting:
    """First place where a ray in air meets the top; as `top_exit`, but the normal points into the elastomer."""
    if isinstance(top, CrownedTop):
        return crowned_hit(top, OUTSIDE, x, y, z, dx, dy, dz, limit)
    return (
        summed_hit(top, OUTSIDE, x, y, z, dx, dy, dz, limit)
        if isinstance(top, SummedSurface)
        else surface_entry(top, x, y, z, dx, dy, dz, limit)
    )


def tip_met(
    top: Top, x: float, y: float, z: float, dx: float, dy: float, dz: float, limit: float
) -> tuple[float, bool, float, float, float]:
    """First place where a ray in air meets a tip; parameters and results as of `tip_hit`."""
    if isinstance(top, CrownedTop):
        return _crowned_tip_hit(top, x, y, z, dx, dy, dz, limit)
    return tip_hit(top.solids, x, y, z, dx, dy, dz, limit)


def is_untouched(top: Top) -> bool:
    """Whether light that leaves through the top can meet nothing any more: flat and crowned pads are convex."""
    if isinstance(top, CrownedTop):
        return not (len(top.heights.tips) or len(top.heights.nodes))
    return isinstance(top, RevolvedSurface) and top.edge == 0.0


def is_steep(top: Top, slope: float, x: float, y: float, z: float, nx: float, ny: float, nz: float) -> bool:
    """Whether the top slopes against the untouched one by more than `slope` [-], at a place with a unit normal.

    On a crown that is the slope of press and field in the frame of the press.
    """
    if isinstance(top, CrownedTop):
        return is_crown_steep(top, slope, x, y, z, nx, ny, nz)
    return nz * math.sqrt(1.0 + slope**2) < 1.0


@njit()
def _crowned_tip_hit(
    top: CrownedTop, x: float, y: float, z: float, dx: float, dy: float, dz: float, limit: float
) -> tuple[float, bool, float, float, float]:
    u, v, w = in_frame(top, x, y, z)
    du, dv, dw = turned(top, dx, dy, dz)
    distance, is_hit, nu, nv, nw = tip_hit(top.heights.solids, u, v, w, du, dv, dw, limit)
    nx, ny, nz = turned_back(top, nu, nv, nw)
    return distance, is_hit, nx, ny, nz


def _of_kind(top: Any, of_crowned: Any, of_sum: Any, of_revolved: Any) -> Any:
    """The code for a top of a compiled kind."""
    kinds = {CrownedTop: of_crowned, SummedSurface: of_sum, RevolvedSurface: of_revolved}
    return kinds[top.instance_class]


@overload(is_in_elastomer, inline="always")
def _compiled_is_in_elastomer(top: Any, x: float, y: float, z: float) -> Any:
    def of_crowned(top: Any, x: float, y: float, z: float) -> Any:
        return is_under_crown(top, x, y, z)

    def of_sum(top: Any, x: float, y: float, z: float) -> Any:
        return is_under_sum(top, x, y, z)

    def of_revolved(top: Any, x: float, y: float, z: float) -> Any:
        return is_submerged(top, x, y, z)

    return _of_kind(top, of_crowned, of_sum, of_revolved)


@overload(top_exit, inline="always")
def _compiled_top_exit(
    top: Any, x: float, y: float, z: float, dx: float, dy: float, dz: float, limit: float
) -> Any:
    def of_crowned(
        top: Any, x: float, y: float, z: float, dx: float, dy: float, dz: float, limit: float
    ) -> Any:
        return crowned_hit(top, INSIDE, x, y, z, dx, dy, dz, limit)

    def of_sum(top: Any, x: float, y: float, z: float, dx: float, dy: float, dz: float, limit: float) -> Any:
        return summed_hit(top, INSIDE, x, y, z, dx, dy, dz, limit)

    def of_revolved(
        top: Any, x: float, y: float, z: float, dx: float, dy: float, dz: float, limit: float
    ) -> Any:
        return surface_hit(top, x, y, z, dx, dy, dz, limit)

    return _of_kind(top, of_crowned, of_sum, of_revolved)


@overload(top_entry, inline="always")
def _compiled_top_entry(
    top: Any, x: float, y: float, z: float, dx: float, dy: float, dz: float, limit: float
) -> Any:
    def of_crowned(
        top: Any, x: float, y: float, z: float, dx: float, dy: float, dz: float, limit: float
    ) -> Any:
        return crowned_hit(top, OUTSIDE, x, y, z, dx, dy, dz, limit)

    def of_sum(top: Any, x: float, y: float, z: float, dx: float, dy: float, dz: float, limit: float) -> Any:
        return summed_hit(top, OUTSIDE, x, y, z, dx, dy, dz, limit)

    def of_revolved(
        top: Any, x: float, y: float, z: float, dx: float, dy: float, dz: float, limit: float
    ) -> Any:
        return surface_entry(top, x, y, z, dx, dy, dz, limit)

    return _of_kind(top, of_crowned, of_sum, of_revolved)


@overload(tip_met, inline="always")
def _compiled_tip_met(
    top: Any, x: float, y: float, z: float, dx: float, dy: float, dz: float, limit: float
) -> Any:
    def of_crowned(
        top: Any, x: float, y: float, z: float, dx: float, dy: float, dz: float, limit: float
    ) -> Any:
        return _crowned_tip_hit(top, x, y, z, dx, dy, dz, limit)

    def of_flat(top: Any, x: float, y: float, z: float, dx: float, dy: float, dz: float, limit: float) -> Any:
        return tip_hit(top.solids, x, y, z, dx, dy, dz, limit)

    return _of_kind(top, of_crowned, of_flat, of_flat)


@overload(is_untouched, inline="always")
def _compiled_is_untouched(top: Any) -> Any:
    def of_crowned(top: Any) -> Any:
        return top.heights.tips.shape[0] == 0 and top.heights.nodes.shape[0] == 0

    def of_sum(top: Any) -> Any:
        return False

    def of_revolved(top: Any) -> Any:
        return top.edge == 0.0

    return _of_kind(top, of_crowned, of_sum, of_revolved)


@overload(is_steep, inline="always")
def _compiled_is_steep(
    top: Any, slope: float, x: float, y: float, z: float, nx: float, ny: float, nz: float
) -> Any:
    def of_crowned(
        top: Any, slope: float, x: float, y: float, z: float, nx: float, ny: float, nz: float
    ) -> Any:
        return is_crown_steep(top, slope, x, y, z, nx, ny, nz)

    def of_flat(top: Any, slope: float, x: float, y: float, z: float, nx: float, ny: float, nz: float) -> Any:
        return nz * math.sqrt(1.0 + slope**2) < 1.0

    return _of_kind(top, of_crowned, of_flat, of_flat)


@njit()
def tip_hit(
    solids: FloatArray, x: float, y: float, z: float, dx: float, dy: float, dz: float, limit: float
) -> tuple[float, bool, float, float, float]:
    """First place nearer than `limit` where a ray in air meets a tip.

    Returns
    -------
    distance [mm], whether there is one, and the unit normal that points out of the tip; a normal of length zero is
    a start inside the tip
    """
    best, hit, nx, ny, nz = limit, False, 0.0, 0.0, 0.0
    for k in range(solids.shape[0]):
        cx, cy, cz, sphere, radius, foot = solids[k]
        px, py, pz = x - cx, y - cy, z - cz
        across = px * px + py * py
        if (z >= foot and across < radius * radius) or (z < foot and across + pz * pz < sphere * sphere):
            return 0.0, True, 0.0, 0.0, 0.0
        a, b = dx * dx + dy * dy, px * dx + py * dy
        gap = b * b - a * (across - radius * radius)
        if b < 0.0 and gap > 0.0:
            t = (-b - math.sqrt(gap)) / a
            if 0.0 <= t < best and z + t * dz >= foot:
                best, hit = t, True
                nx, ny, nz = (px + t * dx) / radius, (py + t * dy) / radius, 0.0
        b += pz * dz
        gap = b * b - (across + pz * pz - sphere * sphere)
        if sphere > 0.0 and b < 0.0 and gap > 0.0:
            t = -b - math.sqrt(gap)
            if 0.0 <= t < best and z + t * dz < foot:
                best, hit = t, True
                nx, ny, nz = (px + t * dx) / sphere, (py + t * dy) / sphere, (pz + t * dz) / sphere
    return best, hit, nx, ny, nz
