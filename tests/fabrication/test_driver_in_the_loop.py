"""The host's driver reads the serial line of the compiled firmware, on a simulated board in real time."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from design.errors import DeviceError
from design.preset import preset
from design.spec import SensorDesign
from fabrication.driver.check import check_frames
from fabrication.driver.sensor import Sensor
from fabrication.driver.simulated.faults import faults_of
from fabrication.driver_config import dump_driver_config
from fabrication.sketch import firmware_settings
from tests.fabrication.driver.made_up_pad import pad_config, untouched
from tests.fabrication.simulated_board import (
    FULL_SCALE,
    SUPPLY_MV,
    board_on_a_port,
    light_table_mv,
    quantised,
    random_table,
)

PAD = preset("piacenza2017-pad")
OTHER = PAD.with_(**{"board.emitter_pins": [40, 22, 41, 23, 42, 24, 43, 25]})


@pytest.fixture
def config_of(tmp_path):
    def written(design: SensorDesign) -> Path:
        file = tmp_path / "driver.toml"
        file.write_text(dump_driver_config(design), encoding="utf-8")
        return file

    return written


@pytest.mark.slow
def test_a_thousand_frames_reach_the_host_and_every_reading_is_the_voltage(
    board_harness, tmp_path, config_of
):
    """Voltages of the light model, through firmware, line and driver."""
    table = light_table_mv(PAD)
    with (
        board_on_a_port(board_harness, tmp_path, PAD, table) as port,
        Sensor(config_of(PAD), port, rate_hz=0, baseline_s=0.0) as sensor,
    ):
        frames = [sensor.read() for _ in range(1000)]
        found = sensor.self_test()
        counts = sensor.counts
    assert all((frame.counts == quantised(table)).all() for frame in frames)
    assert np.diff([frame.sequence for frame in frames]).tolist() == [1] * 999
    assert (counts.lost, counts.damaged) == (0, 0)
    assert found.config_crc == firmware_settings(PAD).config_crc()
    steps_us = np.diff([frame.device_us for frame in frames])
    assert 1e6 / steps_us.mean() > 230.0  # by the board's clock; docs/validation/firmware.md says 235


def test_frames_of_the_firmware_reach_the_host_whole(board_harness, tmp_path, config_of):
    table = random_table(firmware_settings(PAD), seed=1)
    with (
        board_on_a_port(board_harness, tmp_path, PAD, table) as port,
        Sensor(config_of(PAD), port, baseline_s=0.0) as sensor,
    ):
        assert sensor.hello.digest == PAD.digest
        frames = [sensor.read() for _ in range(40)]
    assert all((frame.counts == quantised(table)).all() for frame in frames)
    ambient = quantised(table)[-1]
    assert (frames[0].signals == quantised(table)[:-1] - ambient).all()


@pytest.mark.slow
def test_firmware_of_another_design_is_refused_by_the_host(board_harness, tmp_path, config_of):
    table = random_table(firmware_settings(OTHER))
    with (
        board_on_a_port(board_harness, tmp_path, OTHER, table) as port,
        pytest.raises(DeviceError, match=OTHER.digest[:8]),
        Sensor(config_of(PAD), port, baseline_s=0.0),
    ):
        pass


@pytest.mark.slow
def test_twelve_receivers_reach_the_host_in_their_columns(board_harness, tmp_path, config_of):
    design = preset("oblong-60x40")
    table = random_table(firmware_settings(design))
    with (
        board_on_a_port(board_harness, tmp_path, design, table) as port,
        Sensor(config_of(design), port, baseline_s=0.0) as sensor,
    ):
        frames = [sensor.read() for _ in range(5)]
    assert all((frame.counts == quantised(table)).all() for frame in frames)


def test_wrong_wires_on_the_simulated_board_are_named_by_the_check(board_harness, tmp_path):
    config = pad_config()
    faults = faults_of(config, ["swap:E1,E4", "dead:R2", "saturated:R7"])
    lit = np.minimum(faults.applied(untouched()), FULL_SCALE) / FULL_SCALE * SUPPLY_MV
    table_mv = np.vstack([np.rint(lit).astype(np.int64), np.zeros((1, 8), np.int64)])
    table_mv[:, faults.is_saturated] = SUPPLY_MV
    with (
        board_on_a_port(board_harness, tmp_path, PAD, table_mv) as port,
        Sensor(config, port, baseline_s=0.0) as sensor,
    ):
        frames = [sensor.read() for _ in range(20)]
        verdict = check_frames(frames, sensor.descriptor, sensor.self_test())
    named = [(problem.kind, problem.parts) for problem in verdict.problems]
    assert sorted(named) == [("dead", ("R2",)), ("saturated", ("R7",)), ("swapped", ("E1", "E4"))]
