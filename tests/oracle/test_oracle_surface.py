from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from optopad.sims.optics.scene.optical_scene import smooth_field
from optopad.sims.press import GridTop
from tests.oracle.called_oracle_kernels import (
    is_in_elastomer,
    top_entry,
    top_exit,
    top_height,
    top_hit,
)
from tests.oracle.form_scenes import (
    DISC_MM,
    crown_press,
    disc_form,
    disc_scene,
    displacement_mm,
    fall_mm,
    vault_scene,
)
from tests.oracle.oracle_scenes import (
    dimple,
    dimple_height_mm,
    dimple_shape_mm,
    flat_top,
    ring_scene,
    wrapped_press,
)
from tests.oracle.surface import CONTACT, FREE, INSIDE, NOTHING, OUTSIDE
from tests.oracle.top import lower_presses
from tests.oracle.tracer import CLASSES, trace_oracle

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


def top_crossing(start, direction, side, limit):
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


@pytest.mark.parametrize(("side", "low", "high"), [(INSIDE, 4.0, 8.2), (OUTSIDE, 5.5, 9.0)])
def test_hits_agree_with_bisection_on_the_analytic_top(surface, side, low, high):
    starts, directions = rays(700, 2, low, high)
    met, wrong = 0, 0
    for start, direction in zip(starts, directions, strict=True):
        if is_in_elastomer(surface, *start) != (side == INSIDE):
            continue
        t, what, *normal = top_hit(surface, side, *start, *direction, REACH_MM)
        truth = top_crossing(start, direction, side, REACH_MM)
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


def test_a_top_that_is_given_as_a_grid_is_met_where_its_heights_are():
    at, step = np.array([15.0, 9.0]), 0.1
    x, y = (np.arange(0.0, LENGTH_MM + step, step) - along for along in at)
    places = np.stack(np.meshgrid(x + at[0], y + at[1], indexing="ij"))
    level = np.max(
        [press.contact_radius_mm - np.hypot(*(places - c[:, None, None])) for c, press in TIPS], axis=0
    )
    top = GridTop(at_mm=(15.0, 9.0), x_mm=x, y_mm=y, height_mm=top_mm(*places) - TOP_MM, level=level)
    (surface,) = lower_presses(ring_scene(), [at], [top])
    starts, directions = rays(600, 2, 4.0, 7.5)
    met, touched, wrong = 0, 0, 0
    for start, direction in zip(starts, directions, strict=True):
        truth = top_crossing(start, direction, INSIDE, REACH_MM)
        if not is_in_elastomer(surface, *start) or truth > REACH_MM:
            continue
        t, what, *normal = top_hit(surface, INSIDE, *start, *direction, REACH_MM)
        x_mm, y_mm, _ = start + truth * direction
        edge = max(press.contact_radius_mm - math.hypot(x_mm - c[0], y_mm - c[1]) for c, press in TIPS)
        met, touched = met + 1, touched + (what == CONTACT)
        # the spline is off by a few 0.1 µm where the curvature jumps, at the edges of the contacts
        wrong += abs(t - truth) > 5e-4 / max(float(direction @ normal), 1e-3)
        wrong += abs(edge) > step and what != (CONTACT if edge > 0.0 else FREE)
    assert met > 80
    assert touched > 20
    assert wrong <= 1


CROWN_MM, CLEAR_MM = 30.0, 8.0
PLACE = np.array([15.0, 9.5])
"""Off the apex of the round pad by 3.9 mm, where the top leans by 7.5 degrees."""


def sphere_frame(place):
    """Place on the dome, and its normal, from the centre of the sphere."""
    centre = np.array([DISC_MM, DISC_MM, CLEAR_MM - CROWN_MM])
    flat = place - centre[:2]
    foot = centre + np.array([*flat, math.sqrt(CROWN_MM**2 - flat @ flat)])
    return foot, (foot - centre) / CROWN_MM


def dome_clearance(points, depth_mm, bulge_mm):
    """Height of the pressed dome above (n, 3) points along the press' normal."""
    foot, normal = sphere_frame(PLACE)
    along = (points - foot) @ normal
    across = np.linalg.norm(points - foot - along[..., None] * normal, axis=-1)
    return -fall_mm(across, CROWN_MM) + displacement_mm(across, depth_mm, CROWN_MM, bulge_mm) - along


@pytest.mark.parametrize("side", [INSIDE, OUTSIDE])
def test_hits_agree_with_bisection_on_the_pressed_dome(side):
    depth, bulge = 1.5, 0.08
    (top,) = lower_presses(
        disc_scene(crown_radius_mm=CROWN_MM), [PLACE], [crown_press(depth, CROWN_MM, bulge)]
    )
    rng = np.random.default_rng(1)
    low, high = (
        ((9.0, 4.0, 4.0), (21.0, 15.0, 8.0)) if side == INSIDE else ((10.0, 4.0, 5.5), (20.0, 15.0, 9.0))
    )
    met, wrong = 0, 0
    for start in rng.uniform(low, high, (500, 3)):
        direction = rng.normal(size=3) * [1.0, 1.0, 0.5]
        direction /= np.linalg.norm(direction)
        inside = is_in_elastomer(top, *start)
        assert inside == bool(dome_clearance(start, depth, bulge) >= 0.0)
        if inside != (side == INSIDE):
            continue
        t = np.linspace(0.0, 7.0, 7_001)
        crossed = np.flatnonzero(side * dome_clearance(start + t[:, None] * direction, depth, bulge) <= 0.0)
        found = (top_exit if side == INSIDE else top_entry)(top, *start, *direction, 7.0)
        if found[1] == NOTHING or not crossed.size:
            wrong += found[1] != NOTHING or crossed.size > 0
            continue
        a, b = t[max(crossed[0] - 1, 0)], t[crossed[0]]
        for _ in range(40):
            m = 0.5 * (a + b)
            a, b = (m, b) if side * dome_clearance(start + m * direction, depth, bulge) > 0.0 else (a, m)
        met += 1
        normal = np.array(found[2:])
        assert np.linalg.norm(normal) == pytest.approx(1.0, abs=1e-12)
        # PCHIP through 400 points of the skirt is 2 µm off
        wrong += abs(found[0] - a) > 2e-6 / max(direction @ normal, 1e-4) + 1e-6
    assert met > 80
    assert wrong <= 1  # a graze within the sampling of the check itself


