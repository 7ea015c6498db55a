"""The bytes between board and host: round trips, lengths, what the contract of the link says bit by bit."""

from __future__ import annotations

import struct
import zlib
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from optopad.design.circuit import circuit as electronics
from optopad.fabrication.driver.link.frames import WrappingCounter
from optopad.fabrication.driver.link.protocol import (
    COMMAND_BYTES,
    MAGIC,
    Command,
    FrameFormat,
    Hello,
    Scanner,
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


LENGTHS = message_lengths(PAD)
FRAMES = pack_frames(PAD, range(40), range(40), np.random.default_rng(1).integers(0, 1024, (40, 9, 8)))
OTHER = pack_self_test(SelfTest(reference_counts=225, late_frames=0, least_free_ram_bytes=7000, config_crc=1))
NOISE = st.lists(
    st.one_of(
        st.binary(max_size=40), st.sampled_from([b"\xa5", b"\xa5\x5a", b"\xa5\x5a\x10", b"\xa5\x5a\x11abc"])
    ),
    min_size=5,
    max_size=5,
)


def scanned(stream: bytes, cuts: list[int]) -> tuple[list[bytes], Scanner]:
    scanner = Scanner(LENGTHS)
    edges = [0, *sorted(min(cut, len(stream)) for cut in cuts), len(stream)]
    found = []
    for start, end in pairwise(edges):
        found += [message for _, message in scanner.feed(stream[start:end])]
    return found, scanner


@given(st.lists(st.integers(0, 4300), max_size=60))
def test_how_the_stream_is_cut_changes_nothing(cuts: list[int]) -> None:
    stream = b"".join(FRAMES)
    found, scanner = scanned(stream, cuts)
    assert found == FRAMES
    assert (scanner.damaged, scanner.skipped_bytes, scanner.kept_bytes) == (0, 0, 0)


def test_a_message_that_ends_as_the_next_begins_is_whole_at_once() -> None:
    crc_ends_in_magic = next(
        frame
        for k in range(4096)
        if (frame := pack_frames(PAD, [k], [k], np.zeros((1, 9, 8), int))[0]).endswith(MAGIC[:1])
    )
    scanner = Scanner(LENGTHS)
    assert scanner.feed(crc_ends_in_magic) == [(crc_ends_in_magic[2], crc_ends_in_magic)]
    assert (scanner.skipped_bytes, scanner.kept_bytes) == (0, 0)


@given(NOISE, st.lists(st.integers(0, 700), max_size=20))
def test_messages_between_noise_are_all_found(noise: list[bytes], cuts: list[int]) -> None:
    wanted = [FRAMES[0], OTHER, FRAMES[1], FRAMES[2]]
    stream = b"".join(a + b for a, b in zip(noise, [*wanted, b""], strict=True)) + bytes(2 * PAD.total_bytes)
    found, scanner = scanned(stream, cuts)
    assert found == wanted
    assert scanner.skipped_bytes + scanner.kept_bytes == len(stream) - sum(map(len, wanted))


@given(st.binary(max_size=3000), st.integers(1, 97))
def test_what_is_kept_is_shorter_than_a_message_whatever_arrives(noise: bytes, step: int) -> None:
    scanner = Scanner(LENGTHS)
    for start in range(0, len(noise), step):
        assert scanner.feed(noise[start : start + step]) == []
        assert scanner.kept_bytes < max(LENGTHS.values())


def test_half_frames_for_ever_yield_nothing_and_fill_nothing() -> None:
    scanner, half = Scanner(LENGTHS), FRAMES[0][:50]
    for _ in range(20_000):
        assert scanner.feed(half) == []
    assert scanner.kept_bytes < PAD.total_bytes
    assert scanner.feed(FRAMES[1] + bytes(PAD.total_bytes))[0][1] == FRAMES[1]


def test_a_damaged_frame_takes_only_itself() -> None:
    damaged = bytearray(b"".join(FRAMES[:3]))
    damaged[PAD.total_bytes + 50] ^= 1
    found, scanner = scanned(bytes(damaged), [])
    assert found == [FRAMES[0], FRAMES[2]]
    assert (scanner.damaged, scanner.skipped_bytes) == (1, PAD.total_bytes)


def test_a_lost_byte_takes_only_its_frame() -> None:
    stream = b"".join(FRAMES[:3])
    found, _ = scanned(stream[:150] + stream[151:], [])
    assert found == [FRAMES[0], FRAMES[2]]


def test_an_unfinished_candidate_can_be_forgotten() -> None:
    scanner = Scanner(LENGTHS)
    scanner.feed(FRAMES[0][:60])
    scanner.forget()
    assert [message for _, message in scanner.feed(FRAMES[1])] == [FRAMES[1]]


RATE_HZ = 400
DAY_FRAMES = 24 * 3600 * RATE_HZ


def chunks(total: int, size: int) -> list[tuple[int, int]]:
    return [(start, min(start + size, total)) for start in range(0, total, size)]


@pytest.mark.slow
def test_a_day_of_frames_across_the_wrap_of_the_sequence_loses_none() -> None:
    counter, start, seen = WrappingCounter(goes_back=True), 2**32 - DAY_FRAMES // 2, 0
    for first, end in chunks(DAY_FRAMES, 1_000_000):
        sent = ((start + np.arange(first, end)) % 2**32).astype(np.uint32)
        whole, steps = counter.extended(sent)
        assert (steps == 1).all()
        assert whole[0] == start + first
        seen += len(whole)
    assert seen == DAY_FRAMES
    assert whole[-1] == start + DAY_FRAMES - 1  # beyond 2^32


@pytest.mark.slow
def test_a_day_of_device_time_wraps_twenty_times_and_never_goes_back() -> None:
    counter, wraps, last = WrappingCounter(goes_back=False), 0, -1
    for first, end in chunks(DAY_FRAMES, 1_000_000):
        truth = np.arange(first, end, dtype=np.int64) * (1_000_000 // RATE_HZ)
        sent = (truth % 2**32).astype(np.uint32)
        wraps += int((np.diff(sent.astype(np.int64), prepend=max(last, 0) % 2**32) < 0).sum())
        whole, _ = counter.extended(sent)
        assert np.array_equal(whole, truth)
        last = int(whole[-1])
    assert wraps == 20  # 86,400 s over 4,294.97 s


@given(st.integers(0, 2**32 - 1), st.lists(st.integers(1, 2**31 - 1), min_size=1, max_size=30))
def test_lost_frames_are_counted_across_any_wrap(start: int, steps: list[int]) -> None:
    truth = start + np.concatenate(([0], np.cumsum(steps)))
    counter = WrappingCounter(goes_back=True)
    whole, found = counter.extended((truth % 2**32).astype(np.uint32))
    assert np.array_equal(whole, truth)
    assert found.tolist() == [1, *steps]


@given(st.lists(st.integers(0, 2**32 - 1), max_size=20), st.integers(0, 20))
def test_pieces_count_as_the_whole_does(values: list[int], cut: int) -> None:
    sent = np.array(values, dtype=np.uint32)
    whole, steps = WrappingCounter(goes_back=True).extended(sent)
    counter = WrappingCounter(goes_back=True)
    parts = [counter.extended(sent[:cut]), counter.extended(sent[cut:])]
    assert np.array_equal(np.concatenate([part[0] for part in parts]), whole)
    assert np.array_equal(np.concatenate([part[1] for part in parts]), steps)


@pytest.mark.parametrize("again", [0, 5, 99])
def test_a_board_that_began_anew_is_a_step_backward(again: int) -> None:
    counter = WrappingCounter(goes_back=True)
    counter.extended(np.array([100], dtype=np.uint32))
    _, steps = counter.extended(np.array([again], dtype=np.uint32))
    assert steps[0] < 0


@given(st.booleans(), st.lists(st.integers(0, 2**32 - 1), min_size=1, max_size=20))
def test_one_by_one_counts_as_all_at_once(goes_back: bool, values: list[int]) -> None:
    whole, steps = WrappingCounter(goes_back=goes_back).extended(np.array(values, dtype=np.uint32))
    counter = WrappingCounter(goes_back=goes_back)
    assert [counter.next(value) for value in values] == list(zip(whole.tolist(), steps.tolist(), strict=True))
