"""Decodes optopad's ROS 2 messages into arrays, many at a time.

Messages whose definition is ours are read by their layout: CDR with little-endian numbers, each aligned to its size,
behind a head of four bytes. Others are decoded one by one by the definition in the file, with `mcap_ros2`.

Source: OMG, Common Data Representation, as in DDS-XTypes 1.3, encoding version 1.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Callable, Iterable
from functools import cache
from itertools import groupby
from typing import Any

import numpy as np
from numpy.typing import NDArray

from optopad.design.arrays import FloatArray, IntArray
from optopad.design.errors import InputError
from optopad.fabrication.driver.recording.bag_file import Channel
from optopad.fabrication.driver.recording.mcap_file import FRAME, NS_PER_S, PRESS
from optopad.fabrication.ros2 import definition, names

ROS2 = "ros2msg"
HEAD_BYTES = 4
LITTLE_ENDIAN = b"\x00\x01"
FRAME_FIELDS = ("arrived_ns", "connection", "sequence", "device_us", "time_ns", "place")
PRESS_FIELDS = ("x_mm", "y_mm", "depth_mm")
MOST_FRAME_READINGS = 1_000_000
_FIELD = re.compile(
    r"(?P<kind>bool|byte|float(?:32|64)|u?int(?:8|16|32|64)|string|[a-z]\w*/[A-Z]\w*)(?:\[\d{0,4}\])? "
    r"(?P<name>[a-z](?:_?[a-z0-9])*)"
)
"""A plain field in a definition: its type, or an array of it, and its name."""


class Frames:
    """Frames of one topic, which grow by messages in the order of the file.

    Attributes
    ----------
    shape : numbers of states and receivers; None before the first frame
    """

    def __init__(self, topic: str) -> None:
        self._topic = topic
        self._counts = bytearray()
        self._columns = {name: bytearray() for name in FRAME_FIELDS}
        self.shape: tuple[int, int] | None = None

    def __len__(self) -> int:
        return len(self._columns["place"]) // 8

    def add(self, channel: Channel, contents: list[Any], time_ns: list[int], place: list[int]) -> None:
        """Append frames with their log times and their places in the order of the files; raises InputError."""
        for found in _tables(channel, contents):
            self._append(found)
        self._columns["time_ns"] += np.array(time_ns, dtype=np.int64).tobytes()
        self._columns["place"] += np.array(place, dtype=np.int64).tobytes()

    def column(self, name: str) -> IntArray:
        """One of `FRAME_FIELDS` of every frame, shape (n,)."""
        return np.frombuffer(self._columns[name], dtype=np.int64)

    @property
    def counts(self) -> NDArray[np.uint16]:
        """Readings of every frame, shape (n, states, receivers) [counts]."""
        return np.frombuffer(self._counts, dtype=np.uint16).reshape(len(self), *(self.shape or (0, 0)))

    def _append(self, found: Any) -> None:
        sizes = np.unique(np.stack([found["states"], found["receivers"]], axis=1), axis=0)
        shape = (int(sizes[0, 0]), int(sizes[0, 1]))
        self.shape = self.shape or shape
        if len(sizes) > 1 or shape != self.shape or found["counts"].shape[1] != shape[0] * shape[1]:
            raise InputError(
                f"{self._topic} has frames of several sensors or sizes; record each with its own topic"
            )
        self._counts += np.ascontiguousarray(found["counts"], dtype=np.uint16).tobytes()
        arrived_ns = found["sec"].astype(np.int64) * NS_PER_S + found["nanosec"]
        for name, values in (("arrived_ns", arrived_ns), *((one, found[one]) for one in FRAME_FIELDS[1:4])):
            self._columns[name] += values.astype(np.int64).tobytes()


class Presses:
    """Presses of one topic: `press_mm` (x, y, depth) with their log times and places in the order of the files."""

    def __init__(self) -> None:
        self._press_mm: list[FloatArray] = []
        self._time_ns: list[int] = []
        self._place: list[int] = []

    def __len__(self) -> int:
        return len(self._place)

    def add(self, channel: Channel, contents: list[Any], time_ns: list[int], place: list[int]) -> None:
        """Append presses; raises InputError."""
        for found in _tables(channel, contents):
            self._press_mm.append(np.stack([found[name] for name in PRESS_FIELDS], axis=1).astype(np.float64))
        self._time_ns += time_ns
        self._place += place

    @property
    def press_mm(self) -> FloatArray:
        """x, y and depth of every press, shape (n, 3) [mm]."""
        return np.concatenate([np.zeros((0, 3)), *self._press_mm])

    @property
    def time_ns(self) -> IntArray:
        """Log time of every press, shape (n,) [ns]."""
        return np.array(self._time_ns, dtype=np.int64)

    @property
    def place(self) -> IntArray:
        """Place of every press in the order of the files, shape (n,)."""
        return np.array(self._place, dtype=np.int64)


def _tables(channel: Channel, contents: list[Any]) -> Iterable[Any]:
    """The messages in their order as tables with one field for each quantity; each table has messages of one layout."""
    if not _is_ours(channel):
        yield from _decoded_tables(channel, contents)
        return
    for _, group in groupby(contents, key=lambda one: (len(one), bytes(one[:2]), bytes(one[12:16]))):
        same = list(group)
        if bytes(same[0][:2]) != LITTLE_ENDIAN:
            yield from _decoded_tables(channel, same)
            continue
        layout = _LAYOUTS[channel.kind](bytes(same[0]))
        if layout is None:
            raise _other(channel)
        table = np.frombuffer(b"".join(same), dtype=layout)
        lengths = [name for name in table.dtype.names or () if name.startswith("length")]
        if any((table[name] != table[name][0]).any() for name in lengths):
            raise _other(channel)
        yield table


def _frame_layout(content: bytes) -> np.dtype[Any] | None:
    """Layout of a frame's message and of all with the same sizes; None if the content is no frame."""
    try:
        (text,) = struct.unpack_from("<I", content, HEAD_BYTES + 8)
        arrived = _aligned(12 + text, 4)
        sequence = _aligned(arrived + 12, 8)
        counts = sequence + 28
        (readings,) = struct.unpack_from("<I", content, HEAD_BYTES + counts - 4)
        normalised = _aligned(counts + 2 * readings, 4)
        (ratios,) = struct.unpack_from("<I", content, HEAD_BYTES + normalised)
    except struct.error:
        return None
    if not _fits(content, normalised + 4 + 4 * ratios) or readings > MOST_FRAME_READINGS:
        return None
    fields = {
        "length_text": ("<u4", 8),
        "sec": ("<i4", arrived),
        "nanosec": ("<u4", arrived + 4),
        "connection": ("<u4", arrived + 8),
        "sequence": ("<u8", sequence),
        "device_us": ("<u8", sequence + 8),
        "states": ("<u2", sequence + 20),
        "receivers": ("<u2", sequence + 22),
        "length_counts": ("<u4", counts - 4),
        "counts": (f"({readings},)<u2", counts),
        "length_normalised": ("<u4", normalised),
    }
    return _dtype(fields, len(content))


