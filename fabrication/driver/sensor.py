"""Reads a manufactured sensor: a context manager that yields frames.

    from optopad.fabrication.driver import Sensor

    with Sensor("driver.toml") as sensor:
        for frame in sensor:
            print(frame.sequence, frame.normalised)

The `with` statement finds the board, waits until it has restarted, refuses it if it is of another design, starts it,
and takes a baseline of the untouched pad. Every delivered frame is complete and checked; missing frames are counted.

A board that was unplugged is found again, also under another name of its port. Its frames then have the next connection
number. The baseline is kept, because the pad may be touched at that moment; `take_baseline` renews it.
"""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable, Iterable, Iterator
from typing import TYPE_CHECKING

import numpy as np

from optopad.design.arrays import FloatArray
from optopad.design.errors import DeviceError, InputError
from optopad.fabrication.driver.descriptor import Descriptor, descriptor_of
from optopad.fabrication.driver.link.frames import Frame, FrameDecoder
from optopad.fabrication.driver.link.link import ANSWER_S, Link, check_hello, interval_us, require_digest
from optopad.fabrication.driver.link.ports import (
    GATHER_S,
    GUESSED,
    Port,
    find_port,
    is_guess,
    on_standard_error,
    serial_number_of,
)
from optopad.fabrication.driver.link.protocol import Hello, SelfTest, frame_format
from optopad.fabrication.driver.recording.recorder import Recorder
from optopad.fabrication.driver.stream import LinkCounts, Stream
from optopad.fabrication.driver_file import DriverConfig, load_driver_config

if TYPE_CHECKING:
    from typing_extensions import Self  # in typing from Python 3.11

BASELINE_S = 0.5
PATIENCE_S = 10.0
POLL_S = 0.2
"""Longer waits are divided into waits of this length, so that Ctrl-C works on every operating system [s]."""

FASTEST_HZ = 100_000.0
SLOWEST_HZ = 0.001
"""Lowest permitted frame rate, the same as in a design [Hz]."""

SILENCE_S = 1.0
"""If no frame arrives for this time and three frame intervals, or for `patience_s`, the board counts as silent [s]."""


