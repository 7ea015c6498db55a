"""Bags of robots: every label is right, or the bag is refused with the cause."""

from __future__ import annotations

import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import lz4.frame
import numpy as np
import pytest
import zstandard
from mcap.writer import CompressionType

from optopad.cli import main
from optopad.design.errors import InputError
from optopad.fabrication.driver.recording.export import read_recorded
from optopad.fabrication.driver.recording.joined_log import joined
from optopad.fabrication.driver.recording.mcap_file import FRAME, PRESS, SENSOR, write_mcap
from optopad.fabrication.driver.recording.position_log import read_position_log
from optopad.fabrication.driver.recording.recorded import Recorded
from optopad.fabrication.driver.recording.recorder import Recorder
from optopad.sims.readings.dataset import data_notes, read_data
from optopad.sims.readings.recording import read_recording
from optopad.work import as_netcdf
from tests.fabrication.driver import made_up_bags as bags
from tests.fabrication.driver.made_up_bags import (
    TOPICS,
    later,
    session,
    write_bag,
    write_metadata,
    write_split,
)
from tests.fabrication.driver.test_mcap_file import FRAMES, assert_equal
from tests.said import says

OLD = [f"bag_{k}.mcap" for k in range(12)]
NEW = [f"{k}_bag_2026_11_28-11_{k:02d}_00.mcap" for k in range(12)]
EVENTS, TRUTH = session()


def assert_right(found: Recorded, truth: np.ndarray = TRUTH, *, count: int | None = None) -> None:
    """Every frame has its own press; connection c begins at frame (c - 1) * len(TRUTH)."""
    number = (found.connection - 1) * len(TRUTH) + found.sequence
    assert (np.diff(number) > 0).all()
    assert found.press_mm is not None
    np.testing.assert_array_equal(found.press_mm, truth[number])
    assert len(number) == (len(truth) if count is None else count)


def refused(file: Path, **topics: str) -> str:
    with pytest.raises(InputError) as caught:
        read_recorded(file, **topics)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_the_files_of_a_split_bag_are_read_in_their_order_not_in_that_of_text(tmp_path: Path) -> None:
    for names in (OLD, NEW):
        folder = write_split(tmp_path / names[0], EVENTS, names)
        assert sorted(names) != names
        assert_right(read_recorded(folder))
        write_metadata(
            folder, names[::-1]
        )  # contradicts the log times, which agree with the sequence numbers
        assert_right(read_recorded(folder))
        again = tmp_path / f"again-{names[0]}"
        write_mcap(read_recorded(folder), again)
        assert_equal(read_recorded(folder), read_recorded(again))


def test_a_missing_file_is_named_and_frames_up_to_the_next_press_are_left_out(tmp_path: Path) -> None:
    folder = write_split(tmp_path / "bag", EVENTS, OLD)
    write_metadata(folder, [f"'{name}'" for name in OLD])
    (folder / "bag_5.mcap").unlink()
    found = read_recorded(folder)
    assert found.missing_files == ("bag_5.mcap",)
    assert not found.ended_cleanly
    assert (found.lost > 0, found.left_out > 0) == (True, True)
    assert "bag_5.mcap of metadata.yaml is missing" in found.losses
    assert_right(found, count=len(TRUTH) - found.lost - found.left_out)


def test_a_torn_file_in_the_middle_of_a_bag_costs_no_label(tmp_path: Path) -> None:
    folder = write_split(tmp_path / "bag", EVENTS, OLD[:4])
    for name, share in ((OLD[1], 0.5), (OLD[3], 0.0)):
        content = (folder / name).read_bytes()
        (folder / name).write_bytes(content[: int(share * len(content))])
    found = read_recorded(folder)
    assert not found.ended_cleanly
    assert found.lost > 0
    assert_right(found, count=len(found.sequence))


@pytest.mark.parametrize("by_s", [3600.0, 1.0 - bags.BEGUN_S], ids=["replayed", "simulation time"])
def test_labels_go_by_log_time_and_host_time_is_that_of_arrival(tmp_path: Path, by_s: float) -> None:
    found = read_recorded(write_bag(tmp_path / "a.mcap", (later(EVENTS, by_s), TOPICS)))
    assert_right(found)
    assert found.host_s[0] == bags.BEGUN_S


