"""Writes recordings as MCAP files with ROS 2 messages, which Foxglove, `ros2 bag` and rosbags open; ROS is not needed.

Channels: ``/optopad/sensor`` (what the sensor is, once), ``/optopad/frame``, ``/optopad/press``. The messages are those
of the package `optopad_msgs` (`fabrication/ros2/optopad_msgs`), in CDR. A message's log time is its time of arrival on
this machine; the stamp in its header is the time of the frame's first conversion.

A file that lost its end keeps every complete chunk. A chunk has at most `CHUNK_BYTES`, and ends at the latest with the
call of `McapSink.write`, at any frame rate. `bag` reads these files.

Source: MCAP format specification, version 0; package mcap (MIT); CDR as in OMG's DDSI-RTPS 2.2, 10.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import IO, Any, cast

import numpy as np
from numpy.typing import NDArray

from optopad.design.arrays import FloatArray, IntArray
from optopad.design.errors import OutputError
from optopad.design.files import require_suffix, whole_file
from optopad.design.progress import OnStep, silent
from optopad.fabrication.driver.link.frames import US_PER_S, BoardClock, Frame, FrameDecoder
from optopad.fabrication.driver.link.protocol import frame_format
from optopad.fabrication.driver.recording.raw import Record, RecordKind, Sink, press_of, write_all
from optopad.fabrication.driver.recording.recorded import LOSSES_NAME, Recorded, losses_metadata
from optopad.fabrication.driver_file import DriverConfig, plain_of
from optopad.fabrication.ros2 import PACKAGE, definition

MCAP_SUFFIX = ".mcap"
CHUNK_BYTES = 16384
"""Size above which a chunk is ended [bytes]: 0.35 s of frames at 200 Hz."""
FRAMES_A_PIECE = 5000
"""Number of a recording's frames that are packed at once."""
STEP = "export"
"""Name of the step in reports of progress."""
SENSOR, FRAME, PRESS = (f"{PACKAGE}/msg/{name}" for name in ("Sensor", "Frame", "Press"))
TOPICS = {SENSOR: "/optopad/sensor", FRAME: "/optopad/frame", PRESS: "/optopad/press"}
FRAME_ID = "optopad"
NS_PER_S = 1_000_000_000
INSTALL = "install it: pip install mcap mcap-ros2-support"


def mcap_sink() -> Callable[[IO[bytes], DriverConfig], Sink]:
    """Class that writes an MCAP file.

    Raises
    ------
    OutputError : the package mcap is missing, or older than 1.5.
    """
    try:
        from mcap.writer import Writer

        _ = Writer.flush
    except (ImportError, AttributeError):
        raise OutputError(
            f"MCAP needs the package mcap, 1.5 or newer; {INSTALL}, or record .optorec"
        ) from None
    return McapSink


