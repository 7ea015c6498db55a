"""Whole messages are found in whatever surrounds them, however the stream is cut."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from optopad.fabrication.driver.link.protocol import (
    MAGIC,
    FrameFormat,
    Scanner,
    SelfTest,
    message_lengths,
    pack_frames,
    pack_self_test,
)

PAD = FrameFormat(emitters=8, receivers=8, bits=10)
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
