"""Convert a design to the arrays of an optical scene, and check scenes and masks of requested pairs.

A pad that is not a rectangular block with a flat top gets a `PadForm`: its walls and top.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from optopad.design.arrays import BoolArray, FloatArray, IntArray
from optopad.design.draft import Draft
from optopad.design.errors import InputError
from optopad.design.fields.quantity import absorption_per_mm
from optopad.design.once import once
from optopad.design.shape.cavity import PlacedPart, Plan
from optopad.design.shape.outline import Arc, Outline
from optopad.design.shape.top import Top
from optopad.design.spec import SensorDesign
from optopad.design.spec.properties import emitter_order
from optopad.sims.optics.scene.optical_scene import (
    COSINE_NODES,
    POSE_COLUMNS,
    WHOLE_CIRCLE,
    OpticalScene,
    PadForm,
    pattern_power,
    response_nodes,
    table_pattern,
)

WALLS, POSED = 4, -1
"""Number of a block's walls, and wall number of a face with a pose."""
POWER_TOLERANCE = 1e-6
"""Largest deviation of a pattern's power from 1 [-]: far below the light model's bias of 0.01 %. A larger deviation
means that the pattern was not normalised."""


def check_scene(scene: OpticalScene) -> None:
    """Check the numbers of a scene.

    Raises
    ------
    InputError : a field of the scene is out of range or has the wrong shape; the message names the first such field.
    """
    for name in ("length_mm", "width_mm", "height_mm"):
        _require(name, getattr(scene, name), 0.0, np.inf, open_low=True)
    _require("refractive_index", scene.refractive_index, 1.0, 4.0)
    _require("absorption_per_mm", scene.absorption_per_mm, 0.0, np.inf)
    for name in ("wall_reflectance", "bottom_reflectance", "tip_reflectance"):
        _require(name, getattr(scene, name), 0.0, 0.99)
    _check_patches("emitter", scene.emitter_wall, scene.emitter_patch, scene)
    _check_patches("receiver", scene.receiver_wall, scene.receiver_patch, scene)
    if np.shape(scene.emitter_order) != np.shape(scene.emitter_wall):
        raise InputError(f"emitter_order: shape {np.shape(scene.emitter_order)}, needs one per emitter")
    for k, order in enumerate(scene.emitter_order):
        _require(f"emitter_order[{k}]", order, 0.0, 1000.0)
    if scene.emitter_pattern is not None:
        _check_pattern(scene.emitter_pattern, len(scene.emitter_wall))
    if scene.receiver_response is not None:
        _check_response(scene.receiver_response, len(scene.receiver_wall))
    if scene.wall_index is not None:
        _require("wall_index", scene.wall_index, 1.0, 4.0)
    if scene.top_finish not in ("bare", "specular", "diffuse"):
        raise InputError(f"top_finish: '{scene.top_finish}', must be bare, specular or diffuse")
    _require("top_reflectance", scene.top_reflectance, 0.0, 0.99)


def wanted_pairs(pairs: BoolArray | None, states: int, emitters: int, receivers: int) -> BoolArray:
    """(state, emitter, receiver) mask of pairs to trace. A mask without states holds for all; None is for all pairs.

    Raises
    ------
    InputError : the mask is not boolean, or its shape does not fit.
    """
    if pairs is None:
        return np.ones((states, emitters, receivers), dtype=np.bool_)
    mask = np.asarray(pairs)
    if mask.dtype != np.bool_ or mask.shape not in ((emitters, receivers), (states, emitters, receivers)):
        raise InputError(
            f"pairs: {mask.dtype} of shape {mask.shape}; give booleans of shape "
            f"({emitters}, {receivers}) or ({states}, {emitters}, {receivers})"
        )
    return np.array(np.broadcast_to(mask, (states, emitters, receivers)), order="C")


def _require(name: str, value: float, low: float, high: float, *, open_low: bool = False) -> None:
    inside = low < value <= high if open_low else low <= value <= high
    if not (inside and np.isfinite(value)):
        raise InputError(
            f"{name}: {value:g}, must lie in {low:g} to {high:g}{' (not 0)' if open_low else ''}"
        )


