"""What the readers of frames need of their source: a board on its port, or a pad in a simulation."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Protocol

from optopad.fabrication.driver.descriptor import Descriptor
from optopad.fabrication.driver.link.frames import Frame
from optopad.fabrication.driver.stream import LinkCounts


class FrameSource(Protocol):
    """An open source of frames: `Sensor`, or `optopad.SimulatedSensor`, whose clock is that of the simulation."""

    @property
    def descriptor(self) -> Descriptor:
        """Geometry, names, units and rates of the readings."""

    @property
    def port(self) -> str:
        """Name of the port, or of the simulated pad."""

    @property
    def counts(self) -> LinkCounts:
        """Counts of received, lost and damaged frames, and of reconnections."""

    @property
    def rate_hz(self) -> float | None:
        """Delivered frames per second; None while it is not known."""

    @property
    def patience_s(self) -> float:
        """Longest wait for a frame [s]."""

    @property
    def waiting(self) -> int:
        """Number of frames that are waiting to be read."""

    @property
    def silent_s(self) -> float:
        """Time since the latest frame arrived [s]."""

    @property
    def fault(self) -> str:
        """Why no frames arrive, "" while they do."""

    @property
    def now_s(self) -> float:
        """Present time on the clock of `Frame.host_s` [s]."""

    def read(self) -> Frame:
        """The next frame."""

    def frames(self, count: int | None = None, seconds: float | None = None) -> Iterator[Frame]:
        """Yield frames until a number of frames or a time [s] is reached, whichever is first; None means no limit."""

    def new_frames(self, seconds: float, least: int = 1) -> list[Frame]:
        """The frames that arrive from now on, for a time [s] and until there are `least` of them."""
