"""The driver without the packages that design a sensor: in an environment of its own, and for ROS 2."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import venv
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from optopad.design.preset import preset
from optopad.fabrication.driver_config import dump_driver_config
from optopad.sims.learning.inference.extra_trees import ExtraTreesModel, Forest
from optopad.sims.learning.inference.model_file import KINDS, save_model
from optopad.sims.learning.inference.touch_model import UNIT_SIGMA
from tests.fabrication.driver.made_up_model import header, made_up_model, readings
from tests.fabrication.driver.made_up_pad import NAME, untouched
from tests.sims.learning.made_up_map import made_up_map_model, made_up_noise, noisy_signals, random_presses

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "how-to" / "ros2.md"
PROGRAM = ROOT / "tests" / "optopad" / "robot_program.py"
SYSTEMS = {"humble": ("3.10", "1.21.5"), "jazzy": ("3.12", "1.26.4")}
"""Python and NumPy of the Ubuntu of a ROS distribution."""


def run(command: list[Any], folder: Path, **variables: str) -> subprocess.CompletedProcess[str]:
    """A command with its output. pip compiles nothing: most of what it installs is never imported."""
    return subprocess.run(
        [str(word) for word in command],
        cwd=folder,
        env=os.environ | {"PIP_NO_COMPILE": "1", "PIP_DISABLE_PIP_VERSION_CHECK": "1"} | variables,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )


def models() -> dict[str, Any]:
    """One model of each kind, made up."""
    ridge = made_up_model()
    common: dict[str, Any] = {"touch": ridge.touch, "scaling": ridge.scaling, "sigma": UNIT_SIGMA}
    forest = Forest(
        roots=np.zeros(1, np.int32),
        feature=np.array([9, -1, -1], np.int16),
        threshold=np.full(3, -1.0, np.float32),
        other=np.array([2, 0, 1], np.int32),
        leaf_mm=np.array([[9.0, 8.0, 1.0], [20.0, 11.0, 3.0]], np.float32),
    )
    return {
        "kernel-ridge": ridge,
        "extra-trees": ExtraTreesModel(header=header(kind="extra-trees"), forest=forest, **common),
        "signal-map": made_up_map_model(),
    }


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the files that the program reads."""
    folder = tmp_path_factory.mktemp("bench")
    text = dump_driver_config(preset(NAME), 1e5, np.minimum(untouched(), 1023))
    (folder / "driver.toml").write_text(text, encoding="utf-8")
    presses = random_presses(9, seed=4)
    np.save(folder / "pad.npy", readings(presses))
    np.save(folder / "map.npy", noisy_signals(presses, made_up_noise(), seed=6))
    made = models()
    assert set(made) == set(KINDS)
    for kind, model in made.items():
        signals = np.load(folder / ("map.npy" if kind == "signal-map" else "pad.npy"))
        save_model(folder / f"{kind}.optomodel", model)
        np.save(folder / f"{kind}.predicted.npy", model.predict(signals).press_mm)
    return folder


@pytest.mark.slow
def test_the_driver_reads_a_board_with_numpy_and_pyserial_alone(bench: Path, tmp_path: Path) -> None:
    venv.create(tmp_path / "env", with_pip=True)
    python = tmp_path / "env" / "bin" / "python"
    install = [python, "-m", "pip", "install", "-q", "-c", ROOT / "constraints.txt", f"{ROOT}[driver]"]
    assert run(install, tmp_path).returncode == 0
    listed = run([python, "-m", "pip", "list"], tmp_path).stdout
    assert {line.split()[0].lower() for line in listed.splitlines()[2:]} <= {
        *("numpy", "optopad", "pip", "pyserial", "setuptools")
    }
    read = run([python, PROGRAM, tmp_path / "a.optorec"], bench)
    assert read.returncode == 0, read.stderr
    refused = run([tmp_path / "env" / "bin" / "optopad", "check", NAME], tmp_path)
    assert refused.returncode == 1
    assert (
        "is not installed; run `make setup`, or `pip install '.[design]'` in the checkout" in refused.stderr
    )


