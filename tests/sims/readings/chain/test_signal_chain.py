"""The signal chain: nothing where all is off, and each disturbance with its size and its correlations."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from optopad.design.circuit.circuit import Circuit
from optopad.design.errors import DesignError, ModelScopeError
from optopad.design.fields.packaged import data_quantities
from optopad.design.preset import preset
from optopad.design.spec.sensor import CHAIN, PURE, Noise
from optopad.sims.readings.readout import Readout
from optopad.sims.readings.signal_chain import (
    PressDraw,
    Remainder,
    SignalChain,
    blended,
    chain_of,
    drawn_press,
    drawn_set_offset_mm,
    relative_power,
    shot_variance_per_count,
    true_depth_mm,
    unbonded_share,
    with_loose_walls,
    without_noise,
)
from tests.sims.readings.chain.pair_noise import pair_sigma_counts

DESIGN = preset("piacenza2017-pad")
READOUT = Readout(
    counts_per_flux=54_500.0, full_scale_counts=1023.0, read_noise_counts=0.5, relative_noise=0.003
)
FRAMES = 4000
STANDARD_ERROR = 1.0 / np.sqrt(2 * FRAMES)
"""Relative standard error of one standard deviation of so many normal numbers."""


def chain(**noise: Any) -> SignalChain:
    """The pad's chain with everything off but what is named."""
    return chain_of(
        without_noise(DESIGN).with_(**{f"noise.{name}": value for name, value in noise.items()}), READOUT
    )


def flux(counts: float, frames: int = FRAMES) -> np.ndarray:
    """Every pair gets so many counts."""
    return np.full((frames, 8, 8), counts / READOUT.counts_per_flux)


def taken(
    of: SignalChain, counts: float = 300.0, *, seed: int = 0, is_ambient: bool = False, step_s: float = 0.5137
) -> np.ndarray:
    """Readings of many frames of one set, at times that no flicker is locked to."""
    rng = np.random.default_rng(seed)
    return of.counts(flux(counts), step_s * np.arange(FRAMES), rng, is_ambient)


def test_all_off_gives_the_pure_signal() -> None:
    rng = np.random.default_rng(1)
    light = rng.uniform(1e-4, 0.018, (50, 8, 8))
    found = chain().counts(light, np.arange(50.0), rng, True)
    np.testing.assert_allclose(found[:, :-1], light * READOUT.counts_per_flux, rtol=1e-6)  # float32
    np.testing.assert_array_equal(found[:, -1], 0.0)


def test_every_parameter_of_the_chain_can_be_turned_off() -> None:
    """`PURE` names all but the verdict's own and the shapes, which do nothing by themselves."""
    shapes = {"ambient_flicker", "flicker_hz", "wall_heal_s", "release_decay_s"}
    assert set(PURE) | shapes | {"relative_noise"} == set(Noise.model_fields)


def test_the_chains_parameters_change_no_digest_at_their_defaults() -> None:
    named = DESIGN.with_(**{f"noise.{name}": getattr(Noise(), name) for name in CHAIN})
    assert named.digest == DESIGN.digest
    assert "led_fluctuation" not in DESIGN.model_dump(mode="json")["noise"]
    assert DESIGN.with_(**{"noise.led_fluctuation": 0.01}).digest != DESIGN.digest


def test_relative_noise_of_the_verdict_is_fluctuation_and_drift_together() -> None:
    """So that nothing is counted twice: within a tenth of the summary's 0.3 %."""
    noise = Noise()
    assert np.hypot(noise.led_fluctuation, noise.gain_drift) == pytest.approx(noise.relative_noise, rel=0.1)


def test_read_noise_has_its_size_and_is_independent_everywhere() -> None:
    found = taken(chain(read_noise_counts=2.0))
    spread = found.std(axis=0)
    np.testing.assert_allclose(spread[:-1], 2.0, rtol=5 * STANDARD_ERROR)
    both = np.corrcoef(found[:, 0, 0], found[:, 0, 1])[0, 1]
    assert abs(both) < 5 / np.sqrt(FRAMES)


def test_rounding_adds_a_twelfth() -> None:
    found = taken(chain(read_noise_counts=2.0, quantised=True), counts=300.3)
    assert (found == np.rint(found)).all()
    np.testing.assert_allclose(found[:, :-1].std(axis=0), np.sqrt(4.0 + 1 / 12), rtol=5 * STANDARD_ERROR)


