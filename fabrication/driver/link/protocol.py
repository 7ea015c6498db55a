"""Packs and unpacks the messages between board and host, and finds them in a stream of bytes.

All numbers are little-endian. Every message ends in a CRC-32 (`zlib.crc32`) over all preceding bytes, including
the magic. The high half of byte 2 is the protocol's version, and the low half is the type of message or the command.

    readings  A5 5A 10  sequence u32, device time u32 [us], readings packed bit by bit, CRC
    hello     A5 5A 11  firmware 2 x u8, board, emitters, receivers, bits (plus 128 if each emitter's state has a
                        dark state before and after it), prescaler exponent, settle u16 [us], baud u32,
                        interval u32 [us], design digest 32 bytes, CRC
    self-test A5 5A 12  reference reading u16, late frames u32, least free RAM u16,
                        CRC u32 of the program's configuration, CRC
    command   C5 5C 1x  argument u32, CRC; x: 1 start, 2 stop, 3 interval [us], 4 identify, 5 self-test

Readings are ordered by state, and within a state by receiver, with the least significant bit first. With n bits per
reading, reading k occupies bits k n to (k + 1) n - 1 of the byte string. Both counters wrap at 2^32.

The firmware's `session.h` has the same layout in C.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import IntEnum
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from optopad.design.arrays import IntArray
from optopad.design.errors import DeviceError
from optopad.design.recordings import lit_emitters, with_one_dark
from optopad.fabrication.driver_file import DriverConfig

VERSION = 1
MAGIC = b"\xa5\x5a"
COMMAND_MAGIC = b"\xc5\x5c"
CRC_BYTES = 4
WRAP = 2**32
"""Number of values of a 32-bit counter; sequence numbers and device times wrap from WRAP - 1 to 0."""

STAMP = slice(3, 11)
"""Bytes in a message of readings that contain its sequence number and device time."""

CountArray = NDArray[np.uint32]
_HELLO = struct.Struct("<2sB7BHII32s")
_SELF_TEST = struct.Struct("<2sBHIHI")
_COMMAND = struct.Struct("<2sBI")
_CRC = struct.Struct("<I")


class Kind(IntEnum):
    """Types of messages from the board; the value is the low half of a message's byte 2."""

    READINGS = 0
    HELLO = 1
    SELF_TEST = 2


class Command(IntEnum):
    """Commands from the host to the board. The argument of RATE is the frame interval [us], or 0 for the
    board's shortest."""

    START = 1
    STOP = 2
    RATE = 3
    IDENTIFY = 4
    SELF_TEST = 5


HELLO_BYTES = _HELLO.size + CRC_BYTES
SELF_TEST_BYTES = _SELF_TEST.size + CRC_BYTES
COMMAND_BYTES = _COMMAND.size + CRC_BYTES


