"""Findings of the doctor, with libraries, folders and tools taken away."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from optopad import doctor
from optopad.cli import main
from optopad.doctor import INSTALL, Requirement, explain_import_error
from tests.said import says

ROOT = Path(__file__).parents[2]


def missing_library(text: str) -> ImportError:
    return ImportError(text, name="cadquery")


@pytest.fixture(scope="module")
def examined() -> list[Requirement]:
    return doctor.examine()


def test_every_finding_has_a_name_of_its_own_and_a_way_out_where_it_is_not_ok(
    examined: list[Requirement],
) -> None:
    assert len({finding.name for finding in examined}) == len(examined)
    assert [finding for finding in examined if finding.state != "ok" and not finding.way_out] == []


def test_a_bug_report_has_versions_machine_caches_and_compiler(examined: list[Requirement]) -> None:
    found = {finding.name: finding for finding in examined}
    assert {"platform", "processors", "memory", "optopad", "numpy", "cadquery", "pip check", "cache"} <= set(
        found
    )
    assert found["kernels"].state == "ok"


def test_doctor_speaks_json(
    examined: list[Requirement], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(doctor, "examine", lambda: examined)
    assert main(["doctor", "--json"]) == 0
    findings = json.loads(capsys.readouterr().out)["findings"]
    assert [(one["name"], one["detail"]) for one in findings] == [(one.name, one.detail) for one in examined]


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


def test_an_absent_package_is_missing() -> None:
    finding = doctor.version_finding("no-such-package")
    assert finding == Requirement("no-such-package", "missing", "not installed", INSTALL)


def test_what_pip_finds_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    said = "mujoco 3.0 has requirement numpy>=2, but you have numpy 1.26.\n"
    done = subprocess.CompletedProcess([], 1, stdout=said, stderr="")
    monkeypatch.setattr(subprocess, "run", lambda *_, **__: done)
    assert doctor.dependency_finding() == Requirement("pip check", "warning", said.strip(), INSTALL)


FOLDERS = {
    "cache": ("OPTOPAD_CACHE", "computes everything again"),
    "kernels": ("NUMBA_CACHE_DIR", "compiles the kernels again"),
}
FINDINGS = {"cache": doctor.cache_finding, "kernels": doctor.kernel_finding}


@pytest.mark.parametrize("name", FOLDERS)
def test_a_folder_of_stored_data_that_cannot_be_written_is_reported_with_what_is_wrong(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    variable, lost = FOLDERS[name]
    (tmp_path / "file").write_text("")
    monkeypatch.setenv(variable, str(tmp_path / "file" / "deep"))
    missing = FINDINGS[name]()
    assert (missing.state, lost in missing.way_out) == ("warning", True)
    assert (
        f"it does not exist and cannot be made: {tmp_path / 'file'}: a file, not a folder" in missing.detail
    )
    monkeypatch.setenv(variable, str(tmp_path))
    assert (FINDINGS[name]().state, FINDINGS[name]().detail) == ("ok", f"{tmp_path}, 0.0 MB")


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


def test_no_home_folder_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    def no_home(_name: str) -> Path:
        raise RuntimeError("could not determine the home directory")

    for name in ("OPTOPAD_CACHE", "NUMBA_CACHE_DIR"):
        monkeypatch.delenv(name, raising=False)
    for missing in (no_home, lambda _name: Path("~/.cache/optopad")):
        monkeypatch.setattr("platformdirs.user_cache_path", missing)
        for name, finding in FINDINGS.items():
            found = finding()
            assert (found.state, found.detail) == ("warning", "none: this user has no home folder")
            assert found.way_out.startswith("set HOME, or set OPTOPAD_CACHE")
            assert FOLDERS[name][1] in found.way_out


def test_the_cache_folder_can_be_chosen(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OPTOPAD_CACHE", str(tmp_path))
    assert doctor.cache_folder() == tmp_path
    monkeypatch.delenv("OPTOPAD_CACHE")
    assert doctor.cache_folder().name == "optopad"


def test_kernels_are_kept_in_the_cache_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    monkeypatch.setenv("OPTOPAD_CACHE", str(tmp_path))
    assert doctor.kernel_finding() == Requirement("kernels", "ok", f"{tmp_path / 'kernels'}, 0.0 MB")


def test_a_container_limit_below_the_machine_counts(tmp_path: Path) -> None:
    limit = tmp_path / "memory.max"
    limit.write_text("1500000000\n")
    assert doctor.memory_gb(limit) == 1.5
    limit.write_text("max\n")
    assert doctor.memory_gb(limit) == doctor.memory_gb(tmp_path / "absent")


def test_little_memory_is_a_warning(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doctor, "memory_gb", lambda: 1.0)
    assert doctor.memory_finding().state == "warning"


def test_absent_tools_are_warnings_and_any_of_their_commands_will_do(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    assert {doctor.tool_finding(tool).state for tool in doctor.TOOLS} == {"warning"}
    program = tmp_path / "google-chrome"
    program.write_text("#!/bin/sh\n")
    program.chmod(0o755)
    finding = doctor.tool_finding(doctor.TOOLS[-1])
    assert (finding.name, finding.state) == ("chromium", "ok")


def test_the_doctor_imports_nothing_heavy() -> None:
    program = (
        "import optopad.doctor, sys; optopad.doctor.cache_finding(); "
        "print(*{'cadquery', 'mujoco', 'numba', 'numpy'} & set(sys.modules))"
    )
    result = subprocess.run(
        [sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert result.stdout.strip() == ""