@pytest.mark.slow
@pytest.mark.parametrize("distribution", SYSTEMS)
def test_the_page_on_ros_installs_the_driver_with_the_system_s_numpy(
    distribution: str, bench: Path, tmp_path: Path
) -> None:
    version, numpy = SYSTEMS[distribution]
    system = system_python(tmp_path / "system", version, numpy)
    installed = run(
        ["bash", "-euc", commands_of_page("Install the driver for ROS")],
        ROOT,
        HOME=str(tmp_path),
        PATH=f"{system}:/usr/bin:/bin",
        PYTHONPATH="",
        **pip_s_folders(),
    )
    assert installed.returncode == 0, installed.stderr
    assert {path.name for path in (tmp_path / "ros2_ws" / "src").iterdir()} == {"optopad_msgs", "optopad_ros"}
    environment = tmp_path / "optopad-venv" / "bin"
    node = tmp_path / "ros2_ws" / "src" / "optopad_ros"
    assert run([environment / "python", "-m", "compileall", "-q", node], tmp_path).returncode == 0
    read = run([environment / "python", PROGRAM, tmp_path / "a.optorec", tmp_path / "a.mcap"], bench)
    assert read.returncode == 0, read.stderr
    assert read.stdout.startswith(f"numpy {numpy} {tmp_path / 'system'}/"), read.stdout
    if version == "3.10":
        refused = run([environment / "optopad", "check", NAME], tmp_path)
        assert (refused.returncode, "need Python 3.11 to 3.13" in refused.stderr) == (2, True)


def pip_s_folders() -> dict[str, str]:
    """Where pip has its settings and its cache, for commands with another home."""
    kept = {"XDG_CONFIG_HOME": ".config", "XDG_CACHE_HOME": ".cache"}
    return {name: os.environ.get(name) or str(Path.home() / folder) for name, folder in kept.items()}


def commands_of_page(heading: str) -> str:
    """Lines of the shell below a heading of the page."""
    section = PAGE.read_text(encoding="utf-8").partition(f"## {heading}\n")[2].partition("\n## ")[0]
    return "\n".join(re.findall(r"```sh\n(.*?)```", section, flags=re.DOTALL))


def system_python(folder: Path, version: str, numpy: str) -> Path:
    """The folder of the programs of a Python with this NumPy, as an Ubuntu has one; what is there is linked.

    Skips the test where this machine has no such Python.
    """
    interpreter = interpreter_of(version)
    ask = "import os, sys, sysconfig; print(sysconfig.get_path('stdlib'), os.path.realpath(sys._base_executable))"
    library, program = run([interpreter, "-c", ask], Path("/")).stdout.split()
    programs, modules = folder / "bin", folder / "lib" / f"python{version}"
    programs.mkdir(parents=True)
    modules.mkdir(parents=True)
    for one in Path(library).iterdir():
        if one.name not in {"site-packages", "dist-packages", "EXTERNALLY-MANAGED"}:
            (modules / one.name).symlink_to(one)
    shutil.copy(program, programs / f"python{version}")
    (programs / "python3").symlink_to(f"python{version}")
    prefix = run([programs / "python3", "-c", "import sys; print(sys.prefix)"], folder).stdout.strip()
    if prefix != str(folder):
        pytest.skip(f"{interpreter} does not run from another folder")
    pip = [sys.executable, "-m", "pip", "--python", programs / "python3"]
    done = run([*pip, "install", "-q", "--only-binary=:all:", f"numpy=={numpy}"], folder)
    assert done.returncode == 0, done.stderr
    return programs


def interpreter_of(version: str) -> str:
    """A Python of this version that makes environments: on the path, or installed next to the one of this run."""
    beside = sorted(Path(sys.base_prefix).parent.glob(f"*/bin/python{version}"))
    for candidate in filter(None, (*map(str, beside), shutil.which(f"python{version}"))):
        if run([candidate, "-c", "import ensurepip, venv"], Path("/")).returncode == 0:
            return candidate
    pytest.skip(f"no Python {version} with venv on this machine")
