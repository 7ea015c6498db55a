"""The top of a crowned pad: where rays meet it, in the frame of a press off the apex, and what is tip there."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from optopad.design.errors import InputError, ModelScopeError
from optopad.sims.optics.scene.optical_scene import smooth_field
from tests.oracle.called_oracle_kernels import (
    is_in_elastomer,
    tip_hit,
    top_entry,
    top_exit,
)
from tests.oracle.form_scenes import (
    DISC_MM,
    crown_press,
    disc_form,
    disc_scene,
    displacement_mm,
    fall_mm,
    rectangle_form,
    vault_scene,
)
from tests.oracle.oracle_scenes import shank_press, wrapped_press
from tests.oracle.paths import LightWalker
from tests.oracle.surface import CONTACT, FREE, INSIDE, NOTHING, OUTSIDE, is_untouched
from tests.oracle.top import lower_presses
from tests.oracle.tracer import CLASSES, trace_oracle
from tests.oracle.walk import FATES
from tests.said import says

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


@pytest.mark.parametrize("depth_mm", [0.4, 2.0])
def test_light_that_ends_on_the_tip_of_a_dome_ends_on_the_tilted_sphere(depth_mm):
    scene = disc_scene(crown_radius_mm=CROWN_MM, bottom_reflectance=0.5)
    press = crown_press(depth_mm, CROWN_MM)
    walker = LightWalker(scene, PLACE, press, 1)
    paths = [path for path in walker.random_paths(0, [-1], count=3000, most_rays=10**5) if path.fate == "tip"]
    ends = np.array([path.places_mm[-1] for path in paths])
    foot, normal = sphere_frame(PLACE)
    out = ends - (foot + (3.0 - depth_mm) * normal)
    along = out @ normal
    across = np.linalg.norm(out - along[:, None] * normal, axis=1)
    on_sphere = along < 0.0  # above the equator light in air meets the shank
    assert on_sphere.sum() > 15
    assert np.linalg.norm(out, axis=1)[on_sphere] == pytest.approx(3.0, abs=1e-6)
    assert across[~on_sphere] == pytest.approx(3.0, abs=1e-6)
    straight = np.array([len(path.places_mm) == 2 for path in paths])  # these are still in the elastomer
    assert straight.any()
    assert across[straight].max() < press.contact_radius_mm + 1e-6


@pytest.mark.parametrize("axis", ["x", "y"])
def test_with_its_field_the_contact_on_a_vault_is_the_tilted_tip(axis):
    """The field carries the mean crown, a sphere of twice the radius, over to the cylinder's own shape."""
    scene = vault_scene(axis)
    press, reach, crown = crown_press(1.2, 60.0), 5.0, 30.0

    def field(x, y):
        u, v = x - reach, y - reach
        rho = np.hypot(u, v)
        fade = np.clip((rho - 2.5) / (reach - 2.6), 0.0, 1.0)
        return (fall_mm(v + 0.0 * u, crown) - fall_mm(rho, 2.0 * crown)) * (
            1.0 - fade**2 * (3.0 - 2.0 * fade)
        )

    grid = smooth_field(field, 2.0 * reach, 2.0 * reach, 0.1)
    place = np.array([14.0, 12.5])
    (top,) = lower_presses(scene, [place], [press], [replace(grid, origin_mm=np.full(2, -reach))])
    off = place - [12.0, 10.0]
    off[0 if axis == "x" else 1] = 0.0
    normal = np.array([*off, math.sqrt(crown**2 - off @ off)]) / crown
    foot = np.array([*place, 8.0 - crown + crown * normal[2]])
    centre = foot + (3.0 - 1.2) * normal
    rng = np.random.default_rng(4)
    touched = 0
    for _ in range(400):
        start = np.array([*(place + rng.uniform(-2.5, 2.5, 2)), 2.0])
        t, what, *n = top_exit(top, *start, 0.0, 0.0, 1.0, 20.0)
        out = start + t * np.array([0.0, 0.0, 1.0]) - centre
        across = np.linalg.norm(out - (out @ normal) * normal)
        assert (what == CONTACT) == (across < press.contact_radius_mm)
        if what == CONTACT:
            touched += 1
            # bicubic cells of 0.1 mm: 1e-8 mm off the field
            assert np.linalg.norm(out) == pytest.approx(3.0, abs=1e-7)
            assert np.array(n) == pytest.approx(-out / 3.0, abs=1e-5)
    assert touched > 80


