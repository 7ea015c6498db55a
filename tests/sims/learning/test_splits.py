"""Halves are split by location, and a smaller share covers every press and depth."""

from __future__ import annotations

import numpy as np
import pytest

from optopad.design.errors import InputError
from optopad.sims.learning.samples import held_out, prepared, spread_samples
from tests.sims.learning.pressed_pad import grid_mm, made_up_data


def test_no_location_is_on_both_sides_of_a_split():
    data = prepared(made_up_data(grid_mm(5), sets=3))
    tested = held_out(data.location, 0.5, np.random.default_rng(0))
    places = data.press_mm[:, :2].round(1)
    inside, outside = (set(map(tuple, places[mask])) for mask in (tested, ~tested))
    assert not inside & outside
    assert (len(inside), len(outside)) == (12, 13)


@pytest.mark.parametrize("share", [0.0, 1.0])
def test_both_sides_have_a_location_whatever_the_share(share):
    tested = held_out(np.repeat(np.arange(4), 3), share, np.random.default_rng(0))
    assert tested.any()
    assert not tested.all()


def test_a_share_takes_equally_from_every_press_and_depth():
    press = np.repeat(np.arange(50), 100)
    depth_mm = np.tile(np.round(np.arange(100) * 0.05, 2), 50)
    chosen = spread_samples(press, depth_mm, 1003, np.random.default_rng(1))
    assert len(chosen) == 1003
    assert len(np.unique(chosen)) == 1003
    by_press = np.bincount(press[chosen])
    assert (by_press.min(), by_press.max()) == (20, 21)
    # evenly spread, 200 fall on each fifth of the depths; a step of five leaves at most one a press over
    assert np.abs(np.histogram(depth_mm[chosen], bins=5)[0] - 200.6).max() < 10
    assert len(np.unique(depth_mm[chosen])) == 100  # presses start at depths of their own


def test_few_samples_are_all_taken():
    assert spread_samples(np.zeros(5, int), np.arange(5.0), 9, np.random.default_rng(0)).tolist() == list(
        range(5)
    )


def test_the_same_grid_pressed_twice_has_each_location_once():
    data = prepared(made_up_data(grid_mm(4), sets=2))
    assert data.location.max() + 1 == 16
    assert data.press.max() + 1 == 32


def test_clipped_and_silent_pairs_are_left_out_and_named():
    made = made_up_data(grid_mm(4))
    made.counts[:, 0, 3] = 1023.0
    made.counts[:, 1, 2] = made.counts[:, -1, 2] + 7.0
    data = prepared(made)
    assert len(data.kept) == 62
    assert [line.rpartition(": ")[2] for line in data.left_out] == ["E1-R4", "E2-R3"]
    assert data.facts()["left_out"] == list(data.left_out)


def test_too_little_data_is_refused_with_what_there_is_and_what_it_takes():
    with pytest.raises(InputError, match="has 8 locations, needs >= 9"):
        prepared(made_up_data(grid_mm(4)[:8], sets=4))
    with pytest.raises(InputError, match="has 0 untouched samples, needs >= 50"):
        prepared(made_up_data(grid_mm(4), depths_mm=np.arange(0.0, 5.0, 0.25)))
    with pytest.raises(InputError, match="has 32 touched samples, needs >= 200"):
        prepared(made_up_data(grid_mm(4), depths_mm=np.array([-3.0, -2.0, -1.0, -0.5, 0.0, 1.0])))


def test_a_pad_whose_pairs_all_clip_is_refused_with_the_way_out():
    made = made_up_data(grid_mm(4))
    made.counts[:, :-1] = 1023.0
    with pytest.raises(InputError, match=r"only 0 pairs can be used.*lower the gain"):
        prepared(made)