def test_an_untouched_dome_is_met_on_its_sphere_from_any_frame():
    """Far from a press that lifts nothing, rays meet the same sphere as with the frame at the apex."""
    scene = disc_scene(crown_radius_mm=13.0, height_mm=10.0)  # 67 degrees steep at the rim
    press = replace(crown_press(0.5, 13.0), contact_radius_mm=0.0)
    lifted_nowhere = replace(press, height_mm=0.0 * press.height_mm)
    centre = np.array([DISC_MM, DISC_MM, -3.0])
    rng = np.random.default_rng(2)
    for place in ([DISC_MM, DISC_MM], [DISC_MM + 1.2, DISC_MM - 0.7]):
        (top,) = lower_presses(scene, [place], [lifted_nowhere])
        for _ in range(300):
            r, angle = 11.9 * math.sqrt(rng.random()), 2.0 * math.pi * rng.random()
            x, y = DISC_MM + r * math.cos(angle), DISC_MM + r * math.sin(angle)
            z = rng.random() * (math.sqrt(169.0 - r * r) - 3.0)
            direction = rng.normal(size=3)
            direction /= np.linalg.norm(direction)
            o = np.array([x, y, z]) - centre
            truth = -(o @ direction) + math.sqrt((o @ direction) ** 2 - o @ o + 169.0)
            end = np.array([x, y, z]) + truth * direction
            if np.hypot(*(end[:2] - DISC_MM)) > 12.0 or end[2] < 0.0:
                continue
            t, what, *normal = top_exit(top, x, y, z, *direction, 60.0)
            assert what == FREE
            assert t == pytest.approx(truth, abs=1e-10)
            assert normal == pytest.approx((end - centre) / 13.0, abs=1e-9)


@pytest.mark.parametrize("axis", ["x", "y"])
def test_an_untouched_vault_is_met_on_its_cylinder_from_a_tilted_frame(axis):
    scene = vault_scene(axis)
    nowhere = crown_press(0.5, 60.0)
    nowhere = replace(nowhere, contact_radius_mm=0.0, height_mm=0.0 * nowhere.height_mm)
    (top,) = lower_presses(scene, [[15.0, 13.0]], [nowhere])
    rng = np.random.default_rng(3)
    met = 0
    for start in rng.uniform((1.0, 1.0, 0.5), (23.0, 19.0, 5.0), (200, 3)):
        direction = np.abs(rng.normal(size=3)) * [1.0, -1.0, 1.0]
        direction /= np.linalg.norm(direction)
        t, what, *normal = top_exit(top, *start, *direction, 60.0)
        x, y, z = start + t * direction
        if what == FREE and 0.0 < x < 24.0 and 0.0 < y < 20.0:
            met += 1
            across = x - 12.0 if axis == "y" else y - 10.0
            assert z == pytest.approx(8.0 - fall_mm(across, 30.0), abs=1e-9)
            lean = [across / 30.0, 0.0] if axis == "y" else [0.0, across / 30.0]
            assert normal[:2] == pytest.approx(lean, abs=1e-9)
    assert met > 60


@pytest.mark.slow
def test_without_an_index_step_an_empty_crater_in_a_dome_takes_nothing_away():
    """A dome is convex: the same rays arrive at the same receivers, through the crater or beside it."""
    # the parts so high that they see each other across the crater, as far as the rim allows: 6.8 mm
    patch = np.tile([1.5, 5.9, 0.5, 0.4], (4, 1))
    scene = disc_scene(
        crown_radius_mm=60.0, refractive_index=1.0, wall_reflectance=0.0, bottom_reflectance=0.0,
        emitter_patch=patch, receiver_patch=patch * [1.0, 1.0, 2.0, 2.0],
    )  # fmt: skip
    empty = replace(crown_press(2.5, 60.0, 0.1), contact_radius_mm=0.0)
    place = [[13.0, 15.5]]  # between facets 0 and 3
    whole = trace_oracle(scene, place, [None], rays=60_000, seed=1)
    pressed = trace_oracle(scene, place, [empty], rays=60_000, seed=1)
    direct, crossing = CLASSES.index("direct"), CLASSES.index("crossing")
    through = pressed.flux[direct, 0] + pressed.flux[crossing, 0]
    assert 60_000 * pressed.flux[crossing].sum() > 25.0
    assert np.array_equal(np.rint(60_000 * through), np.rint(60_000 * whole.flux[direct, 0]))


def test_forms_have_one_text_only_where_they_are_the_same():
    form = disc_form(200, 30.0)
    moved = form.walls.copy()
    moved[100, 0] += 1e-12
    assert repr(form) == repr(replace(form))
    assert repr(form) != repr(replace(form, walls=moved))