def _check_patches(kind: str, walls: IntArray, patches: FloatArray, scene: OpticalScene) -> None:
    if np.ndim(walls) != 1 or len(walls) == 0 or np.shape(patches) != (len(walls), 4):
        raise InputError(
            f"{kind}_patch: shape {np.shape(patches)}, needs ({np.size(walls)}, 4) and one or more"
        )
    for k, (wall, patch) in enumerate(zip(walls, patches, strict=True)):
        name = f"{kind}_patch[{k}]"
        if scene.form is None and wall not in range(WALLS):
            raise InputError(f"{kind}_wall[{k}]: {wall}, must be 0 to 3 (south, east, north, west)")
        if wall == POSED and scene.form is not None:
            _check_pose(kind, k, scene)
        elif scene.form is not None and wall not in range(len(scene.form.walls)):
            raise InputError(
                f"{kind}_wall[{k}]: {wall}, must be a row of form.walls, 0 to {len(scene.form.walls) - 1}"
            )
        if not np.isfinite(patch).all():
            raise InputError(f"{name}: {patch} is not finite")
        along, z, half_width, half_height = patch
        if half_width <= 0 or half_height <= 0:
            raise InputError(f"{name}: half sizes {half_width:g}, {half_height:g} mm must be above 0")
        length = scene.length_mm if wall % 2 == 0 else scene.width_mm
        if scene.form is None and (along - half_width < -1e-9 or along + half_width > length + 1e-9):
            raise InputError(
                f"{name}: {along - half_width:g} to {along + half_width:g} mm along a wall of {length:g} mm; "
                "move it inward or widen the cavity"
            )
        if wall != POSED and (z + half_height <= 0 or z - half_height >= scene.height_mm):
            raise InputError(
                f"{name}: {z - half_height:g} to {z + half_height:g} mm high, nothing of it in the clear layer of "
                f"{scene.height_mm:g} mm; change its height"
            )


def _check_pose(kind: str, number: int, scene: OpticalScene) -> None:
    poses = getattr(scene, f"{kind}_pose")
    if poses is None or np.shape(poses) != (len(getattr(scene, f"{kind}_wall")), len(POSE_COLUMNS)):
        raise InputError(f"{kind}_pose: shape {np.shape(poses)}, needs a row of {POSE_COLUMNS} per {kind}")
    pose = poses[number]
    if not np.isfinite(pose).all() or not 0.0 <= pose[2] < scene.height_mm:
        if -np.inf < pose[2] < 0.0:
            raise InputError(
                f"{kind} {number + 1}: the black layer covers its face by {-pose[2]:.2g} mm; pour less"
            )
        raise InputError(
            f"{kind}_pose[{number}]: {pose}; must be finite, with z from 0 to {scene.height_mm:g} mm"
        )


def _check_table(name: str, table: FloatArray, rows: int) -> None:
    if np.ndim(table) != 2 or len(table) != rows or np.shape(table)[1] < 2:
        raise InputError(
            f"{name}: shape {np.shape(table)}, needs ({rows}, 2 or more): a row each, at cosines linspace(0, 1, n)"
        )


def _check_pattern(pattern: FloatArray, emitters: int) -> None:
    _check_table("emitter_pattern", pattern, emitters)
    for k, row in enumerate(np.asarray(pattern, dtype=np.float64)):
        if np.isnan(row).all():
            continue  # by its order
        if not (np.isfinite(row).all() and (row >= 0).all()):
            node = int(np.argwhere(~(np.isfinite(row) & (row >= 0)))[0, 0])
            raise InputError(
                f"emitter_pattern[{k}, {node}]: {row[node]:g}, must be 0 or more; "
                "only a whole row may be NaN, which means emitter_order"
            )
        power = float(pattern_power(row))
        if abs(power - 1.0) > POWER_TOLERANCE:
            raise InputError(
                f"emitter_pattern[{k}]: its power 2 pi int c L dc is {power:.7g}, must be 1 within "
                f"{POWER_TOLERANCE:g}; divide the row by it "
                "(optopad.sims.optics.scene.optical_scene.normalised_pattern)"
            )


def _check_response(response: FloatArray, receivers: int) -> None:
    _check_table("receiver_response", response, receivers)
    bad = np.argwhere(~((np.asarray(response) >= 0) & (np.asarray(response) <= 1)))
    if len(bad):
        k, node = bad[0]
        raise InputError(
            f"receiver_response[{k}, {node}]: {response[k, node]:g}, a share of the arriving light must lie in 0 to 1"
        )


TURN_RAD = 2.0 * math.pi
BORDER_STEP_RAD = TURN_RAD / 96
ROUNDING = 1e-9
"""Tolerance of points [mm] and of cosines [-]; due to it a ray to the edge between two walls meets at least one of
them."""


@once
def scene_of(design: SensorDesign) -> OpticalScene:
    """Optical scene of a design: the clear layer and all active areas, in the order of the parts in the cavity.

    An emitter's angular pattern, if it has one, replaces its Lambertian order. A receiver counts all light on its
    active area, at any angle, unless its part gives the index of the epoxy on the chip.
    """
    draft = Draft.of(design)
    cavity, behind = draft.cavity, draft.wall_index
    plan, surfaces, skin = cavity.plan, design.surfaces, draft.skin
    index = draft.refractive_index.value
    return OpticalScene(
        length_mm=cavity.length_mm,
        width_mm=cavity.width_mm,
        height_mm=cavity.clear_mm,
        refractive_index=index,
        absorption_per_mm=absorption_per_mm(draft.absorption_db_per_cm.value),
        wall_reflectance=surfaces.wall_reflectance,
        bottom_reflectance=surfaces.bottom_reflectance,
        tip_reflectance=surfaces.tip_reflectance,
        emitter_wall=_walls(cavity.emitters, plan),
        emitter_patch=_patches(cavity.emitters),
        emitter_order=np.array([emitter_order(part.part) for part in cavity.emitters]),
        receiver_wall=_walls(cavity.receivers, plan),
        receiver_patch=_patches(cavity.receivers),
        emitter_pattern=_patterns(cavity.emitters),
        receiver_response=_responses(cavity.receivers, index),
        wall_index=None if behind is None else behind.value,
        form=None if draft.is_plain_block else form_of(plan),
        emitter_pose=_poses(cavity.emitters),
        receiver_pose=_poses(cavity.receivers),
        top_finish="bare" if skin is None else skin.finish,
        top_reflectance=0.0 if skin is None else skin.reflectance.value,
    )


