from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from optopad.design.errors import ModelScopeError
from optopad.sims.optics.scene.optical_scene import SmoothField, smooth_field
from tests.oracle.called_oracle_kernels import is_in_elastomer, top_height, top_hit
from tests.oracle.oracle_scenes import (
    dimple,
    dimple_height_mm,
    flat_field,
    flat_top,
    shank_press,
    wrapped_press,
)
from tests.oracle.surface import CONTACT, FREE, INSIDE, NOTHING, OUTSIDE

TOP_MM = 8.0
LENGTH_MM = 32.0
REACH_MM = 6.9
"""How far rays are followed; none of them gets out of the pad."""
FIRST, SECOND = np.array([11.0, 15.0]), np.array([19.0, 17.5])
TIPS = [(FIRST, dimple(2.0, 0.1)), (SECOND, dimple(0.7, 0.05))]


def ripple_mm(x, y):
    return 0.15 * np.sin(0.31 * x + 0.2) * np.cos(0.24 * y)


def top_mm(x, y):
    """The analytic top: two dimples on a ripple."""
    total = TOP_MM + ripple_mm(x, y)
    for (cx, cy), depth, bulge in ((FIRST, 2.0, 0.1), (SECOND, 0.7, 0.05)):
        total = total + dimple_height_mm(np.hypot(x - cx, y - cy), depth, bulge)
    return total


@pytest.fixture(scope="module")
def surface():
    # bicubic through a grid of 0.5 mm: off the ripple by (0.31 x 0.5)^4 / 384 of 0.15 mm, 0.3 nm
    return flat_top(*TIPS, field=smooth_field(ripple_mm, LENGTH_MM, LENGTH_MM, 0.5))


def rays(count, seed, low, high):
    """Starts (n, 3) between two heights near the tips, and directions (n, 3), many of them flat."""
    rng = np.random.default_rng(seed)
    starts = rng.uniform((7.0, 11.0, low), (23.0, 21.0, high), (count, 3))
    directions = rng.normal(size=(count, 3)) * [1.0, 1.0, 0.4]
    return starts, directions / np.linalg.norm(directions, axis=1, keepdims=True)


def first_crossing(start, direction, side, limit):
    """Where the analytic top is met, by samples 0.5 µm to 2 µm apart along the ray and bisection."""

    def clearance(t):
        x, y, z = (start[k] + np.asarray(t) * direction[k] for k in range(3))
        return side * (top_mm(x, y) - z)

    t = np.linspace(0.0, limit, 20_001)
    crossed = np.flatnonzero(clearance(t) <= 0.0)
    if crossed.size == 0:
        return math.inf
    low, high = t[max(crossed[0] - 1, 0)], t[crossed[0]]
    for _ in range(50):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if clearance(middle) > 0.0 else (low, middle)
    return low


def test_height_and_slope_are_those_of_the_analytic_top(surface):
    rng = np.random.default_rng(1)
    for x, y in rng.uniform(7.0, 23.0, (400, 2)):
        height, along, across = top_height(surface, x, y)
        assert TOP_MM + height == pytest.approx(
            float(top_mm(x, y)), abs=2e-6
        )  # PCHIP through 400 points a skirt
        steps = [(1e-6, 0.0), (0.0, 1e-6)]
        for slope, (dx, dy) in zip((along, across), steps, strict=True):
            ends = [top_height(surface, x + s * dx, y + s * dy)[0] for s in (1, -1)]
            assert slope == pytest.approx((ends[0] - ends[1]) / 2e-6, abs=1e-4)


@pytest.mark.parametrize(("side", "low", "high"), [(INSIDE, 4.0, 8.2), (OUTSIDE, 5.5, 9.0)])
def test_hits_agree_with_bisection_on_the_analytic_top(surface, side, low, high):
    starts, directions = rays(700, 2, low, high)
    met, wrong = 0, 0
    for start, direction in zip(starts, directions, strict=True):
        if is_in_elastomer(surface, *start) != (side == INSIDE):
            continue
        t, what, *normal = top_hit(surface, side, *start, *direction, REACH_MM)
        truth = first_crossing(start, direction, side, REACH_MM)
        if what == NOTHING or truth > REACH_MM:
            wrong += what != NOTHING or truth < REACH_MM
            continue
        met += 1
        assert np.linalg.norm(normal) == pytest.approx(1.0, abs=1e-12)
        cosine = float(direction @ normal)
        assert cosine > -1e-9
        # heights agree to 2 µm, so places along the ray to that over the cosine
        wrong += abs(t - truth) > 2e-6 / max(cosine, 1e-4) + 1e-6
    assert met > 80
    assert wrong <= 1  # a graze within the sampling of the check itself


def test_contact_lies_within_the_contact_radii(surface):
    for (centre, press), angle in zip(TIPS, (0.3, 2.0), strict=True):
        for share, expected in ((0.0, CONTACT), (0.99, CONTACT), (1.01, FREE)):
            r = share * press.contact_radius_mm
            x, y = centre + r * np.array([math.cos(angle), math.sin(angle)])
            t, what, *normal = top_hit(surface, INSIDE, x, y, 1.0, 0.0, 0.0, 1.0, 20.0)
            assert what == expected
            assert t == pytest.approx(TOP_MM + top_height(surface, x, y)[0] - 1.0, abs=1e-9)
            assert normal[2] > 0.0


