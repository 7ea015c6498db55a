from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from optopad.design.errors import InputError
from tests.oracle.called_oracle_kernels import is_in_elastomer, top_exit
from tests.oracle.oracle_scenes import (
    dimple,
    dimple_height_mm,
    dimple_shape_mm,
    flat_top,
    wrapped_press,
)
from tests.oracle.surface import CONTACT, FREE, NOTHING

CENTRE = np.array([14.0, 17.0])
TOP_MM = 8.0


def unit_directions(rng, count):
    direction = rng.normal(size=(count, 3))
    direction[:, 2] *= 0.5
    return direction / np.linalg.norm(direction, axis=1, keepdims=True)


def starts_below(rng, surface, count):
    low, high = (10.0, 13.0, 0.1), (18.0, 21.0, 8.3)
    places = rng.uniform(low, high, (count, 3))
    return np.array([p for p in places if is_in_elastomer(surface, *p)])


def first_crossing(start, direction, limit, depth_mm, bulge_mm):
    """Where the analytic height field is first crossed, by sampling every 2 µm or so and bisection."""

    def above(t):
        p = start + np.multiply.outer(np.asarray(t), direction)
        radius = np.hypot(p[..., 0] - CENTRE[0], p[..., 1] - CENTRE[1])
        return p[..., 2] - TOP_MM - dimple_height_mm(radius, depth_mm, bulge_mm)

    t = np.linspace(0.0, limit, 10_001)
    crossed = np.flatnonzero(above(t) > 0.0)
    if crossed.size == 0:
        return math.inf
    if crossed[0] == 0:
        return 0.0
    return brentq(lambda s: float(above(s)), t[crossed[0] - 1], t[crossed[0]], xtol=1e-12)


@pytest.mark.parametrize(("depth_mm", "bulge_mm"), [(0.2, 0.0), (1.0, 0.05), (3.0, 0.2)])
def test_hits_agree_with_bisection_on_the_analytic_dimple(depth_mm, bulge_mm):
    rng = np.random.default_rng(1)
    surface = flat_top((CENTRE, dimple(depth_mm, bulge_mm)))
    starts = starts_below(rng, surface, 700)
    directions = unit_directions(rng, len(starts))
    directions[:, 2] = np.abs(directions[:, 2])
    wrong, curved = 0, 0
    edge = sum(dimple_shape_mm(depth_mm)[::2])
    for start, direction in zip(starts, directions, strict=True):
        t, what, nx, ny, nz = top_exit(surface, *start, *direction, 20.0)
        truth = first_crossing(start, direction, 20.0, depth_mm, bulge_mm)
        if what == NOTHING or truth > 20.0:
            wrong += what != NOTHING or truth < 20.0
            continue
        grazing = abs(float(np.dot(direction, (nx, ny, nz))))
        hit = start + t * direction
        curved += math.hypot(hit[0] - CENTRE[0], hit[1] - CENTRE[1]) < edge
        # the pieces lie within 0.15 µm of the curve, so the hit along the ray within 0.15 µm / cosine
        wrong += abs(t - truth) > 2e-4 / max(grazing, 1e-3)
    assert curved > 25
    assert wrong <= 1  # a ray that grazes within the 2 mm / 10,000 sampling of the check itself


def test_normals_are_the_gradient_of_the_analytic_height_field():
    surface = flat_top((CENTRE, dimple(1.0, 0.05)))
    contact, _, reach = dimple_shape_mm(1.0)
    radius = np.linspace(contact + 0.02 * reach, contact + 0.98 * reach, 101)
    slope = (dimple_height_mm(radius + 1e-6, 1.0, 0.05) - dimple_height_mm(radius - 1e-6, 1.0, 0.05)) / 2e-6
    # PCHIP flattens the curve at its crest: half a knot spacing times the curvature, the rest is second order
    tolerances = 0.5 * (reach / 399) * np.abs(np.gradient(slope, radius)) + 1e-5
    for r, expected, tolerance in zip(radius, slope, tolerances, strict=True):
        x, y = CENTRE[0] + r * math.cos(0.7), CENTRE[1] + r * math.sin(0.7)
        _, what, nx, ny, nz = top_exit(surface, x, y, 1.0, 0.0, 0.0, 1.0, 20.0)
        assert what == FREE
        assert math.hypot(nx, ny, nz) == pytest.approx(1.0, abs=1e-12)
        outward = -(nx * math.cos(0.7) + ny * math.sin(0.7)) / nz
        assert outward == pytest.approx(expected, abs=tolerance)


