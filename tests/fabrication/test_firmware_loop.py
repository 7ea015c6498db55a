"""Hardware in the loop without hardware: the compiled firmware on a simulated board, byte by byte."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from optopad.design.pad import Pad
from optopad.design.preset import preset
from optopad.design.spec import SensorDesign
from optopad.fabrication.driver.link.protocol import Command, Kind, pack_command
from optopad.fabrication.sketch import firmware_settings
from tests.fabrication.simulated_board import (
    Run,
    harness_name,
    light_table_mv,
    not_by_the_simulator,
    portable_pad,
    quantised,
    random_table,
    simulate,
)

PAD = preset("piacenza2017-pad")
BOARDS = {"avr": PAD, "arduino": portable_pad(PAD)}
START = (8_000.0, pack_command(Command.START))
FREELY = (7_000.0, pack_command(Command.RATE, 0))
"""The board is up after 5 ms."""

CHIP_SUPPLY_V, REFERENCE_V = 5.0, 1.1


@pytest.fixture
def loop(request: pytest.FixtureRequest, tmp_path: Path):
    """Runs a design's firmware against a table; the pad's on an AVR board and a made-up one unless given."""

    def run(said, *, duration_us, design: SensorDesign = PAD, table_mv=None, **options) -> Run:
        table = random_table(firmware_settings(Pad.of(design))) if table_mv is None else table_mv
        harness = request.getfixturevalue(harness_name(design))
        return simulate(harness, tmp_path, design, table, said, duration_us=duration_us, **options)

    return run


@pytest.fixture(params=BOARDS)
def pad(request: pytest.FixtureRequest) -> SensorDesign:
    """The paper's pad on an AVR board, and on one with another Arduino core."""
    return BOARDS[request.param]


def counts_of(design: SensorDesign, table_mv=None):
    """(state, receiver) counts that a frame must have; of the made-up table unless given."""
    settings = firmware_settings(Pad.of(design))
    return quantised(random_table(settings) if table_mv is None else table_mv, settings.circuit.adc.bits)


def test_every_reading_is_the_quantised_voltage_of_its_state_and_receiver(loop, pad):
    run = loop([FREELY, START], duration_us=190_000, design=pad)
    counts = run.frames.counts
    assert len(counts) >= 40
    assert run.skipped_bytes < run.layout.total_bytes  # the last frame, cut by the end
    assert (counts == counts_of(pad)).all()


@pytest.mark.slow
def test_a_thousand_frames_of_simulated_light_all_equal_the_voltage(loop, pad):
    table_mv = light_table_mv(PAD)
    run = loop([FREELY, START], duration_us=4_400_000, design=pad, table_mv=table_mv)
    assert len(run.frames.counts) >= 1000
    assert (run.frames.counts == counts_of(pad, table_mv)).all()
    assert run.frames.sequence.tolist() == list(range(len(run.frames.counts)))


def test_a_settle_time_set_too_short_is_caught(loop, pad):
    run = loop([FREELY, START], duration_us=40_000, design=pad, changes=["SETTLE_US=2UL", "CONVERSION_US=52"])
    wrong = run.frames.counts != counts_of(pad)
    assert (
        wrong[:, :, 0].any(axis=1).all()
    )  # a state's first reading is taken while the amplifier still moves
    assert not wrong[:, :, 1:].any()  # a conversion of 52 us later it has settled


def test_switching_early_is_right_as_long_as_the_input_is_held_by_then(loop):
    table = counts_of(PAD)
    early = ["SWITCH_EARLY=1"]
    # the data sheet: held 1.5 clocks after the start, which waits for the next edge of that clock
    in_time = loop([FREELY, START], duration_us=40_000, changes=early)
    assert (in_time.frames.counts == table).all()
    # an input that stayed open for two clocks more would see the next emitter: the model does catch it
    open_longer = loop([FREELY, START], duration_us=40_000, changes=early, hold_adc_clocks=3.5)
    assert (open_longer.frames.counts != table)[:, :, -1].mean() > 0.5


