"""The host's driver reads the serial line of the compiled firmware, on a simulated board in real time."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from optopad.design.circuit.circuit import Circuit
from optopad.design.errors import DeviceError
from optopad.design.pad import Pad
from optopad.design.preset import preset
from optopad.design.spec import SensorDesign
from optopad.fabrication.driver.check import check_frames
from optopad.fabrication.driver.sensor import Sensor
from optopad.fabrication.driver.simulated.board import faults_of
from optopad.fabrication.driver_config import dump_driver_config
from optopad.fabrication.sketch import firmware_settings
from tests.fabrication.driver.made_up_pad import pad_config, untouched
from tests.fabrication.simulated_board import (
    FULL_SCALE,
    SUPPLY_MV,
    board_on_a_port,
    harness_name,
    light_table_mv,
    portable_pad,
    quantised,
    random_table,
)

PAD = preset("piacenza2017-pad")
BOARDS = {"avr": PAD, "arduino": portable_pad(PAD)}
SWAPPED = {"board.emitter_pins": [40, 22, 41, 23, 42, 24, 43, 25]}


@pytest.fixture(params=BOARDS)
def pad(request: pytest.FixtureRequest) -> SensorDesign:
    """The paper's pad on an AVR board, and on one with another Arduino core."""
    return BOARDS[request.param]


@pytest.fixture
def on_a_port(request: pytest.FixtureRequest, tmp_path):
    """Puts a design's simulated board on a port."""

    def started(design: SensorDesign, table_mv):
        return board_on_a_port(request.getfixturevalue(harness_name(design)), tmp_path, design, table_mv)

    return started


def counts_of(design: SensorDesign, table_mv):
    """(state, receiver) counts of a table of voltages on a design's board."""
    return quantised(table_mv, Circuit.of(design).adc.bits)


@pytest.fixture
def config_of(tmp_path):
    def written(design: SensorDesign) -> Path:
        file = tmp_path / "driver.toml"
        file.write_text(dump_driver_config(design), encoding="utf-8")
        return file

    return written


@pytest.mark.slow
def test_a_thousand_frames_reach_the_host_and_every_reading_is_the_voltage(on_a_port, config_of, pad):
    """Voltages of the light model, through firmware, line and driver."""
    table = light_table_mv(PAD)
    with (
        on_a_port(pad, table) as port,
        Sensor(config_of(pad), port, rate_hz=0, baseline_s=0.0) as sensor,
    ):
        frames = [sensor.read() for _ in range(1000)]
        found = sensor.self_test()
        counts = sensor.counts
    expected = counts_of(pad, table)
    assert all((frame.counts == expected).all() for frame in frames)
    assert np.diff([frame.sequence for frame in frames]).tolist() == [1] * 999
    assert (counts.lost, counts.damaged) == (0, 0)
    assert found.config_crc == firmware_settings(Pad.of(pad)).config_crc()
    steps_us = np.diff([frame.device_us for frame in frames])
    assert 1e6 / steps_us.mean() > 230.0  # by the board's clock; docs/validation/firmware.md says 235


def test_frames_of_the_firmware_reach_the_host_whole(on_a_port, config_of, pad):
    table = random_table(firmware_settings(Pad.of(pad)), seed=1)
    with (
        on_a_port(pad, table) as port,
        Sensor(config_of(pad), port, baseline_s=0.0) as sensor,
    ):
        assert sensor.hello.digest == pad.digest
        frames = [sensor.read() for _ in range(40)]
    counts = counts_of(pad, table)
    assert all((frame.counts == counts).all() for frame in frames)
    assert (frames[0].signals == counts[:-1] - counts[-1]).all()


@pytest.mark.slow
def test_firmware_of_another_design_is_refused_by_the_host(on_a_port, config_of, pad):
    other = pad.with_(**SWAPPED)
    table = random_table(firmware_settings(Pad.of(other)))
    with (
        on_a_port(other, table) as port,
        pytest.raises(DeviceError, match=other.digest[:8]),
        Sensor(config_of(pad), port, baseline_s=0.0),
    ):
        pass


@pytest.mark.slow
def test_twelve_receivers_reach_the_host_in_their_columns(on_a_port, config_of):
    design = preset("oblong-60x40")
    table = random_table(firmware_settings(Pad.of(design)))
    with (
        on_a_port(design, table) as port,
        Sensor(config_of(design), port, baseline_s=0.0) as sensor,
    ):
        frames = [sensor.read() for _ in range(5)]
    assert all((frame.counts == quantised(table)).all() for frame in frames)


def test_wrong_wires_on_the_simulated_board_are_named_by_the_check(on_a_port):
    config = pad_config()
    faults = faults_of(config, ["swap:E1,E4", "dead:R2", "saturated:R7"])
    lit = np.minimum(faults.applied(untouched()), FULL_SCALE) / FULL_SCALE * SUPPLY_MV
    table_mv = np.vstack([np.rint(lit).astype(np.int64), np.zeros((1, 8), np.int64)])
    table_mv[:, faults.is_saturated] = SUPPLY_MV
    with (
        on_a_port(PAD, table_mv) as port,
        Sensor(config, port, baseline_s=0.0) as sensor,
    ):
        frames = [sensor.read() for _ in range(20)]
        verdict = check_frames(frames, sensor.descriptor, sensor.self_test())
    named = [(problem.kind, problem.parts) for problem in verdict.problems]
    assert sorted(named) == [("dead", ("R2",)), ("saturated", ("R7",)), ("swapped", ("E1", "E4"))]
