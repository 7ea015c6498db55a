"""Patterns: where their parts land, by hand-computed places."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import TypeAdapter

from optopad.design.errors import DesignError
from optopad.design.shape.cavity import (
    cavity_of,
    chord_midpoint_mm,
    direct_path_pairs,
    facing_pairs,
    is_facing_rows,
    judged_pairs,
    mask_of,
    workspace_of,
)
from optopad.design.spec import Indenter
from optopad.design.spec.indenter import Piece, tip_outline, tip_words
from optopad.design.spec.layout import OPPOSITE, Pattern, Placement, expand
from optopad.design.spec.pad import WALLS, Cavity
from tests.cad.volumes import tip_volume_mm3
from tests.design.spec.spec_fields import good, with_layout
from tests.said import says

PATTERN: TypeAdapter[Any] = TypeAdapter(Pattern)


def cavity(length_mm: float, width_mm: float) -> Cavity:
    return Cavity(length_mm=length_mm, width_mm=width_mm, clear_thickness_mm=8.0)


def places(
    *patterns: dict[str, Any], length_mm: float = 40.0, width_mm: float = 20.0
) -> tuple[Placement, ...]:
    return expand(tuple(PATTERN.validate_python(p) for p in patterns), cavity(length_mm, width_mm))


def ring(parts_per_side: Any = 4, **more: Any) -> dict[str, Any]:
    if isinstance(parts_per_side, list):
        parts_per_side = tuple(parts_per_side)
    return {"pattern": "alternating_ring", "parts_per_side": parts_per_side, **more}


def facing(count: int = 3, **more: Any) -> dict[str, Any]:
    return {"pattern": "facing_rows", "count": count, **more}


def single(kind: str, wall: str, along_mm: float, **more: Any) -> dict[str, Any]:
    return {"pattern": "single", "kind": kind, "wall": wall, "along_mm": along_mm, **more}


def test_a_ring_of_two_a_side_sits_at_the_quarters_and_walks_counter_clockwise() -> None:
    found = [(p.wall, p.along_mm, p.name) for p in places(ring(2))]
    assert found == [
        ("south", 10.0, "E1"),
        ("south", 30.0, "R1"),
        ("east", 5.0, "E2"),
        ("east", 15.0, "R2"),
        ("north", 30.0, "E3"),
        ("north", 10.0, "R3"),
        ("west", 15.0, "E4"),
        ("west", 5.0, "R4"),
    ]


@given(
    st.lists(st.integers(0, 32), min_size=4, max_size=4).filter(lambda n: sum(n) % 2 == 0 and sum(n) > 0),
    st.sampled_from(["emitter", "receiver"]),
)
def test_every_ring_alternates_all_the_way_round(counts: list[int], first: str) -> None:
    kinds = [p.kind for p in places(ring(counts, first=first))]
    assert len(kinds) == sum(counts)
    assert kinds[0] == first
    assert all(a != b for a, b in zip(kinds, [*kinds[1:], kinds[0]], strict=True))


def test_a_ring_keeps_its_pitch_about_the_middle_of_each_wall() -> None:
    south = [p.along_mm for p in places(ring(2, pitch_mm=6.0)) if p.wall == "south"]
    assert south == [17.0, 23.0]


@given(st.integers(1, 32), st.sampled_from(WALLS), st.one_of(st.none(), st.floats(0.5, 100.0)))
def test_facing_rows_face(count: int, wall: Any, pitch_mm: float | None) -> None:
    found = places(facing(count, emitter_wall=wall, pitch_mm=pitch_mm))
    emitters, receivers = found[:count], found[count:]
    assert {p.wall for p in emitters} == {wall}
    assert {p.wall for p in receivers} == {OPPOSITE[wall]}
    assert [p.along_mm for p in emitters] == [p.along_mm for p in receivers]
    middle = cavity(40.0, 20.0).wall_length_mm(wall) / 2
    assert sum(p.along_mm for p in emitters) / count == pytest.approx(middle, rel=1e-12)


def test_a_row_without_pitch_spreads_over_its_wall() -> None:
    assert [p.along_mm for p in places(facing(4))][:4] == [2.5, 7.5, 12.5, 17.5]


def test_per_side_places_its_counts_and_shifts_each_row() -> None:
    found = places(
        {"pattern": "per_side", "kind": "receiver", "south": 1, "north": 2, "pitch_mm": 8.0, "shift_mm": 1.5}
    )
    assert [(p.wall, p.along_mm, p.name) for p in found] == [
        ("south", 21.5, "R1"),
        ("north", 17.5, "R2"),
        ("north", 25.5, "R3"),
    ]


def test_a_single_part_keeps_its_own_name_height_and_part() -> None:
    place = places(single("emitter", "east", 3.0, name="Lamp", height_mm=2.0, part="generic-emitter"))[0]
    assert (place.name, place.height_mm, place.part, place.along_mm) == ("Lamp", 2.0, "generic-emitter", 3.0)


def test_patterns_are_numbered_through_and_remember_their_origin() -> None:
    found = places(facing(1), single("emitter", "south", 3.0), single("receiver", "south", 9.0))
    assert [(p.name, p.origin) for p in found] == [
        ("E1", "layout.0"),
        ("R1", "layout.0"),
        ("E2", "layout.1"),
        ("R2", "layout.2"),
    ]


@pytest.mark.parametrize(
    ("wall", "position"),
    [
        ("south", (7.0, 0.0, 5.0)),
        ("east", (32.0, 7.0, 5.0)),
        ("north", (7.0, 32.0, 5.0)),
        ("west", (0.0, 7.0, 5.0)),
    ],
)
def test_a_parts_active_face_is_flush_with_its_wall(wall: str, position: tuple[float, float, float]) -> None:
    part = cavity_of(with_layout(single("emitter", wall, 7.0))).emitters[0]
    assert part.position_mm == position


def test_a_body_stands_where_its_active_area_puts_it() -> None:
    receiver = cavity_of(good()).receivers[0]
    in_body = receiver.part.active_height_in_body_mm.value
    assert receiver.body_base_mm == pytest.approx(6.0 - in_body)
    assert receiver.body_top_mm - receiver.body_base_mm == pytest.approx(receiver.part.body_height_mm.value)


def test_the_lost_share_is_the_share_of_the_height_above_the_surface() -> None:
    emitter = cavity_of(good(**{"emitters.height_mm": 7.5})).emitters[0]  # 2 mm high: 6.5 to 8.5 of 8 mm
    assert emitter.lost_share == pytest.approx(0.25)
    assert cavity_of(good()).emitters[0].lost_share == 0.0


def test_an_unknown_part_is_refused_where_it_is_named() -> None:
    with pytest.raises(DesignError, match=r"layout\.0\.part.*'no-led'"):
        cavity_of(with_layout(single("emitter", "south", 7.0, part="no-led")))
    with pytest.raises(DesignError, match=r"emitters\.part.*'no-led'"):
        cavity_of(good(**{"emitters.part": "no-led"}))


def test_the_published_workspace_is_20_mm_square() -> None:
    space = workspace_of(good())
    assert (space.x0_mm, space.x1_mm, space.y0_mm, space.y1_mm) == (6.0, 26.0, 6.0, 26.0)
    assert space.clamped(0.0, 30.0) == (6.0, 26.0)
    assert space.contains(6.0, 26.0)
    assert not space.contains(5.9, 10.0)


def test_pairs_in_one_wall_have_no_direct_path() -> None:
    cavity = cavity_of(good())
    direct = direct_path_pairs(cavity)
    assert direct.shape == (8, 8)
    assert direct.sum() == 48  # each emitter sees all but the two receivers of its own wall
    judged = judged_pairs(cavity)
    assert len(judged) == 36
    assert not (mask_of(judged, cavity) & ~direct).any()
    assert not is_facing_rows(cavity)


def test_pairs_across_a_corner_that_no_press_comes_between_are_not_judged() -> None:
    cavity = cavity_of(good())
    left_out = set(map(tuple, np.argwhere(direct_path_pairs(cavity)))) - set(judged_pairs(cavity))
    names = {f"{cavity.emitters[e].name}-{cavity.receivers[r].name}" for e, r in left_out}
    # from (4, 0) to (0, 4): the press nearest to its middle is at (6, 6), 8 / sqrt 2 = 5.66 mm beside the chord
    assert {"E1-R8", "E3-R2", "E5-R4", "E7-R6"} < names
    assert len(names) == 12
    wide = cavity_of(good(**{"indenter.tip_radius_mm": 5.7, "operating.workspace_margin_mm": 0.3}))
    assert len(judged_pairs(wide)) == 48


def test_a_pair_that_no_press_comes_between_is_judged_where_there_is_no_other() -> None:
    cavity = cavity_of(with_layout(single("emitter", "west", 4.0), single("receiver", "south", 4.0)))
    assert judged_pairs(cavity) == ((0, 0),)


@pytest.mark.parametrize(("count", "order"), [(1, [0]), (2, [0, 1]), (3, [1, 0, 2]), (5, [2, 1, 3, 0, 4])])
def test_facing_rows_are_judged_by_their_facing_pairs_the_middle_one_first(
    count: int, order: list[int]
) -> None:
    cavity = cavity_of(with_layout(facing(count, pitch_mm=4.0)))
    assert is_facing_rows(cavity)
    assert facing_pairs(cavity) == judged_pairs(cavity) == tuple((k, k) for k in order)


def test_rows_that_face_nowhere_are_judged_by_all_their_pairs() -> None:
    cavity = cavity_of(with_layout(single("emitter", "west", 8.0), single("receiver", "east", 20.0)))
    assert facing_pairs(cavity) == ()
    assert judged_pairs(cavity) == ((0, 0),)


def test_a_pair_is_pressed_at_the_middle_of_its_chord_inside_the_workspace() -> None:
    middle = cavity_of(with_layout(facing(1)))
    assert chord_midpoint_mm(middle, (0, 0)) == (16.0, 16.0)
    corner = cavity_of(with_layout(single("emitter", "west", 4.0), single("receiver", "south", 5.0)))
    assert chord_midpoint_mm(corner, (0, 0)) == (6.0, 6.0)  # the chord's middle is (2.5, 2)


def test_a_ring_spreads_any_numbers_around_any_outline() -> None:
    # 40 x 20 mm: 12 parts share 120 mm of border as 4, 2, 4, 2; two receivers to an emitter
    found = places({"pattern": "ring", "emitters": 4, "receivers": 8, "sequence": "ERR"})
    assert [one.name for one in found[:4]] == ["E1", "R1", "R2", "E2"]
    assert [(one.wall, one.along_mm) for one in found[:7]] == [
        ("south", 5.0), ("south", 15.0), ("south", 25.0), ("south", 35.0), ("east", 5.0), ("east", 15.0),
        ("north", 35.0),
    ]  # fmt: skip
    disc = Cavity.model_validate({"outline": "disc", "diameter_mm": 150.0, "clear_thickness_mm": 8.0})
    light = expand((PATTERN.validate_python({"pattern": "ring", "emitters": 12, "receivers": 12}),), disc)
    assert [one.angle_deg for one in light] == [15.0 * k for k in range(24)]
    assert [one.kind for one in light[:4]] == ["emitter", "receiver"] * 2
    stadium = Cavity(outline="stadium", length_mm=60.0, width_mm=26.0, clear_thickness_mm=8.0)
    many = expand((PATTERN.validate_python({"pattern": "ring", "emitters": 30, "receivers": 32}),), stadium)
    by_wall = [sum(one.wall == wall for one in many) for wall in ("south", "north")]
    assert by_wall == [14, 14]  # 34 of 149.7 mm each, and 17 to either end
    assert sum(one.kind == "emitter" for one in many) == 30
    right = [one.angle_deg or 0.0 for one in many[14:31]]
    assert np.allclose(
        [(angle + 180.0) % 360.0 - 180.0 for angle in right], -90.0 + 180.0 * (np.arange(17) + 0.5) / 17
    )


def test_a_sequence_that_does_not_make_the_numbers_is_refused() -> None:
    with pytest.raises(DesignError, match="sequence = 'ERR' has 1 emitters and 2 receivers; repeated"):
        with_layout({"pattern": "ring", "emitters": 8, "receivers": 8, "sequence": "ERR"})


def test_two_rows_at_the_same_positions_take_turns() -> None:
    emitters = {"pattern": "per_side", "kind": "emitter", "south": 2, "north": 1}
    found = places(emitters, {"pattern": "per_side", "kind": "receiver", "south": 2})
    south = sorted((one.along_mm, one.name) for one in found if one.wall == "south")
    assert south == [(5.0, "E1"), (15.0, "R1"), (25.0, "E2"), (35.0, "R2")]
    assert [one.along_mm for one in found if one.wall == "north"] == [20.0]
    apart = places(emitters, {"pattern": "per_side", "kind": "receiver", "south": 3})
    assert [one.along_mm for one in apart if one.name in ("E1", "E2")] == [10.0, 30.0]
    shifted = places(
        {"pattern": "per_side", "kind": "emitter", "south": 1, "shift_mm": 5.0},
        {"pattern": "per_side", "kind": "receiver", "south": 1},
    )
    assert [one.along_mm for one in shifted] == [25.0, 20.0]


def tip(**fields: Any) -> Indenter:
    return Indenter(**fields)


def angles(piece: Piece) -> tuple[float, float]:
    """Angle of the tangent to the radial direction at both ends [rad]."""
    if piece.radius == 0.0:
        (r0, h0), (r1, h1) = piece.start, piece.end
        angle = math.atan2(h1 - h0, r1 - r0)
        return angle, angle
    first, last = (math.atan2(r - piece.centre[0], piece.centre[1] - h) for r, h in (piece.start, piece.end))
    return first, last


def test_a_hemisphere_is_a_quarter_circle_of_two_thirds_pi_r_cubed() -> None:
    (piece,) = tip_outline(tip(tip_radius_mm=3.0))
    assert (piece.start, piece.end) == ((0.0, 0.0), (3.0, 3.0))
    assert (piece.centre, piece.radius) == ((0.0, 3.0), 3.0)
    assert tip_volume_mm3(tip(tip_radius_mm=3.0)) == pytest.approx(2 / 3 * math.pi * 27.0, rel=1e-14)


@given(
    radius=st.floats(0.5, 20.0),
    edge=st.floats(0.1, 1.0),
    apex=st.floats(0.1, 1.0),
    half_angle=st.floats(20.0, 85.0),
    shape=st.sampled_from(["cone", "flat_punch"]),
)
def test_pieces_follow_each_other_without_a_gap_or_a_kink_and_end_on_the_shank(
    radius: float, edge: float, apex: float, half_angle: float, shape: str
) -> None:
    fields: dict[str, Any] = {"edge_radius_mm": edge * radius}
    if shape == "cone":
        fields |= {"apex_radius_mm": apex * radius, "cone_half_angle_deg": half_angle}
    pieces = tip_outline(tip(tip_radius_mm=radius, shape=shape, **fields))
    assert pieces[0].start == (0.0, 0.0)
    assert angles(pieces[0])[0] == 0.0
    assert pieces[-1].end[0] == pytest.approx(radius, rel=1e-12)
    assert angles(pieces[-1])[1] == pytest.approx(math.pi / 2, abs=1e-7)
    for one, next_ in pairwise(pieces):
        assert one.end == pytest.approx(next_.start, abs=1e-9 * radius)
        lengths = [math.hypot(p.end[0] - p.start[0], p.end[1] - p.start[1]) for p in (one, next_)]
        if min(lengths) > 1e-6 * radius:  # a shorter piece has no direction to speak of
            assert angles(one)[1] == pytest.approx(angles(next_)[0], abs=1e-6)


def test_a_punch_with_an_edge_of_its_own_radius_and_such_a_cone_are_hemispheres() -> None:
    punch = tip(tip_radius_mm=2.0, shape="flat_punch", edge_radius_mm=2.0)
    cone = tip(tip_radius_mm=2.0, shape="cone", apex_radius_mm=2.0, edge_radius_mm=2.0)
    for shape in (punch, cone):
        assert tip_volume_mm3(shape) == pytest.approx(2 / 3 * math.pi * 8.0, rel=1e-12)
        assert tip_outline(shape)[-1].end[1] == pytest.approx(2.0, rel=1e-12)


def test_volumes_are_those_of_slices() -> None:
    for shape in (
        tip(shape="flat_punch", edge_radius_mm=0.7),
        tip(shape="cone", cone_half_angle_deg=50.0, apex_radius_mm=0.4, edge_radius_mm=0.9),
        tip(shape="profile", profile_mm=((0.0, 0.0), (1.0, 0.1), (2.0, 1.5), (3.0, 1.6))),
    ):
        total = 0.0
        for piece in tip_outline(shape):
            first, last = angles(piece)
            share = np.linspace(0.0, 1.0, 20001)
            if piece.radius:
                angle = first + (last - first) * share
                r = piece.centre[0] + piece.radius * np.sin(angle)
                h = piece.centre[1] - piece.radius * np.cos(angle)
            else:
                r = piece.start[0] + (piece.end[0] - piece.start[0]) * share
                h = piece.start[1] + (piece.end[1] - piece.start[1]) * share
            total += float(np.sum(np.pi * 0.25 * (r[1:] + r[:-1]) ** 2 * np.diff(h)))
        # midpoint rule with 20000 slices a piece: error of the order of 1/20000²
        assert tip_volume_mm3(shape) == pytest.approx(total, rel=1e-7)


def test_a_sharp_cone_has_a_third_of_its_cylinder() -> None:
    cone = tip(shape="profile", profile_mm=((0.0, 0.0), (3.0, 2.0)))
    assert tip_volume_mm3(cone) == pytest.approx(math.pi * 9.0 * 2.0 / 3.0, rel=1e-14)


def test_roundings_that_are_not_given_are_a_tenth_of_the_tip() -> None:
    bare, full = (
        tip_outline(tip(tip_radius_mm=4.0, shape="cone", **fields))
        for fields in ({}, {"apex_radius_mm": 0.4, "edge_radius_mm": 0.4, "cone_half_angle_deg": 60.0})
    )
    assert bare == full


def test_a_hemisphere_is_its_radius_alone_and_keeps_its_digest() -> None:
    assert good().indenter.model_dump() == {"tip_radius_mm": 3.0}
    assert good(**{"indenter.shape": "hemisphere"}).digest == good().digest
    assert good(**{"indenter.shape": "cone"}).digest != good().digest


def test_a_tip_is_told_in_words() -> None:
    assert tip_words(tip()) == "hemisphere of 3 mm radius"
    assert says(tip_words(tip(shape="flat_punch")), "3 mm radius ... 0.3 mm")
    assert "60 degrees" in tip_words(tip(shape="cone"))
    assert "profile of 2 points" in tip_words(tip(shape="profile", profile_mm=((0.0, 0.0), (3.0, 1.0))))
