"""Convert presses on the pad to the ray tracer's top: cut their profiles into pieces.

A profile is the curve (radius, height) of a press around the tip's axis. Its part beyond the contact is the *free
curve*.

Contact
-------
For a hemispherical tip the contact is an exact sphere. If the press is deeper than the tip radius, the contact
continues above the equator on the cylindrical shank, up to the curve's last point within the contact radius. For any
other tip the curve itself is the contact, up to that point.

As cones
--------
A single tip on a flat top is given by cones. The stored points (radius, height) of the free curve are interpolated by a
smooth curve: radius and height are each a monotone cubic (PCHIP, Fritsch & Carlson 1980) over chord length. So the
curve may run back under itself. It is cut into straight pieces that turn by at most `TURN_LIMIT` and are at most
`PIECE_LIMIT_MM` long, which keeps them within 0.15 µm of the curve. Revolved, each piece is a cone frustum. Normals
turn linearly from end to end of a piece, so they are continuous. If the curve does not end at height zero, a vertical
ring closes the step.

As heights that add up
----------------------
On a crown, with a field or with several tips, heights are added. The curve beyond an exact sphere, or the whole curve
for other tips, is a monotone cubic (PCHIP) of height over radius through the stored points. Curves with more than one
height at a radius are refused, except for a shank in the pad: it is made to lean, with the slope `STEEPEST`.

As a grid
---------
Under several tips the contact model gives the whole top, as heights at nodes of a grid in press coordinates. Between
them it is a bicubic spline (SciPy's, not the fast model's), held as a field, with contact where a level is above 0.

This file shares no code with the fast light model on purpose: the two are compared with each other.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import PchipInterpolator, RectBivariateSpline

from optopad.design.arrays import FloatArray
from optopad.design.errors import InputError, ModelScopeError
from optopad.design.shape.top import Top
from optopad.sims.optics.scene.optical_scene import OpticalScene, SmoothField
from optopad.sims.press import GridTop, Indentation
from tests.oracle.scene import outline_mm
from tests.oracle.surface import (
    BINS,
    BLOCK,
    REACH_SHARE,
    SEAM_MM,
    STEEPEST_SHARE,
    Surface,
)

Presses = Indentation | GridTop | None | Sequence[Indentation | None]
"""The presses in one state: one press, None for the untouched pad, one press or None for each tip, or the whole top."""
Tip = tuple[FloatArray, Indentation]
"""Centre (2,) [mm] and press of a tip that touches the pad."""

TIP_MISMATCH_MM = 0.1
"""Largest distance between tip and curve at the end of the contact [mm]; some distance is due to the contact model's
mesh and penetration."""
TURN_LIMIT = 0.01
"""Largest turn of the curve within one straight piece [rad]."""
PIECE_LIMIT_MM = 0.1
"""Longest straight piece [mm]. Together with the turn limit, it keeps pieces within 0.125 µm of the curve."""
STEEPEST, SPHERE_KNOTS = 30.0, 97
"""Outward slope given to a shank in the pad, so its edge moves out by a thirtieth of the wetted length; and number of
points on the sphere below the shank."""


def lower_presses(
    scene: OpticalScene,
    centres_mm: ArrayLike,
    indentations: Sequence[Presses],
    fields: Sequence[SmoothField | None] | None = None,
) -> list[Surface]:
    """Convert each state's top to numbers.

    Parameters
    ----------
    scene : the pad
    centres_mm : (state, 2), or (state, tip, 2) if several tips press at once [mm]
    indentations : (state,) press or None (untouched), or a sequence with one of these per tip
    fields : (state,) smooth height added to the top, or None. On a crown it is a function of press coordinates x and y,
        added along the normal at the press

    Raises
    ------
    InputError : a curve is off its tip.
    ModelScopeError : a curve folds and there are several tips, a field or a crown; contacts overlap; several tips press
        on a crown; or the crown falls too steeply around a press.
    """
    centres = np.asarray(centres_mm, dtype=np.float64)
    top, outline = Top(clear_mm=scene.height_mm, apex_mm=(0.0, 0.0)), None
    if scene.form is not None and not scene.form.top.is_flat:
        top, outline = scene.form.top, outline_mm(scene.form)
    tops = []
    for state, presses in enumerate(indentations):
        if isinstance(presses, GridTop):
            tops.append(lower_grid(top, presses, f"indentations[{state}]", outline))
            continue
        tips = _pressing_tips(centres[state].reshape(-1, 2), presses)
        field = None if fields is None else fields[state]
        tops.append(lower_top(top, tips, field, f"indentations[{state}]", outline))
    return tops


def _pressing_tips(centres: FloatArray, presses: Presses) -> list[Tip]:
    """Tips that touch the pad in one state."""
    listed = [presses] if presses is None or isinstance(presses, Indentation) else presses
    if not any(listed):
        return []
    pairs = zip(centres, listed, strict=True)
    return [(centre, press) for centre, press in pairs if press is not None and press.depth_mm > 0.0]


def lower_top(
    top: Top,
    tips: Sequence[Tip],
    field: SmoothField | None = None,
    where: str = "indentations",
    outline: FloatArray | None = None,
    frame: tuple[FloatArray, FloatArray] | None = None,
) -> Surface:
    """Convert an untouched top, the tips that press on it and a field to numbers.

    where : name of the presses for error messages
    outline : (n, 2) outline of the pad in plan [mm], needed under a crown
    frame : origin and axes of press coordinates, for a field without a tip; None for those of the tip or the cavity

    Raises
    ------
    InputError, ModelScopeError : as for `lower_presses`.
    """
    is_sum = not top.is_flat or field is not None or len(tips) > 1
    origin, axes = frame or (np.array([0.0, 0.0, top.clear_mm]), np.eye(3))
    if frame is None:
        _check_together(top, tips, field, where)
    if frame is None and not (top.is_flat and is_sum):  # in the coordinates of the one press
        x, y = tips[0][0] if tips else top.apex_mm
        origin, axes = top.press_frame(float(x), float(y))
        tips = [(np.zeros(2), press) for _, press in tips]
    reach = 0.0 if outline is None else _reach_mm(top, origin, axes, outline, where)
    curve = top.in_frame
    parts = []
    for number, (centre, press) in enumerate(tips):
        name = where if len(tips) == 1 else f"{where}[{number}]"
        parts.append(_lower_profile(centre, press, curve.mean_curvature, is_sum, name))
    first = np.cumsum([0, *(len(part.curve) for part in parts)])
    starts = [part.starts + row for part, row in zip(parts, first[:-1], strict=True)]
    nodes, corner, step, low, high, field_bend = _lowered_field(field)
    cones = _joined([part.cones for part in parts], 8)
    return Surface(
        origin=tuple(origin.tolist()),
        axes=tuple(axes.ravel().tolist()),
        kx=float(curve.kx),
        ky=float(curve.ky),
        lowest=low - float(_falls(reach, curve.ky)) + sum(part.lowest for part in parts),
        highest=high + sum(part.highest for part in parts),
        is_sum=is_sum,
        tips=_joined([[*part.tip, first[k], first[k + 1] - 1] for k, part in enumerate(parts)], 8),
        solids=_joined([part.solid for part in parts], 6),
        cones=cones,
        blocks=_bounding_blocks(cones),
        curve=_joined([part.curve for part in parts], 5),
        starts=_joined(starts, BINS).astype(np.int64),
        bends=_joined([part.bends for part in parts], BINS),
        nodes=nodes,
        corner=(float(corner[0]), float(corner[1])),
        step=(float(step[0]), float(step[1])),
        field_bend=field_bend,
        level=np.empty((0, 0)),
    )


def lower_grid(top: Top, press: GridTop, where: str, outline: FloatArray | None) -> Surface:
    """Convert a top that is given as a grid to numbers; parameters and errors are those of `lower_top`."""
    origin, axes = top.press_frame(*press.at_mm)
    bare = lower_top(top, [], _spline_field(press), where, outline, (origin, axes))
    return bare._replace(level=np.ascontiguousarray(press.level, dtype=np.float64))


def _spline_field(press: GridTop) -> SmoothField:
    x, y = press.x_mm, press.y_mm
    spline = RectBivariateSpline(x, y, press.height_mm)
    nodes = np.stack([spline(x, y, dx, dy) for dx, dy in ((0, 0), (1, 0), (0, 1), (1, 1))], axis=-1)
    steps = np.array([np.ptp(one) / (len(one) - 1) for one in (x, y)])
    return SmoothField(origin_mm=np.array([x[0], y[0]]), step_mm=steps, nodes=nodes)


def _check_together(top: Top, tips: Sequence[Tip], field: SmoothField | None, where: str) -> None:
    if not top.is_flat and len(tips) > 1:
        raise ModelScopeError(
            f"{where}: {len(tips)} tips on a crown; only one is traced there, press one by one"
        )
    if not top.is_flat and field is not None and not tips:
        raise InputError(f"{where}: a field without a press on a crown has no frame; leave it out")
    for k, (centre, press) in enumerate(tips):
        for other, (place, second) in enumerate(tips[:k]):
            gap = math.hypot(*(np.asarray(centre) - np.asarray(place)))
            need = press.contact_radius_mm + second.contact_radius_mm
            if gap < need:
                raise ModelScopeError(
                    f"{where}[{other}] and [{k}]: {gap:g} mm apart, but their contacts have radii that add up to"
                    f" {need:g} mm; move the tips apart"
                )


def _reach_mm(top: Top, origin: FloatArray, axes: FloatArray, outline: FloatArray, where: str) -> float:
    """Largest distance of the pad's points from the press axis [mm]; on a cylinder, only across it."""
    rim = top.height_mm(outline[:, 0], outline[:, 1])
    ends = np.vstack([np.column_stack([outline, height]) for height in (np.zeros(len(rim)), rim)])
    u, v, _ = axes @ (ends - origin).T
    reach = float(np.hypot(u if top.straight is None else 0.0, v).max())
    limit = REACH_SHARE * top.radius_mm
    if reach > limit:
        raise ModelScopeError(
            f"{where}: seen along the press the pad reaches {reach:g} mm from its axis, and a crown of radius"
            f" {top.radius_mm:g} mm can be traced to {limit:g} mm; press nearer to the apex or flatten the crown"
        )
    return reach


