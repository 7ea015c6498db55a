"""The package as users install it: what is in it, what it leaves alone, what a user's type checker sees."""

from __future__ import annotations

import os
import subprocess
import sys
import sysconfig
import tarfile
import zipfile
from pathlib import Path
from typing import Any

import pytest

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[1]
ROOMS = ("design", "cad", "sims", "fabrication")
BUILD = (sys.executable, "-m", "hatchling", "build")
INSTALL = ("-m", "pip", "install", "-q", "--no-deps", "--no-index", "--no-build-isolation")
BREAKS = "raise SystemExit('a module of the user')\n"


def run(command: list[Any], folder: Path) -> subprocess.CompletedProcess[str]:
    """A command that finds nothing of the checkout by its environment."""
    return subprocess.run(
        [str(word) for word in command],
        cwd=folder,
        env={name: value for name, value in os.environ.items() if name != "PYTHONPATH"},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )


def done(command: list[Any], folder: Path) -> str:
    found = run(command, folder)
    assert found.returncode == 0, found.stdout + found.stderr
    return found.stdout


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the wheel and the source distribution."""
    folder = tmp_path_factory.mktemp("built")
    done([*BUILD, "-d", folder], ROOT)
    return folder


def installed(source: list[Any], folder: Path) -> Path:
    """The programs of a new environment with optopad; its dependencies are those of this environment."""
    done([sys.executable, "-m", "venv", "--without-pip", folder], folder.parent)
    site = next((folder / "lib").glob("python*")) / "site-packages"
    (site / "dependencies.pth").write_text(sysconfig.get_path("purelib") + "\n", encoding="utf-8")
    done([folder / "bin" / "python", *INSTALL, *source], folder.parent)
    return folder / "bin"


@pytest.fixture(scope="module")
def programs(built: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return installed([*built.glob("*.whl")], tmp_path_factory.mktemp("wheel") / "env")


@pytest.fixture(scope="module")
def editable(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """As `make setup` installs it."""
    return installed(["-e", ROOT], tmp_path_factory.mktemp("editable") / "env")


def files_in(wheel: Path) -> dict[str, bytes]:
    with zipfile.ZipFile(wheel) as packed:
        return {name: packed.read(name) for name in packed.namelist() if ".dist-info/" not in name}


def files_of(room: str) -> set[str]:
    paths = (path for path in (ROOT / room).rglob("*") if path.is_file() and "__pycache__" not in path.parts)
    return {path.relative_to(ROOT).as_posix() for path in paths}


def test_the_wheel_holds_every_file_of_the_five_rooms_and_nothing_else(built: Path) -> None:
    (wheel,) = built.glob("*.whl")
    below = {f"optopad/{name}" for room in ROOMS for name in files_of(room)}
    assert set(files_in(wheel)) == below | files_of("optopad")
    assert "optopad/py.typed" in files_in(wheel)


def test_the_source_distribution_makes_the_same_wheel(built: Path, tmp_path: Path) -> None:
    (sources,), (wheel,) = built.glob("*.tar.gz"), built.glob("*.whl")
    with tarfile.open(sources) as packed:
        packed.extractall(tmp_path, filter="data")
    (folder,) = tmp_path.iterdir()
    done([*BUILD, "-t", "wheel", "-d", tmp_path / "again"], folder)
    assert files_in(next((tmp_path / "again").glob("*.whl"))) == files_in(wheel)


def test_the_wheel_leaves_the_names_of_the_folders_free(programs: Path, tmp_path: Path) -> None:
    for room in ROOMS:
        found = run([programs / "python", "-c", f"import optopad.{room}, {room}"], tmp_path)
        assert f"ModuleNotFoundError: No module named '{room}'" in found.stderr


@pytest.mark.parametrize("how", ["programs", "editable"])
def test_modules_of_the_user_disturb_nothing(
    how: str, request: pytest.FixtureRequest, tmp_path: Path
) -> None:
    (tmp_path / "sims").mkdir()
    for name in ("design.py", "cad.py", "fabrication.py", "sims/__init__.py"):
        (tmp_path / name).write_text(BREAKS, encoding="utf-8")
    here = request.getfixturevalue(how)
    program = "import optopad; print(optopad.score(optopad.load('piacenza2017-pair')).verdict)"
    assert "a module of the user" in run([here / "python", "-c", "import design"], tmp_path).stderr
    assert done([here / "python", "-c", program], tmp_path).split()[-1] == "CONTIGUOUS"
    for command in (["optopad"], ["python", "-m", "optopad"]):
        done([here / command[0], *command[1:], "check", "piacenza2017-pair"], tmp_path)
    done([here / "optopad", "build", "piacenza2017-pair", "--out", "made"], tmp_path)


SCRIPT = '''\
"""Thins the pad of the paper until its verdict has no deadband, and writes the design."""

from pathlib import Path

from optopad import check, load, run, save, score
from optopad.design.errors import OptopadError
from optopad.design.spec import SensorDesign
from optopad.screen.bundle import Bundle
from optopad.screen.score import Score


def thinned(design: SensorDesign, step_mm: float) -> SensorDesign:
    return design.with_(**{"cavity.clear_thickness_mm": design.cavity.clear_thickness_mm - step_mm})


def judged(design: SensorDesign) -> Score | None:
    try:
        found = check(design)
        return score(design) if found.ok else None
    except OptopadError as err:
        print(f"{design.name}: {err}")
        return None


def main(folder: Path) -> list[float]:
    design, margins = load("piacenza2017-pair"), list[float]()
    while (found := judged(design)) is not None and found.verdict == "DEADBAND":
        margins.append(found.deadband_mm)
        design = thinned(design, 0.5)
    save(design, folder / "thinned.toml")
    bundle: Bundle = run(design, out=folder)
    print(bundle.folder, bundle.score.verdict)
    return margins


main(Path("outputs"))
'''
WRONG = "score(3)\n"


def test_a_type_checker_knows_the_types_of_the_installed_package(programs: Path, tmp_path: Path) -> None:
    (tmp_path / "script.py").write_text(SCRIPT + WRONG, encoding="utf-8")
    options = ["--strict", "--cache-dir", tmp_path / "cache", "--python-executable", programs / "python"]
    found = run([sys.executable, "-m", "mypy", *options, "script.py"], tmp_path)
    wrong = len(SCRIPT.splitlines()) + 1
    lines = found.stdout.splitlines()
    assert lines[0].startswith(f'script.py:{wrong}: error: Argument 1 to "score" has incompatible type "int"')
    assert lines[1:] == ["Found 1 error in 1 file (checked 1 source file)"]
