"""Patterns of parts on the floor: where their parts stand and look, by hand-computed places."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from optopad.design.errors import DesignError
from optopad.design.shape.cavity import FLOOR_REACH, PlacedPart, cavity_of, direct_path_pairs
from optopad.design.spec import SensorDesign
from tests.design.spec.spec_fields import good_disc, with_layout

BENCHMARK = {"emitters.part": "generic-emitter", "receivers.part": "generic-receiver"}
"""Parts by definition: bodies 1.5 mm deep."""
GRID = {"pattern": "grid", "kind": "emitter", "columns": 2, "rows": 2, "pitch_mm": 8.0}


def floor(*patterns: dict[str, Any], **changes: Any) -> SensorDesign:
    """A pad of 32 x 32 mm with only these patterns."""
    return with_layout(*patterns, **BENCHMARK, **changes)


def places(parts: tuple[PlacedPart, ...]) -> dict[str, tuple[float, float]]:
    return {part.name: (round(part.position_mm[0], 6), round(part.position_mm[1], 6)) for part in parts}


def single(x_mm: float, y_mm: float, **more: Any) -> dict[str, Any]:
    base = {"pattern": "single", "kind": "emitter", "wall": "floor", "x_mm": x_mm, "y_mm": y_mm}
    return base | more


def test_a_grid_runs_row_by_row_about_the_middle_of_the_pad() -> None:
    found = cavity_of(floor(GRID | {"columns": 3, "pitch_mm": 5.0, "pitch_y_mm": 8.0}))
    assert places(found.emitters) == {
        "E1": (11.0, 12.0),
        "E2": (16.0, 12.0),
        "E3": (21.0, 12.0),
        "E4": (11.0, 20.0),
        "E5": (16.0, 20.0),
        "E6": (21.0, 20.0),
    }
    shifted = cavity_of(floor(GRID | {"shift_x_mm": 1.0, "shift_y_mm": -2.0}))
    assert places(shifted.emitters)["E1"] == (13.0, 10.0)


def test_parts_of_a_checkerboard_alternate_along_rows_and_columns() -> None:
    board = {"pattern": "checkerboard", "columns": 2, "rows": 3, "pitch_mm": 6.0}
    found = cavity_of(floor(board))
    assert places(found.emitters) == {"E1": (13.0, 10.0), "E2": (19.0, 16.0), "E3": (13.0, 22.0)}
    assert places(found.receivers) == {"R1": (19.0, 10.0), "R2": (13.0, 16.0), "R3": (19.0, 22.0)}
    other = cavity_of(floor(board | {"first": "receiver"}))
    assert [one.position_mm for one in other.receivers] == [one.position_mm for one in found.emitters]


@pytest.mark.parametrize(
    ("turn_deg", "emitter", "receiver"),
    [
        (0.0, (14.5, 16.0), (17.5, 16.0)),
        (90.0, (16.0, 14.5), (16.0, 17.5)),
        (-90.0, (16.0, 17.5), (16.0, 14.5)),
        (180.0, (17.5, 16.0), (14.5, 16.0)),
    ],
)
def test_a_coupler_points_from_its_emitter_to_its_receiver(
    turn_deg: float, emitter: tuple[float, float], receiver: tuple[float, float]
) -> None:
    grid = GRID | {"kind": "coupler", "columns": 1, "rows": 1, "apart_mm": 3.0, "turn_deg": turn_deg}
    found = cavity_of(floor(grid))
    assert places(found.parts) == {"E1": emitter, "R1": receiver}
    assert {part.turn_deg for part in found.parts} == {turn_deg % 360.0}
    towards = np.subtract(found.receivers[0].position_mm, found.emitters[0].position_mm)[:2]
    assert np.allclose(towards, -3.0 * np.array(found.emitters[0].line.outward))


def test_couplers_are_numbered_through_all_patterns_and_share_a_package() -> None:
    couplers = GRID | {"kind": "coupler", "columns": 2, "rows": 1, "pitch_mm": 8.0, "apart_mm": 3.0}
    found = cavity_of(
        floor(couplers | {"shift_y_mm": -5.0}, couplers | {"shift_y_mm": 5.0}, single(4.0, 4.0))
    )
    assert [part.coupler for part in found.emitters] == ["OC1", "OC2", "OC3", "OC4", None]
    assert [part.coupler for part in found.receivers] == ["OC1", "OC2", "OC3", "OC4"]
    assert [part.name for part in found.emitters] == ["E1", "E2", "E3", "E4", "E5"]


def test_a_part_stands_on_the_board_unless_its_height_is_given() -> None:
    design = floor(GRID, **{"cavity.black_thickness_mm": 1.0})
    for part in cavity_of(design).emitters:
        assert part.is_on_floor
        assert part.height_mm == part.body_top_mm == 0.5
        assert part.body_base_mm == -1.0
        assert part.axis == (0.0, 0.0, 1.0)
    raised = cavity_of(floor(GRID | {"height_mm": 2.0}, **{"cavity.black_thickness_mm": 1.0})).emitters[0]
    assert (raised.height_mm, raised.body_base_mm) == (2.0, 0.5)
    assert raised.height_field == "layout.0.height_mm"


@pytest.mark.parametrize("tilt_deg", [0.0, 30.0, 90.0])
def test_a_tilted_part_looks_in_the_direction_of_its_turn(tilt_deg: float) -> None:
    part = cavity_of(floor(single(10.0, 12.0, tilt_deg=tilt_deg, turn_deg=60.0))).emitters[0]
    tilt, turn = math.radians(tilt_deg), math.radians(60.0)
    towards = (math.cos(turn) * math.sin(tilt), math.sin(turn) * math.sin(tilt), math.cos(tilt))
    assert part.axis == pytest.approx(towards)
    assert part.turn_deg == pytest.approx(60.0)
    size = part.part
    low, deep = size.active_height_in_body_mm.value, size.body_depth_mm.value
    above = size.body_height_mm.value - low
    assert part.height_mm - part.body_base_mm == pytest.approx(low * math.sin(tilt) + deep * math.cos(tilt))
    assert part.body_top_mm - part.height_mm == pytest.approx(above * math.sin(tilt))


def test_a_ring_inside_a_rectangle_is_evenly_spaced_and_looks_as_requested() -> None:
    ring = {"pattern": "ring_inside", "emitters": 2, "receivers": 2, "inset_mm": 4.0}
    found = cavity_of(floor(ring))
    assert places(found.emitters) == {"E1": (16.0, 4.0), "E2": (16.0, 28.0)}
    assert places(found.receivers) == {"R1": (28.0, 16.0), "R2": (4.0, 16.0)}
    assert all(part.axis == (0.0, 0.0, 1.0) for part in found.parts)
    inward = cavity_of(floor(ring | {"looks": "in"}))
    assert [part.turn_deg for part in inward.emitters] == pytest.approx([90.0, 270.0])
    assert [part.turn_deg for part in inward.receivers] == pytest.approx([180.0, 0.0])
    outward = cavity_of(floor(ring | {"looks": "out"}))
    assert np.allclose([p.axis for p in outward.parts], -np.array([p.axis for p in inward.parts]))


def test_a_ring_inside_a_disc_keeps_its_distance_and_looks_at_the_middle() -> None:
    ring = {"pattern": "ring_inside", "emitters": 5, "receivers": 5, "inset_mm": 6.0, "looks": "in"}
    found = cavity_of(good_disc(layout=[ring], **BENCHMARK))
    for part in found.parts:
        x, y = part.position_mm[0] - 20.0, part.position_mm[1] - 20.0
        assert math.hypot(x, y) == pytest.approx(14.0)
        assert part.axis == pytest.approx((-x / 14.0, -y / 14.0, 0.0), abs=1e-9)
    angles = [math.atan2(part.position_mm[1] - 20.0, part.position_mm[0] - 20.0) for part in found.parts]
    assert np.allclose(np.diff(np.sort(angles)), 2.0 * math.pi / 10)


def test_a_ring_inside_a_stadium_keeps_its_distance_from_the_outline() -> None:
    ring = {"pattern": "ring_inside", "emitters": 7, "receivers": 6, "inset_mm": 5.0}
    design = floor(
        ring,
        **{"cavity.outline": "stadium", "cavity.length_mm": 50.0, "mold.outer_length_mm": 63.0},
    )
    found = cavity_of(design)
    assert len(found.parts) == 13
    gaps = [float(found.plan.outline.gap_mm(*part.position_mm[:2])) for part in found.parts]
    assert gaps == pytest.approx([5.0] * 13)


def test_parts_near_enough_for_light_by_way_of_the_top_make_a_pair() -> None:
    reach = FLOOR_REACH * 8.0
    wide = {"cavity.length_mm": 60.0, "mold.outer_length_mm": 73.0}
    for apart, has_path in ((reach, True), (reach + 0.1, False)):
        pair = (single(10.0, 16.0), single(10.0 + apart, 16.0, kind="receiver"))
        assert direct_path_pairs(cavity_of(floor(*pair, **wide))).tolist() == [[has_path]]


@pytest.mark.parametrize(
    ("pattern", "said"),
    [
        (single(4.0, 4.0, along_mm=3.0), "along_mm does not belong to wall = 'floor'"),
        ({"pattern": "single", "kind": "emitter", "wall": "floor", "x_mm": 3.0}, "y_mm is missing"),
        ({"pattern": "single", "kind": "emitter", "wall": "north"}, "along_mm is missing"),
        (single(4.0, 4.0, wall="north", along_mm=3.0), "x_mm does not belong to wall = 'north'"),
        (
            {"pattern": "single", "kind": "emitter", "wall": "east", "along_mm": 3.0, "turn_deg": 5.0},
            "turn_deg does not belong to wall = 'east'",
        ),
        (GRID | {"kind": "coupler"}, "apart_mm is missing"),
        (GRID | {"apart_mm": 3.0}, "apart_mm belongs to couplers"),
        (GRID | {"kind": "coupler", "apart_mm": 3.0, "part": "generic-emitter"}, "a coupler has two entries"),
    ],
)
def test_a_pattern_that_contradicts_itself_is_refused(pattern: dict[str, Any], said: str) -> None:
    with pytest.raises(DesignError, match=said):
        floor(pattern)
