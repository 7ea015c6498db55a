"""Reads a simulated pad like `optopad.Sensor`: reading a frame advances the simulation until the frame is delivered.

    left = optopad.SimulatedSensor(left_pad, data, control_and_step)
    right = optopad.SimulatedSensor(right_pad, data, beside=left)
    with left, right:
        for touch in optopad.TouchReader(left, model).touches(seconds=2.0):  # two seconds of the simulation
            print(touch, right.waiting)

Every step is seen by all sensors that share it, and each keeps its frames until they are read. A simulation that the
user's own program advances needs no function: what was delivered by `data.time` is waiting, and only `read` without a
waiting frame steps. All times are the simulation's.
"""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Self

import mujoco
import numpy as np

from optopad.design.arrays import FloatArray
from optopad.design.errors import InputError
from optopad.fabrication.driver.descriptor import Descriptor
from optopad.fabrication.driver.link.frames import Frame
from optopad.fabrication.driver.recording.recorder import Recorder
from optopad.fabrication.driver.sensor import BASELINE_S, PATIENCE_S
from optopad.fabrication.driver.stream import QUEUE_FRAMES, LinkCounts
from optopad.fabrication.driver_file import DriverConfig
from optopad.fabrication.scene.simulated_pad import SimulatedPad

if TYPE_CHECKING:
    from mujoco import MjData


class SimulatedSensor:
    """A simulated pad with the interface of `optopad.Sensor`.

    Parameters
    ----------
    pad : the pad, whose frames nothing else reads
    data : state of the simulation
    step : function that advances the simulation by a part of a frame or by several; if None, one `mj_step`
    beside : sensor of another pad in the same simulation, whose steps this one shares; then without `step`

    Attributes
    ----------
    config, descriptor : driver configuration of the design, and what the readings are
    patience_s : longest time without a frame [s]

    Raises
    ------
    InputError : `beside` has other data or the same pad, or a function to step was given along with it.
    """

    def __init__(
        self,
        pad: SimulatedPad,
        data: MjData,
        step: Callable[[], None] | None = None,
        *,
        beside: SimulatedSensor | None = None,
    ) -> None:
        self.pad, self._data = pad, data
        self.config: DriverConfig = pad.config
        self.descriptor: Descriptor = pad.descriptor
        self.patience_s = max(PATIENCE_S, 3.0 * pad.interval_s)
        self._queue: deque[Frame] = deque()
        self._overrun = 0
        if beside is None:
            self._step = step or (lambda: mujoco.mj_step(pad.model, data))
            self._together = [self]
        else:
            _require_apart(self, beside, step)
            self._step, self._together = beside._step, beside._together
            self._together.append(self)
        pad.observe(data)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        self.pad.close(is_clean=kind is None or not issubclass(kind, Exception))

    def __iter__(self) -> Iterator[Frame]:
        while True:
            yield self.read()

    def look(self) -> None:
        """Take the frames that were delivered by `data.time`; call it between steps that the program takes itself."""
        self._queue.extend(self.pad.arrived(self._data))
        while len(self._queue) > QUEUE_FRAMES:
            self._queue.popleft()
            self._overrun += 1

    def read(self) -> Frame:
        """The next frame; the simulation is advanced until it is delivered, if none is waiting.

        Raises
        ------
        InputError : the function to step does not advance `data.time`.
        """
        self.look()
        while not self._queue:
            self._advance()
        return self._queue.popleft()

    def frames(self, count: int | None = None, seconds: float | None = None) -> Iterator[Frame]:
        """Yield frames until a number of frames or a simulated time [s] is reached; None means no limit."""
        end_s = np.inf if seconds is None else self._data.time + seconds
        taken = 0
        while count is None or taken < count:
            self.look()
            while not self._queue and self._data.time < end_s:
                self._advance()
            if not self._queue or self._queue[0].host_s > end_s:
                return
            taken += 1
            yield self._queue.popleft()

    def new_frames(self, seconds: float, least: int = 1) -> list[Frame]:
        """The frames of one connection that are delivered from now on, for a time [s] and until there are `least`."""
        self.skip_waiting()
        end_s, frames = self._data.time + seconds, [self.read()]
        while self._data.time < end_s or len(frames) < least:
            frame = self.read()
            if frame.connection != frames[0].connection:
                end_s, frames = self._data.time + seconds, []
            frames.append(frame)
        return frames

    def take_baseline(self, seconds: float = BASELINE_S) -> FloatArray:
        """Read the untouched pad for a time [s]; the mean of its signals becomes the baseline.

        A pad has one from before the simulation, so this is only needed for a scene in which that has changed.

        Returns
        -------
        mean signals, shape (emitters, receivers) [counts]
        """
        baseline: FloatArray = np.mean([frame.signals for frame in self.new_frames(seconds)], axis=0)
        self.pad.baseline = baseline
        self._queue.clear()
        return baseline

    def skip_waiting(self) -> None:
        """Discard the frames that are waiting to be read, so that the next one is new."""
        self.look()
        self._queue.clear()

    def record(self, path: str | os.PathLike[str]) -> Recorder:
        """Record every frame from now on, even if it is never read; see `SimulatedPad.record`."""
        return self.pad.record(path)

    @property
    def waiting(self) -> int:
        """Number of frames that are waiting to be read."""
        self.look()
        return len(self._queue)

    @property
    def counts(self) -> LinkCounts:
        """Counts of frames and of resets of the scene; nothing is lost or damaged."""
        return LinkCounts(
            frames=self.pad.made, overrun=self._overrun, reconnects=max(self.pad.connection - 1, 0)
        )

    @property
    def baseline(self) -> FloatArray | None:
        """Signals of the untouched pad, shape (emitters, receivers) [counts]; None if no baseline was taken."""
        return self.pad.baseline

    @property
    def port(self) -> str:
        """Name of the pad, in place of that of a port."""
        return f"simulated pad {self.pad.name!r}"

    @property
    def rate_hz(self) -> float:
        """Frames per second."""
        return 1.0 / self.pad.interval_s

    @property
    def now_s(self) -> float:
        """Present time of the simulation [s]."""
        return float(self._data.time)

    @property
    def silent_s(self) -> float:
        """Time since the latest frame was delivered [s]."""
        self.look()
        return max(float(self._data.time) - self.pad.last.host_s, 0.0)

    @property
    def fault(self) -> str:
        """Why no frames arrive: always "", as a simulation has no faults of the line."""
        return ""

    def _advance(self) -> None:
        before_s = self._data.time
        self._step()
        if self._data.time == before_s:
            raise InputError(
                "step: did not advance data.time; give a function that calls mujoco.mj_step with this data"
            )
        for one in self._together:
            one.look()


def _require_apart(own: SimulatedSensor, beside: SimulatedSensor, step: Callable[[], None] | None) -> None:
    if own._data is not beside._data:
        raise InputError("beside: has other data; two pads share steps in one simulation only")
    if step is not None:
        raise InputError("step: is given along with beside, whose steps are shared; give one of them")
    if any(one.pad.name == own.pad.name for one in beside._together):
        raise InputError(
            f"beside: reads the pad {own.pad.name!r} already; two pads of one model have two names, by the prefixes "
            "with which they are attached"
        )