class McapSink:
    """Writes an MCAP file: the sensor with the first record, then frames and presses; END completes the file.

    Parameters
    ----------
    stream : the new file, unbuffered
    config : driver configuration of the sensor
    """

    def __init__(self, stream: IO[bytes], config: DriverConfig) -> None:
        from mcap.writer import Writer

        self._stream = stream
        self._pieces = _Pieces()
        self._decoder = FrameDecoder(frame_format(config), config.timing.frame_ms / 1e3)
        self._has_frames = False
        self._writer = Writer(cast("IO[Any]", self._pieces), chunk_size=CHUNK_BYTES)
        self._writer.start(profile="ros2")
        self._channels: dict[str, int] = {}
        self._config = config
        self._write_pieces()

    def write(self, records: list[Record]) -> None:
        """Write frames and presses, and for a record of kind END the file's index.

        All of them are readable from then on: the last chunk is complete. If writing fails, the file ends with its
        last complete chunk.
        """
        for record in records:
            self._put_record(record)
        if records[-1].kind != RecordKind.END:
            self._writer.flush()  # type: ignore[no-untyped-call]
        self._write_pieces()

    def write_recorded(self, recorded: Recorded, on_step: OnStep = silent) -> None:
        """Write all frames and presses of a recording, what is missing of it as metadata, and the file's index."""
        clock, connection = BoardClock(recorded.config.timing.frame_ms / 1e3), int(recorded.connection[0])
        count, before = len(recorded.sequence), np.full(3, np.nan)
        self._put_sensor(float(recorded.host_s[0]))
        for begin in range(0, count, FRAMES_A_PIECE):
            part = slice(begin, begin + FRAMES_A_PIECE)
            numbers, sequence = recorded.connection[part], recorded.sequence[part]
            lost = np.diff(sequence, prepend=recorded.sequence[begin - 1] if begin else sequence[0] - 1) - 1
            began_s = np.empty(len(sequence))
            times = zip(
                numbers.tolist(),
                recorded.device_s[part].tolist(),
                recorded.host_s[part].tolist(),
                strict=True,
            )
            for k, (number, device_s, host_s) in enumerate(times):
                if number != connection:
                    connection = number
                    clock.restart()
                    lost[k] = 0
                began_s[k] = clock.began_s(device_s, host_s)
            frames = _Frames(
                connection=numbers,
                sequence=sequence,
                device_us=np.round(recorded.device_s[part] * US_PER_S).astype(np.int64),
                host_s=recorded.host_s[part],
                lost=lost,
                counts=recorded.counts[part],
                began_s=began_s,
            )
            before = self._put_frames(
                frames, None if recorded.press_mm is None else recorded.press_mm[part], before
            )
            self._write_pieces()
            on_step(STEP, min(begin + FRAMES_A_PIECE, count) / count)
        if losses := losses_metadata(recorded, TOPICS[FRAME]):
            self._writer.add_metadata(LOSSES_NAME, losses)
        self._writer.finish()  # type: ignore[no-untyped-call]
        self._write_pieces()

    def _write_pieces(self) -> None:
        write_all(self._stream, self._pieces.taken())

    def _put_record(self, record: Record) -> None:
        if SENSOR not in self._channels:
            self._put_sensor(record.host_s)
        match record.kind:
            case RecordKind.HELLO:
                if self._has_frames:
                    self._decoder.begin()
            case RecordKind.FRAME:
                self._has_frames = True
                self._put_frames(_frames_of(self._decoder.decoded([record.content], record.host_s)))
            case RecordKind.PRESS:
                self._put_press(press_of(record), record.host_s)
            case RecordKind.END:
                self._writer.finish()  # type: ignore[no-untyped-call]

    def _put_sensor(self, host_s: float) -> None:
        for name, topic in TOPICS.items():
            schema = self._writer.register_schema(name, "ros2msg", definition(name).encode())
            self._channels[name] = self._writer.register_channel(topic, "cdr", schema)
        self._put(SENSOR, _sensor_cdr(sensor_message(self._config, host_s)), host_s)

    def _put_press(self, press_mm: Sequence[float] | FloatArray, host_s: float) -> None:
        self._put(PRESS, _press_cdr(_press_message(press_mm, host_s)), host_s)

    def _put_frames(
        self, frames: _Frames, press_mm: FloatArray | None = None, before: FloatArray | None = None
    ) -> FloatArray:
        """Write frames, each behind its press if that is another than the one before; returns the last press."""
        last = np.full(3, np.nan) if before is None else before
        times, numbers = frames.host_s.tolist(), frames.sequence.tolist()
        for k, content in enumerate(_frames_cdr(frames)):
            if press_mm is not None and (press_mm[k] != last).any():
                last = press_mm[k]
                self._put_press(last, times[k])
            self._put(FRAME, content, times[k], numbers[k])
        return last

    def _put(self, name: str, content: bytes, host_s: float, sequence: int = 0) -> None:
        at = nanoseconds(host_s)
        self._writer.add_message(self._channels[name], at, content, at, sequence % (1 << 32))


class _Pieces:
    """What an MCAP writer has written, in pieces of whole records, until they are taken and written to the file."""

    def __init__(self) -> None:
        self._size, self._pieces = 0, list[bytes]()

    def write(self, piece: bytes) -> None:
        self._size += len(piece)
        self._pieces.append(piece)

    def tell(self) -> int:
        return self._size

    def flush(self) -> None:
        """Nothing to do: the pieces are taken."""

    def taken(self) -> list[bytes]:
        """The pieces since the last call."""
        pieces, self._pieces = self._pieces, []
        return pieces


@dataclass(frozen=True, kw_only=True)
class _Frames:
    """n frames as arrays (n,): numbers, times [us, s] as in `Frame`; counts have the shape (n, states, receivers)."""

    connection: IntArray
    sequence: IntArray
    device_us: IntArray
    host_s: FloatArray
    lost: IntArray
    counts: NDArray[np.uint16]
    began_s: FloatArray


def _frames_of(frames: list[Frame]) -> _Frames:
    return _Frames(
        connection=np.array([frame.connection for frame in frames]),
        sequence=np.array([frame.sequence for frame in frames]),
        device_us=np.array([frame.device_us for frame in frames]),
        host_s=np.array([frame.host_s for frame in frames]),
        lost=np.array([frame.lost_before for frame in frames]),
        counts=np.array([frame.counts for frame in frames]),
        began_s=np.array([frame.began_s for frame in frames]),
    )


