"""Reads the messages of one file of a bag in the order of the file: MCAP, MCAP in Zstandard, or SQLite.

Nothing unpacks to more than a limit, whatever a file declares. A chunk of an MCAP file is used only whole: its checksum
or, without one, its declared size and times must agree with its content. The search for messages goes on behind a
damaged chunk; behind a record that is damaged itself it ends.

Sources: MCAP format specification, version 0; storage plugins `mcap` and `sqlite3` of rosbag2.
"""

from __future__ import annotations

import io
import sqlite3
import struct
import zlib
from collections.abc import Iterator
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Protocol
from urllib.parse import quote

from optopad.design.errors import InputError
from optopad.fabrication.driver.recording.recorded import LOSSES_NAME

MCAP_MAGIC = b"\x89MCAP0\r\n"
ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"
MOST_CHUNK_BYTES = 256_000_000
"""Largest size to which a chunk is unpacked [bytes]; recorders make chunks of 1 MB, or of one image."""
MOST_MESSAGE_BYTES = 16_000_000
"""Largest size to which a single message is unpacked [bytes]; a frame has at most some kB."""
MOST_FILE_BYTES = 64_000_000_000
"""Largest size to which a compressed file is unpacked [bytes]."""
PIECE_BYTES = 1 << 20
LATEST_NS = (1 << 63) - 1

_RECORD = struct.Struct("<BQ")
_MESSAGE = struct.Struct("<HIQQ")
_CHUNK = struct.Struct("<QQQI")
HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, INDEX, ATTACHMENT, METADATA, DATA_END = (
    1,
    2,
    3,
    4,
    5,
    6,
    7,
    9,
    12,
    15,
)
_READ = frozenset((FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, INDEX, METADATA, DATA_END))
OTHERS = 0x80
"""Types of records from this one on belong to other programs, and are skipped."""
_SKIPPED = frozenset((HEADER, ATTACHMENT, *range(OTHERS, 0x100)))


@dataclass(frozen=True, kw_only=True)
class Channel:
    """A channel of messages of one type.

    Attributes
    ----------
    kind : type of the messages, such as ``optopad_msgs/msg/Frame``; "" if the file states none
    encoding : encoding of the messages; ROS 2 has ``cdr``
    schema_encoding, definition : definition of the type, as in the file; both may be empty
    """

    topic: str
    kind: str
    encoding: str
    schema_encoding: str = ""
    definition: bytes = b""


Message = tuple[Channel, int, "bytes | memoryview"]
"""Channel, log time since 1970 [ns], and content of a message."""


class BagFile(Protocol):
    """A file of a bag.

    Attributes
    ----------
    channels : every channel that was found so far, also those without messages
    is_whole : whether the recorder ended the file normally; known after the last message
    lost_bytes : number of bytes read so far that belong to no complete record or to a damaged chunk
    fault : the first damage that was found, in words; "" if there is none
    losses : for each recording of which the file is a copy, metadata on what was missing of it
    """

    channels: list[Channel]
    is_whole: bool
    lost_bytes: int
    fault: str
    losses: list[dict[str, str]]

    def messages(self) -> Iterator[Message | None]:
        """Every message of the file; None where messages are missing."""


class _DamageError(ValueError):
    """A record contradicts itself or the format."""


