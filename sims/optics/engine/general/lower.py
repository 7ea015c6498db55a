"""Convert a disc or crowned pad, and presses on it, to the arrays that the light kernels read."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from optopad.design.arrays import FloatArray
from optopad.design.errors import InputError, ModelScopeError
from optopad.design.shape.top import Top
from optopad.sims.optics.engine.general.grid import check_grid, gridded
from optopad.sims.optics.engine.general.patches import border_mm, from_arc
from optopad.sims.optics.engine.general.rays import BOTTOM, INSIDE
from optopad.sims.optics.engine.general.top import (
    BARE,
    CUPS,
    CYLINDER,
    DEPTH,
    FIELD_X,
    FIELD_Y,
    FLAT,
    FORMED_ROW,
    GRID_X,
    GRID_Y,
    LOWS,
    MIRRORING,
    NODE,
    NUMBERS,
    OUTER,
    SKIN,
    SKIRT_EDGE,
    SPHERE,
    FormedTop,
    empty_grid,
    empty_row,
)
from optopad.sims.optics.scene.optical_scene import OpticalScene, PadForm, SmoothField
from optopad.sims.optics.surface.curves import (
    CELLS,
    CONTACT_R,
    OUTER_R,
    PIECE_COLUMNS,
    PIECES,
    REACH,
    SKIRT_R,
    STEEP,
    check_curve,
    lower_curve,
    lowest_of_pieces_mm,
    outward_cup,
)
from optopad.sims.press import GridTop, Indentation

REACH_SHARE = 0.97
"""Largest distance of the pad's points from the axis of a press, relative to the crown's radius; farther away the crown
is too steep."""
OUTLINE_PLACES = 1440
DARK = 1e-12
"""Share of light that a diffuse skin of reflectance 0 scatters in the model, as 0 stands for a bare top [-]."""
FLUSH_MM = 1e-9
"""Height of a face that looks up at or below which it is part of the bottom [mm]."""
FRAME = 12
"""Number of values that describe press coordinates: the origin (3) and the axes (9)."""


@dataclass(frozen=True, kw_only=True)
class FormedStack:
    """Tops of a disc or crowned pad in all states.

    Attributes
    ----------
    rows : (state, n) origin and axes of press coordinates, numbers of the top, then the radial table of its height; see
        `top.FormedTop`
    field : for each state its grid of heights, a single node if there is none
    """

    rows: FloatArray
    field: list[FloatArray]

    def top(self, state: int) -> FormedTop:
        """Top in the state of a given number."""
        row = self.rows[state]
        numbers = row[FRAME : FRAME + NUMBERS]
        table = row[FRAME + NUMBERS :].copy() if numbers[OUTER] > 0.0 else empty_row()
        axes = row[3:FRAME].reshape(3, 3).copy()
        return FormedTop(row[:3].copy(), axes, numbers.copy(), table, self.field[state])


def is_block(scene: OpticalScene) -> bool:
    """Whether a scene is a rectangular block with a flat top."""
    form = scene.form
    return form is None or (form.top.is_flat and len(form.arcs) == 0 and len(form.walls) == 4)


def check_formed(scene: OpticalScene, fields: Sequence[object] | None) -> None:
    """Refuse fields and smooth walls on disc and crowned pads: InputError."""
    if not is_block(scene) and fields is not None and any(field is not None for field in fields):
        raise InputError("fields: only on a block with a flat top one is traced; leave them out")
    if scene.wall_index is not None:
        raise InputError("wall_index: smooth walls are traced in blocks with a flat top alone")


def stack_formed(
    scene: OpticalScene,
    centres_mm: FloatArray,
    presses: Sequence[Indentation | GridTop | None],
    fields: Sequence[SmoothField | None] | None = None,
) -> FormedStack:
    """Convert the states of a disc or crowned pad, each with one press or none, to arrays.

    Parameters
    ----------
    scene : the pad
    centres_mm : (state, 2) location of the press in plan [mm]; ignored for an untouched state, and
        for a grid, which has its own
    presses : for each state a press or a grid, or None if untouched; heights are measured from the untouched top, along
        the normal at the location
    fields : for each state a smooth height to add, or None; only for blocks

    Raises
    ------
    InputError : a press is outside the pad, or its curve is invalid.
    ModelScopeError : a press goes through the clear layer, a tip overlaps a wall, or the crown falls too steeply around
        a press.
    """
    centres = np.asarray(centres_mm, dtype=np.float64)
    if centres.shape != (len(presses), 2):
        raise InputError(f"centres_mm: shape {centres.shape}, needs ({len(presses)}, 2)")
    rows, field = np.zeros((len(presses), FRAME + NUMBERS + FORMED_ROW)), [empty_grid()] * len(presses)
    for state, (centre, press) in enumerate(zip(centres, presses, strict=True)):
        if press is None or not _is_bent(press):
            top = formed_top(scene, centre, None)
        elif isinstance(press, GridTop):
            check_grid(scene, state, press)
            check_crown(scene, state, *press.at_mm)
            top = gridded(formed_top(scene, np.array(press.at_mm), None, at_apex=False), press)
            field[state] = top.grid
        else:
            check_place(scene, state, centre, press)
            top = formed_top(scene, centre, press)
            if fields is not None and (own := fields[state]) is not None:
                top = _with_field(scene, top, own)
                field[state] = top.grid
        packed = np.concatenate([top.origin, top.axes.ravel(), top.numbers, top.row])
        rows[state, : len(packed)] = packed
    return FormedStack(rows=rows, field=field)


def _is_bent(press: Indentation | GridTop) -> bool:
    return bool(press.height_mm.any()) if isinstance(press, GridTop) else press.depth_mm > 0.0


def check_place(scene: OpticalScene, state: int, centre_mm: FloatArray, press: Indentation) -> None:
    """Check that a press can be modelled at its location.

    Raises
    ------
    InputError, ModelScopeError : see `stack_formed`.
    """
    form = scene.form
    assert form is not None
    x, y = (float(value) for value in centre_mm)
    walls, arcs = walls_of(scene)
    gaps = [level - nx * x - ny * y for nx, ny, level in walls]
    for arc in arcs:
        away, is_here = from_arc(arc, np.array(x), np.array(y))
        gaps.append(float(arc[2] - away) if is_here else math.inf)
    room = min(gaps) if math.isfinite(x) and math.isfinite(y) else -math.inf
    if room <= 0.0:
        raise InputError(f"state {state}: press at ({x:g}, {y:g}) mm is outside the pad; move it inside")
    if room <= press.contact_radius_mm:
        raise ModelScopeError(
            f"state {state}: contact radius {press.contact_radius_mm:.2f} mm but only {room:.2f} mm to the wall; "
            "the surface model is axisymmetric: press further inside"
        )
    check_crown(scene, state, x, y)


def check_crown(scene: OpticalScene, state: int, x: float, y: float) -> None:
    """Check that the crown can be traced around a press at a location [mm].

    Raises
    ------
    ModelScopeError : it falls too steeply.
    """
    form = scene.form
    assert form is not None
    if form.top.is_flat:
        return
    reach, limit = _reach_mm(scene, form, x, y), REACH_SHARE * form.top.radius_mm
    if reach > limit:
        raise ModelScopeError(
            f"state {state}: seen along the press the pad reaches {reach:g} mm from its axis, and a crown of radius "
            f"{form.top.radius_mm:g} mm is traced to {limit:g} mm; press nearer to the apex or flatten the crown"
        )


def _reach_mm(scene: OpticalScene, form: PadForm, x_mm: float, y_mm: float) -> float:
    """Largest distance from a press's axis to bottom or untouched top [mm]; on a cylinder, only across it."""
    middle = np.array([scene.length_mm, scene.width_mm]) / 2.0
    corners = [
        np.arctan2(y - middle[1], x - middle[0])
        for x in (0.0, scene.length_mm)
        for y in (0.0, scene.width_mm)
    ]
    angle = np.concatenate([np.linspace(0.0, 2.0 * np.pi, OUTLINE_PLACES), corners])
    way = np.column_stack([np.cos(angle), np.sin(angle)])
    outline = border_mm(way, middle, *walls_of(scene))
    top = form.top.height_mm(outline[:, 0], outline[:, 1])
    ends = np.vstack([np.column_stack([outline, height]) for height in (np.zeros(len(top)), top)])
    origin, axes = form.top.press_frame(x_mm, y_mm)
    along, across = ((ends - origin) @ axes[:2].T).T
    reach = np.hypot(along, across) if form.top.straight is None else np.abs(across)
    return float(np.nanmax(reach))


