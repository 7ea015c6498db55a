"""Recordings as MCAP files with ROS 2 messages, which Foxglove, `ros2 bag` and rosbags open; ROS is not needed.

Channels: ``/optopad/sensor`` (what the sensor is, once), ``/optopad/frame``, ``/optopad/press``. The messages are those
of the package `optopad_msgs` (`fabrication/ros2/optopad_msgs`), in CDR. A message's log time is its time of arrival on
this machine; the stamp in its header is the time of the frame's first conversion.

Any channels of these message types are read, so bags of the ROS 2 node are, too, as files or folders. A file that lost
its end keeps every complete chunk; a chunk has at most `CHUNK_BYTES`.

Source: MCAP format specification, version 0; packages mcap and mcap-ros2-support (both MIT).
"""

from __future__ import annotations

import io
import json
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from pathlib import Path
from typing import IO, Any

import numpy as np

from design.arrays import FloatArray
from design.errors import InputError, OutputError
from design.files import require_suffix, whole_file
from fabrication.driver.link.clock import BoardClock
from fabrication.driver.link.frames import Frame, FrameDecoder
from fabrication.driver.link.protocol import frame_format
from fabrication.driver.recording.press_labels import PressLabels
from fabrication.driver.recording.raw import Record, RecordKind, Sink, press_of
from fabrication.driver.recording.recorded import Recorded, press_labels
from fabrication.driver_file import DriverConfig, config_from_document
from fabrication.record import plain_of
from fabrication.ros2.messages import PACKAGE, definition

MCAP_SUFFIX = ".mcap"
CHUNK_BYTES = 16384
"""Size of the parts in which messages are written [bytes]: half a second of frames at 200 Hz."""
SENSOR, FRAME, PRESS = (f"{PACKAGE}/msg/{name}" for name in ("Sensor", "Frame", "Press"))
TOPICS = {SENSOR: "/optopad/sensor", FRAME: "/optopad/frame", PRESS: "/optopad/press"}
FRAME_ID = "optopad"
NS_PER_S = 1_000_000_000
INSTALL = "install it: pip install mcap mcap-ros2-support"


def mcap_sink() -> Callable[[IO[bytes], DriverConfig], Sink]:
    """Class that writes an MCAP file.

    Raises
    ------
    OutputError : the package mcap-ros2-support is missing.
    """
    try:
        import mcap_ros2.writer  # noqa: F401
    except ImportError:
        raise OutputError(
            f"MCAP needs the package mcap-ros2-support; {INSTALL}, or record .optorec"
        ) from None
    return McapSink


class McapSink:
    """Writes an MCAP file: the sensor at once, then frames and presses; END completes the file.

    Parameters
    ----------
    stream : the new file, unbuffered
    config : driver configuration of the sensor
    """

    def __init__(self, stream: IO[bytes], config: DriverConfig) -> None:
        from mcap_ros2.writer import Writer

        self._out = io.BufferedWriter(stream)
        self._decoder = FrameDecoder(frame_format(config), config.timing.frame_ms / 1e3)
        self._has_frames = False
        self._writer = Writer(self._out, chunk_size=CHUNK_BYTES)
        self._schemas = {name: self._writer.register_msgdef(name, definition(name)) for name in TOPICS}
        self._config = config
        self._has_sensor = False

    def write(self, records: list[Record]) -> None:
        """Write frames and presses, and for a record of kind END the file's index."""
        for record in records:
            self._put_record(record)
        if records[-1].kind != RecordKind.END:
            self._out.flush()

    def write_recorded(self, recorded: Recorded) -> None:
        """Write all frames and presses of a recording, and the file's index."""
        clock, connection = BoardClock(recorded.config.timing.frame_ms / 1e3), 0
        press_mm, before = recorded.press_mm, np.full(3, np.nan)
        lost = np.diff(recorded.sequence, prepend=recorded.sequence[0] - 1) - 1
        self._put(SENSOR, sensor_message(self._config, float(recorded.host_s[0])), float(recorded.host_s[0]))
        for k, host_s in enumerate(recorded.host_s.tolist()):
            if recorded.connection[k] != connection:
                connection = int(recorded.connection[k])
                clock.restart()
                lost[k] = 0
            if press_mm is not None and (press_mm[k] != before).any():
                before = press_mm[k]
                self._put(PRESS, _press_message(before, host_s), host_s)
            message = {
                "header": {
                    "stamp": stamp(clock.began_s(float(recorded.device_s[k]), host_s)),
                    "frame_id": FRAME_ID,
                },
                "arrived": stamp(host_s),
                "connection": connection,
                "sequence": int(recorded.sequence[k]),
                "device_us": round(recorded.device_s[k] * 1e6),
                "lost_before": int(lost[k]),
                "states": recorded.counts.shape[1],
                "receivers": recorded.counts.shape[2],
                "counts": recorded.counts[k].ravel().tolist(),
                "normalised": [],
            }
            self._put(FRAME, message, host_s, int(recorded.sequence[k]))
        self._end()

    def _end(self) -> None:
        self._writer.finish()  # type: ignore[no-untyped-call]
        self._out.flush()

    def _put_record(self, record: Record) -> None:
        if not self._has_sensor:
            self._has_sensor = True
            self._put(SENSOR, sensor_message(self._config, record.host_s), record.host_s)
        match record.kind:
            case RecordKind.HELLO:
                if self._has_frames:
                    self._decoder.begin()
            case RecordKind.FRAME:
                self._has_frames = True
                for frame in self._decoder.decoded([record.content], record.host_s):
                    self._put(FRAME, frame_message(frame), frame.host_s, frame.sequence)
            case RecordKind.PRESS:
                self._put(PRESS, _press_message(press_of(record), record.host_s), record.host_s)
            case RecordKind.END:
                self._end()

    def _put(self, name: str, message: dict[str, Any], host_s: float, sequence: int = 0) -> None:
        time_ns = nanoseconds(host_s)
        self._writer.write_message(
            TOPICS[name], self._schemas[name], message, time_ns, time_ns, sequence % (1 << 32)
        )


