"""Light in pads that are no flat rectangles: round outlines with facets, and convex tops."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import pairwise

import numpy as np
import pytest

from optopad.sims.optics.scene.optical_scene import smooth_field
from tests.oracle.form_scenes import (
    DISC_MM,
    crown_press,
    disc_scene,
    rectangle_form,
    vault_scene,
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


def bends(radius_mm, axis):
    return {name: 0.0 if axis == name[1] else 1.0 / radius_mm for name in ("kx", "ky")}


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
