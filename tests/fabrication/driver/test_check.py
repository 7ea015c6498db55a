"""Wrong wires, dead parts and saturated amplifiers are named by part and pin; a right build is left in peace."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest

from optopad.design.errors import InputError
from optopad.fabrication.driver import Frame, Sensor
from optopad.fabrication.driver.check import Verdict, check_frames
from optopad.fabrication.driver.descriptor import descriptor_of
from optopad.fabrication.driver.link.protocol import SelfTest
from optopad.fabrication.driver.simulated.board import faults_of
from optopad.fabrication.driver.simulated.port import FakePort
from tests.fabrication.driver.made_up_pad import board, frame, pad_config, untouched

CONFIG = pad_config()
FOUND = descriptor_of(CONFIG)
EMITTERS = [entry.name for entry in CONFIG.emitters]
RECEIVERS = [entry.name for entry in CONFIG.receivers]
PART_SPREAD, PAIR_SPREAD = 0.2, 0.08
"""Of the builds here, standard deviation of the logarithm: LEDs of one bin, places to some tenths of a millimetre."""


def readings(
    *faults: str, seed: int = 0, gain: float = 1.0, spread: float = 1.0, ambient: float = 2.0
) -> list[Frame]:
    """Twenty frames of a build that differs from the expected one in brightness, gain and places."""
    rng, pattern = np.random.default_rng(seed), untouched()
    parts = rng.standard_normal((8, 1)) + rng.standard_normal((1, 8))
    build = (
        pattern * gain * np.exp(spread * (PART_SPREAD * parts + PAIR_SPREAD * rng.standard_normal((8, 8))))
    )
    shown = faults_of(CONFIG, faults)
    levels = np.vstack([shown.applied(build), np.zeros(8)]) + ambient
    levels[:, shown.is_saturated] = np.inf
    return [frame(np.clip(np.round(levels + 0.5 * rng.standard_normal((9, 8))), 0, 1023)) for _ in range(20)]


def kinds(verdict: Verdict) -> list[tuple[str, tuple[str, ...]]]:
    return [(problem.kind, problem.parts) for problem in verdict.problems if problem.is_error]


@pytest.mark.parametrize("seed", range(12))
def test_a_right_build_within_its_tolerances_has_no_error(seed: int) -> None:
    verdict = check_frames(readings(seed=seed, gain=0.7 + 0.05 * seed), FOUND)
    assert kinds(verdict) == []
    assert verdict.is_good


@pytest.mark.slow
@pytest.mark.parametrize("names", [EMITTERS, RECEIVERS], ids=["emitters", "receivers"])
def test_every_exchange_of_two_wires_is_named(names: list[str]) -> None:
    for seed, (one, other) in enumerate(combinations(names, 2)):
        verdict = check_frames(readings(f"swap:{one},{other}", seed=seed), FOUND)
        assert kinds(verdict) == [("swapped", (one, other))]


def test_two_exchanges_at_once_come_apart() -> None:
    found = kinds(check_frames(readings("swap:E1,E2", "swap:R3,R4"), FOUND))
    assert sorted(found) == [("swapped", ("E1", "E2")), ("swapped", ("R3", "R4"))]


@pytest.mark.parametrize("part", [*EMITTERS, *RECEIVERS])
def test_every_dead_part_is_named(part: str) -> None:
    assert kinds(check_frames(readings(f"dead:{part}"), FOUND)) == [("dead", (part,))]


@pytest.mark.parametrize("part", RECEIVERS)
def test_every_saturated_amplifier_is_named(part: str) -> None:
    assert kinds(check_frames(readings(f"saturated:{part}"), FOUND)) == [("saturated", (part,))]


def test_a_dim_emitter_is_a_warning() -> None:
    verdict = check_frames(readings("dim:E3", spread=0.3), FOUND)
    assert [(p.kind, p.parts, p.is_error) for p in verdict.problems] == [("dim", ("E3",), False)]
    assert verdict.is_good


def test_no_light_at_all_is_one_problem() -> None:
    (problem,) = check_frames(readings(gain=1e-6), FOUND).problems
    assert problem.kind == "dead"
    assert "supply" in problem.message


def test_a_gain_far_too_high_is_told_by_the_channels_that_clip() -> None:
    found = check_frames(readings(gain=20.0), FOUND)
    assert {kind for kind, _ in kinds(found)} == {"saturated"}


def test_ambient_light_and_a_low_supply_are_warnings() -> None:
    low = SelfTest(
        reference_counts=280, late_frames=0, least_free_ram_bytes=4000, config_crc=FOUND.config_crc or 0
    )
    verdict = check_frames(readings(ambient=150.0), FOUND, low)
    assert {problem.kind for problem in verdict.problems if not problem.is_error} >= {"ambient", "supply"}
    assert any("4.02 V" in problem.message for problem in verdict.problems)  # 1.1 V x 1024 / 280
    assert verdict.is_good


def test_a_program_made_with_other_pins_is_an_error() -> None:
    assert FOUND.config_crc is not None
    other = SelfTest(
        reference_counts=225, late_frames=0, least_free_ram_bytes=4000, config_crc=FOUND.config_crc ^ 1
    )
    (problem,) = check_frames(readings(), FOUND, other).problems
    assert problem.kind == "program"
    assert f"should be {FOUND.config_crc:08x}" in problem.message
    assert problem.is_error


def test_the_agreement_is_measured() -> None:
    verdict = check_frames(readings(gain=1.5, spread=0.0), FOUND)
    assert verdict.gain == pytest.approx(1.5, rel=0.02)  # rounding of readings of some 30 counts
    assert verdict.mismatch is not None
    assert verdict.mismatch < 0.02


def test_pairs_that_are_meant_to_clip_are_listed_and_no_problem() -> None:
    verdict = check_frames(readings(), FOUND)
    assert len(verdict.clipped_by_design) == int((untouched() >= 0.95 * 1023).sum()) > 0


def test_mirror_images_of_a_symmetric_layout_are_both_named() -> None:
    pair = pad_config("piacenza2017-pair")
    x = untouched("piacenza2017-pair")
    frames = [frame(np.vstack([np.minimum(x[[2, 1, 0]], 1023), np.zeros(3)]).round())]
    (problem,) = check_frames(frames, descriptor_of(pair)).problems
    assert set(problem.parts) == {"E1", "E3", "R1", "R3"}
    assert "not resolved which" in problem.message


def test_without_an_expected_pattern_the_way_out_is_named() -> None:
    from dataclasses import replace

    with pytest.raises(InputError, match="no expected pattern; run `optopad score`"):
        check_frames(readings(), replace(FOUND, expected_counts=None))


@pytest.mark.parametrize(
    "text", ["swap:E1", "swap:E1,R1", "dead:E9", "melted:E1", "saturated:E1", "swap:E1,E1"]
)
def test_a_fault_that_cannot_be_is_refused(text: str) -> None:
    with pytest.raises(InputError, match="is refused"):
        faults_of(CONFIG, [text])


@pytest.mark.parametrize(
    ("fault", "kind", "parts"),
    [
        ("swap:E2,E3", "swapped", ("E2", "E3")),
        ("dead:E4", "dead", ("E4",)),
        ("saturated:R6", "saturated", ("R6",)),
    ],
)
def test_a_fault_of_the_simulated_board_is_named_through_the_whole_driver(
    fault: str, kind: str, parts: tuple[str, ...]
) -> None:
    with (
        FakePort(board(faults=faults_of(CONFIG, [fault]))) as port,
        Sensor(CONFIG, port.name, rate_hz=200, baseline_s=0) as sensor,
    ):
        verdict = check_frames(sensor.frames(count=60), sensor.descriptor, sensor.self_test())
    assert [(p.kind, p.parts) for p in verdict.problems] == [(kind, parts)]


def test_faults_of_three_kinds_at_once_are_each_named() -> None:
    found = kinds(check_frames(readings("swap:E1,E4", "dead:R2", "saturated:R7"), FOUND))
    assert sorted(found) == [("dead", ("R2",)), ("saturated", ("R7",)), ("swapped", ("E1", "E4"))]