class McapFile:
    """An MCAP file; see `BagFile`. `kinds` are the types of messages that `messages` gives."""

    def __init__(self, file: Path, kinds: frozenset[str]) -> None:
        self.channels: list[Channel] = []
        self.is_whole = False
        self.lost_bytes = 0
        self.losses: list[dict[str, str]] = []
        self._file = file
        self._kinds = kinds
        self._schemas: dict[int, tuple[str, str, bytes]] = {}
        self._by_number: dict[int, Channel] = {}
        self.fault = ""
        self._checksum = 0
        self._is_unchecked = False
        self._has_all = False
        self._before = 0

    def messages(self) -> Iterator[Message | None]:
        """Every message of the file; None behind a damaged chunk.

        Raises
        ------
        InputError : the file cannot be opened, is not an MCAP file, has a wrong checksum over messages without one of
            their own, or unpacks to more than a limit.
        """
        try:
            with self._file.open("rb") as plain, _opened(plain, self._file) as stream:
                yield from self._messages(stream)
        except OSError as err:
            raise InputError(
                f"{self._file}: cannot be read: {err.strerror or err}; name the right file"
            ) from None
        if not self.is_whole:
            self.fault = self.fault or "it ends too early"

    def _messages(self, stream: IO[bytes]) -> Iterator[Message | None]:
        magic = stream.read(len(MCAP_MAGIC))
        if not MCAP_MAGIC.startswith(magic):
            raise InputError(f"{self._file}: is not an MCAP file, or damaged: it does not begin like one")
        self._checksum = zlib.crc32(magic)
        while True:
            checksum, head = self._checksum, self._read(stream, _RECORD.size)
            if len(head) < _RECORD.size:
                self.lost_bytes += len(head)
                return
            opcode, length = _RECORD.unpack(head)
            content = self._content(stream, opcode, length)
            if content is None:
                return
            try:
                if opcode == FOOTER and self._has_all:
                    self.is_whole = True
                    return
                if not self._has_all:
                    yield from self._of_record(opcode, head, content, checksum)
                elif opcode in (SCHEMA, CHANNEL):
                    self._declare(opcode, memoryview(content))
            except (_DamageError, struct.error, UnicodeDecodeError) as err:
                self.fault = self.fault or str(err)
                self.lost_bytes += _RECORD.size + length
                yield None

    def _of_record(self, opcode: int, head: bytes, content: bytes, checksum: int) -> list[Message]:
        """Messages of a record before the end of data; `checksum` is that of all bytes before it."""
        before, self._before = self._before, opcode
        if opcode == CHUNK:
            return self._of_chunk(content)
        if opcode == MESSAGE:
            self._is_unchecked = True
            return self._of_records(head + content)
        if opcode in (SCHEMA, CHANNEL):
            self._declare(opcode, memoryview(content))
        elif opcode == DATA_END:
            self._require_checksum(content, checksum)
            self._has_all = True
        elif opcode == INDEX:
            if before not in (CHUNK, INDEX) or struct.unpack_from("<I", content, 2)[0] != len(content) - 6:
                raise _DamageError("an index is damaged, or its chunk is missing")
        elif opcode == METADATA:
            self._take_losses(memoryview(content))
        elif opcode not in _SKIPPED:
            raise _DamageError(f"a record has the unknown type {opcode}")
        return []

    def _content(self, stream: IO[bytes], opcode: int, length: int) -> bytes | None:
        """Content of a record; empty for records that are not needed; None if the file ends within the record."""
        if opcode in _READ and length > MOST_CHUNK_BYTES:
            self._refuse_if_whole(stream, length)
            return None
        kept = io.BytesIO()
        left = length
        while left:
            piece = self._read(stream, min(left, PIECE_BYTES))
            if not piece:
                self.lost_bytes += _RECORD.size + length - left
                return None
            left -= len(piece)
            if opcode in _READ:
                kept.write(piece)
        return kept.getvalue()

    def _refuse_if_whole(self, stream: IO[bytes], length: int) -> None:
        left = length
        while left and (piece := self._read(stream, min(left, PIECE_BYTES))):
            left -= len(piece)
        if not left:
            raise _too_large(self._file, "a record", length, MOST_CHUNK_BYTES)
        self.lost_bytes += _RECORD.size + length - left

    def _read(self, stream: IO[bytes], count: int) -> bytes:
        content = stream.read(count)
        self._checksum = zlib.crc32(content, self._checksum)
        return content

    def _declare(self, opcode: int, content: memoryview) -> None:
        if opcode == SCHEMA:
            (number,) = struct.unpack_from("<H", content)
            name, at = _text(content, 2)
            encoding, at = _text(content, at)
            text, _ = _bytes(content, at)
            self._schemas[number] = (name, encoding, bytes(text))
            return
        number, schema = struct.unpack_from("<HH", content)
        topic, at = _text(content, 4)
        encoding, _ = _text(content, at)
        if schema and schema not in self._schemas:
            raise _DamageError(f"the definition of {topic} is missing")
        kind, schema_encoding, definition = self._schemas.get(schema, ("", "", b""))
        found = Channel(
            topic=topic, kind=kind, encoding=encoding, schema_encoding=schema_encoding, definition=definition
        )
        if self._by_number.get(number) != found:
            self._by_number[number] = found
            self.channels.append(found)

    def _take_losses(self, content: memoryview) -> None:
        """Keep metadata on losses; others are of other programs."""
        begin = struct.pack("<I", len(LOSSES_NAME)) + LOSSES_NAME.encode()
        if content[: len(begin)] != begin:
            return
        pairs, end = _bytes(content, len(begin))
        if end != len(content):
            raise _DamageError("metadata are longer than they declare")
        found, at = {}, 0
        while at < len(pairs):
            name, at = _text(pairs, at)
            found[name], at = _text(pairs, at)
        self.losses.append(found)

    def _of_chunk(self, content: bytes) -> list[Message]:
        first_ns, last_ns, size, checksum = _CHUNK.unpack_from(content)
        compression, at = _text(memoryview(content), _CHUNK.size)
        (length,) = struct.unpack_from("<Q", content, at)
        packed = memoryview(content)[at + 8 : at + 8 + length]
        if len(packed) != length:
            raise _DamageError("a chunk is shorter than it declares")
        unpacked = _unpacked(self._file, compression, packed, size)
        if checksum and zlib.crc32(unpacked) != checksum:
            raise _DamageError("the checksum of a chunk is wrong")
        found = self._of_records(unpacked)
        if not checksum:
            self._is_unchecked = True
            if any(not first_ns <= time_ns <= last_ns for _, time_ns, _ in found):
                raise _DamageError("times in a chunk contradict those that it declares")
        return found

    def _of_records(self, content: bytes | memoryview) -> list[Message]:
        """The messages among records that are not compressed."""
        view, at, end = memoryview(content), 0, len(content)
        found: list[Message] = []
        while at < end:
            opcode, length = _RECORD.unpack_from(view, at)
            at += _RECORD.size
            if length > end - at:
                raise _DamageError("a record is longer than its chunk")
            if opcode == MESSAGE:
                number, _, time_ns, _ = _MESSAGE.unpack_from(view, at)
                channel = self._by_number.get(number)
                if channel is None or time_ns > LATEST_NS or length < _MESSAGE.size:
                    raise _DamageError("a message belongs to no channel or time")
                if channel.kind in self._kinds:
                    found.append((channel, time_ns, view[at + _MESSAGE.size : at + length]))
            elif opcode in (SCHEMA, CHANNEL):
                self._declare(opcode, view[at : at + length])
            elif opcode < OTHERS:
                raise _DamageError(f"a record in a chunk has the unknown type {opcode}")
            at += length
        return found

    def _require_checksum(self, content: bytes, found: int) -> None:
        (stated,) = struct.unpack_from("<I", content)
        if stated and stated != found and self._is_unchecked:
            raise InputError(
                f"{self._file}: is damaged: its checksum is wrong; copy it again from the recorder"
            )


