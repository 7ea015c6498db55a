"""Recordings as LeRobot data sets, and frames as observations of a robot's steps."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import optopad
from optopad.cli import main
from optopad.design.errors import InputError, OutputError
from optopad.fabrication.driver.recording.export import read_recorded
from optopad.fabrication.driver.recording.lerobot import (
    PRESS,
    SIGNALS,
    Source,
    gathered,
    rows_of_step,
    write_episodes,
    write_lerobot,
)
from optopad.fabrication.driver.recording.recorded import PressLabels
from optopad.fabrication.driver.simulated.port import FakePort
from tests.fabrication.driver.made_up_pad import board, pad_config
from tests.fabrication.driver.made_up_recording import RATE_HZ, tip_path, write_recording

PART = "chunk-000/file-000.parquet"
OF_EVERY_STEP = ("timestamp", "frame_index", "episode_index", "index", "task_index")


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("lerobot") / "a.optorec"
    write_recording(file, tip_path(presses=2))
    return file


def test_a_data_set_has_the_files_of_the_format_and_fits_its_own_description(
    recording: Path, tmp_path: Path
) -> None:
    folder = tmp_path / "set"
    assert (
        main(["driver", "export", str(recording), "--lerobot", str(folder), "--fps", "15", "--task", "press"])
        == 0
    )
    there = {one.relative_to(folder).as_posix() for one in folder.rglob("*") if one.is_file()}
    assert there == {
        *("meta/info.json", "meta/stats.json", "meta/tasks.parquet"),
        *(f"meta/episodes/{PART}", f"data/{PART}"),
    }
    info, stats = (json.loads((folder / "meta" / f"{name}.json").read_text()) for name in ("info", "stats"))
    data = pd.read_parquet(folder / "data" / PART)
    assert (info["codebase_version"], info["fps"], info["splits"]) == ("v3.0", 15, {"train": "0:1"})
    assert info["total_frames"] == len(data)
    assert set(info["features"]) == set(data.columns) == set(stats) == {SIGNALS, *OF_EVERY_STEP}
    for name, feature in info["features"].items():
        first = np.asarray(data[name][0])
        assert list(np.shape(first)) or feature["shape"] == [1]
        assert {"dtype", "shape", "names"} <= set(feature)
        assert len(stats[name]["mean"]) == len(stats[name]["q99"]) == feature["shape"][0]
        assert stats[name]["count"] == [len(data)]
    assert info["features"][SIGNALS]["names"][:2] == ["E1-R1", "E1-R2"]
    np.testing.assert_allclose(data["timestamp"], np.arange(len(data)) / 15, atol=1e-4)
    (episode,) = pd.read_parquet(folder / "meta" / "episodes" / PART).to_dict("records")
    assert (episode["length"], episode["dataset_to_index"], list(episode["tasks"])) == (
        len(data),
        len(data),
        ["press"],
    )
    assert list(pd.read_parquet(folder / "meta" / "tasks.parquet").index) == ["press"]


def test_steps_have_the_mean_the_last_or_all_of_their_frames(recording: Path, tmp_path: Path) -> None:
    recorded = read_recorded(recording)
    signals, time_s = (
        recorded.signals.reshape(len(recorded.sequence), -1),
        recorded.host_s - recorded.host_s[0],
    )
    found: dict[str, Any] = {}
    for take in ("mean", "last", "all"):
        write_lerobot(recorded, tmp_path / take, fps=10, take=take)
        found[take] = pd.read_parquet(tmp_path / take / "data" / PART)[SIGNALS]
    inside = (time_s > 0.5) & (time_s <= 0.6)
    assert inside.sum() == RATE_HZ / 10
    np.testing.assert_allclose(found["mean"][5], signals[inside].mean(axis=0), rtol=1e-6)
    np.testing.assert_array_equal(found["last"][5], signals[inside][-1].astype(np.float32))
    np.testing.assert_array_equal(np.stack(found["all"][5]), signals[inside].astype(np.float32))
    shape = json.loads((tmp_path / "all" / "meta" / "info.json").read_text())["features"][SIGNALS]["shape"]
    assert shape == [6, 64]


def test_known_presses_are_an_observation(tmp_path: Path) -> None:
    from optopad.fabrication.driver.recording.recorder import Recorder
    from tests.fabrication.driver.test_mcap_file import BEGUN_S, CONFIG, FRAMES

    with Recorder(tmp_path / "a.optorec", CONFIG) as recorder:
        for k, message in enumerate(FRAMES):
            if k == 200:
                recorder.press(16.0, 8.0, 1.5, BEGUN_S + 0.005 * k)
            recorder.frame(message, BEGUN_S + 0.005 * k)
    write_lerobot(read_recorded(tmp_path / "a.optorec"), tmp_path / "set")
    press = np.stack(pd.read_parquet(tmp_path / "set" / "data" / PART)[PRESS])
    assert press[[0, -1]].tolist() == [[16.0, 8.0, 0.0], [16.0, 8.0, 1.5]]


def data_of(folder: Path) -> pd.DataFrame:
    return pd.concat([pd.read_parquet(one) for one in sorted((folder / "data").glob("*/*.parquet"))])


def info_of(folder: Path) -> dict[str, Any]:
    return dict(json.loads((folder / "meta" / "info.json").read_text()))


def content_of(folder: Path) -> dict[str, bytes]:
    return {str(one.relative_to(folder)): one.read_bytes() for one in folder.rglob("*") if one.is_file()}


def test_several_recordings_are_episodes_and_more_can_be_appended(
    recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_recording(tmp_path / "b.optorec", tip_path(seed=2, presses=1), seed=2)
    folder, files = tmp_path / "set", [str(recording), str(tmp_path / "b.optorec")]
    export = ["driver", "export", "--lerobot", str(folder), "--json"]
    assert main([*export, *files, "--task", "one", "--task", "two"]) == 0
    assert json.loads(capsys.readouterr().out)["lerobot"]["episodes"] == 2
    before = content_of(folder)
    assert main([*export, files[0], "--append", "--task", "two"]) == 0
    said = json.loads(capsys.readouterr().out)["lerobot"]
    assert (said["episodes"], said["total_episodes"], said["repeated"]) == (1, 3, 0)
    kept = [name for name in before if name.endswith("file-000.parquet")]
    assert len(kept) == 2
    assert [content_of(folder)[name] for name in kept] == [before[name] for name in kept]

    data, info = data_of(folder), info_of(folder)
    single = [
        write_lerobot(read_recorded(Path(file)), tmp_path / f"{k}").steps for k, file in enumerate(files)
    ]
    lengths = [single[0], single[1], single[0]]
    assert data["index"].tolist() == list(range(sum(lengths)))
    assert data["episode_index"].tolist() == np.repeat([0, 1, 2], lengths).tolist()
    assert data["task_index"].tolist() == np.repeat([0, 1, 1], lengths).tolist()
    assert data["frame_index"].tolist() == [k for length in lengths for k in range(length)]
    assert (info["total_episodes"], info["total_frames"], info["total_tasks"]) == (3, sum(lengths), 2)
    assert info["splits"] == {"train": "0:3"}
    signals = np.stack(list(data[SIGNALS]))
    alone = np.stack(list(data_of(tmp_path / "0")[SIGNALS]))
    np.testing.assert_array_equal(signals[: single[0]], alone)
    np.testing.assert_array_equal(signals[-single[0] :], alone)

    stats = json.loads((folder / "meta" / "stats.json").read_text())[SIGNALS]
    assert stats["count"] == [sum(lengths)]
    for name in ("mean", "std", "min", "max"):
        np.testing.assert_allclose(stats[name], getattr(signals.astype(float), name)(axis=0), rtol=1e-9)
    parts = np.split(signals.astype(float), np.cumsum(lengths)[:-1])
    medians = [np.median(part, axis=0) for part in parts]
    np.testing.assert_allclose(stats["q50"], np.average(medians, axis=0, weights=lengths), rtol=1e-9)
    episodes = pd.concat(
        [pd.read_parquet(one) for one in sorted((folder / "meta" / "episodes").glob("*/*.parquet"))]
    )
    assert episodes["data/file_index"].tolist() == episodes["meta/episodes/file_index"].tolist() == [0, 0, 1]
    assert episodes["dataset_to_index"].tolist() == np.cumsum(lengths).tolist()
    assert [list(one) for one in episodes["tasks"]] == [["one"], ["two"], ["two"]]


def test_known_presses_of_two_fingers_have_columns_of_their_own(recording: Path, tmp_path: Path) -> None:
    recorded, folder = read_recorded(recording), tmp_path / "set"
    count = len(recorded.sequence)
    one = PressLabels(press_mm=np.tile([10.0, 16.0, 1.0], (count, 1)))
    two = replace(one, others_mm=np.tile([22.0, 16.0, -1.0], (count, 1, 1)))
    two.others_mm[: count // 3] = np.nan  # as in a stage's log where the second tip is away
    write_lerobot(replace(recorded, labels=two), folder, fps=20)
    info, stats = (json.loads((folder / "meta" / f"{name}.json").read_text()) for name in ("info", "stats"))
    assert info["features"][PRESS]["shape"] == [6]
    assert info["features"][PRESS]["names"][2:4] == ["depth_mm", "x2_mm"]
    assert stats[PRESS]["min"] == [10.0, 16.0, 1.0, 0.0, 0.0, -1.0]
    assert stats[PRESS]["max"] == [10.0, 16.0, 1.0, 22.0, 16.0, 0.0]
    assert np.isfinite(stats[PRESS]["mean"]).all()
    with pytest.raises(InputError, match="known presses of 1 at a time, and the episodes before of 2"):
        write_episodes(
            [Source(recorded=replace(recorded, labels=each)) for each in (two, one)],
            tmp_path / "other",
            fps=20,
        )


def test_what_does_not_fit_is_not_appended_and_the_data_set_stays(recording: Path, tmp_path: Path) -> None:
    recorded, folder = read_recorded(recording), tmp_path / "set"
    write_lerobot(recorded, folder, fps=20)
    before = content_of(folder)
    pressed = PressLabels(press_mm=np.zeros((len(recorded.sequence), 3)))
    others: list[tuple[Any, dict[str, Any], str]] = [
        (recorded, {"fps": 25}, r"--fps: 25 is refused: .* 20 steps per second"),
        (recorded, {"fps": 20, "take": "last"}, "last frame of the step"),
        (recorded, {"fps": 20, "take": "all"}, r"\[3, 64\]"),
        (replace(recorded, config=replace(recorded.config, digest="f" * 64)), {"fps": 20}, "ffffffff"),
        (replace(recorded, labels=pressed), {"fps": 20}, "has known presses"),
        (recorded.only(recorded.device_s < 0.04), {"fps": 20}, r"less than one step of 0\.05 s"),
    ]
    for other, options, said in others:
        sources = [Source(recorded=recorded), Source(recorded=other)]
        with pytest.raises(InputError, match=said):
            write_episodes(sources, folder, is_appended=True, **options)

    def interrupted() -> Iterator[Source]:
        yield Source(recorded=recorded)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_episodes(interrupted(), folder, fps=20, is_appended=True)
    assert content_of(folder) == before
    assert [one.name for one in tmp_path.iterdir()] == ["set"]
    folder.rename(tmp_path / ".set.before")  # as after a kill between two renames
    assert write_episodes([Source(recorded=recorded)], folder, fps=20, is_appended=True).total_episodes == 2
    assert [one.name for one in tmp_path.iterdir()] == ["set"]
    (folder / "meta" / "stats.json").write_text("{")
    with pytest.raises(InputError, match="or damaged"):
        write_episodes([Source(recorded=recorded)], folder, fps=20, is_appended=True)


def test_a_gap_begins_an_episode_and_is_never_filled_with_copies(recording: Path, tmp_path: Path) -> None:
    recorded = read_recorded(recording)
    number = np.arange(len(recorded.sequence))
    cut = recorded.only((number < 120) | (number >= 241))
    later = np.where(number < 300, 0.0, 100.0)
    restarted = replace(
        recorded,
        connection=1 + (number >= 300).astype(np.int64),
        device_s=recorded.device_s - recorded.device_s[300] * (number >= 300),
        host_s=recorded.host_s + later,
    )
    for name, one, first, left_out_s in (
        ("gap", cut, 241, 122 / RATE_HZ),
        ("restart", restarted, 300, 100.0),
        ("merged", replace(restarted, host_s=recorded.host_s - later), 300, 0.0),
    ):
        made = write_lerobot(one, tmp_path / name, take="last")
        data = data_of(tmp_path / name)
        assert (made.episodes, made.repeated) == (2, 0)
        assert made.left_out_s == pytest.approx(left_out_s, abs=2 / 30)
        assert not (np.diff(np.stack(list(data[SIGNALS])), axis=0) == 0).all(axis=1).any()
        begun = data[data["episode_index"] == 1]
        assert begun["timestamp"].iloc[0] == 0.0
        inside = recorded.device_s[first:] <= recorded.device_s[first] + 1 / 30 + 1e-6
        last = recorded.signals[first:][inside][-1].ravel()
        np.testing.assert_array_equal(begun[SIGNALS].iloc[0], last.astype(np.float32))


def test_a_host_s_clock_that_is_set_back_changes_no_step(recording: Path, tmp_path: Path) -> None:
    recorded = read_recorded(recording)
    back = recorded.host_s - 30.0 * (np.arange(len(recorded.sequence)) >= 300)
    for name, one in (("right", recorded), ("back", replace(recorded, host_s=back))):
        assert write_lerobot(one, tmp_path / name).episodes == 1
    assert data_of(tmp_path / "back").equals(data_of(tmp_path / "right"))


def test_steps_that_repeat_a_frame_are_counted(recording: Path, tmp_path: Path) -> None:
    recorded = read_recorded(recording)
    made = write_lerobot(recorded, tmp_path / "fast", fps=100)
    assert (made.episodes, made.repeated) == (1, made.steps - (len(recorded.sequence) - 1))
    one_step = recorded.only(~np.isin(np.arange(len(recorded.sequence)), (121, 122)))
    made = write_lerobot(one_step, tmp_path / "lost", fps=30)
    assert (made.episodes, made.repeated) == (1, 1)


def test_steps_per_second_need_not_be_whole(recording: Path, tmp_path: Path) -> None:
    recorded = read_recorded(recording)
    write_lerobot(recorded, tmp_path / "ntsc", fps=29.97)
    write_lerobot(recorded, tmp_path / "whole", fps=30.0)
    assert info_of(tmp_path / "ntsc")["fps"] == 29.97
    assert str(info_of(tmp_path / "whole")["fps"]) == "30"
    data = data_of(tmp_path / "ntsc")
    np.testing.assert_allclose(data["timestamp"], np.arange(len(data)) / 29.97, atol=1e-4)
    assert len(data) == int(recorded.device_s[-1] * 29.97)
    with pytest.raises(InputError, match="--fps: nan is refused"):
        write_lerobot(recorded, tmp_path / "x", fps=float("nan"))


def test_a_step_without_frames_repeats_the_one_before() -> None:
    assert rows_of_step(200.0, 30) == 7
    assert rows_of_step(60.0, 30) == 2
    assert rows_of_step(5.0, 30) == 1
    signals = np.arange(6.0).reshape(3, 2)
    assert gathered(signals, "all", 4).tolist() == [[0, 1], [0, 1], [2, 3], [4, 5]]
    assert gathered(signals, "all", 2).tolist() == [[2, 3], [4, 5]]


def test_a_live_sensor_gives_an_observation_a_step() -> None:
    with FakePort(board()) as port, optopad.Sensor(pad_config(), port.name, rate_hz=100.0) as sensor:
        observations = optopad.Observations(sensor, 30, "all")
        frames = iter(sensor)
        steps = []
        for _ in range(3):
            next(frames)
            steps.append(observations.step()[SIGNALS])
        at_once = observations.step()[SIGNALS], observations.step()[SIGNALS]
        assert {step.shape for step in (*steps, *at_once)} == {(2, 64)}
        assert observations.features[SIGNALS]["shape"] == [2, 64]
        np.testing.assert_array_equal(at_once[1][-1], at_once[1][0])
        with pytest.raises(InputError, match="--fps: 0 is refused"):
            optopad.Observations(sensor, 0)


def test_bad_input_is_refused_and_leaves_nothing(
    recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "old").mkdir()
    export = ["driver", "export", str(recording)]
    for options, said in (
        (["--lerobot", str(tmp_path / "old")], "exists already; choose another folder"),
        (
            ["--lerobot", str(tmp_path / "a"), "--take", "most"],
            "--take: 'most' is refused: give mean, last, all",
        ),
        (["--lerobot", str(tmp_path / "a"), "--fps", "0"], "--fps: 0 is refused"),
        (["--lerobot", str(tmp_path / "a"), "--out", "b.nc"], "two results; give one"),
        (["--append"], "give --lerobot, too"),
        (["b.optorec"], "b.optorec: a second recording"),
        ([str(recording), "--lerobot", str(tmp_path / "a")], "is given twice"),
        (["b.optorec", "--lerobot", str(tmp_path / "a"), "--stage", "a.csv"], "export each with --append"),
        (["--lerobot", str(tmp_path / "a"), "--task", "a", "--task", "b"], "--task: 2 for 1 recordings"),
        (["--lerobot", str(tmp_path / "old"), "--append"], "is no data set of `driver export --lerobot`"),
    ):
        assert main([*export, *options]) == 2
        assert said in capsys.readouterr().err
    recorded = read_recorded(recording)
    with pytest.raises(InputError, match=r"0\.0333 s.*raise --fps"):
        write_lerobot(recorded.only(recorded.host_s < recorded.host_s[0] + 0.03), tmp_path / "a")
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(OutputError, match="pip install pandas pyarrow"):
        write_lerobot(recorded, tmp_path / "a")
    assert [one.name for one in tmp_path.iterdir()] == ["old"]