@pytest.mark.parametrize("depth_mm", [0.3, 1.0, 2.5])
def test_one_tip_is_met_where_the_surface_of_revolution_is(depth_mm):
    press = dimple(depth_mm, 0.05)
    alone, revolved = flat_top((FIRST, press), field=flat_field(0.0)), flat_top((FIRST, press))
    compared = 0
    for side in (INSIDE, OUTSIDE):
        starts, directions = rays(600, 3, 6.0, 8.1)
        for start, direction in zip(starts, directions, strict=True):
            if is_in_elastomer(alone, *start) != (side == INSIDE):
                continue
            mine = top_hit(alone, side, *start, *direction, 12.0)
            theirs = top_hit(revolved, side, *start, *direction, 12.0)
            if side == OUTSIDE and mine[1] == CONTACT:
                continue  # a surface of revolution leaves the tip's own side to the tip
            assert mine[1] == theirs[1]
            cosine = max(float(direction @ mine[2:]), 1e-3)
            # both read the same points within 2 µm of the analytic curve, of height over radius or along the curve
            assert mine[0] == pytest.approx(theirs[0], abs=4e-6 / cosine)
            assert mine[2:] == pytest.approx(theirs[2:], abs=2e-3)  # normals turn linearly over 0.01 rad
            compared += mine[1] != NOTHING
    assert compared > 200


def test_a_step_at_the_edge_of_a_tip_or_field_is_a_vertical_face():
    press = dimple(1.0)
    lifted = replace(press, height_mm=press.height_mm + np.where(press.radius_mm > 3.0, 0.05, 0.0))
    tip = flat_top((FIRST, lifted), field=flat_field(0.0))
    edge = float(press.radius_mm[-1])
    t, what, *normal = top_hit(tip, INSIDE, FIRST[0] + edge - 0.5, FIRST[1], 8.02, 1.0, 0.0, 0.0, 20.0)
    assert (t, what) == (pytest.approx(0.5, abs=1e-8), FREE)
    assert normal == pytest.approx([1.0, 0.0, 0.0], abs=1e-9)
    nodes = np.zeros((3, 3, 4))
    nodes[..., 0] = 0.2
    plateau = flat_top(field=SmoothField(origin_mm=np.full(2, 10.0), step_mm=np.full(2, 2.0), nodes=nodes))
    t, what, *normal = top_hit(plateau, INSIDE, 12.0, 12.0, 8.1, 0.0, -1.0, 0.0, 20.0)
    assert (what, normal) == (FREE, pytest.approx([0.0, -1.0, 0.0]))
    assert t == pytest.approx(2.0, abs=2e-6)  # a field goes on for a nanometre
    t, what, *normal = top_hit(plateau, OUTSIDE, 5.0, 12.0, 8.1, 1.0, 0.0, 0.0, 20.0)
    assert (t, what, normal) == (pytest.approx(5.0, abs=2e-6), FREE, pytest.approx([1.0, 0.0, 0.0]))


def test_no_ray_slips_through(surface):
    starts, directions = rays(3000, 4, 3.0, 8.0)
    directions[:, 2] = np.abs(directions[:, 2])
    for start, direction in zip(starts, directions, strict=True):
        if is_in_elastomer(surface, *start):
            t, what, *normal = top_hit(surface, INSIDE, *start, *direction, 1e6)
            assert what != NOTHING
            assert t < 1e-4 or is_in_elastomer(surface, *(start + (t - 1e-6) * direction))
            if float(direction @ normal) > 0.1:
                assert not is_in_elastomer(surface, *(start + (t + 1e-6) * direction))


def test_a_shank_in_the_pad_is_met_where_it_is_without_a_field_to_a_thirtieth_of_its_length():
    summed = flat_top((FIRST, shank_press()), field=flat_field(0.0))
    alone = flat_top((FIRST, shank_press()))
    starts, directions = rays(2000, 8, 2.0, 6.0)
    found = []
    for start, direction in zip(starts, directions, strict=True):
        if is_in_elastomer(summed, *start) and np.hypot(*(start[:2] - FIRST)) > 3.1:
            here = top_hit(summed, INSIDE, *start, *direction, REACH_MM)[:2]
            there = top_hit(alone, INSIDE, *start, *direction, REACH_MM)[:2]
            found.append((*here, *there))
    t, what, t_alone, what_alone = np.array(found).T
    both = (what == CONTACT) & (what_alone == CONTACT)
    assert both.sum() > 100
    assert np.mean(what == what_alone) > 0.97
    # 0.5 mm of shank leans out by 0.017 mm
    assert np.abs(t - t_alone)[both].max() < 0.05 / 0.3
    assert np.median(np.abs(t - t_alone)[both]) < 0.01


def test_a_curve_that_folds_is_refused_by_name():
    press = wrapped_press()
    with pytest.raises(ModelScopeError, match=r"indentations\[3\]\[1\]"):
        flat_top((FIRST, dimple(1.0)), (SECOND, press), where="indentations[3]")


def test_contacts_that_overlap_are_refused_by_name():
    tips = [(FIRST, dimple(2.0)), (np.array([15.0, 15.0]), dimple(2.0))]
    with pytest.raises(ModelScopeError, match=r"indentations\[0\] and \[1\]: 4 mm apart, .* add up to 4\.89"):
        flat_top(*tips)
