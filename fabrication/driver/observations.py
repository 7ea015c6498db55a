"""Frames of an open sensor as observations of a robot's steps, for data sets that are recorded with LeRobot."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from design.arrays import FloatArray
from fabrication.driver.recording.lerobot import (
    SIGNALS,
    Take,
    checked_take,
    features_of,
    gathered,
    rows_of_step,
)
from fabrication.driver.sensor import Sensor


class Observations:
    """The frames of an open sensor as observations of a robot's steps.

        observations = Observations(sensor, fps=30)
        dataset = LeRobotDataset.create(name, fps=30, features=observations.features | of_the_robot)
        ...
        dataset.add_frame(observations.step() | of_this_step)

    Parameters
    ----------
    sensor : open sensor, which nothing else reads
    fps : steps per second
    take : what becomes of the frames of a step: "mean", "last" or "all"

    Raises
    ------
    InputError : `fps` or `take` is not permitted.
    """

    def __init__(self, sensor: Sensor, fps: int, take: Take = "mean") -> None:
        self._sensor, self._take = sensor, checked_take(fps, take)
        said = sensor.descriptor
        self._rows = rows_of_step(said.required_rate_hz, fps)
        self.features = features_of(said.emitters.names, said.receivers.names, self._rows, take)
        self._last: FloatArray | None = None

    def step(self) -> dict[str, NDArray[np.float32]]:
        """Observation of the frames since the step before; the first step waits for a frame.

        Raises
        ------
        DeviceError : no frame arrived yet.
        """
        waited = [self._sensor.read()] if self._last is None else []
        frames = waited + [self._sensor.read() for _ in range(self._sensor.waiting)]
        signals = np.array([frame.signals.ravel() for frame in frames], dtype=np.float64)
        if self._last is not None and not frames:
            signals = self._last[None]
        self._last = signals[-1]
        return {SIGNALS: gathered(signals, self._take, self._rows)}