def test_light_in_air_meets_the_tilted_tip():
    (top,) = lower_presses(disc_scene(crown_radius_mm=CROWN_MM), [PLACE], [crown_press(1.0, CROWN_MM)])
    foot, normal = sphere_frame(PLACE)
    centre = foot + 2.0 * normal
    side = np.cross(normal, [0.0, 0.0, 1.0])
    side /= np.linalg.norm(side)
    for height, half in ((0.0, 3.0), (-1.0, math.sqrt(8.0)), (20.0, 3.0)):
        start = centre + height * normal - 10.0 * side
        t, is_hit, *n = tip_hit(top, *start, *side, 50.0)
        assert is_hit
        assert t == pytest.approx(10.0 - half, abs=1e-9)
        assert np.array(n) @ side == pytest.approx(-half / 3.0, abs=1e-9)
    beside = centre + 20.0 * normal - 10.0 * side + 3.01 * np.cross(side, normal)
    assert not tip_hit(top, *beside, *side, 50.0)[1]


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


@pytest.mark.slow
@pytest.mark.parametrize("press", [None, crown_press(0.8, CROWN_MM, 0.05), crown_press(2.5, CROWN_MM, 0.1)])
def test_a_dome_pressed_at_its_apex_gives_the_light_of_the_surface_of_revolution(press):
    """On a flat pad, cones that follow dome and press out beyond the walls: other code, the same rays."""
    rays, radius = 30_000, np.linspace(0.0, 13.0, 1301)
    curve = replace(crown_press(0.8, CROWN_MM), depth_mm=1e-9, contact_radius_mm=0.0)
    raised = 0.0 * radius
    if press is not None:
        curve, raised = press, np.interp(radius, press.radius_mm, press.height_mm, right=0.0)
        radius = np.concatenate([press.radius_mm, radius[radius > press.radius_mm[-1] + 1e-3]])
        raised = np.concatenate([press.height_mm, np.zeros(len(radius) - len(press.radius_mm))])
    revolved = replace(curve, radius_mm=radius, height_mm=raised - fall_mm(radius, CROWN_MM))
    grey = {"wall_reflectance": 0.3, "tip_reflectance": 0.3, "absorption_per_mm": 0.01}
    apex = [[DISC_MM, DISC_MM]]
    dome = trace_oracle(disc_scene(crown_radius_mm=CROWN_MM, **grey), apex, [press], rays=rays, seed=3)
    cones = trace_oracle(disc_scene(**grey), apex, [revolved], rays=rays, seed=3)
    direct, crossing = CLASSES.index("direct"), CLASSES.index("crossing")
    # straight light depends on the shadow's edge alone, which is the same to 2 µm
    assert np.abs(dome.flux[direct] - cones.flux[direct]).max() < 2.5 / rays
    moved = np.abs(dome.total - cones.total).sum() + np.abs(dome.flux[crossing] - cones.flux[crossing]).sum()
    # the same rays meet surfaces up to 2 µm apart: few change their receiver, mostly after several reflections
    assert moved < 0.01 * cones.total.sum()


@pytest.mark.slow
def test_a_tip_by_its_curve_is_met_on_a_dome_where_the_same_hemisphere_is():
    sphere = crown_press(2.0, CROWN_MM, 0.1)
    by_curve = replace(sphere, is_hemisphere=False)
    first, second = (
        trace_oracle(disc_scene(crown_radius_mm=CROWN_MM), [PLACE], [press], rays=20_000, seed=4)
        for press in (sphere, by_curve)
    )
    # in air the tips differ, as a curve says nothing of the tip beyond the contact
    moved = np.abs(first.without_crossing - second.without_crossing).sum()
    assert moved < 0.002 * first.total.sum()