def _falls(radius_mm: ArrayLike, curvature: float) -> FloatArray:
    """(...,) distance of a sphere below its tangent plane at (...,) radii [mm]; continued as in `surface.sag`."""
    radius = np.asarray(radius_mm, dtype=np.float64)
    near = np.minimum(radius, STEEPEST_SHARE / max(curvature, 1e-99))
    root = np.sqrt(1.0 - (curvature * near) ** 2)
    fall: FloatArray = curvature * near * (near / (1.0 + root) + (radius - near) / root)
    return fall


def _joined(parts: Sequence[ArrayLike], columns: int) -> FloatArray:
    return np.vstack([np.empty((0, columns)), *parts])


class _Profile(NamedTuple):
    """One tip's part of a `Surface`: either cones, or a curve of heights to be added; the other of the two is empty."""

    tip: tuple[float, ...]
    lowest: float
    highest: float
    solid: FloatArray
    cones: FloatArray
    curve: FloatArray
    starts: FloatArray
    bends: FloatArray


def _lower_profile(
    centre: FloatArray, given: Indentation, mean_curvature: float, is_sum: bool, where: str
) -> _Profile:
    """Convert a press's profile, whose heights are measured from a sphere of the mean curvature [1/mm]."""
    heights = np.asarray(given.height_mm, float) - _falls(given.radius_mm, mean_curvature)
    press = replace(given, height_mm=heights)  # above the tangent plane
    free, wetted, cap = free_curve(press, where)
    cones, curve, starts, bends = (np.empty((0, columns)) for columns in (8, 5, BINS, BINS))
    if is_sum:
        knots, sphere, contact = _single_valued(press, free, wetted, cap, where)
        knots[:, 1] += _falls(knots[:, 0], mean_curvature)
        spline = PchipInterpolator(knots[:, 0], knots[:, 1])
        curve = np.column_stack([knots[:-1, 0], spline.c[::-1].T])
        starts, bends = _rings(float(knots[-1, 0]), contact, sphere, curve, mean_curvature)
    else:
        knots, sphere, contact = np.vstack([wetted, free]), press.tip_radius_mm, cap
        ring = np.array([free[-1], [free[-1, 0], 0.0]])[: 2 if abs(free[-1, 1]) >= 1e-9 else 0]
        rows = [*_straight_pieces(wetted, 1.0), *_curve_pieces(free), *_straight_pieces(ring, 0.0)]
        cones = np.array(rows, dtype=np.float64)
    return _Profile(
        tip=(*centre, knots[-1, 0], contact, sphere, press.depth_mm),
        lowest=min(-press.depth_mm, knots[:, 1].min()),
        highest=max(knots[:, 1].max(), 0.0),
        solid=_solid(press, centre, wetted),
        cones=cones,
        curve=curve,
        starts=starts,
        bends=bends,
    )


