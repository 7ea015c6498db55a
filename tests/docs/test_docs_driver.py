"""The programs of the pages on the built sensor run as they are written, against a simulated board."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path

import numpy as np
import pytest

from optopad.design.preset import preset
from optopad.fabrication.driver.recording.export import read_recorded
from optopad.fabrication.driver.simulated.board import FakeBoard
from optopad.fabrication.driver.simulated.finger import NO_FINGER, Finger, FingerPath
from optopad.fabrication.driver.simulated.port import FakePort, PtyWire
from optopad.fabrication.driver_config import dump_driver_config
from optopad.fabrication.stage.fake_printer import FakePrinter, TipFinger
from optopad.sims.learning.inference.model_file import save_model
from optopad.sims.readings.dataset import read_data
from tests.fabrication.driver.made_up_model import made_up_model
from tests.fabrication.driver.made_up_pad import board, untouched
from tests.fabrication.driver.two_finger_pad import board_of, two_touch_model

ROOT = Path(__file__).parents[2]
pytestmark = [pytest.mark.slow, pytest.mark.skipif(os.name != "posix", reason="needs pseudo-terminals")]
PAGES = [
    ROOT / "docs" / "how-to" / f"{name}.md"
    for name in ("read-sensor", "record-and-export", "collect-presses", "lerobot")
]
TEXT = "".join(page.read_text(encoding="utf-8") for page in PAGES)
PROGRAMS = re.findall(r"```python\n(.*?)```", TEXT, flags=re.DOTALL)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    text = dump_driver_config(preset("piacenza2017-pad"), [1e5] * 8, np.minimum(untouched(), 1023))
    (tmp_path / "driver.toml").write_text(text, encoding="utf-8")
    return tmp_path


def program(word: str) -> str:
    """The one program of the pages in which a word stands."""
    (found,) = [text for text in PROGRAMS if word in text]
    return found


def run(
    program: str,
    folder: Path,
    path: Finger = NO_FINGER,
    stage: FakePort | None = None,
    made: Callable[[Finger], FakeBoard] = board,
) -> str:
    (folder / "program.py").write_text(program, encoding="utf-8")
    here = os.environ | {"PYTHONPATH": os.pathsep.join([str(ROOT), str(folder)])}
    with FakePort(made(path), PtyWire(folder / "pad")), stage or nullcontext():
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
    assert len(run(program("move the robot here"), folder).splitlines()) == 3
    recorded = read_recorded(folder / "robot.optorec")
    assert recorded.press_mm is not None
    assert set(recorded.press_mm[:, 2]) == {0.0, 0.5, 1.0}


def test_the_plain_program_prints_rate_and_counts(folder: Path) -> None:
    said = run(program("change = "), folder)
    assert re.search(r"LinkCounts\(frames=\d+, lost=0, damaged=0", said)


def test_the_observations_of_a_robot_s_steps_have_every_pair(folder: Path) -> None:
    assert run(program("optopad.Observations"), folder).splitlines()[-3:] == ["(64,) (1,)"] * 3


def test_the_program_that_reads_touches_prints_them(folder: Path) -> None:
    save_model(folder / "pad.optomodel", made_up_model())
    press = np.array([[16.0, 16.0, -5.0]] * 2 + [[12.0, 18.0, 3.0]] * 2)
    finger = FingerPath(time_s=np.array([0.0, 2.0, 2.1, 100.0]), press_mm=press)
    lines = run(program("print(touch)"), folder, finger).splitlines()
    assert len(lines) > 20
    x_mm, y_mm = map(float, re.findall(r"[\d.]+", lines[-1])[:2])
    assert (x_mm, y_mm) == pytest.approx((12.0, 18.0), abs=1.5)  # a small model


def test_the_program_that_reads_two_touches_prints_a_line_for_each(folder: Path) -> None:
    save_model(folder / "two.optomodel", two_touch_model())
    press = np.array(
        [[[11.0, 16.0, -5.0], [21.0, 18.0, -5.0]]] * 2 + [[[11.0, 16.0, 2.0], [21.0, 18.0, 1.0]]] * 2
    )
    fingers = FingerPath(time_s=np.array([0.0, 2.0, 2.1, 100.0]), press_mm=press)
    lines = run(program("touches=2"), folder, fingers, made=board_of).splitlines()
    assert len(lines) > 20
    assert {line.split()[0] for line in lines[-10:]} == {"1", "2"}


def test_the_program_that_collects_presses_leaves_a_data_set(folder: Path) -> None:
    (folder / "presses.csv").write_text("x_mm,y_mm,depth_mm\n14,14,-1\n14,14,1\n20,18,2\n")
    printer = FakePrinter((16.0, 16.0, 0.0))
    text = program("GcodeStage").replace('"bench-pad"', '"pad"')
    said = run(text, folder, TipFinger(printer), FakePort(printer, PtyWire(folder / "stage")))
    assert "kept=2, wanted=2, frames=3" in said
    assert read_data(folder / "program.nc").press_mm[-1] == pytest.approx([20, 18, 2], abs=0.02)
