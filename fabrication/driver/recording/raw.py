"""Writes and reads recordings of the raw stream: every frame as it arrived over the line, with its CRC.

    one line of JSON, ended by a line feed:  file format, and the complete driver configuration
    records:  B5 6B, type u8, length u16, host's time f64 [s], content, CRC-32 over all of the record

Types of records:

- 0, a frame
- 1, a hello: the board's identification, with which a connection begins
- 2, a press: x, y, depth as f64 [mm], valid until the next press
- 3, the normal end: numbers of frames and of lost frames, each u64.

In a truncated file, every complete record remains readable. A damaged record is skipped, and its bytes are counted.
"""

from __future__ import annotations

import contextlib
import errno
import json
import os
import struct
import threading
import time
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from enum import IntEnum
from pathlib import Path
from types import TracebackType
from typing import IO, Any, Self

import numpy as np

from design.errors import InputError, OutputError
from design.files import BYTES_FOR_KIND, kind_of, read_bytes, require_suffix
from fabrication.driver_file import DriverConfig, config_from_document
from fabrication.record import plain_of

FORMAT, VERSION = "optopad-recording", 1
SUFFIX = ".optorec"
NEEDED = f"a recording of `optopad driver record` ({SUFFIX})"
MOST_BYTES = 8_000_000_000
"""Largest size of a recording that is read [bytes]."""
FLUSH_S = 0.25
"""Interval at which records are written to the file [s]; it must not exceed 0.5 s."""

MAGIC = b"\xb5\x6b"
_HEAD = struct.Struct("<2sBHd")
_CRC = struct.Struct("<I")
_PRESS = struct.Struct("<3d")
_END = struct.Struct("<2Q")
PRESS_BYTES = _PRESS.size
LONGEST_HEADER = 10_000_000
"""Longest header of a recording that is read [bytes]; the largest configuration is about 30 kB."""

Press = tuple[float, float, float]
OpenFile = Callable[[Path], IO[bytes]]
"""Function that creates a file and opens it without buffering."""


class RecordKind(IntEnum):
    """Types of records in a recording."""

    FRAME = 0
    HELLO = 1
    PRESS = 2
    END = 3


@dataclass(frozen=True, kw_only=True)
class Record:
    """One record of a recording: its type, the host's time at its arrival [s], and its content."""

    kind: RecordKind
    host_s: float
    content: bytes

    @property
    def size(self) -> int:
        """Number of bytes that the record occupies in the file."""
        return _HEAD.size + len(self.content) + _CRC.size


def packed_record(kind: RecordKind, host_s: float, content: bytes) -> bytes:
    """The bytes of a record as they are written to the file."""
    body = _HEAD.pack(MAGIC, kind, len(content), host_s) + content
    return body + _CRC.pack(zlib.crc32(body))


class Recorder:
    """Writes a recording of the raw stream; a context manager.

    A separate thread writes the records to the disk, so that a slow disk does not delay the reading of the port.
    The methods may be called from several threads.

    Parameters
    ----------
    file : name of the new file; an existing file is refused
    config : driver configuration of the sensor
    opened : function that opens the file; tests replace it

    Attributes
    ----------
    failure : error that stopped the recording; None while it continues
    frames : number of frames recorded so far
    lost : number of frames missing so far, by their sequence numbers

    Raises
    ------
    InputError : the name does not end in .optorec.
    OutputError : the file exists, or cannot be written.
    """

    def __init__(
        self, file: str | os.PathLike[str], config: DriverConfig, opened: OpenFile | None = None
    ) -> None:
        self.file = Path(file)
        require_suffix(self.file, (SUFFIX,))
        self.failure: OutputError | None = None
        self.frames = 0
        self.lost = 0
        self._pending: list[bytes] = []
        self._lock = threading.Lock()
        self._writing = threading.RLock()
        self._over = threading.Event()
        started = time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime())
        header = {"format": FORMAT, "version": VERSION, "started": started, "config": plain_of(config)}
        try:
            self._stream = (opened or _new_file)(self.file)
        except OSError as err:
            raise OutputError(_unwritable(self.file, err)) from err
        self._append(json.dumps(header, separators=(",", ":")).encode() + b"\n")
        self.flush()
        if self.failure is not None:
            raise self.failure
        threading.Thread(target=self._keep_flushing, name="optopad recorder", daemon=True).start()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, err: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close(is_clean=kind is None or not issubclass(kind, Exception))

    @property
    def is_open(self) -> bool:
        """Whether records are still accepted."""
        return not self._over.is_set()

    def frame(self, message: bytes, host_s: float) -> None:
        """Append a frame as it arrived."""
        record = packed_record(RecordKind.FRAME, host_s, message)
        with self._lock:
            if self.is_open:
                self._pending.append(record)
                self.frames += 1

    def hello(self, message: bytes, host_s: float) -> None:
        """Append a board's hello (its identification), with which a connection begins."""
        self._append(packed_record(RecordKind.HELLO, host_s, message))

    def press(self, x_mm: float, y_mm: float, depth_mm: float, host_s: float | None = None) -> None:
        """Record the press that is valid from the time `host_s` [s] on, or from now on if that is None.

        A depth of 0 or less means that the pad is untouched.

        Raises
        ------
        OutputError : the recording has failed earlier.
        """
        content = _PRESS.pack(x_mm, y_mm, depth_mm)
        self._append(packed_record(RecordKind.PRESS, time.time() if host_s is None else host_s, content))
        if self.failure is not None:
            raise self.failure

    def flush(self) -> None:
        """Write all pending records to the file; if that fails, truncate it after its last complete record."""
        with self._writing:
            with self._lock:
                records, self._pending = self._pending, []
            try:
                if records and not self._stream.closed:
                    _write_all(self._stream, records)
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
                    end = _END.pack(self.frames, self.lost)
                    self._pending.append(packed_record(RecordKind.END, time.time(), end))
        self.flush()
        self._finish()
        if self.failure is not None:
            raise self.failure

    def _keep_flushing(self) -> None:
        while not self._over.wait(FLUSH_S):
            self.flush()

    def _append(self, record: bytes) -> None:
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


