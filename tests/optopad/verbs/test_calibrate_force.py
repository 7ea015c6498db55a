"""`calibrate --force`: the log of a load cell joined to a recording, and its refusals."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr

from optopad.cli import main
from optopad.design.errors import InputError
from optopad.fabrication.driver.recording.force_log import ForceLog, read_force_log
from optopad.sims.learning.force_fit import fit_force
from optopad.sims.learning.inference.header import ForceCurve, header_of_json
from optopad.sims.learning.press_force import TipPath
from optopad.verbs import calibrate as calibration
from optopad.verbs.calibrate import _pressed_force, force_clock
from tests.fabrication.driver.made_up_model import header
from tests.said import says
from tests.sims.learning.test_force_fit import PAD, pressed

BEGUN_S = 1_790_000_000.0


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A recording's times and presses, and the force under them, by the same clock."""
    folder = tmp_path_factory.mktemp("force")
    time_s, press_mm, force_n = pressed(8, 0.8)
    names = dict(zip(("press_x", "press_y", "press_depth"), press_mm.T, strict=True))
    values = {"host_time": BEGUN_S + time_s} | names
    dataset = xr.Dataset({name: ("time", value) for name, value in values.items()})
    dataset.to_netcdf(folder / "a.nc", engine="h5netcdf")
    return folder / "a.nc", write_log(folder / "cell.csv", BEGUN_S + time_s, force_n)


def write_log(file: Path, time_s: np.ndarray, force: np.ndarray, name: str = "force_n") -> Path:
    rows = [f"{at:.4f},{value:.5f}" for at, value in zip(time_s, force, strict=True)]
    file.write_text("\n".join([f"time_s,{name}", *rows]) + "\n")
    return file


@pytest.mark.slow
def test_a_log_by_the_same_clock_and_by_another_that_is_off_by_a_percent_gives_the_same_modulus(
    files: tuple[Path, Path], tmp_path: Path
) -> None:
    same = fit_force(PAD, *_pressed_force(files[0], read_force_log(files[1]), None))
    log = read_force_log(files[1])
    own_s = 1.01 * (log.time_s - BEGUN_S) + 17.3
    other = read_force_log(write_log(tmp_path / "other.csv", own_s, log.force_n * 1e3, "force_mN"))
    found = fit_force(PAD, *_pressed_force(files[0], other, "auto"))
    assert same.modulus_mpa == pytest.approx(0.8 * same.design_mpa, rel=0.003)
    assert found.modulus_mpa == pytest.approx(same.modulus_mpa, rel=0.001)
    assert (same.time_constant_s, found.time_constant_s) == (None, None)


@pytest.mark.slow
def test_the_moves_that_collect_wrote_give_the_force_its_course(
    files: tuple[Path, Path], tmp_path: Path
) -> None:
    dataset = xr.load_dataset(files[0], engine="h5netcdf")
    names = ["host_time", "press_x", "press_y", "press_depth"]
    rows = np.stack([dataset[name].values for name in names], axis=1)
    bends = np.abs(np.diff(rows[:, 1:], n=2, axis=0)).max(axis=1) > 1e-6
    corners = rows[np.flatnonzero(np.concatenate([[True], bends, [True]]))]
    assert len(corners) < len(rows) / 5
    earlier = corners - [1000.0, 0.0, 0.0, 0.0]
    unknown = np.array([[corners[0, 0], np.nan, np.nan, np.nan]])
    moves = np.concatenate([earlier, unknown, corners])  # two runs; the log is of the second
    held = rows[:, 3] > 0.999 * rows[:, 3].max()
    collected = xr.Dataset({name: ("time", rows[held, k]) for k, name in enumerate(names)})
    for k, name in enumerate(("move_time", "move_x", "move_y", "move_depth")):
        collected[name] = ("move", moves[:, k])
    collected.to_netcdf(tmp_path / "collected.nc", engine="h5netcdf")
    log = read_force_log(files[1])
    same, found = (
        fit_force(PAD, *_pressed_force(file, log, None)) for file in (files[0], tmp_path / "collected.nc")
    )
    assert found.modulus_mpa == pytest.approx(same.modulus_mpa, rel=0.003)


def test_a_press_that_nobody_recorded_is_no_rest_of_its_neighbours(tmp_path: Path) -> None:
    time_s, press_mm, force_n = pressed(9, 0.8)
    time_s = BEGUN_S + time_s
    last = TipPath(time_s=time_s, press_mm=press_mm).contacts[4, 1]  # of the press in the middle
    first = TipPath(time_s=time_s, press_mm=press_mm).contacts[3, 1] + 12
    rows = np.column_stack([time_s, press_mm])
    unknown = np.array([[time_s[last + 5], np.nan, np.nan, np.nan]])
    moves = np.concatenate([rows[:first], unknown, rows[last + 5 :]])
    names = ("move_time", "move_x", "move_y", "move_depth")
    dataset = xr.Dataset({name: ("move", moves[:, k]) for k, name in enumerate(names)})
    dataset.to_netcdf(tmp_path / "cut.nc", engine="h5netcdf")
    log = ForceLog(file="cell.csv", time_s=time_s, force_n=force_n)
    found = fit_force(PAD, *_pressed_force(tmp_path / "cut.nc", log, None))
    assert found.modulus_mpa == pytest.approx(0.8 * found.design_mpa, rel=0.003)
    assert found.single_mpa == pytest.approx([0.8 * found.design_mpa] * 8, rel=0.003)
    assert found.relative_sigma < 0.001