def test_device_microseconds_are_those_of_the_first_conversions(loop, pad):
    run = loop([FREELY, START], duration_us=150_000, design=pad)
    exact_us = run.first_conversions_us()
    device_us = run.frames.device_us.astype(float)
    off_us = device_us - exact_us[: len(device_us)]
    # the clock is read in whole microseconds, just before a wait of at most one converter's clock, 4 us
    assert np.ptp(off_us) <= 3.0 + 4.0
    assert np.diff(device_us) == pytest.approx(np.diff(exact_us[: len(device_us)]), abs=3.0 + 4.0)


def test_frames_keep_the_asked_interval_and_none_is_late(loop, pad):
    interval_us = 6_000
    said = [
        (7_000.0, pack_command(Command.RATE, interval_us)),
        START,
        (120_000.0, pack_command(Command.SELF_TEST)),
    ]
    run = loop(said, duration_us=140_000, design=pad)
    assert len(run.frames.counts) >= 18
    steps = np.diff(run.frames.device_us.astype(np.int64)[:-3])
    assert steps == pytest.approx(np.full(len(steps), interval_us), abs=20)  # the wait is polled
    assert run.self_tests[0].late_frames == 0


def test_an_interval_that_cannot_be_kept_counts_every_frame_as_late(loop, pad):
    said = [(7_000.0, pack_command(Command.RATE, 200)), START, (80_000.0, pack_command(Command.SELF_TEST))]
    run = loop(said, duration_us=100_000, design=pad)
    before = int(np.sum(run.times_us(Kind.READINGS) < run.times_us(Kind.SELF_TEST)[0]))
    assert run.self_tests[0].late_frames == before - 1  # but the first


def test_an_interval_beyond_half_the_clocks_range_is_passed_over(loop, pad):
    said = [(7_000.0, pack_command(Command.RATE, 2**31)), (8_000.0, pack_command(Command.IDENTIFY))]
    run = loop(said, duration_us=20_000, design=pad)
    assert [hello.interval_us for hello in run.hellos] == [16_667, 16_667]
    told = loop([FREELY, (8_000.0, pack_command(Command.IDENTIFY))], duration_us=20_000)
    assert [hello.interval_us for hello in told.hellos] == [16_667, 0]


def test_the_design_rate_is_kept_without_a_command(loop, pad):
    run = loop([START], duration_us=150_000, design=pad)
    steps = np.diff(run.frames.device_us.astype(np.int64))
    assert steps == pytest.approx(np.full(len(steps), 1e6 / 60.0), abs=20)


def test_hello_says_what_the_design_says(loop, pad):
    (hello,) = loop([], duration_us=20_000, design=pad).hellos
    assert hello.digest == pad.digest
    number, bits, exponent = (1, 10, 6) if pad is PAD else (77, 12, 0)
    assert (hello.board, hello.emitters, hello.receivers, hello.bits) == (number, 8, 8, bits)
    assert (hello.prescaler_exponent, hello.settle_us, hello.baud) == (exponent, 20, 1_000_000)
    assert hello.interval_us == 16_667


@pytest.mark.slow
def test_hello_comes_once_a_second_until_started_and_when_asked(loop, pad):
    said = [(1_500_000.0, pack_command(Command.IDENTIFY)), (1_600_000.0, START[1])]
    run = loop(said, duration_us=1_650_000, design=pad)
    at_s = run.times_us(Kind.HELLO) / 1e6
    assert at_s == pytest.approx([at_s[0], at_s[0] + 1.0, 1.5], abs=0.003)
    assert at_s[0] < 0.006
    assert run.times_us(Kind.READINGS)[0] > 1_600_000