def test_frames_and_presses_of_one_tick_of_a_coarse_clock_keep_their_order(tmp_path: Path) -> None:
    events = [replace(one, log_s=np.floor(10.0 * (one.log_s - bags.BEGUN_S)) / 10.0 + 5.0) for one in EVENTS]
    assert len({one.log_s for one in events}) < len(TRUTH) / 4
    assert_right(read_recorded(write_bag(tmp_path / "a.mcap", (events, TOPICS))))


def recorded_both(folder: Path, host_s: np.ndarray, press_s: dict[int, float]) -> list[Path]:
    """One recording in both formats; a press before some frames, at times by the same clock."""
    files = [folder / "a.optorec", folder / "a.mcap"]
    for file in files:
        with Recorder(file, bags.CONFIG) as recorder:
            for k, moment in enumerate(host_s):
                if k in press_s:
                    recorder.press(16.0, 16.0, float(k), press_s[k])
                recorder.frame(FRAMES[k], float(moment))
    return files


@pytest.mark.parametrize("back_s", [30.0, 3600.0])
def test_after_the_clock_was_set_back_labels_go_by_the_order_of_the_file(
    tmp_path: Path, back_s: float
) -> None:
    host_s = bags.BEGUN_S + 0.05 * np.arange(90) - back_s * (np.arange(90) >= 40)
    raw, mcap = recorded_both(tmp_path, host_s, {k: host_s[k] for k in (10, 30, 50)})
    depth = np.repeat([0.0, 10.0, 30.0, 50.0], [10, 20, 20, 40])
    for file in (raw, mcap):
        found = read_recorded(file)
        assert found.press_mm is not None
        np.testing.assert_array_equal(found.press_mm[:, 2], depth)
    assert_equal(read_recorded(raw), read_recorded(mcap))


def test_after_a_small_step_back_ambiguous_frames_are_left_out(tmp_path: Path) -> None:
    host_s = bags.BEGUN_S + 0.05 * np.arange(90) - 0.4 * (np.arange(90) >= 40)
    for file in recorded_both(tmp_path, host_s, {k: host_s[k] for k in (10, 38, 60)}):
        found = read_recorded(file)
        assert found.press_mm is not None
        right = np.array([0.0, 10.0, 38.0, 60.0])[np.searchsorted([10, 38, 60], found.sequence, side="right")]
        np.testing.assert_array_equal(found.press_mm[:, 2], right)
        assert 0 < found.left_out < 20


def test_presses_that_are_added_after_the_recording_label_by_their_times(tmp_path: Path) -> None:
    host_s = bags.BEGUN_S + 0.05 * np.arange(90)
    for file in recorded_both(tmp_path, host_s, {89: host_s[20], 88: host_s[60]}):
        found = read_recorded(file)
        assert found.press_mm is not None
        np.testing.assert_array_equal(found.press_mm[:, 2], np.repeat([0.0, 89.0, 88.0], [20, 40, 30]))


def test_presses_outside_the_frames_are_refused_with_both_spans(tmp_path: Path) -> None:
    host_s = bags.BEGUN_S + 0.05 * np.arange(90)
    for off_s in (-500.0, 500.0):
        for file in recorded_both(tmp_path, host_s, {5: host_s[5] + off_s, 50: host_s[50] + off_s}):
            said = refused(file)
            assert "frames from 0.0 to 4.5 s" in said
            assert f"presses from {off_s + 0.25:.1f} to" in said
            file.unlink()


def test_files_of_a_clock_that_was_set_back_are_ordered_by_metadata_or_names(tmp_path: Path) -> None:
    half = len(EVENTS) // 2
    events = [*EVENTS[:half], *later(EVENTS[half:], -3600.0)]
    folder = write_split(tmp_path / "bag", events, OLD)
    assert_right(read_recorded(folder))
    folder = write_split(tmp_path / "other", events, ["b.mcap", "a.mcap"])
    assert "set back" in refused(folder)
    write_metadata(folder, ["b.mcap", "a.mcap"])
    assert_right(read_recorded(folder))


def sides(style: str) -> list[dict[str, str]]:
    """Topics of a left and a right pad."""
    return [{kind: style.format(side, topic.rpartition("/")[2]) for kind, topic in TOPICS.items()} for side in
            ("left", "right")]  # fmt: skip