@dataclass(frozen=True, kw_only=True)
class FrameFormat:
    """Shape of a frame: numbers of emitters and receivers, dark states, and number of bits of each reading.

    Attributes
    ----------
    dark : when dark states occur, ``frame`` or ``each``; see `optopad.design.recordings.lit_emitters`
    """

    emitters: int
    receivers: int
    bits: int
    dark: str = "frame"

    @property
    def lit(self) -> tuple[int | None, ...]:
        """Index of the emitter that is lit in each state; None for a dark state."""
        return lit_emitters(self.emitters, self.dark)

    @property
    def states(self) -> int:
        """Number of states."""
        return len(self.lit)

    @property
    def readings(self) -> int:
        """Number of readings in a frame: states times receivers."""
        return self.states * self.receivers

    @property
    def reading_bytes(self) -> int:
        """Number of bytes of the packed readings."""
        return -(-self.readings * self.bits // 8)

    @property
    def total_bytes(self) -> int:
        """Number of bytes of a complete message of readings."""
        return int(_record_type(self).itemsize)

    @property
    def full_scale(self) -> int:
        """Largest reading [counts]."""
        return (1 << self.bits) - 1


@dataclass(frozen=True, kw_only=True)
class Hello:
    """A board's description of itself.

    Attributes
    ----------
    firmware : major and minor version
    board : number of this type of board in the catalogue
    dark : when dark states occur, ``frame`` or ``each``; see `optopad.design.recordings.lit_emitters`
    prescaler_exponent : exponent n of the converter's clock, which is the board's clock divided by 2^n
    interval_us : requested frame interval [us]; 0 for the board's shortest
    digest : SHA-256 of the design that the firmware was made for, 64 hexadecimal digits
    """

    firmware: tuple[int, int]
    board: int
    emitters: int
    receivers: int
    bits: int
    prescaler_exponent: int
    settle_us: int
    baud: int
    interval_us: int
    digest: str
    dark: str = "frame"


@dataclass(frozen=True, kw_only=True)
class SelfTest:
    """Result of a board's self-test.

    Attributes
    ----------
    reference_counts : reading of the internal 1.1 V reference, with the supply as full scale [counts]; 0 if not
        measured
    late_frames : number of frames that began later than the frame interval requires
    least_free_ram_bytes : smallest amount of free memory since the reset [bytes]
    config_crc : CRC-32 of the configuration that was compiled into the program
    """

    reference_counts: int
    late_frames: int
    least_free_ram_bytes: int
    config_crc: int


@dataclass(frozen=True, kw_only=True)
class Unpacked:
    """Arrays of n frames: sequence numbers (n,), device times (n,) [us], readings (n, states, receivers) [counts].

    Sequence numbers and device times are as sent, so they wrap at 2^32. The last state of the readings is dark. If the
    board sends a dark state before and after each emitter's state, `optopad.design.recordings.with_one_dark` has
    combined them.
    """

    sequence: CountArray
    device_us: CountArray
    counts: NDArray[np.uint16]


def frame_format(config: DriverConfig) -> FrameFormat:
    """Shape of the frames that a driver configuration describes.

    Raises
    ------
    DeviceError : that frame does not have the layout of this version of the protocol.
    """
    frame = config.frame
    found = FrameFormat(
        emitters=len(config.emitters),
        receivers=frame.receivers,
        bits=frame.bits_per_reading,
        dark="frame" if config.ambient.subtract_state is not None else "each",
    )
    if found.total_bytes != frame.total_bytes or found.bits > MAX_BITS:
        raise DeviceError(
            f"driver.toml: frames of {frame.total_bytes} bytes and {found.bits} bits a reading; protocol "
            f"{VERSION} makes them {found.total_bytes} bytes, at most {MAX_BITS} bits; use the optopad that wrote it"
        )
    return found


_DARK_AROUND_EACH = 1 << 7
"""Flag in the hello's byte of bits per reading: set if there is a dark state before and after each emitter's state."""
MAX_BITS = 16
"""Largest number of bits per reading; arrays of readings have 16-bit elements."""


def message_lengths(layout: FrameFormat) -> dict[int, int]:
    """Length in bytes of each type of message from the board, by the message's byte 2."""
    lengths = {
        Kind.READINGS: layout.total_bytes,
        Kind.HELLO: HELLO_BYTES,
        Kind.SELF_TEST: SELF_TEST_BYTES,
    }
    return {VERSION << 4 | kind: length for kind, length in lengths.items()}


def sealed(content: bytes) -> bytes:
    """Message made of `content` and, at its end, the content's CRC-32."""
    return content + _CRC.pack(zlib.crc32(content))


def is_whole(message: bytes | memoryview) -> bool:
    """Whether the CRC at the end of a message matches its content."""
    return zlib.crc32(message[:-CRC_BYTES]) == int.from_bytes(message[-CRC_BYTES:], "little")


def pack_frames(layout: FrameFormat, sequence: Any, device_us: Any, counts: Any) -> list[bytes]:
    """Messages of readings, one per frame.

    Parameters
    ----------
    layout : shape of the frames
    sequence, device_us : sequence numbers and device times [us] of n frames, shape (n,); both wrap at 2^32
    counts : readings in all states that are sent, shape (n, states, receivers), from 0 to full scale [counts]
    """
    values = np.asarray(counts).reshape(-1, layout.readings)
    rows = np.zeros(len(values), _record_type(layout))
    rows["magic"], rows["version"] = MAGIC, VERSION << 4 | Kind.READINGS
    rows["sequence"] = np.asarray(sequence, dtype=np.int64) % WRAP
    rows["device_us"] = np.asarray(device_us, dtype=np.int64) % WRAP
    bits = (values[:, :, None].astype(np.uint32) >> np.arange(layout.bits, dtype=np.uint32)) & 1
    flat = bits.reshape(len(values), -1).astype(np.uint8)
    rows["readings"] = np.packbits(flat, axis=1, bitorder="little")
    whole = rows.tobytes()
    step = layout.total_bytes
    return [sealed(whole[k : k + step - CRC_BYTES]) for k in range(0, len(whole), step)]


def unpack_frames(layout: FrameFormat, frames: Iterable[bytes]) -> Unpacked:
    """Unpack messages of readings, one per frame, into arrays; the caller must have checked the CRCs."""
    rows = np.frombuffer(b"".join(frames), _record_type(layout))
    return Unpacked(
        sequence=rows["sequence"].astype(np.uint32),
        device_us=rows["device_us"].astype(np.uint32),
        counts=_unpacked(layout, rows["readings"]),
    )


def pack_hello(hello: Hello) -> bytes:
    """Message that contains the board's description of itself."""
    bits = hello.bits | (_DARK_AROUND_EACH if hello.dark == "each" else 0)
    head = (*hello.firmware, hello.board, hello.emitters, hello.receivers, bits)
    rest = hello.prescaler_exponent, hello.settle_us, hello.baud, hello.interval_us
    version = VERSION << 4 | Kind.HELLO
    return sealed(_HELLO.pack(MAGIC, version, *head, *rest, bytes.fromhex(hello.digest)))


def unpack_hello(message: bytes) -> Hello:
    """The board's description of itself that a complete message contains."""
    _, _, *plain, digest = _HELLO.unpack_from(message)
    major, minor, board, emitters, receivers, bits, exponent, settle_us, baud, interval_us = plain
    return Hello(
        firmware=(major, minor),
        board=board,
        emitters=emitters,
        receivers=receivers,
        bits=bits & ~_DARK_AROUND_EACH,
        dark="each" if bits & _DARK_AROUND_EACH else "frame",
        prescaler_exponent=exponent,
        settle_us=settle_us,
        baud=baud,
        interval_us=interval_us,
        digest=digest.hex(),
    )


def pack_self_test(found: SelfTest) -> bytes:
    """Message that contains a self-test's result."""
    numbers = found.reference_counts, found.late_frames, found.least_free_ram_bytes, found.config_crc
    return sealed(_SELF_TEST.pack(MAGIC, VERSION << 4 | Kind.SELF_TEST, *numbers))


def unpack_self_test(message: bytes) -> SelfTest:
    """The self-test result that a complete message contains."""
    _, _, reference, late, ram, crc = _SELF_TEST.unpack_from(message)
    return SelfTest(reference_counts=reference, late_frames=late, least_free_ram_bytes=ram, config_crc=crc)


def pack_command(command: Command, argument: int = 0) -> bytes:
    """Message that contains a command to the board and the command's argument."""
    return sealed(_COMMAND.pack(COMMAND_MAGIC, VERSION << 4 | command, argument))


def unpack_command(message: bytes) -> tuple[Command, int]:
    """Command and argument that a complete message contains; raises ValueError for an unknown command."""
    _, kind, argument = _COMMAND.unpack_from(message)
    return Command(kind & 0x0F), argument


@cache
def _record_type(layout: FrameFormat) -> np.dtype[np.void]:
    fields = [
        ("magic", "S2"),
        ("version", "u1"),
        ("sequence", "<u4"),
        ("device_us", "<u4"),
        ("readings", "u1", (layout.reading_bytes,)),
        ("crc", "<u4"),
    ]
    return np.dtype(fields)


def _unpacked(layout: FrameFormat, packed: NDArray[np.uint8]) -> NDArray[np.uint16]:
    """Unpack packed readings of shape (n, bytes) into counts of shape (n, states, receivers), one dark state last.

    A reading has at most 16 bits, so it spans three bytes or fewer.
    """
    first, shift = _places(layout)
    padded = np.zeros((len(packed), layout.reading_bytes + 2), dtype=np.uint32)
    padded[:, :-2] = packed
    words = padded[:, :-2] | padded[:, 1:-1] << 8 | padded[:, 2:] << 16
    values = (words[:, first] >> shift) & np.uint32(layout.full_scale)
    readings = values.reshape(-1, layout.states, layout.receivers)
    if layout.states > layout.emitters + 1:
        readings = np.rint(with_one_dark(readings, layout.lit, layout.full_scale))
    return readings.astype(np.uint16)


@cache
def _places(layout: FrameFormat) -> tuple[IntArray, CountArray]:
    """Index of each reading's first byte, and the number of low bits in that byte that belong to the previous reading.

    Both arrays have the shape (readings,).
    """
    first, shift = np.divmod(np.arange(layout.readings) * layout.bits, 8)
    return first, shift.astype(np.uint32)


Message = tuple[int, bytes]
"""A message from the board: its byte 2, which gives its type, and all its bytes."""

HEAD_BYTES = 3


class Scanner:
    """Finds the complete messages in successive pieces of a stream, which may be damaged, cut, or begin in a message.

    Bytes that begin with the magic and a type are a candidate, which is a message if its CRC matches. Otherwise the
    search continues one byte further on, so that no complete message after a damaged one is lost; the bytes behind the
    candidate's start have then waited until its full length arrived. Less than one message is kept between two pieces.

    Parameters
    ----------
    lengths : length in bytes of each type of message, by the message's byte 2
    magic : the two bytes with which a message begins
    """

    def __init__(self, lengths: Mapping[int, int], magic: bytes = MAGIC) -> None:
        self._lengths = dict(lengths)
        self._magic = magic
        self._kept = b""
        self.damaged = 0
        """Number of byte sequences so far that began like a message but had a wrong CRC."""
        self.skipped_bytes = 0
        """Number of bytes so far that belong to no message; bytes of a message still arriving are not counted."""

    @property
    def kept_bytes(self) -> int:
        """Number of bytes received so far of a possible message that is not yet complete."""
        return len(self._kept)

    def forget(self) -> None:
        """Discard the bytes of an unfinished message, for example after an interruption of the line."""
        self.skipped_bytes += len(self._kept)
        self._kept = b""

    def feed(self, piece: bytes) -> list[Message]:
        """The messages that this piece of the stream completes, in the order of arrival."""
        stream = self._kept + piece if self._kept else piece
        found: list[Message] = []
        at, end = 0, len(stream)
        while True:
            begun = stream.find(self._magic, at)
            if begun < 0:
                at = end - 1 if stream.endswith(self._magic[:1], at) else end
                break
            at = begun
            if at + HEAD_BYTES > end:
                break
            length = self._lengths.get(stream[at + 2])
            if length is None:
                at += 1
            elif at + length > end:
                break
            elif is_whole(message := stream[at : at + length]):
                found.append((message[2], message))
                at += length
            else:
                self.damaged += 1
                at += 1
        self._kept = stream[at:]
        self.skipped_bytes += at - sum(
            len(message) for _, message in found
        )  # in one step: others may be reading it
        return found
