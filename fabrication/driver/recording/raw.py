"""Writes and reads recordings of the raw stream: every frame as it arrived over the line, with its CRC.

The format of an ``.optorec`` file:

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
import json
import struct
import time
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from enum import IntEnum
from pathlib import Path
from typing import IO, Any, Protocol

import numpy as np

from design.errors import InputError
from design.files import BYTES_FOR_KIND, kind_of, read_bytes
from fabrication.driver_file import DriverConfig, config_from_document
from fabrication.record import plain_of

FORMAT, VERSION = "optopad-recording", 1
SUFFIX = ".optorec"
NEEDED = f"a recording of `optopad driver record` ({SUFFIX})"
MOST_BYTES = 8_000_000_000
"""Largest size of a recording that is read [bytes]."""

MAGIC = b"\xb5\x6b"
_HEAD = struct.Struct("<2sBHd")
_CRC = struct.Struct("<I")
PRESS = struct.Struct("<3d")
END = struct.Struct("<2Q")
PRESS_BYTES = PRESS.size
LONGEST_HEADER = 10_000_000
"""Longest header of a recording that is read [bytes]; the largest configuration is about 30 kB."""

Press = tuple[float, float, float]


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


class Sink(Protocol):
    """Writes records to the open file of a recording; its errors are OSError."""

    def write(self, records: list[Record]) -> None:
        """Write records completely, or remove the part of a record that was written; the last may be of kind END."""


class RawSink:
    """Writes an ``.optorec`` file: the header at once, then records.

    Parameters
    ----------
    stream : the new file, unbuffered
    config : driver configuration of the sensor
    """

    def __init__(self, stream: IO[bytes], config: DriverConfig) -> None:
        self._stream = stream
        started = time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime())
        header = {"format": FORMAT, "version": VERSION, "started": started, "config": plain_of(config)}
        write_all(stream, [json.dumps(header, separators=(",", ":")).encode() + b"\n"])

    def write(self, records: list[Record]) -> None:
        """Write records completely; if that fails, the file ends with its last complete record."""
        packed = [packed_record(record.kind, record.host_s, record.content) for record in records]
        write_all(self._stream, packed)


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
    x_mm, y_mm, depth_mm = PRESS.unpack(record.content)
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


def write_all(stream: IO[bytes], records: list[bytes]) -> None:
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
