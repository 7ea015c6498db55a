"""Writes recordings as MCAP files with ROS 2 messages, which Foxglove, `ros2 bag` and rosbags open; ROS is not needed.

Channels: ``/optopad/sensor`` (what the sensor is, once), ``/optopad/frame``, ``/optopad/press``. The messages are those
of the package `optopad_msgs` (`fabrication/ros2/optopad_msgs`), in CDR. A message's log time is its time of arrival on
this machine; the stamp in its header is the time of the frame's first conversion.

A file that lost its end keeps every complete chunk; a chunk has at most `CHUNK_BYTES`. `bag` reads these files.

Source: MCAP format specification, version 0; packages mcap and mcap-ros2-support (both MIT).
"""

from __future__ import annotations

import io
import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import IO, Any

import numpy as np

from design.arrays import FloatArray
from design.errors import OutputError
from design.files import require_suffix, whole_file
from design.recordings import signals_of
from fabrication.driver.link.clock import BoardClock
from fabrication.driver.link.frames import US_PER_S, Frame, FrameDecoder
from fabrication.driver.link.protocol import frame_format
from fabrication.driver.recording.raw import Record, RecordKind, Sink, press_of
from fabrication.driver.recording.recorded import Recorded
from fabrication.driver_file import DriverConfig
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