class Sensor:
    """A manufactured sensor on its serial port; a context manager that yields frames.

    Parameters
    ----------
    config : path of the design's driver.toml, or the configuration read from it
    port : name of the port, or ``serial:`` and the serial number of its USB device; if None, the board is found by its
        USB identity
    rate_hz : frames per second; 0 for the board's highest rate. If None, the design's rate is used
    accept_digest : first 8 or more digits of the digest of another accepted design, or None
    baseline_s : time for which the untouched pad is read on opening [s]; 0 for no baseline
    patience_s : longest wait for a frame, including reconnection, and for the board on opening [s]; if None, 10 s. The
        limit for a frame is at least three frame intervals, that on opening at least the boot time of the board
    gather_s : interval at which frames are delivered in batches, to reduce the processor's load [s]; 0 to deliver each
        frame immediately
    not_ports : names of ports to exclude when the board is searched, because other devices such as a stage use them
    on_wait : called with progress lines about the chosen port and the wait for the board. If None, they are printed on
        standard error

    Attributes
    ----------
    config : configuration of the design
    descriptor : geometry, names, units and rates of the readings
    patience_s : longest wait for a frame, including reconnection [s]
    serial_number : serial number of the board's USB device at the latest connection; "" if it has none
    """

    def __init__(
        self,
        config: str | os.PathLike[str] | DriverConfig,
        port: str | None = None,
        *,
        rate_hz: float | None = None,
        accept_digest: str | None = None,
        baseline_s: float = BASELINE_S,
        patience_s: float | None = None,
        gather_s: float = GATHER_S,
        not_ports: Iterable[str] = (),
        on_wait: Callable[[str], None] | None = None,
    ) -> None:
        self.config = config if isinstance(config, DriverConfig) else load_driver_config(config)
        self.descriptor: Descriptor = descriptor_of(self.config)
        self._port = port
        self._rate_hz = self.config.timing.wanted_hz if rate_hz is None else rate_hz
        require_rate(self._rate_hz)
        require_digest(accept_digest)
        self._accept_digest = accept_digest
        self._baseline_s = baseline_s
        if patience_s is not None and not 0.0 < patience_s < math.inf:
            raise InputError(f"patience_s: {patience_s:g} is refused: give more than 0 [s]")
        self._opening_s = max(
            PATIENCE_S if patience_s is None else patience_s, self.config.board.boot_s + ANSWER_S
        )
        three_s = 3.0 / self._rate_hz if self._rate_hz else 0.0
        self.patience_s = max(self._opening_s if patience_s is None else patience_s, three_s)
        self._silence_s = min(max(SILENCE_S, three_s), self.patience_s)
        self.serial_number = ""
        self._not_ports = tuple(not_ports)
        self._on_wait = on_wait or on_standard_error
        self._gather_s = gather_s
        self._decoder = _decoder_of(self.config)
        self._stream: Stream | None = None
        self._found_port: str | None = None

    def __enter__(self) -> Self:
        self._found_port = None
        self._decoder = _decoder_of(self.config)
        self._stream = Stream(self._connected, self._decoder, interval_us(self._rate_hz), self._checked)
        try:
            self._stream.begin()
            if self._baseline_s > 0:
                self.take_baseline(self._baseline_s)
        except BaseException:
            self._stream.end(is_clean=False)
            raise
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        self._open.end(is_clean=kind is None or not issubclass(kind, Exception))

    def __iter__(self) -> Iterator[Frame]:
        while True:
            yield self.read()

    def frames(self, count: int | None = None, seconds: float | None = None) -> Iterator[Frame]:
        """Yield frames until a number of frames or a time [s] is reached, whichever is first; None means no limit.

        Raises
        ------
        DeviceError : no frame arrived within `patience_s`, or the time ended while the board was lost or silent.
        OutputError : a recording failed; it contains all earlier frames.
        """
        begun = time.monotonic()
        end = None if seconds is None else begun + seconds
        taken = 0
        while (count is None or taken < count) and (end is None or time.monotonic() < end):
            frame = self._open.taken(POLL_S) if end is not None else self.read()
            if frame is not None:
                taken += 1
                yield frame
            elif min(self.silent_s, time.monotonic() - begun) >= self.patience_s:
                raise self._silence()
        if end is not None and time.monotonic() >= end and self.fault:
            raise self._silence()

    def read(self) -> Frame:
        """The next frame.

        Raises
        ------
        DeviceError : no frame arrived within `patience_s`.
        OutputError : a recording failed; it contains all earlier frames, and reading may continue.
        """
        stream, end = self._open, time.monotonic() + self.patience_s
        while time.monotonic() < end:
            frame = stream.taken(POLL_S)
            if frame is not None:
                return frame
        raise self._silence()

    def take_baseline(self, seconds: float = BASELINE_S) -> FloatArray:
        """Read the untouched pad for a time [s]; the mean of its signals becomes the baseline.

        Returns
        -------
        mean signals, shape (emitters, receivers) [counts]
        """
        baseline: FloatArray = np.mean([frame.signals for frame in self.new_frames(seconds)], axis=0)
        self._decoder.baseline = baseline
        self._open.forget_waiting()
        return baseline

    def new_frames(self, seconds: float, least: int = 1) -> list[Frame]:
        """The frames of one connection that arrive from now on, for a time [s] and until there are `least` of them.

        Raises the same errors as `read`.
        """
        self.skip_waiting()
        end, frames = time.monotonic() + seconds, [self.read()]
        while time.monotonic() < end or len(frames) < least:
            frame = self.read()
            if frame.connection != frames[0].connection:
                end, frames = time.monotonic() + seconds, []
            frames.append(frame)
        return frames

    @property
    def waiting(self) -> int:
        """Number of frames that are waiting to be read."""
        return self._open.waiting

    def skip_waiting(self) -> None:
        """Discard the frames that are waiting to be read, so that the next one is new; they do not count as lost."""
        self._open.forget_waiting()

    def record(self, path: str | os.PathLike[str]) -> Recorder:
        """Record every frame from now on, even if it is never read, until the recorder or the sensor is closed.

        Raises
        ------
        OutputError : the file exists, or cannot be written.
        """
        recorder = Recorder(path, self.config)
        self._open.record(recorder)
        return recorder

    def self_test(self, timeout_s: float = 3.0) -> SelfTest:
        """Request the board's self-test and return its result; raises DeviceError if the board does not reply in
        time."""
        return self._open.self_test(timeout_s)

    @property
    def port(self) -> str:
        """Name of the open port."""
        return self._open.link.port.name

    @property
    def hello(self) -> Hello:
        """The description of itself (hello) that the board sent at the latest connection."""
        return self._open.hello

    @property
    def counts(self) -> LinkCounts:
        """Counts of received, lost and damaged frames, and of reconnections."""
        return self._open.counts

    @property
    def rate_hz(self) -> float | None:
        """Delivered frames per second, over the last 256 frames by the board's clock.

        It is None before a connection's second frame, and 0 while no frames arrive.
        """
        return 0.0 if self.fault else self._decoder.rate_hz

    @property
    def silent_s(self) -> float:
        """Time since the latest frame arrived, or since the opening if none did [s]."""
        return time.monotonic() - self._open.heard_at

    @property
    def now_s(self) -> float:
        """Present time on the clock of `Frame.host_s`, since 1970 [s]."""
        return time.time()

    @property
    def fault(self) -> str:
        """Why no frames arrive, "" while they do: the port is lost, or the board silent for 1 s and three intervals."""
        is_silent = self._open.why_away or self.silent_s > self._silence_s
        return str(self._silence()) if is_silent else ""

    @property
    def baseline(self) -> FloatArray | None:
        """Signals of the untouched pad, shape (emitters, receivers) [counts]; None if no baseline was taken."""
        return self._decoder.baseline

    @property
    def _open(self) -> Stream:
        if self._stream is None:
            raise DeviceError("the sensor is not open; use it as `with Sensor(...) as sensor:`")
        return self._stream

    def _silence(self) -> DeviceError:
        stream = self._open
        return DeviceError(
            stream.why_away
            or f"{self.port}: no whole frame for {self.silent_s:.2g} s ({stream.counts.skipped_bytes} bytes outside "
            f"frames, {stream.counts.damaged} damaged frames); check cable and board, lower the rate or baud"
        )

    def _checked(self, hello: Hello) -> Hello:
        check_hello(hello, self.config, where=self.port, accept_digest=self._accept_digest)
        return hello

    def _connected(self, is_over: Callable[[], bool]) -> tuple[Link, Hello]:
        name, guessed = self._port or self._found_port, False
        if name is None:
            found = find_port(self.config.board, not_ports=self._not_ports)
            name, guessed = found.name, is_guess(found, self.config.board)
        if guessed:
            self._on_wait(
                f"port      {found} is taken for the {self.config.board.title}. {GUESSED} Opening it may reset the "
                "device; --port names another"
            )
        port = Port(name, self.config.board.baud, self._gather_s)
        try:
            link = Link(port, self.config)
            hello = link.greet(
                accept_digest=self._accept_digest,
                patience_s=self._opening_s,
                is_guess=guessed,
                is_over=is_over,
                on_wait=self._on_wait,
            )
            if guessed:
                self._found_port = name  # after unplugging, the only such chip may be a printer's
            self.serial_number = serial_number_of(port.name)
            return link, hello
        except BaseException:
            port.close()
            raise


def require_rate(rate_hz: float) -> None:
    """Check that a board may be asked for so many frames per second; raises InputError otherwise."""
    if rate_hz != 0 and not SLOWEST_HZ <= rate_hz <= FASTEST_HZ:
        raise InputError(
            f"rate_hz: {rate_hz:g} is refused: 0 (as fast as it can), or {SLOWEST_HZ:g} to {FASTEST_HZ:g}"
        )


def _decoder_of(config: DriverConfig) -> FrameDecoder:
    return FrameDecoder(frame_format(config), config.timing.frame_ms / 1e3)
