"""Light through a pressed top: limits, symmetry, sameness, smoothness, errors that cover."""

from dataclasses import replace
from functools import cache

import numba
import numpy as np
import pytest

from optopad.sims.optics.engine.trace_states import ACCURACIES, CLASS_NAMES, trace_scene
from tests.oracle.oracle_scenes import scene_of
from tests.sims.optics.surface.analytic import compact_dimple

PLACES = (4.0, 12.0, 20.0, 28.0)
DIRECT, TOP, SKIRT, WALL, DIFFUSE = range(5)


def pad(**changes):
    """Square pad of 32 x 32 x 8 mm, emitters and receivers in turn round its walls."""
    row = [(wall, along) for wall in range(4) for along in (PLACES if wall < 2 else PLACES[::-1])]
    emitters = [(wall, along, 4.0, 0.5, 0.5) for wall, along in row[0::2]]
    receivers = [(wall, along, 4.0, 1.325, 1.325) for wall, along in row[1::2]]
    return scene_of(emitters, receivers, **changes)


def pair(**changes):
    """One emitter facing one receiver across 20 mm."""
    values = {
        "length_mm": 20.0,
        "width_mm": 20.0,
        "emitter_wall": np.array([3]),
        "emitter_patch": np.array([[10.0, 5.0, 0.5, 0.5]]),
        "emitter_order": np.ones(1),
        "receiver_wall": np.array([1]),
        "receiver_patch": np.array([[10.0, 5.5, 1.325, 1.325]]),
    }
    return pad(**(values | changes))


@cache
def pressed_pad(accuracy="standard", seed=0):
    places = np.array([[16.0, 16.0], [11.0, 9.0], [20.0, 14.0], [9.0, 21.0]])
    dimples = [compact_dimple(depth, bulge_mm=0.03 * depth) for depth in (0.5, 1.5, 3.0, 4.5)]
    return trace_scene(pad(), places, dimples, accuracy=accuracy, seed=seed)


def test_a_vanishing_press_leaves_the_untouched_signal():
    given = pad()
    raw = trace_scene(given, np.array([[16.3, 15.8]] * 2), [None, compact_dimple(1e-5)])
    flux = raw.flux.sum(axis=0)
    judged = raw.flux[DIRECT, 0] > 0
    assert flux[1][judged] == pytest.approx(flux[0][judged], rel=1e-3)
    assert raw.flux[DIFFUSE, 1] == pytest.approx(raw.flux[DIFFUSE, 0], rel=5e-3)


@pytest.mark.slow
def test_two_methods_agree_on_light_mirrored_by_a_curved_top():
    scene, place, pile_up = pair(), np.array([[10.0, 2.6]]), [compact_dimple(0.3, bulge_mm=0.1)]
    # the analytic dimple is known by points, its curvature jumps from piece to piece: many nodes
    settings = replace(ACCURACIES["fine"], few_emitter=8, few_receiver=16, most_emitter=8, most_receiver=16)
    by_path = trace_scene(scene, place, pile_up, accuracy=settings)
    settings = replace(ACCURACIES["fine"], whole_ratio=0.0, image_step=0.02)
    by_cells = trace_scene(scene, place, pile_up, accuracy=settings)
    flux, expected = (raw.flux[TOP : SKIRT + 1].sum() for raw in (by_cells, by_path))
    assert flux == pytest.approx(expected, rel=1e-3)
    untouched = trace_scene(scene, place, [None]).flux[TOP].sum()
    assert abs(flux / untouched - 1) > 0.003


def test_a_deep_press_between_a_pair_blocks_its_straight_light():
    scene = pair()
    raw = trace_scene(scene, np.full((3, 2), 10.0), [None, compact_dimple(1.0), compact_dimple(6.5)])
    direct = raw.flux[DIRECT, :, 0, 0]
    assert direct[1] == pytest.approx(direct[0], rel=1e-9)
    assert direct[2] < 0.01 * direct[0]


def test_signals_follow_a_quarter_turn_of_pad_and_press():
    given, dimple = pad(), [compact_dimple(2.0, bulge_mm=0.05)]
    here = trace_scene(given, np.array([[13.0, 18.0]]), dimple)
    turned = trace_scene(given, np.array([[32.0 - 18.0, 13.0]]), dimple)
    moved = np.roll(here.flux[:, 0], (2, 2), axis=(1, 2))
    error = 4 * np.sqrt(np.mean(here.standard_error**2)) + 1e-7
    assert np.sqrt(np.mean((moved - turned.flux[:, 0]).sum(axis=0) ** 2)) < error
    assert turned.flux[DIRECT, 0] == pytest.approx(moved[DIRECT], rel=1e-6)


def test_a_pair_mask_gives_the_same_bits_as_the_full_trace_of_those_pairs():
    given, dimple, place = pad(), [compact_dimple(2.0, bulge_mm=0.05)], np.array([[13.0, 18.0]])
    mask = np.zeros((8, 8), dtype=bool)
    mask[1, [3, 6]] = True
    full = trace_scene(given, place, dimple)
    some = trace_scene(given, place, dimple, pairs=mask)
    for name in (DIRECT, TOP, SKIRT, DIFFUSE):
        assert some.flux[name, 0][~mask].max() == 0.0
    calm = full.flux[:, 0][:, mask]
    assert some.flux[:, 0][:, mask] == pytest.approx(calm, abs=2e-3 * full.flux[:, 0].sum(0)[mask].min())
    assert (some.flux[[DIRECT, DIFFUSE], 0][:, mask] == full.flux[[DIRECT, DIFFUSE], 0][:, mask]).all()


