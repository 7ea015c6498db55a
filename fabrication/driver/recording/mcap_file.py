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
from design.recordings import signals_of
from fabrication.driver.link.clock import BoardClock
from fabrication.driver.link.frames import US_PER_S, Frame, FrameDecoder
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
        full_scale = frame_format(recorded.config).full_scale
        self._put(SENSOR, sensor_message(self._config, float(recorded.host_s[0])), float(recorded.host_s[0]))
        for k, host_s in enumerate(recorded.host_s.tolist()):
            if recorded.connection[k] != connection:
                connection = int(recorded.connection[k])
                clock.restart()
                lost[k] = 0
            if press_mm is not None and (press_mm[k] != before).any():
                before = press_mm[k]
                self._put(PRESS, _press_message(before, host_s), host_s)
            counts, device_s = recorded.counts[k], float(recorded.device_s[k])
            frame = Frame(
                connection=connection,
                sequence=int(recorded.sequence[k]),
                device_us=round(device_s * US_PER_S),
                host_s=host_s,
                lost_before=int(lost[k]),
                counts=counts,
                signals=signals_of(counts.astype(np.int32)),
                saturated=counts >= full_scale,
                began_s=clock.began_s(device_s, host_s),
            )
            self._put(FRAME, frame_message(frame), host_s, frame.sequence)
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
    topic = read.topic_of_frames(topic)
    frames, presses = read.messages(topic), read.messages(read.companion(topic, PRESS))
    (_, sensor), *_ = read.messages(read.companion(topic, SENSOR)) or [(0, None)]
    if sensor is None:
        raise read.lacks(SENSOR)
    config = _config(sensor.driver_config, f"{file}: the driver configuration of {topic}")
    shape = (len(config.emitters) + 1, frame_format(config).receivers)
    if any((message.states, message.receivers) != shape for _, message in frames):
        raise InputError(
            f"{file}: {topic} has frames of another sensor than its driver configuration; record again"
        )
    host_s = np.array([_time_s(message.arrived) for _, message in frames])
    return Recorded(
        config=config,
        counts=np.array([message.counts for _, message in frames], dtype=np.uint16).reshape(-1, *shape),
        connection=np.array([message.connection for _, message in frames], dtype=np.int64),
        sequence=np.array([message.sequence for _, message in frames], dtype=np.int64),
        device_s=np.array([message.device_us for _, message in frames], dtype=np.int64) / 1e6,
        host_s=host_s,
        labels=_labels(presses, host_s),
        lost=sum(message.lost_before for _, message in frames),
        stray_bytes=read.stray_bytes,
        ended_cleanly=read.ended_cleanly,
    )


def _config(text: str, where: str) -> DriverConfig:
    try:
        document = json.loads(text)
    except (ValueError, RecursionError) as err:
        raise InputError(f"{where}: cannot be read: {err}; record again") from None
    return config_from_document(document, where=where)


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

    def topic_of_frames(self, topic: str | None) -> str:
        """The given topic, or the only one, with frames; raises InputError."""
        found = [name for name in self._topics_of(FRAME) if topic in (None, name)]
        if len(found) > 1:
            raise InputError(
                f"{self.file}: has frames of several sensors; give --topic, one of {', '.join(found)}"
            )
        if not found:
            raise self.lacks(FRAME, "" if topic is None else f" on {topic}")
        return found[0]

    def companion(self, topic: str, kind: str) -> str | None:
        """The topic of another type for a topic of frames: the one in the same namespace, or else the only one."""
        found = self._topics_of(kind)
        near = [name for name in found if name.rpartition("/")[0] == topic.rpartition("/")[0]]
        return near[0] if near else found[0] if len(found) == 1 else None

    def messages(self, topic: str | None) -> list[tuple[int, Any]]:
        """Messages of a topic with their log times [ns]; none without a topic."""
        return [] if topic is None else self.topics[topic][1]

    def lacks(self, kind: str, where: str = "") -> InputError:
        """The error that the file has no messages of a type."""
        has = ", ".join(f"{name} ({one})" for name, (one, _) in self.topics.items()) or "no messages"
        return InputError(
            f"{self.file}: has no {kind}{where}; it has {has}. Record the topics of optopad_ros, or use "
            "`optopad driver record --out x.mcap`"
        )

    def _topics_of(self, kind: str) -> list[str]:
        return [name for name, (one, messages) in self.topics.items() if one == kind and messages]

    def _read(self, file: Path) -> None:
        from mcap.records import Channel, Footer, Message, Schema

        schemas: dict[int, Schema] = {}
        channels: dict[int, Channel] = {}
        is_whole, end = False, 0
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
                    is_whole, end = isinstance(record, Footer) or is_whole, stream.tell()
            except InputError:
                raise
            except Exception as err:  # all, on purpose: of damaged bytes every decompressor raises its own
                if not self.topics:
                    raise InputError(f"{file}: is not an MCAP file, or damaged: {err}") from None
        self.ended_cleanly &= is_whole
        self.stray_bytes += 0 if is_whole else file.stat().st_size - end

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
