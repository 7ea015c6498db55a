"""Reads the port in a thread, so that a slow user program loses no frames: a queue holds about ten seconds of frames.

    port -> scanner -> decoder -> queue -> Sensor
                  \\-> recorder

If the port is lost, or the board on it is silent or has another design's firmware, the thread looks for the board ten
times per second, identifies it and starts it again, for as long as the sensor is open. A fault of optopad's own raises
an error when the next frame is read.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable
from contextlib import ExitStack, suppress
from dataclasses import dataclass

from optopad.design.errors import DeviceError, OutputError
from optopad.fabrication.driver.link.frames import Frame, FrameDecoder
from optopad.fabrication.driver.link.link import Link
from optopad.fabrication.driver.link.ports import PortLostError
from optopad.fabrication.driver.link.protocol import (
    Command,
    Hello,
    Kind,
    Message,
    SelfTest,
    unpack_hello,
    unpack_self_test,
)
from optopad.fabrication.driver.recording.recorder import Recorder

LOOK_EVERY_S = 0.1
"""Time between two searches for the board after its port was lost [s]."""

START_AGAIN_S = 1.0
"""If a board is silent for this time, the start command is sent again, because it may have been damaged [s]."""

OPEN_AGAIN = 5
"""After this number of start commands without a reply, the port is opened again, which resets most boards."""

LATE_HELLO_S = 1.5
"""A hello within this time after a board's first one is considered a repeated reply, not the sign of a reset [s]."""

QUEUE_FRAMES = 4096
"""Largest number of frames in the queue; ten seconds at 400 Hz."""

Connect = Callable[[Callable[[], bool]], tuple[Link, Hello]]
"""Function that opens a port and identifies the board; it stops waiting when its argument returns True."""


@dataclass
class LinkCounts:
    """Numbers of frames, errors and reconnections on a serial line since it was opened.

    Attributes
    ----------
    frames : complete frames received
    lost : frames missing, by their sequence numbers
    damaged : messages whose CRC was wrong
    skipped_bytes : bytes that belonged to no complete message
    overrun : frames discarded because they were not read in time
    reconnects : connections after the first one
    doubled : frames that arrived twice, with the same number and time; the second was discarded
    """

    frames: int = 0
    lost: int = 0
    damaged: int = 0
    skipped_bytes: int = 0
    overrun: int = 0
    reconnects: int = 0
    doubled: int = 0


