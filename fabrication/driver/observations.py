"""Frames of an open sensor as observations of a robot's steps, for data sets that are recorded with LeRobot."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from optopad.design.errors import DeviceError
from optopad.fabrication.driver.frame_source import FrameSource
from optopad.fabrication.driver.link.frames import US_PER_S, Frame
from optopad.fabrication.driver.recording.lerobot import (
    SIGNALS,
    Take,
    checked_take,
    features_of,
    gathered,
    rows_of_step,
)

AGE = f"{SIGNALS}_age"
"""Name of the observation that states how old a step's latest frame is."""


class Observations:
    """The frames of an open sensor as observations of a robot's steps.

        observations = Observations(sensor, fps=30)
        dataset = LeRobotDataset.create(name, fps=30, features=observations.features | of_the_robot)
        ...
        dataset.add_frame(observations.step() | of_this_step)

    A step without a new frame repeats the latest one, and its age grows. An age above 1/fps shows a repeated reading,
    for example while the board is plugged in again.

    Parameters
    ----------
    sensor : open sensor, or `optopad.SimulatedSensor`, which nothing else reads
    fps : steps per second
    take : what becomes of the frames of a step: "mean", "last" or "all"

    Attributes
    ----------
    features : the features of a step, as LeRobot describes them
    age_s : time since the latest frame arrived, at the latest step [s]; NaN before the first step

    Raises
    ------
    InputError : `fps` or `take` is not permitted.
    """

    def __init__(self, sensor: FrameSource, fps: float, take: Take = "mean") -> None:
        self._sensor, self._take = sensor, checked_take(fps, take)
        self._step_us = US_PER_S / fps
        said = sensor.descriptor
        self._rows = rows_of_step(said.required_rate_hz, fps)
        own = features_of(said.emitters.names, said.receivers.names, self._rows, take)
        self.features: dict[str, Any] = own | {AGE: _AGE_FEATURE}
        self.age_s = math.nan
        self._last: Frame | None = None

    def step(self) -> dict[str, NDArray[np.float32]]:
        """Observation of the frames since the step before, and of the last 1/fps at most; the first step waits for one.

        Frames of an earlier connection are not used once the board was plugged in again.

        Raises
        ------
        DeviceError : no frame arrived for the sensor's `patience_s`.
        """
        frames = [self._sensor.read()] if self._last is None else []
        is_all = False
        while not is_all:
            frames += [self._sensor.read() for _ in range(self._sensor.waiting)]
            self.age_s = self._sensor.silent_s
            is_all = self._sensor.waiting == 0
        if self.age_s >= self._sensor.patience_s:
            raise DeviceError(self._sensor.fault or "no frame arrived in time; read again")
        last = frames[-1] if frames else self._last
        assert last is not None
        self._last = last
        since_us = last.device_us - self._step_us
        recent = [one for one in frames if one.connection == last.connection and one.device_us > since_us]
        signals = np.array([one.signals.ravel() for one in recent or [last]], dtype=np.float64)
        return {
            SIGNALS: gathered(signals, self._take, self._rows),
            AGE: np.array([self.age_s], dtype=np.float32),
        }


_AGE_FEATURE: dict[str, Any] = {
    "dtype": "float32",
    "shape": [1],
    "names": ["age_s"],
    "info": {"description": "time since the latest frame of the step arrived", "unit": "s"},
}
