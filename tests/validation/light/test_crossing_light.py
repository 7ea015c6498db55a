from __future__ import annotations

import numpy as np
import pytest

from tests.bench.measures.benchmark_states import benchmark_scene, different_walls
from tests.validation.light import crossing_light
from tests.validation.light.crossing_light import cells, kept, measured, only_emitter


@pytest.fixture
def made_up(tmp_path, monkeypatch):
    """A pad where every pair's signal is 0.004, and at the second place one pair has light that crosses."""

    def crossing(scene, centre_mm, presses, rays, seed):
        flux = np.zeros((len(presses), len(scene.emitter_wall), 8))
        if centre_mm[0] == 20.0:
            flux[-1, -1 if len(scene.emitter_wall) == 1 else 5, 2] = 8e-5
        return flux

    monkeypatch.setattr(crossing_light, "BUILD", tmp_path)
    monkeypatch.setattr(crossing_light, "crossing_flux", crossing)
    monkeypatch.setattr(crossing_light, "flat_flux", lambda: np.full((8, 8), 0.004))


def test_shares_are_of_the_pairs_own_undeformed_signal(made_up):
    places = np.array([[10.0, 10.0], [20.0, 12.0]])
    shallow, deep = measured("analytic", places, (1.0, 2.0), 10**6, "made-up")
    assert (shallow.mean, shallow.largest, shallow.rms) == (0.0, 0.0, 0.0)
    assert deep.largest == pytest.approx(0.02)
    assert deep.mean == pytest.approx(0.02 / (2 * 48))
    assert deep.where == (20.0, 12.0, 5, 2)
    # a count of 80 in a million, its noise taken off the square; 800 in the second measurement
    assert deep.rms == pytest.approx(np.sqrt((0.02**2 - 80.0 / 4000.0**2) / 96.0), rel=1e-3)
    assert deep.largest_error == pytest.approx(np.sqrt(800.0) / 40000.0, rel=1e-3)
    assert "5 → 2 at (20.0, 12.0) mm" in cells(deep)
    assert deep.is_clear
    assert "none above noise" in cells(shallow)


def test_a_finished_part_is_not_made_again(made_up):
    first = kept("part", lambda: np.arange(3.0))
    assert np.array_equal(kept("part", lambda: np.zeros(3)), first)


def test_one_emitter_of_the_scene_is_the_same_emitter():
    scene = benchmark_scene()
    one = only_emitter(scene, 5)
    assert np.array_equal(one.emitter_patch, scene.emitter_patch[5:6])
    assert different_walls(one).tolist() == different_walls(scene)[5:6].tolist()
