"""The bundle: complete or absent, whatever interrupts the work."""

from __future__ import annotations

import errno
import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
import threading
from pathlib import Path
from typing import NoReturn

import pytest

from optopad.cli import main
from optopad.design.errors import DesignError, InputError, OutputError
from optopad.design.io import load_design
from optopad.design.preset import preset
from optopad.design.spec import SensorDesign
from optopad.fabrication import bundle as module
from optopad.fabrication.bundle import (
    MANIFEST,
    Part,
    altered_files,
    bundle,
    bundle_name,
    copy_part,
    current_files,
    with_other_line_ends,
)

PAD = preset("piacenza2017-pad")
ROOT = Path(__file__).parents[2]


def make(out: Path, content: str = "one", design: SensorDesign = PAD, seed: int = 0) -> Path:
    with bundle(design, out, seed=seed) as folder:
        (folder / "sims").mkdir(exist_ok=True)
        (folder / "sims" / "score.json").write_text(content)
    return out / bundle_name(design)


def names(out: Path) -> list[str]:
    return sorted(path.name for path in out.iterdir())


def fail_after_writing(out: Path) -> NoReturn:
    with bundle(PAD, out, seed=0) as folder:
        (folder / "sims").mkdir(exist_ok=True)
        (folder / "sims" / "score.json").write_text("half")
        raise RuntimeError("broken")


def full_disk(*_: object, **__: object) -> NoReturn:
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


WRITER = """
import sys, time
from pathlib import Path
from optopad.design.preset import preset
from optopad.fabrication.bundle import bundle
name, out = sys.argv[1], Path(sys.argv[2])
with bundle(preset("piacenza2017-pad"), out, seed=0) as folder:
    (folder / name).write_text(name)
    print("begun", flush=True)
    sys.stdin.readline()
"""