def test_an_emitters_fluctuation_is_one_for_all_its_receivers_and_none_of_the_other_emitters() -> None:
    found = taken(chain(led_fluctuation=0.01))
    np.testing.assert_allclose(found[:, :-1].std(axis=0), 3.0, rtol=5 * STANDARD_ERROR)
    assert np.corrcoef(found[:, 2, 0], found[:, 2, 5])[0, 1] == pytest.approx(1.0)
    assert abs(np.corrcoef(found[:, 2, 0], found[:, 3, 0])[0, 1]) < 5 / np.sqrt(FRAMES)
    np.testing.assert_array_equal(found[:, -1], 0.0)


def test_drift_is_steady_within_a_set_and_drawn_anew_for_the_next() -> None:
    of = chain(gain_drift=0.01)
    times = np.array([0.0, 5000.0])
    draws = [of.counts(flux(300.0, 2), times, np.random.default_rng(seed)) for seed in range(200)]
    sets = np.array(draws)[:, :, :-1] / 300.0 - 1.0
    np.testing.assert_array_equal(sets[:, 0], sets[:, 1])
    wanted = 0.01 * np.sqrt(2.0)  # emitter's and receiver's
    assert sets[:, 0].std() == pytest.approx(wanted, rel=0.1)  # 200 x 16 draws, of which pairs share
    emitter_part = sets[:, 0].mean(axis=2)
    assert emitter_part.std() == pytest.approx(0.01 * np.sqrt(1 + 1 / 8), rel=0.15)


def test_drift_by_the_hour_is_a_straight_line() -> None:
    of = chain(gain_drift_per_hour=0.01)
    found = of.counts(flux(300.0, 3), np.array([0.0, 1800.0, 3600.0]), np.random.default_rng(0))
    np.testing.assert_array_equal(found[0, :-1], 300.0)
    steps = np.diff(found[:, :-1], axis=0)
    np.testing.assert_allclose(steps[0], steps[1], atol=300 * 1e-4 + 1e-3)  # products of two drifts


def test_ambient_light_lies_on_all_states_and_the_off_state_takes_it_away() -> None:
    of = chain(ambient_counts=40.0, ambient_flicker=0.0)
    found = taken(of, is_ambient=True)
    np.testing.assert_allclose(found[:, -1], 40.0, rtol=1e-6)
    np.testing.assert_allclose(found[:, :-1] - found[:, -1:], 300.0, rtol=1e-6)
    np.testing.assert_array_equal(taken(of, is_ambient=False)[:, -1], 0.0)


def test_a_black_coat_outside_keeps_ambient_light_out() -> None:
    quiet = without_noise(DESIGN).with_(**{"noise.ambient_counts": 40.0, "noise.ambient_flicker": 0.0})
    skin = {"finish": "diffuse", "reflectance": 0.6}
    for black, counts in ((False, 40.0), (True, 0.0)):
        covered = quiet.with_(top=skin | {"black_outside": black})
        found = taken(chain_of(covered, READOUT), is_ambient=True)
        np.testing.assert_allclose(found[:, -1], counts, rtol=1e-6)


@pytest.mark.parametrize("hz", [100.0, 120.0])
def test_flicker_leaves_what_the_times_of_the_readings_make_of_it(hz: float) -> None:
    of = chain(ambient_counts=40.0, ambient_flicker=0.2, flicker_hz=hz)
    found = taken(of, is_ambient=True)
    left = found[:, :-1] - found[:, -1:] - 300.0
    np.testing.assert_allclose(
        np.sqrt((left**2).mean(axis=0)), of.flicker_sigma_counts(), atol=0.01 * 40 * 0.2
    )
    assert of.flicker_sigma_counts().min() < 0.5 * of.flicker_sigma_counts().max()


def test_the_default_residual_of_ambient_light_is_within_the_bound() -> None:
    """The paper's untouched rows allow 1 to 2 counts."""
    left = chain_of(DESIGN, READOUT).flicker_sigma_counts()
    assert 0.5 < np.sqrt((left**2).mean()) < 2.0


def test_readings_follow_one_another_as_the_frame_does() -> None:
    at = chain().read_at_s
    assert (np.diff(at.reshape(-1)) > 0).all()
    assert at[0, 0] == pytest.approx(DESIGN.board.settle_us * 1e-6)

    frame_s = Circuit.of(DESIGN).frame_ms / 1e3
    assert at[-1, -1] < frame_s  # then one conversion and the line


