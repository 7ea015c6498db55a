"""Recordings: nothing that was whole is lost, whatever happens to process, disk or file."""

from __future__ import annotations

import errno
import io
import os
import subprocess
import sys
import time
import tracemalloc
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st

from optopad.design.errors import InputError, OutputError
from optopad.design.preset import PRESETS
from optopad.fabrication.driver import Sensor
from optopad.fabrication.driver.link.protocol import FrameFormat, pack_frames
from optopad.fabrication.driver.recording import export, mcap_file, raw
from optopad.fabrication.driver.recording import recorder as recorder_module
from optopad.fabrication.driver.recording.export import read_recorded, write_csv, write_netcdf
from optopad.fabrication.driver.recording.mcap_file import write_mcap
from optopad.fabrication.driver.recording.raw import PRESS, RecordKind, packed_record, read_records
from optopad.fabrication.driver.recording.recorded import PressLabels
from optopad.fabrication.driver.recording.recorder import Recorder
from optopad.fabrication.driver.simulated.finger import FingerPath, read_path
from optopad.fabrication.driver.simulated.port import FakePort, PtyWire
from optopad.fabrication.driver_file import config_from_document, plain_of
from optopad.sims.readings.recording import read_recording
from tests.fabrication.driver.made_up_pad import board, pad_config

CONFIG = pad_config()
FRAMES = pack_frames(
    FrameFormat(emitters=8, receivers=8, bits=10),
    range(100),
    [2500 * k for k in range(100)],
    np.random.default_rng(2).integers(0, 1024, (100, 9, 8)),
)


def written(file: Path, count: int = 100) -> bytes:
    with Recorder(file, CONFIG) as recorder:
        for number, message in enumerate(FRAMES[:count]):
            recorder.frame(message, 1000.0 + number)
    return file.read_bytes()


def frames_of(file: Path) -> list[bytes]:
    return [record.content for record in read_records(file)[2] if record.kind == RecordKind.FRAME]


@pytest.mark.parametrize("name", PRESETS)
def test_the_configuration_inside_a_recording_is_the_sensor_s(name: str) -> None:
    config = pad_config(name)
    assert config_from_document(plain_of(config), where="header") == config


def test_a_recording_holds_every_frame_byte_for_byte(tmp_path: Path) -> None:
    written(tmp_path / "a.optorec")
    header, config, records, stray = read_records(tmp_path / "a.optorec")
    assert header["format"] == "optopad-recording"
    assert config == CONFIG
    assert frames_of(tmp_path / "a.optorec") == FRAMES
    assert (records[-1].kind, stray) == (RecordKind.END, 0)