_CDR = b"\x00\x01\x00\x00"
"""First bytes of a message in CDR: numbers are little-endian."""
_HEADER = struct.Struct(f"<4siII{len(FRAME_ID) + 1}s")
_PRESS = struct.Struct("<4x3d")


def _frames_cdr(frames: _Frames) -> Iterator[bytes]:
    """The frames' messages in CDR: numbers are at multiples of their size behind the first four bytes."""
    states, receivers = frames.counts.shape[1:]
    rows = np.zeros(len(frames.sequence), _frame_type(states, receivers))
    rows["head"], rows["id_bytes"], rows["id"] = _CDR, len(FRAME_ID) + 1, FRAME_ID
    rows["stamp"], rows["arrived"] = _stamps(frames.began_s), _stamps(frames.host_s)
    for name in ("connection", "sequence", "device_us", "lost", "counts"):
        rows[name] = getattr(frames, name)
    rows["states"], rows["receivers"], rows["readings"] = states, receivers, states * receivers
    content, size = rows.tobytes(), rows.itemsize
    return (content[k : k + size] for k in range(0, len(content), size))


@cache
def _frame_type(states: int, receivers: int) -> np.dtype[np.void]:
    """Layout of a frame's message without normalised signals; its last number, their count, is 0."""
    stamp, counts_end = ("<u4", (2,)), 60 + 2 * states * receivers
    fields: dict[str, tuple[Any, int]] = {
        "stamp": (stamp, 0),
        "id_bytes": ("<u4", 8),
        "id": (f"S{len(FRAME_ID) + 1}", 12),
        "arrived": (stamp, 20),
        "connection": ("<u4", 28),
        "sequence": ("<u8", 32),
        "device_us": ("<u8", 40),
        "lost": ("<u4", 48),
        "states": ("<u2", 52),
        "receivers": ("<u2", 54),
        "readings": ("<u4", 56),
        "counts": (("<u2", (states, receivers)), 60),
    }
    names = ["head", *fields]
    return np.dtype(
        {
            "names": names,
            "formats": ["S4", *(kind for kind, _ in fields.values())],
            "offsets": [0, *(len(_CDR) + at for _, at in fields.values())],
            "itemsize": len(_CDR) + -(-counts_end // 4) * 4 + 4,
        }
    )


def _stamps(time_s: FloatArray) -> NDArray[np.uint32]:
    """Times as the two numbers of ROS's Time, shape (n, 2)."""
    whole = np.floor(time_s)
    rest = np.rint((time_s - whole) * NS_PER_S)
    return np.stack([whole + (rest == NS_PER_S), rest % NS_PER_S], axis=1).astype(np.uint32)


def _press_cdr(message: dict[str, Any]) -> bytes:
    place = (message["x_mm"], message["y_mm"], message["depth_mm"])
    return _header_cdr(message["header"]) + _PRESS.pack(*place)


def _sensor_cdr(message: dict[str, Any]) -> bytes:
    content = _header_cdr(message["header"])
    for value in list(message.values())[1:]:
        if isinstance(value, str):
            content += _text_cdr(content, value)
        elif isinstance(value, list):
            content += struct.pack(f"<{-len(content) % 4}xI", len(value))
            for text in value:
                content += _text_cdr(content, text)
        else:
            content += struct.pack(f"<{-len(content) % 4}xf", value)
    return content


def _header_cdr(header: dict[str, Any]) -> bytes:
    moment, name = header["stamp"], header["frame_id"].encode() + b"\0"
    return _HEADER.pack(_CDR, moment["sec"], moment["nanosec"], len(name), name)


def _text_cdr(before: bytes, text: str) -> bytes:
    """A text behind the bytes `before`: its length is at a multiple of 4."""
    content = text.encode() + b"\0"
    return bytes(-len(before) % 4) + struct.pack("<I", len(content)) + content


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


def write_mcap(recorded: Recorded, out: Path, *, on_step: OnStep = silent) -> None:
    """Write a recording's frames, and a press where the known press changes, as a complete MCAP file or none.

    Raises
    ------
    OutputError : the folder cannot be written, or the package mcap is missing.
    InputError : presses of two fingers are known; the message `optopad_msgs/Press` has one.
    """
    require_suffix(out, (MCAP_SUFFIX,))
    recorded.require_one_finger(out)
    mcap_sink()
    with whole_file(out) as hidden, hidden.open("wb", buffering=0) as stream:
        sink = McapSink(stream, recorded.config)
        sink.write_recorded(recorded, on_step)