def windows_of(scene: OpticalScene, kind: str) -> FloatArray:
    """(n, 16 + table) faces of emitters or receivers, one per table row.

    Columns are centre, unit tangent x and y, half sizes (of the part below the crown), outward normal x and y,
    Lambertian order, area as mounted, number of the wall (or `BOTTOM`, `INSIDE` for a face with a pose), outward normal
    z, unit vector along the height, and the radiance or response table.
    """
    form = scene.form
    assert form is not None
    walls = np.asarray(getattr(scene, f"{kind}_wall"))
    patches = np.asarray(getattr(scene, f"{kind}_patch"))
    poses = getattr(scene, f"{kind}_pose")
    rows = []
    for k, (wall, (along, z, half_u, half_v)) in enumerate(zip(walls, patches, strict=True)):
        order, values = _lobe_of(scene, kind, k)
        if wall < 0:
            rows.append(np.concatenate([_posed(poses[k], half_u, half_v, order), values]))
            continue
        x, y, tx, ty, nx, ny = form.walls[wall]
        ends = [(x + (along + s) * tx, y + (along + s) * ty) for s in (-half_u, 0.0, half_u)]
        top = min(float(form.top.height_mm(*end)) for end in ends)
        high = min(z + half_v, top)
        low = z - half_v
        centre = (x + along * tx, y + along * ty, (low + high) / 2)
        rows.append(
            np.concatenate(
                [
                    [*centre, tx, ty, half_u, max((high - low) / 2, 0.0), nx, ny, order],
                    [4.0 * half_u * half_v, wall, 0.0, 0.0, 0.0, 1.0],
                    values,
                ]
            )
        )
    return np.array(rows)


