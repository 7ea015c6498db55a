"""Files written together: whatever step a process dies at, a folder holds files of one generation."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import pytest

from optopad.design.errors import OutputError
from optopad.design.file_sets import settle, written_together
from optopad.design.files import ABANDONED_S, locked, whole_file, whole_folder
from optopad.design.io import load_design, save_design
from optopad.design.preset import preset

ROOT = Path(__file__).parents[2]
OLD, NEW = dict.fromkeys(("a", "b", "gone"), "old"), dict.fromkeys(("a", "b", "c"), "new")
DIES = """
import os, sys
from pathlib import Path
from optopad.design.file_sets import written_together

replace, left = os.replace, [int(sys.argv[2])]

def dies(*given):
    if not left[0]:
        os._exit(9)
    left[0] -= 1
    replace(*given)

os.replace = dies
with written_together(Path(sys.argv[1]), stale=["gone"]) as made:
    for name in "abc":
        (made / name).write_text("new")
    if sys.argv[2] == "-1":
        os._exit(9)
"""
"""Write a new generation, and die before step so many of moving it; -1 is before the first."""
STEPS = 7
"""The commit, three old files out, three new ones in."""


def written(folder: Path, files: dict[str, str], stale: Sequence[str] = ()) -> None:
    with written_together(folder, stale) as made:
        for name, text in files.items():
            (made / name).write_text(text)


def held(folder: Path) -> dict[str, str]:
    return {path.name: path.read_text() for path in folder.iterdir() if path.is_file()}


def dead(folder: Path, step: int) -> int:
    return subprocess.run(
        [sys.executable, "-c", DIES, str(folder), str(step)], cwd=ROOT, check=False
    ).returncode


def test_after_a_kill_at_any_step_a_folder_holds_one_generation_and_the_next_reader_all_of_it(
    tmp_path: Path,
) -> None:
    for step in range(-1, STEPS):
        folder = tmp_path / str(step)
        written(folder, OLD)
        assert dead(folder, step) == 9
        assert len(set(held(folder).values())) <= 1, step
        settle(folder)
        assert held(folder) == (OLD if step < 1 else NEW), step
        assert len(os.listdir(folder)) == 3
    written(tmp_path / "whole", OLD)
    assert dead(tmp_path / "whole", STEPS) == 0
    assert held(tmp_path / "whole") == NEW


def test_reading_a_design_completes_the_generation_that_it_belongs_to(tmp_path: Path) -> None:
    file = tmp_path / "a"
    for name, folder in (("piacenza2017-pad", tmp_path), ("piacenza2017-pair", tmp_path / "other")):
        folder.mkdir(exist_ok=True)
        save_design(preset(name), folder / "a")
    assert dead(tmp_path, 2) == 9
    ready = next(tmp_path.glob(".optopad-*.ready"))
    (ready / "new" / "a").write_bytes((tmp_path / "other" / "a").read_bytes())
    assert load_design(file).digest == preset("piacenza2017-pair").digest


def test_a_failure_at_any_step_brings_the_former_generation_back(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    replace = os.replace
    for step in range(STEPS):
        folder, calls = tmp_path / str(step), iter(range(100))
        written(folder, OLD)

        def fails(*given: str, calls=calls, step=step) -> None:
            if next(calls) == step:
                raise OSError(13, "in use")
            replace(*given)

        with monkeypatch.context() as patch:
            patch.setattr(os, "replace", fails)
            with pytest.raises(OutputError, match="in use"):
                written(folder, NEW, stale=["gone"])
        assert held(folder) == OLD, step
        assert len(os.listdir(folder)) == 3


def test_a_folder_in_the_way_of_a_file_is_kept(tmp_path: Path) -> None:
    (tmp_path / "a").mkdir()
    with pytest.raises(OutputError, match="Is a directory"):
        written(tmp_path, NEW)
    assert os.listdir(tmp_path) == ["a"]


@pytest.mark.skipif(os.name == "nt", reason="it has no locks of folders")
def test_hidden_folders_of_dead_processes_are_swept_and_those_of_living_ones_kept(tmp_path: Path) -> None:
    of_another = tmp_path / ".download.partial"
    living, left = (tmp_path / f".optopad-{name * 8}.partial" for name in "ab")
    for folder in (of_another, living, left):
        folder.mkdir()
    lock = locked(living)
    try:
        written(tmp_path, OLD)
    finally:
        os.close(lock)
    assert {path.name for path in tmp_path.iterdir() if path.is_dir()} == {of_another.name, living.name}


@pytest.mark.skipif(os.name == "nt", reason="it has no locks of folders")
def test_what_dead_writers_of_a_file_or_folder_left_is_swept_by_the_next_one(tmp_path: Path) -> None:
    old, young = (tmp_path / f".a.txt.{name * 8}.partial" for name in "ab")
    for file in (old, young):
        file.write_text("half")
    os.utime(old, (time.time() - 2 * ABANDONED_S,) * 2)
    left = tmp_path / ".made.cccccccc.partial"
    left.mkdir()
    with whole_file(tmp_path / "a.txt") as file:
        file.write_text("whole")
    with whole_folder(tmp_path / "made") as first:
        assert first.is_dir()
        with whole_folder(tmp_path / "other"):
            assert first.is_dir()
    assert sorted(os.listdir(tmp_path)) == [young.name, "a.txt", "made", "other"]
