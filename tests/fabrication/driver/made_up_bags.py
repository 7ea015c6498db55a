"""Bags of the made-up pad under known presses, in the many shapes in which recorders and robots leave them."""

from __future__ import annotations

import sqlite3
import zlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import zstandard
from mcap.data_stream import RecordBuilder
from mcap.records import Channel, Chunk, DataEnd, Footer, Header, Message, Schema
from mcap.writer import MCAP0_MAGIC, CompressionType, Writer
from mcap_ros2._dynamic import serialize_dynamic

from optopad.fabrication.driver.link.frames import FrameDecoder
from optopad.fabrication.driver.link.protocol import frame_format, pack_frames
from optopad.fabrication.driver.recording import mcap_file
from optopad.fabrication.driver.recording.mcap_file import FRAME, PRESS, SENSOR, nanoseconds
from optopad.fabrication.driver.recording.messages import _frame_layout
from optopad.fabrication.ros2 import definition
from tests.fabrication.driver.made_up_pad import pad_config, press_table

CONFIG = pad_config()
BEGUN_S = 1_790_000_000.0
RATE_HZ = 50.0
DEPTHS_MM = (-1.0, 1.0, 3.0)
FRAMES_A_PRESS = 4
TOPICS = {SENSOR: "/optopad/sensor", FRAME: "/optopad/frame", PRESS: "/optopad/press"}
METADATA = """rosbag2_bagfile_information:
  version: 9
  storage_identifier: mcap
  relative_file_paths:
{}
  duration:
    nanoseconds: 24980000000
  topics_with_message_count:
    - topic_metadata:
        name: /optopad/frame
"""


@dataclass(frozen=True)
class Event:
    """A message: its log time [s], its type, its content in CDR, its number."""

    log_s: float
    kind: str
    content: bytes
    sequence: int = 0


@cache
def encoder(kind: str) -> Callable[[Any], bytes]:
    return serialize_dynamic(kind, definition(kind))[kind]  # type: ignore[return-value]


def session(
    begin_s: float = 0.0, *, seed: int = 1, places: int = 5, presses: bool = True
) -> tuple[list[Event], np.ndarray]:
    """Messages of a node from the board's start on, in the order of time, and (frame, 3) the press of each frame."""
    rng = np.random.default_rng(seed)
    area = CONFIG.workspace
    x, y = (
        np.linspace(low, high, places) for low, high in ((area.x0_mm, area.x1_mm), (area.y0_mm, area.y1_mm))
    )
    known = np.array([(a, b, depth) for a, b in zip(x, y[::-1], strict=True) for depth in DEPTHS_MM])
    known += rng.uniform(0.0, 0.1, known.shape) * (1.0, 1.0, 0.0)
    truth = np.repeat(known, FRAMES_A_PRESS, axis=0)
    time_s = np.arange(len(truth)) / RATE_HZ
    light = press_table().at(truth)
    counts = np.concatenate([light, np.zeros((len(light), 1, light.shape[2]))], axis=1) + 5.0
    counts = np.clip(np.round(counts + rng.normal(0.0, 0.7, counts.shape)), 0, 1023).astype(int)
    layout = frame_format(CONFIG)
    messages = pack_frames(layout, range(len(truth)), np.round(1e6 * (time_s + 0.5)), counts)
    decoder = FrameDecoder(layout, CONFIG.timing.frame_ms / 1e3)
    begun_s = BEGUN_S + begin_s
    found = [Event(begun_s - 0.4, SENSOR, encoder(SENSOR)(mcap_file.sensor_message(CONFIG, begun_s)))]
    for k, (message, moment) in enumerate(zip(messages, begun_s + time_s, strict=True)):
        if presses and k % FRAMES_A_PRESS == 0:
            press = mcap_file._press_message(truth[k], float(moment))
            found.append(Event(moment - 0.001, PRESS, encoder(PRESS)(press)))
        (frame,) = decoder.decoded([message], float(moment))
        found.append(Event(moment, FRAME, encoder(FRAME)(mcap_file.frame_message(frame)), frame.sequence))
    return found, truth


def later(events: Sequence[Event], by_s: float) -> list[Event]:
    """The events with other log times and the same content."""
    return [replace(one, log_s=one.log_s + by_s) for one in events]


def write_bag(
    file: Path,
    *parts: tuple[Sequence[Event], dict[str, str]],
    chunk_bytes: int = 16384,
    compression: CompressionType = CompressionType.ZSTD,
    schema: Callable[[str, str, bytes], tuple[str, str, bytes]] = lambda *given: given,
    change: Callable[[bytes], bytes] = lambda content: content,
    other: tuple[int, str, bytes] | None = None,
    crc: bool = True,
) -> Path:
    """Write events with their topics by type; several parts are merged by log time, one part keeps its order.

    other : number of the event before which a message of a channel without a schema is written, its encoding, content
    """
    merged = [(one, topics) for events, topics in parts for one in events]
    if len(parts) > 1:
        merged.sort(key=lambda one: one[0].log_s)
    file.parent.mkdir(parents=True, exist_ok=True)
    with file.open("wb") as stream:
        writer = Writer(stream, chunk_size=chunk_bytes, compression=compression, enable_crcs=crc)
        writer.start("ros2", "made up")
        schemas: dict[str, int] = {}
        channels: dict[str, int] = {}
        for number, (one, topics) in enumerate(merged):
            time_ns = nanoseconds(one.log_s)
            if other is not None and other[0] == number:
                writer.add_message(writer.register_channel("/robot", other[1], 0), time_ns, other[2], time_ns)
            if one.kind not in schemas:
                schemas[one.kind] = writer.register_schema(
                    *schema(one.kind, "ros2msg", definition(one.kind).encode())
                )
            topic = topics[one.kind]
            if topic not in channels:
                channels[topic] = writer.register_channel(topic, "cdr", schemas[one.kind])
            writer.add_message(channels[topic], time_ns, change(one.content), time_ns, one.sequence)
        writer.finish()
    return file


