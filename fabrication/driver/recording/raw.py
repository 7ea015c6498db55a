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
from dataclasses import dataclass, field
from enum import IntEnum
from pathlib import Path
from typing import IO, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from optopad.design.arrays import FloatArray
from optopad.design.errors import InputError
from optopad.design.files import BYTES_FOR_KIND, kind_of, opened_file, size_of, too_large
from optopad.design.progress import OnStep, silent
from optopad.fabrication.driver.link.protocol import frame_format
from optopad.fabrication.driver_file import DriverConfig, config_from_document, plain_of

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
LONGEST_HELLO = 1024
"""Longest hello that is read [bytes]; that of this version of the protocol has 54."""
PIECE_BYTES = 1_000_000
"""Size of the pieces in which a recording is read [bytes]."""
STEP = "recording"
"""Name of the step in reports of progress."""
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


def packed_size(length: int) -> int:
    """Number of bytes that a record with content of this length occupies."""
    return _HEAD.size + length + _CRC.size


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


@dataclass(frozen=True, kw_only=True)
class RawRecording:
    """The r complete records of a recording, as arrays in the order of the file.

    Attributes
    ----------
    config : driver configuration of the sensor
    kinds : type of each record, as in `RecordKind`, shape (r,)
    host_s : the host's time at each record's arrival, shape (r,) [s]
    frames : bytes of the n frames, in pieces; the shapes (k, bytes of a frame) add up to n
    presses_mm : x, y, depth of each record of type PRESS, shape (p, 3) [mm]
    stray_bytes : number of bytes outside complete records
    gaps : for each place with bytes outside complete records, the number of the record behind, and the number of bytes
    """

    config: DriverConfig
    kinds: NDArray[np.uint8]
    host_s: FloatArray
    frames: list[NDArray[np.uint8]]
    presses_mm: FloatArray
    stray_bytes: int
    gaps: tuple[tuple[int, int], ...]


def read_raw(file: Path, on_step: OnStep = silent) -> RawRecording:
    """Read a recording in pieces, so that it needs little more memory than the bytes of its frames.

    Raises
    ------
    InputError : the file does not exist, is not a recording, or is of another version.
    """
    frames, presses, stray, gaps = list[NDArray[np.uint8]](), list[Press](), 0, list[tuple[int, int]]()
    count = before = 0
    kinds, host_s = [np.zeros(0, np.uint8)], [np.zeros(0)]
    with opened_file(file, needed=NEEDED) as stream:
        _, config, pieces = _begun(file, stream, on_step)
        for piece in pieces:
            of_piece, begins = np.array(piece.kinds, dtype=np.uint8), np.array(piece.begins, dtype=np.int64)
            kinds.append(of_piece)
            host_s.append(np.array(piece.host_s, dtype=np.float64))
            if len(at := begins[of_piece == RecordKind.FRAME]):
                octets = np.frombuffer(piece.content, np.uint8)
                size = frame_format(config).total_bytes
                frames.append(np.lib.stride_tricks.sliding_window_view(octets, size)[at])
            of_presses = begins[of_piece == RecordKind.PRESS].tolist()
            presses += [PRESS.unpack_from(piece.content, k) for k in of_presses]
            stray += piece.stray_bytes
            ends = np.concatenate([[0], begins + np.array(piece.lengths, dtype=np.int64) + _CRC.size])
            between = begins - _HEAD.size - ends[:-1]
            if len(between):
                between[0] += before
                gaps += [(count + int(k), int(between[k])) for k in np.flatnonzero(between)]
            before = piece.used - int(ends[-1]) + (0 if len(between) else before)
            count += len(between)
    return RawRecording(
        config=config,
        kinds=np.concatenate(kinds),
        host_s=np.concatenate(host_s),
        frames=frames,
        presses_mm=np.array(presses, dtype=np.float64).reshape(-1, 3),
        stray_bytes=stray,
        gaps=tuple(gaps),
    )


