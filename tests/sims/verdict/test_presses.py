"""The presses of a verdict: what is pressed where, and that each pair's light is that of its own press."""

import numpy as np
import pytest

from optopad.design.draft import Draft
from optopad.design.preset import preset
from optopad.design.shape.cavity import cavity_of, chord_midpoint_mm, judged_pairs, mask_of
from optopad.sims.optics.tracing import trace
from optopad.sims.verdict.presses import (
    MAP_ACCURACY,
    NEAR_ACCURACY,
    map_depths_mm,
    map_light,
    pad_light,
    pair_curves,
    states_of,
)

PAD = preset("piacenza2017-pad")
CAVITY = cavity_of(PAD)
DEPTH_MM = np.array([0.5, 2.0])


def test_states_run_through_depths_first():
    states = states_of(np.array([[1.0, 2.0], [3.0, 4.0]]), DEPTH_MM)
    assert states.tolist() == [[1.0, 2.0, 0.5], [1.0, 2.0, 2.0], [3.0, 4.0, 0.5], [3.0, 4.0, 2.0]]


def test_a_pair_s_curves_are_its_light_under_a_press_at_its_chord_s_midpoint():
    pairs = judged_pairs(CAVITY)[:3]
    for pair, curves in zip(
        pairs, pair_curves(Draft.of(PAD), pairs, DEPTH_MM, accuracy="draft", seed=1), strict=True
    ):
        assert curves.press_mm == chord_midpoint_mm(CAVITY, pair)
        states = states_of(np.array([curves.press_mm]), DEPTH_MM)
        alone = trace(Draft.of(PAD), states, accuracy="draft", seed=1, pairs=mask_of((pair,), CAVITY))
        assert curves.total == pytest.approx(alone.flux[:, *pair], rel=1e-9)
        assert curves.direct + curves.top + curves.diffuse == pytest.approx(curves.total, rel=1e-12)


def test_a_map_s_light_has_one_entry_a_state_throughout():
    """The two places go onto each other in a half turn: one is traced, both come back."""
    places = np.array([[12.0, 9.0], [CAVITY.length_mm - 12.0, CAVITY.width_mm - 9.0]])
    light = pad_light(Draft.of(PAD), places, DEPTH_MM, accuracy=MAP_ACCURACY, seed=0)
    assert light.presses.tolist() == states_of(places, DEPTH_MM).tolist()
    for of_state in (light.flux, light.standard_error, light.relative_error, light.is_met):
        assert of_state is not None
        assert len(of_state) == 4
    assert sorted(light.flux[1].ravel()) == sorted(light.flux[3].ravel())


@pytest.mark.slow
def test_a_map_is_finer_near_contact_and_keeps_the_order_of_its_states():
    places, depth_mm = np.array([[12.0, 9.0], [20.0, 11.0]]), np.array([0.0, 0.1, 0.5, 2.0])
    light = map_light(Draft.of(PAD), places, depth_mm, accuracy=MAP_ACCURACY, seed=0)
    near = pad_light(Draft.of(PAD), places, depth_mm[:2], accuracy=NEAR_ACCURACY, seed=0)
    deep = pad_light(Draft.of(PAD), places, depth_mm[2:], accuracy=MAP_ACCURACY, seed=0)
    assert light.presses.tolist() == states_of(places, depth_mm).tolist()
    for name in ("flux", "standard_error"):
        found = getattr(light, name).reshape(2, 4, 8, 8)
        assert (found[:, :2] == getattr(near, name).reshape(2, 2, 8, 8)).all()
        assert (found[:, 2:] == getattr(deep, name).reshape(2, 2, 8, 8)).all()
    assert sum(light.by_class.values()) == pytest.approx(light.flux, rel=1e-12)


def test_a_map_s_depths_hold_all_near_contact_and_end_at_the_deepest_press():
    assert map_depths_mm(0.5, 0.2).tolist() == [0.0, 0.02, 0.05, 0.1, 0.15, 0.2, 0.4, 0.5]
    assert map_depths_mm(0.12, 0.2).tolist() == [0.0, 0.02, 0.05, 0.1, 0.12]
