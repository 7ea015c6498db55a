"""Files are written whole or not at all, under names that every system takes; refusals say what is true."""

from __future__ import annotations

import errno
import os
import shutil
import threading
from pathlib import Path
from typing import Annotated, Any, NoReturn

import pytest
from pydantic import BaseModel, TypeAdapter, ValidationError

from optopad.design.errors import InputError, OutputError
from optopad.design.file_sets import written_together
from optopad.design.files import (
    folder_fault,
    name_fault,
    own_folder,
    require_file_name,
    temporary_folder,
    whole_file,
    write_whole,
)
from optopad.design.io import save_design, write_text_atomically
from optopad.design.preset import preset
from optopad.design.press_protocol import PressProtocol, PressSet
from optopad.design.search.space import SearchSpace
from optopad.design.spec import SensorDesign

DEVICES = ["CON", "con", "Prn", "AUX", "nul", "COM1", "com9", "LPT1", "lpt9", "LPT²", "CONIN$"]
WRITERS = {
    "write_whole": lambda file: write_whole(file, b"new"),
    "write_text_atomically": lambda file: write_text_atomically(file, "new"),
    "save_design": lambda file: save_design(preset("piacenza2017-pair"), file),
}


def refuse(number: int) -> Any:
    def refused(*_: object, **__: object) -> NoReturn:
        raise OSError(number, os.strerror(number))

    return refused


@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize("end", ["", ".toml", ".tar.gz", ".", " ", " .txt"])
def test_a_device_name_of_windows_is_no_name_of_a_file(device: str, end: str, tmp_path: Path) -> None:
    assert "device on Windows" in str(name_fault(device + end))
    with pytest.raises(InputError, match="--out: "):
        require_file_name(tmp_path / (device + end), "--out: ")


@pytest.mark.parametrize("model", [SensorDesign, PressProtocol, PressSet, SearchSpace])
@pytest.mark.parametrize("name", ["CON", "aux.x", "a."])
def test_every_name_that_files_are_named_after_is_checked(model: type[BaseModel], name: str) -> None:
    field = model.model_fields["name"]
    taken: TypeAdapter[str] = TypeAdapter(Annotated[(field.annotation, *field.metadata)])
    assert taken.validate_python("console") == "console"
    with pytest.raises(ValidationError, match="Windows"):
        taken.validate_python(name)


@pytest.mark.parametrize("writer", WRITERS)
def test_every_writer_replaces_whole_files_and_leaves_links_targets_alone(
    tmp_path: Path, writer: str
) -> None:
    (tmp_path / "elsewhere.toml").write_text("kept")
    file = tmp_path / "a.toml"
    file.symlink_to(tmp_path / "elsewhere.toml")
    WRITERS[writer](file)
    assert not file.is_symlink()
    assert (tmp_path / "elsewhere.toml").read_text() == "kept"
    assert sorted(os.listdir(tmp_path)) == ["a.toml", "elsewhere.toml"]
    assert file.stat().st_mode & 0o777 == 0o644


@pytest.mark.parametrize("writer", WRITERS)
@pytest.mark.parametrize(
    ("number", "words"),
    [(errno.ENOSPC, "free some room"), (errno.EROFS, "; choose another folder")],
)
def test_every_writer_keeps_the_old_file_and_gives_the_true_reason(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, writer: str, number: int, words: str
) -> None:
    (tmp_path / "a.toml").write_text("old")
    monkeypatch.setattr(os, "replace", refuse(number))
    with pytest.raises(OutputError, match=os.strerror(number)) as caught:
        WRITERS[writer](tmp_path / "a.toml")
    assert words in str(caught.value)
    assert ("free" in str(caught.value)) == (number == errno.ENOSPC)
    assert (tmp_path / "a.toml").read_text() == "old"
    assert os.listdir(tmp_path) == ["a.toml"]


@pytest.mark.parametrize("writer", WRITERS)
@pytest.mark.parametrize("name", ["con.toml", "a\0b.toml", "x" * 300])
def test_every_writer_refuses_names_that_cannot_be(tmp_path: Path, writer: str, name: str) -> None:
    with pytest.raises((InputError, OutputError), match="name"):
        WRITERS[writer](tmp_path / name)
    assert os.listdir(tmp_path) == []


def test_threads_that_write_one_file_at_a_time_do_not_meet(tmp_path: Path) -> None:
    file, hidden, meet = tmp_path / "a.txt", set(), threading.Barrier(4)

    def write(content: str) -> None:
        with whole_file(file) as part:
            hidden.add(part)
            part.write_text(content)
            meet.wait(10)

    threads = [threading.Thread(target=write, args=(one * 1000,)) for one in "abcd"]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(hidden) == 4
    assert file.read_text() in {one * 1000 for one in "abcd"}
    assert os.listdir(tmp_path) == ["a.txt"]


def test_an_interrupted_write_leaves_nothing(tmp_path: Path) -> None:
    with pytest.raises(KeyboardInterrupt), whole_file(tmp_path / "a.txt"):
        raise KeyboardInterrupt
    assert os.listdir(tmp_path) == []


def test_folders_whose_files_are_replaced_are_not_links_and_folders_that_the_user_names_may_be(
    tmp_path: Path,
) -> None:
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(OutputError, match="written through links"):
        own_folder(tmp_path / "link")
    assert own_folder(tmp_path / "link" / "new") == tmp_path / "link" / "new"
    with written_together(tmp_path / "link") as hidden:
        (hidden / "a.txt").write_text("a")
    assert sorted(os.listdir(tmp_path / "elsewhere")) == ["a.txt", "new"]


def test_a_folder_is_refused_with_what_is_wrong(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").write_text("")
    (tmp_path / "lost").symlink_to(tmp_path / "nowhere")
    assert folder_fault(tmp_path) is folder_fault(tmp_path / "new" / "deep") is None
    assert "a folder" in folder_fault(tmp_path / "file")
    assert f"{tmp_path / 'file'}" in folder_fault(tmp_path / "file" / "new")
    assert "leads nowhere" in str(folder_fault(tmp_path / "lost"))
    assert "null byte" in str(folder_fault(tmp_path / "a\0b"))
    with monkeypatch.context() as patch:
        patch.setattr(shutil, "disk_usage", lambda _: shutil._ntuple_diskusage(1, 1, 0))  # type: ignore[attr-defined]
        assert folder_fault(tmp_path) == "its disk is full"
    monkeypatch.setattr("tempfile.mkdtemp", refuse(errno.EROFS))
    assert folder_fault(tmp_path) == "it is not writable (Read-only file system)"
    monkeypatch.setattr("tempfile.mkdtemp", refuse(errno.ENOSPC))
    assert folder_fault(tmp_path) == "its disk is full"
    assert sorted(os.listdir(tmp_path)) == ["file", "lost"]


def test_without_a_folder_for_temporary_files_the_way_out_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tempfile.TemporaryDirectory", refuse(errno.ENOENT))
    with pytest.raises(OutputError, match="TMPDIR"):
        temporary_folder()


@pytest.mark.parametrize("name", ["con-1", "console.toml", "COM10", "com", "lpt0", "a.con", "nul_", ".con"])
def test_names_that_only_resemble_devices_are_taken(name: str) -> None:
    assert name_fault(name) is None