def test_stop_ends_the_frames_and_leaves_no_emitter_lit(loop, pad):
    run = loop([FREELY, START, (50_000.0, pack_command(Command.STOP))], duration_us=80_000, design=pad)
    assert run.times_us(Kind.READINGS)[-1] < 56_000  # a frame takes 4.1 ms
    switched = run.log[run.log["kind"] == 2]
    lit = {int(number) // 2: int(number) % 2 for number in switched["number"]}
    assert set(lit.values()) == {0}


def test_a_stopped_board_goes_on_counting_when_it_is_started_again(loop, pad):
    said = [FREELY, START, (40_000.0, pack_command(Command.STOP)), (60_000.0, START[1])]
    run = loop(said, duration_us=90_000, design=pad)
    assert run.frames.sequence.tolist() == list(range(len(run.frames.sequence)))
    assert (run.frames.counts == counts_of(pad)).all()


def test_answers_go_out_between_frames_and_disturb_none(loop, pad):
    asked = [(20_000.0 + 9_100.0 * k, pack_command(Command.SELF_TEST)) for k in range(10)]
    asked += [(120_000.0 + 7_300.0 * k, pack_command(Command.IDENTIFY)) for k in range(10)]
    run = loop([FREELY, START, *asked], duration_us=220_000, design=pad)
    assert len(run.self_tests) == 10
    assert len(run.hellos) == 11
    assert run.skipped_bytes < run.layout.total_bytes
    assert (run.frames.counts == counts_of(pad)).all()


def test_a_self_test_tells_supply_memory_and_configuration(loop):
    (found,) = loop([(10_000.0, pack_command(Command.SELF_TEST))], duration_us=30_000).self_tests
    assert found.reference_counts == int(REFERENCE_V / CHIP_SUPPLY_V * 1023)
    assert 7_000 < found.least_free_ram_bytes < 8_192 - 376  # 376 bytes are variables
    assert found.config_crc == firmware_settings(Pad.of(PAD)).config_crc()


def test_garbage_is_ignored_and_a_command_in_it_is_found(loop, pad):
    noise = np.random.default_rng(1).integers(0, 256, 40, dtype=np.uint8).tobytes()
    damaged = bytearray(pack_command(Command.STOP))
    damaged[5] ^= 4
    pieces = noise[:20] + b"\xc5\xc5\x5c" + pack_command(Command.START) + noise[20:]
    said = [FREELY, (10_000.0, pieces[:40]), (12_000.0, pieces[40:]), (30_000.0, bytes(damaged))]
    run = loop(said, duration_us=60_000, design=pad)
    assert run.times_us(Kind.READINGS)[0] < 16_000
    assert run.times_us(Kind.READINGS)[-1] > 50_000


def test_pins_and_inputs_chosen_by_hand_are_lit_and_read_in_their_order(loop, pad):
    design = pad.with_(
        **{
            "board.emitter_pins": [49, 22, 10, 37, 2, 14, 6, 53],  # eight ports, L A B C E J H B
            "board.receiver_channels": ["A7", "A0", "A6", "A1", "A5", "A2", "A4", "A3"],
        }
    )
    run = loop([FREELY, START], duration_us=30_000, design=design)
    assert len(run.frames.counts) >= 3
    assert (run.frames.counts == counts_of(design)).all()


PAIR = preset("piacenza2017-pair")


@pytest.mark.parametrize(
    "design",
    [PAIR, *(portable_pad(PAIR, bits) for bits in (8, 11, 16))],
    ids=["avr", "8 bits", "11 bits", "16 bits"],
)
def test_odd_counts_of_receivers_are_packed_whole(loop, design):
    run = loop([FREELY, START], duration_us=20_000, design=design)
    assert len(run.frames.counts) > 10
    assert (run.frames.counts == counts_of(design)).all()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "number", "parts_per_side"), [("uno", 2, [3, 3, 3, 3]), ("nano", 3, [4, 4, 4, 4])]
)
def test_smaller_boards_run_the_same_source(loop, kind, number, parts_per_side):
    ring = {"pattern": "alternating_ring", "parts_per_side": parts_per_side}
    design = PAD.with_(**{"board.kind": f"arduino-{kind}", "layout": [ring]})
    run = loop([FREELY, START], duration_us=40_000, design=design)
    assert run.hellos[0].board == number
    assert len(run.frames.counts) >= 5
    assert (run.frames.counts == counts_of(design)).all()


