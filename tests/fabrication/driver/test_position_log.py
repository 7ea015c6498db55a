"""A stage's log joined to a recording: in step, found in step, or refused."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from optopad.cli import main
from optopad.design.errors import InputError
from optopad.fabrication.driver import Sensor
from optopad.fabrication.driver.recording.export import read_recorded, write_export
from optopad.fabrication.driver.recording.joined_log import joined
from optopad.fabrication.driver.recording.position_log import read_position_log
from optopad.fabrication.driver.simulated.finger import demo_path
from optopad.fabrication.driver.simulated.port import FakePort
from optopad.sims.readings.dataset import read_data
from tests.fabrication.driver.made_up_pad import board, pad_config
from tests.fabrication.driver.made_up_recording import (
    BEGUN_S,
    RATE_HZ,
    positions,
    tip_path,
    write_log,
    write_recording,
)
from tests.said import pattern

PATH = tip_path()
TWO = "time_s,x_mm,y_mm,depth_mm,x2_mm,y2_mm,depth2_mm"


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("recorded") / "a.optorec"
    write_recording(file, PATH)
    return file


def text_log(folder: Path, *rows: str, heading: str = "time_s,x_mm,y_mm,depth_mm") -> Path:
    file = folder / "log.csv"
    file.write_text("\n".join([heading, *rows]) + "\n")
    return file


def test_every_frame_gets_the_position_at_its_time(recording: Path, tmp_path: Path) -> None:
    truth = write_recording(tmp_path / "again.optorec", PATH)
    write_log(tmp_path / "log.csv", PATH)
    found = joined(read_recorded(recording), read_position_log(tmp_path / "log.csv"))
    assert found.left_out == 0
    assert found.recorded.press_mm is not None
    # The log has a row each 0.05 s: linear between them, wrong only where the tip turns, by 0.05 s x 11 mm/s / 4.
    assert np.abs(found.recorded.press_mm - truth).max() < 0.15
    assert np.median(np.abs(found.recorded.press_mm - truth)) < 1e-3


@pytest.mark.parametrize("pause_s", [0.3, 1.0])
def test_frames_that_waited_for_a_reader_that_paused_get_the_position_of_their_own_time(
    pause_s: float, tmp_path: Path
) -> None:
    """All of them are read at its end, when the tip is up to 5 mm further."""
    down_s = float(PATH[2, 0])
    truth = write_recording(tmp_path / "a.optorec", PATH, pause_s=(down_s, down_s + pause_s))
    write_log(tmp_path / "log.csv", PATH)
    found = joined(read_recorded(tmp_path / "a.optorec"), read_position_log(tmp_path / "log.csv"))
    assert found.recorded.press_mm is not None
    assert (
        np.abs(found.recorded.press_mm - truth).max() < 0.5
    )  # 0.05 s that are taken as they are, at 11 mm/s


@pytest.mark.parametrize("late_s", [-41.37, 0.8, 3600.0])
def test_an_offset_is_found_from_the_touches(late_s: float, recording: Path, tmp_path: Path) -> None:
    write_log(tmp_path / "log.csv", PATH, late_s=late_s)
    found = joined(read_recorded(recording), read_position_log(tmp_path / "log.csv"), "auto")
    # Frames are 17 ms apart, each edge is known to half of that; the mean of 12 edges to a quarter.
    assert found.offset_s == pytest.approx(-late_s, abs=0.017)
    assert found.match.share == 1.0
    assert found.match.edges == 12


@pytest.mark.parametrize("pattern", [np.ones(()), np.random.default_rng(1).choice([-1, 1], (8, 8))])
def test_an_offset_is_found_in_spite_of_drift(pattern: np.ndarray, tmp_path: Path) -> None:
    write_recording(tmp_path / "a.optorec", PATH, gain_per_s=0.05 / PATH[-1, 0] * pattern)
    write_log(tmp_path / "log.csv", PATH, late_s=7.0)
    found = joined(read_recorded(tmp_path / "a.optorec"), read_position_log(tmp_path / "log.csv"), "auto")
    assert found.offset_s == pytest.approx(-7.0, abs=0.017)


def test_an_offset_that_is_given_is_taken_and_the_edges_tell_how_good_it_is(
    recording: Path, tmp_path: Path
) -> None:
    write_log(tmp_path / "log.csv", PATH, late_s=2.0)
    found = joined(read_recorded(recording), read_position_log(tmp_path / "log.csv"), -1.6)
    assert found.offset_s == -1.6
    assert found.match.offset_s - found.offset_s == pytest.approx(-0.4, abs=0.02)


def test_a_log_that_is_out_of_step_is_refused_with_the_way_out(recording: Path, tmp_path: Path) -> None:
    write_log(tmp_path / "log.csv", PATH, late_s=0.6)
    log = read_position_log(tmp_path / "log.csv")
    with pytest.raises(InputError, match=r"-0\.60 s"):
        joined(read_recorded(recording), log)
    write_log(tmp_path / "log.csv", tip_path(seed=9))
    with pytest.raises(InputError, match="these match; find"):
        joined(read_recorded(recording), read_position_log(tmp_path / "log.csv"))


def test_another_recording_s_log_gives_no_offset(recording: Path, tmp_path: Path) -> None:
    write_log(tmp_path / "log.csv", tip_path(seed=9))
    with pytest.raises(InputError, match=r"offset not found: .* match at no shift"):
        joined(read_recorded(recording), read_position_log(tmp_path / "log.csv"), "auto")


def test_a_stage_that_repeats_one_rhythm_gives_no_offset_that_could_be_trusted(tmp_path: Path) -> None:
    steady = tip_path(presses=12, rhythm_s=4.0)
    write_recording(tmp_path / "a.optorec", steady)
    write_log(tmp_path / "log.csv", steady, late_s=5.0)
    with pytest.raises(InputError, match="ambiguous: the touches"):
        joined(read_recorded(tmp_path / "a.optorec"), read_position_log(tmp_path / "log.csv"), "auto")


def test_an_untouched_recording_has_nothing_to_find_an_offset_by(tmp_path: Path) -> None:
    still = np.array([[0.0, 16.0, 16.0, -5.0], [5.0, 16.0, 16.0, -5.0]])
    write_recording(tmp_path / "a.optorec", still)
    write_log(tmp_path / "log.csv", PATH)
    with pytest.raises(InputError, match="the signals show 0 touches, needs 2"):
        joined(read_recorded(tmp_path / "a.optorec"), read_position_log(tmp_path / "log.csv"), "auto")


def test_a_log_of_another_day_is_refused(recording: Path, tmp_path: Path) -> None:
    write_log(tmp_path / "log.csv", PATH, late_s=86400.0)
    with pytest.raises(InputError, match=r"no time in common .* the log from 86400\.0 to"):
        joined(read_recorded(recording), read_position_log(tmp_path / "log.csv"))


def test_a_recording_whose_clock_was_set_back_is_refused(recording: Path, tmp_path: Path) -> None:
    write_log(tmp_path / "log.csv", PATH)
    recorded = read_recorded(recording)
    host_s = recorded.host_s - 2.0 * (np.arange(len(recorded.host_s)) >= 500)
    with pytest.raises(InputError, match=r"1\.98 s.*frame 500"):
        joined(replace(recorded, host_s=host_s), read_position_log(tmp_path / "log.csv"), "auto")


def test_frames_whose_position_nobody_knows_are_left_out_and_counted(recording: Path, tmp_path: Path) -> None:
    # 2 s in which the tip moves from one place to another, and a log that ends early.
    begun = BEGUN_S
    rows = [f"{begun},16,16,-5", f"{begun + 1},16,16,-5", f"{begun + 3},20,16,-5", f"{begun + 4},20,16,-5"]
    found = joined(read_recorded(recording), read_position_log(text_log(tmp_path, *rows)), 0.0)
    kept_s = found.recorded.host_s - begun
    assert ((kept_s <= 1.0) | ((kept_s >= 3.0) & (kept_s <= 4.0))).all()
    assert len(kept_s) + found.left_out == len(read_recorded(recording).host_s)


@pytest.mark.slow
def test_sets_and_places_come_from_the_log_and_travel_belongs_to_none(
    recording: Path, tmp_path: Path
) -> None:
    heading = "time_s,x_mm,y_mm,depth_mm,set,place,role,pattern,ambient"
    rows = [
        f"{BEGUN_S},16,16,-5,grid-dark-1,0,train,grid,no",
        f"{BEGUN_S + 1},16,16,-5,,,,,",
        f"{BEGUN_S + 2},16,16,-5,random,4,test,random,yes",
        f"{BEGUN_S + 3},16,16,-5,random,4,test,random,yes",
    ]
    out = tmp_path / "a.nc"
    command = ["driver", "export", str(recording), "--stage", str(text_log(tmp_path, *rows, heading=heading))]
    assert main([*command, "--offset", "0", "--out", str(out)]) == 0
    with xr.open_dataset(out, engine="h5netcdf") as dataset:
        assert set(zip(dataset["set"].values.tolist(), dataset["place"].values.tolist(), strict=True)) == {
            (0, 0),
            (1, 4),
        }
        assert json.loads(dataset.attrs["sets"]) == [
            {"name": "grid-dark-1", "role": "train", "pattern": "grid", "is_ambient": False},
            {"name": "random", "role": "test", "pattern": "random", "is_ambient": True},
        ]
        assert dataset["time_s"].values[0] == 0.0
    found = read_data(out)
    assert [one.role for one in found.sets] == ["train", "test"]
    assert set(found.place_number.tolist()) == {0, 4}
    assert found.full_scale_counts == 1023
    assert found.design_digest == pad_config().digest


def test_two_stages_are_joined_and_a_gap_of_the_second_leaves_frames_out(
    recording: Path, tmp_path: Path
) -> None:
    """The second tip stays where it is, presses while the first is lifted, and is unknown for a while."""
    steps_s = np.arange(0.0, PATH[-1, 0], 0.05)
    first = positions(PATH, steps_s)
    is_lifted, is_gone = first[:, 2] < -1.0, np.abs(steps_s - 3.5) < 0.51
    second = [
        ",,," if gone else f",24000,9000,{900 if lifted else -500}"
        for gone, lifted in zip(is_gone, is_lifted, strict=True)
    ]
    rows = [
        f"{BEGUN_S + at:.3f},{x:.4f},{y:.4f},{depth:.4f}{more}"
        for at, (x, y, depth), more in zip(steps_s, first, second, strict=True)
    ]
    log = text_log(tmp_path, *rows, heading="time_s,x_mm,y_mm,depth_mm,x2_um,y2_um,depth2_um")
    found = joined(read_recorded(recording), read_position_log(log), 0.0)
    labels, at_s = found.recorded.labels, found.recorded.host_s - BEGUN_S
    assert labels is not None
    has_second = np.isfinite(labels.others_mm[:, 0, 2])
    assert (has_second == (np.abs(at_s - 3.5) > 0.5)).all()
    assert found.left_out == pytest.approx(
        2 * 0.05 * RATE_HZ, abs=2
    )  # between rows with and without the second tip
    np.testing.assert_allclose(labels.others_mm[has_second, 0, :2], [[24.0, 9.0]] * has_second.sum())
    write_export(found.recorded, tmp_path / "a.nc", "a")
    with pytest.raises(InputError, match=pattern("a.csv ... two are known ... .nc")):
        write_export(found.recorded, tmp_path / "a.csv", "a")
    data = read_data(tmp_path / "a.nc")
    np.testing.assert_array_equal(data.others_mm, labels.others_mm)
    assert data.has_more.sum() == (labels.others_mm[:, 0, 2] > 0.0).sum() > 0


def test_times_may_be_written_as_dates_and_lengths_in_other_units(tmp_path: Path) -> None:
    file = text_log(
        tmp_path,
        "2026-05-04T14:00:00+02:00,1000,0.002,-0.5",
        "2026-05-04T12:00:01.5Z,1000,0.002,-0.5",
        heading="time,x_um,y_m,depth_mm",
    )
    found = read_position_log(file)
    assert np.diff(found.time_s) == pytest.approx([1.5])
    assert found.press_mm[0] == pytest.approx([1.0, 2.0, -0.5])


@pytest.mark.parametrize(
    ("heading", "rows", "told"),
    [
        ("time_s,x_mm,y_mm", ["0,1,1", "1,1,1"], "has no depth_mm"),
        ("x_mm,y_mm,depth_mm", ["1,1,1", "1,1,1"], "CSV table ... time_s"),
        ("time_s,x_mm,y_mm,depth_mm", ["0,1,1,1", "1,1,nan,1"], "3: y_mm is 'nan'"),
        ("time_s,x_mm,y_mm,depth_mm", ["0,1,1,1", "1,1,,1"], "row 3: y_mm is ''"),
        ("time_s,x_mm,y_mm,depth_mm", ["0,1,1,1", "1,1,1"], "row 3 has 3 values, the heading 4 columns"),
        (
            "time_s,x_mm,y_mm,depth_mm",
            ["0,1,1,1", "0.1,1,1,9.97e36"],
            "row 3 ... 9.97e",
        ),
        (
            "time_s,x_mm,y_mm,depth_mm",
            ["0,1,1,1", "0.04,-999,1,1", "0.08,1,1,1"],
            "row 3 ... -999",
        ),
        ("time_s,x_mm,y_mm,depth_mm", ["5,1,1,1", "4,1,1,1"], "3 is -1.000 s"),
        ("time_s,x_mm,y_mm,depth_mm", ["5,1,1,1", "5,1,1,1"], "row 3 ... row 2 (1 of 2"),
        ("time_s,x_mm,y_mm,depth_mm", ["0,1,1,1", "20,1,1,2", "40,1,1,3"], "are the times milliseconds"),
        ("time_s,x_mm,y_mm,depth_mm", ["5,1,1,1"], "at least 2 rows"),
        ("time_s,x_mm,x_mm,y_mm,depth_mm", ["5,1,1,1,1", "6,1,1,1,1"], "has the column 'x_mm' twice"),
        ("time,x_mm,y_mm,depth_mm", ["2026-05-04T14:00:00,1,1,1"] * 2, "needs ISO 8601 with its zone"),
        (
            "time_s,x_mm,y_mm,depth_mm,place",
            ["0,1,1,1,0", "1,1,1,1,b"],
            "row 3: 'place' is 'b', needs a whole",
        ),
        ("time_s,x_mm,y_mm,depth_mm,set,role", ["0,1,1,1,a,x", "1,1,1,1,a,x"], "'x', needs"),
        (
            "time_s,x_mm,y_mm,depth_mm,set,ambient",
            ["0,1,1,1,a,x", "1,1,1,1,a,x"],
            "ambient is 'x', needs yes",
        ),
        (
            "timestamp,x_mm,y_mm,depth_mm",
            ["1777903387.25,1,1,1"] * 2,
            "timestamp ... 1777903387.25 ... time_s",
        ),
        ("timestamp,x_mm,y_mm,depth_mm", ["1777903387250000000,1,1,1"] * 2, "time_ns"),
        ("time,x_mm,y_mm,depth_mm", ["1777903387250,1,1,1"] * 2, "time_ms"),
        (
            "time_s,x_mm,y_mm,depth_mm",
            ["1777903387250,1,1,1"] * 2,
            "later than the year 2100; are they of time_ms",
        ),
        ("time_ms,x_mm,y_mm,depth_mm", ["1777903387250000,1,1,1"] * 2, "are they of time_us"),
        (
            "time_s,x_mm,y_mm,depth_mm,place",
            ["0,1,1,1,0.5", "1,1,1,1,1"],
            "row 2: 'place' is '0.5', needs a whole",
        ),
        ("time_s,x_mm,y_mm,depth_mm,set", ["0,1,1,1,", "1,1,1,1,"], "row belongs"),
        ("time_s,x_mm,y_mm,depth_mm,set", ["0,1,1,1,a", "1,1,1,1,a"], "has a column 'set' without"),
        (
            "time_s,x_mm,y_mm,depth_mm,x2_mm,y2_mm",
            ["0,1,1,1,9,9", "1,1,1,1,9,9"],
            "x2_mm, y2_mm alone ... depth2_mm",
        ),
        (f"{TWO}", ["0,1,1,1,9,9,1", "1,1,1,1,9,,1"], "row 3: y2_mm is ''"),
        (f"{TWO}", ["0,1,1,1,9,9,1", "0.04,1,1,1,9,9,-999"], "row 3 ... -999"),
        (f"{TWO},x3_mm", ["0,1,1,1,9,9,1,5", "1,1,1,1,9,9,1,5"], "x3_mm ... one tip or of two"),
    ],
)
def test_a_log_that_cannot_be_used_is_refused_by_row_and_column(
    heading: str, rows: list[str], told: str, tmp_path: Path
) -> None:
    with pytest.raises(InputError, match=pattern(told)):
        read_position_log(text_log(tmp_path, *rows, heading=heading))


@pytest.mark.parametrize(
    ("heading", "times", "time_s"),
    [
        (
            "time_us",
            ["4294947296", "4294966296", "18000", "38000"],
            [4294.947296, 4294.966296, 4294.985296, 4295.005296],
        ),
        ("t_ms", ["4294967290", "4", "24"], [4294967.290, 4294967.300, 4294967.320]),
        ("time_ns", ["0", "20000000", "40000000"], [0.0, 0.02, 0.04]),
        ("timestamp", ["2026-05-04T14:03:07Z", "2026-05-04T14:03:08Z"], [1777903387.0, 1777903388.0]),
    ],
)
def test_clocks_of_other_programs_are_read(heading, times, time_s, tmp_path):
    rows = [f"{time},1,1,1,{place}" for time, place in zip(times, ("0.0", "1", "2.0", "3"), strict=False)]
    log = read_position_log(text_log(tmp_path, *rows, heading=f"{heading},x_mm,y_mm,depth_mm,place"))
    assert log.time_s == pytest.approx(time_s, abs=1e-6)
    assert log.place_number.tolist() == list(range(len(times)))


@pytest.mark.slow
def test_export_tells_the_offset_that_it_found(
    recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_log(tmp_path / "log.csv", PATH, late_s=12.5)
    out = tmp_path / "a.nc"
    command = ["driver", "export", str(recording), "--stage", str(tmp_path / "log.csv"), "--out", str(out)]
    assert main(command) == 2
    assert not out.exists()
    assert "--offset auto" in capsys.readouterr().err
    assert main([*command, "--offset", "auto", "--json"]) == 0
    said = json.loads(capsys.readouterr().out)["stage"]
    assert said["offset_s"] == pytest.approx(-12.5, abs=0.017)
    assert said["edges_met"] == 1.0
    # The log is ahead, so that it begins and ends 12.5 s late by its own clock only: all frames are known.
    assert said["left_out"] == 0
    assert main([*command, "--offset", "-12.5"]) == 0
    assert "100% of 12 touch edges match" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (["--offset", "3"], "--offset"),
        (["--stage", "log.csv", "--presses", "p.csv"], "two sources of positions"),
        (["--stage", "log.csv", "--offset", "soon"], "'soon'"),
    ],
)
def test_options_that_make_no_sense_together_are_refused(
    options: list[str], told: str, recording: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["driver", "export", str(recording), *options]) == 2
    assert told in capsys.readouterr().err


@pytest.mark.slow
def test_the_fake_s_finger_is_found_in_the_recording_of_it(tmp_path: Path) -> None:
    slow = demo_path(pad_config().workspace)
    # Ever slower: with presses in rhythm, which the demo's are, a record that begins late meets the log at two offsets.
    path = replace(slow, time_s=0.4 * slow.time_s * (1.0 + 0.01 * slow.time_s))
    (tmp_path / "finger.csv").write_text(path.csv_text())
    with (
        FakePort(board(path)) as port,
        Sensor(pad_config(), port.name, baseline_s=0.0) as sensor,
        sensor.record(tmp_path / "a.optorec"),
    ):
        list(sensor.frames(seconds=7.5))
    recorded = read_recorded(tmp_path / "a.optorec")
    found = joined(recorded, read_position_log(tmp_path / "finger.csv"), "auto")
    # The board's clock begins at its reset; a frame is here some milliseconds later, and 17 ms after the one before.
    assert found.offset_s == pytest.approx((recorded.host_s - recorded.device_s).min(), abs=0.03)
    assert found.match.share == 1.0
    assert found.match.edges == 12