def read_records(file: Path) -> tuple[dict[str, Any], DriverConfig, list[Record], int]:
    """Read a recording; return header, driver configuration, complete records, and number of bytes outside records.

    Raises
    ------
    InputError : the file does not exist, is not a recording, or is of another version.
    """
    content = read_bytes(file, needed=NEEDED, most_bytes=MOST_BYTES)
    header, start = _header(file, content)
    config = config_from_document(header["config"], where=f"{file}: its configuration")
    records = list(_records(content, start))
    used = sum(record.size for record in records)
    return header, config, records, len(content) - start - used


def press_of(record: Record) -> Press:
    """Press (x, y, depth) that a record of type PRESS contains [mm]."""
    x_mm, y_mm, depth_mm = _PRESS.unpack(record.content)
    return x_mm, y_mm, depth_mm


def _header(file: Path, content: bytes) -> tuple[dict[str, Any], int]:
    end = content.find(b"\n", 0, LONGEST_HEADER)
    try:
        header = json.loads(content[:end]) if end > 0 else None
        is_ours = isinstance(header, dict) and header.get("format") == FORMAT
    except (ValueError, RecursionError):
        is_ours = False
    if not is_ours or not isinstance(header, dict) or not isinstance(header.get("config"), dict):
        kind = kind_of(content[:BYTES_FOR_KIND])
        was = "its header is damaged" if kind.startswith("a recording") else kind
        raise InputError(f"{file}: {was}; needs {NEEDED}")
    if header.get("version") != VERSION:
        raise InputError(f"{file}: version {header.get('version')!r}, this optopad reads {VERSION}")
    return header, end + 1


def _records(content: bytes, start: int) -> Iterator[Record]:
    """Every complete record in a file's bytes from `start`; the search skips damaged records byte by byte."""
    at = content.find(MAGIC, start)
    while 0 <= at <= len(content) - _HEAD.size:
        _, kind, length, host_s = _HEAD.unpack_from(content, at)
        end = at + _HEAD.size + length
        seal = content[end : end + _CRC.size]
        if seal == _CRC.pack(zlib.crc32(content[at:end])) and kind in _KINDS:
            yield Record(kind=RecordKind(kind), host_s=host_s, content=content[at + _HEAD.size : end])
            at = end + _CRC.size
        else:
            at += 1
        at = content.find(MAGIC, at)


_KINDS = frozenset(RecordKind)


def _new_file(file: Path) -> IO[bytes]:
    return file.open("xb", buffering=0)


def _write_all(stream: IO[bytes], records: list[bytes]) -> None:
    """Write records in one call; if that fails, remove an incomplete record at the end of the file."""
    whole, written = b"".join(records), 0
    try:
        while written < len(whole):
            written += stream.write(whole[written:]) or 0
    except OSError:
        ends = np.cumsum([len(record) for record in records])
        kept = int(max(ends[ends <= written], default=0))
        with contextlib.suppress(OSError):  # its CRC would mark the part as incomplete anyway
            stream.truncate(stream.tell() - written + kept)
        raise


def _unwritable(file: Path, err: OSError) -> str:
    if err.errno == errno.EEXIST:
        return f"{file}: exists already, and a recording is never overwritten; choose another name"
    if err.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG):
        return (
            f"{file}: the disk is full ({err.strerror}); the recording stopped, it holds every frame up "
            "to then: free some room, then record into a new file"
        )
    return f"{file}: cannot be written: {err.strerror or err}; choose another folder"
