"""The pad in plan and its crown: facets, areas, volumes, heights, normals, places by angle."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from optopad.design.mold.filling import filling_holes
from optopad.design.mold.outline import outline_of
from optopad.design.preset import SHAPED_PRESETS, preset
from optopad.design.shape.cavity import Plan, cavity_of, facet, plan_with, workspace_of
from optopad.design.shape.outline import Arc
from optopad.design.spec import Crown, SensorDesign

DISC, CROWNED, DOME, _ = (preset(name) for name in SHAPED_PRESETS)
WHOLE = Arc(centre_mm=(11.0, 11.0), radius_mm=11.0, start_rad=0.0, turn_rad=2.0 * math.pi)


def made_plan(crown: Crown | None, *, is_disc: bool, sides: int = 0) -> Plan:
    walls = tuple(facet(WHOLE, 360.0 / sides * k, 1.5) for k in range(sides))
    base = (DOME if is_disc else CROWNED).with_(**{"cavity.clear_thickness_mm": 8.0})
    return plan_with(base.model_copy(update={"crown": crown}), walls)


def sphere(radius_mm: float) -> Crown:
    return Crown(shape="sphere", radius_mm=radius_mm)


def cylinder(radius_mm: float, axis: str) -> Crown:
    return Crown.model_validate({"shape": "cylinder", "radius_mm": radius_mm, "axis": axis})


@given(st.floats(-360.0, 360.0), st.floats(0.1, 5.0))
def test_a_facet_is_a_chord_of_its_disc(angle_deg: float, half_mm: float) -> None:
    wall = facet(WHOLE, angle_deg, half_mm)
    for along in (0.0, wall.length_mm):
        x, y = wall.point(along)
        assert math.hypot(x - 11.0, y - 11.0) == pytest.approx(11.0)
    x, y = wall.point(wall.length_mm / 2)
    assert math.hypot(x - 11.0, y - 11.0) == pytest.approx(math.sqrt(121.0 - half_mm**2))
    stands = math.sqrt(121.0 - half_mm**2)
    turn = math.radians(angle_deg)
    assert (x - 11.0, y - 11.0) == pytest.approx((stands * math.cos(turn), stands * math.sin(turn)), abs=1e-9)
    assert wall.along_and_outward_mm(*wall.point(0.3, 2.0)) == pytest.approx((0.3, 2.0))


def test_facets_at_quarter_turns_stand_exactly_along_the_axes() -> None:
    assert [facet(WHOLE, angle, 1.0).outward for angle in (0, 90, 180, -90)] == [
        (1.0, 0.0),
        (0.0, 1.0),
        (-1.0, 0.0),
        (0.0, -1.0),
    ]


def test_a_ring_goes_around_in_turn_from_its_first_angle() -> None:
    turned = cavity_of(DISC.with_(**{"layout.0.first_angle_deg": 10.0, "layout.0.first": "receiver"}))
    angles = [math.degrees(math.atan2(*part.line.outward[::-1])) % 360 for part in turned.receivers]
    assert angles == pytest.approx([10.0 + 45.0 * k for k in range(8)])
    assert turned.emitters[0].wall == "32.5-degree"
    for part in turned.parts:
        x, y, z = part.position_mm
        assert math.hypot(x - 27.5, y - 27.5) == pytest.approx(turned.plan.stands_mm(part.line))
        assert z == part.height_mm


@pytest.mark.parametrize(
    ("is_disc", "sides", "crown"),
    [
        (True, 0, None),
        (True, 12, None),
        (True, 12, sphere(18.0)),
        (True, 12, cylinder(18.0, "y")),
        (False, 0, sphere(40.0)),
        (False, 0, cylinder(60.0, "x")),
        (False, 0, cylinder(60.0, "y")),
    ],
)
def test_area_and_volume_are_those_of_many_random_points(
    is_disc: bool, sides: int, crown: Crown | None
) -> None:
    plan = made_plan(crown, is_disc=is_disc, sides=sides)
    points = np.random.default_rng(7).uniform((0, 0, 0), (plan.length_mm, plan.width_mm, 8.0), (40_000, 3))
    x, y, z = points.T
    inside = plan.outline.contains(x, y)
    below = inside & (z <= plan.top.height_mm(x, y))
    box = plan.length_mm * plan.width_mm
    assert plan.area_mm2 == pytest.approx(box * inside.mean(), rel=0.01)
    assert plan.clear_volume_mm3 == pytest.approx(box * 8.0 * below.mean(), rel=0.01)


def test_a_dome_without_facets_has_the_volume_of_a_cap_on_a_cylinder() -> None:
    plan, high = made_plan(sphere(18.0), is_disc=True), 18.0 - math.sqrt(18.0**2 - 11.0**2)
    cap = math.pi * high**2 * (18.0 - high / 3)
    assert plan.clear_volume_mm3 == pytest.approx(math.pi * 121.0 * (8.0 - high) + cap, rel=1e-12)
    assert plan.rim_mm == pytest.approx((8.0 - high, 8.0 - high))


def test_a_cylinder_has_the_volume_of_its_section() -> None:
    plan, half = made_plan(cylinder(60.0, "x"), is_disc=False), 12.5
    segment = 60.0**2 * math.asin(half / 60.0) - half * math.sqrt(60.0**2 - half**2)
    low = 8.0 - (60.0 - math.sqrt(60.0**2 - half**2))
    assert plan.clear_volume_mm3 == pytest.approx(40.0 * (25.0 * low + segment), rel=1e-12)
    assert plan.rim_mm == pytest.approx((low, 8.0))


@given(st.floats(0.0, 22.0), st.floats(0.0, 22.0))
def test_normals_are_at_right_angles_to_the_top(x: float, y: float) -> None:
    for crown in (None, sphere(18.0), cylinder(18.0, "x"), cylinder(18.0, "y")):
        plan = made_plan(crown, is_disc=True)
        if math.hypot(x - 11.0, y - 11.0) > 10.9:
            continue
        nx, ny, nz = plan.normal(x, y)
        slopes = [
            (plan.top_mm(x + dx, y + dy) - plan.top_mm(x - dx, y - dy)) / 2e-4
            for dx, dy in ((1e-4, 0.0), (0.0, 1e-4))
        ]
        assert (-nx / nz, -ny / nz) == pytest.approx(tuple(slopes), abs=1e-6)
        assert nx**2 + ny**2 + nz**2 == pytest.approx(1.0)


def test_the_workspace_of_a_disc_is_a_disc() -> None:
    space = workspace_of(DOME)
    assert space.clamped(11.0, 11.0) == (11.0, 11.0)
    assert space.clamped(22.0, 11.0) == pytest.approx((18.0, 11.0))
    assert space.clamped(0.0, 0.0) == pytest.approx((11.0 - 7.0 / math.sqrt(2),) * 2)
    assert space.contains(*space.clamped(0.0, 22.0))
    assert not space.contains(5.0, 5.0)  # in the square, not in the disc


@pytest.mark.parametrize("design", [CROWNED, DOME], ids=lambda design: design.name)
def test_a_crowned_pad_is_filled_through_four_holes_in_its_floor(design: SensorDesign) -> None:
    outline, plan = outline_of(design), cavity_of(design).plan
    assert [hole.radius for hole in outline.filling] == [2.0, 1.0, 1.0, 1.0]
    for hole in outline.filling:
        around = [
            hole.radius * np.array([math.cos(turn), math.sin(turn)]) for turn in np.arange(0.0, 6.3, 0.1)
        ]
        assert all(plan.contains(hole.x + dx, hole.y + dy) for dx, dy in around)
        assert (hole.z0, hole.z1) == (-4.0, -1.0)
    assert outline.top_mm == pytest.approx(plan.rim_mm[1])
    assert (outline.lip_mm, outline.collars) == (0.0, ())


def test_a_flat_pad_has_no_holes_to_fill_it() -> None:
    assert outline_of(DISC).filling == filling_holes(cavity_of(DISC).plan, -4.0, -1.0) == ()


def test_fixing_holes_of_a_disc_stand_between_its_parts() -> None:
    outline = outline_of(DISC)
    assert len(outline.fixing_holes) == 4
    for hole in outline.fixing_holes:
        away = [socket.frame.gap_mm(cut, hole) for socket in outline.sockets for cut in socket.cuts]
        assert min(away) > DISC.mold.min_web_mm


def test_sockets_around_a_disc_are_as_far_apart_as_their_corners() -> None:
    first, second = outline_of(DISC).sockets[:2]
    ends = [np.array(first.frame.corners(first.pocket)), np.array(second.frame.corners(second.pocket))]
    nearest = min(np.hypot(*(one - other)) for one in ends[0] for other in ends[1])
    assert first.frame.apart_mm(first.pocket, second.frame, second.pocket) == pytest.approx(nearest, abs=1e-9)
    assert first.frame.apart_mm(first.pocket, first.frame, first.pocket) < 0.0


def test_a_disc_is_told_apart_by_its_own_size_alone() -> None:
    document = DISC.model_dump(mode="json")
    assert "length_mm" not in document["cavity"]
    assert "outer_length_mm" not in document["mold"]
    assert DISC.cavity.length_mm == DISC.cavity.width_mm == 55.0
    wider = DISC.with_(**{"cavity.diameter_mm": 56.0})
    assert wider.cavity.length_mm == 56.0
    assert wider.digest != DISC.digest