def _solid(press: Indentation, centre: FloatArray, wetted: FloatArray) -> FloatArray:
    """(1, 6) row of `Surface.solids` for the tip that light in air meets; (0, 6) if there is no contact."""
    x, y = centre
    if press.contact_radius_mm == 0.0:
        return np.empty((0, 6))
    if press.is_hemisphere:
        tip, middle = press.tip_radius_mm, press.tip_radius_mm - press.depth_mm
        return np.array([[x, y, middle, tip, tip, middle]])
    return np.array([[x, y, 0.0, 0.0, *wetted[-1]]])


def free_curve(press: Indentation, where: str) -> tuple[FloatArray, FloatArray, float]:
    """Points (n, 2) of the free curve; points (m, 2) of the contact beyond its sphere; radius of the sphere's edge.

    The radius is 0 if the tip is no hemisphere or does not touch.
    """
    curve = np.column_stack([press.radius_mm, press.height_mm]).astype(np.float64)
    if press.contact_radius_mm == 0.0:
        return apart(curve), np.empty((0, 2)), 0.0
    tip, equator = press.tip_radius_mm, press.tip_radius_mm - press.depth_mm
    last = int(np.flatnonzero(curve[:, 0] <= press.contact_radius_mm * (1.0 + 1e-9))[-1])
    if not press.is_hemisphere:
        return apart(curve[last:]), apart(curve[: last + 1]), 0.0
    r, z = curve[last]
    gap = math.hypot(r, z - equator) - tip if z <= equator else r - tip
    if abs(gap) > TIP_MISMATCH_MM:
        raise InputError(
            f"{where}: at the contact radius the curve is {gap:+.3f} mm off the tip (limit"
            f" {TIP_MISMATCH_MM:g} mm); check tip_radius_mm {tip:g} and depth_mm {press.depth_mm:g}"
        )
    if z > equator:
        shank = np.array([[tip, equator], [tip, z]])
        return apart(np.vstack([shank[1:], curve[last + 1 :]])), shank, tip
    cap = min(press.contact_radius_mm, tip)
    start = np.array([[cap, equator - math.sqrt(tip * tip - cap * cap)]])
    return apart(np.vstack([start, curve[last + 1 :]])), np.empty((0, 2)), cap


