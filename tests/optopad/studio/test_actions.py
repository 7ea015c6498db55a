"""What the buttons start: told step by step, ended at once, and a word where nothing comes of it."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from optopad.design.mold.outline import outline_of
from optopad.design.preset import preset
from optopad.studio import actions
from optopad.studio.actions import Ghost, MoldShop, Task
from optopad.studio.session import Said

PAIR = preset("piacenza2017-pair")
SOON_S = 20.0


def program(text: str) -> Callable[..., subprocess.Popen[str]]:
    """Stands in for optopad: a program that is given the same arguments."""

    def start(arguments: list[str]) -> subprocess.Popen[str]:
        return subprocess.Popen(
            [sys.executable, "-c", text, *arguments],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
        )

    return start


def until(said: list[Said], words: str) -> Said:
    """The first sentence with some words in it."""
    end = time.monotonic() + SOON_S
    while time.monotonic() < end:
        for one in list(said):
            if words in one.text:
                return one
        time.sleep(0.01)
    raise AssertionError(f"{words!r} in none of {said}")


IMPROVE = """
import json, sys, pathlib
folder = pathlib.Path(sys.argv[-1]) / "improve-piacenza2017-pair-12345678"
folder.mkdir(parents=True)
print("optopad: 3 designs tried", file=sys.stderr)
changes = {"receivers.height_mm": 6.5}
(folder / "improve.json").write_text(json.dumps({"alternatives": [{"kind": "fewest changes", "changes": changes}]}))
"""


def test_improve_tells_its_progress_and_gives_its_alternatives_as_designs(
    tmp_path: Path, monkeypatch
) -> None:
    monkeypatch.setattr(actions, "started", program(IMPROVE))
    said: list[Said] = []
    found: list[tuple[Ghost, ...]] = []
    assert Task(tmp_path, said.append).improve(PAIR, found.append)
    until(said, "1 verified alternative, in")
    assert "improve: 3 designs tried" in [one.text for one in said]
    assert [ghost.design.receivers.height_mm for ghost in found[0]] == [6.5]
    assert found[0][0].kind == "fewest changes"


def test_one_at_a_time_and_what_runs_is_ended_within_seconds(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr(actions, "started", program("import time; time.sleep(60)"))
    said: list[Said] = []
    task = Task(tmp_path, said.append)
    assert task.build(PAIR, lambda _folder: None)
    assert not task.improve(PAIR, lambda _ghosts: None)
    assert task.is_running
    began = time.monotonic()
    task.end()
    assert time.monotonic() - began < 3.0
    until(said, "run: ended")
    assert not task.is_running


@pytest.mark.slow
def test_the_mold_is_the_printed_one_in_the_frame_of_the_cavity() -> None:
    made: dict[str, object] = {}
    ready = threading.Event()
    shop = MoldShop(lambda digest, found: (made.update({digest: found}), ready.set()))
    shop.want(PAIR.with_(**{"mold.rim_mm": 2.0}))  # a newer design ends it
    shop.want(PAIR)
    assert ready.wait(60.0)
    mesh, outline = made[PAIR.digest], outline_of(PAIR)
    assert list(made) == [PAIR.digest]
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    assert low[:2] == pytest.approx([-outline.wall_x_mm, -outline.wall_y_mm], abs=0.01)
    assert low[2] == pytest.approx(outline.bottom_mm, abs=0.01)
    assert high[2] >= outline.top_mm - 0.01


def test_a_result_of_another_time_is_not_taken_for_this_one(tmp_path: Path, monkeypatch) -> None:
    former = tmp_path / "improve-piacenza2017-pair-00000000" / "improve.json"
    former.parent.mkdir()
    former.write_text(json.dumps({"alternatives": []}), encoding="utf-8")
    os.utime(former, (1e9, 1e9))
    monkeypatch.setattr(actions, "started", program(""))
    said: list[Said] = []
    Task(tmp_path, said.append).improve(PAIR, lambda _ghosts: pytest.fail("nothing was found"))
    assert until(said, "its result cannot be read").is_bad