@pytest.mark.slow
@pytest.mark.parametrize(("board", "busy_s"), [(True, 0.8), (False, 0.0)])
def test_frames_that_are_read_together_or_late_give_the_same_modulus(
    board: bool, busy_s: float, files: tuple[Path, Path], tmp_path: Path
) -> None:
    recording = xr.load_dataset(files[0], engine="h5netcdf")
    at, *press = (recording[name].values for name in calibration.FRAMES)
    sent_s = np.arange(at[0], at[-1], 0.005)
    host_s = np.repeat(sent_s[3::4], 4)  # four frames a read
    sent_s = sent_s[: len(host_s)]
    measured_s = host_s.copy()
    for begin in at[0] + np.arange(4.0, at[-1] - at[0], 4.0):  # the host is busy every four seconds
        late = (host_s > begin) & (host_s < begin + busy_s)
        host_s[late], measured_s[late] = begin + busy_s, sent_s[late]
    values = {"host_time": host_s}
    values |= {
        name: np.interp(measured_s, at, axis)
        for name, axis in zip(calibration.FRAMES[1:], press, strict=True)
    }
    if board:
        second = sent_s > sent_s.mean()  # the board restarts, and its clock with it
        values["device_time"] = sent_s - np.where(second, sent_s[second][0], sent_s[0])
        values["connection"] = 1 + second
    dataset = xr.Dataset({name: ("time", value) for name, value in values.items()})
    dataset.to_netcdf(tmp_path / "batches.nc", engine="h5netcdf")
    found = fit_force(PAD, *_pressed_force(tmp_path / "batches.nc", read_force_log(files[1]), None))
    low, high = found.intervals["youngs_modulus_mpa"]
    assert low < 0.8 * found.design_mpa < high
    assert found.modulus_mpa == pytest.approx(0.8 * found.design_mpa, rel=0.01)


def test_the_clock_is_found_under_a_drift_of_the_tare_and_of_the_clock() -> None:
    time_s, press_mm, force_n = pressed(12, 0.7)
    path = TipPath(time_s=time_s, press_mm=press_mm)
    drift = 0.5 * force_n.max() * time_s / time_s[-1]
    for rate in (0.0, 0.0005, 0.01):
        log = ForceLog(file="cell.csv", time_s=(1.0 + rate) * time_s + 17.3, force_n=force_n + drift)
        found = force_clock(path, log, "auto").at(log.time_s)
        assert np.abs(found - time_s).max() < 0.3  # the fit refines it
        with pytest.raises(InputError, match=r"tip presses.* negate"):
            force_clock(path, ForceLog(file="cell.csv", time_s=log.time_s, force_n=-force_n), "auto")


def test_logs_that_do_not_fit_are_refused_with_a_way_out(files: tuple[Path, Path], tmp_path: Path) -> None:
    log = read_force_log(files[1])
    late = replace(log, time_s=log.time_s + 3600.0)
    with pytest.raises(InputError, match=r"recording.*--offset auto"):
        _pressed_force(files[0], late, None)
    with pytest.raises(InputError, match=r"is out of step .* find the offset with --offset auto"):
        _pressed_force(files[0], replace(log, time_s=log.time_s + 2.0), None)
    for name, said in (
        ("force_kg", "force_kg is a mass, needs a force; multiply by 9.80665 and name the column force_n"),
        ("load", "has no force_n .or force_mn.; it has time_s, load"),
    ):
        with pytest.raises(InputError, match=said):
            read_force_log(write_log(tmp_path / "bad.csv", log.time_s, log.force_n, name))
    xr.Dataset({"press_x": ("time", [1.0])}).to_netcdf(tmp_path / "b.nc", engine="h5netcdf")
    with pytest.raises(InputError, match="host_time"):
        _pressed_force(tmp_path / "b.nc", log, None)


def test_an_offset_without_a_log_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    command = ["calibrate", "piacenza2017-pad", str(tmp_path / "a.nc"), "--offset", "auto"]
    assert main(command) == 2
    assert says(capsys.readouterr().err, "--offset ... --force")


def test_the_model_s_force_has_the_error_of_the_modulus() -> None:
    curve = ForceCurve(depth_mm=(0.0, 1.0, 2.0), force_n=(0.0, 1.0, 4.0), relative_sigma=0.03)
    again = header_of_json(header(force_curve=curve).to_json())
    assert again.force_curve == curve
    assert header_of_json(header().to_json()).force_curve == header().force_curve
    assert calibration.MODEL_FILE.endswith(".optomodel")


def test_a_force_in_grams_is_refused_before_the_light_is_fitted(
    files: tuple[Path, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    log = read_force_log(files[1])
    grams = write_log(tmp_path / "grams.csv", log.time_s, log.force_n / 9.80665e-3)
    data = SimpleNamespace(has_more=np.zeros(0, np.bool_))
    data.of_one_tip = lambda: data
    for name, made in (("read_data", data), ("require_design", ()), ("data_notes", ())):
        monkeypatch.setattr(calibration, name, lambda *_, made=made, **__: made)
    monkeypatch.setattr(calibration, "calibrated", lambda *_, **__: pytest.fail("the light was fitted"))
    with pytest.raises(InputError, match=r"81\.\d MPa, is 81\.\d times the design's.* is the force in grams"):
        calibration.fitted(
            PAD, files[0], with_model=False, quick=True, seed=0, on_step=lambda *_: None, force=grams
        )
