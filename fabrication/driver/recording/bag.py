"""Reads MCAP files and ROS 2 bags with messages of `optopad_msgs`; ROS is not needed.

Any channels of these message types are read, as files or as the folder of a bag. A file that lost its end keeps every
complete chunk.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import IO, Any

import numpy as np

from design.arrays import FloatArray
from design.errors import InputError
from fabrication.driver.link.protocol import frame_format
from fabrication.driver.recording.mcap_file import FRAME, INSTALL, NS_PER_S, PRESS, SENSOR, TOPICS, seconds
from fabrication.driver.recording.press_labels import PressLabels
from fabrication.driver.recording.recorded import Recorded, press_labels
from fabrication.driver_file import DriverConfig, config_from_document


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