class Stream:
    """Reads a board's frames in a thread and queues them, from the board's start to its stop.

    Parameters
    ----------
    connect : function that opens a port and identifies the board, see `Connect`
    decoder : decoder of the frames
    interval_us : frame interval [us]; 0 for the board's shortest interval
    checked : function that receives and returns a board's hello; it raises DeviceError if that is of another design

    Attributes
    ----------
    heard_at : time of the latest frame's arrival, or of the first connection, by the monotonic clock [s]
    why_away : why there is no connection; "" while there is one
    """

    def __init__(
        self, connect: Connect, decoder: FrameDecoder, interval_us: int, checked: Callable[[Hello], Hello]
    ) -> None:
        self._connect = connect
        self._checked = checked
        self._decoder = decoder
        self._interval_us = interval_us
        self._queue: deque[Frame] = deque()
        self._changed = threading.Condition()
        self._stopping = threading.Event()
        self._error: Exception | None = None
        self._notice: OutputError | None = None
        self._greeted_at = 0.0
        self._self_test: SelfTest | None = None
        self._past = LinkCounts()
        self._overrun = 0
        self._recorders: list[Recorder] = []
        self.why_away = ""
        self.link, self.hello = self._connection()
        self.heard_at = time.monotonic()
        self._thread = threading.Thread(target=self._run, name="optopad sensor", daemon=True)

    def begin(self) -> None:
        """Start the board and the thread."""
        self.link.start(self._interval_us)
        self._thread.start()

    def end(self, *, is_clean: bool) -> None:
        """Stop board and thread, and close port and recordings; may be called more than once, and after an error.

        Parameters
        ----------
        is_clean : whether open recordings are marked as having ended normally

        Raises
        ------
        OutputError : a recording could not be closed; everything else was stopped.
        """
        self._stopping.set()
        if self._thread.is_alive():
            self._thread.join()
        self.link.port.close()
        with ExitStack() as recordings:
            for recorder in self._recorders:
                recordings.callback(recorder.close, is_clean=is_clean)

    def record(self, recorder: Recorder) -> None:
        """Also pass every frame from now on to a recorder."""
        with self._changed:
            recorder.hello(self.link.hello_message, time.time())
            self._recorders.append(recorder)

    def taken(self, timeout_s: float) -> Frame | None:
        """Take the oldest frame from the queue; None if no frame arrived within `timeout_s` [s].

        Raises
        ------
        OutputError : a recording failed; raised at once and only once, while the frames continue.

        A fault of optopad's own that stopped the thread is raised once all earlier frames have been taken.
        """
        with suppress(IndexError):  # the queue is empty
            if self._notice is None:
                return self._queue.popleft()
        with self._changed:
            self._changed.wait_for(lambda: self._queue or self._error or self._notice, timeout_s)
            if self._notice is not None:
                notice, self._notice = self._notice, None
                raise notice
            if self._queue:
                return self._queue.popleft()
            if self._error is not None:
                raise self._error
            return None

    @property
    def waiting(self) -> int:
        """Number of frames in the queue."""
        return len(self._queue)

    def forget_waiting(self) -> None:
        """Discard all frames in the queue, so that the next one is new; they do not count as lost."""
        with self._changed:
            self._queue.clear()

    def self_test(self, timeout_s: float) -> SelfTest:
        """Request the board's self-test; raises DeviceError if there is no reply in time."""
        with self._changed:
            self._self_test = None
            for _ in range(3):  # request or reply may be damaged on the line
                self.link.send(Command.SELF_TEST)
                self._changed.wait_for(lambda: self._self_test or self._error, timeout_s / 3)
                if self._self_test is not None:
                    return self._self_test
        raise self._error or DeviceError(f"{self.link.port.name}: no reply to the self-test; read again")

    @property
    def counts(self) -> LinkCounts:
        """Counts of received, lost and damaged frames, and of reconnections, so far."""
        scanner = self.link.scanner
        return LinkCounts(
            frames=self._decoder.frames,
            lost=self._decoder.lost,
            damaged=self._past.damaged + scanner.damaged,
            skipped_bytes=self._past.skipped_bytes + scanner.skipped_bytes,
            overrun=self._overrun,
            reconnects=self._decoder.connection - 1,
            doubled=self._decoder.doubled,
        )

    def _run(self) -> None:
        try:
            while not self._stopping.is_set():
                try:
                    self._follow()
                except DeviceError as err:
                    self._reconnect(err)
            self._stop_board()
        except Exception as err:  # all on purpose: the reader of frames raises what the thread cannot fix
            self._fail(err)

    def _follow(self) -> None:
        heard_at, starts = time.monotonic(), 0
        while not self._stopping.is_set():
            messages = self.link.messages()
            now = time.monotonic()
            if messages:
                heard_at, starts = now, 0
                self._take(messages, time.time())
            elif now - heard_at > (starts + 1) * max(START_AGAIN_S, 3 * self._interval_us / 1e6):
                starts += 1
                if starts > OPEN_AGAIN:
                    raise PortLostError(
                        f"{self.link.port.name}: no whole message for {now - heard_at:.0f} s, so the port is opened "
                        "again; check cable and board, lower the rate or baud"
                    )
                self.link.start(self._interval_us)

    def _take(self, messages: list[Message], host_s: float) -> None:
        batch: list[bytes] = []
        for version, message in messages:
            kind = version & 0x0F
            if kind == Kind.READINGS:
                batch.append(message)
                continue
            self._keep(batch, host_s)
            batch = []
            if kind == Kind.HELLO:
                self._began_anew(message)
            else:
                with self._changed:
                    self._self_test = unpack_self_test(message)
                    self._changed.notify_all()
        self._keep(batch, host_s)

    def _keep(self, batch: list[bytes], host_s: float) -> None:
        batch = self._decoder.without_repeats(batch)
        if not batch:
            return
        with self._changed:
            lost = self._decoder.lost
            frames = self._decoder.decoded(batch, host_s)
            for recorder in list(self._recorders):
                self._write(recorder, batch, host_s, self._decoder.lost - lost)
            self._queue.extend(frames)
            self.heard_at = time.monotonic()
            while len(self._queue) > QUEUE_FRAMES:
                self._queue.popleft()
                self._overrun += 1
            self._changed.notify_all()

    def _write(self, recorder: Recorder, batch: list[bytes], host_s: float, lost: int) -> None:
        if recorder.is_open:
            recorder.lost += lost
            for message in batch:
                recorder.frame(message, host_s)
        if recorder.failure is not None:
            self._notice = recorder.failure
        if not recorder.is_open:
            self._recorders.remove(recorder)

    def _connection(self) -> tuple[Link, Hello]:
        found = self._connect(self._stopping.is_set)
        self._greeted_at = time.monotonic()
        return found

    def _began_anew(self, message: bytes) -> None:
        """Restart the stream after an unrequested hello, which indicates that the board was reset."""
        if time.monotonic() - self._greeted_at < LATE_HELLO_S:
            return
        self._greeted_at = time.monotonic()  # a repeated hello is one reset
        self.hello = self._checked(unpack_hello(message))
        self._decoder.begin()
        self._note_connection(message)
        self.link.start(self._interval_us)

    def _note_connection(self, message: bytes) -> None:
        with self._changed:
            for recorder in self._recorders:
                recorder.hello(message, time.time())

    def _reconnect(self, err: DeviceError) -> None:
        self.why_away = str(err)
        self.link.port.close()
        while not self._stopping.wait(LOOK_EVERY_S):
            try:
                link, hello = self._connection()
                self._past.damaged += self.link.scanner.damaged
                self._past.skipped_bytes += self.link.scanner.skipped_bytes
                self.link, self.hello = link, hello
                self.link.start(self._interval_us)
                break
            except PortLostError as again:  # it was lost during the greeting or start
                self.why_away = str(again)
                self.link.port.close()
            except DeviceError as away:
                self.why_away = str(away)
        else:
            return
        self._decoder.begin()
        self._note_connection(self.link.hello_message)
        self.why_away = ""

    def _stop_board(self) -> None:
        try:
            self.link.send(Command.STOP)
        except PortLostError:
            return  # no board remains to be stopped

    def _fail(self, err: Exception) -> None:
        with self._changed:
            self._error = self._error or err
            self.why_away = f"{self.link.port.name}: reading has ended: {type(err).__name__}: {err}"
            self._changed.notify_all()