def apart(knots: FloatArray) -> FloatArray:
    """Points of a curve without those that repeat the previous point."""
    step = np.hypot(*np.diff(knots, axis=0).T)
    return np.asarray(knots[np.concatenate([[True], step > SEAM_MM])])


def _straight_pieces(ends: FloatArray, contact: float) -> list[tuple[float, ...]]:
    step = np.diff(ends, axis=0)
    size, angle = np.hypot(step[:, 0], step[:, 1]), np.arctan2(step[:, 1], step[:, 0])
    return [(*ends[i], *(step[i] / size[i]), size[i], angle[i], angle[i], contact) for i in range(len(step))]


def _curve_pieces(knots: FloatArray) -> list[tuple[float, ...]]:
    """Cut the smooth curve through the points into straight pieces, as rows of `Surface.cones`."""
    chord = np.hypot(*np.diff(knots, axis=0).T)
    along = np.concatenate([[0.0], np.cumsum(chord)])
    curve = PchipInterpolator(along, knots)
    tangent = curve.derivative()
    sample = along[:-1, None] + chord[:, None] * np.linspace(0.0, 1.0, 9)
    turn = np.abs(np.diff(_angles(tangent(sample), np.diff(knots, axis=0)[:, None, :]), axis=1)).sum(axis=1)
    count = np.ceil(np.maximum(turn / TURN_LIMIT, chord / PIECE_LIMIT_MM)).astype(int).clip(min=1)
    pieces: list[tuple[float, ...]] = []
    for start, length, n in zip(along[:-1], chord, count, strict=True):
        cut = start + length * np.linspace(0.0, 1.0, n + 1)
        point = np.asarray(curve(cut))
        step = np.diff(point, axis=0)
        size = np.hypot(*step.T)
        angle = _angles(np.asarray(tangent(cut)), np.vstack([step, step[-1:]]))
        pieces += [(*point[i], *(step[i] / size[i]), size[i], angle[i], angle[i + 1], 0.0) for i in range(n)]
    return pieces


