"""Where the tip is beside what the stage says, and walls that come loose."""

from __future__ import annotations

import numpy as np
import pytest

from optopad.design.errors import ModelScopeError
from optopad.design.preset import preset
from optopad.design.spec.sensor import Noise
from optopad.sims.readings.signal_chain import (
    PressDraw,
    blended,
    drawn_press,
    drawn_set_offset_mm,
    true_depth_mm,
    unbonded_share,
    with_loose_walls,
)

IN_MM = np.array([-1.0, 0.0, 2.5, 5.0])
WAY_MM = np.concatenate([IN_MM, IN_MM[::-1]])
BACK = np.arange(8) >= 4


def still(offset_mm: float = 0.0) -> PressDraw:
    return PressDraw(zero_offset_mm=offset_mm, place_error_mm=np.zeros(2))


def test_without_errors_the_tip_is_where_the_stage_says() -> None:
    np.testing.assert_array_equal(true_depth_mm(WAY_MM, BACK, still(), 0.0), WAY_MM)


def test_the_tip_lags_on_the_way_back_and_never_goes_deeper_than_the_turn() -> None:
    found = true_depth_mm(WAY_MM, BACK, still(), 0.05)
    np.testing.assert_allclose(found - WAY_MM, [0, 0, 0, 0, 0, 0.05, 0.05, 0.05], atol=1e-12)


def test_an_offset_holds_for_the_whole_press() -> None:
    np.testing.assert_allclose(true_depth_mm(WAY_MM, BACK, still(-0.1), 0.0) - WAY_MM, -0.1)


def test_offsets_have_their_size_set_by_set_and_place_by_place() -> None:
    """4000 draws: standard error of a standard deviation 1.1 %."""
    noise, rng = Noise(), np.random.default_rng(0)
    sets = [drawn_set_offset_mm(noise, rng) for _ in range(4000)]
    presses = [drawn_press(noise, 0.1, rng) for _ in range(4000)]
    assert np.std(sets) == pytest.approx(noise.zero_offset_set_mm, rel=0.06)
    assert np.std([one.zero_offset_mm for one in presses]) == pytest.approx(
        noise.zero_offset_place_mm, rel=0.06
    )
    assert np.mean([one.zero_offset_mm for one in presses]) == pytest.approx(0.1, abs=5 * 0.03 / 63)
    np.testing.assert_allclose(
        np.std([one.place_error_mm for one in presses], axis=0), noise.position_error_mm, rtol=0.06
    )


def test_walls_come_loose_with_depth_and_heal_with_their_time_constant() -> None:
    time = np.array([0.0, 1.0, 2.0, 2.0 + 7.5, 2.0 + 15.0])
    depth = np.array([0.0, 2.5, 5.0, 0.0, -10.0])
    found = unbonded_share(depth, time, deepest_mm=5.0, share=0.4, heal_s=7.5)
    np.testing.assert_allclose(found, [0.0, 0.2, 0.4, 0.4 / np.e, 0.4 / np.e**2], rtol=1e-12)


def test_walls_are_looser_on_the_way_back_than_on_the_way_in() -> None:
    """The hysteresis that the paper saw."""
    found = unbonded_share(WAY_MM, np.arange(8.0), deepest_mm=5.0, share=0.3, heal_s=7.5)
    assert found[5] > found[2]
    assert found[6] > found[1] == 0.0


def test_a_share_of_nothing_leaves_the_walls_whole() -> None:
    found = unbonded_share(WAY_MM, np.arange(8.0), deepest_mm=5.0, share=0.0, heal_s=7.5)
    np.testing.assert_array_equal(found, 0.0)


def test_signals_lie_between_bonded_and_loose_walls() -> None:
    bonded, loose = np.full((3, 2, 2), 10.0), np.full((3, 2, 2), 20.0)
    found = blended(bonded, loose, np.array([0.0, 0.25, 1.0]))
    np.testing.assert_allclose(found[:, 0, 0], [10.0, 12.5, 20.0])


def test_loose_walls_are_those_of_an_air_gap_and_come_loose_once() -> None:
    glossy = preset("piacenza2017-pad").with_(
        **{"surfaces.wall_finish": "glossy", "surfaces.wall_index": 1.5}
    )
    loose = with_loose_walls(glossy)
    assert (loose.surfaces.wall_finish, loose.surfaces.wall_index) == ("air_gap", None)
    with pytest.raises(ModelScopeError, match="air gap already"):
        with_loose_walls(loose)
