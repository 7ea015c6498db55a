"""Light scattered more than once: the patch radiosity against its own series, energy, and a grey box."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from optopad.design.draft import Draft
from optopad.design.preset import preset
from optopad.sims.optics.accuracy import ACCURACIES
from optopad.sims.optics.engine.trace_states import CLASS_NAMES, trace_scene
from optopad.sims.optics.engine.untouched import PATCH_MM, RADIOSITY_PATCHES, packed, untouched_pad
from optopad.sims.optics.tracing import trace
from tests.bench.measures.benchmark_states import (
    DEPTHS_MM,
    benchmark_scene,
    benchmark_states,
    different_walls,
)
from tests.oracle.oracle_scenes import dimple, ring_scene

SERIES = 80


@cache
def solved(**changes):
    return untouched_pad(ring_scene(**changes), ACCURACIES["draft"], 0)


def bounced_shares(pad):
    """What one more order makes of a deposit, from all orders: T = (I - S)^-1 - I, so S = I - (I + T)^-1."""
    transfer = pad.orders[2]
    return np.eye(len(transfer)) - np.linalg.inv(np.eye(len(transfer)) + transfer)


def test_all_orders_are_the_sum_of_the_orders():
    pad = solved(wall_reflectance=0.4, bottom_reflectance=0.3)
    once = bounced_shares(pad)
    total, order = np.zeros_like(once), np.eye(len(once))
    for _ in range(SERIES):
        order = order @ once
        total += order
    # what is left after 80 orders of at most 0.4 each is below 1e-30; the rest is rounding of two inversions
    assert np.abs(total - pad.orders[2]).max() < 1e-10


@pytest.mark.parametrize(
    "reflectance",
    [pytest.param(0.05, marks=pytest.mark.slow), 0.4, pytest.param(0.8, marks=pytest.mark.slow)],
)
def test_no_order_brings_more_light_than_the_one_before(reflectance):
    pad = solved(wall_reflectance=reflectance, bottom_reflectance=reflectance)
    shares = bounced_shares(pad)
    assert shares.min() > -1e-12
    assert shares.sum(axis=1).max() <= reflectance + 1e-9


def test_black_walls_scatter_nothing_twice():
    pad = solved(wall_reflectance=0.0, bottom_reflectance=0.0)
    assert (pad.orders[2] == 0.0).all()


def test_a_large_pad_gets_patches_that_are_few_enough():
    scene = ring_scene()
    box = packed(scene)[0]
    surface = 2 * (box[0] + box[1]) * box[2] + box[0] * box[1]
    layout = solved().orders[0]
    patches = (layout[:5, 0] * layout[:5, 1]).sum()
    # every side is rounded up to whole patches
    assert patches >= surface / max(PATCH_MM**2, surface / RADIOSITY_PATCHES)
    assert patches < 1.5 * RADIOSITY_PATCHES


def test_the_press_takes_a_smaller_share_of_scattered_light_between_brighter_walls():
    """Of the pairs that lose most between dark walls: later orders come from everywhere, also round the dimple."""
    place, press = np.array([[16.0, 16.0]]), [dimple(3.0, 0.1)]
    kept = []
    for reflectance in (0.02, 0.6):
        changes = {"wall_reflectance": reflectance, "bottom_reflectance": reflectance}
        pressed = trace_scene(ring_scene(**changes), place, press, accuracy="draft").flux[-1, 0]
        kept.append(pressed / solved(**changes).diffuse)
    losers = np.argsort(kept[0], axis=None)[:8]
    assert (kept[0].ravel()[losers] < 0.95).all()
    assert kept[1].ravel()[losers].mean() > kept[0].ravel()[losers].mean()


DIFFUSE = CLASS_NAMES.index("diffuse")
STATE = 4 * len(DEPTHS_MM) + 3
SEEDS = 12


def scattered(ray_share: float) -> np.ndarray:
    """(seed, emitter, receiver) scattered light of a press."""
    scene, states = benchmark_scene(), benchmark_states("analytic").some([STATE])
    settings = replace(ACCURACIES["score"], ray_share=ray_share)
    return np.array(
        [
            trace_scene(scene, states.centres_mm, states.indentations, accuracy=settings, seed=seed).flux[
                DIFFUSE, 0
            ]
            for seed in range(SEEDS)
        ]
    )


def test_rays_left_to_chance_leave_the_mean_as_it_is():
    followed, by_chance = scattered(0.0), scattered(2.0)
    judged = different_walls(benchmark_scene())
    off = (by_chance.mean(axis=0) - followed.mean(axis=0))[judged]
    error = np.sqrt((by_chance.var(axis=0, ddof=1) + followed.var(axis=0, ddof=1))[judged] / SEEDS)
    # chance is at work, and the differences are of the size that their scatter over the seeds tells
    assert by_chance[:, judged].std(axis=0).mean() > 1.2 * followed[:, judged].std(axis=0).mean()
    assert 0.5 < np.sqrt(np.mean((off / error) ** 2)) < 1.6
    assert abs(off.sum()) < 0.01 * followed.mean(axis=0)[judged].sum()


@pytest.mark.slow
def test_parts_near_the_top_get_no_spikes_of_scattered_light():
    design = preset("piacenza2017-pad")
    presses = np.array([[19.92, 11.85, 0.0], [19.92, 11.85, 4.9]])
    exact = trace(Draft.of(design), presses, accuracy="fine", seed=901)
    for seed in (5, 105, 205):
        rough = trace(Draft.of(design), presses, accuracy="score", seed=seed)
        off = rough.by_class["diffuse"][1] - exact.by_class["diffuse"][1]
        # with undivided cells 4 % of a pair's signal at the second of these seeds
        assert np.abs(off / exact.flux[0])[exact.flux[0] > 0.1 * exact.flux[0].max()].max() < 0.005


MIRRORED = [CLASS_NAMES.index("top"), CLASS_NAMES.index("skirt")]
DIM_STATE, EMITTER, RECEIVER = 10 * len(DEPTHS_MM) + DEPTHS_MM.index(2.0), 6, 0
DIM_SEEDS = 16


def scatter(repeat_share: float) -> float:
    """Standard deviation over seeds of a dim pair's mirrored light, over its untouched signal."""
    scene, states = benchmark_scene(), benchmark_states("analytic")
    pairs = np.zeros((8, 8), dtype=np.bool_)
    pairs[EMITTER] = True
    settings = replace(ACCURACIES["standard"], repeat_share=repeat_share)
    found = []
    for seed in range(DIM_SEEDS):
        raw = trace_scene(
            scene,
            states.centres_mm[[DIM_STATE, DIM_STATE]],
            [None, states.indentations[DIM_STATE]],
            accuracy=settings,
            seed=seed,
            pairs=pairs,
        )
        found.append(raw.flux[MIRRORED, 1, EMITTER, RECEIVER].sum() / raw.flux[:, 0, EMITTER, RECEIVER].sum())
    return float(np.std(found, ddof=1))


@pytest.mark.slow
def test_a_dim_pair_scatters_less_the_less_a_sample_stands_for():
    rough, fine = scatter(1e-2), scatter(5e-4)
    # by the emitter's brightest pair, and one sample for each cell whose light ends together, both were 0.0018
    assert fine < 0.4 * rough
    assert fine < 0.0008
