"""Outlines of lines and arcs, and tops by curvature, against random points and closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from optopad.design.shape.cavity import facet
from optopad.design.shape.outline import Arc, Outline, disc, rectangle, stadium
from optopad.design.shape.top import Top

RADIUS = 11.0
WHOLE = Arc(centre_mm=(RADIUS, RADIUS), radius_mm=RADIUS, start_rad=0.0, turn_rad=2.0 * math.pi)
FACETS = [facet(WHOLE, 37.0 * k, 1.5) for k in range(8)]
BARE = stadium((0.0, 0.0, 32.0, 20.0))
IN_ENDS = [facet(BARE.arc_towards(angle), angle, 1.5) for angle in (0.0, 50.0, 180.0, 235.0)]
OUTLINES = {
    "rectangle": rectangle((2.0, 1.0, 30.0, 21.0)),
    "disc": disc((0.0, 0.0, 22.0, 22.0)),
    "one facet": disc((0.0, 0.0, 22.0, 22.0), FACETS[:1]),
    "eight facets": disc((0.0, 0.0, 22.0, 22.0), FACETS),
    "stadium": BARE,
    "upright stadium": stadium((0.0, 0.0, 20.0, 32.0)),
    "stadium with facets": stadium((0.0, 0.0, 32.0, 20.0), IN_ENDS),
}


@pytest.fixture(params=OUTLINES.values(), ids=OUTLINES)
def outline(request: pytest.FixtureRequest) -> Outline:
    return request.param


def places_around(outline: Outline, count: int) -> np.ndarray:
    x0, y0, x1, y1 = outline.box_mm
    return np.random.default_rng(7).uniform((x0 - 3.0, y0 - 3.0), (x1 + 3.0, y1 + 3.0), (count, 2))


def test_lines_and_arcs_follow_each_other_and_close_the_loop(outline):
    ends = [one.points(np.array([0.0, 1.0])) for one in outline.loop]
    for before, after in zip(ends, [*ends[1:], ends[0]], strict=True):
        assert before[1] == pytest.approx(after[0], abs=1e-9)


def test_area_and_integrals_are_those_of_a_fine_polygon(outline):
    x, y = outline.points(2e-4, 1).T
    area = 0.5 * float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))
    assert outline.area_mm2 == pytest.approx(area, rel=1e-7)
    px, py, weight = outline.integral(outline.centre_mm, 24)
    assert weight.sum() == pytest.approx(outline.area_mm2, rel=1e-12)
    assert float(weight @ np.hypot(px - 12.0, py - 10.0) ** 2) == pytest.approx(second_moment(x, y), rel=1e-6)


def second_moment(x: np.ndarray, y: np.ndarray) -> float:
    """Of a polygon about (12, 10): sum over its triangles from there."""
    ax, ay = x - 12.0, y - 10.0
    bx, by = np.roll(ax, -1), np.roll(ay, -1)
    twice = ax * by - bx * ay
    return float(np.sum(twice * (ax**2 + ax * bx + bx**2 + ay**2 + ay * by + by**2)) / 12.0)


def test_what_is_inside_is_inside_the_polygon_of_its_corners(outline):
    from matplotlib.path import Path

    places = places_around(outline, 400)
    inside = Path(outline.points(1e-3)).contains_points(places)
    gap = outline.gap_mm(*places.T)
    assert ((gap > 0.0) == inside)[np.abs(gap) > 1e-5].all()


def test_a_gap_is_the_least_distance_of_a_place_inside_to_the_border(outline):
    places = np.array([place for place in places_around(outline, 300) if outline.contains(*place)])
    border = outline.points(2e-4, 20_000)
    for place in places[:40]:
        nearest = float(np.hypot(*(border - place).T).min())
        assert float(outline.gap_mm(*place)) == pytest.approx(nearest, abs=2e-3)


def test_the_way_out_ends_on_the_border(outline):
    for angle in np.linspace(0.1, 6.2, 17):
        way = math.cos(angle), math.sin(angle)
        far = outline.way_out_mm((12.0, 10.0), way)
        assert float(outline.gap_mm(12.0 + far * way[0], 10.0 + far * way[1])) == pytest.approx(0.0, abs=1e-9)


def test_places_outside_are_moved_onto_the_border_and_places_inside_stay(outline):
    for x, y in places_around(outline, 200).tolist():
        moved = outline.clamped(x, y)
        assert outline.contains(*moved, 1e-6)
        if outline.contains(x, y, 0.0):
            assert moved == (x, y)


def test_the_farthest_place_of_the_border_is_that_of_a_fine_polygon(outline):
    border = outline.points(2e-4)
    for place in places_around(outline, 40):
        assert outline.farthest_mm(*place) == pytest.approx(np.hypot(*(border - place).T).max(), abs=1e-6)


def test_evenly_spread_places_lie_inside_and_have_the_outline_s_moments(outline):
    shares = np.stack(np.meshgrid(*[(np.arange(200) + 0.5) / 200] * 2), axis=-1).reshape(-1, 2)
    places = outline.spread(shares)
    assert outline.contains(*places.T).all()
    x, y, weight = outline.integral(outline.centre_mm, 24)
    for power in ((1, 0), (0, 1), (2, 0), (1, 1), (0, 2)):
        moment = np.prod(((np.stack([x, y]).T - outline.centre_mm) ** power), axis=1)
        found = np.prod((places - outline.centre_mm) ** power, axis=1).mean()
        assert found == pytest.approx(float(weight @ moment) / outline.area_mm2, abs=0.02)


def test_spread_places_fill_a_disc_evenly():
    shares = np.stack(np.meshgrid(*[(np.arange(60) + 0.5) / 60] * 2), axis=-1).reshape(-1, 2)
    away = np.hypot(*(OUTLINES["disc"].spread(shares) - 11.0).T)
    assert np.mean(away**2) == pytest.approx(RADIUS**2 / 2, rel=1e-3)


BENDS = st.sampled_from([(0.0, 0.0), (0.05, 0.05), (0.0, 0.04), (0.06, 0.0)])
PLACES = st.tuples(st.floats(-7.0, 7.0), st.floats(-7.0, 7.0))


@given(BENDS, PLACES)
def test_a_top_is_the_sphere_or_cylinder_of_its_curvature(bends, place):
    kx, ky = bends
    top = Top(clear_mm=8.0, apex_mm=(1.0, -2.0), kx=kx, ky=ky)
    x, y = place[0] - 1.0, place[1] + 2.0
    away = math.hypot(x if kx else 0.0, y if ky else 0.0)
    radius = top.radius_mm
    sag = 0.0 if top.is_flat else radius - math.sqrt(radius**2 - away**2)
    assert float(top.sag_mm(*place)) == pytest.approx(sag, abs=1e-12)
    step = 1e-5
    slopes = [
        float(top.height_mm(place[0] + dx, place[1] + dy) - top.height_mm(place[0] - dx, place[1] - dy))
        / 2
        / step
        for dx, dy in ((step, 0.0), (0.0, step))
    ]
    upright = np.array([-slopes[0], -slopes[1], 1.0])
    assert top.normal(*place) == pytest.approx(upright / np.linalg.norm(upright), abs=1e-8)


@given(BENDS, PLACES, PLACES)
def test_from_the_frame_of_a_press_the_top_is_the_same_surface(bends, place, other):
    top = Top(clear_mm=8.0, apex_mm=(0.0, 0.0), kx=bends[0], ky=bends[1])
    origin, axes = top.press_frame(*place)
    assert axes @ axes.T == pytest.approx(np.eye(3), abs=1e-12)
    assert np.linalg.det(axes) == pytest.approx(1.0)
    u, v, w = axes @ (np.array([*other, float(top.height_mm(*other))]) - origin)
    assert w == pytest.approx(-float(top.in_frame.sag_mm(u, v)), abs=1e-9)
