"""Records a sensor's frames while they arrive: as they are (``.optorec``), or as ROS 2 messages (``.mcap``)."""

from __future__ import annotations

import errno
import math
import os
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import IO, TYPE_CHECKING

from optopad.design.errors import InputError, OutputError
from optopad.design.files import require_suffix
from optopad.fabrication.driver.recording.mcap_file import MCAP_SUFFIX, mcap_sink
from optopad.fabrication.driver.recording.raw import END, PRESS, SUFFIX, RawSink, Record, RecordKind, Sink
from optopad.fabrication.driver_file import DriverConfig

if TYPE_CHECKING:
    from typing_extensions import Self  # in typing from Python 3.11

FLUSH_S = 0.25
"""Interval at which records are written to the file [s]; it must not exceed 0.5 s."""
SYNC_S = 5.0
"""Interval at which the file is written through to the disk, so that it survives a power cut [s]."""

OpenFile = Callable[[Path], IO[bytes]]
"""Function that creates a file and opens it without buffering."""


class Recorder:
    """Writes a recording of the raw stream; a context manager.

    A separate thread writes the records to the disk, so that a slow disk does not delay the reading of the port.
    Whatever the format and the frame rate, a process that is killed leaves a file with all frames but those of the
    last `FLUSH_S`, and a power cut takes those of the last `SYNC_S`. The methods may be called from several threads.

    Parameters
    ----------
    file : name of the new file, .optorec or .mcap; an existing file is refused
    config : driver configuration of the sensor
    opened : function that opens the file; tests replace it

    Attributes
    ----------
    failure : error that stopped the recording; None while it continues
    frames : number of frames recorded so far
    lost : number of frames missing so far, by their sequence numbers

    Raises
    ------
    InputError : the name does not end in .optorec or .mcap.
    OutputError : the file exists, or cannot be written; or the package for .mcap is missing.
    """

    def __init__(
        self, file: str | os.PathLike[str], config: DriverConfig, opened: OpenFile | None = None
    ) -> None:
        self.file = Path(file)
        require_suffix(self.file, (SUFFIX, MCAP_SUFFIX))
        new_sink = _sink_of(self.file)
        self.failure: OutputError | None = None
        self.frames = 0
        self.lost = 0
        self._pending: list[Record] = []
        self._lock = threading.Lock()
        self._writing = threading.RLock()
        self._over = threading.Event()
        self._synced_s = time.monotonic()
        try:
            self._stream = (opened or _new_file)(self.file)
        except OSError as err:
            raise OutputError(_unwritable(self.file, err)) from err
        try:
            self._sink = new_sink(self._stream, config)
        except OSError as err:
            self._fail(err)
            raise OutputError(_unwritable(self.file, err)) from err
        threading.Thread(target=self._keep_flushing, name="optopad recorder", daemon=True).start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        self.close(is_clean=kind is None or not issubclass(kind, Exception))

    @property
    def is_open(self) -> bool:
        """Whether records are still accepted."""
        return not self._over.is_set()

    def frame(self, message: bytes, host_s: float) -> None:
        """Append a frame as it arrived."""
        record = Record(kind=RecordKind.FRAME, host_s=host_s, content=message)
        with self._lock:
            if self.is_open:
                self._pending.append(record)
                self.frames += 1

    def hello(self, message: bytes, host_s: float) -> None:
        """Append a board's hello (its identification), with which a connection begins."""
        self._append(Record(kind=RecordKind.HELLO, host_s=host_s, content=message))

    def press(self, x_mm: float, y_mm: float, depth_mm: float, host_s: float | None = None) -> None:
        """Record the press that holds from the time `host_s` [s] on, or from now on if that is None.

        It holds until the next call. So call this when the tip has arrived, and with a depth of 0 or less, for the
        untouched pad, before the tip leaves; frames during a motion have the label of the rest before it. To fit a
        force, record the motion of the stage instead (`optopad driver export --stage`).

        Raises
        ------
        InputError : a coordinate is not a finite number.
        OutputError : the recording has failed earlier.
        """
        if not all(map(math.isfinite, (x_mm, y_mm, depth_mm))):
            raise InputError(
                f"press: x, y, depth are {x_mm:g}, {y_mm:g}, {depth_mm:g} mm, needs finite numbers; for the untouched "
                "pad give a depth of 0 or less"
            )
        content = PRESS.pack(x_mm, y_mm, depth_mm)
        now_s = time.time() if host_s is None else host_s
        self._append(Record(kind=RecordKind.PRESS, host_s=now_s, content=content))
        if self.failure is not None:
            raise self.failure

    def flush(self) -> None:
        """Write all pending records to the file; if that fails, truncate it after its last complete record or chunk."""
        with self._writing:
            with self._lock:
                records, self._pending = self._pending, []
            try:
                if records and not self._stream.closed:
                    self._sink.write(records)
                    self._sync()
            except OSError as err:
                self._fail(err)

    def close(self, *, is_clean: bool = True) -> None:
        """Flush everything to the disk and close the file; if `is_clean`, first mark the recording's normal end.

        Raises
        ------
        OutputError : the recording failed, now or earlier; the message states what the file contains.
        """
        with self._lock:
            if self.is_open:
                self._over.set()
                if is_clean:
                    end = END.pack(self.frames, self.lost)
                    self._pending.append(Record(kind=RecordKind.END, host_s=time.time(), content=end))
        self.flush()
        self._finish()
        if self.failure is not None:
            raise self.failure

    def _sync(self) -> None:
        now_s = time.monotonic()
        if now_s - self._synced_s >= SYNC_S:
            self._synced_s = now_s
            os.fsync(self._stream.fileno())

    def _keep_flushing(self) -> None:
        while not self._over.wait(FLUSH_S):
            self.flush()

    def _append(self, record: Record) -> None:
        with self._lock:
            if self.is_open:
                self._pending.append(record)

    def _finish(self) -> None:
        with self._writing:
            if self._stream.closed:
                return
            try:
                os.fsync(self._stream.fileno())
            except OSError as err:
                self._fail(err)
            self._stream.close()

    def _fail(self, err: OSError) -> None:
        self.failure = self.failure or OutputError(_unwritable(self.file, err))
        self._over.set()
        self._stream.close()


def _sink_of(file: Path) -> Callable[[IO[bytes], DriverConfig], Sink]:
    return mcap_sink() if file.suffix.lower() == MCAP_SUFFIX else RawSink


def _new_file(file: Path) -> IO[bytes]:
    return file.open("xb", buffering=0)


def _unwritable(file: Path, err: OSError) -> str:
    if err.errno == errno.EEXIST:
        return f"{file}: exists already, and a recording is never overwritten; choose another name"
    if err.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG):
        until = f"{FLUSH_S:g} s before" if file.suffix.lower() == MCAP_SUFFIX else "then"
        return (
            f"{file}: the disk is full ({err.strerror}); the recording stopped, it holds every frame up "
            f"to {until}: free some room, then record into a new file"
        )
    return f"{file}: cannot be written: {err.strerror or err}; choose another folder"