def started_writer(name: str, out: Path) -> subprocess.Popen[str]:
    """A process that has begun to write a file of this name, and goes on when it is told to."""
    process = subprocess.Popen(
        [sys.executable, "-c", WRITER, name, str(out)],
        cwd=ROOT,
        text=True,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "begun\n"
    return process


def test_a_bundle_is_named_by_design_and_digest_and_leaves_nothing_beside_it(tmp_path: Path) -> None:
    folder = make(tmp_path)
    assert names(tmp_path) == [f"piacenza2017-pad-{PAD.digest[:8]}"] == [folder.name]
    assert sorted(path.name for path in folder.iterdir()) == ["design.toml", MANIFEST, "sims"]


def test_the_manifest_has_size_and_sha256_of_every_file_but_itself(tmp_path: Path) -> None:
    folder = make(tmp_path, "content", seed=7)
    manifest = json.loads((folder / MANIFEST).read_text())
    assert sorted(manifest["files"]) == ["design.toml", "sims/score.json"]
    record = manifest["files"]["sims/score.json"]
    assert record["sha256"] == hashlib.sha256(b"content").hexdigest()
    assert record["bytes"] == 7
    assert (manifest["digest"], manifest["seed"]) == (PAD.digest, 7)
    assert set(manifest["versions"]) == {"python", *module.RECORDED_PACKAGES}


def test_a_file_kept_from_an_earlier_run_keeps_that_run_s_seed(tmp_path: Path) -> None:
    make(tmp_path, seed=1)
    with bundle(PAD, tmp_path, seed=2) as folder:
        (folder / "new.txt").write_text("new")
    manifest = json.loads((tmp_path / bundle_name(PAD) / MANIFEST).read_text())
    seeds = {name: manifest["runs"][record["run"]]["seed"] for name, record in manifest["files"].items()}
    assert seeds == {"design.toml": 1, "sims/score.json": 1, "new.txt": 2}
    assert manifest["seed"] == 2


@pytest.mark.parametrize("damage", ["", "[]", '{"runs": [], "files": {"a": {"run": 4}}}'])
def test_a_damaged_manifest_does_not_stop_the_next_run(tmp_path: Path, damage: str) -> None:
    folder = make(tmp_path)
    (folder / MANIFEST).write_text(damage)
    make(tmp_path, seed=5)
    assert altered_files(folder) == ()
    assert json.loads((folder / MANIFEST).read_text())["seed"] == 5


def test_nothing_is_left_when_the_work_fails(tmp_path: Path) -> None:
    with pytest.raises(RuntimeError, match="broken"):
        fail_after_writing(tmp_path)
    assert names(tmp_path) == []


def test_the_old_bundle_stays_when_the_work_fails(tmp_path: Path) -> None:
    folder = make(tmp_path, "old")
    with pytest.raises(RuntimeError, match="broken"):
        fail_after_writing(tmp_path)
    assert (folder / "sims" / "score.json").read_text() == "old"
    assert altered_files(folder) == ()
    assert names(tmp_path) == [folder.name]


@pytest.mark.parametrize("step", ["save_design", "write_manifest", "_flush", "_swap"])
def test_the_old_bundle_stays_when_the_disk_is_full(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, step: str
) -> None:
    folder = make(tmp_path, "old")
    monkeypatch.setattr(module, step, full_disk)
    with pytest.raises(OutputError, match="left on device"):
        make(tmp_path, "new")
    assert (folder / "sims" / "score.json").read_text() == "old"
    assert altered_files(folder) == ()
    assert names(tmp_path) == [folder.name]


def test_a_disk_that_fills_while_the_old_bundle_is_copied_leaves_nothing_beside_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = make(tmp_path)

    def half_copied(source: Path, target: Path, **_: object) -> NoReturn:
        target.mkdir()
        (target / "design.toml").write_text("half")
        full_disk()

    monkeypatch.setattr(shutil, "copytree", half_copied)
    with pytest.raises(OutputError, match="earlier bundle"):
        make(tmp_path)
    assert names(tmp_path) == [folder.name]


def test_the_old_bundle_comes_back_when_the_new_one_cannot_take_its_place(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = make(tmp_path, "old")
    plain = Path.rename

    def refuse_the_new_one(self: Path, target: Path) -> Path:
        if self.name.endswith(".partial"):
            raise OSError(errno.EACCES, os.strerror(errno.EACCES))
        return plain(self, target)

    monkeypatch.setattr(Path, "rename", refuse_the_new_one)
    with pytest.raises(OutputError, match="Permission denied"):
        make(tmp_path, "new")
    assert (folder / "sims" / "score.json").read_text() == "old"
    assert names(tmp_path) == [folder.name]


def test_a_folder_that_may_not_be_written_is_refused_with_the_way_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(self: Path, *_: object, **__: object) -> NoReturn:
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(self))

    monkeypatch.setattr(Path, "mkdir", refuse)
    with pytest.raises(OutputError, match=r"Permission denied; .* --out"):
        make(tmp_path / "out")


def test_a_file_in_the_place_of_the_folder_is_refused(tmp_path: Path) -> None:
    (tmp_path / "out").write_text("a file")
    with pytest.raises(OutputError, match="cannot be written"):
        make(tmp_path / "out")
    assert (tmp_path / "out").read_text() == "a file"


def test_an_error_about_a_file_elsewhere_is_not_blamed_on_the_bundle(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match="missing"), bundle(PAD, tmp_path / "out", seed=0):
        (tmp_path / "missing").read_text()
    assert names(tmp_path / "out") == []


def test_leftovers_of_a_process_that_was_killed_are_swept_and_work_under_way_is_not(tmp_path: Path) -> None:
    killed, running = (started_writer(name, tmp_path) for name in ("killed", "running"))
    assert len(names(tmp_path)) == 2
    killed.kill()
    killed.communicate()
    folder = make(tmp_path)
    assert len(names(tmp_path)) == 2
    assert running.communicate("\n", timeout=30) == ("", None)
    assert running.returncode == 0
    assert names(tmp_path) == [folder.name]
    assert sorted(path.name for path in folder.iterdir()) == ["design.toml", MANIFEST, "running", "sims"]


def test_threads_that_write_one_bundle_at_a_time_keep_all_their_files(tmp_path: Path) -> None:
    meet, staged, failed = threading.Barrier(4), set(), []

    def write(name: str) -> None:
        try:
            with bundle(PAD, tmp_path, seed=0) as folder:
                staged.add(folder)
                (folder / "sims").mkdir(exist_ok=True)
                (folder / "sims" / name).write_text(name)
                meet.wait(30)
        except BaseException as err:
            failed.append(err)

    make(tmp_path)
    for _ in range(3):
        threads = [threading.Thread(target=write, args=(name,)) for name in "abcd"]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    assert failed == []
    assert len(staged) == 12
    folder = tmp_path / bundle_name(PAD)
    assert names(tmp_path) == [folder.name]
    assert sorted(path.name for path in (folder / "sims").iterdir()) == ["a", "b", "c", "d", "score.json"]
    assert altered_files(folder) == ()
    assert set(json.loads((folder / MANIFEST).read_text())["files"]) >= {f"sims/{name}" for name in "abcd"}


@pytest.mark.slow
def test_processes_that_write_one_bundle_at_a_time_keep_all_their_files(tmp_path: Path) -> None:
    processes = [started_writer(name, tmp_path) for name in "abc"]
    for process in processes:
        assert process.stdin is not None
        process.stdin.write("\n")
        process.stdin.flush()
    for process in processes:
        process.communicate(timeout=30)
        assert process.returncode == 0
    folder = tmp_path / bundle_name(PAD)
    assert names(tmp_path) == [folder.name]
    assert sorted(path.name for path in folder.iterdir()) == ["a", "b", "c", "design.toml", MANIFEST]
    assert altered_files(folder) == ()


def test_files_that_the_user_adds_meanwhile_are_kept(tmp_path: Path) -> None:
    folder = make(tmp_path)
    with bundle(PAD, tmp_path, seed=0):
        (folder / "notes.txt").write_text("mine")
        (folder / "sims" / "score.json").unlink()
    assert (folder / "notes.txt").read_text() == "mine"
    assert not (folder / "sims" / "score.json").exists()
    assert altered_files(folder) == ()


def test_a_bundle_that_is_a_link_is_refused_each_time_and_nothing_is_written(tmp_path: Path) -> None:
    elsewhere = make(tmp_path / "big", "old")
    (tmp_path / "out").mkdir()
    link = tmp_path / "out" / bundle_name(PAD)
    link.symlink_to(elsewhere)
    for _ in range(2):
        with pytest.raises(OutputError, match="folder; remove"):
            make(tmp_path / "out", "new")
        assert names(tmp_path / "out") == [link.name]
        assert link.is_symlink()
        assert (elsewhere / "sims" / "score.json").read_text() == "old"
    link.unlink()
    link.symlink_to(tmp_path / "gone")
    with pytest.raises(OutputError, match="is a link"):
        make(tmp_path / "out")
    (tmp_path / "linked").symlink_to(tmp_path / "big")  # the folder that holds the bundles may be one
    make(tmp_path / "linked", "new")
    assert (elsewhere / "sims" / "score.json").read_text() == "new"


@pytest.mark.parametrize("name", [*module.FOLDERS, "sims/models", "fabrication/firmware"])
def test_a_linked_folder_in_a_bundle_is_not_written_through(tmp_path: Path, name: str) -> None:
    folder = make(tmp_path / "out")
    (tmp_path / "elsewhere").mkdir()
    (folder / name).parent.mkdir(exist_ok=True)
    shutil.rmtree(folder / name, ignore_errors=True)
    (folder / name).symlink_to(tmp_path / "elsewhere")
    with pytest.raises(OutputError, match=f"{name}"):
        make(tmp_path / "out", "new")
    assert list((tmp_path / "elsewhere").iterdir()) == []
    assert names(tmp_path / "out") == [folder.name]
    assert (folder / name).is_symlink()


def test_all_folders_that_commands_write_into_are_guarded_against_links() -> None:
    sources = (path.read_text() for path in (ROOT / "optopad").rglob("*.py"))
    named = {name for source in sources for name in re.findall(r'\bfolder / "(\w+)"', source)}
    assert named - {"designs"} == set(module.FOLDERS)  # designs: of a search, which is no bundle


def test_a_change_of_places_that_was_cut_short_is_put_back(tmp_path: Path) -> None:
    folder = make(tmp_path, "old")
    (folder / "kept.txt").write_text("kept")
    folder.rename(tmp_path / f".{folder.name}.old")
    with pytest.raises(RuntimeError), bundle(PAD, tmp_path, seed=0):
        raise RuntimeError  # even a run that fails restores it
    assert (folder / "kept.txt").read_text() == "kept"
    assert names(tmp_path) == [folder.name]


def test_a_second_command_keeps_what_the_first_one_made(tmp_path: Path) -> None:
    make(tmp_path, "first")
    with bundle(PAD, tmp_path, seed=0) as folder:
        (folder / "second.txt").write_text("second")
    folder = tmp_path / bundle_name(PAD)
    assert (folder / "sims" / "score.json").read_text() == "first"
    assert (folder / "second.txt").read_text() == "second"
    assert altered_files(folder) == ()


def test_a_part_of_single_files_has_inputs_of_its_own_and_is_copied_to_another_bundle(tmp_path: Path) -> None:
    shape, rest = Part({"shape": 1}, ("sims/plot-a.svg",)), Part({"gain": 1}, ("sims/",))
    with bundle(PAD, tmp_path, seed=0, parts=(shape, rest)) as folder:
        (folder / "sims").mkdir()
        for name in ("plot-a.svg", "plot-b.svg"):
            (folder / "sims" / name).write_text(name)
    first = tmp_path / bundle_name(PAD)
    assert current_files(first, shape) == ["sims/plot-a.svg"]
    assert current_files(first, rest) == ["sims/plot-b.svg"]
    other = Part({"gain": 2}, ("sims/",))
    with bundle(PAD.with_(**{"gain.target_counts": 301.0}), tmp_path, seed=0, parts=(shape, other)) as folder:
        assert copy_part(shape, folder, tmp_path, PAD.name) == ["sims/plot-a.svg"]
        assert copy_part(other, folder, tmp_path, PAD.name) == []
        assert copy_part(Part({"shape": 2}, shape.folders), folder, tmp_path, PAD.name) == []
        assert (folder / "sims" / "plot-a.svg").read_text() == "plot-a.svg"
    (first / "sims" / "plot-a.svg").write_text("edited")
    assert current_files(first, shape) == []


OTHER = """
from pathlib import Path
from optopad.design.preset import preset
from optopad.fabrication.bundle import bundle
with bundle(preset("piacenza2017-pad"), Path({out!r}), seed=7) as folder:
    (folder / "both.txt").write_text("other")
    (folder / "gone.txt").unlink()
    (folder / "new").mkdir()
    (folder / "new" / "other.txt").write_text("other")
"""


@pytest.mark.slow
def test_a_command_keeps_what_another_has_finished_meanwhile(tmp_path: Path) -> None:
    with bundle(PAD, tmp_path, seed=0) as folder:
        for name in ("gone", "both", "kept"):
            (folder / f"{name}.txt").write_text("old")
    with bundle(PAD, tmp_path, seed=3) as folder:
        program = OTHER.format(out=str(tmp_path))
        subprocess.run([sys.executable, "-c", program], cwd=ROOT, check=True, timeout=60)
        (folder / "both.txt").write_text("own")
        (folder / "own.txt").write_text("own")
    folder = tmp_path / bundle_name(PAD)
    assert names(tmp_path) == [folder.name]
    assert not (folder / "gone.txt").exists()
    assert (folder / "new" / "other.txt").read_text() == "other"
    assert (folder / "both.txt").read_text() == "own"
    assert altered_files(folder) == ()
    document = json.loads((folder / MANIFEST).read_text())
    seeds = {name: document["runs"][record["run"]]["seed"] for name, record in document["files"].items()}
    assert seeds == {"both.txt": 3, "design.toml": 0, "kept.txt": 0, "new/other.txt": 7, "own.txt": 3}


def test_an_interrupt_between_the_changes_of_places_puts_the_old_bundle_back(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = make(tmp_path, "old")
    rename = Path.rename

    def interrupted(self: Path, target: Path) -> Path:
        moved = rename(self, target)
        if target.name.endswith(".old"):
            raise KeyboardInterrupt
        return moved

    monkeypatch.setattr(Path, "rename", interrupted)
    with pytest.raises(KeyboardInterrupt):
        make(tmp_path, "new")
    assert names(tmp_path) == [folder.name]
    assert (folder / "sims" / "score.json").read_text() == "old"


@pytest.mark.parametrize("name", ["a..b", "a-", "A_1", "con-1"])
def test_every_allowed_name_stays_in_the_folder(tmp_path: Path, name: str) -> None:
    folder = make(tmp_path, design=PAD.with_(name=name))
    assert folder.resolve().parent == tmp_path.resolve()
    assert names(tmp_path) == [folder.name]


def test_changed_and_missing_files_are_named_and_new_ones_are_not(tmp_path: Path) -> None:
    folder = make(tmp_path)
    assert altered_files(folder) == ()
    (folder / "sims" / "score.json").write_text("twO")
    (folder / "design.toml").unlink()
    (folder / "notes.txt").write_text("mine")
    assert altered_files(folder) == ("design.toml", "sims/score.json")


def test_files_of_other_line_ends_are_one_line_on_the_screen(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with bundle(PAD, tmp_path, seed=0) as made:
        for name in ("report.html", "a.csv", "b.svg", "c.toml"):
            (made / name).write_text("one\ntwo\n")
        (made / "windows.csv").write_bytes(b"one\r\ntwo\r\n")
    folder = tmp_path / bundle_name(PAD)
    for file in folder.glob("*.*"):  # as git does with core.autocrlf
        file.write_bytes(file.read_bytes().replace(b"\r\n", b"\n").replace(b"\n", b"\r\n"))
    (folder / "windows.csv").write_bytes(b"one\ntwo\n")
    (folder / "b.svg").write_bytes(b"one\r\nthree\r\n")
    altered = altered_files(folder)
    assert altered == ("a.csv", "b.svg", "c.toml", "design.toml", "report.html", "windows.csv")
    assert with_other_line_ends(folder, altered) == tuple(name for name in altered if name != "b.svg")
    assert main(["report", str(folder)]) == 0
    warnings = [line for line in capsys.readouterr().out.splitlines() if line.startswith("warning")]
    assert len(warnings) == 2
    assert "5 files" in warnings[0]
    assert "* -text" in warnings[0]
    assert "b.svg differs" in warnings[1]


def test_a_folder_without_manifest_is_no_bundle(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no bundle"):
        altered_files(tmp_path)


@pytest.mark.parametrize("text", ["{", "[]", '{"files": {"a": 1}}', '{"files": []}'])
def test_a_damaged_manifest_is_reported(tmp_path: Path, text: str) -> None:
    (tmp_path / MANIFEST).write_text(text)
    with pytest.raises(InputError, match="damaged"):
        altered_files(tmp_path)


def test_a_link_in_a_bundle_is_copied_as_a_link(tmp_path: Path) -> None:
    folder = make(tmp_path)
    (tmp_path / "big").mkdir()
    (folder / "link").symlink_to(tmp_path / "big", target_is_directory=True)
    make(tmp_path, "again")
    assert (folder / "link").is_symlink()


def test_the_design_in_a_bundle_has_the_same_digest(tmp_path: Path) -> None:
    assert load_design(make(tmp_path) / "design.toml").digest == PAD.digest


def test_nothing_is_left_when_the_user_interrupts(tmp_path: Path) -> None:
    with pytest.raises(KeyboardInterrupt), bundle(PAD, tmp_path, seed=0):
        raise KeyboardInterrupt
    assert names(tmp_path) == []


def test_a_link_that_an_earlier_version_left_of_a_former_bundle_is_removed(tmp_path: Path) -> None:
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "elsewhere" / "kept").write_text("kept")
    folder = make(tmp_path)
    (tmp_path / f".{folder.name}.old").symlink_to(tmp_path / "elsewhere")
    make(tmp_path, "new")
    assert names(tmp_path) == sorted([folder.name, "elsewhere"])
    assert (tmp_path / "elsewhere" / "kept").read_text() == "kept"


def test_a_change_of_places_that_was_cut_short_at_its_end_is_tidied_up(tmp_path: Path) -> None:
    folder = make(tmp_path, "new")
    shutil.copytree(folder, tmp_path / f".{folder.name}.old")
    make(tmp_path, "newer")
    assert (folder / "sims" / "score.json").read_text() == "newer"
    assert names(tmp_path) == [folder.name]


@pytest.mark.parametrize("name", ["../out", "a/b", "..", ".hidden", "a\\b/c", "/abs", "a\n", "", "a.", "CON"])
def test_no_name_leads_out_of_the_folder(name: str) -> None:
    with pytest.raises(DesignError, match="name"):
        PAD.with_(name=name)


def test_the_same_run_twice_is_recorded_once(tmp_path: Path) -> None:
    make(tmp_path, "one", seed=3)
    manifest = json.loads((make(tmp_path, "two", seed=3) / MANIFEST).read_text())
    assert [run["seed"] for run in manifest["runs"]] == [3]
    assert {record["run"] for record in manifest["files"].values()} == {0}


def test_what_an_earlier_version_left_is_swept_and_other_designs_work_is_not(tmp_path: Path) -> None:
    left = tmp_path / f".{bundle_name(PAD)}.4711.partial"
    other = tmp_path / f".{bundle_name(PAD)}.x-12345678.4711.partial"
    for folder in (left, other):
        folder.mkdir()
        (folder / "half.txt").write_text("half")
    folder = make(tmp_path)
    assert names(tmp_path) == sorted([folder.name, other.name])
    assert not (folder / "half.txt").exists()


def test_designs_that_differ_have_bundles_of_their_own(tmp_path: Path) -> None:
    thick = PAD.with_(**{"cavity.clear_thickness_mm": 10.0})
    assert make(tmp_path, "a") != make(tmp_path, "b", design=thick)
    assert len(names(tmp_path)) == 2