def nanoseconds(time_s: float) -> int:
    """A time since 1970 in whole nanoseconds, from which `seconds` gives exactly the same number."""
    whole = int(time_s)
    return whole * NS_PER_S + round((time_s - whole) * NS_PER_S)


def seconds(time_ns: int) -> float:
    """A time since 1970 [s] from nanoseconds."""
    whole, rest = divmod(time_ns, NS_PER_S)
    return whole + rest / NS_PER_S


def stamp(time_s: float) -> dict[str, int]:
    """A time as the fields of ROS's Time."""
    whole, rest = divmod(nanoseconds(time_s), NS_PER_S)
    return {"sec": whole, "nanosec": rest}


def sensor_message(config: DriverConfig, host_s: float) -> dict[str, Any]:
    """Fields of a message that states what a sensor is."""
    return {
        "header": {"stamp": stamp(host_s), "frame_id": FRAME_ID},
        "design": config.design,
        "digest": config.digest,
        "emitters": [one.name for one in config.emitters],
        "receivers": [one.name for one in config.receivers],
        "rate": config.timing.wanted_hz,
        "driver_config": json.dumps(plain_of(config), separators=(",", ":")),
    }


def frame_message(frame: Frame, frame_id: str = FRAME_ID) -> dict[str, Any]:
    """Fields of a frame's message."""
    states, receivers = frame.counts.shape
    return {
        "header": {"stamp": stamp(frame.began_s), "frame_id": frame_id},
        "arrived": stamp(frame.host_s),
        "connection": frame.connection,
        "sequence": frame.sequence,
        "device_us": frame.device_us,
        "lost_before": frame.lost_before,
        "states": states,
        "receivers": receivers,
        "counts": frame.counts.ravel().tolist(),
        "normalised": [] if frame.baseline is None else frame.normalised.ravel().tolist(),
    }


def _press_message(press_mm: Sequence[float] | FloatArray, host_s: float) -> dict[str, Any]:
    x_mm, y_mm, depth_mm = (float(value) for value in press_mm)
    header = {"stamp": stamp(host_s), "frame_id": FRAME_ID}
    return {"header": header, "x_mm": x_mm, "y_mm": y_mm, "depth_mm": depth_mm}


def write_mcap(recorded: Recorded, out: Path, _name: str = "") -> None:
    """Write a recording's frames, and a press where the known press changes, as a complete MCAP file or none.

    Raises
    ------
    OutputError : the folder cannot be written, or the package mcap-ros2-support is missing.
    """
    require_suffix(out, (MCAP_SUFFIX,))
    mcap_sink()
    with whole_file(out) as hidden, hidden.open("wb", buffering=0) as stream:
        sink = McapSink(stream, recorded.config)
        sink.write_recorded(recorded)


def read_mcap(file: Path, topic: str | None = None) -> Recorded:
    """Read the frames and presses of an MCAP file, or of the MCAP files in a bag's folder.

    Parameters
    ----------
    topic : topic of the frames; None if the file has frames of one sensor only

    Raises
    ------
    InputError : no such file, a damaged one, or one without frames of optopad; or frames of several sensors.
    """
    read = _Bag(file)
    frames = read.of(FRAME, topic)
    space = next(name for name, (kind, _) in read.topics.items() if kind == FRAME).rpartition("/")[0]
    sensors = read.of(SENSOR, None if topic is None else f"{topic.rpartition('/')[0]}/sensor")
    config = config_from_document(
        json.loads(sensors[-1][1].driver_config), where=f"{file}: the driver configuration in {space}/sensor"
    )
    layout = frame_format(config)
    shape = (len(config.emitters) + 1, layout.receivers)
    counts = np.array([message.counts for _, message in frames], dtype=np.uint16)
    host_s = np.array([_time_s(message.arrived) for _, message in frames])
    presses = read.of(PRESS, None, at_least=0)
    return Recorded(
        config=config,
        counts=counts.reshape(-1, *shape),
        connection=np.array([message.connection for _, message in frames], dtype=np.int64),
        sequence=np.array([message.sequence for _, message in frames], dtype=np.int64),
        device_s=np.array([message.device_us for _, message in frames], dtype=np.int64) / 1e6,
        host_s=host_s,
        labels=_labels(presses, host_s),
        lost=sum(message.lost_before for _, message in frames),
        stray_bytes=read.stray_bytes,
        ended_cleanly=read.ended_cleanly,
    )


