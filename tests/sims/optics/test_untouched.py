"""What the untouched pad shares between seeds and settings."""

from dataclasses import fields

import numpy as np

from sims.optics import untouched
from sims.optics.accuracy import ACCURACIES
from sims.optics.untouched import UnshiftedPad, untouched_pad
from tests.bench.benchmark_states import benchmark_scene


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


def test_a_full_store_lets_the_oldest_go():
    store = {}
    for number in range(untouched.REMEMBERED_PADS + 3):
        untouched._remembered(store, str(number), lambda number=number: number)
    assert list(store.values()) == list(range(3, untouched.REMEMBERED_PADS + 3))
    assert untouched._remembered(store, "5", lambda: -1) == 5
