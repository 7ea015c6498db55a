"""The driver in an environment without the packages that design a sensor: `pip install .[driver]`."""

from __future__ import annotations

import subprocess
import venv
from pathlib import Path

import numpy as np
import pytest

from design.preset import preset
from fabrication.driver_config import dump_driver_config
from tests.fabrication.driver.made_up_pad import NAME, untouched

ROOT = Path(__file__).parents[2]
SCRIPT = """
import sys

import optopad
from fabrication.driver.simulated.board import FakeBoard
from fabrication.driver.simulated.port import FakePort
from fabrication.driver.simulated.press_table import untouched_table
from fabrication.driver_file import load_driver_config

config = load_driver_config("driver.toml")
with FakePort(FakeBoard(config, untouched_table(config))) as port, optopad.Sensor(config, port.name) as sensor:
    with sensor.record("a.optorec"):
        frames = list(sensor.frames(count=20))
recorded = optopad.read_recording("a.optorec")
assert len(recorded.sequence) >= 20 and frames[-1].signals.shape == (8, 8), recorded
heavy = {"cadquery", "mujoco", "numba", "pydantic", "scipy", "typer"} & set(sys.modules)
assert not heavy, heavy
print("read", len(frames))
"""


@pytest.mark.slow
def test_the_driver_reads_a_board_with_numpy_and_pyserial_alone(tmp_path: Path) -> None:
    venv.create(tmp_path / "env", with_pip=True)
    python = tmp_path / "env" / "bin" / "python"
    install = [python, "-m", "pip", "install", "-q", "-c", ROOT / "constraints.txt", f"{ROOT}[driver]"]
    subprocess.run(install, check=True, capture_output=True)
    listed = subprocess.run([python, "-m", "pip", "list"], check=True, capture_output=True, text=True).stdout
    assert {line.split()[0].lower() for line in listed.splitlines()[2:]} <= {
        *("numpy", "optopad", "pip", "pyserial", "setuptools")
    }
    (tmp_path / "driver.toml").write_text(
        dump_driver_config(preset(NAME), 1e5, np.minimum(untouched(), 1023)), encoding="utf-8"
    )
    read = subprocess.run(
        [python, "-c", SCRIPT], cwd=tmp_path, capture_output=True, text=True, timeout=60, check=False
    )
    assert read.stdout == "read 20\n", read.stderr
    refused = subprocess.run(
        [tmp_path / "env" / "bin" / "optopad", "check", "piacenza2017-pad"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert refused.returncode == 1
    assert (
        "is not installed; run `make setup`, or `pip install '.[design]'` in the checkout" in refused.stderr
    )