def form_of(plan: Plan) -> PadForm:
    """Walls and top of a pad that is not a rectangular block with a flat top."""
    return PadForm(
        walls=np.array([(*wall.origin, *wall.tangent, *wall.outward) for wall in plan.walls]).reshape(-1, 6),
        arcs=_round_walls(plan.outline),
        top=plan.top,
    )


def block_form(scene: OpticalScene) -> PadForm:
    """Walls and flat top of a scene that is a rectangular block."""
    x, y = scene.length_mm, scene.width_mm
    walls = [[0, 0, 1, 0, 0, -1], [x, 0, 0, 1, 1, 0], [0, y, 1, 0, 0, 1], [0, 0, 0, 1, -1, 0]]
    top = Top(clear_mm=scene.height_mm, apex_mm=(0.5 * x, 0.5 * y))
    return PadForm(walls=np.array(walls, dtype=np.float64), arcs=np.zeros((0, 6)), top=top)


def _round_walls(outline: Outline) -> FloatArray:
    """(m, 6) round walls. Arcs of one circle become one, including facets between them; a round pad has one circle."""
    circles: dict[tuple[float, float, float], list[Arc]] = {}
    for arc in outline.arcs:
        circles.setdefault((*arc.centre_mm, arc.radius_mm), []).append(arc)
    border = outline.points(BORDER_STEP_RAD)
    rows = []
    for (x, y, radius), arcs in circles.items():
        is_whole = np.hypot(*(border - (x, y)).T).max() <= radius + ROUNDING
        rows.append((x, y, radius, *(WHOLE_CIRCLE if is_whole else _sector_of(arcs))))
    return np.array(rows, dtype=np.float64).reshape(-1, 6)


def _sector_of(arcs: Sequence[Arc]) -> tuple[float, float, float]:
    """Smallest sector that contains arcs of one circle: unit vector to its middle, and cosine of half its angle."""
    arcs = sorted(arcs, key=lambda arc: arc.start_rad % TURN_RAD)
    gaps = [
        (after.start_rad - arc.start_rad - arc.turn_rad) % TURN_RAD
        for arc, after in zip(arcs, (*arcs[1:], arcs[0]), strict=True)
    ]
    last = int(np.argmax(gaps))
    end, half = arcs[last].start_rad + arcs[last].turn_rad, (TURN_RAD - gaps[last]) / 2
    return math.cos(end - half), math.sin(end - half), math.cos(half) - ROUNDING


def _walls(parts: tuple[PlacedPart, ...], plan: Plan) -> IntArray:
    names = [wall.name for wall in plan.walls]
    numbers = [POSED if part.is_on_floor else names.index(part.wall) for part in parts]
    return np.array(numbers, dtype=np.int64)


def _poses(parts: tuple[PlacedPart, ...]) -> FloatArray | None:
    """(n, 5) poses of the faces of parts on the floor, NaN for parts in walls; None if all are in walls."""
    if not any(part.is_on_floor for part in parts):
        return None
    rows = [
        (*part.position_mm, math.radians(part.tilt_deg), math.radians(part.turn_deg))
        if part.is_on_floor
        else (math.nan,) * 5
        for part in parts
    ]
    return np.array(rows, dtype=np.float64)


def _patches(parts: tuple[PlacedPart, ...]) -> FloatArray:
    rows = [(p.along_mm, p.height_mm, p.half_width_mm, p.half_height_mm) for p in parts]
    return np.array(rows, dtype=np.float64).reshape(-1, 4)


def _patterns(parts: tuple[PlacedPart, ...]) -> FloatArray | None:
    """(e, n) angular patterns; a row is NaN if the emitter has an order instead; None if all have an order."""
    tables = [part.part.angular_pattern for part in parts]
    if not any(tables):
        return None
    by_order = np.full(COSINE_NODES, np.nan)
    return np.array([by_order if table is None else table_pattern(table) for table in tables])


def _responses(parts: tuple[PlacedPart, ...], index: float) -> FloatArray | None:
    """(r, n) angular responses; None if every receiver is bare, without epoxy."""
    if all(part.part.epoxy_index is None for part in parts):
        return None
    return np.array([response_nodes(part.part, index) for part in parts])
