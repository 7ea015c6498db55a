"""Dark states before and after each emitter: time of a frame, line, both programs, and the driver's signals."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest

from optopad.design.circuit.circuit import Circuit, frame_bytes, sending_time_ms
from optopad.design.errors import DeviceError
from optopad.design.pad import Pad
from optopad.design.preset import preset
from optopad.design.recordings import lit_emitters, nearest_dark_states, signals_of, with_one_dark
from optopad.design.spec import SensorDesign
from optopad.fabrication.driver import Sensor
from optopad.fabrication.driver.link.link import check_hello
from optopad.fabrication.driver.link.protocol import Command, Kind, pack_command, unpack_hello
from optopad.fabrication.driver.simulated.board import FakeBoard
from optopad.fabrication.driver.simulated.port import FakePort
from optopad.fabrication.driver_config import driver_config, dump_driver_config
from optopad.fabrication.driver_file import config_from_document
from optopad.fabrication.sketch import firmware_settings
from optopad.sims.readings.readout import Readout
from optopad.sims.readings.signal_chain import chain_of, without_noise
from tests.fabrication.driver.made_up_pad import press_table, untouched
from tests.fabrication.simulated_board import (
    INPUT_HELD,
    portable_pad,
    quantised,
    random_table,
    simulate,
    unpack_self_test,
)
from tests.sims.readings.chain.pair_noise import pair_sigma_counts

EACH = {"board.dark": "each", "board.frame_rate_hz": 40.0}
SAID = [
    (7_000.0, pack_command(Command.RATE, 0)),
    (8_000.0, pack_command(Command.START)),
    (90_000.0, pack_command(Command.SELF_TEST)),
]


def pad(**changes: object) -> SensorDesign:
    return preset("piacenza2017-pad").with_(**(EACH | changes))


def test_each_emitter_s_signal_is_the_difference_to_the_mean_of_its_own_dark_states() -> None:
    states = lit_emitters(2, "each")
    assert states == (None, 0, None, 1, None)
    assert nearest_dark_states(states).tolist() == [[0, 2], [2, 4]]
    counts = np.array([[[14, 5], [50, 1023], [10, 7], [60, 9], [20, 3]]], dtype=np.uint16)
    whole = with_one_dark(counts, states, 1023)
    assert whole.tolist() == [[[58, 1023], [65, 11], [20, 7]]]
    assert signals_of(whole)[0].tolist() == [[50 - 12, 1023 - 7], [60 - 15, 9 - 5]]


def test_readings_with_one_dark_state_remain_as_they_are() -> None:
    states = lit_emitters(3)
    assert states == (0, 1, 2, None)
    assert nearest_dark_states(states).tolist() == [[3, 3]] * 3
    counts = np.random.default_rng(0).integers(0, 1024, (5, 4, 2)).astype(np.uint16)
    assert (with_one_dark(counts, states, 1023.0) == counts).all()


def test_a_frame_takes_the_time_of_its_states_and_check_names_the_field() -> None:
    design = pad()
    board, use = Circuit.of(design).board, design.board
    conversion_ms = 13 * 64 / 16e6 * 1e3
    by_hand = 17 * (0.020 + 8 * conversion_ms) + sending_time_ms(board, use, frame_bytes(8, 8, 10, "each"))
    assert Circuit.of(design).frame_ms == pytest.approx(by_hand)
    assert frame_bytes(8, 8, 10, "each") == 15 + 170


def test_the_driver_file_names_the_states_in_order_and_is_read_back() -> None:
    config = config_from_document(tomllib.loads(dump_driver_config(pad())), where="driver.toml")
    assert [state.emitter for state in config.states] == [
        "",
        *(name for n in range(1, 9) for name in (f"E{n}", "")),
    ]
    assert [one.state for one in config.emitters] == list(range(1, 17, 2))
    assert config.ambient.subtract_state is None
    assert config.frame.states == 17
    assert pad().digest != preset("piacenza2017-pad").with_(**{"board.frame_rate_hz": 40.0}).digest


@pytest.mark.parametrize("register", [False, True], ids=["pins", "shift registers"])
@pytest.mark.parametrize("board", ["avr", "arduino core"])
def test_both_programs_read_a_dark_state_after_each_emitter(
    board: str, register: bool, board_harness: Path, native_harness: None, tmp_path: Path
) -> None:
    design = pad(**({"board.emitters": {"shift_register": "74hc595"}} if register else {}))
    design = design if board == "avr" else portable_pad(design)
    settings = firmware_settings(Pad.of(design))
    table = random_table(settings)
    run = simulate(
        board_harness if board == "avr" else None, tmp_path, design, table, SAID, duration_us=200_000
    )
    assert run.layout.states == 17
    assert len(run.frames.counts) >= 8
    (hello, *_) = run.of(Kind.HELLO)
    assert unpack_hello(hello).dark == "each"
    assert unpack_hello(hello).bits == settings.circuit.adc.bits
    assert (run.frames.counts == quantised(table, settings.circuit.adc.bits)).all()
    (answer,) = run.of(Kind.SELF_TEST)
    assert unpack_self_test(answer).config_crc == settings.config_crc()


@pytest.mark.parametrize("dark", ["frame", "each"])
def test_shift_registers_take_the_time_of_their_edges(
    dark: str, native_harness: None, tmp_path: Path
) -> None:
    took_us = {}
    for kind, emitters in {
        "pins": {},
        "registers": {"board.emitters": {"shift_register": "74hc595"}},
    }.items():
        design = portable_pad(pad(**({"board.dark": dark} | emitters)))
        run = simulate(
            None, tmp_path, design, random_table(firmware_settings(Pad.of(design))), SAID, duration_us=90_000
        )
        held_us = (
            run.log["cycle"][run.log["kind"] == INPUT_HELD][1:] / run.clock_hz * 1e6
        )  # the first one is no frame's
        frames = held_us[: len(held_us) // run.layout.readings * run.layout.readings]
        by_state = frames.reshape(-1, run.layout.states, 8)
        took_us[kind] = float(np.median(by_state[:, -1, 0] - by_state[:, 0, 0]))
    states = len(lit_emitters(8, dark))
    (registers,) = Circuit.of(pad(**{"board.emitters": {"shift_register": "74hc595"}})).emitter_chips
    first_us = {"frame": 2 + 2 * 2, "each": 1 + 2 * 9}[dark]
    expected_us = states * registers.entry.switch_ms(8, dark) * 1e3 - first_us
    assert took_us["registers"] - took_us["pins"] == pytest.approx(expected_us, rel=0.12)
    assert (
        driver_config(pad(**{"board.emitters": {"shift_register": "74hc595"}})).timing.switch_us is not None
    )


def test_the_driver_s_signals_are_those_of_the_simulated_board() -> None:
    config = driver_config(pad(), 1e5, np.minimum(untouched(), 1023))
    with (
        FakePort(FakeBoard(config, press_table())) as port,
        Sensor(config, port=port.name, baseline_s=0) as sensor,
    ):
        frames = [sensor.read() for _ in range(40)]
    assert frames[0].counts.shape == (9, 8)
    assert sensor.descriptor.states == (*(f"E{n}" for n in range(1, 9)), "off")
    bright = untouched() < 1000
    found = np.mean([frame.signals for frame in frames], axis=0)
    np.testing.assert_allclose(found[bright], untouched()[bright], atol=1.5)
    assert all(frame.saturated[:-1][untouched() > 1030].all() for frame in frames)


@pytest.mark.parametrize("flicker_hz", [100.0, 120.0])
def test_a_lamp_s_flicker_is_removed_by_the_nearer_dark_states(flicker_hz: float) -> None:
    """Residues against their closed form, and against that of the dark state after each emitter alone."""
    lamp = {"noise.ambient_counts": 40.0, "noise.ambient_flicker": 0.3, "noise.flicker_hz": flicker_hz}
    readout = Readout(
        counts_per_flux=54_500.0, full_scale_counts=1023.0, read_noise_counts=0.5, relative_noise=0.003
    )
    flux = np.full((3000, 8, 8), 300 / 54_500.0)
    left, apart_s = {}, 0.0
    for dark in ("frame", "each"):
        chain = chain_of(without_noise(pad(**{"board.dark": dark})).with_(**lamp), readout)
        found = chain.counts(flux, 0.5137 * np.arange(3000), np.random.default_rng(0), is_ambient=True)
        assert found.shape == (3000, 9, 8)
        residue = signals_of(found.astype(np.float64)) - 300.0
        np.testing.assert_allclose(
            np.sqrt((residue**2).mean(axis=0)), chain.flicker_sigma_counts(), atol=0.15
        )
        left[dark] = float(np.sqrt((residue**2).mean()))
        apart_s = float(chain.read_at_s[1, 0] - chain.read_at_s[0, 0])
    after_alone = 40.0 * 0.3 * np.sqrt(1.0 - np.cos(2.0 * np.pi * flicker_hz * apart_s))
    assert left["each"] < 0.4 * after_alone
    assert left["each"] < 0.1 * left["frame"]


@pytest.mark.parametrize("quantised_readings", [True, False])
def test_the_noise_of_a_signal_has_the_mean_of_two_dark_readings(quantised_readings: bool) -> None:
    readout = Readout(
        counts_per_flux=54_500.0, full_scale_counts=1023.0, read_noise_counts=0.5, relative_noise=0.003
    )
    flux = np.full((4000, 8, 8), 300.3 / 54_500.0)
    found = {}
    for dark in ("frame", "each"):
        changes = {"board.dark": dark, "noise.read_noise_counts": 1.0, "noise.quantised": quantised_readings}
        chain = chain_of(without_noise(pad()).with_(**(changes | {"noise.dark_counts": 20.0})), readout)
        drawn = chain.counts(flux, np.arange(4000.0), np.random.default_rng(1))
        found[dark] = signals_of(drawn.astype(np.float64)).std(axis=0)
        np.testing.assert_allclose(found[dark], pair_sigma_counts(chain, flux[0] * 54_500.0), rtol=0.06)
        assert np.median(found[dark]) == pytest.approx(
            np.median(pair_sigma_counts(chain, flux[0] * 54_500.0)), rel=0.01
        )
    assert (found["each"] < found["frame"]).all()


def test_a_board_with_other_dark_states_is_refused_even_if_its_design_is_accepted() -> None:
    each, frame = driver_config(pad()), driver_config(preset("piacenza2017-pad"))
    hello = unpack_hello(FakeBoard(each, press_table()).heard(pack_command(Command.IDENTIFY), 0.0))
    check_hello(hello, each, where="port", accept_digest=None)
    with pytest.raises(
        DeviceError, match=r'10 bits, dark states "each"; driver\.toml of \S+ has 8, 8, 10, "frame"'
    ):
        check_hello(hello, frame, where="port", accept_digest=each.digest)