def read_records(file: Path) -> tuple[dict[str, Any], DriverConfig, list[Record], int]:
    """Read a recording; return header, driver configuration, complete records, and number of bytes outside records.

    For long recordings, `read_raw` is faster. Errors are as in `read_raw`.
    """
    records, stray = list[Record](), 0
    with opened_file(file, needed=NEEDED) as stream:
        header, config, pieces = _begun(file, stream)
        for piece in pieces:
            stray += piece.stray_bytes
            for kind, host_s, begin, length in zip(*piece.records, strict=True):
                content = piece.content[begin : begin + length]
                records.append(Record(kind=RecordKind(kind), host_s=host_s, content=content))
    return header, config, records, stray


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
        is_damaged = content.startswith(b'{"format": "' + FORMAT.encode())
        was = "its header is damaged" if is_damaged else kind_of(content[:BYTES_FOR_KIND])
        raise InputError(f"{file}: {was}; needs {NEEDED}")
    if header.get("version") != VERSION:
        raise InputError(f"{file}: version {header.get('version')!r}, this optopad reads {VERSION}")
    return header, end + 1


@dataclass(kw_only=True)
class _Piece:
    """Bytes of a file, and the complete records in them: type, time, begin and length of each content."""

    content: bytes
    kinds: list[int] = field(default_factory=list)
    host_s: list[float] = field(default_factory=list)
    begins: list[int] = field(default_factory=list)
    lengths: list[int] = field(default_factory=list)
    used: int = 0
    """Number of bytes that are done with; the rest belongs to the next piece."""

    @property
    def records(self) -> tuple[list[int], list[float], list[int], list[int]]:
        return self.kinds, self.host_s, self.begins, self.lengths

    @property
    def stray_bytes(self) -> int:
        return self.used - sum(self.lengths) - len(self.lengths) * (_HEAD.size + _CRC.size)


def _begun(
    file: Path, stream: IO[bytes], on_step: OnStep = silent
) -> tuple[dict[str, Any], DriverConfig, Iterator[_Piece]]:
    """Header and configuration of an open recording, and its records in pieces that are read one by one."""
    size = size_of(stream, MOST_BYTES)
    start = stream.read(BYTES_FOR_KIND)
    if b"\n" not in start:
        start += stream.readline(LONGEST_HEADER - len(start))
    header, begin = _header(file, start)
    config = config_from_document(header["config"], where=f"{file}: its configuration")
    if size > MOST_BYTES:
        raise InputError(too_large(file, needed=NEEDED, most_bytes=MOST_BYTES))

    def pieces() -> Iterator[_Piece]:
        rest, done, is_last = start[begin:], len(start), False
        while not is_last:
            more = stream.read(PIECE_BYTES)
            is_last, done = len(more) < PIECE_BYTES, done + len(more)
            piece = _whole_records(rest + more, frame_format(config).total_bytes, is_last=is_last)
            rest = piece.content[piece.used :]
            yield piece
            on_step(STEP, 1.0 if is_last else min(done / size, 0.99))

    return header, config, pieces()


def _whole_records(content: bytes, frame_bytes: int, *, is_last: bool) -> _Piece:
    """Every complete record in a part of a file; the search skips damaged ones byte by byte.

    A record is damaged, however right its CRC, if its length is not that of its type. Unless the part `is_last`, a
    record that may continue behind it is left for the next part.
    """
    most = {
        RecordKind.FRAME: frame_bytes,
        RecordKind.HELLO: LONGEST_HELLO,
        RecordKind.PRESS: PRESS.size,
        RecordKind.END: END.size,
    }
    permitted = {
        int(kind): range(0 if kind == RecordKind.HELLO else longest, longest + 1)
        for kind, longest in most.items()
    }
    around = _HEAD.size + _CRC.size
    piece, view, none = _Piece(content=content), memoryview(content), range(0)
    last = len(content) - (around if is_last else around + max(most.values()))
    at = content.find(MAGIC)
    while 0 <= at <= last:
        _, kind, length, host_s = _HEAD.unpack_from(content, at)
        begin = at + _HEAD.size
        end = begin + length
        if (
            length in permitted.get(kind, none)
            and end + _CRC.size <= len(content)
            and zlib.crc32(view[at:end]) == _CRC.unpack_from(content, end)[0]
        ):
            piece.kinds.append(kind)
            piece.host_s.append(host_s)
            piece.begins.append(begin)
            piece.lengths.append(length)
            at = end + _CRC.size
        else:
            at += 1
        at = content.find(MAGIC, at)
    piece.used = len(content) if is_last else at if at >= 0 else max(len(content) - 1, 0)
    return piece


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