def _labels(presses: list[tuple[int, Any]], host_s: FloatArray) -> PressLabels | None:
    if not presses:
        return None
    values = np.array([(one.x_mm, one.y_mm, one.depth_mm) for _, one in presses])
    return press_labels(values, np.array([seconds(at) for at, _ in presses]), host_s)


def _time_s(time: Any) -> float:
    return seconds(time.sec * NS_PER_S + time.nanosec)


class _Bag:
    """All messages of optopad in an MCAP file, or in the MCAP files of a folder.

    Attributes
    ----------
    topics : by topic, the type of its messages, and its messages with their log times [ns]; other types have none
    stray_bytes : number of bytes behind the last complete record
    ended_cleanly : whether every file ends with its footer
    """

    def __init__(self, file: Path) -> None:
        self.file = file
        self.topics: dict[str, tuple[str, list[tuple[int, Any]]]] = {}
        self.stray_bytes, self.ended_cleanly = 0, True
        for one in _files(file):
            self._read(one)

    def of(self, kind: str, topic: str | None, at_least: int = 1) -> list[tuple[int, Any]]:
        """Messages of one type, of a topic or of the only topic that has them."""
        found = {name: messages for name, (one, messages) in self.topics.items() if one == kind and messages}
        if topic is not None:
            found = {name: messages for name, messages in found.items() if name == topic}
        if len(found) > 1:
            raise InputError(
                f"{self.file}: has frames of several sensors; give --topic, one of {', '.join(found)}"
            )
        if not found and at_least:
            has = ", ".join(f"{name} ({one})" for name, (one, _) in self.topics.items()) or "no messages"
            where = "" if topic is None else f" on {topic}"
            raise InputError(
                f"{self.file}: has no {kind}{where}; it has {has}. Record the topics of optopad_ros, or use "
                "`optopad driver record --out x.mcap`"
            )
        return next(iter(found.values()), [])

    def _read(self, file: Path) -> None:
        from mcap.exceptions import EndOfFile, McapError
        from mcap.records import Channel, Footer, Message, Schema

        schemas: dict[int, Schema] = {}
        channels: dict[int, Channel] = {}
        is_whole = False
        with file.open("rb") as stream:
            try:
                for record in _records(stream):
                    if isinstance(record, Schema):
                        schemas[record.id] = record
                    elif isinstance(record, Channel):
                        channels[record.id] = record
                        self.topics.setdefault(record.topic, (schemas[record.schema_id].name, []))
                    elif isinstance(record, Message):
                        self._add(channels[record.channel_id], schemas, record)
                    is_whole = isinstance(record, Footer) or is_whole
            except EndOfFile:
                pass  # the end is missing
            except (McapError, ValueError, KeyError) as err:
                if not self.topics:
                    raise InputError(f"{file}: is not an MCAP file, or damaged: {err}") from None
        self.ended_cleanly &= is_whole

    def _add(self, channel: Any, schemas: dict[int, Any], record: Any) -> None:
        schema = schemas[channel.schema_id]
        if schema.name in TOPICS:
            message = _decoder_for(schema.name, schema.encoding, schema.data)(record.data)
            self.topics[channel.topic][1].append((record.log_time, message))


def _records(stream: IO[bytes]) -> Iterator[Any]:
    from mcap.stream_reader import StreamReader

    yield from StreamReader(stream, validate_crcs=True).records


@cache
def _decoder_for(name: str, encoding: str, text: bytes) -> Callable[[bytes], Any]:
    """Function that decodes messages of a type by the definition in the file."""
    from mcap.records import Schema
    from mcap_ros2.decoder import DecoderFactory

    decode = DecoderFactory().decoder_for("cdr", Schema(id=1, data=text, encoding=encoding, name=name))
    if decode is None:
        raise InputError(f"messages {name} are not in ROS 2's encoding; record with the storage plugin mcap")
    return decode


def _files(file: Path) -> list[Path]:
    try:
        import mcap_ros2.decoder  # noqa: F401
    except ImportError:
        raise InputError(f"{file}: MCAP needs the package mcap-ros2-support; {INSTALL}") from None
    found = sorted(file.glob("*.mcap")) if file.is_dir() else [file]
    if not found:
        raise InputError(
            f"{file}: has no MCAP file; record with `ros2 bag record -s mcap`, or use `ros2 bag convert`"
        )
    if not found[0].is_file():
        raise InputError(f"{file}: no such file")
    return found
