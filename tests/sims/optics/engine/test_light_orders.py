"""Light scattered more than once: the patch radiosity against its own series, energy, and a grey box."""

from functools import cache

import numpy as np
import pytest

from optopad.sims.optics.accuracy import ACCURACIES
from optopad.sims.optics.engine.trace_states import trace_scene
from optopad.sims.optics.engine.untouched import PATCH_MM, RADIOSITY_PATCHES, packed, untouched_pad
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
