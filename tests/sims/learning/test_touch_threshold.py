"""Few false alarms, whatever the pad: made-up touches that no plane separates, and sets with gains of their own."""

from __future__ import annotations

import numpy as np
import pytest

from optopad.design.errors import InputError
from optopad.design.recordings import SetEntry
from optopad.sims.learning.samples import held_out, prepared, spread_samples
from optopad.sims.learning.touch_fit import FALSE_ALARMS, fit_plain_touch, fit_tuned_touch, untouched_limit
from optopad.sims.readings.press_data import PressData
from tests.sims.learning.pressed_pad import grid_mm, made_up_data

UNTOUCHED = np.array([[300.0, 150.0, 600.0], [80.0, 400.0, 250.0]])
DRIFT = 0.004


def made_up_sets(sets: int, seed: int, *, both_ways: bool) -> PressData:
    """Presses at 25 places, 30 depths each; a touch lowers both pairs of a receiver by up to 95 counts.

    `both_ways`: it changes one pair, and raises it at half the places.
    Gains of emitters and receivers differ from set to set by `DRIFT`.
    """
    chance = np.random.default_rng(seed)
    depth_mm = np.concatenate([np.arange(-1.0, 0.0, 0.1), np.arange(20) * 0.1])
    grid = np.stack(np.meshgrid(np.arange(5) * 4.0, np.arange(5) * 4.0), axis=-1).reshape(-1, 2)
    counts, press_mm = [], []
    for _ in range(sets):
        emitter, receiver = (1.0 + DRIFT * chance.standard_normal(count) for count in UNTOUCHED.shape)
        for place, at in enumerate(grid):
            changes = np.zeros((len(depth_mm), *UNTOUCHED.shape))
            touched = slice(place % 2, place % 2 + 1) if both_ways else slice(None)
            sign = 1.0 if both_ways and place % 4 > 1 else -1.0
            changes[:, touched, place % 3] = sign * 50.0 * np.maximum(depth_mm, 0.0)[:, None]
            lit = (UNTOUCHED + changes) * emitter[:, None] * receiver
            lit += chance.standard_normal(lit.shape)
            counts.append(np.concatenate([lit, np.zeros((len(lit), 1, 3))], axis=1))
            press_mm.append(np.column_stack([np.tile(at, (len(lit), 1)), depth_mm]))
    each = len(grid) * len(depth_mm)
    return PressData(
        counts=np.concatenate(counts).astype(np.float32),
        press_mm=np.concatenate(press_mm),
        time_s=np.arange(sets * each, dtype=np.float64),
        set_number=np.repeat(np.arange(sets), each),
        place_number=np.tile(np.repeat(np.arange(len(grid)), len(depth_mm)), sets),
        sets=tuple(
            SetEntry(name=f"set {k}", role="train", pattern="grid", is_ambient=False) for k in range(sets)
        ),
        state_names=("E1", "E2", "off"),
        receiver_names=("R1", "R2", "R3"),
        full_scale_counts=1023.0,
        design_digest="ab" * 32,
        attributes={},
        true_press_mm=None,
    )


@pytest.mark.parametrize("fit", [fit_plain_touch, fit_tuned_touch])
def test_where_no_plane_separates_touches_untouched_frames_of_new_sets_are_still_told(fit):
    train = prepared(made_up_sets(2, 0, both_ways=True))
    plane, facts = fit(train, np.random.default_rng(0), 40_000)
    later = made_up_sets(40, 1, both_ways=True)
    score = plane.score(later.features().astype(float))
    quiet = later.press_mm[:, 2] < 0.0
    assert facts["touch_moved"] > 0.0
    assert (score[quiet] + facts["touch_moved"] > 0.0).mean() > 0.9  # what the fit alone calls touched
    # two sets tell the drift from four changes of gain alone
    assert (score[quiet] > 0.0).mean() < 2.0 * FALSE_ALARMS


def test_a_plane_that_leaves_room_is_not_moved():
    train = prepared(made_up_sets(2, 0, both_ways=False))
    plane, facts = fit_plain_touch(train, np.random.default_rng(0), 40_000)
    assert facts["touch_moved"] == 0.0
    assert untouched_limit(plane, train) < 0.0


def test_the_limit_is_what_one_in_a_hundred_frames_of_new_sets_exceeds():
    plane, _ = fit_plain_touch(prepared(made_up_sets(2, 0, both_ways=True)), np.random.default_rng(0), 40_000)
    limit = untouched_limit(plane, prepared(made_up_sets(8, 2, both_ways=True)))
    later = made_up_sets(60, 3, both_ways=True)
    score = plane.score(later.features().astype(float))[later.press_mm[:, 2] < 0.0]
    middle = score.mean()
    # the drift is known from 7 x 4 changes of gain, to 13 %; the middle from eight sets
    assert limit - middle == pytest.approx(np.quantile(score, 1.0 - FALSE_ALARMS) - middle, rel=0.35)


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