def _angles(tangent: FloatArray, fallback: FloatArray) -> FloatArray:
    """Angle of tangents (..., n, 2) to the radial direction, without jumps [rad]; `fallback` replaces zero tangents."""
    at_rest = np.hypot(tangent[..., 0], tangent[..., 1])[..., None] < 1e-9
    used = np.where(at_rest, fallback, tangent)
    return np.asarray(np.unwrap(np.arctan2(used[..., 1], used[..., 0]), axis=-1))


def _bounding_blocks(table: FloatArray) -> FloatArray:
    ends = table[:, :2] + table[:, 2:4] * table[:, 4:5]
    rows = []
    for first in range(0, len(table), BLOCK):
        points = np.vstack([table[first : first + BLOCK, :2], ends[first : first + BLOCK]])
        low, high = points.min(axis=0) - SEAM_MM, points.max(axis=0) + SEAM_MM
        rows.append((max(low[0], 0.0), high[0], low[1], high[1]))
    return np.array(rows).reshape(-1, 4)


def _single_valued(
    press: Indentation, free: FloatArray, wetted: FloatArray, cap: float, where: str
) -> tuple[FloatArray, float, float]:
    """Convert a curve to one height per radius.

    Returns
    -------
    (n, 2) radius and height by increasing radius; radius of the sphere at the axis, 0 if there is none; contact radius.
    All in mm

    Raises
    ------
    ModelScopeError : the curve folds.
    """
    knots, sphere, contact = free, cap if press.is_hemisphere else 0.0, float(press.contact_radius_mm)
    if not press.is_hemisphere and len(wetted):
        knots = np.vstack([wetted, knots[1:]])
    if press.tip_radius_mm < press.depth_mm and sphere >= press.tip_radius_mm:
        knots, sphere = _leaning(press, knots), 0.0
        contact = float(knots[SPHERE_KNOTS, 0])
    if np.diff(knots[:, 0]).min() < SEAM_MM:
        raise ModelScopeError(
            f"{where}: the curve has several heights at one radius (it folds); with several tips, a field or a crown"
            " only single-valued curves can be traced: press less deep"
        )
    return knots, press.tip_radius_mm if sphere > 0.0 else 0.0, contact


def _leaning(press: Indentation, free: FloatArray) -> FloatArray:
    """Points of a press beyond the tip's equator: sphere, shank as a steep cone, and the free curve moved outward."""
    tip, equator = press.tip_radius_mm, press.tip_radius_mm - press.depth_mm
    angle = np.linspace(0.0, math.atan(STEEPEST), SPHERE_KNOTS)
    sphere = np.column_stack([tip * np.sin(angle), equator - tip * np.cos(angle)])
    rise = free[0, 1] - sphere[-1, 1]
    edge = np.array([[sphere[-1, 0] + rise / STEEPEST, free[0, 1]]])
    beyond = free[1:].copy()
    least = edge[0, 0] + 2.0 * SEAM_MM * np.arange(1, len(beyond) + 1)
    beyond[:, 0] = np.maximum(np.maximum.accumulate(beyond[:, 0]), least)
    return np.vstack([sphere, edge, beyond])


