"""A data set pressed unattended: every position with its frames, resumed press by press, never mixed with another."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from optopad.design.errors import DeviceError, InputError
from optopad.design.recordings import SetEntry
from optopad.fabrication.driver.link.frames import FrameDecoder
from optopad.fabrication.driver.link.protocol import frame_format
from optopad.fabrication.stage.collection import CollectedParts, Collector
from optopad.fabrication.stage.stage import NOWHERE, PressList, joined_path, leg, press_list, read_press_list
from optopad.sims.readings.dataset import read_data
from tests.fabrication.driver.made_up_pad import press_table
from tests.fabrication.driver.test_mcap_file import BEGUN_S, CONFIG, FRAMES
from tests.fabrication.stage.made_up_bench import MIDDLE, bench

pytestmark = pytest.mark.skipif(os.name != "posix", reason="needs pseudo-terminals")
GRID = SetEntry(name="grid-dark", role="train", pattern="grid", is_ambient=False)
RANDOM = SetEntry(name="random", role="test", pattern="random", is_ambient=True)
PLACES = ((GRID, 0, 10.0, 10.0), (GRID, 1, 20.0, 12.0), (RANDOM, 0, 14.0, 22.0))
DEPTHS_MM = (-1.0, 1.0, 4.0)
PRESSES = press_list((one, place, (x, y, depth)) for one, place, x, y in PLACES for depth in DEPTHS_MM)
SETTLE_S = 0.05
"""Three frames of the board at 60 Hz, fifteen at 300."""


def written(folder: Path, text: str) -> Path:
    file = folder / "presses.csv"
    file.write_text(text)
    return file


def test_every_position_is_pressed_and_read_and_the_signals_are_those_of_its_depth(tmp_path: Path) -> None:
    out = tmp_path / "a.nc"
    with bench(has_board=True) as made, made.stage() as stage, made.sensor() as sensor:
        stage.zero(*MIDDLE)
        collector = Collector(sensor, PRESSES, out, settle_s=SETTLE_S, frames=3)
        shares: list[float] = []
        assert collector.run(stage, collector.remaining(), on_step=shares.append) == 3
        found = collector.finish(3)
    assert found.is_complete
    assert shares == pytest.approx([1 / 3, 2 / 3, 1])
    assert [file.name for file in tmp_path.iterdir()] == ["a.nc"]
    data = read_data(out)
    wanted = np.array([step for press in PRESSES.presses for step in press.steps_mm]).repeat(3, axis=0)
    assert data.press_mm == pytest.approx(wanted, abs=0.011)  # M114 has two decimals
    assert data.set_number.tolist() == [0] * 18 + [1] * 9
    assert data.place_number.tolist() == [0] * 9 + [1] * 9 + [0] * 9
    assert [(one.name, one.role, one.is_ambient) for one in data.sets] == [
        ("grid-dark", "train", False),
        ("random", "test", True),
    ]
    light = press_table().at(wanted)
    clear = light[0] < 900  # the others clip
    noise = 0.5 + 0.002 * light.max()  # of reading and light, see fake_board; twice for the dark state
    assert np.abs(data.signals() - light)[:, clear].max() < 6 * noise
    require_path_of(out, made.printer.rides[1:])  # the first lifts the tip before the first press


def require_path_of(file: Path, rides: list[tuple[np.ndarray, np.ndarray]]) -> None:
    """The path in a file leads through all rides but the lift at the end, and rests where frames were taken."""
    found = xr.load_dataset(file, engine="h5netcdf", decode_times=False)
    time_s, host_s = found["move_time"].values, found["host_time"].values
    path = np.stack([found[name].values for name in ("move_x", "move_y", "move_depth")], axis=1)
    at_frames = np.stack([np.interp(host_s, time_s, axis) for axis in path.T], axis=1)
    labels = [found[name].values for name in ("press_x", "press_y", "press_depth")]
    assert at_frames == pytest.approx(np.stack(labels, axis=1), abs=1e-9)
    way = np.linalg.norm(np.diff(path, axis=0), axis=1)
    moved = np.flatnonzero(way > 0.02)
    wanted = np.concatenate([ride for ride in rides[:-1] if np.ptp(ride, axis=0).max() > 0.02])
    assert np.stack([path[moved], path[moved + 1]], axis=1).reshape(-1, 3) == pytest.approx(wanted, abs=0.011)
    speed = np.where(
        np.maximum(path[moved, 2], path[moved + 1, 2]) > -0.99, 100.0, 400.0
    )  # slow near the pad
    assert (np.diff(time_s) >= 0.0).all()
    assert (np.diff(time_s)[moved] >= 0.95 * way[moved] / speed).all()


def test_a_move_ends_with_its_report_and_takes_its_way_over_its_speed() -> None:
    start, end = (1.0, 2.0, -1.0), (1.0, 2.0, 1.0)
    assert leg(100.0, 100.5, start, end, 5.0) == [(100.1, *start), (100.5, *end)]  # held back for 0.1 s
    assert leg(100.0, 100.3, start, end, 5.0) == [(100.0, *start), (100.3, *end)]  # faster than commanded
    assert leg(100.0, 101.0, start, end, 5.0) == [
        (100.0, *start),
        (101.0, *end),
    ]  # the printer limits its speed


def test_a_path_is_unknown_where_a_part_of_it_is_lost() -> None:
    first = np.array([[0.0, 1, 1, -5], [1.0, 1, 1, 2]])
    run_on, lost = first + np.array([1.5, 0, 0, 7]), first + np.array([5.0, 0, 0, 0])
    run_on[:, 3] = 2, -5
    assert joined_path([run_on, first]) == pytest.approx(np.concatenate([first, run_on]))
    found = joined_path([np.array([[-3.0, *NOWHERE]]), lost, np.empty((0, 4)), first])
    assert found is not None
    assert np.isnan(np.interp(3.0, found[:, 0], found[:, 3]))
    assert np.interp([0.5, 5.5], found[:, 0], found[:, 3]) == pytest.approx([-1.5, -1.5])
    assert np.isfinite(found[[0, -1]]).all()
    assert joined_path([]) is None
    assert joined_path([np.array([[5.0, 1, 1, -5], [1.0, 1, 1, 2]])]) is None  # the clock was set back


def test_a_collection_says_how_many_of_its_presses_are_made(tmp_path: Path) -> None:
    parts = CollectedParts(tmp_path / "a.nc", {})
    parts.begin()
    decoder = FrameDecoder(frame_format(CONFIG))
    for number, said in enumerate(("0 lost; 1 of 3 presses made", "0 lost; 2 of 3 presses made", "0 lost")):
        frames = decoder.decoded(FRAMES[3 * number : 3 * number + 3], BEGUN_S + number)
        parts.save(number, frames, [(10.0, 10.0, 1.0)] * 3, [])
        found = parts.recorded(CONFIG, PRESSES)
        assert found is not None
        assert (found.losses, found.is_whole) == (said, number == 2)


@pytest.mark.slow
def test_a_collection_that_was_ended_early_goes_on_where_it_was(tmp_path: Path) -> None:
    out = tmp_path / "a.nc"
    with bench(has_board=True) as made:
        with made.stage() as stage, made.sensor() as sensor:
            stage.zero(*MIDDLE)
            collector = Collector(sensor, PRESSES, out, settle_s=SETTLE_S)
            collector.run(stage, collector.remaining(only=["random"]))
            first = collector.finish(1)
        assert (first.made, first.kept, first.is_complete, first.frames) == (1, 1, False, 3)
        assert set(read_data(out).set_number.tolist()) == {1}
        with made.stage() as stage, made.sensor() as sensor:
            stage.zero(16.0, 16.0, -5.0)
            again = Collector(sensor, PRESSES, out, settle_s=SETTLE_S)
            assert again.remaining() == [0, 1]
            again.run(stage, again.remaining())
            assert again.finish(2).is_complete
    assert read_data(out).place_number.tolist() == [0] * 3 + [1] * 3 + [0] * 3
    moves = xr.load_dataset(out, engine="h5netcdf", decode_times=False)
    assert int(np.isnan(moves["move_depth"]).sum()) == 1  # between the runs
    assert (moves["move_time"].diff("move") >= 0.0).all()
    assert not (tmp_path / "a.nc.parts").exists()


@pytest.mark.slow
def test_a_printer_that_fails_costs_no_press_that_was_whole(tmp_path: Path) -> None:
    out = tmp_path / "a.nc"

    def press(collector: Collector) -> None:
        with made.stage() as stage:
            stage.zero(*MIDDLE)
            collector.run(stage, collector.remaining())

    with bench(has_board=True, fault="error", fault_after=14) as made, made.sensor() as sensor:
        collector = Collector(sensor, PRESSES, out, settle_s=SETTLE_S)
        with pytest.raises(DeviceError, match="Printer halted"):
            press(collector)
        found = collector.finish()
    assert 0 < found.kept < 3
    assert found.frames == 3 * found.kept


def test_another_collection_under_the_same_name_is_refused(tmp_path: Path) -> None:
    with bench(has_board=True) as made, made.sensor() as sensor:
        Collector(sensor, PRESSES, tmp_path / "a.nc", settle_s=1.0).begin()  # nothing made: no obstacle
        Collector(sensor, PRESSES, tmp_path / "a.nc", settle_s=SETTLE_S).begin()
        (tmp_path / "a.nc.parts" / "000000.npz").write_bytes(b"of a press")
        with pytest.raises(InputError, match="settle_s"):
            Collector(sensor, PRESSES, tmp_path / "a.nc", frames=2)
        (tmp_path / "b.nc").write_text("precious")
        with pytest.raises(InputError, match=r"b\.nc: exists already"):
            Collector(sensor, PRESSES, tmp_path / "b.nc")
        with pytest.raises(InputError, match="grid-dark, random"):
            Collector(sensor, PRESSES, tmp_path / "a.nc", settle_s=SETTLE_S).remaining(only=["nowhere"])
    assert (tmp_path / "b.nc").read_text() == "precious"


def test_a_damaged_part_is_named_with_the_way_out(tmp_path: Path) -> None:
    with bench(has_board=True) as made, made.sensor() as sensor:
        collector = Collector(sensor, PRESSES, tmp_path / "a.nc", settle_s=SETTLE_S)
        collector.begin()
        (tmp_path / "a.nc.parts" / "000001.npz").write_bytes(b"torn")
        with pytest.raises(InputError, match=r"000001\.npz"):
            collector.finish()


@pytest.mark.slow
def test_the_room_s_light_is_asked_for_where_it_changes(tmp_path: Path) -> None:
    with bench(has_board=True) as made, made.stage() as stage, made.sensor() as sensor:
        stage.zero(*MIDDLE)
        collector = Collector(sensor, PRESSES, tmp_path / "a.nc", settle_s=0.0)
        asked: list[tuple[str, float]] = []
        collector.run(
            stage,
            collector.remaining(),
            on_light=lambda entry: asked.append((entry.name, round(stage.position()[2], 2))),
        )
    assert asked == [("grid-dark", -5.0), ("random", -5.0)]


def test_a_list_that_leaves_the_limits_moves_nothing(tmp_path: Path) -> None:
    far = press_list([(GRID, 0, (16.0, 16.0, 1.0)), (GRID, 1, (60.0, 16.0, 1.0))])
    with bench(has_board=True) as made, made.stage() as stage, made.sensor() as sensor:
        stage.zero(*MIDDLE)
        rides = len(made.printer.rides)
        collector = Collector(sensor, far, tmp_path / "a.nc", settle_s=0.0)
        with pytest.raises(InputError, match="press 1 of set 'grid-dark': stage: x 60 mm is outside"):
            collector.run(stage, collector.remaining())
        assert len(made.printer.rides) == rides


def test_rows_of_a_table_become_presses_by_set_and_place(tmp_path: Path) -> None:
    text = "x_mm,y_mm,depth_mm,set,place,role,ambient\n8,8,-1,a,3,test,no\n8,8,1,a,3,test,no\n9,8,1,a,4,test,no\n"
    found = read_press_list(written(tmp_path, text))
    assert found.sets == (SetEntry(name="a", role="test", pattern="unknown", is_ambient=False),)
    assert [(one.place_number, len(one.steps_mm)) for one in found.presses] == [(3, 2), (4, 1)]
    plain = read_press_list(written(tmp_path, "x_mm,y_mm,depth_mm\n8,8,-1\n8,8,1\n9,8,1\n8,8,1\n"))
    assert [(one.place_number, len(one.steps_mm)) for one in plain.presses] == [(0, 2), (1, 1), (2, 1)]
    assert plain.digest != found.digest
    assert isinstance(plain, PressList)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("x_mm,y_mm\n1,1\n", "has no depth_mm"),
        ("", "0 rows below the heading.*x_mm,y_mm,depth_mm"),
        ("x_mm,y_mm,depth_mm\n", "0 rows below the heading"),
        ("x_mm,y_mm,depth_mm\n1,1\n", "row 2 has 2 values, the heading 3 columns"),
        ("x_mm,y_mm,depth_mm\n1,x,1\n", "row 2: y_mm is 'x'"),
        ("x_mm,y_mm,depth_mm,place\n1,1,1,-2\n", "row 2: 'place' is '-2', needs a whole number"),
        (
            "x_mm,y_mm,depth_mm,set,place\n1,1,1,a,0\n1,1,1,a,1\n1,1,1,a,0\n",
            "press 0 of set 'a' is repeated",
        ),
        ("x_mm,y_mm,depth_mm,set,role\n1,1,1,a,train\n1,1,1,a,test\n", "two roles"),
    ],
)
def test_a_table_that_says_no_presses_is_refused(text: str, told: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=told):
        read_press_list(written(tmp_path, text))


def test_a_list_has_the_digest_that_half_finished_collections_hold() -> None:
    """A collection is resumed only with the same digest, so that it must not change from version to version."""
    assert PRESSES.digest == "f3e8741003fd483c8512b8335f984a93e3d9ab9dc7afaa5e7cc951b94c86c511"
