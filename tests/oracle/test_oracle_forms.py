"""Light in pads that are no flat rectangles: round outlines with facets, and convex tops."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache
from itertools import pairwise

import numpy as np
import pytest

from optopad.sims.optics.scene.optical_scene import smooth_field
from tests.oracle.form_scenes import (
    DISC_MM,
    block,
    crown_press,
    disc_form,
    disc_scene,
    parts,
    rectangle_form,
    vault_scene,
    with_top,
)
from tests.oracle.oracle_scenes import dimple, ring_scene, wrapped_press
from tests.oracle.paths import LightWalker, sample_paths
from tests.oracle.tracer import CLASSES, trace_oracle
from tests.oracle.walk import FATES

DIRECT, TOP, SKIRT, WALL, DIFFUSE, CROSSING = range(6)
CROWN_MM = 30.0


def fate(light, name):
    return light.ledger[FATES.index(name)]


@cache
def light_of(name):
    """Light of a pad that absorbs and scatters everywhere: untouched, and pressed off the apex."""
    grey = {
        "absorption_per_mm": 0.01,
        "wall_reflectance": 0.3,
        "bottom_reflectance": 0.3,
        "tip_reflectance": 0.3,
    }
    scene, press = {
        "disc": (disc_scene(**grey), dimple(2.0, 0.1)),
        "disc, folded": (disc_scene(**grey), wrapped_press()),
        "dome": (disc_scene(crown_radius_mm=CROWN_MM, **grey), crown_press(2.0, CROWN_MM, 0.1)),
        "dome, smooth walls": (
            disc_scene(crown_radius_mm=CROWN_MM, wall_index=1.0, **grey),
            crown_press(2.0, CROWN_MM, 0.1),
        ),
        "vault along x": (vault_scene("x", **grey), crown_press(2.0, 60.0, 0.1)),
        "vault along y": (vault_scene("y", **grey), crown_press(2.0, 60.0, 0.1)),
    }[name]
    return trace_oracle(scene, [[14.0, 9.0]] * 2, [None, press], rays=20_000, seed=1)


PADS = ("disc", "disc, folded", "dome", "dome, smooth walls", "vault along x", "vault along y")


@pytest.mark.slow
@pytest.mark.parametrize("name", PADS)
def test_all_light_is_accounted_for(name):
    light = light_of(name)
    assert np.abs(light.ledger.sum(axis=0) - 1.0).max() < 1e-9
    assert light.ledger[: len(CLASSES)] == pytest.approx(light.flux.sum(axis=3), abs=1e-12)
    assert (light.ledger >= 0.0).all()
    assert fate(light, "unresolved").max() == 0.0
    assert fate(light, "tip")[0].max() == 0.0
    assert fate(light, "tip")[1].min() > 0.0
    assert (light.flux[WALL].sum() > 0.0) == (name == "dome, smooth walls")


@pytest.mark.slow
@pytest.mark.parametrize("name", PADS)
def test_an_untouched_crown_has_top_light_and_no_skirt_light(name):
    flux = light_of(name).flux.sum(axis=(2, 3))
    assert flux[SKIRT, 0] == 0.0
    assert flux[CROSSING, 0] == 0.0
    assert flux[TOP, 0] > 0.0
    assert flux[SKIRT, 1] > 0.0


@pytest.mark.slow
@pytest.mark.parametrize("crown_mm", [math.inf, CROWN_MM])
def test_with_white_walls_and_tip_all_light_is_received_or_flies_over_the_walls(crown_mm):
    white = {"wall_reflectance": 1.0, "bottom_reflectance": 1.0, "tip_reflectance": 1.0}
    press = dimple(2.0, 0.1) if crown_mm == math.inf else crown_press(2.0, crown_mm, 0.1)
    light = trace_oracle(
        disc_scene(crown_radius_mm=crown_mm, **white), [[14.0, 9.0]], [press], rays=5_000, seed=3
    )
    received = light.ledger[: len(CLASSES)].sum(axis=0)
    # light between the tip and the surface close to it starts inside the tip by rounding
    assert received + fate(light, "escaped") == pytest.approx(1.0, abs=5e-4)
    assert received.min() > 0.05


STATES = {
    "untouched": ([[14.0, 17.0]], [None], None),
    "pressed": ([[14.0, 17.0]], [dimple(2.0, 0.1)], None),
    "folded, at a wall": ([[2.0, 28.0]], [wrapped_press()], None),
    "several": (
        [[[9.0, 9.0], [22.0, 20.0]]],
        [[dimple(2.0, 0.1), dimple(1.0)]],
        [smooth_field(lambda x, y: 0.01 * x - 0.008 * y, 32.0, 32.0, 4.0)],
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("state", STATES)
def test_a_rectangle_as_a_form_gives_the_bits_of_the_rectangle(state):
    centres, presses, fields = STATES[state]
    scene = ring_scene(wall_reflectance=0.4, tip_reflectance=0.3, wall_index=1.0, absorption_per_mm=0.01)
    as_form = replace(scene, form=rectangle_form(32.0, 32.0))
    plain, formed = (
        trace_oracle(pad, centres, presses, fields=fields, rays=5_000, seed=2) for pad in (scene, as_form)
    )
    for name in ("flux", "class_standard_error", "standard_error", "ledger"):
        assert np.array_equal(getattr(plain, name), getattr(formed, name))


@pytest.mark.slow
def test_direct_light_between_facets_is_that_of_small_windows():
    """cosθ₁ cosθ₂ A / (π d²), Lambertian; windows of 1 mm at 3 mm and more are off by less than (1/3)² / 4, 3 %."""
    facets = 12
    scene = block(
        disc_form(facets),
        (2 * DISC_MM, 2 * DISC_MM),
        **parts([(0, 1.5, 4.0, 0.1, 0.1)], [(k, 1.5, 4.0, 0.4, 0.4) for k in range(1, facets)]),
    )
    light = trace_oracle(scene, [[0, 0]], [None], rays=3_000_000, seed=4)
    apothem = math.sqrt(DISC_MM**2 - 1.5**2)
    angle = 2.0 * math.pi * np.arange(1, facets) / facets
    chord = 2.0 * apothem * np.sin(angle / 2.0)
    truth = np.sin(angle / 2.0) ** 2 * 0.64 / (math.pi * chord**2)
    error = light.class_standard_error[DIRECT, 0, 0]
    assert (
        np.abs(light.flux[DIRECT, 0, 0] - truth).max() < (4.0 * error + 0.03 * truth / chord**2 * 9.0).max()
    )
    assert light.flux[DIRECT, 0, 0].sum() == pytest.approx(truth.sum(), rel=0.04)


def bends(radius_mm, axis):
    return {name: 0.0 if axis == name[1] else 1.0 / radius_mm for name in ("kx", "ky")}


@pytest.mark.slow
@pytest.mark.parametrize("depth_mm", [0.0, 1.5])
@pytest.mark.parametrize("axis", ["none", "x"])
def test_a_crown_of_ten_metres_is_flat(axis, depth_mm):
    """The same rays: the top falls by 7 µm to the rim, so few of them end elsewhere."""
    press = dimple(depth_mm, 0.05) if depth_mm > 0.0 else None
    dome = disc_scene(crown_radius_mm=1e4) if axis == "none" else vault_scene(axis)
    lights = []
    for crown_mm in (math.inf, 1e4):
        scene = replace(dome, form=with_top(dome.form, **bends(crown_mm, axis)))
        lights.append(trace_oracle(scene, [[14.5, 10.0]], [press], rays=60_000, seed=5))
    flat, crowned = lights
    for name in (DIRECT, TOP, SKIRT, DIFFUSE, CROSSING):
        error = np.hypot(flat.class_standard_error[name], crowned.class_standard_error[name])
        assert (np.abs(flat.flux[name] - crowned.flux[name]) <= 4.0 * error).all()
    assert np.abs(flat.flux - crowned.flux).sum() < 0.02 * flat.total.sum()
    assert crowned.flux[TOP].sum() > 1e-3


def test_light_in_an_untouched_dome_is_mirrored_by_its_sphere():
    """Light that starts at the rim runs along under the dome, mirrored many times."""
    scene = disc_scene(crown_radius_mm=CROWN_MM, emitter_patch=np.tile([1.5, 5.0, 0.5, 0.4], (4, 1)))
    centre = np.array([DISC_MM, DISC_MM, 8.0 - CROWN_MM])
    chains = 0
    for path in LightWalker(scene, [0, 0], None, 1).random_paths(0, count=2000, most_rays=10**5):
        on_sphere = np.abs(np.linalg.norm(path.places_mm - centre, axis=1) - CROWN_MM) < 1e-9
        legs = np.diff(path.places_mm, axis=0)
        long = np.linalg.norm(legs, axis=1)
        for k in np.flatnonzero(on_sphere[1:-1]) + 1:
            normal = (path.places_mm[k] - centre) / CROWN_MM
            into, out = legs[k - 1] / long[k - 1], legs[k] / long[k]
            # each place is 1 nm off the leg's end by the nudge
            nudged = 4e-6 / min(long[k - 1], long[k])
            assert out == pytest.approx(into - 2.0 * (into @ normal) * normal, abs=1e-9 + nudged)
        assert path.fate != "top" or on_sphere[1:-1].all()
        chains += on_sphere[1:-1].sum() >= 3
    assert chains >= 10


def test_a_smooth_round_wall_mirrors_in_plan_about_its_own_normal():
    scene = disc_scene(2, wall_index=1.0, wall_reflectance=0.0, bottom_reflectance=0.0)
    seen = 0
    for name, places in sample_paths(scene, [0, 0], None, emitter=0, receiver=0, count=100, seed=2):
        if name != "wall":
            continue
        legs = np.diff(places, axis=0)
        nudged = 4e-6 / np.linalg.norm(legs, axis=1).min()  # places at the top are 1 nm off the leg's end
        legs /= np.linalg.norm(legs, axis=1)[:, None]
        for place, (into, out) in zip(places[1:-1], pairwise(legs), strict=True):
            off = np.array([place[0] - DISC_MM, place[1] - DISC_MM, 0.0]) / DISC_MM
            if np.linalg.norm(off) > 1.0 - 1e-9:
                assert np.linalg.norm(off) == pytest.approx(1.0, abs=1e-9)
                assert out == pytest.approx(into - 2.0 * (into @ off) * off, abs=1e-9 + nudged)
                seen += 1
    assert seen > 20


@pytest.mark.slow
@pytest.mark.parametrize("press", [None, crown_press(1.5, CROWN_MM, 0.1)])
def test_light_in_a_dome_is_reciprocal(press):
    """Windows of one size and Lambertian: either may shine, the other receives the same."""
    windows = [(0, 1.5, 4.0, 1.0, 1.0)], [(4, 1.5, 4.0, 1.0, 1.0), (5, 1.5, 4.0, 1.0, 1.0)]
    black = {"wall_reflectance": 0.0, "bottom_reflectance": 0.0}
    form, size = disc_form(8, CROWN_MM), (2 * DISC_MM, 2 * DISC_MM)
    place = [[14.0, 11.0]]
    forth = trace_oracle(block(form, size, **parts(*windows), **black), place, [press], rays=200_000, seed=8)
    back = trace_oracle(
        block(form, size, **parts(*windows[::-1]), **black), place, [press], rays=200_000, seed=9
    )
    for name in (DIRECT, TOP, SKIRT) if press is not None else (DIRECT, TOP):
        forward, backward = forth.flux[name, 0, 0], back.flux[name, 0, :, 0]
        error = np.hypot(forth.class_standard_error[name, 0, 0], back.class_standard_error[name, 0, :, 0])
        assert (forward / error).max() > 8.0
        assert np.abs((forward - backward)[error > 0.0] / error[error > 0.0]).max() < 4.0


@pytest.mark.slow
def test_a_press_on_a_dome_turned_by_the_angle_of_facets_turns_the_signals():
    scene = disc_scene(crown_radius_mm=CROWN_MM, wall_reflectance=0.3)
    turn = math.pi / 2.0  # two facets: emitters come to emitters
    places = np.array([[14.0, 9.0], [DISC_MM + 3.0, DISC_MM + 2.0]])
    off = places[0] - DISC_MM
    assert places[1] - DISC_MM == pytest.approx(
        [off[0] * math.cos(turn) - off[1] * math.sin(turn), off[0] * math.sin(turn) + off[1] * math.cos(turn)]
    )
    press = crown_press(2.0, CROWN_MM, 0.1)
    light = trace_oracle(scene, places, [press, press], rays=60_000, seed=10)
    turned = np.roll(light.total[0], (1, 1), axis=(0, 1))
    errors = np.hypot(np.roll(light.standard_error[0], (1, 1), axis=(0, 1)), light.standard_error[1])
    assert np.abs((turned - light.total[1]) / errors).max() < 4.0
    # the press is off the axis, so that signals not turned differ
    unturned = np.hypot(*light.standard_error)
    assert np.abs((light.total[0] - light.total[1]) / unturned).max() > 10.0


@pytest.mark.slow
def test_of_a_window_at_the_rim_only_what_lies_below_the_crown_shines():
    rim = 8.0 - CROWN_MM + math.sqrt(CROWN_MM**2 - DISC_MM**2)
    windows = parts([(0, 1.5, rim, 1.5, 1.0)], [(2, 1.5, 3.0, 1.0, 1.0)])
    scene = block(disc_form(4, CROWN_MM), (2 * DISC_MM, 2 * DISC_MM), **windows)
    light = trace_oracle(scene, [[0, 0]], [None], rays=100_000, seed=6)
    along = (np.arange(1000) + 0.5) * 3e-3 - 1.5
    top = 8.0 - CROWN_MM + np.sqrt(CROWN_MM**2 - DISC_MM**2 + 1.5**2 - along**2)
    bare = 0.5 - float(np.mean(top - rim)) / 2.0
    # 4 standard errors of a share of a half
    assert fate(light, "unsubmerged")[0, 0] == pytest.approx(bare, abs=4.0 * 0.5 / math.sqrt(100_000))