def test_a_mask_per_state_is_that_mask_in_each_state():
    given, place = pad(), np.array([[13.0, 18.0]] * 2)
    dimples = [compact_dimple(2.0), None]
    mask = np.zeros((2, 8, 8), dtype=bool)
    mask[0, 1, 3] = mask[1, 2, 5] = True
    raw = trace_scene(given, place, dimples, pairs=mask)
    assert ((raw.flux.sum(axis=0) > 0) == mask).all()


def test_same_seed_gives_same_bits_whatever_the_thread_count():
    given = pad()
    places = np.array([[16.0, 16.0], [11.0, 9.0], [20.0, 14.0]])
    dimples = [compact_dimple(depth) for depth in (0.5, 1.5, 3.0)]
    threads = numba.get_num_threads()
    results = []
    for count in (1, threads):
        numba.set_num_threads(count)
        results.append(trace_scene(given, places, dimples, seed=3, accuracy="draft"))
    numba.set_num_threads(threads)
    assert (results[0].flux == results[1].flux).all()
    assert (results[0].standard_error == results[1].standard_error).all()


def test_another_seed_changes_bits_only_within_the_error():
    one, two = pressed_pad(seed=0), pressed_pad(seed=1)
    difference = (one.flux - two.flux).sum(axis=0)
    spread = np.sqrt(np.mean(one.standard_error**2) + np.mean(two.standard_error**2))
    assert 0 < np.sqrt(np.mean(difference**2)) < 3 * spread


def test_states_do_not_depend_on_their_neighbours():
    dimple, place = compact_dimple(1.5, bulge_mm=0.045), np.array([[11.0, 9.0]])
    alone = trace_scene(pad(), place, [dimple])
    assert (alone.flux[:, 0] == pressed_pad().flux[:, 1]).all()


def test_an_untouched_state_has_no_error_and_no_skirt_light():
    raw = trace_scene(pad(), np.zeros((1, 2)), [None])
    assert raw.standard_error.max() == 0.0
    assert raw.flux[SKIRT].max() == 0.0
    assert raw.flux[TOP].sum() > 0.0


def test_no_receiver_gains_more_than_the_emitters_give():
    raw = pressed_pad()
    assert (raw.flux >= 0.0).all()
    assert raw.flux.sum(axis=(0, 3)).max() < 0.2
    assert len(CLASS_NAMES) == len(raw.flux)


def test_signal_is_smooth_in_depth_between_noise_steps():
    depths = np.arange(0.5, 3.5, 0.05)
    scene = pair()
    raw = trace_scene(scene, np.full((len(depths), 2), 10.0), [compact_dimple(d) for d in depths])
    signal = raw.flux.sum(axis=0)[:, 0, 0]
    unit_noise_gain = np.sqrt(20.0)
    rough = np.diff(signal, n=3) / unit_noise_gain / signal.max()
    noise_share = 0.003
    assert np.sqrt(np.mean(rough**2)) < noise_share / 3
    assert np.abs(rough).max() < noise_share


@pytest.mark.slow
def test_a_bright_tip_adds_light_and_only_diffuse_light():
    dimple, place = [compact_dimple(4.0)], np.array([[16.0, 14.0]])
    dark = trace_scene(pad(), place, dimple, accuracy="draft")
    bright = trace_scene(pad(tip_reflectance=0.5), place, dimple, accuracy="draft")
    assert (bright.flux[:DIFFUSE] == dark.flux[:DIFFUSE]).all()
    assert bright.flux[DIFFUSE].sum() > 1.05 * dark.flux[DIFFUSE].sum()


def test_absorption_dims_every_class():
    dimple, place = [compact_dimple(1.0)], np.array([[10.0, 7.0]])
    clear = trace_scene(pair(), place, dimple).flux[:, 0, 0, 0]
    dim = trace_scene(pair(absorption_per_mm=0.01), place, dimple).flux[:, 0, 0, 0]
    assert np.exp(-0.01 * 21) < dim[DIRECT] / clear[DIRECT] < np.exp(-0.01 * 20)
    assert np.exp(-0.01 * 30) < dim[SKIRT] / clear[SKIRT] < np.exp(-0.01 * 20)
    assert dim[DIFFUSE] < clear[DIFFUSE] * np.exp(-0.01 * 20)


@pytest.mark.slow
def test_standard_error_covers_the_difference_to_a_fine_trace():
    reference = pressed_pad("fine", 7)
    raw = pressed_pad()
    judged = reference.flux[DIRECT] > 0
    difference = (raw.flux - reference.flux).sum(axis=0)[judged]
    claimed = np.sqrt(np.mean(raw.standard_error[judged] ** 2))
    assert np.sqrt(np.mean(difference**2)) < 2.5 * claimed


@pytest.mark.slow
def test_error_on_pressed_states_is_below_a_third_of_a_percent():
    reference, raw = pressed_pad("fine", 7), pressed_pad()
    untouched = trace_scene(pad(), np.zeros((1, 2)), [None]).flux.sum(axis=0)[0]
    judged = np.broadcast_to(reference.flux[DIRECT].max(axis=0) > 0, raw.standard_error.shape)
    relative = ((raw.flux - reference.flux).sum(axis=0) / untouched)[judged]
    assert np.sqrt(np.mean(relative**2)) < 0.003
    assert np.median(np.abs(relative)) < 0.001


def test_depth_on_its_own_does_not_change_a_pair_out_of_reach():
    near = replace(pair(length_mm=60.0), emitter_wall=np.array([0]), receiver_wall=np.array([2]))
    raw = trace_scene(near, np.array([[50.0, 10.0]] * 2), [None, compact_dimple(2.0, outer_radius_mm=8.0)])
    assert (raw.flux[[DIRECT, TOP], 1] == raw.flux[[DIRECT, TOP], 0]).all()