def _press_layout(content: bytes) -> np.dtype[Any] | None:
    try:
        (text,) = struct.unpack_from("<I", content, HEAD_BYTES + 8)
    except struct.error:
        return None
    first = _aligned(12 + text, 8)
    if not _fits(content, first + 24):
        return None
    return _dtype({name: ("<f8", first + 8 * k) for k, name in enumerate(PRESS_FIELDS)}, len(content))


_LAYOUTS: dict[str, Callable[[bytes], np.dtype[Any] | None]] = {FRAME: _frame_layout, PRESS: _press_layout}


def _aligned(at: int, size: int) -> int:
    return -(-at // size) * size


def _fits(content: bytes, end: int) -> bool:
    """Whether a message has `end` bytes behind its head; a writer may fill up to eight."""
    return 0 <= len(content) - HEAD_BYTES - end < 8


def _dtype(fields: dict[str, tuple[str, int]], size: int) -> np.dtype[Any]:
    formats, offsets = zip(*fields.values(), strict=True)
    return np.dtype(
        {
            "names": list(fields),
            "formats": list(formats),
            "offsets": [HEAD_BYTES + offset for offset in offsets],
            "itemsize": size,
        }
    )


def _decoded_tables(channel: Channel, contents: list[Any]) -> Iterable[Any]:
    decode = decoder_of(channel)
    for content in contents:
        message = decode(bytes(content))
        try:
            if channel.kind == PRESS:
                yield {name: np.array([getattr(message, name)], dtype=np.float64) for name in PRESS_FIELDS}
                continue
            found = {
                name: np.array([getattr(message, name)], dtype=np.int64)
                for name in ("connection", "sequence", "device_us", "states", "receivers")
            }
            found |= {name: np.array([getattr(message.arrived, name)]) for name in ("sec", "nanosec")}
            yield found | {"counts": np.array([message.counts], dtype=np.uint16)}
        except (AttributeError, OverflowError, ValueError):
            raise _other(channel) from None


def decoder_of(channel: Channel) -> Callable[[bytes], Any]:
    """Function that decodes a message of a channel by the definition in the file, or by ours if the file has none.

    Raises
    ------
    InputError : the definition is in another language, or not of this type of message.
    """
    if not _is_ours(channel) and not _is_plain(channel):
        raise _other(channel)
    text = _own(channel.kind) if _is_ours(channel) else _joined(_parts(_text_of(channel)))
    decode = _decoder(channel.kind, text)

    def decoded(content: bytes) -> Any:
        try:
            return decode(content)
        except (struct.error, ValueError, IndexError, NotImplementedError):
            raise _other(channel) from None

    return decoded


@cache
def _decoder(kind: str, text: str) -> Callable[[bytes], Any]:
    from mcap.records import Schema
    from mcap_ros2.decoder import DecoderFactory

    decode = DecoderFactory().decoder_for("cdr", Schema(id=1, data=text.encode(), encoding=ROS2, name=kind))
    assert decode is not None, kind
    return decode


@cache
def _is_ours(channel: Channel) -> bool:
    """Whether the file defines a type of message as we do, or not at all."""
    if not channel.definition and not channel.schema_encoding:
        return True
    return channel.schema_encoding == ROS2 and _parts(_text_of(channel)) == _parts(_own(channel.kind))


def _is_plain(channel: Channel) -> bool:
    """Whether a definition has only plain fields and, of the types that it contains, those that ours contains."""
    if channel.schema_encoding != ROS2:
        return False
    parts = _parts(_text_of(channel))
    own = _parts(_own(channel.kind))
    found = [_FIELD.fullmatch(line) for line in parts.pop("")]
    fields = [one for one in found if one is not None]
    kinds = {one["kind"] for one in fields if "/" in one["kind"]}
    is_known = kinds <= parts.keys() and all(own.get(name) == lines for name, lines in parts.items())
    return is_known and len({one["name"] for one in fields}) == len(found)


def _text_of(channel: Channel) -> str:
    return channel.definition.decode("utf-8", errors="replace")


def _own(kind: str) -> str:
    return definition(kind) if kind in names() else ""


def _parts(text: str) -> dict[str, list[str]]:
    """Fields of a definition and of those that it contains, without comments, by the name of the type."""
    found: dict[str, list[str]] = {"": []}
    name = ""
    for line in text.splitlines():
        words = line.partition("#")[0].split()
        if words[:1] == ["MSG:"]:
            name = words[-1].replace("/msg/", "/")
            found[name] = []
        elif words and not line.startswith("==="):
            found[name].append(" ".join(words))
    return found


def _joined(parts: dict[str, list[str]]) -> str:
    """The definition of which these are the parts, as the package reads it."""
    return "\n".join(
        line
        for name, lines in parts.items()
        for line in ([*lines] if not name else ["=" * 80, f"MSG: {name}", *lines])
    )


def _other(channel: Channel) -> InputError:
    return InputError(
        f"messages of {channel.topic} do not have the fields of {channel.kind}, or are damaged: record with the "
        "packages of `optopad driver ros2`"
    )
