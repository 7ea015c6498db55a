"""Outlines of tips as the solver and the surface see them: distances, coordinates, convex bodies."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from optopad.design.spec import Indenter
from optopad.sims.contact.library.smooth_press import (
    contact_coordinate,
    contact_tolerance,
    hertz_gap,
    surface_curve,
)
from optopad.sims.contact.tip import (
    HEMISPHERE,
    TipOutline,
    outside_tip,
    tip_coordinate,
    tip_gap,
    tip_of,
    tip_outline,
)
from optopad.sims.contact.wedge import (
    DENSE_HALF_ANGLE,
    TOP_HEIGHT,
    convex_chains,
    outline_points,
    tip_hulls,
)

PUNCH = tip_of(Indenter(shape="flat_punch"))
CONE = tip_of(Indenter(shape="cone", cone_half_angle_deg=50.0))
WAVY = tip_of(
    Indenter(
        shape="profile",
        profile_mm=((0.0, 0.0), (0.6, 0.02), (1.2, 0.5), (1.8, 0.55), (2.4, 1.2), (3.0, 1.3)),
    )
)
ROUND = TipOutline(((0.0, 0.0, 1.0, 1.0, 0.0, 1.0, 1.0 + 1e-12),))
"""A hemisphere that goes through the general formulas."""
TIPS = {"punch": PUNCH, "cone": CONE, "wavy": WAVY, "round": ROUND}


def points_about() -> tuple[np.ndarray, np.ndarray]:
    random = np.random.default_rng(5)
    return random.uniform(0.0, 2.0, 150), random.uniform(-0.8, 1.5, 150)


def test_a_design_without_a_shape_is_the_hemisphere_whatever_its_radius() -> None:
    assert tip_of(Indenter(tip_radius_mm=7.3)) == HEMISPHERE
    assert tip_of(Indenter(tip_radius_mm=0.7, shape="flat_punch")) == PUNCH


def test_the_general_outline_of_a_hemisphere_is_the_special_one() -> None:
    radius, height = points_about()
    for depth in (0.1, 0.9, 1.4):
        np.testing.assert_allclose(
            tip_gap(radius, height, depth, ROUND), tip_gap(radius, height, depth), atol=1e-11
        )
        outside = tip_gap(radius, height, depth) > 0.0  # inside, the shank may be nearer than the sphere
        np.testing.assert_allclose(
            tip_coordinate(radius, height, depth, ROUND)[outside],
            tip_coordinate(radius, height, depth)[outside],
            atol=1e-11,
        )
    along = np.linspace(0.0, 2.5, 60)
    np.testing.assert_allclose(tip_outline(along, 0.4, ROUND), tip_outline(along, 0.4), atol=1e-11)


@pytest.mark.parametrize("tip", TIPS.values(), ids=TIPS)
def test_gap_and_coordinate_are_those_of_the_nearest_of_many_points(tip: TipOutline) -> None:
    radius, height = points_about()
    along = np.linspace(0.0, 4.0, 8001)
    on_radius, on_height = tip_outline(along, 0.5, tip)
    distance = np.hypot(radius[:, None] - on_radius, height[:, None] - on_height)
    gap = tip_gap(radius, height, 0.5, tip)
    # points are 5e-4 apart along the outline, so one is within 2.5e-4 of the nearest place
    np.testing.assert_allclose(np.abs(gap), distance.min(axis=1), atol=2.5e-4)
    inside = (radius < 1.0) & (height > np.interp(radius, on_radius, on_height, right=math.inf))
    np.testing.assert_array_equal((gap < 0.0)[np.abs(gap) > 1e-6], inside[np.abs(gap) > 1e-6])
    at = np.stack(tip_outline(tip_coordinate(radius, height, 0.5, tip), 0.5, tip))
    np.testing.assert_allclose(np.hypot(*(at - [radius, height])), np.abs(gap), atol=1e-9)


@pytest.mark.parametrize("tip", TIPS.values(), ids=TIPS)
def test_coordinates_are_arc_lengths_and_tangents_follow_them(tip: TipOutline) -> None:
    along = np.linspace(0.003, 3.0, 500)
    step = 1e-6
    ahead, behind = (np.stack(tip.points(along + s)) for s in (step, -step))
    slope = (ahead - behind) / (2 * step)
    smooth = np.min(np.abs(along[:, None] - np.append(tip.kinks, 9.0)), axis=1) > 2 * step
    np.testing.assert_allclose(np.hypot(*slope)[smooth], 1.0, atol=1e-6)
    angle = np.array([tip.tangent_angle(float(t)) for t in along])
    np.testing.assert_allclose(np.arctan2(slope[1], slope[0])[smooth], angle[smooth], atol=1e-5)


@pytest.mark.parametrize("tip", TIPS.values(), ids=TIPS)
def test_points_inside_are_moved_onto_the_tip_and_others_stay(tip: TipOutline) -> None:
    radius, height = points_about()
    inside = tip_gap(radius, height, 0.5, tip) < 0.0
    new_radius, new_height = outside_tip(radius, height, 0.5, tip)
    assert np.abs(tip_gap(new_radius[inside], new_height[inside], 0.5, tip)).max() < 1e-9
    np.testing.assert_array_equal(new_radius[~inside], radius[~inside])
    np.testing.assert_array_equal(new_height[~inside], height[~inside])


def test_only_a_polyline_has_kinks() -> None:
    assert PUNCH.kinks.size == CONE.kinks.size == 0
    # four between five lines, and the one to the shank
    assert WAVY.kinks.size == 5


def test_a_tip_whose_slope_only_grows_is_one_body_and_a_wavy_one_is_cut_where_it_falls() -> None:
    assert [len(convex_chains(outline_points(tip))) for tip in (PUNCH, CONE, WAVY)] == [1, 1, 3]


@pytest.mark.parametrize("tip", [PUNCH, CONE, WAVY], ids=["punch", "cone", "wavy"])
def test_bodies_fill_the_tip_within_the_wedge_and_nothing_else(tip: TipOutline) -> None:
    hulls = [ConvexHull(points) for points in tip_hulls(tip)]
    for hull in hulls:
        radius = np.hypot(hull.points[:, 0], hull.points[:, 1])
        assert tip_gap(radius, hull.points[:, 2], 0.0, tip).max() < 1e-9
    random = np.random.default_rng(11)
    angle = random.uniform(-DENSE_HALF_ANGLE, DENSE_HALF_ANGLE, 500)
    radius, height = random.uniform(0.0, 1.0, 500), random.uniform(-0.1, 2.0, 500)
    assert height.max() < TOP_HEIGHT
    where = np.stack([radius * np.cos(angle), radius * np.sin(angle), height], axis=1)
    held = np.any(
        [(where @ hull.equations[:, :3].T + hull.equations[:, 3]).max(axis=1) < 0.0 for hull in hulls], axis=0
    )
    gap = tip_gap(radius, height, 0.0, tip)
    # meridians 0.03 rad apart leave 1.1e-4 of the radius between chord and circle
    np.testing.assert_array_equal(held[np.abs(gap) > 2e-4], (gap < 0.0)[np.abs(gap) > 2e-4])


@pytest.mark.parametrize("spacing", [0.05, 0.1])
@pytest.mark.parametrize("depth", [0.05, 0.1])
def test_the_edge_on_another_tip_is_found_without_knowing_its_curvature(depth: float, spacing: float) -> None:
    edge_radius = math.sqrt(depth)
    radius = np.append(np.arange(0.0, 3.0, spacing), 16 / 3)
    outside = radius**2 / 2 - depth - depth * hertz_gap(np.maximum(radius / edge_radius, 1.0))
    height = np.where(
        radius < edge_radius, 1.0 - depth - np.sqrt(1.0 - np.minimum(radius, 0.9) ** 2), outside
    )
    edge, _ = contact_coordinate(radius, height, depth, contact_tolerance(spacing, 0.1), ROUND)
    # two gaps instead of one: the same fifth of the spacing that the hemisphere's test allows
    assert math.sin(edge) == pytest.approx(edge_radius, abs=0.2 * spacing)


@pytest.mark.parametrize("apex_gap", [0.0, 0.02])
@pytest.mark.parametrize("tip", [HEMISPHERE, CONE, WAVY], ids=["hemisphere", "cone", "wavy"])
def test_a_contact_within_the_first_cell_has_an_edge_beside_the_axis(
    tip: TipOutline, apex_gap: float
) -> None:
    radius = np.append(np.arange(0.0, 3.0, 0.15), 16 / 3)
    height = np.where(radius < 0.1, -0.007 - apex_gap, -0.004 / (1.0 + radius))
    height[1] = min(height[1], tip.height(radius[1:2])[0] - 0.007 - 0.008)  # the first free node hangs below
    edge, first = contact_coordinate(radius, height, 0.007, contact_tolerance(0.15, 0.1), tip)
    assert first == 1
    assert 1e-3 < edge < 0.16


def test_the_curve_under_a_wavy_tip_has_its_kinks_and_stays_out_of_it() -> None:
    radius = np.append(np.arange(0.0, 3.0, 0.1), 16 / 3)
    height = np.where(radius < 0.45, np.interp(radius, *WAVY.points(WAVY.starts)) - 0.2, -0.02 / (1 + radius))
    height[-1] = 0.0
    curve = surface_curve(radius, height, 0.2, spacing=0.1, tolerance=contact_tolerance(0.1, 0.1), tip=WAVY)
    assert (curve.radius[0], curve.height[0]) == (0.0, pytest.approx(-0.2))
    assert tip_gap(curve.radius, curve.height, 0.2, WAVY).min() > -1e-12
    kink_radius, kink_height = WAVY.points(WAVY.kinks[:1])
    assert curve.contact_radius > kink_radius[0]
    nearest = np.hypot(curve.radius - kink_radius[0], curve.height + 0.2 - kink_height[0]).min()
    assert nearest < 1e-9
