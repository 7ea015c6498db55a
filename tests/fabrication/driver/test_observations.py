"""Observations of a robot's steps: which frames they hold, how old these are, and an error once the board is gone."""

from __future__ import annotations

import os
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import optopad
from optopad.design.errors import DeviceError
from optopad.fabrication.driver.observations import AGE, Observations
from optopad.fabrication.driver.recording.lerobot import SIGNALS
from optopad.fabrication.driver.simulated.port import FakePort, PtyWire
from tests.fabrication.driver.made_up_pad import board, frame, pad_config

FPS = 20
STEP_US = 1_000_000 // FPS


class Scripted:
    """An open sensor whose frames and whose silence are set by hand.

    Attributes
    ----------
    frames : the waiting frames, as connection, time of the board [us] and count of every signal
    silent_s : time since the latest one arrived [s]
    """

    patience_s, fault = 1.0, "pad: no whole frame"

    def __init__(self) -> None:
        names = SimpleNamespace(names=tuple("12345678"))
        self.descriptor = SimpleNamespace(required_rate_hz=100.0, emitters=names, receivers=names)
        self.frames: list[tuple[int, int, int]] = []
        self.silent_s = 0.01

    @property
    def waiting(self) -> int:
        return len(self.frames)

    def read(self) -> Any:
        connection, device_us, count = self.frames.pop(0)
        counts = np.full((9, 8), count)
        counts[-1] = 0
        return replace(frame(counts), connection=connection, device_us=device_us)


def test_a_step_has_the_frames_of_one_step_s_time_and_of_the_newest_connection() -> None:
    sensor = Scripted()
    observations = Observations(sensor, FPS)  # type: ignore[arg-type]
    sensor.frames = [(1, k * 10_000, 100 + k) for k in range(900)]  # nine seconds that nobody read
    assert observations.step()[SIGNALS] == pytest.approx(np.full(64, 100 + 897))
    sensor.frames = [(1, 9_000_000, 500), (2, 10_000, 7), (2, 20_000, 9)]
    assert observations.step()[SIGNALS] == pytest.approx(np.full(64, 8))


def test_a_repeated_frame_has_its_age_and_is_refused_after_the_patience() -> None:
    sensor = Scripted()
    observations = Observations(sensor, FPS)  # type: ignore[arg-type]
    assert observations.features[AGE] | {"info": {}} == {
        "dtype": "float32",
        "shape": [1],
        "names": ["age_s"],
        "info": {},
    }
    sensor.frames = [(1, 0, 100)]
    steps = [observations.step()]
    for sensor.silent_s in (0.06, 0.9):
        steps.append(observations.step())
    assert [step[AGE].tolist() for step in steps] == [pytest.approx([age]) for age in (0.01, 0.06, 0.9)]
    assert {step[AGE].dtype for step in steps} == {np.dtype(np.float32)}
    assert observations.age_s == 0.9
    for frames in ([], [(1, STEP_US, 101)]):  # also if the last frames were not read in time
        sensor.silent_s, sensor.frames = 1.0, frames
        with pytest.raises(DeviceError, match="no whole frame"):
            observations.step()
    sensor.silent_s, sensor.frames = 0.01, [(2, 0, 50)]
    assert observations.step()[SIGNALS] == pytest.approx(np.full(64, 50))


@pytest.mark.skipif(os.name != "posix", reason="needs pseudo-terminals")
def test_an_unplugged_board_ends_the_steps_and_a_plugged_one_resumes_them(tmp_path) -> None:
    link = tmp_path / "pad"
    sensor = optopad.Sensor(pad_config(), str(link), rate_hz=200.0, baseline_s=0.0, patience_s=0.2)
    with FakePort(board(), PtyWire(link)) as port, sensor:
        observations = optopad.Observations(sensor, FPS)
        observations.step()
        port.unplug()
        ages = []

        def run() -> None:
            while True:
                observations.step()
                ages.append(observations.age_s)

        with pytest.raises(DeviceError, match="pad"):
            run()
        assert 0.1 < max(ages) < 0.2
        assert np.all(np.diff(ages) >= 0)
        with FakePort(board(), PtyWire(link)):
            assert any(one.connection == 2 for one in sensor.frames(seconds=5.0))
            observations.step()
            assert observations.age_s < 0.2
