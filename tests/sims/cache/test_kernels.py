"""Compiled kernels on disk: found again by any process with the same sources, compiled once at a time."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from optopad.sims import kernels

PROGRAM = """
import sys
from numba.core import event
from {name} import module

class Listener(event.Listener):
    def on_start(self, _event):
        print("compiled")
    def on_end(self, _event):
        pass

event.register("numba:compile", Listener())
print(module.{function}(2.0))
"""
MODULE = """
import sys
from optopad.sims.kernels import entry_points

@entry_points([sys.modules[__name__]])
def twice(x):
    return {factor} * x

@entry_points([sys.modules[__name__]])
def thrice(x):
    return 3.0 * x

if __name__ == "__main__":
    from rooms import module
    module.thrice(1.0)
"""
BESIDE = """
import time
from pathlib import Path
from rooms import module
from optopad.sims.kernels import compile_beside

for _ in range(2):
    compile_beside("rooms.module", module.thrice)
began = time.monotonic()
while not (there := list(Path({kept!r}).rglob("*thrice*.nbi"))) and time.monotonic() < began + {patience}:
    time.sleep(0.005)
print(len(there))
"""


class Sources:
    """A package in a folder of its own, and the kernels that its processes share."""

    def __init__(self, folder: Path, kept: Path, factor: float = 2.0) -> None:
        self.room = folder / "rooms"
        self.room.mkdir(parents=True)
        (self.room / "module.py").write_text(MODULE.format(factor=factor))
        paths = [str(folder), str(Path(__file__).parents[3])]
        self.environment = os.environ | {
            "PYTHONPATH": os.pathsep.join(paths),
            "NUMBA_CACHE_DIR": str(kept),
        }

    def begin(self, program: str = PROGRAM.format(name="rooms", function="twice")) -> subprocess.Popen[str]:
        return subprocess.Popen(
            [sys.executable, "-c", program], env=self.environment, stdout=subprocess.PIPE, text=True
        )

    def run(self, *program: str) -> list[str]:
        return self.begin(*program).communicate()[0].split()


@pytest.mark.slow
def test_another_checkout_with_the_same_sources_compiles_nothing(tmp_path: Path) -> None:
    kept = tmp_path / "kept"
    assert Sources(tmp_path / "one", kept).run() == ["compiled", "4.0"]
    assert Sources(tmp_path / "another", kept).run() == ["4.0"]
    assert Sources(tmp_path / "changed", kept, factor=5.0).run() == ["compiled", "10.0"]


def test_of_two_processes_one_compiles(tmp_path: Path) -> None:
    sources = Sources(tmp_path / "one", tmp_path / "kept")
    both = [sources.begin(), sources.begin()]
    said = sorted(one.communicate()[0].split() for one in both)
    assert said in ([["4.0"], ["compiled", "4.0"]],)


@pytest.mark.slow
def test_another_program_compiles_beside_what_is_not_there(tmp_path: Path) -> None:
    sources = Sources(tmp_path / "one", tmp_path / "kept")
    assert sources.run(BESIDE.format(kept=str(tmp_path / "kept"), patience=60.0)) == ["1"]
    assert sources.run(PROGRAM.format(name="rooms", function="thrice")) == ["6.0"]


def test_a_folder_that_cannot_be_written_costs_compiling_alone(tmp_path: Path) -> None:
    (tmp_path / "kept").write_text("a file, no folder")
    sources = Sources(tmp_path / "one", tmp_path / "kept")
    assert sources.run() == ["compiled", "4.0"]


def test_kernels_of_old_sources_make_room(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kernels, "KEPT_FOLDERS", 3)
    for age in range(5):
        folder = tmp_path / f"compiled-{age}"
        folder.mkdir()
        os.utime(folder, (1e9 - age, 1e9 - age))
    kernels._make_room(tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["compiled-0", "compiled-1"]