def _lobe_of(scene: OpticalScene, kind: str, number: int) -> tuple[float, FloatArray]:
    """Lambertian order of a face, and its radiance or response table; the order is -1 if the table is used."""
    table = scene.emitter_pattern if kind == "emitter" else scene.receiver_response
    order = float(scene.emitter_order[number]) if kind == "emitter" else 1.0
    if table is None:
        return order, np.empty(0)
    values = np.asarray(table[number]) / (1.0 if kind == "emitter" else np.pi)
    return (-1.0 if np.isfinite(values).all() else order), np.nan_to_num(values)


def _posed(pose: FloatArray, half_u: float, half_v: float, order: float) -> FloatArray:
    """(16,) row of a face with a pose; it is flush with the bottom if it looks up from height 0."""
    x, y, z, tilt, turn = pose
    ca, sa, ct, st = np.cos(turn), np.sin(turn), np.cos(tilt), np.sin(tilt)
    flush = tilt == 0.0 and z <= FLUSH_MM
    wall = BOTTOM if flush else INSIDE
    area = 4.0 * half_u * half_v
    return np.array(
        [
            x,
            y,
            0.0 if flush else z,
            -sa,
            ca,
            half_u,
            half_v,
            -ca * st,
            -sa * st,
            order,
            area,
            wall,
            -ct,
            -ca * ct,
            -sa * ct,
            st,
        ]
    )


def walls_of(scene: OpticalScene) -> tuple[FloatArray, FloatArray]:
    """(k, 3) outward normal x, y and distance from the origin of each flat wall; (m, 6) round walls as in `PadForm`."""
    form = scene.form
    assert form is not None
    walls, arcs = (np.asarray(rows, dtype=np.float64).reshape(-1, 6) for rows in (form.walls, form.arcs))
    level = walls[:, 0] * walls[:, 4] + walls[:, 1] * walls[:, 5]
    return np.column_stack([walls[:, 4:6], level]), np.ascontiguousarray(arcs)


