"""What the untouched pad shares between seeds and settings."""

from dataclasses import fields, replace

import numpy as np
import pytest

from optopad.sims.optics.accuracy import ACCURACIES
from optopad.sims.optics.engine import untouched
from optopad.sims.optics.engine.untouched import UnshiftedPad, untouched_pad
from tests.bench.measures.benchmark_states import benchmark_scene, different_walls


def test_seeds_and_settings_of_equal_rays_share_one_solution(monkeypatch):
    solved = []
    real = untouched._solved
    monkeypatch.setattr(untouched, "_UNSHIFTED", {})
    monkeypatch.setattr(untouched, "_UNTOUCHED", {})
    monkeypatch.setattr(untouched, "_solved", lambda *given: solved.append(given) or real(*given))
    scene = benchmark_scene()
    pads = [
        untouched_pad(scene, ACCURACIES[name], seed)
        for name in ("draft", "score", "standard")
        for seed in (0, 1)
    ]
    assert len(solved) == 1
    assert untouched_pad(scene, ACCURACIES["standard"], 1) is pads[-1]
    for pad in pads[1:]:
        for field in fields(UnshiftedPad):
            assert getattr(pad, field.name) is getattr(pads[0], field.name)
    assert not np.array_equal(pads[0].shifts, pads[1].shifts)


@pytest.mark.slow
def test_scattered_light_does_not_hang_on_the_size_of_patches(monkeypatch):
    """All pairs between different walls together, of their scattered light; patches of 1 mm were 0.2 to 0.3 % off."""
    scene, found = benchmark_scene(), {}
    judged = different_walls(scene)
    settings = replace(ACCURACIES["standard"], reference_rays=262144)
    for size_mm in (untouched.REFERENCE_PATCH_MM, untouched.REFERENCE_PATCH_MM / 2):
        monkeypatch.setattr(untouched, "_UNSHIFTED", {})
        monkeypatch.setattr(untouched, "_UNTOUCHED", {})
        monkeypatch.setattr(untouched, "REFERENCE_PATCH_MM", size_mm)
        found[size_mm] = untouched_pad(scene, settings, 0).diffuse[judged].sum()
    coarse, fine = found.values()
    assert abs(coarse / fine - 1.0) < 1e-3


def test_a_full_store_lets_the_oldest_go():
    store = {}
    for number in range(untouched.REMEMBERED_PADS + 3):
        untouched._remembered(store, str(number), lambda number=number: number)
    assert list(store.values()) == list(range(3, untouched.REMEMBERED_PADS + 3))
    assert untouched._remembered(store, "5", lambda: -1) == 5