def _rings(
    edge: float, contact: float, sphere: float, pieces: FloatArray, mean_curvature: float
) -> tuple[FloatArray, FloatArray]:
    """For each ring, (1, BINS) first piece that reaches into it, and (1, BINS) bound on curvature [1/mm]."""
    border = np.linspace(0.0, edge, BINS + 1)
    ends = np.append(pieces[1:, 0], edge)
    first = np.searchsorted(ends, border[:-1], side="left").clip(max=len(pieces) - 1)
    last = np.searchsorted(pieces[:, 0], border[1:], side="right") - 1
    piece_bend = _piece_bends(pieces, ends)
    bends = np.zeros(BINS)
    for ring in range(BINS):
        if last[ring] >= first[ring]:
            bends[ring] = piece_bend[first[ring] : last[ring] + 1].max()
        if sphere > 0.0 and border[ring] < contact:
            inner = sphere**2 - min(border[ring + 1], contact) ** 2
            crown = 1.0 - min(mean_curvature * min(border[ring + 1], contact), STEEPEST_SHARE) ** 2
            bend = sphere**2 / max(inner, 1e-6) ** 1.5 + mean_curvature / crown**1.5
            bends[ring] = max(bends[ring], bend)
    return first[None], bends[None]


def _piece_bends(pieces: FloatArray, ends: FloatArray) -> FloatArray:
    """(m,) bound on |h''| and |h'| / r on each cubic piece [1/mm]."""
    start, size = pieces[:, 0], ends - pieces[:, 0]
    _, _, one, two, three = pieces.T
    second = np.maximum(np.abs(2.0 * two), np.abs(2.0 * two + 6.0 * three * size))
    slope = np.maximum(np.abs(one), np.abs(one + (2.0 * two + 3.0 * three * size) * size))
    slope += 0.25 * second * size  # a parabola between its ends
    return np.asarray(np.maximum(second, slope / np.maximum(start, 1e-2)))


def _lowered_field(
    field: SmoothField | None,
) -> tuple[FloatArray, FloatArray, FloatArray, float, float, float]:
    """Nodes, origin and step of a field; lowest and highest value [mm]; bound on curvature [1/mm]."""
    if field is None:
        return np.empty((0, 0, 4)), np.zeros(2), np.ones(2), 0.0, 0.0, 0.0
    nodes = np.ascontiguousarray(field.nodes, dtype=np.float64)
    step = np.asarray(field.step_mm, dtype=np.float64)
    net = _bezier_net(nodes, step)
    along = 6.0 * np.abs(np.diff(net, 2, axis=2)).max() / step[0] ** 2
    across = 6.0 * np.abs(np.diff(net, 2, axis=3)).max() / step[1] ** 2
    mixed = 9.0 * np.abs(np.diff(np.diff(net, axis=2), axis=3)).max() / (step[0] * step[1])
    bend = float(max(along, across) + mixed)
    origin = np.asarray(field.origin_mm, dtype=np.float64)
    return nodes, origin, step, min(float(net.min()), 0.0), max(float(net.max()), 0.0), bend


def _bezier_net(nodes: FloatArray, step: FloatArray) -> FloatArray:
    """(nx - 1, ny - 1, 4, 4) Bézier control heights of each cell; their convex hull bounds the patch and its slopes."""
    value, along, across, mixed = np.moveaxis(nodes, -1, 0)
    dx, dy = step / 3.0
    corner = np.empty((*value.shape, 3, 3))  # control heights at -1, 0, 1 steps / 3 around each node
    for i, u in enumerate((-dx, 0.0, dx)):
        for j, v in enumerate((-dy, 0.0, dy)):
            corner[..., i, j] = value + u * along + v * across + u * v * mixed
    net = np.empty((value.shape[0] - 1, value.shape[1] - 1, 4, 4))
    net[..., :2, :2] = corner[:-1, :-1, 1:, 1:]
    net[..., 2:, :2] = corner[1:, :-1, :2, 1:]
    net[..., :2, 2:] = corner[:-1, 1:, 1:, :2]
    net[..., 2:, 2:] = corner[1:, 1:, :2, :2]
    return net
