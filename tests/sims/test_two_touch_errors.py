"""Errors of two touches: the table, on data, and the states that a prediction draws."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from optopad.design.draft import Draft
from optopad.design.errors import InputError, ModelScopeError
from optopad.design.preset import preset
from optopad.sims.learning.inference.signal_map import SignalMapModel
from optopad.sims.learning.inference.together import Together
from optopad.sims.learning.inference.touch_model import UNIT_SIGMA
from optopad.sims.learning.inference.two_touches import Touches
from optopad.sims.readings.press_data import PressData, SetEntry
from optopad.sims.two_touch_errors import (
    LEAST_MM,
    ROWS_RADII,
    drawn_touches,
    errors_on_data,
    knows_two,
    require_touches,
    two_touch_errors,
)
from tests.said import pattern
from tests.sims.learning.made_up_map import (
    COUNT,
    EMITTERS,
    RECEIVERS,
    made_up_map_model,
    ratios,
    untouched_counts,
)

NONE = [np.nan, np.nan, np.nan]
PAD = preset("piacenza2017-pad")


def of_two() -> SignalMapModel:
    """The made-up model, whose pairs of touches have the product of both ratios."""
    together = Together(
        radius_mm=3.0,
        errors=np.zeros(3),
        floor_counts=np.full(COUNT * COUNT, 0.8),
        threshold=15.0,
        sigma=UNIT_SIGMA,
    )
    return replace(made_up_map_model(), together=together)


def data_of(touches_mm: np.ndarray, seed: int = 1) -> PressData:
    """Frames of touches (n, k, 3), the first of which is the press of the data, with noise and a dark state of 2."""
    press = np.nan_to_num(touches_mm, nan=-1.0)
    signals = untouched_counts() * np.prod([ratios(press[:, k]) for k in range(press.shape[1])], axis=0)
    lit = 2.0 + signals + 0.5 * np.random.default_rng(seed).normal(size=signals.shape)
    counts = np.concatenate([lit.reshape(-1, COUNT, COUNT), np.full((len(lit), 1, COUNT), 2.0)], axis=1)
    return PressData(
        counts=counts.astype(np.float32),
        press_mm=press[:, 0],
        others_mm=touches_mm[:, 1:],
        time_s=np.arange(len(lit), dtype=np.float64),
        set_number=np.zeros(len(lit), dtype=np.int64),
        place_number=np.arange(len(lit)),
        sets=(SetEntry(name="a", role="test", pattern="random", is_ambient=False),),
        state_names=(*EMITTERS, "off"),
        receiver_names=RECEIVERS,
        full_scale_counts=1023.0,
    )


def test_touches_are_matched_by_the_smaller_sum_of_distances_and_counted_by_distance() -> None:
    true = [
        [[10.0, 10.0, 1.0], [17.0, 10.0, 2.0]],  # 7 mm apart, told in the other order
        [[10.0, 10.0, 1.0], [17.0, 10.0, 2.0]],  # told as one
        [[10.0, 10.0, 1.0], [20.0, 10.0, 0.2]],  # too light for the table
        [[10.0, 10.0, 1.0], [30.0, 10.0, 1.0]],  # 20 mm apart
        [[10.0, 10.0, 1.0], NONE],
        [NONE, [10.0, 10.0, 1.0]],
        [[10.0, 10.0, -1.0], NONE],
    ]
    said = [
        [[17.0, 10.3, 2.1], [10.4, 10.0, 1.0]],
        [[13.0, 10.0, 1.0], NONE],
        [[10.0, 10.0, 1.0], NONE],
        [[10.0, 10.0, 1.0], [30.0, 10.0, 1.5]],
        [[10.0, 10.0, 1.0], NONE],
        [[10.0, 10.0, 1.0], [20.0, 10.0, 1.0]],
        [NONE, NONE],
    ]
    press = np.array(said)
    zeros = np.zeros(len(press))
    found = Touches(
        count=np.isfinite(press[..., 2]).sum(axis=1),
        touch_score=zeros,
        second_score=zeros,
        press_mm=press,
        sigma_mm=press,
        force_n=None,
    )
    made = two_touch_errors("signal-map", found, np.array(true), 3.0)
    near, far = made.rows
    assert (near.from_mm, near.to_mm, near.frames, near.found) == (6.0, 7.5, 2, 0.5)
    assert near.location_mm == pytest.approx((0.35, 0.395))
    assert near.depth_mm == pytest.approx((0.05, 0.095))
    assert (far.from_mm, far.to_mm, far.frames, far.found) == (18.0, np.inf, 1, 1.0)
    assert far.depth_mm == pytest.approx((0.25, 0.475))
    assert (made.single_frames, made.called) == (2, (0.0, 0.5, 0.5))
    document = made.to_json()
    assert document["separations"][1]["to_mm"] is None
    assert document["separations"][0]["from_radii"] == 2.0
    assert document["single"] == {"frames": 2, "called": {"none": 0.0, "one": 0.5, "two": 0.5}}


def test_a_model_of_two_finds_touches_far_apart_in_data() -> None:
    chance = np.random.default_rng(3)
    first = np.column_stack([chance.uniform(7.0, 12.0, (40, 2)), chance.uniform(1.0, 3.0, 40)])
    other = np.column_stack([chance.uniform(20.0, 25.0, (40, 2)), chance.uniform(1.0, 3.0, 40)])
    other[::4] = NONE
    first[1::4, 2] = -1.0  # the press of the data is lifted, the other tip touches
    model = of_two()
    assert knows_two(model)
    assert not knows_two(made_up_map_model())
    made = errors_on_data("signal-map", model, data_of(np.stack([first, other], axis=1)))
    assert sum(row.frames for row in made.rows) == 20
    for row in made.rows:
        assert row.found == 1.0
        assert row.location_mm is not None
        assert row.location_mm[1] < 0.5
    assert made.single_frames == 20
    assert made.called is not None
    assert made.called[1] >= 0.95
    alone = errors_on_data("signal-map", model, data_of(first[:, None]))
    assert (alone.rows, alone.single_frames) == ((), 30)


def test_three_touches_are_refused() -> None:
    three = np.tile([[10.0, 10.0, 1.0], [20.0, 10.0, 1.0], [10.0, 20.0, 1.0]], (12, 1, 1))
    three[:5, 2] = NONE
    with pytest.raises(
        InputError, match=pattern("7 of 12 frames have 3 touches, first in sample 6 ... one or two")
    ):
        errors_on_data("signal-map", of_two(), data_of(three))
    with pytest.raises(InputError, match="touches: 3 is refused; the models know one or two"):
        require_touches(3)


def test_two_touches_need_a_hemisphere() -> None:
    cone = Draft.of(PAD.with_(**{"indenter.shape": "cone"}))
    require_touches(1, cone)
    with pytest.raises(ModelScopeError, match=pattern("indenter.shape: cone ... set it to hemisphere")):
        require_touches(2, cone)


@pytest.mark.parametrize("name", ["piacenza2017-pad", "gripper-stadium", "fingertip-dome"])
def test_drawn_touches_fill_the_rows_that_fit_the_workspace(name: str) -> None:
    design = preset(name)
    draft, radius_mm = Draft.of(design), design.indenter.tip_radius_mm
    touches = drawn_touches(draft, 60, 10, np.random.default_rng(0))
    is_touch = np.isfinite(touches[..., 2])
    pairs = touches[is_touch.all(axis=1)]
    assert (~is_touch[:, 1]).sum() == 60
    assert draft.workspace.contains(*touches[is_touch][:, :2].T).all()
    depth_mm = touches[is_touch][:, 2]
    assert depth_mm.min() >= LEAST_MM
    assert depth_mm.max() <= min(design.operating.max_depth_mm, radius_mm)
    apart = np.hypot(*(pairs[:, 0] - pairs[:, 1])[:, :2].T) / radius_mm
    counts = np.histogram(apart, bins=[*ROWS_RADII[:-1], 1e9])[0]
    assert counts.sum() == len(pairs)
    assert counts[0] == 10
    assert counts.max() == 10