@pytest.mark.parametrize("style", ["/{}/{}", "/pads/{}_{}", "/{1}_{0}", "/robot/{}_pad/{}"])
def test_presses_of_one_pad_never_label_the_other(tmp_path: Path, style: str) -> None:
    left, right = sides(style)
    other, other_truth = session(0.013, seed=2)
    file = write_bag(tmp_path / "two.mcap", (EVENTS, left), (other, right))
    assert "give --topic" in refused(file)
    assert_right(read_recorded(file, topic=left[FRAME]))
    assert_right(read_recorded(file, topic=right[FRAME]), other_truth)
    alone, _ = session(0.013, seed=2, presses=False)
    file = write_bag(tmp_path / "one.mcap", (EVENTS, left), (alone, right))
    assert_right(read_recorded(file, topic=left[FRAME]))
    assert read_recorded(file, topic=right[FRAME]).press_mm is None


def test_presses_that_may_be_of_another_pad_need_their_topic(tmp_path: Path) -> None:
    left, right = sides("/{}/{}")
    for name, topics in (
        ("of the other pad", {**left, PRESS: right[PRESS]}),
        ("of a robot", {**left, PRESS: "/robot/press"}),
    ):
        file = write_bag(tmp_path / f"{name}.mcap", (EVENTS, topics))
        assert f"give --press-topic, one of {topics[PRESS]}" in refused(file)
        assert_right(read_recorded(file, press_topic=topics[PRESS]))
    for name, topics in (
        ("default", {**TOPICS, PRESS: "/robot/press"}),
        ("global", {**left, PRESS: "/press"}),
        ("above", {**sides("/pads/{}_{}")[0], PRESS: "/pads/press"}),
    ):
        assert_right(read_recorded(write_bag(tmp_path / f"{name}.mcap", (EVENTS, topics))))
    alone, _ = session(seed=2, presses=False)
    file = write_bag(tmp_path / "shared.mcap", (EVENTS, {**left, PRESS: "/press"}), (alone, right))
    assert "--press-topic" in refused(file, topic=left[FRAME])
    assert "has no optopad_msgs/msg/Press on /nothing" in refused(
        file, topic=left[FRAME], press_topic="/nothing"
    )


def test_the_description_of_another_pad_is_not_taken(tmp_path: Path) -> None:
    left, right = sides("/{}/{}")
    alone = [one for one in session(seed=2)[0] if one.kind != SENSOR]
    file = write_bag(tmp_path / "one.mcap", (EVENTS, left), (alone, right))
    assert "has no optopad_msgs/msg/Sensor that belongs to /right/frame" in refused(file, topic=right[FRAME])
    shared = [{**one, SENSOR: "/pads/sensor"} for one in sides("/pads/{}_{}")]
    file = write_bag(tmp_path / "shared.mcap", *zip((EVENTS, alone), shared, strict=True))
    assert_right(read_recorded(file, topic=shared[0][FRAME]))


def test_a_node_that_restarts_begins_a_new_connection(tmp_path: Path) -> None:
    again, truth = session(300.0, seed=2)
    both = np.concatenate([TRUTH, truth])
    one = write_bag(tmp_path / "one.mcap", ([*EVENTS, *again], TOPICS))
    merged = tmp_path / "merged"
    write_bag(merged / "z.mcap", (EVENTS, TOPICS))
    write_bag(merged / "a.mcap", (again, TOPICS))
    for file in (one, merged):
        found = read_recorded(file)
        assert_right(found, both)
        assert (found.connection[-1], found.lost) == (2, 0)
        write_mcap(found, tmp_path / "again.mcap")
        assert_equal(found, read_recorded(tmp_path / "again.mcap"))


def test_a_press_labels_no_frame_of_another_recording_in_the_folder(tmp_path: Path) -> None:
    more, truth = session(51.0, seed=2)
    late = [one for one in more if one.kind != PRESS][:1] + more[10:]
    number = sum(one.kind == FRAME for one in more[1:10])
    bare = [one for one in more if one.kind != PRESS]
    both = np.concatenate([TRUTH, truth])
    for name, parts, count in (
        ("without presses", {"a_1": EVENTS, "a_2": bare}, len(TRUTH)),
        ("with later ones", {"a_1": EVENTS, "a_2": late}, 2 * len(TRUTH) - number - 1),
        ("without any before", {"a_1": later(bare, -260.0), "a_2": EVENTS}, len(TRUTH)),
    ):
        for part, events in parts.items():
            write_bag(tmp_path / name / f"{part}.mcap", (events, TOPICS))
        found = read_recorded(tmp_path / name)
        if name == "without any before":
            assert set(found.connection) == {2}
            found = replace(found, connection=found.connection - 1)
        assert_right(found, both, count=count)
        assert (found.left_out > 0, f"{found.left_out} left out" in found.losses) == (True, True)
    presses = [one for one in EVENTS if one.kind == PRESS]
    always = [*presses, replace(presses[-1], log_s=more[-1].log_s + 1.0)]
    for part, events in (("p", always), ("a_1", [e for e in EVENTS if e.kind != PRESS]), ("a_2", bare)):
        write_bag(tmp_path / "robot" / f"{part}.mcap", (events, TOPICS))
    held = np.concatenate([TRUTH, np.broadcast_to(TRUTH[-1], TRUTH.shape)])
    assert_right(read_recorded(tmp_path / "robot"), held)
    assert_right(read_recorded(write_bag(tmp_path / "one.mcap", ([*EVENTS, *bare], TOPICS))), held)


