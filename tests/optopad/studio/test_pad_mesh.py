"""The pad's picture: an outline with facets, a top on the crown, a press along its normal, parts turned."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from optopad.design.held_object import held_of
from optopad.design.preset import PRESETS, SHAPED_PRESETS, preset
from optopad.design.shape.cavity import cavity_of, workspace_of
from optopad.design.spec import SensorDesign
from optopad.sims.contact.held.bottoms import bottom_mm, rotation
from optopad.sims.contact.held.press import grid_of
from optopad.sims.contact.pad_surface import PadSurface, curve_height_mm, pad_surface
from optopad.sims.contact.scope import contact_of
from optopad.sims.optics.scene.lower import scene_of
from optopad.sims.press import GridTop
from optopad.studio import pad_mesh
from optopad.studio.pad_mesh import cut_open, held_top, outline_mm, pressed_top, struck_place, untouched_top
from optopad.studio.view.shapes import (
    along_normal,
    body_box,
    facing,
    held_body,
    plane_cut,
    round_cut,
    tip_apex_mm,
)

DISC, CROWNED, DOME, STADIUM = SHAPED_PRESETS
SPOTS = [(0.0, 0.0), (0.7, 0.4), (-0.6, -0.7)]
ROUND_OFF_MM = 1e-9


def place_in(design: SensorDesign, spot: tuple[float, float]) -> tuple[float, float]:
    """A press place by its share of the way from the middle to the workspace's sides [mm]."""
    space, middle = workspace_of(design), cavity_of(design).plan.centre_mm
    return space.clamped(
        middle[0] + spot[0] * (middle[0] - space.x0_mm), middle[1] + spot[1] * (middle[1] - space.y0_mm)
    )


@pytest.fixture
def flat_presses(monkeypatch: pytest.MonkeyPatch) -> None:
    """Presses of a flat disc for every design: their heights, over whatever top."""

    def pressed(design: SensorDesign, depth_mm: float, at_mm: tuple[float, float]) -> PadSurface:
        return replace(pad_surface(preset(DISC), depth_mm), at_mm=at_mm)

    monkeypatch.setattr(pad_mesh, "pad_surface", pressed)


def areas_mm2(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """(m,) areas in plan, positive where counter-clockwise from above."""
    a, b, c = (points[triangles[:, k], :2] for k in range(3))
    return ((b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])) / 2


@pytest.mark.parametrize("name", PRESETS)
def test_an_outline_is_convex_and_has_the_pad_s_walls(name: str) -> None:
    plan = cavity_of(preset(name)).plan
    corners = outline_mm(plan)
    side = np.roll(corners, -1, axis=0) - corners
    after = np.roll(side, -1, axis=0)
    assert (side[:, 0] * after[:, 1] - side[:, 1] * after[:, 0] > -1e-9).all()
    assert all(plan.contains(x, y) for x, y in corners - 1e-7 * (corners - plan.centre_mm))
    for wall in plan.walls:
        for end in (0.0, wall.length_mm):
            assert np.linalg.norm(corners - wall.point(end), axis=1).min() < 1e-6
    area = 0.5 * float(
        (corners[:, 0] * np.roll(corners[:, 1], -1) - corners[:, 1] * np.roll(corners[:, 0], -1)).sum()
    )
    assert area == pytest.approx(
        plan.area_mm2, rel=1.5e-3 if plan.outline.arcs else 1e-12
    )  # chords of 3.75 degrees


@pytest.mark.parametrize("name", PRESETS)
@pytest.mark.parametrize("spot", SPOTS)
def test_every_vertex_of_an_untouched_top_lies_on_the_plan_s_top(
    name: str, spot: tuple[float, float]
) -> None:
    design = preset(name)
    plan = cavity_of(design).plan
    for points, triangles in (untouched_top(plan), pressed_top(design, place_in(design, spot), 0.0)[:2]):
        assert points[:, 2] == pytest.approx([plan.top_mm(x, y) for x, y in points[:, :2]], abs=ROUND_OFF_MM)
        areas = areas_mm2(points, triangles)
        assert areas.min() > -1e-6
        corners = outline_mm(plan)
        around = areas_mm2(
            np.vstack([corners, plan.centre_mm]),
            np.array([(len(corners), k, (k + 1) % len(corners)) for k in range(len(corners))]),
        )
        assert areas.sum() == pytest.approx(around.sum(), rel=1e-9)


