"""Lower a design to the arrays of an optical scene: blocks by themselves, other pads with their form."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from design.arrays import FloatArray, IntArray
from design.shape.cavity import PlacedPart, cavity_of
from design.shape.outline import Arc, Outline
from design.shape.plan import Plan
from design.spec import SensorDesign
from design.spec.properties import absorption_coefficient_per_mm, emitter_order, refractive_index, wall_index
from sims.optics.scene.acceptance import response_nodes
from sims.optics.scene.emission import COSINE_NODES, table_pattern
from sims.optics.scene.optical_scene import OpticalScene
from sims.optics.scene.pad_form import WHOLE_CIRCLE, PadForm

TURN_RAD = 2.0 * math.pi
BORDER_STEP_RAD = TURN_RAD / 96
ROUNDING = 1e-9
"""Of places [mm] and cosines [-]: a ray that meets two walls' common edge meets at least one of them."""


def scene_of(design: SensorDesign) -> OpticalScene:
    """The clear block with the active areas of all parts, in the order of the cavity's parts.

    An emitter with an angular pattern has it in place of its order; a receiver counts what falls on its active area,
    whatever its angle, unless its part says what lies on the chip.
    """
    cavity = cavity_of(design)
    plan = cavity.plan
    surfaces = design.surfaces
    index = refractive_index(design).value
    behind = wall_index(design)
    return OpticalScene(
        length_mm=cavity.length_mm,
        width_mm=cavity.width_mm,
        height_mm=cavity.clear_mm,
        refractive_index=index,
        absorption_per_mm=absorption_coefficient_per_mm(design),
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
        form=None if plan.is_block else form_of(plan),
    )


def form_of(plan: Plan) -> PadForm:
    """Walls and top of a pad that is no block."""
    return PadForm(
        walls=np.array([(*wall.origin, *wall.tangent, *wall.outward) for wall in plan.walls]).reshape(-1, 6),
        arcs=_round_walls(plan.outline),
        top=plan.top,
    )


def _round_walls(outline: Outline) -> FloatArray:
    """(m, 6) round walls: arcs of one circle are one, with the facets between them; whole if the pad lies within it."""
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
    """Middle, as a unit vector, and cosine of half the turn of the least sector that holds arcs of one circle."""
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
    return np.array([names.index(part.wall) for part in parts], dtype=np.int64)


def _patches(parts: tuple[PlacedPart, ...]) -> FloatArray:
    rows = [(p.along_mm, p.height_mm, p.half_width_mm, p.half_height_mm) for p in parts]
    return np.array(rows, dtype=np.float64).reshape(-1, 4)


def _patterns(parts: tuple[PlacedPart, ...]) -> FloatArray | None:
    """(e, n) patterns, a row of NaN for an emitter that goes by its order; None where all do."""
    tables = [part.part.angular_pattern for part in parts]
    if not any(tables):
        return None
    by_order = np.full(COSINE_NODES, np.nan)
    return np.array([by_order if table is None else table_pattern(table) for table in tables])


def _responses(parts: tuple[PlacedPart, ...], index: float) -> FloatArray | None:
    """(r, n) responses; None where all receivers are bare."""
    if all(part.part.epoxy_index is None for part in parts):
        return None
    return np.array([response_nodes(part.part, index) for part in parts])
