"""Recordings as LeRobot data sets, and frames as observations of a robot's steps."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import optopad
from design.errors import InputError, OutputError
from fabrication.driver.recording.export import read_recorded
from fabrication.driver.recording.lerobot import (
    PRESS,
    SIGNALS,
    gathered,
    rows_of_step,
    write_lerobot,
)
from fabrication.driver.simulated.port import FakePort
from optopad.cli import main
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
    from fabrication.driver.recording.recorder import Recorder
    from tests.fabrication.driver.test_mcap_file import BEGUN_S, CONFIG, FRAMES

    with Recorder(tmp_path / "a.optorec", CONFIG) as recorder:
        for k, message in enumerate(FRAMES):
            if k == 200:
                recorder.press(16.0, 8.0, 1.5, BEGUN_S + 0.005 * k)
            recorder.frame(message, BEGUN_S + 0.005 * k)
    write_lerobot(read_recorded(tmp_path / "a.optorec"), tmp_path / "set")
    press = np.stack(pd.read_parquet(tmp_path / "set" / "data" / PART)[PRESS])
    assert press[[0, -1]].tolist() == [[16.0, 8.0, 0.0], [16.0, 8.0, 1.5]]


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
    ):
        assert main([*export, *options]) == 2
        assert said in capsys.readouterr().err
    recorded = read_recorded(recording)
    with pytest.raises(InputError, match=r"less than one step of 0\.0333 s; raise --fps"):
        write_lerobot(recorded.only(recorded.host_s < recorded.host_s[0] + 0.03), tmp_path / "a")
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(OutputError, match="pip install pandas pyarrow"):
        write_lerobot(recorded, tmp_path / "a")
    assert [one.name for one in tmp_path.iterdir()] == ["old"]