def test_a_recording_of_one_connection_that_goes_on_after_a_pause_takes_no_earlier_press(
    tmp_path: Path,
) -> None:
    pause = [*EVENTS[:40], *later(EVENTS[45:], 60.0)]
    write_bag(tmp_path / "two" / "a_1.mcap", (pause[:40], TOPICS))
    write_bag(tmp_path / "two" / "a_2.mcap", (pause[40:], TOPICS))
    found = read_recorded(tmp_path / "two")
    assert found.left_out > 0
    assert_right(found, count=len(TRUTH) - found.lost - found.left_out)


def test_a_copy_of_a_file_in_the_folder_doubles_no_frame(tmp_path: Path) -> None:
    write_bag(tmp_path / "bag" / "a.mcap", (EVENTS, TOPICS))
    write_bag(tmp_path / "bag" / "a copy.mcap", (EVENTS, TOPICS))
    found = read_recorded(tmp_path / "bag")
    assert_right(found)
    assert found.doubled == len(TRUTH)


def test_two_recordings_of_one_time_in_a_folder_are_refused(tmp_path: Path) -> None:
    other, _ = session(0.013, seed=2)
    for name, events in (("a.mcap", EVENTS), ("b.mcap", other)):
        write_bag(tmp_path / "bag" / name, (events, TOPICS))
    assert "folders of their own" in refused(tmp_path / "bag")


SCHEMALESS: list[dict[str, Any]] = [
    {"other": (where, encoding, content)}
    for where in (0, 40)
    for encoding, content in (("json", b'{"ok":true}'), ("cbor", b"\xa1bok\xf5"), ("", b""))
]
ZSTD = zstandard.ZstdCompressor()
SHAPES: dict[str, list[dict[str, Any]]] = {
    "channels without a schema": SCHEMALESS,
    "empty definitions": [{"schema": lambda name, _, __: (name, "", b"")}],
    "messages in Zstandard": [{"change": ZSTD.compress}],
    "other compressions": [{"compression": one} for one in (CompressionType.LZ4, CompressionType.NONE)],
    "definitions with other comments": [{"schema": lambda n, e, d: (n, e, b"# by another\n\n" + d)}],
    "no checksums": [{"crc": False}],
}


@pytest.mark.parametrize("shape", SHAPES)
def test_bags_as_other_programs_write_them_are_read(tmp_path: Path, shape: str) -> None:
    for options in SHAPES[shape]:
        found = read_recorded(write_bag(tmp_path / "a.mcap", (EVENTS, TOPICS), **options))
        assert_right(found)
        assert found.is_whole


def test_bags_that_are_compressed_as_files_and_those_in_sqlite_are_read(tmp_path: Path) -> None:
    content = write_bag(tmp_path / "a.mcap", (EVENTS, TOPICS)).read_bytes()
    folder = tmp_path / "packed"
    folder.mkdir()
    packed = folder / "packed_0.mcap.zstd"
    packed.write_bytes(ZSTD.compress(content))
    write_metadata(folder, ["packed_0.mcap"])
    database = bags.write_sqlite(tmp_path / "humble" / "humble_0.db3", EVENTS)
    for file in (folder, packed, database.parent, database):
        assert_right(read_recorded(file))
    half = len(content) // 2
    packed.write_bytes(ZSTD.compress(content[:half]) + ZSTD.compress(content[half:])[:-100])
    found = read_recorded(packed)
    assert not found.ended_cleanly
    assert_right(found, count=len(found.sequence))
    database.with_suffix(".db3.zstd").write_bytes(b"")
    assert "ros2 bag convert" in refused(database.parent)
    (tmp_path / "b.db3").write_bytes(b"SQLite format 3\0" + bytes(100))
    assert "SQLite" in refused(tmp_path / "b.db3")