@pytest.mark.parametrize(
    "channels", [[f"A{k}" for k in range(8, 16)], [f"A{k}" for k in (15, 0, 8, 7, 3, 11, 12, 4)]]
)
def test_inputs_above_the_seventh_are_read_by_their_setting_in_the_other_register(loop, channels):
    design = PAD.with_(**{"board.receiver_channels": channels})
    run = loop([FREELY, START], duration_us=30_000, design=design)
    assert len(run.frames.counts) >= 3
    assert (run.frames.counts == counts_of(design)).all()


def test_twelve_receivers_are_read_and_which_the_simulator_does_not_convert_is_said(loop):
    design = preset("oblong-60x40")
    settings = firmware_settings(Pad.of(design))
    run = loop([FREELY, START], duration_us=60_000, design=design)
    said = not_by_the_simulator(settings)
    assert said.endswith("around it R9 on A8, R10 on A9, R11 on A10, R12 on A11")
    assert len(run.frames.counts) >= 4
    assert (run.frames.counts == counts_of(design)).all()


def test_clock_and_sequence_wrap_without_a_frame_out_of_step(loop, pad):
    before_us, before_frames, interval_us = 60_000, 5, 6_000
    changes = [f"FIRST_US={2**32 - before_us}UL", f"FIRST_SEQUENCE={2**32 - before_frames}UL"]
    said = [
        (7_000.0, pack_command(Command.RATE, interval_us)),
        START,
        (150_000.0, pack_command(Command.SELF_TEST)),
    ]
    run = loop(said, duration_us=170_000, design=pad, changes=changes)
    device_us = run.frames.device_us.astype(np.int64)
    assert device_us[0] > 2**31 > device_us[-1]
    assert run.frames.sequence[[0, before_frames]].tolist() == [2**32 - before_frames, 0]
    steps = np.diff(device_us[:-4]) % 2**32
    assert steps == pytest.approx(np.full(len(steps), interval_us), abs=20)  # the wait is polled
    assert run.self_tests[0].late_frames == 0


def test_a_slow_line_holds_frames_up_and_loses_none(loop, pad):
    design = pad.with_(**{"board.baud": 115_200, "board.frame_rate_hz": 50.0})
    run = loop([(20_000.0, FREELY[1]), (25_000.0, START[1])], duration_us=300_000, design=design)
    counts = run.frames.counts
    assert run.frames.sequence.tolist() == list(range(len(counts)))
    assert (counts == counts_of(design)).all()
    # 105 bytes of 10 bits take 9.1 ms, more than the 4.2 ms of reading; the simulator of AVRs takes 11 bits a byte
    frame_us = (105 * 11 / 117_647 if pad is PAD else 123 * 10 / 115_200) * 1e6
    assert np.diff(run.frames.device_us.astype(np.int64))[2:].mean() == pytest.approx(frame_us, rel=0.02)


def test_a_host_that_never_stops_talking_changes_no_reading(loop, pad):
    rng = np.random.default_rng(2)
    noise = [(9_000.0 + 640.0 * k, rng.integers(0, 256, 60, dtype=np.uint8).tobytes()) for k in range(200)]
    run = loop([FREELY, START, *noise], duration_us=160_000, design=pad)
    assert (
        len(run.frames.counts) >= 25
    )  # of 36: hearing bytes that come at the full rate takes half the processor
    assert run.skipped_bytes < run.layout.total_bytes
    assert (run.frames.counts == counts_of(pad)).all()
