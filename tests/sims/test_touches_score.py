"""A score of two touches: states, interpolation, pads on paper with all pairs and with one; and the light of both."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from optopad.design.draft import Draft
from optopad.design.errors import ModelScopeError
from optopad.design.preset import preset
from optopad.sims import touches_score
from optopad.sims.learning.inference.signal_map import Box
from optopad.sims.learning.traced_map import SignalMap
from optopad.sims.optics.scene.lower import scene_of
from optopad.sims.optics.scene.symmetry import each_its_own
from optopad.sims.readings.readout import Readout
from optopad.sims.touches import changes_together
from optopad.sims.touches_score import (
    CLEAR,
    DIRECTIONS_DEG,
    MOST_CLASSES,
    TouchesScore,
    require_touches,
    score_touches,
)
from tests.sims.learning.made_up_map import made_up_signal_map

READOUT = Readout(counts_per_flux=1.0, full_scale_counts=1023.0, read_noise_counts=0.5, relative_noise=0.003)
SMALL = "gripper-stadium"


@cache
def draft(name: str = "piacenza2017-pad") -> Draft:
    return Draft.of(preset(name))


def scored(known: SignalMap, monkeypatch: pytest.MonkeyPatch) -> TouchesScore:
    """The score of a pad on paper, on which two touches change nothing together."""
    pad = touches_score._Pad(
        draft=draft(),
        is_bright=known.is_bright,
        maps=(known.ratio_root, known.ratio_root),
        box=Box(low=np.array([6.0, 6.0, 0.0]), high=np.array([26.0, 26.0, 5.0])),
        counts=known.untouched * 1e5,
        readout=READOUT,
    )
    pairs = len(known.untouched)
    for name, made in (
        ("_pad", lambda *_: pad),
        ("changes_together", lambda _draft, tips, **_: np.zeros((2, len(tips), pairs))),
        ("_classes", lambda one, tips: each_its_own(scene_of(one.design), len(tips))),
    ):
        monkeypatch.setattr(touches_score, name, made)
    return score_touches(draft())


def test_tips_that_touch_are_told_apart_by_many_pairs(monkeypatch: pytest.MonkeyPatch) -> None:
    found = scored(made_up_signal_map(2.0, 9), monkeypatch)
    assert found.two_point_mm["median"] == pytest.approx(6.0)
    assert (found.distance[..., 1:] > 3.0).all()
    assert (np.diff(np.median(found.distance, axis=(0, 1))) > 0.0).all()  # clearer the deeper
    assert (found.location_times >= 1.0 - 1e-9).all()
    assert (found.depth_times >= 1.0 - 1e-9).all()
    assert not found.is_open.any()
    told = json.loads(json.dumps(found.to_json(), allow_nan=False))
    assert told["two_point_mm"] == found.two_point_mm
    assert np.array(told["has_room"]).all()


def test_one_pair_cannot_tell_two_touches_from_one(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = made_up_signal_map(2.0, 9)
    monkeypatch.setattr(touches_score, "MOST_CLASSES", 4)  # few locations
    found = scored(replace(whole, flux=whole.flux[..., :1, 4:5]), monkeypatch)
    assert np.isinf(found.least_mm).all()
    assert all(one["median"] is one["worst"] is None for one in found.two_point_mm["by_depth"])
    assert found.two_point_mm["median"] is found.two_point_mm["worst"] is None
    assert np.isinf(found.location_mm).all()


def test_the_least_separation_is_interpolated_as_a_power() -> None:
    before, now = (touches_score.TOLD_APART * (one / 7.0) ** 2.5 for one in (6.0, 8.0))
    found = touches_score._between(
        np.array([6.0, 8.0]), np.array([8.0, 8.0]), np.array([before, np.nan]), np.array([now, 50.0])
    )
    np.testing.assert_allclose(found, [7.0, 8.0])


@pytest.mark.parametrize("name", ["piacenza2017-pad", SMALL, "fingertip-dome"])
def test_states_are_in_the_workspace_and_few_are_computed(name: str) -> None:
    pad = draft(name)
    places, depth_mm, has_room = touches_score._states(pad)
    assert has_room.any(axis=1).all()
    assert (np.diff(depth_mm) > 0.0).all()
    asked = np.column_stack([np.argwhere(has_room), np.zeros(int(has_room.sum()), int)])
    tips = touches_score._tips(places, depth_mm, asked, 2.0 * pad.design.indenter.tip_radius_mm * CLEAR)
    assert all(pad.workspace.contains(*np.round(one, 9)) for one in tips[..., :2].reshape(-1, 2).tolist())
    np.testing.assert_allclose(tips[..., :2].mean(axis=1), places[asked[:, 0]])
    assert len(touches_score._classes(pad, tips).first) <= MOST_CLASSES
    assert has_room.shape[1] == len(DIRECTIONS_DEG)


def test_pads_without_room_or_with_other_tips_are_refused() -> None:
    for changes, words in (
        ({"indenter.tip_radius_mm": 7.0, "operating.workspace_margin_mm": 12.0}, "no room"),
        ({"indenter.shape": "flat_punch"}, r"indenter\.shape"),
        ({"surfaces.wall_finish": "glossy"}, "wall_finish"),
    ):
        with pytest.raises(ModelScopeError, match=words):
            require_touches(Draft.of(preset("piacenza2017-pad").with_(**changes)))


def test_overlaps_are_refused_before_any_light() -> None:
    with pytest.raises(ModelScopeError, match="overlap"):
        changes_together(draft(), np.array([[[12.0, 14.0, 1.0], [15.0, 14.0, 1.0]]]))
