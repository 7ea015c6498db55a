"""Stored presses survive a round trip, damage and races, and are keyed by what they depend on."""

from __future__ import annotations

import multiprocessing
import os
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

from optopad.design.spec import SensorDesign
from optopad.sims.contact.indentation import solved_press
from optopad.sims.contact.library import stored_press
from optopad.sims.contact.library.live_press import fit_press
from optopad.sims.contact.library.solved_press import SolvedPress
from optopad.sims.contact.library.stored_press import (
    UnitPress,
    cache_folder,
    entry_key,
    entry_path,
    read_entry,
    write_entry,
)
from optopad.sims.contact.scope import contact_of

KEY = entry_key({"case": 1})


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("OPTOPAD_CACHE", str(tmp_path))
    return tmp_path / "contact"


def assert_same(left: UnitPress, right: UnitPress) -> None:
    for field in fields(UnitPress):
        np.testing.assert_array_equal(
            getattr(left, field.name), getattr(right, field.name), err_msg=field.name
        )


def test_round_trip_is_exact(folder: Path, coarse_press: SolvedPress) -> None:
    assert write_entry(KEY, coarse_press.unit) is None
    found = read_entry(KEY)
    assert found is not None
    assert_same(found, coarse_press.unit)
    assert [path.name for path in folder.iterdir()] == [f"{KEY}.npz"]


def test_an_interrupted_write_leaves_nothing(
    folder: Path, coarse_press: SolvedPress, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(os, "replace", interrupted)
    with pytest.raises(KeyboardInterrupt):
        write_entry(KEY, coarse_press.unit)
    assert list(folder.iterdir()) == []


def test_a_flipped_byte_anywhere_is_noticed_or_harmless(folder: Path, coarse_press: SolvedPress) -> None:
    write_entry(KEY, coarse_press.unit)
    whole = entry_path(KEY).read_bytes()
    for position in np.random.default_rng(3).integers(0, len(whole), 60):
        damaged = bytearray(whole)
        damaged[position] ^= 0xFF
        entry_path(KEY).write_bytes(bytes(damaged))
        found = read_entry(KEY)
        if found is not None:
            assert_same(found, coarse_press.unit)


def test_an_entry_under_another_name_counts_as_absent(folder: Path, coarse_press: SolvedPress) -> None:
    write_entry(KEY, coarse_press.unit)
    other = entry_key({"case": 2})
    entry_path(KEY).rename(entry_path(other))
    assert read_entry(other) is None


@pytest.mark.parametrize(
    "wrong", [{"force": np.array([np.nan])}, {"force": np.zeros(1)}, {"radii": np.zeros(3)}]
)
def test_arrays_that_do_not_fit_count_as_absent(
    folder: Path, coarse_press: SolvedPress, wrong: dict[str, np.ndarray]
) -> None:
    write_entry(KEY, replace(coarse_press.unit, **wrong))  # type: ignore[arg-type]
    assert read_entry(KEY) is None


@pytest.mark.parametrize(
    "change", [{"layer": 3.1}, {"mesh": 0.11}, {"depths": [0.1]}, {"recipe": 2}, {"mujoco": "4.0.1"}]
)
def test_the_key_depends_on_every_input(change: dict[str, object]) -> None:
    inputs: dict[str, object] = {
        "layer": 3.0,
        "mesh": 0.1,
        "depths": [0.1, 0.2],
        "recipe": 1,
        "mujoco": "4.0.0",
    }
    assert entry_key(inputs) != entry_key(inputs | change)
    assert entry_key(inputs) == entry_key(dict(reversed(inputs.items())))


def test_the_folder_follows_the_environment(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert cache_folder() == folder
    monkeypatch.delenv("OPTOPAD_CACHE")
    assert cache_folder().parts[-2:] == ("optopad", "contact")


def test_an_unwritable_folder_gives_a_result_with_a_note(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, check_design: SensorDesign, coarse_press: SolvedPress
) -> None:
    blocked = tmp_path / "file"
    blocked.write_text("a file where the folder should be")
    monkeypatch.setenv("OPTOPAD_CACHE", str(blocked))
    monkeypatch.setattr(stored_press, "_SOLVED", {})
    monkeypatch.setattr(stored_press, "_solve", lambda *_: coarse_press.unit)
    press = solved_press(contact_of(check_design), mesh_mm=0.45)
    # the same states for both Poisson's ratios leave nothing to extrapolate
    expected = fit_press(coarse_press.unit).force_at(1 / 3)
    assert press.smooth.force_at(1 / 3) == pytest.approx(expected, rel=1e-9)
    assert len(press.notes) == 2
    assert "solved live" in press.notes[0]
    assert "OPTOPAD_CACHE" in press.notes[1]


def test_a_damaged_entry_is_solved_again_and_replaced(
    folder: Path, monkeypatch: pytest.MonkeyPatch, check_design: SensorDesign, coarse_press: SolvedPress
) -> None:
    calls = []

    def solve(*_: object) -> UnitPress:
        calls.append(1)
        return coarse_press.unit

    monkeypatch.setattr(stored_press, "_solve", solve)
    for damage in (False, True, False):
        monkeypatch.setattr(stored_press, "_SOLVED", {})
        for path in folder.glob("*.npz") if damage else ():
            path.write_bytes(b"not a zip file")
        assert len(solved_press(contact_of(check_design), mesh_mm=0.45).notes) == 1
    # both Poisson's ratios, twice
    assert len(calls) == 4


def _write_often(folder: str, press: UnitPress) -> None:
    os.environ["OPTOPAD_CACHE"] = folder
    for _ in range(20):
        assert write_entry(KEY, press) is None


@pytest.mark.slow
def test_racing_writers_leave_one_whole_entry(folder: Path, coarse_press: SolvedPress) -> None:
    context = multiprocessing.get_context("spawn")
    writers = [
        context.Process(target=_write_often, args=(str(folder.parent), coarse_press.unit)) for _ in range(2)
    ]
    for writer in writers:
        writer.start()
    seen = 0
    while any(writer.is_alive() for writer in writers):
        found = read_entry(KEY)
        if found is not None:
            seen += 1
            assert found.force[-1] == coarse_press.unit.force[-1]
    for writer in writers:
        writer.join()
        assert writer.exitcode == 0
    assert seen > 0
    assert [path.name for path in folder.iterdir()] == [f"{KEY}.npz"]


def test_an_entry_holds_no_pickles(folder: Path, coarse_press: SolvedPress) -> None:
    write_entry(KEY, coarse_press.unit)
    with np.load(entry_path(KEY), allow_pickle=False) as entry:
        assert {entry[name].dtype.kind for name in entry.files} <= {"f", "U"}


@pytest.mark.parametrize("keep", [0, 1, 200, -400, -1])
def test_a_cut_entry_counts_as_absent(folder: Path, coarse_press: SolvedPress, keep: int) -> None:
    write_entry(KEY, coarse_press.unit)
    whole = entry_path(KEY).read_bytes()
    entry_path(KEY).write_bytes(whole[:keep])
    assert read_entry(KEY) is None