@pytest.mark.usefixtures("flat_presses")
@pytest.mark.parametrize("name", SHAPED_PRESETS)
@pytest.mark.parametrize("spot", SPOTS)
def test_a_pressed_top_is_the_crown_with_the_press_on_it_in_the_frame_of_the_press(
    name: str, spot: tuple[float, float]
) -> None:
    design, depth = preset(name), 1.2
    place = place_in(design, spot)
    points, _, surface = pressed_top(design, place, depth)
    assert surface is not None
    form = scene_of(design).form
    assert form is not None
    origin, axes = form.top.press_frame(*place)
    u, v, w = axes @ (points - origin).T
    radius = form.top.radius_mm
    reach = u**2 + v**2 if form.top.straight is None else v**2
    fall = 0.0 if form.top.is_flat else reach / (radius + np.sqrt(radius**2 - reach))
    assert w + fall == pytest.approx(curve_height_mm(surface.near, np.hypot(u, v)), abs=1e-5)
    apex = points[np.argmin(np.hypot(u, v))]
    assert apex == pytest.approx(tip_apex_mm(cavity_of(design).plan, place, depth), abs=ROUND_OFF_MM)


@pytest.mark.parametrize("name", SHAPED_PRESETS)
def test_a_top_cut_open_is_its_far_half(name: str) -> None:
    plan = cavity_of(preset(name)).plan
    points, triangles = untouched_top(plan)
    middle = plan.centre_mm[1]
    cut, corners = cut_open(points, triangles, middle)
    assert cut[:, 1].min() >= middle - ROUND_OFF_MM
    whole, half = areas_mm2(points, triangles).sum(), areas_mm2(cut, corners).sum()
    assert half == pytest.approx(whole / 2, rel=1e-3)  # facets are not quite symmetric


def turned(wxyz: tuple[float, float, float, float], vector: tuple[float, float, float]) -> np.ndarray:
    """A vector turned by a quaternion."""
    twice = 2 * np.cross(wxyz[1:], vector)
    return vector + wxyz[0] * twice + np.cross(wxyz[1:], twice)


SIGNS = list(product((-1.0, 1.0), repeat=3))


@pytest.mark.parametrize("name", PRESETS)
def test_a_part_s_body_is_behind_its_face(name: str) -> None:
    for part in cavity_of(preset(name)).parts:
        turn, (size, middle) = facing(part), body_box(part)
        assert turned(turn, (1.0, 0.0, 0.0)) == pytest.approx(-np.array(part.axis), abs=1e-12)
        assert abs(turned(turn, (0.0, 1.0, 0.0)) @ [*part.line.tangent, 0.0]) == pytest.approx(1.0)
        centre = part.position_mm + turned(turn, tuple(middle))
        assert centre == pytest.approx(part.body_mm.mean(axis=0))
        ends = [centre + turned(turn, tuple(way * size / 2)) for way in (np.array(SIGNS))]
        heights = [end[2] for end in ends]
        assert (min(heights), max(heights)) == pytest.approx((part.body_base_mm, part.body_top_mm))
        if not part.is_on_floor:
            out = part.line.along_and_outward_mm(*centre[:2])
            assert out == pytest.approx((part.along_mm, part.part.body_depth_mm.value / 2))


@pytest.mark.parametrize("name", [DISC, CROWNED, DOME])
@pytest.mark.parametrize("spot", SPOTS)
def test_the_tip_stands_along_the_normal_of_its_place(name: str, spot: tuple[float, float]) -> None:
    design = preset(name)
    plan, place = cavity_of(design).plan, place_in(design, spot)
    normal = np.array(plan.normal(*place))
    assert turned(along_normal(plan.normal(*place)), (0.0, 0.0, 1.0)) == pytest.approx(normal, abs=1e-12)
    way = np.array([*place, plan.top_mm(*place)]) - tip_apex_mm(plan, place, 2.0)
    assert way == pytest.approx(2.0 * normal)


