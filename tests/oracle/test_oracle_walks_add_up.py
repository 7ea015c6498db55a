"""Energy, reciprocity and the pressed top in few rays, through the walk that draws single paths.

The tests of `trace_oracle` with many rays are slow; both walk the same way (the last test here).
"""

from __future__ import annotations

import math
from collections import Counter

import numpy as np
import pytest

from tests.oracle.form_scenes import crown_press, disc_scene
from tests.oracle.oracle_scenes import dimple, ring_scene, scene_of, wrapped_press
from tests.oracle.paths import LightWalker
from tests.oracle.tracer import CLASSES, trace_oracle

CENTRE = [14.0, 17.0]
WHITE = {"wall_reflectance": 1.0, "bottom_reflectance": 1.0, "tip_reflectance": 1.0}


def ends(scene, centre, press, emitter, rays, seed=1):
    """How many of an emitter's rays end with each fate at each receiver (-1: at none)."""
    paths = LightWalker(scene, centre, press, seed).random_paths(emitter, count=rays, most_rays=rays)
    return Counter((path.fate, path.receiver) for path in paths)


@pytest.mark.parametrize(
    ("scene", "press"),
    [
        (ring_scene(**WHITE), None),
        (ring_scene(**WHITE), dimple(2.0, 0.1)),
        (ring_scene(**WHITE), wrapped_press()),
        (disc_scene(crown_radius_mm=30.0, **WHITE), crown_press(2.0, 30.0, 0.1)),
    ],
    ids=["untouched", "pressed", "wrapped", "dome"],
)
def test_with_white_walls_and_tip_every_ray_is_received_or_leaves(scene, press):
    found = ends(scene, [14.0, 11.0], press, 1, 500)
    received = sum(number for (fate, _), number in found.items() if fate in CLASSES)
    escaped = sum(number for (fate, _), number in found.items() if fate == "escaped")
    assert received + escaped == found.total() == 500
    assert min(received, escaped) > 20


@pytest.mark.parametrize("press", [None, dimple(0.7, 0.1)], ids=["untouched", "pressed"])
def test_light_between_windows_of_one_size_is_reciprocal_in_few_rays(press):
    """Either window may shine, the other receives the same; both fill most of their wall, so many rays arrive."""
    box = {
        "wall_reflectance": 0.0,
        "bottom_reflectance": 0.0,
        "length_mm": 8.0,
        "width_mm": 8.0,
        "height_mm": 6.0,
    }
    south, east = [(0, 4.0, 3.0, 2.5, 2.5)], [(1, 4.0, 3.0, 2.5, 2.5)]
    forth = ends(scene_of(south, east, **box), [4.5, 4.0], press, 0, 20_000, seed=8)
    back = ends(scene_of(east, south, **box), [4.5, 4.0], press, 0, 20_000, seed=9)
    for name in ("direct", "top") if press is None else ("direct", "top", "skirt"):
        there, here = forth[name, 0], back[name, 0]
        error = math.sqrt(there + here)
        assert there > 5.0 * error, name
        assert abs(there - here) < 4.0 * error, name


def test_a_deep_press_between_a_facing_pair_ends_its_direct_light_in_few_rays():
    scene = scene_of([(3, 16.0, 4.0, 0.5, 0.5)], [(1, 16.0, 4.0, 1.3, 1.3)])
    assert ends(scene, [16, 16], None, 0, 20_000)["direct", 0] > 30
    pressed = ends(scene, [16, 16], wrapped_press(), 0, 20_000)
    assert pressed["direct", 0] == 0
    assert pressed["tip", -1] > 30


@pytest.mark.slow
@pytest.mark.parametrize(
    ("scene", "press"),
    [
        (ring_scene(tip_reflectance=0.3), dimple(2.0)),
        (disc_scene(crown_radius_mm=30.0), crown_press(2.0, 30.0)),
    ],
    ids=["pad", "dome"],
)
def test_single_paths_are_the_rays_that_the_oracle_counts(scene, press):
    light = trace_oracle(scene, [CENTRE], [press], rays=2_000, seed=1)
    counted = np.zeros_like(light.flux)
    for emitter in range(len(scene.emitter_wall)):
        for (fate, receiver), number in ends(scene, CENTRE, press, emitter, 2_000).items():
            if receiver >= 0:
                counted[CLASSES.index(fate), 0, emitter, receiver] = number
    assert counted == pytest.approx(light.flux * 2_000, abs=1e-6)