def test_the_contact_is_the_exact_sphere():
    surface = flat_top((CENTRE, dimple(3.0)))
    for r in np.linspace(0.0, 2.699, 30):
        t, what, nx, _, nz = top_exit(surface, CENTRE[0] + r, CENTRE[1], 0.0, 0.0, 0.0, 1.0, 20.0)
        assert what == CONTACT
        assert t == pytest.approx(TOP_MM - math.sqrt(9.0 - r * r), abs=1e-12)
        assert (nx, nz) == pytest.approx((-r / 3.0, math.sqrt(9.0 - r * r) / 3.0), abs=1e-12)


def test_a_wetted_shank_is_contact_up_to_where_the_curve_leaves_it():
    surface = flat_top((CENTRE, wrapped_press()))
    for z, expected in ((5.4, CONTACT), (5.6, CONTACT), (6.4, CONTACT), (6.6, FREE)):
        t, what, nx, _, _ = top_exit(surface, CENTRE[0] - 8.0, CENTRE[1], z, 1.0, 0.0, 0.0, 30.0)
        assert what == expected
        assert nx > 0.5
        if expected == CONTACT:
            half = math.sqrt(9.0 - min(z - 5.5, 0.0) ** 2)
            assert t == pytest.approx(8.0 - half, abs=1e-9)


def test_no_ray_slips_through_a_folded_surface():
    rng = np.random.default_rng(2)
    surface = flat_top((CENTRE, wrapped_press()))
    starts = starts_below(rng, surface, 3000)
    directions = unit_directions(rng, len(starts))
    directions[:, 2] = np.abs(directions[:, 2])
    for start, direction in zip(starts, directions, strict=True):
        t, what, nx, ny, nz = top_exit(surface, *start, *direction, 1e9)
        assert what != NOTHING
        before, after = start + (t - 1e-5) * direction, start + (t + 1e-5) * direction
        assert t < 1e-4 or is_in_elastomer(surface, *before)
        if float(np.dot(direction, (nx, ny, nz))) > 0.1:
            assert not is_in_elastomer(surface, *after)


def test_points_between_fold_and_shank_are_outside():
    surface = flat_top((CENTRE, wrapped_press()))
    inside = [(3.8, 7.5), (3.55, 7.8), (3.7, 8.0), (5.0, 8.05), (2.0, 3.0)]
    outside = [(3.3, 7.5), (2.0, 6.0), (3.4, 7.9), (3.7, 8.2), (7.5, 8.01)]
    for points, expected in ((inside, True), (outside, False)):
        for r, z in points:
            assert is_in_elastomer(surface, CENTRE[0] + r, CENTRE[1], z) is expected


def test_an_open_end_of_the_curve_is_closed_by_a_ring():
    press = dimple(1.0)
    lifted = replace(press, height_mm=press.height_mm + np.where(press.radius_mm > 3.0, 0.05, 0.0))
    surface = flat_top((CENTRE, lifted))
    edge = float(press.radius_mm[-1])
    t, what, nx, _, nz = top_exit(surface, CENTRE[0] + edge - 1.0, CENTRE[1], 8.02, 1.0, 0.0, 0.0, 20.0)
    assert (what, nx, nz) == (FREE, 1.0, pytest.approx(0.0, abs=1e-12))
    assert t == pytest.approx(1.0, abs=1e-9)


def test_an_untouched_top_is_the_plane():
    surface = flat_top()
    assert top_exit(surface, 1.0, 2.0, 3.0, 0.6, 0.0, 0.8, 20.0) == pytest.approx((6.25, FREE, 0, 0, 1))
    assert top_exit(surface, 1.0, 2.0, 3.0, 0.6, 0.0, -0.8, 20.0)[1] == NOTHING


def test_a_curve_off_its_tip_is_refused_by_name():
    with pytest.raises(InputError, match=r"indentations\[2\]: .* off the tip"):
        flat_top((CENTRE, replace(dimple(1.0), tip_radius_mm=2.0)), where="indentations[2]")
