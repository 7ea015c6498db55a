"""Data sets: what a file gives back, what is refused, what a kill leaves."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import tracemalloc
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5netcdf
import h5py
import numpy as np
import pytest
import xarray as xr

from optopad.cli import main
from optopad.design.errors import InputError, OutputError
from optopad.design.preset import preset
from optopad.sims.learning.samples import prepared
from optopad.sims.readings.dataset import (
    DataWriter,
    PressData,
    SetEntry,
    _numbers,
    clipped_note,
    header_of,
    joined,
    read_data,
    require_design,
    save_data,
)
from optopad.sims.readings.label_checks import require_no_fill_values, require_possible_readings
from optopad.sims.readings.recording import read_recording
from tests.said import pattern

SETS = (
    SetEntry(name="grid-ambient-1", role="train", pattern="grid", is_ambient=True),
    SetEntry(name="random-dark", role="test", pattern="random", is_ambient=False),
)
EMITTERS, RECEIVERS = ("E1", "E2"), ("R1", "R2", "R3")


def made_up(places: int = 2, depths: int = 3) -> PressData:
    """Two sets of a few presses, readings that tell sample, state and receiver apart."""
    samples = len(SETS) * places * depths
    number = np.arange(samples)
    counts = 10.0 * number[:, None, None] + np.arange(3)[:, None] + 0.25 * np.arange(3)
    press = np.stack([number // depths + 0.5, number * 0.1, number % depths - 1.0], axis=1)
    return PressData(
        counts=counts.astype(np.float32),
        press_mm=press,
        time_s=number * 0.5,
        set_number=number // (places * depths),
        place_number=number // depths % places,
        sets=SETS,
        state_names=(*EMITTERS, "off"),
        receiver_names=RECEIVERS,
        full_scale_counts=1023.0,
        design_digest="ab" * 32,
        attributes={"seed": 3},
        true_press_mm=press + 0.01,
    )


def assert_same(left: PressData, right: PressData) -> None:
    for name in ("counts", "press_mm", "time_s", "set_number", "place_number", "true_press_mm", "others_mm"):
        np.testing.assert_array_equal(getattr(left, name), getattr(right, name), err_msg=name)
    for name in ("sets", "state_names", "receiver_names", "full_scale_counts", "design_digest"):
        assert getattr(left, name) == getattr(right, name)
    assert dict(left.attributes) == dict(right.attributes)


def with_others(data: PressData) -> PressData:
    """Every third sample has another tip, one of them two; the others have none."""
    others = np.full((len(data), 2, 3), np.nan)
    others[::3, 0] = data.press_mm[::3] + np.array([9.0, 0.0, 2.5])
    others[3, 1] = data.press_mm[3] + np.array([0.0, 9.0, 2.5])
    return replace(data, others_mm=others)


def one_press(data: PressData, set_number: int, place: int) -> PressData:
    return data.only((data.set_number == set_number) & (data.place_number == place))


def test_a_file_gives_back_what_was_written(tmp_path: Path) -> None:
    data = made_up()
    assert_same(read_data(save_data(data, tmp_path / "set.nc")), data)


def test_further_tips_are_written_and_read_in_any_unit(tmp_path: Path) -> None:
    data = with_others(made_up())
    np.testing.assert_array_equal(data.touch_count[:6], [1, 0, 1, 2, 0, 1])
    np.testing.assert_array_equal(data.has_more[:6], [True, False, False, True, False, False])
    assert_same(read_data(save_data(data, tmp_path / "set.nc")), data)
    with xr.open_dataset(tmp_path / "set.nc", engine="h5netcdf") as held:
        assert held["others"].dims == ("time", "other", "axis")
        assert held["axis"].values.tolist() == ["x", "y", "depth"]
        other = held.load()
    other["others"] = (1e3 * other["others"].transpose("axis", "time", "other")).assign_attrs(units="um")
    other.to_netcdf(tmp_path / "um.nc", engine="h5netcdf")
    np.testing.assert_allclose(read_data(tmp_path / "um.nc").others_mm, data.others_mm, rtol=1e-12)
    nowhere = replace(data, others_mm=np.full_like(data.others_mm, np.nan))
    with xr.open_dataset(save_data(nowhere, tmp_path / "none.nc"), engine="h5netcdf") as held:
        assert "others" not in held
    found = read_recording(tmp_path / "set.nc")  # which compares one press at a time
    np.testing.assert_array_equal(found.counts["E2-R3"], data.features()[~data.has_more, 5])
    assert "4 of 12 frames have two touches" in " ".join(found.notes)


def test_features_have_the_off_state_taken_away_and_the_emitter_outermost() -> None:
    data = made_up()
    assert data.pair_names[:4] == ("E1-R1", "E1-R2", "E1-R3", "E2-R1")
    np.testing.assert_array_equal(data.features()[0], [-2, -2, -2, -1, -1, -1])


def test_roles_split_by_set_and_presses_stay_whole() -> None:
    data = made_up()
    assert set(data.role("train").set_number) == {0}
    np.testing.assert_array_equal(data.press_numbers(), np.repeat(np.arange(4), 3))


def test_a_file_of_the_simulation_is_a_recording_that_compare_reads(tmp_path: Path) -> None:
    data = made_up()
    found = read_recording(save_data(data, tmp_path / "set.nc"))
    np.testing.assert_array_equal(found.counts["E2-R3"], data.features()[:, 5])


def test_what_the_driver_exports_is_one_unnamed_set_with_presses_told_by_contact(tmp_path: Path) -> None:
    data = made_up()
    dataset = xr.Dataset(
        {"counts": (("time", "state", "receiver"), data.counts[:, [2, 0, 1]].astype(np.uint16))}
        | {
            name: ("time", data.press_mm[:, k])
            for k, name in enumerate(("press_x", "press_y", "press_depth"))
        }
        | {"device_time": ("time", data.time_s)},
        coords={"state": ["off", *EMITTERS], "receiver": list(RECEIVERS)},
        attrs={"design_digest": data.design_digest},
    )
    dataset["press_y"][:] = 7.0
    dataset.to_netcdf(tmp_path / "recorded.nc", engine="h5netcdf")
    found = read_data(tmp_path / "recorded.nc")
    assert found.sets == (SetEntry(name="unnamed", role="train", pattern="unknown", is_ambient=True),)
    assert found.state_names == (*EMITTERS, "off")
    np.testing.assert_array_equal(found.counts, np.floor(data.counts))
    np.testing.assert_array_equal(found.place_number, np.repeat(np.arange(4), 3))
    assert found.true_press_mm is None


def test_travel_retraction_and_jitter_are_no_presses(tmp_path: Path) -> None:
    """A stage that reports all the way: 12 locations, one of them pressed twice; jitter of location and depth."""
    rng, rows, at = np.random.default_rng(1), [], np.zeros(2)
    places = [np.array([6.0 + 3 * (k % 4), 6.0 + 4 * (k // 4)]) for k in range(12)]
    for place in [*places, places[-1]]:
        rows += [[*(at + share * (place - at)), -2.0] for share in np.arange(0.0, 1.0, 0.1)]
        for depth in [*np.linspace(-2.0, 4.0, 30), *np.linspace(4.0, -2.0, 30)]:
            rows.append([*(place + rng.normal(0.0, 0.02, 2)), depth + 0.02 * rng.normal()])
        at = place
    press = np.array(rows)
    samples = len(press)
    data = replace(
        made_up(),
        counts=rng.normal(300.0, 1.0, (samples, 3, 3)).astype(np.float32),
        press_mm=press,
        time_s=np.arange(samples, dtype=float),
        set_number=np.zeros(samples, dtype=np.int64),
        place_number=np.zeros(samples, dtype=np.int64),
        true_press_mm=None,
    )
    with xr.open_dataset(save_data(data, tmp_path / "set.nc"), engine="h5netcdf") as held:
        held.load().drop_vars(["set", "place"]).to_netcdf(tmp_path / "recorded.nc", engine="h5netcdf")
    found = read_data(tmp_path / "recorded.nc")
    assert len(np.unique(found.place_number)) == 13
    assert np.all(np.diff(found.place_number) >= 0)
    facts = prepared(found).facts()
    assert (facts["locations"], facts["presses"]) == (12, 13)
    assert not facts["is_simulated"]


@pytest.mark.parametrize("change", [lambda data: data, with_others])
def test_presses_added_one_by_one_make_the_same_file(
    change: Callable[[PressData], PressData], tmp_path: Path
) -> None:
    data = change(made_up())
    with DataWriter(tmp_path / "set.nc", header_of(data), asked={"seed": 3}) as writer:
        for set_number, place in ((0, 0), (0, 1), (1, 0), (1, 1)):
            assert not (tmp_path / "set.nc").exists()
            writer.add(one_press(data, set_number, place))
        writer.finish()
    assert_same(read_data(tmp_path / "set.nc"), data)
    assert [path.name for path in tmp_path.iterdir()] == ["set.nc"]


KILLED = """
import os, signal, sys
from pathlib import Path
sys.path[:0] = {path!r}
from tests_of_data import made_up, one_press
from optopad.sims.readings.dataset import DataWriter, header_of
data = made_up()
writer = DataWriter(Path({file!r}), header_of(data))
writer.add(one_press(data, 0, 0))
writer.add(one_press(data, 0, 1))
os.kill(os.getpid(), signal.SIGKILL)
"""


@pytest.mark.slow
def test_after_a_kill_the_whole_presses_are_there_and_work_goes_on(tmp_path: Path) -> None:
    (tmp_path / "tests_of_data.py").write_text(Path(__file__).read_text(encoding="utf-8"))
    file, data = tmp_path / "set.nc", made_up()
    program = KILLED.format(path=[str(tmp_path), *sys.path], file=str(file))
    ended = subprocess.run([sys.executable, "-c", program], check=False, timeout=60)
    assert ended.returncode == -signal.SIGKILL
    (journal,) = tmp_path.glob(".set.nc.*.journal")
    with journal.open("ab") as stream:
        stream.write(os.urandom(11))  # a third press, cut short
    with DataWriter(file, header_of(data)) as writer:
        assert writer.done == {(0, 0), (0, 1)}
        writer.add(one_press(data, 1, 0))
        writer.add(one_press(data, 1, 1))
        writer.finish()
    assert_same(read_data(file), data)


@pytest.mark.parametrize("kept", range(0, 700, 37))
def test_a_journal_cut_anywhere_keeps_its_whole_presses(tmp_path: Path, kept: int) -> None:
    data = made_up()
    with DataWriter(tmp_path / "set.nc", header_of(data)) as writer:
        for place in (0, 1):
            writer.add(one_press(data, 0, place))
        size = writer.journal.stat().st_size
        journal = writer.journal
    record = len(one_press(data, 0, 0)) * (9 * 4 + 3 * 8 + 8 + 8 + 3 * 8) + 8
    os.truncate(journal, max(size - kept, 0))
    with DataWriter(tmp_path / "set.nc", header_of(data)) as writer:
        assert len(writer.done) == max(2 - -(-kept // record), 0)


def test_a_journal_of_other_work_is_not_taken_up(tmp_path: Path) -> None:
    data = made_up()
    with DataWriter(tmp_path / "set.nc", header_of(data), asked={"seed": 3}) as writer:
        writer.add(one_press(data, 0, 0))
    with DataWriter(tmp_path / "set.nc", header_of(data), asked={"seed": 4}) as writer:
        assert writer.done == frozenset()


def test_a_journal_has_one_writer_at_a_time(tmp_path: Path) -> None:
    data = made_up()
    with DataWriter(tmp_path / "set.nc", header_of(data)) as writer:
        writer.add(one_press(data, 0, 0))
        with pytest.raises(InputError, match="another process"):
            DataWriter(tmp_path / "set.nc", header_of(data))
        for press in ((0, 1), (1, 0), (1, 1)):
            writer.add(one_press(data, *press))
        writer.write()
    assert_same(read_data(tmp_path / "set.nc"), data)
    with DataWriter(
        tmp_path / "set.nc", header_of(data)
    ) as other:  # it may begin before the first one forgets
        writer.forget()
        assert len(other.done) == 4
        other.finish()
    assert_same(read_data(tmp_path / "set.nc"), data)
    assert os.listdir(tmp_path) == ["set.nc"]


def test_a_journal_with_a_damaged_length_takes_no_memory(tmp_path: Path) -> None:
    data = made_up()
    with DataWriter(tmp_path / "set.nc", header_of(data)) as writer:
        writer.add(one_press(data, 0, 0))
    with writer.journal.open("ab") as stream:
        stream.write(b"\xff\xff\xff\xff" * 3)
    tracemalloc.start()
    try:
        with DataWriter(tmp_path / "set.nc", header_of(data)) as writer:
            assert writer.done == {(0, 0)}
        assert tracemalloc.get_traced_memory()[1] < 1_000_000
    finally:
        tracemalloc.stop()


def test_an_earlier_file_stays_until_the_new_one_is_whole(tmp_path: Path) -> None:
    file = save_data(made_up(), tmp_path / "set.nc")
    before = file.read_bytes()
    with DataWriter(file, header_of(made_up(places=3))) as writer:
        writer.add(one_press(made_up(places=3), 0, 0))
    assert file.read_bytes() == before


def test_a_folder_that_cannot_be_made_is_named(tmp_path: Path) -> None:
    (tmp_path / "taken").write_text("")
    with pytest.raises(OutputError, match="cannot be written"):
        DataWriter(tmp_path / "taken" / "set.nc", header_of(made_up()))


def test_files_of_one_sensor_join_and_others_are_refused() -> None:
    data = made_up()
    both = joined([data, data])
    assert len(both) == 2 * len(data)
    assert both.sets == SETS + SETS
    np.testing.assert_array_equal(both.set_number[len(data) :], data.set_number + 2)
    more = joined([data, with_others(data)])
    np.testing.assert_array_equal(more.has_more, [*[False] * len(data), *with_others(data).has_more])
    with pytest.raises(InputError, match="design_digest of file 2"):
        joined([data, replace(data, design_digest="cd" * 32)])


def test_clipped_channels_are_named_worst_first() -> None:
    data = made_up()
    counts = data.counts.copy()
    counts[:6, 1, 2] = counts[0, 0, 0] = 1023
    note = clipped_note(replace(data, counts=counts))
    many = made_up(depths=60)
    few = np.where(np.arange(240)[:, None, None] == 7, np.float32(1023), many.counts * 0.1)
    assert "E1-R1 (< 1 %)" in str(clipped_note(replace(many, counts=few)))
    assert note == "2 of 9 channels clip at 1023 counts: E2-R3 (50 %), E1-R1 (8 %)"
    assert clipped_note(data) is None


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"state_names": ("E1", "E2", "E3")}, "last 'off'"),
        ({"press_mm": np.zeros((12, 2))}, "press_mm ... (12, 2) ... (12, 3)"),
        ({"set_number": np.full(12, 2)}, "set_number runs from 2 to 2, there are 2 sets"),
        ({"time_s": np.full(12, np.nan)}, "time_s ... 12 of 12 ... sample 1"),
        ({"others_mm": np.zeros((3, 1, 3))}, "others_mm ... (3, 1, 3) ... (12, 1, 3)"),
        (
            {"others_mm": np.tile([16.0, np.nan, 1.0], (12, 1, 1))},
            "others: 12 tips ... sample 1: 16, nan, 1 mm",
        ),
    ],
)
def test_data_that_cannot_be_are_refused_by_name(change: dict[str, object], message: str) -> None:
    with pytest.raises(InputError, match=pattern(message)):
        replace(made_up(), **change)  # type: ignore[arg-type]


def test_a_reading_that_is_no_number_is_refused_with_its_sample(tmp_path: Path) -> None:
    file = save_data(made_up(), tmp_path / "set.nc")
    with xr.open_dataset(file, engine="h5netcdf") as dataset:
        bad = dataset.load()
    bad["counts"][4, 0, 0] = np.nan
    bad.to_netcdf(tmp_path / "bad.nc", engine="h5netcdf")
    with pytest.raises(InputError, match=r"bad\.nc.*1 of 12.*sample 5"):
        read_data(tmp_path / "bad.nc")


FILLS = (-1.0, -999.0, 65535.0, -32767.0, 9.969209968386869e36)


def held(**changes: tuple[int, float]) -> xr.Dataset:
    """A data set in memory; a change is an index of a flat variable, and its new value there."""
    data, by_time = made_up(), ("time",)
    values = dict(zip(("press_x", "press_y", "press_depth"), data.press_mm.T, strict=True))
    found = xr.Dataset(
        {name: (by_time, value.copy()) for name, value in values.items()}
        | {"counts": (("time", "state", "receiver"), data.counts.copy())},
        {"state": list(data.state_names), "receiver": list(data.receiver_names)},
        {"full_scale_counts": 1023.0},
    )
    for name, (at, value) in changes.items():
        found[name].values.flat[at] = value
    return found


@pytest.mark.parametrize("fill", FILLS)
def test_readings_that_no_converter_gives_are_refused_with_count_and_place(fill: float) -> None:
    readings = made_up().counts.reshape(12, 9).copy()
    readings[4, 5] = readings[9, 0] = fill
    names = list("ABCDEFGHI")
    told = rf"2 of 108 readings are outside 0 to 1023, the first is {re.escape(f'{fill:g}')} in F at time index 4"
    with pytest.raises(InputError, match=told):
        require_possible_readings(readings, names, 1023.0, slack=0.5)
    if fill == -1.0:  # noise of a signal may be so
        require_possible_readings(readings, names, None, slack=0.5)
        return
    with pytest.raises(InputError, match=r"1 of 12.*index 9"):
        require_possible_readings(readings, names, None, slack=0.5)


def test_readings_at_both_ends_of_the_converter_are_possible() -> None:
    require_possible_readings(np.array([[0.0, 1023.0]]), ["A", "B"], 1023.0, slack=0.5)
    require_no_fill_values({"A": np.array([65535.0, 60000.0, 20.0]), "B": np.array([-999.0, -900.0, 1e3])})
    require_no_fill_values({"A": np.full(3, 65535)})  # saturated, at an unknown full scale
    for gaps in (np.full(3, -32767), np.full(3, 9.97e36), np.array([1e300, 3.0, 2.0])):
        with pytest.raises(InputError, match="time index 0"):
            require_no_fill_values({"A": gaps})


def test_a_gap_in_readings_or_presses_is_refused_by_every_reader(tmp_path: Path) -> None:
    held(counts=(41, -999.0)).to_netcdf(tmp_path / "counts.nc", engine="h5netcdf")
    held(press_depth=(3, -999.0)).to_netcdf(tmp_path / "depth.nc", engine="h5netcdf")
    for read in (read_data, read_recording):
        with pytest.raises(
            InputError, match=r"counts\.nc: counts: 1 of 108 .* -999 in E2-R3 at time index 4"
        ):
            read(tmp_path / "counts.nc")
        with pytest.raises(InputError, match=r"1 of 12.*index 3"):
            read(tmp_path / "depth.nc")


@pytest.mark.parametrize("gap", [np.nan, -1.0, 2.0**31 - 1, 9.97e36, 0.5])
def test_a_frame_that_belongs_to_no_press_is_refused(gap: float) -> None:
    values = np.where(np.arange(5) == 3, gap, 1.0)
    with pytest.raises(InputError, match=r"1 of 5.*0, .*index 3"):
        _numbers(xr.Dataset({"place": ("time", values)}), "place")


@pytest.mark.slow
def test_a_gap_is_refused_on_the_screen_by_every_command(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    held(counts=(41, -999.0)).to_netcdf(tmp_path / "bad.nc", engine="h5netcdf")
    data, pad = str(tmp_path / "bad.nc"), "piacenza2017-pad"
    model = ["--model", str(tmp_path / "none.optomodel")]
    for command in (
        ["train", data],
        ["compare", pad, data],
        ["calibrate", pad, data],
        ["evaluate", data, *model],
    ):
        assert main(command) == 2, command
        told = capsys.readouterr().err
        assert "1 of 108 readings are outside 0 to 1023, the first is -999 in E2-R3" in told, command


@pytest.mark.parametrize("kind", ["characters", "bytes", "text"])
def test_names_with_blanks_at_the_end_are_read_however_they_are_stored(tmp_path: Path, kind: str) -> None:
    names = {"state": ["E1  ", "E2  ", "off "], "receiver": ["R1", "R2", "R3"]}
    file = tmp_path / "named.nc"
    if kind == "characters":
        held().drop_vars(list(names)).to_netcdf(file, engine="h5netcdf")
        with h5netcdf.File(file, "a") as stored:
            stored.dimensions["characters"] = 4
            for name, texts in names.items():
                made = stored.create_variable(name, (name, "characters"), dtype="S1")
                made[:] = np.array([list(text.ljust(4)) for text in texts], dtype="S1")
    else:
        of_type = object if kind == "text" else "S4"
        named = held().assign_coords({name: np.array(texts, dtype=of_type) for name, texts in names.items()})
        named.to_netcdf(file, engine="h5netcdf")
    found = read_data(file)
    assert found.state_names == ("E1", "E2", "off")
    assert found.receiver_names == RECEIVERS
    np.testing.assert_array_equal(found.counts, made_up().counts)


@pytest.mark.parametrize("gone", ["press_x", "press_depth", "receiver", "counts"])
def test_a_file_without_a_part_is_refused_by_its_name(tmp_path: Path, gone: str) -> None:
    file = save_data(made_up(), tmp_path / "set.nc")
    with xr.open_dataset(file, engine="h5netcdf") as dataset:
        left = dataset.load().drop_vars(gone)
    left.to_netcdf(tmp_path / "left.nc", engine="h5netcdf")
    with pytest.raises(InputError, match=f"has no {gone}"):
        read_data(tmp_path / "left.nc")


def test_what_is_no_netcdf_is_refused(tmp_path: Path) -> None:
    (tmp_path / "text.nc").write_text("depth,signal\n")
    with pytest.raises(InputError, match=r"text\.nc.*netCDF"):
        read_data(tmp_path / "text.nc")
    with pytest.raises(InputError, match="no such file"):
        read_data(tmp_path / "absent.nc")


def test_data_of_another_design_or_with_missing_states_are_refused() -> None:
    design = preset("piacenza2017-pair")
    names = tuple(f"E{k}" for k in (1, 2, 3))
    fits = replace(
        made_up(),
        counts=np.zeros((12, 4, 3), dtype=np.float32),
        state_names=(*names, "off"),
        design_digest=design.digest,
    )
    assert require_design(fits, design) == ()
    assert "names no design" in require_design(replace(fits, design_digest=None), design)[0]
    with pytest.raises(InputError, match="of design abababab"):
        require_design(made_up(), design)
    with pytest.raises(InputError, match="lacks E3"):
        require_design(replace(made_up(), design_digest=None), design)


@pytest.mark.parametrize("read", [read_data, read_recording])
def test_a_small_file_that_unpacks_to_much_is_refused_before_it_does(tmp_path: Path, read: Any) -> None:
    file = save_data(made_up(), tmp_path / "set.nc")
    with h5py.File(file, "r+") as held:
        held.create_dataset("much", shape=(2**28,), dtype="f8", chunks=(2**16,), compression="gzip")
    tracemalloc.start()
    try:
        with pytest.raises(InputError, match=r"unpacks to 2\.15e\+09 bytes, reads at most 5e\+08"):
            read(file)
        assert tracemalloc.get_traced_memory()[1] < 20_000_000
    finally:
        tracemalloc.stop()