def test_other_definitions_of_the_messages_are_read_by_them_or_refused(tmp_path: Path) -> None:
    more = b"uint8 extra\n"
    file = write_bag(tmp_path / "more.mcap", (EVENTS[:20], TOPICS), schema=lambda n, e, d: (n, e, d + more))
    assert "the fields" in refused(file)

    def renamed(name: str, encoding: str, text: bytes) -> tuple[str, str, bytes]:
        return name, encoding, text.replace(b"float32[] normalised", b"float32[] ratio")

    found = read_recorded(write_bag(tmp_path / "renamed.mcap", (EVENTS[:20], TOPICS), schema=renamed))
    assert_right(found, count=len(found.sequence))

    def idl(name: str, encoding: str, text: bytes) -> tuple[str, str, bytes]:
        return name, "ros2idl", b"module optopad_msgs {};"

    assert "the fields" in refused(write_bag(tmp_path / "idl.mcap", (EVENTS[:20], TOPICS), schema=idl))


def middle_chunk(whole: bytes) -> int:
    """Where the chunk in the middle of an MCAP file begins."""
    at, chunks = 8, []
    while whole[at] != 15:  # the end of data
        chunks += [at] * (whole[at] == 6)
        at += 9 + int.from_bytes(whole[at + 1 : at + 9], "little")
    return chunks[len(chunks) // 2]


def test_a_damaged_chunk_costs_its_frames_and_no_label(tmp_path: Path) -> None:
    whole = write_bag(tmp_path / "a.mcap", (EVENTS, TOPICS), chunk_bytes=4096).read_bytes()
    place = middle_chunk(whole)
    # a byte of the packed data; the record's type: unknown, of another program, an end
    for offset, flip in ((500, 0xFF), (0, 0x40), (0, 0x80), (0, 0x04)):
        content = bytearray(whole)
        content[place + offset] ^= flip
        (tmp_path / "b.mcap").write_bytes(content)
        found = read_recorded(tmp_path / "b.mcap")
        assert (found.ended_cleanly, found.lost > 0, found.stray_bytes > 0) == (True, True, True)
        assert_right(found, count=len(TRUTH) - found.lost - found.left_out)


def test_a_damaged_press_of_a_raw_recording_costs_the_frames_up_to_the_next(tmp_path: Path) -> None:
    host_s = bags.BEGUN_S + 0.05 * np.arange(90)
    raw, _ = recorded_both(tmp_path, host_s, {k: host_s[k] - 0.001 for k in range(5, 90, 10)})
    whole = raw.read_bytes()
    depth = np.repeat([0.0, *range(5, 90, 10)], [5, *[10] * 8, 5])
    press, frame = (whole.index(b"\xb5\x6b" + kind, len(whole) // 2) for kind in (b"\x02", b"\x00"))
    for place, left_out in ((press, 10), (frame, 0)):
        content = bytearray(whole)
        content[place + 20] ^= 1
        raw.write_bytes(content)
        found = read_recorded(raw)
        assert found.press_mm is not None
        assert (found.left_out, len(found.sequence) + found.lost + left_out) == (left_out, 90)
        np.testing.assert_array_equal(found.press_mm[:, 2], depth[found.sequence])


def test_frames_out_of_order_are_sorted_and_absent_ones_counted_as_lost(tmp_path: Path) -> None:
    events = [*EVENTS]
    frames = [k for k, one in enumerate(events) if one.kind == FRAME]
    for k in (10, 30, 31):  # with its log time, or each with the log time of the other
        a, b = frames[k], frames[k + 1]
        events[a], events[b] = events[b], events[a]
    a, b = frames[50], frames[51]
    events[a], events[b] = (
        replace(events[b], log_s=events[a].log_s),
        replace(events[a], log_s=events[b].log_s),
    )
    gone = {frames[20], frames[21], frames[40]}
    found = read_recorded(
        write_bag(
            tmp_path / "a.mcap", ([e for k, e in enumerate(events) if k not in gone], TOPICS), crc=False
        )
    )
    assert found.lost == 3
    assert_right(found, count=len(TRUTH) - 3 - found.left_out)
    assert found.left_out <= 2


def test_garbage_in_a_chunk_without_a_checksum_is_found_by_its_times(tmp_path: Path) -> None:
    ns = [int(one.log_s * 1e9) for one in EVENTS]
    numbers = {SENSOR: 1, FRAME: 2, PRESS: 3}
    records = [bags.record_of(numbers[one.kind], at, one.content) for one, at in zip(EVENTS, ns, strict=True)]
    wrong = bags.record_of(2, ns[-1] + 10**15, EVENTS[-1].content)
    chunks = [
        bags.chunk_of(b"".join(records[a : a + 20]), ns[a], ns[min(a + 19, len(ns) - 1)], uncompressed_crc=0)
        for a in range(0, len(records), 20)
    ]
    chunks[1] = bags.chunk_of(b"".join(records[20:40]) + wrong, ns[20], ns[39], uncompressed_crc=0)
    found = read_recorded(bags.write_chunks(tmp_path / "a.mcap", chunks))
    assert found.lost > 0
    assert_right(found, count=len(TRUTH) - found.lost - found.left_out)


def bombs() -> dict[str, Any]:
    zeros = zstandard.ZstdCompressor().compressobj()
    piece = bytes(1 << 20)
    big = b"".join([zeros.compress(piece) for _ in range(300)]) + zeros.flush()
    frame = lz4.frame.LZ4FrameCompressor()
    packed = frame.begin() + b"".join(frame.compress(piece) for _ in range(300)) + frame.flush()
    return {
        "zstd that declares its size": {"data": big, "uncompressed_size": 300 << 20},
        "zstd that declares less": {"data": big, "uncompressed_size": 1000},
        "lz4 that declares its size": {"data": packed, "compression": "lz4", "uncompressed_size": 300 << 20},
        "lz4 that declares less": {"data": packed, "compression": "lz4", "uncompressed_size": 1000},
        "a size of 2^62": {"data": big, "uncompressed_size": 1 << 62},
    }


def test_a_chunk_never_unpacks_beyond_its_declared_size_or_the_limit(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    events, at = session(places=1)[0], int(bags.BEGUN_S) * 10**9
    good = bags.chunk_of(
        b"".join(
            bags.record_of(1 + (one.kind == FRAME), at, one.content)
            for one in events[:3]
            if one.kind != PRESS
        ),
        at,
        at,
    )
    begun_s = time.process_time()
    for name, declared in bombs().items():
        bomb = bags.chunk_of(b"", at, at, uncompressed_crc=0, **declared)
        file = bags.write_chunks(tmp_path / "a.mcap", [good, bomb])
        if declared["uncompressed_size"] == 1000:
            assert read_recorded(file).stray_bytes > 1000, name
        else:
            assert main(["driver", "export", str(file), "--out", str(tmp_path / "a.nc")]) == 2, name
            said = capsys.readouterr().err
            assert ("at most 256 MB" in said, said.count("\n")) == (True, 1), name
    assert time.process_time() - begun_s < 1.0


def test_folders_named_like_files_and_unreadable_files_are_read_or_refused_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    write_bag(tmp_path / "x.mcap" / "x_0.mcap", (EVENTS, TOPICS))
    assert_right(read_recorded(tmp_path / "x.mcap"))
    (tmp_path / "loop.mcap").symlink_to(tmp_path / "loop.mcap")
    (tmp_path / "folder.mcap").mkdir()
    (tmp_path / "x.mcap" / "y.mcap").mkdir()  # a folder within a bag is no file of it
    design = "piacenza2017-pad"
    for name in ("loop.mcap", "folder.mcap", "missing.mcap"):
        for arguments in (
            ["driver", "export", str(tmp_path / name)],
            ["train", str(tmp_path / name)],
            ["compare", design, str(tmp_path / name), "--out", str(tmp_path / "out")],
        ):
            assert main(arguments) == 2, arguments
            said = capsys.readouterr().err
            assert (name in said, said.count("\n")) == (True, 1), said
    monkeypatch.chdir(tmp_path / "x.mcap")
    before = (tmp_path / "x.mcap" / "x_0.mcap").read_bytes()
    assert main(["driver", "export", ".", "--out", "x_0.mcap"]) == 2
    assert (tmp_path / "x.mcap" / "x_0.mcap").read_bytes() == before
    assert main(["driver", "export", "."]) == 0
    assert (tmp_path / "x.nc").exists()


@pytest.mark.slow
def test_every_verb_takes_topics_and_the_folder_of_a_bag(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    left, right = sides("/{}/{}")
    folder = tmp_path / "bag"
    write_bag(folder / "bag_0.mcap", (EVENTS, left), (session(0.013, seed=2)[0], right))
    out, design = ["--out", str(tmp_path / "out")], "piacenza2017-pad"
    for verb in (
        ["driver", "export", str(folder), "--out", str(tmp_path / "a.nc")],
        ["train", str(folder), *out],
        ["evaluate", str(folder), "--model", "none.optomodel", *out],
        ["calibrate", design, str(folder), *out],
        ["compare", design, str(folder), *out],
    ):
        for topics, said in (
            ([], "give --topic, one of /left/frame, /right/frame"),
            (["--topic", "/up/frame"], "has no optopad_msgs/msg/Frame on /up/frame"),
            (
                ["--topic", left[FRAME], "--press-topic", "/up/press"],
                "has no optopad_msgs/msg/Press on /up/press",
            ),
        ):
            assert main([*verb, *topics]) == 2, verb
            assert said in capsys.readouterr().err, verb
    assert main(["compare", design, design, "--topic", "/left/frame", *out]) == 2
    assert "are for a recording" in capsys.readouterr().err
    with as_netcdf(folder, left[FRAME]) as netcdf:
        np.testing.assert_array_equal(read_data(netcdf).press_mm, TRUTH)
    with pytest.raises(InputError, match="is not a bag"), as_netcdf(tmp_path / "a.nc", left[FRAME]):
        pass


@pytest.mark.slow
def test_a_search_in_times_that_step_back_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    host_s = bags.BEGUN_S + 0.05 * np.arange(90) - 30.0 * (np.arange(90) >= 40)
    recorded_both(tmp_path, host_s, {1: host_s[1]})
    rows = "".join(f"{moment:.3f},{moment % 2:.1f}\n" for moment in host_s[:40])
    (tmp_path / "log.csv").write_text(f"time_s,force_n\n{rows}")
    positions = tmp_path / "positions.csv"
    rows = "".join(f"{moment:.3f},16,16,{moment % 2:.1f}\n" for moment in host_s[:40])
    positions.write_text(f"time_s,x_mm,y_mm,depth_mm\n{rows}")
    verb = ["calibrate", "piacenza2017-pad", str(tmp_path / "a.mcap"), "--no-model"]
    assert main([*verb, "--force", str(tmp_path / "log.csv")]) == 2
    assert says(capsys.readouterr().err, "29.95 s ... frame 40")
    with pytest.raises(InputError, match="clock was set back"):
        joined(read_recorded(tmp_path / "a.mcap"), read_position_log(positions))


PEAK = """
import resource, sys
from pathlib import Path
import lz4.frame, mcap_ros2.decoder, zstandard
from optopad.fabrication.driver.recording.export import read_recorded
from optopad.fabrication.driver.recording.lerobot import write_lerobot
def peak_mb(): return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (1e6 if sys.platform == "darwin" else 1e3)
before = peak_mb()
found = read_recorded(Path(sys.argv[1]))
print(len(found.sequence), found.lost, found.press_mm is not None, peak_mb() - before)
"""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="needs the module resource")
def test_an_hour_at_200_hz_is_read_in_300_mb(tmp_path: Path) -> None:
    count = 720_000
    file = bags.write_chunks(tmp_path / "hour.mcap", bags.hours_chunks(count))
    done = subprocess.run(
        [sys.executable, "-c", PEAK, str(file)], capture_output=True, text=True, check=True, timeout=120
    )
    frames, lost, has_press, peak_mb = done.stdout.split()
    assert (int(frames), int(lost), has_press) == (count, 0, "True")
    assert float(peak_mb) < 300.0


@pytest.mark.slow
def test_every_verb_says_what_is_missing_of_a_recording(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    content = write_bag(tmp_path / "a.mcap", (EVENTS, TOPICS)).read_bytes()
    file = tmp_path / "cut.mcap"
    file.write_bytes(content[: int(0.8 * len(content))])
    losses = read_recorded(file).losses
    assert "the end is incomplete" in losses
    assert main(["driver", "export", str(file), "--out", str(tmp_path / "cut.nc")]) == 0
    assert losses in capsys.readouterr().out
    with as_netcdf(file) as netcdf:
        assert f"cut.mcap: {losses}" in data_notes(read_data(netcdf))
        assert f"cut.mcap: {losses}" in read_recording(netcdf).notes
