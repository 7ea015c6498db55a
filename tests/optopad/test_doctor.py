"""Findings of the doctor, with libraries, folders and tools taken away."""

from __future__ import annotations

import errno
import json
import os
import resource
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path
from typing import Any

import pytest

from optopad import doctor
from optopad.cli import main
from optopad.doctor import Requirement, explain_import_error
from tests.said import says

ROOT = Path(__file__).parents[2]


def missing_library(text: str) -> ImportError:
    return ImportError(text, name="cadquery")


def child_cpu_s() -> float:
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


@pytest.fixture(scope="module")
def examined() -> tuple[list[Requirement], float]:
    """What the doctor finds here, and the processor time it takes: the clock of a busy machine says little."""
    before = child_cpu_s()
    findings = doctor.examine()
    return findings, child_cpu_s() - before


@pytest.mark.slow
def test_every_finding_that_is_not_ok_has_a_way_out_and_it_takes_less_than_10_s(
    examined: tuple[list[Requirement], float],
) -> None:
    findings, taken_s = examined
    assert taken_s < 10
    assert len({finding.name for finding in findings}) == len(findings)
    assert [finding for finding in findings if finding.state != "ok" and not finding.way_out] == []


@pytest.fixture
def without_imports(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every import is taken to succeed: trying them takes seconds."""
    monkeypatch.setattr(doctor, "import_failures", lambda modules: [None] * len(modules))


@pytest.mark.usefixtures("without_imports")
def test_every_finding_has_a_name_of_its_own_and_a_way_out_where_it_is_not_ok() -> None:
    findings = doctor.examine()
    assert len({finding.name for finding in findings}) == len(findings)
    assert [finding for finding in findings if finding.state != "ok" and not finding.way_out] == []


@pytest.mark.usefixtures("without_imports")
def test_doctor_speaks_json(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["doctor", "--json"]) == 0
    names = {finding["name"] for finding in json.loads(capsys.readouterr().out)["findings"]}
    assert {"python", "cadquery", "mujoco"} <= names


def test_packages_and_their_oldest_versions_are_those_of_pyproject() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    lines = project["dependencies"] + project["optional-dependencies"]["design"]
    needs = dict(line.split(",")[0].split(">=") for line in lines if "python_version" not in line)
    declared = sorted(map(list, needs.items()))
    assert [[package.distribution, package.at_least] for package in doctor.PACKAGES] == declared


def test_python_range_is_that_of_make_setup_and_ends_with_that_of_pyproject() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    first, beyond = doctor.PYTHON_RANGE
    assert f"{first} <= sys.version_info < {beyond}" in (ROOT / "Makefile").read_text()
    assert project["requires-python"] == ">=3.10,<{}.{}".format(*beyond)


@pytest.mark.parametrize(
    ("version", "state"), [((3, 10, 13), "missing"), ((3, 11, 0), "ok"), ((3, 14, 0), "missing")]
)
def test_python_outside_the_range_is_missing(version: tuple[int, ...], state: str) -> None:
    assert doctor.python_finding(version).state == state


def test_a_missing_libgl_is_named_with_its_packages() -> None:
    message = explain_import_error(
        missing_library("libGL.so.1: cannot open shared object file: No such file or directory")
    )
    assert says(message, "libGL.so.1 ... Debian or Ubuntu ... libgl1 ... libglvnd-glx ... mesa")


def write_module(folder: Path, text: str, monkeypatch: pytest.MonkeyPatch) -> None:
    (folder / "broken_room.py").write_text(text)
    monkeypatch.setenv("PYTHONPATH", str(folder))


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (
            "raise ImportError('libGL.so.1: cannot open shared object file')",
            "broken_room ... libGL.so.1",
        ),
        ("import not_there_at_all", "the Python package not_there_at_all is not installed"),
        ("import os; os._exit(7)", "exit 7"),
        ("raise RuntimeError('no display')", "broken_room ... no display"),
    ],
)
def test_an_import_that_fails_becomes_a_reason(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, text: str, reason: str
) -> None:
    write_module(tmp_path, text, monkeypatch)
    failure = doctor.import_failure("broken_room")
    assert failure is not None
    assert says(failure.reason, reason)


def test_of_imports_tried_together_only_the_one_that_fails_is_blamed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_module(tmp_path, "import os; os._exit(7)", monkeypatch)
    failures = doctor.import_failures(["json", "csv", "broken_room", "math", "zlib"])
    assert [failure is None for failure in failures] == [True, True, False, True, True]


def test_an_import_that_hangs_is_given_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_module(tmp_path, "import time; time.sleep(60)", monkeypatch)
    monkeypatch.setattr(doctor, "PROBE_LIMIT_S", 0.5)
    failure = doctor.import_failure("broken_room")
    assert failure is not None
    assert "0.5 s" in failure.reason


FOLDERS = {
    "cache folder": ("OPTOPAD_CACHE", "warning", "computes everything again"),
    "kernel cache": ("NUMBA_CACHE_DIR", "warning", "compiles the kernels again"),
    "light cache": ("OPTOPAD_CACHE", "warning", "traces all light again"),
    "temporary folder": ("TMPDIR", "missing", "set TMPDIR"),
    "outputs folder": ("", "missing", "pass --out FOLDER"),
}
"""Folders that a run relies on: what names them, what they are where they cannot be written, and the way out."""


def found(name: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> Requirement:
    """The finding on a folder that is put there."""
    if FOLDERS[name][0]:
        monkeypatch.setenv(FOLDERS[name][0], str(folder))
    monkeypatch.setattr(tempfile, "gettempdir", lambda: str(folder))
    (one,) = (finding for finding in doctor.examine(folder) if finding.name == name)
    return one


@pytest.mark.usefixtures("without_imports")
@pytest.mark.parametrize("name", FOLDERS)
def test_every_folder_that_cannot_be_written_is_reported_with_what_is_wrong(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    _, state, way_out = FOLDERS[name]
    (tmp_path / "file").write_text("")
    missing = found(name, tmp_path / "file" / "deep", monkeypatch)
    assert (missing.state, way_out in missing.way_out) == (state, True)
    assert f"{tmp_path / 'file'}" in missing.detail

    def refuse(number: int) -> Any:
        def refused(*_: object, **__: object) -> None:
            raise OSError(number, os.strerror(number))

        return refused

    for number, words in ((errno.EROFS, "it is not writable (Read-only"), (errno.ENOSPC, "its disk is full")):
        monkeypatch.setattr(tempfile, "mkdtemp", refuse(number))
        there = found(name, tmp_path, monkeypatch)
        assert (there.state, words in there.detail, "GB free" in there.detail) == (state, True, False)
        monkeypatch.undo()
        monkeypatch.setattr(doctor, "import_failures", lambda modules: [None] * len(modules))
    assert found(name, tmp_path / "new" / "deep", monkeypatch).state == "ok"
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


NO_HOME = """
import pwd, sys

def unknown(*_):
    raise KeyError("uid not found")

pwd.getpwuid = unknown
from optopad.cli import main
sys.exit(main(sys.argv[1:]))
"""


@pytest.mark.slow
@pytest.mark.parametrize("home", [None, "/dev/null/home"])
def test_a_user_without_a_home_folder_runs_without_caches(tmp_path: Path, home: str | None) -> None:
    hidden = ("HOME", "OPTOPAD_CACHE", "NUMBA_CACHE_DIR", "XDG_CACHE_HOME")
    environment = {name: value for name, value in os.environ.items() if name not in hidden}
    done = subprocess.run(
        [sys.executable, "-c", NO_HOME, "build", "piacenza2017-pair", "--out", str(tmp_path / "out")],
        cwd=tmp_path,
        env=environment | {"PYTHONPATH": str(ROOT)} | ({} if home is None else {"HOME": home}),
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["out"]
    assert list((tmp_path / "out").glob("*/cad/mold.stl"))


def test_the_doctor_imports_nothing_heavy() -> None:
    program = (
        "import optopad.doctor, sys; optopad.doctor.light_finding(); "
        "print(*{'cadquery', 'mujoco', 'numba', 'numpy'} & set(sys.modules))"
    )
    result = subprocess.run(
        [sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert result.stdout.strip() == ""


def test_kept_light_may_be_off_and_its_size_must_be_a_number(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OPTOPAD_LIGHT_CACHE_MB", "0")
    assert doctor.light_finding().detail == "off: OPTOPAD_LIGHT_CACHE_MB is 0"
    monkeypatch.setenv("OPTOPAD_LIGHT_CACHE_MB", "much")
    finding = doctor.light_finding()
    assert finding.state == "missing"
    assert "'much' is refused" in finding.detail