def write_split(folder: Path, events: Sequence[Event], names: Sequence[str]) -> Path:
    """Write events into files of these names, one after the other."""
    for name, part in zip(names, np.array_split(np.arange(len(events)), len(names)), strict=True):
        write_bag(folder / name, ([events[k] for k in part], TOPICS), chunk_bytes=2048)
    return folder


def write_metadata(folder: Path, names: Sequence[str]) -> None:
    text = METADATA.format("\n".join(f"    - {name}" for name in names))
    (folder / "metadata.yaml").write_text(text, encoding="utf-8")


def write_sqlite(file: Path, events: Sequence[Event]) -> Path:
    """A bag as ROS 2 Humble records it without options."""
    file.parent.mkdir(parents=True, exist_ok=True)
    kinds = sorted({one.kind for one in events})
    with closing(sqlite3.connect(file)) as base:
        base.execute(
            "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT, serialization_format TEXT)"
        )
        base.execute(
            "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB)"
        )
        base.executemany(
            "INSERT INTO topics VALUES (?, ?, ?, 'cdr')",
            [(k, TOPICS[kind], kind) for k, kind in enumerate(kinds)],
        )
        base.execute("INSERT INTO topics VALUES (99, '/chatter', 'std_msgs/msg/String', 'cdr')")
        base.executemany(
            "INSERT INTO messages(topic_id, timestamp, data) VALUES (?, ?, ?)",
            [(kinds.index(one.kind), nanoseconds(one.log_s), one.content) for one in events],
        )
        base.commit()
    return file


def write_chunks(file: Path, chunks: Iterable[Chunk], kinds: Sequence[str] = (SENSOR, FRAME, PRESS)) -> Path:
    """An MCAP file of chunks; channel k + 1 has messages of the k-th type."""
    out = RecordBuilder()
    out.write(MCAP0_MAGIC)
    Header(profile="ros2", library="made up").write(out)
    for number, kind in enumerate(kinds, start=1):
        text = definition(kind).encode()
        Schema(id=number, name=kind, encoding="ros2msg", data=text).write(out)
        Channel(id=number, topic=TOPICS[kind], message_encoding="cdr", metadata={}, schema_id=number).write(
            out
        )
    with file.open("wb") as stream:
        for chunk in chunks:
            stream.write(out.end())
            chunk.write(out)
        DataEnd(data_section_crc=0).write(out)
        Footer(summary_start=0, summary_offset_start=0, summary_crc=0).write(out)
        stream.write(out.end() + MCAP0_MAGIC)
    return file


def chunk_of(content: bytes, first_ns: int, last_ns: int, **other: Any) -> Chunk:
    """A chunk of records, in Zstandard; `other` replaces what it declares."""
    declared: dict[str, Any] = {
        "compression": "zstd",
        "data": zstandard.ZstdCompressor(level=1).compress(content),
        "message_start_time": first_ns,
        "message_end_time": last_ns,
        "uncompressed_crc": zlib.crc32(content),
        "uncompressed_size": len(content),
    }
    return Chunk(**(declared | other))


def record_of(number: int, time_ns: int, content: bytes) -> bytes:
    """A message's record."""
    out = RecordBuilder()
    Message(channel_id=number, log_time=time_ns, data=content, publish_time=time_ns, sequence=0).write(out)
    return out.end()


def hours_chunks(frames: int, begun_ns: int = int(BEGUN_S) * 1_000_000_000) -> Iterator[Chunk]:
    """Frames at 200 Hz with random readings and a baseline, and a press every five seconds, as chunks of 5 s."""
    events, _ = session(places=2)
    sensor, press = events[0], events[1]
    yield chunk_of(record_of(1, begun_ns, sensor.content), begun_ns, begun_ns)
    layout = frame_format(CONFIG)
    dark = pack_frames(layout, [0], [0], np.zeros((1, layout.states, layout.receivers), dtype=int))
    (frame,) = FrameDecoder(layout).decoded(dark, BEGUN_S)
    one = record_of(2, 0, encoder(FRAME)(mcap_file.frame_message(frame) | {"normalised": [1.0] * 64}))
    columns = _frame_layout(one[31:])
    rng = np.random.default_rng(1)
    table = np.frombuffer(one * 1000, np.uint8).copy().reshape(1000, -1)
    for begin in range(0, frames, 1000):
        number = np.arange(begin, begin + 1000)
        time_ns = begun_ns + 5_000_000 * number
        table[:, 15:23] = time_ns.astype("<u8")[:, None].view(np.uint8)
        fields = np.ndarray(1000, columns, table, offset=31, strides=(table.shape[1],))
        fields["sequence"], fields["device_us"] = number, 5000 * number
        fields["sec"], fields["nanosec"] = np.divmod(time_ns, 1_000_000_000)
        fields["counts"] = rng.integers(0, 1024, fields["counts"].shape)
        content = record_of(3, int(time_ns[0]), press.content) + table.tobytes()
        yield chunk_of(content, int(time_ns[0]), int(time_ns[-1]))