class SqliteFile:
    """A bag in SQLite, as ROS 2 Humble records it; see `BagFile`."""

    def __init__(self, file: Path, kinds: frozenset[str]) -> None:
        self.channels: list[Channel] = []
        self.is_whole = False
        self.lost_bytes = 0
        self.losses: list[dict[str, str]] = []
        self.fault = ""
        self._file = file
        self._kinds = kinds

    def messages(self) -> Iterator[Message | None]:
        """Every message of the file, in the order in which they were written.

        Raises
        ------
        InputError : the file is not a bag in SQLite.
        """
        where = f"file:{quote(str(self._file.resolve()))}?mode=ro"
        try:
            with closing(sqlite3.connect(where, uri=True)) as base:
                by_number: dict[int, Channel] = {}
                for number, topic, kind, encoding in base.execute(
                    "SELECT id, name, type, serialization_format FROM topics"
                ):
                    channel = Channel(topic=str(topic), kind=str(kind), encoding=str(encoding))
                    self.channels.append(channel)
                    if channel.kind in self._kinds:
                        by_number[int(number)] = channel
                some = ",".join(map(str, by_number))
                content = f"CASE WHEN topic_id IN ({some}) THEN data END"
                rows = base.execute(f"SELECT id, topic_id, timestamp, {content} FROM messages ORDER BY id")
                before = None
                for row, number, time_ns, content in rows:
                    if before is not None and row != before + 1:
                        self.fault = f"rows {before + 1} to {row - 1} are missing"
                        yield None
                    before = row
                    if number in by_number:
                        yield by_number[number], int(time_ns), bytes(content)
                self.is_whole = not self.fault
        except (sqlite3.Error, TypeError, ValueError) as err:
            if not self.channels:
                raise InputError(f"{self._file}: is not a bag in SQLite, or damaged: {err}") from None
            self.fault = str(err)
            yield None


