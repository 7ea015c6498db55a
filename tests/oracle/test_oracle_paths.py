from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from tests.oracle.called_oracle_kernels import is_in_elastomer
from tests.oracle.oracle_scenes import dimple, flat_top, ring_scene, wrapped_press
from tests.oracle.paths import sample_paths
from tests.oracle.tracer import CLASSES

CENTRE = np.array([15.0, 17.0])


@pytest.mark.parametrize("press", [None, dimple(0.5), dimple(3.0, 0.2), wrapped_press()])
def test_every_leg_of_a_path_is_wholly_in_the_elastomer_or_wholly_in_air(press):
    surface = flat_top() if press is None else flat_top((CENTRE, press))
    scene = ring_scene(wall_reflectance=0.5, bottom_reflectance=0.5, tip_reflectance=0.5)
    crossed = 0
    for name, places in sample_paths(scene, CENTRE, press, emitter=1, count=800, seed=1):
        in_air = []
        for start, end in pairwise(places):
            points = start + np.linspace(0.01, 0.99, 25)[:, None] * (end - start)
            assert (points[:, :2] > -1e-5).all()
            assert (points[:, :2] < 32.0 + 1e-5).all()
            # neighbouring pieces overlap by 1 nm, rays restart 1 nm beside the surface
            below, above = (
                [is_in_elastomer(surface, x, y, z + lift) for x, y, z in points] for lift in (-2e-6, 2e-6)
            )
            assert all(below) or not any(above)
            in_air.append(not all(below))
        assert not in_air or not in_air[0]
        assert name not in CLASSES or any(in_air) == (name == "crossing")
        assert name != "crossing" or not in_air[-1]
        assert name != "bottom" or not in_air[-1]
        crossed += any(in_air)
    assert (crossed > 3) == (press is not None)


def test_paths_to_a_receiver_start_on_the_emitter_and_end_on_it():
    scene = ring_scene()
    paths = sample_paths(scene, CENTRE, dimple(1.0), emitter=0, receiver=4, count=30, seed=2)
    assert len(paths) == 30
    assert {name for name, _ in paths} <= set(CLASSES)
    for name, places in paths:
        assert places[0, 1] == 0.0
        assert np.abs(places[0, [0, 2]] - scene.emitter_patch[0, :2]).max() <= 0.5
        assert places[-1, 1] == pytest.approx(32.0, abs=1e-9)
        assert np.abs(places[-1, [0, 2]] - scene.receiver_patch[4, :2]).max() <= 1.325 + 1e-9
        assert name != "direct" or len(places) == 2


def test_a_reflected_path_obeys_the_law_of_reflection():
    paths = sample_paths(ring_scene(), CENTRE, None, emitter=0, receiver=4, count=40, seed=3)
    mirrored = [places for name, places in paths if name == "top"]
    assert len(mirrored) >= 3
    for first, middle, last in mirrored:
        into, out = middle - first, last - middle
        into, out = into / np.linalg.norm(into), out / np.linalg.norm(out)
        assert out == pytest.approx(into * [1.0, 1.0, -1.0], abs=1e-6)


def test_paths_are_the_same_for_the_same_seed():
    first, second = (
        sample_paths(ring_scene(), CENTRE, dimple(2.0), emitter=3, count=20, seed=4) for _ in range(2)
    )
    for (name, places), (other, others) in zip(first, second, strict=True):
        assert name == other
        assert np.array_equal(places, others)
