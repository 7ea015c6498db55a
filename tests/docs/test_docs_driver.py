"""The programs of docs/driver.md run as they are written, against a simulated board."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from design.preset import preset
from fabrication.driver.export import read_recorded
from fabrication.driver.fake_port import FakePort, PtyWire
from fabrication.driver_config import dump_driver_config
from tests.fabrication.driver.made_up_pad import board, untouched

ROOT = Path(__file__).parents[2]
pytestmark = [pytest.mark.slow, pytest.mark.skipif(os.name != "posix", reason="needs pseudo-terminals")]
PAGE = (ROOT / "docs" / "driver.md").read_text(encoding="utf-8")
PROGRAMS = re.findall(r"```python\n(.*?)```", PAGE, flags=re.DOTALL)
ROS = """
import sys
MESSAGES = []

class Float32MultiArray:
    def __init__(self):
        self.layout, self.data = type("Layout", (), {"dim": []})(), []

class MultiArrayDimension:
    def __init__(self, label, size, stride):
        self.label, self.size, self.stride = label, size, stride

class Publisher:
    def publish(self, message):
        MESSAGES.append((len(message.data), [d.size for d in message.layout.dim]))

class Node:
    def create_publisher(self, kind, topic, depth):
        return Publisher()
    def destroy_node(self):
        print(len(MESSAGES), set((length, *sizes) for length, sizes in MESSAGES))

def init(): pass
def create_node(name): return Node()
def ok(): return len(MESSAGES) < 5
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    text = dump_driver_config(preset("piacenza2017-pad"), [1e5] * 8, np.minimum(untouched(), 1023))
    (tmp_path / "driver.toml").write_text(text, encoding="utf-8")
    (tmp_path / "rclpy.py").write_text(ROS, encoding="utf-8")
    (tmp_path / "std_msgs").mkdir()
    (tmp_path / "std_msgs" / "__init__.py").write_text("", encoding="utf-8")
    (tmp_path / "std_msgs" / "msg.py").write_text(
        "from rclpy import Float32MultiArray, MultiArrayDimension\n", encoding="utf-8"
    )
    return tmp_path


def run(program: str, folder: Path) -> str:
    (folder / "program.py").write_text(program, encoding="utf-8")
    here = os.environ | {"PYTHONPATH": os.pathsep.join([str(ROOT), str(folder)])}
    with FakePort(board(), PtyWire(folder / "pad")):
        done = subprocess.run(
            [sys.executable, "program.py"],
            cwd=folder,
            env=here,
            capture_output=True,
            text=True,
            timeout=60,
            check=False,
        )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_program_that_moves_an_indenter_records_its_presses(folder: Path) -> None:
    assert len(run(PROGRAMS[0], folder).splitlines()) == 3
    recorded = read_recorded(folder / "robot.optorec")
    assert recorded.press_mm is not None
    assert set(recorded.press_mm[:, 2]) == {0.0, 0.5, 1.0}


def test_the_plain_program_prints_rate_and_counts(folder: Path) -> None:
    said = run(PROGRAMS[1], folder)
    assert re.search(r"LinkCounts\(frames=\d+, lost=0, damaged=0", said)


def test_the_node_publishes_what_its_layout_says(folder: Path) -> None:
    assert run(PROGRAMS[2], folder).strip() == "5 {(64, 8, 8)}"