def message_content(channel: Channel, content: bytes | memoryview, file: Path) -> bytes | memoryview:
    """Content of a message, unpacked if the recorder compressed single messages.

    Raises
    ------
    InputError : it unpacks to more than a limit, or cannot be unpacked.
    """
    if content[:4] != ZSTD_MAGIC:
        return content
    import zstandard

    try:
        size = zstandard.get_frame_parameters(content).content_size
        if size > MOST_MESSAGE_BYTES:
            raise _too_large(file, f"a message of {channel.topic}", size, MOST_MESSAGE_BYTES)
        return _zstd(content, size)
    except (zstandard.ZstdError, _DamageError) as err:
        raise InputError(f"{file}: a compressed message of {channel.topic} is damaged: {err}") from None


def _opened(plain: IO[bytes], file: Path) -> IO[bytes]:
    if file.suffix.lower() != ".zstd":
        return plain
    return _Unpacking(plain, file)  # type: ignore[return-value]


class _Unpacking(io.RawIOBase):
    """Content of a file that is compressed as a whole; ends where the file is damaged."""

    def __init__(self, plain: IO[bytes], file: Path) -> None:
        import zstandard

        self._error = zstandard.ZstdError
        self._stream = zstandard.ZstdDecompressor().stream_reader(plain, read_across_frames=True)
        self._file = file
        self._count = 0

    def read(self, count: int = -1) -> bytes:
        try:
            found = self._stream.read(count)
        except self._error:
            return b""
        self._count += len(found)
        if self._count > MOST_FILE_BYTES:
            raise _too_large(self._file, "the file", self._count, MOST_FILE_BYTES)
        return bytes(found)


def _unpacked(file: Path, compression: str, packed: memoryview, size: int) -> bytes | memoryview:
    """Content of a chunk of a declared size; raises _DamageError, or InputError above the limit."""
    import lz4.frame
    import zstandard

    try:
        if compression == "zstd":
            states = zstandard.get_frame_parameters(packed).content_size
        elif compression == "lz4":
            states = lz4.frame.get_frame_info(packed)["content_size"]
        elif compression:
            raise _DamageError(f"a chunk is compressed by {compression!r}, which is not read")
        else:
            states = len(packed)
        if states not in (size, 0, zstandard.CONTENTSIZE_UNKNOWN):
            raise _DamageError("the size of a chunk contradicts the one that it declares")
        if size > MOST_CHUNK_BYTES:
            raise _too_large(file, "a chunk", size, MOST_CHUNK_BYTES)
        if not compression:
            return packed
        found = _zstd(packed, size) if compression == "zstd" else _lz4(packed, size)
    except (zstandard.ZstdError, RuntimeError) as err:  # lz4 has no error class of its own
        raise _DamageError(str(err)) from None
    if len(found) != size:
        raise _DamageError("the size of a chunk contradicts the one that it declares")
    return found


def _zstd(packed: bytes | memoryview, size: int) -> bytes:
    import zstandard

    with zstandard.ZstdDecompressor().stream_reader(packed) as reader:
        found: bytes = reader.read(min(size, MOST_CHUNK_BYTES) + 1)
    return found


def _lz4(packed: memoryview, size: int) -> bytes:
    import lz4.frame

    found: bytes = lz4.frame.LZ4FrameDecompressor().decompress(packed, max_length=size + 1)
    return found


def _too_large(file: Path, what: str, size: int, most: int) -> InputError:
    return InputError(
        f"{file}: {what} has {size / 1e6:,.0f} MB when unpacked, and at most {most / 1e6:,.0f} MB are read; "
        "write the file again with smaller parts, as by `ros2 bag convert`"
    )


def _text(content: memoryview, at: int) -> tuple[str, int]:
    found, end = _bytes(content, at)
    return str(found, "utf-8"), end


def _bytes(content: memoryview, at: int) -> tuple[memoryview, int]:
    (length,) = struct.unpack_from("<I", content, at)
    end = at + 4 + length
    if end > len(content):
        raise _DamageError("a text is longer than its record")
    return content[at + 4 : end], end