def formed_top(
    scene: OpticalScene, centre_mm: FloatArray, press: Indentation | None, *, at_apex: bool = True
) -> FormedTop:
    """Top under one press at a location in plan; if `press` is None, the untouched top, in coordinates at its apex.

    at_apex : if False, the untouched top is in coordinates at the location, too
    """
    form = scene.form
    assert form is not None
    is_at_apex = press is None and at_apex
    place = form.top.apex_mm if is_at_apex else (float(centre_mm[0]), float(centre_mm[1]))
    origin, axes = form.top.press_frame(*place)
    kind, radius, mean = _crown_numbers(form.top)
    numbers = np.zeros(NUMBERS)
    numbers[:3] = kind, radius, mean
    numbers[SKIN] = {"bare": BARE, "specular": MIRRORING, "diffuse": max(scene.top_reflectance, DARK)}[
        scene.top_finish
    ]
    row = empty_row()
    if press is not None:
        row, radii = _lowered(press, mean, scene.height_mm)
        numbers[DEPTH : SKIRT_EDGE + 1] = press.depth_mm, *radii
    return FormedTop(origin, np.ascontiguousarray(axes), numbers, row, empty_grid())


def _with_field(scene: OpticalScene, top: FormedTop, field: SmoothField) -> FormedTop:
    """A pressed flat top with a smooth height added to it, and the bounds of both."""
    nodes, step = np.asarray(field.nodes), np.asarray(field.step_mm)
    grid = np.zeros((*nodes.shape[:2], NODE))
    grid[..., :4] = nodes
    numbers, row = top.numbers.copy(), top.row.copy()
    value, along, across, _ = np.moveaxis(nodes, -1, 0)
    bend = max(
        float(np.abs(np.diff(slope, axis=axis)).max(initial=0.0) / step[axis])
        for slope in (along, across)
        for axis in (0, 1)
    )
    over = 0.125 * bend * float(step.max()) ** 2  # of a patch beyond its nodes
    low = min(float(value.min()) - over, 0.0)
    steep = float(np.hypot(along, across).max()) + 0.5 * bend * float(step.max())
    corners = np.array([(x, y) for x in (0.0, scene.length_mm) for y in (0.0, scene.width_mm)])
    numbers[OUTER] = np.hypot(*(corners - top.origin[:2]).T).max() + 1e-6
    numbers[DEPTH] -= low
    numbers[[GRID_X, GRID_Y]] = np.asarray(field.origin_mm) - top.origin[:2]
    numbers[[FIELD_X, FIELD_Y]] = step
    row[LOWS:CUPS] += low
    row[CUPS:FORMED_ROW] += 2.0 * bend
    row[PIECES + STEEP + PIECE_COLUMNS * np.arange(CELLS)] += steep
    return top._replace(numbers=numbers, row=row, grid=grid)


def _crown_numbers(top: Top) -> tuple[float, float, float]:
    if top.is_flat:
        return FLAT, 0.0, 0.0
    return SPHERE if top.straight is None else CYLINDER, top.radius_mm, 1.0 / top.mean_curvature


def _lowered(press: Indentation, mean_mm: float, clear_mm: float) -> tuple[FloatArray, tuple[float, ...]]:
    """(n,) radial table of a press's height; the press's outer, contact and skirt radius [mm]."""
    check_curve(press, clear_mm)
    numbers, table, _ = lower_curve(press, 0.0, mean_mm)
    row = np.zeros(FORMED_ROW)
    row[: len(numbers)] = numbers
    row[REACH:PIECES] = table.reach2
    row[PIECES:LOWS] = table.pieces.ravel()
    lowest = np.minimum(lowest_of_pieces_mm(table.pieces), 0.0)
    row[CUPS:] = outward_cup(table)
    row[LOWS:CUPS] = np.minimum.accumulate(lowest[::-1])[::-1]
    return row, (numbers[OUTER_R], numbers[CONTACT_R], numbers[SKIRT_R])
