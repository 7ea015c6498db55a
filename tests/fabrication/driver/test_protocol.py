"""The bytes between board and host: round trips, lengths, what the contract of the link says bit by bit."""

from __future__ import annotations

import struct
import zlib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from optopad.design.circuit import circuit as electronics
from optopad.fabrication.driver.link.protocol import (
    COMMAND_BYTES,
    Command,
    FrameFormat,
    Hello,
    SelfTest,
    is_whole,
    message_lengths,
    pack_command,
    pack_frames,
    pack_hello,
    pack_self_test,
    unpack_command,
    unpack_frames,
    unpack_hello,
    unpack_self_test,
)

PAD = FrameFormat(emitters=8, receivers=8, bits=10)
U32 = st.integers(0, 2**32 - 1)
U16 = st.integers(0, 2**16 - 1)
U8 = st.integers(0, 255)


@st.composite
def frames(draw: st.DrawFn) -> tuple[FrameFormat, np.ndarray]:
    layout = FrameFormat(
        emitters=draw(st.integers(1, 64)), receivers=draw(st.integers(1, 16)), bits=draw(st.integers(8, 16))
    )
    shape = (draw(st.integers(1, 3)), layout.states, layout.receivers)
    return layout, draw(arrays(np.uint16, shape, elements=st.integers(0, layout.full_scale)))


@given(frames(), U32, U32)
def test_readings_of_any_geometry_come_back_as_they_were(
    drawn: tuple[FrameFormat, np.ndarray], sequence: int, device_us: int
) -> None:
    layout, counts = drawn
    numbers = sequence + np.arange(len(counts))
    packed = pack_frames(layout, numbers, np.full(len(counts), device_us), counts)
    assert {len(frame) for frame in packed} == {layout.total_bytes}
    assert all(is_whole(frame) for frame in packed)
    back = unpack_frames(layout, packed)
    assert np.array_equal(back.counts, counts)
    assert back.sequence.tolist() == [int(number) % 2**32 for number in numbers]
    assert set(back.device_us.tolist()) == {device_us}


def test_a_frame_by_hand() -> None:
    layout = FrameFormat(emitters=1, receivers=2, bits=10)
    (frame,) = pack_frames(layout, [7], [1000], [[[1, 2], [3, 1023]]])
    value = 1 | 2 << 10 | 3 << 20 | 1023 << 30
    head = b"\xa5\x5a\x10" + struct.pack("<II", 7, 1000) + value.to_bytes(5, "little")
    assert frame == head + struct.pack("<I", zlib.crc32(head))


@given(st.integers(1, 64), st.integers(1, 16))
def test_a_frame_is_as_long_as_the_timing_budget_says(emitters: int, receivers: int) -> None:
    layout = FrameFormat(emitters=emitters, receivers=receivers, bits=10)
    assert layout.total_bytes == electronics.frame_bytes(emitters, receivers, 10)


@given(
    st.builds(
        Hello,
        firmware=st.tuples(U8, U8),
        board=U8,
        emitters=U8,
        receivers=U8,
        bits=st.integers(0, 127),
        dark=st.sampled_from(["frame", "each"]),
        prescaler_exponent=U8,
        settle_us=U16,
        baud=U32,
        interval_us=U32,
        digest=st.binary(min_size=32, max_size=32).map(bytes.hex),
    )
)
def test_a_hello_comes_back_as_it_was(hello: Hello) -> None:
    assert unpack_hello(pack_hello(hello)) == hello


@given(
    st.builds(SelfTest, reference_counts=U16, late_frames=U32, least_free_ram_bytes=U16, config_crc=U32),
)
def test_a_self_test_comes_back_as_it_was(found: SelfTest) -> None:
    assert unpack_self_test(pack_self_test(found)) == found


@given(st.sampled_from(Command), U32)
def test_a_command_comes_back_as_it_was(command: Command, argument: int) -> None:
    message = pack_command(command, argument)
    assert (len(message), COMMAND_BYTES) == (11, 11)
    assert is_whole(message)
    assert unpack_command(message) == (command, argument)


def test_the_messages_have_the_lengths_that_the_fields_add_up_to() -> None:
    hello = 2 + 1 + 7 + 2 + 4 + 4 + 32 + 4
    self_test = 2 + 1 + 2 + 4 + 2 + 4 + 4
    assert message_lengths(PAD) == {0x10: 105, 0x11: hello, 0x12: self_test}


@given(st.integers(0, 104), st.integers(1, 255))
def test_no_single_changed_byte_passes_the_check(place: int, flip: int) -> None:
    (frame,) = pack_frames(PAD, [1], [2], np.full((1, 9, 8), 513))
    damaged = bytearray(frame)
    damaged[place] ^= flip
    assert not is_whole(bytes(damaged))


@pytest.mark.parametrize("bits", [8, 10, 12, 16])
def test_full_scale_in_every_reading_survives(bits: int) -> None:
    layout = FrameFormat(emitters=2, receivers=5, bits=bits)
    counts = np.full((1, 3, 5), layout.full_scale)
    assert np.array_equal(unpack_frames(layout, pack_frames(layout, [0], [0], counts)).counts, counts)
