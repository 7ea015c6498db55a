"""Recordings as MCAP files: the same frames as a raw recording, read by other programs as well."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap_ros2.writer import Writer

import optopad
from optopad.cli import main
from optopad.design.errors import InputError, OutputError
from optopad.fabrication.driver.link.frames import Frame
from optopad.fabrication.driver.link.protocol import frame_format, pack_frames
from optopad.fabrication.driver.recording import mcap_file
from optopad.fabrication.driver.recording.bag import read_mcap
from optopad.fabrication.driver.recording.export import read_recorded
from optopad.fabrication.driver.recording.mcap_file import nanoseconds, seconds
from optopad.fabrication.driver.recording.recorder import Recorder
from optopad.fabrication.driver.simulated.port import FakePort
from optopad.fabrication.ros2 import COMMON, definition, names
from optopad.sims.readings.recording import read_recording
from optopad.work import as_netcdf
from tests.fabrication.driver.made_up_pad import board, pad_config

CONFIG = pad_config()
BEGUN_S = 1_790_000_000.1234567
COUNTS = np.random.default_rng(3).integers(0, 1024, (400, 9, 8))
NUMBERS = [k for k in range(402) if k not in (100, 101)]
FRAMES = pack_frames(frame_format(CONFIG), NUMBERS, [5000 * k for k in NUMBERS], COUNTS)


def record(file: Path, *, is_clean: bool = True) -> None:
    """400 frames at 200 Hz, two of them lost, three known presses."""
    recorder = Recorder(file, CONFIG)
    for k, message in enumerate(FRAMES):
        host_s = BEGUN_S + 0.005 * NUMBERS[k] + 1e-4 * (k % 7)
        if k in (50, 150, 250):
            recorder.press(16.0 + k / 97.0, 7.1, 0.01 * k, host_s - 1e-3)
        recorder.frame(message, host_s)
    if is_clean:
        recorder.close()
    else:
        recorder.flush()


@pytest.fixture(scope="module")
def both(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    folder = tmp_path_factory.mktemp("mcap")
    for name in ("a.optorec", "a.mcap"):
        record(folder / name)
    return folder / "a.optorec", folder / "a.mcap"


def assert_equal(one: Any, other: Any) -> None:
    for name in ("counts", "connection", "sequence", "device_s", "host_s", "press_mm"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name), err_msg=name)
    assert (one.config, one.lost, one.ended_cleanly) == (other.config, other.lost, other.ended_cleanly)


def test_an_mcap_file_has_every_bit_of_a_raw_recording(both: tuple[Path, Path]) -> None:
    raw, mcap = (read_recorded(file) for file in both)
    assert_equal(raw, mcap)
    assert (raw.lost, len(raw.sequence)) == (2, 400)
    assert_equal(raw, optopad.read_recording(both[1]))


def test_a_bag_s_folder_is_read_like_its_file(both: tuple[Path, Path]) -> None:
    folder = both[1].parent / "bag"
    folder.mkdir()
    (folder / "bag_0.mcap").write_bytes(both[1].read_bytes())
    assert_equal(read_recorded(both[1]), read_recorded(folder))


@pytest.mark.parametrize("version", ["ROS2_HUMBLE", "ROS2_JAZZY"])
def test_rosbags_reads_the_same_frames_with_the_types_of_ros(both: tuple[Path, Path], version: str) -> None:
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores[version])
    for name in names():
        text = definition(name).partition("=" * 80)[0]
        store.register(get_types_from_msg(text, name))
    raw = read_recorded(both[0])
    with AnyReader([both[1]], default_typestore=store) as reader:
        (frames,) = [one for one in reader.connections if one.topic == "/optopad/frame"]
        found = [
            (at, reader.deserialize(data, one.msgtype))
            for one, at, data in reader.messages(connections=[frames])
        ]
    np.testing.assert_array_equal([one.counts.reshape(9, 8) for _, one in found], raw.counts)
    assert [seconds(at) for at, _ in found] == raw.host_s.tolist()
    assert [one.sequence for _, one in found] == raw.sequence.tolist()
    for one in (found[0][1], found[-1][1]):
        back = store.deserialize_cdr(
            store.serialize_cdr(one, "optopad_msgs/msg/Frame"), "optopad_msgs/msg/Frame"
        )
        assert back.header.frame_id == "optopad"
        assert back.counts.tolist() == one.counts.tolist()


def test_messages_of_ros_are_those_of_humble_and_jazzy() -> None:
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    for name, text in COMMON.items():
        own = get_types_from_msg(text, name.replace("/", "/msg/"))
        for version in (Stores.ROS2_HUMBLE, Stores.ROS2_JAZZY):
            for kind, (_, fields) in own.items():
                assert get_typestore(version).fielddefs[kind][1] == fields, name


def test_a_file_without_its_end_keeps_its_frames(tmp_path: Path, both: tuple[Path, Path]) -> None:
    content = both[1].read_bytes()
    raw = read_recorded(both[0])
    for share in (0.6, 0.9):
        (tmp_path / "cut.mcap").write_bytes(content[: int(share * len(content))])
        found = read_recorded(tmp_path / "cut.mcap")
        count = len(found.sequence)
        assert 50 < count < 400
        assert not found.ended_cleanly
        np.testing.assert_array_equal(found.counts, raw.counts[:count])


def test_every_frame_is_readable_after_a_flush_at_any_rate(tmp_path: Path) -> None:
    record(tmp_path / "a.mcap", is_clean=False)
    found = read_recorded(tmp_path / "a.mcap")
    assert len(found.sequence) == len(FRAMES)
    assert not found.ended_cleanly
    assert f"{found.lost}" in found.losses
    recorder = Recorder(tmp_path / "slow.mcap", CONFIG)
    for k, message in enumerate(FRAMES[:4]):
        recorder.frame(message, BEGUN_S + 0.2 * k)
        recorder.flush()
        assert len(read_recorded(tmp_path / "slow.mcap").sequence) == k + 1
    recorder.close()
    assert read_recorded(tmp_path / "slow.mcap").ended_cleanly


@pytest.mark.parametrize("receivers", [8, 7])
def test_messages_are_those_of_another_encoder(receivers: int) -> None:
    from mcap_ros2._dynamic import serialize_dynamic

    counts = COUNTS[:3, :, :receivers].astype(np.uint16)
    frames = [
        Frame(
            connection=2,
            sequence=2**33 + k,
            device_us=5000 * k,
            host_s=BEGUN_S + k,
            lost_before=k,
            counts=counts[k],
            signals=counts[k].astype(np.int32),
            saturated=counts[k] > 1022,
            began_s=BEGUN_S + k - 1.0,
        )
        for k in range(3)
    ]
    press, sensor = (
        mcap_file._press_message((1.5, 2.0, -3.25), BEGUN_S),
        mcap_file.sensor_message(CONFIG, BEGUN_S),
    )
    for name, messages, made in (
        (
            "Frame",
            [mcap_file.frame_message(one) for one in frames],
            mcap_file._frames_cdr(mcap_file._frames_of(frames)),
        ),
        ("Press", [press], [mcap_file._press_cdr(press)]),
        ("Sensor", [sensor], [mcap_file._sensor_cdr(sensor)]),
    ):
        kind = f"optopad_msgs/msg/{name}"
        encode = serialize_dynamic(kind, definition(kind))[kind]
        assert list(made) == [bytes(encode(message)) for message in messages], name


def test_the_index_of_a_closed_file_has_every_message(both: tuple[Path, Path]) -> None:
    from mcap.reader import make_reader

    with both[1].open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    assert summary.statistics is not None
    counts = {summary.channels[k].topic: n for k, n in summary.statistics.channel_message_counts.items()}
    assert counts == {"/optopad/sensor": 1, "/optopad/frame": 400, "/optopad/press": 3}
    assert sum(index.chunk_length for index in summary.chunk_indexes) > 0.5 * both[1].stat().st_size


def test_times_survive_as_nanoseconds() -> None:
    for time_s in BEGUN_S + np.random.default_rng(1).uniform(0.0, 1e6, 1000):
        assert seconds(nanoseconds(float(time_s))) == time_s


def test_a_sensor_records_both_files_at_once(tmp_path: Path) -> None:
    with (
        FakePort(board()) as port,
        optopad.Sensor(CONFIG, port.name, rate_hz=200.0) as sensor,
        sensor.record(tmp_path / "a.optorec"),
        sensor.record(tmp_path / "a.mcap"),
    ):
        frames = list(sensor.frames(count=100))
    raw, mcap = (read_recorded(tmp_path / f"a{suffix}") for suffix in (".optorec", ".mcap"))
    common = np.intersect1d(raw.sequence, mcap.sequence)  # each file begins and ends at a time of its own
    read = [frame.sequence for frame in frames if frame.sequence >= common[0]]
    assert len(read) > 50
    assert set(read) <= set(common)
    assert_equal(*(one.only(np.isin(one.sequence, common)) for one in (raw, mcap)))
    lag = np.array([frame.host_s - frame.began_s for frame in frames])
    assert (lag >= CONFIG.timing.frame_ms / 1e3 - 1e-6).all()
    assert np.isfinite([frame.began_error_s for frame in frames]).all()
    with pytest.raises(OutputError, match="exists already"):
        Recorder(tmp_path / "a.mcap", CONFIG)


def bag_of(file: Path, topics: dict[str, tuple[str, dict[str, Any]]]) -> Path:
    with file.open("wb") as stream, Writer(stream) as writer:
        for topic, (name, message) in topics.items():
            text = definition(name) if name in names() else "string data\n"
            writer.write_message(topic, writer.register_msgdef(name, text), message, 1, 1)
    return file


def test_other_files_are_refused_with_a_way_out(tmp_path: Path, both: tuple[Path, Path]) -> None:
    other = bag_of(tmp_path / "b.mcap", {"/chatter": ("std_msgs/msg/String", {"data": "hello"})})
    with pytest.raises(
        InputError, match=r"has no optopad_msgs/msg/Frame; it has /chatter \(std_msgs/msg/String\)"
    ):
        read_recorded(other)
    (tmp_path / "c.mcap").write_bytes(b"no mcap file at all, but some text of more than a few bytes")
    with pytest.raises(InputError, match="is not an MCAP file, or damaged"):
        read_recorded(tmp_path / "c.mcap")
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError, match="ros2 bag convert"):
        read_recorded(tmp_path / "empty")
    with pytest.raises(InputError, match="no such file"):
        read_recorded(tmp_path / "missing.mcap")
    with pytest.raises(InputError, match=r"has no optopad_msgs/msg/Frame on /left/frame"):
        read_mcap(both[1], "/left/frame")
    with pytest.raises(InputError, match="--topic"):
        read_recorded(both[0], topic="/optopad/frame")


def test_two_sensors_in_one_bag_are_told_apart_by_topic(tmp_path: Path) -> None:
    from optopad.fabrication.driver.link.frames import FrameDecoder

    (frame,) = FrameDecoder(frame_format(CONFIG)).decoded(FRAMES[:1], BEGUN_S)
    sensor = mcap_file.sensor_message(CONFIG, BEGUN_S)
    message = mcap_file.frame_message(frame)
    topics = {
        f"/{side}/{topic}": (f"optopad_msgs/msg/{name}", content)
        for side in ("left", "right")
        for topic, name, content in (("sensor", "Sensor", sensor), ("frame", "Frame", message))
    }
    file = bag_of(tmp_path / "two.mcap", topics)
    with pytest.raises(InputError, match="--topic"):
        read_recorded(file)
    assert len(read_recorded(file, topic="/right/frame").sequence) == 1


def test_without_the_package_mcap_is_refused_before_a_port_is_opened(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "mcap.writer", None)
    with pytest.raises(OutputError, match="pip install mcap mcap-ros2-support"):
        Recorder(tmp_path / "a.mcap", CONFIG)
    assert not list(tmp_path.iterdir())


def test_an_export_and_a_comparison_take_recordings_as_they_are(
    tmp_path: Path, both: tuple[Path, Path], capsys: pytest.CaptureFixture[str]
) -> None:
    again = tmp_path / "again.mcap"
    assert main(["driver", "export", str(both[0]), "--out", str(again), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["frames"] == 400
    assert_equal(read_recorded(both[0]), read_recorded(again))
    with as_netcdf(both[1]) as netcdf, as_netcdf(both[0]) as other:
        one, two = read_recording(netcdf), read_recording(other)
        assert one.counts.keys() == two.counts.keys()
        np.testing.assert_array_equal(one.depth_mm, two.depth_mm)
    with pytest.raises(InputError, match=r"a\.mcap: needs"), as_netcdf(both[1]) as netcdf:
        raise InputError(f"{netcdf}: needs something")
    assert (
        main(["driver", "export", str(both[1]), "--topic", "/left/frame", "--out", str(tmp_path / "x.nc")])
        == 2
    )
    assert "on /left/frame; it has /optopad/sensor" in capsys.readouterr().err
    assert not (tmp_path / "x.nc").exists()
