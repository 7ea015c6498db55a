"""A dark state after each emitter: the time of a frame, the line, both programs, and the signals of the driver."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest

from design.circuit.pins import board_of, frame_bytes, frame_rate_hz, frame_time_ms, sending_time_ms
from design.preset import preset
from design.recordings import lit_emitters, signals_of, with_one_dark
from design.spec import SensorDesign
from fabrication.driver import Sensor
from fabrication.driver.link.protocol import Command, Kind, pack_command
from fabrication.driver.simulated.board import FakeBoard
from fabrication.driver.simulated.port import FakePort
from fabrication.driver_config import driver_config, dump_driver_config
from fabrication.driver_file import config_from_document
from fabrication.sketch import firmware_settings
from sims.readings.readout import Readout
from sims.readings.signal_chain import chain_of, without_noise
from tests.fabrication.driver.made_up_pad import press_table, untouched
from tests.fabrication.simulated_board import (
    portable_pad,
    quantised,
    random_table,
    simulate,
    unpack_self_test,
)

EACH = {"board.dark": "each", "board.frame_rate_hz": 40.0}
SAID = [
    (7_000.0, pack_command(Command.RATE, 0)),
    (8_000.0, pack_command(Command.START)),
    (90_000.0, pack_command(Command.SELF_TEST)),
]


def pad(**changes: object) -> SensorDesign:
    return preset("piacenza2017-pad").with_(**(EACH | changes))


def test_each_emitter_s_signal_is_the_difference_to_its_own_dark_state() -> None:
    counts = np.array([[[50, 1023], [10, 7], [60, 9], [20, 3]]])
    whole = with_one_dark(counts, 1023)
    assert whole.tolist() == [[[60, 1023], [60, 13], [20, 7]]]
    assert signals_of(whole)[0].tolist() == [[40, 1016], [40, 6]]
    assert lit_emitters(2) == (0, 1, None)
    assert lit_emitters(2, "each") == (0, None, 1, None)


def test_a_frame_takes_the_time_of_its_states_and_check_names_the_field() -> None:
    design = pad()
    board, use = board_of(design), design.board
    conversion_ms = 13 * 64 / 16e6 * 1e3
    by_hand = 16 * (0.020 + 8 * conversion_ms) + sending_time_ms(board, use, frame_bytes(8, 8, 10, "each"))
    assert frame_time_ms(board, use, 8, 8) == pytest.approx(by_hand)
    assert frame_bytes(8, 8, 10, "each") == 15 + 160


def test_the_driver_file_names_the_states_in_order_and_is_read_back() -> None:
    config = config_from_document(tomllib.loads(dump_driver_config(pad())), where="driver.toml")
    assert [state.emitter for state in config.states] == [name for n in range(1, 9) for name in (f"E{n}", "")]
    assert [one.state for one in config.emitters] == list(range(0, 16, 2))
    assert config.ambient.subtract_state is None
    assert config.frame.states == 16
    assert pad().digest != preset("piacenza2017-pad").with_(**{"board.frame_rate_hz": 40.0}).digest


@pytest.mark.parametrize("register", [False, True], ids=["pins", "shift registers"])
@pytest.mark.parametrize("board", ["avr", "arduino core"])
def test_both_programs_read_a_dark_state_after_each_emitter(
    board: str, register: bool, board_harness: Path, native_harness: None, tmp_path: Path
) -> None:
    design = pad(**({"board.emitters": {"shift_register": "74hc595"}} if register else {}))
    design = design if board == "avr" else portable_pad(design)
    settings = firmware_settings(design)
    table = random_table(settings)
    run = simulate(
        board_harness if board == "avr" else None, tmp_path, design, table, SAID, duration_us=200_000
    )
    assert run.layout.states == 16
    assert len(run.frames.counts) >= 8
    assert (run.frames.counts == quantised(table, settings.adc_bits)).all()
    (answer,) = run.of(Kind.SELF_TEST)
    assert unpack_self_test(answer).config_crc == settings.config_crc()


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


def test_a_lamp_s_flicker_is_removed_by_the_nearer_dark_state() -> None:
    """Residues against their closed form, by a lamp of 100 Hz and 40 counts."""
    lamp = {"noise.ambient_counts": 40.0, "noise.ambient_flicker": 0.3, "noise.flicker_hz": 100.0}
    readout = Readout(counts_per_flux=54_500.0, full_scale_counts=1023.0)
    flux = np.full((3000, 8, 8), 300 / 54_500.0)
    left = {}
    for dark in ("frame", "each"):
        chain = chain_of(without_noise(pad(**{"board.dark": dark})).with_(**lamp), readout)
        found = chain.counts(flux, 0.5137 * np.arange(3000), np.random.default_rng(0), is_ambient=True)
        assert found.shape == (3000, 9, 8)
        residue = signals_of(found.astype(np.float64)) - 300.0
        np.testing.assert_allclose(
            np.sqrt((residue**2).mean(axis=0)), chain.flicker_sigma_counts(), atol=0.15
        )
        left[dark] = float(np.sqrt((residue**2).mean()))
    assert left["each"] < 0.25 * left["frame"]


def test_the_page_has_the_figures_of_the_models() -> None:
    page = (Path(__file__).parents[2] / "docs" / "how-to" / "program-board.md").read_text(encoding="utf-8")
    text = " ".join(page.split())
    rates, residues = [], []
    for dark in ("each", "frame"):
        design = pad(**{"board.dark": dark})
        chain = chain_of(design, Readout(counts_per_flux=54_500.0, full_scale_counts=1023.0))
        rates.append(frame_rate_hz(design))
        residues.append(np.sqrt((chain.flicker_sigma_counts() ** 2).mean()))
    assert "{:.0f} frames a second on a Mega, not {:.0f}, by the timing model".format(*rates) in text
    assert "leaves {:.1f} counts (rms) in a pair's signal, not {:.1f}".format(*residues) in text