@pytest.mark.slow
def test_a_shank_in_a_dome_keeps_all_light():
    scene = disc_scene(crown_radius_mm=CROWN_MM, tip_reflectance=0.3, height_mm=9.0)
    light = trace_oracle(scene, [PLACE], [shank_press()], rays=2_000, seed=1)
    assert np.abs(light.ledger.sum(axis=0) - 1.0).max() < 1e-9
    assert light.ledger[FATES.index("unresolved")].max() == 0.0
    assert light.ledger[FATES.index("tip")].min() > 0.01


def test_an_untouched_crown_is_known_to_be_untouched():
    scene = disc_scene(crown_radius_mm=CROWN_MM)
    untouched, pressed = lower_presses(scene, [PLACE, PLACE], [None, crown_press(1.0, CROWN_MM)])
    assert is_untouched(untouched)
    assert not is_untouched(pressed)


@pytest.mark.parametrize(
    ("scene", "centre", "press", "field", "error", "message"),
    [
        (
            disc_scene(crown_radius_mm=CROWN_MM),
            [[10.0, 12.0], [15.0, 12.0]],
            [crown_press(1.0, CROWN_MM)] * 2,
            None,
            ModelScopeError,
            "indentations[0]: 2",
        ),
        (
            disc_scene(crown_radius_mm=CROWN_MM),
            [12.0, 12.0],
            None,
            smooth_field(lambda x, y: 0.0 * (x + y), 4.0, 4.0, 1.0),
            InputError,
            "indentations[0]",
        ),
        (
            disc_scene(crown_radius_mm=13.0, height_mm=10.0),
            [16.0, 12.0],
            crown_press(1.0, 13.0),
            None,
            ModelScopeError,
            "13 mm can ... 12.61 mm",
        ),
        (
            disc_scene(crown_radius_mm=CROWN_MM),
            [12.0, 12.0],
            replace(wrapped_press(), depth_mm=5.5),
            None,
            ModelScopeError,
            "indentations[0]",
        ),
    ],
)
def test_a_bad_press_on_a_form_is_refused_by_name(scene, centre, press, field, error, message):
    with pytest.raises(error) as caught:
        trace_oracle(scene, [centre], [press], fields=[field], rays=10)
    assert says(str(caught.value), message)


@pytest.mark.parametrize(
    "form",
    [
        disc_form(3, CROWN_MM),
        rectangle_form(24.0, 20.0, 30.0, "x"),
        rectangle_form(24.0, 20.0, 30.0, "y"),
        disc_form(3),
    ],
)
def test_the_frame_of_a_press_is_right_handed_and_its_crown_the_same_curve_as_the_top(form):
    origin, axes = form.top.press_frame(15.0, 12.5)
    assert axes @ axes.T == pytest.approx(np.eye(3), abs=1e-14)
    assert np.linalg.det(axes) == pytest.approx(1.0, abs=1e-12)
    step = 1e-5
    slopes = [
        (form.top.height_mm(15.0 + dx, 12.5 + dy) - form.top.height_mm(15.0 - dx, 12.5 - dy)) / (2.0 * step)
        for dx, dy in ((step, 0.0), (0.0, step))
    ]
    upright = np.array([-slopes[0], -slopes[1], 1.0])
    assert axes[2] == pytest.approx(upright / np.linalg.norm(upright), abs=1e-9)
    rng = np.random.default_rng(5)
    for u, v in rng.uniform(-5.0, 5.0, (50, 2)):
        across = math.hypot(u if form.top.straight is None else 0.0, v)
        fall = 0.0 if form.top.is_flat else float(fall_mm(across, form.top.radius_mm))
        x, y, z = origin + u * axes[0] + v * axes[1] - fall * axes[2]
        assert z == pytest.approx(float(form.top.height_mm(x, y)), abs=1e-12)
    if form.top.straight is not None:
        assert axes[0] == pytest.approx([1.0, 0.0, 0.0] if form.top.straight == "x" else [0.0, 1.0, 0.0])


def test_forms_have_one_text_only_where_they_are_the_same():
    form = disc_form(200, 30.0)
    moved = form.walls.copy()
    moved[100, 0] += 1e-12
    assert repr(form) == repr(replace(form))
    assert repr(form) != repr(replace(form, walls=moved))