def test_a_file_torn_anywhere_keeps_every_complete_frame(tmp_path: Path) -> None:
    whole = written(tmp_path / "a.optorec", 6)
    start, size = whole.index(b"\n") + 1, 13 + 105 + 4
    ends = {*range(start, len(whole), 11), *(start + k * size + d for k in range(1, 7) for d in (-1, 0, 1))}
    for end in sorted(ends):
        file = tmp_path / "torn.optorec"
        file.write_bytes(whole[:end])
        assert frames_of(file) == FRAMES[: min((end - start) // size, 6)]


@settings(max_examples=25)
@given(place=st.integers(0, 5), byte=st.integers(0, 121), flip=st.integers(1, 255))
def test_a_damaged_record_takes_only_itself(
    place: int, byte: int, flip: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    file = tmp_path_factory.mktemp("damaged") / "a.optorec"
    whole = bytearray(written(file, 6))
    whole[whole.index(b"\n") + 1 + place * 122 + byte] ^= flip
    file.write_bytes(whole)
    assert frames_of(file) == [*FRAMES[:place], *FRAMES[place + 1 : 6]]
    assert read_records(file)[3] == 122


def test_frames_that_a_recording_holds_twice_are_read_once_and_counted(tmp_path: Path) -> None:
    written(tmp_path / "once.optorec", 20)
    with Recorder(tmp_path / "twice.optorec", CONFIG) as recorder:
        for message in [*FRAMES[:6], *FRAMES[3:6], *[one for one in FRAMES[6:20] for _ in (1, 2)]]:
            recorder.frame(message, 1000.0)
    once, twice = (read_recorded(tmp_path / f"{name}.optorec") for name in ("once", "twice"))
    assert (twice.doubled, twice.lost, once.doubled) == (3 + 14, 0, 0)
    assert np.array_equal(twice.sequence, once.sequence)
    assert np.array_equal(twice.connection, once.connection)


@pytest.mark.parametrize("name", ["data.csv", "data.nc", "data", "data.optorec.gz"])
def test_a_recording_s_name_promises_no_other_content(name: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"\.mcap; use .*data.*\.optorec"):
        Recorder(tmp_path / name, CONFIG)
    recorded = Path(tmp_path / "a.optorec")
    written(recorded, 3)
    for write, right in ((write_netcdf, ".nc"), (write_csv, ".csv")):
        wrong = tmp_path / (name if name != f"data{right}" else "data.txt")
        with pytest.raises(InputError, match=rf"end in \{right}"):
            write(read_recorded(recorded), wrong, "a")
    assert [file.name for file in tmp_path.iterdir()] == ["a.optorec"]


@pytest.mark.parametrize("is_pressed", [True, False])
def test_a_table_holds_what_the_netcdf_does(is_pressed: bool, tmp_path: Path) -> None:
    written(tmp_path / "a.optorec")
    path = FingerPath(time_s=np.array([0.0, 1.0]), press_mm=np.array([[16.0, 12.0, 0.0], [16.0, 12.0, 4.0]]))
    recorded = read_recorded(tmp_path / "a.optorec", path if is_pressed else None)
    write_netcdf(recorded, tmp_path / "a.nc", "a.optorec")
    write_csv(recorded, tmp_path / "a.csv", "a.optorec")
    rows = [line for line in (tmp_path / "a.csv").read_text().splitlines() if not line.startswith("#")]
    heading = rows[0].split(",")
    positions = ["x_mm", "y_mm", "depth_mm"] if is_pressed else []
    assert heading[:-64] == ["time_s", "connection", "sequence", *positions]
    assert [float(row.split(",")[0]) for row in rows[1:]] == pytest.approx(
        recorded.host_s - recorded.host_s[0], abs=1e-6
    )
    assert len(rows) == 1 + len(FRAMES)
    if not is_pressed:
        return
    table, netcdf = read_recording(tmp_path / "a.csv"), read_recording(tmp_path / "a.nc")
    assert table.design_digest == netcdf.design_digest == CONFIG.digest
    assert table.depth_mm == pytest.approx(netcdf.depth_mm, abs=1e-4)
    assert table.counts.keys() == netcdf.counts.keys()
    assert all(np.array_equal(table.counts[pair], netcdf.counts[pair]) for pair in table.counts)


def test_a_recording_is_never_overwritten(tmp_path: Path) -> None:
    before = written(tmp_path / "a.optorec", 2)
    with pytest.raises(OutputError, match="never overwritten"):
        Recorder(tmp_path / "a.optorec", CONFIG)
    assert (tmp_path / "a.optorec").read_bytes() == before


def test_a_folder_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="No such"):
        Recorder(tmp_path / "none" / "a.optorec", CONFIG)


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="needs /dev/full")
@pytest.mark.parametrize("suffix", [".optorec", ".mcap"])
def test_a_disk_that_is_full_from_the_start_is_named(suffix: str, tmp_path: Path) -> None:
    def full(_: Path) -> Any:
        return open("/dev/full", "wb", buffering=0)

    with pytest.raises(OutputError, match="the disk is full"):
        Recorder(tmp_path / f"a{suffix}", CONFIG, opened=full)


class FullDisk(io.FileIO):
    """A file on a disk with so many bytes left; then writes are cut short, then refused."""

    def __init__(self, file: Path, left: int) -> None:
        super().__init__(file, "xb")
        self._left = left

    def write(self, piece: Any) -> int:
        taken = min(len(piece), self._left)
        if taken == 0:
            raise OSError(errno.ENOSPC, "No space left on device")
        self._left -= taken
        return super().write(piece[:taken]) or 0


@pytest.mark.parametrize("spare", [0, 1, 12, 61, 121, 122, 123, 500])
def test_a_disk_that_fills_up_keeps_the_frames_before_and_no_piece_of_the_next(
    tmp_path: Path, spare: int
) -> None:
    head = len(written(tmp_path / "size.optorec", 0)) - (13 + 16 + 4)  # less the end record
    file = tmp_path / "a.optorec"
    recorder = Recorder(file, CONFIG, opened=lambda name: FullDisk(name, head + spare))
    for number, message in enumerate(FRAMES[:20]):
        recorder.frame(message, float(number))
    recorder.flush()
    with pytest.raises(OutputError, match=r"full.*it holds every"):
        recorder.close()
    assert not recorder.is_open
    assert frames_of(file) == FRAMES[: spare // 122]
    assert read_records(file)[3] == 0


@pytest.mark.slow
def test_a_full_disk_stops_the_recording_and_not_the_stream(tmp_path: Path) -> None:
    with FakePort(board()) as port, Sensor(CONFIG, port.name, rate_hz=200, baseline_s=0) as sensor:
        file = tmp_path / "a.optorec"
        recorder = Recorder(file, CONFIG, opened=lambda name: FullDisk(name, 15_000))
        sensor._open.record(recorder)
        sequences, refusals = [], []
        end = time.monotonic() + 2.0
        while time.monotonic() < end and len(sequences) < 250:
            try:
                sequences.append(sensor.read().sequence)
            except OutputError as err:
                refusals.append(str(err))
        assert sensor.counts.lost == 0
    assert len(refusals) == 1
    assert "disk is full" in refusals[0]
    assert np.diff(sequences).tolist() == [1] * (len(sequences) - 1)  # reading lost none
    assert 50 < len(frames_of(file)) < 100  # 15 kB less the header, at 122 bytes each


class StallingDisk(io.FileIO):
    """A file whose every write takes 0.6 s; the system's buffer of the port holds 0.2 s."""

    def write(self, piece: Any) -> int:
        time.sleep(0.6)
        return super().write(piece) or 0


@pytest.mark.slow
def test_a_disk_that_stalls_costs_no_frame(tmp_path: Path) -> None:
    with FakePort(board()) as port, Sensor(CONFIG, port.name, rate_hz=200, baseline_s=0) as sensor:
        recorders = [
            Recorder(tmp_path / name, CONFIG, opened=lambda name: StallingDisk(name, "xb"))
            for name in ("a.optorec", "a.mcap")
        ]
        for recorder in recorders:
            sensor._open.record(recorder)
        list(sensor.frames(seconds=1.5))
        for recorder in recorders:
            recorder.close()
        assert sensor.counts.lost == 0
    for recorder in recorders:
        assert len(read_recorded(recorder.file).sequence) == recorder.frames > 200


def test_closing_the_sensor_closes_its_recording(tmp_path: Path) -> None:
    with FakePort(board()) as port, Sensor(CONFIG, port.name, rate_hz=200, baseline_s=0) as sensor:
        recorder = sensor.record(tmp_path / "a.optorec")
        list(sensor.frames(count=10))
    assert not recorder.is_open
    assert read_recorded(tmp_path / "a.optorec").ended_cleanly


@pytest.mark.slow
def test_half_a_second_after_it_came_a_frame_is_in_the_file(tmp_path: Path) -> None:
    with FakePort(board()) as port, Sensor(CONFIG, port.name, rate_hz=100, baseline_s=0) as sensor:
        recorders = [sensor.record(tmp_path / name) for name in ("a.optorec", "a.mcap")]
        seen = []
        for _ in range(4):
            time.sleep(0.25)
            received = [recorder.frames for recorder in recorders]
            files = [recorder.file for recorder in recorders]
            in_file = [len(read_recorded(file).sequence) if len(seen) > 1 else 0 for file in files]
            seen.append((received, in_file))
        for recorder in recorders:
            recorder.close()
    for (received, _), (_, in_file) in zip(seen, seen[2:], strict=False):  # two steps of 0.25 s later
        assert all(np.greater_equal(in_file, received))


def test_a_full_disk_leaves_an_mcap_file_with_whole_chunks(tmp_path: Path) -> None:
    for spare in (6000, 6001, 7777, 9000):
        file = tmp_path / f"{spare}.mcap"
        recorder = Recorder(file, CONFIG, opened=lambda name, spare=spare: FullDisk(name, spare))
        with pytest.raises(OutputError, match=r"disk is full.*every frame up to 0\.25 s before"):  # noqa: PT012
            for number, message in enumerate(FRAMES):
                recorder.frame(message, float(number))
                if number % 5 == 4:
                    recorder.flush()
                    kept = number - 4 if recorder.failure else number + 1
                    if recorder.failure:
                        break
            recorder.close()
        found = read_recorded(file)
        assert len(found.sequence) == kept >= 5
        assert found.stray_bytes == 0


@pytest.mark.parametrize("suffix", [".optorec", ".mcap"])
def test_what_was_flushed_is_written_through_to_the_disk(
    suffix: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    sizes: list[int] = []
    monkeypatch.setattr(recorder_module, "SYNC_S", 0.0)
    monkeypatch.setattr(os, "fsync", lambda number: sizes.append(os.fstat(number).st_size))
    recorder = Recorder(tmp_path / f"a{suffix}", CONFIG)
    recorder.frame(FRAMES[0], 1000.0)
    recorder.flush()
    assert sizes[-1] == recorder.file.stat().st_size > 0
    recorder.close()
    assert sizes[-1] == recorder.file.stat().st_size


KILLED = """
import os, signal, sys, time
from pathlib import Path
import numpy as np
from optopad.fabrication.driver.link.protocol import frame_format, pack_frames
from optopad.fabrication.driver.recording.recorder import Recorder
from tests.fabrication.driver.made_up_pad import pad_config

CONFIG = pad_config()
FRAMES = pack_frames(frame_format(CONFIG), range(520), range(520), np.zeros((520, 9, 8), int))

def recorded(file, rate_hz):
    recorder, begun_s = Recorder(file, CONFIG), time.time()
    for k in range(int(1.3 * rate_hz)):
        time.sleep(max(begun_s + k / rate_hz - time.time(), 0.0))
        recorder.frame(FRAMES[k], time.time())
    Path(f"{file}.killed").write_text(f"{time.time()} {recorder.frames}")
    os.kill(os.getpid(), signal.SIGKILL)

for suffix in (".optorec", ".mcap"):
    for rate_hz in (5, 400):
        if os.fork() == 0:
            recorded(f"{sys.argv[1]}/{rate_hz}{suffix}", rate_hz)
for _ in range(4):
    os.wait()
"""


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs processes of POSIX")
def test_a_recorder_that_was_killed_leaves_all_but_the_last_half_second_in_each_format_at_each_rate(
    tmp_path: Path,
) -> None:
    root = Path(__file__).parents[3]
    subprocess.run([sys.executable, "-c", KILLED, str(tmp_path)], cwd=root, check=True)
    for suffix in (".optorec", ".mcap"):
        for rate_hz in (5, 400):
            killed_s, frames = (tmp_path / f"{rate_hz}{suffix}.killed").read_text().split()
            kept = read_recorded(tmp_path / f"{rate_hz}{suffix}")
            assert not kept.ended_cleanly
            assert np.array_equal(kept.sequence, np.arange(len(kept.sequence)))
            assert len(kept.sequence) >= int(frames) - 0.5 * rate_hz
            assert float(killed_s) - kept.host_s[-1] < 0.5


@pytest.mark.slow
def test_the_netcdf_is_one_that_compare_reads(tmp_path: Path) -> None:
    file = tmp_path / "a.optorec"
    with FakePort(board()) as port, Sensor(CONFIG, port.name, rate_hz=200, baseline_s=0) as sensor:
        with sensor.record(file) as recorder:
            recorder.press(16.0, 16.0, 0.0)
            list(sensor.frames(count=20))
            recorder.press(16.0, 16.0, 1.5)
            list(sensor.frames(count=20))
        found = read_recorded(file)
        write_netcdf(found, tmp_path / "a.nc", file.name)
    read = read_recording(tmp_path / "a.nc")
    assert read.design_digest == CONFIG.digest
    assert set(read.depth_mm) == {0.0, 1.5}
    assert read.place_mm is not None
    assert set(map(tuple, read.place_mm)) == {(16.0, 16.0)}
    assert set(read.counts) == {f"E{i}-R{j}" for i in range(1, 9) for j in range(1, 9)}
    frames = found.counts.astype(float)
    assert np.array_equal(read.counts["E2-R3"], frames[:, 1, 2] - frames[:, 8, 2])


def test_presses_stay_with_their_frames_when_the_machine_s_clock_is_set_back(tmp_path: Path) -> None:
    with Recorder(tmp_path / "a.optorec", CONFIG) as recorder:
        for number, message in enumerate(FRAMES):
            host_s = 1000.0 + number - (30.0 if number >= 50 else 0.0)
            if number % 10 == 0:
                recorder.press(1.0, 2.0, 0.1 * number, host_s)
            recorder.frame(message, host_s)
    found = read_recorded(tmp_path / "a.optorec").press_mm
    assert found is not None
    assert found[:, 2] == pytest.approx(np.repeat(np.arange(10.0), 10))


def test_presses_may_come_from_a_path_by_the_board_s_clock(tmp_path: Path) -> None:
    written(tmp_path / "a.optorec")
    path = FingerPath(time_s=np.array([0.0, 1.0]), press_mm=np.array([[1.0, 2.0, 0.0], [1.0, 2.0, 4.0]]))
    write_netcdf(read_recorded(tmp_path / "a.optorec", path), tmp_path / "a.nc", "a.optorec")
    with xr.open_dataset(tmp_path / "a.nc", engine="h5netcdf") as dataset:
        assert np.allclose(dataset["press_depth"], 4.0 * 0.0025 * np.arange(100))
        assert dataset["counts"].attrs["units"] == "ADC counts"
        assert dataset["press_depth"].attrs["units"] == "mm"
        assert list(dataset["state"].values) == [*[f"E{i}" for i in range(1, 9)], "off"]


def test_presses_of_two_fingers_are_exported_where_the_format_has_room_and_refused_elsewhere(
    tmp_path: Path,
) -> None:
    written(tmp_path / "a.optorec")
    file = tmp_path / "fingers.csv"
    file.write_text("t_s,x_mm,y_mm,depth_mm,x2_mm,y2_mm,depth2_mm\n0,10,16,1,22,16,-1\n1,10,16,1,22,18,4\n")
    found = read_recorded(tmp_path / "a.optorec", read_path(file))
    assert found.labels is not None
    assert found.only(found.device_s < 0.1).labels.others_mm.shape == (40, 1, 3)  # type: ignore[union-attr]
    write_netcdf(found, tmp_path / "a.nc", "a.optorec")
    with xr.open_dataset(tmp_path / "a.nc", engine="h5netcdf") as dataset:
        others = dataset["others"]
        assert others.dims == ("time", "other", "axis")
        assert list(dataset["axis"].values) == ["x", "y", "depth"]
        depth = -1.0 + 5.0 * 0.0025 * np.arange(100)
        assert np.allclose(others[:, 0, 2], depth)
        assert np.allclose(dataset["press_depth"], 1.0)
    for suffix, write in ((".csv", write_csv), (".mcap", write_mcap)):
        with pytest.raises(InputError, match=r"has the press of one finger a frame, and two are known; give"):
            write(found, tmp_path / f"b{suffix}", *(["a.optorec"] if suffix == ".csv" else []))  # type: ignore[operator]
        assert not (tmp_path / f"b{suffix}").exists()
    lifted = replace(found, labels=replace(found.labels, others_mm=found.labels.others_mm - [0.0, 0.0, 9.0]))
    write_netcdf(lifted, tmp_path / "c.nc", "a.optorec")
    with xr.open_dataset(tmp_path / "c.nc", engine="h5netcdf") as dataset:
        assert "others" not in dataset


def test_a_torn_recording_exports_what_is_whole(tmp_path: Path) -> None:
    file = tmp_path / "a.optorec"
    file.write_bytes(written(tmp_path / "whole.optorec")[:-700])
    found = read_recorded(file)
    write_netcdf(found, tmp_path / "a.nc", file.name)
    assert not found.ended_cleanly
    assert 90 <= len(found.sequence) < 100
    assert 0 < found.stray_bytes < 122


def several(file: Path) -> None:
    """100 frames of two connections, two presses, damage in the middle and at the end; some frames twice."""
    records = [
        packed_record(kind, 1000.0 + k, content)
        for k, (kind, content) in enumerate(
            [
                (RecordKind.HELLO, bytes(56)),
                *((RecordKind.FRAME, frame) for frame in [*FRAMES[:40], *FRAMES[30:50]]),
                (RecordKind.PRESS, PRESS.pack(1.0, 2.0, 3.0)),
                (RecordKind.HELLO, bytes(56)),
                *((RecordKind.FRAME, frame) for frame in FRAMES[:30]),
                (RecordKind.PRESS, PRESS.pack(1.0, 2.0, 4.0)),
                *((RecordKind.FRAME, frame) for frame in FRAMES[30:50]),
            ]
        )
    ]
    records[20] = b"\xb5\x6b" + records[20][3:]
    file.write_bytes(
        written(file.with_name("head.optorec"), 0).split(b"\n")[0] + b"\n" + b"".join(records)[:-5]
    )


def test_pieces_of_any_size_give_the_same_recording_and_the_same_files(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    several(tmp_path / "a.optorec")
    whole = read_recorded(tmp_path / "a.optorec")
    records = read_records(tmp_path / "a.optorec")
    assert (len(whole.sequence), whole.doubled, whole.lost) == (49 + 49, 10, 1)
    assert whole.stray_bytes == records[3] == 121 + 117
    assert whole.connection.tolist() == [1] * 49 + [2] * 49
    assert whole.press_mm is not None
    assert whole.press_mm[:, 2].tolist() == [0.0] * 49 + [3.0] * 30 + [4.0] * 19
    for size, frames in ((64, 1), (777, 7), (5000, 98)):
        monkeypatch.setattr(raw, "PIECE_BYTES", size)
        for module in (mcap_file, export):
            monkeypatch.setattr(module, "FRAMES_A_PIECE", frames)
        found = read_recorded(tmp_path / "a.optorec")
        for name in ("counts", "connection", "sequence", "device_s", "host_s", "press_mm"):
            assert np.array_equal(getattr(found, name), getattr(whole, name)), name
        assert (found.stray_bytes, found.doubled, found.lost) == (whole.stray_bytes, 10, 1)
        write_csv(found, tmp_path / f"{size}.csv", "a")
        mcap_file.write_mcap(found, tmp_path / f"{size}.mcap")
        write_netcdf(found, tmp_path / f"{size}.nc", "a")
        with xr.open_dataset(tmp_path / f"{size}.nc", engine="h5netcdf") as dataset:
            xr.testing.assert_identical(dataset.load(), export.dataset_of(whole, "a"))
        again = read_recorded(tmp_path / f"{size}.mcap")
        for name in ("counts", "connection", "sequence", "device_s", "press_mm"):
            assert np.array_equal(getattr(again, name), getattr(whole, name)), name
    assert (tmp_path / "64.csv").read_bytes() == (tmp_path / "5000.csv").read_bytes()


def test_an_export_ends_within_a_piece_and_leaves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    written(tmp_path / "a.optorec")
    found = read_recorded(tmp_path / "a.optorec")
    for module in (mcap_file, export):
        monkeypatch.setattr(module, "FRAMES_A_PIECE", 10)
    for suffix in (".csv", ".nc", ".mcap"):
        shares: list[float] = []

        def step(_stage: str, share: float, shares: list[float] = shares) -> None:
            shares.append(share)
            if len(shares) == 3:
                raise KeyboardInterrupt

        with pytest.raises(KeyboardInterrupt):
            export.write_export(found, tmp_path / f"a{suffix}", "a", on_step=step)
        assert shares == pytest.approx([0.1, 0.2, 0.3])
    assert [one.name for one in tmp_path.iterdir()] == ["a.optorec"]


def test_reading_takes_little_more_memory_than_the_readings(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(raw, "PIECE_BYTES", 100_000)
    count = 20_000
    layout = FrameFormat(emitters=8, receivers=8, bits=10)
    frames = pack_frames(layout, range(count), range(count), np.zeros((count, 9, 8), int))
    head = written(tmp_path / "head.optorec", 0).split(b"\n")[0] + b"\n"
    records = (packed_record(RecordKind.FRAME, float(k), frame) for k, frame in enumerate(frames))
    (tmp_path / "a.optorec").write_bytes(head + b"".join(records))
    tracemalloc.start()
    found = read_recorded(tmp_path / "a.optorec")
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert len(found.sequence) == count
    assert peak < 2.5 * found.counts.nbytes


def test_connections_of_a_recording_are_told_apart(tmp_path: Path) -> None:
    file, link = tmp_path / "a.optorec", tmp_path / "pad"
    with (
        FakePort(board(), PtyWire(link)) as first,
        Sensor(CONFIG, str(link), rate_hz=200, baseline_s=0) as sensor,
        sensor.record(file),
    ):
        list(sensor.frames(count=20))
        first.unplug()
        with FakePort(board(), PtyWire(link)):
            while sensor.read().connection == 1:
                pass
            list(sensor.frames(count=20))
    found = read_recorded(file)
    assert set(found.connection) == {1, 2}
    assert found.lost == 0


@pytest.mark.parametrize(
    "content", [b"", b"\xff\xfe\n", b"{}\n", b'{"format": "optopad-recording"}\n', b"[" * 9999 + b"\n"]
)
def test_what_is_no_recording_is_refused(tmp_path: Path, content: bytes) -> None:
    file = tmp_path / "a.optorec"
    file.write_bytes(content)
    with pytest.raises(
        InputError, match=r"(file|UTF-16|text|damaged); needs a recording of `optopad driver record`"
    ):
        read_records(file)


def test_a_recording_without_a_frame_is_refused(tmp_path: Path) -> None:
    written(tmp_path / "a.optorec", 0)
    with pytest.raises(InputError, match="holds no whole frame"):
        read_recorded(tmp_path / "a.optorec")


def test_a_record_of_another_length_is_left_out_and_counted_however_right_its_crc(tmp_path: Path) -> None:
    file = tmp_path / "a.optorec"
    whole = written(file, 6)
    end = packed_record(RecordKind.END, 0.0, bytes(16))
    strange = [
        packed_record(RecordKind.FRAME, 1.0, b"short"),
        packed_record(RecordKind.PRESS, 1.0, b"no press"),
    ]
    file.write_bytes(whole[: -len(end)] + b"".join(strange) + whole[-len(end) :])
    found = read_recorded(file)
    assert len(found.sequence) == 6
    assert found.stray_bytes == sum(map(len, strange))
    assert found.press_mm is None
    assert found.ended_cleanly


def test_a_recording_of_nothing_but_strange_records_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "a.optorec"
    with Recorder(file, CONFIG) as recorder:
        recorder.frame(b"short", 1.0)
    with pytest.raises(InputError, match="holds no whole frame"):
        read_recorded(file)


def test_a_press_that_is_no_number_is_refused_where_it_is_set_and_where_it_is_read(tmp_path: Path) -> None:
    with Recorder(tmp_path / "a.optorec", pad_config()) as recorder:
        with pytest.raises(InputError, match="finite numbers"):
            recorder.press(16.0, 16.0, float("nan"))
        recorder.press(16.0, 16.0, -1.0)
    with pytest.raises(InputError, match=r"1 of 2.*frame 2"):
        PressLabels(press_mm=np.array([[16.0, 16.0, 1.0], [16.0, 16.0, np.inf]]))