@pytest.mark.parametrize("name", PRESETS)
@pytest.mark.parametrize("spot", SPOTS)
def test_a_click_finds_the_place_that_it_was_aimed_at(name: str, spot: tuple[float, float]) -> None:
    design = preset(name)
    plan, (x, y) = cavity_of(design).plan, place_in(design, spot)
    eye = np.array([plan.centre_mm[0] - 30.0, -60.0, 70.0])
    found = struck_place(plan, eye, np.array([x, y, plan.top_mm(x, y)]) - eye)
    step = plan.clear_mm - plan.rim_mm[0]
    assert found == pytest.approx(
        (x, y), abs=max(1e-9, 2.0 * step / 400)
    )  # 400 heights, seen from 45 degrees
    assert struck_place(plan, eye, np.array([1.0, -1.0, -1.0])) is None
    assert struck_place(plan, eye, np.array([1.0, 0.0, 0.0])) is None


def test_a_pointer_on_a_round_wall_is_met_on_its_own_side() -> None:
    plan = cavity_of(preset(DISC)).plan
    eye, radius = np.array([20.0, -80.0, 40.0]), plan.radius_mm + 3.0
    for angle in (200.0, 250.0, 340.0, 60.0, 120.0):
        turn = math.radians(angle)
        at = np.array(
            [*(np.array(plan.centre_mm) + radius * np.array([math.cos(turn), math.sin(turn)])), 5.0]
        )
        for share in (0.4, 1.7):
            assert round_cut(eye, eye + share * (at - eye), plan.centre_mm, radius, at) == pytest.approx(at)
    beside = round_cut(eye, np.array([-40.0, 27.5, 5.0]), plan.centre_mm, radius, np.array([0.0, 27.5, 5.0]))
    assert np.isfinite(beside).all()
    assert plane_cut(eye, np.array([20.0, 0.0, 5.0]), 2, 5.0) == pytest.approx([20.0, 0.0, 5.0])


@pytest.mark.parametrize("name", ["piacenza2017-pad", "gripper-stadium", "crowned-40x25"])
@pytest.mark.parametrize("spot", SPOTS)
def test_a_top_under_an_object_has_the_grid_s_heights_along_the_normal(
    name: str, spot: tuple[float, float]
) -> None:
    design = preset(name)
    plan, place = cavity_of(design).plan, place_in(design, spot)
    x, y = grid_of(contact_of(design), place)

    def dent(along_x: np.ndarray, along_y: np.ndarray) -> np.ndarray:
        return -0.3 * np.exp(-(along_x**2 + 0.5 * along_y**2) / 6.0)

    height = dent(x[:, None], y)
    points, triangles = held_top(design, GridTop(at_mm=place, x_mm=x, y_mm=y, height_mm=height, level=height))
    origin, axes = plan.top.press_frame(*place)
    along = (points - origin) @ axes.T
    start = points - dent(*along[:, :2].T)[:, None] * axes[2]
    between_nodes = (0.1 + 0.05) / 8 * (x[1] - x[0]) ** 2  # from the dent's curvatures
    away = (start[:, 2] - pad_mesh.top_mm(plan, *start[:, :2].T)) * plan.top.normal(*start[:, :2].T)[:, 2]
    assert np.abs(away).max() <= between_nodes + 1e-6
    assert (areas_mm2(points, triangles) > -1e-6).all()
    assert areas_mm2(points, triangles).sum() == pytest.approx(
        areas_mm2(*untouched_top(plan)).sum(), rel=1e-3
    )


BODIES = [
    "sphere",
    "ellipsoid",
    "cylinder,edge=0.5",
    "punch",
    "torus",
    *(f"box,pose={pose}" for pose in ("face", "edge", "corner")),
]


@pytest.mark.parametrize("turned", ["", ",yaw=20,pitch=35,roll=10"])
@pytest.mark.parametrize("text", BODIES)
def test_an_object_is_drawn_as_it_presses(text: str, turned: str) -> None:
    held = held_of(text + turned)
    points, triangles = held_body(held)
    turned_mm = points @ rotation(held).T
    above = turned_mm[:, 2] - turned_mm[:, 2].min()
    own = [
        (height, bottom_mm(held, point[:1], point[1:2]).item())
        for point, height in zip(turned_mm[::23], above[::23], strict=True)
    ]
    gap = np.array([height - bottom for height, bottom in own if np.isfinite(bottom)])
    assert gap.min() > -0.05  # chords of a mesh
    assert (gap < 0.05).mean() > 0.3  # points on the lower side
    a, b, c = (points[triangles[:, k]] for k in range(3))
    assert np.einsum("ij,ij->", a, np.cross(b, c)) > 0.0  # triangles counter-clockwise from outside