def test_averages_divide_read_and_shot_noise_and_take_their_time() -> None:
    sixteen = DESIGN.with_(**{"board.averages": 16, "board.frame_rate_hz": 10.0})
    one, many = chain_of(DESIGN, READOUT), chain_of(sixteen, READOUT)
    assert many.noise.read_noise_counts == one.noise.read_noise_counts / 4
    np.testing.assert_allclose(many.shot_variance_per_count, one.shot_variance_per_count / 16)
    between = np.diff(one.read_at_s[0])
    np.testing.assert_allclose(np.diff(many.read_at_s[0]), 16 * between)
    assert sixteen.value_noise_counts == DESIGN.value_noise_counts / 4


def test_shot_noise_follows_the_capacitor_and_stays_below_the_reading_noise() -> None:
    """n q / (2 C V): 27 pF and 5 V / 1024, the values of the build sheet."""
    each = shot_variance_per_count(DESIGN, READOUT)
    np.testing.assert_allclose(each, 1.602e-19 / (2 * 27e-12 * 5 / 1024), rtol=1e-3)
    assert np.sqrt(1000 * each.max()) < 0.1 * Noise().read_noise_counts
    given = without_noise(DESIGN).with_(**{"noise.shot_variance_per_count": 0.04})
    found = taken(chain_of(given, READOUT), counts=100.0)
    np.testing.assert_allclose(found[:, :-1].std(axis=0), 2.0, rtol=5 * STANDARD_ERROR)
    np.testing.assert_array_equal(found[:, -1], 0.0)


def test_bright_pairs_clip_at_full_scale_and_nothing_is_negative() -> None:
    found = taken(chain(read_noise_counts=2.0, quantised=True), counts=1030.0)
    assert found.max() == 1023.0
    assert found.min() == 0.0


def test_the_noise_of_a_pair_is_what_its_formula_says() -> None:
    of = chain_of(DESIGN.with_(**{"noise.dark_counts": 10.0}), READOUT)
    found = taken(of)
    signal = found[:, :-1] - found[:, -1:]
    wanted = pair_sigma_counts(of, np.full((8, 8), 300.0))
    np.testing.assert_allclose(signal.std(axis=0), wanted, rtol=6 * STANDARD_ERROR)


def test_the_same_seed_gives_the_same_readings() -> None:
    of = chain_of(DESIGN, READOUT)
    np.testing.assert_array_equal(taken(of, seed=3), taken(of, seed=3))
    assert (taken(of, seed=3) != taken(of, seed=4)).any()


def test_equal_emitters_have_equal_power_and_unequal_ones_their_own() -> None:
    np.testing.assert_array_equal(relative_power(DESIGN), 1.0)
    parts = DESIGN.model_dump(mode="json")["layout"]
    assert parts[0]["pattern"] == "alternating_ring"
    mixed = DESIGN.with_(
        layout=[
            {"pattern": "single", "kind": "emitter", "wall": "south", "along_mm": 10.0},
            {
                "pattern": "single", "kind": "emitter", "wall": "east", "along_mm": 10.0,
                "part": "osram-lt-p4sg",
            },
            {"pattern": "single", "kind": "receiver", "wall": "north", "along_mm": 10.0},
        ]
    )  # fmt: skip
    found = relative_power(mixed)
    assert found.shape == (2, 1)
    np.testing.assert_allclose(found.mean(axis=0), 1.0)
    assert found[0, 0] != pytest.approx(found[1, 0], rel=0.01)


def test_another_build_is_a_copy_with_other_gains() -> None:
    of = chain()
    other = replace(of, gains=of.gains * 1.2)
    np.testing.assert_allclose(taken(other)[0, 0], 360.0, rtol=1e-6)


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


def test_a_released_press_leaves_half_of_its_residue_after_the_decay_and_never_less_light_than_none() -> None:
    left = Remainder(change=np.full((8, 8), -0.5), released_s=3.0)
    noise = Noise(release_residue=0.04, release_decay_s=2.0)
    found = left.added(np.full((3, 8, 8), 0.9), np.array([2.0, 5.0, 41.0]), noise)
    np.testing.assert_allclose(found[:, 0, 0], [0.88, 0.89, 0.899])
    assert left.added(np.full((1, 8, 8), 0.01), np.array([3.0]), noise).max() == 0.0


def test_the_usual_residue_is_the_catalogues_and_more_than_all_of_a_press_is_refused() -> None:
    """The preset that has a memory takes it from the catalogue, whose bands hold what was fitted to the recordings."""
    known, noise = data_quantities("memory.toml"), preset("gripper-teensy").noise
    assert (noise.release_residue, noise.release_decay_s) == tuple(one.value for one in known.values())
    with pytest.raises(DesignError, match=r"noise.release_residue.*1\.2.*1"):
        DESIGN.with_(**{"noise.release_residue": 1.2})
